//! The principled material, with the parameters of glTF and energy-conserving microfacet lobes.
//!
//! - Specular lobe: F is a mix of a metal and a dielectric, weighted by `metallic`. Both use Schlick's
//!   approximation. For the metal, F0 is `color`. For the dielectric, F0 = min(((ior − 1)/(ior + 1))² ·
//!   specular_color, 1) · specular and F90 = specular.
//! - Diffuse lobe: (1 − metallic)(1 − transmission) · color/π · (1 − E(μᵢ))(1 − E(μₒ))/(1 − Ē), where E is
//!   the albedo of the dielectric lobe.
//! - Transmission through a thin sheet: the specular lobe, mirrored to the other side, times (1 − metallic) ·
//!   transmission · color · (1 − F), where F is the reflectance of the dielectric. Transmissive surfaces are
//!   represented by two vertices, see [`bsdf`](crate::materials::bsdf).
//! - Diffuse transmission kt: f = (1 − metallic)(1 − transmission) · min(kt, 1 − color)/π · (1 − E(μᵢ))(1 −
//!   E(μₒ))/(1 − Ē) for light from the other side.
//! - The clear coat is a [`Coat`](crate::materials::Coat), as over other materials.

mod bxdf;

use std::f32::consts::FRAC_1_PI;

use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::lookup::ParameterLookup;
use crate::materials::microfacet;
use crate::materials::scalar::ScalarParameter;
use crate::materials::schlick_albedo::SchlickAlbedoPair;
use crate::materials::texture::ColorOrTexture;
use crate::math::Vec3;
pub use bxdf::PrincipledBxdf;

/// A principled material.
#[derive(Clone, Debug, PartialEq)]
pub struct Principled {
    inputs: PrincipledInputs,
    /// Albedos of the specular lobe, or `None` if the roughness varies.
    albedo: Option<SchlickAlbedoPair>,
}

/// The parameters of a principled material.
#[derive(Clone, Debug, PartialEq)]
pub struct PrincipledInputs {
    /// Diffuse reflectance, and reflectance of the metal at normal incidence.
    pub color: ColorOrTexture,
    /// Weight of the metallic part.
    pub metallic: ScalarParameter,
    /// The square root of α.
    pub roughness: ScalarParameter,
    /// Index of refraction, at least 1.
    pub ior: f32,
    /// Factor for the dielectric's reflectance.
    pub specular: ScalarParameter,
    /// Factor for the dielectric's reflectance at normal incidence.
    pub specular_color: ColorOrTexture,
    /// Fraction of the light that enters the dielectric and is transmitted instead of scattered.
    pub transmission: ScalarParameter,
    /// Diffuse transmittance kt.
    pub diffuse_transmission: ColorOrTexture,
}

/// [`Principled`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipledPoint {
    /// f of the diffuse lobe in sr⁻¹, for light that passes through the lobes above it in both directions.
    pub base: Vec3,
    /// [`PrincipledPoint::base`] for light from the other side.
    pub transmitted_base: Vec3,
    /// Largest components of the albedos of these two lobes, without attenuation by the lobes above them.
    pub diffuse_albedos: [f32; 2],
    /// Reflectance of the specular lobe at normal incidence.
    pub facets: Vec3,
    /// The metallic part of [`PrincipledPoint::facets`].
    pub metal: Vec3,
    /// Reflectance of the specular lobe at grazing angles.
    pub grazing: f32,
    /// Reflectances of the dielectric at normal incidence and at grazing angles.
    pub dielectric: (Vec3, f32),
    /// Factor for (1 − F)·D·G/(4 cosθᵢ cosθₒ) for transmitted light.
    pub transmission: Vec3,
    /// α of the specular lobe.
    pub alpha: f32,
    /// Albedos of the specular lobe.
    pub albedo: SchlickAlbedoPair,
    /// Reflectance for ambient light.
    pub ambient: Vec3,
}

impl PrincipledPoint {
    /// Whether the material transmits light.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.transmission != Vec3::ZERO || self.transmitted_base != Vec3::ZERO
    }
}

impl Principled {
    /// Creates a material from its parameters.
    pub fn new(inputs: PrincipledInputs) -> Self {
        let albedo = inputs.roughness.as_untextured().map(SchlickAlbedoPair::computed_for_roughness);
        Self { inputs, albedo }
    }
}

impl SpatiallyVaryingBxdf for Principled {
    type Point = PrincipledPoint;

    #[inline]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> PrincipledPoint {
        let inputs = &self.inputs;
        let mut unit = |number: &'m ScalarParameter| lookup.number(number).clamp(0.0, 1.0);
        let (metallic, roughness) = (unit(&inputs.metallic), unit(&inputs.roughness));
        let (specular, through) = (unit(&inputs.specular), unit(&inputs.transmission));
        let color = lookup.color(&inputs.color).min(Vec3::ONE);
        let transmitted = lookup.color(&inputs.diffuse_transmission).min(Vec3::ONE - color);
        let ratio = (inputs.ior - 1.0) / (inputs.ior + 1.0);
        let specular_color = lookup.color(&inputs.specular_color);
        let reflectance = (specular_color * (ratio * ratio)).min(Vec3::ONE) * specular;
        let albedo = self.albedo.unwrap_or_else(|| SchlickAlbedoPair::from_static_tables(roughness));
        let mean = reflectance * albedo.normal.mean + Vec3::splat(specular * albedo.grazing.mean);
        let below = color * (1.0 - metallic);
        let diffuse = below * (1.0 - through);
        let transmitted = transmitted * ((1.0 - metallic) * (1.0 - through));
        let entering = (Vec3::ONE - mean).max(Vec3::splat(1e-3));
        PrincipledPoint {
            base: diffuse * FRAC_1_PI / entering,
            transmitted_base: transmitted * FRAC_1_PI / entering,
            diffuse_albedos: [diffuse, transmitted].map(Vec3::max_element),
            facets: reflectance.lerp(color, metallic),
            metal: color * metallic,
            grazing: specular + (1.0 - specular) * metallic,
            dielectric: (reflectance, specular),
            transmission: below * through,
            alpha: microfacet::alphas_from_roughness(roughness, 0.0)[0],
            albedo,
            ambient: diffuse,
        }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.color(&self.inputs.color)
    }

    fn look_up_ambient_reflectance<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        let PrincipledInputs { color, metallic, transmission, .. } = &self.inputs;
        let [metallic, transmission] =
            [metallic, transmission].map(|number| lookup.number(number).clamp(0.0, 1.0));
        lookup.color(color) * (1.0 - metallic) * (1.0 - transmission)
    }

    fn is_transmissive(&self) -> bool {
        let PrincipledInputs { transmission, diffuse_transmission, .. } = &self.inputs;
        transmission.as_untextured() != Some(0.0) || diffuse_transmission.as_untextured() != Some(Vec3::ZERO)
    }
}

impl BxdfParameters for PrincipledPoint {
    #[inline]
    fn is_black(&self) -> bool {
        let is_dark = self.base == Vec3::ZERO && self.facets == Vec3::ZERO && !self.transmits();
        is_dark && self.grazing == 0.0
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        self.ambient
    }

    fn tinted(self, color: Vec3) -> Self {
        let metal = self.metal * color;
        let facets = self.facets - self.metal + metal;
        let (base, transmission) = (self.base * color, self.transmission * color);
        Self { base, facets, metal, transmission, ambient: self.ambient * color, ..self }
    }
}

#[cfg(test)]
mod tests;
