//! How materials use their textures, and how the pixels of these textures are interpreted.

use super::sources::{ColorSource, ConductorFresnelSource, NumberSource};
use super::{Material, MaterialKind, PhongParameters};
use crate::materials::ChannelSelector;

/// How a texture's pixels are interpreted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelInterpretation {
    /// Pixels are colors.
    Color,
    /// Pixels are surface colors, and the image's alpha channel is the surface's opacity.
    CutOut,
    /// Pixels are tangent-space normals.
    Normal,
    /// Pixels are converted to numbers.
    Number(ChannelSelector),
}

/// Role of a texture in a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureRole {
    /// Diffuse reflectance kd.
    Diffuse,
    /// Specular reflectance ks.
    Specular,
    /// Ambient reflectance ka.
    Ambient,
    /// Reflectance or index of refraction of the microfacets.
    Facets,
    /// Roughness or another microfacet parameter.
    Roughness(ChannelSelector),
    /// Emitted radiance.
    Emission,
    /// Normal map.
    NormalMap,
    /// Height map.
    Bump(ChannelSelector),
    /// Opacity of the surface.
    Opacity(ChannelSelector),
    /// Weight or roughness of an emitter's clear coat.
    EmissionCoat(ChannelSelector),
    /// Weight of a blend.
    BlendWeight(ChannelSelector),
}

impl TextureRole {
    /// Returns how the texture's pixels are interpreted in this role.
    pub fn pixel_interpretation(self) -> PixelInterpretation {
        match self {
            Self::Diffuse | Self::Specular | Self::Ambient | Self::Facets | Self::Emission => {
                PixelInterpretation::Color
            }
            Self::Roughness(number)
            | Self::Bump(number)
            | Self::Opacity(number)
            | Self::EmissionCoat(number)
            | Self::BlendWeight(number) => PixelInterpretation::Number(number),
            Self::NormalMap => PixelInterpretation::Normal,
        }
    }
}

impl MaterialKind {
    /// Returns the color parameters that may be textures, each with its role.
    fn color_parameters_with_roles(&self) -> Vec<(&ColorSource, TextureRole)> {
        match self {
            Self::Phong(PhongParameters { diffuse, specular, ambient, diffuse_transmission, .. }) => vec![
                (diffuse, TextureRole::Diffuse),
                (diffuse_transmission, TextureRole::Diffuse),
                (specular, TextureRole::Specular),
                (ambient.as_ref().unwrap_or(diffuse), TextureRole::Ambient),
            ],
            Self::Metal { fresnel: ConductorFresnelSource::Schlick(color), .. } => {
                vec![(color, TextureRole::Facets)]
            }
            Self::Metal { fresnel: ConductorFresnelSource::Index { eta, k }, .. } => {
                vec![(eta, TextureRole::Facets), (k, TextureRole::Facets)]
            }
            Self::Plastic { diffuse, specular, .. } => vec![
                (diffuse, TextureRole::Diffuse),
                (diffuse, TextureRole::Ambient),
                (specular, TextureRole::Specular),
            ],
            Self::Principled { color, specular_color, diffuse_transmission, .. } => vec![
                (diffuse_transmission, TextureRole::Facets),
                (color, TextureRole::Facets),
                (color, TextureRole::Ambient),
                (specular_color, TextureRole::Facets),
            ],
            Self::Mirror { reflectance: color } | Self::Pane { ior: _, tint: color } => {
                vec![(color, TextureRole::Facets)]
            }
            Self::Glass { .. } | Self::Blend { .. } => Vec::new(),
        }
    }

    /// Returns the numeric parameters that may be textures.
    fn texturable_number_parameters(&self) -> Vec<NumberSource> {
        match self {
            Self::Metal { roughness, anisotropy, .. } => vec![*roughness, *anisotropy],
            Self::Plastic { roughness, .. } | Self::Glass { roughness, .. } => vec![*roughness],
            Self::Principled { metallic, roughness, specular, transmission, .. } => {
                vec![*metallic, *roughness, *specular, *transmission]
            }
            Self::Phong(_) | Self::Mirror { .. } | Self::Pane { .. } | Self::Blend { .. } => Vec::new(),
        }
    }
}

impl Material {
    /// Returns the material's textures, as indices into [`Scene::textures`](super::super::Scene::textures) with
    /// their roles. Textures of a blend's parts are excluded. A texture may occur several times.
    pub fn own_textures_with_roles(&self) -> Vec<(usize, TextureRole)> {
        let Self { name: _, kind, sides: _, emission, normal_map, bump, opacity, coat } = self;
        let coat = Some(coat).filter(|coat| coat.exists());
        let coat_tint = coat.map(|coat| (&coat.tint, TextureRole::Facets));
        let emitter_tint = self.emitter_coat().map(|coat| (&coat.tint, TextureRole::Emission));
        let colors = kind
            .color_parameters_with_roles()
            .into_iter()
            .chain(coat_tint)
            .chain(emitter_tint)
            .filter_map(|(color, role)| Some((color.texture_index()?, role)));
        let numbers = kind
            .texturable_number_parameters()
            .into_iter()
            .chain(coat.into_iter().flat_map(|coat| [coat.weight, coat.roughness]))
            .filter_map(|number| number.texture_index_and_channel(ChannelSelector::Luminance));
        let numbers = numbers.map(|(texture, number)| (texture, TextureRole::Roughness(number)));
        let shown = emission.texture.filter(|_| self.emits()).map(|index| (index, TextureRole::Emission));
        let normals = normal_map.map(|map| (map.texture, TextureRole::NormalMap));
        let heights = bump.map(|bump| (bump.texture, TextureRole::Bump(bump.height_channel_selector())));
        let opacity = opacity
            .texture_index_and_channel()
            .map(|(texture, number)| (texture, TextureRole::Opacity(number)));
        let coat = self.emitter_coat().into_iter().flat_map(|coat| [coat.weight, coat.roughness]);
        let coat = coat.filter_map(|number| number.texture_index_and_channel(ChannelSelector::Luminance));
        let coat = coat.map(|(texture, number)| (texture, TextureRole::EmissionCoat(number)));
        let weight = match kind {
            MaterialKind::Blend { weight, parts: _ } => {
                weight.texture_index_and_channel(ChannelSelector::Luminance)
            }
            MaterialKind::Phong(_)
            | MaterialKind::Mirror { .. }
            | MaterialKind::Glass { .. }
            | MaterialKind::Pane { .. }
            | MaterialKind::Metal { .. }
            | MaterialKind::Plastic { .. }
            | MaterialKind::Principled { .. } => None,
        };
        let weight = weight.map(|(texture, number)| (texture, TextureRole::BlendWeight(number)));
        let surface = shown.into_iter().chain(normals).chain(heights).chain(opacity).chain(coat);
        colors.chain(numbers).chain(surface).chain(weight).collect()
    }
}
