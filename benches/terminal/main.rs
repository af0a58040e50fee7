//! Measures the number of bytes sent to the terminal.
//!
//! `cargo bench --bench terminal` renders bundled scenes and edited versions, replays their previews as
//! the front end receives them, and prints the number of bytes sent by glimt's painter. For comparison, it
//! does the same for plain ratatui on crossterm, which draws every preview, and for chafa (if installed),
//! which draws only the last preview. `-- fidelity` prints the fidelity of the output for each color depth
//! and character set. `-- follow` prints the difference between a fast terminal's screen during a render and
//! its final screen. `-- orbit` prints the utilization of a slow connection while a key moves the camera.

#![allow(clippy::print_stdout)]

mod fidelity;
mod follow;
mod orbit;
mod others;
mod sequence;
mod watched;

use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use glimt::film::Srgb8Image;
use glimt::pipeline::protocol::PreviewBounds;
use glimt::tui::ColorDepth;
use glimt::tui::paint::{PacingDecision, PacingInputs, Painter, PreviewFidelity, preview_pacing_decision};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Color;

use crate::others::{PlainRatatui, chafa};
use crate::sequence::RecordedPreview;

/// Columns and rows of the window. The image is slightly smaller.
const WINDOWS: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];
const SIDE_COLUMNS: u16 = 30;
const OUTER_ROWS: u16 = 4;
/// Maximum channel difference that does not count as a change.
const MAX_UNCHANGED_DIFFERENCE: u8 = 1;

/// An edit to save after the scene has been rendered.
struct Edit {
    scene: &'static str,
    name: &'static str,
    from: &'static str,
    to: &'static str,
}

const EDITS: [Edit; 6] = [
    Edit {
        scene: "cornell",
        name: "material",
        from: "green = { diffuse = [0.13, 0.45, 0.09] }",
        to: "green = { diffuse = [0.13, 0.25, 0.39] }",
    },
    Edit { scene: "cornell", name: "object", from: "size = [0.6, 0.6, 0.6]", to: "size = [0.6, 0.75, 0.6]" },
    Edit {
        scene: "spheres",
        name: "camera",
        from: "position = [0, 1.3, 5.5]",
        to: "position = [0.2, 1.4, 5.5]",
    },
    Edit {
        scene: "spheres",
        name: "material",
        from: "red = { diffuse = [0.70, 0.13, 0.10]",
        to: "red = { diffuse = [0.20, 0.53, 0.10]",
    },
    Edit { scene: "mesh", name: "light", from: "emission = [16, 15.2, 14]", to: "emission = [19, 13.2, 10]" },
    Edit {
        scene: "textures",
        name: "camera",
        from: "position = [0, 1.6, 5.6]",
        to: "position = [0.3, 1.6, 5.6]",
    },
];

fn main() -> Result<(), Box<dyn Error>> {
    let is_asked = |name: &str| std::env::args().any(|argument| argument == name);
    if is_asked("fidelity") {
        return fidelity::print();
    }
    if is_asked("follow") {
        return follow::print();
    }
    if is_asked("orbit") {
        return orbit::print();
    }
    for (columns, rows) in WINDOWS {
        println!("\n{columns}×{rows}: bytes per cell (ratatui and chafa in parentheses)");
        println!(
            "{:<18} {:>6} {:>6} {:>16} {:>6} {:>7} {:>7} {:>15}",
            "", "cells", "first", "exact", "ms", "pictures", "changed", "until still"
        );
        for edit in EDITS {
            replay(&edit, columns, rows)?;
        }
    }
    Ok(())
}

