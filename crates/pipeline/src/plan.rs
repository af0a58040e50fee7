//! Merges a scene with its overrides into the effective settings of a request.

mod checks;
mod outputs;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::formats::model::ModelViewOptions;
use super::protocol::Request;
use super::settings::{
    CheckpointSettings, EffectiveSettingsSummary, OutputLayer, Overrides, ViewMode, layers_to_record,
};
use super::turntable::TurntableFrame;
use crate::film::range_map::{DataBrightnessMap, DataKind};
use crate::film::tone::ToneMapping;
use crate::film::{FilmQuantity, Rect};
use crate::integrators::{AovSource, FirstHitQuantity, PathAov, PhotonSettings, RenderSettings};
use crate::math::Vec3;
use crate::scene::description::{Accel, PhotonOptions, RenderOptions, Scene};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::system::threads::logical_cpu_count;
use crate::world::TextureRolesNeededByRender;
use checks::{check_animation_format, check_crop, check_layers, check_shardable, check_size_and_bit_depth};
pub(super) use outputs::{OutputFiles, OutputNameSource};

/// Resolved settings of a request, merged from the scene, the command line and the keyboard.
#[derive(Clone, Debug)]
pub(super) struct RenderPlan {
    /// Path of the scene file or model.
    pub(super) path: PathBuf,
    /// The scene, with the acceleration structure from the overrides. All other overrides are in `settings`.
    pub(super) scene: Arc<Scene>,
    pub(super) settings: RenderSettings,
    pub(super) crop: Option<Rect>,
    /// 1-based number of the part to render, and the number of parts.
    pub(super) shard: Option<(u32, u32)>,
    /// The turntable frame, or `None` for a still image.
    pub(super) turn: Option<TurntableFrame>,
    /// The view of a model, as specified on the command line.
    pub(super) model_view: ModelViewOptions,
    /// Additional layers for EXR files.
    pub(super) layers: Vec<OutputLayer>,
    /// Bits per channel.
    pub(super) bit_depth: u8,
    pub(super) outputs: OutputFiles,
    pub(super) checkpoints: CheckpointSettings,
    pub(super) limits: ResourceLimits,
}

/// Limits on the resources that a render uses.
#[derive(Clone, Copy, Debug)]
pub(super) struct ResourceLimits {
    /// Number of render threads.
    pub(super) threads: usize,
    /// Time limit in seconds.
    pub(super) seconds: Option<f64>,
    /// Maximum memory use in bytes.
    pub(super) memory: Option<u64>,
}

impl RenderPlan {
    /// Returns the file name of the scene, which is stored in part files.
    pub(super) fn scene_file_name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the tone mapping for the view. Exposure and tone curve apply only to light, not to data.
    pub(super) fn tone_mapping(&self) -> ToneMapping {
        let RenderOptions { exposure, tonemap: curve, .. } = self.settings.render;
        match self.settings.view.aov_source() {
            AovSource::Light(PathAov::Radiance(_))
            | AovSource::Bounds
            | AovSource::Film(FilmQuantity::Radiance) => {
                ToneMapping { exposure_stops: exposure, curve, ..Default::default() }
            }
            AovSource::FirstHit(FirstHitQuantity::Depth) => ToneMapping {
                range_map: DataBrightnessMap::Unresolved(DataKind::Distances),
                ..ToneMapping::DATA
            },
            AovSource::Light(PathAov::TraversalCost)
            | AovSource::FirstHit(FirstHitQuantity::Photons)
            | AovSource::Film(FilmQuantity::Samples | FilmQuantity::Error) => ToneMapping {
                range_map: DataBrightnessMap::Unresolved(DataKind::Amounts),
                ..ToneMapping::DATA
            },
            AovSource::FirstHit(
                FirstHitQuantity::Normal
                | FirstHitQuantity::Barycentric
                | FirstHitQuantity::Uv
                | FirstHitQuantity::Albedo,
            ) => ToneMapping::DATA,
            // The values are linear, but exposure must not scale them.
            AovSource::Light(PathAov::LitFraction) => ToneMapping::default(),
        }
    }

    /// Summarizes the settings for status lines and reports.
    pub(super) fn effective_settings_summary(&self) -> EffectiveSettingsSummary {
        let RenderSettings { render, dof, view, photons, layers: _ } =
            self.settings.without_ineffective_settings();
        EffectiveSettingsSummary {
            width: render.width,
            height: render.height,
            samples: render.samples,
            error: render.error,
            integrator: render.integrator,
            shadows: self.settings.render.shadows,
            clamp: render.clamp,
            photons: photons.is_some(),
            dof,
            accel: render.accel,
            view,
            exposure: render.exposure,
            seed: render.seed,
            threads: self.limits.threads,
            outputs: [self.outputs.images.as_slice(), &self.outputs.animations].concat(),
        }
    }
}

/// Resolved settings of the image to show, and of the image that the scene specifies.
pub(super) struct ShownAndScenePlans {
    pub(super) shown: RenderPlan,
    /// Settings of the scene's own image, or `None` if the request is for that image.
    pub(super) own: Option<RenderPlan>,
}

