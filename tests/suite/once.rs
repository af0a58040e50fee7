//! Non-interactive use: exit codes, streams, files.

use std::fs;
use std::process::{Command as Process, Stdio};
use std::time::{Duration, Instant};

use nix::errno::Errno;

use super::test_dir::{SCENE, TestDir, assert_mentions, mentions, system_error};

#[test]
fn once_renders_and_reports_the_image() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once", 0);
    let last = stderr.lines().last().expect("a line");
    assert_mentions(last, &["ball.png", "32×24", "2 samples"]);
    assert!(dir.path("ball.png").is_file());
    for stage in ["parse", "accel", "render", "write"] {
        assert!(stderr.lines().any(|line| line.starts_with(stage)), "{stage}: {stderr}");
    }
}

#[test]
fn outputs_resolve_to_scene_or_working_directory() {
    let dir = TestDir::new();
    fs::create_dir_all(dir.path("scenes/out")).expect("a folder");
    dir.write("scenes/own.toml", SCENE.replace("[render]", "[render]\noutput = \"out/own.ppm\""));
    dir.write("scenes/none.toml", SCENE);
    let stderr = dir.expect("scenes/own.toml --once", 0);
    assert_mentions(&stderr, &["scenes/out/own.ppm", "32×24"]);
    assert!(dir.path("scenes/out/own.ppm").is_file());
    dir.expect("scenes/none.toml --once", 0);
    assert!(dir.path("none.png").is_file());
    dir.expect("scenes/own.toml --once -o call.png", 0);
    assert!(dir.path("call.png").is_file());
    assert_eq!(fs::read_dir(dir.path("scenes")).expect("a folder").count(), 3, "no image next to the scene");
}

#[test]
fn progress_none_writes_outputs_silently() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once -o a.png -o b.ppm --progress none", 0);
    assert_eq!(stderr, "");
    assert!(dir.path("a.png").is_file() && dir.path("b.ppm").is_file());
    assert!(!dir.path("ball.png").exists());
}

#[test]
fn json_progress_has_the_documented_keys() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once --progress json", 0);
    let lines: Vec<serde_json::Value> =
        stderr.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let of = |event: &str| lines.iter().filter(|line| line["event"] == event).collect::<Vec<_>>();
    let progress = of("progress");
    let fractions: Vec<f64> =
        progress.iter().map(|line| line["fraction"].as_f64().expect("a number")).collect();
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]));
    assert_eq!(fractions.last(), Some(&1.0));
    assert!(progress.iter().all(|line| line.get("eta_seconds").is_some() && line["stage"] == "render"));
    assert_eq!(of("written")[0]["path"], "ball.png");
    assert_eq!(of("done").len(), 1);
    let stages: Vec<_> = of("stage").into_iter().filter(|line| line["status"] != "running").collect();
    assert_eq!(stages.len(), 8);
}

#[test]
fn json_progress_contains_errors() {
    let dir = TestDir::new();
    dir.write("ball.toml", SCENE.replace("\"ball\"", "\"bal\""));
    let stderr = dir.expect("ball.toml --once --progress json", 2);
    let lines: Vec<serde_json::Value> =
        stderr.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let last = lines.last().expect("a line");
    assert_eq!((&last["event"], &last["kind"]), (&"failed".into(), &"scene".into()));
    let errors = last["diagnostics"].as_array().expect("diagnostics");
    let error = errors.iter().find(|one| one["severity"] == "error").expect("an error");
    assert_eq!((&error["line"], &error["path"]), (&17.into(), &"ball.toml".into()));
    assert!(error["message"].as_str().expect("text").contains("bal"));
}

