//! Handles SIGINT, SIGTERM and SIGHUP.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::system::describe_error;
use crate::system::threads::{describe_start_failure, spawn};

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

/// Installs handlers that call `on_signal` on a separate thread instead of terminating the process.
///
/// # Errors
/// The handlers could not be set up. The message explains why and what to do.
pub(super) fn install_signal_handlers(
    on_signal: impl Fn() + Send + 'static,
) -> Result<ReceivedSignal, String> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(|error| {
        let why = describe_error(&error);
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
    spawn("glimt-signals", listen).map_err(|error| describe_start_failure(1, false, &error))?;
    Ok(received)
}
