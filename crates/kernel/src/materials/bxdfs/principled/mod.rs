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
//! - Clear coat c: a lobe with F0 = 0.04, times c. All other lobes are multiplied by (1 − c·E_c(μ)) for each
//!   of the two directions.

mod bxdf;

use std::f32::consts::FRAC_1_PI;
use std::sync::{Arc, LazyLock};

use crate::materials::bsdf::{BxdfMaterial, BxdfParameters};
use crate::materials::footprint::TexturePoint;
use crate::materials::lobe_albedo::{AlbedoTable, LobeAlbedoPolynomial};
use crate::materials::lookup::ParameterLookup;
use crate::materials::microfacet::{self, MicrofacetDistribution};
use crate::materials::scalar::ScalarParameter;
use crate::materials::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;
pub use bxdf::PrincipledBxdf;

/// Reflectance of the clear coat at normal incidence, for an index of refraction of 1.5.
const COAT_REFLECTANCE: f32 = 0.04;

/// A principled material.
#[derive(Clone, Debug, PartialEq)]
pub struct Principled {
    inputs: PrincipledInputs,
    /// Albedos of the specular lobe and of the coat, or `None` for lobes with varying roughness.
    albedos: [Option<SchlickAlbedoPair>; 2],
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
    /// Weight of the clear coat.
    pub clearcoat: ScalarParameter,
    /// The square root of the clear coat's α.
    pub clearcoat_roughness: ScalarParameter,
}

/// [`Principled`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PrincipledPoint {
    /// f of the diffuse lobe in sr⁻¹, for light that passes through the lobes above it in both directions.
    pub base: Vec3,
    /// [`PrincipledPoint::base`] for light from the other side.
    pub transmitted_base: Vec3,
    /// The largest components of the albedos of these two lobes, not including the lobes above them.
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
    /// Weight of the clear coat.
    pub coat: f32,
    /// α of the clear coat.
    pub coat_alpha: f32,
    /// Albedo of the clear coat.
    pub coat_albedo: LobeAlbedoPolynomial,
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

/// Albedos of two lobes that use Schlick's approximation. One lobe's facets have a reflectance of 1 at normal
/// incidence and 0 at grazing angles, and the other lobe's facets 0 at normal incidence and 1 at grazing
/// angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchlickAlbedoPair {
    /// Albedo per unit of reflectance at normal incidence.
    pub normal: LobeAlbedoPolynomial,
    /// Albedo per unit of reflectance at grazing angles.
    pub grazing: LobeAlbedoPolynomial,
}

impl SchlickAlbedoPair {
    /// The albedos for a constant roughness.
    fn computed_for_roughness(roughness: f32) -> Self {
        let [normal, grazing] = build_schlick_albedo_tables(Some(roughness));
        Self { normal: normal.lobe_at_roughness(roughness), grazing: grazing.lobe_at_roughness(roughness) }
    }

    /// The albedos for any roughness, interpolated from tables.
    fn from_static_tables(roughness: f32) -> Self {
        static TABLES: LazyLock<[AlbedoTable; 2]> = LazyLock::new(|| build_schlick_albedo_tables(None));
        let [normal, grazing] = &*TABLES;
        Self { normal: normal.lobe_at_roughness(roughness), grazing: grazing.lobe_at_roughness(roughness) }
    }

    /// Albedo of a coat with this reflectance at normal incidence and a reflectance of 1 at grazing angles.
    fn coat_albedo_polynomial(&self, reflectance: f32) -> LobeAlbedoPolynomial {
        let sum = |normal: f32, grazing: f32| reflectance * normal + grazing;
        LobeAlbedoPolynomial {
            terms: std::array::from_fn(|i| sum(self.normal.terms[i], self.grazing.terms[i])),
            mean: sum(self.normal.mean, self.grazing.mean),
        }
    }
}

/// A clear coat over an emitting surface.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionCoat {
    /// Weight of the coat.
    weight: ScalarParameter,
    /// The square root of the coat's α.
    roughness: ScalarParameter,
    /// The coat's albedo, or `None` if the roughness varies.
    albedo: Option<LobeAlbedoPolynomial>,
}

