//! What surfaces send out.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;

/// Radiance of a front side.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Radiance; where there is a texture, the factor on it.
    pub scale: Vec3,
    /// What it is multiplied by from point to point.
    pub texture: Option<Arc<Texture>>,
}

impl Emission {
    /// Nothing.
    pub const NONE: Self = Self::constant(Vec3::ZERO);

    /// The same everywhere.
    pub const fn constant(scale: Vec3) -> Self {
        Self { scale, texture: None }
    }

    /// Whether it may be more than nothing somewhere.
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
