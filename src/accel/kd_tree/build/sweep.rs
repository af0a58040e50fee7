//! Small cells: every plane through a face of a clipped triangle's box is tried ("perfect splits": Wald, Havran, *On
//! building fast kd-trees for ray tracing, and on doing that in O(N log N)*, 2006).

use super::cost::{Plane, Search};
use crate::accel::reference::{Bounds, Reference};

/// Cells of at most this many references are swept.
pub const SWEPT: usize = 24;

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
        (starts[place], ends[place]) = (reference.bounds.min[axis], reference.bounds.max()[axis]);
        has_planar |= starts[place] == ends[place];
    }
    let (starts, ends) = (&mut starts[..count], &mut ends[..count]);
    sort(starts);
    sort(ends);
    let planar_at = |at: f32| {
        let is_planar = |own: &&Reference| own.bounds.min[axis] == at && own.bounds.max()[axis] == at;
        if has_planar { references.iter().filter(is_planar).count() } else { 0 }
    };
    search.along(axis, |across| {
        let (mut started, mut ended) = (0, 0);
        while ended < count {
            let at = starts.get(started).map_or(ends[ended], |start| start.min(ends[ended]));
            while ended < count && ends[ended] <= at {
                ended += 1;
            }
            across.offer(at, started, count - ended, planar_at(at));
            while started < count && starts[started] <= at {
                started += 1;
            }
        }
    });
}

/// Ascending. By insertion, which is quickest for few numbers that are nearly in order, as parents leave them not seldom.
fn sort(numbers: &mut [f32]) {
    for end in 1..numbers.len() {
        let number = numbers[end];
        let mut place = end;
        while place > 0 && numbers[place - 1] > number {
            numbers[place] = numbers[place - 1];
            place -= 1;
        }
        numbers[place] = number;
    }
}
