//! The lights of a world. They are gathered while it is put together; this stage says whether they changed.

use super::super::cache::Memo;
use super::accel::Ingredients;
use super::{Staged, keys};
use crate::world::World;

/// How the lights stand.
pub(in crate::pipeline) fn lights(from: &Ingredients<'_>, world: &World, memo: &mut Memo<()>) -> Staged<()> {
    let key = keys::lights(from.scene, &from.mesh_keys());
    let same = memo.get(key).is_some();
    memo.set(key, ());
    match world.light_count() {
        0 => Staged::skipped((), "the scene has no light"),
        _ if same => Staged::reused((), "no light changed"),
        1 => Staged::done((), "1 light"),
        count => Staged::done((), format!("{count} lights")),
    }
}
