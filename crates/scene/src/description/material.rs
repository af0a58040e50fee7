//! Materials: the `[materials.*]` tables.

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
pub use crate::materials::microfacet::MicrofacetDistribution;
pub use crate::materials::{Channel, ChannelSelector, EmissionSides, ReflectingSides};
use crate::math::{DVec3, Vec3};

/// A color or a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// A constant color.
    Constant(Vec3),
    /// Index into [`Scene::textures`](super::Scene::textures).
    Texture(usize),
}

/// A number or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NumberSource {
    /// A constant number.
    Constant(f32),
    /// A channel of a texture.
    Texture {
        /// Index into [`Scene::textures`](super::Scene::textures).
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
    pub fn or_none(self) -> Self {
        if self.exists() { self } else { Self::NONE }
    }
}

/// Reflectance of a smooth conductor.
#[derive(Clone, Debug, PartialEq)]
pub enum FresnelSource {
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
    /// Index into [`Scene::textures`](super::Scene::textures).
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

/// A named material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name of the material in the scene file.
    pub name: String,
    /// Reflection and transmission.
    pub kind: MaterialKind,
    /// The sides that reflect light.
    pub sides: ReflectingSides,
    /// Emitted radiance.
    pub emission: EmissionSource,
    /// Normal map, if any.
    pub normal_map: Option<NormalMap>,
    /// Height map, if any. Applied after the normal map.
    pub bump: Option<Bump>,
    /// Opacity of the surface.
    pub opacity: OpacitySource,
    /// Layer over the surface.
    pub coat: CoatSource,
}

