//! `[textures.*]` and `[materials.*]`.

use std::path::PathBuf;

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use super::Located;
use crate::choice;
pub use crate::materials::UvSet;
pub use crate::materials::texture::{TextureFilter, Wrap};
pub use crate::materials::{Channel, EmissionSides, PixelValue};
use crate::math::{DVec3, Vec2, Vec3};

/// An image that materials look up.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Its name in the scene.
    pub name: String,
    /// Its file, resolved against the scene's folder.
    pub file: Located<PathBuf>,
    /// Number of the image in a glTF file. `None` if the file is an image.
    pub image: Option<u32>,
    /// Interpolation.
    pub filter: TextureFilter,
    /// Outside [0, 1].
    pub wrap: Wrap,
    /// Repetitions in u and v; not 0.
    pub repeat: Vec2,
    /// Rotation of the repeated coordinates, in degrees from u to v.
    pub rotate: f64,
    /// Offset of the coordinates after that.
    pub offset: Vec2,
    /// Coordinates by which it is looked up.
    pub uv: UvSet,
    /// Meaning of its numbers.
    pub encoding: Encoding,
    /// Factor on the linear colours and numbers that are looked up, not on normals and heights.
    pub factor: Vec3,
}

choice! {
    /// Meaning of a texture's numbers.
    pub enum Encoding {
        /// sRGB for colours in 8 and 16 bits, linear for numbers, normal maps and float files.
        Auto = "auto",
        /// sRGB, decoded.
        Srgb = "srgb",
        /// Used as they are.
        Linear = "linear",
    }
}

/// A colour or a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// The same everywhere.
    Constant(Vec3),
    /// Index into [`Scene::textures`](super::Scene::textures).
    Texture(usize),
}

/// A number or a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NumberSource {
    /// The same everywhere.
    Constant(f32),
    /// The numbers of a texture.
    Texture {
        /// Index into [`Scene::textures`](super::Scene::textures).
        texture: usize,
        /// The channel that holds them. `None` for the usual number of a pixel.
        channel: Option<Channel>,
    },
}

impl NumberSource {
    /// The number, if it is the same everywhere.
    pub fn constant(&self) -> Option<f32> {
        match *self {
            Self::Constant(number) => Some(number),
            Self::Texture { .. } => None,
        }
    }

    /// The texture and its number of each pixel, if it is one; without a channel, the number is `usual`.
    pub fn texture(&self, usual: PixelValue) -> Option<(usize, PixelValue)> {
        match *self {
            Self::Constant(_) => None,
            Self::Texture { texture, channel } => Some((texture, channel.map_or(usual, PixelValue::Channel))),
        }
    }
}

/// The chance that a surface is there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacitySource {
    /// The chance in [0, 1].
    pub value: NumberSource,
    /// The chance from which the surface is there, below which it is not; 0 for none.
    pub cutoff: f32,
}

impl OpacitySource {
    /// A surface that is there.
    pub const FULL: Self = Self { value: NumberSource::Constant(1.0), cutoff: 0.0 };

    /// Whether the surface is there everywhere.
    pub fn is_full(&self) -> bool {
        match self.value {
            NumberSource::Constant(value) => value >= 1.0 || self.cutoff > 0.0 && value >= self.cutoff,
            NumberSource::Texture { .. } => false,
        }
    }

    /// The texture and its number of each pixel, if it has one.
    pub fn texture(&self) -> Option<(usize, PixelValue)> {
        self.value.texture(PixelValue::Opacity)
    }
}

/// Reflectance of a smooth conductor.
#[derive(Clone, Debug, PartialEq)]
pub enum FresnelSource {
    /// Schlick's approximation, by the reflectance at normal incidence.
    Schlick(ColorSource),
    /// Exact equations, by the complex index of refraction.
    Index {
        /// Its real part.
        eta: ColorSource,
        /// Its imaginary part.
        k: ColorSource,
    },
}

