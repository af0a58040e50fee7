//! Rules of the format that are easy to get wrong.

use super::*;

/// Asserts that `toml` contains all `lines`.
fn check(toml: &str, lines: &[&str]) {
    for line in lines {
        assert!(toml.contains(line), "{line} is missing:\n{toml}");
    }
}

/// Returns the number after `key = `, or the first number of an array.
fn number(toml: &str, key: &str) -> f64 {
    let rest = toml.split(&format!("\n{key} = ")).nth(1).unwrap_or_else(|| panic!("no {key}:\n{toml}"));
    let word: String =
        rest.chars().skip_while(|c| *c == '[').take_while(|c| "0123456789.-e".contains(*c)).collect();
    word.parse().unwrap_or_else(|_| panic!("{key}: {rest}"))
}

const LIGHT: &str = "LightSource \"infinite\"\n";

#[test]
fn left_handed_cameras_mirror_the_image() {
    let camera =
        |text: &str| toml_of(&format!("{text}Camera \"perspective\"\nWorldBegin\n{LIGHT}Shape \"sphere\""));
    let look_at = "LookAt 0 0 -5  0 0 0  0 1 0\n";
    let plain = camera(look_at);
    check(&plain, &["mirror = true", "position = [0, 0, -5]", "look_at = [0, 0, -4]"]);
    let flipped = camera(&format!("Scale -1 1 1\n{look_at}"));
    assert!(!flipped.contains("mirror"), "{flipped}");
    // Two reflections cancel.
    check(&camera(&format!("Scale -1 1 1\n{look_at}Scale -1 1 1\n")), &["mirror = true"]);
}

#[test]
fn field_of_view_is_along_the_shorter_side() {
    let fov = |width: u32, height: u32, rest: &str| {
        let film = format!("\"integer xresolution\" {width} \"integer yresolution\" {height} {rest}");
        let text = format!(
            "Film \"rgb\" {film}\nCamera \"perspective\" \"float fov\" 90\nWorldBegin\n{LIGHT}Shape \"sphere\""
        );
        toml_of(&text)
    };
    assert!((number(&fov(200, 100, ""), "fov") - 90.0).abs() < 1e-9);
    let tall = 2.0 * 2.0_f64.atan().to_degrees();
    assert!((number(&fov(100, 200, ""), "fov") - tall).abs() < 1e-6);
    // A crop is a smaller image with a shifted window.
    let cropped = fov(200, 100, "\"integer pixelbounds\" [100 200 0 50]");
    check(&cropped, &["width = 100", "height = 50", "shift = [-1, 0.5]"]);
    assert!((number(&cropped, "fov") - 2.0 * 0.5_f64.atan().to_degrees()).abs() < 1e-9);
}

#[test]
fn depth_defaults_to_five_bounces() {
    let depth = |integrator: &str| {
        number(&toml_of(&format!("{integrator}{CAMERA}WorldBegin\n{LIGHT}Shape \"sphere\"")), "max_depth")
    };
    assert_eq!(depth(""), 5.0);
    assert_eq!(depth("Integrator \"path\" \"integer maxdepth\" 17\n"), 17.0);
    assert_eq!(depth("Integrator \"bdpt\"\n"), 5.0);
    assert_eq!(depth("Integrator \"volpath\" \"integer maxdepth\" 100000\n"), 1000.0);
}

#[test]
fn only_reverse_orientation_turns_spheres() {
    let light = "AreaLightSource \"diffuse\"\n";
    let normal = |before: &str| number(&toml_of_world(&format!("{light}{before}Shape \"disk\"")), "normal");
    assert_eq!([normal(""), normal("Scale -1 1 1\n")], [0.0; 2]);
    let z = |before: &str| {
        toml_of_world(&format!("{light}{before}Shape \"disk\"")).contains("normal = [0, 0, -1]")
    };
    assert_eq!([z(""), z("Scale 1 1 -1\n"), z("ReverseOrientation\n")], [false, false, true]);
    // A sphere that emits inward becomes a mesh.
    let sphere = |before: &str| toml_of_world(&format!("{light}{before}Shape \"sphere\""));
    assert!(sphere("Scale -1 1 1\n").contains("[[sphere]]"));
    assert!(sphere("ReverseOrientation\n").contains("[[mesh]]"));
}

