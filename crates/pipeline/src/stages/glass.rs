//! Detects glass solids and warns about solids that are not closed.

use std::sync::Arc;

use super::super::cache::Memo;
use super::super::keys;
use super::meshes::MeshesByFileIndex;
use super::{AbortReason, Findings};
use crate::assets::LoadedMesh;
use crate::control::CancelToken;
use crate::scene::LoadedScene;
use crate::scene::description::OpenSurface;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::Fingerprint;
use crate::world::{GlassSolids, OpenGlass};

/// How open glass affects the image, shown under the object's location.
const LACKS: &str = "glass refracts where a ray enters and leaves it; rays through the hole are neither refracted \
                     nor tinted";

/// Finds the glass solids, or reuses them if shapes and materials are unchanged. Warns about open solids.
///
/// # Errors
/// Returns [`AbortReason::Canceled`] if the token is canceled.
pub(crate) fn find_glass_solids(
    loaded: &LoadedScene,
    meshes: &MeshesByFileIndex,
    memo: &mut Memo<Arc<GlassSolids>>,
    findings: &mut Findings,
    token: &CancelToken,
) -> Result<Arc<GlassSolids>, AbortReason> {
    let scene = &loaded.scene;
    let mesh_keys: Vec<Fingerprint> = meshes.iter().map(|mesh| mesh.key).collect();
    let key = keys::glass_key(scene, &keys::scene_fingerprint_references(scene, &mesh_keys, None));
    let bodies = if let Some(bodies) = memo.get(key) {
        Arc::clone(bodies)
    } else {
        let files: Vec<&LoadedMesh> = meshes.iter().map(|mesh| &*mesh.mesh).collect();
        Arc::new(GlassSolids::find(scene, &files, token)?)
    };
    memo.set(key, Arc::clone(&bodies));
    findings.warnings.extend(open_glass_warnings(loaded, bodies.open_objects()));
    let mut is_first_copy = scene.first_copy_filter();
    let flat = bodies.zero_volume_objects().iter().filter(|&&object| is_first_copy(object as usize));
    findings.warnings.extend(flat.map(|&object| duplicate_faces_glass_warning(loaded, object)));
    Ok(bodies)
}

