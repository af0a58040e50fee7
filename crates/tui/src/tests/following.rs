//! Simulates the screen during a render, on a fast terminal and over a slow connection.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::super::display::{Display, TerminalEnvironment};
use super::super::graphics::{ImageProtocol, TerminalImages, TestImageTerminal};
use super::super::presenter::FramePresenter;
use super::super::terminal_replies::TerminalReply;
use crate::color::{ColorDepth, xterm_rgb};
use crate::event::Event;
use crate::film::Srgb8Image;
use crate::fixtures::*;
use crate::mosaic::squares_of_block_character;
use crate::pipeline::protocol::{self, PreviewSlot, PreviewUpdate};
use crate::pipeline::settings::Overrides;
use crate::preview_style::PreviewStyle;

const COLUMNS: u16 = 120;
const ROWS: u16 = 40;
/// Render duration in seconds.
const SECONDS: f64 = 10.0;
const SAMPLES: f64 = 256.0;
/// Intervals between the worker's previews and between its progress reports.
const PICTURE: Duration = Duration::from_millis(66);
const PROGRESS: Duration = Duration::from_millis(60);

/// Parameters of a simulated connection.
#[derive(Clone, Copy)]
struct SimulatedConnection {
    bytes_per_second: f64,
    round_trip: Duration,
}

const FAST: SimulatedConnection =
    SimulatedConnection { bytes_per_second: 2e7, round_trip: Duration::from_millis(1) };
/// A slow 1 Mbit/s connection.
const SLOW: SimulatedConnection =
    SimulatedConnection { bytes_per_second: 125e3, round_trip: Duration::from_millis(150) };

/// A simulated terminal with its screen content and pending replies.
struct SimulatedTerminal {
    line: SimulatedConnection,
    /// Time when the connection becomes idle.
    free: Instant,
    arriving: VecDeque<(Instant, Vec<u8>)>,
    answers: VecDeque<(Instant, TerminalReply)>,
    cells: vt100::Parser,
    pixels: TestImageTerminal,
    /// The bytes that have arrived and the number of bytes sent.
    bytes: Vec<u8>,
    sent: usize,
    /// Each unacknowledged slice's reply time and size, and the peak number of unacknowledged bytes.
    unanswered: VecDeque<(Instant, usize)>,
    max_unanswered: usize,
}

impl SimulatedTerminal {
    fn new(line: SimulatedConnection, now: Instant) -> Self {
        let side = |length| std::num::NonZero::new(length).expect("not zero");
        Self {
            line,
            free: now,
            arriving: VecDeque::new(),
            answers: VecDeque::new(),
            cells: vt100::Parser::new(side(ROWS), side(COLUMNS), 0),
            pixels: TestImageTerminal::default(),
            bytes: Vec::new(),
            sent: 0,
            unanswered: VecDeque::new(),
            max_unanswered: 0,
        }
    }

    /// Sends a slice that ends with a query.
    fn send(&mut self, bytes: Vec<u8>, now: Instant) {
        let SimulatedConnection { bytes_per_second, round_trip } = self.line;
        let answer =
            if bytes.ends_with(b"\x1b[c") { TerminalReply::Attributes } else { TerminalReply::Ready };
        self.free = self.free.max(now) + Duration::from_secs_f64(bytes.len() as f64 / bytes_per_second);
        self.answers.push_back((self.free + round_trip, answer));
        self.sent += bytes.len();
        self.unanswered.push_back((self.free + round_trip, bytes.len()));
        let unanswered = self.unanswered.iter().map(|(_, bytes)| bytes).sum();
        self.max_unanswered = self.max_unanswered.max(unanswered);
        self.arriving.push_back((self.free + round_trip / 2, bytes));
    }

    /// Processes the bytes that have arrived.
    fn deliver(&mut self, now: Instant) {
        while let Some((_, bytes)) = self.arriving.pop_front_if(|(when, _)| *when <= now) {
            self.cells.process(&bytes);
            self.pixels.process_output(&bytes);
            self.bytes.extend(bytes);
        }
        while self.unanswered.pop_front_if(|(when, _)| *when <= now).is_some() {}
    }

    fn next(&self) -> Option<Instant> {
        let arriving = self.arriving.front().map(|(when, _)| *when);
        arriving.into_iter().chain(self.answers.front().map(|(when, _)| *when)).min()
    }

