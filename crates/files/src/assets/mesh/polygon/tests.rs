use super::*;
use crate::math::random::TestRandom;

pub(crate) type Points = Vec<(f32, f32)>;

/// Triangulates a polygon in two planes, checks both triangulations, and returns the one in the plane y = 7.
fn cut(points: &[(f32, f32)]) -> Vec<[usize; 3]> {
    let upright: Vec<Vec3> = points.iter().map(|&(x, y)| Vec3::new(x, 7.0, -y)).collect();
    let triangles = covering(&upright, points);
    let tilted: Vec<Vec3> = points.iter().map(|&(x, y)| Vec3::new(x, y, x + 0.5 * y)).collect();
    covering(&tilted, points);
    triangles
}

/// Triangulates a polygon and checks that the triangles have its orientation and total area.
fn covering(space: &[Vec3], points: &[(f32, f32)]) -> Vec<[usize; 3]> {
    let mut triangles = Vec::new();
    assert!(triangulate(space, |triangle| triangles.push(triangle)), "{} corners", points.len());
    let total = area(points, &(0..points.len()).collect::<Vec<_>>());
    let areas: Vec<f64> = triangles.iter().map(|triangle| area(points, triangle)).collect();
    assert!(areas.iter().all(|area| area * total >= 0.0), "a triangle is flipped");
    let sum: f64 = areas.iter().sum();
    assert!((sum - total).abs() <= 1e-9 * total.abs(), "{sum} of {total}");
    triangles
}

/// Twice the signed area that the corners enclose (the shoelace formula).
pub(crate) fn area(points: &[(f32, f32)], corners: &[usize]) -> f64 {
    let at = |index: usize| {
        let (x, y) = points[corners[index % corners.len()]];
        DVec2::new(f64::from(x), f64::from(y))
    };
    (0..corners.len()).map(|index| at(index).perp_dot(at(index + 1))).sum()
}

/// Number of triangles that contain a point in their interior.
pub(crate) fn layers(points: &[(f32, f32)], triangles: &[[usize; 3]], x: f64, y: f64) -> usize {
    let at = |corner: usize| DVec2::new(f64::from(points[corner].0), f64::from(points[corner].1));
    let holds = |triangle: &&[usize; 3]| {
        let [a, b, c] = triangle.map(at);
        if x < a.x.min(b.x).min(c.x) || x > a.x.max(b.x).max(c.x) {
            return false;
        }
        let p = DVec2::new(x, y);
        let turns = [
            tree::twice_signed_area(a, b, p),
            tree::twice_signed_area(b, c, p),
            tree::twice_signed_area(c, a, p),
        ];
        turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0)
    };
    triangles.iter().filter(holds).count()
}

pub(crate) fn reversed(points: &[(f32, f32)]) -> Points {
    points.iter().rev().copied().collect()
}

#[test]
fn darts_are_cut_along_the_inner_diagonal() {
    let dart = [(0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0)];
    assert_eq!(cut(&dart), [[0, 1, 2], [0, 2, 3]]);
    let turned = [(4.0, 0.0), (1.0, 1.0), (0.0, 4.0), (0.0, 0.0)];
    assert_eq!(cut(&turned), [[0, 1, 3], [1, 2, 3]]);
}

/// A comb whose teeth point up.
fn comb(teeth: usize) -> Points {
    let tooth = |tooth: usize| {
        let x = (teeth - tooth) as f32;
        [(x, 0.25), (x - 0.25, 4.0), (x - 0.5, 0.25)]
    };
    let back = [(0.0, 0.0), (teeth as f32, 0.0)];
    back.into_iter().chain((0..teeth).flat_map(tooth)).chain([(0.0, 0.25)]).collect()
}

#[test]
fn combs_are_covered_exactly_once() {
    for teeth in [3, 300, 350, 3000] {
        let points = comb(teeth);
        assert_eq!(cut(&points).len(), points.len() - 2);
        let backwards = reversed(&points);
        let triangles = cut(&backwards);
        assert_eq!(layers(&backwards, &triangles, 0.25, 3.0), 0, "the point is between two teeth");
        assert_eq!(layers(&backwards, &triangles, 0.74, 2.0), 1, "the point is in a tooth");
    }
}

#[test]
fn work_per_corner_is_nearly_constant() {
    // The corners of gears, spirals, coastlines and combs block each other.
    let visits = |points: &[(f32, f32)]| {
        let plane: Vec<DVec2> = points.iter().map(|&(x, y)| DVec2::new(x.into(), y.into())).collect();
        let (is_simple, visits) = ears::clip_ears_and_count_visits(&plane);
        assert!(is_simple, "{} corners", points.len());
        visits / points.len() as u64
    };
    for shape in [gear, spiral, coast, comb] {
        let few = visits(&shape(500));
        let many = visits(&shape(5000));
        assert!(many < 4 * few + 100, "visits per corner increased from {few} to {many}");
    }
}

