//! Characters that fill part of a cell with the foreground color: half blocks, quadrants, sextants, octants
//! and shades.

use std::collections::HashMap;
use std::sync::LazyLock;

/// Number of rows in the two-column grid that describes parts of a cell. The rows can be divided into halves,
/// thirds and quarters.
pub(crate) const GRID_ROWS: u32 = 12;
/// Number of squares in the grid.
pub(crate) const PLACES: u32 = 2 * GRID_ROWS;
const ALL: u32 = (1 << PLACES) - 1;

/// A division of a cell into two parts, and the characters that draw it. The first part contains the top left
/// corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TwoPartBlockPattern {
    /// Mask of the grid squares in the first part, in row order.
    first: u32,
    symbols: [char; 2],
}

impl PartialEq for TwoPartBlockPattern {
    fn eq(&self, other: &Self) -> bool {
        self.first == other.first
    }
}

impl Eq for TwoPartBlockPattern {}

impl TwoPartBlockPattern {
    /// Upper and lower halves.
    pub(crate) const HALVES: Self = Self { first: (1 << GRID_ROWS) - 1, symbols: ['▀', '▄'] };
    /// A pattern that fills a quarter of the cell with the foreground color. The pattern varies between
    /// fonts.
    pub(crate) const LIGHT: Self = Self { first: 0x21_21_21, symbols: ['░', '▓'] };

    /// A fine pattern with equal amounts of both colors.
    pub(crate) const MEDIUM: Self = Self { first: CHECKS, symbols: ['▒', '▒'] };

    /// Returns the two characters that draw this tile: one for the first part in the foreground color, one
    /// for the second.
    pub(crate) fn symbols(self) -> [char; 2] {
        self.symbols
    }

    /// Number of grid squares in each part.
    pub(crate) fn part_sizes(self) -> [u32; 2] {
        let first = self.first.count_ones();
        [first, PLACES - first]
    }

    /// Counts the grid squares in which each part of this tile overlaps each part of `other`.
    pub(crate) fn part_overlap_counts(self, other: Self) -> [[u32; 2]; 2] {
        let parts = |tile: Self| [tile.first, ALL & !tile.first];
        parts(self).map(|own| parts(other).map(|its| (own & its).count_ones()))
    }
}

/// Returns the tile that a character draws and whether the foreground is the tile's second part, or `None`
/// if it is not a block character.
pub(crate) fn pattern_and_inversion_for_symbol(symbol: char) -> Option<(TwoPartBlockPattern, bool)> {
    // Letters, digits and punctuation have smaller code points than block characters.
    if symbol < '▀' {
        return None;
    }
    let mask = TABLE.masks.get(&symbol)?;
    pattern_and_inversion_for_mask(*mask)
}

/// The grid squares that a character fills with the foreground color, as 12 rows of 2 columns, or `None` if
/// it is not a block character.
pub fn squares_of_block_character(symbol: char) -> Option<[bool; 24]> {
    let mask = match symbol {
        ' ' => 0,
        '█' => ALL,
        _ => *TABLE.masks.get(&symbol)?,
    };
    Some(std::array::from_fn(|place| mask >> place & 1 == 1))
}

/// Returns the tile whose first part is `mask` and false, or the tile whose second part is `mask` and true if
/// the mask excludes the top left corner.
fn pattern_and_inversion_for_mask(mask: u32) -> Option<(TwoPartBlockPattern, bool)> {
    let is_second = mask & 1 == 0;
    let first = if is_second { ALL & !mask } else { mask };
    let symbol = |mask| TABLE.symbols.get(&mask).copied();
    let tile = TwoPartBlockPattern { first, symbols: [symbol(first)?, symbol(ALL & !first)?] };
    Some((tile, is_second))
}

/// Characters and the grid squares they fill.
struct BlockSymbolTable {
    masks: HashMap<char, u32>,
    symbols: HashMap<u32, char>,
}

