//! Determines which image files a scene needs.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assets::image::{ColorEncoding, ColorTransferFunction};
use crate::assets::{FileLine, FileMaterial, FileTexture, LoadedMesh};
use crate::math::Vec3;
use crate::scene::description::{
    Channel, ChannelSelector, ImageSource, Material, PixelInterpretation, Scene, TextureEncoding,
    TextureFilter, TextureRole,
};

/// An image file and its encoding.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TextureImageKey {
    /// File path.
    pub path: PathBuf,
    /// Index of the image in a glTF file, or `None` for a separate image file.
    pub image: Option<u32>,
    /// Encoding of the pixel values.
    pub encoding: ColorEncoding,
    /// Alpha cutoff at which mip levels preserve coverage, or `None` for ordinary mip levels.
    pub coverage: Option<HashableAlphaCutoff>,
}

/// An alpha cutoff, stored as the bits of an `f32` so that it can be hashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct HashableAlphaCutoff(u32);

impl HashableAlphaCutoff {
    /// Converts a cutoff for opacity to a cutoff for pixel values. `factor` is the factor applied to the
    /// image.
    pub fn from_opacity_cutoff_and_factor(cutoff: f32, factor: f32) -> Self {
        Self(if factor > 0.0 { cutoff / factor } else { f32::INFINITY }.to_bits())
    }

    /// Smallest pixel value at which the surface is opaque.
    pub fn value(self) -> f32 {
        f32::from_bits(self.0)
    }
}

/// An image file that must be loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeededTexture {
    /// The file and its encoding.
    pub source: TextureImageKey,
    /// Name shown in progress bars.
    pub name: String,
    /// Index into [`Scene::textures`], or `None` if only a mesh file refers to the image.
    pub declared: Option<usize>,
    /// Index into [`Scene::mesh_files`] of the mesh file that refers to the image.
    pub mesh_file: Option<usize>,
    /// Name of the mesh file's material that refers to the image, or `None` for other textures.
    pub material: Option<String>,
    /// Line in the MTL file that refers to the image, or `None` for other textures.
    pub statement: Option<FileLine>,
    /// Name of a material that uses the image as a normal map, if there is one.
    pub normals_of: Option<String>,
    /// Whether the image is the environment map.
    pub is_environment: bool,
    /// Whether mip levels are needed.
    pub has_mipmaps: bool,
}

impl NeededTexture {
    /// The image used as the environment map.
    pub fn for_environment(file: &Path) -> Self {
        Self {
            source: environment_image_key_from_path(file),
            name: "environment".to_owned(),
            declared: None,
            mesh_file: None,
            material: None,
            statement: None,
            normals_of: None,
            is_environment: true,
            has_mipmaps: false,
        }
    }
}

/// The texture roles that a rendered image needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureRolesNeededByRender {
    /// Diffuse reflectance.
    pub diffuse: bool,
    /// Glossy reflectance.
    pub specular: bool,
    /// Ambient reflectance of Phong surfaces.
    pub ambient: bool,
    /// Emission textures and the environment map.
    pub lights: bool,
    /// Normal maps and height maps.
    pub normals: bool,
    /// All textures of specular materials (mirrors, thin panes, glass, smooth coats). They affect how other
    /// surfaces appear in reflections and behind glass.
    pub by_delta: bool,
}

impl TextureRolesNeededByRender {
    /// Every texture.
    pub const ALL: Self =
        Self { diffuse: true, specular: true, ambient: true, lights: true, normals: true, by_delta: true };
    /// No textures except opacity, which is needed for every image.
    pub const NONE: Self = Self {
        diffuse: false,
        specular: false,
        ambient: false,
        lights: false,
        normals: false,
        by_delta: false,
    };

