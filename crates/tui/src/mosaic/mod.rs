//! Two-color cells: block characters and their fitting to pixels.

mod fit;
mod tile;

pub(super) use self::fit::{FittedCell, fit_cell};
pub use self::tile::squares_of_block_character;
pub(super) use self::tile::{CellGrid, PLACES, TwoPartBlockPattern, pattern_and_inversion_for_symbol};
