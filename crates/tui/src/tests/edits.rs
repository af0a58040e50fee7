//! Tests for edits and typos: history, render numbers and render times.

use super::{BLUE, RED, cells_of};
use crate::ContentChangeTime;
use crate::event::{Event, PreviewSendReport};
use crate::fixtures::*;
use crate::messages;
use crate::pipeline::protocol::{
    self, CameraSaveResult, LastValidSceneRenderOutcome, PreviewUpdate, PreviewedImageState, Stage,
    StageStatus,
};
use crate::pipeline::settings::EffectiveSettingsSummary;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::FingerprintHasher;

const GREEN: [u8; 3] = [10, 200, 20];

/// Saves a scene that contains an error.
fn save_broken_scene(ui: &mut TestUi) {
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    ui.handle_event(Event::Settled);
}

/// Sends a preview of a finished or unfinished image.
fn preview(ui: &mut TestUi, name: &str, color: [u8; 3], is_finished: bool) {
    let generation = ui.state.request.generation;
    let source = Some(PreviewedImageState { image: FingerprintHasher::new(name).finish(), is_finished });
    let picture = uniform_picture(50, 38, color);
    let (range, section, lacks_photons) = (None, None, false);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range,
        section,
        lacks_photons,
        source,
    }));
}

/// Finishes a request whose render stage took `seconds`. The image took `of_image` seconds in total.
fn end(ui: &mut TestUi, unchanged: bool, seconds: f64, of_image: f64) {
    let generation = ui.state.request.generation;
    let mut event = done_event(generation, Vec::new(), unchanged);
    if let protocol::Event::Done { report, .. } = &mut event {
        let render = &mut report.stages[Stage::Render as usize];
        render.status = if unchanged { StageStatus::Reused } else { StageStatus::Done };
        (render.seconds, report.image.render_seconds, report.seconds) = (seconds, of_image, seconds);
    }
    ui.worker_event(event);
}

#[test]
fn fixing_a_typo_is_not_an_edit() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("shininess = 60");
    ui.finish_render(RED);
    ui.simulate_scene_save("shininess = 6");
    ui.report_scene_read();
    preview(&mut ui, "dull", BLUE, true);
    end(&mut ui, false, 1.0, 1.0);
    save_broken_scene(&mut ui);
    // The last valid scene is shown again, possibly with different dithering.
    preview(&mut ui, "dull", GREEN, true);
    ui.simulate_scene_save("shininess = 6");
    ui.report_scene_read();
    preview(&mut ui, "dull", GREEN, true);
    end(&mut ui, true, 0.0, 1.0);
    assert!(ui.screen_text().contains("unchanged · render 2"), "{}", ui.screen_text());
    assert!(
        ui.screen_text().contains("▸2 shininess") && !ui.screen_text().contains(messages::AGAIN),
        "{}",
        ui.screen_text()
    );
    ui.press_character('b');
    assert!(cells_of(&mut ui, RED) > 500, "{}", ui.screen_text());
    let text = ui.screen_text();
    assert!(text.contains(&format!("{}, 0 s ago", messages::render_number_of_count(1, 2))), "{text}");
    assert!(text.contains(&format!("\n{}, shininess 60 → 6  ", messages::BEFORE_EDIT)), "{text}");
    assert!(text.contains("b newest") && !text.contains("b shows"), "{text}");
}

#[test]
fn editing_a_comment_adds_no_entry() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("a = 1 # one");
    ui.report_scene_read();
    preview(&mut ui, "first", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    ui.simulate_scene_save("a = 1 # two");
    ui.report_scene_read();
    preview(&mut ui, "first", BLUE, true);
    end(&mut ui, true, 0.0, 1.0);
    assert_eq!((ui.state.preview.history.len(), ui.state.work.renders), (1, 1));
    ui.press_character('b');
    assert!(ui.screen_text().contains(messages::NO_EARLIER_RENDER), "{}", ui.screen_text());
}

