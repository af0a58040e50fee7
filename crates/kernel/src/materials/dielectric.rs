//! Dielectrics that fill closed shapes.

use super::footprint::TexturePoint;
use super::microfacet::{self, MicrofacetDistribution};
use super::scalar::ScalarParameter;
use crate::math::elementary::exp2;
use crate::math::{DVec3, Vec3};

/// A smooth or rough dielectric that fills its shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Dielectric {
    /// Index of refraction inside the shape. It is 1 outside.
    pub ior: f32,
    /// Transmittance per unit length inside the shape, rounded to `f32`.
    pub tint: Vec3,
    /// The square root of α. For smooth glass, it is a constant 0.
    pub roughness: ScalarParameter,
    /// Distribution of the facets of a rough surface.
    pub distribution: MicrofacetDistribution,
    /// Absorption in halvings per unit length. If the tint of colored glass were stored in `f32`, it could
    /// underflow in scenes with large units and round to 1 in scenes with small units.
    density: Vec3,
}

impl Dielectric {
    /// Creates smooth glass from its transmittance per unit length inside the shape, in [0, 1].
    pub fn new(ior: f32, tint: DVec3) -> Self {
        // Give opaque glass a large but finite density because ∞ · 0 would be NaN.
        let halvings =
            |part: f64| if part < 1.0 { (-libm::log2(part)).min(f32::MAX.into()) as f32 } else { 0.0 };
        let density = Vec3::from_array(tint.to_array().map(halvings));
        let (roughness, distribution) = (ScalarParameter::Constant(0.0), MicrofacetDistribution::Ggx);
        Self { ior, tint: tint.as_vec3(), roughness, distribution, density }
    }

    /// The same glass with a different surface.
    pub fn with_roughness(self, roughness: ScalarParameter, distribution: MicrofacetDistribution) -> Self {
        Self { roughness, distribution, ..self }
    }

    /// Whether the surface is smooth.
    #[inline]
    pub fn is_smooth(&self) -> bool {
        self.roughness.as_untextured() == Some(0.0)
    }

    /// The surface's α, or `None` if the surface is smooth.
    #[inline]
    pub fn alpha(&self, at: &TexturePoint, lookups: &mut u64) -> Option<f32> {
        (!self.is_smooth())
            .then(|| microfacet::alphas_from_roughness(self.roughness.evaluate(at, lookups), 0.0)[0])
    }

    /// Transmittance over `distance` inside the shape (Beer–Lambert law).
    #[inline]
    pub fn interior_transmittance(&self, distance: f32) -> Vec3 {
        if self.density == Vec3::ZERO {
            Vec3::ONE
        } else {
            Vec3::from_array((self.density * distance).to_array().map(|halvings| exp2(-halvings)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_is_multiplicative_over_distance() {
        let glass = Dielectric::new(1.5, DVec3::new(0.5, 1.0, 0.0));
        assert_eq!(glass.interior_transmittance(0.0), Vec3::ONE);
        assert!((glass.interior_transmittance(2.0) - Vec3::new(0.25, 1.0, 0.0)).length() < 1e-6);
    }

    #[test]
    fn tint_is_independent_of_the_unit_of_length() {
        let through = DVec3::new(0.3, 0.5, 0.9);
        for thickness in [0.01, 1.0, 1e3, 1e6, 1e9] {
            let part = |through: f64| libm::exp(libm::log(through) / thickness);
            let tint = DVec3::new(part(through.x), part(through.y), part(through.z));
            let found = Dielectric::new(1.5, tint).interior_transmittance(thickness as f32).as_dvec3();
            assert!((found - through).abs().max_element() < 2e-6, "{thickness}: {found}");
        }
    }
}
