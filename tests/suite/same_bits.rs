//! Bit-identical images on every machine and with every instruction set: compares hashes of small images.

use glimt::accel::InstructionSet;

use super::test_dir::TestDir;

/// FNV-1a hash of an image's float bits.
fn hash(dir: &TestDir, name: &str) -> u64 {
    let picture = image::open(dir.path(name)).expect("a picture").to_rgb32f();
    let bytes = picture.as_raw().iter().flat_map(|x| x.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// A scene with every kind of light and shape, a mirror, glass, textures on all shapes, a lens and a filter.
const EVERYTHING: &str = r#"
[render]
width = 40
height = 30
samples = 5
shadow_samples = 2
filter = "FILTER"
integrator = "INTEGRATOR"
ambient = [0.05, 0.06, 0.07]
background = [0.2, 0.3, 0.5]
[camera]
position = [0, 1.6, 5]
look_at = [0, 0.7, 0]
fov = 50
aperture = 0.02
[materials]
floor = { diffuse = [0.6, 0.6, 0.5], specular = [0.1, 0.1, 0.1], shininess = 20 }
red = { diffuse = [0.7, 0.2, 0.1], specular = [0.3, 0.3, 0.3], shininess = 33.5 }
mirror = { type = "mirror" }
glass = { type = "glass", tint = [0.8, 0.9, 0.95] }
lamp = { diffuse = [0, 0, 0], emission = [6, 5, 4] }
[[plane]]
material = "floor"
[[sphere]]
center = [-1.2, 0.6, 0]
radius = 0.6
material = "glass"
[[sphere]]
center = [0.3, 0.5, -0.8]
radius = 0.5
material = "mirror"
[[box]]
center = [1.5, 0.4, 0]
size = [0.6, 0.8, 0.6]
rotate = [0, 33, 0]
material = "red"
[[cylinder]]
a = [-0.4, 0, 0.9]
b = [-0.4, 0.7, 0.9]
radius = 0.2
material = "red"
[[cone]]
base = [0.7, 0, 0.9]
tip = [0.7, 0.8, 0.9]
radius = 0.3
material = "red"
[[torus]]
center = [-2, 0.5, -1]
axis = [0.3, 1, 0.2]
material = "red"
[[disk]]
center = [2.2, 1, -1]
normal = [-1, 0.3, 1]
material = "floor"
[[triangle]]
a = [-3, 0, -2]
b = [-1, 0, -2.5]
c = [-2, 2, -2.2]
material = "red"
[[quad]]
corner = [-0.5, 3, 0.5]
u = [1, 0, 0]
v = [0, 0, -1]
material = "mirror"
[[quad]]
corner = [-0.5, 2.9, -0.5]
u = [1, 0, 0]
v = [0, 0, 1]
material = "lamp"
[[sphere]]
center = [2, 2, 1]
radius = 0.2
material = "lamp"
[[cylinder]]
a = [-2.5, 1.8, 0]
b = [-2.5, 2.4, 0]
radius = 0.1
material = "lamp"
[[light]]
position = [1, 4, 3]
intensity = [9, 9, 9]
"#;

#[test]
fn images_match_known_hashes() {
    let dir = TestDir::new();
    dir.write("sky.ppm", "P3 4 3 255 90 120 200 20 30 40 255 250 200 70 70 80 60 80 90 0 0 0 9 9 9 200 90 60 30 20 10 8 9 7 6 5 4 1 2 3");
    let known: [(&str, &str, u64); 5] = [
        ("box", "whitted", 0x4b6e_6c5d_51e6_0310),
        ("tent", "whitted", 0x57e4_fc6c_bab8_6693),
        ("gaussian", "whitted", 0xb95c_77a4_8ada_0251),
        ("mitchell", "whitted", 0x7fe1_44cb_4b99_1dc9),
        ("box", "path", 0xa644_d7e3_6a2a_5180),
    ];
    let skies: [(&str, &str, u64); 4] = [
        ("color = \"skyblue\"", "whitted", 0x3525_da6c_881e_42b3),
        ("color = \"skyblue\"", "path", 0x0658_4b56_8bb5_d39f),
        ("file = \"sky.ppm\"\nrotate = 33", "whitted", 0xc1f7_3b7a_1b26_f9df),
        ("file = \"sky.ppm\"\nrotate = 33", "path", 0x2185_978f_7239_9b1a),
    ];
    let scene =
        |filter: &str, integrator| EVERYTHING.replace("FILTER", filter).replace("INTEGRATOR", integrator);
    let plain = known.map(|(filter, integrator, bits)| (scene(filter, integrator), bits));
    let around = skies
        .map(|(sky, integrator, bits)| (format!("{}[environment]\n{sky}\n", scene("box", integrator)), bits));
    let known: Vec<(String, u64)> = plain.into_iter().chain(around).collect();
    let mut tried = Vec::new();
    let mut wrong = Vec::new();
    for (name, instructions) in [
        ("portable", InstructionSet::Portable),
        ("avx2", InstructionSet::Avx2),
        ("avx512", InstructionSet::Avx512),
    ] {
        if instructions.or_best_if_unsupported() != instructions {
            continue;
        }
        tried.push(instructions);
        for (number, (text, expected)) in known.iter().enumerate() {
            dir.write("all.toml", text);
            let mut process = dir.glimt("all.toml --once -o all.exr");
            let output = process.env("GLIMT_SIMD", name).output().expect("it runs");
            assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
            let found = hash(&dir, "all.exr");
            if found != *expected {
                wrong.push(format!("image {number} with {name}: {found:#018x}"));
            }
        }
    }
    eprintln!("tried {tried:?}");
    assert!(
        tried.contains(&InstructionSet::Portable.max(InstructionSet::Avx512.or_best_if_unsupported())),
        "tried {tried:?}"
    );
    assert!(wrong.is_empty(), "different bits:\n{}", wrong.join("\n"));
}

/// A scene with microfacet materials, bump and normal maps, opacity and panes.
const MATERIALS: &str = r#"
[render]
width = 40
height = 30
samples = 4
integrator = "INTEGRATOR"
background = [0.2, 0.3, 0.5]
[camera]
position = [0, 1.6, 5]
look_at = [0, 0.7, 0]
fov = 50
[textures.waves]
file = "waves.ppm"
repeat = [3, 2]
rotate = 25
filter = "mipmap"
[textures.dapples]
file = "waves.ppm"
[textures.tiles]
type = "checker"
repeat = [5, 7]
rotate = 10
filter = "mipmap"
[textures.stripes]
type = "bands"
repeat = [9, 1]
[textures.stone]
type = "noise"
size = 0.2
filter = "mipmap"
[materials]
tiled = { type = "plastic", diffuse = { texture = "tiles" }, roughness = { texture = "stripes" } }
striped = { diffuse = { texture = "stripes" }, emission = { texture = "stone", scale = 0.5 } }
rock = { type = "metal", element = "CuZn", roughness = { texture = "stone" }, bump = "stone" }
floor = { type = "plastic", diffuse = 0.5, roughness = 0.3, bump = "waves", bump_scale = 0.05 }
gold = { type = "metal", element = "gold", roughness = 0.3, anisotropy = 0.5 }
steel = { type = "metal", color = 0.8, roughness = { texture = "waves" }, bump = "waves", bump_scale = 0.1 }
enamel = { type = "plastic", diffuse = [0.7, 0.1, 0.1], roughness = 0, opacity = 0.7 }
leaf = { type = "principled", color = [0.2, 0.6, 0.2], opacity = { texture = "waves", channel = "r" }, opacity_cutoff = 0.4 }
lacquer = { type = "principled", metallic = 0.5, clearcoat = 0.8, clearcoat_roughness = 0.1, normal_map = "waves" }
varnish = { diffuse = [0.6, 0.3, 0.1], coat = { texture = "waves" }, coat_roughness = 0.2, coat_tint = [0.9, 0.7, 0.5] }
chrome = { type = "mirror", coat = 0.5, coat_roughness = { texture = "waves" }, coat_tint = 0.5 }
worn = { type = "blend", materials = ["varnish", "chrome"], weight = { texture = "waves" } }
glass = { type = "glass", bump = "waves", bump_scale = 0.03 }
pane = { type = "glass", thin = true, tint = [0.8, 0.9, 0.9] }
lamp = { diffuse = 0, emission = [6, 5, 4], emission_sides = "both" }
bronze = { type = "metal", color = [0.8, 0.6, 0.3], roughness = 0.4, anisotropy = 0.4, distribution = "beckmann" }
rubber = { type = "plastic", diffuse = 0.4, roughness = { texture = "waves" }, distribution = "beckmann" }
frosted = { type = "glass", roughness = 0.4, distribution = "beckmann" }
paper = { diffuse = 0.3, specular = 0.2, diffuse_transmission = { texture = "dapples" } }
shade = { type = "principled", color = 0.4, diffuse_transmission = [0.5, 0.4, 0.3], roughness = 0.4 }
back = { diffuse = [0.2, 0.4, 0.7], sides = "front" }
[[plane]]
material = "floor"
[[sphere]]
center = [-1, 1.4, -0.5]
radius = 0.4
material = "bronze"
[[sphere]]
center = [0, 1.4, -0.5]
radius = 0.4
material = "rubber"
[[sphere]]
center = [1, 1.4, -0.5]
radius = 0.4
material = "frosted"
[[quad]]
corner = [-3, 0, -3]
u = [2, 0, 0]
v = [0, 2, 0]
material = "tiled"
[[quad]]
corner = [-1, 0.5, -3]
u = [2, 0, 0]
v = [0, 2, 0]
material = "striped"
[[sphere]]
center = [2.2, 0.6, -1.5]
radius = 0.6
material = "rock"
matrix = [1, 0, 0, 0, 0, 1.5, 0, 0, 0, 0.2, 1, 0, 0, 0, 0, 1]
[[quad]]
corner = [-2.2, 0, 0.5]
u = [0.4, 0, 0.3]
v = [0, 0.7, 0]
material = "paper"
[[quad]]
corner = [1.8, 0, 0.8]
u = [0.4, 0, -0.3]
v = [0, 0.7, 0]
material = "shade"
[[cylinder]]
a = [0.8, 0, 1.4]
b = [0.8, 0.3, 1.4]
radius = 0.25
caps = false
material = "back"
[[sphere]]
center = [-1.6, 0.5, 0]
radius = 0.5
material = "gold"
[[sphere]]
center = [-0.5, 0.5, 0]
radius = 0.5
material = "steel"
[[sphere]]
center = [0.6, 0.5, 0]
radius = 0.5
material = "enamel"
[[sphere]]
center = [1.7, 0.5, 0]
radius = 0.5
material = "lacquer"
[[sphere]]
center = [0, 1.5, -0.5]
radius = 0.5
material = "worn"
[[sphere]]
center = [0, 0.4, 1.2]
radius = 0.4
material = "glass"
[[quad]]
corner = [-2, 0, -1]
u = [2, 0, 0]
v = [0, 2, 0]
material = "leaf"
[[quad]]
corner = [0, 0, -1]
u = [2, 0, 0]
v = [0, 2, 0]
material = "pane"
[[disk]]
center = [0, 2.5, -2]
normal = [0, 0, 1]
radius = 0.6
material = "lamp"
[[light]]
position = [1, 4, 3]
intensity = [9, 9, 9]
"#;

#[test]
fn material_images_match_known_hashes() {
    let dir = TestDir::new();
    dir.write(
        "waves.ppm",
        "P3 3 3 255 0 20 90 250 100 30 90 10 200 80 90 100 30 20 10 200 210 220 9 100 80 140 50 60 70 200 3",
    );
    for integrator in ["whitted", "path"] {
        dir.write("materials.toml", MATERIALS.replace("INTEGRATOR", integrator));
        let sets = [InstructionSet::Portable, InstructionSet::Avx2, InstructionSet::Avx512];
        let names = ["portable", "avx2", "avx512"];
        let pictures =
            sets.into_iter().zip(names).filter(|(set, _)| set.or_best_if_unsupported() == *set).map(
                |(set, name)| {
                    let threads = set as usize + 1;
                    let mut process =
                        dir.glimt(&format!("materials.toml --once -o materials.exr --threads {threads}"));
                    let output = process.env("GLIMT_SIMD", name).output().expect("it runs");
                    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
                    (name, hash(&dir, "materials.exr"))
                },
            );
        let pictures: Vec<(&str, u64)> = pictures.collect();
        assert!(pictures.iter().all(|(_, bits)| *bits == pictures[0].1), "{integrator}: {pictures:x?}");
    }
}

/// A grid of `steps` × `steps` squares at y = 0 with slightly raised centers.
fn uneven_floor(steps: u32) -> String {
    let mut text = String::new();
    for i in 0..=steps {
        for j in 0..=steps {
            let at = |k: u32| 4.0 * f64::from(k) / f64::from(steps) - 2.0;
            text += &format!("v {} {} {}\n", at(i), 0.02 * f64::from((i * j) % 2), at(j));
        }
    }
    for i in 0..steps {
        for j in 0..steps {
            let corner = |i: u32, j: u32| i * (steps + 1) + j + 1;
            let [a, b, c, d] = [corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)];
            text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
    }
    text
}

#[test]
fn photon_image_does_not_depend_on_tree() {
    let dir = TestDir::new();
    dir.write("fine.obj", uneven_floor(40));
    dir.write("coarse.obj", uneven_floor(6));
    dir.write("cube.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n");
    for floor in ["fine", "coarse"] {
        let scene = format!(
            "[render]\nwidth = 48\nheight = 48\nsamples = 4\nmax_depth = 6\n[photons]\nenabled = true\ncount = 20000\n\
             [camera]\nposition = [0, 3, 4]\nlook_at = [0, 0.3, 0]\n[materials.floor]\n[materials.glass]\ntype = \"glass\"\n\
             [[light]]\ntype = \"point\"\nposition = [1, 3, 1]\nintensity = [20, 20, 20]\n\
             [[mesh]]\nfile = \"{floor}.obj\"\nmaterial = \"floor\"\n\
             [[mesh]]\nfile = \"cube.obj\"\nmaterial = \"floor\"\ntranslate = [-1.6, 0, -0.4]\nrotate = [0, 20, 0]\n\
             [[mesh]]\nfile = \"cube.obj\"\nmaterial = \"glass\"\ntranslate = [0.1, 0.1, -0.5]\nrotate = [0, 50, 0]\nsmooth = false\n"
        );
        dir.write("scene.toml", scene);
        let of = |accel: &str| {
            let output = dir.run(&format!("scene.toml --once -o all.exr --accel {accel}"));
            assert!(output.status.success(), "{accel}: {}", String::from_utf8_lossy(&output.stderr));
            hash(&dir, "all.exr")
        };
        let by_boxes = of("bvh");
        assert_eq!([of("bvh-high"), of("kdtree")], [by_boxes; 2], "{floor}");
    }
}

#[test]
fn photon_image_matches_known_hash() {
    const KNOWN: u64 = 0x777f_28d8_83fa_7d9c;
    let dir = TestDir::new();
    let text = EVERYTHING.replace("FILTER", "box").replace("INTEGRATOR", "whitted");
    dir.write("all.toml", format!("{text}[photons]\nenabled = true\ncount = 5000\n"));
    let mut wrong = Vec::new();
    for (name, instructions) in [
        ("portable", InstructionSet::Portable),
        ("avx2", InstructionSet::Avx2),
        ("avx512", InstructionSet::Avx512),
    ] {
        if instructions.or_best_if_unsupported() != instructions {
            continue;
        }
        for threads in [1, 2, 7] {
            let mut process = dir.glimt(&format!("all.toml --once -o all.exr --threads {threads}"));
            let output = process.env("GLIMT_SIMD", name).output().expect("it runs");
            assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
            let found = hash(&dir, "all.exr");
            if found != KNOWN {
                wrong.push(format!("{name}, {threads} threads: {found:#018x}"));
            }
        }
    }
    assert!(wrong.is_empty(), "different bits:\n{}", wrong.join("\n"));
}
