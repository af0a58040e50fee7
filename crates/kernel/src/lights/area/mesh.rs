//! Mesh lights. Two triangles that form a parallelogram are sampled as a quad. Other meshes are sampled by
//! area if they have few triangles, and with a light tree if they have many.

use super::quad::QuadEmitter;
use super::sample_point::SampledLightPoint;
use super::triangle::TriangleEmitter;
use super::{LightHitPoint, ShapeEmitter};
use crate::control::{CancelToken, Canceled};
use crate::geometry::SurfaceSample;
use crate::geometry::triangle::Triangle;
use crate::lights::sample::{GeometryOfLight, LightSample, ShadowRayEnd};
use crate::lights::tree::{LightBounds, LightTree, MAX_WITHOUT_TREE, Receiver};
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::DiscreteDistribution;
use crate::sampling::warp;

/// Triangles that emit toward the side of (b − a) × (c − a).
#[derive(Clone, Debug, PartialEq)]
pub struct MeshEmitter {
    /// For each triangle, the corners in world coordinates and the primitive index in its object.
    triangles: Vec<([DVec3; 3], u32)>,
    by_area: DiscreteDistribution,
    /// Centroid of the area.
    center: DVec3,
    /// Bounds on the triangles' positions and emission, for a radiance of 1.
    bounds: LightBounds,
    sampling: MeshSampling,
}

/// How points on a mesh light are sampled.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshSampling {
    /// Samples points as on a quad light.
    Quad(Box<TrianglePairQuad>),
    /// Samples points uniformly over the area.
    Area(AreaSampledTriangles),
    /// Picks a triangle with a light tree, then samples a point on this triangle.
    Tree(LightTree),
}

/// A parallelogram made of two triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrianglePairQuad {
    quad: QuadEmitter,
    /// Vector whose dot product with an offset from the corner is below 1 on the triangle at that corner, and
    /// above 1 on the other triangle.
    across: Vec3,
    /// Primitive indices of the two triangles.
    primitives: [u32; 2],
}

/// Triangles sampled uniformly over their area.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaSampledTriangles {
    all: Vec<EmissiveTriangle>,
    by_area: DiscreteDistribution,
    area: f32,
}

/// A triangle whose front faces along `ab` × `ac`.
#[derive(Clone, Debug, PartialEq)]
struct EmissiveTriangle {
    corner: DVec3,
    ab: Vec3,
    ac: Vec3,
    /// Unit normal on the front side.
    normal: Vec3,
    /// Primitive index in the object.
    primitive: u32,
}

