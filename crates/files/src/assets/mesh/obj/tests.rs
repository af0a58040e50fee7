use super::super::EMPTY_FILE;
use super::super::assemble::NO_FACES;
use super::super::parsed::{alpha_ignored_warning, clamped_color_warning};
use super::super::text::expected_message;
use super::missing_uvs::{corners_without_uvs_warning, faces_without_uvs_warning, file_without_uvs_warning};
use super::statements::{
    CORNER_FORM, attribute_not_in_file_warning, excess_vertex_words_warning, free_form_warning,
    invalid_smoothing_warning, out_of_range_message,
};
use super::vertex::{NONFINITE_COLOR, WEIGHT_OR_COLOR, ZERO_WEIGHT};
use super::words::too_few_numbers_message;
use super::*;
use crate::assets::mesh::load;
use crate::assets::{DroppedFaces, expect_rejection};
use crate::control::{CancelToken, ignore_progress};
use crate::math::{Vec2, Vec3};
use std::fs;

fn read_with(files: &[(&str, &[u8])]) -> Result<LoadedMesh, AssetError> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    load(&folder.path().join(files[0].0), &ignore_progress, &CancelToken::new())
}

fn read(text: &str) -> Result<LoadedMesh, AssetError> {
    read_with(&[("a.obj", text.as_bytes())])
}

fn error(text: &str) -> (Option<usize>, String) {
    expect_rejection(read(text))
}

/// Error for an out-of-range vertex index.
fn vertex_error(line: usize, index: i64, count: usize) -> (Option<usize>, String) {
    (Some(line), out_of_range_message(0, index, count))
}

const COORDINATES: &str = "coordinates";

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn corners_with_different_uvs_are_split() {
    let text = format!("{SQUARE}vt 0 0\nvt 1 0.25\nvn 0 0 2\nf 1/1/1 2/2/1 3/1/1\nf 1/2/1 3/1/1 4/1/1\n");
    let mesh = read(&text).expect("whole").mesh;
    assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.normals.len()), (5, 5, 5));
    assert_eq!(mesh.uvs[1], Vec2::new(1.0, 0.25));
    assert_eq!(mesh.normals, [Vec3::Z; 5]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 2, 4]]);
}

#[test]
fn quads_and_relative_indices_are_read() {
    for faces in
        ["f 1 2 3 4", "f -4 -3 -2 -1", "f 1 2 \\\n 3 4", "f 1 2 3 4\nl 1 2 3\np 1\nl 2 4", "  f 1 2 3 4\r"]
    {
        let mesh = read(&format!("# \u{e9}\n{SQUARE}{faces}\n")).expect(faces).mesh;
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{faces}");
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty() && mesh.materials.is_empty());
    }
    let bytes = [b"# \xff\xfe\n".as_slice(), SQUARE.as_bytes(), b"f 1 2 3\n"].concat();
    assert_eq!(read_with(&[("a.obj", &bytes)]).expect("read").mesh.triangles.len(), 1);
}

#[test]
fn triangles_use_their_assigned_materials() {
    let text = format!("mtllib my one.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 1 3 4\nusemtl none\nf 2 3 4\n");
    let mtl = b"newmtl a\nKd 1 0 0\nnewmtl b\nKe 5 5 5\n";
    let loaded = read_with(&[("a.obj", text.as_bytes()), ("my one.mtl", mtl)]).expect("whole");
    assert_eq!(loaded.mesh.materials, [u32::MAX, 1, u32::MAX]);
    assert_eq!(loaded.materials[1].emission, Vec3::splat(5.0));
    assert_eq!(loaded.material_warnings, [unknown_material_warning("none")]);
}

#[test]
fn byte_order_marks_in_libraries_are_skipped() {
    let object = format!("mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n");
    let library = "\u{feff}newmtl m\nKd 0 1 0\n";
    let loaded = read_with(&[("a.obj", object.as_bytes()), ("a.mtl", library.as_bytes())]).expect("whole");
    assert_eq!(loaded.materials.len(), 1);
}

#[test]
fn only_malformed_libraries_are_errors() {
    let text = format!("mtllib none.mtl\nusemtl red\n{SQUARE}f 1 2 3\n");
    let loaded = read(&text).expect("the mesh should load");
    assert_eq!(
        (loaded.material_warnings.len(), loaded.materials.len(), loaded.mesh.materials.len()),
        (1, 0, 0)
    );
    assert!(loaded.material_warnings[0].contains("none.mtl"), "{:?}", loaded.material_warnings);
    let result = read_with(&[("a.obj", text.as_bytes()), ("none.mtl", b"newmtl red\nKd 1 2\n")]);
    assert_eq!(expect_rejection(result).0, Some(2));
}

