//! `glimt MODEL` and `glimt import`.

use std::fs;
use std::path::Path;

use nix::errno::Errno;
use serde_json::json;

use super::gltf::{Glb, cube, cubes};
use super::test_dir::{PROGRAM, TestDir, assert_mentions, mentions, system_error};

const SMALL: &str = "--once --force --width 48 --height 36 --samples 4 --error 0";

/// Renders an image and returns its linear pixel values.
fn picture(dir: &TestDir, line: &str) -> Vec<f32> {
    dir.expect(&format!("{line} {SMALL} -o picture.exr"), 0);
    image::open(dir.path("picture.exr")).expect("a picture").to_rgb32f().into_raw()
}

fn checker() -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/textures/checker.png")).expect("an image")
}

/// An OBJ file of a box with the specified side lengths.
fn box_of([x, y, z]: [i32; 3]) -> String {
    let corner =
        |bits: i32| format!("v {} {} {}\n", (bits & 1) * x, (bits >> 1 & 1) * y, (bits >> 2 & 1) * z);
    let corners: String = (0..8).map(corner).collect();
    corners + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}

/// Ranges of columns and rows that contain pixels other than ground and sky.
fn covered_ranges(pixels: &[f32]) -> [usize; 4] {
    let mut bounds = [48, 0, 36, 0];
    for (index, pixel) in pixels.chunks(3).enumerate() {
        let (x, y) = (index % 48, index / 48);
        // The normal view is black in the sky, and the ground's normal is (0, 1, 0).
        let is_ground =
            pixel.iter().zip([0.5, 1.0, 0.5]).all(|(value, ground)| (value - ground).abs() < 0.05);
        if !is_ground && pixel.iter().any(|value| *value > 0.0) {
            bounds = [bounds[0].min(x), bounds[1].max(x), bounds[2].min(y), bounds[3].max(y)];
        }
    }
    bounds
}

#[test]
fn model_is_framed_from_every_side() {
    let dir = TestDir::new();
    dir.write("box.obj", box_of([3, 2, 1]));
    for (side, ratio) in [("front", 1.5), ("back", 1.5), ("left", 0.5), ("right", 0.5)] {
        let [left, right, top, bottom] =
            covered_ranges(&picture(&dir, &format!("box.obj --view normal --from {side}")));
        let (width, height) = ((right - left + 1) as f32, (bottom - top + 1) as f32);
        assert!(left > 0 && top > 0 && right < 47 && bottom < 35, "{side}: {left} {right} {top} {bottom}");
        assert!((width / height / ratio - 1.0).abs() < 0.25, "{side}: {width} × {height}");
        assert!(width > 36.0 || height > 26.0, "{side}: must fill the frame: {width} × {height}");
    }
    // With --up, towers along every axis are upright. PLY files from Blender are z-up.
    for (up, sizes) in [("x", [4, 1, 1]), ("y", [1, 4, 1]), ("z", [1, 1, 4])] {
        dir.write("tower.obj", box_of(sizes));
        let [left, right, top, bottom] =
            covered_ranges(&picture(&dir, &format!("tower.obj --view normal --from front --up {up}")));
        let (width, height) = ((right - left + 1) as f32, (bottom - top + 1) as f32);
        assert!((3.0..5.0).contains(&(height / width)), "{up}: {width} × {height}");
    }
    let tower = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n\
                 property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 0 4\n0 0 4\n3 0 1 2\n3 0 2 3\n";
    for (comment, is_high) in [("Created in Blender version 4.5.0", true), ("by hand", false)] {
        dir.write("tower.ply", format!("ply\nformat ascii 1.0\ncomment {comment}\n{tower}"));
        let [left, right, top, bottom] = covered_ranges(&picture(&dir, "tower.ply --view normal --from iso"));
        assert_eq!(bottom - top > right - left, is_high, "{comment}");
    }
    let stderr = dir.expect(&format!("ball.toml {SMALL} --up z"), 2);
    assert_mentions(&stderr, &["--up"]);
    let stderr = dir.expect(&format!("ball.toml {SMALL} --from top"), 2);
    assert_mentions(&stderr, &["--from"]);
}