/// A star-shaped outline, in counterclockwise order.
fn around(corners: usize, radius: impl Fn(usize) -> f64) -> Points {
    let corner = |index: usize| {
        let (sin, cos) = (std::f64::consts::TAU * index as f64 / corners as f64).sin_cos();
        ((radius(index) * cos) as f32, (radius(index) * sin) as f32)
    };
    (0..corners).map(corner).collect()
}

fn gear(teeth: usize) -> Points {
    around(4 * teeth, |index| if index / 2 % 2 == 0 { 10.0 } else { 9.0 })
}

fn coast(corners: usize) -> Points {
    let mut random = TestRandom::new(5);
    let radii: Vec<f64> = (0..corners).map(|_| 5.0 + random.unit()).collect();
    around(corners, |index| radii[index])
}

/// A spiral band with twenty turns.
fn spiral(steps: usize) -> Points {
    let side = |offset: f64| {
        move |step: usize| {
            let t = step as f64 / steps as f64;
            let (sin, cos) = (std::f64::consts::TAU * 20.0 * t).sin_cos();
            let radius = 30.0 - 25.0 * t - offset;
            ((radius * cos) as f32, (radius * sin) as f32)
        }
    };
    (0..steps).map(side(0.0)).chain((0..steps).rev().map(side(0.5))).collect()
}

#[test]
fn smooth_outlines_are_not_triangulated_as_fans() {
    let triangles = cut(&coast(1000));
    let mut uses = vec![0; 1000];
    triangles.as_flattened().iter().for_each(|corner| uses[*corner] += 1);
    assert!(uses.iter().all(|uses| *uses < 100), "{uses:?}");
}

/// A square with a grid of square holes. Each hole is connected to the outline or an earlier hole by a double
/// edge.
pub(crate) fn sieve(side: usize) -> Points {
    let size = 3.0 * side as f32 + 1.0;
    let mut outline = vec![(0.0, 0.0), (size, 0.0), (size, size), (0.0, size)];
    for hole in 0..side * side {
        let (x, y) = (3.0 * (hole % side) as f32 + 1.0, 3.0 * (hole / side) as f32 + 1.0);
        let corners = [(x, y), (x, y + 2.0), (x + 2.0, y + 2.0), (x + 2.0, y)];
        // Start the double edge at a corner of the outline or of a neighboring hole (below or to the left).
        let from = match (hole % side, hole / side) {
            (0, 0) => (0.0, 0.0),
            (0, _) => (x, y - 1.0),
            _ => (x - 1.0, y),
        };
        let index = outline.iter().position(|corner| *corner == from).expect("visited before");
        let bridge = corners.into_iter().chain([corners[0], from]);
        outline.splice(index + 1..index + 1, bridge);
    }
    outline
}

#[test]
fn holes_with_double_edges_are_not_filled() {
    let frame = [
        (0.0, 0.0),
        (3.0, 0.0),
        (3.0, 3.0),
        (0.0, 3.0),
        (0.0, 0.0),
        (1.0, 1.0),
        (1.0, 2.0),
        (2.0, 2.0),
        (2.0, 1.0),
        (1.0, 1.0),
    ];
    for turn in 0..frame.len() {
        let mut points = frame.to_vec();
        points.rotate_left(turn);
        for points in [reversed(&points), points] {
            let triangles = cut(&points);
            assert_eq!(layers(&points, &triangles, 1.4, 1.6), 0);
            for (x, y) in [(0.5, 1.7), (1.7, 0.5), (2.5, 1.7), (1.7, 2.5), (0.3, 0.2), (0.2, 0.3)] {
                assert_eq!(layers(&points, &triangles, x, y), 1, "({x}, {y})");
            }
        }
    }
    let sieve = sieve(12);
    let triangles = cut(&sieve);
    for hole in 0..144_u32 {
        let (x, y) = (3.0 * f64::from(hole % 12) + 1.9, 3.0 * f64::from(hole / 12) + 1.8);
        assert_eq!(layers(&sieve, &triangles, x, y), 0);
        assert_eq!(layers(&sieve, &triangles, x - 1.3718, y + 0.1234), 1);
    }
}

