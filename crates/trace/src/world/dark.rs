//! Bodies of rough glass without a lamp in them: light samples find nothing from within, as no shadow ray leaves glass.

use super::World;
use crate::geometry::Aabb;
use crate::math::Vec3;

/// Room for rounding around lamps, relative to their distance from the origin.
const ROUNDING: f32 = 1e-5;

/// The boxes of a lamp, which is in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampBox {
    /// Box of the ball around the lamp.
    of_ball: Aabb,
    /// Box of the object that emits.
    of_object: Option<Aabb>,
    /// The object that emits.
    pub object: Option<u32>,
}

impl LampBox {
    /// Whether the lamp may meet a box.
    pub fn meets(&self, bounds: &Aabb) -> bool {
        self.of_ball.meets(bounds) && self.of_object.is_none_or(|own| own.meets(bounds))
    }

    /// The middle and the corners of the smaller box.
    pub fn points(&self) -> impl Iterator<Item = Vec3> {
        let own = self.of_object.unwrap_or(self.of_ball);
        let corner = move |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { own.min[axis] } else { own.max[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        };
        std::iter::once(own.center()).chain((0..8).map(corner))
    }
}

impl World {
    /// Whether each object is the place of a closed body of glass that no lamp is in or touches. Empty if no glass is rough.
    pub(super) fn find_dark_bodies(&self) -> Box<[bool]> {
        if !self.has_rough_glass() {
            return Box::default();
        }
        let (objects, lamps) = (self.geometry.objects(), self.lamp_boxes());
        let everywhere = Aabb::around([Vec3::NEG_INFINITY, Vec3::INFINITY]);
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
        let holds_lamp = |bounds: &Aabb| lamps.iter().any(|lamp| lamp.meets(bounds));
        let is_dark = |(body, bounds): (u32, &Option<Aabb>)| {
            let closed = bounds.as_ref().filter(|bounds| bounds.extent().is_finite() && !self.is_open(body));
            closed.is_some_and(|bounds| !holds_lamp(bounds))
        };
        (0..).zip(&boxes).map(is_dark).collect()
    }

    /// Boxes around the lamps of finite extent, with room for rounding.
    pub fn lamp_boxes(&self) -> Vec<LampBox> {
        let boxes = self.lights.iter().filter_map(|(_, light)| {
            let bounds = light.bounds().filter(|_| !light.is_beyond())?;
            let (center, radius) = (bounds.center.as_vec3(), bounds.radius as f32);
            let room = ROUNDING * (radius + center.abs().max_element());
            let around = Vec3::splat(radius + room);
            let of_ball = Aabb::around([center - around, center + around]);
            let object = light.as_area().map(|area| area.object);
            let bounds = object.and_then(|object| self.geometry.objects()[object as usize].bounds());
            Some(LampBox { of_ball, of_object: bounds.map(|own| own.grown(Vec3::splat(room))), object })
        });
        boxes.collect()
    }

    /// Whether no light sample from within a body of glass finds anything.
    #[inline]
    pub fn is_dark_body(&self, body: u32) -> bool {
        self.dark_bodies.get(body as usize).copied().unwrap_or(false)
    }
}
