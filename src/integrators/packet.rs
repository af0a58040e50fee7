//! What a packet of rays meets, and of plain surfaces what they are lit by: rows, where one vertex at a time would cost more than
//! the light.

use super::camera::CameraRow;
use super::lit_row::{LitRow, bsdf_parts};
use super::queues::PathRay;
use super::shot::Shot;
use super::view::Measure;
use crate::geometry::ray::offset_origin;
use crate::geometry::rows::{HitRows, RayRows};
use crate::geometry::surface_rows::SurfaceRow;
use crate::materials::phong::PhongBsdf;
use crate::math::Vec3;
use crate::math::lanes::{TRUE, bits, lane, set_lane};
use crate::sampling::CAMERA_PATH;
use crate::world::{Hit, Loops, Object, PACKET};

/// Rays that go through the scene together.
#[derive(Clone, Copy)]
pub enum Rays<'a> {
    /// Those of the camera, from a slot on, so many.
    Camera(&'a CameraRow, u32, usize),
    /// Of a queue.
    Paths(&'a [PathRay]),
}

impl Rays<'_> {
    /// How many.
    pub fn count(&self) -> usize {
        match self {
            Self::Camera(_, _, count) => *count,
            Self::Paths(paths) => paths.len(),
        }
    }
}

/// The hits of a packet. A surface is plain where its shape has a loop for its surface, its material is Phong without textures,
/// and its ray is in no glass.
pub struct Met {
    hits: HitRows,
    object: [u32; PACKET],
    /// A bit for each ray that meets anything.
    pub any: u32,
    /// A bit for each plain surface.
    pub plain: u32,
    /// A bit for each plain surface that sends out light towards the ray.
    pub shining: u32,
}

impl Met {
    /// What a ray hits.
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        self.hits.get(lane).map(|shape| Hit { shape, object: self.object[lane] })
    }

    /// One of the rays.
    pub fn path(&self, shot: &Shot<'_>, rays: &Rays<'_>, lane: usize) -> PathRay {
        match rays {
            Rays::Camera(row, first, _) => shot.camera_path(row.rays.ray(lane), first + lane as u32),
            Rays::Paths(paths) => paths[lane],
        }
    }
}

impl Shot<'_> {
    /// What at most [`PACKET`] rays meet, whose places in the round's queue start at `first`. The plain surfaces are put into the
    /// row, ready to be lit; those that reflect light are `used` in it.
    pub fn meet(&self, rays: Rays<'_>, first: u32, measure: Measure, row: &mut LitRow) -> Met {
        self.world.geometry.instructions().run(Meeting { shot: self, rays, first, measure, row })
    }
}

struct Meeting<'a> {
    shot: &'a Shot<'a>,
    rays: Rays<'a>,
    first: u32,
    measure: Measure,
    row: &'a mut LitRow,
}

