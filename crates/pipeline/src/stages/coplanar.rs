//! Warnings about lights that are coplanar with other surfaces or overlap other lights.

use super::super::cache::Memo;
use super::super::keys;
use super::Findings;
use super::meshes::MeshesByFileIndex;
use super::parse::ParsedScene;
use crate::assets::LoadedMesh;
use crate::scene::description::Object;
use crate::scene::diagnostic::Severity;
use crate::scene::fingerprint::Fingerprint;
use crate::world::{self, CoplanarLight, find_coplanar_lights};

/// Maximum number of lights to warn about for each kind of overlap.
const MAX_WARNINGS: usize = 10;

/// Warns about lights that are moved because they are coplanar with another surface, and about lights that
/// overlap. Reuses the previous search result if shapes and lights are unchanged.
pub(crate) fn warn_about_coplanar_lights(
    parsed: &ParsedScene,
    meshes: &MeshesByFileIndex,
    memo: &mut Memo<Vec<CoplanarLight>>,
    findings: &mut Findings,
) {
    let loaded = &parsed.loaded;
    let scene = &loaded.scene;
    let origin = world::choose_origin_near_camera_target(&scene.camera, parsed.orbiter.as_ref());
    let mesh_keys: Vec<Fingerprint> = meshes.iter().map(|mesh| mesh.key).collect();
    let key = keys::key_with_coordinate_origin(
        &keys::coplanar_lights_key(scene, &keys::scene_fingerprint_references(scene, &mesh_keys, None)),
        origin,
    );
    let found = memo.get(key).cloned().unwrap_or_else(|| {
        let files: Vec<&LoadedMesh> = meshes.iter().map(|mesh| &*mesh.mesh).collect();
        find_coplanar_lights(scene, &files, origin)
    });
    let named = |number: usize| {
        let Object { shape, name, span, .. } = &scene.objects[number];
        let name = name.as_deref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
        let line = loaded.line_number(span).map_or(String::new(), |line| format!(" on line {line}"));
        format!("the {}{name}{line}", shape.kind())
    };
    let (lifted, doubled): (Vec<_>, Vec<_>) = found.iter().partition(|pair| pair.lift.is_some());
    let mut warn = |pairs: &[&CoplanarLight], describe: &dyn Fn(usize, usize, &str) -> String, help: &str| {
        let mut is_first_copy = scene.first_copy_filter();
        let by_light = pairs.chunk_by(|a, b| a.light == b.light);
        for of_light in by_light.filter(|pairs| is_first_copy(pairs[0].light)).take(MAX_WARNINGS) {
            let [CoplanarLight { light, surface, .. }, others @ ..] = of_light else { continue };
            let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
            let message = describe(*light, *surface, &more);
            let span = scene.objects[*light].span.clone();
            let warning =
                loaded.create_diagnostic_at(span, Severity::Warning, message, Some(help.to_owned()));
            findings.warnings.push(warning);
        }
    };
    let in_plane = |light, surface, more: &str| {
        let other = if surface == light { "other faces of its mesh".to_owned() } else { named(surface) };
        format!("this light is in the plane of {other}{more}")
    };
    let help =
        "glimt renders it slightly in front of the plane; move it off the plane to choose the distance";
    warn(&lifted, &in_plane, help);
    let overlap = |light, surface, more: &str| {
        let both = if surface == light { "faces of ".to_owned() } else { "this light and ".to_owned() };
        let both = both + &named(surface) + more;
        format!("{both} overlap: their light counts twice there, but only one of them is visible")
    };
    warn(&doubled, &overlap, "remove the duplicate, or move one off the plane of the other");
    memo.set(key, found);
}
