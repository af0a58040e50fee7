//! Parts of an image. Merged parts are bit-identical to a single render. Mismatched parts are rejected, and
//! nothing is written.

use std::fs;

use nix::errno::Errno;

use crate::test_dir::{TestDir, assert_mentions, mentions, system_error};

/// A scene that exercises every method: an area light, a mirror that reflects it, and a textured floor.
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

/// A directory with the scene.
pub(crate) fn room_dir() -> TestDir {
    let dir = TestDir::new();
    dir.write("room.toml", ROOM);
    dir.write("step.obj", STEP);
    dir.write("tiles.ppm", TILES);
    dir
}

#[test]
fn output_never_replaces_unrelated_parts() {
    let dir = room_dir();
    let first = "room.toml --once --progress none -o out.part --samples 2 --shard 1/2";
    dir.expect(first, 0);
    let part = dir.bytes("out.part");
    let said = dir.expect("room.toml --once --progress none --samples 2 -o out.part --shard 2/2", 2);
    assert_mentions(&said, &["out.part", "1/2", "--force"]);
    assert!(dir.bytes("out.part") == part);
    // The same part may be replaced, even with a different number of parts.
    dir.expect("room.toml --once --progress none -o out.part --samples 2 --shard 1/3", 0);
    dir.expect(first, 0);
    // An image replaces neither a part nor a checkpoint.
    fs::rename(dir.path("out.part"), dir.path("out.exr")).expect("moved");
    let said = dir.expect("room.toml --once --progress none -o out.exr --samples 2", 2);
    assert_mentions(&said, &["out.exr", "1/2", "--force"]);
    let keep = "room.toml --once --progress none -o kept.exr --samples 2 --keep-checkpoint";
    dir.expect(keep, 0);
    fs::rename(dir.path("kept.exr.checkpoint"), dir.path("kept.exr")).expect("moved");
    let said = dir.expect(keep, 2);
    assert_mentions(&said, &["kept.exr", "checkpoint", "--force"]);
    dir.expect(&format!("{keep} --force"), 0);
}

/// Methods with their options.
pub(crate) const METHODS: [(&str, &str); 5] = [
    ("whitted", "--samples 3"),
    ("path", "--integrator path --samples 5"),
    ("error", "--integrator path --samples 128 --error 0.15"),
    ("photons", "--photons on --samples 256 --width 33 --height 20 --set photons.count=100"),
    ("negative lobes", "--photons on --samples 37 --set photons.count=100 --set render.filter=mitchell"),
];

/// Renders all parts. Returns their names in reverse order.
fn parts(dir: &TestDir, count: u32, options: &str) -> Vec<String> {
    let name = |index: u32| format!("{index}.part");
    for index in 1..=count {
        let part = name(index);
        dir.expect(
            &format!("room.toml --once --progress none -o {part} --shard {index}/{count} {options}"),
            0,
        );
    }
    (1..=count).rev().map(name).collect()
}

#[test]
fn parts_in_any_order_match_single_render() {
    let dir = room_dir();
    for (method, options) in METHODS {
        dir.expect(&format!("room.toml --once --progress none -o one.exr -o one.png {options}"), 0);
        for count in [2, 3, 8, 64] {
            let mut names = parts(&dir, count, options);
            // Shuffle the parts.
            names.rotate_left(count as usize / 3);
            names.swap(0, 1);
            for picture in ["exr", "png"] {
                dir.expect(&format!("merge joined.{picture} {} --progress none", names.join(" ")), 0);
                let (joined, one) =
                    (dir.bytes(&format!("joined.{picture}")), dir.bytes(&format!("one.{picture}")));
                assert!(joined == one, "{method}: {count} parts, {picture}");
            }
        }
    }
}

#[test]
fn merged_image_metadata_matches_a_render() {
    let dir = room_dir();
    for folder in ["a", "b", "out"] {
        fs::create_dir(dir.path(folder)).expect("made");
    }
    for ending in ["png", "exr"] {
        let call = "room.toml --once --progress none --samples 2";
        dir.expect(&format!("{call} -o out/one.{ending}"), 0);
        dir.expect(&format!("{call} -o a/1.part --shard 1/2"), 0);
        dir.expect(&format!("{call} -o b/2.part --shard 2/2"), 0);
        dir.expect(&format!("merge out/two.{ending} a/1.part b/2.part --progress none"), 0);
        assert!(
            dir.bytes(&format!("out/one.{ending}")) == dir.bytes(&format!("out/two.{ending}")),
            "{ending}"
        );
    }
}

