//! Surfaces in contact at a point, so near to each other that no ray can decide which comes first.
//!
//! The positions of touching surfaces are equal within rounding. A ray that hits one of them hits all surfaces within the
//! error of the hit. It crosses them together, on the way from a point that is certainly before all of them to one that is
//! certainly beyond. Rays that leave start at these two points, so that none is missed and none is hit again.

use super::isolated::meets;
use super::{Geometry, Hit, MeshInstance, Object, World};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Aabb, Ray, Shape, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::math::{DVec3, Vec3};

/// The points on both sides of surfaces that touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides {
    /// The point on the side from which a ray comes.
    pub before: Vec3,
    /// The point on the other side.
    pub beyond: Vec3,
}

impl Sides {
    /// The way from one to the other; t = 1 is its end.
    pub fn ray(&self) -> Ray {
        Ray { t_max: 1.0, ..Ray::new(self.before, self.beyond - self.before) }
    }
}

/// A surface or shape at or between the two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Near {
    /// A shape of glass that encloses the point beyond.
    Around {
        /// Its object.
        object: u32,
        /// Its material.
        material: u32,
    },
    /// Any other surface, as the ray between the points hits it.
    Surface {
        /// Hit of that ray.
        hit: Hit,
        /// Its material.
        material: u32,
        /// Whether its front, or for glass the outside of its body, is on the side of the point before.
        is_front: bool,
    },
}

/// Memory for candidates that may be near.
#[derive(Debug, Default)]
pub struct NearMemory {
    objects: Vec<u32>,
    /// Objects and their triangles.
    triangles: Vec<(u32, u32)>,
}

/// Query for a contact.
#[derive(Clone, Copy, Debug)]
pub struct Meeting<'a> {
    /// The hit of one of the surfaces.
    pub hit: &'a Hit,
    /// A point of that surface.
    pub surface: &'a SurfacePoint,
    /// Its normal on the side from which a ray comes.
    pub normal: Vec3,
    /// Distance before it within which surfaces may have been missed: the rounding of the ray's t along the normal.
    pub lead: f32,
}

/// The points before and beyond, and the one before without the lead.
#[derive(Clone, Copy)]
struct Probe {
    sides: Sides,
    close: Vec3,
}

impl Probe {
    /// Fraction of the way that is a little more than that to the close point.
    fn lead_end(&self) -> f32 {
        let way = self.sides.ray().direction;
        (self.close - self.sides.before).dot(way) / way.length_squared()
    }
}

impl World {
    /// Finds the sides of all surfaces that touch at a point, and visits these in an order that depends on the scene
    /// alone.
    #[inline]
    pub fn contact(&self, at: &Meeting<'_>, memory: &mut NearMemory, visit: impl FnMut(Near)) -> Sides {
        let margin = self.geometry.margin(at);
        let error = if self.geometry.is_isolated(at.hit, at.surface, margin) {
            if self.is_far_side_away(at, margin) {
                return self.contact_of_one_side(at, visit);
            }
            self.geometry.only(at, memory)
        } else {
            self.geometry.search(at, memory)
        };
        self.contact_of(at, (memory, error), visit)
    }

    /// Whether a hit is that of a shape of glass whose other sides are far from the surfaces near the point.
    fn is_far_side_away(&self, at: &Meeting<'_>, margin: Vec3) -> bool {
        let far = 8.0 * f64::from(margin.max_element());
        let is_away = match &self.geometry.objects()[at.hit.object as usize] {
            Object::Shape(shape) => shape.is_far_side_beyond(at.surface.point.as_dvec3(), far),
            Object::Mesh(_) => false,
        };
        is_away && self.is_glass(self.material_index(at.hit) as u32)
    }

    /// [`World::contact_of`] where [`World::is_far_side_away`], with nothing else near: the side from which the ray comes decides
    /// everything.
    fn contact_of_one_side(&self, at: &Meeting<'_>, mut visit: impl FnMut(Near)) -> Sides {
        let SurfacePoint { point, error, normal, .. } = *at.surface;
        let object = at.hit.object;
        if normal.dot(at.normal) > 0.0 {
            visit(Near::Around { object, material: self.material_index(at.hit) as u32 });
        }
        Sides {
            before: offset_origin(point, error, at.normal, at.normal),
            beyond: offset_origin(point, error, at.normal, -at.normal),
        }
    }

