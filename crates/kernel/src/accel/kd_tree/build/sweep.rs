//! Splits small cells. Tries every plane through a face of a clipped triangle's box ("perfect splits": Wald,
//! Havran, *On building fast kd-trees for ray tracing, and on doing that in O(N log N)*, 2006). For so few
//! triangles, counting both sides of every plane with SIMD is faster than keeping the faces sorted.

use super::cost::{PlaneSearch, PlanesWithTriangleCounts, SplitPlane};
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::math::Vec4;

/// Cells with at most this many references are swept.
pub const MAX_SWEPT_REFERENCES: usize = 24;

/// Finds the cheapest plane. Returns `None` if a leaf costs no more.
pub fn cheapest_plane(references: &[TriangleReference], cell: &SimdBounds) -> Option<SplitPlane> {
    match references.len() {
        0..=4 => cheapest_plane_simd::<1>(references, cell),
        5..=8 => cheapest_plane_simd::<2>(references, cell),
        9..=16 => cheapest_plane_simd::<4>(references, cell),
        _ => cheapest_plane_simd::<{ MAX_SWEPT_REFERENCES / 4 }>(references, cell),
    }
}

/// A number for each of 4·`N` references.
type LaneValues<const N: usize> = [[f32; 4]; N];

/// [`cheapest_plane`] for at most 4·`N` references.
fn cheapest_plane_simd<const N: usize>(
    references: &[TriangleReference],
    cell: &SimdBounds,
) -> Option<SplitPlane> {
    let mut search = PlaneSearch::<N>::new(cell, references.len());
    // Store the start and the end of each box along each axis. Unused lanes start above every plane and end
    // below it.
    let (mut starts, mut ends) = ([[[f32::INFINITY; 4]; N]; 3], [[[f32::NEG_INFINITY; 4]; N]; 3]);
    for (place, reference) in references.iter().take(4 * N).enumerate() {
        let (min, max) = (reference.bounds.min.to_array(), reference.bounds.max_corner().to_array());
        for axis in 0..3 {
            starts[axis][place / 4][place % 4] = min[axis];
            ends[axis][place / 4][place % 4] = max[axis];
        }
    }
    for axis in 0..3 {
        let (starts, ends) = (&starts[axis], &ends[axis]);
        let has_planar = (0..N).any(|i| Vec4::from(starts[i]).cmpeq(Vec4::from(ends[i])).any());
        for at in [starts, ends] {
            add_axis_planes(axis, at, [starts, ends], references.len(), has_planar, &mut search);
        }
    }
    search.cheapest()
}

/// Adds the candidate planes at `at`, perpendicular to an axis, to the search.
#[inline(always)]
fn add_axis_planes<const N: usize>(
    axis: usize,
    at: &LaneValues<N>,
    [starts, ends]: [&LaneValues<N>; 2],
    count: usize,
    has_planar: bool,
    search: &mut PlaneSearch<N>,
) {
    let mut planes =
        PlanesWithTriangleCounts { at: at.map(Vec4::from), left: [Vec4::ZERO; N], right: [Vec4::ZERO; N] };
    let mut planar = [Vec4::ZERO; N];
    for place in 0..count.min(4 * N) {
        let start = Vec4::splat(starts[place / 4][place % 4]);
        let end = Vec4::splat(ends[place / 4][place % 4]);
        for (i, &at) in planes.at.iter().enumerate() {
            planes.left[i] += Vec4::select(start.cmplt(at), Vec4::ONE, Vec4::ZERO);
            planes.right[i] += Vec4::select(end.cmpgt(at), Vec4::ONE, Vec4::ZERO);
            if has_planar {
                let is_planar = start.cmpge(at) & end.cmple(at);
                planar[i] += Vec4::select(is_planar, Vec4::ONE, Vec4::ZERO);
            }
        }
    }
    if has_planar {
        let mut to_right = planes;
        for (i, planar) in planar.into_iter().enumerate() {
            to_right.right[i] += planar;
            planes.left[i] += planar;
        }
        search.add_planes(axis, true, &to_right);
    }
    search.add_planes(axis, false, &planes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use crate::math::random::signed_number_generator as random;

    /// Cost of a plane, computed directly from the definition. Infinite if the plane does not intersect the
    /// cell.
    fn cost(references: &[TriangleReference], cell: &SimdBounds, plane: &SplitPlane) -> f32 {
        let SplitPlane { axis, at, planar_right } = *plane;
        if !(at > cell.min[axis] && at < cell.max_corner()[axis]) {
            return f32::INFINITY;
        }
        let belongs = |reference: &TriangleReference, right: bool| {
            let (min, max) = (reference.bounds.min[axis], reference.bounds.max_corner()[axis]);
            let is_planar = min == at && max == at;
            if is_planar { right == planar_right } else { if right { max > at } else { min < at } }
        };
        let count = |right| references.iter().filter(|reference| belongs(reference, right)).count() as f32;
        let share = cell.split_at_plane(axis, at).map(|half| half.half_area() / cell.half_area());
        let cost = 1.0 + share[0] * count(false) + share[1] * count(true);
        if count(false) == 0.0 || count(true) == 0.0 { 0.8 * cost } else { cost }
    }

    #[test]
    fn cheapest_plane_matches_brute_force() {
        let mut next = random(23);
        let (mut planes, mut leaves) = (0, 0);
        for round in 0..3000 {
            let count = 1 + round % MAX_SWEPT_REFERENCES;
            // Put the boxes on a grid so that they touch and share planes. Some reach the cell's faces.
            let mut step = |size: f32| Vec3::new(next(), next(), next()).map(|x| (x * size).round() / 8.0);
            let references: Vec<TriangleReference> = (0..count as u32)
                .map(|id| {
                    let from = step(10.0);
                    let along = step(8.0)
                        * Vec3::from(std::array::from_fn(|axis| {
                            f32::from(u8::from(id as usize % 5 != axis))
                        }));
                    TriangleReference::new(id, [from, from + along, from + along * 0.5])
                })
                .collect();
            let cell = SimdBounds::around_references(&references);
            if cell.half_area() == 0.0 || cell.extent().truncate().min_element() == 0.0 {
                continue;
            }
            let faces =
                references.iter().flat_map(|reference| [reference.bounds.min, reference.bounds.max_corner()]);
            let all = faces.flat_map(|corner| {
                (0..6).map(move |i| SplitPlane { axis: i % 3, at: corner[i % 3], planar_right: i < 3 })
            });
            let least = all.map(|plane| cost(&references, &cell, &plane)).fold(count as f32, f32::min);
            match cheapest_plane(&references, &cell) {
                Some(plane) => {
                    let own = cost(&references, &cell, &plane);
                    assert!((own - least).abs() <= 1e-5 * least, "{round}: {plane:?} {own}, {least}");
                    planes += 1;
                }
                None => {
                    assert!(least >= count as f32 * (1.0 - 1e-5), "{round}: leaf, {least}");
                    leaves += 1;
                }
            }
        }
        assert!(planes > 1000 && leaves > 50, "{planes} planes, {leaves} leaves");
    }
}
