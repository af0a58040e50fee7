//! Occlusion between a point and a photon in its kernel.

use super::map::GatherPoint;
use super::reservoir::PhotonPositionAndNormal;
use crate::geometry::Ray;
use crate::lights::GeometryOfLight;
use crate::world::Geometry;

/// Height of the test segment above the surface, in kernel radii, chosen to clear the surface's own
/// curvature.
const ABOVE: f32 = 0.15;

/// Height of the test segment if there is an object closer to the surface, such as a ball resting on it.
const BELOW: f32 = 0.02;

/// Segments shorter than this, in kernel radii, are considered unoccluded.
const NEAR: f32 = 1e-3;

/// Whether a photon is occluded from the kernel's center. Tests a segment above the surface, or a segment
/// close to the surface if there is not enough room above the center or the photon.
pub fn is_photon_occluded(
    geometry: &Geometry,
    look: &GatherPoint,
    photon: &PhotonPositionAndNormal,
    radius: f32,
) -> bool {
    if (photon.point - look.point).length_squared() < (NEAR * radius) * (NEAR * radius) {
        return false;
    }
    let lifted = |lift: f32| {
        let above = lift * radius;
        [look.point + above * look.normal, photon.point + above * photon.normal]
    };
    let is_blocked = |from, to| {
        geometry.is_occluded_except_by_light(
            &Ray::segment_ending_before_point(from, to),
            GeometryOfLight::Nothing,
        )
    };
    let [from, to] = lifted(ABOVE);
    if !is_blocked(from, to) {
        return false;
    }
    let [low_from, low_to] = lifted(BELOW);
    let has_room = !is_blocked(low_from, from) && !is_blocked(low_to, to);
    has_room || is_blocked(low_from, low_to)
}
