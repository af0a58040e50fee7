//! Shapes that emit.

use super::rectangle::QuadEmitter;
use super::sphere::SphereEmitter;
use super::surface::SurfaceEmitter;
use super::triangles::TriangleEmitter;
use super::{End, LightSample, Met, Source};
use crate::geometry::Shape;
use crate::geometry::sphere::Sphere;
use crate::math::{DVec3, Vec3};

/// A shape that sends the same radiance everywhere from its front side.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaLight {
    /// Which shape.
    pub shape: Emitter,
    /// Its radiance.
    pub radiance: Vec3,
    /// The object that it is.
    pub object: u32,
    /// Which part of it.
    pub part: Part,
}

/// Which part of an object a light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    Whole,
    /// One primitive.
    Primitive(u32),
    /// The triangles that the emitter lists.
    Listed,
}

/// The shapes that can emit.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A sphere.
    Sphere(SphereEmitter),
    /// A parallelogram: a quad, or a face of a box.
    Quad(QuadEmitter),
    /// Triangles.
    Triangles(TriangleEmitter),
    /// A shape of any other kind.
    Surface(SurfaceEmitter),
}

/// The lights that a shape is where all of it shines; none where it has no end.
pub fn area_lights(shape: &Shape, radiance: Vec3, object: u32) -> Vec<AreaLight> {
    let light = |part, shape| AreaLight { shape, radiance, object, part };
    let whole = |shape: Option<Emitter>| shape.map(|shape| light(Part::Whole, shape)).into_iter().collect();
    match shape {
        Shape::Sphere(sphere) => {
            let Sphere { center, radius } = *sphere;
            whole(Some(Emitter::Sphere(SphereEmitter { center, radius })))
        }
        Shape::Quad(quad) => whole(Some(Emitter::Quad(QuadEmitter::new(quad.corner, quad.u, quad.v)))),
        Shape::Box(cuboid) => {
            let face = |number| {
                let (corner, u, v) = cuboid.face(number);
                light(Part::Primitive(number), Emitter::Quad(QuadEmitter::new(corner, u, v)))
            };
            (0..6).map(face).collect()
        }
        Shape::Triangle(triangle) => {
            let corners = [triangle.a, triangle.b, triangle.c];
            whole(TriangleEmitter::new(vec![(corners, 0)]).map(Emitter::Triangles))
        }
        Shape::Plane(_) | Shape::Disk(_) | Shape::Cylinder(_) | Shape::Cone(_) | Shape::Torus(_) => {
            whole(SurfaceEmitter::new(*shape).map(Emitter::Surface))
        }
    }
}

impl AreaLight {
    /// [`Light::sample`](super::Light::sample).
    pub fn sample(&self, point: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let own = |sample: Arrival| {
            let Arrival { direction, target, factor } = sample;
            let (end, source) = (End::At(target), Source::Object(self.object));
            (factor > 0.0).then(|| LightSample { end, direction, weight: self.radiance * factor, source })
        };
        match &self.shape {
            Emitter::Sphere(sphere) => own(sphere.sample(point, u)),
            Emitter::Quad(quad) => own(quad.sample(point, u)),
            Emitter::Triangles(triangles) => triangles.sample(point, u, self.radiance, self.object),
            Emitter::Surface(surface) => surface.sample(point, u, self.radiance, self.object),
        }
    }

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, met: &Met) -> f32 {
        if !(met.normal.dot(met.direction) < 0.0) {
            return 0.0;
        }
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.pdf(from),
            Emitter::Quad(quad) => quad.pdf(from, met),
            Emitter::Triangles(triangles) => met.pdf_by_area(triangles.area()),
            Emitter::Surface(surface) => met.pdf_by_area(surface.area()),
        }
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        match &self.shape {
            Emitter::Sphere(sphere) => sphere.center,
            Emitter::Quad(quad) => quad.middle(),
            Emitter::Triangles(triangles) => triangles.middle(),
            Emitter::Surface(surface) => surface.middle(),
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
