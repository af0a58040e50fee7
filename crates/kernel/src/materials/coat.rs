//! The dielectric layer of coats: clear coats over any opaque material, and the coat of plastic.
//!
//! A coat of weight c has a GGX lobe c·F·D·G/(4 cosθᵢ cosθₒ), whose directional albedo is c·E(μ). The coat
//! transmits t(μ) = (1 − c·E(μ))·T^(1/(2 cosθₜ)) of the light in either direction, so the lobes of the layer
//! below are multiplied by t(μᵢ)·t(μₒ). The first factor of t is albedo scaling (Kulla and Conty, *Revisiting
//! Physically Based Shading at Imageworks*, SIGGRAPH 2017 course): the layered BSDF is reciprocal and never
//! gains energy. The second factor is absorption along the refracted path (Jakob et al., *A Comprehensive
//! Framework for Rendering Layered Materials*, SIGGRAPH 2014, section 5.1). T is the transmittance for a
//! round trip through the layer at normal incidence.
//!
//! The coat also reflects light back down. Under a diffuse lobe of reflectance ρ, the returned fraction is
//! c·Ē, with Ē = 2∫E μ dμ, and the geometric series of all reflections multiplies the lobe by 1/(1 − ρ·c·Ē).
//! A white diffuse base therefore reflects all light. A narrow lobe preserves the angle, so its fraction is
//! the smaller of c·E(μᵢ) and c·E(μₒ), which keeps the lobe reciprocal and its albedo at most 1. Absorption
//! of the returned light is neglected, and principled materials neglect the returned light altogether.

use super::footprint::TexturePoint;
use super::fresnel::{fresnel_dielectric_from_outside, schlick_weight};
use super::lobe_albedo::{LobeAlbedoPolynomial, TERMS, evaluate_albedo_fit};
use super::lookup::{MaterialTextureCollector, ParameterLookup, PointTextureEvaluator};
use super::microfacet::{
    self, MicrofacetDistribution, SmithDirectionTerms, UnnormalizedHalfVector, sample_reflected_direction,
};
use super::scalar::ScalarParameter;
use super::schlick_albedo::SchlickAlbedoPair;
use super::texture::ColorOrTexture;
use crate::math::Vec3;
use crate::math::elementary::{exp2, log2};
use crate::math::frame::Frame;
use glimt_base::soa;

/// A clear coat of a material, with textures.
#[derive(Clone, Debug, PartialEq)]
pub struct Coat {
    inputs: CoatTexturedParameters,
    /// Albedos, or `None` if the roughness varies.
    albedo: Option<SchlickAlbedoPair>,
}

/// The parameters of a clear coat.
#[derive(Clone, Debug, PartialEq)]
pub struct CoatTexturedParameters {
    /// Weight c of the coat.
    pub weight: ScalarParameter,
    /// The square root of α.
    pub roughness: ScalarParameter,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Transmittance T for a round trip through the layer at normal incidence.
    pub tint: ColorOrTexture,
}

/// [`Coat`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatPoint {
    /// Weight c of the coat.
    pub weight: f32,
    /// α of the lobe.
    pub alpha: f32,
    /// Reflectance at normal incidence.
    pub reflectance: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Extinction for one pass through the layer at normal incidence, −½·log₂ T.
    pub extinction: Vec3,
    /// Albedo E of the lobe for a weight of 1.
    pub albedo: LobeAlbedoPolynomial,
}

impl Coat {
    /// Creates a coat. Returns `None` if its weight is 0.
    pub fn new(inputs: CoatTexturedParameters) -> Option<Self> {
        if inputs.weight.as_untextured() == Some(0.0) {
            return None;
        }
        let albedo = inputs.roughness.as_untextured().map(SchlickAlbedoPair::computed_for_roughness);
        Some(Self { inputs, albedo })
    }

