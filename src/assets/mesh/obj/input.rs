//! The text of an OBJ as `tobj` may read it.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::BTreeSet;
use std::io::{self, BufRead, Read};

use super::super::Source;

/// The text as `tobj` may read it, and what it does not tell.
pub(super) struct Survey<'a> {
    pub(super) text: Cow<'a, [u8]>,
    pub(super) used_materials: BTreeSet<String>,
}

impl<'a> Survey<'a> {
    /// Lines that `tobj` mistakes for faces (`l`, `p`) are blanked, lines that go on behind a backslash joined,
    /// bytes beyond UTF-8 replaced.
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        let mut text = Cow::Borrowed(bytes);
        let mut used_materials = BTreeSet::new();
        let mut start = 0;
        for end in memchr::memchr_iter(b'\n', bytes).chain([bytes.len()]) {
            let line = bytes[start..end].trim_ascii();
            match line {
                [b'l' | b'p', b' ' | b'\t', ..] => text.to_mut()[start..end].fill(b' '),
                [b'u', b's', b'e', b'm', b't', b'l', b' ', name @ ..] => {
                    used_materials.insert(String::from_utf8_lossy(name).trim().to_owned());
                }
                [.., b'\\'] => {
                    let slash = bytes[start..end].trim_ascii_end().len() + start - 1;
                    text.to_mut()[slash..(end + 1).min(bytes.len())].fill(b' ');
                }
                _ => {}
            }
            start = (end + 1).min(bytes.len());
        }
        if !text.is_ascii() && std::str::from_utf8(&text).is_err() {
            text = Cow::Owned(String::from_utf8_lossy(&text).into_owned().into_bytes());
        }
        Self { text, used_materials }
    }
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
