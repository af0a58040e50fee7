//! Reference microfacet lobes: the formulas from the papers, in `f64`.

use crate::math::DVec3;

use std::f64::consts::PI;

/// D·G/(4 cosθᵢ cosθₒ) of GGX around the z axis.
pub fn reference_microfacet_brdf(one: DVec3, other: DVec3, [u, v]: [f64; 2]) -> f64 {
    let half = (one + other).normalize();
    let stretched = (half.x / u).powi(2) + (half.y / v).powi(2) + half.z * half.z;
    let distribution = 1.0 / (PI * u * v * stretched * stretched);
    let lambda = |d: DVec3| {
        let tangent2 = ((d.x * u).powi(2) + (d.y * v).powi(2)) / (d.z * d.z);
        0.5 * ((1.0 + tangent2).sqrt() - 1.0)
    };
    distribution / (1.0 + lambda(one) + lambda(other)) / (4.0 * one.z * other.z)
}

/// [`reference_microfacet_brdf`] with the Beckmann distribution (Walter et al. 2007, equation 25) and its
/// exact Λ (Heitz 2014, equation 72).
pub fn reference_beckmann_brdf(one: DVec3, other: DVec3, alphas: [f64; 2]) -> f64 {
    let half = (one + other).normalize();
    let [lambda_one, lambda_other] = [one, other].map(|d| beckmann_lambda(d, alphas));
    beckmann_d(half, alphas) / (1.0 + lambda_one + lambda_other) / (4.0 * one.z * other.z)
}

/// D of the Beckmann distribution.
pub fn beckmann_d(half: DVec3, alphas: [f64; 2]) -> f64 {
    let [u, v] = alphas;
    libm::exp(-squared_slope(half, alphas)) / (PI * u * v * half.z.powi(4))
}

/// Smith's Λ for the Beckmann distribution.
pub fn beckmann_lambda(direction: DVec3, [u, v]: [f64; 2]) -> f64 {
    let a = direction.z.abs() / (direction.x * u).hypot(direction.y * v).max(1e-100);
    if a > 26.0 { 0.0 } else { 0.5 * (libm::exp(-a * a) / (a * PI.sqrt()) - libm::erfc(a)) }
}

/// Squared slope of a facet, in units of α.
pub fn squared_slope(half: DVec3, [u, v]: [f64; 2]) -> f64 {
    ((half.x / u).powi(2) + (half.y / v).powi(2)) / (half.z * half.z)
}
