//! Tests for the screen while an older render is being viewed.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::ContentChangeTime;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress, MouseEvent, MouseEventKind};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{
    CameraSaveResult, Command, Event as WorkerEvent, PickedPixel, PreviewUpdate,
};
use crate::pipeline::settings::Overrides;
use crate::preview_style::PreviewStyle;

/// A UI with two renders: the beauty view, then the normal view with hard shadows. The older one is being
/// viewed.
fn older() -> TestUi {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    ui.press_character('s');
    ui.press_character('v');
    ui.finish_render(BLUE);
    ui.press_key(KeyPress::special(KeyCode::Esc));
    ui.press_character('n');
    ui
}

fn line(ui: &mut TestUi, row: usize) -> String {
    ui.screen_text().lines().nth(row).unwrap_or_default().to_owned()
}

#[test]
fn older_render_cannot_be_inspected() {
    let mut ui = older();
    let asks = |effects: &[Effect]| effects.iter().any(|it| matches!(it, Effect::Send(Command::Pick(_))));
    let mouse = |kind| Event::Mouse(MouseEvent { kind, column: 40, row: 20 });
    for keys in
        [&[KeyPress::special(KeyCode::Enter)][..], &[KeyPress::plain('f'); 2], &[KeyPress::plain('y')]]
    {
        let effects: Vec<Effect> = keys.iter().flat_map(|key| ui.press_key(*key)).collect();
        assert!(!asks(&effects), "{keys:?}");
        assert!(ui.screen_text().contains(messages::OLDER_RENDER), "{}", ui.screen_text());
    }
    ui.handle_event(mouse(MouseEventKind::Press));
    assert!(!asks(&ui.handle_event(mouse(MouseEventKind::Release))));
    assert!(ui.screen_text().contains(messages::OLDER_RENDER), "{}", ui.screen_text());
    // A late reply is not shown for the older render.
    let picked = PickedPixel { pixel: [3, 4], object: None, color: None };
    ui.worker_event(WorkerEvent::Picked { generation: 1, picked: Box::new(picked) });
    assert!(!ui.screen_text().contains("pixel 3, 4"), "{}", ui.screen_text());
    ui.press_character('b');
    assert!(
        asks(&ui.press_key(KeyPress::special(KeyCode::Enter))),
        "the newest render should be inspectable"
    );
}

#[test]
fn older_render_hides_newest_settings() {
    let mut ui = older();
    let keys = line(&mut ui, 39);
    assert!(!line(&mut ui, 0).contains("view normal") && !keys.contains("hard"), "{}", ui.screen_text());
    assert!(keys.contains("b newest") && keys.contains("N newer") && !keys.contains("older"), "{keys}");
    ui.press_character('i');
    ui.finish_render(RED);
    ui.press_character('n');
    assert!(line(&mut ui, 0).contains("view normal"), "expected this entry's view: {}", ui.screen_text());
    assert!(line(&mut ui, 39).contains("n N older, newer"), "{}", ui.screen_text());
}

#[test]
fn w_writes_the_newest_image() {
    let mut ui = older();
    ui.press_character('w');
    assert!(ui.screen_text().contains(messages::WRITING_NEWEST), "{}", ui.screen_text());
    let generation = ui.state.request.generation;
    ui.worker_event(WorkerEvent::WriteDone { generation, paths: vec!["ow.png".into()] });
    let words = format!("wrote ow.png{}", messages::WROTE_NEWEST);
    assert!(ui.screen_text().contains(&words), "{}", ui.screen_text());
}

