//! Smooth glass.

use crate::math::Vec3;
use crate::math::elementary::pow;

/// A smooth dielectric that fills its shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Index of refraction inside; outside is 1.
    pub ior: f32,
    /// Transmittance per unit of length inside.
    pub tint: Vec3,
}

impl Glass {
    /// What is left of light after `distance` inside (Beer's law).
    pub fn transmittance(&self, distance: f32) -> Vec3 {
        if self.tint == Vec3::ONE {
            Vec3::ONE
        } else {
            Vec3::from_array(self.tint.to_array().map(|part| pow(part, distance)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_multiplies_along_the_way() {
        let glass = Glass { ior: 1.5, tint: Vec3::new(0.5, 1.0, 0.0) };
        assert_eq!(glass.transmittance(0.0), Vec3::ONE);
        assert!((glass.transmittance(2.0) - Vec3::new(0.25, 1.0, 0.0)).length() < 1e-6);
    }
}
