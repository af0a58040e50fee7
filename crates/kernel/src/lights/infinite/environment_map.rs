//! Equirectangular environment maps.

use std::f32::consts::PI;
use std::sync::Arc;

use crate::choice;
use crate::materials::texels::Texels;
use crate::math::color::luminance;
use crate::math::elementary::{atan2, sin_cos};
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::{DVec3, Vec3};
use crate::sampling::piecewise_constant::{GridSample, PiecewiseConstant2D};
use crate::sampling::warp;

choice! {
    /// Polar angles of the rows of an environment map.
    pub enum MapRowPlacement {
        /// Rows are centered between the poles: half a row is above the first one.
        Centers = "centers",
        /// The first and the last row are at the poles, as in Mitsuba.
        Poles = "poles",
    }
}

impl MapRowPlacement {
    /// Number of rows per half turn, and the coordinate of the first row below the pole +y.
    fn scale_and_offset(self, rows: u32) -> (f32, f32) {
        match self {
            Self::Poles if rows > 1 => (rows as f32 - 1.0, 1.0),
            Self::Poles | Self::Centers => (rows as f32, 0.5),
        }
    }
}

/// An environment map and its sampling distribution. The top row is at +y, the image center at −z, and the
/// right quarter at +x. Colors are interpolated between texel centers. A cell is the area between four texel
/// centers. Above the first row and below the last row, cells are between two texel centers and the pole.
/// Within a cell, the sampling density is proportional to the luminance, which is bilinearly interpolated in
/// azimuth and height.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    texels: Arc<Texels>,
    cells: PiecewiseConstant2D,
    /// Result of [`MapRowPlacement::scale_and_offset`] for this map.
    scale_and_offset: (f32, f32),
    /// Cosines of the polar angles at the tops of the rows of cells, followed by −1.
    heights: Vec<f64>,
    /// Probability of each row divided by the solid angle of one of its cells, in sr⁻¹.
    pdfs: Vec<f32>,
    /// Mean luminance over all directions.
    mean_luminance: f64,
}

/// A position between four texels.
#[derive(Clone, Copy)]
struct TexelPosition {
    column: u32,
    row: u32,
    /// Fractions from left to right and from top to bottom. The vertical fraction is linear in the angle.
    between: [f32; 2],
    /// Fractions from left to right and from top to bottom. The vertical fraction is linear in the height.
    along: [f32; 2],
}

impl EnvironmentMap {
    /// Creates a map from nonnegative texels. Returns `None` if all texels are black.
    pub fn new(texels: Arc<Texels>) -> Option<Self> {
        Self::with_row_placement(texels, MapRowPlacement::Centers)
    }

    /// Creates a map from nonnegative texels whose rows have the given polar angles. Returns `None` if all
    /// texels are black.
    pub fn with_row_placement(texels: Arc<Texels>, placement: MapRowPlacement) -> Option<Self> {
        let (columns, rows) = (texels.width as usize, texels.height as usize);
        let scale_and_offset @ (scale, offset) = placement.scale_and_offset(texels.height);
        let height = |row: usize| match row {
            0 => 1.0,
            row if row > rows => -1.0,
            row => libm::cos((row as f64 - f64::from(offset)) * std::f64::consts::PI / f64::from(scale)),
        };
        let heights: Vec<f64> = (0..=rows + 1).map(height).collect();
        let luminances = |row: usize| -> Vec<f64> {
            (0..texels.width).map(|x| f64::from(luminance(texels.get(x, row as u32)))).collect()
        };
        let mut upper = luminances(0);
        let mut sum = 0.0;
        let weights = (0..=rows).map(|row| {
            let lower = luminances(row.min(rows - 1));
            let both: Vec<f64> = upper.iter().zip(&lower).map(|(upper, lower)| upper + lower).collect();
            upper = lower;
            let extent = heights[row] - heights[row + 1];
            sum += both.iter().sum::<f64>() * extent;
            (0..columns).map(|column| (both[column] + both[(column + 1) % columns]) * extent).collect()
        });
        let cells = PiecewiseConstant2D::new(columns, weights)?;
        let density = |row: usize| {
            let extent = 2.0 * std::f64::consts::PI / columns as f64 * (heights[row] - heights[row + 1]);
            // Rows at the poles have no extent above or below them.
            if extent > 0.0 { (f64::from(cells.row_probability(row)) / extent) as f32 } else { 0.0 }
        };
        let pdfs = (0..=rows).map(density).collect();
        // Each row of cells is between two rows of texels, and the heights range from 1 to −1.
        let mean_luminance = sum / (4.0 * columns as f64);
        Some(Self { texels, cells, scale_and_offset, heights, pdfs, mean_luminance })
    }

