//! From a parser's results to a mesh that keeps the invariants.

use rayon::prelude::*;

use super::normals::fill_missing_normals;
use super::parsed::{Faces, Parsed};
use super::polygon::triangulate;
use super::{Source, corners};
use crate::assets::{AssetError, Dropped, FileHash, LoadedMesh};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::mesh::TriangleMesh;
use crate::math::origin::origin_near;
use crate::math::{DVec3, Vec2, Vec3};

/// Faces between two polls of the token.
const BATCH: usize = 1 << 14;

/// Assembles a mesh: cuts polygons, drops bad faces, compacts the vertices, completes the normals.
pub(crate) fn assemble(source: &Source<'_>, parsed: Parsed) -> Result<LoadedMesh, AssetError> {
    assemble_text(source, parsed, |_| None)
}

/// [`assemble`] for a file with lines. `start_of` returns the offset of a face, counted from 0.
pub(super) fn assemble_text(
    source: &Source<'_>,
    mut parsed: Parsed,
    start_of: impl Fn(usize) -> Option<usize>,
) -> Result<LoadedMesh, AssetError> {
    corners::split(&mut parsed, source.watch.token)?;
    let Parsed {
        positions,
        normals,
        normal_groups,
        uvs,
        second_uvs,
        colors,
        mut faces,
        corner_uvs: _,
        corner_colors: _,
        has_corners_apart,
        face_materials,
        materials,
        mut warnings,
        material_warnings,
        companions,
        pictures,
    } = parsed;
    let (origin, positions) = around_origin(positions, &faces);
    if has_corners_apart {
        faces.join(&positions, source.watch.token)?;
    }
    let most_triangles = TriangleMesh::MOST_TRIANGLES as usize;
    let mut cutter = Cutter::new(&positions, &face_materials, most_triangles);
    cutter.cut_all(source, &faces)?;
    let Cutter { triangles, triangle_materials, dropped, crossing, .. } = cutter;
    let line_of = |face: usize| start_of(face).map(|start| source.line(start));
    warnings.extend(crossing_faces(crossing, line_of));
    if triangles.is_empty() {
        return Err(source.wrong(no_usable_face(faces.len(), dropped)));
    }
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
    complete_normals(&mut mesh, source.watch.token)?;
    let hash = FileHash::default();
    Ok(LoadedMesh { hash, mesh, materials, dropped, warnings, material_warnings, companions, pictures })
}

/// Positions from an origin near those that faces use. Numbers that no `f32` can hold become infinite.
fn around_origin(positions: Vec<DVec3>, faces: &Faces) -> (DVec3, Vec<Vec3>) {
    let least = DVec3::splat(f64::from(f32::MIN));
    let place = |corner: &u32| positions.get(*corner as usize).copied().unwrap_or(DVec3::NAN);
    let held = |place: &DVec3| place.cmpge(least).all() && place.cmple(-least).all();
    let none = || (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let both =
        |(min, max): (DVec3, DVec3), (least, greatest): (DVec3, DVec3)| (min.min(least), max.max(greatest));
    let places = faces.corners.par_iter().map(place).filter(held);
    let (min, max) = places.fold(none, |ends, place| both(ends, (place, place))).reduce(none, both);
    let origin = origin_near((min + max) * 0.5, (max - min).max_element() * 0.5);
    (origin, positions.into_par_iter().map(|place| (place - origin).as_vec3()).collect())
}

fn no_usable_face(faces: usize, dropped: Dropped) -> String {
    if faces == 0 {
        return "no usable face: the file has none".to_owned();
    }
    let Dropped { non_finite, degenerate } = dropped;
    format!(
        "no usable face: of {faces}, {non_finite} have a corner that is not finite and {degenerate} have no area"
    )
}

/// The warning of polygons that cross themselves.
fn crossing_faces((count, first): (u64, usize), line_of: impl Fn(usize) -> Option<usize>) -> Option<String> {
    let first_face = || match line_of(first) {
        Some(line) => format!("line {line}: face {}", first + 1),
        None => format!("face {}", first + 1),
    };
    match count {
        0 => None,
        1 => Some(format!("{} crosses itself: its triangles may overlap", first_face())),
        _ => Some(format!(
            "{} and {} more cross themselves: their triangles may overlap",
            first_face(),
            count - 1
        )),
    }
}

struct Cutter<'a> {
    positions: &'a [Vec3],
    materials: &'a [u32],
    most_triangles: usize,
    triangles: Vec<[u32; 3]>,
    triangle_materials: Vec<u32>,
    dropped: Dropped,
    /// Polygons that cross themselves: their number, and the first face.
    crossing: (u64, usize),
}

