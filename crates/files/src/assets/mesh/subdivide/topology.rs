//! Connectivity of a triangle mesh, and its refinement. Each refinement splits every triangle into four and
//! derives the new connectivity with index arithmetic, without searching for edges.

use rayon::prelude::*;

use super::ParallelMapper;
use crate::assets::AssetError;

/// Twin of half-edges at boundaries and creases.
pub(super) const NONE: u32 = u32::MAX;

/// Bit of an edge index that is set if the half-edge runs against the edge's direction.
const REVERSED: u32 = 1 << 31;

/// Minimum number of faces in a wide fan. With fewer faces, the ordinary edge masks produce a
/// tangent plane at boundaries.
pub(super) const WIDE: u32 = 6;

/// Connectivity of a triangle mesh. Half-edge 3·f + k starts at corner k of face f and ends at the next
/// corner.
///
/// A *fan* consists of the faces around a vertex that are connected through twins. It is closed or ends at
/// boundaries or creases on both sides.
#[derive(Debug, Default)]
pub(super) struct Topology {
    /// Vertices of each face, which are also the start vertices of its half-edges.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The half-edge in the opposite direction on the neighboring face, or [`NONE`].
    twins: Vec<[u32; 3]>,
    /// Edge of each half-edge, with [`REVERSED`].
    edges: Vec<[u32; 3]>,
    /// One half-edge of each edge.
    pub(super) edge_halves: Vec<u32>,
    /// A half-edge that starts at each vertex. In an open fan, the first one counterclockwise, which has no
    /// twin.
    pub(super) vertex_halves: Vec<u32>,
    /// Whether each vertex of the unrefined mesh stays in place. Empty if all vertices move.
    corners: Vec<bool>,
    /// Whether each vertex of the unrefined mesh is on a boundary or crease and has a fan of at least
    /// [`WIDE`] faces. Empty if there are no such vertices.
    wide: Vec<bool>,
}

/// Returns the next half-edge of the face.
pub(super) fn next_half_edge(half: u32) -> u32 {
    if half % 3 == 2 { half - 2 } else { half + 1 }
}

/// Returns the previous half-edge of the face.
pub(super) fn previous_half_edge(half: u32) -> u32 {
    if half.is_multiple_of(3) { half + 2 } else { half - 1 }
}

fn half_edge_entry(of_faces: &[[u32; 3]], half: u32) -> u32 {
    of_faces[half as usize / 3][half as usize % 3]
}

/// The fans of a mesh.
pub(super) struct Fans {
    /// The fan of each half-edge's start vertex.
    pub(super) of_half: Vec<u32>,
    /// The fans, in the order of their first half-edges.
    pub(super) list: Vec<Fan>,
}

/// A fan of faces around a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fan {
    /// The half-edge at which the fan starts.
    pub(super) start: u32,
    /// Number of faces.
    pub(super) faces: u32,
    /// Last half-edge of an open fan, which ends at the vertex.
    pub(super) last: Option<u32>,
}

impl Topology {
    /// Connects triangles whose corners are distinct. Edges with more than two faces, or with two faces of
    /// opposite orientation, become creases. Also returns the number of such edges.
    pub(super) fn connect(
        triangles: Vec<[u32; 3]>,
        vertices: usize,
        work: ParallelMapper<'_>,
    ) -> Result<(Self, usize), AssetError> {
        let mut halves = work.map_indices(3 * triangles.len(), |half| {
            let (start, end) = (
                half_edge_entry(&triangles, half as u32),
                half_edge_entry(&triangles, next_half_edge(half as u32)),
            );
            (u64::from(start.min(end)) << 32 | u64::from(start.max(end)), half as u32)
        })?;
        halves.par_sort_unstable();
        work.token.check_pause_and_cancel()?;
        let mut topology = Self {
            twins: vec![[NONE; 3]; triangles.len()],
            edges: vec![[NONE; 3]; triangles.len()],
            vertex_halves: vec![NONE; vertices],
            triangles,
            ..Self::default()
        };
        let mut improper = 0;
        for edge in halves.chunk_by(|a, b| a.0 == b.0) {
            let number = topology.edge_halves.len() as u32;
            topology.edge_halves.push(edge[0].1);
            for &(_, half) in edge {
                let is_reversed = topology.start_vertex(half) > topology.end_vertex(half);
                let reversed = if is_reversed { REVERSED } else { 0 };
                topology.edges[half as usize / 3][half as usize % 3] = number | reversed;
            }
            match *edge {
                [_] => {}
                [(_, a), (_, b)] if topology.start_vertex(a) == topology.end_vertex(b) => {
                    topology.twins[a as usize / 3][a as usize % 3] = b;
                    topology.twins[b as usize / 3][b as usize % 3] = a;
                }
                _ => improper += 1,
            }
        }
        Ok((topology, improper))
    }

