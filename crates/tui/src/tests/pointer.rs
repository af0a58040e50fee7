//! Tests of the mouse: its requests, and the words for the answers; and the editor's places.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::Changed;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress, Mouse, MouseKind};
use crate::fixtures::*;
use crate::pipeline::protocol::{self, CameraEdit, Command, Kept, Picked, Section, Spot, Thing, Writing};
use crate::pipeline::settings::Overrides;
use crate::preview_kind::PreviewKind;
use crate::scene::diagnostic::Severity;
use crate::terminals::{Brand, TerminalId};

/// 80×24, with a picture in 55×21 cells from (0, 1) on.
fn ui() -> TestUi {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui
}

fn mouse(ui: &mut TestUi, kind: MouseKind, column: u16, row: u16) -> Vec<Effect> {
    ui.event(Event::Mouse(Mouse { kind, column, row }))
}

fn click(ui: &mut TestUi, column: u16, row: u16) -> Vec<Effect> {
    mouse(ui, MouseKind::Press, column, row);
    mouse(ui, MouseKind::Release, column, row)
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

fn answer(ui: &mut TestUi, thing: Option<Thing>) -> Vec<Effect> {
    let picked = Box::new(Picked { pixel: [1, 2], thing, color: Some([0.5; 3]) });
    ui.worker(protocol::Event::Picked { generation: 0, picked })
}

#[test]
fn a_drag_turns_and_a_click_asks() {
    let mut ui = ui();
    mouse(&mut ui, MouseKind::Press, 20, 10);
    let effects = mouse(&mut ui, MouseKind::Drag, 30, 10);
    let pose = request(&effects).expect("a request").overrides.camera.pose.expect("a pose");
    assert!(pose.position.x < -1.0, "the scene goes with the hand: {pose:?}");
    assert!(mouse(&mut ui, MouseKind::Release, 30, 10).is_empty(), "that was no click");
    let spot = asked(&click(&mut ui, 12, 10));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9 && (spot.y - 9.5 / 21.0).abs() < 1e-9, "{spot:?}");
    for (column, row) in [(70, 10), (20, 0), (20, 23)] {
        assert!(click(&mut ui, column, row).is_empty(), "there is no picture");
    }
    assert!(mouse(&mut ui, MouseKind::Drag, 30, 10).is_empty(), "what began elsewhere");
}

