//! OFF: a header keyword and counts, followed by one vertex per line, then one polygon per line (Geomview
//! manual, section *OFF*). Many files deviate from this: the counts may follow the keyword directly, the edge
//! count may be missing, coordinates and faces may be followed by undeclared columns, and comments and blank
//! lines may be anywhere.

use super::assemble::assemble_text_mesh;
use super::parsed::{ColorRangeDetector, FACE_COLORS_IGNORED, ParsedMesh, alpha_ignored_warning};
use super::text::{TextCursor, expected_message, quote_word, unexpected_line_end_message};
use super::{AssetError, EMPTY_FILE, LoadedMesh, MeshFileBytes, vertex_out_of_range_message};
use crate::math::{DVec2, DVec3, Vec2};

/// Number of vertices or faces between polls of the cancel token.
const BATCH: u64 = 1 << 13;

/// Vertex columns declared by the header keyword.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct DeclaredVertexColumns {
    uvs: bool,
    normals: bool,
    colors: bool,
    /// Whether coordinates are homogeneous. If so, the first three are divided by the fourth.
    homogeneous: bool,
}

pub(super) fn parse(source: &MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError> {
    let (excess, indices) = Default::default();
    OffReader { source: *source, cursor: TextCursor::new(source.bytes, 0), excess, indices }.read()
}

#[derive(Clone, Copy)]
struct OffReader<'a> {
    source: MeshFileBytes<'a>,
    cursor: TextCursor<'a>,
    /// Lines with numbers that the header does not declare.
    excess: LinesToWarnAbout,
    /// Lines whose color is an index into a colormap.
    indices: LinesToWarnAbout,
}

/// Lines to warn about: their number and the byte offset of the first one.
#[derive(Clone, Copy, Default)]
struct LinesToWarnAbout(u64, usize);

impl LinesToWarnAbout {
    fn add_line_at_offset(&mut self, at: usize) {
        self.1 = if self.0 == 0 { at } else { self.1 };
        self.0 += 1;
    }

    fn warning(self, source: &MeshFileBytes<'_>, ignored: &str) -> Option<String> {
        let Self(count, first) = self;
        (count > 0).then(|| ignored_values_warning(source.line_number(first), count, ignored))
    }
}

/// Warning about ignored values on `count` lines.
fn ignored_values_warning(first: usize, count: u64, ignored: &str) -> String {
    match count {
        1 => format!("line {first}: ignored {ignored}"),
        _ => format!("line {first} and {} more: ignored {ignored}", count - 1),
    }
}

const UNDECLARED: &str = "numbers not declared in the header";
const COLOR_INDEX: &str = "a color index without a colormap";
const BINARY_OFF: &str = "binary OFF is not supported; convert it to text or PLY";
const NOT_OFF: &str = "OFF";

fn unsupported_variant_message(keyword: &[u8]) -> String {
    format!("{} is not a supported OFF variant", quote_word(keyword))
}

fn missing_count_message(of: &str) -> String {
    format!("the file ends before the number of {of}")
}

fn negative_count_message(of: &str, number: i64) -> String {
    format!("the number of {of} is {number}")
}

fn count_label(of: &str) -> String {
    format!("the number of {of}")
}

fn words_after_counts_message(found: &[u8]) -> String {
    let found = quote_word(found);
    format!(
        "expected the end of the line after the three counts, found {found}; put each vertex and each face on its own line"
    )
}

fn implausible_counts_message(vertices: u64, faces: u64, remaining: u64) -> String {
    let count =
        |number: u64, one: &str, many: &str| format!("{number} {}", if number == 1 { one } else { many });
    let claim = format!(
        "the header claims {} and {}",
        count(vertices, "vertex", "vertices"),
        count(faces, "face", "faces")
    );
    match remaining {
        0 => format!("{claim}, but the file ends there"),
        _ => format!("{claim}, but only {} follow", count(remaining, "byte", "bytes")),
    }
}

fn truncated_message(index: u64, count: u64, items: &str) -> String {
    format!("the file ends after {index} of {count} {items}")
}

fn too_many_corners_message(arity: usize) -> String {
    format!("a face claims {arity} corners, more than the file can hold")
}

fn incomplete_face_message(corner: usize, arity: usize) -> String {
    format!("a face with {arity} corners ends after {corner}")
}

