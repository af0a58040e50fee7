//! Tests for reuse: which stages rerun after an edit, and which files are reported.

use super::*;
use crate::integrators::ViewMode;
use crate::scene::description::{Accel, ShadowMode};

#[test]
fn edits_rerun_only_dependent_stages() {
    let mut bench = Bench::new(SCENE);
    assert_statuses(&bench.done().0, "dddddsdd");

    let (report, unchanged) = bench.done();
    assert_statuses(&report, "rrrrrsrr");
    assert!(unchanged, "the file is the same");

    bench.edit("[camera]", "# a comment\n[camera]");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrrsrr");
    assert!(unchanged, "a comment");

    bench.edit("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrrsdd");
    assert!(!unchanged, "a material");

    bench.edit("intensity = [10, 10, 10]", "intensity = [9, 10, 10]");
    assert_statuses(&bench.done().0, "drrrdsdd");

    bench.edit("position = [0, 1, 4]", "position = [0, 1, 5]");
    assert_statuses(&bench.done().0, "drrrrsdd");

    bench.edit("exposure = 0.0", "exposure = 1.0");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrrrsrd");
    assert!(!unchanged, "the exposure");

    bench.edit("translate = [0, 0, 0]", "translate = [1, 0, 0]");
    let report = bench.done().0;
    assert_statuses(&report, "drrdrsdd");
    assert!(report.stages[Stage::Accel as usize].why.contains("1 kept"), "the mesh's tree should be reused");

    bench.edit("exposure = 1.0", "exposure = 1.0\naccel = \"kdtree\"");
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "drrdrsrr");
    assert!(unchanged, "every kind of tree should produce the same image");
    assert_eq!(report.counters.camera_rays, 0);
    assert!(
        !report.stages[Stage::Accel as usize].why.contains("kept"),
        "another kind of tree should be built"
    );
    assert_eq!(report.settings.accel, Accel::KdTree);

    bench.write("skin.ppm", "P6\n1 1\n255\nxyz");
    let report = bench.done().0;
    assert_statuses(&report, "rrdrrsdd");
    assert!(report.counters.texels_loaded > 0);

    bench.write("one.obj", &format!("{OBJ}f 1 3 2\n"));
    assert_statuses(&bench.done().0, "rdrdrsdd");
}

#[test]
fn opacity_and_vertex_colors_rerun_few_stages() {
    let mut bench = Bench::new(SCENE);
    assert_statuses(&bench.done().0, "dddddsdd");
    let mut expect = |from: &str, to: &str, statuses: &str| {
        bench.edit(from, to);
        let (report, unchanged) = bench.done();
        assert_statuses(&report, statuses);
        assert!(!unchanged, "{to}");
    };
    expect("diffuse = [0.5, 0.5, 0.5]", "diffuse = [0.5, 0.5, 0.5]\nopacity = 0.5", "drrrrsdd");
    expect("translate = [0, 0, 0]", "translate = [0, 0, 0]\nvertex_colors = true", "drrrrsdd");
    // An emissive surface is a light. Its power depends on the opacity.
    expect("opacity = 0.5", "opacity = 0.5\nemission = [1, 1, 1]", "drrrdsdd");
    expect("opacity = 0.5", "opacity = 0.25", "drrrdsdd");
    expect("emission = [1, 1, 1]", "emission = [1, 1, 1]\nemission_sides = \"both\"", "drrrdsdd");
}

