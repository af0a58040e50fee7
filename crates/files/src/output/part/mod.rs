//! Parts of a picture, and checkpoints: a film as a file, with the names of all that it is of.
//!
//! | bytes | |
//! | --- | --- |
//! | 12 | the mark, which no picture begins with |
//! | 4 | the version of this format |
//! | 4, n | the length of the head, and the head: [`Head`] as JSON |
//! | 16 | the digest of all before |
//! | 4, 4, n, 16 | for each tile that has samples: its number, the length of its bytes, its bytes, a digest |
//! | 4, 4, n, 16 | the end in the same form, with a number that no tile has: counts, the digest of all records, the state of the render |
//!
//! All numbers are little-endian. Each digest (BLAKE3, of which 16 bytes are kept) is of that of the head and of its own record, so
//! that no record passes for one of another file. The end holds the digest of all records: nothing can be missing before it, and
//! nothing may follow.

mod error;
mod head;
mod merge;
mod read;
mod save;

pub use error::{PartError, WhichPart, missing_parts};
pub use head::{Head, Kind, PictureHead, ShareHead, ToneHead, Trait, differences};
pub use merge::{Merged, check, merge};
pub use read::{PartFile, input_in_place_of, input_of_that_name, is_part};
pub use save::save;

/// The first bytes of a file. Like those of PNG, they are changed by whatever takes the file for a text.
const MARK: [u8; 12] = crate::system::file::PART_MARK;

/// Version of the format.
const VERSION: u32 = 1;

/// Number in the place of a tile's for the end.
const END: u32 = u32::MAX;

/// Digest of a record, or of the head.
type Digest = [u8; 16];

/// The digest of some bytes of a file whose head has a digest.
fn digest(of_head: &Digest, parts: &[&[u8]]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    hasher.update(of_head);
    for part in parts {
        hasher.update(part);
    }
    let mut digest = Digest::default();
    digest.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    digest
}

/// The end of a file.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct End {
    /// Number of tiles.
    tiles: u64,
    /// Samples that were not finite.
    non_finite: u64,
    /// Digest of the tiles' digests, in hexadecimal digits.
    records: String,
    /// State of the render that made it; of no meaning here.
    state: serde_json::Value,
}

#[cfg(test)]
mod tests;
