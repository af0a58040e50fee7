//! Bytes of a scene file, read without ever blocking or filling the memory.

use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Place};
use super::document::is_mesh;
use super::keys::endings::MESHES;
use super::nearest::nearest;
use super::other_content::{OtherContent, may_be_scene, other_content};
use super::sanitize::visible;
use super::{MAX_FILE_BYTES, MAX_PARTS, NO_SUCH_FILE, NO_SUCH_MODEL};
use crate::system::describe_error;
use crate::system::file::{self, FileKind};

/// The text. The error is one diagnostic that names the file.
pub(super) fn text(path: &Path) -> Result<Arc<str>, Box<Diagnostic>> {
    if is_model(path) {
        return Err(mesh(path));
    }
    if is_other_model(path) {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let message = format!("this is a model of a format that glimt does not read: .{ending}");
        let help = format!("export it as one of these: .{}", MESHES.join(", ."));
        return Err(Diagnostic::error(path, message, Some(help), None));
    }
    let bytes = bytes(path).map_err(|(message, help)| {
        // A large image is not a large scene.
        other_content(path).unwrap_or_else(|| Diagnostic::error(path, message, help, None))
    })?;
    if file::is_lfs_pointer(&bytes) {
        let message = "this is a Git LFS pointer, not the file's content".to_owned();
        return Err(Diagnostic::error(path, message, Some("run `git lfs pull`".to_owned()), None));
    }
    if let Some(content) = OtherContent::of(&bytes) {
        return Err(content.problem(path));
    }
    if bytes.contains(&0) || bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(binary(path));
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text.into()),
        Err(error) => Err(not_utf8(path, error.as_bytes(), error.utf8_error().valid_up_to())),
    }
}

/// A file that is no text.
pub(super) fn binary(path: &Path) -> Box<Diagnostic> {
    Diagnostic::error(
        path,
        "this is a binary file, not the text of a scene".to_owned(),
        Some("a scene is TOML, saved as UTF-8; `glimt new FILE` writes one to start from".to_owned()),
        None,
    )
}

/// A mesh in place of a scene, and how to show it.
fn mesh(path: &Path) -> Box<Diagnostic> {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let help = format!(
        "a scene shows it, by a table [[mesh]] with `file = \"{}\"`; `glimt new FILE` writes a scene to start from",
        visible(&name)
    );
    Diagnostic::error(path, "this is a mesh, not a scene".to_owned(), Some(help), None)
}

/// Whether a file is named like a mesh and is no scene all the same, as its start shows. What cannot be read is none.
pub(super) fn is_model(path: &Path) -> bool {
    is_mesh(path) && lacks_camera(path)
}

/// Endings of models that glimt does not read.
const OTHER_MODELS: [&str; 22] = [
    "3dm", "3ds", "3mf", "abc", "blend", "c4d", "dae", "fbx", "iges", "igs", "lwo", "ma", "max", "mb",
    "step", "stp", "usd", "usda", "usdc", "usdz", "wrl", "x3d",
];

/// Whether a file is named like a model of another format and does not hold a scene all the same.
fn is_other_model(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    OTHER_MODELS.contains(&ending.as_str()) && lacks_camera(path)
}

/// Whether the start of a file lacks the camera of a scene. False for what cannot be read.
fn lacks_camera(path: &Path) -> bool {
    const START: u64 = 1 << 16;
    let start = || {
        let (file, _) = file::open(path).ok()?.ok()?;
        let mut bytes = Vec::new();
        file.take(START).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    };
    start().is_some_and(|bytes| memchr::memmem::find(&bytes, b"[camera]").is_none())
}

fn not_utf8(path: &Path, bytes: &[u8], offset: usize) -> Box<Diagnostic> {
    let source: Arc<str> = String::from_utf8_lossy(bytes).into();
    let line = bytes[..offset].iter().filter(|byte| **byte == b'\n').count() + 1;
    let message = format!("line {line} is not UTF-8 text: byte 0x{:02x} at offset {offset}", bytes[offset]);
    let span = offset..offset + char::REPLACEMENT_CHARACTER.len_utf8();
    let label = "not a character in UTF-8".to_owned();
    let help = Some("save the file as UTF-8".to_owned());
    Diagnostic::error(path, message, help, Some(Place { source, span, label }))
}

type Refusal = (String, Option<String>);

fn bytes(path: &Path) -> Result<Vec<u8>, Refusal> {
    let unreadable = |error: io::Error| unreadable(path, &error);
    let (file, metadata) = file::open(path).map_err(unreadable)?.map_err(|kind| not_regular(path, kind))?;
    if metadata.len() > MAX_FILE_BYTES {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(too_large());
    }
    if parts(&bytes) > MAX_PARTS {
        return Err(large(format!("the scene file has more than {} million parts", MAX_PARTS >> 20)));
    }
    Ok(bytes)
}

