//! From TOML to a scene: one file for each family of tables. Every reader goes on after a mistake, so that
//! all of them are reported, and gives nothing where a value is missing or wrong.

mod camera;
mod common;
mod context;
mod environment;
mod key;
mod lights;
mod materials;
mod names;
mod photons;
mod render;
mod sets;
mod shapes;
mod syntax;
mod table;
mod textures;
mod value;

use std::path::{Path, PathBuf};

use super::description::{Camera, Environment, Light, Scene};
use super::keys::limits;
use super::source::Source;
use super::{MAX_FILE_BYTES, Outcome, Setting, facing, toml};
use crate::math::Vec3;
use context::{Context, Issue};
use table::Table;

pub(super) use camera::FOV_DEGREES;
pub(super) use shapes::is_mesh;

/// Reads and validates a scene; `path` says where the files are that it names.
pub(super) fn lower(source: &Source, path: &Path) -> Outcome {
    let context = Context::new(source.clone(), path);
    let text = source.text();
    if text.trim_start_matches('\u{feff}').trim().is_empty() {
        let help = "`glimt new FILE` writes a scene to start from";
        context.report(Issue::error(0..0, "the scene file is empty").help(help));
        return Outcome { scene: None, diagnostics: context.finish(&[]), settings: Vec::new() };
    }
    if text.len() as u64 > MAX_FILE_BYTES {
        let message = format!("the scene file is larger than {} MiB", MAX_FILE_BYTES >> 20);
        context.report(Issue::error(0..0, message));
        return Outcome { scene: None, diagnostics: context.finish(&[]), settings: Vec::new() };
    }
    let (document, errors) = toml::parse(text);
    let broken_lines = syntax::report(&context, errors);
    let document = sets::put(&context, source, document);
    let scene = scene(&Table::root(&context, document.root()));
    let has_errors = context.has_errors();
    let settings = settings(&document);
    Outcome { scene: scene.filter(|_| !has_errors), diagnostics: context.finish(&broken_lines), settings }
}

/// The places of the values in the tables that hold settings.
fn settings(document: &toml::Document<'_>) -> Vec<Setting> {
    let values = |table: &'static str| {
        let entries = document.root().get(table).and_then(|found| match found.value.item() {
            toml::Item::Table(entries) => Some(entries),
            toml::Item::String(_)
            | toml::Item::Integer { .. }
            | toml::Item::Float(_)
            | toml::Item::Boolean(_)
            | toml::Item::Datetime
            | toml::Item::Array(_) => None,
        });
        let of =
            move |one: toml::KeyValue<'_>| Setting { table, key: one.key.to_owned(), span: one.value.span() };
        entries.into_iter().flat_map(move |entries| entries.iter().map(of).collect::<Vec<_>>())
    };
    ["render", "photons"].into_iter().flat_map(values).collect()
}

/// The camera of a scene, if that is right.
pub(super) fn camera_of(source: &Source) -> Option<Camera> {
    let context = Context::new(source.clone(), Path::new(""));
    let (document, errors) = toml::parse(source.text());
    let document = sets::put(&context, source, document);
    let camera = camera::read(&Table::root(&context, document.root()));
    camera.filter(|_| errors.is_empty() && !context.has_errors())
}

/// The files that a text names, whatever else it says.
pub(super) fn named_files(text: &str, path: &Path) -> Vec<PathBuf> {
    fn gather(table: toml::Entries<'_>, names: &mut Vec<String>) {
        for toml::KeyValue { key, value, .. } in table.iter() {
            match value.item() {
                toml::Item::String(name) if matches!(key, "file" | "orbiter") => names.push(name.to_owned()),
                toml::Item::Table(inner) => gather(inner, names),
                toml::Item::Array(array) => {
                    for element in array.iter() {
                        if let toml::Item::Table(inner) = element.item() {
                            gather(inner, names);
                        }
                    }
                }
                toml::Item::String(_)
                | toml::Item::Integer { .. }
                | toml::Item::Float(_)
                | toml::Item::Boolean(_)
                | toml::Item::Datetime => {}
            }
        }
    }
    let mut names = Vec::new();
    gather(toml::parse(text).0.root(), &mut names);
    let folder = path.parent().unwrap_or(Path::new(""));
    names.into_iter().map(|name| folder.join(name)).collect()
}

/// The whole file. Names are gathered before what refers to them.
fn scene(root: &Table<'_>) -> Option<Scene> {
    let (render, output) = render::read(root);
    let camera = camera::read(root);
    let photons = photons::read(root);
    let textures = textures::read(root);
    let materials = materials::read(root, &textures.names);
    if let Some(list) = &materials.list {
        textures::check_encodings(root.context, &textures, list);
    }
    let (objects, mesh_files) = shapes::read(root, &materials);
    let lights = lights::read(root);
    let environment = environment::read(root);
    root.finish();

    let scene = Scene {
        render: render?,
        output,
        camera: camera?,
        photons: photons?,
        textures: textures.list?,
        mesh_files,
        objects: objects?,
        lights: lights?,
        environment: environment?,
        materials: materials.list?,
    };
    if !root.context.has_errors() {
        textures.names.warn_about_unused(root.context);
        materials.names.warn_about_unused(root.context);
        warn_about_darkness(root.context, &scene);
        // Where a mesh is, is not known before it is loaded.
        if scene.mesh_files.is_empty() {
            for span in facing::away(&scene, Vec::new) {
                root.context
                    .report(Issue::warning(span, facing::MESSAGE).label(facing::LABEL).help(facing::HELP));
            }
        }
        environment::warn_about_background(root, &scene);
    }
    Some(scene)
}

/// Warns about a scene without shapes, or without light.
fn warn_about_darkness(context: &Context<'_>, scene: &Scene) {
    if scene.objects.is_empty() {
        let help = "add one, such as a [[sphere]]; until then the picture is the background";
        context.report(Issue::warning(0..0, "the scene has no shapes").help(help));
        return;
    }
    let own_materials = scene.objects.iter().any(|object| object.material.is_none());
    let emits = |index: usize| scene.materials[index].emits();
    let lamps = scene.objects.iter().filter_map(|object| object.material).any(emits);
    let lights = scene.lights.iter().any(Light::sends) || scene.environment.iter().any(Environment::sends);
    // `path` and photons have light of their own in its place.
    let method = scene.render.integrator.method();
    let is_ambient = method.honours_ambient
        && scene.render.ambient != Vec3::ZERO
        && !(method.gathers && scene.photons.enabled);
    if !lights && !own_materials && !lamps && !is_ambient {
        let help = "add a [[light]] or an [environment], give a material in use `emission`, or set `ambient` in [render]";
        context.report(Issue::warning(0..0, "nothing lights this scene").help(help));
    }
}
