//! Vertex normals where a file has none: each face counts by its angle at the vertex (Thürmer and Wüthrich,
//! *Computing Vertex Normals from Polygonal Facets*, JGT 1998), so that how a surface is cut does not show.

use rayon::prelude::*;

use crate::geometry::mesh::TriangleMesh;
use crate::math::{DVec3, Vec3};

/// Vertices at one place are one surface where their own normals agree within 45 degrees (a texture's seam), and
/// an edge beyond (a box whose file separates its sides).
const SEAM_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Above this many vertices at one place they are all taken together: comparing each with each is quadratic.
const COMPARED: usize = 64;

/// Triangles whose weights are held at a time.
const BATCH: usize = 1 << 16;

/// A unit normal for each vertex, weighted by angle, on the front side of the faces around it. Vertices that the
/// file separates at one place get one normal where their own agree within 45 degrees. Where faces cancel each
/// other, the vertex gets one face's normal. The result does not depend on the number of threads.
pub fn vertex_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
    let sums = weighted_sums(mesh);
    let mut joined = sums.clone();
    for group in by_place(mesh).chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        let group: Vec<u32> = group.iter().map(|(_, vertex)| *vertex).collect();
        join(&group, &sums, &mut joined);
    }
    let mut normals: Vec<Vec3> =
        joined.par_iter().map(|sum| sum.try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3())).collect();
    if normals.contains(&Vec3::ZERO) {
        take_face_normals(mesh, &mut normals);
    }
    normals
}

/// Replace normals of zero.
pub(super) fn fill_missing_normals(mesh: &mut TriangleMesh) {
    let made = vertex_normals(mesh);
    for (normal, made) in mesh.normals.iter_mut().zip(made) {
        if *normal == Vec3::ZERO {
            *normal = made;
        }
    }
}

/// At each vertex the unit normals of its faces times their angles there.
fn weighted_sums(mesh: &TriangleMesh) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    let mut weighted = Vec::with_capacity(BATCH.min(mesh.triangles.len()));
    for triangles in mesh.triangles.chunks(BATCH) {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);
        triangles
            .par_iter()
            .map(|triangle| corner_weights(corners(triangle)))
            .collect_into_vec(&mut weighted);
        for (triangle, (normal, angles)) in triangles.iter().zip(&weighted) {
            for (vertex, angle) in triangle.iter().zip(angles) {
                sums[*vertex as usize] += *normal * *angle;
            }
        }
    }
    sums
}

/// Unit normal (0 without area) and the angle at each corner. The arc tangent keeps the tiny angles of slivers,
/// which an arc cosine loses.
fn corner_weights([a, b, c]: [Vec3; 3]) -> (DVec3, [f64; 3]) {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    let cross = (b - a).cross(c - a);
    let doubled_area = cross.length();
    if doubled_area == 0.0 {
        return (DVec3::ZERO, [0.0; 3]);
    }
    let angle = |from: DVec3, to: DVec3, other: DVec3| doubled_area.atan2((to - from).dot(other - from));
    (cross / doubled_area, [angle(a, b, c), angle(b, c, a), angle(c, a, b)])
}

