//! Tests for switching between scenes, and for changing one of several textures.

use super::*;
use crate::settings::ViewMode;

#[test]
fn switching_back_reuses_trees_and_textures() {
    let mut bench = Bench::new(SCENE);
    bench.write("two.obj", &format!("{OBJ}f 1 3 2\n"));
    bench.write("bark.ppm", "P6\n1 1\n255\nxyz");
    bench.done();
    let before = bench.picture();
    let own = fs::read_to_string(bench.path("scene.toml")).expect("the scene");
    let other = own.replace("one.obj", "two.obj").replace("skin.ppm", "bark.ppm");
    bench.write("scene.toml", &other);
    assert_statuses(&bench.done().0, "ddddrsdd");
    for round in 0..2 {
        bench.write("scene.toml", &own);
        let report = bench.done().0;
        assert_statuses(&report, "drrrrsrd");
        assert_eq!(report.stages[Stage::Accel as usize].why, reasons::CACHED, "round {round}");
        assert_eq!(report.counters.texels_loaded, 0);
        assert_eq!(bench.picture(), before);
        bench.write("scene.toml", &other);
        assert_statuses(&bench.done().0, "drrrrsrd");
    }
}

#[test]
fn switching_back_reuses_caches_after_errors() {
    let mut bench = Bench::new(SCENE);
    bench.write("two.obj", &format!("{OBJ}f 1 3 2\n"));
    bench.done();
    let own = fs::read_to_string(bench.path("scene.toml")).expect("the scene");
    bench.edit("one.obj", "two.obj");
    bench.done();
    bench.edit("two.obj", "three.obj");
    for _ in 0..3 {
        bench.failed();
    }
    bench.write("scene.toml", &own);
    assert_statuses(&bench.done().0, "drrrrsrd");
}

#[test]
fn only_the_changed_texture_is_read() {
    let other = "[textures.bark]\nfile = \"bark.ppm\"\n[materials.trunk]\ndiffuse = { texture = \"bark\" }\n\
                 [[sphere]]\ncenter = [1, 1, 0]\nradius = 0.2\nmaterial = \"trunk\"\n";
    let mut bench = Bench::new(&format!("{SCENE}{other}"));
    bench.write("bark.ppm", "P6\n2 1\n255\nxyzxyz");
    let report = bench.done().0;
    assert_eq!((report.counters.texels_loaded, &*report.stages[2].why), (3, "2 loaded"));
    for (name, text, texels) in
        [("bark.ppm", "P6\n2 1\n255\nabcxyz", 2), ("skin.ppm", "P6\n1 1\n255\nxyz", 1)]
    {
        bench.write(name, text);
        let report = bench.done().0;
        assert_statuses(&report, "rrdrrsdd");
        assert_eq!((report.counters.texels_loaded, &*report.stages[2].why), (texels, "1 loaded, 1 cached"));
    }
}

/// A light whose textures for normals, emission and specular color have two, three and four texels. The
/// ball's texture has one texel.
const BUMPY: &str = "[textures.bumps]\nfile = \"bumps.ppm\"\n[textures.glow]\nfile = \"glow.ppm\"\n\
    [textures.gloss]\nfile = \"gloss.ppm\"\n\
    [materials.lamp]\nspecular = { texture = \"gloss\" }\nemission = { texture = \"glow\" }\nnormal_map = \"bumps\"\n\
    [[quad]]\nmaterial = \"lamp\"\n";

const AMBIENT: &str = "\nambient = [0.1, 0.1, 0.1]";

/// Creates a bench for this view with the files used by [`BUMPY`].
fn bumpy(scene: &str, view: ViewMode) -> Bench {
    let mut bench = Bench::new(scene);
    bench.write("bumps.ppm", "P6\n2 1\n255\n\x7f\x7f\x7f\x7f\x7f\x7f");
    bench.write("glow.ppm", "P6\n3 1\n255\nabcabcabc");
    bench.write("gloss.ppm", "P6\n4 1\n255\nabcabcabcabc");
    bench.overrides.view = Some(view);
    bench
}

/// Renders a new scene. Returns the textures stage's status and reason, and the number of texels loaded.
fn textures_of(scene: &str, view: ViewMode) -> (char, String, u64) {
    let report = bumpy(scene, view).done().0;
    let stage = &report.stages[Stage::Textures as usize];
    let status = statuses(&report).chars().nth(Stage::Textures as usize).expect("a stage");
    (status, stage.why.clone(), report.counters.texels_loaded)
}