#[test]
fn objects_without_normals_get_computed_normals() {
    let text = format!("{SQUARE}vn 0 0 -1\no one\nf 1//1 2//1 3//1\no two\nf 1 3 4\n");
    let mesh = read(&text).expect("whole").mesh;
    assert_eq!(mesh.normals, [Vec3::NEG_Z, Vec3::NEG_Z, Vec3::NEG_Z, Vec3::Z, Vec3::Z, Vec3::Z]);
}

#[test]
fn unusable_faces_are_dropped_and_counted() {
    let text = format!("{SQUARE}v nan 0 0\nv 1e999 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 6\nf 1 2\nf 1\nf 1 1 2\n");
    let loaded = read(&text).expect("one valid face");
    assert_eq!(loaded.dropped, DroppedFaces { non_finite: 2, degenerate: 3 });
    assert_eq!(loaded.mesh.positions.len(), 3);
}

#[test]
fn errors_include_line_and_reason() {
    assert_eq!(error("v 0 0 0\nv 1 0 0\nf 1 2 3\n"), vertex_error(3, 3, 2));
    assert_eq!(error(&format!("{SQUARE}f 1 2 -9\n")), vertex_error(5, -9, 4));
    assert_eq!(error(&format!("{SQUARE}f 0 1 2\n")), vertex_error(5, 0, 4));
    assert_eq!(
        error(&format!("{SQUARE}vt 0 0\n\n# x\nf 1/1 2/2 3/1\n")),
        (Some(8), out_of_range_message(1, 2, 1))
    );
    assert_eq!(error("v 0 0\n"), (Some(1), too_few_numbers_message(3, COORDINATES, 2)));
    assert_eq!(error("v 0 zero 0\n"), (Some(1), expected_message("3 coordinates", b"zero")));
    assert_eq!(error(&format!("{SQUARE}f 1 2 x\n")), (Some(5), expected_message(CORNER_FORM, b"x")));
    assert_eq!(error(SQUARE), (None, NO_FACES.to_owned()));
    assert_eq!(error(""), (None, EMPTY_FILE.to_owned()));
}

#[test]
fn faces_with_many_corners_are_triangulated() {
    let corners: Vec<String> = (0..20_000).map(|index| (index % 4 + 1).to_string()).collect();
    let loaded = read(&format!("{SQUARE}f {}\n", corners.join(" "))).expect("a fan");
    assert!(!loaded.mesh.triangles.is_empty());
}

#[test]
fn comments_may_follow_a_statement() {
    let plain = read(&format!("{SQUARE}vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n")).expect("whole").mesh;
    for text in [
        "v 0 0 0 # a\nv 1 0 0#\nv 1 1 0 # 1 2 3\nv 0 1 0\nvt 0 0 # x\nvn 0 0 1# y\nf 1/1/1 2/1/1 3/1/1 4/1/1 # x\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 \\\n3/1/1 4/1/1# C:\\\n# D:\\\n",
        // A comment ends at the end of the line, even after a backslash.
        "# C:\\models\\\nv 0 0 0 # \\\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nl 1 2 # x\n",
    ] {
        assert_eq!(read(text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh, plain, "{text}");
    }
    assert_eq!(error("v 0 0 0 # a\nv 1 0 0 # b\n# c\nf 1 2 3 # d\n"), vertex_error(4, 3, 2));
    assert_eq!(error("v 0 0 # 0\n"), (Some(1), too_few_numbers_message(3, COORDINATES, 2)));
    assert_eq!(error(&format!("{SQUARE}f 1 2 \\\n x\n")), (Some(5), expected_message(CORNER_FORM, b"x")));
}

#[test]
fn material_names_may_contain_number_signs() {
    let mtl = b"# old one\nnewmtl Material #25 # the floor\nKd 1 0 0 # red\nNs 10 # dull\nnewmtl b # c\nillum 2 # d\n\
                newmtl d\n";
    let text = format!(
        "mtllib a.mtl # ours\n{SQUARE}usemtl Material #25\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl d # e\nf 2 3 4\n"
    );
    let loaded = read_with(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]).expect("whole");
    assert_eq!(loaded.material_warnings, Vec::<String>::new());
    assert_eq!(loaded.mesh.materials, [0, 1, 2]);
    assert_eq!(loaded.materials[0].diffuse, Vec3::X);
}

