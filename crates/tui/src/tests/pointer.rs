//! Tests for the mouse: requests, inspected values, and positions opened in the editor.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::ContentChangeTime;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress, MouseEvent, MouseEventKind};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{
    self, CameraSaveResult, Command, NormalizedPosition, NormalizedRect, PickedObject, PickedPixel,
    PreviewUpdate, SavedCameraEdit, WriteRequirement,
};
use crate::pipeline::settings::Overrides;
use crate::preview_style::PreviewStyle;
use crate::scene::diagnostic::Severity;
use crate::terminals::{TerminalBrand, TerminalId};

/// An 80×24 UI with an image in 55×21 cells at (0, 1).
fn ui() -> TestUi {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui
}

fn mouse(ui: &mut TestUi, kind: MouseEventKind, column: u16, row: u16) -> Vec<Effect> {
    ui.handle_event(Event::Mouse(MouseEvent { kind, column, row }))
}

fn click(ui: &mut TestUi, column: u16, row: u16) -> Vec<Effect> {
    mouse(ui, MouseEventKind::Press, column, row);
    mouse(ui, MouseEventKind::Release, column, row)
}

fn queried_position(effects: &[Effect]) -> NormalizedPosition {
    match effects {
        [Effect::Send(Command::Pick(spot))] => *spot,
        other => panic!("{other:?}"),
    }
}

fn picked_object() -> PickedObject {
    PickedObject {
        shape: "sphere",
        name: Some("ball".to_owned()),
        path: "scenes/cornell.toml".into(),
        line: Some(47),
        instance: None,
        material: "glass crystal".to_owned(),
        position: [0.2, 0.5, -0.3],
        normal: [0.0, 1.0, 0.0],
        is_front: true,
        distance: 3.9,
        depth: 3.816_66,
    }
}

fn answer(ui: &mut TestUi, object: Option<PickedObject>) -> Vec<Effect> {
    let picked = Box::new(PickedPixel { pixel: [1, 2], object, color: Some([0.5; 3]) });
    ui.worker_event(protocol::Event::Picked { generation: 0, picked })
}

#[test]
fn drag_orbits_and_click_inspects() {
    let mut ui = ui();
    mouse(&mut ui, MouseEventKind::Press, 20, 10);
    let effects = mouse(&mut ui, MouseEventKind::Drag, 30, 10);
    let pose = sent_render_request(&effects).expect("a request").overrides.camera.pose.expect("a pose");
    assert!(pose.position.x < -1.0, "the scene should follow the mouse: {pose:?}");
    assert!(
        mouse(&mut ui, MouseEventKind::Release, 30, 10).is_empty(),
        "a drag should not be treated as a click"
    );
    let spot = queried_position(&click(&mut ui, 12, 10));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9 && (spot.y - 9.5 / 21.0).abs() < 1e-9, "{spot:?}");
    for (column, row) in [(70, 10), (20, 0), (20, 23)] {
        assert!(click(&mut ui, column, row).is_empty(), "clicks outside the image should be ignored");
    }
    assert!(
        mouse(&mut ui, MouseEventKind::Drag, 30, 10).is_empty(),
        "a drag that started outside the image should be ignored"
    );
}

