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

fn last_line(desk: &mut Desk) -> String {
    desk.text().lines().last().unwrap_or_default().to_owned()
}

#[test]
fn a_click_is_answered_while_warnings_are_open() {
    let mut desk = Desk::with(state(140, 40));
    desk.finish(RED);
    desk.worker(done(1, vec![diagnostic(Severity::Warning, "a warning")], false));
    desk.press('e');
    let picked = Picked { pixel: [3, 4], thing: None, color: None };
    desk.worker(protocol::Event::Picked { generation: 1, picked: Box::new(picked) });
    assert!(desk.text().contains("nothing at pixel 3, 4"), "{}", desk.text());
}

#[test]
fn one_key_takes_back_all_that_keys_have_changed_and_says_so_once() {
    let mut desk = Desk::with(state(200, 40));
    desk.finish(RED);
    desk.state.request.toggles.camera.focus = Some(2.0);
    desk.press(']');
    desk.finish(BLUE);
    desk.key(KeyPress::special(KeyCode::Esc));
    assert!(last_line(&mut desk).contains("0 reset focus, exposure (+0.25)"), "{}", desk.text());
    desk.press('l');
    desk.finish(RED);
    desk.key(KeyPress::special(KeyCode::Esc));
    let keys = last_line(&mut desk);
    assert!(keys.contains("0 reset camera, exposure (+0.25)") && !keys.contains("focus"), "{keys}");
    desk.press('[');
    assert!(desk.text().contains("exposure 0 "), "{}", desk.text());
}

#[test]
fn a_view_of_photons_without_photons_says_how_to_get_them() {
    let mut desk = Desk::new();
    desk.finish(RED);
    for key in ['v', '/'].into_iter().chain("photons".chars()) {
        desk.press(key);
    }
    assert!(desk.text().contains("p turns them on"), "{}", desk.text());
}

#[test]
fn without_a_preview_no_key_of_the_picture_is_offered() {
    let kind = |kind| Desk::with(state_with(200, 24, kind, ColorDepth::TrueColor, Overrides::default()));
    for (mut desk, is_offered) in [(kind(PreviewKind::None), false), (kind(PreviewKind::HalfBlock), true)] {
        desk.finish(RED);
        assert_eq!(last_line(&mut desk).contains("tab picture"), is_offered, "{}", desk.text());
    }
}

#[test]
fn what_a_render_goes_on_from_is_no_news_once_it_is_done() {
    let mut desk = Desk::new();
    let news = CheckpointNews::Resumed { path: "cornell.png.checkpoint".into(), samples: 16 };
    desk.worker(protocol::Event::Checkpoint { generation: 1, news });
    assert!(desk.text().contains("resuming from cornell.png.checkpoint"), "{}", desk.text());
    desk.finish(RED);
    assert!(!desk.text().contains("resuming from"), "{}", desk.text());
}

#[test]
fn what_was_never_rendered_is_not_rendered_again() {
    let mut desk = Desk::with(state(120, 40));
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    assert!(!desk.text().contains("render again"), "{}", desk.text());
    assert_eq!(exit_summary::words(&desk.state), "no image written; cornell.toml has errors");
    desk.finish(RED);
    assert!(desk.text().contains("render again"), "{}", desk.text());
}

#[test]
fn the_name_has_room_in_every_small_window() {
    for columns in 26..60 {
        let mut desk = Desk::with(state(columns, 8));
        desk.finish(RED);
        assert!(desk.text().contains("corn"), "{columns}: {}", desk.text());
    }
}

#[test]
fn a_reason_that_has_room_beside_its_stage_is_not_broken() {
    let mut desk = Desk::with(state(200, 60));
    desk.finish(RED);
    desk.press('r');
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::Started { generation });
    let stage = stage(Stage::Meshes, Status::Skipped, 0.0, "the scene has no mesh");
    desk.worker(protocol::Event::Stage { generation, stage });
    desk.event(Event::Tick);
    assert!(desk.text().contains("skipped  the scene has no mesh"), "{}", desk.text());
}

/// It would float at the right of an empty screen.
#[test]
fn the_hint_about_a_broken_scene_is_whole_and_in_its_line() {
    for (columns, rows) in [(80, 24), (100, 30), (120, 40), (200, 60)] {
        let mut desk = Desk::with(state(columns, rows));
        desk.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
        desk.event(Event::Settled);
        let text = desk.text();
        let lines: Vec<&str> = text.lines().filter(|line| line.contains("save cornell.toml")).collect();
        assert_eq!(lines.len(), 1, "{text}");
        assert_eq!(lines[0].trim_end(), "save cornell.toml to render", "{text}");
    }
}

#[test]
fn nobody_is_asked_to_save_a_model() {
    let mut state = state(120, 40);
    state.request.scene = "toy.glb".into();
    let mut desk = Desk::with(state);
    desk.finish(RED);
    let text = desk.text();
    assert!(text.contains("toy.glb") && !text.contains("save "), "{text}");
    let words: Vec<&str> = text.split_whitespace().filter(|word| !word.contains('▀')).collect();
    assert!(words.join(" ").contains("rendered again when toy.glb changes"), "{text}");
}