    /// Returns the colors of all cell parts, or of all pixels if an image is shown.
    fn visible_colors(&self) -> Vec<[u8; 3]> {
        if let Some(picture) = self.pixels.displayed_image() {
            return picture.pixels.clone();
        }
        let mut colors = Vec::new();
        for row in 1..ROWS - 3 {
            for column in 0..COLUMNS - 30 {
                let cell = self.cells.screen().cell(row, column).expect("a cell");
                colors.extend(parts(cell).into_iter().flatten());
            }
        }
        colors
    }
}

/// Colors of a block character's grid squares. `None` for other characters and default colors.
fn parts(cell: &vt100::Cell) -> Option<[[u8; 3]; 24]> {
    let color = |color| match color {
        vt100::Color::Default => None,
        vt100::Color::Idx(index) => xterm_rgb(ratatui::style::Color::Indexed(index)),
        vt100::Color::Rgb(r, g, b) => Some([r, g, b]),
    };
    let filled_squares = squares_of_block_character(cell.contents().chars().next().unwrap_or(' '))?;
    let (fg, bg) = (color(cell.fgcolor()), color(cell.bgcolor()));
    let part = |is_ink: bool| if is_ink { fg } else { bg };
    let parts = filled_squares.map(part);
    parts.iter().all(Option::is_some).then(|| parts.map(Option::unwrap_or_default))
}

/// A render displayed on a simulated terminal.
struct WatchedRender {
    ui: TestUi,
    presenter: FramePresenter,
    outbox: Rc<RefCell<Vec<Vec<u8>>>>,
    terminal: SimulatedTerminal,
    slot: PreviewSlot,
    begin: Instant,
    size: (u32, u32),
    /// Times at which the next progress report and preview are due.
    next: [Instant; 2],
    /// Number of previews drawn.
    shown: usize,
    /// Number of camera steps.
    turn: u32,
}

impl WatchedRender {
    fn new(line: SimulatedConnection, preview: PreviewStyle, depth: ColorDepth) -> Self {
        let mut ui = TestUi::from_state(state_with(COLUMNS, ROWS, preview, depth, Overrides::default()));
        let begin = ui.now;
        let generation = ui.state.request.generation;
        ui.worker_event(protocol::Event::Started { generation });
        let settings = Box::new(effective_settings());
        ui.worker_event(protocol::Event::Settings { generation, settings, own: scene_settings() });
        let size = ui.state.request.preview_size.expect("a preview size");
        let (outbox, slot) = (Rc::<RefCell<Vec<Vec<u8>>>>::default(), PreviewSlot::default());
        let images = match preview {
            PreviewStyle::Pixels(protocol) => Some(TerminalImages::new(protocol, false)),
            _ => None,
        };
        let taken = Rc::clone(&outbox);
        let out = Box::new(move |bytes| taken.borrow_mut().push(bytes));
        let display = Display::new(depth, TerminalEnvironment::default(), images, out, begin);
        Self {
            presenter: FramePresenter::new(display, slot.clone(), begin),
            ui,
            outbox,
            terminal: SimulatedTerminal::new(line, begin),
            slot,
            begin,
            size: (size.width, size.height),
            next: [begin; 2],
            shown: 0,
            turn: 0,
        }
    }

    /// Runs the simulation until `fraction` of the render is done.
    fn until(&mut self, fraction: f64) {
        let end = self.begin + Duration::from_secs_f64(SECONDS * fraction);
        self.advance(end, true);
    }

    /// Holds down a camera key for `time`. The worker produces each step's first preview soon after the step
    /// is requested.
    fn orbit(&mut self, time: Duration) {
        const REPEAT: Duration = Duration::from_millis(33);
        const FIRST: Duration = Duration::from_millis(12);
        let end = self.ui.now + time;
        let (mut key, mut last) = (self.ui.now, self.ui.state.request.generation);
        // The last step of an earlier key press may not have a preview yet.
        let mut asked = Some(self.ui.now);
        while self.ui.now < end {
            let next = asked.map_or(key, |asked: Instant| key.min(asked + FIRST));
            self.advance(next, false);
            if asked.is_some_and(|asked| self.ui.now >= asked + FIRST) {
                asked = None;
                self.turn += 1;
                self.send_preview(1.0);
            }
            if self.ui.now >= key {
                key += REPEAT;
                self.ui.press_character('l');
            }
            // A waiting step is requested once the previous one has a preview.
            if self.ui.state.request.generation > last {
                (asked, last) = (Some(self.ui.now), self.ui.state.request.generation);
            }
        }
    }