    /// Looks up all parameters.
    #[inline]
    pub fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> CoatPoint {
        let CoatTexturedParameters { weight, roughness, ior, tint } = &self.inputs;
        let weight = lookup.number(weight).clamp(0.0, 1.0);
        let roughness = lookup.number(roughness).clamp(0.0, 1.0);
        // A partial coat absorbs in proportion to its weight.
        let tint = Vec3::ONE + (lookup.color(tint).min(Vec3::ONE) - Vec3::ONE) * weight;
        let tint = tint.max(Vec3::splat(f32::MIN_POSITIVE));
        let ratio = (f64::from(*ior) - 1.0) / (f64::from(*ior) + 1.0);
        let reflectance = (ratio * ratio) as f32;
        let albedo = self.albedo.unwrap_or_else(|| SchlickAlbedoPair::from_static_tables(roughness));
        CoatPoint {
            weight,
            alpha: microfacet::alphas_from_roughness(roughness, 0.0)[0],
            reflectance,
            ior: *ior,
            extinction: Vec3::new(log2(tint.x), log2(tint.y), log2(tint.z)) * -0.5,
            albedo: albedo.dielectric_albedo(reflectance),
        }
    }

    /// Whether any texture uses the shape's own coordinates.
    pub fn uses_object_point(&self) -> bool {
        let mut textures = MaterialTextureCollector::default();
        self.look_up_parameters(&mut textures);
        textures.scattering.iter().any(|texture| texture.uses_object_point())
    }

    /// Transmittance t for light that leaves the layer below at the given cosine. Counts texture lookups in
    /// `lookups`.
    pub fn transmittance(&self, at: &TexturePoint, cosine: f32, lookups: &mut u64) -> Vec3 {
        let layer = SchlickCoatLayer::from(
            &self.look_up_parameters(&mut PointTextureEvaluator { point: at, lookups }),
        );
        let cosine = cosine.abs();
        layer.absorption_transmittance(layer.path_length(cosine)) * (1.0 - layer.albedo(cosine))
    }

    /// Transmittance t² in and out at the given cosine, including interreflection between the coat and a
    /// mirror with the reflectance `base`. Counts texture lookups in `lookups`.
    pub fn two_way_transmittance(
        &self,
        at: &TexturePoint,
        cosine: f32,
        base: Vec3,
        lookups: &mut u64,
    ) -> Vec3 {
        let layer = SchlickCoatLayer::from(
            &self.look_up_parameters(&mut PointTextureEvaluator { point: at, lookups }),
        );
        let albedo = layer.albedo(cosine);
        let passed = (1.0 - albedo) * (1.0 - albedo);
        let absorbed = layer.absorption_transmittance(2.0 * layer.path_length(cosine));
        absorbed * passed * interreflection_gain(base, albedo)
    }
}

soa! {
    /// A coat at a point, with the GGX or the Beckmann distribution. Its facets reflect according to the
    /// exact Fresnel equations if `EXACT`, and otherwise according to Schlick's approximation.
    pub struct CoatLayer<const EXACT: bool, const BECKMANN: bool> in CoatLayerPacket {
        /// [`CoatPoint::weight`].
        pub weight: f32 = 0.0,
        /// [`CoatPoint::alpha`].
        pub alpha: f32 = 1.0,
        /// [`CoatPoint::reflectance`], used by Schlick's approximation.
        pub reflectance: f32 = 0.0,
        /// [`CoatPoint::ior`].
        pub ior: f32 = 1.5,
        /// [`CoatPoint::extinction`].
        pub extinction: Vec3 = Vec3::ZERO,
        /// Polynomial terms of [`CoatPoint::albedo`].
        pub terms: [f32; TERMS] = [0.0; TERMS],
    }
}

/// Sum 1/(1 − x) of the geometric series of reflections between a coat and its base, where x is the product
/// of their reflectances. Clamps the base's reflectance to 1.
#[inline(always)]
pub fn interreflection_gain(base: Vec3, coat: f32) -> Vec3 {
    let least = Vec3::splat(f32::MIN_POSITIVE);
    Vec3::ONE / (Vec3::ONE - base.min(Vec3::ONE) * coat).max(least)
}

/// The layer of a clear coat.
pub type SchlickCoatLayer = CoatLayer<false, false>;