#[test]
fn keywords_may_be_indented_and_followed_by_tabs() {
    let mtl = b"\tnewmtl\ta b\n\tKd\t1 0 0\n";
    let text = format!("\tmtllib\ta.mtl\n{SQUARE}  usemtl\ta b \nf 1 2 3\n");
    let loaded = read_with(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]).expect("whole");
    assert_eq!(loaded.material_warnings, Vec::<String>::new());
    assert_eq!(loaded.mesh.materials, [0]);
}

#[test]
fn vertex_weights_divide_coordinates() {
    for tail in ["2", "2 9 9 9 1"] {
        let text = format!("v 0 0 0 {tail}\nv 1 0 0 {tail}\nv 0 1 0 0.5\nf 1 2 3\n");
        let mesh = read(&text).expect("whole").mesh;
        assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 2.0]);
    }
    assert_eq!(error("v 0 0 0\nv 1 0 0 0\nv 0 1 0\nf 1 2 3\n"), (Some(2), ZERO_WEIGHT.to_owned()));
    assert_eq!(error("v 0 0 0 1 0\n"), (Some(1), WEIGHT_OR_COLOR.to_owned()));
}

#[test]
fn vertex_colors_are_read_in_all_dialects() {
    let colors = |tails: [&str; 3]| {
        let [a, b, c] = tails;
        let text = format!("v 0 0 0 {a}\nv 1 0 0 {b}\nv 0 1 0 {c} # x\nf 1 2 3\n");
        let loaded = read(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(loaded.mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y], "{text}");
        (loaded.mesh.colors, loaded.warnings)
    };
    let plain = [[255, 0, 0], [0, 51, 0], [255; 3]];
    assert_eq!(colors(["1 0 0", "0 0.2 0", "1 1 1"]), (plain.to_vec(), vec![]));
    assert_eq!(colors(["255 0 0", "0 51 0", "255 255 255"]), (plain.to_vec(), vec![]));
    // An alpha of 1, or both a weight and an alpha of 1.
    assert_eq!(colors(["1 0 0 1", "0 0.2 0 1", "1 1 1 1"]), (plain.to_vec(), vec![]));
    assert_eq!(colors(["1 1 0 0 1", "1 0 0.2 0 1", "1 1 1 1 1"]), (plain.to_vec(), vec![]));
    // A missing color is white.
    assert_eq!(colors(["1 0 0", "0 0.2 0", ""]), (plain.to_vec(), vec![]));
    assert_eq!(colors(["", "0 51 0", "1 1 1"]).0, [[255; 3], [0, 51, 0], [1; 3]]);
    // Fractional colors slightly above 1 are not byte values.
    let clamped = |line: usize, value: f64, one: f64| {
        vec![format!("line {line}: {}", clamped_color_warning(value, one))]
    };
    assert_eq!(colors(["1.5 0 0", "0 0.2 0", "1 1 1"]), (plain.to_vec(), clamped(1, 1.5, 1.0)));
    assert_eq!(colors(["255 0 0", "0 51 -3", "255 255 255"]), (plain.to_vec(), clamped(2, -3.0, 255.0)));
    assert_eq!(colors(["", "", ""]), (vec![], vec![]));
    let ignored = vec![excess_vertex_words_warning(1)];
    assert_eq!(colors(["a b c", "a b c", "a b c"]), (vec![], ignored.clone()));
    assert_eq!(colors(["1 0 0 1 1 1", "0 0.2 0", ""]), (plain.to_vec(), ignored));
    let faded = vec![alpha_ignored_warning(2)];
    assert_eq!(colors(["1 0 0 1", "0 0.2 0 0.5", "1 1 1 1"]), (plain.to_vec(), faded.clone()));
    // Alpha has the same range as the colors.
    assert_eq!(colors(["255 0 0 255", "0 51 0 128", "255 255 255 255"]), (plain.to_vec(), faded));
    assert_eq!(colors(["255 0 0 255", "0 51 0 255", "255 255 255 255"]), (plain.to_vec(), vec![]));
}

