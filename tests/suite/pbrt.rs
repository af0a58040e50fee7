//! Scenes of pbrt, rendered and imported.

use super::test_dir::{TestDir, assert_mentions};

const SMALL: &str = "--once --force --samples 4";

/// Renders an image of 32 × 24 pixels and returns its linear pixel values.
fn picture(dir: &TestDir, line: &str) -> Vec<f32> {
    dir.expect(&format!("{line} {SMALL} -o picture.exr"), 0);
    image::open(dir.path("picture.exr")).expect("a picture").to_rgb32f().into_raw()
}

/// A camera at (0, 0, −5) that looks along z, with an image of 32 × 24 pixels.
const OPTIONS: &str = "Film \"rgb\" \"integer xresolution\" 32 \"integer yresolution\" 24\nPixelFilter \"box\"\n\
    LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\nWorldBegin\n";

/// Renders a world and returns the value of the pixel at a column and a row.
fn pixel(world: &str, column: usize, row: usize) -> [f32; 3] {
    let dir = TestDir::new();
    dir.write("map.pfm", equal_area_map());
    dir.write("scene.pbrt", format!("{OPTIONS}{world}"));
    let pixels = picture(&dir, "scene.pbrt");
    let at = 3 * (row * 32 + column);
    pixels[at..at + 3].try_into().expect("3 channels")
}

/// An equal-area map of 64 × 64 pixels: red toward +x, green toward +y, and blue toward +z of the light; black
/// toward the opposite directions.
fn equal_area_map() -> Vec<u8> {
    let mut bytes = b"PF\n64 64\n-1.0\n".to_vec();
    for row in (0..64).rev() {
        for column in 0..64 {
            let [x, y] = [column, row].map(|index| (f64::from(index) + 0.5) / 32.0 - 1.0);
            // The inner diamond is the upper half. x and y keep their signs everywhere.
            let is_up = x.abs() + y.abs() < 1.0;
            for is_lit in [x > 0.0, y > 0.0, is_up] {
                bytes.extend(f32::from(u8::from(is_lit)).to_le_bytes());
            }
        }
    }
    bytes
}

#[test]
fn pbrt_world_is_left_handed() {
    let ball = "AreaLightSource \"diffuse\" \"rgb L\" [2 3 4]\nTranslate 1 0 0\nShape \"sphere\" \"float radius\" 0.4\n";
    // At a distance of 5, the upper edge is at y = 1.82, so x = 1 is 6.6 pixels right of the center.
    assert_eq!(pixel(ball, 22, 12), [2.0, 3.0, 4.0]);
    assert_eq!(pixel(ball, 9, 12), [0.0; 3]);
}

#[test]
fn pbrt_lights_shine_from_their_front() {
    let light = |before: &str, normals: &str| {
        let mesh = "Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \"point3 P\" [-1 -1 0 1 -1 0 1 1 0 -1 1 0]";
        pixel(&format!("AreaLightSource \"diffuse\"\n{before}{mesh} {normals}"), 16, 12)[0] > 0.0
    };
    let toward_camera = "\"normal N\" [0 0 -1 0 0 -1 0 0 -1 0 0 -1]";
    assert!(!light("", "") && light("ReverseOrientation\n", "") && light("", toward_camera));
    assert!(!light("Scale -1 1 1\n", ""), "mirroring keeps the front");
    assert!(light("Scale 1 1 -1\n", ""), "but a turned front is turned");
    assert!(!light("ReverseOrientation\n", toward_camera));
}

#[test]
fn pbrt_maps_are_upright() {
    let map = "LightSource \"infinite\" \"string filename\" \"map.pfm\" \"float scale\" 2\n";
    let ball = "AttributeBegin Translate 0 0 -99 Shape \"sphere\" AttributeEnd\n";
    // The camera looks along z, and sees +x on the right and +y on top.
    assert_eq!(pixel(&format!("{map}{ball}"), 28, 3), [2.0, 2.0, 2.0]);
    assert_eq!(pixel(&format!("{map}{ball}"), 3, 3), [0.0, 2.0, 2.0]);
    assert_eq!(pixel(&format!("{map}{ball}"), 28, 20), [2.0, 0.0, 2.0]);
    // Turned by 180 degrees about y, the camera sees −z, and −x on the right.
    let turned = format!("AttributeBegin Rotate 180 0 1 0 {map} AttributeEnd\n{ball}");
    assert_eq!(pixel(&turned, 28, 3), [0.0, 2.0, 0.0]);
    // A reflection, which no rotation can express.
    let mirrored = format!("AttributeBegin Scale -1 1 1 {map} AttributeEnd\n{ball}");
    assert_eq!(pixel(&mirrored, 28, 3), [0.0, 2.0, 2.0]);
}

