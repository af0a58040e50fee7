//! Messages between the front ends and the worker.
//!
//! A front end sends [`Command`]s and receives [`Event`]s. Each event contains the generation of its request,
//! and the receiver drops events of older generations. Only one request can be pending. A newer request
//! replaces it and cancels the current render. Events do not contain preview images. Instead,
//! [`Event::Preview`] announces a new image in a slot that stores only the latest preview.

pub mod reasons;
mod stage;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub use self::stage::{Stage, StageReport, StageStatus};
pub use super::answers::{
    CameraSaveResult, NormalizedPosition, NormalizedRect, PickedInstance, PickedObject, PickedPixel,
    SavedCameraEdit, UserMovedCamera,
};
pub use super::report::{
    ImageReport, LightSamplingReport, PhotonsReport, Report, SampleCounts, SampledLightSet, WorkCounters,
};
use super::settings::{AdjustableSceneSettings, EffectiveSettingsSummary, Overrides};
use super::watch::content::FilePathAndContentId;
use crate::film::Srgb8Image;
pub use crate::output::WriteWarning;
pub use crate::scene::description::ResolvedCamera;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Fingerprint;

/// A command from a front end to the worker.
#[derive(Clone, Debug)]
pub enum Command {
    /// Cancel the current request and start this one.
    Render(Box<Request>),
    /// Write the current image to its files as soon as every pixel has a sample.
    Write,
    /// Change the preview size and show the current image again. Rendering continues.
    Preview(Option<PreviewBounds>),
    /// Write this camera to the scene file. [`Event::CameraKept`] reports the result. Rendering continues.
    KeepCamera(Box<UserMovedCamera>),
    /// Undo this edit of the scene file unless the file has changed since then. [`Event::CameraUndone`]
    /// reports the result. Rendering continues.
    UndoCamera(SavedCameraEdit),
    /// Identify the object at an image position. [`Event::Picked`] reports the result. Rendering continues.
    Pick(NormalizedPosition),
    /// Stop the current render.
    Cancel,
    /// Stop the current render and save a checkpoint. If an image is being written, finish writing it
    /// instead, unless [`Command::Cancel`] follows.
    Suspend,
    /// Pause or resume the newest request, even if it has not started. Later requests are not paused.
    Pause(bool),
    /// Stop the worker.
    Quit,
}

/// A request to render an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Number of the request. Must be greater than the number of every earlier request.
    pub generation: u64,
    /// The scene file.
    pub scene: PathBuf,
    /// Overrides from the command line and the keyboard.
    pub overrides: Overrides,
    /// Maximum size of previews, which keep the image's aspect ratio. `None` disables previews.
    pub preview: Option<PreviewBounds>,
    /// Whether to write the finished image.
    pub write: WriteRequirement,
    /// If this request shows another image than the scene's own, the overrides for the scene's own image,
    /// whose film and checkpoint are kept. `None` if this request is for the scene's own image.
    pub own: Option<Box<Overrides>>,
    /// Number of times the scene's files have been saved. An image with keyboard changes that was written by
    /// [`Command::Write`] is kept until a request with a different number reads a valid scene.
    pub saves: u64,
    /// Whether to render again even if nothing has changed.
    pub force: bool,
    /// Region to render first. Does not affect the finished image.
    pub first: Option<NormalizedRect>,
}

impl Request {
    /// Creates a request without previews that writes no files.
    pub fn new(generation: u64, scene: PathBuf, overrides: Overrides) -> Self {
        let (preview, write, own, first) = (None, WriteRequirement::No, None, None);
        Self { generation, scene, overrides, preview, write, own, saves: 0, force: false, first }
    }

    /// Returns the overrides for the scene's own image.
    pub(super) fn scene_image_overrides(&self) -> &Overrides {
        self.own.as_deref().unwrap_or(&self.overrides)
    }

