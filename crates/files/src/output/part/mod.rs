//! Parts of an image and checkpoints: a film stored in a file, with everything that the image depends on.
//!
//! | bytes | |
//! | --- | --- |
//! | 12 | magic number, which no image format uses |
//! | 4 | format version |
//! | 4, n | length of the header, and the header: [`Head`] as JSON |
//! | 16 | digest of everything before |
//! | 4, 4, n, 16 | for each tile with samples: index, length, data, digest |
//! | 4, 4, n, 16 | the footer in the same form, with an index that no tile has: counts, digest of all records, render state |
//!
//! All numbers are little-endian. Digests are the first 16 bytes of BLAKE3. The digest of a record includes
//! that of the header, so that records cannot be mixed between files. The footer contains a digest of all
//! records: no record can be missing, and nothing may follow.

mod error;
mod head;
mod merge;
mod read;
mod save;

pub use error::{PartError, WhichPart, missing_parts};
pub use head::{Dependency, Head, ImageHead, PartKind, ShareHead, ToneHead, differences};
pub use merge::{Merged, check, merge};
pub use read::{PartFile, input_with_content, input_with_name, is_part};
pub use save::save;

/// Magic number. Like that of PNG, it is corrupted by conversions of text files.
const MARK: [u8; 12] = crate::system::file::PART_MARK;

/// Version of the format.
const VERSION: u32 = 1;

/// Index of the footer record.
const FOOTER: u32 = u32::MAX;

/// Digest of a record or of the header.
type Digest = [u8; 16];

/// Digest of some bytes of a file, given the digest of its header.
fn digest(header_digest: &Digest, parts: &[&[u8]]) -> Digest {
    let mut hasher = blake3::Hasher::new();
    hasher.update(header_digest);
    for part in parts {
        hasher.update(part);
    }
    let mut digest = Digest::default();
    digest.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    digest
}

/// Footer of a file.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Footer {
    /// Number of tiles.
    tiles: u64,
    /// Number of nonfinite samples.
    non_finite: u64,
    /// Digest of the tiles' digests, in hexadecimal.
    records: String,
    /// State of the render, opaque to this module.
    state: serde_json::Value,
}

#[cfg(test)]
mod tests;
