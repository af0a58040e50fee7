//! Each option changes the image as expected and appears in the report.

use std::fs;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::process::Stdio;

use glimt::scene::SCENE_NOT_FOUND;
use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::test_dir::{SCENE, TestDir, assert_mentions, mentions, system_error};

/// A scene with an area light, a mirror and a lens, so that every option has an effect.
const ROOM: &str = r#"[render]
width = 24
height = 18
samples = 2
seed = 3

[camera]
position = [0, 1, 4]
look_at = [0, 0.8, 0]
aperture = 0.3
focus = 5

[materials.ball]
type = "phong"
diffuse = [0.8, 0.2, 0.1]
specular = [0.1, 0.1, 0.1]

[materials.mirror]
type = "mirror"
reflectance = [0.9, 0.9, 0.9]

[materials.lamp]
type = "phong"
diffuse = [0, 0, 0]
emission = [8, 8, 8]

[[sphere]]
center = [0.5, 0.5, 0]
radius = 0.5
material = "ball"

[[sphere]]
center = [-0.6, 0.5, 0]
radius = 0.5
material = "mirror"

[[quad]]
corner = [-3, 0, 3]
u = [6, 0, 0]
v = [0, 0, -6]
material = "ball"

[[quad]]
corner = [-0.5, 3, -0.5]
u = [1, 0, 0]
v = [0, 0, 1]
material = "lamp"
"#;

fn room() -> TestDir {
    let dir = TestDir::new();
    dir.write("room.toml", ROOM);
    dir
}

/// Renders with additional options. Returns the contents of the image file.
#[track_caller]
fn rendered_bytes(dir: &TestDir, options: &str) -> Vec<u8> {
    dir.expect(&format!("room.toml --once -o picture.ppm --progress none {options}"), 0);
    dir.bytes("picture.ppm")
}

/// Pixels of an 8-bit PPM.
fn pixels(ppm: &[u8], count: usize) -> &[u8] {
    &ppm[ppm.len() - 3 * count..]
}

#[test]
fn options_change_the_image_and_report() {
    let dir = room();
    let plain = rendered_bytes(&dir, "");
    assert_eq!(plain, rendered_bytes(&dir, ""), "equal options must have equal images");
    let cases: [(&str, &str, serde_json::Value); 8] = [
        ("--shadows hard", "shadows", "hard".into()),
        ("--shadows off", "shadows", "off".into()),
        ("--dof off", "dof", false.into()),
        ("--seed 4", "seed", 4.into()),
        ("--view normal", "view", "normal".into()),
        ("--view depth", "view", "depth".into()),
        ("--view albedo", "view", "albedo".into()),
        ("--view shadow", "view", "shadow".into()),
    ];
    for (option, key, value) in cases {
        assert_ne!(rendered_bytes(&dir, option), plain, "{option}");
        let report = dir.report(&format!("room.toml {option}"));
        assert_eq!(report["settings"][key], value, "{option}");
    }
    for option in ["--max-depth 0", "--max-depth 1", "--samples 3"] {
        assert_ne!(rendered_bytes(&dir, option), plain, "{option}");
    }
    for same in [
        "--seed 3",
        "--dof on",
        "--shadows soft",
        "--view beauty",
        "--samples 2",
        "--integrator whitted",
        "--accel bvh",
        "--threads 1",
        "--threads 0",
        "--color none",
        "--preview none",
        "--photons off",
    ] {
        assert_eq!(rendered_bytes(&dir, same), plain, "{same}");
    }
}

#[test]
fn set_option_matches_editing_the_file() {
    let dir = room();
    let sets = "--set materials.ball.diffuse=[0.1,0.2,0.3] --set sphere.2.radius=.4 --set render.samples=3";
    let by_call = rendered_bytes(&dir, sets);
    let edited = ROOM.replace("[0.8, 0.2, 0.1]", "[0.1, 0.2, 0.3]").replace("samples = 2", "samples = 3");
    let (first, second) = edited.split_at(edited.rfind("[[sphere]]").expect("a ball"));
    dir.write("room.toml", format!("{first}{}", second.replacen("radius = 0.5", "radius = 0.4", 1)));
    assert_eq!(by_call, rendered_bytes(&dir, ""));
    dir.write("room.toml", ROOM);
    assert_ne!(by_call, rendered_bytes(&dir, ""));
    // Dedicated options take precedence over `--set`.
    assert_eq!(rendered_bytes(&dir, "--set render.samples=5 --samples 2"), rendered_bytes(&dir, ""));
    let checked = dir.run("check room.toml --set materials.ball.diffuse=tomatoe");
    let words = String::from_utf8(checked.stderr).expect("UTF-8");
    assert_eq!(checked.status.code(), Some(2));
    assert_mentions(&words, &["\"tomato\"", "--set:1:26"]);
}