/// Number of the parts with which the memory of a text grows.
fn parts(text: &[u8]) -> usize {
    text.iter().filter(|byte| b"[]{}=,\n".contains(byte)).count()
}

fn not_regular(path: &Path, kind: FileKind) -> Refusal {
    if is_mesh(path) {
        return (format!("this is {}, not a model", kind.words()), None);
    }
    let help = match kind {
        FileKind::Folder => "name a scene file, such as scene.toml",
        FileKind::Regular | FileKind::Special | FileKind::Kernel => {
            "a scene is read from a regular file, so that it can be watched"
        }
    };
    (format!("this is {}, not a scene file", kind.words()), Some(help.to_owned()))
}

fn too_large() -> Refusal {
    large(format!("the scene file is larger than {} MiB", MAX_FILE_BYTES >> 20))
}

fn large(message: String) -> Refusal {
    (message, Some("large geometry belongs in mesh files, which [[mesh]] names".to_owned()))
}

fn unreadable(path: &Path, error: &io::Error) -> Refusal {
    if error.kind() == io::ErrorKind::NotFound && is_link(path) {
        return ("this is a symbolic link to a file that does not exist".to_owned(), None);
    }
    if error.kind() == io::ErrorKind::NotFound {
        let shown = |path: &Path| visible(&path.to_string_lossy()).into_owned();
        let missing = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        let is_model = is_mesh(path);
        let near = neighbour(path, if is_model { is_mesh } else { may_be_scene });
        let help = match (missing, near) {
            (Some(folder), _) => Some(format!("the folder {} does not exist", shown(folder))),
            (None, Some(near)) => Some(format!("did you mean {}?", shown(&near))),
            // A model is not what glimt writes.
            (None, None) if is_model => None,
            (None, None) => Some("`glimt new FILE` writes a scene to start from".to_owned()),
        };
        let message = if is_model { NO_SUCH_MODEL } else { NO_SUCH_FILE };
        return (message.to_owned(), help);
    }
    (format!("cannot read the scene file: {}", describe_error(error)), None)
}

/// Files of a folder that are looked at.
pub(super) const MOST_FILES: usize = 2_000;

/// The file beside a missing one with the nearest name, among those that may be meant.
pub(super) fn neighbour(path: &Path, may_be_meant: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let folder = path.parent()?;
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let names: Vec<String> = std::fs::read_dir(listed)
        .ok()?
        .take(MOST_FILES)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| is_alike(Path::new(name), path) && may_be_meant(Path::new(name)))
        .filter(|name| matches!(file::kind(&folder.join(name)), Ok((FileKind::Regular, _))))
        .collect();
    let near = nearest(path.file_name()?.to_str()?, names.iter().map(String::as_str))?;
    Some(folder.join(near))
}

/// Another file in the folder of a missing scene file that has this text: the scene was renamed.
pub fn same_text_beside(path: &Path, text: &str) -> Option<PathBuf> {
    let folder = path.parent()?;
    let listed = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let length = u64::try_from(text.len()).ok()?;
    let has_text = |file: &PathBuf| {
        matches!(file::kind(file), Ok((FileKind::Regular, metadata)) if metadata.len() == length)
            && bytes(file).is_ok_and(|bytes| bytes == text.as_bytes())
    };
    let names =
        std::fs::read_dir(listed).ok()?.take(MOST_FILES).filter_map(|entry| Some(entry.ok()?.file_name()));
    let named = |name| folder.join::<std::ffi::OsString>(name);
    // The order of a folder is that of its system.
    names.map(named).filter(|file| file != path && has_text(file)).min()
}

/// Whether a file may be meant by another name: of the same kind, or of the same name but for the kind. A link to
/// nowhere is not meant by its own name.
fn is_alike(found: &Path, meant: &Path) -> bool {
    found.file_name() != meant.file_name()
        && (found.extension() == meant.extension() || found.file_stem() == meant.file_stem())
}

