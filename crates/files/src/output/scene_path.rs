//! The scene path in an image's metadata. It is relative to the image, so that the two can be moved
//! together.

use std::fs;
use std::path::{Component, Path, PathBuf};

use super::resolve_path::directory_of;

/// Returns a scene's path relative to an image, with `/` as the separator. If the scene is in the image's
/// folder, the path starts with `./`. Bare file names are ambiguous, because earlier versions wrote them for
/// scenes in any folder.
pub fn relative_to_image(scene: &Path, image: &Path) -> String {
    let folders = fs::canonicalize(directory_of(scene)).ok().zip(fs::canonicalize(directory_of(image)).ok());
    let (Some(name), Some((to, from))) = (scene.file_name(), folders) else { return lossy_file_name(scene) };
    let shared = to.components().zip(from.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    let down = to.components().skip(shared);
    let path: PathBuf = up.chain(down).collect::<PathBuf>().join(name);
    let names: Vec<_> = path.components().map(|component| component.as_os_str().to_string_lossy()).collect();
    if names.len() == 1 { format!("./{}", names.concat()) } else { names.join("/") }
}

/// Whether the path `named` in an image's metadata refers to this scene.
pub fn metadata_path_refers_to_scene(named: &str, scene: &Path, image: &Path) -> bool {
    if !named.contains('/') {
        return named == lossy_file_name(scene);
    }
    let Ok(scene_file) = fs::canonicalize(scene) else { return named == relative_to_image(scene, image) };
    // The image may be a link. It may have been written through the link's path or through the target's path.
    let target = fs::canonicalize(image).ok();
    [Some(image), target.as_deref()].into_iter().flatten().any(|image| {
        let file = fs::canonicalize(directory_of(image).join(named));
        named == relative_to_image(scene, image) || file.is_ok_and(|file| file == scene_file)
    })
}

/// File name without the folder.
fn lossy_file_name(scene: &Path) -> String {
    scene.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// A folder with some files.
    fn folder(files: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            fs::write(path, file).expect("written");
        }
        folder
    }

    #[test]
    fn paths_are_relative_to_the_image() {
        let folder = folder(&["a/scene.toml", "a/b/x", "c/x"]);
        let at = |path: &str| folder.path().join(path);
        let scene = at("a/scene.toml");
        for (image, expected) in [
            ("a/scene.png", "./scene.toml"),
            ("scene.png", "a/scene.toml"),
            ("a/b/scene.png", "../scene.toml"),
            ("c/scene.png", "../a/scene.toml"),
            ("a/b/../b/../scene.png", "./scene.toml"),
        ] {
            assert_eq!(relative_to_image(&scene, &at(image)), expected, "{image}");
            assert!(metadata_path_refers_to_scene(expected, &scene, &at(image)), "{image}");
            assert!(!metadata_path_refers_to_scene(expected, &at("c/x"), &at(image)), "{image}");
        }
        assert_eq!(
            relative_to_image(&scene, &at("none/scene.png")),
            "scene.toml",
            "the folder does not exist"
        );
    }

    #[test]
    fn bare_names_match_scenes_in_any_folder() {
        let folder = folder(&["a/scene.toml", "b/scene.toml"]);
        let at = |path: &str| folder.path().join(path);
        let (one, other, image) = (at("a/scene.toml"), at("b/scene.toml"), at("scene.png"));
        let named = relative_to_image(&one, &image);
        assert!(
            metadata_path_refers_to_scene(&named, &one, &image)
                && !metadata_path_refers_to_scene(&named, &other, &image)
        );
        assert!(
            metadata_path_refers_to_scene("scene.toml", &one, &image)
                && metadata_path_refers_to_scene("scene.toml", &other, &image)
        );
        assert!(
            !metadata_path_refers_to_scene("room.toml", &one, &image)
                && !metadata_path_refers_to_scene("./scene.toml", &one, &image)
        );
    }

    #[test]
    fn scenes_match_after_linking_and_moving() {
        let folder = folder(&["a/scene.toml", "big/x"]);
        let at = |path: &str| folder.path().join(path);
        // Link to a folder, a scene and an image.
        symlink(at("a"), at("link")).expect("a link");
        symlink(at("a/scene.toml"), at("other.toml")).expect("a link");
        let image = at("scene.png");
        assert!(metadata_path_refers_to_scene(
            &relative_to_image(&at("a/scene.toml"), &image),
            &at("link/scene.toml"),
            &image
        ));
        assert!(metadata_path_refers_to_scene(
            &relative_to_image(&at("a/scene.toml"), &image),
            &at("other.toml"),
            &image
        ));
        assert!(metadata_path_refers_to_scene(
            &relative_to_image(&at("other.toml"), &image),
            &at("a/scene.toml"),
            &image
        ));
        fs::write(at("big/scene.png"), "").expect("written");
        symlink(at("big/scene.png"), &image).expect("a link");
        let scene = at("a/scene.toml");
        assert!(metadata_path_refers_to_scene(&relative_to_image(&scene, &image), &scene, &image));
        assert!(metadata_path_refers_to_scene(
            &relative_to_image(&scene, &at("big/scene.png")),
            &scene,
            &image
        ));
        // Move the scene with the image, then only the scene.
        let named = relative_to_image(&scene, &at("a/scene.png"));
        fs::rename(at("a"), at("moved")).expect("moved");
        assert!(metadata_path_refers_to_scene(&named, &at("moved/scene.toml"), &at("moved/scene.png")));
        fs::create_dir(at("elsewhere")).expect("made");
        fs::rename(at("moved/scene.toml"), at("elsewhere/scene.toml")).expect("moved");
        assert!(!metadata_path_refers_to_scene(&named, &at("elsewhere/scene.toml"), &at("moved/scene.png")));
    }

    #[test]
    fn non_utf8_names_match_themselves() {
        use std::ffi::OsStr;
        use std::os::unix::ffi::OsStrExt;
        let folder = folder(&["x"]);
        let scene = folder.path().join(OsStr::from_bytes(b"sc\xffne.toml"));
        fs::write(&scene, "").expect("written");
        let image = folder.path().join("a.png");
        assert!(metadata_path_refers_to_scene(&relative_to_image(&scene, &image), &scene, &image));
    }
}
