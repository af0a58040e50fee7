//! Textured quad lights, sampled by their emission texture as well as by solid angle.

use super::quad::QuadEmitter;
use super::sample_point::LightSamplePoint;
use super::{LightHit, ShapeEmitter};
use crate::lights::tree::bounds::strength;
use crate::math::{DVec3, Vec3};
use crate::sampling::piecewise_constant::{GridSample, PiecewiseConstant2D};

/// A parallelogram with an emission texture. A fraction of the samples is chosen by the texture, the others by the solid
/// angle. Their pdf is the mean of both (the balance heuristic for one sample: Veach, *Robust Monte Carlo Methods for Light
/// Transport Simulation*, 1997, section 9.2.4).
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedQuadEmitter {
    quad: QuadEmitter,
    /// Number of cells along both edges.
    size: [usize; 2],
    /// Brightness of the cells.
    cells: PiecewiseConstant2D,
    /// Fraction of the samples that the texture chooses.
    share: f32,
    /// The products of these and a point's offset from the corner are its coordinates along the edges.
    along: [Vec3; 2],
}

/// Most cells along an edge.
const MOST_CELLS: usize = 256;

/// Least and greatest number of look-ups in a cell along an edge.
const LOOKUPS: (usize, usize) = (2, 4);

/// Largest fraction of the samples that a texture chooses: the texture ignores distances.
const MOST_BY_PICTURE: f64 = 0.9;

impl ShapeEmitter for TexturedQuadEmitter {
    /// Samples by the texture or by the solid angle.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> LightSamplePoint {
        let by_picture = u[0] < self.share;
        let (before, share) = if by_picture { (0.0, self.share) } else { (self.share, 1.0 - self.share) };
        let rest = (u[0] - before) / share;
        const LAST: f32 = 1.0_f32.next_down();
        let u = [if rest < LAST { rest } else { LAST }, u[1]];
        let to_corner = self.quad.corner_from(point);
        let GridSample { column, row, rest } = self.cells.sample(u);
        let at =
            [(column as f32 + rest[0]) / self.size[0] as f32, (row as f32 + rest[1]) / self.size[1] as f32];
        let (offset, by_area) = self.quad.by_area(to_corner, at);
        let of_cell = self.cell_density(column, row);
        let own = self.quad.sample(point, u);
        if by_picture {
            let direction = offset * (1.0 / offset.length_squared().sqrt());
            let of_quad = self.quad.density(to_corner).unwrap_or(1.0 / by_area);
            let density = self.share * of_cell / by_area + (1.0 - self.share) * of_quad;
            let factor = if by_area > 0.0 { 1.0 / density } else { 0.0 };
            return LightSamplePoint { direction, target: point + offset, factor };
        }
        if !(own.factor > 0.0) {
            return LightSamplePoint { factor: 0.0, ..own };
        }
        let density = self.density(own.target - point, to_corner, 1.0 / own.factor);
        LightSamplePoint { factor: 1.0 / density, ..own }
    }

    fn pdf(&self, from: Vec3, met: &LightHit) -> f32 {
        let to_corner = self.quad.corner_from(from);
        let of_quad = self.quad.pdf(from, met);
        if of_quad > 0.0 { self.density(met.direction * met.distance, to_corner, of_quad) } else { 0.0 }
    }

    fn middle(&self) -> DVec3 {
        self.quad.middle()
    }
}

impl TexturedQuadEmitter {
    /// An emitter from the colours at places along both edges, in [0, 1], with so many texels along the edges. `None` if
    /// the texture has too little contrast.
    pub fn new(quad: QuadEmitter, texels: [f64; 2], color: impl Fn([f64; 2]) -> Vec3) -> Option<Self> {
        let size = texels.map(|count| (count.ceil() as usize).clamp(1, MOST_CELLS));
        let lookups: [usize; 2] = std::array::from_fn(|i| {
            ((texels[i] / size[i] as f64).ceil() as usize).clamp(LOOKUPS.0, LOOKUPS.1)
        });
        let brightness = |cell: [usize; 2]| {
            let mut sum = 0.0;
            for (j, i) in (0..lookups[1]).flat_map(|j| (0..lookups[0]).map(move |i| (j, i))) {
                let at = |axis: usize, k: usize| {
                    (cell[axis] as f64 + (k as f64 + 0.5) / lookups[axis] as f64) / size[axis] as f64
                };
                sum += strength(color([at(0, i), at(1, j)])).max(0.0);
            }
            sum
        };
        let row = |row: usize| (0..size[0]).map(|column| brightness([column, row])).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = (0..size[1]).map(row).collect();
        let (sum, squares) =
            rows.iter().flatten().fold((0.0, 0.0), |(sum, squares), one| (sum + one, squares + one * one));
        // Divide the variance of the brightness by the mean of its square: 0 if the brightness is constant.
        let contrast = 1.0 - sum * sum / (squares * (size[0] * size[1]) as f64);
        let share = (MOST_BY_PICTURE * contrast) as f32;
        let cells = PiecewiseConstant2D::new(size[0], rows.into_iter()).filter(|_| share > LEAST_SHARE)?;
        Some(Self { along: quad.along(), quad, size, cells, share })
    }

    /// Pdf in sr⁻¹ at an offset from the point, given the pdf of the quad alone.
    #[inline(always)]
    fn density(&self, offset: Vec3, to_corner: Vec3, of_quad: f32) -> f32 {
        let on_quad = offset - to_corner;
        let cell = |axis: usize| {
            let place = self.along[axis].dot(on_quad) * self.size[axis] as f32;
            (if place > 0.0 { place as usize } else { 0 }).min(self.size[axis] - 1)
        };
        let of_cell = self.cell_density(cell(0), cell(1));
        self.share * of_cell / self.quad.projected_solid_angle(offset) + (1.0 - self.share) * of_quad
    }

    /// Density of a cell over the area, relative to that of a constant texture.
    #[inline(always)]
    fn cell_density(&self, column: usize, row: usize) -> f32 {
        let probability = self.cells.row_probability(row) * self.cells.column_probability(row, column);
        probability * (self.size[0] * self.size[1]) as f32
    }
}

/// Least fraction; textures with less contrast are not worth a look-up.
const LEAST_SHARE: f32 = 0.05;