#[test]
fn bump_maps_rerun_only_the_render() {
    let mut bench = Bench::new(&format!("{SCENE}[textures.bumps]\nfile = \"bumps.ppm\"\n"));
    bench.write("bumps.ppm", "P6\n2 1\n255\nabcxyz");
    assert_statuses(&bench.done().0, "dddddsdd");
    let mut expect = |from: &str, to: &str, statuses: &str| {
        bench.edit(from, to);
        let (report, unchanged) = bench.done();
        assert_statuses(&report, statuses);
        assert!(!unchanged, "{to}");
    };
    let diffuse = "diffuse = [0.5, 0.5, 0.5]";
    let bump = format!("{diffuse}\nbump = \"bumps\"\nbump_scale = 0.1");
    expect(diffuse, &bump, "drdrrsdd");
    expect("bump_scale = 0.1", "bump_scale = 0.2", "drrrrsdd");
    expect("bump = \"bumps\"", "bump = { texture = \"bumps\", channel = \"b\" }", "drdrrsdd");
}

#[test]
fn companion_file_change_reloads_the_mesh() {
    let mut bench = Bench::new(SCENE);
    bench.write("one.mtl", "newmtl a\nKd 1 0 0\n");
    bench.write("one.obj", &format!("mtllib one.mtl\n{OBJ}"));
    bench.done();
    assert_statuses(&bench.done().0, "rrrrrsrr");
    bench.write("one.mtl", "newmtl a\nKd 0 1 0\n");
    let report = bench.done().0;
    assert_eq!(report.stages[Stage::Meshes as usize].status, StageStatus::Done);
}

/// One file of each kind that a scene can reference: its name, old text and new text. The test replaces the
/// file after it is hashed and before it is decoded.
const KINDS: [(&str, &str, &str); 8] = [
    ("scene.toml", KINDS_SCENE, "#"),
    (
        "camera.txt",
        "c 0 1 0\np 0 0\nr 18 16\ns 2.5 3.5\nf 45 40 30\n",
        "c 0 1 0\np 0 0\nr 30 5\ns 2.5 3.5\nf 45 40 30\n",
    ),
    ("skin.ppm", "P6\n1 1\n255\nabc", "P6\n1 1\n255\nxyz"),
    ("sky.ppm", "P6\n1 1\n255\nabc", "P6\n1 1\n255\nxyz"),
    (
        "one.obj",
        "mtllib one.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n",
        "mtllib one.mtl\nv 0 0 0\nv 1 0 0\nv 0 2 0\nusemtl m\nf 1 2 3\n",
    ),
    ("one.mtl", "newmtl m\nKd 1 0 0\n", "newmtl m\nKd 0 1 0\n"),
    (
        "a.bin",
        "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0@\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0@\0\0\0\0",
        "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0A\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0@\0\0\0\0",
    ),
    ("image", "P6\n1 1\n255\nabc", "P6\n1 1\n255\nxyz"),
];

const KINDS_SCENE: &str = r#"
[render]
width = 40
height = 30
samples = 4
[camera]
orbiter = "camera.txt"
[environment]
file = "sky.ppm"
[textures.skin]
file = "skin.ppm"
[textures.linked]
file = "a.gltf"
image = 0
[materials.ball]
diffuse = { texture = "skin" }
[materials.other]
diffuse = { texture = "linked" }
[[sphere]]
center = [-0.5, 1.5, 0]
radius = 0.5
material = "ball"
[[sphere]]
center = [0, 0.5, 0]
radius = 0.5
material = "other"
[[mesh]]
file = "one.obj"
[[mesh]]
file = "a.gltf"
part = 0
material = "ball"
translate = [0, 0, -1]
[[light]]
type = "point"
position = [0, 3, 3]
intensity = [10, 10, 10]
"#;

const KINDS_GLTF: &str = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 36}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}], "images": [{"uri": "image"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]}"#;

