//! Reads regular files with a size limit, progress reports and cancellation.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use super::{AssetError, FileHash};
use crate::control::{CancelToken, Canceled, Progress};
use crate::system::file::{self, FileKind};
use crate::system::memory::try_reserve_exact;

/// Number of bytes between polls of the cancel token.
const BYTES_PER_POLL: usize = 1 << 20;

/// Error message for Git LFS pointers.
const LFS_POINTER: &str = "it is a Git LFS pointer, not the file's content; run `git lfs pull`";
/// Error message for binary data where text is expected.
pub(crate) const BINARY_FILE: &str = "this is a binary file in another format";
/// Error message for UTF-16 text.
pub(crate) const UTF16_TEXT: &str = "this is text in UTF-16; save it as UTF-8";

/// Error message for anything other than a regular file.
fn not_regular_file_message(kind: FileKind) -> String {
    format!("it is {}, not a regular file", kind.description())
}

/// Progress callback and cancel token for loading a file.
#[derive(Clone, Copy)]
pub(crate) struct Monitor<'a> {
    pub(crate) progress: Progress<'a>,
    pub(crate) token: &'a CancelToken,
}

impl Monitor<'_> {
    /// Reports progress, then polls the token.
    pub(crate) fn report_and_check_cancel(&self, done: usize, total: usize) -> Result<(), Canceled> {
        (self.progress)(done as u64, total as u64);
        self.token.check_pause_and_cancel()
    }
}

/// BLAKE3 hash of a file's content.
pub(crate) fn hash_bytes(bytes: &[u8]) -> FileHash {
    *blake3::hash(bytes).as_bytes()
}

/// Opens a regular file of at most `limit` bytes and returns it with its length. Rejects pipes, devices and
/// folders without opening them, because opening a pipe may block.
pub(crate) fn open_regular_with_limit(path: &Path, limit: u64) -> Result<(File, u64), AssetError> {
    let unreadable = |error: std::io::Error| AssetError::from_io(path, &error);
    let refused = |kind: FileKind| AssetError::unreadable(path, not_regular_file_message(kind));
    let (mut file, found) = file::open_regular_file(path).map_err(unreadable)?.map_err(refused)?;
    if found.len() > limit {
        let reason = format!("it has {} bytes; the limit is {} MiB", found.len(), limit >> 20);
        return Err(AssetError::unreadable(path, reason));
    }
    if found.len() < file::LFS_POINTER_LIMIT {
        let mut bytes = Vec::new();
        (&mut file).take(file::LFS_POINTER_LIMIT).read_to_end(&mut bytes).map_err(unreadable)?;
        if file::is_lfs_pointer(&bytes) {
            return Err(AssetError::unreadable(path, LFS_POINTER));
        }
        file.rewind().map_err(unreadable)?;
    }
    Ok((file, found.len()))
}

/// Number of bytes to check for binary data at the start of a file.
const CHECKED_BYTES: usize = 1 << 12;

/// Reads a text file. Rejects binary files based on their first [`CHECKED_BYTES`] bytes.
pub(crate) fn read_text_bytes(path: &Path, limit: u64, monitor: Monitor<'_>) -> Result<Vec<u8>, AssetError> {
    read_if_start_accepted(path, limit, monitor, |start| {
        reject_utf16(path, start)?;
        reject_as_binary_if(path, start.contains(&0))
    })
}

/// Reads a text or binary file in a format whose magic number starts with three letters. Rejects UTF-16 text
/// and files with a zero among the first three bytes.
pub(crate) fn read_unless_zeros_in_magic(
    path: &Path,
    limit: u64,
    monitor: Monitor<'_>,
) -> Result<Vec<u8>, AssetError> {
    read_if_start_accepted(path, limit, monitor, |start| {
        reject_utf16(path, start)?;
        reject_as_binary_if(path, start[..start.len().min(3)].contains(&0))
    })
}

/// Reads a text or binary file. Rejects files whose first [`CHECKED_BYTES`] bytes are all zero.
pub(crate) fn read_unless_zeros_at_start(
    path: &Path,
    limit: u64,
    monitor: Monitor<'_>,
) -> Result<Vec<u8>, AssetError> {
    read_if_start_accepted(path, limit, monitor, |start| {
        reject_as_binary_if(path, !start.is_empty() && start.iter().all(|byte| *byte == 0))
    })
}

