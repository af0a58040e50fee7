//! Samples emission points on area lights.

use std::f64::consts::PI;

use super::EmissiveObjectGeometry;
use crate::geometry::surface::point_error_bound;
use crate::geometry::{Shape, SurfaceSample};
use crate::lights::area::{AreaLight, Side};
use crate::lights::tree::bounds::mean_channel;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::DiscreteDistribution;

/// A light's surface, divided into pieces. Each piece is chosen in proportion to its power.
#[derive(Clone, Debug)]
pub struct DividedEmissiveSurface {
    pieces: DiscreteDistribution,
    on: DividedSurfaceGeometry,
    /// Power in W.
    power: Vec3,
}

/// Geometry of the pieces.
#[derive(Clone, Debug)]
enum DividedSurfaceGeometry {
    /// An analytic shape. Each part is divided into side × side pieces of equal area, measured as in
    /// [`Shape::local_part_areas`].
    Shape {
        shape: Shape,
        side: u32,
        /// [`Shape::local_part_areas`].
        areas: Vec<f64>,
        /// Upper bound on the magnitudes of the lengths used to compute points.
        reach: f64,
    },
    /// The triangles of a mesh.
    Mesh { rounding: f32 },
}

/// A sampled point on a light.
pub struct EmissionPoint {
    /// The point, rounded to `f32`.
    pub point: Vec3,
    /// The point before rounding.
    pub from: DVec3,
    /// Unit normal of the emitting side.
    pub normal: DVec3,
    /// Error bound of each component of `point`.
    pub error: Vec3,
    /// Cosine-weighted integral of the radiance, divided by the pdf of the point. The mean is the light's
    /// power in W.
    pub flux: Vec3,
    /// Primitive index in a mesh, or index of the part of a shape.
    pub primitive: u32,
}

/// A point on a piece.
struct PiecePoint {
    point: DVec3,
    normal: DVec3,
    /// Area of the entire piece, assuming that all of it has the same area scale as this point.
    area: f64,
    primitive: u32,
}

/// Maximum number of pieces for a textured or transformed light.
const MAX_PIECES: usize = 1024;

/// Number of texture lookups per side of a piece.
const LOOKUPS_PER_SIDE: u32 = 4;

/// Fraction of a piece's weight that is proportional to its area, because the lookups may miss bright areas.
const BY_AREA: f64 = 0.05;

impl DividedEmissiveSurface {
    /// Divides a light's surface into pieces. Returns `None` if the surface has no area or emits nothing.
    pub fn new(light: &AreaLight, emitter_geometry: &EmissiveObjectGeometry) -> Option<Self> {
        let (on, count) = match emitter_geometry {
            EmissiveObjectGeometry::Shape(shape) => {
                let areas = shape.local_part_areas();
                let is_uneven = light.modulation.is_some() || matches!(shape, Shape::Transformed(_));
                let most = if is_uneven { MAX_PIECES / areas.len().max(1) } else { 1 };
                let side = most.isqrt().max(1);
                let count = areas.len() * side * side;
                (
                    DividedSurfaceGeometry::Shape {
                        shape: shape.clone(),
                        side: side as u32,
                        areas,
                        reach: coordinate_bound(shape)?,
                    },
                    count,
                )
            }
            EmissiveObjectGeometry::Mesh { rounding } => {
                let mesh = light.shape.as_mesh()?;
                (DividedSurfaceGeometry::Mesh { rounding: *rounding }, mesh.primitive_indices().count())
            }
        };
        let per_side = if light.modulation.is_some() { LOOKUPS_PER_SIDE } else { 1 };
        let of = |index: usize| {
            let mut sum = DVec3::ZERO;
            let mut area = 0.0;
            for i in 0..per_side * per_side {
                let u = Vec2::new((i % per_side) as f32 + 0.5, (i / per_side) as f32 + 0.5) / per_side as f32;
                let place = on.sample_point_on_piece(light, index, u);
                area = place.area;
                sum += radiance_without_coat(light, &place).as_dvec3();
            }
            (area, sum * (area * PI / f64::from(per_side * per_side)))
        };
        let all: Vec<(f64, DVec3)> = (0..count).map(of).collect();
        let power: DVec3 = all.iter().map(|(_, power)| *power).sum();
        let area: f64 = all.iter().map(|(area, _)| area).sum();
        let total = mean_channel(power.as_vec3());
        let by_power = if total > 0.0 { (1.0 - BY_AREA) / total } else { 0.0 };
        let weight =
            |(own, power): &(f64, DVec3)| BY_AREA * own / area + by_power * power.element_sum() / 3.0;
        let pieces = DiscreteDistribution::new(all.iter().map(weight))?;
        Some(Self { pieces, on, power: power.as_vec3() })
    }

