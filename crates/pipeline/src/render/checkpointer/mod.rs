//! Saves and restores render checkpoints.

mod lock;
mod state;

use std::cell::{Cell, OnceCell, RefCell};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub(crate) use self::lock::CheckpointLock;
use self::state::NonFilmRenderState;
use super::film_state::FilmState;
use super::share::Shard;
use crate::control::CancelToken;
use crate::film::Film;
use crate::identity::ImageDependencies;
use crate::inputs::ProtectedInputs;
use crate::integrators::RayCounters;
use crate::messages;
use crate::output::part::{
    self, ImageHeader, NamedRenderInput, PartError, PartFile, PartHeader, PartOrCheckpoint, PartShare,
    render_input_differences,
};
use crate::output::write::{Durability, ExistingFilePolicy};
use crate::output::{AttributeLossPolicy, FilmEncodingSettings, OutputError};
use crate::protocol::{CheckpointUpdate, Event};
use crate::settings::{CheckpointSettings, ResumeMode};
use crate::sink::EventSink;
use crate::stages::AbortReason;
use crate::system::describe_error;
use crate::system::file::open_regular_file;

/// Checkpointing may take at most `1/TIME_SHARE` of the render time.
const TIME_SHARE: u32 = 100;

/// Extension appended to the output file name.
const CHECKPOINT_EXTENSION: &str = ".checkpoint";

/// Creates the header of a part or checkpoint file.
pub(crate) fn create_header(
    kind: PartOrCheckpoint,
    state: &FilmState,
    identity: Vec<NamedRenderInput>,
    finish: &FilmEncodingSettings,
) -> PartHeader {
    let share = to_part_share(state.share.as_ref());
    let (picture, scene) = (ImageHeader::from_film(&state.film, finish), String::new());
    PartHeader { kind, identity, share, picture, scene, references: Vec::new() }
}

fn to_part_share(share: Option<&Shard>) -> PartShare {
    match share {
        Some(share) => PartShare {
            index: share.index,
            count: share.count,
            block_count: share.image_block_count(),
            blocks: share.sample_block_indices().to_vec(),
        },
        None => PartShare { index: 1, count: 1, block_count: 0, blocks: Vec::new() },
    }
}

/// Extension appended to another render's checkpoint when it is moved aside.
const BACKUP_EXTENSION: &str = ".before";

/// Returns the checkpoint path for an output file.
pub(crate) fn checkpoint_path(output: &Path) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(CHECKPOINT_EXTENSION);
    name.into()
}

/// Reasons for interrupting a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interruption {
    /// The user requested another image, or none at all. The render will not be resumed.
    Replaced,
    /// The user quit. A long render will be resumed later.
    Left,
    /// The process is being terminated. The render will be resumed later.
    Ended,
}

/// Context for rendering with checkpoints.
pub(crate) struct CheckpointContext<'a> {
    pub(crate) finish: FilmEncodingSettings,
    /// Everything that affects the image.
    pub(crate) dependencies: ImageDependencies<'a>,
    pub(crate) inputs: &'a ProtectedInputs,
    pub(crate) sink: &'a EventSink,
    /// The process's checkpoint state.
    pub(crate) lock: &'a RefCell<CheckpointLock>,
}

/// Saves and restores the checkpoints of one render.
pub(crate) struct Checkpointer<'a> {
    output: PathBuf,
    path: PathBuf,
    settings: CheckpointSettings,
    around: CheckpointContext<'a>,
    /// Names and values of the dependencies, which are slow to compute.
    identity: OnceCell<Vec<NamedRenderInput>>,
    due: Cell<Instant>,
    /// Whether the checkpoint held by this process belongs to this render.
    is_own: Cell<bool>,
}

impl<'a> Checkpointer<'a> {
    /// Creates a checkpointer for an output file.
    pub(crate) fn new(output: &Path, settings: CheckpointSettings, around: CheckpointContext<'a>) -> Self {
        Self {
            output: output.to_owned(),
            path: checkpoint_path(output),
            settings,
            around,
            identity: OnceCell::new(),
            due: Cell::new(Instant::now() + Duration::from_secs_f64(settings.seconds.min(1e9))),
            is_own: Cell::new(false),
        }
    }

    fn current_render_inputs(&self) -> &[NamedRenderInput] {
        self.identity.get_or_init(|| self.around.dependencies.names_and_values())
    }