/// Radiance, the same everywhere or by a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionSource {
    /// The radiance; with a texture, what that is multiplied by.
    pub scale: Vec3,
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: Option<usize>,
    /// Sides that emit.
    pub sides: EmissionSides,
}

impl EmissionSource {
    /// None.
    pub const NONE: Self = Self::constant(Vec3::ZERO);

    /// The same everywhere on the front.
    pub const fn constant(radiance: Vec3) -> Self {
        Self { scale: radiance, texture: None, sides: EmissionSides::Front }
    }
}

/// A named material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the scene.
    pub name: String,
    /// Its reflection or transmission of light.
    pub kind: MaterialKind,
    /// Radiance.
    pub emission: EmissionSource,
    /// The map that bends the shading normals.
    pub normal_map: Option<NormalMap>,
    /// The heights that bend them further.
    pub bump: Option<Bump>,
    /// The chance that it is there.
    pub opacity: OpacitySource,
}

impl MaterialKind {
    /// Name of the type in a scene file.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Phong { .. } => "phong",
            Self::Mirror { .. } => "mirror",
            Self::Glass { .. } | Self::Pane { .. } => "glass",
            Self::Metal { .. } => "metal",
            Self::Plastic { .. } => "plastic",
            Self::Principled { .. } => "principled",
        }
    }

    /// Whether it has a δ lobe: as mirrors, glass and smooth coats have.
    pub fn has_delta(&self) -> bool {
        match self {
            Self::Phong { .. } | Self::Principled { .. } => false,
            Self::Metal { roughness, .. }
            | Self::Plastic { roughness, .. }
            | Self::Glass { roughness, .. } => *roughness == NumberSource::Constant(0.0),
            Self::Mirror { .. } | Self::Pane { .. } => true,
        }
    }

    /// Whether light goes straight on where it borders on air: glass of index 1, however rough.
    pub fn is_like_air(&self) -> bool {
        match self {
            Self::Glass { ior, .. } => *ior == 1.0,
            Self::Phong { .. }
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Metal { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => false,
        }
    }

    /// Whether it depends on the direction of texture coordinates.
    pub fn has_direction(&self) -> bool {
        match self {
            Self::Metal { anisotropy, .. } => *anisotropy != NumberSource::Constant(0.0),
            Self::Phong { .. }
            | Self::Mirror { .. }
            | Self::Glass { .. }
            | Self::Pane { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => false,
        }
    }

    /// Whether it has a colour, which vertex colours multiply.
    pub fn has_color(&self) -> bool {
        match self {
            Self::Metal { fresnel: FresnelSource::Index { .. }, .. } | Self::Glass { .. } => false,
            Self::Metal { fresnel: FresnelSource::Schlick(_), .. }
            | Self::Phong { .. }
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => true,
        }
    }

    /// Whether it is glass that fills its shape.
    pub fn is_glass(&self) -> bool {
        self.substance().is_some()
    }

    /// The bits of what glass is made of: index of refraction and transmittance, however rough its surface is. `None` if it is not glass.
    pub fn substance(&self) -> Option<[u64; 4]> {
        match *self {
            Self::Glass { ior, tint, roughness: _ } => {
                Some([f64::from(ior), tint.x, tint.y, tint.z].map(f64::to_bits))
            }
            Self::Phong { .. }
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Metal { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => None,
        }
    }
}

/// A tangent-space normal map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: usize,
    /// Factor on its slopes, ≥ 0.
    pub strength: f32,
}

/// A texture of heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bump {
    /// Index into [`Scene::textures`](super::Scene::textures).
    pub texture: usize,
    /// The channel that holds the heights. `None` for luminance.
    pub channel: Option<Channel>,
    /// Length of a height of 1; below 0, what stood out is sunk.
    pub scale: f32,
}

impl Bump {
    /// The number of a pixel that is its height.
    pub fn number(&self) -> PixelValue {
        self.channel.map_or(PixelValue::Luminance, PixelValue::Channel)
    }
}

/// Purpose of a texture's look-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TextureUse {
    /// Colours.
    Color,
    /// Colors of a surface whose opacity is the alpha of the same image.
    CutOut,
    /// Normals.
    Normal,
    /// Numbers.
    Number(PixelValue),
}

