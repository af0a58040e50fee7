//! Reading files safely: only regular files, never more than a limit, with progress and cancellation.

use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

use super::{AssetError, FileHash};
use crate::control::{CancelToken, Cancelled, Progress};
pub(crate) use crate::system::describe_error;
use crate::system::file::{self, FileKind};

/// Bytes between two polls of the token.
const CHUNK: usize = 1 << 20;

/// Progress sink and cancel token of the work.
#[derive(Clone, Copy)]
pub(crate) struct Watch<'a> {
    pub(crate) progress: Progress<'a>,
    pub(crate) token: &'a CancelToken,
}

impl Watch<'_> {
    /// Reports progress, then polls the token.
    pub(crate) fn tick(&self, done: usize, total: usize) -> Result<(), Cancelled> {
        (self.progress)(done as u64, total as u64);
        self.token.check()
    }
}

/// Hash of a file that was read as a whole.
pub(crate) fn hash(bytes: &[u8]) -> FileHash {
    *blake3::hash(bytes).as_bytes()
}

/// Opens a regular file of at most `limit` bytes and returns its length too. Pipes, devices and folders are refused
/// before they are opened, so that nothing blocks.
pub(crate) fn open(path: &Path, limit: u64) -> Result<(File, u64), AssetError> {
    let unreadable = |error: std::io::Error| AssetError::unreadable(path, describe_error(&error));
    let refused =
        |kind: FileKind| AssetError::unreadable(path, format!("it is {}, not a regular file", kind.words()));
    let (mut file, found) = file::open(path).map_err(unreadable)?.map_err(refused)?;
    if found.len() > limit {
        let reason = format!("it has {} bytes, more than the {} MiB that are read", found.len(), limit >> 20);
        return Err(AssetError::unreadable(path, reason));
    }
    if found.len() < file::LFS_POINTER_LIMIT {
        let mut bytes = Vec::new();
        (&mut file).take(file::LFS_POINTER_LIMIT).read_to_end(&mut bytes).map_err(unreadable)?;
        if file::is_lfs_pointer(&bytes) {
            let reason = "it is a Git LFS pointer, not the file's content: run `git lfs pull`";
            return Err(AssetError::unreadable(path, reason));
        }
        file.rewind().map_err(unreadable)?;
    }
    Ok((file, found.len()))
}

/// Bytes at the start of a file by which text is recognised.
const START: usize = 1 << 12;

/// Reads a text file; a file whose start is binary is refused before the rest is read.
pub(crate) fn text(path: &Path, limit: u64, watch: Watch<'_>) -> Result<Vec<u8>, AssetError> {
    bytes_if(path, limit, watch, |start| {
        refuse_utf16(path, start)?;
        binary_if(path, start.contains(&0))
    })
}

/// Reads a file whose first three bytes are not zeros: they are letters in every format that uses this function.
pub(crate) fn lettered(path: &Path, limit: u64, watch: Watch<'_>) -> Result<Vec<u8>, AssetError> {
    bytes_if(path, limit, watch, |start| {
        refuse_utf16(path, start)?;
        binary_if(path, start[..start.len().min(3)].contains(&0))
    })
}

/// Reads the start of a regular file, at most so many bytes.
pub(crate) fn start(path: &Path, most: u64) -> Result<Vec<u8>, AssetError> {
    let (file, _) = open(path, u64::MAX)?;
    let mut bytes = Vec::new();
    let read = file.take(most).read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|error| AssetError::unreadable(path, describe_error(&error)))
}

/// Reads a file, text or binary, that does not begin with zeros alone.
pub(crate) fn not_blank(path: &Path, limit: u64, watch: Watch<'_>) -> Result<Vec<u8>, AssetError> {
    bytes_if(path, limit, watch, |start| {
        binary_if(path, !start.is_empty() && start.iter().all(|byte| *byte == 0))
    })
}