#[test]
fn keywords_are_case_insensitive() {
    let text = "MTLLIB a.mtl\nV 0 0 0\nv 1 0 0\nV 0 1 0\nV 1 1 0\nVT 0.5 0\nVN 0 0 1\nS OFF\nG a\nUSEMTL m\n\
        F 1/1/1 2/1/1 3/1/1\nUseMtl m\nf 1/1/1 4/1/1 3/1/1\nSURF 0 1\n";
    let loaded = read_with(&[("a.obj", text.as_bytes()), ("a.mtl", b"NEWMTL m\nKD 1 0 0\n")]).expect("whole");
    let lower = read_with(&[
        ("a.obj", text.to_lowercase().as_bytes()),
        ("a.mtl", b"newmtl m\nKd 1 0 0\n".as_slice()),
    ]);
    let lower = lower.expect("whole");
    assert_eq!(loaded.mesh, lower.mesh);
    assert_eq!((loaded.materials.len(), loaded.warnings.len()), (1, 1));
    // Lines with uppercase statements are also counted in error messages.
    assert_eq!(error("V 0 0 0\nF 1 1 1\nF 1 2 3\n"), vertex_error(3, 2, 1));
}

#[test]
fn self_intersections_are_reported_with_line() {
    let text = format!("{SQUARE}f 1 2 3\nf 1 2 3 4\n# x\nF 1 3 \\\n 2 4\n");
    let loaded = read(&format!("{text}f 1 2 3\n")).expect("whole");
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].starts_with("line 8: face 3 "), "{:?}", loaded.warnings);
}

#[test]
fn some_objects_may_lack_colors() {
    let text = "o a\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0 1\no b\nv 0 0 1\nf 2 3 4\no a\nf 1 2 3\n";
    let mesh = read(text).expect("whole").mesh;
    let red = [255, 0, 0];
    assert_eq!(mesh.colors, [red, [0, 0, 255], [255; 3], red, red, [0, 0, 255]]);
}

#[test]
fn zbrush_paint_comments_set_vertex_colors() {
    let square =
        |paint: &str| read(&format!("{SQUARE}#MRGB {paint}\nf 1 2 3 4\n")).expect("whole").mesh.colors;
    assert_eq!(
        square("ffff0000ff00ff00ff0000ffff010203"),
        [[255, 0, 0], [0, 255, 0], [0, 0, 255], [1, 2, 3]]
    );
    assert_eq!(square("ffff0000\n#MRGB 00010203"), [[255, 0, 0], [1, 2, 3], [255; 3], [255; 3]]);
    assert_eq!(square("none"), Vec::<[u8; 3]>::new());
}

/// Two squares that meet at a right angle along the edge from (1, 0, 0) to (1, 1, 0).
const CORNER: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 -1\nv 1 1 -1\n";