#[test]
fn image_never_uses_unhashed_bytes() {
    let new_bench = || {
        let bench = Bench::new(KINDS_SCENE);
        bench.write("a.gltf", KINDS_GLTF);
        KINDS.iter().for_each(|(name, old, _)| bench.write(name, old));
        bench
    };
    let image = |bench: &mut Bench| {
        bench.done();
        bench.picture()
    };
    let old_image = image(&mut new_bench());
    for (name, old, new) in KINDS {
        let new = if name == "scene.toml" { old.replace("0.5", "0.7") } else { new.to_owned() };
        let mut fresh = new_bench();
        fresh.write(name, &new);
        let new_image = image(&mut fresh);
        assert!(new_image != old_image, "{name} should affect the image");
        // Test without caches first, then with the old content cached.
        for is_cold in [true, false] {
            let mut bench = new_bench();
            if !is_cold {
                bench.done();
                bench.write(name, old);
            }
            let contents = Arc::clone(&bench.contents);
            let replacements = || contents.replacements.lock().expect("not poisoned");
            replacements().insert(bench.path(name), (bench.path(name), new.clone().into()));
            let shown = image(&mut bench);
            assert!(
                shown == new_image || shown == old_image,
                "{name}, {is_cold}: the image should show one version or the other"
            );
            // A file that is hashed only during decoding has not been replaced yet.
            replacements().clear();
            bench.write(name, &new);
            assert!(
                image(&mut bench) == new_image,
                "{name}, {is_cold}: the image should show the new content"
            );
            bench.write(name, old);
            assert!(
                image(&mut bench) == old_image,
                "{name}, {is_cold}: the image should show the old content again"
            );
        }
    }
}

#[test]
fn files_replaced_while_others_load_are_read_again() {
    let image = |bench: &mut Bench| {
        bench.done();
        bench.picture()
    };
    let new = SCENE.replace("position = [0, 1, 4]", "fov = 25\nposition = [0, 1, 4]");
    let new_image = image(&mut Bench::new(&new));
    assert!(new_image != image(&mut Bench::new(SCENE)));
    // Replace the scene after it has been read, while its texture is being read.
    let mut bench = Bench::new(SCENE);
    let replacement = (bench.path("scene.toml"), new.into_bytes());
    let contents = Arc::clone(&bench.contents);
    contents.replacements.lock().expect("not poisoned").insert(bench.path("skin.ppm"), replacement);
    assert!(image(&mut bench) == new_image);
}

#[test]
fn files_replaced_before_an_error_are_read_again() {
    // The scene is replaced while its mesh is still being read, so the texture of the old scene is no longer
    // valid.
    let new = SCENE.replace("skin.ppm", "new.ppm");
    let mut bench = Bench::new(SCENE);
    std::fs::rename(bench.path("skin.ppm"), bench.path("new.ppm")).expect("renamed");
    bench.write("skin.ppm", "P6\n");
    let replacement = (bench.path("scene.toml"), new.into_bytes());
    let contents = Arc::clone(&bench.contents);
    contents.replacements.lock().expect("not poisoned").insert(bench.path("one.obj"), replacement);
    bench.done();
    // An error in unchanged files is reported.
    bench.write("new.ppm", "P6\n");
    assert!(matches!(bench.failed(), Failure::Scene(_)));
}

#[test]
fn unchanged_files_are_hashed_once() {
    let textures = "[textures.skin]\nfile = \"skin.ppm\"\n";
    let twice = format!("{textures}[textures.bumps]\nfile = \"skin.ppm\"\nencoding = \"linear\"\n");
    let scene = SCENE.replace(textures, &twice).replace("\"skin\" }", "\"skin\" }\nnormal_map = \"bumps\"");
    let mut bench = Bench::new(&scene);
    bench.write("one.mtl", "newmtl a\nKd 1 0 0\n");
    bench.write("one.obj", &format!("mtllib one.mtl\n{OBJ}"));
    // Files with recent timestamps are hashed more often.
    std::thread::sleep(Duration::from_millis(2100));
    // The material file is unknown until the mesh is read, so the first request hashes it while decoding it.
    // The output is new after the first request.
    for expected in [&["one.obj", "out.ppm", "scene.toml", "skin.ppm"][..], &["one.mtl", "out.ppm"], &[]] {
        bench.done();
        let mut hashed = std::mem::take(&mut *bench.contents.hashed.lock().expect("not poisoned"));
        hashed.sort_unstable();
        let expected: Vec<_> = expected.iter().map(|name| bench.path(name)).collect();
        // The output has a recent timestamp until two seconds have passed.
        hashed.retain(|path| !expected.is_empty() || *path != bench.path("out.ppm"));
        assert_eq!(hashed, expected);
    }
}

