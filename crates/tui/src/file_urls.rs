//! Addresses of files, for links.

use std::fmt::Write as _;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// The place that relative paths begin at, and the machine: a terminal may be on another one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FileUrls {
    folder: PathBuf,
    host: String,
}

impl FileUrls {
    /// The files of this process, on this machine.
    pub(super) fn here() -> Self {
        // Elsewhere than on Linux, no name stands for the machine that the terminal is on.
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Self { folder: std::env::current_dir().unwrap_or_default(), host: host.trim().to_owned() }
    }

    /// `file://host/path` (RFC 8089).
    pub(super) fn address(&self, path: &Path) -> String {
        let mut address = format!("file://{}", quoted(self.host.as_bytes()));
        address += &quoted(self.folder.join(path).as_os_str().as_bytes());
        address
    }
}

/// Bytes as they may stand in an address (RFC 3986): all but letters, digits, `-._~` and the slash by their codes.
fn quoted(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len());
    for byte in bytes {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                text.push(char::from(*byte));
            }
            other => {
                // Writing to memory does not fail.
                let _ = write!(text, "%{other:02X}");
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_become_addresses() {
        let files = FileUrls { folder: "/home/ä".into(), host: "box".to_owned() };
        assert_eq!(files.address(Path::new("a b;%.png")), "file://box/home/%C3%A4/a%20b%3B%25.png");
        assert_eq!(files.address(Path::new("/tmp/x.png")), "file://box/tmp/x.png");
        assert_eq!(files.address(Path::new("\u{1b}\u{7}")), "file://box/home/%C3%A4/%1B%07");
    }
}
