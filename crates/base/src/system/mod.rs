//! The operating system: its errors in plain words, characters that a terminal shows, files that have an end, priorities and
//! processor time of threads, the end by abort.

#[allow(unsafe_code)]
pub mod abort;
pub mod file;
pub mod machine;
pub mod priority;
pub mod processor;
pub mod text;
pub mod threads;

use std::io::{Error, ErrorKind};

/// An error of the file system as part of a sentence: in small letters, without its number.
pub fn in_words(error: &Error) -> String {
    #[cfg(unix)]
    if error.raw_os_error() == Some(nix::libc::ELOOP) {
        return "its symbolic links lead in a circle".to_owned();
    }
    match error.kind() {
        ErrorKind::NotADirectory => "a part of its path is a file, not a folder".to_owned(),
        // The system did not refuse this: it never saw the name, which has a zero in it.
        ErrorKind::InvalidInput if error.raw_os_error().is_none() => "that is no name of a file".to_owned(),
        _ => {
            let text = error.to_string();
            let mut letters = text.split(" (os error").next().unwrap_or(&text).chars();
            letters.next().map_or(String::new(), |first| first.to_lowercase().chain(letters).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_no_numbers_and_no_capitals() {
        let said = |number: i32| in_words(&Error::from_raw_os_error(number));
        assert_eq!(said(nix::libc::ENOENT), "no such file or directory");
        assert_eq!(said(nix::libc::EACCES), "permission denied");
        assert_eq!(said(nix::libc::ELOOP), "its symbolic links lead in a circle");
        assert_eq!(said(nix::libc::ENOTDIR), "a part of its path is a file, not a folder");
        let zero = std::fs::metadata("a\0b").expect_err("no name");
        assert_eq!(in_words(&zero), "that is no name of a file");
        assert_eq!(in_words(&Error::other("The disk is on fire")), "the disk is on fire");
    }
}