#[test]
fn fronts_of_emissive_meshes_follow_pbrt() {
    let front = |before: &str, rest: &str| {
        let world = format!(
            "AreaLightSource \"diffuse\"\n{before}Shape \"trianglemesh\" \"integer indices\" [0 1 2] \
             \"point3 P\" [0 0 0 1 0 0 0 1 0] {rest}"
        );
        let scene = SceneFolder::new(&format!("{CAMERA}WorldBegin\n{world}")).read().expect("a scene");
        let mesh = &generated_meshes(&scene)[0].mesh;
        let [a, b, c] = mesh.corners(0);
        (b - a).cross(c - a).z
    };
    let normals = "\"normal N\" [0 0 -1 0 0 -1 0 0 -1]";
    assert_eq!(front("", ""), 1.0);
    assert_eq!(front("ReverseOrientation\n", ""), -1.0);
    // Mirroring a shape does not flip its front, in glimt or in pbrt.
    assert_eq!(front("Scale -1 1 1\n", ""), 1.0);
    assert_eq!(front("", normals), -1.0);
    assert_eq!(front("ReverseOrientation\n", normals), 1.0);
}

#[test]
fn roughness_is_remapped_by_default() {
    let roughness = |text: &str| {
        number(
            &toml_of_world(&format!("{LIGHT}Material \"conductor\" {text}\nShape \"sphere\"")),
            "roughness",
        )
    };
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    close(roughness("\"float roughness\" 0.0625"), 0.5);
    close(roughness("\"float roughness\" 0.0625 \"bool remaproughness\" false"), 0.25);
    close(
        roughness("\"float uroughness\" 0.16 \"float vroughness\" 0.01 \"bool remaproughness\" false"),
        0.2,
    );
    close(roughness(""), 0.0);
    let anisotropy = |u: f64, v: f64| {
        let text = format!("\"float uroughness\" {u} \"float vroughness\" {v} \"bool remaproughness\" false");
        number(
            &toml_of_world(&format!("{LIGHT}Material \"conductor\" {text}\nShape \"sphere\"")),
            "anisotropy",
        )
    };
    // α_v / α_u = 1 − 0.9 · anisotropy.
    close(anisotropy(0.2, 0.1), 0.5 / 0.9);
    close(anisotropy(0.1, 0.2), -0.5 / 0.9);
}

#[test]
fn light_spectra_are_divided_by_their_luminance() {
    let intensity = |text: &str| {
        let toml = toml_of_world(&format!("LightSource \"point\" {text}\nShape \"sphere\""));
        let rest = toml
            .split("intensity = ")
            .nth(1)
            .expect("an intensity")
            .lines()
            .next()
            .expect("a line")
            .to_owned();
        let numbers: Vec<f64> =
            rest.trim_matches(['[', ']']).split(", ").map(|word| word.parse().expect("a number")).collect();
        match numbers[..] {
            [gray] => [gray; 3],
            [red, green, blue] => [red, green, blue],
            _ => panic!("{rest}"),
        }
    };
    let luminance = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    assert_eq!(intensity("\"rgb I\" [3 2 1] \"float scale\" 2"), [6.0, 4.0, 2.0]);
    assert!((luminance(intensity("\"blackbody I\" 4000 \"float scale\" 5")) - 5.0).abs() < 0.02);
    // The power of a point light is 4π times its intensity.
    let power = intensity("\"float power\" 12.566370614359172");
    assert!(power.iter().all(|part| (part - 1.0).abs() < 1e-6), "{power:?}");
}

#[test]
fn power_of_area_lights_is_per_triangle() {
    let quad = "AreaLightSource \"diffuse\" \"float power\" 6.283185307179586\nShape \"trianglemesh\" \
        \"integer indices\" [0 1 2 0 2 3] \"point3 P\" [0 0 0 2 0 0 2 2 0 0 2 0]";
    // 2π for each of two triangles of area 2.
    assert!((number(&toml_of_world(quad), "emission") - 1.0).abs() < 1e-6);
    let both = quad.replace("\"float power\"", "\"bool twosided\" true \"float power\"");
    let toml = toml_of_world(&both);
    check(&toml, &["emission_sides = \"both\""]);
    assert!((number(&toml, "emission") - 0.5).abs() < 1e-6);
    // The area of a sphere of radius 1 is 4π.
    let sphere = toml_of_world("AreaLightSource \"diffuse\" \"float power\" 100\nShape \"sphere\"");
    let pi = std::f64::consts::PI;
    assert!((number(&sphere, "emission") / (100.0 / (4.0 * pi * pi)) - 1.0).abs() < 1e-6, "{sphere}");
}

