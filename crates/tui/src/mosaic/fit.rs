//! Approximates a cell's pixels with two colors and a block character.

use super::tile::{CellGrid, TwoPartBlockPattern, TwoPartCellDivision};
use crate::color::linear_to_oklab;
use crate::math::Vec3;
use crate::math::color::{linear_to_srgb8, srgb8_color_to_linear};

/// A cell's tile and its two sRGB colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FittedCell {
    pub(crate) tile: TwoPartBlockPattern,
    /// Colors of the first and second parts.
    pub(crate) pair: [[u8; 3]; 2],
}

/// A tile other than [`TwoPartBlockPattern::HALVES`] is chosen only if it reduces the mean squared Oklab
/// distance by at least this much. Smaller improvements are invisible, make the tiles flicker with the noise,
/// and take more bytes.
const MIN_IMPROVEMENT: f32 = 1e-4;

/// Finds the tile and the two colors that best match a cell's `pixels` (sRGB colors in row order). The tile
/// minimizes the Oklab variance within its two parts.
pub(crate) fn fit_cell(grid: CellGrid, pixels: &[[u8; 3]]) -> FittedCell {
    if let ([first, second], CellGrid::Halves) = (pixels, grid) {
        return FittedCell { tile: TwoPartBlockPattern::HALVES, pair: [*first, *second] };
    }
    let pixels: Vec<Vec3> = pixels.iter().map(|pixel| srgb8_color_to_linear(*pixel)).collect();
    let TwoPartCellDivision { first, tile } = best_division(grid, &pixels);
    let mean = |is_first: bool| {
        let for_part = (0..pixels.len()).filter(|i| (first >> i & 1 == 1) == is_first);
        let count = for_part.clone().count().max(1);
        to_srgb_bytes(for_part.map(|i| pixels[i]).sum::<Vec3>() / count as f32)
    };
    FittedCell { tile, pair: [mean(true), mean(false)] }
}

/// The division of a cell that minimizes the variance within its two parts.
fn best_division(grid: CellGrid, pixels: &[Vec3]) -> TwoPartCellDivision {
    let count = pixels.len() as f32;
    let labs: Vec<Vec3> = pixels.iter().map(|pixel| linear_to_oklab(*pixel)).collect();
    let all: Vec3 = labs.iter().sum();
    let (mut best, mut most) =
        (TwoPartCellDivision { first: 1, tile: TwoPartBlockPattern::HALVES }, f32::NEG_INFINITY);
    let (mut mask, mut sum, mut size) = (0_u32, Vec3::ZERO, 0.0_f32);
    for division in grid.all_divisions() {
        let mut changed = mask ^ division.first;
        while changed != 0 {
            let pixel = changed.trailing_zeros();
            changed &= changed - 1;
            let sign = if division.first >> pixel & 1 == 1 { 1.0 } else { -1.0 };
            sum += labs.get(pixel as usize).copied().unwrap_or_default() * sign;
            size += sign;
        }
        mask = division.first;
        // Reduction in variance, up to a constant.
        let gain = sum.length_squared() / size + (all - sum).length_squared() / (count - size).max(1.0);
        let worth = if division.tile == TwoPartBlockPattern::HALVES { MIN_IMPROVEMENT * count } else { 0.0 };
        if gain + worth > most {
            (best, most) = (*division, gain + worth);
        }
    }
    best
}

fn to_srgb_bytes(linear: Vec3) -> [u8; 3] {
    [linear_to_srgb8(linear.x), linear_to_srgb8(linear.y), linear_to_srgb8(linear.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_color_patterns_are_reproduced() {
        let colors = [[200, 20, 20], [20, 40, 180]];
        for grid in [CellGrid::Quadrants, CellGrid::Sextants, CellGrid::Octants] {
            for TwoPartCellDivision { first, tile } in grid.all_divisions() {
                let pixels: Vec<[u8; 3]> =
                    (0..2 * grid.rows_per_cell()).map(|i| colors[usize::from(first >> i & 1 == 0)]).collect();
                assert_eq!(fit_cell(grid, &pixels), FittedCell { tile: *tile, pair: colors });
            }
        }
    }

    #[test]
    fn nearly_uniform_cells_use_halves() {
        let pixels: Vec<[u8; 3]> = (0..4).map(|i| [150 + i % 3; 3]).collect();
        assert_eq!(fit_cell(CellGrid::Quadrants, &pixels).tile, TwoPartBlockPattern::HALVES);
    }
}
