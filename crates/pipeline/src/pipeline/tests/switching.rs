//! A scene that is switched away and back, and one picture of several that is saved.

use super::*;

#[test]
fn a_scene_that_is_switched_back_to_finds_its_trees_and_pictures() {
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
        assert_eq!(report.stages[Stage::Accel as usize].why, "its trees were kept", "round {round}");
        assert_eq!(report.counters.texels_loaded, 0);
        assert_eq!(bench.picture(), before);
        bench.write("scene.toml", &other);
        assert_statuses(&bench.done().0, "drrrrsrd");
    }
}

#[test]
fn a_scene_that_broke_on_the_way_finds_its_trees_too() {
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
fn of_several_pictures_only_the_one_that_was_saved_is_read() {
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
        assert_eq!((report.counters.texels_loaded, &*report.stages[2].why), (texels, "1 loaded, 1 kept"));
    }
}
