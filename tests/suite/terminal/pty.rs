//! A pseudo-terminal that runs the program, with its screen and keyboard.

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::process::Command as Process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use glimt::tui::messages;

use super::relay::{Relay, Responder, Scanner, Traffic};
use crate::test_dir::{PROGRAM, TestDir};
use nix::sys::signal::{Signal, kill};
use nix::sys::termios::LocalFlags;
use nix::unistd::Pid;
use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, SlavePty, native_pty_system};

/// Time limit for any wait, long enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(60);

/// Environment variables that identify terminals.
const TERMINAL_VARIABLES: [&str; 11] = [
    "TMUX",
    "STY",
    "TERM_PROGRAM",
    "TERM_PROGRAM_VERSION",
    "WT_SESSION",
    "ConEmuANSI",
    "VTE_VERSION",
    "KONSOLE_VERSION",
    "XTERM_VERSION",
    "LC_TERMINAL",
    "LC_TERMINAL_VERSION",
];

/// A red board with a ball in front of it, under a light.
pub const SCENE: &str = r#"[render]
width = 64
height = 48
samples = 4
ambient = [0.5, 0.5, 0.5]

[camera]
position = [0, 0, 4]
look_at = [0, 0, 0]
aperture = 0.2
focus = 4.0

[materials]
board = { diffuse = [0.8, 0.02, 0.02] }
ball = { diffuse = [0.02, 0.02, 0.02] }
lamp = { diffuse = [0, 0, 0], emission = [20, 20, 20] }

[[quad]]
corner = [-1, -1, 0]
u = [2, 0, 0]
v = [0, 2, 0]
material = "board"

[[sphere]]
center = [0.5, 0.2, 0.8]
radius = 0.2
material = "ball"

[[sphere]]
center = [2, 2, 5]
radius = 0.6
material = "lamp"
"#;

pub const RED: &str = "[0.8, 0.02, 0.02]";
pub const GREEN: &str = "[0.02, 0.8, 0.02]";
pub const BLUE: &str = "[0.02, 0.02, 0.8]";

impl TestDir {
    /// A directory with [`SCENE`] in `scene.toml`.
    pub fn with_board() -> Self {
        let dir = Self(tempfile::tempdir().expect("a temporary folder"));
        dir.write("scene.toml", SCENE);
        dir
    }

