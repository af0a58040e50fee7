//! Parts of a picture: joined, they are one render, bit for bit; what does not belong together is named, and nothing is written.

use std::fs;

use crate::desk::Desk;

/// A lamp, a mirror that throws its light, a textured floor: something for every method.
pub(crate) const ROOM: &str = r#"[render]
width = 70
height = 50
samples = 3

[camera]
position = [0, 1.2, 4]
look_at = [0, 0.7, 0]
aperture = 0.02

[textures.tiles]
file = "tiles.ppm"

[materials.floor]
diffuse = { texture = "tiles" }
[materials.lamp]
emission = [6, 5, 4]
[materials.steel]
type = "mirror"
reflectance = 0.9

[[plane]]
point = [0, 0, 0]
normal = [0, 1, 0]
material = "floor"
[[sphere]]
center = [0.4, 0.5, 0]
radius = 0.5
material = "steel"
[[quad]]
corner = [-0.6, 2.2, -0.4]
u = [1.2, 0, 0]
v = [0, 0, 1.2]
material = "lamp"
[[mesh]]
file = "step.obj"
material = "floor"
"#;

const STEP: &str = "v -1.5 0 0\nv -0.6 0 0\nv -1 0.9 -0.2\nf 1 2 3\n";
const TILES: &str = "P3\n2 2\n255\n200 200 200 40 40 60\n40 40 60 200 200 200\n";

/// A desk with that scene.
pub(crate) fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("room.toml", ROOM);
    desk.write("step.obj", STEP);
    desk.write("tiles.ppm", TILES);
    desk
}

#[test]
fn an_output_replaces_no_part_but_its_own_and_no_checkpoint() {
    let desk = desk();
    let first = "room.toml --once --progress none -o out.part --samples 2 --shard 1/2";
    desk.expect(first, 0);
    let part = desk.bytes("out.part");
    let said = desk.expect("room.toml --once --progress none --samples 2 -o out.part --shard 2/2", 2);
    assert!(said.contains("it is part 1/2 of a render") && said.contains("--force"), "{said}");
    assert!(desk.bytes("out.part") == part);
    // The same part again may, and one of another number.
    desk.expect("room.toml --once --progress none -o out.part --samples 2 --shard 1/3", 0);
    desk.expect(first, 0);
    // A picture replaces neither.
    fs::rename(desk.path("out.part"), desk.path("out.exr")).expect("moved");
    let said = desk.expect("room.toml --once --progress none -o out.exr --samples 2", 2);
    assert!(said.contains("it is part 1/2 of a render"), "{said}");
    let keep = "room.toml --once --progress none -o kept.exr --samples 2 --keep-checkpoint";
    desk.expect(keep, 0);
    fs::rename(desk.path("kept.exr.checkpoint"), desk.path("kept.exr")).expect("moved");
    let said = desk.expect(keep, 2);
    assert!(said.contains("kept.exr: it is a checkpoint"), "{said}");
    desk.expect(&format!("{keep} --force"), 0);
}

/// Methods, with a number of samples for each.
pub(crate) const METHODS: [(&str, &str); 5] = [
    ("whitted", "--samples 3"),
    ("path", "--integrator path --samples 5"),
    ("error", "--integrator path --samples 128 --error 0.15"),
    ("photons", "--photons on --samples 256 --width 33 --height 20 --set photons.count=100"),
    ("negative lobes", "--photons on --samples 37 --set photons.count=100 --set render.filter=mitchell"),
];

/// Renders all parts; returns their names, the last one first.
fn parts(desk: &Desk, count: u32, options: &str) -> Vec<String> {
    let name = |index: u32| format!("{index}.part");
    for index in 1..=count {
        let part = name(index);
        desk.expect(
            &format!("room.toml --once --progress none -o {part} --shard {index}/{count} {options}"),
            0,
        );
    }
    (1..=count).rev().map(name).collect()
}

#[test]
fn parts_in_any_order_are_one_render() {
    let desk = desk();
    for (method, options) in METHODS {
        desk.expect(&format!("room.toml --once --progress none -o one.exr -o one.png {options}"), 0);
        for count in [2, 3, 8, 64] {
            let mut names = parts(&desk, count, options);
            // Neither in their order nor in its reverse.
            names.rotate_left(count as usize / 3);
            names.swap(0, 1);
            for picture in ["exr", "png"] {
                desk.expect(&format!("merge joined.{picture} {} --progress none", names.join(" ")), 0);
                let (joined, one) =
                    (desk.bytes(&format!("joined.{picture}")), desk.bytes(&format!("one.{picture}")));
                assert!(joined == one, "{method}: {count} parts, {picture}");
            }
        }
    }
}