/// Returns the normals at the corners of two faces.
fn shaded(text: &str) -> Vec<Vec3> {
    let mesh = read(text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh;
    let normals = crate::assets::mesh::vertex_normals(&mesh, &CancelToken::new()).expect("not canceled");
    let normals = if mesh.normals.is_empty() { normals } else { mesh.normals.clone() };
    mesh.triangles.as_flattened().iter().map(|vertex| normals[*vertex as usize]).collect()
}

#[test]
fn smoothing_groups_define_hard_edges() {
    let with = |a: &str, b: &str| shaded(&format!("{CORNER}{a}\nf 1 2 3\n{b}\nf 3 2 5\n"));
    let flat = [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::X, Vec3::X, Vec3::X];
    for (a, b) in [
        ("s off", ""),
        ("s 0", ""),
        ("s 1", "s 2"),
        ("s", ""),
        ("s OFF", "o b"),
        ("s off", "s 3"),
        ("s 7", "s 0"),
    ] {
        assert_eq!(with(a, b), flat, "{a:?}, {b:?}");
    }
    let smooth = with("", "");
    assert_ne!(smooth, flat);
    // A group continues across objects and materials, and can be resumed later.
    for (a, b) in
        [("s 1", ""), ("s on", "s 1"), ("s 1", "o b"), ("s 1", "g b\nusemtl b"), ("s 2", "s 1\ns 2")]
    {
        assert_eq!(with(a, b), smooth, "{a:?}, {b:?}");
    }
    let textured = |s: &str| shaded(&format!("{CORNER}vt 0 0\nvt 1 1\n{s}\nf 1/1 2/1 3/1\nf 3/2 2/2 5/2\n"));
    assert_eq!(textured("s 1"), smooth, "a texture seam should not be an edge");
    assert_eq!(textured("s off"), flat);
    let loaded = read(&format!("{CORNER}s 1\ns sharp\nf 1 2 3\n")).expect("whole");
    assert_eq!(loaded.warnings, [invalid_smoothing_warning(8, b"sharp")]);
}

#[test]
fn flat_faces_stay_flat_at_shallow_folds() {
    // Vertices of smooth faces share normals across this 11-degree fold.
    let fold = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0.2\n";
    let normals = shaded(&format!("{fold}s off\nf 1 2 3 4\nf 2 5 3\n"));
    assert_eq!(normals[..6], [Vec3::Z; 6]);
    assert!(normals[6..].iter().all(|normal| *normal == normals[6] && normal.x < 0.0), "{normals:?}");
    let hard = shaded(&format!("{fold}s 1\nf 1 2 3 4\ns 2\nf 2 5 3\n"));
    assert_eq!(hard, normals);
    // Coincident vertices in the same group are joined if their normals are similar.
    let apart = fold.to_owned() + "v 1 0 0\nv 1 1 0\n";
    let joined = shaded(&format!("{apart}s 1\nf 1 2 3 4\nf 6 5 7\n"));
    assert_eq!(joined, shaded(&format!("{fold}f 1 2 3 4\nf 2 5 3\n")));
    assert_eq!(shaded(&format!("{apart}s 1\nf 1 2 3 4\ns 2\nf 6 5 7\n")), normals);
}

#[test]
fn explicit_normals_override_smoothing_groups() {
    let normals = shaded(&format!("{CORNER}vn 0 1 0\ns off\nf 1//1 2//1 3//1\nf 3 2 5\n"));
    assert_eq!(normals, [Vec3::Y, Vec3::Y, Vec3::Y, Vec3::X, Vec3::X, Vec3::X]);
}

#[test]
fn each_corner_keeps_its_texture_coordinates() {
    let head = format!("{SQUARE}vt 0.25 0.5\nvt 1 0\nvt 0 1\n");
    let uvs = |faces: &str| {
        let loaded = read(&format!("{head}{faces}")).expect("whole");
        let mesh = &loaded.mesh;
        let corners = mesh.triangles.as_flattened().iter().map(|vertex| mesh.uvs[*vertex as usize]);
        (corners.collect::<Vec<_>>(), loaded.warnings)
    };
    let [a, b, c] = [Vec2::new(0.25, 0.5), Vec2::X, Vec2::Y];
    let none = [Vec2::ZERO; 3];
    let (found, warnings) = uvs("f 1 2 3\nf 1/1 3/2 4/3\nf 1 2 3\n");
    assert_eq!(found, [none, [a, b, c], none].concat());
    assert_eq!(warnings, [corners_without_uvs_warning(8, 2)]);
    let (found, warnings) = uvs("f 1/1 2/2 3\n");
    assert_eq!((found, warnings), (vec![a, b, Vec2::ZERO], vec![corners_without_uvs_warning(8, 1)]));
    // Objects without any texture coordinates do not cause a warning.
    let (found, warnings) = uvs("o one\nf 1 2 3\no two\nf 1/1 3/2 4/3\n");
    assert_eq!((found, warnings), ([none, [a, b, c]].concat(), vec![]));
}

#[test]
fn each_corner_keeps_its_normal() {
    let text = format!("{SQUARE}vn 0 0 -1\nvn 0 1 0\nf 1//1 2//2 3\nf 1 3 4//2\n");
    let mesh = read(&text).expect("whole").mesh;
    let corners: Vec<Vec3> =
        mesh.triangles.as_flattened().iter().map(|v| mesh.normals[*v as usize]).collect();
    assert_eq!(corners, [Vec3::NEG_Z, Vec3::Y, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Y]);
}

#[test]
fn a_face_may_precede_its_vertices() {
    let mesh = read(&format!("f 1 2 3\n{SQUARE}f -4 -2 -1\n")).expect("whole").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(error(&format!("f 1 2 5\n{SQUARE}")), vertex_error(1, 5, 4));
    assert_eq!(error(&format!("f -1 2 3\n{SQUARE}")), vertex_error(1, -1, 0));
}

#[test]
fn a_library_may_follow_usemtl() {
    let text = format!("{SQUARE}usemtl red\nf 1 2 3\nmtllib a.mtl\n");
    let files = [("a.obj", text.as_bytes()), ("a.mtl", &b"newmtl green\nnewmtl red\nKd 1 0 0\n"[..])];
    let loaded = read_with(&files).expect("whole");
    assert_eq!(loaded.mesh.materials, [1]);
    assert!(loaded.material_warnings.is_empty(), "{:?}", loaded.material_warnings);
}

#[test]
fn free_form_surfaces_cause_a_warning() {
    let loaded = read(&format!("{SQUARE}f 1 2 3\ncstype bezier\nsurf 0 1 0 1 1 2 3 4\n")).expect("a face");
    assert_eq!(loaded.warnings, [free_form_warning(7, "surf")]);
}

#[test]
fn texture_coordinate_v_defaults_to_zero() {
    let faces = "f 1/1 2/2 3/3\n";
    for coordinates in
        ["vt 0\nvt 0.5 0\nvt 1\n", "vt 0 # 1\nvt \\\n .5\nvt 1 \\\n", "vt\t0\r\nvt 0.5 0 0\nvt 1 "]
    {
        let text = format!("{SQUARE}{coordinates}\n{faces}");
        let mesh = read(&text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh;
        assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::new(0.5, 0.0), Vec2::X], "{text}");
    }
    assert_eq!(error("vt 0\nvt\nv 0 0 0\n"), (Some(2), too_few_numbers_message(2, "texture coordinates", 0)));
    assert_eq!(error("vt 0\nv 0 0\n"), (Some(2), too_few_numbers_message(3, COORDINATES, 2)));
}

