//! Attributes of the vertices and faces of PLY files, which Mitsuba's `mesh_attribute` uses.

use crate::assets::mesh::ply::tables::{PlyTables, PropertyValueTable};
use crate::formats::foreign::meshes::MeshData;
use crate::math::{DVec2, DVec3};

/// The mesh whose material is being converted, and its attributes.
#[derive(Debug)]
pub(super) struct AttributedMesh {
    /// Start of the shape in the text, which identifies it.
    pub(super) id: usize,
    pub(super) tables: PlyTables,
    /// Colors of the vertices, if the material multiplies them.
    pub(super) colors: Vec<DVec3>,
}

/// An attribute of the vertices or faces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshAttribute {
    /// Whether the attribute has three components. Otherwise, the values are gray.
    pub(super) is_color: bool,
    pub(super) values: Vec<DVec3>,
}

/// Returns an attribute: the properties `NAME_0`, `NAME_1` and so on, or `r`, `g` and `b` for `color`. Only
/// floating-point numbers are supported, because Mitsuba converts others.
pub(super) fn attribute_in_table(table: &PropertyValueTable, name: &str) -> Option<MeshAttribute> {
    let numbered = [0, 1, 2].map(|index| format!("{name}_{index}"));
    let numbered = numbered.each_ref().map(String::as_str);
    let columns = table
        .column_indices(&numbered)
        .or_else(|| table.column_indices(&["r", "g", "b"]).filter(|_| name == "color"))
        .or_else(|| {
            table.column_indices(&numbered[..1]).filter(|_| table.column_indices(&numbered[1..2]).is_none())
        })?;
    if columns.iter().any(|column| !table.is_column_float(*column)) {
        return None;
    }
    let value = |row: usize| match columns[..] {
        [x, y, z] => DVec3::new(table.value(row, x), table.value(row, y), table.value(row, z)),
        _ => DVec3::splat(table.value(row, columns[0])),
    };
    Some(MeshAttribute { is_color: columns.len() == 3, values: (0..table.row_count()).map(value).collect() })
}

/// Returns an attribute of the faces.
pub(super) fn face_attribute(tables: &PlyTables, name: &str) -> Option<MeshAttribute> {
    attribute_in_table(&tables.faces, name).filter(|found| found.values.len() == tables.triangles.len())
}

/// Returns the mesh, or `None` if it has no triangles. Its normals are empty if the file has none.
pub(super) fn triangle_mesh(tables: &PlyTables) -> Option<MeshData> {
    let vertices = &tables.vertices;
    let uvs = vertices.column_indices(&["u", "v"]).or_else(|| vertices.column_indices(&["s", "t"]));
    let uv = |columns: Vec<usize>| {
        let of = |row| DVec2::new(vertices.value(row, columns[0]), vertices.value(row, columns[1]));
        (0..vertices.row_count()).map(of).collect()
    };
    let mesh = MeshData {
        positions: vertices.vectors(["x", "y", "z"])?,
        normals: vertices.vectors(["nx", "ny", "nz"]).unwrap_or_default(),
        uvs: uvs.map(uv).unwrap_or_default(),
        triangles: tables.triangles.clone(),
        colors: Vec::new(),
    };
    (!mesh.triangles.is_empty()).then_some(mesh)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::assets::mesh::ply::tables::read_tables;
    use crate::control::CancelToken;

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
        let parse = |bytes: &[u8]| read_tables(Path::new("a.ply"), bytes, &CancelToken::new());
        let tables = parse(&ascii).expect("a file");
        for other in [&little, &big] {
            assert_eq!(parse(other).as_ref().expect("a file"), &tables);
        }
        let mesh = triangle_mesh(&tables).expect("a mesh");
        assert_eq!((mesh.positions[2], mesh.triangles[0]), (DVec3::Y * 2.0, [0, 1, 2]));
        let color = attribute_in_table(&tables.vertices, "color").expect("an attribute");
        assert_eq!((color.is_color, color.values[0]), (true, DVec3::new(1.0, 0.0, 0.5)));
        let weight = face_attribute(&tables, "weight").expect("an attribute");
        assert_eq!((weight.is_color, &weight.values[..]), (false, &[DVec3::splat(0.25)][..]));
        assert_eq!(face_attribute(&tables, "color"), None);
        assert!(parse(&big[..big.len() - 1]).is_err(), "truncated");
    }
}