    /// The image rendered with `--once` from the current scene.
    pub fn once(&self, options: &[&str]) -> Vec<u8> {
        let mut process = Process::new(PROGRAM);
        process.current_dir(self.0.path()).args(["scene.toml", "--once", "-o", "once.png"]).args(options);
        let output = process.output().expect("it runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        self.bytes("once.png")
    }

    /// The program rendering the scene in a terminal with 80×24 cells.
    pub fn terminal(&self) -> Terminal {
        self.terminal_with(&[PROGRAM, "scene.toml"], &[])
    }

    pub fn terminal_with(&self, command: &[&str], variables: &[(&str, &str)]) -> Terminal {
        Terminal::open(command, variables, self.0.path(), size(80, 24), None)
    }

    /// The program rendering the scene over a slow connection, in a terminal with 120×40 cells.
    pub fn thin_line(&self, answers: Responder) -> Terminal {
        let tmux: &[_] = if answers == Responder::Multiplexer {
            &[("TMUX", "/tmp/tmux-0/default,1,0"), ("SSH_CONNECTION", "192.0.2.1 5000 192.0.2.2 22")]
        } else {
            &[]
        };
        self.thin_line_in(answers, tmux)
    }

    /// Like [`Self::thin_line`], with additional environment variables.
    pub fn thin_line_in(&self, answers: Responder, variables: &[(&str, &str)]) -> Terminal {
        Terminal::open(&[PROGRAM, "scene.toml"], variables, self.0.path(), size(120, 40), Some(answers))
    }

    /// The program rendering the scene in a terminal of the specified size.
    pub fn terminal_of(&self, columns: u16, rows: u16) -> Terminal {
        Terminal::open(&[PROGRAM, "scene.toml"], &[], self.0.path(), size(columns, rows), None)
    }

    /// A program in a terminal with 200×24 cells.
    pub fn wide_terminal_with(&self, command: &[&str]) -> Terminal {
        Terminal::open(command, &[], self.0.path(), size(200, 24), None)
    }

    /// A program in a terminal of the specified size, with additional environment variables.
    pub fn sized_terminal(
        &self,
        command: &[&str],
        variables: &[(&str, &str)],
        (columns, rows): (u16, u16),
    ) -> Terminal {
        Terminal::open(command, variables, self.0.path(), size(columns, rows), None)
    }
}

/// A terminal running a program.
pub struct Terminal {
    master: Box<dyn MasterPty + Send>,
    // Kept open so that the terminal modes can be read after the program has exited.
    _slave: Box<dyn SlavePty + Send>,
    child: Box<dyn Child + Send + Sync>,
    keys: Arc<Mutex<Box<dyn Write + Send>>>,
    screen: Arc<Mutex<vt100::Parser>>,
    /// All output of the program.
    bytes: Arc<Mutex<Vec<u8>>>,
    relay: Option<Relay>,
    is_reading: Arc<AtomicBool>,
}

impl Terminal {
    fn open(
        command: &[&str],
        variables: &[(&str, &str)],
        folder: &Path,
        size: PtySize,
        line: Option<Responder>,
    ) -> Self {
        let pair = native_pty_system().openpty(size).expect("a pseudo-terminal");
        let mut builder = CommandBuilder::new(command[0]);
        builder.args(&command[1..]);
        builder.cwd(folder);
        for name in ["NO_COLOR", "COLUMNS", "SSH_CONNECTION", "SSH_CLIENT", "SSH_TTY", "ENV"]
            .into_iter()
            .chain(TERMINAL_VARIABLES)
        {
            builder.env_remove(name);
        }
        builder.env("TERM", "xterm-256color");
        builder.env("COLORTERM", "truecolor");
        for (name, value) in variables {
            builder.env(name, value);
        }
        let child = pair.slave.spawn_command(builder).expect("the program starts");
        let mut output = pair.master.try_clone_reader().expect("a reader");
        let screen = Arc::new(Mutex::new(vt100::Parser::new(side(size.rows), side(size.cols), 0)));
        let keys = Arc::new(Mutex::new(pair.master.take_writer().expect("a writer")));
        let (shared, bytes) = (screen.clone(), Arc::new(Mutex::new(Vec::new())));
        let kept = bytes.clone();
        let is_reading = Arc::new(AtomicBool::new(true));
        let reads = is_reading.clone();
        let relay = match line {
            Some(answers) => Some(Relay::start(output, keys.clone(), (shared, kept), answers)),
            None => {
                let input = keys.clone();
                std::thread::spawn(move || {
                    let (mut bytes, mut queries) = ([0; 1 << 16], Scanner::default());
                    while let Ok(count @ 1..) = output.read(&mut bytes) {
                        kept.lock().expect("not poisoned").extend_from_slice(&bytes[..count]);
                        shared.lock().expect("not poisoned").process(&bytes[..count]);
                        for (answer, _) in queries.answers(&bytes[..count]) {
                            // Ignore errors: the program may have exited.
                            let _ = input.lock().expect("not poisoned").write_all(answer);
                        }
                        while !reads.load(Ordering::Acquire) {
                            std::thread::sleep(Duration::from_millis(5));
                        }
                    }
                });
                None
            }
        };
        Self { master: pair.master, _slave: pair.slave, child, keys, screen, bytes, relay, is_reading }
    }

    /// The value of `look` when it no longer changes. (Text appears before the image.)
    pub fn settled<T: PartialEq>(&self, look: impl Fn(&vt100::Screen) -> T) -> T {
        let mut before = self.look(&look);
        loop {
            std::thread::sleep(Duration::from_millis(300));
            let now = self.look(&look);
            if now == before {
                return now;
            }
            before = now;
        }
    }

    pub fn press(&mut self, keys: &str) {
        if let Some(relay) = &self.relay {
            relay.press(keys);
            return;
        }
        let mut writer = self.keys.lock().expect("not poisoned");
        writer.write_all(keys.as_bytes()).expect("the terminal accepts keys");
    }

