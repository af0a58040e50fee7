//! From a scene and what the command line changes of it to the settings that hold.

use std::path::{Path, PathBuf};

use super::protocol::Effective;
use super::settings::{Overrides, View};
use crate::film::Rect;
use crate::film::tone::{Curve, ToneMapping};
use crate::integrators::RenderSettings;
use crate::scene::description::{Accel, Camera, Integrator, Scene, Shadows, Tonemap};
use crate::scene::diagnostic::{Diagnostic, Severity};

/// Everything that a request's later stages go by.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The scene's file name, for pictures to carry.
    pub(super) name: String,
    /// The scene with the overrides in its `[render]` table.
    pub(super) scene: Scene,
    pub(super) settings: RenderSettings,
    pub(super) samples: u32,
    pub(super) threads: usize,
    pub(super) crop: Option<Rect>,
    pub(super) time_seconds: Option<f64>,
    pub(super) tone: ToneMapping,
    pub(super) bit_depth: u8,
    pub(super) outputs: Vec<PathBuf>,
    pub(super) effective: Effective,
}

/// Put scene and overrides together.
///
/// # Errors
/// A crop outside the picture.
pub(super) fn plan(mut scene: Scene, path: &Path, overrides: &Overrides) -> Result<Plan, Box<Diagnostic>> {
    override_render(&mut scene, overrides);
    let render = &scene.render;
    check_crop(overrides.crop, render.width, render.height, path)?;
    let aperture = match &scene.camera {
        Camera::LookAt { aperture, .. } | Camera::Orbiter { aperture, .. } => *aperture,
    };
    let settings = RenderSettings {
        width: render.width,
        height: render.height,
        max_depth: render.max_depth,
        shadows: render.shadows,
        shadow_samples: render.shadow_samples,
        filter: render.filter,
        dof: overrides.dof != Some(false) && aperture > 0.0,
        seed: render.seed,
        view: overrides.view.unwrap_or_default(),
    };
    let threads = overrides.threads.filter(|count| *count > 0).unwrap_or_else(cores);
    let outputs = outputs(render.output.as_ref(), path, overrides);
    Ok(Plan {
        name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        settings,
        samples: render.samples,
        threads,
        crop: overrides.crop,
        time_seconds: overrides.time_seconds,
        tone: tone(render.exposure, render.tonemap, settings.view),
        bit_depth: overrides.bit_depth.unwrap_or(8),
        effective: effective(&scene, &settings, threads, &outputs),
        outputs,
        scene,
    })
}

fn override_render(scene: &mut Scene, overrides: &Overrides) {
    let render = &mut scene.render;
    render.width = overrides.width.unwrap_or(render.width);
    render.height = overrides.height.unwrap_or(render.height);
    render.samples = overrides.samples.unwrap_or(render.samples);
    render.max_depth = overrides.max_depth.unwrap_or(render.max_depth);
    render.integrator = overrides.integrator.unwrap_or(render.integrator);
    render.shadows = overrides.shadows.unwrap_or(render.shadows);
    render.accel = overrides.accel.unwrap_or(render.accel);
    render.seed = overrides.seed.unwrap_or(render.seed);
}

/// The command line's files, else the scene's, else the scene's name with `.png` in the working directory.
fn outputs(of_scene: Option<&PathBuf>, path: &Path, overrides: &Overrides) -> Vec<PathBuf> {
    if !overrides.outputs.is_empty() {
        return overrides.outputs.clone();
    }
    let default = || {
        let mut name = path.file_stem().unwrap_or("glimt".as_ref()).to_owned();
        name.push(".png");
        PathBuf::from(name)
    };
    vec![of_scene.cloned().unwrap_or_else(default)]
}

fn check_crop(crop: Option<Rect>, width: u32, height: u32, path: &Path) -> Result<(), Box<Diagnostic>> {
    let inside = |rect: Rect| {
        rect.area() > 0
            && rect.x.checked_add(rect.width).is_some_and(|right| right <= width)
            && rect.y.checked_add(rect.height).is_some_and(|bottom| bottom <= height)
    };
    match crop {
        Some(rect) if !inside(rect) => Err(Box::new(Diagnostic {
            severity: Severity::Error,
            message: format!(
                "--crop {},{},{},{} does not lie inside the picture of {width}×{height} pixels",
                rect.x, rect.y, rect.width, rect.height
            ),
            path: path.to_owned(),
            place: None,
            help: Some("X,Y,W,H are the left and top pixel, the width and the height".to_owned()),
        })),
        _ => Ok(()),
    }
}

