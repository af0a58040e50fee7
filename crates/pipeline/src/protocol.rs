//! Messages between the front ends and the worker.
//!
//! A front end sends [`Command`]s and receives [`Event`]s. Each event carries the generation of its request, and the
//! receiver drops events of older generations. The queue holds one request: a newer one replaces it and cancels the
//! current render. Preview images are not sent as events but stored in a slot that holds only the latest one, which
//! [`Event::Preview`] announces.

pub mod reasons;
mod stage;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub use self::stage::{Stage, StageReport, Status};
pub use super::answers::{CameraEdit, ImagePosition, KeptCamera, MovedCamera, Picked, PickedObject, Section};
pub use super::report::{
    Counters, ImageReport, LightsReport, LightsSampled, PhotonsReport, Report, SampleCounts,
};
use super::settings::{Effective, Overrides, OwnSettings};
use super::watch::content::FileRead;
use crate::film::Picture;
pub use crate::scene::description::Viewpoint;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Key;

/// A command from a front end to the worker.
#[derive(Clone, Debug)]
pub enum Command {
    /// Cancel the current request and start this one.
    Render(Box<Request>),
    /// Write the current image to its files, as soon as every pixel has a sample.
    Write,
    /// Change the size of previews and show the current image again. Rendering continues.
    Preview(Option<PreviewSize>),
    /// Write this camera into the scene file. [`Event::CameraKept`] reports the result. Rendering continues.
    KeepCamera(MovedCamera),
    /// Undo this edit of the scene file unless the file has changed since. [`Event::CameraUndone`] reports the result.
    /// Rendering continues.
    UndoCamera(CameraEdit),
    /// Identify the object at a position of the image. [`Event::Picked`] reports it. Rendering continues.
    Pick(ImagePosition),
    /// Stop the current render.
    Cancel,
    /// Stop the current render and save a checkpoint. An image that is being written is completed, unless
    /// [`Command::Cancel`] follows: then a checkpoint is saved instead.
    Suspend,
    /// Pause or resume the newest request, whether or not it has begun. Later requests are not paused.
    Pause(bool),
    /// Stop the worker.
    Quit,
}

/// A request to render an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Larger than in all earlier requests.
    pub generation: u64,
    /// The scene file.
    pub scene: PathBuf,
    /// Overrides from the command line and from keys.
    pub overrides: Overrides,
    /// Maximum size of previews, which keep the image's aspect ratio. `None` disables previews.
    pub preview: Option<PreviewSize>,
    /// Whether to write the finished image.
    pub write: Writing,
    /// Overrides of the scene's own image if this request shows another one; its film and checkpoint are then kept.
    /// `None` if this request is for the scene's own image.
    pub own: Option<Box<Overrides>>,
    /// Render again even if nothing has changed.
    pub force: bool,
    /// Region whose samples are rendered first. The final image does not depend on it.
    pub first: Option<Section>,
}

/// Whether a finished image is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writing {
    /// Do not write the image.
    No,
    /// Write the image. Failures are reported by [`Event::WriteFailed`] or [`Event::Refused`] at the beginning and at
    /// the end, and the image is rendered and shown anyway.
    Try,
    /// Write the image. A file that cannot be written fails the request, before the render if possible.
    Must,
}

/// Maximum size of a preview in square pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Center of a 1:1 section that shows as many image pixels as fit. `None` to fit the whole image.
    pub around: Option<ImagePosition>,
}

