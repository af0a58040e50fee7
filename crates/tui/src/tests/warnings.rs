//! Tests of warnings: likely mistakes are counted and shown.

use crate::Changed;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::pipeline::protocol;
use crate::scene::diagnostic::Severity;

#[test]
fn warnings_are_counted_and_shown_on_demand() {
    let mut ui = TestUi::new();
    ui.worker(done(1, vec![diagnostic(Severity::Warning, "texture `b` is not used")], false));
    assert!(ui.text().contains("1 warning") && !ui.text().contains("not used"));
    ui.press('e');
    assert!(ui.text().contains("warning: texture `b` is not used"));
    ui.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!ui.text().contains("not used"));
}

#[test]
fn warnings_are_counted_in_one_place() {
    for (columns, rows) in [(60, 20), (80, 24), (120, 40), (200, 60)] {
        let mut ui = TestUi::with(state(columns, rows));
        ui.worker(done(1, vec![diagnostic(Severity::Warning, "odd")], false));
        let text = ui.text();
        assert_eq!(text.matches("1 warning").count(), 1, "{text}");
        assert!(text.contains("e 1 warning"), "{text}");
    }
}

#[test]
fn warnings_are_there_while_the_picture_is_rendered() {
    let mut ui = TestUi::new();
    ui.worker(protocol::Event::Started { generation: 1 });
    ui.press('e');
    assert!(ui.text().contains("files are still being read"), "{}", ui.text());
    let warnings = vec![diagnostic(Severity::Warning, "texture `b` is not used")];
    ui.worker(protocol::Event::Warnings { generation: 1, warnings });
    ui.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, None) });
    assert!(ui.text().contains("1 warning"), "{}", ui.text());
    ui.press('e');
    assert!(ui.text().contains("warning: texture `b` is not used"), "{}", ui.text());
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.worker(protocol::Event::Warnings { generation: 2, warnings: Vec::new() });
    assert!(!ui.text().contains("not used"), "the scene has none any more: {}", ui.text());
    ui.press('e');
    assert!(ui.text().contains("no errors and no warnings"), "{}", ui.text());
}

#[test]
fn warnings_below_errors_are_counted_with_them() {
    let mut ui = TestUi::new();
    ui.fail(vec![diagnostic(Severity::Error, "wrong"), diagnostic(Severity::Warning, "odd")]);
    ui.event(Event::Settled);
    assert!(ui.text().contains("─ 1 error, 1 warning ─"), "{}", ui.text());
}
