//! Shapes that emit.

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

/// A shape that sends out light from its front side, in every direction alike.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Which shape.
    pub shape: Emitter,
    /// Its radiance; with a pattern, what that is multiplied by.
    pub radiance: Vec3,
    /// What it is multiplied by from point to point.
    pub pattern: Option<Box<Pattern>>,
    /// The object that it is.
    pub object: u32,
    /// Which part of it.
    pub part: Part,
    /// Where it is and what it sends.
    pub bounds: LightBounds,
}

/// Which part of an object a light is.
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
    /// A parallelogram that is sampled by its picture.
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

/// The light that a shape is where all of it shines; none where it has no end, or no area.
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

/// Where a shape is and what it sends; none where it has no end. What is flat sends by the cosine, all else a quarter of its area
/// times its radiance, which is the mean over the directions of what is convex (Cauchy).
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
    /// With a pattern, by which a quad is sampled as well.
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

    /// The quad that its points are chosen on, and the two triangles that this is made of, if it is.
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

    /// The same without its pattern.
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

/// A point of a light that shines on another one, computed without branches.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Unit direction to there.
    pub direction: Vec3,
    /// Where it is.
    pub target: Vec3,
    /// One over the density of the direction, in sr; 0 where the light is seen from behind or from inside.
    pub factor: f32,
}

impl Arrival {
    /// Where nothing is seen of a light.
    pub const NOTHING: Self = Self { direction: Vec3::ZERO, target: Vec3::ZERO, factor: 0.0 };
}