#[test]
fn pbrt_distant_lights_have_their_irradiance() {
    // A white wall that faces the light: L = E / π.
    let world = "LightSource \"distant\" \"point3 from\" [0 0 -1] \"point3 to\" [0 0 0] \"rgb L\" [1 2 3]\n\
        Material \"diffuse\" \"rgb reflectance\" [1 1 1]\nShape \"disk\" \"float radius\" 50\n";
    let expected = [1.0, 2.0, 3.0].map(|part: f32| part / std::f32::consts::PI);
    let found = pixel(world, 16, 12);
    assert!(
        found.iter().zip(expected).all(|(found, expected)| (found / expected - 1.0).abs() < 1e-3),
        "{found:?}"
    );
}

/// A scene whose meshes and images exist only in memory.
fn write_generated(dir: &TestDir) {
    let world = "LightSource \"infinite\" \"string filename\" \"map.pfm\"\n\
        Texture \"a\" \"spectrum\" \"checkerboard\" \"float uscale\" 3\n\
        Texture \"b\" \"spectrum\" \"imagemap\" \"string filename\" \"map.pfm\" \"float vscale\" 2\n\
        Texture \"t\" \"spectrum\" \"mix\" \"texture tex1\" \"a\" \"texture tex2\" \"b\" \"float amount\" 0.25\n\
        Material \"coateddiffuse\" \"texture reflectance\" \"t\" \"float roughness\" 0.2\n\
        Shape \"trianglemesh\" \"integer indices\" [0 1 2 0 2 3] \"point3 P\" [-2 -1 0 2 -1 0 2 1 2 -2 1 2] \
        \"point2 uv\" [0 0 1 0 1 1 0 1]\n\
        ObjectBegin \"o\" Shape \"sphere\" \"float radius\" 0.5 \"float zmax\" 0.2 ObjectEnd\n\
        Translate 0.5 0.5 -1 ObjectInstance \"o\"\n\
        AreaLightSource \"diffuse\" \"blackbody L\" 3000 \"float power\" 30 Translate -1 0 0 Shape \"sphere\" \"float radius\" 0.2\n";
    dir.write("map.pfm", equal_area_map());
    dir.write("scene.pbrt", format!("{OPTIONS}{world}"));
}

#[test]
fn imported_pbrt_scenes_have_the_same_pixels() {
    let dir = TestDir::new();
    write_generated(&dir);
    let direct = picture(&dir, "scene.pbrt");
    dir.expect("import scene.pbrt -o imported.toml", 0);
    let imported = picture(&dir, "imported.toml");
    assert!(direct.iter().any(|value| *value > 0.0));
    assert_eq!(
        direct.iter().map(|value| value.to_bits()).collect::<Vec<_>>(),
        imported.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    );
    for name in ["scene.pbrt", "imported.toml"] {
        assert!(dir.run(&format!("check {name}")).status.success(), "{name}");
    }
    // Values can be overridden by the names in the file.
    assert_ne!(direct, picture(&dir, "scene.pbrt --set materials.coateddiffuse.roughness=0.9"));
}

#[test]
fn pbrt_errors_name_the_place() {
    let dir = TestDir::new();
    dir.write("scene.pbrt", format!("{OPTIONS}Include \"part.pbrt\"\n"));
    dir.write("part.pbrt", "\n  Shape \"shpere\"\n");
    let stderr = dir.expect(&format!("scene.pbrt {SMALL}"), 2);
    assert_mentions(&stderr, &["part.pbrt:2:9", "did you mean `sphere`?"]);
    dir.write("part.pbrt", "Shape \"curve\"\nShape \"sphere\"\nLightSource \"infinite\"\n");
    let stderr = dir.expect(&format!("scene.pbrt {SMALL} -o a.exr"), 0);
    assert_mentions(&stderr, &["the lighting changes", "`curve`", "part.pbrt:1:1"]);
    let stderr = dir.expect(&format!("scene.pbrt {SMALL} --strict -o a.exr"), 2);
    assert_mentions(&stderr, &["`curve`"]);
}

#[test]
fn many_dielectrics_are_checked_in_parallel() {
    let dir = TestDir::new();
    let balls: String = (0..5000)
        .map(|index| {
            format!(
                "AttributeBegin Translate {} {} 0 Shape \"sphere\" \"float radius\" 0.3 AttributeEnd\n",
                index % 70,
                index / 70
            )
        })
        .collect();
    dir.write("scene.pbrt", format!("{OPTIONS}LightSource \"infinite\"\nMaterial \"dielectric\"\n{balls}"));
    assert!(dir.run("check scene.pbrt").status.success());
}