#[test]
fn wheel_zooms_and_scrolls_diagnostics() {
    let mut ui = ui();
    let effects = mouse(&mut ui, MouseEventKind::WheelUp, 20, 10);
    assert!(
        sent_render_request(&effects).expect("a request").overrides.camera.pose.expect("a pose").distance()
            < 4.0
    );
    ui.report_scene_errors((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong {i}"))).collect());
    assert!(mouse(&mut ui, MouseEventKind::WheelDown, 20, 15).is_empty());
    assert!(ui.state.overlays.diagnostics.scroll > 0);
    mouse(&mut ui, MouseEventKind::WheelUp, 20, 15);
    assert_eq!(ui.state.overlays.diagnostics.scroll, 0);
}

#[test]
fn clicked_object_is_shown_and_can_be_edited() {
    let mut ui = ui();
    click(&mut ui, 12, 10);
    assert!(answer(&mut ui, Some(picked_object())).is_empty());
    let text = ui.screen_words();
    for words in
        ["sphere \"ball\"", "cornell.toml:47", "glass crystal", "distance 3.9", "position (0.2, 0.5, -0.3)"]
    {
        assert!(text.contains(words), "{words}: {text}");
    }
    // The mark is at the clicked cell.
    assert_eq!(ui.draw_screen()[(12, 10)].symbol(), "┼");
    let place = |effects: &[Effect]| match effects {
        [Effect::Edit(place)] => (place.path.to_string_lossy().into_owned(), place.line, place.column),
        other => panic!("{other:?}"),
    };
    assert_eq!(place(&ui.press_character('o')), ("scenes/cornell.toml".to_owned(), 47, 1));
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
    assert_eq!(
        place(&ui.press_character('o')),
        ("scenes/cornell.toml".to_owned(), 3, 1),
        "errors take precedence"
    );
    let mut fresh = self::ui();
    assert_eq!(place(&fresh.press_character('o')).1, 1, "without errors, the scene file should be opened");
    fresh.handle_event(Event::EditorFailed("no editor `x`".to_owned()));
    assert!(fresh.screen_text().contains("no editor `x`"));
}

#[test]
fn click_after_f_sets_the_focus() {
    let mut ui = ui();
    assert!(ui.press_character('f').is_empty());
    assert!(ui.screen_text().contains(messages::CLICK_TO_FOCUS), "{}", ui.screen_text());
    click(&mut ui, 12, 10);
    let effects = answer(&mut ui, Some(picked_object()));
    let focused = sent_render_request(&effects).expect("a request");
    assert_eq!((focused.overrides.camera.focus, focused.write), (Some(3.8167), WriteRequirement::No));
    assert!(ui.screen_text().contains(&messages::focus_moved(3.8167)[..40]), "{}", ui.screen_text());
    // Any other key cancels the pending click.
    ui.press_character('f');
    ui.press_character('e');
    click(&mut ui, 12, 10);
    assert!(answer(&mut ui, Some(picked_object())).is_empty());
    // If the mouse is off, `f` focuses at the crosshair immediately.
    ui.press_character('m');
    let spot = queried_position(&ui.press_character('f'));
    assert!((spot.x - 12.5 / 55.0).abs() < 1e-9, "expected the last click: {spot:?}");
    assert!(answer(&mut ui, None).is_empty());
    assert!(ui.screen_text().contains(messages::NOTHING_TO_FOCUS));
    ui.state.request.own.as_mut().expect("a scene").camera.aperture = 0.0;
    ui.press_character('f');
    assert!(answer(&mut ui, Some(picked_object())).is_empty());
    assert!(ui.screen_text().contains(messages::PINHOLE));
}

fn kept(ui: &mut TestUi, is_new: bool, is_own: bool) -> Vec<Effect> {
    let outcome = Ok(CameraSaveResult {
        path: "scenes/cornell.toml".into(),
        is_new,
        is_own,
        of_model: false,
        edit: None,
    });
    ui.worker_event(protocol::Event::CameraKept { generation: 0, outcome })
}

#[test]
fn saved_camera_becomes_the_scene_camera() {
    let mut ui = ui();
    ui.press_character('l');
    ui.press_character('c');
    let effects = kept(&mut ui, true, true);
    let own = sent_render_request(&effects).expect("a request");
    assert_eq!((own.overrides.camera.has_changes(), own.write), (false, WriteRequirement::Try));
    let text = ui.screen_text();
    assert!(
        text.contains(&messages::camera_saved("scenes/cornell.toml"))
            && !text.contains(messages::CAMERA_MOVED),
        "{text}"
    );
    // The watcher also reports this save.
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(
        ui.screen_text().contains(&messages::camera_saved("scenes/cornell.toml")),
        "{}",
        ui.screen_text()
    );
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(
        !ui.screen_text().contains(&messages::camera_saved("scenes/cornell.toml")),
        "{}",
        ui.screen_text()
    );

    ui.press_character('l');
    ui.press_character('c');
    let outcome = Err("outdated".to_owned());
    assert!(ui.worker_event(protocol::Event::CameraKept { generation: 0, outcome }).is_empty());
    let text = ui.screen_text();
    assert!(text.contains("error: outdated") && text.contains("reset camera"), "{text}");
    // The watcher reports this save slightly later.
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(ui.screen_text().contains("error: outdated"), "{}", ui.screen_text());
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(!ui.screen_text().contains("error: outdated"), "{}", ui.screen_text());
}

#[test]
fn undo_can_be_repeated_until_nothing_is_left() {
    let mut ui = ui();
    assert!(ui.press_character('u').is_empty());
    assert!(ui.screen_text().contains(messages::NOTHING_TO_UNDO), "{}", ui.screen_text());
    let edit =
        |after: &str| SavedCameraEdit { path: "a.toml".into(), before: "".into(), after: after.into() };
    for after in ["one", "two"] {
        let kept = CameraSaveResult {
            path: "a.toml".into(),
            is_new: true,
            is_own: true,
            of_model: false,
            edit: Some(edit(after)),
        };
        ui.worker_event(protocol::Event::CameraKept { generation: 0, outcome: Ok(kept) });
    }
    let undone = |ui: &mut TestUi, outcome: Result<std::path::PathBuf, String>| {
        ui.worker_event(protocol::Event::CameraUndone { generation: 0, outcome })
    };
    let asks = |ui: &mut TestUi, after| matches!(&ui.press_character('u')[..], [Effect::Send(Command::UndoCamera(asked))] if *asked == edit(after));
    assert!(asks(&mut ui, "two"));
    assert!(undone(&mut ui, Err("outdated".to_owned())).is_empty());
    assert!(ui.screen_text().contains("error: outdated"), "{}", ui.screen_text());
    assert!(asks(&mut ui, "two"), "a failed undo can be retried");
    assert!(
        sent_render_request(&undone(&mut ui, Ok("a.toml".into()))).is_some(),
        "the restored file should be rendered"
    );
    assert!(ui.screen_text().contains(&messages::camera_save_undone("a.toml")), "{}", ui.screen_text());
    assert!(asks(&mut ui, "one"));
    undone(&mut ui, Ok("a.toml".into()));
    assert!(ui.press_character('u').is_empty());
}

#[test]
fn y_copies_if_the_terminal_supports_it() {
    let mut ui = ui();
    assert!(ui.press_character('y').is_empty());
    assert!(ui.screen_text().contains(messages::NOTHING_TO_COPY), "{}", ui.screen_text());
    click(&mut ui, 12, 10);
    answer(&mut ui, Some(picked_object()));
    assert!(ui.press_character('y').is_empty());
    let text: String = ui.screen_text().split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains(&format!("{} sphere", messages::SELECT_TO_COPY)), "{text}");
    assert!(text.contains("normal (0, 1, 0) · pixel 1, 2"), "{text}");
    ui.state.display.capabilities =
        TerminalId { brand: TerminalBrand::Kitty, version: [0, 40] }.terminal_extras();
    let effects = ui.press_character('y');
    let words = "sphere \"ball\" · cornell.toml:47 · glass crystal · distance 3.9 · position (0.2, 0.5, -0.3) · \
                 radiance (0.5, 0.5, 0.5) · normal (0, 1, 0) · pixel 1, 2";
    assert!(
        matches!(&effects[..], [Effect::Aside(bytes)] if *bytes == crate::window_title::clipboard_bytes(words))
    );
    // The clicked object can still be copied after other key presses.
    ui.press_character('s');
    assert!(matches!(ui.press_character('y')[..], [Effect::Aside(_)]));
}

#[test]
fn command_line_camera_overrides_the_file() {
    let sets = vec!["camera.fov=30".to_owned()];
    let base = Overrides { sets, ..Overrides::default() };
    let mut ui = TestUi::from_state(state_with(80, 24, PreviewStyle::HalfBlock, ColorDepth::TrueColor, base));
    ui.finish_render(RED);
    assert!(
        matches!(ui.press_character('c')[..], [Effect::Send(Command::KeepCamera(_))]),
        "the camera should be saved even if it was not moved"
    );
    ui.press_character('>');
    ui.press_character('c');
    assert!(kept(&mut ui, true, false).is_empty());
    let text = ui.screen_text();
    assert!(
        text.contains(&messages::camera_saved_but_overridden("scenes/cornell.toml"))
            && text.contains("reset camera"),
        "{text}"
    );
}

#[test]
fn older_render_is_shown_until_the_next_render() {
    let mut ui = ui();
    assert!(ui.press_character('b').is_empty());
    assert!(ui.screen_text().contains(messages::NO_EARLIER_RENDER));
    ui.press_character('N');
    assert!(ui.screen_text().contains(messages::NEWEST_RENDER), "{}", ui.screen_text());
    ui.press_character('n');
    assert!(ui.screen_text().contains(messages::OLDEST_RENDER), "{}", ui.screen_text());
    ui.press_character('s');
    ui.finish_render(BLUE);
    ui.advance_clock(61_000);
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 61 s ago", messages::render_number_of_count(1, 2))),
        "{}",
        ui.screen_text()
    );
    let generation = ui.state.request.generation;
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture: uniform_picture(50, 38, [10, 200, 10]),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    assert!(super::cells_of(&mut ui, RED) > 0, "the older render should stay visible");
    ui.press_character('N');
    assert!(
        !ui.state.preview.history.is_viewing_older() && ui.screen_text().contains(messages::NEWEST_RENDER),
        "{}",
        ui.screen_text()
    );
    assert!(super::cells_of(&mut ui, BLUE) + super::cells_of(&mut ui, [10, 200, 10]) > 0);
    ui.press_character('n');
    ui.press_character('s');
    assert!(super::cells_of(&mut ui, RED) == 0, "a new render should show the newest image");
}