#[test]
fn depth_limits_the_rays() {
    let dir = room();
    let counters = |depth: u32| dir.report(&format!("room.toml --max-depth {depth}"))["counters"].clone();
    let (none, direct, deep) = (counters(0), counters(1), counters(8));
    assert_eq!((&none["shadow_rays"], &none["reflected_rays"]), (&0.into(), &0.into()));
    assert!(
        direct["shadow_rays"].as_u64() > Some(0)
            && direct["reflected_rays"].as_u64() <= deep["reflected_rays"].as_u64()
    );
    assert!(deep["reflected_rays"].as_u64() > Some(0));
    assert_eq!(none["camera_rays"], 24 * 18 * 2);
}

#[test]
fn size_samples_and_time_are_applied() {
    let dir = room();
    let report = dir.report("room.toml --width 7 --height 5 --samples 9 -o a.png");
    assert_eq!((&report["image"]["width"], &report["image"]["height"]), (&7.into(), &5.into()));
    assert_eq!(report["image"]["samples"]["max"], 9);
    let decoder =
        png::Decoder::new(std::io::BufReader::new(fs::File::open(dir.path("a.png")).expect("a picture")));
    let reader = decoder.read_info().expect("a PNG");
    assert_eq!((reader.info().width, reader.info().height), (7, 5));
    let report = dir.report("room.toml --samples 4000000000 --time 0.3");
    assert_eq!(report["image"]["complete"], false);
    assert!(report["seconds"].as_f64() < Some(20.0));
    assert!(report["image"]["samples"]["min"].as_u64() > Some(0));
}

#[test]
fn crop_keeps_pixels_and_is_black_outside() {
    let dir = room();
    let whole = rendered_bytes(&dir, "");
    let cut = rendered_bytes(&dir, "--crop 5,4,10,8");
    let (whole, cut) = (pixels(&whole, 24 * 18), pixels(&cut, 24 * 18));
    for (index, (a, b)) in whole.chunks(3).zip(cut.chunks(3)).enumerate() {
        let (x, y) = (index % 24, index / 24);
        let is_inside = (5..15).contains(&x) && (4..12).contains(&y);
        assert_eq!(b, if is_inside { a } else { &[0, 0, 0] }, "{x}, {y}");
    }
    assert!(cut.iter().any(|byte| *byte > 0));
}

#[test]
fn formats_and_bit_depths_agree() {
    let dir = room();
    let report = dir.report("room.toml -o a.png -o a.exr -o a.ppm -o a.hdr -o a.jpg");
    assert_eq!(report["image"]["path"], "a.png");
    for (name, start) in [
        ("a.png", b"\x89PNG\r\n\x1a\n".as_slice()),
        ("a.exr", b"\x76\x2f\x31\x01"),
        ("a.ppm", b"P6"),
        ("a.hdr", b"#?RADIANCE"),
        ("a.jpg", b"\xff\xd8\xff"),
    ] {
        assert!(dir.bytes(name).starts_with(start), "{name}");
        assert_eq!(image::open(dir.path(name)).map(|image| image.width()).ok(), Some(24), "{name}");
    }
    let depth = |option: &str| {
        dir.report(&format!("room.toml -o depth.png {option}"));
        image::open(dir.path("depth.png")).expect("a picture").color().bits_per_pixel()
    };
    assert_eq!((depth(""), depth("--bit-depth 8"), depth("--bit-depth 16")), (24, 24, 48));
}

