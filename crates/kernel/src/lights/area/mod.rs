//! Emitting shapes, one file each.
//!
//! Each shape implements its light sampling in a [`ShapeEmitter`]. To add a shape, add its file, a variant of
//! [`Emitter`], and arms in `of_any` and [`new_front_area_light`]. If the shape is flat, also add bounds on
//! its emission. Shapes without a loop in `packet` are sampled point by point.

pub mod cuboid;
pub mod disk;
pub mod emission_modulation;
pub mod inside;
mod meridians;
pub mod mesh;
pub(super) mod packet;
mod piecewise_linear;
pub mod quad;
mod sample_point;
pub mod see_through;
pub mod sphere;
pub mod surface_of_revolution;
pub mod textured_quad;
pub mod torus;
pub mod transformed;
pub mod triangle;

pub use emission_modulation::{
    BlendPartWeight, EmissionModulation, EmissionTerm, TriangleWithUvs, UvMapping,
};
pub use mesh::MeshEmitter;
pub use sample_point::SampledLightPoint;

use super::sample::{GeometryOfLight, LightHitPoint, LightSample, ShadowRayEnd};
use super::tree::bounds::{EmissionCone, LightBounds, mean_channel};
use crate::geometry::Shape;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::transformed::TransformedShape;
use crate::geometry::triangle::Triangle;
use crate::math::{DVec2, DVec3, Vec2, Vec3};
use cuboid::BoxEmitter;
use disk::DiskEmitter;
use inside::InwardEmitter;
use mesh::TrianglePairQuad;
use quad::QuadEmitter;
use see_through::SeeThroughSideEmitter;
use sphere::SphereEmitter;
use surface_of_revolution::{CappedRevolutionEmitter, ConeSide, CylinderSide};
use textured_quad::TexturedQuadEmitter;
use torus::TorusEmitter;
use transformed::TransformedEmitter;
use triangle::TriangleEmitter;

/// A shape whose front emits the same radiance in every direction.
pub trait ShapeEmitter {
    /// Samples a point on the front that is visible from `point`. `u` is in [0, 1)².
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint;

    /// Pdf of [`ShapeEmitter::sample`] in sr⁻¹. `hit` is the point on the front that a ray from `from` hits.
    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32;

    /// Centroid of the area.
    fn area_centroid(&self) -> DVec3;
}

/// A surface that emits uniformly from one side. A two-sided emitter is represented by two lights.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// The emitting shape. The front is the side that emits.
    pub shape: Emitter,
    /// The side of the object that emits.
    pub side: Side,
    /// Radiance, or a factor applied to the modulation if there is one.
    pub radiance: Vec3,
    /// Factor that varies over the light, or `None` for constant radiance.
    pub modulation: Option<Box<EmissionModulation>>,
    /// Index of the object.
    pub object: u32,
    /// The part of the object that emits.
    pub part: EmittingPart,
    /// Bounds on the light's position, directions, and power.
    pub bounds: LightBounds,
}

/// The part of an object to which a light belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmittingPart {
    /// The entire object.
    Whole,
    /// The triangles that the emitter lists.
    Listed,
}

/// A side of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The front.
    Front,
    /// The back, which is the inside of closed shapes.
    Back,
}

/// Any shape that can emit.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A sphere.
    Sphere(SphereEmitter),
    /// A parallelogram.
    Quad(QuadEmitter),
    /// A parallelogram that importance-samples its emission texture.
    TexturedQuad(Box<TexturedQuadEmitter>),
    /// A box.
    Box(BoxEmitter),
    /// A triangle.
    Triangle(TriangleEmitter),
    /// A disk.
    Disk(DiskEmitter),
    /// A cylinder.
    Cylinder(Box<CappedRevolutionEmitter<CylinderSide>>),
    /// A cone.
    Cone(Box<CappedRevolutionEmitter<ConeSide>>),
    /// A torus.
    Torus(TorusEmitter),
    /// The front of a transformed shape.
    Transformed(Box<TransformedEmitter>),
    /// The inside of a shape.
    Inside(Box<InwardEmitter>),
    /// One side of a see-through shape. Near parts do not occlude far parts.
    SeeThrough(Box<SeeThroughSideEmitter>),
    /// Triangles of a mesh.
    Mesh(MeshEmitter),
}

