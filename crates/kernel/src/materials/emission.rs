//! Emission of surfaces.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::principled::EmissionCoat;
use super::texture::Texture;
use crate::choice;
use crate::math::Vec3;

choice! {
    /// Sides of a surface that emit.
    pub enum EmissionSides {
        /// The front.
        Front = "front",
        /// The front and the back alike.
        Both = "both",
    }
}

/// Radiance of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Radiance; with a texture, the factor on it.
    pub scale: Vec3,
    /// Texture by which it is multiplied from point to point.
    pub texture: Option<Arc<Texture>>,
    /// Sides that emit.
    pub sides: EmissionSides,
    /// Clear coat that weakens the radiance by its direction. `None` if there is none.
    pub coat: Option<Arc<EmissionCoat>>,
}

impl Emission {
    /// No emission.
    pub const NONE: Self = Self::constant(Vec3::ZERO);

    /// The same emission everywhere on the front.
    pub const fn constant(scale: Vec3) -> Self {
        Self { scale, texture: None, sides: EmissionSides::Front, coat: None }
    }

    /// Whether it may be above 0 somewhere.
    pub fn shines(&self) -> bool {
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

    /// Whether a side may emit.
    #[inline]
    pub fn shines_from(&self, is_front: bool) -> bool {
        self.shines() && (is_front || self.is_two_sided())
    }

    /// The radiance at texture coordinates, by the cosine of its direction; adds to `lookups`.
    #[inline]
    pub fn at(&self, at: &TexturePoint, cosine: f32, lookups: &mut u64) -> Vec3 {
        let left = self.coat.as_ref().map_or(1.0, |coat| coat.left(at, cosine, lookups));
        let Some(texture) = self.texture.as_ref().filter(|_| self.shines()) else { return self.scale * left };
        *lookups += 1;
        self.scale * texture.lookup(at) * left
    }
}
