//! Tests for notifications, and for the noise curve and history in a wide window.

use ratatui::layout::Rect;

use super::{BLUE, RED, cells_of};
use crate::ContentChangeTime;
use crate::color::ColorDepth;
use crate::event::{Effect, Event, KeyPress, MouseEvent, MouseEventKind};
use crate::fixtures::*;
use crate::graphics::ImageProtocol;
use crate::messages;
use crate::pipeline::protocol::{self, NoiseAndTimeToNextLevel, PreviewUpdate, RenderProgress};
use crate::pipeline::settings::{EffectiveSettingsSummary, Overrides};
use crate::preview_style::PreviewStyle;
use crate::terminal_replies::TerminalReply;
use crate::terminals::{TerminalBrand, TerminalId};
use crate::view;
use crate::view::layout::Layout;

/// Simulates a render with the target `error`. The noise is 10 % after one second and keeps falling.
fn rendered(ui: &mut TestUi, error: f32) {
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let settings = Box::new(EffectiveSettingsSummary { error, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings {
        generation,
        settings: settings.clone(),
        own: scene_settings(),
    });
    let picture = uniform_picture(90, 68, RED);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
    for step in 0..=40 {
        let seconds = 10_f64.powf(f64::from(step) / 20.0);
        let noise = Some(NoiseAndTimeToNextLevel { now: 0.1 / seconds.sqrt(), seconds, next: None });
        let progress = RenderProgress { elapsed_seconds: seconds, noise, ..render_progress(0.5, None) };
        ui.worker_event(protocol::Event::Progress { generation, progress });
    }
    let mut event = done_event(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].seconds = 110.0;
        report.image.error = Some(0.0095);
        report.settings = *settings;
    }
    ui.worker_event(event);
}

/// Saves the scene with each of these texts, one after the other.
fn edited(ui: &mut TestUi, edits: &[(&str, [u8; 3])]) {
    for (text, color) in edits {
        ui.simulate_scene_save(text);
        ui.finish_render(*color);
    }
}

/// Returns the panel's text on one line, without thumbnails.
fn panel(ui: &mut TestUi) -> String {
    let panel = Layout::for_state(&ui.state).panel;
    let buffer = ui.draw_screen();
    let row = |y: u16| {
        (panel.left()..panel.right()).map(|x| buffer[(x, y)].symbol().to_owned()).collect::<String>()
    };
    let rows: Vec<String> = (panel.top()..panel.bottom()).map(row).collect();
    let text = rows.join(" ").replace(|c| ('▀'..='▟').contains(&c), "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn finished_render_has_a_noise_curve() {
    let mut ui = TestUi::from_state(state(120, 40));
    rendered(&mut ui, 0.01);
    let text = panel(&mut ui);
    assert!(text.contains(messages::NOISE_OVER_TIME), "{}", ui.screen_text());
    let words =
        format!("10 % after 1.00 s, 0.95 % after 1 min 50 s; {}", messages::noise_target_line_label("1 %"));
    assert!(text.contains(&words), "{text}");
    // The target line is a row of identical dots from the axis to the edge.
    let is_line = |line: &str| line.chars().filter(|c| ('⠁'..='⣿').contains(c)).count() >= 12;
    assert!(ui.screen_text().lines().any(is_line), "{}", ui.screen_text());
    // Changing the exposure reuses the render and its curve, unlike changing the lighting.
    ui.press_character(']');
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    assert!(!panel(&mut ui).contains(messages::NOISE_OVER_TIME), "the curve is hidden during a render");
    let mut event = done_event(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::StageStatus::Reused;
    }
    ui.worker_event(event);
    assert!(panel(&mut ui).contains(messages::NOISE_OVER_TIME), "{}", ui.screen_text());
    ui.press_character('s');
    ui.finish_render(BLUE);
    assert!(!panel(&mut ui).contains(messages::NOISE_OVER_TIME), "a single point is not drawn as a curve");
    // The curve is restored for an image that was rendered before.
    ui.press_character('0');
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let mut event = done_event(generation, Vec::new(), false);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::StageStatus::Reused;
    }
    ui.worker_event(event);
    assert!(panel(&mut ui).contains(messages::NOISE_OVER_TIME), "{}", ui.screen_text());
    // Without a target `error`, there is no target line.
    let mut ui = TestUi::from_state(state(120, 40));
    rendered(&mut ui, 0.0);
    assert!(panel(&mut ui).contains("1 min 50 s") && !panel(&mut ui).contains("target:"));
}

