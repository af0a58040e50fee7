//! OFF: a header word, counts, a vertex a line, a polygon a line (Geomview's manual, section *OFF*). Real files vary:
//! counts behind the header word, no edge count, undeclared columns behind coordinates and faces, comments and blank
//! lines anywhere.

use super::assemble::assemble_text;
use super::parsed::{ColorRange, Parsed};
use super::text::{Cursor, shown};
use super::{AssetError, LoadedMesh, Source};
use crate::math::{DVec2, DVec3, Vec2};

/// Lines between two polls of the token.
const BATCH: u64 = 1 << 13;

/// Columns of each vertex according to the header word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Header {
    uvs: bool,
    normals: bool,
    colors: bool,
    /// A fourth coordinate that divides the others.
    homogeneous: bool,
}

pub(super) fn parse(source: &Source<'_>) -> Result<LoadedMesh, AssetError> {
    let (excess, indices) = Default::default();
    Reader { source: *source, cursor: Cursor::new(source.bytes, 0), excess, indices }.read()
}

#[derive(Clone, Copy)]
struct Reader<'a> {
    source: Source<'a>,
    cursor: Cursor<'a>,
    /// Lines with numbers that the header does not name.
    excess: Lines,
    /// Lines whose color is a number in a colormap.
    indices: Lines,
}

/// Lines to warn of: their number, and a byte of the first.
#[derive(Clone, Copy, Default)]
struct Lines(u64, usize);

impl Lines {
    fn add(&mut self, at: usize) {
        self.1 = if self.0 == 0 { at } else { self.1 };
        self.0 += 1;
    }

    fn warning(self, source: &Source<'_>, what: &str) -> Option<String> {
        let Self(count, first) = self;
        let line = source.line(first);
        match count {
            0 => None,
            1 => Some(format!("line {line} has {what}: ignored")),
            _ => Some(format!("line {line} and {} more have {what}: ignored", count - 1)),
        }
    }
}

/// Colors of vertices or corners, where they have some.
#[derive(Default)]
struct Colors {
    all: Vec<Option<[f64; 3]>>,
    range: ColorRange,
    /// The least alpha, and a byte of its line.
    least_alpha: Option<(f64, usize)>,
}

impl Colors {
    /// Adds the color for `times` vertices or corners.
    fn push(&mut self, color: &[f64], times: usize) {
        let color: Option<[f64; 3]> = color.first_chunk().copied().inspect(|color| self.range.add(*color));
        self.all.extend(std::iter::repeat_n(color, times));
    }

    fn alpha(&mut self, alpha: f64, at: usize) {
        if self.least_alpha.is_none_or(|(least, _)| alpha < least) {
            self.least_alpha = Some((alpha, at));
        }
    }

    /// All colors in bytes, white where there is none; empty if there are none at all.
    fn finish(self, source: &Source<'_>, warnings: &mut Vec<String>) -> Vec<[u8; 3]> {
        if self.all.iter().all(Option::is_none) {
            return Vec::new();
        }
        if let Some((_, at)) = self.least_alpha.filter(|(least, _)| *least < self.range.one()) {
            let line = source.line(at);
            warnings.push(format!("line {line}: the alpha of the colors is ignored"));
        }
        let bytes = |color: Option<[f64; 3]>| color.map_or([u8::MAX; 3], |color| self.range.bytes(color));
        self.all.into_iter().map(bytes).collect()
    }
}

