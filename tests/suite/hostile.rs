//! Malformed files must be rejected quickly and with little memory. The result must be a clear error, exit
//! code 2, no output on stdout, and an unchanged previous image.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::Command as Process;
use std::time::{Duration, Instant};

use super::test_dir::{SCENE, TestDir, assert_mentions};

/// Time limit for rejecting a file. Rejection takes milliseconds, but reading the whole file would take
/// minutes.
const REJECTION_TIME_LIMIT: Duration = Duration::from_secs(60);

const MESH: &str = "\n[[mesh]]\nfile = \"FILE\"\nmaterial = \"ball\"\n";
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A scene that refers to `file`, with the line and column of the reference.
fn scene(file: &str) -> (String, &'static str) {
    let ending = Path::new(file).extension().and_then(|ending| ending.to_str());
    let (text, place) = match ending {
        Some("png" | "jpg" | "hdr" | "exr") => {
            let scene = SCENE.replace("[0.8, 0.2, 0.1]", "{ texture = \"t\" }");
            (format!("{scene}\n[textures.t]\nfile = \"FILE\"\n"), "25:8")
        }
        Some("txt") => {
            let camera = "position = [0, 1, 4]\nlook_at = [0, 1, 0]";
            (SCENE.replace(camera, "orbiter = \"FILE\""), "7:11")
        }
        _ => (format!("{SCENE}{MESH}"), "25:8"),
    };
    (text.replace("FILE", file), place)
}

/// Renders a scene, and checks that the error contains all expected words.
#[track_caller]
fn rejection_message(dir: &TestDir, scene: &str, words: &[&str]) -> String {
    dir.write("ball.png", "the old one");
    let start = Instant::now();
    let stderr = dir.expect(&format!("{scene} --once -o ball.png"), 2);
    assert!(start.elapsed() < REJECTION_TIME_LIMIT, "{scene}: {:?}", start.elapsed());
    for word in words {
        assert!(stderr.contains(word), "{scene}: {word:?} not found in\n{stderr}");
    }
    assert_eq!(dir.bytes("ball.png"), b"the old one", "{scene}");
    stderr
}

