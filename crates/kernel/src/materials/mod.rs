//! Materials: reflection, transmission, and emission of surfaces.

pub mod blend;
pub mod bsdf;
pub mod bxdf;
pub mod bxdf_packet;
pub mod bxdfs;
pub mod coat;
pub mod dielectric;
pub mod emission;
pub mod footprint;
pub mod fresnel;
pub mod lobe_albedo;
pub mod lookup;
pub mod microfacet;
pub mod mipmaps;
pub mod mirror;
pub mod normal_map;
pub mod normal_perturbation;
pub mod opacity;
pub mod scalar;
pub mod schlick_albedo;
mod shown_lobe_factors;
pub mod specular_over_base;
pub mod texels;
pub mod texture;
pub mod thin_dielectric;

pub use blend::Blend;
pub use bxdfs::*;
pub use coat::{Coat, CoatTexturedParameters};
pub use dielectric::Dielectric;
pub use emission::{Emission, EmissionSides};
pub use footprint::{ExtraCoordinates, Footprint, ObjectPoint, SecondUvPoint, TexturePoint, UvSet};
pub use mipmaps::Mipmaps;
pub use mirror::Mirror;
pub use normal_map::NormalMap;
pub use normal_perturbation::{Bump, NormalPerturbation};
pub use opacity::Opacity;
pub use scalar::{Channel, ChannelSelector, ScalarParameter};
pub use specular_over_base::{SpecularLayer, SpecularOverBase};
pub use thin_dielectric::ThinDielectric;

use std::sync::Arc;

use crate::choice;
use crate::math::Vec3;
use texture::Texture;

choice! {
    /// The sides of an opaque surface that reflect light.
    pub enum ReflectingSides {
        /// Both sides.
        Both = "both",
        /// Only the front; the back is black.
        Front = "front",
    }
}

/// A material that is ready for texture lookups.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// How the surface scatters light.
    pub bsdf: Bsdf,
    /// The sides that scatter light.
    pub sides: ReflectingSides,
    /// Emitted radiance.
    pub emission: Emission,
    /// Perturbation of the shading normals by a normal map, a bump map, or both.
    pub normal_perturbation: Option<NormalPerturbation>,
    /// Probability that the surface exists at a point, or `None` if the surface is opaque everywhere.
    pub opacity: Option<Opacity>,
}

impl Material {
    /// Whether the front or the back scatters light. Always true for blends, whose parts have their own
    /// `sides`.
    #[inline]
    pub fn scatters_on_side(&self, is_front: bool) -> bool {
        match self.sides {
            ReflectingSides::Both => true,
            ReflectingSides::Front => is_front,
        }
    }

    /// Whether the surface, or any part of a blend, scatters light only on its front.
    pub fn may_be_black_from_behind(&self) -> bool {
        !self.scatters_on_side(false) || self.any_blend_part_is(Self::may_be_black_from_behind)
    }

    /// Whether any material property depends on texture coordinates or tangents.
    pub fn needs_uvs_or_tangents(&self) -> bool {
        self.normal_perturbation.is_some()
            || self.bsdf.is_anisotropic()
            || !self.textures().is_empty()
            || self.any_blend_part_is(Self::needs_uvs_or_tangents)
    }

    /// The parts of a blend, or `None` for other materials.
    #[inline]
    fn as_blend(&self) -> Option<&Blend> {
        match &self.bsdf {
            Bsdf::Blend(blend) => Some(blend),
            Bsdf::NonSpecular(_)
            | Bsdf::Mirror(_)
            | Bsdf::Dielectric(_)
            | Bsdf::ThinDielectric(_)
            | Bsdf::SpecularOverBase(_) => None,
        }
    }

    /// Whether the material is a blend.
    #[inline]
    pub fn is_blend(&self) -> bool {
        self.as_blend().is_some()
    }

    /// Whether a property holds for any part of a blend.
    fn any_blend_part_is(&self, property: impl Fn(&Self) -> bool) -> bool {
        self.as_blend().is_some_and(|blend| blend.parts.iter().any(property))
    }

    /// Chooses a part of a blend, or of blends nested in it, with a random number in [0, 1). Returns other
    /// materials unchanged. Counts texture lookups in `lookups`.
    #[inline]
    pub fn choose_part(&self, at: &TexturePoint, u: impl FnOnce() -> f32, lookups: &mut u64) -> &Self {
        let Some(mut blend) = self.as_blend() else { return self };
        let mut u = u();
        loop {
            let part = blend.choose(at, &mut u, lookups);
            match part.as_blend() {
                Some(nested) => blend = nested,
                None => return part,
            }
        }
    }

