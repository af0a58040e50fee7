//! Tests of the effect of each key, and that the help tells it.

use super::{BLUE, RED, cells_of};
use crate::action::Action;
use crate::choice::Choice;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress};
use crate::fixtures::*;
use crate::keymap::KEYMAP;
use crate::math::DVec3;
use crate::pipeline::protocol::{self, CameraEdit, Command, Spot, Writing};
use crate::pipeline::settings::{Effective, Overrides, OwnSettings, View};
use crate::preview_kind::PreviewKind;
use crate::scene::description::{Integrator, Pose, Shadows};
use crate::scene::diagnostic::Severity;
use crate::{Changed, ExitStatus};

/// Every key of the table does what its line says. The match has an arm for every action.
#[test]
fn every_key_has_its_effect() {
    for binding in KEYMAP {
        for key in binding.keys {
            let mut desk = Desk::new();
            desk.finish(RED);
            check(binding.action, *key, &mut desk);
        }
    }
}

/// The pose that a key gives to the camera.
fn moved(effects: &[Effect]) -> Pose {
    request(effects).and_then(|it| it.overrides.camera.pose).expect("a request with a camera")
}

fn check(action: Action, key: KeyPress, desk: &mut Desk) {
    let overrides = |effects: &[Effect]| request(effects).map(|it| it.overrides.clone());
    match action {
        Action::CycleShadows => {
            // Back at the scene's own value, nothing is overridden.
            for (wanted, by_key) in [
                (Shadows::Hard, Some(Shadows::Hard)),
                (Shadows::Off, Some(Shadows::Off)),
                (Shadows::Soft, None),
            ] {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").shadows, by_key);
                assert_eq!(desk.state.request.shadows(), wanted);
            }
        }
        Action::ToggleDepthOfField => {
            for by_key in [Some(false), None] {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").dof, by_key);
            }
        }
        Action::TogglePhotons => {
            for (wanted, by_key) in [(true, Some(true)), (false, None)] {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").photons, by_key);
                assert_eq!(desk.state.request.photons(), wanted);
            }
            desk.press('i');
            assert!(desk.key(key).is_empty(), "path has none");
            assert!(desk.text().contains("path gathers no photons; press i for whitted"), "{}", desk.text());
        }
        Action::CycleIntegrator => {
            for (wanted, by_key) in [(Integrator::Path, Some(Integrator::Path)), (Integrator::Whitted, None)]
            {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").integrator, by_key);
                assert_eq!(desk.state.request.integrator(), wanted);
            }
            desk.key(key);
            assert!(desk.text().contains("path"), "{}", desk.text());
            assert!(desk.press('s').is_empty(), "path has no other shadows");
            assert!(desk.text().contains("path ignores"), "{}", desk.text());
        }
        Action::NextView | Action::PreviousView => {
            let effects = desk.key(key);
            let wanted = if action == Action::NextView { View::Normal } else { View::Error };
            let request = request(&effects).expect("a request");
            assert_eq!((request.overrides.view, request.write), (Some(wanted), Writing::No));
            assert!(desk.text().contains(&format!("view {} (preview only)", wanted.name())));
        }
        Action::OrbitLeft | Action::OrbitRight | Action::OrbitUp | Action::OrbitDown => {
            let moved = moved(&desk.key(key)).position - DVec3::Y;
            let expected = match action {
                Action::OrbitLeft => -DVec3::X,
                Action::OrbitRight => DVec3::X,
                Action::OrbitUp => DVec3::Y,
                _ => -DVec3::Y,
            };
            assert!(moved.dot(expected) > 0.1 && (moved.length() - 4.0).abs() < 1e-3, "{moved}");
        }
        Action::DollyIn | Action::DollyOut => {
            let distance = moved(&desk.key(key)).distance();
            assert_eq!(distance < 4.0, action == Action::DollyIn);
            assert_ne!(distance, 4.0);
        }
        Action::NarrowField | Action::WidenField => {
            let overrides = overrides(&desk.key(key)).expect("a request");
            assert_eq!(overrides.camera.fov.map(|fov| fov < 40.0), Some(action == Action::NarrowField));
            assert_eq!(overrides.camera.pose, None);
        }
        Action::Darken | Action::Brighten => {
            let stops = if action == Action::Darken { -0.25 } else { 0.25 };
            let effects = desk.key(key);
            assert_eq!(
                request(&effects).map(|it| (it.overrides.exposure, it.write)),
                Some((Some(stops), Writing::No))
            );
            assert!(
                desk.text().contains(&format!("exposure {}", crate::state::signed_stops(stops))),
                "{}",
                desk.text()
            );
        }
        Action::KeepCamera => {
            assert!(desk.key(key).is_empty(), "it has not moved");
            desk.press('l');
            let wanted = desk.state.request.viewpoint().expect("a camera");
            assert!(
                matches!(desk.key(key)[..], [Effect::Send(Command::KeepCamera(moved))] if moved.camera == wanted && moved.own == camera())
            );
        }
        Action::Inspect => {
            assert!(
                matches!(desk.key(key)[..], [Effect::Send(Command::Pick(spot))] if (spot.x, spot.y) == (0.5, 0.5))
            );
        }
        Action::UndoCamera => {
            assert!(desk.key(key).is_empty(), "c has written nothing");
            let edit = CameraEdit { path: "a.toml".into(), before: "".into(), after: "a".into() };
            desk.state.saving.camera_edits.push(edit.clone());
            assert!(
                matches!(&desk.key(key)[..], [Effect::Send(Command::UndoCamera(asked))] if *asked == edit)
            );
        }
        Action::Copy => {
            assert!(desk.key(key).is_empty(), "nothing was clicked");
            desk.state.selection.clicked = Some("a ball".to_owned());
            assert!(
                desk.key(key).is_empty() && desk.text().contains("to copy, drag with shift"),
                "{}",
                desk.text()
            );
            desk.state.display.abilities.clipboard = true;
            assert!(matches!(desk.key(key)[..], [Effect::Aside(_)]));
        }
        Action::Focus => {
            assert!(desk.key(key).is_empty(), "a click is waited for");
            assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Pick(_))]));
        }
        Action::CloseUp => {
            let around = |effects: &[Effect]| match effects {
                [Effect::Send(Command::Preview(Some(size)))] => size.around,
                other => panic!("{other:?}"),
            };
            assert_eq!(around(&desk.key(key)), Some(Spot { x: 0.5, y: 0.5 }));
            assert!(desk.text().contains("x back"), "{}", desk.text());
            assert_eq!(around(&desk.key(key)), None);
        }
        Action::RectangleFirst => {
            let first = |effects: &[Effect]| request(effects).expect("a request").first;
            desk.press('r');
            assert!(desk.key(key).is_empty(), "a drag is waited for");
            let section = first(&desk.key(key)).expect("around the crosshair");
            assert!((section.left - 1.0 / 3.0).abs() < 1e-9 && (section.height - 1.0 / 3.0).abs() < 1e-9);
            assert!(desk.text().contains("z rectangle first"), "{}", desk.text());
            assert_eq!(first(&desk.key(key)), None);
        }
        Action::ToggleMouse => {
            assert!(matches!(desk.key(key)[..], [Effect::Mouse(false)]));
            assert!(matches!(desk.key(key)[..], [Effect::Mouse(true)]));
        }
        Action::Edit => assert!(matches!(desk.key(key)[..], [Effect::Edit(_)])),
        Action::BeforeAfter => {
            desk.event(Event::Changed(Changed { noticed: desk.now }));
            desk.finish(BLUE);
            for (color, other) in [(RED, BLUE), (BLUE, RED)] {
                desk.key(key);
                assert!(cells_of(desk, color) > 0 && cells_of(desk, other) == 0);
            }
        }
        Action::OlderPicture | Action::NewerPicture => {
            desk.press('s');
            desk.finish(BLUE);
            let is_older = action == Action::OlderPicture;
            if !is_older {
                desk.press('n');
            }
            desk.key(key);
            assert_eq!(cells_of(desk, RED) > 0, is_older);
        }
        Action::TogglePause => {
            desk.press('r');
            assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Pause(true))]));
            assert!(desk.text().contains("paused"));
            assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Pause(false))]));
        }
        Action::RenderAgain => assert!(request(&desk.key(key)).expect("a request").force),
        Action::WriteNow => assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Write)])),
        Action::SceneSettings => {
            desk.press('s');
            desk.press('v');
            assert_eq!(overrides(&desk.key(key)), Some(Overrides::default()));
            assert!(desk.key(key).is_empty(), "there is nothing left to undo");
        }
        Action::ToggleDiagnostics => {
            desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
            assert!(desk.key(key).is_empty());
            assert!(!desk.text().contains("error: wrong"));
        }
        Action::PictureAlone => {
            let cells = cells_of(desk, RED);
            let effects = desk.key(key);
            assert!(matches!(effects[..], [Effect::Send(Command::Preview(Some(_)))]), "{effects:?}");
            assert!(cells_of(desk, RED) > cells && desk.text().contains("tab back"), "{}", desk.text());
            desk.key(key);
            assert_eq!(cells_of(desk, RED), cells);
        }
        Action::ToggleHelp => {
            desk.key(key);
            assert!(desk.text().contains("show or hide this help"));
            desk.key(key);
            assert!(!desk.text().contains("show or hide this help"));
        }
        Action::Redraw => assert!(matches!(desk.key(key)[..], [Effect::Redraw])),
        Action::Suspend => assert!(matches!(desk.key(key)[..], [Effect::StopJob])),
        Action::Interrupt => assert!(matches!(desk.key(key)[..], [Effect::Quit(ExitStatus(130))])),
        Action::Quit => assert!(matches!(desk.key(key)[..], [Effect::Quit(ExitStatus(0))])),
    }
}

