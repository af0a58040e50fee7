//! Closed form for a kernel's coverage p: the fraction of the kernel that receives photons. Surfaces are
//! included if they have about the same normal as the center and are not occluded from it. The closed form
//! exists if these surfaces are a few flat pieces. In all other cases, the coverage is estimated with random
//! trials.

use arrayvec::ArrayVec;

use super::kernel::kernel_integral_over_polygon;
use super::map::{GatherPoint, MAX_PLANE_DISTANCE, MIN_COSINE};
use crate::geometry::local_geometry::{FlatOrRoundExtent, FlatPolygon, NearestSurface};
use crate::geometry::{Aabb, NearbyGeometry, Shape, ShapeHit};
use crate::materials::{Bsdf, Material, NonSpecular};
use crate::math::frame::Frame;
use crate::math::{DVec2, DVec3};
use crate::world::{Hit, MeshInstance, Object, World};

/// Coverage of a kernel, which is reduced by edges and walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KernelCoverage {
    /// The covered fraction of the kernel's weight. Nothing is occluded within the kernel.
    Fraction(f32),
    /// Unknown because edges or walls are nearby.
    Clipped,
    /// Unknown because many triangles are nearby. Most of these kernels are far from an edge.
    Crowded,
}

/// Distance above which two planes are considered different, in kernel radii.
const MIN_PLANE_SEPARATION: f64 = 4e-3;

/// Pieces whose normals have at least this cosine may be in the same plane.
const SAME_PLANE: f64 = 1.0 - 1e-6;

/// Maximum distance between a wall and the border of the piece it stands on, in kernel radii.
const BORDER: f64 = 2e-3;

/// Maximum cosine between the normals of a wall and the piece it stands on.
const UPRIGHT: f64 = 0.3;

/// Distance beyond which surfaces are ignored, in kernel radii: √(1 + MAX_PLANE_DISTANCE²) plus a margin.
const SEARCH_RADIUS: f64 = 1.05;

/// Minimum radius of a sphere that is treated as flat around the kernel's center, in kernel radii.
const WIDE: f64 = 2.0;

/// Minimum coverage for the closed form. Below it, rounding errors are significant.
const MIN_COVERAGE: f64 = 1e-3;

/// Maximum number of mesh triangles near a kernel.
const TRIANGLES: usize = 32;

/// Maximum number of pieces in a kernel's plane.
const PIECES: usize = 8;

/// Maximum number of walls near a kernel.
const WALLS: usize = 4;

/// Computes a kernel's coverage.
pub fn kernel_coverage(world: &World, look: &GatherPoint, radius: f32) -> KernelCoverage {
    let mut around = KernelNeighborhood::new(look, radius);
    let mut is_crowded = false;
    let bounds = look.kernel_box(radius);
    let is_exact = world.geometry.visit_objects_in_box(&bounds, |id, object| match object {
        Object::Shape(shape) => {
            around.add_shape(shape, |is_front| can_store_photons(primitive_material(world, id, 0), is_front))
        }
        Object::Mesh(mesh) => around.add_mesh((world, id), mesh, &bounds, &mut is_crowded),
    });
    match around.coverage().filter(|_| is_exact) {
        Some(part) => KernelCoverage::Fraction(part as f32),
        None if is_crowded => KernelCoverage::Crowded,
        None => KernelCoverage::Clipped,
    }
}

/// Material of an object's primitive.
pub fn primitive_material(world: &World, object: u32, primitive: u32) -> &Material {
    let shape = ShapeHit { primitive, ..ShapeHit::from_t(0.0) };
    &world.materials[world.material_index(&Hit { shape, object })]
}

/// Whether photons are stored on one side of a material, or of any part of a blend.
pub fn can_store_photons(material: &Material, is_front: bool) -> bool {
    if let Bsdf::Blend(blend) = &material.bsdf {
        return blend.parts.iter().any(|part| can_store_photons(part, is_front));
    }
    let is_lit = |rough: &NonSpecular| rough.as_untextured().is_none_or(|bsdf| !bsdf.is_black());
    let is_rough_glass = || material.bsdf.as_dielectric().is_some_and(|glass| !glass.is_smooth());
    let is_stored = material.bsdf.non_specular_part().is_some_and(is_lit) || is_rough_glass();
    is_stored && material.scatters_on_side(is_front)
}

