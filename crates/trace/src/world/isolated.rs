//! Isolated surface regions: parts of surfaces with no other surfaces nearby, where rays do not need to
//! search for coincident surfaces.
//!
//! The state of each mesh triangle, and of each grid cell around a shape, is computed on first use and cached
//! in one byte. The state depends only on the geometry, not on the order of rays. The cache does not change
//! the results of [`World::find_coincident_surfaces_at`](super::World::find_coincident_surfaces_at).

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use super::{Geometry, Hit, MeshInstance, Object};
use crate::accel::PrimitiveOrSubtreeAroundBox;
use crate::geometry::{Aabb, Shape, SurfacePoint};
use crate::math::{DVec3, Vec3};

/// State of a triangle or grid cell that has not been computed yet.
const UNKNOWN: u8 = 0;

/// State of a region in which no point counts as isolated, because other surfaces may be nearby.
const NEVER: u8 = u8::MAX;

/// Resolution of a triangle's state. Points whose barycentric coordinates are all at least `state /
/// STATE_STEPS` are isolated.
const STATE_STEPS: f32 = 256.0;

/// Largest state tried for a triangle.
const MAX_STATE: f64 = 64.0;

/// Distance from a triangle's edges to its isolated part, in margins. At this distance, neighbors at angles
/// of 30° or more are not considered near.
const FROM_EDGES: f64 = 4.0;

/// Minimum distance, in margins, at which surfaces are not considered near. This distance covers a box of one
/// margin around the point, with room for rounding.
const MIN_SEPARATION: f64 = 1.9;

/// Grid cells along each side of a shape's bounding box.
const CELLS: usize = 16;

/// Isolation tables of all objects.
#[derive(Debug, Default)]
pub(super) struct IsolatedRegionCache {
    /// Diagonal of the bounding box of all finite objects.
    reach: f32,
    tables: Vec<OnceLock<ObjectRegionIsolationStates>>,
}

/// Cached isolation states of one object.
#[derive(Debug)]
struct ObjectRegionIsolationStates {
    /// Maximum margin for which the states are valid.
    margin: f32,
    /// For shapes, the grid's minimum corner and the number of cells per unit length along each axis.
    cells: [Vec3; 2],
    states: Box<[AtomicU8]>,
}

impl IsolatedRegionCache {
    /// Creates empty tables for objects with these bounding boxes.
    pub fn new(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(Aabb::EMPTY, |all, own| all.union(*own));
        let reach = if all.is_empty() { 0.0 } else { all.extent().length() };
        Self { reach, tables: boxes.iter().map(|_| OnceLock::new()).collect() }
    }
}

impl ObjectRegionIsolationStates {
    fn new(margin: f32, cells: [Vec3; 2], count: usize) -> Self {
        Self { margin, cells, states: (0..count).map(|_| AtomicU8::new(UNKNOWN)).collect() }
    }

    /// Creates a table with one state per grid cell of a shape's bounding box.
    fn unknown_for_grid_cells(margin: f32, bounds: &Aabb) -> Self {
        let dense = Vec3::splat(CELLS as f32) / bounds.extent();
        // A flat box is one cell thick.
        let dense = Vec3::from(dense.to_array().map(|dense| if dense.is_finite() { dense } else { 0.0 }));
        Self::new(margin, [bounds.min, dense], CELLS * CELLS * CELLS)
    }

    /// Returns the grid cell that contains a point.
    #[inline]
    fn grid_cell_at(&self, point: Vec3) -> GridCellIndex {
        let [start, dense] = self.cells;
        GridCellIndex(
            ((point - start) * dense).to_array().map(|along| (along.max(0.0) as usize).min(CELLS - 1)),
        )
    }

