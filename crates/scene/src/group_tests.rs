//! Tests for groups and instances.

use std::ops::Range;
use std::path::Path;

use super::description::*;
use super::diagnostic::{Diagnostic, Severity};
use super::tests::{CAMERA, messages, scene};
use super::{LoadedScene, load, parse};
use crate::math::{DMat3, DVec3};

const SPHERE: &str = "center = [1, 2, 3]\nradius = 2\nmaterial = 'm'\n";

/// Errors in a scene, with the text at each span.
fn errors(text: &str) -> Vec<(String, String)> {
    let found = parse(format!("{text}\n{CAMERA}").into(), Path::new("scene.toml")).diagnostics;
    let errors = found.into_iter().filter(|one| one.severity == Severity::Error);
    errors
        .map(|Diagnostic { message, place, .. }| {
            let place = place.expect("a place");
            (format!("{message}; {}", place.label), place.source[place.span].to_owned())
        })
        .collect()
}

/// A matrix that mirrors and shears. Its products with small integers are exact.
fn matrix(translate: [f64; 3]) -> String {
    let [x, y, z] = translate;
    format!("matrix = [0, -2, 0, {x:?}, 1, 0, 0.5, {y:?}, 0, 0, -3, {z:?}, 0, 0, 0, 1]\n")
}

/// The parameters of one shape of each kind.
const SHAPES: [(&str, &str); 10] = [
    ("sphere", "center = [1, 2, 3]\nradius = 2\n"),
    ("quad", "corner = [1, 0, 0]\nu = [2, 1, 0]\nv = [0, 0, 4]\n"),
    ("plane", "point = [0, 1, 0]\nnormal = [1, 2, 3]\n"),
    ("box", "size = [1, 2, 3]\nrotate = [0, 90, 0]\n"),
    ("triangle", "a = [0, 0, 5]\n"),
    ("disk", "normal = [1, 2, 3]\n"),
    ("cylinder", "radius = 2\n"),
    ("cone", "radius = 2\n"),
    ("torus", "axis = [1, 2, 3]\n"),
    ("mesh", "file = 'files/knot.obj'\n"),
];

/// Parses a scene that can refer to the mesh file in `tests/broken`.
fn with_files(text: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/broken/scene.toml");
    let outcome = parse(format!("{text}\n{CAMERA}").into(), &path);
    outcome.scene.unwrap_or_else(|| panic!("{text}: {:?}", outcome.diagnostics))
}

#[test]
fn placements_start_after_the_shapes_own_keys() {
    let text = format!(
        "[textures.grain]\ntype = 'noise'\n[materials.m]\n[materials.rock]\nbump = 'grain'\n\
         [materials.mix]\ntype = 'blend'\nmaterials = ['m', 'rock']\n\
         [[sphere]]\ncenter = [1, 2, 3]\nradius = 2\nmaterial = 'rock'\n{scaled}\
         [[sphere]]\nradius = 1\ncenter = [0, 0, 0]\nmaterial = 'm'\n{scaled}\
         [[mesh]]\nfile = 'files/knot.obj'\nmaterial = 'mix'\nscale = 3\ntranslate = [0, 9, 0]\n\
         [[groups.g.mesh]]\nfile = 'files/knot.obj'\nmaterial = 'mix'\nscale = 3\n\
         [[groups.g.sphere]]\ncenter = [1, 2, 3]\nradius = 1\nmaterial = 'rock'\n{scaled}\
         [[instance]]\ngroup = 'g'\ntranslate = [10, 20, 30]\n",
        scaled = "matrix = [2, 0, 0, 4, 0, 2, 0, 5, 0, 0, 2, 6, 0, 0, 0, 1]\n",
    );
    let scene = with_files(&text);
    let map = |scale: f64, translate: [f64; 3]| {
        let linear = DVec3::AXES.map(|axis| axis * scale);
        Some(AffineMap { linear, translate: DVec3::from_array(translate) })
    };
    let placements: Vec<_> =
        scene.objects.iter().map(|object| object.placement.as_deref().copied()).collect();
    let expected = [
        map(2.0, [4.0, 5.0, 6.0]),
        None,
        map(1.0, [0.0; 3]),
        map(1.0, [10.0, 20.0, 30.0]),
        map(2.0, [14.0, 25.0, 36.0]),
    ];
    assert_eq!(placements, expected);
    // World coordinates (4, 5, 6) + 2·(1, 2, 3) are (1, 2, 3) in the first sphere's own coordinates.
    let frame = scene.objects[0].object_frame(DVec3::ONE);
    assert_eq!(frame.inverse_point(DVec3::new(5.0, 8.0, 11.0)), DVec3::new(1.0, 2.0, 3.0));
}

