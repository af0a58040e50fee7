//! Sources of parameter values. A material lists its parameters once, in
//! [`SpatiallyVaryingBxdf::look_up_parameters`], for texture lookups, for renders with white textures, and for
//! finding the textures that it uses.
//!
//! [`SpatiallyVaryingBxdf::look_up_parameters`]: super::bsdf::SpatiallyVaryingBxdf::look_up_parameters

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::scalar::ScalarParameter;
use super::texture::{ColorOrTexture, Texture};
use crate::math::Vec3;

/// A source of parameter values for materials that live for `'m`.
pub trait ParameterLookup<'m> {
    /// The value of a color.
    fn color(&mut self, color: &'m ColorOrTexture) -> Vec3;

    /// The value of a number.
    fn number(&mut self, number: &'m ScalarParameter) -> f32;

    /// The value of a number whose neutral value is 0 instead of 1.
    #[inline(always)]
    fn number_neutral_at_zero(&mut self, number: &'m ScalarParameter) -> f32 {
        self.number(number)
    }

    /// The value of a color that is used only for ambient light.
    #[inline(always)]
    fn ambient_color(&mut self, color: &'m ColorOrTexture) -> Vec3 {
        self.color(color)
    }
}

/// Looks up textures at a point.
pub struct PointTextureEvaluator<'a> {
    /// The point.
    pub point: &'a TexturePoint,
    /// Counts texture lookups.
    pub lookups: &'a mut u64,
}

impl ParameterLookup<'_> for PointTextureEvaluator<'_> {
    #[inline(always)]
    fn color(&mut self, color: &ColorOrTexture) -> Vec3 {
        color.evaluate(self.point, self.lookups)
    }

    #[inline(always)]
    fn number(&mut self, number: &ScalarParameter) -> f32 {
        number.evaluate(self.point, self.lookups)
    }
}

/// Replaces all textures with white, except textures of the anisotropy, which are replaced with 0.
pub struct WhiteTextureLookup;

impl ParameterLookup<'_> for WhiteTextureLookup {
    #[inline(always)]
    fn color(&mut self, color: &ColorOrTexture) -> Vec3 {
        color.as_untextured().unwrap_or(Vec3::ONE)
    }

    #[inline(always)]
    fn number(&mut self, number: &ScalarParameter) -> f32 {
        number.as_untextured().unwrap_or(1.0)
    }

    #[inline(always)]
    fn number_neutral_at_zero(&mut self, number: &ScalarParameter) -> f32 {
        number.as_untextured().unwrap_or(0.0)
    }
}

/// Collects a material's textures. Returns the same values as [`WhiteTextureLookup`].
#[derive(Default)]
pub struct MaterialTextureCollector<'m> {
    /// Textures of parameters that affect how the surface scatters light.
    pub scattering: Vec<&'m Arc<Texture>>,
    /// Textures that are used only for ambient light.
    pub ambient: Vec<&'m Arc<Texture>>,
}

impl<'m> ParameterLookup<'m> for MaterialTextureCollector<'m> {
    fn color(&mut self, color: &'m ColorOrTexture) -> Vec3 {
        self.scattering.extend(color.texture());
        WhiteTextureLookup.color(color)
    }

    fn number(&mut self, number: &'m ScalarParameter) -> f32 {
        self.scattering.extend(number.texture());
        WhiteTextureLookup.number(number)
    }

    fn number_neutral_at_zero(&mut self, number: &'m ScalarParameter) -> f32 {
        self.scattering.extend(number.texture());
        WhiteTextureLookup.number_neutral_at_zero(number)
    }

    fn ambient_color(&mut self, color: &'m ColorOrTexture) -> Vec3 {
        self.ambient.extend(color.texture());
        WhiteTextureLookup.color(color)
    }
}
