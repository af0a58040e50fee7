//! Tests of what a wide window shows beside a picture, and of notifications.

use ratatui::layout::Rect;

use super::{BLUE, RED, cells_of};
use crate::Changed;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress, Mouse, MouseKind};
use crate::fixtures::*;
use crate::graphics::Protocol;
use crate::pipeline::protocol::{self, NoiseProgress, RenderProgress};
use crate::pipeline::settings::{Effective, Overrides};
use crate::preview_kind::PreviewKind;
use crate::terminal_replies::TerminalReply;
use crate::terminals::{Brand, TerminalId};
use crate::view;
use crate::view::layout::Layout;

/// A render whose noise falls from 10 % after a second, with `error` asked for.
fn rendered(ui: &mut TestUi, error: f32) {
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    let settings = Box::new(Effective { error, ..settings() });
    ui.worker(protocol::Event::Settings {
        generation,
        settings: settings.clone(),
        camera: camera(),
        exposure: 0.0,
        own: own(),
    });
    let picture = plain_picture(90, 68, RED);
    ui.event(Event::Picture {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    for step in 0..=40 {
        let seconds = 10_f64.powf(f64::from(step) / 20.0);
        let noise = Some(NoiseProgress { now: 0.1 / seconds.sqrt(), seconds, next: None });
        let progress = RenderProgress { elapsed_seconds: seconds, noise, ..progress(0.5, None) };
        ui.worker(protocol::Event::Progress { generation, progress });
    }
    let mut event = done(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].seconds = 110.0;
        report.image.error = Some(0.0095);
        report.settings = *settings;
    }
    ui.worker(event);
}

/// Saves of the scene, each with its text.
fn edited(ui: &mut TestUi, edits: &[(&str, [u8; 3])]) {
    for (text, color) in edits {
        ui.event(Event::Changed(Changed { noticed: ui.now }));
        let generation = ui.state.request.generation;
        ui.worker(protocol::Event::Text { generation, text: (*text).into() });
        ui.finish(*color);
    }
}

/// The text of the panel, in one line, without the blocks of small pictures.
fn panel(ui: &mut TestUi) -> String {
    let panel = Layout::of(&ui.state).panel;
    let buffer = ui.screen();
    let row = |y: u16| {
        (panel.left()..panel.right()).map(|x| buffer[(x, y)].symbol().to_owned()).collect::<String>()
    };
    let rows: Vec<String> = (panel.top()..panel.bottom()).map(row).collect();
    let text = rows.join(" ").replace(|c| ('▀'..='▟').contains(&c), "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_noise_of_a_finished_picture_is_a_curve() {
    let mut ui = TestUi::with(state(120, 40));
    rendered(&mut ui, 0.01);
    let text = panel(&mut ui);
    assert!(text.contains("noise while it rendered"), "{}", ui.text());
    let words = "10 % after 1.00 s, 0.95 % after 1 min 50 s; the line is the 1 % asked of each tile";
    assert!(text.contains(words), "{text}");
    // The line is level: a row of the same dots from the axis to the edge.
    let is_line = |line: &str| line.chars().filter(|c| ('⠁'..='⣿').contains(c)).count() >= 12;
    assert!(ui.text().lines().any(is_line), "{}", ui.text());
    // Another exposure is the same render, a key that changes the light is not.
    ui.press(']');
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    assert!(!panel(&mut ui).contains("noise while it rendered"), "while it works");
    let mut event = done(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::Status::Reused;
    }
    ui.worker(event);
    assert!(panel(&mut ui).contains("noise while it rendered"), "{}", ui.text());
    ui.press('s');
    ui.finish(BLUE);
    assert!(!panel(&mut ui).contains("noise while it rendered"), "one point is no curve");
    // A picture that is found again has its curve.
    ui.press('0');
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    let mut event = done(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::Status::Reused;
    }
    ui.worker(event);
    assert!(panel(&mut ui).contains("noise while it rendered"), "{}", ui.text());
    // Without an `error` there is no line.
    let mut ui = TestUi::with(state(120, 40));
    rendered(&mut ui, 0.0);
    assert!(panel(&mut ui).contains("1 min 50 s") && !panel(&mut ui).contains("the line is"));
}

#[test]
fn the_last_pictures_say_what_changed_and_a_click_shows_them() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    assert!(!panel(&mut ui).contains("the last pictures"));
    edited(&mut ui, &[("camera.fov = 30", BLUE)]);
    let text = panel(&mut ui);
    assert!(text.contains("the last pictures n N") && text.contains("▸2 camera.fov"), "{text}");
    assert!(text.contains("1 first"), "{text}");
    ui.press('s');
    ui.finish(RED);
    assert!(panel(&mut ui).contains("▸3 shadows hard"), "{}", ui.text());
    let all = cells_of(&mut ui, BLUE);
    assert!(all > 5 && all < 100, "a small picture: {all}");
    // The cell of the blue one.
    let buffer = ui.screen();
    let blue = ratatui::style::Color::Rgb(BLUE[0], BLUE[1], BLUE[2]);
    let places = buffer.area.positions();
    let place = places.into_iter().find(|place| buffer[*place].fg == blue).expect("a small picture");
    let mouse = Mouse { kind: MouseKind::Press, column: place.x, row: place.y };
    ui.event(Event::Mouse(mouse));
    ui.event(Event::Mouse(Mouse { kind: MouseKind::Release, ..mouse }));
    assert!(cells_of(&mut ui, BLUE) > 500, "{}", ui.text());
    assert!(ui.text().contains("picture 2 of 3") && panel(&mut ui).contains("▸2"), "{}", ui.text());
    ui.press('N');
    assert!(panel(&mut ui).contains("▸3") && cells_of(&mut ui, RED) > 500);
}

/// A save of the scene whose render has begun and has shown a picture, if it has a color.
fn begun(ui: &mut TestUi, text: &str, color: Option<[u8; 3]>) {
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    ui.worker(protocol::Event::Text { generation, text: text.into() });
    let (settings, camera) = (Box::new(settings()), camera());
    ui.worker(protocol::Event::Settings { generation, settings, camera, exposure: 0.0, own: own() });
    color.into_iter().for_each(|color| show(ui, color));
}

/// The request under way has a picture, which the terminal gets.
fn show(ui: &mut TestUi, color: [u8; 3]) {
    let (generation, picture) = (ui.state.request.generation, plain_picture(50, 38, color));
    let picture = Event::Picture {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    };
    ui.event(picture);
    // The line has taken its first bytes.
    ui.event(Event::Shown { generation });
}

#[test]
fn the_picture_does_not_wait_for_its_entry_in_the_strip() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    begun(&mut ui, "camera.fov = 30", None);
    let (generation, before) = (ui.state.request.generation, ui.state.picture.history.len());
    let picture = plain_picture(50, 38, BLUE);
    ui.event(Event::Picture {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    });
    assert!(ui.state.dirty && ui.state.urgent);
    assert_eq!(ui.state.picture.history.len(), before);
    ui.state.dirty = false;
    ui.event(Event::Shown { generation });
    assert_eq!(ui.state.picture.history.len(), before + 1);
    assert!(ui.state.dirty, "the strip has a new entry");
}

