//! STL: facets with their corners and nothing else, as text or binary (3D Systems, *StereoLithography Interface Specification*,
//! 1989). Real files vary: binary headers that begin with "solid", counts that are too small, polygons, several solids, normals that are
//! zero or wrong, keywords in any case. Normals are those of the corners' order; corners at one place become one vertex. The format
//! has no unit and no colours.

use super::assemble::{assemble, assemble_text};
use super::parsed::{Faces, Parsed};
use super::text::{Cursor, shown, with_line_feeds};
use super::{AssetError, LoadedMesh, Source};
use crate::assets::read;
use crate::math::DVec3;

/// Bytes before the number of facets of a binary file.
const HEADER: usize = 80;
/// Bytes before the first facet.
const START: usize = HEADER + 4;
/// Bytes of a facet: a normal and three corners of three floats each, and two bytes that programs fill as they like.
const FACET: usize = 50;
/// Facets, or words of a text, between two polls of the token.
const BATCH: usize = 1 << 13;

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    if !fits_claim(source.bytes) {
        read::refuse_utf16(source.path, source.bytes)?;
    }
    match kind(source.bytes) {
        Kind::Text => {
            let bytes = with_line_feeds(source.bytes);
            let source = Source { bytes: &bytes, ..*source };
            let mut text = Text { source, cursor: Cursor::new(source.bytes, 0), polygons: Vec::new() };
            let parsed = Parsed { has_corners_apart: true, ..text.read()? };
            assemble_text(&source, parsed, |face| text.start_of(face))
        }
        Kind::Binary => assemble(source, Parsed { has_corners_apart: true, ..binary(source)? }),
    }
}

/// How a file is written.
enum Kind {
    Text,
    Binary,
}

/// The kind of a file. One whose length is that of the facets which it claims is binary, whatever its header says.
fn kind(bytes: &[u8]) -> Kind {
    let word = bytes.trim_ascii_start().get(..5);
    let says_solid = word.is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    // Text has no byte 0; a header is filled with them, or with blanks before facets that have some.
    let is_text = says_solid && memchr::memchr(0, bytes).is_none();
    if is_text && !fits_claim(bytes) { Kind::Text } else { Kind::Binary }
}

/// Whether the length of a file is that of the facets which it claims as a binary file.
fn fits_claim(bytes: &[u8]) -> bool {
    claimed(bytes).is_some_and(|count| bytes.len() as u64 == START as u64 + FACET as u64 * count)
}

/// The number of facets that a binary file claims. `None` if it ends before.
fn claimed(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER..START)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

/// Reads a binary file.
fn binary(source: &Source<'_>) -> Result<Parsed, AssetError> {
    let Some(claimed) = claimed(source.bytes) else {
        let start = shown(source.bytes.trim_ascii_start());
        return Err(source.wrong(format!(
            "an STL file is text that begins with solid, or binary of at least {START} bytes; found {start}"
        )));
    };
    let facets = source.bytes[START..].chunks_exact(FACET);
    let behind = facets.remainder().len();
    let found = facets.len() as u64;
    if found < claimed {
        return Err(source
            .wrong(format!("the header claims {claimed} facets, and the file ends after {found} of them")));
    }
    if found == 0 {
        return Err(source
            .wrong(format!("the header claims 0 facets, and {behind} bytes follow; a facet takes {FACET}")));
    }
    // A count of 0 is that of programs which do not know it yet when they begin to write.
    let (count, mut warnings) = (if claimed == 0 { found } else { claimed }, Vec::new());
    if claimed != 0 && (found > claimed || behind > 0) {
        let bytes = (found - claimed) * FACET as u64 + behind as u64;
        warnings
            .push(format!("{bytes} bytes behind the {claimed} facets that the header claims are ignored"));
    }
    let mut parsed = Parsed { warnings, ..Parsed::default() };
    parsed.positions.reserve(3 * count as usize);
    for (index, facet) in facets.take(count as usize).enumerate() {
        if index % BATCH == 0 {
            source.tick(START + index * FACET)?;
        }
        let (floats, _) = facet.as_chunks::<4>();
        let float = |place: usize| f64::from(f32::from_le_bytes(floats[place]));
        // The first three floats are the normal.
        for corner in 1..=3 {
            add(&mut parsed, DVec3::new(float(3 * corner), float(3 * corner + 1), float(3 * corner + 2)));
        }
        parsed.faces.close(3);
    }
    Ok(parsed)
}

/// Adds a corner with a vertex of its own.
fn add(parsed: &mut Parsed, position: DVec3) {
    parsed.faces.corner(parsed.positions.len() as u32);
    parsed.positions.push(position);
}

/// Reads a text.
struct Text<'a> {
    source: Source<'a>,
    cursor: Cursor<'a>,
    /// Faces of more than 3 corners, and the offsets of their loops.
    polygons: Vec<(usize, usize)>,
}

