//! The Oklab color space, where distances approximate perceived differences (Björn Ottosson, "A perceptual
//! color space for image processing", 2020).

use crate::math::Vec3;

/// Matrix from linear Rec. 709 RGB to cone responses.
const CONES: [Vec3; 3] = [
    Vec3::new(0.412_221_46, 0.536_332_55, 0.051_445_995),
    Vec3::new(0.211_903_5, 0.680_699_5, 0.107_396_96),
    Vec3::new(0.088_302_46, 0.281_718_85, 0.629_978_7),
];
/// Matrix from the cube roots of the cone responses to Oklab's lightness, green–red and blue–yellow
/// coordinates.
const LAB: [Vec3; 3] = [
    Vec3::new(0.210_454_26, 0.793_617_8, -0.004_072_047),
    Vec3::new(1.977_998_5, -2.428_592_2, 0.450_593_7),
    Vec3::new(0.025_904_037, 0.782_771_77, -0.808_675_77),
];

fn multiply_matrix(rows: [Vec3; 3], v: Vec3) -> Vec3 {
    Vec3::from_array(rows.map(|row| row.dot(v)))
}

/// Converts a linear color to Oklab.
pub(crate) fn linear_to_oklab(linear: Vec3) -> Vec3 {
    let cones = multiply_matrix(CONES, linear.max(Vec3::ZERO));
    multiply_matrix(LAB, Vec3::from_array(cones.to_array().map(f32::cbrt)))
}

/// Derivative of Oklab with respect to linear light, artificially bounded near black, where it would diverge.
#[derive(Clone, Copy, Debug)]
pub(super) struct OklabDerivative(Vec3);

impl OklabDerivative {
    /// Computes the derivative at a linear color.
    pub(super) fn at(linear: Vec3) -> Self {
        const DARK: f32 = 0.01;
        let cones = multiply_matrix(CONES, linear.max(Vec3::ZERO));
        Self(Vec3::from_array(cones.to_array().map(|cone| {
            let root = (cone + DARK).cbrt();
            1.0 / (3.0 * root * root)
        })))
    }

    /// Returns the change in Oklab caused by a small change in linear light.
    pub(super) fn apply(self, linear: Vec3) -> Vec3 {
        multiply_matrix(LAB, self.0 * multiply_matrix(CONES, linear))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_has_lightness_one_and_no_hue() {
        assert!(linear_to_oklab(Vec3::ONE).distance(Vec3::new(1.0, 0.0, 0.0)) < 1e-3);
        // Lightness of red, from Ottosson's article.
        assert!((linear_to_oklab(Vec3::X).x - 0.628).abs() < 1e-3);
    }

    #[test]
    fn derivative_matches_finite_differences() {
        let color = Vec3::new(0.4, 0.2, 0.6);
        let step = Vec3::new(1e-3, -2e-3, 1e-3);
        let change = linear_to_oklab(color + step) - linear_to_oklab(color);
        assert!(OklabDerivative::at(color).apply(step).distance(change) < 0.1 * change.length());
    }
}