/// Color of the newest entry's small picture.
fn small_color(ui: &TestUi) -> [u8; 3] {
    let history = &ui.state.picture.history;
    history.small(history.len() - 1).expect("a small picture").pixels[0]
}

#[test]
fn the_entry_gets_the_picture_that_comes_after_the_end() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    begun(&mut ui, "camera.fov = 30", Some([0, 0, 0]));
    let generation = ui.state.request.generation;
    // The last picture is taken from its slot when the line has room for it.
    ui.worker(done(generation, Vec::new(), false));
    ui.screen();
    show(&mut ui, BLUE);
    assert_eq!(small_color(&ui), BLUE);
    assert!(ui.state.dirty, "the strip is drawn again");
    assert!(panel(&mut ui).contains("▸2 camera.fov 40 → 30"), "{}", ui.text());
    assert_eq!(ui.state.picture.history.len(), 2);
    // Nothing is drawn for a picture that is shown already.
    ui.event(Event::Shown { generation });
    assert!(!ui.state.dirty);
}

#[test]
fn the_entry_gets_the_picture_that_comes_after_the_end_while_an_older_one_is_looked_at() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    begun(&mut ui, "camera.fov = 30", Some([0, 0, 0]));
    let generation = ui.state.request.generation;
    ui.press('n');
    ui.worker(done(generation, Vec::new(), false));
    ui.screen();
    show(&mut ui, BLUE);
    assert_eq!(small_color(&ui), BLUE);
    assert!(ui.state.dirty, "the strip is drawn again");
}

