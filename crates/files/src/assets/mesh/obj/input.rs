//! The text of an OBJ as `tobj` may read it.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::io::{self, BufRead, Read};
use std::ops::Range;

use super::super::Source;
use crate::control::{CancelToken, Cancelled};

/// The text in a form that `tobj` reads, and facts that `tobj` does not report.
pub(super) struct Survey<'a> {
    pub(super) text: Cow<'a, [u8]>,
    pub(super) used_materials: BTreeSet<String>,
    /// Number of vertices, and the places of the colours among them.
    vertices: usize,
    colors: Vec<Range<usize>>,
}

impl<'a> Survey<'a> {
    /// Prepares the text of an OBJ. It blanks comments behind numbers, colours unless all vertices have one, and lines that `tobj`
    /// mistakes for faces (`l`, `p`). It joins lines that continue behind a backslash, moves keywords before names to
    /// the start of their line, replaces bytes beyond UTF-8, drops slashes that end corners, and adds a second texture coordinate of 0
    /// to single ones and a name to `usemtl` without one.
    ///
    /// # Errors
    /// [`Cancelled`] if the token is cancelled.
    pub(super) fn of(bytes: &'a [u8], token: &CancelToken) -> Result<Self, Cancelled> {
        let mut survey = Self {
            text: Cow::Borrowed(bytes),
            used_materials: BTreeSet::new(),
            vertices: 0,
            colors: Vec::new(),
        };
        let mut unfinished = None;
        let mut inserted = Vec::new();
        let mut start = 0;
        for end in memchr::memchr_iter(b'\n', bytes).chain([bytes.len()]) {
            token.check()?;
            let line = &bytes[start..end];
            let (statement, words) =
                unfinished.take().unwrap_or_else(|| (Statement::of(line.trim_ascii_start()), 0));
            let Line { goes_on, content } = survey.line(start, line, statement);
            if statement == Statement::Face {
                open_slashes(content).for_each(|place| survey.blank(start + place.start..start + place.end));
            }
            if statement == Statement::Named
                && let Some(place) = unnamed_material(line)
            {
                inserted.push((start + place, NO_MATERIAL));
            }
            if statement == Statement::Texture {
                let words = words + words_of(content).take(LONE_TEXTURE_WORDS + 1).count();
                if !goes_on && words == LONE_TEXTURE_WORDS {
                    inserted.push((start + content.len(), SECOND));
                }
                unfinished = goes_on.then_some((statement, words));
            } else {
                unfinished = goes_on.then_some((statement, 0));
            }
            start = (end + 1).min(bytes.len());
        }
        if survey.colors.len() < survey.vertices {
            std::mem::take(&mut survey.colors).into_iter().for_each(|place| survey.blank(place));
        }
        survey.insert(&inserted);
        if !survey.text.is_ascii() && std::str::from_utf8(&survey.text).is_err() {
            survey.text = Cow::Owned(String::from_utf8_lossy(&survey.text).into_owned().into_bytes());
        }
        Ok(survey)
    }

    /// Adds words at places in rising order.
    fn insert(&mut self, words: &[(usize, &[u8])]) {
        if words.is_empty() {
            return;
        }
        let more: usize = words.iter().map(|(_, word)| word.len()).sum();
        let mut text = Vec::with_capacity(self.text.len() + more);
        let mut start = 0;
        for &(place, word) in words {
            text.extend_from_slice(&self.text[start..place]);
            text.extend_from_slice(word);
            start = place;
        }
        text.extend_from_slice(&self.text[start..]);
        self.text = Cow::Owned(text);
    }

    /// Reads a line of this statement at this byte.
    fn line<'l>(&mut self, start: usize, line: &'l [u8], statement: Statement) -> Line<'l> {
        let content = match statement {
            Statement::Comment => return Line { goes_on: false, content: line },
            Statement::Named => {
                self.named(start, line);
                line
            }
            Statement::Vertex
            | Statement::Texture
            | Statement::Face
            | Statement::Numbers
            | Statement::Skipped => {
                let content = &line[..memchr::memchr(b'#', line).unwrap_or(line.len())];
                self.blank(start + content.len()..start + line.len());
                content
            }
            Statement::Other => line,
        };
        match statement {
            Statement::Skipped => self.blank(start..start + line.len()),
            Statement::Vertex => {
                self.vertices += 1;
                let colours = colours(content).map(|place| start + place..start + content.len());
                self.colors.extend(colours);
            }
            Statement::Comment
            | Statement::Named
            | Statement::Texture
            | Statement::Face
            | Statement::Numbers
            | Statement::Other => {}
        }
        let content = content.trim_ascii_end();
        let Some(unfinished) = content.strip_suffix(b"\\") else { return Line { goes_on: false, content } };
        self.blank(start + unfinished.len()..start + content.len());
        self.blank(start + line.len()..(start + line.len() + 1).min(self.text.len()));
        Line { goes_on: true, content: unfinished }
    }

    /// Moves the keyword: `tobj` takes everything behind the first space of the line for the name.
    fn named(&mut self, start: usize, line: &[u8]) {
        let statement = line.trim_ascii();
        let keyword = statement.iter().position(u8::is_ascii_whitespace).unwrap_or(statement.len());
        if statement.starts_with(b"usemtl") && keyword < statement.len() {
            self.used_materials.insert(String::from_utf8_lossy(&statement[keyword..]).trim().to_owned());
        }
        if line.len() > keyword && (!line.starts_with(statement) || line[keyword] != b' ') {
            let text = &mut self.text.to_mut()[start..start + line.len()];
            text.fill(b' ');
            text[..statement.len()].copy_from_slice(statement);
            text[keyword..].iter_mut().take(1).for_each(|blank| *blank = b' ');
        }
    }

    fn blank(&mut self, range: Range<usize>) {
        if !range.is_empty() {
            self.text.to_mut()[range].fill(b' ');
        }
    }
}