    /// Mean luminance over all directions.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }

    /// Mean color over all directions. Between row centers, colors depend linearly on the polar angle.
    pub fn mean(&self) -> Vec3 {
        let rows = self.texels.height;
        let (scale, offset) = self.scale_and_offset;
        let (step, first) = (std::f64::consts::PI / f64::from(scale), 1.0 - f64::from(offset));
        let (sin, cos) =
            (|row: f64| libm::sin((row + first) * step), |row: f64| libm::cos((row + first) * step));
        let of_row = |row: u32| {
            let sum: DVec3 = (0..self.texels.width).map(|x| self.texels.get(x, row).as_dvec3()).sum();
            let at = f64::from(row);
            // Integrate sin θ times the interpolation weight of the row, both above and below the row.
            let above = if row == 0 { 1.0 - cos(at) } else { (sin(at) - sin(at - 1.0)) / step - cos(at) };
            let is_last = row + 1 == rows;
            let below = if is_last { 1.0 + cos(at) } else { cos(at) - (sin(at + 1.0) - sin(at)) / step };
            sum * (above + below)
        };
        let sum: DVec3 = (0..rows).map(of_row).sum();
        (sum / (2.0 * f64::from(self.texels.width))).as_vec3()
    }

    /// Color and sampling pdf in sr⁻¹ for a unit direction. `turn` is the map's rotation about +y, as a
    /// fraction of 360°, counterclockwise when seen from above.
    #[inline(always)]
    pub fn lookup_color_and_pdf(&self, direction: Vec3, turn: f32) -> (Vec3, f32) {
        let place = self.texel_position(direction, turn);
        let corners = self.corner_texels(place.column, place.row);
        let density = self.cell_pdf(place.column, place.row);
        (
            interpolate_bilinear(&corners, place.between),
            density * relative_pdf_in_cell(&luminances_of_four_corners(&corners), place.along),
        )
    }

