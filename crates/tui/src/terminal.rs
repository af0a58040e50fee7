//! Terminal setup and restoration.
//!
//! A [`TerminalSession`] owns the terminal. The terminal is restored when the session is dropped, when the
//! front-end thread panics, before the process stops, and by [`restore_from_other_thread`] if the front end
//! is blocked.

use std::cell::Cell;
use std::fs::File;
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

use super::event::WindowSize;
use super::graphics;
use super::options::TuiError;
use super::paint::LINK_OFF;
use super::window_title::{KEEP_TITLE, PROGRESS_OFF, TITLE_BACK};
use super::writer;
use crate::system::abort;

/// Whether the alternate screen is active.
static ALTERNATE_SCREEN_ACTIVE: AtomicBool = AtomicBool::new(false);
/// Whether mouse reporting is enabled.
static MOUSE_REPORTING_ENABLED: AtomicBool = AtomicBool::new(true);
/// Whether the terminal is in raw mode.
static RAW_MODE_ACTIVE: AtomicBool = AtomicBool::new(false);
/// Whether focus reporting is enabled.
static FOCUS_REPORTING_ENABLED: AtomicBool = AtomicBool::new(false);
/// Whether the window title has been changed.
static HAS_TITLE: AtomicBool = AtomicBool::new(false);
/// Whether a progress bar may be shown.
static HAS_PROGRESS: AtomicBool = AtomicBool::new(false);
/// Whether a hyperlink may still be open.
static HAS_LINKS: AtomicBool = AtomicBool::new(false);
/// Whether the terminal stores images that must be deleted.
static HAS_IMAGES: AtomicBool = AtomicBool::new(false);
/// The thread that owns the terminal. Its panics restore the terminal. Panic messages from other threads are
/// stored in [`PANIC`].
static OWNER: Mutex<Option<ThreadId>> = Mutex::new(None);
/// Message from the last panic in a thread that does not own the terminal.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Enables reports of button events and drags, in SGR format. (crossterm's command would report all mouse
/// movements.)
const MOUSE_ON: &str = "\x1b[?1000h\x1b[?1002h\x1b[?1006h";
const MOUSE_OFF: &str = "\x1b[?1006l\x1b[?1002l\x1b[?1000l";

/// Enables focus reporting (mode 1004).
const FOCUS_ON: &str = "\x1b[?1004h";
const FOCUS_OFF: &str = "\x1b[?1004l";

/// Other terminal changes that glimt may have made, each with the bytes that undo it.
static CHANGES: [(&AtomicBool, &[u8]); 4] = [
    (&HAS_LINKS, LINK_OFF),
    (&HAS_TITLE, TITLE_BACK),
    (&HAS_PROGRESS, PROGRESS_OFF),
    (&FOCUS_REPORTING_ENABLED, FOCUS_OFF.as_bytes()),
];
/// Terminates a control string that may have been cut off. Otherwise, the terminal would treat the following
/// text as part of the string.
const STRING_END: &[u8] = b"\x1b\\";

/// Height-to-width ratio of a cell with square half blocks.
const DEFAULT_CELL_ASPECT: f32 = 2.0;
/// Typical cell size in pixels.
const DEFAULT_CELL_PIXELS: (u16, u16) = (8, 16);
/// Timeout for each restoration step if the terminal does not accept output.
const RESTORATION_TIMEOUT: Duration = Duration::from_millis(60);

/// The terminal while the front end is using it.
pub(super) struct TerminalSession(());

impl TerminalSession {
    /// Sets up the terminal: raw mode, alternate screen, hidden cursor.
    pub(super) fn open() -> Result<Self, TuiError> {
        install_panic_hook();
        prepare_restore_on_abort();
        set_up_terminal().map_err(|source| TuiError::Terminal { action: "set up", source })?;
        Ok(Self(()))
    }