static TABLE: LazyLock<BlockSymbolTable> = LazyLock::new(|| {
    let mut table = BlockSymbolTable { masks: HashMap::new(), symbols: HashMap::new() };
    let mut add = |symbol: char, mask: u32| {
        table.masks.entry(symbol).or_insert(mask);
        table.symbols.entry(mask).or_insert(symbol);
    };
    for (mask, symbol) in (0..).zip(QUADRANTS) {
        if !matches!(symbol, ' ' | '█') {
            add(symbol, expand_mask_to_full_grid(mask, 2));
        }
    }
    let light = TwoPartBlockPattern::LIGHT.first;
    add('░', light);
    add('▓', ALL & !light);
    // The inverted checkerboard has a different mask but looks the same.
    for mask in [CHECKS, ALL & !CHECKS] {
        add('▒', mask);
    }
    let mut next = SEXTANTS;
    for mask in 1..63 {
        if !SEXTANTS_ELSEWHERE.contains(&mask) {
            add(char::from_u32(next).unwrap_or(' '), expand_mask_to_full_grid(mask, 3));
            next += 1;
        }
    }
    let mut next = OCTANTS;
    for mask in 0..256 {
        if let Some((_, symbol)) = OCTANTS_ELSEWHERE.iter().find(|(other, _)| *other == mask) {
            add(*symbol, expand_mask_to_full_grid(mask, 4));
        } else if quadrant_mask_from_octants(mask).is_none() {
            add(char::from_u32(next).unwrap_or(' '), expand_mask_to_full_grid(mask, 4));
            next += 1;
        }
    }
    table
});

/// Mask of a checkerboard pattern.
const CHECKS: u32 = 0x99_99_99;

/// Characters indexed by a mask of the quadrants that they fill, lowest bit first (Unicode, "Block
/// Elements").
const QUADRANTS: [char; 16] =
    [' ', '▘', '▝', '▀', '▖', '▌', '▞', '▛', '▗', '▚', '▐', '▜', '▄', '▙', '▟', '█'];
/// First sextant (Unicode 13, "Symbols for Legacy Computing"). Sextants are ordered by mask, omitting the
/// left and right halves.
const SEXTANTS: u32 = 0x1_FB00;
const SEXTANTS_ELSEWHERE: [u32; 2] = [0b01_01_01, 0b10_10_10];
/// First octant (Unicode 16, "Symbols for Legacy Computing Supplement"). Octants are ordered by mask,
/// omitting shapes that Unicode already contained.
const OCTANTS: u32 = 0x1_CD00;
const OCTANTS_ELSEWHERE: [(u32, char); 10] = [
    (0b00_00_00_01, '\u{1CEA8}'),
    (0b00_00_00_10, '\u{1CEAB}'),
    (0b00_00_00_11, '\u{1FB82}'),
    (0b00_01_01_00, '\u{1FBE6}'),
    (0b00_10_10_00, '\u{1FBE7}'),
    (0b00_11_11_11, '\u{1FB85}'),
    (0b01_00_00_00, '\u{1CEA3}'),
    (0b10_00_00_00, '\u{1CEA0}'),
    (0b11_00_00_00, '▂'),
    (0b11_11_11_00, '▆'),
];

/// Expands a mask with `rows` rows to the full grid.
fn expand_mask_to_full_grid(mask: u32, rows: u32) -> u32 {
    expand_rows(mask, rows, GRID_ROWS)
}

/// Expands a mask from `from` to `to` rows.
fn expand_rows(mask: u32, from: u32, to: u32) -> u32 {
    let each = to / from;
    (0..2 * to)
        .filter(|place| mask >> (place / 2 / each * 2 + place % 2) & 1 == 1)
        .fold(0, |all, place| all | 1 << place)
}

/// The quadrants that fill the same area as a mask of octants, if any.
fn quadrant_mask_from_octants(mask: u32) -> Option<u32> {
    (0..16).find(|quadrants| expand_mask_to_full_grid(*quadrants, 2) == expand_mask_to_full_grid(mask, 4))
}

/// Grids that divide a cell into parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CellGrid {
    Halves,
    Quadrants,
    /// Sextants and quadrants.
    Sextants,
    Octants,
}

/// A division of a cell's pixels into two parts, and the tile that draws it.
#[derive(Clone, Copy, Debug)]
pub(super) struct TwoPartCellDivision {
    /// Mask of the pixels in the first part, in row order.
    pub(super) first: u32,
    pub(super) tile: TwoPartBlockPattern,
}

impl CellGrid {
    /// Pixels per cell, horizontally.
    pub(crate) fn columns_per_cell(self) -> u32 {
        if self == Self::Halves { 1 } else { 2 }
    }

    /// Pixels per cell, vertically. This is enough to distinguish all divisions.
    pub(crate) fn rows_per_cell(self) -> u32 {
        match self {
            Self::Halves | Self::Quadrants => 2,
            Self::Sextants => 6,
            Self::Octants => 4,
        }
    }

