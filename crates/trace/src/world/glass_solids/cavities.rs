//! Cavities: closed meshes with inward-facing fronts inside another solid of the same glass.

use super::caps::triangles_relative_to;
use super::parts::GlassMediumKey;
use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Canceled};
use crate::math::DVec3;
use crate::scene::description::Scene;

/// A closed solid made of meshes.
#[derive(Clone, Debug)]
pub(super) struct ClosedSolid {
    /// Indices of the solid's objects.
    pub objects: Vec<u32>,
    /// Enclosed volume, negative if the front faces inward.
    pub volume: f64,
    /// Type of glass.
    pub substance: GlassMediumKey,
}

/// Direction of the rays used to count surfaces, chosen so that it is unlikely to be parallel to modeled
/// faces.
const PARITY_DIRECTION: DVec3 = DVec3::new(0.350_31, 0.812_77, 0.465_29);

/// Number of vertices tested, all of which must be inside for a mesh to be a cavity.
const VERTICES: usize = 16;

/// Finds cavities. Returns the index of each cavity and of the solid around it.
///
/// A cavity belongs to the smallest solid around it. Large cavities are assigned first, so that a solid
/// floating in a cavity is not considered to be inside the surrounding glass.
pub(super) fn find_cavities(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    origin: DVec3,
    closed: &[ClosedSolid],
    token: &CancelToken,
) -> Result<Vec<(usize, usize)>, Canceled> {
    let corners_of = |object: u32| {
        let mesh = scene.objects[object as usize].shape.as_mesh();
        mesh.into_iter().flat_map(|mesh| triangles_relative_to(mesh, meshes[mesh.file], origin))
    };
    let order = |holds: fn(f64) -> bool| {
        let mut order: Vec<usize> = (0..closed.len()).filter(|&i| holds(closed[i].volume)).collect();
        order.sort_by(|&a, &b| closed[a].volume.total_cmp(&closed[b].volume));
        order
    };
    let (hollows, solids) = (order(|volume| volume < 0.0), order(|volume| volume > 0.0));
    let mut found: Vec<(usize, usize)> = Vec::new();
    for hollow in hollows {
        token.check_pause_and_cancel()?;
        let own: Vec<[DVec3; 3]> = closed[hollow].objects.iter().flat_map(|&id| corners_of(id)).collect();
        let some: Vec<DVec3> =
            own.iter().step_by(own.len().div_ceil(VERTICES).max(1)).map(|corners| corners[0]).collect();
        let surrounds = |solid: usize| {
            let parts = found.iter().filter(|(_, around)| *around == solid).map(|(cavity, _)| *cavity);
            let objects = parts.chain([solid]).flat_map(|body| closed[body].objects.iter().copied());
            are_all_points_inside(&some, objects.flat_map(corners_of))
        };
        let is_fit = |solid: usize| {
            closed[solid].volume > -closed[hollow].volume
                && closed[solid].substance.is_some()
                && closed[solid].substance == closed[hollow].substance
        };
        let around = solids.iter().copied().find(|&solid| is_fit(solid) && surrounds(solid));
        found.extend(around.map(|solid| (hollow, solid)));
    }
    Ok(found)
}

/// Whether all points are inside closed surfaces, which means that rays from the points hit an odd number of
/// triangles.
fn are_all_points_inside(points: &[DVec3], triangles: impl Iterator<Item = [DVec3; 3]>) -> bool {
    let mut hits = vec![0_u32; points.len()];
    for corners in triangles {
        for (hits, &point) in hits.iter_mut().zip(points) {
            *hits += u32::from(parity_ray_hits_triangle(point, corners));
        }
    }
    !hits.is_empty() && hits.iter().all(|hits| hits % 2 == 1)
}

/// Whether the ray from a point along [`PARITY_DIRECTION`] hits a triangle. At a shared edge, exactly one
/// triangle is hit because the edge's product is computed from the endpoints in the same order for both
/// triangles.
fn parity_ray_hits_triangle(point: DVec3, corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner - point);
    let side = |p: DVec3, q: DVec3| {
        let is_first = p.to_array() <= q.to_array();
        let product = if is_first { p.cross(q) } else { q.cross(p) }.dot(PARITY_DIRECTION);
        (product >= 0.0) == is_first
    };
    let sides = [side(a, b), side(b, c), side(c, a)];
    if sides[0] != sides[1] || sides[1] != sides[2] {
        return false;
    }
    let normal = (b - a).cross(c - a);
    a.dot(normal) * PARITY_DIRECTION.dot(normal) > 0.0
}
