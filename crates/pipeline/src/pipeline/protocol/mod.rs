//! What the front ends and the worker say to each other.
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
pub use super::answers::{Kept, Picked, Section, Spot, Thing};
pub use super::report::{
    Counters, ImageReport, LightsReport, LightsSampled, PhotonsReport, Report, SampleCounts,
};
use super::settings::{Effective, Overrides};
use super::watch::content::FileRead;
use crate::film::Picture;
pub use crate::scene::description::Viewpoint;
use crate::scene::diagnostic::Diagnostic;

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
    KeepCamera(Viewpoint),
    /// Say what is at a place of the picture; [`Event::Picked`] does. What is rendered goes on.
    Pick(Spot),
    /// Stop the render under way.
    Cancel,
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
    /// What the command line and the keys change of it.
    pub overrides: Overrides,
    /// The preview wanted: a picture of at most this many pixels across and down, with the picture's aspect
    /// ratio; none: no previews.
    pub preview: Option<PreviewSize>,
    /// Whether the finished picture is written to disk.
    pub write: Writing,
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
    /// It is; where that is not possible, [`Event::WriteFailed`] or [`Event::Refused`] says so, at the beginning and at
    /// the end, and the picture is rendered and shown all the same.
    Try,
    /// It is; a file that cannot be written fails the request, before anything is rendered if that can be told.
    Must,
}

/// Upper bounds of a preview picture, in pixels of square shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreviewSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// As many of the picture's own pixels around this place; none: the whole picture at this size.
    pub around: Option<Spot>,
}

/// From the worker to a front end.
#[derive(Clone, Debug)]
pub enum Event {
    /// The worker took a request up.
    Started {
        /// Which.
        generation: u64,
    },
    /// A stage began or ended.
    Stage {
        /// Of which request.
        generation: u64,
        /// What happened.
        stage: StageReport,
    },
    /// These files were read, or tried: what they hold is what the request is made of. Each such event holds all
    /// files known so far; a front end watches those of the latest.
    Files {
        /// Of which request.
        generation: u64,
        /// The scene and everything that it names.
        files: Vec<FileRead>,
        /// So many of them, the first ones, were read by this request; the others by some before.
        read: usize,
        /// After that.
        since: Instant,
    },
    /// Everything that is there to warn of is known; the picture is yet to be rendered.
    Warnings {
        /// Of which request.
        generation: u64,
        /// The same as [`Event::Done`] will have.
        warnings: Vec<Diagnostic>,
    },
    /// An asset is loading.
    Asset {
        /// Of which request.
        generation: u64,
        /// How far it is.
        progress: AssetProgress,
    },
    /// The scene was understood: these settings hold now.
    Settings {
        /// Of which request.
        generation: u64,
        /// The settings.
        settings: Box<Effective>,
        /// The scene's own camera.
        camera: Viewpoint,
        /// The scene's own exposure, in stops.
        exposure: f32,
    },
    /// The scene file holds another text than that of the last scene that could be read.
    Edited {
        /// Of which request.
        generation: u64,
        /// What differs, in a few words.
        what: String,
    },
    /// The render went on.
    Progress {
        /// Of which request.
        generation: u64,
        /// How far it is.
        progress: RenderProgress,
    },
    /// A newer picture is in the slot.
    Preview {
        /// Of which request.
        generation: u64,
    },
    /// A picture was written.
    Written {
        /// Of which request.
        generation: u64,
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
    },
    /// A picture or a report could not be written; a render under way goes on.
    WriteFailed {
        /// Of which request.
        generation: u64,
        /// Which file, and why.
        message: String,
    },
    /// A file was written, and what the one that was there had besides its bytes could not be kept.
    NotKept {
        /// Of which request.
        generation: u64,
        /// Which file, and what of it.
        message: String,
    },
    /// No file is written as long as one of them must not be: it is an input, another of them, or something that a person
    /// did not mean to lose. A render under way goes on.
    Refused {
        /// Of which request.
        generation: u64,
        /// One for each such file, with the way out.
        conflicts: Vec<Diagnostic>,
    },
    /// [`Command::Write`] waits until every pixel has a sample.
    WritePostponed {
        /// Of which request.
        generation: u64,
    },
    /// What came of [`Command::KeepCamera`].
    CameraKept {
        /// Of which request.
        generation: u64,
        /// What came of it, or why nothing was written.
        outcome: Result<Kept, String>,
    },
    /// What is at the place of [`Command::Pick`].
    Picked {
        /// Of which request.
        generation: u64,
        /// What is there.
        picked: Box<Picked>,
    },
    /// Everything that was asked for is done.
    Done {
        /// Of which request.
        generation: u64,
        /// What it took.
        report: Box<Report>,
        /// Warnings, and the conflicts of [`Event::Refused`] that still hold.
        warnings: Vec<Diagnostic>,
        /// Whether the request found everything as it was, so that nothing was rendered and the same picture shown.
        unchanged: bool,
    },
    /// The request could not be done. The last picture stands.
    Failed {
        /// Of which request.
        generation: u64,
        /// Why.
        failure: Failure,
    },
    /// The request was stopped by a newer one or by [`Command::Cancel`].
    Cancelled {
        /// Which.
        generation: u64,
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

/// How far a render is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderProgress {
    /// From 0 to 1, never falling within a generation; 1 when the render is over.
    pub fraction: f64,
    /// Seconds since the render stage began.
    pub elapsed_seconds: f64,
    /// Seconds still to go, from the work done; none until it can be told.
    pub eta_seconds: Option<f64>,
    /// Samples per pixel so far, on average.
    pub samples: u32,
    /// Samples per pixel that there will be, on average, as far as that is known.
    pub total_samples: u32,
    /// What is known of the noise; nothing before half a second and 16 samples.
    pub noise: Option<NoiseProgress>,
}

/// How much noise there is, and will be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseProgress {
    /// [`Film::relative_error`](crate::film::Film::relative_error), as it is to be expected by now.
    pub now: f64,
    /// A round level below that, or the noise in the end where that comes first; and seconds until then.
    pub next: Option<(f64, f64)>,
}

/// The slot that holds the latest preview.
pub type PreviewSlot = Arc<std::sync::Mutex<Option<LatestPreview>>>;

/// A preview picture with what it is of.
#[derive(Clone, Debug)]
pub struct LatestPreview {
    /// Of which request.
    pub generation: u64,
    /// The picture, at most as large as was asked for.
    pub picture: Arc<Picture>,
    /// The numbers at both ends of the range that it is stretched to: near and far of distances, else 0 and the greatest.
    pub range: Option<[f32; 2]>,
    /// The part of the picture that it shows, pixel by pixel; none: all of it.
    pub section: Option<Section>,
    /// Whether it lacks the light that photons bring, since they are still being traced.
    pub lacks_photons: bool,
}
