//! Rendered values against closed forms, which are derived in comments.

mod blends;
mod bodies;
mod bumps;
mod camera;
mod caustics;
mod coats;
mod direct;
mod distant;
mod emission_textures;
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
mod null_interactions;
mod one_sided;
mod packets;
mod photons;
mod procedural;
mod projections;
mod repeated_faces;
mod robust;
mod round;
mod round_lights;
mod round_properties;
mod scenes;
mod shading;
mod sky;
mod speckle;
mod touching;
mod transformed;
mod translucent;
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

/// Checks that the mean over seeds equals `exact` to within four standard errors. Noise would hide errors, so
/// the standard error must be at most `max_relative_error`·`exact`.
#[track_caller]
pub fn assert_mean(what: &str, values: &[f64], exact: f64, max_relative_error: f64) {
    assert!(values.len() >= 16, "too few seeds");
    let (mean, error) = mean_and_error(values);
    assert!(error <= max_relative_error * exact, "{what}: too noisy: {mean} ± {error}, expected {exact}");
    let allowed = (4.0 * error).max(2e-5 * exact);
    assert!((mean - exact).abs() <= allowed, "{what}: {mean} ± {error}, expected {exact}");
}

/// Checks that two means, each with its standard error, are equal to within five standard errors of their
/// difference. Noise would hide errors, so this standard error must be at most `max_relative_error` of the
/// second mean.
#[track_caller]
pub fn assert_same_mean(what: &str, one: (f64, f64), other: (f64, f64), max_relative_error: f64) {
    let error = one.1.hypot(other.1);
    assert!(error <= max_relative_error * other.0, "{what}: too noisy: {one:?}, {other:?}");
    let allowed = (5.0 * error).max(2e-5 * other.0);
    assert!((one.0 - other.0).abs() <= allowed, "{what}: {one:?}, expected {other:?}");
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
