//! `file:` URLs for hyperlinks.

use std::fmt::Write as _;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// The base directory for relative paths, and the host name, which is needed because the terminal may run on
/// another machine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FileUrlBuilder {
    folder: PathBuf,
    host: String,
}

impl FileUrlBuilder {
    /// URLs of files on this machine.
    pub(super) fn for_this_machine() -> Self {
        // This file exists only on Linux. On other systems, the host name is omitted.
        let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
        Self { folder: std::env::current_dir().unwrap_or_default(), host: host.trim().to_owned() }
    }

    /// The URL of a file, in the form `file://host/path` (RFC 8089).
    pub(super) fn url(&self, path: &Path) -> String {
        let mut address = format!("file://{}", percent_encode(self.host.as_bytes()));
        address += &percent_encode(self.folder.join(path).as_os_str().as_bytes());
        address
    }
}

/// Percent-encodes everything except unreserved characters and slashes (RFC 3986).
fn percent_encode(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len());
    for byte in bytes {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                text.push(char::from(*byte));
            }
            other => {
                // Writing to a string cannot fail.
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
    fn paths_become_file_urls() {
        let files = FileUrlBuilder { folder: "/home/ä".into(), host: "box".to_owned() };
        assert_eq!(files.url(Path::new("a b;%.png")), "file://box/home/%C3%A4/a%20b%3B%25.png");
        assert_eq!(files.url(Path::new("/tmp/x.png")), "file://box/tmp/x.png");
        assert_eq!(files.url(Path::new("\u{1b}\u{7}")), "file://box/home/%C3%A4/%1B%07");
    }
}