/// Whether a name of a missing file is a link.
pub(super) fn is_link(path: &Path) -> bool {
    std::fs::symlink_metadata(path).is_ok_and(|metadata| metadata.is_symlink())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    fn message(path: &Path) -> Diagnostic {
        *text(path).expect_err("a diagnostic")
    }

    #[test]
    fn a_renamed_scene_is_found_by_its_text() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str| folder.path().join(name);
        let write = |name: &str, text: &str| std::fs::write(file(name), text).expect("written");
        let found = || same_text_beside(&file("first.toml"), "a = 1\n");
        assert_eq!(found(), None);
        write("other.toml", "a = 2\n");
        write("longer.toml", "a = 1\n\n");
        std::fs::create_dir(file("folder.toml")).expect("a folder");
        assert_eq!(found(), None);
        write("third", "a = 1\n");
        assert_eq!(found(), Some(file("third")));
        write("second.toml", "a = 1\n");
        assert_eq!(found(), Some(file("second.toml")), "the first by name");
    }

    #[test]
    fn what_is_no_file_is_refused_at_once() {
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
    fn a_missing_file_offers_its_neighbour() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("cornell.toml"), "").expect("written");
        let missing = message(&folder.path().join("cornel.toml"));
        assert!(missing.message.contains("no such scene file"));
        assert!(missing.help.expect("a way out").contains("cornell.toml"));
        let other_kind = message(&folder.path().join("cornels.tom"));
        assert!(other_kind.help.expect("a way out").contains("glimt new"));
        let dangling = folder.path().join("link.toml");
        std::os::unix::fs::symlink(folder.path().join("gone"), &dangling).expect("a link");
        assert!(message(&dangling).message.contains("symbolic link to a file that does not exist"));
        // Nor is a folder, a link that leads nowhere or a pipe.
        std::fs::create_dir(folder.path().join("hall.toml")).expect("made");
        std::os::unix::fs::symlink(folder.path().join("gone"), folder.path().join("halls.toml"))
            .expect("a link");
        let not_regular = message(&folder.path().join("hal.toml"));
        assert!(not_regular.help.expect("a way out").contains("glimt new"));
        // An image does not count as a scene.
        std::fs::write(folder.path().join("my_hall.png"), "").expect("written");
        let picture = message(&folder.path().join("my_hall.toml"));
        assert!(picture.help.expect("a way out").contains("glimt new"));
        // A model is none that glimt writes.
        std::fs::write(folder.path().join("knot.obj"), "").expect("written");
        for (name, help) in [("know.obj", Some("knot.obj")), ("nothing.glb", None), ("cornell.ply", None)] {
            let model = message(&folder.path().join(name));
            assert_eq!(model.message, "there is no such file");
            assert_eq!(model.help.is_some(), help.is_some(), "{name}: {:?}", model.help);
            assert!(
                model.help.is_none_or(|words| words.contains("did you mean") && words.contains("knot.obj"))
            );
        }
        let lonely = message(&folder.path().join("zebra"));
        assert!(lonely.help.expect("a way out").contains("glimt new"));
    }

    #[test]
    fn a_mesh_is_no_scene() {
        let folder = tempfile::tempdir().expect("a folder");
        let contents: [(&str, &[u8]); 3] =
            [("a.obj", b"v 0 0 0\n"), ("b.PLY", b"ply\n"), ("c.glb", b"glTF\0\0")];
        for (name, content) in contents {
            let path = folder.path().join(name);
            std::fs::write(&path, content).expect("written");
            let Diagnostic { message, help, .. } = message(&path);
            assert_eq!(message, "this is a mesh, not a scene");
            assert!(help.expect("a way out").contains(&format!("[[mesh]] with `file = \"{name}\"`")));
        }
        let scene = folder.path().join("scene.obj");
        std::fs::write(&scene, "[camera]\n").expect("written");
        assert!(text(&scene).is_ok());
    }

    #[test]
    fn a_pointer_of_git_lfs_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 9\n")
            .expect("written");
        let said = message(&path);
        assert_eq!(said.message, "this is a Git LFS pointer, not the file's content");
        assert_eq!(said.help.as_deref(), Some("run `git lfs pull`"));
    }

    #[test]
    fn size_and_encoding() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scene.toml");
        let file = File::create(&path).expect("a file");
        file.set_len(MAX_FILE_BYTES + 1).expect("grown");
        assert!(message(&path).message.contains("128 MiB"));
        std::fs::write(&path, "x=[[],[]]\n".repeat(MAX_PARTS / 7)).expect("written");
        assert!(message(&path).message.contains("32 million parts"));
        std::fs::write(&path, b"# fine\nname = \"\xe4\"\n").expect("written");
        let encoding = message(&path);
        assert!(encoding.message.contains("line 2"), "{}", encoding.message);
        assert!(encoding.message.contains("0xe4"));
        assert_eq!(encoding.place.expect("a place").span.start, 15);
        std::fs::write(&path, b"\x7fELF\0\0").expect("written");
        assert!(message(&path).message.contains("binary"));
    }
}
