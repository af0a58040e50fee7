//! Fresnel reflection and refraction at smooth boundaries.

use crate::math::Vec3;

/// Reflectance of a dielectric boundary for unpolarized light, and cosine of the transmitted direction. The
/// cosine is `None` for total internal reflection. `cos_incident` ≥ 0 is the cosine on the ray's side, and
/// `eta` is n(far side)/n(ray's side). Uses the exact equations for both polarizations (Born and Wolf,
/// *Principles of Optics*, section 1.5.2).
#[inline]
pub fn fresnel_dielectric(cos_incident: f32, eta: f32) -> (f32, Option<f32>) {
    let (cos_i, eta) = (f64::from(cos_incident.clamp(0.0, 1.0)), f64::from(eta));
    // Compute 1 − sin²θₜ without cancellation at grazing angles.
    let cos2_t = ((eta - 1.0) * (eta + 1.0) + cos_i * cos_i) / (eta * eta);
    if !(cos2_t > 0.0) {
        return (1.0, None);
    }
    let cos_t = cos2_t.sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    ((0.5 * (parallel * parallel + perpendicular * perpendicular)) as f32, Some(cos_t as f32))
}

/// [`fresnel_dielectric`] for light from outside (`eta` ≥ 1), in `f32` for packets.
#[inline(always)]
pub fn fresnel_dielectric_from_outside(cos_incident: f32, eta: f32) -> f32 {
    fresnel_from_eta_cos_squared(cos_incident, eta, (eta - 1.0) * (eta + 1.0) + cos_incident * cos_incident)
}

/// [`fresnel_dielectric`] for light from either side, in `f32` for packets. Returns 1 for total internal
/// reflection.
#[inline(always)]
pub fn fresnel_dielectric_any_eta(cos_incident: f32, eta: f32) -> f32 {
    let squared = (eta - 1.0) * (eta + 1.0) + cos_incident * cos_incident;
    fresnel_from_eta_cos_squared(cos_incident, eta, if squared > 0.0 { squared } else { 0.0 })
}

