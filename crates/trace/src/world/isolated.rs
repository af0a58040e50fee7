//! Isolated places: parts of surfaces with nothing near them. A ray that crosses a surface there need not search for contacts.
//!
//! The first ray that asks computes it, for a triangle of a mesh or for a cell of the box around a shape, and a byte each keeps the
//! result. The result depends on the geometry alone: it does not matter which ray asks first. `World::contact` gives the same with
//! it as by its own search.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use super::{Geometry, Hit, MeshInstance, Object};
use crate::geometry::{Aabb, Shape, SurfacePoint};
use crate::math::{DVec3, Vec3};

/// Value before any ray has asked.
const UNKNOWN: u8 = 0;

/// Value if something may be near anywhere.
const NEVER: u8 = u8::MAX;

/// Parts of 1 in a triangle's byte: nothing is near if each barycentric coordinate is at least so many of them.
const PARTS: f32 = 256.0;

/// Most of these parts.
const MOST_PARTS: f64 = 64.0;

/// Distance of the isolated part of a triangle from its edges, in margins: neighbours at an angle of 30° and more are not near.
const FROM_EDGES: f64 = 4.0;

/// Least distance, in margins, of surfaces that are not near: the box of a margin around the point, and room for the
/// rounding of both.
const APART: f64 = 1.9;

/// Cells along a side of the box around a shape.
const CELLS: usize = 16;

/// Tables of all objects.
#[derive(Debug, Default)]
pub(super) struct Isolated {
    /// The diagonal of the box around all finite objects.
    reach: f32,
    tables: Vec<OnceLock<Table>>,
}

/// Table of an object.
#[derive(Debug)]
struct Table {
    /// Largest margin for which the table holds.
    margin: f32,
    /// Corner of a shape's first cell, and cells per unit of length along each axis.
    cells: [Vec3; 2],
    states: Box<[AtomicU8]>,
}

impl Isolated {
    /// Empty tables of the objects in these boxes.
    pub fn new(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(Aabb::EMPTY, |all, own| all.union(*own));
        let reach = if all.is_empty() { 0.0 } else { all.extent().length() };
        Self { reach, tables: boxes.iter().map(|_| OnceLock::new()).collect() }
    }
}

impl Table {
    fn new(margin: f32, cells: [Vec3; 2], count: usize) -> Self {
        Self { margin, cells, states: (0..count).map(|_| AtomicU8::new(UNKNOWN)).collect() }
    }

    /// A table with a cell for each place of the box around a shape.
    fn of_cells(margin: f32, bounds: &Aabb) -> Self {
        let dense = Vec3::splat(CELLS as f32) / bounds.extent();
        // A flat box is one cell thick.
        let dense = Vec3::from(dense.to_array().map(|dense| if dense.is_finite() { dense } else { 0.0 }));
        Self::new(margin, [bounds.min, dense], CELLS * CELLS * CELLS)
    }

    /// The cell that contains a point.
    #[inline]
    fn cell(&self, point: Vec3) -> Cell {
        let [start, dense] = self.cells;
        Cell(((point - start) * dense).to_array().map(|along| (along.max(0.0) as usize).min(CELLS - 1)))
    }

    #[inline]
    fn state(&self, number: usize, find: impl FnOnce() -> u8) -> u8 {
        let state = &self.states[number];
        let known = state.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return known;
        }
        let found = find();
        state.store(found, Ordering::Relaxed);
        found
    }
}

/// A part of a surface.
enum Region {
    /// A box around it, grown by the margin.
    Cell(Aabb),
    /// A part of a triangle.
    Triangle {
        corners: [DVec3; 3],
        /// Least distance of surfaces that are not near.
        apart: f64,
    },
}

impl Geometry {
    /// Whether only the object of the hit, and of a mesh only its triangle, is within a margin of a point.
    pub(super) fn is_isolated(&self, hit: &Hit, surface: &SurfacePoint, margin: Vec3) -> bool {
        let object = &self.objects()[hit.object as usize];
        let table = self.isolated().tables[hit.object as usize].get_or_init(|| self.table(object));
        if !(margin.max_element() <= table.margin) {
            return false;
        }
        match object {
            Object::Mesh(mesh) => {
                let triangle = hit.shape.primitive;
                let find = || self.parts_from_edges(hit.object, mesh, triangle, table.margin);
                let state = table.state(triangle as usize, find);
                state != NEVER && surface.barycentric.min_element() * PARTS >= f32::from(state)
            }
            Object::Shape(shape) => {
                let cell = table.cell(surface.point);
                let find = || {
                    let all = shape.bounds().unwrap_or(Aabb::EMPTY);
                    let around = cell.bounds(&all).grown(Vec3::splat(table.margin));
                    if self.is_clear(&around, &Region::Cell(around), hit.object) { 1 } else { NEVER }
                };
                table.state(cell.number(), find) != NEVER
            }
        }
    }

