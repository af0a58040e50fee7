//! Filters that model the visual system: contrast sensitivity as a blur of each opponent channel, and edge
//! and point detection in lightness.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::super::plane::{Plane, normalized_taps, tap_offsets, unnormalized_gaussian_taps};

/// A Gaussian term of a contrast sensitivity function: amplitude, and width in square degrees.
#[derive(Clone, Copy)]
struct SensitivityTerm {
    a: f64,
    b: f64,
}

/// Contrast sensitivity of the achromatic, red–green and blue–yellow channels (table 1 in the paper, omitting
/// second terms that are 0).
const SENSITIVITY: [&[SensitivityTerm]; 3] = [
    &[SensitivityTerm { a: 1.0, b: 0.0047 }],
    &[SensitivityTerm { a: 1.0, b: 0.0053 }],
    &[SensitivityTerm { a: 34.1, b: 0.04 }, SensitivityTerm { a: 13.5, b: 0.025 }],
];
/// Width of the widest Gaussian in square degrees.
const MAX_WIDTH: f64 = 0.04;
/// Size of the features that the eye detects best, in degrees.
const FEATURE_DEGREES: f64 = 0.082;
/// Filter radius in standard deviations.
const RADIUS_IN_SIGMAS: f64 = 3.0;

/// A separable blur with a weight.
struct WeightedGaussian {
    weight: f64,
    taps: Vec<f64>,
}

/// All filters for a specific number of pixels per degree, padded to the same length.
pub(super) struct Filters {
    radius: usize,
    blurs: [Vec<WeightedGaussian>; 3],
    smooth: Vec<f64>,
    edge: Vec<f64>,
    point: Vec<f64>,
}

impl Filters {
    pub(super) fn new(pixels_per_degree: f64) -> Self {
        let blur_radius =
            (RADIUS_IN_SIGMAS * (MAX_WIDTH / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as usize;
        let sigma = 0.5 * FEATURE_DEGREES * pixels_per_degree;
        let feature_radius = (RADIUS_IN_SIGMAS * sigma).ceil() as usize;
        let radius = blur_radius.max(feature_radius);
        let padded = |taps: &[f64], from: usize| {
            let zeros = vec![0.0; radius - from];
            [&zeros, taps, &zeros].concat()
        };
        let blurs = SENSITIVITY.map(|terms| {
            let mut blurs = sensitivity_blurs_of_channel(terms, blur_radius, pixels_per_degree);
            blurs.iter_mut().for_each(|blur| blur.taps = padded(&blur.taps, blur_radius));
            blurs
        });
        let bell = unnormalized_gaussian_taps(sigma, feature_radius);
        let slope: Vec<_> = tap_offsets(feature_radius).zip(&bell).map(|(x, g)| -x * g).collect();
        let curvature: Vec<_> = tap_offsets(feature_radius)
            .zip(&bell)
            .map(|(x, g)| (x * x / (sigma * sigma) - 1.0) * g)
            .collect();
        Self {
            radius,
            blurs,
            smooth: padded(&normalized_taps(&bell), feature_radius),
            edge: padded(&normalize_signs_separately(&slope), feature_radius),
            point: padded(&normalize_signs_separately(&curvature), feature_radius),
        }
    }

    /// Radius of the filters in pixels.
    pub(super) fn radius(&self) -> usize {
        self.radius
    }

    /// Blurs the opponent channels as the eye does at the viewing distance.
    pub(super) fn blurred(&self, planes: &[Plane; 3]) -> [Plane; 3] {
        [0, 1, 2].map(|channel| {
            let parts = self.blurs[channel].iter().map(|blur| {
                let mut part = planes[channel].filtered(&blur.taps, &blur.taps);
                part.values.iter_mut().for_each(|value| *value *= blur.weight);
                part
            });
            let sum = |mut sum: Plane, part: Plane| {
                sum.values.iter_mut().zip(part.values).for_each(|(sum, value)| *sum += value);
                sum
            };
            parts.reduce(sum).unwrap_or_else(|| Plane::zero(0, 0))
        })
    }

    /// Detects edges and points in the achromatic channel.
    pub(super) fn detect_features(&self, y: &Plane) -> FeatureStrengths {
        let lightness = Plane { values: y.values.iter().map(|y| (y + 16.0) / 116.0).collect(), ..*y };
        let smooth = lightness.filter_along_rows(&self.smooth);
        let strengths = |taps: &[f64]| {
            let across = lightness.filter_along_rows(taps).filter_along_columns(&self.smooth);
            let down = smooth.filter_along_columns(taps);
            across.values.iter().zip(&down.values).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        FeatureStrengths { edges: strengths(&self.edge), points: strengths(&self.point) }
    }
}

/// Creates the Gaussian blurs for a channel. Their weights are chosen so that all 2D taps sum to 1.
fn sensitivity_blurs_of_channel(
    terms: &[SensitivityTerm],
    radius: usize,
    pixels_per_degree: f64,
) -> Vec<WeightedGaussian> {
    let volumes = terms.iter().map(|term| {
        // exp(−π²d²/b) with d in degrees.
        let sigma = (term.b / 2.0).sqrt() / PI * pixels_per_degree;
        let taps = unnormalized_gaussian_taps(sigma, radius);
        let sum: f64 = taps.iter().sum();
        WeightedGaussian { weight: term.a * (PI / term.b).sqrt() * sum * sum, taps: normalized_taps(&taps) }
    });
    let mut blurs: Vec<_> = volumes.collect();
    let total: f64 = blurs.iter().map(|blur| blur.weight).sum();
    blurs.iter_mut().for_each(|blur| blur.weight /= total);
    blurs
}

/// Scales positive taps to a sum of 1, and negative taps to a sum of −1.
fn normalize_signs_separately(taps: &[f64]) -> Vec<f64> {
    let positive: f64 = taps.iter().filter(|tap| **tap > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|tap| **tap < 0.0).sum::<f64>();
    taps.iter().map(|tap| tap / if *tap > 0.0 { positive } else { negative }).collect()
}

/// Strength of edges and points at each pixel.
pub(super) struct FeatureStrengths {
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl FeatureStrengths {
    /// Returns each pixel's feature difference, in [0, 1].
    pub(super) fn differences<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = f64> + 'a {
        let between = |a: &'a [f64], b: &'a [f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs());
        let edges = between(&self.edges, &other.edges);
        let points = between(&self.points, &other.points);
        edges.zip(points).map(|(edge, point)| (edge.max(point) * FRAC_1_SQRT_2).sqrt())
    }
}
