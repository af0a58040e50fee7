//! Tests of the loop's parts.

use super::*;
use crate::tui::fixtures::state;

#[test]
fn an_idle_state_is_not_woken() {
    let now = Instant::now();
    let mut state = state(80, 24);
    state.dirty = true;
    assert_eq!(next_wake(&state, now), Some(now));
    state.dirty = false;
    assert!(next_wake(&state, now).is_some(), "the clock of a render runs");
    state.activity = crate::tui::state::Activity::Done;
    assert_eq!(next_wake(&state, now), None);
}

#[test]
fn a_source_that_ends_is_reported_after_its_messages() {
    let (from, receiver) = mpsc::channel();
    let (sender, events) = mpsc::channel();
    forward("test", receiver, &sender, Event::of_watcher, Source::Watcher).expect("a thread");
    from.send(super::super::News::Settled).expect("a receiver");
    drop(from);
    assert!(matches!(events.recv(), Ok(Event::Settled)));
    assert!(matches!(events.recv(), Ok(Event::Lost(Source::Watcher))));
}
