//! Color spaces in image files: transfer curves and primaries.

use std::f64::consts::E;

use super::primaries::is_identity;
use crate::math::color::srgb_to_linear;
use crate::math::elementary::pow_f64;
use crate::math::{DMat3, DVec3};

/// A transfer function from samples in [0, 1] to linear light.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TransferFunction {
    Srgb,
    /// A power function with this exponent.
    Power(f64),
    /// (a·x + b)^g + e for x ≥ d, c·x + f below (ICC.1, 10.18).
    Parametric {
        g: f64,
        a: f64,
        b: f64,
        c: f64,
        d: f64,
        e: f64,
        f: f64,
    },
    /// Values from 0 to 65535 at evenly spaced inputs.
    Table(Vec<u16>),
    /// Perceptual quantization (SMPTE ST 2084). 203 cd/m² maps to 1.
    Pq,
    /// Hybrid log-gamma (ITU-R BT.2100, table 5), scene-referred. A signal of 0.75 maps to 1.
    Hlg,
}

impl TransferFunction {
    pub(super) const LINEAR: Self = Self::Power(1.0);
    /// Inverse of the ITU-R BT.709 camera curve.
    pub(super) const REC_709: Self = Self::Parametric {
        g: 1.0 / 0.45,
        a: 1.0 / 1.099,
        b: 0.099 / 1.099,
        c: 1.0 / 4.5,
        d: 0.081,
        e: 0.0,
        f: 0.0,
    };

    /// Inverse of the SMPTE ST 240 camera curve.
    pub(super) const SMPTE_240M: Self = Self::Parametric {
        g: 1.0 / 0.45,
        a: 1.0 / 1.1115,
        b: 0.1115 / 1.1115,
        c: 1.0 / 4.0,
        d: 4.0 * 0.0228,
        e: 0.0,
        f: 0.0,
    };

    /// Converts a sample in [0, 1] to linear light.
    pub(super) fn decode(&self, x: f64) -> f64 {
        match self {
            Self::Srgb => f64::from(srgb_to_linear(x as f32)),
            Self::Power(exponent) => pow_or_zero(x, *exponent),
            Self::Parametric { g, a, b, c, d, e, f } => {
                if x >= *d {
                    pow_or_zero(a * x + b, *g) + e
                } else {
                    c * x + f
                }
            }
            Self::Table(values) => interpolate_table(values, x),
            Self::Pq => decode_pq(x),
            Self::Hlg => decode_hlg(x) / decode_hlg(0.75),
        }
    }

    /// Whether the curve matches sRGB for 8-bit samples, within the rounding error of profile values.
    fn is_srgb(&self) -> bool {
        const TOLERANCE: f64 = 1.5e-3;
        *self == Self::Srgb
            || (0..=u8::MAX).map(|byte| f64::from(byte) / 255.0).all(|x| {
                let difference = self.decode(x) - f64::from(srgb_to_linear(x as f32));
                difference.abs() <= TOLERANCE
            })
    }
}

/// xʸ, or 0 for x ≤ 0.
fn pow_or_zero(x: f64, exponent: f64) -> f64 {
    match x {
        _ if x < f64::MIN_POSITIVE => 0.0,
        _ if exponent == 1.0 => x,
        _ => pow_f64(x, exponent),
    }
}

/// Decodes a PQ signal relative to the reference white (ITU-R BT.2408, 2.2).
fn decode_pq(x: f64) -> f64 {
    const MAX_RELATIVE_LUMINANCE: f64 = 10_000.0 / 203.0;
    const M1: f64 = 2610.0 / 16384.0;
    const M2: f64 = 2523.0 / 32.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 128.0;
    const C3: f64 = 2392.0 / 128.0;
    let root = pow_or_zero(x, 1.0 / M2);
    MAX_RELATIVE_LUMINANCE * pow_or_zero((root - C1) / (C2 - C3 * root), 1.0 / M1)
}

/// Decodes an HLG signal to [0, 1].
fn decode_hlg(x: f64) -> f64 {
    const A: f64 = 0.178_832_77;
    const B: f64 = 1.0 - 4.0 * A;
    // 0.5 − A·ln(4·A)
    const C: f64 = 0.559_910_729_529_562;
    if x <= 0.5 { x * x / 3.0 } else { (pow_f64(E, (x - C) / A) + B) / 12.0 }
}

fn interpolate_table(values: &[u16], x: f64) -> f64 {
    let at = x.clamp(0.0, 1.0) * values.len().saturating_sub(1) as f64;
    let first = at as usize;
    let value = |index: usize| values.get(index).or(values.last()).map_or(0.0, |word| f64::from(*word));
    let [low, high] = [value(first), value(first + 1)];
    (low + (high - low) * (at - first as f64)) / f64::from(u16::MAX)
}