#[test]
fn instances_equal_written_shapes() {
    let product = |translate: [f64; 3]| {
        // The linear part of `matrix`, applied twice.
        let linear = DMat3::from_cols(DVec3::Y, DVec3::X * -2.0, DVec3::new(0.0, 0.5, -3.0));
        let both = linear * linear;
        let at = linear * DVec3::from_array(translate) + DVec3::new(4.0, 5.0, 6.0);
        let row = |i: usize| {
            both.row(i).to_array().map(|x| format!("{x:?}")).join(", ") + &format!(", {:?}", at[i])
        };
        format!("matrix = [{}, {}, {}, 0, 0, 0, 1]\n", row(0), row(1), row(2))
    };
    let outer = matrix([4.0, 5.0, 6.0]);
    for (kind, keys) in SHAPES {
        let shape = |matrix: &str| {
            let written = with_files(&format!("[materials.m]\n[[{kind}]]\n{keys}{matrix}material = 'm'\n"));
            written.objects[0].shape.clone()
        };
        let copy = |own: &str, outer: &str, group: &str| {
            let text = format!(
                "[materials.m]\n[[groups.a.{kind}]]\n{keys}{own}material = 'm'\n\
                 [[groups.b.instance]]\ngroup = 'a'\n{}[[instance]]\ngroup = '{group}'\n{outer}",
                matrix([1.0, 2.0, 3.0])
            );
            with_files(&text).objects[0].shape.clone()
        };
        assert_eq!(copy("", "", "a"), shape(""), "{kind}");
        assert_eq!(copy("", &outer, "a"), shape(&outer), "{kind}");
        assert_eq!(copy(&matrix([1.0, 2.0, 3.0]), &outer, "a"), shape(&product([1.0, 2.0, 3.0])), "{kind}");
        assert_eq!(copy("", &outer, "b"), shape(&product([1.0, 2.0, 3.0])), "{kind}");
        let steps = "scale = [1, -2, 0.5]\nrotate = [0, 90, 90]\ntranslate = [5, 6, 7]\n";
        let as_matrix = "matrix = [0, 2, 0, 5, 0, 0, 0.5, 6, -1, 0, 0, 7, 0, 0, 0, 1]\n";
        let written = if kind == "mesh" { steps } else { as_matrix };
        assert_eq!(copy("", steps, "a"), shape(written), "{kind}");
    }
}

