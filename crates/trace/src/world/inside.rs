//! Glass around a point: of the camera, or of a lamp.
//!
//! A closed shape knows which points it contains. A body of meshes or of several objects does not: rays from the point to points of
//! its surface tell on which side of it they begin.

use std::collections::{BTreeMap, BTreeSet};

use super::{Hit, Object, ObjectMaterial, World};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Aabb, Ray, ShapeHit, SurfaceRequest};
use crate::math::{DVec3, Vec2, Vec3};

/// Rays that look for the surface of a body, if it has no more objects.
const RAYS: usize = 32;

/// Majority of rays that decides.
const MAJORITY: i32 = 3;

/// Other surfaces that such a ray passes.
const PASSED: usize = 16;

/// A body of glass without a hole, made of meshes or of several objects.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyInParts {
    /// Its place in the order of the file.
    pub body: u32,
    objects: Vec<u32>,
    /// The box around its objects.
    pub bounds: Aabb,
    /// Whether opaque surfaces close it, so that its inside may reach out of the box.
    pub is_covered: bool,
}

impl World {
    /// The closed shapes of glass around a point at the camera, and the bodies that the camera is in, with their materials.
    pub fn glass_around(&self, point: Vec3) -> impl Iterator<Item = (u32, u32)> {
        let is_inside = move |&(object, _): &(u32, u32)| match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.encloses(point.as_dvec3()) == Some(true),
            Object::Mesh(_) => false,
        };
        self.glass_at_eye.iter().copied().filter(is_inside).chain(self.bodies_at_eye.iter().copied())
    }

    /// Whether no part of the lens is in a closed shape of glass, and the camera in no other body.
    pub fn is_eye_in_air(&self) -> bool {
        self.glass_at_eye.is_empty() && self.bodies_at_eye.is_empty()
    }

    /// The closed shapes of glass that the lens may be in, by their objects and materials.
    pub(super) fn find_glass_at_eye(&self) -> Vec<(u32, u32)> {
        let (eye, lens) = (self.camera.position.as_vec3(), Vec3::splat(self.camera.aperture as f32));
        let lens = Aabb { min: eye, max: eye }.grown(lens + eye.abs() * f32::EPSILON);
        let objects = (0_u32..).zip(self.geometry.objects());
        let near = objects.filter_map(|(id, object)| {
            let material = self.material_index(&Hit { shape: ShapeHit::at(0.0), object: id }) as u32;
            let is_near = object.bounds().is_none_or(|bounds| bounds.meets(&lens));
            (is_near && self.is_closed(id) && self.is_glass(material)).then_some((id, material))
        });
        near.collect()
    }

    /// The other bodies of glass that the camera is in, by their places in the order of the file and their materials.
    pub(super) fn find_bodies_at_eye(&self) -> Vec<(u32, u32)> {
        let eye = self.camera.position.as_vec3();
        let at = Aabb { min: eye, max: eye };
        let near =
            self.bodies_in_parts().into_iter().filter(|body| body.is_covered || body.bounds.meets(&at));
        near.filter_map(|body| Some((body.body, self.material_around(&body, eye, None)?))).collect()
    }

    /// The bodies of glass that no single shape closes.
    pub fn bodies_in_parts(&self) -> Vec<BodyInParts> {
        if !self.has_glass {
            return Vec::new();
        }
        let covered = self.bodies.open().iter().filter(|open| open.is_covered);
        let covered: BTreeSet<u32> = covered.map(|open| self.body(open.object)).collect();
        let mut bodies: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for object in 0..self.geometry.objects().len() as u32 {
            let may_be_glass = match self.object_materials[object as usize] {
                ObjectMaterial::One(material) => self.is_glass(material),
                ObjectMaterial::OfFile { .. } => true,
            };
            let body = self.body(object);
            if may_be_glass && !self.is_closed(object) && !self.is_open(body) {
                bodies.entry(body).or_default().push(object);
            }
        }
        let in_parts = |(body, objects): (u32, Vec<u32>)| {
            let bounds =
                objects.iter().filter_map(|&object| self.geometry.objects()[object as usize].bounds());
            let bounds = bounds.fold(Aabb::EMPTY, Aabb::union);
            BodyInParts { body, objects, bounds, is_covered: covered.contains(&body) }
        };
        bodies.into_iter().map(in_parts).collect()
    }

    /// The material of a body around a point, by the side of its surface that most rays from there see. `None` if the point is not in
    /// it, or nothing of it is seen. The point may be on an object, `of`, which then hides nothing.
    pub fn material_around(&self, body: &BodyInParts, point: Vec3, of: Option<u32>) -> Option<u32> {
        let (objects, mut votes, mut material) = (&body.objects, 0_i32, None);
        for ray in 0..RAYS.max(objects.len()) {
            let target = self.geometry.objects()[objects[ray % objects.len()] as usize].some_point(ray);
            let Some((is_back, seen)) = target.and_then(|target| self.seen_side(body, (point, of), target))
            else {
                continue;
            };
            votes += if is_back { 1 } else { -1 };
            material = if is_back { material.or(Some(seen)) } else { material };
            if votes.abs() == MAJORITY {
                break;
            }
        }
        material.filter(|_| votes > 0)
    }

    /// Whether a ray from a point of an object to another point sees a body of glass from its back, and the material there. `None` if
    /// the ray misses it, or leaves it by something opaque that closes it.
    fn seen_side(
        &self,
        body: &BodyInParts,
        (point, of): (Vec3, Option<u32>),
        target: DVec3,
    ) -> Option<(bool, u32)> {
        let mut ray = Ray::new(point, (target - point.as_dvec3()).as_vec3());
        for _ in 0..PASSED {
            let hit = self.geometry.closest(&ray)?;
            let material = self.material_index(&hit) as u32;
            if body.is_covered && !self.is_glass(material) && Some(hit.object) != of {
                return None;
            }
            let bare = SurfaceRequest { uv: false, shadow_point: false };
            let surface = self.geometry.requested_surface(&ray, &hit, bare);
            if self.is_glass(material) && self.body(hit.object) == body.body {
                let is_back = surface.normal.dot(ray.direction) > 0.0;
                return Some((is_back != self.bodies.is_turned(hit.object), material));
            }
            let origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction);
            ray = Ray::new(origin, ray.direction);
        }
        None
    }
}

impl Object {
    /// A point of the surface, for each number another one. `None` if the object has no area.
    fn some_point(&self, number: usize) -> Option<DVec3> {
        match self {
            Self::Shape(shape) => {
                let areas = shape.areas();
                let parts: Vec<usize> = (0..areas.len()).filter(|&part| areas[part] > 0.0).collect();
                let part = *parts.get(number % parts.len().max(1))?;
                let u = Vec2::new(0.618_034, 0.754_877_7) * (number as f32 + 0.5);
                Some(shape.sample(part as u32, u.fract()).point)
            }
            Self::Mesh(mesh) => {
                let count = mesh.triangle_count();
                let triangle = (number * 7919).checked_rem(count)?;
                let [a, b, c] = mesh.world_corners(triangle as u32);
                Some(a * 0.39 + b * 0.33 + c * 0.28)
            }
        }
    }
}