/// Evaluates an expression with `$it` bound to the concrete emitter. Meshes have a separate arm because their
/// triangles are separate primitives.
macro_rules! of_any {
    ($emitter:expr, $it:ident => $body:expr, $mesh:ident => $of_mesh:expr) => {
        match $emitter {
            Emitter::Sphere($it) => $body,
            Emitter::Quad($it) => $body,
            Emitter::TexturedQuad($it) => $body,
            Emitter::Box($it) => $body,
            Emitter::Triangle($it) => $body,
            Emitter::Disk($it) => $body,
            Emitter::Cylinder($it) => $body,
            Emitter::Cone($it) => $body,
            Emitter::Torus($it) => $body,
            Emitter::Transformed($it) => $body,
            Emitter::Inside($it) => $body,
            Emitter::SeeThrough($it) => $body,
            Emitter::Mesh($mesh) => $of_mesh,
        }
    };
}

/// For emitters in their own coordinates. Meshes are never transformed this way.
impl ShapeEmitter for Emitter {
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        of_any!(self, it => it.sample(point, u), _mesh => SampledLightPoint::NOTHING)
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        of_any!(self, it => it.pdf(from, hit), _mesh => 0.0)
    }

    fn area_centroid(&self) -> DVec3 {
        of_any!(self, it => it.area_centroid(), mesh => mesh.area_centroid())
    }
}

impl Emitter {
    /// The sphere, or `None` for other shapes.
    #[inline(always)]
    pub fn as_sphere(&self) -> Option<&SphereEmitter> {
        if let Self::Sphere(sphere) = self { Some(sphere) } else { None }
    }

    /// The triangles of a mesh, or `None` for other shapes.
    #[inline(always)]
    pub fn as_mesh(&self) -> Option<&MeshEmitter> {
        if let Self::Mesh(mesh) = self { Some(mesh) } else { None }
    }

    /// The quad to sample, along with the triangle pair if the quad is made of two triangles. Returns `None`
    /// for other shapes.
    #[inline(always)]
    pub fn as_quad(&self) -> Option<(&QuadEmitter, Option<&TrianglePairQuad>)> {
        if let Self::Quad(quad) = self {
            return Some((quad, None));
        }
        self.as_mesh().and_then(MeshEmitter::as_quad).map(|two| (two.quad(), Some(two)))
    }
}

/// Creates the light on the front of a shape, or returns `None` if the shape is infinite or has no area.
pub fn new_front_area_light(shape: &Shape, radiance: Vec3, object: u32) -> Option<AreaLight> {
    let (emitter, bounds) = (front_emitter(shape)?, emission_bounds(shape, radiance)?);
    let (side, modulation, part) = (Side::Front, None, EmittingPart::Whole);
    Some(AreaLight { shape: emitter, side, radiance, modulation, object, part, bounds })
}

/// Creates the emitter for the front of a shape.
fn front_emitter(shape: &Shape) -> Option<Emitter> {
    Some(match shape {
        Shape::Sphere(sphere) => {
            let Sphere { center, radius } = *sphere;
            Emitter::Sphere(SphereEmitter { center, radius })
        }
        Shape::Quad(quad) => Emitter::Quad(QuadEmitter::new(quad.corner, quad.u, quad.v)),
        Shape::Box(cuboid) => Emitter::Box(BoxEmitter::new(cuboid)),
        Shape::Triangle(triangle) => Emitter::Triangle(TriangleEmitter::new(triangle)?),
        Shape::Disk(disk) => Emitter::Disk(DiskEmitter::new(disk)),
        Shape::Cylinder(cylinder) => {
            Emitter::Cylinder(Box::new(CappedRevolutionEmitter::from_entire_cylinder(cylinder)))
        }
        Shape::Cone(cone) => Emitter::Cone(Box::new(CappedRevolutionEmitter::from_entire_cone(cone))),
        Shape::Torus(torus) => Emitter::Torus(TorusEmitter::new(*torus)),
        Shape::Transformed(own) => {
            Emitter::Transformed(Box::new(TransformedEmitter::new(front_emitter(&own.shape)?, own)))
        }
        Shape::Plane(_) => return None,
    })
}

