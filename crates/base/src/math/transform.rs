//! Affine transforms in double precision, stored with their inverses.

use glam::{DMat3, DVec3, Vec3Swizzles as _};

/// An affine map `x ↦ linear·x + translation` with its inverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Linear part.
    pub linear: DMat3,
    /// Translation.
    pub translation: DVec3,
    /// Inverse of the linear part.
    pub inverse_linear: DMat3,
}

impl Transform {
    /// The identity transform.
    pub const IDENTITY: Self =
        Self { linear: DMat3::IDENTITY, translation: DVec3::ZERO, inverse_linear: DMat3::IDENTITY };

    /// Scales, rotates about x, then y, then z (in degrees), then translates. Scales must not be 0.
    pub fn scale_rotate_translate(scale: DVec3, degrees: DVec3, translation: DVec3) -> Self {
        let rotation = rotation_xyz(degrees);
        Self {
            linear: rotation * DMat3::from_diagonal(scale),
            translation,
            inverse_linear: DMat3::from_diagonal(scale.recip()) * rotation.transpose(),
        }
    }

    /// Applies an invertible linear map, then translates.
    pub fn from_mat3_translation(linear: DMat3, translation: DVec3) -> Self {
        Self { linear, translation, inverse_linear: linear.inverse() }
    }

    /// Rewrites the map for input coordinates relative to `inside` and output coordinates relative to
    /// `outside`.
    #[inline]
    pub fn relative_to_origins(self, inside: DVec3, outside: DVec3) -> Self {
        Self { translation: self.translation + self.linear * inside - outside, ..self }
    }

    /// Transforms a point.
    #[inline]
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.linear * p + self.translation
    }

    /// Transforms a direction.
    #[inline]
    pub fn vector(&self, v: DVec3) -> DVec3 {
        self.linear * v
    }

    /// Transforms upper bounds on the magnitudes of a vector's components.
    pub fn transform_abs_bound(&self, reach: DVec3) -> DVec3 {
        let DMat3 { x_axis, y_axis, z_axis } = self.linear;
        x_axis.abs() * reach.x + y_axis.abs() * reach.y + z_axis.abs() * reach.z
    }

    /// Transforms a normal with the inverse transpose, without normalizing it.
    #[inline]
    pub fn normal(&self, n: DVec3) -> DVec3 {
        self.inverse_linear.transpose() * n
    }

    /// Applies the inverse to a point.
    #[inline]
    pub fn inverse_point(&self, p: DVec3) -> DVec3 {
        self.inverse_linear * (p - self.translation)
    }

    /// Applies the inverse to a direction.
    #[inline]
    pub fn inverse_vector(&self, v: DVec3) -> DVec3 {
        self.inverse_linear * v
    }

    /// Upper bound on the factor by which the inverse stretches vectors.
    pub fn max_inverse_stretch(&self) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.inverse_linear.transpose();
        let lengths = DVec3::new(x_axis.length(), y_axis.length(), z_axis.length());
        // If the rows are orthogonal, as in a scale followed by a rotation, the longest row is exact.
        let products = DVec3::new(x_axis.dot(y_axis), y_axis.dot(z_axis), z_axis.dot(x_axis));
        let is_straight = products.abs().cmple(lengths * lengths.yzx() * 1e-9).all();
        if is_straight { lengths.max_element() * (1.0 + 1e-8) } else { lengths.length() }
    }

    /// Whether the map reverses handedness.
    pub fn flips_handedness(&self) -> bool {
        self.linear.determinant() < 0.0
    }
}

/// Sine and cosine of an angle in degrees, exact for multiples of 90°.
pub fn sin_cos_degrees(angle: f64) -> (f64, f64) {
    let quarters = angle / 90.0;
    if quarters == quarters.round() {
        match (quarters.rem_euclid(4.0)) as i64 {
            0 => (0.0, 1.0),
            1 => (1.0, 0.0),
            2 => (0.0, -1.0),
            _ => (-1.0, 0.0),
        }
    } else {
        libm::sincos(angle.to_radians())
    }
}

/// Rotation by `degrees.x` about x, then `degrees.y` about y, then `degrees.z` about z. Exact for multiples
/// of 90°.
pub fn rotation_xyz(degrees: DVec3) -> DMat3 {
    let exact = |axis: DVec3, angle: f64| {
        let (sin, cos) = sin_cos_degrees(angle);
        if axis.x > 0.0 {
            DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, cos, sin, 0.0, -sin, cos])
        } else if axis.y > 0.0 {
            DMat3::from_cols_array(&[cos, 0.0, -sin, 0.0, 1.0, 0.0, sin, 0.0, cos])
        } else {
            DMat3::from_cols_array(&[cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0])
        }
    };
    exact(DVec3::Z, degrees.z) * exact(DVec3::Y, degrees.y) * exact(DVec3::X, degrees.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::EulerRot;

    #[test]
    fn rotates_about_x_then_y_then_z() {
        let degrees = DVec3::new(31.0, -72.0, 155.0);
        let r = degrees * (std::f64::consts::PI / 180.0);
        let euler = DMat3::from_euler(EulerRot::ZYX, r.z, r.y, r.x);
        let ours = rotation_xyz(degrees);
        assert!((ours - euler).to_cols_array().iter().all(|d| d.abs() < 1e-14));
    }

    #[test]
    fn quarter_turns_are_exact() {
        let turned = rotation_xyz(DVec3::new(0.0, 0.0, 90.0)) * DVec3::X;
        assert_eq!(turned, DVec3::Y);
        assert_eq!(rotation_xyz(DVec3::new(-90.0, 450.0, 720.0)).determinant(), 1.0);
    }

    #[test]
    fn inverse_undoes_the_transform() {
        let t = Transform::scale_rotate_translate(
            DVec3::new(2.0, 0.5, -3.0),
            DVec3::new(10.0, 20.0, 30.0),
            DVec3::new(1e3, -5.0, 7.0),
        );
        let p = DVec3::new(0.3, -0.8, 12.0);
        assert!((t.inverse_point(t.point(p)) - p).length() < 1e-12);
        assert!(t.flips_handedness());
        assert!((t.max_inverse_stretch() - 2.0).abs() < 1e-6, "{}", t.max_inverse_stretch());
        let sheared = Transform {
            inverse_linear: DMat3::from_cols(DVec3::X, DVec3::new(3.0, 1.0, 0.0), DVec3::Z),
            ..t
        };
        assert!(sheared.max_inverse_stretch() >= 3.3027, "the bound is below the largest singular value");
        // A normal stays perpendicular to a transformed tangent.
        assert!(t.normal(DVec3::Y).dot(t.vector(DVec3::new(1.0, 0.0, 2.0))).abs() < 1e-12);
    }
}
