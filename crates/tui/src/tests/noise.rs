//! Tests for the display of noise.

use super::RED;
use crate::event::Event;
use crate::fixtures::*;
use crate::pipeline::protocol::{self, NoiseAndTimeToNextLevel, RenderProgress};

#[test]
fn noise_is_shown_during_a_render() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Started { generation: 1 });
    let noise = Some(NoiseAndTimeToNextLevel { now: 0.021, seconds: 1.0, next: Some((0.01, 14.0)) });
    let progress = RenderProgress { noise, ..render_progress(0.5, Some(20.0)) };
    ui.worker_event(protocol::Event::Progress { generation: 1, progress });
    for (columns, rows, words) in [
        (80, 24, "noise 2.1 % → 1 % in about 14 s · 32/64 samples"),
        (54, 20, "noise 2.1 % · 32/64 samples"),
        (36, 20, "32/64 samples"),
    ] {
        ui.handle_event(Event::Resize(window(columns, rows)));
        assert!(ui.screen_text().contains(words), "{words}: {}", ui.screen_text());
    }
    assert!(!ui.screen_text().contains("noise"), "{}", ui.screen_text());
    // While paused, the remaining time is unknown.
    ui.handle_event(Event::Resize(window(80, 24)));
    ui.press_character(' ');
    assert!(ui.screen_text().contains("noise 2.1 % · 32/64 samples"), "{}", ui.screen_text());
}

#[test]
fn sample_count_is_approximate_with_noise_target() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Started { generation: 1 });
    let settings =
        Box::new(crate::pipeline::settings::EffectiveSettingsSummary { error: 0.02, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings { generation: 1, settings, own: scene_settings() });
    ui.worker_event(protocol::Event::Progress {
        generation: 1,
        progress: RenderProgress { is_total_fixed: false, ..render_progress(0.5, None) },
    });
    assert!(ui.screen_text().contains("about 32 samples"), "{}", ui.screen_text());
}

/// Returns the screen after a render with a target `error` or a time limit.
fn ended(error: f32, time_seconds: Option<f64>, complete: bool, samples: u32) -> String {
    let overrides = crate::pipeline::settings::Overrides { time_seconds, ..Default::default() };
    let (kind, depth) = (crate::preview_style::PreviewStyle::HalfBlock, crate::color::ColorDepth::None);
    let mut ui = TestUi::from_state(state_with(80, 24, kind, depth, overrides));
    ui.finish_render(RED);
    let report = ui.state.work.report.as_mut().expect("a report");
    (report.image.complete, report.image.samples.max) = (complete, samples);
    ui.state.request.effective.as_mut().expect("settings").error = error;
    ui.screen_text()
}

#[test]
fn limit_that_ended_the_render_is_shown() {
    for (error, time, complete, samples, words) in [
        (0.02, None, true, 40, "target ✓ 2 % per tile"),
        (0.02, None, true, 64, "stopped at max samples"),
        (0.02, Some(5.0), false, 40, "stopped at time limit"),
        (0.0, Some(5.0), false, 40, "stopped at time limit"),
        (0.0, Some(5.0), true, 64, "stopped at max samples"),
    ] {
        let text = ended(error, time, complete, samples).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(words), "{words}: {text}");
        assert_eq!(text.contains("target ✓"), words.contains("✓"), "{text}");
        assert_eq!(text.contains("stopped at"), words.contains("stopped"), "{text}");
    }
    let plain = ended(0.0, None, true, 64);
    assert!(!plain.contains("stopped"), "{plain}");
}

#[test]
fn noise_and_target_per_tile_are_shown() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(
        ui.screen_text().contains("noise    0.81 %") && !ui.screen_text().contains("per tile"),
        "{}",
        ui.screen_text()
    );
    for (samples, words) in [(64, "target   0.5 % per tile"), (256, "target ✓ 0.5 % per tile")] {
        ui.state.request.effective.as_mut().expect("settings").error = 0.005;
        ui.state.request.effective.as_mut().expect("settings").samples = samples;
        assert!(ui.screen_text().contains(words), "{words}: {}", ui.screen_text());
    }
}

#[test]
fn noise_has_two_digits() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.state.work.report.as_mut().expect("a report").image.error = Some(0.4312);
    assert!(ui.screen_text().contains("noise    43 %"), "{}", ui.screen_text());
}
