//! The picture in half blocks or characters: the one place where pixels become cells.

use std::borrow::Cow;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};

use super::layout::Layout;
use super::text::{Tone, put};
use crate::film::Picture;
use crate::math::Vec3;
use crate::math::color::{linear_to_srgb, linear_to_srgb8, luminance, srgb8_to_linear};
use crate::pipeline::protocol::Spot;
use crate::tui::color::{self, ColorDepth};
use crate::tui::state::{PreviewKind, State};

/// From dark to bright.
const RAMP: &[u8; 10] = b" .:-=+*#%@";

/// The picture of the state, or a word in its place.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    match &state.picture {
        Some(shown) => {
            let kind = state.preview;
            let placed = Placed::fit(&shown.picture, area, kind, state.window.cell_aspect);
            placed.draw(&shown.picture, kind, state.depth, buffer);
        }
        None if state.problems.is_none() && area.height > 0 => {
            let text = "no picture yet";
            let middle = Rect { y: area.y + area.height / 2, height: 1, ..area };
            let indent = area.width.saturating_sub(super::text::columns(text)) / 2;
            let line = Rect { x: middle.x + indent, width: middle.width - indent, ..middle };
            put(buffer, line, &[(text, Tone::Faint)], state.depth);
        }
        None => {}
    }
}

/// The place of the picture that a cell shows.
pub(in crate::tui) fn spot_at(state: &State, column: u16, row: u16) -> Option<Spot> {
    let picture = &state.picture.as_ref()?.picture;
    let area = Layout::of(state).preview;
    let cells = Placed::fit(picture, area, state.preview, state.window.cell_aspect).cells;
    let share = |at: u16, start: u16, length: u16| (f64::from(at - start) + 0.5) / f64::from(length);
    let spot = || Spot { x: share(column, cells.x, cells.width), y: share(row, cells.y, cells.height) };
    cells.contains((column, row).into()).then(spot)
}

/// Where a picture lies: its cells, and how many pixels it has there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Placed {
    cells: Rect,
    width: u32,
    height: u32,
}

impl Placed {
    /// The largest place in the middle of the area with the picture's aspect ratio. `cell_aspect` is the height
    /// of a cell over its width.
    fn fit(picture: &Picture, area: Rect, kind: PreviewKind, cell_aspect: f32) -> Self {
        let rows_per_cell: u16 = if kind == PreviewKind::HalfBlock { 2 } else { 1 };
        let pixel_aspect = cell_aspect / f32::from(rows_per_cell);
        let room = (f32::from(area.width), f32::from(area.height) * f32::from(rows_per_cell));
        let size = (picture.width.max(1) as f32, picture.height.max(1) as f32 / pixel_aspect);
        let scale = (room.0 / size.0).min(room.1 / size.1);
        let whole = |length: f32, room: f32| (length * scale).round().clamp(room.min(1.0), room) as u16;
        let (width, height) = (whole(size.0, room.0), whole(size.1, room.1));
        let rows = height.div_ceil(rows_per_cell);
        let cells = Rect {
            x: area.x + (area.width - width.min(area.width)) / 2,
            y: area.y + (area.height - rows.min(area.height)) / 2,
            width,
            height: rows,
        };
        Self { cells, width: u32::from(width), height: u32::from(height) }
    }

    fn draw(self, picture: &Picture, kind: PreviewKind, depth: ColorDepth, buffer: &mut Buffer) {
        let pixels = rescaled(picture, self.width, self.height);
        let pixel =
            |x: u32, y: u32| (y < self.height).then(|| pixels.get((y * self.width + x) as usize)).flatten();
        for row in 0..self.cells.height {
            for column in 0..self.cells.width {
                let Some(cell) = buffer.cell_mut((self.cells.x + column, self.cells.y + row)) else {
                    continue;
                };
                let (x, y) = (u32::from(column), u32::from(row));
                match kind {
                    PreviewKind::HalfBlock => {
                        let shade = |y: u32| {
                            pixel(x, y)
                                .map_or(Color::Reset, |rgb| color::pixel(*rgb, depth, x as usize, y as usize))
                        };
                        let style = Style::new().fg(shade(2 * y)).bg(shade(2 * y + 1));
                        cell.set_symbol("▀").set_style(style);
                    }
                    PreviewKind::Ascii => {
                        cell.set_char(pixel(x, y).map_or(' ', |rgb| glyph(*rgb)));
                    }
                    PreviewKind::None => {}
                }
            }
        }
    }
}

/// The character as bright as a colour: the steps of the ramp are even in the sRGB coding of luminance, which is
/// about even to the eye.
fn glyph(rgb: [u8; 3]) -> char {
    let brightness = linear_to_srgb(luminance(srgb8_to_linear(rgb)).clamp(0.0, 1.0));
    let step = (brightness * (RAMP.len() - 1) as f32).round() as usize;
    char::from(RAMP[step.min(RAMP.len() - 1)])
}

/// The picture at another size: means over the pixels covered, in linear light, weighted by how much of each is
/// covered; where it grows, the pixel at the middle.
fn rescaled(picture: &Picture, width: u32, height: u32) -> Cow<'_, [[u8; 3]]> {
    if (picture.width, picture.height) == (width, height) {
        return Cow::Borrowed(&picture.pixels);
    }
    let columns: Vec<_> = (0..width).map(|i| covered(i, width, picture.width)).collect();
    let rows: Vec<_> = (0..height).map(|i| covered(i, height, picture.height)).collect();
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for row in &rows {
        for column in &columns {
            pixels.push(mean(picture, column, row));
        }
    }
    Cow::Owned(pixels)
}

