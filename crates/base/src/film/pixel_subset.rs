//! Divides cells into statistically similar halves, so that noise measured in one half also applies to the
//! other.

use super::Rect;

/// A subset of a rectangle's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SelectedPixels {
    /// The enclosing rectangle.
    pub rect: Rect,
    /// The selected half, or all pixels.
    pub part: PixelSubset,
}

impl From<Rect> for SelectedPixels {
    fn from(rect: Rect) -> Self {
        Self { rect, part: PixelSubset::All }
    }
}

impl SelectedPixels {
    /// Number of selected pixels.
    pub fn count(&self) -> usize {
        self.part.count(self.rect.area())
    }

    /// Image column and row of the selected pixel `number`.
    #[inline]
    pub fn image_position(&self, number: u32) -> (u32, u32) {
        let index = self.part.nth_pixel_index_in_rect(number, self.rect);
        (self.rect.x + index % self.rect.width, self.rect.y + index / self.rect.width)
    }
}

/// All pixels of a rectangle, or half of them: one pixel of each horizontal pair, alternating between left
/// and right. Horizontal, vertical and diagonal edges are therefore split between both halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelSubset {
    /// Every pixel.
    All,
    /// Half 0 or half 1.
    Half(usize),
}

impl PixelSubset {
    /// Number of selected pixels in a rectangle of `area` pixels.
    pub fn count(self, area: usize) -> usize {
        match self {
            Self::All => area,
            Self::Half(half) => (area + 1 - half) / 2,
        }
    }

    /// Row-major index, within the rectangle, of the selected pixel `number`.
    #[inline(always)]
    pub fn nth_pixel_index_in_rect(self, number: u32, rect: Rect) -> u32 {
        match self {
            Self::All => number,
            // If the area is odd, the last pixel belongs to the first half.
            Self::Half(half) => (2 * number + (first_half_column_in_pair(number, rect.width) ^ half as u32))
                .min(rect.area() as u32 - 1),
        }
    }

    /// The half of a rectangle that contains the pixel at `index`.
    pub fn half_containing(index: u32, rect: Rect) -> usize {
        let area = rect.area() as u32;
        let is_alone = index + 1 == area && area % 2 == 1;
        if is_alone { 0 } else { ((index & 1) ^ first_half_column_in_pair(index / 2, rect.width)) as usize }
    }
}

/// 0 if the left pixel of a pair is in the first half, 1 if the right pixel is. Alternates every two rows.
#[inline(always)]
fn first_half_column_in_pair(pair: u32, width: u32) -> u32 {
    (pair / width) & 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_partition_the_pixels() {
        for (width, height) in [(32, 32), (1, 1), (1, 7), (31, 32), (5, 5), (17, 30), (32, 1)] {
            let rect = Rect { x: 3, y: 8, width, height };
            let mut seen = vec![0; rect.area()];
            for half in 0..2 {
                let pixels = SelectedPixels { rect, part: PixelSubset::Half(half) };
                for number in 0..pixels.count() as u32 {
                    let (x, y) = pixels.image_position(number);
                    let index = (y - 8) * width + x - 3;
                    assert_eq!(PixelSubset::half_containing(index, rect), half, "({x}, {y}) in {rect:?}");
                    seen[index as usize] += 1;
                }
            }
            assert!(seen.iter().all(|times| *times == 1), "{rect:?}");
        }
    }

    #[test]
    fn lines_are_split_between_both_halves() {
        let rect = Rect { x: 0, y: 0, width: 8, height: 8 };
        let half = |x: u32, y: u32| PixelSubset::half_containing(y * 8 + x, rect);
        for line in 0..8 {
            let places = |at| [(at, line), (line, at), (at, (at + line) % 8), (at, (line + 7 - at) % 8)];
            for kind in 0..4 {
                let first = (0..8).map(|at| places(at)[kind]).filter(|&(x, y)| half(x, y) == 0).count();
                assert_eq!(first, 4, "line {line} in direction {kind}");
            }
        }
    }
}
