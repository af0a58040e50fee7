//! Builds a part (primitive) from a glTF file as a mesh in local coordinates (glTF 2.0, 3.7.2).

use super::accessor::AccessorReader;
use super::json::{Primitive, TRIANGLES};
use super::{GltfError, GltfFile};
use crate::assets::mesh::assemble::assemble;
use crate::assets::mesh::parsed::{Faces, ParsedMesh};
use crate::assets::mesh::{MeshFileBytes, vertex_out_of_range_message};
use crate::assets::read::Monitor;
use crate::assets::{AssetError, LoadedMesh};
use crate::control::{CancelToken, Progress};
use crate::math::color::linear_to_srgb8;
use crate::math::{DVec3, Vec2, Vec3};

/// Primitive modes that produce faces, other than [`TRIANGLES`].
const STRIP: u32 = 5;
const FAN: u32 = 6;

impl Primitive {
    /// Whether the primitive consists of faces rather than points or lines.
    pub(super) fn has_faces(&self) -> bool {
        [TRIANGLES, STRIP, FAN].contains(&self.mode)
    }

    /// Number of triangle corners that `count` vertices form in this mode.
    pub(super) fn triangle_corner_count(&self, count: u64) -> u64 {
        match self.mode {
            TRIANGLES => count,
            STRIP | FAN => count.saturating_sub(2).saturating_mul(3),
            _ => 0,
        }
    }
}

impl GltfFile {
    /// Returns a part's location in the file and its primitive.
    pub(super) fn part_location_and_primitive(&self, part: usize) -> Option<(String, &Primitive)> {
        let mut first = 0;
        for (mesh, json) in self.root.meshes.iter().enumerate() {
            if let Some(primitive) = part.checked_sub(first).and_then(|index| json.primitives.get(index)) {
                return Some((format!("meshes[{mesh}].primitives[{}]", part - first), primitive));
            }
            first += json.primitives.len();
        }
        None
    }

    /// Number of parts in the file.
    pub fn part_count(&self) -> usize {
        self.root.meshes.iter().map(|mesh| mesh.primitives.len()).sum()
    }

    /// Builds a part as a mesh without materials.
    ///
    /// # Errors
    /// Returns [`AssetError::Malformed`] with the location in the JSON if the part is invalid or unsupported,
    /// or [`AssetError::Canceled`] if the token is canceled.
    pub fn build_part_mesh(
        &self,
        part: usize,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<LoadedMesh, AssetError> {
        let Some((place, primitive)) = self.part_location_and_primitive(part) else {
            return Err(self.malformed_error(GltfError::index_out_of_range("part", part, self.part_count())));
        };
        let parsed = self
            .parse_primitive(primitive)
            .map_err(|wrong| self.malformed_error(wrong.add_location(place.clone())))?;
        let source = MeshFileBytes { path: &self.path, bytes: &[], monitor: Monitor { progress, token } };
        let mut loaded = assemble(&source, parsed).map_err(|error| match error {
            AssetError::Malformed { path, line, reason } => {
                AssetError::Malformed { path, line, reason: format!("{place}: {reason}") }
            }
            other => other,
        })?;
        loaded.hash = self.hash;
        (loaded.companions, loaded.pictures) = (self.companions.clone(), self.image_file_paths());
        Ok(loaded)
    }

    fn parse_primitive(&self, primitive: &Primitive) -> Result<ParsedMesh, GltfError> {
        if primitive.extensions.contains_key(super::DRACO) {
            return Err(GltfError::new("Draco compression is not supported"));
        }
        if !primitive.has_faces() {
            return Err(GltfError::new("points and lines have no faces"));
        }
        // Find the vertex of each corner.
        let positions = self.open_attribute_accessor(primitive, "POSITION")?;
        let positions = positions.ok_or_else(|| GltfError::new("it has no positions"))?;
        if positions.width != 3 {
            let width = positions.width;
            let reason = expected_vec3_message(width);
            return Err(GltfError::new(reason).add_location("POSITION"));
        }
        let (corners, vertices) = self.read_corners_and_kept_vertices(primitive, positions.count)?;
        // Read the vertex attributes.
        let is_complete = |numbers: &AccessorReader<'_>| numbers.count >= positions.count;
        let normals = self.open_attribute_accessor(primitive, "NORMAL")?.filter(is_complete);
        let mut sets = Vec::with_capacity(2);
        for set in self.select_two_uv_sets(primitive) {
            sets.push(
                self.open_attribute_accessor(primitive, &format!("TEXCOORD_{set}"))?.filter(is_complete),
            );
        }
        let colors = self.open_attribute_accessor(primitive, "COLOR_0")?.filter(is_complete);
        let each = || vertices.iter().map(|vertex| *vertex as usize);
        let mut parsed = ParsedMesh { faces: triangulate(primitive.mode, &corners), ..ParsedMesh::default() };
        parsed.positions = each()
            .map(|vertex| DVec3::from(positions.element_floats::<3>(vertex, 0.0).map(f64::from)))
            .collect();
        if let Some(normals) = normals {
            let finite = |normal: Vec3| if normal.is_finite() { normal } else { Vec3::ZERO };
            parsed.normals =
                each().map(|vertex| finite(Vec3::from(normals.element_floats(vertex, 0.0)))).collect();
        }
        // glTF measures v from the top.
        let upright = |[u, v]: [f32; 2]| Vec2::new(u, 1.0 - v);
        for (uvs, all) in sets.iter().zip([&mut parsed.uvs, &mut parsed.second_uvs]) {
            if let Some(uvs) = uvs {
                *all = each().map(|vertex| upright(uvs.element_floats(vertex, 0.0))).collect();
            }
        }
        if let Some(colors) = colors {
            parsed.colors =
                each().map(|vertex| colors.element_floats::<3>(vertex, 1.0).map(linear_to_srgb8)).collect();
        }
        Ok(parsed)
    }

    /// Opens an attribute of a primitive, if present.
    pub(super) fn open_attribute_accessor(
        &self,
        primitive: &Primitive,
        name: &str,
    ) -> Result<Option<AccessorReader<'_>>, GltfError> {
        let Some(&number) = primitive.attributes.get(name) else { return Ok(None) };
        AccessorReader::open(self, number).map(Some).map_err(|wrong| wrong.add_location(name))
    }

