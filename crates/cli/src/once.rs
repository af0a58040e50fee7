//! `--once`: render, write, exit; progress on stderr, nothing on stdout.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

use crate::console::Console;
use crate::exit::Exit;
use crate::lower::Order;
use crate::output::MovingFormat;
use crate::pipeline::protocol::{
    CheckpointNews, Command, Event, Failure, Report, Request, Stage, StageReport, Status, Writing,
};
use crate::pipeline::settings::{Effective, Overrides};
use crate::pipeline::turntable::{Turn, left_over};
use crate::pipeline::{Handle, start};
use crate::progress::{self, Reporter};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::signals;
use crate::system::priority;
use crate::system::threads::start_failure;

/// Longest time that the end may take after a signal.
const PATIENCE: Duration = Duration::from_secs(2);
/// Time after a signal in which a picture that is being written may become whole. Then a checkpoint takes its place.
const WRITING: Duration = Duration::from_secs(1);
/// Between two looks for a signal.
const TICK: Duration = Duration::from_millis(50);

pub(super) fn run(order: &Order, console: &Console) -> Exit {
    // Before the first thread starts: all of them give way.
    priority::lower_priority(order.nice);
    let worker = match start(0) {
        Ok(worker) => worker,
        Err(error) => return console.fail(Exit::FAILED, &start_failure("a thread", false, &error)),
    };
    let remote = worker.remote();
    let is_again = AtomicBool::new(false);
    let ended = match signals::catch(move || {
        // The render ends with a checkpoint. What is being written becomes whole, unless a second signal comes.
        remote.send(Command::Suspend);
        if is_again.swap(true, Ordering::Relaxed) {
            remote.send(Command::Cancel);
        }
    }) {
        Ok(ended) => ended,
        Err(error) => return console.fail(Exit::FAILED, &format!("cannot listen to signals: {error}")),
    };
    let mut deadline = Deadline::default();
    let mut written = Written::default();
    let has_checkpoints = order.overrides.checkpoints.seconds > 0.0;
    let mut is_over = |is_writing: bool| {
        let now = Instant::now();
        // Without checkpoints nothing else keeps a picture that is being written.
        let is_lost = is_writing && !has_checkpoints;
        if ended.by().is_some() && !is_lost && deadline.stops_writing(now, is_writing) {
            worker.send(Command::Cancel);
        }
        ended.by().is_some() && deadline.is_over(now)
    };
    let (mut exit, mut is_whole) = (Exit::DONE, false);
    // One reporter for each picture: what a turntable shows of the one before is cleared.
    let reporter = || progress::reporter(order.progress, order.overrides.time_seconds, console);
    let mut reporter_of_picture = reporter();
    for overrides in pictures(&order.overrides) {
        let turn = overrides.turn;
        if let Some(Turn { number, of }) = turn.filter(|_| reporter_of_picture.says_results()) {
            console.say(&format!("picture {} of {of}", number + 1));
        }
        worker.send(Command::Render(Box::new(Request {
            generation: turn.map_or(1, |turn| u64::from(turn.number) + 1),
            scene: order.scene.clone(),
            overrides,
            preview: None,
            write: Writing::Must,
            own: None,
            force: false,
            first: None,
        })));
        reporter_of_picture = reporter();
        let reporter = &mut *reporter_of_picture;
        exit = follow(&worker, (order, turn), console, reporter, &mut written, &mut is_over);
        reporter.end();
        is_whole = exit == Exit::DONE && turn.is_none_or(Turn::is_last);
        if exit != Exit::DONE || ended.by().is_some() {
            break;
        }
    }
    let reporter = reporter_of_picture;
    if !reporter.says_diagnostics()
        && let Some(signal) = ended.by().and_then(signals::name)
    {
        console.say(&format!("ended by {signal}: {}", outcome(is_whole, &written)));
    }
    worker.finish(deadline.left(Instant::now()));
    ended.by().map_or(exit, Exit::signal)
}

/// The requests of a call: one, or one for each picture of a turntable.
fn pictures(overrides: &Overrides) -> impl Iterator<Item = Overrides> {
    let count = overrides.turn.map_or(1, |turn| turn.of);
    (0..count).map(|number| {
        let turn = overrides.turn.map(|turn| Turn { number, ..turn });
        Overrides { turn, ..overrides.clone() }
    })
}

/// Words about the pictures when a signal ends the program; `is_whole`: all of them are written.
fn outcome(is_whole: bool, written: &Written) -> String {
    let names: Vec<_> = written.pictures.iter().map(|path| path.display().to_string()).collect();
    let kept = written
        .checkpoint
        .as_ref()
        .map(|path| format!("{} has what was rendered; --resume goes on from it", path.display()));
    let words = match names.as_slice() {
        [] => return kept.unwrap_or_else(|| "no picture was written".to_owned()),
        [_] if is_whole => return "the picture was written".to_owned(),
        _ if is_whole => return "the pictures were written".to_owned(),
        [only] => format!("only {only} was written"),
        [first, .., last] => format!("only {} pictures were written, {first} to {last}", names.len()),
    };
    [words].into_iter().chain(kept).collect::<Vec<_>>().join("; ")
}

