//! Converts the diffuse reflectance of Mitsuba's plastic to glimt's.
//!
//! Both have the form (1 − E(μᵢ))·(1 − E(μₒ))·kd/(π η² (1 − kd·F)). For 1 − E and F, Mitsuba uses the
//! transmittance and the internal reflectance of single scattering in the rough coat, so its base loses the
//! energy of multiple scattering. With `nonlinear = false`, the default, kd in the denominator is 1.

use std::f64::consts::TAU;

use crate::formats::foreign::ior::{dielectric_reflectance, mean_fresnel_reflectance};

/// Hemispherical integrals of a coat.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlasticCoat {
    /// Squared mean transmittance of Mitsuba's coat from outside.
    transmittance_squared: f64,
    /// Mean reflectance of Mitsuba's coat from inside.
    internal_reflectance: f64,
    /// (1 − Ē)², where Ē is the mean albedo of glimt's coat.
    glimt_transmittance_squared: f64,
    /// 1 − (1 − Ē)/η², the internal reflectance of glimt's coat.
    glimt_internal_reflectance: f64,
}

impl PlasticCoat {
    /// Computes the integrals. `alpha` is `None` for a smooth coat.
    pub(super) fn new(eta: f64, alpha: Option<f64>, is_beckmann: bool) -> Self {
        let Some(alpha) = alpha else {
            let transmittance = 1.0 - mean_fresnel_reflectance(eta);
            let internal_reflectance = 1.0 - transmittance / (eta * eta);
            let squared = transmittance * transmittance;
            return Self {
                transmittance_squared: squared,
                internal_reflectance,
                glimt_transmittance_squared: squared,
                glimt_internal_reflectance: internal_reflectance,
            };
        };
        let facets = IsotropicMicrofacets { alpha, is_beckmann };
        let transmittance = cosine_weighted_mean(|cosine| facets.transmittance(cosine, eta));
        let internal_reflectance = mitsuba_hemisphere_mean(|cosine| {
            facets.reflectance(cosine, 1.0 / eta, MaskingShadowingForm::Separable)
        });
        let albedo = cosine_weighted_mean(|cosine| {
            facets.reflectance(cosine, eta, MaskingShadowingForm::HeightCorrelated)
        });
        Self {
            transmittance_squared: transmittance * transmittance,
            internal_reflectance,
            glimt_transmittance_squared: (1.0 - albedo) * (1.0 - albedo),
            glimt_internal_reflectance: 1.0 - (1.0 - albedo) / (eta * eta),
        }
    }

    /// Returns the factor of a diffuse texture. With `nonlinear = false` in both renderers, it makes glimt's
    /// plastic equal Mitsuba's. Otherwise, they are equal at a reflectance of 0.5.
    pub(super) fn texture_factor(&self, is_nonlinear: bool) -> f64 {
        if is_nonlinear {
            return remapped_reflectance(0.5, self, true) / 0.5;
        }
        self.transmittance_squared * (1.0 - self.glimt_internal_reflectance)
            / ((1.0 - self.internal_reflectance) * self.glimt_transmittance_squared)
    }
}

/// Returns the diffuse reflectance for which glimt's base reflects as much light as Mitsuba's with `kd`.
pub(super) fn remapped_reflectance(kd: f64, coat: &PlasticCoat, is_nonlinear: bool) -> f64 {
    let saturation = if is_nonlinear { kd } else { 1.0 };
    let reflected = kd * coat.transmittance_squared / (1.0 - saturation * coat.internal_reflectance);
    let remapped =
        reflected / (coat.glimt_transmittance_squared + reflected * coat.glimt_internal_reflectance);
    if remapped.is_finite() { remapped.clamp(0.0, 1.0) } else { kd.clamp(0.0, 1.0) }
}

/// Averages a function of the cosine over a cosine-weighted hemisphere: 2 ∫ f(μ) μ dμ.
fn cosine_weighted_mean(value: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 40;
    let at = |step: u32| value(((f64::from(step) + 0.5) / f64::from(STEPS)).sqrt());
    (0..STEPS).map(at).sum::<f64>() / f64::from(STEPS)
}

/// Like [`cosine_weighted_mean`], but with Mitsuba's quadrature: 64 cosines from 0 to 1 with equal weights.
/// The result is up to 1.6 % lower.
fn mitsuba_hemisphere_mean(value: impl Fn(f64) -> f64) -> f64 {
    const COUNT: u32 = 64;
    let at = |index: u32| (f64::from(index) / f64::from(COUNT - 1)).max(1e-6);
    2.0 * (0..COUNT).map(|index| value(at(index)) * at(index)).sum::<f64>() / f64::from(COUNT)
}

/// How the masking of two directions is combined.
#[derive(Clone, Copy, PartialEq, Eq)]
enum MaskingShadowingForm {
    /// The product of both directions' terms, as in Mitsuba.
    Separable,
    /// 1/(1 + Λᵢ + Λₒ), as in glimt.
    HeightCorrelated,
}

