//! `glimt import` for scenes from other renderers: `--strict`, and the files that it copies.

use super::test_dir::{TestDir, assert_mentions};

/// A Mitsuba scene with the given integrator, which contains the XML `settings`.
fn mitsuba(integrator: &str, settings: &str) -> String {
    format!(
        r#"<scene version="3.0.0">
    <integrator type="{integrator}">{settings}</integrator>
    <sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film></sensor>
    <emitter type="constant"/>
    <shape type="sphere"><point name="center" x="0" y="0" z="5"/></shape>
</scene>"#
    )
}

#[test]
fn strict_import_rejects_only_substitutions() {
    let note = mitsuba("direct", r#"<integer name="emitter_samples" value="4"/>"#);
    let substitution = mitsuba("path", r#"<boolean name="hide_emitters" value="true"/>"#);
    let spot = "Camera \"perspective\"\nWorldBegin\nLightSource \"spot\"\n\
        Translate 0 0 5\nShape \"sphere\"\n";
    for (file, text, word) in
        [("a.xml", note.as_str(), "`direct` with several emitter samples"), ("b.pbrt", spot, "spot")]
    {
        let dir = TestDir::new();
        dir.write(file, text);
        let said = dir.expect(&format!("import {file} -o scene.toml --strict"), 0);
        assert_mentions(&said, &[word]);
        assert!(dir.path("scene.toml").exists(), "{file}");
    }
    let dir = TestDir::new();
    dir.write("a.xml", substitution);
    let said = dir.expect("import a.xml -o scene.toml --strict", 2);
    assert_mentions(&said, &["hide_emitters", "without --strict, this is a warning"]);
    assert!(!dir.path("scene.toml").exists());
}

#[test]
fn import_copies_only_meshes_and_images() {
    let dir = TestDir::new();
    dir.write("secret.png", "a private key");
    let bitmap = r#"<bsdf type="diffuse"><texture type="bitmap" name="reflectance">
        <string name="filename" value="secret.png"/></texture></bsdf></shape>"#;
    dir.write("a.xml", mitsuba("path", "").replace("</shape>", bitmap));
    let map = "Texture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"secret.png\"\n\
        Material \"diffuse\" \"texture reflectance\" \"t\"\n";
    dir.write(
        "b.pbrt",
        format!("Camera \"perspective\"\nWorldBegin\n{map}Translate 0 0 5\nShape \"sphere\"\n"),
    );
    for file in ["a.xml", "b.pbrt"] {
        assert_mentions(&dir.expect(&format!("import {file} -o scene.toml"), 2), &["secret.png"]);
        assert!(!dir.path("scene.toml").exists() && !dir.path("scene_files").exists(), "{file}");
    }
}