#[test]
fn history_lists_changes_and_opens_on_click() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    assert!(!panel(&mut ui).contains(messages::HISTORY));
    edited(&mut ui, &[("camera.fov = 30", BLUE)]);
    let text = panel(&mut ui);
    assert!(
        text.contains(&format!("{} (n / N)", messages::HISTORY)) && text.contains("▸2 camera.fov"),
        "{text}"
    );
    assert!(text.contains(&format!("1 {}", messages::OPENED)), "{text}");
    ui.press_character('s');
    ui.finish_render(RED);
    assert!(panel(&mut ui).contains("▸3 shadows hard"), "{}", ui.screen_text());
    let all = cells_of(&mut ui, BLUE);
    assert!(all > 5 && all < 100, "expected a thumbnail: {all}");
    // Find a cell in the blue thumbnail.
    let buffer = ui.draw_screen();
    let blue = ratatui::style::Color::Rgb(BLUE[0], BLUE[1], BLUE[2]);
    let places = buffer.area.positions();
    let place = places.into_iter().find(|place| buffer[*place].fg == blue).expect("a thumbnail");
    let mouse = MouseEvent { kind: MouseEventKind::Press, column: place.x, row: place.y };
    ui.handle_event(Event::Mouse(mouse));
    ui.handle_event(Event::Mouse(MouseEvent { kind: MouseEventKind::Release, ..mouse }));
    assert!(cells_of(&mut ui, BLUE) > 500, "{}", ui.screen_text());
    assert!(
        ui.screen_text().contains(&messages::render_number_of_count(2, 3)) && panel(&mut ui).contains("▸2"),
        "{}",
        ui.screen_text()
    );
    ui.press_character('N');
    assert!(panel(&mut ui).contains("▸3") && cells_of(&mut ui, RED) > 500);
}

/// Saves the scene and starts its render. If `color` is set, shows a preview in that color.
fn start_render(ui: &mut TestUi, text: &str, color: Option<[u8; 3]>) {
    ui.simulate_scene_save(text);
    ui.report_scene_read();
    color.into_iter().for_each(|color| show(ui, color));
}

/// Shows a preview of the current request on the terminal.
fn show(ui: &mut TestUi, color: [u8; 3]) {
    ui.show_preview(color);
    // The preview's first bytes have been sent.
    ui.handle_event(Event::FirstPreviewSent { generation: ui.state.request.generation });
}

#[test]
fn preview_does_not_wait_for_the_history() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    start_render(&mut ui, "camera.fov = 30", None);
    let (generation, before) = (ui.state.request.generation, ui.state.preview.history.len());
    ui.show_preview(BLUE);
    assert!(ui.state.dirty && ui.state.urgent);
    assert_eq!(ui.state.preview.history.len(), before);
    ui.state.dirty = false;
    ui.handle_event(Event::FirstPreviewSent { generation });
    assert_eq!(ui.state.preview.history.len(), before + 1);
    assert!(ui.state.dirty, "the history should have a new entry");
}

/// Color of the newest thumbnail.
fn small_color(ui: &TestUi) -> [u8; 3] {
    let history = &ui.state.preview.history;
    history.thumbnail(history.len() - 1).expect("a thumbnail").pixels[0]
}