/// A shape looks the same in z-up and y-up formats.
#[test]
fn stl_files_are_z_up() {
    let dir = TestDir::new();
    dir.write("box.obj", box_of([3, 2, 1]));
    // x is the width, y the depth, z the height.
    let facets = box_of([3, 1, 2]);
    let corners: Vec<&str> = facets.lines().filter_map(|line| line.strip_prefix("v ")).collect();
    let faces = facets.lines().filter_map(|line| line.strip_prefix("f "));
    let facet = |face: &str| {
        let vertices: String = face
            .split(' ')
            .map(|corner| format!("vertex {}\n", corners[corner.parse::<usize>().expect("a number") - 1]))
            .collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    dir.write("box.stl", format!("solid box\n{}endsolid box\n", faces.map(facet).collect::<String>()));
    let [obj, stl] = ["box.obj", "box.stl"]
        .map(|file| covered_ranges(&picture(&dir, &format!("{file} --view normal --from front"))));
    assert_eq!(obj, stl);
}

#[test]
fn imported_scene_renders_like_the_model() {
    let dir = TestDir::new();
    dir.write("cubes.glb", cubes(&checker()));
    let shown = picture(&dir, "cubes.glb");
    let said = dir.expect("import cubes.glb -o scene.toml", 0);
    assert_mentions(&said, &["scene.toml", "2 files", "scene_files"]);
    assert_eq!(picture(&dir, "scene.toml"), shown);
    let text = fs::read_to_string(dir.path("scene.toml")).expect("a scene");
    for words in [
        "[textures.checks]\nfile = \"scene_files/checks.png\"\nfactor = [1, 0.5, 0.5]\n",
        "[materials.\"paint \\\"1\\\"\"]\ntype = \"principled\"\ncolor = { texture = \"checks\" }\nroughness = 1\n",
        "name = \"straight\"\nfile = \"scene_files/straight.ply\"\nmaterial = \"paint \\\"1\\\"\"\ntranslate = [-1.5, 1, 0]\n",
        "name = \"turned\"\nfile = \"scene_files/straight.ply\"\n",
    ] {
        assert!(text.contains(words), "{words}\nin\n{text}");
    }
    // The image file is identical to the image embedded in the model.
    assert_eq!(dir.bytes("scene_files/checks.png"), checker());
    // Import never overwrites an existing file or folder.
    let said = dir.expect("import cubes.glb -o scene.toml", 2);
    assert_mentions(&said, &["scene.toml", "-o"]);
    assert_eq!(fs::read_to_string(dir.path("scene.toml")).expect("a scene"), text);
    fs::remove_file(dir.path("scene.toml")).expect("removed");
    assert_mentions(&dir.expect("import cubes.glb -o scene.toml", 2), &["scene_files", "-o"]);
    assert_mentions(&dir.expect("import ball.toml -o b.toml", 2), &["ball.toml", ".gltf", ".glb"]);
    assert_mentions(&dir.expect("import cubes.glb -o b.png", 2), &["b.png", ".toml"]);
}

/// As in exports with light maps, the color uses the first set of texture coordinates and the emission the
/// second.
#[test]
fn both_uv_sets_are_imported() {
    let dir = TestDir::new();
    let write = |emission_set: u32| {
        let mut glb = Glb::default();
        let mut cube = cube(&mut glb);
        let second: Vec<[f32; 2]> = (0..24).map(|i| [(i / 4) as f32 / 6.0, (i % 4) as f32 / 4.0]).collect();
        cube["attributes"]["TEXCOORD_1"] = json!(glb.vectors(&second));
        cube["material"] = json!(0);
        let view = glb.view(&checker());
        let file = glb.finish(json!({
            "nodes": [{"mesh": 0, "name": "cube"}], "meshes": [{"primitives": [cube]}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0, "texCoord": emission_set}}],
            "textures": [{"source": 0}],
            "images": [{"bufferView": view, "mimeType": "image/png", "name": "checks"}]
        }));
        dir.write("a.glb", file);
    };
    write(0);
    let of_one = picture(&dir, "a.glb");
    write(1);
    let of_both = picture(&dir, "a.glb");
    assert_ne!(of_one, of_both);
    let said = dir.expect("import a.glb", 0);
    assert!(!said.contains("approximation"), "{said}");
    assert_eq!(picture(&dir, "a.toml"), of_both);
    let text = fs::read_to_string(dir.path("a.toml")).expect("a scene");
    let texture = "[textures.checks_2]\nfile = \"a_files/checks.png\"\nuv = 1\n";
    assert!(text.contains(texture), "{text}");
    // A mesh without a second set causes a warning.
    dir.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n");
    dir.write("b.toml", text.replace("a_files/cube.ply", "b.obj"));
    let said = dir.expect(&format!("b.toml {SMALL} -o b.exr"), 0);
    assert_mentions(&said, &["warning", "b.obj", "\"checks_2\"", "\"material\""]);
}