#[test]
fn report_values_match_the_options() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once --report r.json --seed 5 --threads 2 --samples 3", 0);
    let text = fs::read_to_string(dir.path("r.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(report["glimt"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["scene"], "ball.toml");
    let image = &report["image"];
    assert_eq!(
        (&image["path"], &image["width"], &image["height"]),
        (&"ball.png".into(), &32.into(), &24.into())
    );
    let samples = &image["samples"];
    assert_eq!((&samples["min"], &samples["max"], &samples["mean"]), (&3.into(), &3.into(), &3.0.into()));
    assert_eq!(image["complete"], true);
    let settings = &report["settings"];
    assert_eq!((&settings["seed"], &settings["threads"]), (&5.into(), &2.into()));
    assert_eq!((&settings["integrator"], &settings["accel"]), (&"whitted".into(), &"bvh".into()));
    assert_eq!((&settings["photons"], &settings["dof"]), (&false.into(), &false.into()));
    let names: Vec<&str> = report["stages"]
        .as_array()
        .expect("stages")
        .iter()
        .map(|stage| {
            assert!(["done", "reused", "skipped"].contains(&stage["status"].as_str().expect("a status")));
            stage["name"].as_str().expect("a name")
        })
        .collect();
    assert_eq!(names, ["parse", "meshes", "textures", "accel", "lights", "photons", "render", "write"]);
    assert_eq!(report["counters"]["camera_rays"], 32 * 24 * 3);
    for counter in ["triangles", "shadow_rays", "photons_stored", "texture_lookups", "non_finite_samples"] {
        assert!(report["counters"][counter].is_u64(), "{counter}");
    }
    assert!(report["seconds"].as_f64().expect("seconds") > 0.0);
    assert!(report["peak_memory_bytes"].as_u64().expect("bytes") > 1 << 20);
}

/// The keys that scripts may rely on, with values of the right types.
const REPORT: &str = r#"{
  "glimt": "0.1.0",
  "scene": "scenes/cornell.toml",
  "image": { "path": "cornell.png", "width": 640, "height": 480,
             "samples": { "min": 16, "mean": 41.2, "max": 64 }, "error": 0.0081, "complete": true },
  "settings": { "integrator": "whitted", "shadows": "soft", "photons": false, "dof": false, "accel": "bvh", "seed": 0, "threads": 2 },
  "stages": [ { "name": "parse", "status": "done", "seconds": 0.0004, "why": "" } ],
  "counters": { "triangles": 0, "camera_rays": 0, "shadow_rays": 0, "reflected_rays": 0, "refracted_rays": 0,
                "photons_emitted": 0, "photons_stored": 0, "texels_loaded": 0, "texture_lookups": 0, "non_finite_samples": 0 },
  "seconds": 1.93,
  "peak_memory_bytes": 41943040
}"#;

/// Checks that `found` has every key of `example` with a value of the same type. Integers must remain
/// integers.
fn assert_like(example: &serde_json::Value, found: &serde_json::Value, place: &str) {
    use serde_json::Value as V;
    match (example, found) {
        (V::Object(keys), V::Object(_)) => {
            for (key, value) in keys {
                let place = format!("{place}.{key}");
                assert!(found.get(key).is_some(), "{place} is missing");
                assert_like(value, &found[key], &place);
            }
        }
        (V::Array(values), V::Array(found)) => {
            assert!(!found.is_empty(), "{place}");
            found.iter().for_each(|one| assert_like(&values[0], one, place));
        }
        (V::Number(number), V::Number(_)) => assert!(!number.is_u64() || found.is_u64(), "{place}: {found}"),
        (V::Bool(_), V::Bool(_)) | (V::String(_), V::String(_)) => {}
        _ => assert_eq!(found, example, "{place} has the wrong type"),
    }
}

#[test]
fn report_has_every_key_with_its_type() {
    let dir = TestDir::new();
    let example: serde_json::Value = serde_json::from_str(REPORT).expect("JSON");
    let report = dir.report("ball.toml --samples 3");
    assert_like(&example, &report, "report");
    let error =
        |samples: u32| dir.report(&format!("ball.toml --samples {samples}"))["image"]["error"].clone();
    assert!(error(1).is_null(), "no error estimate for one sample");
    let [few, many] = [4, 256].map(|samples| error(samples).as_f64().expect("an estimate"));
    assert!(many > 0.0 && many < 0.25 * few && few < 1.0, "{few} {many}");
}

#[test]
fn broken_scene_exits_2_and_keeps_the_image() {
    let dir = TestDir::new();
    dir.write("ball.png", "the old one");
    dir.write("ball.toml", SCENE.replace("width = 32", "width = = 32"));
    let stderr = dir.expect("ball.toml --once", 2);
    assert!(stderr.contains("error") && stderr.contains("ball.toml:2:"), "{stderr}");
    assert_eq!(fs::read(dir.path("ball.png")).expect("there"), b"the old one");
    let stderr = dir.expect("missing.toml --once", 2);
    assert!(stderr.contains("missing.toml"), "{stderr}");
}

