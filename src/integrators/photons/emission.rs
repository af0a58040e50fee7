//! Stub until the lights emit.

use std::sync::Arc;

use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Shape};
use crate::lights::{Light, Lights};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::warp;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    Shape(Shape),
    Mesh { rounding: f32 },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    pub light: [f32; 2],
    pub aim: [f32; 2],
    pub position: [f32; 2],
    pub direction: [f32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitted {
    pub light: u32,
    pub start: Start,
    pub direction: Vec3,
    pub flux: Vec3,
    pub is_aimed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    Point(Vec3),
    Surface { point: Vec3, error: Vec3, normal: Vec3 },
    Beyond(Vec3),
}

impl Emitted {
    pub fn ray(&self) -> Ray {
        let origin = match self.start {
            Start::Point(point) | Start::Beyond(point) => point,
            Start::Surface { point, error, normal } => offset_origin(point, error, normal, self.direction),
        };
        Ray::new(origin, self.direction)
    }
}

#[derive(Clone, Debug)]
pub struct Emission {
    lights: Arc<Lights>,
    outlines: Vec<Option<Outline>>,
}

impl Emission {
    pub fn new(lights: &Arc<Lights>, outline: impl Fn(u32) -> Option<Outline>, _: Ball) -> Option<Self> {
        let of = |light: &Light| match light {
            Light::Area(light) => outline(light.object),
            _ => None,
        };
        let outlines = lights.iter().map(|(_, light)| of(light)).collect();
        (!lights.is_empty()).then(|| Self { lights: Arc::clone(lights), outlines })
    }

    #[must_use]
    pub fn aimed_at(self, _: &[Ball], _: f32) -> Self {
        self
    }

    pub fn emit(&self, u: &Numbers) -> Option<Emitted> {
        let n = self.lights.len();
        let number = ((u.light[0] * n as f32) as usize).min(n - 1);
        let sphere = || warp::cone(u.direction, 2.0);
        let (start, direction, flux) = match self.lights.get(number as u32) {
            Light::Point(light) => (
                Start::Point(light.position.as_vec3()),
                sphere(),
                light.intensity * (4.0 * std::f32::consts::PI),
            ),
            Light::Area(light) => {
                let pi = std::f32::consts::PI;
                let (point, normal, area) = match self.outlines[number]? {
                    Outline::Shape(Shape::Quad(quad)) => {
                        let n = quad.u.cross(quad.v);
                        let p = quad.corner + quad.u * f64::from(u.position[0]) + quad.v * f64::from(u.position[1]);
                        (p.as_vec3(), n.normalize().as_vec3(), n.length() as f32)
                    }
                    Outline::Shape(Shape::Sphere(sphere)) => {
                        let n = warp::cone(u.position, 2.0);
                        let p = sphere.center + n.as_dvec3() * sphere.radius;
                        (p.as_vec3(), n, (4.0 * std::f64::consts::PI * sphere.radius * sphere.radius) as f32)
                    }
                    _ => return None,
                };
                let disk = warp::disk(Vec2::from_array(u.direction));
                let local = disk.extend((1.0 - disk.length_squared()).max(0.0).sqrt());
                let direction = Frame::from_normal(normal).to_world(local).normalize();
                let error = point.abs() * 4.0 * f32::EPSILON;
                (Start::Surface { point, error, normal }, direction, light.radiance * (pi * area))
            }
            _ => return None,
        };
        Some(Emitted { light: number as u32, start, direction, flux: flux * n as f32, is_aimed: false })
    }
}
