//! A smooth coat over a rough base: a δ lobe, and the lobes of the base for the rest of the light.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::fresnel::dielectric;
use super::rough::Rough;
use super::texture::{Color, Texture};
use crate::math::Vec3;

/// A smooth dielectric coat over a rough base, which knows what the coat lets through.
#[derive(Clone, Debug, PartialEq)]
pub struct Coated {
    /// Factor on what the coat reflects.
    pub specular: Color,
    /// Index of refraction of the coat, ≥ 1.
    pub ior: f32,
    /// Surface under it.
    pub base: Rough,
}

impl Coated {
    /// The part of the light that the coat reflects, by the cosine of the angle of incidence, but for `specular`.
    #[inline]
    pub fn fresnel(&self, cosine: f32) -> f32 {
        dielectric(cosine, self.ior).0
    }

    /// The factor on what the coat reflects.
    #[inline]
    pub fn specular(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        self.specular.at(at, lookups)
    }

    /// Its textures.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        self.specular.texture().into_iter()
    }
}
