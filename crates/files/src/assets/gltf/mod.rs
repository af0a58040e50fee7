//! Reads meshes, images and scenes from glTF 2.0 files, in JSON or GLB format (Khronos, *glTF 2.0
//! Specification*).
//!
//! A part is a primitive. Part numbers start at 0 and continue across meshes.
//!
//! `serde_json` parses the JSON into the types of `json`; `base64` decodes data URIs. The crate `gltf` 1.4 is
//! not used. Without validation, it panics on out-of-range indices; with validation, it rejects every
//! required extension it does not know. Its types (`gltf-json`) would replace only the simple half of
//! `json`: clear coats, WebP images, Basis images and instancing would still have to be parsed from raw
//! values. In addition, errors in flattened extensions would lose their line numbers, and data URIs would
//! stay in memory as text.

mod accessor;
mod description;
mod json;
mod materials;
mod merge_scene;
mod model;
mod part;
mod references;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use self::description::{
    AffineMap, Alpha, ModelCamera, ModelInstance, ModelLight, ModelLightKind, ModelMaterial, ModelProjection,
    ModelScene, TextureRef, TextureWrap, TexturedValue, TintedGlass,
};
use self::json::{JsonImage, Root, Uri};
pub use self::references::referenced_files;
use super::image::{self, EmbeddedImage, ImageEncoding, ImageLimits};
use super::read::{self, Monitor};
use super::{AssetError, Companion, FileHash};
use crate::control::{CancelToken, Progress, ignore_progress};
use crate::system::file::FileStamp;

/// Maximum size of the file, and of all its buffers together.
const FILE_LIMIT: u64 = 4 << 30;
/// Maximum size of the JSON, including data URIs.
const JSON_LIMIT: usize = 512 << 20;

/// UTF-8 byte order mark, written by some programs.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// Whether the file name has a glTF extension.
pub fn is_gltf(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    extension.eq_ignore_ascii_case("glb") || extension.eq_ignore_ascii_case("gltf")
}

/// An error in a glTF file: the location in the JSON and the reason.
#[derive(Debug)]
struct GltfError(String);

impl GltfError {
    fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }

    /// Error for an out-of-range index into `list`.
    fn index_out_of_range(list: &str, index: usize, length: usize) -> Self {
        Self(format!("{list}[{index}] does not exist; {list} has length {length}"))
    }

    /// Prefixes the error with an enclosing location.
    fn add_location(self, place: impl Into<String>) -> Self {
        Self(format!("{}: {}", place.into(), self.0))
    }
}

/// Truncates text from a file for use in a message.
fn truncate_for_message(text: &str) -> String {
    text.chars().take(60).collect()
}

/// An open glTF file with its buffers.
#[derive(Debug)]
pub struct GltfFile {
    path: PathBuf,
    root: Root,
    buffers: Vec<Vec<u8>>,
    /// Buffer files outside the glTF file.
    companions: Vec<Companion>,
    hash: FileHash,
    /// For each part, the first part with the same mesh. Only that first part is built.
    first_part_with_same_mesh: Vec<usize>,
}

/// Location of an image's bytes.
#[derive(Debug, PartialEq)]
pub enum ImageLocation<'a> {
    /// In the glTF file itself.
    Inside(&'a [u8]),
    /// In a separate file.
    File(PathBuf),
}

