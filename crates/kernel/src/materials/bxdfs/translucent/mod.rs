//! Phong surfaces that also transmit light diffusely, such as leaves and paper: f = kt/π for light from the
//! other side. Each interaction has two vertices, one per side; see [`bsdf`](crate::materials::bsdf). The
//! side on which a path continues is chosen in proportion to the albedos.

mod bxdf;

use std::f32::consts::FRAC_1_PI;

use super::phong::{Phong, PhongPoint};
use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::lookup::ParameterLookup;
use crate::materials::texture::ColorOrTexture;
use crate::math::Vec3;
pub use bxdf::TranslucentBxdf;

/// A Phong material with diffuse transmission.
#[derive(Clone, Debug, PartialEq)]
pub struct TranslucentPhong {
    /// The reflecting lobes.
    pub reflection: Phong,
    /// Diffuse transmittance kt.
    pub transmission: ColorOrTexture,
}

/// [`TranslucentPhong`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TranslucentPoint {
    /// The reflecting lobes.
    pub reflection: PhongPoint,
    /// Diffuse transmittance kt.
    pub transmission: Vec3,
}

impl TranslucentPoint {
    /// Whether the surface transmits light.
    #[inline]
    pub fn transmits(&self) -> bool {
        self.transmission != Vec3::ZERO
    }

    /// f in sr⁻¹ of transmitted light.
    fn transmission_f(&self) -> Vec3 {
        self.transmission * FRAC_1_PI
    }

    /// Probability that a path continues on the other side.
    fn transmission_probability(&self) -> f32 {
        let PhongPoint { diffuse, specular, .. } = self.reflection;
        let through = self.transmission.max_element();
        let all = diffuse.max_element() + specular.max_element() + through;
        through / all.max(f32::MIN_POSITIVE)
    }
}

impl SpatiallyVaryingBxdf for TranslucentPhong {
    type Point = TranslucentPoint;

    #[inline]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> TranslucentPoint {
        let reflection = self.reflection.look_up_parameters(lookup);
        TranslucentPoint { reflection, transmission: lookup.color(&self.transmission) }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        self.reflection.main_color(lookup)
    }

    fn look_up_ambient_reflectance<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        self.reflection.look_up_ambient_reflectance(lookup)
    }

    fn is_transmissive(&self) -> bool {
        true
    }
}

impl BxdfParameters for TranslucentPoint {
    #[inline]
    fn is_black(&self) -> bool {
        self.reflection.is_black() && !self.transmits()
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        self.reflection.ambient_reflectance()
    }

    fn tinted(self, color: Vec3) -> Self {
        Self { reflection: self.reflection.tinted(color), ..self }
    }

    #[inline(always)]
    fn interreflection_reflectances(&self) -> [Vec3; 2] {
        self.reflection.interreflection_reflectances()
    }
}

#[cfg(test)]
mod tests;
