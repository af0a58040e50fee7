//! The inner sides of round shapes and boxes that emit on both sides.

use std::f32::consts::{PI, TAU};

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::{RayF64, Shape, SurfaceSample};
use crate::math::elementary::sin_cos;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::DiscreteDistribution;

/// The inside of a shape. The inside of a closed shape is only visible from points inside, where directions
/// are sampled uniformly over the sphere. The inside of an open shape is sampled by area.
#[derive(Clone, Debug, PartialEq)]
pub struct InwardEmitter {
    shape: Shape,
    by_area: DiscreteDistribution,
}

impl ShapeEmitter for InwardEmitter {
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        match self.shape.encloses_point_if_closed(point.as_dvec3()) {
            Some(true) => self.sample_direction(point, u),
            Some(false) => SampledLightPoint::NOTHING,
            None => self.sample_by_area(point, u),
        }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        match self.shape.encloses_point_if_closed(from.as_dvec3()) {
            Some(true) => 1.0 / ALL_AROUND,
            Some(false) => 0.0,
            None if self.is_nearest_hit_at(from, hit.direction, hit.distance) => hit
                .uniform_area_solid_angle_pdf(
                    self.by_area.total() * self.shape.area_scale_for_world_normal(hit.normal.as_dvec3()),
                ),
            None => 0.0,
        }
    }

    fn area_centroid(&self) -> DVec3 {
        self.shape.centroid()
    }
}

/// Solid angle of the full sphere of directions, in sr.
const ALL_AROUND: f32 = 4.0 * PI;

impl InwardEmitter {
    /// Creates an emitter for a shape's inside, or returns `None` if the shape has no area.
    pub fn new(shape: &Shape) -> Option<Self> {
        Some(Self { shape: shape.clone(), by_area: DiscreteDistribution::new(shape.local_part_areas())? })
    }

    /// Samples a direction uniformly from a point inside the shape.
    fn sample_direction(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let cos = 1.0 - 2.0 * u[0];
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (sin_around, cos_around) = sin_cos(TAU * u[1]);
        let direction = Vec3::new(sin * cos_around, sin * sin_around, cos);
        self.first_hit_distance(point, direction).map_or(SampledLightPoint::NOTHING, |distance| {
            SampledLightPoint { direction, target: point + direction * distance, factor: ALL_AROUND }
        })
    }

    /// Samples a point uniformly by area. The sample is black if another part of the shape occludes the
    /// point.
    fn sample_by_area(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let (part, rest) = self.by_area.sample(u[0]);
        let SurfaceSample { point: place, normal } =
            self.shape.sample_point_on_part(part as u32, Vec2::new(rest, u[1]));
        let offset = place - point.as_dvec3();
        let distance = offset.length();
        let direction = offset / distance;
        let cosine = direction.dot(normal);
        let direction = direction.as_vec3();
        if !(cosine > 0.0 && self.is_nearest_hit_at(point, direction, distance as f32)) {
            return SampledLightPoint::NOTHING;
        }
        let area = self.by_area.total() * self.shape.area_scale_for_world_normal(normal);
        let factor = cosine * area / (distance * distance);
        SampledLightPoint { direction, target: point + direction * distance as f32, factor: factor as f32 }
    }

    /// Whether no part of the shape occludes the point at `distance`.
    fn is_nearest_hit_at(&self, point: Vec3, direction: Vec3, distance: f32) -> bool {
        self.first_hit_distance(point, direction)
            .is_some_and(|first| first > distance * (1.0 - SAME_DISTANCE))
    }

    /// Distance to the first intersection with the shape.
    fn first_hit_distance(&self, point: Vec3, direction: Vec3) -> Option<f32> {
        let (origin, direction) = (point.as_dvec3(), direction.as_dvec3());
        let ray = RayF64 { origin, direction, t_max: f64::INFINITY };
        self.shape.intersect(&ray).map(|hit| hit.t)
    }
}

/// Relative difference below which two distances are considered equal.
const SAME_DISTANCE: f32 = 1e-4;
