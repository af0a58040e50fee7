//! Error metrics computed from linear values.

use rayon::prelude::*;

use super::ImagePair;
use crate::math::color::{LUMINANCE_WEIGHTS, RELMSE_EPSILON};
use crate::math::{DVec2, Vec3};

/// The trimmed mean excludes one in `DROPPED_ONE_IN` pixels.
const DROPPED_ONE_IN: usize = 1000;

pub(super) struct LinearErrors {
    pub(super) rmse: f64,
    pub(super) relmse: f64,
    pub(super) relmse_trimmed: f64,
    pub(super) dropped_pixels: u64,
    pub(super) max: f64,
    pub(super) max_at: [u32; 2],
    pub(super) luminances: [f64; 2],
}

/// Sums over pixels.
#[derive(Clone, Copy, Default)]
struct LinearErrorSums {
    square: f64,
    relative: f64,
    max: f64,
    /// Column and row of the first pixel with the largest difference.
    max_at: [u32; 2],
    /// Total luminance of each image.
    luminances: DVec2,
}

pub(super) fn measure(pair: &ImagePair) -> LinearErrors {
    let pixels = pair.measured_image().pixels.len();
    let rows = map_row_pairs(pair, row_error_sums);
    let sums = rows.into_iter().enumerate().fold(LinearErrorSums::default(), |sums, (y, row)| {
        let (max, max_at) =
            if row.max > sums.max { (row.max, [row.max_at[0], y as u32]) } else { (sums.max, sums.max_at) };
        LinearErrorSums {
            square: sums.square + row.square,
            relative: sums.relative + row.relative,
            max,
            max_at,
            luminances: sums.luminances + row.luminances,
        }
    });
    let dropped = pixels / DROPPED_ONE_IN;
    let relmse = sums.relative / pixels as f64;
    LinearErrors {
        rmse: (sums.square / (3 * pixels) as f64).sqrt(),
        relmse,
        relmse_trimmed: if dropped == 0 { relmse } else { trimmed_relmse(pair, dropped) },
        dropped_pixels: dropped as u64,
        max: sums.max,
        max_at: sums.max_at,
        luminances: (sums.luminances / pixels as f64).to_array(),
    }
}

/// Applies `row` to each row and returns the results in order.
fn map_row_pairs<T: Send>(pair: &ImagePair, row: impl Fn(&[Vec3], &[Vec3]) -> T + Sync) -> Vec<T> {
    let a = pair.measured_image().pixels.par_chunks(pair.width());
    a.zip(pair.reference().pixels.par_chunks(pair.width())).map(|(a, b)| row(a, b)).collect()
}

fn row_error_sums(a: &[Vec3], b: &[Vec3]) -> LinearErrorSums {
    let mut sums = LinearErrorSums::default();
    for (x, (&a, &b)) in a.iter().zip(b).enumerate() {
        let difference = a.as_dvec3() - b.as_dvec3();
        sums.square += difference.length_squared();
        sums.relative += pixel_relative_squared_error(a, b);
        sums.luminances +=
            DVec2::from([a, b].map(|color| color.as_dvec3().dot(LUMINANCE_WEIGHTS.as_dvec3())));
        let largest = difference.abs().max_element();
        if largest > sums.max {
            (sums.max, sums.max_at) = (largest, [x as u32, 0]);
        }
    }
    sums
}

/// Returns the mean of (a − b)²/(b² + 0.01) over the channels.
fn pixel_relative_squared_error(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3(), b.as_dvec3());
    ((a - b) * (a - b) / (b * b + RELMSE_EPSILON)).element_sum() / 3.0
}

/// Mean of [`pixel_relative_squared_error`], excluding the largest values.
fn trimmed_relmse(pair: &ImagePair, dropped: usize) -> f64 {
    let pixels = pair.measured_image().pixels.par_iter().zip(&pair.reference().pixels);
    let mut errors: Vec<f64> = pixels.map(|(&a, &b)| pixel_relative_squared_error(a, b)).collect();
    let kept = errors.len() - dropped;
    let (_, &mut min_dropped, _) = errors.select_nth_unstable_by(kept, f64::total_cmp);
    drop(errors);
    let rows = map_row_pairs(pair, |a, b| {
        let errors = a.iter().zip(b).map(|(&a, &b)| pixel_relative_squared_error(a, b));
        errors
            .filter(|error| *error < min_dropped)
            .fold((0.0, 0), |(sum, count), error| (sum + error, count + 1))
    });
    let (sum, count) =
        rows.into_iter().fold((0.0, 0_usize), |all, row: (f64, usize)| (all.0 + row.0, all.1 + row.1));
    // Several values may equal the smallest dropped value. Count as many of them as are kept.
    (sum + (kept - count) as f64 * min_dropped) / kept as f64
}
