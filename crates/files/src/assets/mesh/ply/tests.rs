use std::path::Path;

use super::*;
use crate::assets::read::Watch;
use crate::control::{CancelToken, ignore_progress};
use crate::math::{Vec2, Vec3};

fn read_bytes(bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
    let token = CancelToken::new();
    let watch = Watch { progress: &ignore_progress, token: &token };
    parse(&Source { path: Path::new("a.ply"), bytes, watch })
}

fn says(bytes: &[u8]) -> String {
    read_bytes(bytes).expect_err("refused").to_string()
}

const VERTEX: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const FACE: &str = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

fn ascii(body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\ncomment made here\n{VERTEX}{FACE}{body}").into_bytes()
}

#[test]
fn text_with_either_line_end() {
    let text = ascii(&format!("{SQUARE}4 0 1 2 3\n"));
    let mesh = read_bytes(&text).expect("whole").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
    let windows = String::from_utf8(text).expect("text").replace('\n', "\r\n");
    assert_eq!(read_bytes(windows.as_bytes()).expect("whole").mesh, mesh);
}

/// A file with every type, unknown properties and elements, lists in vertices and an element before the vertices.
fn wild(big_endian: bool) -> Vec<u8> {
    let order = if big_endian { "big" } else { "little" };
    let mut file = format!(
        "ply\nformat binary_{order}_endian 1.0\nobj_info x\nelement camera 2\nproperty short a\nproperty list int \
         double b\nelement empty 4000000000\nelement vertex 3\nproperty uchar red\nproperty double x\nproperty int16 \
         y\nproperty float z\nproperty list uchar ushort seen_by\nproperty float nx\nproperty float ny\nproperty \
         float nz\nproperty float s\nproperty uint8 t\nelement face 1\nproperty char flag\nproperty list uchar float \
         texcoord\nproperty list uint32 uint16 vertex_index\nend_header\n"
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let mut bytes = little.to_vec();
        if big_endian {
            bytes.reverse();
        }
        file.extend(bytes);
    };
    for length in [0_i32, 2] {
        put(&7_i16.to_le_bytes());
        put(&length.to_le_bytes());
        (0..length).for_each(|_| put(&1.5_f64.to_le_bytes()));
    }
    for (x, y) in [(0.0_f64, 0_i16), (2.5, 0), (0.0, -300)] {
        put(&[200]);
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&0.25_f32.to_le_bytes());
        put(&[1]);
        put(&513_u16.to_le_bytes());
        [0.0_f32, 0.0, -3.0, 0.75].iter().for_each(|value| put(&value.to_le_bytes()));
        put(&[1]);
    }
    put(&[255]);
    put(&[1]);
    put(&0.5_f32.to_le_bytes());
    put(&3_u32.to_le_bytes());
    [0_u16, 2, 1].iter().for_each(|index| put(&index.to_le_bytes()));
    file
}

#[test]
fn binary_of_both_orders_and_all_types() {
    let mesh = read_bytes(&wild(false)).expect("little").mesh;
    assert_eq!(
        mesh.positions,
        [Vec3::new(0., 0., 0.25), Vec3::new(0., -300., 0.25), Vec3::new(2.5, 0., 0.25)]
    );
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.normals, [Vec3::NEG_Z; 3]);
    assert_eq!(mesh.uvs, [Vec2::new(0.75, 1.0); 3]);
    assert_eq!(read_bytes(&wild(true)).expect("big").mesh, mesh);
}

#[test]
fn every_truncation_is_an_error() {
    let whole = wild(true);
    for length in 0..whole.len() {
        assert!(read_bytes(&whole[..length]).is_err(), "{length} of {}", whole.len());
    }
}