#[test]
fn lone_carriage_returns_end_lines() {
    let plain = read(&format!("# a\n{SQUARE}f 1 2 3 4\n")).expect("whole").mesh;
    let old = format!("# a\n{SQUARE}f 1 2 3 4\n").replace('\n', "\r");
    assert_eq!(read(&old).expect("whole").mesh, plain);
    assert_eq!(error("v 0 0 0\rv 1 0\r"), (Some(2), too_few_numbers_message(3, COORDINATES, 2)));
    let text = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\n").replace('\n', "\r");
    let loaded =
        read_with(&[("a.obj", text.as_bytes()), ("a.mtl", b"newmtl red\rKd 1 0 0\r")]).expect("whole");
    assert_eq!((loaded.material_warnings, loaded.materials[0].diffuse), (Vec::new(), Vec3::X));
}

#[test]
fn trailing_slashes_in_corners_are_ignored() {
    let head = format!("{SQUARE}vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n");
    let mesh = |faces: &str| read(&format!("{head}{faces}\n")).expect(faces).mesh;
    let (plain, textured) = (mesh("f 1 2 3"), mesh("f 1/1 2/2 3/3"));
    for faces in [
        "f 1// 2// 3//",
        "f 1/ 2/ 3/",
        "f 1// 2/ 3 # x",
        "f 1 \\\n 2/ \\\r\n 3/\t",
        "f 1 2 3/# x",
        "f 1 2 3//\r",
        // A comment ends at the end of the line.
        "# note \\\nf 1 2 3/",
    ] {
        assert_eq!(mesh(faces), plain, "{faces}");
    }
    for faces in [
        "f 1/1/ 2/2/ 3/3/",
        "f 1/1 2/2 3/3 # 4/ 5/",
        "f 1/1// 2/2 3/3",
        "f 1/1 2/2/ 3/3",
        "f 1/1/ 2/2/ 3/3/\r",
    ] {
        assert_eq!(mesh(faces), textured, "{faces}");
    }
    for (faces, word) in [("f 1 2 3 /", "/"), ("f 1 2 //", "//"), ("f 1 2 /1/", "/1/")] {
        let error = error(&format!("{head}{faces}\n"));
        assert_eq!(error, (Some(9), expected_message(CORNER_FORM, word.as_bytes())), "{faces}");
    }
    for whole in
        ["g here/\nf 1 2 3", "# f 1/\nf 1 2 3", "mtllib f/ 1/\nf 1 2 3", "f 1 2 3 \\\n\ng here/ there"]
    {
        assert_eq!(mesh(whole), plain, "{whole}");
    }
}

#[test]
fn usemtl_without_a_name_resets_the_material() {
    for none in ["usemtl", "usemtl ", "  usemtl\t", "usemtl\r"] {
        let text = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\n{none}\nf 1 3 4\n");
        let files = [("a.obj", text.as_bytes()), ("a.mtl", &b"newmtl red\nKd 1 0 0\n"[..])];
        let loaded = read_with(&files).expect("whole");
        assert_eq!(loaded.mesh.materials, [0, u32::MAX], "{none:?}");
        assert!(loaded.material_warnings.is_empty(), "{none:?}: {:?}", loaded.material_warnings);
        assert_eq!(error(&format!("{SQUARE}{none}\nf 1 2 9\n")), vertex_error(6, 9, 4));
    }
}