#[test]
fn missing_mesh_exits_2() {
    let dir = TestDir::new();
    dir.write("ball.toml", format!("{SCENE}\n[[mesh]]\nfile = \"no.obj\"\nmaterial = \"ball\"\n"));
    let stderr = dir.expect("ball.toml --once", 2);
    assert!(stderr.contains("no.obj") && stderr.contains("ball.toml:25:"), "{stderr}");
    assert!(!dir.path("ball.png").exists());
}

#[test]
fn option_errors_do_not_point_into_the_scene() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once --crop 0,0,33,1 --progress none", 2);
    assert!(stderr.starts_with("error: `--crop 0,0,33,1`") && !stderr.contains("-->"), "{stderr}");
    let stderr = dir.expect("ball.toml --once --bit-depth 16 -o a.png -o a.jpg --progress none", 2);
    assert!(stderr.contains("JPEG") && stderr.contains("--> a.jpg\n"), "{stderr}");
    dir.write("ball.toml", SCENE.replace("[render]", "[render]\noutput = \"own.jpg\""));
    let stderr = dir.expect("ball.toml --once --bit-depth 16 --progress none", 2);
    assert!(stderr.contains("--> own.jpg\n"), "{stderr}");
    assert_eq!(fs::read_dir(dir.0.path()).expect("a folder").count(), 1, "nothing was written");
}

#[test]
fn ineffective_options_warn() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once --dof on --photons on --integrator path --progress none", 0);
    assert_mentions(&stderr, &["warning: --dof on", "warning: --photons on", "2 warnings"]);
    let stderr = dir.expect("ball.toml --once --dof on --progress json", 0);
    let done = stderr.lines().last().map(serde_json::from_str::<serde_json::Value>);
    let done = done.expect("a line").expect("JSON");
    let warning = &done["diagnostics"][0];
    assert!(warning["path"].is_null() && warning["line"].is_null(), "{done}");
    dir.write("ball.toml", SCENE.replace("[materials", "aperture = 0.1\n[materials"));
    let stderr = dir.expect("ball.toml --once --dof on --photons off --progress none", 0);
    assert_eq!(stderr, "");
}

#[test]
fn missing_generated_mesh_names_its_command() {
    let dir = TestDir::new();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/million.toml");
    dir.write("million.toml", fs::read_to_string(scene).expect("a scene"));
    let stderr = dir.expect("check million.toml", 2);
    assert_mentions(&stderr, &["million.toml", "glimt-assets -- million"]);
}

#[test]
fn wrong_call_exits_2() {
    let dir = TestDir::new();
    for (line, word) in [
        ("ball.toml --once --samples 0", "--samples"),
        ("ball.toml --once --integrator paths", "path"),
        ("ball.toml --once --clamp x", "--clamp"),
        ("ball.toml --once --accel octree", "kdtree"),
        ("ball.toml --once -o a.xyz", "a.xyz"),
        ("ball.toml --once --crop 0,0,33,1", "32×24"),
        ("ball.toml --once --bit-depth 16 -o a.jpg", "JPEG"),
        ("ball.toml --nonsense", "--nonsense"),
        ("--once", "SCENE"),
    ] {
        let stderr = dir.expect(line, 2);
        assert!(stderr.contains(word), "{line}: {stderr}");
    }
    assert_eq!(fs::read_dir(dir.0.path()).expect("a folder").count(), 1, "nothing was written");
}

#[test]
fn write_failure_exits_1() {
    let dir = TestDir::new();
    let stderr = dir.expect("ball.toml --once -o nowhere/a.png", 1);
    assert!(stderr.contains("nowhere"), "{stderr}");
    let stderr = dir.expect("ball.toml --once --report nowhere/r.json", 1);
    assert!(stderr.contains("nowhere/r.json"), "{stderr}");
}

#[test]
fn failed_outputs_are_reported_on_separate_lines() {
    let dir = TestDir::new();
    for name in ["a.png", "b.ppm"] {
        std::os::unix::fs::symlink("/dev/full", dir.path(name)).expect("a link");
    }
    let stderr = dir.expect("ball.toml --once --progress none -o a.png -o c.png -o b.ppm", 1);
    let lines: Vec<&str> = stderr.lines().collect();
    assert_eq!(lines.len(), 2, "{stderr}");
    for (line, name) in lines.into_iter().zip(["a.png", "b.ppm"]) {
        assert_mentions(line, &["error", name, &system_error(Errno::ENOSPC)]);
    }
    assert!(dir.path("c.png").is_file());
}