    /// Lists all divisions of a two-column cell, starting with halves. Successive divisions usually differ in
    /// only one part of the grid.
    pub(super) fn all_divisions(self) -> &'static [TwoPartCellDivision] {
        static QUADRANTS: LazyLock<Vec<TwoPartCellDivision>> = LazyLock::new(|| all_cell_divisions(2, &[2]));
        static SEXTANTS: LazyLock<Vec<TwoPartCellDivision>> =
            LazyLock::new(|| all_cell_divisions(6, &[2, 3]));
        static OCTANTS: LazyLock<Vec<TwoPartCellDivision>> = LazyLock::new(|| all_cell_divisions(4, &[4]));
        match self {
            Self::Halves => &[],
            Self::Quadrants => &QUADRANTS,
            Self::Sextants => &SEXTANTS,
            Self::Octants => &OCTANTS,
        }
    }
}

/// Lists all divisions of a cell with `pixel_rows` rows of pixels along two-column grids. `part_rows`
/// contains each grid's number of rows.
fn all_cell_divisions(pixel_rows: u32, part_rows: &[u32]) -> Vec<TwoPartCellDivision> {
    let mut divisions =
        vec![TwoPartCellDivision { first: (1 << pixel_rows) - 1, tile: TwoPartBlockPattern::HALVES }];
    for rows in part_rows {
        let half = 1_u32 << (2 * rows - 1);
        // Iterate in Gray code order. The mask always includes the top left square.
        for mask in (0..half).map(|i| (i ^ i >> 1) << 1 | 1) {
            let of_tile =
                pattern_and_inversion_for_mask(expand_mask_to_full_grid(mask, *rows)).map(|(tile, _)| tile);
            let is_new = |tile: &TwoPartBlockPattern| {
                divisions.iter().all(|division: &TwoPartCellDivision| division.tile != *tile)
            };
            if let Some(tile) = of_tile.filter(is_new) {
                divisions.push(TwoPartCellDivision { first: expand_rows(mask, *rows, pixel_rows), tile });
            }
        }
    }
    divisions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_divisions_have_characters() {
        for (grid, count) in
            [(CellGrid::Quadrants, 7), (CellGrid::Sextants, 31 + 6), (CellGrid::Octants, 127)]
        {
            let divisions = grid.all_divisions();
            let mut seen = std::collections::HashSet::new();
            for TwoPartCellDivision { first, tile } in divisions {
                assert_eq!(
                    tile.first,
                    expand_rows(*first, grid.rows_per_cell(), GRID_ROWS),
                    "{grid:?} {first:b}"
                );
                let [front, back] = tile.symbols();
                assert_eq!(pattern_and_inversion_for_symbol(front), Some((*tile, false)), "{front}");
                assert_eq!(pattern_and_inversion_for_symbol(back), Some((*tile, true)), "{back}");
                assert!(seen.insert(front) && seen.insert(back));
            }
            assert_eq!(divisions.len(), count, "{grid:?}");
            assert_eq!(divisions[0].tile, TwoPartBlockPattern::HALVES);
        }
    }

    #[test]
    fn known_block_characters() {
        let symbol = |mask, rows| TABLE.symbols[&expand_mask_to_full_grid(mask, rows)];
        assert_eq!(symbol(0b1001, 2), '▚');
        assert_eq!(symbol(1, 3), '🬀');
        assert_eq!(symbol(0b01_01_01, 3), '▌');
        assert_eq!(symbol(62, 3), '🬻');
        // BLOCK OCTANT-3, BLOCK OCTANT-23, and the last one, BLOCK OCTANT-2345678.
        assert_eq!(symbol(0b100, 4), '\u{1CD00}');
        assert_eq!(symbol(0b110, 4), '\u{1CD01}');
        assert_eq!(symbol(0b1111_1110, 4), '\u{1CDE5}');
    }

    #[test]
    fn shades_fill_one_two_or_three_quarters() {
        for (symbol, share) in [('░', 6), ('▒', 12), ('▓', 18)] {
            let (tile, is_second) = pattern_and_inversion_for_symbol(symbol).expect("a tile");
            assert_eq!(tile.part_sizes()[usize::from(is_second)], share, "{symbol}");
        }
        assert_eq!(pattern_and_inversion_for_symbol('▒').map(|(tile, _)| tile.symbols()), Some(['▒', '▒']));
        assert_eq!(pattern_and_inversion_for_symbol('a'), None);
    }
}