    /// Combined needs of two images.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            diffuse: self.diffuse || other.diffuse,
            specular: self.specular || other.specular,
            ambient: self.ambient || other.ambient,
            lights: self.lights || other.lights,
            normals: self.normals || other.normals,
            by_delta: self.by_delta || other.by_delta,
        }
    }

    /// Whether textures with this role are needed. `is_delta` is true for materials with δ lobes.
    fn includes_role(self, role: TextureRole, is_delta: bool) -> bool {
        match role {
            TextureRole::Diffuse => self.diffuse,
            TextureRole::Specular => self.specular || self.by_delta && is_delta,
            TextureRole::Facets | TextureRole::Roughness(_) => {
                self.diffuse || self.specular || self.by_delta && is_delta
            }
            TextureRole::Ambient => self.ambient,
            TextureRole::Emission | TextureRole::EmissionCoat(_) => self.lights,
            TextureRole::NormalMap | TextureRole::Bump(_) => self.normals || self.by_delta && is_delta,
            TextureRole::Opacity(_) | TextureRole::BlendWeight(_) => true,
        }
    }
}

/// Lists the image files needed by materials in use, without duplicates.
pub fn textures_needed(
    scene: &Scene,
    meshes: &[Arc<LoadedMesh>],
    lookups: TextureRolesNeededByRender,
) -> Vec<NeededTexture> {
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
    let (used_materials, own_materials) = used_material_and_mesh_file_flags(scene);
    let used = scene.materials.iter().zip(used_materials).filter(|(_, used)| *used);
    for material in used.flat_map(|(material, _)| material.self_and_blend_parts()) {
        let (textures, is_delta) =
            (material.own_textures_with_roles().into_iter(), material.kind.has_delta_lobe());
        for (texture, role) in textures.filter(|(_, role)| lookups.includes_role(*role, is_delta)) {
            let Some(image) = scene.textures[texture].as_image() else { continue };
            add(NeededTexture {
                source: scene_material_image_key(scene, material, (texture, role), image),
                name: scene.textures[texture].name.clone(),
                declared: Some(texture),
                mesh_file: None,
                material: None,
                statement: None,
                normals_of: (role == TextureRole::NormalMap).then(|| material.name.clone()),
                is_environment: false,
                has_mipmaps: texture_uses_mipmaps(scene, texture),
            });
        }
    }
    for (file, mesh) in meshes.iter().enumerate().filter(|(file, _)| own_materials[*file]) {
        let of_material =
            |own| needed_textures_of_file_material(own, lookups).map(move |texture| (own, texture));
        for (own, (texture, used)) in mesh.materials.iter().flat_map(of_material) {
            let path = &texture.path;
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            add(NeededTexture {
                source: file_texture_image_key(texture, used),
                name,
                declared: None,
                mesh_file: Some(file),
                material: Some(own.name.clone()),
                statement: Some(texture.statement.clone()),
                normals_of: (used == PixelInterpretation::Normal).then(|| own.name.clone()),
                is_environment: false,
                has_mipmaps: false,
            });
        }
    }
    if let Some(file) = environment_map_path(scene).filter(|_| lookups.lights) {
        add(NeededTexture::for_environment(file));
    }
    needed
}

/// Whether a texture's filter uses mip levels.
fn texture_uses_mipmaps(scene: &Scene, texture: usize) -> bool {
    match scene.textures[texture].filter {
        TextureFilter::Nearest | TextureFilter::Bilinear => false,
        TextureFilter::Mipmap => true,
    }
}

/// The environment map's file, or `None` if there is no map or the map's color factor is black.
pub fn environment_map_image_key(scene: &Scene) -> Option<TextureImageKey> {
    environment_map_path(scene).map(environment_image_key_from_path)
}

fn environment_map_path(scene: &Scene) -> Option<&Path> {
    let environment = scene.environment.as_ref().filter(|environment| environment.color != Vec3::ZERO)?;
    Some(&environment.file.as_ref()?.value)
}

fn environment_image_key_from_path(file: &Path) -> TextureImageKey {
    TextureImageKey { path: file.to_owned(), image: None, encoding: ColorEncoding::Color, coverage: None }
}

/// Which of the scene's materials are used by objects, and which mesh files' materials are used by mesh
/// instances.
fn used_material_and_mesh_file_flags(scene: &Scene) -> (Vec<bool>, Vec<bool>) {
    let (mut materials, mut files) =
        (vec![false; scene.materials.len()], vec![false; scene.mesh_files.len()]);
    for object in &scene.objects {
        match (object.material, object.shape.as_mesh().map(|mesh| mesh.file)) {
            (Some(material), _) => materials[material] = true,
            (None, Some(file)) => files[file] = true,
            (None, None) => {}
        }
    }
    (materials, files)
}