impl From<&CoatPoint> for SchlickCoatLayer {
    #[inline(always)]
    fn from(point: &CoatPoint) -> Self {
        let &CoatPoint { weight, alpha, reflectance, ior, extinction, albedo } = point;
        Self { weight, alpha, reflectance, ior, extinction, terms: albedo.terms }
    }
}

/// Limits a cosine to at least 0.
#[inline(always)]
pub(super) fn clamp_cosine_to_nonnegative(cosine: f32) -> f32 {
    if cosine > 0.0 { cosine } else { 0.0 }
}

impl<const EXACT: bool, const BECKMANN: bool> CoatLayer<EXACT, BECKMANN> {
    const DISTRIBUTION: MicrofacetDistribution = MicrofacetDistribution::ggx_or_beckmann(BECKMANN);

    /// Directional albedo c·E at a cosine ≥ 0.
    #[inline(always)]
    pub fn albedo(&self, cosine: f32) -> f32 {
        self.weight * evaluate_albedo_fit(cosine, |number| self.terms[number])
    }

    /// Reflectance of a facet.
    #[inline(always)]
    pub fn fresnel(&self, cosine: f32) -> f32 {
        if EXACT {
            fresnel_dielectric_from_outside(cosine, self.ior)
        } else {
            self.reflectance + (1.0 - self.reflectance) * schlick_weight(cosine)
        }
    }

    /// Smith terms for the directions to the viewer and to the light.
    #[inline(always)]
    fn smith_terms(&self, normal: Vec3, wo: Vec3, wi: Vec3) -> (SmithDirectionTerms, SmithDirectionTerms) {
        (
            SmithDirectionTerms::isotropic(Self::DISTRIBUTION, normal, wo, self.alpha),
            SmithDirectionTerms::isotropic(Self::DISTRIBUTION, normal, wi, self.alpha),
        )
    }

    /// f of the lobe in sr⁻¹, or 0 for directions below the surface.
    #[inline(always)]
    pub fn lobe_f(&self, normal: Vec3, wo: Vec3, wi: Vec3) -> f32 {
        let half = UnnormalizedHalfVector::from_reflection(normal, wo, wi);
        let fresnel = self.fresnel(half.cosine_to_either_direction());
        let (eye, light) = self.smith_terms(normal, wo, wi);
        let distribution = half.isotropic_d(Self::DISTRIBUTION, self.alpha);
        self.weight * fresnel * eye.torrance_sparrow_without_fresnel(&light, distribution)
    }

    /// Pdf in sr⁻¹ of a direction sampled with [`CoatLayer::sample`].
    #[inline(always)]
    pub fn pdf(&self, normal: Vec3, wo: Vec3, wi: Vec3) -> f32 {
        let half = UnnormalizedHalfVector::from_reflection(normal, wo, wi);
        let (eye, light) = self.smith_terms(normal, wo, wi);
        let pdf = eye.reflection_pdf(half.isotropic_d(Self::DISTRIBUTION, self.alpha));
        if light.is_direction_above_surface() { pdf } else { 0.0 }
    }

    /// Samples a direction from the lobe.
    #[inline(always)]
    pub fn sample(&self, normal: Vec3, wo: Vec3, u: [f32; 2]) -> Vec3 {
        sample_reflected_direction(Self::DISTRIBUTION, &Frame::from_normal(normal), wo, [self.alpha; 2], u)
    }

    /// Length of the refracted path through the layer, 1/cosθₜ in units of its thickness, at a cosine ≥ 0.
    #[inline(always)]
    pub fn path_length(&self, cosine: f32) -> f32 {
        let squared = (self.ior - 1.0) * (self.ior + 1.0) + cosine * cosine;
        self.ior / squared.sqrt().max(f32::MIN_POSITIVE)
    }

    /// Transmittance along a path of this length through the layer.
    #[inline(always)]
    pub fn absorption_transmittance(&self, length: f32) -> Vec3 {
        let Vec3 { x, y, z } = self.extinction * -length;
        Vec3::new(exp2(x), exp2(y), exp2(z))
    }
}
