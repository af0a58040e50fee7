use super::super::parsed::clamped_color_warning;
use super::*;
use crate::assets::expect_rejection;
use crate::assets::read::Monitor;
use crate::control::{CancelToken, ignore_progress};
use crate::math::Vec3;
use std::path::Path;

fn read(text: &str) -> Result<LoadedMesh, AssetError> {
    let token = CancelToken::new();
    let monitor = Monitor { progress: &ignore_progress, token: &token };
    parse(&MeshFileBytes { path: Path::new("a.off"), bytes: text.as_bytes(), monitor })
}

fn error(text: &str) -> (Option<usize>, String) {
    expect_rejection(read(text))
}

const FACES: &str = "3 0 1 2\n3 0 2 3\n";

#[test]
fn all_notations_are_equivalent() {
    let coordinates = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"];
    let lines = |tail: &str| coordinates.map(|line| format!("{line}{tail}\n")).concat();
    let plain = read(&format!("OFF\n4 2 0\n{}{FACES}", lines(""))).expect("plain").mesh;
    assert_eq!(plain.triangles, [[0, 1, 2], [0, 2, 3]]);
    for text in [
        format!("OFF 4 2 5\n{}{FACES}", lines("")),
        format!("OFF4 2 0\n{}{FACES}", lines("")),
        format!("OFF\n4 2\n{}{FACES}", lines("")),
        format!("4 2 0\n{}{FACES}", lines("")),
        format!("# first\n\nOFF # kind\n# counts\n4 2 0 # edges\n\n{}#\n{FACES}\n\n", lines(" # here")),
        format!("OFF\r\n4 2 0\r\n{}{}", lines("\r"), FACES.replace('\n', "\r\n")),
        format!("COFF\n4 2 0\n{}{FACES}", lines(" 150 151 152 255 ")),
        format!("COFF\n4 2 0\n{}{FACES}", lines(" 0.1 0.5 0.25")),
        // Normals not declared in the header.
        format!("OFF\n4 2 0\n{}{FACES}", lines(" 0 0 -1")),
        format!("4OFF\n4 2 0\n{}{FACES}", lines(" 1")),
        format!("OFF\n4 2 0\n{}3 0 1 2 7\n3  0 2 3 x\n", lines("")),
        format!("OFF\n4 2 0\n{}{}", lines(""), FACES.trim_end()),
        // One polygon instead of two triangles.
        format!("OFF\n4 1 0\n{}4 0 1 2 3\n", lines("")),
        format!("OFF\n4 1 0\n{}4 0 1\n2 3\n", lines("")),
    ] {
        let mut mesh = read(&text).unwrap_or_else(|error| panic!("{error}: {text}")).mesh;
        mesh.colors.clear();
        mesh.normal_groups.clear();
        assert_eq!(mesh, plain, "{text}");
    }
}

#[test]
fn declared_colors_are_read() {
    let read = |tails: [&str; 3]| {
        let [a, b, c] = tails;
        let text = format!("STCOFF\n3 1 0\n0 0 0 {a} 0 0\n1 0 0 {b} 1 0\n0 1 0 {c} 0 1\n3 0 1 2\n");
        let mesh = read(&text).expect("whole").mesh;
        assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::Y]);
        mesh.colors
    };
    assert_eq!(read(["255 0 1 9", "1 1 1", "2 3 4 255"]), [[255, 0, 1], [1, 1, 1], [2, 3, 4]]);
    assert_eq!(read(["1 0 0.2", "0 0 0 1", "1 1 1"]), [[255, 0, 51], [0; 3], [255; 3]]);
    assert_eq!(read(["3", "0 1 1", "1 1 1"]), [[255; 3], [0, 255, 255], [255; 3]]);
    assert_eq!(read(["3", "3", "3"]), [[0; 3]; 0]);
}

/// Corner colors and warnings for two triangles whose lines end with `tails`.
fn corner_colors(header: &str, vertex: &str, tails: [&str; 2]) -> (Vec<[u8; 3]>, Vec<String>) {
    let [a, b] = tails;
    let text = format!(
        "{header}\n4 2 0\n0 0 0{vertex}\n1 0 0{vertex}\n1 1 0{vertex}\n0 1 0{vertex}\n3 0 1 2 {a}\n3 0 2 3 {b}\n"
    );
    let loaded = super::tests::read(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
    let mesh = &loaded.mesh;
    let corners = mesh.triangles.as_flattened().iter().filter_map(|vertex| mesh.colors.get(*vertex as usize));
    (corners.copied().collect(), loaded.warnings)
}

#[test]
fn face_colors_are_read() {
    let (red, green, white) = ([255, 0, 0], [0, 255, 0], [255; 3]);
    let off = |tails| corner_colors("OFF", "", tails);
    let both = ([[red; 3], [green; 3]].concat(), vec![]);
    for tails in [
        ["255 0 0", "0 255 0"],
        ["1 0 0", "0 1 0"],
        ["1.0 0.0 0 1", "0 1 0.0 1"],
        ["255 0 0 255 # x", "0 255 0 255"],
    ] {
        assert_eq!(off(tails), both, "{tails:?}");
    }
    assert_eq!(off(["255 0 0", ""]), ([[red; 3], [white; 3]].concat(), vec![]));
    assert_eq!(off(["", ""]), (vec![], vec![]));
    let index = ignored_values_warning(7, 1, COLOR_INDEX);
    assert_eq!(off(["3", "255 0 0"]), ([[white; 3], [red; 3]].concat(), vec![index]));
    let clamped = vec![format!("line 8: {}", clamped_color_warning(-1.0, 255.0))];
    assert_eq!(off(["255 0 0", "-1 255 0"]), (both.0, clamped));
    let transparent = vec![alpha_ignored_warning(8)];
    assert_eq!(off(["1 0 0", "0 1 0 0.5"]), ([[red; 3], [green; 3]].concat(), transparent));
    let more = ignored_values_warning(7, 2, UNDECLARED);
    assert_eq!(off(["1 2", "1 0 0 1 7"]), ([[white; 3], [red; 3]].concat(), vec![more]));
    assert_eq!(
        corner_colors("COFF", " 0 255 0", ["255 0 0", "255 0 0"]),
        (vec![green; 6], vec![FACE_COLORS_IGNORED.to_owned()])
    );
}

#[test]
fn self_intersections_are_reported_with_line() {
    let text = "OFF 4 3\n0 0 0\n3 0 0\n0 1 0\n3 2 0\n3 0 1 2 # x\n\n4 0 1 3\n2 255 0 0\n4 0 1 2 3\n";
    let warnings = read(text).expect("whole").warnings;
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].starts_with("line 10: face 3 "), "{warnings:?}");
}

