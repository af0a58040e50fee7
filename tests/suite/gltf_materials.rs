//! Materials of glTF files, compared with the same materials in scene files.

use serde_json::{Value, json};

use super::gltf::{Glb, cube};
use super::test_dir::{TestDir, assert_mentions};

/// A PNG of 2 × 2 pixels.
fn png(pixels: [[u8; 4]; 4]) -> Vec<u8> {
    let image = image::RgbaImage::from_raw(2, 2, pixels.concat()).expect("four pixels");
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("encoded");
    bytes.into_inner()
}

/// A cube with this material and two images: 0 has colors, and 1 has different numbers in each channel.
fn painted_cube(material: &Value) -> Vec<u8> {
    let mut glb = Glb::default();
    let mut painted = cube(&mut glb);
    painted["material"] = json!(0);
    let images = [
        png([[250, 90, 30, 255], [40, 200, 90, 255], [90, 30, 220, 255], [240, 240, 240, 255]]),
        png([[200, 30, 90, 250], [20, 120, 255, 60], [90, 250, 0, 130], [255, 60, 160, 10]]),
    ];
    let views = images.map(|image| glb.view(&image));
    glb.finish(json!({
        "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "translation": [0, 1, 0]}],
        "meshes": [{"primitives": [painted]}], "materials": [material],
        "textures": [{"source": 0}, {"source": 1}],
        "images": views.map(|view| json!({"bufferView": view, "mimeType": "image/png"}))
    }))
}

/// Linear pixel values of a file's image.
fn picture(dir: &TestDir, file: &str) -> Vec<f32> {
    let options = "--width 40 --height 30 --samples 4 --error 0 --progress none --force";
    dir.expect(&format!("{file} --once -o a.exr {options}"), 0);
    image::open(dir.path("a.exr")).expect("an image").to_rgb32f().into_raw()
}

/// Compares a material in a glTF file with tables of a scene file. Returns the notes.
fn compare(material: &Value, tables: &str) -> String {
    let dir = TestDir::new();
    dir.write("a.glb", painted_cube(material));
    let notes = dir.expect("import a.glb -o imported.toml", 0);
    let imported = std::fs::read_to_string(dir.path("imported.toml")).expect("a scene");
    // Replace the materials, which precede the mesh.
    let start = ["[textures", "[materials"].iter().filter_map(|head| imported.find(head)).min();
    let (start, end) = (start.expect("a material"), imported.find("[[mesh]]").expect("a mesh"));
    let textures =
        "[textures.colors]\nfile = \"a.glb\"\nimage = 0\n[textures.numbers]\nfile = \"a.glb\"\nimage = 1\n";
    dir.write("hand.toml", format!("{}{textures}{tables}\n{}", &imported[..start], &imported[end..]));
    let own = picture(&dir, "a.glb");
    assert!(own == picture(&dir, "hand.toml"), "{tables}\n{imported}");
    assert!(own == picture(&dir, "imported.toml"), "{imported}");
    // The extensions must affect the image.
    let mut plain = material.clone();
    plain["extensions"] = json!({});
    dir.write("plain.glb", painted_cube(&plain));
    assert!(own != picture(&dir, "plain.glb"), "{tables}");
    notes
}

