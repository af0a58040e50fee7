//! Local geometry of a shape near a point, over which a density kernel is integrated: flat polygons, or a
//! surface at a distance.

use arrayvec::ArrayVec;

use crate::math::DVec3;

/// Corners of a flat polygon, counterclockwise as seen from its front.
pub type FlatPolygon = ArrayVec<DVec3, 4>;

/// Geometry of a shape near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KernelDomain {
    /// Number of flat polygons that make up the shape; see [`Shape::polygon`](super::Shape::polygon).
    Polygons(u32),
    /// A surface at a distance from the point.
    Surface {
        /// Distance of the point from the surface.
        distance: f64,
        /// The surface below the point, for planes, disks and spheres.
        ground: Option<Ground>,
    },
}

/// The surface below a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Unit normal at the surface point closest to the point.
    pub normal: DVec3,
    /// Height of the point above or below the surface.
    pub height: f64,
    /// Extent of the surface around the closest point.
    pub extent: Extent,
}

/// Extent of a surface around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Extent {
    /// Flat up to this distance.
    Flat(f64),
    /// A sphere of this radius.
    Round(f64),
}

/// Parallelogram with a corner c and edges u and v.
#[inline]
pub(super) fn parallelogram((c, u, v): (DVec3, DVec3, DVec3)) -> FlatPolygon {
    FlatPolygon::from([c, c + u, c + u + v, c + v])
}

impl KernelDomain {
    /// A curved surface of which only the distance is known.
    pub(super) fn curved(distance: f64) -> Self {
        Self::Surface { distance, ground: None }
    }
}
