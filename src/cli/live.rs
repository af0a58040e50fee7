//! The terminal UI: worker, watcher and front end wired together.

use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use super::console::Console;
use super::exit::Exit;
use super::lower::Order;
use super::report;
use crate::pipeline::protocol::{Event, Failure};
use crate::pipeline::start;
use crate::pipeline::watch::Watcher;
use crate::scene::NO_SUCH_FILE;
use crate::scene::diagnostic::Diagnostic;
use crate::tui::{self, Options, TuiError};

/// How long a file that is being written may take at the end.
const PATIENCE: Duration = Duration::from_secs(2);

pub(super) fn run(order: Order, console: &Console) -> Exit {
    match live(order, console) {
        Ok(exit) => exit,
        Err((exit, message)) => console.fail(exit, &message),
    }
}

fn live(order: Order, console: &Console) -> Result<Exit, (Exit, String)> {
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
        color: order.color,
        preview: order.preview,
        cell_aspect: None,
        commands: Box::new(move |command| remote.send(command)),
        events,
        previews: worker.previews.clone(),
        changes,
    });
    worker.finish(PATIENCE);
    if outcome.as_ref().is_ok_and(|ended| ended.is_write_postponed) {
        console.say("the image was not written: glimt was ended before every pixel had a sample");
    }
    outcome.map(|ended| Exit(ended.status.0)).map_err(|error| {
        let exit = if matches!(error, TuiError::NotATerminal { .. }) { Exit::WRONG } else { Exit::FAILED };
        (exit, error.to_string())
    })
}

/// Hand events on, and see to files and reports on the way.
fn tap(events: &Receiver<Event>, report: Option<&Path>, watcher: &Watcher, forward: impl Fn(Event) -> bool) {
    for mut event in events {
        match &mut event {
            Event::Files { files, .. } => watcher.set_files(files.clone()),
            Event::Done { report: made, generation, .. } => {
                if let Some(Err(message)) = report.map(|path| report::write(path, made)) {
                    forward(Event::WriteFailed { generation: *generation, message });
                }
            }
            Event::Failed { failure: Failure::Scene(all), .. } => all.iter_mut().for_each(await_scene),
            _ => {}
        }
        if !forward(event) {
            return;
        }
    }
}

/// A scene that is not there may come (back): what watches it needs no other way out.
fn await_scene(problem: &mut Diagnostic) {
    if problem.message == NO_SUCH_FILE {
        let typo = problem.help.take().filter(|help| help.starts_with("did you mean"));
        let typo = typo.map_or(String::new(), |typo| format!("; {typo}"));
        problem.help = Some(format!("it is rendered as soon as it is there{typo}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_that_is_gone_is_waited_for() {
        let folder = tempfile::tempdir().expect("a folder");
        let said = |name: &str| {
            let [mut problem] = crate::scene::load(&folder.path().join(name))
                .expect_err("there is none")
                .try_into()
                .expect("one problem");
            await_scene(&mut problem);
            problem.help.expect("a way out")
        };
        assert_eq!(said("room.toml"), "it is rendered as soon as it is there");
        std::fs::write(folder.path().join("rooms.toml"), "").expect("written");
        assert!(said("room.toml").contains("as soon as it is there; did you mean"));
        std::fs::write(folder.path().join("room.toml"), "").expect("written");
        assert!(!said("room.toml").contains("as soon as"), "another problem has its own way out");
    }
}