    /// Whether the front end may draw on the screen.
    pub(super) fn is_screen_active(&self) -> bool {
        ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire)
    }

    /// Restores the screen but keeps raw mode until [`TerminalSession::resume`] is called or the session
    /// ends, so that late replies are not echoed.
    pub(super) fn leave_screen_in_raw_mode(&mut self) {
        leave_screen();
    }

    /// Restores the terminal until [`TerminalSession::resume`] is called.
    pub(super) fn restore_terminal_temporarily(&mut self) {
        restore_terminal();
    }

    /// Sets up the terminal again.
    pub(super) fn resume(&mut self) -> io::Result<()> {
        // A shell may have changed the modes while the process was stopped, so save the current ones.
        if RAW_MODE_ACTIVE.swap(false, Ordering::AcqRel) {
            disable_raw_mode()?;
        }
        set_up_terminal()
    }

    /// Enables or disables mouse reporting.
    pub(super) fn set_mouse_reporting(&mut self, is_on: bool) {
        MOUSE_REPORTING_ENABLED.store(is_on, Ordering::Release);
        writer::queue_slice(if is_on { MOUSE_ON } else { MOUSE_OFF }.as_bytes().to_vec());
    }

    /// Enables focus reporting.
    pub(super) fn request_focus_reports(&mut self) {
        enable_focus_reports_on_setup();
        writer::queue_slice(FOCUS_ON.as_bytes().to_vec());
    }

    /// Stops writing to a terminal that no longer exists.
    pub(super) fn abandon(self) {
        ALTERNATE_SCREEN_ACTIVE.store(false, Ordering::Release);
        RAW_MODE_ACTIVE.store(false, Ordering::Release);
    }
}

impl Drop for TerminalSession {
    fn drop(&mut self) {
        restore_terminal();
    }
}

/// Terminal modes saved while another program uses the terminal, or `None` at other times.
static LENT_TERMINAL_MODES: Mutex<Option<Termios>> = Mutex::new(None);

/// Saves the terminal modes for [`restore_terminal_modes`] before another program uses the terminal.
pub(super) fn save_terminal_modes() {
    *LENT_TERMINAL_MODES.lock().unwrap_or_else(PoisonError::into_inner) = tcgetattr(io::stdin()).ok();
}

/// Restores the modes saved by [`save_terminal_modes`], because a killed program may leave the terminal in a
/// different mode. Errors are ignored because nothing can be done about them.
pub(super) fn restore_terminal_modes() {
    if let Some(modes) = LENT_TERMINAL_MODES.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes);
    }
}

/// The terminal, opened during setup, so that restoring it does not need another file descriptor.
static OUTPUT: Mutex<Option<File>> = Mutex::new(None);

fn take_terminal_output() -> Option<File> {
    OUTPUT.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn set_up_terminal() -> io::Result<()> {
    let output = writer::open_terminal_output()?;
    *OUTPUT.lock().unwrap_or_else(PoisonError::into_inner) = Some(output);
    enable_raw_mode()?;
    RAW_MODE_ACTIVE.store(true, Ordering::Release);
    ALTERNATE_SCREEN_ACTIVE.store(true, Ordering::Release);
    *OWNER.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread::current().id());
    write_setup(&mut io::stdout()).inspect_err(|_| restore_terminal())
}

/// Restores the terminal if it is in use. Errors are ignored because they cannot be reported.
fn restore_terminal() {
    leave_screen();
    if RAW_MODE_ACTIVE.swap(false, Ordering::AcqRel) {
        let _ = disable_raw_mode();
    }
}

/// Restores the screen if it is in use, dropping unsent output. If the terminal does not accept output, data
/// buffered by the operating system is also dropped. Takes at most three times [`RESTORATION_TIMEOUT`].
fn leave_screen() {
    if !ALTERNATE_SCREEN_ACTIVE.swap(false, Ordering::AcqRel) {
        return;
    }
    let drop_kept = || tcflush(io::stdout(), FlushArg::TCOFLUSH);
    if !writer::discard_queued_and_wait(RESTORATION_TIMEOUT) {
        let _ = drop_kept();
    }
    let mut bytes = Vec::new();
    let (deadline, dropped) = (Instant::now() + RESTORATION_TIMEOUT, Cell::new(false));
    // Nothing else is writing, so dropping the system's buffered output makes room.
    let is_late = || Instant::now() >= deadline && (dropped.replace(true) || drop_kept().is_err());
    let _ = write_restore(&mut bytes)
        .and_then(|()| take_terminal_output().map_or_else(writer::open_terminal_output, Ok))
        .and_then(|mut out| writer::write_all_unless_canceled(&mut out, &bytes, is_late));
}

/// Restores the terminal from another thread, since the thread that owns it may be blocked. Does not block:
/// if the terminal does not accept output, a spawned thread waits for it.
pub(super) fn restore_from_other_thread() {
    if RAW_MODE_ACTIVE.swap(false, Ordering::AcqRel) {
        let _ = disable_raw_mode();
    }
    if ALTERNATE_SCREEN_ACTIVE.swap(false, Ordering::AcqRel) {
        writer::discard_queued_and_wait(Duration::ZERO);
        thread::spawn(|| {
            let tty = File::options().write(true).open("/dev/tty");
            tty.or_else(|error| take_terminal_output().ok_or(error))
                .and_then(|mut tty| write_restore(&mut tty))
        });
    }
}

