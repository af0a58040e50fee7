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

    /// Returns the scale of a map that consists of a uniform scale > 0 and a translation, or `None` for other
    /// maps.
    pub(super) fn unrotated_uniform_scale(&self) -> Option<f64> {
        let scale = self.linear[0].x;
        (scale > 0.0 && self.linear == DVec3::AXES.map(|axis| axis * scale)).then_some(scale)
    }
}

impl ObjectTransform {
    /// Returns the transform and its inverse.
    pub fn to_transform(&self) -> Transform {
        match *self {
            Self::Steps { scale, rotate, translate } => {
                Transform::scale_rotate_translate(scale, rotate, translate)
            }
            Self::Matrix(map) => map.to_transform(),
        }
    }
}

impl Fingerprinted for AffineMap {
    fn add_to(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let [x, y, z] = self.linear;
        key.add_dvec3(x).add_dvec3(y).add_dvec3(z).add_dvec3(self.translate);
    }
}

impl Fingerprinted for ObjectTransform {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match *self {
            Self::Steps { scale, rotate, translate } => {
                key.add_usize(0).add_dvec3(scale).add_dvec3(rotate).add_dvec3(translate)
            }
            Self::Matrix(map) => key.add_usize(1).add(&map, of),
        };
    }
}