/// The line of keys.
fn bottom(desk: &mut Desk) -> String {
    desk.text().lines().last().map(str::to_owned).unwrap_or_default()
}

#[test]
fn toggles_stand_in_the_line_of_keys_with_their_values() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(
        bottom(&mut desk).starts_with("s soft  p off  d on  v beauty  i whitted  "),
        "{}",
        bottom(&mut desk)
    );
    assert!(bottom(&mut desk).ends_with("q quit  ? help"));
    let is_bold = |desk: &mut Desk| desk.screen()[(2, 23)].modifier.contains(ratatui::style::Modifier::BOLD);
    assert!(!is_bold(&mut desk));
    desk.press('s');
    assert!(bottom(&mut desk).starts_with("s hard"), "{}", bottom(&mut desk));
    assert!(is_bold(&mut desk), "changed by a key");
    desk.press('i');
    assert!(bottom(&mut desk).starts_with("s –  p off  d on  v beauty  i path"), "{}", bottom(&mut desk));
    desk.event(Event::Resize(window(140, 40)));
    desk.press('0');
    let long = "s shadows soft  p photons off  d dof on  v view beauty  i whitted  ";
    assert!(bottom(&mut desk).starts_with(long), "{}", bottom(&mut desk));
    desk.event(Event::Resize(window(40, 12)));
    desk.press('g');
    desk.finish(RED);
    desk.press('0');
    desk.press('?');
    desk.press('?');
    assert!(bottom(&mut desk).starts_with("s soft  p off") && bottom(&mut desk).ends_with("? help"));
}