/// Files that were written.
#[derive(Debug, Default)]
struct Written {
    pictures: Vec<PathBuf>,
    /// The last checkpoint.
    checkpoint: Option<PathBuf>,
}

/// When the program ends whatever the worker is at: [`PATIENCE`] after it was first asked for.
#[derive(Debug, Default)]
struct Deadline {
    end: Option<Instant>,
    /// Whether the picture that was being written is given up.
    is_write_stopped: bool,
}

impl Deadline {
    fn is_over(&mut self, now: Instant) -> bool {
        now >= *self.end.get_or_insert(now + PATIENCE)
    }

    /// Whether what is being written has had its time. The checkpoint of a picture then has as much as after a signal in the render.
    /// True once.
    fn stops_writing(&mut self, now: Instant, is_picture: bool) -> bool {
        let end = *self.end.get_or_insert(now + PATIENCE);
        if self.is_write_stopped || now + PATIENCE < end + WRITING {
            return false;
        }
        self.is_write_stopped = true;
        if is_picture {
            self.end = Some(now + PATIENCE);
        }
        true
    }

    /// Time that the worker may still take.
    fn left(&self, now: Instant) -> Duration {
        self.end.map_or(PATIENCE, |end| end.saturating_duration_since(now))
    }
}

/// Follows the request until it is over or a signal ends it.
fn follow(
    worker: &Handle,
    (order, turn): (&Order, Option<Turn>),
    console: &Console,
    reporter: &mut dyn Reporter,
    written: &mut Written,
    mut is_over: impl FnMut(bool) -> bool,
) -> Exit {
    let mut is_writing = false;
    let mut unwritten: Vec<String> = Vec::new();
    let mut of_call: Vec<Diagnostic> = Vec::new();
    // Warnings about the first picture hold for all.
    let is_first = turn.is_none_or(|turn| turn.number == 0);
    let before = written.pictures.len();
    loop {
        if is_over(is_writing) {
            return Exit::FAILED;
        }
        let mut event = match worker.events.recv_timeout(TICK) {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return console.fail(Exit::FAILED, "the worker is gone"),
        };
        // Warnings about the call come with those about the scene.
        if let Event::Settings { settings, .. } = &event {
            of_call.extend(without_effect(&order.overrides, settings));
        } else if let Event::Stage { stage, .. } = &event
            && !is_first
            && is_read_again(stage)
        {
            worker.send(Command::Cancel);
            reporter.end();
            let what = "the scene or a file of it has changed: the pictures would not be of one turntable";
            return console.fail(Exit::FAILED, what);
        } else if let Event::Checkpoint { news, .. } = &event {
            hear(news, &mut of_call, reporter, console);
        } else if let Event::NotKept { message, .. } = &event {
            of_call.push(warning(message, "another name with -o FILE leaves the old file as it is"));
        } else if let Event::Done { warnings, .. } = &mut event {
            warnings.append(&mut of_call);
            warnings.retain(|_| is_first);
        }
        if let Event::Stage { stage, .. } = &event {
            is_writing = stage.name == Stage::Write && stage.status == Status::Running;
        }
        reporter.event(&event);
        match event {
            Event::Written { path, .. } => written.pictures.push(path),
            Event::Checkpoint { news: CheckpointNews::Written { path }, .. } => {
                written.checkpoint = Some(path);
            }
            // The report, or one of several pictures; the last picture that cannot be written fails the request.
            Event::WriteFailed { message, .. } => unwritten.push(message),
            Event::Done { report, warnings, .. } => {
                reporter.end();
                if !reporter.says_diagnostics() {
                    console.diagnostics(&warnings);
                }
                return done(&report, (&written.pictures[before..], turn), &unwritten, console, reporter);
            }
            Event::Failed { failure, .. } => {
                reporter.end();
                if reporter.says_diagnostics() {
                    return exit_of(&failure);
                }
                unwritten.iter().for_each(|message| console.say(&format!("error: {message}")));
                return failed(&failure, console);
            }
            Event::Cancelled { .. } => return Exit::FAILED,
            Event::Started { .. }
            | Event::Stage { .. }
            | Event::Files { .. }
            | Event::Warnings { .. }
            | Event::Asset { .. }
            | Event::Settings { .. }
            | Event::Progress { .. }
            | Event::Preview { .. }
            | Event::NotKept { .. }
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

/// Whether a stage that reads files found another content than for the picture before.
fn is_read_again(stage: &StageReport) -> bool {
    matches!(stage.name, Stage::Parse | Stage::Meshes | Stage::Textures) && stage.status == Status::Done
}

/// Says what a person wants to know about checkpoints, at once: warnings as well, while something can be done.
fn hear(news: &CheckpointNews, of_call: &mut Vec<Diagnostic>, reporter: &dyn Reporter, console: &Console) {
    let say = |text: String| {
        if reporter.says_results() {
            console.say(&text);
        }
    };
    let mut warn = |message: &str, help: &str| {
        if reporter.says_diagnostics() {
            of_call.push(warning(message, help));
        } else {
            console.diagnostics(&[warning(message, help)]);
        }
    };
    match news {
        CheckpointNews::Written { .. } => {}
        CheckpointNews::Failed { message } => warn(message, "--checkpoint 0 renders without checkpoints"),
        CheckpointNews::Resumed { path, samples } => {
            say(format!("going on from {}, after {samples} samples", path.display()));
        }
        CheckpointNews::Absent { path } => {
            say(format!("there is no {}: starting from the beginning", path.display()));
        }
        CheckpointNews::Ignored { path } => {
            let message = format!("{} is of this picture, and is not used", path.display());
            warn(&message, "--resume goes on from it");
        }
        CheckpointNews::Unused { path, why } => {
            say(format!("{} is not used: {why}; starting from the beginning", path.display()));
        }
        CheckpointNews::Finished { path } => {
            say(format!("{} is finished already", path.display()));
        }
        CheckpointNews::SetAside { path } => {
            say(format!("the checkpoint of another render is {}", path.display()));
        }
    }
}

/// A warning about the call.
fn warning(message: &str, help: &str) -> Diagnostic {
    Diagnostic {
        severity: Severity::Warning,
        message: message.to_owned(),
        path: PathBuf::new(),
        place: None,
        help: Some(help.to_owned()),
    }
}

/// Warnings about options without effect. The terminal UI has its own words for these.
fn without_effect(asked: &Overrides, settings: &Effective) -> Vec<Diagnostic> {
    let dof = (asked.dof == Some(true) && !settings.dof).then(|| {
        let help = "give the scene's [camera] an `aperture`, such as 0.1";
        warning("--dof on has no effect: the scene's camera is a pinhole", help)
    });
    let photons = (asked.photons == Some(true) && !settings.photons).then(|| {
        let help = "`--integrator whitted` gathers photons";
        warning("--photons on has no effect: path gathers none", help)
    });
    dof.into_iter().chain(photons).collect()
}

fn done(
    report: &Report,
    (written, turn): (&[PathBuf], Option<Turn>),
    unwritten: &[String],
    console: &Console,
    reporter: &dyn Reporter,
) -> Exit {
    if reporter.says_results() {
        written.iter().for_each(|path| console.say(&wrote(path, report, turn)));
    }
    if let Some(turn) = turn.filter(|turn| turn.is_last()) {
        written.iter().filter_map(|path| longer(path, turn)).for_each(|message| console.say(&message));
    }
    if !reporter.says_diagnostics() {
        unwritten.iter().for_each(|message| console.say(&format!("error: {message}")));
    }
    if unwritten.is_empty() { Exit::DONE } else { Exit::FAILED }
}

/// Says which files of a longer turntable are behind the last picture of this one. `None` if there are none.
fn longer(last: &Path, turn: Turn) -> Option<String> {
    let left = left_over(last, turn);
    let (first, more) = (left.first()?.display(), left.len() - 1);
    let more = if more == 0 { String::new() } else { format!(" and {more} more") };
    Some(format!("warning: {first}{more}: of a longer turntable before; they are left as they are"))
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
fn wrote(path: &Path, report: &Report, turn: Option<Turn>) -> String {
    let image = &report.image;
    if let Some(turn) = turn.filter(|_| MovingFormat::of(path).is_some()) {
        return format!("wrote {} ({}×{}, {} frames)", path.display(), image.width, image.height, turn.of);
    }
    let samples = match (image.samples.min, image.samples.max) {
        (1, 1) => "1 sample".to_owned(),
        (min, max) if min == max => format!("{max} samples"),
        (min, max) => format!("{min} to {max} samples"),
    };
    let seconds = progress::seconds(report.seconds);
    format!("wrote {} ({}×{}, {samples}, {seconds})", path.display(), image.width, image.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_waited_after_once() {
        let signal = Instant::now();
        let half = signal + PATIENCE / 2;
        let mut deadline = Deadline::default();
        assert_eq!(deadline.left(half), PATIENCE, "without a signal");
        assert!(!deadline.is_over(signal) && !deadline.is_over(half));
        assert_eq!(deadline.left(half), PATIENCE / 2);
        assert!(deadline.is_over(signal + PATIENCE));
        assert_eq!(deadline.left(signal + PATIENCE), Duration::ZERO);
    }

    #[test]
    fn a_picture_that_is_written_too_slowly_leaves_the_time_of_a_checkpoint() {
        let signal = Instant::now();
        for (is_picture, end) in [(true, WRITING + PATIENCE), (false, PATIENCE)] {
            let mut deadline = Deadline::default();
            let mut stops = |after| deadline.stops_writing(signal + after, is_picture);
            assert!(!stops(Duration::ZERO) && !stops(WRITING / 2));
            assert!(stops(WRITING) && !stops(PATIENCE), "once");
            assert!(!deadline.is_over(signal + end - TICK) && deadline.is_over(signal + end));
        }
    }
}
