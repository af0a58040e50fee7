//! `--turntable`: frames from cameras all around a scene or model.

use std::io::Cursor;
use std::process::Stdio;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::test_dir::{TestDir, assert_mentions, mentions};

const SMALL: &str = "--once --width 32 --height 24 --samples 2 --error 0";

/// Four balls with different colors around a point, one on each side.
fn four_balls() -> TestDir {
    let dir = TestDir::new();
    let ball = |name: &str, color: &str, center: &str| {
        format!(
            "[materials.{name}]\ntype = \"phong\"\ndiffuse = 0\nemission = {color}\n\
             [[sphere]]\ncenter = {center}\nradius = 0.8\nmaterial = \"{name}\"\n"
        )
    };
    let balls = [
        ("front", "[1, 0, 0]", "[0, 0, 2]"),
        ("right", "[0, 1, 0]", "[2, 0, 0]"),
        ("back", "[0, 0, 1]", "[0, 0, -2]"),
        ("left", "[1, 1, 0]", "[-2, 0, 0]"),
    ];
    let camera = "[camera]\nposition = [0, 0, 6]\nlook_at = [0, 0, 0]\nfov = 20\n";
    let balls: String = balls.iter().map(|(name, color, center)| ball(name, color, center)).collect();
    dir.write("around.toml", format!("{camera}{balls}"));
    dir
}

/// Center pixel of a 32 × 24 image.
fn middle(rgb: &[u8]) -> [u8; 3] {
    let at = 3 * (12 * 32 + 16);
    [rgb[at], rgb[at + 1], rgb[at + 2]]
}

fn picture(dir: &TestDir, name: &str) -> Vec<u8> {
    image::open(dir.path(name)).expect("a picture").to_rgb8().into_raw()
}

/// Frames of an APNG.
fn frames(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().expect("PNG");
    let count = reader.info().animation_control().expect("an animation").num_frames;
    let mut frame = || {
        let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
        reader.next_frame(&mut pixels).expect("a frame");
        pixels
    };
    (0..count).map(|_| frame()).collect()
}

#[test]
fn turntable_writes_files_and_animations() {
    let dir = four_balls();
    let stderr =
        dir.expect(&format!("around.toml {SMALL} --turntable 4 -o a_####.png -o a.apng -o a.gif"), 0);
    let names = ["a_0001.png", "a_0002.png", "a_0003.png", "a_0004.png"];
    let colors = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]];
    let moving = frames(&dir.bytes("a.apng"));
    assert_eq!(moving.len(), 4);
    for ((name, color), frame) in names.iter().zip(colors).zip(moving) {
        let still = picture(&dir, name);
        assert_eq!(middle(&still), color, "{name}");
        assert_eq!(still, frame, "{name}");
    }
    assert!(dir.bytes("a.gif").starts_with(b"GIF89a"));
    assert_eq!(stderr.matches("wrote a_0003.png").count(), 1, "{stderr}");
    assert_mentions(&stderr, &["a.gif", "32×24", "4 frames"]);
    // The first frame equals the image rendered without `--turntable`.
    dir.expect(&format!("around.toml {SMALL} -o single.png"), 0);
    assert_eq!(picture(&dir, "single.png"), picture(&dir, "a_0001.png"));
}

#[test]
fn turntable_reuses_trees_and_photons() {
    let dir = TestDir::new();
    dir.write("knot.obj", std::fs::read("assets/knot.obj").expect("a mesh"));
    dir.write(
        "pool.toml",
        "[camera]\nposition = [0, 2, 6]\nlook_at = [0, 0, 0]\n[photons]\nenabled = true\n[materials.m]\n\
         [materials.g]\ntype = \"glass\"\n[[mesh]]\nfile = \"knot.obj\"\nmaterial = \"m\"\n[[sphere]]\n\
         center = [0, 3, 0]\nradius = 0.5\nmaterial = \"g\"\n[[light]]\nposition = [0, 6, 0]\nintensity = 9\n",
    );
    dir.expect(&format!("pool.toml {SMALL} --turntable 3 -o a#.ppm --report r#.json"), 0);
    for number in 2..=3 {
        let text = std::fs::read_to_string(dir.path(&format!("r{number}.json"))).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(report["image"]["path"], format!("a{number}.ppm"));
        let stages = report["stages"].as_array().expect("stages");
        let status = |name: &str| {
            let stage = stages.iter().find(|stage| stage["name"] == name).expect("a stage");
            stage["status"].as_str().expect("text").to_owned()
        };
        for name in ["parse", "meshes", "accel", "lights", "photons"] {
            assert_eq!(status(name), "reused", "{name} of {number}");
        }
        assert_eq!(status("render"), "done");
    }
}

