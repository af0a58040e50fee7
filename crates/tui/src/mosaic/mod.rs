//! Two-color cells: block characters, and fitting them to pixels.

mod fit;
mod tile;

pub(super) use self::fit::{FittedCell, fit};
pub use self::tile::filled_squares;
pub(super) use self::tile::{Grid, PLACES, Tile, from_symbol};