/// Image file and encoding for a scene material's texture in this role. `image` is the texture's image.
pub fn scene_material_image_key(
    scene: &Scene,
    material: &Material,
    (texture, role): (usize, TextureRole),
    image: &ImageSource,
) -> TextureImageKey {
    let source =
        scene_texture_image_key(image, texture_pixel_interpretation(scene, material, (texture, role)));
    match role {
        TextureRole::Opacity(_) => TextureImageKey {
            coverage: cutoff_for_mip_coverage(scene, texture, material.opacity.cutoff),
            ..source
        },
        TextureRole::Diffuse
        | TextureRole::Specular
        | TextureRole::Ambient
        | TextureRole::Facets
        | TextureRole::Roughness(_)
        | TextureRole::Emission
        | TextureRole::EmissionCoat(_)
        | TextureRole::BlendWeight(_)
        | TextureRole::NormalMap
        | TextureRole::Bump(_) => source,
    }
}

/// Cutoff at which an opacity texture's mip levels preserve coverage, or `None` without a cutoff or mip
/// levels, and for patterns.
pub fn cutoff_for_mip_coverage(scene: &Scene, texture: usize, cutoff: f32) -> Option<HashableAlphaCutoff> {
    let is_image = scene.textures[texture].as_image().is_some();
    let is_covered = cutoff > 0.0 && texture_uses_mipmaps(scene, texture) && is_image;
    is_covered.then(|| {
        HashableAlphaCutoff::from_opacity_cutoff_and_factor(cutoff, scene.textures[texture].factor.x)
    })
}

/// How a scene material's texture is used in this role.
pub fn texture_pixel_interpretation(
    scene: &Scene,
    material: &Material,
    (texture, role): (usize, TextureRole),
) -> PixelInterpretation {
    match role.pixel_interpretation() {
        PixelInterpretation::Color | PixelInterpretation::CutOut => {
            let is_alpha = |number| match number {
                ChannelSelector::Opacity | ChannelSelector::Channel(Channel::Alpha) => true,
                ChannelSelector::Luminance | ChannelSelector::Channel(_) | ChannelSelector::Mask { .. } => {
                    false
                }
            };
            let opacity =
                material.opacity.texture_index_and_channel().filter(|(_, number)| is_alpha(*number));
            let is_cut_out =
                opacity.is_some_and(|(opacity, _)| have_same_image_and_mapping(scene, opacity, texture));
            if is_cut_out { PixelInterpretation::CutOut } else { PixelInterpretation::Color }
        }
        PixelInterpretation::Number(ChannelSelector::Opacity)
            if !material_uses_image_as_color(scene, material, texture) =>
        {
            PixelInterpretation::Number(ChannelSelector::Mask { of_any_color: false })
        }
        used @ (PixelInterpretation::Number(_) | PixelInterpretation::Normal) => used,
    }
}

/// Whether the material also uses the texture's image for a color.
fn material_uses_image_as_color(scene: &Scene, material: &Material, texture: usize) -> bool {
    let image =
        |texture: usize| scene.textures[texture].as_image().map(|image| (&image.file.value, image.image));
    material.own_textures_with_roles().into_iter().any(|(other, role)| {
        role.pixel_interpretation() == PixelInterpretation::Color && image(other) == image(texture)
    })
}

/// Whether two textures use the same image with the same texture coordinates.
fn have_same_image_and_mapping(scene: &Scene, a: usize, b: usize) -> bool {
    let [a, b] = [a, b].map(|texture| scene.textures[texture].as_image());
    let (Some(a), Some(b)) = (a, b) else { return false };
    let at =
        |image: &ImageSource| (image.image, image.wrap, image.repeat, image.rotate, image.offset, image.uv);
    a.file.value == b.file.value && at(a) == at(b)
}

