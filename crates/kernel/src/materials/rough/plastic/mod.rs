//! Plastic: a diffuse base under a dielectric microfacet coat. With the coat's albedo E and its internal
//! reflectance F_dr = 1 − (1 − Ē)/η², f = specular·F·D·G/(4 cosθᵢ cosθₒ) + (1 − E(μᵢ))(1 − E(μₒ))·kd/(π η² (1
//! − kd·F_dr)). This includes the coat's transmittance in both directions and the light that it reflects back
//! to the base. White plastic reflects all light (Kulla and Conty, *Revisiting Physically Based Shading at
//! Imageworks*, SIGGRAPH 2017 course, without the multiple scattering).

mod bxdf;

use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

use crate::materials::bsdf::{RoughMaterial, RoughPoint};
use crate::materials::footprint::TexturePoint;
use crate::materials::lobe_albedo::{AlbedoTable, LobeAlbedo, dielectric, under_coat};
use crate::materials::microfacet;
use crate::materials::scalar::Number;
use crate::materials::texture::{Color, Texture};
use crate::math::Vec3;
pub use bxdf::PlasticBxdf;

/// A diffuse base under a coat. If the coat is smooth, this type contains only the base. See
/// [`crate::materials::Coated`].
#[derive(Clone, Debug, PartialEq)]
pub struct Plastic {
    diffuse: Color,
    specular: Color,
    roughness: Number,
    ior: f32,
    /// Albedos of the coat.
    albedos: AlbedoTable,
}

/// [`Plastic`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlasticPoint {
    /// Diffuse reflectance kd.
    pub diffuse: Vec3,
    /// f of the base in sr⁻¹, for light that passes through the coat in both directions.
    pub base: Vec3,
    /// Factor for the coat's reflectance. 0 if the coat is smooth.
    pub specular: Vec3,
    /// Index of refraction.
    pub ior: f32,
    /// α. 0 if the coat is smooth.
    pub alpha: f32,
    /// Albedo of the coat.
    pub albedo: LobeAlbedo,
}

impl Plastic {
    /// Creates a plastic material from kd, a factor for the coat's reflectance, the square root of α, and an
    /// index of refraction of at least 1.
    pub fn new(diffuse: Color, specular: Color, roughness: Number, ior: f32) -> Self {
        let fresnel = |cosine: f64| dielectric(cosine, ior.into());
        let is_smooth = roughness.constant() == Some(0.0);
        let albedos = if is_smooth {
            AlbedoTable::single(LobeAlbedo::fit_with_exact_mean(fresnel))
        } else {
            AlbedoTable::new(roughness.constant(), |one| microfacet::alphas(one, 0.0)[0], fresnel)
        };
        Self { diffuse, specular, roughness, ior, albedos }
    }

    /// Whether the coat is smooth.
    fn is_smooth(&self) -> bool {
        self.roughness.constant() == Some(0.0)
    }

    fn point(&self, diffuse: Vec3, specular: Vec3, roughness: f32) -> PlasticPoint {
        let (albedo, is_smooth) = (self.albedos.at(roughness), self.is_smooth());
        let (diffuse, specular) = (diffuse.min(Vec3::ONE), specular.min(Vec3::ONE));
        PlasticPoint {
            diffuse,
            base: base(diffuse, self.ior, &albedo),
            specular: if is_smooth { Vec3::ZERO } else { specular },
            ior: self.ior,
            alpha: if is_smooth { 0.0 } else { microfacet::alphas(roughness, 0.0)[0] },
            albedo,
        }
    }
}

/// Computes f in sr⁻¹ of a base from its kd, for light that passes through the coat in both directions.
fn base(diffuse: Vec3, ior: f32, coat: &LobeAlbedo) -> Vec3 {
    let squared = ior * ior;
    let returned = 1.0 - (1.0 - coat.mean) / squared;
    under_coat(diffuse, returned) * (FRAC_1_PI / squared)
}

impl RoughMaterial for Plastic {
    type Point = PlasticPoint;

    #[inline]
    fn at(&self, at: &TexturePoint, lookups: &mut u64) -> PlasticPoint {
        let (diffuse, specular) = (self.diffuse.at(at, lookups), self.specular.at(at, lookups));
        self.point(diffuse, specular, self.roughness.at(at, lookups))
    }

    fn with_white_textures(&self) -> PlasticPoint {
        let with_white_textures = |color: &Color| color.constant().unwrap_or(Vec3::ONE);
        let roughness = self.roughness.constant().unwrap_or(1.0);
        self.point(with_white_textures(&self.diffuse), with_white_textures(&self.specular), roughness)
    }

    #[inline]
    fn constant(&self) -> Option<PlasticPoint> {
        Some(self.point(self.diffuse.constant()?, self.specular.constant()?, self.roughness.constant()?))
    }

    #[inline]
    fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        self.diffuse.at(at, lookups)
    }

    fn ambient_at(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        self.diffuse.at(at, lookups)
    }

    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let colors = [&self.diffuse, &self.specular].into_iter().filter_map(Color::texture);
        colors.chain(self.roughness.texture())
    }

    #[inline]
    fn supports_packets(&self) -> bool {
        let has_no_levels = self.diffuse.texture().is_none_or(|texture| texture.mipmaps.is_none());
        has_no_levels && self.specular.texture().is_none() && self.roughness.texture().is_none()
    }

    #[inline]
    fn row_texture(&self) -> Option<&Texture> {
        self.diffuse.texture().map(|texture| &**texture)
    }
}

impl RoughPoint for PlasticPoint {
    #[inline]
    fn is_black(&self) -> bool {
        self.base == Vec3::ZERO && self.specular == Vec3::ZERO
    }

    #[inline]
    fn ambient(&self) -> Vec3 {
        self.diffuse
    }

    fn tinted(self, color: Vec3) -> Self {
        let diffuse = (self.diffuse * color).min(Vec3::ONE);
        Self { diffuse, base: base(diffuse, self.ior, &self.albedo), ..self }
    }
}

#[cfg(test)]
mod tests;
