//! Light that passes surfaces straight on: thin panes, and what opacity lets through.
//!
//! Shadow rays first look for what nothing passes, as in a scene without such surfaces. Only those that get by, and that meet the
//! box of an object which light may pass, are followed from one such surface to the next.

use super::packet::Blockers;
use super::{Geometry, Hit, PACKET_SIZE, SimdKernel, World};
use crate::accel::{AnyTest, F32x16};
use crate::geometry::packet::{RayPacket, lanes};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfaceRequest};
use crate::lights::{Source, SourceRow};
use crate::materials::{Footprint, Material};
use crate::math::Vec3;
use crate::math::lanes::{Simd, Vec3x16, set_lane};

/// Relative difference of distances that are equal within rounding.
const SAME_PLACE: f32 = 1e-4;

/// Most surfaces in a row that a ray passes straight on; the next one ends it.
pub const MOST_STRAIGHT: u32 = 64;

/// Objects that light may pass straight on.
#[derive(Debug)]
pub(super) struct Passable {
    /// Whether each object is one.
    objects: Vec<bool>,
    /// Whether any of them is under the tree over several meshes.
    is_any_merged: bool,
}

impl Passable {
    /// The objects of a world that light may pass. `None` if there are none.
    pub(super) fn of(world: &World) -> Option<Self> {
        let geometry = &world.geometry;
        let lets_pass = |object: u32| world.materials_of(object).any(Material::lets_pass);
        let objects: Vec<bool> = (0..geometry.objects().len() as u32).map(lets_pass).collect();
        let is_merged = |(object, is_passable): (u32, &bool)| *is_passable && geometry.is_merged(object);
        let is_any_merged = (0..).zip(&objects).any(is_merged);
        objects.contains(&true).then_some(Self { objects, is_any_merged })
    }

    /// Whether light may pass an object; the number of merged meshes is none of an object's.
    #[inline(always)]
    fn has(&self, object: u32) -> bool {
        self.objects.get(object as usize).copied().unwrap_or(false)
    }
}

/// Light that is left on the rays of a packet.
pub struct Weakened {
    /// A bit for each ray on which nothing is left.
    pub occluded: u32,
    /// The part that is left on the others.
    pub left: Vec3x16,
    /// Texture look-ups.
    pub lookups: u64,
}

impl World {
    /// Whether light may pass any surface straight on.
    #[inline(always)]
    pub fn has_passable(&self) -> bool {
        self.passable.is_some()
    }

    /// Light that is left on the segments of a packet, each with its lamp. `traced` are the bits of the rays that have an
    /// end.
    #[cold]
    #[inline(never)]
    pub fn weakened_rows(
        &self,
        rows: &RayPacket,
        ends: &F32x16,
        traced: u32,
        sources: &SourceRow,
    ) -> Weakened {
        self.geometry.instructions().run(Weakening { world: self, rows, ends, traced, sources })
    }

    /// Whether nothing is left of the light on a segment.
    pub fn is_dark(&self, ray: &Ray, source: Source) -> bool {
        self.left_on_segment(ray, source, &mut 0) == Vec3::ZERO
    }

    /// The part of the light that is left on a segment to its source.
    pub fn left_on_segment(&self, ray: &Ray, source: Source, lookups: &mut u64) -> Vec3 {
        let Some(passable) = &self.passable else {
            return if self.geometry.occluded(ray, source) { Vec3::ZERO } else { Vec3::ONE };
        };
        let is_own = |object: u32| source == Source::Object(object);
        let stops = |object: u32| !passable.has(object) && !is_own(object);
        if self.geometry.closest_of(ray, stops).is_some() {
            return Vec3::ZERO;
        }
        self.left_on(passable, ray, source, lookups)
    }

