//! The terminal UI: worker, watcher and front end wired together.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::console::Console;
use crate::exit::Exit;
use crate::lower::Order;
use crate::output::held;
use crate::pipeline::protocol::{CheckpointNews, Command, Event, Failure, Stage, Status};
use crate::pipeline::start;
use crate::pipeline::watch::{Lost, Watcher, missing_folder};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::sanitize::visible;
use crate::scene::{SAME_TEXT, is_absence, text_now};
use crate::system::threads::start_failure;
use crate::tui::{self, ExitStatus, Options, TuiError, TuiOutcome};

/// Time that the end waits for a picture that is being written, after a signal; and after a key, until a person hears what it
/// waits for.
const PATIENCE: Duration = Duration::from_secs(2);

pub(super) fn run(order: Order, console: &Console) -> Exit {
    // A text that an interrupted replacement has left may be all there is.
    held::recover(&order.scene);
    if let Some(absent) = absent(&order.scene) {
        console.diagnostics(&[absent]);
        return Exit::WRONG;
    }
    match live(order, console) {
        Ok(exit) => exit,
        Err((exit, message)) => console.fail(exit, &message),
    }
}

fn live(order: Order, console: &Console) -> Result<Exit, (Exit, String)> {
    let no_thread = |error: std::io::Error| (Exit::FAILED, start_failure("a thread", false, &error));
    let mut worker = start(order.nice).map_err(no_thread)?;
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
    let (remote, contents) = (worker.remote(), worker.contents());
    let asked = writes.clone();
    let outcome = tui::run(Options {
        scene: order.scene,
        overrides: order.overrides,
        color: order.color,
        preview: order.preview,
        cell_aspect: None,
        notify_after: Duration::try_from_secs_f64(order.notify_after).ok().filter(|time| !time.is_zero()),
        commands: Box::new(move |command| {
            match command {
                Command::Write => asked.order(),
                Command::Quit => asked.leave(),
                Command::Render(_)
                | Command::Preview(_)
                | Command::KeepCamera(_)
                | Command::UndoCamera(_)
                | Command::Pick(_)
                | Command::Cancel
                | Command::Suspend
                | Command::Pause(_) => {}
            }
            remote.send(command);
        }),
        events,
        previews: worker.previews.clone(),
        news,
    });
    let waits = |ended: &TuiOutcome| {
        ended.status == ExitStatus::QUIT && (ended.is_write_unanswered || writes.is_last_stage())
    };
    let has_ended = if worker.end_within(PATIENCE) || !outcome.as_ref().is_ok_and(waits) {
        worker.finish(Duration::ZERO)
    } else {
        console.say("waiting for the image that is being written; ctrl-c ends it without");
        worker.finish(Duration::MAX)
    };
    if has_ended {
        // It ends with the worker; a panic of it has nothing more to say.
        let _ = tap.join();
    }
    if let Ok(ended) = &outcome {
        let lost = contents.outputs.lost(&contents);
        last_words(&writes, ended, (has_ended, &lost, &call())).iter().for_each(|line| console.say(line));
    }
    let exit = |ended: TuiOutcome| match ended.status {
        ExitStatus::QUIT if ended.is_unwritten => Exit::FAILED,
        status => Exit(status.0),
    };
    outcome.map(exit).map_err(|error| {
        let exit = if matches!(error, TuiError::NotATerminal { .. }) { Exit::WRONG } else { Exit::FAILED };
        (exit, error.to_string())
    })
}

/// Outcomes of writing that the user does not know of. After `q` the summary follows if there are none, and if an order to write
/// was not carried out while earlier files exist. Then the checkpoint, and changes by keys that are lost. `lost`: outputs that
/// other programs have changed. `call`: this call, in words for a shell.
fn last_words(
    writes: &Writes,
    ended: &TuiOutcome,
    (has_ended, lost, call): (bool, &[(PathBuf, Lost)], &str),
) -> Vec<String> {
    let mut lines = writes.said(ended.is_write_unanswered, has_ended);
    let has_earlier_files = ended.is_write_unanswered && ended.has_written && !writes.has_written();
    let has_quit = ended.status == ExitStatus::QUIT;
    let has_summary = has_quit && (lines.is_empty() || has_earlier_files);
    if has_summary {
        let lost = lost.iter().map(|(path, lost)| format!("; {} {} since", path.display(), lost.words()));
        lines.push(ended.summary.clone() + &lost.collect::<String>());
    }
    // After SIGHUP the terminal is gone.
    match writes.checkpoint().filter(|_| ended.status != ExitStatus::HANGUP) {
        Some(Ok(_)) if has_summary => {
            lines.iter_mut().rev().take(1).for_each(|line| *line = format!("{line}; {call} continues"));
        }
        Some(Ok(path)) => {
            lines.push(format!("progress saved in {}; run glimt again to resume", path.display()));
        }
        Some(Err(message)) => lines.push(format!("warning: {message}")),
        None => {}
    }
    lines.extend(ended.not_kept.clone().filter(|_| has_quit));
    lines
}

