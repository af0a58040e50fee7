//! Tests for the overlays: help, view list and diagnostics.

use crossterm::event::KeyCode;

use super::{RED, cells_of};
use crate::choice::Choice;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::keymap::{KEYMAP, OVERLAY};
use crate::messages;
use crate::pipeline::protocol::{self, Failure, PreviewUpdate};
use crate::pipeline::settings::{EffectiveSettingsSummary, ViewMode};
use crate::scene::diagnostic::{Diagnostic, Severity, SourceSpan};

/// Number of views.
const VIEWS: u16 = ViewMode::ALL.len() as u16;

const ESCAPE: KeyPress = KeyPress::special(KeyCode::Esc);

#[test]
fn help_shows_every_key_at_every_window_size() {
    for (columns, rows) in [(80, 24), (120, 40), (80, 12), (80, 8)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.press_character('?');
        let mut seen = ui.screen_text();
        for _ in 0..60 {
            ui.press_character('j');
            seen += &ui.screen_text();
        }
        let lines =
            KEYMAP.iter().map(|it| (it.label, it.help)).chain(OVERLAY.iter().map(|it| (it.label, it.help)));
        for (label, help) in lines.filter(|(_, help)| !help.is_empty()) {
            let line = seen.lines().find(|line| line.contains(help));
            let line = line.unwrap_or_else(|| panic!("{help:?} not found in\n{seen}"));
            assert!(line.contains(label), "{line:?}");
        }
        ui.press_key(ESCAPE);
        assert!(!ui.screen_text().contains(" keys "));
    }
}

#[test]
fn help_scrolls_to_both_ends_with_every_key() {
    let mut ui = TestUi::from_state(state(60, 12));
    ui.press_character('?');
    let top = ui.screen_text();
    assert!(top.contains("j k scroll") && top.contains("esc close"), "{top}");
    let special = |code| KeyPress::special(code);
    for (forth, back) in [
        (KeyPress::plain('j'), KeyPress::plain('k')),
        (special(KeyCode::Down), special(KeyCode::Up)),
        (special(KeyCode::PageDown), special(KeyCode::PageUp)),
    ] {
        ui.press_key(forth);
        assert_ne!(ui.screen_text(), top, "{forth:?}");
        ui.press_key(back);
        assert_eq!(ui.screen_text(), top, "{back:?}");
        ui.press_key(back);
        assert!(!ui.state.dirty, "at the top");
    }
    for _ in 0..60 {
        ui.press_character('j');
    }
    ui.draw_screen();
    ui.press_character('j');
    assert!(!ui.state.dirty, "at the end");
    ui.press_character('?');
    ui.press_character('?');
    assert_eq!(ui.screen_text(), top, "the help should reopen at the top");
}

#[test]
fn help_is_readable_in_a_small_window() {
    for (columns, rows) in [(40, 12), (30, 8)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.press_character('?');
        let mut seen = String::new();
        for _ in 0..200 {
            assert!(!ui.screen_text().contains('…'), "{}", ui.screen_text());
            // Collect only the first line of each page to avoid duplicates.
            let line = ui.screen_text().lines().nth(1).map(str::to_owned).unwrap_or_default();
            seen += &line.replace(['│', '╭', '╮'], " ");
            ui.press_character('j');
        }
        let seen: Vec<&str> = seen.split_whitespace().collect();
        for help in KEYMAP.iter().map(|it| it.help).filter(|help| !help.is_empty()).take(20) {
            let is_there = help.split_whitespace().all(|word| seen.contains(&word));
            assert!(is_there, "{help:?} not found in {seen:?}");
        }
    }
}

#[test]
fn scroll_keys_are_shown_only_when_needed() {
    for (rows, is_long) in [(24, true), (60, false)] {
        let mut ui = TestUi::from_state(state(80, rows));
        ui.press_character('?');
        assert!(ui.screen_text().contains("esc close"), "{}", ui.screen_text());
        assert_eq!(ui.screen_text().contains("j k scroll"), is_long, "{}", ui.screen_text());
    }
    for (faults, is_long) in [(9, true), (1, false)] {
        let mut ui = TestUi::new();
        ui.report_scene_errors(
            (0..faults).map(|i| diagnostic(Severity::Error, &format!("wrong number {i}"))).collect(),
        );
        assert!(ui.screen_text().contains("esc close"), "{}", ui.screen_text());
        assert_eq!(ui.screen_text().contains("j k scroll"), is_long, "{}", ui.screen_text());
    }
}

