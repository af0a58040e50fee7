//! Shadow rays of many rows of vertices, put together by the light that they go to: rays to one corner of the scene meet the same
//! boxes on the way, those of one row go everywhere.

use super::light::{Sums, add_where};
use crate::geometry::rows::{Ends, RayRows, lanes};
use crate::lights::{Source, SourceRow};
use crate::math::lanes::{LANES, Lanes3};
use crate::world::{Geometry, Loops};

/// Rays of a row of vertices, and what they bring.
struct Pooled {
    /// The number of the row.
    row: u32,
    rays: RayRows,
    ends: Ends,
    /// A bit for each ray.
    traced: u32,
    sources: SourceRow,
    values: Lanes3,
}

/// Shadow rays that wait.
#[derive(Default)]
pub struct Pool {
    rows: Vec<Pooled>,
    /// The light's place in the tree of each ray, and its own row and lane.
    order: Vec<(u32, u32)>,
}

impl Pool {
    /// Rows of rays from which on they are traced before more come, while they are in the cache.
    const FULL: usize = 512;

    /// Whether they are to be traced now.
    pub fn is_full(&self) -> bool {
        self.rows.len() >= Self::FULL
    }

    /// Take the rays of `traced` of a row of vertices, with the places of their lights.
    #[inline(always)]
    pub(super) fn push(
        &mut self,
        row: u32,
        (rays, ends, traced): (RayRows, Ends, u32),
        sources: &SourceRow,
        values: &Lanes3,
        places: &[u32; LANES],
    ) {
        let number = self.rows.len() as u32 * LANES as u32;
        self.order.extend(lanes(traced).map(|i| (places[i], number + i as u32)));
        self.rows.push(Pooled { row, rays, ends, traced, sources: sources.clone(), values: *values });
    }

    /// Trace all rays and forget them; what arrives is added to the sums of the rows, in the order in which rays came.
    pub(super) fn trace(&mut self, geometry: &Geometry, sums: &mut [Sums]) {
        // Rays are not equal: the order is one.
        self.order.sort_unstable();
        let Self { rows, order } = self;
        geometry.instructions().run(Tracing { geometry, rows, order });
        for Pooled { row, traced, values, .. } in &*rows {
            add_where(*traced, values, &mut sums[*row as usize].light);
        }
        self.clear();
    }

    /// Forget all rays.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.order.clear();
    }
}

/// Takes the bits of rays that are stopped.
struct Tracing<'a> {
    geometry: &'a Geometry,
    rows: &'a mut [Pooled],
    order: &'a [(u32, u32)],
}

impl Loops for Tracing<'_> {
    type Done = ();

    #[inline(always)]
    fn run(self) {
        let Self { geometry, rows, order } = self;
        for rays in order.chunks(LANES) {
            let mut packet = RayRows::of([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            let mut ends = [-1.0; LANES];
            let mut sources = SourceRow::of(Source::Nothing);
            for (to, &(_, ray)) in rays.iter().enumerate() {
                let (row, from) = (&rows[ray as usize / LANES], ray as usize % LANES);
                for axis in 0..3 {
                    packet.origin[axis][to] = row.rays.origin[axis][from];
                    packet.direction[axis][to] = row.rays.direction[axis][from];
                }
                ends[to] = row.ends[from];
                sources.copy(to, &row.sources, from);
            }
            let traced = ((1_u64 << rays.len()) - 1) as u32;
            let occluded = geometry.occluded_rows(&packet, &ends, traced, &sources);
            for to in lanes(occluded) {
                let ray = rays[to].1 as usize;
                rows[ray / LANES].traced &= !(1 << (ray % LANES));
            }
        }
    }
}