/// Creates something that is not a regular file. Returns words from the expected error, or `None` if this
/// system cannot create such a file.
fn make(path: &Path, what: &str) -> Option<&'static [&'static str]> {
    Some(match what {
        "missing" => &["not found"],
        "folder" => {
            fs::create_dir(path).expect("a folder");
            &["is a folder, not a"]
        }
        "pipe" => {
            nix::unistd::mkfifo(path, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
            &["is a pipe, a socket or a device, not a"]
        }
        "device" => {
            symlink("/dev/zero", path).expect("a link");
            &["is a pipe, a socket or a device, not a"]
        }
        "kernel" => {
            // Without this file, the link would be dangling.
            if !Path::new("/proc/kmsg").exists() {
                return None;
            }
            symlink("/proc/kmsg", path).expect("a link");
            &["is a kernel file, as in /proc, not a"]
        }
        "circle" => {
            symlink(path, path).expect("a link");
            &["its symbolic links form a loop"]
        }
        "dangling" => {
            symlink(path.with_file_name("nowhere"), path).expect("a link");
            &["is a symbolic link to a file that does not exist"]
        }
        "terabytes" => {
            // Some file systems do not support such large files.
            File::create(path).and_then(|file| file.set_len(5 << 40)).ok()?;
            &[]
        }
        "locked" => {
            fs::write(path, TRIANGLE).expect("written");
            fs::set_permissions(path, fs::Permissions::from_mode(0o0)).expect("locked");
            if File::open(path).is_ok() {
                return None; // the test runs as root
            }
            &["permission denied"]
        }
        _ => unreachable!("{what}"),
    })
}

const KINDS: [&str; 9] =
    ["missing", "folder", "pipe", "device", "kernel", "circle", "dangling", "terabytes", "locked"];

#[test]
fn scene_must_be_a_regular_file() {
    for what in KINDS {
        let dir = TestDir::new();
        if let Some(words) = make(&dir.path("bad.toml"), what) {
            let stderr = rejection_message(&dir, "bad.toml", words);
            assert!(stderr.contains("bad.toml"), "{what}: {stderr}");
        }
    }
}

#[test]
fn part_must_be_a_regular_file() {
    for what in ["folder", "pipe", "device", "kernel"] {
        let dir = TestDir::new();
        let Some(words) = make(&dir.path("1.part"), what) else { continue };
        for line in ["merge out.png 1.part", "merge --watch out.png 1.part"] {
            let stderr = dir.expect(line, 2);
            assert_eq!(
                stderr,
                format!("error: 1.part: it {} part or checkpoint\n", words[0]),
                "{what}: {line}"
            );
        }
    }
}

#[test]
fn asset_must_be_a_regular_file() {
    for what in KINDS {
        for ending in ["obj", "off", "ply", "png", "jpg", "hdr", "exr", "txt"] {
            let dir = TestDir::new();
            let file = format!("bad.{ending}");
            if let Some(words) = make(&dir.path(&file), what) {
                let (text, place) = scene(&file);
                dir.write("scene.toml", text);
                let stderr = rejection_message(&dir, "scene.toml", words);
                assert!(stderr.contains(&file), "{what}: {stderr}");
                assert_mentions(&stderr, &[&format!("scene.toml:{place}")]);
            }
        }
    }
}

#[test]
fn assets_with_wrong_contents_are_rejected() {
    let noise: Vec<u8> = (0..5000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let zeros = vec![0; 5000];
    for (ending, empty, wrong) in [
        ("obj", "the file is empty", "bad.obj:1: this is a binary file in another format"),
        ("off", "the file is empty", "bad.off:1: "),
        ("ply", "the file is empty", "bad.ply:1: "),
        ("stl", "the file is empty", "bad.stl:"),
        ("png", "the file is empty", "unsupported image format"),
        ("jpg", "the file is empty", "unsupported image format"),
        ("hdr", "the file is empty", "unsupported image format"),
        ("exr", "the file is empty", "unsupported image format"),
        ("txt", "missing line `s size radius`", "bad.txt:1: this is a binary file in another format"),
    ] {
        let dir = TestDir::new();
        let file = format!("bad.{ending}");
        let (text, place) = scene(&file);
        dir.write("scene.toml", text);
        let place = format!("scene.toml:{place}");
        dir.write(&file, "");
        rejection_message(&dir, "scene.toml", &[&file, empty, &place]);
        for bytes in [&noise, &zeros] {
            dir.write(&file, bytes);
            rejection_message(&dir, "scene.toml", &[wrong, &place]);
        }
        // Many zeros.
        let huge = File::create(dir.path(&file)).and_then(|file| file.set_len(1 << 27));
        huge.expect("a sparse file");
        rejection_message(&dir, "scene.toml", &[&file, &place]);
    }
}

#[test]
fn huge_and_binary_scenes_are_rejected() {
    let dir = TestDir::new();
    File::create(dir.path("huge.toml")).and_then(|file| file.set_len(1 << 30)).expect("a sparse file");
    rejection_message(&dir, "huge.toml", &["huge.toml", "larger than", "[[mesh]]"]);
    dir.write("latin.toml", SCENE.replace("[0.8, 0.2, 0.1]", "0.8 # caf\u{e9}").replace('\u{e9}', "@"));
    let latin: Vec<u8> =
        dir.bytes("latin.toml").iter().map(|&byte| if byte == b'@' { 0xe9 } else { byte }).collect();
    dir.write("latin.toml", latin);
    rejection_message(&dir, "latin.toml", &["latin.toml:12:20", "0xe9", "UTF-8"]);
    dir.write("deep.toml", format!("x = {}\n", "[".repeat(500_000)));
    rejection_message(&dir, "deep.toml", &["deep.toml:1:", "nested too deeply"]);
    dir.write("zeros.toml", [0; 999]);
    rejection_message(&dir, "zeros.toml", &["zeros.toml", "binary file"]);
}

/// Checks that a mesh is rejected with an error that contains the expected words and the mesh's position in
/// the scene.
#[track_caller]
fn mesh_refused(name: &str, content: &[u8], words: &[&str]) {
    let dir = TestDir::new();
    dir.write(name, content);
    dir.write("scene.toml", scene(name).0);
    let stderr = rejection_message(&dir, "scene.toml", words);
    assert!(stderr.contains("scene.toml:25:8") && stderr.contains(name), "{stderr}");
}

#[test]
fn unusable_meshes_are_rejected() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    mesh_refused("a.obj", format!("{vertices}f 1 2 4\n").as_bytes(), &["a.obj:4: "]);
    mesh_refused("a.obj", format!("{vertices}f 1 2 -4\n").as_bytes(), &["a.obj:4: "]);
    mesh_refused("a.obj", format!("{vertices}f 1 2 99999999999999999999\n").as_bytes(), &["a.obj:4: "]);
    mesh_refused("a.obj", format!("{vertices}f 1 2\n").as_bytes(), &["a.obj", "usable face"]);
    mesh_refused("a.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", &["no usable face", "finite"]);
    mesh_refused("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", &["a.off:6: "]);
    mesh_refused("a.off", b"OFF\n4000000000 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", &["a.off:", "4000000000"]);
    mesh_refused("a.off", b"OFF\n3 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", &["4000000000"]);
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let header = |vertices: u64, faces: u64| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
                 property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n"
            )
        };
        mesh_refused("a.ply", header(4_000_000_000, 1).as_bytes(), &["4000000000"]);
        mesh_refused(
            "a.ply",
            format!("{}{}", header(1, 4_000_000_000), "0 ".repeat(20)).as_bytes(),
            &["4000000000"],
        );
        mesh_refused("a.ply", header(u64::MAX, u64::MAX).as_bytes(), &["a.ply"]);
        mesh_refused("a.ply", header(1, 1).as_bytes(), &["a.ply"]);
    }
}

