//! Builds a valid [`TriangleMesh`] from a parser's output.

use std::collections::HashSet;

use rayon::prelude::*;

use super::normals::fill_missing_normals;
use super::parsed::{Faces, ParsedMesh};
use super::polygon::triangulate;
use super::{MeshFileBytes, corners};
use crate::assets::{AssetError, DroppedFaces, FileHash, LoadedMesh};
use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::TriangleMesh;
use crate::math::origin::local_coordinate_origin;
use crate::math::{DVec3, Vec2, Vec3};

/// Number of faces between polls of the cancel token.
const BATCH: usize = 1 << 14;

/// Assembles a mesh: triangulates polygons, drops unusable faces, removes unused vertices and completes the
/// normals.
pub(crate) fn assemble(source: &MeshFileBytes<'_>, parsed: ParsedMesh) -> Result<LoadedMesh, AssetError> {
    assemble_text_mesh(source, parsed, |_| None)
}

/// Like [`assemble`], but for text files. `start_of` maps a face index to the byte offset of the face.
pub(super) fn assemble_text_mesh(
    source: &MeshFileBytes<'_>,
    mut parsed: ParsedMesh,
    start_of: impl Fn(usize) -> Option<usize>,
) -> Result<LoadedMesh, AssetError> {
    corners::split_vertices_by_uv_and_color(&mut parsed, source.monitor.token)?;
    let ParsedMesh {
        positions,
        normals,
        normal_groups,
        uvs,
        second_uvs,
        colors,
        mut faces,
        corner_uvs: _,
        corner_colors: _,
        has_separate_corners,
        face_materials,
        materials,
        mut warnings,
        material_warnings,
        companions,
        pictures,
    } = parsed;
    let (origin, positions) = to_origin_and_offsets(positions, &faces);
    if has_separate_corners {
        faces.merge_vertices_by_position(&positions, source.monitor.token)?;
    }
    let max_triangles = TriangleMesh::MAX_TRIANGLES as usize;
    let mut cutter = FaceTriangulator::new(&positions, &face_materials, max_triangles);
    cutter.add_all_faces(source, &faces)?;
    let FaceTriangulator { triangles, triangle_materials, dropped, crossing, .. } = cutter;
    let line_of = |face: usize| start_of(face).map(|start| source.line_number(start));
    warnings.extend(self_intersection_warning(crossing.0, crossing.1, line_of));
    if triangles.is_empty() {
        return Err(source.malformed_error_without_line(no_usable_face_message(faces.len(), dropped)));
    }
    let bad_uvs = [&uvs, &second_uvs].map(|uvs| vertices_with_non_finite_attribute(uvs, |uv| uv.is_finite()));
    let bad_normals = vertices_with_non_finite_attribute(&normals, |normal| normal.is_finite());
    warnings.extend(first_face_using_vertices_warning(&faces, line_of, &bad_uvs.concat(), NON_FINITE_UVS));
    warnings.extend(first_face_using_vertices_warning(&faces, line_of, &bad_normals, NON_FINITE_NORMALS));
    let materials_of = triangle_materials;
    let mut mesh = TriangleMesh {
        origin,
        positions,
        normals,
        normal_groups,
        uvs,
        second_uvs,
        colors,
        triangles,
        materials: materials_of,
    };
    drop_unused_vertices(&mut mesh);
    for uv in mesh.uvs.iter_mut().chain(&mut mesh.second_uvs).filter(|uv| !uv.is_finite()) {
        *uv = Vec2::ZERO;
    }
    normalize_and_complete_normals(&mut mesh, source.monitor.token)?;
    let hash = FileHash::default();
    Ok(LoadedMesh { hash, mesh, materials, dropped, warnings, material_warnings, companions, pictures })
}