    /// Restores an empty film from a checkpoint if the settings request it, or from the output file if it
    /// already contains this part. Returns whether the film is usable. If not, the render must start with a
    /// new film.
    ///
    /// # Errors
    /// A requested checkpoint belongs to another image, is damaged or has too many samples, or the output
    /// file is a part of another render.
    pub(crate) fn resume(&self, state: &mut FilmState, samples: u32) -> Result<bool, AbortReason> {
        let resume = self.settings.resume;
        let is_there = self.path.symlink_metadata().is_ok();
        if resume == ResumeMode::Asked && self.restore_from_finished_output(state)? {
            return Ok(true);
        }
        match resume {
            ResumeMode::No | ResumeMode::IfSame if !is_there => return Ok(true),
            ResumeMode::Asked if !is_there => {
                self.send_update(CheckpointUpdate::Absent { path: self.path.clone() });
                return Ok(true);
            }
            ResumeMode::No | ResumeMode::Asked | ResumeMode::IfSame => {}
        }
        if resume != ResumeMode::Asked && !part::is_part_or_checkpoint(&self.path) {
            self.report_failure(&format!("{} {}", self.path.display(), not_a_checkpoint_message(&self.path)));
            return Ok(true);
        }
        if resume == ResumeMode::No {
            let is_same = PartFile::read_header(&self.path)
                .is_ok_and(|head| self.differences_from(&head, state).is_empty());
            if is_same {
                self.send_update(CheckpointUpdate::Ignored { path: self.path.clone() });
            }
            return Ok(true);
        }
        let Err(error) = self.restore(state, samples) else {
            self.around.lock.borrow_mut().lock_abandoned_checkpoint(&self.path);
            self.is_own.set(true);
            let (path, samples) = (self.path.clone(), state.min_unfinished_samples(samples));
            self.send_update(CheckpointUpdate::Resumed { path, samples });
            return Ok(true);
        };
        if resume == ResumeMode::Asked {
            return Err(AbortReason::failure_with_remedy(
                format!("--resume: {error}"),
                "remove --resume to start over, or name another file with -o",
            ));
        }
        if self.around.lock.borrow_mut().record_first_report_of_file(&self.path) {
            self.send_update(CheckpointUpdate::Unused {
                path: self.path.clone(),
                why: rejection_message(&error),
            });
        }
        Ok(!state.has_samples())
    }

    /// Restores the film from the output file if the file already contains this part. Returns whether the
    /// film was restored.
    ///
    /// # Errors
    /// The output file is a part of another render.
    fn restore_from_finished_output(&self, state: &mut FilmState) -> Result<bool, AbortReason> {
        if state.share.is_none() || !part::is_part_or_checkpoint(&self.output) {
            return Ok(false);
        }
        let path = self.output.clone();
        let file = match PartFile::open_and_validate(&self.output, &CancelToken::new()) {
            Ok(file) if file.head.kind == PartOrCheckpoint::Part => file,
            // Earlier checks ensure that a part never replaces a checkpoint.
            Ok(_) => return Ok(false),
            Err(error) => {
                self.send_update(CheckpointUpdate::Unused { path, why: rejection_message(&error) });
                return Ok(false);
            }
        };
        let mut differences = self.differences_from(&file.head, state);
        let PartHeader { scene, references, .. } = file.head.clone();
        let head = PartHeader { scene, references, ..self.create_header(PartOrCheckpoint::Part, state) };
        if differences.is_empty() && file.head != head {
            differences.push("the output settings differ".to_owned());
        }
        let refused = |error: PartError| {
            let remedy = "remove --resume to replace it, or name another file with -o";
            Err(AbortReason::failure_with_remedy(format!("--resume: {error}"), remedy))
        };
        if !differences.is_empty() {
            return refused(PartError::Other { path, other: "this call".to_owned(), differences });
        }
        if let Err(error) = file.restore_into_film(&state.film) {
            return refused(error);
        }
        state.recount_samples();
        state.is_finished_part = true;
        self.send_update(CheckpointUpdate::Finished { path });
        Ok(true)
    }

