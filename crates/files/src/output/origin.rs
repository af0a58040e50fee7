//! Whether glimt wrote the file that a write would replace: its content decides, whatever its ending. A kind of file
//! replaces its own kind alone.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use memchr::memmem;
use serde::de::DeserializeOwned;

use super::place::{self, Place, Target};
use super::{PROGRAM, SOFTWARE};

/// Bytes of the chunks before a picture's pixels; those of glimt take some hundred.
const HEADER_BYTES: usize = 1 << 20;
/// Largest plot that is examined, in bytes.
const PLOT_BYTES: u64 = 64 << 20;

/// File that a write would replace.
#[derive(Debug)]
pub enum Replaced {
    /// No file, or one that may be replaced.
    Own,
    /// A file that somebody else may want to keep, and the kind that glimt would write there: "a report".
    Foreign(&'static str),
    /// A file that cannot be read.
    Unreadable(io::Error),
}

impl Replaced {
    fn of(file: Option<io::Result<File>>, kind: &'static str, is_own: impl Fn(File) -> bool) -> Self {
        match file {
            None => Self::Own,
            Some(Ok(file)) => {
                if is_own(file) {
                    Self::Own
                } else {
                    Self::Foreign(kind)
                }
            }
            Some(Err(error)) => Self::Unreadable(error),
        }
    }

    /// [`Self::of`] for texts: an empty file may be replaced too.
    fn of_text(path: &Path, kind: &'static str, is_own: impl Fn(File) -> bool) -> Self {
        let is_empty = |file: &File| file.metadata().is_ok_and(|found| found.len() == 0);
        Self::of(replaced(path), kind, |file| is_empty(&file) || is_own(file))
    }

    /// Why the file is not replaced; `None` if it may be.
    pub fn why_kept(&self) -> Option<String> {
        match self {
            Self::Own => None,
            Self::Foreign(kind) => Some(format!("the file of this name is not {kind} that glimt wrote")),
            Self::Unreadable(error) => Some(format!(
                "the file of this name cannot be read: {}",
                crate::system::describe_error(error)
            )),
        }
    }
}

/// Whether a picture may be replaced: a PNG whose text chunk names glimt.
pub fn replaced_picture(path: &Path) -> Replaced {
    Replaced::of(replaced(path), "a picture", is_own_picture)
}

/// The scene that a PNG of glimt names. `None` for a file that does not exist and for a picture that names none.
pub fn scene_of_picture(path: &Path) -> Option<String> {
    const KEY: &str = "glimt:scene";
    let reader = png_header(replaced(path)?.ok()?)?;
    let info = reader.info();
    let latin = info.uncompressed_latin1_text.iter().find(|text| text.keyword == KEY);
    let utf8 = || info.utf8_text.iter().find(|text| text.keyword == KEY)?.get_text().ok();
    latin.map(|text| text.text.clone()).or_else(utf8)
}

/// Whether a file of JSON may be replaced: one that is `T` as a whole and passes the test, or an empty file.
pub fn replaced_json<T: DeserializeOwned>(
    path: &Path,
    kind: &'static str,
    is_own: impl Fn(&T) -> bool,
) -> Replaced {
    Replaced::of_text(path, kind, |file| {
        let mut reader = BufReader::new(file);
        // Do not read large files of others to their end for nothing.
        let is_object = reader.fill_buf().is_ok_and(|start| start.trim_ascii_start().starts_with(b"{"));
        is_object && serde_json::from_reader(reader).is_ok_and(|value| is_own(&value))
    })
}

/// Whether a table may be replaced: one with this first line, given with its end, or an empty file.
pub fn replaced_table(path: &Path, first_line: &str) -> Replaced {
    Replaced::of_text(path, "a table", |file| {
        let mut start = Vec::new();
        let is_read = file.take(first_line.len() as u64).read_to_end(&mut start).is_ok();
        is_read && start == first_line.as_bytes()
    })
}

/// Whether a plot may be replaced: one with these texts that is [`signed`] or of a version that did not sign, or an empty
/// file.
pub fn replaced_plot(path: &Path, texts: &[&str]) -> Replaced {
    Replaced::of_text(path, "a plot", |file| is_own_plot(file, texts))
}

/// The signature's start, which follows an SVG's first tag.
const SIGNATURE: &str = "\n<desc>";

/// A plot that says which program drew it.
pub fn signed(svg: &str) -> String {
    match svg.split_once('>') {
        Some((start, rest)) => format!("{start}>{SIGNATURE}{SOFTWARE}</desc>{rest}"),
        None => svg.to_owned(),
    }
}

/// The regular file that a write would replace, open if it can be read.
fn replaced(path: &Path) -> Option<io::Result<File>> {
    match place::find(path) {
        Ok(Place::File(Target { path, existing: Some(_) })) => Some(File::open(path)),
        // Nothing is replaced there; whoever writes reports what cannot be written.
        Ok(Place::File(Target { existing: None, .. }) | Place::InPlace(_)) | Err(_) => None,
    }
}

/// A PNG up to its first pixel.
fn png_header(file: File) -> Option<png::Reader<BufReader<File>>> {
    let limits = png::Limits { bytes: HEADER_BYTES };
    let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), limits);
    decoder.set_ignore_iccp_chunk(true);
    decoder.read_info().ok()
}

fn is_own_picture(file: File) -> bool {
    let Some(reader) = png_header(file) else { return false };
    let texts = &reader.info().uncompressed_latin1_text;
    texts.iter().any(|text| text.keyword == "Software" && is_program(&text.text))
}

/// `glimt 0.1.0`
fn is_program(software: &str) -> bool {
    software.split_once(' ').is_some_and(|(name, _)| name == PROGRAM)
}

fn is_own_plot(file: File, texts: &[&str]) -> bool {
    let mut svg = Vec::new();
    if file.take(PLOT_BYTES).read_to_end(&mut svg).is_err() || !svg.starts_with(b"<svg ") {
        return false;
    }
    let has = |part: &str| memmem::find(&svg, part.as_bytes()).is_some();
    let signature = format!(">{SIGNATURE}{PROGRAM} ");
    let is_signed = memmem::find(&svg, b">").is_some_and(|end| svg[end..].starts_with(signature.as_bytes()));
    (is_signed || !has("<desc>")) && texts.iter().all(|text| has(&format!("\n{text}\n")))
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
        assert!(matches!(replaced_picture(&path), Replaced::Foreign("a picture")));
        let denied = || Some(Err(io::Error::from(io::ErrorKind::PermissionDenied)));
        let replaced = Replaced::of(denied(), "a picture", |_| true);
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
        let foreign = Replaced::Foreign("a report").why_kept();
        assert_eq!(foreign.as_deref(), Some("the file of this name is not a report that glimt wrote"));
        assert_eq!(Replaced::Own.why_kept(), None);
    }
}
