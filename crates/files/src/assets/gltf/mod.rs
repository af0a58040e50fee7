//! glTF 2.0 (Khronos, *glTF 2.0 Specification*): files as JSON or GLB, their parts as meshes, their images, and what they show.
//!
//! A part is a primitive; parts are counted over all meshes from 0.
//!
//! `serde_json` parses the JSON into the types of `json`, `base64` decodes data URIs. The crate `gltf` 1.4 is not used: without its
//! validation it panics at an index out of range, with it it refuses every required extension that it does not know. Its types alone
//! (`gltf-json`) would replace the plain half of `json` only. Clear coats, WebP and Basis images and instancing have no types there and
//! would be read a second time from raw values; extensions are flattened, so that errors in them lose their line; and the text of a
//! data URI stays in memory beside its bytes.

mod accessor;
mod description;
mod json;
mod materials;
mod model;
mod part;
mod whole;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use self::description::{
    Alpha, Glass, ModelCamera, ModelInstance, ModelLight, ModelLightKind, ModelMaterial, ModelScene, Placed,
    Slot, TextureRef, TextureWrap,
};
use self::json::{Root, Uri};
use super::image::{self, ImageEncoding, ImageLimits, ImageWithin};
use super::read::{self, Watch};
use super::{AssetError, Companion, FileHash};
use crate::control::{CancelToken, Progress, ignore_progress};

/// Most bytes of a file, and of all buffers together.
const FILE_LIMIT: u64 = 4 << 30;
/// Most bytes of JSON, data URIs included.
const JSON_LIMIT: usize = 512 << 20;

/// The mark of UTF-8 that some programs write before a text.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// Whether a file is glTF by its name.
pub fn is_gltf(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    ending.eq_ignore_ascii_case("glb") || ending.eq_ignore_ascii_case("gltf")
}

/// Files that a glTF file names: those of its buffers and of its images, used or not. Only the JSON is read.
///
/// # Errors
/// The file cannot be read, or is no glTF.
pub fn files_named(path: &Path) -> Result<Vec<PathBuf>, AssetError> {
    /// Bytes of a GLB file before its JSON (4.4.2): the header, then the length and the kind of the first chunk.
    const BEFORE_JSON: usize = 20;
    let header = read::start(path, BEFORE_JSON as u64)?;
    let (before, length) = match header[..] {
        [b'g', b'l', b'T', b'F', _, _, _, _, _, _, _, _, a, b, c, d, ..] => {
            (BEFORE_JSON, u32::from_le_bytes([a, b, c, d]) as usize)
        }
        _ => (0, JSON_LIMIT),
    };
    let bytes = read::start(path, (before + length.min(JSON_LIMIT)) as u64)?;
    let text = bytes.get(before..).unwrap_or_default();
    let root: Root = serde_json::from_slice(text.strip_prefix(BOM).unwrap_or(text))
        .map_err(|error| AssetError::malformed(path, Some(error.line()), "it is no glTF"))?;
    let mut files = named(path, root.buffers.iter().map(|buffer| &buffer.uri));
    files.extend(named(path, root.images.iter().map(|image| &image.uri)));
    Ok(files)
}

/// Files beside a glTF file that some of these URIs name.
fn named<'u>(path: &Path, uris: impl Iterator<Item = &'u Option<Uri>>) -> Vec<PathBuf> {
    let file = |uri: &Option<Uri>| match uri {
        Some(Uri::File(uri)) => beside(path, uri).ok(),
        Some(Uri::Data(_)) | None => None,
    };
    uris.filter_map(file).collect()
}

/// A fault of a file: a place in the JSON, and the reason.
#[derive(Debug)]
struct Wrong(String);

impl Wrong {
    fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }

    /// An index that leads nowhere.
    fn index(list: &str, index: usize, length: usize) -> Self {
        Self(format!("{list}[{index}] does not exist: there are {length}"))
    }

    /// The same with the place that it was met in.
    fn inside(self, place: impl Into<String>) -> Self {
        Self(format!("{}: {}", place.into(), self.0))
    }
}

/// A text of a file in a message.
fn shown(text: &str) -> String {
    text.chars().take(60).collect()
}

