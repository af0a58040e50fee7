//! Reads scene files without blocking, and limits the memory used.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, SourceSpan};
use super::nearest::nearest_name;
use super::other_content::{NEW_SCENE_HELP, NonSceneContent, detect_image_or_part_file, has_toml_extension};
use super::sanitize::escape_invisible_chars;
use super::{MAX_FILE_BYTES, MAX_PARTS, SCENE_NOT_FOUND};
use crate::system::file::{self, FileKind};
use crate::system::{RAISE_FILE_LIMIT, describe_io_error, folder, is_too_many_open_files};

/// Error message for binary files.
const NOT_TEXT: &str = "this is a binary file, not a scene";
/// Error message for dangling symbolic links.
const DANGLING_LINK: &str = "this is a symbolic link to a file that does not exist";
/// Error message and hint for files not downloaded by Git LFS.
const LFS_POINTER: &str = "this is a Git LFS pointer, not the file's contents";
const LFS_HELP: &str = "run `git lfs pull`";

/// Reads the text of a scene file.
pub(super) fn read_scene_text(path: &Path) -> Result<Arc<str>, Box<Diagnostic>> {
    let bytes = read_bytes(path).map_err(|(message, help)| {
        // Report a large image as an image rather than as a large scene.
        detect_image_or_part_file(path)
            .map_or_else(|| Diagnostic::error_in_file(path, message, help, None), |(_, problem)| problem)
    })?;
    if file::is_lfs_pointer(&bytes) {
        return Err(Diagnostic::error_in_file(path, LFS_POINTER.to_owned(), Some(LFS_HELP.to_owned()), None));
    }
    if let Some(content) = NonSceneContent::detect(&bytes) {
        return Err(content.to_diagnostic(path));
    }
    if bytes.contains(&0) || bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(binary_file_error(path));
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text.into()),
        Err(error) => Err(not_utf8_error(path, error.as_bytes(), error.utf8_error().valid_up_to())),
    }
}

/// Creates the error for a binary file.
pub(super) fn binary_file_error(path: &Path) -> Box<Diagnostic> {
    Diagnostic::error_in_file(
        path,
        NOT_TEXT.to_owned(),
        Some(format!("a scene is a TOML file in UTF-8; {NEW_SCENE_HELP}")),
        None,
    )
}

/// Whether the first bytes of a file contain the `[camera]` header of a scene file. Comments in the formats
/// of other renderers may mention it.
fn has_camera_header(path: &Path, start: &[u8]) -> bool {
    const HEADER: &[u8] = b"[camera]";
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    if extension != "xml" && extension != "pbrt" {
        return memchr::memmem::find(start, HEADER).is_some();
    }
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    !start.trim_ascii_start().starts_with(b"<")
        && start.split(|byte| *byte == b'\n').any(|line| line.trim_ascii_end() == HEADER)
}

/// Whether a file is readable and has no `[camera]` header near its start, and therefore is not a scene file.
pub fn lacks_camera_header(path: &Path) -> bool {
    const START: u64 = 1 << 16;
    let start = || {
        let (file, _) = file::open_regular_file(path).ok()?.ok()?;
        let mut bytes = Vec::new();
        file.take(START).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    };
    start().is_some_and(|bytes| !has_camera_header(path, &bytes))
}

fn not_utf8_error(path: &Path, bytes: &[u8], offset: usize) -> Box<Diagnostic> {
    let source: Arc<str> = String::from_utf8_lossy(bytes).into();
    let line = bytes[..offset].iter().filter(|byte| **byte == b'\n').count() + 1;
    let message = format!("line {line} is not UTF-8 text: byte 0x{:02x} at offset {offset}", bytes[offset]);
    let span = offset..offset + char::REPLACEMENT_CHARACTER.len_utf8();
    let label = "not a UTF-8 character".to_owned();
    let help = Some("save the file as UTF-8".to_owned());
    Diagnostic::error_in_file(path, message, help, Some(SourceSpan { source, span, label }))
}

type RefusalMessageAndHelp = (String, Option<String>);

fn read_bytes(path: &Path) -> Result<Vec<u8>, RefusalMessageAndHelp> {
    let unreadable = |error: io::Error| unreadable_refusal(path, &error);
    let (file, metadata) = file::open_regular_file(path).map_err(unreadable)?.map_err(not_regular_refusal)?;
    if metadata.len() > MAX_FILE_BYTES {
        return Err(too_large_refusal());
    }
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(too_large_refusal());
    }
    if count_syntax_elements(&bytes) > MAX_PARTS {
        return Err(refusal_advising_separate_mesh_files(format!(
            "the scene file has more than {} million syntax elements",
            MAX_PARTS >> 20
        )));
    }
    Ok(bytes)
}

