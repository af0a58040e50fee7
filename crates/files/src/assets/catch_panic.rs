//! Converts panics in third-party decoders into errors.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static IS_CATCHING: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work`. If it panics, returns the panic message as an error instead of printing it.
///
/// The first call installs a panic hook that forwards all other panics to the previous hook. A front end that
/// has its own hook (for example, to restore the terminal) must install that hook before loading any file.
///
/// # Errors
///
/// The panic message.
pub fn catch_panic<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    install_silencing_hook();
    let outer = IS_CATCHING.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    IS_CATCHING.set(outer);
    result.map_err(|payload| panic_message(payload.as_ref()))
}

fn install_silencing_hook() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_CATCHING.get() {
                previous(info);
            }
        }));
    });
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_messages_are_returned_as_errors() {
        let number = 7;
        assert_eq!(catch_panic(|| panic!("at {number}")), Err::<(), _>("at 7".to_owned()));
        assert_eq!(catch_panic(|| 3), Ok(3));
        assert!(!IS_CATCHING.get());
    }
}
