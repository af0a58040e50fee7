//! Which image files a scene looks up.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assets::image::ImageEncoding;
use crate::assets::{FileMaterial, LoadedMesh};
use crate::scene::description::{ColorSource, Encoding, Material, MaterialKind, Scene};

/// An image file, and how its numbers are read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TextureSource {
    /// The file.
    pub path: PathBuf,
    /// How its numbers are read.
    pub encoding: ImageEncoding,
}

/// What a texture is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Colours.
    Color,
    /// Normals.
    Normal,
}

/// An image file that is needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeededTexture {
    /// File and encoding.
    pub source: TextureSource,
    /// Its name on progress bars.
    pub name: String,
    /// Index into [`Scene::textures`]; none: a mesh file's own texture.
    pub declared: Option<usize>,
    /// Index into [`Scene::mesh_files`] of the mesh whose material names it.
    pub mesh_file: Option<usize>,
}

/// The image files that materials of objects look up, each once. Textures that no such material names are not among
/// them.
pub fn textures_needed(scene: &Scene, meshes: &[Arc<LoadedMesh>]) -> Vec<NeededTexture> {
    let mut needed: Vec<NeededTexture> = Vec::new();
    let mut known = HashSet::new();
    let mut add = |texture: NeededTexture| {
        if known.insert(texture.source.clone()) {
            needed.push(texture);
        }
    };
    let (used_materials, own_materials) = in_use(scene);
    for (material, _) in scene.materials.iter().zip(used_materials).filter(|(_, used)| *used) {
        for (texture, used) in material_textures(material) {
            add(NeededTexture {
                source: declared_source(scene, texture, used),
                name: scene.textures[texture].name.clone(),
                declared: Some(texture),
                mesh_file: None,
            });
        }
    }
    for (file, mesh) in meshes.iter().enumerate().filter(|(file, _)| own_materials[*file]) {
        for (path, used) in mesh.materials.iter().flat_map(file_textures) {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            add(NeededTexture {
                source: file_source(path, used),
                name,
                declared: None,
                mesh_file: Some(file),
            });
        }
    }
    needed
}

/// Which materials of the scene some object has, and which mesh files' own materials some instance takes.
fn in_use(scene: &Scene) -> (Vec<bool>, Vec<bool>) {
    let (mut materials, mut files) =
        (vec![false; scene.materials.len()], vec![false; scene.mesh_files.len()]);
    for object in &scene.objects {
        match (object.material, object.shape.mesh_file()) {
            (Some(material), _) => materials[material] = true,
            (None, Some(file)) => files[file] = true,
            (None, None) => {}
        }
    }
    (materials, files)
}

/// Where a texture of the scene file comes from when it is used for something.
pub fn declared_source(scene: &Scene, texture: usize, used: Use) -> TextureSource {
    let texture = &scene.textures[texture];
    let encoding = match (texture.encoding, used) {
        (Encoding::Srgb, Use::Color | Use::Normal) => ImageEncoding::Srgb,
        (Encoding::Linear, Use::Color | Use::Normal) | (Encoding::Auto, Use::Normal) => ImageEncoding::Linear,
        (Encoding::Auto, Use::Color) => ImageEncoding::Color,
    };
    TextureSource { path: texture.file.value.clone(), encoding }
}

/// Where a texture of a mesh file comes from.
pub fn file_source(path: &Path, used: Use) -> TextureSource {
    let encoding = match used {
        Use::Color => ImageEncoding::Color,
        Use::Normal => ImageEncoding::Linear,
    };
    TextureSource { path: path.to_owned(), encoding }
}

/// Indices of the textures that a material names.
fn material_textures(material: &Material) -> Vec<(usize, Use)> {
    // Every field by name: a new one may name a texture.
    let (diffuse, specular, ambient, normal_map) = match &material.kind {
        MaterialKind::Phong { diffuse, specular, shininess: _, ambient, emission: _, normal_map } => {
            (diffuse, specular, ambient, normal_map)
        }
        MaterialKind::Mirror { reflectance: _ } | MaterialKind::Glass { ior: _, tint: _ } => {
            return Vec::new();
        }
    };
    let color = |source: &ColorSource| match source {
        ColorSource::Texture(index) => Some((*index, Use::Color)),
        ColorSource::Constant(_) => None,
    };
    let normal = normal_map.map(|(index, _)| (index, Use::Normal));
    [color(diffuse), color(specular), ambient.as_ref().and_then(color), normal]
        .into_iter()
        .flatten()
        .collect()
}

fn file_textures(material: &FileMaterial) -> impl Iterator<Item = (&Path, Use)> {
    let color = [&material.diffuse_texture, &material.specular_texture];
    let colors = color.into_iter().flatten().map(|path| (path.as_path(), Use::Color));
    colors.chain(material.normal_texture.iter().map(|path| (path.as_path(), Use::Normal)))
}
