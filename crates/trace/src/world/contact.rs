//! Coincident surfaces: surfaces so close together that a ray's hits cannot be ordered.
//!
//! Touching surfaces coincide up to rounding. A ray that hits one of them is treated as hitting every surface
//! within the hit's error bound. The ray crosses all of them at the same time, from a point guaranteed to be
//! in front of them to a point guaranteed to be behind them. New rays start at one of these two points, so
//! that no surface is missed or hit twice.

use arrayvec::ArrayVec;

use super::isolated::triangle_overlaps_box;
use super::{Geometry, Hit, MeshInstance, Object, World};
use crate::accel::PrimitiveOrSubtreeAroundBox;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Aabb, Ray, Shape, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::math::{DVec3, Vec3};

/// Maximum number of recorded solids around a ray. Only the last solids in file order are recorded.
pub const MAX_INTERIORS: usize = 4;

/// The last closed glass shapes in a subtree, in descending order. Other shapes in the subtree that enclose
/// the same point have no effect there.
pub(super) type LastClosedGlassIdsInSubtree = ArrayVec<u32, MAX_INTERIORS>;

/// Two points, one on each side of coincident surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetPoints {
    /// The point on the incoming ray's side.
    pub before: Vec3,
    /// The point on the far side.
    pub beyond: Vec3,
}

impl OffsetPoints {
    /// Returns the segment from `before` to `beyond`, which ends at t = 1.
    pub fn segment_from_before_to_beyond(&self) -> Ray {
        Ray { t_max: 1.0, ..Ray::new(self.before, self.beyond - self.before) }
    }
}

/// A shape around the far point, or a surface between the two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CoincidentOrEnclosingSurface {
    /// A glass shape that encloses [`OffsetPoints::beyond`].
    Around {
        /// Index of the shape's object.
        object: u32,
        /// Material of the shape.
        material: u32,
    },
    /// Any other surface that the segment between the points hits.
    Surface {
        /// The hit along the segment.
        hit: Hit,
        /// Material of the surface.
        material: u32,
        /// Whether `before` is on the surface's front side or, for glass, outside the solid.
        is_front: bool,
    },
}

/// Reusable buffers for candidate surfaces.
#[derive(Debug, Default)]
pub struct CoincidenceScratch {
    objects: Vec<u32>,
    /// Pairs of object and triangle indices.
    triangles: Vec<(u32, u32)>,
}

/// A query for coincident surfaces at a hit.
#[derive(Clone, Copy, Debug)]
pub struct CoincidenceQuery<'a> {
    /// A hit on one of the surfaces.
    pub hit: &'a Hit,
    /// The surface at the hit.
    pub surface: &'a SurfacePoint,
    /// The surface normal, facing the incoming ray.
    pub normal: Vec3,
    /// Distance in front of the hit within which surfaces may have been missed: the rounding error of the
    /// ray's t along the normal.
    pub lead: f32,
}

/// The offset points, and the near point without the added `lead` distance.
#[derive(Clone, Copy)]
struct CoincidenceTestSegment {
    sides: OffsetPoints,
    close: Vec3,
}

impl CoincidenceTestSegment {
    /// Value of t at `close` along the segment.
    fn close_point_t(&self) -> f32 {
        let way = self.sides.segment_from_before_to_beyond().direction;
        (self.close - self.sides.before).dot(way) / way.length_squared()
    }
}

impl World {
    /// Finds all coincident surfaces at a hit, and one point on each side of them. `visit` is called in an
    /// order that depends only on the scene.
    #[inline]
    pub fn find_coincident_surfaces_at(
        &self,
        at: &CoincidenceQuery<'_>,
        memory: &mut CoincidenceScratch,
        visit: impl FnMut(CoincidentOrEnclosingSurface),
    ) -> OffsetPoints {
        let margin = self.geometry.coincidence_margin(at);
        let error = if self.geometry.is_hit_isolated(at.hit, at.surface, margin) {
            if self.is_glass_thicker_than(at, margin) {
                return self.visit_glass_entered_at_isolated_hit(at, visit);
            }
            self.geometry.set_hit_as_only_candidate(at, memory)
        } else {
            self.collect_surfaces_near_hit(at, memory)
        };
        self.visit_coincident_surfaces(at, (memory, error), visit)
    }

    /// Collects surfaces that may coincide with the hit point or enclose it, and returns their error bound
    /// per axis.
    pub fn collect_surfaces_near_hit(
        &self,
        at: &CoincidenceQuery<'_>,
        memory: &mut CoincidenceScratch,
    ) -> Vec3 {
        self.geometry.collect_surfaces_near_hit(at, memory, &self.enclosing_glass)
    }

