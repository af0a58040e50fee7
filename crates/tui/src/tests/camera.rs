//! Tests for requests and messages triggered by camera keys.

use super::{BLUE, RED};
use crate::event::{Effect, Event, KeyPress};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{self, Command, PreviewUpdate, ResolvedCamera, WriteRequirement};
use crate::pipeline::settings::{AdjustableSceneSettings, Overrides};
use crate::preview_style::PreviewStyle;
use crate::scene::description::{Pose, Projection};
use crate::scene::diagnostic::Severity;
use crate::{ColorDepth, ContentChangeTime};
use crossterm::event::KeyCode;

fn show(ui: &mut TestUi) -> Vec<crate::event::Effect> {
    let generation = ui.state.request.generation;
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture: uniform_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }))
}

#[test]
fn moved_camera_is_shown_but_not_written() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let effects = ui.press_character('l');
    let moved = sent_render_request(&effects).expect("a request");
    assert_eq!((moved.write, moved.force), (WriteRequirement::No, false));
    let text = ui.screen_text();
    assert!(text.contains(messages::CAMERA_MOVED), "{text}");
    assert!(text.lines().last().is_some_and(|line| line.contains("reset camera")), "{text}");
    show(&mut ui);
    let effects = ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    let edited = sent_render_request(&effects).expect("a request");
    assert_eq!(edited.overrides.camera, moved.overrides.camera, "saving should not reset the camera");
    assert_eq!(edited.write, WriteRequirement::No);
    let effects = ui.press_character('0');
    let own = sent_render_request(&effects).expect("a request");
    assert_eq!((own.write, own.overrides.camera.has_changes()), (WriteRequirement::Try, false));
    assert!(!ui.screen_text().contains(messages::CAMERA_MOVED));
}

#[test]
fn newest_camera_step_waits_for_a_preview() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let effects = ui.press_character('l');
    let first =
        sent_render_request(&effects).expect("an immediate request").overrides.camera.pose.expect("a pose");
    for key in ['l', 'l', 'k', '<'] {
        assert!(ui.press_character(key).is_empty(), "steps should wait for the first step's preview");
    }
    let effects = show(&mut ui);
    let newest = sent_render_request(&effects).expect("the newest step should be requested").overrides.camera;
    let pose = newest.pose.expect("a pose");
    assert!(pose.position.x > 2.9 * first.position.x && pose.position.y > 1.1, "{pose:?}");
    assert!(newest.fov.is_some_and(|fov| fov < 40.0));
    assert!(show(&mut ui).is_empty(), "no step should be waiting");
    assert!(
        sent_render_request(&ui.press_character('l')).is_some(),
        "the next step should be requested immediately"
    );
    // Other keys take effect immediately. Their request has the camera after all previous steps.
    ui.press_character('l');
    let effects = ui.press_character('s');
    assert!(sent_render_request(&effects).expect("a request").overrides.camera != newest);
    assert!(show(&mut ui).is_empty());
}

/// A user interface whose scene has this projection.
fn with_projection(projection: Projection, mirror: bool) -> TestUi {
    let mut ui = TestUi::from_state(state(160, 40));
    ui.finish_render(RED);
    let camera = &mut ui.state.request.own.as_mut().expect("a scene").camera;
    (camera.projection, camera.window.mirror) = (projection, mirror);
    ui
}

#[test]
fn zoom_and_dolly_follow_the_projection() {
    let own = Projection::Orthographic { view_height: 3.0 };
    for (key, factor) in [('>', 1.05), ('<', 1.0 / 1.05), ('+', 0.95), ('-', 1.0 / 0.95)] {
        let mut ui = with_projection(own, false);
        let moved = sent_render_request(&ui.press_character(key)).expect("a request").overrides.camera;
        let height = moved.view_height.expect("a height");
        assert!((height / 3.0 - factor).abs() < 1e-3, "{key}: {height}");
        assert_eq!(moved.fov, None);
        assert_eq!(moved.pose.is_some(), "+-".contains(key), "{key}");
        assert_eq!(kept(&mut ui).map(|camera| camera.projection.view_height()), Some(Some(height)));
        let text = ui.state.request.toggles.as_command_line_options(None).join(" ");
        assert!(text.contains(&format!("--set camera.view_height={height}")), "{text}");
    }
    let mut ui = with_projection(Projection::Fisheye { fov: 359.0 }, false);
    let wide = sent_render_request(&ui.press_character('>')).expect("a request").overrides.camera;
    assert_eq!((wide.fov, wide.view_height), (Some(360.0), None));
    let mut ui = with_projection(Projection::Spherical, false);
    assert!(sent_render_request(&ui.press_character('>')).is_none());
    assert!(ui.screen_text().contains(messages::NO_FIELD_OF_VIEW));
}

