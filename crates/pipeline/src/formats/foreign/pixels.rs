//! In-memory images and their encoding as PFM.

use crate::math::{DVec2, DVec3, Vec3};

/// An image of linear values, with the top row first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Pixels {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) values: Vec<Vec3>,
}

impl Pixels {
    /// Returns the value at a column and a row, which must be in range.
    pub(crate) fn get(&self, column: usize, row: usize) -> DVec3 {
        self.values[row * self.width + column].as_dvec3()
    }

    /// Interpolates between texel centers. `at` is in pixels from the top left corner. `index` maps a column
    /// or row, which may be outside the image, to one inside, or returns `None` for black.
    pub(crate) fn bilinear(&self, at: DVec2, index: impl Fn(i64, usize) -> Option<usize>) -> DVec3 {
        let corner = (at - 0.5).floor();
        let part = at - 0.5 - corner;
        let texel = |column: i64, row: i64| {
            let (column, row) = (index(column, self.width), index(row, self.height));
            column.zip(row).map_or(DVec3::ZERO, |(column, row)| self.get(column, row))
        };
        let (x, y) = (corner.x as i64, corner.y as i64);
        let top = texel(x, y).lerp(texel(x + 1, y), part.x);
        top.lerp(texel(x, y + 1).lerp(texel(x + 1, y + 1), part.x), part.y)
    }

    /// Encodes the image as PFM. `is_gray` keeps only the first component.
    pub(crate) fn encode_pfm(&self, is_gray: bool) -> Vec<u8> {
        let magic = if is_gray { "Pf" } else { "PF" };
        let mut bytes = format!("{magic}\n{} {}\n-1.0\n", self.width, self.height).into_bytes();
        bytes.reserve(self.values.len() * if is_gray { 4 } else { 12 });
        // PFM stores the bottom row first.
        for row in self.values.chunks_exact(self.width).rev() {
            for value in row {
                let channels = value.to_array();
                let channels = if is_gray { &channels[..1] } else { &channels[..] };
                channels.iter().for_each(|channel| bytes.extend(channel.to_le_bytes()));
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bottom_row_is_written_first() {
        let pixels = Pixels { width: 1, height: 2, values: vec![Vec3::ONE, Vec3::new(0.5, 0.25, 0.0)] };
        let bytes = pixels.encode_pfm(false);
        let header = b"PF\n1 2\n-1.0\n";
        assert!(bytes.starts_with(header));
        assert_eq!(&bytes[header.len()..header.len() + 4], 0.5_f32.to_le_bytes());
        assert_eq!(pixels.encode_pfm(true).len(), header.len() + 8);
    }

    #[test]
    fn values_are_exact_at_texel_centers() {
        let pixels = Pixels { width: 2, height: 1, values: vec![Vec3::ZERO, Vec3::ONE] };
        let clamp = |index: i64, count: usize| Some(index.clamp(0, count as i64 - 1) as usize);
        for (x, expected) in [(0.5, 0.0), (1.0, 0.5), (1.5, 1.0), (2.0, 1.0)] {
            assert_eq!(pixels.bilinear(DVec2::new(x, 0.5), clamp), DVec3::splat(expected));
        }
    }
}
