//! Colors in a PLY file. Their range depends on their type and on the largest value.

use super::super::parsed::{ALPHA_IGNORED, ColorComponentExtremes, ColorRangeDetector, unit_color_to_bytes};
use super::header::ScalarType;

/// Colors in file order.
pub(super) struct PlyColorCollector {
    /// Types of red, green and blue.
    scalars: [ScalarType; 3],
    /// Colors stored as bytes.
    bytes: Vec<[u8; 3]>,
    /// Colors stored as types other than bytes.
    numbers: Vec<[f64; 3]>,
    range: ColorRangeDetector,
    /// Extremes of red, green and blue.
    extremes: [ColorComponentExtremes; 3],
    /// Minimum alpha, its type, and a byte offset in its item.
    alpha: Option<(f64, ScalarType, usize)>,
}

impl PlyColorCollector {
    pub(super) fn new(scalars: [ScalarType; 3]) -> Self {
        let (bytes, numbers) = Default::default();
        let (range, extremes) = Default::default();
        Self { scalars, bytes, numbers, range, extremes, alpha: None }
    }

    /// Adds a color. `at` is a byte offset in its item.
    pub(super) fn push(&mut self, color: [f64; 3], at: usize) {
        self.extremes.iter_mut().zip(color).for_each(|(extremes, part)| extremes.add_component(part, at));
        if !self.are_bytes() {
            self.range.add_color(color, at);
        }
        self.push_untracked(color);
    }

    /// Adds white for an item without a color.
    pub(super) fn push_missing_as_white(&mut self) {
        self.push_untracked([f64::INFINITY; 3]);
    }

    fn are_bytes(&self) -> bool {
        self.scalars == [ScalarType::U8; 3]
    }

    fn push_untracked(&mut self, color: [f64; 3]) {
        if self.are_bytes() {
            self.bytes.push(color.map(|part| part as u8));
        } else {
            self.numbers.push(color);
        }
    }

    pub(super) fn track_lowest_alpha(&mut self, alpha: f64, scalar: ScalarType, at: usize) {
        if self.alpha.is_none_or(|(least, ..)| alpha < least) {
            self.alpha = Some((alpha, scalar, at));
        }
    }

    /// Returns the colors as bytes, and warnings about ignored alpha and out-of-range values. Each warning
    /// has a byte offset in an affected item.
    pub(super) fn into_bytes_and_warnings(self) -> (Vec<[u8; 3]>, Vec<(usize, String)>) {
        let max = self.extremes.iter().map(ColorComponentExtremes::max).fold(0.0, f64::max);
        let one = |scalar: ScalarType| match scalar {
            ScalarType::U8 | ScalarType::I8 => scalar.full_intensity(),
            ScalarType::I16 | ScalarType::U16 | ScalarType::I32 | ScalarType::U32 => {
                let fits = |limit: &f64| max <= *limit;
                [255.0, 65535.0].into_iter().find(fits).unwrap_or(f64::INFINITY).min(scalar.full_intensity())
            }
            ScalarType::F32 | ScalarType::F64 => self.range.full_intensity(),
        };
        let transparent = self.alpha.filter(|(least, scalar, _)| *least < one(*scalar));
        let outside = self.scalars.iter().zip(&self.extremes).find_map(|(scalar, extremes)| {
            let fraction = extremes.fraction_in_integer_color_warning().filter(|_| scalar.is_integer());
            extremes.out_of_range_color_warning(one(*scalar)).or(fraction)
        });
        let mut warnings: Vec<_> = outside.into_iter().collect();
        warnings.extend(transparent.map(|(.., at)| (at, ALPHA_IGNORED.to_owned())));
        let ones = self.scalars.map(one);
        let in_bytes =
            |color: &[f64; 3]| unit_color_to_bytes(std::array::from_fn(|part| color[part] / ones[part]));
        let colors = self.numbers.iter().map(in_bytes);
        (if self.numbers.is_empty() { self.bytes } else { colors.collect() }, warnings)
    }
}
