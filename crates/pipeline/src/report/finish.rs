//! Creates and writes reports.

use std::path::PathBuf;

use super::{ImageReport, LightSamplingReport, PhotonsReport, Report, SampledLightSet, WorkCounters};
use crate::control::CancelToken;
use crate::film::range_map::DataBrightnessMap;
use crate::inputs::ProtectedInputs;
use crate::integrators::{RayCounters, light_sampling_purpose};
use crate::output::write::{ExistingFilePolicy, write_atomically_with_policy};
use crate::output::{OutputError, json};
use crate::plan::RenderPlan;
use crate::prepare::ReadyScene;
use crate::protocol::StageReport;
use crate::render::film_cache::FilmCache;
use crate::render::film_state::FilmState;
use crate::sink::EventSink;
use crate::targets::{OutputTarget, write_guarded};

/// Results of a request.
#[derive(Clone, Copy)]
pub(crate) struct RequestResults<'a> {
    pub(crate) scene: &'a ReadyScene,
    pub(crate) plan: &'a RenderPlan,
    pub(crate) state: &'a FilmState,
    pub(crate) films: &'a FilmCache,
    pub(crate) rays: RayCounters,
    pub(crate) photons: Option<PhotonsReport>,
    pub(crate) is_written: bool,
}

pub(crate) fn make_report(finished: &RequestResults<'_>, stages: Vec<StageReport>, seconds: f64) -> Report {
    let mut settings = finished.plan.effective_settings_summary();
    // The plan has the samples of this process's share.
    if let Some(share) = &finished.state.share {
        settings.samples = share.samples;
    }
    Report {
        glimt: env!("CARGO_PKG_VERSION"),
        scene: finished.scene.assets.parsed.loaded.path.to_string_lossy().into_owned(),
        image: image_report(finished),
        settings,
        lights: light_sampling_report(finished),
        photons: finished.photons,
        stages,
        counters: count_work(finished),
        seconds,
        peak_memory_bytes: peak_memory_bytes(),
    }
}

/// Writes a report to the path in the plan.
///
/// # Errors
/// The file cannot be written. The error contains the file name.
pub(crate) fn write_report(
    plan: &RenderPlan,
    inputs: &ProtectedInputs,
    report: &Report,
    sink: &EventSink,
    token: &CancelToken,
) -> Result<(), OutputError> {
    let Some(path) = &plan.outputs.report else { return Ok(()) };
    let unwritable =
        |error: serde_json::Error| OutputError::File { path: path.clone(), source: error.into() };
    let text = json::to_pretty_text(report).map_err(unwritable)?;
    write_guarded(plan, inputs, OutputTarget::from_report_path(path), None, sink, |guard| {
        write_atomically_with_policy(path, text.as_bytes(), guard, token)
    })
}

/// Removes the report for an earlier image after another image has replaced that image. Does not remove files
/// that a report must not replace. Reports failures as events.
pub(crate) fn remove_outdated_report(plan: &RenderPlan, inputs: &ProtectedInputs, sink: &EventSink) {
    if let Err(error) = remove_report(plan, inputs, sink) {
        sink.send_write_failed(None, format!("the report describes an earlier image: {error}"));
    }
}

fn remove_report(plan: &RenderPlan, inputs: &ProtectedInputs, sink: &EventSink) -> Result<(), OutputError> {
    let Some(path) = plan.outputs.report.as_ref().filter(|path| path.is_file()) else { return Ok(()) };
    let failed = |source| OutputError::File { path: path.clone(), source };
    let remove = |guard: &ExistingFilePolicy<'_>| {
        let real = std::fs::canonicalize(path).map_err(failed)?;
        (guard.may_replace)(&real)?;
        std::fs::remove_file(&real).map_err(failed)
    };
    write_guarded(plan, inputs, OutputTarget::from_report_path(path), None, sink, remove)
}

