//! Boundaries, creases and corners.

use super::*;

/// Points of an open uniform cubic B-spline at multiples of 1/`steps`. The ends are interpolated: each has a
/// phantom neighbor, the mirror image of the second point.
fn spline(control: &[DVec3], steps: usize) -> Vec<DVec3> {
    let last = control.len() - 1;
    let mut points = vec![2.0 * control[0] - control[1]];
    points.extend_from_slice(control);
    points.push(2.0 * control[last] - control[last - 1]);
    let at = |i: usize| {
        let (piece, t) = ((i / steps).min(last - 1), i as f64 / steps as f64);
        let t = t - piece as f64;
        let weights = [
            (1.0 - t).powi(3),
            3.0 * t.powi(3) - 6.0 * t * t + 4.0,
            -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
            t.powi(3),
        ];
        points[piece..].iter().zip(weights).map(|(point, weight)| *point * weight / 6.0).sum()
    };
    (0..=last * steps).map(at).collect()
}

/// The control points along the boundary of a grid, from one vertex of a single face to the other and back.
fn boundary_of_grid(start: &TriangleMesh, columns: u32, rows: u32) -> [Vec<DVec3>; 2] {
    let index = |x: u32, y: u32| y * (columns + 1) + x;
    // The diagonals connect (0, 0) with (columns, rows), so the other two corners have a single face.
    let lower = (0..=rows).rev().map(|y| index(0, y)).chain((1..=columns).map(|x| index(x, 0)));
    let upper = (0..=rows).map(|y| index(columns, y)).chain((0..columns).rev().map(|x| index(x, rows)));
    let points = |list: Vec<u32>| list.iter().map(|i| start.positions[*i as usize].as_dvec3()).collect();
    [points(lower.collect()), points(upper.collect())]
}

#[test]
fn flat_grids_stay_flat_within_a_spline() {
    let place = |[x, y]: [f32; 2]| [x + 0.2 * (3.0 * y).sin(), y + 0.15 * (2.0 * x * y).cos(), 0.0];
    let start = grid(4, 3, place);
    let fine = subdivided(&start, 3);
    assert!(fine.positions.iter().all(|at| at.z == 0.0));
    assert!(fine.normals.iter().all(|normal| *normal == Vec3::Z));
    // All points of the spline are vertices, and the boundary has no others.
    let curves = boundary_of_grid(&start, 4, 3).map(|control| spline(&control, 8));
    let mut count = 0;
    for point in curves.iter().flat_map(|curve| &curve[1..]) {
        assert!(fine.positions.iter().any(|at| (at.as_dvec3() - *point).length() < 1e-6), "{point}");
        count += 1;
    }
    assert_eq!(edge_faces(&fine).values().filter(|faces| **faces == 1).count(), count);
}

#[test]
fn vertices_of_a_single_face_stay() {
    let triangle = mesh(&[[0., 0., 0.], [1., 0., 0.25], [0., 2., 0.]], &[[0, 1, 2]]);
    let fine = subdivided(&triangle, 4);
    assert_eq!(fine.positions[..3], triangle.positions);
    // Straight edges remain straight.
    let area = |mesh: &TriangleMesh| -> f64 {
        let cross = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
            (b - a).cross(c - a).length()
        };
        mesh.triangles.iter().map(cross).sum()
    };
    assert!((area(&fine) - area(&triangle)).abs() < 1e-6);
}

/// A surface whose rim has a vertex with `faces` faces: a fan around that vertex, with one more row outside.
fn fan(faces: u32) -> TriangleMesh {
    let at = |row: f32, i: u32| {
        let angle = std::f32::consts::PI * i as f32 / faces as f32;
        let [x, y] = [row * angle.cos(), row * angle.sin()];
        [x * 1.3, y, 0.3 * x * x - 0.2 * y * y + 0.2 * x * y + 0.3 * y]
    };
    let mut positions = vec![[0.0, 0.0, 0.1]];
    for row in 1..=2 {
        positions.extend((0..=faces).map(|i| at(row as f32, i)));
    }
    let index = |row: u32, i: u32| 1 + row * (faces + 1) + i;
    let mut triangles: Vec<_> = (0..faces).map(|i| [0, index(0, i), index(0, i + 1)]).collect();
    for i in 0..faces {
        let [a, b] = [index(0, i), index(0, i + 1)];
        let [c, d] = [index(1, i), index(1, i + 1)];
        triangles.extend([[a, c, b], [b, c, d]]);
    }
    mesh(&positions, &triangles)
}

/// Mean face normal around a boundary vertex after many refinements of its ring, from the definition of the
/// scheme. The ring is magnified after each step.
fn normal_after_many_steps(center: DVec3, ring: &[DVec3]) -> DVec3 {
    let faces = ring.len() - 1;
    let is_wide = faces >= 6;
    let far = if is_wide { 0.5 - 0.25 * (std::f64::consts::PI / faces as f64).cos() } else { 0.375 };
    let mut arms: Vec<DVec3> = ring.iter().map(|point| *point - center).collect();
    // In wide fans, other modes decay slowly. In others, the tangent across grows relative to the one along.
    for _ in 0..if is_wide { 600 } else { 150 } {
        let moved = (arms[0] + arms[faces]) / 8.0;
        let refined = |i: usize| match i {
            0 => arms[0] / 2.0,
            i if i == faces => arms[faces] / 2.0,
            i => arms[i] * far + (arms[i - 1] + arms[i + 1]) / 8.0,
        };
        arms = (0..=faces).map(|i| 2.0 * (refined(i) - moved)).collect();
    }
    arms.windows(2).map(|pair| pair[0].cross(pair[1])).sum::<DVec3>().normalize()
}

