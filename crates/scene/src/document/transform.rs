//! Reads transforms: the key `matrix`, or `scale`, `rotate` and `translate`.

use super::super::description::{AffineMap, ObjectTransform};
use super::context::Issue;
use super::key::KeyInTable;
use super::table::TableReader;
use crate::math::DVec3;
use crate::math::limits::{MAX_MAGNITUDE, MIN_LENGTH, is_nonzero_but_too_short, robust_length};

/// Reads either `matrix`, or `scale`, `rotate` and `translate`.
pub(super) fn read_transform(table: &TableReader<'_>) -> Option<ObjectTransform> {
    let (matrix, steps) = (table.key("matrix"), ["scale", "rotate", "translate"].map(|name| table.key(name)));
    if matrix.is_present() {
        for key in &steps {
            if let Some(span) = key.key_span() {
                let message = format!("`{}` conflicts with `matrix`", key.info.name);
                key.context.report(Issue::error(span, message).with_help("remove one of the two"));
            }
        }
        return read_affine_matrix(&matrix).map(ObjectTransform::Matrix);
    }
    let [scale, rotate, translate] = steps;
    let (scale, rotate, translate) = (scale.scale_factors(), rotate.vector(), translate.vector());
    Some(ObjectTransform::Steps { scale: scale?, rotate: rotate?, translate: translate? })
}

/// Reads an invertible affine transform in row-major order.
pub(super) fn read_affine_matrix(key: &KeyInTable<'_>) -> Option<AffineMap> {
    let numbers: [f64; 16] = key.numbers("16 numbers, row by row")?;
    let [x, y, z, translate] =
        std::array::from_fn(|column| DVec3::from_array(std::array::from_fn(|row| numbers[4 * row + column])));
    let map = AffineMap { linear: [x, y, z], translate };
    let (message, label) = if numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
        let [a, b, c, d] = [12, 13, 14, 15].map(|place| numbers[place]);
        ("the last row of `matrix` must be 0, 0, 0, 1".to_owned(), format!("it is {a}, {b}, {c}, {d}"))
    } else if let Some((problem, label)) = affine_map_problem(&map) {
        (format!("`matrix` {problem}"), label)
    } else {
        return Some(map);
    };
    key.context.report(Issue::error(key.value_span().unwrap_or_default(), message).with_label(label));
    None
}

/// Returns the reason why a composed transform cannot be used, and its details. Returns `None` if it can be
/// used.
pub(super) fn composed_transform_problem(transform: &ObjectTransform) -> Option<(&'static str, String)> {
    let map = transform.to_affine_map();
    let [x, y, z] = map.linear;
    let largest = [x, y, z, map.translate].map(|column| column.abs().max_element());
    if largest.iter().any(|number| *number > MAX_MAGNITUDE) {
        return Some(("makes the shape too large", format!("its numbers must be at most {MAX_MAGNITUDE:e}")));
    }
    affine_map_problem(&map)
}

/// Minimum ratio of a matrix's determinant to the product of its column lengths. A matrix with a smaller
/// ratio counts as singular.
const MIN_VOLUME_RATIO: f64 = 1e-12;

fn affine_map_problem(map: &AffineMap) -> Option<(&'static str, String)> {
    let [x, y, z] = map.linear;
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    if !(volume.abs() > MIN_VOLUME_RATIO * edges) {
        let label = match volume {
            0.0 => "its determinant is 0".to_owned(),
            _ => format!("its determinant is {volume:e}"),
        };
        return Some(("is not invertible", label));
    }
    let is_short = |axis: &DVec3| is_nonzero_but_too_short(robust_length(*axis));
    map.linear
        .iter()
        .any(is_short)
        .then(|| ("makes the shape too small", format!("its columns must be more than {MIN_LENGTH:e} long")))
}