/// An open glTF file with its buffers.
#[derive(Debug)]
pub struct Container {
    path: PathBuf,
    root: Root,
    buffers: Vec<Vec<u8>>,
    /// Files that hold its buffers, read.
    companions: Vec<Companion>,
    hash: FileHash,
    /// For each part the first one with the same mesh, which is built for all of them.
    built_as: Vec<usize>,
}

/// The bytes of an image.
#[derive(Debug, PartialEq)]
pub enum ImageBytes<'a> {
    /// Inside the file.
    Inside(&'a [u8]),
    /// A file of its own.
    File(PathBuf),
}

impl Container {
    /// Opens a file and reads its buffers.
    ///
    /// # Errors
    /// [`AssetError`], with the place in the JSON.
    pub fn open(path: &Path, progress: Progress<'_>, token: &CancelToken) -> Result<Self, AssetError> {
        let watch = Watch { progress, token };
        let bytes = read::not_blank(path, FILE_LIMIT, watch)?;
        read::refuse_utf16(path, &bytes)?;
        let (length, hash) = (bytes.len(), read::hash(&bytes));
        let wrong = |wrong: Wrong| AssetError::malformed(path, None, wrong.0);
        let (json, binary) =
            if bytes.starts_with(b"glTF") { chunks(&bytes).map_err(wrong)? } else { (0..length, None) };
        // Parse the JSON.
        let text = &bytes[json];
        if text.len() > JSON_LIMIT {
            let (has, most) = (text.len().div_ceil(1 << 20), JSON_LIMIT >> 20);
            return Err(wrong(Wrong::new(format!(
                "{has} MiB of JSON, more than the {most} that are read; keep the buffers in .glb or .bin files"
            ))));
        }
        let text = text.strip_prefix(BOM).unwrap_or(text);
        if !text.trim_ascii_start().starts_with(b"{") {
            let reason = if length == 0 {
                "the file is empty"
            } else if bytes.starts_with(b"glTF") {
                "it is no glTF: its JSON is no object"
            } else {
                "it is no glTF: neither GLB nor an object of JSON"
            };
            return Err(AssetError::malformed(path, None, reason));
        }
        let mut root: Root = serde_json::from_slice(text).map_err(|error| {
            if let Some(version) = old_version(text) {
                return wrong(Wrong::new(format!("it is glTF {}; version 2 is read", shown(&version))));
            }
            let what = error.to_string();
            let what = in_words_of_json(what.split(" at line ").next().unwrap_or_default());
            AssetError::malformed(
                path,
                Some(error.line()),
                format!("column {}: {}", error.column(), shown_long(&what)),
            )
        })?;
        check_version(&root).map_err(wrong)?;
        check_required(&root).map_err(wrong)?;
        // Keep the binary chunk, then read what the buffers name.
        let binary = binary.map(|range| {
            let mut bytes = bytes;
            bytes.truncate(range.end);
            bytes.drain(..range.start);
            bytes
        });
        let (buffers, companions) = buffers(path, &mut root, binary, watch)?;
        let mut container =
            Self { path: path.to_owned(), hash, root, buffers, companions, built_as: Vec::new() };
        container.built_as = container.shared_parts().map_err(wrong)?;
        watch.tick(2 * length, 2 * length)?;
        Ok(container)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Files that hold its buffers.
    pub fn companions(&self) -> &[Companion] {
        &self.companions
    }

    /// Hash of the file itself.
    pub fn hash(&self) -> FileHash {
        self.hash
    }

    /// Files that its images name, shown or not.
    pub fn pictures(&self) -> Vec<PathBuf> {
        named(&self.path, self.root.images.iter().map(|image| &image.uri))
    }

    /// The bytes of an image, or the file that holds them.
    ///
    /// # Errors
    /// An image that does not exist, or bytes that are not there.
    pub fn image(&self, number: usize) -> Result<ImageBytes<'_>, AssetError> {
        self.image_bytes(number).map_err(|wrong| self.wrong(wrong.inside(format!("images[{number}]"))))
    }

    /// The bytes of an image, read from its file if it has one.
    ///
    /// # Errors
    /// As for [`Container::image`], and a file that cannot be read.
    pub fn image_content(&self, number: usize, token: &CancelToken) -> Result<Vec<u8>, AssetError> {
        match self.image(number)? {
            ImageBytes::Inside(bytes) => Ok(bytes.to_vec()),
            ImageBytes::File(file) => {
                read::bytes(&file, FILE_LIMIT, Watch { progress: &ignore_progress, token })
            }
        }
    }

