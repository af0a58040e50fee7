//! Plastic: a diffuse base under a dielectric microfacet coat. With the coat's albedo E and its internal
//! reflectance F_dr = 1 − (1 − Ē)/η², f = specular·F·D·G/(4 cosθᵢ cosθₒ) + (1 − E(μᵢ))(1 − E(μₒ))·kd/(π η² (1
//! − kd·F_dr)). This includes the coat's transmittance in both directions and the light that it reflects back
//! to the base. White plastic reflects all light (Kulla and Conty, *Revisiting Physically Based Shading at
//! Imageworks*, SIGGRAPH 2017 course, without the multiple scattering).

mod bxdf;

use std::f32::consts::FRAC_1_PI;

use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::lobe_albedo::{
    AlbedoTable, LobeAlbedoPolynomial, fresnel_dielectric_f64, reflectance_inside_coat,
};
use crate::materials::lookup::ParameterLookup;
use crate::materials::microfacet::{self, MicrofacetDistribution};
use crate::materials::scalar::ScalarParameter;
use crate::materials::texture::ColorOrTexture;
use crate::math::Vec3;
pub use bxdf::PlasticBxdf;

/// A diffuse base under a coat. If the coat is smooth, this type contains only the base. See
/// [`crate::materials::SpecularOverBase`].
#[derive(Clone, Debug, PartialEq)]
pub struct Plastic {
    diffuse: ColorOrTexture,
    specular: ColorOrTexture,
    roughness: ScalarParameter,
    ior: f32,
    /// Albedos of the coat.
    albedos: AlbedoTable,
    /// Whether the base's reflectance is proportional to kd.
    is_linear: bool,
}

/// [`Plastic`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlasticPoint {
    /// Diffuse reflectance kd.
    pub diffuse: Vec3,
    /// f of the base in sr⁻¹, for light that passes through the coat in both directions.
    pub base: Vec3,
    /// Factor for the coat's reflectance, or 0 if the coat is smooth.
    pub specular: Vec3,
    /// Index of refraction.
    pub ior: f32,
    /// α of the coat, or 0 if it is smooth.
    pub alpha: f32,
    /// Albedo of the coat.
    pub albedo: LobeAlbedoPolynomial,
    /// Whether the base's reflectance is proportional to kd.
    pub is_linear: bool,
}

impl Plastic {
    /// Creates a plastic material from kd, a factor for the coat's reflectance, the square root of α, an
    /// index of refraction of at least 1, and the distribution of the coat's facets.
    pub fn new(
        diffuse: ColorOrTexture,
        specular: ColorOrTexture,
        roughness: ScalarParameter,
        ior: f32,
        distribution: MicrofacetDistribution,
    ) -> Self {
        let fresnel = |cosine: f64| fresnel_dielectric_f64(cosine, ior.into());
        let is_smooth = roughness.as_untextured() == Some(0.0);
        let albedos = if is_smooth {
            AlbedoTable::from_single_albedo(LobeAlbedoPolynomial::fit_storing_exact_mean(fresnel))
        } else {
            AlbedoTable::new(
                distribution,
                roughness.as_untextured(),
                |one| microfacet::alphas_from_roughness(one, 0.0)[0],
                fresnel,
            )
        };
        Self { diffuse, specular, roughness, ior, albedos, is_linear: false }
    }

    /// Makes the reflectance of the base proportional to kd, as if the light that the coat reflects back met
    /// a white base. Colors do not become more saturated.
    #[must_use]
    pub fn with_linear_base(self) -> Self {
        Self { is_linear: true, ..self }
    }

    /// Whether the coat is smooth.
    fn is_smooth(&self) -> bool {
        self.roughness.as_untextured() == Some(0.0)
    }
}

/// Computes f in sr⁻¹ of a base from its kd, for light that passes through the coat in both directions.
fn base_layer_f(diffuse: Vec3, ior: f32, coat: &LobeAlbedoPolynomial, is_linear: bool) -> Vec3 {
    let squared = ior * ior;
    let returned = 1.0 - (1.0 - coat.mean) / squared;
    let reflected =
        if is_linear { diffuse / (1.0 - returned) } else { reflectance_inside_coat(diffuse, returned) };
    reflected * (FRAC_1_PI / squared)
}

impl SpatiallyVaryingBxdf for Plastic {
    type Point = PlasticPoint;

    #[inline(always)]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> PlasticPoint {
        let diffuse = lookup.color(&self.diffuse).min(Vec3::ONE);
        let specular = lookup.color(&self.specular).min(Vec3::ONE);
        let roughness = lookup.number(&self.roughness);
        let (albedo, is_smooth) = (self.albedos.lobe_at_roughness(roughness), self.is_smooth());
        PlasticPoint {
            diffuse,
            base: base_layer_f(diffuse, self.ior, &albedo, self.is_linear),
            specular: if is_smooth { Vec3::ZERO } else { specular },
            ior: self.ior,
            alpha: if is_smooth { 0.0 } else { microfacet::alphas_from_roughness(roughness, 0.0)[0] },
            albedo,
            is_linear: self.is_linear,
        }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.color(&self.diffuse)
    }

    fn look_up_ambient_reflectance<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.color(&self.diffuse)
    }

    #[inline]
    fn color_to_look_up(&self) -> Option<&ColorOrTexture> {
        Some(&self.diffuse)
    }
}

impl BxdfParameters for PlasticPoint {
    #[inline]
    fn is_black(&self) -> bool {
        self.base == Vec3::ZERO && self.specular == Vec3::ZERO
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        self.diffuse
    }

    fn tinted(self, color: Vec3) -> Self {
        let diffuse = (self.diffuse * color).min(Vec3::ONE);
        Self { diffuse, base: base_layer_f(diffuse, self.ior, &self.albedo, self.is_linear), ..self }
    }
}

#[cfg(test)]
mod tests;
