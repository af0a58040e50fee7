//! `--once`: render, write, exit; progress on stderr, nothing on stdout.

use std::path::PathBuf;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use super::console::Console;
use super::exit::Exit;
use super::lower::Order;
use super::progress::{self, Reporter};
use super::report;
use super::signals::{self, Ended};
use crate::output::check_place;
use crate::pipeline::protocol::{Command, Event, Failure, Report, Request, Writing};
use crate::pipeline::{Handle, start};

/// How long the end may take after a signal.
const PATIENCE: Duration = Duration::from_secs(2);
/// Between two looks for a signal.
const TICK: Duration = Duration::from_millis(50);

pub(super) fn run(order: &Order, console: &Console) -> Exit {
    if let Some(Err(error)) = order.report.as_deref().map(check_place) {
        return console.fail(Exit::FAILED, &error.to_string());
    }
    let worker = match start() {
        Ok(worker) => worker,
        Err(error) => return console.fail(Exit::FAILED, &format!("cannot start a thread: {error}")),
    };
    let remote = worker.remote();
    let ended = match signals::catch(move || remote.send(Command::Cancel)) {
        Ok(ended) => ended,
        Err(error) => return console.fail(Exit::FAILED, &format!("cannot listen to signals: {error}")),
    };
    worker.send(Command::Render(Box::new(Request {
        generation: 1,
        scene: order.scene.clone(),
        overrides: order.overrides.clone(),
        preview: None,
        write: Writing::Must,
        force: false,
    })));
    let mut reporter = progress::reporter(order.progress, console);
    let exit = follow(&worker, order, console, &mut *reporter, &ended);
    reporter.end();
    worker.finish(PATIENCE);
    ended.by().map_or(exit, Exit::signal)
}

/// Until the request is over or a signal ends it.
fn follow(
    worker: &Handle,
    order: &Order,
    console: &Console,
    reporter: &mut dyn Reporter,
    ended: &Ended,
) -> Exit {
    let mut written: Vec<PathBuf> = Vec::new();
    let mut deadline: Option<Instant> = None;
    loop {
        if ended.by().is_some() && *deadline.get_or_insert(Instant::now() + PATIENCE) < Instant::now() {
            return Exit::FAILED;
        }
        let event = match worker.events.recv_timeout(TICK) {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return console.fail(Exit::FAILED, "the worker is gone"),
        };
        reporter.event(&event);
        match event {
            Event::Written { path, .. } => written.push(path),
            Event::Done { report, warnings, .. } => {
                reporter.end();
                if !reporter.says_diagnostics() {
                    console.diagnostics(&warnings);
                }
                return done(order, &report, &written, console, reporter);
            }
            Event::Failed { failure, .. } => {
                reporter.end();
                let is_said = reporter.says_diagnostics();
                return if is_said { exit_of(&failure) } else { failed(&failure, console) };
            }
            Event::Cancelled { .. } => return Exit::FAILED,
            _ => {}
        }
    }
}

fn done(
    order: &Order,
    report: &Report,
    written: &[PathBuf],
    console: &Console,
    reporter: &dyn Reporter,
) -> Exit {
    if reporter.says_results() {
        written.iter().for_each(|path| console.say(&wrote(path, report)));
    }
    match order.report.as_deref().map(|path| report::write(path, report)) {
        Some(Err(message)) => console.fail(Exit::FAILED, &message),
        _ => Exit::DONE,
    }
}

fn failed(failure: &Failure, console: &Console) -> Exit {
    match failure {
        Failure::Scene(diagnostics) => console.diagnostics(diagnostics),
        Failure::Work(message) => console.say(&format!("error: {message}")),
    }
    exit_of(failure)
}

fn exit_of(failure: &Failure) -> Exit {
    match failure {
        Failure::Scene(_) => Exit::WRONG,
        Failure::Work(_) => Exit::FAILED,
    }
}

/// `wrote cornell.png (640×480, 64 samples, 1.93 s)`
fn wrote(path: &std::path::Path, report: &Report) -> String {
    let image = &report.image;
    let samples = match (image.samples.min, image.samples.max) {
        (1, 1) => "1 sample".to_owned(),
        (min, max) if min == max => format!("{max} samples"),
        (min, max) => format!("{min} to {max} samples"),
    };
    let seconds = progress::seconds(report.seconds);
    format!("wrote {} ({}×{}, {samples}, {seconds})", path.display(), image.width, image.height)
}
