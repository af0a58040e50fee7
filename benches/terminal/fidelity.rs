//! Fidelity of the terminal output to the image.
//!
//! Converts cells to pixels and compares them with the image in Oklab: directly, and blurred as if viewed by
//! an eye that cannot resolve single cells. Characters other than blocks are replaced with their mean color.
//! For comparison, also measures chafa with the same character set and its best dithering.

use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};

use glimt::film::Srgb8Image;
use glimt::math::Vec3;
use glimt::math::color::srgb8_color_to_linear;
use glimt::tui::{ColorDepth, PreviewChoice, draw_for_dark_xterm, squares_of_block_character, xterm_rgb};
use ratatui::buffer::{Buffer, Cell};
use ratatui::layout::Rect;
use ratatui::style::Color;

/// Pixels per cell: a common multiple of all subdivisions.
const CELL: (usize, usize) = (12, 24);
/// Standard deviation of the blur in pixels: a quarter of a cell's height.
const BLUR: f32 = 6.0;
const WINDOW: Rect = Rect { x: 0, y: 0, width: 80, height: 30 };
/// Default colors of the terminal.
const FOREGROUND: [u8; 3] = [229; 3];
const BACKGROUND: [u8; 3] = [0; 3];
/// Ink coverage of the ASCII characters from space to `~` on a scale of 0 to 255: the means of their DejaVu
/// Sans Mono bitmaps.
#[rustfmt::skip]
const ASCII_INK_COVERAGE: [u8; 95] = [0, 21, 16, 61, 52, 45, 58, 8, 28, 28, 24, 27, 11, 7, 7, 27, 61, 38, 44, 46, 49, 48, 58, 36, 62, 58, 14, 17, 29, 28, 29, 31, 66, 54, 68, 40, 60, 53, 43, 53, 59, 43, 39, 57, 35, 68, 68, 58, 52, 63, 62, 49, 38, 55, 47, 67, 50, 39, 48, 35, 27, 35, 17, 17, 6, 48, 54, 32, 54, 48, 37, 60, 47, 34, 36, 47, 32, 54, 40, 45, 54, 54, 26, 38, 36, 40, 34, 47, 36, 42, 36, 39, 30, 38, 15];

/// A display mode, with the corresponding settings for glimt and chafa.
struct DisplayMode {
    name: &'static str,
    preview: PreviewChoice,
    depth: ColorDepth,
    symbols: &'static str,
    colors: &'static str,
}

const HALVES: &str = "vhalf+solid+space";
const QUADRANTS: &str = "quad+half+solid+space";
const SEXTANTS: &str = "sextant+quad+half+solid+space";
const STIPPLED_HALVES: &str = "vhalf+stipple+solid+space";
const STIPPLED_QUADRANTS: &str = "quad+half+stipple+solid+space";
const STIPPLED_SEXTANTS: &str = "sextant+quad+half+stipple+solid+space";

const MODES: [DisplayMode; 16] = [
    mode("half blocks, 24 bits", PreviewChoice::HalfBlock, ColorDepth::TrueColor, HALVES, "full"),
    mode("quadrants, 24 bits", PreviewChoice::Quadrant, ColorDepth::TrueColor, QUADRANTS, "full"),
    mode("sextants, 24 bits", PreviewChoice::Sextant, ColorDepth::TrueColor, SEXTANTS, "full"),
    mode("octants, 24 bits", PreviewChoice::Octant, ColorDepth::TrueColor, "", "full"),
    mode("half blocks, 256", PreviewChoice::HalfBlock, ColorDepth::Indexed256, HALVES, "256"),
    mode("quadrants, 256", PreviewChoice::Quadrant, ColorDepth::Indexed256, QUADRANTS, "256"),
    mode("sextants, 256", PreviewChoice::Sextant, ColorDepth::Indexed256, SEXTANTS, "256"),
    mode("octants, 256", PreviewChoice::Octant, ColorDepth::Indexed256, "", "256"),
    mode("half blocks, 16", PreviewChoice::HalfBlock, ColorDepth::Ansi16, STIPPLED_HALVES, "16"),
    mode("quadrants, 16", PreviewChoice::Quadrant, ColorDepth::Ansi16, STIPPLED_QUADRANTS, "16"),
    mode("sextants, 16", PreviewChoice::Sextant, ColorDepth::Ansi16, STIPPLED_SEXTANTS, "16"),
    mode("octants, 16", PreviewChoice::Octant, ColorDepth::Ansi16, "", "16"),
    mode("ASCII, 24 bits", PreviewChoice::Ascii, ColorDepth::TrueColor, "ascii", "full"),
    mode("ASCII, 256", PreviewChoice::Ascii, ColorDepth::Indexed256, "ascii", "256"),
    mode("ASCII, 16", PreviewChoice::Ascii, ColorDepth::Ansi16, "ascii", "16"),
    mode("ASCII, no colors", PreviewChoice::Ascii, ColorDepth::None, "ascii", "none"),
];

