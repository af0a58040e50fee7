//! Tests for the whole screen.

use std::time::Duration;

use proptest::prelude::*;
use ratatui::style::Color;

use super::{BLUE, RED, cells_of};
use crate::ContentChangeTime;
use crate::color::ColorDepth;
use crate::event::PreviewSendReport;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::keymap::KEYMAP;
use crate::messages;
use crate::pipeline::protocol::{
    self, Failure, PreviewUpdate, RenderProgress, Stage, StageReport, StageStatus,
};
use crate::pipeline::settings::{Overrides, ViewMode};
use crate::preview_style::PreviewStyle;
use crate::scene::diagnostic::Severity;

#[test]
fn preview_uses_half_blocks_in_the_middle() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let screen = ui.draw_screen();
    // In 21 rows, an image with an aspect ratio of 50:38 could be 56 columns wide, but one column is left
    // blank. The area starts in row 1.
    let cell = &screen[(25, 10)];
    assert_eq!((cell.symbol(), cell.fg, cell.bg), ("▀", Color::Rgb(200, 20, 10), Color::Rgb(200, 20, 10)));
    assert_eq!(cells_of(&mut ui, RED), 55 * 21);
    assert_ne!(screen[(56, 10)].symbol(), "▀", "the image should end at the panel");
}

#[test]
fn half_blocks_show_two_pixels() {
    let mut ui = TestUi::new();
    let generation = ui.state.request.generation;
    let mut picture = (*uniform_picture(56, 42, RED)).clone();
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        if (i / 56) % 2 == 1 {
            *pixel = BLUE;
        }
    }
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture: picture.into(),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    let screen = ui.draw_screen();
    for place in [(0, 1), (55, 21), (17, 9)] {
        assert_eq!((screen[place].fg, screen[place].bg), (Color::Rgb(200, 20, 10), Color::Rgb(10, 20, 200)));
    }
}

#[test]
fn preview_without_colors_uses_characters() {
    let state = state_with(80, 24, PreviewStyle::Ascii, ColorDepth::None, Overrides::default());
    let mut ui = TestUi::from_state(state);
    ui.finish_render([255; 3]);
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    let screen = ui.draw_screen();
    assert_eq!(screen[(25, 5)].symbol(), "@");
    assert!(screen.content.iter().all(|cell| cell.fg == Color::Reset && cell.bg == Color::Reset));
}

#[test]
fn value_range_is_shown_after_the_view_name() {
    let base = Overrides { view: Some(ViewMode::Depth), ..Overrides::default() };
    let state = state_with(120, 40, PreviewStyle::HalfBlock, ColorDepth::TrueColor, base);
    let mut ui = TestUi::from_state(state);
    for (range, words) in [
        (Some([2.704, 659.24]), "view depth 2.7 to 659 "),
        (Some([0.0, 0.012_34]), "view depth 0 to 0.0123 "),
        (Some([10.04, 1e-5]), "view depth 10 to 1.0e-5 "),
        (None, "view depth  "),
    ] {
        let generation = ui.state.request.generation;
        ui.handle_event(Event::Preview(PreviewUpdate {
            generation,
            picture: uniform_picture(51, 40, RED),
            range,
            section: None,
            lacks_photons: false,
            source: None,
        }));
        assert!(ui.screen_text().contains(words), "{words}: {}", ui.screen_text());
    }
}

#[test]
fn wrongly_sized_image_is_not_shown() {
    let mut ui = TestUi::new();
    let mut picture = (*uniform_picture(4, 4, RED)).clone();
    picture.pixels.truncate(3);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation: 1,
        picture: picture.into(),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    assert!(ui.state.preview.shown.is_none());
}