    #[inline]
    fn get_or_compute_state(&self, number: usize, find: impl FnOnce() -> u8) -> u8 {
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

/// A patch of a surface to test for isolation.
enum SurfacePatch {
    /// A grid cell, expanded by the margin.
    GridCell(Aabb),
    /// The inner part of a triangle.
    Triangle {
        corners: [DVec3; 3],
        /// Distance up to which a surface is considered near.
        apart: f64,
    },
}

impl Geometry {
    /// Whether there is nothing within `margin` of the point other than the hit object or, for a mesh, the
    /// hit triangle.
    pub fn is_hit_isolated(&self, hit: &Hit, surface: &SurfacePoint, margin: Vec3) -> bool {
        let object = &self.objects()[hit.object as usize];
        let table = self.isolated_region_cache().tables[hit.object as usize]
            .get_or_init(|| self.new_region_isolation_table(object));
        if !(margin.max_element() <= table.margin) {
            return false;
        }
        match object {
            Object::Mesh(mesh) => {
                let triangle = hit.shape.primitive;
                let find = || self.triangle_isolation_state(hit.object, mesh, triangle, table.margin);
                let state = table.get_or_compute_state(triangle as usize, find);
                state != NEVER && surface.barycentric.min_element() * STATE_STEPS >= f32::from(state)
            }
            Object::Shape(shape) => {
                let cell = table.grid_cell_at(surface.point);
                let find = || {
                    let all = shape.bounds().unwrap_or(Aabb::EMPTY);
                    let around = cell.bounds(&all).expanded(Vec3::splat(table.margin));
                    if self.is_region_isolated(&around, &SurfacePatch::GridCell(around), hit.object) {
                        1
                    } else {
                        NEVER
                    }
                };
                table.get_or_compute_state(cell.linear_index(), find) != NEVER
            }
        }
    }

    /// Creates an object's table. The margin covers rays from up to four scene sizes away. Longer rays have
    /// larger margins and do not use the table.
    fn new_region_isolation_table(&self, object: &Object) -> ObjectRegionIsolationStates {
        let of_rays =
            self.max_mesh_rounding_error() + 8.0 * f32::EPSILON * self.isolated_region_cache().reach;
        match object {
            Object::Mesh(mesh) => {
                let margin = of_rays.max(4.0 * mesh.max_rounding_error());
                ObjectRegionIsolationStates::new(
                    margin,
                    [Vec3::ZERO; 2],
                    mesh.tree.loaded_mesh().mesh.triangles.len(),
                )
            }
            Object::Shape(shape) => match shape.bounds() {
                Some(bounds) => {
                    let size = bounds.min.abs().max(bounds.max.abs()).max_element();
                    ObjectRegionIsolationStates::unknown_for_grid_cells(
                        of_rays.max(64.0 * f32::EPSILON * size),
                        &bounds,
                    )
                }
                // With a negative margin, the table of an unbounded shape is never used.
                None => ObjectRegionIsolationStates::new(-1.0, [Vec3::ZERO; 2], 0),
            },
        }
    }

    /// Computes a triangle's state.
    fn triangle_isolation_state(&self, object: u32, mesh: &MeshInstance, triangle: u32, margin: f32) -> u8 {
        let corners = mesh.world_corners(triangle);
        let own_corners = mesh.local_corners(triangle);
        let growth = mesh.transform.max_inverse_stretch();
        let [a, b, c] = corners;
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a)).sqrt();
        let height = (b - a).cross(c - a).length() / longest;
        let least = (f64::from(STATE_STEPS) * FROM_EDGES * f64::from(margin) / height).ceil().max(1.0);
        // Points whose barycentric coordinates all exceed a bound form a smaller triangle with the same
        // centroid.
        let smaller = |corners: [DVec3; 3], parts: f64| {
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            corners.map(|corner| middle + (corner - middle) * (1.0 - 3.0 * parts / f64::from(STATE_STEPS)))
        };
        let apart = MIN_SEPARATION * f64::from(margin);
        // Also try a part farther from the edges, in case there is a small angle between this triangle and a
        // neighbor.
        for parts in [least, 4.0 * least].into_iter().filter(|&parts| parts <= MAX_STATE) {
            let inner = smaller(own_corners, parts);
            if !is_far_from_other_triangles(mesh, triangle, inner, apart * growth) {
                continue;
            }
            let inner = smaller(corners, parts);
            let region = SurfacePatch::Triangle { corners: inner, apart };
            let around = Aabb::from_points_f64(inner).expanded(Vec3::splat(2.0 * margin));
            if self.is_region_isolated(&around, &region, object) {
                return parts as u8;
            }
        }
        NEVER
    }

