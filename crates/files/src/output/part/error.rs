//! Errors of parts and checkpoints, each with the way out.

use std::io;
use std::path::PathBuf;

use nix::errno::Errno;

use crate::system::describe_error;

/// A part by its number and the number of parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WhichPart {
    /// From 1.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
}

/// Reasons for which parts are not merged, or a checkpoint is not gone on from.
#[derive(Debug, thiserror::Error)]
pub enum PartError {
    /// The file cannot be read.
    #[error("{}: {}", path.display(), describe_error(source))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{}: this is neither a part nor a checkpoint of glimt", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// Another version of glimt wrote it.
    #[error("{}: it has version {found} of the format, and this glimt reads version {known}; render it again with this glimt", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The version that is read.
        known: u32,
    },
    /// It ends too early: it is being copied, or the copy was broken off.
    #[error("{}: it is damaged: it ends at byte {bytes}, before its end; copy or render it again", path.display())]
    Unfinished {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
    },
    /// Its bytes are not those that were written.
    #[error("{}: it is damaged: {why}; copy or render it again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The place, in words.
        why: String,
    },
    /// A checkpoint in the place of a part, or the other way round.
    #[error("{}: it is a {found}, not a {wanted}", path.display())]
    Kind {
        /// The file.
        path: PathBuf,
        /// Kind of the file.
        found: &'static str,
        /// Requested kind.
        wanted: &'static str,
    },
    /// It is of another picture.
    #[error("{}: it does not fit {other}: {}", path.display(), differences.join("; "))]
    Other {
        /// The file.
        path: PathBuf,
        /// The one that it is compared with.
        other: String,
        /// Differences, a phrase for each.
        differences: Vec<String>,
    },
    /// Two files are the same part.
    #[error("{} and {}: both are part {index}/{count}; name it once", first.display(), second.display())]
    Doubled {
        /// One of the files.
        first: PathBuf,
        /// The other one.
        second: PathBuf,
        /// Number of the part.
        index: u32,
        /// Number of parts.
        count: u32,
    },
    /// Some parts are not there.
    #[error("{}; render them with --shard, or join what is there with --partial", missing_parts(missing, *count))]
    Missing {
        /// Their numbers.
        missing: Vec<u32>,
        /// Number of parts.
        count: u32,
    },
    /// There is no memory for the picture.
    #[error("{0}")]
    Film(#[from] crate::film::FilmError),
    /// The work was stopped.
    #[error("cancelled")]
    Cancelled(#[from] crate::control::Cancelled),
}

impl PartError {
    /// Whether the process, or the machine, has too many open files: further files would fail for the same reason.
    pub fn is_out_of_files(&self) -> bool {
        let Self::Unreadable { source, .. } = self else { return false };
        matches!(source.raw_os_error().map(Errno::from_raw), Some(Errno::EMFILE | Errno::ENFILE))
    }
}

/// `2 of 8 parts are missing: 3/8, 4/8`: the names of some of them.
pub fn missing_parts(missing: &[u32], count: u32) -> String {
    format!("{} of {count} parts are missing: {}", missing.len(), in_a_row(missing, count))
}

/// `1/8, 3/8, 4/8`: at most some of them.
fn in_a_row(missing: &[u32], count: u32) -> String {
    const MOST: usize = 20;
    let names: Vec<String> = missing.iter().take(MOST).map(|index| format!("{index}/{count}")).collect();
    let rest = missing.len().saturating_sub(MOST);
    if rest > 0 { format!("{} and {rest} more", names.join(", ")) } else { names.join(", ") }
}
