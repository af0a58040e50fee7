//! Shapes that emit, one file each.
//!
//! [`ShapeEmitter`] is all that a shape tells as a light. To add one: its file, its variant of [`Emitter`] with the arm of
//! `of_any` and of [`area_light`], and the bounds of its emission, if it is flat. A shape without a loop of its own in `row` is
//! sampled point by point.

pub mod cuboid;
pub mod disk;
pub mod emission_texture;
pub mod inside;
mod linear;
mod meridians;
pub mod mesh;
pub mod quad;
pub mod round;
pub(super) mod row;
mod sample_point;
pub mod sheer;
pub mod sphere;
pub mod textured_quad;
pub mod torus;
pub mod triangle;

pub use emission_texture::{Chart, EmissionTexture, Patch};
pub use mesh::MeshEmitter;
pub use sample_point::LightSamplePoint;

use super::sample::{End, LightHit, LightSample, Source};
use super::tree::bounds::{EmissionCone, LightBounds, strength};
use crate::geometry::Shape;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::triangle::Triangle;
use crate::math::{DVec2, DVec3, Vec3};
use cuboid::BoxEmitter;
use disk::DiskEmitter;
use inside::InsideEmitter;
use mesh::QuadOfTwo;
use quad::QuadEmitter;
use round::{ConeSide, CylinderSide, RoundEmitter};
use sheer::SheerEmitter;
use sphere::SphereEmitter;
use textured_quad::TexturedQuadEmitter;
use torus::TorusEmitter;
use triangle::TriangleEmitter;

/// A shape whose front emits the same radiance in every direction.
pub trait ShapeEmitter {
    /// Samples a point of the front that is visible from `point`, by numbers in [0, 1).
    fn sample(&self, point: Vec3, u: [f32; 2]) -> LightSamplePoint;

    /// Pdf in sr⁻¹ of [`ShapeEmitter::sample`] at a point of the front that a ray from `from` hits.
    fn pdf(&self, from: Vec3, met: &LightHit) -> f32;

    /// Centre of area.
    fn middle(&self) -> DVec3;
}

/// A shape that emits from one side, with the same radiance in every direction. A shape that emits from both sides is two lights.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitting shape, with its front on the side that emits.
    pub shape: Emitter,
    /// The side of the object that emits.
    pub side: Side,
    /// Radiance; with a texture, the factor on it.
    pub radiance: Vec3,
    /// Emission texture, by which the radiance is multiplied from point to point.
    pub texture: Option<Box<EmissionTexture>>,
    /// Number of the object.
    pub object: u32,
    /// Part of the object.
    pub part: Part,
    /// Bounds on the light's position, directions and power.
    pub bounds: LightBounds,
}

/// Part of an object that a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    Whole,
    /// The triangles that the emitter lists.
    Listed,
}

/// A side of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The front.
    Front,
    /// The back: the inside of closed shapes.
    Back,
}

/// The shapes that can emit.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A sphere.
    Sphere(SphereEmitter),
    /// A parallelogram.
    Quad(QuadEmitter),
    /// A parallelogram that is sampled by its emission texture.
    TexturedQuad(Box<TexturedQuadEmitter>),
    /// A box.
    Box(BoxEmitter),
    /// A triangle.
    Triangle(TriangleEmitter),
    /// A disk.
    Disk(DiskEmitter),
    /// A cylinder.
    Cylinder(Box<RoundEmitter<CylinderSide>>),
    /// A cone.
    Cone(Box<RoundEmitter<ConeSide>>),
    /// A torus.
    Torus(TorusEmitter),
    /// The inside of a shape.
    Inside(Box<InsideEmitter>),
    /// A side of a shape that lets light pass, whose near parts do not hide the others.
    Sheer(Box<SheerEmitter>),
    /// Triangles of a mesh.
    Mesh(MeshEmitter),
}

/// Calls the same method of an emitter of any shape; a mesh has an arm of its own, as its triangles may have lights of their own.
macro_rules! of_any {
    ($emitter:expr, $it:ident => $asked:expr, $mesh:ident => $of_mesh:expr) => {
        match $emitter {
            Emitter::Sphere($it) => $asked,
            Emitter::Quad($it) => $asked,
            Emitter::TexturedQuad($it) => $asked,
            Emitter::Box($it) => $asked,
            Emitter::Triangle($it) => $asked,
            Emitter::Disk($it) => $asked,
            Emitter::Cylinder($it) => $asked,
            Emitter::Cone($it) => $asked,
            Emitter::Torus($it) => $asked,
            Emitter::Inside($it) => $asked,
            Emitter::Sheer($it) => $asked,
            Emitter::Mesh($mesh) => $of_mesh,
        }
    };
}

