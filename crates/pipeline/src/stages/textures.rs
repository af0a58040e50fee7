//! The textures stage: decodes images in parallel if they are used by visible materials and their content has
//! changed.

use std::collections::{HashMap, HashSet};
use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::super::cache::{CacheOfNamedValues, EvictionCandidate};
use super::super::protocol::reasons;
use super::super::watch::content::{FileContentId, FilePathAndContentId};
use super::containers::{ImageInput, canonical};
use super::meshes::MeshesByFileIndex;
use super::{AbortReason, FileCounts, FileReadContext, Findings, StageResult, loading_result};
use crate::assets::AssetError;
use crate::assets::image::{
    ColorCurve, DecodedImage, EmbeddedImage, ImageEncoding, ImageLimits,
    embedded_dimensions_and_decoded_bytes, load_embedded, load_hashed, mipmaps,
    mipmaps_of_thresholded_texels, read_dimensions_and_decoded_bytes,
};
use crate::control::{Cancelled, Progress};
use crate::materials::Mipmaps;
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::scene::LoadedScene;
use crate::scene::description::{Channel, ChannelSelector, Scene, TextureEncoding, TextureRole};
use crate::scene::diagnostic::Severity;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};
use crate::world::{
    AlphaCutoffKey, Image, Images, NeededTexture, TextureRolesNeededByRender, TextureSource,
    environment_source, textures_needed,
};

/// Maximum total size of a scene's texels, in bytes.
const MAX_BYTES: u64 = 2 << 30;

/// Canonical path of an image, and how to interpret its values.
type TextureKey = (PathBuf, Option<u32>, ImageEncoding, Option<AlphaCutoffKey>);

fn texture_key(source: &TextureSource) -> TextureKey {
    (canonical(&source.path), source.image, source.encoding, source.coverage)
}

/// Decoded texels, and warnings about the parts of the file that were ignored.
#[derive(Clone, Debug)]
struct DecodedTexture {
    texels: Arc<Texels>,
    warnings: Vec<String>,
}

/// Texture cache. Each file and encoding has one entry, plus one for its mipmaps if a material uses them.
#[derive(Debug, Default)]
pub(crate) struct TextureCache {
    texels: CacheOfNamedValues<TextureKey, DecodedTexture>,
    mipmaps: CacheOfNamedValues<TextureKey, Mipmaps>,
    /// Image files referenced by glTF files, by texture name.
    linked: HashMap<TextureKey, PathBuf>,
}

impl TextureCache {
    /// Whether all of the given textures are cached, even if their files have changed in the meantime.
    fn has_all(&self, needed: &[NeededTexture]) -> bool {
        needed.iter().all(|one| self.texels.get_by_name(&texture_key(&one.source)).is_some())
    }

    pub(crate) fn record_request_usage(&mut self, success: bool, request: u64) {
        self.texels.record_request_usage(success, request);
        self.mipmaps.record_request_usage(success, request);
    }

    pub(crate) fn eviction_candidates(&self) -> impl Iterator<Item = EvictionCandidate> {
        self.texels.eviction_candidates().chain(self.mipmaps.eviction_candidates())
    }

    pub(crate) fn evict_unused_before(&mut self, request: u64) {
        self.texels.evict_unused_before(request);
        self.mipmaps.evict_unused_before(request);
        let texels = &self.texels;
        self.linked.retain(|name, _| texels.get_by_name(name).is_some());
    }
}

/// The loaded textures of a scene. Excludes textures that failed to load.
#[derive(Debug, Default)]
pub(crate) struct Textures {
    pub(crate) images: Images,
    /// Key of each image.
    pub(crate) key_of: HashMap<TextureSource, Fingerprint>,
    /// Key of each texture, in the same order as the needed textures.
    pub(crate) keys: Vec<Fingerprint>,
    /// Keys of the textures used by materials from mesh files.
    pub(crate) of_files: Vec<Fingerprint>,
    /// The environment map and its key.
    pub(crate) environment: Option<(Fingerprint, Arc<Texels>)>,
    /// Number of texels that this request read from files.
    pub(crate) texels_loaded: u64,
    /// Bytes used by all images, including their mipmaps.
    pub(crate) memory_bytes: u64,
}

