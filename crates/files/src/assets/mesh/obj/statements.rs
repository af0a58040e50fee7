//! The statements of an OBJ, in the numbers of the file.

use super::super::text::shown;
use super::super::{AssetError, Source};
use super::vertex::Vertices;
use super::words::{Words, number, whole};
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Statements between two polls of the token.
const BATCH: u64 = 1 << 13;

/// Index of a part that a corner does not have.
pub(super) const NONE: u32 = u32::MAX;

/// Position, texture coordinates and normal of a corner, counted from 0.
pub(super) type Corner = [u32; 3];

/// Smoothing of faces without normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Smoothing {
    /// No statement precedes the face.
    Unsaid,
    /// `s off` or `s 0`.
    Flat,
    /// `s` with a number above 0.
    Group(u32),
}

/// A statement between faces.
pub(super) enum Change {
    /// `o` or `g`.
    Object,
    Library(String),
    Material(String),
    Smoothing(Smoothing),
}

/// Letters of the longest keyword that is read.
const LONGEST: usize = 6;

/// A keyword in lower case. A longer word than any keyword is returned as it is.
fn lower_case<'a>(word: &'a [u8], lower: &'a mut [u8; LONGEST]) -> &'a [u8] {
    let Some(lower) = lower.get_mut(..word.len()) else { return word };
    lower.copy_from_slice(word);
    lower.make_ascii_lowercase();
    lower
}

/// Everything in the file that is used.
#[derive(Default)]
pub(super) struct Statements {
    pub(super) vertices: Vertices,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    /// Corners of all faces, face by face.
    pub(super) corners: Vec<Corner>,
    /// Number of corners of each face.
    pub(super) arities: Vec<u32>,
    /// Changes, each with the number of faces before it.
    pub(super) changes: Vec<(usize, Change)>,
    pub(super) warnings: Vec<String>,
    /// Offset and keyword of the first free-form curve or surface.
    free_form: Option<(usize, String)>,
}

impl Statements {
    pub(super) fn read(source: &Source<'_>) -> Result<Self, AssetError> {
        let mut found = Self::default();
        let mut words = Words::new(source.bytes);
        let mut count = 0;
        while words.next_statement() {
            if count % BATCH == 0 {
                source.tick(words.at())?;
            }
            count += 1;
            let start = words.at();
            found.statement(source, &mut words).map_err(|reason| source.wrong_at(start, reason))?;
            words.line();
        }
        found.drop_absent_parts(source);
        found.check_ranges(source)?;
        found.warn(source);
        Ok(found)
    }

    fn statement(&mut self, source: &Source<'_>, words: &mut Words<'_>) -> Result<(), String> {
        let start = words.at();
        let Some(keyword) = words.word() else {
            if let Some(paint) = words.line().strip_prefix(b"#MRGB ") {
                self.vertices.read_paint(paint);
            }
            return Ok(());
        };
        let mut lower = [0; LONGEST];
        match lower_case(keyword, &mut lower) {
            b"v" => self.vertices.read(words)?,
            b"vt" => {
                let [u, v, _] = numbers(words, 1, 2, "texture coordinates")?;
                self.uvs.push(DVec2::new(u, v).as_vec2());
            }
            b"vn" => self.normals.push(DVec3::from(numbers(words, 3, 3, "normal coordinates")?).as_vec3()),
            b"f" => self.face(words)?,
            b"o" | b"g" => self.change(Change::Object),
            b"s" => self.smoothing(source, words, start),
            b"mtllib" => {
                let name = words.name();
                self.change(Change::Library(name));
            }
            b"usemtl" => {
                let name = words.name();
                self.change(Change::Material(name));
            }
            b"surf" | b"curv" | b"curv2" => {
                self.free_form.get_or_insert((start, String::from_utf8_lossy(keyword).into_owned()));
            }
            _ => {}
        }
        Ok(())
    }

    fn change(&mut self, change: Change) {
        self.changes.push((self.arities.len(), change));
    }

    /// Reads a smoothing group. A word that is neither a number nor `on` or `off` leaves the group as it is.
    fn smoothing(&mut self, source: &Source<'_>, words: &mut Words<'_>, start: usize) {
        let group = words.word().unwrap_or(b"off");
        let smoothing = match whole(group).map(u32::try_from) {
            Some(Ok(0)) => Smoothing::Flat,
            Some(Ok(number)) => Smoothing::Group(number),
            None if group.eq_ignore_ascii_case(b"off") => Smoothing::Flat,
            None if group.eq_ignore_ascii_case(b"on") => Smoothing::Group(1),
            Some(Err(_)) | None => {
                let (line, group) = (source.line(start), shown(group));
                let warning =
                    format!("line {line}: expected a smoothing group or `off`, found {group}: ignored");
                self.warnings.push(warning);
                return;
            }
        };
        self.change(Change::Smoothing(smoothing));
    }