impl Emitter {
    /// The sphere. `None` for other shapes.
    #[inline(always)]
    pub fn as_sphere(&self) -> Option<&SphereEmitter> {
        if let Self::Sphere(sphere) = self { Some(sphere) } else { None }
    }

    /// The triangles of a mesh. `None` for other shapes.
    #[inline(always)]
    pub fn as_mesh(&self) -> Option<&MeshEmitter> {
        if let Self::Mesh(mesh) = self { Some(mesh) } else { None }
    }

    /// The quad on which its points are sampled, and the pair of triangles that forms the quad, if it is one.
    #[inline(always)]
    pub fn as_quad(&self) -> Option<(&QuadEmitter, Option<&QuadOfTwo>)> {
        if let Self::Quad(quad) = self {
            return Some((quad, None));
        }
        self.as_mesh().and_then(MeshEmitter::quad_of_two).map(|two| (two.quad(), Some(two)))
    }
}

/// The light of the front of a shape that emits all over. `None` if the shape is infinite, or has no area.
pub fn area_light(shape: &Shape, radiance: Vec3, object: u32) -> Option<AreaLight> {
    let emitter = match shape {
        Shape::Sphere(sphere) => {
            let Sphere { center, radius } = *sphere;
            Emitter::Sphere(SphereEmitter { center, radius })
        }
        Shape::Quad(quad) => Emitter::Quad(QuadEmitter::new(quad.corner, quad.u, quad.v)),
        Shape::Box(cuboid) => Emitter::Box(BoxEmitter::new(cuboid)),
        Shape::Triangle(triangle) => Emitter::Triangle(TriangleEmitter::new(triangle)?),
        Shape::Disk(disk) => Emitter::Disk(DiskEmitter::new(disk)),
        Shape::Cylinder(cylinder) => Emitter::Cylinder(Box::new(RoundEmitter::of_cylinder(cylinder))),
        Shape::Cone(cone) => Emitter::Cone(Box::new(RoundEmitter::of_cone(cone))),
        Shape::Torus(torus) => Emitter::Torus(TorusEmitter::new(*torus)),
        Shape::Plane(_) => return None,
    };
    let bounds = bounds(shape, radiance)?;
    let (side, texture, part) = (Side::Front, None, Part::Whole);
    Some(AreaLight { shape: emitter, side, radiance, texture, object, part, bounds })
}

/// The light of a side of a shape that emits all over, and which light may pass. `None` if the shape is infinite, or has no area.
pub fn sheer_light(shape: &Shape, side: Side, radiance: Vec3, object: u32) -> Option<AreaLight> {
    let hides_itself = match (shape, side) {
        (Shape::Quad(_) | Shape::Triangle(_) | Shape::Disk(_) | Shape::Plane(_), _) => false,
        // From outside, each place of their front is alone in its direction.
        (Shape::Sphere(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_), Side::Front) => false,
        (Shape::Sphere(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_), Side::Back) => true,
        (Shape::Torus(_), _) => true,
    };
    let light = match side {
        Side::Front => area_light(shape, radiance, object)?,
        Side::Back => back_light(shape, radiance, object)?,
    };
    let sheer = if hides_itself { SheerEmitter::new(shape, side) } else { None };
    Some(match sheer {
        Some(sheer) => AreaLight { shape: Emitter::Sheer(Box::new(sheer)), ..light },
        None => light,
    })
}

