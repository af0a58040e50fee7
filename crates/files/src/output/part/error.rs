//! Errors for parts and checkpoints, with advice for the user.

use std::io;
use std::path::PathBuf;

use crate::system::file::FileKind;
use crate::system::{describe_io_error, is_too_many_open_files};

/// Reason why parts cannot be merged or a checkpoint cannot be resumed.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The file cannot be read.
    #[error("{}: {}", path.display(), describe_io_error(source))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// System error.
        source: io::Error,
    },
    /// The path is not a regular file.
    #[error("{}: it is {}, not a part or checkpoint", path.display(), kind.description())]
    NotRegular {
        /// The path.
        path: PathBuf,
        /// Its file type.
        kind: FileKind,
    },
    /// The file has a different format.
    #[error("{}: not a part or checkpoint written by glimt", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The file was written by an incompatible version of glimt.
    #[error("{}: format version {found} is not supported (expected {known}); render it again with this version of glimt", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the file.
        found: u32,
        /// The supported version.
        known: u32,
    },
    /// The file is truncated: it is still being copied, or copying was interrupted.
    #[error("{}: it is damaged (truncated at byte {bytes}); copy or render it again", path.display())]
    Unfinished {
        /// The file.
        path: PathBuf,
        /// Length of the file.
        bytes: u64,
    },
    /// A checksum is wrong or the file is malformed.
    #[error("{}: it is damaged ({why}); copy or render it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Description and location of the damage.
        why: String,
    },
    /// The file is a checkpoint instead of a part, or vice versa.
    #[error("{}: it is a {found}, not a {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Type of the file.
        found: &'static str,
        /// Requested type.
        wanted: &'static str,
    },
    /// The file belongs to a different image.
    #[error("{}: it does not match {other}: {}", path.display(), differences.join("; "))]
    Other {
        /// The file.
        path: PathBuf,
        /// The file it was compared with.
        other: String,
        /// Descriptions of the differences.
        differences: Vec<String>,
    },
    /// Two files contain the same part.
    #[error("{} and {} both contain part {index}/{count}", first.display(), second.display())]
    Doubled {
        /// The first file.
        first: PathBuf,
        /// The second file.
        second: PathBuf,
        /// Index of the part.
        index: u32,
        /// Number of parts.
        count: u32,
    },
    /// Some parts are missing.
    #[error("{}; render them with --shard, or merge the others with --partial", missing_parts_message(missing, *count))]
    Missing {
        /// Indices of the missing parts.
        missing: Vec<u32>,
        /// Number of parts.
        count: u32,
    },
    /// There is not enough memory for the image.
    #[error("{0}")]
    Film(#[from] crate::film::FilmCreationError),
    /// The operation was canceled.
    #[error("canceled")]
    Canceled(#[from] crate::control::Canceled),
}

impl PartError {
    /// Whether too many files are open in the process or the system. Opening more files would also fail.
    pub fn is_too_many_open_files(&self) -> bool {
        let Self::Unreadable { source, .. } = self else { return false };
        is_too_many_open_files(source)
    }
}

/// Describes missing parts, for example `2 of 8 parts are missing: 3/8, 4/8`.
pub fn missing_parts_message(missing: &[u32], count: u32) -> String {
    format!("{} of {count} parts are missing: {}", missing.len(), format_missing_parts(missing, count))
}

/// Lists parts in the form `1/8, 3/8, 4/8`. Long lists are truncated.
fn format_missing_parts(missing: &[u32], count: u32) -> String {
    const MAX_SHOWN: usize = 20;
    let names: Vec<String> = missing.iter().take(MAX_SHOWN).map(|index| format!("{index}/{count}")).collect();
    let rest = missing.len().saturating_sub(MAX_SHOWN);
    if rest > 0 { format!("{} and {rest} more", names.join(", ")) } else { names.join(", ") }
}