/// An event from the worker to a front end.
#[derive(Clone, Debug)]
pub enum Event {
    /// The worker started a request.
    Started {
        /// Request number.
        generation: u64,
    },
    /// A stage began or ended.
    Stage {
        /// Request number.
        generation: u64,
        /// The stage and its status.
        stage: StageReport,
    },
    /// Files that were read or tried, which the request depends on. Each such event contains all files known so far,
    /// and the front end watches the files of the latest event.
    Files {
        /// Request number.
        generation: u64,
        /// The scene and all files it references.
        files: Vec<FileRead>,
        /// Number of files at the head of the list that this request read. Earlier requests read the others.
        read: usize,
        /// Time before the first read.
        since: Instant,
    },
    /// All warnings are known, before the image is rendered.
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
        /// Progress of the asset.
        progress: AssetProgress,
    },
    /// The scene is valid and has these effective settings.
    Settings {
        /// Request number.
        generation: u64,
        /// The settings.
        settings: Box<Effective>,
        /// Camera of the scene.
        camera: Viewpoint,
        /// Exposure of the scene, in stops.
        exposure: f32,
        /// The scene's values of other settings that keys change.
        own: OwnSettings,
    },
    /// The scene file was read.
    Text {
        /// Request number.
        generation: u64,
        /// Text of the scene file, or of the scene generated for a model.
        text: Arc<str>,
    },
    /// The render made progress.
    Progress {
        /// Request number.
        generation: u64,
        /// Progress of the render.
        progress: RenderProgress,
    },
    /// The slot contains a newer preview.
    Preview {
        /// Request number.
        generation: u64,
    },
    /// An image was written.
    Written {
        /// Request number.
        generation: u64,
        /// The file.
        path: PathBuf,
        /// Size of the file.
        bytes: u64,
        /// Whether it is the scene's own image, without changes made by keys.
        is_own: bool,
    },
    /// State of the scene's own image, for a request that shows another one.
    OwnImage {
        /// Request number.
        generation: u64,
        /// The state.
        state: OwnState,
    },
    /// An image or a report could not be written. Rendering continues.
    WriteFailed {
        /// Request number.
        generation: u64,
        /// The file, if only one failed. Its content is unknown.
        path: Option<PathBuf>,
        /// The file and the reason.
        message: String,
    },
    /// A file was replaced, and some metadata of the old file could not be preserved.
    NotKept {
        /// Request number.
        generation: u64,
        /// The file and the lost metadata.
        message: String,
    },
    /// No file is written, because at least one must not be: it is an input, is named twice, or contains something that
    /// glimt did not write. Rendering continues.
    Refused {
        /// Request number.
        generation: u64,
        /// One diagnostic per such file, with a solution.
        conflicts: Vec<Diagnostic>,
    },
    /// News about the checkpoint of the render.
    Checkpoint {
        /// Request number.
        generation: u64,
        /// The news.
        news: CheckpointNews,
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
        /// The files.
        paths: Vec<PathBuf>,
    },
    /// Answer to [`Command::KeepCamera`].
    CameraKept {
        /// Request number.
        generation: u64,
        /// The file with the camera, or why glimt did not write it.
        outcome: Result<KeptCamera, String>,
    },
    /// Answer to [`Command::UndoCamera`].
    CameraUndone {
        /// Request number.
        generation: u64,
        /// The restored file, or why glimt did not write it.
        outcome: Result<PathBuf, String>,
    },
    /// Answer to [`Command::Pick`].
    Picked {
        /// Request number.
        generation: u64,
        /// The object and the color.
        picked: Box<Picked>,
    },
    /// The request is finished.
    Done {
        /// Request number.
        generation: u64,
        /// Report of the request.
        report: Box<Report>,
        /// Warnings, and the conflicts of [`Event::Refused`] that remain.
        warnings: Vec<Diagnostic>,
        /// Whether nothing had changed, so that the request rendered nothing and shows the same image.
        unchanged: bool,
    },
    /// The request failed. The previous image remains.
    Failed {
        /// Request number.
        generation: u64,
        /// Why.
        failure: Failure,
    },
    /// The render of the last good scene ended. It replaced the request's own scene, which could not be read, as
    /// [`Event::Failed`] reported.
    LastGoodEnded {
        /// Request number.
        generation: u64,
        /// How the render ended.
        end: LastGoodEnd,
    },
    /// The request was cancelled by a newer one or by [`Command::Cancel`].
    Cancelled {
        /// Request number.
        generation: u64,
    },
}

/// State of the scene's own image: the saved scene with the overrides of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnState {
    /// All its files contain it.
    Written,
    /// Some of its samples are rendered.
    Begun {
        /// Whether the request adds samples to it, because it shows the same film in another way.
        is_rendering: bool,
    },
    /// None of its samples are rendered.
    NotBegun,
}