#[test]
fn the_wheel_goes_nearer_and_scrolls_the_errors() {
    let mut ui = ui();
    let effects = mouse(&mut ui, MouseKind::WheelUp, 20, 10);
    assert!(request(&effects).expect("a request").overrides.camera.pose.expect("a pose").distance() < 4.0);
    ui.fail((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    assert!(mouse(&mut ui, MouseKind::WheelDown, 20, 15).is_empty());
    assert!(ui.state.overlays.diagnostics.scroll > 0);
    mouse(&mut ui, MouseKind::WheelUp, 20, 15);
    assert_eq!(ui.state.overlays.diagnostics.scroll, 0);
}

#[test]
fn what_was_clicked_is_said_and_led_to() {
    let mut ui = ui();
    click(&mut ui, 12, 10);
    assert!(answer(&mut ui, Some(thing())).is_empty());
    let text = ui.text();
    for words in ["sphere \"ball\"", "cornell.toml:47", "glass crystal", "3.9 away", "at (0.2, 0.5, -0.3)"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    // The mark is where the click was.
    assert_eq!(ui.screen()[(12, 10)].symbol(), "┼");
    let place = |effects: &[Effect]| match effects {
        [Effect::Edit(place)] => (place.path.to_string_lossy().into_owned(), place.line, place.column),
        other => panic!("{other:?}"),
    };
    assert_eq!(place(&ui.press('o')), ("scenes/cornell.toml".to_owned(), 47, 1));
    ui.fail(vec![diagnostic(Severity::Error, "wrong")]);
    assert_eq!(place(&ui.press('o')), ("scenes/cornell.toml".to_owned(), 3, 1), "the error comes first");
    let mut fresh = self::ui();
    assert_eq!(place(&fresh.press('o')).1, 1, "else the scene");
    fresh.event(Event::NoEditor("there is no editor `x`".to_owned()));
    assert!(fresh.text().contains("there is no editor `x`"));
}

#[test]
fn a_click_after_f_focuses_there() {
    let mut ui = ui();
    assert!(ui.press('f').is_empty());
    assert!(ui.text().contains("click where to focus"), "{}", ui.text());
    click(&mut ui, 12, 10);
    let effects = answer(&mut ui, Some(thing()));
    let focused = request(&effects).expect("a request");
    assert_eq!((focused.overrides.camera.focus, focused.write), (Some(3.8167), Writing::No));
    assert!(ui.text().contains("focus at 3.8167 (preview only)"), "{}", ui.text());
    // Another key ends the waiting for a click.
    ui.press('f');
    ui.press('e');
    click(&mut ui, 12, 10);
    assert!(answer(&mut ui, Some(thing())).is_empty());
    // Without the mouse, the crosshair at once.
    ui.press('m');
    let spot = asked(&ui.press('f'));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9, "the last click: {spot:?}");
    assert!(answer(&mut ui, None).is_empty());
    assert!(ui.text().contains("nothing to focus on"));
    ui.state.request.camera.as_mut().expect("a camera").aperture = 0.0;
    ui.press('f');
    assert!(answer(&mut ui, Some(thing())).is_empty());
    assert!(ui.text().contains("the camera's `aperture` is 0"));
}

fn kept(ui: &mut TestUi, is_new: bool, is_own: bool) -> Vec<Effect> {
    let outcome =
        Ok(Kept { path: "scenes/cornell.toml".into(), is_new, is_own, of_model: false, edit: None });
    ui.worker(protocol::Event::CameraKept { generation: 0, outcome })
}

#[test]
fn a_camera_in_the_file_is_the_scene_s_own() {
    let mut ui = ui();
    ui.press('l');
    ui.press('c');
    let effects = kept(&mut ui, true, true);
    let own = request(&effects).expect("a request");
    assert_eq!((own.overrides.camera.is_any(), own.write), (false, Writing::Try));
    let text = ui.text();
    assert!(text.contains("camera saved to scenes/cornell.toml") && !text.contains("camera moved"), "{text}");
    // The watcher hears of that, too.
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    assert!(ui.text().contains("camera saved to scenes/cornell.toml"), "{}", ui.text());
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    assert!(!ui.text().contains("camera saved to"), "{}", ui.text());

    ui.press('l');
    ui.press('c');
    let outcome = Err("the scene file has changed since it was read".to_owned());
    assert!(ui.worker(protocol::Event::CameraKept { generation: 0, outcome }).is_empty());
    let text = ui.text();
    assert!(text.contains("error: the scene file has changed") && text.contains("0 reset camera"), "{text}");
    // The watcher hears of that save a little later.
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    assert!(ui.text().contains("error: the scene file has changed"), "{}", ui.text());
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    assert!(!ui.text().contains("error: the scene file has changed"), "{}", ui.text());
}

#[test]
fn u_asks_for_what_c_wrote_until_there_is_nothing_left() {
    let mut ui = ui();
    assert!(ui.press('u').is_empty());
    assert!(ui.text().contains("nothing to undo"), "{}", ui.text());
    let edit = |after: &str| CameraEdit { path: "a.toml".into(), before: "".into(), after: after.into() };
    for after in ["one", "two"] {
        let kept = Kept {
            path: "a.toml".into(),
            is_new: true,
            is_own: true,
            of_model: false,
            edit: Some(edit(after)),
        };
        ui.worker(protocol::Event::CameraKept { generation: 0, outcome: Ok(kept) });
    }
    let undone = |ui: &mut TestUi, outcome: Result<std::path::PathBuf, String>| {
        ui.worker(protocol::Event::CameraUndone { generation: 0, outcome })
    };
    let asks = |ui: &mut TestUi, after| matches!(&ui.press('u')[..], [Effect::Send(Command::UndoCamera(asked))] if *asked == edit(after));
    assert!(asks(&mut ui, "two"));
    assert!(undone(&mut ui, Err("a.toml has changed".to_owned())).is_empty());
    assert!(ui.text().contains("error: a.toml has changed"), "{}", ui.text());
    assert!(asks(&mut ui, "two"), "it can be tried again");
    assert!(request(&undone(&mut ui, Ok("a.toml".into()))).is_some(), "the picture is that of the file");
    assert!(ui.text().contains("a.toml restored"), "{}", ui.text());
    assert!(asks(&mut ui, "one"));
    undone(&mut ui, Ok("a.toml".into()));
    assert!(ui.press('u').is_empty());
}

#[test]
fn y_copies_what_was_clicked_where_the_terminal_takes_it() {
    let mut ui = ui();
    assert!(ui.press('y').is_empty());
    assert!(ui.text().contains("nothing was clicked yet"), "{}", ui.text());
    click(&mut ui, 12, 10);
    answer(&mut ui, Some(thing()));
    assert!(ui.press('y').is_empty());
    let text: String = ui.text().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        text.contains("to copy, drag with shift (or after m): sphere \"ball\" · cornell.toml:47"),
        "{text}"
    );
    assert!(text.contains("normal (0, 1, 0) · pixel 1, 2"), "{text}");
    ui.state.display.capabilities = TerminalId { brand: Brand::Kitty, version: [0, 40] }.capabilities();
    let effects = ui.press('y');
    let words = "sphere \"ball\" · cornell.toml:47 · glass crystal · 3.9 away · at (0.2, 0.5, -0.3) · \
                 radiance (0.5, 0.5, 0.5) · normal (0, 1, 0) · pixel 1, 2";
    assert!(matches!(&effects[..], [Effect::Aside(bytes)] if *bytes == crate::window_title::copy(words)));
    // What was clicked stays for a copy, whatever keys come between.
    ui.press('s');
    assert!(matches!(ui.press('y')[..], [Effect::Aside(_)]));
}

#[test]
fn a_camera_of_the_call_stays_before_the_file() {
    let sets = vec!["camera.fov=30".to_owned()];
    let base = Overrides { sets, ..Overrides::default() };
    let mut ui = TestUi::with(state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base));
    ui.finish(RED);
    assert!(matches!(ui.press('c')[..], [Effect::Send(Command::KeepCamera(_))]), "it may be kept unmoved");
    ui.press('>');
    ui.press('c');
    assert!(kept(&mut ui, true, false).is_empty());
    let text = ui.text();
    assert!(text.contains("in this call --set comes first") && text.contains("0 reset camera"), "{text}");
}

