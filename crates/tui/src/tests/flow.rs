//! Tests for requests, generations, timing and signals.

use std::time::Duration;

use super::{BLUE, RED, cells_of};
use crate::event::{Effect, Event, KeyPress, RequiredEventSource, Signal};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{self, Command, Failure, PreviewBounds, PreviewUpdate, WriteRequirement};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::state::RequestStatus;
use crate::{ContentChangeTime, ExitStatus};

#[test]
fn first_request_includes_the_preview_size() {
    let mut state = state(80, 24);
    let effects = crate::update::request_first_render(&mut state);
    let request = sent_render_request(&effects).expect("a request");
    assert_eq!(request.preview, Some(PreviewBounds { width: 56, height: 42, around: None }));
    assert_eq!((request.generation, request.write, request.force), (1, WriteRequirement::Try, false));
}

#[test]
fn images_of_older_requests_are_dropped() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let old = ui.state.request.generation;
    ui.press_character('r');
    ui.draw_screen();
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation: old,
        picture: uniform_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    ui.worker_event(protocol::Event::Progress { generation: old, progress: render_progress(0.5, None) });
    ui.worker_event(protocol::Event::Failed { generation: old, failure: Failure::Work("old".to_owned()) });
    assert!(!ui.state.dirty, "outdated events should not cause a redraw");
    assert!(ui.state.work.progress.is_none() && ui.state.overlays.problems.is_none());
    assert_eq!(cells_of(&mut ui, BLUE), 0);
    assert!(cells_of(&mut ui, RED) > 0, "the last image should remain visible");
}

#[test]
fn first_change_is_timed_from_the_save() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let noticed = ui.now;
    ui.now += Duration::from_millis(3);
    let effects = ui.handle_event(Event::FileChanged(ContentChangeTime { noticed }));
    assert_eq!(sent_render_request(&effects).map(|it| it.generation), Some(2));
    ui.handle_event(Event::FirstPreviewSent { generation: 1 });
    assert_eq!(ui.state.saving.first_change, None, "the old preview should not count");
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation: 2,
        picture: uniform_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    ui.now += Duration::from_millis(20);
    ui.handle_event(Event::FirstPreviewSent { generation: 2 });
    ui.worker_event(done_event(2, Vec::new(), false));
    assert!(ui.screen_text().contains(&messages::save_to_screen_text("23 ms")), "{}", ui.screen_text());
    ui.now += Duration::from_millis(20);
    ui.handle_event(Event::FirstPreviewSent { generation: 2 });
    assert!(
        !ui.state.dirty && ui.screen_text().contains(&messages::save_to_screen_text("23 ms")),
        "measured once"
    );
}

#[test]
fn only_the_first_preview_is_urgent() {
    let mut ui = TestUi::new();
    let picture = |ui: &mut TestUi, generation| {
        ui.state.urgent = false;
        ui.handle_event(Event::Preview(PreviewUpdate {
            generation,
            picture: uniform_picture(50, 38, RED),
            range: None,
            section: None,
            lacks_photons: false,
            source: None,
        }));
        ui.state.urgent
    };
    assert!(picture(&mut ui, 1));
    assert!(!picture(&mut ui, 1));
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(!picture(&mut ui, 1), "an outdated preview is not urgent");
    assert!(picture(&mut ui, 2));
    assert!(!picture(&mut ui, 2));
}

#[test]
fn unchanged_state_is_not_redrawn() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.draw_screen();
    ui.press_character('g');
    ui.advance_clock(10_000);
    ui.handle_event(Event::FirstPreviewSent { generation: 1 });
    ui.worker_event(protocol::Event::Preview { generation: 1 });
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::PageUp));
    assert!(!ui.state.dirty);
    assert_eq!(ui.state.next_tick(), None);
}

#[test]
fn clock_stops_while_paused() {
    let mut ui = TestUi::new();
    ui.draw_screen();
    assert!(ui.state.next_tick().is_some());
    ui.advance_clock(250);
    assert!(ui.state.dirty);
    ui.press_character(' ');
    ui.draw_screen();
    assert_eq!(ui.state.next_tick(), None);
}

