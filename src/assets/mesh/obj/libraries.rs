//! The material files of an OBJ.

use std::cell::RefCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::super::{AssetError, Source, mtl};
use crate::assets::FileMaterial;

/// The material files that an OBJ names, as they are met.
pub(super) struct Libraries<'a> {
    pub(super) source: &'a Source<'a>,
    pub(super) found: RefCell<Found>,
    pub(super) failed: RefCell<Option<AssetError>>,
}

#[derive(Default)]
pub(super) struct Found {
    pub(super) materials: HashMap<String, FileMaterial>,
    pub(super) warnings: Vec<String>,
    pub(super) missing: bool,
    /// Files that were read or looked for.
    pub(super) files: Vec<PathBuf>,
    /// Pictures that they name.
    pub(super) pictures: Vec<PathBuf>,
}

impl Libraries<'_> {
    /// One file, or several in one statement. A missing one is a warning; a malformed one is the mesh's error.
    pub(super) fn load(&self, statement: &Path) -> tobj::MTLLoadResult {
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let whole = folder.join(statement);
        let text = statement.to_string_lossy().replace('\\', "/");
        let names: Vec<_> = if whole.exists() {
            vec![whole]
        } else if folder.join(&text).exists() {
            vec![folder.join(&text)]
        } else {
            text.split_whitespace().map(|name| folder.join(name)).collect()
        };
        let mut materials = Vec::new();
        for path in names {
            materials.extend(self.load_file(&path)?);
        }
        let places = materials.iter().enumerate().map(|(index, found)| (found.name.clone(), index)).collect();
        Ok((materials, places))
    }

    fn load_file(&self, path: &Path) -> Result<Vec<tobj::Material>, tobj::LoadError> {
        self.found.borrow_mut().files.push(path.to_owned());
        match mtl::load(path, self.source.watch) {
            Ok(materials) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                let known = materials.iter().map(|found| (found.name.clone(), mtl::material(found, folder)));
                let mut found = self.found.borrow_mut();
                found.materials.extend(known);
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
