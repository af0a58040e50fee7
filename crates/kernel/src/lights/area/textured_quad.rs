//! Textured quad lights. Some samples follow the emission texture, and the others are uniform over the solid
//! angle.

use super::quad::QuadEmitter;
use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::lights::tree::bounds::mean_channel;
use crate::math::{DVec3, Vec3};
use crate::sampling::piecewise_constant::{GridSample, PiecewiseConstant2D};

/// A parallelogram with an emission texture. Some samples are distributed according to the texture, the rest
/// by solid angle. The pdf is a mixture of the two pdfs (one-sample balance heuristic: Veach, *Robust Monte
/// Carlo Methods for Light Transport Simulation*, 1997, section 9.2.4).
#[derive(Clone, Debug, PartialEq)]
pub struct TexturedQuadEmitter {
    quad: QuadEmitter,
    /// Number of cells along each edge.
    size: [usize; 2],
    /// Distribution of the cells' brightness.
    cells: PiecewiseConstant2D,
    /// Probability of sampling according to the texture.
    texture_probability: f32,
    /// Vectors whose dot products with a point's offset from the corner are the point's coordinates along the
    /// edges.
    along: [Vec3; 2],
}

/// Maximum number of cells along an edge.
const MAX_CELLS: usize = 256;

/// Minimum and maximum numbers of texture lookups per cell along each axis.
const LOOKUPS: (usize, usize) = (2, 4);

/// Maximum fraction of texture samples. It is below 1 because texture sampling does not account for
/// distances.
const MAX_TEXTURE_PROBABILITY: f64 = 0.9;

impl ShapeEmitter for TexturedQuadEmitter {
    /// Samples according to the texture or by solid angle.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let by_texture = u[0] < self.texture_probability;
        let (before, probability) = if by_texture {
            (0.0, self.texture_probability)
        } else {
            (self.texture_probability, 1.0 - self.texture_probability)
        };
        let rest = (u[0] - before) / probability;
        const LAST: f32 = 1.0_f32.next_down();
        let u = [if rest < LAST { rest } else { LAST }, u[1]];
        let to_corner = self.quad.offset_to_corner(point);
        let GridSample { column, row, rest } = self.cells.sample(u);
        let at =
            [(column as f32 + rest[0]) / self.size[0] as f32, (row as f32 + rest[1]) / self.size[1] as f32];
        let (offset, by_area) = self.quad.sample_by_area(to_corner, at);
        let cell_factor = self.cell_pdf_ratio(column, row);
        let own = self.quad.sample(point, u);
        if by_texture {
            let direction = offset * (1.0 / offset.length_squared().sqrt());
            let quad_pdf = self.quad.pdf_by_solid_angle(to_corner).unwrap_or(1.0 / by_area);
            let density = self.texture_probability * cell_factor / by_area
                + (1.0 - self.texture_probability) * quad_pdf;
            let factor = if by_area > 0.0 { 1.0 / density } else { 0.0 };
            return SampledLightPoint { direction, target: point + offset, factor };
        }
        if !(own.factor > 0.0) {
            return SampledLightPoint { factor: 0.0, ..own };
        }
        let density = self.mixture_pdf(own.target - point, to_corner, 1.0 / own.factor);
        SampledLightPoint { factor: 1.0 / density, ..own }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let to_corner = self.quad.offset_to_corner(from);
        let quad_pdf = self.quad.pdf(from, hit);
        if quad_pdf > 0.0 { self.mixture_pdf(hit.direction * hit.distance, to_corner, quad_pdf) } else { 0.0 }
    }

    fn area_centroid(&self) -> DVec3 {
        self.quad.area_centroid()
    }
}

impl TexturedQuadEmitter {
    /// Creates an emitter. `color` returns the color at a position in [0, 1]² along the edges, and `texels`
    /// are the numbers of texels along the edges. Returns `None` if the texture has too little contrast.
    pub fn new(quad: QuadEmitter, texels: [f64; 2], color: impl Fn([f64; 2]) -> Vec3) -> Option<Self> {
        let size = texels.map(|count| (count.ceil() as usize).clamp(1, MAX_CELLS));
        let lookups: [usize; 2] = std::array::from_fn(|i| {
            ((texels[i] / size[i] as f64).ceil() as usize).clamp(LOOKUPS.0, LOOKUPS.1)
        });
        let brightness = |cell: [usize; 2]| {
            let mut sum = 0.0;
            for (j, i) in (0..lookups[1]).flat_map(|j| (0..lookups[0]).map(move |i| (j, i))) {
                let at = |axis: usize, k: usize| {
                    (cell[axis] as f64 + (k as f64 + 0.5) / lookups[axis] as f64) / size[axis] as f64
                };
                sum += mean_channel(color([at(0, i), at(1, j)])).max(0.0);
            }
            sum
        };
        let row = |row: usize| (0..size[0]).map(|column| brightness([column, row])).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = (0..size[1]).map(row).collect();
        let (sum, squares) =
            rows.iter().flatten().fold((0.0, 0.0), |(sum, squares), one| (sum + one, squares + one * one));
        // Variance of the brightness divided by the mean of its square. It is 0 if the brightness is
        // constant.
        let contrast = 1.0 - sum * sum / (squares * (size[0] * size[1]) as f64);
        let texture_probability = (MAX_TEXTURE_PROBABILITY * contrast) as f32;
        let cells = PiecewiseConstant2D::new(size[0], rows.into_iter())
            .filter(|_| texture_probability > MIN_TEXTURE_PROBABILITY)?;
        Some(Self { along: quad.dual_basis(), quad, size, cells, texture_probability })
    }

    /// Pdf in sr⁻¹ at an offset from the point, given the untextured quad's pdf.
    #[inline(always)]
    fn mixture_pdf(&self, offset: Vec3, to_corner: Vec3, quad_pdf: f32) -> f32 {
        let on_quad = offset - to_corner;
        let cell = |axis: usize| {
            let place = self.along[axis].dot(on_quad) * self.size[axis] as f32;
            (if place > 0.0 { place as usize } else { 0 }).min(self.size[axis] - 1)
        };
        let cell_factor = self.cell_pdf_ratio(cell(0), cell(1));
        self.texture_probability * cell_factor / self.quad.inverse_pdf_by_area(offset)
            + (1.0 - self.texture_probability) * quad_pdf
    }

    /// Area density of a cell, relative to a constant texture.
    #[inline(always)]
    fn cell_pdf_ratio(&self, column: usize, row: usize) -> f32 {
        let probability = self.cells.row_probability(row) * self.cells.column_probability_in_row(row, column);
        probability * (self.size[0] * self.size[1]) as f32
    }
}

/// Minimum fraction of texture samples. If the texture has less contrast, texture samples are not worth the
/// lookups.
const MIN_TEXTURE_PROBABILITY: f32 = 0.05;
