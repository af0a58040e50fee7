//! Shapes that emit.

use super::arrival::Arrival;
use super::cuboid::BoxEmitter;
use super::disk::DiskEmitter;
use super::mesh::{MeshEmitter, QuadOfTwo, Sampling};
use super::pattern::Pattern;
use super::picture::PictureEmitter;
use super::rectangle::QuadEmitter;
use super::round::{ConeSide, CylinderSide, RoundEmitter};
use super::sphere::SphereEmitter;
use super::torus::TorusEmitter;
use super::tree::bounds::{EmissionCone, LightBounds, strength};
use super::triangle::TriangleEmitter;
use super::{End, LightSample, Met, Source};
use crate::geometry::Shape;
use crate::geometry::sphere::Sphere;
use crate::geometry::triangle::Triangle;
use crate::materials::TexturePoint;
use crate::math::{DVec2, DVec3, Vec3};

/// A shape that emits from its front side, with the same radiance in every direction.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Emitting shape.
    pub shape: Emitter,
    /// Radiance; with a pattern, the factor on it.
    pub radiance: Vec3,
    /// Emission texture, by which the radiance is multiplied from point to point.
    pub pattern: Option<Box<Pattern>>,
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

/// The shapes that can emit.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A sphere.
    Sphere(SphereEmitter),
    /// A parallelogram.
    Quad(QuadEmitter),
    /// A parallelogram that is sampled by its emission texture.
    Picture(Box<PictureEmitter>),
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
    /// Triangles of a mesh.
    Mesh(MeshEmitter),
}

/// The light of a shape that emits all over. `None` if the shape is infinite, or has no area.
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
    Some(AreaLight { shape: emitter, radiance, pattern: None, object, part: Part::Whole, bounds })
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
    pub fn with_pattern(mut self, pattern: Pattern) -> Self {
        if let Emitter::Quad(quad) = &self.shape {
            let color = |at: [f64; 2]| pattern.texture().lookup(&TexturePoint::sharp(DVec2::from_array(at)));
            let picture = PictureEmitter::new(*quad, pattern.texture().texels_across(), color);
            if let Some(picture) = picture {
                self.shape = Emitter::Picture(Box::new(picture));
            }
        }
        Self { pattern: Some(Box::new(pattern)), ..self }
    }

    /// The quad on which its points are sampled, and the pair of triangles that forms the quad, if it is one.
    #[inline(always)]
    pub fn quad(&self) -> Option<(&QuadEmitter, Option<&QuadOfTwo>)> {
        match &self.shape {
            Emitter::Quad(quad) => Some((quad, None)),
            Emitter::Mesh(mesh) => match mesh.sampling() {
                Sampling::Quad(two) => Some((two.quad(), Some(two))),
                Sampling::Area(_) | Sampling::Tree(_) => None,
            },
            Emitter::Sphere(_)
            | Emitter::Picture(_)
            | Emitter::Box(_)
            | Emitter::Triangle(_)
            | Emitter::Disk(_)
            | Emitter::Cylinder(_)
            | Emitter::Cone(_)
            | Emitter::Torus(_) => None,
        }
    }

    /// [`Light::sample`](super::Light::sample).
    pub fn sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let sample = self.plain_sample(point, normal, u)?;
        let (Some(pattern), End::At(target)) = (&self.pattern, sample.end) else { return Some(sample) };
        let primitive = match sample.source {
            Source::Primitive(_, primitive) => primitive,
            Source::Object(_) | Source::Nothing => 0,
        };
        Some(LightSample { weight: sample.weight * pattern.at(target, primitive), ..sample })
    }

    /// [`AreaLight::sample`] without its emission texture.
    #[inline]
    pub fn plain_sample(&self, point: Vec3, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let own = |sample: Arrival| {
            let Arrival { direction, target, factor } = sample;
            let (end, source) = (End::At(target), Source::Object(self.object));
            (factor > 0.0).then(|| LightSample { end, direction, weight: self.radiance * factor, source })
        };
        match &self.shape {
            Emitter::Sphere(sphere) => own(sphere.sample(point, u)),
            Emitter::Quad(quad) => own(quad.sample(point, u)),
            Emitter::Picture(picture) => own(picture.sample(point, u)),
            Emitter::Box(cuboid) => own(cuboid.sample(point, u)),
            Emitter::Triangle(triangle) => own(triangle.sample(point, u)),
            Emitter::Disk(disk) => own(disk.sample(point, u)),
            Emitter::Cylinder(cylinder) => own(cylinder.sample(point, u)),
            Emitter::Cone(cone) => own(cone.sample(point, u)),
            Emitter::Torus(torus) => own(torus.sample(point, u)),
            Emitter::Mesh(mesh) => mesh.sample(point, normal, u, (self.radiance, self.object)),
        }
    }

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, normal: Vec3, met: &Met) -> f32 {
        if !(met.normal.dot(met.direction) < 0.0) {
            return 0.0;
        }
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.pdf(from),
            Emitter::Quad(quad) => quad.pdf(from, met),
            Emitter::Picture(picture) => picture.pdf(from, met),
            Emitter::Box(cuboid) => cuboid.pdf(from, met),
            Emitter::Triangle(triangle) => triangle.pdf(from, met),
            Emitter::Disk(disk) => disk.pdf(from, met.direction) as f32,
            Emitter::Cylinder(cylinder) => cylinder.pdf(from, met),
            Emitter::Cone(cone) => cone.pdf(from, met),
            Emitter::Torus(torus) => torus.pdf(from, met),
            Emitter::Mesh(mesh) => mesh.pdf(from, normal, met),
        }
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.center,
            Emitter::Quad(quad) => quad.middle(),
            Emitter::Picture(picture) => picture.middle(),
            Emitter::Box(cuboid) => cuboid.middle(),
            Emitter::Triangle(triangle) => triangle.middle(),
            Emitter::Disk(disk) => disk.middle(),
            Emitter::Cylinder(cylinder) => cylinder.middle(),
            Emitter::Cone(cone) => cone.middle(),
            Emitter::Torus(torus) => torus.middle(),
            Emitter::Mesh(mesh) => mesh.middle(),
        }
    }
}