    /// Samples a unit direction. Returns the direction along with the color and pdf that
    /// [`EnvironmentMap::lookup_color_and_pdf`] would return for it.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2], turn: f32) -> (Vec3, Vec3, f32) {
        let GridSample { column, row, rest } = self.cells.sample(u);
        let corners = self.corner_texels(column as u32, row as u32);
        let luminances = luminances_of_four_corners(&corners);
        let along = warp::bilinear(rest, &luminances);
        let (direction, down) = self.direction_in_cell(column as f32, row, along, turn);
        let density = self.cell_pdf(column as u32, row as u32);
        (
            direction,
            interpolate_bilinear(&corners, [along[0], down]),
            density * relative_pdf_in_cell(&luminances, along),
        )
    }

    /// Unit direction at a position in a cell. `along` contains the fractions of the cell's azimuth and
    /// height. Also returns the vertical fraction, measured in angle.
    #[inline(always)]
    fn direction_in_cell(&self, column: f32, row: usize, along: [f32; 2], turn: f32) -> (Vec3, f32) {
        let extent = self.heights[row + 1] - self.heights[row];
        self.direction_and_row_fraction(
            column,
            row as f32,
            self.heights[row] + extent * f64::from(along[1]),
            along[0],
            turn,
        )
    }

    /// Unit direction at the height `y` and at a fraction `along` of a cell's azimuth range. Also returns the
    /// vertical fraction, measured in angle.
    #[inline(always)]
    fn direction_and_row_fraction(
        &self,
        column: f32,
        row: f32,
        y: f64,
        along: f32,
        turn: f32,
    ) -> (Vec3, f32) {
        let across = ((1.0 - y) * (1.0 + y)).max(0.0).sqrt() as f32;
        let turns = (column + 0.5 + along) / self.texels.width as f32 - 0.5 - turn;
        let (sin, cos) = sin_cos(2.0 * PI * turns);
        let direction = Vec3::new(across * sin, y as f32, -across * cos);
        let (scale, offset) = self.scale_and_offset;
        let down = atan2(across, y as f32) * (1.0 / PI) * scale + offset - row;
        (direction, down.max(0.0).min(1.0))
    }

    /// [`EnvironmentMap::sample`] for a packet. Returns unit directions, colors, and pdfs. Memory lookups
    /// alternate with branchless loops.
    #[inline(always)]
    pub fn sample_packet(&self, u: &[F32x16; 2], turn: f32) -> (Vec3x16, Vec3x16, F32x16) {
        let (mut columns, mut rows, mut rest) = ([0; PACKET_SIZE], [0; PACKET_SIZE], [[0.0; PACKET_SIZE]; 2]);
        let (mut tops, mut extents) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        let mut pdfs = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let at = self.cells.sample([u[0][i], u[1][i]]);
            (columns[i], rows[i]) = (at.column as u32, at.row as u32);
            (rest[0][i], rest[1][i]) = (at.rest[0], at.rest[1]);
            tops[i] = self.heights[at.row];
            extents[i] = self.heights[at.row + 1] - tops[i];
            pdfs[i] = self.cell_pdf(at.column as u32, at.row as u32);
        }
        let corners = self.corner_texel_packets(&columns, &rows);
        let [mut directions, mut colors] = [[[0.0; PACKET_SIZE]; 3]; 2];
        for i in 0..PACKET_SIZE {
            let corners = [0, 1, 2, 3].map(|corner| lane(&corners[corner], i));
            let luminances = luminances_of_four_corners(&corners);
            let along = warp::bilinear([rest[0][i], rest[1][i]], &luminances);
            let y = tops[i] + extents[i] * f64::from(along[1]);
            let (direction, down) = self.direction_and_row_fraction(
                columns[i] as i32 as f32,
                rows[i] as i32 as f32,
                y,
                along[0],
                turn,
            );
            set_lane(&mut directions, i, direction);
            set_lane(&mut colors, i, interpolate_bilinear(&corners, [along[0], down]));
            pdfs[i] *= relative_pdf_in_cell(&luminances, along);
        }
        (directions, colors, pdfs)
    }

    /// [`EnvironmentMap::lookup_color_and_pdf`] for a packet.
    #[inline(always)]
    pub fn lookup_color_and_pdf_packet(&self, directions: &Vec3x16, turn: f32) -> (Vec3x16, F32x16) {
        let (mut columns, mut rows) = ([0; PACKET_SIZE], [0; PACKET_SIZE]);
        let (mut between, mut angles) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let (x, y) = self.cell_coordinates(lane(directions, i), turn);
            (columns[i], rows[i]) = self.cell_from_cell_coordinates(x, y);
            between[i] = x - columns[i] as i32 as f32;
            angles[i] = y - rows[i] as i32 as f32;
        }
        let corners = self.corner_texel_packets(&columns, &rows);
        let (mut heights, mut pdfs) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            pdfs[i] = self.cell_pdf(columns[i], rows[i]);
            heights[i] = self.fraction_of_row_above(rows[i], directions[1][i]);
        }
        let mut colors = [[0.0; PACKET_SIZE]; 3];
        for i in 0..PACKET_SIZE {
            let corners = [0, 1, 2, 3].map(|corner| lane(&corners[corner], i));
            set_lane(&mut colors, i, interpolate_bilinear(&corners, [between[i], angles[i]]));
            pdfs[i] *= relative_pdf_in_cell(&luminances_of_four_corners(&corners), [between[i], heights[i]]);
        }
        (colors, pdfs)
    }

    #[inline(always)]
    fn texel_position(&self, direction: Vec3, turn: f32) -> TexelPosition {
        let (x, y) = self.cell_coordinates(direction, turn);
        let (column, row) = self.cell_from_cell_coordinates(x, y);
        let between = [x - column as f32, y - row as f32];
        let along = [between[0], self.fraction_of_row_above(row, direction.y)];
        TexelPosition { column, row, between, along }
    }

    /// Cell coordinates of a unit direction.
    #[inline(always)]
    fn cell_coordinates(&self, direction: Vec3, turn: f32) -> (f32, f32) {
        let (width, (scale, offset)) = (self.texels.width as f32, self.scale_and_offset);
        let turns = 0.5 + atan2(direction.x, -direction.z) * (0.5 / PI) + turn;
        let x = (turns - turns.floor()) * width - 0.5;
        let x = if x < 0.0 { x + width } else { x };
        let across = (direction.x * direction.x + direction.z * direction.z).sqrt();
        (x, atan2(across, direction.y) * (1.0 / PI) * scale + offset)
    }

    /// Column and row of a cell from cell coordinates.
    #[inline(always)]
    fn cell_from_cell_coordinates(&self, x: f32, y: f32) -> (u32, u32) {
        // Rounding may have moved a coordinate from just below 0 to the full width.
        ((x as u32).min(self.texels.width - 1), (y as u32).min(self.texels.height))
    }

    /// Fraction of a row's height that is above a direction.
    #[inline(always)]
    fn fraction_of_row_above(&self, row: u32, y: f32) -> f32 {
        let (top, bottom) = (self.heights[row as usize], self.heights[row as usize + 1]);
        (((top - f64::from(y)) / (top - bottom)) as f32).max(0.0).min(1.0)
    }

    /// Indices of the texels around a cell: upper left, upper right, lower left, lower right.
    #[inline(always)]
    fn corner_indices(&self, column: u32, row: u32) -> [usize; 4] {
        let (width, column) = (self.texels.width as usize, column as usize);
        let right = if column + 1 == width { 0 } else { column + 1 };
        let upper = row.saturating_sub(1) as usize * width;
        let lower = row.min(self.texels.height - 1) as usize * width;
        [upper + column, upper + right, lower + column, lower + right]
    }

    /// The texels around a cell.
    #[inline(always)]
    fn corner_texels(&self, column: u32, row: u32) -> [Vec3; 4] {
        // Avoid `map` because it may not be inlined.
        let [a, b, c, d] = self.corner_indices(column, row);
        [
            self.texels.linear_color_at_index(a),
            self.texels.linear_color_at_index(b),
            self.texels.linear_color_at_index(c),
            self.texels.linear_color_at_index(d),
        ]
    }

    /// The texels around a packet of cells. Separate loops let cache misses overlap.
    #[inline(always)]
    fn corner_texel_packets(&self, columns: &[u32; PACKET_SIZE], rows: &[u32; PACKET_SIZE]) -> [Vec3x16; 4] {
        let mut places = [[0; PACKET_SIZE]; 4];
        for i in 0..PACKET_SIZE {
            let own = self.corner_indices(columns[i], rows[i]);
            for corner in 0..4 {
                places[corner][i] = own[corner];
            }
        }
        let mut corners = [[[0.0; PACKET_SIZE]; 3]; 4];
        self.texels.read_color_packets_into(&places, &mut corners);
        corners
    }

    /// Mean pdf of a cell in sr⁻¹.
    #[inline(always)]
    fn cell_pdf(&self, column: u32, row: u32) -> f32 {
        self.pdfs[row as usize] * self.cells.column_probability_in_row(row as usize, column as usize)
    }
}

/// Bilinear interpolation between the texels around a cell.
#[inline(always)]
fn interpolate_bilinear(corners: &[Vec3; 4], between: [f32; 2]) -> Vec3 {
    corners[0].lerp(corners[1], between[0]).lerp(corners[2].lerp(corners[3], between[0]), between[1])
}

#[inline(always)]
fn luminances_of_four_corners(corners: &[Vec3; 4]) -> [f32; 4] {
    corners.map(luminance)
}

/// Pdf at a position in a cell, relative to the mean pdf in the cell.
#[inline(always)]
fn relative_pdf_in_cell(luminances: &[f32; 4], along: [f32; 2]) -> f32 {
    let [a, b, c, d] = *luminances;
    let upper = a + (b - a) * along[0];
    let lower = c + (d - c) * along[0];
    let sum = (a + b) + (c + d);
    let relative_pdf = 4.0 * (upper + (lower - upper) * along[1]) / sum;
    if sum > 0.0 { relative_pdf.max(0.0) } else { 0.0 }
}
