//! Thin panes: glass of two parallel sides without a thickness.

use super::fresnel::dielectric;
use super::texture::Color;

/// A pane without thickness. What it does not reflect goes straight on.
#[derive(Clone, Debug, PartialEq)]
pub struct Pane {
    /// Index of refraction of the glass; outside is 1.
    pub ior: f32,
    /// Transmittance of the glass, at any angle.
    pub tint: Color,
}

impl Pane {
    /// Reflectance at the cosine of an angle of incidence: 2R/(1 + R), R that of each side, by all reflections between the sides.
    #[inline]
    pub fn reflectance(&self, cosine: f32) -> f32 {
        let (side, _) = dielectric(cosine.abs(), self.ior);
        2.0 * side / (1.0 + side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn a_pane_adds_up_all_reflections_between_its_sides() {
        let pane = Pane { ior: 1.5, tint: Color::Constant(Vec3::ONE) };
        for degrees in [0.0_f32, 30.0, 60.0, 80.0, 89.0] {
            let cosine = degrees.to_radians().cos();
            let r = f64::from(dielectric(cosine, 1.5).0);
            // R + T²R + T²R³ + …
            let series: f64 = r + (0..2000).map(|k| (1.0 - r).powi(2) * r.powi(2 * k + 1)).sum::<f64>();
            assert!((f64::from(pane.reflectance(cosine)) - series).abs() < 1e-6, "{degrees}");
        }
        // At normal incidence R = .04 and R' = .08/1.04.
        assert!((pane.reflectance(-1.0) - 0.08 / 1.04).abs() < 1e-6);
        assert!((pane.reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
