//! Queue of vertex packets that await direct lighting, and the light that the vertices reflect.

use std::ops::Range;

use super::all_lights::SampleAllLights;
use super::light_sums::LightSums;
use super::lobe_rays::LobeRayTracingKernel;
use super::mis::CompetingTechnique;
use super::shadow_lift::ShadowOriginLiftKernel;
use super::shadow_rays::ShadowRayQueue;
use crate::control::Canceled;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::transport::accumulator::Accumulator;
use crate::integrators::transport::batch::{ALL, VertexBatch};
use crate::integrators::transport::cone::RayCone;
use crate::integrators::transport::interiors::{InteriorList, InteriorListPool};
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::ShadingVertex;
use crate::integrators::view::{PathAov, PathClasses};
use crate::materials::BxdfKind;
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, Vec3x16, lane};
use crate::scene::description::ShadowMode;

/// Vertices that await direct lighting. The result for a vertex does not depend on which vertices share its
/// packet.
#[derive(Default)]
pub struct DirectLightVertexQueue {
    rows: Vec<VertexBatch>,
    /// Number of packets in use. The remaining packets are kept for reuse.
    count: usize,
    /// Index of the packet to which single vertices are added, for each combination of BSDF kind, darkness,
    /// and number of sides. The packet may be full or unused.
    open: [[usize; BxdfKind::ALL.len()]; 4],
    /// Direct light reflected at the vertices of each path in this bounce.
    arrived: Vec<Vec3>,
    /// The parts of `arrived` from wide lobes at vertices that the camera sees. Empty if they are not needed.
    arrived_diffuse: Vec<Vec3>,
    /// Media at the vertices.
    interior_lists: InteriorListPool,
    /// Sums over the light samples at the packets of a group.
    sums: Vec<LightSums>,
    /// Shadow rays of several packets.
    pool: ShadowRayQueue,
    /// Ray cones at the vertices of this bounce's paths. Empty if ray cones are not used.
    cones: Vec<RayCone>,
}

/// The sides that a vertex represents. No light samples are visible from a dark side.
#[derive(Clone, Copy)]
pub enum ShadingSides<'m> {
    /// One side.
    OneSide {
        /// Whether the vertex is dark.
        is_dark: bool,
    },
    /// Both sides of the surface. No light samples are visible from the other side.
    TwoSides {
        /// Whether the vertex is dark.
        is_dark: bool,
        /// Ray origin on the other side.
        beyond: Vec3,
        /// The medium on the other side.
        interiors: &'m InteriorList,
    },
}

/// Number of packets in a group if lights are picked from a tree.
const MAX_GROUP_SIZE: usize = 64;

impl DirectLightVertexQueue {
    /// The queue is processed when it contains this many packets, while their data is still in the cache.
    const FULL: usize = 64;

    /// Minimum number of vertices in a packet. Smaller packets are merged into other packets.
    const MIN_OWN_ROW: u32 = 8;

    /// Whether the queued packets should be processed now.
    pub fn is_full(&self) -> bool {
        self.count >= Self::FULL
    }

    /// Begins a bounce with `paths` paths. If `has_cones`, also allocates ray cones for them. If
    /// `splits_lobes`, separates the light from wide lobes at vertices that the camera sees.
    pub fn begin_bounce(&mut self, paths: usize, has_cones: bool, splits_lobes: bool) {
        self.clear();
        self.cones.clear();
        self.cones.resize(if has_cones { paths } else { 0 }, RayCone::default());
        zero_and_resize(&mut self.arrived, paths);
        zero_and_resize(&mut self.arrived_diffuse, if splits_lobes { paths } else { 0 });
        self.interior_lists.clear();
    }

    /// Stores the ray cone at a path's vertex.
    pub fn store_ray_cone(&mut self, place: u32, cone: RayCone) {
        if let Some(own) = self.cones.get_mut(place as usize) {
            *own = cone;
        }
    }

    /// Ends the bounce of these paths and adds their direct light to the accumulator, in path order.
    pub fn accumulate_arrived_light(&mut self, paths: &[PathRay], accumulator: &mut Accumulator<'_>) {
        for (place, light) in self.arrived.iter().enumerate().filter(|(_, light)| **light != Vec3::ZERO) {
            let path = &paths[place];
            let (slot, only_specular_before) = (path.slot, path.state.only_specular_before);
            let visible = self.arrived_diffuse.get(place).copied().filter(|_| only_specular_before);
            let diffuse = accumulator.diffuse_part_of_light(place as u32, *light, visible);
            accumulator.add_clamped_direct(slot, (*light, diffuse), only_specular_before);
        }
    }

