//! Builds meshes and encodes them as PLY.

use crate::assets::LoadedMesh;
use crate::math::color::linear_to_srgb;
use crate::math::{DVec2, DVec3};

/// A triangle mesh under construction.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct MeshData {
    pub(crate) positions: Vec<DVec3>,
    /// Vertex normals, or empty.
    pub(crate) normals: Vec<DVec3>,
    /// Texture coordinates, or empty.
    pub(crate) uvs: Vec<DVec2>,
    /// Linear vertex colors from 0 to 1, or empty.
    pub(crate) colors: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl MeshData {
    /// Copies a mesh loaded from a file.
    pub(crate) fn from_loaded(loaded: &LoadedMesh) -> Self {
        let mesh = &loaded.mesh;
        Self {
            positions: mesh.positions.iter().map(|position| position.as_dvec3() + mesh.origin).collect(),
            normals: mesh.normals.iter().map(|normal| normal.as_dvec3()).collect(),
            uvs: mesh.uvs.iter().map(|uv| uv.as_dvec2()).collect(),
            colors: Vec::new(),
            triangles: mesh.triangles.clone(),
        }
    }

    /// The cross product of two edges of a triangle, whose length is twice its area.
    fn triangle_cross_product(&self, [a, b, c]: [u32; 3]) -> DVec3 {
        let [a, b, c] = [a, b, c].map(|vertex| self.positions[vertex as usize]);
        (b - a).cross(c - a)
    }

    /// The area of a triangle transformed by `matrix`.
    pub(crate) fn transformed_triangle_area(&self, triangle: [u32; 3], matrix: &crate::math::DMat4) -> f64 {
        let [a, b, c] = triangle.map(|vertex| matrix.transform_point3(self.positions[vertex as usize]));
        0.5 * (b - a).cross(c - a).length()
    }

    /// Orients the triangles as pbrt does. The front of a triangle is on the side of its vertex normals or,
    /// if there are none, follows its winding. `is_reversed` flips the front and the normals.
    pub(crate) fn orient_triangles_like_pbrt(&mut self, is_reversed: bool) {
        if is_reversed {
            self.normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        for index in 0..self.triangles.len() {
            let triangle = self.triangles[index];
            let is_flipped = if self.normals.is_empty() {
                is_reversed
            } else {
                let sum: DVec3 = triangle.iter().map(|vertex| self.normals[*vertex as usize]).sum();
                self.triangle_cross_product(triangle).dot(sum) < 0.0
            };
            if is_flipped {
                self.triangles[index].swap(1, 2);
            }
        }
    }

    /// Drops triangles without area.
    pub(crate) fn drop_degenerate_triangles(&mut self) {
        let mut triangles = std::mem::take(&mut self.triangles);
        triangles.retain(|triangle| self.triangle_cross_product(*triangle).length_squared() > 0.0);
        self.triangles = triangles;
    }

    /// Drops triangles that single precision cannot tell from a line.
    pub(crate) fn drop_slivers(&mut self) {
        let [low, high] = self
            .positions
            .iter()
            .fold([DVec3::MAX, DVec3::MIN], |[low, high], at| [low.min(*at), high.max(*at)]);
        let least = 2e-7 * (high - low).max_element();
        let mut triangles = std::mem::take(&mut self.triangles);
        triangles.retain(|triangle| {
            let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            self.triangle_cross_product(*triangle).length() > least * longest
        });
        self.triangles = triangles;
    }

    /// Assigns pbrt's default texture coordinates (0, 0), (1, 0) and (1, 1) to the corners of each triangle,
    /// if there are no texture coordinates.
    pub(crate) fn add_default_uvs(&mut self) {
        if !self.uvs.is_empty() {
            return;
        }
        self.split_triangles();
        let uvs = [DVec2::ZERO, DVec2::X, DVec2::ONE];
        self.uvs = uvs.into_iter().cycle().take(3 * self.triangles.len()).collect();
    }

    /// Tessellates a parametric surface as a grid of `columns` by `rows` cells. `surface` returns the
    /// position and normal at (u, v).
    pub(crate) fn tessellate_surface(
        [columns, rows]: [u32; 2],
        surface: impl Fn(DVec2) -> (DVec3, DVec3),
    ) -> Self {
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

    /// Sets the normals to the means of the adjacent triangles' normals, weighted by the triangles' angles.
    pub(crate) fn add_smooth_normals(&mut self) {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        for triangle in &self.triangles {
            let Some(normal) = self.triangle_cross_product(*triangle).try_normalize() else { continue };
            for corner in 0..3 {
                let [at, next, last] =
                    [0, 1, 2].map(|step| self.positions[triangle[(corner + step) % 3] as usize]);
                let [a, b] = [next - at, last - at].map(DVec3::normalize_or_zero);
                sums[triangle[corner] as usize] += normal * libm::acos(a.dot(b).clamp(-1.0, 1.0));
            }
        }
        self.normals = sums.into_iter().map(|sum| sum.try_normalize().unwrap_or(DVec3::Z)).collect();
    }

    /// Adds the triangles of another mesh, which must have the same attributes unless this mesh is empty.
    pub(crate) fn append(&mut self, other: Self) {
        let offset = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.uvs.extend(other.uvs);
        self.colors.extend(other.colors);
        self.triangles.extend(other.triangles.iter().map(|triangle| triangle.map(|vertex| vertex + offset)));
    }

    /// Gives every triangle its own vertices.
    pub(crate) fn split_triangles(&mut self) {
        let corners: Vec<usize> = self.triangles.iter().flatten().map(|vertex| *vertex as usize).collect();
        let split = |values: &[DVec3]| match values.is_empty() {
            true => Vec::new(),
            false => corners.iter().map(|corner| values[*corner]).collect(),
        };
        (self.positions, self.normals, self.colors) =
            (split(&self.positions), split(&self.normals), split(&self.colors));
        if !self.uvs.is_empty() {
            self.uvs = corners.iter().map(|corner| self.uvs[*corner]).collect();
        }
        self.triangles =
            (0..self.triangles.len() as u32).map(|index| [0, 1, 2].map(|k| 3 * index + k)).collect();
    }

    /// Encodes the mesh as binary PLY, with positions in double precision.
    pub(crate) fn encode_ply(&self) -> Vec<u8> {
        let (has_normals, has_uvs) = (!self.normals.is_empty(), !self.uvs.is_empty());
        let has_colors = !self.colors.is_empty();
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
        if has_colors {
            header.push_str("property float red\nproperty float green\nproperty float blue\n");
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
            if has_colors {
                // Colors in PLY files are in sRGB.
                let color = self.colors[index].as_vec3().to_array().map(linear_to_srgb);
                color.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
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
            mesh.orient_triangles_like_pbrt(is_reversed);
            assert_eq!(mesh.triangle_cross_product(mesh.triangles[0]), expected, "{normal:?} {is_reversed}");
            assert!(mesh.normals.iter().all(|normal| normal.dot(expected) > 0.0));
        }
    }

    #[test]
    fn surfaces_face_along_their_normals() {
        let mesh = MeshData::tessellate_surface([3, 2], |uv| (DVec3::new(uv.x, uv.y, 0.0), DVec3::Z));
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (12, 12));
        assert!(mesh.triangles.iter().all(|triangle| mesh.triangle_cross_product(*triangle).z > 0.0));
    }

    #[test]
    fn slivers_are_dropped() {
        let mut mesh = triangle();
        mesh.positions.push(DVec3::X * 0.5 + DVec3::Y * 1e-8);
        mesh.triangles.push([0, 1, 3]);
        mesh.drop_slivers();
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
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
