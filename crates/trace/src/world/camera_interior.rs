//! Finds the glass around a point, such as the position of the camera or a light.
//!
//! Closed shapes can be tested directly. For a solid made of meshes or several objects, rays are cast from
//! the point toward points on the solid's surface, and a majority vote determines whether the point is
//! inside.

use std::collections::{BTreeMap, BTreeSet};

use super::{Hit, Object, ObjectMaterial, World};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Aabb, Ray, ShapeHit, SurfaceRequest};
use crate::math::{DVec3, Vec2, Vec3};

/// Minimum number of rays to cast.
const MIN_RAYS: usize = 32;

/// Voting stops when the numbers of inside and outside rays differ by this much.
const MAJORITY: i32 = 3;

/// Maximum number of other surfaces that a ray may pass through.
const MAX_PASSED: usize = 16;

/// A closed glass solid made of meshes or several objects.
#[derive(Clone, Debug, PartialEq)]
pub struct CompoundSolid {
    /// The object that represents the solid.
    pub body: u32,
    objects: Vec<u32>,
    /// Bounding box of the solid's objects.
    pub bounds: Aabb,
    /// Whether the solid is closed by opaque surfaces. Its interior may then extend beyond `bounds`.
    pub is_covered: bool,
}

impl World {
    /// Glass around the origin of a camera ray, with its materials: closed shapes that contain the origin,
    /// and other solids that contain the camera or, for parallel rays, the origin.
    pub fn glass_around_lens_point(&self, point: Vec3) -> impl Iterator<Item = (u32, u32)> {
        let is_inside = move |&(object, _): &(u32, u32)| match &self.geometry.objects()[object as usize] {
            Object::Shape(shape) => shape.encloses_point_if_closed(point.as_dvec3()) == Some(true),
            Object::Mesh(_) => false,
        };
        let around_origin = self
            .solids_near_ray_origins
            .iter()
            .filter_map(move |body| Some((body.body, self.glass_material_around_point(body, point, None)?)));
        let around_camera = self.camera_solids.iter().copied();
        self.lens_glass.iter().copied().filter(is_inside).chain(around_camera).chain(around_origin)
    }

    /// Whether all camera rays start outside closed glass shapes and other glass solids.
    pub fn is_camera_in_air(&self) -> bool {
        self.lens_glass.is_empty() && self.camera_solids.is_empty() && self.solids_near_ray_origins.is_empty()
    }

    /// Closed glass shapes in whose bounding boxes camera rays may start, with their materials.
    pub(super) fn find_closed_glass_near_lens(&self) -> Vec<(u32, u32)> {
        let objects = (0_u32..).zip(self.geometry.objects());
        let near = objects.filter_map(|(id, object)| {
            let material = self.material_index(&Hit { shape: ShapeHit::from_t(0.0), object: id }) as u32;
            let is_near = object.bounds().is_none_or(|bounds| self.camera.may_start_rays_in(&bounds));
            (is_near && self.is_closed_shape(id) && self.is_glass_material(material))
                .then_some((id, material))
        });
        near.collect()
    }

    /// Other glass solids in which parallel rays may start. Each ray must then be tested against them.
    pub(super) fn find_solids_near_ray_origins(&self) -> Vec<CompoundSolid> {
        if !self.camera.has_parallel_rays() {
            return Vec::new();
        }
        let mut solids = self.find_compound_glass_solids();
        solids.retain(|body| body.is_covered || self.camera.may_start_rays_in(&body.bounds));
        solids
    }

    /// Other glass solids that contain the camera, each with its material at the camera. Empty if rays do not
    /// start at the camera.
    pub(super) fn find_solids_around_camera(&self) -> Vec<(u32, u32)> {
        if self.camera.has_parallel_rays() {
            return Vec::new();
        }
        let eye = self.camera.position.as_vec3();
        let at = Aabb { min: eye, max: eye };
        let near = self
            .find_compound_glass_solids()
            .into_iter()
            .filter(|body| body.is_covered || body.bounds.overlaps(&at));
        near.filter_map(|body| Some((body.body, self.glass_material_around_point(&body, eye, None)?)))
            .collect()
    }