#[test]
fn unusable_faces_are_counted_and_skipped() {
    let dir = TestDir::new();
    let vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 1e999 1 1\n";
    dir.write("a.obj", format!("{vertices}f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 1 2\n"));
    dir.write("scene.toml", scene("a.obj").0);
    let stderr = dir.expect("scene.toml --once -o a.png", 0);
    for fact in ["warning: a.obj: ", " 2 faces ", " 1 face ", "scene.toml:25:8"] {
        assert!(stderr.contains(fact), "{fact}: {stderr}");
    }
    assert_eq!(dir.report("scene.toml -o a.png")["counters"]["triangles"], 1);
}

#[test]
fn unreadable_mtl_fails_only_if_it_is_used() {
    for what in KINDS {
        let dir = TestDir::new();
        let Some(_) = make(&dir.path("bad.mtl"), what) else { continue };
        dir.write("a.obj", format!("mtllib bad.mtl\n{TRIANGLE}"));
        let (text, _) = scene("a.obj");
        // No warning if the scene sets the mesh's material.
        dir.write("scene.toml", &text);
        let stderr = dir.expect("scene.toml --once -o a.png", 0);
        assert!(!stderr.contains("warning"), "{what}: {stderr}");
        // An error if the scene does not set it.
        dir.write("scene.toml", text.trim_end().trim_end_matches("material = \"ball\""));
        rejection_message(
            &dir,
            "scene.toml",
            &["needs `material`: a.obj has no", "cannot read bad.mtl", "scene.toml:24:1"],
        );
    }
}

#[test]
fn malformed_mtl_is_rejected() {
    for (content, words) in [
        ("\0\0\0", "bad.mtl:1: "),
        ("newmtl a\nKd 1 2\n", "bad.mtl:2: "),
        ("newmtl a\nNs nan\n", "bad.mtl:2: "),
    ] {
        let dir = TestDir::new();
        dir.write("bad.mtl", content);
        dir.write("a.obj", format!("mtllib bad.mtl\n{TRIANGLE}"));
        dir.write("scene.toml", scene("a.obj").0);
        rejection_message(&dir, "scene.toml", &[words, "scene.toml:25:8"]);
    }
}

