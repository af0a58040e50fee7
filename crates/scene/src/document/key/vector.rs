//! Reads vectors.

use super::super::context::Issue;
use super::KeyInTable;
use crate::math::limits::{MIN_LENGTH, is_nonzero_but_too_short, robust_length};
use crate::math::{DMat3, DVec3, Vec2};

/// Maximum deviation of the product of a rotation and its transpose from the identity. Some files write
/// rotations with only four decimals.
const ROTATION_TOLERANCE: f64 = 1e-3;

impl KeyInTable<'_> {
    /// Reads three numbers as a vector.
    pub(in super::super) fn vector(&self) -> Option<DVec3> {
        self.numbers("three numbers, [x, y, z]").map(DVec3::from_array)
    }

    /// Reads a direction of any nonzero length. Error messages call the shape or light `what`.
    pub(in super::super) fn nonzero_direction(&self, what: &str) -> Option<DVec3> {
        let direction = self.vector()?;
        if !self.check_vector_zero_or_long_enough(direction) {
            return None;
        }
        if direction == DVec3::ZERO {
            let issue = Issue::error(self.value_span()?, format!("the {what} has no direction"))
                .with_label(format!("`{}` has length 0", self.info.name))
                .with_help("use any nonzero vector, such as [0, 1, 0] for up");
            self.context.report(issue);
            return None;
        }
        Some(direction)
    }

    /// Checks that a vector is long enough to compute with, and reports an error if not. For vectors of
    /// length 0, the caller reports a more specific error.
    pub(in super::super) fn check_vector_zero_or_long_enough(&self, vector: DVec3) -> bool {
        let length = robust_length(vector);
        let Some(span) = self.value_span().filter(|_| is_nonzero_but_too_short(length)) else { return true };
        let issue = Issue::error(span, format!("`{}` must be more than {MIN_LENGTH:e} long", self.info.name));
        self.context.report(issue.with_label(format!("its length is {length:e}")));
        false
    }

    /// Checks that the points at the keys `self` and `other` are far enough apart to compute with, and
    /// reports an error if not. For equal points, the caller reports a more specific error.
    pub(in super::super) fn check_points_equal_or_far_apart(
        &self,
        from: DVec3,
        other: &Self,
        to: DVec3,
    ) -> bool {
        let distance = robust_length(to - from);
        let span = other.value_span().or(self.value_span());
        let Some(span) = span.filter(|_| is_nonzero_but_too_short(distance)) else { return true };
        let (first, second) = (self.info.name, other.info.name);
        let message = format!("`{first}` and `{second}` must be more than {MIN_LENGTH:e} apart");
        self.context.report(Issue::error(span, message).with_label(format!("they are {distance:e} apart")));
        false
    }

    /// Reads a rotation matrix of 9 or 16 numbers in row-major order, and orthonormalizes it to remove
    /// rounding errors.
    pub(in super::super) fn rotation(&self) -> Option<DMat3> {
        let is_4x4 = self.value?.as_array().is_some_and(|array| array.len() == 16);
        let expected = "9 or 16 numbers, row by row";
        let rows: [f64; 9] = if is_4x4 {
            let numbers: [f64; 16] = self.numbers(expected)?;
            let rest = [3, 7, 11, 12, 13, 14, 15].map(|place| numbers[place]);
            if rest != [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
                self.report_not_a_rotation("the last row and the last column must be 0, 0, 0, 1");
                return None;
            }
            [0, 1, 2, 4, 5, 6, 8, 9, 10].map(|place| numbers[place])
        } else {
            self.numbers(expected)?
        };
        let matrix = DMat3::from_cols_array(&rows).transpose();
        let product = matrix * matrix.transpose() - DMat3::IDENTITY;
        let error = product.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
        if !(error <= ROTATION_TOLERANCE) {
            self.report_not_a_rotation("the rows must have length 1 and be perpendicular to each other");
            return None;
        }
        if matrix.determinant() < 0.0 {
            self.report_not_a_rotation("it is a reflection: its determinant is -1");
            return None;
        }
        let x = matrix.x_axis.normalize();
        let z = x.cross(matrix.y_axis).normalize();
        Some(DMat3::from_cols(x, z.cross(x), z))
    }

    fn report_not_a_rotation(&self, label: &str) {
        let span = self.value_span().unwrap_or_default();
        let issue = Issue::error(span, format!("`{}` must be a rotation", self.info.name)).with_label(label);
        self.context.report(issue.with_help("remove scaling, shearing, mirroring and translation"));
    }

    /// Reads a pair of numbers.
    pub(in super::super) fn number_pair(&self) -> Option<Vec2> {
        self.numbers("two numbers, [u, v]").map(|[u, v]: [f64; 2]| Vec2::new(u as f32, v as f32))
    }

    /// Reads scale factors: one number for all three axes, or three numbers.
    pub(in super::super) fn scale_factors(&self) -> Option<DVec3> {
        if self.value?.as_number().is_some() {
            return self.number().map(DVec3::splat);
        }
        self.numbers("a number, or three numbers [x, y, z]").map(DVec3::from_array)
    }
}
