//! The mouse, what it asks for, what is said of the answers; and the editor's places.

use super::{BLUE, RED};
use crate::pipeline::protocol::{self, Command, Kept, Picked, Spot, Thing, Writing};
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Severity;
use crate::tui::Changed;
use crate::tui::color::ColorDepth;
use crate::tui::event::{Effect, Event, Mouse, MouseKind};
use crate::tui::fixtures::*;
use crate::tui::state::PreviewKind;

/// 80×24, with a picture in 55×21 cells from (0, 1) on.
fn desk() -> Desk {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk
}

fn mouse(desk: &mut Desk, kind: MouseKind, column: u16, row: u16) -> Vec<Effect> {
    desk.event(Event::Mouse(Mouse { kind, column, row }))
}

fn click(desk: &mut Desk, column: u16, row: u16) -> Vec<Effect> {
    mouse(desk, MouseKind::Press, column, row);
    mouse(desk, MouseKind::Release, column, row)
}

fn asked(effects: &[Effect]) -> Spot {
    match effects {
        [Effect::Send(Command::Pick(spot))] => *spot,
        other => panic!("{other:?}"),
    }
}

fn thing() -> Thing {
    Thing {
        shape: "sphere",
        name: Some("ball".to_owned()),
        path: "scenes/cornell.toml".into(),
        line: 47,
        material: "glass crystal".to_owned(),
        position: [0.2, 0.5, -0.3],
        normal: [0.0, 1.0, 0.0],
        is_front: true,
        distance: 3.9,
        depth: 3.816_66,
    }
}

fn answer(desk: &mut Desk, thing: Option<Thing>) -> Vec<Effect> {
    let picked = Box::new(Picked { pixel: [1, 2], thing, color: Some([0.5; 3]) });
    desk.worker(protocol::Event::Picked { generation: 0, picked })
}

#[test]
fn a_drag_turns_and_a_click_asks() {
    let mut desk = desk();
    mouse(&mut desk, MouseKind::Press, 20, 10);
    let effects = mouse(&mut desk, MouseKind::Drag, 30, 10);
    let pose = request(&effects).expect("a request").overrides.camera.pose.expect("a pose");
    assert!(pose.position.x < -1.0, "the scene goes with the hand: {pose:?}");
    assert!(mouse(&mut desk, MouseKind::Release, 30, 10).is_empty(), "that was no click");
    let spot = asked(&click(&mut desk, 12, 10));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9 && (spot.y - 9.5 / 21.0).abs() < 1e-9, "{spot:?}");
    for (column, row) in [(70, 10), (20, 0), (20, 23)] {
        assert!(click(&mut desk, column, row).is_empty(), "there is no picture");
    }
    assert!(mouse(&mut desk, MouseKind::Drag, 30, 10).is_empty(), "what began elsewhere");
}