#[test]
fn no_partial_words_remain_next_to_the_help() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    ui.press_character('?');
    let text = ui.screen_text();
    let beside = |line: &str| line.split(['╭', '╰']).next().is_some_and(|left| left.trim().is_empty());
    let edges: Vec<&str> = text.lines().filter(|line| line.contains(['╭', '╰'])).collect();
    assert!(edges.len() == 2 && edges.into_iter().all(beside), "{text}");
}

#[test]
fn help_shows_how_to_close_it() {
    let mut ui = TestUi::from_state(state(40, 12));
    ui.press_character('?');
    assert!(ui.screen_text().contains("esc close"), "{}", ui.screen_text());
}

#[test]
fn digits_select_views() {
    for (columns, rows) in [(80, 24), (120, 40), (120, 24), (40, 12), (30, 8)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        ui.press_character('5');
        assert_eq!(ui.state.request.view_mode(), ViewMode::Beauty, "digits should only work in the list");
        ui.press_character('v');
        let text = ui.screen_text();
        assert!(
            text.contains("▸2 normal") && text.contains("1 beauty") && text.contains("3 depth"),
            "{text}"
        );
        let effects = ui.press_character('3');
        let wanted = sent_render_request(&effects).expect("a request").overrides.view;
        assert_eq!(wanted, Some(ViewMode::Depth));
        assert!(ui.screen_text().contains("▸3 depth"), "{}", ui.screen_text());
        // Each digit always selects the same view.
        for _ in 0..7 {
            ui.press_character('v');
        }
        assert!(ui.screen_text().contains("▸  emission"), "{}", ui.screen_text());
        ui.press_character('9');
        assert_eq!(ui.state.request.view_mode(), ViewMode::Specular);
        ui.press_key(ESCAPE);
        assert!(!ui.screen_text().contains("▸"));
        ui.press_character('1');
        assert_eq!(ui.state.request.view_mode(), ViewMode::Specular, "digits should only work in the list");
    }
}

#[test]
fn keys_navigate_the_open_view_list() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60), (30, 8)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        ui.press_character('v');
        let down = KeyPress::special(KeyCode::Down);
        for (number, view) in ViewMode::ALL.iter().enumerate().skip(2) {
            let effects = ui.press_key(if number % 2 == 0 { down } else { KeyPress::plain('j') });
            let overrides = sent_render_request(&effects).expect("a request").overrides.clone();
            assert_eq!((overrides.view, overrides.camera.has_changes()), (Some(*view), false));
            let text = ui.screen_text();
            let is_marked = |line: &str| line.contains('▸') && line.contains(view.name());
            assert!(text.lines().any(is_marked), "{} at {columns}×{rows}:\n{text}", view.name());
        }
        assert!(ui.press_character('j').is_empty(), "at the end");
        assert_eq!(
            sent_render_request(&ui.press_character('k')).and_then(|it| it.overrides.view),
            Some(ViewMode::Samples)
        );
        for key in [KeyCode::Left, KeyCode::Right, KeyCode::Up] {
            ui.press_key(KeyPress::special(key));
            assert!(!ui.state.request.toggles.camera.has_changes(), "{key:?} should only affect the list");
        }
        ui.press_key(KeyPress::special(KeyCode::Enter));
        assert!(!ui.screen_text().contains('▸'), "{}", ui.screen_text());
        ui.press_character('j');
        assert!(
            ui.state.request.toggles.camera.has_changes(),
            "the list is closed, so the camera should move"
        );
    }
}

#[test]
fn views_are_found_by_name() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character('v');
    assert!(ui.press_character('/').is_empty());
    ui.press_character('d');
    assert_eq!(ui.state.request.view_mode(), ViewMode::Depth, "expected the first match");
    ui.press_character('i');
    assert_eq!(ui.state.request.view_mode(), ViewMode::Diffuse);
    assert!(ui.screen_text().contains("/ di"), "{}", ui.screen_text());
    ui.press_key(KeyPress::special(KeyCode::Backspace));
    assert_eq!(ui.state.request.view_mode(), ViewMode::Depth);
    for letter in "qqq".chars() {
        assert!(ui.press_character(letter).is_empty(), "q should not quit while searching");
    }
    assert_eq!(ui.state.request.view_mode(), ViewMode::Depth, "no match");
    ui.press_key(KeyPress::special(KeyCode::Enter));
    assert!(ui.state.overlays.views.is_none());
    assert_eq!(ui.state.request.view_mode(), ViewMode::Depth);
}

