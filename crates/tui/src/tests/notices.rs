//! Tests of notices: they expire, and leave progress and results in sight.

use super::{BLUE, RED};
use crate::event::Event;
use crate::fixtures::*;
use crate::pipeline::protocol;

const WINDOWS: [(u16, u16); 5] = [(60, 20), (80, 24), (100, 30), (120, 40), (200, 60)];
const SHORT: &str = "exposure +0.25";
const LONG: &str = "camera moved (preview only). w: save image · c: keep in scene · 0: reset";
const LONGER: &str = "the camera was saved since keys moved it: camera.position = [0, 1, 4.5], camera.fov = 35; \
    press c again to write over it, or 0 to go back to the saved one";

/// A desk on whose screen a notice stands while a render is half done.
fn half_done(window: (u16, u16), notice: &str) -> Desk {
    let mut desk = Desk::with(state(window.0, window.1));
    desk.finish(RED);
    desk.press('r');
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::Started { generation });
    desk.worker(protocol::Event::Progress { generation, progress: progress(0.5, Some(2.0)) });
    crate::update::say(&mut desk.state, notice);
    desk
}

#[test]
fn a_notice_expires_after_four_seconds() {
    for window in WINDOWS {
        let mut desk = Desk::with(state(window.0, window.1));
        desk.finish(RED);
        desk.press(']');
        desk.finish(BLUE);
        assert!(desk.text().contains(SHORT), "{}", desk.text());
        desk.wait(3900);
        assert!(desk.text().contains(SHORT), "{}", desk.text());
        // Nothing else happens meanwhile: the loop has to wake up for it.
        let wake = desk.state.next_tick().expect("a tick");
        assert!(wake <= desk.now + std::time::Duration::from_millis(100));
        desk.state.dirty = false;
        desk.wait(100);
        assert!(desk.state.dirty);
        let rows = desk.text();
        // The line of keys has it as what `0` resets.
        let above = rows.lines().rev().skip(1).any(|row| row.contains(SHORT));
        assert!(!above, "{rows}");
        assert_eq!(desk.state.next_tick(), None);
    }
}

#[test]
fn a_later_notice_has_its_own_four_seconds() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.press(']');
    desk.wait(3000);
    desk.press(']');
    desk.finish(BLUE);
    desk.wait(3000);
    assert!(desk.text().contains("exposure +0.5"), "{}", desk.text());
}

#[test]
fn a_notice_leaves_progress_in_sight() {
    for window in WINDOWS {
        for notice in [SHORT, LONG, LONGER] {
            let mut desk = half_done(window, notice);
            let text = desk.text();
            let begin: String = notice.chars().take(30).collect();
            assert!(text.contains(&begin), "{window:?} {text}");
            assert!(text.contains("32/64 samples"), "{window:?} {text}");
            assert!(text.contains("50 %"), "{window:?} {text}");
        }
    }
}

#[test]
fn a_notice_leaves_the_written_file_in_sight() {
    for window in WINDOWS {
        for notice in [SHORT, LONG, LONGER] {
            let mut desk = Desk::with(state(window.0, window.1));
            desk.worker(protocol::Event::Written {
                generation: 1,
                path: "cornell.png".into(),
                bytes: 90_200,
                is_own: true,
            });
            desk.finish(RED);
            crate::update::say(&mut desk.state, notice);
            assert!(desk.text().contains("→ cornell.png"), "{window:?} {}", desk.text());
        }
    }
}

/// Where there is no line under the image, the notice takes the place of the keys, for its time.
#[test]
fn in_a_low_window_the_keys_return() {
    let mut desk = Desk::with(state(60, 8));
    desk.finish(RED);
    desk.press(']');
    desk.finish(BLUE);
    assert!(!desk.text().contains("q quit"), "{}", desk.text());
    desk.wait(4000);
    assert!(desk.text().contains("q quit"), "{}", desk.text());
}

#[test]
fn faults_and_prompts_stay_until_a_key() {
    let failed = protocol::Event::WriteFailed {
        generation: 1,
        path: Some("cornell.png".into()),
        message: "cannot write cornell.png: disk full".to_owned(),
    };
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.worker(failed);
    desk.wait(60_000);
    assert!(desk.text().contains("disk full"), "{}", desk.text());
    desk.press('f');
    desk.wait(60_000);
    assert!(desk.text().contains("click where to focus"), "{}", desk.text());
    desk.press('f');
    desk.event(Event::Lost(crate::event::Source::Watcher));
    desk.wait(60_000);
    assert!(desk.text().contains("no longer watched"), "{}", desk.text());
}
