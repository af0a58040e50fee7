//! Tests for images written with `w`: text on the screen and in the exit summary.

use super::{BLUE, RED};
use crate::ContentChangeTime;
use crate::event::{Effect, Event, KeyPress};
use crate::exit_summary::summary_text;
use crate::fixtures::*;
use crate::messages;
use crate::options::{ExternalChange, OutputChange};
use crate::pipeline::protocol::{self, Command, SampleCounts, SavedSceneRenderStatus, Stage, StageStatus};
use crate::scene::diagnostic::Severity;

/// Creates a UI that has started to render the scene's own image.
fn ui_with_begun_render(columns: u16, rows: u16) -> TestUi {
    let mut ui = TestUi::from_state(state(columns, rows));
    ui.report_scene_read();
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.1, None) });
    ui
}

fn own_image(ui: &mut TestUi, state: SavedSceneRenderStatus) {
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::OwnImage { generation, state });
}

/// Finishes the current request without writing its image.
fn finish_unwritten(ui: &mut TestUi, color: [u8; 3]) {
    let generation = ui.state.request.generation;
    ui.report_scene_read();
    ui.show_preview(color);
    let mut done = done_event(generation, ui.state.overlays.warnings.clone(), false);
    if let protocol::Event::Done { report, .. } = &mut done {
        (report.image.path, report.image.paths) = (None, Vec::new());
        report.stages[Stage::Write as usize].status = StageStatus::Skipped;
    }
    ui.worker_event(done);
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
}

/// Presses `w` and reports the written image, with these sample counts if it is unfinished.
fn write(ui: &mut TestUi, is_own: bool, unfinished: Option<SampleCounts>) {
    ui.press_character('w');
    let generation = ui.state.request.generation;
    let path = "cornell.png".into();
    ui.worker_event(protocol::Event::Written { generation, path, bytes: 1, is_own, unfinished });
    ui.worker_event(protocol::Event::WriteDone { generation, paths: vec!["cornell.png".into()] });
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
}

#[track_caller]
fn assert_shows(ui: &mut TestUi, words: &str) {
    // A side panel wraps its text next to the preview, so remove the preview's cells between the lines.
    let text: String = ui.screen_text().chars().filter(|it| *it != '▀' && !it.is_whitespace()).collect();
    let words: String = words.chars().filter(|it| !it.is_whitespace()).collect();
    assert!(text.contains(&words), "{words}: {}", ui.screen_text());
}

#[test]
fn w_writes_the_newest_step() {
    let mut ui = ui_with_begun_render(80, 24);
    ui.press_character(']');
    assert!(ui.press_character(']').is_empty(), "the step should wait for the first step's preview");
    let effects = ui.press_character('w');
    assert_eq!(sent_render_request(&effects).expect("the waiting step").overrides.exposure, Some(0.5));
    assert!(matches!(effects.last(), Some(Effect::Send(Command::Write))), "{effects:?}");
    let generation = ui.state.request.generation;
    ui.worker_event(written_event(generation, "cornell.png", false));
    assert!(summary_text(&ui.state).ends_with("with exposure +0.5"), "{}", summary_text(&ui.state));
}

const PART: SampleCounts = SampleCounts { min: 16, mean: 20.0, max: 32 };

#[test]
fn image_written_on_request_is_named_until_replaced() {
    let with = "written with exposure +0.25";
    for (columns, rows) in [(80, 24), (120, 40), (100, 20)] {
        let mut ui = ui_with_begun_render(columns, rows);
        ui.press_character(']');
        own_image(&mut ui, SavedSceneRenderStatus::Begun { is_rendering: true });
        write(&mut ui, false, Some(PART));
        let part = "wrote cornell.png: unfinished (16 to 32 samples), with exposure +0.25";
        assert_eq!(summary_text(&ui.state), part);
        finish_unwritten(&mut ui, BLUE);
        assert_eq!(summary_text(&ui.state), part);
        assert_shows(&mut ui, &messages::written_image_unfinished("cornell.png"));
        assert!(
            !ui.screen_text().contains("→ cornell.png"),
            "a partial image should not be listed: {}",
            ui.screen_text()
        );
        // Show another image, then the scene's own image, which does not replace the written one.
        ui.press_character('s');
        own_image(&mut ui, SavedSceneRenderStatus::Begun { is_rendering: false });
        finish_unwritten(&mut ui, RED);
        assert_shows(&mut ui, messages::NOT_SAVED);
        assert_shows(&mut ui, &messages::image_written_with_changes("cornell.png", "exposure +0.25"));
        ui.press_character('0');
        finish_unwritten(&mut ui, RED);
        assert_eq!(summary_text(&ui.state), part);
        assert_shows(&mut ui, &messages::written_image_differs("cornell.png", "exposure +0.25"));
        assert!(
            !ui.screen_text().contains("→ cornell.png"),
            "the old image should not be listed: {}",
            ui.screen_text()
        );
        write(&mut ui, true, None);
        assert_eq!(summary_text(&ui.state), "wrote cornell.png: 640×480, 64 samples, 1.93 s");
        assert_shows(&mut ui, "→ cornell.png");
        assert!(!ui.screen_text().contains(with), "{}", ui.screen_text());
    }
}

