//! `glimt bench` on small scenes.

use std::fs;
use std::os::unix::fs::symlink;

use glimt::scene::SCENE_NOT_FOUND;
use nix::errno::Errno;
use serde_json::Value;

use super::test_dir::{TestDir, assert_mentions, mentions, system_error};

/// A ball on a floor under an area light. The image is small, and some of the light is indirect.
const SCENE: &str = r#"[render]
width = 24
height = 16
ambient = [0.5, 0.5, 0.5]
[camera]
position = [0, 1, 4]
look_at = [0, 0.7, 0]
[materials]
wall = { diffuse = [0.6, 0.6, 0.5] }
lamp = { emission = [8, 8, 8] }
[[sphere]]
center = [0, 0.5, 0]
radius = 0.5
material = "wall"
[[quad]]
material = "wall"
[[quad]]
corner = [-0.5, 2, -0.5]
u = [1, 0, 0]
v = [0, 0, 1]
material = "lamp"
"#;

/// Options for a measurement that is fast enough for a test.
const SMALL: &str = "--samples 1,4 --reference-samples 64 --seeds 3 --progress none";

fn box_dir() -> TestDir {
    let dir = TestDir::new();
    dir.write("box.toml", SCENE);
    dir
}

/// Runs `glimt bench` with a separate cache. Returns stdout and stderr.
#[track_caller]
fn bench(dir: &TestDir, line: &str, code: i32) -> (String, String) {
    let mut process = dir.glimt(&format!("bench {line}"));
    let output = process.env("XDG_CACHE_HOME", dir.path("cache")).output().expect("it runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    let (stdout, stderr) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(code), "{line}\n{stdout}\n{stderr}");
    (stdout, stderr)
}

fn json(dir: &TestDir, name: &str) -> Value {
    serde_json::from_slice(&dir.bytes(name)).expect("JSON")
}

/// The relMSE of every image.
fn errors(results: &Value) -> Vec<f64> {
    let methods = results["scenes"][0]["methods"].as_array().expect("methods");
    let steps = methods.iter().flat_map(|method| method["steps"].as_array().expect("steps"));
    let pictures = steps.flat_map(|step| step["pictures"].as_array().expect("pictures"));
    pictures.map(|picture| picture["relmse"].as_f64().expect("a number")).collect()
}

#[test]
fn bench_measures_a_scene_end_to_end() {
    let dir = box_dir();
    let (stdout, stderr) =
        bench(&dir, &format!("box.toml {SMALL} --csv a.csv --json a.json --plot a.svg"), 0);
    assert_eq!(stderr, "");
    assert_mentions(&stdout, &["box.toml", "24×16", "3 seeds", "2 × 64 samples", "16 ×"]);
    for method in ["path ", "whitted photons ", "whitted "] {
        assert!(
            stdout.lines().filter(|line| line.starts_with(method) && !line.contains(':')).count() >= 2,
            "{stdout}"
        );
    }
    assert!(
        stdout.contains("whitted: setup") && stdout.contains("\n  BIAS: "),
        "ambient light replaces indirect light: {stdout}"
    );
    assert!(stdout.lines().all(|line| line.chars().count() <= 80 || line.contains("set-up")), "{stdout}");
    let results = json(&dir, "a.json");
    assert_eq!(errors(&results).len(), 3 * 2 * 3);
    assert!(errors(&results)[..3].iter().all(|error| *error > 0.0));
    let text = String::from_utf8(dir.bytes("a.csv")).expect("UTF-8");
    assert_eq!(text.split_terminator("\r\n").count(), 1 + 18);
    let svg = String::from_utf8(dir.bytes("a.svg")).expect("UTF-8");
    let plot = roxmltree::Document::parse(&svg).expect("XML");
    let said: Vec<_> = plot.descendants().filter_map(|node| node.text()).collect();
    assert!(said.iter().any(|text| text.trim_start().starts_with("whitted photons")), "{said:?}");
    let seeds: Vec<u64> = (1..=3).chain(4..=6).collect();
    let steps = results["scenes"][0]["methods"][0]["steps"].as_array().expect("steps");
    let used = steps.iter().flat_map(|step| step["pictures"].as_array().expect("pictures"));
    assert_eq!(used.map(|picture| picture["seed"].as_u64().expect("a seed")).collect::<Vec<_>>(), seeds);
}

#[test]
fn errors_are_reproducible_and_references_cached() {
    let dir = box_dir();
    let line = format!("box.toml {SMALL} --integrator path --json");
    bench(&dir, &format!("{line} a.json"), 0);
    bench(&dir, &format!("{line} b.json --threads 1"), 0);
    let (a, b) = (json(&dir, "a.json"), json(&dir, "b.json"));
    assert_eq!(errors(&a), errors(&b));
    let is_cached =
        |results: &Value| results["scenes"][0]["reference"]["is_cached"].as_bool().expect("a flag");
    assert!(!is_cached(&a) && is_cached(&b));
    let kept = || {
        fs::read_dir(dir.path("cache/glimt/references"))
            .expect("a folder")
            .map(|entry| entry.expect("a file").path())
    };
    for file in kept() {
        fs::write(&file, "broken").expect("written");
    }
    bench(&dir, &format!("{line} c.json"), 0);
    assert!(!is_cached(&json(&dir, "c.json")), "expected a damaged cache file to be replaced");
    assert_eq!(errors(&json(&dir, "c.json")), errors(&a));
    dir.write("box.toml", SCENE.replace("0.6, 0.6, 0.5", "0.6, 0.6, 0.4"));
    bench(&dir, &format!("{line} d.json"), 0);
    assert!(!is_cached(&json(&dir, "d.json")), "a changed scene needs a new reference");
    assert_eq!(kept().count(), 2);
    bench(&dir, &format!("{line} e.json --no-cache"), 0);
    assert!(
        !is_cached(&json(&dir, "e.json")) && errors(&json(&dir, "e.json")) == errors(&json(&dir, "d.json"))
    );
}

#[test]
fn baseline_option_compares_with_a_previous_run() {
    let dir = box_dir();
    let line = format!("box.toml {SMALL} --integrator path");
    bench(&dir, &format!("{line} --json old.json"), 0);
    let (stdout, _) = bench(&dir, &format!("{line} --baseline old.json"), 0);
    assert_mentions(&stdout, &["old.json", "95 %", "box.toml, path", "× 1.000", "(1.000 to 1.000)"]);
    let (stdout, _) = bench(&dir, &format!("{line} --clamp 0.01 --baseline old.json"), 0);
    assert!(
        mentions(&stdout, "old.json") && !mentions(&stdout, "error ×"),
        "expected no error ratio for a different method: {stdout}"
    );
    let (stdout, _) = bench(
        &dir,
        &format!("{line} --set render.max_depth=1 --set render.shadow_samples=64 --baseline old.json"),
        0,
    );
    assert!(stdout.contains(": error × 0."), "expected a lower error with less light: {stdout}");
    dir.write("odd.json", "{}");
    let (_, stderr) = bench(&dir, &format!("{line} --baseline odd.json"), 2);
    assert_mentions(&stderr, &["error: odd.json", "bench --json FILE"]);
    let (_, stderr) = bench(&dir, &format!("{line} --baseline none.json"), 2);
    assert_mentions(&stderr, &["none.json", &system_error(Errno::ENOENT)]);
}

#[test]
fn baseline_must_be_a_regular_file() {
    let dir = box_dir();
    let pipe = dir.path("pipe.json");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
    for name in ["pipe.json", "/dev/zero"] {
        let (_, stderr) = bench(&dir, &format!("box.toml {SMALL} --baseline {name}"), 2);
        assert_eq!(
            stderr,
            format!("error: cannot read {name}: it is a pipe, a socket or a device, not a regular file\n")
        );
    }
}

#[test]
fn all_scenes_are_checked_before_measuring() {
    let dir = box_dir();
    dir.write("broken.toml", SCENE.replace("radius = 0.5", "radius = -1"));
    let line = format!("box.toml none.toml broken.toml {SMALL} --csv a.csv");
    let (stdout, stderr) = bench(&dir, &line, 2);
    assert_eq!(stdout, "");
    assert!(
        stderr.contains("none.toml") && stderr.contains("broken.toml:13"),
        "expected two error messages: {stderr}"
    );
    assert!(!dir.path("a.csv").exists());
    assert!(!dir.path("cache/glimt/references").exists(), "expected no measurement");
    // This output would overwrite an input of the second scene.
    dir.write("skin.ppm", "P6\n1 1\n255\nabc");
    let skin = "diffuse = { texture = \"skin\" }\n[textures.skin]\nfile = \"skin.ppm\"\n[materials.other]\ndiffuse = 0";
    dir.write(
        "skin.toml",
        SCENE
            .replace("wall = { diffuse = [0.6, 0.6, 0.5] }", &format!("[materials.wall]\n{skin}"))
            .replace("lamp = { emission = [8, 8, 8] }", "[materials.lamp]\nemission = 8"),
    );
    std::os::unix::fs::symlink("skin.ppm", dir.path("a.svg")).expect("a link");
    let (stdout, stderr) = bench(&dir, &format!("box.toml skin.toml {SMALL} --plot a.svg --force"), 2);
    assert_eq!(stdout, "");
    assert_mentions(&stderr, &["a.svg", "skin.toml"]);
    assert_eq!(dir.bytes("skin.ppm"), b"P6\n1 1\n255\nabc");
}

#[test]
fn references_set_the_size_and_a_single_one_warns() {
    let dir = box_dir();
    for seed in [8, 9] {
        let line =
            format!("box.toml --once --integrator path --samples 64 --seed {seed} --width 12 --height 8");
        dir.expect(&format!("{line} --progress none -o r{seed}.exr"), 0);
    }
    let line = "box.toml --samples 1,4 --seeds 3 --integrator path --progress none --reference r8.exr";
    let (two, _) = bench(&dir, &format!("{line} --reference r9.exr"), 0);
    assert_mentions(&two, &["box.toml", "12×8", "3 seeds", "r8.exr", "r9.exr"]);
    let (one, _) = bench(&dir, line, 0);
    let reference = |text: &str| text.lines().nth(1).expect("a second line").to_owned();
    assert!(mentions(&reference(&one), "r8.exr") && reference(&one) != reference(&two), "{one}");
    let (_, stderr) = bench(&dir, &format!("{line} --csv r8.exr"), 2);
    assert_eq!(
        stderr,
        "error: cannot write r8.exr: it is one of the references; choose another file with --csv FILE\n"
    );
    let (_, stderr) = bench(&dir, "box.toml --reference none.exr", 2);
    assert_mentions(&stderr, &["none.exr", &system_error(Errno::ENOENT)]);
    let (_, stderr) = bench(&dir, "box.toml ball.toml --reference r8.exr", 2);
    assert_mentions(&stderr, &["--reference"]);
}

#[test]
fn outputs_never_replace_inputs_or_each_other() {
    let dir = box_dir();
    dir.write("skin.ppm", "P6\n1 1\n255\nabc");
    let textured = SCENE.replace("diffuse = [0.6, 0.6, 0.5]", "diffuse = { texture = \"skin\" }");
    dir.write("skin.toml", format!("{textured}\n[textures.skin]\nfile = \"skin.ppm\"\n"));
    symlink("box.toml", dir.path("link.csv")).expect("a link");
    symlink("skin.ppm", dir.path("skin.csv")).expect("a link");
    for (line, facts) in [
        ("box.toml --csv box.toml", &["box.toml", "scenes", "--csv FILE"][..]),
        ("box.toml --csv link.csv", &["link.csv", "scenes", "--csv FILE"]),
        ("box.toml --csv a.json --json ./a.json", &["./a.json", "--csv", "--json FILE"]),
        ("box.toml --plot a.png", &["a.png", "SVG", ".svg"]),
        ("skin.toml --force --csv skin.csv", &["skin.csv", "skin.toml"]),
    ] {
        let (_, stderr) = bench(&dir, &format!("{line} {SMALL}"), 2);
        assert_mentions(&stderr, facts);
    }
    assert_eq!(dir.bytes("skin.ppm"), b"P6\n1 1\n255\nabc");
    // Without a file name, the option consumes the next argument.
    for (line, facts) in [
        ("--csv ball.toml", ["ball.toml", "table", "--csv FILE"]),
        ("--json ball.toml box.toml", ["ball.toml", "results", "--json FILE"]),
    ] {
        let (_, stderr) = bench(&dir, &format!("{line} {SMALL}"), 2);
        assert_mentions(&stderr, &facts);
    }
    assert_eq!(dir.bytes("ball.toml"), super::test_dir::SCENE.as_bytes());
    let (_, stderr) = bench(&dir, "box.toml --csv none/a.csv", 1);
    assert!(mentions(&stderr, "none") && !dir.path("none").exists(), "{stderr}");
}

#[test]
fn failed_output_does_not_affect_other_outputs() {
    let dir = box_dir();
    symlink("/dev/full", dir.path("full.csv")).expect("a link");
    let line =
        "box.toml --samples 1 --reference-samples 8 --seeds 1 --integrator path --no-cache --progress none";
    let (_, stderr) = bench(&dir, &format!("{line} --csv full.csv --json a.json --plot a.svg"), 1);
    assert_mentions(&stderr, &["full.csv", &system_error(Errno::ENOSPC)]);
    assert!(stderr.lines().count() == 1 && errors(&json(&dir, "a.json")).len() == 1, "{stderr}");
    assert!(dir.path("a.svg").is_file());
    // Results overwrite previous results, regardless of file names.
    for _ in 0..2 {
        bench(&dir, &format!("{line} --json results --csv table"), 0);
    }
}

#[test]
fn bench_ignores_the_scene_output() {
    let dir = box_dir();
    let textured = SCENE.replace("diffuse = [0.6, 0.6, 0.5]", "diffuse = { texture = \"skin\" }");
    // A render would overwrite the scene's texture with its image, by default and with `output`.
    for (name, output) in [("skin.toml", ""), ("other.toml", "output = \"skin.png\"\n")] {
        let scene = textured.replace("[render]\n", &format!("[render]\n{output}"));
        dir.write(name, format!("{scene}\n[textures.skin]\nfile = \"skin.png\"\n"));
        image::RgbImage::new(2, 2).save(dir.path("skin.png")).expect("saved");
        let line = "--samples 1 --reference-samples 8 --seeds 1 --integrator path --no-cache --progress none";
        let (_, stderr) = bench(&dir, &format!("{name} {line}"), 0);
        assert_eq!(stderr, "", "{name}");
    }
}

#[test]
fn bench_reports_invalid_usage() {
    let dir = box_dir();
    dir.write("wrong.toml", SCENE.replace("radius = 0.5", "radius = -1"));
    let (_, stderr) = bench(&dir, "wrong.toml", 2);
    assert!(stderr.contains("wrong.toml:13:"), "{stderr}");
    for (line, facts) in [
        ("none.toml", &["none.toml", SCENE_NOT_FOUND][..]),
        ("box.toml box.toml", &["box.toml", "twice"]),
        ("box.toml --samples 0", &["--samples", "1", "4294967295"]),
        ("box.toml --samples 1 --time 1", &["--samples", "--time"]),
        ("box.toml --seeds 0", &["--seeds", "1", "1000"]),
        ("box.toml --within 0", &["--within", "seconds", "0"]),
        ("box.toml --integrator paths", &["paths"]),
        ("box.toml --seed 4294967290", &["--seed 4294967290"]),
    ] {
        let (_, stderr) = bench(&dir, line, 2);
        assert_mentions(&stderr, facts);
    }
}

#[test]
fn progress_is_plain_lines_or_json_objects() {
    let dir = box_dir();
    let line = "box.toml --samples 1 --reference-samples 8 --seeds 1 --integrator path --no-cache";
    let (stdout, plain) = bench(&dir, line, 0);
    assert_mentions(&plain, &["box.toml", "24×16", "path, 1 sample"]);
    assert!(mentions(&stdout, "seeds") && !stdout.contains("BIAS"), "{stdout}");
    let (_, objects) = bench(&dir, &format!("{line} --progress json --csv a.csv"), 0);
    let objects: Vec<Value> = objects.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let events: Vec<_> = objects.iter().map(|object| object["event"].as_str().expect("a name")).collect();
    assert!(events.contains(&"progress") && events.contains(&"step"), "{events:?}");
    assert_eq!(events[events.len() - 2..], ["written", "done"]);
    let (_, failed) = bench(&dir, "none.toml --progress json", 2);
    let failed: Value = serde_json::from_str(failed.lines().last().expect("a line")).expect("JSON");
    assert_eq!((&failed["event"], &failed["kind"]), (&"failed".into(), &"scene".into()));
}

#[test]
fn time_budgets_are_sorted_and_used_up() {
    let dir = box_dir();
    let line = "box.toml --time 0.02,0.01 --reference-samples 16 --seeds 2 --integrator path --progress none";
    bench(&dir, &format!("{line} --json a.json"), 0);
    let results = json(&dir, "a.json");
    let steps = results["scenes"][0]["methods"][0]["steps"].as_array().expect("steps").clone();
    let budgets: Vec<_> = steps.iter().map(|step| step["budget"].as_f64().expect("a time")).collect();
    assert_eq!(budgets, [0.01, 0.02]);
    assert!(steps.iter().all(|step| step["seconds"].as_f64() >= step["budget"].as_f64()));
}

#[test]
fn interrupted_bench_writes_nothing() {
    use std::process::Stdio;
    let dir = box_dir();
    let mut process =
        dir.glimt("bench box.toml --reference-samples 4000000000 --no-cache --csv a.csv --progress json");
    let mut child = process.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("it runs");
    let mut said = std::io::BufReader::new(child.stderr.take().expect("stderr"));
    let mut line = String::new();
    while !line.contains("reference 1 of 2") {
        line.clear();
        assert!(
            std::io::BufRead::read_line(&mut said, &mut line).expect("a line") > 0,
            "exited before the interrupt"
        );
    }
    let id = nix::unistd::Pid::from_raw(child.id() as i32);
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT).expect("sent");
    assert_eq!(child.wait().expect("it ends").code(), Some(130));
    assert!(!dir.path("a.csv").exists());
}
