//! Tests of the screen while an older picture is looked at: what it says is of that picture.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::Changed;
use crate::event::{Effect, Event, KeyPress, Mouse, MouseKind};
use crate::fixtures::*;
use crate::pipeline::protocol::{Command, Event as WorkerEvent, Kept, Picked};

/// A beauty, then hard shadows in the view of normals; the beauty is looked at.
fn older() -> TestUi {
    let mut ui = TestUi::with(state(120, 40));
    ui.finish(RED);
    ui.press('s');
    ui.press('v');
    ui.finish(BLUE);
    ui.key(KeyPress::special(KeyCode::Esc));
    ui.press('n');
    ui
}

fn line(ui: &mut TestUi, row: usize) -> String {
    ui.text().lines().nth(row).unwrap_or_default().to_owned()
}

#[test]
fn it_answers_no_question_about_its_objects() {
    let mut ui = older();
    let asks = |effects: &[Effect]| effects.iter().any(|it| matches!(it, Effect::Send(Command::Pick(_))));
    let mouse = |kind| Event::Mouse(Mouse { kind, column: 40, row: 20 });
    for keys in
        [&[KeyPress::special(KeyCode::Enter)][..], &[KeyPress::plain('f'); 2], &[KeyPress::plain('y')]]
    {
        let effects: Vec<Effect> = keys.iter().flat_map(|key| ui.key(*key)).collect();
        assert!(!asks(&effects), "{keys:?}");
        assert!(ui.text().contains("of an older picture nothing is known"), "{}", ui.text());
    }
    ui.event(mouse(MouseKind::Press));
    assert!(!asks(&ui.event(mouse(MouseKind::Release))));
    assert!(ui.text().contains("of an older picture nothing is known"), "{}", ui.text());
    // An answer that comes late is not about it.
    let picked = Picked { pixel: [3, 4], thing: None, color: None };
    ui.worker(WorkerEvent::Picked { generation: 1, picked: Box::new(picked) });
    assert!(!ui.text().contains("pixel 3, 4"), "{}", ui.text());
    ui.press('b');
    assert!(asks(&ui.key(KeyPress::special(KeyCode::Enter))), "the newest one is asked");
}

#[test]
fn the_settings_of_the_newest_are_not_told_of_it() {
    let mut ui = older();
    let keys = line(&mut ui, 39);
    assert!(!line(&mut ui, 0).contains("view normal") && !keys.contains("hard"), "{}", ui.text());
    assert!(keys.contains("b newest") && keys.contains("N newer") && !keys.contains("older"), "{keys}");
    ui.press('i');
    ui.finish(RED);
    ui.press('n');
    assert!(line(&mut ui, 0).contains("view normal"), "that of this one: {}", ui.text());
    assert!(line(&mut ui, 39).contains("n N older, newer"), "{}", ui.text());
}

#[test]
fn the_image_that_w_writes_meanwhile_is_the_newest_and_is_called_so() {
    let mut ui = older();
    ui.press('w');
    assert!(ui.text().contains("writing the newest image, not the one that is shown"), "{}", ui.text());
    let generation = ui.state.request.generation;
    ui.worker(WorkerEvent::WriteDone { generation, paths: vec!["ow.png".into()] });
    let words = "wrote ow.png: the newest picture, not the one that is shown";
    assert!(ui.text().contains(words), "{}", ui.text());
}

#[test]
fn the_camera_that_c_writes_meanwhile_is_that_of_the_newest_and_is_called_so() {
    // The save is often noticed before the answer comes, and leads to the newest picture.
    for (is_own, is_noticed) in [(true, false), (false, false), (true, true)] {
        let mut ui = older();
        ui.press('b');
        ui.press('h');
        ui.finish(RED);
        ui.press('n');
        assert!(!ui.press('c').is_empty());
        if is_noticed {
            ui.event(Event::Changed(crate::Changed { noticed: ui.now }));
        }
        let kept = Kept { path: "a.toml".into(), is_new: true, is_own, of_model: false, edit: None };
        let generation = ui.state.request.generation;
        ui.worker(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
        let words = "that of the newest picture, not of the one that was shown";
        assert!(ui.text().contains(words), "{}", ui.text());
    }
}

#[test]
fn the_newest_goes_on_and_says_how_far_it_is() {
    let mut ui = older();
    ui.press('b');
    ui.press('r');
    let generation = ui.state.request.generation;
    ui.worker(WorkerEvent::Started { generation });
    let picture = plain_picture(50, 38, RED);
    ui.event(Event::Picture {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    ui.worker(WorkerEvent::Progress { generation, progress: progress(0.25, Some(3.0)) });
    ui.press('n');
    let words = "picture 2 of 3, 0 s ago  newest 25 %  ETA 3.0 s";
    assert!(line(&mut ui, 0).contains(words), "{}", ui.text());
    ui.press('m');
    ui.press('N');
    ui.press('n');
    // The strip marks a picture whose render was stopped.
    ui.press('s');
    ui.finish(BLUE);
    assert!(ui.text().contains("unfinished;"), "{}", ui.text());
    assert_eq!(ui.text().matches("unfinished").count(), 1, "{}", ui.text());
}

#[test]
fn its_age_goes_on_in_the_one_place_that_tells_it() {
    let mut ui = older();
    ui.wait(3000);
    assert!(line(&mut ui, 0).contains("picture 1 of 2, 3 s ago"), "{}", ui.text());
    assert!(!ui.text().contains("0 s ago") && ui.text().contains("N newer"), "{}", ui.text());
    assert!(ui.state.next_tick().is_some(), "it is drawn again");
}

#[test]
fn the_time_of_a_save_goes_with_its_picture() {
    let mut ui = TestUi::new();
    ui.finish(RED);
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.finish(BLUE);
    let generation = ui.state.request.generation;
    ui.event(Event::Shown { generation });
    assert!(ui.text().contains("saved → seen"), "{}", ui.text());
    ui.press('s');
    ui.finish(RED);
    assert!(!ui.text().contains("saved → seen"), "no save made this one: {}", ui.text());
}
