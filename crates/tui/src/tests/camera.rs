//! Tests of keys on the camera: which pictures they request, how often, and the messages.

use super::{BLUE, RED};
use crate::event::{Effect, Event, KeyPress};
use crate::fixtures::*;
use crate::pipeline::protocol::{self, Command, Viewpoint, Writing};
use crate::pipeline::settings::Overrides;
use crate::preview_kind::PreviewKind;
use crate::scene::description::Pose;
use crate::scene::diagnostic::Severity;
use crate::{Changed, ColorDepth};
use crossterm::event::KeyCode;

fn show(ui: &mut TestUi) -> Vec<crate::event::Effect> {
    let generation = ui.state.request.generation;
    ui.event(Event::Picture {
        generation,
        picture: plain_picture(50, 38, BLUE),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    })
}

#[test]
fn a_moved_camera_is_shown_and_not_written_until_it_goes_back() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    let effects = ui.press('l');
    let moved = request(&effects).expect("a request");
    assert_eq!((moved.write, moved.force), (Writing::No, false));
    let text = ui.text();
    assert!(text.contains("camera moved (preview only). w: save image"), "{text}");
    assert!(text.lines().last().is_some_and(|line| line.contains("0 reset camera")), "{text}");
    show(&mut ui);
    let effects = ui.event(Event::Changed(Changed { noticed: ui.now }));
    let edited = request(&effects).expect("a request");
    assert_eq!(edited.overrides.camera, moved.overrides.camera, "a save does not move it back");
    assert_eq!(edited.write, Writing::No);
    let effects = ui.press('0');
    let own = request(&effects).expect("a request");
    assert_eq!((own.write, own.overrides.camera.is_any()), (Writing::Try, false));
    assert!(!ui.text().contains("camera moved"));
}

#[test]
fn of_many_steps_the_newest_is_rendered_once_the_one_before_is_seen() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    let effects = ui.press('l');
    let first = request(&effects).expect("the first step at once").overrides.camera.pose.expect("a pose");
    for key in ['l', 'l', 'k', '<'] {
        assert!(ui.press(key).is_empty(), "the first has no picture yet");
    }
    let effects = show(&mut ui);
    let newest = request(&effects).expect("the newest").overrides.camera;
    let pose = newest.pose.expect("a pose");
    assert!(pose.position.x > 2.9 * first.position.x && pose.position.y > 1.1, "{pose:?}");
    assert!(newest.fov.is_some_and(|fov| fov < 40.0));
    assert!(show(&mut ui).is_empty(), "nothing waits any more");
    assert!(request(&ui.press('l')).is_some(), "and the next goes at once");
    // What is not a step goes at once, with all steps before it.
    ui.press('l');
    let effects = ui.press('s');
    assert!(request(&effects).expect("a request").overrides.camera != newest);
    assert!(show(&mut ui).is_empty());
}

#[test]
fn a_step_that_can_have_no_picture_holds_nothing_up() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui.press('l');
    ui.press('l');
    let generation = ui.state.request.generation;
    let diagnostics = vec![diagnostic(Severity::Error, "wrong")];
    let failure = protocol::Failure::Scene(diagnostics);
    let effects = ui.worker(protocol::Event::Failed { generation, failure });
    assert!(request(&effects).is_none(), "the scene broke meanwhile: the last good one is rendered");
    assert!(request(&show(&mut ui)).is_some(), "which is seen");
    ui.press('l');
    let generation = ui.state.request.generation;
    let failure = protocol::Failure::Work("no memory".to_owned());
    let effects = ui.worker(protocol::Event::Failed { generation, failure });
    assert!(request(&effects).is_some(), "the work failed: the step that waited goes");
    let mut ui = TestUi::with(state(80, 1));
    ui.finish(RED);
    for _ in 0..3 {
        assert!(request(&ui.press('l')).is_some(), "there is no room for a picture");
    }
}