/// Checks that tiles stop at different sample counts. Otherwise, the `error` case would test nothing.
#[test]
fn noise_target_stops_some_tiles_early() {
    let dir = room_dir();
    let report = dir.report(&format!("room.toml {} -o a.png", METHODS[2].1));
    let samples = &report["image"]["samples"];
    assert!(samples["min"].as_u64() < samples["max"].as_u64(), "{samples}");
    let photons = dir.report(&format!("room.toml {} -o a.png --force", METHODS[3].1));
    assert!(photons["photons"]["emitted"].as_u64() > Some(0));
}

#[test]
fn views_and_crops_are_merged() {
    let dir = room_dir();
    for options in [
        "--view samples --samples 64 --error 0.2",
        "--view error --samples 8",
        "--view depth",
        "--crop 7,3,50,41 --samples 32 --error 0.2 --bit-depth 16 --set render.exposure=1",
    ] {
        dir.expect(&format!("room.toml --once --progress none -o one.png {options}"), 0);
        let names = parts(&dir, 3, options);
        dir.expect(&format!("merge joined.png {} --progress none", names.join(" ")), 0);
        assert!(dir.bytes("joined.png") == dir.bytes("one.png"), "{options}");
    }
}

#[test]
fn mismatched_parts_are_rejected() {
    let dir = room_dir();
    let names = parts(&dir, 3, "");
    dir.write("joined.png", "the picture before");
    let refused = |line: &str, facts: &[&str]| {
        let said = dir.expect(&format!("merge joined.png {line} --progress none"), 2);
        assert_mentions(&said, facts);
        assert_eq!(dir.bytes("joined.png"), b"the picture before", "{line}");
        said
    };
    refused("1.part 3.part", &["1 of 3", "missing", "2/3"]);
    refused("1.part 2.part 2.part 3.part", &["2.part", "2/3"]);
    refused("1.part 2.part none.part", &["none.part"]);
    refused("1.part 2.part room.toml", &["room.toml", "part"]);
    let other = |options: &str, facts: &[&str]| {
        dir.expect(&format!("room.toml --once --progress none -o other.part {options}"), 0);
        refused("1.part other.part 3.part", facts)
    };
    let said = other("--shard 2/3 --view depth", &["view", "depth", "beauty"]);
    assert_eq!(said.matches("view").count(), 1, "{said}");
    other("--shard 2/3 --seed 7", &["seed", "7", "0"]);
    other("--shard 2/3 --samples 4", &["samples", "4", "3"]);
    other("--shard 2/3 --integrator path", &["integrator", "path", "whitted"]);
    other("--shard 2/3 --set render.exposure=1", &["exposure", "1", "0"]);
    other("--shard 2/3 --set sphere.1.radius=0.4", &["shapes", "materials", "lights", "camera"]);
    other("--shard 2/4", &["4", "3"]);
    dir.write("step.obj", STEP.replace("0.9", "0.8"));
    other("--shard 2/3", &["step.obj"]);
    dir.write("step.obj", STEP);
    dir.write("tiles.ppm", TILES.replace("200", "201"));
    other("--shard 2/3", &["tiles.ppm"]);
    dir.write("tiles.ppm", TILES);
    // Parts rendered from the same files in another folder match.
    fs::create_dir(dir.path("away")).expect("a folder");
    for (name, text) in [("room.toml", ROOM), ("step.obj", STEP), ("tiles.ppm", TILES)] {
        dir.write(&format!("away/{name}"), text);
    }
    dir.expect("away/room.toml --once --progress none -o other.part --shard 2/3", 0);
    dir.expect("merge away.png 1.part other.part 3.part --progress none", 0);
    // All damaged parts are reported.
    let whole = dir.bytes("2.part");
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    dir.write("flipped.part", flipped);
    dir.write("cut.part", &whole[..whole.len() - 100]);
    let said = refused("1.part flipped.part cut.part", &["flipped.part", "cut.part"]);
    assert_eq!(said.matches("damaged").count(), 2, "{said}");
    let mut newer = whole;
    newer[12] = 9;
    dir.write("newer.part", newer);
    refused("1.part newer.part 3.part", &["newer.part", "version 9"]);
    // A part is never overwritten with an image, regardless of its name.
    let said = dir.expect("merge 1.part 2.part 3.part --progress none", 2);
    assert!(said.contains("1.part"), "{said}");
    fs::copy(dir.path("1.part"), dir.path("1.png")).expect("copied");
    let said = dir.expect("merge 1.png 2.part 3.part --progress none", 2);
    assert_mentions(&said, &["1.png", "part"]);
    assert_eq!(dir.bytes("1.png"), dir.bytes("1.part"));
    dir.expect("compare 1.png away.png", 2);
    // The image must be the first argument.
    let said = dir.expect("merge 1.part 2.part 3.part out.png --progress none", 2);
    assert!(mentions(&said, "1.part") && !dir.path("out.png").exists(), "{said}");
    // If the image is named twice, the second argument counts as a part.
    fs::copy(dir.path("away.png"), dir.path("twice.png")).expect("copied");
    for name in ["twice.png", "nowhere.png"] {
        let said = dir.expect(&format!("merge {name} ./{name} 2.part 3.part --progress none"), 2);
        assert!(said.starts_with("error: ") && mentions(&said, name), "{said}");
    }
    assert_eq!(names.len(), 3);
}

