//! Computes vertex normals for files without normals. Each face is weighted by its angle at the vertex, which
//! makes the normals independent of the triangulation (Thürmer and Wüthrich, *Computing Vertex Normals from
//! Polygonal Facets*, JGT 1998).

use std::f64::consts::{FRAC_PI_2, PI};

use rayon::prelude::*;

use super::coincident;
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::{TriangleMesh, VertexNormalGroup};
use crate::math::{DVec3, Vec3};

/// Minimum cosine at which the normals of coincident vertices are merged. Normals that differ by at most 45
/// degrees are merged, as at a texture seam. Otherwise, the vertices form a sharp edge, as in a box with
/// separate sides.
const SEAM_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Maximum number of coincident vertices whose normals are compared pairwise, which takes quadratic time.
/// Larger sets are merged without comparing normals.
const MAX_COMPARED: usize = 64;

/// Number of triangles or vertices between polls of the cancel token.
const BATCH: usize = 1 << 16;

/// Computes a unit normal for each vertex, pointing to the front side of its faces. Each face is weighted by
/// its angle at the vertex. Coincident vertices share a normal if they have the same
/// [`VertexNormalGroup::group`] and their normals differ by at most 45 degrees. If the face normals cancel
/// out, the normal of one face is used. The result does not depend on the number of threads.
///
/// # Errors
/// [`Canceled`].
pub fn vertex_normals(mesh: &TriangleMesh, token: &CancelToken) -> Result<Vec<Vec3>, Canceled> {
    let mut sums = sum_weighted_face_normals(mesh, token)?;
    let groups = &mesh.normal_groups;
    let firsts = first_vertices_with_same_normal(groups);
    for (vertex, first) in firsts.iter().enumerate().filter(|(vertex, first)| vertex != *first) {
        let own = std::mem::take(&mut sums[vertex]);
        sums[*first] += own;
    }
    let places = coincident::find_coincident_vertex_sets(&mesh.positions, token)?;
    let mut joined = sums.clone();
    for place in &places {
        token.check_pause_and_cancel()?;
        if groups.is_empty() {
            merge_normals_within_seam_angle(place, &sums, &mut joined);
        } else {
            let group = |vertex: &u32| groups[*vertex as usize].group;
            let is_joined = |vertex: &&u32| {
                firsts[**vertex as usize] == **vertex as usize && group(vertex) != VertexNormalGroup::FLAT
            };
            let mut place: Vec<u32> = place.iter().filter(is_joined).copied().collect();
            place.sort_by_key(group);
            place
                .chunk_by(|a, b| group(a) == group(b))
                .for_each(|place| merge_normals_within_seam_angle(place, &sums, &mut joined));
        }
    }
    for (vertex, first) in firsts.into_iter().enumerate() {
        joined[vertex] = joined[first];
    }
    let mut normals = vec![Vec3::ZERO; sums.len()];
    for (normals, sums) in normals.chunks_mut(BATCH).zip(joined.chunks(BATCH)) {
        token.check_pause_and_cancel()?;
        let unit = |sum: &DVec3| sum.try_normalize().map_or(Vec3::ZERO, |n| n.as_vec3());
        normals.par_iter_mut().zip(sums).for_each(|(normal, sum)| *normal = unit(sum));
    }
    if normals.contains(&Vec3::ZERO) {
        replace_canceled_normals(mesh, &mut normals, token)?;
    }
    Ok(normals)
}

/// Maps each vertex to the first vertex with the same normal. Returns an empty list if there are no groups.
fn first_vertices_with_same_normal(groups: &[VertexNormalGroup]) -> Vec<usize> {
    let numbers = groups.iter().map(|group| group.normal as usize + 1).max().unwrap_or(0);
    let mut firsts = vec![usize::MAX; numbers];
    let first_of = |(vertex, group): (usize, &VertexNormalGroup)| {
        let first = &mut firsts[group.normal as usize];
        *first = vertex.min(*first);
        *first
    };
    groups.iter().enumerate().map(first_of).collect()
}

/// Whether a mesh without normals consists of flat faces, like a box. In a faceted mesh, the face normals
/// around most vertices partly cancel out.
pub(crate) fn is_polyhedral_without_normals(mesh: &TriangleMesh) -> bool {
    /// Minimum length of the mean unit normal around a vertex on a smooth surface. It corresponds to normals
    /// that form a cone with a half-angle of 32 degrees.
    const MIN_MEAN_LENGTH: f32 = 0.85;
    let groups = &mesh.normal_groups;
    if !mesh.normals.is_empty() || groups.iter().any(|group| group.group != VertexNormalGroup::BY_ANGLE) {
        return false;
    }
    let firsts = first_vertices_with_same_normal(groups);
    let mut sums = vec![(Vec3::ZERO, 0_u32); mesh.positions.len()];
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for corner in corners {
            let vertex = firsts.get(*corner as usize).copied().unwrap_or(*corner as usize);
            let (sum, count) = &mut sums[vertex];
            *sum += normal;
            *count += 1;
        }
    }
    let means = sums.iter().filter(|(_, count)| *count > 0).map(|(sum, count)| sum.length() / *count as f32);
    let (total, vertices) =
        means.fold((0.0, 0), |(total, vertices), mean| (total + f64::from(mean), vertices + 1));
    total < f64::from(MIN_MEAN_LENGTH) * f64::from(vertices)
}

