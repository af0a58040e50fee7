//! Cells of two colors: the characters that divide a cell, and the best of them for some pixels.

mod fit;
mod tile;

pub(super) use self::fit::{FittedCell, fit};
pub use self::tile::filled;
pub(super) use self::tile::{Grid, PLACES, Tile, of_symbol};
