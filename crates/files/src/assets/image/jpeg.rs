//! Faults that the JPEG decoder accepts and a texture must not have: it fills missing data with grey.

use std::path::Path;

use crate::assets::AssetError;
use crate::assets::read::{self, Watch};
use crate::control::{CancelToken, ignore_progress};

/// Checks that the last scan ends: the marker of the end of the image follows that of the scan's start. Within a scan
/// neither can occur (ITU-T T.81, B.1.1.5).
pub(super) fn check_whole(path: &Path, limit: u64, token: &CancelToken) -> Result<(), String> {
    let bytes = read::bytes(path, limit, Watch { progress: &ignore_progress, token });
    check_bytes(&bytes.map_err(|error: AssetError| error.to_string())?)
}

/// [`check_whole`] of bytes in memory.
pub(super) fn check_bytes(bytes: &[u8]) -> Result<(), String> {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    match (last([0xff, 0xda]), last([0xff, 0xd9])) {
        (Some(scan), Some(end)) if scan < end => Ok(()),
        _ => Err("the file ends before the image does".to_owned()),
    }
}

/// Checks the size: each block of 8 × 8 pixels takes at least one bit, that of its mean.
pub(super) fn check_plausible(width: u32, height: u32, file_bytes: u64) -> Result<(), String> {
    let blocks = u64::from(width.div_ceil(8)) * u64::from(height.div_ceil(8));
    if blocks > file_bytes.saturating_mul(8) {
        return Err(format!("it claims {width} × {height} pixels, which {file_bytes} bytes cannot hold"));
    }
    Ok(())
}