/// The source pixels under one target pixel along one axis, with the length of each that is covered.
fn covered(target: u32, targets: u32, sources: u32) -> Vec<(u32, f32)> {
    if targets >= sources {
        let middle = (u64::from(target) * 2 + 1) * u64::from(sources) / (2 * u64::from(targets.max(1)));
        return vec![(u32::try_from(middle).unwrap_or(0), 1.0)];
    }
    let ratio = f64::from(sources) / f64::from(targets);
    let (start, end) = (f64::from(target) * ratio, f64::from(target + 1) * ratio);
    let last = (end.ceil() as u32).min(sources);
    (start.floor() as u32..last)
        .map(|source| {
            let length = (f64::from(source + 1)).min(end) - f64::from(source).max(start);
            (source, length as f32)
        })
        .filter(|(_, length)| *length > 0.0)
        .collect()
}

fn mean(picture: &Picture, columns: &[(u32, f32)], rows: &[(u32, f32)]) -> [u8; 3] {
    let at = |x: u32, y: u32| {
        picture.pixels.get(y as usize * picture.width as usize + x as usize).copied().unwrap_or_default()
    };
    if let ([(x, _)], [(y, _)]) = (columns, rows) {
        return at(*x, *y);
    }
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (y, height) in rows {
        for (x, width) in columns {
            sum += srgb8_to_linear(at(*x, *y)) * (width * height);
            weights += width * height;
        }
    }
    (sum / weights).to_array().map(linear_to_srgb8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> Picture {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Picture { width, height, pixels }
    }

    fn fit(width: u32, height: u32, area: (u16, u16), kind: PreviewKind, aspect: f32) -> Placed {
        Placed::fit(&picture(width, height, |_, _| [0; 3]), Rect::new(3, 1, area.0, area.1), kind, aspect)
    }

    #[test]
    fn a_picture_of_the_size_asked_for_is_not_scaled() {
        let placed = fit(50, 40, (50, 20), PreviewKind::HalfBlock, 2.0);
        assert_eq!(placed, Placed { cells: Rect::new(3, 1, 50, 20), width: 50, height: 40 });
        let narrow = fit(20, 40, (50, 20), PreviewKind::HalfBlock, 2.0);
        assert_eq!(narrow.cells, Rect::new(18, 1, 20, 20));
        let odd = fit(50, 31, (50, 20), PreviewKind::HalfBlock, 2.0);
        assert_eq!(odd, Placed { cells: Rect::new(3, 3, 50, 16), width: 50, height: 31 });
    }

    #[test]
    fn the_aspect_is_kept_in_every_area() {
        for (columns, rows) in [(80_u16, 24_u16), (51, 20), (150, 55), (200, 20), (30, 60)] {
            for (width, height) in [(640, 480), (100, 300), (1920, 1080), (64, 64)] {
                for (kind, per_cell) in [(PreviewKind::HalfBlock, 2.0), (PreviewKind::Ascii, 1.0)] {
                    for aspect in [1.8_f32, 2.0, 2.3] {
                        let placed = fit(width, height, (columns, rows), kind, aspect);
                        let shown_height = placed.height as f32 * aspect / per_cell;
                        // Half a pixel of rounding on each side.
                        let wanted = width as f32 / height as f32;
                        let low = (placed.width as f32 - 0.5) / (shown_height + 0.5 * aspect / per_cell);
                        let high = (placed.width as f32 + 0.5) / (shown_height - 0.5 * aspect / per_cell);
                        assert!(low <= wanted && wanted <= high, "{placed:?} for {width}×{height}");
                        assert!(
                            placed.cells.width == columns || placed.cells.height == rows,
                            "{placed:?} leaves room"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn shrinking_takes_the_mean_in_linear_light() {
        let checks = picture(8, 8, |x, y| if (x + y) % 2 == 0 { [255; 3] } else { [0; 3] });
        let half = linear_to_srgb8(0.5);
        assert_eq!(rescaled(&checks, 4, 4).as_ref(), [[half; 3]; 16]);
        let thirds = picture(3, 1, |x, _| if x == 0 { [255; 3] } else { [0; 3] });
        // The first of two covers one white pixel and half a black one.
        assert_eq!(rescaled(&thirds, 2, 1).as_ref(), [[linear_to_srgb8(2.0 / 3.0); 3], [0; 3]]);
    }

    #[test]
    fn growing_repeats_pixels() {
        let two = picture(2, 1, |x, _| if x == 0 { [1, 2, 3] } else { [4, 5, 6] });
        assert_eq!(rescaled(&two, 4, 1).as_ref(), [[1, 2, 3], [1, 2, 3], [4, 5, 6], [4, 5, 6]]);
    }

    #[test]
    fn the_ramp_goes_from_space_to_at() {
        assert_eq!(glyph([0; 3]), ' ');
        assert_eq!(glyph([255; 3]), '@');
        assert_eq!(glyph([128; 3]), '+');
        assert!(
            RAMP.iter().position(|c| char::from(*c) == glyph([0, 255, 0]))
                > RAMP.iter().position(|c| char::from(*c) == glyph([0, 0, 255]))
        );
    }

    #[test]
    fn an_odd_last_row_leaves_the_lower_half_to_the_background() {
        let one = picture(2, 1, |_, _| [9, 8, 7]);
        let mut buffer = Buffer::empty(Rect::new(0, 0, 2, 3));
        Placed::fit(&one, buffer.area, PreviewKind::HalfBlock, 2.0).draw(
            &one,
            PreviewKind::HalfBlock,
            ColorDepth::TrueColor,
            &mut buffer,
        );
        let cell = &buffer[(0, 1)];
        assert_eq!((cell.symbol(), cell.fg, cell.bg), ("▀", Color::Rgb(9, 8, 7), Color::Reset));
    }
}
