//! Image files that a scene looks up.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assets::image::ImageEncoding;
use crate::assets::{FileMaterial, LoadedMesh};
use crate::math::Vec3;
use crate::scene::description::{Encoding, PixelNumber, Scene, TextureFilter, TextureRole, TextureUse};

/// An image file, and the encoding of its numbers.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TextureSource {
    /// The file.
    pub path: PathBuf,
    /// Number of the image in a glTF file. `None` if the file is an image.
    pub image: Option<u32>,
    /// Encoding of its numbers.
    pub encoding: ImageEncoding,
}

/// An image file that is needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeededTexture {
    /// File and encoding.
    pub source: TextureSource,
    /// Its name on progress bars.
    pub name: String,
    /// Index into [`Scene::textures`]. `None` for a mesh file's own texture.
    pub declared: Option<usize>,
    /// Index into [`Scene::mesh_files`] of the mesh whose material names it.
    pub mesh_file: Option<usize>,
    /// Name of the mesh file's material, which names it. `None` for others.
    pub material: Option<String>,
    /// Name of a material that takes its normals from it. `None` if no material does.
    pub normals_of: Option<String>,
    /// Whether `[environment]` names it.
    pub is_environment: bool,
    /// Whether its mip levels are looked up.
    pub has_mipmaps: bool,
}

impl NeededTexture {
    /// The map of an environment.
    pub fn of_environment(file: &Path) -> Self {
        Self {
            source: environment_map(file),
            name: "environment".to_owned(),
            declared: None,
            mesh_file: None,
            material: None,
            normals_of: None,
            is_environment: true,
            has_mipmaps: false,
        }
    }
}

/// Textures that a picture looks up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lookups {
    /// Diffuse reflectance.
    pub diffuse: bool,
    /// Glossy reflectance.
    pub specular: bool,
    /// Ambient reflectance of Phong surfaces.
    pub ambient: bool,
    /// Emission textures, and the map of the environment.
    pub lights: bool,
    /// Normal maps and heights.
    pub normals: bool,
    /// All of mirrors, panes, glass and smooth coats, by which other surfaces are seen.
    pub by_delta: bool,
}

impl Lookups {
    /// All textures.
    pub const ALL: Self =
        Self { diffuse: true, specular: true, ambient: true, lights: true, normals: true, by_delta: true };
    /// No textures but those of opacity, which every picture looks up.
    pub const NONE: Self = Self {
        diffuse: false,
        specular: false,
        ambient: false,
        lights: false,
        normals: false,
        by_delta: false,
    };

    /// Whether textures of a role are looked up, in a material that is δ or not.
    fn has(self, role: TextureRole, is_delta: bool) -> bool {
        match role {
            TextureRole::Diffuse => self.diffuse,
            TextureRole::Specular => self.specular || self.by_delta && is_delta,
            TextureRole::Facets | TextureRole::Roughness(_) => {
                self.diffuse || self.specular || self.by_delta && is_delta
            }
            TextureRole::Ambient => self.ambient,
            TextureRole::Emission | TextureRole::EmissionCoat(_) => self.lights,
            TextureRole::NormalMap | TextureRole::Bump(_) => self.normals || self.by_delta && is_delta,
            TextureRole::Opacity(_) => true,
        }
    }
}

/// The image files that materials of objects look up for such a picture, each once. Textures that no such material names
/// are left out.
pub fn textures_needed(scene: &Scene, meshes: &[Arc<LoadedMesh>], lookups: Lookups) -> Vec<NeededTexture> {
    let mut needed: Vec<NeededTexture> = Vec::new();
    let mut known = HashMap::new();
    let mut add = |texture: NeededTexture| match known.entry(texture.source.clone()) {
        Entry::Vacant(new) => {
            new.insert(needed.len());
            needed.push(texture);
        }
        Entry::Occupied(place) => {
            let known = &mut needed[*place.get()];
            known.has_mipmaps |= texture.has_mipmaps;
            known.normals_of = known.normals_of.take().or(texture.normals_of);
        }
    };
    let (used_materials, own_materials) = in_use(scene);
    for (material, _) in scene.materials.iter().zip(used_materials).filter(|(_, used)| *used) {
        let (textures, is_delta) = (material.textures().into_iter(), material.kind.has_delta());
        for (texture, role) in textures.filter(|(_, role)| lookups.has(*role, is_delta)) {
            add(NeededTexture {
                source: declared_source(scene, texture, role.texture_use()),
                name: scene.textures[texture].name.clone(),
                declared: Some(texture),
                mesh_file: None,
                material: None,
                normals_of: (role == TextureRole::NormalMap).then(|| material.name.clone()),
                is_environment: false,
                has_mipmaps: has_mipmaps(scene, texture),
            });
        }
    }
    for (file, mesh) in meshes.iter().enumerate().filter(|(file, _)| own_materials[*file]) {
        let of_material = |own| file_textures(own, lookups).map(move |texture| (own, texture));
        for (own, (path, used)) in mesh.materials.iter().flat_map(of_material) {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            add(NeededTexture {
                source: file_source(path, used),
                name,
                declared: None,
                mesh_file: Some(file),
                material: Some(own.name.clone()),
                normals_of: (used == TextureUse::Normal).then(|| own.name.clone()),
                is_environment: false,
                has_mipmaps: false,
            });
        }
    }
    if let Some(file) = environment_file(scene).filter(|_| lookups.lights) {
        add(NeededTexture::of_environment(file));
    }
    needed
}