    /// Whether the scene's own image should be written.
    pub(super) fn should_write_scene_image(&self) -> bool {
        self.own.is_some() || self.write != WriteRequirement::No
    }
}

/// Whether to write the finished image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteRequirement {
    /// Do not write the image.
    No,
    /// Try to write the image. It is rendered and shown even if writing fails. [`Event::WriteFailed`] and
    /// [`Event::Refused`] report failures at the start and end of the request.
    Try,
    /// Write the image. If a file cannot be written, the request fails, before rendering if possible.
    Must,
}

/// Maximum preview size on a display with square pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewBounds {
    /// Maximum width in pixels.
    pub width: u32,
    /// Maximum height in pixels.
    pub height: u32,
    /// Center of the section to show at 1:1. The section is as large as the maximum size allows. `None` shows
    /// the whole image.
    pub around: Option<NormalizedPosition>,
}

/// An event from the worker to a front end.
#[derive(Clone, Debug)]
pub enum Event {
    /// The worker started a request.
    Started {
        /// Request number.
        generation: u64,
    },
    /// A stage started or ended.
    Stage {
        /// Request number.
        generation: u64,
        /// The stage and its status.
        stage: StageReport,
    },
    /// Files that the request depends on, including files it failed to read. Each event lists all files found
    /// so far, and the front end watches the files in the latest event.
    Files {
        /// Request number.
        generation: u64,
        /// The scene and all files it references.
        files: Vec<FilePathAndContentId>,
        /// Number of files at the start of the list that this request read. The others were read by earlier
        /// requests.
        read: usize,
        /// A point in time before the first read.
        since: Instant,
    },
    /// All warnings. Sent before the image is rendered.
    Warnings {
        /// Request number.
        generation: u64,
        /// The same warnings as in [`Event::Done`].
        warnings: Vec<Diagnostic>,
    },
    /// An asset is loading.
    Asset {
        /// Request number.
        generation: u64,
        /// Loading progress.
        progress: AssetProgress,
    },
    /// The scene is valid and has these effective settings.
    Settings {
        /// Request number.
        generation: u64,
        /// Effective settings of the request.
        settings: Box<EffectiveSettingsSummary>,
        /// The scene's values for the settings that keys can change.
        own: AdjustableSceneSettings,
    },
    /// The scene file was read.
    Text {
        /// Request number.
        generation: u64,
        /// Text of the scene file, or the scene text generated for a model.
        text: Arc<str>,
    },
    /// The render made progress.
    Progress {
        /// Request number.
        generation: u64,
        /// Progress of the render.
        progress: RenderProgress,
    },
    /// A newer preview is in the slot.
    Preview {
        /// Request number.
        generation: u64,
    },
    /// An image was written.
    Written {
        /// Request number.
        generation: u64,
        /// The image file.
        path: PathBuf,
        /// Size of the file in bytes.
        bytes: u64,
        /// Whether the image is the scene's own image, without keyboard changes.
        is_own: bool,
        /// Sample counts of an image that was written before its render finished, or `None` for a finished
        /// image.
        unfinished: Option<SampleCounts>,
    },
    /// State of the scene's own image, sent when a request shows a different image.
    OwnImage {
        /// Request number.
        generation: u64,
        /// State of the scene's own image.
        state: SavedSceneRenderStatus,
    },
    /// An image or a report could not be written. Rendering continues.
    WriteFailed {
        /// Request number.
        generation: u64,
        /// The file, if only one failed. Its contents are unknown.
        path: Option<PathBuf>,
        /// The file and the reason.
        message: String,
    },
    /// A file was written, but with a problem.
    WriteWarning {
        /// Request number.
        generation: u64,
        /// The file and the problem.
        warning: WriteWarning,
    },
    /// No files are written because at least one of them must not be overwritten: it is an input, is listed
    /// twice, or was not written by glimt. Rendering continues.
    Refused {
        /// Request number.
        generation: u64,
        /// One diagnostic per conflicting file, with a suggested fix.
        conflicts: Vec<Diagnostic>,
    },
    /// An update about the render's checkpoint.
    Checkpoint {
        /// Request number.
        generation: u64,
        /// The update.
        news: CheckpointUpdate,
    },
    /// [`Command::Write`] is postponed until every pixel has a sample.
    WritePostponed {
        /// Request number.
        generation: u64,
    },
    /// [`Command::Write`] has written all files.
    WriteDone {
        /// Request number.
        generation: u64,
        /// The written files.
        paths: Vec<PathBuf>,
    },
    /// Answer to [`Command::KeepCamera`].
    CameraKept {
        /// Request number.
        generation: u64,
        /// The file to which the camera was saved, or why it was not written.
        outcome: Result<CameraSaveResult, String>,
    },
    /// Answer to [`Command::UndoCamera`].
    CameraUndone {
        /// Request number.
        generation: u64,
        /// The restored file, or why it was not restored.
        outcome: Result<PathBuf, String>,
    },
    /// Answer to [`Command::Pick`].
    Picked {
        /// Request number.
        generation: u64,
        /// The object and the color.
        picked: Box<PickedPixel>,
    },
    /// The request is finished.
    Done {
        /// Request number.
        generation: u64,
        /// Report of the request.
        report: Box<Report>,
        /// Warnings, and any remaining conflicts from [`Event::Refused`].
        warnings: Vec<Diagnostic>,
        /// Whether the displayed image is unchanged and nothing was rendered or written.
        unchanged: bool,
    },
    /// The request failed. The previous image remains.
    Failed {
        /// Request number.
        generation: u64,
        /// Why the request failed.
        failure: Failure,
    },
    /// The render of the last valid scene ended. That scene was rendered because the request's own scene
    /// could not be read, which [`Event::Failed`] has already reported.
    LastGoodEnded {
        /// Request number.
        generation: u64,
        /// How the render ended.
        end: LastValidSceneRenderOutcome,
    },
    /// The request was canceled by a newer request or by [`Command::Cancel`].
    Canceled {
        /// Request number.
        generation: u64,
    },
}

