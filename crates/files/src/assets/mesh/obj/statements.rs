//! Parses the statements in an OBJ file.

use super::super::parsed::{alpha_ignored_warning, face_index_of_corner};
use super::super::text::expected_message;
use super::super::{AssetError, MeshFileBytes};
use super::vertex::Vertices;
use super::words::{ObjTextCursor, parse_integer, parse_number, too_few_numbers_message};
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Number of statements between polls of the cancel token.
const BATCH: u64 = 1 << 13;

/// Index used for an attribute that a corner lacks.
pub(super) const NONE: u32 = u32::MAX;

/// Position index, texture coordinate index and normal index of a corner, all starting at 0.
pub(super) type CornerIndices = [u32; 3];

/// Smoothing for faces without normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Smoothing {
    /// No `s` statement precedes the face.
    Unspecified,
    /// `s off` or `s 0`.
    Flat,
    /// `s` followed by a positive number.
    Group(u32),
}

/// A statement that changes the state for subsequent faces.
pub(super) enum StateChange {
    /// `o` or `g`.
    Object,
    Library(String),
    Material(String),
    Smoothing(Smoothing),
}

/// Length of the longest keyword.
const MAX_KEYWORD_LENGTH: usize = 6;

/// Converts a keyword to lowercase. Words longer than any keyword are returned unchanged.
fn keyword_to_lowercase<'a>(word: &'a [u8], lower: &'a mut [u8; MAX_KEYWORD_LENGTH]) -> &'a [u8] {
    let Some(lower) = lower.get_mut(..word.len()) else { return word };
    lower.copy_from_slice(word);
    lower.make_ascii_lowercase();
    lower
}

/// Parsed contents of an OBJ file.
#[derive(Default)]
pub(super) struct ParsedObj {
    pub(super) vertices: Vertices,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    /// Corners of all faces, concatenated.
    pub(super) corners: Vec<CornerIndices>,
    /// Number of corners of each face.
    pub(super) arities: Vec<u32>,
    /// State changes, each with the number of faces that precede it.
    pub(super) changes: Vec<(usize, StateChange)>,
    pub(super) warnings: Vec<String>,
    /// Byte offset and keyword of the first free-form curve or surface.
    free_form: Option<(usize, String)>,
}

impl ParsedObj {
    pub(super) fn read(source: &MeshFileBytes<'_>) -> Result<Self, AssetError> {
        let mut found = Self::default();
        let mut words = ObjTextCursor::new(source.bytes);
        let mut count = 0;
        while words.move_to_next_statement() {
            if count % BATCH == 0 {
                source.report_progress(words.offset())?;
            }
            count += 1;
            let start = words.offset();
            found
                .parse_statement(source, &mut words)
                .map_err(|reason| source.malformed_error_with_line(start, reason))?;
            words.take_raw_line_rest();
        }
        found.drop_indices_of_absent_attributes(source);
        found.check_index_ranges(source)?;
        found.add_warnings(source);
        Ok(found)
    }

    fn parse_statement(
        &mut self,
        source: &MeshFileBytes<'_>,
        words: &mut ObjTextCursor<'_>,
    ) -> Result<(), String> {
        let start = words.offset();
        let Some(keyword) = words.next_word() else {
            if let Some(paint) = words.take_raw_line_rest().strip_prefix(b"#MRGB ") {
                self.vertices.read_mrgb_colors(paint);
            }
            return Ok(());
        };
        let mut lower = [0; MAX_KEYWORD_LENGTH];
        match keyword_to_lowercase(keyword, &mut lower) {
            b"v" => self.vertices.parse_vertex(words)?,
            b"vt" => {
                let [u, v, _] = parse_min_to_max_numbers(words, 1, 2, "texture coordinates")?;
                self.uvs.push(DVec2::new(u, v).as_vec2());
            }
            b"vn" => {
                self.normals.push(
                    DVec3::from(parse_min_to_max_numbers(words, 3, 3, "normal coordinates")?).as_vec3(),
                );
            }
            b"f" => self.parse_face(words)?,
            b"o" | b"g" => self.push_state_change(StateChange::Object),
            b"s" => self.parse_smoothing(source, words, start),
            b"mtllib" => {
                let name = words.take_name();
                self.push_state_change(StateChange::Library(name));
            }
            b"usemtl" => {
                let name = words.take_name();
                self.push_state_change(StateChange::Material(name));
            }
            b"surf" | b"curv" | b"curv2" => {
                self.free_form.get_or_insert((start, String::from_utf8_lossy(keyword).into_owned()));
            }
            _ => {}
        }
        Ok(())
    }

