//! Meshes of single objects: a coral, a globe, a rope, a knot, a vase and a dodecahedron.

use std::collections::HashMap;

use super::noise::{fractal_noise, value_noise};
use super::surface::{PolygonMesh, icosahedron, sphere_midpoint};
use super::vector::{Vector, add, cross, dot, scale, sin_cos_turns, smoothstep, subtract, unit};

/// A coral: a round lump with branching ridges and 81,920 triangles.
pub(crate) fn coral() -> PolygonMesh {
    icosphere_with_radii(6, |direction| {
        let ridge = 1.0 - (2.0 * fractal_noise(scale(direction, 2.6), 3, 0, 7) - 1.0).abs();
        0.72 + 0.34 * smoothstep(0.62, 1.0, ridge) + 0.05 * fractal_noise(scale(direction, 14.0), 2, 0, 21)
    })
}

/// Number of subdivisions of the globe in `million.ply`.
pub(crate) const GLOBE_SUBDIVISIONS: u32 = 8;

/// A mountainous globe with 20 · 4^`times` triangles.
pub(crate) fn mountainous_globe(times: u32) -> PolygonMesh {
    icosphere_with_radii(times, |direction| {
        let height = fractal_noise(scale(direction, 2.0), 8, 0, 3);
        let crater = value_noise(scale(direction, 9.0), 0, 11);
        0.82 + 0.42 * height - 0.05 * smoothstep(0.68, 0.8, crater)
    })
}

/// Three strands twisted along a knot: 36,864 triangles.
pub(crate) fn trefoil_knot_rope() -> PolygonMesh {
    let mut whole = PolygonMesh::default();
    for strand in 0..3 {
        let phase = f64::from(strand) / 3.0;
        let middle = |s: f64| {
            let (center, normal, binormal) = tube_center_normal_binormal(s, trefoil_point);
            let (sin, cos) = sin_cos_turns(phase + 22.0 * s);
            add(center, add(scale(normal, 0.085 * cos), scale(binormal, 0.085 * sin)))
        };
        let tube = weld_grid_seams(
            PolygonMesh::parametric_grid(512, 12, [1.0, 1.0], |s, t| tube_point(s, t, 0.082, middle)),
            512,
            12,
        );
        let base = whole.positions.len() as u32;
        whole.positions.extend(tube.positions);
        whole.faces.extend(tube.faces.into_iter().map(|face| face.into_iter().map(|v| v + base).collect()));
    }
    whole
}

/// A tube along a trefoil knot. The texture repeats 24 times along the tube and twice around it.
pub(crate) fn trefoil_knot_tube() -> PolygonMesh {
    PolygonMesh::parametric_grid(224, 24, [24.0, 2.0], |s, t| tube_point(s, t, 0.24, trefoil_point))
}

/// A hollow vase, a surface of revolution about y, 1.6 high.
pub(crate) fn vase() -> PolygonMesh {
    PolygonMesh::parametric_grid(64, 64, [4.0, 4.0], |s, t| {
        let [radius, height] = vase_profile_point(t);
        let (sin, cos) = sin_cos_turns(s);
        [radius * cos, height, radius * sin]
    })
}

/// Radius and height along the vase's profile, a Catmull–Rom spline from the center of the foot over the lip
/// to the center of the interior.
fn vase_profile_point(t: f64) -> [f64; 2] {
    const KNOTS: [[f64; 2]; 16] = [
        [0.0, 0.0],
        [0.2, 0.0],
        [0.32, 0.01],
        [0.4, 0.08],
        [0.56, 0.4],
        [0.52, 0.8],
        [0.3, 1.15],
        [0.24, 1.35],
        [0.36, 1.58],
        [0.34, 1.6],
        [0.2, 1.35],
        [0.26, 1.15],
        [0.47, 0.8],
        [0.5, 0.4],
        [0.3, 0.1],
        [0.0, 0.06],
    ];
    let last = KNOTS.len() - 1;
    let place = (t * last as f64).clamp(0.0, last as f64);
    let index = (place.floor() as usize).min(last - 1);
    let x = place - index as f64;
    let knot = |offset: usize| KNOTS[(index + offset).saturating_sub(1).min(last)];
    let blend = |axis: usize| {
        let [a, b, c, d] = [knot(0)[axis], knot(1)[axis], knot(2)[axis], knot(3)[axis]];
        b + 0.5 * x * (c - a + x * (2.0 * a - 5.0 * b + 4.0 * c - d + x * (3.0 * (b - c) + d - a)))
    };
    // The ends must be exactly on the axis.
    let radius = if place == 0.0 || place == last as f64 { 0.0 } else { blend(0).max(0.0) };
    [radius, blend(1)]
}

