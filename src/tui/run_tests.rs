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
fn multiplexers_and_networks_are_known_by_their_variables() {
    let way = |pairs: &[(&str, &str)]| {
        way(|name| pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned()))
    };
    assert!(!way(&[("TERM", "xterm-256color"), ("TMUX", "")]).is_multiplexed);
    assert!(way(&[("TERM", "xterm-256color"), ("TMUX", "/tmp/tmux-0/default,1,0")]).is_multiplexed);
    assert!(way(&[("TERM", "tmux-256color")]).is_multiplexed);
    assert!(way(&[("TERM", "screen.xterm-256color")]).is_multiplexed);
    assert!(way(&[("STY", "1234.pts-0")]).is_multiplexed);
    assert!(way(&[("SSH_CONNECTION", "10.0.0.1 5000 10.0.0.2 22")]).is_remote);
    assert!(!way(&[("TMUX", "/tmp/tmux-0/default,1,0"), ("SSH_TTY", "")]).is_remote);
}

#[test]
fn a_terminal_is_asked_what_is_not_known_of_it() {
    let ask = |preview, color, depth, pairs: &[(&str, &str)]| {
        ask(preview, color, depth, |name| {
            pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    };
    let (auto, xterm) = (PreviewChoice::Auto, ("TERM", "xterm-256color"));
    let none = Ask::default();
    let found = ask(auto, ColorChoice::Auto, ColorDepth::Indexed256, &[xterm]);
    assert_eq!(found, Ask { blocks: true, true_color: true, ..none });
    let found = ask(auto, ColorChoice::Ansi16, ColorDepth::Ansi16, &[xterm]);
    assert_eq!(found, Ask { blocks: true, palette: true, ..none });
    let tmux = ("TMUX", "/tmp/tmux-0/default,1,0");
    assert_eq!(ask(auto, ColorChoice::Auto, ColorDepth::Indexed256, &[xterm, tmux]), none);
    assert_eq!(ask(PreviewChoice::HalfBlock, ColorChoice::Auto, ColorDepth::TrueColor, &[xterm]), none);
    let found = ask(auto, ColorChoice::None, ColorDepth::None, &[xterm]);
    assert_eq!(found, Ask { background: true, ..none });
    assert_eq!(ask(auto, ColorChoice::Auto, ColorDepth::Ansi16, &[("TERM", "linux")]), none);
}

#[test]
fn without_colours_the_preview_is_a_ramp() {
    assert_eq!(PreviewKind::of(PreviewChoice::Auto, ColorDepth::None), PreviewKind::Ascii);
    assert_eq!(PreviewKind::of(PreviewChoice::HalfBlock, ColorDepth::None), PreviewKind::Ascii);
    assert_eq!(PreviewKind::of(PreviewChoice::Auto, ColorDepth::Ansi16), PreviewKind::HalfBlock);
    assert_eq!(PreviewKind::of(PreviewChoice::None, ColorDepth::TrueColor), PreviewKind::None);
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
