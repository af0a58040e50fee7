mod boundaries;
mod degenerate;
mod limits;
mod seams;

use std::collections::BTreeMap;

use super::*;
use crate::assets::expect_rejection;

/// A mesh without attributes.
fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> TriangleMesh {
    let positions = positions.iter().copied().map(Vec3::from_array).collect();
    TriangleMesh { positions, triangles: triangles.to_vec(), ..TriangleMesh::default() }
}

fn try_subdivide(mesh: &TriangleMesh, levels: u32) -> Result<LoadedMesh, AssetError> {
    let loaded = LoadedMesh { mesh: mesh.clone(), ..LoadedMesh::default() };
    subdivide(loaded, levels, Path::new("a.obj"), &CancelToken::new())
}

fn subdivided(mesh: &TriangleMesh, levels: u32) -> TriangleMesh {
    try_subdivide(mesh, levels).expect("a valid mesh").mesh
}

/// A cube with a diagonal on each side, from −1 to 1.
fn cube() -> TriangleMesh {
    let corner = |index: u32| [0, 1, 2].map(|axis| if index >> axis & 1 == 1 { 1.0 } else { -1.0 });
    let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<_> = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let corners: Vec<_> = (0..8).map(corner).collect();
    // The first corners are in the order in which the triangles use them.
    let order = [0, 2, 3, 1, 4, 5, 7, 6];
    let place = |corner: u32| order.iter().position(|known| *known == corner).expect("a corner") as u32;
    let positions: Vec<[f32; 3]> = order.iter().map(|corner| corners[*corner as usize]).collect();
    mesh(&positions, &triangles.iter().map(|corners| corners.map(place)).collect::<Vec<_>>())
}

fn octahedron() -> TriangleMesh {
    let positions = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0., 0.], [0., -1., 0.], [0., 0., -1.]];
    let triangles = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    mesh(&positions, &triangles)
}

/// A grid of `columns` × `rows` squares in the plane z = 0, each split along the same diagonal. `place` moves
/// its points.
fn grid(columns: u32, rows: u32, place: impl Fn([f32; 2]) -> [f32; 3]) -> TriangleMesh {
    let index = |x: u32, y: u32| y * (columns + 1) + x;
    let squares = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
    let triangles: Vec<_> = squares
        .flat_map(|(x, y)| {
            let [a, b, c, d] = [index(x, y), index(x + 1, y), index(x + 1, y + 1), index(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let points = (0..=rows).flat_map(|y| (0..=columns).map(move |x| [x as f32, y as f32]));
    mesh(&points.map(place).collect::<Vec<_>>(), &triangles)
}

/// The neighbors of a vertex in counterclockwise order, found by matching the faces. In an open fan, they
/// start at the boundary.
fn ring(mesh: &TriangleMesh, vertex: u32) -> (Vec<u32>, bool) {
    let mut after = BTreeMap::new();
    for triangle in &mesh.triangles {
        if let Some(corner) = triangle.iter().position(|corner| *corner == vertex) {
            after.insert(triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]);
        }
    }
    let first = after.keys().find(|start| after.values().all(|end| end != *start));
    let is_open = first.is_some();
    let mut all = vec![*first.or(after.keys().next()).expect("a face")];
    while let Some(next) = after.get(&all[all.len() - 1]).filter(|next| **next != all[0]) {
        all.push(*next);
    }
    (all, is_open)
}

/// Number of faces at each edge.
fn edge_faces(mesh: &TriangleMesh) -> BTreeMap<[u32; 2], u32> {
    let mut counts = BTreeMap::new();
    for triangle in &mesh.triangles {
        for corner in 0..3 {
            let [a, b] = [triangle[corner], triangle[(corner + 1) % 3]];
            *counts.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    counts
}

/// Mean of the faces' normals at a vertex, weighted by area.
fn mean_face_normal(mesh: &TriangleMesh, vertex: u32) -> DVec3 {
    let faces = mesh.triangles.iter().filter(|triangle| triangle.contains(&vertex));
    let normal = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
        (b - a).cross(c - a)
    };
    faces.map(normal).sum::<DVec3>().normalize()
}

/// [`mean_face_normal`] of each vertex.
fn mean_face_normals(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|corner| sums[*corner as usize] += normal);
    }
    sums.into_iter().map(DVec3::normalize).collect()
}

#[test]
fn level_zero_changes_nothing() {
    let plain = TriangleMesh { materials: vec![3; 12], normals: vec![Vec3::X; 8], ..cube() };
    assert_eq!(subdivided(&plain, 0), plain);
}

#[test]
fn the_euler_characteristic_is_kept() {
    // A torus of quads around the z axis.
    let (around, across) = (9_u32, 5_u32);
    let at = |i: u32| {
        let [u, v] = [(i / across) as f32 / around as f32, (i % across) as f32 / across as f32];
        let (u, v) = (u * std::f32::consts::TAU, v * std::f32::consts::TAU);
        let radius = 2.0 + v.cos();
        [radius * u.cos(), radius * u.sin(), v.sin()]
    };
    let index = |i: u32, j: u32| i % around * across + j % across;
    let squares = (0..around).flat_map(|i| (0..across).map(move |j| (i, j)));
    let triangles: Vec<_> = squares
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let torus = mesh(&(0..around * across).map(at).collect::<Vec<_>>(), &triangles);
    for (start, characteristic) in [(&torus, 0), (&cube(), 2), (&grid(3, 2, |[x, y]| [x, y, 0.0]), 1)] {
        for levels in 1..=3 {
            let fine = subdivided(start, levels);
            assert_eq!(fine.triangles.len(), start.triangles.len() << (2 * levels));
            let edges = edge_faces(&fine).len() as i64;
            let found = fine.positions.len() as i64 - edges + fine.triangles.len() as i64;
            assert_eq!(found, characteristic, "level {levels}");
        }
    }
}

#[test]
fn results_do_not_depend_on_thread_count() {
    let bumps = grid(60, 40, |[x, y]| [x, y, (x * 0.37).sin() + (y * 0.61).cos()]);
    let mut bumps = TriangleMesh { materials: (0..bumps.triangles.len() as u32).collect(), ..bumps };
    bumps.uvs = bumps.positions.iter().map(|at| at.truncate() * at.z).collect();
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| subdivided(&bumps, 3))
    };
    let fine = with(1);
    assert_eq!(fine, with(3));
    assert!(fine.materials.iter().enumerate().all(|(triangle, of)| *of == triangle as u32 / 64));
    let (token, loaded) = (CancelToken::new(), LoadedMesh { mesh: bumps, ..LoadedMesh::default() });
    token.cancel();
    assert!(matches!(subdivide(loaded, 1, Path::new("a.obj"), &token), Err(AssetError::Canceled(_))));
}

#[test]
fn too_many_triangles_are_rejected_early() {
    // 2²⁷ triangles are the limit. 40,000 triangles at level 6 are more.
    let many = grid(200, 100, |[x, y]| [x, y, 0.0]);
    let (line, message) = expect_rejection(try_subdivide(&many, 6));
    assert_eq!((line, &message), (None, &too_many_triangles_message(40_000, 6, 5)));
    assert!(message.contains("163840000") && message.ends_with("use `subdivide = 5`"), "{message}");
}
