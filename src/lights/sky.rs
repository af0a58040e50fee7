//! Equirectangular maps of the light from all around.

use std::f32::consts::PI;
use std::sync::Arc;

use crate::materials::texels::Texels;
use crate::math::color::luminance;
use crate::math::elementary::{atan2, sin_cos};
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};
use crate::math::{DVec3, Vec3};
use crate::sampling::grid::{Grid, InGrid};

/// A map, top row at +y, the middle of it towards −z, its right quarter towards +x, with the distribution that its directions
/// are sampled by. It is interpolated between the centres of its texels: its cells lie between four of those, and above the
/// first row and below the last one between two.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyMap {
    texels: Arc<Texels>,
    cells: Grid,
    /// Cosines of the angles from the top at which rows of cells begin, and −1.
    heights: Vec<f64>,
    /// Density in sr⁻¹ of a row, were its columns alike.
    densities: Vec<f32>,
    /// Over all directions.
    mean_luminance: f64,
}

/// A place between four texels.
#[derive(Clone, Copy)]
struct Place {
    column: u32,
    row: u32,
    /// From the left texels to the right ones, and from the upper to the lower ones.
    between: [f32; 2],
}

impl SkyMap {
    /// Of texels ≥ 0; none where all are black.
    pub fn new(texels: Arc<Texels>) -> Option<Self> {
        let (columns, rows) = (texels.width as usize, texels.height as usize);
        let height = |row: usize| match row {
            0 => 1.0,
            row if row > rows => -1.0,
            row => libm::cos((row as f64 - 0.5) * std::f64::consts::PI / rows as f64),
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
        let cells = Grid::new(columns, weights)?;
        let density = |row: usize| {
            let extent = 2.0 * std::f64::consts::PI / columns as f64 * (heights[row] - heights[row + 1]);
            (f64::from(cells.row_probability(row)) / extent) as f32
        };
        let densities = (0..=rows).map(density).collect();
        // Of both rows of texels around each of cells, and of heights from 1 to −1.
        let mean_luminance = sum / (4.0 * columns as f64);
        Some(Self { texels, cells, heights, densities, mean_luminance })
    }

    /// The mean of the luminance over all directions.
    pub fn mean_luminance(&self) -> f64 {
        self.mean_luminance
    }

    /// The mean of the colours over all directions: between the middles of rows they are linear in the angle from the top.
    pub fn mean(&self) -> Vec3 {
        let rows = self.texels.height;
        let step = std::f64::consts::PI / f64::from(rows);
        let (sin, cos) = (|row: f64| libm::sin((row + 0.5) * step), |row: f64| libm::cos((row + 0.5) * step));
        let of_row = |row: u32| {
            let sum: DVec3 = (0..self.texels.width).map(|x| self.texels.get(x, row).as_dvec3()).sum();
            let at = f64::from(row);
            // ∫ sin θ dθ of what it is above it, and below it.
            let above = if row == 0 { 1.0 - cos(at) } else { (sin(at) - sin(at - 1.0)) / step - cos(at) };
            let is_last = row + 1 == rows;
            let below = if is_last { 1.0 + cos(at) } else { cos(at) - (sin(at + 1.0) - sin(at)) / step };
            sum * (above + below)
        };
        let sum: DVec3 = (0..rows).map(of_row).sum();
        (sum / (2.0 * f64::from(self.texels.width))).as_vec3()
    }

    /// The colour in a unit direction, and the density in sr⁻¹ with which samples have it. `turn` are the turns of the map
    /// about +y, counterclockwise seen from above.
    #[inline(always)]
    pub fn lookup(&self, direction: Vec3, turn: f32) -> (Vec3, f32) {
        let place = self.place(direction, turn);
        (self.color(&place), self.density(&place))
    }

    /// A unit direction.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2], turn: f32) -> Vec3 {
        self.direction(&self.cells.sample(u), turn)
    }