#[test]
fn table_shows_the_status_of_each_stage() {
    let mut ui = TestUi::new();
    for report in [
        stage_report(Stage::Parse, StageStatus::Done, 0.0004, ""),
        stage_report(Stage::Meshes, StageStatus::Reused, 0.0, ""),
        stage_report(Stage::Photons, StageStatus::Skipped, 0.0, "off"),
        stage_report(Stage::Render, StageStatus::Running, 0.0, ""),
    ] {
        ui.worker_event(protocol::Event::Stage { generation: 1, stage: report });
    }
    let text = ui.screen_text();
    for line in ["✓ parse    0.40 ms", "= meshes    reused", "· accel", "- photons  skipped", "> render"] {
        assert!(text.contains(line), "{line:?} not found in\n{text}");
    }
}

#[test]
fn asset_bar_stays_briefly_when_full() {
    let mut ui = TestUi::new();
    let asset = |done| protocol::Event::Asset { generation: 1, progress: asset_progress("bricks", done, 8) };
    ui.worker_event(asset(3));
    let text = ui.screen_text();
    assert!(text.contains("bricks") && text.contains("━━━─────  37 %"), "{text}");
    ui.worker_event(asset(8));
    ui.advance_clock(100);
    assert!(ui.screen_text().contains("━━━━━━━━ 100 %"));
    assert_eq!(ui.screen_text().matches("bricks").count(), 1);
    ui.advance_clock(400);
    assert!(ui.state.dirty);
    assert!(!ui.screen_text().contains("bricks"));
}

#[test]
fn asset_bar_disappears_with_its_stage() {
    let mut ui = TestUi::new();
    let of =
        |name, status| protocol::Event::Stage { generation: 1, stage: stage_report(name, status, 0.1, "") };
    let row = |ui: &mut TestUi, words: &str| ui.screen_text().lines().position(|line| line.contains(words));
    ui.worker_event(of(Stage::Photons, StageStatus::Running));
    let hint = row(&mut ui, "save cornell.toml");
    assert!(hint.is_some(), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::Asset { generation: 1, progress: asset_progress("photons", 2, 2) });
    assert!(ui.screen_text().contains("━━━━━━━━ 100 %") && row(&mut ui, "save cornell.toml") == hint);
    ui.worker_event(of(Stage::Photons, StageStatus::Done));
    assert!(
        !ui.screen_text().contains("100 %") && row(&mut ui, "save cornell.toml") == hint,
        "{}",
        ui.screen_text()
    );
    // Progress bars disappear when the render ends.
    ui.worker_event(protocol::Event::Asset { generation: 1, progress: asset_progress("knot.obj", 2, 2) });
    ui.worker_event(done_event(1, Vec::new(), false));
    assert!(!ui.screen_text().contains("knot.obj"), "{}", ui.screen_text());
    assert_eq!(ui.state.next_tick(), None);
}

#[test]
fn eta_is_shown_only_if_plausible() {
    let mut ui = TestUi::new();
    let mut eta = |progress: RenderProgress| {
        ui.worker_event(protocol::Event::Progress { generation: 1, progress });
        ui.screen_text().lines().next().and_then(|row| Some(row.split_once("ETA ")?.1.trim().to_owned()))
    };
    assert_eq!(eta(render_progress(0.004, Some(16_686_900.0))).as_deref(), Some("…"));
    assert_eq!(
        eta(RenderProgress { elapsed_seconds: 0.3, ..render_progress(0.4, Some(2e9)) }).as_deref(),
        Some("…")
    );
    assert_eq!(eta(render_progress(0.02, Some(16_686_900.0))).as_deref(), Some("over a day"));
    assert_eq!(eta(render_progress(0.02, Some(7200.0))).as_deref(), Some("2 h 00 min"));
}

#[test]
fn render_bar_shows_percent_samples_and_eta() {
    let mut ui = TestUi::new();
    ui.now += Duration::from_millis(1200);
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.25, None) });
    assert!(
        ui.screen_text().contains("25 %  ETA …") && ui.screen_text().contains("16/64 samples · 1.2 s"),
        "{}",
        ui.screen_text()
    );
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.5, Some(125.0)) });
    assert!(ui.screen_text().contains("50 %  ETA 2 min 05 s"), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(1.0, Some(0.0)) });
    ui.worker_event(done_event(1, Vec::new(), false));
    let text = ui.screen_text();
    assert!(text.contains("1.93 s · render 1\n") && !text.contains(['━', '─']), "{text}");
}