impl MaterialKind {
    /// Name of the material type in scene files.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Phong(_) => "phong",
            Self::Mirror { .. } => "mirror",
            Self::Glass { .. } | Self::Pane { .. } => "glass",
            Self::Metal { .. } => "metal",
            Self::Plastic { .. } => "plastic",
            Self::Principled { .. } => "principled",
            Self::Blend { .. } => "blend",
        }
    }

    /// Whether the material has a δ lobe, like a mirror, smooth glass or a smooth coat.
    pub fn has_delta_lobe(&self) -> bool {
        match self {
            Self::Phong(_) | Self::Principled { .. } => false,
            Self::Metal { roughness, .. }
            | Self::Plastic { roughness, .. }
            | Self::Glass { roughness, .. } => *roughness == NumberSource::Constant(0.0),
            Self::Mirror { .. } | Self::Pane { .. } => true,
            Self::Blend { .. } => self.is_any_part(|part| part.kind.has_delta_lobe()),
        }
    }

    /// The materials of a blend, or an empty slice for other materials.
    pub fn parts(&self) -> &[Material] {
        match self {
            Self::Blend { weight: _, parts } => &**parts,
            Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Glass { .. }
            | Self::Pane { .. }
            | Self::Metal { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => &[],
        }
    }

    /// Whether a property holds for any part of a blend.
    fn is_any_part(&self, property: impl Fn(&Material) -> bool) -> bool {
        self.parts().iter().any(property)
    }

    /// Whether the material is solid glass with index of refraction 1, which does not refract in air.
    pub fn is_index_matched_glass(&self) -> bool {
        match self {
            Self::Glass { ior, .. } => *ior == 1.0,
            Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Metal { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. }
            | Self::Blend { .. } => false,
        }
    }

    /// Whether the material is anisotropic, and therefore depends on the direction in which texture
    /// coordinates increase.
    pub fn is_anisotropic(&self) -> bool {
        match self {
            Self::Metal { anisotropy, .. } => *anisotropy != NumberSource::Constant(0.0),
            Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Glass { .. }
            | Self::Pane { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => false,
            Self::Blend { .. } => self.is_any_part(|part| part.kind.is_anisotropic()),
        }
    }

    /// Whether the material has a color that can be multiplied by vertex colors.
    pub fn accepts_vertex_colors(&self) -> bool {
        match self {
            Self::Metal { fresnel: FresnelSource::Index { .. }, .. } | Self::Glass { .. } => false,
            Self::Metal { fresnel: FresnelSource::Schlick(_), .. }
            | Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => true,
            Self::Blend { .. } => self.is_any_part(|part| part.kind.accepts_vertex_colors()),
        }
    }

    /// Whether light passes through the surface even where its opacity is 1.
    pub fn transmits(&self) -> bool {
        match self {
            Self::Glass { .. } | Self::Pane { .. } => true,
            Self::Principled { transmission, diffuse_transmission, .. } => {
                *transmission != NumberSource::Constant(0.0) || *diffuse_transmission != ColorSource::BLACK
            }
            Self::Phong(PhongParameters { diffuse_transmission, .. }) => {
                *diffuse_transmission != ColorSource::BLACK
            }
            Self::Mirror { .. } | Self::Metal { .. } | Self::Plastic { .. } => false,
            Self::Blend { .. } => self.is_any_part(|part| part.kind.transmits()),
        }
    }

    /// Whether the material is solid glass.
    pub fn is_solid_glass(&self) -> bool {
        self.glass_medium_identity().is_some()
    }

    /// Returns a key for the interior of solid glass: the bits of its index of refraction and transmittance,
    /// but not its roughness. Returns `None` for other materials.
    pub fn glass_medium_identity(&self) -> Option<[u64; 4]> {
        match *self {
            Self::Glass { ior, tint, .. } => Some([f64::from(ior), tint.x, tint.y, tint.z].map(f64::to_bits)),
            Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Metal { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. }
            | Self::Blend { .. } => None,
        }
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: usize,
    /// Scale factor for the slopes, ≥ 0.
    pub strength: f32,
}

/// A height map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Index into [`Scene::textures`](super::Scene::textures).
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

/// Parameters of a Phong surface.
#[derive(Clone, Debug, PartialEq)]
pub struct PhongParameters {
    /// Diffuse reflectance kd.
    pub diffuse: ColorSource,
    /// Specular reflectance ks.
    pub specular: ColorSource,
    /// Phong exponent α ≥ 0.
    pub shininess: f32,
    /// Ambient reflectance ka. `None` uses the diffuse color.
    pub ambient: Option<ColorSource>,
    /// Diffuse transmittance kt.
    pub diffuse_transmission: ColorSource,
}

/// Reflection and transmission of a material.
#[derive(Clone, Debug, PartialEq)]
pub enum MaterialKind {
    /// The normalized Phong model.
    Phong(PhongParameters),
    /// A perfect mirror.
    Mirror {
        /// Reflectance, in [0, 1].
        reflectance: ColorSource,
    },
    /// Smooth or rough dielectric.
    Glass {
        /// Index of refraction of the interior, in [0.1, 10]. If it is below 1, the interior is optically
        /// thinner than the exterior, like a bubble in water.
        ior: f32,
        /// Transmittance of the interior per unit length, in [0, 1].
        tint: DVec3,
        /// Square root of α, in [0, 1]; 0 is smooth.
        roughness: NumberSource,
        /// Distribution of the facets.
        distribution: MicrofacetDistribution,
    },
    /// An infinitely thin pane of smooth glass.
    Pane {
        /// Index of refraction, in [0.1, 10].
        ior: f32,
        /// Transmittance of the glass at any angle, in [0, 1].
        tint: ColorSource,
    },
    /// A conductor with a microfacet surface.
    Metal {
        /// Fresnel reflectance of the facets.
        fresnel: FresnelSource,
        /// Square root of α, in [0, 1]; 0 is a mirror.
        roughness: NumberSource,
        /// Stretch of the highlight along u, in [−1, 1].
        anisotropy: NumberSource,
        /// Distribution of the facets.
        distribution: MicrofacetDistribution,
    },
    /// A diffuse base under a dielectric microfacet coat.
    Plastic {
        /// Diffuse reflectance kd, in [0, 1].
        diffuse: ColorSource,
        /// Scale factor for the coat's reflectance, in [0, 1].
        specular: ColorSource,
        /// Index of refraction, in [1, 10].
        ior: f32,
        /// Square root of the coat's α, in [0, 1]; 0 is smooth.
        roughness: NumberSource,
        /// Distribution of the coat's facets.
        distribution: MicrofacetDistribution,
        /// Whether light that the coat reflects back saturates the color.
        nonlinear: bool,
    },
    /// The glTF material model. Colors and numbers are in [0, 1], except for `ior` and `specular_color`.
    Principled {
        /// Diffuse reflectance of the dielectric part, and the metal's reflectance at normal incidence.
        color: ColorSource,
        /// Weight of the metal.
        metallic: NumberSource,
        /// Square root of the GGX α.
        roughness: NumberSource,
        /// Index of refraction, in [1, 10].
        ior: f32,
        /// Scale factor for the dielectric part's specular reflectance.
        specular: NumberSource,
        /// Scale factor for the dielectric part's specular reflectance at normal incidence, ≥ 0.
        specular_color: ColorSource,
        /// Fraction of the non-specular light that is transmitted instead of scattered diffusely.
        transmission: NumberSource,
        /// Diffuse transmittance kt, at most 1 − `color`.
        diffuse_transmission: ColorSource,
    },
    /// A blend of two materials, which may be blends.
    Blend {
        /// Weight of the second material, in [0, 1].
        weight: NumberSource,
        /// The materials.
        parts: Box<[Material; 2]>,
    },
}

impl ColorSource {
    /// Constant black.
    pub const BLACK: Self = Self::Constant(Vec3::ZERO);

    /// Returns the texture's index, or `None` if the color is constant.
    fn texture_index(&self) -> Option<usize> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(index) => Some(*index),
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
            Self::Metal { fresnel: FresnelSource::Schlick(color), .. } => vec![(color, TextureRole::Facets)],
            Self::Metal { fresnel: FresnelSource::Index { eta, k }, .. } => {
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
    /// Whether shapes with this material are lights.
    pub fn emits(&self) -> bool {
        self.emission.scale != Vec3::ZERO || self.kind.is_any_part(Self::emits)
    }

    /// The sides of the surface that may emit light.
    pub fn emission_sides(&self) -> EmissionSides {
        let is_both = |part: &Self| part.emits() && part.emission_sides() == EmissionSides::Both;
        if self.kind.is_any_part(is_both) { EmissionSides::Both } else { self.emission.sides }
    }

    /// The material itself and, for a blend, all of its parts.
    pub fn with_parts(&self) -> Vec<&Self> {
        let parts = self.kind.parts().iter().flat_map(Self::with_parts);
        std::iter::once(self).chain(parts).collect()
    }

    /// Returns the coat, or `None` if it does not attenuate any emission.
    pub fn emitter_coat(&self) -> Option<&CoatSource> {
        (self.emits() && self.coat.exists()).then_some(&self.coat)
    }

    /// Returns the material's textures, as indices into [`Scene::textures`](super::Scene::textures) with
    /// their roles, but not those of the parts of a blend. A texture may occur several times.
    pub fn textures(&self) -> Vec<(usize, TextureRole)> {
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

impl Fingerprinted for ColorSource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Constant(color) => {
                key.add_usize(0).add_vec3(*color);
            }
            Self::Texture(index) => {
                of.textures[*index].add_to(key.add_usize(1), of);
            }
        }
    }
}

impl Fingerprinted for OpacitySource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { value, cutoff } = self;
        key.add_f32(*cutoff).add(value, of);
    }
}

