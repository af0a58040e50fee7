//! The terminal: taken, given back, whatever happens.
//!
//! One [`TerminalSession`] owns it. It is given back when the screen is dropped, when the front end's thread panics (by a
//! hook that is chained once), before the program stops, and by [`rescue`] when the front end is stuck.

use std::cell::Cell;
use std::io::{self, IsTerminal, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, OnceLock, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use crossterm::cursor::{Hide, Show};
use crossterm::event::{DisableBracketedPaste, EnableBracketedPaste};
use crossterm::style::{Print, ResetColor};
use crossterm::terminal::{
    Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode,
    enable_raw_mode,
};
use crossterm::{execute, terminal};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::termios::{FlushArg, SetArg, Termios, tcflush, tcgetattr, tcsetattr};

use super::event::Window;
use super::graphics;
use super::options::TuiError;
use super::paint::LINK_OFF;
use super::window_title::{KEEP_TITLE, PROGRESS_OFF, TITLE_BACK};
use super::writer;
use crate::system::abort;

/// Whether the screen is taken.
static TAKEN: AtomicBool = AtomicBool::new(false);
/// Whether the mouse is wanted.
static MOUSE: AtomicBool = AtomicBool::new(true);
/// Whether keys come raw.
static RAW: AtomicBool = AtomicBool::new(false);
/// Whether the terminal is to report the focus.
static FOCUS: AtomicBool = AtomicBool::new(false);
/// Whether the window has a title of glimt's.
static HAS_TITLE: AtomicBool = AtomicBool::new(false);
/// Whether the window may have a bar of progress.
static HAS_PROGRESS: AtomicBool = AtomicBool::new(false);
/// Whether a link may be open in the text.
static HAS_LINKS: AtomicBool = AtomicBool::new(false);
/// Whether the terminal keeps images that have to be deleted.
static HAS_IMAGES: AtomicBool = AtomicBool::new(false);
/// The thread whose panic gives the terminal back; those of other threads are kept in [`PANIC`].
static OWNER: Mutex<Option<ThreadId>> = Mutex::new(None);
/// Message of the last panic of another thread.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Presses, movements with a button down, in SGR form. (crossterm's own command turns on all movements.)
const MOUSE_ON: &str = "\x1b[?1000h\x1b[?1002h\x1b[?1006h";
const MOUSE_OFF: &str = "\x1b[?1006l\x1b[?1002l\x1b[?1000l";

/// Reports of the focus (mode 1004).
const FOCUS_ON: &str = "\x1b[?1004h";
const FOCUS_OFF: &str = "\x1b[?1004l";

/// Other changes that glimt may have made, with the bytes that take them back.
static CHANGES: [(&AtomicBool, &[u8]); 4] = [
    (&HAS_LINKS, LINK_OFF),
    (&HAS_TITLE, TITLE_BACK),
    (&HAS_PROGRESS, PROGRESS_OFF),
    (&FOCUS, FOCUS_OFF.as_bytes()),
];
/// End of a control string, in case one was cut: the terminal would add the text behind it to that string.
const STRING_END: &[u8] = b"\x1b\\";

/// Half blocks are about square at this height over width of a cell.
const DEFAULT_CELL_ASPECT: f32 = 2.0;
/// A cell of many fonts.
const DEFAULT_CELL_PIXELS: (u16, u16) = (8, 16);
/// Time to wait for a terminal that takes nothing, at each step of giving it back.
const STUCK: Duration = Duration::from_millis(60);

/// The terminal, taken.
pub(super) struct TerminalSession(());

impl TerminalSession {
    /// Takes the terminal: raw mode, alternate screen, no cursor.
    pub(super) fn open() -> Result<Self, TuiError> {
        chain_panic_hook();
        prepare_abort();
        take().map_err(|source| TuiError::Terminal { action: "set up", source })?;
        Ok(Self(()))
    }

    /// Whether it may be drawn on.
    pub(super) fn is_taken(&self) -> bool {
        TAKEN.load(Ordering::Acquire)
    }

    /// Gives the screen back and keeps the keys, until [`TerminalSession::resume`] or the end: what the terminal still answers
    /// must not be echoed.
    pub(super) fn leave(&mut self) {
        leave_screen();
    }

    /// Gives the terminal back until [`TerminalSession::resume`].
    pub(super) fn suspend(&mut self) {
        give_back();
    }

    /// Takes the terminal again, whoever changed its modes.
    pub(super) fn resume(&mut self) -> io::Result<()> {
        // What a shell set while the program was stopped is no longer what was saved when it was taken.
        if RAW.swap(false, Ordering::AcqRel) {
            disable_raw_mode()?;
        }
        take()
    }

    /// Has the terminal report the mouse, or leave it to its own.
    pub(super) fn set_mouse(&mut self, is_on: bool) {
        MOUSE.store(is_on, Ordering::Release);
        writer::send(if is_on { MOUSE_ON } else { MOUSE_OFF }.as_bytes().to_vec());
    }

    /// Has the terminal report the focus.
    pub(super) fn report_focus(&mut self) {
        will_report_focus();
        writer::send(FOCUS_ON.as_bytes().to_vec());
    }

    /// The terminal is gone: nothing more is written to it.
    pub(super) fn abandon(self) {
        TAKEN.store(false, Ordering::Release);
        RAW.store(false, Ordering::Release);
    }
}

impl Drop for TerminalSession {
    fn drop(&mut self) {
        give_back();
    }
}

/// The modes of the terminal as another program found them. `None` unless another program has the terminal.
static LENT: Mutex<Option<Termios>> = Mutex::new(None);

/// Leaves the terminal to another program, until [`take_back`].
pub(super) fn lend() {
    *LENT.lock().unwrap_or_else(PoisonError::into_inner) = tcgetattr(io::stdin()).ok();
}

/// Sets the modes of the terminal as they were when it was lent: a program that was killed leaves its own. Errors are of
/// no use: there is nothing else to be done.
pub(super) fn take_back() {
    if let Some(modes) = LENT.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes);
    }
}

