//! Tests for the warning count and the diagnostics pane.

use crate::ContentChangeTime;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol;
use crate::scene::diagnostic::Severity;

#[test]
fn warnings_are_counted_and_shown_on_demand() {
    let mut ui = TestUi::new();
    ui.worker_event(done_event(1, vec![diagnostic(Severity::Warning, "unused `b`")], false));
    assert!(ui.screen_text().contains("1 warning") && !ui.screen_text().contains("unused"));
    ui.press_character('e');
    assert!(ui.screen_text().contains("warning: unused `b`"));
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!ui.screen_text().contains("unused"));
}

#[test]
fn warnings_are_counted_in_only_one_place() {
    for (columns, rows) in [(60, 20), (80, 24), (120, 40), (200, 60)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.worker_event(done_event(1, vec![diagnostic(Severity::Warning, "odd")], false));
        let text = ui.screen_text();
        assert_eq!(text.matches("1 warning").count(), 1, "{text}");
        assert!(text.contains("e 1 warning"), "{text}");
    }
}

#[test]
fn warnings_are_shown_during_the_render() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Started { generation: 1 });
    ui.press_character('e');
    assert!(ui.screen_text().contains(messages::STILL_READING), "{}", ui.screen_text());
    let warnings = vec![diagnostic(Severity::Warning, "unused `b`")];
    ui.worker_event(protocol::Event::Warnings { generation: 1, warnings });
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.5, None) });
    assert!(ui.screen_text().contains("1 warning"), "{}", ui.screen_text());
    ui.press_character('e');
    assert!(ui.screen_text().contains("warning: unused `b`"), "{}", ui.screen_text());
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.worker_event(protocol::Event::Warnings { generation: 2, warnings: Vec::new() });
    assert!(!ui.screen_text().contains("unused"), "expected no more warnings: {}", ui.screen_text());
    ui.press_character('e');
    assert!(ui.screen_text().contains(messages::NO_DIAGNOSTICS), "{}", ui.screen_text());
}

#[test]
fn warnings_are_counted_with_errors() {
    let mut ui = TestUi::new();
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong"), diagnostic(Severity::Warning, "odd")]);
    ui.handle_event(Event::Settled);
    assert!(ui.screen_text().contains("─ 1 error, 1 warning ─"), "{}", ui.screen_text());
}
