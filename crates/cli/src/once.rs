//! `--once`: renders, writes the image and exits. Reports progress on stderr and prints nothing to stdout.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::console::Console;
use crate::exit::Exit;
use crate::lower::RenderRequest;
use crate::output::AnimationFormat;
use crate::pipeline::protocol::{
    CheckpointUpdate, Command, Event, Failure, Report, Request, Stage, StageReport, StageStatus,
    WriteRequirement, WriteWarning,
};
use crate::pipeline::settings::{EffectiveSettingsSummary, Overrides};
use crate::pipeline::turntable::{TurntableFrame, leftover_frames};
use crate::pipeline::{WorkerHandle, start_worker_with_channel};
use crate::progress::{self, Reporter};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::signals;
use crate::system::priority;
use crate::system::threads::describe_thread_start_failure;

/// Time limit for exiting after a signal.
const EXIT_TIMEOUT: Duration = Duration::from_secs(2);
/// Time limit for finishing an image after a signal. After this time, a checkpoint is written instead.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);
/// Interval for checking signals.
const TICK: Duration = Duration::from_millis(50);

/// Runs `--once`.
pub(super) fn run(render_request: &RenderRequest, console: &Console) -> Exit {
    // Lower the priority before starting threads, because threads inherit it.
    priority::lower_priority_including_spawned_threads(render_request.nice);
    let (worker, events) = match start_worker_with_channel(0) {
        Ok(started) => started,
        Err(error) => {
            return console.print_error(Exit::FAILED, &describe_thread_start_failure(1, false, &error));
        }
    };
    let remote = worker.command_sender();
    let was_signaled = AtomicBool::new(false);
    let ended = match signals::install_signal_handlers(move || {
        // Stop rendering and save a checkpoint. Finish a file that is being written unless a second signal
        // arrives.
        remote.send(Command::Suspend);
        if was_signaled.swap(true, Ordering::Relaxed) {
            remote.send(Command::Cancel);
        }
    }) {
        Ok(ended) => ended,
        Err(message) => return console.print_error(Exit::FAILED, &message),
    };
    let mut deadline = ExitDeadline::default();
    let mut written = CompletedWrites::default();
    let has_checkpoints = render_request.overrides.checkpoints.seconds > 0.0;
    let mut is_over = |is_writing: bool| {
        let now = Instant::now();
        // Without checkpoints, the image being written would be lost.
        let is_lost = is_writing && !has_checkpoints;
        if ended.signal_number().is_some() && !is_lost && deadline.check_write_timeout_once(now, is_writing) {
            worker.send(Command::Cancel);
        }
        ended.signal_number().is_some() && deadline.has_expired_since_first_call(now)
    };
    let (mut exit, mut is_whole) = (Exit::DONE, false);
    // Use one reporter per image to clear the progress of the previous frame.
    let reporter =
        || progress::create_reporter(render_request.progress, render_request.overrides.time_seconds, console);
    let mut image_reporter = reporter();
    for overrides in overrides_per_turntable_frame(&render_request.overrides) {
        let turn = overrides.turn;
        if let Some(TurntableFrame { number, of }) = turn.filter(|_| image_reporter.allows_text_results()) {
            console.print_line_to_stderr(&format!("frame {} of {of}", number + 1));
        }
        let generation = turn.map_or(1, |turn| u64::from(turn.number) + 1);
        let request = Request::new(generation, render_request.scene.clone(), overrides.clone());
        worker.send(Command::Render(Box::new(Request { write: WriteRequirement::Must, ..request })));
        image_reporter = reporter();
        let reporter = &mut *image_reporter;
        exit = handle_events(&worker, &events, &overrides, console, reporter, &mut written, &mut is_over);
        reporter.clear_output();
        is_whole = exit == Exit::DONE && turn.is_none_or(TurntableFrame::is_last);
        if exit != Exit::DONE || ended.signal_number().is_some() {
            break;
        }
    }
    let reporter = image_reporter;
    if !reporter.reports_diagnostics()
        && let Some(signal) = ended.signal_number().and_then(signals::signal_name)
    {
        console.print_line_to_stderr(&format!(
            "terminated by {signal}: {}",
            describe_images_so_far(is_whole, &written)
        ));
    }
    worker.stop_or_abandon(deadline.time_left(Instant::now()));
    ended.signal_number().map_or(exit, Exit::from_signal)
}

/// Returns the overrides for each render request: a single request, or one per turntable frame.
fn overrides_per_turntable_frame(overrides: &Overrides) -> impl Iterator<Item = Overrides> {
    let count = overrides.turn.map_or(1, |turn| turn.of);
    (0..count).map(|number| {
        let turn = overrides.turn.map(|turn| TurntableFrame { number, ..turn });
        Overrides { turn, ..overrides.clone() }
    })
}

