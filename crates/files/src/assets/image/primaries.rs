//! Converts colors between primaries.

use crate::math::{DMat3, DVec3};

/// Conversions that differ from the identity matrix by at most this much are skipped, because primaries in
/// files are rounded.
const TOLERANCE: f64 = 2e-3;

/// XYZ of D50, the white point of ICC profiles (ICC.1, 6.3.4.3).
const D50: DVec3 = DVec3::new(0.9642, 1.0, 0.8249);

/// Chromaticities (x, y) of the primaries and the white point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Primaries {
    pub(super) red: [f64; 2],
    pub(super) green: [f64; 2],
    pub(super) blue: [f64; 2],
    pub(super) white: [f64; 2],
}

impl Primaries {
    /// Rec. 709 and sRGB (ITU-R BT.709).
    pub(super) const REC_709: Self =
        Self { red: [0.64, 0.33], green: [0.30, 0.60], blue: [0.15, 0.06], white: [0.3127, 0.3290] };
    /// Rec. 2020 (ITU-R BT.2020).
    pub(super) const REC_2020: Self =
        Self { red: [0.708, 0.292], green: [0.170, 0.797], blue: [0.131, 0.046], ..Self::REC_709 };
    /// Display P3 (SMPTE EG 432-1).
    pub(super) const DISPLAY_P3: Self =
        Self { red: [0.680, 0.320], green: [0.265, 0.690], blue: [0.150, 0.060], ..Self::REC_709 };
    /// CIE XYZ with equal-energy white.
    pub(super) const XYZ: Self =
        Self { red: [1.0, 0.0], green: [0.0, 1.0], blue: [0.0, 0.0], white: [1.0 / 3.0, 1.0 / 3.0] };

    /// Creates primaries from numbers in the order in which files store them: red, green, blue, white.
    pub(super) fn from_numbers([rx, ry, gx, gy, bx, by, wx, wy]: [f64; 8]) -> Self {
        Self { red: [rx, ry], green: [gx, gy], blue: [bx, by], white: [wx, wy] }
    }

    /// XYZ of the white point, with Y = 1.
    fn white_xyz(&self) -> DVec3 {
        chromaticity_to_unit_sum_xyz(self.white) / self.white[1]
    }

    /// Matrix to XYZ, scaled to map (1, 1, 1) to white, or `None` for degenerate primaries.
    fn to_xyz_matrix(self) -> Option<DMat3> {
        let primaries = DMat3::from_cols(
            chromaticity_to_unit_sum_xyz(self.red),
            chromaticity_to_unit_sum_xyz(self.green),
            chromaticity_to_unit_sum_xyz(self.blue),
        );
        let scales = inverse(primaries)? * self.white_xyz();
        let matrix = primaries * DMat3::from_diagonal(scales);
        inverse(matrix).is_some().then_some(matrix)
    }

    /// Luminance weights of red, green and blue, or `None` for degenerate primaries.
    pub(super) fn luminance_weights(self) -> Option<DVec3> {
        Some(self.to_xyz_matrix()?.row(1))
    }

    /// Matrix to linear Rec. 709 with Bradford chromatic adaptation, or `None` for degenerate primaries.
    pub(super) fn to_rec_709_matrix(self) -> Option<DMat3> {
        Some(xyz_to_rec_709_matrix(self.white_xyz())? * self.to_xyz_matrix()?)
    }
}

/// Matrix to linear Rec. 709 from an ICC profile's colorants, which are in XYZ relative to D50.
pub(super) fn colorants_to_rec_709_matrix(colorants: DMat3) -> Option<DMat3> {
    Some(xyz_to_rec_709_matrix(D50)? * colorants)
}

/// Whether a matrix is the identity, up to rounding.
pub(super) fn is_identity(matrix: &DMat3) -> bool {
    (*matrix - DMat3::IDENTITY).to_cols_array().iter().all(|entry| entry.abs() <= TOLERANCE)
}

/// Matrix from XYZ with this white point to linear Rec. 709.
fn xyz_to_rec_709_matrix(white: DVec3) -> Option<DMat3> {
    let to_cones = bradford_cone_response_matrix();
    let [from, to] = [white, Primaries::REC_709.white_xyz()].map(|white| to_cones * white);
    let adapted = inverse(to_cones)? * DMat3::from_diagonal(to / from) * to_cones;
    let matrix = inverse(Primaries::REC_709.to_xyz_matrix()?)? * adapted;
    matrix.is_finite().then_some(matrix)
}

/// Bradford cone response matrix (Lam, *Metamerism and Colour Constancy*, University of Bradford, 1985).
fn bradford_cone_response_matrix() -> DMat3 {
    DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296])
}

fn chromaticity_to_unit_sum_xyz([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x, y, 1.0 - x - y)
}

/// Inverse of a matrix, or `None` if the matrix is nearly singular.
fn inverse(matrix: DMat3) -> Option<DMat3> {
    (matrix.determinant().abs() > 1e-9).then(|| matrix.inverse()).filter(|inverse| inverse.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn assert_near(found: DVec3, expected: [f64; 3], tolerance: f64) {
        assert!((found - DVec3::from_array(expected)).length() < tolerance, "{found} {expected:?}");
    }

    #[test]
    fn conversions_to_rec_709_match_references() {
        let matrix = |primaries: Primaries| primaries.to_rec_709_matrix().expect("colors");
        assert!(is_identity(&matrix(Primaries::REC_709)));
        // ITU-R BT.2087, table 4, inverted.
        let rec_2020 = matrix(Primaries::REC_2020);
        assert_near(rec_2020 * DVec3::X, [1.6605, -0.1246, -0.0182], 1e-4);
        assert_near(rec_2020 * DVec3::Z, [-0.0728, -0.0083, 1.1187], 1e-4);
        // White is preserved.
        let ap0 = Primaries {
            red: [0.7347, 0.2653],
            green: [0.0, 1.0],
            blue: [0.0001, -0.077],
            white: [0.32168, 0.33767],
        };
        for primaries in [rec_2020, matrix(Primaries::XYZ), matrix(Primaries::DISPLAY_P3), matrix(ap0)] {
            assert_near(primaries * DVec3::ONE, [1.0; 3], 1e-12);
        }
        assert_near(Primaries::REC_709.luminance_weights().expect("colors"), [0.2126, 0.7152, 0.0722], 1e-4);
    }

    #[test]
    fn degenerate_primaries_are_rejected() {
        let line = Primaries { green: [0.395, 0.195], ..Primaries::REC_709 };
        let black = Primaries { white: [0.3, 0.0], ..Primaries::REC_709 };
        let nan = Primaries { blue: [f64::NAN, 0.1], ..Primaries::REC_709 };
        for primaries in [line, black, nan, Primaries::from_numbers([0.0; 8])] {
            assert_eq!(primaries.to_rec_709_matrix(), None, "{primaries:?}");
        }
    }

    #[test]
    fn srgb_colorants_produce_the_identity() {
        let colorants = DMat3::from_cols_array(&[
            0.43607, 0.22249, 0.01392, 0.38515, 0.71687, 0.09708, 0.14307, 0.06061, 0.71410,
        ]);
        assert!(is_identity(&colorants_to_rec_709_matrix(colorants).expect("colors")));
    }
}