    /// Whether no other objects are near a region. Every object near the region must overlap `around`.
    fn is_region_isolated(&self, around: &Aabb, region: &SurfacePatch, own: u32) -> bool {
        let is_near = |id: u32| match &self.objects()[id as usize] {
            Object::Shape(shape) => shape_may_overlap_region(shape, around, region),
            Object::Mesh(mesh) => {
                let is_far = |other: u32| !region.is_triangle_near(mesh.world_corners(other), around);
                !mesh.tree.triangle_tree().all_triangles_in_box_satisfy(&mesh.box_to_local(around), is_far)
            }
        };
        let is_near = |id: u32| id != own && is_near(id);
        if self.unbounded().iter().any(|&id| is_near(id)) {
            return false;
        }
        let mut is_clear = true;
        self.finite_object_tree().visit_surfaces_overlapping_box(around, |met| {
            is_clear = match met {
                PrimitiveOrSubtreeAroundBox::Primitive(id) => !is_near(id),
                PrimitiveOrSubtreeAroundBox::Enclosing(_) => false,
            };
            is_clear
        });
        is_clear
    }
}

/// Whether all other triangles of the mesh are at least `apart` from a part of one triangle, in mesh
/// coordinates. This is checked first because most nearby triangles are neighbors in the same mesh.
fn is_far_from_other_triangles(mesh: &MeshInstance, triangle: u32, part: [DVec3; 3], apart: f64) -> bool {
    let around = Aabb::from_points_f64(part).expanded(Vec3::splat((1.1 * apart) as f32));
    mesh.tree.triangle_tree().all_triangles_in_box_satisfy(&around, |other| {
        other == triangle || are_triangles_apart(part, mesh.local_corners(other), apart)
    })
}

/// Whether a shape may intersect a region or enclose it.
fn shape_may_overlap_region(shape: &Shape, around: &Aabb, region: &SurfacePatch) -> bool {
    if shape.bounds().is_some_and(|bounds| !bounds.overlaps(around)) {
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
        return region.is_triangle_near([a, a + quad.u, c], around)
            || region.is_triangle_near([a, c, a + quad.v], around);
    }
    if let Shape::Triangle(own) = shape {
        return region.is_triangle_near([own.a, own.b, own.c], around);
    }
    // Other shapes are considered near if their bounding boxes overlap.
    true
}

impl SurfacePatch {
    /// Whether a triangle may be near the region. Triangles that do not overlap `around` are not near.
    fn is_triangle_near(&self, triangle: [DVec3; 3], around: &Aabb) -> bool {
        match self {
            Self::GridCell(cell) => triangle_overlaps_box(triangle, cell),
            Self::Triangle { corners, apart } => {
                Aabb::from_points_f64(triangle).overlaps(around)
                    && !are_triangles_apart(*corners, triangle, *apart)
            }
        }
    }
}

/// A grid cell of a shape's bounding box, identified by its indices along the axes.
struct GridCellIndex([usize; 3]);

impl GridCellIndex {
    fn linear_index(&self) -> usize {
        let Self([x, y, z]) = *self;
        (z * CELLS + y) * CELLS + x
    }

    /// Bounding box of the cell, expanded for rounding.
    fn bounds(&self, all: &Aabb) -> Aabb {
        let side = all.extent() / CELLS as f32;
        let min = all.min + Vec3::from(self.0.map(|along| along as f32)) * side;
        Aabb { min, max: min + side }.expanded(side * 1e-3)
    }
}

/// Whether a triangle intersects a box, up to rounding (Akenine-Möller, *Fast 3D Triangle-Box Overlap
/// Testing*, 2001).
pub(super) fn triangle_overlaps_box(corners: [DVec3; 3], bounds: &Aabb) -> bool {
    if !Aabb::from_points_f64(corners).overlaps(bounds) {
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

/// Whether any axis separates two triangles by more than `distance`.
fn are_triangles_apart(one: [DVec3; 3], other: [DVec3; 3], distance: f64) -> bool {
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
    // First try the axes that typically separate neighbors: the first triangle's in-plane edge normals.
    let normal = own[0].cross(own[1]);
    if own.into_iter().any(|edge| parts(edge.cross(normal))) || parts(normal) {
        return true;
    }
    let normal = others[0].cross(others[1]);
    parts(normal)
        || others.into_iter().any(|edge| parts(edge.cross(normal)))
        || own.into_iter().any(|edge| others.into_iter().any(|other| parts(edge.cross(other))))
}