    /// Moves another render's checkpoint aside, unless this render includes all of its samples. If another
    /// checkpoint was moved aside earlier, keeps the checkpoint with the longer render time.
    ///
    /// # Errors
    /// Returns why the checkpoint cannot be moved, for example because another process has locked it.
    fn move_other_checkpoint_aside(&self, state: &FilmState, rays: RayCounters) -> Result<(), String> {
        let is_held = self.around.lock.borrow().is_held_by_this_process(&self.path);
        if is_held && self.is_own.get() {
            return Ok(());
        }
        if self.around.lock.borrow().is_held_by_another_process(&self.path) {
            return Err(held_by_another_message(&self.path));
        }
        let Some((head, there)) = read_checkpoint_header_and_state(&self.path) else {
            return match PartFile::read_header(&self.path) {
                Err(PartError::Version { .. }) => self.back_up_unless_backup_is_longer(|_| false),
                Ok(head) if head.kind == PartOrCheckpoint::Part => {
                    Err(finished_part_conflict_message(&self.path))
                }
                Ok(_)
                | Err(
                    PartError::Unreadable { .. }
                    | PartError::NotRegular { .. }
                    | PartError::Foreign { .. }
                    | PartError::Unfinished { .. }
                    | PartError::Damaged { .. }
                    | PartError::Kind { .. }
                    | PartError::Other { .. }
                    | PartError::Doubled { .. }
                    | PartError::Missing { .. }
                    | PartError::Film(_)
                    | PartError::Canceled(_),
                ) => Ok(()),
            };
        };
        if self.is_superseded_by_this_render(&head, &there, state, rays) {
            return Ok(());
        }
        let is_longer = |aside: &Path| {
            read_checkpoint_header_and_state(aside).is_some_and(|(_, before)| before.seconds >= there.seconds)
        };
        self.back_up_unless_backup_is_longer(is_longer)
    }

    /// Moves the checkpoint aside, unless `is_longer` returns true for one that was moved aside earlier.
    ///
    /// # Errors
    /// Returns why it cannot be moved.
    fn back_up_unless_backup_is_longer(&self, is_longer: impl Fn(&Path) -> bool) -> Result<(), String> {
        let mut aside = self.path.as_os_str().to_owned();
        aside.push(BACKUP_EXTENSION);
        let aside = PathBuf::from(aside);
        if is_longer(&aside) {
            return Ok(());
        }
        if aside.symlink_metadata().is_ok() && read_checkpoint_header_and_state(&aside).is_none() {
            return Err(format!(
                "cannot move the existing checkpoint aside: {} exists and is not a checkpoint",
                aside.display()
            ));
        }
        std::fs::rename(&self.path, &aside).map_err(|error| format!("{}: {error}", self.path.display()))?;
        self.send_update(CheckpointUpdate::SetAside { path: aside });
        Ok(())
    }

    /// Whether a checkpoint belongs to this image and contains no more work than this render.
    fn is_superseded_by_this_render(
        &self,
        head: &PartHeader,
        there: &NonFilmRenderState,
        state: &FilmState,
        rays: RayCounters,
    ) -> bool {
        let has_rays = state.is_finished_part || there.camera_rays() <= rays.camera_rays;
        self.differences_from(head, state).is_empty() && has_rays
    }

    fn restore(&self, state: &mut FilmState, samples: u32) -> Result<(), PartError> {
        let path = self.path.clone();
        let other =
            |differences| PartError::Other { path: path.clone(), other: "this call".to_owned(), differences };
        let unlike = self.differences_from(&PartFile::read_header(&self.path)?, state);
        if !unlike.is_empty() {
            return Err(other(unlike));
        }
        let file = PartFile::open_and_validate(&self.path, &CancelToken::new())?;
        file.check_kind(PartOrCheckpoint::Checkpoint)?;
        // Validate the whole file before changing anything.
        let damaged = |why: &str| PartError::Damaged { path: path.clone(), why: why.to_owned() };
        let read: NonFilmRenderState =
            serde_json::from_value(file.state.clone()).map_err(|_| damaged("its state is invalid"))?;
        if !read.is_plausible() {
            return Err(damaged("its state contains implausible numbers"));
        }
        if !read.matches_film_size(state) {
            return Err(damaged("its state does not match the film"));
        }
        file.restore_into_film(&state.film)?;
        read.restore_into(state).ok_or_else(|| damaged("its state does not match the film"))?;
        state.recount_samples();
        if !state.has_at_most_samples(samples) {
            return Err(other(vec![messages::oversampled_checkpoint_message(samples)]));
        }
        Ok(())
    }

    fn create_header(&self, kind: PartOrCheckpoint, state: &FilmState) -> PartHeader {
        create_header(kind, state, self.current_render_inputs().to_vec(), &self.around.finish)
    }