    fn push_state_change(&mut self, change: StateChange) {
        self.changes.push((self.arities.len(), change));
    }

    /// Parses a smoothing group. Ignores invalid groups with a warning.
    fn parse_smoothing(&mut self, source: &MeshFileBytes<'_>, words: &mut ObjTextCursor<'_>, start: usize) {
        let group = words.next_word().unwrap_or(b"off");
        let smoothing = match parse_integer(group).map(u32::try_from) {
            Some(Ok(0)) => Smoothing::Flat,
            Some(Ok(number)) => Smoothing::Group(number),
            None if group.eq_ignore_ascii_case(b"off") => Smoothing::Flat,
            None if group.eq_ignore_ascii_case(b"on") => Smoothing::Group(1),
            Some(Err(_)) | None => {
                self.warnings.push(invalid_smoothing_warning(source.line_number(start), group));
                return;
            }
        };
        self.push_state_change(StateChange::Smoothing(smoothing));
    }

    fn parse_face(&mut self, words: &mut ObjTextCursor<'_>) -> Result<(), String> {
        let counts = [self.vertices.positions.len(), self.uvs.len(), self.normals.len()];
        let before = self.corners.len();
        while let Some(word) = words.next_word() {
            self.corners.push(parse_corner(word, counts)?);
        }
        self.arities.push((self.corners.len() - before) as u32);
        Ok(())
    }

    /// If the file lacks texture coordinates or normals, drops their indices from all corners and adds a
    /// warning.
    fn drop_indices_of_absent_attributes(&mut self, source: &MeshFileBytes<'_>) {
        for (part, count, name) in
            [(1, self.uvs.len(), "texture coordinates"), (2, self.normals.len(), "normals")]
        {
            let Some(first) = self.corners.iter().position(|corner| corner[part] != NONE) else { continue };
            if count == 0 {
                let line = source
                    .line_number(byte_offset_of_face(source, face_index_of_corner(&self.arities, first)));
                self.warnings.push(attribute_not_in_file_warning(line, name));
                self.corners.iter_mut().for_each(|corner| corner[part] = NONE);
            }
        }
    }

    /// Checks the indices of all corners. Must be called after all statements are parsed, because faces may
    /// precede their vertices.
    fn check_index_ranges(&self, source: &MeshFileBytes<'_>) -> Result<(), AssetError> {
        let counts = [self.vertices.positions.len(), self.uvs.len(), self.normals.len()];
        let wrong = |corner: &CornerIndices| {
            (0..3).find(|part| corner[*part] as usize >= counts[*part] && corner[*part] != NONE)
        };
        let Some((place, part)) =
            self.corners.iter().enumerate().find_map(|(place, corner)| Some((place, wrong(corner)?)))
        else {
            return Ok(());
        };
        let index = i64::from(self.corners[place][part]) + 1;
        Err(source.malformed_error_with_line(
            byte_offset_of_face(source, face_index_of_corner(&self.arities, place)),
            out_of_range_message(part, index, counts[part]),
        ))
    }

    fn add_warnings(&mut self, source: &MeshFileBytes<'_>) {
        if let Some(start) = self.vertices.first_excess {
            let line = source.line_number(start);
            self.warnings.push(excess_vertex_words_warning(line));
        }
        if let Some(start) = self.vertices.most_transparent_vertex_offset() {
            self.warnings.push(alpha_ignored_warning(source.line_number(start)));
        }
        if let Some((start, words)) = self.vertices.out_of_range_color_warning() {
            self.warnings.push(format!("line {}: {words}", source.line_number(start)));
        }
        if let Some((start, keyword)) = &self.free_form {
            let line = source.line_number(*start);
            self.warnings.push(free_form_warning(line, keyword));
        }
    }
}

pub(super) const CORNER_FORM: &str = "a corner like 1/2/3";

