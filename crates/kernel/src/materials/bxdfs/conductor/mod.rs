//! Conductors: microfacets with the exact Fresnel equations, or with Schlick's approximation for a color.

mod bxdf;
pub mod elements;

use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::fresnel::{fresnel_conductor, schlick_weight};
use crate::materials::lookup::ParameterLookup;
use crate::materials::microfacet;
use crate::materials::scalar::ScalarParameter;
use crate::materials::texture::ColorOrTexture;
use crate::math::Vec3;
pub use bxdf::ConductorBxdf;

/// A rough conductor with a single lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct Conductor {
    /// Reflectance of the facets.
    pub fresnel: ConductorFresnel,
    /// The square root of α.
    pub roughness: ScalarParameter,
    /// Elongation of the lobe along u, in [−1, 1].
    pub anisotropy: ScalarParameter,
}

/// Reflectance of a smooth conductor as a function of angle.
#[derive(Clone, Debug, PartialEq)]
pub enum ConductorFresnel {
    /// Schlick's approximation, based on the reflectance at normal incidence.
    Schlick(ColorOrTexture),
    /// Exact equations, from the complex index of refraction.
    Index {
        /// Real part for red, green, and blue.
        eta: ColorOrTexture,
        /// Imaginary part for red, green, and blue.
        k: ColorOrTexture,
    },
}

/// [`ConductorFresnel`] at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FresnelPoint {
    /// The reflectance at normal incidence, or the real part η.
    pub first: Vec3,
    /// The imaginary part k, or a negative number for Schlick's approximation.
    pub second: Vec3,
}

/// [`Conductor`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConductorPoint {
    /// Reflectance of the facets.
    pub fresnel: FresnelPoint,
    /// α along u and along v.
    pub alphas: [f32; 2],
}

impl ConductorFresnel {
    /// The reflectance at a single point.
    #[inline]
    pub fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> FresnelPoint {
        match self {
            Self::Schlick(color) => FresnelPoint::from_schlick(lookup.color(color)),
            Self::Index { eta, k } => FresnelPoint::from_complex_ior(lookup.color(eta), lookup.color(k)),
        }
    }
}

impl FresnelPoint {
    /// Uses Schlick's approximation. Limits the reflectance at normal incidence to at most 1.
    pub fn from_schlick(reflectance: Vec3) -> Self {
        Self { first: reflectance.min(Vec3::ONE), second: Vec3::NEG_ONE }
    }

    /// Uses the exact equations, with a complex index of refraction. The index is limited to 1e8, where
    /// metals reflect all light, because the fourth power of a larger value would overflow.
    pub fn from_complex_ior(eta: Vec3, k: Vec3) -> Self {
        const MAX_INDEX: Vec3 = Vec3::splat(1e8);
        Self { first: eta.min(MAX_INDEX), second: k.min(MAX_INDEX) }
    }

    /// Multiplies the color by `color`. Indices of refraction are not colors and stay unchanged.
    pub fn tinted(self, color: Vec3) -> Self {
        if self.second.x < 0.0 { Self { first: self.first * color, ..self } } else { self }
    }

    /// Computes the reflectance from the cosine of the angle of incidence.
    pub fn reflectance(&self, cosine: f32) -> Vec3 {
        let of = |first, second| reflectance(first, second, cosine, schlick_weight(cosine));
        let Self { first, second } = self;
        Vec3::new(of(first.x, second.x), of(first.y, second.y), of(first.z, second.z))
    }
}

/// Reflectance of a facet in one channel. `weight` is the [`schlick_weight`] of the cosine.
#[inline(always)]
fn reflectance(first: f32, second: f32, cosine: f32, weight: f32) -> f32 {
    let exact = fresnel_conductor(cosine, first, second);
    let approximate = first + (1.0 - first) * weight;
    if second < 0.0 { approximate } else { exact }
}

impl SpatiallyVaryingBxdf for Conductor {
    type Point = ConductorPoint;

    #[inline]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> ConductorPoint {
        let roughness = lookup.number(&self.roughness);
        let anisotropy = lookup.number_neutral_at_zero(&self.anisotropy).clamp(-1.0, 1.0);
        ConductorPoint {
            fresnel: self.fresnel.look_up_parameters(lookup),
            alphas: microfacet::alphas_from_roughness(roughness, anisotropy),
        }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        self.fresnel.look_up_parameters(lookup).reflectance(1.0)
    }

    #[inline]
    fn is_anisotropic(&self) -> bool {
        self.anisotropy.as_untextured() != Some(0.0)
    }
}

impl BxdfParameters for ConductorPoint {
    #[inline]
    fn is_black(&self) -> bool {
        false
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        Vec3::ZERO
    }

    fn tinted(self, color: Vec3) -> Self {
        Self { fresnel: self.fresnel.tinted(color), ..self }
    }

    #[inline(always)]
    fn interreflection_reflectances(&self) -> [Vec3; 2] {
        [Vec3::ZERO, self.fresnel.reflectance(1.0)]
    }
}

#[cfg(test)]
mod tests;