    /// Finds the sides among the given candidates, whose points may be in error by at most `error`.
    pub(super) fn contact_of(
        &self,
        at: &Meeting<'_>,
        (memory, error): (&NearMemory, Vec3),
        mut visit: impl FnMut(Near),
    ) -> Sides {
        let geometry = &self.geometry;
        let (point, normal) = (at.surface.point, at.normal);
        let sides = Sides {
            before: offset_origin(point, error + normal.abs() * at.lead, normal, normal),
            beyond: offset_origin(point, error, normal, -normal),
        };
        let probe = Probe { sides, close: offset_origin(point, error, normal, normal) };
        let lead_end = probe.lead_end();
        let mut is_led = false;
        let mut found = |near: Near| {
            is_led |= match near {
                Near::Around { .. } => false,
                Near::Surface { hit, .. } => hit.shape.t <= lead_end,
            };
            visit(near);
        };
        let mut closed_lead = false;
        for &id in &memory.objects {
            if let Object::Shape(shape) = &geometry.objects()[id as usize] {
                let points = [sides.before, probe.close, sides.beyond].map(|point| point.as_dvec3());
                let inside = shape.encloses_each(points);
                closed_lead |= inside.is_some_and(|[before, close, _]| before != close);
                let is_around = inside.map(|[_, _, beyond]| beyond);
                self.near_shape(shape, id, (&sides, is_around)).into_iter().for_each(&mut found);
            }
        }
        let ends = [sides.before, sides.beyond].map(|end| end.as_dvec3());
        for &(object, triangle) in &memory.triangles {
            let mesh = geometry.objects()[object as usize].mesh();
            if let Some((shape, is_front)) = mesh.and_then(|mesh| mesh.crossed(triangle, ends)) {
                let hit = Hit { shape, object };
                found(self.surface_near(hit, self.material_index(&hit) as u32, is_front));
            }
        }
        if is_led || closed_lead { sides } else { Sides { before: probe.close, ..sides } }
    }

    /// A shape between the sides, or around the point beyond, if that is known of it.
    fn near_shape(
        &self,
        shape: &Shape,
        object: u32,
        (sides, is_around): (&Sides, Option<bool>),
    ) -> Option<Near> {
        let material = self.material_index(&Hit { shape: ShapeHit::at(0.0), object }) as u32;
        if let (true, Some(is_around)) = (self.is_glass(material), is_around) {
            return is_around.then_some(Near::Around { object, material });
        }
        let ray = sides.ray().to_f64();
        let bare = SurfaceRequest { uv: false, shadow_point: false };
        let own = shape.intersect(&ray)?;
        let is_front = shape.requested_surface(&ray, &own, bare).normal.as_dvec3().dot(ray.direction) < 0.0;
        Some(self.surface_near(Hit { shape: own, object }, material, is_front))
    }

    fn surface_near(&self, hit: Hit, material: u32, is_front: bool) -> Near {
        let is_turned = self.is_glass(material) && self.bodies.is_turned(hit.object);
        Near::Surface { hit, material, is_front: is_front != is_turned }
    }

    /// The body of glass that an object is of, by its place in the order of the file.
    pub fn body(&self, object: u32) -> u32 {
        self.bodies.place(object)
    }

    /// Whether any body of glass is open, so that rays cannot know whether they are inside it.
    pub fn has_open_glass(&self) -> bool {
        self.has_open_glass
    }

    /// Whether the body of glass at a place is open.
    pub fn is_open(&self, body: u32) -> bool {
        self.bodies.is_open(body)
    }

    /// Whether a material is glass.
    pub fn is_glass(&self, material: u32) -> bool {
        self.materials[material as usize].bsdf.glass().is_some()
    }

    /// Whether an object by itself determines its inside; around other objects, rays must remember the glass.
    pub fn is_closed(&self, object: u32) -> bool {
        match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.is_closed(),
            Object::Mesh(_) => false,
        }
    }

    /// The closed shapes of glass, by their objects and materials.
    pub fn closed_glasses(&self) -> impl Iterator<Item = (u32, u32)> {
        (0..self.geometry.objects().len() as u32).filter_map(|id| {
            let material = self.material_index(&Hit { shape: ShapeHit::at(0.0), object: id }) as u32;
            (self.is_closed(id) && self.is_glass(material)).then_some((id, material))
        })
    }

    /// Whether an object is a shape that contains a point.
    pub fn encloses(&self, object: u32, point: Vec3) -> bool {
        match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.encloses(point.as_dvec3()) == Some(true),
            Object::Mesh(_) => false,
        }
    }
}

