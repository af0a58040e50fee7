//! MTL (Wavefront, *MTL Material Format*, 1995), with the PBR extension.

mod ignored;
mod map;
mod material;
mod statements;

use std::path::{Path, PathBuf};

use super::text::{convert_mac_line_ends, decode_line, strip_byte_order_mark};
use crate::assets::read::{self, Monitor};
use crate::assets::{AssetError, FileHash};
pub(super) use ignored::{MtlWarning, collect_warnings};
pub(super) use map::{encode_utf8_and_latin1_paths, first_existing_or_first, successively_strip_comments};
pub(super) use material::to_file_material;
use statements::{MtlColorParameter, MtlScalarParameter, Statement};

/// Maximum size of an MTL file.
pub(super) const FILE_LIMIT: u64 = 64 << 20;

/// Contents of an MTL file.
pub(super) struct MtlLibrary {
    pub(super) materials: Vec<MtlMaterial>,
    /// Ignored statements outside any material.
    pub(super) ignored: Vec<MtlWarning>,
    /// Hash of the file.
    pub(super) hash: FileHash,
}

/// A material's statements. If a statement is repeated, the last one is used.
#[derive(Clone, Debug, Default)]
pub(super) struct MtlMaterial {
    pub(super) name: String,
    /// Line of the `newmtl` statement.
    line: usize,
    colors: [Option<WithLine<[f64; 3]>>; MtlColorParameter::ALL.len()],
    numbers: [Option<WithLine<f64>>; MtlScalarParameter::ALL.len()],
    illumination: Option<WithLine<u8>>,
    maps: Vec<(map::MapKind, map::MtlMap)>,
    /// Statements that have no effect.
    ignored: Vec<MtlWarning>,
}

/// A value and the line that defines it.
#[derive(Clone, Copy, Debug)]
struct WithLine<T> {
    value: T,
    line: usize,
}

impl MtlMaterial {
    fn color(&self, color: MtlColorParameter) -> Option<WithLine<[f64; 3]>> {
        self.colors[color as usize]
    }

    fn number(&self, number: MtlScalarParameter) -> Option<f64> {
        self.number_with_line(number).map(|number| number.value)
    }

    fn number_with_line(&self, number: MtlScalarParameter) -> Option<WithLine<f64>> {
        self.numbers[number as usize]
    }

    /// The last map of this kind.
    fn map(&self, kind: map::MapKind) -> Option<&map::MtlMap> {
        self.maps.iter().rev().find(|(found, _)| *found == kind).map(|(_, map)| map)
    }

    /// Candidate image paths for all maps, including unsupported ones.
    pub(super) fn candidate_image_paths(&self, folder: &Path) -> impl Iterator<Item = PathBuf> {
        self.maps.iter().flat_map(|(_, map)| map.candidate_paths()).map(move |file| folder.join(file))
    }
}

/// Reads an MTL file.
///
/// # Errors
/// [`AssetError::Unreadable`], or [`AssetError::Malformed`] with the line.
pub(super) fn load(path: &Path, monitor: Monitor<'_>) -> Result<MtlLibrary, AssetError> {
    let quiet = Monitor { progress: &crate::control::ignore_progress, ..monitor };
    let bytes = read::read_text_bytes(path, FILE_LIMIT, quiet)?;
    let hash = read::hash_bytes(&bytes);
    let bytes = convert_mac_line_ends(strip_byte_order_mark(&bytes));
    let mut library = MtlLibrary { materials: Vec::new(), ignored: Vec::new(), hash };
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let line = decode_line(line);
        let mut warnings = Vec::new();
        let statement = statements::parse_line(&line, &mut warnings)
            .map_err(|reason| AssetError::malformed(path, Some(index + 1), reason))?;
        library.add_statement(statement, index + 1, warnings);
    }
    library.warn_about_duplicates();
    Ok(library)
}

/// Returns the candidate image paths for a map statement in the MTL file at `path`, or an empty list for
/// other statements and invalid map statements.
pub(super) fn map_statement_image_candidates(path: &Path, line: &[u8]) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    match statements::parse_line(&decode_line(line), &mut Vec::new()) {
        Ok(Statement::Map(_, map)) => map.candidate_paths().map(|file| folder.join(file)).collect(),
        Ok(
            Statement::Nothing
            | Statement::New(_)
            | Statement::Color(..)
            | Statement::Number(..)
            | Statement::Illumination(_)
            | Statement::Ignored,
        )
        | Err(_) => Vec::new(),
    }
}

impl MtlLibrary {
    /// Adds a statement and any warnings about it.
    fn add_statement(&mut self, statement: Statement, line: usize, warnings: Vec<String>) {
        if let Statement::New(name) = statement {
            self.materials.push(MtlMaterial { name, line, ..MtlMaterial::default() });
            return;
        }
        let Some(material) = self.materials.last_mut() else {
            let is_nothing = matches!(statement, Statement::Nothing);
            if !is_nothing && self.ignored.is_empty() {
                let words = NO_MATERIAL_YET.to_owned();
                self.ignored.push(MtlWarning { line, words });
            }
            return;
        };
        material.ignored.extend(warnings.into_iter().map(|words| MtlWarning { line, words }));
        match statement {
            Statement::New(_) | Statement::Nothing | Statement::Ignored => {}
            Statement::Color(color, value) => {
                material.colors[color as usize] = Some(WithLine { value, line });
            }
            Statement::Number(number, value) => {
                material.numbers[number as usize] = Some(WithLine { value, line });
            }
            Statement::Illumination(value) => material.illumination = Some(WithLine { value, line }),
            Statement::Map(kind, mut map) => {
                map.line = line;
                material.maps.push((kind, map));
            }
        }
    }

    /// Warns about materials with the same name, of which only the last one is used.
    fn warn_about_duplicates(&mut self) {
        let mut seen = std::collections::HashMap::new();
        for material in &self.materials {
            if let Some(first) = seen.insert(material.name.as_str(), material.line) {
                let words = duplicate_material_warning(&material.name, first);
                self.ignored.push(MtlWarning { line: material.line, words });
            }
        }
    }
}

const NO_MATERIAL_YET: &str = "statements before the first `newmtl` are ignored";

fn duplicate_material_warning(name: &str, first: usize) -> String {
    format!("material {name:?} replaces the one defined on line {first}")
}

#[cfg(test)]
mod tests;
