//! Tests of the screen.

use std::time::Duration;

use proptest::prelude::*;
use ratatui::style::Color;

use super::{BLUE, RED, cells_of};
use crate::Changed;
use crate::color::ColorDepth;
use crate::event::FrameReport;
use crate::event::{Event, KeyPress};
use crate::fixtures::*;
use crate::keymap::KEYMAP;
use crate::pipeline::protocol::{self, Failure, RenderProgress, Stage, StageReport, Status};
use crate::pipeline::settings::{Overrides, View};
use crate::preview_kind::PreviewKind;
use crate::scene::diagnostic::Severity;

#[test]
fn the_picture_is_in_half_blocks_in_the_middle_of_its_area() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let screen = desk.screen();
    // 56 × 21 cells are as large as 50:38 gets in 21 rows, but for a column; the area begins in row 1.
    let cell = &screen[(25, 10)];
    assert_eq!((cell.symbol(), cell.fg, cell.bg), ("▀", Color::Rgb(200, 20, 10), Color::Rgb(200, 20, 10)));
    assert_eq!(cells_of(&mut desk, RED), 55 * 21);
    assert_ne!(screen[(56, 10)].symbol(), "▀", "the picture ends where the stages begin");
}

#[test]
fn upper_and_lower_pixels_are_foreground_and_background() {
    let mut desk = Desk::new();
    let generation = desk.state.request.generation;
    let mut picture = (*plain_picture(56, 42, RED)).clone();
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        if (i / 56) % 2 == 1 {
            *pixel = BLUE;
        }
    }
    desk.event(Event::Picture {
        generation,
        picture: picture.into(),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    let screen = desk.screen();
    for place in [(0, 1), (55, 21), (17, 9)] {
        assert_eq!((screen[place].fg, screen[place].bg), (Color::Rgb(200, 20, 10), Color::Rgb(10, 20, 200)));
    }
}

#[test]
fn without_colours_the_picture_is_a_ramp_and_nothing_has_a_colour() {
    let state = state_with(80, 24, PreviewKind::Ascii, ColorDepth::None, Overrides::default());
    let mut desk = Desk::with(state);
    desk.finish([255; 3]);
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    let screen = desk.screen();
    assert_eq!(screen[(25, 5)].symbol(), "@");
    assert!(screen.content.iter().all(|cell| cell.fg == Color::Reset && cell.bg == Color::Reset));
}

#[test]
fn what_a_picture_is_stretched_to_stands_beside_its_view() {
    let base = Overrides { view: Some(View::Depth), ..Overrides::default() };
    let state = state_with(120, 40, PreviewKind::HalfBlock, ColorDepth::TrueColor, base);
    let mut desk = Desk::with(state);
    for (range, words) in [
        (Some([2.704, 659.24]), "view depth 2.7 to 659 "),
        (Some([0.0, 0.012_34]), "view depth 0 to 0.0123 "),
        (Some([10.04, 1e-5]), "view depth 10 to 1.0e-5 "),
        (None, "view depth  "),
    ] {
        let generation = desk.state.request.generation;
        desk.event(Event::Picture {
            generation,
            picture: plain_picture(51, 40, RED),
            range,
            section: None,
            lacks_photons: false,
            source: None,
        });
        assert!(desk.text().contains(words), "{words}: {}", desk.text());
    }
}

#[test]
fn a_picture_that_lies_about_its_size_is_not_shown() {
    let mut desk = Desk::new();
    let mut picture = (*plain_picture(4, 4, RED)).clone();
    picture.pixels.truncate(3);
    desk.event(Event::Picture {
        generation: 1,
        picture: picture.into(),
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    assert!(desk.state.picture.shown.is_none());
}

#[test]
fn the_table_shows_each_stage_as_it_stands() {
    let mut desk = Desk::new();
    for report in [
        stage(Stage::Parse, Status::Done, 0.0004, ""),
        stage(Stage::Meshes, Status::Reused, 0.0, ""),
        stage(Stage::Photons, Status::Skipped, 0.0, "off"),
        stage(Stage::Render, Status::Running, 0.0, ""),
    ] {
        desk.worker(protocol::Event::Stage { generation: 1, stage: report });
    }
    let text = desk.text();
    for line in ["✓ parse    0.40 ms", "= meshes    reused", "· accel", "- photons  skipped", "> render"] {
        assert!(text.contains(line), "{line:?} is not in\n{text}");
    }
}

#[test]
fn the_bar_of_an_asset_fills_stays_a_moment_and_goes() {
    let mut desk = Desk::new();
    let asset = |done| protocol::Event::Asset { generation: 1, progress: asset("bricks", done, 8) };
    desk.worker(asset(3));
    let text = desk.text();
    assert!(text.contains("bricks") && text.contains("━━━─────  37 %"), "{text}");
    desk.worker(asset(8));
    desk.wait(100);
    assert!(desk.text().contains("━━━━━━━━ 100 %"));
    assert_eq!(desk.text().matches("bricks").count(), 1);
    desk.wait(400);
    assert!(desk.state.dirty);
    assert!(!desk.text().contains("bricks"));
}

#[test]
fn a_bar_goes_with_its_stage_and_moves_nothing() {
    let mut desk = Desk::new();
    let of = |name, status| protocol::Event::Stage { generation: 1, stage: stage(name, status, 0.1, "") };
    let row = |desk: &mut Desk, words: &str| desk.text().lines().position(|line| line.contains(words));
    desk.worker(of(Stage::Photons, Status::Running));
    let hint = row(&mut desk, "save cornell.toml");
    assert!(hint.is_some(), "{}", desk.text());
    desk.worker(protocol::Event::Asset { generation: 1, progress: asset("photons", 2, 2) });
    assert!(desk.text().contains("━━━━━━━━ 100 %") && row(&mut desk, "save cornell.toml") == hint);
    desk.worker(of(Stage::Photons, Status::Done));
    assert!(!desk.text().contains("100 %") && row(&mut desk, "save cornell.toml") == hint, "{}", desk.text());
    // Nor does one outlive the render.
    desk.worker(protocol::Event::Asset { generation: 1, progress: asset("knot.obj", 2, 2) });
    desk.worker(done(1, Vec::new(), false));
    assert!(!desk.text().contains("knot.obj"), "{}", desk.text());
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn no_eta_is_shown_early_and_none_is_absurd() {
    let mut desk = Desk::new();
    let mut eta = |progress: RenderProgress| {
        desk.worker(protocol::Event::Progress { generation: 1, progress });
        desk.text().lines().next().and_then(|row| Some(row.split_once("ETA ")?.1.trim().to_owned()))
    };
    assert_eq!(eta(progress(0.004, Some(16_686_900.0))).as_deref(), Some("…"));
    assert_eq!(
        eta(RenderProgress { elapsed_seconds: 0.3, ..progress(0.4, Some(2e9)) }).as_deref(),
        Some("…")
    );
    assert_eq!(eta(progress(0.02, Some(16_686_900.0))).as_deref(), Some("over a day"));
    assert_eq!(eta(progress(0.02, Some(7200.0))).as_deref(), Some("2 h 00 min"));
}

#[test]
fn the_render_bar_tells_percent_samples_and_what_is_to_go() {
    let mut desk = Desk::new();
    desk.now += Duration::from_millis(1200);
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.25, None) });
    assert!(
        desk.text().contains("25 %  ETA …") && desk.text().contains("16/64 samples · 1.2 s"),
        "{}",
        desk.text()
    );
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, Some(125.0)) });
    assert!(desk.text().contains("50 %  ETA 2 min 05 s"), "{}", desk.text());
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(1.0, Some(0.0)) });
    desk.worker(done(1, Vec::new(), false));
    let text = desk.text();
    assert!(text.contains("1.93 s · run 1\n") && !text.contains(['━', '─']), "{text}");
}