#[test]
fn orbiting_follows_the_mirrored_image() {
    let x = |mirror| {
        let mut ui = with_projection(Projection::Perspective { fov: 40.0 }, mirror);
        let moved = sent_render_request(&ui.press_character('l')).expect("a request").overrides.camera;
        moved.pose.expect("a pose").position.x
    };
    assert!(x(false) > 0.1);
    assert_eq!(x(true), -x(false));
}

#[test]
fn missing_previews_do_not_block_steps() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character('l');
    ui.press_character('l');
    let generation = ui.state.request.generation;
    let diagnostics = vec![diagnostic(Severity::Error, "wrong")];
    let failure = protocol::Failure::Scene(diagnostics);
    let effects = ui.worker_event(protocol::Event::Failed { generation, failure });
    assert!(sent_render_request(&effects).is_none(), "the last valid scene should still be rendering");
    assert!(sent_render_request(&show(&mut ui)).is_some(), "the preview should trigger the waiting step");
    ui.press_character('l');
    let generation = ui.state.request.generation;
    let failure = protocol::Failure::Work("no memory".to_owned());
    let effects = ui.worker_event(protocol::Event::Failed { generation, failure });
    assert!(sent_render_request(&effects).is_some(), "a failure should trigger the waiting step");
    let mut ui = TestUi::from_state(state(80, 1));
    ui.finish_render(RED);
    for _ in 0..3 {
        assert!(
            sent_render_request(&ui.press_character('l')).is_some(),
            "without space for a preview, steps should not wait"
        );
    }
}

#[test]
fn arrows_scroll_open_diagnostics() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.report_scene_errors((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    let down = KeyPress::special(KeyCode::Down);
    assert!(ui.press_key(down).is_empty());
    assert!(ui.state.overlays.diagnostics.scroll > 0);
    ui.press_key(KeyPress::special(KeyCode::Esc));
    assert!(
        sent_render_request(&ui.press_key(down)).is_some(),
        "arrow keys should move the camera after the pane is closed"
    );
}

#[test]
fn camera_keys_need_a_scene() {
    let mut ui = TestUi::new();
    assert!(
        ui.press_character('l').is_empty()
            && ui.press_character('>').is_empty()
            && ui.press_character(']').is_empty()
    );
    assert!(ui.screen_text().contains(messages::NO_SCENE));
}

#[test]
fn exposure_changes_start_from_scene_value() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.state.request.own.as_mut().expect("a scene").exposure = 1.0;
    ui.press_character(']');
    show(&mut ui);
    let effects = ui.press_character(']');
    assert_eq!(sent_render_request(&effects).and_then(|it| it.overrides.exposure), Some(1.5));
    assert!(ui.screen_text().contains("0 reset exposure (+1.5)"), "{}", ui.screen_text());
}

#[test]
fn held_keys_stop_at_their_limits() {
    for (key, words) in [
        ('+', messages::CLOSEST.to_owned()),
        ('-', messages::FARTHEST.to_owned()),
        ('<', messages::fov_limit(1.0)),
        ('>', messages::fov_limit(160.0)),
        ('[', messages::exposure_limit("−20")),
        (']', messages::exposure_limit("+20")),
    ] {
        let mut ui = TestUi::new();
        ui.finish_render(RED);
        for _ in 0..400 {
            ui.press_character(key);
            show(&mut ui);
        }
        assert!(ui.screen_text().contains(&words), "{key}: {}", ui.screen_text());
        let generation = ui.state.request.generation;
        assert!(
            ui.press_character(key).is_empty() && ui.state.request.generation == generation,
            "{key}: a request"
        );
        let view = ui.state.request.current_camera().expect("a camera");
        assert!((0.0039..4001.0).contains(&view.pose.distance()), "{key}: {view:?}");
    }
}