#[test]
fn clear_coats_equal_hand_written_ones() {
    let base =
        json!({"baseColorFactor": [0.5, 0.25, 0.125, 1], "metallicFactor": 0.0, "roughnessFactor": 0.75});
    let coat = |coat: Value| json!({"name": "m", "pbrMetallicRoughness": base, "extensions": {"KHR_materials_clearcoat": coat}});
    let keys = "[materials.m]\ntype = \"principled\"\ncolor = [0.5, 0.25, 0.125]\nroughness = 0.75\n";
    let said = compare(
        &coat(json!({"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.25})),
        &format!("{keys}clearcoat = 0.75\nclearcoat_roughness = 0.25\n"),
    );
    assert!(!said.contains("materials[0]"), "{said}");
    // The same layer has two names. The weight is in the red channel, the roughness in the green one.
    let textured = json!({
        "clearcoatFactor": 1.0, "clearcoatTexture": {"index": 1},
        "clearcoatRoughnessFactor": 1.0, "clearcoatRoughnessTexture": {"index": 1},
        "clearcoatNormalTexture": {"index": 0}
    });
    let numbers = "coat = { texture = \"numbers\", channel = \"r\" }\n\
                   coat_roughness = { texture = \"numbers\", channel = \"g\" }\n";
    let said = compare(&coat(textured), &format!("{keys}{numbers}"));
    assert_mentions(&said, &["materials[0]", "clear coat's normal map is ignored"]);
}

#[test]
fn diffuse_transmission_equals_hand_written_one() {
    let material = |base: Value, through: Value| {
        let extensions = json!({"KHR_materials_diffuse_transmission": through});
        json!({"name": "leaf", "pbrMetallicRoughness": base, "extensions": extensions})
    };
    let base = json!({"baseColorFactor": [0.5, 0.75, 0.25, 1], "metallicFactor": 0.0});
    let kind = "type = \"principled\"\nroughness = 1.0\n";
    // A quarter of the light is transmitted.
    let through = json!({"diffuseTransmissionFactor": 0.25, "diffuseTransmissionColorFactor": [1, 0.5, 0]});
    let said = compare(
        &material(base.clone(), through),
        &format!(
            "[materials.leaf]\n{kind}color = [0.375, 0.5625, 0.1875]\ndiffuse_transmission = [0.25, 0.125, 0]\n"
        ),
    );
    assert!(!said.contains("materials[0]"), "{said}");
    // Textures of both colors.
    let textured = json!({
        "diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [1, 0.5, 0.25],
        "diffuseTransmissionColorTexture": {"index": 0}
    });
    compare(
        &material(json!({"baseColorTexture": {"index": 0}, "metallicFactor": 0.0}), textured),
        &format!(
            "[textures.reflected]\nfile = \"a.glb\"\nimage = 0\nfactor = 0.5\n\
             [textures.transmitted]\nfile = \"a.glb\"\nimage = 0\nfactor = [0.5, 0.25, 0.125]\n\
             [materials.leaf]\n{kind}color = {{ texture = \"reflected\" }}\n\
             diffuse_transmission = {{ texture = \"transmitted\" }}\n"
        ),
    );
    // A texture of the weight, in its alpha channel, blends reflection and transmission.
    let weighted = json!({"diffuseTransmissionFactor": 1.0, "diffuseTransmissionTexture": {"index": 1}, "diffuseTransmissionColorFactor": [1, 0.5, 0]});
    let color = "color = [0.5, 0.75, 0.25]\n";
    compare(
        &material(base, weighted),
        &format!(
            "[materials.front]\n{kind}{color}[materials.back]\n{kind}color = 0\ndiffuse_transmission = [1, 0.5, 0]\n\
             [materials.leaf]\ntype = \"blend\"\nmaterials = [\"front\", \"back\"]\n\
             weight = {{ texture = \"numbers\", channel = \"a\" }}\n"
        ),
    );
    // Metal keeps its reflectance.
    let half = json!({"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [1, 0.5, 0]});
    compare(
        &material(json!({"baseColorFactor": [0.5, 0.75, 0.25, 1], "metallicFactor": 0.25}), half),
        &format!(
            "[materials.rest]\n{kind}color = [0.25, 0.375, 0.125]\ndiffuse_transmission = [0.5, 0.25, 0]\n\
             [materials.metal]\n{kind}{color}metallic = 1.0\n\
             [materials.leaf]\ntype = \"blend\"\nmaterials = [\"rest\", \"metal\"]\nweight = 0.25\n"
        ),
    );
}

#[test]
fn layers_that_glass_lacks_are_noted() {
    let material = |volume: Value, transmission: f64| {
        json!({"pbrMetallicRoughness": {"metallicFactor": 0.0}, "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": transmission}, "KHR_materials_volume": volume,
            "KHR_materials_clearcoat": {"clearcoatFactor": 1.0},
            "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5}
        }})
    };
    let notes = |material: Value| {
        let dir = TestDir::new();
        dir.write("a.glb", painted_cube(&material));
        // Each approximation is an error with --strict.
        dir.expect("import a.glb -o strict.toml --strict", 2);
        dir.expect("import a.glb -o a.toml", 0)
    };
    let said = notes(material(json!({"thicknessFactor": 1.0}), 1.0));
    assert_mentions(&said, &["clear coat of solid glass", "diffuse transmission of solid glass"]);
    let said = notes(material(json!({}), 0.5));
    assert_mentions(&said, &["straight through"]);
    assert!(!said.contains("glass"), "{said}");
    let said = notes(material(json!({"thicknessFactor": 1.0}), 0.0));
    assert_mentions(&said, &["volume below", "thin"]);
}

#[test]
fn merged_scenes_keep_diffuse_transmission() {
    let dir = TestDir::new();
    let material = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.75, 0.25, 1], "metallicFactor": 0.0},
        "extensions": {"KHR_materials_diffuse_transmission":
            {"diffuseTransmissionFactor": 0.25, "diffuseTransmissionColorFactor": [1, 0.5, 0]}}
    });
    dir.write("a.glb", painted_cube(&material));
    let scene = |material: &str| {
        format!(
            "[camera]\nposition = [3, 3, 4]\nlook_at = [0, 1, 0]\n[render]\nintegrator = \"path\"\n[environment]\ncolor = 1\n\
             [materials.leaf]\ntype = \"principled\"\nroughness = 1.0\ncolor = [0.375, 0.5625, 0.1875]\n\
             diffuse_transmission = [0.25, 0.125, 0]\n[[mesh]]\nfile = \"a.glb\"\n{material}"
        )
    };
    dir.write("own.toml", scene(""));
    dir.write("hand.toml", scene("material = \"leaf\"\n"));
    assert!(picture(&dir, "own.toml") == picture(&dir, "hand.toml"));
}
