//! Connects the worker, the file watcher and the terminal UI.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::lower::RenderRequest;
use crate::output::held;
use crate::pipeline::protocol::{
    CheckpointUpdate, Command, Event, Failure, SavedSceneRenderStatus, Stage, StageStatus,
};
use crate::pipeline::watch::{
    ExternalChange, FileHashCache, FilePathAndContentId, Watcher, find_missing_folder,
};
use crate::pipeline::{not_a_scene_file_error, start_worker};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::sanitize::escape_invisible_chars;
use crate::scene::{SAME_TEXT, is_scene_not_found_diagnostic, read_scene_file_text};
use crate::system::threads::describe_thread_start_failure;
use crate::tui::messages::{OLDER_THAN_EDIT, WAITING_FOR_FILE};
use crate::tui::{self, EventQueue, EventSender, ExitStatus, TuiError, TuiOptions, TuiOutcome};

/// How long to wait at exit for an image to be written. After that, glimt exits if it received a signal; if
/// the user quit with a key, it prints a message and keeps waiting.
const EXIT_TIMEOUT: Duration = Duration::from_secs(2);

/// Line printed if glimt exits before the image is written.
const NOT_WRITTEN: &str = "the image was not written: glimt exited first";

/// Runs the terminal UI.
pub(super) fn run(request: RenderRequest, console: &Console) -> Exit {
    // Restore a scene whose replacement was interrupted.
    held::recover_backup(&request.scene);
    if let Some(absent) = scene_not_found_error(&request.scene) {
        console.print_diagnostics(&[absent]);
        return Exit::WRONG;
    }
    match run_terminal_ui(request, console) {
        Ok(exit) => exit,
        Err((exit, message)) => console.print_error(exit, &message),
    }
}