fn take() -> io::Result<()> {
    enable_raw_mode()?;
    RAW.store(true, Ordering::Release);
    TAKEN.store(true, Ordering::Release);
    *OWNER.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread::current().id());
    enter(&mut io::stdout()).inspect_err(|_| give_back())
}

/// Gives the terminal back, if it is taken. Errors are of no use: there is nobody left to tell.
fn give_back() {
    leave_screen();
    if RAW.swap(false, Ordering::AcqRel) {
        let _ = disable_raw_mode();
    }
}

/// Gives the screen back, if it is taken. What has not been sent is dropped; a terminal that takes nothing loses what
/// the system keeps for it as well, and is waited for no longer than three times [`STUCK`].
fn leave_screen() {
    if !TAKEN.swap(false, Ordering::AcqRel) {
        return;
    }
    let drop_kept = || tcflush(io::stdout(), FlushArg::TCOFLUSH);
    if !writer::discard(STUCK) {
        let _ = drop_kept();
    }
    let mut bytes = Vec::new();
    let (deadline, dropped) = (Instant::now() + STUCK, Cell::new(false));
    // Nobody else writes: once what the system keeps has been dropped there is room.
    let is_late = || Instant::now() >= deadline && (dropped.replace(true) || drop_kept().is_err());
    let _ = leave(&mut bytes)
        .and_then(|()| writer::output())
        .and_then(|mut out| writer::write_all(&mut out, &bytes, is_late));
}

/// Gives the terminal back from another thread while the owner may be stuck. Returns soon; a terminal that takes
/// nothing keeps the writer waiting, not the caller.
pub(super) fn rescue() {
    if RAW.swap(false, Ordering::AcqRel) {
        let _ = disable_raw_mode();
    }
    if TAKEN.swap(false, Ordering::AcqRel) {
        writer::discard(Duration::ZERO);
        thread::spawn(|| {
            let tty = std::fs::OpenOptions::new().write(true).open("/dev/tty");
            tty.and_then(|mut tty| leave(&mut tty))
        });
    }
}

/// Bytes and modes with which an abort gives the terminal back, without an allocation.
static LAST_WORDS: OnceLock<RestoreData> = OnceLock::new();

struct RestoreData {
    /// The modes of the terminal before it was first taken.
    modes: Option<nix::libc::termios>,
    /// The bytes that delete images.
    delete_images: Vec<u8>,
    /// The bytes that give the screen back.
    leave: Vec<u8>,
}

