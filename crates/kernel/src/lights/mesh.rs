//! Emissive triangles of a mesh: few by area, many by a tree over them.

use super::tree::{LightBounds, LightTree, MOST_WITHOUT, Receiver};
use super::triangle::TriangleEmitter;
use super::{End, LightSample, Met, Source};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::AreaPoint;
use crate::geometry::triangle::Triangle;
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
    /// Where the triangles are and what they send, for a unit of radiance.
    bounds: LightBounds,
    /// Over the triangles, where they are many.
    tree: Option<LightTree>,
}

impl MeshEmitter {
    /// From corners with their primitive numbers, which increase; none where there is no area.
    ///
    /// # Errors
    /// [`Cancelled`] when the token was told so.
    pub fn new(triangles: Vec<([DVec3; 3], u32)>, token: &CancelToken) -> Result<Option<Self>, Cancelled> {
        let vector_area_of = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a) * 0.5;
        let areas = triangles.iter().map(|(corners, _)| vector_area_of(corners).length());
        let Some(by_area) = Discrete::new(areas) else { return Ok(None) };
        let center = triangles.iter().map(|(corners, _)| {
            (corners[0] + corners[1] + corners[2]) / 3.0 * vector_area_of(corners).length()
        });
        let center = center.sum::<DVec3>() / by_area.total();
        let all: Vec<_> = triangles.iter().map(|(corners, _)| LightBounds::of_triangle(corners)).collect();
        let Some(bounds) = LightBounds::around(all.iter().flatten()) else { return Ok(None) };
        let tree = if all.len() > MOST_WITHOUT { LightTree::new(&all, token)? } else { None };
        Ok(Some(Self { triangles, by_area, center, bounds, tree }))
    }

    /// The numbers that its triangles have in their object.
    pub fn primitives(&self) -> impl Iterator<Item = u32> {
        self.triangles.iter().map(|(_, primitive)| *primitive)
    }

    /// A point of one of its triangles, uniform over it, with the triangle's area and its number in the object.
    pub fn place(&self, index: usize, u: Vec2) -> (AreaPoint, f64, u32) {
        let ([a, b, c], primitive) = &self.triangles[index];
        let weights = warp::triangle(u).as_dvec3();
        let point = *a * weights.x + *b * weights.y + *c * weights.z;
        let vector_area = (*b - *a).cross(*c - *a) * 0.5;
        let area = vector_area.length();
        (AreaPoint { point, normal: vector_area / area }, area, *primitive)
    }

    /// Where the triangles are and what they send, for a unit of radiance.
    pub fn bounds(&self) -> LightBounds {
        self.bounds
    }

    /// The tree over its triangles.
    pub fn tree(&self) -> Option<&LightTree> {
        self.tree.as_ref()
    }

    /// For a point of a surface with this normal: uniform over the area of all triangles, or one of them by the tree, and its
    /// solid angle.
    #[inline(always)]
    pub fn sample(
        &self,
        point: Vec3,
        normal: Vec3,
        u: [f32; 2],
        (radiance, object): (Vec3, u32),
    ) -> Option<LightSample> {
        match &self.tree {
            Some(tree) => {
                let pick = tree.pick(&Receiver::plain(point, normal), f64::from(u[0]))?;
                let (corners, primitive) = &self.triangles[pick.light as usize];
                let rest = (pick.rest as f32).min(1.0_f32.next_down());
                let arrival = emitter(corners)?.sample(point, [rest, u[1]]);
                (arrival.factor > 0.0).then(|| LightSample {
                    end: End::At(arrival.target),
                    direction: arrival.direction,
                    weight: radiance * (arrival.factor / pick.probability),
                    source: Source::Primitive(object, *primitive),
                })
            }
            None => self.sample_by_area(point, u, radiance, object),
        }
    }

    fn sample_by_area(&self, point: Vec3, u: [f32; 2], radiance: Vec3, object: u32) -> Option<LightSample> {
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

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, normal: Vec3, met: &Met) -> f32 {
        let Some(tree) = &self.tree else { return met.pdf_by_area(self.by_area.total()) };
        let index = self.triangles.binary_search_by_key(&met.primitive, |(_, primitive)| *primitive);
        let own = index.ok().and_then(|index| Some((index, emitter(&self.triangles[index].0)?)));
        own.map_or(0.0, |(index, own)| {
            tree.probability(&Receiver::plain(from, normal), index as u32) * own.pdf(from, met)
        })
    }

    #[cfg(test)]
    pub(super) fn normal_of(&self, primitive: u32) -> Option<DVec3> {
        let ([a, b, c], _) = self.triangles.iter().find(|(_, other)| *other == primitive)?;
        Some((*b - *a).cross(*c - *a).normalize())
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        self.center
    }
}

fn emitter([a, b, c]: &[DVec3; 3]) -> Option<TriangleEmitter> {
    TriangleEmitter::new(&Triangle { a: *a, b: *b, c: *c })
}
