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

/// Test all lanes; `shear_z` is t for each unit of z. Where most packs have a lane that the ray goes through, but behind its
/// start, as around the origin of a bounce, [`slender`] saves the error bound for those.
#[inline(always)]
pub fn hits<V: Lanes>(corners: &Corners<V>, shear_z: V, t_max: V, slender: Option<V>) -> Hits<V> {
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *corners;
    let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let zero = ax.like(0.0);
    let (least, greatest) = (wa.min(wb.min(wc)), wa.max(wb.max(wc)));
    let outside = least.lt(zero) & zero.lt(greatest);
    let on_edge = least.eq(zero) | greatest.eq(zero);
    let determinant = wa + wb + wc;
    let inverse = ax.like(1.0).over(determinant);
    let t = (wa * az + wb * bz + wc * cz) * shear_z * inverse;
    let ahead = zero.lt(t) & t.le(t_max);
    let candidate = match slender {
        Some(slender) => zero.lt(t) | on_edge | may_be_needle(corners, determinant, slender),
        None => zero.le(zero),
    };
    let (mut hit, mut doubtful) = (0, 0);
    if V::bits(V::without(candidate, outside)) != 0 {
        let (error, reach) = distance_error(corners, shear_z, inverse);
        let needle = (reach * reach.like(ILL_CONDITIONED)).lt(error);
        doubtful = V::bits(V::without(needle | on_edge, outside));
        hit = V::bits(V::without(error.lt(t) & ahead, outside)) & !doubtful;
    }
    Hits { hit, doubtful, t, u: wb * inverse, v: wc * inverse }
}

/// A little more than is needed, for the rounding of [`may_be_needle`] itself.
const MORE: f32 = 1.05;

/// Unit of rounding, by the part of the reach that makes a needle.
const UNITS: f32 = MORE * 0.5 * f32::EPSILON / ILL_CONDITIONED;

/// What [`may_be_needle`] needs, of the greatest coordinate of any corner as seen from the origin of the ray.
#[inline(always)]
pub fn slender<V: Lanes>(farthest: V) -> V {
    farthest * farthest.like(30.0 * UNITS)
}

/// False only where the triangle is no needle. With s the sum of the greatest x and y, of which the product is at most s²/4,
/// and d the greatest z, [`distance_error`] is at most (27·s² + 30·d·s) units of rounding of the reach, by the
/// determinant. A determinant of which the inverse may be infinite counts as one.
#[inline(always)]
fn may_be_needle<V: Lanes>(corners: &Corners<V>, determinant: V, slender: V) -> V::Mask {
    let sum = greatest(corners, 0) + greatest(corners, 1);
    determinant.abs().le(sum * (sum * sum.like(27.0 * UNITS) + slender) + sum.like(1e-37))
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
