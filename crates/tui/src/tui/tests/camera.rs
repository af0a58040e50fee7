//! Tests of keys on the camera: which pictures they request, how often, and the messages.

use super::{BLUE, RED};
use crate::pipeline::protocol::{self, Writing};
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Severity;
use crate::tui::event::{Event, KeyPress};
use crate::tui::fixtures::*;
use crate::tui::preview_kind::PreviewKind;
use crate::tui::{Changed, ColorDepth};
use crossterm::event::KeyCode;

fn show(desk: &mut Desk) -> Vec<crate::tui::event::Effect> {
    let generation = desk.state.request.generation;
    desk.event(Event::Picture {
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
    let mut desk = Desk::new();
    desk.finish(RED);
    let effects = desk.press('l');
    let moved = request(&effects).expect("a request");
    assert_eq!((moved.write, moved.force), (Writing::No, false));
    let text = desk.text();
    assert!(text.contains("camera moved: shown, not written; w writes it"), "{text}");
    assert!(text.lines().last().is_some_and(|line| line.contains("0 camera moved")), "{text}");
    show(&mut desk);
    let effects = desk.event(Event::Changed(Changed { noticed: desk.now }));
    let edited = request(&effects).expect("a request");
    assert_eq!(edited.overrides.camera, moved.overrides.camera, "a save does not move it back");
    assert_eq!(edited.write, Writing::No);
    let effects = desk.press('0');
    let own = request(&effects).expect("a request");
    assert_eq!((own.write, own.overrides.camera.is_any()), (Writing::Try, false));
    assert!(!desk.text().contains("camera moved"));
}

#[test]
fn of_many_steps_the_newest_is_rendered_once_the_one_before_is_seen() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let effects = desk.press('l');
    let first = request(&effects).expect("the first step at once").overrides.camera.pose.expect("a pose");
    for key in ['l', 'l', 'k', '<'] {
        assert!(desk.press(key).is_empty(), "the first has no picture yet");
    }
    let effects = show(&mut desk);
    let newest = request(&effects).expect("the newest").overrides.camera;
    let pose = newest.pose.expect("a pose");
    assert!(pose.position.x > 2.9 * first.position.x && pose.position.y > 1.1, "{pose:?}");
    assert!(newest.fov.is_some_and(|fov| fov < 40.0));
    assert!(show(&mut desk).is_empty(), "nothing waits any more");
    assert!(request(&desk.press('l')).is_some(), "and the next goes at once");
    // What is not a step goes at once, with all steps before it.
    desk.press('l');
    let effects = desk.press('s');
    assert!(request(&effects).expect("a request").overrides.camera != newest);
    assert!(show(&mut desk).is_empty());
}

#[test]
fn a_step_that_can_have_no_picture_holds_nothing_up() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.press('l');
    desk.press('l');
    let generation = desk.state.request.generation;
    let diagnostics = vec![diagnostic(Severity::Error, "wrong")];
    let failure = protocol::Failure::Scene(diagnostics);
    let effects = desk.worker(protocol::Event::Failed { generation, failure });
    assert!(request(&effects).is_none(), "the scene broke meanwhile: the last good one is rendered");
    assert!(request(&show(&mut desk)).is_some(), "which is seen");
    desk.press('l');
    let generation = desk.state.request.generation;
    let failure = protocol::Failure::Work("no memory".to_owned());
    let effects = desk.worker(protocol::Event::Failed { generation, failure });
    assert!(request(&effects).is_some(), "the work failed: the step that waited goes");
    let mut desk = Desk::with(state(80, 1));
    desk.finish(RED);
    for _ in 0..3 {
        assert!(request(&desk.press('l')).is_some(), "there is no room for a picture");
    }
}