#[test]
fn images_with_wrong_sizes_are_rejected() {
    let png = {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 60_000, 60_000);
        encoder.set_color(png::ColorType::Rgb);
        let _ = encoder.write_header().expect("a header").finish();
        bytes
    };
    for (name, content) in [
        ("a.png", png.as_slice()),
        ("a.ppm", b"P6\n16000 16000\n255\nabc".as_slice()),
        ("a.ppm", b"P6\n4000000000 4000000000\n255\nabc"),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16000 +X 16000\nabc"),
        ("a.bmp", b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\xff\xff\xff\x7f\xff\xff\xff\x7f\x01\0\x18\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"),
    ] {
        let dir = TestDir::new();
        dir.write(name, content);
        dir.write("scene.toml", scene("a.png").0.replace("a.png", name));
        rejection_message(&dir, "scene.toml", &[name, "scene.toml:25:8"]);
    }
}

#[test]
fn image_metadata_is_not_kept_in_memory() {
    const BOMB: usize = 256 << 20;
    type Add = fn(&mut png::Encoder<'_, &mut Vec<u8>>, String) -> Result<(), png::EncodingError>;
    let zeros = || "0".repeat(BOMB);
    let encoded = |info: png::Info<'static>, add: Option<Add>| {
        let mut file = Vec::new();
        let mut encoder = png::Encoder::with_info(&mut file, info).expect("an encoder");
        encoder.set_compression(png::Compression::Fast);
        if let Some(add) = add {
            add(&mut encoder, zeros()).expect("added");
        }
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(&[7]).expect("written");
        writer.finish().expect("written");
        file
    };
    let mut profiled = png::Info::with_size(1, 1);
    profiled.icc_profile = Some(zeros().into_bytes().into());
    let plain = || png::Info::with_size(1, 1);
    for (name, file) in [
        ("iCCP", encoded(profiled, None)),
        ("zTXt", encoded(plain(), Some(|encoder, text| encoder.add_ztxt_chunk("a".to_owned(), text)))),
        ("iTXt", encoded(plain(), Some(|encoder, text| encoder.add_itxt_chunk("a".to_owned(), text)))),
        ("tEXt", encoded(plain(), Some(|encoder, text| encoder.add_text_chunk("a".to_owned(), text)))),
    ] {
        let dir = TestDir::new();
        dir.write("a.png", file);
        dir.write("scene.toml", scene("a.png").0);
        // Use a shell, so that peak memory does not include the test process.
        let program = dir.glimt("").get_program().to_owned();
        let mut shell = Process::new("sh");
        let line = "\"$0\" scene.toml --once -o out.png --report report.json; exit $?";
        let status =
            shell.args(["-c", line]).arg(program).current_dir(dir.0.path()).output().expect("it runs").status;
        assert!(status.success(), "{name}: {status}");
        let report: serde_json::Value = serde_json::from_slice(&dir.bytes("report.json")).expect("JSON");
        let bytes = report["peak_memory_bytes"].as_u64().expect("bytes");
        assert!(bytes < BOMB as u64 / 4, "{name}: {bytes}");
        assert_eq!(report["counters"]["texels_loaded"], 1, "{name}");
    }
}