impl MeshEmitter {
    /// Creates an emitter from triangles in order of increasing primitive indices. Returns `None` if they
    /// have no area.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn new(triangles: Vec<([DVec3; 3], u32)>, token: &CancelToken) -> Result<Option<Self>, Canceled> {
        let vector_area_of = |[a, b, c]: &[DVec3; 3]| (*b - *a).cross(*c - *a) * 0.5;
        let areas = triangles.iter().map(|(corners, _)| vector_area_of(corners).length());
        let Some(by_area) = DiscreteDistribution::new(areas) else { return Ok(None) };
        let center = triangles.iter().map(|(corners, _)| {
            (corners[0] + corners[1] + corners[2]) / 3.0 * vector_area_of(corners).length()
        });
        let center = center.sum::<DVec3>() / by_area.total();
        let all: Vec<_> = triangles.iter().map(|(corners, _)| LightBounds::from_triangle(corners)).collect();
        let Some(bounds) = LightBounds::union_of_all(all.iter().flatten()) else { return Ok(None) };
        let tree = if all.len() > MAX_WITHOUT_TREE { LightTree::new(&all, token)? } else { None };
        let sampling = match (tree, TrianglePairQuad::from_triangles(&triangles)) {
            (Some(tree), _) => MeshSampling::Tree(tree),
            (None, Some(quad)) => MeshSampling::Quad(Box::new(quad)),
            (None, None) => MeshSampling::Area(AreaSampledTriangles::new(&triangles, &by_area)),
        };
        Ok(Some(Self { triangles, by_area, center, bounds, sampling }))
    }

    /// Primitive indices of the triangles.
    pub fn primitive_indices(&self) -> impl Iterator<Item = u32> {
        self.triangles.iter().map(|(_, primitive)| *primitive)
    }

    /// Samples a point uniformly on the triangle at `index`. Returns the point, the triangle's area, and its
    /// primitive index.
    pub fn sample_point_on_triangle(&self, index: usize, u: Vec2) -> (SurfaceSample, f64, u32) {
        let ([a, b, c], primitive) = &self.triangles[index];
        let weights = warp::triangle(u).as_dvec3();
        let point = *a * weights.x + *b * weights.y + *c * weights.z;
        let vector_area = (*b - *a).cross(*c - *a) * 0.5;
        let area = vector_area.length();
        (SurfaceSample { point, normal: vector_area / area }, area, *primitive)
    }

    /// Bounds on the triangles' positions and emission, for a radiance of 1.
    pub fn light_bounds(&self) -> LightBounds {
        self.bounds
    }

    /// How points on the mesh are sampled.
    #[inline(always)]
    pub fn sampling(&self) -> &MeshSampling {
        &self.sampling
    }

    /// The triangles, if they are sampled by area.
    #[inline(always)]
    pub fn as_area_sampled(&self) -> Option<&AreaSampledTriangles> {
        if let MeshSampling::Area(facets) = &self.sampling { Some(facets) } else { None }
    }

    /// The parallelogram, if the light is sampled as a quad.
    #[inline(always)]
    pub fn as_quad(&self) -> Option<&TrianglePairQuad> {
        if let MeshSampling::Quad(two) = &self.sampling { Some(two) } else { None }
    }

    /// The light tree over the triangles, if there are many.
    pub fn light_tree(&self) -> Option<&LightTree> {
        if let MeshSampling::Tree(tree) = &self.sampling { Some(tree) } else { None }
    }

    /// Samples the light for a surface point with the given normal.
    #[inline(always)]
    pub fn sample(
        &self,
        point: Vec3,
        normal: Vec3,
        u: [f32; 2],
        (radiance, object): (Vec3, u32),
    ) -> Option<LightSample> {
        let (arrival, primitive) = match &self.sampling {
            MeshSampling::Quad(quad) => {
                let arrival = quad.quad.sample(point, u);
                (arrival, quad.primitive_containing(point, arrival.target))
            }
            MeshSampling::Area(facets) => {
                let arrival = facets.sample(point, u);
                (arrival, facets.sampled_primitive(u[0]))
            }
            MeshSampling::Tree(tree) => {
                let pick = tree.pick(&Receiver::with_unknown_lobe(point, normal), f64::from(u[0]))?;
                let (corners, primitive) = &self.triangles[pick.light as usize];
                let rest = (pick.rest as f32).min(1.0_f32.next_down());
                let SampledLightPoint { direction, target, factor } =
                    triangle_emitter(corners)?.sample(point, [rest, u[1]]);
                (SampledLightPoint { direction, target, factor: factor / pick.probability }, *primitive)
            }
        };
        (arrival.factor > 0.0).then(|| LightSample {
            end: ShadowRayEnd::At(arrival.target),
            direction: arrival.direction,
            weight: radiance * arrival.factor,
            source: GeometryOfLight::Primitive(object, primitive),
        })
    }

    /// Implements [`Light::pdf_of_hit`](crate::lights::Light::pdf_of_hit).
    pub fn pdf(&self, from: Vec3, normal: Vec3, hit: &LightHitPoint) -> f32 {
        let tree = match &self.sampling {
            MeshSampling::Quad(quad) => return quad.quad.pdf(from, hit),
            MeshSampling::Area(_) => return hit.uniform_area_solid_angle_pdf(self.by_area.total()),
            MeshSampling::Tree(tree) => tree,
        };
        let index = self.triangles.binary_search_by_key(&hit.primitive, |(_, primitive)| *primitive);
        let own = index.ok().and_then(|index| Some((index, triangle_emitter(&self.triangles[index].0)?)));
        own.map_or(0.0, |(index, own)| {
            tree.probability(&Receiver::with_unknown_lobe(from, normal), index as u32) * own.pdf(from, hit)
        })
    }

    #[cfg(test)]
    pub(crate) fn normal_of(&self, primitive: u32) -> Option<DVec3> {
        let ([a, b, c], _) = self.triangles.iter().find(|(_, other)| *other == primitive)?;
        Some((*b - *a).cross(*c - *a).normalize())
    }

    /// Centroid of the area.
    pub fn area_centroid(&self) -> DVec3 {
        self.center
    }
}

