use std::path::Path;

use super::super::parsed::{
    FACE_COLORS_IGNORED, alpha_ignored_warning, clamped_color_warning, dropped_color_fractions_warning,
};
use super::super::text::expected_message;
use super::body::END_OF_FILE;
use super::faces::{SEVERAL_TEXTURES, attribute_list_length_warning};
use super::header::{
    NO_END, NO_FORMAT, PROPERTY_FIRST, header_too_long_message, ignored_texture_warning,
    invalid_count_message, invalid_statement_message, skipped_lines_warning, unknown_encoding_message,
    unknown_keyword_message, unknown_type_message,
};
use super::*;
use crate::assets::expect_rejection;
use crate::assets::read::Monitor;
use crate::control::{CancelToken, ignore_progress};
use crate::math::{Vec2, Vec3};

fn read_bytes(bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
    let token = CancelToken::new();
    let monitor = Monitor { progress: &ignore_progress, token: &token };
    parse(&MeshFileBytes { path: Path::new("a.ply"), bytes, monitor })
}

fn error(bytes: &[u8]) -> (Option<usize>, String) {
    expect_rejection(read_bytes(bytes))
}

/// Error in the first face.
fn face_error(reason: &str) -> String {
    item_error_message("face", 1, reason)
}

const VERTEX: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
const FACE: &str = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
const SQUARE: &str = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

fn ascii(body: &str) -> Vec<u8> {
    format!("ply\nformat ascii 1.0\ncomment made here\n{VERTEX}{FACE}{body}").into_bytes()
}

#[test]
fn both_line_ends_are_accepted() {
    let text = ascii(&format!("{SQUARE}4 0 1 2 3\n"));
    let mesh = read_bytes(&text).expect("whole").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
    let windows = String::from_utf8(text).expect("text").replace('\n', "\r\n");
    assert_eq!(read_bytes(windows.as_bytes()).expect("whole").mesh, mesh);
}

