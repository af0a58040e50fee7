//! The material files of an OBJ.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::super::mtl::{self, Library, cut_at_comments, spellings};
use super::super::{AssetError, Source};
use crate::assets::{Companion, FileMaterial};

/// The material files that an OBJ names, in the order in which they occur.
pub(super) struct Libraries<'a> {
    pub(super) source: &'a Source<'a>,
    /// Names of materials that the OBJ uses.
    pub(super) used: &'a BTreeSet<String>,
    pub(super) found: Found,
}

#[derive(Default)]
pub(super) struct Found {
    pub(super) materials: Vec<FileMaterial>,
    /// Used names that lead to a material.
    pub(super) resolved: BTreeSet<String>,
    pub(super) warnings: Vec<String>,
    pub(super) missing: bool,
    /// Files that were read or looked for.
    pub(super) files: Vec<Companion>,
    /// Pictures that they name.
    pub(super) pictures: Vec<PathBuf>,
}

impl Libraries<'_> {
    /// Loads one file, or several in one statement, and returns the index of the material for each used name. A missing file is a
    /// warning.
    pub(super) fn load(&mut self, statement: &str) -> Result<HashMap<String, usize>, AssetError> {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let readings = cut_at_comments(statement).flat_map(|name| [name.to_owned(), name.replace('\\', "/")]);
        let readings = readings.flat_map(|name| spellings(&name));
        let whole = readings.map(|name| folder.join(name)).find(|path| path.exists());
        let names = whole.map_or_else(
            || {
                let names = cut_at_comments(statement).last().unwrap_or(statement).replace('\\', "/");
                names.split_whitespace().filter_map(|name| mtl::found(folder, spellings(name))).collect()
            },
            |path| vec![path],
        );
        let mut places = HashMap::new();
        for path in names {
            places.extend(self.load_file(&path)?);
        }
        self.found.resolved.extend(places.keys().cloned());
        Ok(places)
    }

    /// Index of the material for each used name. On both sides a comment may follow the name, and a name may look as if
    /// one did (`Material #25`): the longest agreement counts.
    fn places<'n>(&self, names: impl Iterator<Item = &'n str>) -> HashMap<String, usize> {
        let whole: Vec<_> = names.enumerate().map(|(index, name)| (name, index)).collect();
        let mut known: HashMap<&str, usize> = whole.iter().copied().collect();
        for (name, index) in whole {
            for name in cut_at_comments(name) {
                known.entry(name).or_insert(index);
            }
        }
        let meant = |name: &String| cut_at_comments(name).find_map(|name| known.get(name).copied());
        self.used.iter().filter_map(|name| Some((name.clone(), meant(name)?))).collect()
    }

    fn load_file(&mut self, path: &Path) -> Result<HashMap<String, usize>, AssetError> {
        let library = mtl::load(path, self.source.watch);
        let hash = library.as_ref().ok().map(|library| library.hash);
        self.found.files.push(Companion { path: path.to_owned(), hash });
        match library {
            Ok(library) => Ok(self.add(path, library)),
            Err(error @ AssetError::Unreadable { .. }) => {
                self.found.missing = true;
                self.found.warnings.push(format!("{error}; its materials are left out"));
                Ok(HashMap::new())
            }
            Err(error) => Err(error),
        }
    }

    fn add(&mut self, path: &Path, library: Library) -> HashMap<String, usize> {
        let Library { materials, ignored, hash: _ } = library;
        let folder = path.parent().unwrap_or(Path::new(""));
        let places = self.places(materials.iter().map(|material| material.name.as_str()));
        let used: BTreeSet<usize> = places.values().copied().collect();
        let found = &mut self.found;
        found.warnings.extend(mtl::warnings(path, ignored, used.into_iter().map(|index| &materials[index])));
        found.pictures.extend(materials.iter().flat_map(|material| material.pictures(folder)));
        let first = found.materials.len();
        found.materials.extend(materials.iter().map(|one| mtl::material(one, folder)));
        places.into_iter().map(|(name, place)| (name, first + place)).collect()
    }
}
