//! Thin panes: two parallel glass surfaces that are infinitely close together.

use super::fresnel::fresnel_dielectric;
use super::texture::ColorOrTexture;

/// An infinitely thin pane. Light passes undeflected unless it is reflected.
#[derive(Clone, Debug, PartialEq)]
pub struct ThinDielectric {
    /// Index of refraction of the glass relative to the outside.
    pub ior: f32,
    /// Transmittance of the glass at all angles.
    pub tint: ColorOrTexture,
}

impl ThinDielectric {
    /// Reflectance at an incident angle with the given cosine. It is 2R/(1 + R), where R is the reflectance
    /// of a single side. This accounts for all reflections between the two sides.
    #[inline]
    pub fn reflectance(&self, cosine: f32) -> f32 {
        let (side, _) = fresnel_dielectric(cosine.abs(), self.ior);
        2.0 * side / (1.0 + side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn pane_reflectance_sums_all_internal_bounces() {
        let pane = ThinDielectric { ior: 1.5, tint: ColorOrTexture::Constant(Vec3::ONE) };
        for degrees in [0.0_f32, 30.0, 60.0, 80.0, 89.0] {
            let cosine = degrees.to_radians().cos();
            let r = f64::from(fresnel_dielectric(cosine, 1.5).0);
            // Sum the series R + T²R + T²R³ + …
            let series: f64 = r + (0..2000).map(|k| (1.0 - r).powi(2) * r.powi(2 * k + 1)).sum::<f64>();
            assert!((f64::from(pane.reflectance(cosine)) - series).abs() < 1e-6, "{degrees}");
        }
        // At normal incidence, R = 0.04 and R' = 0.08/1.04.
        assert!((pane.reflectance(-1.0) - 0.08 / 1.04).abs() < 1e-6);
        assert!((pane.reflectance(0.0) - 1.0).abs() < 1e-6);
    }
}