#[test]
fn nonfinite_vertex_colors_are_rejected() {
    let error = error("v 0 0 0 1 1 1\nv 1 0 0 nan nan nan\nv 0 1 0 1 1 1\nf 1 2 3\n");
    assert_eq!(error, (Some(2), NONFINITE_COLOR.to_owned()));
}

#[test]
fn libraries_apply_to_earlier_statements() {
    let mtl: &[u8] = b"newmtl red\nKd 1 0 0\n";
    let other: &[u8] = b"newmtl blue\nKd 0 0 1\n";
    for text in [
        format!("{SQUARE}usemtl red\nmtllib a.mtl\nf 1 2 3\n"),
        format!("{SQUARE}usemtl red\nf 1 2 3\nmtllib a.mtl"),
        format!("mtllib b.mtl\n{SQUARE}usemtl red\n\tmtllib\ta.mtl # late\nf 1 2 3\n"),
        format!("{SQUARE}usemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\nmtllib b.mtl\nmtllib a.mtl\n"),
        format!("{SQUARE}usemtl red\nf 1 2 3\nmtllib b.mtl a.mtl\n"),
    ] {
        let files = [("a.obj", text.as_bytes()), ("a.mtl", mtl), ("b.mtl", other)];
        let loaded = read_with(&files).expect(&text);
        assert_eq!(loaded.material_warnings, Vec::<String>::new(), "{text}");
        assert_eq!(loaded.materials[loaded.mesh.materials[0] as usize].diffuse, Vec3::X, "{text}");
    }
    // If two materials have the same name, the one defined before `usemtl` is used.
    let text = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\nmtllib c.mtl\nusemtl red\nf 1 3 4\n");
    let files = [("a.obj", text.as_bytes()), ("a.mtl", mtl), ("c.mtl", b"newmtl red\nKd 0 1 0\n")];
    let loaded = read_with(&files).expect("whole");
    let colors = loaded.mesh.materials.iter().map(|index| loaded.materials[*index as usize].diffuse);
    assert_eq!(colors.collect::<Vec<_>>(), [Vec3::X, Vec3::Y]);
}

#[test]
fn material_names_may_be_latin_1() {
    let text = [b"mtllib a.mtl\n", SQUARE.as_bytes(), b"o caf\xe9\nusemtl gr\xfcn\nf 1 2 3\n"].concat();
    for mtl in [b"newmtl gr\xfcn\nKd 1 0 0\n".as_slice(), "newmtl gr\u{fc}n\nKd 1 0 0\n".as_bytes()] {
        let loaded = read_with(&[("a.obj", &text), ("a.mtl", mtl)]).expect("whole");
        assert_eq!((loaded.materials[0].diffuse, loaded.material_warnings.len()), (Vec3::X, 0));
    }
}

#[test]
fn textures_without_coordinates_are_reported() {
    let mtl: &[u8] =
        b"newmtl plain\nKd 1 0 0\nnewmtl wall\nmap_Kd w.png\nnewmtl glass\nillum 7\nNi 1.5\nmap_Kd w.png\n";
    let warnings = |faces: &str| {
        let text = format!("mtllib a.mtl\n{SQUARE}{faces}");
        let loaded = read_with(&[("a.obj", text.as_bytes()), ("a.mtl", mtl)]).expect("whole");
        let about_uvs = |words: &String| words.contains("texture coordinates");
        let of_materials = loaded.material_warnings.into_iter().filter(about_uvs).collect::<Vec<_>>();
        (of_materials, loaded.warnings)
    };
    let none: Vec<String> = Vec::new();
    let half = vec![file_without_uvs_warning(9, "wall")];
    assert_eq!(warnings("usemtl plain\nf 1 2 3\nusemtl wall\nf 1 3 4\n"), (half, none.clone()));
    assert_eq!(warnings("usemtl plain\nf 1 2 3\nusemtl glass\nf 1 3 4\n"), (none.clone(), none.clone()));
    let uvs = "vt 0 0\nvt 1 0\nvt 1 1\nusemtl wall\n";
    assert_eq!(warnings(&format!("{uvs}f 1/1 2/2 3/3\n")), (none.clone(), none.clone()));
    assert_eq!(
        warnings(&format!("{uvs}f 1/1 2/2 3/3\no other\nf 1 3 4\nf 1 2 3\n")),
        (vec![faces_without_uvs_warning(12, "wall")], none.clone())
    );
    // Partially missing coordinates are reported regardless of the material.
    assert_eq!(warnings(&format!("{uvs}f 1/1 2/2 3\n")), (none, vec![corners_without_uvs_warning(10, 1)]));
}