/// Reads a regular file with any content.
pub(crate) fn read_bytes(path: &Path, limit: u64, monitor: Monitor<'_>) -> Result<Vec<u8>, AssetError> {
    read_if_start_accepted(path, limit, monitor, |_| Ok(()))
}

fn reject_as_binary_if(path: &Path, is_binary: bool) -> Result<(), AssetError> {
    let refused = || AssetError::malformed(path, Some(1), BINARY_FILE);
    if is_binary { Err(refused()) } else { Ok(()) }
}

/// Rejects UTF-16 where a text file is expected. Do not call it for binary formats, because their 16-bit
/// numbers can look like UTF-16.
pub(crate) fn reject_utf16(path: &Path, start: &[u8]) -> Result<(), AssetError> {
    let refused = || AssetError::malformed(path, Some(1), UTF16_TEXT);
    if looks_like_utf16(start) { Err(refused()) } else { Ok(()) }
}

/// Whether a file starts like UTF-16 text: an optional byte order mark, then two ASCII characters, each with
/// a zero byte.
fn looks_like_utf16(start: &[u8]) -> bool {
    let start = start.strip_prefix(b"\xff\xfe").or(start.strip_prefix(b"\xfe\xff")).unwrap_or(start);
    let is_letter = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    match start {
        [a, 0, b, 0, ..] | [0, a, 0, b, ..] => is_letter(a) && is_letter(b),
        _ => false,
    }
}

/// Reads a regular file unless `accept` rejects its first [`CHECKED_BYTES`] bytes. Reports progress in bytes
/// out of `2·length`; the second half is reserved for parsing.
fn read_if_start_accepted(
    path: &Path,
    limit: u64,
    monitor: Monitor<'_>,
    accept: impl Fn(&[u8]) -> Result<(), AssetError>,
) -> Result<Vec<u8>, AssetError> {
    let (mut file, length) = open_regular_with_limit(path, limit)?;
    let unreadable = |error: std::io::Error| AssetError::from_io(path, &error);
    let mut start = Vec::new();
    (&mut file).take(CHECKED_BYTES as u64).read_to_end(&mut start).map_err(unreadable)?;
    accept(&start)?;
    file.rewind().map_err(unreadable)?;
    read_rest(path, file, length, limit, monitor)
}

