//! Colors of a PLY file. Their range depends on their type and largest value.

use super::super::parsed::{ColorRange, color_bytes};
use super::header::Scalar;

/// Colors in file order.
pub(super) struct PlyColors {
    /// Types of red, green and blue.
    scalars: [Scalar; 3],
    /// Colors stored as bytes.
    bytes: Vec<[u8; 3]>,
    /// Colors of types other than bytes.
    numbers: Vec<[f64; 3]>,
    range: ColorRange,
    /// Minimum alpha, its type, and a byte offset in the same vertex.
    alpha: Option<(f64, Scalar, usize)>,
}

impl PlyColors {
    pub(super) fn new(scalars: [Scalar; 3]) -> Self {
        let (bytes, numbers) = Default::default();
        Self { scalars, bytes, numbers, range: ColorRange::default(), alpha: None }
    }

    pub(super) fn push(&mut self, color: [f64; 3]) {
        if self.scalars == [Scalar::U8; 3] {
            self.bytes.push(color.map(|part| part as u8));
        } else {
            self.range.add(color);
            self.numbers.push(color);
        }
    }

    pub(super) fn add_alpha(&mut self, alpha: f64, scalar: Scalar, at: usize) {
        if self.alpha.is_none_or(|(least, ..)| alpha < least) {
            self.alpha = Some((alpha, scalar, at));
        }
    }

    /// Returns the colors as bytes. If any alpha is less than 1, also returns a byte offset in the vertex
    /// with the minimum alpha, to be used in a warning that alpha is ignored.
    pub(super) fn finish(self) -> (Vec<[u8; 3]>, Option<usize>) {
        let one = |scalar: Scalar| match scalar {
            Scalar::U8 | Scalar::I8 => scalar.full_intensity(),
            Scalar::I16 | Scalar::U16 | Scalar::I32 | Scalar::U32 => {
                let fits = |limit: &f64| self.range.max() <= *limit;
                [255.0, 65535.0].into_iter().find(fits).unwrap_or(f64::INFINITY).min(scalar.full_intensity())
            }
            Scalar::F32 | Scalar::F64 => self.range.one(),
        };
        let transparent = self.alpha.filter(|(least, scalar, _)| *least < one(*scalar)).map(|(.., at)| at);
        let ones = self.scalars.map(one);
        let in_bytes = |color: &[f64; 3]| color_bytes(std::array::from_fn(|part| color[part] / ones[part]));
        let colors = self.numbers.iter().map(in_bytes);
        (if self.numbers.is_empty() { self.bytes } else { colors.collect() }, transparent)
    }
}