#[test]
fn pixels_one_to_one_are_no_small_picture() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED), ("camera.fov = 30", BLUE)]);
    let (generation, picture) = (ui.state.request.generation, plain_picture(50, 38, RED));
    let section = Some(protocol::Section { left: 0.4, top: 0.4, width: 0.2, height: 0.2 });
    let (range, lacks_photons, source) = (None, false, None);
    ui.event(Event::Picture { generation, picture, range, section, lacks_photons, source });
    ui.event(Event::Shown { generation });
    assert_eq!(small_color(&ui), BLUE);
}

#[test]
fn the_render_under_way_is_the_newest_of_the_last_pictures() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    begun(&mut ui, "camera.fov = 30", Some(BLUE));
    let text = panel(&mut ui);
    assert!(text.contains("▸2 camera.fov 40 → 30") && text.contains(" 1 first"), "{text}");
    assert!(!text.contains("unfinished"), "it is not stopped: {text}");
    // The next save stops it. The stopped picture stays until the new render has one; it has no number.
    begun(&mut ui, "camera.fov = 20", None);
    let text = panel(&mut ui);
    assert!(text.contains("▸– unfinished; camera.fov") && !text.contains('2'), "{text}");
    show(&mut ui, [10, 200, 20]);
    for keys in ["", "nN", "b", "b"] {
        keys.chars().for_each(|key| drop(ui.press(key)));
        let text = panel(&mut ui);
        assert!(text.contains("2 camera.fov 30 → 20") && text.contains("– unfinished; camera.fov"), "{text}");
        assert_eq!(text.contains('▸'), text.contains("▸2") || keys == "b", "{keys}: {text}");
        assert_eq!(text.matches("unfinished").count(), 1, "{text}");
    }
    // While an older one is looked at, the one under way is there as well.
    edited(&mut ui, &[]);
    let generation = ui.state.request.generation;
    ui.worker(done(generation, Vec::new(), false));
    ui.press('n');
    let before = ui.state.picture.history.len();
    begun(&mut ui, "camera.fov = 10", None);
    ui.press('n');
    ui.press('n');
    show(&mut ui, [90, 90, 20]);
    assert_eq!(ui.state.picture.history.len(), before + 1);
    assert!(panel(&mut ui).contains(" 3 camera.fov 20 → 10"), "{}", ui.text());
}

