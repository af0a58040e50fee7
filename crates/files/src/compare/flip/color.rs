//! FLIP's color spaces. The reference white is the display's white.

use std::sync::LazyLock;

use crate::math::{DMat3, DVec3};

/// Matrix from linear Rec. 709 to XYZ. Its columns are red, green and blue.
const XYZ_OF_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

static RGB_OF_XYZ: LazyLock<DMat3> = LazyLock::new(|| XYZ_OF_RGB.inverse());

/// XYZ of the reference white.
const WHITE: DVec3 = DVec3::new(
    (10_135_552.0 + 8_788_810.0 + 4_435_075.0) / 24_577_794.0,
    1.0,
    (1_425_312.0 + 8_788_810.0 + 70_074_185.0) / 73_733_382.0,
);

/// YCxCz, a linear variant of CIELAB. Used for simulating the eye's blur.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpponentColor {
    /// Lightness, −16 to 100.
    pub(super) y: f64,
    /// Green to red.
    pub(super) cx: f64,
    /// Blue to yellow.
    pub(super) cz: f64,
}

impl OpponentColor {
    /// Converts from a linear color.
    pub(super) fn from_linear(rgb: DVec3) -> Self {
        let xyz = XYZ_OF_RGB * rgb / WHITE;
        Self { y: 116.0 * xyz.y - 16.0, cx: 500.0 * (xyz.x - xyz.y), cz: 200.0 * (xyz.y - xyz.z) }
    }

    /// Clamps to the display's gamut and converts to [`PerceivedColor`].
    pub(super) fn to_perceived_color(self) -> PerceivedColor {
        let y = (self.y + 16.0) / 116.0;
        let xyz = DVec3::new(y + self.cx / 500.0, y, y - self.cz / 200.0) * WHITE;
        PerceivedColor::from_linear((*RGB_OF_XYZ * xyz).clamp(DVec3::ZERO, DVec3::ONE))
    }
}

/// CIELAB with the Hunt effect: chroma increases with lightness.
#[derive(Clone, Copy, Debug)]
pub(super) struct PerceivedColor {
    lightness: f64,
    a: f64,
    b: f64,
}

impl PerceivedColor {
    /// Converts from a linear color.
    pub(super) fn from_linear(rgb: DVec3) -> Self {
        let [x, y, z] = (XYZ_OF_RGB * rgb / WHITE).to_array().map(cielab_nonlinearity);
        let hunt = 0.01 * (116.0 * y - 16.0);
        Self { lightness: 116.0 * y - 16.0, a: hunt * 500.0 * (x - y), b: hunt * 200.0 * (y - z) }
    }

    /// HyAB distance: absolute lightness difference plus Euclidean chroma distance.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let (a, b) = (self.a - other.a, self.b - other.b);
        (self.lightness - other.lightness).abs() + (a * a + b * b).sqrt()
    }
}

/// CIE 1976 lightness: a cube root with a linear part near 0.
fn cielab_nonlinearity(t: f64) -> f64 {
    const DELTA: f64 = 6.0 / 29.0;
    if t > DELTA * DELTA * DELTA { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

/// Distance between green and blue, the two display colors that are farthest apart.
pub(super) fn max_display_hyab_distance() -> f64 {
    PerceivedColor::from_linear(DVec3::Y).distance(&PerceivedColor::from_linear(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_and_black_have_known_coordinates() {
        let white = OpponentColor::from_linear(DVec3::ONE);
        assert!((white.y - 100.0).abs() < 1e-12 && white.cx.abs() < 1e-12 && white.cz.abs() < 1e-12);
        let distance =
            PerceivedColor::from_linear(DVec3::ONE).distance(&PerceivedColor::from_linear(DVec3::ZERO));
        assert!((distance - 100.0).abs() < 1e-9, "{distance}");
    }

    #[test]
    fn display_colors_round_trip() {
        for rgb in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.2, 0.5, 0.9), DVec3::splat(1e-4)] {
            let distance = OpponentColor::from_linear(rgb)
                .to_perceived_color()
                .distance(&PerceivedColor::from_linear(rgb));
            assert!(distance < 1e-9, "{rgb}: {distance}");
        }
    }
}