#[test]
fn entry_shows_preview_drawn_after_render_ends() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    start_render(&mut ui, "camera.fov = 30", Some([0, 0, 0]));
    let generation = ui.state.request.generation;
    // The last preview is taken from its slot only when bandwidth is available.
    ui.worker_event(done_event(generation, Vec::new(), false));
    ui.draw_screen();
    show(&mut ui, BLUE);
    assert_eq!(small_color(&ui), BLUE);
    assert!(ui.state.dirty, "the history should be redrawn");
    assert!(panel(&mut ui).contains("▸2 camera.fov 40 → 30"), "{}", ui.screen_text());
    assert_eq!(ui.state.preview.history.len(), 2);
    // A preview that is already shown is not redrawn.
    ui.handle_event(Event::FirstPreviewSent { generation });
    assert!(!ui.state.dirty);
}

#[test]
fn hidden_entry_gets_preview_drawn_after_end() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    start_render(&mut ui, "camera.fov = 30", Some([0, 0, 0]));
    let generation = ui.state.request.generation;
    ui.press_character('n');
    ui.worker_event(done_event(generation, Vec::new(), false));
    ui.draw_screen();
    show(&mut ui, BLUE);
    assert_eq!(small_color(&ui), BLUE);
    assert!(ui.state.dirty, "the history should be redrawn");
}

#[test]
fn actual_pixels_are_not_used_as_a_thumbnail() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED), ("camera.fov = 30", BLUE)]);
    let (generation, picture) = (ui.state.request.generation, uniform_picture(50, 38, RED));
    let section = Some(protocol::NormalizedRect { left: 0.4, top: 0.4, width: 0.2, height: 0.2 });
    let (range, lacks_photons, source) = (None, false, None);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range,
        section,
        lacks_photons,
        source,
    }));
    ui.handle_event(Event::FirstPreviewSent { generation });
    assert_eq!(small_color(&ui), BLUE);
}

#[test]
fn running_render_is_the_newest_entry() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    start_render(&mut ui, "camera.fov = 30", Some(BLUE));
    let text = panel(&mut ui);
    assert!(
        text.contains("▸2 camera.fov 40 → 30") && text.contains(&format!(" 1 {}", messages::OPENED)),
        "{text}"
    );
    assert!(!text.contains(messages::STOPPED), "the render is still running: {text}");
    // The next save stops the render. Its entry loses its number, which the new render gets once it has a
    // preview.
    start_render(&mut ui, "camera.fov = 20", None);
    let text = panel(&mut ui);
    assert!(text.contains(&format!("▸– {}: camera.fov", messages::STOPPED)) && !text.contains('2'), "{text}");
    show(&mut ui, [10, 200, 20]);
    for keys in ["", "nN", "b", "b"] {
        keys.chars().for_each(|key| drop(ui.press_character(key)));
        let text = panel(&mut ui);
        assert!(
            text.contains("2 camera.fov 30 → 20")
                && text.contains(&format!("– {}: camera.fov", messages::STOPPED)),
            "{text}"
        );
        assert_eq!(text.contains('▸'), text.contains("▸2") || keys == "b", "{keys}: {text}");
        assert_eq!(text.matches(messages::STOPPED).count(), 1, "{text}");
    }
    // A running render is added even while an older one is being viewed.
    edited(&mut ui, &[]);
    let generation = ui.state.request.generation;
    ui.worker_event(done_event(generation, Vec::new(), false));
    ui.press_character('n');
    let before = ui.state.preview.history.len();
    start_render(&mut ui, "camera.fov = 10", None);
    ui.press_character('n');
    ui.press_character('n');
    show(&mut ui, [90, 90, 20]);
    assert_eq!(ui.state.preview.history.len(), before + 1);
    assert!(panel(&mut ui).contains(" 3 camera.fov 20 → 10"), "{}", ui.screen_text());
}

#[test]
fn moving_the_camera_adds_a_single_entry() {
    let mut ui = TestUi::from_state(state(120, 40));
    edited(&mut ui, &[("camera.fov = 40", RED)]);
    for step in 0..5 {
        ui.press_character('l');
        show(&mut ui, [step, 0, 200]);
        let text = panel(&mut ui);
        assert!(
            text.contains("▸2 camera moved") && text.contains(&format!(" 1 {}", messages::OPENED)),
            "{text}"
        );
        assert_eq!(ui.state.preview.history.len(), 2, "{text}");
    }
}

