//! One side of a see-through round shape or box. Surfaces behind the near side are visible through it.

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter, Side};
use crate::geometry::{Shape, SurfaceSample};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::DiscreteDistribution;

/// One side of a shape, sampled by area. Shadow rays account for other parts of the shape along the way.
#[derive(Clone, Debug, PartialEq)]
pub struct SeeThroughSideEmitter {
    shape: Shape,
    by_area: DiscreteDistribution,
    /// 1 for the front, −1 for the back.
    outwards: f64,
}

impl SeeThroughSideEmitter {
    /// Creates an emitter for one side of a shape, or returns `None` if the shape has no area.
    pub fn new(shape: &Shape, side: Side) -> Option<Self> {
        let outwards = match side {
            Side::Front => 1.0,
            Side::Back => -1.0,
        };
        Some(Self {
            shape: shape.clone(),
            by_area: DiscreteDistribution::new(shape.local_part_areas())?,
            outwards,
        })
    }
}

impl ShapeEmitter for SeeThroughSideEmitter {
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let (part, rest) = self.by_area.sample(u[0]);
        let SurfaceSample { point: place, normal } =
            self.shape.sample_point_on_part(part as u32, Vec2::new(rest, u[1]));
        let offset = place - point.as_dvec3();
        let distance = offset.length();
        let cosine = -self.outwards * normal.dot(offset) / distance;
        if !(cosine > 0.0) {
            return SampledLightPoint::NOTHING;
        }
        let direction = (offset / distance).as_vec3();
        let area = self.by_area.total() * self.shape.area_scale_for_world_normal(normal);
        let factor = cosine * area / (distance * distance);
        SampledLightPoint { direction, target: point + direction * distance as f32, factor: factor as f32 }
    }

    fn pdf(&self, _: Vec3, hit: &LightHitPoint) -> f32 {
        hit.uniform_area_solid_angle_pdf(
            self.by_area.total() * self.shape.area_scale_for_world_normal(hit.normal.as_dvec3()),
        )
    }

    fn area_centroid(&self) -> DVec3 {
        self.shape.centroid()
    }
}
