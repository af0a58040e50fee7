//! Draws the preview using block characters or ASCII. Only this module converts pixels to cells.

use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};

use super::layout::Layout;
use super::marks;
use super::message;
use super::ramp::AsciiRamp;
use super::text::{TextRole, put_text};
use crate::color::{ColorDepth, ColorMapper, XTERM};
use crate::film::Srgb8Image;
use crate::graphics::PlacedImage;
use crate::messages;
use crate::mosaic::{CellGrid, fit_cell};
use crate::options::PreviewChoice;
use crate::pipeline::protocol::NormalizedPosition;
use crate::pipeline::protocol::PreviewUpdate;
use crate::preview_style::PreviewStyle;
use crate::rescale::resized_pixels;
use crate::state::State;

/// Draws the preview, or a message if there is none.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    match &state.preview.shown {
        Some(_) if is_drawn_as_pixels(state) => {}
        Some(shown) => {
            let kind = cell_based_style(state.display.kind, state.display.depth);
            let placed = PreviewPlacement::for_preview(state, shown, area, kind);
            placed.draw(&shown.picture, kind, PreviewColorSettings::for_state(state), buffer);
            marks::draw_marks(state, placed.cells, buffer);
        }
        None if state.overlays.problems.is_none() && area.height > 0 => {
            let text = messages::NO_IMAGE;
            let middle = Rect { y: area.y + area.height / 2, height: 1, ..area };
            let indent = area.width.saturating_sub(super::text::text_columns(text)) / 2;
            let line = Rect { x: middle.x + indent, width: middle.width - indent, ..middle };
            put_text(buffer, line, &[(text, TextRole::Faint)], state.display.depth);
        }
        None => {}
    }
}

/// Draws the thumbnail of a history entry.
pub(super) fn draw_history_thumbnail(state: &State, picture: &Srgb8Image, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    if !area.is_empty() {
        let kind = cell_based_style(state.display.kind, state.display.depth);
        let placed =
            PreviewPlacement::fit(picture, area, kind, state.display.window.cell_aspect, f32::INFINITY);
        placed.draw(picture, kind, PreviewColorSettings::for_state(state), buffer);
    }
}

/// The image position shown by a cell of the preview.
pub(crate) fn image_position_at(state: &State, column: u16, row: u16) -> Option<NormalizedPosition> {
    let shown = state.preview.shown.as_ref()?;
    let area = Layout::for_state(state).preview;
    let cells = PreviewPlacement::for_preview(
        state,
        shown,
        area,
        cell_based_style(state.display.kind, state.display.depth),
    )
    .cells;
    let share = |at: u16, start: u16, length: u16| (f64::from(at - start) + 0.5) / f64::from(length);
    let spot = || {
        let spot = NormalizedPosition {
            x: share(column, cells.x, cells.width),
            y: share(row, cells.y, cells.height),
        };
        shown.section.map_or(spot, |section| section.position_in_image(spot))
    };
    cells.contains((column, row).into()).then(spot)
}

/// Returns the preview style to use if the preview must be drawn as cells.
fn cell_based_style(kind: PreviewStyle, depth: ColorDepth) -> PreviewStyle {
    match kind {
        PreviewStyle::Pixels(_) => PreviewStyle::from_choice(PreviewChoice::Auto, depth),
        kind => kind,
    }
}

/// Whether the preview is drawn as pixels, which requires that nothing covers it.
fn is_drawn_as_pixels(state: &State) -> bool {
    matches!(state.display.kind, PreviewStyle::Pixels(_))
        && !state.overlays.help.open
        && !state.overlays.diagnostics.open
        && state.overlays.views.is_none()
        && !message::covers_preview(state)
}

/// Placement of a preview drawn as pixels, or `None` if the preview is drawn as cells.
pub(crate) fn placed_pixel_preview(state: &State, area: Rect) -> Option<PlacedImage> {
    let shown = state.preview.shown.as_ref().filter(|_| is_drawn_as_pixels(state))?;
    let placed = PreviewPlacement::for_preview(state, shown, area, state.display.kind);
    let (picture, cells) = (shown.picture.clone(), placed.cells);
    (!cells.is_empty()).then_some(PlacedImage { picture, cells, cell: state.display.window.cell_pixels })
}