/// Converts positions to offsets from an origin near the vertices that faces use. Offsets too large for `f32`
/// become infinite.
fn to_origin_and_offsets(positions: Vec<DVec3>, faces: &Faces) -> (DVec3, Vec<Vec3>) {
    let least = DVec3::splat(f64::from(f32::MIN));
    let place = |corner: &u32| positions.get(*corner as usize).copied().unwrap_or(DVec3::NAN);
    let held = |place: &DVec3| place.cmpge(least).all() && place.cmple(-least).all();
    let none = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let both =
        |(min, max): (DVec3, DVec3), (least, greatest): (DVec3, DVec3)| (min.min(least), max.max(greatest));
    let places = faces.corners.par_iter().map(place).filter(held);
    let (min, max) = places.fold(none, |ends, place| both(ends, (place, place))).reduce(none, both);
    let origin = local_coordinate_origin((min + max) * 0.5, (max - min).max_element() * 0.5);
    (origin, positions.into_par_iter().map(|place| (place - origin).as_vec3()).collect())
}

pub(super) const NO_FACES: &str = "no usable face: the file has no faces";

fn too_many_triangles_message(limit: usize) -> String {
    format!("more than {limit} triangles; split the mesh")
}

fn index_out_of_range_message(face: usize) -> String {
    format!("face {face}: vertex index out of range")
}

fn no_usable_face_message(faces: usize, dropped: DroppedFaces) -> String {
    if faces == 0 {
        return NO_FACES.to_owned();
    }
    let DroppedFaces { non_finite, degenerate } = dropped;
    format!("no usable face: {non_finite} of {faces} have a non-finite corner, {degenerate} have zero area")
}

const NON_FINITE_UVS: &str = "has non-finite texture coordinates; such coordinates are set to (0, 0)";
const NON_FINITE_NORMALS: &str = "has non-finite normals; they are recomputed";

/// Returns the vertices whose attribute is not finite.
fn vertices_with_non_finite_attribute<T>(values: &[T], is_finite: impl Fn(&T) -> bool) -> Vec<u32> {
    (0_u32..).zip(values).filter(|(_, value)| !is_finite(value)).map(|(vertex, _)| vertex).collect()
}

/// Warns about the first face that uses any of the vertices.
fn first_face_using_vertices_warning(
    faces: &Faces,
    line_of: impl Fn(usize) -> Option<usize>,
    vertices: &[u32],
    words: &str,
) -> Option<String> {
    let vertices: HashSet<u32> = vertices.iter().copied().collect();
    if vertices.is_empty() {
        return None;
    }
    let corner = faces.corners.iter().position(|vertex| vertices.contains(vertex))?;
    let face = faces.face_of_corner(corner);
    Some(format!("{} {words}", face_label(face, line_of(face))))
}

/// Label of a face in warnings, with the line number in text files.
fn face_label(face: usize, line: Option<usize>) -> String {
    match line {
        Some(line) => format!("line {line}: face {}", face + 1),
        None => format!("face {}", face + 1),
    }
}

/// Warns about self-intersecting polygons.
fn self_intersection_warning(
    count: u64,
    first: usize,
    line_of: impl Fn(usize) -> Option<usize>,
) -> Option<String> {
    let first_face = || face_label(first, line_of(first));
    match count {
        0 => None,
        1 => Some(format!("{} intersects itself; its triangles may overlap", first_face())),
        _ => Some(format!(
            "{} and {} more intersect themselves; their triangles may overlap",
            first_face(),
            count - 1
        )),
    }
}

struct FaceTriangulator<'a> {
    positions: &'a [Vec3],
    materials: &'a [u32],
    max_triangles: usize,
    triangles: Vec<[u32; 3]>,
    triangle_materials: Vec<u32>,
    dropped: DroppedFaces,
    /// Number of self-intersecting polygons, and the index of the first one.
    crossing: (u64, usize),
}

impl<'a> FaceTriangulator<'a> {
    fn new(positions: &'a [Vec3], materials: &'a [u32], max_triangles: usize) -> Self {
        let (triangles, triangle_materials) = Default::default();
        Self {
            positions,
            materials,
            max_triangles,
            triangles,
            triangle_materials,
            dropped: DroppedFaces::default(),
            crossing: (0, 0),
        }
    }