#[test]
fn written_file_is_shown_with_its_size() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    ui.worker_event(protocol::Event::Written {
        generation: 1,
        path: "out/cornell.png".into(),
        bytes: 210_400,
        is_own: true,
        unfinished: None,
    });
    let text = ui.screen_text();
    for words in ["→ out/cornell.png", "  210.4 kB, 640×480"] {
        assert!(text.contains(words), "{words:?} not found in\n{text}");
    }
    assert!(!text.contains("wrote"), "the keys should be visible\n{text}");
}

#[test]
fn write_is_confirmed_after_all_files() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let written = |path: &str| written_event(1, path, true);
    let done = || protocol::Event::WriteDone { generation: 1, paths: vec!["a.png".into(), "b.ppm".into()] };
    ui.press_character('w');
    ui.worker_event(written("a.png"));
    // The key is pressed again before the first write has written its second file.
    ui.press_character('w');
    ui.worker_event(written("b.ppm"));
    assert!(!ui.screen_text().contains("wrote"), "{}", ui.screen_text());
    for _ in 0..2 {
        ui.worker_event(done());
        assert!(ui.screen_text().contains(&messages::files_written("a.png, b.ppm")), "{}", ui.screen_text());
    }
    // An intervening request does not prevent the confirmation.
    ui.press_character('w');
    ui.press_character('r');
    ui.worker_event(done());
    assert!(ui.screen_text().contains(&messages::files_written("a.png, b.ppm")), "{}", ui.screen_text());
}

#[test]
fn stage_reasons_are_wrapped_between_words() {
    let mut ui = TestUi::new();
    let stage = |why: &str| StageReport {
        name: Stage::Meshes,
        status: StageStatus::Skipped,
        seconds: 0.0,
        processor_seconds: 0.0,
        why: why.to_owned(),
    };
    let (short, long) = ("not in the scene", "not needed in this scene");
    ui.worker_event(protocol::Event::Stage { generation: 1, stage: stage("unneeded") });
    ui.handle_event(Event::Resize(window(100, 24)));
    assert!(ui.screen_text().contains("skipped  unneeded"), "{}", ui.screen_text());
    ui.handle_event(Event::Resize(window(80, 24)));
    ui.worker_event(protocol::Event::Stage { generation: 1, stage: stage(short) });
    assert!(ui.screen_text().contains(&format!("  {short}")), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::Stage { generation: 1, stage: stage(long) });
    let text = ui.screen_text();
    assert!(text.contains(&format!("  {}", &long[..18])) && text.contains("  scene"), "{text}");
    // Below the image, each stage takes a single row.
    ui.handle_event(Event::Resize(window(80, 37)));
    assert!(!ui.screen_text().contains(long) && ui.screen_text().contains("skipped"), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::Stage { generation: 1, stage: stage(short) });
    ui.handle_event(Event::Resize(window(200, 60)));
    assert!(ui.screen_text().contains(short), "{}", ui.screen_text());
}

#[test]
fn failed_stage_is_not_shown_as_running() {
    let mut ui = TestUi::new();
    let stage = StageReport {
        name: Stage::Parse,
        status: StageStatus::Running,
        seconds: 0.0,
        processor_seconds: 0.0,
        why: String::new(),
    };
    ui.worker_event(protocol::Event::Stage { generation: 1, stage });
    assert!(ui.screen_text().contains("> parse"));
    let failure = Failure::Scene(vec![diagnostic(Severity::Error, "wrong")]);
    ui.worker_event(protocol::Event::Failed { generation: 1, failure });
    assert!(
        !ui.screen_text().contains("parse"),
        "stages of a broken scene should be hidden: {}",
        ui.screen_text()
    );
}

#[test]
fn only_renders_with_changes_are_counted() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(ui.screen_text().contains("· render 1"), "{}", ui.screen_text());
    ui.press_character('0');
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.worker_event(done_event(2, Vec::new(), true));
    assert!(ui.screen_text().contains("unchanged · render 1"), "{}", ui.screen_text());
    ui.press_character('r');
    ui.worker_event(done_event(3, Vec::new(), false));
    assert!(ui.screen_text().contains("· render 2"), "{}", ui.screen_text());
}

