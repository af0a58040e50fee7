//! SIGINT, SIGTERM and SIGHUP as values.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

/// The number of the signal that came first, once one came.
#[derive(Clone, Debug, Default)]
pub(super) struct Ended(Arc<AtomicI32>);

impl Ended {
    pub(super) fn by(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Acquire)).filter(|number| *number != 0)
    }
}

/// The name of a signal that a person or a program sent; after SIGHUP nobody reads it.
pub(super) fn name(number: i32) -> Option<&'static str> {
    match number {
        SIGINT => Some("SIGINT"),
        SIGTERM => Some("SIGTERM"),
        _ => None,
    }
}

/// From now on these signals call `on_signal` on a thread of their own rather than end the process.
///
/// # Errors
/// The handlers could not be set up.
pub(super) fn catch(on_signal: impl Fn() + Send + 'static) -> std::io::Result<Ended> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let ended = Ended::default();
    let noted = ended.clone();
    std::thread::Builder::new().name("glimt-signals".to_owned()).spawn(move || {
        for number in &mut signals {
            // The first one is what the exit code tells.
            let _ = noted.0.compare_exchange(0, number, Ordering::AcqRel, Ordering::Acquire);
            on_signal();
        }
    })?;
    Ok(ended)
}
