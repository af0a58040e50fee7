//! Tests that the image gets enough space and that nothing moves during a render.

use super::{RED, cells_of};
use crate::ContentChangeTime;
use crate::color::ColorDepth;
use crate::event::{Effect, Event};
use crate::fixtures::*;
use crate::graphics::ImageProtocol;
use crate::messages;
use crate::pipeline::protocol::{self, Command, PreviewBounds, PreviewUpdate, Stage, StageStatus};
use crate::pipeline::settings::{EffectiveSettingsSummary, Overrides};
use crate::preview_style::PreviewStyle;
use crate::scene::diagnostic::Severity;
use crate::view::layout::Layout;

const WINDOWS: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];
const SIZES: [(u32, u32); 4] = [(640, 480), (1280, 720), (640, 400), (512, 512)];

/// Returns the preview size for an image, limited to the requested size.
fn fitted_preview_size(size: (u32, u32), most: PreviewBounds) -> (u32, u32) {
    let scale = (f64::from(most.width) / f64::from(size.0)).min(f64::from(most.height) / f64::from(size.1));
    let side = |length: u32, most: u32| ((f64::from(length) * scale).round() as u32).clamp(1, most);
    (side(size.0, most.width), side(size.1, most.height))
}

/// Reports settings with this image size and shows the scene's preview.
fn rendered(ui: &mut TestUi, (width, height): (u32, u32)) {
    let generation = ui.state.request.generation;
    ui.worker_event(protocol::Event::Started { generation });
    let settings = Box::new(EffectiveSettingsSummary { width, height, ..effective_settings() });
    ui.worker_event(protocol::Event::Settings { generation, settings, own: scene_settings() });
    show(ui, (width, height));
}

fn show(ui: &mut TestUi, size: (u32, u32)) {
    let generation = ui.state.request.generation;
    let (width, height) = fitted_preview_size(size, ui.state.request.preview_size.expect("a preview"));
    let picture = uniform_picture(width, height, RED);
    ui.handle_event(Event::Preview(PreviewUpdate {
        generation,
        picture,
        range: None,
        section: None,
        lacks_photons: false,
        source: None,
    }));
}

/// Returns the number of cells that an image can cover in a window with one line of text.
fn max_cells((columns, rows): (u16, u16), (width, height): (u32, u32)) -> f64 {
    let shape = f64::from(width) / f64::from(height) * 2.0;
    let room = (f64::from(columns), f64::from(rows - 1));
    let columns = room.0.min((room.1 * shape).round());
    columns * (columns / shape).ceil().min(room.1)
}

#[test]
fn image_gets_most_of_the_space() {
    for window in WINDOWS {
        for size in SIZES {
            let most = max_cells(window, size);
            let mut ui = TestUi::from_state(state(window.0, window.1));
            rendered(&mut ui, size);
            let share = cells_of(&mut ui, RED) as f64 / most;
            println!("{window:?} {size:?}: {share:.3}");
            assert!(share >= 0.75, "{window:?} {size:?}: {share:.3}\n{}", ui.screen_text());
            ui.press_key(crate::event::KeyPress::special(crossterm::event::KeyCode::Tab));
            show(&mut ui, size);
            let share = cells_of(&mut ui, RED) as f64 / most;
            assert!(share >= 0.95, "{window:?} {size:?} alone: {share:.3}\n{}", ui.screen_text());
        }
    }
}

#[test]
fn layout_is_stable_during_a_render() {
    for (columns, rows) in WINDOWS.into_iter().chain([(40, 12), (30, 8), (80, 60)]) {
        let mut ui = TestUi::from_state(state(columns, rows));
        rendered(&mut ui, (640, 480));
        let place = |ui: &TestUi| {
            let Layout { header, preview, panel, under, keys, pane } = Layout::for_state(&ui.state);
            [header, preview, panel, under, keys, pane]
        };
        let before = place(&ui);
        let generation = ui.state.request.generation;
        for step in 0..10 {
            match step {
                0 => ui.worker_event(protocol::Event::Stage {
                    generation,
                    stage: stage_report(Stage::Textures, StageStatus::Running, 0.0, ""),
                }),
                1 => ui.worker_event(protocol::Event::Asset {
                    generation,
                    progress: asset_progress("bricks", 3, 8),
                }),
                2 => ui.worker_event(protocol::Event::Progress {
                    generation,
                    progress: render_progress(0.5, None),
                }),
                3 => ui.press_character(' '),
                4 => ui.press_character('0'),
                5 => ui.worker_event(written_event(generation, "cornell.png", true)),
                6 => ui.worker_event(done_event(
                    generation,
                    vec![diagnostic(Severity::Warning, "unused")],
                    false,
                )),
                7 => ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now })),
                8 => {
                    ui.report_scene_errors(vec![diagnostic(Severity::Error, "wrong")]);
                    Vec::new()
                }
                _ => ui.handle_event(Event::Settled),
            };
            ui.draw_screen();
            assert_eq!(place(&ui), before, "step {step} at {columns}×{rows}");
        }
    }
}