#[test]
fn suggested_command_can_be_pasted() {
    let dir = TestDir::new();
    let name = "it's my \"scene\" $HOME.toml";
    let output = dir.glimt("new").arg(name).output().expect("it runs");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    let command = stderr.lines().find_map(|line| line.strip_prefix("now: glimt ")).expect("a command");
    let command = command.split("    (").next().expect("its end");
    let echoed = std::process::Command::new("sh").args(["-c", &format!("printf %s {command}")]).output();
    assert_eq!(String::from_utf8_lossy(&echoed.expect("it runs").stdout), name, "{command}");
}

#[test]
fn help_and_version_go_to_stdout() {
    let dir = TestDir::new();
    for (line, word) in
        [("--help", "--samples"), ("--version", glimt::pipeline::BUILD), ("new --help", "FILE")]
    {
        let output = dir.run(line);
        assert_eq!(output.status.code(), Some(0));
        assert!(String::from_utf8_lossy(&output.stdout).contains(word), "{line}");
    }
}

#[test]
fn check_counts_objects_and_triangles() {
    let dir = TestDir::new();
    let output = dir.run("check ball.toml");
    assert_eq!(output.status.code(), Some(0));
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_mentions(&stdout, &["ok: ball.toml", "1 object", "0 triangles"]);
    dir.write("ball.toml", SCENE.replace("\"ball\"", "\"bal\""));
    let stderr = dir.expect("check ball.toml", 2);
    assert!(stderr.contains("bal") && stderr.contains("ball.toml:17:"), "{stderr}");
}

#[test]
fn check_warns_about_unlit_meshes() {
    let dir = TestDir::new();
    dir.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    dir.write("a.mtl", "newmtl a\nKd 1 1 1\n");
    let scene = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[[mesh]]\nfile = \"a.obj\"\n";
    dir.write("dark.toml", scene);
    let said = |name: &str| String::from_utf8_lossy(&dir.run(&format!("check {name}")).stderr).into_owned();
    assert_mentions(&said("dark.toml"), &["warning", "dark.toml", "lights"]);
    dir.write("lit.toml", format!("{scene}[[light]]\n"));
    assert!(!mentions(&said("lit.toml"), "warning"), "{}", said("lit.toml"));
}

#[test]
fn check_names_lights_in_the_plane_of_a_surface() {
    let dir = TestDir::new();
    let scene = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.lamp]\nemission = 1\n[materials.wall]\n";
    let quad = |name: &str, size: i32, material: &str| {
        format!(
            "[[quad]]\nname = \"{name}\"\ncorner = [0, 2, 0]\nu = [{size}, 0, 0]\nv = [0, 0, {size}]\nmaterial = \"{material}\"\n"
        )
    };
    let (lamp, ceiling) = (quad("panel", 1, "lamp"), quad("ceiling", 3, "wall"));
    for (objects, light, other) in [([&lamp, &ceiling], 7, 13), ([&ceiling, &lamp], 13, 7)] {
        dir.write("a.toml", format!("{scene}{}", objects.map(String::as_str).concat()));
        let said = String::from_utf8_lossy(&dir.run("check a.toml").stderr).into_owned();
        assert_mentions(
            &said,
            &["warning", "plane", "ceiling", &format!("line {other}"), &format!("a.toml:{light}")],
        );
    }
}

