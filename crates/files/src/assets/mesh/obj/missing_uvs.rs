//! Warns about faces without texture coordinates.

use std::collections::BTreeMap;

use super::super::MeshFileBytes;
use super::super::parsed::ParsedMesh;
use super::build::FaceRun;
use super::statements::{CornerIndices, NONE, ParsedObj, byte_offset_of_face, line_numbers_of_faces};
use crate::assets::FileMaterial;

/// Faces that have corners without texture coordinates.
#[derive(Default)]
pub(super) struct MissingUvs {
    /// Index of the first face that lacks texture coordinates in an object that has some, and the number of
    /// such faces.
    partial: Option<(usize, usize)>,
    /// For each textured material, the index of its first face in objects without texture coordinates.
    textured: BTreeMap<u32, usize>,
}

impl MissingUvs {
    pub(super) fn find(statements: &ParsedObj, runs: &[FaceRun], materials: &[FileMaterial]) -> Self {
        let has_textures =
            |material: u32| materials.get(material as usize).is_some_and(FileMaterial::has_textures);
        let mut found = Self::default();
        let (mut face, mut corner) = (0, 0);
        for object in runs.chunk_by(|_, next| !next.is_object) {
            // Collect the faces that lack coordinates, with their materials.
            let (mut lacking, mut has_some) = (Vec::new(), false);
            for material in object.iter().flat_map(|run| std::iter::repeat_n(run.material, run.faces)) {
                let end = corner + statements.arities[face] as usize;
                let has_uvs = |corner: &CornerIndices| corner[1] != NONE;
                let corners = &statements.corners[corner..end];
                has_some |= corners.iter().any(has_uvs);
                if !corners.iter().all(has_uvs) {
                    lacking.push((face, material));
                }
                (face, corner) = (face + 1, end);
            }
            if has_some {
                if let Some((face, _)) = lacking.first() {
                    found.partial.get_or_insert((*face, 0)).1 += lacking.len();
                }
                continue;
            }
            for (face, material) in lacking.into_iter().filter(|(_, material)| has_textures(*material)) {
                found.textured.entry(material).or_insert(face);
            }
        }
        found
    }

    /// Warning about objects in which only some corners have texture coordinates.
    pub(super) fn partial_uvs_warning(&self, source: &MeshFileBytes<'_>) -> Option<String> {
        let (first, count) = self.partial?;
        Some(corners_without_uvs_warning(source.line_number(byte_offset_of_face(source, first)), count))
    }

    /// Warnings about textured objects without texture coordinates, one for each material.
    pub(super) fn material_warnings(&self, source: &MeshFileBytes<'_>, parsed: &ParsedMesh) -> Vec<String> {
        let mut faces: Vec<usize> = self.textured.values().copied().collect();
        faces.sort_unstable();
        let lines = line_numbers_of_faces(source, &faces);
        let warning = |(material, face): (&u32, &usize)| {
            let line = faces.binary_search(face).map_or(0, |index| lines[index]);
            let name = &parsed.materials[*material as usize].name;
            if parsed.uvs.is_empty() {
                file_without_uvs_warning(line, name)
            } else {
                faces_without_uvs_warning(line, name)
            }
        };
        self.textured.iter().map(warning).collect()
    }
}

pub(super) fn corners_without_uvs_warning(first: usize, count: usize) -> String {
    let faces = match count {
        1 => format!("line {first}: a face has"),
        _ => format!("line {first} and {} more faces have", count - 1),
    };
    format!("{faces} corners without texture coordinates; (0, 0) is used instead")
}

/// Warning about a material with textures in a file without texture coordinates.
pub(super) fn file_without_uvs_warning(line: usize, material: &str) -> String {
    format!(
        "line {line}: the file has no texture coordinates, so each triangle shows half of every texture in \"{material}\""
    )
}

/// Warning about faces without texture coordinates in a file that has some.
pub(super) fn faces_without_uvs_warning(line: usize, material: &str) -> String {
    format!(
        "line {line}: faces without texture coordinates show only the point (0, 0) of every texture in \"{material}\""
    )
}