    /// Types more keys than the terminal can buffer, in the background.
    pub fn burst(&mut self, keys: String) {
        let writer = self.keys.clone();
        std::thread::spawn(move || {
            // Ignore errors: the program may have exited.
            let _ = writer.lock().expect("not poisoned").write_all(keys.as_bytes());
        });
    }

    pub fn resize(&mut self, columns: u16, rows: u16) {
        let mut screen = self.screen.lock().expect("not poisoned");
        screen.screen_mut().set_size(side(rows), side(columns));
        self.master.resize(size(columns, rows)).expect("resized");
    }

    /// Writes to the screen like another program.
    pub fn scribble(&self, bytes: &str) {
        self.screen.lock().expect("not poisoned").process(bytes.as_bytes());
    }

    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(i32::try_from(self.id()).expect("a process id")), signal).expect("sent");
    }

    /// The program's process ID.
    pub fn id(&self) -> u32 {
        self.child.process_id().expect("an id")
    }

    /// Makes the terminal start or stop reading the program's output.
    pub fn set_reading(&self, reading: bool) {
        self.is_reading.store(reading, Ordering::Release);
    }

    /// Whether the program has exited.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_some()
    }

    /// Waits for the program to exit, and returns its exit code.
    #[track_caller]
    pub fn code(&mut self) -> u32 {
        let deadline = Instant::now() + LIMIT;
        loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                return status.exit_code();
            }
            assert!(Instant::now() < deadline, "the program did not exit\n{}", self.text());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The lines left on the screen after the program has exited.
    pub fn last_lines(&self) -> String {
        self.wait("the restored screen", |screen| {
            !screen.alternate_screen() && !screen.contents().trim().is_empty()
        });
        self.settled(|screen| screen.contents().trim().to_owned())
    }

    /// Traffic of the slow connection.
    pub fn line<T>(&self, what: impl FnOnce(&Traffic) -> T) -> T {
        let relay = self.relay.as_ref().expect("a thin line");
        what(&relay.seen.lock().expect("no panic"))
    }

    /// All output so far.
    pub fn bytes(&self) -> Vec<u8> {
        self.bytes.lock().expect("not poisoned").clone()
    }

    /// Text on the screen.
    pub fn text(&self) -> String {
        self.look(|screen| screen.contents())
    }

    pub fn look<T>(&self, what: impl FnOnce(&vt100::Screen) -> T) -> T {
        what(self.screen.lock().expect("not poisoned").screen())
    }

    /// Waits until the screen satisfies `holds`.
    #[track_caller]
    pub fn wait(&self, what: &str, holds: impl Fn(&vt100::Screen) -> bool) {
        let deadline = Instant::now() + LIMIT;
        while !self.look(&holds) {
            assert!(Instant::now() < deadline, "timed out waiting for {what}\n{}", self.text());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[track_caller]
    pub fn wait_for(&self, text: &str) {
        self.wait(text, |screen| screen.contents().contains(text));
    }

    /// Waits for one of the front end's messages. The screen may show a truncated message.
    #[track_caller]
    pub fn wait_for_message(&self, message: &str) {
        self.wait(message, |screen| shows(screen, message));
    }

    /// Waits until every pixel of a render has a sample.
    #[track_caller]
    pub fn wait_for_coverage(&self) {
        self.wait("a sample for every pixel", |screen| {
            let text = screen.contents();
            let counts =
                text.lines().filter_map(|line| line.split_once(" samples · ")?.0.split_whitespace().last());
            let of_total = |count: &str| count.split('/').next().and_then(|done| done.parse::<f64>().ok());
            counts.filter_map(of_total).any(|done| done >= 2.0)
        });
    }

    /// Waits until render `number` is finished and no render is running.
    #[track_caller]
    pub fn wait_for_render(&self, number: usize) {
        let words = format!("· {}", messages::numbered_render(number));
        self.wait(&words, |screen| {
            let text = screen.contents();
            // Frames arrive in pieces, from top to bottom. All text is complete when the bar below the image
            // is gone.
            let is_whole = !text.contains(" samples · ");
            let is_over = |line: &str| line.contains("✓ done") || line.contains("! unwritten");
            let is_done = |line: &str| is_over(line) && line.trim_end().ends_with(&words);
            is_whole && text.lines().any(is_done)
        });
    }

    /// Waits until the image has the given color.
    #[track_caller]
    pub fn wait_for_color(&self, name: &str) {
        self.wait(name, |screen| {
            let counts = Colors::of(screen);
            counts.dominant_color().is_some_and(|most| most == name)
        });
    }

    /// Waits for the program to exit, checks that the terminal is restored, and returns the exit code.
    #[track_caller]
    pub fn end(self) -> u32 {
        self.end_showing("")
    }

    /// Like [`Terminal::end`], but first waits until the final screen contains one of the given strings,
    /// separated by `|`.
    #[track_caller]
    pub fn end_showing(mut self, words: &str) -> u32 {
        let code = self.code();
        self.wait("the restored screen with a cursor", |screen| {
            !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste()
        });
        let modes = self.master.get_termios().expect("modes").local_flags.bits();
        for (name, flag) in
            [("ECHO", LocalFlags::ECHO), ("ICANON", LocalFlags::ICANON), ("ISIG", LocalFlags::ISIG)]
        {
            assert_ne!(modes & flag.bits(), 0, "{name} is off");
        }
        self.wait(words, |screen| words.split('|').any(|word| screen.contents().contains(word)));
        code
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // If a test failed, the program may still be running.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether the screen shows the beginning of a message.
pub fn shows(screen: &vt100::Screen, message: &str) -> bool {
    let text = screen.contents().split_whitespace().collect::<Vec<_>>().join(" ");
    let start: String = message.chars().take(30).collect();
    text.contains(start.trim_end())
}

fn size(columns: u16, rows: u16) -> PtySize {
    PtySize { rows, cols: columns, pixel_width: 0, pixel_height: 0 }
}

fn side(length: u16) -> NonZeroU16 {
    NonZeroU16::new(length).expect("not zero")
}

/// Number of cells clearly dominated by each channel.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Colors {
    pub red: usize,
    pub green: usize,
    pub blue: usize,
}

impl Colors {
    /// Counts the colors of the upper halves of cells.
    pub fn of(screen: &vt100::Screen) -> Self {
        let mut colors = Self::default();
        for color in cells(screen).filter_map(upper) {
            let vt100::Color::Rgb(r, g, b) = color else { continue };
            // Use a wide margin, because the last bits of a color depend on the cell's history.
            let above = |a: u8, b: u8, c: u8| a > 50 && a / 2 > b.max(c);
            colors.red += usize::from(above(r, g, b));
            colors.green += usize::from(above(g, r, b));
            colors.blue += usize::from(above(b, r, g));
        }
        colors
    }

    pub fn total(&self) -> usize {
        self.red + self.green + self.blue
    }

    pub fn is_dominant(&self, name: &str) -> bool {
        self.dominant_color() == Some(name)
    }

    /// Returns the color of more than 90 % of the cells, or `None` if there is none or the image is too small.
    fn dominant_color(&self) -> Option<&'static str> {
        let total = self.total();
        let all = [(self.red, "red"), (self.green, "green"), (self.blue, "blue")];
        all.into_iter().find(|(count, _)| total > 100 && count * 10 > total * 9).map(|(_, name)| name)
    }
}

/// Color of a cell's upper half, regardless of the character used.
pub fn upper(cell: &vt100::Cell) -> Option<vt100::Color> {
    match cell.contents() {
        "▀" | "█" => Some(cell.fgcolor()),
        "▄" | " " | "" => Some(cell.bgcolor()),
        _ => None,
    }
}

pub fn cells(screen: &vt100::Screen) -> impl Iterator<Item = &vt100::Cell> {
    let (rows, columns) = screen.size();
    (0..rows.get()).flat_map(move |row| (0..columns.get()).filter_map(move |column| screen.cell(row, column)))
}