#[test]
fn a_written_image_is_named_with_its_size() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.worker(protocol::Event::Written {
        generation: 1,
        path: "out/cornell.png".into(),
        bytes: 210_400,
        is_own: true,
    });
    let text = desk.text();
    for words in ["→ out/cornell.png", "  210.4 kB, 640×480"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    assert!(!text.contains("wrote"), "the keys stay in sight\n{text}");
}

#[test]
fn a_key_that_writes_is_answered_when_all_files_are_written() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let written =
        |path: &str| protocol::Event::Written { generation: 1, path: path.into(), bytes: 1, is_own: true };
    let done = || protocol::Event::WriteDone { generation: 1, paths: vec!["a.png".into(), "b.ppm".into()] };
    desk.press('w');
    desk.worker(written("a.png"));
    // The same key before the second file of the first order is written.
    desk.press('w');
    desk.worker(written("b.ppm"));
    assert!(!desk.text().contains("wrote"), "{}", desk.text());
    for _ in 0..2 {
        desk.worker(done());
        assert!(desk.text().contains("wrote a.png, b.ppm"), "{}", desk.text());
    }
    // A request that came in between does not keep the answer back.
    desk.press('w');
    desk.press('r');
    desk.worker(done());
    assert!(desk.text().contains("wrote a.png, b.ppm"), "{}", desk.text());
}

