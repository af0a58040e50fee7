//! The masks of Loop's scheme (Loop, *Smooth Subdivision Surfaces Based on Triangles*, 1987), with boundaries
//! and creases that are cubic B-splines (Hoppe et al., *Piecewise Smooth Surface Reconstruction*, SIGGRAPH
//! 1994).

use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul};

use super::topology::{NONE, Topology, next_half_edge, previous_half_edge};

/// A value at a vertex that is subdivided: a point, texture coordinates or a color.
pub(super) trait VertexValue:
    Copy + Default + Send + Sync + Add<Output = Self> + Mul<f64, Output = Self>
{
}

impl<T: Copy + Default + Send + Sync + Add<Output = T> + Mul<f64, Output = T>> VertexValue for T {}

/// Weight of each of the `count` neighbors of a vertex in a closed fan, β (Loop, section 3.2).
pub(super) fn neighbor_weight(count: u32) -> f64 {
    if count == 6 {
        return 1.0 / 16.0;
    }
    let n = f64::from(count);
    let center = 0.375 + 0.25 * libm::cos(TAU / n);
    (0.625 - center * center) / n
}

/// Weight of the far end of an edge in a wide fan with this many faces around the near end, whose weight is
/// 3/4 minus this one. Across the boundary, the largest eigenvalue becomes 1/2, as along the boundary
/// (Biermann, Levin and Zorin, *Piecewise Smooth Subdivision Surfaces with Normal Control*, SIGGRAPH 2000,
/// section 3.2).
fn wide_fan_edge_weight(faces: u32) -> f64 {
    0.5 - 0.25 * libm::cos(PI / f64::from(faces))
}

/// Value after one refinement, at a vertex if `index` is below the number of vertices, and otherwise at the
/// middle of an edge.
pub(super) fn refined_value<T: VertexValue>(topology: &Topology, values: &[T], index: usize) -> T {
    match index.checked_sub(topology.vertex_count()) {
        None => refined_vertex_value(topology, values, index as u32),
        Some(edge) => refined_edge_value(topology, values, topology.edge_halves[edge]),
    }
}

fn refined_vertex_value<T: VertexValue>(topology: &Topology, values: &[T], vertex: u32) -> T {
    let value = values[vertex as usize];
    if topology.is_corner(vertex) {
        return value;
    }
    let (mut sum, mut count) = (T::default(), 0);
    let start = topology.vertex_halves[vertex as usize];
    let last = topology.walk_fan(start, |half| {
        sum = sum + values[topology.end_vertex(half) as usize];
        count += 1;
    });
    match last {
        None => {
            let weight = neighbor_weight(count);
            value * (1.0 - f64::from(count) * weight) + sum * weight
        }
        Some(last) => {
            let ends =
                values[topology.end_vertex(start) as usize] + values[topology.start_vertex(last) as usize];
            value * 0.75 + ends * 0.125
        }
    }
}

fn refined_edge_value<T: VertexValue>(topology: &Topology, values: &[T], half: u32) -> T {
    let [a, b] = [topology.start_vertex(half), topology.end_vertex(half)];
    let at = |vertex: u32| values[vertex as usize];
    let twin = topology.twin(half);
    if twin == NONE {
        return (at(a) + at(b)) * 0.5;
    }
    let wings = at(topology.start_vertex(previous_half_edge(half)))
        + at(topology.start_vertex(previous_half_edge(twin)));
    let wide = match (topology.has_wide_fan_at(a), topology.has_wide_fan_at(b)) {
        (true, false) => topology.wide_fan_face_count(half).map(|faces| (a, b, faces)),
        (false, true) => topology.wide_fan_face_count(twin).map(|faces| (b, a, faces)),
        // Only unrefined meshes have an edge between two such vertices. Use Loop's weights there.
        (false, false) | (true, true) => None,
    };
    let ends = match wide {
        None => (at(a) + at(b)) * 0.375,
        Some((near, far, faces)) => {
            let weight = wide_fan_edge_weight(faces);
            at(near) * (0.75 - weight) + at(far) * weight
        }
    };
    ends + wings * 0.125
}

/// Value on the limit surface. `index` is as in [`refined_value`], and `refined` contains the values after
/// the refinement.
pub(super) fn limit_value<T: VertexValue>(topology: &Topology, refined: &[T], index: usize) -> T {
    let value = refined[index];
    let Some(edge) = index.checked_sub(topology.vertex_count()) else {
        return limit_at_vertex(topology, refined, index as u32);
    };
    let half = topology.edge_halves[edge];
    if topology.twin(half) == NONE {
        let ends =
            refined[topology.start_vertex(half) as usize] + refined[topology.end_vertex(half) as usize];
        return value * (2.0 / 3.0) + ends * (1.0 / 6.0);
    }
    let ring = edge_ring(topology, half).map(|vertex| refined[vertex as usize]);
    let sum = ring.into_iter().fold(T::default(), Add::add);
    value * 0.5 + sum * (1.0 / 12.0)
}

fn limit_at_vertex<T: VertexValue>(topology: &Topology, refined: &[T], vertex: u32) -> T {
    let value = refined[vertex as usize];
    if topology.is_corner(vertex) {
        return value;
    }
    let at_middle = |half: u32| refined[topology.vertex_count() + topology.edge_of_half_edge(half) as usize];
    let (mut sum, mut count) = (T::default(), 0);
    let start = topology.vertex_halves[vertex as usize];
    let last = topology.walk_fan(start, |half| {
        sum = sum + at_middle(half);
        count += 1;
    });
    match last {
        None => {
            let own = 3.0 / (8.0 * neighbor_weight(count));
            (value * own + sum) * (1.0 / (own + f64::from(count)))
        }
        Some(last) => value * (2.0 / 3.0) + (at_middle(start) + at_middle(last)) * (1.0 / 6.0),
    }
}

/// The six vertices around the middle of an edge after one refinement, counterclockwise from the end of the
/// half-edge, which has a twin.
pub(super) fn edge_ring(topology: &Topology, half: u32) -> [u32; 6] {
    let (first, twin) = (topology.vertex_count() as u32, topology.twin(half));
    let middle = |half: u32| first + topology.edge_of_half_edge(half);
    let sides = |half: u32| [middle(next_half_edge(half)), middle(previous_half_edge(half))];
    let ([b, c], [d, e]) = (sides(half), sides(twin));
    [topology.end_vertex(half), b, c, topology.start_vertex(half), d, e]
}
