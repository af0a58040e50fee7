//! Polygons with holes and polygons that touch themselves, in every format that has polygons.

use std::fs;
use std::sync::{Arc, LazyLock};

use super::load;
use super::polygon::tests::{Points, area, layers, reversed, sieve};
use crate::control::{CancelToken, ignore_progress};

/// A polygon, and points in its holes or next to its outline that no triangle may cover.
struct Polygon {
    name: &'static str,
    points: Points,
    outside: Vec<(f64, f64)>,
}

/// A ring with 3002 corners. Its edges are joined by a double edge.
fn ring() -> Points {
    let circle = |radius: f64| {
        (0..1500).map(move |corner| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(corner) / 1500.0).sin_cos();
            // Round to integers, which every format represents exactly.
            ((radius * cos).round() as f32, (radius * sin).round() as f32)
        })
    };
    let [outer, inner]: [Points; 2] = [30_000.0, 20_000.0].map(|radius| circle(radius).collect());
    let hole = inner[..1].iter().chain(inner.iter().rev());
    outer.iter().chain(&outer[..1]).chain(hole).copied().collect()
}

fn polygons() -> Vec<Polygon> {
    let in_ring =
        (0..200).map(|step| (f64::from(step) * 95.0, f64::from(step * 37 % 60) - 30.0)).chain([(-9e3, 17e3)]);
    let in_sieve = (0..256).map(|hole| (3.0 * f64::from(hole % 16) + 1.9, 3.0 * f64::from(hole / 16) + 1.8));
    let two_squares =
        [(0, 0), (2, 0), (2, 2), (4, 2), (4, 4), (2, 4), (2, 2), (0, 2)].map(|(x, y)| (x as f32, y as f32));
    let notch = [(0, 0), (4, 0), (4, 4), (3, 4), (2, 0), (1, 4), (0, 4)].map(|(x, y)| (x as f32, y as f32));
    let hook = [(0, 0), (4, 0), (4, 4), (6, 4), (4, 2), (6, 0), (8, 4), (6, 6), (0, 6)]
        .map(|(x, y)| (x as f32, y as f32));
    let counterclockwise = [
        ("a ring", ring(), in_ring.collect()),
        ("a sieve", sieve(16), in_sieve.collect()),
        ("two squares that share a corner", two_squares.into(), vec![(3.0, 1.0), (1.0, 3.0)]),
        ("a notch that ends at an edge", notch.into(), vec![(2.0, 0.5), (2.0, 3.0)]),
        ("a corner that touches an edge from outside", hook.into(), vec![(4.5, 3.0), (5.0, 0.5)]),
    ];
    let both = |(name, points, outside): (_, Points, Vec<_>)| {
        let clockwise = Polygon { name, points: reversed(&points), outside: outside.clone() };
        [Polygon { name, points, outside }, clockwise]
    };
    counterclockwise.into_iter().flat_map(both).collect()
}

