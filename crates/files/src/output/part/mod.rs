//! Part files and checkpoints. Each file contains a film and describes everything the image depends on.
//!
//! | bytes | |
//! | --- | --- |
//! | 12 | magic number, not used by any image format |
//! | 4 | format version |
//! | 4, n | length of the header, and the header: [`PartHeader`] as JSON |
//! | 16 | digest of all preceding bytes |
//! | 4, 4, n, 16 | for each tile with samples: index, length, data, digest |
//! | 4, 4, n, 16 | the footer in the same form, with an index not used by tiles: counts, digest of all records, render state |
//!
//! All numbers are little-endian. Digests are the first 16 bytes of BLAKE3. The digest of a record includes
//! the header's digest, so records from different files cannot be mixed. The footer contains a digest of all
//! records, so missing records are detected. No bytes may follow the footer.

mod error;
mod head;
mod merge;
mod read;
mod save;

pub use error::{PartError, missing_parts_message};
pub use head::{
    ImageHeader, NamedRenderInput, PartFileKind, PartHeader, PartShare, ToneHeader, render_input_differences,
};
pub use merge::{MergedParts, check_and_list_missing, merge_parts};
pub use read::{
    PartFile, find_input_that_is_path_suffix, find_render_input_by_content, is_part_or_checkpoint,
};
pub use save::save;

/// Magic number. Like PNG's signature, it is corrupted if a program converts the file as if it were text, so
/// such damage is detected.
const MAGIC: [u8; 12] = crate::system::file::PART_MAGIC;

/// Version of the part file format.
const VERSION: u32 = 2;

/// Index of the footer record.
const FOOTER: u32 = u32::MAX;

/// Digest of a record or the header.
type Digest = [u8; 16];

/// Computes the digest of bytes in a file, given the header's digest.
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

/// Part file footer.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
struct Footer {
    /// Number of tiles.
    tiles: u64,
    /// Number of nonfinite samples.
    non_finite: u64,
    /// Digest of the tiles' digests, in hexadecimal.
    records: String,
    /// Render state, opaque to this module.
    state: serde_json::Value,
}

#[cfg(test)]
mod tests;