/// Image file and encoding for a scene texture with this pixel interpretation.
pub fn scene_texture_image_key(image: &ImageSource, used: PixelInterpretation) -> TextureImageKey {
    let encoding = match (image.encoding, used) {
        (TextureEncoding::Srgb, PixelInterpretation::Color | PixelInterpretation::Normal) => {
            ColorEncoding::Srgb
        }
        (TextureEncoding::Linear, PixelInterpretation::Color | PixelInterpretation::Normal)
        | (TextureEncoding::Auto, PixelInterpretation::Normal) => ColorEncoding::Linear,
        (TextureEncoding::Auto, PixelInterpretation::Color) => ColorEncoding::Color,
        (TextureEncoding::Auto, PixelInterpretation::CutOut) => {
            ColorEncoding::CutOut(ColorTransferFunction::Auto)
        }
        (TextureEncoding::Srgb, PixelInterpretation::CutOut) => {
            ColorEncoding::CutOut(ColorTransferFunction::Srgb)
        }
        (TextureEncoding::Linear, PixelInterpretation::CutOut) => {
            ColorEncoding::CutOut(ColorTransferFunction::Linear)
        }
        (TextureEncoding::Srgb, PixelInterpretation::Number(of)) => {
            ColorEncoding::Number { of, is_srgb: true }
        }
        (TextureEncoding::Auto | TextureEncoding::Linear, PixelInterpretation::Number(of)) => {
            ColorEncoding::Number { of, is_srgb: false }
        }
    };
    TextureImageKey { path: image.file.value.clone(), image: image.image, encoding, coverage: None }
}

/// Returns the image file to load for a texture of a mesh file, and how to decode it for this use.
pub fn file_texture_image_key(texture: &FileTexture, used: PixelInterpretation) -> TextureImageKey {
    let encoding = match used {
        PixelInterpretation::Color => ColorEncoding::Color,
        PixelInterpretation::CutOut => ColorEncoding::CutOut(ColorTransferFunction::Auto),
        PixelInterpretation::Normal => ColorEncoding::Linear,
        PixelInterpretation::Number(of) => {
            ColorEncoding::Number { of: texture.number.unwrap_or(of), is_srgb: false }
        }
    };
    TextureImageKey { path: texture.path.clone(), image: None, encoding, coverage: None }
}

/// How textures from mesh files are used as scalar parameters.
pub const FILE_NUMBER: PixelInterpretation = PixelInterpretation::Number(ChannelSelector::Luminance);

/// How a mesh file material's color texture is used.
pub fn color_or_cutout_interpretation(own: &FileMaterial, texture: &FileTexture) -> PixelInterpretation {
    let is_alpha = |opacity: &&FileTexture| match opacity.number {
        None | Some(ChannelSelector::Opacity | ChannelSelector::Channel(Channel::Alpha)) => true,
        Some(ChannelSelector::Luminance | ChannelSelector::Channel(_) | ChannelSelector::Mask { .. }) => {
            false
        }
    };
    let opacity = own.opacity_texture.as_ref().filter(is_alpha);
    let is_cut_out = opacity.is_some_and(|opacity| opacity.has_same_image_and_mapping(texture));
    if is_cut_out { PixelInterpretation::CutOut } else { PixelInterpretation::Color }
}

/// Returns how a material from a mesh file uses its opacity texture.
pub fn opacity_pixel_interpretation(own: &FileMaterial, opacity: &FileTexture) -> PixelInterpretation {
    let colors = [&own.diffuse_texture, &own.specular_texture, &own.emission_texture];
    let is_color = colors.into_iter().flatten().any(|color| color.path == opacity.path);
    let number =
        if is_color { ChannelSelector::Opacity } else { ChannelSelector::Mask { of_any_color: true } };
    PixelInterpretation::Number(number)
}