#[test]
fn words_beside_a_stage_are_not_cut_in_the_middle() {
    let mut desk = Desk::new();
    let stage = |why: &str| StageReport {
        name: Stage::Meshes,
        status: Status::Skipped,
        seconds: 0.0,
        processor_seconds: 0.0,
        why: why.to_owned(),
    };
    desk.worker(protocol::Event::Stage { generation: 1, stage: stage("no need") });
    desk.event(Event::Resize(window(100, 24)));
    assert!(desk.text().contains("skipped  no need"), "{}", desk.text());
    desk.event(Event::Resize(window(80, 24)));
    desk.worker(protocol::Event::Stage { generation: 1, stage: stage("the scene names none") });
    assert!(desk.text().contains("  the scene names none"), "{}", desk.text());
    desk.worker(protocol::Event::Stage { generation: 1, stage: stage("there is none in this scene") });
    let text = desk.text();
    assert!(text.contains("  there is none in this") && text.contains("  scene"), "{text}");
    // Below the picture there is one row for each.
    desk.event(Event::Resize(window(80, 37)));
    assert!(
        !desk.text().contains("there is none in this scene") && desk.text().contains("skipped"),
        "{}",
        desk.text()
    );
    desk.worker(protocol::Event::Stage { generation: 1, stage: stage("the scene names none") });
    desk.event(Event::Resize(window(200, 60)));
    assert!(desk.text().contains("the scene names none"), "{}", desk.text());
}

#[test]
fn a_stage_that_failed_does_not_look_at_work() {
    let mut desk = Desk::new();
    let stage = StageReport {
        name: Stage::Parse,
        status: Status::Running,
        seconds: 0.0,
        processor_seconds: 0.0,
        why: String::new(),
    };
    desk.worker(protocol::Event::Stage { generation: 1, stage });
    assert!(desk.text().contains("> parse"));
    let failure = Failure::Scene(vec![diagnostic(Severity::Error, "wrong")]);
    desk.worker(protocol::Event::Failed { generation: 1, failure });
    assert!(!desk.text().contains("parse"), "the stages of a broken scene tell nothing: {}", desk.text());
}

#[test]
fn renders_are_counted_and_requests_that_change_nothing_are_not() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.text().contains("· run 1"), "{}", desk.text());
    desk.press('0');
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.worker(done(2, Vec::new(), true));
    assert!(desk.text().contains("unchanged · run 1"), "{}", desk.text());
    desk.press('r');
    desk.worker(done(3, Vec::new(), false));
    assert!(desk.text().contains("· run 2"), "{}", desk.text());
}

#[test]
fn a_file_that_is_gone_is_missing_and_not_broken() {
    let mut desk = Desk::with(state(120, 30));
    desk.finish(RED);
    let absent = *crate::scene::text_now("no-such-folder/cornell.toml".as_ref()).expect_err("an error");
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(vec![absent]);
    desk.event(Event::Settled);
    let text = desk.text();
    assert!(text.starts_with(" ✗ missing "), "{text}");
    assert!(!text.contains("broken") && text.contains("stays until the file is back"), "{text}");
    desk.fail(vec![diagnostic(Severity::Error, "unknown key")]);
    assert!(desk.text().starts_with(" ✗ broken "), "{}", desk.text());
}

#[test]
fn a_broken_file_keeps_the_picture_and_shows_the_place() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let before = cells_of(&mut desk, RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    desk.event(Event::Settled);
    let text = desk.text();
    for words in [
        "error: unknown key `heigth`",
        "scenes/cornell.toml:3:1",
        "3 | heigth = 4",
        "| ^^^^^^ here",
        "help: did you mean `height`?",
        "─ 1 error ─",
        "broken",
    ] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
    let after = cells_of(&mut desk, RED);
    assert!(after >= before / 2, "{after} of {before} cells are left");

    desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(desk.text().contains("heigth"), "the pane stays until the file is whole");
    desk.finish(BLUE);
    assert!(!desk.text().contains("heigth"));
    assert_eq!((cells_of(&mut desk, BLUE), cells_of(&mut desk, RED)), (before, 0));
}

