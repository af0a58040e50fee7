//! Messages between the front ends and the worker.
//!
//! A front end sends [`Command`]s and receives [`Event`]s, each with the generation of the request that it is
//! about; events of older generations are dropped by the receiver. The queue of requests holds one: a newer one
//! replaces it and cancels the render under way. Preview pictures do not travel in events but in a slot that
//! holds the latest only ([`Event::Preview`] says that it changed).

mod stage;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub use self::stage::{Stage, StageReport, Status};
pub use super::answers::{CameraEdit, Kept, MovedCamera, Picked, Section, Spot, Thing};
pub use super::report::{
    Counters, ImageReport, LightsReport, LightsSampled, PhotonsReport, Report, SampleCounts,
};
use super::settings::{Effective, Overrides, OwnSettings};
use super::watch::content::FileRead;
use crate::film::Picture;
pub use crate::scene::description::Viewpoint;
use crate::scene::diagnostic::Diagnostic;
use crate::scene::fingerprint::Key;

/// From a front end to the worker.
#[derive(Clone, Debug)]
pub enum Command {
    /// Render this; whatever is under way is cancelled.
    Render(Box<Request>),
    /// Write the picture as it is now to its files; if some of its pixels have no sample yet, as soon as they have.
    Write,
    /// Previews are to have this size from now on; the picture at hand is shown again. What is rendered goes on.
    Preview(Option<PreviewSize>),
    /// Put this camera into the scene file; [`Event::CameraKept`] says what came of it. What is rendered goes on.
    KeepCamera(MovedCamera),
    /// Put the scene file back as it was before this edit, if nobody changed it since; [`Event::CameraUndone`] says what came of
    /// it. What is rendered goes on.
    UndoCamera(CameraEdit),
    /// Say what is at a place of the picture; [`Event::Picked`] does. What is rendered goes on.
    Pick(Spot),
    /// Stop the render under way.
    Cancel,
    /// Stop the render under way, and keep a checkpoint of it. A picture that is being written becomes whole, unless
    /// [`Command::Cancel`] comes too: then a checkpoint takes its place.
    Suspend,
    /// Hold the work, or let it go on: that of the newest request, whether it has begun or not. A request that comes
    /// later is not held.
    Pause(bool),
    /// End the worker.
    Quit,
}

/// One order for a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Larger than that of every request before.
    pub generation: u64,
    /// The scene file.
    pub scene: PathBuf,
    /// Changes by the command line and by keys.
    pub overrides: Overrides,
    /// The preview: a picture of at most this many pixels across and down, with the image's aspect ratio. `None` for no previews.
    pub preview: Option<PreviewSize>,
    /// Whether the finished picture is written to disk.
    pub write: Writing,
    /// Overrides of the scene's own image, where this request shows something else: its film and its checkpoint are kept. `None`
    /// for a request of that image.
    pub own: Option<Box<Overrides>>,
    /// Render again even where nothing changed.
    pub force: bool,
    /// The part of the picture that gets its samples before the rest; the picture is the same in the end.
    pub first: Option<Section>,
}

/// Whether a finished picture is written to disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writing {
    /// It is not.
    No,
    /// Write it. If that is impossible, [`Event::WriteFailed`] or [`Event::Refused`] reports it at the beginning and at the end,
    /// and the picture is rendered and shown all the same.
    Try,
    /// Write it. A file that cannot be written fails the request, if possible before anything is rendered.
    Must,
}

/// Upper bounds of a preview picture, in pixels of square shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Center of the image's own pixels that are shown, as many as fit. `None` for the whole image at this size.
    pub around: Option<Spot>,
}