fn needed_textures_of_file_material(
    own: &FileMaterial,
    lookups: TextureRolesNeededByRender,
) -> impl Iterator<Item = (&FileTexture, PixelInterpretation)> {
    let shared = [
        (&own.diffuse_texture, TextureRole::Ambient),
        (&own.emission_texture, TextureRole::Emission),
        (&own.normal_texture, TextureRole::NormalMap),
        (&own.opacity_texture, TextureRole::Opacity(ChannelSelector::Opacity)),
    ];
    let of_kind = match &own.physical {
        None => vec![
            (&own.diffuse_texture, TextureRole::Diffuse),
            (
                if own.allows_specular_highlight() { &own.specular_texture } else { &None },
                TextureRole::Specular,
            ),
        ],
        Some(physical) => {
            let role = TextureRole::Roughness(ChannelSelector::Luminance);
            let numbers = physical.textures().map(|texture| (texture, role));
            let coat = [&physical.clearcoat_texture, &physical.clearcoat_roughness_texture];
            let coat = coat.into_iter().filter(|_| own.emits());
            let coat = coat.map(|texture| (texture, TextureRole::EmissionCoat(ChannelSelector::Luminance)));
            let color = (&own.diffuse_texture, TextureRole::Facets);
            std::iter::once(color).chain(numbers).chain(coat).collect()
        }
    };
    let looked_up =
        of_kind.into_iter().chain(shared).filter(move |(_, role)| lookups.includes_role(*role, false));
    looked_up.filter_map(|(texture, role)| {
        let texture = texture.as_ref()?;
        let used = match role.pixel_interpretation() {
            PixelInterpretation::Color | PixelInterpretation::CutOut => {
                color_or_cutout_interpretation(own, texture)
            }
            PixelInterpretation::Number(ChannelSelector::Opacity) => {
                opacity_pixel_interpretation(own, texture)
            }
            used @ (PixelInterpretation::Number(_) | PixelInterpretation::Normal) => used,
        };
        Some((texture, used))
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;

    /// How a material uses its textures, in role order.
    fn uses(material: &str) -> Vec<PixelInterpretation> {
        let text = format!(
            "[camera]\nposition = [0, 5, 1]\nlook_at = [0, 0, 0]\n\
             [textures.leaf]\nfile = '../../assets/textures/leaf.png'\nencoding = 'srgb'\n\
             [textures.same]\nfile = '../../assets/textures/leaf.png'\nencoding = 'srgb'\n\
             [textures.moved]\nfile = '../../assets/textures/leaf.png'\noffset = [0.5, 0]\nencoding = 'srgb'\n\
             [textures.other]\nfile = '../../assets/textures/bumps.png'\n\
             [materials.m]\n{material}\n[[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = 'm'\n"
        );
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scene.toml");
        let outcome = crate::scene::parse(Arc::from(text.as_str()), &path);
        let scene = outcome.scene.unwrap_or_else(|| panic!("{:?}: {text}", outcome.diagnostics));
        let found = scene.materials.iter().find(|material| material.name == "m").expect("the material");
        found
            .own_textures_with_roles()
            .into_iter()
            .map(|used| texture_pixel_interpretation(&scene, found, used))
            .collect()
    }

    #[test]
    fn color_and_alpha_from_one_image_form_a_cut_out() {
        const MASK: PixelInterpretation =
            PixelInterpretation::Number(ChannelSelector::Mask { of_any_color: false });
        const ALPHA: PixelInterpretation =
            PixelInterpretation::Number(ChannelSelector::Channel(Channel::Alpha));
        const OPACITY: PixelInterpretation = PixelInterpretation::Number(ChannelSelector::Opacity);
        let (color, cut_out) = (PixelInterpretation::Color, PixelInterpretation::CutOut);
        let both = |diffuse: &str, opacity: &str| {
            let mut uses = uses(&format!("diffuse = {{ texture = '{diffuse}' }}\nopacity = {{ {opacity} }}"));
            uses.dedup();
            uses
        };
        assert_eq!(both("leaf", "texture = 'leaf'"), [cut_out, OPACITY]);
        assert_eq!(both("leaf", "texture = 'same'"), [cut_out, OPACITY]);
        assert_eq!(both("leaf", "texture = 'leaf', channel = 'a'"), [cut_out, ALPHA]);
        // With an offset, colors and alpha values do not match, so the color is not a cut-out. The opacity
        // still comes from a color image.
        assert_eq!(both("leaf", "texture = 'moved'"), [color, OPACITY]);
        // An image used only for opacity is a mask.
        assert_eq!(both("leaf", "texture = 'other'"), [color, MASK]);
        assert_eq!(uses("diffuse = 0.5\nopacity = { texture = 'leaf' }"), [MASK]);
        let red = PixelInterpretation::Number(ChannelSelector::Channel(Channel::Red));
        assert_eq!(both("leaf", "texture = 'leaf', channel = 'r'"), [color, red]);
        assert_eq!(uses("normal_map = 'other'"), [PixelInterpretation::Normal]);
    }
}
