//! Reads PLY files with all properties of their vertices and faces, which Mitsuba's `mesh_attribute` uses.

use crate::formats::foreign::meshes::MeshData;
use crate::math::{DVec2, DVec3};

/// A PLY file of triangles.
#[derive(Debug, Default, PartialEq)]
pub(super) struct PlyTables {
    vertices: PropertyTable,
    faces: PropertyTable,
    triangles: Vec<[u32; 3]>,
}

/// The mesh whose material is being converted, and its attributes.
#[derive(Debug)]
pub(super) struct AttributedMesh {
    /// Start of the shape in the text, which identifies it.
    pub(super) id: usize,
    pub(super) tables: PlyTables,
    /// Colors of the vertices, if the material multiplies them.
    pub(super) colors: Vec<DVec3>,
}

/// The scalar properties of an element, row by row.
#[derive(Debug, Default, PartialEq)]
struct PropertyTable {
    names: Vec<String>,
    /// Whether a property has floating-point numbers.
    is_float: Vec<bool>,
    values: Vec<f64>,
}

/// Type of a scalar.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ScalarType {
    bytes: usize,
    is_float: bool,
    is_signed: bool,
}

/// A property of an element.
#[derive(Debug)]
struct PlyProperty {
    name: String,
    item: ScalarType,
    /// Type of the length, if the property is a list.
    length: Option<ScalarType>,
}

/// An element of the header.
#[derive(Debug)]
struct PlyElement {
    name: String,
    count: usize,
    properties: Vec<PlyProperty>,
}

/// Encoding of the numbers after the header.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Reads numbers, and returns `None` at the end of the file.
struct Numbers<'a> {
    encoding: Encoding,
    rest: &'a [u8],
}

impl Numbers<'_> {
    fn next(&mut self, kind: ScalarType) -> Option<f64> {
        if self.encoding == Encoding::Ascii {
            let start = self.rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
            let word = &self.rest[start..];
            let end = word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len());
            self.rest = &word[end..];
            return std::str::from_utf8(&word[..end]).ok()?.parse().ok();
        }
        let (bytes, rest) = self.rest.split_at_checked(kind.bytes)?;
        self.rest = rest;
        let mut number = [0; 8];
        number[..kind.bytes].copy_from_slice(bytes);
        if self.encoding == Encoding::BigEndian {
            number[..kind.bytes].reverse();
        }
        let whole = u64::from_le_bytes(number);
        Some(match (kind.is_float, kind.bytes) {
            (true, 4) => f64::from(f32::from_bits(whole as u32)),
            (true, _) => f64::from_bits(whole),
            (false, bytes) if kind.is_signed => {
                let unused = 64 - 8 * bytes as u32;
                ((whole << unused) as i64 >> unused) as f64
            }
            (false, _) => whole as f64,
        })
    }
}

/// Returns the type with a name.
fn scalar_type(name: &str) -> Option<ScalarType> {
    let (bytes, is_float, is_signed) = match name {
        "char" | "int8" => (1, false, true),
        "uchar" | "uint8" => (1, false, false),
        "short" | "int16" => (2, false, true),
        "ushort" | "uint16" => (2, false, false),
        "int" | "int32" => (4, false, true),
        "uint" | "uint32" => (4, false, false),
        "float" | "float32" => (4, true, true),
        "double" | "float64" => (8, true, true),
        _ => return None,
    };
    Some(ScalarType { bytes, is_float, is_signed })
}

