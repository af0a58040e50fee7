//! Whose file it is that a write would replace.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use super::PROGRAM;
use super::place::{self, Place, Target};

/// Of the chunks before a picture's pixels; those of glimt take some hundred.
const HEADER_BYTES: usize = 1 << 20;
/// Of the start of a report.
const START_BYTES: u64 = 64;

/// What a write would replace.
#[derive(Debug)]
pub enum Replaced {
    /// Nothing, or what may be replaced.
    Own,
    /// What somebody else may want to keep.
    Foreign,
    /// A file that cannot be read.
    Unreadable(io::Error),
}

impl Replaced {
    fn of(file: Option<io::Result<File>>, is_own: impl Fn(File) -> bool) -> Self {
        match file {
            None => Self::Own,
            Some(Ok(file)) => {
                if is_own(file) {
                    Self::Own
                } else {
                    Self::Foreign
                }
            }
            Some(Err(error)) => Self::Unreadable(error),
        }
    }
}

/// A PNG picture is glimt's own where its text chunk says so.
pub fn replaced_picture(path: &Path) -> Replaced {
    Replaced::of(replaced(path), is_own_picture)
}

/// A report may replace an earlier report, an empty file, any file that ends in `.json`.
pub fn replaced_report(path: &Path) -> Replaced {
    if has_ending(path, "json") { Replaced::Own } else { Replaced::of(replaced(path), is_own_report) }
}

/// Whether a file is there that a report must not replace. So is one that cannot be read.
pub fn holds_foreign_report(path: &Path) -> bool {
    !matches!(replaced_report(path), Replaced::Own)
}

/// Whether a file is there that would be replaced and is no table: neither empty, nor with this first line, nor one that
/// ends in `.csv`.
pub fn holds_foreign_table(path: &Path, first_line: &str) -> bool {
    let is_own = |file: File| {
        let mut start = Vec::new();
        let is_read = file.take(first_line.len() as u64).read_to_end(&mut start).is_ok();
        is_read && (start.is_empty() || start == first_line.as_bytes())
    };
    !has_ending(path, "csv") && !matches!(Replaced::of(replaced(path), is_own), Replaced::Own)
}

fn has_ending(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(wanted))
}

/// The regular file that a write would replace, open if it can be read.
fn replaced(path: &Path) -> Option<io::Result<File>> {
    match place::find(path) {
        Ok(Place::File(Target { path, existing: Some(_) })) => Some(File::open(path)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_read_is_not_called_somebody_else_s() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        assert!(matches!(replaced_picture(&path), Replaced::Own), "there is none");
        std::fs::write(&path, "a picture").expect("written");
        assert!(matches!(replaced_picture(&path), Replaced::Foreign));
        let denied = || Some(Err(io::Error::from(io::ErrorKind::PermissionDenied)));
        let replaced = Replaced::of(denied(), |_| true);
        assert!(
            matches!(replaced, Replaced::Unreadable(why) if why.kind() == io::ErrorKind::PermissionDenied)
        );
    }
}