#[test]
fn toggling_a_setting_back_reuses_the_film() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    let soft = bench.picture();
    bench.overrides.shadows = Some(ShadowMode::Off);
    let (report, _) = bench.done();
    assert_eq!(report.stages[Stage::Render as usize].status, StageStatus::Done);
    assert_eq!(report.counters.films, 2);
    assert!(report.counters.film_memory_bytes >= 2 * 40 * 30 * 28);
    bench.overrides.shadows = None;
    bench.writing = WriteRequirement::No;
    let (report, unchanged) = bench.done();
    assert_statuses(&report, "rrrrrsrs");
    assert!(!unchanged, "the shown image should differ");
    bench.writing = WriteRequirement::Must;
    let (report, _) = bench.done();
    assert_statuses(&report, "rrrrrsrd");
    assert_eq!(report.counters.camera_rays, 0);
    assert_eq!(bench.picture(), soft);
    bench.force = true;
    assert_eq!(bench.done().0.stages[Stage::Render as usize].status, StageStatus::Done, "forced");
}

#[test]
fn deleted_image_is_written_again() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    fs::remove_file(bench.path("out.ppm")).expect("removed");
    assert_statuses(&bench.done().0, "rrrrrsrd");
    assert!(bench.path("out.ppm").exists());
}

#[test]
fn skipped_stages_have_reasons() {
    let text = SCENE.replace("{ texture = \"skin\" }", "[1, 1, 1]");
    let text = text.replace("[textures.skin]\nfile = \"skin.ppm\"\n", "");
    let text = text.replace("[[mesh]]\nfile = \"one.obj\"\nmaterial = \"wall\"\ntranslate = [0, 0, 0]\n", "");
    let report = Bench::new(&text).done().0;
    assert_statuses(&report, "dssddsdd");
    let why = |stage: Stage| report.stages[stage as usize].why.clone();
    assert_eq!(why(Stage::Meshes), reasons::NO_MESHES);
    assert_eq!(why(Stage::Textures), reasons::NO_TEXTURES);
    assert_eq!(why(Stage::Photons), reasons::PHOTONS_OFF);
}

#[test]
fn photons_are_retraced_only_if_affected() {
    // Ambient light is only visible while photons are off.
    let text = SCENE.replace("exposure = 0.0", "exposure = 0.0\nambient = 0.3");
    let mirror = "[[quad]]\ncorner = [-2, 0, -2]\nu = [4, 0, 0]\nv = [0, 4, 0]\nmaterial = \"steel\"\n";
    let steel = "[materials.steel]\ntype = \"mirror\"\n";
    let on = "[photons]\nenabled = true\ncount = 500\n";
    let mut bench = Bench::new(&format!("{text}{mirror}{steel}{on}"));
    let of = |report: &Report| report.photons.expect("a photon report");
    let report = bench.done().0;
    assert_statuses(&report, "dddddddd");
    assert!(report.settings.photons);
    assert_eq!((of(&report).passes, of(&report).emitted), (4, 2000), "there should be one pass per sample");
    assert_eq!((report.counters.photons_emitted, report.counters.photons_stored), (2000, of(&report).stored));

    for (from, to, expected) in [
        ("position = [0, 1, 4]", "position = [0, 1.5, 4]", "drrrrrdd"),
        ("exposure = 0.0", "exposure = 1.0", "drrrrrrd"),
        ("width = 40", "width = 44", "drrrrrdd"),
    ] {
        bench.edit(from, to);
        let report = bench.done().0;
        assert_statuses(&report, expected);
        assert_eq!((of(&report).passes, report.counters.photons_emitted), (0, 0), "{to}");
    }
    bench.edit("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]");
    assert_statuses(&bench.done().0, "drrrrddd");
    bench.edit("intensity = [10, 10, 10]", "intensity = [9, 10, 10]");
    assert_statuses(&bench.done().0, "drrrdddd");

    let on = bench.picture();
    bench.overrides.photons = Some(false);
    let report = bench.done().0;
    assert_statuses(&report, "rrrrrsdd");
    assert!(report.photons.is_none() && bench.picture() != on);
    bench.overrides.photons = None;
    assert_statuses(&bench.done().0, "rrrrrrrd");
    assert_eq!(bench.picture(), on, "the cached film should be shown");
}

