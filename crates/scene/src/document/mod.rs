//! Lowers TOML to a scene. Each table has a module with the definitions of its keys and their reader. Readers
//! return `None` for missing or invalid values and continue after errors so that all errors are reported.

mod blends;
pub(super) mod camera;
mod context;
pub(super) mod environment;
pub(super) mod groups;
mod key;
pub(super) mod lights;
pub(super) mod materials;
mod mesh;
mod names;
mod objects;
pub(super) mod photons;
pub(super) mod render;
mod sets;
mod shape_table;
pub(super) mod shapes;
mod syntax;
mod table;
pub(super) mod textures;
mod transform;
mod value;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::description::{Camera, Environment, Light, Scene};
use super::keys::limits;
use super::other_content::NEW_SCENE_HELP;
use super::source::SceneText;
use super::toml::{Document, SceneDocumentBuilder};
use super::{MAX_FILE_BYTES, ParseOutcome, SettingSpan, facing, toml};
use crate::math::Vec3;
use context::{FileContext, Issue};
use objects::ObjectList;
use table::TableReader;

pub use context::MORE_LIKE_THESE;
#[cfg(test)]
pub(super) use materials::ENERGY_GAIN;
#[cfg(test)]
pub(super) use syntax::MISSING_VALUE;

/// Reads and validates a scene. Relative paths are resolved against the folder of `path`.
pub(super) fn parse_and_lower(source: &SceneText, path: &Path) -> ParseOutcome {
    let context = FileContext::new(source.clone(), path);
    let text = source.text_without_set_args();
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        let help = NEW_SCENE_HELP;
        context.report(Issue::error(0..0, "the scene file is empty").with_help(help));
        return ParseOutcome {
            scene: None,
            diagnostics: context.into_diagnostics(&[]),
            settings: Vec::new(),
        };
    }
    if text.len() as u64 > MAX_FILE_BYTES {
        let message = format!("the scene file is larger than {} MiB", MAX_FILE_BYTES >> 20);
        context.report(Issue::error(0..0, message));
        return ParseOutcome {
            scene: None,
            diagnostics: context.into_diagnostics(&[]),
            settings: Vec::new(),
        };
    }
    let (document, errors) = toml::parse(text);
    let broken_lines = syntax::report_errors_and_collect_broken_lines(&context, errors);
    let document = sets::apply_set_args(&context, source, document);
    lower(context, &document, &broken_lines)
}

/// Validates a document that was built in memory.
pub(super) fn lower_built(source: &SceneText, built: &SceneDocumentBuilder, path: &Path) -> ParseOutcome {
    let document = &built.document;
    let context = FileContext::new(source.clone(), path).with_in_memory_files(Arc::clone(&built.generated));
    let is_overridden = source.override_arg_offsets().next().is_some();
    let overridden = is_overridden.then(|| sets::apply_set_args(&context, source, document.clone()));
    lower(context, overridden.as_ref().unwrap_or(document), &[])
}

fn lower(context: FileContext<'_>, document: &Document<'_>, broken_lines: &[Range<usize>]) -> ParseOutcome {
    let scene = read_scene(&TableReader::root(&context, document.root()));
    let has_errors = context.has_errors();
    let settings = render_and_photons_value_spans(document);
    ParseOutcome {
        scene: scene.filter(|_| !has_errors),
        diagnostics: context.into_diagnostics(broken_lines),
        settings,
    }
}

/// Returns the spans of all values in `[render]` and `[photons]`.
fn render_and_photons_value_spans(document: &Document<'_>) -> Vec<SettingSpan> {
    let values = |table: &'static str| {
        let entries = document.root().get(table).and_then(|found| found.value.as_table());
        let of = move |one: toml::KeyValue<'_>| SettingSpan {
            table,
            key: one.key.to_owned(),
            span: one.value.span(),
        };
        entries.into_iter().flat_map(move |entries| entries.iter().map(of).collect::<Vec<_>>())
    };
    ["render", "photons"].into_iter().flat_map(values).collect()
}

/// Reads only a scene's camera. Returns `None` if there are errors.
pub(super) fn parse_camera(source: &SceneText) -> Option<Camera> {
    let context = FileContext::new(source.clone(), Path::new(""));
    let (document, errors) = toml::parse(source.text_without_set_args());
    let document = sets::apply_set_args(&context, source, document);
    let camera = camera::read_camera(&TableReader::root(&context, document.root()));
    camera.filter(|_| errors.is_empty() && !context.has_errors())
}