#[test]
fn iso_and_shutter_become_gain() {
    let text = format!(
        "Film \"rgb\" \"float iso\" 150\nCamera \"perspective\" \"float shutterclose\" 0.5\nWorldBegin\n{LIGHT}Shape \"sphere\""
    );
    assert_eq!(number(&toml_of(&text), "gain"), 0.75);
    assert!(!toml_of_world("Shape \"sphere\"").contains("gain"));
}

/// A gray 2 × 1 image with the values 64 and 128.
fn gray_pgm() -> Vec<u8> {
    [&b"P5\n2 1\n255\n"[..], &[64, 128]].concat()
}

fn folder_with_image(world: &str) -> SceneFolder {
    let folder = SceneFolder::new(&format!("{CAMERA}WorldBegin\n{LIGHT}{world}"));
    folder.write("a.pgm", &gray_pgm());
    folder.scene_from_document().unwrap_or_else(|errors| panic!("{errors:?}"));
    folder
}

fn toml_with_image(world: &str) -> String {
    folder_with_image(world).read().expect("a scene").document.to_toml()
}

#[test]
fn checker_cells_are_one_unit() {
    let texture = "Texture \"c\" \"spectrum\" \"checkerboard\" \"float uscale\" 4 \"float vscale\" 8 \
        \"float udelta\" 1 \"rgb tex1\" [1 0 0] \"rgb tex2\" [0 0 1]\n";
    let toml = toml_of_world(&format!(
        "{texture}Material \"diffuse\" \"texture reflectance\" \"c\"\nShape \"sphere\""
    ));
    check(&toml, &["repeat = [2, 4]", "offset = [0.5, 0]", "colors = [[1, 0, 0], [0, 0, 1]]"]);
}

#[test]
fn number_textures_decode_from_srgb() {
    let texture = "Texture \"t\" \"float\" \"imagemap\" \"string filename\" \"a.pgm\" \"float uscale\" 3\n";
    let toml = toml_with_image(&format!("{texture}Shape \"sphere\" \"texture alpha\" \"t\""));
    check(
        &toml,
        &["encoding = \"srgb\"", "opacity = { texture = \"a\", channel = \"r\" }", "repeat = [3, 1]"],
    );
    // The roughness is baked from linear values.
    let world = format!("{texture}Material \"conductor\" \"texture roughness\" \"t\"\nShape \"sphere\"");
    let folder = folder_with_image(&world);
    let scene = folder.read().expect("a scene");
    let file = scene.document.added_in_memory_files().values().next().expect("an image");
    let texel = &file.bytes[file.bytes.len() - 8..];
    let values = [0, 4].map(|at| f32::from_le_bytes(texel[at..at + 4].try_into().expect("4 bytes")));
    for (value, byte) in values.iter().zip([64.0_f64, 128.0]) {
        let linear = ((byte / 255.0 + 0.055) / 1.055).powf(2.4);
        assert!((f64::from(*value) - linear.powf(0.25)).abs() < 1e-5, "{value} {byte}");
    }
}

#[test]
fn displacement_keeps_its_scale() {
    let textures = "Texture \"raw\" \"float\" \"imagemap\" \"string filename\" \"a.pgm\" \"float vscale\" 2\n\
        Texture \"small\" \"float\" \"constant\" \"float value\" 0.002\n\
        Texture \"d\" \"float\" \"scale\" \"texture tex\" \"raw\" \"texture scale\" \"small\"\n";
    let toml = toml_with_image(&format!(
        "{textures}Material \"diffuse\" \"texture displacement\" \"d\"\nShape \"sphere\""
    ));
    check(&toml, &["bump_scale = 0.002", "bump = { texture = \"a\", channel = \"r\" }", "repeat = [1, 2]"]);
}