#[test]
fn merge_never_replaces_a_source_file() {
    let dir = room_dir();
    parts(&dir, 2, "");
    // A copy of a source file, as if the parts were rendered on another machine.
    fs::create_dir(dir.path("elsewhere")).expect("a folder");
    fs::copy(dir.path("tiles.ppm"), dir.path("elsewhere/copy.ppm")).expect("copied");
    for name in ["tiles.ppm", "elsewhere/copy.ppm"] {
        for options in ["", "--watch"] {
            let said = dir.expect(&format!("merge {name} 1.part 2.part {options} --progress none"), 2);
            assert_mentions(&said, &[name, "(tiles.ppm)"]);
            assert_eq!(dir.bytes(name), TILES.as_bytes());
        }
    }
    // A source file that has changed or is missing.
    for content in [Some("P3 1 1 255 9 9 9\n"), None] {
        match content {
            Some(text) => dir.write("tiles.ppm", text),
            None => fs::remove_file(dir.path("tiles.ppm")).expect("removed"),
        };
        for name in ["tiles.ppm", "elsewhere/../tiles.ppm"] {
            let said = dir.expect(&format!("merge {name} 1.part 2.part --progress none"), 2);
            assert_mentions(&said, &[name, "(tiles.ppm)"]);
            let left = fs::read_to_string(dir.path("tiles.ppm")).ok();
            assert_eq!(left.as_deref(), content);
        }
    }
    dir.expect("merge joined.ppm 1.part 2.part --progress none", 0);
}

#[test]
fn merge_never_replaces_an_unread_input() {
    let dir = room_dir();
    dir.write("unused.ppm", "P3 1 1 255 9 9 9\n");
    dir.write("step.mtl", "newmtl a\nKd 1 0 0\n");
    dir.write("step.obj", format!("mtllib step.mtl\n{STEP}"));
    dir.write(
        "room.toml",
        ROOM.replace("[textures.tiles]", "[textures.u]\nfile = \"unused.ppm\"\n[textures.tiles]"),
    );
    std::os::unix::fs::symlink("room.toml", dir.path("latest.ppm")).expect("a link");
    std::os::unix::fs::symlink("step.mtl", dir.path("step.ppm")).expect("a link");
    // The depth view needs no textures, so the parts do not record them.
    parts(&dir, 2, "--view depth");
    let inputs = ["tiles.ppm", "unused.ppm", "room.toml", "step.mtl"];
    let before = inputs.map(|name| dir.bytes(name));
    for (name, input) in [
        ("tiles.ppm", "(tiles.ppm)"),
        ("unused.ppm", "(unused.ppm)"),
        ("latest.ppm", "(room.toml)"),
        ("step.ppm", "(step.mtl)"),
    ] {
        for options in ["", "--watch", "--partial"] {
            let said = dir.expect(&format!("merge {name} 1.part 2.part {options} --progress none"), 2);
            assert_mentions(&said, &[name, input]);
        }
    }
    assert!(inputs.map(|name| dir.bytes(name)) == before);
}

