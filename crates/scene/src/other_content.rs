//! Recognizes models, images, image parts and checkpoints that are passed instead of a scene by their first
//! bytes.

use std::io::Read;
use std::path::Path;

use super::diagnostic::Diagnostic;
use super::sanitize::escape_invisible_chars;
use crate::system::file::{self, PART_MAGIC};

/// Hint for errors about files that are not scenes.
pub const NEW_SCENE_HELP: &str = "`glimt new FILE` writes a scene to start from";

/// Whether a path has a scene file's extension.
pub fn has_toml_extension(found: &Path) -> bool {
    found.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Contents of a file that is not a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NonSceneContent {
    /// A model, with its format and its usual extension.
    Model { format: &'static str, ending: &'static str },
    /// An image in this format.
    Image(&'static str),
    /// An image part or a checkpoint.
    Part,
}

/// Checks whether a file is an image, an image part or a checkpoint, regardless of its name. Returns its
/// format and an error, or `None` for other or unreadable files.
pub fn detect_image_or_part_file(path: &Path) -> Option<(&'static str, Box<Diagnostic>)> {
    const START: u64 = 1 << 10;
    let (opened, _) = file::open_regular_file(path).ok()?.ok()?;
    let mut bytes = Vec::new();
    opened.take(START).read_to_end(&mut bytes).ok()?;
    match NonSceneContent::detect(&bytes)? {
        NonSceneContent::Model { .. } => None,
        content @ NonSceneContent::Image(format) => Some((format, content.to_diagnostic(path))),
        content @ NonSceneContent::Part => Some(("part", content.to_diagnostic(path))),
    }
}

impl NonSceneContent {
    /// Detects the content type from the first bytes. Returns `None` if the file may be a scene.
    pub(super) fn detect(bytes: &[u8]) -> Option<Self> {
        if bytes.starts_with(&PART_MAGIC) {
            return Some(Self::Part);
        }
        image_format(bytes).map(Self::Image).or_else(|| detect_model(bytes))
    }

    /// Returns the error for a file that has these contents and is therefore not a scene.
    pub(super) fn to_diagnostic(self, path: &Path) -> Box<Diagnostic> {
        // Remove the extension `.toml`.
        let name = if has_toml_extension(path) { path.file_stem() } else { path.file_name() };
        let name = name.unwrap_or(path.as_os_str()).to_string_lossy();
        let (message, help) = match self {
            Self::Model { format, ending } => (
                format!("this is a model ({format}), but its extension is not .{ending}"),
                format!(
                    "glimt detects models by their extension: rename it to {}.{ending}",
                    escape_invisible_chars(&name)
                ),
            ),
            Self::Image(format) => {
                let help = format!("`glimt info` shows how an image was rendered; {NEW_SCENE_HELP}");
                (format!("this is an image ({format}), not a scene"), help)
            }
            Self::Part => (
                "this is an image part or a checkpoint, not a scene".to_owned(),
                "`glimt info` shows which scene it belongs to; `glimt merge` merges parts".to_owned(),
            ),
        };
        Diagnostic::error_in_file(path, message, Some(help), None)
    }
}

/// Returns an image's format, or `None` if the file is not an image.
fn image_format(bytes: &[u8]) -> Option<&'static str> {
    const STARTS: [(&[u8], &str); 9] = [
        (b"\x89PNG\r\n", "PNG"),
        (b"\xff\xd8\xff", "JPEG"),
        (b"\x76\x2f\x31\x01", "EXR"),
        (b"#?RADIANCE", "HDR"),
        (b"#?RGBE", "HDR"),
        (b"GIF87a", "GIF"),
        (b"GIF89a", "GIF"),
        (b"II*\0", "TIFF"),
        (b"MM\0*", "TIFF"),
    ];
    let known = STARTS.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, format)| *format);
    match bytes {
        _ if known.is_some() => known,
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("WebP"),
        // If `=` follows, this is not a PPM file: `P6` is a TOML key.
        [b'P', b'1'..=b'7', b' ' | b'\t' | b'\r' | b'\n', rest @ ..]
            if !starts_with_byte_after_whitespace(rest, b'=') =>
        {
            Some("PPM")
        }
        // The reserved bytes of a BMP header are 0, which does not occur in text.
        [b'B', b'M', _, _, _, _, 0, 0, 0, 0, ..] => Some("BMP"),
        _ => is_tga(bytes).then_some("TGA"),
    }
}

/// Whether the first byte after leading whitespace is `byte`.
fn starts_with_byte_after_whitespace(bytes: &[u8], byte: u8) -> bool {
    bytes.trim_ascii_start().first() == Some(&byte)
}

/// Whether `bytes` start with a TGA header. TGA has no magic number, so all fields must be valid. At least
/// one of the bytes in a valid header never occurs in text.
fn is_tga(bytes: &[u8]) -> bool {
    let &[_, map, kind, first0, first1, count0, count1, depth, _, _, _, _, w0, w1, h0, h1, bits, ..] = bytes
    else {
        return false;
    };
    let is_mapped = matches!(kind, 1 | 9);
    let has_map = map == 1 && matches!(depth, 15 | 16 | 24 | 32);
    let has_none = map == 0 && [first0, first1, count0, count1, depth] == [0; 5];
    let is_kind = matches!(kind, 1..=3 | 9..=11) && if is_mapped { has_map } else { has_map || has_none };
    is_kind && [w0, w1] != [0; 2] && [h0, h1] != [0; 2] && matches!(bits, 8 | 15 | 16 | 24 | 32)
}

