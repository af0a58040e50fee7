//! Regression tests for text that confused new users.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::color::ColorDepth;
use crate::event::{Event, KeyPress};
use crate::exit_summary;
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{self, CheckpointUpdate, PickedPixel, Stage, StageStatus};
use crate::pipeline::settings::Overrides;
use crate::preview_style::PreviewStyle;
use crate::scene::diagnostic::Severity;

fn last_line(ui: &mut TestUi) -> String {
    ui.screen_text().lines().last().unwrap_or_default().to_owned()
}

#[test]
fn click_result_is_shown_with_warnings_open() {
    let mut ui = TestUi::from_state(state(140, 40));
    ui.finish_render(RED);
    ui.worker_event(done_event(1, vec![diagnostic(Severity::Warning, "a warning")], false));
    ui.press_character('e');
    let picked = PickedPixel { pixel: [3, 4], object: None, color: None };
    ui.worker_event(protocol::Event::Picked { generation: 1, picked: Box::new(picked) });
    assert!(ui.screen_text().contains("pixel 3, 4"), "{}", ui.screen_text());
}

#[test]
fn reset_lists_all_changes_once() {
    let mut ui = TestUi::from_state(state(200, 40));
    ui.finish_render(RED);
    ui.state.request.toggles.camera.focus = Some(2.0);
    ui.press_character(']');
    ui.finish_render(BLUE);
    ui.press_key(KeyPress::special(KeyCode::Esc));
    assert_eq!(ui.state.request.describe_camera_and_exposure_changes(), ["focus", "exposure (+0.25)"]);
    assert!(last_line(&mut ui).contains("reset focus, "), "{}", ui.screen_text());
    ui.press_character('l');
    ui.finish_render(RED);
    ui.press_key(KeyPress::special(KeyCode::Esc));
    let keys = last_line(&mut ui);
    assert!(keys.contains("reset camera, ") && !keys.contains("focus"), "{keys}");
    ui.press_character('[');
    assert!(ui.screen_text().contains("exposure 0 "), "{}", ui.screen_text());
}

#[test]
fn photon_view_without_photons_shows_a_hint() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    for key in ['v', '/'].into_iter().chain("photons".chars()) {
        ui.press_character(key);
    }
    assert!(ui.screen_text().contains(messages::VIEW_WITHOUT_PHOTONS), "{}", ui.screen_text());
}

#[test]
fn image_keys_are_hidden_without_a_preview() {
    let kind =
        |kind| TestUi::from_state(state_with(200, 24, kind, ColorDepth::TrueColor, Overrides::default()));
    for (mut ui, is_offered) in [(kind(PreviewStyle::None), false), (kind(PreviewStyle::HalfBlock), true)] {
        ui.finish_render(RED);
        assert_eq!(last_line(&mut ui).contains("tab image"), is_offered, "{}", ui.screen_text());
    }
}

#[test]
fn resume_message_disappears_after_the_render() {
    let mut ui = TestUi::new();
    let news = CheckpointUpdate::Resumed { path: "cornell.png.checkpoint".into(), samples: 16 };
    ui.worker_event(protocol::Event::Checkpoint { generation: 1, news });
    assert!(ui.screen_text().contains(messages::RESUMING), "{}", ui.screen_text());
    ui.finish_render(RED);
    assert!(!ui.screen_text().contains(messages::RESUMING), "{}", ui.screen_text());
}

#[test]
fn first_render_hint_omits_the_word_again() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    assert!(!ui.screen_text().contains("render again"), "{}", ui.screen_text());
    assert_eq!(exit_summary::summary_text(&ui.state), "no image written; cornell.toml has errors");
    ui.finish_render(RED);
    assert!(ui.screen_text().contains("render again"), "{}", ui.screen_text());
}

#[test]
fn scene_name_is_visible_in_small_windows() {
    for columns in 26..60 {
        let mut ui = TestUi::from_state(state(columns, 8));
        ui.finish_render(RED);
        assert!(ui.screen_text().contains("corn"), "{columns}: {}", ui.screen_text());
    }
}

#[test]
fn stage_reason_in_a_wide_panel_is_not_wrapped() {
    let mut ui = TestUi::from_state(state(200, 60));
    ui.finish_render(RED);
    ui.press_character('r');
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let stage = stage_report(Stage::Meshes, StageStatus::Skipped, 0.0, "unneeded");
    ui.worker_event(protocol::Event::Stage { generation, stage });
    ui.handle_event(Event::Tick);
    assert!(ui.screen_text().contains("skipped  unneeded"), "{}", ui.screen_text());
}

/// The hint must not be shown at the right edge of an empty screen.
#[test]
fn save_hint_has_its_own_line() {
    for (columns, rows) in [(80, 24), (100, 30), (120, 40), (200, 60)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
        ui.handle_event(Event::Settled);
        let text = ui.screen_text();
        let hint = messages::saving_starts_render_hint("cornell.toml", false);
        let lines: Vec<&str> = text.lines().filter(|line| line.contains(&hint)).collect();
        assert_eq!(lines.len(), 1, "{text}");
        assert_eq!(lines[0].trim_end(), hint, "{text}");
    }
}

#[test]
fn models_have_no_save_hint() {
    let mut state = state(120, 40);
    state.request.scene = "toy.glb".into();
    let mut ui = TestUi::from_state(state);
    ui.finish_render(RED);
    let text = ui.screen_text();
    assert!(text.contains("toy.glb") && !text.contains("save "), "{text}");
    let words: Vec<&str> = text.split_whitespace().filter(|word| !word.contains('▀')).collect();
    assert!(words.join(" ").contains(&messages::renders_on_changes_hint("toy.glb")), "{text}");
}
