//! Bodies of rough glass without a lamp in them: light samples find nothing from within, as no shadow ray leaves glass.

use super::World;
use crate::geometry::Aabb;
use crate::math::Vec3;

/// Room for rounding around lamps, relative to their distance from the origin.
const ROUNDING: f32 = 1e-5;

impl World {
    /// Whether each object is the place of a closed body of glass that no lamp is in or touches. Empty if no glass is rough.
    pub(super) fn find_dark_bodies(&self) -> Box<[bool]> {
        if !self.has_rough_glass() {
            return Box::default();
        }
        let objects = self.geometry.objects();
        let everywhere = Aabb::around([Vec3::NEG_INFINITY, Vec3::INFINITY]);
        // A lamp is within the sphere around it, and within the box around its object.
        let lamps: Vec<[Aabb; 2]> = self
            .lights
            .iter()
            .filter_map(|(_, light)| {
                let bounds = light.bounds().filter(|_| !light.is_beyond())?;
                let (center, radius) = (bounds.center.as_vec3(), bounds.radius as f32);
                let room = ROUNDING * (radius + center.abs().max_element());
                let around = Vec3::splat(radius + room);
                let object = light.as_area().and_then(|area| objects[area.object as usize].bounds());
                let of_object = object.map_or(everywhere, |own| own.grown(Vec3::splat(room)));
                Some([Aabb::around([center - around, center + around]), of_object])
            })
            .collect();
        // Join the boxes of each body's objects.
        let mut boxes: Vec<Option<Aabb>> = vec![None; objects.len()];
        for (id, object) in (0_u32..).zip(objects) {
            if self.materials_of(id).any(|material| material.bsdf.glass().is_some()) {
                let (own, joined) =
                    (object.bounds().unwrap_or(everywhere), &mut boxes[self.body(id) as usize]);
                *joined = Some(joined.map_or(own, |others| others.union(own)));
            }
        }
        // Leave out those that a lamp may be in, and those that rays may leave.
        let holds_lamp =
            |bounds: &Aabb| lamps.iter().any(|boxes| boxes.iter().all(|lamp| lamp.meets(bounds)));
        let is_dark = |(body, bounds): (u32, &Option<Aabb>)| {
            let closed = bounds.as_ref().filter(|bounds| bounds.extent().is_finite() && !self.is_open(body));
            closed.is_some_and(|bounds| !holds_lamp(bounds))
        };
        (0..).zip(&boxes).map(is_dark).collect()
    }

    /// Whether no light sample from within a body of glass finds anything.
    #[inline]
    pub fn is_dark_body(&self, body: u32) -> bool {
        self.dark_bodies.get(body as usize).copied().unwrap_or(false)
    }
}