pub(super) fn invalid_smoothing_warning(line: usize, found: &[u8]) -> String {
    format!("line {line}: {}; ignored", expected_message("a smoothing group or `off`", found))
}

pub(super) fn attribute_not_in_file_warning(line: usize, attribute: &str) -> String {
    format!("line {line}: faces reference {attribute}, but the file has none; the references are ignored")
}

pub(super) fn excess_vertex_words_warning(line: usize) -> String {
    format!("line {line}: ignored extra words after a vertex's coordinates and color")
}

pub(super) fn free_form_warning(line: usize, keyword: &str) -> String {
    format!("line {line}: free-form curves and surfaces (`{keyword}`) are not supported and are skipped")
}

/// Line numbers of faces, given their indices in ascending order. Reads the file once.
pub(super) fn line_numbers_of_faces(source: &MeshFileBytes<'_>, faces: &[usize]) -> Vec<usize> {
    let mut starts = face_byte_offsets(source);
    let (mut passed, mut at, mut line) = (0, 0, 1);
    let mut line_of = |face: usize| {
        let start = starts.nth(face - passed).unwrap_or(source.bytes.len());
        line += memchr::memchr_iter(b'\n', &source.bytes[at..start]).count();
        (passed, at) = (face + 1, start);
        line
    };
    faces.iter().map(|face| line_of(*face)).collect()
}

/// Byte offset of a face.
pub(super) fn byte_offset_of_face(source: &MeshFileBytes<'_>, face: usize) -> usize {
    face_byte_offsets(source).nth(face).unwrap_or(0)
}

/// Byte offsets of all faces.
fn face_byte_offsets<'a>(source: &MeshFileBytes<'a>) -> impl Iterator<Item = usize> + use<'a> {
    let mut words = ObjTextCursor::new(source.bytes);
    std::iter::from_fn(move || {
        while words.move_to_next_statement() {
            let start = words.offset();
            let is_face = words.next_word().is_some_and(|word| word.eq_ignore_ascii_case(b"f"));
            while is_face && words.next_word().is_some() {}
            words.take_raw_line_rest();
            if is_face {
                return Some(start);
            }
        }
        None
    })
}

/// Parses `min` to `max` numbers in a statement. Missing numbers are 0.
fn parse_min_to_max_numbers(
    words: &mut ObjTextCursor<'_>,
    min: usize,
    max: usize,
    what: &str,
) -> Result<[f64; 3], String> {
    let mut values = [0.0; 3];
    let mut count = 0;
    while let Some(word) = words.next_word().filter(|_| count < max) {
        let value = parse_number(word).ok_or_else(|| expected_message(&format!("{max} {what}"), word))?;
        values[count] = value;
        count += 1;
    }
    if count < min { Err(too_few_numbers_message(max, what, count)) } else { Ok(values) }
}

/// Parses a corner such as `1`, `1/2`, `1//3` or `1/2/3`, ignoring trailing slashes.
fn parse_corner(word: &[u8], counts: [usize; 3]) -> Result<CornerIndices, String> {
    let wrong = || expected_message(CORNER_FORM, word);
    let end = word.iter().rposition(|byte| *byte != b'/').map_or(0, |last| last + 1);
    let mut corner = [NONE; 3];
    for (part, digits) in word[..end].split(|byte| *byte == b'/').enumerate() {
        if digits.is_empty() && part > 0 {
            continue;
        }
        let index = parse_integer(digits).filter(|_| part < 3).ok_or_else(wrong)?;
        corner[part] = absolute_index(index, counts[part])
            .ok_or_else(|| out_of_range_message(part, index, counts[part]))?;
    }
    Ok(corner)
}

/// Converts a one-based index, or a negative index relative to the end, to a zero-based index.
fn absolute_index(index: i64, count: usize) -> Option<u32> {
    let from_zero = if index < 0 { count as i64 + index } else { index - 1 };
    u32::try_from(from_zero).ok().filter(|index| *index != NONE)
}

pub(super) fn out_of_range_message(attribute: usize, index: i64, count: usize) -> String {
    let what = ["vertex", "texture coordinate", "normal"][attribute];
    match count {
        0 => format!("{what} {index} is out of range: none are defined before this line"),
        _ => format!("{what} {index} is out of range: there are {count}, numbered from 1"),
    }
}
