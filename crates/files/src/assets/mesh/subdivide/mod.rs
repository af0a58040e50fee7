//! Loop subdivision. Vertices are moved to their limit positions and get the normals of the limit surface.
//!
//! Vertices at the same position are a single control point, even if their normals or texture coordinates
//! differ. Texture coordinates and colors are subdivided with the same masks. Where they are discontinuous,
//! they have boundaries of their own, which do not affect the shape.
//!
//! All values are sums in a fixed order, computed in `f64`, so they do not depend on the number of threads.

mod masks;
mod normals;
mod topology;
mod weld;

use std::path::Path;

use rayon::prelude::*;

use self::masks::{VertexValue, limit_value, refined_value};
use self::normals::LimitNormalCalculator;
use self::topology::Topology;
use self::weld::ControlMesh;
use super::assemble::{drop_unused_vertices, has_area};
use crate::assets::{AssetError, LoadedMesh};
use crate::control::CancelToken;
use crate::geometry::mesh::TriangleMesh;
use crate::math::color::linear_to_srgb8;
use crate::math::{DVec2, DVec3, Vec2, Vec3};
use crate::system::memory::try_reserve_exact;

/// Approximate peak memory per final triangle with texture coordinates, in bytes.
const BYTES_PER_TRIANGLE: u64 = 80;

/// Number of values between polls of the cancel token.
const BATCH: usize = 1 << 17;

/// Number of triangles after `levels` subdivisions.
pub fn subdivided_triangle_count(triangles: usize, levels: u32) -> u64 {
    (triangles as u64) << (2 * levels)
}

/// Approximate peak memory of a subdivision in bytes.
pub fn subdivision_memory_bytes(triangles: usize, levels: u32) -> u64 {
    subdivided_triangle_count(triangles, levels) * BYTES_PER_TRIANGLE
}

/// Subdivides a mesh `levels` times (at most 6) with Loop's scheme. `path` is the mesh's file, for
/// error messages. Level 0 returns the mesh unchanged.
///
/// Boundaries are cubic B-splines. Edges with more than two faces, or with faces of opposite orientation, are
/// treated like boundaries, with a warning. Vertices where boundaries or such edges meet, and vertices of a
/// single face on a boundary, stay in place. Normals from the file are replaced. Triangle t of the mesh
/// becomes the triangles 4ⁿ·t to 4ⁿ·(t + 1) − 1 for n levels, unless triangles without area are dropped.
///
/// # Errors
/// - [`AssetError::Malformed`] if the result would have more than [`TriangleMesh::MAX_TRIANGLES`] triangles.
/// - [`AssetError::OutOfMemory`] or [`AssetError::Canceled`].
pub fn subdivide(
    mut loaded: LoadedMesh,
    levels: u32,
    path: &Path,
    token: &CancelToken,
) -> Result<LoadedMesh, AssetError> {
    if levels == 0 || loaded.mesh.triangles.is_empty() {
        return Ok(loaded);
    }
    check_triangle_count(loaded.mesh.triangles.len(), levels, path)?;
    let work = ParallelMapper { path, token };
    let before = loaded.mesh.triangles.len();
    let control = ControlMesh::weld(&mut loaded.mesh, work)?;
    loaded.dropped.degenerate += (before - loaded.mesh.triangles.len()) as u64;
    check_has_triangles(&loaded.mesh, path)?;
    loaded.warnings.extend(improper_edges_warning(control.improper_edges));
    let TriangleMesh { origin, materials, .. } = std::mem::take(&mut loaded.mesh);
    let copies = 1 << (2 * levels);
    let materials = work.map_indices(materials.len() * copies, |triangle| materials[triangle / copies])?;
    loaded.mesh = TriangleMesh { origin, materials, ..subdivided_mesh(control, levels, work)? };
    loaded.dropped.degenerate += drop_triangles_without_area(&mut loaded.mesh);
    check_has_triangles(&loaded.mesh, path)?;
    Ok(loaded)
}