#[test]
fn check_json_is_not_ok_if_warnings_hide_an_error() {
    use std::fmt::Write;
    let dir = TestDir::new();
    let mut scene = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[[light]]\n".to_owned();
    for number in 0..600 {
        write!(scene, "[materials.m{number}]\nnormal_strength = 2\n").expect("written");
    }
    for (error, is_ok) in [("", true), ("[[sphere]]\nradius = -1\n", false)] {
        dir.write("a.toml", format!("{scene}{error}"));
        let output = dir.run("check a.toml --json");
        assert_eq!(output.status.code(), Some(if is_ok { 0 } else { 2 }), "{output:?}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(report["ok"], is_ok, "{error}");
        let said = report.to_string();
        assert_eq!(said.contains("\"error\""), !is_ok, "{error}");
    }
}

#[test]
fn check_names_lights_counted_twice() {
    let dir = TestDir::new();
    let vertices = "v 0 2 0\nv 1 2 0\nv 1 2 1\nv 0 2 1\n";
    let scene = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[materials.lamp]\nemission = 1\n";
    let quad =
        "[[quad]]\nname = \"panel\"\ncorner = [0, 2, 0]\nu = [1, 0, 0]\nv = [0, 0, 1]\nmaterial = \"lamp\"\n";
    let mesh = "[[mesh]]\nname = \"tube\"\nfile = \"a.obj\"\nmaterial = \"lamp\"\n";
    let said = |faces: &str, objects: &[&str]| {
        dir.write("a.obj", format!("{vertices}{faces}"));
        // Names are unique.
        let name = |(i, object): (usize, &&str)| {
            object.replace("panel", &format!("panel {i}")).replace("tube", &format!("tube {i}"))
        };
        let objects: Vec<String> = objects.iter().enumerate().map(name).collect();
        dir.write("a.toml", format!("{scene}{}", objects.concat()));
        String::from_utf8_lossy(&dir.run("check a.toml").stderr).into_owned()
    };
    let once = "f 1 2 3 4\n";
    assert!(!mentions(&said(once, &[mesh]), "twice"));
    // Duplicate faces emit only once, even if they start at different corners.
    assert!(!mentions(&said("f 1 2 3\nf 1 3 4\nf 2 3 1\nf 3 4 1\n", &[mesh]), "twice"));
    // The other diagonal.
    assert_mentions(
        &said("f 1 2 3 4\nf 2 3 4 1\n", &[mesh]),
        &["tube 0", "line 6", "twice", "a.toml:6", "help"],
    );
    // Two objects in the same place.
    for (objects, other, line) in [
        ([quad, quad], "panel 0", "a.toml:12"),
        ([quad, mesh], "panel 0", "a.toml:12"),
        ([mesh, quad], "tube 0", "a.toml:10"),
        ([mesh, mesh], "tube 0", "a.toml:10"),
    ] {
        assert_mentions(&said(once, &objects), &[other, "line 6", "twice", line, "help"]);
    }
}

#[test]
fn check_handles_200000_shapes() {
    use std::fmt::Write;
    const COUNT: u32 = 200_000;
    let dir = TestDir::new();
    let mut text = SCENE.to_owned();
    for i in 1..COUNT {
        let (x, y, z) = (i % 97, i / 97 % 89, i / 8633);
        let sphere = format!("center = [{x}.25, {y}.5, -{z}]\nradius = 0.125\nmaterial = \"ball\"");
        writeln!(text, "[[sphere]]\n{sphere}").expect("memory");
    }
    dir.write("many.toml", text);
    let output = dir.run("check many.toml");
    let stdout = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_mentions(&stdout, &["ok: many.toml", "200000 objects", "0 triangles"]);
}

#[test]
fn new_scene_renders_and_never_overwrites() {
    let dir = TestDir::new();
    let stderr = dir.expect("new fresh.toml", 0);
    assert_mentions(&stderr, &["fresh.toml", "glimt fresh.toml"]);
    dir.expect("fresh.toml --once --width 16 --height 12 --samples 1", 0);
    let stderr = dir.expect("new ball.toml", 2);
    assert_mentions(&stderr, &["error: ball.toml"]);
    assert_eq!(fs::read_to_string(dir.path("ball.toml")).expect("there"), SCENE);
    dir.expect("new nowhere/x.toml", 1);
    // A folder with that name exists.
    fs::create_dir(dir.path("sub")).expect("a folder");
    for name in ["sub", "sub/"] {
        assert_mentions(&dir.expect(&format!("new {name}"), 2), &[&format!("error: {name}")]);
    }
}

#[test]
fn unprintable_names_are_not_suggested() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let dir = TestDir::new();
    for name in ["new\nline.toml".as_bytes(), b"\xff.toml", "a\u{202e}b.toml".as_bytes()] {
        let output = dir.glimt("new").arg(OsStr::from_bytes(name)).output().expect("it runs");
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.starts_with("wrote ") && !said.contains("glimt "), "{said}");
        let picture = [&name[..name.len() - 4], b"png"].concat();
        let output = dir.glimt("new").arg(OsStr::from_bytes(&picture)).output().expect("it runs");
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: ") && said.contains(" .toml "), "{said}");
        assert!(!said.contains("glimt "), "{said}");
    }
}

