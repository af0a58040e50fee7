//! Tests for key effects and help texts.

use super::{BLUE, RED, cells_of};
use crate::action::Action;
use crate::choice::Choice;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress};
use crate::fixtures::*;
use crate::keymap::{self, KEYMAP};
use crate::math::DVec3;
use crate::messages;
use crate::pipeline::protocol::{self, Command, NormalizedPosition, SavedCameraEdit, WriteRequirement};
use crate::pipeline::settings::{AdjustableSceneSettings, EffectiveSettingsSummary, Overrides, ViewMode};
use crate::preview_style::PreviewStyle;
use crate::scene::description::{Integrator, Pose, ShadowMode};
use crate::scene::diagnostic::Severity;
use crate::{ContentChangeTime, ExitStatus};

/// Checks that each key does what its table row says. `check` covers every action.
#[test]
fn every_key_has_its_effect() {
    for binding in KEYMAP {
        for key in binding.keys {
            let mut ui = TestUi::new();
            ui.finish_render(RED);
            check(binding.action, *key, &mut ui);
        }
    }
}

/// The camera pose requested by a key.
fn requested_pose(effects: &[Effect]) -> Pose {
    sent_render_request(effects).and_then(|it| it.overrides.camera.pose).expect("a request with a camera")
}

fn check(action: Action, key: KeyPress, ui: &mut TestUi) {
    let overrides = |effects: &[Effect]| sent_render_request(effects).map(|it| it.overrides.clone());
    match action {
        Action::CycleShadows => {
            // Returning to the scene's own value clears the override.
            for (wanted, by_key) in [
                (ShadowMode::Hard, Some(ShadowMode::Hard)),
                (ShadowMode::Off, Some(ShadowMode::Off)),
                (ShadowMode::Soft, None),
            ] {
                let effects = ui.press_key(key);
                assert_eq!(overrides(&effects).expect("a request").shadows, by_key);
                assert_eq!(ui.state.request.shadow_mode(), wanted);
            }
        }
        Action::ToggleDepthOfField => {
            for by_key in [Some(false), None] {
                let effects = ui.press_key(key);
                assert_eq!(overrides(&effects).expect("a request").dof, by_key);
            }
        }
        Action::TogglePhotons => {
            for (wanted, by_key) in [(true, Some(true)), (false, None)] {
                let effects = ui.press_key(key);
                assert_eq!(overrides(&effects).expect("a request").photons, by_key);
                assert_eq!(ui.state.request.are_photons_enabled(), wanted);
            }
            ui.press_character('i');
            assert!(ui.press_key(key).is_empty(), "the path integrator does not use photons");
            assert!(
                ui.screen_text().contains(&messages::photons_unsupported("whitted")),
                "{}",
                ui.screen_text()
            );
        }
        Action::CycleIntegrator => {
            for (wanted, by_key) in [(Integrator::Path, Some(Integrator::Path)), (Integrator::Whitted, None)]
            {
                let effects = ui.press_key(key);
                assert_eq!(overrides(&effects).expect("a request").integrator, by_key);
                assert_eq!(ui.state.request.integrator(), wanted);
            }
            ui.press_key(key);
            assert!(ui.screen_text().contains("path"), "{}", ui.screen_text());
            assert!(ui.press_character('s').is_empty(), "the path integrator always has soft shadows");
            assert!(
                ui.screen_text().contains(&messages::hard_shadows_unsupported("path", "whitted")),
                "{}",
                ui.screen_text()
            );
        }
        Action::NextView | Action::PreviousView => {
            let effects = ui.press_key(key);
            let wanted = if action == Action::NextView { ViewMode::Normal } else { ViewMode::Error };
            let request = sent_render_request(&effects).expect("a request");
            assert_eq!((request.overrides.view, request.write), (Some(wanted), WriteRequirement::No));
            assert!(ui.screen_text().contains(&messages::view_mode_chosen(wanted.name())));
        }
        Action::OrbitLeft | Action::OrbitRight | Action::OrbitUp | Action::OrbitDown => {
            let moved = requested_pose(&ui.press_key(key)).position - DVec3::Y;
            let expected = match action {
                Action::OrbitLeft => -DVec3::X,
                Action::OrbitRight => DVec3::X,
                Action::OrbitUp => DVec3::Y,
                _ => -DVec3::Y,
            };
            assert!(moved.dot(expected) > 0.1 && (moved.length() - 4.0).abs() < 1e-3, "{moved}");
        }
        Action::DollyIn | Action::DollyOut => {
            let distance = requested_pose(&ui.press_key(key)).distance();
            assert_eq!(distance < 4.0, action == Action::DollyIn);
            assert_ne!(distance, 4.0);
        }
        Action::NarrowField | Action::WidenField => {
            let overrides = overrides(&ui.press_key(key)).expect("a request");
            assert_eq!(overrides.camera.fov.map(|fov| fov < 40.0), Some(action == Action::NarrowField));
            assert_eq!(overrides.camera.pose, None);
        }
        Action::Darken | Action::Brighten => {
            let stops = if action == Action::Darken { -0.25 } else { 0.25 };
            let effects = ui.press_key(key);
            assert_eq!(
                sent_render_request(&effects).map(|it| (it.overrides.exposure, it.write)),
                Some((Some(stops), WriteRequirement::No))
            );
            assert!(
                ui.screen_text()
                    .contains(&messages::exposure_changed(&crate::state::format_exposure_stops(stops))),
                "{}",
                ui.screen_text()
            );
        }
        Action::KeepCamera => {
            assert!(ui.press_key(key).is_empty(), "an unchanged camera should not be saved");
            ui.press_character('l');
            let wanted = ui.state.request.current_camera().expect("a camera");
            assert!(
                matches!(&ui.press_key(key)[..], [Effect::Send(Command::KeepCamera(moved))] if moved.camera == wanted && moved.own == camera())
            );
        }
        Action::Inspect => {
            assert!(
                matches!(ui.press_key(key)[..], [Effect::Send(Command::Pick(spot))] if (spot.x, spot.y) == (0.5, 0.5))
            );
        }
        Action::UndoCamera => {
            assert!(ui.press_key(key).is_empty(), "no camera has been saved");
            let edit = SavedCameraEdit { path: "a.toml".into(), before: "".into(), after: "a".into() };
            ui.state.saving.camera_edits.push(edit.clone());
            assert!(
                matches!(&ui.press_key(key)[..], [Effect::Send(Command::UndoCamera(asked))] if *asked == edit)
            );
        }
        Action::Copy => {
            assert!(ui.press_key(key).is_empty(), "nothing has been clicked");
            ui.state.selection.clicked = Some("a ball".to_owned());
            assert!(
                ui.press_key(key).is_empty() && ui.screen_text().contains(messages::SELECT_TO_COPY),
                "{}",
                ui.screen_text()
            );
            ui.state.display.capabilities.clipboard = true;
            assert!(matches!(ui.press_key(key)[..], [Effect::Aside(_)]));
        }
        Action::Focus => {
            assert!(ui.press_key(key).is_empty(), "expected to wait for a click");
            assert!(matches!(ui.press_key(key)[..], [Effect::Send(Command::Pick(_))]));
        }
        Action::ActualPixels => {
            let around = |effects: &[Effect]| match effects {
                [Effect::Send(Command::Preview(Some(size)))] => size.around,
                other => panic!("{other:?}"),
            };
            assert_eq!(around(&ui.press_key(key)), Some(NormalizedPosition { x: 0.5, y: 0.5 }));
            assert!(ui.screen_text().contains("x back"), "{}", ui.screen_text());
            assert_eq!(around(&ui.press_key(key)), None);
        }
        Action::RenderRegionFirst => {
            let first = |effects: &[Effect]| sent_render_request(effects).expect("a request").first;
            ui.press_character('r');
            assert!(ui.press_key(key).is_empty(), "expected to wait for a drag");
            let section = first(&ui.press_key(key)).expect("a region around the crosshair");
            assert!((section.left - 1.0 / 3.0).abs() < 1e-9 && (section.height - 1.0 / 3.0).abs() < 1e-9);
            assert!(ui.screen_text().contains("z region first"), "{}", ui.screen_text());
            assert_eq!(first(&ui.press_key(key)), None);
        }
        Action::ToggleMouse => {
            assert!(matches!(ui.press_key(key)[..], [Effect::Mouse(false)]));
            assert!(matches!(ui.press_key(key)[..], [Effect::Mouse(true)]));
        }
        Action::Edit => assert!(matches!(ui.press_key(key)[..], [Effect::Edit(_)])),
        Action::CompareLastEdit => {
            ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
            ui.finish_render(BLUE);
            for (color, other) in [(RED, BLUE), (BLUE, RED)] {
                ui.press_key(key);
                assert!(cells_of(ui, color) > 0 && cells_of(ui, other) == 0);
            }
        }
        Action::OlderRender | Action::NewerRender => {
            ui.press_character('s');
            ui.finish_render(BLUE);
            let is_older = action == Action::OlderRender;
            if !is_older {
                ui.press_character('n');
            }
            ui.press_key(key);
            assert_eq!(cells_of(ui, RED) > 0, is_older);
        }
        Action::TogglePause => {
            ui.press_character('r');
            assert!(matches!(ui.press_key(key)[..], [Effect::Send(Command::Pause(true))]));
            assert!(ui.screen_text().contains("paused"));
            assert!(matches!(ui.press_key(key)[..], [Effect::Send(Command::Pause(false))]));
        }
        Action::RenderAgain => assert!(sent_render_request(&ui.press_key(key)).expect("a request").force),
        Action::WriteImage => assert!(matches!(ui.press_key(key)[..], [Effect::Send(Command::Write)])),
        Action::ResetSettings => {
            ui.press_character('s');
            ui.press_character('v');
            assert_eq!(overrides(&ui.press_key(key)), Some(Overrides::default()));
            assert!(ui.press_key(key).is_empty(), "nothing left to reset");
        }
        Action::ToggleDiagnostics => {
            ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
            assert!(ui.press_key(key).is_empty());
            assert!(!ui.screen_text().contains("error: wrong"));
        }
        Action::ShowImageOnly => {
            let cells = cells_of(ui, RED);
            let effects = ui.press_key(key);
            assert!(matches!(effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
            assert!(
                cells_of(ui, RED) > cells && ui.screen_text().contains("tab back"),
                "{}",
                ui.screen_text()
            );
            ui.press_key(key);
            assert_eq!(cells_of(ui, RED), cells);
        }
        Action::ToggleHelp => {
            let help = keymap::binding_for_action(action).expect("a binding").help;
            ui.press_key(key);
            assert!(ui.screen_text().contains(help));
            ui.press_key(key);
            assert!(!ui.screen_text().contains(help));
        }
        Action::Redraw => assert!(matches!(ui.press_key(key)[..], [Effect::Redraw])),
        Action::Suspend => assert!(matches!(ui.press_key(key)[..], [Effect::StopJob])),
        Action::Interrupt => assert!(matches!(ui.press_key(key)[..], [Effect::Quit(ExitStatus(130))])),
        Action::Quit => assert!(matches!(ui.press_key(key)[..], [Effect::Quit(ExitStatus(0))])),
    }
}

/// The text of the key line.
fn bottom(ui: &mut TestUi) -> String {
    ui.screen_text().lines().last().map(str::to_owned).unwrap_or_default()
}

#[test]
fn key_line_shows_toggles_and_values() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(bottom(&mut ui).starts_with("s soft  p off  d on  v beauty  i whitted  "), "{}", bottom(&mut ui));
    assert!(bottom(&mut ui).ends_with("q quit  ? help"));
    let is_bold =
        |ui: &mut TestUi| ui.draw_screen()[(2, 23)].modifier.contains(ratatui::style::Modifier::BOLD);
    assert!(!is_bold(&mut ui));
    ui.press_character('s');
    assert!(bottom(&mut ui).starts_with("s hard"), "{}", bottom(&mut ui));
    assert!(is_bold(&mut ui), "changed settings should be bold");
    ui.press_character('i');
    assert!(bottom(&mut ui).starts_with("s –  p off  d on  v beauty  i path"), "{}", bottom(&mut ui));
    ui.handle_event(Event::Resize(window(140, 40)));
    ui.press_character('0');
    let long = "s shadows soft  p photons off  d dof on  v view beauty  i whitted  ";
    assert!(bottom(&mut ui).starts_with(long), "{}", bottom(&mut ui));
    ui.handle_event(Event::Resize(window(40, 12)));
    ui.press_character('g');
    ui.finish_render(RED);
    ui.press_character('0');
    ui.press_character('?');
    ui.press_character('?');
    assert!(bottom(&mut ui).starts_with("s soft  p off") && bottom(&mut ui).ends_with("? help"));
}

#[test]
fn key_line_shows_currently_useful_keys() {
    let mut ui = TestUi::new();
    assert!(bottom(&mut ui).contains("space pause"), "{}", bottom(&mut ui));
    ui.press_character(' ');
    assert!(bottom(&mut ui).contains("space resume"), "{}", bottom(&mut ui));
    ui.finish_render(RED);
    assert!(bottom(&mut ui).contains("tab image") && !bottom(&mut ui).contains("space"));
    ui.press_character('s');
    ui.finish_render(RED);
    ui.handle_event(Event::Resize(window(200, 60)));
    for binding in KEYMAP.iter().filter(|it| !it.hint.is_empty() && it.action != Action::TogglePause) {
        let hint = format!("{} {}", binding.label, binding.hint);
        assert!(bottom(&mut ui).contains(&hint), "{hint:?} not found in {}", bottom(&mut ui));
    }
    let generation = ui.state.request.generation;
    ui.worker_event(done_event(generation, vec![diagnostic(Severity::Warning, "unused")], false));
    assert!(bottom(&mut ui).contains("e 1 warning"));
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
    assert!(bottom(&mut ui).contains("esc close"), "{}", bottom(&mut ui));
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(bottom(&mut ui).contains("e 1 error"), "{}", bottom(&mut ui));
}

#[test]
fn message_is_shown_until_a_key_is_pressed() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let hints = bottom(&mut ui);
    ui.press_character('0');
    let text = ui.screen_text();
    assert!(text.lines().nth(22).is_some_and(|line| line.starts_with(messages::NOTHING_TO_RESET)), "{text}");
    assert_eq!(bottom(&mut ui), hints);
    ui.press_character('?');
    ui.press_character('?');
    assert!(!ui.screen_text().contains(messages::NOTHING_TO_RESET));
    // If there is no separate line for messages, they replace the key line or the scene name in the header.
    for rows in [12, 5] {
        ui.handle_event(Event::Resize(window(60, rows)));
        ui.press_character('0');
        assert!(ui.screen_text().contains(messages::NOTHING_TO_RESET), "{}", ui.screen_text());
    }
}

