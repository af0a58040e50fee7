//! Occlusion between a point and a photon of its kernel.

use super::map::GatherPoint;
use super::reservoir::Place;
use crate::geometry::Ray;
use crate::lights::Source;
use crate::world::Geometry;

/// Height of the way to a photon above the surface, in radii of the kernel: over the curvature of the surface itself.
const ABOVE: f32 = 0.15;

/// Height of the way if something hangs closer above the surface, such as a ball at rest on it.
const BELOW: f32 = 0.02;

/// Length, in radii, below which a way is free.
const NEAR: f32 = 1e-3;

/// Whether something is between a point and a photon of its kernel: on the way above the surface, or, if one of them lacks that
/// much room above it, on the way close to the surface.
pub fn is_occluded(geometry: &Geometry, look: &GatherPoint, photon: &Place, radius: f32) -> bool {
    if (photon.point - look.point).length_squared() < (NEAR * radius) * (NEAR * radius) {
        return false;
    }
    let lifted = |lift: f32| {
        let above = lift * radius;
        [look.point + above * look.normal, photon.point + above * photon.normal]
    };
    let is_blocked = |from, to| geometry.occluded(&Ray::segment(from, to), Source::Nothing);
    let [from, to] = lifted(ABOVE);
    if !is_blocked(from, to) {
        return false;
    }
    let [low_from, low_to] = lifted(BELOW);
    let has_room = !is_blocked(low_from, from) && !is_blocked(low_to, to);
    has_room || is_blocked(low_from, low_to)
}