/// A file with all scalar types, unknown properties and elements, list properties on the vertices, and an
/// element before the vertices.
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
fn both_byte_orders_and_all_types_are_read() {
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
fn faces_may_precede_vertices() {
    let text = format!(
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\n{VERTEX}end_header\n3 0 1 \
         2\n{SQUARE}"
    );
    assert_eq!(read_bytes(text.as_bytes()).expect("whole").mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn errors_include_line_or_face() {
    for (body, line, reason) in [
        (format!("{SQUARE}3 0 1 4\n"), 15, face_error(&vertex_out_of_range_message(4, 4))),
        (format!("{SQUARE}-3 0 1 2\n"), 15, face_error(&negative_length_message(-3))),
        (format!("{SQUARE}999 0 1 2\n"), 15, face_error(&list_too_long_message(999))),
        (
            "0 0 0\n1 x 0\n0 0 0\n0 0 0\n3 0 1 2\n".to_owned(),
            12,
            item_error_message("vertex", 2, &expected_message("a number", b"x")),
        ),
    ] {
        assert_eq!(error(&ascii(&body)), (Some(line), reason));
    }
    let mut binary = wild(false);
    let last = binary.len() - 2;
    binary[last] = 9;
    assert_eq!(error(&binary), (None, face_error(&vertex_out_of_range_message(9, 3))));
    for (text, line, reason) in [
        ("plx\n", Some(1), expected_message("ply", b"plx")),
        ("ply\nformat ascii 1.0\nelement vertex many\n", Some(3), invalid_count_message("many", "vertex")),
        ("ply\nproperty float x\n", Some(2), PROPERTY_FIRST.to_owned()),
        ("ply\nformat utf8 1.0\n", Some(2), unknown_encoding_message("utf8")),
        ("ply\nelement v 1\nproperty half x\n", Some(3), unknown_type_message("half")),
        ("ply\nend_header\n", Some(2), NO_FORMAT.to_owned()),
        ("ply\nformat ascii 1.0\n", None, NO_END.to_owned()),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n",
            None,
            NO_POSITIONS.to_owned(),
        ),
    ] {
        assert_eq!(error(text.as_bytes()), (line, reason));
    }
}

#[test]
fn false_counts_cause_no_allocation() {
    for encoding in ["ascii", "binary_little_endian"] {
        let vertices = VERTEX.replace('4', "4000000000");
        let text = format!("ply\nformat {encoding} 1.0\n{vertices}{FACE}0 0 0\n");
        assert_eq!(error(text.as_bytes()).1, implausible_count_message("vertex", 4_000_000_000, 6));
        let faces = FACE.replace("face 1", "face 4000000000");
        let text = format!("ply\nformat {encoding} 1.0\n{faces}");
        assert_eq!(error(text.as_bytes()).1, implausible_count_message("face", 4_000_000_000, 0));
    }
    let list = FACE.replace("uchar int", "uint int");
    let mut file = format!("ply\nformat binary_little_endian 1.0\n{VERTEX}{list}").into_bytes();
    file.extend([0; 48]);
    file.extend(4_000_000_000_u32.to_le_bytes());
    assert_eq!(error(&file).1, face_error(&list_too_long_message(4_000_000_000)));
}

#[test]
fn the_header_size_is_limited() {
    let comments = format!("comment {}\n", "x".repeat(100)).repeat(10_000);
    let long = format!("ply\nformat ascii 1.0\n{comments}{VERTEX}{FACE}{SQUARE}4 0 1 2 3\n");
    assert_eq!(error(long.as_bytes()).1, header_too_long_message());
    let line = format!("ply\ncomment {}", "x".repeat(2 << 20));
    assert_eq!(error(line.as_bytes()).1, header_too_long_message());
    // This header is just short enough. The size limit is reached within a line after it.
    let comments = format!("comment {}\n", "x".repeat(100)).repeat(9_000);
    let fits = format!("ply\nformat ascii 1.0\n{comments}{VERTEX}{FACE}{SQUARE}4 0 1 2 3\n");
    assert!(read_bytes(fits.as_bytes()).is_ok());
}

#[test]
fn vertex_colors_are_read() {
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
fn strip_triangles_alternate_in_orientation() {
    let file = |strips: &str, elements: &str| {
        let header = format!("ply\nformat ascii 1.0\n{VERTEX}{elements}end_header\n");
        format!("{header}{SQUARE}{strips}").into_bytes()
    };
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let read = |list: &str| read_bytes(&file(list, strips)).expect("whole");
    // Both triangles in a strip have the same orientation.
    assert_eq!(read("4 0 1 3 2\n").mesh.triangles, [[0, 1, 3], [3, 1, 2]]);
    // −1 starts a new strip.
    assert_eq!(read("7 0 1 3 -1 0 1 2\n").mesh.triangles, [[0, 1, 3], [0, 1, 2]]);
    // A repeated vertex joins strips and is not counted as a dropped face.
    let joined = read("8 0 1 3 3 3 1 2 0\n");
    assert_eq!(joined.mesh.triangles, [[0, 1, 3], [3, 1, 2], [2, 1, 0]]);
    assert_eq!(joined.dropped, crate::assets::DroppedFaces::default());
    let strip_error = |reason: &str| item_error_message("tristrips", 1, reason);
    for (list, reason) in [
        ("3 0 1 4\n", vertex_out_of_range_message(4, 4)),
        ("3 0 1 -2\n", vertex_out_of_range_message(-2, 4)),
        ("900 0 1 2\n", list_too_long_message(900)),
    ] {
        assert_eq!(error(&file(list, strips)).1, strip_error(&reason));
    }
    let not_a_list = file("", "element tristrips 0\nproperty float vertex_indices\n");
    assert_eq!(error(&not_a_list).1, missing_vertex_indices_message("tristrips"));
    // Strips are ignored if there are faces.
    let both = format!("{strips}element face 1\nproperty list uchar int vertex_indices\n");
    assert_eq!(read_bytes(&file("4 0 1 3 2\n3 0 1 2\n", &both)).expect("whole").mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn unknown_header_lines_are_skipped_with_warning() {
    let text = String::from_utf8(ascii(&format!("{SQUARE}4 0 1 2 3\n"))).expect("text");
    let plain = read_bytes(text.as_bytes()).expect("whole");
    let odd = text.replace("comment made here", "Created by hand, with love");
    let read = read_bytes(odd.as_bytes()).expect("whole");
    assert_eq!(read.mesh, plain.mesh);
    let unknown = format!("line 3: {}", unknown_keyword_message("Created"));
    assert_eq!(read.warnings, [skipped_lines_warning(&unknown, 1)]);
    let odd = text.replace("comment made here", "Created by hand\nwith love\nlong ago");
    assert_eq!(read_bytes(odd.as_bytes()).expect("whole").warnings, [skipped_lines_warning(&unknown, 3)]);
    // Misspelled keywords are errors if they could change the meaning.
    let replaced = |from: &str, to: &str| error(text.replace(from, to).as_bytes());
    assert_eq!(replaced("element face", "elment face").1, invalid_statement_message("elment"));
    assert_eq!(replaced("property float z", "porperty float z").1, invalid_statement_message("porperty"));
    let misspelled = skipped_lines_warning(&format!("line 2: {}", unknown_keyword_message("frmat")), 1);
    assert_eq!(replaced("format", "frmat").1, format!("{NO_FORMAT}; {misspelled}"));
    // Incomplete statements are ambiguous, so they are errors.
    assert_eq!(replaced("comment made here", "element box").1, invalid_statement_message("element"));
    assert_eq!(replaced("comment made here", "format").1, invalid_statement_message("format"));
    assert_eq!(error(&[b"ply\n".as_slice(), &[7; 3000]].concat()).1, NO_END);
}

/// Some programs write lists without declaring them in the header. Other readers parse these files line by
/// line.
#[test]
fn undeclared_values_are_ignored() {
    let plain = read_bytes(&ascii(&format!("{SQUARE}3 0 1 2\n").replace('\u{0}', ""))).expect("whole");
    for body in [
        "0 0 0 9 9\n1 0 0\n1 1 0 9\n\n0 1 0\n3 0 1 2\n",
        "0 0 0\n1 0 0\n1 1 0\n0 1 0 0.5\n3 0 1 2 6 0.5 0.5\n",
    ] {
        let read = read_bytes(&ascii(body)).expect("whole");
        assert_eq!(read.mesh, plain.mesh, "{body}");
        assert_eq!(read.warnings.len(), 1);
        let line = if body.contains("9 9") { 11 } else { 14 };
        assert_eq!(read.warnings[0], extra_line_values_warning(line, 2));
    }
    // A truncated file with undeclared values must not be read word by word.
    let rows = "0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 1 2 3\n";
    assert_eq!(error(&ascii(rows)), (None, implausible_count_message("face", 1, 0)));
    let truncated = (Some(15), face_error(END_OF_FILE));
    assert_eq!(error(&ascii("0 0 0 9\n1 0 0\n1 1 0\n0 1 0\n")), truncated);
    // A face with too few corners is an error in both passes.
    assert!(error(&ascii("0 0 0 9\n1 0 0\n1 1 0\n0 1 0\n3 0 1\n")).0.is_some());
    // Several items may share a line.
    let joined = read_bytes(&ascii("0 0 0 1 0 0\n1 1 0 0 1 0\n3 0 1 2\n")).expect("whole");
    assert_eq!((joined.mesh, joined.warnings.len()), (plain.mesh, 0));
}

/// A text file with the square's vertices and the specified face properties and face lines.
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

/// Returns the values at the corners of all triangles.
fn at_corners<T: Copy>(loaded: &LoadedMesh, values: &[T]) -> Vec<T> {
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
fn corner_texture_coordinates_are_read() {
    let list = "property list uchar float texcoord\n";
    let uvs = |face: &str, lines: &[&str]| {
        let loaded = loaded(&square(PLAIN, face, lines));
        (at_corners(&loaded, &loaded.mesh.uvs), loaded.warnings)
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
    assert_eq!(
        uvs(&numbered, &["3 0 1 2 6 0 0 1 0 1 1 0", "3 0 2 3 6 0 0 1 1 0 1 1"]),
        (both, vec![SEVERAL_TEXTURES.to_owned()])
    );
    // A face's coordinates apply to all its corners.
    let one = vec![Vec2::new(0.5, 0.25); 6];
    assert_eq!(uvs(list, &["4 0 1 2 3 2 0.5 0.25"]).0, one);
    assert_eq!(uvs("property float u\nproperty float v\n", &["4 0 1 2 3 0.5 0.25"]).0, one);
    assert_eq!(uvs("property double s\nproperty double t\n", &["4 0 1 2 3 0.5 0.25"]).0, one);
    // Only nonempty lists of the wrong length cause a warning.
    assert_eq!(uvs(list, &[two[0], "3 0 2 3 0"]), (vec![a, b, c, a, a, a], vec![]));
    let (found, warnings) = uvs(list, &[two[0], "3 0 2 3 5 1 1 1 1 1"]);
    assert_eq!(found, [a, b, c, a, a, a]);
    assert_eq!(warnings, [attribute_list_length_warning("line 15: face 2", 1)]);
    assert!(uvs("", &["3 0 1 2"]).0.is_empty());
}

#[test]
fn texture_seams_do_not_change_vertex_normals() {
    let list = "property list uchar float texcoord\n";
    let text = square(PLAIN, list, &["3 0 1 2 6 0 0 1 0 1 1", "3 0 2 3 6 0.5 0.5 1 0 0 1"])
        .replace("1 1 0 \n", "1 1 5 \n");
    let mesh = loaded(&text).mesh;
    let normals = crate::assets::mesh::vertex_normals(&mesh, &CancelToken::new()).expect("not canceled");
    assert_eq!(mesh.positions.len(), 6);
    for (a, b) in [(0, 3), (2, 4)] {
        let [a, b] = [(0, a), (1, b - 3)].map(|(face, corner)| mesh.triangles[face][corner] as usize);
        assert!(a != b && normals[a] == normals[b], "{normals:?}");
    }
}

#[test]
fn vertex_colors_of_any_type_are_read() {
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
fn self_intersections_are_reported_with_line() {
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
fn alpha_below_one_causes_a_warning() {
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
        assert_eq!(warnings(scalar, faded), [alpha_ignored_warning(14)]);
    }
}

#[test]
fn unusable_vertex_colors_are_reported_with_line() {
    let properties =
        |scalar: &str| ["red", "green", "blue"].map(|name| format!("property {scalar} {name}\n")).concat();
    for (scalar, tails, line, words, color) in [
        (
            "uchar",
            ["0 0 0", "0 300 0", "0 0 0", "0 0 0"],
            14,
            clamped_color_warning(300.0, 255.0),
            [0, 255, 0],
        ),
        ("uchar", ["0 0 0", "0 0 0", "0 0 -5", "0 0 0"], 15, clamped_color_warning(-5.0, 255.0), [0; 3]),
        ("uchar", ["0 0 0", "0 0.5 0", "0 0 0", "0 0 0"], 14, dropped_color_fractions_warning(0.5), [0; 3]),
        ("float", ["0 0.5 0", "0 1.5 0", "0 0 0", "0 0 0"], 14, clamped_color_warning(1.5, 1.0), [0, 255, 0]),
        ("float", ["0 0 0", "0 -0.5 0", "0 0 0", "0 0 0"], 14, clamped_color_warning(-0.5, 1.0), [0; 3]),
        (
            "float",
            ["0 9 0", "0 300 0", "0 0 0", "0 0 0"],
            14,
            clamped_color_warning(300.0, 255.0),
            [0, 255, 0],
        ),
        ("double", ["0 1 0", "0 nan 0", "0 0 0", "0 0 0"], 14, clamped_color_warning(f64::NAN, 1.0), [0; 3]),
        (
            "float",
            ["0 1 0", "0 inf 0", "0 0 0", "0 0 0"],
            14,
            clamped_color_warning(f64::INFINITY, 1.0),
            [0, 255, 0],
        ),
        (
            "ushort",
            ["0 1 0", "0 70000 0", "0 0 0", "0 0 0"],
            14,
            clamped_color_warning(70000.0, 65535.0),
            [0, 255, 0],
        ),
        ("int", ["0 1 0", "0 -1 0", "0 0 0", "0 0 0"], 14, clamped_color_warning(-1.0, 255.0), [0; 3]),
    ] {
        let found = loaded(&square((&properties(scalar), tails), "", &["3 0 1 2"]));
        assert_eq!(found.warnings, [format!("line {line}: {words}")], "{scalar} {tails:?}");
        if line == 14 {
            assert_eq!(found.mesh.colors[1], color, "{scalar} {tails:?}");
        }
    }
}

#[test]
fn nonfinite_attributes_are_reported_with_line() {
    let warnings = |names: [&str; 2], tails: [&str; 4]| {
        let properties = names.map(|name| format!("property float {name}\n")).concat();
        loaded(&square((&properties, tails), "", &["3 0 1 2", "3 0 2 3"])).warnings
    };
    let usual = ["0 0", "1 0", "1 1", "0 1"];
    assert_eq!(warnings(["u", "v"], usual), [""; 0]);
    let said = warnings(["u", "v"], ["0 0", "1 0", "1 1", "0 inf"]);
    assert_eq!(
        said,
        ["line 17: face 2 has non-finite texture coordinates; such coordinates are set to (0, 0)"]
    );
}

#[test]
fn unusable_face_colors_are_reported_with_line() {
    let parts = |scalar: &str, names: &[&str]| {
        names.iter().map(|name| format!("property {scalar} {name}\n")).collect::<String>()
    };
    let warnings = |face: &str, lines: &[&str]| loaded(&square(PLAIN, face, lines)).warnings;
    let rgb = ["red", "green", "blue"];
    let clamped = |line: usize, value: f64, one: f64| {
        vec![format!("line {line}: {}", clamped_color_warning(value, one))]
    };
    let (own, list) = (parts("uchar", &rgb), "property list uchar float color\n");
    let rows = |face: &str, lines: &[&str]| {
        square(PLAIN, face, lines)
            .lines()
            .position(|line| line == lines[0])
            .map(|row| row + 1)
            .expect("a row")
    };
    let lines = ["3 0 1 2 0 0 0", "3 0 2 3 0 300 0"];
    assert_eq!(warnings(&own, &lines), clamped(rows(&own, &lines) + 1, 300.0, 255.0));
    let lines = ["3 0 1 2 3 0 0 0.5", "3 0 2 3 3 -1 0 0"];
    assert_eq!(warnings(list, &lines), clamped(rows(list, &lines) + 1, -1.0, 1.0));
    let lines = ["3 0 1 2 4 0 0 1 1", "3 0 2 3 4 0 0 1 0.5"];
    assert_eq!(warnings(list, &lines), [alpha_ignored_warning(rows(list, &lines) + 1)]);
    let with_alpha = parts("uchar", &["red", "green", "blue", "alpha"]);
    let lines = ["3 0 1 2 0 0 0 255", "3 0 2 3 0 0 0 254"];
    assert_eq!(warnings(&with_alpha, &lines), [alpha_ignored_warning(rows(&with_alpha, &lines) + 1)]);
}

#[test]
fn texture_comments_are_reported_with_line() {
    let text = square(PLAIN, "", &["3 0 1 2"]);
    let with = |comments: &str| {
        let found = loaded(&text.replace("element vertex", &format!("{comments}element vertex")));
        (found.warnings, found.material_warnings)
    };
    assert_eq!(with("comment made by hand\ncomment TextureFiles\n"), (vec![], vec![]));
    let one = vec![ignored_texture_warning(3, "old wall.png", 1)];
    assert_eq!(with("comment TextureFile old wall.png\n"), (vec![], one));
    let two = vec![ignored_texture_warning(3, "a.png", 2)];
    assert_eq!(with("comment TextureFile a.png\ncomment TextureFile b.png\n"), (vec![], two));
}

#[test]
fn face_and_corner_colors_are_read() {
    let parts =
        |scalar: &str| ["red", "green", "blue"].map(|name| format!("property {scalar} {name}\n")).concat();
    let colors = |vertex, face: &str, lines: &[&str]| {
        let loaded = loaded(&square(vertex, face, lines));
        (at_corners(&loaded, &loaded.mesh.colors), loaded.warnings)
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
    assert_eq!((found, warnings), (vec![blue; 3], vec![FACE_COLORS_IGNORED.to_owned()]));
}