/// A dodecahedron: the dual of the icosahedron, with a pentagon around each of its vertices.
pub(crate) fn dodecahedron() -> PolygonMesh {
    let (corners, triangles) = icosahedron();
    let center = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|corner| corners[corner as usize]);
        unit(add(a, add(b, c)))
    };
    let positions = triangles.iter().map(center).collect();
    let faces =
        (0..corners.len() as u32).map(|corner| incident_triangles_in_order(corner, &triangles)).collect();
    PolygonMesh { positions, faces, ..PolygonMesh::default() }
}

/// The triangles around a corner, in order. The last edge of each triangle is the first edge of the next.
fn incident_triangles_in_order(corner: u32, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut next = HashMap::new();
    for (index, triangle) in triangles.iter().enumerate() {
        if let Some(place) = triangle.iter().position(|&other| other == corner) {
            next.insert(triangle[(place + 1) % 3], (triangle[(place + 2) % 3], index as u32));
        }
    }
    let start = next.keys().min().copied().unwrap_or(0);
    let mut ring = Vec::new();
    let mut at = start;
    while let Some(&(to, triangle)) = next.get(&at) {
        ring.push(triangle);
        at = to;
        if at == start {
            break;
        }
    }
    ring
}

/// An icosahedron subdivided `times` times. `radius` returns a vertex's distance from the center, given its
/// direction.
pub(crate) fn icosphere_with_radii(times: u32, radius: impl Fn(Vector) -> f64) -> PolygonMesh {
    let (mut corners, mut triangles) = icosahedron();
    for _ in 0..times {
        let mut middles = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut middle = |from: u32, to: u32| {
                *middles.entry((from.min(to), from.max(to))).or_insert_with(|| {
                    corners.push(sphere_midpoint(
                        corners[from.min(to) as usize],
                        corners[from.max(to) as usize],
                    ));
                    corners.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    PolygonMesh {
        positions: corners.into_iter().map(|direction| scale(direction, radius(direction))).collect(),
        faces: triangles.into_iter().map(|triangle| triangle.to_vec()).collect(),
        ..PolygonMesh::default()
    }
}

/// A trefoil knot within a radius of about 1. It winds twice around the y axis and three times around the
/// circle of radius 0.66 in the plane y = 0.
fn trefoil_point(s: f64) -> Vector {
    let (sin2, cos2) = sin_cos_turns(2.0 * s);
    let (sin3, cos3) = sin_cos_turns(3.0 * s);
    let radius = 0.66 + 0.3 * cos3;
    [radius * cos2, 0.36 * sin3, radius * sin2]
}

/// A point on a closed curve, and two directions perpendicular to the curve that are periodic along it. The
/// first points away from the circle that the knot winds around.
fn tube_center_normal_binormal(s: f64, curve: impl Fn(f64) -> Vector) -> (Vector, Vector, Vector) {
    let center = curve(s);
    let tangent = unit(subtract(curve(s + 1e-4), curve(s - 1e-4)));
    let (sin, cos) = sin_cos_turns(2.0 * s);
    let away = subtract(center, [0.66 * cos, 0.0, 0.66 * sin]);
    let normal = unit(subtract(away, scale(tangent, dot(away, tangent))));
    (center, normal, cross(tangent, normal))
}

/// A point on a tube of radius `radius` around a closed curve.
fn tube_point(s: f64, t: f64, radius: f64, curve: impl Fn(f64) -> Vector) -> Vector {
    let (center, normal, binormal) = tube_center_normal_binormal(s, curve);
    let (sin, cos) = sin_cos_turns(t);
    add(center, add(scale(normal, radius * cos), scale(binormal, radius * sin)))
}

/// Closes a grid in both directions by merging its seam vertices.
fn weld_grid_seams(grid: PolygonMesh, columns: u32, rows: u32) -> PolygonMesh {
    let welded = |vertex: u32| {
        let (column, row) = (vertex / (rows + 1), vertex % (rows + 1));
        (column % columns) * rows + row % rows
    };
    let kept = (0..columns).flat_map(|column| (0..rows).map(move |row| column * (rows + 1) + row));
    PolygonMesh {
        positions: kept.map(|vertex| grid.positions[vertex as usize]).collect(),
        faces: grid.faces.into_iter().map(|face| face.into_iter().map(welded).collect()).collect(),
        ..PolygonMesh::default()
    }
}
