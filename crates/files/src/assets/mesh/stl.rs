//! STL: facets defined by their corners, as text or binary (3D Systems, *StereoLithography Interface
//! Specification*, 1989). Many files deviate from the specification: binary headers may begin with "solid",
//! counts may be too small, facets may be polygons, there may be several solids, normals may be zero or
//! wrong, and keywords may be in any case. Normals in the file are ignored and computed from the order of the
//! corners instead. Coincident corners are merged into one vertex. The format has no units and no standard
//! colors.

use super::assemble::{assemble, assemble_text_mesh};
use super::parsed::{Faces, ParsedMesh};
use super::text::{TextCursor, convert_mac_line_ends, expected_message};
use super::{AssetError, LoadedMesh, MeshFileBytes};
use crate::assets::read;
use crate::math::DVec3;

/// Size of a binary file's header, which precedes the number of facets.
const HEADER_BYTES: usize = 80;
/// Offset of the first facet in a binary file.
const FACETS_OFFSET: usize = HEADER_BYTES + 4;
/// Size of a facet: a normal and three corners (three floats each), followed by a two-byte attribute.
const FACET_BYTES: usize = 50;
/// Number of facets (binary) or words (text) between polls of the cancel token.
const BATCH: usize = 1 << 13;

pub(super) fn parse(source: &MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError> {
    if !has_binary_size(source.bytes) {
        read::reject_utf16(source.path, source.bytes)?;
    }
    match detect_encoding(source.bytes) {
        StlEncoding::Text => {
            let bytes = convert_mac_line_ends(source.bytes);
            let source = MeshFileBytes { bytes: &bytes, ..*source };
            let mut reader =
                TextReader { source, cursor: TextCursor::new(source.bytes, 0), polygons: Vec::new() };
            let parsed = ParsedMesh { has_separate_corners: true, ..reader.read()? };
            assemble_text_mesh(&source, parsed, |face| reader.face_offset_unless_triangle(face))
        }
        StlEncoding::Binary => {
            assemble(source, ParsedMesh { has_separate_corners: true, ..read_binary(source)? })
        }
    }
}

/// Encoding of an STL file.
enum StlEncoding {
    Text,
    Binary,
}

/// Detects the encoding. A file whose size matches the number of facets in a binary header is binary,
/// regardless of the header's text.
fn detect_encoding(bytes: &[u8]) -> StlEncoding {
    let word = bytes.trim_ascii_start().get(..5);
    let says_solid = word.is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // Text has no zero bytes. Binary files contain zeros in the header, or in the facets if the header is
    // padded with blanks.
    let is_text = says_solid && memchr::memchr(0, bytes).is_none();
    if is_text && !has_binary_size(bytes) { StlEncoding::Text } else { StlEncoding::Binary }
}

/// Whether the file size matches the number of facets if the file is read as binary.
fn has_binary_size(bytes: &[u8]) -> bool {
    declared_facet_count(bytes)
        .is_some_and(|count| bytes.len() as u64 == FACETS_OFFSET as u64 + FACET_BYTES as u64 * count)
}

/// Number of facets according to a binary header, or `None` if the file is too short.
fn declared_facet_count(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER_BYTES..FACETS_OFFSET)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

/// Reads a binary STL file.
fn read_binary(source: &MeshFileBytes<'_>) -> Result<ParsedMesh, AssetError> {
    let Some(claimed) = declared_facet_count(source.bytes) else {
        return Err(source.malformed_error_without_line(not_stl_message(source.bytes.trim_ascii_start())));
    };
    let facets = source.bytes[FACETS_OFFSET..].chunks_exact(FACET_BYTES);
    let excess = facets.remainder().len();
    let found = facets.len() as u64;
    if found < claimed {
        return Err(source.malformed_error_without_line(too_few_facets_message(claimed, found)));
    }
    if found == 0 {
        return Err(source.malformed_error_without_line(format!(
            "the header claims 0 facets, and the {excess} bytes that follow are too few for a facet ({FACET_BYTES} bytes)"
        )));
    }
    // Accept a count of 0, because some programs write the header before they know the number of facets.
    let (count, mut warnings) = (if claimed == 0 { found } else { claimed }, Vec::new());
    if claimed != 0 && (found > claimed || excess > 0) {
        let bytes = (found - claimed) * FACET_BYTES as u64 + excess as u64;
        warnings.push(excess_bytes_warning(bytes, claimed));
    }
    let mut parsed = ParsedMesh { warnings, ..ParsedMesh::default() };
    parsed.positions.reserve(3 * count as usize);
    for (index, facet) in facets.take(count as usize).enumerate() {
        if index % BATCH == 0 {
            source.report_progress(FACETS_OFFSET + index * FACET_BYTES)?;
        }
        let (floats, _) = facet.as_chunks::<4>();
        let float = |place: usize| f64::from(f32::from_le_bytes(floats[place]));
        // The first three floats are the normal.
        for corner in 1..=3 {
            add_corner(
                &mut parsed,
                DVec3::new(float(3 * corner), float(3 * corner + 1), float(3 * corner + 2)),
            );
        }
        parsed.faces.end_face(3);
    }
    Ok(parsed)
}

fn not_stl_message(found: &[u8]) -> String {
    let wanted = format!("text STL starting with solid, or binary STL of at least {FACETS_OFFSET} bytes");
    expected_message(&wanted, found)
}

fn too_few_facets_message(claimed: u64, found: u64) -> String {
    let facets = if claimed == 1 { "facet" } else { "facets" };
    format!("the header claims {claimed} {facets}, but the file ends after {found}")
}

/// Warning about bytes after the last facet.
fn excess_bytes_warning(bytes: u64, claimed: u64) -> String {
    format!("ignored {bytes} bytes after the {claimed} facets declared in the header")
}

const VERTEX_OUTSIDE: &str = "a vertex is not between \"outer loop\" and \"endloop\"";
const ENDS_IN_FACET: &str = "the file ends inside a facet";
const KEYWORD: &str = "an STL keyword";

fn short_loop_message(corners: usize) -> String {
    format!("a loop with only {corners} corners")
}

/// Adds a corner as a separate vertex.
fn add_corner(parsed: &mut ParsedMesh, position: DVec3) {
    parsed.faces.push_corner(parsed.positions.len() as u32);
    parsed.positions.push(position);
}

/// Parser for text STL files.
struct TextReader<'a> {
    source: MeshFileBytes<'a>,
    cursor: TextCursor<'a>,
    /// Indices of faces with more than 3 corners, each with the byte offset of its loop.
    polygons: Vec<(usize, usize)>,
}

