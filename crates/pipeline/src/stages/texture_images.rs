//! Images used by textures: their keys, and decoding.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::super::watch::content::{FileContentId, FilePathAndContentId};
use super::FileReadContext;
use super::containers::{ImageInput, canonical_path};
use crate::assets::AssetError;
use crate::assets::image::{
    ColorEncoding, DecodedImage, EmbeddedImage, ImageLimits, embedded_dimensions_and_memory_size,
    load_and_hash, load_embedded, mipmaps, mipmaps_of_thresholded_texels, read_dimensions_and_memory_size,
};
use crate::control::Progress;
use crate::materials::Mipmaps;
use crate::materials::texels::Texels;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::world::{HashableAlphaCutoff, NeededTexture, TextureImageKey};

/// Canonical path of an image, and how to interpret its values.
pub(super) type TextureKey = (PathBuf, Option<u32>, ColorEncoding, Option<HashableAlphaCutoff>);

pub(super) fn texture_key(source: &TextureImageKey) -> TextureKey {
    (canonical_path(&source.path), source.image, source.encoding, source.coverage)
}

/// Decoded texels, and warnings about the parts of the file that were ignored.
#[derive(Clone, Debug)]
pub(super) struct DecodedTexture {
    pub(super) texels: Arc<Texels>,
    pub(super) warnings: Vec<String>,
}

/// An image and all textures that use it.
pub(super) struct ImageWithTextures<'a> {
    pub(super) name: TextureKey,
    pub(super) content: FileContentId,
    /// The image file that the glTF file references.
    pub(super) linked: Option<FilePathAndContentId>,
    pub(super) kept: CachedTexelsAndMipmaps,
    pub(super) asked_by: Vec<&'a NeededTexture>,
}

/// Data cached for an image.
#[derive(Debug, Default)]
pub(super) struct CachedTexelsAndMipmaps {
    pub(super) texels: Option<Arc<DecodedTexture>>,
    pub(super) mipmaps: Option<Arc<Mipmaps>>,
}

impl ImageWithTextures<'_> {
    /// Whether any texture that uses the image needs mipmaps.
    pub(super) fn needs_mipmaps(&self) -> bool {
        self.asked_by.iter().any(|one| one.has_mipmaps)
    }

    pub(super) fn path(&self) -> &Path {
        &self.asked_by[0].source.path
    }

    pub(super) fn decoded_image_fingerprint(&self) -> Fingerprint {
        let (path, image, encoding, coverage) = &self.name;
        let mut key = FingerprintHasher::new("texture");
        key.add_path_bytes(path)
            .add_usize(encoding.index())
            .add_usize(image.map_or(0, |image| image as usize + 1));
        if let Some(cutoff) = coverage {
            key.add_f32(cutoff.value());
        }
        self.content.add_to_fingerprint(&mut key);
        if let Some(FilePathAndContentId { path, content }) = &self.linked {
            content.add_to_fingerprint(key.add_path_bytes(path));
        }
        key.finish()
    }
}

/// Loads all images. Returns an error for each image that would raise the total size above `max_bytes`.
pub(super) fn load_images_or_reject_excess(
    images: &[ImageWithTextures<'_>],
    max_bytes: u64,
    reading: &FileReadContext<'_>,
) -> Vec<(TextureContentAndLinkedImage, Result<DecodedTextureWithMipmaps, AssetError>)> {
    let size = |image: &ImageWithTextures<'_>| {
        let (width, height, bytes) = match image.kept.texels.as_deref() {
            Some(DecodedTexture { texels, .. }) => {
                (texels.width, texels.height, texels.memory_bytes() as u64)
            }
            // Unreadable images are reported during loading.
            None => image_dimensions_and_memory(&image.asked_by[0].source, reading).unwrap_or_default(),
        };
        let is_weighted = matches!(image.asked_by[0].source.encoding, ColorEncoding::CutOut(_));
        bytes
            + if image.needs_mipmaps() {
                Mipmaps::estimate_memory_bytes(width, height, is_weighted)
            } else {
                0
            }
    };
    let sizes: Vec<u64> = reading.pool.install(|| images.par_iter().map(size).collect());
    let over = memory_limit_errors(&sizes, max_bytes);
    let load = |(image, over): (&ImageWithTextures<'_>, Option<String>)| {
        let mut contents = (image.content, image.linked.clone());
        let result = match over {
            Some(reason) => Err(AssetError::Malformed { path: image.path().to_owned(), line: None, reason }),
            None => load_image_and_mipmaps(image, &mut contents, reading),
        };
        (contents, result)
    };
    reading.pool.install(|| images.par_iter().zip(over).map(load).collect())
}

