//! Converts texture descriptions, from scene and mesh files, into textures that can be looked up.

use std::sync::Arc;

use super::textures::{TextureImageKey, file_texture_image_key, scene_material_image_key};
use super::{Images, TexelsAndMipmaps};
use crate::assets::FileTexture;
use crate::materials::UvSet;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::texture::{
    ImageTexture, Pattern, PatternTexture, Texture, TextureFilter, TextureMapping, UvTransform,
    ValueScaleAndOffset, Wrap,
};
use crate::math::Vec3;
use crate::scene::description::{self, ImageSource, PixelInterpretation, Scene, TextureRole, TextureSource};

/// Converts a texture of a material from the scene file, given by its index and role.
pub(super) fn lower_texture(
    scene: &Scene,
    images: &Images,
    material: &description::Material,
    (index, role): (usize, TextureRole),
) -> Texture {
    let declared = &scene.textures[index];
    match &declared.content {
        TextureSource::Image(image) => {
            let source = scene_material_image_key(scene, material, (index, role), image);
            Texture::Image(lower_image(declared, image, loaded_image_or_placeholder(images, &source), role))
        }
        TextureSource::Pattern { colors, pattern } => {
            Texture::Pattern(lower_pattern(declared, *colors, pattern, role))
        }
    }
}

fn lower_image(
    declared: &description::Texture,
    image: &ImageSource,
    loaded: TexelsAndMipmaps,
    role: TextureRole,
) -> ImageTexture {
    let &description::Texture { filter, factor, .. } = declared;
    let &ImageSource { wrap, repeat, rotate, offset, uv, .. } = image;
    let TexelsAndMipmaps { texels, mipmaps } = loaded;
    let mipmaps = match filter {
        TextureFilter::Nearest | TextureFilter::Bilinear => None,
        TextureFilter::Mipmap => mipmaps,
    };
    let moved = UvTransform::new(uv, rotate, offset.as_dvec2()).map(Box::new);
    let factor = match role.pixel_interpretation() {
        PixelInterpretation::Color | PixelInterpretation::CutOut | PixelInterpretation::Number(_) => {
            ValueScaleAndOffset::from_scale(factor)
        }
        PixelInterpretation::Normal => None,
    };
    ImageTexture { texels, mipmaps, filter, wrap, mapping: TextureMapping { repeat, moved }, factor }
}

/// Converts a pattern. Numbers use the same value in every channel.
fn lower_pattern(
    declared: &description::Texture,
    colors: [Vec3; 2],
    pattern: &Pattern,
    role: TextureRole,
) -> PatternTexture {
    let is_filtered = match declared.filter {
        TextureFilter::Nearest | TextureFilter::Bilinear => false,
        TextureFilter::Mipmap => true,
    };
    let colors = match role.pixel_interpretation() {
        PixelInterpretation::Color | PixelInterpretation::CutOut => {
            colors.map(|color| color * declared.factor)
        }
        PixelInterpretation::Number(number) => {
            let factor = if matches!(role, TextureRole::Bump(_)) { 1.0 } else { declared.factor.x };
            colors.map(|color| Vec3::splat(number.value_of_opaque_color(color) * factor))
        }
        PixelInterpretation::Normal => colors,
    };
    PatternTexture { pattern: pattern.clone(), colors, is_filtered }
}

/// Converts a texture of a mesh file. Returns `None` if the image was not loaded, either because it is not
/// needed or because it could not be read.
pub(super) fn lower_mesh_file_texture(
    images: &Images,
    texture: &FileTexture,
    used: PixelInterpretation,
) -> Option<Arc<Texture>> {
    let texels = images.get(&file_texture_image_key(texture, used))?.texels.clone();
    let (base, gain) = texture.range;
    let factor = match used {
        PixelInterpretation::Color | PixelInterpretation::CutOut | PixelInterpretation::Number(_) => {
            ValueScaleAndOffset::from_scale_and_offset(Vec3::splat(gain), Vec3::splat(base))
        }
        PixelInterpretation::Normal => None,
    };
    let moved = UvTransform::new(UvSet::First, 0.0, texture.offset).map(Box::new);
    Some(Arc::new(Texture::Image(ImageTexture {
        texels,
        mipmaps: None,
        filter: TextureFilter::Bilinear,
        wrap: if texture.is_clamped { Wrap::Clamp } else { Wrap::Repeat },
        mapping: TextureMapping { repeat: texture.repeat, moved },
        factor,
    })))
}

/// Returns a loaded image, or a placeholder if the image was not loaded. Images that are not loaded are used
/// only by materials without objects, whose textures are never looked up.
fn loaded_image_or_placeholder(images: &Images, source: &TextureImageKey) -> TexelsAndMipmaps {
    images.get(source).cloned().unwrap_or_else(|| {
        let data = TexelData::Linear8(vec![[128, 128, 255]]);
        TexelsAndMipmaps {
            texels: Arc::new(Texels { width: 1, height: 1, data, unusable: 0 }),
            mipmaps: None,
        }
    })
}