    fn add_all_faces(&mut self, source: &MeshFileBytes<'_>, faces: &Faces) -> Result<(), AssetError> {
        if self.copy_triangles_if_all_valid(faces) {
            return Ok(());
        }
        self.triangles.reserve(faces.len());
        let mut from = 0;
        for face in 0..faces.len() {
            if face % BATCH == 0 {
                source.monitor.token.check_pause_and_cancel()?;
            }
            let arity = faces.arities.get(face).map_or(3, |arity| *arity as usize);
            let corners = &faces.corners[from..from + arity];
            from += arity;
            if corners.iter().any(|&corner| corner as usize >= self.positions.len()) {
                return Err(source.malformed_error_without_line(index_out_of_range_message(face + 1)));
            }
            self.add_face(corners, face);
            if self.triangles.len() > self.max_triangles {
                return Err(
                    source.malformed_error_without_line(too_many_triangles_message(self.max_triangles))
                );
            }
            if let Some(&material) = self.materials.get(face) {
                self.triangle_materials.resize(self.triangles.len(), material);
            }
        }
        Ok(())
    }

    /// Fast path for meshes with only valid triangles: copies all faces in parallel. Returns false for other
    /// meshes.
    fn copy_triangles_if_all_valid(&mut self, faces: &Faces) -> bool {
        let (triangles, _) = faces.corners.as_chunks();
        let in_range = |corner: &u32| (*corner as usize) < self.positions.len();
        let good = |triangle: &[u32; 3]| {
            let points = || triangle.map(|corner| self.positions[corner as usize]);
            triangle.iter().all(in_range)
                && points().iter().all(|point| point.is_finite())
                && has_area(points())
        };
        let all = faces.arities.is_empty()
            && triangles.len() <= self.max_triangles
            && triangles.par_iter().all(good);
        if all {
            self.triangles = triangles.to_vec();
            self.triangle_materials = self.materials.to_vec();
        }
        all
    }

    /// Adds the triangles of a face, or counts the face as dropped.
    fn add_face(&mut self, corners: &[u32], face: usize) {
        let before = self.triangles.len();
        if corners.iter().any(|&corner| !self.positions[corner as usize].is_finite()) {
            self.dropped.non_finite += 1;
            return;
        }
        match *corners {
            [a, b, c] => self.push_unless_degenerate([a, b, c]),
            _ => self.triangulate_polygon(corners, face),
        }
        if self.triangles.len() == before {
            self.dropped.degenerate += 1;
        }
    }

    /// Triangulates a polygon after dropping repeated corners, as in quads at a pole.
    fn triangulate_polygon(&mut self, corners: &[u32], face: usize) {
        let place = |corner: u32| self.positions[corner as usize];
        let mut distinct = corners.to_vec();
        distinct.dedup_by(|a, b| place(*a) == place(*b));
        while distinct.len() > 1 && place(distinct[0]) == place(distinct[distinct.len() - 1]) {
            distinct.pop();
        }
        if distinct.len() >= 3 {
            let points: Vec<Vec3> = distinct.iter().map(|&corner| place(corner)).collect();
            let before = self.triangles.len();
            let is_simple = triangulate(&points, |triangle| {
                self.push_unless_degenerate(triangle.map(|index| distinct[index]));
            });
            if !is_simple && self.triangles.len() > before {
                self.crossing.1 = if self.crossing.0 == 0 { face } else { self.crossing.1 };
                self.crossing.0 += 1;
            }
        }
    }

    fn push_unless_degenerate(&mut self, triangle: [u32; 3]) {
        if has_area(triangle.map(|corner| self.positions[corner as usize])) {
            self.triangles.push(triangle);
        }
    }
}

/// Whether three finite points form a triangle with nonzero area. Computes in `f64`, where products of `f32`
/// coordinates neither overflow nor underflow, and are exact for nearby points.
pub(super) fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    (b - a).cross(c - a) != DVec3::ZERO
}

/// Removes unused vertices, whose coordinates may be arbitrary and would enlarge the bounds.
pub(super) fn drop_unused_vertices(mesh: &mut TriangleMesh) {
    let mut new_index = vec![u32::MAX; mesh.positions.len()];
    for &corner in mesh.triangles.as_flattened() {
        new_index[corner as usize] = 0;
    }
    if !new_index.contains(&u32::MAX) {
        return;
    }
    for (kept, index) in (0_u32..).zip(new_index.iter_mut().filter(|index| **index == 0)) {
        *index = kept;
    }
    retain_used(&mut mesh.positions, &new_index);
    retain_used(&mut mesh.normals, &new_index);
    retain_used(&mut mesh.normal_groups, &new_index);
    retain_used(&mut mesh.uvs, &new_index);
    retain_used(&mut mesh.second_uvs, &new_index);
    retain_used(&mut mesh.colors, &new_index);
    for corner in mesh.triangles.as_flattened_mut() {
        *corner = new_index[*corner as usize];
    }
}

