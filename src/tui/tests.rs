//! The front end driven by scripted events, on a screen without a terminal.

use std::time::Duration;

use proptest::prelude::*;
use ratatui::style::Color;

use super::action::Action;
use super::color::ColorDepth;
use super::event::{Effect, Event, KeyPress, Signal, Source};
use super::fixtures::*;
use super::keymap::KEYMAP;
use super::state::{Activity, PreviewKind};
use super::{Changed, ExitStatus};
use crate::pipeline::protocol::{self, Command, Failure, PreviewSize, Stage, Status};
use crate::pipeline::settings::{Overrides, View};
use crate::scene::description::Shadows;
use crate::scene::diagnostic::Severity;

const RED: [u8; 3] = [200, 20, 10];
const BLUE: [u8; 3] = [10, 20, 200];

fn cells_of(desk: &mut Desk, rgb: [u8; 3]) -> usize {
    let color = Color::Rgb(rgb[0], rgb[1], rgb[2]);
    desk.screen().content.iter().filter(|cell| cell.symbol() == "▀" && cell.fg == color).count()
}

#[test]
fn the_first_request_has_room_for_the_preview() {
    let mut state = state(80, 24);
    let effects = super::update::start(&mut state);
    let request = request(&effects).expect("a request");
    assert_eq!(request.preview, Some(PreviewSize { width: 51, height: 40 }));
    assert_eq!((request.generation, request.write, request.force), (1, true, false));
}

#[test]
fn the_picture_is_in_half_blocks_in_the_middle_of_its_area() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let screen = desk.screen();
    // 51 × 20 cells have room for 51 × 39 of 50:38; the area begins in row 1.
    let cell = &screen[(25, 10)];
    assert_eq!((cell.symbol(), cell.fg, cell.bg), ("▀", Color::Rgb(200, 20, 10), Color::Rgb(200, 20, 10)));
    assert_eq!(cells_of(&mut desk, RED), 51 * 20);
    assert_ne!(screen[(51, 10)].symbol(), "▀", "the picture ends where the stages begin");
}

#[test]
fn upper_and_lower_pixels_are_foreground_and_background() {
    let mut desk = Desk::new();
    let generation = desk.state.generation;
    let mut picture = (*plain_picture(51, 40, RED)).clone();
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        if (i / 51) % 2 == 1 {
            *pixel = BLUE;
        }
    }
    desk.event(Event::Picture { generation, picture: picture.into() });
    let screen = desk.screen();
    for place in [(0, 1), (50, 20), (17, 9)] {
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
fn pictures_of_older_generations_are_dropped() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let old = desk.state.generation;
    desk.press('r');
    desk.screen();
    desk.event(Event::Picture { generation: old, picture: plain_picture(50, 38, BLUE) });
    desk.worker(protocol::Event::Progress { generation: old, progress: progress(0.5, None) });
    desk.worker(protocol::Event::Failed { generation: old, failure: Failure::Work("old".to_owned()) });
    assert!(!desk.state.dirty, "nothing is drawn for them");
    assert!(desk.state.progress.is_none() && desk.state.problems.is_none());
    assert_eq!(cells_of(&mut desk, BLUE), 0);
    assert!(cells_of(&mut desk, RED) > 0, "the last picture stands until there is a newer one");
}

#[test]
fn a_picture_that_lies_about_its_size_is_not_shown() {
    let mut desk = Desk::new();
    let mut picture = (*plain_picture(4, 4, RED)).clone();
    picture.pixels.truncate(3);
    desk.event(Event::Picture { generation: 1, picture: picture.into() });
    assert!(desk.state.picture.is_none());
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
    for line in
        ["✓ parse     0.40 ms", "= meshes     reused", "· accel", "- photons   skipped  off", "> render"]
    {
        assert!(text.contains(line), "{line:?} is not in\n{text}");
    }
}

#[test]
fn the_bar_of_an_asset_fills_stays_a_moment_and_goes() {
    let mut desk = Desk::new();
    let asset = |done| protocol::Event::Asset { generation: 1, progress: asset("bricks", done, 8) };
    desk.worker(asset(3));
    let text = desk.text();
    assert!(text.contains("bricks") && text.contains("███░░░░░  37%"), "{text}");
    desk.worker(asset(8));
    desk.wait(100);
    assert!(desk.text().contains("████████ 100%"));
    assert_eq!(desk.text().matches("bricks").count(), 1);
    desk.wait(400);
    assert!(desk.state.dirty);
    assert!(!desk.text().contains("bricks"));
}