#[test]
fn inverted_images_are_baked() {
    let texture =
        "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.pgm\" \"bool invert\" true\n";
    let world = format!("{texture}Material \"diffuse\" \"texture reflectance\" \"t\"\nShape \"sphere\"");
    let scene = folder_with_image(&world).read().expect("a scene");
    let file = scene.document.added_in_memory_files().values().next().expect("an image");
    let first = f32::from_le_bytes(file.bytes[file.bytes.len() - 24..][..4].try_into().expect("4 bytes"));
    let linear = ((64.0 / 255.0 + 0.055) / 1.055_f64).powf(2.4);
    assert!((f64::from(first) - (1.0 - linear)).abs() < 1e-6, "{first}");
}

#[test]
fn included_paths_are_relative_to_the_first_file() {
    let folder = SceneFolder::new(&format!(
        "{CAMERA}WorldBegin\n{LIGHT}Include \"parts/a.pbrt\"\nInclude \"parts/b.pbrt\""
    ));
    folder.write(
        "parts/a.pbrt",
        b"Material \"diffuse\" # red\n\"rgb reflectance\" [1 # first\n0 0]\nInclude \"parts/c.pbrt\"",
    );
    folder.write("parts/b.pbrt", b"Shape \"plymesh\" \"string filename\" \"parts/t.ply\"");
    folder.write("parts/c.pbrt", b"Shape \"plymesh\" \"string filename\" \"parts/t.ply.gz\"");
    folder.write("parts/t.ply", TRIANGLE_PLY);
    folder.write("parts/t.ply.gz", &gzip(TRIANGLE_PLY));
    folder.scene_from_document().unwrap_or_else(|errors| panic!("{errors:?}"));
    let scene = folder.read().expect("a scene");
    let toml = scene.document.to_toml();
    check(&toml, &["file = \"parts/t.ply\"", "diffuse = [1, 0, 0]", "smooth = false"]);
    assert_eq!(toml.matches("[[mesh]]").count(), 2);
    assert_eq!(generated_meshes(&scene)[0].mesh.triangles.len(), 1);
    let watched: Vec<_> = scene.companions.iter().map(|one| one.path.file_name().expect("a name")).collect();
    for name in ["a.pbrt", "b.pbrt", "c.pbrt", "t.ply.gz"] {
        assert!(watched.iter().any(|watched| *watched == name), "{name}: {watched:?}");
    }
}

#[test]
fn imports_keep_their_graphics_state() {
    let folder = SceneFolder::new(&format!("{CAMERA}WorldBegin\n{LIGHT}Import \"a.pbrt\"\nShape \"sphere\""));
    folder.write("a.pbrt", b"Translate 5 0 0\nShape \"sphere\"");
    let toml = folder.read().expect("a scene").document.to_toml();
    check(&toml, &["center = [5, 0, 0]", "center = [0, 0, 0]"]);
}

#[test]
fn instances_multiply_the_current_transform() {
    let world = "ObjectBegin \"o\"\nTranslate 1 0 0\nMaterial \"diffuse\" \"rgb reflectance\" [0 1 0]\nShape \"sphere\"\nObjectEnd\n\
        Scale 2 2 2\nObjectInstance \"o\"\nMaterial \"conductor\"\nObjectInstance \"o\"\n";
    let toml = toml_of_world(&format!("{LIGHT}{world}"));
    check(
        &toml,
        &[
            "[[groups.o.sphere]]",
            "center = [1, 0, 0]",
            "matrix = [2, 0, 0, 0,  0, 2, 0, 0,  0, 0, 2, 0,  0, 0, 0, 1]",
        ],
    );
    assert_eq!(toml.matches("[[instance]]").count(), 2);
    // Shapes keep the material of their definition.
    assert!(!toml.contains("metal"), "{toml}");
}

#[test]
fn conductors_are_copper_by_default() {
    let toml = toml_of_world(&format!("{LIGHT}Material \"conductor\"\nShape \"sphere\""));
    check(&toml, &["type = \"metal\"", "roughness = 0"]);
    let [red, blue] = [number(&toml, "eta"), number(&toml, "k")];
    assert!((0.1..0.4).contains(&red) && (3.0..4.0).contains(&blue), "{toml}");
    // The index of refraction of a coated metal is relative to the coat.
    let coated = toml_of_world(&format!(
        "{LIGHT}Material \"coatedconductor\" \"float interface.eta\" 2\nShape \"sphere\""
    ));
    assert!((number(&coated, "eta") - red / 2.0).abs() < 1e-6, "{coated}");
    check(&coated, &["coat = 1", "coat_ior = 2", "coat_roughness = 0"]);
}

