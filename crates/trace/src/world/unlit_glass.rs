//! Rough glass solids without a light inside. Sampling lights from their interior is pointless because shadow
//! rays never leave glass.

use super::World;
use crate::geometry::Aabb;
use crate::math::Vec3;

/// Margin for rounding around lights, relative to their distance from the origin.
const ROUNDING: f32 = 1e-5;

/// Two bounding boxes of the same light, which is inside both of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBoundingBoxes {
    /// Bounding box of the light's bounding sphere.
    of_ball: Aabb,
    /// Bounding box of the emitting object.
    of_object: Option<Aabb>,
    /// The emitting object.
    pub object: Option<u32>,
}

impl LightBoundingBoxes {
    /// Whether the light may intersect a box.
    pub fn may_light_source_overlap_box(&self, bounds: &Aabb) -> bool {
        self.of_ball.overlaps(bounds) && self.of_object.is_none_or(|own| own.overlaps(bounds))
    }

    /// Center and corners of the smaller box.
    pub fn smaller_box_center_and_corners(&self) -> impl Iterator<Item = Vec3> {
        let own = self.of_object.unwrap_or(self.of_ball);
        let corner = move |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { own.min[axis] } else { own.max[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        };
        std::iter::once(own.center()).chain((0..8).map(corner))
    }
}

impl World {
    /// Finds the closed glass solids that are not touched by a light. The result is empty if no glass is
    /// rough.
    pub(super) fn find_glass_not_touching_lights(&self) -> Box<[bool]> {
        if !self.has_rough_glass() {
            return Box::default();
        }
        let (objects, light_boxes) = (self.geometry.objects(), self.finite_light_boxes());
        let everywhere = Aabb::from_points([Vec3::NEG_INFINITY, Vec3::INFINITY]);
        // Compute the bounding box of each solid.
        let mut boxes: Vec<Option<Aabb>> = vec![None; objects.len()];
        for (id, object) in (0_u32..).zip(objects) {
            if self.materials_of(id).any(|material| material.bsdf.as_dielectric().is_some()) {
                let (own, joined) =
                    (object.bounds().unwrap_or(everywhere), &mut boxes[self.solid_id(id) as usize]);
                *joined = Some(joined.map_or(own, |others| others.union(own)));
            }
        }
        // Keep the closed solids that cannot be touched by a light.
        let may_contain_light =
            |bounds: &Aabb| light_boxes.iter().any(|light| light.may_light_source_overlap_box(bounds));
        let is_dark = |(body, bounds): (u32, &Option<Aabb>)| {
            let closed = bounds
                .as_ref()
                .filter(|bounds| bounds.extent().is_finite() && !self.is_glass_solid_open(body));
            closed.is_some_and(|bounds| !may_contain_light(bounds))
        };
        (0..).zip(&boxes).map(is_dark).collect()
    }

    /// Bounding boxes of all finite lights, with a margin for rounding.
    pub fn finite_light_boxes(&self) -> Vec<LightBoundingBoxes> {
        let boxes = self.lights.iter().filter_map(|(_, light)| {
            let bounds = light.bounds_if_emissive().filter(|_| !light.is_infinite())?;
            let (center, radius) = (bounds.center.as_vec3(), bounds.radius as f32);
            let room = ROUNDING * (radius + center.abs().max_element());
            let around = Vec3::splat(radius + room);
            let of_ball = Aabb::from_points([center - around, center + around]);
            let object = light.as_area().map(|area| area.object);
            let bounds = object.and_then(|object| self.geometry.objects()[object as usize].bounds());
            Some(LightBoundingBoxes {
                of_ball,
                of_object: bounds.map(|own| own.expanded(Vec3::splat(room))),
                object,
            })
        });
        boxes.collect()
    }

    /// Whether light samples taken from inside a glass solid are always occluded.
    #[inline]
    pub fn is_glass_interior_shadowed(&self, body: u32) -> bool {
        self.unlit_glass.get(body as usize).copied().unwrap_or(false)
    }
}