/// Files referenced only by an option, and the files of a mesh that does not parse.
#[test]
fn merge_never_replaces_an_unread_option_input() {
    let dir = room_dir();
    fs::create_dir_all(dir.path("common")).expect("a folder");
    let image = "P3 1 1 255 9 9 9\n";
    for name in ["other.ppm", "common/far.ppm"] {
        dir.write(name, image);
    }
    dir.write(
        "room.toml",
        ROOM.replace("[textures.tiles]", "[textures.u]\nfile = \"tiles.ppm\"\n[textures.tiles]"),
    );
    for (file, out) in [("other.ppm", "other.ppm"), ("common/../common/far.ppm", "common/far.ppm")] {
        parts(&dir, 2, &format!("--view depth --set textures.u.file=\"{file}\" --force"));
        let said = dir.expect(&format!("merge {out} 1.part 2.part --progress none"), 2);
        assert_mentions(&said, &[out]);
        assert_eq!(dir.bytes(out), image.as_bytes());
        dir.expect("merge free.ppm 1.part 2.part --progress none", 0);
    }
}

#[test]
fn merge_of_moved_parts_never_replaces_an_input() {
    let dir = room_dir();
    for folder in ["elsewhere", "q"] {
        fs::create_dir(dir.path(folder)).expect("a folder");
    }
    dir.write("new.ppm", TILES);
    parts(&dir, 2, "--view depth");
    for part in ["1.part", "2.part"] {
        fs::rename(dir.path(part), dir.path("elsewhere").join(part)).expect("moved");
    }
    // The scene's reference to this texture was added after the parts were rendered.
    dir.write(
        "room.toml",
        ROOM.replace("[textures.tiles]", "[textures.u]\nfile = \"new.ppm\"\n[textures.tiles]"),
    );
    for name in ["tiles.ppm", "new.ppm"] {
        for out in [name.to_owned(), format!("q/../{name}")] {
            let said =
                dir.expect(&format!("merge {out} elsewhere/1.part elsewhere/2.part --progress none"), 2);
            assert_mentions(&said, &[&out, &format!("({name})")]);
            assert_eq!(dir.bytes(name), TILES.as_bytes());
        }
    }
}

#[test]
fn merge_protects_textures_of_a_mesh_with_errors() {
    let dir = room_dir();
    let image = "P3 1 1 255 9 9 9\n";
    dir.write("late.ppm", image);
    parts(&dir, 2, "--view depth");
    // The mesh's reference to this texture was added after the parts were rendered.
    dir.write("step.mtl", "newmtl a\nKd one\nmap_Kd late.ppm\n");
    dir.write("step.obj", format!("mtllib step.mtl\n{STEP}f 1 2 9\n"));
    let said = dir.expect("merge late.ppm 1.part 2.part --progress none", 2);
    assert_mentions(&said, &["late.ppm", "(late.ppm)"]);
    assert_eq!(dir.bytes("late.ppm"), image.as_bytes());
}

#[test]
fn partial_option_merges_existing_parts() {
    let dir = room_dir();
    dir.expect("room.toml --once --progress none -o one.exr", 0);
    parts(&dir, 4, "");
    let said = dir.expect("merge some.exr 4.part 1.part none.part --partial", 0);
    assert_mentions(&said, &["warning", "2 of 4", "2/4, 3/4"]);
    let said = dir.expect("merge all.exr 4.part 3.part 2.part 1.part --partial", 0);
    assert!(!said.contains("missing"), "{said}");
    assert!(dir.bytes("all.exr") == dir.bytes("one.exr") && dir.bytes("some.exr") != dir.bytes("one.exr"));
    // With photons, a partial merge has fewer passes.
    parts(&dir, 2, "--photons on --samples 32 --set photons.count=100");
    dir.expect("merge half.exr 1.part --partial --progress none", 0);
    dir.expect("merge half.exr 1.part --progress none", 2);
}