/// Returns an error message for each image that would exceed the total limit.
fn memory_limit_errors(sizes: &[u64], max_bytes: u64) -> Vec<Option<String>> {
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let mut before = 0;
    let check = |&size: &u64| {
        if before + size <= max_bytes {
            before += size;
            return None;
        }
        Some(format!(
            "the image takes {} MiB of memory in addition to {} MiB of other images, and a scene's images may take {} MiB \
             in total; use smaller or fewer images",
            mib(size),
            mib(before),
            mib(max_bytes)
        ))
    };
    sizes.iter().map(check).collect()
}

/// Content of a texture's file and, if that file is a glTF file, of the image file that it references.
pub(super) type TextureContentAndLinkedImage = (FileContentId, Option<FilePathAndContentId>);

/// An image, its mipmaps if needed, and whether all of this came from the cache.
pub(super) type DecodedTextureWithMipmaps = (Arc<DecodedTexture>, Option<Arc<Mipmaps>>, bool);

/// Loads an image and its mipmaps. Sets `contents` to the contents that were decoded.
fn load_image_and_mipmaps(
    image: &ImageWithTextures<'_>,
    contents: &mut TextureContentAndLinkedImage,
    reading: &FileReadContext<'_>,
) -> Result<DecodedTextureWithMipmaps, AssetError> {
    let mut was_kept = true;
    let decoded = match &image.kept.texels {
        Some(decoded) => decoded.clone(),
        None => {
            was_kept = false;
            let DecodedImage { texels, warnings } = decode_image(image, contents, reading)?;
            Arc::new(DecodedTexture { texels: Arc::new(texels), warnings })
        }
    };
    let mipmaps = match &image.kept.mipmaps {
        None if image.needs_mipmaps() => {
            was_kept = false;
            let made = match image.asked_by[0].source.coverage {
                None => mipmaps(&decoded.texels, reading.token)?,
                Some(cutoff) => {
                    mipmaps_of_thresholded_texels(&decoded.texels, cutoff.value(), reading.token)?
                }
            };
            Some(Arc::new(made))
        }
        kept => kept.clone(),
    };
    Ok((decoded, mipmaps, was_kept))
}