#[test]
fn long_errors_are_scrolled_and_stop_at_their_ends() {
    let mut desk = Desk::new();
    desk.fail((0..9).map(|i| diagnostic(Severity::Error, &format!("wrong number {i}"))).collect());
    assert!(desk.text().contains("wrong number 0") && !desk.text().contains("wrong number 8"));
    assert!(desk.text().contains("9 errors"));
    let down = KeyPress::special(crossterm::event::KeyCode::PageDown);
    let up = KeyPress::special(crossterm::event::KeyCode::Up);
    for _ in 0..100 {
        desk.key(down);
    }
    let text = desk.text();
    assert!(text.contains("wrong number 8") && !text.contains("wrong number 0"), "{text}");
    desk.screen();
    desk.key(down);
    assert!(!desk.state.dirty, "the end is the end");
    for _ in 0..100 {
        desk.key(up);
    }
    assert!(desk.text().contains("wrong number 0"));
}

#[test]
fn work_that_failed_is_said_in_the_pane() {
    let mut desk = Desk::new();
    let failure = Failure::Work("cannot write /nowhere/a.png: no such folder".to_owned());
    desk.worker(protocol::Event::Failed { generation: 1, failure });
    assert!(desk.text().contains("error: cannot write /nowhere/a.png"), "{}", desk.text());
}

#[test]
fn a_conflict_opens_the_pane_once_and_stays_until_it_is_solved() {
    let mut desk = Desk::new();
    let conflict = || vec![diagnostic(Severity::Error, "cannot write a.png")];
    let refused = || protocol::Event::Refused { generation: 1, conflicts: conflict() };
    desk.worker(refused());
    assert!(
        desk.text().contains("error: cannot write a.png") && desk.text().contains("1 error"),
        "{}",
        desk.text()
    );
    assert!(desk.text().contains("nothing is written"));
    assert!(desk.state.work.is_running(), "the render goes on");
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!desk.text().contains("cannot write a.png"));
    desk.worker(refused());
    assert!(!desk.text().contains("cannot write a.png"), "a person has seen and closed it");
    let warning = diagnostic(Severity::Warning, "texture `b` is not used");
    desk.worker(done(1, [conflict(), vec![warning]].concat(), false));
    assert!(desk.text().contains("e 1 error, 1 warning"), "{}", desk.text());
    desk.press('e');
    assert!(desk.text().contains("cannot write a.png"));
    desk.worker(done(1, Vec::new(), false));
    assert!(!desk.text().contains("error"), "{}", desk.text());
}

#[test]
fn names_with_escape_sequences_come_out_harmless() {
    let evil = "a\u{1b}]52;c;eA==\u{7}\u{9b}31m\u{202e}b\rc";
    let mut desk = Desk::new();
    desk.state.request.scene = evil.into();
    desk.worker(protocol::Event::Asset { generation: 1, progress: asset(evil, 1, 2) });
    desk.worker(protocol::Event::Stage {
        generation: 1,
        stage: stage(Stage::Parse, Status::Done, 0.1, evil),
    });
    desk.worker(protocol::Event::Written { generation: 1, path: evil.into(), bytes: 1, is_own: true });
    let harmless = |text: &str| {
        assert!(text.contains('␛'), "{text}");
        assert!(text.chars().all(|c| c == '\n' || !(c.is_control() || c == '\u{202e}')), "{text:?}");
    };
    harmless(&desk.text());
    let mut broken = diagnostic(Severity::Error, evil);
    broken.path = evil.into();
    broken.help = Some(evil.to_owned());
    desk.fail(vec![broken]);
    harmless(&desk.text());
    desk.worker(protocol::Event::Failed { generation: 1, failure: Failure::Work(evil.to_owned()) });
    harmless(&desk.text());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn no_window_and_no_history_panics(
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
            PreviewKind::HalfBlock,
            PreviewKind::Quadrant,
            PreviewKind::Sextant,
            PreviewKind::Octant,
            PreviewKind::Ascii,
            PreviewKind::None,
        ][kind];
        let depth = [ColorDepth::TrueColor, ColorDepth::Indexed256, ColorDepth::Ansi16, ColorDepth::None][depth];
        let mut desk = Desk::with(state_with(columns, rows, kind, depth, Overrides::default()));
        desk.state.display.window.cell_aspect = aspect;
        let mut keys = keys.iter();
        for step in script {
            let generation = desk.state.request.generation;
            match step {
                0 => desk.fail(vec![diagnostic(Severity::Error, "a rather long message that has to be wrapped"); 3]),
                1 => desk.finish(RED),
                2 => { desk.worker(protocol::Event::Asset { generation, progress: asset("long name of a texture", 1, 2) }); }
                3 => { desk.worker(protocol::Event::Progress { generation, progress: progress(0.3, Some(9.0)) }); }
                4 => {
                    let picture = plain_picture(picture.0, picture.1, BLUE);
                    desk.event(Event::Picture { generation, picture, range: None, section: None, lacks_photons: false, source: None });
                }
                5 => { desk.event(Event::Resize(window(rows, columns.min(80)))); }
                6 => { desk.wait(300); }
                _ => {
                    if let Some(key) = keys.next() {
                        desk.key(KEYMAP[*key].keys[0]);
                    }
                }
            }
            desk.screen();
        }
        desk.screen();
    }
}

