//! Places textured cylinders, and detects normals in mesh files.

use std::f64::consts::TAU;
use std::io::Read;
use std::path::Path;

use glimt_kernel::geometry::cylinder::Cylinder;

use super::textures::extension;
use super::values::perpendicular_up;
use crate::math::{DMat4, DVec3};

/// Returns the matrix that places the cylinder of radius 1 from the origin to (0, 0, 1) so that its texture
/// coordinate u follows Mitsuba's angle. Returns `None` if the ends coincide.
pub(super) fn cylinder_matrix(matrix: &DMat4, start: DVec3, end: DVec3, radius: f64) -> Option<DMat4> {
    let axis = end - start;
    let direction = axis.try_normalize()?;
    let across = perpendicular_up(direction);
    let along = direction.cross(across);
    let frame = DMat4::from_cols(
        (across * radius).extend(0.0),
        (along * radius).extend(0.0),
        axis.extend(0.0),
        start.extend(1.0),
    );
    // Rotate the cylinder so that glimt's u is 0 at angle 0. Mirror it if u runs in the opposite direction.
    let cylinder = Cylinder::new(DVec3::ZERO, DVec3::Z, 1.0, false);
    let u_at = |point: DVec3| cylinder.uv_at_point(point + DVec3::Z * 0.5).x;
    let (first, quarter) = (u_at(DVec3::X), u_at(DVec3::Y));
    let is_reversed = (quarter - first).rem_euclid(1.0) > 0.5;
    let turn = DMat4::from_rotation_z(TAU * if is_reversed { -first } else { first });
    let mirror = DMat4::from_scale(DVec3::new(1.0, if is_reversed { -1.0 } else { 1.0 }, 1.0));
    Some(*matrix * frame * mirror * turn)
}

/// Whether a mesh file has normals. Serialized and unreadable files are assumed to have them.
pub(super) fn has_normals(path: &Path) -> bool {
    const MAX_BYTES: u64 = 256 << 20;
    let Ok(file) = std::fs::File::open(path) else { return true };
    let mut bytes = Vec::new();
    if file.take(MAX_BYTES).read_to_end(&mut bytes).is_err() {
        return true;
    }
    let contains = |bytes: &[u8], word: &[u8]| bytes.windows(word.len()).any(|window| window == word);
    match extension(&path.to_string_lossy()).as_str() {
        "obj" => contains(&bytes, b"\nvn "),
        "ply" => {
            let end = bytes.windows(10).position(|window| window == b"end_header").unwrap_or(bytes.len());
            contains(&bytes[..end], b" nx")
        }
        "stl" => false,
        _ => true,
    }
}
