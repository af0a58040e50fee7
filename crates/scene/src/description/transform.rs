//! Transforms of shapes and meshes.

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use crate::math::transform::Transform;
use crate::math::{DMat3, DVec3};

/// A transform as written in the scene file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObjectTransform {
    /// Scale, rotation and translation.
    Steps {
        /// Scale factors, applied first. No component is 0.
        scale: DVec3,
        /// Rotation in degrees about x, then y, then z.
        rotate: DVec3,
        /// Translation, applied last.
        translate: DVec3,
    },
    /// An invertible affine map.
    Matrix(AffineMap),
}

/// An invertible affine map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AffineMap {
    /// Images of the coordinate axes.
    pub linear: [DVec3; 3],
    /// Image of the origin.
    pub translate: DVec3,
}

impl AffineMap {
    /// Returns the map and its inverse.
    pub fn to_transform(&self) -> Transform {
        let [x, y, z] = self.linear;
        Transform::from_mat3_translation(DMat3::from_cols(x, y, z), self.translate)
    }

    /// Returns the scale factor of a map that only scales uniformly, by a factor > 0, and translates. Returns
    /// `None` for other maps.
    pub(super) fn unrotated_uniform_scale(&self) -> Option<f64> {
        let scale = self.linear[0].x;
        (scale > 0.0 && self.linear == DVec3::AXES.map(|axis| axis * scale)).then_some(scale)
    }
}

impl ObjectTransform {
    /// The identity transform.
    pub const IDENTITY: Self = Self::Steps { scale: DVec3::ONE, rotate: DVec3::ZERO, translate: DVec3::ZERO };

    /// Returns the transform and its inverse.
    pub fn to_transform(&self) -> Transform {
        match *self {
            Self::Steps { scale, rotate, translate } => {
                Transform::scale_rotate_translate(scale, rotate, translate)
            }
            Self::Matrix(map) => map.to_transform(),
        }
    }

    /// Returns the transform as an affine map.
    pub fn to_affine_map(&self) -> AffineMap {
        let Transform { linear, translation, inverse_linear: _ } = self.to_transform();
        AffineMap { linear: [linear.x_axis, linear.y_axis, linear.z_axis], translate: translation }
    }

    /// Returns the transform that applies `self` and then `outer`. Keeps the steps if one of the transforms
    /// is the identity or if `outer` only translates, because a composed matrix would be rounded differently.
    #[must_use]
    pub fn then(&self, outer: &Self) -> Self {
        match (*self, *outer) {
            (inner, Self::IDENTITY) => inner,
            (Self::IDENTITY, outer) => outer,
            (
                Self::Steps { scale, rotate, translate },
                Self::Steps { scale: DVec3::ONE, rotate: DVec3::ZERO, translate: offset },
            ) => Self::Steps { scale, rotate, translate: translate + offset },
            (inner, outer) => {
                let (inner, outer) = (inner.to_affine_map(), outer.to_transform());
                Self::Matrix(AffineMap {
                    linear: inner.linear.map(|axis| outer.vector(axis)),
                    translate: outer.point(inner.translate),
                })
            }
        }
    }
}

impl Fingerprinted for AffineMap {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let [x, y, z] = self.linear;
        key.add_dvec3(x).add_dvec3(y).add_dvec3(z).add_dvec3(self.translate);
    }
}

impl Fingerprinted for ObjectTransform {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match *self {
            Self::Steps { scale, rotate, translate } => {
                key.add_usize(0).add_dvec3(scale).add_dvec3(rotate).add_dvec3(translate)
            }
            Self::Matrix(map) => key.add_usize(1).add_with_references(&map, of),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURNED: ObjectTransform = ObjectTransform::Steps {
        scale: DVec3::new(2.0, 0.5, -3.0),
        rotate: DVec3::new(10.0, 20.0, 30.0),
        translate: DVec3::new(1.0, -5.0, 7.0),
    };

    #[test]
    fn inner_transforms_are_applied_first() {
        let sheared = ObjectTransform::Matrix(AffineMap {
            linear: [DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.0, -0.2, 2.0)],
            translate: DVec3::Y,
        });
        let point = DVec3::new(0.3, -0.8, 12.0);
        for (inner, outer) in [(TURNED, sheared), (sheared, TURNED), (TURNED, TURNED)] {
            let [both, first, second] = [inner.then(&outer), inner, outer].map(|one| one.to_transform());
            assert!((both.point(point) - second.point(first.point(point))).length() < 1e-12);
            assert!((both.inverse_point(both.point(point)) - point).length() < 1e-12);
        }
    }

    #[test]
    fn steps_are_kept_under_translations() {
        let offset = DVec3::new(0.1, 0.2, 0.3);
        let moved = ObjectTransform::Steps { scale: DVec3::ONE, rotate: DVec3::ZERO, translate: offset };
        let ObjectTransform::Steps { scale, rotate, translate } = TURNED else { unreachable!() };
        let expected = ObjectTransform::Steps { scale, rotate, translate: translate + offset };
        assert_eq!(TURNED.then(&moved), expected);
        assert_eq!(TURNED.then(&ObjectTransform::IDENTITY), TURNED);
        assert_eq!(ObjectTransform::IDENTITY.then(&TURNED), TURNED);
    }
}
