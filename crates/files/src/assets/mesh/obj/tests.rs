use super::*;
use crate::assets::Dropped;
use crate::assets::mesh::load;
use crate::control::{CancelToken, unwatched};
use std::fs;

fn read_with(files: &[(&str, &[u8])]) -> Result<LoadedMesh, AssetError> {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in files {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    load(&folder.path().join(files[0].0), &unwatched, &CancelToken::new())
}

fn read(text: &str) -> Result<LoadedMesh, AssetError> {
    read_with(&[("a.obj", text.as_bytes())])
}

fn says(text: &str) -> String {
    let text = read(text).expect_err("refused").to_string();
    text.rsplit_once("/a.obj").map_or(text.clone(), |(_, rest)| rest.to_owned())
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn corners_with_other_uvs_are_other_vertices() {
    let text = format!("{SQUARE}vt 0 0\nvt 1 0.25\nvn 0 0 2\nf 1/1/1 2/2/1 3/1/1\nf 1/2/1 3/1/1 4/1/1\n");
    let mesh = read(&text).expect("whole").mesh;
    assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.normals.len()), (5, 5, 5));
    assert_eq!(mesh.uvs[1], Vec2::new(1.0, 0.25));
    assert_eq!(mesh.normals, [Vec3::Z; 5]);
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 2, 4]]);
}