#[test]
fn photons_are_skipped_without_mirrors() {
    let mut bench = Bench::new(&format!("{SCENE}[photons]\nenabled = true\n"));
    for (expected, next) in [("dddddsdd", "[0, 1.5, 4]"), ("drrrrsdd", "[0, 1, 4]")] {
        let report = bench.done().0;
        assert_statuses(&report, expected);
        assert!(report.settings.photons);
        assert_eq!(report.counters.photons_emitted, 0);
        bench.edit("position = [0, 1", &format!("position = {next} # [0, 1"));
    }
}

#[test]
fn reused_photons_match_a_fresh_render() {
    // `ambient` is ignored with photons, so the stored photons and the film must not depend on it.
    let ambient =
        |value: &str| SCENE.replace("exposure = 0.0", &format!("exposure = 0.0\nambient = {value}"));
    let glass = "[[sphere]]\ncenter = [0.7, 1, 1]\nradius = 0.4\nmaterial = \"clear\"\n[materials.clear]\ntype = \"glass\"\n";
    let on = "[photons]\nenabled = true\ncount = 2000\nradius = 0.2\n";
    let text = |value: &str| format!("{}{glass}{on}", ambient(value));
    let mut bench = Bench::new(&text("0.0"));
    bench.done();
    bench.edit("ambient = 0.0", "ambient = 0.3");
    bench.edit("position = [0, 1, 4]", "position = [0, 1.5, 4]");
    bench.done();
    let mut fresh = Bench::new(&text("0.3").replace("position = [0, 1, 4]", "position = [0, 1.5, 4]"));
    fresh.done();
    assert_eq!(bench.picture(), fresh.picture());
}

#[test]
fn all_broken_assets_are_reported_and_watched() {
    let mut bench = Bench::new(SCENE);
    bench.write("one.obj", "");
    bench.write("skin.ppm", "");
    let of = bench.send();
    let mut events = bench.until_end(of);
    let Some(Event::Failed { failure: Failure::Scene(errors), .. }) = events.pop() else {
        panic!("expected a failure")
    };
    for name in ["one.obj", "skin.ppm"] {
        let error = errors
            .iter()
            .find(|error| error.message.contains(name))
            .expect("an error that mentions the file");
        let place = error.place.as_ref().expect("a location in the scene");
        assert!(
            place.source[place.span.clone()].contains(name),
            "the error should be located at the file name"
        );
        assert_eq!(error.path, bench.path("scene.toml"));
    }
    let Some(Event::Files { files, .. }) = events.pop() else { panic!("expected files") };
    for name in ["scene.toml", "one.obj", "skin.ppm"] {
        assert!(files.iter().any(|file| file.path == bench.path(name)), "{name}");
    }
    assert!(!bench.path("out.ppm").exists());
    bench.write("one.obj", OBJ);
    bench.write("skin.ppm", "P6\n1 1\n255\nabc");
    bench.done();
}