/// An isotropic microfacet distribution.
#[derive(Clone, Copy)]
struct IsotropicMicrofacets {
    alpha: f64,
    is_beckmann: bool,
}

impl IsotropicMicrofacets {
    /// Single-scattering reflectance for a direction at `cosine` to the normal.
    fn reflectance(self, cosine: f64, eta: f64, masking: MaskingShadowingForm) -> f64 {
        self.mean_over_facets(cosine, |along, [_, _, z], [_, _, mz]| {
            let out_z = 2.0 * along * mz - z;
            if out_z <= 0.0 {
                return 0.0;
            }
            dielectric_reflectance(along, eta) * self.masking(z, out_z, masking)
        })
    }

    /// Single-scattering transmittance for a direction at `cosine` to the normal, with separable masking.
    fn transmittance(self, cosine: f64, eta: f64) -> f64 {
        self.mean_over_facets(cosine, |along, [_, _, z], [_, _, mz]| {
            let reflectance = dielectric_reflectance(along, eta);
            let sine_squared = (1.0 - along * along) / (eta * eta);
            if sine_squared >= 1.0 {
                return 0.0;
            }
            // The refracted direction is m·(along/η − cos θt) − ω/η.
            let out_z = mz * (along / eta - (1.0 - sine_squared).sqrt()) - z / eta;
            if out_z >= 0.0 {
                return 0.0;
            }
            (1.0 - reflectance) * self.masking(z, -out_z, MaskingShadowingForm::Separable)
        })
    }

    /// Averages a function over the facets that face a direction, weighted by projected area but without
    /// masking. The function takes the cosine between the direction and the facet normal, and both vectors.
    fn mean_over_facets(self, cosine: f64, value: impl Fn(f64, [f64; 3], [f64; 3]) -> f64) -> f64 {
        const HEIGHTS: u32 = 64;
        const ANGLES: u32 = 24;
        let direction = [(1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine];
        let mut sum = 0.0;
        for height in 0..HEIGHTS {
            let u = (f64::from(height) + 0.5) / f64::from(HEIGHTS);
            let tangent_squared =
                self.alpha * self.alpha * if self.is_beckmann { -libm::log(1.0 - u) } else { u / (1.0 - u) };
            let mz = 1.0 / (1.0 + tangent_squared).sqrt();
            let sine = (1.0 - mz * mz).max(0.0).sqrt();
            for angle in 0..ANGLES {
                // The other half circle is symmetric.
                let phi = TAU / 2.0 * (f64::from(angle) + 0.5) / f64::from(ANGLES);
                let normal = [sine * libm::cos(phi), sine * libm::sin(phi), mz];
                let along = direction[0] * normal[0] + direction[2] * normal[2];
                if along > 0.0 {
                    sum += value(along, direction, normal) * along / (cosine * mz);
                }
            }
        }
        sum / f64::from(HEIGHTS * ANGLES)
    }

    fn masking(self, cosine_in: f64, cosine_out: f64, masking: MaskingShadowingForm) -> f64 {
        let (a, b) = (self.single_masking(cosine_in), self.single_masking(cosine_out));
        match masking {
            MaskingShadowingForm::Separable => a * b,
            MaskingShadowingForm::HeightCorrelated => 1.0 / (1.0 / a + 1.0 / b - 1.0),
        }
    }

    /// Smith's masking term of one direction.
    fn single_masking(self, cosine: f64) -> f64 {
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine;
        if self.is_beckmann {
            // Walter et al., Microfacet Models for Refraction, EGSR 2007, section 5.2.
            let a = 1.0 / (self.alpha * tangent);
            if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
        } else {
            2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tangent * tangent).sqrt())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_coats_are_remapped_exactly() {
        let coat = PlasticCoat::new(1.49, None, false);
        let inside = coat.internal_reflectance;
        for kd in [0.0, 0.2, 0.5, 1.0] {
            assert!((remapped_reflectance(kd, &coat, true) - kd).abs() < 1e-9);
            let linear = kd / (1.0 - inside + kd * inside);
            assert!((remapped_reflectance(kd, &coat, false) - linear).abs() < 1e-9);
        }
        assert!((coat.texture_factor(false) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn nearly_smooth_coats_match_smooth_coats() {
        let smooth = PlasticCoat::new(1.5, None, false);
        for is_beckmann in [false, true] {
            let rough = PlasticCoat::new(1.5, Some(0.01), is_beckmann);
            assert!((rough.transmittance_squared - smooth.transmittance_squared).abs() < 4e-3, "{rough:?}");
            assert!(
                (rough.internal_reflectance / smooth.internal_reflectance - 63.0 / 64.0).abs() < 1e-2,
                "{rough:?}"
            );
        }
    }

    #[test]
    fn rough_coats_are_darker_in_mitsuba() {
        // Using kd unchanged would make the image about 10 % brighter at α = 0.4.
        let coat = PlasticCoat::new(1.5, Some(0.4), true);
        let remapped = remapped_reflectance(0.5, &coat, true);
        assert!((0.42..0.49).contains(&remapped), "{remapped}");
    }
}