#[test]
fn small_windows_show_all_inspected_values() {
    for (columns, rows) in [(40, 12), (30, 8), (80, 5)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        ui.press_key(crate::event::KeyPress::special(crossterm::event::KeyCode::Enter));
        answer(&mut ui, Some(picked_object()));
        let text = ui.screen_text().replace('\n', " ");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        for words in
            ["cornell.toml:47", "glass", "distance 3.9", "radiance (0.5, 0.5, 0.5)", "normal (0, 1, 0)"]
        {
            assert!(words.split(' ').all(|word| text.contains(word)), "{words}: {}", ui.screen_text());
        }
        ui.press_character('y');
        ui.press_character('?');
        ui.press_character('?');
        assert!(
            !ui.screen_text().contains("crystal"),
            "a key press should hide the values: {}",
            ui.screen_text()
        );
    }
}

#[test]
fn small_windows_show_how_to_copy() {
    for (columns, rows) in [(80, 24), (30, 8), (20, 6), (40, 12)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        ui.press_key(crate::event::KeyPress::special(crossterm::event::KeyCode::Enter));
        answer(&mut ui, Some(picked_object()));
        ui.press_character('y');
        let text = ui.screen_text();
        assert!(
            text.lines().next().is_some_and(|line| line.contains("✓ done")),
            "the render state should be visible: {text}"
        );
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(&format!("{} sphere \"ball\"", messages::SELECT_TO_COPY)), "{text}");
    }
}