/// Has an abort, as of a failed allocation, give the terminal back.
fn prepare_abort() {
    LAST_WORDS.get_or_init(|| {
        let (mut delete_images, mut leave) = (Vec::new(), Vec::new());
        // Writing to memory does not fail.
        let _ = leave_images(&mut delete_images).and_then(|()| leave_text(&mut leave));
        RestoreData { modes: tcgetattr(io::stdin()).ok().map(Into::into), delete_images, leave }
    });
    abort::set_terminal_restore(give_back_at_once);
}

/// Gives the terminal back by async-signal-safe calls alone: no lock, no allocation. A terminal that takes nothing is
/// waited for no longer than [`STUCK`].
fn give_back_at_once() {
    let Some(words) = LAST_WORDS.get() else { return };
    if TAKEN.swap(false, Ordering::AcqRel) {
        let out = io::stdout();
        let _ = tcflush(&out, FlushArg::TCOFLUSH);
        let mut room = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
        if poll(&mut room, PollTimeout::try_from(STUCK).unwrap_or(PollTimeout::ZERO))
            .is_ok_and(|ready| ready > 0)
        {
            if HAS_IMAGES.load(Ordering::Acquire) {
                let _ = nix::unistd::write(&out, &words.delete_images);
            }
            for bytes in taken_back() {
                let _ = nix::unistd::write(&out, bytes);
            }
            let _ = nix::unistd::write(&out, &words.leave);
        }
    }
    if let Some(modes) = words.modes
        && RAW.swap(false, Ordering::AcqRel)
    {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes.into());
    }
}

/// From now on the terminal may keep kitty's images, or have been cut in the middle of a string.
pub(super) fn will_have_images() {
    HAS_IMAGES.store(true, Ordering::Release);
}

/// The terminal is to report the focus whenever it is taken.
pub(super) fn will_report_focus() {
    FOCUS.store(true, Ordering::Release);
}

/// Bytes to send before the window gets a title: empty unless it has its own yet.
pub(super) fn before_title() -> &'static [u8] {
    if HAS_TITLE.swap(true, Ordering::AcqRel) { b"" } else { KEEP_TITLE }
}

/// From now on the window may have a bar of progress.
pub(super) fn will_have_progress() {
    HAS_PROGRESS.store(true, Ordering::Release);
}

/// From now on a link may be open.
pub(super) fn will_have_links() {
    HAS_LINKS.store(true, Ordering::Release);
}

/// Bytes that take back what else was changed. Each is given once, but for modes, which are set whenever the terminal is taken.
fn taken_back() -> impl Iterator<Item = &'static [u8]> {
    let mut is_first = true;
    CHANGES.iter().flat_map(move |(flag, bytes)| {
        let is_mode = std::ptr::eq(*flag, &FOCUS);
        let is_due = if is_mode { flag.load(Ordering::Acquire) } else { flag.swap(false, Ordering::AcqRel) };
        let end = (is_due && std::mem::replace(&mut is_first, false)).then_some(STRING_END);
        end.into_iter().chain(is_due.then_some(*bytes))
    })
}

/// The bytes that take the screen.
fn enter(out: &mut impl Write) -> io::Result<()> {
    let mouse = if MOUSE.load(Ordering::Acquire) { MOUSE_ON } else { MOUSE_OFF };
    let focus = if FOCUS.load(Ordering::Acquire) { FOCUS_ON } else { "" };
    execute!(
        out,
        EnterAlternateScreen,
        Hide,
        EnableBracketedPaste,
        Print(mouse),
        Print(focus),
        Clear(ClearType::All)
    )
}

/// The bytes that give it back, from any state that a frame can be cut in.
fn leave(out: &mut impl Write) -> io::Result<()> {
    if HAS_IMAGES.load(Ordering::Acquire) {
        leave_images(out)?;
    }
    taken_back().try_for_each(|bytes| out.write_all(bytes))?;
    leave_text(out)
}

/// The bytes that delete the images that the terminal keeps.
fn leave_images(out: &mut impl Write) -> io::Result<()> {
    out.write_all(STRING_END)?;
    out.write_all(&graphics::delete_all())
}

