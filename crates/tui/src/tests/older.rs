//! Tests of the screen while an older picture is looked at: what it says is of that picture.

use crossterm::event::KeyCode;

use super::{BLUE, RED};
use crate::Changed;
use crate::event::{Effect, Event, KeyPress, Mouse, MouseKind};
use crate::fixtures::*;
use crate::pipeline::protocol::{Command, Event as WorkerEvent, Kept, Picked};

/// A beauty, then hard shadows in the view of normals; the beauty is looked at.
fn older() -> Desk {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    desk.press('s');
    desk.press('v');
    desk.finish(BLUE);
    desk.key(KeyPress::special(KeyCode::Esc));
    desk.press('n');
    desk
}

fn line(desk: &mut Desk, row: usize) -> String {
    desk.text().lines().nth(row).unwrap_or_default().to_owned()
}

#[test]
fn it_answers_no_question_about_its_objects() {
    let mut desk = older();
    let asks = |effects: &[Effect]| effects.iter().any(|it| matches!(it, Effect::Send(Command::Pick(_))));
    let mouse = |kind| Event::Mouse(Mouse { kind, column: 40, row: 20 });
    for keys in
        [&[KeyPress::special(KeyCode::Enter)][..], &[KeyPress::plain('f'); 2], &[KeyPress::plain('y')]]
    {
        let effects: Vec<Effect> = keys.iter().flat_map(|key| desk.key(*key)).collect();
        assert!(!asks(&effects), "{keys:?}");
        assert!(desk.text().contains("of an older picture nothing is known"), "{}", desk.text());
    }
    desk.event(mouse(MouseKind::Press));
    assert!(!asks(&desk.event(mouse(MouseKind::Release))));
    assert!(desk.text().contains("of an older picture nothing is known"), "{}", desk.text());
    // An answer that comes late is not about it.
    let picked = Picked { pixel: [3, 4], thing: None, color: None };
    desk.worker(WorkerEvent::Picked { generation: 1, picked: Box::new(picked) });
    assert!(!desk.text().contains("pixel 3, 4"), "{}", desk.text());
    desk.press('b');
    assert!(asks(&desk.key(KeyPress::special(KeyCode::Enter))), "the newest one is asked");
}

#[test]
fn the_settings_of_the_newest_are_not_told_of_it() {
    let mut desk = older();
    let keys = line(&mut desk, 39);
    assert!(!line(&mut desk, 0).contains("view normal") && !keys.contains("hard"), "{}", desk.text());
    assert!(keys.contains("b newest") && keys.contains("N newer") && !keys.contains("older"), "{keys}");
    desk.press('i');
    desk.finish(RED);
    desk.press('n');
    assert!(line(&mut desk, 0).contains("view normal"), "that of this one: {}", desk.text());
    assert!(line(&mut desk, 39).contains("n N older, newer"), "{}", desk.text());
}

#[test]
fn the_image_that_w_writes_meanwhile_is_the_newest_and_is_called_so() {
    let mut desk = older();
    desk.press('w');
    assert!(desk.text().contains("writing the newest image, not the one that is shown"), "{}", desk.text());
    let generation = desk.state.request.generation;
    desk.worker(WorkerEvent::WriteDone { generation, paths: vec!["ow.png".into()] });
    let words = "wrote ow.png: the newest picture, not the one that is shown";
    assert!(desk.text().contains(words), "{}", desk.text());
}

#[test]
fn the_camera_that_c_writes_meanwhile_is_that_of_the_newest_and_is_called_so() {
    // The save is often noticed before the answer comes, and leads to the newest picture.
    for (is_own, is_noticed) in [(true, false), (false, false), (true, true)] {
        let mut desk = older();
        desk.press('b');
        desk.press('h');
        desk.finish(RED);
        desk.press('n');
        assert!(!desk.press('c').is_empty());
        if is_noticed {
            desk.event(Event::Changed(crate::Changed { noticed: desk.now }));
        }
        let kept = Kept { path: "a.toml".into(), is_new: true, is_own, of_model: false, edit: None };
        let generation = desk.state.request.generation;
        desk.worker(WorkerEvent::CameraKept { generation, outcome: Ok(kept) });
        let words = "that of the newest picture, not of the one that was shown";
        assert!(desk.text().contains(words), "{}", desk.text());
    }
}

#[test]
fn the_newest_goes_on_and_says_how_far_it_is() {
    let mut desk = older();
    desk.press('b');
    desk.press('r');
    let generation = desk.state.request.generation;
    desk.worker(WorkerEvent::Started { generation });
    let picture = plain_picture(50, 38, RED);
    desk.event(Event::Picture {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    desk.worker(WorkerEvent::Progress { generation, progress: progress(0.25, Some(3.0)) });
    desk.press('n');
    let words = "picture 2 of 3, 0 s ago  newest 25 %  ETA 3.0 s";
    assert!(line(&mut desk, 0).contains(words), "{}", desk.text());
    desk.press('m');
    desk.press('N');
    desk.press('n');
    // The strip marks a picture whose render was stopped.
    desk.press('s');
    desk.finish(BLUE);
    assert!(desk.text().contains("unfinished;"), "{}", desk.text());
    assert_eq!(desk.text().matches("unfinished").count(), 1, "{}", desk.text());
}

#[test]
fn its_age_goes_on_in_the_one_place_that_tells_it() {
    let mut desk = older();
    desk.wait(3000);
    assert!(line(&mut desk, 0).contains("picture 1 of 2, 3 s ago"), "{}", desk.text());
    assert!(!desk.text().contains("0 s ago") && desk.text().contains("N newer"), "{}", desk.text());
    assert!(desk.state.next_tick().is_some(), "it is drawn again");
}

#[test]
fn the_time_of_a_save_goes_with_its_picture() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.finish(BLUE);
    let generation = desk.state.request.generation;
    desk.event(Event::Shown { generation });
    assert!(desk.text().contains("saved → seen"), "{}", desk.text());
    desk.press('s');
    desk.finish(RED);
    assert!(!desk.text().contains("saved → seen"), "no save made this one: {}", desk.text());
}
