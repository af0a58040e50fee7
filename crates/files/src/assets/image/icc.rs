//! ICC profiles with a matrix and curves, or with a single gray curve (ICC.1:2022). Profiles with lookup
//! tables are not supported.

use super::primaries::colorants_to_rec_709_matrix;
use super::space::{ColorSpace, TransferFunction};
use crate::math::{DMat3, DVec3};

/// Maximum length of a curve's table.
const MAX_VALUES: usize = 1 << 16;

/// Returns the color space from a profile for a gray or RGB image, or the reason for ignoring the profile.
pub(super) fn color_space_from_profile(profile: &[u8], is_gray: bool) -> Result<ColorSpace, String> {
    let profile = IccProfile::from_bytes(profile).ok_or(MALFORMED)?;
    match (profile.read_four_bytes(16), profile.read_four_bytes(20)) {
        (Some(b"RGB "), Some(b"XYZ ")) if !is_gray => profile.rgb_color_space(),
        (Some(b"GRAY"), Some(b"XYZ " | b"Lab ")) if is_gray => {
            let curve = profile.read_curve_tag(b"kTRC").ok_or(UNSUPPORTED_CURVES)?;
            Ok(ColorSpace::from_curves_and_matrix_to_rec_709(
                Some([curve.clone(), curve.clone(), curve]),
                DMat3::IDENTITY,
            ))
        }
        (Some(b"RGB "), Some(b"Lab ")) if !is_gray => Err(LOOKUP_TABLES.to_owned()),
        (Some(space), _) => {
            let space = String::from_utf8_lossy(space).trim().to_owned();
            Err(wrong_color_space_message(&space, is_gray))
        }
        (None, _) => Err(MALFORMED.to_owned()),
    }
}

pub(super) const MALFORMED: &str = "malformed profile";
pub(super) const LOOKUP_TABLES: &str = "lookup tables are not supported";
pub(super) const UNSUPPORTED_CURVES: &str = "missing or unsupported curves";
pub(super) const DEGENERATE_PRIMARIES: &str = "degenerate primaries";

/// Reason for ignoring a profile with the wrong color space.
pub(super) fn wrong_color_space_message(found: &str, is_gray: bool) -> String {
    format!("its color space is {found:?}, not {}", if is_gray { "gray" } else { "RGB" })
}

struct IccProfile<'a>(&'a [u8]);

impl<'a> IccProfile<'a> {
    fn from_bytes(bytes: &'a [u8]) -> Option<Self> {
        let profile = Self(bytes);
        (profile.read_four_bytes(36)? == b"acsp").then_some(profile)
    }

    fn read_four_bytes(&self, at: usize) -> Option<&'a [u8; 4]> {
        self.0.get(at..)?.first_chunk()
    }

    fn read_u32(&self, at: usize) -> Option<usize> {
        self.read_four_bytes(at).map(|bytes| u32::from_be_bytes(*bytes) as usize)
    }

    /// Returns a tag's data.
    fn tag(&self, name: &[u8; 4]) -> Option<&'a [u8]> {
        const TABLE: usize = 128;
        let count = self.read_u32(TABLE)?.min(self.0.len() / 12);
        let entry = (0..count)
            .map(|i| TABLE + 4 + 12 * i)
            .find(|&entry| self.read_four_bytes(entry) == Some(name))?;
        let start = self.read_u32(entry + 4)?;
        self.0.get(start..start.checked_add(self.read_u32(entry + 8)?)?)
    }

    fn rgb_color_space(&self) -> Result<ColorSpace, String> {
        let [red, green, blue] = [b"rXYZ", b"gXYZ", b"bXYZ"].map(|name| self.read_xyz_tag(name));
        let (Some(red), Some(green), Some(blue)) = (red, green, blue) else {
            return Err(LOOKUP_TABLES.to_owned());
        };
        let curves = [b"rTRC", b"gTRC", b"bTRC"].map(|name| self.read_curve_tag(name));
        let [Some(r), Some(g), Some(b)] = curves else {
            return Err(UNSUPPORTED_CURVES.to_owned());
        };
        let colorants = DMat3::from_cols(red, green, blue);
        if colorants.determinant().abs() < 1e-6 {
            return Err(DEGENERATE_PRIMARIES.to_owned());
        }
        let matrix = colorants_to_rec_709_matrix(colorants).ok_or(DEGENERATE_PRIMARIES)?;
        Ok(ColorSpace::from_curves_and_matrix_to_rec_709(Some([r, g, b]), matrix))
    }

    fn read_xyz_tag(&self, name: &[u8; 4]) -> Option<DVec3> {
        let data = Self(self.tag(name)?);
        (data.read_four_bytes(0)? == b"XYZ ").then_some(())?;
        let [x, y, z] = [8, 12, 16].map(|at| data.read_s15_fixed_16(at));
        Some(DVec3::new(x?, y?, z?))
    }

    /// Reads an s15Fixed16 number.
    fn read_s15_fixed_16(&self, at: usize) -> Option<f64> {
        self.read_four_bytes(at).map(|bytes| f64::from(i32::from_be_bytes(*bytes)) / 65536.0)
    }

    fn read_curve_tag(&self, name: &[u8; 4]) -> Option<TransferFunction> {
        let data = Self(self.tag(name)?);
        match data.read_four_bytes(0)? {
            b"curv" => data.parse_sampled_curve(),
            b"para" => data.parse_parametric_curve(),
            _ => None,
        }
    }

    fn parse_sampled_curve(&self) -> Option<TransferFunction> {
        const START: usize = 12;
        let count = self.read_u32(8)?;
        let values = self.0.get(START..START + 2 * count.min(MAX_VALUES))?;
        let values: Vec<u16> = values.as_chunks().0.iter().map(|word| u16::from_be_bytes(*word)).collect();
        match *values.as_slice() {
            [] => Some(TransferFunction::LINEAR),
            [gamma] => Some(TransferFunction::Power(f64::from(gamma) / 256.0)),
            _ => Some(TransferFunction::Table(values)),
        }
    }

    fn parse_parametric_curve(&self) -> Option<TransferFunction> {
        let kind = u16::from_be_bytes(*self.0.get(8..)?.first_chunk()?);
        let number = |index: usize| self.read_s15_fixed_16(12 + 4 * index);
        let g = number(0)?;
        let (mut a, mut b, mut c, mut d, mut e, mut f) = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        if kind >= 1 {
            (a, b) = (number(1)?, number(2)?);
            d = -b / a;
        }
        match kind {
            0 | 1 => {}
            2 => {
                e = number(3)?;
                f = e;
            }
            3 => (c, d) = (number(3)?, number(4)?),
            4 => (c, d, e, f) = (number(3)?, number(4)?, number(5)?, number(6)?),
            _ => return None,
        }
        [g, a, b, c, d, e, f].iter().all(|number| number.is_finite()).then_some(())?;
        Some(TransferFunction::Parametric { g, a, b, c, d, e, f })
    }
}
