//! Occlusion between a point and a photon in its kernel.

use super::map::GatherPoint;
use super::reservoir::PhotonPosition;
use crate::geometry::Ray;
use crate::lights::LightObject;
use crate::world::Geometry;

/// Height of the test segment above the surface, in kernel radii, to clear the curvature of the surface itself.
const ABOVE: f32 = 0.15;

/// Height of the test segment if something is closer above the surface, such as a ball resting on it.
const BELOW: f32 = 0.02;

/// Length in kernel radii below which a segment counts as unoccluded.
const NEAR: f32 = 1e-3;

/// Whether a photon is occluded from the center of its kernel: along a segment above the surface or, if either end
/// lacks the room for that, along a segment close to the surface.
pub fn is_occluded(geometry: &Geometry, look: &GatherPoint, photon: &PhotonPosition, radius: f32) -> bool {
    if (photon.point - look.point).length_squared() < (NEAR * radius) * (NEAR * radius) {
        return false;
    }
    let lifted = |lift: f32| {
        let above = lift * radius;
        [look.point + above * look.normal, photon.point + above * photon.normal]
    };
    let is_blocked = |from, to| geometry.occluded(&Ray::segment(from, to), LightObject::Nothing);
    let [from, to] = lifted(ABOVE);
    if !is_blocked(from, to) {
        return false;
    }
    let [low_from, low_to] = lifted(BELOW);
    let has_room = !is_blocked(low_from, from) && !is_blocked(low_to, to);
    has_room || is_blocked(low_from, low_to)
}