/// Data needed to restore the terminal on abort without allocating memory.
static LAST_WORDS: OnceLock<RestoreData> = OnceLock::new();

struct RestoreData {
    /// Terminal modes before setup.
    modes: Option<nix::libc::termios>,
    /// Bytes that delete images.
    delete_images: Vec<u8>,
    /// Bytes that restore the screen.
    leave: Vec<u8>,
}

/// Prepares to restore the terminal on abort, for example after a failed allocation.
fn prepare_restore_on_abort() {
    LAST_WORDS.get_or_init(|| {
        let (mut delete_images, mut leave) = (Vec::new(), Vec::new());
        // Writing to a vector cannot fail.
        let _ = write_image_deletion(&mut delete_images).and_then(|()| write_frame_end_and_leave(&mut leave));
        RestoreData { modes: tcgetattr(io::stdin()).ok().map(Into::into), delete_images, leave }
    });
    abort::set_terminal_restore_hook(restore_terminal_while_aborting);
}

/// Restores the terminal using only async-signal-safe calls, without locks or allocations. If the terminal
/// does not accept output, waits no longer than [`RESTORATION_TIMEOUT`].
fn restore_terminal_while_aborting() {
    let Some(words) = LAST_WORDS.get() else { return };
    if ALTERNATE_SCREEN_ACTIVE.swap(false, Ordering::AcqRel) {
        let out = io::stdout();
        let _ = tcflush(&out, FlushArg::TCOFLUSH);
        let mut room = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
        if poll(&mut room, PollTimeout::try_from(RESTORATION_TIMEOUT).unwrap_or(PollTimeout::ZERO))
            .is_ok_and(|ready| ready > 0)
        {
            if HAS_IMAGES.load(Ordering::Acquire) {
                let _ = nix::unistd::write(&out, &words.delete_images);
            }
            for bytes in take_undo_bytes() {
                let _ = nix::unistd::write(&out, bytes);
            }
            let _ = nix::unistd::write(&out, &words.leave);
        }
    }
    if let Some(modes) = words.modes
        && RAW_MODE_ACTIVE.swap(false, Ordering::AcqRel)
    {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes.into());
    }
}

/// Records that kitty images may be stored and that control strings may be cut off.
pub(super) fn mark_images_used() {
    HAS_IMAGES.store(true, Ordering::Release);
}

/// Enables focus reporting each time the terminal is set up.
pub(super) fn enable_focus_reports_on_setup() {
    FOCUS_REPORTING_ENABLED.store(true, Ordering::Release);
}

/// Bytes to send before setting a window title. The first call returns the sequence that saves the original
/// title. Later calls return nothing.
pub(super) fn take_title_save_sequence() -> &'static [u8] {
    if HAS_TITLE.swap(true, Ordering::AcqRel) { b"" } else { KEEP_TITLE }
}

/// Records that a progress bar may be shown.
pub(super) fn mark_progress_bar_used() {
    HAS_PROGRESS.store(true, Ordering::Release);
}

/// Records that a hyperlink may be open.
pub(super) fn mark_links_used() {
    HAS_LINKS.store(true, Ordering::Release);
}

/// Bytes that undo the changes listed in [`CHANGES`]. Each change is undone only once, except for modes,
/// which are enabled again when the terminal is set up.
fn take_undo_bytes() -> impl Iterator<Item = &'static [u8]> {
    let mut is_first = true;
    CHANGES.iter().flat_map(move |(flag, bytes)| {
        let is_mode = std::ptr::eq(*flag, &FOCUS_REPORTING_ENABLED);
        let is_due = if is_mode { flag.load(Ordering::Acquire) } else { flag.swap(false, Ordering::AcqRel) };
        let end = (is_due && std::mem::replace(&mut is_first, false)).then_some(STRING_END);
        end.into_iter().chain(is_due.then_some(*bytes))
    })
}

