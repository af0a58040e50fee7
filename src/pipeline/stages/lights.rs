//! The lights of a scene, gathered anew when one of them changed.

use std::sync::Arc;

use super::super::cache::Memo;
use super::{Staged, keys};
use crate::lights::Lights;
use crate::scene::description::Scene;
use crate::scene::fingerprint::Referents;
use crate::world::{self, Geometry};

/// Gather them.
pub(in crate::pipeline) fn lights(
    scene: &Scene,
    of: &Referents<'_>,
    geometry: &Geometry,
    memo: &mut Memo<Arc<Lights>>,
) -> Staged<Arc<Lights>> {
    let key = keys::lights(scene, of, geometry.origin());
    if let Some(lights) = memo.get(key).filter(|lights| !lights.is_empty()) {
        return Staged::reused(lights.clone(), "no light changed");
    }
    let lights = world::lights(scene, geometry);
    memo.set(key, lights.clone());
    match lights.len() {
        0 => Staged::skipped(lights, "the scene has no light"),
        1 => Staged::done(lights, "1 light"),
        count => Staged::done(lights, format!("{count} lights")),
    }
}