#[test]
fn invalid_values_list_the_valid_values() {
    let dir = TestDir::new();
    for (option, facts) in [
        ("--samples abc", &["--samples", "1", "4294967295"][..]),
        ("--samples -1", &["--samples", "1", "4294967295"]),
        ("--width 0", &["--width", "1", "65536"]),
        ("--height 65537", &["--height", "1", "65536"]),
        ("--seed -1", &["--seed", "0", "4294967295"]),
        ("--max-depth 1.5", &["--max-depth", "0", "10000"]),
        ("--time -3", &["--time", "seconds", "0"]),
        ("--time nan", &["--time", "seconds", "0"]),
        ("--threads -2", &["--threads", "0", "4096"]),
        ("--bit-depth 10", &["--bit-depth", "8", "16"]),
        ("--crop -1,0,2,2", &["--crop", "X,Y,W,H"]),
        ("--crop 30,0,9,9", &["30,0,9,9", "32×24"]),
        ("--shadows maybe", &["off, hard, soft"]),
        ("--dof perhaps", &["on, off"]),
        ("--view nothing", &["beauty, normal, depth"]),
        ("--progress loud", &["auto, plain, json, none"]),
        ("--color pink", &["truecolor"]),
        ("--sampels 3", &["--samples"]),
        ("-o a.tiff", &["a.tiff", ".png, .exr"]),
        ("-o a", &["a", ".png, .exr"]),
        ("-o a.png -o a.png", &["a.png", "twice"]),
        ("--set render.samples=0", &["--set:1:18"]),
        ("--set sphere.2.radius=1", &["--set", "1", "2"]),
        ("--set samples=3", &["render.samples=3"]),
        ("other.toml", &["\"other.toml\""]),
    ] {
        assert_mentions(&dir.expect(&format!("ball.toml --once {option}"), 2), facts);
    }
    for (call, facts) in [
        ("--samples 4 ball.toml b.toml", &["\"b.toml\""][..]),
        ("chekc ball.toml", &["\"chekc\"", "`check`"]),
        ("render ball.toml", &["\"render\"", "check, new, import, info, compare, bench, merge, farm"]),
    ] {
        assert_mentions(&dir.expect(call, 2), facts);
    }
    assert_eq!(fs::read_dir(dir.0.path()).expect("a folder").count(), 1, "nothing was written");
}

#[test]
fn targets_are_checked_before_rendering() {
    let dir = TestDir::new();
    std::os::unix::fs::symlink("/dev/full", dir.path("full.png")).expect("a link");
    let stderr = dir.expect("ball.toml --once -o full.png", 1);
    assert_mentions(&stderr, &["full.png", &system_error(Errno::ENOSPC)]);
    for option in ["-o nowhere/a.png", "--report nowhere/r.json", "--report .", "-o ball.toml/a.png"] {
        let stderr = dir.expect(&format!("ball.toml --once --samples 4000000000 {option}"), 1);
        assert!(stderr.contains("cannot write") && !stderr.contains("os error"), "{option}: {stderr}");
    }
    let long = format!("-o {}.png", "n".repeat(300));
    let stderr = dir.expect(&format!("ball.toml --once --samples 4000000000 {long}"), 1);
    assert_mentions(&stderr, &[&system_error(Errno::ENAMETOOLONG)]);
    #[cfg(target_os = "linux")]
    for option in ["-o /proc/a.png", "-o /sys/a.png", "--report /proc/r.json", "--report /sys/r.json"] {
        let stderr = dir.expect(&format!("ball.toml --once --samples 4000000000 {option}"), 1);
        let denied = system_error(Errno::EACCES);
        assert_mentions(&stderr, &[if option.contains("/proc") { "directory /proc" } else { &denied }]);
    }
    let stderr = dir.expect("new nowhere/x.toml", 1);
    assert_mentions(&stderr, &["nowhere/x.toml", "directory nowhere"]);
    assert_eq!(names(&dir), ["ball.toml", "full.png"]);
}

