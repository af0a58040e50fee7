//! Tests for `--set`.

use std::path::Path;

use super::description::*;
use super::diagnostic::Diagnostic;
use super::source::{MALFORMED_SET, MISSING_EQUALS_HELP};
use super::tests::CAMERA;
use super::{ParseOutcome, SceneText, document, parse};

/// Adds a camera to `text` and parses it with `--set` values.
fn parse_with_set_args(text: &str, sets: &[&str]) -> Result<Scene, Vec<Diagnostic>> {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    let source = SceneText::with_set_args(format!("{text}\n{CAMERA}").into(), &sets)?;
    let ParseOutcome { scene, diagnostics, .. } = document::parse_and_lower(&source, Path::new("scene.toml"));
    scene.ok_or(diagnostics)
}

const BALLS: &str = "[render]\nsamples = 4
[materials.wall]\ndiffuse = [0.1, 0.2, 0.3]
[[sphere]]\ncenter=[0,0,0]\nradius=1\nmaterial='wall'
[[sphere]]\ncenter=[1,0,0]\nradius=2\nmaterial='wall'\nname='ball'
[[sphere]]\ncenter=[2,0,0]\nradius=3\nmaterial='wall'\nname='big ball'
[[groups.pair.sphere]]\ncenter=[0,0,0]\nradius=4\nmaterial='wall'\nname='small'
[[instance]]\ngroup='pair'\ntranslate=[4, 5, 6]";

#[test]
fn set_is_equivalent_to_editing_the_file() {
    let cases: [(&[&str], &str, &str); 13] = [
        (&["render.samples=3"], "samples = 4", "samples = 3"),
        (&["render.width=7"], "samples = 4", "samples = 4\nwidth = 7"),
        (&["render.samples=3", "render.samples=9"], "samples = 4", "samples = 9"),
        (&["camera.position=[1, 2, 3]"], "[0, 1, 4]", "[1, 2, 3]"),
        (&["materials.wall.diffuse=0.5"], "[0.1, 0.2, 0.3]", "0.5"),
        (&["materials.wall.diffuse=tomato"], "[0.1, 0.2, 0.3]", "'tomato'"),
        (&["materials.wall.diffuse=#ff0000"], "[0.1, 0.2, 0.3]", "'#ff0000'"),
        (&["sphere.2.radius=.25"], "radius=2", "radius=0.25"),
        (&["sphere.ball.radius=0.25"], "radius=2", "radius=0.25"),
        (&["sphere.'big ball'.radius=0.25"], "radius=3", "radius=0.25"),
        (&["photons.count=77"], "[render]", "[photons]\ncount = 77\n[render]"),
        (&["groups.pair.sphere.small.radius=7"], "radius=4", "radius=7"),
        (&["instance.1.translate=[1, 2, 3]"], "[4, 5, 6]", "[1, 2, 3]"),
    ];
    for (sets, old, new) in cases {
        let text = format!("{BALLS}\n{CAMERA}").replace(old, new);
        let from_file = parse(text.into(), Path::new("scene.toml")).scene.expect("a scene");
        let from_set = parse_with_set_args(BALLS, sets).expect("a scene");
        assert_eq!((&from_set.render, &from_set.camera), (&from_file.render, &from_file.camera), "{sets:?}");
        assert_eq!(from_set.photons, from_file.photons, "{sets:?}");
        let shapes = |scene: &Scene| scene.objects.iter().map(|one| one.shape.clone()).collect::<Vec<_>>();
        assert_eq!(shapes(&from_set), shapes(&from_file), "{sets:?}");
        let kinds = |scene: &Scene| scene.materials.iter().map(|one| one.kind.clone()).collect::<Vec<_>>();
        assert_eq!(kinds(&from_set), kinds(&from_file), "{sets:?}");
    }
}