/// A GLB file of a cube whose texture is at the specified URI.
fn with_image(uri: &str) -> Vec<u8> {
    let mut glb = Glb::default();
    let mut cube = cube(&mut glb);
    cube["material"] = json!(0);
    glb.finish(json!({
        "nodes": [{"mesh": 0, "name": "../cube"}], "meshes": [{"primitives": [cube]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": uri}]
    }))
}

#[test]
fn embedded_and_linked_images_render_identically() {
    let dir = TestDir::new();
    dir.write("c.png", checker());
    for mode in ["OPAQUE", "MASK", "BLEND"] {
        let model = |is_embedded: bool| {
            let mut glb = Glb::default();
            let mut cube = cube(&mut glb);
            cube["material"] = json!(0);
            let image = if is_embedded {
                json!({"bufferView": glb.view(&checker()), "mimeType": "image/png"})
            } else {
                json!({"uri": "c.png"})
            };
            dir.write("a.glb", glb.finish(json!({
                "nodes": [{"mesh": 0}], "meshes": [{"primitives": [cube]}],
                "materials": [{"alphaMode": mode, "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
                "textures": [{"source": 0}], "images": [image]
            })));
            picture(&dir, "a.glb")
        };
        assert!(model(true) == model(false), "{mode}");
    }
}

/// Importing an untrusted model must not copy arbitrary local files into the scene's folder.
#[test]
fn import_copies_only_images() {
    let dir = TestDir::new();
    dir.write("secret", "root:x:0:0\n");
    dir.write("secret.png", "root:x:0:0\n");
    for name in ["secret", "secret.png"] {
        dir.write("a.glb", with_image(name));
        let said = dir.expect("import a.glb", 2);
        assert!(said.contains(name) && said.contains("images[0]"), "{said}");
        assert!(!dir.path("a.toml").exists() && !dir.path("a_files").exists());
    }
    // An image without an extension gets the extension of its format. No name can escape from the folder.
    dir.write("picture", checker());
    dir.write("a.glb", with_image("picture"));
    dir.expect("import a.glb", 0);
    assert_eq!(dir.bytes("a_files/picture.png"), checker());
    assert!(dir.path("a_files/_cube.ply").exists());
}

/// If a file cannot be written, the import removes its other files.
#[test]
fn failed_import_leaves_no_files() {
    let dir = TestDir::new();
    dir.write("cubes.glb", cubes(&checker()));
    // A dangling link has the scene's name.
    std::os::unix::fs::symlink("nowhere", dir.path("taken.toml")).expect("a link");
    assert_mentions(&dir.expect("import cubes.glb -o taken.toml", 2), &["taken.toml", "-o"]);
    assert!(!dir.path("taken_files").exists());
    // Limit file sizes to one 512-byte block.
    let shell = std::process::Command::new("sh")
        .args(["-c", &format!("ulimit -f 1; exec {PROGRAM} import cubes.glb -o full.toml")])
        .current_dir(dir.path("."))
        .output()
        .expect("it runs");
    let said = String::from_utf8_lossy(&shell.stderr).into_owned();
    assert_eq!(shell.status.code(), Some(1), "{said}");
    assert_mentions(&said, &["full_files", &system_error(Errno::EFBIG)]);
    assert!(!dir.path("full.toml").exists() && !dir.path("full_files").exists());
    dir.expect("import cubes.glb -o full.toml", 0);
}

/// A scene with invalid numbers is not written, and the error says where the number is in the glTF file.
#[test]
fn out_of_range_number_errors_name_the_node() {
    let dir = TestDir::new();
    let light = |intensity: f64| {
        json!({"nodes": [{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 5, 0]}],
            "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "name": "sun", "intensity": intensity}]}}})
    };
    for (mut model, facts) in [
        (json!({"nodes": [{"mesh": 0, "scale": [1e30, 1e30, 1e30]}]}), ["nodes[0]", "scale", "1e30"]),
        (json!({"nodes": [{"mesh": 0, "translation": [0, -1e30, 0]}]}), ["nodes[0]", "translation", "1e30"]),
        (
            json!({"scenes": [{"nodes": [1]}], "nodes": [{"mesh": 0, "scale": [1e9, 1e9, 1e9]}, {"children": [0], "scale": [1e9, 1e9, 1e9]}]}),
            ["nodes[0]", "ancestors", "1e18"],
        ),
        (light(1e30), ["nodes[1]", "lights[0] \"sun\"", "1e30"]),
        (light(1e300), ["nodes[1]", "lights[0] \"sun\"", "1e300"]),
    ] {
        let mut glb = Glb::default();
        model["meshes"] = json!([{"primitives": [cube(&mut glb)]}]);
        dir.write("a.glb", glb.finish(model));
        let said = dir.expect("import a.glb --strict", 2);
        assert_mentions(&said, &facts);
        assert!(!dir.path("a.toml").exists() && !dir.path("a_files").exists(), "{said}");
        let said = dir.expect(&format!("a.glb {SMALL}"), 2);
        assert_mentions(&said, &facts);
        assert!(!said.contains("a.glb:"), "{said}");
    }
    // The scene of an accepted model passes `check`.
    let mut glb = Glb::default();
    let mut model = light(9e14);
    model["meshes"] = json!([{"primitives": [cube(&mut glb)]}]);
    dir.write("a.glb", glb.finish(model));
    dir.expect("import a.glb", 0);
    assert!(dir.run("check a.toml").status.success());
}

#[test]
fn impossible_counts_are_reported_exactly() {
    let dir = TestDir::new();
    let mut glb = Glb::default();
    let cube = cube(&mut glb);
    let text = glb.finish_text(json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [cube]}]}));
    dir.write("a.gltf", text.replace("\"count\":36", "\"count\":1000000000000"));
    let said = dir.expect("import a.gltf", 2);
    assert_mentions(&said, &["1000000000000"]);
}

/// An import killed at any time leaves either a complete scene or no visible file, and the next import
/// succeeds.
#[test]
fn interrupted_import_is_all_or_nothing() {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    /// Maximum number of imports that may finish before the signal.
    const TRIES: u32 = 20;
    let dir = TestDir::new();
    // Many large parts make writing slow.
    let mut glb = Glb::default();
    let positions: Vec<[f32; 3]> =
        (0..30_000).map(|i| [(i % 250) as f32, (i / 250) as f32, (i % 7) as f32]).collect();
    // Parts must differ, because identical parts are written only once.
    let parts = (0..30).map(|_| json!({"attributes": {"POSITION": glb.vectors(&positions)}}));
    let primitives: Vec<_> = parts.collect();
    dir.write("big.glb", glb.finish(json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": primitives}]})));
    let hidden = || {
        let entries = fs::read_dir(dir.path(".")).expect("a folder").flatten();
        entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(".o.toml.glimt-")).count()
    };
    for (signal, code) in [
        (Signal::SIGINT, Some(130)),
        (Signal::SIGTERM, Some(143)),
        (Signal::SIGHUP, Some(129)),
        (Signal::SIGKILL, None),
    ] {
        let run = || {
            let mut import = dir.glimt("import big.glb -o o.toml");
            let mut child = import.stderr(std::process::Stdio::piped()).spawn().expect("it runs");
            // Kill the process while it writes.
            while hidden() == 0 && child.try_wait().expect("a state").is_none() {
                std::thread::yield_now();
            }
            kill(Pid::from_raw(child.id() as i32), signal).expect("sent");
            child.wait_with_output().expect("its end")
        };
        let mut output = run();
        // On a busy machine, the import may have finished before the signal.
        for _ in 0..TRIES {
            if output.status.code() != Some(0) {
                break;
            }
            fs::remove_file(dir.path("o.toml")).expect("a complete scene");
            fs::remove_dir_all(dir.path("o_files")).expect("the scene's files");
            output = run();
        }
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), code, "{signal}: {said}");
        let is_whole = dir.path("o.toml").exists();
        assert_eq!(dir.path("o_files").exists(), is_whole, "{signal}: {said}");
        if is_whole {
            fs::remove_file(dir.path("o.toml")).expect("removed");
            fs::remove_dir_all(dir.path("o_files")).expect("removed");
        } else if matches!(signal, Signal::SIGINT | Signal::SIGTERM) {
            assert_mentions(&said, &[signal.as_str()]);
        }
        assert_eq!(hidden(), usize::from(signal == Signal::SIGKILL && !is_whole), "{signal}");
    }
    dir.expect("import big.glb -o o.toml", 0);
    assert_eq!(hidden(), 0, "leftovers of a killed import must be removed");
}