impl GltfFile {
    /// Opens a glTF file and reads its buffers.
    ///
    /// # Errors
    /// [`AssetError`], with the location in the JSON.
    pub fn open(path: &Path, progress: Progress<'_>, token: &CancelToken) -> Result<Self, AssetError> {
        let monitor = Monitor { progress, token };
        let bytes = read::read_unless_zeros_at_start(path, FILE_LIMIT, monitor)?;
        read::reject_utf16(path, &bytes)?;
        let (length, hash) = (bytes.len(), read::hash_bytes(&bytes));
        let wrong = |wrong: GltfError| AssetError::malformed(path, None, wrong.0);
        let (json, binary) =
            if bytes.starts_with(b"glTF") { glb_chunks(&bytes).map_err(wrong)? } else { (0..length, None) };
        // Parse the JSON.
        let text = &bytes[json];
        if text.len() > JSON_LIMIT {
            let (has, limit) = (text.len().div_ceil(1 << 20), JSON_LIMIT >> 20);
            return Err(wrong(GltfError::new(format!(
                "the JSON has {has} MiB; the limit is {limit} MiB; store the buffers in .glb or .bin files"
            ))));
        }
        let text = text.strip_prefix(BOM).unwrap_or(text);
        if !text.trim_ascii_start().starts_with(b"{") {
            let reason = if length == 0 {
                EMPTY_FILE
            } else if bytes.starts_with(b"glTF") {
                "not a glTF file: the JSON is not an object"
            } else {
                NEITHER_GLB_NOR_JSON
            };
            return Err(AssetError::malformed(path, None, reason));
        }
        let mut root: Root = serde_json::from_slice(text).map_err(|error| {
            if let Some(version) = pre_2_0_version(text) {
                return wrong(GltfError::new(unsupported_version_message(&version)));
            }
            let what = error.to_string();
            let what = replace_rust_terms(what.split(" at line ").next().unwrap_or_default());
            AssetError::malformed(
                path,
                Some(error.line()),
                format!("column {}: {}", error.column(), truncate_parser_message(&what)),
            )
        })?;
        check_version(&root).map_err(wrong)?;
        check_required_extensions(&root).map_err(wrong)?;
        // Extract the binary chunk, then read the buffers.
        let binary = binary.map(|range| {
            let mut bytes = bytes;
            bytes.truncate(range.end);
            bytes.drain(..range.start);
            bytes
        });
        let (buffers, companions) = read_buffers(path, &mut root, binary, monitor)?;
        let mut container = Self {
            path: path.to_owned(),
            hash,
            root,
            buffers,
            companions,
            first_part_with_same_mesh: Vec::new(),
        };
        container.first_part_with_same_mesh = container.map_duplicate_parts().map_err(wrong)?;
        monitor.report_and_check_cancel(2 * length, 2 * length)?;
        Ok(container)
    }

    /// Path of the glTF file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Buffer files outside the glTF file.
    pub fn external_buffers(&self) -> &[Companion] {
        &self.companions
    }

    /// Hash of the glTF file.
    pub fn file_hash(&self) -> FileHash {
        self.hash
    }

    /// Image files referenced by the glTF file, including unused ones.
    pub fn image_file_paths(&self) -> Vec<PathBuf> {
        let file = |image: &JsonImage| match &image.uri {
            Some(Uri::File(uri)) => resolve_relative_uri(&self.path, uri).ok(),
            Some(Uri::Data(_)) | None => None,
        };
        self.root.images.iter().filter_map(file).collect()
    }

