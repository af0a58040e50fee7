//! The bodies of glass: which of its surfaces are one, and which have holes.

use std::sync::Arc;

use super::super::cache::Memo;
use super::super::keys;
use super::meshes::Meshes;
use super::{Findings, Stop};
use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::scene::Loaded;
use crate::scene::description::Shape;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::Key;
use crate::world::{Bodies, OpenGlass};

/// What a picture lacks where glass is open, under the place of the object.
const LACKS: &str = "glass refracts where a ray goes in and where it comes out; no ray that comes through the hole \
                     is refracted or tinted";

/// Finds the bodies, unless shapes and materials are as they were; warns about those that are open.
///
/// # Errors
/// Cancelled.
pub(in crate::pipeline) fn glass(
    loaded: &Loaded,
    meshes: &Meshes,
    memo: &mut Memo<Arc<Bodies>>,
    findings: &mut Findings,
    token: &CancelToken,
) -> Result<Arc<Bodies>, Stop> {
    let scene = &loaded.scene;
    let mesh_keys: Vec<Key> = meshes.iter().map(|mesh| mesh.key).collect();
    let key = keys::glass(scene, &keys::referents(scene, &mesh_keys, None));
    let bodies = if let Some(bodies) = memo.get(key) {
        Arc::clone(bodies)
    } else {
        let files: Vec<&LoadedMesh> = meshes.iter().map(|mesh| &*mesh.mesh).collect();
        Arc::new(Bodies::find(scene, &files, token)?)
    };
    memo.set(key, Arc::clone(&bodies));
    findings.warnings.extend(bodies.open().iter().filter_map(|open| warning(loaded, open)));
    Ok(bodies)
}

/// What is said of glass with a hole; `None` if opaque surfaces are around the hole.
fn warning(loaded: &Loaded, open: &OpenGlass) -> Option<Diagnostic> {
    if open.is_covered {
        return None;
    }
    let object = &loaded.scene.objects[open.object as usize];
    let edges = if open.edges == 1 { "1 edge".to_owned() } else { format!("{} edges", open.edges) };
    let (what, help) = match object.shape {
        Shape::Quad { .. } => ("a quad", "use a thin [[box]] for a pane, or close it by other glass"),
        Shape::Triangle { .. } => ("a triangle", "use a [[box]], or a closed [[mesh]]"),
        Shape::Disk { .. } => ("a disk", "use a flat [[cylinder]] for a round pane"),
        Shape::Cylinder { .. } => ("an open cylinder", "close it by `caps = true`"),
        Shape::Cone { .. } => ("an open cone", "close it by `cap = true`"),
        Shape::Sphere { .. } | Shape::Plane { .. } | Shape::Box { .. } | Shape::Torus { .. } => return None,
        Shape::Mesh(_) => ("", "close the mesh in the program that made it, or give a pane a thickness"),
    };
    let (mut message, mut help) = (format!("{what} of glass has no inside"), help);
    if object.shape.mesh().is_some() {
        let name = object.name.as_deref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
        message = if open.disagrees {
            help = "let its normals be recalculated, all outwards, in the program that made it";
            format!("mesh{name} of glass is inside out in parts: {edges} between two fronts and backs")
        } else {
            let part = percent(open.missing);
            format!(
                "mesh{name} of glass is not closed: {edges} without a neighbour, {part} of its surface missing"
            )
        };
    }
    let help = Some(help.to_owned());
    let mut diagnostic = loaded.diagnostic_at(object.span.clone(), Severity::Warning, message, help);
    if let Some(place) = &mut diagnostic.place {
        place.label = LACKS.to_owned();
    }
    Some(diagnostic)
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        percent if percent < 0.1 => "less than 0.1 %".to_owned(),
        percent if percent < 9.95 => format!("{percent:.1} %"),
        percent => format!("{percent:.0} %"),
    }
}
