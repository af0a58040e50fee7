//! Ear clipping (Meisters, *Polygons Have Ears*, American Mathematical Monthly 1975) for polygons that may
//! touch themselves. Corners may be repeated or may be on other edges, and holes may be connected to the
//! outline by a double edge.

use std::collections::VecDeque;

use super::tree::{CornerTree, twice_signed_area};
use crate::math::DVec2;

/// Maximum number of visits to corners and tree nodes: this many per corner, plus [`EXTRA_VISITS`]. Simple
/// polygons need about 50 visits per corner. Polygons that wind around the same corners many times may exceed
/// the limit, after which corners are clipped without being tested.
const VISITS_PER_CORNER: u64 = 200;
const EXTRA_VISITS: u64 = 1_000_000;

/// Marks a clipped corner or the end of a list.
const NONE: u32 = u32::MAX;

/// Triangulates a counterclockwise polygon. Returns whether all cuts are diagonals, which is false for
/// self-intersecting polygons.
pub(super) fn clip_ears_and_check_simple(points: &[DVec2], emit: impl FnMut([usize; 3])) -> bool {
    EarClipper::new(points, emit).run()
}

/// Like [`clip_ears_and_check_simple`], but also returns the number of visits.
#[cfg(test)]
pub(super) fn clip_ears_and_count_visits(points: &[DVec2]) -> (bool, u64) {
    let mut clipper = EarClipper::new(points, |_| {});
    (clipper.run(), clipper.visits)
}

struct EarClipper<'a, F> {
    points: &'a [DVec2],
    emit: F,
    next: Vec<u32>,
    previous: Vec<u32>,
    remaining: usize,
    tree: CornerTree,
    /// Corners to test, each with a stamp. Entries with an outdated stamp are skipped.
    queue: VecDeque<(u32, u32)>,
    stamps: Vec<u32>,
    /// For each corner, the head of its list of blocked corners. The lists are stored in `waiting`.
    first_waiting: Vec<u32>,
    waiting: Vec<(u32, u32, u32)>,
    visits: u64,
    max_visits: u64,
}

impl<'a, F: FnMut([usize; 3])> EarClipper<'a, F> {
    fn new(points: &'a [DVec2], emit: F) -> Self {
        let count = points.len() as u32;
        Self {
            points,
            emit,
            next: (1..count).chain([0]).collect(),
            previous: [count - 1].into_iter().chain(0..count - 1).collect(),
            remaining: points.len(),
            tree: CornerTree::new(points),
            queue: (0..count).map(|corner| (corner, 0)).collect(),
            stamps: vec![0; points.len()],
            first_waiting: vec![NONE; points.len()],
            waiting: Vec::new(),
            visits: 0,
            max_visits: VISITS_PER_CORNER * u64::from(count) + EXTRA_VISITS,
        }
    }

    fn run(&mut self) -> bool {
        let mut is_simple = true;
        while self.remaining > 2 {
            self.clip_queued();
            if self.remaining <= 2
                || self.clip_first_accepted(|clipper, corner| clipper.find_blocker(corner, true).is_none())
            {
                continue;
            }
            is_simple = false;
            // Clip any convex corner. If no corner is convex, the rest of the polygon has no positive area.
            if !self.clip_first_accepted(|_, _| true) {
                break;
            }
        }
        is_simple && self.visits <= self.max_visits
    }

    /// Clips ears until the queue is empty.
    fn clip_queued(&mut self) {
        while let Some((corner, stamp)) = self.queue.pop_front() {
            if self.stamps[corner as usize] != stamp || self.remaining <= 2 {
                continue;
            }
            if self.is_spike(corner) {
                self.clip_corner(corner);
            } else if self.is_convex(corner) {
                match self.find_blocker(corner, false) {
                    None => self.clip_corner(corner),
                    Some(blocker) => self.wait_for_blocker(corner, stamp, blocker),
                }
            }
        }
    }

    /// Clips the first convex corner that `is_ear` accepts.
    fn clip_first_accepted(&mut self, is_ear: impl Fn(&mut Self, u32) -> bool) -> bool {
        let Some(start) = self.next.iter().position(|next| *next != NONE) else { return false };
        let mut corner = start as u32;
        for _ in 0..self.remaining {
            if self.is_convex(corner) && is_ear(self, corner) {
                self.clip_corner(corner);
                return true;
            }
            corner = self.next[corner as usize];
        }
        false
    }

    fn point(&self, corner: u32) -> DVec2 {
        self.points[corner as usize]
    }