    /// Like [`DirectLightVertexQueue::accumulate_arrived_light`], for paths with consecutive slots.
    pub fn accumulate_arrived_light_in_slots(&mut self, first: u32, accumulator: &mut Accumulator<'_>) {
        accumulator.add_direct_to_consecutive_slots(first, &self.arrived, &self.arrived_diffuse);
    }

    /// Returns an unused packet. The caller fills it, and then keeps it with
    /// [`DirectLightVertexQueue::commit_spare_vertices`] or discards it.
    pub fn spare_batch(&mut self) -> &mut VertexBatch {
        if self.count == self.rows.len() {
            self.rows.push(VertexBatch::empty());
        }
        &mut self.rows[self.count]
    }

    /// Keeps the vertices in the spare packet.
    pub fn commit_spare_vertices(&mut self) {
        let (kept, spare) = self.rows.split_at_mut(self.count);
        let Some(row) = spare.first_mut().filter(|row| row.used != 0) else { return };
        row.clear_lanes_outside(row.used);
        if row.used.count_ones() >= Self::MIN_OWN_ROW {
            self.count += 1;
            return;
        }
        // Merge a small packet with other packets of the same kind.
        let mut left = row.used;
        let open = &mut self.open[0][row.bsdf.kind() as usize];
        if let Some(open) =
            kept.get_mut(*open).filter(|open| open.has_kind_and_flags(row.bsdf.kind(), (false, false)))
        {
            for lane in set_bit_lanes(row.used).take((ALL & !open.used).count_ones() as usize) {
                open.copy_vertex_from(open.used.trailing_ones() as usize, row, lane);
                left &= !(1 << lane);
            }
        }
        if left != 0 {
            row.clear_lanes_outside(left);
            *open = self.count;
            self.count += 1;
        }
    }

    /// Adds a vertex to the queue for direct lighting.
    #[inline(always)]
    pub fn push(
        &mut self,
        tile: &TileContext<'_>,
        lit: &ShadingVertex<'_>,
        aov: PathAov,
        sides: ShadingSides<'_>,
    ) {
        self.store_ray_cone(lit.place, lit.vertex.cone);
        let interiors = self.interior_lists.push_list(lit.interiors);
        let far_side = match sides {
            ShadingSides::OneSide { .. } => None,
            ShadingSides::TwoSides { beyond, interiors, .. } => {
                Some((beyond, self.interior_lists.push_list(interiors)))
            }
        };
        let (row, lane) = match sides {
            ShadingSides::OneSide { is_dark } => {
                self.packet_with_free_lane(lit.bsdf.kind(), (is_dark, false))
            }
            ShadingSides::TwoSides { is_dark, .. } => {
                self.packet_with_free_lane(lit.bsdf.kind(), (is_dark, true))
            }
        };
        row.set_vertex(lane, tile, lit, aov, interiors);
        if let Some((beyond, interiors)) = far_side {
            row.set_far_side_origin(lane, beyond, interiors);
        }
    }

    /// Returns a packet for this kind of BSDF and the index of a free lane in the packet. `which` specifies
    /// whether the vertex is dark and whether it is two-sided.
    fn packet_with_free_lane(&mut self, kind: BxdfKind, which: (bool, bool)) -> (&mut VertexBatch, usize) {
        let (is_dark, has_two_sides) = which;
        let table = usize::from(is_dark) + 2 * usize::from(has_two_sides);
        let mut number = self.open[table][kind as usize];
        let is_open = |row: &VertexBatch| row.used != ALL && row.has_kind_and_flags(kind, which);
        if number >= self.count || !is_open(&self.rows[number]) {
            let row = self.spare_batch();
            row.reset();
            row.bsdf.set_kind(kind);
            (row.is_dark, row.has_two_sides) = which;
            number = self.count;
            self.open[table][kind as usize] = number;
            self.count += 1;
        }
        let row = &mut self.rows[number];
        let lane = row.used.trailing_ones() as usize;
        (row, lane)
    }

    /// Removes all vertices.
    pub fn clear(&mut self) {
        (self.count, self.open) = (0, Default::default());
        // A canceled bounce may have left rays in the pool.
        self.pool.clear();
    }

    /// Groups of consecutive packets whose lights are sampled together.
    pub fn jointly_sampled_packet_ranges(
        &self,
        tile: &TileContext<'_>,
    ) -> impl Iterator<Item = Range<usize>> + use<> {
        let (count, picks_lights) =
            (self.count, tile.world.lights.sampler_for_purpose(tile.behavior.receivers).is_some());
        let size = if picks_lights { MAX_GROUP_SIZE } else { 1 };
        (0..count).step_by(size).map(move |first| first..(first + size).min(count))
    }

    /// A packet of vertices.
    pub fn batch_at_index(&self, number: usize) -> &VertexBatch {
        &self.rows[number]
    }

