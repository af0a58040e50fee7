//! Merges a scene with its overrides into the effective settings of a request.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::protocol::Request;
use super::settings::{
    CheckpointSettings, EffectiveSettingsSummary, OutputLayer, Overrides, UpAxis, ViewMode, ViewSide,
    layers_to_record,
};
use super::turntable::{self, TurntableFrame};
use crate::choice::Choice;
use crate::film::range_map::{DataKind, RangeMap};
use crate::film::tone::ToneMapping;
use crate::film::{FilmQuantity, Rect};
use crate::integrators::{AovSource, FirstHitQuantity, LightAov, PhotonSettings, RenderSettings};
use crate::math::Vec3;
use crate::output::AnimationFormat;
use crate::output::{BitDepth, Format, OutputError};
use crate::scene::description::{Accel, PhotonOptions, Scene, Tonemap};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::system::threads::logical_cpu_count;
use crate::world::TextureRolesNeededByRender;

/// Resolved settings of a request, merged from the scene, the command line and the keyboard.
#[derive(Clone, Debug)]
pub(super) struct RenderPlan {
    /// Path of the scene file or model.
    pub(super) path: PathBuf,
    /// File name of the scene, which is stored in part files.
    pub(super) name: String,
    /// The scene, with the acceleration structure from the overrides. All other overrides are in `settings`.
    pub(super) scene: Arc<Scene>,
    pub(super) settings: RenderSettings,
    pub(super) threads: usize,
    pub(super) crop: Option<Rect>,
    pub(super) time_seconds: Option<f64>,
    pub(super) tone: ToneMapping,
    pub(super) bit_depth: u8,
    /// Output files of this image.
    pub(super) outputs: Vec<PathBuf>,
    /// Animation files that contain this image as a frame.
    pub(super) moving: Vec<PathBuf>,
    /// The turntable frame, or `None` for a still image.
    pub(super) turn: Option<TurntableFrame>,
    /// Additional layers for EXR files.
    pub(super) layers: Vec<OutputLayer>,
    /// The side of a model that faces the camera, or `None` if not set on the command line.
    pub(super) from: Option<ViewSide>,
    /// The model's up axis, or `None` if not set on the command line.
    pub(super) up: Option<UpAxis>,
    /// Output files for later turntable frames.
    pub(super) later_outputs: Vec<PathBuf>,
    pub(super) named_by: OutputNameSource,
    /// Default file name pattern for turntable frames, with `#` for the number, or `None` if this is not a
    /// turntable or the user named the files.
    pub(super) default_names: Option<PathBuf>,
    pub(super) report: Option<PathBuf>,
    pub(super) replaces_foreign: bool,
    /// 1-based number of the part to render, and the number of parts.
    pub(super) shard: Option<(u32, u32)>,
    pub(super) checkpoints: CheckpointSettings,
    /// Maximum memory use of the render, in bytes.
    pub(super) memory: Option<u64>,
    pub(super) effective: EffectiveSettingsSummary,
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
    let settings = RenderSettings {
        render,
        dof: overrides.dof != Some(false) && aperture > 0.0,
        view: overrides.view.unwrap_or(ViewMode::Beauty),
        photons: overrides
            .photons
            .unwrap_or(scene.photons.enabled)
            .then(|| photon_settings(&scene.photons, (render.width, render.height))),
        layers: layers_to_record(&overrides.layers),
    };
    let threads = thread_count(overrides);
    let (outputs, named_by) = output_paths(scene.output.as_ref(), path, overrides);
    let is_usual = named_by == OutputNameSource::Default && overrides.turn.is_some();
    let default_names = outputs.first().filter(|_| is_usual).cloned();
    let OutputPathsByKind { outputs, moving, later_outputs } =
        OutputPathsByKind::classify_output_paths(outputs, overrides.turn);
    let bit_depth = overrides.bit_depth.unwrap_or(8);
    match overrides.shard {
        // Part files do not use an image format.
        Some(_) => check_shardable(&settings, overrides)?,
        None => {
            let check =
                |path: &PathBuf| check_format_supports_image(path, (render.width, render.height), bit_depth);
            outputs.iter().try_for_each(check)?;
            check_layers(&outputs, &moving, settings.view, overrides)?;
            moving.iter().try_for_each(|path| {
                check_animation_size_and_depth(path, (render.width, render.height), bit_depth)
            })?;
        }
    }
    Ok(RenderPlan {
        path: path.to_owned(),
        name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        settings,
        threads,
        crop: overrides.crop,
        time_seconds: overrides.time_seconds,
        tone: tone_mapping_for_view(render.exposure, render.tonemap, settings.view),
        bit_depth,
        effective: EffectiveSettingsSummary::new(&settings, threads, &[outputs.as_slice(), &moving].concat()),
        outputs,
        moving,
        later_outputs,
        turn: overrides.turn,
        layers: overrides.layers.clone(),
        from: overrides.from,
        up: overrides.up,
        named_by,
        default_names,
        report: requested_report_path(overrides),
        replaces_foreign: overrides.replaces_foreign,
        shard: overrides.shard,
        checkpoints: overrides.checkpoints,
        memory: overrides.memory,
        scene: scene_with_accel(scene, render.accel),
    })
}

