//! The terminal UI: worker, watcher and front end wired together.

use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::console::Console;
use super::exit::Exit;
use super::lower::Order;
use crate::pipeline::protocol::{Command, Event, Failure};
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
    let (sender, news) = channel();
    let watcher = Watcher::start(order.poll, worker.contents(), move |said| {
        // A front end that is gone wants no news.
        let _ = sender.send(said);
    })
    .map_err(no_thread)?;
    let (forward, events) = channel();
    let from_worker = std::mem::replace(&mut worker.events, channel().1);
    let writes = Writes::default();
    let heard = writes.clone();
    let tap = move || tap(&from_worker, &watcher, &heard, |event| forward.send(event).is_ok());
    let tap = std::thread::Builder::new().name("glimt-events".to_owned()).spawn(tap).map_err(no_thread)?;
    let remote = worker.remote();
    let asked = writes.clone();
    let outcome = tui::run(Options {
        scene: order.scene,
        overrides: order.overrides,
        color: order.color,
        preview: order.preview,
        cell_aspect: None,
        commands: Box::new(move |command| {
            if matches!(command, Command::Write) {
                asked.lines().clear();
            }
            remote.send(command);
        }),
        events,
        previews: worker.previews.clone(),
        news,
    });
    let has_ended = worker.finish(PATIENCE);
    if outcome.as_ref().is_ok_and(|ended| ended.is_write_unanswered) {
        if has_ended {
            // It ends with the worker; a panic of it has nothing more to say.
            let _ = tap.join();
        }
        writes.said().iter().for_each(|line| console.say(line));
    }
    outcome.map(|ended| Exit(ended.status.0)).map_err(|error| {
        let exit = if matches!(error, TuiError::NotATerminal { .. }) { Exit::WRONG } else { Exit::FAILED };
        (exit, error.to_string())
    })
}

/// What came of the last order to write.
#[derive(Clone, Debug, Default)]
struct Writes(Arc<Mutex<Vec<String>>>);

impl Writes {
    fn lines(&self) -> MutexGuard<'_, Vec<String>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn hear(&self, event: &Event) {
        match event {
            Event::Written { path, .. } => self.lines().push(format!("wrote {}", path.display())),
            Event::WriteFailed { message, .. } => self.lines().push(format!("error: {message}")),
            Event::Refused { conflicts, .. } => {
                let lines = conflicts.iter().map(|conflict| format!("error: {}", conflict.message));
                self.lines().extend(lines);
            }
            Event::Started { .. }
            | Event::Stage { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Warnings { .. }
            | Event::Progress { .. }
            | Event::Preview { .. }
            | Event::WritePostponed { .. }
            | Event::Files { .. }
            | Event::Done { .. }
            | Event::Failed { .. }
            | Event::Cancelled { .. } => {}
        }
    }

    /// A line for each picture.
    fn said(&self) -> Vec<String> {
        let lines = self.lines();
        if lines.is_empty() {
            vec!["the image was not written: glimt was ended first".to_owned()]
        } else {
            lines.clone()
        }
    }
}

/// Hand events on, and see on the way to what is watched and to what is written.
fn tap(events: &Receiver<Event>, watcher: &Watcher, writes: &Writes, forward: impl Fn(Event) -> bool) {
    let mut is_heard = true;
    for mut event in events {
        writes.hear(&event);
        // The front end is gone: only what is still written counts.
        if !is_heard {
            continue;
        }
        if let Event::Files { files, .. } = &event {
            watcher.set_files(files.clone());
        }
        if let Event::Failed { failure: Failure::Scene(all), .. } = &mut event {
            all.iter_mut().for_each(await_scene);
        }
        is_heard = forward(event);
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
            let [mut problem] = crate::scene::load(&folder.path().join(name), &[])
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