#[test]
fn newline_in_a_name_is_escaped() {
    let dir = TestDir::new();
    let run = |arguments: &[&str]| {
        let mut process = dir.glimt("");
        process.args(arguments).output().expect("it runs")
    };
    let forged = |ending: &str| format!("a\nwrote forged.png\r\nerror: b{ending}");
    let (toml, png, obj) = (forged(".toml"), forged(".png"), forged(".obj"));
    dir.write(&toml, SCENE);
    let mesh = |file: &str| format!("{SCENE}\n[[mesh]]\nfile = {file:?}\n");
    dir.write("wrong.toml", mesh("none\nforged.obj"));
    dir.write("no_materials.toml", mesh(&obj));
    dir.write(&obj, TRIANGLE);
    for (arguments, code) in [
        (vec![toml.as_str(), "--once"], 0),
        (vec![&toml, "--once", "--progress", "plain"], 0),
        (vec!["ball.toml", "--once", "-o", &png], 0),
        (vec!["ball.toml", "--once", "-o", "missing\nforged/a.png"], 1),
        (vec!["ball.toml", "--once", "-o", &forged(".xyz")], 2),
        (vec!["ball.toml", "--once", "-o", &png, "-o", &png], 2),
        (vec!["ball.toml", "--once", "--report", "missing\nforged/a.json"], 1),
        (vec!["ball.toml", "--once", "--samples", "1\nforged"], 2),
        (vec!["ball.toml", "--once", "--view", "a\nforged"], 2),
        (vec!["ball.toml", "--forged\nforged"], 2),
        (vec!["ball.toml", "forged\nforged"], 2),
        (vec!["check", &toml], 0),
        (vec!["check", "none\nforged.toml"], 2),
        (vec!["check", "wrong.toml"], 2),
        (vec!["check", "no_materials.toml"], 2),
        (vec!["new", &forged(".new")], 0),
        (vec!["new", &toml], 2),
        (vec![&toml, "--once", "--progress", "json"], 2),
        (vec![&toml, "--once", "--progress", "json", "--force"], 0),
    ] {
        let output = run(&arguments);
        let said = String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}\n{said}");
        assert!(said.contains("forged"), "{arguments:?}\n{said}");
        for line in said.lines() {
            let is_split =
                ["forged", "wrote forged.png", "error: b"].iter().any(|start| line.starts_with(start));
            assert!(!is_split && !line.contains('\r'), "{arguments:?}\n{said}");
        }
    }
}

/// Characters that a terminal would interpret or hide.
const CONTROL_CHARACTERS: &str = "\u{1b}]52;c;ZXZpbA==\u{7}\u{1b}[2J\u{9b}31m\r\u{202e}gnp\u{8}";

#[track_caller]
fn assert_harmless(output: &std::process::Output, code: i32) {
    let text = String::from_utf8(output.stderr.clone()).expect("UTF-8");
    assert_eq!(output.status.code(), Some(code), "{text}");
    let harmful = |c: char| (c.is_control() && c != '\n') || ('\u{202a}'..='\u{202e}').contains(&c);
    assert!(!text.chars().any(harmful), "{text:?}");
    assert!(output.stdout.iter().all(|byte| *byte == b'\n' || !byte.is_ascii_control()));
    let is_named = text.contains("31m") || text.contains("0000001b");
    assert!(is_named || !output.stdout.is_empty(), "name not found in: {text}");
}

