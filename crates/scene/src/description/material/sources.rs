//! Parameters of materials: constants or textures.

use crate::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use crate::materials::{Channel, ChannelSelector, EmissionSides};
use crate::math::Vec3;

/// A color or a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// A constant color.
    Constant(Vec3),
    /// Index into [`Scene::textures`](super::super::Scene::textures).
    Texture(usize),
}

/// A number or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NumberSource {
    /// A constant number.
    Constant(f32),
    /// A channel of a texture.
    Texture {
        /// Index into [`Scene::textures`](super::super::Scene::textures).
        texture: usize,
        /// The channel. `None` selects the key's default channel.
        channel: Option<Channel>,
    },
}

impl NumberSource {
    /// The number, or `None` if it is a texture.
    pub fn as_constant(&self) -> Option<f32> {
        match *self {
            Self::Constant(number) => Some(number),
            Self::Texture { .. } => None,
        }
    }

    /// Returns the texture's index and how to compute the number from a pixel: from the specified channel, or
    /// with `usual` if no channel is specified. Returns `None` if the number is constant.
    pub fn texture_index_and_channel(&self, usual: ChannelSelector) -> Option<(usize, ChannelSelector)> {
        match *self {
            Self::Constant(_) => None,
            Self::Texture { texture, channel } => {
                Some((texture, channel.map_or(usual, ChannelSelector::Channel)))
            }
        }
    }
}

/// Opacity of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacitySource {
    /// The opacity, in [0, 1].
    pub value: NumberSource,
    /// Threshold for alpha testing, or 0 to disable it.
    pub cutoff: f32,
}

impl OpacitySource {
    /// A fully opaque surface.
    pub const FULL: Self = Self { value: NumberSource::Constant(1.0), cutoff: 0.0 };

    /// Whether the surface is opaque everywhere.
    pub fn is_opaque(&self) -> bool {
        match self.value {
            NumberSource::Constant(value) => value >= 1.0 || self.cutoff > 0.0 && value >= self.cutoff,
            NumberSource::Texture { .. } => false,
        }
    }

    /// Returns the texture's index and how to compute the opacity from a pixel, or `None` if the opacity is
    /// constant.
    pub fn texture_index_and_channel(&self) -> Option<(usize, ChannelSelector)> {
        self.value.texture_index_and_channel(ChannelSelector::Opacity)
    }
}

/// A dielectric layer over a material.
#[derive(Clone, Debug, PartialEq)]
pub struct CoatSource {
    /// Weight of the layer, in [0, 1].
    pub weight: NumberSource,
    /// Square root of the GGX α, in [0, 1].
    pub roughness: NumberSource,
    /// Index of refraction, in [1, 10].
    pub ior: f32,
    /// Transmittance for a round trip through the layer at normal incidence, in [0, 1].
    pub tint: ColorSource,
}

impl CoatSource {
    /// No coat.
    pub const NONE: Self = Self {
        weight: NumberSource::Constant(0.0),
        roughness: NumberSource::Constant(0.0),
        ior: 1.5,
        tint: ColorSource::Constant(Vec3::ONE),
    };

    /// Whether the coat may have a weight above 0.
    pub fn exists(&self) -> bool {
        self.weight != NumberSource::Constant(0.0)
    }

    /// Returns [`CoatSource::NONE`] if the weight is 0, so that the other keys do not affect fingerprints.
    #[must_use]
    pub fn cleared_if_zero_weight(self) -> Self {
        if self.exists() { self } else { Self::NONE }
    }
}

/// Reflectance of a smooth conductor.
#[derive(Clone, Debug, PartialEq)]
pub enum ConductorFresnelSource {
    /// Schlick's approximation with the reflectance at normal incidence.
    Schlick(ColorSource),
    /// Fresnel equations with the complex index of refraction.
    Index {
        /// Real part of the index of refraction.
        eta: ColorSource,
        /// Imaginary part of the index of refraction.
        k: ColorSource,
    },
}

/// Emitted radiance, constant or textured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionSource {
    /// The radiance, or a scale factor for the texture.
    pub scale: Vec3,
    /// Index into [`Scene::textures`](super::super::Scene::textures).
    pub texture: Option<usize>,
    /// The sides that emit light.
    pub sides: EmissionSides,
}

impl EmissionSource {
    /// No emission.
    pub const NONE: Self = Self::from_constant(Vec3::ZERO);

    /// Creates a source that emits constant radiance from the front.
    pub const fn from_constant(radiance: Vec3) -> Self {
        Self { scale: radiance, texture: None, sides: EmissionSides::Front }
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Index into [`Scene::textures`](super::super::Scene::textures).
    pub texture: usize,
    /// Scale factor for the slopes, ≥ 0.
    pub strength: f32,
}

/// A height map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Index into [`Scene::textures`](super::super::Scene::textures).
    pub texture: usize,
    /// The channel that contains the heights. `None` selects the luminance.
    pub channel: Option<Channel>,
    /// Displacement where the map is white. Negative values invert the relief.
    pub scale: f32,
}

impl Bump {
    /// Returns how to compute the height from a pixel.
    pub fn height_channel_selector(&self) -> ChannelSelector {
        self.channel.map_or(ChannelSelector::Luminance, ChannelSelector::Channel)
    }
}

impl ColorSource {
    /// Constant black.
    pub const BLACK: Self = Self::Constant(Vec3::ZERO);

    /// Returns the texture's index, or `None` if the color is constant.
    pub(super) fn texture_index(&self) -> Option<usize> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(index) => Some(*index),
        }
    }
}

impl Fingerprinted for ColorSource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Constant(color) => {
                key.add_usize(0).add_vec3(*color);
            }
            Self::Texture(index) => {
                of.textures[*index].add_to_fingerprint(key.add_usize(1), of);
            }
        }
    }
}

impl Fingerprinted for OpacitySource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { value, cutoff } = self;
        key.add_f32(*cutoff).add_with_references(value, of);
    }
}

impl Fingerprinted for CoatSource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { weight, roughness, ior, tint } = self;
        key.add_with_references(weight, of)
            .add_with_references(roughness, of)
            .add_f32(*ior)
            .add_with_references(tint, of);
    }
}

impl Fingerprinted for NumberSource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match *self {
            Self::Constant(value) => {
                key.add_usize(0).add_f32(value);
            }
            Self::Texture { texture, channel } => {
                key.add_usize(1).add_bool(channel.is_some());
                if let Some(channel) = channel {
                    key.add_choice_name(channel);
                }
                of.textures[texture].add_to_fingerprint(key, of);
            }
        }
    }
}

impl Fingerprinted for ConductorFresnelSource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Schlick(color) => {
                key.add_usize(0).add_with_references(color, of);
            }
            Self::Index { eta, k } => {
                key.add_usize(1).add_with_references(eta, of).add_with_references(k, of);
            }
        }
    }
}

impl Fingerprinted for EmissionSource {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { scale, texture, sides } = *self;
        key.add_vec3(scale).add_choice_name(sides).add_bool(texture.is_some());
        if let Some(texture) = texture {
            of.textures[texture].add_to_fingerprint(key, of);
        }
    }
}

impl Fingerprinted for NormalMap {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { texture, strength } = *self;
        of.textures[texture].add_to_fingerprint(key.add_f32(strength), of);
    }
}

impl Fingerprinted for Bump {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { texture, channel, scale } = *self;
        key.add_f32(scale).add_with_references(&NumberSource::Texture { texture, channel }, of);
    }
}