impl Geometry {
    /// Distance within which touching surfaces are searched, in errors of the point.
    const REACH: f32 = 16.0;

    /// Distance along each axis within which surfaces that touch a point are searched.
    pub(super) fn margin(&self, at: &Meeting<'_>) -> Vec3 {
        (at.surface.error * Self::REACH).max(Vec3::splat(self.mesh_rounding() + 2.0 * at.lead))
    }

    /// Collects the hit itself as the only candidate; returns a bound on each component's distance to it.
    pub(super) fn only(&self, at: &Meeting<'_>, memory: &mut NearMemory) -> Vec3 {
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
                at.surface.error.max(mesh.touch_error(shape.primitive, at.surface.point))
            }
        }
    }

    /// Collects the shapes and triangles of meshes that may touch a point; returns a bound on each component's distance to them.
    pub(super) fn search(&self, at: &Meeting<'_>, memory: &mut NearMemory) -> Vec3 {
        let NearMemory { objects, triangles } = memory;
        objects.clear();
        triangles.clear();
        let point = at.surface.point;
        let near = Aabb { min: point, max: point }.grown(self.margin(at));
        objects.extend(self.unbounded());
        self.tree().meeting(&near, |id| objects.push(id));
        let mut error = at.surface.error;
        for &id in &*objects {
            let Object::Mesh(mesh) = &self.objects()[id as usize] else { continue };
            mesh.tree.triangles().meeting(&mesh.local_box(&near), |triangle| {
                if meets(mesh.world_corners(triangle), &near) {
                    triangles.push((id, triangle));
                    error = error.max(mesh.touch_error(triangle, point));
                }
            });
        }
        // Some are visited more than once.
        triangles.sort_unstable();
        triangles.dedup();
        error
    }
}

impl MeshInstance {
    /// A box of the world in the mesh's coordinates.
    pub(super) fn local_box(&self, bounds: &Aabb) -> Aabb {
        let corner = |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { bounds.min[axis] } else { bounds.max[axis] };
            self.transform.inverse_point(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        };
        Aabb::around_f64((0..8).map(corner))
    }

    /// Error of a triangle near a point: rounding of its corners in the file, and of ray tests there.
    fn touch_error(&self, triangle: u32, point: Vec3) -> Vec3 {
        let corners = self.tree.loaded().mesh.corners(triangle).map(|corner| corner.as_dvec3());
        let reach = corners.iter().fold(DVec3::ZERO, |reach, corner| reach.max(corner.abs()));
        let local = self.transform.inverse_point(point.as_dvec3());
        let of_tests = self.placed(&self.transform).error(point, local, corners);
        of_tests + self.transform.reach(reach).as_vec3() * f32::EPSILON
    }

    /// Upper bound on the error of any triangle near it.
    pub(super) fn rounding(&self) -> f32 {
        let local = self.tree.bounds();
        if local.is_empty() {
            return 0.0;
        }
        let reach = self.transform.reach(local.min.abs().max(local.max.abs()).as_dvec3());
        (reach + self.transform.translation.abs()).max_element() as f32 * (16.0 * f32::EPSILON)
    }

    /// Crossing of a triangle on the way from one point to another, and whether it is from the front; decided in `f64`.
    /// Of triangles that share an edge, one is crossed there.
    fn crossed(&self, triangle: u32, [from, to]: [DVec3; 2]) -> Option<(ShapeHit, bool)> {
        let [a, b, c] = self.tree.loaded().mesh.corners(triangle).map(|p| self.transform.point(p.as_dvec3()));
        let normal = (b - a).cross(c - a);
        let (start, end) = (normal.dot(from - a), normal.dot(to - a));
        if (start > 0.0) == (end > 0.0) {
            return None;
        }
        let direction = to - from;
        let facing = if start > 0.0 { -1.0 } else { 1.0 };
        // The area beyond an edge: the weight of its corner but for a factor.
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
