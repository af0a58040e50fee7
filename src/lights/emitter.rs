//! Shapes that emit.

use super::rectangle::{QuadEmitter, SeenQuad};
use super::sphere::{SeenSphere, SphereEmitter};
use super::surface::SurfaceEmitter;
use super::triangles::TriangleEmitter;
use super::{LightSample, LightSamples, Met, Source};
use crate::geometry::Shape;
use crate::geometry::sphere::Sphere;
use crate::math::lanes::Lanes;
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
    /// The light as seen from a point; none where it certainly sends nothing there.
    pub fn seen_from(&self, point: Vec3) -> Option<SeenLight<'_>> {
        let shape = match &self.shape {
            Emitter::Sphere(sphere) => SeenShape::Sphere(sphere.seen_from(point)?),
            Emitter::Quad(quad) => SeenShape::Quad(quad.seen_from(point)?),
            Emitter::Triangles(triangles) => SeenShape::Triangles(triangles, point),
            Emitter::Surface(surface) => SeenShape::Surface(surface, point),
        };
        Some(SeenLight::Area(self, shape))
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

/// A light and a point that it may shine on, ready to be sampled many times.
#[derive(Clone, Copy, Debug)]
pub enum SeenLight<'a> {
    /// There is but one way.
    Only(LightSample),
    /// A shape.
    Area(&'a AreaLight, SeenShape<'a>),
}

/// A shape as seen from a point.
#[derive(Clone, Copy, Debug)]
pub enum SeenShape<'a> {
    /// A sphere.
    Sphere(SeenSphere),
    /// A parallelogram.
    Quad(SeenQuad<'a>),
    /// Triangles, and the point.
    Triangles(&'a TriangleEmitter, Vec3),
    /// A shape of any other kind, and the point.
    Surface(&'a SurfaceEmitter, Vec3),
}

impl SeenLight<'_> {
    /// Ways for light to arrive by the first numbers of each lane, put behind what is in the queue; none where the part that was
    /// chosen sends nothing.
    #[inline(always)]
    pub fn samples(&self, u: [Lanes; 2], count: usize, queue: &mut Vec<LightSamples>) {
        match self {
            Self::Only(sample) => queue.extend((0..count).map(|_| LightSamples::from(*sample))),
            Self::Area(light, SeenShape::Quad(quad)) => {
                let all = quad.samples(u, light.radiance, Source::Object(light.object));
                queue.push(LightSamples { count, ..all });
            }
            Self::Area(light, SeenShape::Sphere(sphere)) => {
                let all = sphere.samples(u, light.radiance, Source::Object(light.object));
                queue.push(LightSamples { count, ..all });
            }
            Self::Area(light, shape) => {
                queue.extend((0..count).filter_map(|i| light.sample(shape, [u[0][i], u[1][i]])));
            }
        }
    }
}

impl AreaLight {
    /// One sample of a shape of which the samples are made one by one.
    fn sample(&self, shape: &SeenShape<'_>, u: [f32; 2]) -> Option<LightSamples> {
        let sample = match shape {
            SeenShape::Triangles(triangles, point) => triangles.sample(*point, u, self.radiance, self.object),
            SeenShape::Surface(surface, point) => surface.sample(*point, u, self.radiance, self.object),
            SeenShape::Quad(_) | SeenShape::Sphere(_) => None,
        };
        sample.map(LightSamples::from)
    }
}
