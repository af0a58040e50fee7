//! A smooth coat over a non-specular base. The coat has a δ lobe, and the base's lobes scatter the
//! transmitted light.

use std::sync::Arc;

use super::bxdfs::NonSpecular;
use super::footprint::TexturePoint;
use super::fresnel::dielectric;
use super::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;

/// A smooth dielectric coat over a base. The base's lobes already account for the coat's transmittance.
#[derive(Clone, Debug, PartialEq)]
pub struct Coated {
    /// Factor applied to the coat's reflection.
    pub specular: ColorOrTexture,
    /// Index of refraction of the coat, at least 1.
    pub ior: f32,
    /// The surface under the coat.
    pub base: NonSpecular,
}

impl Coated {
    /// Computes the coat's Fresnel reflectance from the cosine of the angle of incidence. Does not include
    /// the factor `specular`.
    #[inline]
    pub fn fresnel(&self, cosine: f32) -> f32 {
        dielectric(cosine, self.ior).0
    }

    /// The factor applied to the coat's reflection. Counts texture lookups in `lookups`.
    #[inline]
    pub fn specular_tint(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        self.specular.evaluate(at, lookups)
    }

    /// All textures of the coat.
    pub fn coat_textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        self.specular.texture().into_iter()
    }
}