#[test]
fn editing_the_output_path_adds_no_entry() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("camera.fov = 40");
    ui.report_scene_read();
    show_preview(&mut ui, "narrow", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    ui.simulate_scene_save("camera.fov = 44");
    ui.report_scene_read();
    show_preview(&mut ui, "wide", BLUE, true);
    end(&mut ui, false, 1.0, 1.0);
    ui.simulate_scene_save("camera.fov = 44\nrender.output = \"other.png\"");
    ui.report_scene_read();
    show_preview(&mut ui, "wide", BLUE, true);
    let generation = ui.state.request.generation;
    let mut event = done_event(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[Stage::Render as usize].status = StageStatus::Reused;
    }
    ui.worker_event(event);
    let text = ui.screen_text();
    // Another render wrote the image, but it results from the same edit.
    assert!(text.contains("· render 3") && text.contains("▸3 camera.fov"), "{text}");
    assert!(!text.contains("render.output"), "{text}");
    assert_eq!(ui.state.preview.history.len(), 2);
    ui.press_character('b');
    assert!(
        ui.screen_text().contains(&format!("{}, camera.fov 40 → 44  ", messages::BEFORE_EDIT)),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn resumed_render_time_is_cumulative() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("a = 1");
    ui.report_scene_read();
    preview(&mut ui, "first", RED, true);
    end(&mut ui, false, 5.8, 5.8);
    ui.press_character('r');
    ui.report_scene_read();
    preview(&mut ui, "first", BLUE, false);
    save_broken_scene(&mut ui);
    preview(&mut ui, "first", GREEN, false);
    ui.simulate_scene_save("a = 1");
    ui.report_scene_read();
    preview(&mut ui, "first", GREEN, false);
    let generation = ui.state.request.generation;
    let progress = protocol::RenderProgress { earlier_seconds: 4.5, ..render_progress(0.5, None) };
    ui.worker_event(protocol::Event::Progress { generation, progress });
    assert!(
        ui.screen_text().contains("32/64 samples · 4.5 s"),
        "time should be cumulative: {}",
        ui.screen_text()
    );
    preview(&mut ui, "first", BLUE, true);
    end(&mut ui, false, 4.23, 8.73);
    let text = ui.screen_text();
    assert!(text.contains("render 8.73 s +2.9 s"), "{text}");
    assert!(text.contains("8.73 s · render 2"), "{text}");
    assert_eq!(ui.state.preview.history.len(), 1, "{text}");
}

/// Shows a preview on the terminal.
fn show_preview(ui: &mut TestUi, name: &str, color: [u8; 3], is_finished: bool) {
    preview(ui, name, color, is_finished);
    let generation = ui.state.request.generation;
    ui.handle_event(Event::FirstPreviewSent { generation });
}

/// Reports that the render of the last valid scene has ended.
fn last_good(ui: &mut TestUi, end: LastValidSceneRenderOutcome) {
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::LastGoodEnded { generation, end });
}

const FINISHED: LastValidSceneRenderOutcome = LastValidSceneRenderOutcome::Finished { unchanged: false };

/// Finishes a render, makes an edit, and saves a typo while the edit is being rendered.
fn typo_during_a_render() -> TestUi {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("shininess = 60");
    ui.finish_render(RED);
    ui.simulate_scene_save("shininess = 6");
    ui.report_scene_read();
    show_preview(&mut ui, "dull", BLUE, false);
    save_broken_scene(&mut ui);
    show_preview(&mut ui, "dull", GREEN, false);
    ui
}

