//! The watertight triangle test in every lane, with the operations of `ShearedRay::intersect` in their order and without
//! fused products, so that the bits are the same.

use super::lanes::Lanes;
use crate::geometry::watertight::ILL_CONDITIONED;
use crate::math::float::gamma;

/// Corners as seen from the ray: sheared x and y, and z.
pub type Corners<V> = [[V; 3]; 3];

/// What a ray hits.
pub struct Hits<V: Lanes> {
    /// A bit for each lane that is hit.
    pub hit: u32,
    /// A bit for each lane that must be tested again with more digits: an edge function is exactly 0, or the triangle is too
    /// thin to tell t.
    pub doubtful: u32,
    pub t: V,
    pub u: V,
    pub v: V,
}

/// Test all lanes; `shear_z` is t for each unit of z.
#[inline(always)]
pub fn hits<V: Lanes>(corners: &Corners<V>, shear_z: V, t_max: V) -> Hits<V> {
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *corners;
    let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let zero = ax.like(0.0);
    let doubtful = wa.eq(zero) | wb.eq(zero) | wc.eq(zero);
    let negative = wa.lt(zero) | wb.lt(zero) | wc.lt(zero);
    let positive = zero.lt(wa) | zero.lt(wb) | zero.lt(wc);
    let determinant = wa + wb + wc;
    let inverse = ax.like(1.0).over(determinant);
    let t = (wa * az + wb * bz + wc * cz) * shear_z * inverse;
    let outside = negative & positive;
    let inside = V::bits(V::without(zero.le(zero), outside));
    let (mut hit, mut doubtful) = (0, V::bits(doubtful));
    if inside != 0 {
        let (error, reach) = distance_error(corners, shear_z, inverse);
        let needle = V::without((reach * reach.like(ILL_CONDITIONED)).lt(error), outside);
        doubtful |= V::bits(needle);
        hit = V::bits(V::without(error.lt(t) & t.le(t_max), outside)) & !doubtful;
    }
    Hits { hit, doubtful, t, u: wb * inverse, v: wc * inverse }
}

/// See `ShearedRay::distance_error`.
#[inline(always)]
fn distance_error<V: Lanes>(corners: &Corners<V>, shear_z: V, inverse_determinant: V) -> (V, V) {
    let (x, y, depth) = (greatest(corners, 0), greatest(corners, 1), greatest(corners, 2));
    let z = depth * shear_z.abs();
    let error_z = shear_z.like(gamma(3)) * z;
    let (error_x, error_y) = (shear_z.like(gamma(5)) * (x + depth), shear_z.like(gamma(5)) * (y + depth));
    let error_edge = shear_z.like(2.0) * (shear_z.like(gamma(2)) * x * y + error_y * x + error_x * y);
    let edge = shear_z.like(2.0) * x * y;
    let sum = shear_z.like(gamma(3)) * edge * z + error_edge * z + error_z * edge;
    (shear_z.like(3.0) * sum * inverse_determinant.abs(), z)
}

/// The greatest size of a coordinate.
#[inline(always)]
fn greatest<V: Lanes>(corners: &Corners<V>, axis: usize) -> V {
    corners[0][axis].abs().max(corners[1][axis].abs()).max(corners[2][axis].abs())
}