/// From the worker to a front end.
#[derive(Clone, Debug)]
pub enum Event {
    /// The worker took a request up.
    Started {
        /// Number of the request.
        generation: u64,
    },
    /// A stage began or ended.
    Stage {
        /// Number of the request.
        generation: u64,
        /// The stage and its status.
        stage: StageReport,
    },
    /// These files were read, or tried: what they hold is what the request is made of. Each such event holds all
    /// files known so far; a front end watches those of the latest.
    Files {
        /// Number of the request.
        generation: u64,
        /// The scene and everything that it names.
        files: Vec<FileRead>,
        /// Number of files that this request read, at the head of the list; earlier requests read the others.
        read: usize,
        /// After that.
        since: Instant,
    },
    /// Everything that is there to warn of is known; the picture is yet to be rendered.
    Warnings {
        /// Number of the request.
        generation: u64,
        /// The same as [`Event::Done`] will have.
        warnings: Vec<Diagnostic>,
    },
    /// An asset is loading.
    Asset {
        /// Number of the request.
        generation: u64,
        /// Progress of the asset.
        progress: AssetProgress,
    },
    /// The scene was understood: these settings hold now.
    Settings {
        /// Number of the request.
        generation: u64,
        /// The settings.
        settings: Box<Effective>,
        /// The scene's own camera.
        camera: Viewpoint,
        /// The scene's own exposure, in stops.
        exposure: f32,
        /// The scene's other settings that keys change.
        own: OwnSettings,
    },
    /// The scene file could be read.
    Text {
        /// Number of the request.
        generation: u64,
        /// Text of the scene file; of a model, of the scene that was made for it.
        text: Arc<str>,
    },
    /// The render went on.
    Progress {
        /// Number of the request.
        generation: u64,
        /// Progress of the render.
        progress: RenderProgress,
    },
    /// A newer picture is in the slot.
    Preview {
        /// Number of the request.
        generation: u64,
    },
    /// A picture was written.
    Written {
        /// Number of the request.
        generation: u64,
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// Whether it is the scene's own image, not one that keys changed.
        is_own: bool,
    },
    /// State of the scene's own image, in a request that shows something else.
    OwnImage {
        /// Number of the request.
        generation: u64,
        /// The state.
        state: OwnState,
    },
    /// A picture or a report could not be written; a render under way goes on.
    WriteFailed {
        /// Number of the request.
        generation: u64,
        /// The picture's file, if the failure is of one alone: nobody knows what it holds now.
        path: Option<PathBuf>,
        /// The file and the reason.
        message: String,
    },
    /// A file was written, and what the one that was there had besides its bytes could not be kept.
    NotKept {
        /// Number of the request.
        generation: u64,
        /// The file and the properties that were lost.
        message: String,
    },
    /// No file is written as long as one of them must not be: it is an input, another of them, or something that a person
    /// did not mean to lose. A render under way goes on.
    Refused {
        /// Number of the request.
        generation: u64,
        /// One for each such file, with the way out.
        conflicts: Vec<Diagnostic>,
    },
    /// Something about the checkpoint of the render.
    Checkpoint {
        /// Number of the request.
        generation: u64,
        /// Message about it.
        news: CheckpointNews,
    },
    /// [`Command::Write`] waits until every pixel has a sample.
    WritePostponed {
        /// Number of the request.
        generation: u64,
    },
    /// [`Command::Write`] is done, and every file was written.
    WriteDone {
        /// Number of the request.
        generation: u64,
        /// The files.
        paths: Vec<PathBuf>,
    },
    /// Answer to [`Command::KeepCamera`].
    CameraKept {
        /// Number of the request.
        generation: u64,
        /// The file with the camera, or the reason why glimt wrote nothing.
        outcome: Result<Kept, String>,
    },
    /// Answer to [`Command::UndoCamera`].
    CameraUndone {
        /// Number of the request.
        generation: u64,
        /// The file that is as before, or the reason why glimt wrote nothing.
        outcome: Result<PathBuf, String>,
    },
    /// Answer to [`Command::Pick`].
    Picked {
        /// Number of the request.
        generation: u64,
        /// The object there.
        picked: Box<Picked>,
    },
    /// The request is finished.
    Done {
        /// Number of the request.
        generation: u64,
        /// Report of the request.
        report: Box<Report>,
        /// Warnings, and the conflicts of [`Event::Refused`] that still hold.
        warnings: Vec<Diagnostic>,
        /// Whether the request found everything as it was, so that nothing was rendered and the same picture shown.
        unchanged: bool,
    },
    /// The request could not be done. The last picture stands.
    Failed {
        /// Number of the request.
        generation: u64,
        /// Why.
        failure: Failure,
    },
    /// The scene of the request could not be read, as [`Event::Failed`] has said, and the last good one took its place: its render
    /// ended.
    LastGoodEnded {
        /// Number of the request.
        generation: u64,
        /// End of the render.
        end: LastGoodEnd,
    },
    /// The request was stopped by a newer one or by [`Command::Cancel`].
    Cancelled {
        /// Number of the request.
        generation: u64,
    },
}

/// State of the scene's own image: the image of the scene file as saved, with the overrides of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OwnState {
    /// Its files hold it.
    Written,
    /// Some of its samples are there.
    Begun {
        /// Whether the request adds samples to it: it shows the same film in another way.
        is_rendering: bool,
    },
    /// Nothing of it has been rendered.
    NotBegun,
}