#[test]
fn reverted_changes_are_not_sent() {
    for keys in ["[]", "][", "<>", "><", "+-", "-+", "lh", "]]]]["] {
        let mut ui = TestUi::new();
        ui.finish_render(RED);
        let mut last = None;
        for key in keys.chars() {
            let effects = ui.press_character(key);
            last = sent_render_request(&effects).cloned();
            show(&mut ui);
        }
        let last = last.expect("a request");
        let is_back = keys != "]]]][";
        assert_eq!(last.overrides == Overrides::default(), is_back, "{keys}: {:?}", last.overrides);
        assert_eq!(
            (last.write, last.own.is_none()),
            if is_back { (WriteRequirement::Try, true) } else { (WriteRequirement::No, false) }
        );
        let line = ui.screen_text().lines().last().map(str::to_owned).unwrap_or_default();
        assert_eq!(!line.contains("0 "), is_back, "{keys}: {line}");
        assert!(!ui.screen_text().contains(messages::CAMERA_MOVED), "{keys}: {}", ui.screen_text());
    }
}

#[test]
fn command_line_exposure_is_not_a_change() {
    let base = Overrides { exposure: Some(1.0), ..Overrides::default() };
    let mut ui = TestUi::from_state(state_with(80, 24, PreviewStyle::HalfBlock, ColorDepth::TrueColor, base));
    ui.finish_render(RED);
    ui.press_character('[');
    show(&mut ui);
    ui.press_character(']');
    assert_eq!(
        (ui.state.request.toggles.exposure, ui.state.request.combined_overrides().exposure),
        (None, Some(1.0))
    );
}

