//! The Hosek–Wilkie sky and its sun. All radiances are spectral, in linear Rec. 709: a spectrally
//! constant radiance of 1 W·m⁻²·sr⁻¹·nm⁻¹ has a luminance of 1.
//!
//! | files | contents |
//! | --- | --- |
//! | `model` | [`SkyModelInputs`]; the published tables, and their interpolation |
//! | [`sun`] | the sun's disk |
//! | this file | [`SkyDome`]: radiance from all directions, and its sampling distribution |

mod model;
pub mod sun;

use std::f32::consts::PI;
use std::sync::Arc;

pub use self::model::SkyModelInputs;
use self::model::sky_coefficients;
use self::sun::SunDisk;
use crate::math::color::luminance;
use crate::math::elementary::{atan2, exp2, sin_cos};
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::{DVec3, Vec3};
use crate::sampling::piecewise_constant::{GridSample, PiecewiseConstant2D};

/// A sky and its sun.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    /// The sky and the ground, or `None` if they are black.
    pub dome: Option<Arc<SkyDome>>,
    /// The sun, or `None` if its scale is 0.
    pub sun: Option<Arc<SunDisk>>,
}

impl Sky {
    /// Evaluates the model and builds the sampling distribution, in a few milliseconds.
    pub fn new(parameters: &SkyModelInputs) -> Self {
        let sun = (parameters.sun_scale > 0.0).then(|| Arc::new(SunDisk::new(parameters)));
        let of_sun = sun.as_ref().map_or(DVec3::ZERO, |sun| sun.horizontal_irradiance());
        Self { dome: SkyDome::new(parameters, of_sun).map(Arc::new), sun }
    }
}

/// Elevation of a direction above the horizontal plane, in radians.
pub fn elevation(direction: DVec3) -> f64 {
    libm::atan2(direction.y, (direction.x * direction.x + direction.z * direction.z).sqrt())
}

/// Orientation of a sky: an orthonormal basis, and the direction to the sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyFrame {
    /// Horizontal direction 90° from the sun's azimuth.
    side: Vec3,
    /// Direction toward the zenith.
    up: Vec3,
    /// Horizontal direction toward the sun's azimuth.
    toward: Vec3,
    /// Direction toward the sun's center.
    sun: Vec3,
}

impl SkyFrame {
    /// Creates the frame from unit directions toward the sun and the zenith.
    pub fn new(sun: DVec3, up: DVec3) -> Self {
        let side = up.cross(sun).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        Self { side: side.as_vec3(), up: up.as_vec3(), toward: side.cross(up).as_vec3(), sun: sun.as_vec3() }
    }

    /// Unit direction toward the sun's center.
    pub fn sun(&self) -> Vec3 {
        self.sun
    }

    /// Unit direction toward the zenith.
    pub fn up(&self) -> Vec3 {
        self.up
    }
}

/// Radiance of the sky above the horizon, and of a uniform diffuse ground below it. Directions are sampled
/// from cells with equal ranges of azimuth and height. The last row of cells is the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct SkyDome {
    channels: [SkyChannel; 3],
    ground: Vec3,
    cells: PiecewiseConstant2D,
    /// Probability of each row, divided by the solid angle of one of its cells, in sr⁻¹.
    pdfs: Vec<f32>,
    /// Mean radiance over all directions.
    mean: Vec3,
}

/// Number of cells around the horizon.
const COLUMNS: usize = 128;
/// Number of rows of cells from the zenith to the horizon.
const ROWS: usize = 64;

