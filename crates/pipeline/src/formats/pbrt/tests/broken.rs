//! Messages and positions of errors in invalid scenes.

use super::*;

/// Invalid scenes: the text after the camera and `WorldBegin`, and part of the message. `§` marks the start
/// of the underlined text.
const WORLDS: [(&str, &str); 37] = [
    ("\n§Shap \"sphere\"", "unknown directive"),
    ("§WorldEnd", "pbrt-v3"),
    ("Shape §sphere", "double quotes"),
    ("Shape §\"shpere\"", "unknown shape"),
    ("Shape §\"cone\"", "pbrt-v3"),
    ("Shape \"sphere\"\n  §\"float raduis\" 2", "unknown parameter"),
    ("Shape \"sphere\" §\"integer radius\" 2", "`radius` must have the type float"),
    ("Shape \"sphere\" \"float radius\" §-1", "greater than 0"),
    ("Shape \"sphere\" \"float radius\" §[1 2]", "one value"),
    ("Shape \"sphere\" §\"color Kd\" [1 1 1]", "unknown parameter type"),
    ("Shape \"sphere\" \"float radius\" [1 §oops]", "expected a number"),
    ("Shape \"sphere\" \"float radius\" §[1", "never closed"),
    ("Shape \"sphere\" §\"float radius", "no closing quote"),
    ("Material §\"matte\"\nShape \"sphere\"", "pbrt-v3"),
    ("Material §\"difuse\"\nShape \"sphere\"", "unknown material"),
    ("NamedMaterial §\"none\"\nShape \"sphere\"", "there is no material"),
    (
        "Material \"diffuse\" \"texture reflectance\" §\"none\"\nShape \"sphere\"",
        "there is no spectrum texture",
    ),
    ("Material \"diffuse\" \"rgb reflectance\" §[1 2]\nShape \"sphere\"", "three numbers"),
    ("Material \"conductor\" \"spectrum eta\" §\"metal-Xy-eta\"\nShape \"sphere\"", "unknown spectrum"),
    ("§Material \"mix\"\nShape \"sphere\"", "two names"),
    ("Texture \"a\" §\"color\" \"imagemap\"", "pbrt-v3"),
    ("Texture \"a\" \"float\" \"constant\"\nTexture §\"a\" \"float\" \"constant\"", "already a texture"),
    ("AttributeBegin\n§ObjectEnd", "innermost block"),
    ("§AttributeBegin\n", "no `AttributeEnd`"),
    ("§AttributeEnd", "no matching `AttributeBegin`"),
    ("ObjectInstance §\"none\"", "there is no object"),
    ("ObjectBegin \"a\"\n§ObjectBegin \"b\"", "cannot be nested"),
    ("Include §\"none.pbrt\"", "none.pbrt"),
    ("Include §\"scene.pbrt\"", "includes itself"),
    ("LightSource §\"sun\"", "unknown light"),
    ("LightSource \"spot\" \"point3 from\" [0 0 1] \"point3 to\" §[0 0 1]", "no direction"),
    ("CoordSysTransform §\"camra\"", "unknown coordinate system"),
    ("Rotate 90 0 0 §x", "expected a number"),
    ("§Rotate 90 0 0 0", "no direction"),
    ("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" §[0 1 3]", "out of range"),
    ("Shape \"plymesh\" \"string filename\" §\"a.gltf\"", "can only read PLY files"),
    ("§Camera \"perspective\"", "must precede `WorldBegin`"),
];

#[test]
fn errors_have_the_right_position() {
    for (marked, message) in WORLDS {
        let text = format!("{CAMERA}WorldBegin\n{marked}");
        check(&text, message);
    }
}

#[test]
fn errors_in_options_have_the_right_position() {
    for (marked, message) in [
        ("§Shape \"sphere\"", "must follow `WorldBegin`"),
        ("Film §\"image\"\nWorldBegin", "pbrt-v3"),
        ("Film \"rgb\" \"integer xresolution\" §0\nWorldBegin", "between"),
        ("Film \"rgb\" \"float cropwindow\" §[0 1]\nWorldBegin", "four numbers"),
        ("Camera §\"persp\"\nWorldBegin", "unknown camera"),
        ("Camera §\"realistic\"\nWorldBegin", "lens systems"),
        ("Camera \"perspective\" \"float fov\" §180\nWorldBegin", "between 0 and 180"),
        ("Scale 1 1 2\n§Camera \"perspective\"\nWorldBegin", "uniform scale"),
        ("§LookAt 0 0 0  0 0 0  0 1 0\nWorldBegin", "no direction"),
        ("Integrator §\"pth\"\nWorldBegin", "unknown integrator"),
        ("Sampler §\"hlton\"\nWorldBegin", "unknown sampler"),
        ("PixelFilter §\"bx\"\nWorldBegin", "unknown pixel filter"),
    ] {
        check(marked, message);
    }
}

fn check(marked: &str, message: &str) {
    let place = marked.find('§').expect("a mark");
    let text = marked.replace('§', "");
    let folder = SceneFolder::new(&text);
    let errors = folder.scene_from_document().expect_err(&text);
    let found = errors[0].place.as_ref().unwrap_or_else(|| panic!("{text}: {errors:?}"));
    assert!(errors[0].message.contains(message), "{text}: {:?}", errors[0]);
    assert_eq!(found.span.start, place, "{text}: {:?}", errors[0].message);
}

#[test]
fn several_errors_are_reported_with_suggestions() {
    let text =
        format!("{CAMERA}WorldBegin\nShap \"sphere\"\nShape \"sphere\" \"flaot radius\" 1\nTranslat 1 2 3\n");
    let errors = SceneFolder::new(&text).read().expect_err("errors");
    assert_eq!(errors.len(), 3, "{errors:?}");
    let labels: Vec<_> = errors.iter().map(|one| &*one.place.as_ref().expect("a place").label).collect();
    assert_eq!(labels, ["did you mean `Shape`?", "did you mean `float`?", "did you mean `Translate`?"]);
}

#[test]
fn errors_in_included_files_name_the_file() {
    let folder = SceneFolder::new(&format!("{CAMERA}WorldBegin\nInclude \"a.pbrt\"\n"));
    folder.write("a.pbrt", b"\n\nShape \"shpere\"");
    let errors = folder.read().expect_err("errors");
    assert!(errors[0].path.ends_with("a.pbrt"), "{errors:?}");
    assert_eq!(errors[0].place.as_ref().map(|place| place.span.start), Some(8));
}

#[test]
fn imported_files_cannot_end_outer_blocks() {
    let text = format!("{CAMERA}WorldBegin\nAttributeBegin\nImport \"a.pbrt\"\nAttributeEnd\n");
    let folder = SceneFolder::new(&text);
    folder.write("a.pbrt", b"Shape \"sphere\"\nAttributeEnd\n");
    let errors = folder.read().expect_err("errors");
    assert!(errors[0].path.ends_with("a.pbrt") && errors.len() == 1, "{errors:?}");
    assert_eq!(errors[0].place.as_ref().map(|place| place.span.start), Some(15));
}

#[test]
fn shared_textures_do_not_grow_exponentially() {
    let double = |index: usize| {
        format!(
            "Texture \"{}\" \"spectrum\" \"mix\" \"texture tex1\" \"{index}\" \"texture tex2\" \"{index}\"\n",
            index + 1
        )
    };
    let chain = |length: usize| {
        let all: String = (0..length).map(double).collect();
        format!(
            "{CAMERA}WorldBegin\nTexture \"0\" \"spectrum\" \"bilerp\"\n{all}\
             Material \"diffuse\" \"texture reflectance\" \"{length}\"\nShape \"sphere\"\n"
        )
    };
    assert!(SceneFolder::new(&chain(5)).read().is_ok());
    let errors = SceneFolder::new(&chain(30)).read().expect_err("errors");
    assert!(errors[0].message.contains("combines more than"), "{errors:?}");
}

#[test]
fn cycles_and_deep_nesting_are_errors() {
    let folder = SceneFolder::new(&format!("{CAMERA}WorldBegin\nInclude \"a.pbrt\"\n"));
    folder.write("a.pbrt", b"Include \"b.pbrt\"");
    folder.write("b.pbrt", b"Include \"a.pbrt\"");
    assert!(folder.read().expect_err("errors")[0].message.contains("includes itself"));
    // Each file includes the next one twice.
    let folder = SceneFolder::new(&format!("{CAMERA}WorldBegin\nInclude \"0.pbrt\"\n"));
    for depth in 0..100 {
        let next = depth + 1;
        folder.write(
            &format!("{depth}.pbrt"),
            format!("Include \"{next}.pbrt\" Include \"{next}.pbrt\"").as_bytes(),
        );
    }
    assert!(folder.read().is_err());
    let blocks = format!("{CAMERA}WorldBegin\n{}", "AttributeBegin\n".repeat(100_000));
    assert!(SceneFolder::new(&blocks).read().expect_err("errors")[0].message.contains("nested"));
    let textures: String = (0..100)
        .map(|index| format!("Texture \"{index}\" \"float\" \"scale\" \"texture tex\" \"{}\"\n", index + 1))
        .collect();
    let world = format!(
        "{textures}Texture \"100\" \"float\" \"scale\" \"texture tex\" \"0\"\nShape \"sphere\" \"texture alpha\" \"0\""
    );
    let errors = SceneFolder::new(&format!("{CAMERA}WorldBegin\n{world}")).read().expect_err("errors");
    assert!(errors[0].message.contains("uses itself"), "{errors:?}");
}