#[test]
fn deleted_file_is_reported_as_missing() {
    let mut ui = TestUi::from_state(state(120, 30));
    ui.finish_render(RED);
    let absent =
        *crate::scene::read_scene_file_text("no-such-folder/cornell.toml".as_ref()).expect_err("an error");
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(vec![absent]);
    ui.handle_event(Event::Settled);
    let text = ui.screen_text();
    assert!(text.starts_with(" ✗ missing "), "{text}");
    assert!(!text.contains("broken") && text.contains(messages::LAST_GOOD_RENDER), "{text}");
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown key")]);
    assert!(ui.screen_text().starts_with(" ✗ broken "), "{}", ui.screen_text());
}

#[test]
fn broken_file_keeps_the_image() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    let before = cells_of(&mut ui, RED);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(vec![diagnostic(Severity::Error, "unknown `heigth`")]);
    ui.handle_event(Event::Settled);
    let text = ui.screen_text();
    for words in [
        "error: unknown `heigth`",
        "scenes/cornell.toml:3:1",
        "3 | heigth = 4",
        "| ^^^^^^ here",
        "help: did you mean `height`?",
        "─ 1 error ─",
        "broken",
    ] {
        assert!(text.contains(words), "{words:?} not found in\n{text}");
    }
    let after = cells_of(&mut ui, RED);
    assert!(after >= before / 2, "{after} of {before} cells");

    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    assert!(ui.screen_text().contains("heigth"), "the pane should stay open until the file is read");
    ui.finish_render(BLUE);
    assert!(!ui.screen_text().contains("heigth"));
    assert_eq!((cells_of(&mut ui, BLUE), cells_of(&mut ui, RED)), (before, 0));
}

#[test]
fn long_diagnostics_scroll_to_their_ends() {
    let mut ui = TestUi::new();
    ui.report_scene_errors(
        (0..9).map(|i| diagnostic(Severity::Error, &format!("wrong number {i}"))).collect(),
    );
    assert!(ui.screen_text().contains("wrong number 0") && !ui.screen_text().contains("wrong number 8"));
    assert!(ui.screen_text().contains("9 errors"));
    let down = KeyPress::special(crossterm::event::KeyCode::PageDown);
    let up = KeyPress::special(crossterm::event::KeyCode::Up);
    for _ in 0..100 {
        ui.press_key(down);
    }
    let text = ui.screen_text();
    assert!(text.contains("wrong number 8") && !text.contains("wrong number 0"), "{text}");
    ui.draw_screen();
    ui.press_key(down);
    assert!(!ui.state.dirty, "at the end");
    for _ in 0..100 {
        ui.press_key(up);
    }
    assert!(ui.screen_text().contains("wrong number 0"));
}

#[test]
fn render_failure_is_shown_in_the_pane() {
    let mut ui = TestUi::new();
    let failure = Failure::Work("unwritable".to_owned());
    ui.worker_event(protocol::Event::Failed { generation: 1, failure });
    assert!(ui.screen_text().contains("error: unwritable"), "{}", ui.screen_text());
}

#[test]
fn conflict_opens_the_pane_once() {
    let mut ui = TestUi::new();
    let conflict = || vec![diagnostic(Severity::Error, "readonly a.png")];
    let refused = || protocol::Event::Refused { generation: 1, conflicts: conflict() };
    ui.worker_event(refused());
    assert!(
        ui.screen_text().contains("error: readonly") && ui.screen_text().contains("1 error"),
        "{}",
        ui.screen_text()
    );
    assert!(ui.state.saving.unwritten.is_some() && ui.screen_text().contains(messages::NOT_WRITTEN));
    assert!(ui.state.work.is_request_running(), "the render should continue");
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!ui.screen_text().contains("readonly a.png"));
    ui.worker_event(refused());
    assert!(!ui.screen_text().contains("readonly a.png"), "the user closed the pane");
    let warning = diagnostic(Severity::Warning, "texture `b` is not used");
    ui.worker_event(done_event(1, [conflict(), vec![warning]].concat(), false));
    assert!(ui.screen_text().contains("e 1 error, 1 warning"), "{}", ui.screen_text());
    ui.press_character('e');
    assert!(ui.screen_text().contains("readonly a.png"));
    ui.worker_event(done_event(1, Vec::new(), false));
    assert!(!ui.screen_text().contains("error"), "{}", ui.screen_text());
}

