//! Small cells: every plane through a face of a clipped triangle's box is tried ("perfect splits": Wald, Havran, *On
//! building fast kd-trees for ray tracing, and on doing that in O(N log N)*, 2006).

use super::bounds::{Bounds, Reference};
use super::cost::{Plane, Search};

/// Cells of at most this many references are swept.
pub const SWEPT: usize = 64;

/// The cheapest plane; none where a leaf is as cheap.
pub fn cheapest(references: &[Reference], cell: &Bounds) -> Option<Plane> {
    let mut search = Search::new(cell, references.len());
    for axis in 0..3 {
        sweep(references, axis, &mut search);
    }
    search.cheapest()
}

fn sweep(references: &[Reference], axis: usize, search: &mut Search<'_>) {
    let count = references.len().min(SWEPT);
    let (mut starts, mut ends) = ([0.0_f32; SWEPT], [0.0_f32; SWEPT]);
    let mut has_planar = false;
    for (place, reference) in references.iter().take(SWEPT).enumerate() {
        (starts[place], ends[place]) = (reference.bounds.min[axis], reference.bounds.max[axis]);
        has_planar |= starts[place] == ends[place];
    }
    let (starts, ends) = (&mut starts[..count], &mut ends[..count]);
    starts.sort_unstable_by(f32::total_cmp);
    ends.sort_unstable_by(f32::total_cmp);
    let (mut started, mut ended) = (0, 0);
    while ended < count {
        let at = starts.get(started).map_or(ends[ended], |start| start.min(ends[ended]));
        while ended < count && ends[ended] <= at {
            ended += 1;
        }
        let in_plane =
            |reference: &&Reference| reference.bounds.min[axis] == at && reference.bounds.max[axis] == at;
        let planar = if has_planar { references.iter().filter(in_plane).count() } else { 0 };
        search.offer(axis, at, started, count - ended, planar);
        while started < count && starts[started] <= at {
            started += 1;
        }
    }
}