impl Fingerprinted for CoatSource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { weight, roughness, ior, tint } = self;
        key.add(weight, of).add(roughness, of).add_f32(*ior).add(tint, of);
    }
}

impl Fingerprinted for NumberSource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match *self {
            Self::Constant(value) => {
                key.add_usize(0).add_f32(value);
            }
            Self::Texture { texture, channel } => {
                key.add_usize(1).add_bool(channel.is_some());
                if let Some(channel) = channel {
                    key.add_choice(channel);
                }
                of.textures[texture].add_to(key, of);
            }
        }
    }
}

impl Fingerprinted for FresnelSource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Schlick(color) => {
                key.add_usize(0).add(color, of);
            }
            Self::Index { eta, k } => {
                key.add_usize(1).add(eta, of).add(k, of);
            }
        }
    }
}

impl Fingerprinted for EmissionSource {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { scale, texture, sides } = *self;
        key.add_vec3(scale).add_choice(sides).add_bool(texture.is_some());
        if let Some(texture) = texture {
            of.textures[texture].add_to(key, of);
        }
    }
}

impl Fingerprinted for NormalMap {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { texture, strength } = *self;
        of.textures[texture].add_to(key.add_f32(strength), of);
    }
}

impl Fingerprinted for Bump {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { texture, channel, scale } = *self;
        key.add_f32(scale).add(&NumberSource::Texture { texture, channel }, of);
    }
}

impl Fingerprinted for MaterialKind {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Phong(PhongParameters { diffuse, specular, shininess, ambient, diffuse_transmission }) => {
                key.add_usize(0).add_f32(*shininess).add(diffuse, of).add(specular, of).add(ambient, of);
                key.add(diffuse_transmission, of);
            }
            Self::Mirror { reflectance } => {
                key.add_usize(1).add(reflectance, of);
            }
            Self::Glass { ior, tint, roughness, distribution } => {
                key.add_usize(2).add_f32(*ior).add_dvec3(*tint).add(roughness, of).add_choice(*distribution);
            }
            Self::Pane { ior, tint } => {
                key.add_usize(3).add_f32(*ior).add(tint, of);
            }
            Self::Metal { fresnel, roughness, anisotropy, distribution } => {
                key.add_usize(6).add(fresnel, of).add(roughness, of).add(anisotropy, of);
                key.add_choice(*distribution);
            }
            Self::Plastic { diffuse, specular, ior, roughness, distribution, nonlinear } => {
                key.add_usize(4).add(diffuse, of).add(specular, of).add_f32(*ior).add(roughness, of);
                key.add_choice(*distribution).add_bool(*nonlinear);
            }
            Self::Principled {
                color,
                metallic,
                roughness,
                ior,
                specular,
                specular_color,
                transmission,
                diffuse_transmission,
            } => {
                key.add_usize(5).add(color, of).add(metallic, of).add(roughness, of).add_f32(*ior);
                key.add(specular, of).add(specular_color, of).add(transmission, of);
                key.add(diffuse_transmission, of);
            }
            Self::Blend { weight, parts } => {
                let [first, second] = &**parts;
                key.add_usize(7).add(weight, of).add(first, of).add(second, of);
            }
        }
    }
}

impl Fingerprinted for Material {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { name: _, kind, sides, emission, normal_map, bump, opacity, coat } = self;
        key.add(kind, of).add(emission, of).add(normal_map, of).add(bump, of).add(opacity, of).add(coat, of);
        key.add_choice(*sides);
    }
}
