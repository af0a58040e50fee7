//! Converts grids of signed distances (`sdfgrid`) to meshes.
//!
//! Mitsuba interpolates the distances trilinearly. Every voxel with a sign change is split into cells, and
//! every cell into six tetrahedra, whose edges meet the surface at the roots of the interpolant.

use super::graph::PluginInstance;
use super::material_key::UvFlips;
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use crate::formats::foreign::meshes::MeshData;
use crate::math::{DVec2, DVec3};

/// Maximum size of a grid.
const MAX_BYTES: u64 = 256 << 20;
/// Cells along an edge of a voxel.
const CELLS: u32 = 3;
/// Maximum number of triangles.
const MAX_TRIANGLES: usize = 20_000_000;

/// Corners of the six tetrahedra of a cell. The bits of a corner are its x, y and z.
const TETRAHEDRA: [[u32; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Signed distances at the points of a grid over the unit cube. x varies fastest.
#[derive(Debug, PartialEq)]
struct DistanceGrid {
    size: [usize; 3],
    values: Vec<f32>,
}

/// The offset of a corner.
fn corner_offset(corner: u32) -> DVec3 {
    DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2 & 1))
}

impl DistanceGrid {
    /// Parses a file of Mitsuba's volume format, version 3, with one channel of 32-bit floats.
    fn parse(bytes: &[u8]) -> Option<Self> {
        /// Magic, version, type, size, channels and bounds.
        const HEADER: usize = 48;
        let (header, data) = bytes.split_at_checked(HEADER)?;
        let word = |index: usize| -> Option<usize> {
            Some(u32::from_le_bytes(*header.get(4 * index..)?.first_chunk()?) as usize)
        };
        let size = [word(2)?, word(3)?, word(4)?];
        let is_supported = header.starts_with(b"VOL\x03") && word(1)? == 1 && word(5)? == 1;
        if !is_supported || size.iter().any(|size| !(2..=1 << 12).contains(size)) {
            return None;
        }
        let count = size.iter().product::<usize>();
        let values: Vec<f32> = data
            .chunks_exact(4)
            .filter_map(|bytes| bytes.try_into().ok().map(f32::from_le_bytes))
            .take(count)
            .collect();
        (values.len() == count && values.iter().all(|value| value.is_finite()))
            .then_some(Self { size, values })
    }

    /// The value at a voxel corner, in voxels.
    fn value_at_voxel_corner(&self, at: DVec3) -> f64 {
        let [x, y, z] = at.to_array().map(|index| index as usize);
        let [width, height, _] = self.size;
        f64::from(self.values[x + width * (y + height * z)])
    }