    fn image_bytes(&self, number: usize) -> Result<ImageBytes<'_>, Wrong> {
        let images = &self.root.images;
        let image = images.get(number).ok_or_else(|| Wrong::index("images", number, images.len()))?;
        match (&image.uri, image.buffer_view) {
            (Some(Uri::Data(bytes)), _) => Ok(ImageBytes::Inside(bytes)),
            (Some(Uri::File(uri)), _) => Ok(ImageBytes::File(beside(&self.path, uri)?)),
            (None, Some(view)) => {
                let views = &self.root.buffer_views;
                let json = views.get(view).ok_or_else(|| Wrong::index("bufferViews", view, views.len()))?;
                accessor::view_bytes(self, json).map(ImageBytes::Inside)
            }
            (None, None) => Err(Wrong::new("it has neither a URI nor a buffer view")),
        }
    }

    fn wrong(&self, wrong: Wrong) -> AssetError {
        AssetError::malformed(&self.path, None, wrong.0)
    }

    /// The part that is built for a part: the first one with the same mesh.
    pub(super) fn built_as(&self, part: usize) -> usize {
        self.built_as.get(part).copied().unwrap_or(part)
    }

    /// Finds for each part the first one with the same mesh. Refuses files whose other meshes share bytes so often that they
    /// would take many times the file's size.
    fn shared_parts(&self) -> Result<Vec<usize>, Wrong> {
        /// Corners that any file may have.
        const FREE: u64 = 1 << 20;
        let mut first = HashMap::new();
        let mut built_as = Vec::new();
        let mut corners: u64 = 0;
        for primitive in self.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
            let part = built_as.len();
            let is_compressed = primitive.extensions.contains_key(DRACO);
            let sets = self.coordinate_sets(primitive);
            let mesh = (primitive.indices, primitive.mode, is_compressed, sets, &primitive.attributes);
            let first = *first.entry(mesh).or_insert(part);
            built_as.push(first);
            if first == part {
                let list = primitive.indices.or_else(|| primitive.attributes.get("POSITION").copied());
                let count = list.and_then(|list| self.root.accessors.get(list)).map_or(0, |list| list.count);
                corners = corners.saturating_add(primitive.corners_built(count));
            }
        }
        let bytes: u64 = self.buffers.iter().map(|buffer| buffer.len() as u64).sum();
        let most = bytes + FREE;
        if corners > most {
            return Err(Wrong::new(format!(
                "its primitives claim {corners} corners of triangles, and its {bytes} bytes of buffers may have \
                 {most}: one a byte, and {FREE} more"
            )));
        }
        Ok(built_as)
    }

    /// An error about an image, which names the image and this file.
    fn about_image(&self, number: usize, error: AssetError) -> AssetError {
        let place = format!("images[{number}]");
        match error {
            AssetError::Malformed { path, reason, .. } if path == self.path => {
                self.wrong(Wrong::new(reason).inside(place))
            }
            error @ (AssetError::Malformed { .. } | AssetError::Unreadable { .. }) => {
                self.wrong(Wrong::new(error.to_string()).inside(place))
            }
            other @ (AssetError::OutOfMemory { .. } | AssetError::Cancelled(_)) => other,
        }
    }

    /// Refuses an image whose header is wrong, or that is not there.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the index of the image; [`AssetError::Cancelled`].
    pub fn check_image_header(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ImageEncoding::Color);
        let size = match self.image(number)? {
            ImageBytes::File(file) => image::size(&file, encoding, limits, token),
            ImageBytes::Inside(bytes) => {
                let image = ImageWithin { path: &self.path, bytes: bytes.into() };
                image::size_within(image, encoding, limits, token)
            }
        };
        size.map(drop).map_err(|error| self.about_image(number, error))
    }

    /// Refuses an image that cannot be decoded.
    ///
    /// # Errors
    /// As for [`Container::check_image_header`].
    pub fn check_image(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ImageEncoding::Color);
        let texels = match self.image(number)? {
            ImageBytes::File(file) => image::load(&file, encoding, limits, &ignore_progress, token),
            ImageBytes::Inside(bytes) => {
                let image = ImageWithin { path: &self.path, bytes: bytes.into() };
                image::load_within(image, encoding, limits, &ignore_progress, token)
            }
        };
        texels.map(drop).map_err(|error| self.about_image(number, error))
    }
}