/// A color space, stored as its difference from the default: sRGB for integers, linear Rec. 709 for floats.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ColorSpace {
    curves: Option<[TransferFunction; 3]>,
    matrix: Option<DMat3>,
}

impl ColorSpace {
    /// Creates a color space from its curves (`None` for the default) and its matrix to linear Rec. 709.
    pub(super) fn from_curves_and_matrix_to_rec_709(
        curves: Option<[TransferFunction; 3]>,
        matrix: DMat3,
    ) -> Self {
        Self {
            curves: curves.filter(|curves| !curves.iter().all(TransferFunction::is_srgb)),
            matrix: (!is_identity(&matrix)).then_some(matrix),
        }
    }

    /// Creates a color space that differs from the default only in its primaries.
    pub(super) fn from_matrix_to_rec_709(matrix: DMat3) -> Self {
        Self::from_curves_and_matrix_to_rec_709(None, matrix)
    }

    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Tables that map integers from 0 to `max` to linear light, for red, green and blue.
    pub(super) fn linearization_tables(&self, max: u16) -> [Vec<f32>; 3] {
        const SRGB: [TransferFunction; 3] =
            [TransferFunction::Srgb, TransferFunction::Srgb, TransferFunction::Srgb];
        let curves = self.curves.as_ref().unwrap_or(&SRGB);
        let table = |curve: &TransferFunction| {
            let samples = (0..=max).map(|sample| f64::from(sample) / f64::from(max));
            samples.map(|x| curve.decode(x) as f32).collect()
        };
        [table(&curves[0]), table(&curves[1]), table(&curves[2])]
    }

    /// Converts linear light in this space to linear Rec. 709.
    pub(super) fn convert_linear_to_rec_709(&self, linear: [f32; 3]) -> [f32; 3] {
        let Some(matrix) = &self.matrix else { return linear };
        (*matrix * DVec3::from_array(linear.map(f64::from))).as_vec3().to_array()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_match_known_values() {
        let parametric = TransferFunction::Parametric {
            g: 2.4,
            a: 1.0 / 1.055,
            b: 0.055 / 1.055,
            c: 1.0 / 12.92,
            d: 0.04045,
            e: 0.0,
            f: 0.0,
        };
        assert!(parametric.is_srgb() && TransferFunction::Srgb.is_srgb());
        assert!(
            !TransferFunction::Power(2.2).is_srgb()
                && !TransferFunction::LINEAR.is_srgb()
                && !TransferFunction::REC_709.is_srgb()
        );
        assert!((TransferFunction::Power(2.0).decode(0.5) - 0.25).abs() < 1e-9);
        assert_eq!(
            [TransferFunction::LINEAR.decode(0.3), TransferFunction::Power(2.2).decode(0.0)],
            [0.3, 0.0]
        );
        let table = TransferFunction::Table(vec![0, 65535, 0]);
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|x| table.decode(x)), [0.0, 0.5, 1.0, 0.0]);
        assert!(
            (TransferFunction::REC_709.decode(0.5) - ((0.5_f64 + 0.099) / 1.099).powf(1.0 / 0.45)).abs()
                < 1e-9
        );
    }

    #[test]
    fn broadcast_curves_match_reference_values() {
        let is_near = |found: f64, exact: f64| (found - exact).abs() <= 1e-4 * exact;
        // ITU-R BT.2408, table 1: signals for the reference white, 1000 cd/m² and 18 % gray.
        for (signal, nits) in [(1.0, 10_000.0), (0.580_69, 203.0), (0.751_83, 1000.0), (0.0, 0.0)] {
            assert!(is_near(TransferFunction::Pq.decode(signal), nits / 203.0), "{signal}");
        }
        for (signal, light) in [(1.0, 1.0), (0.5, 1.0 / 12.0), (0.75, 0.264_963), (0.0, 0.0)] {
            assert!(is_near(TransferFunction::Hlg.decode(signal), light / 0.264_963), "{signal}");
        }
        // HLG is continuous.
        assert!(is_near(decode_hlg(0.5), decode_hlg(0.5 + 1e-9)));
    }

    #[test]
    fn the_default_space_is_recognized() {
        let srgb = || Some([TransferFunction::Srgb, TransferFunction::Srgb, TransferFunction::Srgb]);
        assert!(ColorSpace::from_curves_and_matrix_to_rec_709(srgb(), DMat3::IDENTITY).is_default());
        assert!(
            !ColorSpace::from_curves_and_matrix_to_rec_709(
                srgb(),
                DMat3::from_diagonal(DVec3::new(1.0, 0.9, 1.0))
            )
            .is_default()
        );
        assert!(
            !ColorSpace::from_curves_and_matrix_to_rec_709(
                Some([TransferFunction::Srgb, TransferFunction::LINEAR, TransferFunction::Srgb]),
                DMat3::IDENTITY
            )
            .is_default()
        );
    }
}
