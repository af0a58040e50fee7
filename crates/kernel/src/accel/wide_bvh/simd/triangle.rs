//! SIMD watertight triangle test. Performs the operations of `ShearedRay::intersect` in the same order and
//! without fused multiply-adds, so both give the same bits.

use super::vector::SimdVector;
use crate::geometry::watertight::ILL_CONDITIONED;
use crate::math::float::gamma;

/// Corners in the ray's coordinates: sheared x, sheared y, and z.
pub type ShearedCorners<V> = [[V; 3]; 3];

/// Results of testing a ray against a pack, or a packet against a triangle.
pub struct TriangleHits<V: SimdVector> {
    /// Mask of the lanes with a hit.
    pub hit: u32,
    /// Mask of the lanes that must be retested in higher precision, because an edge function is exactly 0,
    /// the triangle is too thin to determine t, or t is too close to 0.
    pub doubtful: u32,
    pub t: V,
    pub u: V,
    pub v: V,
}

/// Tests all lanes. `shear_z` is t per unit of z. Skips the division and the error bound if no ray passes
/// through a triangle. With `is_single`, also skips them if all triangles are behind the origin or past the
/// end of the ray, as in most packs.
#[inline(always)]
pub fn intersect<V: SimdVector>(
    corners: &ShearedCorners<V>,
    shear_z: V,
    t_max: V,
    is_single: bool,
) -> TriangleHits<V> {
    let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = *corners;
    let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let zero = ax.splat_like(0.0);
    let (min, max) = (wa.min(wb.min(wc)), wa.max(wb.max(wc)));
    let outside = min.lt(zero) & zero.lt(max);
    let on_edge = min.eq(zero) | max.eq(zero);
    let determinant = wa + wb + wc;
    let along = (wa * az + wb * bz + wc * cz) * shear_z;
    let none = TriangleHits { hit: 0, doubtful: 0, t: zero, u: zero, v: zero };
    let candidate = if is_single {
        on_edge | may_be_in_range_mask(corners, determinant, shear_z, along, t_max)
    } else {
        zero.le(zero)
    };
    if V::movemask(V::mask_difference(candidate, outside)) == 0 {
        return none;
    }
    let inverse = ax.splat_like(1.0).div(determinant);
    let t = along * inverse;
    let ahead = zero.lt(t) & t.le(t_max);
    let (error, reach) = distance_error_and_corner_max_t(corners, shear_z, inverse);
    let needle = (reach * reach.splat_like(ILL_CONDITIONED)).lt(error);
    let at_start = t.abs().le(error);
    let doubtful = V::movemask(V::mask_difference(needle | at_start | on_edge, outside));
    let hit = V::movemask(V::mask_difference(ahead, outside)) & !doubtful;
    TriangleHits { hit, doubtful, t, u: wb * inverse, v: wc * inverse }
}

/// Unit roundoff divided by the needle ratio, slightly enlarged to account for rounding in
/// [`may_be_in_range_mask`] itself.
const UNITS: f32 = 1.05 * 0.5 * f32::EPSILON / ILL_CONDITIONED;

/// Whether a triangle may need the full test. Returns false only if the triangle is not a needle and t is
/// negative or past the ray's end by more than its error. Let s be the sum of the maxima of |x| and |y|, so
/// the product of these maxima is at most s²/4, and let d be the maximum of |z|. Then the error from
/// [`distance_error_and_corner_max_t`] is at most the reach times 30·s·(s + d) unit roundoffs, divided by the
/// determinant. If the inverse of the determinant may be infinite, the triangle counts as a needle. `along`
/// is t times the determinant.
#[inline(always)]
fn may_be_in_range_mask<V: SimdVector>(
    corners: &ShearedCorners<V>,
    determinant: V,
    shear_z: V,
    along: V,
    t_max: V,
) -> V::Mask {
    let (sum, deepest) =
        (max_abs_coordinate(corners, 0) + max_abs_coordinate(corners, 1), max_abs_coordinate(corners, 2));
    let bound = sum * ((sum + deepest) * sum.splat_like(30.0 * UNITS)) + sum.splat_like(1e-37);
    let (size, reach) = (determinant.abs(), deepest * (shear_z.abs() * sum.splat_like(ILL_CONDITIONED)));
    let (ahead, error) = (along.xor_sign(determinant), bound * reach);
    let is_ahead =
        sum.splat_like(0.0).le(error + ahead) & ahead.le(size * (t_max * sum.splat_like(1.000_001)) + error);
    size.le(bound) | is_ahead
}