    /// Returns the connectivity of other vertices at the same corners. Faces remain connected across an edge
    /// if they have the same vertices there.
    pub(super) fn with_replaced_vertices(&self, triangles: Vec<[u32; 3]>, vertices: usize) -> Self {
        let mut other = Self {
            twins: vec![[NONE; 3]; triangles.len()],
            edges: vec![[NONE; 3]; triangles.len()],
            vertex_halves: vec![NONE; vertices],
            triangles,
            ..Self::default()
        };
        for half in 0..3 * other.triangles.len() as u32 {
            let (face, corner, twin) = (half as usize / 3, half as usize % 3, self.twin(half));
            let is_joined = twin != NONE
                && other.start_vertex(half) == other.end_vertex(twin)
                && other.end_vertex(half) == other.start_vertex(twin);
            if is_joined {
                other.twins[face][corner] = twin;
            }
            other.edges[face][corner] = if is_joined && twin < half {
                half_edge_entry(&other.edges, twin) | REVERSED
            } else {
                other.edge_halves.push(half);
                other.edge_halves.len() as u32 - 1
            };
        }
        other
    }

    /// Finds all fans, and the start of one fan for each vertex.
    pub(super) fn find_fans(&mut self) -> Fans {
        let mut fans = Fans { of_half: vec![NONE; 3 * self.triangles.len()], list: Vec::new() };
        for half in 0..3 * self.triangles.len() as u32 {
            if fans.of_half[half as usize] != NONE {
                continue;
            }
            let (number, start) = (fans.list.len() as u32, self.first_half_edge_of_fan(half));
            let mut faces = 0;
            let last = self.walk_fan(start, |half| {
                fans.of_half[half as usize] = number;
                faces += 1;
            });
            fans.list.push(Fan { start, faces, last });
            let known = &mut self.vertex_halves[half_edge_entry(&self.triangles, half) as usize];
            *known = if *known == NONE { start } else { *known };
        }
        fans
    }

    /// Classifies the vertices. `is_fixed` adds vertices that stay in place.
    ///
    /// A vertex moves smoothly if it has a single fan, which is closed. It moves along a boundary or a crease
    /// if each of its fans lies between the same two neighbors. All other vertices are corners, and so are
    /// vertices whose fans have only one face each.
    pub(super) fn classify_vertices(&mut self, fans: &Fans, is_fixed: impl Fn(u32) -> bool) {
        /// The fans of one vertex.
        #[derive(Clone, Copy)]
        struct FansAtVertex {
            ends: Option<[u32; 2]>,
            fans: u32,
            most_faces: u32,
            is_corner: bool,
        }
        let none = FansAtVertex { ends: None, fans: 0, most_faces: 0, is_corner: false };
        let mut seen = vec![none; self.vertex_halves.len()];
        for fan in &fans.list {
            let ends = fan.last.map(|last| {
                let ends = [self.end_vertex(fan.start), self.start_vertex(last)];
                [ends[0].min(ends[1]), ends[0].max(ends[1])]
            });
            let vertex = &mut seen[self.start_vertex(fan.start) as usize];
            let is_same = vertex.fans == 0 || ends.is_some() && ends == vertex.ends;
            vertex.is_corner |= !is_same || ends.is_some_and(|[a, b]| a == b);
            vertex.ends = ends;
            vertex.fans += 1;
            vertex.most_faces = vertex.most_faces.max(fan.faces);
        }
        let corner = |(number, vertex): (usize, &FansAtVertex)| {
            let is_lone = vertex.ends.is_some() && vertex.most_faces == 1;
            vertex.is_corner || is_lone || is_fixed(number as u32)
        };
        let corners: Vec<bool> = seen.iter().enumerate().map(corner).collect();
        let wide = |(vertex, is_corner): (&FansAtVertex, &bool)| {
            vertex.ends.is_some() && vertex.most_faces >= WIDE && !is_corner
        };
        let wide: Vec<bool> = seen.iter().zip(&corners).map(wide).collect();
        self.corners = if corners.contains(&true) { corners } else { Vec::new() };
        self.wide = if wide.contains(&true) { wide } else { Vec::new() };
    }