/// The room at 24 samples stops at different numbers of them: the test of `error` would be empty otherwise.
#[test]
fn the_noise_threshold_of_that_test_stops_some_tiles_early() {
    let desk = desk();
    let report = desk.report(&format!("room.toml {} -o a.png", METHODS[2].1));
    let samples = &report["image"]["samples"];
    assert!(samples["min"].as_u64() < samples["max"].as_u64(), "{samples}");
    let photons = desk.report(&format!("room.toml {} -o a.png --force", METHODS[3].1));
    assert!(photons["photons"]["emitted"].as_u64() > Some(0));
}

#[test]
fn views_and_crops_are_joined_too() {
    let desk = desk();
    for options in [
        "--view samples --samples 64 --error 0.2",
        "--view error --samples 8",
        "--view depth",
        "--crop 7,3,50,41 --samples 32 --error 0.2 --bit-depth 16 --set render.exposure=1",
    ] {
        desk.expect(&format!("room.toml --once --progress none -o one.png {options}"), 0);
        let names = parts(&desk, 3, options);
        desk.expect(&format!("merge joined.png {} --progress none", names.join(" ")), 0);
        assert!(desk.bytes("joined.png") == desk.bytes("one.png"), "{options}");
    }
}

#[test]
fn what_does_not_belong_together_is_named_and_nothing_is_written() {
    let desk = desk();
    let names = parts(&desk, 3, "");
    desk.write("joined.png", "the picture before");
    let refused = |line: &str, words: &str| {
        let said = desk.expect(&format!("merge joined.png {line} --progress none"), 2);
        assert!(said.contains(words), "{line}: {said}");
        assert_eq!(desk.bytes("joined.png"), b"the picture before", "{line}");
        said
    };
    refused("1.part 3.part", "1 of 3 parts are missing: 2/3");
    refused("1.part 2.part 2.part 3.part", "both are part 2/3");
    refused("1.part 2.part none.part", "none.part: ");
    refused("1.part 2.part room.toml", "room.toml: this is neither a part");
    let other = |options: &str, words: &str| {
        desk.expect(&format!("room.toml --once --progress none -o other.part {options}"), 0);
        refused("1.part other.part 3.part", words);
    };
    other("--shard 2/3 --seed 7", "seed is 7 here and 0 there");
    other("--shard 2/3 --samples 4", "samples is 4 here and 3 there");
    other("--shard 2/3 --integrator path", "integrator is path here and whitted there");
    other("--shard 2/3 --set render.exposure=1", "exposure is 1 here and 0 there");
    other("--shard 2/3 --set sphere.1.radius=0.4", "shapes, materials, lights or camera");
    other("--shard 2/4", "it is one of 4 parts here and of 3 there");
    desk.write("step.obj", STEP.replace("0.9", "0.8"));
    other("--shard 2/3", "step.obj has another content");
    desk.write("step.obj", STEP);
    desk.write("tiles.ppm", TILES.replace("200", "201"));
    other("--shard 2/3", "tiles.ppm has another content");
    desk.write("tiles.ppm", TILES);
    // The same files in another folder are the same picture.
    fs::create_dir(desk.path("away")).expect("a folder");
    for (name, text) in [("room.toml", ROOM), ("step.obj", STEP), ("tiles.ppm", TILES)] {
        desk.write(&format!("away/{name}"), text);
    }
    desk.expect("away/room.toml --once --progress none -o other.part --shard 2/3", 0);
    desk.expect("merge away.png 1.part other.part 3.part --progress none", 0);
    // Some that are damaged, each named.
    let whole = desk.bytes("2.part");
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    desk.write("flipped.part", flipped);
    desk.write("cut.part", &whole[..whole.len() - 100]);
    let said = refused("1.part flipped.part cut.part", "flipped.part: it is damaged");
    assert!(said.contains("cut.part: it is damaged"), "{said}");
    let mut newer = whole;
    newer[12] = 2;
    desk.write("newer.part", newer);
    refused("1.part newer.part 3.part", "version 2 of the format");
    // A part never becomes a picture, whatever its name.
    let said = desk.expect("merge 1.part 2.part 3.part --progress none", 2);
    assert!(said.contains("1.part"), "{said}");
    fs::copy(desk.path("1.part"), desk.path("1.png")).expect("copied");
    let said = desk.expect("merge 1.png 2.part 3.part --progress none", 2);
    assert!(said.contains("cannot write 1.png: it is a part"), "{said}");
    desk.expect("compare 1.png away.png", 2);
    assert_eq!(names.len(), 3);
}