#[test]
fn missing_attributes_are_dropped_with_warning() {
    let loaded = read(&format!("{SQUARE}f 1 2 3\nf 1/1/4 3/2/4 4/3/4\n")).expect("whole");
    assert!(loaded.mesh.uvs.is_empty());
    for what in ["texture coordinates", "normals"] {
        assert!(loaded.warnings.contains(&attribute_not_in_file_warning(6, what)), "{:?}", loaded.warnings);
    }
}

/// A corner: the bit patterns of its position and texture coordinates, and its normal.
type CornerBits = (([u32; 3], [u32; 2]), Vec3);

fn corner_of(position: Vec3, uv: Vec2, normal: Vec3) -> CornerBits {
    ((position.to_array().map(f32::to_bits), uv.to_array().map(f32::to_bits)), normal)
}

/// Corners of each face, read with `tobj`.
fn faces_from_tobj(path: &std::path::Path) -> Vec<Vec<CornerBits>> {
    let (models, _) = tobj::load_obj(path, &tobj::LoadOptions::default()).expect("tobj should read it");
    let mut faces = Vec::new();
    for tobj::Model { mesh, .. } in &models {
        assert!(mesh.face_arities.iter().all(|arity| *arity == 4), "all faces have four corners");
        let at =
            |values: &[f64], index: u32, of: usize, part: usize| values[index as usize * of + part] as f32;
        let corner = |i: usize| {
            let position = |part| at(&mesh.positions, mesh.indices[i], 3, part);
            let uv =
                |part| mesh.texcoord_indices.get(i).map_or(0.0, |index| at(&mesh.texcoords, *index, 2, part));
            let normal =
                |part| mesh.normal_indices.get(i).map_or(0.0, |index| at(&mesh.normals, *index, 3, part));
            let normal = Vec3::from([0, 1, 2].map(normal)).normalize_or_zero();
            corner_of(Vec3::from([0, 1, 2].map(position)), Vec2::from([0, 1].map(uv)), normal)
        };
        faces.extend((0..mesh.indices.len() / 4).map(|face| (face * 4..face * 4 + 4).map(corner).collect()));
    }
    faces
}

#[test]
fn triangles_match_tobj() {
    let assets = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets");
    for name in ["knot.obj", "vase.obj", "shrub.obj", "room.obj"] {
        let path = assets.join(name);
        let mesh = load(&path, &ignore_progress, &CancelToken::new()).expect("whole").mesh;
        let faces = faces_from_tobj(&path);
        // Index the faces by their corners.
        let mut around: HashMap<_, Vec<usize>> = HashMap::new();
        for (face, corners) in faces.iter().enumerate() {
            corners.iter().for_each(|(bits, _)| around.entry(*bits).or_default().push(face));
        }
        let has = |face: usize, (bits, normal): &CornerBits| {
            faces[face]
                .iter()
                .any(|(at, found)| at == bits && (*found == Vec3::ZERO || found.distance(*normal) < 1e-6))
        };
        for triangle in &mesh.triangles {
            let corners = triangle.map(|index| {
                let index = index as usize;
                let uv = mesh.uvs.get(index).copied().unwrap_or_default();
                corner_of(mesh.positions[index], uv, mesh.normals[index])
            });
            let candidates = around.get(&corners[0].0).map_or(&[][..], Vec::as_slice);
            let is_part = candidates.iter().any(|face| corners.iter().all(|corner| has(*face, corner)));
            assert!(is_part, "{name}: {corners:?}");
        }
        // A face whose corners coincide at a pole has fewer triangles.
        let places =
            |face: &Vec<CornerBits>| face.iter().map(|((at, _), _)| *at).collect::<BTreeSet<_>>().len();
        let count: usize = faces.iter().map(|face| places(face) - 2).sum();
        assert_eq!(mesh.triangles.len(), count, "{name}");
    }
}
