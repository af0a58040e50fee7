//! Whose file it is that a write would replace.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::PROGRAM;
use super::place::{self, Place, Target};

/// Of the chunks before a picture's pixels; those of glimt take some hundred.
const HEADER_BYTES: usize = 1 << 20;
/// Of the start of a report.
const START_BYTES: u64 = 64;

/// Whether a file is there that would be replaced and is no PNG picture that glimt wrote, as its text chunk says. So is
/// one that cannot be read.
pub fn holds_foreign_picture(path: &Path) -> bool {
    replaced(path).is_some_and(|file| !file.is_some_and(is_own_picture))
}

/// Whether a file is there that would be replaced and is nothing that a report may replace: an earlier report, an empty
/// file, any file that ends in `.json`.
pub fn holds_foreign_report(path: &Path) -> bool {
    !has_ending(path, "json") && replaced(path).is_some_and(|file| !file.is_some_and(is_own_report))
}

/// Whether a file is there that would be replaced and is no table: neither empty, nor with this first line, nor one that
/// ends in `.csv`.
pub fn holds_foreign_table(path: &Path, first_line: &str) -> bool {
    let is_own = |file: File| {
        let mut start = Vec::new();
        let is_read = file.take(first_line.len() as u64).read_to_end(&mut start).is_ok();
        is_read && (start.is_empty() || start == first_line.as_bytes())
    };
    !has_ending(path, "csv") && replaced(path).is_some_and(|file| !file.is_some_and(is_own))
}

fn has_ending(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(wanted))
}

/// The regular file that a write would replace, open if it can be read.
fn replaced(path: &Path) -> Option<Option<File>> {
    match place::find(path) {
        Ok(Place::File(Target { path, existing: Some(_) })) => Some(File::open(path).ok()),
        // Nothing is replaced there; what cannot be written is said by whoever writes.
        Ok(Place::File(Target { existing: None, .. }) | Place::InPlace(_)) | Err(_) => None,
    }
}

fn is_own_picture(file: File) -> bool {
    let limits = png::Limits { bytes: HEADER_BYTES };
    let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), limits);
    decoder.set_ignore_iccp_chunk(true);
    let Ok(reader) = decoder.read_info() else { return false };
    let texts = &reader.info().uncompressed_latin1_text;
    texts.iter().any(|text| text.keyword == "Software" && is_program(&text.text))
}

/// `glimt 0.1.0`
fn is_program(software: &str) -> bool {
    software.split_once(' ').is_some_and(|(name, _)| name == PROGRAM)
}

fn is_own_report(file: File) -> bool {
    let mut start = Vec::new();
    if file.take(START_BYTES).read_to_end(&mut start).is_err() {
        return false;
    }
    let key = start.trim_ascii_start().strip_prefix(b"{").map(<[u8]>::trim_ascii_start);
    start.is_empty() || key.is_some_and(|key| key.starts_with(b"\"glimt\""))
}
