//! Non-specular materials under a clear coat. See [`Coat`] for the model.

mod bxdf;

use crate::materials::bsdf::{BxdfParameters, SpatiallyVaryingBxdf};
use crate::materials::coat::{Coat, CoatPoint};
use crate::materials::lookup::ParameterLookup;
use crate::math::Vec3;
pub use bxdf::CoatedBxdf;

/// A material under a clear coat.
#[derive(Clone, Debug, PartialEq)]
pub struct CoatedMaterial<M> {
    /// The coat.
    pub coat: Coat,
    /// The material below the coat.
    pub base: M,
}

/// [`CoatedMaterial`] at a point, after texture lookups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoatedPoint<P> {
    /// The coat.
    pub coat: CoatPoint,
    /// The material below the coat.
    pub base: P,
}

impl<M: SpatiallyVaryingBxdf> SpatiallyVaryingBxdf for CoatedMaterial<M> {
    type Point = CoatedPoint<M::Point>;

    #[inline]
    fn look_up_parameters<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Self::Point {
        let base = self.base.look_up_parameters(lookup);
        CoatedPoint { coat: self.coat.look_up_parameters(lookup), base }
    }

    #[inline]
    fn main_color<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        self.base.main_color(lookup)
    }

    fn look_up_ambient_reflectance<'m>(&'m self, lookup: &mut impl ParameterLookup<'m>) -> Vec3 {
        self.base.look_up_ambient_reflectance(lookup)
    }

    #[inline]
    fn is_anisotropic(&self) -> bool {
        self.base.is_anisotropic()
    }

    fn is_transmissive(&self) -> bool {
        self.base.is_transmissive()
    }
}

impl<P: BxdfParameters> BxdfParameters for CoatedPoint<P> {
    #[inline]
    fn is_black(&self) -> bool {
        self.coat.weight == 0.0 && self.base.is_black()
    }

    #[inline]
    fn ambient_reflectance(&self) -> Vec3 {
        self.base.ambient_reflectance()
    }

    fn tinted(self, color: Vec3) -> Self {
        Self { base: self.base.tinted(color), ..self }
    }
}

#[cfg(test)]
mod tests;
