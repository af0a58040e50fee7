//! Local shape geometry near a point, for integrating a density-estimation kernel. It consists of flat
//! polygons, or of a surface at a known distance.

use arrayvec::ArrayVec;

use crate::math::DVec3;

/// Corners of a flat polygon, counterclockwise when seen from the front.
pub type FlatPolygon = ArrayVec<DVec3, 4>;

/// Shape geometry near a point, for integrating a density-estimation kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NearbyGeometry {
    /// Number of flat polygons that form the shape. See
    /// [`Shape::nth_polygon_face`](super::Shape::nth_polygon_face).
    Polygons(u32),
    /// A non-polygonal surface.
    Surface {
        /// Distance from the point to the surface.
        distance: f64,
        /// The surface below the point. Only for planes, disks, and spheres.
        ground: Option<NearestSurface>,
    },
}

/// Surface geometry below a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestSurface {
    /// Unit normal at the closest point on the surface.
    pub normal: DVec3,
    /// Height of the point above or below the surface.
    pub height: f64,
    /// Extent of the surface around the closest point.
    pub extent: FlatOrRoundExtent,
}

/// Extent of a surface around a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FlatOrRoundExtent {
    /// A plane that extends at least up to this distance.
    Flat(f64),
    /// A sphere of this radius.
    Round(f64),
}

/// Returns the parallelogram with corner c and edges u and v.
#[inline]
pub(super) fn polygon_from_parallelogram((c, u, v): (DVec3, DVec3, DVec3)) -> FlatPolygon {
    FlatPolygon::from([c, c + u, c + u + v, c + v])
}

impl NearbyGeometry {
    /// Describes a curved surface of which only the distance is known.
    pub(super) fn from_distance_to_curved_surface(distance: f64) -> Self {
        Self::Surface { distance, ground: None }
    }
}