#[test]
fn conductor_reflectance_is_exact() {
    let toml = toml_of_world(&format!(
        "{LIGHT}Material \"conductor\" \"rgb reflectance\" [0.5 0.5 0.5]\nShape \"sphere\""
    ));
    let (eta, k) = (number(&toml, "eta"), number(&toml, "k"));
    let reflectance = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
    assert!((reflectance - 0.5).abs() < 1e-6, "{toml}");
}

#[test]
fn mix_amount_weights_the_second_material() {
    let world = "MakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb reflectance\" [1 0 0]\n\
        MakeNamedMaterial \"b\" \"string type\" \"diffuse\" \"rgb reflectance\" [0 1 0]\n\
        MakeNamedMaterial \"m\" \"string type\" \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.25\n\
        NamedMaterial \"m\"\nShape \"sphere\"";
    check(&toml_of_world(&format!("{LIGHT}{world}")), &["materials = [\"a\", \"b\"]", "weight = 0.25"]);
}

#[test]
fn spheres_have_pbrts_texture_coordinates() {
    // u starts at +x and increases toward +y, and v = 1 is at +z.
    let texture =
        "Texture \"c\" \"spectrum\" \"checkerboard\"\nMaterial \"diffuse\" \"texture reflectance\" \"c\"\n";
    let toml = toml_of_world(&format!("{LIGHT}{texture}Shape \"sphere\" \"float radius\" 2"));
    check(&toml, &["matrix = [-1, 0, 0, 0,  0, 0, -1, 0,  0, 1, 0, 0,  0, 0, 0, 1]", "radius = 2"]);
}

#[test]
fn transforms_are_applied_to_the_right() {
    let toml =
        toml_of_world(&format!("{LIGHT}Translate 1 2 3\nRotate 90 0 0 2\nTranslate 1 0 0\nShape \"sphere\""));
    check(&toml, &["center = [1, 3, 3]"]);
    // `Transform` lists columns.
    let toml =
        toml_of_world(&format!("{LIGHT}Transform [1 0 0 0  0 1 0 0  0 0 1 0  4 5 6 1]\nShape \"sphere\""));
    check(&toml, &["center = [4, 5, 6]"]);
}

#[test]
fn absorbing_media_become_tints() {
    let medium = "MakeNamedMedium \"m\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [0 0 0] \"rgb sigma_a\" [0 1 2]\n\
        Material \"dielectric\"\nMediumInterface \"m\" \"\"\nShape \"sphere\"";
    let toml = toml_of_world(&format!("{LIGHT}{medium}"));
    check(&toml, &["tint = [1, 0.36787945, 0.13533528]"]);
    let scattering = medium.replace("[0 0 0]", "[1 1 1]");
    let scene =
        SceneFolder::new(&format!("{CAMERA}WorldBegin\n{LIGHT}{scattering}")).read().expect("a scene");
    assert!(
        scene.substitutions[0].message.starts_with("the lighting changes: medium"),
        "{:?}",
        scene.substitutions
    );
}

#[test]
fn curves_are_skipped_with_a_count() {
    let world = format!("{LIGHT}Shape \"curve\"\nShape \"curve\"\nShape \"sphere\"");
    let scene = SceneFolder::new(&format!("{CAMERA}WorldBegin\n{world}")).read().expect("a scene");
    let messages: Vec<_> = scene.substitutions.iter().map(|one| &*one.message).collect();
    assert_eq!(messages, ["the lighting changes: 2 × shape `curve`: skipped"]);
}

#[test]
fn missing_files_can_be_tolerated() {
    let folder = SceneFolder::new(&format!(
        "{CAMERA}WorldBegin\n{LIGHT}Shape \"plymesh\" \"string filename\" \"none.ply\"\nShape \"sphere\""
    ));
    let errors = folder.scene_from_document().expect_err("an error");
    assert!(errors[0].message.contains("file not found"), "{errors:?}");
    let place = errors[0].place.as_ref().expect("a place");
    assert_eq!(&place.source[place.span.clone()], "\"none.ply\"");
    let options = ForeignOptions {
        missing: crate::formats::foreign::MissingAssetMode::Note,
        ..ForeignOptions::default()
    };
    let scene = read_path(&folder.path(), &options).expect("a scene");
    assert!(scene.substitutions[0].message.contains("missing mesh"));
}
