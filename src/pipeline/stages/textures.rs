//! Image files that visible materials look up, several at once, each decoded only when its content changed.

use std::collections::HashMap;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use rayon::prelude::*;

use super::super::cache::Pool;
use super::super::fingerprint::{Fingerprint, Key};
use super::super::watch::content::{Content, FileRead};
use super::meshes::canonical;
use super::{Asset, Counts, Findings, Reading, Staged, Stop, loaded_and_kept};
use crate::assets::AssetError;
use crate::assets::image::{ImageEncoding, ImageLimits, load};
use crate::control::Cancelled;
use crate::materials::texels::Texels;
use crate::scene::Loaded;
use crate::scene::description::Encoding;
use crate::world::{NeededTexture, SourceEncoding, TextureSource};

/// The cache of textures: one entry per file and reading of its numbers.
pub(in crate::pipeline) type TextureCache = Pool<(PathBuf, SourceEncoding), Texels>;

/// The textures that were asked for, without those that failed.
#[derive(Debug, Default)]
pub(in crate::pipeline) struct Textures {
    pub(in crate::pipeline) texels: HashMap<TextureSource, Arc<Texels>>,
    /// Of what each was made, in the order asked for.
    pub(in crate::pipeline) keys: Vec<Key>,
    /// Texels read from files by this request.
    pub(in crate::pipeline) texels_loaded: u64,
}

/// Load these. All files are tried; errors go to the findings.
///
/// # Errors
/// Cancelled.
pub(in crate::pipeline) fn textures(
    loaded: &Loaded,
    needed: &[NeededTexture],
    cache: &mut TextureCache,
    findings: &mut Findings,
    reading: &Reading<'_>,
) -> Result<Staged<Textures>, Stop> {
    let mut textures = Textures::default();
    if needed.is_empty() {
        return Ok(Staged::skipped(textures, "no visible material names a texture"));
    }
    let before: Vec<(Content, Option<Arc<Texels>>)> = needed
        .iter()
        .map(|one| {
            let content = reading.contents.read(&one.source.path, reading.token)?;
            Ok((content, cache.get(&name(&one.source), key(&one.source, content))))
        })
        .collect::<Result<_, Cancelled>>()?;
    let assets: Vec<Asset<Texels>> = reading.pool.install(|| {
        needed
            .par_iter()
            .zip(before)
            .map(|(one, (content, kept))| load_one(one, content, kept, reading))
            .collect()
    });
    let mut counts = Counts::default();
    for (one, asset) in needed.iter().zip(assets) {
        let file = asset.files[0].clone();
        let key = key(&one.source, file.content);
        findings.read(file);
        match asset.result {
            Ok((texels, was_kept)) => {
                counts.kept += usize::from(was_kept);
                counts.loaded += usize::from(!was_kept);
                textures.texels_loaded += if was_kept { 0 } else { texels.len() as u64 };
                cache.insert(name(&one.source), key, texels.clone());
                textures.keys.push(key);
                textures.texels.insert(one.source.clone(), texels);
            }
            Err(AssetError::Cancelled(_)) => return Err(Stop::Cancelled),
            Err(error) => {
                counts.failed += 1;
                findings.asset_error(loaded, place(loaded, one), &error);
            }
        }
    }
    Ok(loaded_and_kept(textures, counts))
}

/// For `check`: also the textures of the scene file that no visible material names.
pub(in crate::pipeline) fn add_declared(loaded: &Loaded, wanted: &mut Vec<NeededTexture>) {
    for (index, texture) in loaded.scene.textures.iter().enumerate() {
        if wanted.iter().any(|one| one.source.path == texture.file.value) {
            continue;
        }
        let encoding = match texture.encoding {
            Encoding::Auto => SourceEncoding::Color,
            Encoding::Srgb => SourceEncoding::Srgb,
            Encoding::Linear => SourceEncoding::Linear,
        };
        let source = TextureSource { path: texture.file.value.clone(), encoding };
        wanted.push(NeededTexture {
            source,
            name: texture.name.clone(),
            declared: Some(index),
            mesh_file: None,
        });
    }
}

fn load_one(
    one: &NeededTexture,
    content: Content,
    kept: Option<Arc<Texels>>,
    reading: &Reading<'_>,
) -> Asset<Texels> {
    let path = &one.source.path;
    let files = vec![FileRead { path: path.clone(), content }];
    if let Some(texels) = kept {
        return Asset { files, result: Ok((texels, true)) };
    }
    let encoding = match one.source.encoding {
        SourceEncoding::Color => ImageEncoding::Color,
        SourceEncoding::Srgb => ImageEncoding::Srgb,
        SourceEncoding::Linear => ImageEncoding::Linear,
    };
    let result = reading
        .sink
        .asset(&one.name, |progress| load(path, encoding, ImageLimits::default(), progress, reading.token));
    Asset { files, result: result.map(|texels| (Arc::new(texels), false)) }
}

/// Where the scene names it: its own table, or the mesh whose materials look it up.
fn place(loaded: &Loaded, one: &NeededTexture) -> Range<usize> {
    let scene = &loaded.scene;
    let declared = one.declared.map(|index| scene.textures[index].file.span.clone());
    let mesh = || one.mesh_file.map(|index| scene.mesh_files[index].span.clone());
    declared.or_else(mesh).unwrap_or(0..0)
}

fn name(source: &TextureSource) -> (PathBuf, SourceEncoding) {
    (canonical(&source.path), source.encoding)
}

fn key(source: &TextureSource, content: Content) -> Key {
    Fingerprint::new("texture").path(&source.path).index(source.encoding as usize).content(content).finish()
}
