//! Tone curves, which map linear radiance to linear display light in [0, 1].
//!
//! Every curve maps components in [0, 1e10] to [0, 1], preserves black and is monotonic for gray.

use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::elementary::{log2, pow};

/// x/(1 + x) on luminance: E. Reinhard et al., "Photographic Tone Reproduction for Digital Images" (2002),
/// eq. 3. Preserves hue until a component is clamped.
pub(super) fn reinhard(color: Vec3) -> Vec3 {
    clamp(color / (1.0 + luminance(color)))
}

/// K. Narkowicz, "ACES Filmic Tone Mapping Curve" (2015): a rational fit to the ACES reference and output
/// transforms, per component, without the optional exposure factor of 0.6.
pub(super) fn aces(color: Vec3) -> Vec3 {
    let numerator = color * (2.51 * color + 0.03);
    let denominator = color * (2.43 * color + 0.59) + 0.14;
    clamp(numerator / denominator)
}

/// T. Sobotka's AgX (2022) with its default look: an inset matrix, a sigmoid over 16.5 stops around middle
/// gray, and an outset matrix. The matrices are B. Wrensch's for Rec. 709 ("Minimal AgX Implementation",
/// 2023). This implementation evaluates the exact sigmoid instead of his polynomial fit. The result is
/// linearized with a display gamma of 2.2.
pub(super) fn agx(color: Vec3) -> Vec3 {
    let inset = apply_gray_preserving_matrix(&AGX_INSET, color);
    let encoded = Vec3::from_array(inset.to_array().map(agx_tone_curve));
    let outset = clamp(apply_gray_preserving_matrix(&AGX_OUTSET, encoded));
    Vec3::from_array(outset.to_array().map(|x| pow(x, 2.2)))
}

/// Columns of AgX's inset matrix.
const AGX_INSET: [Vec3; 3] = [
    Vec3::new(0.842_479_05, 0.042_328_242, 0.042_375_654),
    Vec3::new(0.078_433_6, 0.878_468_6, 0.078_433_6),
    Vec3::new(0.079_223_745, 0.079_166_13, 0.879_142_94),
];
const AGX_OUTSET: [Vec3; 3] = [
    Vec3::new(1.196_879, -0.052_896_757, -0.052_971_635),
    Vec3::new(-0.098_020_88, 1.151_903_2, -0.098_043_45),
    Vec3::new(-0.099_029_74, -0.098_961_18, 1.151_073_7),
];
/// Log2 range mapped to [0, 1]: from 10 stops below middle gray (0.18) to 6.5 above.
const AGX_STOPS: [f32; 2] = [-12.473_931, 4.026_069];

fn agx_tone_curve(x: f32) -> f32 {
    let [low, high] = AGX_STOPS;
    agx_sigmoid((log2(x.max(f32::MIN_POSITIVE)).clamp(low, high) - low) / (high - low))
}

/// Sigmoid with slope 2 at (10/16.5, ½), and toe and shoulder powers of 3 and 3.25. Maps 0 to 0 and 1 to 1.
fn agx_sigmoid(x: f32) -> f32 {
    const SLOPE: f32 = 2.0;
    const PIVOT: f32 = 10.0 / 16.5;
    let (sign, run, power) = if x < PIVOT { (-1.0, PIVOT, 3.0) } else { (1.0, 1.0 - PIVOT, 3.25) };
    let rise: f32 = SLOPE * run;
    // The hyperbola s·t/(1 + tᵖ)^(1/p) with t = slope·distance/s, where s is chosen so that the curve ends
    // half a unit from the pivot.
    let scale = rise / pow(pow(rise / 0.5, power) - 1.0, 1.0 / power);
    let term = SLOPE * (x - PIVOT).abs() / scale;
    0.5 + sign * scale * term / pow(1.0 + pow(term, power), 1.0 / power)
}

/// Applies a matrix with its rows normalized to a sum of 1, so that gray stays gray (the published digits are
/// off by 1e-4).
fn apply_gray_preserving_matrix(columns: &[Vec3; 3], v: Vec3) -> Vec3 {
    let [a, b, c] = *columns;
    (a * v.x + b * v.y + c * v.z) / (a + b + c)
}

fn clamp(color: Vec3) -> Vec3 {
    color.clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agx_sigmoid_matches_the_published_fit() {
        // B. Wrensch's fit of the same curve, with a mean squared error of 3.7e-6.
        let polynomial = |x: f32| {
            [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232].iter().fold(0.0, |sum, c| sum * x + c)
        };
        for step in 0..=100 {
            let x = step as f32 / 100.0;
            assert!((agx_sigmoid(x) - polynomial(x)).abs() < 8e-3, "{x}: {}", agx_sigmoid(x));
        }
        assert!(agx_sigmoid(0.0).abs() < 1e-6);
        assert!((agx_sigmoid(1.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn agx_matrices_are_inverses() {
        for color in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE] {
            let back =
                apply_gray_preserving_matrix(&AGX_OUTSET, apply_gray_preserving_matrix(&AGX_INSET, color));
            assert!((back - color).abs().max_element() < 1e-3, "{color}: {back}");
        }
    }
}
