//! What the HDR decoder does not bound: it keeps every line of the header.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

use super::in_words;
use crate::control::CancelToken;

/// Most bytes of a header, the line of the size with it: as PLY.
const HEADER_BYTES: u64 = 1 << 20;

/// Whether the header ends where one may: at an empty line, behind which the line of the size follows. A file that ends before is the
/// decoder's to refuse.
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
    Err(format!("its header does not end within {} MiB", HEADER_BYTES >> 20))
}