/// Whether the mip levels of a texture of the scene file are looked up.
fn has_mipmaps(scene: &Scene, texture: usize) -> bool {
    match scene.textures[texture].filter {
        TextureFilter::Nearest | TextureFilter::Bilinear => false,
        TextureFilter::Mipmap => true,
    }
}

/// Source of the environment's map. `None` without a map, or if its factor is black.
pub fn environment_source(scene: &Scene) -> Option<TextureSource> {
    environment_file(scene).map(environment_map)
}

fn environment_file(scene: &Scene) -> Option<&Path> {
    let environment = scene.environment.as_ref().filter(|environment| environment.color != Vec3::ZERO)?;
    Some(&environment.file.as_ref()?.value)
}

fn environment_map(file: &Path) -> TextureSource {
    TextureSource { path: file.to_owned(), image: None, encoding: ImageEncoding::Color }
}

/// Whether each material of the scene belongs to an object, and whether each mesh file's own materials belong to an
/// instance.
fn in_use(scene: &Scene) -> (Vec<bool>, Vec<bool>) {
    let (mut materials, mut files) =
        (vec![false; scene.materials.len()], vec![false; scene.mesh_files.len()]);
    for object in &scene.objects {
        match (object.material, object.shape.mesh().map(|mesh| mesh.file)) {
            (Some(material), _) => materials[material] = true,
            (None, Some(file)) => files[file] = true,
            (None, None) => {}
        }
    }
    (materials, files)
}

/// Source of a texture of the scene file for this use.
pub fn declared_source(scene: &Scene, texture: usize, used: TextureUse) -> TextureSource {
    let texture = &scene.textures[texture];
    let encoding = match (texture.encoding, used) {
        (Encoding::Srgb, TextureUse::Color | TextureUse::Normal) => ImageEncoding::Srgb,
        (Encoding::Linear, TextureUse::Color | TextureUse::Normal) | (Encoding::Auto, TextureUse::Normal) => {
            ImageEncoding::Linear
        }
        (Encoding::Auto, TextureUse::Color) => ImageEncoding::Color,
        (Encoding::Srgb, TextureUse::Number(of)) => ImageEncoding::Number { of, is_srgb: true },
        (Encoding::Auto | Encoding::Linear, TextureUse::Number(of)) => {
            ImageEncoding::Number { of, is_srgb: false }
        }
    };
    TextureSource { path: texture.file.value.clone(), image: texture.image, encoding }
}

/// Source of a texture of a mesh file for this use.
pub fn file_source(path: &Path, used: TextureUse) -> TextureSource {
    let encoding = match used {
        TextureUse::Color => ImageEncoding::Color,
        TextureUse::Normal => ImageEncoding::Linear,
        TextureUse::Number(of) => ImageEncoding::Number { of, is_srgb: false },
    };
    TextureSource { path: path.to_owned(), image: None, encoding }
}

/// Use of textures of mesh files as numbers.
pub const FILE_NUMBER: TextureUse = TextureUse::Number(PixelNumber::Luminance);
/// Use of textures of mesh files as opacity.
pub const FILE_OPACITY: TextureUse = TextureUse::Number(PixelNumber::Opacity);

fn file_textures(material: &FileMaterial, lookups: Lookups) -> impl Iterator<Item = (&Path, TextureUse)> {
    let shared = [
        (&material.diffuse_texture, TextureRole::Ambient),
        (&material.emission_texture, TextureRole::Emission),
        (&material.normal_texture, TextureRole::NormalMap),
        (&material.opacity_texture, TextureRole::Opacity(PixelNumber::Opacity)),
    ];
    let own = match &material.physical {
        None => vec![
            (&material.diffuse_texture, TextureRole::Diffuse),
            (
                if material.has_highlight() { &material.specular_texture } else { &None },
                TextureRole::Specular,
            ),
        ],
        Some(physical) => vec![
            (&material.diffuse_texture, TextureRole::Facets),
            (&physical.roughness_texture, TextureRole::Roughness(PixelNumber::Luminance)),
            (&physical.metallic_texture, TextureRole::Roughness(PixelNumber::Luminance)),
        ],
    };
    let looked_up = own.into_iter().chain(shared).filter(move |(_, role)| lookups.has(*role, false));
    looked_up.filter_map(|(path, role)| Some((path.as_deref()?, role.texture_use())))
}
