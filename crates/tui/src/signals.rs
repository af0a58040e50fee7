//! Handles signals and detects terminals that disappear without sending one.
//!
//! Signals are handled on separate threads because the event loop may be blocked by a terminal that does not
//! accept output, or by endless input. If the event loop does not react to a terminating signal, these
//! threads end the process.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

#[cfg(target_os = "linux")]
use nix::libc;
use nix::sys::signal::{Signal as Number, kill};
use nix::unistd::{Pid, getpgrp, getpid, getppid, getsid};
use signal_hook::consts::{
    SIGALRM, SIGCONT, SIGHUP, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGSYS, SIGTERM, SIGTRAP, SIGTSTP, SIGURG,
    SIGUSR1, SIGUSR2, SIGVTALRM, SIGWINCH, SIGXCPU,
};
use signal_hook::iterator::Signals;
use signal_hook::low_level;

use super::ExitStatus;
use super::event::{Event, Signal};
use super::terminal;
use crate::system::threads::spawn;

/// Grace period for the event loop to exit after a signal.
const GRACE_PERIOD: Duration = Duration::from_millis(1500);
/// Time allowed for a stalled terminal to accept the bytes that restore it.
const RESTORE_TIME_LIMIT: Duration = Duration::from_millis(100);
/// How often to check that the terminal still exists.
const TERMINAL_CHECK_INTERVAL: Duration = Duration::from_millis(500);

/// Signals handled by the event loop.
const HANDLED_SIGNALS: [i32; 7] = [SIGINT, SIGTERM, SIGQUIT, SIGHUP, SIGTSTP, SIGCONT, SIGWINCH];
/// Other signals that terminate the program. The terminal is restored first.
const OTHER_SIGNALS: [i32; 9] =
    [SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU, SIGIO, SIGSYS, SIGTRAP];

/// Linux-specific signals that terminate the program, including real-time signals.
#[cfg(target_os = "linux")]
fn linux_only_terminating_signals() -> impl Iterator<Item = i32> {
    [libc::SIGPWR, libc::SIGSTKFLT].into_iter().chain(libc::SIGRTMIN()..=libc::SIGRTMAX())
}

#[cfg(not(target_os = "linux"))]
fn linux_only_terminating_signals() -> impl Iterator<Item = i32> {
    std::iter::empty()
}

/// A signal used to wake the signal thread. No other program sends it, and it is ignored by default.
const WAKE_SIGNAL: i32 = SIGURG;

/// Signal handler. Dropping it restores the default actions.
pub(super) struct SignalListener {
    over: Arc<AtomicBool>,
}

impl SignalListener {
    /// Starts the signal threads, which send events to `events`.
    pub(super) fn start(events: &Sender<Event>) -> io::Result<Self> {
        let over = Arc::new(AtomicBool::new(false));
        let mut signals = Signals::new(
            HANDLED_SIGNALS
                .into_iter()
                .chain(OTHER_SIGNALS)
                .chain(linux_only_terminating_signals())
                .chain([WAKE_SIGNAL]),
        )?;
        let handler = SignalThread { over: Arc::clone(&over), events: events.clone() };
        spawn("signals", move || {
            loop {
                signals.wait().for_each(|number| handler.handle_signal(number));
                *lock_handled_round_count() += 1;
                HANDLED_ROUNDS.1.notify_all();
            }
        })?;
        let handler = SignalThread { over: Arc::clone(&over), events: events.clone() };
        spawn("terminal-watch", move || handler.watch_for_terminal_loss())?;
        Ok(Self { over })
    }
}

impl Drop for SignalListener {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
    }
}

/// Whether the terminal has hung up. If so, the program ends within [`GRACE_PERIOD`].
static HUNG_UP: AtomicBool = AtomicBool::new(false);

/// Whether signals from the keyboard are handled by a child process.
static CHILD_HANDLES_SIGNALS: AtomicBool = AtomicBool::new(false);

/// Number of rounds in which the signal thread has handled all pending signals.
static HANDLED_ROUNDS: (Mutex<u64>, Condvar) = (Mutex::new(0), Condvar::new());

fn lock_handled_round_count() -> MutexGuard<'static, u64> {
    HANDLED_ROUNDS.0.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How long to wait for the signal thread. Handling takes microseconds, so the timeout expires only if the
/// thread is gone.
const SIGNAL_TIMEOUT: Duration = Duration::from_secs(10);