#[test]
fn new_aspect_ratio_requests_another_preview() {
    let mut ui = TestUi::new();
    let settings = |width| Box::new(EffectiveSettingsSummary { width, height: 480, ..effective_settings() });
    let same = ui.worker_event(protocol::Event::Settings {
        generation: 1,
        settings: settings(640),
        own: scene_settings(),
    });
    assert!(same.is_empty(), "{same:?}");
    let wide = ui.worker_event(protocol::Event::Settings {
        generation: 1,
        settings: settings(1200),
        own: scene_settings(),
    });
    assert!(
        matches!(wide[..], [Effect::Send(Command::Preview(Some(PreviewBounds { width: 80, .. })))]),
        "{wide:?}"
    );
}

#[test]
fn small_windows_are_usable() {
    for (columns, rows) in [(40, 12), (30, 8)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.worker_event(protocol::Event::Progress {
            generation: 1,
            progress: render_progress(0.5, Some(9.0)),
        });
        let text = ui.screen_text();
        assert!(text.contains("● rendering") && text.contains("50 %"), "{text}");
        assert!(text.contains("? help") && text.contains("s soft"), "{text}");
        ui.worker_event(protocol::Event::Progress {
            generation: 1,
            progress: render_progress(0.5, Some(4567.0)),
        });
        assert!(
            ui.screen_text().contains("50 %"),
            "progress should take precedence over the ETA: {}",
            ui.screen_text()
        );
        rendered(&mut ui, (640, 480));
        let share = cells_of(&mut ui, RED) as f64 / max_cells((columns, rows), (640, 480));
        assert!(share >= 0.7, "{share:.3}\n{}", ui.screen_text());
        ui.report_scene_errors(vec![diagnostic(Severity::Error, "misspelled")]);
        let text = ui.screen_text();
        assert!(text.contains("✗ broken") && text.contains("error: misspelled"), "{text}");
        assert!(text.contains("cornell.toml:3:1"), "{text}");
    }
}

#[test]
fn status_line_shows_progress_then_results() {
    let mut ui = TestUi::from_state(state(120, 40));
    let under = |ui: &mut TestUi| ui.screen_text().lines().nth(38).map(str::to_owned).unwrap_or_default();
    let of = |name, status, seconds| protocol::Event::Stage {
        generation: 1,
        stage: stage_report(name, status, seconds, ""),
    };
    ui.worker_event(of(Stage::Textures, StageStatus::Running, 0.0));
    ui.worker_event(protocol::Event::Asset { generation: 1, progress: asset_progress("bricks", 1, 2) });
    assert!(under(&mut ui).starts_with("textures ━") && under(&mut ui).trim_end().ends_with("─ 0.0 s"));
    ui.worker_event(of(Stage::Textures, StageStatus::Done, 0.1));
    ui.worker_event(of(Stage::Render, StageStatus::Running, 0.0));
    ui.worker_event(protocol::Event::Progress { generation: 1, progress: render_progress(0.5, None) });
    assert!(under(&mut ui).starts_with("render ━"), "{}", under(&mut ui));
    assert!(under(&mut ui).contains("─ 32/64 samples · 0.0 s"), "{}", under(&mut ui));
    ui.worker_event(done_event(1, Vec::new(), false));
    assert!(under(&mut ui).starts_with("parse 250 ms, "), "{}", under(&mut ui));
}

#[test]
fn stage_times_are_compared_with_last_render() {
    let mut ui = TestUi::new();
    let render = |ui: &mut TestUi, seconds| {
        let generation = ui.state.request.generation;
        ui.worker_event(protocol::Event::Started { generation });
        let report = stage_report(Stage::Render, StageStatus::Done, seconds, "");
        ui.worker_event(protocol::Event::Stage { generation, stage: report });
    };
    render(&mut ui, 1.42);
    assert!(!ui.screen_text().contains("1.42 s −") && !ui.screen_text().contains("1.42 s +"));
    ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
    render(&mut ui, 1.12);
    assert!(ui.screen_text().contains("render   1.12 s −.3 s"), "{}", ui.screen_text());
    ui.press_character('r');
    ui.worker_event(protocol::Event::Started { generation: ui.state.request.generation });
    ui.press_character('r');
    render(&mut ui, 2.24);
    assert!(
        ui.screen_text().contains("render  2.24 s +1.1 s"),
        "canceled renders should not count: {}",
        ui.screen_text()
    );
}

