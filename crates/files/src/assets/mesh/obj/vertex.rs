//! Vertices in an OBJ file, including color extensions from several programs.

use super::super::parsed::ColorRangeDetector;
use super::super::text::expected_message;
use super::words::{ObjTextCursor, parse_number, too_few_numbers_message};
use crate::math::DVec3;

/// Positions and colors.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<DVec3>,
    /// Optional color of each position. May be shorter than `positions`.
    colors: Vec<Option<[f32; 3]>>,
    range: ColorRangeDetector,
    /// Colors from ZBrush's `#MRGB` comments, in the order of the positions.
    painted: Vec<[u8; 3]>,
    /// Minimum alpha and the byte offset of its statement.
    min_alpha: Option<(f64, usize)>,
    /// Byte offset of the first statement with extra words.
    pub(super) first_excess: Option<usize>,
}

pub(super) const WEIGHT_OR_COLOR: &str =
    "expected one weight or three color components after the coordinates";
pub(super) const ZERO_WEIGHT: &str = "a vertex has weight 0";
pub(super) const NONFINITE_COLOR: &str = "vertex colors must be finite";

impl Vertices {
    /// Parses a `v` statement: x y z, followed by nothing, a weight, a color, a color with alpha, or a weight
    /// and a color with alpha.
    pub(super) fn parse_vertex(&mut self, words: &mut ObjTextCursor<'_>) -> Result<(), String> {
        let start = words.offset();
        let mut numbers = [0.0; 8];
        let mut count = 0;
        while let Some(word) = words.next_word() {
            match parse_number(word) {
                Some(value) if count < numbers.len() => numbers[count] = value,
                Some(_) => {}
                None if count >= 3 => {
                    self.first_excess.get_or_insert(start);
                    break;
                }
                None => return Err(expected_message("3 coordinates", word)),
            }
            count += 1;
        }
        let [x, y, z, rest @ ..] = numbers;
        let (weight, color, alpha) = match (count, rest) {
            (0..3, _) => return Err(too_few_numbers_message(3, "coordinates", count)),
            (3, _) => (1.0, None, None),
            (4, [weight, ..]) => (weight, None, None),
            (5, _) => return Err(WEIGHT_OR_COLOR.to_owned()),
            (6, [r, g, b, ..]) => (1.0, Some([r, g, b]), None),
            (7, [r, g, b, alpha, _]) => (1.0, Some([r, g, b]), Some(alpha)),
            (8, [weight, r, g, b, alpha]) => (weight, Some([r, g, b]), Some(alpha)),
            (_, [r, g, b, ..]) => {
                self.first_excess.get_or_insert(start);
                (1.0, Some([r, g, b]), None)
            }
        };
        if weight == 0.0 {
            return Err(ZERO_WEIGHT.to_owned());
        }
        if let Some(color) = color {
            self.add_color_of_next_position(color, start)?;
        }
        if let Some(alpha) = alpha
            && self.min_alpha.is_none_or(|(least, _)| alpha < least)
        {
            self.min_alpha = Some((alpha, start));
        }
        self.positions.push(DVec3::new(x, y, z) / weight);
        Ok(())
    }

    /// Adds a color for the next position.
    fn add_color_of_next_position(&mut self, color: [f64; 3], start: usize) -> Result<(), String> {
        if !color.iter().all(|part| part.is_finite()) {
            return Err(NONFINITE_COLOR.to_owned());
        }
        self.range.add_color(color, start);
        self.colors.resize(self.positions.len(), None);
        self.colors.push(Some(color.map(|part| part as f32)));
        Ok(())
    }

    /// Parses an `#MRGB` comment: for each vertex, two hexadecimal digits each for mask, red, green and blue.
    pub(super) fn read_mrgb_colors(&mut self, line: &[u8]) {
        let digits = line.trim_ascii().chunks_exact(8);
        let painted = digits.map_while(|digits| {
            let value = u32::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok()?;
            let [_, red, green, blue] = value.to_be_bytes();
            Some([red, green, blue])
        });
        self.painted.extend(painted);
    }

    /// Whether the file has any colors.
    pub(super) fn has_colors(&self) -> bool {
        !self.colors.is_empty() || !self.painted.is_empty()
    }

    /// Byte offset of the vertex with the minimum alpha, or `None` if every alpha is at its maximum. Alpha
    /// has the same range as the colors.
    pub(super) fn most_transparent_vertex_offset(&self) -> Option<usize> {
        self.min_alpha.filter(|(least, _)| *least < self.range.full_intensity()).map(|(_, start)| start)
    }

    /// Returns the byte offset of a vertex with an out-of-range color, and a warning about it.
    pub(super) fn out_of_range_color_warning(&self) -> Option<(usize, String)> {
        self.range.out_of_range_warning()
    }

    /// Color of a position, or white if the file does not specify it.
    pub(super) fn color_of(&self, index: usize) -> [u8; 3] {
        if self.colors.is_empty() {
            return self.painted.get(index).copied().unwrap_or([u8::MAX; 3]);
        }
        let color = self.colors.get(index).copied().flatten();
        color.map_or([u8::MAX; 3], |color| self.range.color_to_bytes(color.map(f64::from)))
    }
}