/// Describes the images written before a signal. `is_whole` means that all images were written.
fn describe_images_so_far(is_whole: bool, written: &CompletedWrites) -> String {
    let names: Vec<_> = written.images.iter().map(|path| path.display().to_string()).collect();
    let kept = written
        .checkpoint
        .as_ref()
        .map(|path| format!("progress saved in {}; use --resume to continue", path.display()));
    let words = match names.as_slice() {
        [] => return kept.unwrap_or_else(|| "no image was written".to_owned()),
        [_] if is_whole => return "the image was written".to_owned(),
        _ if is_whole => return "all images were written".to_owned(),
        [only] => format!("only {only} was written"),
        [first, .., last] => format!("only {} images were written, {first} to {last}", names.len()),
    };
    [words].into_iter().chain(kept).collect::<Vec<_>>().join("; ")
}

/// The files written so far.
#[derive(Debug, Default)]
struct CompletedWrites {
    images: Vec<PathBuf>,
    /// The last checkpoint.
    checkpoint: Option<PathBuf>,
}

/// The time at which glimt exits without waiting for the worker: [`EXIT_TIMEOUT`] after the first query.
#[derive(Debug, Default)]
struct ExitDeadline {
    end: Option<Instant>,
    /// Whether the write stage was canceled because it took too long.
    is_write_stopped: bool,
}

impl ExitDeadline {
    fn has_expired_since_first_call(&mut self, now: Instant) -> bool {
        now >= *self.end.get_or_insert(now + EXIT_TIMEOUT)
    }

    /// Returns true the first time it is called after writing has taken too long. If an image was being
    /// written, extends the deadline so that a checkpoint can be written.
    fn check_write_timeout_once(&mut self, now: Instant, is_image: bool) -> bool {
        let end = *self.end.get_or_insert(now + EXIT_TIMEOUT);
        if self.is_write_stopped || now + EXIT_TIMEOUT < end + WRITE_TIMEOUT {
            return false;
        }
        self.is_write_stopped = true;
        if is_image {
            self.end = Some(now + EXIT_TIMEOUT);
        }
        true
    }

    /// Time left for the worker.
    fn time_left(&self, now: Instant) -> Duration {
        self.end.map_or(EXIT_TIMEOUT, |end| end.saturating_duration_since(now))
    }
}

