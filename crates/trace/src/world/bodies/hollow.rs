//! Cavities: closed meshes whose front faces inwards, inside other bodies of the same glass.

use super::cover::triangles;
use super::pieces::Substance;
use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Cancelled};
use crate::math::DVec3;
use crate::scene::description::Scene;

/// A closed body of meshes.
#[derive(Clone, Debug)]
pub(super) struct Closed {
    /// Its objects.
    pub objects: Vec<u32>,
    /// Volume; below 0 if its front faces inwards.
    pub volume: f64,
    /// Its glass.
    pub substance: Substance,
}

/// Direction of the lines that count surfaces; no side of a thing that people make has it.
const ASKANCE: DVec3 = DVec3::new(0.350_31, 0.812_77, 0.465_29);

/// Vertices of a cavity that must be inside.
const VERTICES: usize = 16;

/// The cavities among these bodies, each with the body around it, by their places in the list.
///
/// A cavity joins the smallest body that surrounds it. Large cavities come first: what floats in one of them is not in its glass.
pub(super) fn cavities(
    scene: &Scene,
    meshes: &[&LoadedMesh],
    origin: DVec3,
    closed: &[Closed],
    token: &CancelToken,
) -> Result<Vec<(usize, usize)>, Cancelled> {
    let corners_of = |object: u32| {
        let mesh = scene.objects[object as usize].shape.mesh();
        mesh.into_iter().flat_map(|mesh| triangles(mesh, meshes[mesh.file], origin))
    };
    let order = |holds: fn(f64) -> bool| {
        let mut order: Vec<usize> = (0..closed.len()).filter(|&i| holds(closed[i].volume)).collect();
        order.sort_by(|&a, &b| closed[a].volume.total_cmp(&closed[b].volume));
        order
    };
    let (hollows, solids) = (order(|volume| volume < 0.0), order(|volume| volume > 0.0));
    let mut found: Vec<(usize, usize)> = Vec::new();
    for hollow in hollows {
        token.check()?;
        let own: Vec<[DVec3; 3]> = closed[hollow].objects.iter().flat_map(|&id| corners_of(id)).collect();
        let some: Vec<DVec3> =
            own.iter().step_by(own.len().div_ceil(VERTICES).max(1)).map(|corners| corners[0]).collect();
        let surrounds = |solid: usize| {
            let parts = found.iter().filter(|(_, around)| *around == solid).map(|(cavity, _)| *cavity);
            let objects = parts.chain([solid]).flat_map(|body| closed[body].objects.iter().copied());
            are_inside(&some, objects.flat_map(corners_of))
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

/// Whether all points are inside of closed surfaces: lines from them hit an odd number of triangles.
fn are_inside(points: &[DVec3], triangles: impl Iterator<Item = [DVec3; 3]>) -> bool {
    let mut hits = vec![0_u32; points.len()];
    for corners in triangles {
        for (hits, &point) in hits.iter_mut().zip(points) {
            *hits += u32::from(is_ahead(point, corners));
        }
    }
    !hits.is_empty() && hits.iter().all(|hits| hits % 2 == 1)
}

/// Whether the line from a point meets a triangle. Edges count for one of their triangles: each product of an edge is computed
/// from its corners in the same order for both.
fn is_ahead(point: DVec3, corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner - point);
    let side = |p: DVec3, q: DVec3| {
        let is_first = p.to_array() <= q.to_array();
        let product = if is_first { p.cross(q) } else { q.cross(p) }.dot(ASKANCE);
        (product >= 0.0) == is_first
    };
    let sides = [side(a, b), side(b, c), side(c, a)];
    if sides[0] != sides[1] || sides[1] != sides[2] {
        return false;
    }
    let normal = (b - a).cross(c - a);
    a.dot(normal) * ASKANCE.dot(normal) > 0.0
}