#[test]
fn the_wheel_goes_nearer_and_scrolls_the_errors() {
    let mut desk = desk();
    let effects = mouse(&mut desk, MouseKind::WheelUp, 20, 10);
    assert!(request(&effects).expect("a request").overrides.camera.pose.expect("a pose").distance() < 4.0);
    desk.fail((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    assert!(mouse(&mut desk, MouseKind::WheelDown, 20, 15).is_empty());
    assert!(desk.state.pane.scroll > 0);
    mouse(&mut desk, MouseKind::WheelUp, 20, 15);
    assert_eq!(desk.state.pane.scroll, 0);
}

#[test]
fn what_was_clicked_is_said_and_led_to() {
    let mut desk = desk();
    click(&mut desk, 12, 10);
    assert!(answer(&mut desk, Some(thing())).is_empty());
    let text = desk.text();
    assert!(text.contains("sphere \"ball\" · cornell.toml:47 · glass crystal · 3.9 away · (0.2"), "{text}");
    let place = |effects: &[Effect]| match effects {
        [Effect::Edit(place)] => (place.path.to_string_lossy().into_owned(), place.line, place.column),
        other => panic!("{other:?}"),
    };
    assert_eq!(place(&desk.press('o')), ("scenes/cornell.toml".to_owned(), 47, 1));
    desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
    assert_eq!(place(&desk.press('o')), ("scenes/cornell.toml".to_owned(), 3, 1), "the error comes first");
    let mut fresh = self::desk();
    assert_eq!(place(&fresh.press('o')).1, 1, "else the scene");
    fresh.event(Event::NoEditor("there is no editor `x`".to_owned()));
    assert!(fresh.text().contains("there is no editor `x`"));
}

#[test]
fn a_click_after_f_focuses_there() {
    let mut desk = desk();
    assert!(desk.press('f').is_empty());
    assert!(desk.text().contains("click where to focus"), "{}", desk.text());
    click(&mut desk, 12, 10);
    let effects = answer(&mut desk, Some(thing()));
    let focused = request(&effects).expect("a request");
    assert_eq!((focused.overrides.camera.focus, focused.write), (Some(3.8167), Writing::No));
    assert!(desk.text().contains("focus 3.8167 away"), "{}", desk.text());
    // Another key ends the waiting for a click.
    desk.press('f');
    desk.press('e');
    click(&mut desk, 12, 10);
    assert!(answer(&mut desk, Some(thing())).is_empty());
    // Without the mouse, the crosshair at once.
    desk.press('m');
    let spot = asked(&desk.press('f'));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9, "the last click: {spot:?}");
    assert!(answer(&mut desk, None).is_empty());
    assert!(desk.text().contains("nothing to focus on"));
    desk.state.camera.as_mut().expect("a camera").aperture = 0.0;
    desk.press('f');
    assert!(answer(&mut desk, Some(thing())).is_empty());
    assert!(desk.text().contains("no `aperture`"));
}

fn kept(desk: &mut Desk, is_new: bool, is_own: bool) -> Vec<Effect> {
    let outcome = Ok(Kept { path: "scenes/cornell.toml".into(), is_new, is_own });
    desk.worker(protocol::Event::CameraKept { generation: 0, outcome })
}

#[test]
fn a_camera_in_the_file_is_the_scene_s_own() {
    let mut desk = desk();
    desk.press('l');
    desk.press('c');
    let effects = kept(&mut desk, true, true);
    let own = request(&effects).expect("a request");
    assert_eq!((own.overrides.camera.is_any(), own.write), (false, Writing::Try));
    let text = desk.text();
    assert!(
        text.contains("the camera is in scenes/cornell.toml now") && !text.contains("camera moved"),
        "{text}"
    );
    // The watcher hears of that, too.
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(desk.text().contains("the camera is in scenes/cornell.toml now"), "{}", desk.text());
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(!desk.text().contains("the camera is in"), "{}", desk.text());

    desk.press('l');
    desk.press('c');
    let outcome = Err("the scene file has changed since it was read".to_owned());
    assert!(desk.worker(protocol::Event::CameraKept { generation: 0, outcome }).is_empty());
    let text = desk.text();
    assert!(text.contains("error: the scene file has changed") && text.contains("camera moved"), "{text}");
}

#[test]
fn a_camera_of_the_call_stays_before_the_file() {
    let sets = vec!["camera.fov=30".to_owned()];
    let base = Overrides { sets, ..Overrides::default() };
    let mut desk = Desk::with(state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base));
    desk.finish(RED);
    assert!(matches!(desk.press('c')[..], [Effect::Send(Command::KeepCamera(_))]), "it may be kept unmoved");
    desk.press('>');
    desk.press('c');
    assert!(kept(&mut desk, true, false).is_empty());
    let text = desk.text();
    assert!(text.contains("in this call --set comes first") && text.contains("camera moved"), "{text}");
}

#[test]
fn older_pictures_wait_for_no_newer_one_and_a_render_ends_them() {
    let mut desk = desk();
    assert!(desk.press('b').is_empty());
    assert!(desk.text().contains("no picture from before an edit"));
    desk.press('N');
    assert!(desk.text().contains("this is the newest picture"), "{}", desk.text());
    desk.press('n');
    assert!(desk.text().contains("this is the oldest picture"), "{}", desk.text());
    desk.press('s');
    desk.finish(BLUE);
    desk.wait(61_000);
    desk.press('n');
    assert!(desk.text().contains("picture 1 of 2, 61 s ago"), "{}", desk.text());
    let generation = desk.state.generation;
    desk.event(Event::Picture { generation, picture: plain_picture(50, 38, [10, 200, 10]), range: None });
    assert!(super::cells_of(&mut desk, RED) > 0, "the older one stays");
    desk.press('N');
    assert!(super::cells_of(&mut desk, BLUE) + super::cells_of(&mut desk, [10, 200, 10]) > 0);
    desk.press('n');
    desk.press('s');
    assert!(super::cells_of(&mut desk, RED) == 0, "a render goes on from the newest");
}