/// Counts the syntax elements, which determine the memory used by the parsed document.
fn count_syntax_elements(text: &[u8]) -> usize {
    text.iter().filter(|byte| b"[]{}=,\n".contains(byte)).count()
}

fn not_regular_refusal(kind: FileKind) -> RefusalMessageAndHelp {
    let help = match kind {
        FileKind::Folder => "pass a scene file, such as scene.toml",
        FileKind::Regular | FileKind::Special | FileKind::Kernel => {
            "glimt reads scenes only from regular files, so that it can watch them"
        }
    };
    (format!("this is {}, not a scene file", kind.description()), Some(help.to_owned()))
}

fn too_large_refusal() -> RefusalMessageAndHelp {
    refusal_advising_separate_mesh_files(format!(
        "the scene file is larger than {} MiB",
        MAX_FILE_BYTES >> 20
    ))
}

fn refusal_advising_separate_mesh_files(message: String) -> RefusalMessageAndHelp {
    (message, Some("put large geometry in mesh files and reference them with [[mesh]]".to_owned()))
}

fn unreadable_refusal(path: &Path, error: &io::Error) -> RefusalMessageAndHelp {
    if error.kind() == io::ErrorKind::NotFound && is_symlink(path) {
        return (DANGLING_LINK.to_owned(), None);
    }
    if error.kind() == io::ErrorKind::NotFound {
        let help = missing_file_help(path, has_toml_extension).unwrap_or_else(|| NEW_SCENE_HELP.to_owned());
        return (SCENE_NOT_FOUND.to_owned(), Some(help));
    }
    let help = is_too_many_open_files(error).then(|| RAISE_FILE_LIMIT.to_owned());
    (format!("cannot read the scene file: {}", describe_io_error(error)), help)
}

/// Returns the help text for a missing file: the missing folder, or a file with a similar name among those
/// accepted by `may_be_meant`.
pub fn missing_file_help(path: &Path, may_be_meant: impl Fn(&Path) -> bool) -> Option<String> {
    let shown = |path: &Path| escape_invisible_chars(&path.to_string_lossy()).into_owned();
    match path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists()) {
        Some(folder) => Some(format!("the folder {} does not exist", shown(folder))),
        None => similar_file(path, may_be_meant).map(|near| format!("did you mean {}?", shown(&near))),
    }
}

/// Maximum number of files to examine per folder.
pub(super) const MAX_FOLDER_FILES: usize = 2_000;

