//! A part of a glTF file: a primitive as a mesh in its own coordinates (glTF 2.0, 3.7.2).

use super::accessor::Numbers;
use super::json::{Primitive, TRIANGLES};
use super::{Container, Wrong};
use crate::assets::mesh::Source;
use crate::assets::mesh::assemble::assemble;
use crate::assets::mesh::parsed::{Faces, Parsed};
use crate::assets::read::Watch;
use crate::assets::{AssetError, LoadedMesh};
use crate::control::{CancelToken, Progress};
use crate::math::color::linear_to_srgb8;
use crate::math::{DVec3, Vec2, Vec3};

/// The modes of primitives that have faces, beside [`TRIANGLES`].
const STRIP: u32 = 5;
const FAN: u32 = 6;

impl Primitive {
    /// Whether it has faces, not points or lines.
    pub(super) fn has_faces(&self) -> bool {
        [TRIANGLES, STRIP, FAN].contains(&self.mode)
    }

    /// Corners of the triangles that a list of so many corners makes in its mode.
    pub(super) fn corners_built(&self, count: u64) -> u64 {
        match self.mode {
            TRIANGLES => count,
            STRIP | FAN => count.saturating_sub(2).saturating_mul(3),
            _ => 0,
        }
    }
}

impl Container {
    /// The primitive of a number over all meshes, with its place.
    pub(super) fn primitive(&self, part: usize) -> Option<(String, &Primitive)> {
        let mut first = 0;
        for (mesh, json) in self.root.meshes.iter().enumerate() {
            if let Some(primitive) = part.checked_sub(first).and_then(|place| json.primitives.get(place)) {
                return Some((format!("meshes[{mesh}].primitives[{}]", part - first), primitive));
            }
            first += json.primitives.len();
        }
        None
    }

    /// Number of parts.
    pub fn parts(&self) -> usize {
        self.root.meshes.iter().map(|mesh| mesh.primitives.len()).sum()
    }

    /// A part as a mesh, without materials.
    ///
    /// # Errors
    /// [`AssetError::Malformed`] with the place in the JSON; [`AssetError::Cancelled`].
    pub fn part(
        &self,
        part: usize,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<LoadedMesh, AssetError> {
        let Some((place, primitive)) = self.primitive(part) else {
            return Err(self.wrong(Wrong::index("part", part, self.parts())));
        };
        let parsed = self.parsed(primitive).map_err(|wrong| self.wrong(wrong.inside(place.clone())))?;
        let source = Source { path: &self.path, bytes: &[], watch: Watch { progress, token } };
        let mut loaded = assemble(&source, parsed).map_err(|error| match error {
            AssetError::Malformed { path, line, reason } => {
                AssetError::Malformed { path, line, reason: format!("{place}: {reason}") }
            }
            other => other,
        })?;
        loaded.hash = self.hash;
        (loaded.companions, loaded.pictures) = (self.companions.clone(), self.pictures());
        Ok(loaded)
    }

    fn parsed(&self, primitive: &Primitive) -> Result<Parsed, Wrong> {
        if primitive.extensions.contains_key(super::DRACO) {
            return Err(Wrong::new("its faces are compressed by Draco, which this version does not read"));
        }
        if !primitive.has_faces() {
            return Err(Wrong::new("points and lines have no faces"));
        }
        // Find the vertices of the corners.
        let positions = self.attribute(primitive, "POSITION")?;
        let positions = positions.ok_or_else(|| Wrong::new("it has no positions"))?;
        if positions.width != 3 {
            let width = positions.width;
            let reason = format!("a position has three numbers (VEC3), and here {width}");
            return Err(Wrong::new(reason).inside("POSITION"));
        }
        let (corners, vertices) = self.corners(primitive, positions.count)?;
        // Read what the vertices have.
        let is_whole = |numbers: &Numbers<'_>| numbers.count >= positions.count;
        let normals = self.attribute(primitive, "NORMAL")?.filter(is_whole);
        let mut sets = Vec::with_capacity(2);
        for set in self.coordinate_sets(primitive) {
            sets.push(self.attribute(primitive, &format!("TEXCOORD_{set}"))?.filter(is_whole));
        }
        let colors = self.attribute(primitive, "COLOR_0")?.filter(is_whole);
        let each = || vertices.iter().map(|vertex| *vertex as usize);
        let mut parsed = Parsed { faces: faces(primitive.mode, &corners), ..Parsed::default() };
        parsed.positions =
            each().map(|vertex| DVec3::from(positions.floats::<3>(vertex, 0.0).map(f64::from))).collect();
        if let Some(normals) = normals {
            let finite = |normal: Vec3| if normal.is_finite() { normal } else { Vec3::ZERO };
            parsed.normals = each().map(|vertex| finite(Vec3::from(normals.floats(vertex, 0.0)))).collect();
        }
        // glTF counts v from the top.
        let upright = |[u, v]: [f32; 2]| Vec2::new(u, 1.0 - v);
        for (uvs, all) in sets.iter().zip([&mut parsed.uvs, &mut parsed.second_uvs]) {
            if let Some(uvs) = uvs {
                *all = each().map(|vertex| upright(uvs.floats(vertex, 0.0))).collect();
            }
        }
        if let Some(colors) = colors {
            parsed.colors =
                each().map(|vertex| colors.floats::<3>(vertex, 1.0).map(linear_to_srgb8)).collect();
        }
        Ok(parsed)
    }

    /// An attribute of a primitive.
    pub(super) fn attribute(&self, primitive: &Primitive, name: &str) -> Result<Option<Numbers<'_>>, Wrong> {
        let Some(&number) = primitive.attributes.get(name) else { return Ok(None) };
        Numbers::of(self, number).map(Some).map_err(|wrong| wrong.inside(name))
    }