    /// Closed glass solids that consist of meshes or several objects.
    pub fn find_compound_glass_solids(&self) -> Vec<CompoundSolid> {
        if !self.has_glass {
            return Vec::new();
        }
        let covered = self.glass_solids.open_objects().iter().filter(|open| open.is_covered);
        let covered: BTreeSet<u32> = covered.map(|open| self.solid_id(open.object)).collect();
        let mut solids: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for object in 0..self.geometry.objects().len() as u32 {
            let may_be_glass = match self.object_materials[object as usize] {
                ObjectMaterial::One(material) => self.is_glass_material(material),
                ObjectMaterial::OfFile { .. } => true,
            };
            let body = self.solid_id(object);
            if may_be_glass && !self.is_closed_shape(object) && !self.is_glass_solid_open(body) {
                solids.entry(body).or_default().push(object);
            }
        }
        let in_parts = |(body, objects): (u32, Vec<u32>)| {
            let bounds =
                objects.iter().filter_map(|&object| self.geometry.objects()[object as usize].bounds());
            let bounds = bounds.fold(Aabb::EMPTY, Aabb::union);
            CompoundSolid { body, objects, bounds, is_covered: covered.contains(&body) }
        };
        solids.into_iter().map(in_parts).collect()
    }

    /// The glass material around a point, decided by a majority vote among rays cast from the point toward
    /// the solid. Returns `None` if the point is outside the solid or no ray hits it. If the point is on
    /// object `of`, that object does not block the rays.
    pub fn glass_material_around_point(
        &self,
        body: &CompoundSolid,
        point: Vec3,
        of: Option<u32>,
    ) -> Option<u32> {
        let (objects, mut votes, mut material) = (&body.objects, 0_i32, None);
        for ray in 0..MIN_RAYS.max(objects.len()) {
            let target =
                self.geometry.objects()[objects[ray % objects.len()] as usize].surface_point_by_number(ray);
            let Some((is_back, seen)) =
                target.and_then(|target| self.ray_hit_side_and_material(body, (point, of), target))
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

    /// Casts a ray toward `target`. Returns whether the ray hits the solid from behind, and the material at
    /// the hit, or `None` if the ray misses the solid or leaves through an opaque surface that closes it.
    fn ray_hit_side_and_material(
        &self,
        body: &CompoundSolid,
        (point, of): (Vec3, Option<u32>),
        target: DVec3,
    ) -> Option<(bool, u32)> {
        let mut ray = Ray::new(point, (target - point.as_dvec3()).as_vec3());
        for _ in 0..MAX_PASSED {
            let hit = self.geometry.closest_hit(&ray)?;
            let material = self.material_index(&hit) as u32;
            if body.is_covered && !self.is_glass_material(material) && Some(hit.object) != of {
                return None;
            }
            let bare = SurfaceRequest { uv: false, shadow_point: false };
            let surface = self.geometry.requested_surface(&ray, &hit, bare);
            if self.is_glass_material(material) && self.solid_id(hit.object) == body.body {
                let is_back = surface.normal.dot(ray.direction) > 0.0;
                return Some((is_back != self.glass_solids.is_inside_out(hit.object), material));
            }
            let origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction);
            ray = Ray::new(origin, ray.direction);
        }
        None
    }
}

impl Object {
    /// Returns a point on the surface, selected by `number`, or `None` if the object has no area.
    fn surface_point_by_number(&self, number: usize) -> Option<DVec3> {
        match self {
            Self::Shape(shape) => {
                let areas = shape.local_part_areas();
                let parts: Vec<usize> = (0..areas.len()).filter(|&part| areas[part] > 0.0).collect();
                let part = *parts.get(number % parts.len().max(1))?;
                let u = Vec2::new(0.618_034, 0.754_877_7) * (number as f32 + 0.5);
                Some(shape.sample_point_on_part(part as u32, u.fract()).point)
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