/// A wall perpendicular to the kernel's plane, represented as a half-plane containing the center. The dot
/// product of `normal` and a point in the half-plane is at most `distance`.
struct Wall {
    normal: DVec2,
    distance: f64,
}

impl Wall {
    /// Whether all corners are on the center's side.
    fn has_all_on_inner_side(&self, corners: &[DVec2]) -> bool {
        corners
            .iter()
            .all(|corner| self.normal.dot(*corner) <= self.distance + BORDER + 1e-6 * corner.length())
    }
}

/// Surfaces near a kernel's center.
struct KernelNeighborhood {
    point: DVec3,
    normal: DVec3,
    radius: f64,
    /// Tangents, divided by the radius.
    tangents: [DVec3; 2],
    /// Pieces of the kernel's plane that receive photons.
    pieces: ArrayVec<FlatPolygon, PIECES>,
    /// Number of surfaces that each cover the whole kernel.
    whole: u32,
    walls: ArrayVec<Wall, WALLS>,
}

impl KernelNeighborhood {
    fn new(look: &GatherPoint, radius: f32) -> Self {
        let Frame { s, t, n } = Frame::from_normal(look.normal);
        let radius = f64::from(radius);
        Self {
            point: look.point.as_dvec3(),
            normal: n.as_dvec3(),
            radius,
            tangents: [s, t].map(|axis| axis.as_dvec3() / radius),
            pieces: ArrayVec::new(),
            whole: 0,
            walls: ArrayVec::new(),
        }
    }

    /// Projects a vector onto the plane, in units of the radius.
    #[inline]
    fn project_vector(&self, vector: DVec3) -> DVec2 {
        DVec2::new(self.tangents[0].dot(vector), self.tangents[1].dot(vector))
    }

    /// A piece's corners, projected onto the plane relative to the center, in units of the radius.
    #[inline]
    fn project_polygon(&self, piece: &FlatPolygon) -> ArrayVec<DVec2, 4> {
        piece.iter().map(|&corner| self.project_vector(corner - self.point)).collect()
    }

    /// Returns the kernel's weight over the pieces, or `None` if a wall separates the pieces or if they
    /// overlap.
    fn coverage(&self) -> Option<f64> {
        if !self.walls.is_empty() && self.whole > 0 {
            return None;
        }
        let mut part = f64::from(self.whole);
        for piece in &self.pieces {
            let corners = self.project_polygon(piece);
            if !self.walls.iter().all(|wall| wall.has_all_on_inner_side(&corners)) {
                return None;
            }
            part += kernel_integral_over_polygon(&corners);
        }
        (MIN_COVERAGE..=1.0 + MIN_PLANE_SEPARATION).contains(&part).then_some(part.min(1.0))
    }

    /// Adds a shape and returns whether the coverage still has a closed form. `receives` returns whether
    /// photons are stored on the front (`true`) or the back.
    fn add_shape(&mut self, shape: &Shape, receives: impl Fn(bool) -> bool) -> bool {
        match shape.polygons_or_surface_near(self.point) {
            NearbyGeometry::Polygons(count) => (0..count)
                .filter_map(|number| shape.nth_polygon_face(number))
                .all(|piece| self.add_polygon_piece_or_wall(piece, &receives)),
            NearbyGeometry::Surface { distance, ground } => {
                distance > SEARCH_RADIUS * self.radius
                    || ground.is_some_and(|ground| self.try_add_covering_surface(&ground, receives))
            }
        }
    }