#[test]
fn broken_scene_keeps_its_assets() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    let before = bench.picture();
    bench.edit("width = 40", "width = = 40");
    let of = bench.send();
    let events = bench.until_end(of);
    assert!(matches!(events.last(), Some(Event::Failed { failure: Failure::Scene(_), .. })));
    let files = events.iter().rev().find_map(|event| match event {
        Event::Files { files, .. } => Some(files),
        _ => None,
    });
    assert!(files.expect("files").iter().any(|file| file.path == bench.path("one.obj")));
    assert_eq!(bench.picture(), before, "the image should remain");
    bench.edit("width = = 40", "width = 40");
    // An invalid scene is not cached, so the scene is parsed again, but no other stage runs.
    let (report, unchanged) = bench.done();
    assert_eq!(report.stages[Stage::Meshes as usize].status, StageStatus::Reused);
    assert!(unchanged);
}

#[test]
fn missing_file_of_broken_scene_is_watched() {
    let mut bench = Bench::new(&SCENE.replace("one.obj", "later.obj"));
    let of = bench.send();
    let files: Vec<PathBuf> = bench
        .until_end(of)
        .into_iter()
        .filter_map(|event| match event {
            Event::Files { files, .. } => Some(files),
            _ => None,
        })
        .flatten()
        .map(|file| file.path)
        .collect();
    assert!(files.contains(&bench.path("later.obj")), "{files:?}");
}

#[test]
fn progress_never_decreases_and_ends_at_one() {
    let mut bench = Bench::new(&SCENE.replace("samples = 4", "samples = 40"));
    let of = bench.send();
    let mut fractions = Vec::new();
    for event in bench.until_end(of) {
        if let Event::Progress { progress, .. } = event {
            fractions.push(progress.fraction);
            assert!(progress.total_samples == 40 && progress.samples <= 40);
        }
    }
    assert_eq!(fractions.first(), Some(&0.0));
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{fractions:?}");
    assert_eq!(fractions.last(), Some(&1.0));
}

#[test]
fn thread_count_does_not_change_the_image() {
    let picture = |threads| {
        let mut bench = Bench::new(&SCENE.replace("samples = 4", "samples = 7"));
        bench.overrides.threads = Some(threads);
        assert_eq!(bench.done().0.settings.threads, threads);
        bench.picture()
    };
    let one = picture(1);
    assert!(one == picture(2) && one == picture(7));
}

#[test]
fn adding_samples_later_gives_the_same_image() {
    let mut bench = Bench::new(SCENE);
    let rays = |samples: u64| 40 * 30 * samples;
    bench.done();
    bench.overrides.samples = Some(9);
    let report = bench.done().0;
    assert_eq!(report.image.samples.min, 9);
    assert!(report.image.complete);
    let continued = bench.picture();
    bench.force = true;
    let again = bench.done().0;
    assert_eq!(bench.picture(), continued);
    assert_eq!(again.counters.camera_rays - report.counters.camera_rays, rays(4));
}

#[test]
fn rotating_the_environment_does_not_reload_files() {
    let around = "[environment]\nfile = \"sky.ppm\"\nrotate = 0\n";
    let mut bench = Bench::new(&format!("{SCENE}{around}"));
    let sky = "P6\n2 1\n255\nabcdef";
    bench.write("sky.ppm", sky);
    let report = bench.done().0;
    assert_statuses(&report, "dddddsdd");
    assert_eq!(report.counters.texels_loaded, 3);
    assert_eq!(report.stages[Stage::Lights as usize].why, "2 lights");
    assert_statuses(&bench.done().0, "rrrrrsrr");
    // No texels are read and no trees are built.
    for (old, new) in [("rotate = 0", "rotate = 90"), ("rotate = 90", "color = [1, 0.5, 1]")] {
        bench.edit(old, new);
        let report = bench.done().0;
        assert_statuses(&report, "drrrdsdd");
        assert_eq!(report.counters.texels_loaded, 0);
    }
    // Changes to the file are detected.
    bench.write("sky.ppm", "P6\n2 1\n255\nabcdeg");
    let report = bench.done().0;
    assert_statuses(&report, "rrdrdsdd");
    assert_eq!(report.counters.texels_loaded, 2);
    // Removing the file from the environment drops the map.
    bench.edit("file = \"sky.ppm\"\n", "");
    assert_statuses(&bench.done().0, "drrrdsdd");
    bench.edit("[environment]\n", "# ");
    assert_statuses(&bench.done().0, "drrrdsdd");
}