/// Waits until all signals sent before the call have been handled. Waits for two rounds, because the first
/// may have started before the call.
fn wait_for_pending_signals() {
    for _ in 0..2 {
        let before = lock_handled_round_count();
        let last = *before;
        if low_level::raise(WAKE_SIGNAL).is_ok() {
            drop(HANDLED_ROUNDS.1.wait_timeout_while(before, SIGNAL_TIMEOUT, |now| *now == last));
        }
    }
}

/// The foreground child process, and the signal by which glimt itself is being terminated.
struct ForegroundChildRecord {
    id: Option<Pid>,
    ending: Option<Number>,
}

static CHILD: Mutex<ForegroundChildRecord> = Mutex::new(ForegroundChildRecord { id: None, ending: None });

fn lock_foreground_child() -> MutexGuard<'static, ForegroundChildRecord> {
    CHILD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sets the child process to which terminating signals are forwarded, or `None` once it has exited.
pub(super) fn set_foreground_child(id: Option<Pid>) {
    let mut child = lock_foreground_child();
    child.id = id;
    if let (Some(id), Some(number)) = (id, child.ending) {
        forward_to_job_or_child(id, number);
    }
}

/// Forwards the first terminating signal to the child. Ignores later ones, because this process also receives
/// the signals that it sends to its own job.
fn forward_termination_to_child(number: Number) {
    let mut child = lock_foreground_child();
    if child.ending.replace(number).is_none()
        && let Some(id) = child.id
    {
        forward_to_job_or_child(id, number);
    }
}

/// Forwards the signal to the whole job if this process leads it, since a shell does not forward signals to
/// its children. Otherwise forwards it to the child only.
fn forward_to_job_or_child(id: Pid, number: Number) {
    let whole_job = Pid::from_raw(0);
    // Ignore errors because the process may have exited.
    let _ = kill(if getpgrp() == getpid() { whole_job } else { id }, number);
}

/// Lets the child handle keyboard signals until the returned guard is dropped.
pub(super) fn leave_signals_to_child() -> IgnoredKeyboardSignalsGuard {
    CHILD_HANDLES_SIGNALS.store(true, Ordering::Release);
    IgnoredKeyboardSignalsGuard(())
}

/// Guard returned by [`leave_signals_to_child`].
pub(super) struct IgnoredKeyboardSignalsGuard(());

impl Drop for IgnoredKeyboardSignalsGuard {
    fn drop(&mut self) {
        // If a key press ended the child, this process received the same signal but may not have handled it
        // yet.
        wait_for_pending_signals();
        CHILD_HANDLES_SIGNALS.store(false, Ordering::Release);
    }
}

struct SignalThread {
    over: Arc<AtomicBool>,
    events: Sender<Event>,
}

impl SignalThread {
    fn handle_signal(&self, number: i32) {
        if number == WAKE_SIGNAL {
            return;
        }
        if self.over.load(Ordering::Acquire) {
            // SIGHUP must not interrupt the final checkpoint after a hangup. It may arrive after the event
            // loop has detected the hangup, or a second time from the shell.
            if number == SIGHUP {
                if HUNG_UP.load(Ordering::Acquire) {
                    return;
                }
                if !terminal::terminal_exists() {
                    return self.deliver_signal(Signal::Hangup);
                }
            }
            // signal-hook does not support signals that exist only on Linux.
            if low_level::emulate_default_handler(number).is_err() {
                low_level::exit(128 + number);
            }
            return;
        }
        let is_from_keyboard = matches!(number, SIGINT | SIGQUIT | SIGTSTP | SIGCONT);
        if is_from_keyboard && CHILD_HANDLES_SIGNALS.load(Ordering::Acquire) {
            return;
        }
        let signal = match number {
            SIGINT => Signal::Interrupt,
            SIGTERM => Signal::Terminate,
            SIGQUIT => Signal::Quit,
            SIGHUP => Signal::Hangup,
            SIGTSTP => Signal::Suspend,
            SIGWINCH => Signal::Resize,
            SIGCONT => Signal::Continue,
            other => Signal::Other(other),
        };
        self.deliver_signal(signal);
    }

    fn watch_for_terminal_loss(&self) {
        while !self.over.load(Ordering::Acquire) {
            thread::sleep(TERMINAL_CHECK_INTERVAL);
            if !terminal::terminal_exists() {
                self.deliver_signal(Signal::Hangup);
                return;
            }
        }
    }