/// Creates the light on one side of a see-through shape, or returns `None` if the shape is infinite or has no
/// area.
pub fn new_see_through_side_light(
    shape: &Shape,
    side: Side,
    radiance: Vec3,
    object: u32,
) -> Option<AreaLight> {
    let untransformed = if let Shape::Transformed(own) = shape { &own.shape } else { shape };
    let hides_itself = match (untransformed, side) {
        (Shape::Quad(_) | Shape::Triangle(_) | Shape::Disk(_) | Shape::Plane(_), _) => false,
        // A ray from outside hits the front of a convex shape at most once.
        (Shape::Sphere(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_), Side::Front) => false,
        (Shape::Sphere(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_), Side::Back) => true,
        (Shape::Torus(_) | Shape::Transformed(_), _) => true,
    };
    let light = match side {
        Side::Front => new_front_area_light(shape, radiance, object)?,
        Side::Back => new_back_area_light(shape, radiance, object)?,
    };
    let see_through = if hides_itself { SeeThroughSideEmitter::new(shape, side) } else { None };
    Some(match see_through {
        Some(see_through) => AreaLight { shape: Emitter::SeeThrough(Box::new(see_through)), ..light },
        None => light,
    })
}

/// Creates the light on the back of a shape, or returns `None` if the shape is infinite or has no area.
pub fn new_back_area_light(shape: &Shape, radiance: Vec3, object: u32) -> Option<AreaLight> {
    let turned = turned_over_if_flat(shape);
    let light = new_front_area_light(turned.as_ref().unwrap_or(shape), radiance, object)?;
    let emitter = match turned {
        Some(_) => light.shape,
        None => Emitter::Inside(Box::new(InwardEmitter::new(shape)?)),
    };
    Some(AreaLight { shape: emitter, side: Side::Back, ..light })
}

/// Turns a flat shape over so that its front faces the other way. Returns `None` for other shapes.
fn turned_over_if_flat(shape: &Shape) -> Option<Shape> {
    match shape {
        Shape::Quad(quad) => Some(Shape::Quad(Parallelogram::new(quad.corner, quad.v, quad.u))),
        Shape::Triangle(Triangle { a, b, c }) => Some(Shape::Triangle(Triangle { a: *a, b: *c, c: *b })),
        Shape::Disk(disk) => Some(Shape::Disk(Disk::new(disk.centroid(), -disk.normal(), disk.radius()))),
        Shape::Transformed(own) => turned_over_if_flat(&own.shape)
            .map(|shape| Shape::Transformed(Box::new(TransformedShape::new(shape, own.to_world)))),
        Shape::Plane(_)
        | Shape::Sphere(_)
        | Shape::Box(_)
        | Shape::Cylinder(_)
        | Shape::Cone(_)
        | Shape::Torus(_) => None,
    }
}

/// Normal of a flat shape's front, of any length, or `None` for other shapes.
fn normal_if_flat(shape: &Shape) -> Option<DVec3> {
    match shape {
        Shape::Quad(quad) => Some(quad.u.cross(quad.v)),
        Shape::Triangle(Triangle { a, b, c }) => Some((b - a).cross(c - a)),
        Shape::Disk(disk) => Some(disk.normal()),
        Shape::Transformed(own) => Some(own.to_world.normal(normal_if_flat(&own.shape)?)),
        Shape::Sphere(_)
        | Shape::Plane(_)
        | Shape::Box(_)
        | Shape::Cylinder(_)
        | Shape::Cone(_)
        | Shape::Torus(_) => None,
    }
}

/// Area of a shape, estimated on a grid of points if the shape is transformed.
fn area(shape: &Shape) -> f64 {
    let areas = shape.local_part_areas();
    let Shape::Transformed(_) = shape else { return areas.iter().sum() };
    const SIDE: u32 = 16;
    let grid = |i: u32| (Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) + 0.5) / SIDE as f32;
    let scale = |part: u32, i: u32| {
        shape.area_scale_for_world_normal(shape.sample_point_on_part(part, grid(i)).normal)
    };
    let mean = |part: u32| (0..SIDE * SIDE).map(|i| scale(part, i)).sum::<f64>() / f64::from(SIDE * SIDE);
    (0..).zip(areas).map(|(part, area)| if area > 0.0 { area * mean(part) } else { 0.0 }).sum()
}

