//! Number of bytes sent to the terminal for a bundled scene's first preview, whole render, and edits.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, PoisonError};

use glimt::film::Srgb8Image;
use glimt::pipeline::WorkerHandle;
use glimt::pipeline::protocol::{Command, Event, PreviewBounds, Request};
use glimt::pipeline::settings::Overrides;
use glimt::tui::ColorDepth;
use glimt::tui::paint::{Painter, PreviewFidelity};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Color;

/// Window sizes, and the preview sizes next to the side panel.
const SIZES: [(Rect, PreviewBounds); 3] = [
    (Rect { x: 0, y: 0, width: 80, height: 24 }, PreviewBounds { width: 60, height: 40, around: None }),
    (Rect { x: 0, y: 0, width: 120, height: 40 }, PreviewBounds { width: 90, height: 72, around: None }),
    (Rect { x: 0, y: 0, width: 200, height: 60 }, PreviewBounds { width: 170, height: 112, around: None }),
];
/// Width and height of the film. Larger images have less noise in their previews.
const FILM: u32 = 320;

/// Renders previews, one scene at a time.
struct PreviewRenderer {
    handle: WorkerHandle,
    events: Receiver<Event>,
    preview: PreviewBounds,
    generation: u64,
    folder: tempfile::TempDir,
}

impl PreviewRenderer {
    fn new(preview: PreviewBounds) -> Self {
        let (handle, events) = glimt::pipeline::start_worker_with_channel(0).expect("a worker");
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { handle, events, preview, generation: 0, folder }
    }

    /// Returns the last preview of a scene. If `samples` is `None`, this is the coarse preview with one
    /// sample per preview pixel.
    fn preview(&mut self, scene: &str, samples: Option<u32>) -> Srgb8Image {
        let path: PathBuf = self.folder.path().join("scene.toml");
        std::fs::write(&path, scene).expect("written");
        let side = if samples.is_some() { FILM } else { self.preview.height };
        let overrides = Overrides {
            width: Some(side),
            height: Some(side),
            samples: Some(samples.unwrap_or(1)),
            ..Overrides::default()
        };
        self.generation += 1;
        let request = Request::new(self.generation, path, overrides);
        let request = Request { preview: Some(self.preview), ..request };
        self.handle.send(Command::Render(Box::new(request)));
        for event in &self.events {
            assert!(!matches!(event, Event::Failed { .. }), "{event:?}");
            if matches!(event, Event::Done { generation, .. } if generation == self.generation) {
                break;
            }
        }
        let latest = self.handle.previews.lock().unwrap_or_else(PoisonError::into_inner).take();
        Arc::unwrap_or_clone(latest.expect("a preview").picture)
    }

    /// All previews of a render.
    fn pictures(&mut self, scene: &str) -> Vec<(Srgb8Image, PreviewFidelity)> {
        let steps = [
            (None, PreviewFidelity::First),
            (Some(1), PreviewFidelity::Moving),
            (Some(2), PreviewFidelity::Moving),
            (Some(4), PreviewFidelity::Moving),
            (Some(16), PreviewFidelity::Moving),
            (Some(32), PreviewFidelity::Still),
        ];
        steps.map(|(samples, fidelity)| (self.preview(scene, samples), fidelity)).into()
    }
}

/// A painter and the terminal it writes to.
struct PaintedScreen {
    window: Rect,
    painter: Painter,
    terminal: vt100::Parser,
}

impl PaintedScreen {
    fn new(window: Rect) -> Self {
        let side = |length| std::num::NonZero::new(length).expect("not zero");
        let terminal = vt100::Parser::new(side(window.height), side(window.width), 0);
        Self { window, painter: Painter::new(ColorDepth::TrueColor), terminal }
    }

    /// Shows an image. Returns the number of bytes sent.
    fn show(&mut self, picture: &Srgb8Image, fidelity: PreviewFidelity) -> usize {
        let mut buffer = Buffer::empty(self.window);
        let place = Rect::new(2, 1, picture.width as u16, picture.height.div_ceil(2) as u16);
        for y in 0..place.height {
            for x in 0..place.width {
                let color = |row: u16| {
                    let [r, g, b] =
                        picture.pixels[usize::from(row) * picture.width as usize + usize::from(x)];
                    Color::Rgb(r, g, b)
                };
                let cell = &mut buffer[(x + place.x, y + place.y)];
                cell.set_symbol("▀").set_fg(color(2 * y)).set_bg(color(2 * y + 1));
            }
        }
        self.painter.set_target(&buffer, place, fidelity);
        let mut sent = 0;
        loop {
            let bytes = self.painter.next_slice(8192);
            if bytes.is_empty() {
                return sent;
            }
            self.terminal.process(&bytes);
            sent += bytes.len();
        }
    }

