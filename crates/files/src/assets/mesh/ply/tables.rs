//! Reads PLY files as tables that keep all scalar properties of vertices and faces, whatever their names.

use std::path::Path;

use super::super::{AssetError, MeshFileBytes, Monitor};
use super::body::{AsciiReader, BinaryReader, END_OF_FILE, LineEndMode, NumberReader};
use super::header::{self, Element, Encoding, PropertyType};
use super::{BATCH, TextCursor};
use crate::control::{CancelToken, ignore_progress};
use crate::math::DVec3;

/// The scalar properties of a file's vertices and faces, and its triangles.
#[derive(Debug, Default, PartialEq)]
pub struct PlyTables {
    /// One row per vertex.
    pub vertices: PropertyValueTable,
    /// One row per face.
    pub faces: PropertyValueTable,
    /// Vertex indices, all of which are in range.
    pub triangles: Vec<[u32; 3]>,
}

/// The scalar properties of an element, row by row.
#[derive(Debug, Default, PartialEq)]
pub struct PropertyValueTable {
    names: Vec<String>,
    /// For each property, whether its numbers are floating-point.
    is_float: Vec<bool>,
    values: Vec<f64>,
}

impl PropertyValueTable {
    /// Returns the columns of properties, or `None` unless the table has all of them.
    pub fn column_indices(&self, names: &[&str]) -> Option<Vec<usize>> {
        names.iter().map(|name| self.names.iter().position(|known| known == name)).collect()
    }

    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.values.len().checked_div(self.names.len()).unwrap_or(0)
    }

    /// The number in a row and a column.
    pub fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.names.len() + column]
    }

    /// Whether the numbers in a column are floating-point.
    pub fn is_column_float(&self, column: usize) -> bool {
        self.is_float[column]
    }

    /// Returns the vectors in three columns, or `None` unless the table has all of them.
    pub fn vectors(&self, names: [&str; 3]) -> Option<Vec<DVec3>> {
        let columns = self.column_indices(&names)?;
        let vector = |row| DVec3::from_array([0, 1, 2].map(|axis| self.value(row, columns[axis])));
        Some((0..self.row_count()).map(vector).collect())
    }
}

/// Parses a file whose faces are triangles.
///
/// # Errors
/// [`AssetError::Malformed`], also for faces other than triangles, or [`AssetError::Canceled`].
pub fn read_tables(path: &Path, bytes: &[u8], token: &CancelToken) -> Result<PlyTables, AssetError> {
    let source = MeshFileBytes { path, bytes, monitor: Monitor { progress: &ignore_progress, token } };
    let header = header::parse(&source)?;
    let (elements, at) = (&header.elements, header.body);
    let read = match header.encoding {
        Encoding::Ascii => {
            let cursor = TextCursor::new(bytes, at);
            read_elements(elements, &mut AsciiReader(cursor, LineEndMode::Blank), token)
        }
        Encoding::LittleEndian => read_elements(elements, &mut BinaryReader::<false> { bytes, at }, token),
        Encoding::BigEndian => read_elements(elements, &mut BinaryReader::<true> { bytes, at }, token),
    };
    token.check_pause_and_cancel()?;
    read.map_err(|reason| source.malformed_error_without_line(reason))
}

/// Reads all elements, or returns the reason why they cannot be read.
fn read_elements(
    elements: &[Element],
    numbers: &mut impl NumberReader,
    token: &CancelToken,
) -> Result<PlyTables, String> {
    let mut tables = PlyTables::default();
    for element in elements {
        let mut table = PropertyValueTable::default();
        for property in &element.properties {
            match property.kind {
                PropertyType::Scalar(scalar) => {
                    table.names.push(property.name.clone());
                    table.is_float.push(!scalar.is_integer());
                }
                PropertyType::List { .. } => {}
            }
        }
        let count = if element.properties.is_empty() { 0 } else { element.count };
        for index in 0..count {
            if index % BATCH == 0 && token.is_canceled() {
                return Ok(tables);
            }
            read_item(element, numbers, &mut table, &mut tables.triangles)?;
        }
        match element.name.as_str() {
            "vertex" => tables.vertices = table,
            "face" => tables.faces = table,
            _ => {}
        }
    }
    let count = tables.vertices.row_count() as u64;
    let is_valid = tables.triangles.iter().flatten().all(|vertex| u64::from(*vertex) < count);
    if is_valid { Ok(tables) } else { Err("a vertex is out of range".to_owned()) }
}

/// Appends the scalars of a vertex or a face to its table, and the vertices of a face to the triangles.
fn read_item(
    element: &Element,
    numbers: &mut impl NumberReader,
    table: &mut PropertyValueTable,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), String> {
    for property in &element.properties {
        match property.kind {
            PropertyType::Scalar(scalar) => table.values.push(numbers.read_float(scalar)?),
            PropertyType::List { count, item } => {
                let count = numbers.read_integer(count)?;
                let has_corners = matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                if element.name != "face" || !has_corners {
                    let count = usize::try_from(count).map_err(|_| END_OF_FILE.to_owned())?;
                    numbers.skip_scalars(item, count)?;
                    continue;
                }
                if count != 3 {
                    return Err(format!("a face has {count} vertices instead of 3"));
                }
                let mut corner = || {
                    let vertex = numbers.read_integer(item)?;
                    u32::try_from(vertex).map_err(|_| format!("vertex {vertex} is out of range"))
                };
                triangles.push([corner()?, corner()?, corner()?]);
            }
        }
    }
    Ok(())
}
