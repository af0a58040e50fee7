//! MTL (Wavefront, *MTL Material Format*, 1995), with the extension for physically based rendering.

mod ignored;
mod map;
mod material;
mod statements;

use std::path::{Path, PathBuf};

use super::text::{decoded, with_line_feeds, without_mark};
use crate::assets::read::{self, Watch};
use crate::assets::{AssetError, FileHash};
pub(super) use ignored::{Ignored, warnings};
pub(super) use map::{cut_at_comments, found, spellings};
pub(super) use material::material;
use statements::{Colour, Number, Statement};

/// Most bytes of a material file.
const FILE_LIMIT: u64 = 64 << 20;

/// The materials of an MTL file.
pub(super) struct Library {
    pub(super) materials: Vec<MtlMaterial>,
    /// Parts of the file that belong to no material and are ignored.
    pub(super) ignored: Vec<Ignored>,
    /// Hash of the file.
    pub(super) hash: FileHash,
}

/// The statements of a material; of several, the last.
#[derive(Clone, Debug, Default)]
pub(super) struct MtlMaterial {
    pub(super) name: String,
    /// Line of its `newmtl`.
    line: usize,
    colors: [Option<At<[f64; 3]>>; Colour::ALL.len()],
    numbers: [Option<At<f64>>; Number::ALL.len()],
    illumination: Option<At<u8>>,
    maps: Vec<(map::Kind, map::Map)>,
    /// Statements that have no effect.
    ignored: Vec<Ignored>,
}

/// A value and its line.
#[derive(Clone, Copy, Debug)]
struct At<T> {
    value: T,
    line: usize,
}

impl MtlMaterial {
    fn color(&self, color: Colour) -> Option<At<[f64; 3]>> {
        self.colors[color as usize]
    }

    fn number(&self, number: Number) -> Option<f64> {
        self.numbers[number as usize].map(|number| number.value)
    }

    /// The last map of a kind.
    fn map(&self, kind: map::Kind) -> Option<&map::Map> {
        self.maps.iter().rev().find(|(own, _)| *own == kind).map(|(_, map)| map)
    }

    /// Files of all maps, also of those that are not read.
    pub(super) fn pictures(&self, folder: &Path) -> impl Iterator<Item = PathBuf> {
        self.maps.iter().flat_map(|(_, map)| map.files()).map(move |file| folder.join(file))
    }
}

/// Reads an MTL file.
///
/// # Errors
/// The errors of reading, and [`AssetError::Malformed`] with the line.
pub(super) fn load(path: &Path, watch: Watch<'_>) -> Result<Library, AssetError> {
    let quiet = Watch { progress: &crate::control::ignore_progress, ..watch };
    let bytes = read::text(path, FILE_LIMIT, quiet)?;
    let hash = read::hash(&bytes);
    let bytes = with_line_feeds(without_mark(&bytes));
    let mut library = Library { materials: Vec::new(), ignored: Vec::new(), hash };
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let line = decoded(line);
        let statement = statements::parse(&line)
            .map_err(|reason| AssetError::malformed(path, Some(index + 1), reason))?;
        library.add(statement, index + 1);
    }
    library.add_repeated();
    Ok(library)
}

impl Library {
    fn add(&mut self, statement: Statement, line: usize) {
        if let Statement::New(name) = statement {
            self.materials.push(MtlMaterial { name, line, ..MtlMaterial::default() });
            return;
        }
        let Some(material) = self.materials.last_mut() else {
            let is_nothing = matches!(statement, Statement::Nothing);
            if !is_nothing && self.ignored.is_empty() {
                let words = "statements before the first `newmtl` are ignored".to_owned();
                self.ignored.push(Ignored { line, words });
            }
            return;
        };
        match statement {
            Statement::New(_) | Statement::Nothing => {}
            Statement::Colour(color, value) => material.colors[color as usize] = Some(At { value, line }),
            Statement::Number(number, value) => material.numbers[number as usize] = Some(At { value, line }),
            Statement::Illumination(value) => material.illumination = Some(At { value, line }),
            Statement::Map(kind, mut map) => {
                map.line = line;
                material.maps.push((kind, map));
            }
            Statement::Ignored(words) => material.ignored.push(Ignored { line, words }),
        }
    }

    /// Warns about names that occur twice: the last material of a name counts.
    fn add_repeated(&mut self) {
        let mut seen = std::collections::HashMap::new();
        for material in &self.materials {
            if let Some(first) = seen.insert(material.name.as_str(), material.line) {
                let words = format!("the material {:?} replaces the one of line {first}", material.name);
                self.ignored.push(Ignored { line: material.line, words });
            }
        }
    }
}

#[cfg(test)]
mod tests;
