//! OBJ (Wavefront, *Object Files*, 1995). Each polygon corner has separate indices for its position, texture
//! coordinates and normal. The indices are converted to single-index vertices.

mod build;
mod libraries;
mod missing_uvs;
mod references;
mod statements;
mod vertex;
mod words;

use std::collections::{BTreeSet, HashMap};

use super::assemble::assemble_text_mesh;
use super::parsed::ParsedMesh;
use super::text::convert_mac_line_ends;
use super::{AssetError, LoadedMesh, MeshFileBytes};
use crate::assets::FileMaterial;
use build::{FaceRun, build_vertices_and_faces};
use libraries::{LoadedLibraries, MtlLibraryLoader};
use missing_uvs::MissingUvs;
pub(super) use references::referenced_files;
use statements::{NONE, ParsedObj, Smoothing, StateChange, byte_offset_of_face};

pub(super) fn parse(source: &MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError> {
    parse_normalized_text(&MeshFileBytes { bytes: &convert_mac_line_ends(source.bytes), ..*source })
}

fn parse_normalized_text(source: &MeshFileBytes<'_>) -> Result<LoadedMesh, AssetError> {
    let mut statements = ParsedObj::read(source)?;
    let materials = ObjMaterials::load(source, &statements.changes)?;
    let runs = split_into_face_runs(&statements, &materials.used);
    let mut parsed = ParsedMesh {
        materials: materials.all,
        material_warnings: materials.warnings,
        companions: materials.found.files,
        pictures: materials.found.images,
        warnings: std::mem::take(&mut statements.warnings),
        ..ParsedMesh::default()
    };
    build_vertices_and_faces(&statements, &runs, &mut parsed);
    let missing = MissingUvs::find(&statements, &runs, &parsed.materials);
    parsed.warnings.extend(missing.partial_uvs_warning(source));
    parsed.material_warnings.extend(missing.material_warnings(source, &parsed));
    drop(statements);
    assemble_text_mesh(source, parsed, |face| Some(byte_offset_of_face(source, face)))
}

/// Materials for an OBJ file.
struct ObjMaterials {
    all: Vec<FileMaterial>,
    /// Material index of each `usemtl` statement, or [`NONE`].
    used: Vec<u32>,
    warnings: Vec<String>,
    found: LoadedLibraries,
}

impl ObjMaterials {
    /// Loads the libraries and resolves the materials. A library applies to all later `usemtl` statements,
    /// and to earlier ones that name a material no earlier library defines.
    fn load(source: &MeshFileBytes<'_>, changes: &[(usize, StateChange)]) -> Result<Self, AssetError> {
        let name_of = |change: &StateChange| match change {
            StateChange::Material(name) if !name.is_empty() => Some(name.clone()),
            StateChange::Material(_)
            | StateChange::Library(_)
            | StateChange::Object
            | StateChange::Smoothing(_) => None,
        };
        let names: BTreeSet<String> = changes.iter().filter_map(|(_, change)| name_of(change)).collect();
        let mut libraries = MtlLibraryLoader { source, used: &names, found: LoadedLibraries::default() };
        let mut known = HashMap::new();
        let mut used = Vec::new();
        for (_, change) in changes {
            match change {
                StateChange::Library(name) => known.extend(libraries.load_mtllib_statement(name)?),
                StateChange::Material(name) => used.push((name, known.get(name).copied())),
                StateChange::Object | StateChange::Smoothing(_) => {}
            }
        }
        let index = |(name, found): (&String, Option<usize>)| found.or_else(|| known.get(name).copied());
        let used = used.into_iter().map(|used| index(used).map_or(NONE, |index| index as u32)).collect();
        let mut found = libraries.found;
        let mut warnings = std::mem::take(&mut found.warnings);
        if !found.missing {
            let unknown = names.difference(&found.resolved);
            warnings.extend(unknown.map(|name| unknown_material_warning(name)));
        }
        let all = std::mem::take(&mut found.materials);
        Ok(Self { all, used, warnings, found })
    }
}

fn unknown_material_warning(name: &str) -> String {
    format!("unknown material {name:?}")
}

/// Splits the faces into runs between state changes.
fn split_into_face_runs(statements: &ParsedObj, materials: &[u32]) -> Vec<FaceRun> {
    let mut materials = materials.iter();
    let mut runs =
        vec![FaceRun { faces: 0, material: NONE, smoothing: Smoothing::Unspecified, is_object: false }];
    let mut before = 0;
    let end = statements.arities.len();
    for (faces, change) in
        statements.changes.iter().map(|(at, change)| (*at, Some(change))).chain([(end, None)])
    {
        let Some(last) = runs.last_mut() else { continue };
        last.faces = faces - before;
        let mut next = FaceRun { faces: 0, is_object: false, ..*last };
        before = faces;
        match change {
            Some(StateChange::Object) => next.is_object = true,
            Some(StateChange::Material(_)) => {
                next.material = materials.next().copied().unwrap_or(NONE);
                next.is_object = next.material != last.material;
            }
            Some(StateChange::Smoothing(smoothing)) => next.smoothing = *smoothing,
            Some(StateChange::Library(_)) | None => {}
        }
        runs.push(next);
    }
    runs
}

#[cfg(test)]
mod tests;