    /// Media at the vertices.
    pub fn interior_lists(&self) -> &InteriorListPool {
        &self.interior_lists
    }

    /// Ray cones at the vertices, indexed by queue index. Empty if ray cones are not used.
    pub fn cones_by_path_index(&self) -> &[RayCone] {
        &self.cones
    }

    /// Samples lights at the packets of a group and traces the shadow rays. Must be called before
    /// [`Self::add_lobe_ray_light`]. `shares_with_paths` is true if continuing paths compete with the
    /// light samples.
    pub fn sample_group_lights(
        &mut self,
        group: Range<usize>,
        tile: &TileContext<'_>,
        aov: PathAov,
        shares_with_paths: bool,
    ) -> Result<(), Canceled> {
        // The sums of a group are large, so their buffer is reused.
        let mut sums = std::mem::take(&mut self.sums);
        sums.clear();
        // Sample lights at each packet, and pool the shadow rays to picked lights.
        for number in group {
            tile.token.check_pause_and_cancel()?;
            let row = &mut self.rows[number];
            if row.may_lift != 0 {
                tile.world
                    .geometry
                    .instruction_set()
                    .run(ShadowOriginLiftKernel { geometry: &tile.world.geometry, row });
            }
            let request = DirectLightPacketRequest::new(number, row, aov, shares_with_paths);
            sums.push(self.sample_packet_lights(request, tile, aov, sums.len() as u32));
            if self.pool.is_full() {
                self.pool.trace(tile, aov, &mut sums);
            }
        }
        // Trace the remaining pooled rays.
        self.pool.trace(tile, aov, &mut sums);
        self.sums = sums;
        Ok(())
    }

    /// Adds the light found by lobe rays to the reflected light of packet `index` in the group passed to
    /// [`Self::sample_group_lights`], and returns the sums. `number` is the index of the packet in the queue.
    pub fn add_lobe_ray_light(
        &mut self,
        (index, number): (usize, usize),
        tile: &TileContext<'_>,
        aov: PathAov,
        shares_with_paths: bool,
    ) -> &mut LightSums {
        if aov == PathAov::LitFraction {
            self.sums[index].replace_light_with_lit_fraction();
        }
        let row = &self.rows[number];
        let request = DirectLightPacketRequest::new(number, row, aov, shares_with_paths);
        match self.competing_technique(request, tile, aov) {
            CompetingTechnique::Lobes(sharp) => {
                let interior_lists = interiors_of_batch(&self.interior_lists, row);
                let sums = &mut self.sums[index];
                LobeRayTracingKernel { tile, row, sharp, aov, interior_lists, sums }.trace();
            }
            CompetingTechnique::Nothing | CompetingTechnique::Paths | CompetingTechnique::NarrowPaths => {}
        }
        &mut self.sums[index]
    }

    /// The technique that competes with light samples at a packet.
    fn competing_technique(
        &self,
        request: DirectLightPacketRequest,
        tile: &TileContext<'_>,
        aov: PathAov,
    ) -> CompetingTechnique {
        let is_soft = tile.settings.render.shadows == ShadowMode::Soft;
        let row = &self.rows[request.number];
        if request.shares_with_paths {
            CompetingTechnique::Paths
        } else if row.bsdf.extends_narrow_lobe_paths() && is_soft && tile.behavior.mirrors {
            CompetingTechnique::NarrowPaths
        } else if row.bsdf.extends_narrow_lobe_paths() && !is_soft && aov != PathAov::LitFraction {
            // Paths in microfacet lobes do not account for lights.
            CompetingTechnique::from_sharp_vertex_mask(row.bsdf.narrow_lobe_mask() & request.used)
        } else {
            CompetingTechnique::from_sharp_vertex_mask(row.sharp_lobe_mask(tile, aov) & request.used)
        }
    }

    /// Samples lights at a packet. Shadow rays to picked lights are pooled under index `number`.
    fn sample_packet_lights(
        &mut self,
        request: DirectLightPacketRequest,
        tile: &TileContext<'_>,
        aov: PathAov,
        number: u32,
    ) -> LightSums {
        if request.used == 0 {
            return LightSums::ZERO;
        }
        let mut pool = std::mem::take(&mut self.pool);
        let row = &self.rows[request.number];
        let (competing, interior_lists) =
            (self.competing_technique(request, tile, aov), interiors_of_batch(&self.interior_lists, row));
        let lighting = SampleAllLights::<true> {
            tile,
            row,
            used: request.used,
            aov,
            competing,
            interior_lists,
            only_infinite: false,
            splits_lobes: self.splits_lobes(row),
        };
        let sums = lighting.sample_all_or_picked_lights(number, &mut pool);
        self.pool = pool;
        sums
    }

