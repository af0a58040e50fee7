//! Handles SIGINT, SIGTERM and SIGHUP.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::system::describe_error;

/// The first signal received, if any.
#[derive(Clone, Debug, Default)]
pub(super) struct ReceivedSignal(Arc<AtomicI32>);

impl ReceivedSignal {
    pub(super) fn signal_number(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Acquire)).filter(|number| *number != 0)
    }
}

/// A signal's name for messages. `None` for SIGHUP, because the terminal is gone.
pub(super) fn signal_name(number: i32) -> Option<&'static str> {
    match number {
        SIGINT => Some("SIGINT"),
        SIGTERM => Some("SIGTERM"),
        _ => None,
    }
}

/// Explains why [`install_signal_handlers`] failed and what to do.
pub(super) fn describe_handler_failure(error: &std::io::Error) -> String {
    format!(
        "cannot listen to signals: {}; raise the limits on open files and on processes (ulimit -n, ulimit -u)",
        describe_error(error)
    )
}

/// Installs handlers that call `on_signal` on a separate thread instead of terminating the process.
///
/// # Errors
/// The handlers could not be set up.
pub(super) fn install_signal_handlers(
    on_signal: impl Fn() + Send + 'static,
) -> std::io::Result<ReceivedSignal> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let received = ReceivedSignal::default();
    let recorder = received.clone();
    std::thread::Builder::new().name("glimt-signals".to_owned()).spawn(move || {
        for number in &mut signals {
            // The first signal determines the exit code.
            let _ = recorder.0.compare_exchange(0, number, Ordering::AcqRel, Ordering::Acquire);
            on_signal();
        }
    })?;
    Ok(received)
}