#[test]
fn watching_merge_waits_for_missing_parts() {
    let dir = room_dir();
    dir.expect("room.toml --once --progress none -o one.exr", 0);
    parts(&dir, 2, "");
    fs::rename(dir.path("2.part"), dir.path("later")).expect("renamed");
    let mut waiting = dir.glimt("merge joined.exr 1.part 2.part --watch --progress none");
    let mut waiting = waiting.spawn().expect("it runs");
    std::thread::sleep(std::time::Duration::from_millis(300));
    assert!(waiting.try_wait().expect("a child").is_none(), "merged without the missing part");
    fs::rename(dir.path("later"), dir.path("2.part")).expect("renamed");
    assert!(waiting.wait().expect("a child").success());
    assert!(dir.bytes("joined.exr") == dir.bytes("one.exr"));
    dir.expect("room.toml --once --progress none -o other.part --shard 2/2 --seed 3", 0);
    let said = dir.expect("merge joined.exr 1.part other.part none.part --watch --progress plain", 2);
    assert_mentions(&said, &["other.part", "seed", "3", "0"]);
}

#[test]
fn watching_merge_waits_for_incomplete_parts() {
    let dir = room_dir();
    dir.expect("room.toml --once --progress none -o one.exr", 0);
    parts(&dir, 2, "");
    let whole = dir.bytes("2.part");
    for progress in ["plain", "json"] {
        dir.write("2.part", "");
        let mut merge = dir.glimt(&format!("merge joined.exr 1.part 2.part --watch --progress {progress}"));
        let mut waiting = merge.stderr(std::process::Stdio::piped()).spawn().expect("it runs");
        for length in [0, 7, 100, whole.len() / 2, whole.len() - 1] {
            dir.write("2.part", &whole[..length]);
            std::thread::sleep(std::time::Duration::from_millis(600));
            assert!(waiting.try_wait().expect("a child").is_none(), "merged with {length} bytes of a part");
        }
        dir.write("2.part", &whole);
        let output = waiting.wait_with_output().expect("a child");
        let said = String::from_utf8(output.stderr).expect("UTF-8");
        assert!(output.status.success(), "{said}");
        let words = match progress {
            "plain" => "1 of 2 parts; 2.part",
            _ => r#""unfinished":["2.part"]"#,
        };
        assert_eq!(said.matches(words).count(), 1, "{said}");
        assert!(dir.bytes("joined.exr") == dir.bytes("one.exr"));
        fs::remove_file(dir.path("joined.exr")).expect("removed");
    }
    // Waiting cannot repair a damaged part.
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    dir.write("2.part", flipped);
    let said = dir.expect("merge joined.exr 1.part 2.part --watch --progress none", 2);
    assert_mentions(&said, &["2.part", "damaged"]);
    // Without --watch, an incomplete part is an error.
    dir.write("2.part", &whole[..whole.len() - 1]);
    let said = dir.expect("merge joined.exr 1.part 2.part --progress none", 2);
    assert_mentions(&said, &["2.part", "damaged", &format!("byte {}", whole.len() - 1)]);
    assert!(!dir.path("joined.exr").exists());
}

/// Runs the program as an unprivileged user, because root may write to any file.
#[test]
fn merge_replaces_the_same_files_as_a_render() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
    use std::os::unix::process::CommandExt;
    let dir = room_dir();
    parts(&dir, 2, "");
    let program = dir.program();
    let is_root = fs::metadata(dir.0.path()).expect("a folder").uid() == 0;
    fs::set_permissions(dir.0.path(), fs::Permissions::from_mode(0o777)).expect("permitted");
    let said = |line: &str| {
        let mut process = std::process::Command::new(&program);
        process.current_dir(dir.0.path()).args(line.split_whitespace());
        if is_root {
            process.uid(65534).gid(65534);
        }
        let output = process.output().expect("it runs");
        (output.status.code(), String::from_utf8(output.stderr).expect("UTF-8"))
    };
    let calls = ["merge NAME 1.part 2.part --progress none", "room.toml --once --progress none -o NAME"];
    for call in calls {
        let (kept, target) = (dir.path("kept.png"), dir.path("target.png"));
        for path in [&kept, &target] {
            fs::write(path, "the image before").expect("written");
            fs::set_permissions(path, fs::Permissions::from_mode(0o666)).expect("permitted");
        }
        let _ = fs::remove_file(dir.path("link.png"));
        symlink("target.png", dir.path("link.png")).expect("a link");
        // A write-protected file is kept.
        fs::set_permissions(&kept, fs::Permissions::from_mode(0o444)).expect("permitted");
        let (code, text) = said(&call.replace("NAME", "kept.png"));
        assert_eq!(code, Some(1), "{call}: {text}");
        assert_mentions(&text, &["kept.png", &system_error(Errno::EACCES)]);
        assert_eq!(fs::read(&kept).expect("a file"), b"the image before");
        // A link is kept, and its target is replaced.
        let (code, text) = said(&call.replace("NAME", "link.png"));
        assert_eq!(code, Some(0), "{call}: {text}");
        let link = dir.path("link.png").symlink_metadata().expect("a link");
        assert!(link.is_symlink() && fs::read(&target).expect("a file").starts_with(b"\x89PNG"), "{call}");
        let protected = fs::metadata(&target).expect("a file").mode() & 0o777;
        assert_eq!(protected, 0o666, "{call}");
        fs::remove_file(kept).expect("removed");
    }
}

