//! Emission of surfaces.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;

/// Radiance of a front side.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Radiance; with a texture, the factor on it.
    pub scale: Vec3,
    /// Texture by which it is multiplied from point to point.
    pub texture: Option<Arc<Texture>>,
}

impl Emission {
    /// No emission.
    pub const NONE: Self = Self::constant(Vec3::ZERO);

    /// The same emission everywhere.
    pub const fn constant(scale: Vec3) -> Self {
        Self { scale, texture: None }
    }

    /// Whether it may be above 0 somewhere.
    pub fn shines(&self) -> bool {
        self.scale != Vec3::ZERO
    }

    /// The radiance at texture coordinates; adds to `lookups`.
    #[inline]
    pub fn at(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        let Some(texture) = self.texture.as_ref().filter(|_| self.shines()) else { return self.scale };
        *lookups += 1;
        self.scale * texture.lookup(at)
    }
}