#[test]
fn a_picture_that_could_not_be_written_is_not_called_done() {
    let mut desk = Desk::new();
    let generation = desk.state.request.generation;
    desk.worker(protocol::Event::WriteFailed {
        generation,
        path: None,
        message: "cannot write a.png: disk full".to_owned(),
    });
    desk.worker(done(generation, Vec::new(), false));
    let first = |desk: &mut Desk| desk.text().lines().next().map(str::to_owned).unwrap_or_default();
    assert!(first(&mut desk).contains("! unwritten") && !desk.text().contains("✓ done"), "{}", desk.text());
    desk.press('y');
    assert!(desk.text().contains("not written: e says why"), "{}", desk.text());
    // `e` shows the reason again.
    desk.press('e');
    assert!(
        desk.text().contains("─ 1 error ─") && desk.text().contains("error: cannot write a.png: disk full")
    );
    desk.press('e');
    assert!(!desk.text().contains("disk full"), "{}", desk.text());
    desk.worker(protocol::Event::Written { generation, path: "a.png".into(), bytes: 1, is_own: true });
    assert!(first(&mut desk).contains("✓ done"), "{}", desk.text());
}

/// The screen behind its first line, in one line.
fn below(desk: &mut Desk) -> String {
    let text = desk.text();
    let words = text.lines().skip(1).flat_map(str::split_whitespace);
    words.filter(|word| !word.starts_with('▀')).collect::<Vec<_>>().join(" ")
}

#[test]
fn a_file_of_another_picture_is_not_named() {
    for (columns, rows) in [(80, 24), (120, 40), (100, 20)] {
        let mut desk = Desk::with(state(columns, rows));
        let written = |generation| protocol::Event::Written {
            generation,
            path: "a.png".into(),
            bytes: 1,
            is_own: true,
        };
        let failed = |generation, message: &str| protocol::Event::WriteFailed {
            generation,
            path: Some("a.png".into()),
            message: message.to_owned(),
        };
        desk.worker(written(1));
        desk.finish(super::RED);
        assert!(below(&mut desk).contains("→ a.png"), "{}", desk.text());
        // The next picture cannot be written: the file holds the one before.
        desk.event(Event::Changed(crate::Changed { noticed: desk.now }));
        desk.worker(protocol::Event::Started { generation: 2 });
        desk.worker(failed(2, "cannot write a.png: denied"));
        desk.worker(done(2, Vec::new(), false));
        desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
        assert!(!below(&mut desk).contains("→ a.png"), "{}", desk.text());
        // It can again.
        desk.press('w');
        desk.worker(written(2));
        desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
        assert!(
            below(&mut desk).contains("→ a.png") && !desk.text().contains("unwritten"),
            "{}",
            desk.text()
        );
        // Written by a key once more, it fails: nobody knows what is there.
        desk.press('w');
        desk.worker(failed(2, "cannot write a.png: gone"));
        desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
        let first = desk.text().lines().next().map(str::to_owned).unwrap_or_default();
        assert!(first.contains("! unwritten") && !below(&mut desk).contains("→ a.png"), "{}", desk.text());
        desk.press('e');
        assert!(desk.text().contains("cannot write a.png: gone"), "{}", desk.text());
        let words = "not written: cannot write a.png: gone; before that, wrote a.png";
        assert_eq!(crate::exit_summary::words(&desk.state), words);
    }
}

