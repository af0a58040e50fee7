//! Tests of words that a newcomer stumbled over.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::color::ColorDepth;
use crate::event::{Event, KeyPress};
use crate::exit_summary;
use crate::fixtures::*;
use crate::pipeline::protocol::{self, CheckpointNews, Picked, Stage, Status};
use crate::pipeline::settings::Overrides;
use crate::preview_kind::PreviewKind;
use crate::scene::diagnostic::Severity;

fn last_line(ui: &mut TestUi) -> String {
    ui.text().lines().last().unwrap_or_default().to_owned()
}

#[test]
fn a_click_is_answered_while_warnings_are_open() {
    let mut ui = TestUi::with(state(140, 40));
    ui.finish(RED);
    ui.worker(done(1, vec![diagnostic(Severity::Warning, "a warning")], false));
    ui.press('e');
    let picked = Picked { pixel: [3, 4], thing: None, color: None };
    ui.worker(protocol::Event::Picked { generation: 1, picked: Box::new(picked) });
    assert!(ui.text().contains("nothing at pixel 3, 4"), "{}", ui.text());
}

#[test]
fn one_key_takes_back_all_that_keys_have_changed_and_says_so_once() {
    let mut ui = TestUi::with(state(200, 40));
    ui.finish(RED);
    ui.state.request.toggles.camera.focus = Some(2.0);
    ui.press(']');
    ui.finish(BLUE);
    ui.key(KeyPress::special(KeyCode::Esc));
    assert!(last_line(&mut ui).contains("0 reset focus, exposure (+0.25)"), "{}", ui.text());
    ui.press('l');
    ui.finish(RED);
    ui.key(KeyPress::special(KeyCode::Esc));
    let keys = last_line(&mut ui);
    assert!(keys.contains("0 reset camera, exposure (+0.25)") && !keys.contains("focus"), "{keys}");
    ui.press('[');
    assert!(ui.text().contains("exposure 0 "), "{}", ui.text());
}

#[test]
fn a_view_of_photons_without_photons_says_how_to_get_them() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    for key in ['v', '/'].into_iter().chain("photons".chars()) {
        ui.press(key);
    }
    assert!(ui.text().contains("p turns them on"), "{}", ui.text());
}

#[test]
fn without_a_preview_no_key_of_the_picture_is_offered() {
    let kind = |kind| TestUi::with(state_with(200, 24, kind, ColorDepth::TrueColor, Overrides::default()));
    for (mut ui, is_offered) in [(kind(PreviewKind::None), false), (kind(PreviewKind::HalfBlock), true)] {
        ui.finish(RED);
        assert_eq!(last_line(&mut ui).contains("tab picture"), is_offered, "{}", ui.text());
    }
}

#[test]
fn what_a_render_goes_on_from_is_no_news_once_it_is_done() {
    let mut ui = TestUi::new();
    let news = CheckpointNews::Resumed { path: "cornell.png.checkpoint".into(), samples: 16 };
    ui.worker(protocol::Event::Checkpoint { generation: 1, news });
    assert!(ui.text().contains("resuming from cornell.png.checkpoint"), "{}", ui.text());
    ui.finish(RED);
    assert!(!ui.text().contains("resuming from"), "{}", ui.text());
}

#[test]
fn what_was_never_rendered_is_not_rendered_again() {
    let mut ui = TestUi::with(state(120, 40));
    ui.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    assert!(!ui.text().contains("render again"), "{}", ui.text());
    assert_eq!(exit_summary::words(&ui.state), "no image written; cornell.toml has errors");
    ui.finish(RED);
    assert!(ui.text().contains("render again"), "{}", ui.text());
}

#[test]
fn the_name_has_room_in_every_small_window() {
    for columns in 26..60 {
        let mut ui = TestUi::with(state(columns, 8));
        ui.finish(RED);
        assert!(ui.text().contains("corn"), "{columns}: {}", ui.text());
    }
}

#[test]
fn a_reason_that_has_room_beside_its_stage_is_not_broken() {
    let mut ui = TestUi::with(state(200, 60));
    ui.finish(RED);
    ui.press('r');
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    let stage = stage(Stage::Meshes, Status::Skipped, 0.0, "the scene has no mesh");
    ui.worker(protocol::Event::Stage { generation, stage });
    ui.event(Event::Tick);
    assert!(ui.text().contains("skipped  the scene has no mesh"), "{}", ui.text());
}

/// It would float at the right of an empty screen.
#[test]
fn the_hint_about_a_broken_scene_is_whole_and_in_its_line() {
    for (columns, rows) in [(80, 24), (100, 30), (120, 40), (200, 60)] {
        let mut ui = TestUi::with(state(columns, rows));
        ui.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
        ui.event(Event::Settled);
        let text = ui.text();
        let lines: Vec<&str> = text.lines().filter(|line| line.contains("save cornell.toml")).collect();
        assert_eq!(lines.len(), 1, "{text}");
        assert_eq!(lines[0].trim_end(), "save cornell.toml to render", "{text}");
    }
}

#[test]
fn nobody_is_asked_to_save_a_model() {
    let mut state = state(120, 40);
    state.request.scene = "toy.glb".into();
    let mut ui = TestUi::with(state);
    ui.finish(RED);
    let text = ui.text();
    assert!(text.contains("toy.glb") && !text.contains("save "), "{text}");
    let words: Vec<&str> = text.split_whitespace().filter(|word| !word.contains('▀')).collect();
    assert!(words.join(" ").contains("rendered again when toy.glb changes"), "{text}");
}