#[test]
fn drag_after_z_selects_the_region_to_render() {
    let mut ui = ui();
    ui.press_character('r');
    ui.press_character('z');
    assert!(ui.screen_text().contains(messages::DRAG_REGION), "{}", ui.screen_text());
    mouse(&mut ui, MouseEventKind::Press, 10, 5);
    assert!(mouse(&mut ui, MouseEventKind::Drag, 30, 12).is_empty(), "the camera should not move");
    assert_eq!(ui.draw_screen()[(10, 5)].symbol(), "┌");
    assert_eq!(ui.draw_screen()[(30, 12)].symbol(), "┘");
    let effects = mouse(&mut ui, MouseEventKind::Release, 30, 12);
    let marked = sent_render_request(&effects).expect("a request");
    let section = marked.first.expect("a region");
    assert!((section.left - 10.5 / 55.0).abs() < 1e-9 && (section.width - 20.0 / 55.0).abs() < 1e-9);
    assert!(!marked.overrides.camera.has_changes());
    // The region applies to all renders until `z` is pressed again.
    assert_eq!(sent_render_request(&ui.press_character('s')).expect("a request").first, Some(section));
    assert_eq!(sent_render_request(&ui.press_character('z')).expect("a request").first, None);
    ui.finish_render(BLUE);
    ui.press_character('z');
    mouse(&mut ui, MouseEventKind::Press, 30, 12);
    assert!(mouse(&mut ui, MouseEventKind::Release, 30, 12).is_empty(), "no render is running");
    assert!(ui.screen_text().contains(messages::REGION_NEXT), "{}", ui.screen_text());
    assert!(sent_render_request(&ui.press_character('r')).expect("a request").first.is_some());
}