/// Reads a regular file, whose bytes may be any.
pub(crate) fn bytes(path: &Path, limit: u64, watch: Watch<'_>) -> Result<Vec<u8>, AssetError> {
    bytes_if(path, limit, watch, |_| Ok(()))
}

fn binary_if(path: &Path, is_binary: bool) -> Result<(), AssetError> {
    let refused = || AssetError::malformed(path, Some(1), "this is a binary file of another kind");
    if is_binary { Err(refused()) } else { Ok(()) }
}

/// Refuses a file that should be text and begins as UTF-16 does. Numbers of 16 bits may look the same: do not call this on files
/// that may be binary.
pub(crate) fn refuse_utf16(path: &Path, start: &[u8]) -> Result<(), AssetError> {
    let refused = || AssetError::malformed(path, Some(1), "this is text in UTF-16; save it as UTF-8");
    if is_utf16(start) { Err(refused()) } else { Ok(()) }
}

/// Whether a file begins as text in UTF-16 does: two letters, each beside a byte 0, behind a mark or not.
fn is_utf16(start: &[u8]) -> bool {
    let start = start.strip_prefix(b"\xff\xfe").or(start.strip_prefix(b"\xfe\xff")).unwrap_or(start);
    let is_letter = |byte: &u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    match start {
        [a, 0, b, 0, ..] | [0, a, 0, b, ..] => is_letter(a) && is_letter(b),
        _ => false,
    }
}

/// Reads a regular file if its first [`START`] bytes are accepted. Progress counts bytes out of `2·length`: the second
/// half is the parser's.
fn bytes_if(
    path: &Path,
    limit: u64,
    watch: Watch<'_>,
    accept: impl Fn(&[u8]) -> Result<(), AssetError>,
) -> Result<Vec<u8>, AssetError> {
    let (mut file, length) = open(path, limit)?;
    let unreadable = |error: std::io::Error| AssetError::unreadable(path, describe_error(&error));
    let mut start = Vec::new();
    (&mut file).take(START as u64).read_to_end(&mut start).map_err(unreadable)?;
    accept(&start)?;
    file.rewind().map_err(unreadable)?;
    rest(path, file, (length, limit), watch)
}