impl Loops for Meeting<'_> {
    type Done = Met;

    #[inline(always)]
    fn run(self) -> Met {
        let Self { shot, rays, first, measure, row } = self;
        let world = shot.world;
        row.reset();
        let of_paths;
        let mut ends = [-1.0; PACKET];
        let rows = match rays {
            Rays::Camera(row, _, count) => {
                ends[..count].fill(f32::INFINITY);
                &row.rays
            }
            Rays::Paths(paths) => {
                let (mut origin, mut direction) = ([[0.0; PACKET]; 3], [[0.0; PACKET]; 3]);
                for (lane, path) in paths.iter().enumerate().take(PACKET) {
                    set_lane(&mut origin, lane, path.ray.origin);
                    set_lane(&mut direction, lane, path.ray.direction);
                    ends[lane] = path.ray.t_max;
                }
                of_paths = RayRows::of(origin, direction);
                &of_paths
            }
        };
        let (hits, object) = world.geometry.closest_rows(rows, &mut ends);
        let mut surface = SurfaceRow::EMPTY;
        let any = hits.any();
        let (mut left, mut plain, mut shining) = (any, 0, 0);
        let mut seen = !0;
        match rays {
            Rays::Camera(..) => left = if world.is_eye_in_air() { left } else { 0 },
            Rays::Paths(paths) => {
                for (lane, path) in paths.iter().enumerate() {
                    left &= if path.medium.is_air() { !0 } else { !(1 << lane) };
                    seen &= if path.history.is_seen { !0 } else { !(1 << lane) };
                }
            }
        }
        while left != 0 {
            let id = object[left.trailing_zeros() as usize % PACKET];
            let mut of = [0; PACKET];
            for lane in 0..PACKET {
                of[lane] = if object[lane] == id { TRUE } else { 0 };
            }
            let of = bits(of) & left;
            left &= !of;
            let Object::Shape(shape) = &world.geometry.objects()[id as usize] else { continue };
            let Some((material, bsdf)) = world.plain_phong(id) else { continue };
            if surface.fill(shape, rows, &hits, of) {
                plain |= of;
                shining |= if material.emission.shines() { of } else { 0 };
                row.used |= if bsdf.is_black() { 0 } else { of };
                let seen = seen & of;
                row.set_bsdf(of, &bsdf, measure);
                if seen != of && measure != Measure::ALL {
                    row.set_bsdf(of & !seen, &bsdf, Measure::ALL);
                }
            }
        }
        let front = if plain == 0 { 0 } else { row.place(&rays, first, rows, &surface) };
        Met { hits, object, any, plain, shining: shining & front }
    }
}

impl LitRow {
    /// The lobes of some lanes.
    #[inline(always)]
    fn set_bsdf(&mut self, of: u32, bsdf: &PhongBsdf, measure: Measure) {
        let [diffuse, specular] = bsdf_parts(bsdf, measure);
        for lane in 0..PACKET {
            let is_of = of & 1 << lane != 0;
            for axis in 0..3 {
                let (own, new) = (&mut self.diffuse[axis][lane], diffuse[axis]);
                *own = if is_of { new } else { *own };
                let (own, new) = (&mut self.specular[axis][lane], specular[axis]);
                *own = if is_of { new } else { *own };
            }
            self.shininess[lane] = if is_of { bsdf.shininess } else { self.shininess[lane] };
            self.albedos[0][lane] = if is_of { bsdf.diffuse.max_element() } else { self.albedos[0][lane] };
            self.albedos[1][lane] = if is_of { bsdf.specular.max_element() } else { self.albedos[1][lane] };
        }
        self.is_glossy |= bsdf.specular != Vec3::ZERO;
    }

    /// Where paths meet plain surfaces; a bit for each that comes to the front.
    #[inline(always)]
    fn place(&mut self, paths: &Rays<'_>, first: u32, rays: &RayRows, surface: &SurfaceRow) -> u32 {
        let mut front = [0; PACKET];
        self.medium = [0; PACKET];
        for i in 0..PACKET {
            let (normal, direction) = (lane(&surface.normal, i), lane(&rays.direction, i));
            let cosine = normal.dot(direction);
            front[i] = if cosine < 0.0 { TRUE } else { 0 };
            let normal = normal * if cosine > 0.0 { -1.0 } else { 1.0 };
            let from = offset_origin(lane(&surface.point, i), lane(&surface.error, i), normal, normal);
            set_lane(&mut self.from, i, from);
            set_lane(&mut self.normal, i, normal);
            let to_eye = -direction;
            set_lane(&mut self.mirrored_eye, i, normal * (2.0 * normal.dot(to_eye)) - to_eye);
        }
        match paths {
            Rays::Camera(_, slot, _) => {
                self.throughput = [[1.0; PACKET]; 3];
                self.path = [CAMERA_PATH + 1; PACKET];
                self.carried = [1.0; PACKET];
                for i in 0..PACKET {
                    (self.slot[i], self.place[i]) = (slot + i as u32, first + i as u32);
                }
            }
            Rays::Paths(paths) => {
                for (i, path) in paths.iter().enumerate().take(PACKET) {
                    set_lane(&mut self.throughput, i, path.throughput);
                    self.carried[i] = path.history.carried;
                    (self.slot[i], self.path[i], self.place[i]) = (path.slot, path.path, first + i as u32);
                }
            }
        }
        bits(front)
    }
}
