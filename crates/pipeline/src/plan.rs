//! Merges a scene with its overrides into the effective settings of a request.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::formats::model::ModelViewOptions;
use super::protocol::Request;
use super::settings::{
    CheckpointSettings, EffectiveSettingsSummary, OutputLayer, Overrides, ViewMode, layers_to_record,
};
use super::turntable::{self, TurntableFrame};
use crate::choice::Choice;
use crate::film::range_map::{DataBrightnessMap, DataKind};
use crate::film::tone::ToneMapping;
use crate::film::{FilmQuantity, Rect};
use crate::integrators::{AovSource, FirstHitQuantity, PathAov, PhotonSettings, RenderSettings};
use crate::math::Vec3;
use crate::output::AnimationFormat;
use crate::output::{BitDepth, Format, OutputError};
use crate::scene::description::{Accel, PhotonOptions, RenderOptions, Scene};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::system::threads::logical_cpu_count;
use crate::world::TextureRolesNeededByRender;

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

/// The files that a request writes.
#[derive(Clone, Debug)]
pub(super) struct OutputFiles {
    /// Files of this image.
    pub(super) images: Vec<PathBuf>,
    /// Animations that contain this image as a frame.
    pub(super) animations: Vec<PathBuf>,
    /// Image files of later turntable frames.
    pub(super) later_images: Vec<PathBuf>,
    pub(super) report: Option<PathBuf>,
    pub(super) named_by: OutputNameSource,
    /// Default file name pattern for turntable frames, with `#` for the number, or `None` if this is not a
    /// turntable or the user named the files.
    pub(super) default_names: Option<PathBuf>,
    /// Whether the report, and images with default names, may replace files that glimt did not write.
    pub(super) replaces_foreign: bool,
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
    pub(super) fn effective_settings(&self) -> EffectiveSettingsSummary {
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
pub(super) struct RequestPlans {
    pub(super) shown: RenderPlan,
    /// Settings of the scene's own image, or `None` if the request is for that image.
    pub(super) own: Option<RenderPlan>,
}

impl RequestPlans {
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

/// Source of the output file names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OutputNameSource {
    /// The `-o` option.
    CommandLine,
    /// The `output` key in `[render]`.
    Scene,
    /// The scene's name with the extension `.png`.
    Default,
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
        scene: scene_with_accel(scene, render.accel),
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
fn scene_with_accel(scene: &Arc<Scene>, accel: Accel) -> Arc<Scene> {
    let mut scene = Arc::clone(scene);
    if scene.render.accel != accel {
        Arc::make_mut(&mut scene).render.accel = accel;
    }
    scene
}

/// Returns the output files specified on the command line or, failing that, in the scene. The default is a
/// `.png` file in the working directory with the scene's name.
fn output_paths(
    of_scene: Option<&PathBuf>,
    path: &Path,
    overrides: &Overrides,
) -> (Vec<PathBuf>, OutputNameSource) {
    if !overrides.outputs.is_empty() {
        return (overrides.outputs.clone(), OutputNameSource::CommandLine);
    }
    if let Some(of_scene) = of_scene {
        return match overrides.turn {
            None => (vec![of_scene.clone()], OutputNameSource::Scene),
            // The scene specifies only one file, so the turntable uses default names.
            Some(_) => (vec![turntable::add_frame_placeholder(of_scene)], OutputNameSource::Default),
        };
    }
    let mut name = path.file_stem().unwrap_or("glimt".as_ref()).to_owned();
    name.push(".png");
    let name = PathBuf::from(name);
    (
        vec![if overrides.turn.is_some() { turntable::add_frame_placeholder(&name) } else { name }],
        OutputNameSource::Default,
    )
}

/// Returns the report's path. For a turntable, it includes the frame number.
fn requested_report_path(overrides: &Overrides) -> Option<PathBuf> {
    let path = overrides.report.as_ref()?;
    let numbered = overrides.turn.and_then(|turn| turntable::frame_path(path, turn));
    Some(numbered.unwrap_or_else(|| path.clone()))
}

impl OutputFiles {
    /// Resolves the files that a request writes. `of_scene` is the output file specified in the scene.
    fn resolve(of_scene: Option<&PathBuf>, scene: &Path, overrides: &Overrides) -> Self {
        let (paths, named_by) = output_paths(of_scene, scene, overrides);
        let mut files = Self {
            images: Vec::new(),
            animations: Vec::new(),
            later_images: Vec::new(),
            report: requested_report_path(overrides),
            named_by,
            default_names: None,
            replaces_foreign: overrides.replaces_foreign,
        };
        let Some(turn) = overrides.turn else { return Self { images: paths, ..files } };
        files.default_names = paths.first().filter(|_| named_by == OutputNameSource::Default).cloned();
        for path in paths {
            if AnimationFormat::from_path(&path).is_some() {
                files.animations.push(path);
                continue;
            }
            // For the first frame, also list the files for later frames, so that conflicts are detected
            // before hours of rendering.
            let others = (turn.number + 1..turn.of).filter(|_| turn.number == 0);
            let of = |number| turntable::frame_path(&path, TurntableFrame { number, ..turn });
            files.later_images.extend(others.filter_map(of));
            files.images.push(of(turn.number).unwrap_or(path));
        }
        files
    }
}

/// Creates an error about the command line.
pub(super) fn argument_error(message: String, help: &str) -> Box<Diagnostic> {
    let error = Diagnostic::about_file(Path::new(""), Severity::Error, message);
    Box::new(Diagnostic { help: Some(help.to_owned()), ..error })
}

/// Checks that the requested layers can be written.
fn check_layers(plan: &RenderPlan) -> Result<(), Box<Diagnostic>> {
    if plan.layers.is_empty() {
        return Ok(());
    }
    let refused = |message: String, help: &str| Err(argument_error(message, help));
    let is_exr = |path: &&PathBuf| Format::from_path(path).is_ok_and(|format| format == Format::Exr);
    let OutputFiles { images, animations, .. } = &plan.outputs;
    if let Some(other) = images.iter().find(|path| !is_exr(path)).or(animations.first()) {
        let message = format!("`--layers` needs EXR output; {} is not an EXR file", other.display());
        return refused(message, "write an EXR file, for example -o layers.exr");
    }
    let view = plan.settings.view;
    if view != ViewMode::Beauty {
        let message = format!("`--layers` needs the `beauty` view, not `{}`", view.name());
        return refused(message, "remove --view, or request it as a layer");
    }
    Ok(())
}

/// Checks that an animation format supports the image size and bit depth.
fn check_animation_format(plan: &RenderPlan, path: &Path) -> Result<(), Box<Diagnostic>> {
    let Some(format) = AnimationFormat::from_path(path) else { return Ok(()) };
    let RenderOptions { width, height, .. } = plan.settings.render;
    let message = match format.check_size(width, height) {
        Err(error) => error.to_string(),
        Ok(()) if plan.bit_depth != 8 => format!("animated {format} files have 8 bits per channel"),
        Ok(()) => return Ok(()),
    };
    let error = argument_error(message, "use numbered files, for example a_####.png");
    Err(Box::new(Diagnostic { path: path.to_owned(), ..*error }))
}

fn check_crop(crop: Option<Rect>, width: u32, height: u32) -> Result<(), Box<Diagnostic>> {
    let inside = |rect: Rect| {
        rect.area() > 0
            && rect.x.checked_add(rect.width).is_some_and(|right| right <= width)
            && rect.y.checked_add(rect.height).is_some_and(|bottom| bottom <= height)
    };
    match crop {
        Some(rect) if !inside(rect) => {
            let Rect { x, y, width: w, height: h } = rect;
            let message =
                format!("`--crop {x},{y},{w},{h}` is not inside the image of {width}×{height} pixels");
            let help = "X,Y,W,H are the left edge, top edge, width and height in pixels";
            Err(argument_error(message, help))
        }
        _ => Ok(()),
    }
}

/// Checks that an image with these settings can be rendered in parts and that exactly one output file is
/// specified.
fn check_shardable(settings: &RenderSettings, overrides: &Overrides) -> Result<(), Box<Diagnostic>> {
    let refused = |message: &str, help: &str| Err(argument_error(message.to_owned(), help));
    if overrides.outputs.len() != 1 {
        return refused("`--shard` needs exactly one output file", "name it, for example -o night.1.part");
    }
    if overrides.time_seconds.is_some() {
        return refused(
            "`--shard` does not work with `--time`: machines differ in speed",
            "use --samples or --error",
        );
    }
    if settings.gathers_photons() && settings.render.error > 0.0 {
        let message =
            "`--shard` does not work with photons and a noise target: each pass needs the whole image";
        return refused(message, "use --error 0 with --samples, or --photons off");
    }
    if settings.gathers_photons() && settings.view.aov_source() == AovSource::Film(FilmQuantity::Error) {
        return refused(
            "`--shard` does not work with photons and the `error` view",
            "render it without --shard, or use --photons off",
        );
    }
    Ok(())
}

/// Checks that the file format supports the image size and bit depth.
fn check_size_and_bit_depth(plan: &RenderPlan, path: &Path) -> Result<(), Box<Diagnostic>> {
    let RenderOptions { width, height, .. } = plan.settings.render;
    let check = || Format::from_path(path)?.check_image(width, height, BitDepth::try_from(plan.bit_depth)?);
    check().map_err(|error: OutputError| {
        Box::new(Diagnostic::about_file(path, Severity::Error, error.to_string()))
    })
}

/// Returns the number of render threads: the requested number, or one per core.
pub(super) fn thread_count(overrides: &Overrides) -> usize {
    overrides.threads.filter(|count| *count > 0).unwrap_or_else(logical_cpu_count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Choice;
    use crate::output::Format;
    use crate::scene::description::ShadowMode;
    use crate::tests::loaded_of;

    fn planned(text: &str, overrides: &Overrides) -> RenderPlan {
        resolve_plan(&loaded_of(text).scene, Path::new("scenes/my.scene.toml"), overrides).expect("a plan")
    }

    #[test]
    fn command_line_takes_precedence_over_scene() {
        let text = "[render]\nwidth = 32\nheight = 24\nsamples = 4\n";
        let size = |plan: &RenderPlan| {
            let render = &plan.settings.render;
            (render.width, render.height, render.samples)
        };
        let given = planned(text, &Overrides::default());
        assert_eq!(size(&given), (32, 24, 4));
        let overrides = Overrides {
            width: Some(8),
            samples: Some(2),
            threads: Some(3),
            seed: Some(9),
            ..Default::default()
        };
        let changed = planned(text, &overrides);
        assert_eq!(size(&changed), (8, 24, 2));
        assert_eq!(
            (changed.limits.threads, changed.settings.render.seed, changed.effective_settings().width),
            (3, 9, 8)
        );
    }

    #[test]
    fn default_photon_count_is_the_pixel_count() {
        let count = |table: &str, width, height, crop| {
            let overrides =
                Overrides { width: Some(width), height: Some(height), crop, ..Default::default() };
            let text = format!("[photons]\nenabled = true\n{table}");
            planned(&text, &overrides).settings.photons.expect("photon settings").count
        };
        let part = Some(Rect { x: 7, y: 9, width: 5, height: 3 });
        for (table, width, height, photons) in [
            ("", 320, 240, 76_800),
            ("count = 0", 320, 240, 76_800),
            ("", 16, 16, 8192),
            ("", 1920, 1080, 200_000),
            ("count = 500", 320, 240, 500),
            ("count = 9_000_000", 320, 240, MAX_PHOTONS as u32),
        ] {
            assert_eq!(count(table, width, height, None), photons, "{table} at {width}×{height}");
            assert_eq!(
                count(table, width, height, part),
                photons,
                "the photon count should not depend on the crop"
            );
        }
    }

    #[test]
    fn overrides_do_not_copy_the_scene() {
        let scene = loaded_of("").scene;
        let overrides = Overrides { width: Some(8), shadows: Some(ShadowMode::Off), ..Default::default() };
        let planned = resolve_plan(&scene, Path::new("a.toml"), &overrides).expect("a plan");
        assert!(Arc::ptr_eq(&planned.scene, &scene));
    }

    #[test]
    fn default_output_is_named_after_the_scene() {
        assert_eq!(planned("", &Overrides::default()).outputs.images, [PathBuf::from("my.scene.png")]);
        let scene = "[render]\noutput = \"a/b.exr\"\n";
        let of_scene = planned(scene, &Overrides::default()).outputs.images;
        assert!(of_scene.len() == 1 && of_scene[0].is_absolute() && of_scene[0].ends_with("a/b.exr"));
        let overrides = Overrides { outputs: vec!["x.png".into(), "y.exr".into()], ..Default::default() };
        assert_eq!(planned(scene, &overrides).outputs.images, overrides.outputs);
    }

    /// The `scene` and `files` crates each have their own list of formats because neither depends on the
    /// other.
    #[test]
    fn scene_accepts_exactly_the_supported_formats() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("scene.toml");
        let load = |ending: &str| {
            let camera = "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n";
            std::fs::write(&path, format!("[render]\noutput = \"a.{ending}\"\n{camera}")).expect("written");
            crate::scene::load(&path, &[])
        };
        for ending in Format::all_extensions() {
            assert!(load(ending).is_ok(), "{ending}");
        }
        let wrong = format!("{:?}", load("xyz").expect_err("an unknown format"));
        let offered = wrong.split(|c: char| !c.is_alphanumeric()).collect::<std::collections::HashSet<_>>();
        for ending in ["png", "exr", "hdr", "jpg", "jpeg", "ppm", "webp", "tga", "bmp"] {
            assert_eq!(
                offered.contains(ending),
                Format::all_extensions().any(|known| known == ending),
                "{ending}: {wrong}"
            );
        }
    }

    #[test]
    fn depth_of_field_needs_an_aperture() {
        let on = Overrides { dof: Some(true), ..Default::default() };
        assert!(!planned("", &on).effective_settings().dof);
        let lens = "[camera]\naperture = 0.1\n";
        assert!(planned(lens, &Overrides::default()).effective_settings().dof);
        assert!(!planned(lens, &Overrides { dof: Some(false), ..Default::default() }).settings.dof);
    }

    #[test]
    fn crop_must_be_inside_the_image() {
        let text = "[render]\nwidth = 32\nheight = 24\n";
        let with = |x, y, width, height| Overrides {
            crop: Some(Rect { x, y, width, height }),
            ..Default::default()
        };
        let path = Path::new("a.toml");
        let scene = loaded_of(text).scene;
        assert!(resolve_plan(&scene, path, &with(31, 23, 1, 1)).is_ok());
        for outside in [with(31, 23, 2, 1), with(0, 0, 0, 1), with(u32::MAX, 0, 2, 2)] {
            let wrong = resolve_plan(&scene, path, &outside).expect_err("outside");
            assert!(wrong.message.contains("32×24"), "{}", wrong.message);
        }
    }

    #[test]
    fn exposure_applies_only_to_light() {
        let text = "[render]\nexposure = 2.0\n";
        assert_eq!(planned(text, &Overrides::default()).tone_mapping().exposure_stops, 2.0);
        let normals = Overrides { view: Some(ViewMode::Normal), ..Default::default() };
        assert_eq!(planned(text, &normals).tone_mapping().exposure_stops, 0.0);
    }

    #[test]
    fn only_data_views_skip_the_srgb_curve() {
        use crate::film::tone::Transfer;
        for &view in ViewMode::ALL {
            let overrides = Overrides { view: Some(view), ..Default::default() };
            let transfer = planned("", &overrides).tone_mapping().transfer;
            let is_display_value = match view.aov_source() {
                AovSource::FirstHit(_) | AovSource::Light(PathAov::TraversalCost) => true,
                AovSource::Film(quantity) => quantity != FilmQuantity::Radiance,
                AovSource::Light(PathAov::Radiance(_) | PathAov::LitFraction) | AovSource::Bounds => false,
            };
            assert_eq!(transfer == Transfer::Identity, is_display_value, "{}", view.name());
        }
    }
}