impl Event {
    /// Whether this is the result of an attempt to write an image.
    pub fn is_write_result(&self) -> bool {
        matches!(self, Self::Written { .. } | Self::WriteFailed { .. } | Self::Refused { .. })
    }
}

/// State of the scene's own image, which is rendered from the saved scene with the command-line overrides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SavedSceneRenderStatus {
    /// The image has been written to all of its output files.
    Written,
    /// Some of the image's samples have been rendered.
    Begun {
        /// Whether the current request adds samples to this image because its own image shares the film.
        is_rendering: bool,
    },
    /// None of the image's samples have been rendered.
    NotBegun,
}

/// An update about a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CheckpointUpdate {
    /// The checkpoint was written.
    Written {
        /// Path of the checkpoint.
        path: PathBuf,
    },
    /// The checkpoint could not be written. The render continues.
    Failed {
        /// The file and the reason.
        message: String,
    },
    /// The render resumes from the checkpoint.
    Resumed {
        /// Path of the checkpoint.
        path: PathBuf,
        /// Lowest sample count among the pixels that need more samples.
        samples: u32,
    },
    /// The checkpoint to resume from does not exist, so the render starts from scratch.
    Absent {
        /// Path of the checkpoint.
        path: PathBuf,
    },
    /// A checkpoint of this image exists, but resuming was not requested.
    Ignored {
        /// Path of the checkpoint.
        path: PathBuf,
    },
    /// The render ignores a checkpoint or an incomplete part and starts from scratch.
    Unused {
        /// Path of the checkpoint.
        path: PathBuf,
        /// The reason: it belongs to another image, has more samples than requested, or is damaged.
        why: String,
    },
    /// The output file already contains this part.
    Finished {
        /// The output file.
        path: PathBuf,
    },
    /// The checkpoint of another render was renamed.
    SetAside {
        /// New path of the checkpoint.
        path: PathBuf,
    },
}