    /// Number of vertices.
    pub(super) fn vertex_count(&self) -> usize {
        self.vertex_halves.len()
    }

    /// Number of edges.
    pub(super) fn edge_count(&self) -> usize {
        self.edge_halves.len()
    }

    /// Start vertex of a half-edge.
    pub(super) fn start_vertex(&self, half: u32) -> u32 {
        half_edge_entry(&self.triangles, half)
    }

    /// End vertex of a half-edge.
    pub(super) fn end_vertex(&self, half: u32) -> u32 {
        half_edge_entry(&self.triangles, next_half_edge(half))
    }

    /// Twin of a half-edge, or [`NONE`].
    pub(super) fn twin(&self, half: u32) -> u32 {
        half_edge_entry(&self.twins, half)
    }

    /// Edge of a half-edge.
    pub(super) fn edge_of_half_edge(&self, half: u32) -> u32 {
        half_edge_entry(&self.edges, half) & !REVERSED
    }

    /// Whether a vertex stays in place.
    pub(super) fn is_corner(&self, vertex: u32) -> bool {
        self.corners.get(vertex as usize).copied().unwrap_or(false)
    }

    /// Whether a vertex on a boundary or crease has a large fan of faces, whose inner edges need special
    /// masks.
    pub(super) fn has_wide_fan_at(&self, vertex: u32) -> bool {
        self.wide.get(vertex as usize).copied().unwrap_or(false)
    }

    /// Visits the half-edges that start at the vertex, counterclockwise from `start`. If the fan is open,
    /// returns its last half-edge, which ends at the vertex.
    pub(super) fn walk_fan(&self, start: u32, mut visit: impl FnMut(u32)) -> Option<u32> {
        let mut half = start;
        loop {
            visit(half);
            let last = previous_half_edge(half);
            half = self.twin(last);
            if half == NONE {
                return Some(last);
            }
            if half == start {
                return None;
            }
        }
    }

    /// Returns the first half-edge of the fan that contains `half`, or `half` if the fan is closed.
    pub(super) fn first_half_edge_of_fan(&self, half: u32) -> u32 {
        let mut first = half;
        loop {
            let twin = self.twin(first);
            if twin == NONE {
                return first;
            }
            first = next_half_edge(twin);
            if first == half {
                return half;
            }
        }
    }

    /// If the edge of `half` is in a wide fan at the start of `half`, returns the number of faces in the fan.
    pub(super) fn wide_fan_face_count(&self, half: u32) -> Option<u32> {
        let mut faces = 0;
        let last = self.walk_fan(self.first_half_edge_of_fan(half), |_| faces += 1);
        last.filter(|_| faces >= WIDE).map(|_| faces)
    }

    /// Triangles after splitting each face into four: one at each corner, then the one in the middle. The
    /// index of the new vertex on an edge is the original vertex count plus the edge's index.
    pub(super) fn refined_triangles(&self, work: ParallelMapper<'_>) -> Result<Vec<[u32; 3]>, AssetError> {
        let first = self.vertex_count() as u32;
        let split = work.map_indices(self.triangles.len(), |face| {
            let [a, b, c] = self.triangles[face];
            let [ab, bc, ca] = self.edges[face].map(|edge| first + (edge & !REVERSED));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        })?;
        Ok(split.into_flattened())
    }