/// Computes the reflectance of a dielectric boundary from η² times the squared cosine of the transmitted
/// direction.
#[inline(always)]
fn fresnel_from_eta_cos_squared(cos_incident: f32, eta: f32, cos2_t: f32) -> f32 {
    let cos_t = cos2_t.sqrt();
    let squared = eta * eta;
    // Both cosines are multiplied by η. The `max` avoids 0/0 at grazing angles for η = 1.
    let parallel = (squared * cos_incident - cos_t) / (squared * cos_incident + cos_t).max(f32::MIN_POSITIVE);
    let perpendicular = (cos_incident - cos_t) / (cos_incident + cos_t).max(f32::MIN_POSITIVE);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Computes the transmittance of a boundary for unpolarized light from the cosines and the indices of
/// refraction on both sides. Avoids cancellation. The result is bit-identical in both directions.
#[inline(always)]
pub fn fresnel_transmittance([cos_1, cos_2]: [f32; 2], [n_1, n_2]: [f32; 2]) -> f32 {
    let (parallel, perpendicular) = (n_2 * cos_1 + n_1 * cos_2, n_1 * cos_1 + n_2 * cos_2);
    let inverse = 1.0 / (parallel * parallel) + 1.0 / (perpendicular * perpendicular);
    2.0 * ((n_1 * n_2) * (cos_1 * cos_2)) * inverse
}

/// Reflectance of a conductor with index η and extinction k, for unpolarized light (Born and Wolf,
/// *Principles of Optics*, section 14.2).
#[inline(always)]
pub fn fresnel_conductor(cos_incident: f32, eta: f32, k: f32) -> f32 {
    let cos2 = cos_incident * cos_incident;
    let sin2 = (1.0 - cos2).max(0.0);
    // a + ib is the square root of (η + ik)² − sin²θ. Compute the larger of a² and b² first, because the
    // smaller one would suffer from cancellation.
    let real = (eta - k) * (eta + k) - sin2;
    let product = eta * k;
    let sum = (real * real + 4.0 * product * product).sqrt();
    let larger = 0.5 * (sum + real.abs());
    let smaller = product * product / larger.max(f32::MIN_POSITIVE);
    let a = if real > 0.0 { larger } else { smaller }.sqrt();
    let (even, odd) = (sum + cos2, 2.0 * a * cos_incident);
    // For an index of 1, the reflectance is 0. Prevent rounding from making it negative.
    let rest = if even > odd { even - odd } else { 0.0 };
    let perpendicular = rest / (even + odd).max(f32::MIN_POSITIVE);
    let (even, odd) = (cos2 * sum + sin2 * sin2, odd * sin2);
    // An index of 0 reflects all light, even at normal incidence.
    let ratio = if even > 0.0 { (even - odd) / (even + odd) } else { 1.0 };
    let parallel = perpendicular * ratio;
    0.5 * (perpendicular + parallel)
}

/// Schlick's weight (1 − cosθ)⁵ for interpolating from the reflectance at normal incidence to the reflectance
/// at grazing incidence (Schlick, *An Inexpensive BRDF Model for Physically-based Rendering*, 1994).
#[inline(always)]
pub fn schlick_weight(cos_incident: f32) -> f32 {
    let rest = (1.0 - cos_incident).max(0.0);
    let squared = rest * rest;
    squared * squared * rest
}

/// Direction in which Snell's law refracts the unit vector `incident`, given the unit normal on its side and
/// the cosine from [`fresnel_dielectric`].
pub fn refract_given_transmitted_cosine(
    incident: Vec3,
    normal: Vec3,
    eta: f32,
    cos_transmitted: f32,
) -> Vec3 {
    let cos_incident = -incident.dot(normal);
    (incident / eta + normal * (cos_incident / eta - cos_transmitted)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_matches_the_exact_equations() {
        for eta in [1.0_f32, 1.01, 1.5, 2.5, 10.0] {
            for step in 0..=1000_u16 {
                let cosine = f32::from(step) / 1000.0;
                let (exact, found) =
                    (fresnel_dielectric(cosine, eta).0, fresnel_dielectric_from_outside(cosine, eta));
                assert!(
                    (exact - found).abs() < 2e-6 || eta == 1.0 && cosine == 0.0,
                    "{eta} {cosine}: {found}"
                );
            }
        }
    }

    #[test]
    fn reflectance_and_transmittance_sum_to_one() {
        for eta in [0.4_f32, 0.75, 1.01, 1.5, 2.5] {
            for step in 1..=1000_u16 {
                let cosine = f32::from(step) / 1000.0;
                let (exact, through) = fresnel_dielectric(cosine, eta);
                assert!((exact - fresnel_dielectric_any_eta(cosine, eta)).abs() < 2e-5, "{eta} {cosine}");
                let Some(beyond) = through else { continue };
                let there = fresnel_transmittance([cosine, beyond], [1.0, eta]);
                assert!((1.0 - exact - there).abs() < 2e-5, "{eta} {cosine}: {there}");
                assert_eq!(there, fresnel_transmittance([beyond, cosine], [eta, 1.0]));
            }
        }
    }

    /// The reflectance of a conductor, computed with complex numbers.
    fn conductor_of_complex_numbers(cos: f64, eta: f64, k: f64) -> f64 {
        type Complex = [f64; 2];
        let times = |[a, b]: Complex, [c, d]: Complex| [a * c - b * d, a * d + b * c];
        let over = |z: Complex, [c, d]: Complex| times(z, [c / (c * c + d * d), -d / (c * c + d * d)]);
        let index = [eta, k];
        let [re, im] = times(index, index);
        // η times the cosine of the transmitted direction is √(n² − sin²θ).
        let (re, im) = (re - (1.0 - cos * cos), im);
        let size = (re * re + im * im).sqrt();
        let root = [((size + re) * 0.5).sqrt(), ((size - re) * 0.5).sqrt()];
        let square = |[a, b]: Complex| a * a + b * b;
        let perpendicular = over([cos - root[0], -root[1]], [cos + root[0], root[1]]);
        let [n2, m2] = times(index, index).map(|part| part * cos);
        let parallel = over([n2 - root[0], m2 - root[1]], [n2 + root[0], m2 + root[1]]);
        0.5 * (square(perpendicular) + square(parallel))
    }

    #[test]
    fn conductors_match_complex_arithmetic() {
        for (eta, k) in [(0.05_f32, 4.3_f32), (0.2, 3.9), (1.5, 7.6), (2.9, 3.1), (1.5, 0.0), (0.5, 0.1)] {
            for step in 1..=100_u16 {
                let cosine = f32::from(step) / 100.0;
                let exact = conductor_of_complex_numbers(cosine.into(), eta.into(), k.into());
                let found = f64::from(fresnel_conductor(cosine, eta, k));
                assert!((exact - found).abs() < 2e-5, "{eta} + {k}i at {cosine}: {found} instead of {exact}");
            }
        }
        // With equal indices, nothing is reflected. Rounding must not make the reflectance negative.
        for eta in [1.0_f32, 1.0 - f32::EPSILON, 1.0 + f32::EPSILON, 1.001] {
            for step in 0..=1000_u16 {
                let found = fresnel_conductor(f32::from(step) / 1000.0, eta, 0.0);
                assert!((0.0..=1.0).contains(&found), "{eta} at {step}: {found}");
            }
        }
        // The reflectance of gold at normal incidence is ((η − 1)² + k²)/((η + 1)² + k²).
        assert!((fresnel_conductor(1.0, 0.108, 3.508) - 0.9681).abs() < 1e-4);
    }

    fn reflectance(degrees: f64, eta: f32) -> f64 {
        f64::from(fresnel_dielectric(degrees.to_radians().cos() as f32, eta).0)
    }

    #[test]
    fn reflectance_is_correct_at_special_angles() {
        assert!((reflectance(0.0, 1.5) - 0.04).abs() < 1e-7);
        assert!((reflectance(90.0, 1.5) - 1.0).abs() < 1e-5);
        // At Brewster's angle, the reflectance is half of the perpendicular reflectance.
        let brewster = 1.5_f64.atan();
        let expected =
            0.5 * ((brewster.cos() - 1.5 * brewster.sin()) / (brewster.cos() + 1.5 * brewster.sin())).powi(2);
        assert!((reflectance(brewster.to_degrees(), 1.5) - expected).abs() < 1e-6);
    }

    #[test]
    fn reflection_is_total_beyond_critical_angle() {
        for (n, critical) in [(1.5, 41.8103), (1.33, 48.7535), (2.4, 24.6244)] {
            let transmitted = |degrees: f64| fresnel_dielectric(degrees.to_radians().cos() as f32, 1.0 / n).1;
            assert!(transmitted(critical - 0.01).is_some(), "{n}");
            assert!(transmitted(critical + 0.01).is_none(), "{n}");
        }
    }

    #[test]
    fn hemispherical_means_match_reference_values() {
        let mean = |eta: f32| {
            let n = 1_000_000;
            let cos2 = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
            (0..n).map(|i| f64::from(fresnel_dielectric(cos2(i).sqrt() as f32, eta).0)).sum::<f64>()
                / f64::from(n)
        };
        assert!((mean(1.5) - 0.091_778_0).abs() < 1e-5);
        assert!((mean(1.0 / 1.5) - 0.596_345_8).abs() < 1e-5);
    }

    #[test]
    fn refraction_obeys_snell() {
        for eta in [1.5_f32, 1.0 / 1.5, 1.0] {
            for degrees in [0.0_f32, 20.0, 40.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let incident = Vec3::new(sin, -cos, 0.0);
                let (_, cos_t) = fresnel_dielectric(cos, eta);
                let refracted = refract_given_transmitted_cosine(
                    incident,
                    Vec3::Y,
                    eta,
                    cos_t.expect("below the critical angle"),
                );
                assert!((refracted.x - sin / eta).abs() < 1e-6 && refracted.y < 0.0);
            }
        }
    }
}