/// Replaces zero normals with computed vertex normals.
pub(super) fn fill_missing_normals(mesh: &mut TriangleMesh, token: &CancelToken) -> Result<(), Canceled> {
    let made = vertex_normals(mesh, token)?;
    for (normal, made) in mesh.normals.iter_mut().zip(made) {
        if *normal == Vec3::ZERO {
            *normal = made;
        }
    }
    Ok(())
}

/// Sums the unit face normals around each vertex in face order, weighted by the faces' angles at the vertex.
/// Each thread owns a range of vertices, so the order does not depend on the number of threads.
fn sum_weighted_face_normals(mesh: &TriangleMesh, token: &CancelToken) -> Result<Vec<DVec3>, Canceled> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    let share = sums.len().div_ceil(rayon::current_num_threads()).max(1);
    let mut weighted = Vec::with_capacity(BATCH.min(mesh.triangles.len()));
    for triangles in mesh.triangles.chunks(BATCH) {
        token.check_pause_and_cancel()?;
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| mesh.positions[vertex as usize]);
        triangles
            .par_iter()
            .with_min_len(1 << 10)
            .map(|triangle| normal_and_corner_angles(corners(triangle)))
            .collect_into_vec(&mut weighted);
        sums.par_chunks_mut(share).enumerate().for_each(|(part, sums)| {
            let first = part * share;
            for (triangle, (normal, angles)) in triangles.iter().zip(&weighted) {
                for (vertex, angle) in triangle.iter().zip(angles) {
                    if let Some(sum) = sums.get_mut((*vertex as usize).wrapping_sub(first)) {
                        *sum += *normal * *angle;
                    }
                }
            }
        });
    }
    Ok(sums)
}

/// Returns a triangle's unit normal (0 if it has no area) and the angle at each corner. Unlike the arccosine,
/// the arctangent is accurate for the tiny angles in slivers.
fn normal_and_corner_angles([a, b, c]: [Vec3; 3]) -> (DVec3, [f64; 3]) {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    let (ab, bc, ca) = (b - a, c - b, a - c);
    let cross = ca.cross(ab);
    let doubled_area = cross.length();
    if doubled_area == 0.0 {
        return (DVec3::ZERO, [0.0; 3]);
    }
    let angle = |from: DVec3, to: DVec3| fast_atan2_upper_half(-from.dot(to), doubled_area);
    (cross / doubled_area, [angle(ca, ab), angle(ab, bc), angle(bc, ca)])
}

/// Computes `atan2(y, x)` for y > 0 with a relative error of at most 2e-8 (Abramowitz and Stegun, *Handbook
/// of Mathematical Functions*, 4.4.49). This is accurate enough for weights and avoids unpredictable
/// branches.
fn fast_atan2_upper_half(x: f64, y: f64) -> f64 {
    const STARTS: [f64; 4] = [0.0, FRAC_PI_2, PI, FRAC_PI_2];
    const SIGNS: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
    let octant = usize::from(y > x.abs()) | usize::from(x < 0.0) << 1;
    let t = x.abs().min(y) / x.abs().max(y);
    let t2 = t * t;
    let (t4, pair) = (t2 * t2, |a: f64, b: f64| a + b * t2);
    let low = pair(1.0, -0.333_331_452_8) + t4 * pair(0.199_935_508_5, -0.142_088_994_4);
    let high = pair(0.106_562_639_3, -0.075_289_640_0) + t4 * pair(0.042_909_613_8, -0.016_165_736_7);
    let t8 = t4 * t4;
    STARTS[octant] + SIGNS[octant] * t * (low + t8 * (high + t8 * 0.002_866_225_7))
}