/// A flaw, possibly shared by several objects. Each flaw causes one warning.
#[derive(Clone, Copy, PartialEq, Eq)]
enum GlassFlaw {
    /// A shape without an interior.
    Sheet { one: &'static str, several: &'static str, help: &'static str },
    /// A mesh with a hole.
    Hole,
    /// A mesh with inconsistently oriented faces.
    Fronts,
}

/// Maximum number of objects listed in a warning.
const MAX_NAMES: usize = 5;

/// Returns one warning per flaw, located at the first affected object. Ignores glass whose holes are covered
/// by opaque surfaces.
fn open_glass_warnings(loaded: &LoadedScene, open: &[OpenGlass]) -> Vec<Diagnostic> {
    let mut groups: Vec<(GlassFlaw, Vec<&OpenGlass>)> = Vec::new();
    let mut is_first_copy = loaded.scene.first_copy_filter();
    for open in open.iter().filter(|open| !open.is_covered && is_first_copy(open.object as usize)) {
        let Some(flaw) = glass_flaw(loaded, open) else { continue };
        match groups.iter_mut().find(|(other, _)| *other == flaw) {
            Some((_, members)) => members.push(open),
            None => groups.push((flaw, vec![open])),
        }
    }
    groups.iter().map(|(flaw, members)| glass_flaw_warning(loaded, *flaw, members)).collect()
}

/// Returns the flaw that keeps an open object from enclosing a volume, or `None` if no remedy is known.
fn glass_flaw(loaded: &LoadedScene, open: &OpenGlass) -> Option<GlassFlaw> {
    let shape = &loaded.scene.objects[open.object as usize].shape;
    if shape.as_mesh().is_some() {
        return Some(if open.disagrees { GlassFlaw::Fronts } else { GlassFlaw::Hole });
    }
    let sheet = |one, several, help| GlassFlaw::Sheet { one, several, help };
    Some(match shape.untransformed_open_surface()? {
        OpenSurface::Quad(_) => sheet(
            "a glass quad",
            "glass quads",
            "use a thin [[box]] for a pane, or close it with other glass",
        ),
        OpenSurface::Triangle(_) => {
            sheet("a glass triangle", "glass triangles", "use a [[box]], or a closed [[mesh]]")
        }
        OpenSurface::Disk { .. } => {
            sheet("a glass disk", "glass disks", "use a flat [[cylinder]] for a round pane")
        }
        OpenSurface::Cylinder { .. } => {
            sheet("an open glass cylinder", "open glass cylinders", "close it with `caps = true`")
        }
        OpenSurface::Cone { .. } => {
            sheet("an open glass cone", "open glass cones", "close it with `cap = true`")
        }
    })
}

/// Returns a single warning about all objects that have a flaw. `members` must not be empty.
fn glass_flaw_warning(loaded: &LoadedScene, flaw: GlassFlaw, members: &[&OpenGlass]) -> Diagnostic {
    let first = &loaded.scene.objects[members[0].object as usize];
    let edges: usize = members.iter().map(|open| open.edges).sum();
    let edges = if edges == 1 { "1 edge".to_owned() } else { format!("{edges} edges") };
    let part = format_percent(members.iter().map(|open| open.missing).fold(0.0, f64::max));
    let (count, names) = (members.len(), list_object_names(loaded, members));
    let mesh = match (count, &first.name) {
        (1, Some(name)) => format!("glass mesh \"{name}\" is"),
        (1, None) => "glass mesh is".to_owned(),
        (_, _) => format!("{count} glass meshes are"),
    };
    let list = if count == 1 { String::new() } else { format!(": {names}") };
    let (message, help) = match flaw {
        GlassFlaw::Sheet { one, help, .. } if count == 1 => (format!("{one} has no interior"), help),
        GlassFlaw::Sheet { several, help, .. } => (format!("{count} {several} have no interior{list}"), help),
        GlassFlaw::Hole => {
            let of = if count == 1 { "of its surface" } else { "of one surface" };
            let message = format!(
                "{mesh} not closed: {edges} without a neighbor made of the same glass, {part} {of} missing{list}"
            );
            (message, "close the mesh in a modeling program, or give a pane some thickness")
        }
        GlassFlaw::Fronts => {
            let message = format!(
                "{mesh} inconsistently oriented: {edges} between faces with opposite orientations{list}"
            );
            (message, "recalculate its normals in a modeling program so that they point outwards")
        }
    };
    let mut diagnostic =
        loaded.create_diagnostic_at(first.span.clone(), Severity::Warning, message, Some(help.to_owned()));
    if let Some(place) = &mut diagnostic.place {
        place.label = LACKS.to_owned();
    }
    diagnostic
}

/// Lists the first few objects by name, or by line if they are unnamed: `"pane", line 12 and 3 more`. Objects
/// in foreign files may have neither.
fn list_object_names(loaded: &LoadedScene, members: &[&OpenGlass]) -> String {
    let name = |open: &&OpenGlass| {
        let object = &loaded.scene.objects[open.object as usize];
        let line = || loaded.line_number(&object.span).map(|line| format!("line {line}"));
        let name = object.name.as_deref().map(|name| format!("\"{name}\""));
        name.or_else(line).unwrap_or_else(|| "an unnamed mesh".to_owned())
    };
    // Replacing only one name with "1 more" would not make the list shorter.
    let most = if members.len() == MAX_NAMES + 1 { MAX_NAMES + 1 } else { MAX_NAMES };
    let mut shown: Vec<String> = members.iter().take(most).map(name).collect();
    let last = match members.len() - shown.len() {
        0 => shown.pop().unwrap_or_default(),
        more => format!("{more} more"),
    };
    if shown.is_empty() { last } else { format!("{} and {last}", shown.join(", ")) }
}

/// Returns the warning about a closed mesh that encloses no volume.
fn duplicate_faces_glass_warning(loaded: &LoadedScene, object: u32) -> Diagnostic {
    let object = &loaded.scene.objects[object as usize];
    let name = object.name.as_deref().map(|name| format!(" \"{name}\"")).unwrap_or_default();
    let message =
        format!("glass{name} encloses no volume: every face is duplicated with the opposite orientation");
    let help = "export each face once, facing outwards (not double-sided)".to_owned();
    let mut diagnostic =
        loaded.create_diagnostic_at(object.span.clone(), Severity::Warning, message, Some(help));
    if let Some(place) = &mut diagnostic.place {
        place.label = "rays enter it but never leave, so everything behind it is tinted".to_owned();
    }
    diagnostic
}

fn format_percent(part: f64) -> String {
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
    use crate::scene::fingerprint::FingerprintHasher;
    use crate::stages::meshes::CachedMesh;

    /// Returns the warnings for a scene whose mesh file is replaced with `mesh`.
    fn warnings(text: &str, material: &str, mesh: Option<LoadedMesh>) -> Vec<Diagnostic> {
        let text = format!(
            "[materials.a]\ntype = '{material}'\n{text}\n[render]\nambient = [1, 1, 1]\n[camera]\nposition = [0, 1, 4]\n\
             look_at = [0, 1, 0]\n"
        );
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, &text).expect("written");
        std::fs::write(folder.path().join("a.ply"), "").expect("written");
        let loaded = crate::scene::load(&path, &[]).expect("a valid scene");
        let mut findings = Findings::default();
        let meshes: MeshesByFileIndex = mesh
            .into_iter()
            .map(|mesh| {
                let key = FingerprintHasher::new("test").finish();
                Arc::new(CachedMesh::new(Arc::new(mesh), key, Vec::new()))
            })
            .collect();
        let token = CancelToken::new();
        let found = find_glass_solids(&loaded, &meshes, &mut Memo::default(), &mut findings, &token);
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
    fn shapes_without_interior_cause_warnings() {
        for (shape, expected) in [
            ("[[quad]]\ncorner = [0, 0, 0]\nu = [1, 0, 0]\nv = [0, 1, 0]", "a glass quad has no interior"),
            ("[[triangle]]\na = [0, 0, 0]\nb = [1, 0, 0]\nc = [0, 1, 0]", "a glass triangle has no interior"),
            ("[[disk]]", "a glass disk has no interior"),
            ("[[cylinder]]\ncaps = false", "an open glass cylinder has no interior"),
            ("[[cone]]\ncap = false", "an open glass cone has no interior"),
        ] {
            let shape = format!("{shape}\nmaterial = 'a'");
            assert_eq!(messages(&shape, "glass", None), [expected]);
            assert_eq!(
                messages(&shape, "phong", None),
                [""; 0],
                "there should be no warning for other materials: {shape}"
            );
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
    fn hole_warning_includes_mesh_name_and_hole_size() {
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
        // The area of the missing face is 1/2, and the area of the whole mesh is (3 + √3)/2.
        let open = "glass mesh \"drop\" is not closed: 3 edges without a neighbor made of the same glass, 27 % of its surface missing";
        assert_eq!(messages(text, "glass", of(&all[1..])), [open]);
        assert_eq!(messages(text, "phong", of(&all[1..])), [""; 0]);
        // One face points inwards.
        let odd = [[0, 1, 2], all[1], all[2], all[3]];
        let odd = &messages(text, "glass", of(&odd))[..];
        assert_eq!(
            odd,
            [
                "glass mesh \"drop\" is inconsistently oriented: 6 edges between faces with opposite orientations"
            ]
        );
        // Every face is duplicated with the opposite orientation.
        let both: Vec<_> = all.iter().flat_map(|&[a, b, c]| [[a, b, c], [a, c, b]]).collect();
        let twice =
            "glass \"drop\" encloses no volume: every face is duplicated with the opposite orientation";
        assert_eq!(messages(text, "glass", of(&both)), [twice]);
    }

    #[test]
    fn similar_flaws_share_one_warning() {
        let pane = |i: usize| {
            let name = if i == 1 { String::new() } else { format!("name = 'pane {i}'\n") };
            format!("[[quad]]\n{name}corner = [0, {i}, 0]\nu = [1, 0, 0]\nv = [0, 0, 1]\nmaterial = 'a'\n")
        };
        let panes = |count: usize| (0..count).map(pane).collect::<String>();
        let of = |count: usize| messages(&panes(count), "glass", None);
        let five = "\"pane 0\", line 9, \"pane 2\", \"pane 3\"";
        assert_eq!(of(2), ["2 glass quads have no interior: \"pane 0\" and line 9"]);
        assert_eq!(of(5), [format!("5 glass quads have no interior: {five} and \"pane 4\"")]);
        assert_eq!(of(6), [format!("6 glass quads have no interior: {five}, \"pane 4\" and \"pane 5\"")]);
        assert_eq!(of(30), [format!("30 glass quads have no interior: {five}, \"pane 4\" and 25 more")]);
        // A different kind of flaw causes a separate warning.
        let mixed = format!("[[disk]]\nmaterial = 'a'\n{}", panes(2));
        assert_eq!(messages(&mixed, "glass", None).len(), 2);
    }

    #[test]
    fn different_kinds_of_glass_do_not_close_a_solid() {
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
        assert_eq!(
            messages(&other("ior = 1.5\ntint = [1, 1, 1]"), "glass", None),
            [""; 0],
            "equal materials should close the solid"
        );
        for glass in ["ior = 1.33", "tint = [0.5, 1, 1]"] {
            let found = messages(&other(glass), "glass", None);
            // The warning covers the lid and its four neighbors.
            assert!(found.len() == 1 && found[0].starts_with("5 "), "{glass}: {found:?}");
        }
    }
}