impl EmissionCoat {
    /// Creates a coat with the given weight and roughness, or returns `None` if the weight is 0.
    pub fn new(weight: ScalarParameter, roughness: ScalarParameter) -> Option<Self> {
        if weight.as_untextured() == Some(0.0) {
            return None;
        }
        let albedo = roughness.as_untextured().map(|one| {
            SchlickAlbedoPair::computed_for_roughness(one).coat_albedo_polynomial(COAT_REFLECTANCE)
        });
        Some(Self { weight, roughness, albedo })
    }

    /// Transmittance for light that leaves the surface at the given cosine. Counts texture lookups in
    /// `lookups`.
    pub fn transmittance(&self, at: &TexturePoint, cosine: f32, lookups: &mut u64) -> f32 {
        let weight = self.weight.evaluate(at, lookups).clamp(0.0, 1.0);
        let between = |roughness: f32| SchlickAlbedoPair::from_static_tables(roughness.clamp(0.0, 1.0));
        let albedo = match self.albedo {
            Some(albedo) => albedo,
            None => between(self.roughness.evaluate(at, lookups)).coat_albedo_polynomial(COAT_REFLECTANCE),
        };
        1.0 - weight * albedo.at_cosine(cosine.abs())
    }

    /// All textures of the coat.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        [&self.weight, &self.roughness].into_iter().filter_map(ScalarParameter::texture)
    }
}

/// The two tables of [`SchlickAlbedoPair`].
fn build_schlick_albedo_tables(roughness: Option<f32>) -> [AlbedoTable; 2] {
    let alpha = |roughness: f32| microfacet::alphas_from_roughness(roughness, 0.0)[0];
    let weight = |cosine: f64| {
        let rest = 1.0 - cosine;
        rest * rest * rest * rest * rest
    };
    const GGX: MicrofacetDistribution = MicrofacetDistribution::Ggx;
    let normal = AlbedoTable::new(GGX, roughness, alpha, |cosine| 1.0 - weight(cosine));
    [normal, AlbedoTable::new(GGX, roughness, alpha, weight)]
}

impl Principled {
    /// Creates a material from its parameters.
    pub fn new(inputs: PrincipledInputs) -> Self {
        let has_coat = inputs.clearcoat.as_untextured() != Some(0.0);
        let coat = inputs.clearcoat_roughness.as_untextured().filter(|_| has_coat);
        let albedos = [inputs.roughness.as_untextured(), coat]
            .map(|roughness| roughness.map(SchlickAlbedoPair::computed_for_roughness));
        // The albedo is irrelevant if the coat has no weight.
        let [specular, coat] = albedos;
        Self { inputs, albedos: [specular, if has_coat { coat } else { specular }] }
    }
}

impl BxdfMaterial for Principled {
    type Point = PrincipledPoint;

    #[inline]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> PrincipledPoint {
        let inputs = &self.inputs;
        let mut unit = |number: &'m ScalarParameter| lookup.number(number).clamp(0.0, 1.0);
        let (metallic, roughness) = (unit(&inputs.metallic), unit(&inputs.roughness));
        let (specular, through) = (unit(&inputs.specular), unit(&inputs.transmission));
        let (coat, coat_roughness) = (unit(&inputs.clearcoat), unit(&inputs.clearcoat_roughness));
        let color = lookup.color(&inputs.color).min(Vec3::ONE);
        let transmitted = lookup.color(&inputs.diffuse_transmission).min(Vec3::ONE - color);
        let ratio = (inputs.ior - 1.0) / (inputs.ior + 1.0);
        let specular_color = lookup.color(&inputs.specular_color);
        let reflectance = (specular_color * (ratio * ratio)).min(Vec3::ONE) * specular;
        let [specular_albedo, coat_albedo] = self.albedos;
        let albedo = specular_albedo.unwrap_or_else(|| SchlickAlbedoPair::from_static_tables(roughness));
        let coat_albedo =
            coat_albedo.unwrap_or_else(|| SchlickAlbedoPair::from_static_tables(coat_roughness));
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
            coat,
            coat_alpha: microfacet::alphas_from_roughness(coat_roughness, 0.0)[0],
            coat_albedo: coat_albedo.coat_albedo_polynomial(COAT_REFLECTANCE),
            ambient: diffuse,
        }
    }

    #[inline]
    fn albedo<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        lookup.color(&self.inputs.color)
    }

    fn ambient<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
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
        is_dark && self.grazing == 0.0 && self.coat == 0.0
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
