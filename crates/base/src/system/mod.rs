//! Operating system access: files, folders, memory limits, threads and their priorities, CPU time, machine
//! identity, error messages, printable characters and abort handling.

#[allow(unsafe_code)]
pub mod abort;
pub mod cpu_time;
pub mod file;
pub mod folder;
pub mod machine;
pub mod memory;
pub mod priority;
pub mod text;
pub mod threads;

use std::io::{Error, ErrorKind};

/// Describes a file-system error for use within a sentence: in lower case and without the error number.
pub fn describe_io_error(error: &Error) -> String {
    #[cfg(unix)]
    if error.raw_os_error() == Some(nix::libc::ELOOP) {
        return "its symbolic links form a loop".to_owned();
    }
    match error.kind() {
        ErrorKind::NotADirectory => "a part of its path is a file, not a folder".to_owned(),
        // The name contains a NUL byte, so it was never passed to the system.
        ErrorKind::InvalidInput if error.raw_os_error().is_none() => {
            "that is not a valid file name".to_owned()
        }
        _ => {
            let text = error.to_string();
            let mut letters = text.split(" (os error").next().unwrap_or(&text).chars();
            letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
        }
    }
}

/// Advice for errors recognized by [`is_too_many_open_files`].
pub const RAISE_FILE_LIMIT: &str = "raise the limit on open files (ulimit -n)";

/// Whether too many files are open in the process or the system. Opening another file would also fail.
pub fn is_too_many_open_files(error: &Error) -> bool {
    matches!(error.raw_os_error(), Some(nix::libc::EMFILE | nix::libc::ENFILE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_messages_have_no_numbers_or_capitals() {
        let said = |number: i32| describe_io_error(&Error::from_raw_os_error(number));
        assert_eq!(said(nix::libc::ENOENT), "no such file or directory");
        assert_eq!(said(nix::libc::EACCES), "permission denied");
        assert_eq!(said(nix::libc::ELOOP), "its symbolic links form a loop");
        assert_eq!(said(nix::libc::ENOTDIR), "a part of its path is a file, not a folder");
        let zero = std::fs::metadata("a\0b").expect_err("no name");
        assert_eq!(describe_io_error(&zero), "that is not a valid file name");
        assert_eq!(describe_io_error(&Error::other("The disk is on fire")), "the disk is on fire");
    }
}
