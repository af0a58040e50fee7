//! A terminal that timestamps incoming bytes and parses them later, so as not to slow the program during a
//! measurement.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};

use super::BenchResult;

/// Timeout for all waits.
const LIMIT: Duration = Duration::from_secs(20);

/// Timestamped output of the program.
type Chunk = (Instant, Vec<u8>);

/// glimt running in a true-color pseudo-terminal.
pub struct TimedTerminal {
    // Keeps the terminal open.
    _master: Box<dyn MasterPty + Send>,
    child: Box<dyn Child + Send + Sync>,
    keys: Arc<Mutex<Box<dyn Write + Send>>>,
    chunks: Arc<Mutex<Vec<Chunk>>>,
    screen: vt100::Parser,
}

/// The colors of every image cell, or `None` for cells with text.
pub type Cells = Vec<Option<[[u8; 3]; 2]>>;

impl TimedTerminal {
    /// Starts the program in a folder.
    pub fn open(folder: &Path, arguments: &[&str], columns: u16, rows: u16) -> BenchResult<Self> {
        let size = PtySize { rows, cols: columns, pixel_width: 0, pixel_height: 0 };
        let pair = native_pty_system().openpty(size)?;
        let program = std::env::var("GLIMT").unwrap_or(env!("CARGO_BIN_EXE_glimt").to_owned());
        let mut command = CommandBuilder::new(program);
        command.args(arguments);
        command.cwd(folder);
        for name in ["NO_COLOR", "TMUX", "TERM_PROGRAM"] {
            command.env_remove(name);
        }
        command.env("TERM", "xterm-256color");
        command.env("COLORTERM", "truecolor");
        let child = pair.slave.spawn_command(command)?;
        let keys = Arc::new(Mutex::new(pair.master.take_writer()?));
        let chunks = Arc::<Mutex<Vec<Chunk>>>::default();
        read(pair.master.try_clone_reader()?, chunks.clone(), keys.clone());
        let side = |length| NonZeroU16::new(length).ok_or("the terminal has no cells");
        let screen = vt100::Parser::new(side(rows)?, side(columns)?, 0);
        Ok(Self { _master: pair.master, child, keys, chunks, screen })
    }

    /// Types characters.
    pub fn press(&self, keys: &str) -> BenchResult<()> {
        Ok(lock(&self.keys).write_all(keys.as_bytes())?)
    }

    /// Waits until the screen satisfies `holds`.
    pub fn wait(&mut self, what: &str, holds: impl Fn(&vt100::Screen) -> bool) -> BenchResult<()> {
        let deadline = Instant::now() + LIMIT;
        loop {
            self.read_pending_output();
            if holds(self.screen.screen()) {
                return Ok(());
            }
            if Instant::now() > deadline {
                return Err(
                    format!("timed out waiting for {what}\n{}", self.screen.screen().contents()).into()
                );
            }
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// The current cells of the image.
    pub fn cells(&mut self) -> Cells {
        self.read_pending_output();
        cells(self.screen.screen())
    }

    /// Returns the time at which the image first satisfies `differs`. Starts checking after `pause`.
    pub fn time_of_change(
        &mut self,
        pause: Duration,
        differs: impl Fn(&Cells) -> bool,
    ) -> BenchResult<Instant> {
        let deadline = Instant::now() + LIMIT;
        thread::sleep(pause);
        while Instant::now() < deadline {
            let chunks = std::mem::take(&mut *lock(&self.chunks));
            let mut found = None;
            for (time, bytes) in chunks {
                self.screen.process(&bytes);
                if found.is_none() && differs(&cells(self.screen.screen())) {
                    found = Some(time);
                }
            }
            if let Some(time) = found {
                return Ok(time);
            }
            thread::sleep(Duration::from_millis(20));
        }
        Err(format!("the image did not change\n{}", self.screen.screen().contents()).into())
    }

    /// Counts the bursts of output that are large enough for an image. Bursts are separated by pauses.
    pub fn bursts(&mut self) -> usize {
        const MIN_IMAGE_BYTES: usize = 300;
        const GAP: Duration = Duration::from_millis(8);
        let chunks = std::mem::take(&mut *lock(&self.chunks));
        let mut bursts: Vec<(Instant, usize)> = Vec::new();
        for (time, bytes) in &chunks {
            self.screen.process(bytes);
            match bursts.last_mut() {
                Some((last, size)) if *time < *last + GAP => (*last, *size) = (*time, *size + bytes.len()),
                Some(_) | None => bursts.push((*time, bytes.len())),
            }
        }
        bursts.iter().filter(|(_, size)| *size >= MIN_IMAGE_BYTES).count()
    }

    fn read_pending_output(&mut self) {
        for (_, bytes) in std::mem::take(&mut *lock(&self.chunks)) {
            self.screen.process(&bytes);
        }
    }
}

impl Drop for TimedTerminal {
    fn drop(&mut self) {
        // The measurement is complete, so ignore a failure to stop the program.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Timestamps incoming bytes, and answers queries for the terminal's status and type.
fn read(
    mut output: Box<dyn Read + Send>,
    chunks: Arc<Mutex<Vec<Chunk>>>,
    keys: Arc<Mutex<Box<dyn Write + Send>>>,
) {
    const ANSWERS: [(&[u8], &[u8]); 2] = [(b"\x1b[5n", b"\x1b[0n"), (b"\x1b[c", b"\x1b[?62;22c")];
    thread::spawn(move || {
        let mut bytes = vec![0; 1 << 16];
        let mut tail = Vec::new();
        while let Ok(count @ 1..) = output.read(&mut bytes) {
            lock(&chunks).push((Instant::now(), bytes[..count].to_vec()));
            tail.extend_from_slice(&bytes[..count]);
            for (question, answer) in ANSWERS {
                while let Some(at) = tail.windows(question.len()).position(|window| window == question) {
                    tail.drain(at..at + question.len());
                    // Ignore errors: the program may have exited.
                    let _ = lock(&keys).write_all(answer);
                }
            }
            // A query may be split across reads.
            tail.drain(..tail.len().saturating_sub(3));
        }
    });
}

fn cells(screen: &vt100::Screen) -> Cells {
    let (rows, columns) = screen.size();
    let mut cells = Cells::new();
    for row in 0..rows.get() {
        for column in 0..columns.get() {
            cells.push(screen.cell(row, column).and_then(half_cell_colors));
        }
    }
    cells
}

/// Colors of the upper and lower halves of an image cell.
fn half_cell_colors(cell: &vt100::Cell) -> Option<[[u8; 3]; 2]> {
    let rgb = |color| match color {
        vt100::Color::Rgb(r, g, b) => Some([r, g, b]),
        _ => None,
    };
    let (fore, back) = (rgb(cell.fgcolor()), rgb(cell.bgcolor()));
    match cell.contents() {
        "▀" => Some([fore?, back.unwrap_or_default()]),
        "▄" => Some([back.unwrap_or_default(), fore?]),
        "█" => Some([fore?; 2]),
        _ => Some([back?; 2]),
    }
}
