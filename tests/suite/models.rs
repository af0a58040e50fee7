//! Models in every file format, with materials from the file.

use super::test_dir::{TestDir, assert_mentions, mentions};

const CAMERA: &str = "[render]\nwidth = 24\nheight = 18\nsamples = 4\n[camera]\nposition = [0.3, 0.4, 3]\nlook_at = [0.5, 0.4, 0]\n\
                      [[light]]\nposition = [1, 2, 3]\nintensity = [9, 9, 9]\n[environment]\ncolor = [0.3, 0.4, 0.5]\n";

/// Linear pixel values of a scene's image.
fn picture(dir: &TestDir, scene: &str) -> Vec<f32> {
    dir.write("scene.toml", format!("{CAMERA}{scene}"));
    dir.expect("scene.toml --once -o scene.exr", 0);
    image::open(dir.path("scene.exr")).expect("a picture").to_rgb32f().into_raw()
}

#[test]
fn tetrahedron_looks_the_same_in_every_format() {
    let dir = TestDir::new();
    let corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    let words = |[a, b, c]: [i32; 3]| format!("{a} {b} {c}\n");
    let vertices = corners.map(words).concat();
    let numbered = faces.map(|face| format!("3 {}", words(face.map(|corner: usize| corner as i32)))).concat();
    dir.write("a.off", format!("OFF\n4 4 0\n{vertices}{numbered}"));
    let properties = ["x", "y", "z"].map(|name| format!("property float {name}\n")).concat();
    dir.write(
        "a.ply",
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\n{properties}element face 4\nproperty list uchar int \
             vertex_indices\nend_header\n{vertices}{numbered}"
        ),
    );
    let obj = corners.map(|corner| format!("v {}", words(corner))).concat()
        + &faces.map(|face| format!("f {}", words(face.map(|corner| corner as i32 + 1)))).concat();
    dir.write("a.obj", obj);
    let places = faces.map(|face| face.map(|corner| corners[corner]));
    let facet = |places: [[i32; 3]; 3]| {
        let vertices = places.map(|place| format!("vertex {}", words(place))).concat();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    dir.write("a.stl", format!("solid a\n{}endsolid a\n", places.map(facet).concat()));
    let mut bytes = [&b"solid is how many binary files begin"[..], &[0; 44], &4_u32.to_le_bytes()].concat();
    for place in places {
        bytes.extend([0; 12]);
        bytes.extend(place.as_flattened().iter().flat_map(|number| (*number as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    dir.write("b.STL", bytes);
    for smooth in [false, true] {
        let of = |file: &str| {
            let mesh =
                format!("[[mesh]]\nfile = \"{file}\"\nmaterial = \"m\"\nsmooth = {smooth}\n[materials.m]\n");
            picture(&dir, &mesh)
        };
        let expected = of("a.off");
        assert!(
            expected.iter().any(|value| (value - expected[0]).abs() > 0.1),
            "the tetrahedron must be visible"
        );
        for file in ["a.ply", "a.obj", "a.stl", "b.STL"] {
            assert!(of(file) == expected, "{file}, smooth = {smooth}");
        }
    }
}

#[test]
fn physical_mtl_matches_principled_material() {
    let dir = TestDir::new();
    dir.write("dull.ppm", "P3 2 2 255 20 20 20 90 90 90 160 160 160 230 230 230\n");
    dir.write("skin.ppm", "P3 2 1 255 250 120 60 40 90 230\n");
    dir.write(
        "a.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n",
    );
    for (mtl, keys) in [
        ("Kd 0.8 0.4 0.2\nPr 0.3\n", "color = [0.8, 0.4, 0.2]\nroughness = 0.3\n"),
        (
            "Kd 0.8 0.4 0.2\nillum 3\nKs 1 1 1\nNs 90\nPm 1\nNi 1\n",
            "color = [0.8, 0.4, 0.2]\nmetallic = 1.0\n",
        ),
        (
            "Kd 0.8 0.4 0.2\nNi 1.8\nPc 0.5\nPcr 0.25\nPs 0.1\naniso 0.2\n",
            "color = [0.8, 0.4, 0.2]\nior = 1.8\nclearcoat = 0.5\nclearcoat_roughness = 0.25\n",
        ),
        (
            "Kd 0.8 0.4 0.2\nPr 0.3\nKe 2 1 0.5\n",
            "color = [0.8, 0.4, 0.2]\nroughness = 0.3\nemission = [2, 1, 0.5]\n",
        ),
        (
            "Kd 0.8 0.4 0.2\nPr 0.3\nKe 2 1 0.5\nd 0.25\n",
            "color = [0.8, 0.4, 0.2]\nroughness = 0.3\nemission = [2, 1, 0.5]\nopacity = 0.25\n",
        ),
        ("Kd 0.8 0.4 0.2\nPr 0.3\nTr 0.25\n", "color = [0.8, 0.4, 0.2]\nroughness = 0.3\nopacity = 0.75\n"),
        // An opacity map overrides the glass illumination model.
        (
            "Kd 0.8 0.4 0.2\nPr 0.3\nKe 2 1 0.5\nillum 9\nd 0.5\nmap_d dull.ppm\n",
            "color = [0.8, 0.4, 0.2]\nroughness = 0.3\nemission = [2, 1, 0.5]\nopacity = { texture = \"dull\" }\n",
        ),
        (
            "map_Kd skin.ppm\nmap_Pr dull.ppm\nmap_Pm dull.ppm\n",
            "color = { texture = \"skin\" }\nroughness = { texture = \"dull\" }\nmetallic = { texture = \"dull\" }\n",
        ),
        // A coat also covers emission.
        (
            "Kd 0.8 0.4 0.2\nKe 2 1 0.5\nPc 0.75\nPcr 0.25\n",
            "color = [0.8, 0.4, 0.2]\nemission = [2, 1, 0.5]\nclearcoat = 0.75\nclearcoat_roughness = 0.25\n",
        ),
        (
            "Kd 0.8 0.4 0.2\nKe 2 1 0.5\nmap_Pc dull.ppm\nmap_Pcr dull.ppm\n",
            "color = [0.8, 0.4, 0.2]\nemission = [2, 1, 0.5]\ncoat = { texture = \"dull\" }\ncoat_roughness = { texture = \"dull\" }\n",
        ),
        (
            "Kd 0.8 0.4 0.2\nPr 0.5\nPm 1\naniso 0.75\nPc 0.5\nPcr 0.25\n",
            "type = \"metal\"\ncolor = [0.8, 0.4, 0.2]\nroughness = 0.5\nanisotropy = 0.75\ncoat = 0.5\ncoat_roughness = 0.25\n",
        ),
    ] {
        dir.write("a.mtl", format!("newmtl m\n{mtl}"));
        let textures = "[textures.skin]\nfile = \"skin.ppm\"\n[textures.dull]\nfile = \"dull.ppm\"\n";
        let kind = if keys.starts_with("type") { "" } else { "type = \"principled\"\n" };
        let declared = format!("[materials.m]\n{kind}{keys}{textures}");
        let own = picture(&dir, "[[mesh]]\nfile = \"a.obj\"\n");
        let expected = picture(&dir, &format!("[[mesh]]\nfile = \"a.obj\"\nmaterial = \"m\"\n{declared}"));
        assert!(own == expected, "{mtl}");
        dir.write("a.mtl", "newmtl m\nKd 0.8 0.4 0.2\n");
        assert!(picture(&dir, "[[mesh]]\nfile = \"a.obj\"\n") != expected, "{mtl}: must affect the image");
    }
}

#[test]
fn mtl_maps_scale_like_constants() {
    let dir = TestDir::new();
    dir.write("white.ppm", "P3 1 1 255 255 255 255\n");
    dir.write("dark.ppm", "P3 1 1 255 90 90 90\n");
    dir.write(
        "a.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n",
    );
    let of = |mtl: &str| {
        dir.write("a.mtl", format!("newmtl m\n{mtl}"));
        picture(&dir, "[[mesh]]\nfile = \"a.obj\"\n")
    };
    let highlight = of("Kd 0 0 0\nKs 1 1 1\nNs 20\n");
    assert!(highlight.iter().any(|value| *value > 0.01), "the highlight must be visible");
    for (map, constant) in [
        ("Kd 0 0 0\nNs 20\nmap_Ks white.ppm\n", highlight),
        ("Kd 0 0 0\nNs 20\nmap_Ks -mm 0.25 0.5 white.ppm\n", of("Kd 0 0 0\nKs 0.75 0.75 0.75\nNs 20\n")),
        // Values below 0 become 0.
        ("map_Kd -mm -0.5 1 dark.ppm\n", of("Kd 0 0 0\n")),
        ("map_Kd -mm -0.5 1 white.ppm\n", of("Kd 0.5 0.5 0.5\n")),
        ("Kd 0 0 0\nKe 1 1 1\nmap_Ke -mm -0.5 1 dark.ppm\n", of("Kd 0 0 0\n")),
    ] {
        let mapped = of(map);
        let differ = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-5 * b.abs();
        assert!(!mapped.iter().zip(&constant).any(differ), "{map}");
    }
}

/// MeshLab and some other programs invert `Tr`, so that the opaque value is 1 instead of 0.
#[test]
fn misused_mtl_statements_are_corrected() {
    let dir = TestDir::new();
    dir.write("shine.ppm", "P3 1 1 255 255 255 255\n");
    dir.write(
        "a.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\nusemtl n\nf 1/1 3/1 2/1\n",
    );
    let said = |mtl: &str| {
        dir.write("a.mtl", format!("newmtl m\n{mtl}newmtl n\n{mtl}newmtl unused\n{mtl}"));
        let said = dir.expect("a.obj --once --force --width 24 --height 18 --samples 4 -o a.exr", 0);
        (dir.bytes("a.exr"), said)
    };
    let (plain, quiet) = said("Kd 0.8 0.8 0.8\n");
    assert!(!quiet.contains("warning"), "{quiet}");
    let opaque = "`Tr 1` without `d`";
    let dull = "a.mtl:3: `Ks` has no effect unless `Ns`";
    for (mtl, words) in [
        ("Tr 1.000000\n", Some(opaque)),
        ("Tr 1\nd 1\n", None),
        ("Tr 0\n", None),
        ("Ks 0.8 0.8 0.8\nNs 0\nillum 2\n", Some(dull)),
        ("Ks 0.8 0.8 0.8\n", Some(dull)),
        ("Ks 0.8 0.8 0.8\nTr 1\n", Some(dull)),
        ("Ks 0.8 0.8 0.8\nTr 1\n", Some(opaque)),
        ("map_Ks shine.ppm\n", Some(dull)),
        ("Ks 0 0 0\nNs 0\n", None),
        // Illumination model 1 has no specular highlight.
        ("Ks 0.8 0.8 0.8\nNs 0\nillum 1\n", None),
    ] {
        let (picture, said) = said(&format!("Kd 0.8 0.8 0.8\n{mtl}"));
        assert!(picture == plain, "{mtl}");
        match words {
            Some(words) => assert_eq!(said.matches(words).count(), 1, "{mtl}: {said}"),
            None => assert!(!said.contains("warning"), "{mtl}: {said}"),
        }
    }
    assert!(said("Kd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNs 20\n").0 != plain, "the highlight must be visible");
}

#[test]
fn anisotropy_without_uv_warns() {
    let dir = TestDir::new();
    dir.write("a.stl", "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    let scene = |anisotropy: &str| {
        format!(
            "{CAMERA}[[mesh]]\nfile = \"a.stl\"\nmaterial = \"m\"\n[materials.m]\ntype = \"metal\"\ncolor = 0.9\nanisotropy = {anisotropy}\n"
        )
    };
    dir.write("brushed.toml", scene("0.5"));
    let stderr = dir.expect("brushed.toml --once -o a.exr", 0);
    assert_mentions(&stderr, &["warning", "a.stl", "`anisotropy`", "\"m\"", "brushed.toml"]);
    dir.write("plain.toml", scene("0.0"));
    assert!(!dir.expect("plain.toml --once -o b.exr", 0).contains("anisotropy"));
}

#[test]
fn missing_mtl_images_name_their_material() {
    let dir = TestDir::new();
    dir.write(
        "a.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl brick\nf 1/1 2/2 3/3\n",
    );
    dir.write("a.toml", format!("{CAMERA}[[mesh]]\nfile = \"a.obj\"\n"));
    dir.write("heights.pgm", "P2\n2 1\n255\n0 200\n");
    dir.write("a.mtl", "newmtl brick\nmap_Kd lost.png\n");
    let missing = dir.expect("a.toml --once -o a.png", 2);
    assert_mentions(&missing, &["a.mtl:2: cannot read lost.png", "\"brick\"", "a.obj"]);
    let shown = dir.expect("a.obj --once --width 24 --height 18 --samples 1 -o b.png", 0);
    assert_mentions(&shown, &["warning: a.mtl:2: cannot read lost.png", "\"brick\"", "a.obj"]);
    dir.write("lost.png", "no picture");
    let wrong = dir.expect("a.toml --once -o a.png", 2);
    assert_mentions(&wrong, &["a.mtl:2: ", "lost.png", "\"brick\"", "a.obj"]);
    dir.write("a.mtl", "newmtl brick\nmap_Bump heights.pgm\n");
    let gray = dir.expect("a.toml --once -o a.png", 0);
    assert_mentions(&gray, &["warning: a.mtl:2: ", "heights.pgm", "normals", "\"brick\""]);
}

/// Unusable values in a model cause warnings that name the file and line, with and without a scene.
#[test]
fn unusable_model_values_warn() {
    let dir = TestDir::new();
    dir.write("h.ppm", "P3 1 1 255 9 9 9\n");
    dir.write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wall\nf 1 2 3\n");
    dir.write("a.mtl", "newmtl wall\nTf 0 1 0\nPr 7\nmap_Kd -s 0 0 0 -unknown 3 h.ppm\n");
    dir.write("a.toml", format!("{CAMERA}[[mesh]]\nfile = \"a.obj\"\n"));
    let small = "--once --force --width 24 --height 18 --samples 1 -o a.png";
    for scene in ["a.obj", "a.toml"] {
        let said = dir.expect(&format!("{scene} {small}"), 0);
        for warning in [
            "a.obj: line 6: the file has no texture coordinates, so each triangle shows half of every texture in \"wall\"",
            "a.obj: a.mtl:2: `Tf` is ignored; use `tint` in a material of the scene",
            "a.obj: a.mtl:3: 7 in `Pr` is clamped to 1",
            "a.obj: a.mtl:4: option `-s 0 0 0` is ignored",
            "a.obj: a.mtl:4: option `-unknown 3` is ignored",
        ] {
            assert_eq!(
                said.matches(&format!("warning: {warning}\n")).count(),
                1,
                "{scene}: {warning}: {said}"
            );
        }
    }
    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
                  property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let body = "0 0 0 300 0 0\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n";
    dir.write("a.ply", format!("ply\nformat ascii 1.0\ncomment TextureFile x.png\n{header}{body}"));
    let said = dir.expect(&format!("a.ply {small}"), 0);
    assert!(said.contains("warning: line 3: the texture \"x.png\" is ignored"), "{said}");
    assert!(said.contains("warning: a.ply: line 14: the color component 300 is outside"), "{said}");
}

#[test]
fn unsuitable_images_warn() {
    let dir = TestDir::new();
    dir.write("heights.pgm", "P2\n2 1\n255\n0 200\n");
    let said = |material: &str| {
        dir.write(
            "a.toml",
            format!(
                "{CAMERA}[textures.t]\nfile = \"heights.pgm\"\n[materials.m]\n{material}\n\
                 [[sphere]]\ncenter = [0, 0, 0]\nradius = 1\nmaterial = \"m\"\n"
            ),
        );
        dir.expect("a.toml --once -o a.png", 0)
    };
    let gray = said("normal_map = \"t\"");
    assert_mentions(&gray, &["warning", "heights.pgm", "normals", "\"m\""]);
    let alpha = said("opacity = { texture = \"t\", channel = \"a\" }");
    assert_mentions(&alpha, &["warning", "heights.pgm", "alpha", "`channel = \"a\"`"]);
    for fine in ["bump = \"t\"", "opacity = { texture = \"t\" }", "diffuse = { texture = \"t\" }"] {
        let said = said(fine);
        assert!(!mentions(&said, "heights.pgm"), "{said}");
    }
}

#[test]
fn ineffective_mesh_keys_warn() {
    let dir = TestDir::new();
    let corners = "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n";
    dir.write("a.off", format!("COFF\n3 1 0\n{corners}3 0 1 2\n"));
    dir.write("dots.ppm", "P3\n2 1\n255\n0 0 0 255 255 255\n");
    let warnings = |material: &str, more: &str| {
        dir.write(
            "a.toml",
            format!(
                "{CAMERA}[[mesh]]\nfile = \"a.off\"\nmaterial = \"m\"\n{more}\n[materials.m]\n{material}\n\
                 [textures.dots]\nfile = \"dots.ppm\"\n"
            ),
        );
        dir.expect("a.toml --once -o a.png", 0)
    };
    let textured = warnings("diffuse = { texture = \"dots\" }", "");
    assert_mentions(&textured, &["warning", "a.off", "texture coordinates", "\"m\""]);
    let metal = warnings("type = \"metal\"\nelement = \"gold\"", "vertex_colors = true");
    assert_mentions(&metal, &["warning", "`vertex_colors`", "\"m\""]);
    let matte = warnings("diffuse = 0.5", "vertex_colors = true");
    assert!(!mentions(&matte, "`vertex_colors`") && !mentions(&matte, "texture coordinates"), "{matte}");
}