#[test]
fn older_pictures_wait_for_no_newer_one_and_a_render_ends_them() {
    let mut ui = ui();
    assert!(ui.press('b').is_empty());
    assert!(ui.text().contains("no picture from before an edit"));
    ui.press('N');
    assert!(ui.text().contains("this is the newest picture"), "{}", ui.text());
    ui.press('n');
    assert!(ui.text().contains("this is the oldest picture"), "{}", ui.text());
    ui.press('s');
    ui.finish(BLUE);
    ui.wait(61_000);
    ui.press('n');
    assert!(ui.text().contains("picture 1 of 2, 61 s ago"), "{}", ui.text());
    let generation = ui.state.request.generation;
    ui.event(Event::Picture {
        generation,
        picture: plain_picture(50, 38, [10, 200, 10]),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    assert!(super::cells_of(&mut ui, RED) > 0, "the older one stays");
    ui.press('N');
    assert!(
        !ui.state.picture.history.is_open() && ui.text().contains("this is the newest picture"),
        "{}",
        ui.text()
    );
    assert!(super::cells_of(&mut ui, BLUE) + super::cells_of(&mut ui, [10, 200, 10]) > 0);
    ui.press('n');
    ui.press('s');
    assert!(super::cells_of(&mut ui, RED) == 0, "a render goes on from the newest");
}

#[test]
fn what_was_clicked_is_told_in_full_in_a_small_window() {
    for (columns, rows) in [(40, 12), (30, 8), (80, 5)] {
        let mut ui = TestUi::with(state(columns, rows));
        ui.finish(RED);
        ui.key(crate::event::KeyPress::special(crossterm::event::KeyCode::Enter));
        answer(&mut ui, Some(thing()));
        let text = ui.text().replace('\n', " ");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in ["cornell.toml:47", "glass", "3.9 away", "radiance (0.5, 0.5, 0.5)", "normal (0, 1, 0)"]
        {
            assert!(words.split(' ').all(|word| text.contains(word)), "{words}: {}", ui.text());
        }
        ui.press('y');
        ui.press('?');
        ui.press('?');
        assert!(!ui.text().contains("crystal"), "until the next key: {}", ui.text());
    }
}

#[test]
fn y_says_how_to_copy_in_small_windows_too() {
    for (columns, rows) in [(80, 24), (30, 8), (20, 6), (40, 12)] {
        let mut ui = TestUi::with(state(columns, rows));
        ui.finish(RED);
        ui.key(crate::event::KeyPress::special(crossterm::event::KeyCode::Enter));
        answer(&mut ui, Some(thing()));
        ui.press('y');
        let text = ui.text();
        assert!(text.lines().next().is_some_and(|line| line.contains("✓ done")), "the state stays: {text}");
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains("to copy, drag with shift (or after m): sphere \"ball\""), "{text}");
    }
}

#[test]
fn a_drag_after_z_marks_what_is_rendered_first() {
    let mut ui = ui();
    ui.press('r');
    ui.press('z');
    assert!(ui.text().contains("drag a rectangle"), "{}", ui.text());
    mouse(&mut ui, MouseKind::Press, 10, 5);
    assert!(mouse(&mut ui, MouseKind::Drag, 30, 12).is_empty(), "the camera stays");
    assert_eq!(ui.screen()[(10, 5)].symbol(), "┌");
    assert_eq!(ui.screen()[(30, 12)].symbol(), "┘");
    let effects = mouse(&mut ui, MouseKind::Release, 30, 12);
    let marked = request(&effects).expect("a request");
    let section = marked.first.expect("a rectangle");
    assert!((section.left - 10.5 / 55.0).abs() < 1e-9 && (section.width - 20.0 / 55.0).abs() < 1e-9);
    assert!(!marked.overrides.camera.is_any());
    // Each render has it, until z again.
    assert_eq!(request(&ui.press('s')).expect("a request").first, Some(section));
    assert_eq!(request(&ui.press('z')).expect("a request").first, None);
    ui.finish(BLUE);
    ui.press('z');
    mouse(&mut ui, MouseKind::Press, 30, 12);
    assert!(mouse(&mut ui, MouseKind::Release, 30, 12).is_empty(), "nothing is rendering");
    assert!(ui.text().contains("from the next render on"), "{}", ui.text());
    assert!(request(&ui.press('r')).expect("a request").first.is_some());
}

#[test]
fn a_close_up_is_drawn_pixel_by_pixel_and_clicks_know_where_they_are() {
    let mut ui = ui();
    let spot = asked(&click(&mut ui, 12, 10));
    ui.press('x');
    let around = ui.state.request.preview_size.expect("a size").around;
    assert_eq!(around, Some(spot));
    // 20 × 10 pixels of the picture, fewer than there is room for.
    let section = Some(Section { left: 0.2, top: 0.4, width: 0.1, height: 0.2 });
    let generation = ui.state.request.generation;
    let picture = plain_picture(20, 10, BLUE);
    ui.event(Event::Picture {
        generation,
        picture,
        range: None,
        section,
        lacks_photons: false,
        source: None,
    });
    assert_eq!(super::cells_of(&mut ui, BLUE), 20 * 5, "{}", ui.text());
    assert!(ui.text().contains("cornell.toml  1:1"), "{}", ui.text());
    // The area has 56 × 21 cells from (0, 1) on: the picture begins at (18, 9).
    let spot = asked(&click(&mut ui, 18, 9));
    assert!((spot.x - (0.2 + 0.1 * 0.5 / 20.0)).abs() < 1e-9, "{spot:?}");
    assert!((spot.y - (0.4 + 0.2 * 0.5 / 5.0)).abs() < 1e-9, "{spot:?}");
}

#[test]
fn an_older_picture_is_said_to_be_older_in_the_first_line() {
    let mut ui = ui();
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.finish(BLUE);
    ui.press('b');
    let first = |ui: &mut TestUi| ui.text().lines().next().map(str::to_owned).unwrap_or_default();
    assert!(first(&mut ui).contains("◂ older") && first(&mut ui).contains("picture 1 of 2"));
    // A key that means nothing takes the message away.
    ui.press('y');
    let text = ui.text();
    assert!(text.contains("b newest") && text.contains("N newer"), "the ways on: {text}");
    assert!(!text.contains("samples") && !text.contains("render 1"), "that is of the newest one: {text}");
    ui.event(Event::Resize(window(30, 8)));
    assert!(first(&mut ui).contains("1 of 2"), "{}", ui.text());
    ui.event(Event::Resize(window(80, 24)));
    ui.press('b');
    assert!(first(&mut ui).contains("✓ done") && ui.text().contains("samples"), "{}", ui.text());
}

#[test]
fn before_and_after_a_camera_that_was_kept_differ() {
    let mut ui = ui();
    ui.press('l');
    ui.finish(BLUE);
    ui.press('c');
    kept(&mut ui, true, true);
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.finish(BLUE);
    ui.press('b');
    assert!(super::cells_of(&mut ui, RED) > 0, "the camera from before: {}", ui.text());
}

#[test]
fn escape_ends_what_waits_what_was_said_and_older_pictures() {
    let mut ui = ui();
    let escape = |ui: &mut TestUi| ui.event(Event::Key(KeyPress::special(KeyCode::Esc)));
    for (key, waits) in [('z', "drag a rectangle"), ('f', "click")] {
        ui.press(key);
        assert!(ui.text().contains(waits), "{}", ui.text());
        escape(&mut ui);
        assert!(!ui.state.selection.is_marking && !ui.state.selection.is_focusing);
        assert!(!ui.text().contains(waits), "{}", ui.text());
    }
    ui.state.selection.facts = Some(vec!["sphere".to_owned()]);
    escape(&mut ui);
    assert_eq!(ui.state.selection.facts, None);
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.finish(BLUE);
    ui.press('b');
    assert!(ui.state.picture.history.is_open());
    escape(&mut ui);
    assert!(!ui.state.picture.history.is_open() && ui.text().contains("the newest picture"), "{}", ui.text());
}

#[test]
fn a_drag_of_a_rectangle_that_is_left_is_none() {
    for key in [KeyCode::Esc, KeyCode::Char('v'), KeyCode::Char('z')] {
        let mut ui = ui();
        ui.press('z');
        mouse(&mut ui, MouseKind::Press, 12, 10);
        mouse(&mut ui, MouseKind::Drag, 20, 14);
        assert!(ui.state.request.first_section.is_some());
        ui.key(KeyPress::special(key));
        assert!(ui.state.request.first_section.is_none() && !ui.state.selection.is_marking, "{key:?}");
        assert!(mouse(&mut ui, MouseKind::Drag, 30, 16).is_empty(), "{key:?}: it turns nothing");
        assert!(mouse(&mut ui, MouseKind::Release, 30, 16).is_empty(), "{key:?}: it is no click");
    }
}

#[test]
fn a_digit_without_the_list_says_where_the_list_is() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui.press('3');
    assert!(ui.text().contains("v lists the views"), "{}", ui.text());
}