    /// The largest channel difference between the screen and an image.
    fn difference(&self, picture: &Srgb8Image) -> u8 {
        let pixels = picture.pixels.iter().enumerate();
        let off = pixels.map(|(i, wanted)| {
            let (x, y) = (i % picture.width as usize, i / picture.width as usize);
            let cell = self.terminal.screen().cell(y as u16 / 2 + 1, x as u16 + 2).expect("a cell");
            let is_upper = y % 2 == 0;
            let color = match cell.contents() {
                "▀" if is_upper => cell.fgcolor(),
                "▄" if !is_upper => cell.fgcolor(),
                "█" => cell.fgcolor(),
                _ => cell.bgcolor(),
            };
            let shown = rgb(color);
            (0..3).map(|k| shown[k].abs_diff(wanted[k])).max().unwrap_or(0)
        });
        off.max().unwrap_or(0)
    }
}

/// RGB value of a color in xterm's palette.
fn rgb(color: vt100::Color) -> [u8; 3] {
    match color {
        vt100::Color::Rgb(r, g, b) => [r, g, b],
        vt100::Color::Idx(index @ 232..) => [8 + 10 * (index - 232); 3],
        vt100::Color::Idx(index @ 16..) => {
            let index = usize::from(index - 16);
            [index / 36, index / 6 % 6, index % 6].map(|step| [0, 95, 135, 175, 215, 255][step])
        }
        other => unreachable!("{other:?} is not an image color"),
    }
}

fn scene(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    std::fs::read_to_string(path).expect("a bundled scene")
}

/// Number of cells in which a color channel differs by more than 1.
fn count_changed_cells(a: &Srgb8Image, b: &Srgb8Image) -> usize {
    let width = a.width as usize;
    let is_off = |i: usize| (0..3).any(|k| a.pixels[i][k].abs_diff(b.pixels[i][k]) > 1);
    let tops = (0..a.pixels.len()).filter(|i| (i / width).is_multiple_of(2));
    tops.filter(|i| is_off(*i) || is_off(i + width)).count()
}

/// Shows all previews of a render. Returns the number of bytes for the first preview and for all
/// previews.
fn show_all(screen: &mut PaintedScreen, pictures: &[(Srgb8Image, PreviewFidelity)]) -> (usize, usize) {
    let sent: Vec<usize> =
        pictures.iter().map(|(picture, fidelity)| screen.show(picture, *fidelity)).collect();
    let (last, _) = pictures.last().expect("pictures");
    let off = screen.difference(last);
    assert!(off <= 1, "the screen differs from the last image by {off}");
    assert_eq!(screen.show(last, PreviewFidelity::Still), 0, "an unchanged image must send nothing");
    (sent[0], sent.iter().sum())
}

#[test]
fn renders_and_edits_stay_within_byte_budgets() {
    let green = "green = { diffuse = [0.13, 0.45, 0.09] }";
    let red = "red = { diffuse = [0.70, 0.13, 0.10]";
    let edits = [
        ("cornell.toml", green, "green = { diffuse = [0.13, 0.25, 0.39] }"),
        ("cornell.toml", "size = [0.6, 0.6, 0.6]", "size = [0.6, 0.75, 0.6]"),
        ("spheres.toml", red, "red = { diffuse = [0.20, 0.53, 0.10]"),
        ("spheres.toml", "position = [0, 1.3, 5.5]", "position = [0.2, 1.4, 5.5]"),
    ];
    for ((window, preview), (name, from, to)) in SIZES.iter().flat_map(|size| edits.map(|edit| (*size, edit)))
    {
        let place = format!("{name}, {to}, at {}×{}", window.width, window.height);
        let (before, mut studio, mut screen) =
            (scene(name), PreviewRenderer::new(preview), PaintedScreen::new(window));
        assert!(before.contains(from), "{name} does not contain `{from}`");
        let old = studio.pictures(&before);
        let new = studio.pictures(&before.replace(from, to));
        let [(old_last, _), (new_last, _)] = [&old, &new].map(|pictures| pictures.last().expect("pictures"));
        let cells = old_last.pixels.len() / 2;
        let (first, all) = show_all(&mut screen, &old);
        assert!(first <= 12 * cells, "{place}: {first} bytes for the first preview with {cells} cells");
        assert!(all <= 48 * cells, "{place}: {all} bytes for {cells} cells");
        let edited = count_changed_cells(old_last, new_last);
        let (_, all) = show_all(&mut screen, &new);
        assert!(edited > 0 && all <= 48 * edited, "{place}: {all} bytes for {edited} changed cells");
    }
}