#[test]
fn the_arrows_scroll_the_errors_while_they_are_open() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui.fail((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    let down = KeyPress::special(KeyCode::Down);
    assert!(ui.key(down).is_empty());
    assert!(ui.state.overlays.diagnostics.scroll > 0);
    ui.key(KeyPress::special(KeyCode::Esc));
    assert!(request(&ui.key(down)).is_some(), "closed, they move the camera");
}

#[test]
fn before_a_scene_is_read_there_is_no_camera_to_move() {
    let mut ui = TestUi::new();
    assert!(ui.press('l').is_empty() && ui.press('>').is_empty() && ui.press(']').is_empty());
    assert!(ui.text().contains("has not been read yet"));
}

#[test]
fn exposure_starts_from_the_scene_s_own() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui.state.request.exposure = Some(1.0);
    ui.press(']');
    show(&mut ui);
    let effects = ui.press(']');
    assert_eq!(request(&effects).and_then(|it| it.overrides.exposure), Some(1.5));
    assert!(ui.text().contains("0 reset exposure (+1.5)"), "{}", ui.text());
}

#[test]
fn keys_that_are_held_come_to_an_end_and_say_so() {
    for (key, words) in [
        ('+', "as near as keys go"),
        ('-', "as far as keys go"),
        ('<', "field of view 1°"),
        ('>', "field of view 160°"),
        ('[', "exposure −20"),
        (']', "exposure +20"),
    ] {
        let mut ui = TestUi::new();
        ui.finish(RED);
        for _ in 0..400 {
            ui.press(key);
            show(&mut ui);
        }
        assert!(ui.text().contains(words), "{key}: {}", ui.text());
        let generation = ui.state.request.generation;
        assert!(
            ui.press(key).is_empty() && ui.state.request.generation == generation,
            "{key}: nothing is rendered"
        );
        let view = ui.state.request.viewpoint().expect("a camera");
        assert!((0.0039..4001.0).contains(&view.pose.distance()), "{key}: {view:?}");
    }
}

#[test]
fn what_is_back_where_the_scene_has_it_is_no_change() {
    for keys in ["[]", "][", "<>", "><", "+-", "-+", "lh", "]]]]["] {
        let mut ui = TestUi::new();
        ui.finish(RED);
        let mut last = None;
        for key in keys.chars() {
            let effects = ui.press(key);
            last = request(&effects).cloned();
            show(&mut ui);
        }
        let last = last.expect("a request");
        let is_back = keys != "]]]][";
        assert_eq!(last.overrides == Overrides::default(), is_back, "{keys}: {:?}", last.overrides);
        assert_eq!(
            (last.write, last.own.is_none()),
            if is_back { (Writing::Try, true) } else { (Writing::No, false) }
        );
        let line = ui.text().lines().last().map(str::to_owned).unwrap_or_default();
        assert_eq!(!line.contains("0 "), is_back, "{keys}: {line}");
        assert!(!ui.text().contains("camera moved"), "{keys}: {}", ui.text());
    }
}

#[test]
fn the_call_s_own_exposure_is_no_change_either() {
    let base = Overrides { exposure: Some(1.0), ..Overrides::default() };
    let mut ui = TestUi::with(state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base));
    ui.finish(RED);
    ui.press('[');
    show(&mut ui);
    ui.press(']');
    assert_eq!((ui.state.request.toggles.exposure, ui.state.request.overrides().exposure), (None, Some(1.0)));
}

