//! Tests for documents built in memory.

use std::path::Path;

use super::description::Scene;
use super::diagnostic::Diagnostic;
use super::{LoadedScene, SceneDocumentBuilder, SceneDocumentValue, load_from_built_document, parse};
use crate::math::DVec3;

/// Text of a foreign file. The last number is the radius of the second sphere.
const SOURCE: &str = "camera; ball 1; brick; ball -2";

/// Builds a scene with two spheres and, between them, a box.
fn built(radius: f64, source: &str) -> SceneDocumentBuilder {
    let mut built = SceneDocumentBuilder::new(source.into());
    built.start_table("camera");
    built.set("position", DVec3::new(0.0, 1.0, 4.0));
    built.set("look_at", [0.0, 0.1, 1.0 / 3.0]);
    built.start_table("render");
    built.set("width", 64.0);
    for name in ["wall", "big brick"] {
        built.start_named_table("materials", name);
        built.set("type", "principled");
        built.set("emission", 0.1);
    }
    built.start_list_table("sphere");
    built.set("center", [1.0, 2.0, 3.0]);
    built.set("radius", 1.0);
    built.set("material", "wall");
    built.start_list_table("box");
    built.set("material", "big brick");
    built.start_list_table("sphere");
    built.set("center", SceneDocumentValue::Array(vec![4.0.into(), 5.0.into(), 6e-7.into()]));
    if !source.is_empty() {
        built.set_span_for_next_values(SOURCE.len() - 2..SOURCE.len());
    }
    built.set("radius", radius);
    built.set("material", "wall");
    built
}

fn load(built: SceneDocumentBuilder, sets: &[&str]) -> Result<LoadedScene, Vec<Diagnostic>> {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    load_from_built_document(built, Path::new("a.pbrt"), &sets)
}

fn first_error(built: SceneDocumentBuilder, sets: &[&str]) -> Diagnostic {
    load(built, sets).expect_err("an error").remove(0)
}

/// Formats everything except spans.
fn parts(scene: &Scene) -> String {
    let objects = scene.objects.iter().map(|one| (&one.shape, one.material, &one.name));
    format!("{:?} {:?} {:?} {:?}", scene.render, scene.camera, objects.collect::<Vec<_>>(), scene.materials)
}

#[test]
fn built_document_equals_its_scene_file() {
    let loaded = load(built(2.0, ""), &[]).expect("a scene");
    let text = built(2.0, "").to_toml();
    let parsed = parse(text.as_str().into(), Path::new("a.toml")).scene.expect("a scene");
    assert_eq!(parts(&loaded.scene), parts(&parsed), "{text}");
    assert!(loaded.is_foreign() && loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let kinds: Vec<_> = loaded.scene.objects.iter().map(|one| one.shape.kind()).collect();
    assert_eq!(kinds, ["sphere", "box", "sphere"], "objects should be in the order of their tables");
}

#[test]
fn set_overrides_built_values() {
    let overridden = load(built(2.0, ""), &["sphere.2.radius=3", "render.width=9"]).expect("a scene");
    let direct = load(built(3.0, ""), &[]).expect("a scene");
    let scene = Scene { render: direct.scene.render, ..Scene::clone(&overridden.scene) };
    assert_eq!(parts(&scene), parts(&direct.scene));
    assert_eq!(overridden.scene.render.width, 9);
    // The overrides are not part of the document.
    let camera = overridden.built.expect("a document").to_toml();
    assert_eq!(camera, built(2.0, "").to_toml());
    let error = first_error(built(2.0, ""), &["render.samples=0"]);
    assert_eq!(error.path, Path::new("--set"));
    assert_eq!(&error.place.map(|place| place.source[place.span].to_owned()).expect("a place"), "0");
}

#[test]
fn errors_underline_the_foreign_text() {
    let with_text = first_error(built(-2.0, SOURCE), &["render.width=9"]);
    let place = with_text.place.expect("a place");
    assert_eq!((&place.source[..SOURCE.len()], &place.source[place.span]), (SOURCE, "-2"));
    assert_eq!(
        (with_text.message.as_str(), place.label.as_str()),
        ("`radius` must be greater than 0", "found -2")
    );
    // The underlined text need not be the value. It may be the name of an object, for example.
    let mut named = built(2.0, SOURCE);
    named.start_table("camera");
    named.set_span_for_next_values(0..6);
    named.set("fov", -2.0);
    let label = first_error(named, &[]).place.map(|place| place.label);
    assert_eq!(label.as_deref(), Some("found -2"));
    let without = first_error(built(-2.0, ""), &["render.width=9"]);
    assert_eq!(without.message, format!("{}; {}", with_text.message, place.label));
    assert_eq!((without.place, without.path), (None, with_text.path));
    let mut wrong = built(2.0, "");
    wrong.set("name", "7");
    wrong.start_table("camera");
    wrong.set("fov", "wide");
    wrong.set("aperture", 1e300);
    let messages: Vec<_> = load(wrong, &[]).expect_err("errors").into_iter().map(|one| one.message).collect();
    let expected = [
        "`fov` must be a number; found the string \"wide\"",
        "`aperture` must be at most 1e18 in magnitude; found 1e300",
        "`name` must not be a number",
    ];
    assert_eq!(messages, expected);
}
