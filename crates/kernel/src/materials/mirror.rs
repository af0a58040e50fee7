//! Perfect mirrors.

use std::sync::Arc;

use super::conductor::ConductorFresnel;
use super::footprint::TexturePoint;
use super::lookup::{MaterialTextureCollector, ParameterLookup, PointTextureEvaluator, WhiteTextureLookup};
use super::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;

/// A perfect mirror.
#[derive(Clone, Debug, PartialEq)]
pub enum Mirror {
    /// The same reflectance at all angles.
    Constant(ColorOrTexture),
    /// A smooth conductor.
    Conductor(ConductorFresnel),
}

impl Mirror {
    /// Reflectance at an incident angle with the given cosine. The color is multiplied by `tint`. Counts
    /// texture lookups in `lookups`.
    #[inline]
    pub fn reflectance(&self, cosine: f32, tint: Option<Vec3>, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Constant(color) => color.evaluate(at, lookups).min(Vec3::ONE) * tint.unwrap_or(Vec3::ONE),
            Self::Conductor(fresnel) => {
                let fresnel = fresnel.look_up_parameters(&mut PointTextureEvaluator { point: at, lookups });
                tint.map_or(fresnel, |tint| fresnel.tinted(tint)).reflectance(cosine)
            }
        }
    }

    /// [`Mirror::reflectance`] with white textures.
    pub fn reflectance_with_white_textures(&self, cosine: f32) -> Vec3 {
        match self {
            Self::Constant(color) => color.as_untextured().unwrap_or(Vec3::ONE),
            Self::Conductor(fresnel) => {
                fresnel.look_up_parameters(&mut WhiteTextureLookup).reflectance(cosine)
            }
        }
    }

    /// All textures of the mirror.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let mut textures = MaterialTextureCollector::default();
        match self {
            Self::Constant(color) => {
                textures.color(color);
            }
            Self::Conductor(fresnel) => {
                fresnel.look_up_parameters(&mut textures);
            }
        }
        textures.scattering.into_iter()
    }
}

/// The reflection of the direction `incident`: R = I − 2(I·N)N.
pub fn reflect(incident: Vec3, normal: Vec3) -> Vec3 {
    incident - normal * (2.0 * incident.dot(normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec2;

    #[test]
    fn tint_scales_schlick_metals_but_not_eta_k() {
        let (at, half) = (TexturePoint::from_uv(DVec2::ZERO), Some(Vec3::splat(0.5)));
        let gray = |mirror: &Mirror, cosine: f32, tint| mirror.reflectance(cosine, tint, &at, &mut 0).x;
        let color = |reflectance: f32| ColorOrTexture::Constant(Vec3::splat(reflectance));
        let even = Mirror::Constant(color(0.8));
        assert_eq!([gray(&even, 0.1, None), gray(&even, 0.1, half)], [0.8, 0.4]);
        // Schlick: F0 + (1 − F0)(1 − cosθ)⁵ with F0 = 0.4.
        let metal = Mirror::Conductor(ConductorFresnel::Schlick(color(0.8)));
        assert!((gray(&metal, 0.5, half) - (0.4 + 0.6 / 32.0)).abs() < 1e-6);
        let index = Mirror::Conductor(ConductorFresnel::Index { eta: color(0.2), k: color(3.9) });
        assert_eq!(gray(&index, 0.5, half), gray(&index, 0.5, None));
    }

    #[test]
    fn extreme_metal_indices_conserve_energy() {
        let at = TexturePoint::from_uv(DVec2::ZERO);
        for (eta, k) in [(1e-30_f32, 0.0_f32), (1e30, 0.0), (0.0, 1e38), (f32::MAX, f32::MAX), (5e9, 5e9)] {
            let [eta, k] = [eta, k].map(|part| ColorOrTexture::Constant(Vec3::splat(part)));
            let metal = Mirror::Conductor(ConductorFresnel::Index { eta, k });
            for cosine in [0.01, 0.5, 1.0] {
                let part = metal.reflectance(cosine, None, &at, &mut 0).x;
                assert!((0.999..=1.0).contains(&part), "{metal:?}: {part}");
            }
        }
    }

    #[test]
    fn reflection_preserves_the_angle() {
        let (incident, normal) = (Vec3::new(0.6, -0.8, 0.0), Vec3::Y);
        assert_eq!(reflect(incident, normal), Vec3::new(0.6, 0.8, 0.0));
        assert_eq!(reflect(incident, -normal), reflect(incident, normal));
    }
}