#[test]
fn the_scene_of_a_model_is_written_once_and_its_camera_is_kept() {
    use crate::pipeline::protocol::{Event as WorkerEvent, Kept};
    let mut ui = TestUi::new();
    ui.state.request.scene = "assets/vase.obj".into();
    ui.finish([200, 30, 30]);
    ui.press('l');
    ui.finish([30, 30, 200]);
    ui.key(KeyPress::special(KeyCode::Esc));
    assert!(ui.text().contains("c keep") && !ui.text().contains("o edit"), "{}", ui.text());
    let kept =
        Kept { path: "assets/vase.toml".into(), is_new: true, is_own: false, of_model: true, edit: None };
    let generation = ui.state.request.generation;
    ui.worker(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
    ui.key(KeyPress::special(KeyCode::Esc));
    assert!(!ui.text().contains("c keep"), "there is a scene already: {}", ui.text());
    assert_eq!(crate::exit_summary::not_kept(&ui.state), None);
    ui.press('l');
    ui.finish([200, 30, 30]);
    assert!(crate::exit_summary::not_kept(&ui.state).is_some(), "it was moved since");
}

/// A save after which the scene has this camera.
fn save(ui: &mut TestUi, camera: Viewpoint) {
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    ui.worker(protocol::Event::Settings {
        generation,
        settings: settings().into(),
        camera,
        exposure: 0.0,
        own: own(),
    });
    show(ui);
}

/// The camera that `c` orders to be written. `None` if it orders nothing.
fn kept(ui: &mut TestUi) -> Option<Viewpoint> {
    let is_order = |effect: Effect| match effect {
        Effect::Send(Command::KeepCamera(moved)) => Some(moved.camera),
        _ => None,
    };
    ui.press('c').into_iter().find_map(is_order)
}

fn moved_to(position: [f64; 3]) -> Viewpoint {
    let camera = camera();
    Viewpoint { pose: Pose { position: position.into(), ..camera.pose }, ..camera }
}

#[test]
fn what_was_saved_of_a_moved_camera_is_named_before_c_writes_over_it() {
    let wide = |fov| Viewpoint { fov, ..camera() };
    let look_at = Viewpoint { pose: Pose { look_at: [0.0, 0.5, 0.0].into(), ..camera().pose }, ..camera() };
    let both = Viewpoint { fov: 25.0, ..moved_to([0.0, 2.0, 4.0]) };
    for (keys, saved, words) in [
        ("h", moved_to([0.0, 2.0, 4.0]), "camera.position = [0, 2, 4]"),
        ("h", look_at, "camera.look_at = [0, 0.5, 0]"),
        ("<", wide(25.0), "camera.fov = 25"),
        ("h<", both, "camera.position = [0, 2, 4], camera.fov = 25"),
        ("h<", wide(25.0), "camera.fov = 25"),
    ] {
        let mut ui = TestUi::with(state(160, 40));
        ui.finish(RED);
        for key in keys.chars() {
            ui.press(key);
            show(&mut ui);
        }
        let moved = ui.state.request.toggles.camera;
        save(&mut ui, saved);
        assert_eq!(kept(&mut ui), None, "{keys}");
        let said = format!(
            "error: {words} was saved since the keys moved the camera: press c again to write over it"
        );
        assert!(ui.text().contains(&said), "{keys}: {}", ui.text());
        assert_eq!(kept(&mut ui), Some(saved.changed(&moved)), "{keys}: the second time it is meant");
    }
}

#[test]
fn what_is_saved_after_that_is_named_again() {
    let mut ui = TestUi::with(state(160, 40));
    ui.finish(RED);
    ui.press('h');
    show(&mut ui);
    for height in [2.0, 3.0] {
        save(&mut ui, moved_to([0.0, height, 4.0]));
        assert_eq!(kept(&mut ui), None);
        assert!(ui.text().contains(&format!("camera.position = [0, {height}, 4]")), "{}", ui.text());
    }
    // Moved on, it is still the camera that is meant.
    ui.press('h');
    show(&mut ui);
    assert!(kept(&mut ui).is_some());
}

#[test]
fn what_was_saved_beside_a_moved_camera_stays_when_c_writes() {
    let saved = Viewpoint { fov: 25.0, ..camera() };
    let mut ui = TestUi::with(state(160, 40));
    ui.finish(RED);
    ui.press('h');
    show(&mut ui);
    save(&mut ui, saved);
    let moved = ui.state.request.toggles.camera;
    assert_eq!(kept(&mut ui), Some(saved.changed(&moved)));
    // The plane in focus goes with what is looked at: it was not saved.
    let mut ui = TestUi::with(state(160, 40));
    ui.finish(RED);
    ui.state.request.toggles.camera.focus = Some(2.5);
    ui.press('r');
    save(&mut ui, moved_to([0.0, 1.0, 6.0]));
    assert_eq!(kept(&mut ui).map(|camera| (camera.focus, camera.pose.position.z)), Some((2.5, 6.0)));
}

#[test]
fn keys_that_move_the_camera_from_a_saved_one_write_over_nothing_that_is_newer() {
    let mut ui = TestUi::with(state(160, 40));
    ui.finish(RED);
    ui.press('h');
    show(&mut ui);
    save(&mut ui, moved_to([0.0, 2.0, 4.0]));
    ui.press('0');
    ui.press('h');
    assert!(kept(&mut ui).is_some());
}

#[test]
fn the_camera_of_a_model_is_saved_by_nobody() {
    let mut ui = TestUi::with(state(160, 40));
    ui.state.request.scene = "assets/vase.obj".into();
    ui.finish(RED);
    ui.press('h');
    show(&mut ui);
    // The model has another size by now, and is framed anew.
    save(&mut ui, moved_to([0.0, 2.0, 4.0]));
    assert!(kept(&mut ui).is_some());
}
