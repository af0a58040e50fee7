//! Form of a shape near a point: flat pieces, or a surface at a distance.

use arrayvec::ArrayVec;

use crate::math::DVec3;

/// A flat piece by its corners, counter-clockwise as seen from its front.
pub type Piece = ArrayVec<DVec3, 4>;

/// The form of a shape near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalForm {
    /// Number of the flat pieces that make up the shape: see [`Shape::piece`](super::Shape::piece).
    Pieces(u32),
    /// A surface at a distance from the point.
    Surface {
        /// Distance of the point from the surface.
        distance: f64,
        /// The surface below the point, of planes, disks and spheres.
        ground: Option<Ground>,
    },
}

/// The surface below a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit normal at the foot of the point.
    pub normal: DVec3,
    /// Height of the point above the surface, to either side.
    pub height: f64,
    /// Extent of the surface around the foot.
    pub extent: Extent,
}

/// Extent of a surface around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// It is flat up to this distance.
    Flat(f64),
    /// It is a sphere of this radius.
    Round(f64),
}

/// The parallelogram at a corner along two edges, (corner, u, v).
#[inline]
pub(super) fn parallelogram((c, u, v): (DVec3, DVec3, DVec3)) -> Piece {
    Piece::from([c, c + u, c + u + v, c + v])
}

impl LocalForm {
    /// A curved surface of which the distance alone is known.
    pub(super) fn curved(distance: f64) -> Self {
        Self::Surface { distance, ground: None }
    }
}
