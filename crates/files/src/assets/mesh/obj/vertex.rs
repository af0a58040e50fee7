//! Vertices of an OBJ, with the colors that programs add to them.

use super::super::parsed::ColorRange;
use super::super::text::shown;
use super::words::{Words, number};
use crate::math::DVec3;

/// Positions and their colors.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<DVec3>,
    /// Color of each position, `None` where the file has none; shorter than the positions if the last ones have none.
    colors: Vec<Option<[f32; 3]>>,
    range: ColorRange,
    /// Colors in ZBrush's comments `#MRGB`, in the order of the positions.
    painted: Vec<[u8; 3]>,
    /// The least alpha, and the offset of its statement.
    least_alpha: Option<(f64, usize)>,
    /// Offset of the first statement with words that are not used.
    pub(super) first_excess: Option<usize>,
}

impl Vertices {
    /// Reads a `v` statement: x y z, then a weight, a color, a color and its alpha, or a weight, a color and its alpha.
    pub(super) fn read(&mut self, words: &mut Words<'_>) -> Result<(), String> {
        let start = words.at();
        let mut numbers = [0.0; 8];
        let mut count = 0;
        while let Some(word) = words.word() {
            match number(word) {
                Some(value) if count < numbers.len() => numbers[count] = value,
                Some(_) => {}
                None if count >= 3 => {
                    self.first_excess.get_or_insert(start);
                    break;
                }
                None => return Err(format!("expected 3 coordinates, found {}", shown(word))),
            }
            count += 1;
        }
        let [x, y, z, rest @ ..] = numbers;
        let (weight, color, alpha) = match (count, rest) {
            (0..3, _) => return Err(format!("expected 3 coordinates, found {count}")),
            (3, _) => (1.0, None, None),
            (4, [weight, ..]) => (weight, None, None),
            (5, _) => return Err("coordinates are followed by one weight or three colors".to_owned()),
            (6, [r, g, b, ..]) => (1.0, Some([r, g, b]), None),
            (7, [r, g, b, alpha, _]) => (1.0, Some([r, g, b]), Some(alpha)),
            (8, [weight, r, g, b, alpha]) => (weight, Some([r, g, b]), Some(alpha)),
            (_, [r, g, b, ..]) => {
                self.first_excess.get_or_insert(start);
                (1.0, Some([r, g, b]), None)
            }
        };
        if weight == 0.0 {
            return Err("the weight of a vertex is 0".to_owned());
        }
        if let Some(color) = color {
            self.color(color)?;
        }
        if let Some(alpha) = alpha
            && self.least_alpha.is_none_or(|(least, _)| alpha < least)
        {
            self.least_alpha = Some((alpha, start));
        }
        self.positions.push(DVec3::new(x, y, z) / weight);
        Ok(())
    }

    /// Adds the color of the position that follows.
    fn color(&mut self, color: [f64; 3]) -> Result<(), String> {
        if !color.iter().all(|part| part.is_finite()) {
            return Err("the colors of a vertex are finite numbers".to_owned());
        }
        self.range.add(color);
        self.colors.resize(self.positions.len(), None);
        self.colors.push(Some(color.map(|part| part as f32)));
        Ok(())
    }

    /// Reads the words of a comment `#MRGB`: a mask, red, green and blue in two hexadecimal digits each, per vertex.
    pub(super) fn read_paint(&mut self, line: &[u8]) {
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

    /// Offset of the vertex with the least alpha, if that is below 1. Alpha has the range of the colors.
    pub(super) fn translucent(&self) -> Option<usize> {
        self.least_alpha.filter(|(least, _)| *least < self.range.one()).map(|(_, start)| start)
    }

    /// The color of a position; white if it has none.
    pub(super) fn color_of(&self, index: usize) -> [u8; 3] {
        if self.colors.is_empty() {
            return self.painted.get(index).copied().unwrap_or([u8::MAX; 3]);
        }
        let color = self.colors.get(index).copied().flatten();
        color.map_or([u8::MAX; 3], |color| self.range.bytes(color.map(f64::from)))
    }
}