/// The bytes that end what a frame may have begun, and show the shell's screen.
fn leave_text(out: &mut impl Write) -> io::Result<()> {
    execute!(
        out,
        EndSynchronizedUpdate,
        ResetColor,
        Print(MOUSE_OFF),
        DisableBracketedPaste,
        LeaveAlternateScreen,
        Show
    )
}

/// While the terminal is taken, a panic of its owner gives it back and is then reported as always; a panic of
/// another thread would be lost on the alternate screen and is kept for [`last_panic`].
fn chain_panic_hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let owner = *OWNER.lock().unwrap_or_else(PoisonError::into_inner);
            if TAKEN.load(Ordering::Acquire) && owner != Some(std::thread::current().id()) {
                *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(info.to_string());
            } else {
                give_back();
                previous(info);
            }
        }));
    });
}

/// Message of the last panic of another thread.
pub(super) fn last_panic() -> Option<String> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// An error where keys or screen are no terminal.
pub(super) fn require() -> Result<(), TuiError> {
    if !io::stdin().is_terminal() {
        return Err(TuiError::NotATerminal { stream: "standard input" });
    }
    if !io::stdout().is_terminal() {
        return Err(TuiError::NotATerminal { stream: "standard output" });
    }
    Ok(())
}

/// Whether both ends of the terminal are still there.
pub(super) fn is_there() -> bool {
    require().is_ok()
}

/// The size of the window; the aspect of a cell as given, else from the window's size in pixels, else 2.
pub(super) fn window(cell_aspect: Option<f32>) -> Window {
    match terminal::window_size() {
        Ok(size) => bounded(Window {
            columns: size.columns,
            rows: size.rows,
            cell_aspect: cell_aspect
                .unwrap_or_else(|| aspect((size.columns, size.rows), (size.width, size.height))),
            cell_pixels: cell_pixels((size.columns, size.rows), (size.width, size.height)),
        }),
        Err(_) => {
            let (columns, rows) = terminal::size().unwrap_or((80, 24));
            bounded(Window {
                columns,
                rows,
                cell_aspect: cell_aspect.unwrap_or(DEFAULT_CELL_ASPECT),
                cell_pixels: DEFAULT_CELL_PIXELS,
            })
        }
    }
}

/// Most columns that are drawn: more than a wall of screens has.
const MOST_COLUMNS: u16 = 4096;
/// Most cells that are drawn. Each takes some hundred bytes, and terminals may report 65,535 columns and rows.
const MOST_CELLS: u32 = 1 << 20;

/// The part of a window that is drawn.
fn bounded(window: Window) -> Window {
    let columns = window.columns.min(MOST_COLUMNS);
    let most_rows = MOST_CELLS / u32::from(columns.max(1));
    let rows = u16::try_from(most_rows).map_or(window.rows, |most| window.rows.min(most));
    Window { columns, rows, ..window }
}

/// Height over width of a cell. Sizes in pixels are often zero or nonsense; values within 3% of 2 are 2, so that
/// pictures need no scaling.
fn aspect(cells: (u16, u16), pixels: (u16, u16)) -> f32 {
    let width = f32::from(pixels.0) / f32::from(cells.0);
    let height = f32::from(pixels.1) / f32::from(cells.1);
    let aspect = height / width;
    let sane = width >= 2.0 && (1.2..=3.5).contains(&aspect);
    if sane && (aspect - DEFAULT_CELL_ASPECT).abs() > 0.06 { aspect } else { DEFAULT_CELL_ASPECT }
}