/// The textures needed for an image.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct NeededTextures {
    pub(crate) textures: Vec<NeededTexture>,
    /// Number of textures that the scene uses but this view does not need.
    pub(crate) left_out: usize,
    /// Whether a missing texture is an error even in a model. If not, the model is shown without the texture.
    pub(crate) are_required: bool,
}

/// Which textures of a scene to load.
#[derive(Clone, Copy)]
pub(crate) enum TextureSelection {
    /// Textures used by visible materials in these roles. If all of the scene's textures are cached, all of
    /// them, so that the lights and trees that depend on them can be reused.
    ForImage(TextureRolesNeededByRender),
    /// All textures, used or not, all of which must be readable.
    ForCheck,
}

/// Returns the selected textures.
pub(crate) fn find_needed_textures(
    loaded: &LoadedScene,
    meshes: &MeshesByFileIndex,
    selection: TextureSelection,
    cache: &TextureCache,
) -> NeededTextures {
    let meshes: Vec<_> = meshes.iter().map(|kept| kept.mesh.clone()).collect();
    let mut all = textures_needed(&loaded.scene, &meshes, TextureRolesNeededByRender::ALL);
    let roles = match selection {
        TextureSelection::ForImage(roles) => roles,
        TextureSelection::ForCheck => {
            add_check_only_textures(loaded, &mut all);
            return NeededTextures { textures: all, left_out: 0, are_required: true };
        }
    };
    let for_image = textures_needed(&loaded.scene, &meshes, roles);
    let left_out = all.len() - for_image.len();
    if left_out == 0 || cache.has_all(&all) {
        return NeededTextures { textures: all, ..NeededTextures::default() };
    }
    NeededTextures { textures: for_image, left_out, ..NeededTextures::default() }
}

/// An image and all textures that use it.
struct ImageWithTextures<'a> {
    name: TextureKey,
    content: FileContentId,
    /// The image file that the glTF file references.
    linked: Option<FilePathAndContentId>,
    kept: CachedTexelsAndMipmaps,
    asked_by: Vec<&'a NeededTexture>,
}

/// Data cached for an image.
#[derive(Debug, Default)]
struct CachedTexelsAndMipmaps {
    texels: Option<Arc<DecodedTexture>>,
    mipmaps: Option<Arc<Mipmaps>>,
}

