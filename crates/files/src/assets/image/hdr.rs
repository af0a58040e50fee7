//! Limits that the HDR decoder lacks: it keeps every line of the header.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use super::in_words;
use crate::control::CancelToken;

/// Most bytes of a header with the line of the size; the same limit as for PLY.
const HEADER_BYTES: u64 = 1 << 20;

/// [`check_header`] of bytes in memory.
pub(super) fn check_bytes(bytes: &[u8]) -> Result<(), String> {
    let most = HEADER_BYTES as usize;
    let start = &bytes[..bytes.len().min(most)];
    let ends = |blank: usize| start[blank + 2..].contains(&b'\n');
    if bytes.len() >= most && !memchr::memmem::find(start, b"\n\n").is_some_and(ends) {
        return Err(too_long());
    }
    Ok(())
}

fn too_long() -> String {
    format!("its header does not end within {} MiB", HEADER_BYTES >> 20)
}

/// Checks that the header ends within its limit: at an empty line, followed by the line of the size. A file that ends before is
/// left to the decoder.
pub(super) fn check_header(file: &File, token: &CancelToken) -> Result<(), String> {
    const CHUNK: usize = 1 << 14;
    let mut chunk = vec![0; CHUNK];
    let (mut at, mut last, mut is_over) = (0, 0, false);
    while at < HEADER_BYTES {
        token.check().map_err(|cancelled| cancelled.to_string())?;
        let got = match file.read_at(&mut chunk, at) {
            Ok(0) => return Ok(()),
            Ok(got) => got,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(in_words(&error)),
        };
        for &byte in &chunk[..got] {
            if byte == b'\n' && is_over {
                return Ok(());
            }
            is_over |= byte == b'\n' && last == b'\n';
            last = byte;
        }
        at += got as u64;
    }
    Err(too_long())
}
