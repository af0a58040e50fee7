//! Directional albedos of microfacet lobes that use Schlick's approximation. The approximation is linear in
//! the reflectances at normal incidence and at grazing angles, so two albedos cover all of them.

use std::sync::LazyLock;

use super::lobe_albedo::{AlbedoTable, LobeAlbedoPolynomial};
use super::microfacet::{self, MicrofacetDistribution};

/// Albedos of two lobes that use Schlick's approximation. The facets of one lobe have a reflectance of 1 at
/// normal incidence and 0 at grazing angles; the facets of the other lobe have the reverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SchlickAlbedoPair {
    /// Albedo per unit of reflectance at normal incidence.
    pub normal: LobeAlbedoPolynomial,
    /// Albedo per unit of reflectance at grazing angles.
    pub grazing: LobeAlbedoPolynomial,
}

impl SchlickAlbedoPair {
    /// The albedos for a constant roughness.
    pub fn computed_for_roughness(roughness: f32) -> Self {
        let [normal, grazing] = build_schlick_albedo_tables(Some(roughness));
        Self { normal: normal.lobe_at_roughness(roughness), grazing: grazing.lobe_at_roughness(roughness) }
    }

    /// The albedos for any roughness, interpolated from tables.
    pub fn from_static_tables(roughness: f32) -> Self {
        static TABLES: LazyLock<[AlbedoTable; 2]> = LazyLock::new(|| build_schlick_albedo_tables(None));
        let [normal, grazing] = &*TABLES;
        Self { normal: normal.lobe_at_roughness(roughness), grazing: grazing.lobe_at_roughness(roughness) }
    }

    /// Albedo of a lobe with this reflectance at normal incidence and a reflectance of 1 at grazing angles.
    pub fn dielectric_albedo(&self, reflectance: f32) -> LobeAlbedoPolynomial {
        let sum = |normal: f32, grazing: f32| reflectance * normal + grazing;
        LobeAlbedoPolynomial {
            terms: std::array::from_fn(|i| sum(self.normal.terms[i], self.grazing.terms[i])),
            mean: sum(self.normal.mean, self.grazing.mean),
        }
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