/// Loads the needed textures. Tries all files and adds errors to the findings.
///
/// # Errors
/// The token is canceled, or there is not enough memory.
pub(crate) fn load_textures(
    loaded: &LoadedScene,
    needed: &NeededTextures,
    cache: &mut TextureCache,
    findings: &mut Findings,
    reading: &FileReadContext<'_>,
) -> Result<StageResult<Textures>, AbortReason> {
    let mut textures = Textures::default();
    let NeededTextures { textures: needed, left_out, are_required } = needed;
    if needed.is_empty() {
        let why = match left_out {
            0 => reasons::NO_TEXTURES,
            _ => reasons::NOT_NEEDED_FOR_VIEW,
        };
        return Ok(StageResult::skipped(textures, why));
    }
    let environment = environment_source(&loaded.scene);
    let images = group_by_image(needed, cache, reading)?;
    let assets = load_images_within_limit(&images, MAX_BYTES, reading);
    let mut counts = FileCounts::default();
    for (mut image, (contents, asset)) in images.into_iter().zip(assets) {
        (image.content, image.linked) = contents;
        let key = image.decoded_image_fingerprint();
        for one in &image.asked_by {
            findings.add_file(FilePathAndContentId { path: one.source.path.clone(), content: image.content });
        }
        if let Some(file) = &image.linked {
            findings.add_file(file.clone());
            cache.linked.insert(image.name.clone(), file.path.clone());
        }
        match asset {
            Ok((decoded, mipmaps, was_kept)) => {
                let texels = &decoded.texels;
                let loaded_image = Image { texels: texels.clone(), mipmaps: mipmaps.clone() };
                counts.kept += usize::from(was_kept);
                counts.loaded += usize::from(!was_kept);
                textures.texels_loaded += if image.kept.texels.is_some() { 0 } else { texels.len() as u64 };
                let of_levels = mipmaps.as_ref().map_or(0, |mipmaps| mipmaps.memory_bytes());
                textures.memory_bytes += (texels.memory_bytes() + of_levels) as u64;
                textures.keys.push(key);
                if image.asked_by.iter().any(|one| one.mesh_file.is_some()) {
                    textures.of_files.push(key);
                }
                for one in &image.asked_by {
                    textures.images.insert(one.source.clone(), loaded_image.clone());
                    textures.key_of.insert(one.source.clone(), key);
                    if Some(&one.source) == environment.as_ref() {
                        textures.environment = Some((key, texels.clone()));
                    }
                }
                warn_about_unusable_pixels(loaded, &image, texels, findings);
                warn_about_gray_normal_map(loaded, &image, texels, findings);
                warn_about_opaque_alpha(loaded, &image, texels, findings);
                for warning in &decoded.warnings {
                    warn(loaded, image.asked_by[0], warning, findings);
                }
                if let Some(mipmaps) = &mipmaps {
                    let bytes = mipmaps.memory_bytes();
                    cache.mipmaps.insert(image.name.clone(), key, (mipmaps.clone(), bytes));
                }
                let bytes = texels.memory_bytes();
                cache.texels.insert(image.name, key, (decoded, bytes));
            }
            Err(AssetError::Cancelled(_)) => return Err(AbortReason::Cancelled),
            Err(error @ (AssetError::OutOfMemory { .. } | AssetError::TooManyOpenFiles { .. })) => {
                return Err(AbortReason::work_failure(error));
            }
            Err(error) if !are_required && loaded.is_foreign() => {
                counts.failed += 1;
                for one in &image.asked_by {
                    replace_unreadable_image(loaded, one, &error, &mut textures.images, findings);
                }
            }
            Err(error) => {
                counts.failed += 1;
                for one in &image.asked_by {
                    match (&one.material, one.mesh_file) {
                        (Some(material), Some(file)) => {
                            let file = loaded.scene.mesh_files[file].value.display();
                            let help = format!("it is used by the material \"{material}\" in {file}");
                            findings.add_error(
                                loaded,
                                reference_span(loaded, one),
                                prefix_mtl_line(one, &error),
                                &help,
                            );
                        }
                        _ => findings.add_asset_error(loaded, reference_span(loaded, one), &error),
                    }
                }
            }
        }
    }
    if let Some((_, texels)) = textures.environment.as_ref().filter(|(_, texels)| texels.is_black()) {
        let size = format!("{} × {}", texels.width, texels.height);
        let message = format!("the environment map is black: none of its {size} pixels emits light");
        findings.add_warning(loaded, environment_span(&loaded.scene).unwrap_or(0..0), message);
    }
    Ok(loading_result(textures, FileCounts { left_out: *left_out, ..counts }))
}

/// Warns about an unreadable image in a model and replaces it with a constant. Preserves the material's
/// factors, except that emission is dropped. Materials from mesh files provide their own values for use
/// without a texture.
fn replace_unreadable_image(
    loaded: &LoadedScene,
    one: &NeededTexture,
    error: &AssetError,
    images: &mut Images,
    findings: &mut Findings,
) {
    let file = loaded.path.display();
    let mut warn = |material: &str| {
        let help = format!("glimt shows the material \"{material}\" in {file} without it");
        let warning = loaded.diagnostic_at(
            reference_span(loaded, one),
            Severity::Warning,
            prefix_mtl_line(one, error),
            Some(help),
        );
        if !findings.warnings.contains(&warning) {
            findings.warnings.push(warning);
        }
    };
    one.material.iter().for_each(|material| warn(material));
    let Some(declared) = one.declared else { return };
    let mut is_light = true;
    for material in &loaded.scene.materials {
        let mut roles =
            material.textures().into_iter().filter(|(texture, _)| *texture == declared).peekable();
        if roles.peek().is_some() {
            warn(&material.name);
        }
        is_light &= roles.all(|(_, role)| role == TextureRole::Emission);
    }
    let texel = match one.source.encoding {
        ImageEncoding::Linear => Vec3::new(0.5, 0.5, 1.0),
        ImageEncoding::Color | ImageEncoding::CutOut(ColorCurve::Auto) if is_light => Vec3::ZERO,
        ImageEncoding::Color
        | ImageEncoding::Srgb
        | ImageEncoding::Raw
        | ImageEncoding::CutOut(_)
        | ImageEncoding::Number { .. } => Vec3::ONE,
    };
    let texels = Texels { width: 1, height: 1, data: TexelData::Float(vec![texel]), unusable: 0 };
    images.insert(one.source.clone(), Image { texels: Arc::new(texels), mipmaps: None });
}