const fn mode(
    name: &'static str,
    preview: PreviewChoice,
    depth: ColorDepth,
    symbols: &'static str,
    colors: &'static str,
) -> DisplayMode {
    DisplayMode { name, preview, depth, symbols, colors }
}

/// Prints the fidelity of every display mode for several bundled scenes.
pub(crate) fn print() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/pictures");
    println!("\nerror in {}×{} cells, sharp and blurred; chafa in parentheses", WINDOW.width, WINDOW.height);
    println!("{:<22} {:>26} {:>26} {:>26}", "", "cornell_glass", "textures", "shapes");
    for mode in MODES {
        print!("{:<22}", mode.name);
        for name in ["cornell_glass", "textures", "shapes"] {
            let file = folder.join(name).with_extension("png");
            let own = errors(&file, |picture, _| {
                Ok(Some(draw_for_dark_xterm(picture, mode.preview, mode.depth, WINDOW)))
            })?;
            let mut best: Option<[f32; 2]> = None;
            for dither in ["none", "ordered", "diffusion"] {
                let found = errors(&file, |_, area| chafa(&file, area, &mode, dither))?;
                let is_better = |found: &[f32; 2]| best.is_none_or(|best| found[1] < best[1]);
                best = found.filter(is_better).or(best);
            }
            let [sharp, blurred] = own.unwrap_or_default();
            let others = best.map_or("–".to_owned(), |[sharp, blurred]| format!("{sharp:.1} {blurred:.2}"));
            print!(" {:>26}", format!("{sharp:.1} {blurred:.2} ({others})"));
        }
        println!();
    }
    Ok(())
}

/// Returns the sharp and blurred errors of the cells that `draw` produces for an image, excluding a border.
fn errors(
    file: &Path,
    draw: impl Fn(&Srgb8Image, Rect) -> Result<Option<Buffer>, Box<dyn Error>>,
) -> Result<Option<[f32; 2]>, Box<dyn Error>> {
    let image = image::open(file)?.to_rgb8();
    let pixels = image.pixels().map(|pixel| pixel.0).collect();
    let picture = Srgb8Image { width: image.width(), height: image.height(), pixels };
    let place =
        image_area(&draw_for_dark_xterm(&picture, PreviewChoice::HalfBlock, ColorDepth::TrueColor, WINDOW));
    let Some(buffer) = draw(&picture, place)? else { return Ok(None) };
    let area = if buffer.area == WINDOW { place } else { buffer.area };
    let seen = LinearImage::from_cells(&buffer, area);
    let truth = LinearImage::from_image(&picture, seen.width, seen.height);
    Ok(Some([seen.error(&truth), seen.blurred().error(&truth.blurred())]))
}

/// Position of the image in the window.
fn image_area(buffer: &Buffer) -> Rect {
    let is_picture = |x: u16, y: u16| buffer[(x, y)].symbol() != " ";
    let columns: Vec<u16> =
        (0..buffer.area.width).filter(|x| (0..buffer.area.height).any(|y| is_picture(*x, y))).collect();
    let rows: Vec<u16> =
        (0..buffer.area.height).filter(|y| (0..buffer.area.width).any(|x| is_picture(x, *y))).collect();
    let (Some(left), Some(top)) = (columns.first(), rows.first()) else { return buffer.area };
    Rect::new(*left, *top, columns.len() as u16, rows.len() as u16)
}

/// The image as drawn by chafa. `None` if chafa is not installed or does not support the character set.
fn chafa(
    file: &Path,
    area: Rect,
    mode: &DisplayMode,
    dither: &str,
) -> Result<Option<Buffer>, Box<dyn Error>> {
    if mode.symbols.is_empty() {
        return Ok(None);
    }
    let size = format!("{}x{}", area.width, area.height);
    let output = Command::new("chafa")
        .args(["--format", "symbols", "--symbols", mode.symbols, "--colors", mode.colors, "--dither", dither])
        .args(["--work", "9", "--stretch", "--size", &size])
        .arg(file)
        .stderr(Stdio::null())
        .output();
    let Some(output) = output.ok().filter(|output| output.status.success()) else { return Ok(None) };
    let side = |length: u16| std::num::NonZero::new(length).ok_or("the window is empty");
    let mut terminal = vt100::Parser::new(side(area.height + 1)?, side(area.width)?, 0);
    let bytes: Vec<u8> = output
        .stdout
        .iter()
        .flat_map(|byte| match byte {
            b'\n' => vec![b'\r', b'\n'],
            byte => vec![*byte],
        })
        .collect();
    terminal.process(&bytes);
    let mut buffer = Buffer::empty(Rect::new(0, 0, area.width, area.height));
    for y in 0..area.height {
        for x in 0..area.width {
            if let Some(cell) = terminal.screen().cell(y, x) {
                copy(cell, &mut buffer[(x, y)]);
            }
        }
    }
    Ok(Some(buffer))
}