#[test]
fn preview_is_resized_after_a_delay() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(ui.handle_event(Event::Resize(window(120, 40))).is_empty());
    assert!(cells_of(&mut ui, RED) > 56 * 21, "the current image should be scaled");
    ui.now += Duration::from_millis(50);
    ui.handle_event(Event::Resize(window(200, 60)));
    assert!(ui.advance_clock(50).is_empty());
    let effects = ui.advance_clock(50);
    assert!(matches!(
        effects[..],
        [Effect::Send(Command::Preview(Some(PreviewBounds { width: 152, height: 114, around: None })))]
    ));
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation: 1,
        picture: uniform_picture(149, 112, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    assert!(cells_of(&mut ui, BLUE) > 0, "the new preview should be shown");
    ui.finish_render(RED);
    ui.handle_event(Event::Resize(window(200, 60)));
    assert!(ui.advance_clock(1000).is_empty(), "no request is needed if the size is unchanged");
}

#[test]
fn resize_does_not_restart_the_render() {
    for is_held in [false, true] {
        let mut ui = TestUi::new();
        ui.now += Duration::from_secs(5);
        if is_held {
            ui.press_character(' ');
        }
        ui.handle_event(Event::Resize(window(120, 40)));
        let effects = ui.advance_clock(200);
        assert!(matches!(effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
        assert_eq!((ui.state.request.generation, ui.state.work.paused), (1, is_held));
        assert!(ui.worker_event(done_event(1, Vec::new(), false)).is_empty());
    }
}

#[test]
fn editing_a_comment_reports_unchanged() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.worker_event(protocol::Event::Started { generation: 2 });
    ui.worker_event(done_event(2, Vec::new(), true));
    assert!(ui.screen_text().contains("unchanged"));
    assert!(cells_of(&mut ui, RED) > 0);
}

#[test]
fn signals_quit_suspend_or_redraw() {
    let mut ui = TestUi::new();
    let effect = |ui: &mut TestUi, signal| ui.handle_event(Event::Signal(signal));
    assert!(matches!(effect(&mut ui, Signal::Interrupt)[..], [Effect::Quit(ExitStatus(130))]));
    assert!(matches!(effect(&mut ui, Signal::Terminate)[..], [Effect::Quit(ExitStatus(143))]));
    assert!(matches!(effect(&mut ui, Signal::Hangup)[..], [Effect::Quit(ExitStatus(129))]));
    assert!(matches!(effect(&mut ui, Signal::Suspend)[..], [Effect::Suspend]));
    assert!(matches!(effect(&mut ui, Signal::Quit)[..], [Effect::Quit(ExitStatus(131))]));
    assert!(matches!(effect(&mut ui, Signal::Continue)[..], [Effect::Redraw]));
    assert!(matches!(effect(&mut ui, Signal::Resize)[..], [Effect::Measure]));
}

#[test]
fn lost_event_sources_are_handled() {
    let mut ui = TestUi::new();
    assert!(matches!(ui.handle_event(Event::SourceEnded(RequiredEventSource::Worker))[..], [Effect::GiveUp]));
    assert!(matches!(
        ui.handle_event(Event::SourceEnded(RequiredEventSource::Keys))[..],
        [Effect::Quit(ExitStatus::HANGUP)]
    ));
    assert!(ui.handle_event(Event::SourceEnded(RequiredEventSource::Watcher)).is_empty());
    assert!(ui.screen_text().contains(messages::NOT_WATCHING));
}

#[test]
fn canceled_render_is_reported() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Canceled { generation: 1 });
    assert_eq!(ui.state.work.activity, RequestStatus::Canceled);
    assert!(ui.screen_text().contains("stopped"));
}