/// Renders a scene and its edited version, and prints a line for each.
fn replay(edit: &Edit, columns: u16, rows: u16) -> Result<(), Box<dyn Error>> {
    let size = PreviewBounds {
        width: u32::from(columns - SIDE_COLUMNS),
        height: 2 * u32::from(rows - OUTER_ROWS),
        around: None,
    };
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let text = fs::read_to_string(scenes.join(edit.scene).with_extension("toml"))?;
    if !text.contains(edit.from) {
        return Err(format!("{} does not contain `{}`", edit.scene, edit.from).into());
    }
    // Write the file next to the scenes so that relative paths work.
    let scene = tempfile::Builder::new().prefix("bench").suffix(".toml").tempfile_in(&scenes)?;
    let worker = glimt::pipeline::start_worker_with_channel(0)?;
    let mut window = Window::new(columns, rows);
    for (generation, name, text) in
        [(1, "start", text.clone()), (2, edit.name, text.replace(edit.from, edit.to))]
    {
        fs::write(scene.path(), text)?;
        let shots = sequence::render(&worker, generation, scene.path(), size)?;
        let line = window.show(&shots)?;
        println!("{:<18} {line}", format!("{} {name}", edit.scene));
    }
    window.settle();
    Ok(())
}

/// A window that both glimt and plain ratatui draw.
struct Window {
    area: Rect,
    painter: Painter,
    plain: PlainRatatui,
    /// Image on the screen.
    last: Option<Srgb8Image>,
}

impl Window {
    fn new(columns: u16, rows: u16) -> Self {
        let area = Rect::new(0, 0, columns, rows);
        Self {
            area,
            painter: Painter::new(ColorDepth::TrueColor),
            plain: PlainRatatui::new(area),
            last: None,
        }
    }

    /// Shows the previews of one render, skipping those not worth drawing.
    fn show(&mut self, shots: &[RecordedPreview]) -> Result<String, Box<dyn Error>> {
        let (Some(first), Some(last)) = (shots.first(), shots.last()) else {
            return Err("no preview".into());
        };
        let cells = changed(None, &last.picture);
        let changed = changed(self.last.as_ref(), &last.picture);
        let begin = Instant::now();
        let first_bytes = self.aim(&first.picture, PreviewFidelity::First);
        let milliseconds = begin.elapsed().as_secs_f64() * 1e3;
        let (mut bytes, mut pictures) = (first_bytes, 1);
        let (mut aimed, mut at) = (first.samples, first.seconds);
        for shot in &shots[1..] {
            let moment = PacingInputs {
                bytes_per_second: None,
                cells: cells as u32,
                samples: shot.samples,
                aimed_samples: Some(aimed),
                since_aim: Duration::from_secs_f64(shot.seconds - at),
                is_shown: true,
                is_fast: false,
                is_in_pixels: false,
                is_final: shot.is_final,
                final_in: None,
            };
            if let PacingDecision::Aim(fidelity) = preview_pacing_decision(&moment) {
                (aimed, at) = (shot.samples, shot.seconds);
                bytes += self.aim(&shot.picture, fidelity);
                pictures += 1;
            }
        }
        let plain: usize = shots.iter().map(|shot| self.plain.draw(&self.cells(&shot.picture).0)).sum();
        let exact = self.exact(&last.picture);
        let (plain_exact, chafa_exact) = self.bytes_of_other_programs(&last.picture)?;
        self.last = Some(last.picture.clone());
        let by = |bytes: usize, cells: usize| bytes as f64 / cells.max(1) as f64;
        let chafa = chafa_exact.map_or("–".to_owned(), |bytes| format!("{:.0}", by(bytes, cells)));
        Ok(format!(
            "{cells:>6} {:>6.1} {:>7.1} ({:.0}, {chafa}) {milliseconds:>6.1} {:>7} {changed:>7} {:>7.1} ({:.0})",
            by(first_bytes, changed),
            by(exact, cells),
            by(plain_exact, cells),
            format!("{pictures}/{}", shots.len()),
            by(bytes, changed),
            by(plain, changed),
        ))
    }

