//! Quad lamps with a picture on them: sampled by the picture as well as by what a point sees of them.

use super::Met;
use super::emitter::Arrival;
use super::rectangle::QuadEmitter;
use super::tree::bounds::strength;
use crate::math::{DVec3, Vec3};
use crate::sampling::grid::{Grid, InGrid};

/// A parallelogram with a picture on it. A part of the samples is chosen by the picture, the others by the solid angle; their
/// density is the mean of both (the balance heuristic for one sample: Veach, *Robust Monte Carlo Methods for Light Transport
/// Simulation*, 1997, section 9.2.4).
#[derive(Clone, Debug, PartialEq)]
pub struct PictureEmitter {
    quad: QuadEmitter,
    /// Along both edges.
    size: [usize; 2],
    /// How bright the parts are.
    cells: Grid,
    /// Of the samples, those that are chosen by it.
    share: f32,
    /// A point's offset from the corner times these is how far it is along the edges.
    along: [Vec3; 2],
}

/// Cells along an edge at most.
const MOST_CELLS: usize = 256;

/// Look-ups in a cell along an edge, at least and at most.
const LOOKUPS: (usize, usize) = (2, 4);

/// Of the samples, those that are chosen by a picture at most: what it does not tell is how near a part is.
const MOST_BY_PICTURE: f64 = 0.9;

impl PictureEmitter {
    /// Of the colours at places along both edges, in [0, 1], for so many texels along these; none where they tell nothing.
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
        // The variance of the brightness by the mean of its square: 0 where it is the same everywhere.
        let contrast = 1.0 - sum * sum / (squares * (size[0] * size[1]) as f64);
        let share = (MOST_BY_PICTURE * contrast) as f32;
        let cells = Grid::new(size[0], rows.into_iter()).filter(|_| share > LEAST_SHARE)?;
        Some(Self { along: quad.along(), quad, size, cells, share })
    }

    /// By the picture or by the solid angle.
    #[inline(always)]
    pub fn sample(&self, point: Vec3, u: [f32; 2]) -> Arrival {
        let by_picture = u[0] < self.share;
        let (before, share) = if by_picture { (0.0, self.share) } else { (self.share, 1.0 - self.share) };
        let rest = (u[0] - before) / share;
        const LAST: f32 = 1.0_f32.next_down();
        let u = [if rest < LAST { rest } else { LAST }, u[1]];
        let to_corner = self.quad.corner_from(point);
        let InGrid { column, row, rest } = self.cells.sample(u);
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
            return Arrival { direction, target: point + offset, factor };
        }
        if !(own.factor > 0.0) {
            return Arrival { factor: 0.0, ..own };
        }
        let density = self.density(own.target - point, to_corner, 1.0 / own.factor);
        Arrival { factor: 1.0 / density, ..own }
    }

    /// [`Light::pdf`](super::Light::pdf).
    pub fn pdf(&self, from: Vec3, met: &Met) -> f32 {
        let to_corner = self.quad.corner_from(from);
        let of_quad = self.quad.pdf(from, met);
        if of_quad > 0.0 { self.density(met.direction * met.distance, to_corner, of_quad) } else { 0.0 }
    }

    /// Density in sr⁻¹ at an offset from the point that sees it, by that of the quad alone.
    #[inline(always)]
    fn density(&self, offset: Vec3, to_corner: Vec3, of_quad: f32) -> f32 {
        let on_quad = offset - to_corner;
        let cell = |axis: usize| {
            let place = self.along[axis].dot(on_quad) * self.size[axis] as f32;
            (if place > 0.0 { place as usize } else { 0 }).min(self.size[axis] - 1)
        };
        let of_cell = self.cell_density(cell(0), cell(1));
        self.share * of_cell / self.quad.shown(offset) + (1.0 - self.share) * of_quad
    }

    /// Of a cell, its density over the area by that of a picture which is the same everywhere.
    #[inline(always)]
    fn cell_density(&self, column: usize, row: usize) -> f32 {
        let probability = self.cells.row_probability(row) * self.cells.column_probability(row, column);
        probability * (self.size[0] * self.size[1]) as f32
    }

    /// Centre of area.
    pub fn middle(&self) -> DVec3 {
        self.quad.middle()
    }
}

/// Pictures with less contrast are not worth a look.
const LEAST_SHARE: f32 = 0.05;