#[test]
fn boundary_normals_match_many_refinements() {
    for faces in 2..=14 {
        let start = fan(faces);
        let (ring, is_open) = ring(&start, 0);
        assert!(is_open && ring.len() as u32 == faces + 1);
        let at = |vertex: u32| start.positions[vertex as usize].as_dvec3();
        let points: Vec<DVec3> = ring.iter().map(|vertex| at(*vertex)).collect();
        let expected = normal_after_many_steps(at(0), &points);
        let fine = [1, 2, 4, 6].map(|levels| subdivided(&start, levels));
        for fine in &fine {
            let found = fine.normals[0].as_dvec3();
            assert!((found - expected).length() < 1e-5, "{faces}: {found} {expected}");
        }
        // The faces of finer meshes approach the tangent plane, slowly if there are many.
        let errors = fine.map(|fine| (mean_face_normal(&fine, 0) - expected).length());
        assert!(errors.is_sorted_by(|a, b| a > b) && errors[3] < 0.06, "{faces}: {errors:?}");
        // The boundary is tangent to the surface.
        assert!(expected.dot((points[0] - points[faces as usize]).normalize()).abs() < 1e-6, "{faces}");
    }
}

#[test]
fn limits_at_boundaries_do_not_depend_on_the_level() {
    for faces in [1, 2, 3, 5, 9] {
        let start = fan(faces);
        let [coarse, fine] = [2, 5].map(|levels| subdivided(&start, levels));
        for vertex in 0..start.positions.len() {
            assert!((coarse.positions[vertex] - fine.positions[vertex]).length() < 1e-6);
        }
    }
}

#[test]
fn pages_at_a_binding_share_a_crease() {
    // Three pages share the edge between the first two vertices.
    let page = |angle: f32| [angle.cos(), angle.sin(), 0.5];
    let positions =
        [vec![[0., 0., 0.], [0., 0., 1.], [0., 0., 2.]], [0.0, 2.0, 4.0].map(page).to_vec()].concat();
    let triangles = [3, 4, 5].map(|page| [[0, 1, page], [1, 2, page]]).concat();
    let loaded = try_subdivide(&mesh(&positions, &triangles), 3).expect("valid");
    assert_eq!(loaded.warnings, Vec::from_iter(improper_edges_warning(2)));
    assert!(loaded.warnings[0].starts_with("2 edges have") && loaded.warnings[0].contains("face outward"));
    // All pages meet along the binding, which stays straight, and each has its own normals there.
    let on_binding = |at: &&Vec3| at.x.abs() < 1e-7 && at.y.abs() < 1e-7;
    let mut heights: Vec<f32> = loaded.mesh.positions.iter().filter(on_binding).map(|at| at.z).collect();
    heights.sort_by(f32::total_cmp);
    assert_eq!(heights.len(), 3 * 17);
    assert!(heights.chunks(3).all(|same| same[0] == same[2]));
    for page in 0..3 {
        let normals = |page: usize| loaded.mesh.normals[loaded.mesh.triangles[page * 128][0] as usize];
        assert!(normals(page).dot(normals((page + 1) % 3)) < 0.5);
    }
}

#[test]
fn faces_of_opposite_orientation_meet_in_a_crease() {
    let start = grid(2, 1, |[x, y]| [x, y, if x == 1.0 { 0.5 } else { 0.0 }]);
    let mut flipped = start.clone();
    flipped.triangles[2..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
    let loaded = try_subdivide(&flipped, 2).expect("valid");
    assert_eq!(loaded.warnings, Vec::from_iter(improper_edges_warning(1)));
    // On the crease, the normals are on the front side of each face.
    let mesh = &loaded.mesh;
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
        let normal = (b - a).cross(c - a).normalize();
        assert!(triangle.iter().all(|corner| mesh.normals[*corner as usize].dot(normal) > 0.5));
    }
    // Without the flip, the fold is rounded.
    let highest = |mesh: &TriangleMesh| mesh.positions.iter().map(|at| at.z).fold(0.0, f32::max);
    assert!(highest(mesh) > highest(&subdivided(&start, 2)) - 1e-6);
}

#[test]
fn cones_that_touch_at_their_tips_stay_joined() {
    let mut positions = vec![[0.0, 0.0, 0.0]];
    let mut triangles = Vec::new();
    for (side, height) in [(0, 1.0), (1, -1.0)] {
        let first = positions.len() as u32;
        let at = |i: u32| {
            let angle = std::f32::consts::TAU * i as f32 / 5.0;
            [angle.cos(), height, angle.sin()]
        };
        positions.extend((0..5).map(at));
        positions.push([0.0, 2.0 * height, 0.0]);
        for i in 0..5 {
            let [a, b] = [first + i, first + (i + 1) % 5];
            let faces = [[0, a, b], [a, first + 5, b]];
            triangles.extend(faces.map(|[a, b, c]| if side == 0 { [a, b, c] } else { [a, c, b] }));
        }
    }
    let fine = subdivided(&mesh(&positions, &triangles), 2);
    let tips: Vec<usize> = (0..fine.positions.len()).filter(|i| fine.positions[*i] == Vec3::ZERO).collect();
    assert_eq!(tips.len(), 2, "each cone has its own normal");
    assert!(fine.normals[tips[0]].dot(fine.normals[tips[1]]) < -0.9);
}