impl TextReader<'_> {
    /// Returns the byte offset of a face's loop, or `None` for faces with 3 corners.
    fn face_offset_unless_triangle(&self, face: usize) -> Option<usize> {
        self.polygons.iter().find(|(polygon, _)| *polygon == face).map(|(_, start)| *start)
    }

    fn read(&mut self) -> Result<ParsedMesh, AssetError> {
        let mut parsed = ParsedMesh::default();
        let mut corners: Option<usize> = None;
        let (mut loop_start, mut faces) = (0, 0);
        let mut words = 0;
        while self.cursor.skip_to_word_across_lines() {
            if words % BATCH == 0 {
                self.source.report_progress(self.cursor.offset())?;
            }
            words += 1;
            let start = self.cursor;
            let word = self.cursor.take_word();
            let is = |name: &str| word.eq_ignore_ascii_case(name.as_bytes());
            if is("vertex") {
                let Some(count) = &mut corners else {
                    return self.fail_with_line(start, VERTEX_OUTSIDE);
                };
                *count += 1;
                let position =
                    DVec3::new(self.read_coordinate()?, self.read_coordinate()?, self.read_coordinate()?);
                add_corner(&mut parsed, position);
            } else if is("loop") {
                loop_start = start.offset();
                if corners.replace(0).is_some() {
                    return self.fail_with_line(start, "a loop inside a loop");
                }
            } else if is("endloop") {
                match corners.take() {
                    Some(count) if count >= 3 => {
                        if count > 3 {
                            self.polygons.push((faces, loop_start));
                        }
                        faces += 1;
                        parsed.faces.end_face(count);
                    }
                    Some(count) => return self.fail_with_line(start, short_loop_message(count)),
                    None => return self.fail_with_line(start, "\"endloop\" without \"outer loop\""),
                }
            } else if is("solid") || is("endsolid") {
                self.skip_name();
            } else if is("normal") {
                self.skip_normal();
            } else if !(is("facet") || is("outer") || is("endfacet")) {
                return self.fail_with_line(start, expected_message(KEYWORD, word));
            }
            if parsed.positions.len() > Faces::MAX_CORNERS {
                return self
                    .fail_with_line(start, "too many corners for one mesh; split it into several files");
            }
        }
        if corners.is_some() {
            return self.fail_with_line(self.cursor, ENDS_IN_FACET);
        }
        Ok(parsed)
    }

    fn fail_with_line<T>(&self, at: TextCursor<'_>, reason: impl Into<String>) -> Result<T, AssetError> {
        let end = self.source.bytes.trim_ascii_end().len();
        Err(self.source.malformed_error_with_line(at.offset().min(end), reason))
    }

    fn read_coordinate(&mut self) -> Result<f64, AssetError> {
        if !self.cursor.skip_to_word_across_lines() {
            return self.fail_with_line(self.cursor, "the file ends inside a vertex");
        }
        let mut start = self.cursor;
        match self.cursor.take_float() {
            Some(value) => Ok(value),
            None => self.fail_with_line(self.cursor, expected_message("a coordinate", start.take_word())),
        }
    }

    /// Skips a solid's name, which may have any number of words. It ends at the end of the line, or at a
    /// facet on the same line.
    fn skip_name(&mut self) {
        let bytes = self.source.bytes;
        let is_blank = |byte: &u8| byte.is_ascii_whitespace();
        let mut at = self.cursor.offset();
        while bytes.get(at).is_some_and(|byte| *byte != b'\n') {
            let word = bytes[at..].iter().position(is_blank).map_or(&bytes[at..], |end| &bytes[at..at + end]);
            if word.eq_ignore_ascii_case(b"facet") {
                let mut ahead = TextCursor::new(bytes, at + word.len());
                if ahead.skip_to_word_across_lines() && ahead.take_word().eq_ignore_ascii_case(b"normal") {
                    break;
                }
            }
            at += word.len().max(1);
        }
        self.cursor = TextCursor::new(bytes, at);
    }

    /// Skips a normal, which may contain words that are not numbers.
    fn skip_normal(&mut self) {
        for _ in 0..3 {
            let mut ahead = self.cursor;
            if ahead.skip_to_word_across_lines() && !ahead.take_word().eq_ignore_ascii_case(b"outer") {
                self.cursor = ahead;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::expect_rejection;
    use crate::assets::mesh::Monitor;
    use crate::assets::mesh::assemble::NO_FACES;
    use crate::control::{CancelToken, ignore_progress};
    use crate::math::Vec3;
    use std::path::Path;

    fn read(bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
        let token = CancelToken::new();
        parse(&MeshFileBytes {
            path: Path::new("a.stl"),
            bytes,
            monitor: Monitor { progress: &ignore_progress, token: &token },
        })
    }

    fn error(bytes: &[u8]) -> (Option<usize>, String) {
        expect_rejection(read(bytes))
    }

    /// Corners of the outward-facing facets of a tetrahedron.
    const TETRAHEDRON: [[[f32; 3]; 3]; 4] = {
        let [o, x, y, z] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        [[o, y, x], [o, x, z], [o, z, y], [x, y, z]]
    };

    fn binary_of(header: &[u8], claimed: u32, facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(HEADER_BYTES, b' ');
        bytes.extend(claimed.to_le_bytes());
        for facet in facets {
            bytes.extend([0; 12]);
            bytes.extend(facet.iter().flatten().flat_map(|number| number.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn text_of(facets: &[[[f32; 3]; 3]]) -> String {
        let mut text = "solid of # any name\n".to_owned();
        for facet in facets {
            text.push_str("  facet normal nan -nan(ind) 0\n    outer loop\n");
            for [x, y, z] in facet {
                text.push_str(&format!("      vertex {x} {y:e} {z}\n"));
            }
            text.push_str("    endloop\n  endfacet\n");
        }
        text + "endsolid of any name\n"
    }

    /// Returns the positions of each triangle's corners.
    fn places(loaded: &LoadedMesh) -> Vec<[Vec3; 3]> {
        let mesh = &loaded.mesh;
        (0..mesh.triangles.len() as u32)
            .map(|triangle| mesh.corners(triangle).map(|place| place + mesh.origin.as_vec3()))
            .collect()
    }

    #[test]
    fn text_and_binary_files_are_equivalent() {
        let expected = TETRAHEDRON.map(|facet| facet.map(Vec3::from_array));
        for bytes in [
            binary_of(b"made by hand", 4, &TETRAHEDRON),
            binary_of(b"solid that is binary", 4, &TETRAHEDRON),
            binary_of(b"solid without its count", 0, &TETRAHEDRON),
            binary_of(b"s\0o\0l\0i\0d\0", 4, &TETRAHEDRON),
            text_of(&TETRAHEDRON).into_bytes(),
            text_of(&TETRAHEDRON).to_uppercase().replace('\n', "\r").into_bytes(),
            text_of(&TETRAHEDRON).replace('\n', " ").replacen("# any name", "\n", 1).into_bytes(),
        ] {
            let loaded = read(&bytes).expect("read");
            assert_eq!(places(&loaded), expected);
            assert_eq!(loaded.mesh.positions.len(), 4, "coincident corners should be merged");
            assert!(loaded.warnings.is_empty() && loaded.mesh.normals.is_empty());
        }
    }

    #[test]
    fn any_whitespace_separates_words() {
        let expected = TETRAHEDRON.map(|facet| facet.map(Vec3::from_array));
        let text = text_of(&TETRAHEDRON).replace("of # any name", "").replace("of any name", "");
        let words: Vec<&str> = text.split_whitespace().collect();
        let twice = [words.join(" "), words.join("\t")].join(" ");
        for blank in [" ", "\t", "\n", "\r\n", "\r", "  \n"] {
            let loaded =
                read(words.join(blank).as_bytes()).unwrap_or_else(|error| panic!("{error}: {blank:?}"));
            assert_eq!(places(&loaded), expected, "{blank:?}");
        }
        assert_eq!(places(&read(twice.as_bytes()).expect("two solids on one line")).len(), 8);
        for name in ["one", "of two words", "a # b", "facet", "endsolid facet"] {
            let text = words.join(" ").replace("solid", &format!("solid {name}"));
            assert_eq!(places(&read(text.as_bytes()).expect(name)), expected, "{name:?}");
        }
    }

    #[test]
    fn corners_one_ulp_apart_stay_separate() {
        let near = f32::from_bits(1.0_f32.to_bits() + 1);
        let facets = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[0.0, 0.0, -0.0], [near, 0.0, 0.0], [0.0, 0.0, 1.0]],
        ];
        let loaded = read(&binary_of(b"", 2, &facets)).expect("read");
        assert_eq!(loaded.mesh.positions.len(), 5, "0 and -0 coincide");
    }

    #[test]
    fn degenerate_facets_are_skipped_and_counted() {
        let mut facets = TETRAHEDRON.to_vec();
        facets.push([[0.0; 3], [1.0; 3], [1.0; 3]]);
        facets.push([[f32::NAN; 3], [1.0; 3], [0.0; 3]]);
        let loaded = read(&binary_of(b"", 6, &facets)).expect("read");
        assert_eq!(
            (loaded.mesh.triangles.len(), loaded.dropped.degenerate, loaded.dropped.non_finite),
            (4, 1, 1)
        );
    }

    #[test]
    fn polygons_are_triangulated_and_solids_merged() {
        let square = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
        let loaded = read(format!("{square}{}", square.replace(" 0\n", " 3\n")).as_bytes()).expect("read");
        assert_eq!((loaded.mesh.triangles.len(), loaded.mesh.positions.len()), (4, 8));
    }

    #[test]
    fn self_intersections_are_reported_with_line() {
        let facet = |corners: &[&str]| {
            let vertices: Vec<_> = corners.iter().map(|corner| format!("vertex {corner}\n")).collect();
            format!("facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n", vertices.concat())
        };
        let plain = facet(&["0 0 0", "1 0 0", "1 1 0", "0 1 0"]);
        let crossed = facet(&["0 0 0", "3 0 0", "0 1 0", "3 2 0"]);
        for end in ["\n", "\r\n", "\r"] {
            let text = format!("solid a\n{plain}{crossed}endsolid a\n").replace('\n', end);
            let warnings = read(text.as_bytes()).expect("read").warnings;
            assert_eq!(warnings.len(), 1);
            assert!(warnings[0].starts_with("line 11: face 2 "), "{warnings:?}");
        }
    }

    #[test]
    fn bytes_after_the_facets_cause_a_warning() {
        let mut bytes = binary_of(b"", 3, &TETRAHEDRON);
        bytes.extend(b"rest");
        let loaded = read(&bytes).expect("read");
        assert_eq!(loaded.mesh.triangles.len(), 3);
        assert_eq!(loaded.warnings, [excess_bytes_warning(54, 3)]);
    }

    #[test]
    fn errors_include_line_and_reason() {
        let cut = binary_of(b"", 9, &TETRAHEDRON);
        assert_eq!(error(&cut), (None, too_few_facets_message(9, 4)));
        assert_eq!(error(&binary_of(b"", u32::MAX, &[])).1, too_few_facets_message(u64::from(u32::MAX), 0));
        assert_eq!(error(b"PK\x03\x04 an archive").1, not_stl_message(b"PK\x03\x04 an archive"));
        let wide: Vec<u8> = "solid a\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(error(&wide), (Some(1), read::UTF16_TEXT.to_owned()));
        assert_eq!(error(b"solid a\nendsolid a\n"), (None, NO_FACES.to_owned()));
        for (text, line, reason) in [
            (
                "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 x\n",
                4,
                expected_message("a coordinate", b"x"),
            ),
            ("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 1\n", 4, ENDS_IN_FACET.to_owned()),
            ("solid\nvertex 0 0 1\n", 2, VERTEX_OUTSIDE.to_owned()),
            ("solid\nouter loop\nvertex 0 0 1\nendloop\n", 4, short_loop_message(1)),
            ("solid\ncube 1\n", 2, expected_message(KEYWORD, b"cube")),
        ] {
            assert_eq!(error(text.as_bytes()), (Some(line), reason), "{text}");
        }
    }
}
