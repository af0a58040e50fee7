//! Saves checkpoints, and moves checkpoints of other renders aside.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::super::film_state::FilmState;
use super::state::NonFilmRenderState;
use super::{
    CheckpointContext, Checkpointer, Interruption, not_a_checkpoint_message, read_checkpoint_header_and_state,
};
use crate::control::CancelToken;
use crate::film::Film;
use crate::integrators::RayCounters;
use crate::output::part::{self, PartError, PartFile, PartFileKind, PartHeader};
use crate::output::write::{Durability, ExistingFilePolicy};
use crate::output::{AttributeLossPolicy, OutputError};
use crate::protocol::CheckpointUpdate;

/// Checkpointing may take at most `1/TIME_SHARE` of the render time.
const TIME_SHARE: u32 = 100;

/// Extension appended to another render's checkpoint when it is moved aside.
const BACKUP_EXTENSION: &str = ".before";

impl Checkpointer<'_> {
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

    /// Saves a checkpoint. Returns whether it succeeded.
    pub(super) fn write_and_report(
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
        let head = self.create_header(PartFileKind::Checkpoint, state);
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
                Ok(_) if PartFile::read_header(at).is_ok_and(|head| head.kind == PartFileKind::Part) => {
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
                Err(PartError::Version { .. }) => self.back_up_unless(|_| false),
                Ok(head) if head.kind == PartFileKind::Part => {
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
        self.back_up_unless(is_longer)
    }

    /// Moves the checkpoint aside, unless `is_longer` returns true for one that was moved aside earlier.
    ///
    /// # Errors
    /// Returns why it cannot be moved.
    fn back_up_unless(&self, is_longer: impl Fn(&Path) -> bool) -> Result<(), String> {
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
}

fn finished_part_conflict_message(path: &Path) -> String {
    format!("{} is a finished part; name another file with -o", path.display())
}

fn held_by_another_message(path: &Path) -> String {
    format!("another running glimt uses {}; name another file with -o", path.display())
}