#[test]
fn undeclared_numbers_are_reported_with_line() {
    let more = ignored_values_warning(3, 4, UNDECLARED);
    assert_eq!(corner_colors("OFF", " 0 0 1", ["", ""]), (vec![], vec![more.clone()]));
    assert_eq!(corner_colors("NOFF", " 0 0 1 7", ["", ""]).1, [more]);
    assert!(corner_colors("NOFF", " 0 0 1", ["", ""]).1.is_empty());
}

#[test]
fn declared_normals_and_uvs_are_read() {
    let text =
        "STCNOFF\n3 1 0\n0 0 0 0 0 2 9 9 9 9 0.5 0.25\n1 0 0 0 0 2 9 9 9 1 0\n0 1 0 0 0 2 9 0 1\n3 0 1 2\n";
    let mesh = read(text).expect("whole").mesh;
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.uvs, [Vec2::new(0.5, 0.25), Vec2::X, Vec2::Y]);
    let text = "4OFF\n3 1 0\n0 0 0 2\n1 0 0 2\n0 1 0 0.5\n3 0 1 2\n";
    assert_eq!(read(text).expect("whole").mesh.positions, [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 2.0]);
}

#[test]
fn errors_include_line_and_reason() {
    let start = "OFF\n# comment\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n";
    let first_face = |face: &str| error(&format!("{start}{face}\n"));
    for (face, reason) in [
        ("3 0 1 3", vertex_out_of_range_message(3, 3)),
        ("3 0 -1 2", vertex_out_of_range_message(-1, 3)),
        ("3 0 1 x", expected_message("a vertex", b"x")),
        ("-3 0 1 2", negative_count_message("corners", -3)),
        ("x 0 1 2", expected_message(&count_label("corners"), b"x")),
    ] {
        assert_eq!(first_face(face), (Some(7), reason));
    }
    assert_eq!(first_face("3 0 1  \n").1, incomplete_face_message(2, 3));
    for (text, line, reason) in [
        ("OFF\n2 1 0\n0 0 0\n0 zero 0 0\n3 0 1 2\n", 4, expected_message("a coordinate", b"zero")),
        ("OFF\n2 1 0\n0 0 0\n0 0\n30 0 1 2 3\n", 4, unexpected_line_end_message("a coordinate")),
        ("OFF\n1 2 0\n0 0 0\n3 0 0 0\n      \n", 6, truncated_message(1, 2, "faces")),
        ("", 1, EMPTY_FILE.to_owned()),
        ("solid\n", 1, expected_message(NOT_OFF, b"solid")),
        ("nOFF 3\n", 1, unsupported_variant_message(b"nOFF")),
        ("OFF BINARY\n", 1, BINARY_OFF.to_owned()),
        ("OFF\n-1 2 0\n", 2, negative_count_message("vertices", -1)),
        ("OFF -3 1 0\n", 1, negative_count_message("vertices", -3)),
        ("OFF\n3 -1 0\n", 2, negative_count_message("faces", -1)),
        ("OFF\n1.5 2 0\n", 2, expected_message(&count_label("vertices"), b"1.5")),
        ("OFF\n3 x 0\n", 2, expected_message(&count_label("faces"), b"x")),
        ("OFF 3\n", 1, missing_count_message("faces")),
        ("OFF", 1, missing_count_message("vertices")),
        ("OFF 3 1 0", 1, implausible_counts_message(3, 1, 0)),
        ("OFF 3 1 x\n", 1, expected_message(&count_label("edges"), b"x")),
        ("OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2\n", 1, words_after_counts_message(b"0")),
    ] {
        assert_eq!(error(text), (Some(line), reason), "{text}");
    }
}

#[test]
fn false_counts_cause_no_allocation() {
    let huge = 4_000_000_000;
    assert_eq!(error("OFF\n4000000000 4000000000 0\n0 0 0\n").1, implausible_counts_message(huge, huge, 6));
    let overflow = expected_message(&count_label("vertices"), b"18446744073709551615");
    assert_eq!(error("OFF\n18446744073709551615 1 0\n").1, overflow);
    let text = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n";
    assert_eq!(error(text), (Some(6), too_many_corners_message(4_000_000_000)));
}