#[test]
fn model_scene_is_written_once() {
    use crate::pipeline::protocol::{CameraSaveResult, Event as WorkerEvent};
    let mut ui = TestUi::new();
    ui.state.request.scene = "assets/vase.obj".into();
    ui.finish_render([200, 30, 30]);
    ui.press_character('l');
    ui.finish_render([30, 30, 200]);
    ui.press_key(KeyPress::special(KeyCode::Esc));
    assert!(
        ui.screen_text().contains("c keep") && !ui.screen_text().contains("o edit"),
        "{}",
        ui.screen_text()
    );
    let kept = CameraSaveResult {
        path: "assets/vase.toml".into(),
        is_new: true,
        is_own: false,
        of_model: true,
        edit: None,
    };
    let generation = ui.state.request.generation;
    ui.worker_event(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
    ui.press_key(KeyPress::special(KeyCode::Esc));
    assert!(!ui.screen_text().contains("c keep"), "c should not be offered again: {}", ui.screen_text());
    assert_eq!(crate::exit_summary::unsaved_changes_as_options(&ui.state), None);
    ui.press_character('l');
    ui.finish_render([200, 30, 30]);
    assert!(
        crate::exit_summary::unsaved_changes_as_options(&ui.state).is_some(),
        "the camera has moved since it was saved"
    );
}

/// Simulates saving a scene with this camera.
fn save(ui: &mut TestUi, camera: ResolvedCamera) {
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    ui.worker_event(protocol::Event::Settings {
        generation,
        settings: effective_settings().into(),
        own: AdjustableSceneSettings { camera, ..scene_settings() },
    });
    show(ui);
}

/// Presses `c` and returns the camera that the worker is asked to write. `None` if nothing is written.
fn kept(ui: &mut TestUi) -> Option<ResolvedCamera> {
    let is_order = |effect: Effect| match effect {
        Effect::Send(Command::KeepCamera(moved)) => Some(moved.camera),
        _ => None,
    };
    ui.press_character('c').into_iter().find_map(is_order)
}

fn viewpoint_at(position: [f64; 3]) -> ResolvedCamera {
    let camera = camera();
    ResolvedCamera { pose: Pose { position: position.into(), ..camera.pose }, ..camera }
}

#[test]
fn first_c_lists_conflicting_saves() {
    let wide = |fov| ResolvedCamera { projection: Projection::Perspective { fov }, ..camera() };
    let look_at =
        ResolvedCamera { pose: Pose { look_at: [0.0, 0.5, 0.0].into(), ..camera().pose }, ..camera() };
    let both = ResolvedCamera { projection: wide(25.0).projection, ..viewpoint_at([0.0, 2.0, 4.0]) };
    for (keys, saved, words) in [
        ("h", viewpoint_at([0.0, 2.0, 4.0]), "camera.position = [0, 2, 4]"),
        ("h", look_at, "camera.look_at = [0, 0.5, 0]"),
        ("<", wide(25.0), "camera.fov = 25"),
        ("h<", both, "camera.position = [0, 2, 4], camera.fov = 25"),
        ("h<", wide(25.0), "camera.fov = 25"),
    ] {
        let mut ui = TestUi::from_state(state(160, 40));
        ui.finish_render(RED);
        for key in keys.chars() {
            ui.press_character(key);
            show(&mut ui);
        }
        let moved = ui.state.request.toggles.camera;
        save(&mut ui, saved);
        assert_eq!(kept(&mut ui), None, "{keys}");
        let said = format!("error: {words} {}", messages::CAMERA_CONFLICT);
        assert!(ui.screen_text().contains(&said), "{keys}: {}", ui.screen_text());
        assert_eq!(kept(&mut ui), Some(saved.with_change(&moved)), "{keys}: pressing c again should confirm");
    }
}

#[test]
fn later_conflicting_saves_are_also_listed() {
    let mut ui = TestUi::from_state(state(160, 40));
    ui.finish_render(RED);
    ui.press_character('h');
    show(&mut ui);
    for height in [2.0, 3.0] {
        save(&mut ui, viewpoint_at([0.0, height, 4.0]));
        assert_eq!(kept(&mut ui), None);
        assert!(
            ui.screen_text().contains(&format!("camera.position = [0, {height}, 4]")),
            "{}",
            ui.screen_text()
        );
    }
    // Moving the camera again requires no confirmation.
    ui.press_character('h');
    show(&mut ui);
    assert!(kept(&mut ui).is_some());
}

#[test]
fn saving_keeps_camera_settings_that_did_not_move() {
    let saved = ResolvedCamera { projection: Projection::Perspective { fov: 25.0 }, ..camera() };
    let mut ui = TestUi::from_state(state(160, 40));
    ui.finish_render(RED);
    ui.press_character('h');
    show(&mut ui);
    save(&mut ui, saved);
    let moved = ui.state.request.toggles.camera;
    assert_eq!(kept(&mut ui), Some(saved.with_change(&moved)));
    // The focus follows `look_at`, so saving did not change it.
    let mut ui = TestUi::from_state(state(160, 40));
    ui.finish_render(RED);
    ui.state.request.toggles.camera.focus = Some(2.5);
    ui.press_character('r');
    save(&mut ui, viewpoint_at([0.0, 1.0, 6.0]));
    assert_eq!(kept(&mut ui).map(|camera| (camera.focus, camera.pose.position.z)), Some((2.5, 6.0)));
}

#[test]
fn reset_camera_can_be_moved_without_conflict() {
    let mut ui = TestUi::from_state(state(160, 40));
    ui.finish_render(RED);
    ui.press_character('h');
    show(&mut ui);
    save(&mut ui, viewpoint_at([0.0, 2.0, 4.0]));
    ui.press_character('0');
    ui.press_character('h');
    assert!(kept(&mut ui).is_some());
}

#[test]
fn model_cameras_have_no_conflicts() {
    let mut ui = TestUi::from_state(state(160, 40));
    ui.state.request.scene = "assets/vase.obj".into();
    ui.finish_render(RED);
    ui.press_character('h');
    show(&mut ui);
    // The model's size has changed, so its default camera has moved.
    save(&mut ui, viewpoint_at([0.0, 2.0, 4.0]));
    assert!(kept(&mut ui).is_some());
}