fn check_has_triangles(mesh: &TriangleMesh, path: &Path) -> Result<(), AssetError> {
    if !mesh.triangles.is_empty() {
        return Ok(());
    }
    Err(AssetError::malformed(path, None, "no usable face: all faces have zero area"))
}

/// Rejects a subdivision with too many triangles.
fn check_triangle_count(triangles: usize, levels: u32, path: &Path) -> Result<(), AssetError> {
    let most = u64::from(TriangleMesh::MAX_TRIANGLES);
    if subdivided_triangle_count(triangles, levels) <= most {
        return Ok(());
    }
    let possible = (0..levels).rev().find(|levels| subdivided_triangle_count(triangles, *levels) <= most);
    Err(AssetError::malformed(
        path,
        None,
        too_many_triangles_message(triangles, levels, possible.unwrap_or(0)),
    ))
}

/// Error message for a subdivision with too many triangles. `possible` is the highest level without an error.
fn too_many_triangles_message(triangles: usize, levels: u32, possible: u32) -> String {
    let (count, most) = (subdivided_triangle_count(triangles, levels), TriangleMesh::MAX_TRIANGLES);
    format!(
        "`subdivide = {levels}` turns {triangles} triangles into {count}; the limit is {most}; use `subdivide = {possible}`"
    )
}

/// Warning about edges that become creases, or `None` if there are none.
fn improper_edges_warning(count: usize) -> Option<String> {
    let (edges, have) = if count == 1 { ("edge", "has") } else { ("edges", "have") };
    (count > 0).then(|| {
        format!(
            "{count} {edges} {have} more than two faces, or faces that face opposite sides, and are subdivided as \
             creases; remove duplicate and inner faces, and make all faces face outward"
        )
    })
}

/// Subdivides a control mesh. The result has no materials.
fn subdivided_mesh(
    control: ControlMesh,
    levels: u32,
    work: ParallelMapper<'_>,
) -> Result<TriangleMesh, AssetError> {
    let ControlMesh { mut shape, mut points, mut seamed, mut uvs, mut second_uvs, mut colors, .. } = control;
    for level in 1..=levels {
        let attributes = seamed.as_ref().unwrap_or(&shape);
        points = refine_values(&shape, &points, work)?;
        uvs = refine_values(attributes, &uvs, work)?;
        second_uvs = refine_values(attributes, &second_uvs, work)?;
        colors = refine_values(attributes, &colors, work)?;
        if level < levels {
            shape = shape.refined(work)?;
            seamed = seamed.map(|seamed| seamed.refined(work)).transpose()?;
        }
    }
    let attributes = seamed.as_ref().unwrap_or(&shape);
    let uv = |uv: DVec2| uv.as_vec2();
    let uvs: Vec<Vec2> = converted_limit_values(attributes, &uvs, uv, work)?;
    let second_uvs: Vec<Vec2> = converted_limit_values(attributes, &second_uvs, uv, work)?;
    let color = |color: DVec3| color.as_vec3().to_array().map(linear_to_srgb8);
    let colors = converted_limit_values(attributes, &colors, color, work)?;
    let triangles = attributes.refined_triangles(work)?;
    let (positions, normals) = limit_positions_and_normals(&shape, &points, attributes, work)?;
    Ok(TriangleMesh { positions, normals, uvs, second_uvs, colors, triangles, ..TriangleMesh::default() })
}

/// Values after one refinement. An empty list stays empty.
fn refine_values<T: VertexValue>(
    topology: &Topology,
    values: &[T],
    work: ParallelMapper<'_>,
) -> Result<Vec<T>, AssetError> {
    if values.is_empty() {
        return Ok(Vec::new());
    }
    work.map_indices(topology.vertex_count() + topology.edge_count(), |index| {
        refined_value(topology, values, index)
    })
}

/// Converted values on the limit surface, from the values after the last refinement. An empty list stays
/// empty.
fn converted_limit_values<T: VertexValue, U: Send>(
    topology: &Topology,
    refined: &[T],
    convert: impl Fn(T) -> U + Sync,
    work: ParallelMapper<'_>,
) -> Result<Vec<U>, AssetError> {
    work.map_indices(refined.len(), |index| convert(limit_value(topology, refined, index)))
}