#[test]
fn what_is_of_use_now_stands_beside_the_toggles() {
    let mut desk = Desk::new();
    assert!(bottom(&mut desk).contains("space pause"), "{}", bottom(&mut desk));
    desk.press(' ');
    assert!(bottom(&mut desk).contains("space go on"), "{}", bottom(&mut desk));
    desk.finish(RED);
    assert!(bottom(&mut desk).contains("tab picture") && !bottom(&mut desk).contains("space"));
    desk.press('s');
    desk.finish(RED);
    desk.event(Event::Resize(window(200, 60)));
    for binding in KEYMAP.iter().filter(|it| !it.hint.is_empty() && it.action != Action::TogglePause) {
        let hint = format!("{} {}", binding.label, binding.hint);
        assert!(bottom(&mut desk).contains(&hint), "{hint:?} is not in {}", bottom(&mut desk));
    }
    let generation = desk.state.request.generation;
    desk.worker(done(generation, vec![diagnostic(Severity::Warning, "unused")], false));
    assert!(bottom(&mut desk).contains("e 1 warning"));
    desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
    assert!(bottom(&mut desk).contains("esc close"), "{}", bottom(&mut desk));
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(bottom(&mut desk).contains("e 1 error"), "{}", bottom(&mut desk));
}

#[test]
fn a_message_stands_under_the_picture_until_the_next_key_and_the_keys_stay() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let hints = bottom(&mut desk);
    desk.press('0');
    let text = desk.text();
    assert!(text.lines().nth(22).is_some_and(|line| line.starts_with("nothing to reset")), "{text}");
    assert_eq!(bottom(&mut desk), hints);
    desk.press('?');
    desk.press('?');
    assert!(!desk.text().contains("nothing to reset"));
    // Without a line of its own it takes the place of the keys, and without those the place of the name.
    for rows in [12, 5] {
        desk.event(Event::Resize(window(60, rows)));
        desk.press('0');
        assert!(desk.text().contains("nothing to reset"), "{}", desk.text());
    }
}

