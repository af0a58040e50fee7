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

/// Flaw of the picture where glass is open, under the place of the object.
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
    findings.warnings.extend(bodies.flat().iter().map(|&object| warning_of_flat(loaded, object)));
    Ok(bodies)
}

/// The warning about glass with a hole. `None` if opaque surfaces are around the hole.
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
                "mesh{name} of glass is not closed: {edges} without a neighbour of the same glass, {part} of its surface missing"
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

/// The warning about a closed body that encloses nothing.
fn warning_of_flat(loaded: &Loaded, object: u32) -> Diagnostic {
    let object = &loaded.scene.objects[object as usize];
    let name = object.name.as_deref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
    let message = format!("glass{name} encloses nothing: its faces are there twice, facing both ways");
    let help = "export each face once, facing outwards (not double-sided)".to_owned();
    let mut diagnostic = loaded.diagnostic_at(object.span.clone(), Severity::Warning, message, Some(help));
    if let Some(place) = &mut diagnostic.place {
        place.label = "rays that come in stay inside: all behind it is tinted".to_owned();
    }
    diagnostic
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        percent if percent < 0.1 => "less than 0.1 %".to_owned(),
        percent if percent < 9.95 => format!("{percent:.1} %"),
        percent => format!("{percent:.0} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::pipeline::stages::meshes::KeptMesh;
    use crate::scene::fingerprint::Fingerprint;

    /// The warnings of a scene whose mesh files are this one.
    fn warnings(text: &str, material: &str, mesh: Option<LoadedMesh>) -> Vec<Diagnostic> {
        let text = format!(
            "[materials.a]\ntype = '{material}'\n{text}\n[render]\nambient = [1, 1, 1]\n[camera]\nposition = [0, 1, 4]\n\
             look_at = [0, 1, 0]\n"
        );
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, &text).expect("written");
        std::fs::write(folder.path().join("a.ply"), "").expect("written");
        let loaded = crate::scene::load(&path, &[]).expect("a scene that is right");
        let mut findings = Findings::default();
        let meshes: Meshes = mesh
            .into_iter()
            .map(|mesh| {
                let key = Fingerprint::new("test").finish();
                Arc::new(KeptMesh::new(Arc::new(mesh), key, Vec::new()))
            })
            .collect();
        let token = CancelToken::new();
        let found = glass(&loaded, &meshes, &mut Memo::default(), &mut findings, &token);
        assert!(found.is_ok(), "{text}");
        let is_right = |one: &Diagnostic| {
            let place = one.place.as_ref().map(|place| &place.source[place.span.clone()]);
            one.help.is_some() && place.is_some_and(|place| place.starts_with("[["))
        };
        assert!(findings.warnings.iter().all(is_right), "{:?}", findings.warnings);
        findings.warnings
    }

    fn messages(text: &str, material: &str, mesh: Option<LoadedMesh>) -> Vec<String> {
        warnings(text, material, mesh).into_iter().map(|one| one.message).collect()
    }

    #[test]
    fn shapes_without_an_inside_are_warned_about() {
        for (shape, expected) in [
            ("[[quad]]\ncorner = [0, 0, 0]\nu = [1, 0, 0]\nv = [0, 1, 0]", "a quad of glass has no inside"),
            (
                "[[triangle]]\na = [0, 0, 0]\nb = [1, 0, 0]\nc = [0, 1, 0]",
                "a triangle of glass has no inside",
            ),
            ("[[disk]]", "a disk of glass has no inside"),
            ("[[cylinder]]\ncaps = false", "an open cylinder of glass has no inside"),
            ("[[cone]]\ncap = false", "an open cone of glass has no inside"),
        ] {
            let shape = format!("{shape}\nmaterial = 'a'");
            assert_eq!(messages(&shape, "glass", None), [expected]);
            assert_eq!(messages(&shape, "phong", None), [""; 0], "{shape} that is not of glass");
        }
        for closed in [
            "[[cylinder]]",
            "[[cone]]",
            "[[torus]]",
            "[[sphere]]\ncenter = [0, 0, 0]\nradius = 1",
            "[[box]]",
            "[[plane]]",
            "[[disk]]\nmaterial = 'a'\n[[cone]]\ncap = false",
        ] {
            assert_eq!(messages(&format!("{closed}\nmaterial = 'a'"), "glass", None), [""; 0], "{closed}");
        }
    }

    #[test]
    fn a_mesh_with_a_hole_is_named_and_said_how_large_the_hole_is() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let all = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let of = |triangles: &[[u32; 3]]| {
            let mut loaded = LoadedMesh::default();
            loaded.mesh.positions = positions.clone();
            loaded.mesh.triangles = triangles.to_vec();
            Some(loaded)
        };
        let text = "[[mesh]]\nname = 'drop'\nfile = 'a.ply'\nmaterial = 'a'";
        assert_eq!(messages(text, "glass", of(&all)), [""; 0]);
        // Half an area of 1 of half an area of 3 + √3.
        let open = "mesh \"drop\" of glass is not closed: 3 edges without a neighbour of the same glass, 27 % of its surface missing";
        assert_eq!(messages(text, "glass", of(&all[1..])), [open]);
        assert_eq!(messages(text, "phong", of(&all[1..])), [""; 0]);
        // One of them looks inwards.
        let odd = [[0, 1, 2], all[1], all[2], all[3]];
        let odd = &messages(text, "glass", of(&odd))[..];
        assert_eq!(
            odd,
            ["mesh \"drop\" of glass is inside out in parts: 6 edges between two fronts and backs"]
        );
        // Each face twice, facing both ways.
        let both: Vec<_> = all.iter().flat_map(|&[a, b, c]| [[a, b, c], [a, c, b]]).collect();
        let twice = "glass \"drop\" encloses nothing: its faces are there twice, facing both ways";
        assert_eq!(messages(text, "glass", of(&both)), [twice]);
    }

    #[test]
    fn parts_of_different_glass_do_not_close_each_other() {
        let side = |corner: &str, u: &str, v: &str, material: &str| {
            format!("[[quad]]\ncorner = {corner}\nu = {u}\nv = {v}\nmaterial = '{material}'\n")
        };
        let (x, y, z) = ("[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]");
        let cube = |lid: &str| {
            [
                side("[0, 0, 0]", y, x, "a"),
                side("[0, 0, 0]", z, y, "a"),
                side("[0, 0, 0]", x, z, "a"),
                side("[1, 0, 0]", y, z, "a"),
                side("[0, 1, 0]", z, x, "a"),
                side("[0, 0, 1]", x, y, lid),
            ]
            .concat()
        };
        let other = |glass: &str| format!("[materials.b]\ntype = 'glass'\n{glass}\n{}", cube("b"));
        assert_eq!(messages(&cube("a"), "glass", None), [""; 0]);
        assert_eq!(messages(&other("ior = 1.5\ntint = [1, 1, 1]"), "glass", None), [""; 0], "the same glass");
        for glass in ["ior = 1.33", "tint = [0.5, 1, 1]"] {
            assert_eq!(
                messages(&other(glass), "glass", None).len(),
                5,
                "{glass}: the lid and its four neighbours"
            );
        }
    }
}