#[test]
fn unanswered_writes_are_still_pending_at_exit() {
    let generation = 1;
    let written = |generation| protocol::Event::WriteDone { generation, paths: vec!["a.png".into()] };
    let failed = protocol::Event::WriteFailed { generation, path: None, message: "full".to_owned() };
    let refused = protocol::Event::Refused { generation, conflicts: Vec::new() };
    let postponed = protocol::Event::WritePostponed { generation };
    let ends = [written(generation), failed, refused].map(|event| (Some(event), false));
    for (outcome, is_open) in [(None, true), (Some(postponed), true)].into_iter().chain(ends) {
        let mut ui = TestUi::new();
        assert!(!ui.state.saving.is_write_requested);
        ui.press_character('w');
        if let Some(event) = outcome {
            ui.worker_event(event);
        }
        assert!(matches!(ui.press_character('q')[..], [Effect::Quit(ExitStatus::QUIT)]));
        assert_eq!(ui.state.saving.is_write_requested, is_open);
    }
    let mut ui = TestUi::new();
    ui.press_character('w');
    ui.press_character('r');
    assert!(ui.state.saving.is_write_requested, "the next request should still write the image");
    ui.worker_event(written(ui.state.request.generation));
    assert!(!ui.state.saving.is_write_requested);
}

fn error_with(message: &str) -> Vec<Diagnostic> {
    vec![diagnostic(Severity::Error, message)]
}

#[test]
fn errors_in_incomplete_files_are_deferred() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(error_with("half"));
    let text = ui.screen_text();
    assert!(!text.contains("half") && !text.contains("broken"), "{text}");
    assert!(text.contains("… waiting") && text.contains(messages::INCOMPLETE_FILE), "{text}");
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(error_with("more"));
    assert!(!ui.screen_text().contains("more") && !ui.screen_text().contains("broken"));
    assert!(ui.handle_event(Event::Settled).is_empty());
    let text = ui.screen_text();
    assert!(text.contains("error: more") && text.contains("broken"), "{text}");
    assert!(!text.contains("half"), "outdated error: {text}");
}

#[test]
fn file_saved_in_steps_shows_no_error() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(error_with("half"));
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    ui.handle_event(Event::Settled);
    ui.advance_clock(5000);
    let text = ui.screen_text();
    assert!(!text.contains("half") && text.contains("done"), "{text}");
    assert!(cells_of(&mut ui, BLUE) > 0 && cells_of(&mut ui, RED) == 0);
}

#[test]
fn errors_in_stable_files_are_shown_immediately() {
    let mut ui = TestUi::new();
    ui.report_scene_errors(error_with("first"));
    assert!(ui.screen_text().contains("error: first"), "without a save, errors should not be deferred");
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.handle_event(Event::Settled);
    ui.report_scene_errors(error_with("late"));
    assert!(ui.screen_text().contains("error: late"));
    ui.press_character('r');
    ui.report_scene_errors(error_with("again"));
    assert!(ui.screen_text().contains("error: again"));
}

#[test]
fn errors_are_shown_if_the_watcher_is_lost() {
    let mut ui = TestUi::new();
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(error_with("half"));
    ui.handle_event(Event::SourceEnded(RequiredEventSource::Watcher));
    assert!(ui.screen_text().contains("error: half"), "{}", ui.screen_text());
    ui.press_character('r');
    ui.report_scene_errors(error_with("again"));
    assert!(ui.screen_text().contains("error: again"));
}

#[test]
fn render_failures_are_shown_immediately() {
    let mut ui = TestUi::new();
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    let failure = Failure::Work("no memory".to_owned());
    ui.worker_event(protocol::Event::Failed { generation: ui.state.request.generation, failure });
    assert!(ui.screen_text().contains("no memory"), "{}", ui.screen_text());
}

#[test]
fn time_spent_in_the_editor_is_not_counted() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let noticed = ui.now;
    ui.now += Duration::from_secs(9);
    ui.handle_event(Event::EditorExited);
    ui.now += Duration::from_millis(2);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed }));
    ui.now += Duration::from_millis(20);
    ui.handle_event(Event::FirstPreviewSent { generation: 2 });
    assert_eq!(ui.state.saving.first_change, Some(Duration::from_millis(22)));
    let noticed = ui.now;
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed }));
    ui.now += Duration::from_millis(30);
    ui.handle_event(Event::FirstPreviewSent { generation: 3 });
    assert_eq!(ui.state.saving.first_change, Some(Duration::from_millis(30)));
}
