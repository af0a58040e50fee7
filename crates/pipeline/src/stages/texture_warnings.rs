//! Warnings about textures.

use std::fmt::Display;
use std::ops::Range;
use std::sync::Arc;

use super::Findings;
use super::texture_images::{DecodedTexture, ImageWithTextures};
use crate::assets::AssetError;
use crate::assets::image::{ColorEncoding, ColorTransferFunction};
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::scene::LoadedScene;
use crate::scene::description::{Channel, ChannelSelector, Scene, TextureRole};
use crate::scene::diagnostic::Severity;
use crate::world::{Images, NeededTexture, TexelsAndMipmaps};

/// Warns about an unreadable image in a model and replaces it with a constant. Preserves the material's
/// factors, except that emission is dropped. Materials from mesh files provide their own values for use
/// without a texture.
pub(super) fn replace_unreadable_image(
    loaded: &LoadedScene,
    one: &NeededTexture,
    error: &AssetError,
    images: &mut Images,
    findings: &mut Findings,
) {
    let file = loaded.path.display();
    let mut warn = |material: &str| {
        let help = format!("glimt shows the material \"{material}\" in {file} without it");
        let warning = loaded.create_diagnostic_at(
            texture_reference_span(loaded, one),
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
        let mut roles = material
            .own_textures_with_roles()
            .into_iter()
            .filter(|(texture, _)| *texture == declared)
            .peekable();
        if roles.peek().is_some() {
            warn(&material.name);
        }
        is_light &= roles.all(|(_, role)| role == TextureRole::Emission);
    }
    let texel = match one.source.encoding {
        ColorEncoding::Linear => Vec3::new(0.5, 0.5, 1.0),
        ColorEncoding::Color | ColorEncoding::CutOut(ColorTransferFunction::Auto) if is_light => Vec3::ZERO,
        ColorEncoding::Color
        | ColorEncoding::Srgb
        | ColorEncoding::Raw
        | ColorEncoding::CutOut(_)
        | ColorEncoding::Number { .. } => Vec3::ONE,
    };
    let texels = Texels { width: 1, height: 1, data: TexelData::Float(vec![texel]), unusable: 0 };
    images.insert(one.source.clone(), TexelsAndMipmaps { texels: Arc::new(texels), mipmaps: None });
}

/// Prefixes a message about an image with the MTL line that references the image.
fn prefix_mtl_line(one: &NeededTexture, message: &impl Display) -> String {
    match &one.statement {
        Some(statement) => format!("{statement}: {message}"),
        None => message.to_string(),
    }
}

/// Adds an error at each reference to an unreadable image.
pub(super) fn add_unreadable_image_errors(
    loaded: &LoadedScene,
    image: &ImageWithTextures<'_>,
    error: &AssetError,
    findings: &mut Findings,
) {
    for one in &image.asked_by {
        let span = texture_reference_span(loaded, one);
        match (&one.material, one.mesh_file) {
            (Some(material), Some(file)) => {
                let file = loaded.scene.mesh_files[file].value.display();
                let help = format!("it is used by the material \"{material}\" in {file}");
                findings.add_error(loaded, span, prefix_mtl_line(one, error), &help);
            }
            (Some(_), None) | (None, _) => findings.add_asset_error(loaded, span, error),
        }
    }
}

/// Adds the warnings about a decoded image at the places where the image is referenced.
pub(super) fn warn_about_image(
    loaded: &LoadedScene,
    image: &ImageWithTextures<'_>,
    decoded: &DecodedTexture,
    findings: &mut Findings,
) {
    let (first, texels) = (image.asked_by[0], &decoded.texels);
    let pixels = unusable_pixels_warning(image, texels).map(|message| (first, message));
    let (heights, alpha) = (gray_normal_map_warning(image, texels), opaque_alpha_warning(image, texels));
    let of_file = decoded.warnings.iter().map(|message| (first, message.clone()));
    for (one, message) in pixels.into_iter().chain(heights).chain(alpha).chain(of_file) {
        findings.add_warning(loaded, texture_reference_span(loaded, one), prefix_mtl_line(one, &message));
    }
}

/// Returns a warning about pixels that are negative, not finite or too large.
fn unusable_pixels_warning(image: &ImageWithTextures<'_>, texels: &Texels) -> Option<String> {
    let count = match texels.unusable {
        0 => return None,
        1 => "1 pixel is".to_owned(),
        count => format!("{count} pixels are"),
    };
    let path = image.path().display();
    Some(format!("{path}: {count} negative, not finite or above 1e18 in a channel; glimt uses 0 instead"))
}

/// Returns a warning that a gray normal map is probably a height map. If it comes from a mesh file, it does
/// not change the normals.
fn gray_normal_map_warning<'a>(
    image: &ImageWithTextures<'a>,
    texels: &Texels,
) -> Option<(&'a NeededTexture, String)> {
    let normals = image.asked_by.iter().find_map(|one| Some((*one, one.normals_of.as_deref()?)));
    let (one, material) = normals.filter(|_| texels.are_all_gray())?;
    let effect = match one.mesh_file {
        Some(_) => "it does not change the normals (use `bump` for heights)",
        None => "it tilts all normals to one side (use `bump` for heights)",
    };
    let path = image.path().display();
    let message =
        format!("the normal map {path} of \"{material}\" is gray and probably contains heights: {effect}");
    Some((one, message))
}

/// Returns a warning about an image used with `channel = "a"` whose alpha is 1 everywhere.
fn opaque_alpha_warning<'a>(
    image: &ImageWithTextures<'a>,
    texels: &Texels,
) -> Option<(&'a NeededTexture, String)> {
    const ALPHA: ChannelSelector = ChannelSelector::Channel(Channel::Alpha);
    let is_alpha =
        |one: &&&NeededTexture| matches!(one.source.encoding, ColorEncoding::Number { of: ALPHA, .. });
    let one = image.asked_by.iter().find(is_alpha).filter(|_| texels.is_white())?;
    let path = image.path().display();
    Some((*one, format!("{path} has no alpha below 1: `channel = \"a\"` is 1 everywhere")))
}

/// Returns the span of the environment map's file name.
pub(super) fn environment_file_span(scene: &Scene) -> Option<Range<usize>> {
    scene.environment.as_ref()?.file.as_ref().map(|file| file.span.clone())
}

/// Returns the span that references a texture: its own table, or the mesh whose materials use it.
fn texture_reference_span(loaded: &LoadedScene, one: &NeededTexture) -> Range<usize> {
    let scene = &loaded.scene;
    let declared = one.declared.and_then(|index| Some(scene.textures[index].as_image()?.file.span.clone()));
    let mesh = || one.mesh_file.map(|index| scene.mesh_files[index].span.clone());
    let environment = || environment_file_span(scene).filter(|_| one.is_environment);
    declared.or_else(mesh).or_else(environment).unwrap_or(0..0)
}
