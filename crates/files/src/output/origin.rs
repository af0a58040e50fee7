//! Detects from a file's content whether glimt wrote it. glimt replaces only its own files, and only with
//! files of the same type.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use memchr::memmem;
use serde::de::DeserializeOwned;

use super::resolve_path::{self, TargetFile, WriteTarget};
use super::{PROGRAM, SOFTWARE};

/// Maximum size of the PNG chunks before the pixels. glimt writes a few hundred bytes.
const HEADER_BYTES: usize = 1 << 20;
/// Maximum number of bytes to examine in a plot.
const PLOT_BYTES: u64 = 64 << 20;

/// Result of checking the file that would be replaced.
#[derive(Debug)]
pub enum ReplaceCheckResult {
    /// No file, or a file that may be replaced.
    Own,
    /// A file not written by glimt. Contains the type of file that glimt would write, such as "a report".
    Foreign(&'static str),
    /// A file that cannot be read.
    Unreadable(io::Error),
}

impl ReplaceCheckResult {
    fn from_file(file: Option<io::Result<File>>, kind: &'static str, is_own: impl Fn(File) -> bool) -> Self {
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

    /// Like [`Self::from_file`], but for text files. Empty files may also be replaced.
    fn from_text_file(path: &Path, kind: &'static str, is_own: impl Fn(File) -> bool) -> Self {
        let is_empty = |file: &File| file.metadata().is_ok_and(|found| found.len() == 0);
        Self::from_file(open_existing(path), kind, |file| is_empty(&file) || is_own(file))
    }

    /// Returns the reason not to replace the file, or `None` if it may be replaced.
    pub fn reason_to_keep(&self) -> Option<String> {
        match self {
            Self::Own => None,
            Self::Foreign(kind) => Some(format!("the existing file is not {kind} that glimt wrote")),
            Self::Unreadable(error) => {
                Some(format!("the existing file cannot be read: {}", crate::system::describe_io_error(error)))
            }
        }
    }
}

/// Checks whether an image may be replaced. It must be a PNG with a text chunk that names glimt.
pub fn check_image_replacement(path: &Path) -> ReplaceCheckResult {
    ReplaceCheckResult::from_file(open_existing(path), "an image", is_glimt_png)
}

/// Returns the scene named in a PNG file's metadata, or `None` if there is no such file or scene name.
pub fn scene_name_in_png(path: &Path) -> Option<String> {
    const KEY: &str = "glimt:scene";
    let reader = open_png_reader(open_existing(path)?.ok()?)?;
    let info = reader.info();
    let latin = info.uncompressed_latin1_text.iter().find(|text| text.keyword == KEY);
    let utf8 = || info.utf8_text.iter().find(|text| text.keyword == KEY)?.get_text().ok();
    latin.map(|text| text.text.clone()).or_else(utf8)
}

/// Checks whether a JSON file may be replaced. It must be empty, or parse as a `T` that `is_own` accepts.
pub fn check_json_replacement<T: DeserializeOwned>(
    path: &Path,
    kind: &'static str,
    is_own: impl Fn(&T) -> bool,
) -> ReplaceCheckResult {
    ReplaceCheckResult::from_text_file(path, kind, |file| {
        let mut reader = BufReader::new(file);
        // Avoid reading a large file in another format completely.
        let is_object = reader.fill_buf().is_ok_and(|start| start.trim_ascii_start().starts_with(b"{"));
        is_object && serde_json::from_reader(reader).is_ok_and(|value| is_own(&value))
    })
}

/// Checks whether a table may be replaced. It must be empty, or start with `first_line`, including the line
/// end.
pub fn check_table_replacement(path: &Path, first_line: &str) -> ReplaceCheckResult {
    ReplaceCheckResult::from_text_file(path, "a table", |file| {
        let mut start = Vec::new();
        let is_read = file.take(first_line.len() as u64).read_to_end(&mut start).is_ok();
        is_read && start == first_line.as_bytes()
    })
}

/// Checks whether a plot may be replaced. It must be empty, or contain `texts` and the signature that
/// [`sign_plot`] adds. Plots from older versions, which have no signature, are also accepted.
pub fn check_plot_replacement(path: &Path, texts: &[&str]) -> ReplaceCheckResult {
    ReplaceCheckResult::from_text_file(path, "a plot", |file| is_glimt_plot(file, texts))
}

/// Start of the signature, which follows the first tag in an SVG file.
const SIGNATURE: &str = "\n<desc>";

/// Adds a signature with the program's name to a plot.
pub fn sign_plot(svg: &str) -> String {
    match svg.split_once('>') {
        Some((start, rest)) => format!("{start}>{SIGNATURE}{SOFTWARE}</desc>{rest}"),
        None => svg.to_owned(),
    }
}

/// Opens the regular file that would be replaced, if it exists.
fn open_existing(path: &Path) -> Option<io::Result<File>> {
    match resolve_path::resolve_writable(path) {
        Ok(WriteTarget::File(TargetFile { path, existing: Some(_) })) => Some(File::open(path)),
        // Nothing would be replaced. Errors are reported when the file is written.
        Ok(WriteTarget::File(TargetFile { existing: None, .. }) | WriteTarget::InPlace(_)) | Err(_) => None,
    }
}

/// Reads a PNG up to its first pixel.
fn open_png_reader(file: File) -> Option<png::Reader<BufReader<File>>> {
    let limits = png::Limits { bytes: HEADER_BYTES };
    let mut decoder = png::Decoder::new_with_limits(BufReader::new(file), limits);
    decoder.set_ignore_iccp_chunk(true);
    decoder.read_info().ok()
}

fn is_glimt_png(file: File) -> bool {
    let Some(reader) = open_png_reader(file) else { return false };
    let texts = &reader.info().uncompressed_latin1_text;
    texts.iter().any(|text| text.keyword == "Software" && is_glimt_software(&text.text))
}

/// Whether the text has the form `glimt 0.1.0`.
fn is_glimt_software(software: &str) -> bool {
    software.split_once(' ').is_some_and(|(name, _)| name == PROGRAM)
}

fn is_glimt_plot(file: File, texts: &[&str]) -> bool {
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
    fn unreadable_files_are_not_foreign() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        assert!(matches!(check_image_replacement(&path), ReplaceCheckResult::Own), "no file");
        std::fs::write(&path, "an image").expect("written");
        assert!(matches!(check_image_replacement(&path), ReplaceCheckResult::Foreign("an image")));
        let denied = || Some(Err(io::Error::from(io::ErrorKind::PermissionDenied)));
        let replaced = ReplaceCheckResult::from_file(denied(), "an image", |_| true);
        assert!(
            matches!(replaced, ReplaceCheckResult::Unreadable(why) if why.kind() == io::ErrorKind::PermissionDenied)
        );
    }

    #[test]
    fn unreadable_files_are_reported_with_the_reason() {
        for errno in [nix::libc::EACCES, nix::libc::EMFILE] {
            let error = || io::Error::from_raw_os_error(errno);
            let reason = ReplaceCheckResult::Unreadable(error()).reason_to_keep().expect("it is kept");
            assert!(reason.ends_with(&crate::system::describe_io_error(&error())), "{reason}");
        }
        assert!(
            ReplaceCheckResult::Foreign("a report")
                .reason_to_keep()
                .expect("it is kept")
                .contains("a report")
        );
        assert_eq!(ReplaceCheckResult::Own.reason_to_keep(), None);
    }
}