/// Role of a texture in a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TextureRole {
    /// kd.
    Diffuse,
    /// ks.
    Specular,
    /// ka.
    Ambient,
    /// Reflectance of microfacets, by normal incidence or by the index of refraction.
    Facets,
    /// Roughness, and other numbers of microfacets.
    Roughness(PixelValue),
    /// Radiance.
    Emission,
    /// Map that bends its normals.
    NormalMap,
    /// Heights that bend its normals.
    Bump(PixelValue),
    /// The chance that it is there.
    Opacity(PixelValue),
    /// Clear coat over what emits.
    EmissionCoat(PixelValue),
}

impl TextureRole {
    /// Meaning of its numbers.
    pub fn texture_use(self) -> TextureUse {
        match self {
            Self::Diffuse | Self::Specular | Self::Ambient | Self::Facets | Self::Emission => {
                TextureUse::Color
            }
            Self::Roughness(number)
            | Self::Bump(number)
            | Self::Opacity(number)
            | Self::EmissionCoat(number) => TextureUse::Number(number),
            Self::NormalMap => TextureUse::Normal,
        }
    }
}

/// Reflection or transmission of light by a material.
#[derive(Clone, Debug, PartialEq)]
pub enum MaterialKind {
    /// Normalised Phong.
    Phong {
        /// kd.
        diffuse: ColorSource,
        /// ks.
        specular: ColorSource,
        /// α ≥ 0.
        shininess: f32,
        /// ka. `None` for the diffuse colour.
        ambient: Option<ColorSource>,
    },
    /// A perfect mirror of this reflectance in [0, 1].
    Mirror {
        /// Reflectance.
        reflectance: ColorSource,
    },
    /// Smooth or rough dielectric.
    Glass {
        /// Index of refraction inside, in [0.1, 10]; below 1: thinner than what is outside, as a bubble in water.
        ior: f32,
        /// Transmittance per unit of length inside, in [0, 1].
        tint: DVec3,
        /// The root of α, in [0, 1]; 0 is smooth.
        roughness: NumberSource,
    },
    /// A pane of smooth glass without thickness.
    Pane {
        /// Index of refraction, in [0.1, 10].
        ior: f32,
        /// Transmittance of the glass at any angle, in [0, 1].
        tint: ColorSource,
    },
    /// Conductor of microfacets.
    Metal {
        /// Reflectance of the facets.
        fresnel: FresnelSource,
        /// The root of α, in [0, 1]; 0 is a mirror.
        roughness: NumberSource,
        /// Stretch of the lobe along u, in [−1, 1].
        anisotropy: NumberSource,
    },
    /// A diffuse base under a dielectric coat of microfacets.
    Plastic {
        /// kd, in [0, 1].
        diffuse: ColorSource,
        /// Factor on what the coat reflects, in [0, 1].
        specular: ColorSource,
        /// Index of refraction, in [1, 10].
        ior: f32,
        /// The root of α, in [0, 1]; 0 is a smooth coat.
        roughness: NumberSource,
    },
    /// The inputs of glTF. Colours and numbers are in [0, 1] but for `ior` and `specular_color`.
    Principled {
        /// Diffuse reflectance, or that of the metal at normal incidence.
        color: ColorSource,
        /// Weight of the metal.
        metallic: NumberSource,
        /// The root of α.
        roughness: NumberSource,
        /// Index of refraction, in [1, 10].
        ior: f32,
        /// Factor on the reflectance of what is no metal.
        specular: NumberSource,
        /// Factor on that reflectance at normal incidence, ≥ 0.
        specular_color: ColorSource,
        /// Part of the light below the specular lobe that goes through.
        transmission: NumberSource,
        /// Weight of a clear coat.
        clearcoat: NumberSource,
        /// The root of its α.
        clearcoat_roughness: NumberSource,
    },
}

impl ColorSource {
    /// Index of the texture that it is, if it is one.
    fn texture(&self) -> Option<usize> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(index) => Some(*index),
        }
    }
}