    /// The two sets of texture coordinates of a primitive's mesh: those that the textures of its material use, the lower one
    /// first. The first two of more; the only one is the first.
    pub(super) fn coordinate_sets(&self, primitive: &Primitive) -> [usize; 2] {
        let material = primitive.material.and_then(|material| self.root.materials.get(material));
        let used = material.map(|material| material.coordinate_sets()).unwrap_or_default();
        let first = used.first().copied().unwrap_or_default();
        match used.iter().find(|set| **set != first) {
            Some(&second) => [first.min(second), first.max(second)],
            None => [first, usize::from(first == 0)],
        }
    }

    /// The vertex of each corner as an index into the list of vertices that is returned too: all, or those that are used if
    /// these are fewer than half.
    fn corners(&self, primitive: &Primitive, vertices: usize) -> Result<(Vec<u32>, Vec<u32>), Wrong> {
        let all = || (0..vertices as u32).collect();
        let Some(number) = primitive.indices else { return Ok((all(), all())) };
        let indices = Numbers::of(self, number).map_err(|wrong| wrong.inside("indices"))?;
        if !indices.are_indices() {
            return Err(Wrong::new("its indices are not whole numbers").inside("indices"));
        }
        let mut corners: Vec<u32> = (0..indices.count).map(|place| indices.index(place)).collect();
        if let Some(wrong) = corners.iter().find(|corner| **corner as usize >= vertices) {
            return Err(Wrong::new(format!("vertex {wrong} is out of range: there are {vertices}, from 0")));
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

/// The triangles of corners in a mode. Corners without a whole triangle are left out.
fn faces(mode: u32, corners: &[u32]) -> Faces {
    let mut faces = Faces::default();
    let mut add = |triangle: [u32; 3]| {
        triangle.iter().for_each(|corner| faces.corner(*corner));
        faces.close(3);
    };
    match mode {
        STRIP => {
            for (place, window) in corners.windows(3).enumerate() {
                let [a, b, c] = [window[0], window[1], window[2]];
                add(if place % 2 == 0 { [a, b, c] } else { [b, a, c] });
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
