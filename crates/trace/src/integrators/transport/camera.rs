//! Camera rays, in packets.

use std::ops::Range;

use super::interiors::{Interior, InteriorList};
use super::ray::{PathHistory, PathRay};
use super::tile::TileContext;
use crate::geometry::Ray;
use crate::geometry::packet::{F32x16, RayPacket};
use crate::math::lanes::Simd;
use crate::math::{DVec2, Vec2, Vec3};
use crate::sampling::filter::FilterSample;
use crate::sampling::{CAMERA_PATH, Dimension, SamplerPacket, warp};
use crate::world::{FilmPosition, FilmPositionPacket, PACKET_SIZE, SimdKernel};

/// Number of camera-ray packets generated together to hide the latency of random number generation.
pub const CAMERA_ROWS: usize = 8;

/// A packet of camera rays.
#[derive(Clone)]
pub struct CameraRayPacket {
    /// The rays.
    pub rays: RayPacket,
    /// Mask of rays whose filter weight is negative.
    pub negative: u32,
    /// Mask of the lanes with a ray. Lanes outside the circle of a fisheye have none and remain black.
    pub valid: u32,
}

impl TileContext<'_> {
    /// Replaces the queue's contents with camera rays for a range of slots. Calls `negative` for each packet
    /// with its first slot and the mask of rays whose filter weight is negative.
    pub fn replace_queue_with_camera_rays(
        &self,
        slots: Range<u32>,
        queue: &mut Vec<PathRay>,
        mut negative: impl FnMut(u32, u32),
    ) {
        queue.clear();
        let mut rows = Vec::new();
        for first in slots.clone().step_by(CAMERA_ROWS * PACKET_SIZE) {
            self.fill_camera_packets(first..slots.end, &mut rows);
            for (first, row) in (first..).step_by(PACKET_SIZE).zip(&rows) {
                negative(first, row.negative);
                let slots = first..slots.end.min(first + PACKET_SIZE as u32);
                let valid = slots.zip(0..).filter(|(_, lane)| row.valid >> lane & 1 != 0);
                queue.extend(valid.map(|(slot, lane)| self.path_from_camera_ray(row.rays.ray(lane), slot)));
            }
        }
    }

    /// Replaces the contents of `rows` with packets of camera rays for the first slots in the range, at most
    /// [`CAMERA_ROWS`] packets.
    pub fn fill_camera_packets(&self, slots: Range<u32>, rows: &mut Vec<CameraRayPacket>) {
        rows.clear();
        let count = slots.len().div_ceil(PACKET_SIZE).min(CAMERA_ROWS);
        self.world.geometry.instruction_set().run(CameraRayKernel {
            tile: self,
            first: slots.start,
            count,
            rows,
        });
    }

    /// Path that starts with a camera ray.
    #[inline(always)]
    pub fn path_from_camera_ray(&self, ray: Ray, slot: u32) -> PathRay {
        let interiors = if self.world.is_camera_in_air() {
            InteriorList::default()
        } else {
            self.camera_interiors(ray.origin)
        };
        let state = PathHistory::CAMERA;
        let cone = self.camera_cone.unwrap_or_default();
        PathRay { ray, throughput: Vec3::ONE, slot, path: CAMERA_PATH + 1, interiors, state, cone }
    }

    /// The glass solids around a point on the lens.
    #[cold]
    #[inline(never)]
    fn camera_interiors(&self, point: Vec3) -> InteriorList {
        let around =
            self.world.glass_around_lens_point(point).map(|(body, material)| Interior { body, material });
        around.fold(InteriorList::default(), InteriorList::entered)
    }

    /// Rays for the sixteen slots starting at `first`, even if some are past the last slot. Must be called
    /// inside a kernel that is compiled for each instruction set.
    #[inline(always)]
    fn camera_packet(&self, first: u32) -> CameraRayPacket {
        let paths = [CAMERA_PATH; PACKET_SIZE];
        let (settings, camera) = (self.settings, &self.world.camera);
        let (xs, ys, samples) = self.block.pixels_and_samples_of_consecutive_slots(first);
        let sampler = SamplerPacket::new(settings.render.seed, &xs, &ys, &samples);
        // Sample positions in the pixels.
        let mut in_pixel = sampler.pairs(&paths, Dimension::Pixel, 0, 1);
        let mut negative = 0;
        settings.render.filter.sample_packet(&mut in_pixel, |lane, sample: FilterSample| {
            negative |= u32::from(sample.is_negative) << lane;
        });
        let mut film = FilmPositionPacket { offset: [[0.0; PACKET_SIZE]; 2], half_width: 0.0 };
        for lane in 0..PACKET_SIZE {
            let corner = DVec2::new(f64::from(xs[lane]), f64::from(ys[lane])) + DVec2::splat(0.5);
            let place = corner + DVec2::new(f64::from(in_pixel[0][lane]), f64::from(in_pixel[1][lane]));
            let FilmPosition { offset, half_width } = settings.film_position_from_pixel(place);
            (film.offset[0][lane], film.offset[1][lane]) = (offset.x, offset.y);
            film.half_width = half_width;
        }
        // Generate rays through these positions, from points on the lens if the camera has an aperture.
        let (rays, valid) = if settings.dof && camera.aperture > 0.0 {
            let lens = sample_unit_disk_packet(sampler.pairs(&paths, Dimension::Lens, 0, 1));
            camera.ray_packet(&film, Some(&lens))
        } else {
            camera.ray_packet(&film, None)
        };
        CameraRayPacket { rays, negative, valid }
    }
}

/// Kernel that generates several packets of camera rays.
struct CameraRayKernel<'a> {
    tile: &'a TileContext<'a>,
    first: u32,
    count: usize,
    rows: &'a mut Vec<CameraRayPacket>,
}

impl SimdKernel for CameraRayKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: impl Simd) {
        for number in 0..self.count as u32 {
            self.rows.push(self.tile.camera_packet(self.first + number * PACKET_SIZE as u32));
        }
    }
}

/// Maps pairs of random numbers to the unit disk.
#[inline(always)]
fn sample_unit_disk_packet([u, v]: [F32x16; 2]) -> [F32x16; 2] {
    let mut points = [u, v];
    for lane in 0..PACKET_SIZE {
        let point = warp::disk(Vec2::new(u[lane], v[lane]));
        (points[0][lane], points[1][lane]) = (point.x, point.y);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::super::tile::SampleBlock;
    use super::*;
    use crate::film::Rect;

    #[test]
    fn packed_slots_match_single_slots() {
        let tile = Rect { x: 5, y: 7, width: 3, height: 40 };
        let cases = [(3..4, None), (0..5, Some(9)), (100..116, None), (100..116, Some(8)), (7..40, Some(20))];
        for (samples, mirrored_width) in cases {
            let block = SampleBlock { pixels: tile.into(), samples, mirrored_width };
            for first in [0, 1, 2, 15, 33] {
                let (xs, ys, samples) = block.pixels_and_samples_of_consecutive_slots(first);
                for lane in 0..PACKET_SIZE {
                    let place = block.pixel_and_sample(first + lane as u32);
                    assert_eq!((xs[lane], ys[lane], samples[lane]), place, "{first} + {lane}");
                }
                let slots = std::array::from_fn(|lane| first + 7 * lane as u32);
                let (xs, ys, samples) = block.pixels_and_samples_of_slots(&slots);
                for lane in 0..PACKET_SIZE {
                    let place = block.pixel_and_sample(slots[lane]);
                    assert_eq!((xs[lane], ys[lane], samples[lane]), place, "{first} + 7 * {lane}");
                }
            }
        }
    }
}
