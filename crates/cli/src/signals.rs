//! Handles SIGINT, SIGTERM and SIGHUP.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::system::describe_io_error;
use crate::system::threads::{describe_thread_start_failure, spawn};

/// The first signal received, or 0.
#[derive(Clone, Debug, Default)]
pub(super) struct ReceivedSignal(Arc<AtomicI32>);

impl ReceivedSignal {
    pub(super) fn signal_number(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Acquire)).filter(|number| *number != 0)
    }
}

/// Returns a signal's name for use in messages, or `None` for SIGHUP, because the terminal is gone.
pub(super) fn signal_name(number: i32) -> Option<&'static str> {
    match number {
        SIGINT => Some("SIGINT"),
        SIGTERM => Some("SIGTERM"),
        _ => None,
    }
}

/// Runs a command whose token a signal cancels. The command must not write anything once it is canceled.
pub(super) fn run_cancelable_by_signals(
    console: &Console,
    command: impl FnOnce(&CancelToken) -> Exit,
) -> Exit {
    let token = CancelToken::new();
    let cancel = token.clone();
    let ended = match install_signal_handlers(move || cancel.cancel()) {
        Ok(ended) => ended,
        Err(message) => return console.print_error(Exit::FAILED, &message),
    };
    let exit = command(&token);
    let Some(number) = ended.signal_number() else { return exit };
    if let Some(signal) = signal_name(number).filter(|_| exit != Exit::DONE) {
        console.print_line_to_stderr(&format!("terminated by {signal}: nothing was written"));
    }
    Exit::from_signal(number)
}

/// Installs handlers that call `on_signal` on a separate thread instead of terminating the process.
///
/// # Errors
/// The handlers could not be set up. The message explains why and what to do.
pub(super) fn install_signal_handlers(
    on_signal: impl Fn() + Send + 'static,
) -> Result<ReceivedSignal, String> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(|error| {
        let why = describe_io_error(&error);
        format!("cannot listen for signals: {why}; raise the limit on open files (`ulimit -n`)")
    })?;
    let received = ReceivedSignal::default();
    let recorder = received.clone();
    let listen = move || {
        for number in &mut signals {
            // The first signal determines the exit code.
            let _ = recorder.0.compare_exchange(0, number, Ordering::AcqRel, Ordering::Acquire);
            on_signal();
        }
    };
    spawn("glimt-signals", listen).map_err(|error| describe_thread_start_failure(1, false, &error))?;
    Ok(received)
}
