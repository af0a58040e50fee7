//! Warnings about mesh files.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::Findings;
use crate::assets::{DroppedFaces, LoadedMesh};
use crate::scene::LoadedScene;
use crate::scene::description::{Material, MeshFile, UvSet};

/// Warnings about mesh files, without duplicates. The dropped faces in all parts of a file are counted
/// together.
#[derive(Default)]
pub(super) struct MeshWarnings<'a> {
    all: Vec<(&'a MeshFile, MeshWarning)>,
    /// Index of each file's warning about dropped faces.
    dropped: HashMap<&'a Path, usize>,
    /// Files and parts whose dropped faces are counted. The same part may occur at several subdivision levels.
    counted: HashSet<(&'a Path, Option<u32>)>,
    known: HashSet<String>,
}

enum MeshWarning {
    /// Dropped faces, and the number of parts that had any.
    Dropped(DroppedFaces, usize),
    Message(String),
}

impl<'a> MeshWarnings<'a> {
    /// Adds a file's warnings. Warnings about its materials are included only if an object uses these
    /// materials.
    pub(super) fn add_file_warnings(&mut self, file: &'a MeshFile, mesh: &LoadedMesh, uses_own: bool) {
        if mesh.dropped != DroppedFaces::default() && self.counted.insert((&file.value, file.part)) {
            let place = *self.dropped.entry(&file.value).or_insert(self.all.len());
            match self.all.get_mut(place) {
                Some((_, MeshWarning::Dropped(all, parts))) => {
                    all.non_finite += mesh.dropped.non_finite;
                    all.degenerate += mesh.dropped.degenerate;
                    *parts += 1;
                }
                Some((_, MeshWarning::Message(_))) | None => {
                    self.all.push((file, MeshWarning::Dropped(mesh.dropped, 1)));
                }
            }
        }
        let of_materials = mesh.material_warnings.iter().filter(move |_| uses_own);
        for said in mesh.warnings.iter().chain(of_materials) {
            let words = format!("{}: {said}", file.value.display());
            if self.known.insert(words.clone()) {
                self.all.push((file, MeshWarning::Message(words)));
            }
        }
    }

    pub(super) fn messages(self) -> Vec<(&'a MeshFile, String)> {
        let words = |(file, warning): (&'a MeshFile, MeshWarning)| {
            let words = match warning {
                MeshWarning::Message(words) => words,
                MeshWarning::Dropped(faces, parts) => {
                    let of_parts = if parts > 1 { format!(" in {parts} parts") } else { String::new() };
                    format!("{}: {}{of_parts}", file.value.display(), describe_dropped_faces(&faces)?)
                }
            };
            Some((file, words))
        };
        self.all.into_iter().filter_map(words).collect()
    }
}

/// Maximum number of warnings about all mesh files.
pub(crate) const MAX_WARNINGS: usize = 100;

pub(super) fn add_limited_mesh_warnings(
    loaded: &LoadedScene,
    warnings: Vec<(&MeshFile, String)>,
    findings: &mut Findings,
) {
    let omitted = warnings.len().saturating_sub(MAX_WARNINGS);
    let last = warnings.last().map(|(file, _)| file.span.clone());
    for (file, message) in warnings.into_iter().take(MAX_WARNINGS) {
        findings.add_warning(loaded, file.span.clone(), message);
    }
    if let Some(span) = last.filter(|_| omitted > 0) {
        let s = if omitted == 1 { "" } else { "s" };
        findings.add_warning(loaded, span, format!("{omitted} more warning{s} about mesh files"));
    }
}

/// Describes the dropped faces, or returns `None` if no faces were dropped.
fn describe_dropped_faces(faces: &DroppedFaces) -> Option<String> {
    let count = |number: u64, what: &str| {
        (number > 0).then(|| format!("{number} face{} {what}", if number == 1 { "" } else { "s" }))
    };
    let parts: Vec<String> =
        [count(faces.non_finite, "with non-finite coordinates"), count(faces.degenerate, "without area")]
            .into_iter()
            .flatten()
            .collect();
    (!parts.is_empty()).then(|| format!("skipped {}", parts.join(" and ")))
}

/// Warns about objects whose mesh files lack data that the objects need. Skips files that could not be read.
pub(super) fn warn_about_missing_mesh_data<'a>(
    loaded: &LoadedScene,
    mesh_of_file: impl Fn(usize) -> &'a LoadedMesh,
    findings: &mut Findings,
) {
    let mut is_first_copy = loaded.scene.first_copy_filter();
    for (number, object) in loaded.scene.objects.iter().enumerate() {
        let Some(mesh) = object.shape.as_mesh().filter(|_| is_first_copy(number)) else { continue };
        let (file, read) =
            (loaded.scene.mesh_files[mesh.file].value.display(), &mesh_of_file(mesh.file).mesh);
        if read.positions.is_empty() {
            continue;
        }
        let material = object.material.map(|material| &loaded.scene.materials[material]);
        let mut warn = |message| findings.add_warning(loaded, object.span.clone(), message);
        if mesh.vertex_colors && read.colors.is_empty() {
            warn(format!("`vertex_colors` has no effect: the vertices of {file} have no colors"));
        } else if let Some(material) =
            material.filter(|own| mesh.vertex_colors && !own.kind.accepts_vertex_colors())
        {
            let name = &material.name;
            warn(format!("`vertex_colors` has no effect: material \"{name}\" has no color to multiply"));
        }
        let Some(material) = material else { continue };
        let name = &material.name;
        let textures = &loaded.scene.textures;
        let is_second = |(texture, _): &(usize, _)| textures[*texture].uv_set() == Some(UvSet::Second);
        let all: Vec<_> =
            material.self_and_blend_parts().into_iter().flat_map(Material::own_textures_with_roles).collect();
        if let Some((texture, _)) = all.iter().find(|texture| is_second(texture))
            && read.second_uvs.is_empty()
        {
            let texture = &textures[*texture].name;
            warn(format!(
                "{file} has no second set of texture coordinates: texture \"{texture}\" of \"{name}\" uses the first"
            ));
        }
        if !read.uvs.is_empty() {
            continue;
        }
        if material.kind.is_anisotropic() {
            warn(format!(
                "{file} has no texture coordinates, which the `anisotropy` of \"{name}\" needs to determine its direction"
            ));
        }
        if all.iter().any(|(texture, _)| textures[*texture].uv_set().is_some()) {
            warn(format!(
                "{file} has no texture coordinates: each triangle shows half of every texture of \"{name}\""
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    #[test]
    fn warnings_about_parts_are_combined() {
        let part =
            |part| MeshFile { value: PathBuf::from("a.glb"), part: Some(part), subdivide: 0, span: 0..0 };
        let (files, other) = (
            [part(0), part(1), part(2)],
            MeshFile { value: "b.ply".into(), part: None, subdivide: 0, span: 0..0 },
        );
        let mesh = |degenerate, warning: &str| LoadedMesh {
            dropped: DroppedFaces { non_finite: 0, degenerate },
            warnings: vec![warning.to_owned()],
            ..LoadedMesh::default()
        };
        let mut warnings = MeshWarnings::default();
        files.iter().for_each(|file| warnings.add_file_warnings(file, &mesh(149, "odd"), true));
        warnings.add_file_warnings(&other, &mesh(1, "odd"), true);
        let messages: Vec<String> = warnings.messages().into_iter().map(|(_, message)| message).collect();
        let expected = [
            "a.glb: skipped 447 faces without area in 3 parts",
            "a.glb: odd",
            "b.ply: skipped 1 face without area",
            "b.ply: odd",
        ];
        assert_eq!(messages, expected);
    }

    #[test]
    fn dropped_faces_are_counted() {
        assert_eq!(describe_dropped_faces(&DroppedFaces::default()), None);
        let some = DroppedFaces { non_finite: 1, degenerate: 12 };
        assert_eq!(
            describe_dropped_faces(&some).as_deref(),
            Some("skipped 1 face with non-finite coordinates and 12 faces without area")
        );
    }
}