#[test]
fn unchanged_image_keeps_its_curve() {
    let mut ui = TestUi::from_state(state(120, 40));
    rendered(&mut ui, 0.01);
    // Make and fix a typo, which leaves the image unchanged.
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    ui.report_scene_errors(vec![diagnostic(crate::scene::diagnostic::Severity::Error, "wrong")]);
    ui.handle_event(Event::Settled);
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let mut event = done_event(generation, Vec::new(), true);
    if let protocol::Event::Done { report, .. } = &mut event {
        report.stages[protocol::Stage::Render as usize].status = protocol::StageStatus::Reused;
    }
    ui.worker_event(event);
    assert!(ui.screen_text().contains("unchanged"), "{}", ui.screen_text());
    assert!(panel(&mut ui).contains(messages::NOISE_OVER_TIME), "{}", ui.screen_text());
}

#[test]
fn numbers_are_not_separated_from_their_units() {
    for columns in 120..200 {
        let mut ui = TestUi::from_state(state(columns, 40));
        rendered(&mut ui, 0.01);
        let panel = Layout::for_state(&ui.state).panel;
        let buffer = ui.draw_screen();
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
fn history_heading_is_not_shown_without_entries() {
    // The panel is too narrow for diagnostics, then not tall enough, then large enough.
    for (width, height) in [(640, 400), (640, 320), (640, 480)] {
        let mut ui = TestUi::from_state(state(200, 60));
        ui.state.request.effective = Some(EffectiveSettingsSummary { width, height, ..effective_settings() });
        ui.handle_event(Event::Resize(window(200, 60)));
        for (number, color) in [RED, BLUE, [1, 2, 3]].into_iter().enumerate() {
            ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
            let generation = ui.state.request.generation;
            ui.worker_event(protocol::Event::Started { generation });
            ui.worker_event(protocol::Event::Text { generation, text: format!("seed = {number}").into() });
            show(&mut ui, color);
            let mut event = done_event(generation, Vec::new(), false);
            if let protocol::Event::Done { report, .. } = &mut event {
                (report.settings.width, report.settings.height) = (width, height);
            }
            ui.worker_event(event);
        }
        let entries = |text: &str| {
            [&*format!("1 {}", messages::OPENED), "2 seed", "3 seed"]
                .into_iter()
                .filter(|words| text.contains(words))
                .count()
        };
        let has_heading = |text: &str| text.contains(messages::HISTORY);
        let text = ui.screen_text();
        assert!(has_heading(&text) && entries(&text) == 3, "{text}");
        for count in 1..8 {
            let errors = (0..count)
                .map(|number| diagnostic(crate::scene::diagnostic::Severity::Error, &format!("{number}")));
            ui.report_scene_errors(errors.collect());
            ui.handle_event(Event::Settled);
            let text = ui.screen_text();
            assert!(text.contains("error: 0"), "{text}");
            assert_eq!(has_heading(&text), entries(&text) > 1, "{width}×{height}, {count} errors:\n{text}");
        }
    }
}

/// At every window size and with every kind of preview, delayed text must stay inside the panel.
#[test]
fn side_panel_fits_every_window_size() {
    let kinds = [
        (PreviewStyle::HalfBlock, ColorDepth::TrueColor),
        (PreviewStyle::Octant, ColorDepth::Indexed256),
        (PreviewStyle::Ascii, ColorDepth::None),
        (PreviewStyle::Pixels(ImageProtocol::Kitty), ColorDepth::TrueColor),
        (PreviewStyle::None, ColorDepth::Ansi16),
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
        let mut ui = TestUi::from_state(state_with(120, 40, kind, depth, Overrides::default()));
        let all: Vec<_> =
            (1_u8..).zip(edits).map(|(index, what)| (what, [40 * (index % 5), 10 * index, 7])).collect();
        ui.finish_render(RED);
        edited(&mut ui, &all);
        ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
        rendered(&mut ui, 0.01);
        for columns in [100, 119, 120, 140, 200] {
            for rows in [1, 5, 12, 24, 40, 60, 90] {
                ui.handle_event(Event::Resize(window(columns, rows)));
                for key in ['n', 'N', '?', '?'] {
                    ui.press_character(key);
                    let layout = Layout::for_state(&ui.state);
                    let mut buffer = ratatui::buffer::Buffer::empty(Rect::new(0, 0, columns, rows));
                    let drawn = view::draw(&ui.state, &mut buffer);
                    let is_inside = drawn.later.intersection(layout.panel) == drawn.later;
                    assert!(is_inside || drawn.later.is_empty(), "{columns}×{rows}: {:?}", drawn.later);
                    assert!(drawn.later.intersection(layout.preview).is_empty(), "{columns}×{rows}");
                    let is_wide = columns >= 120;
                    assert!(
                        is_wide || !fixtures_text(&buffer).contains(messages::HISTORY),
                        "{columns}×{rows}"
                    );
                }
            }
        }
    }
}

fn fixtures_text(buffer: &ratatui::buffer::Buffer) -> String {
    buffer_text(buffer)
}

#[test]
fn written_files_are_hyperlinks() {
    for (columns, rows) in [(120, 40), (80, 20)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.worker_event(protocol::Event::Written {
            generation: 1,
            path: "cornell.png".into(),
            bytes: 107_000,
            is_own: true,
            unfinished: None,
        });
        ui.finish_render(RED);
        let mut buffer = ui.draw_screen();
        let drawn = view::draw(&ui.state, &mut buffer);
        let [(cells, path)] = &drawn.files[..] else { panic!("{drawn:?}\n{}", ui.screen_text()) };
        let name: String = cells.positions().map(|place| buffer[place].symbol().to_owned()).collect();
        assert_eq!((name.as_str(), path.as_os_str().to_str()), ("cornell.png", Some("cornell.png")));
        ui.press_character('?');
        assert!(view::draw(&ui.state, &mut buffer).files.is_empty(), "covered text should not be linked");
    }
}

/// Finishes a render after `seconds` and returns the notification, if any.
fn notification(seconds: u64, prepare: impl Fn(&mut TestUi)) -> Option<String> {
    let mut ui = TestUi::new();
    ui.state.display.capabilities =
        TerminalId { brand: TerminalBrand::Kitty, version: [0, 40] }.terminal_extras();
    prepare(&mut ui);
    ui.advance_clock(1000 * seconds);
    let effects = ui.worker_event(done_event(1, Vec::new(), false));
    effects.into_iter().find_map(|effect| match effect {
        Effect::Aside(bytes) => String::from_utf8(bytes).ok(),
        _ => None,
    })
}

#[test]
fn long_renders_send_a_notification_at_the_end() {
    let focus = |is_here| {
        move |ui: &mut TestUi| drop(ui.handle_event(Event::TerminalReply(TerminalReply::Focus { is_here })))
    };
    let words = "\u{1b}]99;;glimt: cornell.toml: done after 31.0 s\u{1b}\\";
    assert_eq!(notification(31, focus(false)).as_deref(), Some(words));
    assert_eq!(notification(30, focus(false)), None);
    assert_eq!(notification(31, focus(true)), None);
    assert_eq!(notification(31, |_| {}), None, "no notification should be sent before focus is lost");
    assert_eq!(notification(31, |ui| ui.state.display.has_focus = true), None);
    // Pauses are not counted.
    let held = |ui: &mut TestUi| {
        focus(false)(ui);
        ui.press_key(KeyPress::plain(' '));
        ui.advance_clock(60_000);
        ui.press_key(KeyPress::plain(' '));
    };
    assert_eq!(notification(5, held), None);
    let never = |ui: &mut TestUi| {
        focus(false)(ui);
        ui.state.display.notify_after = None;
    };
    assert_eq!(notification(100, never), None);
}