/// Maximum number of photons per pass, limited by memory.
pub(super) const MAX_PHOTONS: u64 = 4_000_000;

/// Range for the default photon count, which is the number of pixels clamped to this range. With fewer
/// photons, the additional error outweighs the time saved. More photons leave less time for further passes
/// and delay the first image.
const PHOTONS_BY_PIXELS: RangeInclusive<u64> = 8192..=200_000;

/// Returns the photon settings for an image of the given size.
fn photon_settings(requested: &PhotonOptions, (width, height): (u32, u32)) -> PhotonSettings {
    let PhotonOptions { enabled: _, count, radius, bounces } = *requested;
    let by_pixels = || {
        let pixels = u64::from(width) * u64::from(height);
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

/// A request's output files, grouped by kind.
struct OutputPathsByKind {
    outputs: Vec<PathBuf>,
    moving: Vec<PathBuf>,
    later_outputs: Vec<PathBuf>,
}

impl OutputPathsByKind {
    fn classify_output_paths(paths: Vec<PathBuf>, turn: Option<TurntableFrame>) -> Self {
        let (mut moving, mut later_outputs) = (Vec::new(), Vec::new());
        let Some(turn) = turn else { return Self { outputs: paths, moving, later_outputs } };
        let mut outputs = Vec::new();
        for path in paths {
            if AnimationFormat::from_path(&path).is_some() {
                moving.push(path);
                continue;
            }
            // For the first frame, also list the files for later frames, so that conflicts are detected
            // before hours of rendering.
            let others = (turn.number + 1..turn.of).filter(|_| turn.number == 0);
            let of = |number| turntable::frame_path(&path, TurntableFrame { number, ..turn });
            later_outputs.extend(others.filter_map(of));
            outputs.push(of(turn.number).unwrap_or(path));
        }
        Self { outputs, moving, later_outputs }
    }
}

/// Creates an error about the command line.
pub(super) fn argument_error(message: String, help: &str) -> Box<Diagnostic> {
    let error = Diagnostic::about_file(Path::new(""), Severity::Error, message);
    Box::new(Diagnostic { help: Some(help.to_owned()), ..error })
}

/// Checks that the requested layers can be written.
fn check_layers(
    outputs: &[PathBuf],
    moving: &[PathBuf],
    view: ViewMode,
    overrides: &Overrides,
) -> Result<(), Box<Diagnostic>> {
    if overrides.layers.is_empty() {
        return Ok(());
    }
    let refused = |message: String, help: &str| Err(argument_error(message, help));
    let is_exr = |path: &&PathBuf| Format::from_path(path).is_ok_and(|format| format == Format::Exr);
    if let Some(other) = outputs.iter().find(|path| !is_exr(path)).or(moving.first()) {
        let message = format!("`--layers` needs EXR output; {} is not an EXR file", other.display());
        return refused(message, "write an EXR file, for example -o layers.exr");
    }
    if view != ViewMode::Beauty {
        let message = format!("`--layers` needs the `beauty` view, not `{}`", view.name());
        return refused(message, "remove --view, or request it as a layer");
    }
    Ok(())
}

/// Checks that an animation format supports the image size and bit depth.
fn check_animation_size_and_depth(
    path: &Path,
    size: (u32, u32),
    bit_depth: u8,
) -> Result<(), Box<Diagnostic>> {
    let Some(format) = AnimationFormat::from_path(path) else { return Ok(()) };
    let message = match format.check_size(size.0, size.1) {
        Err(error) => error.to_string(),
        Ok(()) if bit_depth != 8 => format!("animated {format} files have 8 bits per channel"),
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
fn check_format_supports_image(path: &Path, size: (u32, u32), bit_depth: u8) -> Result<(), Box<Diagnostic>> {
    let check = || Format::from_path(path)?.check_image(size.0, size.1, BitDepth::try_from(bit_depth)?);
    check().map_err(|error: OutputError| {
        Box::new(Diagnostic::about_file(path, Severity::Error, error.to_string()))
    })
}

/// Returns the tone mapping for a view. Exposure and tone curve apply only to light, not to data.
fn tone_mapping_for_view(exposure: f32, curve: Tonemap, view: ViewMode) -> ToneMapping {
    match view.aov_source() {
        AovSource::Light(LightAov::Radiance(_))
        | AovSource::Bounds
        | AovSource::Film(FilmQuantity::Radiance) => {
            ToneMapping { exposure_stops: exposure, curve, ..Default::default() }
        }
        AovSource::FirstHit(FirstHitQuantity::Depth) => {
            ToneMapping { range_map: RangeMap::Unresolved(DataKind::Distances), ..ToneMapping::DATA }
        }
        AovSource::Light(LightAov::TraversalCost)
        | AovSource::FirstHit(FirstHitQuantity::Photons)
        | AovSource::Film(FilmQuantity::Samples | FilmQuantity::Error) => {
            ToneMapping { range_map: RangeMap::Unresolved(DataKind::Amounts), ..ToneMapping::DATA }
        }
        AovSource::FirstHit(
            FirstHitQuantity::Normal
            | FirstHitQuantity::Barycentric
            | FirstHitQuantity::Uv
            | FirstHitQuantity::Albedo,
        ) => ToneMapping::DATA,
        // The values are linear, but exposure must not scale them.
        AovSource::Light(LightAov::LitFraction) => ToneMapping::default(),
    }
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
        assert_eq!((changed.threads, changed.settings.render.seed, changed.effective.width), (3, 9, 8));
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
        assert_eq!(planned("", &Overrides::default()).outputs, [PathBuf::from("my.scene.png")]);
        let scene = "[render]\noutput = \"a/b.exr\"\n";
        let of_scene = planned(scene, &Overrides::default()).outputs;
        assert!(of_scene.len() == 1 && of_scene[0].is_absolute() && of_scene[0].ends_with("a/b.exr"));
        let overrides = Overrides { outputs: vec!["x.png".into(), "y.exr".into()], ..Default::default() };
        assert_eq!(planned(scene, &overrides).outputs, overrides.outputs);
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
        assert!(!planned("", &on).effective.dof);
        let lens = "[camera]\naperture = 0.1\n";
        assert!(planned(lens, &Overrides::default()).effective.dof);
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
        assert_eq!(planned(text, &Overrides::default()).tone.exposure_stops, 2.0);
        let normals = Overrides { view: Some(ViewMode::Normal), ..Default::default() };
        assert_eq!(planned(text, &normals).tone.exposure_stops, 0.0);
    }

    #[test]
    fn only_data_views_skip_the_srgb_curve() {
        use crate::film::tone::Transfer;
        for &view in ViewMode::ALL {
            let overrides = Overrides { view: Some(view), ..Default::default() };
            let transfer = planned("", &overrides).tone.transfer;
            let is_display_value = match view.aov_source() {
                AovSource::FirstHit(_) | AovSource::Light(LightAov::TraversalCost) => true,
                AovSource::Film(quantity) => quantity != FilmQuantity::Radiance,
                AovSource::Light(LightAov::Radiance(_) | LightAov::LitFraction) | AovSource::Bounds => false,
            };
            assert_eq!(transfer == Transfer::Identity, is_display_value, "{}", view.name());
        }
    }
}