impl<'a> Cutter<'a> {
    fn new(positions: &'a [Vec3], materials: &'a [u32], most_triangles: usize) -> Self {
        let (triangles, triangle_materials) = Default::default();
        Self {
            positions,
            materials,
            most_triangles,
            triangles,
            triangle_materials,
            dropped: Dropped::default(),
            crossing: (0, 0),
        }
    }

    fn cut_all(&mut self, source: &Source<'_>, faces: &Faces) -> Result<(), AssetError> {
        if self.take_as_they_are(faces) {
            return Ok(());
        }
        self.triangles.reserve(faces.len());
        let mut from = 0;
        for face in 0..faces.len() {
            if face % BATCH == 0 {
                source.watch.token.check()?;
            }
            let arity = faces.arities.get(face).map_or(3, |arity| *arity as usize);
            let corners = &faces.corners[from..from + arity];
            from += arity;
            if corners.iter().any(|&corner| corner as usize >= self.positions.len()) {
                return Err(source.wrong(format!("face {}: an index is out of range", face + 1)));
            }
            self.cut(corners, face);
            if self.triangles.len() > self.most_triangles {
                let most = self.most_triangles;
                return Err(source.wrong(format!("more than {most} triangles; split it into several meshes")));
            }
            if let Some(&material) = self.materials.get(face) {
                self.triangle_materials.resize(self.triangles.len(), material);
            }
        }
        Ok(())
    }

    /// Takes all faces in parallel in the common case: triangles only, and all of them good. Returns whether it did.
    fn take_as_they_are(&mut self, faces: &Faces) -> bool {
        let (triangles, _) = faces.corners.as_chunks();
        let in_range = |corner: &u32| (*corner as usize) < self.positions.len();
        let good = |triangle: &[u32; 3]| {
            let points = || triangle.map(|corner| self.positions[corner as usize]);
            triangle.iter().all(in_range)
                && points().iter().all(|point| point.is_finite())
                && has_area(points())
        };
        let all = faces.arities.is_empty()
            && triangles.len() <= self.most_triangles
            && triangles.par_iter().all(good);
        if all {
            self.triangles = triangles.to_vec();
            self.triangle_materials = self.materials.to_vec();
        }
        all
    }

    /// Adds a face's triangles, or counts the reason why it has none.
    fn cut(&mut self, corners: &[u32], face: usize) {
        let before = self.triangles.len();
        if corners.iter().any(|&corner| !self.positions[corner as usize].is_finite()) {
            self.dropped.non_finite += 1;
            return;
        }
        match *corners {
            [a, b, c] => self.keep([a, b, c]),
            _ => self.cut_polygon(corners, face),
        }
        if self.triangles.len() == before {
            self.dropped.degenerate += 1;
        }
    }

    /// Cuts a polygon. It may touch itself at one place (a quad at a pole): repeated corners are dropped.
    fn cut_polygon(&mut self, corners: &[u32], face: usize) {
        let place = |corner: u32| self.positions[corner as usize];
        let mut distinct = corners.to_vec();
        distinct.dedup_by(|a, b| place(*a) == place(*b));
        while distinct.len() > 1 && place(distinct[0]) == place(distinct[distinct.len() - 1]) {
            distinct.pop();
        }
        if distinct.len() >= 3 {
            let points: Vec<Vec3> = distinct.iter().map(|&corner| place(corner)).collect();
            let before = self.triangles.len();
            let is_simple = triangulate(&points, |triangle| self.keep(triangle.map(|index| distinct[index])));
            if !is_simple && self.triangles.len() > before {
                self.crossing.1 = if self.crossing.0 == 0 { face } else { self.crossing.1 };
                self.crossing.0 += 1;
            }
        }
    }