impl Reader<'_> {
    fn read(mut self) -> Result<LoadedMesh, AssetError> {
        let header = self.header()?;
        let vertices = self.count("vertices")?;
        let faces = self.count("faces")?;
        self.end_counts()?;
        self.plausible(vertices, faces)?;
        let mut parsed = Parsed::default();
        self.vertices(header, vertices, &mut parsed)?;
        let before_faces = self;
        let colors = self.faces(vertices, faces, &mut parsed)?;
        let own_colors = colors.finish(&self.source, &mut parsed.warnings);
        if parsed.colors.is_empty() {
            parsed.corner_colors = own_colors;
        } else if !own_colors.is_empty() {
            parsed.warnings.push("the colors of the faces are ignored: the vertices have colors".to_owned());
        }
        parsed.warnings.extend(self.excess.warning(&self.source, "more numbers than the header names"));
        parsed
            .warnings
            .extend(self.indices.warning(&self.source, "an index into a colormap that is elsewhere"));
        assemble_text(&self.source, parsed, |face| before_faces.start_of_face(vertices, face))
    }

    /// Offset of a face, counted from 0, for a reader at the first one.
    fn start_of_face(&self, vertices: u64, face: usize) -> Option<usize> {
        let mut ahead = *self;
        ahead.faces(vertices, face as u64, &mut Parsed::default()).ok()?;
        ahead.cursor.skip_blank();
        Some(ahead.cursor.at())
    }

    fn wrong<T>(&self, reason: impl Into<String>) -> Result<T, AssetError> {
        Err(self.source.wrong_at(self.cursor.at(), reason))
    }

    fn unexpected<T>(&self, wanted: &str) -> Result<T, AssetError> {
        let mut ahead = self.cursor;
        self.wrong(format!("expected {wanted}, found {}", shown(ahead.word())))
    }

    /// Reads the header word: `[ST][C][N][4]OFF`. Counts may follow it without a blank, and it may be missing.
    fn header(&mut self) -> Result<Header, AssetError> {
        if !self.cursor.skip_blank() {
            return self.wrong("the file is empty");
        }
        let start = self.cursor;
        let word = self.cursor.word();
        if word[0].is_ascii_digit() && !word.ends_with(b"OFF") {
            self.cursor = start;
            return Ok(Header::default());
        }
        let Some(end) = word.windows(3).position(|part| part == b"OFF") else {
            self.cursor = start;
            return self.wrong(format!("expected OFF, found {}", shown(word)));
        };
        let (kind, behind) = (&word[..end], &word[end + 3..]);
        let known = kind.iter().all(|letter| b"STCN4".contains(letter));
        if !known || !behind.iter().all(u8::is_ascii_digit) {
            return self.wrong(format!("{} is no kind of OFF that can be read", shown(word)));
        }
        self.cursor = Cursor::new(self.source.bytes, self.cursor.at() - behind.len());
        self.refuse_binary()?;
        let has = |letter| kind.contains(&letter);
        Ok(Header { uvs: has(b'S'), normals: has(b'N'), colors: has(b'C'), homogeneous: has(b'4') })
    }

    fn refuse_binary(&mut self) -> Result<(), AssetError> {
        let mut ahead = self.cursor;
        if ahead.skip_in_line() && ahead.word() == b"BINARY" {
            return self.wrong("binary OFF files are not read; write it as text or PLY");
        }
        Ok(())
    }

    fn count(&mut self, of: &str) -> Result<u64, AssetError> {
        if !self.cursor.skip_blank() {
            let reason = format!("the file ends before the number of {of}");
            return Err(self.source.wrong_at(self.source.bytes.trim_ascii_end().len(), reason));
        }
        self.number(of)
    }

    /// Reads the whole number ≥ 0 that starts here.
    fn number(&mut self, of: &str) -> Result<u64, AssetError> {
        match self.cursor.integer() {
            Some(number) => match u64::try_from(number) {
                Ok(number) => Ok(number),
                Err(_) => self.wrong(format!("the number of {of} is {number}")),
            },
            None => self.unexpected(&format!("the number of {of}")),
        }
    }

    /// Reads the number of edges, which nothing needs and which may be missing.
    fn end_counts(&mut self) -> Result<(), AssetError> {
        if self.cursor.skip_in_line() {
            self.number("edges")?;
        }
        if self.cursor.skip_in_line() {
            let mut ahead = self.cursor;
            return self.wrong(format!(
                "expected the line's end behind the three counts, found {}; each vertex and each face stands on a line \
                 of its own",
                shown(ahead.word())
            ));
        }
        self.cursor.end_line();
        Ok(())
    }

    /// Checks the counts: a vertex takes at least 6 bytes, a face at least 2; a header that claims more is wrong.
    fn plausible(&self, vertices: u64, faces: u64) -> Result<(), AssetError> {
        let needed = vertices.saturating_mul(6).saturating_add(faces.saturating_mul(2));
        let remaining = self.cursor.remaining() as u64;
        if needed > remaining + 1 || vertices > u64::from(u32::MAX) {
            let count = |number: u64, one: &str, many: &str| {
                format!("{number} {}", if number == 1 { one } else { many })
            };
            let claim = format!(
                "the header claims {} and {}",
                count(vertices, "vertex", "vertices"),
                count(faces, "face", "faces")
            );
            let reason = match remaining {
                0 => format!("{claim}, and the file ends behind it"),
                _ => format!("{claim}, and only {} follow", count(remaining, "byte", "bytes")),
            };
            return Err(self.source.wrong_at(self.cursor.at().saturating_sub(1), reason));
        }
        Ok(())
    }

    fn vertices(&mut self, header: Header, count: u64, parsed: &mut Parsed) -> Result<(), AssetError> {
        parsed.positions.reserve(count as usize);
        let mut colors = Colors::default();
        for index in 0..count {
            if index % BATCH == 0 {
                self.source.tick(self.cursor.at())?;
            }
            if !self.cursor.skip_blank() {
                return self.wrong(format!("the file ends after {index} of {count} vertices"));
            }
            let position = self.triple("a coordinate")?;
            let divisor = if header.homogeneous { self.float("a coordinate")? } else { 1.0 };
            parsed.positions.push(position / divisor);
            if header.normals {
                parsed.normals.push(self.triple("a normal")?.as_vec3());
            }
            if header.colors {
                let rest = self.rest_of_line()?;
                let (color, uv) = rest.split_at(rest.len().saturating_sub(if header.uvs { 2 } else { 0 }));
                if header.uvs {
                    let [u, v] = *uv else {
                        return self.wrong("expected texture coordinates, found the line's end");
                    };
                    parsed.uvs.push(DVec2::new(u, v).as_vec2());
                }
                self.color(color, 1, &mut colors);
            } else if header.uvs {
                parsed.uvs.push(self.last_two()?);
            } else if self.cursor.skip_in_line() {
                self.excess.add(self.cursor.at());
            }
            self.cursor.end_line();
        }
        parsed.colors = colors.finish(&self.source, &mut parsed.warnings);
        Ok(())
    }

    /// Adds the color that ends a line, for `times` vertices or corners.
    fn color(&mut self, color: &[f64], times: usize, colors: &mut Colors) {
        colors.push(color, times);
        match color {
            [_, _, _, alpha] => colors.alpha(*alpha, self.cursor.at()),
            [_] => self.indices.add(self.cursor.at()),
            [] | [_, _, _] => {}
            [_, _] | [_, _, _, _, _, ..] => self.excess.add(self.cursor.at()),
        }
    }

    fn triple(&mut self, what: &str) -> Result<DVec3, AssetError> {
        Ok(DVec3::new(self.float(what)?, self.float(what)?, self.float(what)?))
    }

    fn float(&mut self, what: &str) -> Result<f64, AssetError> {
        if !self.cursor.skip_in_line() {
            return self.wrong(format!("expected {what}, found the line's end"));
        }
        match self.cursor.float() {
            Some(value) => Ok(value),
            None => self.unexpected(what),
        }
    }

    /// Reads the numbers up to the line's end: a colour of any length, and texture coordinates.
    fn rest_of_line(&mut self) -> Result<Vec<f64>, AssetError> {
        let mut rest = Vec::new();
        while self.cursor.skip_in_line() {
            rest.push(self.float("a number")?);
        }
        Ok(rest)
    }

    /// Reads texture coordinates, which are the last of a line, behind a colour of any length.
    fn last_two(&mut self) -> Result<Vec2, AssetError> {
        let mut last = DVec2::new(self.float("u")?, self.float("v")?);
        while self.cursor.skip_in_line() {
            last = DVec2::new(last.y, self.float("a number")?);
        }
        Ok(last.as_vec2())
    }

    fn faces(&mut self, vertices: u64, count: u64, parsed: &mut Parsed) -> Result<Colors, AssetError> {
        parsed.faces.reserve(count as usize);
        let mut colors = Colors::default();
        for index in 0..count {
            if index % BATCH == 0 {
                self.source.tick(self.cursor.at())?;
            }
            if !self.cursor.skip_blank() {
                return self.wrong(format!("the file ends after {index} of {count} faces"));
            }
            self.face(vertices, parsed, &mut colors)?;
        }
        Ok(colors)
    }

    fn face(&mut self, vertices: u64, parsed: &mut Parsed, colors: &mut Colors) -> Result<(), AssetError> {
        let arity = usize::try_from(self.number("corners")?).unwrap_or(usize::MAX);
        if arity.saturating_mul(2) > self.cursor.remaining() {
            return self.wrong(format!("a face claims {arity} corners, more than the file can hold"));
        }
        for corner in 0..arity {
            if !self.cursor.skip_in_line() && (corner == 0 || !self.cursor.skip_blank()) {
                return self.wrong(format!("a face of {arity} corners ends after {corner}"));
            }
            match self.cursor.integer() {
                Some(vertex) if (0..vertices as i64).contains(&vertex) => parsed.faces.corner(vertex as u32),
                Some(vertex) => {
                    return self
                        .wrong(format!("vertex {vertex} is out of range: there are {vertices}, from 0"));
                }
                None => return self.unexpected("a vertex"),
            }
        }
        parsed.faces.close(arity);
        let (mut color, mut count) = ([0.0; 5], 0);
        while count < color.len() && self.cursor.skip_in_line() {
            let Some(number) = self.cursor.float() else {
                self.excess.add(self.cursor.at());
                break;
            };
            color[count] = number;
            count += 1;
        }
        self.color(&color[..count], arity, colors);
        self.cursor.end_line();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::read::Watch;
    use crate::control::{CancelToken, ignore_progress};
    use crate::math::Vec3;
    use std::path::Path;

    fn read(text: &str) -> Result<LoadedMesh, AssetError> {
        let token = CancelToken::new();
        let watch = Watch { progress: &ignore_progress, token: &token };
        parse(&Source { path: Path::new("a.off"), bytes: text.as_bytes(), watch })
    }

    fn says(text: &str) -> String {
        read(text).expect_err("refused").to_string()
    }

    const FACES: &str = "3 0 1 2\n3 0 2 3\n";

    #[test]
    fn one_mesh_in_all_the_ways_it_occurs() {
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
            // Normals that the header does not declare.
            format!("OFF\n4 2 0\n{}{FACES}", lines(" 0 0 -1")),
            format!("4OFF\n4 2 0\n{}{FACES}", lines(" 1")),
            format!("OFF\n4 2 0\n{}3 0 1 2 7\n3  0 2 3 x\n", lines("")),
            format!("OFF\n4 2 0\n{}{}", lines(""), FACES.trim_end()),
            // A polygon instead of two triangles.
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
    fn declared_colours_are_read() {
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

    /// Colors of the corners of two triangles, whose lines end in these tails, and the warnings.
    fn of_faces(header: &str, vertex: &str, tails: [&str; 2]) -> (Vec<[u8; 3]>, Vec<String>) {
        let [a, b] = tails;
        let text = format!(
            "{header}\n4 2 0\n0 0 0{vertex}\n1 0 0{vertex}\n1 1 0{vertex}\n0 1 0{vertex}\n3 0 1 2 {a}\n3 0 2 3 {b}\n"
        );
        let loaded = super::tests::read(&text).unwrap_or_else(|error| panic!("{error}: {text}"));
        let mesh = &loaded.mesh;
        let corners =
            mesh.triangles.as_flattened().iter().filter_map(|vertex| mesh.colors.get(*vertex as usize));
        (corners.copied().collect(), loaded.warnings)
    }

    #[test]
    fn colors_of_faces_are_read() {
        let (red, green, white) = ([255, 0, 0], [0, 255, 0], [255; 3]);
        let off = |tails| of_faces("OFF", "", tails);
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
        let index = "line 7 has an index into a colormap that is elsewhere: ignored";
        assert_eq!(off(["3", "255 0 0"]), ([[white; 3], [red; 3]].concat(), vec![index.to_owned()]));
        let (colors, faded) = off(["1 0 0", "0 1 0 0.5"]);
        assert_eq!((colors, faded.len()), ([[red; 3], [green; 3]].concat(), 1));
        assert!(faded[0].starts_with("line 8: "), "{faded:?}");
        let more = "line 7 and 1 more have more numbers than the header names: ignored";
        assert_eq!(off(["1 2", "1 0 0 1 7"]), ([[white; 3], [red; 3]].concat(), vec![more.to_owned()]));
        let vertices = "the colors of the faces are ignored: the vertices have colors";
        assert_eq!(
            of_faces("COFF", " 0 255 0", ["255 0 0", "255 0 0"]),
            (vec![green; 6], vec![vertices.to_owned()])
        );
    }

    #[test]
    fn a_face_that_crosses_itself_has_a_line() {
        let text = "OFF 4 3\n0 0 0\n3 0 0\n0 1 0\n3 2 0\n3 0 1 2 # x\n\n4 0 1 3\n2 255 0 0\n4 0 1 2 3\n";
        let warnings = read(text).expect("whole").warnings;
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].starts_with("line 10: face 3 "), "{warnings:?}");
    }

    #[test]
    fn numbers_that_the_header_does_not_name_have_their_line() {
        let more = "line 3 and 3 more have more numbers than the header names: ignored";
        assert_eq!(of_faces("OFF", " 0 0 1", ["", ""]), (vec![], vec![more.to_owned()]));
        assert_eq!(of_faces("NOFF", " 0 0 1 7", ["", ""]).1, [more.to_owned()]);
        assert!(of_faces("NOFF", " 0 0 1", ["", ""]).1.is_empty());
    }

    #[test]
    fn declared_normals_and_texture_coordinates_are_read() {
        let text = "STCNOFF\n3 1 0\n0 0 0 0 0 2 9 9 9 9 0.5 0.25\n1 0 0 0 0 2 9 9 9 1 0\n0 1 0 0 0 2 9 0 1\n3 0 1 2\n";
        let mesh = read(text).expect("whole").mesh;
        assert_eq!(mesh.normals, [Vec3::Z; 3]);
        assert_eq!(mesh.uvs, [Vec2::new(0.5, 0.25), Vec2::X, Vec2::Y]);
        let text = "4OFF\n3 1 0\n0 0 0 2\n1 0 0 2\n0 1 0 0.5\n3 0 1 2\n";
        assert_eq!(read(text).expect("whole").mesh.positions, [Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 2.0]);
    }

    #[test]
    fn errors_name_the_line() {
        let start = "OFF\n# comment\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n";
        assert!(says(&format!("{start}3 0 1 3\n")).starts_with("a.off:7: vertex 3 is out of range"));
        assert!(says(&format!("{start}3 0 -1 2\n")).starts_with("a.off:7: vertex -1 is out of range"));
        assert!(says(&format!("{start}3 0 1 x\n")).starts_with("a.off:7: expected a vertex, found \"x\""));
        assert!(says(&format!("{start}3 0 1  \n\n")).contains("a face of 3 corners ends after 2"));
        assert!(
            says("OFF\n2 1 0\n0 0 0\n0 zero 0 0\n3 0 1 2\n").starts_with("a.off:4: expected a coordinate")
        );
        assert!(
            says("OFF\n2 1 0\n0 0 0\n0 0\n30 0 1 2 3\n")
                .starts_with("a.off:4: expected a coordinate, found the")
        );
        assert!(says("OFF\n1 2 0\n0 0 0\n3 0 0 0\n      \n").contains("after 1 of 2 faces"));
        assert!(says("").contains("empty"));
        assert!(says("solid\n").starts_with("a.off:1: expected OFF, found \"solid\""));
        assert!(says("nOFF 3\n").contains("no kind of OFF"));
        assert!(says("OFF BINARY\n").contains("binary"));
        for (text, reason) in [
            ("OFF\n-1 2 0\n", "a.off:2: the number of vertices is -1"),
            ("OFF -3 1 0\n", "a.off:1: the number of vertices is -3"),
            ("OFF\n3 -1 0\n", "a.off:2: the number of faces is -1"),
            ("OFF\n1.5 2 0\n", "a.off:2: expected the number of vertices, found \"1.5\""),
            ("OFF\n3 x 0\n", "a.off:2: expected the number of faces, found \"x\""),
            ("OFF 3\n", "a.off:1: the file ends before the number of faces"),
            ("OFF", "a.off:1: the file ends before the number of vertices"),
            ("OFF 3 1 0", "a.off:1: the header claims 3 vertices and 1 face, and the file ends behind it"),
            ("OFF 3 1 x\n", "a.off:1: expected the number of edges, found \"x\""),
            (
                "OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2\n",
                "a.off:1: expected the line's end behind the three counts, found \"0\"; each vertex and each face stands on a line of its own",
            ),
        ] {
            assert_eq!(says(text), reason);
        }
        assert_eq!(says(&format!("{start}-3 0 1 2\n")), "a.off:7: the number of corners is -3");
        assert_eq!(
            says(&format!("{start}x 0 1 2\n")),
            "a.off:7: expected the number of corners, found \"x\""
        );
    }

    #[test]
    fn lies_cost_nothing() {
        assert!(says("OFF\n4000000000 4000000000 0\n0 0 0\n").contains("only 6 bytes follow"));
        assert!(says("OFF\n18446744073709551615 1 0\n").contains("number of vertices"));
        let text = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4000000000 0 1 2\n";
        assert!(says(text).starts_with("a.off:6: a face claims 4000000000 corners"));
    }
}
