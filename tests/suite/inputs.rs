//! A render never overwrites its own inputs, regardless of the path used.

use std::fs;
use std::os::unix::fs::symlink;

use glimt::system::machine::ProcessIdentity;
use serde_json::json;

use super::gltf::Glb;
use super::test_dir::{SCENE, TestDir, assert_mentions, mentions};

/// An image not written by glimt, with one red texel.
const PHOTOGRAPH: &[u8] = b"P6\n1 1\n255\n\xff\x20\x20";

/// Options for an endless render, so that the test detects late rejections.
const ENDLESS: &str = "--once --samples 4000000000 --time 2";

/// A scene with a textured ball, a mesh with a material file and images, an orbiter camera, and an unused
/// texture.
fn studio() -> TestDir {
    let dir = TestDir::new();
    fs::create_dir(dir.path("deep")).expect("a folder");
    let camera = "orbiter = \"camera.txt\"\n";
    let scene = SCENE
        .replace("position = [0, 1, 4]\nlook_at = [0, 1, 0]\n", camera)
        .replace("[materials.ball]", &format!("{}\n[materials.ball]", TEXTURES))
        .replace("[0.8, 0.2, 0.1]", "{ texture = \"skin\" }");
    dir.write("scene.toml", format!("{scene}\n[[mesh]]\nfile = \"deep/one.obj\"\n"));
    for name in ["skin.ppm", "unused.ppm", "deep/wood.ppm", "deep/bumps.ppm", "deep/alpha.ppm"] {
        dir.write(name, PHOTOGRAPH);
    }
    dir.write("camera.txt", "c 0 1 0\np 0 0\nr 0 0\ns 4 1\nf 40 4 3\n");
    dir.write(
        "deep/one.obj",
        "mtllib one.mtl materials.json gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n",
    );
    dir.write("deep/materials.json", "newmtl other\n");
    dir.write("deep/one.mtl", "newmtl m\nmap_Kd wood.ppm\nnorm bumps.ppm\nmap_d alpha.ppm\n");
    dir
}

const TEXTURES: &str = "[textures.skin]\nfile = \"skin.ppm\"\n[textures.unused]\nfile = \"unused.ppm\"\n";

/// All regular files in the directory tree with their contents.
fn all_files(dir: &TestDir) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut folders = vec![dir.0.path().to_owned()];
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let entry = entry.expect("an entry");
            let kind = entry.file_type().expect("a kind");
            if kind.is_dir() {
                folders.push(entry.path());
            } else if kind.is_file() {
                found.push((entry.path(), fs::read(entry.path()).expect("a file")));
            }
        }
    }
    found.sort();
    found
}

/// Runs glimt and checks that it exits with code 2, prints a message with the expected words, renders nothing
/// and changes no file. Returns the message.
#[track_caller]
fn rejection_message(dir: &TestDir, line: &str, words: &[&str]) -> String {
    let before = all_files(dir);
    let stderr = dir.expect(line, 2);
    for word in words {
        assert!(stderr.contains(word), "{line}: {word}: {stderr}");
    }
    assert!(!stderr.lines().any(|line| line.starts_with("render")), "{line}: {stderr}");
    assert!(all_files(dir) == before, "{line}: a file was changed: {stderr}");
    stderr
}

#[test]
fn default_output_never_replaces_an_input() {
    let dir = TestDir::new();
    let texture = "[textures.marble]\nfile = \"marble.png\"\n\n[materials.ball]";
    let scene =
        SCENE.replace("[materials.ball]", texture).replace("[0.8, 0.2, 0.1]", "{ texture = \"marble\" }");
    dir.write("marble.toml", scene);
    // This image was written by glimt, so the default output could replace it if it were not an input.
    dir.expect("ball.toml --once -o marble.png", 0);
    let stderr =
        rejection_message(&dir, &format!("marble.toml {ENDLESS}"), &["marble.png", "texture `marble`", "-o"]);
    assert!(stderr.contains("marble.toml:11:8") && stderr.contains("`output = "), "{stderr}");
    dir.expect("marble.toml --once -o other.png", 0);
}