    /// Whether the hit is on a glass shape whose far side is not close to the hit point.
    fn is_glass_thicker_than(&self, at: &CoincidenceQuery<'_>, margin: Vec3) -> bool {
        let far = 8.0 * f64::from(margin.max_element());
        let is_away = match &self.geometry.objects()[at.hit.object as usize] {
            Object::Shape(shape) => shape.is_locally_thicker_than(at.surface.point.as_dvec3(), far),
            Object::Mesh(_) => false,
        };
        is_away && self.is_glass_material(self.material_index(at.hit) as u32)
    }

    /// Fast path for [`World::visit_coincident_surfaces`] if [`World::is_glass_thicker_than`] is true and
    /// nothing else is nearby. In this case, only the incoming ray's side matters.
    fn visit_glass_entered_at_isolated_hit(
        &self,
        at: &CoincidenceQuery<'_>,
        mut visit: impl FnMut(CoincidentOrEnclosingSurface),
    ) -> OffsetPoints {
        let SurfacePoint { point, error, normal, .. } = *at.surface;
        let object = at.hit.object;
        if normal.dot(at.normal) > 0.0 {
            visit(CoincidentOrEnclosingSurface::Around {
                object,
                material: self.material_index(at.hit) as u32,
            });
        }
        OffsetPoints {
            before: offset_origin(point, error, at.normal, at.normal),
            beyond: offset_origin(point, error, at.normal, -at.normal),
        }
    }

    /// Computes the offset points and visits the coincident surfaces among the candidates in `memory`, whose
    /// error is at most `error`.
    pub fn visit_coincident_surfaces(
        &self,
        at: &CoincidenceQuery<'_>,
        (memory, error): (&CoincidenceScratch, Vec3),
        mut visit: impl FnMut(CoincidentOrEnclosingSurface),
    ) -> OffsetPoints {
        let geometry = &self.geometry;
        let (point, normal) = (at.surface.point, at.normal);
        let sides = OffsetPoints {
            before: offset_origin(point, error + normal.abs() * at.lead, normal, normal),
            beyond: offset_origin(point, error, normal, -normal),
        };
        let probe = CoincidenceTestSegment { sides, close: offset_origin(point, error, normal, normal) };
        let lead_end = probe.close_point_t();
        let mut is_led = false;
        let mut found = |near: CoincidentOrEnclosingSurface| {
            is_led |= match near {
                CoincidentOrEnclosingSurface::Around { .. } => false,
                CoincidentOrEnclosingSurface::Surface { hit, .. } => hit.shape.t <= lead_end,
            };
            visit(near);
        };
        let mut closed_lead = false;
        for &id in &memory.objects {
            if let Object::Shape(shape) = &geometry.objects()[id as usize] {
                let points = [sides.before, probe.close, sides.beyond].map(|point| point.as_dvec3());
                let inside = shape.encloses_points_if_closed(points);
                closed_lead |= inside.is_some_and(|[before, close, _]| before != close);
                let is_around = inside.map(|[_, _, beyond]| beyond);
                self.test_shape_at_offset_points(shape, id, (&sides, is_around))
                    .into_iter()
                    .for_each(&mut found);
            }
        }
        let ends = [sides.before, sides.beyond].map(|end| end.as_dvec3());
        for &(object, triangle) in &memory.triangles {
            let mesh = geometry.objects()[object as usize].mesh();
            if let Some((shape, is_front)) =
                mesh.and_then(|mesh| mesh.intersect_segment_with_triangle(triangle, ends))
            {
                let hit = Hit { shape, object };
                found(self.wrap_coincident_hit(hit, self.material_index(&hit) as u32, is_front));
            }
        }
        if is_led || closed_lead { sides } else { OffsetPoints { before: probe.close, ..sides } }
    }

    /// Returns the shape if its surface is between the points, or if it is glass and encloses
    /// [`OffsetPoints::beyond`]. `is_around` is `None` for open shapes.
    fn test_shape_at_offset_points(
        &self,
        shape: &Shape,
        object: u32,
        (sides, is_around): (&OffsetPoints, Option<bool>),
    ) -> Option<CoincidentOrEnclosingSurface> {
        let material = self.material_index(&Hit { shape: ShapeHit::from_t(0.0), object }) as u32;
        if let (true, Some(is_around)) = (self.is_glass_material(material), is_around) {
            return is_around.then_some(CoincidentOrEnclosingSurface::Around { object, material });
        }
        let ray = sides.segment_from_before_to_beyond().to_f64();
        let bare = SurfaceRequest { uv: false, shadow_point: false };
        let own = shape.intersect(&ray)?;
        let is_front =
            shape.surface_point_with_fields(&ray, &own, bare).normal.as_dvec3().dot(ray.direction) < 0.0;
        Some(self.wrap_coincident_hit(Hit { shape: own, object }, material, is_front))
    }