    /// Returns the differences between a file header and this render.
    fn differences_from(&self, head: &PartHeader, state: &FilmState) -> Vec<String> {
        let mut unlike =
            render_input_differences(&head.identity, self.current_render_inputs(), "there", "here");
        let share = to_part_share(state.share.as_ref());
        let name = |share: &PartShare| match share.count {
            1 => "the whole image".to_owned(),
            count => format!("part {}/{count}", share.index),
        };
        if unlike.is_empty() && head.share != share {
            unlike.push(format!("it contains {}, but this run renders {}", name(&head.share), name(&share)));
        }
        unlike
    }

    /// Saves a checkpoint if one is due.
    pub(crate) fn save_if_due(&self, state: &FilmState, rays: RayCounters, seconds: f64) {
        if Instant::now() < self.due.get() {
            return;
        }
        let begin = Instant::now();
        self.write_and_report(state, rays, seconds, Durability::Power);
        let pause = Duration::from_secs_f64(self.settings.seconds.min(1e9)).max(begin.elapsed() * TIME_SHARE);
        self.due.set(Instant::now() + pause);
    }

    /// When a render is canceled, saves a checkpoint if it will be resumed later. Returns whether one was
    /// saved.
    pub(crate) fn save_if_canceled(
        &self,
        state: &FilmState,
        rays: RayCounters,
        seconds: f64,
        interruption: Interruption,
    ) -> bool {
        let is_kept = match interruption {
            Interruption::Replaced => false,
            // Update an existing checkpoint even after a short render.
            Interruption::Left => seconds >= self.settings.seconds || self.is_own.get(),
            Interruption::Ended => true,
        };
        // Do not wait for the disk, because the process is being terminated.
        is_kept && state.has_samples() && self.write_and_report(state, rays, seconds, Durability::Process)
    }

    /// Checks whether this process has already saved a checkpoint of this render during an earlier request.
    pub(crate) fn detect_own_checkpoint(&self, state: &FilmState) {
        let is_held = self.around.lock.borrow().is_held_by_this_process(&self.path);
        let is_own = is_held
            && PartFile::read_header(&self.path)
                .is_ok_and(|head| self.differences_from(&head, state).is_empty());
        self.is_own.set(is_own);
    }

    /// Removes the checkpoint once the image has been written, or saves a final one if checkpoints are kept.
    /// If the image was not written, saves a checkpoint if checkpoints are kept, the render was long, or the
    /// process is being terminated.
    pub(crate) fn finish(
        &self,
        state: &FilmState,
        rays: RayCounters,
        is_written: bool,
        interruption: Interruption,
    ) {
        let was_long = state.render_seconds >= self.settings.seconds;
        let is_ended = match interruption {
            Interruption::Ended => true,
            Interruption::Left | Interruption::Replaced => false,
        };
        match (is_written, self.settings.are_kept) {
            (false, false) if !was_long && !is_ended => return,
            (false, _) | (true, true) => {
                let durability = if is_ended { Durability::Process } else { Durability::Power };
                self.write_and_report(state, rays, state.render_seconds, durability);
                return;
            }
            (true, false) => {}
        }
        // Keep the checkpoint if it belongs to another image or to another running process, or if it has more
        // samples.
        let is_done = |(head, there)| self.is_superseded_by_this_render(&head, &there, state, rays);
        let mut lock = self.around.lock.borrow_mut();
        let is_own = self.is_own.get() && lock.is_held_by_this_process(&self.path);
        if is_own
            || !lock.is_held_by_another_process(&self.path)
                && read_checkpoint_header_and_state(&self.path).is_some_and(is_done)
        {
            lock.release();
            // A failure to remove the checkpoint is harmless.
            let _ = std::fs::remove_file(&self.path);
        }
    }

    /// Saves a checkpoint. Returns whether it succeeded.
    fn write_and_report(
        &self,
        state: &FilmState,
        rays: RayCounters,
        seconds: f64,
        durability: Durability,
    ) -> bool {
        // 0 disables checkpoints.
        if self.settings.seconds <= 0.0 {
            return false;
        }
        if let Err(why) = self.move_other_checkpoint_aside(state, rays) {
            self.report_failure(&why);
            return false;
        }
        let head = self.create_header(PartOrCheckpoint::Checkpoint, state);
        let written = serde_json::to_value(NonFilmRenderState::from_film_state(state, rays, seconds))
            .map_err(|error| OutputError::File { path: self.path.clone(), source: error.into() })
            .and_then(|value| self.save_and_keep_locked(&head, &state.film, &value, durability));
        match &written {
            Ok(()) => {
                self.is_own.set(true);
                self.send_update(CheckpointUpdate::Written { path: self.path.clone() });
            }
            Err(error) => self.report_failure(&error.to_string()),
        }
        written.is_ok()
    }