/// Finds the file with the most similar name in a missing file's folder. Considers only files accepted by
/// `may_be_meant`.
pub(super) fn similar_file(path: &Path, may_be_meant: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let parent = path.parent()?;
    let listed = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let names: Vec<String> = folder::entry_names(listed)
        .ok()?
        .take(MAX_FOLDER_FILES)
        .filter_map(|name| name.into_string().ok())
        .filter(|name| shares_stem_or_extension(Path::new(name), path) && may_be_meant(Path::new(name)))
        .filter(|name| matches!(file::file_kind_and_metadata(&parent.join(name)), Ok((FileKind::Regular, _))))
        .collect();
    let near = nearest_name(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(parent.join(near))
}

/// Finds the new path of a missing scene file that was probably renamed: a file with the same text in the
/// same folder.
pub fn find_renamed_scene_by_text(path: &Path, text: &str) -> Option<PathBuf> {
    let parent = path.parent()?;
    let listed = if parent.as_os_str().is_empty() { Path::new(".") } else { parent };
    let length = u64::try_from(text.len()).ok()?;
    let has_text = |file: &PathBuf| {
        matches!(file::file_kind_and_metadata(file), Ok((FileKind::Regular, metadata)) if metadata.len() == length)
            && read_bytes(file).is_ok_and(|bytes| bytes == text.as_bytes())
    };
    let names = folder::entry_names(listed).ok()?.take(MAX_FOLDER_FILES);
    let named = |name| parent.join::<std::ffi::OsString>(name);
    // The order of files in a folder depends on the file system. Use the first by name.
    names.map(named).filter(|file| file != path && has_text(file)).min()
}

/// Whether two file names differ, but have the same extension or the same stem.
fn shares_stem_or_extension(found: &Path, meant: &Path) -> bool {
    found.file_name() != meant.file_name()
        && (found.extension() == meant.extension() || found.file_stem() == meant.file_stem())
}

/// Whether a path is a symbolic link, even a dangling one.
pub(super) fn is_symlink(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    fn message(path: &Path) -> Diagnostic {
        *read_scene_text(path).expect_err("a diagnostic")
    }

    #[test]
    fn renamed_scenes_are_found_by_text() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str| folder.path().join(name);
        let write = |name: &str, text: &str| std::fs::write(file(name), text).expect("written");
        let found = || find_renamed_scene_by_text(&file("first.toml"), "a = 1\n");
        assert_eq!(found(), None);
        write("other.toml", "a = 2\n");
        write("longer.toml", "a = 1\n\n");
        std::fs::create_dir(file("folder.toml")).expect("a folder");
        assert_eq!(found(), None);
        write("third", "a = 1\n");
        assert_eq!(found(), Some(file("third")));
        write("second.toml", "a = 1\n");
        assert_eq!(found(), Some(file("second.toml")), "expected the first file by name");
    }

    #[test]
    fn special_files_are_rejected_without_blocking() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(message(folder.path()).message.contains("folder"));
        assert!(message(Path::new("/dev/zero")).message.contains("device"));
        let pipe = folder.path().join("pipe");
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
        assert!(message(&pipe).message.contains("pipe"));
        #[cfg(target_os = "linux")]
        assert!(message(Path::new("/proc/kmsg")).message.contains("kernel file"));
        let circle = folder.path().join("circle.toml");
        std::os::unix::fs::symlink(&circle, &circle).expect("a link");
        assert!(message(&circle).message.contains("form a loop"));
    }

    #[test]
    fn missing_files_suggest_similar_names() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("cornell.toml"), "").expect("written");
        let missing = message(&folder.path().join("cornel.toml"));
        assert_eq!(missing.message, SCENE_NOT_FOUND);
        assert!(missing.help.expect("a help text").contains("cornell.toml"));
        let other_kind = message(&folder.path().join("cornels.tom"));
        assert!(other_kind.help.expect("a help text").contains("glimt new"));
        let dangling = folder.path().join("link.toml");
        std::os::unix::fs::symlink(folder.path().join("gone"), &dangling).expect("a link");
        assert_eq!(message(&dangling).message, DANGLING_LINK);
        // Folders, dangling links and pipes are not suggested.
        std::fs::create_dir(folder.path().join("hall.toml")).expect("made");
        std::os::unix::fs::symlink(folder.path().join("gone"), folder.path().join("halls.toml"))
            .expect("a link");
        let not_regular = message(&folder.path().join("hal.toml"));
        assert!(not_regular.help.expect("a help text").contains("glimt new"));
        // Images are not suggested.
        std::fs::write(folder.path().join("my_hall.png"), "").expect("written");
        let picture = message(&folder.path().join("my_hall.toml"));
        assert!(picture.help.expect("a help text").contains("glimt new"));
        let lonely = message(&folder.path().join("zebra"));
        assert!(lonely.help.expect("a help text").contains("glimt new"));
    }

    #[test]
    fn comments_in_other_formats_are_not_headers() {
        let xml = "\u{feff}<scene>\n<!--\n[camera]\n-->\n</scene>";
        let cases = [
            ("a.xml", xml, false),
            ("a.pbrt", "# like [camera] in glimt\n", false),
            ("a.pbrt", "#[camera]\n", false),
            ("a.XML", "name = 1\n[camera]\r\n", true),
            ("a.toml", "  [camera] # the view\n", true),
        ];
        for (name, text, is_scene) in cases {
            assert_eq!(has_camera_header(Path::new(name), text.as_bytes()), is_scene, "{name}: {text}");
        }
    }

    #[test]
    fn git_lfs_pointers_are_recognized() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 9\n")
            .expect("written");
        let Diagnostic { message, help, .. } = message(&path);
        assert_eq!((message.as_str(), help.as_deref()), (LFS_POINTER, Some(LFS_HELP)));
    }

    #[test]
    fn size_and_encoding_are_checked() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        let file = File::create(&path).expect("a file");
        file.set_len(MAX_FILE_BYTES + 1).expect("grown");
        assert!(message(&path).message.contains("128 MiB"));
        std::fs::write(&path, "x=[[],[]]\n".repeat(MAX_PARTS / 7)).expect("written");
        assert!(message(&path).message.contains("32 million"));
        std::fs::write(&path, b"# fine\nname = \"\xe4\"\n").expect("written");
        let encoding = message(&path);
        assert!(encoding.message.contains("line 2"), "{}", encoding.message);
        assert!(encoding.message.contains("0xe4"));
        assert_eq!(encoding.place.expect("a place").span.start, 15);
        std::fs::write(&path, b"\x7fELF\0\0").expect("written");
        assert!(message(&path).message.contains("binary"));
    }
}