    /// Adds a surface if it extends over the whole kernel and has the kernel's normal. Otherwise, returns
    /// false.
    fn try_add_covering_surface(&mut self, ground: &NearestSurface, receives: impl Fn(bool) -> bool) -> bool {
        let is_wide = match ground.extent {
            FlatOrRoundExtent::Flat(reach) => reach > SEARCH_RADIUS * self.radius,
            FlatOrRoundExtent::Round(radius) => radius > WIDE * self.radius,
        };
        let cosine = ground.normal.dot(self.normal);
        let is_same = cosine.abs() > SAME_PLANE && ground.height < MIN_PLANE_SEPARATION * self.radius;
        self.whole += u32::from(is_wide && is_same && receives(cosine > 0.0));
        is_wide && is_same
    }

    /// Adds the triangles of a mesh and returns whether the coverage still has a closed form.
    fn add_mesh(
        &mut self,
        (world, id): (&World, u32),
        mesh: &MeshInstance,
        bounds: &Aabb,
        is_crowded: &mut bool,
    ) -> bool {
        let mut near: ArrayVec<u32, TRIANGLES> = ArrayVec::new();
        // Trees may visit a triangle twice, and may also visit nearby triangles outside the box. Skip
        // repeated and distant triangles so that the result does not depend on the tree.
        let is_exact = mesh.visit_triangles_in_box(bounds, |triangle| {
            let is_known = near.contains(&triangle);
            is_known
                || !Aabb::from_points_f64(mesh.world_corners(triangle)).overlaps(bounds)
                || near.try_push(triangle).is_ok()
        });
        if !is_exact {
            *is_crowded = true;
            return false;
        }
        near.sort_unstable();
        near.iter().all(|&triangle| {
            let piece = mesh.world_corners(triangle).into_iter().collect();
            self.add_polygon_piece_or_wall(piece, |is_front| {
                can_store_photons(primitive_material(world, id, triangle), is_front)
            })
        })
    }

    /// Adds a flat piece and returns whether the coverage still has a closed form.
    fn add_polygon_piece_or_wall(&mut self, piece: FlatPolygon, receives: impl Fn(bool) -> bool) -> bool {
        let normal = (piece[1] - piece[0]).cross(piece[2] - piece[0]);
        let from = piece[0] - self.point;
        let (size, distance, cosine) = (normal.length_squared(), normal.dot(from), normal.dot(self.normal));
        let is_within =
            |radii: f64| distance * distance < (radii * self.radius) * (radii * self.radius) * size;
        // Ignore pieces that are too far away or have no area.
        if !(size > 0.0 && is_within(SEARCH_RADIUS)) {
            return true;
        }
        if cosine * cosine > SAME_PLANE * SAME_PLANE * size && is_within(MIN_PLANE_SEPARATION) {
            return !receives(cosine > 0.0) || self.pieces.try_push(piece).is_ok();
        }
        let heights = piece.iter().map(|&corner| self.normal.dot(corner - self.point));
        let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
        let (reach, rises) =
            (f64::from(MAX_PLANE_DISTANCE) * self.radius, high > MIN_PLANE_SEPARATION * self.radius);
        let is_steep = cosine * cosine <= f64::from(MIN_COSINE * MIN_COSINE) * size;
        if high < -reach
            || low > reach
            || !rises && (is_steep || !receives(cosine > 0.0))
            || !polygon_overlaps_unit_disk(&self.project_polygon(&piece))
        {
            return true;
        }
        rises && self.add_wall(normal / size.sqrt(), distance / size.sqrt())
    }

    /// Adds a wall, given its plane's normal and signed distance from the center.
    fn add_wall(&mut self, normal: DVec3, distance: f64) -> bool {
        let along = self.project_vector(normal) * (self.radius * distance.signum());
        let length = along.length();
        let wall = Wall { normal: along / length, distance: distance.abs() / (length * self.radius) };
        normal.dot(self.normal).abs() < UPRIGHT
            && wall.distance > MIN_PLANE_SEPARATION
            && self.walls.try_push(wall).is_ok()
    }
}

