//! Color: linear Rec. 709 RGB as [`Vec3`], and the sRGB transfer function.

use std::sync::LazyLock;

use glam::Vec3;

use super::elementary::pow;

/// Added to the squared reference in relMSE to keep the errors of black pixels finite. Errors are effectively
/// absolute below a radiance of 0.1 and relative above it.
pub const RELMSE_EPSILON: f64 = 0.01;

/// Contributions of the linear Rec. 709 primaries to relative luminance (IEC 61966-2-1).
pub const LUMINANCE_WEIGHTS: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// Relative luminance of a linear color.
pub fn luminance(color: Vec3) -> f32 {
    color.dot(LUMINANCE_WEIGHTS)
}

/// Decodes an sRGB component in [0, 1] to linear (IEC 61966-2-1).
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { pow((encoded + 0.055) / 1.055, 2.4) }
}

/// Encodes a linear component in [0, 1] as sRGB (IEC 61966-2-1).
pub fn linear_to_srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * pow(linear, 1.0 / 2.4) - 0.055 }
}

/// [`linear_to_srgb`] in double precision, for error metrics.
pub fn linear_to_srgb_f64(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// Encodes a linear component, clamped to [0, 1], as an sRGB byte. NaN becomes 0.
pub fn linear_to_srgb8(linear: f32) -> u8 {
    let encoded = linear_to_srgb(linear.clamp(0.0, 1.0));
    // Float-to-integer casts saturate and map NaN to 0.
    (encoded * 255.0 + 0.5) as u8
}

/// Decodes an sRGB byte triple to a linear color.
#[inline]
pub fn srgb8_color_to_linear([red, green, blue]: [u8; 3]) -> Vec3 {
    let table = &*SRGB8_TO_LINEAR;
    Vec3::new(table[usize::from(red)], table[usize::from(green)], table[usize::from(blue)])
}

/// Lookup table for [`srgb_to_linear`], indexed by sRGB byte.
pub static SRGB8_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_to_linear(byte as f32 / 255.0)));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_round_trip_exactly() {
        for byte in 0..=255_u8 {
            let linear = srgb_to_linear(f32::from(byte) / 255.0);
            assert_eq!(linear_to_srgb8(linear), byte);
            assert_eq!(srgb8_color_to_linear([byte, 0, 255]), Vec3::new(linear, 0.0, 1.0));
        }
    }

    #[test]
    fn srgb_curve_matches_reference_values() {
        assert!((srgb_to_linear(0.5) - 0.214_041_14).abs() < 1e-6);
        assert!((linear_to_srgb(0.18) - 0.461_356).abs() < 1e-5);
        assert!((linear_to_srgb_f64(0.18) - 0.461_356_129_500_442).abs() < 1e-12);
        assert_eq!(linear_to_srgb8(f32::NAN), 0);
        assert_eq!(linear_to_srgb8(f32::INFINITY), 255);
        assert_eq!(linear_to_srgb8(-1.0), 0);
    }
}