/// Reads the rest of an open file of about `length` bytes. Reports progress in the way [`read_bytes`] does.
pub(crate) fn read_rest(
    path: &Path,
    file: File,
    length: u64,
    limit: u64,
    monitor: Monitor<'_>,
) -> Result<Vec<u8>, AssetError> {
    let unreadable = |error: std::io::Error| AssetError::from_io(path, &error);
    let mut file = file.take(limit);
    let length = length as usize;
    let mut bytes = Vec::new();
    let out_of_memory = |_| AssetError::OutOfMemory { path: path.to_owned(), bytes: length };
    try_reserve_exact(&mut bytes, length + 1).map_err(out_of_memory)?;
    loop {
        monitor.report_and_check_cancel(bytes.len().min(length), 2 * length)?;
        let got = (&mut file).take(BYTES_PER_POLL as u64).read_to_end(&mut bytes).map_err(unreadable)?;
        if got == 0 {
            return Ok(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::expect_rejection;
    use crate::control::ignore_progress;
    use crate::system::describe_io_error;
    use std::fs;
    use std::sync::Mutex;

    fn monitor(token: &CancelToken) -> Monitor<'_> {
        Monitor { progress: &ignore_progress, token }
    }

    #[test]
    fn unsuitable_files_are_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let reason = |path: &Path| expect_rejection(read_bytes(path, 100, monitor(&token))).1;
        assert_eq!(reason(folder.path()), not_regular_file_message(FileKind::Folder));
        let missing = std::io::Error::from_raw_os_error(nix::libc::ENOENT);
        assert_eq!(reason(&folder.path().join("none.obj")), describe_io_error(&missing));
        let long = folder.path().join("long");
        fs::write(&long, [0; 101]).expect("written");
        assert!(reason(&long).contains("101"));
    }

    #[test]
    fn binary_files_are_rejected_early() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("zeros");
        // A sparse file of 3 TiB, which would take an hour to read completely.
        File::create(&path).and_then(|file| file.set_len(3 << 40)).expect("a sparse file");
        for read in [read_text_bytes, read_unless_zeros_in_magic] {
            let error = expect_rejection(read(&path, u64::MAX, monitor(&token)));
            assert_eq!(error, (Some(1), BINARY_FILE.to_owned()));
        }
        fs::write(&path, b"ply\n\0").expect("written");
        assert!(read_text_bytes(&path, 100, monitor(&token)).is_err());
        assert_eq!(read_unless_zeros_in_magic(&path, 100, monitor(&token)).expect("read"), b"ply\n\0");
        fs::write(&path, b"").expect("written");
        assert_eq!(read_text_bytes(&path, 100, monitor(&token)).expect("read"), b"");
    }

    #[test]
    fn utf16_text_is_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("wide");
        for mark in ["", "\u{feff}"] {
            let words = || format!("{mark}v 0 0 0\n");
            let little: Vec<u8> = words().encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = words().encode_utf16().flat_map(u16::to_be_bytes).collect();
            for bytes in [little, big] {
                fs::write(&path, bytes).expect("written");
                for read in [read_text_bytes, read_unless_zeros_in_magic] {
                    let error = expect_rejection(read(&path, u64::MAX, monitor(&token)));
                    assert_eq!(error, (Some(1), UTF16_TEXT.to_owned()));
                }
            }
        }
    }

    #[test]
    fn binary_files_may_look_like_utf16() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("numbers");
        for numbers in [[33_u16, 126, 40], [0xfeff, 65, 66]] {
            let content: Vec<u8> = numbers.into_iter().flat_map(u16::to_le_bytes).collect();
            fs::write(&path, &content).expect("written");
            for read in [read_bytes, read_unless_zeros_at_start] {
                assert_eq!(read(&path, 100, monitor(&token)).expect("numbers"), content);
            }
        }
    }

    #[test]
    fn git_lfs_pointers_are_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("pointer");
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        fs::write(&path, pointer).expect("written");
        for read in [read_text_bytes, read_unless_zeros_in_magic, read_unless_zeros_at_start, read_bytes] {
            let error = expect_rejection(read(&path, 1 << 20, monitor(&token)));
            assert_eq!(error, (None, LFS_POINTER.to_owned()));
        }
        fs::write(&path, format!("{pointer}{}", "x".repeat(1024))).expect("written");
        assert!(read_bytes(&path, 1 << 20, monitor(&token)).is_ok(), "pointers are short");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_link_loops_do_not_block() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let reason = |path: &Path| expect_rejection(read_bytes(path, 100, monitor(&token))).1;
        let pipe = folder.path().join("pipe");
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
        assert_eq!(reason(&pipe), not_regular_file_message(FileKind::Special));
        assert_eq!(reason(Path::new("/dev/zero")), not_regular_file_message(FileKind::Special));
        #[cfg(target_os = "linux")]
        assert_eq!(reason(Path::new("/proc/kmsg")), not_regular_file_message(FileKind::Kernel));
        let cycle = folder.path().join("cycle");
        std::os::unix::fs::symlink(&cycle, &cycle).expect("a link");
        let link_loop = std::io::Error::from_raw_os_error(nix::libc::ELOOP);
        assert_eq!(reason(&cycle), describe_io_error(&link_loop));
    }

    #[test]
    fn reading_reports_progress_and_can_be_canceled() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("some");
        fs::write(&path, vec![7; 3 * BYTES_PER_POLL]).expect("written");
        let seen = Mutex::new(Vec::new());
        let token = CancelToken::new();
        let note = |done, total| {
            seen.lock().expect("no panic").push((done, total));
            if done >= 2 * BYTES_PER_POLL as u64 {
                token.cancel();
            }
        };
        let result = read_bytes(&path, u64::MAX, Monitor { progress: &note, token: &token });
        assert!(matches!(result, Err(AssetError::Canceled(_))));
        let total = 6 * BYTES_PER_POLL as u64;
        let expected: Vec<_> = (0..3).map(|chunk| (chunk * BYTES_PER_POLL as u64, total)).collect();
        assert_eq!(*seen.lock().expect("no panic"), expected);
    }
}
