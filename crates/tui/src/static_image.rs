//! Prints images as lines of text without using a full-screen UI or terminal queries.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

use super::color::{self, ColorDepth, ColorDepthChoice, ColorMapper};
use super::event::WindowSize;
use super::options::PreviewChoice;
use super::paint::buffer_to_ansi_text;
use super::terminal;
use super::view::preview::{PreviewColorSettings, draw_image, size_in_cells};
use super::view::text::{text_columns, truncated_text};
use crate::film::Srgb8Image;

/// Minimum terminal width for showing images.
const MIN_COLUMNS: u16 = 30;
/// Minimum width of images shown side by side.
const MIN_BESIDE: u16 = 20;
/// Number of columns between images.
const IMAGE_GAP: u16 = 2;
/// Terminal rows reserved for text.
const TEXT_ROWS: u16 = 17;
/// Minimum height of an image.
const MIN_ROWS: u16 = 7;

/// An image and its caption.
#[derive(Clone, Debug)]
pub struct NamedImage {
    /// The caption, which must not contain control characters.
    pub name: String,
    /// The image. Images printed together must have the same size.
    pub picture: Srgb8Image,
}

/// Draws images as lines of text, side by side, or stacked if the terminal is narrow. Uses the terminal's
/// colors, or ASCII characters if it has none. Returns an empty string if the terminal has fewer than 30
/// columns. If the output is not a terminal, its size is assumed to be 80×24.
pub fn images_as_text(pictures: &[NamedImage], color: ColorDepthChoice, is_terminal: bool) -> String {
    let variable = |name: &str| std::env::var(name).ok();
    let depth = color::resolve_color_depth(color, variable);
    let shades = ColorMapper::new(depth, color::assumed_ansi_colors(&variable("TERM").unwrap_or_default()));
    let inks = PreviewColorSettings {
        depth,
        shades: &shades,
        is_light: color::colorfgbg_indicates_light_background(variable),
    };
    let ((columns, rows), aspect) = if is_terminal {
        window_size_and_aspect(&terminal::query_window_size(None))
    } else {
        ((80, 24), 2.0)
    };
    let buffers = draw_images_beside_or_stacked(pictures, inks, columns, rows, aspect);
    buffers.iter().map(|buffer| buffer_to_ansi_text(buffer, depth != ColorDepth::None)).collect()
}

/// Returns the window size and cell aspect ratio, with defaults for terminals that report a size of 0.
fn window_size_and_aspect(window: &WindowSize) -> ((u16, u16), f32) {
    let size = (window.columns, window.rows);
    let aspect = Some(window.cell_aspect).filter(|aspect| aspect.is_finite());
    (if size.0 == 0 || size.1 == 0 { (80, 24) } else { size }, aspect.unwrap_or(2.0))
}

/// Draws the images in one or more rows.
fn draw_images_beside_or_stacked(
    pictures: &[NamedImage],
    inks: PreviewColorSettings<'_>,
    columns: u16,
    rows: u16,
    aspect: f32,
) -> Vec<Buffer> {
    let count = pictures.len().max(1) as u16;
    let beside = columns.saturating_sub(IMAGE_GAP * (count - 1)) / count;
    let rows = rows.saturating_sub(TEXT_ROWS).max(MIN_ROWS);
    if columns < MIN_COLUMNS {
        Vec::new()
    } else if beside >= MIN_BESIDE {
        vec![draw_images_side_by_side(pictures, inks, beside, rows, aspect)]
    } else {
        pictures.chunks(1).map(|one| draw_images_side_by_side(one, inks, columns, rows, aspect)).collect()
    }
}

/// Draws images side by side below their captions, each scaled to fit into `columns` × `rows` cells.
fn draw_images_side_by_side(
    pictures: &[NamedImage],
    inks: PreviewColorSettings<'_>,
    columns: u16,
    rows: u16,
    aspect: f32,
) -> Buffer {
    let sizes = pictures.iter().map(|one| size_in_cells(&one.picture, inks.depth, columns, rows, aspect));
    let (width, height) = sizes.fold((0, 0), |most, size| (most.0.max(size.0), most.1.max(size.1)));
    let names = pictures.iter().map(|one| text_columns(&one.name).min(columns)).max().unwrap_or(0);
    let stride = width.max(names) + IMAGE_GAP;
    let mut buffer = Buffer::empty(Rect::new(0, 0, stride * pictures.len() as u16, height + 1));
    for (x, one) in (0..).step_by(usize::from(stride)).zip(pictures) {
        buffer.set_string(x, 0, truncated_text(&one.name, columns), Style::new());
        let area = Rect::new(x, 1, width, height);
        buffer.merge(&draw_image(&one.picture, PreviewChoice::HalfBlock, inks, area, aspect));
    }
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::XTERM;

    fn laid_out_lines(size: (u16, u16), depth: ColorDepth) -> Vec<String> {
        let picture = Srgb8Image { width: 64, height: 48, pixels: vec![[200, 30, 30]; 64 * 48] };
        let named = |name: &str| NamedImage { name: name.to_owned(), picture: picture.clone() };
        let shades = ColorMapper::new(depth, &XTERM);
        let inks = PreviewColorSettings { depth, shades: &shades, is_light: false };
        let buffers = draw_images_beside_or_stacked(
            &["a.png", "b.png", "a difference image with a long name"].map(named),
            inks,
            size.0,
            size.1,
            2.0,
        );
        let text: String = buffers.iter().map(|buffer| buffer_to_ansi_text(buffer, false)).collect();
        text.lines().map(str::to_owned).collect()
    }

    fn widest(lines: &[String]) -> usize {
        lines.iter().map(|line| line.chars().count()).max().unwrap_or(0)
    }

    #[test]
    fn wide_terminals_show_images_side_by_side() {
        let lines = laid_out_lines((100, 60), ColorDepth::TrueColor);
        assert!(lines[0].starts_with("a.png ") && lines[0].contains("b.png"), "{lines:?}");
        assert_eq!((lines.len(), widest(&lines)), (1 + 12, 32 * 3 + 2 * 2), "{lines:?}");
    }

    #[test]
    fn narrow_terminals_stack_or_omit_images() {
        let lines = laid_out_lines((40, 24), ColorDepth::TrueColor);
        assert_eq!((lines.len(), lines[8].as_str()), (3 * 8, "b.png"), "{lines:?}");
        assert!(widest(&lines) <= 40, "{lines:?}");
        assert!(laid_out_lines((29, 24), ColorDepth::TrueColor).is_empty());
        assert!(!laid_out_lines((30, 1), ColorDepth::TrueColor).is_empty());
    }

    #[test]
    fn images_without_color_use_ascii_characters() {
        let lines = laid_out_lines((100, 60), ColorDepth::None);
        assert!(lines.len() > 8 && lines[1..].iter().all(|line| line.is_ascii()), "{lines:?}");
    }
}