impl ShownAndScenePlans {
    /// Merges a scene and the overrides of a request.
    ///
    /// # Errors
    /// See [`resolve_plan`].
    pub(super) fn resolve(scene: &Arc<Scene>, request: &Request) -> Result<Self, Box<Diagnostic>> {
        let plan = |overrides: &Overrides| resolve_plan(scene, &request.scene, overrides);
        Ok(Self { shown: plan(&request.overrides)?, own: request.own.as_deref().map(plan).transpose()? })
    }

    /// Returns the textures that the request needs, including those for the scene's own image, because its
    /// film key depends on them.
    pub(super) fn texture_needs(&self) -> TextureRolesNeededByRender {
        let shown = self.shown.settings.texture_needs();
        self.own.as_ref().map_or(shown, |own| shown.union(own.settings.texture_needs()))
    }
}

/// Merges a scene and overrides.
///
/// # Errors
/// The crop is outside the image, or an output format cannot store the image.
pub(super) fn resolve_plan(
    scene: &Arc<Scene>,
    path: &Path,
    overrides: &Overrides,
) -> Result<RenderPlan, Box<Diagnostic>> {
    let mut render = overrides.apply_to(&scene.render);
    if scene.environment.is_some() {
        render.background = Vec3::ZERO;
    }
    check_crop(overrides.crop, render.width, render.height)?;
    let aperture = scene.camera.lens_radius();
    let photons = overrides.photons.unwrap_or(scene.photons.enabled);
    let settings = RenderSettings {
        render,
        dof: overrides.dof != Some(false) && aperture > 0.0,
        view: overrides.view.unwrap_or(ViewMode::Beauty),
        photons: photons.then(|| photon_settings(&scene.photons, &render)),
        layers: layers_to_record(&overrides.layers),
    };
    let plan = RenderPlan {
        path: path.to_owned(),
        scene: scene_with_accel_setting(scene, render.accel),
        settings,
        crop: overrides.crop,
        shard: overrides.shard,
        turn: overrides.turn,
        model_view: ModelViewOptions::from_overrides(overrides),
        layers: overrides.layers.clone(),
        bit_depth: overrides.bit_depth.unwrap_or(8),
        outputs: OutputFiles::resolve(scene.output.as_ref(), path, overrides),
        checkpoints: overrides.checkpoints,
        limits: ResourceLimits {
            threads: thread_count(overrides),
            seconds: overrides.time_seconds,
            memory: overrides.memory,
        },
    };
    match plan.shard {
        // Part files do not use an image format.
        Some(_) => check_shardable(&plan.settings, overrides)?,
        None => {
            plan.outputs.images.iter().try_for_each(|path| check_size_and_bit_depth(&plan, path))?;
            check_layers(&plan)?;
            plan.outputs.animations.iter().try_for_each(|path| check_animation_format(&plan, path))?;
        }
    }
    Ok(plan)
}

/// Maximum number of photons per pass, limited by memory.
pub(super) const MAX_PHOTONS: u64 = 4_000_000;

/// Range for the default photon count, which is the number of pixels clamped to this range. With fewer
/// photons, the additional error outweighs the time saved. More photons leave less time for further passes
/// and delay the first image.
const PHOTONS_BY_PIXELS: RangeInclusive<u64> = 8192..=200_000;

/// Returns the photon settings for an image.
fn photon_settings(requested: &PhotonOptions, image: &RenderOptions) -> PhotonSettings {
    let PhotonOptions { enabled: _, count, radius, bounces } = *requested;
    let by_pixels = || {
        let pixels = u64::from(image.width) * u64::from(image.height);
        pixels.clamp(*PHOTONS_BY_PIXELS.start(), *PHOTONS_BY_PIXELS.end())
    };
    let count = if count == 0 { by_pixels() } else { count.min(MAX_PHOTONS) };
    PhotonSettings { count: count as u32, radius: radius as f32, bounces }
}

/// Returns the scene with acceleration structure `accel`. Copies the scene only if necessary, because it may
/// be large.
fn scene_with_accel_setting(scene: &Arc<Scene>, accel: Accel) -> Arc<Scene> {
    let mut scene = Arc::clone(scene);
    if scene.render.accel != accel {
        Arc::make_mut(&mut scene).render.accel = accel;
    }
    scene
}

/// Creates an error about the command line.
pub(super) fn argument_error(message: String, help: &str) -> Box<Diagnostic> {
    let error = Diagnostic::about_file(Path::new(""), Severity::Error, message);
    Box::new(Diagnostic { help: Some(help.to_owned()), ..error })
}

/// Returns the number of render threads: the requested number, or one per core.
pub(super) fn thread_count(overrides: &Overrides) -> usize {
    overrides.threads.filter(|count| *count > 0).unwrap_or_else(logical_cpu_count)
}

#[cfg(test)]
mod tests;