    #[inline(always)]
    fn direction(&self, at: &InGrid, turn: f32) -> Vec3 {
        let InGrid { column, row, rest } = *at;
        let extent = self.heights[row + 1] - self.heights[row];
        self.towards(column as f32, self.heights[row] + extent * f64::from(rest[1]), rest[0], turn)
    }

    /// A unit direction of a height in a column, so far along it.
    #[inline(always)]
    fn towards(&self, column: f32, y: f64, along: f32, turn: f32) -> Vec3 {
        let across = ((1.0 - y) * (1.0 + y)).max(0.0).sqrt() as f32;
        let turns = (column + 0.5 + along) / self.texels.width as f32 - 0.5 - turn;
        let (sin, cos) = sin_cos(2.0 * PI * turns);
        Vec3::new(across * sin, y as f32, -across * cos)
    }

    /// [`SkyMap::sample`] side by side. What is looked up is looked up between loops without branches.
    #[inline(always)]
    pub fn sample_row(&self, u: &[Lanes; 2], turn: f32) -> Lanes3 {
        let (mut columns, mut along, mut heights) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let InGrid { column, row, rest } = self.cells.sample([u[0][i], u[1][i]]);
            let extent = self.heights[row + 1] - self.heights[row];
            heights[i] = self.heights[row] + extent * f64::from(rest[1]);
            (columns[i], along[i]) = (column as f32, rest[0]);
        }
        let mut directions = [[0.0; LANES]; 3];
        for i in 0..LANES {
            set_lane(&mut directions, i, self.towards(columns[i], heights[i], along[i], turn));
        }
        directions
    }

    /// [`SkyMap::lookup`] side by side.
    #[inline(always)]
    pub fn lookup_row(&self, directions: &Lanes3, turn: f32) -> (Lanes3, Lanes) {
        let (mut columns, mut rows, mut between) = ([0; LANES], [0; LANES], [[0.0; LANES]; 2]);
        for i in 0..LANES {
            let place = self.place(lane(directions, i), turn);
            (columns[i], rows[i]) = (place.column, place.row);
            (between[0][i], between[1][i]) = (place.between[0], place.between[1]);
        }
        let (mut colors, mut densities) = ([[0.0; LANES]; 3], [0.0; LANES]);
        for i in 0..LANES {
            let place = Place { column: columns[i], row: rows[i], between: [between[0][i], between[1][i]] };
            set_lane(&mut colors, i, self.color(&place));
            densities[i] = self.density(&place);
        }
        (colors, densities)
    }

    #[inline(always)]
    fn place(&self, direction: Vec3, turn: f32) -> Place {
        let (width, height) = (self.texels.width as f32, self.texels.height as f32);
        let turns = 0.5 + atan2(direction.x, -direction.z) * (0.5 / PI) + turn;
        let x = (turns - turns.floor()) * width - 0.5;
        let x = if x < 0.0 { x + width } else { x };
        // A number just below 0 is rounded up to the width.
        let column = (x as u32).min(self.texels.width - 1);
        let across = (direction.x * direction.x + direction.z * direction.z).sqrt();
        let y = atan2(across, direction.y) * (1.0 / PI) * height + 0.5;
        let row = (y as u32).min(self.texels.height);
        Place { column, row, between: [x - column as f32, y - row as f32] }
    }

    #[inline(always)]
    fn color(&self, place: &Place) -> Vec3 {
        let Place { column, row, between } = *place;
        let right = if column + 1 == self.texels.width { 0 } else { column + 1 };
        let (upper, lower) = (row.saturating_sub(1), row.min(self.texels.height - 1));
        let between_in = |row| self.texels.get(column, row).lerp(self.texels.get(right, row), between[0]);
        between_in(upper).lerp(between_in(lower), between[1])
    }

    #[inline(always)]
    fn density(&self, place: &Place) -> f32 {
        let row = place.row as usize;
        self.densities[row] * self.cells.column_probability(row, place.column as usize)
    }
}