/// File names in the folder, sorted.
fn names(dir: &TestDir) -> Vec<String> {
    let entries = fs::read_dir(dir.0.path()).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn new_requires_a_scene_name() {
    let dir = TestDir::new();
    for name in ["a.png", "a.EXR", "a.webp", "a.obj", "a.glb"] {
        assert_mentions(&dir.expect(&format!("new {name}"), 2), &[name, ".toml", "glimt new a.toml"]);
    }
    assert_eq!(names(&dir), ["ball.toml"]);
    for name in ["a.toml", "b", "c.scene", "d.TOML"] {
        dir.expect(&format!("new {name}"), 0);
    }
}

#[test]
fn usage_errors_escape_line_breaks() {
    use std::os::unix::ffi::OsStrExt;
    let dir = TestDir::new();
    let mut process = dir.glimt("ball.toml --once --set");
    process.arg(std::ffi::OsStr::from_bytes(b"\xff\x1b[2J=3"));
    let output = process.output().expect("it runs");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr.lines().count() > 2 && stderr.contains("\nUsage: ") && !stderr.contains('␊'), "{stderr}");
    assert!(stderr.chars().all(|one| !one.is_control() || one == '\n'), "{stderr:?}");
}

#[test]
fn unknown_word_is_reported_as_a_command() {
    let dir = TestDir::new();
    for (call, facts) in [
        ("paint", ["\"paint\"", "check, new, import, info, compare, bench"]),
        ("turn", ["\"turn\"", "command"]),
        ("finish zsh", ["\"finish\"", "command"]),
        ("chek --once", ["\"chek\"", "`check`"]),
        ("--once compar", ["\"compar\"", "`compare`"]),
    ] {
        let stderr = dir.expect(call, 2);
        assert_mentions(&stderr, &facts);
        assert_eq!(stderr.lines().count(), 1, "{call}: {stderr}");
    }
    // A word that could be a file is reported as a missing file.
    for call in ["room.toml --once", "./schema --once", "scenes/schema --once"] {
        assert_mentions(&dir.expect(call, 2), &[SCENE_NOT_FOUND]);
    }
    // Without `--once`, the same error appears before the screen opens.
    let stderr = dir.expect("bal.toml", 2);
    assert_mentions(&stderr, &[SCENE_NOT_FOUND, "ball.toml"]);
    for (call, fact) in [
        ("nofolder/x.toml", "nofolder"),
        ("./nofolder/deep/x.toml --once", "./nofolder/deep"),
        ("check nofolder/x.toml", "nofolder"),
        ("quite-another-name.toml", "`glimt new FILE`"),
    ] {
        assert_mentions(&dir.expect(call, 2), &[SCENE_NOT_FOUND, fact]);
    }
    dir.write("paint", SCENE);
    dir.expect("paint --once -o a.png", 0);
}

/// Tests only modes that do not wait for the file to become a scene.
#[test]
fn images_as_scenes_are_rejected_with_info() {
    let dir = TestDir::new();
    dir.write("ball.toml", SCENE);
    dir.expect("ball.toml --once -o a.png -o b.exr -o c.hdr -o d.jpg -o e.webp -o f.ppm", 0);
    dir.expect("ball.toml --once -o h.part --shard 1/2", 0);
    fs::rename(dir.path("a.png"), dir.path("a.toml")).expect("renamed");
    dir.write("g.gif", "GIF89a");
    dir.write("i.bmp", b"BM\x46\0\0\0\0\0\0\0\x36");
    dir.write("j.tif", b"II*\0");
    let mut tga = [0; 18];
    (tga[2], tga[12], tga[14], tga[16]) = (2, 4, 4, 24);
    dir.write("k.tga", tga);
    dir.write("l.pgm", "P2\n1 1\n255\n7\n");
    for (file, content) in [
        ("i.bmp", "(BMP)"),
        ("j.tif", "(TIFF)"),
        ("k.tga", "(TGA)"),
        ("l.pgm", "(PPM)"),
        ("a.toml", "(PNG)"),
        ("b.exr", "(EXR)"),
        ("c.hdr", "(HDR)"),
        ("d.jpg", "(JPEG)"),
        ("e.webp", "(WebP)"),
        ("f.ppm", "(PPM)"),
        ("g.gif", "(GIF)"),
        ("h.part", "checkpoint"),
    ] {
        for call in [file.to_owned(), format!("{file} --once"), format!("check {file}")] {
            let stderr = dir.expect(&call, 2);
            assert_mentions(&stderr, &[content]);
            // The output of `info` follows the error message.
            let info = dir.glimt(&format!("info {file}")).output().expect("it runs");
            let info = [info.stdout, info.stderr].concat();
            let info = String::from_utf8_lossy(&info).replace("error: ", "");
            assert!(!info.is_empty() && stderr.ends_with(&info), "{call}: {stderr}\n{info}");
        }
        let lines = dir.expect(&format!("{file} --once --progress json"), 2);
        let lines: Vec<_> = lines.lines().collect();
        let [line] = lines.as_slice() else { panic!("{lines:?}") };
        let line: serde_json::Value = serde_json::from_str(line).expect("JSON");
        assert_eq!((&line["event"], &line["kind"]), (&"failed".into(), &"scene".into()));
        assert_eq!(line["diagnostics"].as_array().map(Vec::len), Some(1));
        assert_eq!(line["image"]["path"].as_str(), Some(file).filter(|file| *file != "g.gif"), "{line}");
    }
}

