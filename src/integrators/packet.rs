//! What a packet of rays meets, and of plain surfaces what they are lit by: rows, where one vertex at a time would cost more than
//! the light.

use super::camera::CameraRow;
use super::lit_row::{LitRow, bsdf_parts};
use super::queues::PathRay;
use super::shot::Shot;
use super::view::Measure;
use crate::geometry::ray::offset_origin;
use crate::geometry::rows::{self, HitRows, RayRows};
use crate::geometry::surface_rows::SurfaceRow;
use crate::materials::phong::PhongBsdf;
use crate::math::Vec3;
use crate::math::lanes::{Lanes, Lanes3, TRUE, bits, lane, set_lane, take, truths};
use crate::sampling::CAMERA_PATH;
use crate::world::{Hit, Loops, Object, PACKET};

/// Rays that go through the scene together.
#[derive(Clone, Copy)]
pub enum Rays<'a> {
    /// Those of the camera, from a slot on, so many, from a place in the round's queue on.
    Camera(&'a CameraRow, u32, usize, u32),
    /// Of a queue, from a place on.
    Paths(&'a [PathRay], u32),
    /// Of a queue of which it is known what they hit: those at some places.
    Traced(&'a [PathRay], &'a [Option<Hit>], &'a [u32]),
}

impl Rays<'_> {
    /// How many.
    pub fn count(&self) -> usize {
        match self {
            Self::Camera(_, _, count, _) => *count,
            Self::Paths(paths, _) => paths.len(),
            Self::Traced(_, _, places) => places.len(),
        }
    }

    /// The place of a lane's path in the round's queue; any number where there is no path.
    #[inline(always)]
    pub fn place(&self, lane: usize) -> u32 {
        match self {
            Self::Camera(_, _, _, first) | Self::Paths(_, first) => first + lane as u32,
            Self::Traced(_, _, places) => places.get(lane).copied().unwrap_or(0),
        }
    }

    /// Of a queue: the path in a lane.
    #[inline(always)]
    fn of_queue(&self, lane: usize) -> Option<&PathRay> {
        match self {
            Self::Camera(..) => None,
            Self::Paths(paths, _) => paths.get(lane),
            Self::Traced(paths, _, places) => paths.get(*places.get(lane)? as usize),
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
    /// [`Environment::arriving_row`](crate::lights::Environment::arriving_row) where any ray meets nothing.
    sky: (Lanes3, Lanes),
}

impl Met {
    /// What a ray hits.
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        self.hits.get(lane).map(|shape| Hit { shape, object: self.object[lane] })
    }

    /// One of the rays.
    pub fn path(&self, shot: &Shot<'_>, rays: &Rays<'_>, lane: usize) -> PathRay {
        match rays {
            Rays::Camera(row, first, ..) => shot.camera_path(row.rays.ray(lane), first + lane as u32),
            Rays::Paths(paths, _) => paths[lane],
            Rays::Traced(paths, _, places) => paths[places[lane] as usize],
        }
    }

    /// Radiance that a ray sees of light from all around, which meets nothing, and the density in sr⁻¹ of samples from there.
    pub fn sky(&self, lane_of_ray: usize) -> (Vec3, f32) {
        (lane(&self.sky.0, lane_of_ray), self.sky.1[lane_of_ray])
    }
}

impl Shot<'_> {
    /// What at most [`PACKET`] rays meet. The plain surfaces are put into the row, ready to be lit; those that reflect light are
    /// `used` in it.
    pub fn meet(&self, rays: Rays<'_>, measure: Measure, row: &mut LitRow) -> Met {
        self.world.geometry.instructions().run(Meeting { shot: self, rays, measure, row })
    }
}

struct Meeting<'a> {
    shot: &'a Shot<'a>,
    rays: Rays<'a>,
    measure: Measure,
    row: &'a mut LitRow,
}