#[test]
fn complete_image_written_early_is_described() {
    let mut ui = ui_with_begun_render(80, 24);
    ui.press_character('v');
    write(&mut ui, false, None);
    finish_unwritten(&mut ui, BLUE);
    assert_eq!(summary_text(&ui.state), "wrote cornell.png: view normal, 640×480, 64 samples, 1.93 s");
    assert_shows(&mut ui, "→ cornell.png");
}

#[test]
fn written_image_is_outdated_only_after_a_save() {
    let mut ui = ui_with_begun_render(80, 24);
    ui.press_character('s');
    own_image(&mut ui, SavedSceneRenderStatus::NotBegun);
    finish_unwritten(&mut ui, BLUE);
    write(&mut ui, false, None);
    ui.press_character(']');
    own_image(&mut ui, SavedSceneRenderStatus::NotBegun);
    finish_unwritten(&mut ui, BLUE);
    assert_shows(&mut ui, &messages::image_written_with_changes("cornell.png", "shadows hard"));
    assert!(!ui.screen_words().contains("older than your last"), "{}", ui.screen_text());
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    own_image(&mut ui, SavedSceneRenderStatus::NotBegun);
    finish_unwritten(&mut ui, RED);
    assert_shows(&mut ui, &messages::scene_image_file_outdated("cornell.png"));
    assert!(!ui.screen_text().contains("written with"), "{}", ui.screen_text());
    assert!(summary_text(&ui.state).ends_with("(older than your last edit)"), "{}", summary_text(&ui.state));
}

/// Reports a conflict with an existing file.
fn report_conflict(ui: &mut TestUi) {
    let conflicts = vec![diagnostic(Severity::Error, "cannot write cornell.png: it is another image")];
    ui.worker_event(protocol::Event::Refused { generation: ui.state.request.generation, conflicts });
}

#[test]
fn w_is_offered_only_if_it_replaces_the_file() {
    for (lost, is_kept) in [
        (ExternalChange::Removed, false),
        (ExternalChange::Replaced, false),
        (ExternalChange::ReplacedByOtherScene, true),
        (ExternalChange::ReplacedByForeign, true),
    ] {
        let mut ui = TestUi::from_state(state(120, 40));
        ui.worker_event(written_event(1, "cornell.png", true));
        ui.finish_render(RED);
        ui.handle_event(Event::OutputChanged(OutputChange { path: "cornell.png".into(), lost: Some(lost) }));
        let words =
            if is_kept { messages::output_not_overwritten } else { messages::output_modified_externally };
        assert_shows(&mut ui, &words("cornell.png", lost.describe()));
        ui.press_character(']');
        finish_unwritten(&mut ui, BLUE);
        assert_shows(&mut ui, &words("cornell.png", lost.describe()));
        assert_eq!(
            ui.screen_text().contains(messages::NOT_SAVED),
            !is_kept,
            "{lost:?}: {}",
            ui.screen_text()
        );
    }
}

#[test]
fn conflict_hides_hints_about_saving_with_w() {
    let mut ui = TestUi::from_state(state(120, 40));
    report_conflict(&mut ui);
    finish_unwritten(&mut ui, RED);
    for key in ['l', 'v'] {
        ui.press_character(key);
        assert!(
            ui.screen_text().contains("preview only") && !ui.screen_text().contains("w: save"),
            "{}",
            ui.screen_text()
        );
        own_image(&mut ui, SavedSceneRenderStatus::Begun { is_rendering: false });
        ui.worker_event(protocol::Event::Started { generation: ui.state.request.generation });
        report_conflict(&mut ui);
        finish_unwritten(&mut ui, BLUE);
        assert_shows(&mut ui, messages::NOT_SAVED_WITH_CONFLICT);
        for words in [messages::NOT_SAVED, "continues it", "renders it"] {
            assert!(!ui.screen_text().contains(words), "{words}: {}", ui.screen_text());
        }
    }
}