#[test]
fn view_loads_only_the_textures_it_needs() {
    let bumpy = &format!("{SCENE}{BUMPY}");
    let ambient = |scene: &str| scene.replacen("samples = 4", &format!("samples = 4{AMBIENT}"), 1);
    let textures = |status, why: &str, texels| (status, why.to_owned(), texels);
    let nothing = textures('s', reasons::NOT_NEEDED_FOR_VIEW, 0);
    // These scenes have no photons and no ambient light.
    for view in [ViewMode::Depth, ViewMode::Uv, ViewMode::Barycentric, ViewMode::Photons, ViewMode::Ambient] {
        assert_eq!(textures_of(bumpy, view), nothing, "{view:?}");
    }
    for view in [ViewMode::Normal, ViewMode::Shadow, ViewMode::Emission] {
        assert_eq!(textures_of(SCENE, view), nothing, "{view:?}");
    }
    assert_eq!(textures_of(bumpy, ViewMode::Normal), textures('d', "1 loaded, 3 not needed", 2));
    assert_eq!(textures_of(bumpy, ViewMode::Albedo), textures('d', "1 loaded, 3 not needed", 1));
    // The `shadow` view depends on emission but not on reflectance.
    assert_eq!(textures_of(bumpy, ViewMode::Shadow), textures('d', "2 loaded, 2 not needed", 5));
    assert_eq!(textures_of(bumpy, ViewMode::Emission), textures('d', "1 loaded, 3 not needed", 3));
    assert_eq!(textures_of(&ambient(bumpy), ViewMode::Ambient), textures('d', "1 loaded, 3 not needed", 1));
    // The `bounds` view draws boxes over the image, and a lobe's color affects how often the lobe is sampled.
    for view in [
        ViewMode::Beauty,
        ViewMode::Diffuse,
        ViewMode::Specular,
        ViewMode::Bounds,
        ViewMode::Cost,
        ViewMode::Error,
    ] {
        assert_eq!(textures_of(bumpy, view), textures('d', "4 loaded", 10), "{view:?}");
    }
    let photons = &format!("{bumpy}[photons]\nenabled = true\ncount = 100\n");
    assert_eq!(textures_of(photons, ViewMode::Photons), textures('d', "4 loaded", 10));
    for view in [ViewMode::Emission, ViewMode::Albedo] {
        assert_eq!(textures_of(photons, view), textures_of(bumpy, view), "{view:?}");
    }
}

#[test]
fn view_does_not_look_up_unneeded_textures() {
    let ambient = |scene: &str| scene.replacen("samples = 4", &format!("samples = 4{AMBIENT}"), 1);
    for (view, scene) in [
        (ViewMode::Shadow, SCENE.to_owned()),
        (ViewMode::Emission, SCENE.to_owned()),
        (ViewMode::Emission, ambient(SCENE)),
        (ViewMode::Ambient, SCENE.to_owned()),
        (ViewMode::Photons, SCENE.to_owned()),
    ] {
        let mut bench = Bench::new(&scene);
        bench.overrides.view = Some(view);
        let counters = bench.done().0.counters;
        assert_eq!((counters.texels_loaded, counters.texture_lookups), (0, 0), "{view:?}");
    }
    let mut bench = Bench::new(&ambient(SCENE));
    bench.overrides.view = Some(ViewMode::Ambient);
    let counters = bench.done().0.counters;
    assert!(counters.texels_loaded == 1 && counters.texture_lookups > 0, "{counters:?}");
}

#[test]
fn unneeded_textures_do_not_change_a_view() {
    let bumpy_scene = format!("{SCENE}{BUMPY}").replacen("samples = 4", &format!("samples = 4{AMBIENT}"), 1);
    for view in [
        ViewMode::Normal,
        ViewMode::Depth,
        ViewMode::Uv,
        ViewMode::Shadow,
        ViewMode::Albedo,
        ViewMode::Ambient,
        ViewMode::Emission,
    ] {
        for scene in [SCENE, &bumpy_scene] {
            // A black texel reflects nothing, but the view must still show incoming light.
            let bench = |view| {
                let bench = bumpy(scene, view);
                bench.write("skin.ppm", "P6\n1 1\n255\n\0\0\0");
                bench
            };
            let mut without = bench(view);
            without.done();
            // Textures for the beauty view remain loaded so that lights and trees that depend on them can be
            // reused.
            let mut with = bench(ViewMode::Beauty);
            with.done();
            with.overrides.view = Some(view);
            let report = with.done().0;
            assert_eq!(statuses(&report).chars().nth(Stage::Textures as usize), Some('r'), "{view:?}");
            assert_eq!(with.picture(), without.picture(), "{view:?}");
        }
    }
}