/// Exposure and tone curve are for light; numbers that are display values already are shown as they are.
fn tone(exposure: f32, tonemap: Tonemap, view: View) -> ToneMapping {
    let is_light = matches!(view, View::Beauty | View::Ambient | View::Diffuse | View::Specular);
    let curve = match tonemap {
        Tonemap::None => Curve::None,
        Tonemap::Reinhard => Curve::Reinhard,
        Tonemap::Aces => Curve::Aces,
        Tonemap::Agx => Curve::Agx,
    };
    match (is_light, view.is_data()) {
        (true, _) => ToneMapping { exposure_stops: exposure, curve, ..Default::default() },
        (false, true) => ToneMapping::DATA,
        // A share of light that arrives is linear, but no exposure makes it more than it is.
        (false, false) => ToneMapping::default(),
    }
}

fn effective(scene: &Scene, settings: &RenderSettings, threads: usize, outputs: &[PathBuf]) -> Effective {
    Effective {
        width: settings.width,
        height: settings.height,
        samples: scene.render.samples,
        integrator: match scene.render.integrator {
            Integrator::Whitted => "whitted",
        },
        shadows: match settings.shadows {
            Shadows::Off => "off",
            Shadows::Hard => "hard",
            Shadows::Soft => "soft",
        },
        // The integrators of this version gather no photons, whatever is asked for.
        photons: false,
        dof: settings.dof,
        accel: match scene.render.accel {
            Accel::Bvh => "bvh",
            Accel::KdTree => "kdtree",
        },
        view: settings.view.name(),
        seed: settings.seed,
        threads,
        outputs: outputs.to_vec(),
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::tests::scene_of;

    fn planned(text: &str, overrides: &Overrides) -> Plan {
        plan(scene_of(text), Path::new("scenes/my.scene.toml"), overrides).expect("a plan")
    }

    #[test]
    fn the_command_line_wins_over_the_scene_and_the_scene_over_defaults() {
        let text = "[render]\nwidth = 32\nheight = 24\nsamples = 4\n";
        let given = planned(text, &Overrides::default());
        assert_eq!((given.settings.width, given.settings.height, given.samples), (32, 24, 4));
        let overrides = Overrides {
            width: Some(8),
            samples: Some(2),
            threads: Some(3),
            seed: Some(9),
            ..Default::default()
        };
        let changed = planned(text, &overrides);
        assert_eq!((changed.settings.width, changed.settings.height, changed.samples), (8, 24, 2));
        assert_eq!((changed.threads, changed.settings.seed, changed.scene.render.width), (3, 9, 8));
    }

    #[test]
    fn the_default_output_is_the_scenes_name_in_the_working_directory() {
        assert_eq!(planned("", &Overrides::default()).outputs, [PathBuf::from("my.scene.png")]);
        let scene = "[render]\noutput = \"a/b.exr\"\n";
        assert_eq!(planned(scene, &Overrides::default()).outputs, [PathBuf::from("a/b.exr")]);
        let overrides = Overrides { outputs: vec!["x.png".into(), "y.exr".into()], ..Default::default() };
        assert_eq!(planned(scene, &overrides).outputs.len(), 2);
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
    fn a_crop_must_lie_inside() {
        let text = "[render]\nwidth = 32\nheight = 24\n";
        let with = |x, y, width, height| Overrides {
            crop: Some(Rect { x, y, width, height }),
            ..Default::default()
        };
        let path = Path::new("a.toml");
        assert!(plan(scene_of(text), path, &with(31, 23, 1, 1)).is_ok());
        for outside in [with(31, 23, 2, 1), with(0, 0, 0, 1), with(u32::MAX, 0, 2, 2)] {
            let wrong = plan(scene_of(text), path, &outside).expect_err("outside");
            assert!(wrong.message.contains("32×24"), "{}", wrong.message);
        }
    }

    #[test]
    fn exposure_is_for_light_only() {
        let text = "[render]\nexposure = 2.0\n";
        assert_eq!(planned(text, &Overrides::default()).tone.exposure_stops, 2.0);
        let normals = Overrides { view: Some(View::Normal), ..Default::default() };
        assert_eq!(planned(text, &normals).tone.exposure_stops, 0.0);
    }

    #[test]
    fn only_display_values_skip_the_srgb_curve() {
        use crate::film::tone::Transfer;
        for view in View::ALL {
            let overrides = Overrides { view: Some(view), ..Default::default() };
            let transfer = planned("", &overrides).tone.transfer;
            assert_eq!(transfer == Transfer::Identity, view.is_data(), "{}", view.name());
        }
    }
}