#[test]
fn copies_are_in_file_order() {
    let ball = |name: &str| format!("{SPHERE}name = '{name}'\n");
    let text = format!(
        "[materials.m]\n[[sphere]]\n{}[[instance]]\ngroup = 'pair'\nname = 'left'\n[[box]]\nmaterial = 'm'\nname = 'box'\n\
         [[groups.pair.box]]\nmaterial = 'm'\nname = 'inner box'\n[[groups.pair.instance]]\ngroup = 'single'\n\
         [[groups.pair.sphere]]\n{}[[groups.single.sphere]]\n{}[[instance]]\ngroup = 'single'\n[[sphere]]\n{}",
        ball("first"),
        ball("inner"),
        ball("single"),
        ball("last")
    );
    let scene = scene(&text);
    let names: Vec<&str> = scene.objects.iter().filter_map(|object| object.name.as_deref()).collect();
    assert_eq!(names, ["first", "inner box", "single", "inner", "box", "single", "last"]);
    let instances: Vec<(Range<usize>, Option<&str>)> =
        scene.instances.iter().map(|one| (one.objects.clone(), one.name.as_deref())).collect();
    assert_eq!(instances, [(1..4, Some("left")), (5..6, None)]);
    let of: Vec<_> =
        (0..7).map(|object| scene.instance_containing(object).map(|one| one.objects.start)).collect();
    assert_eq!(of, [None, Some(1), Some(1), Some(1), None, Some(5), None]);
    assert_eq!(scene.objects[2].span, scene.objects[5].span);
    let mut filter = scene.first_copy_filter();
    assert_eq!((0..7).map(&mut filter).collect::<Vec<_>>(), [true, true, true, true, true, false, true]);
}

#[test]
fn groups_without_instances_are_not_loaded() {
    let text = "[[light]]\n[materials.m]\n[[groups.used.mesh]]\nfile = 'files/ball.obj'\nmaterial = 'm'\n\
                [[groups.unused.mesh]]\nfile = 'files/view.txt.obj'\nmaterial = 'm'\n";
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("files")).expect("a folder");
    for name in ["files/ball.obj", "files/view.txt.obj"] {
        std::fs::write(folder.path().join(name), "").expect("written");
    }
    let path = folder.path().join("scene.toml");
    let load = |instances: &str| -> LoadedScene {
        std::fs::write(&path, format!("{CAMERA}{text}{instances}")).expect("written");
        load(&path, &[]).expect("a scene")
    };
    let instance = "[[instance]]\ngroup = 'used'\n";
    let loaded = load(&instance.repeat(3));
    assert_eq!(
        loaded.warnings.iter().map(|one| &*one.message).collect::<Vec<_>>(),
        ["the group \"unused\" is not used"]
    );
    let files: Vec<usize> =
        loaded.scene.objects.iter().filter_map(|object| Some(object.shape.as_mesh()?.file)).collect();
    assert_eq!((files, loaded.scene.mesh_files.len()), (vec![0; 3], 1));
    let other = load(&format!("{instance}[[instance]]\ngroup = 'unused'\n"));
    assert_eq!((other.warnings.len(), other.scene.mesh_files.len()), (0, 2));
    let reversed = load("[[instance]]\ngroup = 'unused'\n");
    assert!(reversed.scene.mesh_files[0].value.ends_with("files/view.txt.obj"));
    assert_eq!(reversed.scene.objects[0].shape.as_mesh().map(|mesh| mesh.file), Some(0));
}

#[test]
fn cycles_are_reported_at_an_instance() {
    let nested = |group: &str, inner: &str| format!("[[groups.{group}.instance]]\ngroup = '{inner}'\n");
    let itself = errors(&format!("{}[[instance]]\ngroup = 'a'\n", nested("a", "a")));
    assert_eq!(itself.len(), 1, "{itself:?}");
    assert_eq!(itself[0].0, "the group \"a\" contains itself; a → a");
    // The reported cycle does not include the group that leads to it.
    let three = [nested("outer", "a"), nested("a", "b"), nested("b", "c"), nested("c", "a")].concat();
    let found = errors(&three);
    let [(message, _)] = found.as_slice() else { panic!("{found:?}") };
    let is_cycle = |names: [&str; 4]| message.ends_with(&format!("; {}", names.join(" → ")));
    assert!(
        [["a", "b", "c", "a"], ["b", "c", "a", "b"], ["c", "a", "b", "c"]].into_iter().any(is_cycle),
        "{message}"
    );
    let long: String = (0..40).map(|i| nested(&format!("g{i}"), &format!("g{}", (i + 1) % 40))).collect();
    let label = errors(&long).remove(0).0;
    assert!(label.contains(" → … → ") && label.matches('→').count() == 5, "{label}");
}

