//! Tests for cameras moved by the front end.

use super::*;
use crate::math::DVec3;
use crate::messages;
use crate::protocol::{CameraSaveResult, NormalizedPosition, PickedPixel, SavedCameraEdit, UserMovedCamera};
use crate::scene::description::{CameraOverrides, ImageShiftAndMirror, Pose, Projection, ResolvedCamera};

/// Tables that add a mirror and photons to a scene.
const PHOTONS: &str = "[[quad]]\ncorner = [-2, 0, -2]\nu = [4, 0, 0]\nv = [0, 4, 0]\nmaterial = \"steel\"\n\
    [materials.steel]\ntype = \"mirror\"\n[photons]\nenabled = true\ncount = 500\n";

fn moved() -> CameraOverrides {
    let pose = Pose { position: DVec3::new(0.5, 1.5, 4.25), look_at: DVec3::Y, up: DVec3::Y };
    CameraOverrides { pose: Some(pose), fov: Some(35.0), ..CameraOverrides::default() }
}

/// Returns a request's camera, which is the scene's camera with the front end's changes.
fn camera(bench: &mut Bench) -> ResolvedCamera {
    let of = bench.send();
    let events = bench.until_end(of);
    let camera = |event: &Event| match event {
        Event::Settings { own, .. } => Some(own.camera),
        _ => None,
    };
    let own = events.iter().find_map(camera).expect("a camera");
    own.with_change(&bench.overrides.camera)
}

#[test]
fn moving_camera_reuses_trees_lights_and_photons() {
    let mut bench = Bench::new(&format!("{SCENE}{PHOTONS}"));
    bench.done();
    let own = bench.picture();
    bench.overrides.camera = moved();
    bench.writing = WriteRequirement::No;
    let (report, _) = bench.done();
    assert_statuses(&report, "rrrrrrds");
    assert_eq!(report.counters.photons_emitted, 0);
    assert_eq!(bench.picture(), own, "the image should not be written");
    bench.overrides.camera = CameraOverrides::default();
    bench.writing = WriteRequirement::Must;
    assert_statuses(&bench.done().0, "rrrrrrrr");
}

#[test]
fn moved_camera_matches_edited_file() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.camera = moved();
    bench.done();
    let shown = bench.picture();
    bench.overrides.camera = CameraOverrides::default();
    bench.done();
    assert_ne!(bench.picture(), shown);
    bench.overrides.sets = vec!["camera.position=[0.5,1.5,4.25]".to_owned(), "camera.fov=35".to_owned()];
    assert_statuses(&bench.done().0, "drrrrsrd");
    assert_eq!(bench.picture(), shown);
}

#[test]
fn focus_follows_look_at_unless_set() {
    for (scene, expected) in [
        (SCENE.to_owned(), moved().pose.expect("a pose").distance()),
        (SCENE.replace("[camera]", "[camera]\nfocus = 2.5"), 2.5),
    ] {
        let mut bench = Bench::new(&scene);
        bench.overrides.camera = moved();
        assert_eq!(camera(&mut bench).focus, expected);
        bench.overrides.camera.focus = Some(1.25);
        assert_eq!(camera(&mut bench).focus, 1.25);
    }
}

#[test]
fn orbiter_camera_can_be_moved() {
    let orbiter = SCENE.replace("position = [0, 1, 4]\nlook_at = [0, 1, 0]", "orbiter = \"camera.txt\"");
    let mut bench = Bench::new(&orbiter);
    bench.write("camera.txt", "c 0 1 0\np 0 0\nr 0 0\ns 4 5\nf 40 4 3\n");
    let own = camera(&mut bench);
    assert_eq!(
        (own.pose.position, own.pose.look_at, own.projection.fov()),
        (DVec3::new(0.0, 1.0, 4.0), DVec3::Y, Some(40.0))
    );
    bench.overrides.camera = moved();
    bench.done();
    let shown = bench.picture();
    let mut other = Bench::new(SCENE);
    other.overrides.camera = moved();
    other.done();
    assert_eq!(other.picture(), shown);
}