    fn keep(&mut self, triangle: [u32; 3]) {
        if has_area(triangle.map(|corner| self.positions[corner as usize])) {
            self.triangles.push(triangle);
        }
    }
}

/// Whether three finite points span an area. In f64, f32 points neither overflow nor underflow, and the products of
/// nearby points are exact.
fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let [a, b, c] = [a, b, c].map(|point| point.as_dvec3());
    (b - a).cross(c - a) != DVec3::ZERO
}

/// Drops unused vertices: bounds are taken over all vertices, and a file may hold anything in those that it does not
/// use.
fn drop_unused_vertices(mesh: &mut TriangleMesh) {
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

fn complete_normals(mesh: &mut TriangleMesh, token: &CancelToken) -> Result<(), Cancelled> {
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
    use crate::assets::read::Watch;
    use crate::control::ignore_progress;
    use std::path::Path;

    fn assembled(parsed: Parsed) -> Result<LoadedMesh, AssetError> {
        let token = CancelToken::new();
        let watch = Watch { progress: &ignore_progress, token: &token };
        assemble(&Source { path: Path::new("a.off"), bytes: &[], watch }, parsed)
    }

    fn faces(list: &[&[u32]]) -> Faces {
        let mut faces = Faces::default();
        for face in list {
            face.iter().for_each(|&corner| faces.corner(corner));
            faces.close(face.len());
        }
        faces
    }

    fn exact(positions: &[Vec3]) -> Vec<DVec3> {
        positions.iter().map(|position| position.as_dvec3()).collect()
    }

    const SQUARE: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];

    #[test]
    fn arities_appear_with_the_first_other_polygon() {
        let faces = faces(&[&[0, 1, 2], &[0, 2, 3], &[0, 1, 2, 3], &[0, 1, 2]]);
        assert_eq!((faces.len(), faces.arities), (4, vec![3, 3, 4, 3]));
    }

    #[test]
    fn faces_without_area_are_counted_and_materials_stay_with_theirs() {
        let mut positions = SQUARE.to_vec();
        positions.extend([Vec3::X, Vec3::X * 2.0, Vec3::new(f32::NAN, 0.0, 0.0), Vec3::splat(9.0)]);
        let list: [&[u32]; 7] =
            [&[0, 1, 4], &[0, 1, 5], &[0, 1, 6], &[0, 1, 2, 3], &[0, 1], &[1, 4, 2, 3], &[0, 0, 0, 0]];
        let face_materials = vec![0, 1, 2, 3, 4, 5, 6];
        let positions = exact(&positions);
        let parsed = Parsed { positions, faces: faces(&list), face_materials, ..Parsed::default() };
        let loaded = assembled(parsed).expect("some faces are good");
        assert_eq!(loaded.dropped, Dropped { non_finite: 1, degenerate: 4 });
        assert_eq!(loaded.mesh.materials, [3, 3, 5]);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3], [1, 2, 3]]);
        assert_eq!(loaded.mesh.positions, SQUARE);
    }

    #[test]
    fn the_extremes_of_f32_have_area() {
        for scale in [f32::MAX / 2.0, f32::MIN_POSITIVE / 1024.0] {
            let positions = exact(&[Vec3::ZERO, Vec3::X * scale, Vec3::Y * scale]);
            let parsed = Parsed { positions, faces: faces(&[&[0, 1, 2]]), ..Parsed::default() };
            assert_eq!(assembled(parsed).expect("has area").mesh.triangles.len(), 1);
        }
    }

    #[test]
    fn what_is_far_from_the_origin_keeps_its_digits() {
        let far = DVec3::new(1e8, -3e7, 5e5);
        let mut positions: Vec<DVec3> = exact(&SQUARE).into_iter().map(|corner| corner + far).collect();
        // Positions that no face uses, or no `f32` holds, do not move the origin.
        positions.extend([DVec3::splat(1e30), DVec3::splat(1e39)]);
        let parsed =
            Parsed { positions, faces: faces(&[&[0, 1, 2], &[0, 2, 3], &[0, 1, 5]]), ..Parsed::default() };
        let loaded = assembled(parsed).expect("two are good");
        assert_eq!(loaded.dropped, Dropped { non_finite: 1, degenerate: 0 });
        let mesh = loaded.mesh;
        let places: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3() + mesh.origin).collect();
        assert_eq!(places, exact(&SQUARE).into_iter().map(|corner| corner + far).collect::<Vec<_>>());
    }

    #[test]
    fn more_triangles_than_trees_can_hold_are_refused_with_their_number() {
        let token = CancelToken::new();
        let watch = Watch { progress: &ignore_progress, token: &token };
        let source = Source { path: Path::new("a.off"), bytes: &[], watch };
        for list in [&[&[0, 1, 2][..], &[0, 2, 3]][..], &[&[0, 1, 2, 3]]] {
            assert!(Cutter::new(&SQUARE, &[], 2).cut_all(&source, &faces(list)).is_ok());
            let error = Cutter::new(&SQUARE, &[], 1).cut_all(&source, &faces(list)).expect_err("two");
            assert_eq!(error.to_string(), "a.off: more than 1 triangles; split it into several meshes");
        }
    }

    #[test]
    fn faces_that_cross_themselves_are_counted() {
        let positions = exact(&[Vec3::ZERO, Vec3::X * 3.0, Vec3::Y, Vec3::new(3.0, 2.0, 0.0)]);
        let warnings = |list: &[&[u32]]| {
            let parsed = Parsed { positions: positions.clone(), faces: faces(list), ..Parsed::default() };
            assembled(parsed).expect("has area").warnings
        };
        assert!(warnings(&[&[0, 1, 3, 2]]).is_empty());
        assert_eq!(
            warnings(&[&[0, 1, 2], &[0, 1, 2, 3]]),
            ["face 2 crosses itself: its triangles may overlap"]
        );
        assert_eq!(
            warnings(&[&[0, 1, 2, 3], &[0, 1, 3, 2], &[2, 3, 0, 1]]),
            ["face 1 and 1 more cross themselves: their triangles may overlap"]
        );
    }

    #[test]
    fn no_usable_face_says_why() {
        let positions = exact(&[Vec3::ZERO, Vec3::X, Vec3::X, Vec3::splat(f32::INFINITY)]);
        let parsed = Parsed { positions, faces: faces(&[&[0, 1, 2], &[0, 1, 3]]), ..Parsed::default() };
        let says = assembled(parsed).expect_err("nothing left").to_string();
        assert_eq!(
            says,
            "a.off: no usable face: of 2, 1 have a corner that is not finite and 1 have no area"
        );
        assert!(assembled(Parsed::default()).expect_err("empty").to_string().contains("no usable face"));
    }

    #[test]
    fn normals_are_made_unit_and_missing_ones_made() {
        let normals = vec![Vec3::Z * 1e30, Vec3::ZERO, Vec3::new(0.0, f32::NAN, 0.0), Vec3::NEG_Z * 1e-30];
        let parsed = Parsed {
            positions: exact(&SQUARE),
            normals,
            uvs: vec![Vec2::ONE, Vec2::NAN, Vec2::X, Vec2::Y],
            faces: faces(&[&[0, 1, 2, 3]]),
            ..Parsed::default()
        };
        let mesh = assembled(parsed).expect("good").mesh;
        assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::Z, Vec3::NEG_Z]);
        assert_eq!(mesh.uvs[1], Vec2::ZERO);
    }

    #[test]
    fn an_index_out_of_range_names_the_face() {
        let parsed = Parsed {
            positions: exact(&SQUARE),
            faces: faces(&[&[0, 1, 2], &[0, 1, 4]]),
            ..Parsed::default()
        };
        assert!(assembled(parsed).expect_err("refused").to_string().contains("face 2"));
    }
}