#[test]
fn renders_that_cannot_be_split_are_rejected() {
    let dir = room_dir();
    for (line, facts) in [
        ("--once --shard 1/2", &["-o"][..]),
        ("--once --shard 1/2 -o a.part -o b.part", &["-o"]),
        ("--once --shard 1/2 -o a.part --time 3", &["--shard", "--time"]),
        ("--once --shard 1/2 -o a.part --photons on --error 0.1", &["photons", "noise"]),
        ("--once --shard 1/2 -o a.part --photons on --view error", &["photons", "`error`"]),
        ("--shard 1/2 -o a.part", &["--shard", "--once"]),
        ("--once --shard 3/2 -o a.part", &["--shard", "I/N"]),
    ] {
        let said = dir.expect(&format!("room.toml {line}"), 2);
        assert_mentions(&said, facts);
        assert!(!dir.path("a.part").exists());
    }
}

#[test]
fn scheduler_scripts_are_valid() {
    let dir = room_dir();
    for engine in ["slurm", "parallel", "kubernetes"] {
        let line = format!("farm room.toml -o out.exr --shards 4 --engine {engine} --host a -- --samples 9");
        let output = dir.run(&line);
        assert_eq!(output.status.code(), Some(0), "{engine}");
        let script = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(script.contains("--samples 9") && script.contains("merge"), "{script}");
        dir.write("script", &script);
        if engine != "kubernetes" {
            let mut shell = std::process::Command::new("sh");
            let is_sound = shell.current_dir(dir.0.path()).args(["-n", "script"]).status().expect("a shell");
            assert!(is_sound.success(), "{script}");
        }
    }
    let said = dir.expect("farm room.toml -o out.xyz --shards 4 --engine slurm", 2);
    assert_mentions(&said, &[".xyz", ".exr"]);
    let said = dir.expect("farm room.toml -o out.exr --shards 4 --engine slurm -- --sample 3", 2);
    assert_mentions(&said, &["`--`", "--sample"]);
    let mut process = dir.glimt("farm room.toml --shards 4 --engine slurm -o");
    let output = process.arg("a\u{1b}[31m.exr").output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        output.stdout.is_empty() && !said.contains('\u{1b}'),
        "control characters must be escaped: {said:?}"
    );
    let said = dir.expect("farm none.toml -o out.exr --shards 4 --engine slurm", 2);
    assert_mentions(&said, &["error:", "none.toml"]);
}

#[test]
fn memory_limit_rejects_large_renders() {
    let dir = room_dir();
    let said = dir.expect("room.toml --once -o a.png --width 9000 --height 9000 --memory 500MB", 1);
    assert_mentions(&said, &["GiB", "477 MiB", "--memory"]);
    assert!(!said.contains("render   "), "nothing must be rendered: {said}");
    dir.expect("room.toml --once -o a.png --memory 500MB", 0);
    let photons = "--photons on --set photons.count=4000000";
    let said = dir.expect(&format!("room.toml --once -o a.png {photons} --memory 500MB"), 1);
    assert_mentions(&said, &["photons", "`count`"]);
}