#[test]
fn render_of_last_valid_scene_is_counted_once() {
    let mut ui = typo_during_a_render();
    let newest = |ui: &mut TestUi| {
        let text = ui.screen_text();
        assert!(
            text.contains("▸2 shininess") && text.contains(&format!(" 1 {}", messages::OPENED)),
            "{text}"
        );
        assert!(!text.contains(messages::STOPPED), "{text}");
    };
    newest(&mut ui);
    last_good(&mut ui, FINISHED);
    assert_eq!(ui.state.work.renders, 2);
    // The last preview arrives after the render has ended.
    show_preview(&mut ui, "dull", BLUE, true);
    newest(&mut ui);
    for key in ['n', 'N'] {
        ui.press_character(key);
    }
    newest(&mut ui);
    ui.simulate_scene_save("shininess = 6");
    ui.report_scene_read();
    show_preview(&mut ui, "dull", BLUE, true);
    end(&mut ui, true, 0.0, 1.0);
    newest(&mut ui);
    assert!(ui.screen_text().contains("unchanged · render 2"), "{}", ui.screen_text());
    ui.simulate_scene_save("shininess = 5");
    ui.report_scene_read();
    show_preview(&mut ui, "duller", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 0 s ago", messages::render_number_of_count(2, 3))),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn stopped_render_of_last_valid_scene_is_marked() {
    let mut ui = typo_during_a_render();
    last_good(&mut ui, LastValidSceneRenderOutcome::Stopped);
    assert!(ui.screen_text().contains(&format!("▸– {}:", messages::STOPPED)), "{}", ui.screen_text());
    assert_eq!(ui.state.work.renders, 1);
}

#[test]
fn render_of_last_valid_scene_is_numbered() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("shininess = 60");
    ui.report_scene_read();
    show_preview(&mut ui, "bright", RED, true);
    end(&mut ui, false, 1.0, 1.0);
    save_broken_scene(&mut ui);
    show_preview(&mut ui, "bright", RED, true);
    last_good(&mut ui, LastValidSceneRenderOutcome::Finished { unchanged: true });
    assert_eq!((ui.state.preview.history.len(), ui.state.work.renders), (1, 1));
    for (run, name, words) in [(2, "hard", "shadows"), (3, "off", "shadows off")] {
        ui.press_character('s');
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
        for is_finished in [false, true] {
            show_preview(&mut ui, name, [7, run, u8::from(is_finished)], is_finished);
            assert!(ui.screen_text().contains(&format!("▸{run} {words}")), "{}", ui.screen_text());
            assert!(ui.screen_text().contains(&format!(" 1 {}", messages::OPENED)), "{}", ui.screen_text());
        }
        last_good(&mut ui, FINISHED);
        assert_eq!(ui.state.work.renders, u64::from(run));
        assert!(ui.screen_text().contains(&format!("▸{run} {words}")), "{}", ui.screen_text());
    }
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 0 s ago", messages::render_number_of_count(2, 3))),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn complete_image_is_not_listed_as_stopped() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    ui.press_character('s');
    ui.report_scene_read();
    // All samples have been rendered, but a key is pressed before the request is done.
    show_preview(&mut ui, "hard", GREEN, true);
    ui.press_character('s');
    ui.finish_render(BLUE);
    ui.press_character('n');
    let text = ui.screen_text();
    assert!(
        text.contains(&format!("{}, 0 s ago", messages::unnumbered_render_label(messages::OLDER)))
            && !text.contains(messages::STOPPED),
        "{text}"
    );
}

#[test]
fn entries_are_numbered_by_render() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    // Stopped renders are not counted.
    ui.press_character('s');
    ui.report_scene_read();
    preview(&mut ui, "hard", GREEN, false);
    ui.press_character('s');
    ui.finish_render(BLUE);
    let text = ui.screen_text();
    assert!(text.contains("· render 2") && text.contains("▸2 shadows off"), "{text}");
    assert!(
        text.contains(&format!("– {}:", messages::STOPPED))
            && text.contains(&format!(" 1 {}", messages::OPENED)),
        "{text}"
    );
    ui.press_character('n');
    assert!(
        ui.screen_text()
            .contains(&format!("{}, 0 s ago", messages::unnumbered_render_label(messages::STOPPED))),
        "{}",
        ui.screen_text()
    );
    assert!(
        ui.screen_text().contains(&format!(
            "{}: shadows hard · {}",
            messages::STOPPED,
            messages::HISTORY_KEYS.join(" · ")
        )),
        "{}",
        ui.screen_text()
    );
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 0 s ago", messages::render_number_of_count(1, 2))),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn age_counts_from_the_last_improvement() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.simulate_scene_save("shininess = 60");
    ui.report_scene_read();
    show_preview(&mut ui, "bright", RED, false);
    ui.advance_clock(8000);
    end(&mut ui, false, 8.0, 8.0);
    ui.advance_clock(3000);
    // Showing an image again, for example at a different size, does not change its age.
    show_preview(&mut ui, "bright", GREEN, true);
    ui.simulate_scene_save("shininess = 6");
    ui.report_scene_read();
    show_preview(&mut ui, "dull", BLUE, false);
    ui.advance_clock(2000);
    ui.press_character('n');
    assert!(
        ui.screen_text().contains(&format!("{}, 5 s ago", messages::render_number_of_count(1, 2))),
        "{}",
        ui.screen_text()
    );
    // The same applies to a stopped render.
    ui.press_character('N');
    show_preview(&mut ui, "dull", GREEN, false);
    ui.advance_clock(4000);
    ui.press_character('s');
    ui.advance_clock(1000);
    ui.finish_render(RED);
    ui.press_character('n');
    assert!(
        ui.screen_text()
            .contains(&format!("{}, 5 s ago", messages::unnumbered_render_label(messages::STOPPED))),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn reset_settings_are_listed_together() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    ui.press_character('s');
    ui.press_character('p');
    ui.finish_render(BLUE);
    ui.press_character('0');
    ui.finish_render(GREEN);
    ui.press_character('s');
    ui.finish_render(RED);
    ui.press_character('n');
    let words = format!("shadows and photons reset · {}", messages::HISTORY_KEYS.join(" · "));
    assert!(ui.screen_text().contains(&words), "{}", ui.screen_text());
}