#[test]
fn toggles_start_from_the_command_line() {
    let base =
        Overrides { shadows: Some(ShadowMode::Off), view: Some(ViewMode::Depth), ..Overrides::default() };
    let state = state_with(80, 24, PreviewStyle::HalfBlock, ColorDepth::TrueColor, base.clone());
    let mut ui = TestUi::from_state(state);
    assert!(bottom(&mut ui).starts_with("s off  p off") && bottom(&mut ui).contains("v depth"));
    let effects = ui.press_character('s');
    let soft = sent_render_request(&effects).expect("a request");
    assert_eq!((soft.overrides.shadows, soft.write), (Some(ShadowMode::Soft), WriteRequirement::No));
    assert_eq!(soft.own.as_deref(), Some(&base), "the scene's own image should continue");
    let effects = ui.press_character('V');
    assert_eq!(sent_render_request(&effects).expect("a request").write, WriteRequirement::No);
    let effects = ui.press_character('0');
    assert_eq!(sent_render_request(&effects).map(|it| it.overrides.clone()), Some(base));
}

#[test]
fn pinhole_has_no_depth_of_field() {
    let mut ui = TestUi::new();
    let pinhole = || Box::new(EffectiveSettingsSummary { dof: false, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings { generation: 1, settings: pinhole(), own: scene_settings() });
    assert!(ui.press_character('d').is_empty());
    assert!(ui.screen_text().contains(messages::PINHOLE));

    let base = Overrides { dof: Some(false), ..Overrides::default() };
    let state = state_with(80, 24, PreviewStyle::HalfBlock, ColorDepth::TrueColor, base);
    let mut ui = TestUi::from_state(state);
    ui.worker_event(protocol::Event::Settings { generation: 1, settings: pinhole(), own: scene_settings() });
    assert_eq!(sent_render_request(&ui.press_character('d')).expect("a request").overrides.dof, Some(true));
    ui.worker_event(protocol::Event::Settings { generation: 2, settings: pinhole(), own: scene_settings() });
    assert!(ui.screen_text().contains(messages::PINHOLE));
}

#[test]
fn new_request_ends_a_pause() {
    let mut ui = TestUi::new();
    ui.press_character(' ');
    let effects = ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(matches!(effects[..], [Effect::Send(Command::Pause(false)), Effect::Send(Command::Render(_))]));
    assert!(!ui.state.work.paused);
    assert!(ui.screen_text().contains(messages::RESUMED), "{}", ui.screen_text());
}

#[test]
fn resuming_is_reported_with_other_messages() {
    for (key, words) in [
        ('s', messages::RESUMED.to_owned()),
        ('r', messages::RESUMED.to_owned()),
        ('v', messages::view_mode_chosen("normal")),
    ] {
        let mut ui = TestUi::new();
        ui.press_character(' ');
        let effects = ui.press_character(key);
        assert!(sent_render_request(&effects).is_some() && !ui.state.work.paused);
        let text = ui.screen_text();
        assert!(text.contains(messages::RESUMED) && text.contains(&words[..5]), "{key}: {text}");
        ui.press_character(key);
        assert!(!ui.screen_text().contains(messages::RESUMED), "{key}: should be reported only once");
    }
    let mut ui = TestUi::new();
    ui.press_character(' ');
    ui.press_character(' ');
    assert!(!ui.screen_text().contains(messages::RESUMED), "resuming with space should show no message");
}

#[test]
fn clock_stops_while_paused() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.5, None) });
    ui.advance_clock(3000);
    ui.press_character(' ');
    assert!(ui.screen_text().contains("32/64 samples · 3.0 s"), "{}", ui.screen_text());
    ui.advance_clock(5000);
    assert!(ui.screen_text().contains("32/64 samples · 3.0 s"), "{}", ui.screen_text());
    ui.press_character(' ');
    ui.advance_clock(1000);
    assert!(ui.screen_text().contains("32/64 samples · 4.0 s"), "{}", ui.screen_text());
}