/// Color settings for a preview.
#[derive(Clone, Copy)]
pub(crate) struct PreviewColorSettings<'a> {
    pub(crate) depth: ColorDepth,
    pub(crate) shades: &'a ColorMapper,
    /// Whether the terminal's background is light.
    pub(crate) is_light: bool,
}

impl<'a> PreviewColorSettings<'a> {
    fn for_state(state: &'a State) -> Self {
        Self { depth: state.display.depth, shades: &state.display.shades, is_light: state.display.is_light }
    }
}

/// Draws an image into `area` for a terminal with a dark background, xterm's colors, and cells that are
/// twice as tall as wide.
pub fn draw_for_dark_xterm(
    picture: &Srgb8Image,
    choice: PreviewChoice,
    depth: ColorDepth,
    area: Rect,
) -> Buffer {
    let shades = ColorMapper::new(depth, &XTERM);
    let inks = PreviewColorSettings { depth, shades: &shades, is_light: false };
    draw_image(picture, choice, inks, area, 2.0)
}

/// Draws an image with the given color settings and cell aspect ratio.
pub(crate) fn draw_image(
    picture: &Srgb8Image,
    choice: PreviewChoice,
    inks: PreviewColorSettings<'_>,
    area: Rect,
    cell_aspect: f32,
) -> Buffer {
    let mut buffer = Buffer::empty(area);
    let kind = cell_based_style(PreviewStyle::from_choice(choice, inks.depth), inks.depth);
    PreviewPlacement::fit(picture, area, kind, cell_aspect, f32::INFINITY).draw(
        picture,
        kind,
        inks,
        &mut buffer,
    );
    buffer
}

/// Returns the size in cells of an image drawn with half blocks or ASCII characters, limited to the available
/// space.
pub(crate) fn size_in_cells(
    picture: &Srgb8Image,
    depth: ColorDepth,
    columns: u16,
    rows: u16,
    cell_aspect: f32,
) -> (u16, u16) {
    let kind = PreviewStyle::from_choice(PreviewChoice::HalfBlock, depth);
    let area = Rect::new(0, 0, columns, rows);
    let cells = PreviewPlacement::fit(picture, area, kind, cell_aspect, f32::INFINITY).cells;
    (cells.width, cells.height)
}

/// Placement of an image: the cells it covers and its size in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PreviewPlacement {
    cells: Rect,
    width: u32,
    height: u32,
}

impl PreviewPlacement {
    /// Placement of the current preview, either as large as possible or showing actual pixels.
    fn for_preview(state: &State, shown: &PreviewUpdate, area: Rect, kind: PreviewStyle) -> Self {
        let across = kind.grid().map_or(1, CellGrid::columns_per_cell);
        let one_to_one = across as f32 / state.display.horizontal_pixels_per_cell() as f32;
        let most = if shown.section.is_some() { one_to_one } else { f32::INFINITY };
        Self::fit(&shown.picture, area, kind, state.display.window.cell_aspect, most)
    }

    /// Computes the largest centered placement with the image's aspect ratio. `cell_aspect` is a cell's
    /// height divided by its width. An image pixel covers at most `most` cell parts horizontally.
    fn fit(picture: &Srgb8Image, area: Rect, kind: PreviewStyle, cell_aspect: f32, most: f32) -> Self {
        let (across, down) =
            kind.grid().map_or((1, 1), |grid| (grid.columns_per_cell() as u16, grid.rows_per_cell() as u16));
        let pixel_aspect = cell_aspect * f32::from(across) / f32::from(down);
        let room = (f32::from(area.width * across), f32::from(area.height * down));
        let size = (picture.width.max(1) as f32, picture.height.max(1) as f32 / pixel_aspect);
        let scale = (room.0 / size.0).min(room.1 / size.1).min(most);
        let whole = |length: f32, room: f32| (length * scale).round().clamp(room.min(1.0), room) as u16;
        let (width, height) = (whole(size.0, room.0), whole(size.1, room.1));
        let (columns, rows) = (width.div_ceil(across), height.div_ceil(down));
        // If a cell is several pixels wide, round up to whole cells.
        let (width, height) = if across > 1 { (columns * across, rows * down) } else { (width, height) };
        let cells = Rect {
            x: area.x + (area.width - columns.min(area.width)) / 2,
            y: area.y + (area.height - rows.min(area.height)) / 2,
            width: columns,
            height: rows,
        };
        Self { cells, width: u32::from(width), height: u32::from(height) }
    }