/// Encodes a polygon in the plane z = x + y in every format that has polygons.
fn encodings(points: &Points) -> Vec<(&'static str, Vec<u8>)> {
    let mut vertices = Points::new();
    let index = |point: &(f32, f32)| {
        vertices.iter().position(|vertex| vertex == point).unwrap_or_else(|| {
            vertices.push(*point);
            vertices.len() - 1
        })
    };
    let corners: Vec<usize> = points.iter().map(index).collect();
    let lines = |start: &str, points: &Points| -> String {
        points.iter().map(|(x, y)| format!("{start}{x} {y} {}\n", x + y)).collect()
    };
    let words =
        |first: usize| -> String { corners.iter().map(|corner| format!(" {}", corner + first)).collect() };
    let (vertex_count, count) = (vertices.len(), corners.len());
    let header = |encoding: &str| {
        let coordinates = ["x", "y", "z"].map(|name| format!("property float {name}\n")).concat();
        format!(
            "ply\nformat {encoding} 1.0\nelement vertex {vertex_count}\n{coordinates}\
             element face 1\nproperty list uint uint vertex_indices\nend_header\n"
        )
    };
    let mut binary = header("binary_little_endian").into_bytes();
    for (x, y) in &vertices {
        binary.extend([*x, *y, x + y].map(f32::to_le_bytes).concat());
    }
    binary.extend([count].iter().chain(&corners).flat_map(|number| (*number as u32).to_le_bytes()));
    let facet = lines("vertex ", points);
    vec![
        ("a.obj", format!("{}f{}\n", lines("v ", &vertices), words(1)).into()),
        ("a.off", format!("OFF\n{vertex_count} 1 0\n{}{count}{}\n", lines("", &vertices), words(0)).into()),
        ("ascii.ply", format!("{}{}{count}{}\n", header("ascii"), lines("", &vertices), words(0)).into()),
        ("binary.ply", binary),
        (
            "a.stl",
            format!("solid a\nfacet normal 0 0 0\nouter loop\n{facet}endloop\nendfacet\nendsolid a\n").into(),
        ),
    ]
}

/// A polygon that was loaded from a file, and its triangles.
struct LoadedPolygon {
    case: String,
    polygon: Arc<Polygon>,
    warnings: Vec<String>,
    points: Points,
    triangles: Vec<[usize; 3]>,
}

/// Each polygon in each format. Loading them takes most of the time, so all tests share them.
static LOADED: LazyLock<Vec<LoadedPolygon>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let mut all = Vec::new();
    for polygon in polygons().into_iter().map(Arc::new) {
        for (file, bytes) in encodings(&polygon.points) {
            let path = folder.path().join(file);
            fs::write(&path, bytes).expect("written");
            let case = format!("{} in {file}", polygon.name);
            let loaded = load(&path, &ignore_progress, &CancelToken::new()).expect(&case);
            let position = |at: &crate::math::Vec3| {
                let position = at.as_dvec3() + loaded.mesh.origin;
                assert_eq!(position.z, position.x + position.y, "{case}: rounded");
                (position.x as f32, position.y as f32)
            };
            let points = loaded.mesh.positions.iter().map(position).collect();
            let corners = |triangle: &[u32; 3]| triangle.map(|corner| corner as usize);
            let triangles = loaded.mesh.triangles.iter().map(corners).collect();
            let polygon = Arc::clone(&polygon);
            all.push(LoadedPolygon { case, polygon, warnings: loaded.warnings, points, triangles });
        }
    }
    all
});

#[test]
fn triangle_areas_sum_to_the_polygon_area() {
    for LoadedPolygon { case, polygon, points, triangles, .. } in LOADED.iter() {
        let all: Vec<usize> = (0..polygon.points.len()).collect();
        let sum: f64 = triangles.iter().map(|triangle| area(points, triangle)).sum();
        assert_eq!(sum, area(&polygon.points, &all), "{case}");
    }
}

#[test]
fn triangles_keep_the_polygon_orientation() {
    for LoadedPolygon { case, polygon, points, triangles, .. } in LOADED.iter() {
        let all: Vec<usize> = (0..polygon.points.len()).collect();
        let total = area(&polygon.points, &all);
        assert!(triangles.iter().all(|triangle| area(points, triangle) * total > 0.0), "{case}");
    }
}

#[test]
fn holes_and_gaps_are_not_covered() {
    for LoadedPolygon { case, polygon, points, triangles, .. } in LOADED.iter() {
        for (x, y) in &polygon.outside {
            assert_eq!(layers(points, triangles, *x, *y), 0, "{case}: ({x}, {y})");
        }
    }
}

#[test]
fn touching_polygons_cause_no_warnings() {
    for LoadedPolygon { case, warnings, .. } in LOADED.iter() {
        assert!(warnings.is_empty(), "{case}: {warnings:?}");
    }
}