/// Positions and normals on the limit surface for each vertex of the attributes' connectivity.
fn limit_positions_and_normals(
    shape: &Topology,
    points: &[DVec3],
    attributes: &Topology,
    work: ParallelMapper<'_>,
) -> Result<(Vec<Vec3>, Vec<Vec3>), AssetError> {
    let limit_normals = LimitNormalCalculator::new(shape, points);
    let place = |vertex: usize| match vertex.checked_sub(attributes.vertex_count()) {
        None => RefinedVertexLocation::Vertex(attributes.vertex_halves[vertex]),
        Some(edge) => RefinedVertexLocation::Edge(attributes.edge_halves[edge]),
    };
    let count = attributes.vertex_count() + attributes.edge_count();
    let positions = work.map_indices(count, |vertex| {
        let index = match place(vertex) {
            RefinedVertexLocation::Vertex(half) => shape.start_vertex(half) as usize,
            RefinedVertexLocation::Edge(half) => {
                shape.vertex_count() + shape.edge_of_half_edge(half) as usize
            }
        };
        limit_value(shape, points, index).as_vec3()
    })?;
    let normals = work.map_indices_with_buffer(count, |vertex, arms| match place(vertex) {
        RefinedVertexLocation::Vertex(half) => limit_normals.normal_at_vertex(half, arms),
        RefinedVertexLocation::Edge(half) => limit_normals.normal_at_edge(half),
    })?;
    Ok((positions, normals))
}

/// Location of a vertex in the connectivity before the last refinement.
enum RefinedVertexLocation {
    /// At the start of this half-edge.
    Vertex(u32),
    /// At the middle of this half-edge's edge.
    Edge(u32),
}

/// Drops triangles that have no area after rounding. Returns how many were dropped.
fn drop_triangles_without_area(mesh: &mut TriangleMesh) -> u64 {
    let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);
    let is_kept = |triangle: &[u32; 3]| has_area(corners(triangle));
    if mesh.triangles.par_iter().all(is_kept) {
        return 0;
    }
    let kept: Vec<bool> = mesh.triangles.iter().map(is_kept).collect();
    let mut each = kept.iter();
    mesh.triangles.retain(|_| each.next() == Some(&true));
    let mut each = kept.iter();
    mesh.materials.retain(|_| each.next() == Some(&true));
    drop_unused_vertices(mesh);
    (kept.len() - mesh.triangles.len()) as u64
}

/// Computes long lists in parallel, in batches between which it can be canceled.
#[derive(Clone, Copy)]
struct ParallelMapper<'a> {
    /// The mesh file, for error messages.
    path: &'a Path,
    token: &'a CancelToken,
}

impl ParallelMapper<'_> {
    /// Returns a list of `count` values.
    fn map_indices<T: Send>(
        self,
        count: usize,
        value: impl Fn(usize) -> T + Sync,
    ) -> Result<Vec<T>, AssetError> {
        self.map_indices_with_buffer(count, |index, _: &mut Vec<()>| value(index))
    }

    /// Returns a list of `count` values, whose computation uses a buffer.
    fn map_indices_with_buffer<T: Send, B: Send>(
        self,
        count: usize,
        value: impl Fn(usize, &mut Vec<B>) -> T + Sync,
    ) -> Result<Vec<T>, AssetError> {
        let mut values = Vec::new();
        let bytes = count * size_of::<T>();
        try_reserve_exact(&mut values, count)
            .map_err(|_| AssetError::OutOfMemory { path: self.path.to_owned(), bytes })?;
        for start in (0..count).step_by(BATCH) {
            self.token.check_pause_and_cancel()?;
            let batch = (start..count.min(start + BATCH)).into_par_iter().with_min_len(1 << 9);
            values.par_extend(batch.map_init(Vec::new, |buffer, index| value(index, buffer)));
        }
        Ok(values)
    }
}

#[cfg(test)]
mod tests;
