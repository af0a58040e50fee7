//! Converts a triangle mesh to control points, which determine the shape, and corner attributes such as
//! texture coordinates.

use super::ParallelMapper;
use super::topology::{Fans, NONE, Topology};
use crate::assets::AssetError;
use crate::assets::mesh::coincident::find_coincident_vertex_sets;
use crate::geometry::mesh::TriangleMesh;
use crate::math::color::srgb8_color_to_linear;
use crate::math::{DVec2, DVec3, Vec2};

/// Number of vertices of a fan with which the attributes of a corner are compared. In a fan with more
/// distinct attributes, some edges become unnecessary seams.
const COMPARED: usize = 64;

/// Control points and attributes of a mesh.
pub(super) struct ControlMesh {
    /// Connectivity of the control points.
    pub(super) shape: Topology,
    /// Control points, relative to the mesh's origin.
    pub(super) points: Vec<DVec3>,
    /// Connectivity of the attributes, which has additional boundaries at seams. `None` if it is the same.
    pub(super) seamed: Option<Topology>,
    /// Texture coordinates, or empty.
    pub(super) uvs: Vec<DVec2>,
    /// Second set of texture coordinates, or empty.
    pub(super) second_uvs: Vec<DVec2>,
    /// Linear colors, or empty.
    pub(super) colors: Vec<DVec3>,
    /// Number of edges that are creases because of more than two faces or opposite orientations.
    pub(super) improper_edges: usize,
}

impl ControlMesh {
    /// Welds the vertices of a mesh that coincide. Drops triangles with coincident corners and vertices
    /// without triangles.
    pub(super) fn weld(mesh: &mut TriangleMesh, work: ParallelMapper<'_>) -> Result<Self, AssetError> {
        let (triangles, sources) = weld_triangles(mesh, work)?;
        let points: Vec<DVec3> =
            sources.iter().map(|vertex| mesh.positions[*vertex as usize].as_dvec3()).collect();
        let (mut shape, improper_edges) = Topology::connect(triangles, points.len(), work)?;
        let fans = shape.find_fans();
        shape.classify_vertices(&fans, |_| false);
        work.token.check_pause_and_cancel()?;
        let (corners, sources) = split_fans_by_uv_and_color(mesh, &fans, &shape);
        let is_same = sources.len() == points.len() && improper_edges == 0;
        let seamed = (!is_same).then(|| seamed_topology(&shape, corners, sources.len()));
        let uvs = |all: &[Vec2]| gather_and_convert(all, &sources, |uv: Vec2| uv.as_dvec2());
        Ok(Self {
            uvs: uvs(&mesh.uvs),
            second_uvs: uvs(&mesh.second_uvs),
            colors: gather_and_convert(&mesh.colors, &sources, |color| {
                srgb8_color_to_linear(color).as_dvec3()
            }),
            shape,
            points,
            seamed,
            improper_edges,
        })
    }
}

/// Converts the values of these vertices. An empty list stays empty.
fn gather_and_convert<T: Copy, U>(values: &[T], vertices: &[u32], convert: impl Fn(T) -> U) -> Vec<U> {
    if values.is_empty() {
        return Vec::new();
    }
    vertices.iter().map(|vertex| convert(values[*vertex as usize])).collect()
}

/// Returns the triangles with welded vertices, and the first of the mesh's vertices for each welded vertex,
/// in the order of the corners. This order is independent of how a file splits its vertices. Removes
/// triangles with coincident corners from the mesh.
fn weld_triangles(
    mesh: &mut TriangleMesh,
    work: ParallelMapper<'_>,
) -> Result<(Vec<[u32; 3]>, Vec<u32>), AssetError> {
    let mut first: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for set in find_coincident_vertex_sets(&mesh.positions, work.token)? {
        set.iter().for_each(|vertex| first[*vertex as usize] = set[0]);
    }
    let is_degenerate = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| first[vertex as usize]);
        a == b || b == c || c == a
    };
    let is_kept: Vec<bool> = mesh.triangles.iter().map(|triangle| !is_degenerate(triangle)).collect();
    if is_kept.contains(&false) {
        let mut kept = is_kept.iter();
        mesh.triangles.retain(|_| kept.next() == Some(&true));
        let mut kept = is_kept.iter();
        mesh.materials.retain(|_| kept.next() == Some(&true));
    }
    let (mut numbers, mut sources) = (vec![NONE; first.len()], Vec::new());
    let mut welded = |vertex: u32| {
        let number = &mut numbers[first[vertex as usize] as usize];
        if *number == NONE {
            *number = sources.len() as u32;
            sources.push(vertex);
        }
        *number
    };
    let triangles = mesh.triangles.iter().map(|triangle| triangle.map(&mut welded)).collect();
    Ok((triangles, sources))
}

/// Returns triangles whose corners share a vertex if they are in the same fan and have the same attributes,
/// and one of the mesh's vertices for each.
fn split_fans_by_uv_and_color(
    mesh: &TriangleMesh,
    fans: &Fans,
    shape: &Topology,
) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut corners = vec![[NONE; 3]; mesh.triangles.len()];
    let mut sources: Vec<u32> = Vec::new();
    for fan in &fans.list {
        let first = sources.len();
        shape.walk_fan(fan.start, |half| {
            let (face, corner) = (half as usize / 3, half as usize % 3);
            let vertex = mesh.triangles[face][corner];
            let known = &sources[first..];
            let recent = known.len().saturating_sub(COMPARED);
            let is_same = |other: &u32| has_same_uvs_and_color(mesh, *other, vertex);
            let found = known[recent..].iter().position(is_same).map(|index| first + recent + index);
            corners[face][corner] = found.unwrap_or(sources.len()) as u32;
            if found.is_none() {
                sources.push(vertex);
            }
        });
    }
    (corners, sources)
}

/// Whether two vertices have equal texture coordinates and colors.
fn has_same_uvs_and_color(mesh: &TriangleMesh, a: u32, b: u32) -> bool {
    let (a, b) = (a as usize, b as usize);
    let has_same_uvs = |uvs: &[Vec2]| uvs.is_empty() || uvs[a] == uvs[b];
    let has_same_color = mesh.colors.is_empty() || mesh.colors[a] == mesh.colors[b];
    a == b || has_same_uvs(&mesh.uvs) && has_same_uvs(&mesh.second_uvs) && has_same_color
}

/// Returns the connectivity of the attributes. Where three or more seams, boundaries or creases meet, the
/// attributes stay in place.
fn seamed_topology(shape: &Topology, corners: Vec<[u32; 3]>, vertices: usize) -> Topology {
    let mut seamed = shape.with_replaced_vertices(corners, vertices);
    let mut seams = vec![0_u32; shape.vertex_count()];
    for &half in shape.edge_halves.iter().filter(|half| seamed.twin(**half) == NONE) {
        seams[shape.start_vertex(half) as usize] += 1;
        seams[shape.end_vertex(half) as usize] += 1;
    }
    let fans = seamed.find_fans();
    let starts = seamed.vertex_halves.clone();
    seamed.classify_vertices(&fans, |vertex| {
        let point = shape.start_vertex(starts[vertex as usize]);
        shape.is_corner(point) || seams[point as usize] >= 3
    });
    seamed
}