#[test]
fn the_arrows_scroll_the_errors_while_they_are_open() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.fail((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    let down = KeyPress::special(KeyCode::Down);
    assert!(desk.key(down).is_empty());
    assert!(desk.state.overlays.diagnostics.scroll > 0);
    desk.key(KeyPress::special(KeyCode::Esc));
    assert!(request(&desk.key(down)).is_some(), "closed, they move the camera");
}

#[test]
fn before_a_scene_is_read_there_is_no_camera_to_move() {
    let mut desk = Desk::new();
    assert!(desk.press('l').is_empty() && desk.press('>').is_empty() && desk.press(']').is_empty());
    assert!(desk.text().contains("has not been read yet"));
}

#[test]
fn exposure_starts_from_the_scene_s_own() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.state.request.exposure = Some(1.0);
    desk.press(']');
    show(&mut desk);
    let effects = desk.press(']');
    assert_eq!(request(&effects).and_then(|it| it.overrides.exposure), Some(1.5));
    assert!(desk.text().contains("0 exposure +1.5"), "{}", desk.text());
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
        let mut desk = Desk::new();
        desk.finish(RED);
        for _ in 0..400 {
            desk.press(key);
            show(&mut desk);
        }
        assert!(desk.text().contains(words), "{key}: {}", desk.text());
        let generation = desk.state.request.generation;
        assert!(
            desk.press(key).is_empty() && desk.state.request.generation == generation,
            "{key}: nothing is rendered"
        );
        let view = desk.state.request.viewpoint().expect("a camera");
        assert!((0.0039..4001.0).contains(&view.pose.distance()), "{key}: {view:?}");
    }
}

#[test]
fn what_is_back_where_the_scene_has_it_is_no_change() {
    for keys in ["[]", "][", "<>", "><", "+-", "-+", "lh", "]]]]["] {
        let mut desk = Desk::new();
        desk.finish(RED);
        let mut last = None;
        for key in keys.chars() {
            let effects = desk.press(key);
            last = request(&effects).cloned();
            show(&mut desk);
        }
        let last = last.expect("a request");
        let is_back = keys != "]]]][";
        assert_eq!(last.overrides == Overrides::default(), is_back, "{keys}: {:?}", last.overrides);
        assert_eq!(last.write, Writing::Try, "{keys}");
        let line = desk.text().lines().last().map(str::to_owned).unwrap_or_default();
        assert_eq!(!line.contains("0 "), is_back, "{keys}: {line}");
        assert!(!desk.text().contains("camera moved"), "{keys}: {}", desk.text());
    }
}

#[test]
fn the_call_s_own_exposure_is_no_change_either() {
    let base = Overrides { exposure: Some(1.0), ..Overrides::default() };
    let mut desk = Desk::with(state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base));
    desk.finish(RED);
    desk.press('[');
    show(&mut desk);
    desk.press(']');
    assert_eq!(
        (desk.state.request.toggles.exposure, desk.state.request.overrides().exposure),
        (None, Some(1.0))
    );
}

#[test]
fn the_scene_of_a_model_is_written_once_and_its_camera_is_kept() {
    use crate::pipeline::protocol::{Event as WorkerEvent, Kept};
    let mut desk = Desk::new();
    desk.state.request.scene = "assets/vase.obj".into();
    desk.finish([200, 30, 30]);
    desk.press('l');
    desk.finish([30, 30, 200]);
    desk.key(KeyPress::special(KeyCode::Esc));
    assert!(desk.text().contains("c keep") && !desk.text().contains("o edit"), "{}", desk.text());
    let kept =
        Kept { path: "assets/vase.toml".into(), is_new: true, is_own: false, of_model: true, edit: None };
    let generation = desk.state.request.generation;
    desk.worker(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
    desk.key(KeyPress::special(KeyCode::Esc));
    assert!(!desk.text().contains("c keep"), "there is a scene already: {}", desk.text());
    assert!(!crate::tui::exit_summary::words(&desk.state).contains("discarded"));
    desk.press('l');
    desk.finish([200, 30, 30]);
    assert!(crate::tui::exit_summary::words(&desk.state).contains("discarded"), "it was moved since");
}
