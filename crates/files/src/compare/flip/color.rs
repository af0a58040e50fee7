//! The colour spaces of FLIP, with the white of the display as the reference white.

use std::sync::LazyLock;

use crate::math::{DMat3, DVec3};

/// Linear Rec. 709 to XYZ: columns for red, green and blue.
const XYZ_OF_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(10_135_552.0 / 24_577_794.0, 2_613_072.0 / 12_288_897.0, 1_425_312.0 / 73_733_382.0),
    DVec3::new(8_788_810.0 / 24_577_794.0, 8_788_810.0 / 12_288_897.0, 8_788_810.0 / 73_733_382.0),
    DVec3::new(4_435_075.0 / 24_577_794.0, 887_015.0 / 12_288_897.0, 70_074_185.0 / 73_733_382.0),
);

static RGB_OF_XYZ: LazyLock<DMat3> = LazyLock::new(|| XYZ_OF_RGB.inverse());

/// XYZ of white.
const WHITE: DVec3 = DVec3::new(
    (10_135_552.0 + 8_788_810.0 + 4_435_075.0) / 24_577_794.0,
    1.0,
    (1_425_312.0 + 8_788_810.0 + 70_074_185.0) / 73_733_382.0,
);

/// YCxCz, a linear form of CIELAB in which the eye's blur is modelled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opponent {
    /// Lightness, −16 to 100.
    pub(super) y: f64,
    /// From green to red.
    pub(super) cx: f64,
    /// From blue to yellow.
    pub(super) cz: f64,
}

impl Opponent {
    /// Converts a linear colour.
    pub(super) fn of(rgb: DVec3) -> Self {
        let xyz = XYZ_OF_RGB * rgb / WHITE;
        Self { y: 116.0 * xyz.y - 16.0, cx: 500.0 * (xyz.x - xyz.y), cz: 200.0 * (xyz.y - xyz.z) }
    }

    /// The perceived form of the nearest colour that a display can show.
    pub(super) fn perceived(self) -> Perceived {
        let y = (self.y + 16.0) / 116.0;
        let xyz = DVec3::new(y + self.cx / 500.0, y, y - self.cz / 200.0) * WHITE;
        Perceived::of((*RGB_OF_XYZ * xyz).clamp(DVec3::ZERO, DVec3::ONE))
    }
}

/// CIELAB with the Hunt effect: chroma grows with lightness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Perceived {
    lightness: f64,
    a: f64,
    b: f64,
}

impl Perceived {
    /// Converts a linear colour.
    pub(super) fn of(rgb: DVec3) -> Self {
        let [x, y, z] = (XYZ_OF_RGB * rgb / WHITE).to_array().map(lightness);
        let hunt = 0.01 * (116.0 * y - 16.0);
        Self { lightness: 116.0 * y - 16.0, a: hunt * 500.0 * (x - y), b: hunt * 200.0 * (y - z) }
    }

    /// HyAB: lightness by difference, chroma by Euclidean distance.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        let (a, b) = (self.a - other.a, self.b - other.b);
        (self.lightness - other.lightness).abs() + (a * a + b * b).sqrt()
    }
}

/// CIE 1976: a cube root with a straight line near 0.
fn lightness(t: f64) -> f64 {
    const DELTA: f64 = 6.0 / 29.0;
    if t > DELTA * DELTA * DELTA { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

/// Distance of the two colours of a display that are furthest apart: green and blue.
pub(super) fn largest_distance() -> f64 {
    Perceived::of(DVec3::Y).distance(&Perceived::of(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn white_and_black_are_where_they_should_be() {
        let white = Opponent::of(DVec3::ONE);
        assert!((white.y - 100.0).abs() < 1e-12 && white.cx.abs() < 1e-12 && white.cz.abs() < 1e-12);
        let distance = Perceived::of(DVec3::ONE).distance(&Perceived::of(DVec3::ZERO));
        assert!((distance - 100.0).abs() < 1e-9, "{distance}");
    }

    #[test]
    fn colours_of_the_display_survive_the_way_there_and_back() {
        for rgb in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.2, 0.5, 0.9), DVec3::splat(1e-4)] {
            let distance = Opponent::of(rgb).perceived().distance(&Perceived::of(rgb));
            assert!(distance < 1e-9, "{rgb}: {distance}");
        }
    }
}