    fn draw(
        self,
        picture: &Srgb8Image,
        kind: PreviewStyle,
        inks: PreviewColorSettings<'_>,
        buffer: &mut Buffer,
    ) {
        let pixels = resized_pixels(picture, self.width, self.height);
        let scaled = ScaledImage { width: self.width, height: self.height, pixels: &pixels };
        let mut each = |draw: &dyn Fn(usize, usize, &mut Cell)| {
            for row in 0..self.cells.height {
                for column in 0..self.cells.width {
                    if let Some(cell) = buffer.cell_mut((self.cells.x + column, self.cells.y + row)) {
                        draw(usize::from(column), usize::from(row), cell);
                    }
                }
            }
        };
        match kind.grid() {
            Some(grid) => each(&|x, y, cell| draw_two_color_cell(&scaled, grid, inks.shades, x, y, cell)),
            None if kind == PreviewStyle::None => {}
            None => {
                let ramp = AsciiRamp::for_image(picture, inks.is_light);
                each(&|x, y, cell| draw_ascii_cell(&scaled, ramp, inks, x, y, cell));
            }
        }
    }
}

/// An image scaled to the size at which it is drawn.
struct ScaledImage<'a> {
    width: u32,
    height: u32,
    pixels: &'a [[u8; 3]],
}

impl ScaledImage<'_> {
    fn pixel(&self, x: u32, y: u32) -> Option<[u8; 3]> {
        let index = (y < self.height).then(|| y as usize * self.width as usize + x as usize)?;
        self.pixels.get(index).copied()
    }
}

/// Draws a cell as a block character in two colors.
fn draw_two_color_cell(
    scaled: &ScaledImage<'_>,
    grid: CellGrid,
    shades: &ColorMapper,
    x: usize,
    y: usize,
    cell: &mut Cell,
) {
    let (left, top) = (x as u32 * grid.columns_per_cell(), y as u32 * grid.rows_per_cell());
    let part = |i: u32| scaled.pixel(left + i % grid.columns_per_cell(), top + i / grid.columns_per_cell());
    let parts: Vec<Option<[u8; 3]>> = (0..grid.columns_per_cell() * grid.rows_per_cell()).map(part).collect();
    let colors: Vec<[u8; 3]> = parts.iter().copied().flatten().collect();
    if colors.len() < parts.len() {
        // The last row of cells may lack pixels in its lower half.
        let color = parts[0].map_or(Color::Reset, |rgb| shades.terminal_color_at(rgb, x, 2 * y));
        cell.set_symbol("▀").set_style(Style::new().fg(color).bg(Color::Reset));
        return;
    }
    let shown = shades.map_cell(fit_cell(grid, &colors), x, y);
    let [first, second] = shown.pair;
    cell.set_char(shown.tile.symbols()[0]).set_style(Style::new().fg(first).bg(second));
}

