//! Size of the terminal window and of its cells.

use crossterm::terminal;

use crate::event::WindowSize;

/// Height-to-width ratio of a cell with square half blocks.
const DEFAULT_CELL_ASPECT: f32 = 2.0;
/// Typical cell size in pixels.
const DEFAULT_CELL_PIXELS: (u16, u16) = (8, 16);

/// Window size and cell aspect ratio. If `cell_aspect` is `None`, the aspect ratio is derived from the window
/// size in pixels, or is 2 if that size is unknown.
pub(crate) fn query_window_size(cell_aspect: Option<f32>) -> WindowSize {
    match terminal::window_size() {
        Ok(size) => clamp_window_size(WindowSize {
            columns: size.columns,
            rows: size.rows,
            cell_aspect: cell_aspect.unwrap_or_else(|| {
                cell_height_to_width_ratio((size.columns, size.rows), (size.width, size.height))
            }),
            cell_pixels: cell_size_from_window((size.columns, size.rows), (size.width, size.height)),
        }),
        Err(_) => {
            let (columns, rows) = terminal::size().unwrap_or((80, 24));
            clamp_window_size(WindowSize {
                columns,
                rows,
                cell_aspect: cell_aspect.unwrap_or(DEFAULT_CELL_ASPECT),
                cell_pixels: DEFAULT_CELL_PIXELS,
            })
        }
    }
}

/// Maximum number of columns drawn. Not even a video wall has more.
const MAX_COLUMNS: u16 = 4096;
/// Maximum number of cells drawn. A cell takes hundreds of bytes of memory, and terminals may report up to
/// 65,535 columns and rows.
const MAX_CELLS: u32 = 1 << 20;

/// Limits a window to the maximum size.
fn clamp_window_size(window: WindowSize) -> WindowSize {
    let columns = window.columns.min(MAX_COLUMNS);
    let max_rows = MAX_CELLS / u32::from(columns.max(1));
    let rows = u16::try_from(max_rows).map_or(window.rows, |most| window.rows.min(most));
    WindowSize { columns, rows, ..window }
}

/// Height-to-width ratio of a cell. Reported pixel sizes are often zero or implausible. Values within 3% of 2
/// are rounded to 2 so that previews need no scaling.
fn cell_height_to_width_ratio(cells: (u16, u16), pixels: (u16, u16)) -> f32 {
    let width = f32::from(pixels.0) / f32::from(cells.0);
    let height = f32::from(pixels.1) / f32::from(cells.1);
    let aspect = height / width;
    let sane = width >= 2.0 && (1.2..=3.5).contains(&aspect);
    if sane && (aspect - DEFAULT_CELL_ASPECT).abs() > 0.06 { aspect } else { DEFAULT_CELL_ASPECT }
}

/// Cell size in pixels, or a typical size if the reported one is implausible.
fn cell_size_from_window(cells: (u16, u16), pixels: (u16, u16)) -> (u16, u16) {
    let side = |pixels: u16, cells: u16| pixels.checked_div(cells).filter(|side| (2..=100).contains(side));
    side(pixels.0, cells.0).zip(side(pixels.1, cells.1)).unwrap_or(DEFAULT_CELL_PIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn implausible_cell_aspects_are_ignored() {
        assert_eq!(cell_height_to_width_ratio((80, 24), (80 * 8, 24 * 18)), 2.25);
        assert_eq!(cell_height_to_width_ratio((80, 24), (0, 0)), 2.0);
        assert_eq!(cell_height_to_width_ratio((0, 0), (640, 480)), 2.0);
        assert_eq!(cell_height_to_width_ratio((80, 24), (80, 24)), 2.0);
        assert_eq!(cell_height_to_width_ratio((100, 50), (1000, 1010)), 2.0);
    }

    #[test]
    fn number_of_cells_is_limited() {
        let of = |columns, rows| {
            let cell_pixels = DEFAULT_CELL_PIXELS;
            let drawn = clamp_window_size(WindowSize {
                columns,
                rows,
                cell_aspect: DEFAULT_CELL_ASPECT,
                cell_pixels,
            });
            (drawn.columns, drawn.rows)
        };
        for usual in [(80, 24), (640, 360), (4096, 256), (0, 0), (0, 24), (1, u16::MAX)] {
            assert_eq!(of(usual.0, usual.1), usual);
        }
        for (columns, rows) in [(32_767, 32_767), (u16::MAX, u16::MAX), (u16::MAX, 1), (300, u16::MAX)] {
            let drawn = of(columns, rows);
            assert!(u32::from(drawn.0) * u32::from(drawn.1) <= MAX_CELLS, "{drawn:?}");
            assert!(drawn.0 >= columns.min(300) && drawn.1 >= rows.min(256), "{drawn:?}");
        }
    }

    #[test]
    fn implausible_cell_sizes_are_ignored() {
        assert_eq!(cell_size_from_window((80, 24), (80 * 9, 24 * 18 + 3)), (9, 18));
        assert_eq!(cell_size_from_window((80, 24), (0, 0)), DEFAULT_CELL_PIXELS);
        assert_eq!(cell_size_from_window((0, 0), (640, 480)), DEFAULT_CELL_PIXELS);
    }
}