/// Starts a render and sends it `signals` signals while it writes the image. Returns the exit code and
/// stderr.
fn signal_during_write(dir: &TestDir, line: &str, signals: usize) -> (Option<i32>, String) {
    let stderr = fs::File::create(dir.path("stderr")).expect("a file");
    let mut child = dir.glimt(line).stderr(stderr).spawn().expect("it runs");
    let said = || fs::read_to_string(dir.path("stderr")).expect("there");
    let start = Instant::now();
    let is_writing = || said().lines().any(|line| line.contains("\"write\"") && line.contains("running"));
    while !is_writing() {
        assert!(start.elapsed() < Duration::from_secs(60), "did not start to write: {}", said());
        std::thread::sleep(Duration::from_millis(1));
    }
    for _ in 0..signals {
        // The process may have exited.
        let _ = Process::new("kill").arg("-TERM").arg(child.id().to_string()).stderr(Stdio::null()).status();
        std::thread::sleep(Duration::from_millis(30));
    }
    let code = child.wait().expect("it ends").code();
    (code, said())
}

#[test]
fn signal_during_the_write_keeps_the_render() {
    // After one signal, an image that is almost written may be completed. A second signal aborts the write.
    // In both cases, the samples are saved.
    for (size, signals) in [("--width 700 --height 500", 1), ("--width 1600 --height 1200", 2)] {
        let dir = TestDir::new();
        let render = format!("ball.toml --once -o out.png --samples 1 --progress json {size}");
        let (code, said) = signal_during_write(&dir, &render, signals);
        let (picture, checkpoint) = (dir.path("out.png"), dir.path("out.png.checkpoint"));
        assert!(code == Some(143) || code == Some(0) && picture.exists(), "{code:?}: {said}");
        assert!(picture.exists() != checkpoint.exists(), "{said}");
        let leftover = |entry: std::io::Result<fs::DirEntry>| {
            entry.expect("an entry").file_name().to_string_lossy().ends_with(".tmp")
        };
        assert!(!fs::read_dir(dir.0.path()).expect("a folder").any(leftover), "temporary files remain");
        if checkpoint.exists() {
            dir.expect(&render.replace("json", "none --resume"), 0);
        }
        dir.expect(&render.replace("json", "none").replace("out.png", "one.png"), 0);
        assert!(dir.bytes("out.png") == dir.bytes("one.png"), "{size}, {signals} signals");
    }
}

