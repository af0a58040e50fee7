//! Tests that notices expire and do not hide progress or results.

use super::{BLUE, RED};
use crate::event::Event;
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol;

const WINDOWS: [(u16, u16); 5] = [(60, 20), (80, 24), (100, 30), (120, 40), (200, 60)];
const SHORT: &str = "exposure +0.25";
const LONG: &str = messages::CAMERA_MOVED;
const LONGER: &str = "camera.position = [0, 1, 4.5], camera.fov = 35, camera.focus = 4.25 was saved after you moved the camera: \
    press c again to overwrite it, or 0 to reset the camera";

/// A UI showing a notice while a render is half done.
fn half_done(window: (u16, u16), notice: &str) -> TestUi {
    let mut ui = TestUi::from_state(state(window.0, window.1));
    ui.finish_render(RED);
    ui.press_character('r');
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    ui.worker_event(protocol::Event::Progress { generation, progress: render_progress(0.5, Some(2.0)) });
    crate::update::show_notice(&mut ui.state, notice);
    ui
}

#[test]
fn notice_expires_after_four_seconds() {
    for window in WINDOWS {
        let mut ui = TestUi::from_state(state(window.0, window.1));
        ui.finish_render(RED);
        ui.press_character(']');
        ui.finish_render(BLUE);
        assert!(ui.screen_text().contains(SHORT), "{}", ui.screen_text());
        ui.advance_clock(3900);
        assert!(ui.screen_text().contains(SHORT), "{}", ui.screen_text());
        // Since there are no other events, the event loop must wake up to clear the notice.
        let wake = ui.state.next_tick().expect("a tick");
        assert!(wake <= ui.now + std::time::Duration::from_millis(100));
        ui.state.dirty = false;
        ui.advance_clock(100);
        assert!(ui.state.dirty);
        let rows = ui.screen_text();
        // The key line also contains this text, as a setting that `0` resets.
        let above = rows.lines().rev().skip(1).any(|row| row.contains(SHORT));
        assert!(!above, "{rows}");
        assert_eq!(ui.state.next_tick(), None);
    }
}

#[test]
fn newer_notice_is_shown_for_four_seconds() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.press_character(']');
    ui.advance_clock(3000);
    ui.press_character(']');
    ui.finish_render(BLUE);
    ui.advance_clock(3000);
    assert!(ui.screen_text().contains(&messages::exposure_changed("+0.5")), "{}", ui.screen_text());
}

#[test]
fn notice_does_not_hide_progress() {
    for window in WINDOWS {
        for notice in [SHORT, LONG, LONGER] {
            let mut ui = half_done(window, notice);
            let text = ui.screen_text();
            let begin: String = notice.chars().take(30).collect();
            assert!(text.contains(&begin), "{window:?} {text}");
            assert!(text.contains("32/64 samples"), "{window:?} {text}");
            assert!(text.contains("50 %"), "{window:?} {text}");
        }
    }
}

#[test]
fn notice_does_not_hide_the_written_file() {
    for window in WINDOWS {
        for notice in [SHORT, LONG, LONGER] {
            let mut ui = TestUi::from_state(state(window.0, window.1));
            ui.worker_event(protocol::Event::Written {
                generation: 1,
                path: "cornell.png".into(),
                bytes: 90_200,
                is_own: true,
                unfinished: None,
            });
            ui.finish_render(RED);
            crate::update::show_notice(&mut ui.state, notice);
            assert!(ui.screen_text().contains("→ cornell.png"), "{window:?} {}", ui.screen_text());
        }
    }
}

/// Without a status line, notices replace the key line.
#[test]
fn small_window_shows_keys_after_a_notice() {
    let mut ui = TestUi::from_state(state(60, 8));
    ui.finish_render(RED);
    ui.press_character(']');
    ui.finish_render(BLUE);
    assert!(!ui.screen_text().contains("q quit"), "{}", ui.screen_text());
    ui.advance_clock(4000);
    assert!(ui.screen_text().contains("q quit"), "{}", ui.screen_text());
}

#[test]
fn errors_and_prompts_stay_until_a_key_press() {
    let failed = protocol::Event::WriteFailed {
        generation: 1,
        path: Some("cornell.png".into()),
        message: "disk full".to_owned(),
    };
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.worker_event(failed);
    ui.advance_clock(60_000);
    assert!(ui.screen_text().contains("disk full"), "{}", ui.screen_text());
    ui.press_character('f');
    ui.advance_clock(60_000);
    assert!(ui.screen_text().contains(messages::CLICK_TO_FOCUS), "{}", ui.screen_text());
    ui.press_character('f');
    ui.handle_event(Event::SourceEnded(crate::event::RequiredEventSource::Watcher));
    ui.advance_clock(60_000);
    assert!(ui.screen_text().contains(messages::NOT_WATCHING), "{}", ui.screen_text());
}