    /// Locates an image's bytes.
    ///
    /// # Errors
    /// The image does not exist, or its bytes are out of range.
    pub fn locate_image(&self, number: usize) -> Result<ImageLocation<'_>, AssetError> {
        self.find_image_location(number)
            .map_err(|wrong| self.malformed_error(wrong.add_location(format!("images[{number}]"))))
    }

    /// Returns an image's bytes, reading them from a separate file if necessary.
    ///
    /// # Errors
    /// Same as [`GltfFile::locate_image`]. Also fails if the image file cannot be read.
    pub fn read_embedded_or_external_image(
        &self,
        number: usize,
        token: &CancelToken,
    ) -> Result<Vec<u8>, AssetError> {
        match self.locate_image(number)? {
            ImageLocation::Inside(bytes) => Ok(bytes.to_vec()),
            ImageLocation::File(file) => {
                read::read_bytes(&file, FILE_LIMIT, Monitor { progress: &ignore_progress, token })
            }
        }
    }

    fn find_image_location(&self, number: usize) -> Result<ImageLocation<'_>, GltfError> {
        let images = &self.root.images;
        let image = images
            .get(number)
            .ok_or_else(|| GltfError::index_out_of_range("images", number, images.len()))?;
        match (&image.uri, image.buffer_view) {
            (Some(Uri::Data(bytes)), _) => Ok(ImageLocation::Inside(bytes)),
            (Some(Uri::File(uri)), _) => Ok(ImageLocation::File(resolve_relative_uri(&self.path, uri)?)),
            (None, Some(view)) => {
                let views = &self.root.buffer_views;
                let json = views
                    .get(view)
                    .ok_or_else(|| GltfError::index_out_of_range("bufferViews", view, views.len()))?;
                accessor::view_bytes(self, json).map(ImageLocation::Inside)
            }
            (None, None) => Err(GltfError::new("it has neither a URI nor a buffer view")),
        }
    }

    fn malformed_error(&self, wrong: GltfError) -> AssetError {
        AssetError::malformed(&self.path, None, wrong.0)
    }

    /// Returns the first part with the same mesh as `part`. Only this first part is built.
    pub(super) fn first_part_with_same_mesh(&self, part: usize) -> usize {
        self.first_part_with_same_mesh.get(part).copied().unwrap_or(part)
    }

    /// Maps each part to the first part with the same mesh. Rejects files whose meshes reuse the same buffer
    /// bytes so often that they would need many times the file size in memory.
    fn map_duplicate_parts(&self) -> Result<Vec<usize>, GltfError> {
        /// Number of corners allowed in addition to one per buffer byte.
        const FREE: u64 = 1 << 20;
        let mut first = HashMap::new();
        let mut first_part_with_same_mesh = Vec::new();
        let mut corners: u64 = 0;
        for primitive in self.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
            let part = first_part_with_same_mesh.len();
            let is_compressed = primitive.extensions.contains_key(DRACO);
            let sets = self.select_two_uv_sets(primitive);
            let mesh = (primitive.indices, primitive.mode, is_compressed, sets, &primitive.attributes);
            let first = *first.entry(mesh).or_insert(part);
            first_part_with_same_mesh.push(first);
            if first == part {
                let list = primitive.indices.or_else(|| primitive.attributes.get("POSITION").copied());
                let count = list.and_then(|list| self.root.accessors.get(list)).map_or(0, |list| list.count);
                corners = corners.saturating_add(primitive.triangle_corner_count(count));
            }
        }
        let bytes: u64 = self.buffers.iter().map(|buffer| buffer.len() as u64).sum();
        let limit = bytes + FREE;
        if corners > limit {
            return Err(GltfError::new(too_many_corners_for_buffers_message(corners, bytes, limit)));
        }
        Ok(first_part_with_same_mesh)
    }

    /// Adds the image's index and this file's path to an image error.
    fn add_image_context(&self, number: usize, error: AssetError) -> AssetError {
        let place = format!("images[{number}]");
        match error {
            AssetError::Malformed { path, reason, .. } if path == self.path => {
                self.malformed_error(GltfError::new(reason).add_location(place))
            }
            error @ (AssetError::Malformed { .. } | AssetError::Unreadable { .. }) => {
                self.malformed_error(GltfError::new(error.to_string()).add_location(place))
            }
            other @ (AssetError::OutOfMemory { .. }
            | AssetError::MemoryLimit { .. }
            | AssetError::TooManyOpenFiles { .. }
            | AssetError::Cancelled(_)) => other,
        }
    }

    /// Checks that an image exists and has a valid header.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the image's index, or [`AssetError::Cancelled`].
    pub fn check_image_header(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ImageEncoding::Color);
        let size = match self.locate_image(number)? {
            ImageLocation::File(file) => {
                image::read_dimensions_and_decoded_bytes(&file, encoding, limits, token)
            }
            ImageLocation::Inside(bytes) => {
                let image = EmbeddedImage { path: &self.path, bytes: bytes.into() };
                image::embedded_dimensions_and_decoded_bytes(image, encoding, limits, token)
            }
        };
        size.map(drop).map_err(|error| self.add_image_context(number, error))
    }

    /// Checks that an image can be decoded.
    ///
    /// # Errors
    /// Same as [`GltfFile::check_image_header`].
    pub fn check_image_decodes(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ImageEncoding::Color);
        let texels = match self.locate_image(number)? {
            ImageLocation::File(file) => image::load(&file, encoding, limits, &ignore_progress, token),
            ImageLocation::Inside(bytes) => {
                let image = EmbeddedImage { path: &self.path, bytes: bytes.into() };
                image::load_embedded(image, encoding, limits, &ignore_progress, token)
            }
        };
        texels.map(drop).map_err(|error| self.add_image_context(number, error))
    }
}

fn too_many_corners_for_buffers_message(corners: u64, bytes: u64, limit: u64) -> String {
    format!("its primitives have {corners} triangle corners; the limit for {bytes} buffer bytes is {limit}")
}

/// Error message for an empty file.
const EMPTY_FILE: &str = "the file is empty";
const NEITHER_GLB_NOR_JSON: &str = "not a glTF file: neither GLB nor a JSON object";

fn unsupported_version_message(version: &str) -> String {
    format!("glTF {} is not supported; version 2 is required", truncate_for_message(version))
}

fn unsupported_glb_message(version: u32) -> String {
    format!("GLB version {version} is not supported; version 2 is required")
}

fn newer_version_required_message(required: &str) -> String {
    format!("it requires glTF {required}; only 2.0 is supported")
}

fn invalid_min_version_message(text: &str) -> String {
    format!("asset.minVersion is not a version: {:?}", truncate_for_message(text))
}

/// Error message for an unsupported extension that a file's meshes or images need.
fn unsupported_extension_message(extension: &str, help: &str) -> String {
    format!("{extension} is not supported; {help}")
}

fn unknown_extension_message(extension: &str) -> String {
    format!(
        "the required extension {} is not supported (extensionsRequired)",
        truncate_for_message(extension)
    )
}

