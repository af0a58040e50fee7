//! Reads vectors.

use super::super::context::Issue;
use super::KeyInTable;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};
use crate::math::{DVec3, Vec2};

impl KeyInTable<'_> {
    /// Reads three numbers as a vector.
    pub(in super::super) fn vector(&self) -> Option<DVec3> {
        self.numbers("three numbers, [x, y, z]").map(DVec3::from_array)
    }

    /// Reads a direction of any nonzero length. Error messages call the shape or light `what`.
    pub(in super::super) fn direction(&self, what: &str) -> Option<DVec3> {
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
        let issue = Issue::error(span, format!("`{}` must be more than {SHORTEST:e} long", self.info.name));
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
        let message = format!("`{first}` and `{second}` must be more than {SHORTEST:e} apart");
        self.context.report(Issue::error(span, message).with_label(format!("they are {distance:e} apart")));
        false
    }

    /// Reads a pair of numbers.
    pub(in super::super) fn pair(&self) -> Option<Vec2> {
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
