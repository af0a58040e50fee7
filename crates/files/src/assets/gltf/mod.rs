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
mod container;
mod description;
mod json;
mod materials;
mod merge_scene;
mod model;
mod part;
mod references;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use self::container::DRACO;
pub use self::description::{
    AffineMap, AlphaMode, DiffuseTransmission, ModelCamera, ModelInstance, ModelLight, ModelLightKind,
    ModelMaterial, ModelProjection, ModelScene, TextureLookup, TextureWrap, TexturedValue, TintedGlass,
};
use self::json::{JsonImage, Root, Uri};
pub use self::references::referenced_files;
use super::image::{self, ColorEncoding, EmbeddedImage, ImageLimits};
use super::read::{self, Monitor};
use super::{AssetError, Companion, FileHash};
use crate::control::{CancelToken, ignore_progress};

/// Maximum size of the file, and of all its buffers together.
const FILE_LIMIT: u64 = 4 << 30;

/// Whether the file name has a glTF extension.
pub fn has_gltf_extension(path: &Path) -> bool {
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
    /// Path of the glTF file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Buffer files outside the glTF file.
    pub fn external_buffers(&self) -> &[Companion] {
        &self.companions
    }

    /// Hash of the glTF file.
    pub fn main_file_hash(&self) -> FileHash {
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
        self.image_bytes_or_path(number)
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

    fn image_bytes_or_path(&self, number: usize) -> Result<ImageLocation<'_>, GltfError> {
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
                accessor::buffer_view_bytes(self, json).map(ImageLocation::Inside)
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
            | AssetError::Canceled(_)) => other,
        }
    }

    /// Checks that an image exists and has a valid header.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the image's index, or [`AssetError::Canceled`].
    pub fn check_image_header(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ColorEncoding::Color);
        let size = match self.locate_image(number)? {
            ImageLocation::File(file) => {
                image::read_dimensions_and_memory_size(&file, encoding, limits, token)
            }
            ImageLocation::Inside(bytes) => {
                let image = EmbeddedImage { path: &self.path, bytes: bytes.into() };
                image::embedded_dimensions_and_memory_size(image, encoding, limits, token)
            }
        };
        size.map(drop).map_err(|error| self.add_image_context(number, error))
    }

    /// Checks that an image can be decoded.
    ///
    /// # Errors
    /// Same as [`GltfFile::check_image_header`].
    pub fn check_image_decodes(&self, number: usize, token: &CancelToken) -> Result<(), AssetError> {
        let (limits, encoding) = (ImageLimits::default(), ColorEncoding::Color);
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

fn not_relative_uri_message(uri: &str) -> String {
    format!("{:?} is not a relative URI", truncate_for_message(uri))
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
