//! FLIP (P. Andersson et al., *FLIP: A Difference Evaluator for Alternating Images*, 2020) for low dynamic
//! range images, viewed at [`PIXELS_PER_DEGREE`]. Images are extended by repeating their border pixels.

mod color;
mod filters;

use rayon::prelude::*;

use self::color::{OpponentColor, PerceivedColor};
use self::filters::{FeatureStrengths, Filters};
use super::plane::Plane;
use super::{ImagePair, tiles};
use crate::film::Rect;
use crate::math::Vec3;

/// Pixels per degree of the visual field, for a display that is 0.7 m wide, has 3840 columns, and is viewed
/// from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Exponent applied to color differences.
const QC: f64 = 0.7;
/// Fraction of the maximum color difference at which the error reaches [`PT`].
const PC: f64 = 0.4;
/// Error for a color difference of [`PC`] times the maximum.
const PT: f64 = 0.95;

/// Computes the error of each pixel, in [0, 1].
pub(super) fn error_map(pair: &ImagePair) -> Vec<f32> {
    let (width, height) = (pair.width(), pair.height());
    let filters = Filters::new(PIXELS_PER_DEGREE);
    let max = libm::pow(color::max_display_hyab_distance(), QC);
    let mut map = vec![0.0; width * height];
    map.par_chunks_mut(width * tiles::SIDE).enumerate().for_each(|(band, out)| {
        for tile in tiles::tiles_in_band(band, width, height) {
            let errors = tile_pixel_errors(pair, tile, &filters, max);
            let rows = errors.chunks_exact(tile.width as usize);
            for (row, out) in rows.zip(out.chunks_exact_mut(width)) {
                out[tile.x as usize..][..row.len()].copy_from_slice(row);
            }
        }
    });
    map
}

fn tile_pixel_errors(pair: &ImagePair, tile: Rect, filters: &Filters, max: f64) -> Vec<f32> {
    let [a, b] = [0, 1].map(|which| perceived_colors_and_features(pair, which, tile, filters));
    let colors = a.0.iter().zip(&b.0).map(|(a, b)| error_from_color_distance(a.distance(b), max));
    let features = a.1.differences(&b.1);
    colors.zip(features).map(|(color, feature)| libm::pow(color, 1.0 - feature) as f32).collect()
}

/// Computes the perceived colors and the features of one image within a tile.
fn perceived_colors_and_features(
    pair: &ImagePair,
    which: usize,
    tile: Rect,
    filters: &Filters,
) -> (Vec<PerceivedColor>, FeatureStrengths) {
    let planes = opponent_planes(pair, which, tile, filters.radius());
    let features = filters.detect_features(&planes[0]);
    let [y, cx, cz] = filters.blurred(&planes);
    let blurred = y.values.iter().zip(&cx.values).zip(&cz.values);
    let perceived =
        blurred.map(|((&y, &cx), &cz)| OpponentColor { y, cx, cz }.to_perceived_color()).collect();
    (perceived, features)
}

/// YCxCz of a tile and its margin.
fn opponent_planes(pair: &ImagePair, which: usize, tile: Rect, margin: usize) -> [Plane; 3] {
    let (width, height) = (tile.width as usize + 2 * margin, tile.height as usize + 2 * margin);
    let mut planes = [0; 3].map(|_| Plane::zero(width, height));
    let position = |start: u32, offset: usize, length: usize| {
        (start as usize + offset).saturating_sub(margin).min(length - 1)
    };
    for row in 0..height {
        let y = position(tile.y, row, pair.height());
        for column in 0..width {
            let pixel = pair.pixel_pair(position(tile.x, column, pair.width()), y)[which];
            let OpponentColor { y, cx, cz } =
                OpponentColor::from_linear(pixel.clamp(Vec3::ZERO, Vec3::ONE).as_dvec3());
            for (plane, value) in planes.iter_mut().zip([y, cx, cz]) {
                plane.values[row * width + column] = value;
            }
        }
    }
    planes
}

/// Maps a color distance to an error in [0, 1]. Most of the range is used for small distances.
fn error_from_color_distance(distance: f64, max: f64) -> f64 {
    let error = libm::pow(distance, QC);
    let knee = PC * max;
    if error < knee { error * PT / knee } else { PT + (error - knee) / (max - knee) * (1.0 - PT) }
}