/// Checks the fix that is suggested when too many thread stacks exceed the memory limit.
#[cfg(target_os = "linux")]
#[test]
fn thread_failure_message_suggests_a_fix() {
    let dir = TestDir::new();
    let glimt = dir.glimt("");
    let mut shell = std::process::Command::new("sh");
    let line = "ulimit -v 2000000; exec \"$0\" ball.toml --once --threads 3000 --progress none";
    shell.args(["-c", line]).arg(glimt.get_program()).current_dir(dir.0.path());
    let output = shell.output().expect("it runs");
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    let words = "out of memory: cannot start 3000 threads; use fewer (--threads 1), or raise the memory limit (`ulimit -v`)";
    assert_eq!(stderr, format!("error: {words}\n"));
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn dash_is_standard_output() {
    let dir = TestDir::new();
    let output = dir.run("ball.toml --once --report - --progress none");
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), b"".as_slice()));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["image"]["path"], "ball.png");
    let (mut ours, theirs) = UnixStream::pair().expect("a socket");
    let mut command = dir.glimt("ball.toml --once --report - --progress none");
    let mut child = command.stdout(OwnedFd::from(theirs)).spawn().expect("it runs");
    // Close this process's copy of the child's end.
    drop(command);
    let mut report = String::new();
    ours.read_to_string(&mut report).expect("a report");
    assert!(child.wait().expect("it ends").success() && report.starts_with('{'), "{report}");
    for (call, facts) in [
        ("ball.toml --report -", ["--report -", "--once"]),
        ("ball.toml --once -o -", ["-", ".png, .exr"]),
        ("bench ball.toml --csv -", ["--csv -", "tables"]),
        ("bench ball.toml --json -", ["--json -", "tables"]),
        ("bench ball.toml --plot -", ["-", ".svg"]),
        ("compare ball.png ball.png --diff -", ["-", ".png, .exr"]),
    ] {
        assert_mentions(&dir.expect(call, 2), &facts);
    }
    assert_eq!(names(&dir), ["ball.png", "ball.toml"]);
    // With a path, `-` is an ordinary file name.
    dir.expect("ball.toml --once --report ./-", 0);
    assert!(dir.bytes("-").starts_with(b"{"));
}

#[test]
fn signal_interrupts_a_blocked_report() {
    let dir = TestDir::new();
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    fcntl(&writer, FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).expect("set");
    while writer.write(&[0; 4096]).is_ok() {}
    fcntl(&writer, FcntlArg::F_SETFL(OFlag::empty())).expect("set");
    let mut command = dir.glimt("ball.toml --once --report - --progress none");
    let mut child = command.stdout(writer).stderr(Stdio::piped()).spawn().expect("it runs");
    // The image is written before the report.
    dir.await_file("ball.png", &mut child);
    kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).expect("it runs");
    let output = child.wait_with_output().expect("it ends");
    drop(reader);
    let stderr = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(130), "{stderr}");
    assert_mentions(&stderr, &["error", "report", "SIGINT", "ball.png"]);
    assert_eq!(stderr.lines().count(), 2, "{stderr}");
}