/// Bounds on a shape's emission, or `None` if the shape is infinite. Flat shapes emit with a cosine falloff.
/// Other shapes are assumed to emit a quarter of their area times the radiance in every direction, which is
/// the mean over all directions for convex shapes (Cauchy).
fn emission_bounds(shape: &Shape, radiance: Vec3) -> Option<LightBounds> {
    let area = area(shape);
    let (shown, cone) = match normal_if_flat(shape).map(DVec3::normalize) {
        Some(normal) => (area, EmissionCone::lambertian(normal)),
        None => (0.25 * area, EmissionCone::ALL),
    };
    Some(LightBounds::from_bounding_box(shape.bounds()?, mean_channel(radiance) * shown, cone))
}

impl AreaLight {
    /// Adds an emission modulation. If it varies with position, quads are importance sampled accordingly.
    pub fn with_modulation(mut self, modulation: EmissionModulation) -> Self {
        if let (Emitter::Quad(quad), true) = (&self.shape, modulation.varies_with_position()) {
            // The two edges are swapped on the back.
            let ordered = |[u, v]: [f64; 2]| match self.side {
                Side::Front => [u, v],
                Side::Back => [v, u],
            };
            let color =
                |at: [f64; 2]| modulation.factor_at_uv(DVec2::from_array(ordered(at)), || quad.point_at(at));
            let across = ordered(modulation.texels_per_uv_unit());
            let textured = TexturedQuadEmitter::new(*quad, across, color);
            if let Some(textured) = textured {
                self.shape = Emitter::TexturedQuad(Box::new(textured));
            }
        }
        Self { modulation: Some(Box::new(modulation)), ..self }
    }

    /// Implements [`Light::sample`](super::Light::sample).
    pub fn sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.sample_unmodulated(point, normal, u)?;
        let (Some(modulation), ShadowRayEnd::At(target)) = (&self.modulation, sample.end) else {
            return Some(sample);
        };
        let primitive = match sample.source {
            GeometryOfLight::Primitive(_, primitive) => primitive,
            GeometryOfLight::Object(_) | GeometryOfLight::SeeThrough(_) | GeometryOfLight::Nothing => 0,
        };
        Some(LightSample {
            weight: sample.weight * modulation.radiance_factor(target, primitive, sample.direction),
            ..sample
        })
    }

    /// [`AreaLight::sample`] without the emission modulation.
    #[inline]
    pub fn sample_unmodulated(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let own = |sample: SampledLightPoint| {
            let SampledLightPoint { direction, target, factor } = sample;
            let (end, source) = (ShadowRayEnd::At(target), self.geometry_of_light());
            (factor > 0.0).then(|| LightSample { end, direction, weight: self.radiance * factor, source })
        };
        of_any!(&self.shape,
            it => own(it.sample(point, u)),
            mesh => mesh.sample(point, normal, u, (self.radiance, self.object)))
    }

    /// The light's geometry.
    pub(super) fn geometry_of_light(&self) -> GeometryOfLight {
        let is_sheer = matches!(self.shape, Emitter::SeeThrough(_));
        if is_sheer { GeometryOfLight::SeeThrough(self.object) } else { GeometryOfLight::Object(self.object) }
    }

    /// Implements [`Light::pdf_of_hit`](super::Light::pdf_of_hit).
    pub fn pdf(&self, from: Vec3, normal: Vec3, hit: &LightHitPoint) -> f32 {
        let hit = &match self.side {
            Side::Front => *hit,
            Side::Back => LightHitPoint { normal: -hit.normal, ..*hit },
        };
        if !(hit.normal.dot(hit.direction) < 0.0) {
            return 0.0;
        }
        of_any!(&self.shape, it => it.pdf(from, hit), mesh => mesh.pdf(from, normal, hit))
    }

    /// Centroid of the area.
    pub fn area_centroid(&self) -> DVec3 {
        self.shape.area_centroid()
    }
}
