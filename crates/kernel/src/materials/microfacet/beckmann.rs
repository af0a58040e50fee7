//! Smith masking and visible normal sampling for the Beckmann distribution.
//!
//! Let a = 1/(α tanθ). Then Λ = (erf(a) − 1)/2 + exp(−a²)/(2a√π) (Heitz, *Understanding the Masking-Shadowing
//! Function in Microfacet-Based BRDFs*, JCGT 3(2), 2014, equation 72). Walter et al. approximate this with a
//! rational function, whose relative error is 0.35 %. We use the exact form, so that sampling with visible
//! normals matches the pdf.
//!
//! Visible normals are sampled as pairs of slopes (Heitz and d'Eon, *Importance Sampling Microfacet-Based
//! BSDFs using the Distribution of Visible Normals*, EGSR 2014). For α = 1 and a view direction (sinθ, 0,
//! cosθ), the slope along y is normally distributed, and the density of the slope x along the view direction
//! is proportional to (cosθ − x sinθ)·exp(−x²) for x < cotθ. With v = (1 + erf(x))/2, the integral of this
//! density is H(v) = v cosθ + exp(−x²) sinθ/(2√π), and H'(v) = cosθ − x sinθ. H is concave, so Newton's
//! method converges.

use std::f32::consts::{FRAC_2_SQRT_PI, LN_2};

use crate::math::Vec3;
use crate::math::elementary::{erf_and_gaussian, gaussian, half_variance_normal_quantile, log2};

/// Number of Newton iterations, which reduce the error of H to less than 1e-6.
const NEWTON_STEPS: u32 = 3;

/// Range of v. The probability of slopes outside of it is below the resolution of a random number.
const V_RANGE: [f32; 2] = [6e-8, 1.0 - 6e-8];

/// cosθ (1 + 2Λ). `sine` is α sinθ.
#[inline(always)]
pub fn cosine_times_one_plus_two_lambda(cosine: f32, sine: f32) -> f32 {
    let (erf, gaussian) = erf_and_gaussian(cosine / sine);
    cosine * erf + sine * (0.5 * FRAC_2_SQRT_PI) * gaussian
}

/// Samples a visible normal of a surface with α = 1 in its local frame. `view` is the unit view direction.
/// The result is not normalized.
#[inline(always)]
pub fn sample_visible_normal(view: Vec3, u: [f32; 2]) -> Vec3 {
    let squared = view.x * view.x + view.y * view.y;
    let is_upright = squared < 1e-14;
    let sine = squared.sqrt();
    let inverse = 1.0 / if is_upright { 1.0 } else { sine };
    let (x, y) = (if is_upright { 1.0 } else { view.x * inverse }, view.y * inverse);
    let along = sample_slope_along_view(view.z, sine, u[0]);
    let across = half_variance_normal_quantile(u[1].max(V_RANGE[0]).min(V_RANGE[1]));
    Vec3::new(across * y - along * x, -along * y - across * x, 1.0)
}

/// Samples the slope along the view direction.
#[inline(always)]
fn sample_slope_along_view(cosine: f32, sine: f32, u: f32) -> f32 {
    let u = u.max(V_RANGE[0]);
    let (erf, at_end) = erf_and_gaussian(cosine / sine);
    let weight = sine * (0.25 * FRAC_2_SQRT_PI);
    // v and H at the steepest visible slope.
    let end = (0.5 + 0.5 * erf).min(V_RANGE[1]);
    let wanted = u * (cosine * end + weight * at_end);
    // Start from a blend of the solutions for normal and grazing incidence.
    let (erf, _) = erf_and_gaussian((-LN_2 * log2(u)).sqrt());
    let upright = cosine / (cosine + 2.0 * weight);
    let mut v = (end * (upright * u + (1.0 - upright) * (1.0 - erf))).max(V_RANGE[0]).min(end);
    let mut slope = half_variance_normal_quantile(v);
    for _ in 0..NEWTON_STEPS {
        let missing = wanted - (cosine * v + weight * gaussian(slope));
        v = (v + missing / (cosine - slope * sine).max(1e-6)).max(V_RANGE[0]).min(end);
        slope = half_variance_normal_quantile(v);
    }
    slope
}