fn retain_used<T>(values: &mut Vec<T>, new_index: &[u32]) {
    let mut indices = new_index.iter();
    values.retain(|_| indices.next().is_some_and(|index| *index != u32::MAX));
}

fn normalize_and_complete_normals(mesh: &mut TriangleMesh, token: &CancelToken) -> Result<(), Canceled> {
    for normal in &mut mesh.normals {
        *normal = normal.as_dvec3().try_normalize().map_or(Vec3::ZERO, |unit| unit.as_vec3());
    }
    if mesh.normals.iter().all(|normal| *normal == Vec3::ZERO) {
        mesh.normals = Vec::new();
    } else if mesh.normals.contains(&Vec3::ZERO) {
        fill_missing_normals(mesh, token)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::expect_rejection;
    use crate::assets::read::Monitor;
    use crate::control::ignore_progress;
    use std::path::Path;

    fn assembled(parsed: ParsedMesh) -> Result<LoadedMesh, AssetError> {
        let token = CancelToken::new();
        let monitor = Monitor { progress: &ignore_progress, token: &token };
        assemble(&MeshFileBytes { path: Path::new("a.off"), bytes: &[], monitor }, parsed)
    }

    fn faces(list: &[&[u32]]) -> Faces {
        let mut faces = Faces::default();
        for face in list {
            face.iter().for_each(|&corner| faces.push_corner(corner));
            faces.end_face(face.len());
        }
        faces
    }

    fn exact(positions: &[Vec3]) -> Vec<DVec3> {
        positions.iter().map(|position| position.as_dvec3()).collect()
    }

    const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

    #[test]
    fn arities_include_triangles_before_a_polygon() {
        let faces = faces(&[&[0, 1, 2], &[0, 2, 3], &[0, 1, 2, 3], &[0, 1, 2]]);
        assert_eq!((faces.len(), faces.arities), (4, vec![3, 3, 4, 3]));
    }

    #[test]
    fn dropping_faces_keeps_material_assignments() {
        let mut positions = SQUARE.to_vec();
        positions.extend([Vec3::X, Vec3::X * 2.0, Vec3::new(f32::NAN, 0.0, 0.0), Vec3::splat(9.0)]);
        let list: [&[u32]; 7] =
            [&[0, 1, 4], &[0, 1, 5], &[0, 1, 6], &[0, 1, 2, 3], &[0, 1], &[1, 4, 2, 3], &[0, 0, 0, 0]];
        let face_materials = vec![0, 1, 2, 3, 4, 5, 6];
        let positions = exact(&positions);
        let parsed = ParsedMesh { positions, faces: faces(&list), face_materials, ..ParsedMesh::default() };
        let loaded = assembled(parsed).expect("valid faces");
        assert_eq!(loaded.dropped, DroppedFaces { non_finite: 1, degenerate: 4 });
        assert_eq!(loaded.mesh.materials, [3, 3, 5]);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3], [1, 2, 3]]);
        assert_eq!(loaded.mesh.positions, SQUARE);
    }

    #[test]
    fn huge_and_tiny_triangles_have_area() {
        for scale in [f32::MAX / 2.0, f32::MIN_POSITIVE / 1024.0] {
            let positions = exact(&[Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale]);
            let parsed = ParsedMesh { positions, faces: faces(&[&[0, 1, 2]]), ..ParsedMesh::default() };
            assert_eq!(assembled(parsed).expect("has area").mesh.triangles.len(), 1);
        }
    }

    #[test]
    fn far_positions_keep_their_precision() {
        let far = DVec3::new(1e8, -3e7, 5e5);
        let mut positions: Vec<DVec3> = exact(&SQUARE).into_iter().map(|corner| corner + far).collect();
        // Unused positions and positions too large for `f32` do not affect the origin.
        positions.extend([DVec3::splat(1e30), DVec3::splat(1e39)]);
        let parsed = ParsedMesh {
            positions,
            faces: faces(&[&[0, 1, 2], &[0, 2, 3], &[0, 1, 5]]),
            ..ParsedMesh::default()
        };
        let loaded = assembled(parsed).expect("two valid faces");
        assert_eq!(loaded.dropped, DroppedFaces { non_finite: 1, degenerate: 0 });
        let mesh = loaded.mesh;
        let places: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3() + mesh.origin).collect();
        assert_eq!(places, exact(&SQUARE).into_iter().map(|corner| corner + far).collect::<Vec<_>>());
    }

    #[test]
    fn too_many_triangles_are_rejected() {
        let token = CancelToken::new();
        let monitor = Monitor { progress: &ignore_progress, token: &token };
        let source = MeshFileBytes { path: Path::new("a.off"), bytes: &[], monitor };
        for list in [&[&[0, 1, 2][..], &[0, 2, 3]][..], &[&[0, 1, 2, 3]]] {
            assert!(FaceTriangulator::new(&SQUARE, &[], 2).add_all_faces(&source, &faces(list)).is_ok());
            let result = FaceTriangulator::new(&SQUARE, &[], 1).add_all_faces(&source, &faces(list));
            assert_eq!(expect_rejection(result), (None, super::too_many_triangles_message(1)));
        }
    }

    #[test]
    fn self_intersecting_faces_are_counted() {
        let positions = exact(&[Vec3::ZERO, Vec3::X * 3.0, Vec3::Y, Vec3::new(3.0, 2.0, 0.0)]);
        let warnings = |list: &[&[u32]]| {
            let parsed =
                ParsedMesh { positions: positions.clone(), faces: faces(list), ..ParsedMesh::default() };
            assembled(parsed).expect("has area").warnings
        };
        assert!(warnings(&[&[0, 1, 3, 2]]).is_empty());
        assert_eq!(
            warnings(&[&[0, 1, 2], &[0, 1, 2, 3]]),
            Vec::from_iter(self_intersection_warning(1, 1, |_| None))
        );
        assert_eq!(
            warnings(&[&[0, 1, 2, 3], &[0, 1, 3, 2], &[2, 3, 0, 1]]),
            Vec::from_iter(self_intersection_warning(2, 0, |_| None))
        );
    }

    #[test]
    fn unusable_faces_are_counted_by_reason() {
        let positions = exact(&[Vec3::ZERO, Vec3::X, Vec3::X, Vec3::splat(f32::INFINITY)]);
        let parsed =
            ParsedMesh { positions, faces: faces(&[&[0, 1, 2], &[0, 1, 3]]), ..ParsedMesh::default() };
        let dropped = DroppedFaces { non_finite: 1, degenerate: 1 };
        assert_eq!(expect_rejection(assembled(parsed)).1, no_usable_face_message(2, dropped));
        assert_eq!(expect_rejection(assembled(ParsedMesh::default())).1, NO_FACES);
    }

    #[test]
    fn normals_are_normalized_and_completed() {
        let normals = vec![Vec3::Z * 1e30, Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0), Vec3::NEG_Z * 1e-30];
        let parsed = ParsedMesh {
            positions: exact(&SQUARE),
            normals,
            uvs: vec![Vec2::ONE, Vec2::NAN, Vec2::X, Vec2::Y],
            faces: faces(&[&[0, 1, 2, 3]]),
            ..ParsedMesh::default()
        };
        let LoadedMesh { mesh, warnings, .. } = assembled(parsed).expect("good");
        assert_eq!(
            warnings,
            [NON_FINITE_UVS, NON_FINITE_NORMALS].map(|words| format!("{} {words}", face_label(0, None)))
        );
        assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::NEG_Z]);
        assert_eq!(mesh.uvs[1], Vec2::ZERO);
    }

    #[test]
    fn index_errors_include_the_face() {
        let parsed = ParsedMesh {
            positions: exact(&SQUARE),
            faces: faces(&[&[0, 1, 2], &[0, 1, 4]]),
            ..ParsedMesh::default()
        };
        assert_eq!(expect_rejection(assembled(parsed)), (None, index_out_of_range_message(2)));
    }
}
