//! Reads the key `matrix`.

use super::super::super::description::AffineMap;
use super::super::context::Issue;
use super::super::key::KeyInTable;
use super::super::limits::Limits;
use crate::math::DVec3;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};

/// Minimum ratio of a matrix's determinant to the product of its column lengths. A matrix with a smaller
/// ratio is singular up to rounding.
const MIN_VOLUME_RATIO: f64 = 1e-12;

/// Reads an invertible affine transform in row-major order.
pub(super) fn read_affine_matrix(key: &KeyInTable<'_>) -> Option<AffineMap> {
    let numbers: [f64; 16] = key.numbers(Limits::Any, "16 numbers, row by row")?;
    let [x, y, z, translate] =
        std::array::from_fn(|column| DVec3::from_array(std::array::from_fn(|row| numbers[4 * row + column])));
    let wrong = |message: &str, label: String| {
        key.context.report(Issue::error(key.value_span().unwrap_or_default(), message).with_label(label));
        None
    };
    if numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
        let [a, b, c, d] = [12, 13, 14, 15].map(|place| numbers[place]);
        return wrong("the last row of `matrix` must be 0, 0, 0, 1", format!("it is {a}, {b}, {c}, {d}"));
    }
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    if !(volume.abs() > MIN_VOLUME_RATIO * edges) {
        return wrong("`matrix` is not invertible", format!("its determinant is {volume:e}"));
    }
    if [x, y, z].iter().any(|axis| is_nonzero_but_too_short(robust_length(*axis))) {
        return wrong(
            "`matrix` makes the shape too small",
            format!("its columns must be more than {SHORTEST:e} long"),
        );
    }
    Some(AffineMap { linear: [x, y, z], translate })
}