    /// Whether the surface may emit light.
    pub fn is_emissive(&self) -> bool {
        self.emission.is_emissive() || self.any_blend_part_is(Self::is_emissive)
    }

    /// Expected radiance emitted from one side, at the given cosine to the normal: the radiance times the
    /// opacity, or for a blend, the weighted mean of this over its parts. Counts texture lookups in
    /// `lookups`.
    pub fn expected_emission_at(
        &self,
        at: &TexturePoint,
        is_front: bool,
        cosine: f32,
        lookups: &mut u64,
    ) -> Vec3 {
        if let Some(blend) = self.as_blend() {
            return blend.mean_over_parts(at, lookups, |part, lookups| {
                part.expected_emission_at(at, is_front, cosine, lookups)
            });
        }
        if !self.emission.emits_on_side(is_front) {
            return Vec3::ZERO;
        }
        let radiance = self.emission.radiance_at_cosine(at, cosine, lookups);
        match &self.opacity {
            Some(opacity) => radiance * opacity.evaluate(at, lookups),
            None => radiance,
        }
    }

    /// Probability that the surface exists at a point with a material for which `accepts` is true. Counts
    /// texture lookups in `lookups`.
    pub fn presence_probability(
        &self,
        at: &TexturePoint,
        accepts: &dyn Fn(&Self) -> bool,
        lookups: &mut u64,
    ) -> f32 {
        match self.as_blend() {
            Some(blend) => {
                let for_part = |part: &Self, lookups: &mut u64| {
                    Vec3::splat(part.presence_probability(at, accepts, lookups))
                };
                blend.mean_over_parts(at, lookups, for_part).x
            }
            None if !accepts(self) => 0.0,
            None => self.opacity.as_ref().map_or(1.0, |opacity| opacity.evaluate(at, lookups)),
        }
    }

    /// Whether light may pass through the surface undeflected, because the surface is a thin pane or is
    /// partially transparent.
    #[inline]
    pub fn has_null_interaction(&self) -> bool {
        self.bsdf.as_thin_dielectric().is_some()
            || self.opacity.is_some()
            || self.any_blend_part_is(Self::has_null_interaction)
    }

    /// Fraction of the light that passes undeflected at a point, for an incident angle with the given cosine.
    /// `color` multiplies a pane's transmittance. Counts texture lookups in `lookups`.
    pub fn null_transmittance(&self, at: &TexturePoint, color: Vec3, cosine: f32, lookups: &mut u64) -> Vec3 {
        if let Some(blend) = self.as_blend() {
            return blend.mean_over_parts(at, lookups, |part, lookups| {
                part.null_transmittance(at, color, cosine, lookups)
            });
        }
        let there = self.opacity.as_ref().map_or(1.0, |opacity| opacity.evaluate(at, lookups));
        let through = self.bsdf.as_thin_dielectric().map_or(Vec3::ZERO, |pane| {
            let tint = pane.tint.evaluate(at, lookups).min(Vec3::ONE);
            tint * color * (1.0 - pane.reflectance(cosine))
        });
        through * there + Vec3::splat(1.0 - there)
    }

    /// Whether any texture filters its lookups by the footprint.
    pub fn uses_footprint(&self) -> bool {
        self.textures().iter().any(|texture| texture.uses_footprint())
    }

    /// Whether any texture uses the shape's own coordinates.
    pub fn uses_object_point(&self) -> bool {
        self.textures().iter().any(|texture| texture.uses_object_point())
    }

    /// All textures. Skips the coat of the emission, which has the same textures as the coat of the BSDF.
    fn textures(&self) -> Vec<&Arc<Texture>> {
        let mut textures: Vec<_> = match &self.bsdf {
            Bsdf::NonSpecular(rough) => rough.textures().collect(),
            Bsdf::Mirror(mirror) => mirror.textures().collect(),
            Bsdf::SpecularOverBase(layers) => {
                layers.specular_textures().chain(layers.base.textures()).collect()
            }
            Bsdf::Dielectric(glass) => glass.roughness.texture().into_iter().collect(),
            Bsdf::ThinDielectric(pane) => pane.tint.texture().into_iter().collect(),
            Bsdf::Blend(blend) => blend
                .weight
                .texture()
                .into_iter()
                .chain(blend.parts.iter().flat_map(Self::textures))
                .collect(),
        };
        textures.extend(&self.emission.texture);
        textures.extend(self.opacity.as_ref().and_then(|opacity| opacity.value.texture()));
        textures.extend(self.normal_perturbation.iter().flat_map(NormalPerturbation::textures));
        textures
    }
}

