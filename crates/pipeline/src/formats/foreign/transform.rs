//! Transforms in foreign scenes, and the scene keys for them.

use crate::math::{DMat3, DMat4, DVec3};
use crate::scene::SceneDocumentValue;

/// Rotation by `degrees` about an axis: cos θ·I + sin θ·\[a\]ₓ + (1 − cos θ)·a·aᵀ. The axis is not
/// normalized; unless it has unit length, the result is not a rotation.
pub(crate) fn rotation_about_raw_axis(axis: DVec3, degrees: f64) -> DMat4 {
    let (sine, cosine) = sin_cos_degrees(degrees);
    let cross = DMat3::from_cols(
        DVec3::new(0.0, axis.z, -axis.y),
        DVec3::new(-axis.z, 0.0, axis.x),
        DVec3::new(axis.y, -axis.x, 0.0),
    );
    let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    DMat4::from_mat3(DMat3::IDENTITY * cosine + cross * sine + outer * (1.0 - cosine))
}

/// Sine and cosine of an angle in degrees, exact for multiples of 90.
pub(crate) fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    let turn = degrees.rem_euclid(360.0);
    match turn {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => libm::sincos(turn.to_radians()),
    }
}

/// Value of the `matrix` key of a shape or instance: 16 numbers in row-major order.
pub(crate) fn matrix_value(matrix: &DMat4) -> SceneDocumentValue {
    let rows = matrix.transpose().to_cols_array();
    rows.map(zero_if_negligible).into()
}

/// Replaces numbers that are only rounding errors (relative to 1) with 0.
fn zero_if_negligible(number: f64) -> f64 {
    if number.abs() < 1e-14 { 0.0 } else { number }
}

/// The linear part of an affine matrix.
pub(crate) fn linear_part(matrix: &DMat4) -> DMat3 {
    DMat3::from_cols(matrix.x_axis.truncate(), matrix.y_axis.truncate(), matrix.z_axis.truncate())
}

/// Whether a matrix is affine, invertible and finite.
pub(crate) fn is_invertible_affine(matrix: &DMat4) -> bool {
    let last = matrix.row(3);
    let determinant = linear_part(matrix).determinant();
    matrix.is_finite()
        && last.to_array() == [0.0, 0.0, 0.0, 1.0]
        && determinant != 0.0
        && determinant.is_finite()
}

/// Returns the positive scale factor of a matrix that combines a rotation or reflection with a uniform scale,
/// or `None` for other matrices.
pub(crate) fn similarity_scale(matrix: &DMat4) -> Option<f64> {
    let linear = linear_part(matrix);
    let product = linear.transpose() * linear;
    let scale = product.x_axis.x;
    let error = (product - DMat3::from_diagonal(DVec3::splat(scale))).to_cols_array();
    (scale > 0.0 && error.iter().all(|entry| entry.abs() <= 1e-9 * scale)).then(|| scale.sqrt())
}

/// Whether a matrix reverses handedness.
pub(crate) fn is_mirroring(matrix: &DMat4) -> bool {
    linear_part(matrix).determinant() < 0.0
}

/// Camera-to-world matrix of a camera at `origin` that looks at `target`. x points to the left of the image,
/// y up and z forward. Returns `None` if `origin`, `target` and `up` do not define an orientation.
pub(crate) fn look_at_with_x_left(origin: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let forward = (target - origin).try_normalize()?;
    let left = up.cross(forward).try_normalize()?;
    let up = forward.cross(left);
    Some(DMat4::from_cols(left.extend(0.0), up.extend(0.0), forward.extend(0.0), origin.extend(1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_axis_shears_unless_normalized() {
        let unit = rotation_about_raw_axis(DVec3::Z, 90.0);
        assert_eq!(unit.transform_vector3(DVec3::X), DVec3::Y);
        assert_eq!(similarity_scale(&unit), Some(1.0));
        let raw = rotation_about_raw_axis(DVec3::new(0.0, 1.0, 1.0), 90.0);
        assert_eq!(similarity_scale(&raw), None);
        assert_eq!(raw.transform_vector3(DVec3::X), DVec3::new(0.0, 1.0, -1.0));
    }

    #[test]
    fn look_at_has_x_on_the_left() {
        let camera = look_at_with_x_left(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).expect("a camera");
        assert_eq!(camera.transform_vector3(DVec3::X), DVec3::NEG_X);
        assert!(!is_mirroring(&camera));
        assert!(look_at_with_x_left(DVec3::ZERO, DVec3::Y, DVec3::Y).is_none());
    }

    #[test]
    fn matrix_is_written_row_by_row() {
        let moved = DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0));
        let rows = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0];
        assert_eq!(matrix_value(&moved), rows.into());
        assert!(is_invertible_affine(&moved) && !is_invertible_affine(&DMat4::ZERO));
    }
}