    fn corner_with_neighbors(&self, corner: u32) -> [u32; 3] {
        [self.previous[corner as usize], corner, self.next[corner as usize]]
    }

    fn is_convex(&self, corner: u32) -> bool {
        let [a, b, c] = self.corner_with_neighbors(corner).map(|corner| self.point(corner));
        twice_signed_area(a, b, c) > 0.0
    }

    /// Whether the outline reverses direction at a corner.
    fn is_spike(&self, corner: u32) -> bool {
        let [a, b, c] = self.corner_with_neighbors(corner).map(|corner| self.point(corner));
        twice_signed_area(a, b, c) == 0.0 && (a - b).dot(c - b) >= 0.0
    }

    /// Removes a corner, and emits its triangle unless the triangle has zero area.
    fn clip_corner(&mut self, corner: u32) {
        let [a, b, c] = self.corner_with_neighbors(corner);
        if self.is_convex(b) {
            (self.emit)([a, b, c].map(|corner| corner as usize));
        }
        self.next[a as usize] = c;
        self.previous[c as usize] = a;
        self.next[b as usize] = NONE;
        self.stamps[b as usize] += 1;
        self.remaining -= 1;
        self.tree.remove(b);
        for changed in [b, a, c] {
            self.requeue_blocked_by(changed);
        }
        for neighbor in [a, c] {
            self.append_corner_to_queue(neighbor);
        }
    }

    /// Appends a corner to the queue. Clipping corners in queue order spreads the cuts along the outline,
    /// which avoids slivers.
    fn append_corner_to_queue(&mut self, corner: u32) {
        let stamp = &mut self.stamps[corner as usize];
        *stamp += 1;
        self.queue.push_back((corner, *stamp));
    }

    fn wait_for_blocker(&mut self, corner: u32, stamp: u32, blocker: u32) {
        let first = &mut self.first_waiting[blocker as usize];
        self.waiting.push((corner, stamp, *first));
        *first = (self.waiting.len() - 1) as u32;
    }

    /// Queues the corners blocked by `blocker`.
    fn requeue_blocked_by(&mut self, blocker: u32) {
        let mut entry = std::mem::replace(&mut self.first_waiting[blocker as usize], NONE);
        while entry != NONE {
            let (corner, stamp, next) = self.waiting[entry as usize];
            if self.stamps[corner as usize] == stamp {
                self.append_corner_to_queue(corner);
            }
            entry = next;
        }
    }

    /// Finds a corner that prevents a convex corner from being an ear: one at which the outline enters the
    /// convex corner's triangle. Unless `may_touch` is true, corners on the diagonal also count, because the
    /// triangles on its two sides would not share these vertices.
    fn find_blocker(&mut self, corner: u32, may_touch: bool) -> Option<u32> {
        if self.visits > self.max_visits {
            return None;
        }
        let around = self.corner_with_neighbors(corner);
        let triangle = around.map(|corner| self.point(corner));
        let mut visits = self.visits;
        let found = self.tree.search_near_triangle(triangle, &mut visits, |other| {
            self.next[other as usize] != NONE
                && !around.contains(&other)
                && self.outline_enters_triangle_at(triangle, other, may_touch)
        });
        self.visits = visits;
        found
    }

    /// Whether the outline enters a triangle's interior at this corner. Unless `may_touch` is true, corners
    /// on the diagonal also count.
    fn outline_enters_triangle_at(&self, triangle: [DVec2; 3], corner: u32, may_touch: bool) -> bool {
        let [a, _, c] = triangle;
        let point = self.point(corner);
        let turns = edge_functions(triangle, point);
        if turns.iter().any(|turn| *turn < 0.0) {
            return false;
        }
        if !may_touch && turns[2] == 0.0 && point != a && point != c {
            return true;
        }
        // If the corner is on the triangle's boundary, the outline enters the triangle if a neighbor is
        // inside every side that the corner is on.
        [self.previous[corner as usize], self.next[corner as usize]].into_iter().any(|neighbor| {
            let sides = self::edge_functions(triangle, self.point(neighbor));
            (0..3).all(|side| turns[side] > 0.0 || sides[side] > 0.0)
        })
    }
}

/// Returns which side of each triangle edge a point is on. Positive values are inside.
fn edge_functions([a, b, c]: [DVec2; 3], point: DVec2) -> [f64; 3] {
    [twice_signed_area(a, b, point), twice_signed_area(b, c, point), twice_signed_area(c, a, point)]
}