/// News about a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CheckpointNews {
    /// The checkpoint was written.
    Written {
        /// The file.
        path: PathBuf,
    },
    /// The checkpoint could not be written. The render continues.
    Failed {
        /// The file and the reason.
        message: String,
    },
    /// The render resumes from the checkpoint.
    Resumed {
        /// The file.
        path: PathBuf,
        /// Samples of every pixel that needs more.
        samples: u32,
    },
    /// The checkpoint to resume from does not exist, so the render starts from zero.
    Absent {
        /// The file.
        path: PathBuf,
    },
    /// A checkpoint of this image exists, but the command line does not ask to resume.
    Ignored {
        /// The file.
        path: PathBuf,
    },
    /// The render ignores a checkpoint or an incomplete part and starts from zero.
    Unused {
        /// The file.
        path: PathBuf,
        /// The reason: another image, more samples than requested, or damage.
        why: String,
    },
    /// The output file already contains this part.
    Finished {
        /// The file.
        path: PathBuf,
    },
    /// The checkpoint of another render was renamed.
    SetAside {
        /// Its new name.
        path: PathBuf,
    },
}

/// Why a request failed.
#[derive(Clone, Debug)]
pub enum Failure {
    /// The scene or a file it references is invalid (exit code 2): errors and warnings.
    Scene(Vec<Diagnostic>),
    /// The work failed (exit code 1), for example because a file could not be written or the worker died.
    Work(String),
}

/// How the render of the last good scene ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastGoodEnd {
    /// The image is finished.
    Finished {
        /// Whether it was finished before, so that nothing was rendered or written.
        unchanged: bool,
    },
    /// The image is not finished: the render was stopped, or no scene has been read yet.
    Stopped,
}

/// Loading progress of an asset.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetProgress {
    /// Name of a texture in the scene, or a mesh's file name.
    pub name: String,
    /// Work units done.
    pub done: u64,
    /// Total work units. Loading has ended when `done == total`.
    pub total: u64,
}

/// Progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderProgress {
    /// From 0 to 1. Never decreases within a generation, and is 1 when the render is over.
    pub fraction: f64,
    /// Seconds since the render stage began.
    pub elapsed_seconds: f64,
    /// Seconds that earlier requests spent on the samples this one continues from.
    pub earlier_seconds: f64,
    /// Expected remaining seconds. `None` until the rate is known.
    pub eta_seconds: Option<f64>,
    /// Average samples per pixel so far, rounded down.
    pub samples: u32,
    /// Exact average of the samples per pixel.
    pub mean_samples: f64,
    /// Expected final average of the samples per pixel.
    pub total_samples: u32,
    /// Whether every pixel gets `total_samples`, because neither noise nor time ends the render.
    pub is_total_fixed: bool,
    /// Noise so far. `None` during the first half second and the first 16 samples.
    pub noise: Option<NoiseProgress>,
}

/// Current and predicted noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseProgress {
    /// Last measured [`Film::relative_error`](crate::film::Film::relative_error).
    pub now: f64,
    /// Seconds from the start of the render stage to the measurement.
    pub seconds: f64,
    /// The next lower round level, and the seconds until then. `None` if the render ends earlier or the noise cannot be
    /// predicted: with photons and with `error`.
    pub next: Option<(f64, f64)>,
}

/// Slot that holds the latest preview.
pub type PreviewSlot = Arc<std::sync::Mutex<Option<LatestPreview>>>;

/// A preview and the image it shows.
#[derive(Clone, Debug)]
pub struct LatestPreview {
    /// Request number.
    pub generation: u64,
    /// The preview, within the requested size.
    pub picture: Arc<Picture>,
    /// Range of values mapped to black and white: the nearest and farthest distance, or 0 and the maximum.
    pub range: Option<[f32; 2]>,
    /// Section of the image that is shown at 1:1. `None` for the whole image.
    pub section: Option<Section>,
    /// Whether the preview lacks the photons' light, because they are still being traced.
    pub lacks_photons: bool,
    /// The image that the preview shows. `None` if it lacks the photons' light.
    pub source: Option<PreviewSource>,
}

/// The image that a preview shows, and whether it is finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviewSource {
    /// Previews with the same key show the same image, at any size and number of samples.
    pub image: Key,
    /// Whether the image has all its samples.
    pub is_finished: bool,
}
