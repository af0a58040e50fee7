//! Reads transforms: the key `matrix`, or `scale`, `rotate` and `translate`.

use super::super::description::{AffineMap, ObjectTransform};
use super::context::Issue;
use super::key::KeyInTable;
use super::table::TableReader;
use crate::math::DVec3;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};

/// Reads either `matrix`, or `scale`, `rotate` and `translate`.
pub(super) fn read_transform(table: &TableReader<'_>) -> Option<ObjectTransform> {
    let (matrix, steps) = (table.key("matrix"), ["scale", "rotate", "translate"].map(|name| table.key(name)));
    if matrix.is_present() {
        for key in &steps {
            if let Some(span) = key.key_span() {
                let message = format!("`{}` conflicts with `matrix`", key.info.name);
                key.context.report(Issue::error(span, message));
            }
        }
        return read_affine_matrix(&matrix).map(ObjectTransform::Matrix);
    }
    let [scale, rotate, translate] = steps;
    let (scale, rotate, translate) = (scale.scale_factors(), rotate.vector(), translate.vector());
    Some(ObjectTransform::Steps { scale: scale?, rotate: rotate?, translate: translate? })
}

/// Minimum ratio of a matrix's determinant to the product of its column lengths. A matrix with a smaller
/// ratio is singular up to rounding.
const MIN_VOLUME_RATIO: f64 = 1e-12;

/// Reads an invertible affine transform in row-major order.
pub(super) fn read_affine_matrix(key: &KeyInTable<'_>) -> Option<AffineMap> {
    let numbers: [f64; 16] = key.numbers("16 numbers, row by row")?;
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