/// This call, in words for a shell.
fn call() -> String {
    let words = std::env::args().skip(1).map(|word| match shlex::try_quote(&word) {
        Ok(quoted) => quoted.into_owned(),
        Err(_) => word.clone(),
    });
    format!("glimt {}", words.collect::<Vec<_>>().join(" "))
}

/// Error about a scene that does not exist at the start; glimt waits for a scene that disappears later.
fn absent(scene: &Path) -> Option<Diagnostic> {
    if scene.symlink_metadata().is_ok() {
        return None;
    }
    text_now(scene).err().map(|problem| *problem).filter(is_absence)
}

/// Outcomes of writing pictures.
#[derive(Clone, Debug, Default)]
struct Writes(Arc<Mutex<Heard>>);

#[derive(Debug, Default)]
struct Heard {
    /// A line for each picture since the last order to write, and whether it came after the front end was left.
    lines: Vec<(bool, String)>,
    /// Whether a picture was written since the last order to write.
    has_written: bool,
    has_left: bool,
    /// The checkpoint that was written after the front end was left, or the reason why there is none.
    checkpoint: Option<Result<PathBuf, String>>,
    /// Whether a request is at its last stage.
    is_last_stage: bool,
}

impl Writes {
    fn heard(&self) -> MutexGuard<'_, Heard> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A person asks for the picture.
    fn order(&self) {
        let mut heard = self.heard();
        heard.lines.clear();
        heard.has_written = false;
    }

    /// The front end is left.
    fn leave(&self) {
        self.heard().has_left = true;
    }

    fn has_written(&self) -> bool {
        self.heard().has_written
    }

    fn is_last_stage(&self) -> bool {
        self.heard().is_last_stage
    }