impl SkyDome {
    /// Evaluates the model. `sun_irradiance` is the sun's irradiance on the ground. Returns `None` if the sky
    /// and the ground are black.
    fn new(parameters: &SkyModelInputs, sun_irradiance: DVec3) -> Option<Self> {
        let channels = [0, 1, 2].map(|channel| SkyChannel::new(parameters, channel));
        let (sin, cos) = (libm::sin(parameters.sun_elevation), libm::cos(parameters.sun_elevation));
        let frame = SkyFrame::new(DVec3::new(cos, sin, 0.0), DVec3::Y);
        let (mut luminances, mut sum, mut irradiance) = (Vec::new(), DVec3::ZERO, DVec3::ZERO);
        for (row, column) in (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column))) {
            let mut of_cell = DVec3::ZERO;
            for at in GAUSS_POINTS.into_iter().flat_map(|down| GAUSS_POINTS.map(|along| [along, down])) {
                let direction = direction_in_cell(&frame, column, row, at);
                let radiance = sky_radiance(&channels, &frame, direction).as_dvec3() * 0.25;
                of_cell += radiance;
                irradiance += radiance * f64::from(direction.y);
            }
            sum += of_cell;
            luminances.push(f64::from(luminance(of_cell.as_vec3())));
        }
        let solid_angle = 2.0 * std::f64::consts::PI / (COLUMNS * ROWS) as f64;
        let lit = (irradiance * solid_angle + sun_irradiance) / std::f64::consts::PI;
        let ground = (parameters.ground.as_dvec3() * lit * f64::from(parameters.ground_scale)).as_vec3();
        // Unless the sky is black, any cell may contain light, even if its Gauss points are black.
        let least = luminances.iter().sum::<f64>() / luminances.len() as f64 * 1e-3;
        let dome = luminances.chunks(COLUMNS).map(|row| row.iter().map(|one| one.max(least)).collect());
        let of_ground = vec![f64::from(luminance(ground)) * ROWS as f64; COLUMNS];
        let cells = PiecewiseConstant2D::new(COLUMNS, dome.chain([of_ground]))?;
        let pdf = |row: usize| {
            let extent = if row < ROWS { 1.0 / ROWS as f32 } else { 1.0 };
            cells.row_probability(row) * COLUMNS as f32 / (2.0 * PI * extent)
        };
        let pdfs = (0..=ROWS).map(pdf).collect();
        let mean = (sum / (COLUMNS * ROWS) as f64 + ground.as_dvec3()) * 0.5;
        Some(Self { channels, ground, cells, pdfs, mean: mean.as_vec3() })
    }

    /// Mean radiance over all directions.
    pub fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Radiance from a unit direction, and pdf of [`SkyDome::sample`] in sr⁻¹.
    pub fn radiance_and_pdf(&self, frame: &SkyFrame, direction: Vec3) -> (Vec3, f32) {
        let turns = atan2(direction.dot(frame.side), direction.dot(frame.toward)) * (0.5 / PI);
        let column = ((turns - turns.floor()) * COLUMNS as f32) as usize;
        let height = direction.dot(frame.up);
        let row =
            if height < 0.0 { ROWS } else { ((1.0 - height) * ROWS as f32).min(ROWS as f32 - 1.0) as usize };
        (self.radiance(frame, direction), self.cell_pdf(column.min(COLUMNS - 1), row))
    }

    /// Samples a unit direction. Returns the direction, its radiance and its pdf in sr⁻¹.
    pub fn sample(&self, frame: &SkyFrame, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        let GridSample { column, row, rest } = self.cells.sample(u);
        let direction = direction_in_cell(frame, column, row, rest);
        (direction, self.radiance(frame, direction), self.cell_pdf(column, row))
    }

    /// [`SkyDome::radiance_and_pdf`] for a packet. Not inlined, to avoid a copy in every kernel that samples
    /// lights.
    #[inline(never)]
    pub fn radiance_and_pdf_packet(&self, frame: &SkyFrame, directions: &Vec3x16) -> (Vec3x16, F32x16) {
        let (mut radiances, mut pdfs) = ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let (radiance, pdf) = self.radiance_and_pdf(frame, lane(directions, i));
            set_lane(&mut radiances, i, radiance);
            pdfs[i] = pdf;
        }
        (radiances, pdfs)
    }

    /// [`SkyDome::sample`] for a packet.
    #[inline(never)]
    pub fn sample_packet(&self, frame: &SkyFrame, u: &[F32x16; 2]) -> (Vec3x16, Vec3x16, F32x16) {
        let [mut directions, mut radiances] = [[[0.0; PACKET_SIZE]; 3]; 2];
        let mut pdfs = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let (direction, radiance, pdf) = self.sample(frame, [u[0][i], u[1][i]]);
            set_lane(&mut directions, i, direction);
            set_lane(&mut radiances, i, radiance);
            pdfs[i] = pdf;
        }
        (directions, radiances, pdfs)
    }

    fn radiance(&self, frame: &SkyFrame, direction: Vec3) -> Vec3 {
        if direction.dot(frame.up) < 0.0 {
            self.ground
        } else {
            sky_radiance(&self.channels, frame, direction)
        }
    }

    fn cell_pdf(&self, column: usize, row: usize) -> f32 {
        self.pdfs[row] * self.cells.column_probability_in_row(row, column)
    }
}