/// Returns the files that a scene's text references, even if it has errors.
pub(super) fn files_referenced_by_text(text: &str, path: &Path) -> Vec<PathBuf> {
    referenced_files(&toml::parse(text).0, path)
}

/// Returns the files that a document references.
pub(super) fn referenced_files(document: &Document<'_>, path: &Path) -> Vec<PathBuf> {
    fn collect_file_names(table: toml::Entries<'_>, names: &mut Vec<String>) {
        for toml::KeyValue { key, value, .. } in table.iter() {
            let name = value.as_str().filter(|_| matches!(key, "file" | "orbiter"));
            names.extend(name.map(str::to_owned));
            let elements = value.as_array().into_iter().flat_map(|array| array.iter());
            for inner in elements.chain([value]).filter_map(|value| value.as_table()) {
                collect_file_names(inner, names);
            }
        }
    }
    let mut names = Vec::new();
    collect_file_names(document.root(), &mut names);
    let folder = path.parent().unwrap_or(Path::new(""));
    names.into_iter().map(|name| folder.join(name)).collect()
}

/// Reads the whole scene. Textures, materials and groups are read before the tables that refer to them by
/// name.
fn read_scene(root: &TableReader<'_>) -> Option<Scene> {
    let (render, output) = render::read_render_table(root);
    let camera = camera::read_camera(root);
    let photons = photons::read_photons(root);
    let textures = textures::read_textures(root);
    let materials = materials::read_materials(root, &textures);
    if let Some(list) = &materials.list {
        textures::report_ambiguous_encodings(root.context, &textures, list);
    }
    let objects = objects::read_objects(root, &materials);
    let lights = lights::read_lights(root);
    let environment = environment::read_environment(root);
    root.report_unknown_and_missing_keys();

    let ObjectList { objects, instances, mesh_files, groups } = objects?;
    let scene = Scene {
        render: render?,
        output,
        camera: camera?,
        photons: photons?,
        textures: textures.list?,
        mesh_files,
        objects,
        instances,
        lights: lights?,
        environment: environment?,
        materials: materials.list?,
    };
    if !root.context.has_errors() {
        textures.names.warn_about_unused(root.context);
        materials.names.warn_about_unused(root.context);
        groups.names.warn_about_unused(root.context);
        warn_if_empty_or_unlit(root.context, &scene);
        // If there are meshes, wait until their bounds are known.
        if scene.mesh_files.is_empty() {
            for span in facing::spans_of_lights_facing_nothing(&scene, Vec::new) {
                root.context.report(
                    Issue::warning(span, facing::MESSAGE).with_label(facing::LABEL).with_help(facing::HELP),
                );
            }
        }
        environment::warn_if_background_hidden(root, &scene);
    }
    Some(scene)
}

/// Warning message for unlit scenes.
pub(super) const UNLIT_SCENE: &str = "nothing lights this scene";
/// End of error messages about degenerate shapes.
pub(super) const NO_AREA: &str = "has no area";

/// Warns if a scene has no shapes or no light.
fn warn_if_empty_or_unlit(context: &FileContext<'_>, scene: &Scene) {
    if scene.objects.is_empty() {
        let help = "add one, such as a [[sphere]]; until then the image shows the background";
        context.report(Issue::warning(0..0, "the scene has no shapes").with_help(help));
        return;
    }
    let has_file_materials = scene.objects.iter().any(|object| object.material.is_none());
    let emits = |index: usize| scene.materials[index].emits();
    let has_emitters = scene.objects.iter().filter_map(|object| object.material).any(emits);
    let has_lights = scene.lights.iter().any(Light::has_emission)
        || scene.environment.iter().any(Environment::has_emission);
    // `path` and photons compute indirect light instead of using `ambient`.
    let method = scene.render.integrator.properties();
    let has_ambient = method.honors_ambient
        && scene.render.ambient != Vec3::ZERO
        && !(method.gathers && scene.photons.enabled);
    if !has_lights && !has_file_materials && !has_emitters && !has_ambient {
        let help = "add a [[light]] or an [environment], set `emission` on a material that is in use, or set `ambient` in [render]";
        context.report(Issue::warning(0..0, UNLIT_SCENE).with_help(help));
    }
}