/// The light of the back of a shape that emits all over. `None` if the shape is infinite, or has no area.
pub fn back_light(shape: &Shape, radiance: Vec3, object: u32) -> Option<AreaLight> {
    let turned = match shape {
        Shape::Quad(quad) => Some(Shape::Quad(Parallelogram::new(quad.corner, quad.v, quad.u))),
        Shape::Triangle(Triangle { a, b, c }) => Some(Shape::Triangle(Triangle { a: *a, b: *c, c: *b })),
        Shape::Disk(disk) => Some(Shape::Disk(Disk::new(disk.centroid(), -disk.normal(), disk.radius()))),
        Shape::Plane(_) => return None,
        Shape::Sphere(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_) | Shape::Torus(_) => None,
    };
    let light = area_light(turned.as_ref().unwrap_or(shape), radiance, object)?;
    let emitter = match turned {
        Some(_) => light.shape,
        None => Emitter::Inside(Box::new(InsideEmitter::new(shape)?)),
    };
    Some(AreaLight { shape: emitter, side: Side::Back, ..light })
}

/// Bounds of a shape's emission. `None` if the shape is infinite. Flat shapes emit by the cosine. Others emit a quarter of their
/// area times the radiance in any direction, which is the mean over directions for a convex shape (Cauchy).
fn bounds(shape: &Shape, radiance: Vec3) -> Option<LightBounds> {
    let normal = match shape {
        Shape::Quad(quad) => Some(quad.u.cross(quad.v)),
        Shape::Triangle(Triangle { a, b, c }) => Some((b - a).cross(c - a)),
        Shape::Disk(disk) => Some(disk.normal()),
        Shape::Sphere(_)
        | Shape::Plane(_)
        | Shape::Box(_)
        | Shape::Cylinder(_)
        | Shape::Cone(_)
        | Shape::Torus(_) => None,
    };
    let area: f64 = shape.areas().iter().sum();
    let (shown, cone) = match normal.map(DVec3::normalize) {
        Some(normal) => (area, EmissionCone::of_front(normal)),
        None => (0.25 * area, EmissionCone::ALL),
    };
    Some(LightBounds::in_box(shape.bounds()?, strength(radiance) * shown, cone))
}

impl AreaLight {
    /// The light with an emission texture, by which a quad is sampled as well.
    pub fn with_texture(mut self, texture: EmissionTexture) -> Self {
        if let (Emitter::Quad(quad), true) = (&self.shape, texture.has_places()) {
            // The edges of a back are in the other order.
            let ordered = |[u, v]: [f64; 2]| match self.side {
                Side::Front => [u, v],
                Side::Back => [v, u],
            };
            let color = |at: [f64; 2]| texture.lookup(DVec2::from_array(ordered(at)));
            let across = ordered(texture.texels_across());
            let picture = TexturedQuadEmitter::new(*quad, across, color);
            if let Some(picture) = picture {
                self.shape = Emitter::TexturedQuad(Box::new(picture));
            }
        }
        Self { texture: Some(Box::new(texture)), ..self }
    }

    /// [`Light::sample`](super::Light::sample).
    pub fn sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.plain_sample(point, normal, u)?;
        let (Some(texture), End::At(target)) = (&self.texture, sample.end) else { return Some(sample) };
        let primitive = match sample.source {
            Source::Primitive(_, primitive) => primitive,
            Source::Object(_) | Source::Sheer(_) | Source::Nothing => 0,
        };
        Some(LightSample {
            weight: sample.weight * texture.at(target, primitive, sample.direction),
            ..sample
        })
    }

    /// [`AreaLight::sample`] without its emission texture.
    #[inline]
    pub fn plain_sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let own = |sample: LightSamplePoint| {
            let LightSamplePoint { direction, target, factor } = sample;
            let (end, source) = (End::At(target), self.source());
            (factor > 0.0).then(|| LightSample { end, direction, weight: self.radiance * factor, source })
        };
        of_any!(&self.shape,
            it => own(it.sample(point, u)),
            mesh => mesh.sample(point, normal, u, (self.radiance, self.object)))
    }

    /// The part of the scene that the samples lie on.
    pub(super) fn source(&self) -> Source {
        let is_sheer = matches!(self.shape, Emitter::Sheer(_));
        if is_sheer { Source::Sheer(self.object) } else { Source::Object(self.object) }
    }

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, normal: Vec3, met: &LightHit) -> f32 {
        let met = &match self.side {
            Side::Front => *met,
            Side::Back => LightHit { normal: -met.normal, ..*met },
        };
        if !(met.normal.dot(met.direction) < 0.0) {
            return 0.0;
        }
        of_any!(&self.shape, it => it.pdf(from, met), mesh => mesh.pdf(from, normal, met))
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        of_any!(&self.shape, it => it.middle(), mesh => mesh.middle())
    }
}