/// Reads the rest of an open file, whose length is expected to be `length`. Progress counts as for [`bytes`].
pub(crate) fn rest(
    path: &Path,
    file: File,
    (length, limit): (u64, u64),
    watch: Watch<'_>,
) -> Result<Vec<u8>, AssetError> {
    let unreadable = |error: std::io::Error| AssetError::unreadable(path, describe_error(&error));
    let mut file = file.take(limit);
    let length = length as usize;
    let mut bytes = Vec::new();
    let out_of_memory = |_| AssetError::OutOfMemory { path: path.to_owned(), bytes: length };
    bytes.try_reserve_exact(length + 1).map_err(out_of_memory)?;
    loop {
        watch.tick(bytes.len().min(length), 2 * length)?;
        let got = (&mut file).take(CHUNK as u64).read_to_end(&mut bytes).map_err(unreadable)?;
        if got == 0 {
            return Ok(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ignore_progress;
    use std::fs;
    use std::sync::Mutex;

    fn watch(token: &CancelToken) -> Watch<'_> {
        Watch { progress: &ignore_progress, token }
    }

    #[test]
    fn what_is_no_file_is_refused_in_words() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let says = |path: &Path| bytes(path, 100, watch(&token)).expect_err("refused").to_string();
        assert!(says(folder.path()).contains("folder"));
        assert!(says(&folder.path().join("none.obj")).contains("none.obj: no such file"));
        let long = folder.path().join("long");
        fs::write(&long, [0; 101]).expect("written");
        assert!(says(&long).contains("101 bytes"));
    }

    #[test]
    fn what_is_binary_is_told_by_its_start() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("zeros");
        // 3 TiB without content: reading them would take an hour.
        File::create(&path).and_then(|file| file.set_len(3 << 40)).expect("a sparse file");
        for read in [text, lettered] {
            let error = read(&path, u64::MAX, watch(&token)).expect_err("refused").to_string();
            assert!(error.ends_with("zeros:1: this is a binary file of another kind"), "{error}");
        }
        fs::write(&path, b"ply\n\0").expect("written");
        assert!(text(&path, 100, watch(&token)).is_err());
        assert_eq!(lettered(&path, 100, watch(&token)).expect("read"), b"ply\n\0");
        fs::write(&path, b"").expect("written");
        assert_eq!(text(&path, 100, watch(&token)).expect("read"), b"");
    }

    #[test]
    fn text_in_utf16_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("wide");
        for mark in ["", "\u{feff}"] {
            let words = || format!("{mark}v 0 0 0\n");
            let little: Vec<u8> = words().encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = words().encode_utf16().flat_map(u16::to_be_bytes).collect();
            for bytes in [little, big] {
                fs::write(&path, bytes).expect("written");
                for read in [text, lettered] {
                    let error = read(&path, u64::MAX, watch(&token)).expect_err("refused").to_string();
                    assert!(error.ends_with("wide:1: this is text in UTF-16; save it as UTF-8"), "{error}");
                }
            }
        }
    }

    #[test]
    fn binary_files_may_begin_as_utf16_does() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("numbers");
        for numbers in [[33_u16, 126, 40], [0xfeff, 65, 66]] {
            let content: Vec<u8> = numbers.into_iter().flat_map(u16::to_le_bytes).collect();
            fs::write(&path, &content).expect("written");
            for read in [bytes, not_blank] {
                assert_eq!(read(&path, 100, watch(&token)).expect("numbers"), content);
            }
        }
    }

    #[test]
    fn pointers_of_git_lfs_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let path = folder.path().join("pointer");
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";
        fs::write(&path, pointer).expect("written");
        for read in [text, lettered, not_blank, bytes] {
            let error = read(&path, 1 << 20, watch(&token)).expect_err("no content").to_string();
            assert!(
                error.ends_with("Git LFS pointer, not the file's content: run `git lfs pull`"),
                "{error}"
            );
        }
        fs::write(&path, format!("{pointer}{}", "x".repeat(1024))).expect("written");
        assert!(bytes(&path, 1 << 20, watch(&token)).is_ok(), "pointers are short");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_loops_do_not_block() {
        let folder = tempfile::tempdir().expect("a folder");
        let token = CancelToken::new();
        let says = |path: &Path| bytes(path, 100, watch(&token)).expect_err("refused").to_string();
        let pipe = folder.path().join("pipe");
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
        assert!(says(&pipe).contains("pipe"));
        assert!(says(Path::new("/dev/zero")).contains("device"));
        #[cfg(target_os = "linux")]
        assert!(says(Path::new("/proc/kmsg")).contains("kernel file"));
        let turn = folder.path().join("turn");
        std::os::unix::fs::symlink(&turn, &turn).expect("a link");
        assert!(says(&turn).contains("symbolic links form a loop"), "{}", says(&turn));
    }

    #[test]
    fn reading_reports_and_stops() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("some");
        fs::write(&path, vec![7; 3 * CHUNK]).expect("written");
        let seen = Mutex::new(Vec::new());
        let token = CancelToken::new();
        let note = |done, total| {
            seen.lock().expect("no panic").push((done, total));
            if done >= 2 * CHUNK as u64 {
                token.cancel();
            }
        };
        let result = bytes(&path, u64::MAX, Watch { progress: &note, token: &token });
        assert!(matches!(result, Err(AssetError::Cancelled(_))));
        let total = 6 * CHUNK as u64;
        let expected: Vec<_> = (0..3).map(|chunk| (chunk * CHUNK as u64, total)).collect();
        assert_eq!(*seen.lock().expect("no panic"), expected);
    }
}
