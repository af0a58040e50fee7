//! Opacity of surfaces: the chance that a surface is there.

use super::footprint::TexturePoint;
use super::number::Number;

/// The chance that a surface is there. Rays pass the rest of it straight on, as if it were not there.
#[derive(Clone, Debug, PartialEq)]
pub struct Opacity {
    /// The chance, clamped to [0, 1].
    pub value: Number,
    /// Chance from which the surface is there, below which it is not; 0 for none. Mip levels of a texture are those of its coverage.
    pub cutoff: f32,
}

impl Opacity {
    /// The chance at texture coordinates, in [0, 1]; adds to `lookups`.
    #[inline]
    pub fn at(&self, at: &TexturePoint, lookups: &mut u64) -> f32 {
        match &self.value {
            Number::Texture(texture) if self.cutoff > 0.0 && texture.mipmaps.is_some() => {
                *lookups += 1;
                texture.coverage(at, self.cutoff)
            }
            value => self.cut(value.at(at, lookups)),
        }
    }

    /// The chance, if it is the same everywhere.
    pub fn constant(&self) -> Option<f32> {
        self.value.constant().map(|value| self.cut(value))
    }

    /// The mean chance; that of a texture with a cutoff is estimated by its mean.
    pub fn mean(&self) -> f32 {
        match &self.value {
            Number::Constant(value) => self.cut(*value),
            Number::Texture(texture) => texture.mean().x.clamp(0.0, 1.0),
        }
    }

    #[inline]
    fn cut(&self, value: f32) -> f32 {
        if self.cutoff > 0.0 { f32::from(u8::from(value >= self.cutoff)) } else { value.clamp(0.0, 1.0) }
    }
}