#[test]
fn quads_relative_indices_and_long_lines_are_read() {
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
fn triangles_know_their_materials() {
    let text = format!("mtllib my one.mtl\n{SQUARE}f 1 2 3\nusemtl b\nf 1 3 4\nusemtl none\nf 2 3 4\n");
    let mtl = b"newmtl a\nKd 1 0 0\nnewmtl b\nKe 5 5 5\n";
    let loaded = read_with(&[("a.obj", text.as_bytes()), ("my one.mtl", mtl)]).expect("whole");
    assert_eq!(loaded.mesh.materials, [u32::MAX, 1, u32::MAX]);
    assert_eq!(loaded.materials[1].emission, Vec3::splat(5.0));
    assert_eq!(loaded.material_warnings, ["no material is named \"none\""]);
}

#[test]
fn a_byte_order_mark_before_a_library_is_no_part_of_its_first_word() {
    let object = format!("mtllib a.mtl\n{SQUARE}usemtl m\nf 1 2 3\n");
    let library = "\u{feff}newmtl m\nKd 0 1 0\n";
    let loaded = read_with(&[("a.obj", object.as_bytes()), ("a.mtl", library.as_bytes())]).expect("whole");
    assert_eq!(loaded.materials.len(), 1);
}

#[test]
fn a_missing_library_is_a_warning_and_a_wrong_one_an_error() {
    let text = format!("mtllib none.mtl\nusemtl red\n{SQUARE}f 1 2 3\n");
    let loaded = read(&text).expect("a mesh all the same");
    assert_eq!(
        (loaded.material_warnings.len(), loaded.materials.len(), loaded.mesh.materials.len()),
        (1, 0, 0)
    );
    assert!(loaded.material_warnings[0].contains("none.mtl"), "{:?}", loaded.material_warnings);
    let result = read_with(&[("a.obj", text.as_bytes()), ("none.mtl", b"newmtl red\nKd 1 2\n")]);
    assert!(result.expect_err("refused").to_string().contains("none.mtl:2: `Kd`"));
}

#[test]
fn groups_without_normals_get_them_when_others_have_some() {
    let text = format!("{SQUARE}vn 0 0 -1\no one\nf 1//1 2//1 3//1\no two\nf 1 3 4\n");
    let mesh = read(&text).expect("whole").mesh;
    assert_eq!(mesh.normals, [Vec3::NEG_Z, Vec3::NEG_Z, Vec3::NEG_Z, Vec3::Z, Vec3::Z, Vec3::Z]);
    let mixed = format!("{SQUARE}vt 0 1\no one\nf 1/1 2 3\n");
    let loaded = read(&mixed).expect("whole");
    assert!(loaded.warnings[0].contains("\"one\"") && loaded.mesh.uvs.iter().all(|uv| *uv == Vec2::ZERO));
}

#[test]
fn what_tobj_accepts_is_dropped_and_counted() {
    let text = format!("{SQUARE}v nan 0 0\nv 1e999 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 6\nf 1 2\nf 1\nf 1 1 2\n");
    let loaded = read(&text).expect("one face is good");
    assert_eq!(loaded.dropped, Dropped { non_finite: 2, degenerate: 3 });
    assert_eq!(loaded.mesh.positions.len(), 3);
}

#[test]
fn errors_name_the_line() {
    assert_eq!(says("v 0 0 0\nv 1 0 0\nf 1 2 3\n"), ":3: vertex 3 is out of range: there are 2, from 1");
    assert_eq!(says(&format!("{SQUARE}f 1 2 -9\n")), ":5: vertex -9 is out of range: there are 4, from 1");
    assert_eq!(
        says(&format!("{SQUARE}vt 0 0\n\n# x\nf 1/1 2/2 3/1\n")),
        ":8: texture coordinate 2 is out of range: there are 1, from 1"
    );
    assert_eq!(says("v 0 0\n"), ":1: expected 3 coordinates, found 2");
    assert_eq!(says("v 0 zero 0\n"), ":1: expected 3 coordinates, found \"zero\"");
    assert_eq!(says(&format!("{SQUARE}f 1 2 x\n")), ":5: expected a corner like 1/2/3, found \"x\"");
    assert_eq!(says(&format!("{SQUARE}f 0 1 2\n")), ":5: vertex 0 is out of range: there are 4, from 1");
    assert!(says(SQUARE).contains("no usable face"));
    assert!(says("").contains("the file is empty"));
}

#[test]
fn a_face_of_very_many_corners_ends() {
    let corners: Vec<String> = (0..300_000).map(|index| (index % 4 + 1).to_string()).collect();
    let loaded = read(&format!("{SQUARE}f {}\n", corners.join(" "))).expect("a fan");
    assert!(!loaded.mesh.triangles.is_empty());
}

#[test]
fn comments_may_stand_behind_a_statement() {
    let plain = read(&format!("{SQUARE}vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n")).expect("whole").mesh;
    for text in [
        "v 0 0 0 # a\nv 1 0 0#\nv 1 1 0 # 1 2 3\nv 0 1 0\nvt 0 0 # x\nvn 0 0 1# y\nf 1/1/1 2/1/1 3/1/1 4/1/1 # x\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 \\\n3/1/1 4/1/1# C:\\\n# D:\\\n",
        // A comment ends with its line, whatever its last character.
        "# C:\\models\\\nv 0 0 0 # \\\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nl 1 2 # x\n",
    ] {
        assert_eq!(read(text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh, plain, "{text}");
    }
    assert_eq!(
        says("v 0 0 0 # a\nv 1 0 0 # b\n# c\nf 1 2 3 # d\n"),
        ":4: vertex 3 is out of range: there are 2, from 1"
    );
    assert_eq!(says("v 0 0 # 0\n"), ":1: expected 3 coordinates, found 2");
    assert_eq!(says(&format!("{SQUARE}f 1 2 \\\n x\n")), ":5: expected a corner like 1/2/3, found \"x\"");
}

#[test]
fn names_are_told_from_comments_by_what_there_is() {
    let mtl = b"# of old\nnewmtl Material #25 # the floor\nKd 1 0 0 # red\nNs 10 # dull\nnewmtl b # c\nillum 2 # d\n\
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
fn colours_and_weights_behind_coordinates() {
    // Some vertices with a colour, some without.
    let text = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 1 1 1 # white\nf 1 2 3\n";
    let mesh = read(text).expect("whole").mesh;
    assert_eq!((mesh.positions[2], mesh.colors.len()), (Vec3::Y, 0));
    // All of them with a colour, and corners that differ in texture coordinates.
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 0.2 0\nv 0 1 0 1 1 1 # white\nvt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/2 3/1 2/1\n";
    let mesh = read(text).expect("whole").mesh;
    assert_eq!(mesh.colors, [[255, 0, 0], [0, 51, 0], [255, 255, 255], [255, 0, 0]]);
    // Words are no colours.
    let text = "v 0 0 0 a b c\nv 1 0 0 a b c\nv 0 1 0 a b c\nf 1 2 3\n";
    assert_eq!(read(text).expect("whole").mesh.colors.len(), 0);
    assert_eq!(
        read("v 0 0 0 2\nv 1 0 0 2\nv 0 1 0 0.5\nf 1 2 3\n").expect("whole").mesh.positions[2],
        Vec3::Y * 2.0
    );
    assert_eq!(says("v 0 0 0\nv 1 0 0 0\nv 0 1 0\nf 1 2 3\n"), ":2: the weight of a vertex is 0");
    assert_eq!(says("v 0 0 0 1 0\n"), ":1: coordinates are followed by one weight or three colours");
}

#[test]
fn a_texture_coordinate_alone_has_another_one_of_zero() {
    let faces = "f 1/1 2/2 3/3\n";
    for coordinates in
        ["vt 0\nvt 0.5 0\nvt 1\n", "vt 0 # 1\nvt \\\n .5\nvt 1 \\\n", "vt\t0\r\nvt 0.5 0 0\nvt 1 "]
    {
        let text = format!("{SQUARE}{coordinates}\n{faces}");
        let mesh = read(&text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh;
        assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::new(0.5, 0.0), Vec2::X], "{text}");
    }
    assert_eq!(says("vt 0\nvt\nv 0 0 0\n"), ":2: expected 2 texture coordinates, found 0");
    assert_eq!(says("vt 0\nv 0 0\n"), ":2: expected 3 coordinates, found 2");
}

#[test]
fn lines_may_end_in_carriage_returns_alone() {
    let plain = read(&format!("# a\n{SQUARE}f 1 2 3 4\n")).expect("whole").mesh;
    let old = format!("# a\n{SQUARE}f 1 2 3 4\n").replace('\n', "\r");
    assert_eq!(read(&old).expect("whole").mesh, plain);
    assert_eq!(says("v 0 0 0\rv 1 0\r"), ":2: expected 3 coordinates, found 2");
    let text = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\n").replace('\n', "\r");
    let loaded =
        read_with(&[("a.obj", text.as_bytes()), ("a.mtl", b"newmtl red\rKd 1 0 0\r")]).expect("whole");
    assert_eq!((loaded.material_warnings, loaded.materials[0].diffuse), (Vec::new(), Vec3::X));
}

#[test]
fn a_corner_that_ends_with_a_slash_leaves_numbers_out() {
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
        // A comment ends with its line.
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
    for faces in ["f 1 2 3 /", "f 1 2 //", "f 1 2 /1/"] {
        let said = says(&format!("{head}{faces}\n"));
        assert!(said.starts_with(":9: expected a corner like 1/2/3"), "{faces}: {said}");
    }
    for whole in
        ["g here/\nf 1 2 3", "# f 1/\nf 1 2 3", "mtllib f/ 1/\nf 1 2 3", "f 1 2 3 \\\n\ng here/ there"]
    {
        assert_eq!(mesh(whole), plain, "{whole}");
    }
}

#[test]
fn a_usemtl_without_a_name_ends_the_material() {
    for none in ["usemtl", "usemtl ", "  usemtl\t", "usemtl\r"] {
        let text = format!("mtllib a.mtl\n{SQUARE}usemtl red\nf 1 2 3\n{none}\nf 1 3 4\n");
        let files = [("a.obj", text.as_bytes()), ("a.mtl", &b"newmtl red\nKd 1 0 0\n"[..])];
        let loaded = read_with(&files).expect("whole");
        assert_eq!(loaded.mesh.materials, [0, u32::MAX], "{none:?}");
        assert!(loaded.material_warnings.is_empty(), "{none:?}: {:?}", loaded.material_warnings);
        assert_eq!(
            says(&format!("{SQUARE}{none}\nf 1 2 9\n")),
            ":6: vertex 9 is out of range: there are 4, from 1"
        );
    }
}

#[test]
fn a_colour_that_is_no_number_has_its_line() {
    let said = says("v 0 0 0 1 1 1\nv 1 0 0 nan nan nan\nv 0 1 0 1 1 1\nf 1 2 3\n");
    assert_eq!(said, ":2: the colours of a vertex are finite numbers");
}

#[test]
fn a_survey_heeds_the_token() {
    let token = CancelToken::new();
    assert!(Survey::of(b"f 1 2 3\n", &token).is_ok());
    token.cancel();
    assert!(Survey::of(b"f 1 2 3\n", &token).is_err());
}