/// Part of a statement in one line.
struct Line<'l> {
    /// Whether the next line belongs to it.
    goes_on: bool,
    /// Text without comments and the mark of continuation.
    content: &'l [u8],
}

/// Words of a `vt` with one coordinate: v is then 0 (Wavefront, Object Files, 1995), which `tobj` does not know.
const LONE_TEXTURE_WORDS: usize = 2;

fn words_of(content: &[u8]) -> impl Iterator<Item = &[u8]> {
    content.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Kind of a line, as far as kinds are read differently.
#[derive(Clone, Copy, PartialEq)]
enum Statement {
    Comment,
    Vertex,
    /// Texture coordinates.
    Texture,
    Face,
    /// Other numbers, up to a comment.
    Numbers,
    /// Points and lines.
    Skipped,
    /// A keyword and a name, in which `#` may occur.
    Named,
    Other,
}

impl Statement {
    fn of(line: &[u8]) -> Self {
        let keyword = line.iter().position(u8::is_ascii_whitespace).map_or(line, |end| &line[..end]);
        match keyword {
            b"v" => Self::Vertex,
            b"vt" => Self::Texture,
            b"f" => Self::Face,
            b"vn" => Self::Numbers,
            b"l" | b"p" => Self::Skipped,
            b"usemtl" | b"mtllib" => Self::Named,
            [b'#', ..] => Self::Comment,
            _ => Self::Other,
        }
    }
}

/// The second coordinate of a `vt` with one.
const SECOND: &[u8] = b" 0";
/// The name that stands for none: a control character, which no program writes.
const NO_MATERIAL: &[u8] = b" \x01";

/// Place of the name that a `usemtl` lacks, once the keyword begins its line. `None` for other lines.
fn unnamed_material(line: &[u8]) -> Option<usize> {
    let keyword = line.trim_ascii();
    (keyword == b"usemtl").then_some(keyword.len())
}

/// Places of the slashes that end a corner, behind which programs leave out numbers: `1//` and `2/2/`. `tobj` would take the
/// corner for one without any slash.
fn open_slashes(content: &[u8]) -> impl Iterator<Item = Range<usize>> {
    let ends_word = |slash: &usize| content.get(slash + 1).is_none_or(u8::is_ascii_whitespace);
    memchr::memchr_iter(b'/', content).filter(ends_word).filter_map(|last| {
        let before = &content[..=last];
        let start = before.iter().rposition(u8::is_ascii_whitespace).map_or(0, |blank| blank + 1);
        let word = &before[start..];
        let number = word.iter().rposition(|byte| *byte != b'/')?;
        Some(start + number + 1..last + 1)
    })
}

/// Place of the three colours of a vertex; `tobj` requires them of all vertices or of none.
fn colours(line: &[u8]) -> Option<usize> {
    let mut ends = line.windows(2).enumerate().filter_map(|(at, pair)| {
        (!pair[0].is_ascii_whitespace() && pair[1].is_ascii_whitespace()).then_some(at + 1)
    });
    // The colours follow the keyword and three coordinates.
    let colours = ends.nth(3)?;
    let number =
        |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<f32>().ok().filter(|part| part.is_finite());
    let words = || words_of(&line[colours..]);
    (words().count() == 3 && words().all(|word| number(word).is_some())).then_some(colours)
}

/// Bytes that `tobj` gets at a time, between two polls of the token.
const CHUNK: usize = 1 << 18;

/// A reader that reports and can be stopped.
pub(super) struct Chunks<'a> {
    source: &'a Source<'a>,
    text: &'a [u8],
    at: usize,
    stopped: Cell<bool>,
}

impl<'a> Chunks<'a> {
    pub(super) fn new(source: &'a Source<'a>, text: &'a [u8]) -> Self {
        Self { source, text, at: 0, stopped: Cell::new(false) }
    }
}

impl Read for Chunks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.fill_buf()?.read(buffer)?;
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Chunks<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let end = (self.at / CHUNK + 1) * CHUNK;
        if self.at.is_multiple_of(CHUNK) {
            let at = self.at.min(self.source.bytes.len());
            self.stopped.set(self.stopped.get() || self.source.tick(at).is_err());
        }
        if self.stopped.get() {
            return Err(io::Error::other("cancelled"));
        }
        Ok(&self.text[self.at..end.min(self.text.len())])
    }

    fn consume(&mut self, amount: usize) {
        self.at += amount;
    }
}