/// The compression of meshes that is not read.
const DRACO: &str = "KHR_draco_mesh_compression";

/// The version of a file before glTF 2.0, whose JSON has objects in place of lists. `None` for another file.
fn old_version(text: &[u8]) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct Old {
        asset: json::Asset,
    }
    let Old { asset } = serde_json::from_slice(text).ok()?;
    let is_old = asset.version.starts_with("1.") || asset.version.starts_with("0.");
    is_old.then_some(asset.version)
}

/// A message of the JSON parser with the words of JSON in place of those of Rust.
fn in_words_of_json(message: &str) -> String {
    let Some((before, expected)) = message.rsplit_once(", expected ") else { return message.to_owned() };
    let before = match before.strip_prefix("invalid type: ") {
        Some("map") => "invalid type: object".to_owned(),
        Some("sequence") => "invalid type: array".to_owned(),
        Some(_) | None => before.to_owned(),
    };
    let expected = match expected {
        "usize" | "u64" | "u32" => "a whole number from 0",
        "f64" => "a number",
        "a sequence" => "an array",
        "a map" => "an object",
        other if other.starts_with("struct ") => "an object",
        other => other,
    };
    format!("{before}, expected {expected}")
}

/// A longer text of a parser in a message.
fn shown_long(text: &str) -> String {
    text.chars().take(200).collect()
}

type Range = std::ops::Range<usize>;

/// The JSON and the binary chunk of a GLB file (4.4).
fn chunks(bytes: &[u8]) -> Result<(Range, Option<Range>), Wrong> {
    const JSON: u32 = 0x4e4f_534a;
    const BINARY: u32 = 0x004e_4942;
    let word = |at: usize| bytes.get(at..at + 4)?.first_chunk().copied().map(u32::from_le_bytes);
    match word(4) {
        Some(2) => {}
        Some(version) => {
            return Err(Wrong::new(format!("it is GLB of version {version}; version 2 is read")));
        }
        None => return Err(Wrong::new("the file ends in its header")),
    }
    let declared = word(8).map_or(0, |length| length as usize);
    let end_of = |at: usize| (at + 8).checked_add(word(at)? as usize).filter(|end| *end <= bytes.len());
    let is_chunk = |at: usize| matches!(word(at + 4), Some(JSON | BINARY)) && end_of(at).is_some();
    let (mut json, mut binary, mut at) = (None, None, 12);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let start = at + 8;
        let Some(end) = end_of(at) else {
            // Bytes behind the length that the header declares are no chunk.
            if at >= declared && json.is_some() && !matches!(kind, JSON | BINARY) {
                break;
            }
            let has = bytes.len() - start;
            return Err(Wrong::new(format!(
                "the chunk at byte {at} claims {length} bytes, and the file has {has} more"
            )));
        };
        match kind {
            JSON if json.is_none() => json = Some(start..end),
            BINARY if binary.is_none() => binary = Some(start..end),
            _ => {}
        }
        // Some programs write chunks without the bytes that fill them up to a multiple of four.
        let next = end.next_multiple_of(4);
        at = if !is_chunk(next) && is_chunk(end) { end } else { next };
    }
    Ok((json.ok_or_else(|| Wrong::new("it has no JSON"))?, binary))
}

fn check_version(root: &Root) -> Result<(), Wrong> {
    let least = root.asset.min_version.as_str();
    let number = |text: &str| text.parse::<u32>().ok();
    let parts = match least.split_once('.') {
        Some((major, minor)) => number(major).zip(number(minor)),
        None => number(least).map(|major| (major, 0)),
    };
    match parts {
        _ if least.is_empty() => {}
        Some(version) if version <= (2, 0) => {}
        Some(_) => {
            return Err(Wrong::new(format!("it needs a reader of glTF {least}, and 2.0 is read")));
        }
        None => return Err(Wrong::new(format!("asset.minVersion is no version: {:?}", shown(least)))),
    }
    match root.asset.version.as_str() {
        version if version.starts_with("2.") => Ok(()),
        "" => Err(Wrong::new("it is no glTF: asset.version is missing")),
        version => Err(Wrong::new(format!("it is glTF {}; version 2 is read", shown(version)))),
    }
}