fn copy(from: &vt100::Cell, to: &mut Cell) {
    let color = |color| match color {
        vt100::Color::Default => Color::Reset,
        vt100::Color::Idx(index) => Color::Indexed(index),
        vt100::Color::Rgb(r, g, b) => Color::Rgb(r, g, b),
    };
    let (mut fg, mut bg) = (color(from.fgcolor()), color(from.bgcolor()));
    if from.inverse() {
        let own = |color, own: [u8; 3]| {
            if color == Color::Reset { Color::Rgb(own[0], own[1], own[2]) } else { color }
        };
        (fg, bg) = (own(bg, BACKGROUND), own(fg, FOREGROUND));
    }
    to.set_symbol(if from.has_contents() { from.contents() } else { " " }).set_fg(fg).set_bg(bg);
}

/// An image in linear light.
struct LinearImage {
    width: usize,
    height: usize,
    pixels: Vec<Vec3>,
}

impl LinearImage {
    fn from_cells(buffer: &Buffer, area: Rect) -> Self {
        let (width, height) = (usize::from(area.width) * CELL.0, usize::from(area.height) * CELL.1);
        let pixel = |i: usize| {
            let (x, y) = (i % width, i / width);
            let cell = &buffer[(area.x + (x / CELL.0) as u16, area.y + (y / CELL.1) as u16)];
            let place = y % CELL.1 / (CELL.1 / 12) * 2 + x % CELL.0 / (CELL.0 / 2);
            let symbol = cell.symbol().chars().next().unwrap_or(' ');
            let [ink, ground] =
                [xterm_rgb(cell.fg).unwrap_or(FOREGROUND), xterm_rgb(cell.bg).unwrap_or(BACKGROUND)];
            let [ink, ground] = [ink, ground].map(srgb8_color_to_linear);
            let part = match (squares_of_block_character(symbol), (symbol as usize).checked_sub(0x20)) {
                (Some(filled_squares), _) => f32::from(u8::from(filled_squares[place])),
                (None, Some(number)) => {
                    ASCII_INK_COVERAGE.get(number).map_or(0.0, |ink| f32::from(*ink) / 255.0)
                }
                (None, None) => 0.0,
            };
            ground + (ink - ground) * part
        };
        Self { width, height, pixels: (0..width * height).map(pixel).collect() }
    }

    fn from_image(picture: &Srgb8Image, width: usize, height: usize) -> Self {
        let linear = picture.pixels.iter().map(|pixel| srgb8_color_to_linear(*pixel)).collect();
        let image =
            glimt::film::RadianceImage { width: picture.width, height: picture.height, pixels: linear };
        let pixels = image.resized(width as u32, height as u32).pixels;
        Self { width, height, pixels }
    }

    /// Gaussian blur, first along rows, then along columns.
    fn blurred(&self) -> Self {
        let reach = (3.0 * BLUR) as isize;
        let weights: Vec<f32> = (-reach..=reach).map(|i| (-(i as f32 / BLUR).powi(2) / 2.0).exp()).collect();
        let all: f32 = weights.iter().sum();
        let along = |pixels: &[Vec3], step: [isize; 2]| -> Vec<Vec3> {
            let at = |x: isize, y: isize| {
                let x = x.clamp(0, self.width as isize - 1) as usize;
                let y = y.clamp(0, self.height as isize - 1) as usize;
                pixels[y * self.width + x]
            };
            let mean = |i: usize| {
                let (x, y) = ((i % self.width) as isize, (i / self.width) as isize);
                let offsets = (-reach..=reach).zip(&weights);
                offsets.map(|(i, weight)| at(x + i * step[0], y + i * step[1]) * *weight).sum::<Vec3>() / all
            };
            (0..pixels.len()).map(mean).collect()
        };
        let pixels = along(&along(&self.pixels, [1, 0]), [0, 1]);
        Self { pixels, ..*self }
    }

    /// Returns the RMS distance in Oklab, as a percentage of the distance from black to white.
    fn error(&self, other: &Self) -> f32 {
        let squares = self
            .pixels
            .iter()
            .zip(&other.pixels)
            .map(|(a, b)| f64::from(oklab(*a).distance_squared(oklab(*b))));
        100.0 * (squares.sum::<f64>() / self.pixels.len() as f64).sqrt() as f32
    }
}

fn oklab(linear: Vec3) -> Vec3 {
    let rows = |rows: [[f32; 3]; 3], v: Vec3| Vec3::from_array(rows.map(|row| Vec3::from_array(row).dot(v)));
    let cones = rows(
        [
            [0.412_221_46, 0.536_332_55, 0.051_445_995],
            [0.211_903_5, 0.680_699_5, 0.107_396_96],
            [0.088_302_46, 0.281_718_85, 0.629_978_7],
        ],
        linear.max(Vec3::ZERO),
    );
    rows(
        [
            [0.210_454_26, 0.793_617_8, -0.004_072_047],
            [1.977_998_5, -2.428_592_2, 0.450_593_7],
            [0.025_904_037, 0.782_771_77, -0.808_675_77],
        ],
        Vec3::from_array(cones.to_array().map(f32::cbrt)),
    )
}