#[test]
fn escape_sequences_in_names_are_harmless() {
    let evil = "a\u{1b}]52;c;eA==\u{7}\u{9b}31m\u{202e}b\rc";
    let mut ui = TestUi::new();
    ui.state.request.scene = evil.into();
    ui.worker_event(protocol::Event::Asset { generation: 1, progress: asset_progress(evil, 1, 2) });
    ui.worker_event(protocol::Event::Stage {
        generation: 1,
        stage: stage_report(Stage::Parse, StageStatus::Done, 0.1, evil),
    });
    ui.worker_event(written_event(1, evil, true));
    let harmless = |text: &str| {
        assert!(text.contains('␛'), "{text}");
        assert!(text.chars().all(|c| c == '\n' || !(c.is_control() || c == '\u{202e}')), "{text:?}");
    };
    harmless(&ui.screen_text());
    let mut broken = diagnostic(Severity::Error, evil);
    broken.path = evil.into();
    broken.help = Some(evil.to_owned());
    ui.report_scene_errors(vec![broken]);
    harmless(&ui.screen_text());
    ui.worker_event(protocol::Event::Failed { generation: 1, failure: Failure::Work(evil.to_owned()) });
    harmless(&ui.screen_text());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn no_window_size_or_history_panics(
        columns in 1_u16..250,
        rows in 1_u16..80,
        aspect in 1.2_f32..3.5,
        kind in 0..6_usize,
        depth in 0..4_usize,
        picture in (1_u32..90, 1_u32..90),
        script in prop::collection::vec(0..9_u8, 0..14),
        keys in prop::collection::vec(0..KEYMAP.len(), 0..14),
    ) {
        let kind = [
            PreviewStyle::HalfBlock,
            PreviewStyle::Quadrant,
            PreviewStyle::Sextant,
            PreviewStyle::Octant,
            PreviewStyle::Ascii,
            PreviewStyle::None,
        ][kind];
        let depth = [ColorDepth::TrueColor, ColorDepth::Indexed256, ColorDepth::Ansi16, ColorDepth::None][depth];
        let mut ui = TestUi::from_state(state_with(columns, rows, kind, depth, Overrides::default()));
        ui.state.display.window.cell_aspect = aspect;
        let mut keys = keys.iter();
        for step in script {
            let generation = ui.state.request.generation;
            match step {
                0 => ui.report_scene_errors(vec![diagnostic(Severity::Error, "a rather long message that has to be wrapped"); 3]),
                1 => ui.finish_render(RED),
                2 => { ui.worker_event(protocol::Event::Asset { generation, progress: asset_progress("long name of a texture", 1, 2) }); }
                3 => { ui.worker_event(protocol::Event::Progress { generation, progress: render_progress(0.3, Some(9.0)) }); }
                4 => {
                    let picture = uniform_picture(picture.0, picture.1, BLUE);
                    ui.handle_event(Event::Preview(PreviewUpdate { generation, picture, range: None, section: None, lacks_photons: false, source: None }));
                }
                5 => { ui.handle_event(Event::Resize(window(rows, columns.min(80)))); }
                6 => { ui.advance_clock(300); }
                _ => {
                    if let Some(key) = keys.next() {
                        ui.press_key(KEYMAP[*key].keys[0]);
                    }
                }
            }
            ui.draw_screen();
        }
        ui.draw_screen();
    }
}