/// Extensions without which a file has no meshes or no pictures, and the way out.
const MISSING: [(&str, &str); 5] = [
    (DRACO, "export it without Draco compression"),
    ("EXT_meshopt_compression", "export it without meshopt compression"),
    ("KHR_meshopt_compression", "export it without meshopt compression"),
    ("KHR_texture_basisu", "export it with PNG or JPEG textures in place of Basis ones"),
    ("EXT_mesh_gpu_instancing", "export it with a node for each instance"),
];

/// Extensions that are read, or whose loss a note states.
const KNOWN: [&str; 21] = [
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    // Data about the file, which no picture shows.
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Refuses files that cannot be read without what glimt does not have (3.12).
fn check_required(root: &Root) -> Result<(), Wrong> {
    for name in &root.extensions_required {
        if let Some((_, help)) = MISSING.iter().find(|(known, _)| known == name) {
            return Err(Wrong::new(format!("it needs {name}, which this version does not read; {help}")));
        }
        if !KNOWN.contains(&name.as_str()) {
            return Err(Wrong::new(format!(
                "it requires the extension {}, which this version does not read (extensionsRequired)",
                shown(name)
            )));
        }
    }
    Ok(())
}

/// The bytes of all buffers, and the files that held them.
fn buffers(
    path: &Path,
    root: &mut Root,
    mut binary: Option<Vec<u8>>,
    watch: Watch<'_>,
) -> Result<(Vec<Vec<u8>>, Vec<Companion>), AssetError> {
    let (mut all, mut files, mut total) = (Vec::new(), Vec::new(), 0);
    for (number, buffer) in root.buffers.iter_mut().enumerate() {
        let wrong =
            |wrong: Wrong| AssetError::malformed(path, None, wrong.inside(format!("buffers[{number}]")).0);
        let bytes = match buffer.uri.take() {
            Some(Uri::Data(bytes)) => bytes,
            Some(Uri::File(uri)) => {
                let file = beside(path, &uri).map_err(wrong)?;
                let silent = Watch { progress: &ignore_progress, token: watch.token };
                let bytes = read::bytes(&file, FILE_LIMIT - total, silent).map_err(|error| match error {
                    AssetError::Unreadable { path: missing, reason } => {
                        let name = path.file_name().unwrap_or_default().to_string_lossy();
                        AssetError::unreadable(
                            &missing,
                            format!("{reason}; buffers[{number}] of {name} is in it"),
                        )
                    }
                    other => other,
                })?;
                files.push(Companion { path: file, hash: Some(read::hash(&bytes)) });
                bytes
            }
            None if number == 0 => {
                binary.take().ok_or_else(|| wrong(Wrong::new("it has neither a URI nor a binary chunk")))?
            }
            None => return Err(wrong(Wrong::new("it has no URI"))),
        };
        if (bytes.len() as u64) < buffer.byte_length {
            let (has, claimed) = (bytes.len(), buffer.byte_length);
            return Err(wrong(Wrong::new(format!("it claims {claimed} bytes, and there are {has}"))));
        }
        total += bytes.len() as u64;
        if total > FILE_LIMIT {
            return Err(wrong(Wrong::new(format!("the buffers have more than {} MiB", FILE_LIMIT >> 20))));
        }
        all.push(bytes);
    }
    Ok((all, files))
}

/// The file that a relative URI names (RFC 3986), seen from a file.
fn beside(path: &Path, uri: &str) -> Result<PathBuf, Wrong> {
    let has_scheme = uri.split(['/', '?', '#']).next().is_some_and(|first| first.contains(':'));
    if has_scheme || uri.starts_with('/') || uri.is_empty() {
        return Err(Wrong::new(format!("{:?} is no file beside it", shown(uri))));
    }
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, behind @ ..] = rest {
        let digits =
            behind.get(..2).and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        match (first, digits) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &behind[2..];
            }
            _ => {
                bytes.push(*first);
                rest = behind;
            }
        }
    }
    let name =
        String::from_utf8(bytes).map_err(|_| Wrong::new(format!("{:?} is no name of a file", shown(uri))))?;
    if name.contains('\0') {
        return Err(Wrong::new("a name with a byte 0"));
    }
    Ok(path.parent().unwrap_or(Path::new("")).join(name))
}

#[cfg(test)]
mod tests;
