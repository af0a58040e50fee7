//! Meshes that are not surfaces.

use super::*;

fn assert_finite(mesh: &TriangleMesh) {
    assert!(mesh.positions.iter().chain(&mesh.normals).all(|value| value.is_finite()));
    assert!(mesh.normals.iter().all(|normal| normal.is_normalized()));
    assert!(mesh.triangles.as_flattened().iter().all(|vertex| (*vertex as usize) < mesh.positions.len()));
}

#[test]
fn isolated_vertices_are_dropped() {
    let mut start = cube();
    let whole = subdivided(&start, 2);
    start.positions.insert(0, Vec3::splat(f32::NAN));
    start.positions.push(Vec3::splat(9.0));
    start.triangles.as_flattened_mut().iter_mut().for_each(|vertex| *vertex += 1);
    assert_eq!(subdivided(&start, 2), whole);
}

#[test]
fn duplicate_faces_stay_separate() {
    let mut doubled = cube();
    doubled.triangles.extend_from_within(3..4);
    let loaded = try_subdivide(&doubled, 2).expect("valid");
    assert_eq!(loaded.warnings.len(), 1);
    assert!(loaded.warnings[0].starts_with("3 edges have more than two faces"));
    assert_finite(&loaded.mesh);
    let corners = |triangle: usize| loaded.mesh.corners(triangle as u32);
    assert_eq!(
        (0..16).map(|i| corners(3 * 16 + i)).collect::<Vec<_>>(),
        (0..16).map(|i| corners(12 * 16 + i)).collect::<Vec<_>>()
    );
    // A single face, twice.
    let face = mesh(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]], &[[0, 1, 2], [0, 1, 2]]);
    let fine = subdivided(&face, 3);
    assert_finite(&fine);
    assert!(fine.normals.iter().all(|normal| *normal == Vec3::Z));
}

#[test]
fn faces_back_to_back_are_finite() {
    let pillow = mesh(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]], &[[0, 1, 2], [0, 2, 1]]);
    assert_finite(&subdivided(&pillow, 3));
    // Two tetrahedra that share an edge.
    let positions = [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [1., 0., 1.], [-1., 0., 0.], [-1., 0., -1.]];
    let tetrahedron = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d], [a, d, b], [b, d, c]];
    let triangles = [[0, 1, 2, 3], [0, 1, 4, 5]].map(tetrahedron).concat();
    let loaded = try_subdivide(&mesh(&positions, &triangles), 3).expect("valid");
    assert_finite(&loaded.mesh);
    assert_eq!(loaded.warnings.len(), 1);
}

#[test]
fn coincident_corners_are_dropped() {
    let mut start = cube();
    let whole = subdivided(&start, 1);
    start.positions.push(start.positions[0]);
    start.triangles.push([0, 8, 1]);
    let loaded = try_subdivide(&start, 1).expect("valid");
    assert_eq!((loaded.dropped.degenerate, &loaded.mesh), (1, &whole));
    let line = mesh(&[[0., 0., 0.], [0., 0., 0.], [1., 0., 0.]], &[[0, 1, 2]]);
    assert_eq!(expect_rejection(try_subdivide(&line, 2)).1, "no usable face: all faces have zero area");
}

#[test]
fn meshes_far_from_the_origin_keep_their_shape() {
    let start = TriangleMesh { origin: DVec3::new(1e8, -3e7, 5e5), ..cube() };
    let fine = subdivided(&start, 2);
    assert_eq!((fine.origin, &fine.positions), (start.origin, &subdivided(&cube(), 2).positions));
}
