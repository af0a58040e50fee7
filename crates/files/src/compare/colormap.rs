//! Color map for errors: black, purple, red, orange, pale yellow, with uniform lightness steps.

use std::f64::consts::TAU;

use crate::math::Vec3;

/// Returns the linear Rec. 709 color for a value in [0, 1]. CIE lightness is proportional to the value, the
/// Oklab hue (B. Ottosson, 2020) makes half a turn, and chroma peaks in the middle.
pub(super) fn error_color(value: f64) -> Vec3 {
    const MAX_LIGHTNESS: f64 = 95.0;
    const CHROMA: f64 = 0.19;
    const MIN_CHROMA: f64 = 0.07;
    let value = value.clamp(0.0, 1.0);
    let turn = 0.79 + 0.5 * value;
    let chroma = CHROMA * 4.0 * value * (1.0 - value) + MIN_CHROMA * value * value;
    let (a, b) = (chroma * libm::cos(TAU * turn), chroma * libm::sin(TAU * turn));
    linear_rgb_from_oklab(libm::cbrt(luminance_from_cie_lightness(MAX_LIGHTNESS * value)), a, b)
}

/// Converts a CIE lightness in [0, 100] to relative luminance.
fn luminance_from_cie_lightness(lightness: f64) -> f64 {
    const KAPPA: f64 = 24_389.0 / 27.0;
    let root = (lightness + 16.0) / 116.0;
    if lightness > 8.0 { root * root * root } else { lightness / KAPPA }
}

fn linear_rgb_from_oklab(lightness: f64, a: f64, b: f64) -> Vec3 {
    let cube = |x: f64| x * x * x;
    let long = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let middle = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let short = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    let red = 4.076_741_662_1 * long - 3.307_711_591_3 * middle + 0.230_969_929_2 * short;
    let green = -1.268_438_004_6 * long + 2.609_757_401_1 * middle - 0.341_319_396_5 * short;
    let blue = -0.004_196_086_3 * long - 0.703_418_614_7 * middle + 1.707_614_701_0 * short;
    Vec3::new(red as f32, green as f32, blue as f32).clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::color::luminance;

    #[test]
    fn lightness_increases_with_the_error() {
        assert_eq!(error_color(0.0), Vec3::ZERO);
        assert_eq!(error_color(-1.0), error_color(0.0));
        assert_eq!(error_color(2.0), error_color(1.0));
        assert!(luminance(error_color(1.0)) > 0.85, "{}", error_color(1.0));
        for step in 0..256 {
            let [darker, lighter] =
                [step, step + 1].map(|step| luminance(error_color(f64::from(step) / 256.0)));
            assert!(lighter > darker, "{step}: {darker} {lighter}");
        }
    }

    #[test]
    fn hues_match_the_documentation() {
        let is_largest = |value: f64, channel: usize| {
            let color = error_color(value).to_array();
            color.iter().all(|other| *other <= color[channel])
        };
        assert!(is_largest(0.15, 2), "purple: {}", error_color(0.15));
        assert!(is_largest(0.5, 0), "red: {}", error_color(0.5));
        let yellow = error_color(1.0);
        assert!(yellow.x > yellow.z && yellow.y > yellow.z, "{yellow}");
    }
}