#[test]
fn toggles_start_from_the_command_line_and_go_back_to_it() {
    let base = Overrides { shadows: Some(Shadows::Off), view: Some(View::Depth), ..Overrides::default() };
    let state = state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base.clone());
    let mut desk = Desk::with(state);
    assert!(bottom(&mut desk).starts_with("s off  p off") && bottom(&mut desk).contains("v depth"));
    let effects = desk.press('s');
    let soft = request(&effects).expect("a request");
    assert_eq!((soft.overrides.shadows, soft.write), (Some(Shadows::Soft), Writing::No));
    assert_eq!(soft.own.as_deref(), Some(&base), "the image of the call is kept");
    let effects = desk.press('V');
    assert_eq!(request(&effects).expect("a request").write, Writing::No);
    let effects = desk.press('0');
    assert_eq!(request(&effects).map(|it| it.overrides.clone()), Some(base));
}

#[test]
fn depth_of_field_of_a_pinhole_is_explained() {
    let mut desk = Desk::new();
    let pinhole = || Box::new(Effective { dof: false, ..settings() });
    desk.worker(protocol::Event::Settings {
        generation: 1,
        settings: pinhole(),
        camera: camera(),
        exposure: 0.0,
        own: own(),
    });
    assert!(desk.press('d').is_empty());
    assert!(desk.text().contains("the camera's `aperture` is 0"));

    let base = Overrides { dof: Some(false), ..Overrides::default() };
    let state = state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base);
    let mut desk = Desk::with(state);
    desk.worker(protocol::Event::Settings {
        generation: 1,
        settings: pinhole(),
        camera: camera(),
        exposure: 0.0,
        own: own(),
    });
    assert_eq!(request(&desk.press('d')).expect("a request").overrides.dof, Some(true));
    desk.worker(protocol::Event::Settings {
        generation: 2,
        settings: pinhole(),
        camera: camera(),
        exposure: 0.0,
        own: own(),
    });
    assert!(desk.text().contains("the camera's `aperture` is 0"));
}

#[test]
fn a_new_request_lets_a_paused_worker_go_on() {
    let mut desk = Desk::new();
    desk.press(' ');
    let effects = desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(matches!(effects[..], [Effect::Send(Command::Pause(false)), Effect::Send(Command::Render(_))]));
    assert!(!desk.state.work.paused);
    assert!(desk.text().contains("no longer paused"), "{}", desk.text());
}