    /// Selects the two texture coordinate sets for a primitive's mesh: the first two that its material's
    /// textures use, in ascending order. If the textures use only one set, that set is first.
    pub(super) fn select_two_uv_sets(&self, primitive: &Primitive) -> [usize; 2] {
        let material = primitive.material.and_then(|material| self.root.materials.get(material));
        let used = material.map(|material| material.coordinate_set_per_texture()).unwrap_or_default();
        let first = used.first().copied().unwrap_or_default();
        match used.iter().find(|set| **set != first) {
            Some(&second) => [first.min(second), first.max(second)],
            None => [first, usize::from(first == 0)],
        }
    }

    /// Returns each corner's index into a list of vertices, and that list. The list contains all vertices, or
    /// only the used ones if there are few corners.
    fn read_corners_and_kept_vertices(
        &self,
        primitive: &Primitive,
        vertices: usize,
    ) -> Result<(Vec<u32>, Vec<u32>), GltfError> {
        let all = || (0..vertices as u32).collect();
        let Some(number) = primitive.indices else { return Ok((all(), all())) };
        let indices = AccessorReader::open(self, number).map_err(|wrong| wrong.add_location("indices"))?;
        if !indices.are_indices() {
            return Err(GltfError::new("indices must be integers").add_location("indices"));
        }
        let mut corners: Vec<u32> = (0..indices.count).map(|place| indices.read_index(place)).collect();
        if let Some(vertex) = corners.iter().find(|corner| **corner as usize >= vertices) {
            return Err(GltfError::new(vertex_out_of_range_message(i64::from(*vertex), vertices as u64)));
        }
        if corners.len() >= vertices / 2 {
            return Ok((corners, all()));
        }
        let mut used = corners.clone();
        used.sort_unstable();
        used.dedup();
        for corner in &mut corners {
            *corner = used.partition_point(|vertex| *vertex < *corner) as u32;
        }
        Ok((corners, used))
    }
}

pub(super) fn expected_vec3_message(width: usize) -> String {
    format!("expected VEC3, found {width} components")
}

/// Triangulates corners according to the primitive mode, dropping incomplete triangles.
fn triangulate(mode: u32, corners: &[u32]) -> Faces {
    let mut faces = Faces::default();
    let mut add = |triangle: [u32; 3]| {
        triangle.iter().for_each(|corner| faces.push_corner(*corner));
        faces.end_face(3);
    };
    match mode {
        STRIP => {
            for (index, window) in corners.windows(3).enumerate() {
                let [a, b, c] = [window[0], window[1], window[2]];
                add(if index % 2 == 0 { [a, b, c] } else { [b, a, c] });
            }
        }
        FAN => {
            for pair in corners.get(1..).unwrap_or_default().windows(2) {
                add([corners[0], pair[0], pair[1]]);
            }
        }
        _ => corners.as_chunks::<3>().0.iter().for_each(|triangle| add(*triangle)),
    }
    faces
}