/// Optional colors of vertices or corners.
#[derive(Default)]
struct ParsedOffColors {
    all: Vec<Option<[f64; 3]>>,
    range: ColorRangeDetector,
    /// Minimum alpha and a byte offset on its line.
    min_alpha: Option<(f64, usize)>,
}

impl ParsedOffColors {
    /// Adds the same color for `times` vertices or corners.
    fn push_repeated(&mut self, color: &[f64], times: usize, at: usize) {
        let color: Option<[f64; 3]> = color.first_chunk().copied();
        color.iter().for_each(|color| self.range.add_color(*color, at));
        self.all.extend(std::iter::repeat_n(color, times));
    }

    fn track_lowest_alpha(&mut self, alpha: f64, at: usize) {
        if self.min_alpha.is_none_or(|(least, _)| alpha < least) {
            self.min_alpha = Some((alpha, at));
        }
    }

    /// Returns the colors as bytes, with white for missing colors, or an empty list if all are missing. Adds
    /// warnings about alpha and out-of-range colors.
    fn into_bytes_adding_warnings(
        self,
        source: &MeshFileBytes<'_>,
        warnings: &mut Vec<String>,
    ) -> Vec<[u8; 3]> {
        if self.all.iter().all(Option::is_none) {
            return Vec::new();
        }
        if let Some((_, at)) = self.min_alpha.filter(|(least, _)| *least < self.range.full_intensity()) {
            warnings.push(alpha_ignored_warning(source.line_number(at)));
        }
        let outside = self.range.out_of_range_warning();
        warnings.extend(outside.map(|(at, words)| format!("line {}: {words}", source.line_number(at))));
        let bytes =
            |color: Option<[f64; 3]>| color.map_or([u8::MAX; 3], |color| self.range.color_to_bytes(color));
        self.all.into_iter().map(bytes).collect()
    }
}