#[test]
fn scene_named_like_its_image_is_kept() {
    let dir = TestDir::new();
    dir.write("scene.png", SCENE);
    rejection_message(&dir, &format!("scene.png {ENDLESS}"), &["scene.png", "the scene file", "-o"]);
    symlink("ball.toml", dir.path("ln.png")).expect("a link");
    rejection_message(&dir, &format!("ball.toml {ENDLESS} -o ln.png"), &["ln.png", "ball.toml", "-o"]);
    fs::hard_link(dir.path("ball.toml"), dir.path("hard.png")).expect("a link");
    rejection_message(&dir, &format!("ball.toml {ENDLESS} -o hard.png"), &["hard.png", "ball.toml"]);
}

#[test]
fn no_path_to_an_input_is_accepted_as_output() {
    let dir = studio();
    let skin = dir.path("skin.ppm");
    symlink("skin.ppm", dir.path("link.ppm")).expect("a link");
    symlink("link.ppm", dir.path("second.ppm")).expect("a link");
    symlink(&skin, dir.path("deep/absolute.ppm")).expect("a link");
    fs::hard_link(&skin, dir.path("hard.ppm")).expect("a link");
    symlink("deep", dir.path("elsewhere")).expect("a link");
    for output in [
        "skin.ppm",
        "./skin.ppm",
        "deep/../skin.ppm",
        "elsewhere/../skin.ppm",
        "link.ppm",
        "second.ppm",
        "deep/absolute.ppm",
        "hard.ppm",
        skin.to_str().expect("UTF-8"),
    ] {
        rejection_message(
            &dir,
            &format!("scene.toml {ENDLESS} -o {output}"),
            &[output, "skin.ppm", "texture `skin`"],
        );
        rejection_message(&dir, &format!("scene.toml {ENDLESS} -o good.png -o {output}"), &[output]);
    }
    // A folder under another name. After a link, `..` refers to the parent of the link's target.
    rejection_message(
        &dir,
        &format!("scene.toml {ENDLESS} -o elsewhere/wood.ppm"),
        &["elsewhere/wood.ppm", "deep/wood.ppm"],
    );
    fs::create_dir_all(dir.path("far/away")).expect("folders");
    symlink("far/away", dir.path("near")).expect("a link");
    dir.expect("scene.toml --once -o near/../skin.ppm", 0);
    assert!(dir.bytes("far/skin.ppm").starts_with(b"P6\n# Software: glimt"));
    assert_eq!(dir.bytes("skin.ppm"), PHOTOGRAPH);
}

#[test]
fn every_kind_of_input_is_kept() {
    let dir = studio();
    for (output, role) in [
        ("skin.ppm", "texture `skin`"),
        ("unused.ppm", "texture `unused`"),
        ("deep/wood.ppm", "one.obj"),
        ("deep/bumps.ppm", "one.obj"),
        // The material file refers to this image, but nothing uses it.
        ("deep/alpha.ppm", "one.obj"),
    ] {
        let stderr = rejection_message(&dir, &format!("scene.toml {ENDLESS} -o {output}"), &[output, role]);
        assert!(stderr.contains("--> scene.toml:"), "{output}: expected a position in the scene: {stderr}");
    }
    for (report, role) in [
        ("scene.toml", "the scene file"),
        ("camera.txt", "orbiter"),
        ("deep/one.obj", "mesh"),
        // Existing files that are not reports are rejected before the mesh is read.
        ("deep/materials.json", "report"),
        ("deep/one.mtl", "report"),
        ("deep/wood.ppm", "report"),
        // This file does not exist yet, but the mesh refers to it.
        ("deep/gone.mtl", "one.obj"),
    ] {
        rejection_message(
            &dir,
            &format!("scene.toml {ENDLESS} --report {report}"),
            &[report, role, "--report"],
        );
        rejection_message(&dir, &format!("scene.toml {ENDLESS} --report deep/../{report}"), &[report, role]);
    }
    // Images of the mesh's own materials are inputs even if the scene overrides the materials.
    let text = fs::read_to_string(dir.path("scene.toml")).expect("the scene");
    dir.write("scene.toml", text.replace("one.obj\"", "one.obj\"\nmaterial = \"ball\""));
    rejection_message(&dir, &format!("scene.toml {ENDLESS} -o deep/wood.ppm"), &["deep/wood.ppm", "one.obj"]);
}