#[test]
fn model_stays_in_the_frame() {
    let dir = TestDir::new();
    // A long plank, seen end-on in the first frame.
    dir.write("plank.obj", "v -1 0 -8\nv 1 0 -8\nv 1 2 8\nv -1 2 8\nv 0 3 0\nf 1 2 3 4\nf 1 2 5\nf 3 4 5\n");
    dir.expect(&format!("plank.obj {SMALL} --turntable 4 --from front --view albedo -o b.apng"), 0);
    for frame in frames(&dir.bytes("b.apng")) {
        let row = |y: usize| frame[3 * 32 * y..3 * 32 * (y + 1)].to_vec();
        let pixel = |y: usize, x: usize| row(y)[3 * x..3 * x + 3].to_vec();
        // Both ends of every row show the ground.
        assert!((4..20).all(|y| pixel(y, 0) == pixel(y, 31)), "the model is cropped");
    }
}

#[test]
fn impossible_turntables_are_rejected() {
    let dir = TestDir::new();
    let rejected =
        |line: &str, facts: &[&str]| assert_mentions(&dir.expect(&format!("ball.toml {line}"), 2), facts);
    rejected("--turntable 4 -o a.gif", &["--turntable", "--once"]);
    rejected("--once --turntable 4 -o a.png", &["a_####.png", ".gif", ".apng"]);
    rejected("--once -o a.gif", &["a.gif", "--turntable N"]);
    rejected("--once --turntable 0 -o a.gif", &["--turntable", "1", "10000"]);
    rejected("--once --turntable 4 -o a.gif --shard 1/2", &["--turntable", "--shard"]);
    rejected("--once --turntable 4 -o a.gif --resume", &["--resume"]);
    rejected("--once --turntable 4 -o a.gif --report r.json", &["--report r_####.json"]);
    rejected("--once --turntable 4 -o a.gif --bit-depth 16", &["8 bits"]);
    rejected("--once --turntable 4 -o a_#.gif -o a_#.xyz", &[".xyz", ".png"]);
    rejected("--once --turntable 4 -o a_#.png -o a_#.png", &["a_#.png", "twice"]);
    rejected("--once --turntable 11 -o a_#.png -o a_1#.png", &["a_11.png"]);
    // A later frame would replace an input, so nothing is rendered.
    dir.write("a3.png", std::fs::read("assets/textures/checker.png").expect("an image"));
    let scene = format!("{}[textures.t]\nfile = \"a3.png\"\n", super::test_dir::SCENE);
    dir.write("uses.toml", scene);
    let stderr = dir.expect("uses.toml --once --turntable 4 -o a#.png", 2);
    assert_mentions(&stderr, &["a3.png"]);
    assert!(!dir.path("a1.png").exists());
    let stderr = dir.expect("ball.toml --once --turntable 10000 -o a.gif --width 1000 --height 1000", 1);
    assert_mentions(&stderr, &["27.94 GiB"]);
    let stderr =
        dir.expect("ball.toml --once --turntable 10000 -o a.gif --width 64 --height 64 --memory 30MiB", 1);
    assert_mentions(&stderr, &["error", "frames", "30 MiB", "--memory"]);
}

#[test]
fn frames_linked_to_one_file_are_rejected() {
    let dir = four_balls();
    std::os::unix::fs::symlink("a_3.png", dir.path("a_1.png")).expect("a link");
    dir.write("a_3.png", std::fs::read("assets/textures/checker.png").expect("an image"));
    let stderr = dir.expect(&format!("around.toml {SMALL} --turntable 4 -o a_#.png"), 2);
    assert_mentions(&stderr, &["a_1.png", "a_3.png"]);
    assert!(!dir.path("a_2.png").exists());
}