    fn face(&mut self, words: &mut Words<'_>) -> Result<(), String> {
        let counts = [self.vertices.positions.len(), self.uvs.len(), self.normals.len()];
        let before = self.corners.len();
        while let Some(word) = words.word() {
            self.corners.push(corner(word, counts)?);
        }
        self.arities.push((self.corners.len() - before) as u32);
        Ok(())
    }

    /// Drops the texture coordinates or normals of corners where the file has none at all, and warns of it.
    fn drop_absent_parts(&mut self, source: &Source<'_>) {
        for (part, count, what) in
            [(1, self.uvs.len(), "texture coordinates"), (2, self.normals.len(), "normals")]
        {
            let Some(first) = self.corners.iter().position(|corner| corner[part] != NONE) else { continue };
            if count == 0 {
                let line = source.line(face_start(source, self.face_of(first)));
                self.warnings.push(format!("line {line}: faces name {what}, but the file has none: ignored"));
                self.corners.iter_mut().for_each(|corner| corner[part] = NONE);
            }
        }
    }

    /// The face of a corner, both counted from 0.
    fn face_of(&self, corner: usize) -> usize {
        let mut end = 0;
        let is_before = |arity: &&u32| {
            end += **arity as usize;
            end <= corner
        };
        self.arities.iter().take_while(is_before).count()
    }

    /// Checks the corners' indices. A face may precede the vertices that it names, so this happens at the end.
    fn check_ranges(&self, source: &Source<'_>) -> Result<(), AssetError> {
        let counts = [self.vertices.positions.len(), self.uvs.len(), self.normals.len()];
        let wrong = |corner: &Corner| {
            (0..3).find(|part| corner[*part] as usize >= counts[*part] && corner[*part] != NONE)
        };
        let Some((place, part)) =
            self.corners.iter().enumerate().find_map(|(place, corner)| Some((place, wrong(corner)?)))
        else {
            return Ok(());
        };
        let index = i64::from(self.corners[place][part]) + 1;
        Err(source.wrong_at(face_start(source, self.face_of(place)), out_of_range(part, index, counts[part])))
    }

    fn warn(&mut self, source: &Source<'_>) {
        if let Some(start) = self.vertices.first_excess {
            let line = source.line(start);
            self.warnings
                .push(format!("line {line}: a vertex has more than coordinates and a color: ignored"));
        }
        if let Some(start) = self.vertices.translucent() {
            let line = source.line(start);
            self.warnings.push(format!("line {line}: the alpha of the vertex colors is ignored"));
        }
        if let Some((start, keyword)) = &self.free_form {
            let line = source.line(*start);
            self.warnings
                .push(format!("line {line}: free-form curves and surfaces (`{keyword}`) are left out"));
        }
    }
}

/// Offset of a face, counted from 0.
pub(super) fn face_start(source: &Source<'_>, face: usize) -> usize {
    let mut words = Words::new(source.bytes);
    let mut faces = 0;
    while words.next_statement() {
        let start = words.at();
        if words.word().is_some_and(|word| word.eq_ignore_ascii_case(b"f")) {
            if faces == face {
                return start;
            }
            faces += 1;
            while words.word().is_some() {}
        }
        words.line();
    }
    0
}

/// Reads at least `least` and at most `most` of a statement's numbers; the others are 0.
fn numbers(words: &mut Words<'_>, least: usize, most: usize, what: &str) -> Result<[f64; 3], String> {
    let mut values = [0.0; 3];
    let mut count = 0;
    while let Some(word) = words.word().filter(|_| count < most) {
        let value = number(word).ok_or_else(|| format!("expected {most} {what}, found {}", shown(word)))?;
        values[count] = value;
        count += 1;
    }
    if count < least { Err(format!("expected {most} {what}, found {count}")) } else { Ok(values) }
}

/// Reads a corner such as `1`, `1/2`, `1//3` or `1/2/3`; slashes at its end are ignored.
fn corner(word: &[u8], counts: [usize; 3]) -> Result<Corner, String> {
    let wrong = || format!("expected a corner like 1/2/3, found {}", shown(word));
    let end = word.iter().rposition(|byte| *byte != b'/').map_or(0, |last| last + 1);
    let mut corner = [NONE; 3];
    for (part, digits) in word[..end].split(|byte| *byte == b'/').enumerate() {
        if digits.is_empty() && part > 0 {
            continue;
        }
        let index = whole(digits).filter(|_| part < 3).ok_or_else(wrong)?;
        corner[part] =
            absolute(index, counts[part]).ok_or_else(|| out_of_range(part, index, counts[part]))?;
    }
    Ok(corner)
}

/// The index counted from 0 of one that counts from 1, or back from the last if it is negative.
fn absolute(index: i64, count: usize) -> Option<u32> {
    let from_zero = if index < 0 { count as i64 + index } else { index - 1 };
    u32::try_from(from_zero).ok().filter(|index| *index != NONE)
}

fn out_of_range(part: usize, index: i64, count: usize) -> String {
    let what = ["vertex", "texture coordinate", "normal"][part];
    format!("{what} {index} is out of range: there are {count}, from 1")
}
