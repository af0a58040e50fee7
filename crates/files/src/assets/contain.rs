//! Foreign decoders may panic on hostile files; here such a panic becomes a value, and nothing is printed.

use std::any::Any;
use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` and returns a panic inside as its message.
///
/// The panic hook set at the first call stays in charge of every other panic. A front end that sets a hook of its own
/// (to restore the terminal) does so before it loads anything.
///
/// # Errors
/// The message of a panic.
pub fn contain<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    hush_contained_panics();
    let outer = CONTAINED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(work));
    CONTAINED.set(outer);
    result.map_err(|payload| message(payload.as_ref()))
}

fn hush_contained_panics() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CONTAINED.get() {
                previous(info);
            }
        }));
    });
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_message_and_the_next_call_is_unharmed() {
        let number = 7;
        assert_eq!(contain(|| panic!("at {number}")), Err::<(), _>("at 7".to_owned()));
        assert_eq!(contain(|| 3), Ok(3));
        assert!(!CONTAINED.get());
    }
}