impl Loops for Meeting<'_> {
    type Done = Met;

    #[inline(always)]
    fn run(self) -> Met {
        let Self { shot, rays, measure, row } = self;
        let world = shot.world;
        row.reset();
        let (of_paths, traced);
        let mut ends = [-1.0; PACKET];
        let rows = match rays {
            Rays::Camera(row, _, count, _) => {
                ends[..count].fill(f32::INFINITY);
                traced = ((1_u64 << count) - 1) as u32;
                &row.rays
            }
            Rays::Paths(..) | Rays::Traced(..) => {
                let (mut origin, mut direction) = ([[0.0; PACKET]; 3], [[0.0; PACKET]; 3]);
                for lane in 0..PACKET {
                    let Some(path) = rays.of_queue(lane) else { break };
                    set_lane(&mut origin, lane, path.ray.origin);
                    set_lane(&mut direction, lane, path.ray.direction);
                    ends[lane] = path.ray.t_max;
                }
                traced = rows::traced(&ends);
                of_paths = RayRows::of(origin, direction);
                &of_paths
            }
        };
        let (hits, object) = match rays {
            Rays::Camera(..) | Rays::Paths(..) => world.geometry.closest_rows(rows, &mut ends, traced),
            Rays::Traced(_, known, places) => {
                let (mut hits, mut object) = (HitRows::none(), [u32::MAX; PACKET]);
                for (lane, &place) in places.iter().enumerate().take(PACKET) {
                    if let Some(hit) = &known[place as usize] {
                        hits.put(lane, &hit.shape);
                        object[lane] = hit.object;
                    }
                }
                (hits, object)
            }
        };
        let mut surface = SurfaceRow::EMPTY;
        let any = hits.any();
        let (mut left, mut plain, mut shining) = (any, 0, 0);
        let (mut seen, mut from_gloss) = (!0, 0);
        match rays {
            Rays::Camera(..) => left = if world.is_eye_in_air() { left } else { 0 },
            Rays::Paths(..) | Rays::Traced(..) => {
                for lane in 0..PACKET {
                    let Some(path) = rays.of_queue(lane) else { break };
                    left &= if path.medium.is_air() { !0 } else { !(1 << lane) };
                    seen &= if path.history.is_seen { !0 } else { !(1 << lane) };
                    from_gloss |= u32::from(path.history.is_from_gloss) << lane;
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
        (row.seen, row.from_gloss) = (seen, from_gloss);
        let front = if plain == 0 { 0 } else { row.place(&rays, rows, &surface) };
        let all = ((1_u64 << rays.count()) - 1) as u32;
        let sky = match world.lights.environment() {
            Some(environment) if any & all != all => environment.arriving_row(&rows.direction),
            Some(_) | None => ([[0.0; PACKET]; 3], [0.0; PACKET]),
        };
        Met { hits, object, any, plain, shining: shining & front, sky }
    }
}

impl LitRow {
    /// The lobes of some lanes.
    #[inline(always)]
    fn set_bsdf(&mut self, of: u32, bsdf: &PhongBsdf, measure: Measure) {
        let [diffuse, specular] = bsdf_parts(bsdf, measure);
        let of = truths(of);
        for axis in 0..3 {
            take(&of, &[diffuse[axis]; PACKET], &mut self.diffuse[axis]);
            take(&of, &[specular[axis]; PACKET], &mut self.specular[axis]);
        }
        take(&of, &[bsdf.shininess; PACKET], &mut self.shininess);
        take(&of, &[bsdf.diffuse.max_element(); PACKET], &mut self.albedos[0]);
        take(&of, &[bsdf.specular.max_element(); PACKET], &mut self.albedos[1]);
        self.is_glossy |= bsdf.specular != Vec3::ZERO;
    }

    /// Where paths meet plain surfaces; a bit for each that comes to the front.
    #[inline(always)]
    fn place(&mut self, paths: &Rays<'_>, rays: &RayRows, surface: &SurfaceRow) -> u32 {
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
            Rays::Camera(_, slot, ..) => {
                self.throughput = [[1.0; PACKET]; 3];
                self.path = [CAMERA_PATH + 1; PACKET];
                self.carried = [1.0; PACKET];
                for i in 0..PACKET {
                    self.slot[i] = slot + i as u32;
                }
            }
            Rays::Paths(..) | Rays::Traced(..) => {
                for i in 0..PACKET {
                    let Some(path) = paths.of_queue(i) else { break };
                    set_lane(&mut self.throughput, i, path.throughput);
                    self.carried[i] = path.history.carried;
                    (self.slot[i], self.path[i]) = (path.slot, path.path);
                }
            }
        }
        for i in 0..PACKET {
            self.place[i] = paths.place(i);
        }
        bits(front)
    }
}
