//! glimt in a pseudo-terminal at one end of a connection, and a screen at the other end.

use std::error::Error;
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use glimt::tui::{TestImageTerminal, squares_of_block_character, xterm_rgb};
use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use ratatui::style::Color;

pub(crate) const COLUMNS: u16 = 120;
pub(crate) const ROWS: u16 = 40;
/// Width and height of a cell in pixels.
const CELL: (u16, u16) = (8, 16);
/// Timeout for all waits.
const LIMIT: Duration = Duration::from_secs(600);
/// Answers to terminal queries: status, device attributes, and synchronized output.
const ANSWERS: [(&[u8], &[u8]); 3] =
    [(b"\x1b[5n", b"\x1b[0n"), (b"\x1b[c", b"\x1b[?62;4;22c"), (b"\x1b[?2026$p", b"\x1b[?2026;2$y")];

/// A connection to the terminal.
#[derive(Clone, Copy)]
pub(crate) struct Connection {
    pub(crate) bytes_per_second: f64,
    /// One-way delay.
    pub(crate) delay: Duration,
}

impl Connection {
    /// A connection to a terminal on the same machine.
    pub(crate) const NONE: Self = Self { bytes_per_second: f64::INFINITY, delay: Duration::ZERO };
    /// 1 Mbit/s with a round-trip time of 150 ms.
    pub(crate) const SLOW: Self = Self { bytes_per_second: 125e3, delay: Duration::from_millis(75) };
}

/// Byte counts and the screen at the far end.
pub(crate) struct FarEnd {
    pub(crate) cells: vt100::Parser,
    pub(crate) pixels: TestImageTerminal,
    /// Number of bytes received.
    pub(crate) came: usize,
    /// Number of bytes sent in total, and before the last answered query.
    sent: usize,
    answered: usize,
    pub(crate) max_unanswered: usize,
}

impl FarEnd {
    /// Colors of the image's pixels, or of its cell subdivisions.
    pub(crate) fn colors(&self) -> Vec<[u8; 3]> {
        if let Some(picture) = self.pixels.displayed_image() {
            return picture.pixels.clone();
        }
        let (rows, columns) = self.cells.screen().size();
        let places = (1..rows.get()).flat_map(|row| (0..columns.get()).map(move |column| (row, column)));
        let cells = places.filter_map(|(row, column)| self.cells.screen().cell(row, column));
        cells.flat_map(parts).collect()
    }

    /// Returns the progress shown on the screen, in percent; 100 once the render has finished.
    pub(crate) fn percent(&self) -> Option<u32> {
        let row =
            self.cells.screen().rows(0, COLUMNS).find(|row| row.contains("glimt") || !row.is_empty())?;
        if row.contains("✓ done") || row.contains("! unwritten") {
            return Some(100);
        }
        let words: Vec<&str> = row.split_whitespace().collect();
        let place = words.iter().position(|word| *word == "%")?;
        words.get(place.checked_sub(1)?)?.parse().ok()
    }
}

/// Colors of a cell's subdivisions. Characters other than blocks count as black, so that all screens have the
/// same number of colors.
fn parts(cell: &vt100::Cell) -> [[u8; 3]; 24] {
    let color = |color| match color {
        vt100::Color::Default => None,
        vt100::Color::Idx(index) => xterm_rgb(Color::Indexed(index)),
        vt100::Color::Rgb(r, g, b) => Some([r, g, b]),
    };
    let (fg, bg) = (color(cell.fgcolor()), color(cell.bgcolor()));
    let filled_squares =
        squares_of_block_character(cell.contents().chars().next().unwrap_or(' ')).unwrap_or([false; 24]);
    filled_squares.map(|is_ink| if is_ink { fg } else { bg }.unwrap_or_default())
}

/// A terminal running the program.
pub(crate) struct WatchedTerminal {
    // Keeps the terminal open.
    _master: Box<dyn MasterPty + Send>,
    child: Box<dyn Child + Send + Sync>,
    keys: Arc<Mutex<Box<dyn Write + Send>>>,
    far: Arc<Mutex<FarEnd>>,
}

