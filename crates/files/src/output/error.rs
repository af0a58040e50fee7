//! Errors of writing a picture, with the way out.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use nix::libc;

use super::{Format, MovingFormat};
use crate::system::describe_error;

/// Reasons for which a picture could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The path has no ending.
    #[error("cannot write {}: it has no ending that says its format; use one of {}", path.display(), Format::known_endings())]
    NoEnding {
        /// The path.
        path: PathBuf,
    },
    /// No format has this ending.
    #[error("cannot write {}: .{ending} is not a format that glimt writes; use one of {}", path.display(), Format::known_endings())]
    UnknownEnding {
        /// The path.
        path: PathBuf,
        /// Its ending, in small letters.
        ending: String,
    },
    /// The bit depth is neither 8 nor 16.
    #[error("{bits} bits a channel are not possible; use 8 or 16")]
    BitDepth {
        /// Requested bits.
        bits: u8,
    },
    /// The format cannot hold the picture.
    #[error("a {format} file cannot {why}; use .png or .exr")]
    Unsuitable {
        /// The format.
        format: Format,
        /// Property that the format lacks.
        why: String,
    },
    /// The format cannot hold the moving picture, or its encoder failed.
    #[error("a moving {format} file {why}")]
    Moving {
        /// The format.
        format: MovingFormat,
        /// The reason.
        why: String,
    },
    /// The encoder failed.
    #[error("the picture could not be encoded as {format}: {why}")]
    Encoder {
        /// The format.
        format: Format,
        /// Message of the encoder.
        why: String,
    },
    /// A picture cannot be written to the target.
    #[error("cannot write {}: {why}; {way_out}", path.display())]
    Target {
        /// The path as given.
        path: PathBuf,
        /// Fault of the target.
        why: String,
        /// Advice for a way out.
        way_out: &'static str,
    },
    /// The existing file must stay.
    #[error("{reason}")]
    Refused {
        /// The file, the reason, and the way out.
        reason: String,
    },
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled(#[from] crate::control::Cancelled),
    /// The system refused the operation.
    #[error("cannot write {}: {}; {}", path.display(), describe_error(source), way_out(source))]
    File {
        /// The path as given.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
}

impl OutputError {
    pub(super) fn encoder(format: Format, why: &impl ToString) -> Self {
        Self::Encoder { format, why: why.to_string() }
    }

    pub(super) fn file(path: &Path, source: impl Into<io::Error>) -> Self {
        Self::File { path: path.to_owned(), source: source.into() }
    }
}

fn way_out(error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "free some space or choose another place",
        ErrorKind::FileTooLarge => {
            "raise the limit on the size of files (ulimit -f), choose another place or a smaller picture"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "allow writing there or choose another place"
        }
        ErrorKind::InvalidFilename => "choose a shorter name",
        ErrorKind::BrokenPipe => "whoever read it has ended; choose a file",
        _ if matches!(error.raw_os_error(), Some(libc::EMFILE | libc::ENFILE)) => {
            "raise the limit on open files (ulimit -n)"
        }
        _ => "choose another place",
    }
}
