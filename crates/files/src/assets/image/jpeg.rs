//! Rejects malformed JPEG files, because the decoder would accept them and fill missing data with gray.

use std::path::Path;

use crate::assets::AssetError;
use crate::assets::read::{self, Monitor};
use crate::control::{CancelToken, ignore_progress};

/// Checks that a JPEG's type is supported and that its end-of-image marker follows the last start-of-scan
/// marker. Neither marker can occur within a scan (ITU-T T.81, B.1.1.5).
pub(super) fn check_complete(path: &Path, limit: u64, token: &CancelToken) -> Result<(), String> {
    let bytes = read::read_bytes(path, limit, Monitor { progress: &ignore_progress, token });
    check_complete_bytes(&bytes.map_err(|error: AssetError| error.to_string())?)
}

/// Like [`check_complete`], but for a file in memory.
pub(super) fn check_complete_bytes(bytes: &[u8]) -> Result<(), String> {
    check_supported_type(bytes)?;
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    match (last([0xff, 0xda]), last([0xff, 0xd9])) {
        (Some(scan), Some(end)) if scan < end => Ok(()),
        _ => Err(TRUNCATED.to_owned()),
    }
}

/// Error message for a truncated image.
pub(super) const TRUNCATED: &str = "the image data is truncated";

/// Rejects JPEG types that the decoder does not support (ITU-T T.81, table B.1). The decoder's own message
/// does not name the type.
fn check_supported_type(bytes: &[u8]) -> Result<(), String> {
    // A frame header starts with the bits per sample.
    let mut frames = segments_before_scan(bytes)
        .filter(|(marker, _)| matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc));
    let Some((marker, start)) = frames.next() else { return Ok(()) };
    let kind = match (marker, bytes.get(start)) {
        (0xc9..=0xcf, _) => "an arithmetic-coded JPEG".to_owned(),
        (0xc3, _) => "a lossless JPEG".to_owned(),
        (0xc5..=0xc7, _) => "a hierarchical JPEG".to_owned(),
        (_, Some(bits)) if *bits != 8 => format!("a {bits}-bit JPEG"),
        (_, _) => return Ok(()),
    };
    Err(format!("it is {kind}; save it as a baseline or progressive JPEG, or as PNG"))
}

/// Returns the offset of the transform byte in a misleading Adobe segment: one that specifies RGB in a file
/// with a JFIF segment. JFIF implies YCbCr, and other readers give it precedence.
pub(super) fn wrong_adobe_transform_offset(bytes: &[u8]) -> Option<usize> {
    const ADOBE: &[u8] = b"Adobe";
    const TRANSFORM: usize = 11;
    let find = |marker: u8, name: &[u8]| {
        let mut named = segments_before_scan(bytes)
            .filter(|(found, start)| *found == marker && bytes[*start..].starts_with(name));
        named.next().map(|(_, start)| start)
    };
    find(0xe0, b"JFIF\0")?;
    let transform = find(0xee, ADOBE)? + TRANSFORM;
    (bytes.get(transform) == Some(&0)).then_some(transform)
}

/// Changes a misleading Adobe segment to YCbCr.
pub(super) fn fix_adobe_color_transform(bytes: &mut [u8]) {
    if let Some(transform) = wrong_adobe_transform_offset(bytes) {
        bytes[transform] = 1;
    }
}

/// Returns the marker and data offset of each segment before the first scan.
fn segments_before_scan(bytes: &[u8]) -> impl Iterator<Item = (u8, usize)> {
    const SCAN: u8 = 0xda;
    let mut at = 2;
    std::iter::from_fn(move || {
        // A marker may be preceded by any number of 0xff fill bytes.
        while bytes.get(at..at + 2)? == [0xff, 0xff] {
            at += 1;
        }
        let &[0xff, marker, high, low] = bytes.get(at..)?.first_chunk()? else { return None };
        let start = at + 4;
        at += 2 + usize::from(u16::from_be_bytes([high, low]));
        (marker != SCAN && start <= bytes.len()).then_some((marker, start))
    })
}

/// Checks the image size in the header against the file size. Each block of 8 × 8 pixels takes at least one
/// bit for its mean.
pub(super) fn check_plausible_size(width: u32, height: u32, file_bytes: u64) -> Result<(), String> {
    let blocks = u64::from(width.div_ceil(8)) * u64::from(height.div_ceil(8));
    if blocks > file_bytes.saturating_mul(8) {
        return Err(implausible_image_size_message(width, height, file_bytes));
    }
    Ok(())
}

/// Error message for an image with more pixels than its file can contain.
pub(super) fn implausible_image_size_message(width: u32, height: u32, file_bytes: u64) -> String {
    format!("the header claims {width} × {height} pixels, too many for a file of {file_bytes} bytes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsupported_jpeg_types_are_rejected() {
        let file = |marker: u8, bits: u8| {
            [
                0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xff, marker, 0, 5, bits, 0, 0, 0xff, 0xda, 0, 2,
                0xff, 0xd9,
            ]
        };
        for (marker, bits) in [(0xc0, 8), (0xc1, 8), (0xc2, 8)] {
            assert_eq!(check_complete_bytes(&file(marker, bits)), Ok(()), "{marker:x}");
        }
        // A Huffman table is not a frame header.
        assert_eq!(check_complete_bytes(&file(0xc4, 1)), Ok(()));
        let error = |marker, bits| check_complete_bytes(&file(marker, bits)).expect_err("an error");
        let kinds = [0xc3, 0xc6, 0xc9, 0xca].map(|marker| error(marker, 8));
        assert!(kinds[0] != kinds[1] && kinds[1] != kinds[2] && kinds[2] == kinds[3], "{kinds:?}");
        assert!(error(0xc1, 12).contains("12"));
        let whole = file(0xc0, 8);
        for length in 0..whole.len() {
            assert!(check_complete_bytes(&whole[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn jfif_overrides_an_adobe_transform() {
        let file = |segments: &[&[u8]]| {
            let mut file = vec![0xff, 0xd8];
            for segment in segments {
                file.extend([0xff, segment[0], 0, segment.len() as u8 + 1]);
                file.extend(&segment[1..]);
            }
            file.extend([0xff, 0xda, 0, 2, 0xff, 0xd9]);
            file
        };
        let (jfif, rgb, ycc) =
            (b"\xe0JFIF\0\x01\x02", b"\xeeAdobe\0d\0\0\0\0\0", b"\xeeAdobe\0d\0\0\0\0\x01");
        for segments in [&[jfif.as_slice(), rgb][..], &[rgb, jfif]] {
            let file = file(segments);
            let at = wrong_adobe_transform_offset(&file).expect("both segments are present");
            assert_eq!(file[at - 11..=at], rgb[1..]);
        }
        for segments in [&[jfif.as_slice(), ycc][..], &[rgb], &[jfif], &[]] {
            assert_eq!(wrong_adobe_transform_offset(&file(segments)), None);
        }
    }
}