#[test]
fn names_are_escaped_for_the_terminal() {
    let dir = TestDir::new();
    let toml: String = CONTROL_CHARACTERS.chars().map(|c| format!("\\U{:08x}", u32::from(c))).collect();
    let run = |arguments: &[&str]| {
        let mut process = dir.glimt("");
        process.args(arguments).output().expect("it runs")
    };
    let name = format!("{CONTROL_CHARACTERS}.toml");
    // The scene's path, for a missing, an invalid and a valid scene.
    assert_harmless(&run(&[&name, "--once"]), 2);
    dir.write(&name, "[render]\nwidth = 0\n");
    assert_harmless(&run(&[&name, "--once"]), 2);
    assert_harmless(&run(&["check", &name]), 2);
    assert_harmless(&run(&["new", &name]), 2);
    dir.write(&name, SCENE);
    assert_harmless(&run(&[&name, "--once"]), 0);
    assert_harmless(&run(&[&name, "--once", "--progress", "plain"]), 0);
    assert_harmless(&run(&["check", &name]), 0);
    assert_harmless(&run(&["ball.toml", "--once", "-o", &format!("{CONTROL_CHARACTERS}.xyz")]), 2);
    assert_harmless(&run(&["ball.toml", "--once", "-o", &format!("{CONTROL_CHARACTERS}/a.png")]), 1);
    assert_harmless(&run(&["ball.toml", "--once", "--report", &format!("{CONTROL_CHARACTERS}/a.json")]), 1);
    assert_harmless(&run(&["ball.toml", "--once", "--view", CONTROL_CHARACTERS]), 2);
    // Names in the scene.
    for (from, to) in [
        ("material = \"ball\"", format!("material = \"{toml}\"")),
        ("type = \"phong\"", format!("type = \"{toml}\"")),
        ("[0.8, 0.2, 0.1]", format!("{{ texture = \"{toml}\" }}")),
        ("[0.8, 0.2, 0.1]", format!("\"{toml}\"")),
        ("radius = 0.5", format!("\"{toml}\" = 0.5")),
        ("[[sphere]]", format!("[[\"{toml}\"]]")),
        ("[materials.ball]", format!("[materials.\"{toml}\"]")),
        ("position = [0, 1, 4]", format!("orbiter = \"{toml}.txt\"")),
        ("samples = 2", format!("output = \"{toml}.png\"\nwidth = 3 {CONTROL_CHARACTERS}")),
    ] {
        dir.write("ball.toml", SCENE.replace(from, &to));
        assert_harmless(&run(&["ball.toml", "--once"]), 2);
    }
    // Names in meshes.
    for (obj, mtl) in [
        (format!("usemtl {CONTROL_CHARACTERS}\n{TRIANGLE}"), String::new()),
        (format!("mtllib {CONTROL_CHARACTERS}.mtl\n{TRIANGLE}"), String::new()),
        (
            format!(
                "g {CONTROL_CHARACTERS}\no {CONTROL_CHARACTERS}\n{}f 1/1 2/1 3\n",
                TRIANGLE.replace("f ", "vt 0 0\nf ")
            ),
            String::new(),
        ),
        (
            format!("mtllib a.mtl\nusemtl {CONTROL_CHARACTERS}\n{TRIANGLE}"),
            format!("newmtl {CONTROL_CHARACTERS}\nmap_Kd {CONTROL_CHARACTERS}.png\n"),
        ),
        (format!("mtllib a.mtl\nusemtl a\n{TRIANGLE}"), format!("newmtl a\nKd {CONTROL_CHARACTERS}\n")),
        (format!("v {CONTROL_CHARACTERS} 0 0\n"), String::new()),
    ] {
        dir.write("a.obj", obj);
        dir.write("a.mtl", mtl);
        for material in ["", "material = \"ball\"\n"] {
            dir.write("ball.toml", format!("{SCENE}\n[[mesh]]\nfile = \"a.obj\"\n{material}"));
            let output = run(&["ball.toml", "--once"]);
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            let harmful = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
            assert!(!text.chars().any(harmful), "{text:?}");
            assert!(output.stdout.is_empty());
        }
    }
}

#[test]
fn paths_may_be_invalid_utf8() {
    let dir = TestDir::new();
    let name = std::ffi::OsStr::from_bytes(b"b\xff\x1b[2J.toml");
    fs::write(dir.0.path().join(name), SCENE).expect("written");
    let output = dir.glimt("--once").arg(name).output().expect("it runs");
    let text = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(!text.contains('\u{1b}'), "{text:?}");
    let written = std::ffi::OsStr::from_bytes(b"b\xff\x1b[2J.png");
    assert!(dir.0.path().join(written).is_file());
}

#[test]
fn models_open_despite_names_that_are_not_utf8() {
    let dir = TestDir::new();
    let names = [b"\xff.obj", b"\xfe.obj"].map(|name| Path::new(OsStr::from_bytes(name)));
    // Some file systems only allow UTF-8.
    if fs::write(dir.0.path().join(names[0]), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").is_err() {
        return;
    }
    fs::write(dir.0.path().join(names[1]), "v 0 0 0\nv 3 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    // The name that the others have if they are converted to text.
    dir.write("\u{fffd}.obj", "v 0 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n");
    let render = |name: &Path| {
        let mut process = dir.glimt("--once --progress none --width 32 --height 24 --samples 4 -o model.ppm");
        let output = process.arg(name).output().expect("it runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let image = dir.bytes("model.ppm");
        fs::remove_file(dir.path("model.ppm")).expect("removed");
        image
    };
    fs::copy(dir.0.path().join(names[0]), dir.path("plain.obj")).expect("copied");
    let pixels = |image: Vec<u8>| image.into_iter().rev().take(32 * 24 * 3).collect::<Vec<_>>();
    let [first, second, plain] =
        [names[0], names[1], Path::new("plain.obj")].map(|name| pixels(render(name)));
    assert!(first == plain && first != second);
}