#[test]
fn a_full_bar_goes_after_the_render_too() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Asset { generation: 1, progress: asset("knot.obj", 2, 2) });
    desk.worker(done(1, Vec::new(), false));
    assert!(desk.text().contains("knot.obj"));
    let wake = desk.state.next_tick().expect("the bar asks to be woken");
    assert!(wake > desk.now && wake <= desk.now + Duration::from_millis(500));
    desk.wait(500);
    assert!(!desk.text().contains("knot.obj"));
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn the_render_bar_tells_percent_samples_and_what_is_to_go() {
    let mut desk = Desk::new();
    desk.now += Duration::from_millis(1200);
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.25, None) });
    assert!(desk.text().contains("25% · samples 16/64 · 1.2 s · ETA …"), "{}", desk.text());
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(0.5, Some(125.0)) });
    assert!(desk.text().contains("50% · samples 32/64 · 1.2 s · ETA 2 min 05 s"), "{}", desk.text());
    desk.worker(protocol::Event::Progress { generation: 1, progress: progress(1.0, Some(0.0)) });
    desk.worker(done(1, Vec::new(), false));
    let text = desk.text();
    assert!(text.contains("100% · samples 64/64 · total 1.93 s") && !text.contains('░'), "{text}");
}

#[test]
fn a_written_image_is_named_with_its_size() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.worker(protocol::Event::Written { generation: 1, path: "out/cornell.png".into(), bytes: 210_400 });
    let text = desk.text();
    for words in ["image out/cornell.png", "640×480 px, 210.4 kB", "wrote out/cornell.png"] {
        assert!(text.contains(words), "{words:?} is not in\n{text}");
    }
}