#[test]
fn strict_import_rejects_approximations() {
    let dir = TestDir::new();
    let mut glb = Glb::default();
    let mut cube = cube(&mut glb);
    cube["material"] = json!(0);
    let extensions = json!({"KHR_materials_sheen": {}});
    dir.write("a.glb", glb.finish(json!({
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [cube]}], "materials": [{"extensions": extensions}], "animations": [{}]
    })));
    let said = dir.expect("import a.glb -o strict.toml --strict", 2);
    assert_mentions(&said, &["materials[0]", "sheen", "2 approximations", "--strict"]);
    assert!(!dir.path("strict.toml").exists() && !dir.path("strict_files").exists());
    dir.expect("import a.glb", 0);
    let text = fs::read_to_string(dir.path("a.toml")).expect("a scene");
    let comments: String = text.lines().filter(|line| line.starts_with("# ")).collect();
    assert_mentions(&comments, &["animations: 1", "materials[0]", "sheen"]);
    let said = dir.expect(&format!("a.glb {SMALL}"), 0);
    assert_mentions(&said, &["materials[0]", "sheen"]);
}

#[test]
fn model_cameras_and_lights_are_used() {
    let dir = TestDir::new();
    let mut glb = Glb::default();
    let cube = cube(&mut glb);
    dir.write("a.glb", glb.finish(json!({
        "nodes": [{"mesh": 0}, {"name": "eye", "camera": 0, "translation": [0, 0, 9]},
            {"translation": [0, 5, 5], "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "meshes": [{"primitives": [cube]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "aspectRatio": 2}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 40, "color": [1, 0, 0]}]}}
    })));
    dir.expect("import a.glb", 0);
    let text = fs::read_to_string(dir.path("a.toml")).expect("a scene");
    for words in [
        "width = 960\nheight = 480",
        "position = [0, 0, 9]",
        "look_at = [0, 0, 0]",
        "fov = 57.29578",
        "intensity = [40, 0, 0]",
    ] {
        assert!(text.contains(words), "{words}\nin\n{text}");
    }
    assert!(!text.contains("directional"), "{text}");
}

/// For models with polished surfaces, glimt clamps reflected light and reports this. Other models render
/// without bias.
#[test]
fn only_polished_models_are_clamped() {
    let dir = TestDir::new();
    for (roughness, is_polished) in [(0.1, true), (0.5, false)] {
        let mut glb = Glb::default();
        let mut cube = cube(&mut glb);
        cube["material"] = json!(0);
        dir.write(
            "a.glb",
            glb.finish(json!({
                "nodes": [{"mesh": 0}], "meshes": [{"primitives": [cube]}],
                "materials": [{"pbrMetallicRoughness": {"roughnessFactor": roughness}}]
            })),
        );
        let said = dir.expect(&format!("a.glb {SMALL} -o a.exr"), 0);
        assert_eq!(mentions(&said, "--clamp 0"), is_polished, "{said}");
        assert_eq!(mentions(&said, "clamp"), is_polished, "{said}");
        assert!(!dir.expect(&format!("a.glb {SMALL} -o a.exr --clamp 0"), 0).contains("clamp"));
    }
    dir.write("box.obj", box_of([1, 1, 1]));
    assert!(!dir.expect(&format!("box.obj {SMALL} -o a.exr"), 0).contains("clamp"));
}

/// A part with a material from the scene, and a whole file with its own materials.
#[test]
fn scene_can_use_a_gltf_file_or_a_part() {
    let dir = TestDir::new();
    dir.write("cubes.glb", cubes(&checker()));
    let check = |text: &str, code: i32| {
        dir.write(
            "scene.toml",
            format!("[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n[environment]\ncolor = 1\n{text}"),
        );
        let output = dir.run("check scene.toml");
        assert_eq!(output.status.code(), Some(code), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8([output.stdout, output.stderr].concat()).expect("UTF-8")
    };
    let whole = check("[[mesh]]\nfile = \"cubes.glb\"\n", 0);
    assert_mentions(&whole, &["1 object", "24 triangles"]);
    let part = "[[mesh]]\nfile = \"cubes.glb\"\npart = 0\n";
    let material = "material = \"m\"\n[materials.m]\ndiffuse = { texture = \"t\" }\n[textures.t]\nfile = \"cubes.glb\"\n";
    let said = check(&format!("{part}{material}image = 0\n"), 0);
    assert_mentions(&said, &["1 object", "12 triangles", "1 texture"]);
    assert_mentions(&check(part, 2), &["scene.toml", "`material`"]);
    assert_mentions(&check(&format!("{part}{material}"), 2), &["scene.toml", ".glb"]);
    assert_mentions(&check(&format!("{part}{material}image = 7\n"), 2), &["images[7]", "1"]);
    let said = check(&format!("{}{material}image = 0\n", part.replace('0', "9")), 2);
    assert_mentions(&said, &["part[9]", "1"]);
    let said = check("[[mesh]]\nfile = \"a.obj\"\npart = 0\n", 2);
    assert_mentions(&said, &["a.obj"]);
}

#[test]
fn broken_model_errors_have_a_position() {
    let dir = TestDir::new();
    for (file, content, fact) in [
        ("a.glb", &b"glTF\x02\0\0\0\0\0\0\0"[..], "JSON"),
        ("a.gltf", b"{", "line 1: column 1"),
        ("a.gltf", b"{\"asset\": {\"version\": \"2.0\"}}", "faces"),
        ("a.stl", b"solid a\nvertex", "line 2"),
        ("a.ply", b"ply\n", "a.ply"),
    ] {
        dir.write(file, content);
        let said = dir.expect(&format!("{file} {SMALL}"), 2);
        assert_mentions(&said, &[file, fact]);
    }
}

#[test]
fn small_distant_model_is_framed() {
    let dir = TestDir::new();
    let moved = |size: f64, to: f64| {
        let corner = |bits: i32| {
            let at = |axis: i32, length: f64| to + size * length * f64::from(bits >> axis & 1);
            format!("v {:e} {:e} {:e}\n", at(0, 3.0), at(1, 2.0), at(2, 1.0))
        };
        let corners: String = (0..8).map(corner).collect();
        corners + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
    };
    dir.write("near.obj", moved(1.0, 0.0));
    let near = picture(&dir, "near.obj --view normal");
    for (size, to) in [(1e-6, 1.0), (1e-6, 10.0), (1e-5, 100.0), (1e-7, 10.0), (1e7, 1e15), (1e9, 1e17)] {
        dir.write("far.obj", moved(size, to));
        let far = picture(&dir, "far.obj --view normal");
        let squares: f32 = near.iter().zip(&far).map(|(a, b)| (a - b) * (a - b)).sum();
        let off = (squares / near.len() as f32).sqrt();
        assert!(off < 0.05, "{size} at {to}: {off}");
    }
}

#[test]
fn damaged_images_are_not_imported() {
    let dir = TestDir::new();
    let mut damaged = checker();
    let place = damaged.len() - 20;
    damaged[place] ^= 255;
    dir.write("a.glb", cubes(&damaged));
    for call in ["check a.glb", "import a.glb"] {
        let said = dir.expect(call, 2);
        assert_mentions(&said, &["a.glb"]);
    }
    let said = dir.expect("import a.glb", 2);
    assert_mentions(&said, &["a.glb", "images[0]"]);
}

#[test]
fn unusable_models_are_rejected() {
    let dir = TestDir::new();
    for ending in ["obj", "off"] {
        let text = match ending {
            "obj" => "v 1e20 0 0\nv 1 0 0\nv 0 1e20 0\nf 1 2 3\n",
            _ => "OFF\n3 1 0\n1e20 0 0\n1 0 0\n0 1e20 0\n3 0 1 2\n",
        };
        dir.write(&format!("far.{ending}"), text);
        let said = dir.expect(&format!("check far.{ending}"), 2);
        let numbers = said.split([' ', ',', '\n']).filter_map(|word| word.parse::<f64>().ok());
        assert!({ numbers }.any(|number| (number / 1e20 - 1.0).abs() < 1e-6), "{said}");
        assert_mentions(&said, &["1e18"]);
        assert!(!said.contains("position"), "{said}");
    }
    dir.write("a.fbx", "Kaydara FBX Binary");
    let said = dir.expect("check a.fbx", 2);
    assert_mentions(&said, &[".fbx", ".obj", ".glb", ".gltf"]);
    let said = dir.expect("check none.stl", 2);
    assert!(!said.contains("glimt new"), "{said}");
    fs::create_dir(dir.path("folder.ply")).expect("a folder");
    let said = dir.expect("check folder.ply", 2);
    assert_mentions(&said, &["folder.ply", "folder", "model"]);
    assert!(!said.contains("scene.toml"), "{said}");
}

#[test]
fn model_errors_do_not_quote_generated_scene() {
    let dir = TestDir::new();
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl q\nf 1/1 2/1 3/1\n";
    dir.write("a.obj", format!("mtllib a.mtl\n{triangle}"));
    // The material file is missing.
    for call in [format!("a.obj {SMALL} -o a.png"), "check a.obj".to_owned()] {
        let said = String::from_utf8(dir.run(&call).stderr).expect("UTF-8");
        assert_mentions(&said, &["a.mtl"]);
    }
    dir.write("a.mtl", "newmtl q\nmap_Kd nope.png\n");
    let said = dir.expect(&format!("a.obj {SMALL} -o a.png"), 0);
    assert!(said.contains("nope.png") && said.contains("--> a.obj\n"), "{said}");
    let said = dir.expect("check a.obj", 2);
    assert!(said.contains("nope.png") && said.contains("--> a.obj\n"), "{said}");
    dir.write("nope.png", checker());
    let said = dir.expect(&format!("a.obj {SMALL} -o nope.png"), 2);
    assert!(mentions(&said, "nope.png") && !said.contains("a.obj:"), "{said}");
}

/// If a model is invisible, the image shows only the ground, so a warning must explain why.
#[test]
fn invisible_model_warns() {
    let dir = TestDir::new();
    let said = |file: &str| {
        let said = dir.expect(&format!("{file} {SMALL} -o a.exr"), 0);
        (said.matches("opacity").count(), said)
    };
    let mut unseen = Vec::new();
    for (material, is_seen) in [
        (json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}), false),
        (json!({"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.3]}}), false),
        (json!({"alphaMode": "MASK", "alphaCutoff": 2}), false),
        (json!({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.1]}}), true),
        (json!({"alphaMode": "OPAQUE", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}), true),
        (json!({"alphaMode": "MASK", "alphaCutoff": 1}), true),
    ] {
        let mut glb = Glb::default();
        let mut cube = cube(&mut glb);
        cube["material"] = json!(0);
        let is_beyond = material["alphaCutoff"] == 2;
        dir.write(
            "a.glb",
            glb.finish(json!({
                "nodes": [{"mesh": 0}], "meshes": [{"primitives": [cube]}], "materials": [material]
            })),
        );
        let (count, said) = said("a.glb");
        assert_eq!(count, usize::from(!is_seen), "{material}: {said}");
        assert_eq!(mentions(&said, "materials[0]"), is_beyond, "{said}");
        if !is_seen {
            unseen.push(dir.bytes("a.exr"));
        }
        if !is_beyond {
            dir.expect("import a.glb --strict", 0);
            fs::remove_file(dir.path("a.toml")).expect("removed");
            fs::remove_dir_all(dir.path("a_files")).expect("removed");
        }
    }
    assert!(unseen.iter().all(|picture| *picture == unseen[0]), "images must show only the ground");
    // A single visible face is enough.
    let faces = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl p\nf 1 2 3\nusemtl q\nf 1 3 2\n";
    dir.write("a.obj", faces);
    for (mtl, count) in [
        ("newmtl p\nd 0\nnewmtl q\nd 0\n", 1),
        ("newmtl p\nd 0\nnewmtl q\nd 0.5\n", 0),
        ("newmtl p\nd 0\n", 0),
        ("newmtl p\nd 0\nnewmtl q\nd 0\nillum 7\n", 0),
    ] {
        dir.write("a.mtl", mtl);
        let (found, said) = said("a.obj");
        assert_eq!(found, count, "{mtl}: {said}");
    }
}

/// A model is shown even if its images are missing.
#[test]
fn model_is_shown_without_missing_images() {
    let dir = TestDir::new();
    let faces = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl q\nf 1/1 2/2 3/3\n";
    dir.write("a.obj", faces);
    let maps = "map_Kd kd.png\nmap_Ks ks.png\nmap_Ke ke.png\nmap_d d.png\nnorm n.png\n";
    let names = ["kd.png", "ks.png", "ke.png", "d.png", "n.png"];
    let physical = "map_Pr pr.png\nmap_Pm pm.png\nmap_Kd kd.png\n";
    for (plain, maps, names) in [
        ("Kd 0.8 0.2 0.1\nKs 0.1 0.1 0.1\nNs 20\nKe 0.1 0 0\nd 0.7\n", maps, &names[..]),
        ("Kd 0.8 0.2 0.1\nPr 0.2\nPm 0.5\n", physical, &["kd.png", "pr.png", "pm.png"]),
    ] {
        // A missing emission map is not replaced with uniform emission.
        dir.write("a.mtl", format!("newmtl q\n{}", plain.replace("Ke 0.1 0 0\n", "")));
        let expected = picture(&dir, "a.obj");
        dir.write("a.mtl", format!("newmtl q\n{plain}{maps}"));
        for content in [None, Some("no picture")] {
            for name in names {
                match content {
                    None => drop(fs::remove_file(dir.path(name))),
                    Some(content) => dir.write(name, content),
                }
            }
            let said = dir.expect(&format!("a.obj {SMALL} -o a.exr"), 0);
            for name in names {
                assert!(said.contains(name), "{name}: {said}");
            }
            assert_mentions(&said, &["warning", "\"q\"", "a.obj"]);
            assert!(picture(&dir, "a.obj") == expected, "{maps}{content:?}");
        }
        // The missing image remains an input, and commands that need the complete model fail.
        let said = dir.expect(&format!("a.obj {SMALL} -o kd.png"), 2);
        assert_mentions(&said, &["kd.png"]);
        assert_eq!(dir.bytes("kd.png"), b"no picture");
        assert!(dir.expect("check a.obj", 2).contains("kd.png"));
    }
    // Check the same for glTF, with image files and embedded images.
    let plain = |glb: Vec<u8>| {
        dir.write("a.glb", glb);
        picture(&dir, "a.glb")
    };
    let mut glb = Glb::default();
    let mut bare = cube(&mut glb);
    bare["material"] = json!(0);
    let bare = plain(glb.finish(json!({
        "nodes": [{"mesh": 0, "name": "../cube"}], "meshes": [{"primitives": [bare]}], "materials": [{"pbrMetallicRoughness": {}}]
    })));
    assert!(plain(with_image("lost.png")) == bare);
    let said = dir.expect(&format!("a.glb {SMALL} -o a.exr"), 0);
    assert_mentions(&said, &["warning", "lost.png", "\"material\"", "a.glb"]);
    assert!(dir.expect("import a.glb", 2).contains("images[0]"));
    assert!(dir.expect("check a.glb", 2).contains("lost.png"));
    dir.write("lost.png", checker());
    assert!(picture(&dir, "a.glb") != bare);
    dir.write("lost.png", "no picture");
    assert!(picture(&dir, "a.glb") == bare);
    assert_mentions(&dir.expect(&format!("a.glb {SMALL} -o lost.png"), 2), &["lost.png"]);
    let mut damaged = checker();
    damaged.truncate(60);
    dir.write("a.glb", cubes(&damaged));
    let said = dir.expect(&format!("a.glb {SMALL} -o a.exr"), 0);
    assert_mentions(&said, &["warning", "\"paint \"1\"\"", "a.glb"]);
}

#[test]
fn model_image_records_its_view() {
    let dir = TestDir::new();
    dir.write("a.obj", box_of([1, 2, 3]));
    dir.expect(&format!("a.obj {SMALL} --from left --up z -o a.png"), 0);
    let info = |name: &str| String::from_utf8(dir.run(&format!("info {name}")).stdout).expect("UTF-8");
    let said = info("a.png");
    assert!(said.contains("  from        left\n") && said.contains("  up          z\n"), "{said}");
    dir.expect(&format!("a.obj {SMALL} -o b.png"), 0);
    let said = info("b.png");
    assert!(!said.contains("  from ") && !said.contains("  up "), "{said}");
}

#[test]
fn model_is_never_an_output() {
    let dir = TestDir::new();
    dir.write("a.obj", box_of([1, 2, 3]));
    std::os::unix::fs::symlink("a.obj", dir.path("a.png")).expect("a link");
    let said = dir.expect(&format!("a.obj {SMALL} -o a.png"), 2);
    assert_mentions(&said, &["a.png", "a.obj", "model"]);
    assert!(said.lines().all(|line| line.trim() != "|"), "{said}");
}
