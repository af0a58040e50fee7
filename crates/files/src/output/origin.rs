//! Whether glimt wrote the file that a write would replace: the content says so, whatever the name ends in.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use memchr::memmem;
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::place::{self, Place, Target};
use super::{PROGRAM, SOFTWARE};

/// Bytes of the chunks before a picture's pixels; those of glimt take some hundred.
const HEADER_BYTES: usize = 1 << 20;
/// Bytes of the largest plot that is looked into.
const PLOT_BYTES: u64 = 64 << 20;

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

    /// As [`Self::of`], for texts: an empty file may be replaced too.
    fn of_text(path: &Path, is_own: impl Fn(File) -> bool) -> Self {
        let is_empty = |file: &File| file.metadata().is_ok_and(|found| found.len() == 0);
        Self::of(replaced(path), |file| is_empty(&file) || is_own(file))
    }

    /// Why the file is not replaced; `None` if it may be.
    pub fn why_kept(&self) -> Option<String> {
        match self {
            Self::Own => None,
            Self::Foreign => Some("there is a file of this name that glimt did not write".to_owned()),
            Self::Unreadable(error) => {
                Some(format!("the file of this name cannot be read: {}", crate::system::in_words(error)))
            }
        }
    }
}

/// Whether a picture may be replaced: a PNG whose text chunk names glimt.
pub fn replaced_picture(path: &Path) -> Replaced {
    Replaced::of(replaced(path), is_own_picture)
}

/// Whether a file of JSON may be replaced: a report, the results of `bench`, an empty file.
pub fn replaced_json(path: &Path) -> Replaced {
    Replaced::of_text(path, is_own_json)
}

/// Whether a table may be replaced: one with this first line, or an empty file.
pub fn replaced_table(path: &Path, first_line: &str) -> Replaced {
    Replaced::of_text(path, |file| {
        let mut start = Vec::new();
        let is_read = file.take(first_line.len() as u64).read_to_end(&mut start).is_ok();
        is_read && start == first_line.as_bytes()
    })
}

/// Whether a plot may be replaced: one that is [`signed`], one of an older version, or an empty file.
pub fn replaced_plot(path: &Path) -> Replaced {
    Replaced::of_text(path, is_own_plot)
}

/// A plot that says which program drew it.
pub fn signed(svg: &str) -> String {
    match svg.split_once('>') {
        Some((start, rest)) => format!("{start}>\n<desc>{SOFTWARE}</desc>{rest}"),
        None => svg.to_owned(),
    }
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

/// What reports and results have in common, in every version.
#[derive(Deserialize)]
struct OwnJson {
    #[serde(rename = "glimt")]
    _version: String,
    #[serde(rename = "seconds")]
    _seconds: f64,
    #[serde(rename = "scene", alias = "scenes")]
    _scenes: IgnoredAny,
}

fn is_own_json(file: File) -> bool {
    let mut reader = BufReader::new(file);
    // Large files of somebody else are not read to their end for nothing.
    let is_object = reader.fill_buf().is_ok_and(|start| start.trim_ascii_start().starts_with(b"{"));
    is_object && serde_json::from_reader::<_, OwnJson>(reader).is_ok()
}

fn is_own_plot(file: File) -> bool {
    let mut text = Vec::new();
    if file.take(PLOT_BYTES).read_to_end(&mut text).is_err() || !text.starts_with(b"<svg ") {
        return false;
    }
    let has = |part: &str| memmem::find(&text, part.as_bytes()).is_some();
    // Older versions left the names of the axes alone.
    has(&format!("<desc>{PROGRAM} ")) || (has("\nseconds of rendering\n") && has("\nrelMSE\n"))
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

    #[test]
    fn a_file_that_cannot_be_read_is_said_with_the_system_s_reason() {
        let why = |number| {
            Replaced::Unreadable(io::Error::from_raw_os_error(number)).why_kept().expect("it is kept")
        };
        assert_eq!(why(nix::libc::EACCES), "the file of this name cannot be read: permission denied");
        assert_eq!(why(nix::libc::EMFILE), "the file of this name cannot be read: too many open files");
        let foreign = Replaced::Foreign.why_kept();
        assert_eq!(foreign.as_deref(), Some("there is a file of this name that glimt did not write"));
        assert_eq!(Replaced::Own.why_kept(), None);
    }
}
