//! Shadow rays from many vertex packets, regrouped by light. Rays to nearby lights visit the same bounding
//! boxes, whereas the rays of one packet diverge.

use super::all_lights::convert_transmittance_for_aov;
use super::light_sums::{LightSums, add_masked_lane_products, add_masked_lanes};
use crate::geometry::packet::{F32x16, RayPacket, set_bit_lanes};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::view::PathAov;
use crate::lights::{GeometryOfLight, GeometryOfLightPacket};
use crate::math::lanes::{PACKET_SIZE, Simd, Vec3x16, lane, set_lane};
use crate::world::{SimdKernel, World};

/// Shadow rays from one vertex packet, and their contributions.
#[repr(align(64))]
struct QueuedShadowRays {
    /// Index of the vertex packet.
    row: u32,
    rays: RayPacket,
    ends: F32x16,
    /// Mask of rays to trace.
    traced: u32,
    sources: GeometryOfLightPacket,
    values: Vec3x16,
    /// Whether [`ShadowRayQueue::fractions`] contains the fractions of `values` from wide lobes.
    has_fraction: bool,
}

/// Queue of shadow rays from many vertex packets.
#[derive(Default)]
pub struct ShadowRayQueue {
    rows: Vec<QueuedShadowRays>,
    /// Fractions of the contributions from wide lobes, for the rows that have them.
    fractions: Vec<Vec3x16>,
    /// For each ray, the tree position of its light, and the ray's row and lane.
    order: Vec<(u32, u32)>,
    /// Rows and lanes of the rays, grouped by light.
    sorted: Vec<u32>,
}

/// Maximum number of light groups.
const MAX_GROUPS: usize = 1 << GROUP_BITS;
const GROUP_BITS: u32 = 11;

impl ShadowRayQueue {
    /// The queued rays are traced when they come from this many packets, while they are still in the cache.
    const FULL: usize = 512;

    /// Whether the queued rays should be traced now.
    pub fn is_full(&self) -> bool {
        self.rows.len() >= Self::FULL
    }

    /// Queues a vertex packet's rays selected by `traced`, along with the tree positions of their lights.
    #[inline(always)]
    pub fn push_packet(
        &mut self,
        row: u32,
        (rays, ends, traced): (RayPacket, F32x16, u32),
        sources: &GeometryOfLightPacket,
        (values, fraction): (&Vec3x16, Option<&Vec3x16>),
        places: &[u32; PACKET_SIZE],
    ) {
        let number = self.rows.len() as u32 * PACKET_SIZE as u32;
        self.order.extend(set_bit_lanes(traced).map(|i| (places[i], number + i as u32)));
        self.rows.push(QueuedShadowRays {
            row,
            rays,
            ends,
            traced,
            sources: sources.clone(),
            values: *values,
            has_fraction: fraction.is_some(),
        });
        self.fractions.extend(fraction);
    }

    /// Traces and removes all rays, and adds the unoccluded light to the packets' sums in queue order.
    pub fn trace(&mut self, tile: &TileContext<'_>, aov: PathAov, sums: &mut [LightSums]) {
        if self.rows.is_empty() {
            return;
        }
        self.group_by_light_tree_position();
        let Self { rows, fractions, sorted, .. } = self;
        let world = tile.world;
        world.geometry.instruction_set().run(ShadowRayKernel { world, aov, rows, rays: sorted });
        let mut fractions = fractions.iter();
        for QueuedShadowRays { row, traced, values, has_fraction, .. } in &*rows {
            let sums = &mut sums[*row as usize];
            add_masked_lanes(*traced, values, &mut sums.light);
            if *has_fraction && let Some(fraction) = fractions.next() {
                add_masked_lane_products(*traced, values, fraction, &mut sums.diffuse);
            }
        }
        self.clear();
    }

    /// Groups rays by ranges of tree positions with a counting sort. Rays within a group keep their order.
    fn group_by_light_tree_position(&mut self) {
        let Self { order, sorted, .. } = self;
        let largest = order.iter().map(|&(place, _)| place).max().unwrap_or(0);
        let shift = (u32::BITS - largest.leading_zeros()).saturating_sub(GROUP_BITS);
        let mut starts = [0; MAX_GROUPS + 1];
        for (place, _) in &*order {
            starts[(place >> shift) as usize + 1] += 1;
        }
        for run in 1..MAX_GROUPS {
            starts[run] += starts[run - 1];
        }
        sorted.resize(order.len(), 0);
        for &(place, ray) in &*order {
            let start = &mut starts[(place >> shift) as usize];
            sorted[*start] = ray;
            *start += 1;
        }
    }

    /// Removes all rays.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.fractions.clear();
        self.order.clear();
    }
}

/// Traces the queued rays and clears the bits of occluded rays in [`QueuedShadowRays::traced`].
struct ShadowRayKernel<'a> {
    world: &'a World,
    aov: PathAov,
    rows: &'a mut [QueuedShadowRays],
    /// Rows and lanes of the rays.
    rays: &'a [u32],
}

impl SimdKernel for ShadowRayKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: impl Simd) {
        let Self { world, aov, rows, rays } = self;
        for rays in rays.chunks(PACKET_SIZE) {
            let mut packet = RayPacket::from_soa([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
            let mut ends = [-1.0; PACKET_SIZE];
            let mut sources = GeometryOfLightPacket::splat(GeometryOfLight::Nothing);
            for (to, &ray) in rays.iter().enumerate() {
                let (row, from) = (&rows[ray as usize / PACKET_SIZE], ray as usize % PACKET_SIZE);
                for axis in 0..3 {
                    packet.origin[axis][to] = row.rays.origin[axis][from];
                    packet.direction[axis][to] = row.rays.direction[axis][from];
                }
                packet.start[to] = row.rays.start[from];
                ends[to] = row.ends[from];
                sources.copy_lane(to, &row.sources, from);
            }
            let traced = ((1_u64 << rays.len()) - 1) as u32;
            let occluded = if world.has_null_interaction_surfaces() {
                attenuate_queued_contributions(world, aov, (&packet, &ends, traced), &sources, (rows, rays))
            } else {
                world.geometry.occluded_ray_mask(&packet, &ends, traced, &sources, simd)
            };
            for to in set_bit_lanes(occluded) {
                let ray = rays[to] as usize;
                rows[ray / PACKET_SIZE].traced &= !(1 << (ray % PACKET_SIZE));
            }
        }
    }
}

/// Multiplies the contributions of rays by the transmittance of null interactions. Returns the mask of rays
/// with zero transmittance.
#[cold]
#[inline(never)]
fn attenuate_queued_contributions(
    world: &World,
    aov: PathAov,
    (packet, ends, traced): (&RayPacket, &F32x16, u32),
    sources: &GeometryOfLightPacket,
    (rows, rays): (&mut [QueuedShadowRays], &[u32]),
) -> u32 {
    let weakened = world.transmittance_packet(packet, ends, traced, sources);
    for from in set_bit_lanes(traced & !weakened.occluded) {
        let left = convert_transmittance_for_aov(lane(&weakened.left, from), aov);
        let (row, to) = (&mut rows[rays[from] as usize / PACKET_SIZE], rays[from] as usize % PACKET_SIZE);
        let value = lane(&row.values, to) * left;
        set_lane(&mut row.values, to, value);
    }
    weakened.occluded
}
