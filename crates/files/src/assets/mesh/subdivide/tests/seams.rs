//! Texture coordinates, colors and their seams.

use super::*;

/// Affine texture coordinates.
fn affine(at: Vec3) -> Vec2 {
    Vec2::new(0.5 * at.x - 0.25 * at.y + 3.0, 0.125 * at.x + at.y)
}

#[test]
fn affine_coordinates_stay_affine() {
    let place = |[x, y]: [f32; 2]| [x + 0.2 * (3.0 * y).sin(), y + 0.15 * (2.0 * x * y).cos(), 0.0];
    let mut start = grid(4, 3, place);
    start.uvs = start.positions.iter().map(|at| affine(*at)).collect();
    start.second_uvs = start.uvs.iter().map(|uv| *uv * 2.0).collect();
    start.colors = start.positions.iter().map(|_| [200, 100, 7]).collect();
    let fine = subdivided(&start, 3);
    for (at, (uv, second)) in fine.positions.iter().zip(fine.uvs.iter().zip(&fine.second_uvs)) {
        assert!((affine(*at) - *uv).length() < 2e-6, "{at}");
        assert!((*uv * 2.0 - *second).length() < 1e-5);
    }
    assert!(fine.colors.iter().all(|color| *color == [200, 100, 7]));
    assert_eq!(fine.colors.len(), fine.positions.len());
}

/// A grid whose right half has its own vertices along the line x = 2, with texture coordinates that are
/// larger by 10.
fn split_grid(place: impl Fn([f32; 2]) -> [f32; 3]) -> TriangleMesh {
    let start = grid(4, 3, place);
    let (mut split, count) = (start.clone(), start.positions.len() as u32);
    split.positions.extend_from_slice(&start.positions);
    split.uvs = split.positions.iter().map(|at| affine(*at)).collect();
    split.uvs[count as usize..].iter_mut().for_each(|uv| *uv += Vec2::splat(10.0));
    for (square, triangles) in split.triangles.chunks_mut(2).enumerate() {
        if square % 4 >= 2 {
            triangles.as_flattened_mut().iter_mut().for_each(|vertex| *vertex += count);
        }
    }
    split
}

#[test]
fn seams_change_only_the_coordinates() {
    let flat = |[x, y]: [f32; 2]| [x, y, 0.0];
    let split = split_grid(flat);
    let fine = subdivided(&split, 3);
    let whole = subdivided(&grid(4, 3, flat), 3);
    // Positions and normals of each triangle are bit-identical to the mesh without a seam.
    for (split, whole_corners) in fine.triangles.iter().zip(&whole.triangles) {
        for (a, b) in split.iter().zip(whole_corners) {
            let (a, b) = (*a as usize, *b as usize);
            assert_eq!((fine.positions[a], fine.normals[a]), (whole.positions[b], whole.normals[b]));
        }
    }
    // Along the seam, coordinates remain affine on both sides.
    for (triangle, corners) in fine.triangles.iter().enumerate() {
        let shift = if triangle / 128 % 4 >= 2 { 10.0 } else { 0.0 };
        for corner in corners {
            let (at, uv) = (fine.positions[*corner as usize], fine.uvs[*corner as usize]);
            assert!((affine(at) + Vec2::splat(shift) - uv).length() < 4e-6, "{at} {uv}");
        }
    }
    assert_eq!(fine.positions.len(), whole.positions.len() + 3 * 8 + 1);
}

#[test]
fn a_box_of_six_charts_has_smooth_normals() {
    // Each side of the cube has its own vertices and the unit square as coordinates.
    let start = cube();
    let mut split = TriangleMesh::default();
    for side in start.triangles.chunks(2) {
        let first = split.positions.len() as u32;
        let corners = [side[0][0], side[0][1], side[0][2], side[1][2]];
        split.positions.extend(corners.map(|corner| start.positions[corner as usize]));
        split.uvs.extend([Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
        split.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    let (fine, whole) = (subdivided(&split, 3), subdivided(&start, 3));
    for (split, whole_corners) in fine.triangles.iter().zip(&whole.triangles) {
        for (a, b) in split.iter().zip(whole_corners) {
            let (a, b) = (*a as usize, *b as usize);
            assert_eq!((fine.positions[a], fine.normals[a]), (whole.positions[b], whole.normals[b]));
        }
    }
    // Each chart still covers the unit square, whose corners stay because three seams meet there.
    for chart in 0..6 {
        let corners = fine.triangles[chart * 128..(chart + 1) * 128].as_flattened();
        let uvs = || corners.iter().map(|corner| fine.uvs[*corner as usize]);
        for corner in [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y] {
            assert!(uvs().any(|uv| uv == corner), "{chart} {corner}");
        }
        assert!(uvs().all(|uv| uv.cmpge(Vec2::ZERO).all() && uv.cmple(Vec2::ONE).all()));
        let area = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| fine.uvs[corner as usize].as_dvec2());
            0.5 * (b - a).perp_dot(c - a)
        };
        let total: f64 = fine.triangles[chart * 128..(chart + 1) * 128].iter().map(area).sum();
        assert!((total - 1.0).abs() < 1e-5, "{chart}: {total}");
    }
}

#[test]
fn colors_are_blended_linearly() {
    let mut start = grid(4, 4, |[x, y]| [x, y, 0.0]);
    // A linear ramp of the linear values along x.
    let ramp = |x: f32| [linear_to_srgb8(0.25 * x), 0, 255];
    start.colors = start.positions.iter().map(|at| ramp(at.x)).collect();
    let fine = subdivided(&start, 2);
    for (at, color) in fine.positions.iter().zip(&fine.colors) {
        let expected = ramp(at.x);
        assert!(color[0].abs_diff(expected[0]) <= 1 && color[1..] == expected[1..], "{at}: {color:?}");
    }
}
