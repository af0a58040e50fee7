//! Error messages about image files.

use ::image::ImageError;
use ::image::error::LimitErrorKind;

use super::jpeg;
use crate::system::describe_io_error;

/// Error message for an empty file.
pub(super) const EMPTY_FILE: &str = "the file is empty";
/// Error message for an empty embedded image.
pub(super) const EMPTY_EMBEDDED: &str = "an embedded image is empty";

pub(super) fn empty_image_message(width: u32, height: u32) -> String {
    format!("it has {width} × {height} pixels")
}

pub(super) fn side_too_long_message(width: u32, height: u32, limit: u32) -> String {
    format!("it has {width} × {height} pixels; the limit is {limit} per side")
}

pub(super) fn memory_limit_message(width: u32, height: u32, needed: u64, limit: u64) -> String {
    let (needed, limit) = (needed.div_ceil(1 << 20), limit >> 20);
    format!("it has {width} × {height} pixels, which need {needed} MiB of memory; the limit is {limit} MiB")
}

pub(super) fn implausible_size_message(width: u32, height: u32, needed: u64, length: u64) -> String {
    let needed = needed.div_ceil(1 << 20);
    format!(
        "the header claims {width} × {height} pixels ({needed} MiB), too many for a file of {length} bytes"
    )
}

/// Error message for an image that cannot be decoded.
pub(super) fn undecodable_image_message(width: u32, height: u32, reason: &str) -> String {
    format!("the header claims {width} × {height} pixels: {reason}")
}

pub(crate) fn unknown_format_message() -> String {
    "unsupported image format; expected png, jpg, ppm, pfm, tga, bmp, hdr, exr or webp".to_owned()
}

/// Shortens a decoder's error message, which may quote large parts of the file.
pub(super) fn shorten_decoder_error(error: &ImageError) -> String {
    const MAX_LENGTH: usize = 200;
    let words = match error {
        ImageError::Unsupported(_) => format!("{}: {error}", unknown_format_message()),
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            jpeg::TRUNCATED.to_owned()
        }
        ImageError::IoError(error) => describe_io_error(error),
        ImageError::Limits(error) if error.kind() == LimitErrorKind::InsufficientMemory => {
            "it needs more memory than the limit for images".to_owned()
        }
        _ => replace_chunk_debug_with_name(&error.to_string()),
    };
    if words.chars().count() <= MAX_LENGTH {
        words
    } else {
        words.chars().take(MAX_LENGTH).chain(['…']).collect()
    }
}

/// Replaces PNG chunk types in a decoder message with the chunk names. The decoder prints them in debug
/// format.
fn replace_chunk_debug_with_name(words: &str) -> String {
    const OPENING: &str = "ChunkType { type: ";
    let Some((before, rest)) = words.split_once(OPENING) else { return words.to_owned() };
    let Some((chunk, after)) = rest.split_once(" }") else { return words.to_owned() };
    let name = chunk.split(',').next().unwrap_or_default();
    format!("{before}{name}{after}")
}