/// Handles events until the request is finished or aborted by a signal.
fn handle_events(
    worker: &WorkerHandle,
    events: &Receiver<Event>,
    overrides: &Overrides,
    console: &Console,
    reporter: &mut dyn Reporter,
    written: &mut CompletedWrites,
    mut is_over: impl FnMut(bool) -> bool,
) -> Exit {
    let mut is_writing = false;
    let mut unwritten: Vec<String> = Vec::new();
    let mut call_warnings: Vec<Diagnostic> = Vec::new();
    // Warnings about the first frame apply to all frames.
    let is_first = overrides.turn.is_none_or(|turn| turn.number == 0);
    let before = written.images.len();
    loop {
        if is_over(is_writing) {
            return Exit::FAILED;
        }
        let mut event = match events.recv_timeout(TICK) {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => {
                return console.print_error(Exit::FAILED, "internal error: the worker thread has exited");
            }
        };
        // Report warnings about the arguments together with warnings about the scene.
        if let Event::Settings { settings, .. } = &event {
            call_warnings.extend(ineffective_option_warnings(overrides, settings));
        } else if let Event::Stage { stage, .. } = &event
            && !is_first
            && has_stage_reread_changed_file(stage)
        {
            worker.send(Command::Cancel);
            reporter.clear_output();
            let what = "the scene or one of its files changed during the turntable";
            return console.print_error(Exit::FAILED, what);
        } else if let Event::Checkpoint { news, .. } = &event {
            report_checkpoint_update(news, &mut call_warnings, reporter, console);
        } else if let Event::WriteWarning { warning, .. } = &event {
            call_warnings.push(written_file_warning(warning));
        } else if let Event::Done { warnings, .. } = &mut event {
            warnings.append(&mut call_warnings);
            warnings.retain(|_| is_first);
        }
        if let Event::Stage { stage, .. } = &event {
            is_writing = stage.name == Stage::Write && stage.status == StageStatus::Running;
        }
        reporter.handle_event(&event);
        match event {
            Event::Written { path, .. } => written.images.push(path),
            Event::Checkpoint { news: CheckpointUpdate::Written { path }, .. } => {
                written.checkpoint = Some(path);
            }
            // The report or one of several images could not be written. If no image can be written, the
            // request fails.
            Event::WriteFailed { message, .. } => unwritten.push(message),
            Event::Done { report, warnings, .. } => {
                reporter.clear_output();
                if !reporter.reports_diagnostics() {
                    console.print_diagnostics(&warnings);
                }
                return report_written_and_failed_images(
                    &report,
                    &written.images[before..],
                    overrides.turn,
                    &unwritten,
                    console,
                    reporter,
                );
            }
            Event::Failed { failure, .. } => {
                reporter.clear_output();
                if reporter.reports_diagnostics() {
                    return exit_code_for_failure(&failure);
                }
                unwritten
                    .iter()
                    .for_each(|message| console.print_line_to_stderr(&format!("error: {message}")));
                return report_failure(&failure, console);
            }
            Event::Canceled { .. } => return Exit::FAILED,
            Event::Started { .. }
            | Event::Stage { .. }
            | Event::Files { .. }
            | Event::Warnings { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Progress { .. }
            | Event::Preview { .. }
            | Event::WriteWarning { .. }
            | Event::Refused { .. }
            | Event::OwnImage { .. }
            | Event::WritePostponed { .. }
            | Event::WriteDone { .. }
            | Event::LastGoodEnded { .. }
            | Event::Checkpoint { .. }
            | Event::Text { .. }
            | Event::CameraKept { .. }
            | Event::CameraUndone { .. }
            | Event::Picked { .. } => {}
        }
    }
}

/// Whether a stage read a file that has changed since the previous frame.
fn has_stage_reread_changed_file(stage: &StageReport) -> bool {
    matches!(stage.name, Stage::Parse | Stage::Meshes | Stage::Textures) && stage.status == StageStatus::Done
}

/// Reports checkpoint news and warnings immediately, while the user can still react.
fn report_checkpoint_update(
    news: &CheckpointUpdate,
    call_warnings: &mut Vec<Diagnostic>,
    reporter: &dyn Reporter,
    console: &Console,
) {
    let say = |text: String| {
        if reporter.allows_text_results() {
            console.print_line_to_stderr(&text);
        }
    };
    let mut warn = |message: &str, help: &str| {
        if reporter.reports_diagnostics() {
            call_warnings.push(argument_warning(message, help));
        } else {
            console.print_diagnostics(&[argument_warning(message, help)]);
        }
    };
    match news {
        CheckpointUpdate::Written { .. } => {}
        CheckpointUpdate::Failed { message } => {
            warn(message, "use --checkpoint 0 to render without checkpoints");
        }
        CheckpointUpdate::Resumed { path, samples } => {
            say(format!("Resuming from {} at {samples} samples", path.display()));
        }
        CheckpointUpdate::Absent { path } => {
            say(format!("No checkpoint {}; starting from the beginning", path.display()));
        }
        CheckpointUpdate::Ignored { path } => {
            let message = format!("ignoring {}, a checkpoint of this image", path.display());
            warn(&message, "use --resume to continue from it");
        }
        CheckpointUpdate::Unused { path, why } => {
            say(format!("Ignoring {}: {why}; starting from the beginning", path.display()));
        }
        CheckpointUpdate::Finished { path } => {
            say(format!("{} is already finished", path.display()));
        }
        CheckpointUpdate::SetAside { path } => {
            say(format!("Saved the checkpoint of another render as {}", path.display()));
        }
    }
}

/// Creates a warning about a file that has been written.
fn written_file_warning(problem: &WriteWarning) -> Diagnostic {
    match problem {
        WriteWarning::AttributesLost { .. } => {
            argument_warning(&problem.to_string(), "use -o FILE to keep the old file")
        }
        WriteWarning::NotSynchronized { .. } => {
            argument_warning(&problem.to_string(), "check the disk, then run `sync`")
        }
    }
}

/// Creates a warning about the arguments.
fn argument_warning(message: &str, help: &str) -> Diagnostic {
    Diagnostic {
        severity: Severity::Warning,
        message: message.to_owned(),
        path: PathBuf::new(),
        place: None,
        help: Some(help.to_owned()),
    }
}

/// Returns warnings about options that have no effect. The terminal UI has its own messages for these
/// options.
fn ineffective_option_warnings(
    requested: &Overrides,
    settings: &EffectiveSettingsSummary,
) -> Vec<Diagnostic> {
    let dof = (requested.dof == Some(true) && !settings.dof).then(|| {
        let help = "set `aperture` in [camera], for example to 0.1";
        argument_warning("--dof on has no effect: the camera's aperture is 0", help)
    });
    let photons = (requested.photons == Some(true) && !settings.photons).then(|| {
        let help = "use `--integrator whitted`";
        argument_warning("--photons on has no effect: photons work with whitted only", help)
    });
    dof.into_iter().chain(photons).collect()
}

fn report_written_and_failed_images(
    report: &Report,
    written: &[PathBuf],
    turn: Option<TurntableFrame>,
    unwritten: &[String],
    console: &Console,
    reporter: &dyn Reporter,
) -> Exit {
    if reporter.allows_text_results() {
        written
            .iter()
            .for_each(|path| console.print_line_to_stderr(&describe_written_image(path, report, turn)));
    }
    if let Some(turn) = turn.filter(|turn| turn.is_last()) {
        written
            .iter()
            .filter_map(|path| leftover_frames_warning(path, turn))
            .for_each(|message| console.print_line_to_stderr(&message));
    }
    if !reporter.reports_diagnostics() {
        unwritten.iter().for_each(|message| console.print_line_to_stderr(&format!("error: {message}")));
    }
    if unwritten.is_empty() { Exit::DONE } else { Exit::FAILED }
}

/// Returns a warning about files left over from an earlier, longer turntable, if any.
fn leftover_frames_warning(last: &Path, turn: TurntableFrame) -> Option<String> {
    let left = leftover_frames(last, turn);
    let (first, more) = (left.first()?.display(), left.len() - 1);
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Some(format!("warning: {first}{more} left over from an earlier, longer turntable"))
}

fn report_failure(failure: &Failure, console: &Console) -> Exit {
    match failure {
        Failure::Scene(diagnostics) => console.print_diagnostics(diagnostics),
        Failure::Work(message) => console.print_line_to_stderr(&format!("error: {message}")),
    }
    exit_code_for_failure(failure)
}

fn exit_code_for_failure(failure: &Failure) -> Exit {
    match failure {
        Failure::Scene(_) => Exit::WRONG,
        Failure::Work(_) => Exit::FAILED,
    }
}

/// Describes a written image, as in `wrote cornell.png (640×480, 64 samples, 1.93 s)`.
fn describe_written_image(path: &Path, report: &Report, turn: Option<TurntableFrame>) -> String {
    let image = &report.image;
    if let Some(turn) = turn.filter(|_| AnimationFormat::from_path(path).is_some()) {
        return format!("wrote {} ({}×{}, {} frames)", path.display(), image.width, image.height, turn.of);
    }
    let samples = match (image.samples.min, image.samples.max) {
        (1, 1) => "1 sample".to_owned(),
        (min, max) if min == max => format!("{max} samples"),
        (min, max) => format!("{min} to {max} samples"),
    };
    let seconds = progress::format_seconds(report.seconds);
    format!("wrote {} ({}×{}, {samples}, {seconds})", path.display(), image.width, image.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_lost_attributes_suggest_another_file() {
        let path = PathBuf::from("a.png");
        let lost = WriteWarning::AttributesLost { path: path.clone(), lost: vec!["its owner".to_owned()] };
        let unsynchronized = WriteWarning::NotSynchronized { path, why: "input/output error".to_owned() };
        for (problem, has_option) in [(lost, true), (unsynchronized, false)] {
            let Diagnostic { severity, message, help, .. } = written_file_warning(&problem);
            assert_eq!((severity, message), (Severity::Warning, problem.to_string()));
            assert_eq!(help.is_some_and(|help| help.contains("-o FILE")), has_option, "{problem}");
        }
    }

    #[test]
    fn deadline_starts_at_the_first_query() {
        let signal = Instant::now();
        let half = signal + EXIT_TIMEOUT / 2;
        let mut deadline = ExitDeadline::default();
        assert_eq!(deadline.time_left(half), EXIT_TIMEOUT, "without a signal");
        assert!(
            !deadline.has_expired_since_first_call(signal) && !deadline.has_expired_since_first_call(half)
        );
        assert_eq!(deadline.time_left(half), EXIT_TIMEOUT / 2);
        assert!(deadline.has_expired_since_first_call(signal + EXIT_TIMEOUT));
        assert_eq!(deadline.time_left(signal + EXIT_TIMEOUT), Duration::ZERO);
    }

    #[test]
    fn slow_writes_are_stopped_for_a_checkpoint() {
        let signal = Instant::now();
        for (is_image, end) in [(true, WRITE_TIMEOUT + EXIT_TIMEOUT), (false, EXIT_TIMEOUT)] {
            let mut deadline = ExitDeadline::default();
            let mut stops = |after| deadline.check_write_timeout_once(signal + after, is_image);
            assert!(!stops(Duration::ZERO) && !stops(WRITE_TIMEOUT / 2));
            assert!(stops(WRITE_TIMEOUT) && !stops(EXIT_TIMEOUT), "once");
            assert!(
                !deadline.has_expired_since_first_call(signal + end - TICK)
                    && deadline.has_expired_since_first_call(signal + end)
            );
        }
    }
}