/// News about a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CheckpointNews {
    /// It was written.
    Written {
        /// The file.
        path: PathBuf,
    },
    /// It could not be written; the render goes on.
    Failed {
        /// The file and the reason.
        message: String,
    },
    /// The render goes on from it.
    Resumed {
        /// The file.
        path: PathBuf,
        /// Samples that every pixel has which is to have more.
        samples: u32,
    },
    /// The render was to go on from it, and begins anew: it is not there.
    Absent {
        /// The file.
        path: PathBuf,
    },
    /// It is of this picture, and the call does not ask for it.
    Ignored {
        /// The file.
        path: PathBuf,
    },
    /// It is there, and the render begins anew: why. Also a part that is not whole.
    Unused {
        /// The file.
        path: PathBuf,
        /// The reason: it is of another picture, has more samples than asked for, or is damaged.
        why: String,
    },
    /// The output is this part already.
    Finished {
        /// The file.
        path: PathBuf,
    },
    /// That of another render made way for this one's.
    SetAside {
        /// Its new name.
        path: PathBuf,
    },
}

/// Why a request could not be done.
#[derive(Clone, Debug)]
pub enum Failure {
    /// The scene or something it names is wrong (exit code 2): errors and warnings.
    Scene(Vec<Diagnostic>),
    /// The work failed (exit code 1): a file that could not be written, a worker that died.
    Work(String),
}

/// End of a render of the last good scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LastGoodEnd {
    /// The picture is finished.
    Finished {
        /// Whether it was finished before: nothing was rendered or written, and the same picture shown.
        unchanged: bool,
    },
    /// The picture is not finished: the render was stopped, or no scene could be read so far.
    Stopped,
}

/// An asset that is loading.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetProgress {
    /// Its name: a texture's name in the scene, a mesh's file name.
    pub name: String,
    /// Work units done.
    pub done: u64,
    /// Work units in all; `done == total` ends it.
    pub total: u64,
}

/// Progress of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderProgress {
    /// From 0 to 1, never falling within a generation; 1 when the render is over.
    pub fraction: f64,
    /// Seconds since the render stage began.
    pub elapsed_seconds: f64,
    /// Seconds in which earlier requests rendered the samples that this one goes on from.
    pub earlier_seconds: f64,
    /// Expected seconds until the end. `None` until the rate is known.
    pub eta_seconds: Option<f64>,
    /// Samples per pixel so far, on average, rounded down.
    pub samples: u32,
    /// The exact average.
    pub mean_samples: f64,
    /// Samples per pixel that there will be, on average, as far as that is known.
    pub total_samples: u32,
    /// Whether every pixel gets `total_samples`: neither noise nor time ends the render.
    pub is_total_fixed: bool,
    /// Noise so far. `None` before half a second and 16 samples.
    pub noise: Option<NoiseProgress>,
}

/// Noise now, and noise to come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseProgress {
    /// [`Film::relative_error`](crate::film::Film::relative_error), as it was measured last.
    pub now: f64,
    /// Seconds from the beginning of the render stage to that measurement.
    pub seconds: f64,
    /// A round level below that, and seconds until then. `None` if the render ends first, and if nobody knows how noise falls:
    /// with photons and with `error`.
    pub next: Option<(f64, f64)>,
}

/// The slot that holds the latest preview.
pub type PreviewSlot = Arc<std::sync::Mutex<Option<LatestPreview>>>;

/// A preview picture with what it is of.
#[derive(Clone, Debug)]
pub struct LatestPreview {
    /// Number of the request.
    pub generation: u64,
    /// The picture, at most of the requested size.
    pub picture: Arc<Picture>,
    /// The numbers at both ends of the range that it is stretched to: near and far of distances, else 0 and the greatest.
    pub range: Option<[f32; 2]>,
    /// The part of the image that is shown pixel by pixel. `None` for the whole image.
    pub section: Option<Section>,
    /// Whether it lacks the light that photons bring, since they are still being traced.
    pub lacks_photons: bool,
    /// The image that it shows. `None` if it lacks the light of photons.
    pub source: Option<PreviewSource>,
}

/// The image that a preview shows, and how far its render is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PreviewSource {
    /// Previews with the same key show the same image, at any size and with any number of its samples.
    pub image: Key,
    /// Whether the image has all its samples.
    pub is_finished: bool,
}