    /// Power in W. For textured lights, it is estimated from a dense grid of points.
    pub fn power(&self) -> Vec3 {
        self.power
    }

    /// Samples a point from random numbers in [0, 1).
    pub fn sample_point(&self, light: &AreaLight, piece: f32, u: Vec2) -> EmissionPoint {
        let (index, _) = self.pieces.sample(piece);
        let place = self.on.sample_point_on_piece(light, index, u);
        let PiecePoint { point, normal, area, .. } = place;
        let factor = PI * area / self.pieces.probability(index);
        let flux = (radiance_without_coat(light, &place).as_dvec3() * factor).as_vec3();
        let rounded = point.as_vec3();
        let error = match self.on {
            DividedSurfaceGeometry::Shape { reach, .. } => point_error_bound(rounded, reach),
            DividedSurfaceGeometry::Mesh { rounding } => {
                point_error_bound(rounded, 0.0) + Vec3::splat(rounding)
            }
        };
        EmissionPoint { point: rounded, from: point, normal, error, flux, primitive: place.primitive }
    }
}

impl DividedSurfaceGeometry {
    /// A uniformly distributed point on a piece.
    fn sample_point_on_piece(&self, light: &AreaLight, index: usize, u: Vec2) -> PiecePoint {
        match (self, light.shape.as_mesh()) {
            (Self::Shape { shape, side, areas, .. }, _) => {
                let all = *side as usize;
                let (part, cell) = (index / (all * all), index % (all * all));
                let corner = Vec2::new((cell % all) as f32, (cell / all) as f32);
                let u = ((corner + u) / *side as f32).min(Vec2::splat(1.0_f32.next_down()));
                let SurfaceSample { point, normal } = shape.sample_point_on_part(part as u32, u);
                let area = areas[part] * shape.area_scale_for_world_normal(normal) / (all * all) as f64;
                let normal = match light.side {
                    Side::Front => normal,
                    Side::Back => -normal,
                };
                PiecePoint { point, normal, area, primitive: part as u32 }
            }
            (Self::Mesh { .. }, Some(mesh)) => {
                let (place, area, primitive) = mesh.sample_point_on_triangle(index, u);
                PiecePoint { point: place.point, normal: place.normal, area, primitive }
            }
            (Self::Mesh { .. }, None) => {
                PiecePoint { point: DVec3::ZERO, normal: DVec3::Y, area: 0.0, primitive: 0 }
            }
        }
    }
}

/// Radiance at a point in W·sr⁻¹·m⁻², without a clear coat.
fn radiance_without_coat(light: &AreaLight, place: &PiecePoint) -> Vec3 {
    let modulation = light.modulation.as_ref();
    light.radiance
        * modulation.map_or(Vec3::ONE, |modulation| {
            modulation.radiance_factor_without_coat(place.point.as_vec3(), place.primitive)
        })
}

/// Upper bound on the magnitudes of the lengths used to compute points on the shape, or `None` if the shape
/// is infinite.
fn coordinate_bound(shape: &Shape) -> Option<f64> {
    if let Shape::Transformed(own) = shape {
        return Some(own.length_bound_to_world(coordinate_bound(&own.shape)?));
    }
    let bounds = shape.bounds()?;
    let largest = bounds.min.abs().max(bounds.max.abs()).as_dvec3().max_element();
    Some(largest + 2.0 * bounds.extent().as_dvec3().length())
}
