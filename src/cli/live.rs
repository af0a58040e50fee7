//! The terminal UI: worker, watcher and front end wired together.

use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use super::args;
use super::console::Console;
use super::exit::Exit;
use super::lower::Order;
use super::report;
use crate::pipeline::protocol::Event;
use crate::pipeline::start;
use crate::pipeline::watch::Watcher;
use crate::tui::{self, ColorChoice, Options, PreviewChoice, TuiError};

/// How long a file that is being written may take at the end.
const PATIENCE: Duration = Duration::from_secs(2);

pub(super) fn run(order: Order, console: &Console) -> Exit {
    match live(order) {
        Ok(exit) => exit,
        Err((exit, message)) => console.fail(exit, &message),
    }
}

fn live(order: Order) -> Result<Exit, (Exit, String)> {
    let no_thread = |error| (Exit::FAILED, format!("cannot start a thread: {error}"));
    let mut worker = start().map_err(no_thread)?;
    let (sender, changes) = channel();
    let watcher = Watcher::start(order.poll, worker.contents(), move |changed| {
        // A front end that is gone wants no changes.
        let _ = sender.send(changed);
    })
    .map_err(no_thread)?;
    let (forward, events) = channel();
    let from_worker = std::mem::replace(&mut worker.events, channel().1);
    let report = order.report.clone();
    let tap = move || tap(&from_worker, report.as_deref(), &watcher, |event| forward.send(event).is_ok());
    std::thread::Builder::new().name("glimt-events".to_owned()).spawn(tap).map_err(no_thread)?;
    let remote = worker.remote();
    let outcome = tui::run(Options {
        scene: order.scene,
        overrides: order.overrides,
        color: color(order.color),
        preview: preview(order.preview),
        cell_aspect: None,
        commands: Box::new(move |command| remote.send(command)),
        events,
        previews: worker.previews.clone(),
        changes,
    });
    worker.finish(PATIENCE);
    outcome.map(|status| Exit(status.0)).map_err(|error| {
        let exit = if matches!(error, TuiError::NotATerminal { .. }) { Exit::WRONG } else { Exit::FAILED };
        (exit, error.to_string())
    })
}

/// Hand events on, and see to files and reports on the way.
fn tap(events: &Receiver<Event>, report: Option<&Path>, watcher: &Watcher, forward: impl Fn(Event) -> bool) {
    for event in events {
        match &event {
            Event::Files { files, .. } => watcher.set_files(files.clone()),
            Event::Done { report: made, generation, .. } => {
                if let Some(Err(message)) = report.map(|path| report::write(path, made)) {
                    forward(Event::WriteFailed { generation: *generation, message });
                }
            }
            _ => {}
        }
        if !forward(event) {
            return;
        }
    }
}

fn color(color: args::Color) -> ColorChoice {
    match color {
        args::Color::Auto => ColorChoice::Auto,
        args::Color::Truecolor => ColorChoice::TrueColor,
        args::Color::Palette256 => ColorChoice::Indexed256,
        args::Color::Palette16 => ColorChoice::Ansi16,
        args::Color::None => ColorChoice::None,
    }
}

fn preview(preview: args::Preview) -> PreviewChoice {
    match preview {
        args::Preview::Auto => PreviewChoice::Auto,
        args::Preview::Halfblock => PreviewChoice::HalfBlock,
        args::Preview::Ascii => PreviewChoice::Ascii,
        args::Preview::None => PreviewChoice::None,
    }
}