/// Default file names are derived from the scene's name. They replace only files written by glimt.
#[test]
fn default_frames_keep_unrelated_images() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --turntable 2", 0);
    dir.expect("ball.toml --once --turntable 2 --seed 4", 0);
    assert!(dir.path("ball_0002.png").exists() && !dir.path("ball.png").exists());
    let foreign = std::fs::read("assets/textures/checker.png").expect("an image");
    dir.write("ball_0002.png", &foreign);
    let stderr = dir.expect("ball.toml --once --turntable 2 --seed 5", 2);
    assert_mentions(&stderr, &["ball_0002.png"]);
    assert_eq!(dir.bytes("ball_0002.png"), foreign);
    // `output` in the scene applies only to single images.
    dir.write("named.toml", super::test_dir::SCENE.replace("samples = 2", "samples = 2\noutput = \"x.png\""));
    dir.expect("named.toml --once --turntable 2", 0);
    assert!(dir.path("x_0001.png").exists() && !dir.path("x.png").exists());
}

#[test]
fn interrupted_turntable_leaves_whole_files() {
    let dir = four_balls();
    let line = "around.toml --once --width 64 --height 48 --samples 1000 --error 0 --turntable 5000 -o a_#.png -o a.gif";
    let mut process = dir.glimt(line).stderr(Stdio::piped()).spawn().expect("it runs");
    dir.await_file("a_2.png", &mut process);
    kill(Pid::from_raw(process.id() as i32), Signal::SIGTERM).expect("it runs");
    assert_eq!(process.wait().expect("it ends").code(), Some(143));
    let names: Vec<String> = std::fs::read_dir(dir.path("."))
        .expect("a folder")
        .map(|entry| entry.expect("a file").file_name().into_string().expect("UTF-8"))
        .collect();
    let pictures: Vec<&String> = names.iter().filter(|name| name.ends_with(".png")).collect();
    assert_eq!(pictures.len() + 2, names.len(), "unexpected files: {names:?}");
    pictures.iter().for_each(|name| assert_eq!(picture(&dir, name).len(), 64 * 48 * 3));
}

#[test]
fn changed_scene_ends_the_turntable() {
    let dir = four_balls();
    let line =
        "around.toml --once --width 64 --height 48 --samples 200 --error 0 --turntable 5000 -o a_#.png";
    let mut process = dir.glimt(line).stderr(Stdio::piped()).spawn().expect("it runs");
    dir.await_file("a_1.png", &mut process);
    let text = std::fs::read_to_string(dir.path("around.toml")).expect("a scene");
    dir.write("around.toml", text.replace("radius = 0.8", "radius = 0.7"));
    let output = process.wait_with_output().expect("it ends");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.starts_with("error: ") || stderr.contains("\nerror: "), "{stderr}");
    assert_mentions(&stderr, &["turntable"]);
}

#[test]
fn frames_of_a_longer_turntable_are_kept() {
    let dir = four_balls();
    assert!(!mentions(&dir.expect(&format!("around.toml {SMALL} --turntable 4 -o w_##.png"), 0), "more"));
    let third = dir.bytes("w_03.png");
    let said = dir.expect(&format!("around.toml {SMALL} --turntable 2 -o w_##.png"), 0);
    assert_mentions(&said, &["w_03.png", "1 more"]);
    assert_eq!(dir.bytes("w_03.png"), third);
}

/// The hint must not suggest `output` in `[render]`, which does not apply to turntables or models.
#[test]
fn unrelated_image_hint_is_a_valid_option() {
    let dir = TestDir::new();
    dir.write("plank.obj", "v -1 0 -8\nv 1 0 -8\nv 1 2 8\nf 1 2 3\n");
    let foreign = std::fs::read("assets/textures/checker.png").expect("an image");
    for name in ["plank.png", "plank_0001.png", "ball_0002.png", "ball.png"] {
        dir.write(name, &foreign);
    }
    let said = |line: &str| dir.expect(line, 2);
    for (file, name) in [("plank.obj", "plank_####.png"), ("ball.toml", "ball_####.png")] {
        let said = said(&format!("{file} {SMALL} --turntable 3"));
        assert_mentions(&said, &[&format!("-o '{name}'"), "--force", "-o 'NAME_####.png'"]);
        assert!(!said.contains("[render]"), "{said}");
    }
    let single = said(&format!("plank.obj {SMALL}"));
    assert_mentions(&single, &["-o FILE", "-o plank.png"]);
    assert!(!single.contains("[render]"), "{single}");
    assert!(said(&format!("ball.toml {SMALL}")).contains("in [render]"));
    dir.expect(&format!("plank.obj {SMALL} --turntable 3 -o plank_####.png"), 0);
}