#[test]
fn full_device_fails_but_closed_pipe_does_not() {
    let dir = TestDir::new();
    for seed in [1, 2] {
        dir.expect(&format!("ball.toml --once --progress none --seed {seed} -o {seed}.exr"), 0);
    }
    let bench = "bench ball.toml --samples 1 --reference-samples 4 --seeds 1 --no-cache --integrator path --progress none";
    for line in [
        "new -",
        "check ball.toml",
        "compare 1.exr 2.exr",
        "compare 1.exr 2.exr --json",
        bench,
        "--help",
        "--version",
        "check --help",
        "ball.toml --once --progress none --report -",
    ] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").expect("a device");
        let output = dir.glimt(line).stdout(full).output().expect("it runs");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(1), "{line}: {stderr}");
        assert_mentions(&stderr, &[&system_error(Errno::ENOSPC)]);
        assert_eq!(stderr.lines().count(), 1, "{line}: {stderr}");
        let mut process = dir.glimt(line);
        let mut child = process.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        let is_report = line.contains("--report");
        let stderr = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(
            (output.status.code(), stderr.is_empty()),
            (Some(i32::from(is_report)), !is_report),
            "{line}: {stderr}"
        );
    }
}

#[test]
fn help_fits_and_lists_every_option() {
    let dir = TestDir::new();
    for line in ["--help", "-h", "check --help", "new --help"] {
        let output = dir.run(line);
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        let longest = text.lines().map(|line| line.chars().count()).max().expect("lines");
        assert!(longest <= 100, "{line}: {longest}\n{text}");
        assert!(output.stderr.is_empty() && !text.contains('\u{1b}'));
    }
    let text = String::from_utf8(dir.run("--help").stdout).expect("UTF-8");
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let formats = "The extension determines the format: png, exr, hdr, jpg, ppm, webp; with --turntable also gif, apng.";
    assert!(words.contains(formats), "{text}");
    for option in [
        "--once",
        "--output",
        "--report",
        "--width",
        "--height",
        "--samples",
        "--time",
        "--crop",
        "--view",
        "--seed",
        "--integrator",
        "--max-depth",
        "--shadows",
        "--clamp",
        "--photons",
        "--dof",
        "--accel",
        "--threads",
        "--progress",
        "--preview",
        "--color",
        "--bit-depth",
        "--set",
    ] {
        assert!(text.contains(option), "{option}");
    }
}

#[test]
fn progress_and_color_options_take_effect() {
    let dir = room();
    let plain = dir.expect("room.toml --once --progress plain", 0);
    let stages: Vec<&str> = plain.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(
        stages.starts_with(&["parse", "meshes", "textures", "accel", "lights", "photons", "render"]),
        "{plain}"
    );
    assert_eq!(plain, plain.trim_start(), "{plain}");
    dir.write("room.toml", ROOM.replace("radius = 0.5", "radius = 0"));
    assert!(!dir.expect("room.toml --once --progress none", 2).is_empty(), "only errors must be printed");
    let colored = dir.run("room.toml --once --color truecolor");
    assert!(String::from_utf8_lossy(&colored.stderr).contains("\u{1b}["));
    assert!(!dir.expect("room.toml --once --color none", 2).contains('\u{1b}'));
}

#[test]
fn failed_stages_are_not_reported_as_loaded() {
    let dir = TestDir::new();
    dir.write("bad.obj", "v 0 0 0\n");
    dir.write("ball.toml", format!("{SCENE}\n[[mesh]]\nfile = \"bad.obj\"\nmaterial = \"ball\"\n"));
    let stderr = dir.expect("ball.toml --once --progress plain", 2);
    assert!(!stderr.contains("loaded") && stderr.contains("1 failed"), "{stderr}");
}