/// Writes the bytes that set up the screen.
fn write_setup(out: &mut impl Write) -> io::Result<()> {
    let mouse = if MOUSE_REPORTING_ENABLED.load(Ordering::Acquire) { MOUSE_ON } else { MOUSE_OFF };
    let focus = if FOCUS_REPORTING_ENABLED.load(Ordering::Acquire) { FOCUS_ON } else { "" };
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

/// Writes the bytes that restore the screen, even if a frame was cut off at any point.
fn write_restore(out: &mut impl Write) -> io::Result<()> {
    if HAS_IMAGES.load(Ordering::Acquire) {
        write_image_deletion(out)?;
    }
    take_undo_bytes().try_for_each(|bytes| out.write_all(bytes))?;
    write_frame_end_and_leave(out)
}

/// Writes the bytes that delete stored images.
fn write_image_deletion(out: &mut impl Write) -> io::Result<()> {
    out.write_all(STRING_END)?;
    out.write_all(&graphics::delete_all_commands())
}

/// Writes the bytes that end an unfinished frame and switch back to the shell's screen.
fn write_frame_end_and_leave(out: &mut impl Write) -> io::Result<()> {
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

/// Installs the panic hook. If the terminal's owner panics while using it, the terminal is restored before
/// the panic is reported. A panic message from another thread would be lost on the alternate screen, so it is
/// stored for [`last_panic_message`].
fn install_panic_hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let owner = *OWNER.lock().unwrap_or_else(PoisonError::into_inner);
            if ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire) && owner != Some(std::thread::current().id()) {
                *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(info.to_string());
            } else {
                restore_terminal();
                previous(info);
            }
        }));
    });
}