#[test]
fn outlines_may_touch_themselves() {
    // Two squares that share a corner, a corner that touches an edge from inside or outside, an edge
    // traversed in both directions, and collinear corners.
    let touching: [&[(f32, f32)]; 6] = [
        &[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 1.0), (2.0, 2.0), (1.0, 2.0), (1.0, 1.0), (0.0, 1.0)],
        &[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (3.0, 4.0), (2.0, 0.0), (1.0, 4.0), (0.0, 4.0)],
        &[(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (6.0, 3.0), (4.0, 1.5), (6.0, 1.0), (6.0, 4.0), (0.0, 4.0)],
        &[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 4.0), (2.0, 6.0), (2.0, 4.0), (0.0, 4.0)],
        &[
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (3.0, 0.0),
            (3.0, 1.0),
            (3.0, 3.0),
            (2.0, 3.0),
            (0.0, 3.0),
            (0.0, 1.0),
        ],
        &[
            (0.0, 0.0),
            (4.0, 0.0),
            (4.0, 4.0),
            (0.0, 4.0),
            (0.0, 2.0),
            (2.0, 2.0),
            (2.0, 3.0),
            (2.0, 2.0),
            (0.0, 2.0),
        ],
    ];
    for (case, points) in touching.into_iter().enumerate() {
        for turn in 0..points.len() {
            let mut points = points.to_vec();
            points.rotate_left(turn);
            for points in [reversed(&points), points] {
                let triangles = cut(&points);
                assert!(triangles.len() <= points.len() - 2, "{case}");
            }
        }
    }
}

#[test]
fn collinear_corners_are_kept() {
    let row = |from: (f32, f32), to: (f32, f32)| {
        (0..20).map(move |step| {
            let t = step as f32 / 20.0;
            (from.0 + (to.0 - from.0) * t, from.1 + (to.1 - from.1) * t)
        })
    };
    let corners = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)];
    let square: Points = (0..4).flat_map(|side| row(corners[side], corners[(side + 1) % 4])).collect();
    let triangles = cut(&square);
    assert_eq!(triangles.len(), 78);
    assert!(triangles.iter().all(|triangle| area(&square, triangle) > 0.0));
}

#[test]
fn random_outlines_are_covered_exactly_once() {
    let mut random = TestRandom::new(3);
    for case in 0..2000 {
        // A polyomino's outline touches itself where two cells share only a corner.
        let points = if case % 2 == 0 { polyomino(&mut random, 4 + case % 40) } else { coast(5 + case % 60) };
        cut(&points);
    }
}

/// The outline of a simply connected polyomino, with its cells on the left.
fn polyomino(random: &mut TestRandom, size: usize) -> Points {
    let mut cells = vec![(0_i32, 0_i32)];
    let has = |cells: &[(i32, i32)], x, y| cells.contains(&(x, y));
    while cells.len() < size {
        let (x, y) = cells[random.below(cells.len())];
        let (dx, dy) = [(1, 0), (-1, 0), (0, 1), (0, -1)][random.below(4)];
        let (x, y) = (x + dx, y + dy);
        // Adding a cell with only one neighbor never creates a hole.
        let neighbors =
            [(1, 0), (-1, 0), (0, 1), (0, -1)].iter().filter(|(dx, dy)| has(&cells, x + dx, y + dy));
        if !has(&cells, x, y) && neighbors.count() == 1 {
            cells.push((x, y));
        }
    }
    // Follow the boundary. Where two cells share only a corner, stay in the same cell.
    let start = *cells.iter().min().expect("a cell");
    let ((mut x, mut y), (mut dx, mut dy)) = (start, (1, 0));
    let mut outline = Vec::new();
    loop {
        outline.push((x as f32, y as f32));
        (x, y) = (x + dx, y + dy);
        let left_ahead = (x + (dx - dy - 1) / 2, y + (dy + dx - 1) / 2);
        let right_ahead = (x + (dx + dy - 1) / 2, y + (dy - dx - 1) / 2);
        if !has(&cells, left_ahead.0, left_ahead.1) {
            (dx, dy) = (-dy, dx);
        } else if has(&cells, right_ahead.0, right_ahead.1) {
            (dx, dy) = (dy, -dx);
        }
        if (x, y) == start && (dx, dy) == (1, 0) {
            return outline;
        }
    }
}

#[test]
fn self_intersecting_polygons_are_reported() {
    let star: Vec<Vec3> = (0..7)
        .map(|i| std::f32::consts::TAU * 3.0 * i as f32 / 7.0)
        .map(|angle| Vec3::new(angle.cos(), 7.0, angle.sin()))
        .collect();
    let bow = [Vec3::ZERO, Vec3::new(4.0, 4.0, 0.0), Vec3::X * 4.0, Vec3::Y * 3.0];
    for points in [&star[..], &bow] {
        let mut count = 0;
        assert!(!triangulate(points, |_| count += 1));
        assert!((1..points.len()).contains(&count));
    }
}