#[test]
fn d_and_f_report_a_pinhole_camera() {
    for text in ["[camera]\nfov = 40", "[camera]\naperture = 0.0"] {
        let mut ui = TestUi::new();
        ui.simulate_scene_save(text);
        ui.report_scene_read();
        ui.state.request.effective = Some(EffectiveSettingsSummary { dof: false, ..effective_settings() });
        ui.state.request.own.as_mut().expect("a scene").camera.aperture = 0.0;
        ui.press_character('d');
        assert!(ui.screen_text().contains(messages::PINHOLE), "{}", ui.screen_text());
        ui.press_character('f');
        assert!(ui.screen_text().contains(messages::PINHOLE), "{}", ui.screen_text());
    }
}

#[test]
fn creating_a_model_scene_cannot_be_undone() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let (path, edit) = ("assets/knot.toml".into(), None);
    let kept = CameraSaveResult { path, is_new: true, is_own: false, of_model: true, edit };
    ui.worker_event(protocol::Event::CameraKept { generation: 1, outcome: Ok(kept) });
    ui.press_character('u');
    let words = messages::NEW_SCENE_STAYS;
    assert!(ui.screen_text().contains(words), "{}", ui.screen_text());
}

#[test]
fn unreadable_scene_has_no_save_hint() {
    let mut ui = TestUi::new();
    let folder = Diagnostic { place: None, ..diagnostic(Severity::Error, "a folder") };
    ui.report_scene_errors(vec![folder]);
    assert!(!ui.screen_text().contains("save "), "{}", ui.screen_text());
    ui.handle_event(Event::Settled);
    assert!(
        ui.screen_text().contains("a folder") && !ui.screen_text().contains("save "),
        "{}",
        ui.screen_text()
    );
    let mut ui = TestUi::new();
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `radus`")]);
    ui.handle_event(Event::Settled);
    assert!(
        ui.screen_text().contains(&messages::saving_starts_render_hint("cornell.toml", false)),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn eta_is_never_zero() {
    for (seconds, words) in [(0.0, "ETA under 1 s"), (0.04, "ETA under 1 s"), (0.06, "ETA 0.1 s")] {
        let mut ui = TestUi::new();
        ui.worker_event(protocol::Event::Progress {
            generation: 1,
            progress: render_progress(0.5, Some(seconds)),
        });
        assert!(ui.screen_text().contains(words), "{seconds}: {}", ui.screen_text());
    }
}

#[test]
fn status_line_items_are_separated() {
    let mut ui = TestUi::from_state(state(80, 24));
    ui.finish_render(RED);
    ui.press_character('l');
    ui.finish_render(BLUE);
    let settings = ui.state.request.effective.as_mut().expect("settings");
    (settings.width, settings.height) = (320, 180);
    let reused = |name| stage_report(name, StageStatus::Reused, 0.0, "");
    for name in [Stage::Parse, Stage::Meshes, Stage::Lights] {
        ui.state.work.stages[name as usize] = Some(reused(name));
    }
    for name in [Stage::Textures, Stage::Accel, Stage::Photons, Stage::Write] {
        ui.state.work.stages[name as usize] = None;
    }
    ui.state.display.frame = Some(PreviewSendReport { bytes: 131_000, round_trip: None });
    ui.press_character('m');
    ui.state.overlays.message = None;
    assert!(
        ui.screen_text().contains(&format!(
            "{}, {}",
            messages::cached_stage_count("3 stages"),
            messages::NOT_SAVED
        )),
        "{}",
        ui.screen_text()
    );
}