#[test]
fn a_key_that_ends_a_pause_says_so_beside_what_it_says_itself() {
    for (key, words) in
        [('s', "no longer paused"), ('r', "no longer paused"), ('v', "view normal (preview only)")]
    {
        let mut desk = Desk::new();
        desk.press(' ');
        let effects = desk.press(key);
        assert!(request(&effects).is_some() && !desk.state.work.paused);
        let text = desk.text();
        assert!(text.contains("no longer paused") && text.contains(words), "{key}: {text}");
        desk.press(key);
        assert!(!desk.text().contains("no longer paused"), "{key}: said once");
    }
    let mut desk = Desk::new();
    desk.press(' ');
    desk.press(' ');
    assert!(!desk.text().contains("no longer paused"), "whoever ends it by its key knows");
}

#[test]
fn the_clock_stands_still_while_a_render_is_held() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, None) });
    desk.wait(3000);
    desk.press(' ');
    assert!(desk.text().contains("32/64 samples · 3.0 s"), "{}", desk.text());
    desk.wait(5000);
    assert!(desk.text().contains("32/64 samples · 3.0 s"), "{}", desk.text());
    desk.press(' ');
    desk.wait(1000);
    assert!(desk.text().contains("32/64 samples · 4.0 s"), "{}", desk.text());
}

#[test]
fn pausing_nothing_is_explained() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.press(' ').is_empty());
    assert!(desk.text().contains("nothing is rendering"));
}

#[test]
fn a_picture_that_is_written_later_says_so_and_then_that_it_is() {
    let mut desk = Desk::new();
    desk.press('w');
    desk.worker(protocol::Event::WritePostponed { generation: 1 });
    assert!(desk.text().contains("as soon as every pixel has a sample"), "{}", desk.text());
    desk.worker(protocol::Event::WriteDone { generation: 1, paths: vec!["cornell.png".into()] });
    assert!(desk.text().contains("wrote cornell.png"), "{}", desk.text());
}

#[test]
fn a_render_that_is_stopped_is_no_longer_held() {
    let mut desk = Desk::new();
    desk.press(' ');
    desk.worker(protocol::Event::Cancelled { generation: 1 });
    assert!(!desk.state.work.paused && !desk.text().contains("paused"), "{}", desk.text());
}

#[test]
fn a_toggle_that_is_back_where_the_scene_has_it_is_no_change() {
    for (keys, base) in [
        ("sss", Overrides::default()),
        ("sss", Overrides { shadows: Some(Shadows::Hard), ..Overrides::default() }),
        ("ii", Overrides::default()),
        ("pp", Overrides::default()),
        ("dd", Overrides::default()),
        ("vV", Overrides::default()),
    ] {
        let mut desk =
            Desk::with(state_with(120, 40, PreviewKind::HalfBlock, ColorDepth::TrueColor, base.clone()));
        desk.finish(RED);
        let mut requests = Vec::new();
        for key in keys.chars() {
            assert_eq!(desk.state.request.overrides() == base, requests.is_empty(), "{keys}");
            requests.extend(request(&desk.press(key)).cloned());
        }
        assert_eq!(requests.last().map(|request| &request.overrides), Some(&base), "{keys}");
        // It goes on from there, whether its answer has come or not.
        let first = request(&desk.press(keys.chars().next().expect("a key"))).cloned().expect("a request");
        assert_eq!(first.overrides, requests[0].overrides, "{keys}");
    }
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    "sssii".chars().for_each(|key| drop(desk.press(key)));
    assert!(desk.press('0').is_empty());
    assert!(desk.text().contains("nothing to reset"), "{}", desk.text());
}

#[test]
fn the_scene_has_other_settings_after_a_save() {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    desk.press('s');
    desk.finish(BLUE);
    // The save is of `hard`, which the keys have as well.
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    let (generation, own) = (desk.state.request.generation, OwnSettings { shadows: Shadows::Hard, ..own() });
    let settings = Box::new(Effective { shadows: Shadows::Hard, ..settings() });
    desk.worker(protocol::Event::Settings { generation, settings, camera: camera(), exposure: 0.0, own });
    let shadows: Vec<Option<Shadows>> = "sss"
        .chars()
        .map(|key| request(&desk.press(key)).and_then(|request| request.overrides.shadows))
        .collect();
    assert_eq!(shadows, [Some(Shadows::Off), Some(Shadows::Soft), None]);
}
