//! Builds meshes and encodes them as PLY.

use crate::assets::LoadedMesh;
use crate::math::{DVec2, DVec3};

/// A triangle mesh under construction.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct MeshData {
    pub(super) positions: Vec<DVec3>,
    /// Vertex normals, or empty.
    pub(super) normals: Vec<DVec3>,
    /// Texture coordinates, or empty.
    pub(super) uvs: Vec<DVec2>,
    pub(super) triangles: Vec<[u32; 3]>,
}

impl MeshData {
    /// Copies a mesh loaded from a file.
    pub(super) fn from_loaded(loaded: &LoadedMesh) -> Self {
        let mesh = &loaded.mesh;
        Self {
            positions: mesh.positions.iter().map(|position| position.as_dvec3() + mesh.origin).collect(),
            normals: mesh.normals.iter().map(|normal| normal.as_dvec3()).collect(),
            uvs: mesh.uvs.iter().map(|uv| uv.as_dvec2()).collect(),
            triangles: mesh.triangles.clone(),
        }
    }

    /// The cross product of two edges of a triangle, whose length is twice its area.
    fn area_vector(&self, [a, b, c]: [u32; 3]) -> DVec3 {
        let [a, b, c] = [a, b, c].map(|vertex| self.positions[vertex as usize]);
        (b - a).cross(c - a)
    }

    /// The area of a triangle transformed by `matrix`.
    pub(super) fn transformed_area(&self, triangle: [u32; 3], matrix: &crate::math::DMat4) -> f64 {
        let [a, b, c] = triangle.map(|vertex| matrix.transform_point3(self.positions[vertex as usize]));
        0.5 * (b - a).cross(c - a).length()
    }

    /// Orients the triangles as pbrt does. The front of a triangle is on the side of its vertex normals or,
    /// if there are none, follows its winding. `is_reversed` flips the front and the normals.
    pub(super) fn orient(&mut self, is_reversed: bool) {
        if is_reversed {
            self.normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            let is_flipped = if self.normals.is_empty() {
                is_reversed
            } else {
                let sum: DVec3 = triangle.iter().map(|vertex| self.normals[*vertex as usize]).sum();
                self.area_vector(triangle).dot(sum) < 0.0
            };
            if is_flipped {
                self.triangles[index].swap(1, 2);
            }
        }
    }

    /// Drops triangles without area.
    pub(super) fn drop_degenerate_triangles(&mut self) {
        let mut triangles = std::mem::take(&mut self.triangles);
        triangles.retain(|triangle| self.area_vector(*triangle).length_squared() > 0.0);
        self.triangles = triangles;
    }

    /// Assigns pbrt's default texture coordinates (0, 0), (1, 0) and (1, 1) to the corners of each triangle,
    /// if there are no texture coordinates.
    pub(super) fn add_default_uvs(&mut self) {
        if !self.uvs.is_empty() {
            return;
        }
        let corner = |values: &[DVec3], triangles: &[[u32; 3]]| -> Vec<DVec3> {
            triangles.iter().flatten().filter_map(|vertex| values.get(*vertex as usize).copied()).collect()
        };
        self.positions = corner(&self.positions, &self.triangles);
        self.normals = corner(&self.normals, &self.triangles);
        let uvs = [DVec2::ZERO, DVec2::X, DVec2::ONE];
        self.uvs = uvs.into_iter().cycle().take(3 * self.triangles.len()).collect();
        self.triangles =
            (0..self.triangles.len() as u32).map(|index| [0, 1, 2].map(|k| 3 * index + k)).collect();
    }

    /// Tessellates a parametric surface as a grid of `columns` by `rows` cells. `surface` returns the
    /// position and normal at (u, v).
    pub(super) fn from_surface([columns, rows]: [u32; 2], surface: impl Fn(DVec2) -> (DVec3, DVec3)) -> Self {
        let mut mesh = Self::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let uv = DVec2::new(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                let (position, normal) = surface(uv);
                mesh.positions.push(position);
                mesh.normals.push(normal);
                mesh.uvs.push(uv);
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let first = row * (columns + 1) + column;
                let [a, b, c, d] = [first, first + 1, first + columns + 2, first + columns + 1];
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        mesh.drop_degenerate_triangles();
        mesh
    }

    /// Encodes the mesh as binary PLY, with positions in double precision.
    pub(super) fn encode(&self) -> Vec<u8> {
        let (has_normals, has_uvs) = (!self.normals.is_empty(), !self.uvs.is_empty());
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\n",
            self.positions.len()
        );
        if has_normals {
            header.push_str("property float nx\nproperty float ny\nproperty float nz\n");
        }
        if has_uvs {
            header.push_str("property float u\nproperty float v\n");
        }
        let count = self.triangles.len();
        header.push_str(&format!(
            "element face {count}\nproperty list uchar uint vertex_indices\nend_header\n"
        ));
        let mut bytes = header.into_bytes();
        bytes.reserve(self.positions.len() * 44 + count * 13);
        for (index, position) in self.positions.iter().enumerate() {
            position.to_array().iter().for_each(|number| bytes.extend(number.to_le_bytes()));
            if has_normals {
                let normal = self.normals[index].as_vec3().to_array();
                normal.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
            }
            if has_uvs {
                let uv = self.uvs[index].as_vec2().to_array();
                uv.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
            }
        }
        for triangle in &self.triangles {
            bytes.push(3);
            triangle.iter().for_each(|vertex| bytes.extend(vertex.to_le_bytes()));
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> MeshData {
        MeshData {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]],
            ..MeshData::default()
        }
    }

    #[test]
    fn fronts_follow_normals_or_the_winding() {
        for (normal, is_reversed, expected) in [
            (None, false, DVec3::Z),
            (None, true, DVec3::NEG_Z),
            (Some(DVec3::Z), false, DVec3::Z),
            (Some(DVec3::NEG_Z), false, DVec3::NEG_Z),
            (Some(DVec3::Z), true, DVec3::NEG_Z),
            (Some(DVec3::NEG_Z), true, DVec3::Z),
        ] {
            let mut mesh = triangle();
            mesh.normals = normal.map_or(Vec::new(), |normal| vec![normal; 3]);
            mesh.orient(is_reversed);
            assert_eq!(mesh.area_vector(mesh.triangles[0]), expected, "{normal:?} {is_reversed}");
            assert!(mesh.normals.iter().all(|normal| normal.dot(expected) > 0.0));
        }
    }

    #[test]
    fn surfaces_face_along_their_normals() {
        let mesh = MeshData::from_surface([3, 2], |uv| (DVec3::new(uv.x, uv.y, 0.0), DVec3::Z));
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (12, 12));
        assert!(mesh.triangles.iter().all(|triangle| mesh.area_vector(*triangle).z > 0.0));
    }

    #[test]
    fn default_texture_coordinates_are_per_triangle() {
        let mut mesh = triangle();
        mesh.triangles.push([0, 2, 1]);
        mesh.add_default_uvs();
        assert_eq!((mesh.positions.len(), mesh.uvs.len(), mesh.triangles[1]), (6, 6, [3, 4, 5]));
        assert_eq!(mesh.uvs[5], DVec2::ONE);
    }
}