fn short_buffer_message(claimed: u64, has: usize) -> String {
    format!("it claims {claimed} bytes but has {has}")
}

fn unreadable_buffer_file_message(reason: &str, number: usize, name: &str) -> String {
    format!("{reason}; {name} stores buffers[{number}] there")
}

fn not_relative_uri_message(uri: &str) -> String {
    format!("{:?} is not a relative URI", truncate_for_message(uri))
}

/// An unsupported mesh compression extension.
const DRACO: &str = "KHR_draco_mesh_compression";

/// Returns the version of a file that predates glTF 2.0, or `None` for other files. Such a file does not
/// parse as [`Root`], because older versions use JSON objects where glTF 2.0 uses arrays.
fn pre_2_0_version(text: &[u8]) -> Option<String> {
    #[derive(serde::Deserialize)]
    struct AssetOnlyRoot {
        asset: json::JsonAsset,
    }
    let AssetOnlyRoot { asset } = serde_json::from_slice(text).ok()?;
    let is_old = asset.version.starts_with("1.") || asset.version.starts_with("0.");
    is_old.then_some(asset.version)
}

/// Replaces Rust terms with JSON terms in a JSON parser message.
fn replace_rust_terms(message: &str) -> String {
    let Some((before, expected)) = message.rsplit_once(", expected ") else { return message.to_owned() };
    let before = match before.strip_prefix("invalid type: ") {
        Some("map") => "invalid type: object".to_owned(),
        Some("sequence") => "invalid type: array".to_owned(),
        Some(_) | None => before.to_owned(),
    };
    let expected = match expected {
        "usize" | "u64" | "u32" => "a nonnegative integer",
        "f64" => "a number",
        "a sequence" => "an array",
        "a map" => "an object",
        other if other.starts_with("struct ") => "an object",
        other => other,
    };
    format!("{before}, expected {expected}")
}

/// Truncates long parser messages.
fn truncate_parser_message(text: &str) -> String {
    text.chars().take(200).collect()
}

type Range = std::ops::Range<usize>;

/// Byte ranges of the JSON and binary chunks in a GLB file (4.4).
fn glb_chunks(bytes: &[u8]) -> Result<(Range, Option<Range>), GltfError> {
    const JSON: u32 = 0x4e4f_534a;
    const BINARY: u32 = 0x004e_4942;
    let word = |at: usize| bytes.get(at..at + 4)?.first_chunk().copied().map(u32::from_le_bytes);
    match word(4) {
        Some(2) => {}
        Some(version) => {
            return Err(GltfError::new(unsupported_glb_message(version)));
        }
        None => return Err(GltfError::new("the file ends inside the header")),
    }
    let declared = word(8).map_or(0, |length| length as usize);
    let end_of = |at: usize| (at + 8).checked_add(word(at)? as usize).filter(|end| *end <= bytes.len());
    let is_chunk = |at: usize| matches!(word(at + 4), Some(JSON | BINARY)) && end_of(at).is_some();
    let (mut json, mut binary, mut at) = (None, None, 12);
    while let (Some(length), Some(kind)) = (word(at), word(at + 4)) {
        let start = at + 8;
        let Some(end) = end_of(at) else {
            // Ignore bytes past the length declared in the header.
            if at >= declared && json.is_some() && !matches!(kind, JSON | BINARY) {
                break;
            }
            let has = bytes.len() - start;
            return Err(GltfError::new(format!(
                "the chunk at byte {at} claims {length} bytes, but only {has} remain"
            )));
        };
        match kind {
            JSON if json.is_none() => json = Some(start..end),
            BINARY if binary.is_none() => binary = Some(start..end),
            _ => {}
        }
        // Some programs write chunks without padding them to a multiple of four.
        let next = end.next_multiple_of(4);
        at = if !is_chunk(next) && is_chunk(end) { end } else { next };
    }
    Ok((json.ok_or_else(|| GltfError::new("the JSON chunk is missing"))?, binary))
}

fn check_version(root: &Root) -> Result<(), GltfError> {
    let required = root.asset.min_version.as_str();
    let number = |text: &str| text.parse::<u32>().ok();
    let parts = match required.split_once('.') {
        Some((major, minor)) => number(major).zip(number(minor)),
        None => number(required).map(|major| (major, 0)),
    };
    match parts {
        _ if required.is_empty() => {}
        Some(version) if version <= (2, 0) => {}
        Some(_) => {
            return Err(GltfError::new(newer_version_required_message(required)));
        }
        None => return Err(GltfError::new(invalid_min_version_message(required))),
    }
    match root.asset.version.as_str() {
        version if version.starts_with("2.") => Ok(()),
        "" => Err(GltfError::new("not a glTF file: asset.version is missing")),
        version => Err(GltfError::new(unsupported_version_message(version))),
    }
}

