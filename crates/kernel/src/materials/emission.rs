//! Emission of surfaces.

use std::sync::Arc;

use super::coat::Coat;
use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::choice;
use crate::math::Vec3;

choice! {
    /// Which sides of a surface emit.
    pub enum EmissionSides {
        /// Only the front.
        Front = "front",
        /// Both the front and the back.
        Both = "both",
    }
}

/// Emitted radiance of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Radiance, or a factor applied to the texture if there is one.
    pub scale: Vec3,
    /// Texture that modulates the radiance.
    pub texture: Option<Arc<Texture>>,
    /// Which sides emit.
    pub sides: EmissionSides,
    /// Clear coat that attenuates the radiance by a direction-dependent factor, if there is one.
    pub coat: Option<Arc<Coat>>,
}

impl Emission {
    /// No emission.
    pub const NONE: Self = Self::from_constant(Vec3::ZERO);

    /// Constant emission from the front.
    pub const fn from_constant(scale: Vec3) -> Self {
        Self { scale, texture: None, sides: EmissionSides::Front, coat: None }
    }

    /// Whether the surface may emit light.
    pub fn is_emissive(&self) -> bool {
        self.scale != Vec3::ZERO
    }

    /// Whether both sides emit.
    #[inline]
    pub fn is_two_sided(&self) -> bool {
        match self.sides {
            EmissionSides::Front => false,
            EmissionSides::Both => true,
        }
    }

    /// Whether a side may emit light.
    #[inline]
    pub fn emits_on_side(&self, is_front: bool) -> bool {
        self.is_emissive() && (is_front || self.is_two_sided())
    }

    /// The radiance at the given texture coordinates, in a direction at the given cosine to the normal.
    /// Counts texture lookups in `lookups`.
    #[inline]
    pub fn radiance_at_cosine(&self, at: &TexturePoint, cosine: f32, lookups: &mut u64) -> Vec3 {
        let left = self.coat.as_ref().map_or(Vec3::ONE, |coat| coat.transmittance(at, cosine, lookups));
        let Some(texture) = self.texture.as_ref().filter(|_| self.is_emissive()) else {
            return self.scale * left;
        };
        *lookups += 1;
        self.scale * texture.lookup(at) * left
    }
}
