//! Reads and imports pbrt-v4 scenes.
//!
//! [`parser`] collects the statements of all files, [`texture_nodes`] resolves textures, and [`scene`] writes
//! the tables of a scene document. Coordinates stay left-handed; instead, the camera mirrors the image. The
//! readers follow pbrt-v4's documentation and, where it is silent, its behavior.

mod bake;
mod colors;
mod emitters;
mod environment;
mod lexer;
mod lights;
mod material_tables;
mod materials;
mod memo;
mod mesh_files;
mod objects;
mod parameters;
mod parser;
mod scene;
mod settings;
mod shapes;
mod state;
#[cfg(test)]
mod tests;
mod texture_nodes;
mod textures;
mod values;

use std::path::{Path, PathBuf};

use self::colors::ColorReader;
use self::lexer::PbrtError;
use self::parser::Parser;
use self::scene::{AssetPathResolver, PbrtConverter};
use self::texture_nodes::TextureResolver;
use super::foreign::ForeignError;
use super::foreign::import::{CopiedFile, check_scene_before_import, read_files_to_copy};
use super::foreign::sources::SourceReader;
use super::{ForeignReadContext, ForeignScene, ImportedScene};
use crate::assets::Companion;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::{SceneDocumentBuilder, SourceFiles};

/// Reads a scene.
pub(super) fn read(path: &Path, context: &ForeignReadContext<'_>) -> Result<ForeignScene, ForeignError> {
    read_scene(path, None, context).map(|(scene, _)| scene)
}

/// Converts a scene to a scene file, with its meshes and images in `folder`.
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

/// Reads a scene. For an import, `import` is the folder for the assets, and the files to copy into it are
/// returned as well.
fn read_scene(
    path: &Path,
    import: Option<&str>,
    context: &ForeignReadContext<'_>,
) -> Result<(ForeignScene, Vec<CopiedFile>), ForeignError> {
    let mut sources = SourceReader::default();
    let Parser { errors, statements, .. } = parser::parse(path, &mut sources, context.token)?;
    if !errors.is_empty() {
        return Err(scene_error(&errors, &sources.files, sources.companions));
    }
    let SourceReader { files, hash, mut companions, .. } = sources;
    let colors = ColorReader::new(path.parent().unwrap_or(Path::new("")), context.token);
    let mut writer = PbrtConverter::new(
        &statements,
        TextureResolver::new(&statements, &colors),
        SceneDocumentBuilder::empty_for_source_files(files.clone()),
        AssetPathResolver::new(path, import),
        context.options,
        context.token,
    );
    writer.convert_all();
    context.token.check_pause_and_cancel()?;
    let PbrtConverter { document, notes, errors, assets, companions: read, .. } = writer;
    companions.extend(read);
    companions.append(&mut colors.companions.borrow_mut());
    if !errors.is_empty() {
        return Err(scene_error(&errors, &files, companions));
    }
    let (notes, substitutions) = notes.into_diagnostics(&files);
    Ok((ForeignScene { document, hash, companions, notes, substitutions }, assets.copies))
}

fn scene_error(errors: &[PbrtError], files: &SourceFiles, companions: Vec<Companion>) -> ForeignError {
    let diagnostic = |error: &PbrtError| {
        let PbrtError { message, span, label, help } = error.clone();
        files.diagnostic(Severity::Error, span, message, label, help)
    };
    let diagnostics: Vec<Diagnostic> = errors.iter().map(diagnostic).collect();
    ForeignError::Scene { diagnostics, companions }
}
