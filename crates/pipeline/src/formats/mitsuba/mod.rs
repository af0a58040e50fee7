//! Reads scenes of Mitsuba 3, 2 and 0.6.
//!
//! `xml` reads the files, `graph` resolves references, and the other modules convert the objects to the
//! tables of a scene file, which [`SceneReader`] collects.

mod assets;
mod bsdfs;
mod colors;
mod curves;
mod disks;
mod emitters;
mod generated;
mod graph;
mod instances;
mod material_key;
mod media;
mod mesh_attributes;
mod placement;
mod plastic;
mod ply;
mod projectors;
mod property;
mod reader;
mod sdf_grids;
mod settings;
mod shapes;
mod tags;
#[cfg(test)]
mod tests;
mod textures;
mod unused;
mod values;
mod xml;

use std::path::{Path, PathBuf};

use self::graph::{GraphBuilder, ObjectKind};
use self::reader::SceneReader;
use self::shapes::ShapeTarget;
use self::xml::XmlLoader;
use super::foreign::ForeignError;
use super::foreign::import::{CopiedFile, check_scene_before_import, read_files_to_copy};
use super::model::file_name;
use super::{ForeignReadContext, ForeignScene, ImportedScene};
use crate::assets::Companion;
use crate::scene::diagnostic::Diagnostic;

/// Reads a scene.
pub(super) fn read(path: &Path, context: &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError> {
    read_scene(path, None, context).map(|(scene, _)| scene)
}

/// Converts a scene to a scene file, and copies its meshes and images to `folder`.
pub(super) fn import_with_assets(
    path: &Path,
    folder: &str,
    context: &ForeignReadContext<'_>,
) -> Result<ImportedScene, ForeignError> {
    check_scene_before_import(read(path, context)?, path)?;
    let (ForeignScene { document, notes, substitutions, .. }, copies) =
        read_scene(path, Some(folder), context)?;
    let mut files = read_files_to_copy(copies, context.token)?;
    let generated = document.added_in_memory_files().iter();
    files.extend(generated.map(|(name, file)| (PathBuf::from(name), file.bytes.to_vec())));
    Ok(ImportedScene { document, files, substitutions, notes })
}

/// Reads a scene. With `asset_folder`, the document refers to copies in this folder, which are also returned.
fn read_scene(
    path: &Path,
    asset_folder: Option<&str>,
    context: &ForeignReadContext<'_>,
) -> Result<(ForeignScene, Vec<CopiedFile>), ForeignError> {
    let ForeignReadContext { options, token, .. } = *context;
    let mut loader = XmlLoader::new(path, &options.defines, token);
    let root = loader.load_scene_elements(path)?;
    let XmlLoader { reader: sources, errors, folders, .. } = loader;
    let fail = |diagnostics: Vec<Diagnostic>, companions: Vec<Companion>| {
        Err(ForeignError::Scene { diagnostics, companions })
    };
    let Some(root) = root.filter(|_| errors.is_empty()) else {
        return fail(errors, sources.companions);
    };
    let built = GraphBuilder::new(&sources.files, token).build(&root);
    token.check_pause_and_cancel()?;
    let graph = match built {
        Ok(graph) => graph,
        Err(errors) => return fail(errors, sources.companions),
    };
    drop(root);
    let mut reader = SceneReader::new(&graph, &sources.files, path, &folders, asset_folder, context);
    reader.document.add_comment_above_next_table(format!("{}, as glimt shows it.", file_name(path)));
    let scene = reader.object_by_index(0);
    reader.add_render_and_camera_tables(scene);
    for child in &scene.children {
        token.check_pause_and_cancel()?;
        match reader.object_by_index(child.target).kind {
            ObjectKind::Shape => {
                reader.add_shape(child.target, ShapeTarget::SCENE);
            }
            // A named area light only defines the emission of the shapes that refer to it.
            ObjectKind::Emitter if reader.is_named_area_light(child.target) => {}
            ObjectKind::Emitter => reader.add_emitter(child.target),
            // BSDFs, textures and media are converted where they are used.
            ObjectKind::Bsdf
            | ObjectKind::Film
            | ObjectKind::Filter
            | ObjectKind::Integrator
            | ObjectKind::Medium
            | ObjectKind::Phase
            | ObjectKind::Sampler
            | ObjectKind::Scene
            | ObjectKind::Sensor
            | ObjectKind::Spectrum
            | ObjectKind::Subsurface
            | ObjectKind::Texture
            | ObjectKind::Volume => reader.report_child_if_unreachable(scene, child),
        }
    }
    token.check_pause_and_cancel()?;
    let SceneReader { errors, notes, mut document, companions: found, asset_names, .. } = reader;
    let companions: Vec<Companion> = sources.companions.into_iter().chain(found).collect();
    if !errors.is_empty() {
        return fail(errors, companions);
    }
    let (notes, substitutions) = notes.into_diagnostics(&sources.files);
    let (hash, files) = (sources.hash, sources.files);
    document.set_source_files(files);
    let copied = asset_names.into_iter().map(|(source, name)| CopiedFile { name, source }).collect();
    Ok((ForeignScene { document, hash, companions, notes, substitutions }, copied))
}
