//! Tests of the words about noise.

use super::RED;
use crate::pipeline::protocol::{self, NoiseProgress, RenderProgress};
use crate::tui::event::Event;
use crate::tui::fixtures::*;

#[test]
fn the_noise_is_told_as_it_falls() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Started { generation: 1 });
    let noise = Some(NoiseProgress { now: 0.021, next: Some((0.01, 14.0)) });
    let progress = RenderProgress { noise, ..progress(0.5, Some(20.0)) };
    desk.worker(protocol::Event::Progress { generation: 1, progress });
    for (columns, rows, words) in [
        (80, 24, "noise 2.1 %, 1 % in 14.0 s · 32/64 samples"),
        (54, 20, "noise 2.1 % · 32/64 samples"),
        (36, 20, "32/64 samples"),
    ] {
        desk.event(Event::Resize(window(columns, rows)));
        assert!(desk.text().contains(words), "{words}: {}", desk.text());
    }
    assert!(!desk.text().contains("noise"), "{}", desk.text());
}

#[test]
fn noise_is_told_of_the_whole_picture_and_what_is_asked_of_a_tile() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.text().contains("0.81 % in all") && !desk.text().contains("a tile"), "{}", desk.text());
    for (samples, words) in [(64, "0.5 % a tile "), (256, "0.5 % a tile ✓")] {
        desk.state.request.effective.as_mut().expect("settings").error = 0.005;
        desk.state.request.effective.as_mut().expect("settings").samples = samples;
        assert!(desk.text().contains(words), "{words}: {}", desk.text());
    }
}

#[test]
fn noise_has_two_digits() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.state.work.report.as_mut().expect("a report").image.error = Some(0.4312);
    assert!(desk.text().contains("43 % in all"), "{}", desk.text());
}