    /// Values at the corners of a voxel.
    fn corners(&self, voxel: DVec3) -> [f64; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| self.value_at_voxel_corner(voxel + corner_offset(corner)))
    }

    /// Number of voxels per axis.
    fn voxels_per_axis(&self) -> DVec3 {
        DVec3::from(self.size.map(|size| size as f64)) - DVec3::ONE
    }

    /// Mitsuba's smooth normal: the blend of the normals of the eight voxels around the nearest point of the
    /// grid, after Hansson-Söderlund et al., Ray Tracing of Signed Distance Function Grids, JCGT 11(3), 2022.
    /// `at` is in voxels.
    fn smooth_normal(&self, at: DVec3) -> DVec3 {
        let first = at.round() - DVec3::ONE;
        let weight = at - first - DVec3::splat(0.5);
        let mut sum = DVec3::ZERO;
        for corner in 0..8 {
            let offset = corner_offset(corner);
            let voxel = first + offset;
            let last = self.voxels_per_axis() - DVec3::ONE;
            let inside = voxel.clamp(DVec3::ZERO, last);
            let parts = offset * weight + (DVec3::ONE - offset) * (DVec3::ONE - weight);
            let gradient = gradient(&self.corners(inside), at - inside) * self.voxels_per_axis();
            sum += gradient.normalize_or_zero() * parts.element_product();
        }
        sum.normalize_or(DVec3::Z)
    }

    /// The surface in the unit cube. Returns `None` if it has too many triangles.
    fn surface(&self, is_smooth: bool) -> Option<MeshData> {
        let mut mesh = MeshData::default();
        let [width, height, depth] = self.size.map(|size| size - 1);
        for z in 0..depth {
            for y in 0..height {
                for x in 0..width {
                    let voxel = DVec3::from([x, y, z].map(|index| index as f64));
                    let corners = self.corners(voxel);
                    let is_crossed =
                        corners.iter().any(|value| *value >= 0.0) && corners.iter().any(|value| *value < 0.0);
                    if is_crossed {
                        self.add_voxel(&mut mesh, voxel, &corners, is_smooth);
                    }
                    if mesh.triangles.len() > MAX_TRIANGLES {
                        return None;
                    }
                }
            }
        }
        Some(mesh)
    }

    fn add_voxel(&self, mesh: &mut MeshData, voxel: DVec3, corners: &[f64; 8], is_smooth: bool) {
        let scale = self.voxels_per_axis();
        for cell in 0..CELLS.pow(3) {
            let cell = [cell % CELLS, cell / CELLS % CELLS, cell / (CELLS * CELLS)];
            let cell = DVec3::from(cell.map(f64::from));
            for tetrahedron in TETRAHEDRA {
                let points = tetrahedron.map(|corner| (cell + corner_offset(corner)) / f64::from(CELLS));
                for triangle in tetrahedron_surface(&points, corners) {
                    let first = mesh.positions.len() as u32;
                    for at in triangle {
                        let place = voxel + at;
                        let normal = if is_smooth {
                            self.smooth_normal(place)
                        } else {
                            (gradient(corners, at) * scale).normalize_or(DVec3::Z)
                        };
                        mesh.positions.push(place / scale);
                        mesh.normals.push(normal);
                        // Mitsuba's grids have no texture coordinates.
                        mesh.uvs.push(DVec2::ZERO);
                    }
                    mesh.triangles.push([first, first + 1, first + 2]);
                }
            }
        }
    }
}

/// Trilinear interpolation in a voxel.
fn interpolate_trilinearly(corners: &[f64; 8], at: DVec3) -> f64 {
    let weight = |corner: u32| {
        let offset = corner_offset(corner);
        (offset * at + (DVec3::ONE - offset) * (DVec3::ONE - at)).element_product()
    };
    (0..8).map(|corner| weight(corner) * corners[corner as usize]).sum()
}

/// Gradient of the trilinear interpolation in a voxel, in voxels.
fn gradient(corners: &[f64; 8], at: DVec3) -> DVec3 {
    let along = |axis: usize| {
        let (mut low, mut high) = (at, at);
        (low[axis], high[axis]) = (0.0, 1.0);
        interpolate_trilinearly(corners, high) - interpolate_trilinearly(corners, low)
    };
    DVec3::new(along(0), along(1), along(2))
}

/// The root of the interpolation between two points with values of different sign.
fn root_between(corners: &[f64; 8], mut inside: DVec3, mut outside: DVec3) -> DVec3 {
    for _ in 0..24 {
        let middle = (inside + outside) / 2.0;
        *(if interpolate_trilinearly(corners, middle) < 0.0 { &mut inside } else { &mut outside }) = middle;
    }
    (inside + outside) / 2.0
}

/// The triangles of the surface in a tetrahedron.
fn tetrahedron_surface(points: &[DVec3; 4], corners: &[f64; 8]) -> Vec<[DVec3; 3]> {
    let (mut inside, mut outside) = (Vec::new(), Vec::new());
    for point in points {
        (if interpolate_trilinearly(corners, *point) < 0.0 { &mut inside } else { &mut outside })
            .push(*point);
    }
    let root = |a: usize, b: usize| root_between(corners, inside[a], outside[b]);
    match (inside.len(), outside.len()) {
        (1, 3) => vec![[root(0, 0), root(0, 1), root(0, 2)]],
        (3, 1) => vec![[root(0, 0), root(1, 0), root(2, 0)]],
        (2, 2) => {
            let [a, b, c, d] = [root(0, 0), root(0, 1), root(1, 1), root(1, 0)];
            vec![[a, b, c], [a, c, d]]
        }
        _ => Vec::new(),
    }
}