/// Detects a model from the first line that is not a comment.
fn detect_model(bytes: &[u8]) -> Option<NonSceneContent> {
    if bytes.starts_with(b"glTF") {
        return Some(NonSceneContent::Model { format: "glTF", ending: "glb" });
    }
    let mut lines = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let line = lines.find(|line| !line.is_empty() && !line.starts_with(b"#"))?;
    let mut words = line.split(u8::is_ascii_whitespace);
    let (word, next) = (words.next()?, words.next());
    // This is TOML if there is an equals sign.
    if line.contains(&b'=') {
        return None;
    }
    let (format, ending) = match (word, next) {
        (b"ply", None) => ("PLY", "ply"),
        (b"OFF" | b"COFF" | b"NOFF" | b"CNOFF" | b"STOFF", _) => ("OFF", "off"),
        (b"solid", _) => ("STL", "stl"),
        (b"v" | b"vn" | b"vt" | b"mtllib" | b"usemtl" | b"o" | b"g", Some(_)) => ("OBJ", "obj"),
        _ => return None,
    };
    Some(NonSceneContent::Model { format, ending })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_recognized_by_magic_bytes() {
        let mut tga = vec![0; 18];
        (tga[2], tga[12], tga[14], tga[16]) = (2, 4, 4, 24);
        let images: [(&[u8], &str); 13] = [
            (b"\x89PNG\r\n\x1a\n", "PNG"),
            (b"\xff\xd8\xff\xe0", "JPEG"),
            (b"\x76\x2f\x31\x01\x02", "EXR"),
            (b"#?RADIANCE\n", "HDR"),
            (b"#?RGBE\n", "HDR"),
            (b"GIF89a\0", "GIF"),
            (b"RIFF\x04\0\0\0WEBPVP8L", "WebP"),
            (b"P6\n1 1\n255\nabc", "PPM"),
            (b"P3 1 1 255 1 2 3", "PPM"),
            (b"P5\t", "PPM"),
            (b"BM\x46\0\0\0\0\0\0\0\x36", "BMP"),
            (b"II*\0", "TIFF"),
            (&tga, "TGA"),
        ];
        for (bytes, format) in images {
            assert_eq!(NonSceneContent::detect(bytes), Some(NonSceneContent::Image(format)), "{format}");
        }
        for scene in
            ["P6 = 3", "P6\n= 3", "BM = 1", "GIF8 = 1", "RIFF = 1", "# P6\n[camera]", "#? what\n", "", "P6"]
        {
            assert_eq!(NonSceneContent::detect(scene.as_bytes()), None, "{scene:?}");
        }
    }

    #[test]
    fn parts_and_large_images_are_recognized() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        std::fs::write(&path, PART_MAGIC).expect("written");
        let part = super::super::read_scene_file_text(&path).expect_err("an error");
        assert_eq!(part, NonSceneContent::Part.to_diagnostic(&path));
        assert_eq!(detect_image_or_part_file(&path), Some(("part", part)));
        std::fs::write(&path, b"\x76\x2f\x31\x01").expect("written");
        let file = std::fs::File::options().write(true).open(&path).expect("opened");
        file.set_len(super::super::MAX_FILE_BYTES + 1).expect("made longer");
        let large = super::super::read_scene_file_text(&path).expect_err("an error");
        assert_eq!(large, NonSceneContent::Image("EXR").to_diagnostic(&path));
        std::fs::write(&path, b"v 0 0 0\n").expect("written");
        assert_eq!(detect_image_or_part_file(&path), None, "models are rendered");
    }

    #[test]
    fn models_are_recognized_by_content() {
        let of = |text: &str| NonSceneContent::detect(text.as_bytes());
        let ending = |text: &str| match of(text) {
            Some(NonSceneContent::Model { ending, .. }) => ending,
            Some(NonSceneContent::Image(_) | NonSceneContent::Part) => "image",
            None => "",
        };
        for (text, expected) in [
            ("# by a program\n\nmtllib a.mtl\nv 0 0 0\n", "obj"),
            ("v 0 0 0\r\n", "obj"),
            ("ply\r\nformat ascii 1.0\r\n", "ply"),
            ("OFF\n3 1 0\n", "off"),
            ("OFF 3 1 0\n", "off"),
            ("solid \nfacet", "stl"),
            ("glTF\u{2}\0\0\0", "glb"),
            ("P6\n1 1\n255\nabc", "image"),
            ("#?RADIANCE\n", "image"),
            ("# a scene\n[camera]\n", ""),
            ("v = 3\n", ""),
            ("solid = true\n", ""),
            ("g \"x\" = 3", ""),
            ("v\n", ""),
            ("", ""),
            ("[render", ""),
        ] {
            assert_eq!(ending(text), expected, "{text:?}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("model");
        std::fs::write(&path, "v 0 0 0\n").expect("written");
        let error = super::super::read_scene_file_text(&path).expect_err("an error");
        assert_eq!(error, NonSceneContent::Model { format: "OBJ", ending: "obj" }.to_diagnostic(&path));
        assert!(error.help.expect("a help text").contains("model.obj"));
    }
}