#[test]
fn faces_may_come_before_vertices() {
    let text = format!(
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\n{VERTEX}end_header\n3 0 1 \
         2\n{SQUARE}"
    );
    assert_eq!(read_bytes(text.as_bytes()).expect("whole").mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn errors_name_line_or_face() {
    assert!(
        says(&ascii(&format!("{SQUARE}3 0 1 4\n"))).starts_with("a.ply:15: face 1: vertex 4 is out of range")
    );
    assert!(
        says(&ascii("0 0 0\n1 x 0\n0 0 0\n0 0 0\n3 0 1 2\n"))
            .contains("a.ply:12: vertex 2: expected a number")
    );
    assert!(says(&ascii(&format!("{SQUARE}-3 0 1 2\n"))).contains("the length of a list is -3"));
    let mut binary = wild(false);
    let last = binary.len() - 2;
    binary[last] = 9;
    assert_eq!(says(&binary), "a.ply: face 1: vertex 9 is out of range: there are 3, from 0");
    assert!(says(b"plx\n").starts_with("a.ply:1: expected ply, found \"plx\""));
    assert!(
        says(b"ply\nformat ascii 1.0\nelement vertex many\n").starts_with("a.ply:3: \"many\" is no number")
    );
    assert!(says(b"ply\nproperty float x\n").contains("a.ply:2: a property before"));
    assert!(says(b"ply\nformat utf8 1.0\n").contains("a.ply:2: the format is ascii"));
    assert!(says(b"ply\nelement v 1\nproperty half x\n").contains("a.ply:3: \"half\" is no type"));
    assert!(says(b"ply\nend_header\n").contains("no format"));
    assert!(says(b"ply\nformat ascii 1.0\n").contains("no end_header"));
    let flat = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n";
    assert!(says(flat.as_bytes()).contains("no x, y and z"));
}

#[test]
fn lies_cost_nothing() {
    for encoding in ["ascii", "binary_little_endian"] {
        let vertices = VERTEX.replace('4', "4000000000");
        let text = format!("ply\nformat {encoding} 1.0\n{vertices}{FACE}0 0 0\n");
        assert!(
            says(text.as_bytes())
                .contains("claims 4000000000 times the element `vertex`, and only 6 bytes follow")
        );
        let faces = FACE.replace("face 1", "face 4000000000");
        let text = format!("ply\nformat {encoding} 1.0\n{faces}");
        assert!(says(text.as_bytes()).contains("claims 4000000000 times the element `face`"));
    }
    let list = FACE.replace("uchar int", "uint int");
    let mut file = format!("ply\nformat binary_little_endian 1.0\n{VERTEX}{list}").into_bytes();
    file.extend([0; 48]);
    file.extend(4_000_000_000_u32.to_le_bytes());
    assert!(says(&file).contains("face 1: it claims 4000000000 corners"));
}

#[test]
fn a_header_that_is_too_long_names_the_limit() {
    let comments = format!("comment {}\n", "x".repeat(100)).repeat(10_000);
    let long = format!("ply\nformat ascii 1.0\n{comments}{VERTEX}{FACE}{SQUARE}4 0 1 2 3\n");
    let reason = says(long.as_bytes());
    assert!(
        reason.ends_with("no end_header in its first 1 MiB, and no more than that is read of a header"),
        "{reason}"
    );
    let line = format!("ply\ncomment {}", "x".repeat(2 << 20));
    assert!(says(line.as_bytes()).contains("no end_header in its first 1 MiB"));
    // Take a header just below the limit, cut within a statement.
    let comments = format!("comment {}\n", "x".repeat(100)).repeat(9_000);
    let fits = format!("ply\nformat ascii 1.0\n{comments}{VERTEX}{FACE}{SQUARE}4 0 1 2 3\n");
    assert!(read_bytes(fits.as_bytes()).is_ok());
    assert_eq!(says(b"ply\nformat ascii 1.0\n"), "a.ply: the header has no end_header");
}

#[test]
fn a_list_of_negative_length_is_said_to_be_one() {
    assert_eq!(says(&ascii(&format!("{SQUARE}-3 0 1 2\n"))), "a.ply:15: face 1: the length of a list is -3");
    assert!(says(&ascii(&format!("{SQUARE}999 0 1 2\n"))).contains("it claims 999 corners"));
}

#[test]
fn vertices_have_colours() {
    let with = |properties: &str, colors: [&str; 4]| {
        let vertices = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"];
        let lines: String =
            vertices.iter().zip(colors).map(|(place, color)| format!("{place} {color}\n")).collect();
        let text = format!("ply\nformat ascii 1.0\n{VERTEX}{properties}{FACE}{lines}4 0 1 2 3\n");
        read_bytes(text.as_bytes()).expect("whole").mesh.colors
    };
    let bytes = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";
    let read = with(bytes, ["255 0 51 9", "1 2 3 9", "0 0 0 9", "4 5 6 9"]);
    assert_eq!(read, [[255, 0, 51], [1, 2, 3], [0, 0, 0], [4, 5, 6]]);
    let floats = "property float r\nproperty float g\nproperty float b\n";
    assert_eq!(with(floats, ["1 0 0.2", "2 -1 nan", "0 0 0", "1 1 1"])[..2], [[255, 0, 51], [255, 0, 0]]);
    assert_eq!(with("property uchar red\n", ["1", "2", "3", "4"]), [[0; 3]; 0]);
}

#[test]
fn strips_are_triangles_that_turn_in_turns() {
    let file = |strips: &str, elements: &str| {
        let header = format!("ply\nformat ascii 1.0\n{VERTEX}{elements}end_header\n");
        format!("{header}{SQUARE}{strips}").into_bytes()
    };
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let read = |list: &str| read_bytes(&file(list, strips)).expect("whole");
    // Across the square and back: both triangles face the same side.
    assert_eq!(read("4 0 1 3 2\n").mesh.triangles, [[0, 1, 3], [3, 1, 2]]);
    // −1 begins anew.
    assert_eq!(read("7 0 1 3 -1 0 1 2\n").mesh.triangles, [[0, 1, 3], [0, 1, 2]]);
    // A vertex that is repeated joins strips, and no face is missing.
    let joined = read("8 0 1 3 3 3 1 2 0\n");
    assert_eq!(joined.mesh.triangles, [[0, 1, 3], [3, 1, 2], [2, 1, 0]]);
    assert_eq!(joined.dropped, crate::assets::Dropped::default());
    assert!(says(&file("3 0 1 4\n", strips)).contains("vertex 4 is out of range: there are 4, from 0"));
    assert!(says(&file("3 0 1 -2\n", strips)).contains("vertex -2 is out of range"));
    assert!(says(&file("900 0 1 2\n", strips)).contains("more than the file can hold"));
    assert!(
        says(&file("", "element tristrips 0\nproperty float vertex_indices\n")).contains("no list of whole")
    );
    // Beside faces they are left aside.
    let both = format!("{strips}element face 1\nproperty list uchar int vertex_indices\n");
    assert_eq!(read_bytes(&file("4 0 1 3 2\n3 0 1 2\n", &both)).expect("whole").mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn a_line_of_a_header_that_says_nothing_is_skipped_with_a_warning() {
    let text = String::from_utf8(ascii(&format!("{SQUARE}4 0 1 2 3\n"))).expect("text");
    let plain = read_bytes(text.as_bytes()).expect("whole");
    let odd = text.replace("comment made here", "Created by hand, with love");
    let read = read_bytes(odd.as_bytes()).expect("whole");
    assert_eq!(read.mesh, plain.mesh);
    assert_eq!(read.warnings, ["line 3: \"Created\" is no statement of a PLY header: the line is skipped"]);
    let odd = text.replace("comment made here", "Created by hand\nwith love\nlong ago");
    let more = ["line 3: \"Created\" is no statement of a PLY header: the line and 2 more are skipped"];
    assert_eq!(read_bytes(odd.as_bytes()).expect("whole").warnings, more);
    // Misspelt statements.
    assert!(
        says(text.replace("element face", "elment face").as_bytes()).contains("\"elment\" is no statement")
    );
    assert!(says(text.replace("property float z", "porperty float z").as_bytes()).contains("\"porperty\""));
    let said = says(text.replace("format", "frmat").as_bytes());
    assert!(said.contains("no format line; line 2: \"frmat\" is no statement"), "{said}");
    // A statement that is not whole could mean anything.
    assert!(says(text.replace("comment made here", "element box").as_bytes()).contains("is no statement"));
    assert!(says(text.replace("comment made here", "format").as_bytes()).contains("is no statement"));
    assert!(says(&[b"ply\n".as_slice(), &[7; 3000]].concat()).contains("end_header"));
}

/// Some programs write lists that their header does not name. Others read such files line by line.
#[test]
fn values_that_the_header_does_not_name_are_left_out_line_by_line() {
    let plain = read_bytes(&ascii(&format!("{SQUARE}3 0 1 2\n").replace('\u{0}', ""))).expect("whole");
    for body in [
        "0 0 0 9 9\n1 0 0\n1 1 0 9\n\n0 1 0\n3 0 1 2\n",
        "0 0 0\n1 0 0\n1 1 0\n0 1 0 0.5\n3 0 1 2 6 0.5 0.5\n",
    ] {
        let read = read_bytes(&ascii(body)).expect("whole");
        assert_eq!(read.mesh, plain.mesh, "{body}");
        assert_eq!(read.warnings.len(), 1);
        let line = if body.contains("9 9") { 11 } else { 14 };
        let said =
            format!("line {line} and 1 more have more values than the header names: those are left out");
        assert_eq!(read.warnings[0], said);
    }
    // A file that is cut short as well is not taken word by word.
    let rows = "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n";
    let cut = "a.ply: the header claims 1 times the element `face`, and only 0 bytes follow";
    assert_eq!(says(&ascii(rows)), cut);
    assert_eq!(says(&ascii("0 0 0 9\n1 0 0\n1 1 0\n0 1 0\n")), "a.ply:15: face 1: the file ends here");
    // Where there are too few, the error is that of the file as it stands.
    let said = says(&ascii("0 0 0 9\n1 0 0\n1 1 0\n0 1 0\n3 0 1\n"));
    assert!(said.starts_with("a.ply:"), "{said}");
    // Several items in a line are fine.
    let joined = read_bytes(&ascii("0 0 0 1 0 0\n1 1 0 0 1 0\n3 0 1 2\n")).expect("whole");
    assert_eq!((joined.mesh, joined.warnings.len()), (plain.mesh, 0));
}

/// A text with the square's vertices, and faces with these properties and lines.
fn square(vertex: (&str, [&str; 4]), face: &str, lines: &[&str]) -> String {
    let (properties, tails) = vertex;
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    let vertices: String = SQUARE.lines().zip(tails).map(|(line, tail)| format!("{line} {tail}\n")).collect();
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\n{xyz}{properties}element face {}\n\
         property list uchar int vertex_indices\n{face}end_header\n{vertices}{}\n",
        lines.len(),
        lines.join("\n")
    )
}

const PLAIN: (&str, [&str; 4]) = ("", [""; 4]);

/// The value of each corner of the triangles.
fn of_corners<T: Copy>(loaded: &LoadedMesh, values: &[T]) -> Vec<T> {
    loaded
        .mesh
        .triangles
        .as_flattened()
        .iter()
        .filter_map(|vertex| values.get(*vertex as usize))
        .copied()
        .collect()
}

fn loaded(text: &str) -> LoadedMesh {
    read_bytes(text.as_bytes()).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn texture_coordinates_of_corners_are_read() {
    let list = "property list uchar float texcoord\n";
    let uvs = |face: &str, lines: &[&str]| {
        let loaded = loaded(&square(PLAIN, face, lines));
        (of_corners(&loaded, &loaded.mesh.uvs), loaded.warnings)
    };
    let [a, b, c, d] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let both = vec![a, b, c, a, c, d];
    let two = ["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0 0 1 1 0 1"];
    assert_eq!(uvs(list, &two), (both.clone(), vec![]));
    assert_eq!(uvs(list, &["4 0 1 2 3 8 0 0 1 0 1 1 0 1"]), (both.clone(), vec![]));
    assert_eq!(uvs(list, &["4 0 1 2 3 12 0 0 9 1 0 9 1 1 9 0 1 9"]), (both.clone(), vec![]));
    for name in ["texcoords", "uv", "st", "texture_coordinates"] {
        assert_eq!(uvs(&list.replace("texcoord", name), &two).0, both, "{name}");
    }
    let numbered = format!("{list}property int texnumber\n");
    assert_eq!(
        uvs(&numbered, &["3 0 1 2 6 0 0 1 0 1 1 2", "3 0 2 3 6 0 0 1 1 0 1 2"]),
        (both.clone(), vec![])
    );
    let several = "the faces have several textures (`texnumber`): all show those of one material";
    assert_eq!(
        uvs(&numbered, &["3 0 1 2 6 0 0 1 0 1 1 0", "3 0 2 3 6 0 0 1 1 0 1 1"]),
        (both, vec![several.to_owned()])
    );
    // Those of a face are for all of its corners.
    let one = vec![Vec2::new(0.5, 0.25); 6];
    assert_eq!(uvs(list, &["4 0 1 2 3 2 0.5 0.25"]).0, one);
    assert_eq!(uvs("property float u\nproperty float v\n", &["4 0 1 2 3 0.5 0.25"]).0, one);
    assert_eq!(uvs("property double s\nproperty double t\n", &["4 0 1 2 3 0.5 0.25"]).0, one);
    // An empty list is nothing to warn of; a wrong one is.
    assert_eq!(uvs(list, &[two[0], "3 0 2 3 0"]), (vec![a, b, c, a, a, a], vec![]));
    let (found, warnings) = uvs(list, &[two[0], "3 0 2 3 5 1 1 1 1 1"]);
    assert_eq!(found, [a, b, c, a, a, a]);
    let does_not_fit = "line 15: face 2: the number of texture coordinates or colors does not fit the corners: ignored there";
    assert_eq!(warnings, [does_not_fit]);
    assert!(uvs("", &["3 0 1 2"]).0.is_empty());
}

#[test]
fn seams_of_textures_keep_the_normals_of_vertices() {
    let list = "property list uchar float texcoord\n";
    let text = square(PLAIN, list, &["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0.5 0.5 1 0 0 1"])
        .replace("1 1 0 \n", "1 1 5 \n");
    let mesh = loaded(&text).mesh;
    let normals = crate::assets::mesh::vertex_normals(&mesh, &CancelToken::new()).expect("nobody cancels");
    assert_eq!(mesh.positions.len(), 6);
    for (a, b) in [(0, 3), (2, 4)] {
        let [a, b] = [(0, a), (1, b - 3)].map(|(face, corner)| mesh.triangles[face][corner] as usize);
        assert!(a != b && normals[a] == normals[b], "{normals:?}");
    }
}

#[test]
fn vertex_colors_of_every_type_and_range() {
    let colors = |scalar: &str, names: [&str; 3], tail: &str| {
        let properties: String = names.iter().map(|name| format!("property {scalar} {name}\n")).collect();
        let loaded = loaded(&square((&properties, [tail; 4]), "", &["3 0 1 2"]));
        loaded.mesh.colors[0]
    };
    let names = ["red", "green", "blue"];
    for (scalar, tail) in [
        ("uchar", "200 100 50"),
        ("int", "200 100 50"),
        ("uint", "200 100 50"),
        ("short", "200 100 50"),
        ("ushort", "200 100 50"),
        ("float", "200 100 50"),
        ("double", "200.0 100.2 50.0"),
        ("float", "0.784314 0.392157 0.196078"),
        ("ushort", "51400 25700 12850"),
        ("int", "51400 25700 12850"),
        ("uint", "3368601800 1684300900 842150450"),
    ] {
        assert_eq!(colors(scalar, names, tail), [200, 100, 50], "{scalar} {tail}");
    }
    for names in [["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]] {
        assert_eq!(colors("uchar", names, "200 100 50"), [200, 100, 50], "{names:?}");
    }
}

#[test]
fn a_face_that_crosses_itself_has_a_line() {
    let vertices = "0 0 0\n3 0 0\n0 1 0\n3 2 0\n";
    let faces = FACE.replace("face 1", "face 3");
    let header = format!("ply\nformat ascii 1.0\n{VERTEX}{faces}");
    for (last, is_by_lines) in [("4 0 1 2 3", false), ("4 0 1 2 3 9", true)] {
        let text = format!("{header}{vertices}3 0 1 2\n4 0 1 3 2\n{last}\n");
        let warnings = read_bytes(text.as_bytes()).expect("whole").warnings;
        assert_eq!(warnings.len(), 1 + usize::from(is_by_lines));
        assert!(warnings[0].starts_with("line 16: face 3 "), "{warnings:?}");
    }
}

#[test]
fn an_alpha_below_one_is_warned_of() {
    let warnings = |scalar: &str, tail: &str| {
        let names = ["red", "green", "blue", "alpha"];
        let properties: String = names.iter().map(|name| format!("property {scalar} {name}\n")).collect();
        loaded(&square((&properties, [tail; 4]), "", &["3 0 1 2"])).warnings
    };
    for (scalar, opaque, faded) in [
        ("uchar", "9 9 9 255", "9 9 9 254"),
        ("float", "1 1 1 1", "1 1 1 0.5"),
        ("float", "9 9 9 255", "9 9 9 9"),
    ] {
        assert!(warnings(scalar, opaque).is_empty(), "{scalar} {opaque}");
        let found = warnings(scalar, faded);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("line 14: "), "{found:?}");
    }
}

#[test]
fn colors_of_faces_and_of_corners_are_read() {
    let parts =
        |scalar: &str| ["red", "green", "blue"].map(|name| format!("property {scalar} {name}\n")).concat();
    let colors = |vertex, face: &str, lines: &[&str]| {
        let loaded = loaded(&square(vertex, face, lines));
        (of_corners(&loaded, &loaded.mesh.colors), loaded.warnings)
    };
    let (red, green, blue) = ([255, 0, 0], [0, 255, 0], [0, 0, 255]);
    let both = [[red; 3], [green; 3]].concat();
    assert_eq!(
        colors(PLAIN, &parts("uchar"), &["3 0 1 2 255 0 0", "3 0 2 3 0 255 0"]),
        (both.clone(), vec![])
    );
    assert_eq!(colors(PLAIN, &parts("float"), &["3 0 1 2 1 0 0", "3 0 2 3 0 1 0"]).0, both);
    assert_eq!(colors(PLAIN, &parts("float"), &["3 0 1 2 255 0 0", "3 0 2 3 0 255 0"]).0, both);
    let list = "property list uchar float color\n";
    let corners = ["3 0 1 2 9 1 0 0 0 1 0 0 0 1", "3 0 2 3 4 0 1 0 1"];
    assert_eq!(colors(PLAIN, list, &corners), ([red, green, blue, green, green, green].to_vec(), vec![]));
    assert_eq!(colors(PLAIN, list, &[corners[0], "3 0 2 3 0"]).0[3..], [[255; 3]; 3]);
    let vertex = parts("uchar");
    let (found, warnings) = colors((&vertex, ["0 0 255"; 4]), &parts("uchar"), &["3 0 1 2 255 0 0"]);
    assert_eq!(
        (found, warnings),
        (vec![blue; 3], vec!["the colors of the faces are ignored: the vertices have colors".to_owned()])
    );
}