    /// Whether the light from wide lobes must be summed separately at a packet.
    pub fn splits_lobes(&self, row: &VertexBatch) -> bool {
        self.reflected_light_split(row) == ReflectedLightSplit::Mixed
    }

    /// How to divide a packet's reflected light.
    fn reflected_light_split(&self, row: &VertexBatch) -> ReflectedLightSplit {
        if self.arrived_diffuse.is_empty() || row.only_specular_before == 0 {
            return ReflectedLightSplit::Unused;
        }
        match (row.bsdf.has_wide_lobes(), row.bsdf.has_narrow_lobes()) {
            (_, false) => ReflectedLightSplit::OnlyWide,
            (false, true) => ReflectedLightSplit::OnlyNarrow,
            (true, true) => ReflectedLightSplit::Mixed,
        }
    }

    /// Adds reflected light, and if `splits_lobes` its part from wide lobes, to packet `index` in the group.
    pub fn add_to_packet_sums(
        &mut self,
        (index, number): (usize, usize),
        light: &[Vec3x16; 2],
        splits_lobes: bool,
    ) {
        self.sums[index].add_lanes(self.rows[number].used, light, splits_lobes);
    }

    /// Adds the reflected light of packet `index` in the group to its paths. A path has two vertices at a
    /// transmissive surface.
    pub fn add_packet_light_to_paths(&mut self, (index, number): (usize, usize), aov: PathAov) {
        let (row, arrived) = (&self.rows[number], &self.sums[index]);
        let light = match aov {
            PathAov::Radiance(_) | PathAov::LitFraction => row.times_throughput(&arrived.light),
            PathAov::TraversalCost => arrived.light,
        };
        let diffuse = match self.reflected_light_split(row) {
            ReflectedLightSplit::Unused | ReflectedLightSplit::OnlyNarrow => None,
            ReflectedLightSplit::OnlyWide => Some(light),
            ReflectedLightSplit::Mixed => Some(row.times_throughput(&arrived.diffuse)),
        };
        if let Some(diffuse) = diffuse {
            for i in set_bit_lanes(row.used) {
                self.arrived_diffuse[row.place[i] as usize] += lane(&diffuse, i);
            }
        }
        match row.first_consecutive_queue_index() {
            Some(first) => {
                let own = &mut self.arrived[first as usize..][..PACKET_SIZE];
                for (i, own) in own.iter_mut().enumerate() {
                    *own += lane(&light, i);
                }
            }
            None => {
                for i in set_bit_lanes(row.used) {
                    self.arrived[row.place[i] as usize] += lane(&light, i);
                }
            }
        }
    }
}

/// How a packet's reflected light is divided into light from wide lobes and light from narrow lobes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ReflectedLightSplit {
    /// The parts are not needed.
    Unused,
    /// All lobes are wide.
    OnlyWide,
    /// All lobes are narrow.
    OnlyNarrow,
    /// The surfaces may have wide and narrow lobes.
    Mixed,
}

/// Media at a packet's vertices, or `None` if all vertices are in air.
fn interiors_of_batch<'a>(pool: &'a InteriorListPool, row: &VertexBatch) -> Option<&'a InteriorListPool> {
    (!pool.are_all_air() && row.has_vertex_in_glass()).then_some(pool)
}

/// Resizes a vector and sets all its elements to zero.
fn zero_and_resize(sums: &mut Vec<Vec3>, count: usize) {
    // `Vec::resize` writes one component at a time, so it is used only for new elements.
    sums.truncate(count);
    bytemuck::fill_zeroes(sums);
    sums.resize(count, Vec3::ZERO);
}

/// Mask of vertices whose direct light is visible in the view and may be nonzero.
fn contributing_vertex_mask(row: &VertexBatch, aov: PathAov) -> u32 {
    if row.is_dark {
        return 0;
    }
    let PathClasses { direct, indirect, .. } = aov.path_classes();
    let hidden = |bits: u32, is_shown: bool| if is_shown { 0 } else { bits };
    !(hidden(row.only_specular_before, direct) | hidden(!row.only_specular_before, indirect))
}

/// Request to compute direct lighting at a packet of vertices.
#[derive(Clone, Copy)]
struct DirectLightPacketRequest {
    /// Index of the packet.
    number: usize,
    /// Mask of vertices for which to compute direct lighting.
    used: u32,
    /// Whether continuing paths compete with the light samples.
    shares_with_paths: bool,
}

impl DirectLightPacketRequest {
    fn new(number: usize, row: &VertexBatch, aov: PathAov, shares_with_paths: bool) -> Self {
        Self { number, used: row.used & contributing_vertex_mask(row, aov), shares_with_paths }
    }
}