    /// Finishes drawing the final preview.
    fn finish(&mut self) {
        let generation = self.ui.state.request.generation;
        self.send_preview(SAMPLES);
        self.ui.worker_event(done_event(generation, Vec::new(), false));
        self.advance(self.ui.now + Duration::from_secs(5), false);
    }

    fn advance(&mut self, end: Instant, is_at_work: bool) {
        loop {
            let now = self.ui.now;
            self.presenter.draw_if_due(&mut self.ui.state, now);
            for event in self.presenter.send_pending(&self.ui.state, now, || false) {
                self.send_event(event);
            }
            for bytes in std::mem::take(&mut *self.outbox.borrow_mut()) {
                self.presenter.display.record_accepted_bytes(bytes.len());
                self.terminal.send(bytes, now);
            }
            let wake = self.presenter.next_action_time(&self.ui.state, now);
            let work = self.next.into_iter().filter(|_| is_at_work).min();
            let next = [wake, work, self.terminal.next()].into_iter().flatten().min().unwrap_or(end);
            if next >= end {
                self.ui.now = end;
                self.terminal.deliver(end);
                return;
            }
            self.ui.now = next.max(now);
            self.events(is_at_work);
        }
    }

    /// Handles all due events.
    fn events(&mut self, is_at_work: bool) {
        let now = self.ui.now;
        self.terminal.deliver(now);
        while let Some((_, answer)) = self.terminal.answers.pop_front_if(|(when, _)| *when <= now) {
            self.presenter.display.handle_reply(answer, now);
        }
        let done = (now - self.begin).as_secs_f64() / SECONDS;
        let generation = self.ui.state.request.generation;
        if is_at_work && now >= self.next[0] {
            self.next[0] = now + PROGRESS;
            let progress = render_progress(done, Some((1.0 - done) * SECONDS));
            let progress = protocol::RenderProgress {
                samples: (done * SAMPLES) as u32,
                mean_samples: done * SAMPLES,
                total_samples: SAMPLES as u32,
                ..progress
            };
            self.ui.worker_event(protocol::Event::Progress { generation, progress });
        }
        if is_at_work && now >= self.next[1] {
            self.next[1] = now + PICTURE;
            self.send_preview((done * SAMPLES).max(1.0));
        }
        self.ui.handle_event(Event::Tick);
    }

    fn send_preview(&mut self, samples: f64) {
        let generation = self.ui.state.request.generation;
        let picture = Arc::new(picture(self.size, samples, self.turn));
        *self.slot.lock().expect("a slot") = Some(PreviewUpdate {
            generation,
            picture,
            range: None,
            section: None,
            lacks_photons: false,
            source: None,
        });
        if let Some(event) = self.presenter.take_preview_event_if_due(generation, &self.ui.state, self.ui.now)
        {
            self.send_event(event);
        }
    }

    fn send_event(&mut self, event: Event) {
        self.shown += usize::from(matches!(event, Event::FirstPreviewSent { .. }));
        self.ui.handle_event(event);
    }
}

/// A room in muted colors, as noisy as a render with `samples` samples per pixel.
fn picture((width, height): (u32, u32), samples: f64, turn: u32) -> Srgb8Image {
    /// Noise of a single sample in code values, similar to a Cornell box.
    const NOISE: f64 = 1.2;
    let root = samples.sqrt();
    let pixel = |i: u32| {
        let column = (i % width + 3 * turn) % width;
        let (x, y) = (f64::from(column) / f64::from(width), f64::from(i / width) / f64::from(height));
        let wall = if x < 0.3 { [150.0, 40.0, 30.0] } else { [130.0, 120.0, 100.0] };
        let hash = (u64::from(i) << 20 ^ samples.to_bits()).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let channel = |c: usize| {
            let unit = f64::from((hash >> (16 * c) & 0xFFFF) as u16) / 65536.0 - 0.5;
            // The mean absolute deviation is a quarter of the distribution's width.
            (wall[c] * (0.4 + 0.6 * y) + NOISE * 4.0 * unit / root).round() as u8
        };
        [channel(0), channel(1), channel(2)]
    };
    Srgb8Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}

/// Mean difference between two screens, in code values.
fn mean_difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    assert!(!b.is_empty() && a.len() == b.len(), "{} and {} colors", a.len(), b.len());
    let all = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(a.abs_diff(*b)));
    all.sum::<f64>() / (3 * a.len()) as f64
}