#[test]
fn clicks_in_a_close_up_select_the_right_pixel() {
    let mut ui = ui();
    let spot = queried_position(&click(&mut ui, 12, 10));
    ui.press_character('x');
    let around = ui.state.request.preview_size.expect("a size").around;
    assert_eq!(around, Some(spot));
    // The section has 20 × 10 image pixels, and more would fit.
    let section = Some(NormalizedRect { left: 0.2, top: 0.4, width: 0.1, height: 0.2 });
    let generation = ui.state.request.generation;
    let picture = uniform_picture(20, 10, BLUE);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range: None,
        section,
        lacks_photons: false,
        source: None,
    }));
    assert_eq!(super::cells_of(&mut ui, BLUE), 20 * 5, "{}", ui.screen_text());
    assert!(ui.screen_text().contains("cornell.toml  1:1"), "{}", ui.screen_text());
    // The area has 56 × 21 cells at (0, 1), so the image starts at (18, 9).
    let spot = queried_position(&click(&mut ui, 18, 9));
    assert!((spot.x - (0.2 + 0.1 * 0.5 / 20.0)).abs() < 1e-9, "{spot:?}");
    assert!((spot.y - (0.4 + 0.2 * 0.5 / 5.0)).abs() < 1e-9, "{spot:?}");
}

