//! What the front ends and the worker say to each other.
//!
//! A front end sends [`Command`]s and receives [`Event`]s, each with the generation of the request that it is
//! about; events of older generations are dropped by the receiver. The queue of requests holds one: a newer one
//! replaces it and cancels the render under way. Preview pictures do not travel in events but in a slot that
//! holds the latest only ([`Event::Preview`] says that it changed).

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub use super::answers::{Kept, Picked, Section, Spot, Thing};
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

/// The stages, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Reading and validating the scene file.
    Parse,
    /// Reading mesh files.
    Meshes,
    /// Reading textures.
    Textures,
    /// Building trees.
    Accel,
    /// Gathering the lights.
    Lights,
    /// Shooting photons.
    Photons,
    /// Tracing.
    Render,
    /// Encoding and writing pictures.
    Write,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Self; 8] = [
        Self::Parse,
        Self::Meshes,
        Self::Textures,
        Self::Accel,
        Self::Lights,
        Self::Photons,
        Self::Render,
        Self::Write,
    ];

    /// Its name in reports and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Parse => "parse",
            Self::Meshes => "meshes",
            Self::Textures => "textures",
            Self::Accel => "accel",
            Self::Lights => "lights",
            Self::Photons => "photons",
            Self::Render => "render",
            Self::Write => "write",
        }
    }
}

/// How a stage stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// At work. Never in a finished report.
    Running,
    /// Done in this request.
    Done,
    /// Its inputs did not change.
    Reused,
    /// This scene does not need it.
    Skipped,
}

/// One line of the table of stages.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StageReport {
    /// Which.
    pub name: Stage,
    /// How it stands.
    pub status: Status,
    /// What it took.
    pub seconds: f64,
    /// Why it was skipped or reused, or what it made, in a few words; may be empty.
    pub why: String,
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

/// The report of one finished request: the JSON of `--report`.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Version.
    pub glimt: &'static str,
    /// The scene file as named by the caller.
    pub scene: String,
    /// The picture.
    pub image: ImageReport,
    /// The settings it was made with.
    pub settings: Effective,
    /// The lights, and how vertices sample them.
    pub lights: LightsReport,
    /// The photons that were sent for it; none where nothing gathers them.
    pub photons: Option<PhotonsReport>,
    /// All eight stages, in order.
    pub stages: Vec<StageReport>,
    /// What was done.
    pub counters: Counters,
    /// Wall-clock time of the request.
    pub seconds: f64,
    /// Highest resident memory of the process so far.
    pub peak_memory_bytes: u64,
}

/// The picture in a report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ImageReport {
    /// The first output, or none where nothing was written.
    pub path: Option<String>,
    /// Every output.
    pub paths: Vec<String>,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel.
    pub samples: SampleCounts,
    /// The error to expect, relative to the picture's mean luminance; see
    /// [`Film::relative_error`](crate::film::Film::relative_error). None below two samples a pixel.
    pub error: Option<f64>,
    /// Seconds that it was rendered for: by this request, and by those before that it goes on from.
    pub render_seconds: f64,
    /// Whether every pixel got the samples that were asked for.
    pub complete: bool,
    /// Of a view that is stretched to what is seen: the numbers at both ends. In `depth` the least, which is white, and the greatest
    /// distance; in others 0 and the greatest number, which is white.
    pub range: Option<[f32; 2]>,
}

/// Samples per pixel over a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct SampleCounts {
    /// Fewest.
    pub min: u32,
    /// On average.
    pub mean: f64,
    /// Most.
    pub max: u32,
}

/// The lights of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct LightsReport {
    /// How many; a mesh counts for each of its emitting materials.
    pub count: u64,
    /// How many of them a surface samples where light falls on it.
    pub sampled: LightsSampled,
    /// Lights that a vertex picks: 32 × `shadow_samples` in whitted, 4 × in path; 0 without a tree.
    pub picks: u64,
    /// Nodes of the tree that it picks from.
    pub tree_nodes: u64,
    /// Bytes held by trees over lights, and over the triangles of lights.
    pub memory_bytes: u64,
}

/// The photons of a picture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PhotonsReport {
    /// Passes that were sent; others were kept from before.
    pub passes: u64,
    /// Photons that were sent.
    pub emitted: u64,
    /// Photons of them that were stored.
    pub stored: u64,
    /// Texture look-ups on their ways.
    #[serde(skip)]
    pub lookups: u64,
    /// Seconds that it took to send and store them.
    pub seconds: f64,
    /// Photons sent in each of these seconds.
    pub per_second: f64,
    /// Radius of the first pass's kernel for caustics.
    pub caustic_radius: f32,
    /// Radius of the first pass's kernel for what is thrown back from caustics.
    pub bounced_radius: f32,
    /// Bytes held by maps that are kept.
    pub kept_memory_bytes: u64,
    /// Most bytes of maps that were in use at once.
    pub used_memory_bytes: u64,
}

/// How many lights a surface samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightsSampled {
    /// All of them.
    All,
    /// Some that it picks, by what they are expected to bring.
    Picked,
}

/// What a request did, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Triangles over all mesh instances and single triangles.
    pub triangles: u64,
    /// Shapes of any kind; a mesh instance counts as one.
    pub objects: u64,
    /// Rays from the camera.
    pub camera_rays: u64,
    /// Rays towards lights.
    pub shadow_rays: u64,
    /// Mirrored rays.
    pub reflected_rays: u64,
    /// Refracted rays.
    pub refracted_rays: u64,
    /// Rays that go on from diffuse and glossy surfaces.
    pub scattered_rays: u64,
    /// Photons sent out.
    pub photons_emitted: u64,
    /// Photons stored.
    pub photons_stored: u64,
    /// Texels read from files.
    pub texels_loaded: u64,
    /// Bytes held by images, with the levels of those that have them.
    pub texture_memory_bytes: u64,
    /// Texture look-ups.
    pub texture_lookups: u64,
    /// Samples that were not finite and count as 0.
    pub non_finite_samples: u64,
    /// Bytes held by trees.
    pub accel_memory_bytes: u64,
    /// Films kept: that of the picture, and those that a toggle that is switched back finds again.
    pub films: u64,
    /// Bytes held by them.
    pub film_memory_bytes: u64,
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
}
