//! Smooth glass.

use crate::math::elementary::exp2;
use crate::math::{DVec3, Vec3};

/// A smooth dielectric that fills its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Index of refraction inside; outside is 1.
    pub ior: f32,
    /// Transmittance per unit of length inside, as precise as `f32` allows.
    pub tint: Vec3,
    /// Halvings of light per unit of length. In scenes that are small for their unit, the tint of a coloured pane is too small for
    /// `f32`, and in large ones too near to 1.
    density: Vec3,
}

impl Glass {
    /// Glass with a transmittance in [0, 1] per unit of length inside.
    pub fn new(ior: f32, tint: DVec3) -> Self {
        // Opaque glass gets a large density, as ∞ over no distance would be NaN.
        let halvings =
            |part: f64| if part < 1.0 { (-libm::log2(part)).min(f32::MAX.into()) as f32 } else { 0.0 };
        Self { ior, tint: tint.as_vec3(), density: Vec3::from_array(tint.to_array().map(halvings)) }
    }

    /// Transmittance over `distance` inside (Beer's law).
    #[inline]
    pub fn transmittance(&self, distance: f32) -> Vec3 {
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
    fn absorption_multiplies_along_the_way() {
        let glass = Glass::new(1.5, DVec3::new(0.5, 1.0, 0.0));
        assert_eq!(glass.transmittance(0.0), Vec3::ONE);
        assert!((glass.transmittance(2.0) - Vec3::new(0.25, 1.0, 0.0)).length() < 1e-6);
    }

    #[test]
    fn a_pane_is_as_clear_whatever_the_unit_of_length() {
        let through = DVec3::new(0.3, 0.5, 0.9);
        for thickness in [0.01, 1.0, 1e3, 1e6, 1e9] {
            let part = |through: f64| libm::exp(libm::log(through) / thickness);
            let tint = DVec3::new(part(through.x), part(through.y), part(through.z));
            let found = Glass::new(1.5, tint).transmittance(thickness as f32).as_dvec3();
            assert!((found - through).abs().max_element() < 2e-6, "{thickness}: {found}");
        }
    }
}