#[test]
fn a_broken_file_keeps_the_picture_and_shows_the_place() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let before = cells_of(&mut desk, RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.fail(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
    let text = desk.text();
    for words in [
        "error: unknown key `heigth`",
        "scenes/cornell.toml:3:1",
        "3 | heigth = 4",
        "| ^^^^^^ here",
        "help: did you mean `height`?",
        "1 error",
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
    for _ in 0..20 {
        desk.key(down);
    }
    assert!(desk.text().contains("wrong number 8") && !desk.text().contains("wrong number 0"));
    desk.screen();
    desk.key(down);
    assert!(!desk.state.dirty, "the end is the end");
    for _ in 0..20 {
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
fn warnings_are_counted_and_shown_on_demand() {
    let mut desk = Desk::new();
    desk.worker(done(1, vec![diagnostic(Severity::Warning, "texture `b` is not used")], false));
    assert!(desk.text().contains("1 warning") && !desk.text().contains("not used"));
    desk.press('e');
    assert!(desk.text().contains("warning: texture `b` is not used"));
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!desk.text().contains("not used"));
}

#[test]
fn names_with_escape_sequences_come_out_harmless() {
    let evil = "a\u{1b}]52;c;eA==\u{7}\u{9b}31m\u{202e}b\rc";
    let mut desk = Desk::new();
    desk.state.scene = evil.into();
    desk.worker(protocol::Event::Asset { generation: 1, progress: asset(evil, 1, 2) });
    desk.worker(protocol::Event::Stage {
        generation: 1,
        stage: stage(Stage::Parse, Status::Done, 0.1, evil),
    });
    desk.worker(protocol::Event::Written { generation: 1, path: evil.into(), bytes: 1 });
    let harmless = |text: &str| {
        assert!(text.contains('\u{fffd}'), "{text}");
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

#[test]
fn the_first_change_is_measured_from_the_save_to_the_frame() {
    let mut desk = Desk::new();
    desk.finish(RED);
    let noticed = desk.now;
    desk.now += Duration::from_millis(3);
    let effects = desk.event(Event::Changed(Changed { noticed }));
    assert_eq!(request(&effects).map(|it| it.generation), Some(2));
    desk.event(Event::Shown { generation: 1 });
    assert_eq!(desk.state.first_change, None, "the old picture does not count");
    desk.event(Event::Picture { generation: 2, picture: plain_picture(50, 38, BLUE) });
    desk.now += Duration::from_millis(20);
    desk.event(Event::Shown { generation: 2 });
    assert!(desk.text().contains("first change after 23 ms"), "{}", desk.text());
    desk.now += Duration::from_millis(20);
    desk.event(Event::Shown { generation: 2 });
    assert!(!desk.state.dirty && desk.text().contains("after 23 ms"), "measured once");
}

#[test]
fn only_the_first_picture_of_a_request_does_not_wait_for_its_turn() {
    let mut desk = Desk::new();
    let picture = |desk: &mut Desk, generation| {
        desk.state.urgent = false;
        desk.event(Event::Picture { generation, picture: plain_picture(50, 38, RED) });
        desk.state.urgent
    };
    assert!(picture(&mut desk, 1));
    assert!(!picture(&mut desk, 1));
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(!picture(&mut desk, 1), "an old one is no news");
    assert!(picture(&mut desk, 2));
    assert!(!picture(&mut desk, 2));
}

#[test]
fn nothing_is_drawn_when_nothing_changed() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.screen();
    desk.press('x');
    desk.wait(10_000);
    desk.event(Event::Shown { generation: 1 });
    desk.worker(protocol::Event::Preview { generation: 1 });
    desk.key(KeyPress::special(crossterm::event::KeyCode::Up));
    assert!(!desk.state.dirty);
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn the_clock_runs_while_rendering_and_stands_while_paused() {
    let mut desk = Desk::new();
    desk.screen();
    assert!(desk.state.next_tick().is_some());
    desk.wait(250);
    assert!(desk.state.dirty);
    desk.press(' ');
    desk.screen();
    assert_eq!(desk.state.next_tick(), None);
}

#[test]
fn another_window_asks_for_another_preview_once_it_is_quiet() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.event(Event::Resize(window(120, 40))).is_empty());
    assert!(cells_of(&mut desk, RED) > 51 * 20, "the picture at hand is scaled meanwhile");
    desk.now += Duration::from_millis(50);
    desk.event(Event::Resize(window(200, 60)));
    assert!(desk.wait(100).is_empty());
    let effects = desk.wait(50);
    let request = request(&effects).expect("a request");
    assert_eq!(request.preview, desk.state.preview_size());
    assert_eq!(request.preview, Some(PreviewSize { width: 153, height: 112 }));
    assert!(!request.force);
    desk.finish(RED);
    desk.event(Event::Resize(window(200, 60)));
    assert!(desk.wait(1000).is_empty(), "the same size asks for nothing");
}

#[test]
fn a_long_render_is_not_given_up_for_the_window() {
    let mut desk = Desk::new();
    desk.now += Duration::from_secs(5);
    desk.event(Event::Resize(window(120, 40)));
    assert!(desk.wait(200).is_empty());
    let effects = desk.worker(done(1, Vec::new(), false));
    assert!(request(&effects).is_some(), "it is asked for afterwards");
}

#[test]
fn a_comment_edited_renders_nothing_and_says_so() {
    let mut desk = Desk::new();
    desk.finish(RED);
    desk.event(Event::Changed(Changed { noticed: desk.now }));
    desk.worker(protocol::Event::Started { generation: 2 });
    desk.worker(done(2, Vec::new(), true));
    assert!(desk.text().contains("unchanged"));
    assert!(cells_of(&mut desk, RED) > 0);
}

/// Every key of the table does what its line says. The match has an arm for every action.
#[test]
fn every_key_has_its_effect() {
    for binding in KEYMAP {
        for key in binding.keys {
            let mut desk = Desk::new();
            desk.finish(RED);
            check(binding.action, *key, &mut desk);
        }
    }
}

fn check(action: Action, key: KeyPress, desk: &mut Desk) {
    let overrides = |effects: &[Effect]| request(effects).map(|it| it.overrides.clone());
    match action {
        Action::CycleShadows => {
            for wanted in [Shadows::Hard, Shadows::Off, Shadows::Soft] {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").shadows, Some(wanted));
            }
        }
        Action::ToggleDepthOfField => {
            for wanted in [false, true] {
                let effects = desk.key(key);
                assert_eq!(overrides(&effects).expect("a request").dof, Some(wanted));
            }
        }
        Action::TogglePhotons => {
            assert!(desk.key(key).is_empty());
            assert!(desk.text().contains("photons come with a later version"));
        }
        Action::NextView | Action::PreviousView => {
            let effects = desk.key(key);
            let wanted = if action == Action::NextView { View::Normal } else { View::Shadow };
            let request = request(&effects).expect("a request");
            assert_eq!((request.overrides.view, request.write), (Some(wanted), false));
            assert!(desk.text().contains(&format!("view {}", wanted.name())));
        }
        Action::TogglePause => {
            desk.press('r');
            assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Pause(true))]));
            assert!(desk.text().contains("paused"));
            assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Pause(false))]));
        }
        Action::RenderAgain => assert!(request(&desk.key(key)).expect("a request").force),
        Action::WriteNow => assert!(matches!(desk.key(key)[..], [Effect::Send(Command::Write)])),
        Action::SceneSettings => {
            desk.press('s');
            desk.press('v');
            assert_eq!(overrides(&desk.key(key)), Some(Overrides::default()));
            assert!(desk.key(key).is_empty(), "there is nothing left to undo");
        }
        Action::ToggleDiagnostics | Action::Close => {
            desk.fail(vec![diagnostic(Severity::Error, "wrong")]);
            assert!(desk.key(key).is_empty());
            assert!(!desk.text().contains("error: wrong"));
        }
        Action::ScrollUp | Action::ScrollDown => {
            desk.fail((0..9).map(|_| diagnostic(Severity::Error, "wrong")).collect());
            desk.state.pane.scroll = 9;
            desk.key(key);
            assert_eq!(desk.state.pane.scroll < 9, action == Action::ScrollUp);
            assert_eq!(desk.state.pane.scroll > 9, action == Action::ScrollDown);
        }
        Action::ToggleHelp => {
            desk.key(key);
            assert!(desk.text().contains("quit") && desk.text().contains(" keys "));
            desk.key(key);
            assert!(!desk.text().contains(" keys "));
        }
        Action::Suspend => assert!(matches!(desk.key(key)[..], [Effect::StopJob])),
        Action::Interrupt => assert!(matches!(desk.key(key)[..], [Effect::Quit(ExitStatus(130))])),
        Action::Quit => assert!(matches!(desk.key(key)[..], [Effect::Quit(ExitStatus(0))])),
    }
}

