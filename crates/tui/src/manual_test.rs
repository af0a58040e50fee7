//! Runs the front end in a real terminal with a simulated worker. `GLIMT_MANUAL_SCENE` is the scene file's
//! path. A scene that contains `broken` fails to load, and one that contains `panic` makes the worker panic.
//! Pressing `w` makes the front end panic.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use super::fixtures::{
    asset_progress, diagnostic, done_event, effective_settings, scene_settings, stage_report,
};
use super::{
    ColorDepthChoice, ContentChangeTime, EventQueue, EventSender, PreviewChoice, TuiOptions, WatchEvent, run,
};
use crate::film::Srgb8Image;
use crate::pipeline::protocol::{
    Command, Event, Failure, PreviewSlot, PreviewUpdate, RenderProgress, Request, Stage, StageStatus,
};
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Severity;

#[test]
#[ignore = "interactive, until q: GLIMT_MANUAL_SCENE=a.toml cargo test --release -p glimt-tui --lib manual_test -- --ignored --nocapture"]
fn interactive_session() {
    let scene = PathBuf::from(std::env::var("GLIMT_MANUAL_SCENE").unwrap_or_default());
    let (commands, orders) = channel();
    let events = EventQueue::default();
    let (sender, watcher) = (events.worker_sender(), events.watcher_sender());
    let previews = PreviewSlot::default();
    let slot = Arc::clone(&previews);
    thread::spawn(move || run_simulated_worker(&orders, &sender, &slot));
    let watched = scene.clone();
    thread::spawn(move || poll_scene_file_changes(&watched, &watcher));
    let options = TuiOptions {
        scene,
        overrides: Overrides::default(),
        color: ColorDepthChoice::Auto,
        preview: PreviewChoice::Auto,
        cell_aspect: None,
        notify_after: None,
        commands: Box::new(move |command| {
            assert!(!matches!(command, Command::Write), "pressing w panics in the front-end thread");
            commands.send(command).unwrap_or_default();
        }),
        previews,
    };
    match run(options, events) {
        Ok(ended) => std::process::exit(i32::from(ended.status.0)),
        Err(error) => {
            println!("error: {error}");
            std::process::exit(1);
        }
    }
}

fn poll_scene_file_changes(scene: &PathBuf, news: &EventSender<WatchEvent>) {
    let mut last = std::fs::read(scene).ok();
    loop {
        thread::sleep(Duration::from_millis(30));
        let now = std::fs::read(scene).ok();
        if now != last {
            last = now;
            let changed = WatchEvent::Changed(ContentChangeTime { noticed: Instant::now() });
            [changed, WatchEvent::Settled].into_iter().for_each(|event| news.send(event));
        }
    }
}

fn run_simulated_worker(
    orders: &Receiver<Command>,
    events: &EventSender<Event>,
    slot: &Mutex<Option<PreviewUpdate>>,
) {
    let mut next = None;
    loop {
        match next.take().or_else(|| orders.recv().ok()) {
            Some(Command::Render(request)) => next = simulate_render(&request, orders, events, slot),
            Some(Command::Quit) | None => return,
            Some(_) => {}
        }
    }
}

/// Simulates a two-second render that the next command interrupts.
fn simulate_render(
    request: &Request,
    orders: &Receiver<Command>,
    events: &EventSender<Event>,
    slot: &Mutex<Option<PreviewUpdate>>,
) -> Option<Command> {
    let generation = request.generation;
    let say = |event| events.send(event);
    say(Event::Started { generation });
    let text = std::fs::read_to_string(&request.scene).unwrap_or_default();
    assert!(!text.contains("panic"), "the file contains `panic`");
    if text.contains("broken") {
        let failure = Failure::Scene(vec![diagnostic(Severity::Error, "unknown key `heigth`")]);
        say(Event::Failed { generation, failure });
        return None;
    }
    say(Event::Stage { generation, stage: stage_report(Stage::Parse, StageStatus::Done, 0.0003, "") });
    say(Event::Settings { generation, settings: Box::new(effective_settings()), own: scene_settings() });
    say(Event::Stage { generation, stage: stage_report(Stage::Textures, StageStatus::Running, 0.0, "") });
    let start = Instant::now();
    for step in 0..=20_u32 {
        say(Event::Asset { generation, progress: asset_progress("bricks", u64::from(step.min(10)), 10) });
        if let Some(size) = request.preview {
            let height = (size.width * 3 / 4).min(size.height).max(1);
            let picture = Arc::new(test_preview_image(height * 4 / 3, height, step + text.len() as u32 * 20));
            *slot.lock().expect("a slot") = Some(PreviewUpdate {
                generation,
                picture,
                range: None,
                section: None,
                lacks_photons: false,
                source: None,
            });
            say(Event::Preview { generation });
        }
        let progress = RenderProgress {
            fraction: f64::from(step) / 20.0,
            elapsed_seconds: start.elapsed().as_secs_f64(),
            earlier_seconds: 0.0,
            eta_seconds: Some(f64::from(20 - step) * 0.1),
            samples: step * 3,
            mean_samples: f64::from(step * 3),
            total_samples: 60,
            is_total_fixed: true,
            noise: None,
        };
        say(Event::Progress { generation, progress });
        if let Ok(command) = orders.recv_timeout(Duration::from_millis(100)) {
            return Some(command);
        }
    }
    say(Event::Written {
        generation,
        path: "cornell.png".into(),
        bytes: 210_400,
        is_own: true,
        unfinished: None,
    });
    say(done_event(generation, vec![diagnostic(Severity::Warning, "texture `b` is not used")], false));
    None
}

fn test_preview_image(width: u32, height: u32, phase: u32) -> Srgb8Image {
    let pixel = |x: u32, y: u32| [(x * 255 / width) as u8, (y * 255 / height) as u8, (phase * 6 % 256) as u8];
    let pixels =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Srgb8Image { width, height, pixels }
}