    /// The part of the light that passes the surface at a hit straight on, and the ray beyond it.
    pub fn beyond(&self, ray: &Ray, hit: &Hit, lookups: &mut u64) -> (Vec3, Ray) {
        let index = self.material_index(hit);
        let material = &self.materials[index];
        let asked = SurfaceRequest { uv: self.is_textured(index), shadow_point: false };
        let surface = self.geometry.requested_surface(ray, hit, asked);
        let cosine = surface.shading_normal.dot(ray.direction.normalize_or_zero());
        let color = self.vertex_color(hit).unwrap_or(Vec3::ONE);
        let at = self.texture_point(hit, &surface, |_| Footprint::POINT);
        let left = material.passing(&at, color, cosine, lookups);
        let origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction);
        let start = self.geometry.triangle_number(hit);
        let beyond = Ray::new(origin, ray.direction).leaving(start);
        (left, Ray { t_max: ray.t_max - hit.shape.t, ..beyond })
    }

    /// The part of the light that all surfaces on a segment which light may pass leave together.
    fn left_on(&self, passable: &Passable, ray: &Ray, source: Source, lookups: &mut u64) -> Vec3 {
        let (mut left, mut ray, mut count) = (Vec3::ONE, *ray, 0);
        let is_own = |object: u32| source == Source::Object(object);
        // The sampled place is an end of the ray within rounding.
        let end = SAME_PLACE * ray.t_max;
        while let Some(hit) = self.geometry.closest_of(&ray, |object| passable.has(object) && !is_own(object))
        {
            if source == Source::Sheer(hit.object) && hit.shape.t >= ray.t_max - end {
                break;
            }
            let (part, beyond) = self.beyond(&ray, &hit, lookups);
            ray = beyond;
            // The light itself stops nothing.
            if source == Source::Primitive(hit.object, hit.shape.primitive) {
                continue;
            }
            (left, count) = (left * part, count + 1);
            if left == Vec3::ZERO || count > MOST_STRAIGHT {
                return Vec3::ZERO;
            }
            if !(ray.t_max > 0.0) {
                break;
            }
        }
        left
    }
}

/// [`World::weakened_rows`].
struct Weakening<'a> {
    world: &'a World,
    rows: &'a RayPacket,
    ends: &'a F32x16,
    traced: u32,
    sources: &'a SourceRow,
}

impl SimdKernel for Weakening<'_> {
    type Output = Weakened;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Weakened {
        let Self { world, rows, ends, traced, sources } = self;
        let mut weakened = Weakened { occluded: 0, left: [[1.0; PACKET_SIZE]; 3], lookups: 0 };
        let Some(passable) = &world.passable else { return weakened };
        // Find the rays that nothing stops.
        let geometry: &Geometry = &world.geometry;
        let each_mesh = passable.is_any_merged || traced & geometry.to_whole_merged(sources) != 0;
        let tree = if each_mesh { geometry.tree() } else { geometry.visited() };
        let blockers = Blockers::new(geometry, rows, sources, simd);
        let mut solid = Solid { blockers, passable, near: 0 };
        weakened.occluded = tree.any_packet(rows, ends, traced, geometry.unbounded(), &mut solid, simd);
        // Follow those that come near surfaces which light may pass.
        for lane in lanes(traced & !weakened.occluded & solid.near) {
            let ray = Ray { t_max: ends[lane], ..rows.ray(lane) };
            let left = world.left_on(passable, &ray, sources.source(lane), &mut weakened.lookups);
            set_lane(&mut weakened.left, lane, left);
            weakened.occluded |= u32::from(left == Vec3::ZERO) << lane;
        }
        weakened
    }
}

/// Test for occluders that nothing passes.
struct Solid<'a, F> {
    blockers: Blockers<'a, F>,
    passable: &'a Passable,
    /// A bit for each ray that meets the box of an object which light may pass.
    near: u32,
}

impl<F: Simd> AnyTest for Solid<'_, F> {
    #[inline(always)]
    fn test(&mut self, id: u32, met: u32, ends: &F32x16) -> u32 {
        if self.passable.has(id) {
            self.near |= met;
            return 0;
        }
        self.blockers.test(id, met, ends)
    }
}