#[test]
fn mistakes_in_set_are_reported() {
    let two = "[[sphere]]\ncenter=[0,0,0]\nradius=1\nmaterial='wall'\nname='ball'";
    for (set, message, written) in [
        ("render.samples=0", "`samples` must be a whole number between 1 and 4294967295", "0"),
        ("render.samples=lots", "`samples` must be a whole number", "\"lots\""),
        ("render.sampels=3", "unknown key `sampels` in [render]", "sampels"),
        ("rendr.samples=3", "unknown table `rendr`", "rendr"),
        ("materials.wal.diffuse=1", "the scene has no table [materials.wal]", "wal"),
        ("materials.wal={}", "the scene has no table [materials.wal]", "wal"),
        ("textures.a.file=b.png", "the scene has no table [textures.a]", "a"),
        ("sphere.5.radius=1", "there is no [[sphere]] with number or name `5`", "5"),
        ("sphere.0.radius=1", "there is no [[sphere]] with number or name `0`", "0"),
        ("sphere.radius=1", "there is no [[sphere]] with number or name `radius`", "radius"),
        ("sphere.ball.radius=1", "2 [[sphere]] tables are named `ball`", "ball"),
        ("cone.1.radius=1", "the scene has no [[cone]]", "1"),
        ("light.1.intensity=1", "the scene has no [[light]]", "1"),
        ("groups.triple.sphere.1.radius=1", "the scene has no table [groups.triple]", "triple"),
        ("groups.pair.cone.1.radius=1", "the scene has no [[groups.pair.cone]]", "1"),
        ("groups.pair.sphere.2.radius=1", "there is no [[groups.pair.sphere]] with number or name `2`", "2"),
        ("groups.pair.sphere.1.raduis=1", "unknown key `raduis` in [[groups.pair.sphere]]", "raduis"),
        ("instance.1.group=triple", "there is no group \"triple\"", "\"triple\""),
        (
            "camera.position.1=3",
            "`camera.position` is an array of values and can only be set as a whole",
            "1",
        ),
        ("camera.position=3", "`position` must be three numbers, [x, y, z]", "3"),
        ("sphere.1=3", "[[sphere]] must be a table", "3"),
        ("samples=3", MALFORMED_SET, "samples=3"),
        ("render.samples 3", MALFORMED_SET, "render.samples 3"),
    ] {
        let errors = parse_with_set_args(&format!("{BALLS}\n{two}"), &[set]).expect_err("an error");
        let [error] = errors.as_slice() else { panic!("{set}: {errors:?}") };
        let place = error.place.as_ref().expect("a place");
        assert_eq!((&*error.message, &place.source[place.span.clone()]), (message, written), "{set}");
        assert_eq!(error.path, Path::new("--set"), "{set}");
        let help = error.help.as_deref().unwrap_or_default();
        assert!(set.contains('=') || help == MISSING_EQUALS_HELP, "{set}: {help}");
    }
}

#[test]
fn unclosed_brackets_do_not_affect_set() {
    let source = SceneText::with_set_args("[render]\nsamples = [1,".into(), &["render.width=3".to_owned()])
        .expect("a text");
    let outcome = document::parse_and_lower(&source, Path::new("scene.toml"));
    assert!(
        outcome.diagnostics.iter().all(|one| one.path == Path::new("scene.toml")),
        "{:?}",
        outcome.diagnostics
    );
}

#[test]
fn position_and_look_at_override_the_orbiter() {
    let camera = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        let source = SceneText::with_set_args("[camera]\norbiter = 'a.txt'\nfocus = 2.0\n".into(), &sets)
            .expect("sets");
        document::parse_camera(&source)
    };
    let place = ["camera.position=[1,2,3]", "camera.look_at=[0,0,0]"];
    let Some(Camera::LookAt { position, projection, focus, .. }) =
        camera(&[place[0], place[1], "camera.fov=30"])
    else {
        panic!("expected a camera defined by vectors")
    };
    assert_eq!(
        (position, projection.fov(), focus),
        (crate::math::DVec3::new(1.0, 2.0, 3.0), Some(30.0), 2.0)
    );
    let orbiter = "camera.orbiter=b.txt";
    for sets in [vec![place[0]], vec![place[1]], vec![place[0], place[1], orbiter]] {
        assert!(!matches!(camera(&sets), Some(Camera::LookAt { .. })), "{sets:?}");
    }
}

#[test]
fn projection_from_set_ignores_keys_of_the_file() {
    let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\nfov = 30\naperture = 0.1\nfocus = 2\n";
    let camera = |sets: &[&str]| {
        let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
        document::parse_camera(&SceneText::with_set_args(text.into(), &sets).expect("sets"))
    };
    let Some(Camera::LookAt { projection, aperture, focus, .. }) = camera(&["camera.projection=panorama"])
    else {
        panic!("expected a panorama")
    };
    assert_eq!((projection, aperture, focus), (Projection::Spherical, 0.0, 4.0));
    assert!(camera(&["camera.projection=orthographic"]).is_none());
    assert!(camera(&["camera.projection=orthographic", "camera.view_height=2"]).is_some());
    assert!(camera(&["camera.projection=panorama", "camera.fov=20"]).is_none());
    assert!(camera(&["camera.view_height=2"]).is_none());
}
