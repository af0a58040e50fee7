//! Opacity of surfaces.

use super::footprint::TexturePoint;
use super::scalar::ScalarParameter;

/// The probability that a surface exists at a point. Where it does not, rays pass through undeflected.
#[derive(Clone, Debug, PartialEq)]
pub struct Opacity {
    /// The opacity, clamped to [0, 1].
    pub value: ScalarParameter,
    /// Opacity threshold, or 0 if there is no threshold. The surface is opaque at and above the threshold,
    /// and fully transparent below it. If there is a threshold, the texture's mip levels contain the fraction
    /// of opaque texels.
    pub cutoff: f32,
}

impl Opacity {
    /// The opacity at the given texture coordinates, in [0, 1]. Counts texture lookups in `lookups`.
    #[inline]
    pub fn evaluate(&self, at: &TexturePoint, lookups: &mut u64) -> f32 {
        match &self.value {
            ScalarParameter::Texture(texture) if self.cutoff > 0.0 && texture.has_coverage_above_cutoff() => {
                *lookups += 1;
                texture.coverage_above_cutoff(at, self.cutoff)
            }
            value => self.apply_cutoff(value.evaluate(at, lookups)),
        }
    }

    /// The opacity, if it is constant.
    pub fn as_untextured(&self) -> Option<f32> {
        self.value.as_untextured().map(|value| self.apply_cutoff(value))
    }

    /// The mean opacity. For a texture with a cutoff, this is estimated as the texture's mean.
    pub fn mean(&self) -> f32 {
        match &self.value {
            ScalarParameter::Constant(value) => self.apply_cutoff(*value),
            ScalarParameter::Texture(texture) => texture.mean().x.clamp(0.0, 1.0),
        }
    }

    #[inline]
    fn apply_cutoff(&self, value: f32) -> f32 {
        if self.cutoff > 0.0 { f32::from(u8::from(value >= self.cutoff)) } else { value.clamp(0.0, 1.0) }
    }
}