    /// Recolors a rectangle with 5 % of the cells, then adds noise, then changes nothing.
    fn settle(&mut self) {
        let Some(last) = self.last.take() else { return };
        let (width, height) = (last.width, last.height);
        let share = 0.05_f64.sqrt();
        let (across, down) = ((f64::from(width) * share) as u32, (f64::from(height) * share) as u32);
        let mut other = last;
        for y in height / 3..height / 3 + down {
            for x in width / 3..width / 3 + across {
                let pixel = &mut other.pixels[(y * width + x) as usize];
                *pixel = [pixel[2], 255 - pixel[1], pixel[0]];
            }
        }
        let rectangle = (self.aim(&other, PreviewFidelity::Still), self.plain.draw(&self.cells(&other).0));
        let mut noisy = other.clone();
        for (i, channel) in noisy.pixels.as_flattened_mut().iter_mut().enumerate() {
            let step = ((i as u32).wrapping_mul(2_654_435_761) >> 16) % 5;
            *channel = (*channel).saturating_add(step as u8).saturating_sub(2);
        }
        let noise = (self.aim(&noisy, PreviewFidelity::Moving), self.plain.draw(&self.cells(&noisy).0));
        let idle = (self.aim(&noisy, PreviewFidelity::Moving), self.plain.draw(&self.cells(&noisy).0));
        println!(
            "{:<18} 5 % in a rectangle {} B ({}), noise of ±2 {} B ({}), idle {} B ({})",
            "  then", rectangle.0, rectangle.1, noise.0, noise.1, idle.0, idle.1
        );
    }

    /// Bytes required to draw an image on a screen with unknown contents.
    fn exact(&self, picture: &Srgb8Image) -> usize {
        let mut painter = Painter::new(ColorDepth::TrueColor);
        let (buffer, place) = self.cells(picture);
        painter.set_target(&buffer, place, PreviewFidelity::Still);
        drain(&mut painter)
    }

    fn bytes_of_other_programs(
        &self,
        picture: &Srgb8Image,
    ) -> Result<(usize, Option<usize>), Box<dyn Error>> {
        Ok((PlainRatatui::new(self.area).draw(&self.cells(picture).0), chafa(picture)?))
    }

    fn aim(&mut self, picture: &Srgb8Image, fidelity: PreviewFidelity) -> usize {
        let (buffer, place) = self.cells(picture);
        self.painter.set_target(&buffer, place, fidelity);
        drain(&mut self.painter)
    }

    /// The image as half blocks, and its position.
    fn cells(&self, picture: &Srgb8Image) -> (Buffer, Rect) {
        let mut buffer = Buffer::empty(self.area);
        let place = Rect::new(0, 1, picture.width as u16, picture.height.div_ceil(2) as u16);
        let color = |x: u16, y: u32| {
            let pixel = picture.pixels.get((y * picture.width) as usize + usize::from(x));
            pixel.map_or(Color::Reset, |[r, g, b]| Color::Rgb(*r, *g, *b))
        };
        for y in 0..place.height {
            for x in 0..place.width {
                let row = 2 * u32::from(y);
                buffer[(x, y + place.y)].set_symbol("▀").set_fg(color(x, row)).set_bg(color(x, row + 1));
            }
        }
        (buffer, place)
    }
}

/// Sends all pending output of the painter. Returns the number of bytes.
fn drain(painter: &mut Painter) -> usize {
    std::iter::from_fn(|| Some(painter.next_slice(24_000).len()).filter(|bytes| *bytes > 0)).sum()
}

/// Returns the number of cells that differ, or of all cells if nothing was shown before.
fn changed(before: Option<&Srgb8Image>, after: &Srgb8Image) -> usize {
    let width = after.width as usize;
    let differs = |i: usize| match before.and_then(|before| before.pixels.get(i)) {
        Some(old) => after
            .pixels
            .get(i)
            .is_some_and(|new| (0..3).any(|k| old[k].abs_diff(new[k]) > MAX_UNCHANGED_DIFFERENCE)),
        None => true,
    };
    let rows = (after.height as usize).div_ceil(2);
    let cells = (0..rows * width).map(|cell| 2 * (cell / width) * width + cell % width);
    cells.filter(|i| differs(*i) || differs(i + width)).count()
}