    fn hear(&self, event: &Event) {
        let mut heard = self.heard();
        let has_left = heard.has_left;
        match event {
            Event::Written { path, .. } => {
                heard.lines.push((has_left, format!("wrote {}", path.display())));
                heard.has_written = true;
            }
            Event::WriteFailed { message, .. } => heard.lines.push((has_left, format!("error: {message}"))),
            Event::Refused { conflicts, .. } => {
                let lines =
                    conflicts.iter().map(|conflict| (has_left, format!("error: {}", conflict.message)));
                heard.lines.extend(lines);
            }
            Event::Stage { stage, .. } => {
                heard.is_last_stage = stage.name == Stage::Write && stage.status == Status::Running;
            }
            Event::Done { .. } | Event::Failed { .. } | Event::Cancelled { .. } => {
                heard.is_last_stage = false;
            }
            Event::Checkpoint { news, .. } if has_left => match news {
                CheckpointNews::Written { path } => heard.checkpoint = Some(Ok(path.clone())),
                CheckpointNews::Failed { message } => heard.checkpoint = Some(Err(message.clone())),
                CheckpointNews::Resumed { .. }
                | CheckpointNews::Absent { .. }
                | CheckpointNews::Ignored { .. }
                | CheckpointNews::Unused { .. }
                | CheckpointNews::Finished { .. }
                | CheckpointNews::SetAside { .. } => {}
            },
            Event::Started { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Warnings { .. }
            | Event::NotKept { .. }
            | Event::Progress { .. }
            | Event::Preview { .. }
            | Event::WritePostponed { .. }
            | Event::WriteDone { .. }
            | Event::OwnImage { .. }
            | Event::LastGoodEnded { .. }
            | Event::Checkpoint { .. }
            | Event::Text { .. }
            | Event::CameraKept { .. }
            | Event::CameraUndone { .. }
            | Event::Picked { .. }
            | Event::Files { .. } => {}
        }
    }

    /// The checkpoint of a render that was left, or the reason why there is none.
    fn checkpoint(&self) -> Option<Result<PathBuf, String>> {
        self.heard().checkpoint.clone()
    }

    /// A line for each picture that a person does not know of: those after the front end was left; of an order that is
    /// unanswered all since then.
    fn said(&self, is_unanswered: bool, has_ended: bool) -> Vec<String> {
        let heard = self.heard();
        let unknown = heard.lines.iter().filter(|(has_left, _)| is_unanswered || *has_left);
        let mut lines: Vec<String> = unknown.map(|(_, line)| line.clone()).collect();
        if !has_ended && (is_unanswered || heard.is_last_stage) || is_unanswered && lines.is_empty() {
            lines.push("the image was not written: glimt was ended first".to_owned());
        }
        lines
    }
}

/// Passes events on; tells the watcher which files to watch, and notes which pictures were written.
fn tap(events: &Receiver<Event>, watcher: &Watcher, writes: &Writes, forward: impl Fn(Event) -> bool) {
    let mut is_heard = true;
    for mut event in events {
        writes.hear(&event);
        // The front end is gone: only what is still written counts.
        if !is_heard {
            continue;
        }
        if matches!(event, Event::Written { .. }) {
            watcher.watch_outputs();
        }
        if let Event::Files { files, read, since, .. } = &event {
            let (read, before) = files.split_at((*read).min(files.len()));
            watcher.set_files(read.to_vec(), before.to_vec(), *since);
        }
        if let Event::Failed { failure: Failure::Scene(all), .. } = &mut event {
            all.iter_mut().for_each(await_scene);
        }
        is_heard = forward(event);
    }
}

/// A scene that is not there may come (back): what watches it needs no other way out.
fn await_scene(problem: &mut Diagnostic) {
    if is_absence(problem) {
        // A typo, or a new name.
        let is_file = |help: &String| help.starts_with("did you mean") || help.contains(SAME_TEXT);
        let file = problem.help.take().filter(is_file);
        let file = file.map_or(String::new(), |help| format!("; {help}"));
        problem.help = Some(match missing_folder(&problem.path) {
            Some(folder) => format!(
                "the folder {} is not there; the scene is rendered as soon as both are{file}",
                visible(&folder.to_string_lossy())
            ),
            None => format!("it is rendered as soon as it is there{file}"),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_that_was_not_carried_out_is_told_beside_the_files_that_are_there() {
        let summary = "wrote a.png: 640×480, 4 samples, 1.39 s; the render after it was stopped at 0 %";
        let ended = |has_written| TuiOutcome {
            status: ExitStatus::QUIT,
            is_write_unanswered: true,
            summary: summary.to_owned(),
            has_written,
            is_unwritten: false,
            not_kept: None,
        };
        let writes = Writes::default();
        writes.hear(&Event::Written { generation: 1, path: "a.png".into(), bytes: 1, is_own: true });
        writes.order();
        writes.leave();
        let message = "the newest picture is not written".to_owned();
        writes.hear(&Event::WriteFailed { generation: 2, path: None, message });
        let error = "error: the newest picture is not written";
        let said = |ended: TuiOutcome| last_words(&writes, &ended, (true, &[], "glimt a.toml"));
        assert_eq!(said(ended(true)), [error, summary]);
        assert_eq!(said(ended(false)), [error]);
        writes.hear(&Event::Written { generation: 2, path: "a.png".into(), bytes: 1, is_own: true });
        assert_eq!(said(ended(true)), [error, "wrote a.png"]);
    }

    #[test]
    fn the_last_line_lists_changes_and_the_summary_says_what_became_of_the_files() {
        let ended = |status| TuiOutcome {
            status,
            is_write_unanswered: false,
            summary: "a.png not finished (10 %)".to_owned(),
            has_written: false,
            is_unwritten: false,
            not_kept: Some("not kept: --shadows off".to_owned()),
        };
        let writes = Writes::default();
        let lost = [(PathBuf::from("a.png"), Lost::Removed)];
        let said = |status, lost: &[(PathBuf, Lost)]| {
            last_words(&writes, &ended(status), (true, lost, "glimt a.toml --seed 1"))
        };
        let not_kept = "not kept: --shadows off";
        assert_eq!(said(ExitStatus::QUIT, &[]), ["a.png not finished (10 %)", not_kept]);
        let removed = "a.png not finished (10 %); a.png was removed since";
        assert_eq!(said(ExitStatus::QUIT, &lost), [removed, not_kept]);
        writes.leave();
        let news = CheckpointNews::Written { path: "a.png.checkpoint".into() };
        writes.hear(&Event::Checkpoint { generation: 1, news });
        let continues = "a.png not finished (10 %); glimt a.toml --seed 1 continues";
        assert_eq!(said(ExitStatus::QUIT, &[]), [continues, not_kept]);
        let saved = "progress saved in a.png.checkpoint; run glimt again to resume";
        assert_eq!(said(ExitStatus::TERMINATED, &[]), [saved]);
        assert_eq!(said(ExitStatus::HANGUP, &[]), [""; 0]);
    }

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
        let mut renamed = *crate::scene::text_now(Path::new("none.toml")).expect_err("there is none");
        renamed.help = Some(format!("third.toml {SAME_TEXT}"));
        await_scene(&mut renamed);
        assert!(renamed.help.is_some_and(|help| help.contains("third.toml")));
        let name = "gone/room.toml";
        assert!(
            said(name).ends_with("/gone is not there; the scene is rendered as soon as both are"),
            "{}",
            said(name)
        );
        std::fs::write(folder.path().join("rooms.toml"), "").expect("written");
        assert!(said("room.toml").contains("as soon as it is there; did you mean"));
        std::fs::write(folder.path().join("room.toml"), "").expect("written");
        assert!(!said("room.toml").contains("as soon as"), "another problem has its own way out");
    }
}
