//! Directional albedos of Beckmann lobes.

use std::f64::consts::FRAC_2_SQRT_PI;

use super::gauss_legendre;

/// Maximum of the slopes x and y, in units of α. The probability of steeper slopes is 1e-8.
const MAX_SLOPE: f64 = 4.0;

/// Number of quadrature nodes along the view direction and across it.
const NODES: [usize; 2] = [24, 16];

/// Directional albedo E(μ) = ∬ P(x, y) (cosθ − αx sinθ)/cosθ · F/(1 + Λᵢ + Λₒ) dx dy, a mean over the slopes
/// of all visible facets. Slopes are normally distributed: P(x, y) = exp(−x² − y²)/π. A facet reflects light
/// above the surface if α²x² cosθ + 2αx sinθ < (1 − α²y²) cosθ, so the quadrature covers only an interval of
/// x.
pub(super) fn integrate_albedo(cosine: f64, alpha: f64, reflectance: &impl Fn(f64) -> f64) -> f64 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let masked = smith_lambda(cosine, sine, alpha);
    let along: Vec<(f64, f64)> = gauss_legendre(NODES[0]).collect();
    let most = MAX_SLOPE.min(1.0 / (alpha * cosine));
    let mut sum = 0.0;
    for (part, weight) in gauss_legendre(NODES[1]) {
        let y = most * part;
        let tilt = alpha * y * cosine;
        let root = (1.0 - tilt * tilt).max(0.0).sqrt();
        let low = (-(sine + root) / (alpha * cosine)).max(-MAX_SLOPE);
        let high = (cosine * (1.0 - alpha * alpha * y * y) / (alpha * (root + sine))).min(MAX_SLOPE);
        if high <= low {
            continue;
        }
        let of_row = along.iter().map(|(part, weight)| {
            let x = low + (high - low) * part;
            let slope2 = x * x + y * y;
            let visible = cosine - alpha * x * sine;
            let squared = 1.0 + alpha * alpha * slope2;
            let reflected = (2.0 * visible / squared - cosine).clamp(1e-12, 1.0);
            let shadowed = smith_lambda(reflected, (1.0 - reflected * reflected).sqrt(), alpha);
            let fresnel = reflectance((visible / squared.sqrt()).clamp(0.0, 1.0));
            weight * libm::exp(-slope2) * visible * fresnel / (1.0 + masked + shadowed)
        });
        sum += weight * (high - low) * of_row.sum::<f64>();
    }
    // The integrand is symmetric in y.
    2.0 * std::f64::consts::FRAC_1_PI * most * sum / cosine
}

/// Smith's Λ.
fn smith_lambda(cosine: f64, sine: f64, alpha: f64) -> f64 {
    if sine == 0.0 {
        return 0.0;
    }
    let a = cosine / (alpha * sine);
    0.5 * (libm::exp(-a * a) * 0.5 * FRAC_2_SQRT_PI / a - libm::erfc(a))
}