/// Maximum difference from the final screen, in code values, at 10, 25 and 50 % of a render.
const MAX: [(f64, f64); 3] = [(0.1, 1.5), (0.25, 0.8), (0.5, 0.5)];

/// Checks that the screen is close to its final content at each fraction in [`MAX`], and that enough previews
/// are drawn.
#[track_caller]
fn assert_followed(preview: PreviewStyle, depth: ColorDepth) {
    let mut watch = WatchedRender::new(FAST, preview, depth);
    let screens = MAX.map(|(fraction, _)| {
        watch.until(fraction);
        watch.terminal.visible_colors()
    });
    watch.until(1.0);
    let pictures = watch.shown;
    watch.finish();
    for ((fraction, most), screen) in MAX.into_iter().zip(&screens) {
        let apart = mean_difference(screen, &watch.terminal.visible_colors());
        assert!(apart <= most, "{preview:?}, {depth:?}, at {fraction}: difference {apart}");
    }
    assert!((45..=105).contains(&pictures), "{preview:?}, {depth:?}: {pictures} previews in 10 s");
}

#[test]
fn fast_terminal_keeps_up_using_half_blocks() {
    assert_followed(PreviewStyle::HalfBlock, ColorDepth::TrueColor);
}

#[test]
fn fast_terminal_keeps_up_using_sextants() {
    assert_followed(PreviewStyle::Sextant, ColorDepth::TrueColor);
}

#[test]
fn fast_terminal_keeps_up_using_256_colors() {
    assert_followed(PreviewStyle::HalfBlock, ColorDepth::Indexed256);
}

#[test]
fn fast_terminal_keeps_up_using_pixels() {
    assert_followed(PreviewStyle::Pixels(ImageProtocol::Kitty), ColorDepth::TrueColor);
}

#[test]
fn slow_connection_gets_few_previews() {
    let mut watch = WatchedRender::new(SLOW, PreviewStyle::HalfBlock, ColorDepth::TrueColor);
    watch.until(1.0);
    assert!(watch.shown <= 12, "{} previews in 10 s", watch.shown);
    let sent = watch.terminal.sent;
    assert!(sent <= 300_000, "{sent} bytes");
    assert!(watch.terminal.max_unanswered <= 24_000, "{} bytes", watch.terminal.max_unanswered);
    let before = watch.terminal.visible_colors();
    watch.finish();
    let apart = mean_difference(&before, &watch.terminal.visible_colors());
    assert!(apart > 0.5 && apart < 4.0, "difference {apart}: only the final preview should be exact");
}

#[test]
fn held_key_uses_most_of_the_bandwidth() {
    let mut watch = WatchedRender::new(SLOW, PreviewStyle::HalfBlock, ColorDepth::TrueColor);
    watch.until(0.2);
    watch.orbit(Duration::from_secs(2));
    let before = watch.terminal.sent;
    watch.orbit(Duration::from_secs(6));
    let used = (watch.terminal.sent - before) as f64 / (6.0 * SLOW.bytes_per_second);
    assert!(used >= 0.7, "{used} of the bandwidth used");
    assert!(watch.terminal.max_unanswered <= 24_000, "{} bytes", watch.terminal.max_unanswered);
}

/// kitty 0.26 does not show images that are sent within synchronized output.
#[test]
fn only_cells_use_synchronized_output() {
    let (begin, end) = ("\x1b[?2026h", "\x1b[?2026l");
    for (preview, is_marked) in
        [(PreviewStyle::HalfBlock, true), (PreviewStyle::Pixels(ImageProtocol::Kitty), false)]
    {
        let mut watch = WatchedRender::new(FAST, preview, ColorDepth::TrueColor);
        watch.presenter.display.handle_reply(TerminalReply::Synchronized { is_known: true }, watch.begin);
        watch.until(0.1);
        let sent = String::from_utf8_lossy(&watch.terminal.bytes).into_owned();
        let between: Vec<&str> =
            sent.split(begin).skip(1).filter_map(|rest| rest.split(end).next()).collect();
        assert!(!is_marked || !between.is_empty(), "large slices of cells should be synchronized");
        assert!(between.iter().all(|part| !part.contains("\x1b_G")), "{preview:?}");
        assert_eq!(sent.contains("\x1b_G"), !is_marked, "{preview:?}");
    }
}