/// Message from the last panic in a thread that does not own the terminal.
pub(super) fn last_panic_message() -> Option<String> {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Returns an error if stdin or stdout is not a terminal.
pub(super) fn require_terminal() -> Result<(), TuiError> {
    if !io::stdin().is_terminal() {
        return Err(TuiError::NotATerminal { stream: "standard input" });
    }
    if !io::stdout().is_terminal() {
        return Err(TuiError::NotATerminal { stream: "standard output" });
    }
    Ok(())
}

/// Whether the terminal still exists.
pub(super) fn terminal_exists() -> bool {
    require_terminal().is_ok()
}

/// Window size and cell aspect ratio. If `cell_aspect` is `None`, the aspect ratio is derived from the window
/// size in pixels, or is 2 if that size is unknown.
pub(super) fn query_window_size(cell_aspect: Option<f32>) -> WindowSize {
    match terminal::window_size() {
        Ok(size) => clamp_window_size(WindowSize {
            columns: size.columns,
            rows: size.rows,
            cell_aspect: cell_aspect
                .unwrap_or_else(|| cell_aspect_ratio((size.columns, size.rows), (size.width, size.height))),
            cell_pixels: cell_size_from_window((size.columns, size.rows), (size.width, size.height)),
        }),
        Err(_) => {
            let (columns, rows) = terminal::size().unwrap_or((80, 24));
            clamp_window_size(WindowSize {
                columns,
                rows,
                cell_aspect: cell_aspect.unwrap_or(DEFAULT_CELL_ASPECT),
                cell_pixels: DEFAULT_CELL_PIXELS,
            })
        }
    }
}

/// Maximum number of columns drawn. Not even a video wall has more.
const MAX_COLUMNS: u16 = 4096;
/// Maximum number of cells drawn. A cell takes hundreds of bytes of memory, and terminals may report up to
/// 65,535 columns and rows.
const MAX_CELLS: u32 = 1 << 20;

/// Limits a window to the maximum size.
fn clamp_window_size(window: WindowSize) -> WindowSize {
    let columns = window.columns.min(MAX_COLUMNS);
    let max_rows = MAX_CELLS / u32::from(columns.max(1));
    let rows = u16::try_from(max_rows).map_or(window.rows, |most| window.rows.min(most));
    WindowSize { columns, rows, ..window }
}

/// Height-to-width ratio of a cell. Reported pixel sizes are often zero or implausible. Values within 3% of 2
/// are rounded to 2 so that previews need no scaling.
fn cell_aspect_ratio(cells: (u16, u16), pixels: (u16, u16)) -> f32 {
    let width = f32::from(pixels.0) / f32::from(cells.0);
    let height = f32::from(pixels.1) / f32::from(cells.1);
    let aspect = height / width;
    let sane = width >= 2.0 && (1.2..=3.5).contains(&aspect);
    if sane && (aspect - DEFAULT_CELL_ASPECT).abs() > 0.06 { aspect } else { DEFAULT_CELL_ASPECT }
}

/// Cell size in pixels, or a typical size if the reported one is implausible.
fn cell_size_from_window(cells: (u16, u16), pixels: (u16, u16)) -> (u16, u16) {
    let side = |pixels: u16, cells: u16| pixels.checked_div(cells).filter(|side| (2..=100).contains(side));
    side(pixels.0, cells.0).zip(side(pixels.1, cells.1)).unwrap_or(DEFAULT_CELL_PIXELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Serializes tests because they share process-wide state.
    static ALONE: Mutex<()> = Mutex::new(());

    fn exclusive_access() -> std::sync::MutexGuard<'static, ()> {
        ALONE.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn bytes(write: impl Fn(&mut Vec<u8>) -> io::Result<()>) -> String {
        let mut out = Vec::new();
        write(&mut out).expect("writing to a vector");
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn restore_undoes_setup() {
        let _alone = exclusive_access();
        let enter = bytes(write_setup);
        let leave = bytes(write_restore);
        for mode in ["?1049", "?25", "?2004", "?1000", "?1002", "?1006"] {
            assert!(enter.contains(mode) && leave.contains(mode), "{mode}: {enter:?} {leave:?}");
        }
        assert!(enter.contains("\x1b[?1049h") && enter.contains("\x1b[?25l"), "{enter:?}");
        assert!(leave.contains("\x1b[0m"), "{leave:?}");
        assert!(leave.ends_with("\x1b[?1049l\x1b[?25h"), "{leave:?}");
    }

    #[test]
    fn title_progress_and_links_are_undone_once() {
        let _alone = exclusive_access();
        let all = || take_undo_bytes().collect::<Vec<_>>();
        assert!(all().is_empty());
        assert_eq!((take_title_save_sequence(), take_title_save_sequence()), (KEEP_TITLE, &b""[..]));
        mark_progress_bar_used();
        mark_links_used();
        assert_eq!(all(), [STRING_END, LINK_OFF, TITLE_BACK, PROGRESS_OFF]);
        assert!(all().is_empty());
        assert_eq!(take_title_save_sequence(), KEEP_TITLE, "the new title should be saved again");
        assert_eq!(all(), [STRING_END, TITLE_BACK]);
    }

    #[test]
    fn vt100_screen_is_restored() {
        let _alone = exclusive_access();
        let side = |length| std::num::NonZero::new(length).expect("not zero");
        let mut screen = vt100::Parser::new(side(5), side(20), 0);
        screen.process(b"shell$ ");
        screen.process(bytes(write_setup).as_bytes());
        screen.process(b"picture");
        assert!(screen.screen().alternate_screen() && screen.screen().hide_cursor());
        screen.process(bytes(write_restore).as_bytes());
        assert!(!screen.screen().alternate_screen() && !screen.screen().hide_cursor());
        assert!(screen.screen().contents().starts_with("shell$ "));
    }

    #[test]
    fn implausible_cell_aspects_are_ignored() {
        assert_eq!(cell_aspect_ratio((80, 24), (80 * 8, 24 * 18)), 2.25);
        assert_eq!(cell_aspect_ratio((80, 24), (0, 0)), 2.0);
        assert_eq!(cell_aspect_ratio((0, 0), (640, 480)), 2.0);
        assert_eq!(cell_aspect_ratio((80, 24), (80, 24)), 2.0);
        assert_eq!(cell_aspect_ratio((100, 50), (1000, 1010)), 2.0);
    }

    #[test]
    fn number_of_cells_is_limited() {
        let of = |columns, rows| {
            let cell_pixels = DEFAULT_CELL_PIXELS;
            let drawn = clamp_window_size(WindowSize {
                columns,
                rows,
                cell_aspect: DEFAULT_CELL_ASPECT,
                cell_pixels,
            });
            (drawn.columns, drawn.rows)
        };
        for usual in [(80, 24), (640, 360), (4096, 256), (0, 0), (0, 24), (1, u16::MAX)] {
            assert_eq!(of(usual.0, usual.1), usual);
        }
        for (columns, rows) in [(32_767, 32_767), (u16::MAX, u16::MAX), (u16::MAX, 1), (300, u16::MAX)] {
            let drawn = of(columns, rows);
            assert!(u32::from(drawn.0) * u32::from(drawn.1) <= MAX_CELLS, "{drawn:?}");
            assert!(drawn.0 >= columns.min(300) && drawn.1 >= rows.min(256), "{drawn:?}");
        }
    }

    #[test]
    fn implausible_cell_sizes_are_ignored() {
        assert_eq!(cell_size_from_window((80, 24), (80 * 9, 24 * 18 + 3)), (9, 18));
        assert_eq!(cell_size_from_window((80, 24), (0, 0)), DEFAULT_CELL_PIXELS);
        assert_eq!(cell_size_from_window((0, 0), (640, 480)), DEFAULT_CELL_PIXELS);
    }

    #[test]
    fn restoring_unused_terminal_does_nothing() {
        let _alone = exclusive_access();
        assert!(!ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire));
        restore_terminal();
        restore_from_other_thread();
        assert!(!ALTERNATE_SCREEN_ACTIVE.load(Ordering::Acquire));
    }
}
