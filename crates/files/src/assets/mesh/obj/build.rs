//! Builds single-index vertices from the statements in an OBJ file.

use std::collections::HashMap;

use super::super::parsed::ParsedMesh;
use super::statements::{CornerIndices, NONE, ParsedObj, Smoothing};
use crate::geometry::mesh::VertexNormalGroup;
use crate::math::{Vec2, Vec3};

/// Consecutive faces with the same material, smoothing group and object.
pub(super) struct FaceRun {
    /// Number of faces.
    pub(super) faces: usize,
    pub(super) material: u32,
    pub(super) smoothing: Smoothing,
    /// Whether the run starts an object, group or material. Such a run shares no vertices with earlier runs.
    pub(super) is_object: bool,
}

/// Adds the faces from all runs. Within an object, every distinct combination of indices becomes a vertex.
pub(super) fn build_vertices_and_faces(statements: &ParsedObj, runs: &[FaceRun], parsed: &mut ParsedMesh) {
    let has = |part: usize| statements.corners.iter().any(|corner| corner[part] != NONE);
    let smooths = |run: &FaceRun| run.faces > 0 && run.smoothing != Smoothing::Unspecified;
    let mut builder = VertexBuilder {
        statements,
        has_uvs: has(1),
        has_normals: has(2),
        has_colors: statements.vertices.has_colors(),
        has_smoothing: runs.iter().any(smooths),
        has_materials: runs.iter().any(|run| run.material != NONE),
        vertices: HashMap::new(),
        normals: HashMap::new(),
        parsed,
        face: 0,
        corner: 0,
    };
    runs.iter().for_each(|run| builder.add_face_run(run));
}

/// Smoothing group of a vertex and, for flat shading, the face number, starting at 1.
type SmoothingTag = (u32, u32);

struct VertexBuilder<'a> {
    statements: &'a ParsedObj,
    has_uvs: bool,
    has_normals: bool,
    has_colors: bool,
    has_smoothing: bool,
    has_materials: bool,
    /// Vertices of the current object.
    vertices: HashMap<(CornerIndices, SmoothingTag), u32>,
    /// Maps a position and smoothing group to a normal index, across all objects.
    normals: HashMap<(u32, u32), u32>,
    parsed: &'a mut ParsedMesh,
    face: usize,
    corner: usize,
}

impl VertexBuilder<'_> {
    fn add_face_run(&mut self, run: &FaceRun) {
        if run.is_object {
            self.vertices.clear();
        }
        for _ in 0..run.faces {
            let arity = self.statements.arities[self.face] as usize;
            self.face += 1;
            for corner in &self.statements.corners[self.corner..self.corner + arity] {
                let vertex = self.find_or_add_vertex(*corner, run.smoothing);
                self.parsed.faces.push_corner(vertex);
            }
            self.parsed.faces.end_face(arity);
            self.corner += arity;
        }
        if self.has_materials {
            self.parsed.face_materials.resize(self.parsed.faces.len(), run.material);
        }
    }

    fn find_or_add_vertex(&mut self, corner: CornerIndices, smoothing: Smoothing) -> u32 {
        let has_normal = corner[2] != NONE;
        let tag = match smoothing {
            Smoothing::Flat if !has_normal => (VertexNormalGroup::FLAT, self.face as u32),
            Smoothing::Group(group) if !has_normal => (group.min(VertexNormalGroup::FLAT - 1), 0),
            Smoothing::Flat | Smoothing::Group(_) | Smoothing::Unspecified => {
                (VertexNormalGroup::BY_ANGLE, 0)
            }
        };
        let next = self.parsed.positions.len() as u32;
        let vertex = *self.vertices.entry((corner, tag)).or_insert(next);
        if vertex == next {
            self.push_new_vertex(corner, tag.0);
        }
        vertex
    }

    fn push_new_vertex(&mut self, corner: CornerIndices, group: u32) {
        let [position, uv, normal] = corner.map(|index| index as usize);
        let ParsedObj { vertices, uvs, normals, .. } = self.statements;
        let index = self.parsed.positions.len() as u32;
        self.parsed.positions.push(vertices.positions[position]);
        if self.has_uvs {
            self.parsed.uvs.push(uvs.get(uv).copied().unwrap_or(Vec2::ZERO));
        }
        if self.has_normals {
            self.parsed.normals.push(normals.get(normal).copied().unwrap_or(Vec3::ZERO));
        }
        if self.has_colors {
            self.parsed.colors.push(vertices.color_of(position));
        }
        if self.has_smoothing {
            let is_shared = group != VertexNormalGroup::FLAT && group != VertexNormalGroup::BY_ANGLE;
            let key = (corner[0], group);
            let normal = if is_shared { *self.normals.entry(key).or_insert(index) } else { index };
            self.parsed.normal_groups.push(VertexNormalGroup { normal, group });
        }
    }
}