#[test]
fn closed_streams_are_tolerated() {
    let dir = TestDir::new();
    for line in
        ["--help", "--version", "check ball.toml", "ball.toml --once", "missing.toml --once", "--nonsense"]
    {
        let mut child =
            dir.glimt(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it runs");
        drop((child.stdout.take(), child.stderr.take()));
        let code = child.wait().expect("it ends").code();
        let expected = if ["missing.toml --once", "--nonsense"].contains(&line) { 2 } else { 0 };
        assert_eq!(code, Some(expected), "{line}");
    }
    // A panic would be printed to the remaining stream.
    let mut child =
        dir.glimt("check ball.toml").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs");
    drop(child.stdout.take());
    let mut said = String::new();
    child.stderr.take().expect("piped").read_to_string(&mut said).expect("UTF-8");
    child.wait().expect("it ends");
    assert_eq!(said, "");
}

#[test]
fn image_does_not_depend_on_accel() {
    let dir = TestDir::new();
    for scene in ["mesh", "textures", "orbiter"] {
        let path = format!("{}/scenes/{scene}.toml", env!("CARGO_MANIFEST_DIR"));
        let [boxes, pieces, planes] = ["bvh", "bvh-high", "kdtree"].map(|accel| {
            let size = "--width 96 --height 64 --samples 2 --bit-depth 16";
            let report = dir.report(&format!("{path} {size} --accel {accel} -o {accel}.png"));
            assert_eq!(report["settings"]["accel"], accel);
            let file = fs::File::open(dir.path(&format!("{accel}.png"))).expect("a picture");
            let mut reader = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
            let mut pixels = vec![0; reader.output_buffer_size().expect("a size")];
            reader.next_frame(&mut pixels).expect("pixels");
            pixels
        });
        assert!(boxes.iter().any(|&byte| byte != boxes[0]), "{scene}: the image is uniform");
        assert!(boxes == planes && boxes == pieces, "{scene}");
    }
}

#[test]
fn warnings_name_the_responsible_setting() {
    let dir = room();
    let lit = format!("{ROOM}\n[[light]]\n");
    dir.write("room.toml", &lit);
    let call = "room.toml --once -o picture.ppm --progress none";
    for (options, setting) in
        [("--integrator path", "`--integrator path`"), ("--set render.integrator=path", "--> --set:1:21")]
    {
        let stderr = dir.expect(&format!("{call} {options}"), 0);
        assert_mentions(&stderr, &["warning", "path", "[[light]]", setting]);
        assert!(!stderr.contains("room.toml"), "{options}: {stderr}");
    }
    let stderr = dir.expect(&format!("{call} --integrator path --clamp 2 --set camera.fov=50"), 0);
    assert_mentions(&stderr, &["warning", "`--clamp 2`"]);
    let stderr = dir.expect(&format!("{call} --view photons"), 0);
    assert_mentions(&stderr, &["warning", "`--view photons`"]);
    dir.write("room.toml", lit.replace("seed = 3\n", "seed = 3\nintegrator = \"path\"\nclamp = 2\n"));
    let stderr = dir.expect(call, 0);
    assert!(stderr.contains("--> room.toml:6:14") && stderr.contains("--> room.toml:7:9"), "{stderr}");
    let stderr = String::from_utf8(dir.run("check room.toml").stderr).expect("UTF-8");
    assert!(stderr.contains("--> room.toml:6:14") && stderr.contains("--> room.toml:7:9"), "{stderr}");
}

#[test]
fn point_light_through_rough_glass_warns() {
    let dir = TestDir::new();
    let point = "position = [0, 3, 0]";
    let sun = |angle: &str| format!("type = \"directional\"\ndirection = [0, -1, 0]\nangle = {angle}");
    for (ior, light, is_warned) in
        [("1", point, true), ("1.5", point, false), ("1", &sun("0"), true), ("1", &sun("3"), false)]
    {
        let ball = format!(
            "render = {{ integrator = \"path\" }}\ncamera = {{ position = [0, 1, 4], look_at = [0, 0, 0] }}\n\
             [materials.g]\ntype = \"glass\"\nior = {ior}\nroughness = 0.5\n[[sphere]]\nmaterial = \"g\"\n\
             center = [0, 0, 0]\nradius = 1\n[[light]]\n{light}\n"
        );
        dir.write("ball.toml", ball);
        let stderr = String::from_utf8(dir.run("check ball.toml").stderr).expect("UTF-8");
        assert_eq!(mentions(&stderr, "[[light]]"), is_warned, "{ior}, {light}: {stderr}");
    }
}
