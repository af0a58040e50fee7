//! Rough glass: a boundary of two dielectrics made of microfacets that reflect and refract (Walter, Marschner, Li, Torrance,
//! *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007).
//!
//! With the Fresnel reflectance F of a facet, indices of refraction n, view direction o and light direction i:
//!
//! - reflection: f = F·D·G/(4 cosθᵢ cosθₒ), with the facet's normal h along o + i;
//! - transmission: f = |o·h| |i·h| (1 − F)·D·G·nᵢ²/(cosθᵢ cosθₒ |nₒ o + nᵢ i|²), with h along nₒ o + nᵢ i. Light is basic
//!   radiance, L/n², so that nᵢ² replaces the nₒ² of radiance, and f/nᵢ² is the same in both directions.
//!
//! A surface is two vertices; see [`bsdf`](crate::materials::bsdf). Both sample the same facet, and choose its reflection or its
//! refraction with probability F. So f·cosθᵢ divided by the pdf is G/G₁ for both.

mod row;

use crate::materials::bsdf::RoughPoint;
use crate::math::Vec3;
pub use row::GlassRow;

/// Rough glass at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlassPoint {
    /// Index of refraction on the viewer's side.
    pub near: f32,
    /// Index of refraction on the other side; differs from the viewer's.
    pub far: f32,
    /// α.
    pub alpha: f32,
}

impl RoughPoint for GlassPoint {
    #[inline]
    fn is_black(&self) -> bool {
        false
    }

    #[inline]
    fn ambient(&self) -> Vec3 {
        Vec3::ZERO
    }

    fn tinted(self, _: Vec3) -> Self {
        self
    }
}

#[cfg(test)]
mod tests;