#[test]
fn header_marks_an_older_render() {
    let mut ui = ui();
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    ui.press_character('b');
    let first = |ui: &mut TestUi| ui.screen_text().lines().next().map(str::to_owned).unwrap_or_default();
    assert!(
        first(&mut ui).contains("◂ older")
            && first(&mut ui).contains(&messages::render_number_of_count(1, 2))
    );
    // A key that has no effect clears the message.
    ui.press_character('y');
    let text = ui.screen_text();
    assert!(text.contains("b newest") && text.contains("N newer"), "expected history keys: {text}");
    assert!(
        !text.contains("samples") && !text.contains("render  "),
        "values from the newest render should be hidden: {text}"
    );
    ui.handle_event(Event::Resize(window(30, 8)));
    assert!(first(&mut ui).contains("1 of 2"), "{}", ui.screen_text());
    ui.handle_event(Event::Resize(window(80, 24)));
    ui.press_character('b');
    assert!(
        first(&mut ui).contains("✓ done") && ui.screen_text().contains("samples"),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn saved_camera_can_be_compared_with_the_old_one() {
    let mut ui = ui();
    ui.press_character('l');
    ui.finish_render(BLUE);
    ui.press_character('c');
    kept(&mut ui, true, true);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    ui.press_character('b');
    assert!(super::cells_of(&mut ui, RED) > 0, "expected the previous camera: {}", ui.screen_text());
}

#[test]
fn escape_cancels_gestures_and_closes_history() {
    let mut ui = ui();
    let escape = |ui: &mut TestUi| ui.handle_event(Event::Key(KeyPress::special(KeyCode::Esc)));
    for (key, waits) in [('z', messages::DRAG_REGION), ('f', messages::CLICK_TO_FOCUS)] {
        ui.press_character(key);
        assert!(ui.screen_text().contains(waits), "{}", ui.screen_text());
        escape(&mut ui);
        assert!(!ui.state.selection.is_marking && !ui.state.selection.is_focusing);
        assert!(!ui.screen_text().contains(waits), "{}", ui.screen_text());
    }
    ui.state.selection.facts = Some(vec!["sphere".to_owned()]);
    escape(&mut ui);
    assert_eq!(ui.state.selection.facts, None);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    ui.press_character('b');
    assert!(ui.state.preview.history.is_viewing_older());
    escape(&mut ui);
    assert!(
        !ui.state.preview.history.is_viewing_older() && ui.screen_text().contains(messages::NEWEST_RENDER),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn canceled_region_drag_has_no_effect() {
    for key in [KeyCode::Esc, KeyCode::Char('v'), KeyCode::Char('z')] {
        let mut ui = ui();
        ui.press_character('z');
        mouse(&mut ui, MouseEventKind::Press, 12, 10);
        mouse(&mut ui, MouseEventKind::Drag, 20, 14);
        assert!(ui.state.request.first_section.is_some());
        ui.press_key(KeyPress::special(key));
        assert!(ui.state.request.first_section.is_none() && !ui.state.selection.is_marking, "{key:?}");
        assert!(
            mouse(&mut ui, MouseEventKind::Drag, 30, 16).is_empty(),
            "{key:?}: the camera should not move"
        );
        assert!(mouse(&mut ui, MouseEventKind::Release, 30, 16).is_empty(), "{key:?}: expected no click");
    }
}

#[test]
fn digit_without_the_view_list_shows_a_hint() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character('3');
    assert!(ui.screen_text().contains(messages::VIEWS_FIRST), "{}", ui.screen_text());
}

#[test]
fn focusing_requires_an_aperture() {
    let mut ui = ui();
    ui.state.request.own.as_mut().expect("a scene").camera.aperture = 0.0;
    assert!(ui.press_character('f').is_empty());
    assert!(ui.screen_text().contains(messages::PINHOLE), "{}", ui.screen_text());
    assert!(!ui.state.selection.is_focusing, "the next click should not set the focus");
}

#[test]
fn exposure_changes_add_no_history_entry() {
    let mut ui = ui();
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    for color in [[1, 2, 3], [4, 5, 6], [7, 8, 9]] {
        ui.press_character(']');
        ui.finish_render(color);
    }
    assert_eq!(ui.state.work.renders, 2, "exposure changes should not be counted");
    ui.press_character('n');
    assert!(ui.screen_text().contains(&messages::render_number_of_count(1, 2)), "{}", ui.screen_text());
    ui.press_character('N');
    // Toggling a setting adds an entry.
    ui.press_character('s');
    ui.finish_render(BLUE);
    ui.press_character('n');
    assert!(ui.screen_text().contains(&messages::render_number_of_count(2, 3)), "{}", ui.screen_text());
}

#[test]
fn older_render_is_shown_with_its_changes() {
    use crate::pipeline::protocol;
    let mut ui = TestUi::from_state(state(120, 40));
    for (color, text) in [(RED, "r = 1\nfov = 40"), (BLUE, "r = 2\nfov = 40"), (RED, "r = 2\nfov = 30")] {
        ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
        let generation = ui.state.request.generation;
        ui.worker_event(protocol::Event::Text { generation, text: text.into() });
        ui.finish_render(color);
    }
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 0 s ago", messages::render_number_of_count(2, 3)))
            && ui.screen_text().contains(&format!("\nr 1 → 2 · {}", messages::HISTORY_KEYS.join(" · "))),
        "{}",
        ui.screen_text()
    );
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("\n{} · {}", messages::OPENED, messages::HISTORY_KEYS[1])),
        "no edit: {}",
        ui.screen_text()
    );
    ui.press_character('b');
    ui.press_character('b');
    assert!(
        ui.screen_text().contains(&format!("\n{}, fov 40 → 30  ", messages::BEFORE_EDIT)),
        "{}",
        ui.screen_text()
    );
}