#[test]
fn unwritten_image_is_not_shown_as_done() {
    let mut ui = TestUi::new();
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::WriteFailed {
        generation,
        path: None,
        message: "a.png: disk full".to_owned(),
    });
    ui.worker_event(done_event(generation, Vec::new(), false));
    let first = |ui: &mut TestUi| ui.screen_text().lines().next().map(str::to_owned).unwrap_or_default();
    assert!(
        first(&mut ui).contains("! unwritten") && !ui.screen_text().contains("✓ done"),
        "{}",
        ui.screen_text()
    );
    ui.press_character('y');
    assert!(ui.screen_text().contains(messages::NOT_WRITTEN), "{}", ui.screen_text());
    // Pressing `e` shows the reason again.
    ui.press_character('e');
    assert!(ui.screen_text().contains("─ 1 error ─") && ui.screen_text().contains("error: a.png"));
    ui.press_character('e');
    assert!(!ui.screen_text().contains("disk full"), "{}", ui.screen_text());
    ui.worker_event(written_event(generation, "a.png", true));
    assert!(first(&mut ui).contains("✓ done"), "{}", ui.screen_text());
}

/// The screen below the header, joined into one line.
fn text_below_header(ui: &mut TestUi) -> String {
    let text = ui.screen_text();
    let words = text.lines().skip(1).flat_map(str::split_whitespace);
    words.filter(|word| !word.starts_with('▀')).collect::<Vec<_>>().join(" ")
}

#[test]
fn files_of_other_images_are_not_listed() {
    for (columns, rows) in [(80, 24), (120, 40), (100, 20)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        let written = |generation| written_event(generation, "a.png", true);
        let failed = |generation, message: &str| protocol::Event::WriteFailed {
            generation,
            path: Some("a.png".into()),
            message: message.to_owned(),
        };
        ui.worker_event(written(1));
        ui.finish_render(super::RED);
        assert!(text_below_header(&mut ui).contains("→ a.png"), "{}", ui.screen_text());
        // The next image could not be written, so the file still contains the previous one.
        ui.handle_event(Event::FileChanged(crate::ContentChangeTime { noticed: ui.now }));
        ui.worker_event(protocol::Event::Started { generation: 2 });
        ui.worker_event(failed(2, "a.png: denied"));
        ui.worker_event(done_event(2, Vec::new(), false));
        ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
        assert!(!text_below_header(&mut ui).contains("→ a.png"), "{}", ui.screen_text());
        // Writing succeeds again.
        ui.press_character('w');
        ui.worker_event(written(2));
        ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
        assert!(
            text_below_header(&mut ui).contains("→ a.png") && !ui.screen_text().contains("unwritten"),
            "{}",
            ui.screen_text()
        );
        // Another write, requested with a key, fails. The file's content is now unknown.
        ui.press_character('w');
        ui.worker_event(failed(2, "a.png: gone"));
        ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
        let first = ui.screen_text().lines().next().map(str::to_owned).unwrap_or_default();
        assert!(
            first.contains("! unwritten") && !text_below_header(&mut ui).contains("→ a.png"),
            "{}",
            ui.screen_text()
        );
        ui.press_character('e');
        assert!(ui.screen_text().contains("a.png: gone"), "{}", ui.screen_text());
        let words = "not written: a.png: gone; before that, wrote a.png";
        assert_eq!(crate::exit_summary::summary_text(&ui.state), words);
    }
}

#[test]
fn write_failure_is_cleared_by_a_later_write() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Started { generation: 1 });
    ui.press_character('w');
    let message = "cannot write a.png: full".to_owned();
    ui.worker_event(protocol::Event::WriteFailed { generation: 1, path: Some("a.png".into()), message });
    ui.worker_event(written_event(1, "a.png", true));
    ui.finish_render(super::RED);
    ui.press_key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(
        ui.screen_text().contains("✓ done") && text_below_header(&mut ui).contains("→ a.png"),
        "{}",
        ui.screen_text()
    );
}