    fn deliver_signal(&self, signal: Signal) {
        if signal == Signal::Hangup {
            HUNG_UP.store(true, Ordering::Release);
        }
        if let Some(status) = exit_status_for(signal) {
            if let Ok(number) = Number::try_from(signal_number(signal)) {
                forward_termination_to_child(number);
            }
            let over = Arc::clone(&self.over);
            thread::spawn(move || wait_grace_period_and_exit(signal, status, &over));
        }
        // If the channel is closed, the event loop has ended and does not need the signal.
        let _ = self.events.send(Event::Signal(signal));
    }
}

fn signal_number(signal: Signal) -> i32 {
    match signal {
        Signal::Interrupt => SIGINT,
        Signal::Terminate => SIGTERM,
        Signal::Quit => SIGQUIT,
        Signal::Hangup => SIGHUP,
        Signal::Other(number) => number,
        Signal::Suspend => SIGTSTP,
        Signal::Continue => SIGCONT,
        Signal::Resize => SIGWINCH,
    }
}

/// Exit code for a terminating signal.
fn exit_status_for(signal: Signal) -> Option<ExitStatus> {
    match signal {
        Signal::Interrupt => Some(ExitStatus::INTERRUPTED),
        Signal::Terminate => Some(ExitStatus::TERMINATED),
        Signal::Quit => Some(ExitStatus::ABORTED),
        Signal::Hangup => Some(ExitStatus::HANGUP),
        Signal::Other(number) => Some(ExitStatus::from_signal(number)),
        Signal::Suspend | Signal::Continue | Signal::Resize => None,
    }
}

/// Ends the process if the event loop has not ended. Restores the terminal first, except after a hangup, when
/// it no longer exists. The saved modes are always restored, because a running child may have changed them.
fn wait_grace_period_and_exit(signal: Signal, status: ExitStatus, over: &AtomicBool) {
    thread::sleep(GRACE_PERIOD);
    if signal != Signal::Hangup {
        if over.load(Ordering::Acquire) {
            return;
        }
        terminal::restore_from_other_thread();
        thread::sleep(RESTORE_TIME_LIMIT);
    }
    terminal::restore_saved_terminal_modes();
    low_level::exit(i32::from(status.0));
}

/// Whether a shell could continue this process after it stops. The shell must be in the same session, so a
/// session leader has no such shell.
pub(super) fn can_shell_resume_process() -> bool {
    match (getsid(None), getsid(Some(getppid()))) {
        (Ok(own), Ok(parents)) => own == parents && own != getpid(),
        _ => false,
    }
}

/// Stops the whole job with SIGTSTP, including any wrapper process. This is what ctrl-z does outside raw
/// mode.
pub(super) fn suspend_job() -> io::Result<()> {
    kill(Pid::from_raw(0), Number::SIGTSTP).map_err(io::Error::from)
}

/// Performs the default action of SIGTSTP, which stops this process. Returns when it is continued.
pub(super) fn suspend_process() {
    // If the process cannot be stopped, it keeps running.
    let _ = low_level::emulate_default_handler(SIGTSTP);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn real_time_signals_are_handled() {
        let numbers: Vec<i32> = linux_only_terminating_signals().collect();
        assert!(numbers.contains(&libc::SIGRTMIN()) && numbers.contains(&libc::SIGRTMAX()));
        assert_eq!(exit_status_for(Signal::Other(libc::SIGRTMAX())), Some(ExitStatus(128 + 64)));
    }

    #[test]
    fn terminating_signals_have_exit_codes() {
        assert_eq!(exit_status_for(Signal::Interrupt), Some(ExitStatus(130)));
        assert_eq!(exit_status_for(Signal::Terminate), Some(ExitStatus(143)));
        assert_eq!(exit_status_for(Signal::Quit), Some(ExitStatus(131)));
        assert_eq!(exit_status_for(Signal::Hangup), Some(ExitStatus(129)));
        assert_eq!(exit_status_for(Signal::Other(SIGUSR1)), Some(ExitStatus(128 + SIGUSR1 as u8)));
        assert_eq!(exit_status_for(Signal::Suspend), None);
        assert_eq!(exit_status_for(Signal::Continue), None);
        assert_eq!(exit_status_for(Signal::Resize), None);
    }
}