#[test]
fn camera_and_materials_do_not_affect_the_sky() {
    let sky = "[environment]\nsky = { sun = [1, 1, 0] }\nrotate = 0\n";
    let mut bench = Bench::new(&format!("{SCENE}{sky}"));
    let report = bench.done().0;
    assert_eq!(report.stages[Stage::Lights as usize].why, "3 lights");
    for (old, new) in
        [("position = [0, 1, 4]", "position = [0, 1, 5]"), ("[0.5, 0.5, 0.5]", "[0.6, 0.5, 0.5]")]
    {
        bench.edit(old, new);
        assert_statuses(&bench.done().0, "drrrrsdd");
    }
    for (old, new) in [("rotate = 0", "rotate = 90"), ("sun = [1, 1, 0]", "sun = [1, 1, 0], turbidity = 2")] {
        bench.edit(old, new);
        assert_statuses(&bench.done().0, "drrrdsdd");
    }
    bench.edit("turbidity = 2", "sun_scale = 0");
    assert_eq!(bench.done().0.stages[Stage::Lights as usize].why, "2 lights");
}

#[test]
fn black_map_and_bad_texels_cause_warnings() {
    let around = "[environment]\nfile = \"sky.exr\"\n";
    let messages = |values: &[f32]| {
        let mut bench = Bench::new(&format!("{SCENE}{around}"));
        let raw: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        let kind = image::ExtendedColorType::Rgb32F;
        image::save_buffer(bench.path("sky.exr"), &raw, values.len() as u32 / 3, 1, kind).expect("written");
        let (report, warnings) = bench.done_with_warnings();
        assert_eq!(report.counters.non_finite_samples, 0);
        warnings.into_iter().map(|one| one.message).collect::<Vec<_>>()
    };
    assert_eq!(messages(&[1.0; 6]), Vec::<String>::new());
    let bad = messages(&[
        1.0,
        f32::NAN,
        1.0,
        0.5,
        0.5,
        0.5,
        -1.0,
        1.0,
        1.0,
        1.0,
        1.0,
        f32::INFINITY,
        3e38,
        0.0,
        0.0,
    ]);
    assert!(bad.len() == 1 && bad[0].contains("sky.exr: 4 "), "{bad:?}");
    let black = messages(&[0.0; 6]);
    assert!(black.len() == 1 && black[0].contains(" 2 × 1 "), "{black:?}");
    assert_eq!(messages(&[f32::NAN; 3]).len(), 2);
}

#[test]
fn invalid_map_error_points_to_its_reference() {
    let mut bench = Bench::new(&format!("{SCENE}[environment]\nfile = \"sky.hdr\"\n"));
    bench.write("sky.hdr", "not an image");
    let Failure::Scene(errors) = bench.failed() else { panic!("expected scene errors") };
    assert_eq!(errors.len(), 1, "{errors:?}");
    let place = errors[0].place.as_ref().expect("a place");
    assert_eq!(&place.source[place.span.clone()], "\"sky.hdr\"");
    assert!(errors[0].message.contains("sky.hdr"), "{}", errors[0].message);
}

