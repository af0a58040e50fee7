//! The report of a finished request, and its file.

mod marks;

use std::path::{Path, PathBuf};

use super::inputs::Inputs;
use super::plan::Plan;
use super::protocol::StageReport;
use super::settings::Effective;
use super::sink::Sink;
use super::stages::canvas::Canvas;
use super::stages::films::Films;
use super::targets::guarded;
use crate::control::CancelToken;
use crate::film::stretch::Stretch;
use crate::integrators::{RayCounters, receivers};

use crate::output::{OutputError, json, write::atomic_until};
use crate::world::World;

pub(super) use marks::Marks;

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

/// What a request came to.
pub(super) struct Finished<'a> {
    pub(super) scene: &'a Path,
    pub(super) plan: &'a Plan,
    pub(super) world: &'a World,
    pub(super) canvas: &'a Canvas,
    pub(super) films: &'a Films,
    pub(super) rays: RayCounters,
    pub(super) texels_loaded: u64,
    pub(super) texture_memory_bytes: u64,
    pub(super) photons: Option<PhotonsReport>,
    pub(super) is_written: bool,
}

pub(super) fn report(finished: &Finished<'_>, stages: Vec<StageReport>, seconds: f64) -> Report {
    Report {
        glimt: env!("CARGO_PKG_VERSION"),
        scene: finished.scene.to_string_lossy().into_owned(),
        image: image(finished),
        settings: finished.plan.effective.clone(),
        lights: lights(finished),
        photons: finished.photons,
        stages,
        counters: counters(finished),
        seconds,
        peak_memory_bytes: peak_memory_bytes(),
    }
}

/// Write it where the plan says.
///
/// # Errors
/// Why not, with the file's name.
pub(super) fn write_report(
    plan: &Plan,
    inputs: &Inputs,
    report: &Report,
    sink: &Sink,
    token: &CancelToken,
) -> Result<(), OutputError> {
    let Some(path) = &plan.report else { return Ok(()) };
    let unwritable =
        |error: serde_json::Error| OutputError::File { path: path.clone(), source: error.into() };
    let text = json::file(report).map_err(unwritable)?;
    guarded(plan, inputs, path, sink, |guard| atomic_until(path, text.as_bytes(), guard, token))
}

fn image(finished: &Finished<'_>) -> ImageReport {
    let plan = finished.plan;
    let samples = finished.canvas.film.samples();
    let outputs: &[PathBuf] = if finished.is_written { &plan.outputs } else { &[] };
    let paths: Vec<String> = outputs.iter().map(|path| path.to_string_lossy().into_owned()).collect();
    ImageReport {
        path: paths.first().cloned(),
        paths,
        width: plan.settings.render.width,
        height: plan.settings.render.height,
        samples: SampleCounts { min: samples.min, mean: samples.mean, max: samples.max },
        error: finished.canvas.film.relative_error(),
        render_seconds: finished.canvas.render_seconds,
        complete: finished.canvas.is_complete(plan.settings.render.samples),
        range: range(finished),
    }
}

fn lights(finished: &Finished<'_>) -> LightsReport {
    let lights = &finished.world.lights;
    let settings = &finished.plan.settings;
    let samples = u64::from(settings.render.shadow_samples);
    let are_gathered = settings.gathers() && finished.photons.is_some_and(|photons| photons.emitted > 0);
    let selection = lights.selection(receivers(settings, are_gathered));
    let (sampled, picks) = match selection {
        Some(selection) => (LightsSampled::Picked, samples * u64::from(selection.picks.count)),
        None => (LightsSampled::All, 0),
    };
    LightsReport {
        count: lights.len() as u64,
        sampled,
        picks,
        tree_nodes: selection.map_or(0, |selection| selection.tree.node_count()) as u64,
        memory_bytes: lights.memory_bytes() as u64,
    }
}

fn range(finished: &Finished<'_>) -> Option<[f32; 2]> {
    let Finished { plan, canvas, .. } = finished;
    if plan.tone.stretch == Stretch::None {
        return None;
    }
    let image = canvas.film.image(plan.settings.view.quantity());
    plan.tone.of_picture(&image).stretch.range().map(|range| range.ends())
}

fn counters(finished: &Finished<'_>) -> Counters {
    let (world, rays) = (finished.world, finished.rays);
    Counters {
        triangles: world.triangle_count(),
        objects: world.object_count(),
        camera_rays: rays.camera_rays,
        shadow_rays: rays.shadow_rays,
        reflected_rays: rays.reflected_rays,
        refracted_rays: rays.refracted_rays,
        scattered_rays: rays.scattered_rays,
        photons_emitted: finished.photons.map_or(0, |photons| photons.emitted),
        photons_stored: finished.photons.map_or(0, |photons| photons.stored),
        texels_loaded: finished.texels_loaded,
        texture_memory_bytes: finished.texture_memory_bytes,
        texture_lookups: rays.texture_lookups + finished.photons.map_or(0, |photons| photons.lookups),
        non_finite_samples: finished.canvas.film.non_finite_samples(),
        accel_memory_bytes: world.accel_memory_bytes() as u64,
        films: finished.films.count() as u64,
        film_memory_bytes: finished.films.memory_bytes(),
    }
}

/// Highest resident memory of the process so far; 0 where it cannot be told.
fn peak_memory_bytes() -> u64 {
    peak_of_program().unwrap_or_else(peak_of_process)
}

/// Of this program alone, where the system tells it (proc_pid_status(5)).
fn peak_of_program() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kibibytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?;
    Some(kibibytes.trim().parse::<u64>().ok()? * 1024)
}

/// With what the process took before it became this program: whoever calls glimt may have taken much.
fn peak_of_process() -> u64 {
    use nix::sys::resource::{UsageWho, getrusage};
    // Bytes on macOS, kibibytes elsewhere (getrusage(2)).
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    let highest = getrusage(UsageWho::RUSAGE_SELF).map_or(0, |usage| usage.max_rss());
    u64::try_from(highest).unwrap_or(0) * unit
}
