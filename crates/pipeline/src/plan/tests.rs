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
    let overrides =
        Overrides { width: Some(8), samples: Some(2), threads: Some(3), seed: Some(9), ..Default::default() };
    let changed = planned(text, &overrides);
    assert_eq!(size(&changed), (8, 24, 2));
    assert_eq!(
        (changed.limits.threads, changed.settings.render.seed, changed.effective_settings_summary().width),
        (3, 9, 8)
    );
}

#[test]
fn default_photon_count_is_the_pixel_count() {
    let count = |table: &str, width, height, crop| {
        let overrides = Overrides { width: Some(width), height: Some(height), crop, ..Default::default() };
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
    assert!(!planned("", &on).effective_settings_summary().dof);
    let lens = "[camera]\naperture = 0.1\n";
    assert!(planned(lens, &Overrides::default()).effective_settings_summary().dof);
    assert!(!planned(lens, &Overrides { dof: Some(false), ..Default::default() }).settings.dof);
}

#[test]
fn crop_must_be_inside_the_image() {
    let text = "[render]\nwidth = 32\nheight = 24\n";
    let with =
        |x, y, width, height| Overrides { crop: Some(Rect { x, y, width, height }), ..Default::default() };
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