    fn wrap_coincident_hit(&self, hit: Hit, material: u32, is_front: bool) -> CoincidentOrEnclosingSurface {
        let is_inside_out = self.is_glass_material(material) && self.glass_solids.is_inside_out(hit.object);
        CoincidentOrEnclosingSurface::Surface { hit, material, is_front: is_front != is_inside_out }
    }

    /// The object that represents the glass solid of `object`: the solid's last object in file order.
    pub fn solid_id(&self, object: u32) -> u32 {
        self.glass_solids.solid_id(object)
    }

    /// Whether any glass solid is open, in which case it may be unknown whether a ray is inside glass.
    pub fn has_open_glass(&self) -> bool {
        self.has_open_glass
    }

    /// Whether a glass solid is open.
    pub fn is_glass_solid_open(&self, body: u32) -> bool {
        self.glass_solids.is_open(body)
    }

    /// Whether a material is glass.
    pub fn is_glass_material(&self, material: u32) -> bool {
        self.materials[material as usize].bsdf.as_dielectric().is_some()
    }

    /// Whether the object is a closed shape, for which point containment can be tested. For other objects,
    /// rays must track the glass they have entered.
    pub fn is_closed_shape(&self, object: u32) -> bool {
        match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.is_closed(),
            Object::Mesh(_) => false,
        }
    }

    /// Closed glass shapes and their materials.
    pub fn closed_glass_shapes(&self) -> impl Iterator<Item = (u32, u32)> {
        (0..self.geometry.objects().len() as u32).filter_map(|id| {
            let material = self.material_index(&Hit { shape: ShapeHit::from_t(0.0), object: id }) as u32;
            (self.is_closed_shape(id) && self.is_glass_material(material)).then_some((id, material))
        })
    }

    /// The [`LastClosedGlassIdsInSubtree`] of each subtree, or an empty list if few objects are nested.
    pub(super) fn closed_glass_shapes_by_subtree(&self) -> Box<[LastClosedGlassIdsInSubtree]> {
        let is_glass = |id: u32| {
            let material = self.material_index(&Hit { shape: ShapeHit::from_t(0.0), object: id }) as u32;
            self.is_closed_shape(id) && self.is_glass_material(material)
        };
        self.geometry.finite_object_tree().n_highest_ids_by_subtree(is_glass).into()
    }

    /// Whether an object is a closed shape that contains a point.
    pub fn is_closed_shape_containing(&self, object: u32, point: Vec3) -> bool {
        match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.encloses_point_if_closed(point.as_dvec3()) == Some(true),
            Object::Mesh(_) => false,
        }
    }
}

impl Geometry {
    /// Search distance for coincident surfaces, as a multiple of the point's error.
    const REACH: f32 = 16.0;

    /// Search distance for coincident surfaces along each axis.
    pub fn coincidence_margin(&self, at: &CoincidenceQuery<'_>) -> Vec3 {
        (at.surface.error * Self::REACH).max(Vec3::splat(self.max_mesh_rounding_error() + 2.0 * at.lead))
    }

    /// Makes the hit itself the only candidate. Returns its error bound per axis.
    pub fn set_hit_as_only_candidate(
        &self,
        at: &CoincidenceQuery<'_>,
        memory: &mut CoincidenceScratch,
    ) -> Vec3 {
        let Hit { shape, object } = *at.hit;
        memory.objects.clear();
        memory.triangles.clear();
        match &self.objects()[object as usize] {
            Object::Shape(_) => {
                memory.objects.push(object);
                at.surface.error
            }
            Object::Mesh(mesh) => {
                memory.triangles.push((object, shape.primitive));
                at.surface.error.max(mesh.triangle_position_error(shape.primitive, at.surface.point))
            }
        }
    }

