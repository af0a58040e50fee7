//! Polygons → triangles. Convex ones become fans; others are clipped ear by ear.

use crate::math::{DVec3, Vec3};

/// Most corners of a polygon that is clipped, which takes quadratic time; larger polygons become fans.
const CLIPPED_CORNERS: usize = 1024;

/// Cuts a polygon of `corners.len() ≥ 3` finite points into triangles of indices into it, with the same orientation.
pub(super) fn triangulate(points: &[Vec3], mut emit: impl FnMut([usize; 3])) {
    let points: Vec<DVec3> = points.iter().map(|point| point.as_dvec3()).collect();
    let normal = newell_normal(&points);
    let turns =
        |a: usize, b: usize, c: usize| (points[b] - points[a]).cross(points[c] - points[a]).dot(normal);
    let count = points.len();
    if count == 4 && turns(0, 1, 2).min(turns(0, 2, 3)) <= 0.0 && turns(0, 1, 3).min(turns(1, 2, 3)) > 0.0 {
        emit([0, 1, 3]);
        emit([1, 2, 3]);
    } else if count <= 4 || count > CLIPPED_CORNERS || (1..count - 1).all(|i| turns(0, i, i + 1) >= 0.0) {
        (1..count - 1).for_each(|i| emit([0, i, i + 1]));
    } else {
        clip_ears(count, turns, emit);
    }
}

/// The sum of the fan's normals, which is the same for every origin (Newell's method).
fn newell_normal(points: &[DVec3]) -> DVec3 {
    let origin = points[0];
    points.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin)).sum()
}

/// Ear clipping (Meisters 1975): cuts off convex corners whose triangle contains no other corner. `turns` is positive
/// if three corners turn the polygon's way. If no ear is found (a polygon that crosses itself), the rest becomes a fan.
fn clip_ears(count: usize, turns: impl Fn(usize, usize, usize) -> f64, mut emit: impl FnMut([usize; 3])) {
    let mut ring: Vec<usize> = (0..count).collect();
    let mut start = 0;
    while ring.len() > 3 {
        let length = ring.len();
        let ear = (0..length).map(|step| (start + step) % length).find(|&place| is_ear(&ring, place, &turns));
        let Some(place) = ear else { break };
        emit(around(&ring, place));
        ring.remove(place);
        start = place.min(ring.len() - 1);
    }
    (1..ring.len() - 1).for_each(|i| emit([ring[0], ring[i], ring[i + 1]]));
}

fn around(ring: &[usize], place: usize) -> [usize; 3] {
    let length = ring.len();
    [ring[(place + length - 1) % length], ring[place], ring[(place + 1) % length]]
}

fn is_ear(ring: &[usize], place: usize, turns: &impl Fn(usize, usize, usize) -> f64) -> bool {
    let [a, b, c] = around(ring, place);
    let inside = |&&p: &&usize| turns(a, b, p) >= 0.0 && turns(b, c, p) >= 0.0 && turns(c, a, p) >= 0.0;
    turns(a, b, c) > 0.0 && !ring.iter().filter(|p| ![a, b, c].contains(p)).any(|p| inside(&p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(points: &[(f32, f32)]) -> Vec<[usize; 3]> {
        let points: Vec<Vec3> = points.iter().map(|&(x, y)| Vec3::new(x, 7.0, -y)).collect();
        let mut triangles = Vec::new();
        triangulate(&points, |triangle| triangles.push(triangle));
        triangles
    }

    /// Twice the signed area of each triangle.
    fn areas(points: &[(f32, f32)], triangles: &[[usize; 3]]) -> Vec<f32> {
        let area = |[a, b, c]: [usize; 3]| {
            let (a, b, c) = (points[a], points[b], points[c]);
            (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
        };
        triangles.iter().map(|&triangle| area(triangle)).collect()
    }

    #[test]
    fn a_dart_is_cut_along_its_inner_diagonal() {
        let dart = [(0.0, 0.0), (4.0, 0.0), (1.0, 1.0), (0.0, 4.0)];
        assert_eq!(cut(&dart), [[0, 1, 2], [0, 2, 3]]);
        let turned = [(4.0, 0.0), (1.0, 1.0), (0.0, 4.0), (0.0, 0.0)];
        assert_eq!(cut(&turned), [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn a_comb_is_covered_once() {
        // Three teeth, clockwise and anticlockwise; the shoelace formula gives the area to cover.
        let comb = [
            (0.0, 0.0),
            (5.0, 0.0),
            (5.0, 4.0),
            (4.0, 1.0),
            (3.0, 4.0),
            (2.0, 1.0),
            (1.0, 4.0),
            (0.5, 1.0),
            (0.0, 4.0),
        ];
        let shoelace = |points: &[(f32, f32)]| -> f32 {
            (0..points.len())
                .map(|i| (points[i], points[(i + 1) % points.len()]))
                .map(|(a, b)| a.0 * b.1 - a.1 * b.0)
                .sum()
        };
        let backwards: Vec<_> = comb.iter().rev().copied().collect();
        for points in [comb.to_vec(), backwards] {
            let triangles = cut(&points);
            let areas = areas(&points, &triangles);
            let whole = shoelace(&points);
            assert_eq!(triangles.len(), points.len() - 2);
            assert!(areas.iter().all(|area| area * whole > 0.0), "{areas:?}");
            assert!((areas.iter().sum::<f32>() - whole).abs() < 1e-4);
        }
    }

    #[test]
    fn a_polygon_that_crosses_itself_still_ends() {
        let star: Vec<(f32, f32)> = (0..7)
            .map(|i| std::f32::consts::TAU * 3.0 * i as f32 / 7.0)
            .map(|angle| (angle.cos(), angle.sin()))
            .collect();
        assert_eq!(cut(&star).len(), 5);
    }
}
