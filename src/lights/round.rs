//! Disks, cylinders, cones and tori that shine outwards, by area.

use std::f64::consts::PI;

use super::{LightSample, Source};
use crate::geometry::cone::Cone;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::ray::offset_origin;
use crate::geometry::torus::Torus;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::Discrete;
use crate::sampling::warp;

/// A round shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Round {
    /// Flat; it shines from its front only.
    Disk(Disk),
    /// With its caps, if it has them.
    Cylinder(Cylinder),
    /// With its cap, if it has it.
    Cone(Cone),
    /// A ring.
    Torus(Torus),
}

/// A round shape that shines outwards.
#[derive(Clone, Debug, PartialEq)]
pub struct RoundEmitter {
    shape: Round,
    /// The parts of the shape by their numbers.
    by_area: Discrete,
}

/// A point of the surface.
struct Place {
    point: DVec3,
    /// Unit normal.
    normal: DVec3,
}

impl RoundEmitter {
    /// None where the area is too small for a number.
    pub fn new(shape: Round) -> Option<Self> {
        let by_area = match &shape {
            Round::Disk(disk) => Discrete::new([disk.area()]),
            Round::Cylinder(cylinder) => Discrete::new(cylinder.areas()),
            Round::Cone(cone) => Discrete::new(cone.areas()),
            Round::Torus(torus) => Discrete::new([torus.area()]),
        };
        Some(Self { shape, by_area: by_area? })
    }

    /// Uniform over the area. A torus may hide parts of itself, so shadow rays test it, up to just above their target; of
    /// the others nothing comes before a point that faces the receiver.
    pub fn sample(&self, point: Vec3, u: [f32; 2], radiance: Vec3, object: u32) -> Option<LightSample> {
        let place = self.place(u);
        let offset = place.point - point.as_dvec3();
        let distance_squared = offset.length_squared();
        let direction = offset / distance_squared.sqrt();
        let cosine = -place.normal.dot(direction);
        let (target, source) = match self.shape {
            Round::Torus(torus) => (above(&torus, &place, offset), Source::Nothing),
            Round::Disk(_) | Round::Cylinder(_) | Round::Cone(_) => {
                (place.point.as_vec3(), Source::Object(object))
            }
        };
        (cosine > 0.0).then(|| LightSample {
            target,
            direction: direction.as_vec3(),
            weight: radiance * (self.by_area.total() * cosine / distance_squared) as f32,
            source,
        })
    }

    fn place(&self, u: [f32; 2]) -> Place {
        let (part, u) = {
            let (part, rest) = self.by_area.sample(u[0]);
            (part as u32, [rest, u[1]])
        };
        let (x, y) = (f64::from(u[0]), f64::from(u[1]));
        match (&self.shape, part) {
            (Round::Disk(disk), _) => on_disk(disk, u),
            (Round::Cylinder(cylinder), 0) => placed(cylinder.side(x, y)),
            (Round::Cylinder(cylinder), cap) => on_disk(&cylinder.cap(cap), u),
            (Round::Cone(cone), 0) => placed(cone.side(x, 1.0 - (1.0 - y).sqrt())),
            (Round::Cone(cone), _) => on_disk(&cone.base(), u),
            (Round::Torus(torus), _) => placed(on_torus(torus, x, y)),
        }
    }

    /// As if all came from the middle: what the shape shows to the point, of a torus a quarter of its area, which is the
    /// mean over all directions.
    pub fn middle(&self, point: Vec3, radiance: Vec3, object: u32) -> Option<LightSample> {
        let from = point.as_dvec3();
        let (middle, is_inside) = match &self.shape {
            Round::Disk(disk) => (disk.center(), false),
            Round::Cylinder(cylinder) => (cylinder.center(), cylinder.contains(from)),
            Round::Cone(cone) => (cone.center(), cone.contains(from)),
            Round::Torus(torus) => (torus.center(), torus.signed_distance(from) < 0.0),
        };
        let offset = middle - from;
        let distance_squared = offset.length_squared();
        let direction = offset / distance_squared.sqrt();
        let shown = self.shown(-direction);
        (!is_inside && shown > 0.0).then(|| LightSample {
            target: middle.as_vec3(),
            direction: direction.as_vec3(),
            weight: radiance * (shown / distance_squared) as f32,
            source: Source::Object(object),
        })
    }

    /// The area that faces a direction, times the cosine.
    fn shown(&self, direction: DVec3) -> f64 {
        match &self.shape {
            Round::Disk(disk) => disk.area() * disk.normal().dot(direction).max(0.0),
            Round::Cylinder(cylinder) => {
                let along = cylinder.axis().dot(direction);
                let [side, cap, _] = cylinder.areas();
                ring_shown(side, across(along), 0.0) + cap * along.abs()
            }
            Round::Cone(cone) => {
                let along = cone.axis().dot(direction);
                let ([side, cap], (cosine, sine)) = (cone.areas(), cone.slope());
                ring_shown(side, cosine * across(along), -sine * along) + cap * along.max(0.0)
            }
            Round::Torus(torus) => torus.area() / 4.0,
        }
    }
}

fn placed((point, normal): (DVec3, DVec3)) -> Place {
    Place { point, normal }
}

fn on_disk(disk: &Disk, u: [f32; 2]) -> Place {
    Place { point: disk.point(warp::disk(Vec2::from_array(u)).as_dvec2()), normal: disk.normal() }
}

/// Uniform over the area: the angle ψ of the tube has density 1 + (tube/radius)·cos ψ, so that of the uniform ψ and its
/// mirror image π − ψ, whose densities sum to a constant, one is taken by its share.
fn on_torus(torus: &Torus, x: f64, y: f64) -> (DVec3, DVec3) {
    // cos ψ at v = y, since ψ = 0 is v = ½.
    let share = 0.5 - 0.5 * torus.slimness() * (2.0 * PI * y).cos();
    if x < share { torus.place(x / share, y) } else { torus.place((x - share) / (1.0 - share), 1.5 - y) }
}

/// A point that is certainly above the torus, also for a segment of this length towards it.
fn above(torus: &Torus, place: &Place, offset: DVec3) -> Vec3 {
    let (point, normal) = (place.point.as_vec3(), place.normal.as_vec3());
    let error = torus.error(point) + offset.abs().as_vec3() * f32::EPSILON;
    offset_origin(point, error, normal, normal)
}

fn across(along: f64) -> f64 {
    (1.0 - along * along).max(0.0).sqrt()
}

/// ∫max(0, a·cos φ + b) over an area on which all φ are alike: what shows of normals that have, to the direction of sight,
/// a part of length a around the axis and a part b along it.
fn ring_shown(area: f64, a: f64, b: f64) -> f64 {
    if b >= a {
        area * b
    } else if b <= -a {
        0.0
    } else {
        area / PI * (((a - b) * (a + b)).sqrt() + b * (-b / a).acos())
    }
}