impl TrianglePairQuad {
    /// Maximum deviation of the fourth corner from a parallelogram, relative to its size.
    const MAX_CORNER_DEVIATION: f64 = 1e-5;

    /// The parallelogram formed by two triangles that share an edge, or `None` if they do not form one.
    fn from_triangles(triangles: &[([DVec3; 3], u32)]) -> Option<Self> {
        let [(first, one), (second, two)] = triangles else { return None };
        let normal = |[a, b, c]: &[DVec3; 3]| (b - a).cross(c - a);
        if normal(first).dot(normal(second)) <= 0.0 {
            return None;
        }
        // Find the corner that is only in the first triangle, and the corner that is only in the second.
        let corner = (0..3).find(|&i| !second.contains(&first[i]))?;
        let [p, x, y] = [0, 1, 2].map(|i| first[(corner + i) % 3]);
        let far = second.iter().find(|other| !first.contains(other))?;
        let (u, v) = (x - p, y - p);
        let is_shared = second.contains(&x) && second.contains(&y);
        let is_flat = (p + u + v - far).length() <= Self::MAX_CORNER_DEVIATION * (u.length() + v.length());
        if !(is_shared && is_flat) {
            return None;
        }
        let quad = QuadEmitter::new(p, u, v);
        let [along_u, along_v] = quad.dual_basis();
        Some(Self { quad, across: along_u + along_v, primitives: [*one, *two] })
    }

    /// The parallelogram.
    #[inline(always)]
    pub fn quad(&self) -> &QuadEmitter {
        &self.quad
    }

    /// Primitive index of the triangle that contains the sampled `target`.
    #[inline(always)]
    pub fn primitive_containing(&self, point: Vec3, target: Vec3) -> u32 {
        let offset = (target - point) - self.quad.offset_to_corner(point);
        if offset.dot(self.across) < 1.0 { self.primitives[0] } else { self.primitives[1] }
    }
}

impl AreaSampledTriangles {
    fn new(triangles: &[([DVec3; 3], u32)], by_area: &DiscreteDistribution) -> Self {
        let facet = |&([a, b, c], primitive): &([DVec3; 3], u32)| {
            let (ab, ac) = (b - a, c - a);
            let normal = ab.cross(ac).normalize_or_zero().as_vec3();
            EmissiveTriangle { corner: a, ab: ab.as_vec3(), ac: ac.as_vec3(), normal, primitive }
        };
        let all = triangles.iter().map(facet).collect();
        Self { all, by_area: by_area.clone(), area: by_area.total() as f32 }
    }

    /// Samples the triangles as seen from `point`.
    #[inline(always)]
    pub fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let (index, rest) = self.by_area.sample(u[0]);
        let EmissiveTriangle { corner, ab, ac, normal, .. } = &self.all[index];
        let weights = warp::triangle(Vec2::new(rest, u[1]));
        let offset = (*corner - point.as_dvec3()).as_vec3() + *ab * weights.y + *ac * weights.z;
        let nearness = 1.0 / offset.length_squared().sqrt();
        let direction = offset * nearness;
        let factor = -normal.dot(direction) * self.area * (nearness * nearness);
        let factor = if factor > 0.0 { factor } else { 0.0 };
        SampledLightPoint { direction, target: point + offset, factor }
    }

    /// Primitive index of the sampled triangle, given the sample's first random number.
    #[inline(always)]
    pub fn sampled_primitive(&self, u: f32) -> u32 {
        self.all[self.by_area.sample(u).0].primitive
    }
}

fn triangle_emitter([a, b, c]: &[DVec3; 3]) -> Option<TriangleEmitter> {
    TriangleEmitter::new(&Triangle { a: *a, b: *b, c: *c })
}