impl MaterialKind {
    /// Its colours, with their roles.
    fn colors(&self) -> Vec<(&ColorSource, TextureRole)> {
        match self {
            Self::Phong { diffuse, specular, shininess: _, ambient } => vec![
                (diffuse, TextureRole::Diffuse),
                (specular, TextureRole::Specular),
                (ambient.as_ref().unwrap_or(diffuse), TextureRole::Ambient),
            ],
            Self::Metal { fresnel: FresnelSource::Schlick(color), .. } => vec![(color, TextureRole::Facets)],
            Self::Metal { fresnel: FresnelSource::Index { eta, k }, .. } => {
                vec![(eta, TextureRole::Facets), (k, TextureRole::Facets)]
            }
            Self::Plastic { diffuse, specular, ior: _, roughness: _ } => vec![
                (diffuse, TextureRole::Diffuse),
                (diffuse, TextureRole::Ambient),
                (specular, TextureRole::Specular),
            ],
            Self::Principled { color, specular_color, .. } => vec![
                (color, TextureRole::Facets),
                (color, TextureRole::Ambient),
                (specular_color, TextureRole::Facets),
            ],
            Self::Mirror { reflectance: color } | Self::Pane { ior: _, tint: color } => {
                vec![(color, TextureRole::Facets)]
            }
            Self::Glass { ior: _, tint: _, roughness: _ } => Vec::new(),
        }
    }

    /// Its numbers that may be textures.
    fn numbers(&self) -> Vec<NumberSource> {
        match self {
            Self::Metal { fresnel: _, roughness, anisotropy } => vec![*roughness, *anisotropy],
            Self::Plastic { roughness, .. } | Self::Glass { roughness, .. } => vec![*roughness],
            Self::Principled {
                metallic,
                roughness,
                specular,
                transmission,
                clearcoat,
                clearcoat_roughness,
                ..
            } => vec![*metallic, *roughness, *specular, *transmission, *clearcoat, *clearcoat_roughness],
            Self::Phong { .. } | Self::Mirror { .. } | Self::Pane { .. } => Vec::new(),
        }
    }
}

impl Material {
    /// Whether what has it is a light.
    pub fn emits(&self) -> bool {
        self.emission.scale != Vec3::ZERO
    }

    /// Weight and roughness of the clear coat over what it emits. `None` without emission or coat.
    pub fn emission_coat(&self) -> Option<[NumberSource; 2]> {
        match self.kind {
            MaterialKind::Principled { clearcoat, clearcoat_roughness, .. } => {
                let has_coat = self.emits() && clearcoat != NumberSource::Constant(0.0);
                has_coat.then_some([clearcoat, clearcoat_roughness])
            }
            MaterialKind::Phong { .. }
            | MaterialKind::Mirror { .. }
            | MaterialKind::Glass { .. }
            | MaterialKind::Pane { .. }
            | MaterialKind::Metal { .. }
            | MaterialKind::Plastic { .. } => None,
        }
    }

    /// The textures that it looks up, as indices into [`Scene::textures`](super::Scene::textures), each with its role; one may
    /// have several.
    pub fn textures(&self) -> Vec<(usize, TextureRole)> {
        let Self { name: _, kind, emission, normal_map, bump, opacity } = self;
        let colors = kind.colors().into_iter().filter_map(|(color, role)| Some((color.texture()?, role)));
        let numbers = kind.numbers().into_iter().filter_map(|number| number.texture(PixelValue::Luminance));
        let numbers = numbers.map(|(texture, number)| (texture, TextureRole::Roughness(number)));
        let shown = emission.texture.filter(|_| self.emits()).map(|index| (index, TextureRole::Emission));
        let normals = normal_map.map(|map| (map.texture, TextureRole::NormalMap));
        let heights = bump.map(|bump| (bump.texture, TextureRole::Bump(bump.number())));
        let opacity = opacity.texture().map(|(texture, number)| (texture, TextureRole::Opacity(number)));
        let coat = self.emission_coat().into_iter().flatten();
        let coat = coat.filter_map(|number| number.texture(PixelValue::Luminance));
        let coat = coat.map(|(texture, number)| (texture, TextureRole::EmissionCoat(number)));
        colors.chain(numbers).chain(shown).chain(normals).chain(heights).chain(opacity).chain(coat).collect()
    }
}