#[test]
fn an_order_to_write_that_fails_while_a_render_goes_on_says_nothing_of_its_end() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Started { generation: 1 });
    desk.press('w');
    let message = "cannot write a.png: full".to_owned();
    desk.worker(protocol::Event::WriteFailed { generation: 1, path: Some("a.png".into()), message });
    desk.worker(protocol::Event::Written { generation: 1, path: "a.png".into(), bytes: 1, is_own: true });
    desk.finish(super::RED);
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(desk.text().contains("✓ done") && below(&mut desk).contains("→ a.png"), "{}", desk.text());
}

#[test]
fn the_way_back_is_offered_once_and_where_something_was_changed() {
    let mut desk = Desk::with(state(200, 60));
    desk.finish(RED);
    let keys = |desk: &mut Desk| desk.text().lines().last().map(str::to_owned).unwrap_or_default();
    assert!(!keys(&mut desk).contains("0 "), "{}", keys(&mut desk));
    desk.press('s');
    desk.finish(RED);
    assert!(keys(&mut desk).contains("0 reset"), "{}", keys(&mut desk));
    desk.press('l');
    desk.finish(RED);
    let keys = keys(&mut desk);
    assert!(keys.contains("0 reset camera") && keys.matches("0 reset").count() == 1, "{keys}");
}

#[test]
fn what_the_last_picture_took_is_in_words_where_there_is_room() {
    let mut desk = Desk::with(state(120, 40));
    desk.finish(RED);
    // All stages alike leave no room for it.
    desk.state.work.stages = Default::default();
    desk.state.saving.edits = 1;
    desk.state.display.frame =
        Some(FrameReport { bytes: 30_500, round_trip: Some(Duration::from_millis(150)) });
    assert!(desk.text().contains("31 kB sent, answered in 150 ms"), "{}", desk.text());
    desk.event(Event::Resize(window(30, 20)));
    assert!(desk.text().contains("31 kB sent") && !desk.text().contains("150 ms"), "{}", desk.text());
    desk.event(Event::Resize(window(9, 20)));
    assert!(!desk.text().contains("kB"), "{}", desk.text());
}

#[test]
fn the_folder_stands_before_the_name() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.text().contains("scenes/cornell.toml  640×480"), "{}", desk.text());
    desk.event(Event::Resize(window(40, 12)));
    assert!(!desk.text().contains("scenes"), "{}", desk.text());
}

#[test]
fn a_change_of_time_that_has_no_room_is_left_out() {
    let mut desk = Desk::with(state(100, 24));
    desk.finish(RED);
    desk.state.work.last_seconds[Stage::Render as usize] = Some(4.0);
    desk.press('r');
    desk.state.work.stages[Stage::Render as usize] = Some(stage(Stage::Render, Status::Done, 0.35, ""));
    assert!(desk.text().contains("render    350 ms −3.65 s"), "{}", desk.text());
    // The gap before the time is the first to go.
    desk.event(Event::Resize(window(80, 24)));
    assert!(desk.text().contains("✓ render 350 ms −3.65 s"), "{}", desk.text());
    desk.state.work.last_seconds[Stage::Render as usize] = Some(200.0);
    let text = desk.text();
    assert!(text.contains("render    350 ms") && !text.contains('−'), "{text}");
}

#[test]
fn a_picture_that_lacks_photons_is_said_to() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Started { generation: 1 });
    desk.worker(protocol::Event::Stage {
        generation: 1,
        stage: stage(Stage::Photons, Status::Running, 0.0, ""),
    });
    assert!(!desk.text().contains("without photons"), "there is no picture yet");
    let picture = |lacks_photons| Event::Picture {
        generation: 1,
        picture: plain_picture(50, 38, RED),
        range: None,
        section: None,
        lacks_photons,
        source: None,
    };
    desk.event(picture(true));
    assert!(desk.text().contains("shown without photons yet"), "{}", desk.text());
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.1, None) });
    assert!(desk.text().contains("shown without photons yet"), "as long as that picture is shown");
    desk.event(picture(false));
    assert!(!desk.text().contains("without photons"), "{}", desk.text());
}