#[test]
fn no_partial_lines_remain_below_the_view_list() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    let settings = Box::new(EffectiveSettingsSummary { width: 480, height: 480, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings { generation: 1, settings, own: scene_settings() });
    ui.press_character('v');
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let panel = crate::view::layout::Layout::for_state(&ui.state).panel;
    assert!(panel.height > VIEWS, "{panel:?}");
    let screen = ui.draw_screen();
    for row in panel.y + VIEWS..panel.bottom() {
        let line: String = (panel.x..panel.right()).map(|column| screen[(column, row)].symbol()).collect();
        assert_eq!(line.trim(), "", "row {row}");
    }
}

#[test]
fn view_list_closes_automatically() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character('v');
    ui.finish_render(RED);
    let wake = ui.state.next_tick().expect("a wakeup to close the list");
    assert!(wake > ui.now);
    ui.advance_clock(3000);
    ui.press_character('v');
    ui.advance_clock(3000);
    assert!(ui.screen_text().contains("▸3 depth"), "each key press should keep it open");
    ui.advance_clock(2000);
    assert!(ui.state.dirty && !ui.screen_text().contains("▸"));
    ui.finish_render(RED);
    assert_eq!(ui.state.next_tick(), None);
}

#[test]
fn view_list_marks_hidden_views() {
    for (columns, rows, is_cut) in [(40, 10, true), (30, 8, true), (40, 16, false)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        ui.press_character('v');
        let text = ui.screen_text();
        assert!(text.contains('▾') == is_cut && !text.contains('▴'), "{columns}×{rows}\n{text}");
        assert!(text.contains("1-9 choose"), "{columns}×{rows}\n{text}");
        assert!(!text.contains("(preview"), "{columns}×{rows}\n{text}");
        // The marker scrolls with the view.
        for _ in 0..ViewMode::ALL.len() {
            ui.press_character('j');
        }
        let text = ui.screen_text();
        assert!(text.contains('▴') == is_cut && !text.contains('▾'), "{columns}×{rows}\n{text}");
        ui.press_key(ESCAPE);
        assert!(ui.screen_text().contains("(preview only)"), "{columns}×{rows}\n{}", ui.screen_text());
    }
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character('v');
    let text = ui.screen_text();
    assert!(!text.contains(['▴', '▾']) && text.contains(&messages::view_mode_chosen("normal")), "{text}");
}

#[test]
fn only_ten_positions_of_an_error_are_shown() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.report_scene_errors((1..=20).map(|line| at(Severity::Error, "unknown `wal`", line)).collect());
    let text = ui.screen_text();
    let words = ": 2:1, 3:1, 4:1, 5:1, 6:1, 7:1, 8:1, 9:1, 10:1 and 10 more";
    assert!(text.split_whitespace().collect::<Vec<_>>().join(" ").contains(words), "{text}");
}

fn at(severity: Severity, message: &str, line: usize) -> Diagnostic {
    let source: std::sync::Arc<str> = std::sync::Arc::from("first = 1\n".repeat(20));
    let place = SourceSpan { source, span: line * 10 - 10..line * 10 - 5, label: String::new() };
    Diagnostic { place: Some(place), help: None, ..diagnostic(severity, message) }
}

#[test]
fn errors_come_first_and_duplicates_are_merged() {
    let mut ui = TestUi::from_state(state(120, 40));
    let material = |line| at(Severity::Error, "unknown `wal`", line);
    ui.report_scene_errors(vec![
        at(Severity::Warning, "texture `b` is not used", 1),
        material(12),
        material(5),
        at(Severity::Error, "unknown key `radios`", 3),
        material(17),
    ]);
    let text = ui.screen_text();
    assert!(text.contains("4 errors"), "{text}");
    assert_eq!(text.matches("unknown `wal`").count(), 1, "{text}");
    assert!(text.contains("cornell.toml:5:1") && text.contains(": 12:1, 17:1"), "{text}");
    let place = |words: &str| text.find(words).unwrap_or_else(|| panic!("{words} not found in\n{text}"));
    assert!(place("radios") < place("wal`") && place("wal`") < place("not used"), "{text}");
}