/// Sends a query and waits for the answer.
fn answer(bench: &mut Bench, command: Command) -> Event {
    bench.worker.send(command);
    loop {
        let event = bench.next();
        if matches!(event, Event::Picked { .. } | Event::CameraKept { .. } | Event::CameraUndone { .. }) {
            return event;
        }
    }
}

fn keep(bench: &mut Bench, camera: ResolvedCamera) -> Result<CameraSaveResult, String> {
    keep_moved_from(bench, camera, bench.own.get().expect("the scene's camera"))
}

/// Like [`keep`], but for a camera that was moved starting from `own` instead of the scene's camera.
fn keep_moved_from(
    bench: &mut Bench,
    camera: ResolvedCamera,
    own: ResolvedCamera,
) -> Result<CameraSaveResult, String> {
    match answer(bench, Command::KeepCamera(Box::new(UserMovedCamera { camera, own }))) {
        Event::CameraKept { outcome, .. } => outcome,
        other => panic!("{other:?}"),
    }
}

fn undo(bench: &mut Bench, edit: SavedCameraEdit) -> Result<std::path::PathBuf, String> {
    match answer(bench, Command::UndoCamera(edit)) {
        Event::CameraUndone { outcome, .. } => outcome,
        other => panic!("{other:?}"),
    }
}

fn pick(bench: &mut Bench, x: f64, y: f64) -> PickedPixel {
    match answer(bench, Command::Pick(NormalizedPosition { x, y })) {
        Event::Picked { picked, .. } => *picked,
        other => panic!("{other:?}"),
    }
}

#[test]
fn saving_the_camera_does_not_rerender() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    let shown = bench.picture();
    let kept = keep(&mut bench, camera).expect("written");
    assert_eq!((kept.path, kept.is_new, kept.is_own), (bench.path("scene.toml"), true, true));
    let expected = SCENE
        .replace("[0, 1, 4]", "[0.5, 1.5, 4.25]")
        .replace("look_at = [0, 1, 0]", "look_at = [0, 1, 0]\nfov = 35");
    assert_eq!(fs::read_to_string(bench.path("scene.toml")).expect("a scene"), expected);
    bench.overrides.camera = CameraOverrides::default();
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrrsrr");
    assert!(unchanged && bench.picture() == shown);
    assert!(!keep(&mut bench, camera).expect("nothing should be written").is_new);
}

#[test]
fn changed_file_is_not_overwritten() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    bench.edit("[camera]", "# another edit\n[camera]");
    let text = fs::read_to_string(bench.path("scene.toml")).expect("a scene");
    let why = keep(&mut bench, camera).expect_err("refused");
    assert!(why == messages::SCENE_FILE_CHANGED, "{why}");
    assert_eq!(fs::read_to_string(bench.path("scene.toml")).expect("a scene"), text);
    bench.done();
    assert!(keep(&mut bench, camera).expect("read again").is_new);
}

#[test]
fn outdated_camera_is_not_saved() {
    let mut bench = Bench::new(&SCENE.replace("[camera]", "[camera]\nfov = 34"));
    bench.done();
    let own = bench.own.get().expect("a camera");
    let moved = own.with_change(&CameraOverrides { fov: None, ..moved() });
    // The worker reads the edited file before it receives the camera.
    bench.edit("fov = 34", "fov = 20");
    bench.done();
    let text = fs::read_to_string(bench.path("scene.toml")).expect("a scene");
    let why = keep_moved_from(&mut bench, moved, own).expect_err("refused");
    assert_eq!(why, messages::CAMERA_CHANGED);
    assert_eq!(fs::read_to_string(bench.path("scene.toml")).expect("a scene"), text);
    // If the move starts from the file's current camera, the camera is saved and the edit is preserved.
    let moved = ResolvedCamera { projection: Projection::Perspective { fov: 20.0 }, ..moved };
    assert!(keep(&mut bench, moved).expect("written").is_new);
    let text = fs::read_to_string(bench.path("scene.toml")).expect("a scene");
    assert!(text.contains("fov = 20") && text.contains("[0.5, 1.5, 4.25]"), "{text}");
}

