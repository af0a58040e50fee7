//! Emissive triangles of a mesh, by area.

use super::{End, LightSample, Source};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::Discrete;
use crate::sampling::warp;

/// Triangles that shine along (b − a) × (c − a).
#[derive(Clone, Debug, PartialEq)]
pub struct MeshEmitter {
    /// Corners in world coordinates, with the number each has in its object.
    triangles: Vec<([DVec3; 3], u32)>,
    by_area: Discrete,
    /// Centre of area.
    center: DVec3,
    /// Sum of the normals times the areas.
    vector_area: DVec3,
}

impl MeshEmitter {
    /// From corners with their primitive numbers; none where there is no area.
    pub fn new(triangles: Vec<([DVec3; 3], u32)>) -> Option<Self> {
        let vector_area_of = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a) * 0.5;
        let areas = triangles.iter().map(|(corners, _)| vector_area_of(corners).length());
        let by_area = Discrete::new(areas)?;
        let center = triangles.iter().map(|(corners, _)| {
            (corners[0] + corners[1] + corners[2]) / 3.0 * vector_area_of(corners).length()
        });
        let center = center.sum::<DVec3>() / by_area.total();
        let vector_area = triangles.iter().map(|(corners, _)| vector_area_of(corners)).sum();
        Some(Self { triangles, by_area, center, vector_area })
    }

    /// The numbers that its triangles have in their object.
    pub fn primitives(&self) -> impl Iterator<Item = u32> {
        self.triangles.iter().map(|(_, primitive)| *primitive)
    }

    /// Of all triangles.
    pub fn area(&self) -> f64 {
        self.by_area.total()
    }

    /// Uniform over the area of all.
    pub fn sample(&self, point: Vec3, u: [f32; 2], radiance: Vec3, object: u32) -> Option<LightSample> {
        let (index, rest) = self.by_area.sample(u[0]);
        let ([a, b, c], primitive) = &self.triangles[index];
        let weights = warp::triangle(Vec2::new(rest, u[1])).as_dvec3();
        let target = *a * weights.x + *b * weights.y + *c * weights.z;
        let offset = target - point.as_dvec3();
        let distance_squared = offset.length_squared();
        let direction = offset / distance_squared.sqrt();
        let cosine = -(*b - *a).cross(*c - *a).normalize().dot(direction);
        (cosine > 0.0).then(|| LightSample {
            end: End::At(target.as_vec3()),
            direction: direction.as_vec3(),
            weight: radiance * (self.by_area.total() * cosine / distance_squared) as f32,
            source: Source::Primitive(object, *primitive),
        })
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        self.center
    }
}
