//! Warnings about lights that are coplanar with other surfaces.

use super::super::cache::Memo;
use super::super::keys;
use super::Findings;
use super::meshes::Meshes;
use crate::assets::LoadedMesh;
use crate::math::DVec3;
use crate::scene::LoadedScene;
use crate::scene::description::Object;
use crate::scene::diagnostic::Severity;
use crate::scene::fingerprint::Key;
use crate::world::{CoplanarLight, coplanar_lights};

/// Maximum number of lights to warn about.
const MAX_WARNINGS: usize = 10;

/// Warns about lights that are moved off the plane of another surface. Reuses the previous search result if
/// shapes and lights are unchanged.
pub(crate) fn warn_about_coplanar_lights(
    loaded: &LoadedScene,
    meshes: &Meshes,
    memo: &mut Memo<Vec<CoplanarLight>>,
    findings: &mut Findings,
) {
    let scene = &loaded.scene;
    let mesh_keys: Vec<Key> = meshes.iter().map(|mesh| mesh.key).collect();
    let key = keys::coplanar(scene, &keys::referents(scene, &mesh_keys, None));
    let found = memo.get(key).cloned().unwrap_or_else(|| {
        let files: Vec<&LoadedMesh> = meshes.iter().map(|mesh| &*mesh.mesh).collect();
        coplanar_lights(scene, &files, DVec3::ZERO)
    });
    let named = |number: usize| {
        let Object { shape, name, span, .. } = &scene.objects[number];
        let name = name.as_deref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
        format!("the {}{name} on line {}", shape.kind(), loaded.line(span))
    };
    for of_light in found.chunk_by(|a, b| a.light == b.light).take(MAX_WARNINGS) {
        let [CoplanarLight { light, surface, .. }, others @ ..] = of_light else { continue };
        let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
        let other = if surface == light { "other faces of its mesh".to_owned() } else { named(*surface) };
        let message = format!("this light is in the plane of {other}{more}");
        let help =
            "glimt renders it slightly in front of the plane; move it off the plane to choose the distance";
        let span = scene.objects[*light].span.clone();
        findings.warnings.push(loaded.diagnostic_at(span, Severity::Warning, message, Some(help.to_owned())));
    }
    memo.set(key, found);
}
