//! The tables of the Hosek–Wilkie model: coefficients of the sky and the radiance of the sun.
//!
//! `hosek_wilkie.bin` contains two tables of little-endian `f32` values. The first contains
//! [`SkyCoefficients`] for turbidities 1 to 10, ground albedos 0 and 1, six control points over the sun's
//! elevation, and the channels red, green and blue. The second contains the sun's mean radiance for the same
//! turbidities as piecewise cubic polynomials of the elevation in radians: 45 segments, three channels, four
//! coefficients. Radiances are in linear Rec. 709, where the luminance of a spectrally constant radiance of
//! 1 W·m⁻²·sr⁻¹·nm⁻¹ is 1. `tables.py` computes the file from the authors' tables.

use std::f64::consts::FRAC_PI_2;

use crate::math::{DVec3, Vec3};

/// Parameters of a sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyModelInputs {
    /// Elevation of the sun's center in radians, in (0, π/2].
    pub sun_elevation: f64,
    /// Turbidity of the air, from 1 to 10.
    pub turbidity: f64,
    /// Albedo of the ground, from 0 to 1.
    pub ground: Vec3,
    /// Angular diameter of the sun in radians.
    pub sun_angle: f64,
    /// Factor on the sun's radiance.
    pub sun_scale: f32,
    /// Factor on the sky's radiance.
    pub sky_scale: f32,
    /// Factor on the radiance of the ground.
    pub ground_scale: f32,
}

/// The parameters A, B, C, D, E, F, G, I, H of the distribution of one channel, in the order of the published
/// tables, followed by the mean radiance (Hosek and Wilkie, *An Analytic Model for Full Spectral Sky-Dome
/// Radiance*, 2012, eq. 8).
pub(super) type SkyCoefficients = [f64; PARAMETERS];

const TABLES: &[u8] = include_bytes!("hosek_wilkie.bin");
const TURBIDITIES: usize = 10;
const ALBEDOS: usize = 2;
const CONTROL_POINTS: usize = 6;
const CHANNELS: usize = 3;
const PARAMETERS: usize = 10;
const SEGMENTS: usize = 45;
const ORDER: usize = 4;
const SUN_TABLE: usize = TURBIDITIES * ALBEDOS * CONTROL_POINTS * CHANNELS * PARAMETERS;

/// Limb darkening of the sun's disk in each channel: coefficients of a polynomial in the cosine μ between the
/// sun's surface normal and the ray. The mean over the disk is 1. The spectral polynomials (Hosek and Wilkie,
/// *Adding a Solar-Radiance Function to the Hošek–Wilkie Skylight Model*, 2013) are averaged over the
/// spectrum of a sun at 40° and turbidity 3. For other suns above 10°, the resulting error is at most 1 % in
/// red and green, and at most 6 % in blue.
pub(super) const LIMB_DARKENING: [[f32; 6]; CHANNELS] = [
    [0.399_946, 1.627_701, -2.291_01, 3.041_141, -2.242_908, 0.670_615],
    [0.317_416, 1.662_939, -1.839_017, 2.136_627, -1.415_792, 0.387_611],
    [0.211_736, 1.642_759, -1.232_128, 1.300_413, -0.815_469, 0.212_845],
];

fn table_entry(index: usize) -> f64 {
    f64::from(f32::from_le_bytes(TABLES.as_chunks::<4>().0[index]))
}

/// Index of the table at or below a turbidity, and the fraction for interpolation with the next table.
fn turbidity_index_and_fraction(turbidity: f64) -> (usize, f64) {
    let index = (turbidity as usize).clamp(1, TURBIDITIES - 1) - 1;
    (index, turbidity - (index + 1) as f64)
}

/// Coefficients of one channel. The tables are interpolated linearly over turbidity and albedo, and with
/// Bézier curves of degree 5 over the cube root of the elevation.
pub(super) fn sky_coefficients(parameters: &SkyModelInputs, channel: usize) -> SkyCoefficients {
    let SkyModelInputs { sun_elevation, turbidity, ground, .. } = *parameters;
    let albedo = f64::from(ground[channel]);
    let x = libm::cbrt(sun_elevation / FRAC_PI_2).min(1.0);
    let (first, fraction) = turbidity_index_and_fraction(turbidity);
    let mut all = [0.0; PARAMETERS];
    for (turbidity, share) in [(first, 1.0 - fraction), (first + 1, fraction)] {
        for (row, weight) in [(0, share * (1.0 - albedo)), (1, share * albedo)] {
            for (control, binomial) in [1.0, 5.0, 10.0, 10.0, 5.0, 1.0].into_iter().enumerate() {
                let power = |x: f64, count: usize| (0..count).fold(1.0, |product, _| product * x);
                let bernstein = binomial * power(x, control) * power(1.0 - x, CONTROL_POINTS - 1 - control);
                let place = ((turbidity * ALBEDOS + row) * CONTROL_POINTS + control) * CHANNELS + channel;
                for (parameter, sum) in all.iter_mut().enumerate() {
                    *sum += weight * bernstein * table_entry(place * PARAMETERS + parameter);
                }
            }
        }
    }
    all
}

/// Mean radiance of the sun's disk at an elevation in radians.
pub(super) fn sun_radiance(turbidity: f64, elevation: f64) -> DVec3 {
    let segment = (libm::cbrt(elevation / FRAC_PI_2) * SEGMENTS as f64) as usize;
    let segment = segment.min(SEGMENTS - 1);
    let start = segment as f64 / SEGMENTS as f64;
    let x = elevation - start * start * start * FRAC_PI_2;
    let (first, fraction) = turbidity_index_and_fraction(turbidity);
    let of_turbidity = |turbidity: usize| {
        DVec3::from([0, 1, 2].map(|channel| {
            let place = SUN_TABLE + ((turbidity * SEGMENTS + segment) * CHANNELS + channel) * ORDER;
            (0..ORDER).rev().fold(0.0, |sum, power| sum * x + table_entry(place + power))
        }))
    };
    // Near the horizon, the color is outside the Rec. 709 gamut, and blue is slightly negative.
    of_turbidity(first).lerp(of_turbidity(first + 1), fraction).max(DVec3::ZERO)
}