    /// A table for an object. Rays that come from farther than four times the size of the scene have larger margins than its own.
    fn table(&self, object: &Object) -> Table {
        let of_rays = self.mesh_rounding() + 8.0 * f32::EPSILON * self.isolated().reach;
        match object {
            Object::Mesh(mesh) => {
                let margin = of_rays.max(4.0 * mesh.rounding());
                Table::new(margin, [Vec3::ZERO; 2], mesh.tree.loaded().mesh.triangles.len())
            }
            Object::Shape(shape) => match shape.bounds() {
                Some(bounds) => {
                    let size = bounds.min.abs().max(bounds.max.abs()).max_element();
                    Table::of_cells(of_rays.max(64.0 * f32::EPSILON * size), &bounds)
                }
                // No ray has a margin that small.
                None => Table::new(-1.0, [Vec3::ZERO; 2], 0),
            },
        }
    }

    /// The byte of a triangle.
    fn parts_from_edges(&self, object: u32, mesh: &MeshInstance, triangle: u32, margin: f32) -> u8 {
        let corners = mesh.world_corners(triangle);
        let own_corners = mesh.local_corners(triangle);
        let growth = mesh.transform.max_inverse_stretch();
        let [a, b, c] = corners;
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a)).sqrt();
        let height = (b - a).cross(c - a).length() / longest;
        let least = (f64::from(PARTS) * FROM_EDGES * f64::from(margin) / height).ceil().max(1.0);
        // Barycentric coordinates of at least some parts form a smaller triangle about the same middle.
        let smaller = |corners: [DVec3; 3], parts: f64| {
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            corners.map(|corner| middle + (corner - middle) * (1.0 - 3.0 * parts / f64::from(PARTS)))
        };
        let apart = APART * f64::from(margin);
        // Try a part further from the edges, for neighbours at a small angle.
        for parts in [least, 4.0 * least].into_iter().filter(|&parts| parts <= MOST_PARTS) {
            let inner = smaller(own_corners, parts);
            if !is_clear_of_own(mesh, triangle, inner, apart * growth) {
                continue;
            }
            let inner = smaller(corners, parts);
            let region = Region::Triangle { corners: inner, apart };
            let around = Aabb::around_f64(inner).grown(Vec3::splat(2.0 * margin));
            if self.is_clear(&around, &region, object) {
                return parts as u8;
            }
        }
        NEVER
    }

    /// Whether no other object comes near a region; near surfaces overlap `around`.
    fn is_clear(&self, around: &Aabb, region: &Region, own: u32) -> bool {
        let is_near = |id: u32| match &self.objects()[id as usize] {
            Object::Shape(shape) => shape_is_near(shape, around, region),
            Object::Mesh(mesh) => {
                let is_far = |other: u32| !region.is_near(mesh.world_corners(other), around);
                !mesh.tree.triangles().meeting_while(&mesh.local_box(around), is_far)
            }
        };
        let is_near = |id: u32| id != own && is_near(id);
        if self.unbounded().iter().any(|&id| is_near(id)) {
            return false;
        }
        let mut is_clear = true;
        self.tree().meeting(around, |id| is_clear = is_clear && !is_near(id));
        is_clear
    }
}

/// Whether a mesh's other triangles are apart from a part of one of them by a distance, all in the mesh's coordinates: its
/// neighbours are the most triangles near it.
fn is_clear_of_own(mesh: &MeshInstance, triangle: u32, part: [DVec3; 3], apart: f64) -> bool {
    let around = Aabb::around_f64(part).grown(Vec3::splat((1.1 * apart) as f32));
    mesh.tree.triangles().meeting_while(&around, |other| {
        other == triangle || are_apart(part, mesh.local_corners(other), apart)
    })
}

