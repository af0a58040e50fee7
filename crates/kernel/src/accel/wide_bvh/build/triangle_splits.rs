//! Covers large triangles with several smaller boxes before construction (Karras, Aila, *Fast Parallel
//! Construction of High-Quality Bounding Volume Hierarchies*, 2013, section 4). Prefers triangles that fill
//! little of their box, and cuts at planes that recursively halve the scene's bounding box.

use rayon::prelude::*;

use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::control::{CancelToken, Canceled};
use crate::math::Vec3;
use crate::math::elementary::exp2;

/// Maximum number of additional references as a fraction of the number of triangles.
const MAX_ADDITIONAL: f64 = 0.3;

/// Number of levels in the grid of planes. The grid has 2^`LEVELS` cells along each axis.
const LEVELS: u32 = 20;

/// Number of references processed between polls of the cancellation token.
const REFERENCES_PER_POLL: usize = 4096;

/// Splits the references of large triangles. The result depends only on the triangles.
///
/// # Errors
/// [`Canceled`] if the build was canceled.
pub fn split_large_triangles(
    references: &[TriangleReference],
    corners: &(impl Fn(u32) -> [Vec3; 3] + Sync),
    token: &CancelToken,
) -> Result<Vec<TriangleReference>, Canceled> {
    let grid = BisectionGrid::around_references(references);
    let priority = |reference: &TriangleReference| grid.priority(reference, corners(reference.id()));
    let priorities: Vec<f32> = references.par_iter().map(priority).collect();
    let factor = find_priority_scale(&priorities, (references.len() as f64 * MAX_ADDITIONAL) as u64);
    let of_chunk = |(references, priorities): (&[TriangleReference], &[f32])| {
        token.check_pause_and_cancel()?;
        let mut pieces = Vec::new();
        for (reference, &priority) in references.iter().zip(priorities) {
            grid.cut_at_grid_planes(
                *reference,
                cut_count(priority, factor),
                corners(reference.id()),
                &mut pieces,
            );
        }
        Ok(pieces)
    };
    let chunks = references.par_chunks(REFERENCES_PER_POLL).zip(priorities.par_chunks(REFERENCES_PER_POLL));
    Ok(chunks.map(of_chunk).collect::<Result<Vec<_>, _>>()?.concat())
}

/// Number of times to cut a triangle with this priority.
fn cut_count(priority: f32, factor: f32) -> u32 {
    (priority * factor) as u32
}

/// Finds, by bisection, the largest factor for which the total number of cuts is at most `most`.
fn find_priority_scale(priorities: &[f32], most: u64) -> f32 {
    let total = |factor: f32| {
        priorities.par_iter().map(|&priority| u64::from(cut_count(priority, factor))).sum::<u64>()
    };
    let sum: f64 = priorities.iter().map(|&priority| f64::from(priority)).sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return 0.0;
    }
    // Rounding down loses less than one cut per triangle.
    let (mut low, mut high) =
        ((most as f64 / sum) as f32, ((most as f64 + priorities.len() as f64) / sum) as f32);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if total(middle) <= most { low = middle } else { high = middle }
    }
    if total(low) <= most { low } else { 0.0 }
}

/// A bounding box that is halved recursively.
struct BisectionGrid {
    start: Vec3,
    extent: Vec3,
}

/// A plane of the grid.
struct GridPlane {
    axis: usize,
    at: f32,
    /// Level of the plane. Level 0 separates two cells of the finest grid; higher levels separate larger
    /// cells.
    level: u32,
}

impl BisectionGrid {
    fn around_references(references: &[TriangleReference]) -> Self {
        let all = SimdBounds::around_references(references);
        Self { start: all.min.truncate(), extent: all.extent().truncate() }
    }

    /// The coarsest plane that intersects a box.
    fn coarsest_plane(&self, bounds: &SimdBounds) -> Option<GridPlane> {
        let cells = (1_u32 << LEVELS) as f32;
        let on_axis = |axis: usize| {
            let place = |x: f32| (x - self.start[axis]) / self.extent[axis] * cells;
            // A box that ends on a plane counts as below it.
            let first = place(bounds.min[axis]) as u32;
            let last = (place(bounds.max_corner()[axis]).ceil() as u32).saturating_sub(1).max(first);
            let level = (first ^ last).checked_ilog2()?;
            let at = self.start[axis] + self.extent[axis] * ((last >> level << level) as f32 / cells);
            (bounds.min[axis] < at && at < bounds.max_corner()[axis]).then_some(GridPlane { axis, at, level })
        };
        let length = |plane: &GridPlane| bounds.extent()[plane.axis];
        (0..3).filter_map(on_axis).max_by(|a, b| a.level.cmp(&b.level).then(length(a).total_cmp(&length(b))))
    }

    /// Priority for cutting a triangle: the excess area of its box, with a lower weight for finer planes.
    fn priority(&self, reference: &TriangleReference, [a, b, c]: [Vec3; 3]) -> f32 {
        let Some(plane) = self.coarsest_plane(&reference.bounds) else { return 0.0 };
        let normal = (b - a).cross(c - a).abs();
        let too_much = reference.bounds.half_area() - (normal.x + normal.y + normal.z);
        let weight = exp2(-((LEVELS - plane.level) as f32));
        let priority = libm::cbrtf(too_much.max(0.0) * weight);
        if priority.is_finite() { priority } else { 0.0 }
    }

    /// Cuts a triangle `cuts` times. Larger parts are cut more often.
    fn cut_at_grid_planes(
        &self,
        reference: TriangleReference,
        cuts: u32,
        corners: [Vec3; 3],
        pieces: &mut Vec<TriangleReference>,
    ) {
        let plane = if cuts == 0 { None } else { self.coarsest_plane(&reference.bounds) };
        let Some(GridPlane { axis, at, .. }) = plane else { return pieces.push(reference) };
        let halves = reference.split(axis, at, corners);
        let [left, right] = halves.map(|half| half.bounds.extent().truncate().max_element());
        let of_left = ((cuts - 1) as f32 * (left / (left + right)) + 0.5) as u32;
        self.cut_at_grid_planes(halves[0], of_left, corners, pieces);
        self.cut_at_grid_planes(halves[1], cuts - 1 - of_left.min(cuts - 1), corners, pieces);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_triangles_are_split() {
        let mesh: Vec<[Vec3; 3]> = (0..100)
            .map(|i| {
                let at = Vec3::new((i % 10) as f32, (i / 10) as f32, 0.0);
                if i == 7 {
                    [Vec3::ZERO, Vec3::splat(10.0), Vec3::new(9.9, 9.8, 10.0)]
                } else {
                    [at, at + Vec3::X, at + Vec3::Y]
                }
            })
            .collect();
        let references: Vec<_> =
            mesh.iter().zip(0..).map(|(&corners, id)| TriangleReference::new(id, corners)).collect();
        let pieces = split_large_triangles(&references, &|id| mesh[id as usize], &CancelToken::new())
            .expect("never canceled");
        let of = |id: u32| pieces.iter().filter(move |piece| piece.id() == id);
        assert!(of(7).count() > 10 && pieces.len() <= 130, "{} of {}", of(7).count(), pieces.len());
        assert!((0..100).all(|id| id == 7 || of(id).count() == 1));
        let area: f32 = of(7).map(|piece| piece.bounds.half_area()).sum();
        assert!(area < 0.2 * references[7].bounds.half_area(), "{area}");
    }
}
