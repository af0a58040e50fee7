//! Restores a film from a checkpoint or from a finished part.

use super::super::film_state::FilmState;
use super::state::NonFilmRenderState;
use super::{Checkpointer, not_a_checkpoint_message};
use crate::control::CancelToken;
use crate::messages;
use crate::output::part::{self, PartError, PartFile, PartFileKind, PartHeader};
use crate::protocol::CheckpointUpdate;
use crate::settings::ResumeMode;
use crate::stages::AbortReason;

impl Checkpointer<'_> {
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
            Ok(file) if file.head.kind == PartFileKind::Part => file,
            // Earlier checks ensure that a part never replaces a checkpoint.
            Ok(_) => return Ok(false),
            Err(error) => {
                self.send_update(CheckpointUpdate::Unused { path, why: rejection_message(&error) });
                return Ok(false);
            }
        };
        let mut differences = self.differences_from(&file.head, state);
        let PartHeader { scene, references, .. } = file.head.clone();
        let head = PartHeader { scene, references, ..self.create_header(PartFileKind::Part, state) };
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
        state.update_sample_counts_from_film();
        state.is_finished_part = true;
        self.send_update(CheckpointUpdate::Finished { path });
        Ok(true)
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
        file.check_kind(PartFileKind::Checkpoint)?;
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
        state.update_sample_counts_from_film();
        if !state.has_at_most_samples(samples) {
            return Err(other(vec![messages::oversampled_checkpoint_message(samples)]));
        }
        Ok(())
    }
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
