//! Tests of warnings: likely mistakes are counted and shown.

use crate::Changed;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::pipeline::protocol;
use crate::scene::diagnostic::Severity;

#[test]
fn warnings_are_counted_and_shown_on_demand() {
    let mut desk = Desk::new();
    desk.worker(done(1, vec![diagnostic(Severity::Warning, "texture `b` is not used")], false));
    assert!(desk.text().contains("1 warning") && !desk.text().contains("not used"));
    desk.press('e');
    assert!(desk.text().contains("warning: texture `b` is not used"));
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!desk.text().contains("not used"));
}

#[test]
fn warnings_are_counted_in_one_place() {
    for (columns, rows) in [(60, 20), (80, 24), (120, 40), (200, 60)] {
        let mut desk = Desk::with(state(columns, rows));
        desk.worker(done(1, vec![diagnostic(Severity::Warning, "odd")], false));
        let text = desk.text();
        assert_eq!(text.matches("1 warning").count(), 1, "{text}");
        assert!(text.contains("e 1 warning"), "{text}");
    }
}

#[test]
fn warnings_are_there_while_the_picture_is_rendered() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Started { generation: 1 });
    desk.press('e');
    assert!(desk.text().contains("files are still being read"), "{}", desk.text());
    let warnings = vec![diagnostic(Severity::Warning, "texture `b` is not used")];
    desk.worker(protocol::Event::Warnings { generation: 1, warnings });
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, None) });
    assert!(desk.text().contains("1 warning"), "{}", desk.text());
    desk.press('e');
    assert!(desk.text().contains("warning: texture `b` is not used"), "{}", desk.text());
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.worker(protocol::Event::Warnings { generation: 2, warnings: Vec::new() });
    assert!(!desk.text().contains("not used"), "the scene has none any more: {}", desk.text());
    desk.press('e');
    assert!(desk.text().contains("no errors and no warnings"), "{}", desk.text());
}

#[test]
fn warnings_below_errors_are_counted_with_them() {
    let mut desk = Desk::new();
    desk.fail(vec![diagnostic(Severity::Error, "wrong"), diagnostic(Severity::Warning, "odd")]);
    desk.event(Event::Settled);
    assert!(desk.text().contains("─ 1 error, 1 warning ─"), "{}", desk.text());
}
