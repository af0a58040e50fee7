//! The textures stage: decodes images in parallel if they are used by visible materials and their content has
//! changed.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::cache::{CacheOfNamedValues, EvictableCache};
use super::super::formats::has_model_extension;
use super::super::protocol::reasons;
use super::super::watch::content::FilePathAndContentId;
use super::meshes::MeshesByFileIndex;
use super::texture_images::{
    CachedTexelsAndMipmaps, DecodedTexture, ImageWithTextures, TextureKey, load_images_or_reject_excess,
    texture_key,
};
use super::texture_warnings::{
    add_unreadable_image_errors, environment_file_span, replace_unreadable_image, warn_about_image,
};
use super::{AbortReason, FileCounts, FileReadContext, Findings, StageResult, loading_result};
use crate::assets::image::ColorEncoding;
use crate::control::Canceled;
use crate::materials::Mipmaps;
use crate::materials::texels::Texels;
use crate::scene::LoadedScene;
use crate::scene::description::TextureEncoding;
use crate::scene::fingerprint::Fingerprint;
use crate::world::{
    Images, NeededTexture, TexelsAndMipmaps, TextureImageKey, TextureRolesNeededByRender,
    environment_map_image_key, textures_needed,
};

/// Maximum total size of a scene's texels, in bytes.
const MAX_BYTES: u64 = 2 << 30;

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
        needed.iter().all(|one| self.texels.get_even_if_stale(&texture_key(&one.source)).is_some())
    }

    pub(crate) fn caches_mut(&mut self) -> [&mut dyn EvictableCache; 2] {
        [&mut self.texels, &mut self.mipmaps]
    }

    /// Forgets the linked files of images that are no longer cached.
    pub(crate) fn forget_links_of_evicted_images(&mut self) {
        let texels = &self.texels;
        self.linked.retain(|name, _| texels.get_even_if_stale(name).is_some());
    }
}

/// The loaded textures of a scene. Excludes textures that failed to load.
#[derive(Debug, Default)]
pub(crate) struct LoadedTextures {
    pub(crate) images: Images,
    /// Key of each image.
    pub(crate) key_of: HashMap<TextureImageKey, Fingerprint>,
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
) -> Result<StageResult<LoadedTextures>, AbortReason> {
    reading.add_generated_files(loaded, findings);
    let mut textures = LoadedTextures::default();
    let NeededTextures { textures: needed, left_out, are_required } = needed;
    if needed.is_empty() {
        let why = match left_out {
            0 => reasons::NO_TEXTURES,
            _ => reasons::NOT_NEEDED_FOR_VIEW,
        };
        return Ok(StageResult::skipped(textures, why));
    }
    let environment = environment_map_image_key(&loaded.scene);
    let images = group_by_image(needed, cache, reading)?;
    let assets = load_images_or_reject_excess(&images, MAX_BYTES, reading);
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
                let loaded_image = TexelsAndMipmaps { texels: texels.clone(), mipmaps: mipmaps.clone() };
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
                warn_about_image(loaded, &image, &decoded, findings);
                if let Some(mipmaps) = &mipmaps {
                    let bytes = mipmaps.memory_bytes();
                    cache.mipmaps.insert(image.name.clone(), key, mipmaps.clone(), bytes);
                }
                let bytes = texels.memory_bytes();
                cache.texels.insert(image.name, key, decoded, bytes);
            }
            Err(error) => {
                let error = AbortReason::reject_fatal_asset_error(error)?;
                counts.failed += 1;
                if !are_required && loaded.is_foreign() && has_model_extension(&loaded.path) {
                    for one in &image.asked_by {
                        replace_unreadable_image(loaded, one, &error, &mut textures.images, findings);
                    }
                } else {
                    add_unreadable_image_errors(loaded, &image, &error, findings);
                }
            }
        }
    }
    if let Some((_, texels)) = textures.environment.as_ref().filter(|(_, texels)| texels.is_black()) {
        let size = format!("{} × {}", texels.width, texels.height);
        let message = format!("the environment map is black: none of its {size} pixels emits light");
        findings.add_warning(loaded, environment_file_span(&loaded.scene).unwrap_or(0..0), message);
    }
    Ok(loading_result(textures, FileCounts { left_out: *left_out, ..counts }))
}

/// Groups the needed textures by file and encoding, in their original order, and looks up cached data.
fn group_by_image<'a>(
    needed: &'a [NeededTexture],
    cache: &mut TextureCache,
    reading: &FileReadContext<'_>,
) -> Result<Vec<ImageWithTextures<'a>>, Canceled> {
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

/// Adds textures that only `check` loads: unused textures from the scene file, and a black environment map.
fn add_check_only_textures(loaded: &LoadedScene, wanted: &mut Vec<NeededTexture>) {
    let name = |path: &Path, image: Option<u32>| (path.to_owned(), image);
    let mut known: HashSet<_> = wanted.iter().map(|one| name(&one.source.path, one.source.image)).collect();
    for (index, texture) in loaded.scene.textures.iter().enumerate() {
        let Some(image) = texture.as_image() else { continue };
        if !known.insert(name(&image.file.value, image.image)) {
            continue;
        }
        let encoding = match image.encoding {
            TextureEncoding::Auto => ColorEncoding::Color,
            TextureEncoding::Srgb => ColorEncoding::Srgb,
            TextureEncoding::Linear => ColorEncoding::Linear,
        };
        let (path, image) = (image.file.value.clone(), image.image);
        let source = TextureImageKey { path, image, encoding, coverage: None };
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

#[cfg(test)]
mod tests {
    use std::fs;

    use crate::protocol::{Stage, StageStatus};
    use crate::tests::{Bench, SCENE};

    #[test]
    fn file_with_two_names_is_loaded_once() {
        let tables = "[textures.other]\nfile = \"./skin.ppm\"\n[materials.other]\ndiffuse = { texture = \"other\" }\n\
                      [[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"other\"\n";
        let mut bench = Bench::new(&format!("{SCENE}{tables}"));
        let report = bench.done().0;
        assert_eq!(report.counters.texels_loaded, 1);
        bench.edit("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]");
        let report = bench.done().0;
        assert_eq!(report.stages[Stage::Textures as usize].status, StageStatus::Reused);
        // Changes must be detected through both names.
        fs::write(bench.path("skin.ppm"), "P6\n1 1\n255\nxyz").expect("written");
        assert_eq!(bench.done().0.stages[Stage::Textures as usize].status, StageStatus::Done);
    }
}
