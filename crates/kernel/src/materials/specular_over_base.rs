//! Surfaces with a δ lobe and non-specular lobes: plastic under a smooth coat, and mirrors and smooth plastic
//! under a clear coat.

use std::sync::Arc;

use super::bxdfs::NonSpecular;
use super::coat::Coat;
use super::footprint::TexturePoint;
use super::fresnel::fresnel_dielectric;
use super::mirror::Mirror;
use super::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;

/// A surface with a δ lobe and non-specular lobes. The non-specular lobes already account for the
/// transmittance of all layers above them.
#[derive(Clone, Debug, PartialEq)]
pub struct SpecularOverBase {
    /// The surface with the δ lobe.
    pub specular: SpecularLayer,
    /// A clear coat over the δ lobe, if there is one.
    pub coat: Option<Coat>,
    /// The non-specular lobes.
    pub base: NonSpecular,
}

/// A surface with a δ lobe.
#[derive(Clone, Debug, PartialEq)]
pub enum SpecularLayer {
    /// A smooth dielectric coat.
    SmoothCoat {
        /// Factor applied to the coat's reflection.
        tint: ColorOrTexture,
        /// Index of refraction of the coat, at least 1.
        ior: f32,
    },
    /// A mirror.
    Mirror(Mirror),
}

impl SpecularOverBase {
    /// The probability of choosing the δ lobe at an incident angle with the given cosine. `mirror` is the
    /// reflectance of [`SpecularLayer::Mirror`]. Counts texture lookups in `lookups`.
    #[inline]
    pub fn specular_probability(
        &self,
        cosine: f32,
        mirror: Vec3,
        at: &TexturePoint,
        lookups: &mut u64,
    ) -> f32 {
        match &self.specular {
            SpecularLayer::SmoothCoat { tint: _, ior } => {
                let left = self.two_way_coat_transmittance(cosine, Vec3::ZERO, at, lookups);
                left.max_element() * fresnel_dielectric(cosine, *ior).0
            }
            SpecularLayer::Mirror(_) => {
                (self.two_way_coat_transmittance(cosine, mirror, at, lookups) * mirror).max_element()
            }
        }
    }

    /// Reflectance of the δ lobe divided by [`SpecularOverBase::specular_probability`], with the same
    /// parameters.
    #[inline]
    pub fn specular_sample_weight(
        &self,
        cosine: f32,
        mirror: Vec3,
        at: &TexturePoint,
        lookups: &mut u64,
    ) -> Vec3 {
        let relative = |color: Vec3| color / color.max_element().max(f32::MIN_POSITIVE);
        match &self.specular {
            SpecularLayer::SmoothCoat { tint, ior: _ } => {
                relative(self.two_way_coat_transmittance(cosine, Vec3::ZERO, at, lookups))
                    * tint.evaluate(at, lookups)
            }
            SpecularLayer::Mirror(_) => {
                relative(self.two_way_coat_transmittance(cosine, mirror, at, lookups) * mirror)
            }
        }
    }

    /// Transmittance of the clear coat in and out at the same angle, including interreflection with a base of
    /// the given reflectance.
    #[inline]
    fn two_way_coat_transmittance(
        &self,
        cosine: f32,
        base: Vec3,
        at: &TexturePoint,
        lookups: &mut u64,
    ) -> Vec3 {
        self.coat.as_ref().map_or(Vec3::ONE, |coat| coat.two_way_transmittance(at, cosine, base, lookups))
    }

    /// The surface's main color. Counts texture lookups in `lookups`.
    #[inline]
    pub fn main_color(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match &self.specular {
            SpecularLayer::SmoothCoat { .. } => self.base.main_color(at, lookups),
            SpecularLayer::Mirror(mirror) => mirror.reflectance(1.0, None, at, lookups),
        }
    }

    /// All textures of the δ lobe. The coat has the same textures as the coat of the base.
    pub fn specular_textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let (tint, mirror) = match &self.specular {
            SpecularLayer::SmoothCoat { tint, ior: _ } => (tint.texture(), None),
            SpecularLayer::Mirror(mirror) => (None, Some(mirror)),
        };
        tint.into_iter().chain(mirror.into_iter().flat_map(Mirror::textures))
    }
}