/// Whether a shape may have a point near a region, or encloses it.
fn shape_is_near(shape: &Shape, around: &Aabb, region: &Region) -> bool {
    if shape.bounds().is_some_and(|bounds| !bounds.meets(around)) {
        return false;
    }
    if let Shape::Plane(plane) = shape {
        return (0..8).any(|i| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { around.min[axis] } else { around.max[axis] };
            plane.is_behind(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        });
    }
    if let Shape::Sphere(sphere) = shape {
        let nearest = sphere.center.clamp(around.min.as_dvec3(), around.max.as_dvec3());
        return nearest.distance(sphere.center) <= sphere.radius * (1.0 + 1e-6);
    }
    if let Shape::Quad(quad) = shape {
        let (a, c) = (quad.corner, quad.corner + quad.u + quad.v);
        return region.is_near([a, a + quad.u, c], around) || region.is_near([a, c, a + quad.v], around);
    }
    if let Shape::Triangle(own) = shape {
        return region.is_near([own.a, own.b, own.c], around);
    }
    // The boxes around the others meet.
    true
}

impl Region {
    /// Whether a triangle may be near; one that does not overlap `around` is not.
    fn is_near(&self, triangle: [DVec3; 3], around: &Aabb) -> bool {
        match self {
            Self::Cell(cell) => meets(triangle, cell),
            Self::Triangle { corners, apart } => {
                Aabb::around_f64(triangle).meets(around) && !are_apart(*corners, triangle, *apart)
            }
        }
    }
}

/// A cell of the box around a shape, by its indices along the axes.
struct Cell([usize; 3]);

impl Cell {
    fn number(&self) -> usize {
        let Self([x, y, z]) = *self;
        (z * CELLS + y) * CELLS + x
    }

    /// Its box, with room for the rounding of places.
    fn bounds(&self, all: &Aabb) -> Aabb {
        let side = all.extent() / CELLS as f32;
        let min = all.min + Vec3::from(self.0.map(|along| along as f32)) * side;
        Aabb { min, max: min + side }.grown(side * 1e-3)
    }
}

/// Whether a triangle has a point in a box, within rounding (Akenine-Möller, *Fast 3D Triangle-Box Overlap Testing*, 2001).
pub(super) fn meets(corners: [DVec3; 3], bounds: &Aabb) -> bool {
    if !Aabb::around_f64(corners).meets(bounds) {
        return false;
    }
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let (middle, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let [a, b, c] = corners.map(|corner| corner - middle);
    let edges = [b - a, c - b, a - c];
    let parts = |axis: DVec3| {
        let along = [a, b, c].map(|corner| corner.dot(axis));
        let reach = half.dot(axis.abs()) * (1.0 + 1e-9);
        let (low, high) = (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
        low > reach || high < -reach
    };
    let normal = edges[0].cross(edges[1]);
    let across = |edge: DVec3| {
        [DVec3::new(0.0, -edge.z, edge.y), DVec3::new(edge.z, 0.0, -edge.x), DVec3::new(-edge.y, edge.x, 0.0)]
    };
    !(parts(normal) || edges.into_iter().flat_map(across).any(parts))
}

/// Whether an axis separates two triangles by this distance.
fn are_apart(one: [DVec3; 3], other: [DVec3; 3], distance: f64) -> bool {
    let edges = |[a, b, c]: [DVec3; 3]| [b - a, c - b, a - c];
    let (own, others) = (edges(one), edges(other));
    let range = |corners: [DVec3; 3], axis: DVec3| {
        let [a, b, c] = corners.map(|corner| corner.dot(axis));
        [a.min(b).min(c), a.max(b).max(c)]
    };
    let parts = |axis: DVec3| {
        let ([a, b], [c, d]) = (range(one, axis), range(other, axis));
        (c - b).max(a - d) > distance * axis.length()
    };
    // The edges in the first plane separate neighbours.
    let normal = own[0].cross(own[1]);
    if own.into_iter().any(|edge| parts(edge.cross(normal))) || parts(normal) {
        return true;
    }
    let normal = others[0].cross(others[1]);
    parts(normal)
        || others.into_iter().any(|edge| parts(edge.cross(normal)))
        || own.into_iter().any(|edge| others.into_iter().any(|other| parts(edge.cross(other))))
}

#[cfg(test)]
#[path = "isolated_tests.rs"]
mod tests;
