//! A bear made of balls and round cones with smooth joints, for `scenes/figure.toml`. It is 0.33 high and
//! sits at the origin.

use super::surface::PolygonMesh;
use super::vector::{Vector, add, dot, mix, scale, subtract, unit};

/// The lattice's corner, cell size, and number of cells along each axis.
const CORNER: Vector = [-0.13, -0.025, -0.1];
const CELL: f64 = 0.0029;
const CELLS: [usize; 3] = [91, 124, 91];

/// Distance below which two parts blend.
const BLEND: f64 = 0.022;

/// The ends and radii of each part. Off-center parts are mirrored.
const PARTS: [[(Vector, f64); 2]; 8] = [
    // Trunk, head, snout.
    [([0.0, 0.068, 0.0], 0.076), ([0.0, 0.165, -0.004], 0.058)],
    [([0.0, 0.255, 0.0], 0.058), ([0.0, 0.262, 0.004], 0.056)],
    [([0.0, 0.242, 0.045], 0.026), ([0.0, 0.24, 0.062], 0.02)],
    // Ear, arm, leg, foot, tail.
    [([0.047, 0.302, -0.004], 0.021), ([0.05, 0.308, -0.004], 0.021)],
    [([0.06, 0.178, 0.01], 0.024), ([0.078, 0.118, 0.068], 0.021)],
    [([0.048, 0.036, 0.03], 0.037), ([0.074, 0.031, 0.1], 0.031)],
    [([0.076, 0.034, 0.112], 0.032), ([0.079, 0.056, 0.12], 0.024)],
    [([0.0, 0.04, -0.07], 0.022), ([0.0, 0.042, -0.076], 0.022)],
];

/// Extracts the zero level set of the distance field with surface nets (Gibson, *Constrained Elastic Surface
/// Nets*, MICCAI 1998). Each cell that the surface crosses has one vertex, which is moved onto the surface.
/// Each lattice edge that the surface crosses has one quad.
pub(crate) fn bear() -> PolygonMesh {
    let inside = inside_flags();
    let [nx, ny, nz] = CELLS;
    let corner = |[x, y, z]: [usize; 3]| inside[(x * (ny + 1) + y) * (nz + 1) + z];
    let mut surface = PolygonMesh::default();
    // Add a vertex in each cell that has corners on both sides of the surface.
    let mut vertices = vec![u32::MAX; nx * ny * nz];
    let cell = |[x, y, z]: [usize; 3]| (x * ny + y) * nz + z;
    for at in all_lattice_indices(CELLS) {
        let corners =
            (0..8).filter(|&c| corner([at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)])).count();
        if corners % 8 != 0 {
            vertices[cell(at)] = surface.positions.len() as u32;
            surface.positions.push(project_onto_surface(lattice_position(at, 0.5)));
        }
    }
    // Add a quad around each edge that crosses the surface, facing outward.
    for (at, axis) in all_lattice_indices(CELLS).flat_map(|at| (0..3).map(move |axis| (at, axis))) {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        if at[next] == 0 || at[last] == 0 {
            continue;
        }
        let mut end = at;
        end[axis] += 1;
        if corner(at) != corner(end) {
            let around = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(back, below)| {
                let mut beside = at;
                beside[next] -= back;
                beside[last] -= below;
                vertices[cell(beside)]
            });
            let mut face = around.to_vec();
            if !corner(at) {
                face.reverse();
            }
            surface.faces.push(face);
        }
    }
    surface
}

/// Returns for each lattice point whether it is inside the bear.
fn inside_flags() -> Vec<bool> {
    all_lattice_indices(CELLS.map(|cells| cells + 1))
        .map(|at| bear_distance(lattice_position(at, 0.0)) < 0.0)
        .collect()
}

/// All points of a lattice, with the last axis varying fastest.
fn all_lattice_indices([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])))
}

/// Position of a lattice point, offset by a fraction of a cell along all axes.
fn lattice_position([x, y, z]: [usize; 3], by: f64) -> Vector {
    add(CORNER, scale([x as f64 + by, y as f64 + by, z as f64 + by], CELL))
}

/// Moves a point onto the surface with Newton steps along the gradient.
fn project_onto_surface(mut point: Vector) -> Vector {
    for _ in 0..6 {
        point = subtract(point, scale(distance_gradient(point), bear_distance(point)));
    }
    point
}

fn distance_gradient(point: Vector) -> Vector {
    const STEP: f64 = 1e-5;
    let slope = |axis: usize| {
        let mut aside = [0.0; 3];
        aside[axis] = STEP;
        bear_distance(add(point, aside)) - bear_distance(subtract(point, aside))
    };
    unit([slope(0), slope(1), slope(2)])
}

/// Approximate signed distance to the bear, negative inside.
fn bear_distance([x, y, z]: Vector) -> f64 {
    // The bear is symmetric.
    let point = [x.abs(), y, z];
    PARTS.iter().map(|ends| round_cone_distance(point, ends)).fold(f64::MAX, |a, b| {
        let near = (BLEND - (a - b).abs()).max(0.0) / BLEND;
        a.min(b) - near * near * BLEND / 4.0
    })
}

/// Distance to a round cone: a ball swept from one end to the other with a changing radius.
fn round_cone_distance(point: Vector, [(from, first), (to, second)]: &[(Vector, f64); 2]) -> f64 {
    let along = subtract(*to, *from);
    let t = (dot(subtract(point, *from), along) / dot(along, along)).clamp(0.0, 1.0);
    let aside = subtract(point, mix(*from, *to, t));
    dot(aside, aside).sqrt() - (first + (second - first) * t)
}