#[test]
fn pausing_without_a_render_shows_a_message() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(ui.press_character(' ').is_empty());
    assert!(ui.screen_text().contains(messages::NOT_RENDERING));
}

#[test]
fn postponed_write_is_reported_again_when_done() {
    let mut ui = TestUi::new();
    ui.press_character('w');
    ui.worker_event(protocol::Event::WritePostponed { generation: 1 });
    assert!(ui.screen_text().contains(messages::WRITE_POSTPONED), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::WriteDone { generation: 1, paths: vec!["cornell.png".into()] });
    assert!(ui.screen_text().contains(&messages::files_written("cornell.png")), "{}", ui.screen_text());
}

#[test]
fn canceled_render_is_not_paused() {
    let mut ui = TestUi::new();
    ui.press_character(' ');
    ui.worker_event(protocol::Event::Canceled { generation: 1 });
    assert!(!ui.state.work.paused && !ui.screen_text().contains("paused"), "{}", ui.screen_text());
}

#[test]
fn reverted_toggle_is_not_a_change() {
    for (keys, base) in [
        ("sss", Overrides::default()),
        ("sss", Overrides { shadows: Some(ShadowMode::Hard), ..Overrides::default() }),
        ("ii", Overrides::default()),
        ("pp", Overrides::default()),
        ("dd", Overrides::default()),
        ("vV", Overrides::default()),
    ] {
        let mut ui = TestUi::from_state(state_with(
            120,
            40,
            PreviewStyle::HalfBlock,
            ColorDepth::TrueColor,
            base.clone(),
        ));
        ui.finish_render(RED);
        let mut requests = Vec::new();
        for key in keys.chars() {
            assert_eq!(ui.state.request.combined_overrides() == base, requests.is_empty(), "{keys}");
            requests.extend(sent_render_request(&ui.press_character(key)).cloned());
        }
        assert_eq!(requests.last().map(|request| &request.overrides), Some(&base), "{keys}");
        // Toggling starts again from the scene's value, whether or not the reply has arrived.
        let first = sent_render_request(&ui.press_character(keys.chars().next().expect("a key")))
            .cloned()
            .expect("a request");
        assert_eq!(first.overrides, requests[0].overrides, "{keys}");
    }
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    "sssii".chars().for_each(|key| drop(ui.press_character(key)));
    assert!(ui.press_character('0').is_empty());
    assert!(ui.screen_text().contains(messages::NOTHING_TO_RESET), "{}", ui.screen_text());
}

#[test]
fn saved_settings_are_the_base_for_toggles() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    ui.press_character('s');
    ui.finish_render(BLUE);
    // The saved scene has hard shadows, as set with the key.
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    let generation = ui.state.request.generation;
    let own = AdjustableSceneSettings { shadows: ShadowMode::Hard, ..scene_settings() };
    let settings = Box::new(EffectiveSettingsSummary { shadows: ShadowMode::Hard, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings { generation, settings, own });
    let shadows: Vec<Option<ShadowMode>> = "sss"
        .chars()
        .map(|key| {
            sent_render_request(&ui.press_character(key)).and_then(|request| request.overrides.shadows)
        })
        .collect();
    assert_eq!(shadows, [Some(ShadowMode::Off), Some(ShadowMode::Soft), None]);
}
