//! Files that scenes refer to: missing ones, watched ones, and their names in imports.

use std::path::PathBuf;

use super::{Bench, OBJ, has_line, png, scene};
use crate::formats::foreign::MissingAssetMode;

/// Paths of the watched files.
fn watched(bench: &Bench) -> Vec<PathBuf> {
    match bench.with_context(crate::formats::mitsuba::read) {
        Ok(scene) => scene.companions,
        Err(crate::formats::foreign::ForeignError::Scene { companions, .. }) => companions,
        Err(other) => panic!("{other:?}"),
    }
    .into_iter()
    .map(|one| one.path)
    .collect()
}

#[test]
fn missing_spectra_are_errors_or_substitutions() {
    let spectrum = "<spectrum name=\"reflectance\" filename=\"no.spd\"/>";
    let mut bench =
        scene(&format!("<shape type=\"sphere\"><bsdf type=\"diffuse\">{spectrum}</bsdf></shape>"));
    let errors = bench.read().expect_err("a missing file");
    assert_eq!(errors[0].message, "spectrum not found: no.spd");
    assert_eq!(watched(&bench), [bench.path("no.spd")]);
    bench.options.missing = MissingAssetMode::Note;
    has_line(&bench.toml(), "diffuse = 0.5");
    let notes = bench.notes();
    assert!(notes.iter().any(|note| note.contains("spectrum no.spd: not found")), "{notes:?}");
}

#[test]
fn skipped_meshes_are_watched() {
    let bench = scene("<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>");
    bench.write("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
    assert!(bench.notes().iter().any(|note| note.contains("without area")), "{:?}", bench.notes());
    assert_eq!(watched(&bench), [bench.path("a.obj")]);
    bench.write("a.obj", OBJ);
    has_line(&bench.toml(), "[[mesh]]");
}

#[test]
fn images_of_masks_are_watched() {
    let bench = scene(
        r#"<shape type="sphere"><bsdf type="mask"><bsdf type="diffuse"/><texture type="bitmap" name="opacity">
        <string name="filename" value="a.png"/></texture></bsdf></shape>"#,
    );
    for has_alpha in [false, true] {
        bench.write("a.png", png(has_alpha));
        assert_eq!(bench.toml().contains("channel = \"r\""), has_alpha);
        assert_eq!(watched(&bench), [bench.path("a.png")]);
    }
}

#[test]
fn weights_are_luminances_despite_alpha() {
    let bench = scene(
        r#"<shape type="sphere"><bsdf type="blendbsdf"><bsdf type="diffuse"/><bsdf type="conductor"/>
        <texture type="bitmap" name="weight"><string name="filename" value="a.png"/></texture></bsdf></shape>"#,
    );
    bench.write("a.png", png(true));
    let toml = bench.toml();
    assert!(toml.contains("weight = { texture = ") && !toml.contains("channel"), "{toml}");
}

#[test]
fn all_places_of_missing_files_are_watched() {
    let mesh = "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>";
    let bench = scene(&format!("<path value=\"p\"/><path value=\"q\"/>{mesh}"));
    bench.write("p/other", "").write("q/other", "");
    let places = ["q/a.obj", "p/a.obj", "a.obj"].map(|name| bench.path(name));
    assert_eq!(watched(&bench), places);
    // A file that is created in a folder with precedence replaces the one that was found.
    bench.write("p/a.obj", OBJ);
    assert_eq!(watched(&bench), [bench.path("q/a.obj"), bench.path("p/a.obj")]);
}

#[test]
fn all_places_of_missing_includes_are_watched() {
    let bench = scene("<path value=\"p\"/><path value=\"q\"/><include filename=\"a.xml\"/>");
    bench.write("p/other", "").write("q/other", "");
    let paths = watched(&bench);
    for place in ["a.xml", "p/a.xml", "q/a.xml"] {
        assert!(paths.contains(&bench.path(place)), "{place}: {paths:?}");
    }
}

#[test]
fn all_places_of_missing_folders_are_watched() {
    let bench = scene("<path value=\"p\"/><path value=\"q\"/>");
    bench.write("p/other", "");
    let paths = watched(&bench);
    assert!(paths.contains(&bench.path("q")) && paths.contains(&bench.path("p/q")), "{paths:?}");
}

#[test]
fn copied_files_have_different_names() {
    let names = ["a/t.obj", "b/t.obj", "t_2.obj", "c/t.obj"];
    let shape =
        |name: &str| format!("<shape type=\"obj\"><string name=\"filename\" value=\"{name}\"/></shape>");
    let bench = scene(&names.map(shape).concat());
    for (index, name) in names.iter().enumerate() {
        bench.write(name, format!("{OBJ}# {index}\n"));
    }
    let imported = bench.import();
    let mut copies: Vec<_> = imported.files.iter().map(|(name, _)| name.clone()).collect();
    copies.sort();
    copies.dedup();
    assert_eq!(copies.len(), names.len(), "{copies:?}");
    let text = imported.document.to_toml();
    let refers = |(name, bytes): &(PathBuf, Vec<u8>)| {
        let index: usize = (0..names.len())
            .find(|index| bytes.ends_with(format!("# {index}\n").as_bytes()))
            .expect("a copy");
        let files: Vec<_> = text.lines().filter(|line| line.starts_with("file = ")).collect();
        files[index] == format!("file = \"{}\"", name.display())
    };
    assert!(imported.files.iter().all(refers), "{text}");
}

#[test]
fn includes_may_have_backslashes() {
    let bench = scene(
        "<path value=\"parts\\more\"/><include filename=\"parts\\a.xml\"/><include filename=\"b.xml\"/>",
    );
    bench.write("parts/a.xml", "<scene version=\"3.0.0\"><shape type=\"sphere\"/></scene>");
    bench.write("parts/more/b.xml", "<scene version=\"3.0.0\"><shape type=\"cube\"/></scene>");
    let text = bench.toml();
    has_line(&text, "[[sphere]]");
    has_line(&text, "[[box]]");
}
