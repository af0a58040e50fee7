//! Triangle meshes as plain data.

use crate::math::{DVec3, Vec2, Vec3};

/// An indexed triangle mesh in object space. All indices are in range, all positions are finite, and no
/// triangle has coincident corners.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Origin of the positions, in file coordinates. It is (0, 0, 0), or a point close to the mesh if the
    /// mesh is far from (0, 0, 0).
    pub origin: DVec3,
    /// Vertex positions relative to `origin`.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals, or empty.
    pub normals: Vec<Vec3>,
    /// Vertex texture coordinates, or empty. v = 0 is the bottom row of an image.
    pub uvs: Vec<Vec2>,
    /// Normal group of each vertex. The groups determine which vertices share a computed normal. If empty,
    /// every vertex has its own normal in the group [`VertexNormalGroup::BY_ANGLE`].
    pub normal_groups: Vec<VertexNormalGroup>,
    /// Second set of vertex texture coordinates, or empty.
    pub second_uvs: Vec<Vec2>,
    /// Vertex colors in sRGB, or empty.
    pub colors: Vec<[u8; 3]>,
    /// Vertex indices (a, b, c) of each triangle. The front faces along (b − a) × (c − a).
    pub triangles: Vec<[u32; 3]>,
    /// Each triangle's index in the file's material list, or `u32::MAX` for no material. May be empty.
    pub materials: Vec<u32>,
}

/// A vertex's normal group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexNormalGroup {
    /// Vertices with the same number share a normal. Must be less than the number of vertices in the file.
    pub normal: u32,
    /// Smoothing group. Normals at the same position are merged if they have the same group and differ by at
    /// most 45 degrees.
    pub group: u32,
}

impl VertexNormalGroup {
    /// The group of vertices without a smoothing group.
    pub const BY_ANGLE: u32 = 0;
    /// The group of flat faces. Their normals are never merged with others.
    pub const FLAT: u32 = u32::MAX;
}

impl TriangleMesh {
    /// Maximum number of triangles. Triangle indices must fit in the nodes of every tree type, even after
    /// triangle splitting.
    pub const MAX_TRIANGLES: u32 = 1 << 27;

    /// Corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|vertex| self.positions[vertex as usize])
    }

    /// Bounding box in file coordinates, or `None` if there are no vertices.
    pub fn bounds_in_file_coordinates(&self) -> Option<[DVec3; 2]> {
        let first = *self.positions.first()?;
        let grow = |[min, max]: [Vec3; 2], at: &Vec3| [min.min(*at), max.max(*at)];
        Some(self.positions.iter().fold([first; 2], grow).map(|at| at.as_dvec3() + self.origin))
    }

    /// Extreme vertices along 26 directions (the axes and the diagonals of two or three axes), in file
    /// coordinates.
    pub fn extreme_vertices(&self) -> Vec<DVec3> {
        let Some(first) = self.positions.first() else { return Vec::new() };
        let steps = [-1.0_f32, 0.0, 1.0];
        let directions =
            (0..27).map(|index| Vec3::new(steps[index % 3], steps[index / 3 % 3], steps[index / 9]));
        let farthest = |direction: Vec3| {
            let farther = |(far, at): (f32, Vec3), next: &Vec3| {
                let reach = direction.dot(*next);
                if reach > far { (reach, *next) } else { (far, at) }
            };
            self.positions.iter().fold((direction.dot(*first), *first), farther).1.as_dvec3() + self.origin
        };
        directions.filter(|direction| *direction != Vec3::ZERO).map(farthest).collect()
    }

    /// Memory used by the mesh, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.positions.as_slice())
            + size_of_val(self.normals.as_slice())
            + size_of_val(self.uvs.as_slice())
            + size_of_val(self.normal_groups.as_slice())
            + size_of_val(self.second_uvs.as_slice())
            + size_of_val(self.colors.as_slice())
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.materials.as_slice())
    }
}