#[test]
fn the_help_shows_every_line_of_the_table_at_80_by_24() {
    let mut desk = Desk::new();
    desk.press('?');
    let text = desk.text();
    for binding in KEYMAP {
        let line = text.lines().find(|line| line.contains(binding.help));
        let line = line.unwrap_or_else(|| panic!("{:?} is not in\n{text}", binding.help));
        assert!(line.contains(binding.label), "{line:?}");
    }
    desk.key(KeyPress::special(crossterm::event::KeyCode::Esc));
    assert!(!desk.text().contains(" keys "));
}

#[test]
fn the_bottom_line_is_made_from_the_table_until_there_is_a_message() {
    let mut desk = Desk::new();
    let bottom = |desk: &mut Desk| desk.text().lines().last().map(str::to_owned).unwrap_or_default();
    let hints = bottom(&mut desk);
    for binding in KEYMAP.iter().filter(|it| !it.hint.is_empty() && it.action != Action::ToggleHelp) {
        assert!(hints.contains(&format!("{} {}", binding.label, binding.hint)), "{hints:?}");
    }
    desk.press('p');
    assert!(bottom(&mut desk).contains("photons come with"));
    desk.press('?');
    desk.press('?');
    assert_eq!(bottom(&mut desk), hints);
}

#[test]
fn toggles_start_from_the_command_line_and_go_back_to_it() {
    let base = Overrides { shadows: Some(Shadows::Off), view: Some(View::Depth), ..Overrides::default() };
    let state = state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base.clone());
    let mut desk = Desk::with(state);
    assert!(desk.text().contains("shadows off") && desk.text().contains("view depth"));
    let effects = desk.press('s');
    let soft = request(&effects).expect("a request");
    assert_eq!((soft.overrides.shadows, soft.write), (Some(Shadows::Soft), true));
    let effects = desk.press('V');
    assert!(!request(&effects).expect("a request").write, "only the view of the command line is written");
    let effects = desk.press('0');
    assert_eq!(request(&effects).map(|it| it.overrides.clone()), Some(base));
}

