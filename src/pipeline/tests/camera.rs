//! A camera that is moved by the front end.

use super::*;
use crate::math::DVec3;
use crate::scene::description::{CameraChange, Pose, Viewpoint};

/// A mirror, and photons that it throws.
const PHOTONS: &str = "[[quad]]\ncorner = [-2, 0, -2]\nu = [4, 0, 0]\nv = [0, 4, 0]\nmaterial = \"steel\"\n\
    [materials.steel]\ntype = \"mirror\"\n[photons]\nenabled = true\ncount = 500\n";

fn moved() -> CameraChange {
    let pose = Pose { position: DVec3::new(0.5, 1.5, 4.25), look_at: DVec3::Y, up: DVec3::Y };
    CameraChange { pose: Some(pose), fov: Some(35.0), focus: None }
}

/// The camera that a request says it has.
fn camera(bench: &mut Bench) -> Viewpoint {
    let of = bench.send();
    let events = bench.until_end(of);
    let camera = |event: &Event| match event {
        Event::Settings { camera, .. } => Some(*camera),
        _ => None,
    };
    events.iter().find_map(camera).expect("a camera")
}

#[test]
fn a_moved_camera_keeps_trees_lights_and_photons() {
    let mut bench = Bench::new(&format!("{SCENE}{PHOTONS}"));
    bench.done();
    let own = bench.picture();
    bench.overrides.camera = moved();
    bench.writing = Writing::No;
    let (report, _) = bench.done();
    assert_statuses(&report, "rrrrrrds");
    assert_eq!(report.counters.photons_emitted, 0);
    assert_eq!(bench.picture(), own, "it is shown alone");
    bench.overrides.camera = CameraChange::default();
    bench.writing = Writing::Must;
    assert_statuses(&bench.done().0, "rrrrrrrr");
}

#[test]
fn a_moved_camera_gives_the_picture_that_the_file_would() {
    let mut bench = Bench::new(SCENE);
    bench.overrides.camera = moved();
    bench.done();
    let shown = bench.picture();
    bench.overrides.camera = CameraChange::default();
    bench.done();
    assert_ne!(bench.picture(), shown);
    bench.overrides.sets = vec!["camera.position=[0.5,1.5,4.25]".to_owned(), "camera.fov=35".to_owned()];
    assert_statuses(&bench.done().0, "drrrrsrd");
    assert_eq!(bench.picture(), shown);
}

#[test]
fn the_plane_in_focus_goes_with_what_is_looked_at_unless_the_scene_says_where_it_is() {
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
fn an_orbiter_camera_is_moved_by_vectors() {
    let orbiter = SCENE.replace("position = [0, 1, 4]\nlook_at = [0, 1, 0]", "orbiter = \"camera.txt\"");
    let mut bench = Bench::new(&orbiter);
    bench.write("camera.txt", "c 0 1 0\np 0 0\nr 0 0\ns 4 5\nf 40 4 3\n");
    let own = camera(&mut bench);
    assert_eq!((own.pose.position, own.pose.look_at, own.fov), (DVec3::new(0.0, 1.0, 4.0), DVec3::Y, 40.0));
    bench.overrides.camera = moved();
    bench.done();
    let shown = bench.picture();
    let mut other = Bench::new(SCENE);
    other.overrides.camera = moved();
    other.done();
    assert_eq!(other.picture(), shown);
}
