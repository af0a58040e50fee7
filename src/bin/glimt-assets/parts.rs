//! Building blocks for furniture: boxes, solids of revolution, tubes and balls. All are closed and face
//! outward.

use super::shapes::icosphere_with_radii;
use super::surface::PolygonMesh;
use super::vector::{Vector, add, cross, dot, scale, sin_cos_turns, subtract, unit};

/// Joins several solids into one surface.
pub(crate) fn join(parts: impl IntoIterator<Item = PolygonMesh>) -> PolygonMesh {
    let mut whole = PolygonMesh::default();
    for part in parts {
        let base = whole.positions.len() as u32;
        whole.positions.extend(part.positions);
        whole.faces.extend(part.faces.into_iter().map(|face| face.into_iter().map(|v| v + base).collect()));
    }
    whole
}

/// Translates a surface.
pub(crate) fn translate_mesh(surface: PolygonMesh, by: Vector) -> PolygonMesh {
    map_positions(surface, |position| add(position, by))
}

fn map_positions(surface: PolygonMesh, map: impl Fn(Vector) -> Vector) -> PolygonMesh {
    PolygonMesh { positions: surface.positions.into_iter().map(map).collect(), ..surface }
}

/// A box between two corners with edges beveled by `edge`.
pub(crate) fn beveled_box(from: Vector, to: Vector, edge: f64) -> PolygonMesh {
    let (middle, half) = (scale(add(from, to), 0.5), scale(subtract(to, from), 0.5));
    let sign = |corner: u32, axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
    // Use three vertices per corner, one for each adjacent side.
    let mut positions = Vec::new();
    for (corner, side) in (0..8).flat_map(|corner| (0..3).map(move |side| (corner, side))) {
        let reach = |axis: usize| half[axis] - if axis == side { 0.0 } else { edge };
        positions.push(add(middle, [0, 1, 2].map(|axis| sign(corner, axis) * reach(axis))));
    }
    let vertex = |corner: u32, side: usize| 3 * corner + side as u32;
    let mut faces: Vec<Vec<u32>> =
        (0..8).map(|corner| (0..3).map(|side| vertex(corner, side)).collect()).collect();
    for axis in 0..3 {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        let corner = |a: u32, b: u32, c: u32| a << axis | b << next | c << last;
        for a in 0..2 {
            // Add the side, and the bevels between the other two axes.
            let around = [(0, 0), (1, 0), (1, 1), (0, 1)];
            faces.push(around.map(|(b, c)| vertex(corner(a, b, c), axis)).to_vec());
            for b in 0..2 {
                let (low, high) = (corner(0, a, b), corner(1, a, b));
                faces.push(vec![
                    vertex(low, next),
                    vertex(high, next),
                    vertex(high, last),
                    vertex(low, last),
                ]);
            }
        }
    }
    orient_outward(positions, faces, middle)
}

/// A hexahedron. `corners` contains the corners of its bottom face in order, then the corresponding corners
/// of its top face.
pub(crate) fn hexahedron(corners: [Vector; 8]) -> PolygonMesh {
    let middle = scale(corners.iter().fold([0.0; 3], |sum, &corner| add(sum, corner)), 0.125);
    let sides = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    // Each side has its own vertices because the edges are sharp.
    let positions = sides.iter().flat_map(|side| side.map(|corner: usize| corners[corner])).collect();
    let faces = (0..6).map(|side| (4 * side..4 * side + 4).collect()).collect();
    orient_outward(positions, faces, middle)
}

/// Creates a convex solid, flipping faces where necessary so that all of them face outward.
fn orient_outward(positions: Vec<Vector>, mut faces: Vec<Vec<u32>>, middle: Vector) -> PolygonMesh {
    for face in &mut faces {
        let [a, b, c] = [0, 1, 2].map(|corner| positions[face[corner] as usize]);
        if dot(cross(subtract(b, a), subtract(c, a)), subtract(a, middle)) < 0.0 {
            face.reverse();
        }
    }
    PolygonMesh { positions, faces, ..PolygonMesh::default() }
}

/// A solid of revolution about y. `outline` contains radii and heights, from the foot along the outside to
/// the top. Radius 0 is on the axis. Two equal points form a sharp edge.
pub(crate) fn solid_of_revolution(outline: &[[f64; 2]], sides: u32) -> PolygonMesh {
    let mut surface = PolygonMesh::default();
    let mut below: Option<(u32, [f64; 2])> = None;
    for &[radius, height] in outline {
        let base = surface.positions.len() as u32;
        let count = if radius == 0.0 { 1 } else { sides };
        surface.positions.extend((0..count).map(|side| {
            let (sin, cos) = sin_cos_turns(f64::from(side) / f64::from(sides));
            [radius * cos, height, radius * sin]
        }));
        if let Some((lower, point)) = below.filter(|(_, point)| *point != [radius, height]) {
            for side in 0..sides {
                let next = (side + 1) % sides;
                let ring = |base: u32, radius: f64, side: u32| if radius == 0.0 { base } else { base + side };
                let mut face = vec![ring(lower, point[0], side), ring(base, radius, side)];
                face.extend((radius != 0.0).then(|| ring(base, radius, next)));
                face.extend((point[0] != 0.0).then(|| ring(lower, point[0], next)));
                surface.faces.push(face);
            }
        }
        below = Some((base, [radius, height]));
    }
    surface
}

/// A round bar that follows a path, closed at both ends.
pub(crate) fn round_bar_along_path(path: &[Vector], radius: f64, sides: u32) -> PolygonMesh {
    let mut surface = PolygonMesh::default();
    let last = path.len() - 1;
    let tangent = |at: usize| unit(subtract(path[(at + 1).min(last)], path[at.saturating_sub(1)]));
    let first = tangent(0);
    let aside = if first[1].abs() < 0.9 { [0.0, 1.0, 0.0] } else { [1.0, 0.0, 0.0] };
    let mut normal = unit(cross(first, aside));
    for (at, &point) in path.iter().enumerate() {
        // Rotate the frame as little as possible along the path.
        let along = tangent(at);
        normal = unit(subtract(normal, scale(along, dot(normal, along))));
        let binormal = cross(along, normal);
        surface.positions.extend((0..sides).map(|side| {
            let (sin, cos) = sin_cos_turns(f64::from(side) / f64::from(sides));
            add(point, add(scale(normal, radius * cos), scale(binormal, radius * sin)))
        }));
    }
    for (ring, side) in (0..last as u32).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
        let (here, next) = (ring * sides + side, ring * sides + (side + 1) % sides);
        surface.faces.push(vec![here, next, next + sides, here + sides]);
    }
    // The ends have their own vertices because their edges are sharp.
    for ring in [0, last as u32] {
        let base = surface.positions.len() as u32;
        let end = (ring * sides) as usize;
        surface.positions.extend_from_within(end..end + sides as usize);
        let around = base..base + sides;
        surface.faces.push(if ring == 0 { around.rev().collect() } else { around.collect() });
    }
    surface
}

/// A ball of 20 · 4^`times` triangles.
pub(crate) fn ball(times: u32, center: Vector, radius: f64) -> PolygonMesh {
    translate_mesh(icosphere_with_radii(times, |_| radius), center)
}