/// Parses the header. Returns the encoding, the elements and the bytes after the header.
fn parse_header(bytes: &[u8]) -> Option<(Encoding, Vec<PlyElement>, &[u8])> {
    const END: &[u8] = b"end_header";
    const MAX_HEADER: usize = 1 << 16;
    let searched = &bytes[..bytes.len().min(MAX_HEADER)];
    let end = searched.windows(END.len()).position(|window| window == END)?;
    let text = std::str::from_utf8(&bytes[..end]).ok()?;
    let after = &bytes[end + END.len()..];
    let newline = after.iter().position(|byte| *byte == b'\n')?;
    let (mut encoding, mut elements) = (None, Vec::<PlyElement>::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::LittleEndian,
                    "binary_big_endian" => Encoding::BigEndian,
                    _ => return None,
                });
            }
            ["element", name, count] => {
                let element =
                    PlyElement { name: name.to_owned(), count: count.parse().ok()?, properties: Vec::new() };
                elements.push(element);
            }
            ["property", "list", length, item, name] => {
                let (length, item) = (Some(scalar_type(length)?), scalar_type(item)?);
                elements.last_mut()?.properties.push(PlyProperty { name: name.to_owned(), item, length });
            }
            ["property", item, name] => {
                let item = scalar_type(item)?;
                elements.last_mut()?.properties.push(PlyProperty {
                    name: name.to_owned(),
                    item,
                    length: None,
                });
            }
            _ => {}
        }
    }
    Some((encoding?, elements, &after[newline + 1..]))
}

impl PropertyTable {
    /// Returns the columns of consecutive properties.
    fn columns(&self, names: &[&str]) -> Option<Vec<usize>> {
        names.iter().map(|name| self.names.iter().position(|known| known == name)).collect()
    }

    fn rows(&self) -> usize {
        self.values.len().checked_div(self.names.len()).unwrap_or(0)
    }

    fn value(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.names.len() + column]
    }

    fn vectors(&self, names: [&str; 3]) -> Option<Vec<DVec3>> {
        let columns = self.columns(&names)?;
        let vector = |row| {
            DVec3::new(self.value(row, columns[0]), self.value(row, columns[1]), self.value(row, columns[2]))
        };
        Some((0..self.rows()).map(vector).collect())
    }

    /// Returns an attribute: the properties `NAME_0`, `NAME_1` and so on, or `r`, `g` and `b` for `color`. Only
    /// floating-point numbers are supported, because Mitsuba converts others.
    fn attribute(&self, name: &str) -> Option<MeshAttribute> {
        let numbered = [0, 1, 2].map(|index| format!("{name}_{index}"));
        let numbered = numbered.each_ref().map(String::as_str);
        let columns = self
            .columns(&numbered)
            .or_else(|| self.columns(&["r", "g", "b"]).filter(|_| name == "color"))
            .or_else(|| self.columns(&numbered[..1]).filter(|_| self.columns(&numbered[1..2]).is_none()))?;
        if columns.iter().any(|column| !self.is_float[*column]) {
            return None;
        }
        let value = |row: usize| match columns[..] {
            [x, y, z] => DVec3::new(self.value(row, x), self.value(row, y), self.value(row, z)),
            _ => DVec3::splat(self.value(row, columns[0])),
        };
        Some(MeshAttribute { is_color: columns.len() == 3, values: (0..self.rows()).map(value).collect() })
    }
}

/// An attribute of the vertices or faces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshAttribute {
    /// Whether the attribute has three components. Otherwise, the values are gray.
    pub(super) is_color: bool,
    pub(super) values: Vec<DVec3>,
}

impl PlyTables {
    /// Parses a file. Returns `None` if it is malformed or has faces other than triangles.
    pub(super) fn parse(bytes: &[u8]) -> Option<Self> {
        let (encoding, elements, rest) = parse_header(bytes)?;
        let (mut numbers, mut tables) = (Numbers { encoding, rest }, Self::default());
        for element in &elements {
            let mut table = PropertyTable::default();
            for property in element.properties.iter().filter(|property| property.length.is_none()) {
                table.names.push(property.name.clone());
                table.is_float.push(property.item.is_float);
            }
            let count = if element.properties.is_empty() { 0 } else { element.count };
            for _ in 0..count {
                for property in &element.properties {
                    let Some(length) = property.length else {
                        table.values.push(numbers.next(property.item)?);
                        continue;
                    };
                    let count = numbers.next(length)?;
                    let is_face = element.name == "face"
                        && matches!(&*property.name, "vertex_indices" | "vertex_index");
                    if is_face && count == 3.0 {
                        let mut corner = || Some(numbers.next(property.item)? as u32);
                        tables.triangles.push([corner()?, corner()?, corner()?]);
                    } else if is_face {
                        return None;
                    } else {
                        for _ in 0..count as usize {
                            numbers.next(property.item)?;
                        }
                    }
                }
            }
            match &*element.name {
                "vertex" => tables.vertices = table,
                "face" => tables.faces = table,
                _ => {}
            }
        }
        let count = tables.vertices.rows() as u32;
        let is_valid = tables.triangles.iter().flatten().all(|vertex| *vertex < count);
        (is_valid && !tables.triangles.is_empty()).then_some(tables)
    }

