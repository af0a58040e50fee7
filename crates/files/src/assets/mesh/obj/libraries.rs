//! The material files of an OBJ.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use super::super::mtl::{self, Library, cut_at_comments};
use super::super::{AssetError, Source};
use crate::assets::{Companion, FileMaterial};

/// The material files that an OBJ names, in the order in which they occur.
pub(super) struct Libraries<'a> {
    pub(super) source: &'a Source<'a>,
    /// Names of materials that the OBJ uses.
    pub(super) used: &'a BTreeSet<String>,
    pub(super) found: RefCell<Found>,
    pub(super) failed: RefCell<Option<AssetError>>,
}

#[derive(Default)]
pub(super) struct Found {
    pub(super) materials: HashMap<String, FileMaterial>,
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
    /// Loads one file, or several in one statement. A missing file is a warning; a malformed one is the mesh's error.
    pub(super) fn load(&self, statement: &Path) -> tobj::MTLLoadResult {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let text = statement.to_string_lossy();
        let readings = cut_at_comments(&text).flat_map(|name| [name.to_owned(), name.replace('\\', "/")]);
        let whole = readings.map(|name| folder.join(name)).find(|path| path.exists());
        let names = whole.map_or_else(
            || {
                let names = cut_at_comments(&text).last().unwrap_or(&text).replace('\\', "/");
                names.split_whitespace().map(|name| folder.join(name)).collect()
            },
            |path| vec![path],
        );
        let mut materials = Vec::new();
        for path in names {
            materials.extend(self.load_file(&path)?);
        }
        let places = self.places(&materials);
        self.found.borrow_mut().resolved.extend(places.keys().cloned());
        Ok((materials, places))
    }

    /// Index of the material for each used name. On both sides a comment may follow the name, and a name may look as if
    /// one did (`Material #25`): the longest agreement counts.
    fn places(&self, materials: &[tobj::Material]) -> HashMap<String, usize> {
        let whole = materials.iter().enumerate().map(|(index, found)| (found.name.as_str(), index));
        let mut known: HashMap<&str, usize> = whole.clone().collect();
        for (name, index) in whole {
            for name in cut_at_comments(name) {
                known.entry(name).or_insert(index);
            }
        }
        let meant = |name: &String| cut_at_comments(name).find_map(|name| known.get(name).copied());
        self.used.iter().filter_map(|name| Some((name.clone(), meant(name)?))).collect()
    }

    fn load_file(&self, path: &Path) -> Result<Vec<tobj::Material>, tobj::LoadError> {
        let library = mtl::load(path, self.source.watch);
        let hash = library.as_ref().ok().map(|library| library.hash);
        self.found.borrow_mut().files.push(Companion { path: path.to_owned(), hash });
        match library {
            Ok(Library { materials, warnings, hash: _ }) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                let known = materials.iter().map(|found| (found.name.clone(), mtl::material(found, folder)));
                let mut found = self.found.borrow_mut();
                found.materials.extend(known);
                found.warnings.extend(warnings);
                let used: BTreeSet<usize> = self.places(&materials).into_values().collect();
                found.warnings.extend(mtl::warnings(path, used.into_iter().map(|index| &materials[index])));
                found.pictures.extend(materials.iter().flat_map(|material| mtl::pictures(material, folder)));
                Ok(materials)
            }
            Err(error @ AssetError::Unreadable { .. }) => {
                let mut found = self.found.borrow_mut();
                found.missing = true;
                found.warnings.push(format!("{error}; its materials are left out"));
                Ok(Vec::new())
            }
            Err(error) => {
                *self.failed.borrow_mut() = Some(error);
                Err(tobj::LoadError::ReadError)
            }
        }
    }
}
