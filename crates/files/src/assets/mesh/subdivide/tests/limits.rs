//! The surface away from boundaries, compared with powers of the subdivision matrix.

use super::*;

type Matrix = Vec<Vec<f64>>;

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let cell = |row: &Vec<f64>, column: usize| row.iter().zip(b).map(|(x, other)| x * other[column]).sum();
    a.iter().map(|row| (0..b[0].len()).map(|column| cell(row, column)).collect()).collect()
}

/// One step of Loop's scheme on a vertex and its ring of `n` neighbors, from the definition of the scheme.
fn subdivision_matrix(n: usize) -> Matrix {
    let alpha = (0.375 + 0.25 * (std::f64::consts::TAU / n as f64).cos()).powi(2) + 0.375;
    let mut matrix = vec![vec![0.0; n + 1]; n + 1];
    matrix[0] = std::iter::once(alpha).chain(std::iter::repeat_n((1.0 - alpha) / n as f64, n)).collect();
    for neighbor in 0..n {
        let row = &mut matrix[neighbor + 1];
        row[0] = 3.0 / 8.0;
        row[neighbor + 1] += 3.0 / 8.0;
        row[(neighbor + 1) % n + 1] += 1.0 / 8.0;
        row[(neighbor + n - 1) % n + 1] += 1.0 / 8.0;
    }
    matrix
}

/// Limit of a vertex: the rows of a high power of the matrix converge to it.
fn limit_from_matrix(mesh: &TriangleMesh, vertex: u32) -> DVec3 {
    let (ring, _) = ring(mesh, vertex);
    let mut power = subdivision_matrix(ring.len());
    for _ in 0..7 {
        power = product(&power, &power);
    }
    let points = std::iter::once(vertex).chain(ring).map(|vertex| mesh.positions[vertex as usize].as_dvec3());
    power[0].iter().zip(points).map(|(weight, point)| *weight * point).sum()
}

#[test]
fn cube_limits_match_powers_of_the_matrix() {
    let cube = cube();
    for levels in 1..=4 {
        let fine = subdivided(&cube, levels);
        for vertex in 0..8 {
            let found = fine.positions[vertex as usize].as_dvec3();
            let expected = limit_from_matrix(&cube, vertex);
            assert!((found - expected).length() < 1e-6, "{levels}, {vertex}: {found} {expected}");
        }
    }
}

/// A closed mesh whose vertices have 3, 4, 5, 12 and 13 faces: a ring, and a point on each side of it.
fn spindle() -> TriangleMesh {
    let count = 12_u32;
    let at = |i: u32| {
        let angle = std::f32::consts::TAU * i as f32 / count as f32;
        [angle.cos() * 1.5, 0.2 * (3.0 * angle).sin(), angle.sin()]
    };
    let mut positions: Vec<_> = (0..count).map(at).collect();
    positions.extend([[0.1, 1.0, 0.0], [0.0, -0.7, 0.2], [1.4, 0.6, 0.3]]);
    let mut triangles: Vec<_> =
        (0..count).flat_map(|i| [[(i + 1) % count, i, count], [i, (i + 1) % count, count + 1]]).collect();
    // Split the first face at a point.
    let [a, b, c] = triangles.remove(0);
    triangles.extend([[a, b, count + 2], [b, c, count + 2], [c, a, count + 2]]);
    mesh(&positions, &triangles)
}

#[test]
fn limits_do_not_depend_on_the_level() {
    for start in [octahedron(), spindle(), cube()] {
        let [coarse, fine] = [1, 4].map(|levels| subdivided(&start, levels));
        for vertex in 0..start.positions.len() {
            assert!((coarse.positions[vertex] - fine.positions[vertex]).length() < 1e-6);
            assert!((coarse.normals[vertex] - fine.normals[vertex]).length() < 1e-5);
        }
        // The middles of edges are vertices of all finer meshes.
        let middles = &coarse.positions[start.positions.len()..];
        let is_vertex = |middle: &Vec3| fine.positions.iter().any(|at| (*at - *middle).length() < 1e-6);
        assert!(middles.iter().all(is_vertex));
    }
}

#[test]
fn normals_match_a_much_finer_mesh() {
    for start in [octahedron(), spindle(), cube()] {
        let [coarse, fine] = [1, 6].map(|levels| subdivided(&start, levels));
        let means = mean_face_normals(&fine);
        for (vertex, expected) in means.iter().enumerate().take(start.positions.len()) {
            let found = coarse.normals[vertex].as_dvec3();
            assert!((found.length() - 1.0).abs() < 1e-6);
            // At a vertex with many faces, the mean converges slowly.
            assert!((found - *expected).length() < 0.02, "{vertex}: {found} {expected}");
        }
        for (vertex, expected) in means.iter().enumerate() {
            let apart = (fine.normals[vertex].as_dvec3() - *expected).length();
            assert!(apart < 0.1, "{vertex}: {apart}");
        }
    }
}

#[test]
fn equal_meshes_in_all_splits_are_identical() {
    let cube = cube();
    let whole = subdivided(&cube, 2);
    // Each face has its own vertices, as in STL, in files with normals, and in files that repeat positions.
    let positions: Vec<_> =
        cube.triangles.as_flattened().iter().map(|vertex| cube.positions[*vertex as usize]).collect();
    let triangles: Vec<_> = (0..12).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    let normals = positions.iter().map(|at| at.normalize()).collect();
    let split = TriangleMesh { positions, triangles, normals, ..TriangleMesh::default() };
    assert_eq!(subdivided(&split, 2), whole);
}
