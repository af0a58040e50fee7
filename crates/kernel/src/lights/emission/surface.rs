//! Places on lights that are objects.

use std::f64::consts::PI;

use super::Outline;
use crate::geometry::surface::error;
use crate::geometry::{AreaPoint, Shape};
use crate::lights::area::{AreaLight, Side};
use crate::lights::tree::bounds::strength;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::Discrete;

/// The surface of a light in pieces, which are chosen by power.
#[derive(Clone, Debug)]
pub struct Surface {
    pieces: Discrete,
    on: On,
    /// Power in W.
    power: Vec3,
}

/// Geometry of the pieces.
#[derive(Clone, Debug)]
enum On {
    /// A shape, whose parts are cut into side × side pieces of the same area.
    Shape {
        shape: Shape,
        side: u32,
        /// Areas of the parts.
        areas: Vec<f64>,
        /// Greatest of the lengths from which a point is computed.
        reach: f64,
    },
    /// The triangles of a mesh.
    Mesh { rounding: f32 },
}

/// A place on a light.
pub struct Place {
    /// The place, rounded.
    pub point: Vec3,
    /// The place.
    pub from: DVec3,
    /// Unit normal of the side that emits.
    pub normal: DVec3,
    /// Bound on the error of each of its components.
    pub error: Vec3,
    /// Emitted radiance integrated by the cosine, over the pdf of such places: the mean is the power of the light, in
    /// W.
    pub flux: Vec3,
    /// The triangle of a mesh.
    pub primitive: u32,
}

/// A point of a piece.
struct OnPiece {
    point: DVec3,
    normal: DVec3,
    /// Area of the piece.
    area: f64,
    primitive: u32,
}

/// Most pieces of a lamp with a texture.
const PIECES: usize = 1024;

/// Places along a side of a piece at which its texture is sampled.
const ASKED: u32 = 4;

/// Fraction of the weight of a lamp's pieces that goes by their area: there may be more light between the sampled places.
const BY_AREA: f64 = 0.05;

impl Surface {
    /// The surface of a light. `None` if it has no area, or emits nothing.
    pub fn new(light: &AreaLight, outline: &Outline) -> Option<Self> {
        let (on, count) = match outline {
            Outline::Shape(shape) => {
                let areas = shape.areas();
                let most = if light.texture.is_some() { PIECES / areas.len().max(1) } else { 1 };
                let side = most.isqrt().max(1);
                let count = areas.len() * side * side;
                (On::Shape { shape: *shape, side: side as u32, areas, reach: reach(shape)? }, count)
            }
            Outline::Mesh { rounding } => {
                let mesh = light.shape.as_mesh()?;
                (On::Mesh { rounding: *rounding }, mesh.primitives().count())
            }
        };
        let asked = if light.texture.is_some() { ASKED } else { 1 };
        let of = |index: usize| {
            let mut sum = DVec3::ZERO;
            let mut area = 0.0;
            for i in 0..asked * asked {
                let u = Vec2::new((i % asked) as f32 + 0.5, (i / asked) as f32 + 0.5) / asked as f32;
                let place = on.at(light, index, u);
                area = place.area;
                sum += radiance(light, &place).as_dvec3();
            }
            (area, sum * (area * PI / f64::from(asked * asked)))
        };
        let all: Vec<(f64, DVec3)> = (0..count).map(of).collect();
        let power: DVec3 = all.iter().map(|(_, power)| *power).sum();
        let area: f64 = all.iter().map(|(area, _)| area).sum();
        let total = strength(power.as_vec3());
        let by_power = if total > 0.0 { (1.0 - BY_AREA) / total } else { 0.0 };
        let weight =
            |(own, power): &(f64, DVec3)| BY_AREA * own / area + by_power * power.element_sum() / 3.0;
        let pieces = Discrete::new(all.iter().map(weight))?;
        Some(Self { pieces, on, power: power.as_vec3() })
    }

    /// Power in W; for a lamp with a texture, the mean over places close to each other.
    pub fn power(&self) -> Vec3 {
        self.power
    }

    /// Samples a place by numbers in [0, 1).
    pub fn place(&self, light: &AreaLight, piece: f32, u: Vec2) -> Place {
        let (index, _) = self.pieces.sample(piece);
        let place = self.on.at(light, index, u);
        let OnPiece { point, normal, area, .. } = place;
        let factor = PI * area / self.pieces.share(index);
        let flux = (radiance(light, &place).as_dvec3() * factor).as_vec3();
        let rounded = point.as_vec3();
        let error = match self.on {
            On::Shape { reach, .. } => error(rounded, reach),
            On::Mesh { rounding } => error(rounded, 0.0) + Vec3::splat(rounding),
        };
        Place { point: rounded, from: point, normal, error, flux, primitive: place.primitive }
    }
}

impl On {
    /// A place of a piece, uniform over it.
    fn at(&self, light: &AreaLight, index: usize, u: Vec2) -> OnPiece {
        match (self, light.shape.as_mesh()) {
            (Self::Shape { shape, side, areas, .. }, _) => {
                let all = *side as usize;
                let (part, cell) = (index / (all * all), index % (all * all));
                let corner = Vec2::new((cell % all) as f32, (cell / all) as f32);
                let u = ((corner + u) / *side as f32).min(Vec2::splat(1.0_f32.next_down()));
                let AreaPoint { point, normal } = shape.sample(part as u32, u);
                let normal = match light.side {
                    Side::Front => normal,
                    Side::Back => -normal,
                };
                OnPiece { point, normal, area: areas[part] / (all * all) as f64, primitive: part as u32 }
            }
            (Self::Mesh { .. }, Some(mesh)) => {
                let (place, area, primitive) = mesh.place(index, u);
                OnPiece { point: place.point, normal: place.normal, area, primitive }
            }
            (Self::Mesh { .. }, None) => {
                OnPiece { point: DVec3::ZERO, normal: DVec3::Y, area: 0.0, primitive: 0 }
            }
        }
    }
}

/// Radiance of a place, W·sr⁻¹·m⁻², but for a clear coat.
fn radiance(light: &AreaLight, place: &OnPiece) -> Vec3 {
    let texture = light.texture.as_ref();
    light.radiance
        * texture.map_or(Vec3::ONE, |texture| texture.at_place(place.point.as_vec3(), place.primitive))
}

/// Upper bound on the lengths from which the points of a shape are computed. `None` if the shape is infinite.
fn reach(shape: &Shape) -> Option<f64> {
    let bounds = shape.bounds()?;
    let greatest = bounds.min.abs().max(bounds.max.abs()).as_dvec3().max_element();
    Some(greatest + 2.0 * bounds.extent().as_dvec3().length())
}