/// Reasons why a request failed.
#[derive(Clone, Debug)]
pub enum Failure {
    /// Errors and warnings for an invalid scene or referenced file (exit code 2).
    Scene(Vec<Diagnostic>),
    /// Another failure (exit code 1), for example because a file could not be written or the worker crashed.
    Work(String),
}

/// How the render of the last valid scene ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastValidSceneRenderOutcome {
    /// The image is finished.
    Finished {
        /// Whether the image was already finished, so that nothing had to be rendered or written.
        unchanged: bool,
    },
    /// The image is unfinished because the render was stopped or no valid scene has been read yet.
    Stopped,
}

/// Loading progress of an asset.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetProgress {
    /// Texture name from the scene, or the file name of a mesh.
    pub name: String,
    /// Work units done.
    pub done: u64,
    /// Total number of work units. Loading is finished when `done == total`.
    pub total: u64,
}

/// Progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderProgress {
    /// Fraction done, from 0 to 1. Never decreases within a generation and is 1 once rendering ends.
    pub fraction: f64,
    /// Seconds since the render stage started.
    pub elapsed_seconds: f64,
    /// Seconds that earlier requests spent on samples reused by this render.
    pub earlier_seconds: f64,
    /// Estimated remaining seconds, or `None` until the rate is known.
    pub eta_seconds: Option<f64>,
    /// Average samples per pixel so far, rounded down.
    pub samples: u32,
    /// Exact average samples per pixel so far.
    pub mean_samples: f64,
    /// Expected average samples per pixel at the end.
    pub total_samples: u32,
    /// Whether every pixel will have `total_samples` samples, because there is no noise target or time limit.
    pub is_total_fixed: bool,
    /// Current noise, or `None` during the first half second and the first 16 samples.
    pub noise: Option<NoiseAndTimeToNextLevel>,
}

/// The current noise, and when the next lower level will be reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseAndTimeToNextLevel {
    /// Most recently measured [`Film::relative_error`](crate::film::Film::relative_error).
    pub now: f64,
    /// Seconds from the start of the render stage to the measurement.
    pub seconds: f64,
    /// The next lower round noise level, and the number of seconds until it is reached, or `None` if the
    /// render ends before that, or if photons or a noise target (`error`) make the noise unpredictable.
    pub next: Option<(f64, f64)>,
}

/// Slot for the latest preview.
pub type PreviewSlot = Arc<std::sync::Mutex<Option<PreviewUpdate>>>;

/// A preview and the image it shows.
#[derive(Clone, Debug)]
pub struct PreviewUpdate {
    /// Request number.
    pub generation: u64,
    /// The preview image, no larger than the requested size.
    pub picture: Arc<Srgb8Image>,
    /// Range of values displayed as black to white: from the smallest to the largest distance, or from 0 to
    /// the maximum.
    pub range: Option<[f32; 2]>,
    /// Section of the image shown at 1:1, or `None` for the whole image.
    pub section: Option<NormalizedRect>,
    /// Whether the preview lacks light from photons because they are still being traced.
    pub lacks_photons: bool,
    /// The image that the preview shows, or `None` if the preview lacks light from photons.
    pub source: Option<PreviewedImageState>,
}

impl PreviewUpdate {
    /// Whether two previews show the same image, regardless of size and sample count.
    pub fn shows_same_image(&self, other: &Self) -> bool {
        let images = self.source.zip(other.source);
        images.is_some_and(|(own, other)| own.image == other.image)
    }

    /// Whether all samples are known to be included in the image.
    pub fn shows_finished_image(&self) -> bool {
        self.source.is_some_and(|source| source.is_finished)
    }
}

/// The image that a preview shows, and whether it is finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviewedImageState {
    /// Previews with the same key show the same image, although their sizes and sample counts may differ.
    pub image: Fingerprint,
    /// Whether the image has all of its samples.
    pub is_finished: bool,
}