#[test]
fn mipmaps_are_built_without_reading_files() {
    let mut bench = Bench::new(SCENE);
    bench.write("skin.ppm", "P6\n2 2\n255\nabcabcabcabc");
    let report = bench.done().0;
    assert_eq!((report.counters.texels_loaded, report.counters.texture_memory_bytes), (4, 12));
    bench.edit("file = \"skin.ppm\"", "file = \"skin.ppm\"\nfilter = \"mipmap\"");
    let report = bench.done().0;
    assert_statuses(&report, "drdrrsdd");
    // The second level is one texel of three floats.
    assert_eq!((report.counters.texels_loaded, report.counters.texture_memory_bytes), (0, 24));
    bench.edit("diffuse = [0.5, 0.5, 0.5]", "diffuse = [0.6, 0.5, 0.5]");
    assert_statuses(&bench.done().0, "drrrrsdd");
}

#[test]
fn emission_texture_changes_the_light() {
    let light = "[textures.slide]\nfile = \"slide.ppm\"\n[materials.light]\nemission = { texture = \"slide\", scale = 2 }\n\
                [[sphere]]\ncenter = [0, 4, 0]\nradius = 0.5\nmaterial = \"light\"\n";
    let mut bench = Bench::new(&format!("{SCENE}{light}"));
    bench.write("slide.ppm", "P6\n1 1\n255\nabc");
    let report = bench.done().0;
    assert_eq!(report.stages[Stage::Lights as usize].why, "2 lights");
    let before = bench.picture();
    assert_statuses(&bench.done().0, "rrrrrsrr");
    bench.write("slide.ppm", "P6\n1 1\n255\nxyz");
    assert_statuses(&bench.done().0, "rrdrdsdd");
    assert_ne!(bench.picture(), before);
    bench.edit("scale = 2", "scale = 3");
    assert_statuses(&bench.done().0, "drrrdsdd");
    // An emissive material that is black or has a factor of 0 does not create a light.
    bench.write("slide.ppm", "P6\n1 1\n255\n\0\0\0");
    assert_eq!(bench.done().0.stages[Stage::Lights as usize].why, "1 light");
    bench.edit("scale = 3", "scale = 0");
    let report = bench.done().0;
    assert_eq!(report.counters.texture_memory_bytes, 3, "the texture should not be loaded");
}

#[test]
fn sample_and_error_views_reuse_the_film() {
    let mut bench = Bench::new(SCENE);
    bench.done();
    let beauty = bench.picture();
    for view in [ViewMode::Samples, ViewMode::Error] {
        bench.overrides.view = Some(view);
        let report = bench.done().0;
        assert_statuses(&report, "rrrrrsrd");
        assert_eq!(report.counters.camera_rays, 0);
        assert_ne!(bench.picture(), beauty);
    }
    bench.overrides.view = None;
    assert_statuses(&bench.done().0, "rrrrrsrd");
    assert_eq!(bench.picture(), beauty);
}

/// A texture that is missing at first must be watched, and must be shown once it exists.
#[test]
fn model_texture_is_shown_once_it_exists() {
    let mut bench = Bench::new(SCENE);
    bench.scene = "one.obj";
    bench.write("one.mtl", "newmtl m\nKd 0.2 0.4 0.2\nmap_Kd later.ppm\n");
    bench.write("one.obj", "mtllib one.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
    let of = bench.send();
    let events = bench.until_end(of);
    let is_watched = |event: &Event| match event {
        Event::Files { files, .. } => files.iter().any(|file| file.path == bench.path("later.ppm")),
        _ => false,
    };
    assert!(events.iter().any(is_watched));
    let has_warning = |warnings: &[Diagnostic]| warnings.iter().any(|one| one.message.contains("later.ppm"));
    let Some(Event::Done { warnings, .. }) = events.last() else { panic!("{:?}", events.last()) };
    assert!(has_warning(warnings), "{warnings:?}");
    let without = bench.picture();
    bench.write("later.ppm", "P6\n1 1\n255\nabc");
    assert!(!has_warning(&bench.done_with_warnings().1));
    let with = bench.picture();
    assert!(with != without);
    fs::remove_file(bench.path("later.ppm")).expect("removed");
    assert!(has_warning(&bench.done_with_warnings().1));
    assert!(bench.picture() == without);
}