    /// Collects shapes and triangles that may coincide with the hit point, and returns their error bound per
    /// axis. Shapes that enclose the point but whose surfaces are far away are included only if `enclosing`
    /// lists them for their subtree.
    pub(super) fn collect_surfaces_near_hit(
        &self,
        at: &CoincidenceQuery<'_>,
        memory: &mut CoincidenceScratch,
        enclosing: &[LastClosedGlassIdsInSubtree],
    ) -> Vec3 {
        let CoincidenceScratch { objects, triangles } = memory;
        objects.clear();
        triangles.clear();
        let point = at.surface.point;
        let near = Aabb { min: point, max: point }.expanded(self.coincidence_margin(at));
        objects.extend(self.unbounded());
        self.finite_object_tree().visit_surfaces_overlapping_box(&near, |met| {
            match met {
                PrimitiveOrSubtreeAroundBox::Primitive(id) => objects.push(id),
                PrimitiveOrSubtreeAroundBox::Enclosing(subtree) => {
                    objects.extend(enclosing.get(subtree).into_iter().flatten());
                }
            }
            true
        });
        let mut error = at.surface.error;
        for &id in &*objects {
            let Object::Mesh(mesh) = &self.objects()[id as usize] else { continue };
            mesh.tree.triangle_tree().visit_triangles_in_box(&mesh.box_to_local(&near), |triangle| {
                if triangle_overlaps_box(mesh.world_corners(triangle), &near) {
                    triangles.push((id, triangle));
                    error = error.max(mesh.triangle_position_error(triangle, point));
                }
            });
        }
        // Trees may visit a triangle more than once.
        triangles.sort_unstable();
        triangles.dedup();
        error
    }
}

impl MeshInstance {
    /// Converts a world-space box to its bounding box in mesh coordinates.
    pub(super) fn box_to_local(&self, bounds: &Aabb) -> Aabb {
        let corner = |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { bounds.min[axis] } else { bounds.max[axis] };
            self.transform.inverse_point(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        };
        Aabb::from_points_f64((0..8).map(corner))
    }

    /// Position error of a triangle near a point, caused by rounding its corners in the file and in the ray
    /// test.
    fn triangle_position_error(&self, triangle: u32, point: Vec3) -> Vec3 {
        let corners = self.tree.loaded_mesh().mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let reach = corners.iter().fold(DVec3::ZERO, |reach, corner| reach.max(corner.abs()));
        let local = self.transform.inverse_point(point.as_dvec3());
        let of_tests = self.to_placed_mesh(&self.transform).point_error_bound(point, local, corners);
        of_tests + self.transform.transform_abs_bound(reach).as_vec3() * f32::EPSILON
    }

    /// Upper bound on the error of any triangle in the mesh.
    pub(super) fn max_rounding_error(&self) -> f32 {
        let local = self.tree.bounds();
        if local.is_empty() {
            return 0.0;
        }
        let reach = self.transform.transform_abs_bound(local.min.abs().max(local.max.abs()).as_dvec3());
        (reach + self.transform.translation.abs()).max_element() as f32 * (16.0 * f32::EPSILON)
    }

    /// Intersects a segment with a triangle in `f64` arithmetic. Returns the hit and whether the front was
    /// hit. At a shared edge, exactly one of the triangles is hit.
    fn intersect_segment_with_triangle(
        &self,
        triangle: u32,
        [from, to]: [DVec3; 2],
    ) -> Option<(ShapeHit, bool)> {
        let [a, b, c] =
            self.tree.loaded_mesh().mesh.corners(triangle).map(|p| self.transform.point(p.as_dvec3()));
        let normal = (b - a).cross(c - a);
        let (start, end) = (normal.dot(from - a), normal.dot(to - a));
        if (start > 0.0) == (end > 0.0) {
            return None;
        }
        let direction = to - from;
        let facing = if start > 0.0 { -1.0 } else { 1.0 };
        // Scaled barycentric coordinate of the corner opposite the edge.
        let beyond = |p: DVec3, q: DVec3| {
            let weight = facing * direction.dot((p - from).cross(q - from));
            let is_own = (p.to_array() < q.to_array()) == (facing > 0.0);
            (weight > 0.0 || weight == 0.0 && is_own).then_some(weight)
        };
        let (wa, wb, wc) = (beyond(b, c)?, beyond(c, a)?, beyond(a, b)?);
        let sum = wa + wb + wc;
        let (t, u, v) = (start / (start - end), wb / sum, wc / sum);
        let hit = ShapeHit { t: t as f32, primitive: triangle, u: u as f32, v: v as f32 };
        (sum > 0.0).then_some((hit, (start > 0.0) != self.transform.flips_handedness()))
    }
}