impl<'a> SceneReader<'a> {
    /// Adds a grid of signed distances as a mesh. Returns whether anything was added.
    pub(super) fn add_distance_grid(&mut self, object: &'a PluginInstance, target: ShapeTarget<'_>) -> bool {
        let Some(matrix) = self.shape_transform(object) else { return false };
        let Some((name, span)) = self.text(object, "filename") else {
            self.report_error(object.span.clone(), "the grid needs `filename`", None);
            return false;
        };
        let is_smooth = match self.text(object, "normals") {
            None | Some(("smooth", _)) => true,
            Some(("analytic", _)) => false,
            Some((_, span)) => {
                self.report_error(span, "`normals` must be smooth or analytic", None);
                return false;
            }
        };
        let Some(path) = self.asset_path(name, &span, "grid") else { return false };
        let Some(material) = self.shape_material(object, UvFlips::default()) else { return false };
        let bytes = self.read_watched_file(&path, MAX_BYTES);
        let Some(grid) = bytes.and_then(|bytes| DistanceGrid::parse(&bytes)) else {
            let help = "glimt reads version 3 of the format with one channel of 32-bit floats".to_owned();
            self.report_error(span, "the grid cannot be read", Some(help));
            return false;
        };
        let Some(mut mesh) = grid.surface(is_smooth) else {
            self.refuse(object, "grids with so large surfaces");
            return false;
        };
        mesh.orient_triangles_like_pbrt(false);
        self.notes.note("`sdfgrid`", "a mesh of triangles a third of a voxel wide", object.span.clone());
        self.add_generated_mesh(mesh, object, target, material, &matrix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file of a grid of 9 × 8 × 7 points.
    fn file(distance: impl Fn(DVec3) -> f64) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        [1_u32, 9, 8, 7, 1].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        bytes.extend([0; 24]);
        for index in 0..9 * 8 * 7 {
            let at = [index % 9, index / 9 % 8, index / 72].map(f64::from);
            let at = DVec3::from(at) / DVec3::new(8.0, 7.0, 6.0);
            bytes.extend((distance(at) as f32).to_le_bytes());
        }
        bytes
    }

    #[test]
    fn planes_are_exact_and_face_outward() {
        let normal = DVec3::new(1.0, 2.0, 3.0).normalize();
        let grid = DistanceGrid::parse(&file(|at| (at - DVec3::splat(0.5)).dot(normal))).expect("a grid");
        for is_smooth in [true, false] {
            let mesh = grid.surface(is_smooth).expect("a mesh");
            assert!(!mesh.triangles.is_empty());
            for (at, found) in mesh.positions.iter().zip(&mesh.normals) {
                assert!((*at - DVec3::splat(0.5)).dot(normal).abs() < 1e-6, "{at}");
                assert!((*found - normal).length() < 1e-5, "{found}");
            }
        }
    }

    #[test]
    fn surfaces_of_spheres_are_closed() {
        let grid = DistanceGrid::parse(&file(|at| (at - DVec3::splat(0.5)).length() - 0.4)).expect("a grid");
        let mut mesh = grid.surface(true).expect("a mesh");
        mesh.orient_triangles_like_pbrt(false);
        let corner = |vertex: u32| mesh.positions[vertex as usize];
        // The volume of a closed surface by the divergence theorem; a voxel is about 0.14 wide.
        let volume: f64 = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.map(corner))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        let moved: f64 = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.map(|vertex| corner(vertex) + DVec3::splat(7.0)))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum();
        assert!((volume - moved).abs() < 1e-6, "{volume} {moved}");
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 0.4_f64.powi(3);
        // The interpolation flattens the sphere by about 2 · 0.14² / (8 · 0.4).
        assert!((volume / expected - 1.0).abs() < 0.08, "{volume}");
    }

    #[test]
    fn other_files_are_rejected() {
        let bytes = file(|at| at.x - 0.5);
        assert!(DistanceGrid::parse(&bytes[..bytes.len() - 1]).is_none());
        let mut wrong = bytes;
        wrong[3] = 2;
        assert!(DistanceGrid::parse(&wrong).is_none());
    }
}