#[test]
fn a_camera_on_its_way_is_one_of_the_last_pictures() {
    let mut ui = TestUi::with(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    for step in 0..5 {
        ui.press('l');
        show(&mut ui, [step, 0, 200]);
        let text = panel(&mut ui);
        assert!(text.contains("▸2 camera moved") && text.contains(" 1 first"), "{text}");
        assert_eq!(ui.state.picture.history.len(), 2, "{text}");
    }
}

#[test]
fn a_picture_that_is_as_it_was_keeps_its_curve() {
    let mut ui = TestUi::with(state(120, 40));
    rendered(&mut ui, 0.01);
    // A typo, which is mended: the picture is unchanged.
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    ui.fail(vec![diagnostic(crate::scene::diagnostic::Severity::Error, "wrong")]);
    ui.event(Event::Settled);
    ui.event(Event::Changed(Changed { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker(protocol::Event::Started { generation });
    let mut event = done(generation, Vec::new(), true);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::Status::Reused;
    }
    ui.worker(event);
    assert!(ui.text().contains("unchanged"), "{}", ui.text());
    assert!(panel(&mut ui).contains("noise while it rendered"), "{}", ui.text());
}

#[test]
fn no_line_ends_between_a_number_and_its_unit() {
    for columns in 120..200 {
        let mut ui = TestUi::with(state(columns, 40));
        rendered(&mut ui, 0.01);
        let panel = Layout::of(&ui.state).panel;
        let buffer = ui.screen();
        let line = |y: u16| {
            (panel.left()..panel.right()).map(|x| buffer[(x, y)].symbol().to_owned()).collect::<String>()
        };
        let caption = (panel.top()..panel.bottom()).map(line).filter(|line| line.contains("after"));
        for line in caption {
            let last = line.split_whitespace().last().unwrap_or_default();
            assert!(last.parse::<f64>().is_err(), "{columns}: {line}");
        }
    }
}

#[test]
fn errors_over_the_strip_leave_no_heading_behind() {
    // A panel too narrow for errors, one too low for them, and one that holds them.
    for (width, height) in [(640, 400), (640, 320), (640, 480)] {
        let mut ui = TestUi::with(state(200, 60));
        ui.state.request.effective = Some(Effective { width, height, ..settings() });
        ui.event(Event::Resize(window(200, 60)));
        for (number, color) in [RED, BLUE, [1, 2, 3]].into_iter().enumerate() {
            ui.event(Event::Changed(Changed { noticed: ui.now }));
            let generation = ui.state.request.generation;
            ui.worker(protocol::Event::Started { generation });
            ui.worker(protocol::Event::Text { generation, text: format!("seed = {number}").into() });
            show(&mut ui, color);
            let mut event = done(generation, Vec::new(), false);
            if let protocol::Event::Done { report, .. } = &mut event {
                (report.settings.width, report.settings.height) = (width, height);
            }
            ui.worker(event);
        }
        let entries = |text: &str| {
            ["1 first", "2 seed", "3 seed"].into_iter().filter(|words| text.contains(words)).count()
        };
        let has_heading = |text: &str| text.contains("the last pictures");
        let text = ui.text();
        assert!(has_heading(&text) && entries(&text) == 3, "{text}");
        for count in 1..8 {
            let errors = (0..count)
                .map(|number| diagnostic(crate::scene::diagnostic::Severity::Error, &format!("{number}")));
            ui.fail(errors.collect());
            ui.event(Event::Settled);
            let text = ui.text();
            assert!(text.contains("error: 0"), "{text}");
            assert_eq!(has_heading(&text), entries(&text) > 1, "{width}×{height}, {count} errors:\n{text}");
        }
    }
}

/// Whatever the window, the colors and the kind of picture: all is in the panel, and what waits for the picture is not in it.
#[test]
fn it_fits_into_every_window() {
    let kinds = [
        (PreviewKind::HalfBlock, ColorDepth::TrueColor),
        (PreviewKind::Octant, ColorDepth::Indexed256),
        (PreviewKind::Ascii, ColorDepth::None),
        (PreviewKind::Pixels(Protocol::Kitty), ColorDepth::TrueColor),
        (PreviewKind::None, ColorDepth::Ansi16),
    ];
    let edits = [
        "a = 1",
        "materials.board.diffuse = [0.8, 0.02, 0.02]",
        "materials.board.diffuse = [0.02, 0.8, 0.02]",
        "d = 1",
        "e = 1",
        "f = 1",
        "g = 1",
    ];
    for (kind, depth) in kinds {
        let mut ui = TestUi::with(state_with(120, 40, kind, depth, Overrides::default()));
        let all: Vec<_> =
            (1_u8..).zip(edits).map(|(index, what)| (what, [40 * (index % 5), 10 * index, 7])).collect();
        ui.finish(RED);
        edited(&mut ui, &all);
        ui.event(Event::Changed(Changed { noticed: ui.now }));
        rendered(&mut ui, 0.01);
        for columns in [100, 119, 120, 140, 200] {
            for rows in [1, 5, 12, 24, 40, 60, 90] {
                ui.event(Event::Resize(window(columns, rows)));
                for key in ['n', 'N', '?', '?'] {
                    ui.press(key);
                    let layout = Layout::of(&ui.state);
                    let mut buffer = ratatui::buffer::Buffer::empty(Rect::new(0, 0, columns, rows));
                    let drawn = view::draw(&ui.state, &mut buffer);
                    let is_inside = drawn.later.intersection(layout.panel) == drawn.later;
                    assert!(is_inside || drawn.later.is_empty(), "{columns}×{rows}: {:?}", drawn.later);
                    assert!(drawn.later.intersection(layout.preview).is_empty(), "{columns}×{rows}");
                    let is_wide = columns >= 120;
                    assert!(
                        is_wide || !fixtures_text(&buffer).contains("the last pictures"),
                        "{columns}×{rows}"
                    );
                }
            }
        }
    }
}

fn fixtures_text(buffer: &ratatui::buffer::Buffer) -> String {
    text(buffer)
}

#[test]
fn what_is_written_is_a_link() {
    for (columns, rows) in [(120, 40), (80, 20)] {
        let mut ui = TestUi::with(state(columns, rows));
        ui.worker(protocol::Event::Written {
            generation: 1,
            path: "cornell.png".into(),
            bytes: 107_000,
            is_own: true,
        });
        ui.finish(RED);
        let mut buffer = ui.screen();
        let drawn = view::draw(&ui.state, &mut buffer);
        let [(cells, path)] = &drawn.files[..] else { panic!("{drawn:?}\n{}", ui.text()) };
        let name: String = cells.positions().map(|place| buffer[place].symbol().to_owned()).collect();
        assert_eq!((name.as_str(), path.as_os_str().to_str()), ("cornell.png", Some("cornell.png")));
        ui.press('?');
        assert!(view::draw(&ui.state, &mut buffer).files.is_empty(), "the help lies over it");
    }
}

/// Ends a render after so many seconds. Returns what is sent beside the picture.
fn told(seconds: u64, prepare: impl Fn(&mut TestUi)) -> Option<String> {
    let mut ui = TestUi::new();
    ui.state.display.capabilities = TerminalId { brand: Brand::Kitty, version: [0, 40] }.capabilities();
    prepare(&mut ui);
    ui.wait(1000 * seconds);
    let effects = ui.worker(done(1, Vec::new(), false));
    effects.into_iter().find_map(|effect| match effect {
        Effect::Aside(bytes) => String::from_utf8(bytes).ok(),
        _ => None,
    })
}

#[test]
fn the_end_of_a_long_render_is_told_to_whoever_looks_elsewhere() {
    let focus = |is_here| {
        move |ui: &mut TestUi| drop(ui.event(Event::TerminalReply(TerminalReply::Focus { is_here })))
    };
    let words = "\u{1b}]99;;glimt: cornell.toml: done after 31.0 s\u{1b}\\";
    assert_eq!(told(31, focus(false)).as_deref(), Some(words));
    assert_eq!(told(30, focus(false)), None);
    assert_eq!(told(31, focus(true)), None);
    assert_eq!(told(31, |_| {}), None, "a terminal that never said that it lost the focus");
    assert_eq!(told(31, |ui| ui.state.display.has_focus = true), None);
    // A pause is no work.
    let held = |ui: &mut TestUi| {
        focus(false)(ui);
        ui.key(KeyPress::plain(' '));
        ui.wait(60_000);
        ui.key(KeyPress::plain(' '));
    };
    assert_eq!(told(5, held), None);
    let never = |ui: &mut TestUi| {
        focus(false)(ui);
        ui.state.display.notify_after = None;
    };
    assert_eq!(told(100, never), None);
}