    /// Splits each face into four. See [`Topology::refined_triangles`]. The halves of edge e become the edges
    /// 2e and 2e + 1; the edges within faces follow.
    pub(super) fn refined(self, work: ParallelMapper<'_>) -> Result<Self, AssetError> {
        let triangles = self.refined_triangles(work)?;
        let (faces, first) = (self.triangles.len(), 2 * self.edge_count() as u32);
        let twins = work.map_indices(faces, |face| self.twins_of_child_faces(face as u32))?.into_flattened();
        let edges =
            work.map_indices(faces, |face| self.edges_of_child_faces(face as u32, first))?.into_flattened();
        let edge_halves =
            work.map_indices(first as usize + 3 * faces, |edge| match (edge as u32).checked_sub(first) {
                Some(inner) => 3 * child_face(inner / 3, inner % 3) + 1,
                None => {
                    let half = self.edge_halves[edge / 2];
                    let is_at_start =
                        edge as u32 % 2 == u32::from(half_edge_entry(&self.edges, half) & REVERSED != 0);
                    if is_at_start { outgoing_child(half) } else { incoming_child(half) }
                }
            })?;
        let vertex_halves = work.map_indices(self.vertex_count() + self.edge_count(), |vertex| match self
            .vertex_halves
            .get(vertex)
        {
            Some(half) => outgoing_child(*half),
            None => incoming_child(self.edge_halves[vertex - self.vertex_count()]),
        })?;
        let Self { corners, wide, .. } = self;
        Ok(Self { triangles, twins, edges, edge_halves, vertex_halves, corners, wide })
    }

    fn twins_of_child_faces(&self, face: u32) -> [[u32; 3]; 4] {
        let twins = self.twins[face as usize];
        let of_outgoing = |twin| if twin == NONE { NONE } else { incoming_child(twin) };
        let of_incoming = |twin| if twin == NONE { NONE } else { outgoing_child(twin) };
        let middle = 3 * child_face(face, 3);
        let at_corner = |corner: usize| {
            let before = (corner + 2) % 3;
            [of_outgoing(twins[corner]), middle + before as u32, of_incoming(twins[before])]
        };
        let inner = |corner: u32| 3 * child_face(face, corner) + 1;
        [at_corner(0), at_corner(1), at_corner(2), [inner(1), inner(2), inner(0)]]
    }

    fn edges_of_child_faces(&self, face: u32, first_inner: u32) -> [[u32; 3]; 4] {
        let edges = self.edges[face as usize];
        let is_reversed = |edge: u32| u32::from(edge & REVERSED != 0);
        // The shift drops the bit for the direction.
        let at_start = |edge: u32| (edge << 1) + is_reversed(edge);
        let at_end = |edge: u32| (edge << 1) + 1 - is_reversed(edge);
        let inner = |corner: usize| first_inner + 3 * face + corner as u32;
        let at_corner = |corner: usize| {
            [at_start(edges[corner]), inner(corner), at_end(edges[(corner + 2) % 3]) | REVERSED]
        };
        [at_corner(0), at_corner(1), at_corner(2), [inner(1), inner(2), inner(0)].map(|edge| edge | REVERSED)]
    }
}

/// Face that replaces a corner of a face, or its middle (3).
fn child_face(face: u32, corner: u32) -> u32 {
    4 * face + corner
}

/// First half of a half-edge after refinement, which starts at the same vertex.
fn outgoing_child(half: u32) -> u32 {
    3 * child_face(half / 3, half % 3)
}

/// Second half of a half-edge after refinement, which ends at the same vertex.
fn incoming_child(half: u32) -> u32 {
    3 * child_face(half / 3, next_half_edge(half) % 3) + 2
}
