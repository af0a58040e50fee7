//! Loads the material libraries for an OBJ file.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::super::mtl::{self, MtlLibrary, encode_utf8_and_latin1_paths, successively_strip_comments};
use super::super::{AssetError, MeshFileBytes};
use crate::assets::{Companion, FileMaterial};
use crate::system::file::FileStamp;

/// Loads the libraries referenced by an OBJ file, in order of occurrence.
pub(super) struct MtlLibraryLoader<'a> {
    pub(super) source: &'a MeshFileBytes<'a>,
    /// Names of the materials used by the OBJ file.
    pub(super) used: &'a BTreeSet<String>,
    pub(super) found: LoadedLibraries,
}

#[derive(Default)]
pub(super) struct LoadedLibraries {
    pub(super) materials: Vec<FileMaterial>,
    /// Used names that were resolved to a material.
    pub(super) resolved: BTreeSet<String>,
    pub(super) warnings: Vec<String>,
    pub(super) missing: bool,
    /// Library files, including missing ones.
    pub(super) files: Vec<Companion>,
    /// Images referenced by the materials.
    pub(super) images: Vec<PathBuf>,
}

impl MtlLibraryLoader<'_> {
    /// Loads the libraries named in a statement. Maps each used material name that they define to its
    /// material index. Missing files only cause warnings.
    pub(super) fn load_mtllib_statement(
        &mut self,
        statement: &str,
    ) -> Result<HashMap<String, usize>, AssetError> {
        let mut indices = HashMap::new();
        for path in resolve_library_paths(self.source.path, statement) {
            indices.extend(self.load_file_and_map_materials(&path)?);
        }
        self.found.resolved.extend(indices.keys().cloned());
        Ok(indices)
    }

    /// Maps each used material name to its index in `names`. In both OBJ and MTL files, a name may contain
    /// `#` (`Material #25`) or be followed by a comment, so the longest match is used.
    fn map_used_names_within_library<'n>(
        &self,
        names: impl Iterator<Item = &'n str>,
    ) -> HashMap<String, usize> {
        let all: Vec<_> = names.enumerate().map(|(index, name)| (name, index)).collect();
        let mut known: HashMap<&str, usize> = all.iter().copied().collect();
        for (name, index) in all {
            for name in successively_strip_comments(name) {
                known.entry(name).or_insert(index);
            }
        }
        let index =
            |name: &String| successively_strip_comments(name).find_map(|name| known.get(name).copied());
        self.used.iter().filter_map(|name| Some((name.clone(), index(name)?))).collect()
    }

    fn load_file_and_map_materials(&mut self, path: &Path) -> Result<HashMap<String, usize>, AssetError> {
        let stamp = FileStamp::from_path(path);
        let library = mtl::load(path, self.source.monitor);
        let hash = library.as_ref().ok().map(|library| library.hash);
        self.found.files.push(Companion { path: path.to_owned(), hash, stamp });
        match library {
            Ok(library) => Ok(self.add_materials_and_map_names(path, library)),
            Err(error @ AssetError::Unreadable { .. }) => {
                self.found.missing = true;
                self.found.warnings.push(unreadable_library_warning(&error));
                Ok(HashMap::new())
            }
            Err(error) => Err(error),
        }
    }

    fn add_materials_and_map_names(&mut self, path: &Path, library: MtlLibrary) -> HashMap<String, usize> {
        let MtlLibrary { materials, ignored, hash: _ } = library;
        let folder = path.parent().unwrap_or(Path::new(""));
        let indices =
            self.map_used_names_within_library(materials.iter().map(|material| material.name.as_str()));
        let used: BTreeSet<usize> = indices.values().copied().collect();
        let found = &mut self.found;
        found.warnings.extend(mtl::collect_warnings(
            path,
            ignored,
            used.into_iter().map(|index| &materials[index]),
        ));
        found.images.extend(materials.iter().flat_map(|material| material.candidate_image_paths(folder)));
        let first = found.materials.len();
        found.materials.extend(materials.iter().map(|material| mtl::to_file_material(material, path)));
        indices.into_iter().map(|(name, index)| (name, first + index)).collect()
    }
}

/// Returns the libraries named in an `mtllib` statement from the OBJ file at `obj`. The names may contain
/// blanks and may be followed by a comment.
pub(super) fn resolve_library_paths(obj: &Path, statement: &str) -> Vec<PathBuf> {
    let folder = obj.parent().unwrap_or(Path::new(""));
    let readings =
        successively_strip_comments(statement).flat_map(|name| [name.to_owned(), name.replace('\\', "/")]);
    let readings = readings.flat_map(|name| encode_utf8_and_latin1_paths(&name));
    let single = readings.map(|name| folder.join(name)).find(|path| path.exists());
    if let Some(path) = single {
        return vec![path];
    }
    let names = successively_strip_comments(statement).last().unwrap_or(statement).replace('\\', "/");
    names
        .split_whitespace()
        .filter_map(|name| mtl::first_existing_or_first(folder, encode_utf8_and_latin1_paths(name)))
        .collect()
}

/// Warning about a library that cannot be read.
pub(super) fn unreadable_library_warning(error: &AssetError) -> String {
    format!("{error}; its materials are skipped")
}