#[test]
fn reset_is_offered_once_after_a_change() {
    let mut ui = TestUi::from_state(state(200, 60));
    ui.finish_render(RED);
    let keys = |ui: &mut TestUi| ui.screen_text().lines().last().map(str::to_owned).unwrap_or_default();
    assert!(!keys(&mut ui).contains("0 "), "{}", keys(&mut ui));
    ui.press_character('s');
    ui.finish_render(RED);
    assert!(keys(&mut ui).contains("0 reset"), "{}", keys(&mut ui));
    ui.press_character('l');
    ui.finish_render(RED);
    let keys = keys(&mut ui);
    assert!(keys.contains("reset camera") && keys.matches("0 reset").count() == 1, "{keys}");
}

#[test]
fn preview_cost_is_shown_if_it_fits() {
    let mut ui = TestUi::from_state(state(120, 40));
    ui.finish_render(RED);
    // If all stages are listed, there is no space for the preview cost.
    ui.state.work.stages = Default::default();
    ui.state.saving.edits = 1;
    ui.state.display.frame =
        Some(PreviewSendReport { bytes: 30_500, round_trip: Some(Duration::from_millis(150)) });
    assert!(
        ui.screen_text().contains(&messages::preview_bytes_and_round_trip(31, Some(150))),
        "{}",
        ui.screen_text()
    );
    ui.handle_event(Event::Resize(window(30, 20)));
    assert!(
        ui.screen_text().contains("31 kB sent") && !ui.screen_text().contains("150 ms"),
        "{}",
        ui.screen_text()
    );
    ui.handle_event(Event::Resize(window(9, 20)));
    assert!(!ui.screen_text().contains("kB"), "{}", ui.screen_text());
}

#[test]
fn folder_is_shown_only_if_it_fits() {
    let mut ui = TestUi::new();
    ui.finish_render(RED);
    assert!(ui.screen_text().contains("/cornell.toml  640×480"), "{}", ui.screen_text());
    ui.handle_event(Event::Resize(window(40, 12)));
    assert!(!ui.screen_text().contains("scenes"), "{}", ui.screen_text());
}

#[test]
fn time_differences_are_omitted_if_too_wide() {
    let mut ui = TestUi::from_state(state(100, 24));
    ui.finish_render(RED);
    ui.state.work.last_seconds[Stage::Render as usize] = Some(4.0);
    ui.press_character('r');
    ui.state.work.stages[Stage::Render as usize] =
        Some(stage_report(Stage::Render, StageStatus::Done, 0.35, ""));
    assert!(ui.screen_text().contains("render    350 ms −3.65 s"), "{}", ui.screen_text());
    // The gap before the time is dropped first.
    ui.handle_event(Event::Resize(window(80, 24)));
    assert!(ui.screen_text().contains("✓ render 350 ms −3.65 s"), "{}", ui.screen_text());
    ui.state.work.last_seconds[Stage::Render as usize] = Some(200.0);
    let text = ui.screen_text();
    assert!(text.contains("render    350 ms") && !text.contains('−'), "{text}");
}

#[test]
fn preview_without_photons_is_marked() {
    let mut ui = TestUi::new();
    ui.worker_event(protocol::Event::Started { generation: 1 });
    ui.worker_event(protocol::Event::Stage {
        generation: 1,
        stage: stage_report(Stage::Photons, StageStatus::Running, 0.0, ""),
    });
    assert!(!ui.screen_text().contains(messages::WITHOUT_PHOTONS), "no preview yet");
    let picture = |lacks_photons| {
        Event::Preview(PreviewUpdate {
            generation: 1,
            picture: uniform_picture(50, 38, RED),
            range: None,
            section: None,
            lacks_photons,
            source: None,
        })
    };
    ui.handle_event(picture(true));
    assert!(ui.screen_text().contains(messages::WITHOUT_PHOTONS), "{}", ui.screen_text());
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.1, None) });
    assert!(
        ui.screen_text().contains(messages::WITHOUT_PHOTONS),
        "the mark should last as long as that preview"
    );
    ui.handle_event(picture(false));
    assert!(!ui.screen_text().contains(messages::WITHOUT_PHOTONS), "{}", ui.screen_text());
}