#[test]
fn gltf_images_are_never_replaced() {
    let dir = TestDir::new();
    let mut glb = Glb::default();
    let positions = glb.vectors(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    // Unused images: an occlusion map, an image for a material without faces, and an image without a texture.
    let json = json!({
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": positions}, "material": 0}]}],
        "materials": [{"occlusionTexture": {"index": 0}}, {"emissiveTexture": {"index": 1}}],
        "textures": [{"source": 0}, {"source": 1}],
        "images": [{"uri": "deep/ao.png"}, {"uri": "glow.png"}, {"uri": "spare%2Done.png"}],
    });
    dir.write("m.glb", glb.finish(json));
    fs::create_dir(dir.path("deep")).expect("a folder");
    dir.write("scene.toml", format!("{SCENE}\n[[mesh]]\nfile = \"m.glb\"\n"));
    dir.write(
        "textured.toml",
        SCENE
            .replace("[materials.ball]", "[textures.t]\nfile = \"m.glb\"\nimage = 1\n[materials.ball]")
            .replace("[0.8, 0.2, 0.1]", "{ texture = \"t\" }"),
    );
    dir.write("other.off", "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    let pictures = ["deep/ao.png", "glow.png", "spare-one.png"];
    for picture in pictures {
        dir.write(picture, PHOTOGRAPH);
    }
    for picture in pictures {
        for call in [
            "m.glb",
            "scene.toml",
            "textured.toml",
            "scene.toml --set mesh.1.file=other.off --set mesh.1.material=ball",
        ] {
            let stderr = rejection_message(
                &dir,
                &format!("{call} {ENDLESS} --force -o {picture}"),
                &[picture, "cannot write"],
            );
            assert!(stderr.contains("m.glb") || stderr.contains("scene"), "{call}: {stderr}");
        }
    }
}

#[test]
fn output_key_must_not_name_an_input() {
    let dir = studio();
    let text = fs::read_to_string(dir.path("scene.toml")).expect("the scene");
    dir.write("scene.toml", text.replace("[render]", "[render]\noutput = \"deep/../skin.ppm\""));
    let words = ["deep/../skin.ppm", "texture `skin`", "--> scene.toml:", "`output`"];
    rejection_message(&dir, &format!("scene.toml {ENDLESS}"), &words);
    let output = dir.run("check scene.toml");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    dir.expect("scene.toml --once -o other.png", 0);
}

#[test]
fn outputs_and_report_must_differ() {
    let dir = TestDir::new();
    fs::create_dir_all(dir.path("o/p")).expect("folders");
    symlink("o", dir.path("q")).expect("a link");
    symlink("p/new.png", dir.path("o/dangling.png")).expect("a link");
    dir.write("there.png", PHOTOGRAPH);
    fs::hard_link(dir.path("there.png"), dir.path("hard.png")).expect("a link");
    for line in [
        "-o a.png -o ./a.png",
        "-o a.png -o o/../a.png",
        "-o o/a.png -o q/a.png",
        "-o o/p/new.png -o o/dangling.png",
        "-o b.png -o o/dangling.png -o q/p/new.png",
        "-o there.png -o hard.png",
        "-o a.png --report a.png",
        "-o a.png --report o/../a.png",
        "--report ball.png",
        "--report q/../ball.png",
        "-o o/p/new.png --report o/dangling.png",
    ] {
        let names = line.split_whitespace().filter(|word| !word.starts_with('-'));
        let names: Vec<&str> = names.skip_while(|name| *name == "b.png").collect();
        let stderr = rejection_message(&dir, &format!("ball.toml {ENDLESS} {line}"), &names);
        assert_eq!(stderr.matches("error: ").count(), 1, "{line}: {stderr}");
    }
    dir.expect("ball.toml --once -o o/a.png -o a.png --report o/p/a.png.json", 0);
}

#[test]
fn default_output_replaces_only_glimt_images() {
    let dir = TestDir::new();
    dir.expect("ball.toml --once", 0);
    let own = dir.bytes("ball.png");
    dir.expect("ball.toml --once --seed 3", 0);
    assert_ne!(dir.bytes("ball.png"), own, "glimt must replace its own image");
    let ways = ["ball.png", "-o", "`output = "];
    let truncated = &own[..20];
    let mut other = own.clone();
    let at = other.windows(6).position(|window| window == b"glimt ").expect("its name");
    other[at] = b'G';
    for foreign in [PHOTOGRAPH, b"", b"\x89PNG\r\n\x1a\n", truncated, SCENE.as_bytes(), &other] {
        dir.write("ball.png", foreign);
        rejection_message(&dir, &format!("ball.toml {ENDLESS}"), &ways);
    }
    // An image from another encoder, without glimt's text chunk.
    image::RgbImage::new(3, 2).save(dir.path("ball.png")).expect("a photograph");
    rejection_message(&dir, &format!("ball.toml {ENDLESS}"), &ways);
    dir.write("photo.png", dir.bytes("ball.png"));
    fs::remove_file(dir.path("ball.png")).expect("removed");
    symlink("photo.png", dir.path("ball.png")).expect("a link");
    rejection_message(&dir, &format!("ball.toml {ENDLESS}"), &ways);
    // An explicitly named output is replaced.
    dir.expect("ball.toml --once -o ball.png", 0);
    assert_eq!(dir.bytes("photo.png").len(), own.len());
    dir.expect("ball.toml --once", 0);
    fs::remove_file(dir.path("photo.png")).expect("removed");
    dir.expect("ball.toml --once", 0);
    assert_eq!(dir.bytes("photo.png"), own, "a dangling link must be followed");
    let scene = SCENE.replace("[render]", "[render]\noutput = \"own.png\"");
    dir.write("ball.toml", scene);
    dir.write("own.png", PHOTOGRAPH);
    dir.expect("ball.toml --once", 0);
    assert!(dir.bytes("own.png").starts_with(b"\x89PNG"));
}

#[test]
fn report_replaces_only_reports() {
    let dir = TestDir::new();
    let report = |name: &str| dir.expect(&format!("ball.toml --once --report {name}"), 0);
    for name in ["new", "new", "new.txt", "new.txt", "r.json"] {
        report(name);
    }
    dir.write("empty", "");
    report("empty");
    for (name, content) in [("m.obj", b"v 0 0 0\n".as_slice()), ("notes", b"glimt"), ("x.ppm", PHOTOGRAPH)] {
        dir.write(name, content);
        rejection_message(&dir, &format!("ball.toml {ENDLESS} --report {name}"), &[name, ".json"]);
    }
    // If stdout was opened for appending, the report is appended to the file.
    dir.write("log", "before\n");
    let log = fs::OpenOptions::new().append(true).open(dir.path("log")).expect("a file");
    let status = dir.glimt("ball.toml --once --report /dev/stdout").stdout(log).status().expect("it runs");
    assert!(status.success() && dir.bytes("log").starts_with(b"before\n{"));
    let scene = fs::OpenOptions::new().append(true).open(dir.path("ball.toml")).expect("a file");
    let status = dir.glimt("ball.toml --once --report /dev/stdout").stdout(scene).status().expect("it runs");
    assert_eq!((status.code(), dir.bytes("ball.toml")), (Some(2), SCENE.into()));
}

#[test]
fn input_named_like_a_temporary_file_is_kept() {
    let dir = studio();
    let text = fs::read_to_string(dir.path("scene.toml")).expect("the scene");
    let mut ended = std::process::Command::new("true").spawn().expect("true starts");
    let (machine, process) = (ProcessIdentity::current().machine, ended.id());
    ended.wait().expect("it ends");
    let [scene, camera, stale] =
        ["s", "c", "a"].map(|name| format!(".{name}.glimt-{machine:016x}-{process}-2.tmp"));
    let (scene, camera, stale) = (scene.as_str(), camera.as_str(), stale.as_str());
    dir.write(scene, text.replace("camera.txt", camera));
    dir.write(camera, dir.bytes("camera.txt"));
    dir.write(stale, "left behind");
    dir.expect(&format!("{scene} --once -o a.png --report r.json"), 0);
    assert!(dir.path(scene).exists() && dir.path(camera).exists());
    assert!(!dir.path(stale).exists(), "stale temporary files must be removed");
}

#[test]
fn new_never_overwrites() {
    let dir = TestDir::new();
    symlink("nowhere.toml", dir.path("dangling.toml")).expect("a link");
    symlink("ball.toml", dir.path("link.toml")).expect("a link");
    fs::create_dir(dir.path("folder.toml")).expect("a folder");
    for name in ["dangling.toml", "link.toml", "folder.toml", "deep/../ball.toml", "ball.toml"] {
        fs::create_dir_all(dir.path("deep")).expect("a folder");
        rejection_message(&dir, &format!("new {name}"), &["error: ", name]);
    }
    assert!(!dir.path("nowhere.toml").exists());
    assert!(fs::symlink_metadata(dir.path("dangling.toml")).expect("a link").is_symlink());
    let stderr = dir.expect("new dangling.toml", 2);
    assert!(!dir.path("nowhere.toml").exists() && mentions(&stderr, "dangling.toml"), "{stderr}");
}

#[test]
fn environment_map_is_never_an_output() {
    let dir = TestDir::new();
    // The map is an input even if a black factor makes it unused.
    for (name, color) in [("lit.toml", ""), ("dark.toml", "color = 0\n")] {
        dir.write(name, format!("{SCENE}\n[environment]\nfile = \"sky.ppm\"\n{color}"));
        dir.write("sky.ppm", PHOTOGRAPH);
        let said =
            rejection_message(&dir, &format!("{name} {ENDLESS} -o sky.ppm"), &["sky.ppm", "environment"]);
        assert!(said.contains(name), "{said}");
        let checked = dir.glimt(&format!("check {name}")).output().expect("it runs");
        let counted = String::from_utf8_lossy(&checked.stdout).into_owned();
        let lights = if color.is_empty() { "2 lights" } else { "1 light" };
        assert!(counted.contains("1 texture") && counted.contains(lights), "{counted}");
    }
    fs::remove_file(dir.path("sky.ppm")).expect("removed");
    let missing = dir.expect("check lit.toml", 2);
    assert_mentions(&missing, &["error", "sky.ppm", "lit.toml"]);
    dir.write("sky.ppm", "P6 no picture");
    for call in ["check lit.toml", "check dark.toml", "lit.toml --once"] {
        assert!(dir.expect(call, 2).contains("sky.ppm"), "{call}");
    }
}

#[test]
fn overridden_files_are_kept() {
    let dir = studio();
    dir.write("other.ppm", PHOTOGRAPH);
    dir.write("deep/two.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    dir.write("other.txt", "c 0 1 0\np 0 0\nr 0 0\ns 4 1\nf 40 4 3\n");
    for (set, output) in [
        ("textures.skin.file=other.ppm", "skin.ppm"),
        ("textures.skin={file=\"other.ppm\"}", "skin.ppm"),
        ("mesh.1.file=deep/two.obj --set mesh.1.material=ball", "deep/wood.ppm"),
        ("textures.skin.file=other.ppm", "other.ppm"),
    ] {
        rejection_message(&dir, &format!("scene.toml {ENDLESS} --set {set} -o {output}"), &[output]);
    }
    for (set, report) in [
        ("camera.orbiter=other.txt", "camera.txt"),
        ("mesh.1.file=deep/two.obj --set mesh.1.material=ball", "deep/one.obj"),
    ] {
        rejection_message(
            &dir,
            &format!("scene.toml {ENDLESS} --set {set} --report {report}"),
            &[report, "--report"],
        );
    }
    // The default output, with a texture written by glimt.
    dir.expect("scene.toml --once --samples 1 -o made.png", 0);
    let text = fs::read_to_string(dir.path("scene.toml")).expect("the scene");
    dir.write("made.toml", text.replace("unused.ppm", "made.png"));
    rejection_message(&dir, "made.toml --once --set textures.unused.file=other.ppm", &["made.png"]);
}