impl WatchedTerminal {
    /// Starts a command in a folder.
    pub(crate) fn open(command: &[&str], folder: &Path, line: Connection) -> Result<Self, Box<dyn Error>> {
        let size =
            PtySize { rows: ROWS, cols: COLUMNS, pixel_width: COLUMNS * CELL.0, pixel_height: ROWS * CELL.1 };
        let pair = native_pty_system().openpty(size)?;
        let mut builder = CommandBuilder::new(command[0]);
        builder.args(&command[1..]);
        builder.cwd(folder);
        for name in ["NO_COLOR", "TMUX", "TERM_PROGRAM", "SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY"] {
            builder.env_remove(name);
        }
        builder.env("TERM", "xterm-256color");
        builder.env("COLORTERM", "truecolor");
        let child = pair.slave.spawn_command(builder)?;
        let keys = Arc::new(Mutex::new(pair.master.take_writer()?));
        let side = |length| NonZeroU16::new(length).ok_or("the terminal has no cells");
        let far = Arc::new(Mutex::new(FarEnd {
            cells: vt100::Parser::new(side(ROWS)?, side(COLUMNS)?, 0),
            pixels: TestImageTerminal::default(),
            came: 0,
            sent: 0,
            answered: 0,
            max_unanswered: 0,
        }));
        simulate_connection(pair.master.try_clone_reader()?, far.clone(), keys.clone(), line);
        Ok(Self { _master: pair.master, child, keys, far })
    }

    /// Types characters.
    pub(crate) fn press(&self, keys: &str) -> Result<(), Box<dyn Error>> {
        Ok(lock(&self.keys).write_all(keys.as_bytes())?)
    }

    /// The state at the far end.
    pub(crate) fn far_end(&self) -> MutexGuard<'_, FarEnd> {
        lock(&self.far)
    }

    /// Waits until the far end satisfies `holds`.
    pub(crate) fn wait(&self, what: &str, holds: impl Fn(&FarEnd) -> bool) -> Result<(), Box<dyn Error>> {
        let deadline = Instant::now() + LIMIT;
        while !holds(&self.far_end()) {
            if Instant::now() > deadline {
                let screen = self.far_end().cells.screen().contents();
                return Err(format!("timed out waiting for {what}\n{screen}").into());
            }
            thread::sleep(Duration::from_millis(2));
        }
        Ok(())
    }
}

impl Drop for WatchedTerminal {
    fn drop(&mut self) {
        // The measurement is complete, so ignore a failure to stop the program.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Bytes with their arrival time.
type DelayedBytes = (Instant, Vec<u8>);

/// Simulates the connection: delays output on its way to the far end, and answers on the way back.
fn simulate_connection(
    mut output: Box<dyn Read + Send>,
    far: Arc<Mutex<FarEnd>>,
    keys: Arc<Mutex<Box<dyn Write + Send>>>,
    line: Connection,
) {
    let ((down, arriving), (up, rising)) =
        (channel::<DelayedBytes>(), channel::<(Instant, usize, &'static [u8])>());
    let at_end = far.clone();
    thread::spawn(move || process_arrivals(&arriving, &at_end, &up, line.delay));
    let at_start = far.clone();
    thread::spawn(move || {
        while let Ok((when, asked, answer)) = rising.recv() {
            thread::sleep(when.saturating_duration_since(Instant::now()));
            lock(&at_start).answered = asked;
            if lock(&keys).write_all(answer).is_err() {
                return;
            }
        }
    });
    thread::spawn(move || {
        let (mut bytes, mut free) = ([0; 1 << 12], Instant::now());
        while let Ok(count @ 1..) = output.read(&mut bytes) {
            let now = Instant::now();
            {
                let mut far = lock(&far);
                far.sent += count;
                far.max_unanswered = far.max_unanswered.max(far.sent - far.answered);
            }
            for part in bytes[..count].chunks(1 << 10) {
                free = free.max(now) + Duration::from_secs_f64(part.len() as f64 / line.bytes_per_second);
                if down.send((free + line.delay, part.to_vec())).is_err() {
                    return;
                }
            }
        }
    });
}

fn process_arrivals(
    arriving: &Receiver<DelayedBytes>,
    far: &Mutex<FarEnd>,
    up: &Sender<(Instant, usize, &'static [u8])>,
    delay: Duration,
) {
    let mut tail = Vec::new();
    while let Ok((when, bytes)) = arriving.recv() {
        thread::sleep(when.saturating_duration_since(Instant::now()));
        let mut far = lock(far);
        far.cells.process(&bytes);
        far.pixels.process_output(&bytes);
        for byte in bytes {
            far.came += 1;
            tail.push(byte);
            if let Some((_, answer)) = ANSWERS.iter().find(|(question, _)| tail.ends_with(question)) {
                // Ignore errors: the program may have exited.
                let _ = up.send((Instant::now() + delay, far.came, *answer));
            }
            if tail.len() > 64 {
                tail.drain(..48);
            }
        }
    }
}
