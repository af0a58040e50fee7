//! Rendered values against closed forms, which are derived in comments.

mod bodies;
mod bumps;
mod camera;
mod caustics;
mod direct;
mod distant;
mod everywhere;
mod facets;
mod far;
mod film;
mod footprints;
mod frosted;
mod glass;
mod global;
mod hard;
mod many_lights;
mod microfacets;
mod mirror;
mod patterns;
mod photons;
mod repeated_faces;
mod robust;
mod round;
mod round_lights;
mod round_properties;
mod rows;
mod scenes;
mod shading;
mod sky;
mod speckle;
mod straight;
mod touching;
mod transformed;
mod two_sided;
mod uv_sets;
mod views;

use glimt::math::DVec3;

/// A point or direction.
pub const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Mean and standard error over independent values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Checks that |mean − exact| ≤ max(3·SE, 1e-5·exact), where mean and SE are over seeds.
#[track_caller]
pub fn assert_mean(what: &str, values: &[f64], exact: f64) {
    assert!(values.len() >= 16, "too few seeds");
    let (mean, error) = mean_and_error(values);
    let allowed = (3.0 * error).max(1e-5 * exact.abs());
    assert!((mean - exact).abs() <= allowed, "{what}: {mean} ± {error}, expected {exact}");
}

/// Checks that a value is exact to within a relative error of 1e-5.
#[track_caller]
pub fn assert_close(what: &str, value: f64, exact: f64) {
    assert!((value - exact).abs() <= 1e-5 * exact.abs(), "{what}: {value}, expected {exact}");
}

/// Irradiance from an unoccluded polygon of unit radiance above the horizon, in any orientation: ½·|Σ
/// Θᵢ(Γᵢ·n)|, where Θᵢ is the angle subtended by an edge and Γᵢ the unit normal of the plane through the edge
/// and the point (Lambert, *Photometria*, 1760).
pub fn lambert(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let corners: Vec<DVec3> = polygon.iter().map(|&corner| (corner - point).normalize()).collect();
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let sum = edges.map(|(a, b)| {
        let across = a.cross(*b);
        across.length().atan2(a.dot(*b)) * across.normalize_or_zero().dot(normal)
    });
    (0.5 * sum.sum::<f64>()).abs()
}