/// Prefixes a message about an image with the MTL line that references the image.
fn prefix_mtl_line(one: &NeededTexture, message: &impl Display) -> String {
    match &one.statement {
        Some(statement) => format!("{statement}: {message}"),
        None => message.to_string(),
    }
}

/// Adds a warning about an image at the place where the image is referenced.
fn warn(loaded: &LoadedScene, one: &NeededTexture, message: &str, findings: &mut Findings) {
    findings.add_warning(loaded, reference_span(loaded, one), prefix_mtl_line(one, &message));
}

/// Warns about pixels that are negative, not finite or too large.
fn warn_about_unusable_pixels(
    loaded: &LoadedScene,
    image: &ImageWithTextures<'_>,
    texels: &Texels,
    findings: &mut Findings,
) {
    let count = match texels.unusable {
        0 => return,
        1 => "1 pixel is".to_owned(),
        count => format!("{count} pixels are"),
    };
    let path = image.path().display();
    let message =
        format!("{path}: {count} negative, not finite or above 1e18 in a channel; glimt uses 0 instead");
    warn(loaded, image.asked_by[0], &message, findings);
}

/// Warns that a gray normal map is probably a height map. If it comes from a mesh file, it does not change
/// the normals.
fn warn_about_gray_normal_map(
    loaded: &LoadedScene,
    image: &ImageWithTextures<'_>,
    texels: &Texels,
    findings: &mut Findings,
) {
    let normals = image.asked_by.iter().find_map(|one| Some((one, one.normals_of.as_deref()?)));
    let Some((one, material)) = normals.filter(|_| texels.are_all_gray()) else { return };
    let effect = match one.mesh_file {
        Some(_) => "it does not change the normals (use `bump` for heights)",
        None => "it tilts all normals to one side (use `bump` for heights)",
    };
    let path = image.path().display();
    let message =
        format!("the normal map {path} of \"{material}\" is gray and probably contains heights: {effect}");
    warn(loaded, one, &message, findings);
}

/// Warns about an image used with `channel = "a"` whose alpha is 1 everywhere.
fn warn_about_opaque_alpha(
    loaded: &LoadedScene,
    image: &ImageWithTextures<'_>,
    texels: &Texels,
    findings: &mut Findings,
) {
    const ALPHA: ChannelSelector = ChannelSelector::Channel(Channel::Alpha);
    let is_alpha = |one: &&&NeededTexture| {
        matches!(one.source.encoding, ImageEncoding::Number { of: ALPHA, is_srgb: _ })
    };
    let Some(one) = image.asked_by.iter().find(is_alpha).filter(|_| texels.is_white()) else { return };
    let path = image.path().display();
    let message = format!("{path} has no alpha below 1: `channel = \"a\"` is 1 everywhere");
    warn(loaded, one, &message, findings);
}

/// Returns the span of the environment map's file name.
fn environment_span(scene: &Scene) -> Option<Range<usize>> {
    scene.environment.as_ref()?.file.as_ref().map(|file| file.span.clone())
}