/// Every vertex behind the bits of its place, so that those at one place follow each other.
fn by_place(mesh: &TriangleMesh) -> Vec<([u32; 3], u32)> {
    // Adding 0 makes −0 and 0 one place.
    let place = |position: Vec3| (position + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<_> = (0..mesh.positions.len() as u32)
        .map(|vertex| (place(mesh.positions[vertex as usize]), vertex))
        .collect();
    order.par_sort_unstable();
    order
}

fn join(group: &[u32], sums: &[DVec3], joined: &mut [DVec3]) {
    let own = |vertex: u32| sums[vertex as usize];
    if group.len() > COMPARED {
        let sum: DVec3 = group.iter().map(|&vertex| own(vertex)).sum();
        group.iter().for_each(|&vertex| joined[vertex as usize] = sum);
        return;
    }
    for &vertex in group {
        let direction = own(vertex).normalize_or_zero();
        let agrees = |other: DVec3| other.normalize_or_zero().dot(direction) > SEAM_COSINE;
        let sum: DVec3 = group.iter().map(|&other| own(other)).filter(|other| agrees(*other)).sum();
        joined[vertex as usize] = sum;
    }
}

/// For vertices whose faces cancel: the normal of one of them; up where there is none.
fn take_face_normals(mesh: &TriangleMesh, normals: &mut [Vec3]) {
    for triangle in &mesh.triangles {
        if triangle.iter().any(|&vertex| normals[vertex as usize] == Vec3::ZERO) {
            let (normal, _) = corner_weights(triangle.map(|vertex| mesh.positions[vertex as usize]));
            for &vertex in triangle {
                let own = &mut normals[vertex as usize];
                *own = if *own == Vec3::ZERO { normal.as_vec3() } else { *own };
            }
        }
    }
    normals.iter_mut().filter(|normal| **normal == Vec3::ZERO).for_each(|normal| *normal = Vec3::Y);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> TriangleMesh {
        let positions = positions.iter().copied().map(Vec3::from_array).collect();
        TriangleMesh { positions, triangles: triangles.to_vec(), ..TriangleMesh::default() }
    }

    #[test]
    fn a_cubes_corner_points_along_its_diagonal_however_it_is_cut() {
        // Three right angles meet at the origin; one face is cut in two there. Weights by area or by count
        // would lean towards it.
        let corner = mesh(
            &[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0., 0., 1.]],
            &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
        );
        let normal = vertex_normals(&corner)[0];
        assert!((normal - Vec3::ONE.normalize()).length() < 1e-6, "{normal}");
    }

    #[test]
    fn a_seam_does_not_show_and_an_edge_does() {
        // Two quads folded by `height`, with separate vertices along the fold.
        let folded = |height: f32| {
            mesh(
                &[
                    [0., 0., 0.],
                    [0., 1., 0.],
                    [-1., 0., height],
                    [0., 0., -0.],
                    [0., 1., 0.],
                    [1., 0., height],
                ],
                &[[0, 1, 2], [3, 5, 4]],
            )
        };
        let seam = vertex_normals(&folded(0.1));
        assert_eq!(seam[0], seam[3]);
        assert!((seam[0] - Vec3::Z).length() < 1e-6);
        assert!((seam[2] - Vec3::Z).length() > 0.05);
        let edge = vertex_normals(&folded(3.0));
        assert!(edge[0].dot(edge[3]) < 0.0);
    }

    #[test]
    fn faces_that_cancel_leave_one_of_their_normals() {
        let normals = vertex_normals(&mesh(
            &[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [9., 9., 9.]],
            &[[0, 1, 2], [0, 2, 1]],
        ));
        assert_eq!(normals[..3], [Vec3::Z; 3]);
        assert!(normals.iter().all(|normal| normal.is_normalized()));
    }

    #[test]
    fn slivers_and_extremes_give_unit_normals() {
        for scale in [1e-20_f32, 1.0, 1e30] {
            let sliver = mesh(
                &[[0., 0., 0.], [scale, 0., 0.], [0.5 * scale, 1e-7 * scale, 0.], [0.5 * scale, 0., scale]],
                &[[0, 1, 2], [0, 3, 1]],
            );
            for normal in vertex_normals(&sliver) {
                assert!(normal.is_normalized(), "{scale}: {normal}");
            }
        }
    }

    #[test]
    fn many_vertices_at_one_place_are_quick() {
        let count = 200_000;
        let mut positions = vec![[0.0; 3]; count];
        positions.extend([[1., 0., 0.], [0., 1., 0.]]);
        let (x, y) = (count as u32, count as u32 + 1);
        let triangles: Vec<_> = (0..count as u32).map(|vertex| [vertex, x, y]).collect();
        assert!(vertex_normals(&mesh(&positions, &triangles)).iter().all(|normal| *normal == Vec3::Z));
    }
}