/// Width and height of a cell in pixels, where the sizes make sense.
fn cell_pixels(cells: (u16, u16), pixels: (u16, u16)) -> (u16, u16) {
    let side = |pixels: u16, cells: u16| pixels.checked_div(cells).filter(|side| (2..=100).contains(side));
    side(pixels.0, cells.0).zip(side(pixels.1, cells.1)).unwrap_or(DEFAULT_CELL_PIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lock for one test at a time: the changes to be taken back are those of the process.
    static ALONE: Mutex<()> = Mutex::new(());

    fn alone() -> std::sync::MutexGuard<'static, ()> {
        ALONE.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn bytes(write: impl Fn(&mut Vec<u8>) -> io::Result<()>) -> String {
        let mut out = Vec::new();
        write(&mut out).expect("a vector takes everything");
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn leaving_undoes_entering() {
        let _alone = alone();
        let enter = bytes(enter);
        let leave = bytes(leave);
        for mode in ["?1049", "?25", "?2004", "?1000", "?1002", "?1006"] {
            assert!(enter.contains(mode) && leave.contains(mode), "{mode}: {enter:?} {leave:?}");
        }
        assert!(enter.contains("\x1b[?1049h") && enter.contains("\x1b[?25l"), "{enter:?}");
        assert!(leave.contains("\x1b[0m"), "{leave:?}");
        assert!(leave.ends_with("\x1b[?1049l\x1b[?25h"), "{leave:?}");
    }

    #[test]
    fn title_progress_and_links_are_taken_back_once() {
        let _alone = alone();
        let all = || taken_back().collect::<Vec<_>>();
        assert!(all().is_empty());
        assert_eq!((before_title(), before_title()), (KEEP_TITLE, &b""[..]));
        will_have_progress();
        will_have_links();
        assert_eq!(all(), [STRING_END, LINK_OFF, TITLE_BACK, PROGRESS_OFF]);
        assert!(all().is_empty());
        assert_eq!(before_title(), KEEP_TITLE, "taken again, it is kept again");
        assert_eq!(all(), [STRING_END, TITLE_BACK]);
    }

    #[test]
    fn the_screen_is_left_in_a_vt100() {
        let _alone = alone();
        let side = |length| std::num::NonZero::new(length).expect("not zero");
        let mut screen = vt100::Parser::new(side(5), side(20), 0);
        screen.process(b"shell$ ");
        screen.process(bytes(enter).as_bytes());
        screen.process(b"picture");
        assert!(screen.screen().alternate_screen() && screen.screen().hide_cursor());
        screen.process(bytes(leave).as_bytes());
        assert!(!screen.screen().alternate_screen() && !screen.screen().hide_cursor());
        assert!(screen.screen().contents().starts_with("shell$ "));
    }

    #[test]
    fn the_aspect_of_a_cell_is_believed_when_it_is_sane() {
        assert_eq!(aspect((80, 24), (80 * 8, 24 * 18)), 2.25);
        assert_eq!(aspect((80, 24), (0, 0)), 2.0);
        assert_eq!(aspect((0, 0), (640, 480)), 2.0);
        assert_eq!(aspect((80, 24), (80, 24)), 2.0);
        assert_eq!(aspect((100, 50), (1000, 1010)), 2.0);
    }

    #[test]
    fn a_window_of_any_size_has_a_bounded_number_of_cells() {
        let of = |columns, rows| {
            let cell_pixels = DEFAULT_CELL_PIXELS;
            let drawn = bounded(Window { columns, rows, cell_aspect: DEFAULT_CELL_ASPECT, cell_pixels });
            (drawn.columns, drawn.rows)
        };
        for usual in [(80, 24), (640, 360), (4096, 256), (0, 0), (0, 24), (1, u16::MAX)] {
            assert_eq!(of(usual.0, usual.1), usual);
        }
        for (columns, rows) in [(32_767, 32_767), (u16::MAX, u16::MAX), (u16::MAX, 1), (300, u16::MAX)] {
            let drawn = of(columns, rows);
            assert!(u32::from(drawn.0) * u32::from(drawn.1) <= MOST_CELLS, "{drawn:?}");
            assert!(drawn.0 >= columns.min(300) && drawn.1 >= rows.min(256), "{drawn:?}");
        }
    }

    #[test]
    fn pixels_of_a_cell_are_believed_when_they_make_sense() {
        assert_eq!(cell_pixels((80, 24), (80 * 9, 24 * 18 + 3)), (9, 18));
        assert_eq!(cell_pixels((80, 24), (0, 0)), DEFAULT_CELL_PIXELS);
        assert_eq!(cell_pixels((0, 0), (640, 480)), DEFAULT_CELL_PIXELS);
    }

    #[test]
    fn giving_back_what_was_not_taken_does_nothing() {
        let _alone = alone();
        assert!(!TAKEN.load(Ordering::Acquire));
        give_back();
        rescue();
        assert!(!TAKEN.load(Ordering::Acquire));
    }
}