fn run_terminal_ui(request: RenderRequest, console: &Console) -> Result<Exit, (Exit, String)> {
    let no_thread = |error: std::io::Error| (Exit::FAILED, describe_thread_start_failure(1, false, &error));
    let (contents, events) = (Arc::<FileHashCache>::default(), EventQueue::default());
    let changes = events.watcher_sender();
    let watcher = Watcher::start(request.poll, Arc::clone(&contents), move |change| changes.send(change))
        .map_err(no_thread)?;
    let writes = SharedWriteLog::default();
    let forwarder = WorkerEventForwarder { watcher, writes: writes.clone(), ui: events.worker_sender() };
    let worker =
        start_worker(request.nice, Arc::clone(&contents), move |event| forwarder.handle_event(event))
            .map_err(no_thread)?;
    let (remote, asked) = (worker.command_sender(), writes.clone());
    let options = TuiOptions {
        scene: request.scene,
        overrides: request.overrides,
        color: request.color,
        preview: request.preview,
        cell_aspect: None,
        notify_after: Duration::try_from_secs_f64(request.notify_after).ok().filter(|time| !time.is_zero()),
        commands: Box::new(move |command| {
            match command {
                Command::Write => asked.clear_for_write_command(),
                Command::Quit => asked.record_ui_exit(),
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
        previews: worker.previews.clone(),
    };
    let outcome = tui::run(options, events);
    let waits = |ended: &TuiOutcome| {
        ended.status == ExitStatus::QUIT && (ended.is_write_unanswered || writes.is_in_write_stage())
    };
    let has_ended = if worker.stop_within(EXIT_TIMEOUT) || !outcome.as_ref().is_ok_and(waits) {
        worker.stop_or_abandon(Duration::ZERO)
    } else {
        console.print_line_to_stderr("waiting for the image to be written; press ctrl-c to quit without it");
        worker.stop_or_abandon(Duration::MAX)
    };
    if let Ok(ended) = &outcome {
        let lost = contents.outputs.list_external_changes(&contents);
        let is_older = ended.is_current && writes.is_image_older_than_inputs(&contents);
        exit_summary_lines(&writes, ended, has_ended, is_older, &lost, &shell_quoted_command_line())
            .iter()
            .for_each(|line| console.print_line_to_stderr(line));
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

/// Returns the lines to print after the terminal UI exits: unreported writes, the summary, the checkpoint and
/// the changes that were not kept. The summary is printed only after `q`, in two cases: all writes were
/// reported, or a write failed but earlier files exist. `is_older` is true if the images are older than the
/// scene. `lost` contains the outputs changed by other programs. `call` is the command line glimt was started
/// with.
fn exit_summary_lines(
    writes: &SharedWriteLog,
    ended: &TuiOutcome,
    has_ended: bool,
    is_older: bool,
    lost: &[(PathBuf, ExternalChange)],
    call: &str,
) -> Vec<String> {
    let mut lines = writes.unreported_lines(ended, has_ended);
    let has_earlier_files =
        ended.is_write_unanswered && ended.has_written && !writes.has_written_since_command();
    let has_quit = ended.status == ExitStatus::QUIT;
    let has_summary = has_quit && (lines.is_empty() || has_earlier_files);
    if has_summary {
        let lost = lost.iter().map(|(path, lost)| format!("; {} {} since", path.display(), lost.describe()));
        let older = if is_older { OLDER_THAN_EDIT } else { "" };
        lines.push(ended.summary.clone() + older + &lost.collect::<String>());
    }
    // After SIGHUP the terminal is gone.
    match writes.exit_checkpoint_result().filter(|_| ended.status != ExitStatus::HANGUP) {
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

/// Returns the command line glimt was started with, quoted for a shell.
fn shell_quoted_command_line() -> String {
    let words = std::env::args().skip(1).map(|word| match shlex::try_quote(&word) {
        Ok(quoted) => quoted.into_owned(),
        Err(_) => word.clone(),
    });
    format!("glimt {}", words.collect::<Vec<_>>().join(" "))
}

/// Returns an error if the scene does not exist at startup. If the scene disappears later, glimt waits for
/// it.
fn scene_not_found_error(scene: &Path) -> Option<Diagnostic> {
    if scene.symlink_metadata().is_ok() {
        return None;
    }
    let problem =
        not_a_scene_file_error(scene).or_else(|| read_scene_file_text(scene).err().map(|problem| *problem));
    problem.filter(is_scene_not_found_diagnostic)
}

/// A log of written images, shared between threads.
#[derive(Clone, Debug, Default)]
struct SharedWriteLog(Arc<Mutex<WriteLog>>);

/// A log of written images.
#[derive(Debug, Default)]
struct WriteLog {
    /// Lines about images written since the last write command, each with its event number.
    lines: Vec<(u64, String)>,
    /// Number of events about written, failed, and refused images.
    results: u64,
    /// Whether an image was written since the last write command.
    has_written: bool,
    has_left: bool,
    /// The checkpoint written after the UI exited, or an error message.
    checkpoint: Option<Result<PathBuf, String>>,
    /// Whether a request is in its last stage.
    is_last_stage: bool,
    /// The last request that read files before the UI exited, and the files it read.
    read: (u64, Vec<FilePathAndContentId>),
    /// The files from which the scene's own image was rendered, or `None` if that image is not written.
    image_files: Option<Vec<FilePathAndContentId>>,
}

impl SharedWriteLog {
    fn lock_log(&self) -> MutexGuard<'_, WriteLog> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Records a write command from the user.
    fn clear_for_write_command(&self) {
        let mut log = self.lock_log();
        log.lines.clear();
        log.has_written = false;
    }

    /// Records that the UI has exited.
    fn record_ui_exit(&self) {
        self.lock_log().has_left = true;
    }

    fn has_written_since_command(&self) -> bool {
        self.lock_log().has_written
    }

    fn is_in_write_stage(&self) -> bool {
        self.lock_log().is_last_stage
    }

    fn record_event(&self, event: &Event) {
        let mut log = self.lock_log();
        let has_left = log.has_left;
        let number = log.results;
        log.results += u64::from(event.is_write_result());
        match event {
            Event::Written { generation, path, is_own, unfinished, .. } => {
                log.lines.push((number, format!("wrote {}", path.display())));
                log.has_written = true;
                if *is_own && unfinished.is_none() && *generation == log.read.0 {
                    log.image_files = Some(log.read.1.clone());
                }
            }
            Event::WriteFailed { message, .. } => log.lines.push((number, format!("error: {message}"))),
            Event::Refused { conflicts, .. } => {
                let lines = conflicts.iter().map(|conflict| (number, format!("error: {}", conflict.message)));
                log.lines.extend(lines);
            }
            Event::Stage { stage, .. } => {
                log.is_last_stage = stage.name == Stage::Write && stage.status == StageStatus::Running;
            }
            Event::Done { generation, report, .. } => {
                log.is_last_stage = false;
                let is_written = report.stages[Stage::Write as usize].status != StageStatus::Skipped;
                if is_written && *generation == log.read.0 {
                    log.image_files = Some(log.read.1.clone());
                }
            }
            Event::Failed { .. } | Event::Canceled { .. } => log.is_last_stage = false,
            Event::Checkpoint { news, .. } if has_left => match news {
                CheckpointUpdate::Written { path } => log.checkpoint = Some(Ok(path.clone())),
                CheckpointUpdate::Failed { message } => log.checkpoint = Some(Err(message.clone())),
                CheckpointUpdate::Resumed { .. }
                | CheckpointUpdate::Absent { .. }
                | CheckpointUpdate::Ignored { .. }
                | CheckpointUpdate::Unused { .. }
                | CheckpointUpdate::Finished { .. }
                | CheckpointUpdate::SetAside { .. } => {}
            },
            Event::Started { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Warnings { .. }
            | Event::WriteWarning { .. }
            | Event::Progress { .. }
            | Event::Preview { .. }
            | Event::WritePostponed { .. }
            | Event::WriteDone { .. }
            | Event::LastGoodEnded { .. }
            | Event::Checkpoint { .. }
            | Event::Text { .. }
            | Event::CameraKept { .. }
            | Event::CameraUndone { .. }
            | Event::Picked { .. } => {}
            // Ignore requests after the UI has exited, which are not finished.
            Event::Files { .. } | Event::OwnImage { .. } if has_left => {}
            Event::Files { generation, files, .. } => log.read = (*generation, files.clone()),
            Event::OwnImage { state, .. } => {
                let is_written = *state == SavedSceneRenderStatus::Written;
                log.image_files = is_written.then(|| log.read.1.clone());
            }
        }
    }

    /// Whether the scene's own image is older than the files on disk, for example because the user saved the
    /// scene and quit at once.
    fn is_image_older_than_inputs(&self, contents: &FileHashCache) -> bool {
        let files = self.lock_log().image_files.take();
        let now = |path: &Path| contents.read_content_id(path, &CancelToken::new());
        files.is_none_or(|files| files.iter().any(|file| now(&file.path) != Ok(file.content)))
    }

    /// Returns the checkpoint written after the UI exited, or an error message.
    fn exit_checkpoint_result(&self) -> Option<Result<PathBuf, String>> {
        self.lock_log().checkpoint.clone()
    }

    /// Returns the lines about images that the UI did not report: images from events it did not handle, or
    /// all images since an unanswered write command.
    fn unreported_lines(&self, ended: &TuiOutcome, has_ended: bool) -> Vec<String> {
        let log = self.lock_log();
        let is_unanswered = ended.is_write_unanswered;
        let unknown = log.lines.iter().filter(|(number, _)| is_unanswered || *number >= ended.write_results);
        let mut lines: Vec<String> = unknown.map(|(_, line)| line.clone()).collect();
        if !has_ended && (is_unanswered || log.is_last_stage) || is_unanswered && lines.is_empty() {
            lines.push(NOT_WRITTEN.to_owned());
        }
        lines
    }
}

/// Passes the worker's events to the terminal UI, the watcher and the log of written images.
struct WorkerEventForwarder {
    watcher: Watcher,
    writes: SharedWriteLog,
    ui: EventSender<Event>,
}

impl WorkerEventForwarder {
    fn handle_event(&self, mut event: Event) {
        self.writes.record_event(&event);
        if matches!(event, Event::Written { .. }) {
            self.watcher.watch_outputs();
        }
        if let Event::Files { files, read, since, .. } = &event {
            let (read, before) = files.split_at((*read).min(files.len()));
            self.watcher.set_files(read.to_vec(), before.to_vec(), *since);
        }
        if let Event::Failed { failure: Failure::Scene(all), .. } = &mut event {
            all.iter_mut().for_each(add_waiting_for_scene_help);
        }
        self.ui.send(event);
    }
}

/// Changes the help text for a missing scene to say that the UI waits for the scene to appear.
fn add_waiting_for_scene_help(problem: &mut Diagnostic) {
    if is_scene_not_found_diagnostic(problem) {
        // Keep a suggestion for a typo or a renamed scene.
        let is_file = |help: &String| help.starts_with("did you mean") || help.contains(SAME_TEXT);
        let file = problem.help.take().filter(is_file);
        let file = file.map_or(String::new(), |help| format!("; {help}"));
        problem.help = Some(match find_missing_folder(&problem.path) {
            Some(folder) => format!(
                "waiting for the folder {} and the scene to appear{file}",
                escape_invisible_chars(&folder.to_string_lossy())
            ),
            None => format!("{WAITING_FOR_FILE}{file}"),
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_writes_are_reported_before_the_summary() {
        let summary = "wrote a.png: 640×480, 4 samples, 1.39 s; the next render was stopped at 0 %";
        let ended = |has_written| TuiOutcome {
            status: ExitStatus::QUIT,
            is_write_unanswered: true,
            summary: summary.to_owned(),
            is_current: false,
            write_results: 0,
            has_written,
            is_unwritten: false,
            not_kept: None,
        };
        let written = |generation| {
            let path = "a.png".into();
            Event::Written { generation, path, bytes: 1, is_own: true, unfinished: None }
        };
        let writes = SharedWriteLog::default();
        writes.record_event(&written(1));
        writes.clear_for_write_command();
        writes.record_ui_exit();
        let message = "the latest image is not written".to_owned();
        writes.record_event(&Event::WriteFailed { generation: 2, path: None, message });
        let error = "error: the latest image is not written";
        let said = |ended: TuiOutcome| exit_summary_lines(&writes, &ended, true, false, &[], "glimt a.toml");
        assert_eq!(said(ended(true)), [error, summary]);
        assert_eq!(said(ended(false)), [error]);
        writes.record_event(&written(2));
        assert_eq!(said(ended(true)), [error, "wrote a.png"]);
    }

    #[test]
    fn summary_includes_lost_files_and_changes() {
        let ended = |status| TuiOutcome {
            status,
            is_write_unanswered: false,
            summary: "a.png not finished (10 %)".to_owned(),
            is_current: false,
            write_results: 0,
            has_written: false,
            is_unwritten: false,
            not_kept: Some("not kept: --shadows off".to_owned()),
        };
        let writes = SharedWriteLog::default();
        let lost = [(PathBuf::from("a.png"), ExternalChange::Removed)];
        let said = |status, lost: &[(PathBuf, ExternalChange)]| {
            exit_summary_lines(&writes, &ended(status), true, false, lost, "glimt a.toml --seed 1")
        };
        let not_kept = "not kept: --shadows off";
        assert_eq!(said(ExitStatus::QUIT, &[]), ["a.png not finished (10 %)", not_kept]);
        let removed = "a.png not finished (10 %); a.png was removed since";
        assert_eq!(said(ExitStatus::QUIT, &lost), [removed, not_kept]);
        writes.record_ui_exit();
        let news = CheckpointUpdate::Written { path: "a.png.checkpoint".into() };
        writes.record_event(&Event::Checkpoint { generation: 1, news });
        let continues = "a.png not finished (10 %); glimt a.toml --seed 1 continues";
        assert_eq!(said(ExitStatus::QUIT, &[]), [continues, not_kept]);
        let saved = "progress saved in a.png.checkpoint; run glimt again to resume";
        assert_eq!(said(ExitStatus::TERMINATED, &[]), [saved]);
        assert_eq!(said(ExitStatus::HANGUP, &[]), [""; 0]);
    }

    #[test]
    fn image_is_outdated_after_an_unread_save() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "1").expect("written");
        let (writes, contents) = (SharedWriteLog::default(), FileHashCache::default());
        let content = contents.read_content_id(&path, &CancelToken::new()).expect("never canceled");
        let read = || Event::Files {
            generation: 1,
            files: vec![FilePathAndContentId { path: path.clone(), content }],
            read: 1,
            since: std::time::Instant::now(),
        };
        let own = |state| writes.record_event(&Event::OwnImage { generation: 1, state });
        writes.record_event(&read());
        own(SavedSceneRenderStatus::Written);
        assert!(!writes.is_image_older_than_inputs(&contents));
        own(SavedSceneRenderStatus::Written);
        std::fs::write(&path, "22").expect("written");
        assert!(writes.is_image_older_than_inputs(&contents));
        // A request has read the new scene, but has not rendered its image.
        own(SavedSceneRenderStatus::NotBegun);
        assert!(writes.is_image_older_than_inputs(&contents));
        let ended = TuiOutcome {
            status: ExitStatus::QUIT,
            is_write_unanswered: false,
            summary: "wrote a.png".to_owned(),
            is_current: true,
            write_results: 0,
            has_written: true,
            is_unwritten: false,
            not_kept: None,
        };
        let said = |is_older| exit_summary_lines(&writes, &ended, true, is_older, &[], "glimt a.toml");
        assert_eq!(said(false), ["wrote a.png"]);
        assert_eq!(said(true), [format!("wrote a.png{OLDER_THAN_EDIT}")]);
    }

    #[test]
    fn unshown_image_written_before_exit_is_reported() {
        let writes = SharedWriteLog::default();
        let written = || {
            let path = "a.png".into();
            Event::Written { generation: 1, path, bytes: 1, is_own: true, unfinished: None }
        };
        writes.record_event(&written());
        let ended = |write_results| TuiOutcome {
            status: ExitStatus::QUIT,
            is_write_unanswered: false,
            summary: "a.png not finished (3 %)".to_owned(),
            is_current: false,
            write_results,
            has_written: false,
            is_unwritten: false,
            not_kept: None,
        };
        let said = |seen| exit_summary_lines(&writes, &ended(seen), true, false, &[], "glimt a.toml");
        assert_eq!(said(0), ["wrote a.png"]);
        assert_eq!(said(1), ["a.png not finished (3 %)"]);
    }

    #[test]
    fn help_for_missing_scenes_mentions_waiting() {
        let folder = tempfile::tempdir().expect("a folder");
        let said = |name: &str| {
            let [mut problem] = crate::scene::load(&folder.path().join(name), &[])
                .expect_err("the scene is missing")
                .try_into()
                .expect("one problem");
            add_waiting_for_scene_help(&mut problem);
            problem.help.expect("a help text")
        };
        assert_eq!(said("room.toml"), WAITING_FOR_FILE);
        let mut renamed =
            *crate::scene::read_scene_file_text(Path::new("none.toml")).expect_err("the scene is missing");
        renamed.help = Some(format!("third.toml {SAME_TEXT}"));
        add_waiting_for_scene_help(&mut renamed);
        assert!(renamed.help.is_some_and(|help| help.contains("third.toml")));
        let name = "gone/room.toml";
        assert!(said(name).contains("/gone ") && said(name).starts_with("waiting"), "{}", said(name));
        std::fs::write(folder.path().join("rooms.toml"), "").expect("written");
        assert!(said("room.toml").starts_with(&format!("{WAITING_FOR_FILE}; did you mean")));
        std::fs::write(folder.path().join("room.toml"), "").expect("written");
        assert!(!said("room.toml").contains(WAITING_FOR_FILE), "other problems keep their help");
    }
}