/// Nodes of two-point Gauss–Legendre quadrature on [0, 1].
const GAUSS_POINTS: [f32; 2] = [0.211_324_87, 0.788_675_1];

/// Unit direction at a position in a cell, given as fractions of the cell's azimuth and height.
fn direction_in_cell(frame: &SkyFrame, column: usize, row: usize, [along, down]: [f32; 2]) -> Vec3 {
    let height = if row < ROWS { 1.0 - (row as f32 + down) / ROWS as f32 } else { -down };
    let across = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
    let (sin, cos) = sin_cos(2.0 * PI * (column as f32 + along) / COLUMNS as f32);
    frame.side * (across * sin) + frame.toward * (across * cos) + frame.up * height
}

/// Radiance of the sky from a unit direction above the horizon.
fn sky_radiance(channels: &[SkyChannel; 3], frame: &SkyFrame, direction: Vec3) -> Vec3 {
    // Compute the angle to the sun from the chord, which is accurate even for small angles.
    let squared_chord = (direction - frame.sun).length_squared().min(4.0);
    let point = SkyPoint {
        height: direction.dot(frame.up).max(0.0),
        squared_chord,
        angle: 2.0 * atan2(squared_chord.sqrt(), (4.0 - squared_chord).sqrt()),
    };
    let [red, green, blue] = channels;
    Vec3::new(red.radiance(&point), green.radiance(&point), blue.radiance(&point))
}

/// A point of the sky, described relative to the horizon and the sun.
struct SkyPoint {
    /// Sine of the elevation.
    height: f32,
    /// Squared length of the chord to the sun: 2 − 2·cos γ.
    squared_chord: f32,
    /// Angle γ to the sun.
    angle: f32,
}

/// Coefficients of one color channel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SkyChannel(
    /// The coefficients, with B and E multiplied by log₂ e, and the mean radiance multiplied by the scale.
    [f32; 10],
);

impl SkyChannel {
    fn new(parameters: &SkyModelInputs, channel: usize) -> Self {
        let mut all = sky_coefficients(parameters, channel);
        all[1] *= std::f64::consts::LOG2_E;
        all[4] *= std::f64::consts::LOG2_E;
        all[9] *= f64::from(parameters.sky_scale);
        Self(all.map(|one| one as f32))
    }

    /// Radiance, equation 8 of the 2012 paper. The fit is slightly negative in places; clamps it to 0.
    fn radiance(&self, point: &SkyPoint) -> f32 {
        let [a, b, c, d, e, f, g, i, h, mean] = self.0;
        let SkyPoint { height, squared_chord, angle } = *point;
        let cos = 1.0 - 0.5 * squared_chord;
        let base = (1.0 - h) * (1.0 - h) + h * squared_chord;
        let anisotropy = (1.0 + cos * cos) / (base * base.sqrt());
        let horizon = 1.0 + a * exp2(b / (height + 0.01));
        let glow = c + d * exp2(e * angle) + f * (cos * cos) + g * anisotropy + i * height.sqrt();
        (horizon * glow * mean).max(0.0)
    }
}

#[cfg(test)]
mod tests;