impl ImageWithTextures<'_> {
    /// Whether any texture that uses the image needs mipmaps.
    fn needs_mipmaps(&self) -> bool {
        self.asked_by.iter().any(|one| one.has_mipmaps)
    }

    fn path(&self) -> &Path {
        &self.asked_by[0].source.path
    }

    fn decoded_image_fingerprint(&self) -> Fingerprint {
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

/// Groups the needed textures by file and encoding, in their original order, and looks up cached data.
fn group_by_image<'a>(
    needed: &'a [NeededTexture],
    cache: &mut TextureCache,
    reading: &FileReadContext<'_>,
) -> Result<Vec<ImageWithTextures<'a>>, Cancelled> {
    let mut images: Vec<ImageWithTextures<'a>> = Vec::new();
    let mut known = HashMap::new();
    for one in needed {
        let name = texture_key(&one.source);
        let index = *known.entry(name.clone()).or_insert(images.len());
        if let Some(image) = images.get_mut(index) {
            image.asked_by.push(one);
            continue;
        }
        let content = reading.contents.first_seen_content_id(&one.source.path, reading.token)?;
        let linked = cache.linked.get(&name).map(|path| {
            let content = reading.contents.first_seen_content_id(path, reading.token)?;
            Ok(FilePathAndContentId { path: path.clone(), content })
        });
        let (linked, kept) = (linked.transpose()?, CachedTexelsAndMipmaps::default());
        images.push(ImageWithTextures { name, content, linked, kept, asked_by: vec![one] });
    }
    for image in &mut images {
        let key = image.decoded_image_fingerprint();
        image.kept.texels = cache.texels.get(&image.name, key);
        if image.needs_mipmaps() {
            image.kept.mipmaps = cache.mipmaps.get(&image.name, key);
        }
    }
    Ok(images)
}

/// Loads all images. Returns an error for each image that would raise the total size above `most_bytes`.
fn load_images_within_limit(
    images: &[ImageWithTextures<'_>],
    most_bytes: u64,
    reading: &FileReadContext<'_>,
) -> Vec<(TextureFileContentIds, Result<DecodedTextureWithMipmaps, AssetError>)> {
    let size = |image: &ImageWithTextures<'_>| {
        let (width, height, bytes) = match image.kept.texels.as_deref() {
            Some(DecodedTexture { texels, .. }) => {
                (texels.width, texels.height, texels.memory_bytes() as u64)
            }
            // Unreadable images are reported during loading.
            None => image_dimensions_and_memory(&image.asked_by[0].source, reading).unwrap_or_default(),
        };
        let is_weighted = matches!(image.asked_by[0].source.encoding, ImageEncoding::CutOut(_));
        bytes
            + if image.needs_mipmaps() {
                Mipmaps::estimate_memory_bytes(width, height, is_weighted)
            } else {
                0
            }
    };
    let sizes: Vec<u64> = reading.pool.install(|| images.par_iter().map(size).collect());
    let over = memory_limit_errors(&sizes, most_bytes);
    let load = |(image, over): (&ImageWithTextures<'_>, Option<String>)| {
        let mut contents = (image.content, image.linked.clone());
        let result = match over {
            Some(reason) => Err(AssetError::Malformed { path: image.path().to_owned(), line: None, reason }),
            None => load_one(image, &mut contents, reading),
        };
        (contents, result)
    };
    reading.pool.install(|| images.par_iter().zip(over).map(load).collect())
}

/// Returns an error message for each image that would exceed the total limit.
fn memory_limit_errors(sizes: &[u64], most_bytes: u64) -> Vec<Option<String>> {
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let mut before = 0;
    let check = |&size: &u64| {
        if before + size <= most_bytes {
            before += size;
            return None;
        }
        Some(format!(
            "the image takes {} MiB of memory in addition to {} MiB of other images, and a scene's images may take {} MiB \
             in total; use smaller or fewer images",
            mib(size),
            mib(before),
            mib(most_bytes)
        ))
    };
    sizes.iter().map(check).collect()
}

/// Content of a texture's file and, if that file is a glTF file, of the image file that it references.
type TextureFileContentIds = (FileContentId, Option<FilePathAndContentId>);

/// An image, its mipmaps if needed, and whether all of this came from the cache.
type DecodedTextureWithMipmaps = (Arc<DecodedTexture>, Option<Arc<Mipmaps>>, bool);

