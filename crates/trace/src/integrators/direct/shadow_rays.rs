//! Shadow rays of many rows of vertices, grouped by light: rays to one corner of the scene visit the same boxes on the way, while
//! those of one row go everywhere.

use super::all_lights::{Sums, add_where, passed};
use crate::geometry::rows::{Ends, RayRows, lanes};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::Measure;
use crate::lights::{Source, SourceRow};
use crate::math::lanes::{Folds, LANES, Lanes3, lane, set_lane};
use crate::world::{Loops, World};

/// Rays of a row of vertices, and their contributions.
struct QueuedRow {
    /// The number of the row.
    row: u32,
    rays: RayRows,
    ends: Ends,
    /// A bit for each ray.
    traced: u32,
    sources: SourceRow,
    values: Lanes3,
}

/// Shadow rays that wait to be traced.
#[derive(Default)]
pub struct ShadowRayQueue {
    rows: Vec<QueuedRow>,
    /// Each ray's light, by its place in the tree, with the ray's own row and lane.
    order: Vec<(u32, u32)>,
    /// Rows and lanes of the rays, grouped by place.
    sorted: Vec<u32>,
}

/// Most groups of places.
const RUNS: usize = 1 << RUN_BITS;
const RUN_BITS: u32 = 11;

impl ShadowRayQueue {
    /// Number of rows of rays from which they are traced before more come, while they are in the cache.
    const FULL: usize = 512;

    /// Whether the rays are to be traced now.
    pub fn is_full(&self) -> bool {
        self.rows.len() >= Self::FULL
    }

    /// Takes the rays of `traced` of a row of vertices, with the places of their lights.
    #[inline(always)]
    pub fn push(
        &mut self,
        row: u32,
        (rays, ends, traced): (RayRows, Ends, u32),
        sources: &SourceRow,
        values: &Lanes3,
        places: &[u32; LANES],
    ) {
        let number = self.rows.len() as u32 * LANES as u32;
        self.order.extend(lanes(traced).map(|i| (places[i], number + i as u32)));
        self.rows.push(QueuedRow { row, rays, ends, traced, sources: sources.clone(), values: *values });
    }

    /// Traces all rays and drops them; adds the light that arrives to the sums of the rows, in the order in which rays
    /// came.
    pub fn trace(&mut self, tile: &TileContext<'_>, measure: Measure, sums: &mut [Sums]) {
        if self.rows.is_empty() {
            return;
        }
        self.sort();
        let Self { rows, sorted, .. } = self;
        let world = tile.world;
        world.geometry.instructions().run(Tracing { world, measure, rows, rays: sorted });
        for QueuedRow { row, traced, values, .. } in &*rows {
            add_where(*traced, values, &mut sums[*row as usize].light);
        }
        self.clear();
    }

    /// Groups rays by ranges of consecutive places, by counting; rays of a group stay in their order.
    fn sort(&mut self) {
        let Self { order, sorted, .. } = self;
        let greatest = order.iter().map(|&(place, _)| place).max().unwrap_or(0);
        let shift = (u32::BITS - greatest.leading_zeros()).saturating_sub(RUN_BITS);
        let mut starts = [0; RUNS + 1];
        for (place, _) in &*order {
            starts[(place >> shift) as usize + 1] += 1;
        }
        for run in 1..RUNS {
            starts[run] += starts[run - 1];
        }
        sorted.resize(order.len(), 0);
        for &(place, ray) in &*order {
            let start = &mut starts[(place >> shift) as usize];
            sorted[*start] = ray;
            *start += 1;
        }
    }

    /// Drops all rays.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.order.clear();
    }
}

/// Test that finds the rays which are occluded.
struct Tracing<'a> {
    world: &'a World,
    measure: Measure,
    rows: &'a mut [QueuedRow],
    /// Their rows and lanes.
    rays: &'a [u32],
}

impl Loops for Tracing<'_> {
    type Done = ();

    #[inline(always)]
    fn run(self, folds: impl Folds) {
        let Self { world, measure, rows, rays } = self;
        for rays in rays.chunks(LANES) {
            let mut packet = RayRows::of([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            let mut ends = [-1.0; LANES];
            let mut sources = SourceRow::of(Source::Nothing);
            for (to, &ray) in rays.iter().enumerate() {
                let (row, from) = (&rows[ray as usize / LANES], ray as usize % LANES);
                for axis in 0..3 {
                    packet.origin[axis][to] = row.rays.origin[axis][from];
                    packet.direction[axis][to] = row.rays.direction[axis][from];
                }
                packet.start[to] = row.rays.start[from];
                ends[to] = row.ends[from];
                sources.copy(to, &row.sources, from);
            }
            let traced = ((1_u64 << rays.len()) - 1) as u32;
            let occluded = if world.has_passable() {
                weaken(world, measure, (&packet, &ends, traced), &sources, (rows, rays))
            } else {
                world.geometry.occluded_rows(&packet, &ends, traced, &sources, folds)
            };
            for to in lanes(occluded) {
                let ray = rays[to] as usize;
                rows[ray / LANES].traced &= !(1 << (ray % LANES));
            }
        }
    }
}

/// Weakens the contributions of rays by what they pass straight on; returns a bit for each on which nothing is left.
#[cold]
#[inline(never)]
fn weaken(
    world: &World,
    measure: Measure,
    (packet, ends, traced): (&RayRows, &Ends, u32),
    sources: &SourceRow,
    (rows, rays): (&mut [QueuedRow], &[u32]),
) -> u32 {
    let weakened = world.weakened_rows(packet, ends, traced, sources);
    for from in lanes(traced & !weakened.occluded) {
        let left = passed(lane(&weakened.left, from), measure);
        let (row, to) = (&mut rows[rays[from] as usize / LANES], rays[from] as usize % LANES);
        let value = lane(&row.values, to) * left;
        set_lane(&mut row.values, to, value);
    }
    weakened.occluded
}