fn merge_normals_within_seam_angle(group: &[u32], sums: &[DVec3], joined: &mut [DVec3]) {
    let own = |vertex: u32| sums[vertex as usize];
    if group.len() > MAX_COMPARED {
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

/// Assigns normals to vertices whose face normals cancel out: the normal of one of the faces, or +y if the
/// vertex has no faces.
fn replace_canceled_normals(
    mesh: &TriangleMesh,
    normals: &mut [Vec3],
    token: &CancelToken,
) -> Result<(), Canceled> {
    for triangles in mesh.triangles.chunks(BATCH) {
        token.check_pause_and_cancel()?;
        for triangle in triangles {
            if triangle.iter().any(|&vertex| normals[vertex as usize] == Vec3::ZERO) {
                let (normal, _) =
                    normal_and_corner_angles(triangle.map(|vertex| mesh.positions[vertex as usize]));
                for &vertex in triangle {
                    let own = &mut normals[vertex as usize];
                    *own = if *own == Vec3::ZERO { normal.as_vec3() } else { *own };
                }
            }
        }
    }
    normals.iter_mut().filter(|normal| **normal == Vec3::ZERO).for_each(|normal| *normal = Vec3::Y);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
        super::vertex_normals(mesh, &CancelToken::new()).expect("not canceled")
    }

    fn mesh(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> TriangleMesh {
        let positions = positions.iter().copied().map(Vec3::from_array).collect();
        TriangleMesh { positions, triangles: triangles.to_vec(), ..TriangleMesh::default() }
    }

    #[test]
    fn normals_do_not_depend_on_the_triangulation() {
        // Three right angles meet at the origin, and one of the three faces is split there. Weighting by area
        // or by count would pull the normal toward the split face.
        let corner = mesh(
            &[[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0., 0., 1.]],
            &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
        );
        let normal = vertex_normals(&corner)[0];
        assert!((normal - Vec3::ONE.normalize()).length() < 1e-6, "{normal}");
    }

    #[test]
    fn seams_are_smooth_and_edges_are_sharp() {
        // Two quads with a fold of the specified height and separate vertices along the fold.
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
    fn opposite_faces_use_the_normal_of_one_face() {
        let normals = vertex_normals(&mesh(
            &[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [9., 9., 9.]],
            &[[0, 1, 2], [0, 2, 1]],
        ));
        assert_eq!(normals[..3], [Vec3::Z; 3]);
        assert!(normals.iter().all(|normal| normal.is_normalized()));
    }

    #[test]
    fn slivers_and_extreme_scales_have_unit_normals() {
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
    fn angles_match_atan2() {
        for i in 0..1000 {
            let (x, y) = ((f64::from(i) * 0.7).sin() * 3.0, (0.02 * f64::from(i) - 15.0).exp());
            let exact = y.atan2(x);
            assert!((fast_atan2_upper_half(x, y) - exact).abs() <= 3e-8 * exact, "({x}, {y})");
        }
    }

    #[test]
    fn normals_do_not_depend_on_thread_count() {
        let at = |i: u32| [(i % 300) as f32, (i / 300) as f32, (i as f32 * 0.37).sin()];
        let positions: Vec<_> = (0..90_000).map(at).collect();
        let triangles: Vec<_> =
            (0..89_699).flat_map(|i| [[i, i + 1, i + 300], [i + 1, i + 301, i + 300]]).collect();
        let mesh = mesh(&positions, &triangles);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| vertex_normals(&mesh))
        };
        assert_eq!(with(1), with(3));
        let token = CancelToken::new();
        token.cancel();
        assert_eq!(super::vertex_normals(&mesh, &token), Err(Canceled));
    }

    #[test]
    fn many_coincident_vertices_are_fast() {
        let count = 200_000;
        let mut positions = vec![[0.0; 3]; count];
        positions.extend([[1., 0., 0.], [0., 1., 0.]]);
        let (x, y) = (count as u32, count as u32 + 1);
        let triangles: Vec<_> = (0..count as u32).map(|vertex| [vertex, x, y]).collect();
        assert!(vertex_normals(&mesh(&positions, &triangles)).iter().all(|normal| *normal == Vec3::Z));
    }

    /// A sphere made of `rows` rows and 2 · `rows` columns of quads that share vertices.
    fn sphere(rows: u32) -> TriangleMesh {
        let at = |i: u32| {
            let (row, column) = (i / (2 * rows), i % (2 * rows));
            let (polar, turn) = (std::f32::consts::PI / rows as f32 * (row as f32 + 0.5)).sin_cos();
            let (sin, cos) = (std::f32::consts::PI / rows as f32 * column as f32).sin_cos();
            Vec3::new(polar * cos, turn, polar * sin)
        };
        let quads = (0..rows - 1).flat_map(|row| (0..2 * rows).map(move |column| (row, column)));
        let triangles = quads.flat_map(|(row, column)| {
            let next = (column + 1) % (2 * rows);
            let [a, b] = [row * 2 * rows + column, row * 2 * rows + next];
            [[a, b, a + 2 * rows], [b, b + 2 * rows, a + 2 * rows]]
        });
        let positions = (0..rows * 2 * rows).map(at).collect();
        TriangleMesh { positions, triangles: triangles.collect(), ..TriangleMesh::default() }
    }

    #[test]
    fn boxes_are_faceted_and_spheres_are_not() {
        let corner = |i: u32| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
        let mut cube =
            TriangleMesh { positions: (0..8).map(corner).collect(), triangles, ..TriangleMesh::default() };
        assert!(is_polyhedral_without_normals(&cube));
        cube.normals = vec![Vec3::Y; 8];
        assert!(!is_polyhedral_without_normals(&cube), "the mesh has normals");
        assert!(!is_polyhedral_without_normals(&sphere(8)) && !is_polyhedral_without_normals(&sphere(60)));
    }
}