/// Draws a cell as a character.
fn draw_ascii_cell(
    scaled: &ScaledImage<'_>,
    ramp: AsciiRamp,
    inks: PreviewColorSettings<'_>,
    x: usize,
    y: usize,
    cell: &mut Cell,
) {
    let Some(rgb) = scaled.pixel(x as u32, y as u32) else { return };
    if inks.depth == ColorDepth::None {
        cell.set_char(ramp.glyph(rgb));
    } else {
        let (symbol, ink) = ramp.tinted_glyph(rgb);
        cell.set_char(symbol).set_style(Style::new().fg(inks.shades.terminal_color_at(ink, x, y)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::state;

    fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> Srgb8Image {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Srgb8Image { width, height, pixels }
    }

    fn fit(width: u32, height: u32, area: (u16, u16), kind: PreviewStyle, aspect: f32) -> PreviewPlacement {
        PreviewPlacement::fit(
            &picture(width, height, |_, _| [0; 3]),
            Rect::new(3, 1, area.0, area.1),
            kind,
            aspect,
            f32::INFINITY,
        )
    }

    #[test]
    fn image_with_the_requested_size_is_not_scaled() {
        let placed = fit(50, 40, (50, 20), PreviewStyle::HalfBlock, 2.0);
        assert_eq!(placed, PreviewPlacement { cells: Rect::new(3, 1, 50, 20), width: 50, height: 40 });
        let narrow = fit(20, 40, (50, 20), PreviewStyle::HalfBlock, 2.0);
        assert_eq!(narrow.cells, Rect::new(18, 1, 20, 20));
        let odd = fit(50, 31, (50, 20), PreviewStyle::HalfBlock, 2.0);
        assert_eq!(odd, PreviewPlacement { cells: Rect::new(3, 3, 50, 16), width: 50, height: 31 });
    }

    #[test]
    fn aspect_ratio_is_preserved_in_any_area() {
        for (columns, rows) in [(80_u16, 24_u16), (51, 20), (150, 55), (200, 20), (30, 60)] {
            for (width, height) in [(640, 480), (100, 300), (1920, 1080), (64, 64)] {
                for (kind, across, per_cell) in [
                    (PreviewStyle::HalfBlock, 1.0, 2.0),
                    (PreviewStyle::Ascii, 1.0, 1.0),
                    (PreviewStyle::Quadrant, 2.0, 2.0),
                    (PreviewStyle::Sextant, 2.0, 6.0),
                    (PreviewStyle::Octant, 2.0, 4.0),
                ] {
                    for aspect in [1.8_f32, 2.0, 2.3] {
                        let placed = fit(width, height, (columns, rows), kind, aspect);
                        let shown_height = placed.height as f32 * aspect / per_cell;
                        let shown_width = placed.width as f32 / across;
                        // Rounding can add half a pixel per side, or one cell if a cell has several pixels.
                        let is_fine = across > 1.0;
                        let (off_x, off_y) =
                            if is_fine { (1.0, aspect) } else { (0.5, 0.5 * aspect / per_cell) };
                        let wanted = width as f32 / height as f32;
                        let low = (shown_width - off_x) / (shown_height + off_y);
                        let high = (shown_width + off_x) / (shown_height - off_y);
                        assert!(low <= wanted && wanted <= high, "{placed:?} for {width}×{height}");
                        assert!(
                            placed.cells.width == columns || placed.cells.height == rows,
                            "{placed:?} does not fill the area"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn odd_last_row_shows_the_background() {
        let one = picture(2, 1, |_, _| [9, 8, 7]);
        let state = state(2, 3);
        let mut buffer = Buffer::empty(Rect::new(0, 0, 2, 3));
        PreviewPlacement::fit(&one, buffer.area, PreviewStyle::HalfBlock, 2.0, f32::INFINITY).draw(
            &one,
            PreviewStyle::HalfBlock,
            PreviewColorSettings::for_state(&state),
            &mut buffer,
        );
        let cell = &buffer[(0, 1)];
        assert_eq!((cell.symbol(), cell.fg, cell.bg), ("▀", Color::Rgb(9, 8, 7), Color::Reset));
    }

    #[test]
    fn edges_within_a_cell_are_drawn_as_quadrants() {
        let sharp = picture(8, 8, |x, _| if x < 3 { [200, 20, 20] } else { [20, 20, 200] });
        let state = state(4, 2);
        for (kind, symbol) in
            [(PreviewStyle::Quadrant, "▌"), (PreviewStyle::Sextant, "▌"), (PreviewStyle::Octant, "▌")]
        {
            let mut buffer = Buffer::empty(Rect::new(0, 0, 4, 2));
            PreviewPlacement::fit(&sharp, buffer.area, kind, 2.0, f32::INFINITY).draw(
                &sharp,
                kind,
                PreviewColorSettings::for_state(&state),
                &mut buffer,
            );
            let cell = &buffer[(1, 1)];
            let colors = (cell.symbol(), cell.fg, cell.bg);
            assert_eq!(colors, (symbol, Color::Rgb(200, 20, 20), Color::Rgb(20, 20, 200)), "{kind:?}");
        }
    }
}