#[test]
fn without_an_aperture_f_refuses_at_once() {
    let mut ui = ui();
    ui.state.request.camera.as_mut().expect("a camera").aperture = 0.0;
    assert!(ui.press('f').is_empty());
    assert!(ui.text().contains("the camera's `aperture` is 0"), "{}", ui.text());
    assert!(!ui.state.selection.is_focusing, "the next click is no focus");
}

#[test]
fn an_exposure_is_no_picture_of_its_own_in_the_history() {
    let mut ui = ui();
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.finish(BLUE);
    for color in [[1, 2, 3], [4, 5, 6], [7, 8, 9]] {
        ui.press(']');
        ui.finish(color);
    }
    assert_eq!(ui.state.work.renders, 2, "nor is it a run");
    ui.press('n');
    assert!(ui.text().contains("picture 1 of 2"), "{}", ui.text());
    ui.press('N');
    // A toggle is one.
    ui.press('s');
    ui.finish(BLUE);
    ui.press('n');
    assert!(ui.text().contains("picture 2 of 3"), "{}", ui.text());
}

#[test]
fn an_older_picture_says_what_its_edit_changed() {
    use crate::pipeline::protocol;
    let mut ui = TestUi::with(state(120, 40));
    for (color, text) in [(RED, "r = 1\nfov = 40"), (BLUE, "r = 2\nfov = 40"), (RED, "r = 2\nfov = 30")] {
        ui.event(Event::Changed(Changed { noticed: ui.now }));
        let generation = ui.state.request.generation;
        ui.worker(protocol::Event::Text { generation, text: text.into() });
        ui.finish(color);
    }
    ui.press('n');
    assert!(
        ui.text().contains("picture 2 of 3, 0 s ago")
            && ui.text().contains("\nafter r 1 → 2 · n older · N newer"),
        "{}",
        ui.text()
    );
    ui.press('n');
    assert!(ui.text().contains("\nthe first picture · N newer"), "it is of no edit: {}", ui.text());
    ui.press('b');
    ui.press('b');
    assert!(ui.text().contains("\nbefore the last edit, fov 40 → 30  "), "{}", ui.text());
}
