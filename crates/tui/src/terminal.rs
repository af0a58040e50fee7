//! Terminal setup and restoration.
//!
//! A [`TerminalSession`] owns the terminal. The terminal is restored when the session is dropped, when the
//! front-end thread panics, before the process stops, and by [`restore_from_other_thread`] if the front end
//! is blocked.

mod restore_on_abort;
mod sequences;
mod window_size;

use std::cell::Cell;
use std::fs::File;
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use crossterm::terminal::{disable_raw_mode, enable_raw_mode};
use nix::sys::termios::{FlushArg, SetArg, Termios, tcflush, tcgetattr, tcsetattr};

use super::options::TuiError;
use super::writer;
use restore_on_abort::prepare_restore_on_abort;
use sequences::{FOCUS_ON, MOUSE_OFF, MOUSE_ON, MOUSE_REPORTING_ENABLED, write_restore, write_setup};
pub(super) use sequences::{
    enable_focus_reports_on_setup, mark_images_used, mark_links_used, mark_progress_bar_used,
    take_title_save_sequence,
};
pub(super) use window_size::query_window_size;

/// Whether the alternate screen is active.
static ALTERNATE_SCREEN_ACTIVE: AtomicBool = AtomicBool::new(false);
/// Whether the terminal is in raw mode.
static RAW_MODE_ACTIVE: AtomicBool = AtomicBool::new(false);
/// The thread that owns the terminal. Its panics restore the terminal. Panic messages from other threads are
/// stored in [`PANIC`].
static OWNER: Mutex<Option<ThreadId>> = Mutex::new(None);
/// Message from the last panic in a thread that does not own the terminal.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

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

/// Saves the terminal modes for [`restore_saved_terminal_modes`] before another program uses the terminal.
pub(super) fn save_terminal_modes() {
    *LENT_TERMINAL_MODES.lock().unwrap_or_else(PoisonError::into_inner) = tcgetattr(io::stdin()).ok();
}

/// Restores the modes saved by [`save_terminal_modes`], because a killed program may leave the terminal in a
/// different mode. Errors are ignored because nothing can be done about them.
pub(super) fn restore_saved_terminal_modes() {
    if let Some(modes) = LENT_TERMINAL_MODES.lock().unwrap_or_else(PoisonError::into_inner).take() {
        let _ = tcsetattr(io::stdin(), SetArg::TCSANOW, &modes);
    }
}

/// The terminal, opened during setup, so that restoring it does not need another file descriptor.
static OUTPUT: Mutex<Option<File>> = Mutex::new(None);

fn take_output_kept_for_restoring() -> Option<File> {
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
        .and_then(|()| take_output_kept_for_restoring().map_or_else(writer::open_terminal_output, Ok))
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
            tty.or_else(|error| take_output_kept_for_restoring().ok_or(error))
                .and_then(|mut tty| write_restore(&mut tty))
        });
    }
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

#[cfg(test)]
mod tests;