#[test]
fn c_saves_the_newest_camera() {
    // Detecting the file change, often before the reply arrives, returns to the newest render.
    for (is_own, is_noticed) in [(true, false), (false, false), (true, true)] {
        let mut ui = older();
        ui.press_character('b');
        ui.press_character('h');
        ui.finish_render(RED);
        ui.press_character('n');
        assert!(!ui.press_character('c').is_empty());
        if is_noticed {
            ui.handle_event(Event::FileChanged(crate::ContentChangeTime { noticed: ui.now }));
        }
        let kept =
            CameraSaveResult { path: "a.toml".into(), is_new: true, is_own, of_model: false, edit: None };
        let generation = ui.state.request.generation;
        ui.worker_event(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
        let words = messages::OF_NEWEST_RENDER.trim_end();
        assert!(ui.screen_text().contains(words), "{}", ui.screen_text());
    }
}

#[test]
fn newest_render_progress_is_shown() {
    let mut ui = older();
    ui.press_character('b');
    ui.press_character('r');
    let generation = ui.state.request.generation;
    ui.worker_event(WorkerEvent::Started { generation });
    let picture = uniform_picture(50, 38, RED);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    ui.worker_event(WorkerEvent::Progress { generation, progress: render_progress(0.25, Some(3.0)) });
    ui.press_character('n');
    let words = format!("{}, 0 s ago  newest 25 %  ETA 3.0 s", messages::render_number_of_count(2, 3));
    assert!(line(&mut ui, 0).contains(&words), "{}", ui.screen_text());
    ui.press_character('m');
    ui.press_character('N');
    ui.press_character('n');
    // A stopped render is marked in the history.
    ui.press_character('s');
    ui.finish_render(BLUE);
    assert!(ui.screen_text().contains(&format!("{}:", messages::STOPPED)), "{}", ui.screen_text());
    assert_eq!(ui.screen_text().matches(messages::STOPPED).count(), 1, "{}", ui.screen_text());
}

#[test]
fn age_is_shown_once_and_updated() {
    let mut ui = older();
    ui.advance_clock(3000);
    assert!(
        line(&mut ui, 0).contains(&format!("{}, 3 s ago", messages::render_number_of_count(1, 2))),
        "{}",
        ui.screen_text()
    );
    assert!(
        !ui.screen_text().contains("0 s ago") && ui.screen_text().contains("N newer"),
        "{}",
        ui.screen_text()
    );
    assert!(ui.state.next_tick().is_some(), "the age should be updated");
}

#[test]
fn save_time_is_cleared_by_the_next_render() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.finish_render(BLUE);
    let generation = ui.state.request.generation;
    ui.handle_event(Event::FirstPreviewSent { generation });
    assert!(ui.state.saving.first_change.is_some(), "{}", ui.screen_text());
    ui.press_character('s');
    ui.finish_render(RED);
    assert!(ui.state.saving.first_change.is_none(), "not rendered after a save: {}", ui.screen_text());
}

/// A preview style that draws the image, and one that draws nothing.
const KINDS: [PreviewStyle; 2] = [PreviewStyle::HalfBlock, PreviewStyle::None];

fn ui_with(kind: PreviewStyle) -> TestUi {
    TestUi::from_state(state_with(80, 24, kind, ColorDepth::TrueColor, Overrides::default()))
}

#[test]
fn interrupted_render_is_counted_once() {
    for kind in KINDS {
        let mut ui = ui_with(kind);
        ui.report_scene_read();
        // A key interrupts the first render. Later keys find it finished. The next render is also
        // interrupted.
        for (keys, number) in [("]", 1), ("]", 1), ("s]", 2), ("]", 2), ("s", 3)] {
            keys.chars().for_each(|key| drop(ui.press_character(key)));
            ui.finish_render(RED);
            assert!(
                ui.screen_text().contains(&messages::numbered_render(number)),
                "{kind:?} {keys}: {}",
                ui.screen_text()
            );
        }
    }
}

#[test]
fn first_render_is_counted_even_if_unchanged() {
    let mut ui = ui_with(PreviewStyle::None);
    ui.report_scene_read();
    // The key arrives when the image is complete but the request has not ended.
    ui.press_character(']');
    ui.report_scene_read();
    ui.worker_event(done_event(ui.state.request.generation, Vec::new(), true));
    assert!(ui.screen_text().contains(&messages::numbered_render(1)), "{}", ui.screen_text());
}

#[test]
fn history_needs_a_preview() {
    let keys =
        [('n', messages::OLDEST_RENDER), ('N', messages::NEWEST_RENDER), ('b', messages::NO_EARLIER_RENDER)];
    for (kind, (key, words)) in KINDS.into_iter().flat_map(|kind| keys.map(|it| (kind, it))) {
        let mut ui = ui_with(kind);
        let has_preview = kind != PreviewStyle::None;
        ui.press_character(key);
        let early = if has_preview { messages::NO_IMAGE } else { messages::NO_PREVIEW };
        assert!(ui.screen_text().contains(early), "{kind:?} {key}: {}", ui.screen_text());
        ui.finish_render(RED);
        ui.press_character(key);
        let late = if has_preview { words } else { messages::NO_PREVIEW };
        assert!(ui.screen_text().contains(late), "{kind:?} {key}: {}", ui.screen_text());
    }
}