    /// Returns the mesh. Its normals are empty if the file has none.
    pub(super) fn mesh(&self) -> Option<MeshData> {
        let uvs = self.vertices.columns(&["u", "v"]).or_else(|| self.vertices.columns(&["s", "t"]));
        let uv = |columns: Vec<usize>| {
            let of =
                |row| DVec2::new(self.vertices.value(row, columns[0]), self.vertices.value(row, columns[1]));
            (0..self.vertices.rows()).map(of).collect()
        };
        Some(MeshData {
            positions: self.vertices.vectors(["x", "y", "z"])?,
            normals: self.vertices.vectors(["nx", "ny", "nz"]).unwrap_or_default(),
            uvs: uvs.map(uv).unwrap_or_default(),
            triangles: self.triangles.clone(),
            colors: Vec::new(),
        })
    }

    /// Returns an attribute of the vertices.
    pub(super) fn vertex_attribute(&self, name: &str) -> Option<MeshAttribute> {
        self.vertices.attribute(name)
    }

    /// Returns an attribute of the faces.
    pub(super) fn face_attribute(&self, name: &str) -> Option<MeshAttribute> {
        self.faces.attribute(name).filter(|attribute| attribute.values.len() == self.triangles.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file with one triangle, whose numbers `write` encodes.
    fn file(format: &str, write: impl Fn(&mut Vec<u8>, f32)) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
            property float color_0\nproperty float color_1\nproperty float color_2\nelement face 1\n\
            property float weight_0\nproperty list uchar short vertex_indices\nend_header\n"
        )
        .into_bytes();
        for vertex in
            [[0.0, 0.0, 0.0, 1.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 2.0, 0.0, 0.0, 0.0, 1.0]]
        {
            vertex.into_iter().for_each(|number| write(&mut bytes, number));
        }
        write(&mut bytes, 0.25);
        bytes
    }

    #[test]
    fn all_encodings_have_the_same_attributes() {
        let mut ascii = file("ascii", |bytes, number| bytes.extend(format!("{number} ").bytes()));
        ascii.extend(b"\n3 0 1 2\n");
        let mut little = file("binary_little_endian", |bytes, number| bytes.extend(number.to_le_bytes()));
        little.extend([3, 0, 0, 1, 0, 2, 0]);
        let mut big = file("binary_big_endian", |bytes, number| bytes.extend(number.to_be_bytes()));
        big.extend([3, 0, 0, 0, 1, 0, 2]);
        let tables = PlyTables::parse(&ascii).expect("a file");
        for other in [&little, &big] {
            assert_eq!(PlyTables::parse(other).as_ref(), Some(&tables));
        }
        let mesh = tables.mesh().expect("a mesh");
        assert_eq!((mesh.positions[2], mesh.triangles[0]), (DVec3::Y * 2.0, [0, 1, 2]));
        let color = tables.vertex_attribute("color").expect("an attribute");
        assert_eq!((color.is_color, color.values[0]), (true, DVec3::new(1.0, 0.0, 0.5)));
        let weight = tables.face_attribute("weight").expect("an attribute");
        assert_eq!((weight.is_color, &weight.values[..]), (false, &[DVec3::splat(0.25)][..]));
        assert_eq!(tables.face_attribute("color"), None);
        assert_eq!(PlyTables::parse(&big[..big.len() - 1]), None, "truncated");
    }
}