#[test]
fn save_hint_is_shown_until_the_first_save() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        for size in SIZES {
            let mut ui = TestUi::from_state(state(columns, rows));
            rendered(&mut ui, size);
            ui.worker_event(done_event(1, Vec::new(), false));
            // If all stages are listed, a narrow window has no space for the hint.
            ui.state.work.stages = Default::default();
            assert!(
                ui.screen_words().contains(&messages::saving_starts_render_hint("cornell.toml", false)),
                "{}",
                ui.screen_text()
            );
            ui.handle_event(Event::FileChanged(ContentChangeTime { noticed: ui.now }));
            ui.worker_event(done_event(2, Vec::new(), false));
            assert!(
                !ui.screen_words().contains(&messages::saving_starts_render_hint("cornell.toml", false)),
                "{}",
                ui.screen_text()
            );
        }
    }
}

#[test]
fn status_line_lists_only_current_files() {
    let mut ui = TestUi::new();
    let finish = |ui: &mut TestUi| {
        let generation = ui.state.request.generation;
        rendered(ui, (320, 200));
        ui.worker_event(done_event(generation, Vec::new(), false));
        let settings = ui.state.request.effective.as_mut().expect("settings");
        (settings.width, settings.height) = (320, 200);
        // If all stages are listed, there is no space for a file.
        ui.state.work.stages = Default::default();
    };
    finish(&mut ui);
    ui.worker_event(protocol::Event::Written {
        generation: 1,
        path: "dof.png".into(),
        bytes: 63_000,
        is_own: true,
        unfinished: None,
    });
    assert!(
        Layout::for_state(&ui.state).panel.is_empty() && ui.screen_text().contains("→ dof.png 63.0 kB"),
        "{}",
        ui.screen_text()
    );
    ui.press_character('l');
    finish(&mut ui);
    // A key press that has no other effect clears the message about the camera.
    ui.press_character('?');
    ui.press_character('?');
    let text = ui.screen_text();
    assert!(text.contains(messages::NOT_SAVED) && !text.contains("dof.png 63"), "{text}");
    ui.press_character('w');
    ui.worker_event(protocol::Event::Written {
        generation: 2,
        path: "dof.png".into(),
        bytes: 64_000,
        is_own: false,
        unfinished: None,
    });
    ui.press_character('?');
    ui.press_character('?');
    let text = ui.screen_text();
    assert!(text.contains("→ dof.png 64.0 kB") && !text.contains("not saved"), "{text}");
}

#[test]
fn hints_wrap_at_the_panel_width() {
    for (columns, rows, width) in [(80, 24, 480), (120, 40, 480), (160, 40, 480)] {
        let mut ui = TestUi::from_state(state(columns, rows));
        ui.finish_render(RED);
        let settings = Box::new(EffectiveSettingsSummary { width, height: 480, ..effective_settings() });
        ui.worker_event(protocol::Event::Settings { generation: 1, settings, own: scene_settings() });
        let panel = Layout::for_state(&ui.state).panel;
        let hint = messages::saving_starts_render_hint("cornell.toml", true);
        assert_eq!(
            ui.screen_text().contains(&hint),
            usize::from(panel.width) >= hint.len(),
            "{panel:?}\n{}",
            ui.screen_text()
        );
    }
}

#[test]
fn pixel_preview_memory_is_bounded() {
    let by = |protocol, columns, rows, cell_pixels| {
        let kind = PreviewStyle::Pixels(protocol);
        let mut state = state_with(columns, rows, kind, ColorDepth::TrueColor, Overrides::default());
        state.display.window.cell_pixels = cell_pixels;
        state.display.horizontal_pixels_per_cell()
    };
    for (protocol, fine, most) in
        [(ImageProtocol::Kitty, 10, 2_400_000), (ImageProtocol::Sixel, 8, 1_600_000)]
    {
        assert_eq!(by(protocol, 80, 24, (8, 16)), 8, "full resolution");
        assert_eq!(by(protocol, 200, 60, (20, 40)), fine, "limited resolution");
        for (columns, rows) in [(480, 130), (1000, 500), (4000, 2000), (u16::MAX, u16::MAX)] {
            let across = by(protocol, columns, rows, (10, 20));
            let pixels = u64::from(columns) * u64::from(rows) * 2 * u64::from(across * across);
            assert!(across == 1 || pixels <= most, "{protocol:?} {columns}×{rows}: {across}");
        }
    }
}