#[test]
fn diagnostics_are_next_to_the_image_if_possible() {
    for (columns, rows, width, is_beside) in
        [(160, 40, 640, true), (80, 60, 640, true), (80, 24, 480, true), (80, 24, 640, false)]
    {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        let settings = Box::new(EffectiveSettingsSummary { width, height: 480, ..effective_settings() });
        ui.worker_event(protocol::Event::Settings { generation: 1, settings, own: scene_settings() });
        let before = cells_of(&mut ui, RED);
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "misspelled")]);
        assert!(ui.screen_text().contains("error: misspelled"), "{}", ui.screen_text());
        let after = cells_of(&mut ui, RED);
        assert_eq!(
            after == before,
            is_beside,
            "{after} of {before} at {columns}×{rows}\n{}",
            ui.screen_text()
        );
    }
}

#[test]
fn closed_diagnostics_stay_closed_until_new_ones() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let fault = || vec![diagnostic(Severity::Error, "misspelled")];
    ui.report_scene_errors(fault());
    ui.press_key(ESCAPE);
    ui.press_character('v');
    ui.report_scene_errors(fault());
    assert!(!ui.state.overlays.diagnostics.open, "{}", ui.screen_text());
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "another one")]);
    assert!(ui.state.overlays.diagnostics.open, "new errors should open the pane");
}

#[test]
fn camera_steps_wait_while_the_scene_is_broken() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "misspelled")]);
    let first = ui.press_character('h');
    assert!(sent_render_request(&first).is_some());
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "misspelled")]);
    assert!(
        sent_render_request(&ui.press_character('h')).is_none(),
        "the step should wait for the first step's preview"
    );
    let generation = ui.state.request.generation;
    let picture = uniform_picture(50, 38, RED);
    let effects = ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    assert!(sent_render_request(&effects).is_some(), "the preview should trigger the waiting step");
}

#[test]
fn number_of_displayed_errors_is_limited() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.report_scene_errors(
        (0..2000).map(|i| diagnostic(Severity::Error, &format!("wrong number {i}"))).collect(),
    );
    for _ in 0..100 {
        ui.press_key(KeyPress::special(KeyCode::PageDown));
    }
    assert!(ui.screen_text().contains("… 1900 more"), "{}", ui.screen_text());
}

#[test]
fn diagnostics_scroll_with_every_key() {
    let mut ui = TestUi::new();
    ui.report_scene_errors(
        (0..9).map(|i| diagnostic(Severity::Error, &format!("wrong number {i}"))).collect(),
    );
    let top = ui.screen_text();
    ui.press_character('j');
    assert_ne!(ui.screen_text(), top);
    ui.press_character('k');
    assert_eq!(ui.screen_text(), top);
    for (forth, back) in [(KeyCode::Down, KeyCode::Up), (KeyCode::PageDown, KeyCode::PageUp)] {
        ui.press_key(KeyPress::special(forth));
        assert_ne!(ui.screen_text(), top, "{forth:?}");
        ui.press_key(KeyPress::special(back));
        assert_eq!(ui.screen_text(), top, "{back:?}");
    }
    ui.press_key(ESCAPE);
    assert!(!ui.screen_text().contains("wrong number"));
    ui.draw_screen();
    ui.press_key(ESCAPE);
    assert!(!ui.state.dirty, "nothing was open, so nothing should be redrawn");
}

#[test]
fn long_failure_is_wrapped_between_words() {
    let mut ui = TestUi::from_state(state(40, 12));
    let failure =
        Failure::Work("cannot write /a/rather/long/name/of/a/folder/image.png: no such folder".to_owned());
    ui.worker_event(protocol::Event::Failed { generation: 1, failure });
    assert!(ui.screen_text().contains("such folder"), "{}", ui.screen_text());
}

#[test]
fn resize_keeps_overlays_open() {
    let mut ui = TestUi::new();
    ui.press_character('?');
    for (columns, rows) in [(30, 8), (200, 60), (10, 2), (1, 1), (80, 24)] {
        ui.handle_event(Event::Resize(window(columns, rows)));
        for _ in 0..5 {
            ui.press_character('j');
        }
        ui.draw_screen();
    }
    assert!(ui.screen_text().contains(" keys "), "{}", ui.screen_text());
}
