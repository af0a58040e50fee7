//! Rays of the camera.

use std::ops::Range;

use super::medium::{Inside, Medium};
use super::queues::PathRay;
use super::shot::Shot;
use crate::math::{DVec2, Vec2, Vec3};
use crate::sampling::warp;

impl Shot<'_> {
    /// Rays through the pixels of some slots, in place of what is in the queue.
    pub fn camera_rays(&self, slots: Range<u32>, queue: &mut Vec<PathRay>) {
        queue.clear();
        queue.extend(slots.map(|slot| self.camera_ray(slot)));
    }

    fn camera_ray(&self, slot: u32) -> PathRay {
        let (x, y, _) = self.block.place(slot);
        let [fx, fy, lx, ly] = self.sampler(slot).camera();
        let sample = self.settings.render.filter.sample(Vec2::new(fx, fy));
        let in_pixel = (sample.offset + Vec2::splat(0.5)).as_dvec2();
        let lens = if self.settings.dof { warp::disk(Vec2::new(lx, ly)) } else { Vec2::ZERO };
        let from_corner = DVec2::new(f64::from(x), f64::from(y)) + in_pixel;
        let ray = self.world.camera.ray(self.settings.from_middle(from_corner), lens);
        let around =
            self.world.glass_around(ray.origin).map(|(object, material)| Inside { object, material });
        let medium = around.fold(Medium::default(), Medium::entered);
        PathRay { ray, throughput: Vec3::splat(sample.weight), slot, path: 1, medium }
    }
}
