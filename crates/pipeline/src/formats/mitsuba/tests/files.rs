//! Files that scenes refer to: missing ones, watched ones, and their names in imports.

use std::path::PathBuf;

use super::{Bench, has_line, scene};
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
    let mut bench = scene(&format!("<shape type=\"sphere\"><bsdf type=\"diffuse\">{spectrum}</bsdf></shape>"));
    let errors = bench.read().expect_err("a missing file");
    assert_eq!(errors[0].message, "spectrum not found: no.spd");
    assert_eq!(watched(&bench), [bench.path("no.spd")]);
    bench.options.missing = MissingAssetMode::Note;
    has_line(&bench.toml(), "diffuse = 0.5");
    let notes = bench.notes();
    assert!(notes.iter().any(|note| note.contains("spectrum no.spd: not found")), "{notes:?}");
}