#[test]
fn what_is_there_is_joined_if_that_is_asked_for() {
    let desk = desk();
    desk.expect("room.toml --once --progress none -o one.exr", 0);
    parts(&desk, 4, "");
    let said = desk.expect("merge some.exr 4.part 1.part none.part --partial", 0);
    assert!(said.contains("warning: 2 of 4 parts are missing: 2/4, 3/4"), "{said}");
    let said = desk.expect("merge all.exr 4.part 3.part 2.part 1.part --partial", 0);
    assert!(!said.contains("missing"), "{said}");
    assert!(
        desk.bytes("all.exr") == desk.bytes("one.exr") && desk.bytes("some.exr") != desk.bytes("one.exr")
    );
    // Photons: fewer blocks, the same pixels.
    parts(&desk, 2, "--photons on --samples 32 --set photons.count=100");
    desk.expect("merge half.exr 1.part --partial --progress none", 0);
    desk.expect("merge half.exr 1.part --progress none", 2);
}

#[test]
fn a_merge_waits_for_parts_and_shows_what_does_not_fit_at_once() {
    let desk = desk();
    desk.expect("room.toml --once --progress none -o one.exr", 0);
    parts(&desk, 2, "");
    fs::rename(desk.path("2.part"), desk.path("later")).expect("renamed");
    let mut waiting = desk.glimt("merge joined.exr 1.part 2.part --watch --progress none");
    let mut waiting = waiting.spawn().expect("it runs");
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(waiting.try_wait().expect("a child").is_none(), "a part is missing");
    fs::rename(desk.path("later"), desk.path("2.part")).expect("renamed");
    assert!(waiting.wait().expect("a child").success());
    assert!(desk.bytes("joined.exr") == desk.bytes("one.exr"));
    desk.expect("room.toml --once --progress none -o other.part --shard 2/2 --seed 3", 0);
    let said = desk.expect("merge joined.exr 1.part other.part none.part --watch --progress plain", 2);
    assert!(said.contains("seed is 3 here and 0 there"), "{said}");
}

#[test]
fn what_cannot_be_divided_is_refused_before_the_work() {
    let desk = desk();
    for (line, words) in [
        ("--once --shard 1/2", "-o must name its file"),
        ("--once --shard 1/2 -o a.part -o b.part", "-o must name its file"),
        ("--once --shard 1/2 -o a.part --time 3", "--shard and --time exclude each other"),
        ("--once --shard 1/2 -o a.part --photons on --error 0.1", "photons with a noise threshold"),
        ("--once --shard 1/2 -o a.part --photons on --view error", "the view `error` of photons"),
        ("--shard 1/2 -o a.part", "--shard needs --once"),
        ("--once --shard 3/2 -o a.part", "expected I/N"),
    ] {
        let said = desk.expect(&format!("room.toml {line}"), 2);
        assert!(said.contains(words), "{line}: {said}");
        assert!(!desk.path("a.part").exists());
    }
}

#[test]
fn scripts_of_schedulers_are_sound() {
    let desk = desk();
    for engine in ["slurm", "parallel", "kubernetes"] {
        let line = format!("farm room.toml -o out.exr --shards 4 --engine {engine} --host a -- --samples 9");
        let output = desk.run(&line);
        assert_eq!(output.status.code(), Some(0), "{engine}");
        let script = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(script.contains("--samples 9") && script.contains("merge"), "{script}");
        desk.write("script", &script);
        if engine != "kubernetes" {
            let mut shell = std::process::Command::new("sh");
            let is_sound = shell.current_dir(desk.0.path()).args(["-n", "script"]).status().expect("a shell");
            assert!(is_sound.success(), "{script}");
        }
    }
    let said = desk.expect("farm room.toml -o out.xyz --shards 4 --engine slurm", 2);
    assert!(said.contains(".xyz is not a format"), "{said}");
    let said = desk.expect("farm none.toml -o out.exr --shards 4 --engine slurm", 2);
    assert!(said.contains("none.toml: no such file"), "{said}");
}

#[test]
fn a_render_that_needs_more_memory_than_allowed_is_refused_with_the_numbers() {
    let desk = desk();
    let said = desk.expect("room.toml --once -o a.png --width 9000 --height 9000 --memory 500MB", 1);
    assert!(said.contains("the render needs about 4.1") && said.contains("477 MiB of --memory"), "{said}");
    assert!(!said.contains("render   "), "nothing is rendered: {said}");
    desk.expect("room.toml --once -o a.png --memory 500MB", 0);
    let photons = "--photons on --set photons.count=4000000";
    let said = desk.expect(&format!("room.toml --once -o a.png {photons} --memory 500MB"), 1);
    assert!(said.contains("photons ") && said.contains("smaller `count`"), "{said}");
}