/// Loads an image and its mipmaps. Sets `contents` to the contents that were decoded.
fn load_one(
    image: &ImageWithTextures<'_>,
    contents: &mut TextureFileContentIds,
    reading: &FileReadContext<'_>,
) -> Result<DecodedTextureWithMipmaps, AssetError> {
    let mut was_kept = true;
    let decoded = match &image.kept.texels {
        Some(decoded) => decoded.clone(),
        None => {
            was_kept = false;
            let DecodedImage { texels, warnings } = decode(image, contents, reading)?;
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
fn decode(
    image: &ImageWithTextures<'_>,
    contents: &mut TextureFileContentIds,
    reading: &FileReadContext<'_>,
) -> Result<DecodedImage, AssetError> {
    let (one, limits) = (image.asked_by[0], ImageLimits::default());
    let (encoding, token) = (one.source.encoding, reading.token);
    contents.1 = None;
    let file = match one.source.image {
        None => image.path().to_owned(),
        Some(number) => {
            let (input, hash) = reading.containers.image_input((image.path(), number), token)?;
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
    let load = |progress: Progress<'_>| load_hashed(&file, encoding, limits, progress, token);
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
    source: &TextureSource,
    reading: &FileReadContext<'_>,
) -> Result<ImageInput, AssetError> {
    match source.image {
        None => Ok(ImageInput::File(source.path.clone())),
        Some(image) => {
            reading.containers.image_input((&source.path, image), reading.token).map(|(input, _)| input)
        }
    }
}

/// Returns the width, height and memory size of an image.
fn image_dimensions_and_memory(
    source: &TextureSource,
    reading: &FileReadContext<'_>,
) -> Result<(u32, u32, u64), AssetError> {
    let (limits, encoding) = (ImageLimits::default(), source.encoding);
    match locate_image_bytes(source, reading)? {
        ImageInput::File(path) => read_dimensions_and_decoded_bytes(&path, encoding, limits, reading.token),
        ImageInput::Bytes(bytes) => embedded_dimensions_and_decoded_bytes(
            EmbeddedImage { path: &source.path, bytes },
            encoding,
            limits,
            reading.token,
        ),
    }
}

/// Adds textures that only `check` loads: unused textures from the scene file, and a black environment map.
fn add_check_only_textures(loaded: &LoadedScene, wanted: &mut Vec<NeededTexture>) {
    let name = |path: &Path, image: Option<u32>| (path.to_owned(), image);
    let mut known: HashSet<_> = wanted.iter().map(|one| name(&one.source.path, one.source.image)).collect();
    for (index, texture) in loaded.scene.textures.iter().enumerate() {
        if !known.insert(name(&texture.file.value, texture.image)) {
            continue;
        }
        let encoding = match texture.encoding {
            TextureEncoding::Auto => ImageEncoding::Color,
            TextureEncoding::Srgb => ImageEncoding::Srgb,
            TextureEncoding::Linear => ImageEncoding::Linear,
        };
        let (path, image) = (texture.file.value.clone(), texture.image);
        let source = TextureSource { path, image, encoding, coverage: None };
        wanted.push(NeededTexture {
            source,
            name: texture.name.clone(),
            declared: Some(index),
            mesh_file: None,
            material: None,
            statement: None,
            normals_of: None,
            is_environment: false,
            has_mipmaps: false,
        });
    }
    let environment = loaded.scene.environment.as_ref().and_then(|environment| environment.file.as_ref());
    if let Some(file) = environment.filter(|file| known.insert(name(&file.value, None))) {
        wanted.push(NeededTexture::for_environment(&file.value));
    }
}

/// Returns the span that references a texture: its own table, or the mesh whose materials use it.
fn reference_span(loaded: &LoadedScene, one: &NeededTexture) -> Range<usize> {
    let scene = &loaded.scene;
    let declared = one.declared.map(|index| scene.textures[index].file.span.clone());
    let mesh = || one.mesh_file.map(|index| scene.mesh_files[index].span.clone());
    let environment = || environment_span(scene).filter(|_| one.is_environment);
    declared.or_else(mesh).or_else(environment).unwrap_or(0..0)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::protocol::{Failure, Stage, Status};
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

    #[test]
    fn file_with_two_names_is_loaded_once() {
        let tables = "[textures.other]\nfile = \"./skin.ppm\"\n[materials.other]\ndiffuse = { texture = \"other\" }\n\
                      [[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"other\"\n";
        let mut bench = Bench::new(&format!("{SCENE}{tables}"));
        let report = bench.done().0;
        assert_eq!(report.counters.texels_loaded, 1);
        bench.edit("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]");
        let report = bench.done().0;
        assert_eq!(report.stages[Stage::Textures as usize].status, Status::Reused);
        // Changes must be detected through both names.
        fs::write(bench.path("skin.ppm"), "P6\n1 1\n255\nxyz").expect("written");
        assert_eq!(bench.done().0.stages[Stage::Textures as usize].status, Status::Done);
    }
}
