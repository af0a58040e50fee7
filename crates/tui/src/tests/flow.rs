//! Requests, generations, time and signals.

use std::time::Duration;

use super::{BLUE, RED, cells_of};
use crate::event::{Effect, Event, KeyPress, Signal, Source};
use crate::fixtures::*;
use crate::pipeline::protocol::{self, Command, Failure, PreviewSize, Writing};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::state::Activity;
use crate::{Changed, ExitStatus};

#[test]
fn the_first_request_has_room_for_the_preview() {
    let mut state = state(80, 24);
    let effects = crate::update::start(&mut state);
    let request = request(&effects).expect("a request");
    assert_eq!(request.preview, Some(PreviewSize { width: 56, height: 42, around: None }));
    assert_eq!((request.generation, request.write, request.force), (1, Writing::Try, false));
}

#[test]
fn pictures_of_older_generations_are_dropped() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let old = desk.state.request.generation;
    desk.press('r');
    desk.screen();
    desk.event(Event::Picture {
        generation: old,
        picture: plain_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    desk.worker(protocol::Event::Progress { generation: old, progress: progress(0.5, None) });
    desk.worker(protocol::Event::Failed { generation: old, failure: Failure::Work("old".to_owned()) });
    assert!(!desk.state.dirty, "nothing is drawn for them");
    assert!(desk.state.work.progress.is_none() && desk.state.overlays.problems.is_none());
    assert_eq!(cells_of(&mut desk, BLUE), 0);
    assert!(cells_of(&mut desk, RED) > 0, "the last picture stands until there is a newer one");
}

#[test]
fn the_first_change_is_measured_from_the_save_to_the_frame() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let noticed = desk.now;
    desk.now += Duration::from_millis(3);
    let effects = desk.event(Event::Changed(Changed { noticed }));
    assert_eq!(request(&effects).map(|it| it.generation), Some(2));
    desk.event(Event::Shown { generation: 1 });
    assert_eq!(desk.state.saving.first_change, None, "the old picture does not count");
    desk.event(Event::Picture {
        generation: 2,
        picture: plain_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    desk.now += Duration::from_millis(20);
    desk.event(Event::Shown { generation: 2 });
    desk.worker(done(2, Vec::new(), false));
    assert!(desk.text().contains("saved → seen 23 ms"), "{}", desk.text());
    desk.now += Duration::from_millis(20);
    desk.event(Event::Shown { generation: 2 });
    assert!(!desk.state.dirty && desk.text().contains("seen 23 ms"), "measured once");
}

#[test]
fn only_the_first_picture_of_a_request_does_not_wait_for_its_turn() {
    let mut desk = Desk::new();
    let picture = |desk: &mut Desk, generation| {
        desk.state.urgent = false;
        desk.event(Event::Picture {
            generation,
            picture: plain_picture(50, 38, RED),
            range: None,
            section: None,
            lacks_photons: false,
            source: None,
        });
        desk.state.urgent
    };
    assert!(picture(&mut desk, 1));
    assert!(!picture(&mut desk, 1));
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(!picture(&mut desk, 1), "an old one is no news");
    assert!(picture(&mut desk, 2));
    assert!(!picture(&mut desk, 2));
}

#[test]
fn nothing_is_drawn_when_nothing_changed() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.screen();
    desk.press('g');
    desk.wait(10_000);
    desk.event(Event::Shown { generation: 1 });
    desk.worker(protocol::Event::Preview { generation: 1 });
    desk.key(KeyPress::special(crossterm::event::KeyCode::PageUp));
    assert!(!desk.state.dirty);
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn the_clock_runs_while_rendering_and_stands_while_paused() {
    let mut desk = Desk::new();
    desk.screen();
    assert!(desk.state.next_tick().is_some());
    desk.wait(250);
    assert!(desk.state.dirty);
    desk.press(' ');
    desk.screen();
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn another_window_asks_for_another_preview_once_it_is_quiet() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.event(Event::Resize(window(120, 40))).is_empty());
    assert!(cells_of(&mut desk, RED) > 56 * 21, "the picture at hand is scaled meanwhile");
    desk.now += Duration::from_millis(50);
    desk.event(Event::Resize(window(200, 60)));
    assert!(desk.wait(50).is_empty());
    let effects = desk.wait(50);
    assert!(matches!(
        effects[..],
        [Effect::Send(Command::Preview(Some(PreviewSize { width: 152, height: 114, around: None })))]
    ));
    desk.event(Event::Picture {
        generation: 1,
        picture: plain_picture(149, 112, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    assert!(cells_of(&mut desk, BLUE) > 0, "the same request shows its picture again");
    desk.finish(RED);
    desk.event(Event::Resize(window(200, 60)));
    assert!(desk.wait(1000).is_empty(), "the same size asks for nothing");
}

#[test]
fn a_render_goes_on_in_another_window_held_or_not() {
    for is_held in [false, true] {
        let mut desk = Desk::new();
        desk.now += Duration::from_secs(5);
        if is_held {
            desk.press(' ');
        }
        desk.event(Event::Resize(window(120, 40)));
        let effects = desk.wait(200);
        assert!(matches!(effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
        assert_eq!((desk.state.request.generation, desk.state.work.paused), (1, is_held));
        assert!(desk.worker(done(1, Vec::new(), false)).is_empty());
    }
}

#[test]
fn a_comment_edited_renders_nothing_and_says_so() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.worker(protocol::Event::Started { generation: 2 });
    desk.worker(done(2, Vec::new(), true));
    assert!(desk.text().contains("unchanged"));
    assert!(cells_of(&mut desk, RED) > 0);
}

#[test]
fn signals_end_stop_and_redraw() {
    let mut desk = Desk::new();
    let effect = |desk: &mut Desk, signal| desk.event(Event::Signal(signal));
    assert!(matches!(effect(&mut desk, Signal::Interrupt)[..], [Effect::Quit(ExitStatus(130))]));
    assert!(matches!(effect(&mut desk, Signal::Terminate)[..], [Effect::Quit(ExitStatus(143))]));
    assert!(matches!(effect(&mut desk, Signal::Hangup)[..], [Effect::Quit(ExitStatus(129))]));
    assert!(matches!(effect(&mut desk, Signal::Suspend)[..], [Effect::Suspend]));
    assert!(matches!(effect(&mut desk, Signal::Quit)[..], [Effect::Quit(ExitStatus(131))]));
    assert!(matches!(effect(&mut desk, Signal::Continue)[..], [Effect::Redraw]));
    assert!(matches!(effect(&mut desk, Signal::Resize)[..], [Effect::Measure]));
}

#[test]
fn a_source_that_ends_is_dealt_with() {
    let mut desk = Desk::new();
    assert!(matches!(desk.event(Event::Lost(Source::Worker))[..], [Effect::GiveUp]));
    assert!(matches!(desk.event(Event::Lost(Source::Keys))[..], [Effect::Quit(ExitStatus::HANGUP)]));
    assert!(desk.event(Event::Lost(Source::Watcher)).is_empty());
    assert!(desk.text().contains("no longer watched"));
}

#[test]
fn a_cancelled_render_says_that_it_stopped() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Cancelled { generation: 1 });
    assert_eq!(desk.state.work.activity, Activity::Cancelled);
    assert!(desk.text().contains("stopped"));
}

#[test]
fn whether_the_person_knows_what_came_of_a_write_is_known_at_the_end() {
    let generation = 1;
    let written = |generation| protocol::Event::WriteDone { generation, paths: vec!["a.png".into()] };
    let failed = protocol::Event::WriteFailed { generation, path: None, message: "full".to_owned() };
    let refused = protocol::Event::Refused { generation, conflicts: Vec::new() };
    let postponed = protocol::Event::WritePostponed { generation };
    let ends = [written(generation), failed, refused].map(|event| (Some(event), false));
    for (outcome, is_open) in [(None, true), (Some(postponed), true)].into_iter().chain(ends) {
        let mut desk = Desk::new();
        assert!(!desk.state.saving.is_write_requested);
        desk.press('w');
        if let Some(event) = outcome {
            desk.worker(event);
        }
        assert!(matches!(desk.press('q')[..], [Effect::Quit(ExitStatus::QUIT)]));
        assert_eq!(desk.state.saving.is_write_requested, is_open);
    }
    let mut desk = Desk::new();
    desk.press('w');
    desk.press('r');
    assert!(desk.state.saving.is_write_requested, "the order goes over to the next request");
    desk.worker(written(desk.state.request.generation));
    assert!(!desk.state.saving.is_write_requested);
}

fn wrong(message: &str) -> Vec<Diagnostic> {
    vec![diagnostic(Severity::Error, message)]
}

#[test]
fn a_file_that_is_half_there_is_no_error_until_it_stays_so() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(wrong("half"));
    let text = desk.text();
    assert!(!text.contains("half") && !text.contains("broken"), "{text}");
    assert!(text.contains("… waiting") && text.contains("for the file to be whole"), "{text}");
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(wrong("three quarters"));
    assert!(!desk.text().contains("three quarters") && !desk.text().contains("broken"));
    assert!(desk.event(Event::Settled).is_empty());
    let text = desk.text();
    assert!(text.contains("error: three quarters") && text.contains("broken"), "{text}");
    assert!(!text.contains("half"), "of what is in the file now: {text}");
}

#[test]
fn a_file_that_comes_in_two_pieces_shows_no_error() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(wrong("half"));
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.finish(BLUE);
    desk.event(Event::Settled);
    desk.wait(5000);
    let text = desk.text();
    assert!(!text.contains("half") && text.contains("done"), "{text}");
    assert!(cells_of(&mut desk, BLUE) > 0 && cells_of(&mut desk, RED) == 0);
}

#[test]
fn an_error_in_a_file_that_stays_as_it_is_is_shown_at_once() {
    let mut desk = Desk::new();
    desk.fail(wrong("from the start"));
    assert!(desk.text().contains("error: from the start"), "nothing was saved");
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.event(Event::Settled);
    desk.fail(wrong("that took long to be found"));
    assert!(desk.text().contains("error: that took long to be found"));
    desk.press('r');
    desk.fail(wrong("again"));
    assert!(desk.text().contains("error: again"));
}

#[test]
fn an_error_does_not_wait_for_a_watcher_that_is_gone() {
    let mut desk = Desk::new();
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(wrong("half"));
    desk.event(Event::Lost(Source::Watcher));
    assert!(desk.text().contains("error: half"), "{}", desk.text());
    desk.press('r');
    desk.fail(wrong("again"));
    assert!(desk.text().contains("error: again"));
}

#[test]
fn a_failure_of_the_work_does_not_wait_for_the_file() {
    let mut desk = Desk::new();
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    let failure = Failure::Work("no memory".to_owned());
    desk.worker(protocol::Event::Failed { generation: desk.state.request.generation, failure });
    assert!(desk.text().contains("no memory"), "{}", desk.text());
}

#[test]
fn time_in_the_editor_is_not_from_the_save_to_the_screen() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let noticed = desk.now;
    desk.now += Duration::from_secs(9);
    desk.event(Event::Back);
    desk.now += Duration::from_millis(2);
    desk.event(Event::Changed(Changed { noticed }));
    desk.now += Duration::from_millis(20);
    desk.event(Event::Shown { generation: 2 });
    assert_eq!(desk.state.saving.first_change, Some(Duration::from_millis(22)));
    let noticed = desk.now;
    desk.event(Event::Changed(Changed { noticed }));
    desk.now += Duration::from_millis(30);
    desk.event(Event::Shown { generation: 3 });
    assert_eq!(desk.state.saving.first_change, Some(Duration::from_millis(30)));
}