#[test]
fn undo_restores_every_byte() {
    let mut bench = Bench::new(SCENE);
    let text = |bench: &Bench| fs::read_to_string(bench.path("scene.toml")).expect("a scene");
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    let edit = keep(&mut bench, camera).expect("written").edit.expect("an edit");
    let kept = text(&bench);
    // Later edits are preserved, whether or not glimt has read them.
    bench.edit("[camera]", "# another edit\n[camera]");
    let edited = text(&bench);
    for _ in 0..2 {
        let why = undo(&mut bench, edit.clone()).expect_err("refused");
        assert!(why.contains("scene.toml"), "{why}");
        assert_eq!(text(&bench), edited);
        bench.done();
    }
    // Undoing succeeds once the later edit is reverted.
    fs::write(bench.path("scene.toml"), &kept).expect("written");
    assert_eq!(undo(&mut bench, edit.clone()), Ok(bench.path("scene.toml")));
    assert_eq!(text(&bench), SCENE);
    assert!(undo(&mut bench, edit).is_err(), "the edit should already be undone");
    assert_eq!(text(&bench), SCENE);
}

#[test]
fn missing_scene_file_is_reported() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    let edit = keep(&mut bench, camera).expect("written").edit.expect("an edit");
    fs::remove_file(bench.path("scene.toml")).expect("removed");
    let why = undo(&mut bench, edit).expect_err("refused");
    assert!(why.contains("scene.toml"), "{why}");
    let why = keep(&mut bench, camera).expect_err("refused");
    assert_eq!(why, messages::SCENE_FILE_MISSING);
    assert!(!bench.path("scene.toml").exists());
}

#[test]
fn saving_the_camera_keeps_links_and_permissions() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let mut bench = Bench::new(SCENE);
    let real = bench.path("real.toml");
    fs::rename(bench.path("scene.toml"), &real).expect("renamed");
    symlink("real.toml", bench.path("scene.toml")).expect("a link");
    fs::set_permissions(&real, fs::Permissions::from_mode(0o640)).expect("permissions set");
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    assert!(keep(&mut bench, camera).expect("written").is_own);
    assert!(bench.path("scene.toml").is_symlink());
    assert_eq!(fs::metadata(&real).expect("a file").permissions().mode() & 0o777, 0o640);
    assert!(fs::read_to_string(&real).expect("a scene").contains("fov = 35"));
}

#[test]
fn saving_the_camera_keeps_file_attributes() {
    let mut bench = Bench::new(SCENE);
    let path = bench.path("scene.toml");
    // Skip file systems without extended attributes.
    if xattr::set(&path, "user.note", b"mine").is_err() {
        return;
    }
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    assert!(keep(&mut bench, camera).expect("written").is_new);
    assert_eq!(xattr::get(&path, "user.note").expect("attributes").as_deref(), Some(b"mine".as_slice()));
}

#[test]
fn camera_is_not_saved_if_metadata_would_be_lost() {
    for (why, is_linked) in [("has other hard links", true), ("is read-only", false)] {
        let mut bench = Bench::new(SCENE);
        let path = bench.path("scene.toml");
        if is_linked {
            fs::hard_link(path, bench.path("other.toml")).expect("another name");
        } else {
            let mut permissions = fs::metadata(&path).expect("a file").permissions();
            permissions.set_readonly(true);
            fs::set_permissions(path, permissions).expect("permissions set");
        }
        bench.overrides.camera = moved();
        let camera = camera(&mut bench);
        let refusal = keep(&mut bench, camera).expect_err(why);
        assert!(refusal.contains(why), "{refusal}");
        assert_eq!(fs::read_to_string(bench.path("scene.toml")).expect("a scene"), SCENE);
    }
}

#[test]
fn command_line_overrides_saved_camera() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.sets = vec!["camera.fov=20".to_owned()];
    bench.overrides.camera = moved();
    let camera = camera(&mut bench);
    let kept = keep(&mut bench, camera).expect("written");
    assert!(kept.is_new && !kept.is_own);
    assert!(fs::read_to_string(bench.path("scene.toml")).expect("a scene").contains("fov = 35"));
}