/// SIMD version of `ShearedRay::distance_error_and_corner_max_t`.
#[inline(always)]
fn distance_error_and_corner_max_t<V: SimdVector>(
    corners: &ShearedCorners<V>,
    shear_z: V,
    inverse_determinant: V,
) -> (V, V) {
    let (x, y, depth) =
        (max_abs_coordinate(corners, 0), max_abs_coordinate(corners, 1), max_abs_coordinate(corners, 2));
    let z = depth * shear_z.abs();
    let error_z = shear_z.splat_like(gamma(3)) * z;
    let (error_x, error_y) =
        (shear_z.splat_like(gamma(5)) * (x + depth), shear_z.splat_like(gamma(5)) * (y + depth));
    let error_edge =
        shear_z.splat_like(2.0) * (shear_z.splat_like(gamma(2)) * x * y + error_y * x + error_x * y);
    let edge = shear_z.splat_like(2.0) * x * y;
    let sum = shear_z.splat_like(gamma(3)) * edge * z + error_edge * z + error_z * edge;
    (shear_z.splat_like(3.0) * sum * inverse_determinant.abs(), z)
}

/// Largest absolute coordinate of the corners along an axis.
#[inline(always)]
fn max_abs_coordinate<V: SimdVector>(corners: &ShearedCorners<V>, axis: usize) -> V {
    corners[0][axis].abs().max(corners[1][axis].abs()).max(corners[2][axis].abs())
}

#[cfg(test)]
#[allow(unsafe_code)]
mod tests {
    use super::*;
    use crate::accel::wide_bvh::simd::vector::SimdF32x4;
    use crate::math::random::signed_number_generator as random;

    /// Tests triangles slightly inside and slightly outside the filter's limits on thinness and on distance
    /// from the origin.
    #[test]
    fn filter_rejects_only_clear_misses() {
        // SAFETY: every x86-64 processor supports four-float vectors.
        let like = unsafe { SimdF32x4::splat(0.0) };
        let mut next = random(31);
        let (mut needles, mut starts, mut passed, mut clear, mut beyond) = (0, 0, 0, 0, 0);
        for round in 0..400_000 {
            // Use needles of various widths, sizes, and distances. Corners with |x| = |y| are the worst case.
            let size = 2.0_f32.powf(next() * 12.0);
            let depth = if round % 2 == 0 { 0.0 } else { size * 2.0_f32.powf(next() * 10.0) };
            let is_thin = round % 4 < 2;
            let width =
                size * if is_thin { 2.0_f32.powf(next() * 7.0 - 14.0) * (1.0 + depth / size) } else { 1.0 };
            let along = if round % 3 == 0 { [next(), next()] } else { [1.0, 1.0_f32.copysign(next())] };
            let shift = size * 2.0_f32.powf(next() * 7.0 - 18.0);
            let mut corner = |part: f32, z: f32| {
                let at = |axis: usize, off: f32| along[axis] * size * part + off * width;
                let z = if is_thin { -depth * (1.0 - 0.1 * next().abs()) } else { z * depth + shift };
                [at(0, next()), at(1, next()), z]
            };
            let scalar = [corner(1.0, 1.0), corner(-1.0, -1.0), corner(0.0, 0.0)];
            let corners: ShearedCorners<SimdF32x4> = scalar.map(|corner| corner.map(|x| like.splat_like(x)));
            let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners;
            let (wa, wb, wc) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
            let determinant = wa + wb + wc;
            let shear_z = like.splat_like(2.0_f32.powf(next() * 8.0));
            let inverse = like.splat_like(1.0).div(determinant);
            let along = (wa * az + wb * bz + wc * cz) * shear_z;
            let t = along * inverse;
            let (error, reach) = distance_error_and_corner_max_t(&corners, shear_z, inverse);
            let is_needle = SimdF32x4::movemask((reach * like.splat_like(ILL_CONDITIONED)).lt(error)) != 0;
            let is_at_start = SimdF32x4::movemask(t.abs().le(error)) != 0;
            // Place the ray's end in front of the triangle, on it, behind it, or at infinity.
            let mut distance = [0.0; 4];
            t.store(&mut distance);
            let part = [0.5, 1.0, 1.0 + f32::EPSILON, 2.0, f32::INFINITY][round % 5];
            let end = like.splat_like((distance[0] * part).max(0.0));
            let passes =
                SimdF32x4::movemask(may_be_in_range_mask(&corners, determinant, shear_z, along, end)) != 0;
            let is_ahead = SimdF32x4::movemask(like.lt(t) & t.le(end)) != 0;
            let is_beyond = SimdF32x4::movemask(end.lt(t)) != 0;
            assert!(passes || !(is_ahead || is_needle || is_at_start), "{scalar:?}");
            beyond += u32::from(is_beyond && !passes);
            if is_beyond {
                continue;
            }
            if is_ahead {
                continue;
            }
            needles += u32::from(is_needle);
            starts += u32::from(is_at_start && !is_needle);
            passed += u32::from(passes);
            clear += u32::from(!passes);
        }
        assert!(needles > 20_000 && starts > 2_000 && clear > 20_000, "{needles}, {starts}, {clear}");
        assert!(passed < 4 * (needles + starts), "{passed} passed, {needles} needles, {starts} at origin");
        assert!(beyond > 5_000, "{beyond} past the end");
    }
}