    /// Saves a checkpoint and keeps it locked. Never replaces other kinds of files.
    fn save_and_keep_locked(
        &self,
        head: &PartHeader,
        film: &Film,
        state: &serde_json::Value,
        durability: Durability,
    ) -> Result<(), OutputError> {
        let (path, CheckpointContext { inputs, lock, .. }) = (&self.path, &self.around);
        let may_replace = |at: &Path| {
            let refused = |reason| Err(OutputError::Refused { reason });
            match at.symlink_metadata() {
                Ok(_) if !part::is_part_or_checkpoint(at) || inputs.contains_path(at) => refused(format!(
                    "cannot write {}: the existing file {}",
                    path.display(),
                    not_a_checkpoint_message(at)
                )),
                Ok(_) if PartFile::read_header(at).is_ok_and(|head| head.kind == PartOrCheckpoint::Part) => {
                    Err(OutputError::Refused { reason: finished_part_conflict_message(path) })
                }
                // Another process may have locked the file since the last check.
                Ok(_) if lock.borrow().is_held_by_another_process(at) => {
                    refused(held_by_another_message(path))
                }
                Ok(_) | Err(_) => Ok(()),
            }
        };
        let guard = ExistingFilePolicy {
            is_kept: &|path| inputs.contains_path(path),
            may_replace: &may_replace,
            sweep: None,
            losses: AttributeLossPolicy::Report(&|_| ()),
        };
        // This write is short and never canceled, because it may have been triggered by a signal.
        let file = part::save(path, head, film, state, &guard, &CancelToken::new(), durability)?;
        lock.borrow_mut().keep_open(path, file);
        Ok(())
    }

    fn report_failure(&self, why: &str) {
        let CheckpointContext { sink, lock, .. } = &self.around;
        if lock.borrow_mut().record_first_failure_of_request(sink.generation) {
            self.send_update(CheckpointUpdate::Failed { message: format!("no checkpoint: {why}") });
        }
    }

    fn send_update(&self, news: CheckpointUpdate) {
        let sink = self.around.sink;
        sink.send(Event::Checkpoint { generation: sink.generation, news });
    }
}

fn finished_part_conflict_message(path: &Path) -> String {
    format!("{} is a finished part; name another file with -o", path.display())
}

fn held_by_another_message(path: &Path) -> String {
    format!("another running glimt uses {}; name another file with -o", path.display())
}

/// Returns the reason for not using a file, without the file name.
fn rejection_message(error: &PartError) -> String {
    match error {
        PartError::Other { differences, .. } => differences.join("; "),
        PartError::Damaged { why, .. } => format!("{}: {why}", messages::DAMAGED),
        PartError::Unfinished { bytes, .. } => format!("truncated at byte {bytes}"),
        PartError::Version { found, known, .. } => {
            format!("format version {found}, but this glimt reads version {known}")
        }
        PartError::Unreadable { .. }
        | PartError::NotRegular { .. }
        | PartError::Foreign { .. }
        | PartError::Kind { .. }
        | PartError::Doubled { .. }
        | PartError::Missing { .. }
        | PartError::Film(_)
        | PartError::Canceled(_) => error.to_string(),
    }
}

/// Reads the header and state of a valid checkpoint.
fn read_checkpoint_header_and_state(path: &Path) -> Option<(PartHeader, NonFilmRenderState)> {
    let file = PartFile::open_and_validate(path, &CancelToken::new()).ok()?;
    file.check_kind(PartOrCheckpoint::Checkpoint).ok()?;
    let state: NonFilmRenderState = serde_json::from_value(file.state).ok()?;
    state.is_plausible().then_some((file.head, state))
}
/// Describes why a file does not count as a checkpoint: its content, or an error when opening it.
fn not_a_checkpoint_message(path: &Path) -> String {
    // Opening a pipe would block.
    open_regular_file(path).map_or_else(
        |error| format!("cannot be read: {}", describe_error(&error)),
        |_| messages::NOT_A_CHECKPOINT.to_owned(),
    )
}
