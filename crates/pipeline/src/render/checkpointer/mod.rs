//! Saves and restores render checkpoints.

mod lock;
mod resume;
mod save;
mod state;

use std::cell::{Cell, OnceCell, RefCell};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub(crate) use self::lock::ProcessCheckpointState;
use self::state::NonFilmRenderState;
use super::film_state::FilmState;
use super::share::Shard;
use crate::control::CancelToken;
use crate::identity::ImageDependencies;
use crate::inputs::ProtectedInputs;
use crate::integrators::RayCounters;
use crate::messages;
use crate::output::FilmEncodingSettings;
use crate::output::part::{
    ImageHeader, NamedRenderInput, PartFile, PartFileKind, PartHeader, PartShare, render_input_differences,
};
use crate::output::write::Durability;
use crate::protocol::{CheckpointUpdate, Event};
use crate::settings::CheckpointSettings;
use crate::sink::EventSink;
use crate::system::describe_io_error;
use crate::system::file::open_regular_file;

/// Extension appended to the output file name.
const CHECKPOINT_EXTENSION: &str = ".checkpoint";

/// Creates the header of a part or checkpoint file.
pub(crate) fn create_header(
    kind: PartFileKind,
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
            block_count: share.image_sample_block_count(),
            blocks: share.sample_block_indices().to_vec(),
        },
        None => PartShare { index: 1, count: 1, block_count: 0, blocks: Vec::new() },
    }
}

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
    pub(crate) lock: &'a RefCell<ProcessCheckpointState>,
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

    fn create_header(&self, kind: PartFileKind, state: &FilmState) -> PartHeader {
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
    pub(crate) fn remove_or_save_checkpoint(
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

    fn report_failure(&self, why: &str) {
        let CheckpointContext { sink, lock, .. } = &self.around;
        if lock.borrow_mut().record_failure_and_check_first(sink.generation) {
            self.send_update(CheckpointUpdate::Failed { message: format!("no checkpoint: {why}") });
        }
    }

    fn send_update(&self, news: CheckpointUpdate) {
        let sink = self.around.sink;
        sink.send(Event::Checkpoint { generation: sink.generation, news });
    }
}

/// Reads the header and state of a valid checkpoint.
fn read_checkpoint_header_and_state(path: &Path) -> Option<(PartHeader, NonFilmRenderState)> {
    let file = PartFile::open_and_validate(path, &CancelToken::new()).ok()?;
    file.check_kind(PartFileKind::Checkpoint).ok()?;
    let state: NonFilmRenderState = serde_json::from_value(file.state).ok()?;
    state.is_plausible().then_some((file.head, state))
}
/// Describes why a file does not count as a checkpoint: its content, or an error when opening it.
fn not_a_checkpoint_message(path: &Path) -> String {
    // Opening a pipe would block.
    open_regular_file(path).map_or_else(
        |error| format!("cannot be read: {}", describe_io_error(&error)),
        |_| messages::NOT_A_CHECKPOINT.to_owned(),
    )
}