#[test]
fn depth_of_field_of_a_pinhole_is_explained() {
    let mut desk = Desk::new();
    let pinhole = || Box::new(protocol::Effective { dof: false, ..settings() });
    desk.worker(protocol::Event::Settings { generation: 1, settings: pinhole() });
    assert!(desk.press('d').is_empty());
    assert!(desk.text().contains("no aperture"));

    let base = Overrides { dof: Some(false), ..Overrides::default() };
    let state = state_with(80, 24, PreviewKind::HalfBlock, ColorDepth::TrueColor, base);
    let mut desk = Desk::with(state);
    desk.worker(protocol::Event::Settings { generation: 1, settings: pinhole() });
    assert_eq!(request(&desk.press('d')).expect("a request").overrides.dof, Some(true));
    desk.worker(protocol::Event::Settings { generation: 2, settings: pinhole() });
    assert!(desk.text().contains("no aperture"));
}

#[test]
fn a_new_request_lets_a_paused_worker_go_on() {
    let mut desk = Desk::new();
    desk.press(' ');
    let effects = desk.event(Event::Changed(Changed { noticed: desk.now }));
    assert!(matches!(effects[..], [Effect::Send(Command::Pause(false)), Effect::Send(Command::Render(_))]));
    assert!(!desk.state.paused);
}

#[test]
fn pausing_nothing_is_explained() {
    let mut desk = Desk::new();
    desk.finish(RED);
    assert!(desk.press(' ').is_empty());
    assert!(desk.text().contains("nothing is rendering"));
}

#[test]
fn signals_end_stop_and_redraw() {
    let mut desk = Desk::new();
    let effect = |desk: &mut Desk, signal| desk.event(Event::Signal(signal));
    assert!(matches!(effect(&mut desk, Signal::Interrupt)[..], [Effect::Quit(ExitStatus(130))]));
    assert!(matches!(effect(&mut desk, Signal::Terminate)[..], [Effect::Quit(ExitStatus(143))]));
    assert!(matches!(effect(&mut desk, Signal::Hangup)[..], [Effect::Quit(ExitStatus(129))]));
    assert!(matches!(effect(&mut desk, Signal::Suspend)[..], [Effect::Suspend]));
    assert!(matches!(effect(&mut desk, Signal::Continue)[..], [Effect::Redraw]));
}

#[test]
fn a_source_that_ends_is_dealt_with() {
    let mut desk = Desk::new();
    assert!(matches!(desk.event(Event::Lost(Source::Worker))[..], [Effect::GiveUp]));
    assert!(matches!(desk.event(Event::Lost(Source::Keys))[..], [Effect::Quit(ExitStatus::HANGUP)]));
    assert!(desk.event(Event::Lost(Source::Watcher)).is_empty());
    assert!(desk.text().contains("no longer watched"));
}

#[test]
fn a_cancelled_render_says_that_it_stopped() {
    let mut desk = Desk::new();
    desk.worker(protocol::Event::Cancelled { generation: 1 });
    assert_eq!(desk.state.activity, Activity::Cancelled);
    assert!(desk.text().contains("stopped"));
}

#[test]
fn a_small_window_says_what_it_hides() {
    let mut desk = Desk::with(state(60, 5));
    assert!(desk.text().contains("too small: messages, name, stages hidden"), "{}", desk.text());
    desk.press('p');
    assert!(desk.text().contains("photons come with"), "{}", desk.text());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn no_window_and_no_history_panics(
        columns in 1_u16..250,
        rows in 1_u16..80,
        aspect in 1.2_f32..3.5,
        kind in 0..3_usize,
        depth in 0..4_usize,
        picture in (1_u32..90, 1_u32..90),
        script in prop::collection::vec(0..9_u8, 0..14),
        keys in prop::collection::vec(0..KEYMAP.len(), 0..14),
    ) {
        let kind = [PreviewKind::HalfBlock, PreviewKind::Ascii, PreviewKind::None][kind];
        let depth = [ColorDepth::TrueColor, ColorDepth::Indexed256, ColorDepth::Ansi16, ColorDepth::None][depth];
        let mut desk = Desk::with(state_with(columns, rows, kind, depth, Overrides::default()));
        desk.state.window.cell_aspect = aspect;
        let mut keys = keys.iter();
        for step in script {
            let generation = desk.state.generation;
            match step {
                0 => desk.fail(vec![diagnostic(Severity::Error, "a rather long message that has to be wrapped"); 3]),
                1 => desk.finish(RED),
                2 => { desk.worker(protocol::Event::Asset { generation, progress: asset("long name of a texture", 1, 2) }); }
                3 => { desk.worker(protocol::Event::Progress { generation, progress: progress(0.3, Some(9.0)) }); }
                4 => {
                    let picture = plain_picture(picture.0, picture.1, BLUE);
                    desk.event(Event::Picture { generation, picture });
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