/// Key of the look-up; the texels have keys of their own.
impl Fingerprinted for Texture {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self { name: _, file, image, filter, wrap, repeat, rotate, offset, uv, encoding, factor } = self;
        key.path(&file.value).choice(*filter).choice(*wrap).choice(*encoding).f32(repeat.x).f32(repeat.y);
        key.f64(*rotate).f32(offset.x).f32(offset.y).vec3(*factor).flag(*uv == UvSet::Second);
        key.index(image.map_or(0, |image| image as usize + 1));
    }
}

impl Fingerprinted for ColorSource {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::Constant(color) => {
                key.index(0).vec3(*color);
            }
            Self::Texture(index) => {
                of.textures[*index].add_to(key.index(1), of);
            }
        }
    }
}

impl Fingerprinted for OpacitySource {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { value, cutoff } = self;
        key.f32(*cutoff).add(value, of);
    }
}

impl Fingerprinted for NumberSource {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match *self {
            Self::Constant(value) => {
                key.index(0).f32(value);
            }
            Self::Texture { texture, channel } => {
                key.index(1).flag(channel.is_some());
                if let Some(channel) = channel {
                    key.choice(channel);
                }
                of.textures[texture].add_to(key, of);
            }
        }
    }
}

impl Fingerprinted for FresnelSource {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::Schlick(color) => {
                key.index(0).add(color, of);
            }
            Self::Index { eta, k } => {
                key.index(1).add(eta, of).add(k, of);
            }
        }
    }
}

impl Fingerprinted for EmissionSource {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { scale, texture, sides } = *self;
        key.vec3(scale).choice(sides).flag(texture.is_some());
        if let Some(texture) = texture {
            of.textures[texture].add_to(key, of);
        }
    }
}

impl Fingerprinted for NormalMap {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { texture, strength } = *self;
        of.textures[texture].add_to(key.f32(strength), of);
    }
}

impl Fingerprinted for Bump {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { texture, channel, scale } = *self;
        key.f32(scale).add(&NumberSource::Texture { texture, channel }, of);
    }
}

impl Fingerprinted for MaterialKind {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::Phong { diffuse, specular, shininess, ambient } => {
                key.index(0).f32(*shininess).add(diffuse, of).add(specular, of).add(ambient, of);
            }
            Self::Mirror { reflectance } => {
                key.index(1).add(reflectance, of);
            }
            Self::Glass { ior, tint, roughness } => {
                key.index(2).f32(*ior).dvec3(*tint).add(roughness, of);
            }
            Self::Pane { ior, tint } => {
                key.index(3).f32(*ior).add(tint, of);
            }
            Self::Metal { fresnel, roughness, anisotropy } => {
                key.index(6).add(fresnel, of).add(roughness, of).add(anisotropy, of);
            }
            Self::Plastic { diffuse, specular, ior, roughness } => {
                key.index(4).add(diffuse, of).add(specular, of).f32(*ior).add(roughness, of);
            }
            Self::Principled {
                color,
                metallic,
                roughness,
                ior,
                specular,
                specular_color,
                transmission,
                clearcoat,
                clearcoat_roughness,
            } => {
                key.index(5).add(color, of).add(metallic, of).add(roughness, of).f32(*ior);
                key.add(specular, of).add(specular_color, of).add(transmission, of);
                key.add(clearcoat, of).add(clearcoat_roughness, of);
            }
        }
    }
}

impl Fingerprinted for Material {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        let Self { name: _, kind, emission, normal_map, bump, opacity } = self;
        key.add(kind, of).add(emission, of).add(normal_map, of).add(bump, of).add(opacity, of);
    }
}