/// Unsupported extensions that change how meshes or images are stored, each with advice on exporting the
/// file without it.
const MISSING: [(&str, &str); 5] = [
    (DRACO, "export it without Draco compression"),
    ("EXT_meshopt_compression", "export it without meshopt compression"),
    ("KHR_meshopt_compression", "export it without meshopt compression"),
    ("KHR_texture_basisu", "export it with PNG or JPEG textures instead of Basis textures"),
    ("EXT_mesh_gpu_instancing", "export it with a node for each instance"),
];

/// Extensions that are either supported or ignored with a note.
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
    // Metadata that does not affect images.
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Rejects files that require unsupported extensions (3.12).
fn check_required_extensions(root: &Root) -> Result<(), GltfError> {
    for name in &root.extensions_required {
        if let Some((_, help)) = MISSING.iter().find(|(known, _)| known == name) {
            return Err(GltfError::new(unsupported_extension_message(name, help)));
        }
        if !KNOWN.contains(&name.as_str()) {
            return Err(GltfError::new(unknown_extension_message(name)));
        }
    }
    Ok(())
}

/// Reads all buffers and returns them with the list of buffer files.
fn read_buffers(
    path: &Path,
    root: &mut Root,
    mut binary: Option<Vec<u8>>,
    monitor: Monitor<'_>,
) -> Result<(Vec<Vec<u8>>, Vec<Companion>), AssetError> {
    let (mut all, mut files, mut total) = (Vec::new(), Vec::new(), 0);
    for (number, buffer) in root.buffers.iter_mut().enumerate() {
        let wrong = |wrong: GltfError| {
            AssetError::malformed(path, None, wrong.add_location(format!("buffers[{number}]")).0)
        };
        let bytes = match buffer.uri.take() {
            Some(Uri::Data(bytes)) => bytes,
            Some(Uri::File(uri)) => {
                let file = resolve_relative_uri(path, &uri).map_err(wrong)?;
                let silent = Monitor { progress: &ignore_progress, token: monitor.token };
                let stamp = FileStamp::from_path(&file);
                let bytes =
                    read::read_bytes(&file, FILE_LIMIT - total, silent).map_err(|error| match error {
                        AssetError::Unreadable { path: missing, reason } => {
                            let name = path.file_name().unwrap_or_default().to_string_lossy();
                            AssetError::unreadable(
                                &missing,
                                unreadable_buffer_file_message(&reason, number, &name),
                            )
                        }
                        other => other,
                    })?;
                files.push(Companion { path: file, hash: Some(read::hash_bytes(&bytes)), stamp });
                bytes
            }
            None if number == 0 => binary
                .take()
                .ok_or_else(|| wrong(GltfError::new("it has neither a URI nor a binary chunk")))?,
            None => return Err(wrong(GltfError::new("it has no URI"))),
        };
        if (bytes.len() as u64) < buffer.byte_length {
            let (has, claimed) = (bytes.len(), buffer.byte_length);
            return Err(wrong(GltfError::new(short_buffer_message(claimed, has))));
        }
        total += bytes.len() as u64;
        if total > FILE_LIMIT {
            return Err(wrong(GltfError::new(format!("the buffers exceed {} MiB", FILE_LIMIT >> 20))));
        }
        all.push(bytes);
    }
    Ok((all, files))
}

/// Resolves a relative URI (RFC 3986) against the path of the glTF file.
fn resolve_relative_uri(path: &Path, uri: &str) -> Result<PathBuf, GltfError> {
    let has_scheme = uri.split(['/', '?', '#']).next().is_some_and(|first| first.contains(':'));
    if has_scheme || uri.starts_with('/') || uri.is_empty() {
        return Err(GltfError::new(not_relative_uri_message(uri)));
    }
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, following @ ..] = rest {
        let digits = following
            .get(..2)
            .and_then(|digits| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok());
        match (first, digits) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &following[2..];
            }
            _ => {
                bytes.push(*first);
                rest = following;
            }
        }
    }
    let name = String::from_utf8(bytes)
        .map_err(|_| GltfError::new(format!("{:?} is not a valid file name", truncate_for_message(uri))))?;
    if name.contains('\0') {
        return Err(GltfError::new("a file name contains a zero byte"));
    }
    Ok(path.parent().unwrap_or(Path::new("")).join(name))
}

#[cfg(test)]
mod tests;
