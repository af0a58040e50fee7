//! Errors from writing images, with advice for the user.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::{AnimationFormat, Format};
use crate::system::{RAISE_FILE_LIMIT, describe_io_error, is_too_many_open_files};

/// Reason why an image could not be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The path has no file name extension.
    #[error("cannot write {}: it has no file extension; use one of {}", path.display(), Format::list_known_extensions())]
    NoExtension {
        /// The path.
        path: PathBuf,
    },
    /// No format has this extension.
    #[error("cannot write {}: .{extension} is not a supported format; use one of {}", path.display(), Format::list_known_extensions())]
    UnknownExtension {
        /// The path.
        path: PathBuf,
        /// The lowercase extension.
        extension: String,
    },
    /// The bit depth is neither 8 nor 16.
    #[error("{bits} bits per channel are not supported; use 8 or 16")]
    BitDepth {
        /// Requested bits.
        bits: u8,
    },
    /// The format cannot represent the image.
    #[error("a {format} file cannot {why}; use .png or .exr")]
    Unsuitable {
        /// The format.
        format: Format,
        /// The missing capability.
        why: String,
    },
    /// The format cannot represent the animation, or its encoder failed.
    #[error("an animated {format} file {why}")]
    Animation {
        /// The format.
        format: AnimationFormat,
        /// The reason.
        why: String,
    },
    /// The encoder failed.
    #[error("the image could not be encoded as {format}: {why}")]
    Encoder {
        /// The format.
        format: Format,
        /// The encoder's message.
        why: String,
    },
    /// The target cannot be written.
    #[error("cannot write {}: {why}; {advice}", path.display())]
    Target {
        /// The path as specified by the user.
        path: PathBuf,
        /// The reason.
        why: String,
        /// Advice for the user.
        advice: &'static str,
    },
    /// Replacing the existing file is not allowed.
    #[error("{reason}")]
    Refused {
        /// Message that names the file, states the reason and gives advice.
        reason: String,
    },
    /// The work was canceled.
    #[error("canceled")]
    Canceled(#[from] crate::control::Canceled),
    /// The operating system reported an error.
    #[error("cannot write {}: {}; {}", path.display(), describe_io_error(source), write_error_advice(source))]
    File {
        /// The path as specified by the user.
        path: PathBuf,
        /// System error.
        source: io::Error,
    },
}

impl OutputError {
    pub(super) fn encoder(format: Format, why: &impl ToString) -> Self {
        Self::Encoder { format, why: why.to_string() }
    }

    pub(super) fn from_io(path: &Path, source: impl Into<io::Error>) -> Self {
        Self::File { path: path.to_owned(), source: source.into() }
    }
}

fn write_error_advice(error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "free some space or choose another location",
        ErrorKind::FileTooLarge => {
            "raise the file size limit (ulimit -f), choose another location or render a smaller image"
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "allow writing there or choose another location"
        }
        ErrorKind::InvalidFilename => "choose a shorter name",
        ErrorKind::BrokenPipe => "the reader has exited; write to a file",
        _ if is_too_many_open_files(error) => RAISE_FILE_LIMIT,
        _ => "choose another location",
    }
}