/// Decodes an image. Sets `contents` to the contents that were decoded.
fn decode_image(
    image: &ImageWithTextures<'_>,
    contents: &mut TextureContentAndLinkedImage,
    reading: &FileReadContext<'_>,
) -> Result<DecodedImage, AssetError> {
    let (one, limits) = (image.asked_by[0], ImageLimits::default());
    let (encoding, token) = (one.source.encoding, reading.token);
    contents.1 = None;
    if let Some(bytes) = reading.containers.importer_generated_file(image.path()) {
        let within = EmbeddedImage { path: image.path(), bytes };
        let load = |progress: Progress<'_>| load_embedded(within, encoding, limits, progress, token);
        return reading.sink.load_asset_with_progress(&one.name, load);
    }
    let file = match one.source.image {
        None => image.path().to_owned(),
        Some(number) => {
            let (input, hash) = reading.containers.image_input(image.path(), number, token)?;
            contents.0 = reading.contents.record_decoded(image.path(), hash);
            match input {
                ImageInput::Bytes(bytes) => {
                    let within = EmbeddedImage { path: image.path(), bytes };
                    let load =
                        |progress: Progress<'_>| load_embedded(within, encoding, limits, progress, token);
                    return reading.sink.load_asset_with_progress(&one.name, load);
                }
                ImageInput::File(path) => {
                    let content = reading.contents.first_seen_content_id(&path, token)?;
                    contents.1 = Some(FilePathAndContentId { path: path.clone(), content });
                    path
                }
            }
        }
    };
    let load = |progress: Progress<'_>| load_and_hash(&file, encoding, limits, progress, token);
    let (texels, hash) = reading.sink.load_asset_with_progress(&one.name, load)?;
    let content = reading.contents.record_decoded(&file, hash);
    match &mut contents.1 {
        Some(linked) => linked.content = content,
        None => contents.0 = content,
    }
    Ok(texels)
}

/// Returns where an image's bytes are stored.
fn locate_image_bytes(
    source: &TextureImageKey,
    reading: &FileReadContext<'_>,
) -> Result<ImageInput, AssetError> {
    match source.image {
        None => Ok(match reading.containers.importer_generated_file(&source.path) {
            Some(bytes) => ImageInput::Bytes(bytes),
            None => ImageInput::File(source.path.clone()),
        }),
        Some(image) => {
            reading.containers.image_input(&source.path, image, reading.token).map(|(input, _)| input)
        }
    }
}

/// Returns the width, height and memory size of an image.
fn image_dimensions_and_memory(
    source: &TextureImageKey,
    reading: &FileReadContext<'_>,
) -> Result<(u32, u32, u64), AssetError> {
    let (limits, encoding) = (ImageLimits::default(), source.encoding);
    match locate_image_bytes(source, reading)? {
        ImageInput::File(path) => read_dimensions_and_memory_size(&path, encoding, limits, reading.token),
        ImageInput::Bytes(bytes) => embedded_dimensions_and_memory_size(
            EmbeddedImage { path: &source.path, bytes },
            encoding,
            limits,
            reading.token,
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Failure;
    use crate::tests::{Bench, SCENE};

    #[test]
    fn memory_limit_applies_to_all_images_together() {
        let over = memory_limit_errors(&[600, 400, 0, 25, 1], 1001);
        assert_eq!(over.iter().map(Option::is_some).collect::<Vec<_>>(), [false, false, false, true, false]);
        // Three run-length encoded images whose headers specify 15999 × 15999 pixels (732.3 MiB each),
        // although they contain far fewer.
        let table = |name: &str| format!("[textures.{name}]\nfile = \"{name}.tga\"\n");
        let ball = |name: &str| {
            format!(
                "[materials.{name}]\ndiffuse = {{ texture = \"{name}\" }}\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\n\
                 material = \"{name}\"\n"
            )
        };
        let names = ["one", "two", "three"];
        let tables: String = names.iter().map(|name| table(name) + &ball(name)).collect();
        let mut bench = Bench::new(&format!("{SCENE}{tables}"));
        let header = "\0\0\x0a\0\0\0\0\0\0\0\0\0\x7f\x3e\x7f\x3e\x18\0";
        for name in names {
            // Minimum file length for an image of this size, with 128 pixels per run.
            bench.write(&format!("{name}.tga"), &format!("{header}{}", "\0".repeat(3 << 20)));
        }
        let Failure::Scene(errors) = bench.failed() else { panic!("the scene should have errors") };
        let over: Vec<_> = errors.iter().filter(|error| error.message.contains("MiB")).collect();
        assert_eq!(over.len(), 1, "{errors:?}");
        for fact in ["three.tga", " 733 MiB", " 1465 MiB", " 2048 MiB"] {
            assert!(over[0].message.contains(fact), "{fact}: {}", over[0].message);
        }
    }
}
