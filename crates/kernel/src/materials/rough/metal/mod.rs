//! Conductors: microfacets with the exact Fresnel equations, or with Schlick's approximation for a color.

mod bxdf;
pub mod elements;

use std::sync::Arc;

use crate::materials::bsdf::{RoughMaterial, RoughPoint};
use crate::materials::footprint::TexturePoint;
use crate::materials::fresnel::{conductor, schlick_weight};
use crate::materials::microfacet;
use crate::materials::scalar::Number;
use crate::materials::texture::{Color, Texture};
use crate::math::Vec3;
pub use bxdf::ConductorBxdf;

/// A rough conductor with a single lobe.
#[derive(Clone, Debug, PartialEq)]
pub struct Conductor {
    /// Reflectance of the facets.
    pub fresnel: ConductorFresnel,
    /// The square root of α.
    pub roughness: Number,
    /// Elongation of the lobe along u, in [−1, 1].
    pub anisotropy: Number,
}

/// Reflectance of a smooth conductor as a function of angle.
#[derive(Clone, Debug, PartialEq)]
pub enum ConductorFresnel {
    /// Schlick's approximation, based on the reflectance at normal incidence.
    Schlick(Color),
    /// Exact equations, from the complex index of refraction.
    Index {
        /// Real part for red, green, and blue.
        eta: Color,
        /// Imaginary part for red, green, and blue.
        k: Color,
    },
}

/// [`ConductorFresnel`] at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FresnelPoint {
    /// The reflectance at normal incidence, or the real part η.
    pub first: Vec3,
    /// The imaginary part k. Negative for Schlick's approximation.
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
    /// Looks up the textures and returns the reflectance at a single point. Counts texture lookups in
    /// `lookups`.
    #[inline]
    pub fn at(&self, at: &TexturePoint, lookups: &mut u64) -> FresnelPoint {
        match self {
            Self::Schlick(color) => FresnelPoint::schlick(color.at(at, lookups)),
            Self::Index { eta, k } => FresnelPoint::index(eta.at(at, lookups), k.at(at, lookups)),
        }
    }

    /// The conductor with all textures replaced by white ones.
    pub fn with_white_textures(&self) -> FresnelPoint {
        let with_white_textures = |color: &Color| color.constant().unwrap_or(Vec3::ONE);
        match self {
            Self::Schlick(color) => FresnelPoint::schlick(with_white_textures(color)),
            Self::Index { eta, k } => FresnelPoint::index(with_white_textures(eta), with_white_textures(k)),
        }
    }

    /// The conductor's values if it has no textures.
    pub fn constant(&self) -> Option<FresnelPoint> {
        match self {
            Self::Schlick(color) => color.constant().map(FresnelPoint::schlick),
            Self::Index { eta, k } => Some(FresnelPoint::index(eta.constant()?, k.constant()?)),
        }
    }

    /// All textures of the conductor.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let colors = match self {
            Self::Schlick(color) => [Some(color), None],
            Self::Index { eta, k } => [Some(eta), Some(k)],
        };
        colors.into_iter().flatten().filter_map(Color::texture)
    }
}

impl FresnelPoint {
    /// Schlick's approximation. Limits the reflectance at normal incidence to at most 1.
    pub fn schlick(reflectance: Vec3) -> Self {
        Self { first: reflectance.min(Vec3::ONE), second: Vec3::NEG_ONE }
    }

    /// Uses the exact equations, with a complex index of refraction. The index is limited to 1e8, where
    /// metals reflect all light, because the fourth power of a larger value would overflow.
    pub fn index(eta: Vec3, k: Vec3) -> Self {
        const MOST: Vec3 = Vec3::splat(1e8);
        Self { first: eta.min(MOST), second: k.min(MOST) }
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
    let exact = conductor(cosine, first, second);
    let approximate = first + (1.0 - first) * weight;
    if second < 0.0 { approximate } else { exact }
}

impl RoughMaterial for Conductor {
    type Point = ConductorPoint;

    #[inline]
    fn at(&self, at: &TexturePoint, lookups: &mut u64) -> ConductorPoint {
        let roughness = self.roughness.at(at, lookups);
        let anisotropy = self.anisotropy.at(at, lookups);
        ConductorPoint {
            fresnel: self.fresnel.at(at, lookups),
            alphas: microfacet::alphas(roughness, anisotropy.clamp(-1.0, 1.0)),
        }
    }

    fn with_white_textures(&self) -> ConductorPoint {
        let roughness = self.roughness.constant().unwrap_or(1.0);
        let anisotropy = self.anisotropy.constant().unwrap_or(0.0);
        ConductorPoint {
            fresnel: self.fresnel.with_white_textures(),
            alphas: microfacet::alphas(roughness, anisotropy),
        }
    }

    #[inline]
    fn constant(&self) -> Option<ConductorPoint> {
        let alphas = microfacet::alphas(self.roughness.constant()?, self.anisotropy.constant()?);
        Some(ConductorPoint { fresnel: self.fresnel.constant()?, alphas })
    }

    #[inline]
    fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        self.fresnel.at(at, lookups).reflectance(1.0)
    }

    fn ambient_at(&self, _: &TexturePoint, _: &mut u64) -> Vec3 {
        Vec3::ZERO
    }

    fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let numbers = [&self.roughness, &self.anisotropy].into_iter().filter_map(Number::texture);
        self.fresnel.textures().chain(numbers)
    }

    #[inline]
    fn supports_packets(&self) -> bool {
        !self.has_direction() && self.constant().is_some()
    }

    #[inline]
    fn row_texture(&self) -> Option<&Texture> {
        None
    }

    #[inline]
    fn has_direction(&self) -> bool {
        self.anisotropy.constant() != Some(0.0)
    }
}

impl RoughPoint for ConductorPoint {
    #[inline]
    fn is_black(&self) -> bool {
        false
    }

    #[inline]
    fn ambient(&self) -> Vec3 {
        Vec3::ZERO
    }

    fn tinted(self, color: Vec3) -> Self {
        Self { fresnel: self.fresnel.tinted(color), ..self }
    }
}

#[cfg(test)]
mod tests;
