//! Rough glass: a boundary between two dielectrics, with microfacets that reflect and refract (Walter,
//! Marschner, Li, Torrance, *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007).
//!
//! Let F be a facet's Fresnel reflectance, n the indices of refraction, o the view direction, and i the light
//! direction. Then
//!
//! - for reflection, f = F·D·G/(4 cosθᵢ cosθₒ), and the facet's normal h has the direction o + i;
//! - for transmission, f = |o·h| |i·h| (1 − F)·D·G·nᵢ²/(cosθᵢ cosθₒ |nₒ o + nᵢ i|²), and h has the direction
//!   nₒ o + nᵢ i. Light is measured in basic radiance, L/n². Therefore, nᵢ² replaces the nₒ² used for
//!   radiance, and f/nᵢ² is the same in both directions.
//!
//! A surface is represented by two vertices, see [`bsdf`](crate::materials::bsdf). Both vertices sample the
//! same facet, and choose reflection with probability F and refraction otherwise. Therefore, f·cosθᵢ divided
//! by the pdf is G/G₁ at both vertices.

mod bxdf;

use super::BxdfPoint;
use crate::materials::bsdf::BxdfParameters;
use crate::materials::microfacet::MicrofacetDistribution;
use crate::math::Vec3;
pub use bxdf::DielectricBxdf;

/// Rough glass at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoughDielectricPoint {
    /// Index of refraction on the viewer's side.
    pub near: f32,
    /// Index of refraction on the other side. Must differ from `near`.
    pub far: f32,
    /// α.
    pub alpha: f32,
    /// Distribution of the facets.
    pub distribution: MicrofacetDistribution,
}

impl RoughDielectricPoint {
    /// The BSDF for reflected light.
    pub fn reflection_bxdf(self) -> BxdfPoint {
        match self.distribution {
            MicrofacetDistribution::Ggx => BxdfPoint::DielectricReflection(self),
            MicrofacetDistribution::Beckmann => BxdfPoint::BeckmannReflection(self),
        }
    }

    /// The BSDF for transmitted light.
    pub fn transmission_bxdf(self) -> BxdfPoint {
        match self.distribution {
            MicrofacetDistribution::Ggx => BxdfPoint::DielectricTransmission(self),
            MicrofacetDistribution::Beckmann => BxdfPoint::BeckmannTransmission(self),
        }
    }
}

impl BxdfParameters for RoughDielectricPoint {
    #[inline]
    fn is_black(&self) -> bool {
        false
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        Vec3::ZERO
    }

    fn tinted(self, _: Vec3) -> Self {
        self
    }
}

#[cfg(test)]
mod tests;