impl Text<'_> {
    /// Offset of a face of more than 3 corners.
    fn start_of(&self, face: usize) -> Option<usize> {
        self.polygons.iter().find(|(polygon, _)| *polygon == face).map(|(_, start)| *start)
    }

    fn read(&mut self) -> Result<Parsed, AssetError> {
        let mut parsed = Parsed::default();
        let mut corners: Option<usize> = None;
        let (mut loop_start, mut faces) = (0, 0);
        let mut words = 0;
        while self.cursor.skip_blank() {
            if words % BATCH == 0 {
                self.source.tick(self.cursor.at())?;
            }
            words += 1;
            let start = self.cursor;
            let word = self.cursor.word();
            let is = |name: &str| word.eq_ignore_ascii_case(name.as_bytes());
            if is("vertex") {
                let Some(count) = &mut corners else {
                    return self.wrong(start, "a vertex outside of \"outer loop\" and \"endloop\"");
                };
                *count += 1;
                let position = DVec3::new(self.float()?, self.float()?, self.float()?);
                add(&mut parsed, position);
            } else if is("loop") {
                loop_start = start.at();
                if corners.replace(0).is_some() {
                    return self.wrong(start, "a loop in a loop");
                }
            } else if is("endloop") {
                match corners.take() {
                    Some(count) if count >= 3 => {
                        if count > 3 {
                            self.polygons.push((faces, loop_start));
                        }
                        faces += 1;
                        parsed.faces.close(count);
                    }
                    Some(count) => return self.wrong(start, format!("a loop of {count} corners")),
                    None => return self.wrong(start, "\"endloop\" without \"outer loop\""),
                }
            } else if is("solid") || is("endsolid") {
                self.name();
            } else if is("normal") {
                self.skip_normal();
            } else if !(is("facet") || is("outer") || is("endfacet")) {
                return self.wrong(start, format!("expected a keyword of STL, found {}", shown(word)));
            }
            if parsed.positions.len() > Faces::MOST_CORNERS {
                return self.wrong(start, "more corners than a mesh can have; split it into several files");
            }
        }
        if corners.is_some() {
            return self.wrong(self.cursor, "the file ends in a facet");
        }
        Ok(parsed)
    }

    fn wrong<T>(&self, at: Cursor<'_>, reason: impl Into<String>) -> Result<T, AssetError> {
        let end = self.source.bytes.trim_ascii_end().len();
        Err(self.source.wrong_at(at.at().min(end), reason))
    }

    fn float(&mut self) -> Result<f64, AssetError> {
        if !self.cursor.skip_blank() {
            return self.wrong(self.cursor, "the file ends in a vertex");
        }
        let mut start = self.cursor;
        match self.cursor.float() {
            Some(value) => Ok(value),
            None => {
                let word = shown(start.word());
                self.wrong(self.cursor, format!("expected a coordinate, found {word}"))
            }
        }
    }

    /// Skips a name of any words, up to the end of the line or to the facet that follows it there.
    fn name(&mut self) {
        let bytes = self.source.bytes;
        let is_blank = |byte: &u8| byte.is_ascii_whitespace();
        let mut at = self.cursor.at();
        while bytes.get(at).is_some_and(|byte| *byte != b'\n') {
            let word = bytes[at..].iter().position(is_blank).map_or(&bytes[at..], |end| &bytes[at..at + end]);
            if word.eq_ignore_ascii_case(b"facet") {
                let mut ahead = Cursor::new(bytes, at + word.len());
                if ahead.skip_blank() && ahead.word().eq_ignore_ascii_case(b"normal") {
                    break;
                }
            }
            at += word.len().max(1);
        }
        self.cursor = Cursor::new(bytes, at);
    }

    /// Skips a normal, whose words need not be numbers.
    fn skip_normal(&mut self) {
        for _ in 0..3 {
            let mut ahead = self.cursor;
            if ahead.skip_blank() && !ahead.word().eq_ignore_ascii_case(b"outer") {
                self.cursor = ahead;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::mesh::Watch;
    use crate::control::{CancelToken, ignore_progress};
    use crate::math::Vec3;
    use std::path::Path;

    fn read(bytes: &[u8]) -> Result<LoadedMesh, AssetError> {
        let token = CancelToken::new();
        parse(&Source {
            path: Path::new("a.stl"),
            bytes,
            watch: Watch { progress: &ignore_progress, token: &token },
        })
    }

    fn says(bytes: &[u8]) -> String {
        read(bytes).expect_err("refused").to_string()
    }

    /// The corners of a tetrahedron's facets, outwards.
    const TETRAHEDRON: [[[f32; 3]; 3]; 4] = {
        let [o, x, y, z] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        [[o, y, x], [o, x, z], [o, z, y], [x, y, z]]
    };

    fn binary_of(header: &[u8], claimed: u32, facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(HEADER, b' ');
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

    /// The places of each triangle's corners.
    fn places(loaded: &LoadedMesh) -> Vec<[Vec3; 3]> {
        let mesh = &loaded.mesh;
        (0..mesh.triangles.len() as u32)
            .map(|triangle| mesh.corners(triangle).map(|place| place + mesh.origin.as_vec3()))
            .collect()
    }

    #[test]
    fn text_and_binary_give_the_same_facets_with_corners_joined() {
        let expected = TETRAHEDRON.map(|facet| facet.map(Vec3::from_array));
        for bytes in [
            binary_of(b"made by nobody", 4, &TETRAHEDRON),
            binary_of(b"solid that is binary", 4, &TETRAHEDRON),
            binary_of(b"solid without its count", 0, &TETRAHEDRON),
            binary_of(b"s\0o\0l\0i\0d\0", 4, &TETRAHEDRON),
            text_of(&TETRAHEDRON).into_bytes(),
            text_of(&TETRAHEDRON).to_uppercase().replace('\n', "\r").into_bytes(),
            text_of(&TETRAHEDRON).replace('\n', " ").replacen("# any name", "\n", 1).into_bytes(),
        ] {
            let loaded = read(&bytes).expect("read");
            assert_eq!(places(&loaded), expected);
            assert_eq!(loaded.mesh.positions.len(), 4, "corners at one place are one vertex");
            assert!(loaded.warnings.is_empty() && loaded.mesh.normals.is_empty());
        }
    }

    #[test]
    fn blanks_may_be_of_any_kind() {
        let expected = TETRAHEDRON.map(|facet| facet.map(Vec3::from_array));
        let text = text_of(&TETRAHEDRON).replace("of # any name", "").replace("of any name", "");
        let words: Vec<&str> = text.split_whitespace().collect();
        let twice = [words.join(" "), words.join("\t")].join(" ");
        for blank in [" ", "\t", "\n", "\r\n", "\r", "  \n"] {
            let loaded =
                read(words.join(blank).as_bytes()).unwrap_or_else(|error| panic!("{error}: {blank:?}"));
            assert_eq!(places(&loaded), expected, "{blank:?}");
        }
        assert_eq!(places(&read(twice.as_bytes()).expect("two solids in a line")).len(), 8);
        for name in ["one", "of two words", "a # b", "facet", "endsolid facet"] {
            let text = words.join(" ").replace("solid", &format!("solid {name}"));
            assert_eq!(places(&read(text.as_bytes()).expect(name)), expected, "{name:?}");
        }
    }

    #[test]
    fn places_that_differ_by_a_bit_are_apart() {
        let near = f32::from_bits(1.0_f32.to_bits() + 1);
        let facets = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            [[0.0, 0.0, -0.0], [near, 0.0, 0.0], [0.0, 0.0, 1.0]],
        ];
        let loaded = read(&binary_of(b"", 2, &facets)).expect("read");
        assert_eq!(loaded.mesh.positions.len(), 5, "0 and -0 are one place");
    }

    #[test]
    fn facets_without_area_are_left_out_and_counted() {
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
    fn a_polygon_is_cut_and_solids_are_added() {
        let square = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
        let loaded = read(format!("{square}{}", square.replace(" 0\n", " 3\n")).as_bytes()).expect("read");
        assert_eq!((loaded.mesh.triangles.len(), loaded.mesh.positions.len()), (4, 8));
    }

    #[test]
    fn a_facet_that_crosses_itself_has_a_line() {
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
    fn bytes_behind_the_facets_are_told() {
        let mut bytes = binary_of(b"", 3, &TETRAHEDRON);
        bytes.extend(b"rest");
        let loaded = read(&bytes).expect("read");
        assert_eq!(loaded.mesh.triangles.len(), 3);
        assert_eq!(loaded.warnings, ["54 bytes behind the 3 facets that the header claims are ignored"]);
    }

    #[test]
    fn mistakes_have_their_place() {
        let cut = binary_of(b"", 9, &TETRAHEDRON);
        assert_eq!(says(&cut), "a.stl: the header claims 9 facets, and the file ends after 4 of them");
        assert_eq!(
            says(&binary_of(b"", u32::MAX, &[])),
            "a.stl: the header claims 4294967295 facets, and the file ends after 0 of them"
        );
        assert!(
            says(b"PK\x03\x04 an archive").starts_with("a.stl: an STL file is text that begins with solid")
        );
        let wide: Vec<u8> = "solid a\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert_eq!(says(&wide), "a.stl:1: this is text in UTF-16; save it as UTF-8");
        assert!(says(b"solid a\nendsolid a\n").contains("no usable face: the file has none"));
        assert!(
            says(b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 x\n")
                .starts_with("a.stl:4: expected a coordinate, found \"x\"")
        );
        assert!(
            says(b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 1\n")
                .starts_with("a.stl:4: the file ends in a facet")
        );
        assert!(says(b"solid\nvertex 0 0 1\n").starts_with("a.stl:2: a vertex outside"));
        assert!(
            says(b"solid\nouter loop\nvertex 0 0 1\nendloop\n").starts_with("a.stl:4: a loop of 1 corners")
        );
        assert!(says(b"solid\ncube 1\n").starts_with("a.stl:2: expected a keyword of STL, found \"cube\""));
    }
}