#[test]
fn pick_identifies_object_and_material() {
    let mut bench = Bench::new(&SCENE.replace("center = [0, 1, 0]", "name = \"globe\"\ncenter = [0, 1, 0]"));
    bench.done();
    let middle = pick(&mut bench, 0.5, 0.5);
    let object = middle.object.expect("the ball");
    assert_eq!(
        (object.shape, object.name.as_deref(), object.material.as_str()),
        ("sphere", Some("globe"), "phong ball")
    );
    let line = SCENE.lines().position(|line| line == "[[sphere]]").expect("a sphere") + 1;
    assert_eq!((object.path, object.line), (bench.path("scene.toml"), Some(line)));
    assert!(
        (object.position[2] - 0.5).abs() < 0.01 && (object.distance - 3.5).abs() < 0.01,
        "{:?}",
        object.position
    );
    assert!(object.normal[2] > 0.99 && object.is_front && (object.depth - 3.5).abs() < 0.01);
    assert_eq!(middle.pixel, [20, 15]);
    assert!(middle.color.expect("a sample").iter().all(|channel| channel.is_finite()));
    assert_eq!(pick(&mut bench, 0.0, 0.0).object, None);
    assert_eq!(
        pick(&mut bench, 7.0, -1.0).pixel,
        [39, 0],
        "the position should be clamped to the nearest pixel"
    );
}

#[test]
fn queries_do_not_interrupt_a_render() {
    let mut bench = Bench::new(&SCENE.replace("samples = 4", "samples = 1000000"));
    let of = bench.send();
    while !matches!(bench.next(), Event::Progress { progress, .. } if progress.samples > 0) {}
    assert!(pick(&mut bench, 0.5, 0.5).object.is_some());
    let camera = ResolvedCamera {
        pose: moved().pose.expect("a pose"),
        projection: Projection::Perspective { fov: 40.0 },
        window: ImageShiftAndMirror::default(),
        aperture: 0.0,
        focus: 1.0,
    };
    assert!(keep(&mut bench, camera).expect("written").is_new);
    assert!(
        matches!(bench.next(), Event::Progress { .. } | Event::Preview { .. }),
        "the render should continue"
    );
    bench.worker.send(Command::Cancel);
    bench.until_end(of);
}

#[test]
fn clicks_follow_the_image_as_shown() {
    // The ball is at the center of the unshifted image. `shift` moves the window, not the ball.
    for (keys, ball, other) in [
        ("shift = [0.25, 0]", [0.31, 0.5], [0.69, 0.5]),
        ("shift = [0.25, 0]\nmirror = true", [0.69, 0.5], [0.31, 0.5]),
        ("projection = \"panorama\"", [0.5, 0.5], [0.01, 0.5]),
        ("projection = \"fisheye\"\nshift = [0, 0.25]", [0.5, 0.75], [0.5, 0.25]),
    ] {
        let mut bench = Bench::new(&SCENE.replace("[camera]\n", &format!("[camera]\n{keys}\n")));
        bench.done();
        let mut shape = |[x, y]: [f64; 2]| pick(&mut bench, x, y).object.map(|object| object.shape);
        assert_eq!(shape(ball), Some("sphere"), "{keys}");
        assert_ne!(shape(other), Some("sphere"), "{keys}");
    }
}

#[test]
fn pick_reports_materials_from_mesh_files() {
    let mut bench =
        Bench::new("[camera]\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n[[mesh]]\nfile = \"two.obj\"\n");
    bench.write("two.mtl", "newmtl chalk\nKd 1 1 1\n");
    let half = |x: i32, own: &str| format!("v {x} -1 0\nv 0 -1 0\nv 0 1 0\n{own}\nf -3 -2 -1\n");
    bench.write("two.obj", &format!("mtllib two.mtl\n{}{}", half(1, ""), half(-1, "usemtl chalk")));
    bench.done();
    let mut material = |x| pick(&mut bench, x, 0.6).object.expect("a half").material;
    assert_eq!(material(0.45), "chalk (in the file)");
    assert_eq!(material(0.55), "no material in the file");
}
