//! Materials: the `[materials.*]` tables.

mod sources;
mod texture_roles;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
pub use crate::materials::microfacet::MicrofacetDistribution;
pub use crate::materials::{Channel, ChannelSelector, EmissionSides, ReflectingSides};
use crate::math::{DVec3, Vec3};
pub use sources::{
    Bump, CoatSource, ColorSource, ConductorFresnelSource, EmissionSource, NormalMap, NumberSource,
    OpacitySource,
};
pub use texture_roles::{PixelInterpretation, TextureRole};

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
            Self::Blend { .. } => self.any_blend_part_is(|part| part.kind.has_delta_lobe()),
        }
    }

    /// The materials of a blend, or an empty slice for other materials.
    pub fn blended_materials(&self) -> &[Material] {
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
    fn any_blend_part_is(&self, property: impl Fn(&Material) -> bool) -> bool {
        self.blended_materials().iter().any(property)
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
            Self::Blend { .. } => self.any_blend_part_is(|part| part.kind.is_anisotropic()),
        }
    }

    /// Whether the material has a color that can be multiplied by vertex colors.
    pub fn accepts_vertex_colors(&self) -> bool {
        match self {
            Self::Metal { fresnel: ConductorFresnelSource::Index { .. }, .. } | Self::Glass { .. } => false,
            Self::Metal { fresnel: ConductorFresnelSource::Schlick(_), .. }
            | Self::Phong(_)
            | Self::Mirror { .. }
            | Self::Pane { .. }
            | Self::Plastic { .. }
            | Self::Principled { .. } => true,
            Self::Blend { .. } => self.any_blend_part_is(|part| part.kind.accepts_vertex_colors()),
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
            Self::Blend { .. } => self.any_blend_part_is(|part| part.kind.transmits()),
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
        fresnel: ConductorFresnelSource,
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

impl Material {
    /// Whether shapes with this material are lights.
    pub fn emits(&self) -> bool {
        self.emission.scale != Vec3::ZERO || self.kind.any_blend_part_is(Self::emits)
    }

    /// The sides of the surface that may emit light.
    pub fn emission_sides(&self) -> EmissionSides {
        let is_both = |part: &Self| part.emits() && part.emission_sides() == EmissionSides::Both;
        if self.kind.any_blend_part_is(is_both) { EmissionSides::Both } else { self.emission.sides }
    }

    /// The material itself and, for a blend, all of its parts.
    pub fn self_and_blend_parts(&self) -> Vec<&Self> {
        let parts = self.kind.blended_materials().iter().flat_map(Self::self_and_blend_parts);
        std::iter::once(self).chain(parts).collect()
    }

    /// Returns the coat, or `None` if it does not attenuate any emission.
    pub fn emitter_coat(&self) -> Option<&CoatSource> {
        (self.emits() && self.coat.exists()).then_some(&self.coat)
    }
}

impl Fingerprinted for MaterialKind {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Phong(PhongParameters { diffuse, specular, shininess, ambient, diffuse_transmission }) => {
                key.add_usize(0)
                    .add_f32(*shininess)
                    .add_with_references(diffuse, of)
                    .add_with_references(specular, of)
                    .add_with_references(ambient, of);
                key.add_with_references(diffuse_transmission, of);
            }
            Self::Mirror { reflectance } => {
                key.add_usize(1).add_with_references(reflectance, of);
            }
            Self::Glass { ior, tint, roughness, distribution } => {
                key.add_usize(2)
                    .add_f32(*ior)
                    .add_dvec3(*tint)
                    .add_with_references(roughness, of)
                    .add_choice_name(*distribution);
            }
            Self::Pane { ior, tint } => {
                key.add_usize(3).add_f32(*ior).add_with_references(tint, of);
            }
            Self::Metal { fresnel, roughness, anisotropy, distribution } => {
                key.add_usize(6)
                    .add_with_references(fresnel, of)
                    .add_with_references(roughness, of)
                    .add_with_references(anisotropy, of);
                key.add_choice_name(*distribution);
            }
            Self::Plastic { diffuse, specular, ior, roughness, distribution, nonlinear } => {
                key.add_usize(4)
                    .add_with_references(diffuse, of)
                    .add_with_references(specular, of)
                    .add_f32(*ior)
                    .add_with_references(roughness, of);
                key.add_choice_name(*distribution).add_bool(*nonlinear);
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
                key.add_usize(5)
                    .add_with_references(color, of)
                    .add_with_references(metallic, of)
                    .add_with_references(roughness, of)
                    .add_f32(*ior);
                key.add_with_references(specular, of)
                    .add_with_references(specular_color, of)
                    .add_with_references(transmission, of);
                key.add_with_references(diffuse_transmission, of);
            }
            Self::Blend { weight, parts } => {
                let [first, second] = &**parts;
                key.add_usize(7)
                    .add_with_references(weight, of)
                    .add_with_references(first, of)
                    .add_with_references(second, of);
            }
        }
    }
}

impl Fingerprinted for Material {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { name: _, kind, sides, emission, normal_map, bump, opacity, coat } = self;
        key.add_with_references(kind, of)
            .add_with_references(emission, of)
            .add_with_references(normal_map, of)
            .add_with_references(bump, of)
            .add_with_references(opacity, of)
            .add_with_references(coat, of);
        key.add_choice_name(*sides);
    }
}