/// Whether a polygon overlaps the unit disk.
fn polygon_overlaps_unit_disk(corners: &[DVec2]) -> bool {
    let edges = || corners.iter().zip(corners.iter().cycle().skip(1));
    let is_near = |a: DVec2, b: DVec2| {
        let way = b - a;
        let along = (-a.dot(way) / way.length_squared()).clamp(0.0, 1.0);
        (a + way * along).length_squared() < 1.0
    };
    let left = edges().filter(|(a, b)| a.perp_dot(**b) > 0.0).count();
    left == 0 || left == corners.len() || edges().any(|(&a, &b)| is_near(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::OrientedBox;
    use crate::geometry::parallelogram::Parallelogram;
    use crate::geometry::sphere::Sphere;
    use crate::math::Vec3;

    /// Coverage of an upward-facing kernel of radius 0.1 at (x, 0, z) among shapes.
    fn coverage_at(x: f32, z: f32, shapes: &[&Shape]) -> Option<f64> {
        let look = GatherPoint { point: Vec3::new(x, 0.0, z), normal: Vec3::Y, max_depth: 1 };
        let mut around = KernelNeighborhood::new(&look, 0.1);
        let is_exact = shapes.iter().all(|shape| around.add_shape(shape, |_| true));
        around.coverage().filter(|_| is_exact)
    }

    fn quad(corner: DVec3, u: DVec3, v: DVec3) -> Shape {
        Shape::Quad(Parallelogram::new(corner, u, v))
    }

    #[test]
    fn only_flat_pieces_have_a_closed_form() {
        let floor = &quad(DVec3::ZERO, DVec3::Z, DVec3::X);
        let other = &quad(DVec3::X, DVec3::Z, DVec3::X);
        let wall = &quad(DVec3::ZERO, DVec3::Y, DVec3::Z);
        let back = &quad(DVec3::ZERO, DVec3::X, DVec3::Y);
        let near = |told: Option<f64>, exact: f64| told.is_some_and(|told| (told - exact).abs() < 1e-5);
        assert_eq!(coverage_at(0.5, 0.5, &[floor, wall]), Some(1.0));
        assert!(near(coverage_at(1.0, 0.5, &[floor]), 0.5), "{:?}", coverage_at(1.0, 0.5, &[floor]));
        assert!(near(coverage_at(1.0, 0.5, &[floor, other]), 1.0));
        assert!(near(
            coverage_at(0.05, 0.5, &[floor, wall]),
            1.0 - coverage_at(-0.05, 0.5, &[floor]).expect("flat")
        ));
        assert!(near(
            coverage_at(0.0005, 0.0005, &[floor, wall, back]),
            coverage_at(0.0005, 0.0005, &[floor]).expect("flat")
        ));
        // A wall between two pieces, a box on the floor, a sheet above the floor, and a ball on the floor.
        assert_eq!(coverage_at(0.95, 0.5, &[floor, other, &quad(DVec3::X, DVec3::Y, DVec3::Z)]), None);
        let cuboid = Shape::Box(OrientedBox::new(DVec3::new(0.5, 0.1, 0.5), DVec3::splat(0.2), DVec3::ZERO));
        assert_eq!(coverage_at(0.35, 0.5, &[floor, &cuboid]), None);
        assert_eq!(coverage_at(0.25, 0.5, &[floor, &cuboid]), Some(1.0));
        let sheet = quad(DVec3::new(0.4, 0.01, 0.4), DVec3::Z * 0.2, DVec3::X * 0.2);
        assert_eq!(coverage_at(0.35, 0.5, &[floor, &sheet]), None);
        let ball = |radius: f64| Shape::Sphere(Sphere { center: DVec3::new(0.5, radius, 0.5), radius });
        assert_eq!(coverage_at(0.45, 0.5, &[floor, &ball(0.1)]), None);
        // Kernels on large and small balls.
        let under = |radius: f64| Shape::Sphere(Sphere { center: DVec3::new(0.5, -radius, 0.5), radius });
        assert_eq!(
            (coverage_at(0.5, 0.5, &[&under(1.0)]), coverage_at(0.5, 0.5, &[&under(0.15)])),
            (Some(1.0), None)
        );
    }
}