#[test]
fn signal_during_the_write_reports_the_image() {
    let dir = TestDir::new();
    let stderr = fs::File::create(dir.path("stderr")).expect("a file");
    let line =
        "ball.toml --once -o out.png --samples 1 --progress plain --width 700 --height 500 --checkpoint 0";
    let mut child = dir.glimt(line).stderr(stderr).spawn().expect("it runs");
    let said = || fs::read_to_string(dir.path("stderr")).expect("there");
    let start = Instant::now();
    while !said().contains("render   done") {
        assert!(start.elapsed() < Duration::from_secs(60), "{}", said());
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = Process::new("kill").arg("-TERM").arg(child.id().to_string()).stderr(Stdio::null()).status();
    let code = child.wait().expect("it ends").code();
    // Without checkpoints, only the image saves the samples.
    assert!(dir.path("out.png").exists(), "{code:?}: {}", said());
    assert_mentions(&said(), &["out.png"]);
    assert!(code == Some(0) || mentions(&said(), "SIGTERM"), "{}", said());
}

#[test]
fn image_does_not_depend_on_threads() {
    let dir = TestDir::new();
    for threads in [1, 2, 7] {
        dir.expect(&format!("ball.toml --once -o {threads}.ppm --samples 5 --threads {threads}"), 0);
    }
    let picture = |name: &str| fs::read(dir.path(name)).expect("a picture");
    assert!(picture("1.ppm") == picture("2.ppm") && picture("1.ppm") == picture("7.ppm"));
}

#[test]
fn closed_pipe_does_not_panic() {
    let dir = TestDir::new();
    let mut child = dir.glimt("ball.toml --once").stderr(Stdio::piped()).spawn().expect("it runs");
    drop(child.stderr.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    let mut child = dir.glimt("check ball.toml").stdout(Stdio::piped()).spawn().expect("it runs");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}

#[test]
fn signals_set_the_exit_code_and_keep_the_image() {
    for (name, code) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        let dir = TestDir::new();
        dir.write("ball.png", "the old one");
        let mut child = dir
            .glimt("ball.toml --once -o ball.png --samples 4000000 --progress json")
            .stderr(Stdio::piped())
            .spawn()
            .expect("it runs");
        // Wait for the first sample, which makes a checkpoint possible.
        wait_for(&mut child, |line| line.contains("\"progress\"") && !line.contains("\"samples\":0,"));
        let killed = Process::new("kill").arg(format!("-{name}")).arg(child.id().to_string()).status();
        assert!(killed.expect("kill runs").success());
        assert_eq!(child.wait().expect("it ends").code(), Some(code), "{name}");
        assert_eq!(fs::read(dir.path("ball.png")).expect("there"), b"the old one");
        assert!(dir.path("ball.png.checkpoint").is_file());
        assert_eq!(fs::read_dir(dir.0.path()).expect("a folder").count(), 3, "temporary files remain");
    }
}

#[test]
fn signal_is_reported() {
    for (name, code, words) in [
        (
            "INT",
            130,
            "terminated by SIGINT: progress saved in ball.png.checkpoint; use --resume to continue\n",
        ),
        (
            "TERM",
            143,
            "terminated by SIGTERM: progress saved in ball.png.checkpoint; use --resume to continue\n",
        ),
        ("HUP", 129, ""),
    ] {
        for progress in ["plain", "none"] {
            let dir = TestDir::new();
            let stderr = fs::File::create(dir.path("stderr")).expect("a file");
            let mut child = dir
                .glimt(&format!("ball.toml --once --samples 4000000 --threads 1 --progress {progress}"))
                .stderr(stderr)
                .spawn()
                .expect("it runs");
            let said = || fs::read_to_string(dir.path("stderr")).expect("there");
            // Without progress output, there is no sign that the handlers are installed.
            let sign = if progress == "plain" { "photons" } else { "" };
            let start = Instant::now();
            while !said().contains(sign) || start.elapsed() < Duration::from_millis(500) {
                assert!(start.elapsed() < Duration::from_secs(30), "did not start");
                std::thread::sleep(Duration::from_millis(10));
            }
            let killed = Process::new("kill").arg(format!("-{name}")).arg(child.id().to_string()).status();
            assert!(killed.expect("kill runs").success());
            assert_eq!(child.wait().expect("it ends").code(), Some(code), "{name} {progress}");
            let last = said().lines().last().map_or(String::new(), |line| format!("{line}\n"));
            assert_eq!(said().matches("terminated by").count(), usize::from(!words.is_empty()), "{}", said());
            assert!(words.is_empty() || last == words, "{}", said());
        }
    }
}

#[test]
fn new_writes_to_stdout_for_a_dash() {
    let dir = TestDir::new();
    let output = dir.run("new -");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(output.stdout, glimt::scene::starter_scene().as_bytes());
    assert!(output.stderr.is_empty());
    assert!(!dir.path("-").exists());
    dir.expect("new ./-", 0);
    assert_eq!(dir.bytes("-"), glimt::scene::starter_scene().as_bytes());
    // A scene on stdout has no folder for the schema, so the message shows how to write it.
    let output = dir.run("new --schema -");
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.starts_with(b"#:schema glimt.schema.json\n"));
    let said = String::from_utf8(output.stderr).expect("UTF-8");
    let words =
        "note: to create glimt.schema.json next to the scene, run: glimt schema > glimt.schema.json\n";
    assert_eq!(said, words);
}

/// Waits until the process prints a matching line to stderr. Later output is discarded.
fn wait_for(child: &mut std::process::Child, is_it: impl Fn(&str) -> bool + Send + 'static) {
    use std::io::{BufRead, BufReader};
    let stderr = BufReader::new(child.stderr.take().expect("piped"));
    let (sender, said) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        for line in stderr.lines().map_while(Result::ok) {
            if is_it(&line) {
                let _ = sender.send(());
            }
        }
    });
    said.recv_timeout(Duration::from_secs(30)).expect("the expected line");
}