fn image_report(finished: &RequestResults<'_>) -> ImageReport {
    let plan = finished.plan;
    let samples = finished.state.film.sample_count_stats();
    let outputs: &[PathBuf] = if finished.is_written { &plan.outputs.images } else { &[] };
    let paths: Vec<String> = outputs.iter().map(|path| path.to_string_lossy().into_owned()).collect();
    ImageReport {
        path: paths.first().cloned(),
        paths,
        width: plan.settings.render.width,
        height: plan.settings.render.height,
        samples: samples.into(),
        error: finished.state.film.relative_error(),
        render_seconds: finished.state.render_seconds,
        complete: finished.state.is_complete(plan.settings.render.samples),
        range: data_view_value_range(finished),
    }
}

fn light_sampling_report(finished: &RequestResults<'_>) -> LightSamplingReport {
    let lights = &finished.scene.world.lights;
    let settings = &finished.plan.settings;
    let samples = u64::from(settings.render.shadow_samples);
    let are_gathered =
        settings.gathers_photons() && finished.photons.is_some_and(|photons| photons.emitted > 0);
    let selection = lights.sampler_for_purpose(light_sampling_purpose(settings, are_gathered));
    let (sampled, picks) = match selection {
        Some(selection) => (SampledLightSet::Picked, samples * u64::from(selection.picks.count)),
        None => (SampledLightSet::All, 0),
    };
    LightSamplingReport {
        count: lights.len() as u64,
        sampled,
        picks,
        tree_nodes: selection.map_or(0, |selection| selection.tree.node_count()) as u64,
        memory_bytes: lights.light_trees_memory_bytes() as u64,
    }
}

fn data_view_value_range(finished: &RequestResults<'_>) -> Option<[f32; 2]> {
    let RequestResults { plan, state, .. } = finished;
    let tone = plan.tone_mapping();
    if tone.range_map == DataBrightnessMap::None {
        return None;
    }
    let image = state.film.image(plan.settings.view.displayed_film_quantity());
    tone.with_image_range(&image).range_map.range().map(|range| range.limits())
}

fn count_work(finished: &RequestResults<'_>) -> WorkCounters {
    let (world, textures) = (&finished.scene.world, &finished.scene.assets.textures);
    let rays = finished.rays;
    WorkCounters {
        triangles: world.triangle_count(),
        objects: world.object_count(),
        camera_rays: rays.camera_rays,
        shadow_rays: rays.shadow_rays,
        reflected_rays: rays.reflected_rays,
        refracted_rays: rays.refracted_rays,
        scattered_rays: rays.scattered_rays,
        photons_emitted: finished.photons.map_or(0, |photons| photons.emitted),
        photons_stored: finished.photons.map_or(0, |photons| photons.stored),
        texels_loaded: textures.texels_loaded,
        texture_memory_bytes: textures.memory_bytes,
        texture_lookups: rays.texture_lookups + finished.photons.map_or(0, |photons| photons.lookups),
        non_finite_samples: finished.state.film.non_finite_samples(),
        accel_memory_bytes: world.accel_memory_bytes() as u64,
        films: finished.films.count() as u64,
        film_memory_bytes: finished.films.memory_bytes(),
    }
}

/// Peak resident memory of the process in bytes, or 0 if unknown.
fn peak_memory_bytes() -> u64 {
    peak_memory_from_proc_status().unwrap_or_else(peak_memory_from_rusage)
}

/// Peak resident memory of this program, on systems that report it (proc_pid_status(5)).
fn peak_memory_from_proc_status() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kibibytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.trim().strip_suffix("kB")?;
    Some(kibibytes.trim().parse::<u64>().ok()? * 1024)
}

/// Peak resident memory of the process. Includes memory used before the process executed this program, which
/// may be large depending on the parent process.
fn peak_memory_from_rusage() -> u64 {
    use nix::sys::resource::{UsageWho, getrusage};
    // Bytes on macOS, kibibytes elsewhere (getrusage(2)).
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    let highest = getrusage(UsageWho::RUSAGE_SELF).map_or(0, |usage| usage.max_rss());
    u64::try_from(highest).unwrap_or(0) * unit
}
