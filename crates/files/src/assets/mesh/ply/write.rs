//! Writes meshes as little-endian PLY files. Reading such a file returns the same mesh.

use crate::geometry::mesh::TriangleMesh;
use crate::math::DVec3;

/// Encodes a mesh as PLY, without materials.
pub fn encode_ply(mesh: &TriangleMesh) -> Vec<u8> {
    let is_far = mesh.origin != DVec3::ZERO;
    let place = if is_far { "double" } else { "float" };
    let (normals, uvs, colors) = (!mesh.normals.is_empty(), !mesh.uvs.is_empty(), !mesh.colors.is_empty());
    let second_uvs = !mesh.second_uvs.is_empty();
    // Write the header.
    let mut header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.len());
    let mut add = |kind: &str, names: &[&str]| {
        names.iter().for_each(|name| header.push_str(&format!("property {kind} {name}\n")));
    };
    add(place, &["x", "y", "z"]);
    if normals {
        add("float", &["nx", "ny", "nz"]);
    }
    if uvs {
        add("float", &["u", "v"]);
    }
    if second_uvs {
        add("float", &["u1", "v1"]);
    }
    if colors {
        add("uchar", &["red", "green", "blue"]);
    }
    header.push_str(&format!(
        "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.triangles.len()
    ));
    // Write vertices, then faces.
    let mut bytes = header.into_bytes();
    for (index, position) in mesh.positions.iter().enumerate() {
        if is_far {
            let at = position.as_dvec3() + mesh.origin;
            at.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        } else {
            position.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        }
        let mut floats =
            |numbers: &[f32]| numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        if normals {
            floats(&mesh.normals[index].to_array());
        }
        if uvs {
            floats(&mesh.uvs[index].to_array());
        }
        if second_uvs {
            floats(&mesh.second_uvs[index].to_array());
        }
        if colors {
            bytes.extend(mesh.colors[index]);
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        triangle.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
    }
    bytes
}