#[test]
fn deeply_nested_groups_are_expanded() {
    const DEPTH: usize = 20_000;
    let group = |i: usize| {
        let translate = if i.is_multiple_of(2) { "translate = [1, 0, 0]\n" } else { "" };
        format!("[[groups.g{i}.instance]]\ngroup = 'g{}'\n{translate}", i + 1)
    };
    let chain: String = (0..DEPTH).map(group).collect();
    let text =
        format!("[materials.m]\n{chain}[[groups.g{DEPTH}.sphere]]\n{SPHERE}[[instance]]\ngroup = 'g0'\n");
    let center = DVec3::new(1.0 + 0.5 * DEPTH as f64, 2.0, 3.0);
    assert_eq!(scene(&text).objects[0].shape, Shape::Sphere { center, radius: 2.0 });
}

#[test]
fn too_many_copies_are_rejected() {
    // Each group contains the next one ten times. The copies are counted, even if they contain no shapes.
    for shape in [format!("[[groups.g9.sphere]]\n{SPHERE}"), "[groups.g9]\n".to_owned()] {
        let nested = |i: usize| format!("[[groups.g{i}.instance]]\ngroup = 'g{}'\n", i + 1).repeat(10);
        let text = format!("[materials.m]\n{}{shape}", (0..9).map(nested).collect::<String>());
        let placed = |group: &str| errors(&format!("{text}[[instance]]\ngroup = '{group}'\n"));
        let found = placed("g0");
        let [(message, _)] = found.as_slice() else { panic!("{found:?}") };
        assert!(message.contains("2 million copies") && message.contains("\"g0\""), "{message}");
        assert_eq!(placed("g5"), []);
    }
    // The sum saturates instead of overflowing.
    let doubled: String =
        (0..200).map(|i| format!("[[groups.g{i}.instance]]\ngroup = 'g{}'\n", i + 1).repeat(2)).collect();
    let all = format!("{doubled}[groups.g200]\n[[instance]]\ngroup = 'g0'\n[[instance]]\ngroup = 'g0'\n");
    assert_eq!(errors(&all).len(), 1);
    assert_eq!(messages(&doubled.replace("'g200'", "'g199'")).len(), 1, "a cycle");
}

#[test]
fn composed_transforms_stay_in_range() {
    let nested = |scale: &str, own: &str| {
        let text = format!(
            "[materials.m]\n[[groups.a.sphere]]\n{SPHERE}{own}[[groups.b.instance]]\ngroup = 'a'\nscale = {scale}\n\
             [[instance]]\ngroup = 'b'\nscale = {scale}\n"
        );
        errors(&text)
    };
    assert_eq!((nested("1e8", ""), nested("1e-8", "")), (vec![], vec![]));
    for (scale, own, problem) in [
        ("1e12", "", "too large"),
        ("1e-12", "", "too small"),
        ("[1, 1, 1]", "", ""),
        ("1e8", "matrix = [1e8, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n", "too large"),
        ("1", "matrix = [1, 1, 0, 0, 1, 1.00001, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n", ""),
        (
            "[1e4, 1e-4, 1]",
            "matrix = [1, 1, 0, 0, 1, 1.00001, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n",
            "not invertible",
        ),
    ] {
        let found = nested(scale, own);
        assert_eq!(found.len(), usize::from(!problem.is_empty()), "{scale} {own}: {found:?}");
        assert!(found.iter().all(|(message, place)| message.contains(problem) && place.contains("instance")));
    }
    // Compositions that overflow midway are rejected as well.
    let chain: String =
        (0..40).map(|i| format!("[[groups.g{i}.instance]]\ngroup = 'g{}'\nscale = 1e18\n", i + 1)).collect();
    let text = format!("[materials.m]\n{chain}[[groups.g40.sphere]]\n{SPHERE}[[instance]]\ngroup = 'g0'\n");
    assert_eq!(errors(&text).len(), 1);
}
