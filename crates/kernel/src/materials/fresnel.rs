//! Reflection and refraction at a smooth boundary of dielectrics.

use crate::math::Vec3;

/// Unpolarised reflectance, and the cosine of the transmitted direction. `None` for total internal reflection.
/// `cos_incident` ≥ 0 on the side of the ray, `eta` = n(far side)/n(ray's side). Exact equations of both polarisations
/// (Born and Wolf, *Principles of Optics*, section 1.5.2).
#[inline]
pub fn dielectric(cos_incident: f32, eta: f32) -> (f32, Option<f32>) {
    let (cos_i, eta) = (f64::from(cos_incident.clamp(0.0, 1.0)), f64::from(eta));
    // Compute 1 − sin²θₜ without the cancellation at grazing angles.
    let cos2_t = ((eta - 1.0) * (eta + 1.0) + cos_i * cos_i) / (eta * eta);
    if !(cos2_t > 0.0) {
        return (1.0, None);
    }
    let cos_t = cos2_t.sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    ((0.5 * (parallel * parallel + perpendicular * perpendicular)) as f32, Some(cos_t as f32))
}

/// The refracted direction of unit `incident`, given the unit normal on its own side and the result of [`dielectric`]
/// (Snell).
pub fn refract(incident: Vec3, normal: Vec3, eta: f32, cos_transmitted: f32) -> Vec3 {
    let cos_incident = -incident.dot(normal);
    (incident / eta + normal * (cos_incident / eta - cos_transmitted)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reflectance(degrees: f64, eta: f32) -> f64 {
        f64::from(dielectric(degrees.to_radians().cos() as f32, eta).0)
    }

    #[test]
    fn normal_incidence_and_grazing() {
        assert!((reflectance(0.0, 1.5) - 0.04).abs() < 1e-7);
        assert!((reflectance(90.0, 1.5) - 1.0).abs() < 1e-5);
        // Brewster's angle: half of the perpendicular reflectance.
        let brewster = 1.5_f64.atan();
        let expected =
            0.5 * ((brewster.cos() - 1.5 * brewster.sin()) / (brewster.cos() + 1.5 * brewster.sin())).powi(2);
        assert!((reflectance(brewster.to_degrees(), 1.5) - expected).abs() < 1e-6);
    }

    #[test]
    fn all_is_reflected_beyond_the_critical_angle() {
        for (n, critical) in [(1.5, 41.8103), (1.33, 48.7535), (2.4, 24.6244)] {
            let transmitted = |degrees: f64| dielectric(degrees.to_radians().cos() as f32, 1.0 / n).1;
            assert!(transmitted(critical - 0.01).is_some(), "{n}");
            assert!(transmitted(critical + 0.01).is_none(), "{n}");
        }
    }

    #[test]
    fn the_mean_over_the_hemisphere_from_outside_and_inside() {
        let mean = |eta: f32| {
            let n = 1_000_000;
            let cos2 = |i: i32| (f64::from(i) + 0.5) / f64::from(n);
            (0..n).map(|i| f64::from(dielectric(cos2(i).sqrt() as f32, eta).0)).sum::<f64>() / f64::from(n)
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
                let (_, cos_t) = dielectric(cos, eta);
                let refracted = refract(incident, Vec3::Y, eta, cos_t.expect("below the critical angle"));
                assert!((refracted.x - sin / eta).abs() < 1e-6 && refracted.y < 0.0);
            }
        }
    }
}