/// How a surface scatters light (bidirectional scattering distribution function).
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// A surface without δ lobes.
    NonSpecular(NonSpecular),
    /// A perfect mirror.
    Mirror(Mirror),
    /// A smooth or rough dielectric.
    Dielectric(Dielectric),
    /// A thin dielectric pane.
    ThinDielectric(ThinDielectric),
    /// A surface with a δ lobe and non-specular lobes.
    SpecularOverBase(SpecularOverBase),
    /// A blend of two materials.
    Blend(Box<Blend>),
}

impl Bsdf {
    /// Whether the surface has a δ lobe.
    #[inline]
    pub fn has_delta(&self) -> bool {
        match self {
            Self::NonSpecular(_) => false,
            Self::Dielectric(glass) => glass.is_smooth(),
            Self::Mirror(_) | Self::ThinDielectric(_) | Self::SpecularOverBase(_) => true,
            Self::Blend(blend) => blend.parts.iter().any(|part| part.bsdf.has_delta()),
        }
    }

    /// Whether the surface has non-δ lobes, which light sampling can reach.
    #[inline]
    pub fn has_non_delta_lobes(&self) -> bool {
        match self {
            Self::Blend(blend) => blend.parts.iter().any(|part| part.bsdf.has_non_delta_lobes()),
            Self::NonSpecular(_)
            | Self::Mirror(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::SpecularOverBase(_) => self.non_specular_part().is_some(),
        }
    }

    /// Whether the lobes depend on the directions of the texture axes.
    #[inline]
    pub fn is_anisotropic(&self) -> bool {
        self.any_non_specular_part_satisfies(NonSpecular::is_anisotropic)
    }

    /// The non-δ lobes, or `None` for blends and for surfaces without such lobes.
    #[inline]
    pub fn non_specular_part(&self) -> Option<&NonSpecular> {
        match self {
            Self::NonSpecular(rough) | Self::SpecularOverBase(SpecularOverBase { base: rough, .. }) => {
                Some(rough)
            }
            Self::Mirror(_) | Self::Dielectric(_) | Self::ThinDielectric(_) | Self::Blend(_) => None,
        }
    }

    /// The BSDF of a surface that has only non-δ lobes, or `None` for other materials.
    #[inline(always)]
    pub fn as_purely_non_specular(&self) -> Option<&NonSpecular> {
        match self {
            Self::NonSpecular(rough) => Some(rough),
            Self::Mirror(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::SpecularOverBase(_)
            | Self::Blend(_) => None,
        }
    }

    /// The thin pane, or `None` for other materials.
    #[inline]
    pub fn as_thin_dielectric(&self) -> Option<&ThinDielectric> {
        match self {
            Self::ThinDielectric(pane) => Some(pane),
            Self::NonSpecular(_)
            | Self::Mirror(_)
            | Self::Dielectric(_)
            | Self::SpecularOverBase(_)
            | Self::Blend(_) => None,
        }
    }

    /// The dielectric that fills the shape, or `None` for other materials.
    pub fn as_dielectric(&self) -> Option<&Dielectric> {
        match self {
            Self::Dielectric(glass) => Some(glass),
            Self::NonSpecular(_)
            | Self::Mirror(_)
            | Self::SpecularOverBase(_)
            | Self::ThinDielectric(_)
            | Self::Blend(_) => None,
        }
    }

    /// Whether the surface also scatters light to the other side.
    pub fn has_non_specular_transmission(&self) -> bool {
        self.any_non_specular_part_satisfies(NonSpecular::is_transmissive)
    }

    /// Whether a property holds for the non-δ lobes of the surface, or of any part of a blend.
    fn any_non_specular_part_satisfies(&self, property: fn(&NonSpecular) -> bool) -> bool {
        match self {
            Self::Blend(blend) => {
                blend.parts.iter().any(|part| part.bsdf.any_non_specular_part_satisfies(property))
            }
            Self::NonSpecular(_)
            | Self::Mirror(_)
            | Self::Dielectric(_)
            | Self::ThinDielectric(_)
            | Self::SpecularOverBase(_) => self.non_specular_part().is_some_and(property),
        }
    }

    /// The surface's main color. Counts texture lookups in `lookups`.
    #[inline]
    pub fn main_color(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::NonSpecular(rough) => rough.main_color(at, lookups),
            Self::Mirror(mirror) => mirror.reflectance(1.0, None, at, lookups),
            Self::Dielectric(glass) => glass.tint,
            Self::ThinDielectric(pane) => pane.tint.evaluate(at, lookups),
            Self::SpecularOverBase(layers) => layers.main_color(at, lookups),
            Self::Blend(blend) => {
                blend.mean_over_parts(at, lookups, |part, lookups| part.bsdf.main_color(at, lookups))
            }
        }
    }
}