impl OffReader<'_> {
    fn read(mut self) -> Result<LoadedMesh, AssetError> {
        let header = self.read_header_keyword()?;
        let vertices = self.read_count("vertices")?;
        let faces = self.read_count("faces")?;
        self.skip_edge_count_and_line_end()?;
        self.check_plausible_counts(vertices, faces)?;
        let mut parsed = ParsedMesh::default();
        self.read_vertices(header, vertices, &mut parsed)?;
        let before_faces = self;
        let colors = self.read_faces(vertices, faces, &mut parsed)?;
        let face_colors = colors.into_bytes_adding_warnings(&self.source, &mut parsed.warnings);
        if parsed.colors.is_empty() {
            parsed.corner_colors = face_colors;
        } else if !face_colors.is_empty() {
            parsed.warnings.push(FACE_COLORS_IGNORED.to_owned());
        }
        parsed.warnings.extend(self.excess.warning(&self.source, UNDECLARED));
        parsed.warnings.extend(self.indices.warning(&self.source, COLOR_INDEX));
        assemble_text_mesh(&self.source, parsed, |face| before_faces.face_byte_offset(vertices, face))
    }

    /// Returns the byte offset of a face, given its index. The reader must be at the first face.
    fn face_byte_offset(&self, vertices: u64, face: usize) -> Option<usize> {
        let mut ahead = *self;
        ahead.read_faces(vertices, face as u64, &mut ParsedMesh::default()).ok()?;
        ahead.cursor.skip_to_word_across_lines();
        Some(ahead.cursor.offset())
    }

    fn fail<T>(&self, reason: impl Into<String>) -> Result<T, AssetError> {
        Err(self.source.malformed_error_with_line(self.cursor.offset(), reason))
    }

    fn fail_with_unexpected_word<T>(&self, wanted: &str) -> Result<T, AssetError> {
        let mut ahead = self.cursor;
        self.fail(expected_message(wanted, ahead.take_word()))
    }

    /// Reads the optional header keyword `[ST][C][N][4]OFF`. A count may follow without whitespace.
    fn read_header_keyword(&mut self) -> Result<DeclaredVertexColumns, AssetError> {
        if !self.cursor.skip_to_word_across_lines() {
            return self.fail(EMPTY_FILE);
        }
        let start = self.cursor;
        let word = self.cursor.take_word();
        if word[0].is_ascii_digit() && !word.ends_with(b"OFF") {
            self.cursor = start;
            return Ok(DeclaredVertexColumns::default());
        }
        let Some(end) = word.windows(3).position(|part| part == b"OFF") else {
            self.cursor = start;
            return self.fail(expected_message(NOT_OFF, word));
        };
        let (flags, digits) = (&word[..end], &word[end + 3..]);
        let known = flags.iter().all(|letter| b"STCN4".contains(letter));
        if !known || !digits.iter().all(u8::is_ascii_digit) {
            return self.fail(unsupported_variant_message(word));
        }
        self.cursor = TextCursor::new(self.source.bytes, self.cursor.offset() - digits.len());
        self.reject_binary()?;
        let has = |letter| flags.contains(&letter);
        Ok(DeclaredVertexColumns {
            uvs: has(b'S'),
            normals: has(b'N'),
            colors: has(b'C'),
            homogeneous: has(b'4'),
        })
    }

    fn reject_binary(&mut self) -> Result<(), AssetError> {
        let mut ahead = self.cursor;
        if ahead.skip_to_word_in_line() && ahead.take_word() == b"BINARY" {
            return self.fail(BINARY_OFF);
        }
        Ok(())
    }

    fn read_count(&mut self, of: &str) -> Result<u64, AssetError> {
        if !self.cursor.skip_to_word_across_lines() {
            let end = self.source.bytes.trim_ascii_end().len();
            return Err(self.source.malformed_error_with_line(end, missing_count_message(of)));
        }
        self.read_nonnegative_integer(of)
    }

    /// Reads a nonnegative integer at the cursor.
    fn read_nonnegative_integer(&mut self, of: &str) -> Result<u64, AssetError> {
        match self.cursor.take_integer() {
            Some(number) => match u64::try_from(number) {
                Ok(number) => Ok(number),
                Err(_) => self.fail(negative_count_message(of, number)),
            },
            None => self.fail_with_unexpected_word(&count_label(of)),
        }
    }

    /// Skips the optional number of edges and the end of the line.
    fn skip_edge_count_and_line_end(&mut self) -> Result<(), AssetError> {
        if self.cursor.skip_to_word_in_line() {
            self.read_nonnegative_integer("edges")?;
        }
        if self.cursor.skip_to_word_in_line() {
            let mut ahead = self.cursor;
            return self.fail(words_after_counts_message(ahead.take_word()));
        }
        self.cursor.move_to_next_line();
        Ok(())
    }

    /// Checks the counts against the file size. A vertex takes at least 6 bytes, a face at least 2.
    fn check_plausible_counts(&self, vertices: u64, faces: u64) -> Result<(), AssetError> {
        let needed = vertices.saturating_mul(6).saturating_add(faces.saturating_mul(2));
        let remaining = self.cursor.remaining_byte_count() as u64;
        if needed > remaining + 1 || vertices > u64::from(u32::MAX) {
            let reason = implausible_counts_message(vertices, faces, remaining);
            return Err(self
                .source
                .malformed_error_with_line(self.cursor.offset().saturating_sub(1), reason));
        }
        Ok(())
    }

    fn read_vertices(
        &mut self,
        header: DeclaredVertexColumns,
        count: u64,
        parsed: &mut ParsedMesh,
    ) -> Result<(), AssetError> {
        parsed.positions.reserve(count as usize);
        let mut colors = ParsedOffColors::default();
        for index in 0..count {
            if index % BATCH == 0 {
                self.source.report_progress(self.cursor.offset())?;
            }
            if !self.cursor.skip_to_word_across_lines() {
                return self.fail(truncated_message(index, count, "vertices"));
            }
            let position = self.read_vec3("a coordinate")?;
            let divisor = if header.homogeneous { self.read_float("a coordinate")? } else { 1.0 };
            parsed.positions.push(position / divisor);
            if header.normals {
                parsed.normals.push(self.read_vec3("a normal")?.as_vec3());
            }
            if header.colors {
                let rest = self.read_numbers_to_line_end()?;
                let (color, uv) = rest.split_at(rest.len().saturating_sub(if header.uvs { 2 } else { 0 }));
                if header.uvs {
                    let [u, v] = *uv else {
                        return self.fail(unexpected_line_end_message("texture coordinates"));
                    };
                    parsed.uvs.push(DVec2::new(u, v).as_vec2());
                }
                self.add_color_repeatedly(color, 1, &mut colors);
            } else if header.uvs {
                parsed.uvs.push(self.read_uv_at_line_end()?);
            } else if self.cursor.skip_to_word_in_line() {
                self.excess.add_line_at_offset(self.cursor.offset());
            }
            self.cursor.move_to_next_line();
        }
        parsed.colors = colors.into_bytes_adding_warnings(&self.source, &mut parsed.warnings);
        Ok(())
    }

    /// Adds a color from the end of a line to `times` vertices or corners.
    fn add_color_repeatedly(&mut self, color: &[f64], times: usize, colors: &mut ParsedOffColors) {
        colors.push_repeated(color, times, self.cursor.offset());
        match color {
            [_, _, _, alpha] => colors.track_lowest_alpha(*alpha, self.cursor.offset()),
            [_] => self.indices.add_line_at_offset(self.cursor.offset()),
            [] | [_, _, _] => {}
            [_, _] | [_, _, _, _, _, ..] => self.excess.add_line_at_offset(self.cursor.offset()),
        }
    }

    fn read_vec3(&mut self, what: &str) -> Result<DVec3, AssetError> {
        Ok(DVec3::new(self.read_float(what)?, self.read_float(what)?, self.read_float(what)?))
    }

    fn read_float(&mut self, what: &str) -> Result<f64, AssetError> {
        if !self.cursor.skip_to_word_in_line() {
            return self.fail(unexpected_line_end_message(what));
        }
        match self.cursor.take_float() {
            Some(value) => Ok(value),
            None => self.fail_with_unexpected_word(what),
        }
    }

    /// Reads the remaining numbers on the line: a color with any number of components, and texture
    /// coordinates.
    fn read_numbers_to_line_end(&mut self) -> Result<Vec<f64>, AssetError> {
        let mut rest = Vec::new();
        while self.cursor.skip_to_word_in_line() {
            rest.push(self.read_float("a number")?);
        }
        Ok(rest)
    }

    /// Reads texture coordinates: the last two numbers on the line. A color with any number of components may
    /// precede them.
    fn read_uv_at_line_end(&mut self) -> Result<Vec2, AssetError> {
        let mut last = DVec2::new(self.read_float("u")?, self.read_float("v")?);
        while self.cursor.skip_to_word_in_line() {
            last = DVec2::new(last.y, self.read_float("a number")?);
        }
        Ok(last.as_vec2())
    }

    fn read_faces(
        &mut self,
        vertices: u64,
        count: u64,
        parsed: &mut ParsedMesh,
    ) -> Result<ParsedOffColors, AssetError> {
        parsed.faces.reserve(count as usize);
        let mut colors = ParsedOffColors::default();
        for index in 0..count {
            if index % BATCH == 0 {
                self.source.report_progress(self.cursor.offset())?;
            }
            if !self.cursor.skip_to_word_across_lines() {
                return self.fail(truncated_message(index, count, "faces"));
            }
            self.read_face(vertices, parsed, &mut colors)?;
        }
        Ok(colors)
    }

    fn read_face(
        &mut self,
        vertices: u64,
        parsed: &mut ParsedMesh,
        colors: &mut ParsedOffColors,
    ) -> Result<(), AssetError> {
        let arity = usize::try_from(self.read_nonnegative_integer("corners")?).unwrap_or(usize::MAX);
        if arity.saturating_mul(2) > self.cursor.remaining_byte_count() {
            return self.fail(too_many_corners_message(arity));
        }
        for corner in 0..arity {
            if !self.cursor.skip_to_word_in_line()
                && (corner == 0 || !self.cursor.skip_to_word_across_lines())
            {
                return self.fail(incomplete_face_message(corner, arity));
            }
            match self.cursor.take_integer() {
                Some(vertex) if (0..vertices as i64).contains(&vertex) => {
                    parsed.faces.push_corner(vertex as u32);
                }
                Some(vertex) => return self.fail(vertex_out_of_range_message(vertex, vertices)),
                None => return self.fail_with_unexpected_word("a vertex"),
            }
        }
        parsed.faces.end_face(arity);
        let (mut color, mut count) = ([0.0; 5], 0);
        while count < color.len() && self.cursor.skip_to_word_in_line() {
            let Some(number) = self.cursor.take_float() else {
                self.excess.add_line_at_offset(self.cursor.offset());
                break;
            };
            color[count] = number;
            count += 1;
        }
        self.add_color_repeatedly(&color[..count], arity, colors);
        self.cursor.move_to_next_line();
        Ok(())
    }
}

#[cfg(test)]
mod tests;
