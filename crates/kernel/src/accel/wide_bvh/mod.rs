//! A BVH over triangles with eight children per node and four triangles per pack.
//!
//! Hits are bit-identical on every instruction set. Box tests are conservative, the triangle test always uses
//! the same arithmetic, and the lowest id wins among hits at the same distance.

mod build;
mod node;
mod simd;

use crate::control::{CancelToken, Canceled};
use crate::geometry::packet::set_bit_lanes;
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;

pub use simd::{InstructionSet, SimdKernel, pages};

use crate::accel::{F32x16, PACKET_SIZE, RayBoxInterval, VisitedNode};

use node::{TrianglePack, WideNode};

/// An eight-wide BVH over triangles.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// Nodes, starting with the root. Empty if there are no triangles.
    nodes: Vec<WideNode>,
    packs: Vec<TrianglePack>,
    bounds: Aabb,
    instructions: InstructionSet,
    quality: BuildQuality,
}

/// Build quality of a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildQuality {
    /// Each triangle is in one leaf.
    #[default]
    Medium,
    /// Triangles that fill little of their boxes are split, and may be in several leaves.
    High,
}

impl WideBvh {
    /// Builds a tree over `count` indexed triangles. Triangles with NaN coordinates are never hit.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn build(
        count: u32,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        Self::build_with_quality(BuildQuality::default(), count, corners, token)
    }

    /// Builds a tree with the given quality, which does not affect the hits.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn build_with_quality(
        quality: BuildQuality,
        count: u32,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let build::BuiltWideBvh { nodes, packs, bounds } = build::build(count, corners, quality, token)?;
        Ok(Self { nodes, packs, bounds, instructions: InstructionSet::from_environment_or_best(), quality })
    }

    /// Sets the instruction set for traversal. Falls back to the fastest supported one if the processor lacks
    /// `instructions`.
    pub fn with_instruction_set(mut self, instructions: InstructionSet) -> Self {
        self.instructions = instructions.or_best_if_unsupported();
        self
    }

    /// Instruction set used for traversal.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instructions
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory used by the tree, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.packs.as_slice())
    }

    /// Expected numbers of nodes and triangle packs that a random line through the bounding box visits,
    /// estimated from surface areas.
    pub fn expected_visits(&self) -> (f64, f64) {
        let whole = f64::from(self.bounds.half_area());
        let mut visits = (f64::from(!self.nodes.is_empty()), 0.0);
        for node in &self.nodes {
            for slot in 0..node::WIDTH {
                let Some(bounds) = node.child_bounds(slot) else { continue };
                let share = f64::from(bounds.half_area()) / whole;
                match node.child(slot) {
                    node::Child::Inner(_) => visits.0 += share,
                    node::Child::Leaf { count, .. } => visits.1 += share * f64::from(count),
                }
            }
        }
        visits
    }

    /// Visits the nodes whose boxes the ray hits, parents first, in an order that depends only on the tree.
    /// `visit` returns whether to descend.
    pub fn visit_nodes_hit_by_ray(
        &self,
        ray: &Ray,
        mut visit: impl FnMut(&VisitedNode, &RayBoxInterval) -> bool,
    ) {
        let root = (self.bounds, node::Child::Inner(0), 0);
        let mut pending = if self.nodes.is_empty() { Vec::new() } else { vec![root] };
        while let Some((bounds, child, depth)) = pending.pop() {
            let Some(stretch) = RayBoxInterval::new(&bounds, ray) else { continue };
            let shapes = match child {
                node::Child::Inner(_) => 0,
                node::Child::Leaf { first, count } => {
                    let packs = &self.packs[first as usize..(first + count) as usize];
                    packs.iter().map(|pack| pack.ids().count() as u32).sum()
                }
            };
            if !visit(&VisitedNode { bounds, depth, shapes }, &stretch) {
                continue;
            }
            if let node::Child::Inner(place) = child {
                let node = &self.nodes[place as usize];
                let below = |slot: usize| Some((node.child_bounds(slot)?, node.child(slot), depth + 1));
                pending.extend((0..node::WIDTH).filter_map(below));
            }
        }
    }

    /// Finds the nearest hit. Among hits at the same distance, the lowest triangle index wins.
    pub fn closest_hit(&self, ray: &Ray) -> Option<ShapeHit> {
        if self.nodes.is_empty() { None } else { simd::closest_hit(self, ray) }
    }

    /// Whether the ray hits any triangle other than `except`.
    pub fn any_hit(&self, ray: &Ray, except: Option<u32>) -> bool {
        !self.nodes.is_empty() && simd::any_hit(self, ray, except)
    }

    /// [`WideBvh::closest_hit`] for up to [`PACKET_SIZE`] rays. Faster for rays in similar directions, such
    /// as camera rays through neighboring pixels.
    pub fn closest_hit_packet(&self, rays: &[Ray], ends: &F32x16, hits: &mut [Option<ShapeHit>]) {
        debug_assert!(rays.len() <= PACKET_SIZE && rays.len() == hits.len());
        hits.fill(None);
        if !self.nodes.is_empty() && !simd::try_closest_hit_packet(self, rays, ends, hits) {
            for (lane, hit) in hits.iter_mut().enumerate().filter(|&(lane, _)| ends[lane] >= 0.0) {
                *hit = self.closest_hit(&Ray { t_max: ends[lane], ..rays[lane] });
            }
        }
    }

    /// [`WideBvh::any_hit`] for up to [`PACKET_SIZE`] rays. Returns the mask of the rays that hit. `except`
    /// is empty or has one entry per ray.
    pub fn any_hit_packet(&self, rays: &[Ray], ends: &F32x16, except: &[Option<u32>]) -> u32 {
        debug_assert!(rays.len() <= PACKET_SIZE && (except.is_empty() || rays.len() == except.len()));
        if self.nodes.is_empty() {
            return 0;
        }
        if let Some(bits) = simd::try_any_hit_packet(self, rays, ends, except) {
            return bits;
        }
        let alone = |lane: usize| {
            let ray = Ray { t_max: ends[lane], ..rays[lane] };
            u32::from(self.any_hit(&ray, except.get(lane).copied().flatten())) << lane
        };
        if self.instructions == InstructionSet::Portable {
            return (0..rays.len()).filter(|&lane| ends[lane] >= 0.0).map(alone).sum();
        }
        let mut bits = 0;
        for_each_coherent_ray_group(rays, ends, |group, count| {
            let as_packet =
                (count >= SMALL_GROUP).then(|| simd::try_any_hit_packet(self, rays, group, except)).flatten();
            let one_by_one = || (0..rays.len()).filter(|&lane| group[lane] >= 0.0).map(alone).sum();
            bits |= as_packet.unwrap_or_else(one_by_one);
        });
        bits
    }

    /// Visits every triangle that overlaps a box, and possibly some nearby ones. A split triangle may be
    /// visited repeatedly.
    pub fn visit_overlapping(&self, other: &Aabb, mut visit: impl FnMut(u32)) {
        self.visit_overlapping_while(other, |triangle| {
            visit(triangle);
            true
        });
    }

    /// Like [`WideBvh::visit_overlapping`], but stops when `visit` returns false. Returns whether all
    /// triangles were visited.
    pub fn visit_overlapping_while(&self, other: &Aabb, mut visit: impl FnMut(u32) -> bool) -> bool {
        self.nodes.is_empty() || self.visit_overlapping_in_subtree(0, other, &mut visit)
    }

    fn visit_overlapping_in_subtree(
        &self,
        place: u32,
        other: &Aabb,
        visit: &mut impl FnMut(u32) -> bool,
    ) -> bool {
        let node = &self.nodes[place as usize];
        set_bit_lanes(node.overlap_mask(other)).all(|slot| match node.child(slot) {
            node::Child::Inner(child) => self.visit_overlapping_in_subtree(child, other, visit),
            node::Child::Leaf { first, count } => {
                let packs = &self.packs[first as usize..(first + count) as usize];
                packs.iter().flat_map(TrianglePack::ids).all(&mut *visit)
            }
        })
    }

    /// Checks that every box contains its subtree and that every triangle is in the right leaves.
    ///
    /// # Errors
    /// A description of the first error found.
    pub fn validate(&self, count: u32, corners: impl Fn(u32) -> [Vec3; 3]) -> Result<(), String> {
        let mut leaves: Vec<Vec<Aabb>> = vec![Vec::new(); count as usize];
        let in_pieces = self.quality == BuildQuality::High;
        let mut pending: Vec<(u32, Aabb)> =
            if self.nodes.is_empty() { Vec::new() } else { vec![(0, self.bounds)] };
        while let Some((index, outer)) = pending.pop() {
            let node = &self.nodes[index as usize];
            for slot in 0..node::WIDTH {
                let Some(bounds) = node.child_bounds(slot) else { continue };
                if bounds.union(outer) != outer {
                    return Err(format!("a child of node {index} is larger than the node"));
                }
                match node.child(slot) {
                    node::Child::Inner(child) => pending.push((child, bounds)),
                    node::Child::Leaf { first, count } => {
                        for pack in &self.packs[first as usize..(first + count) as usize] {
                            for id in pack.ids() {
                                if !in_pieces && Aabb::from_points(corners(id)).union(bounds) != bounds {
                                    return Err(format!("triangle {id} extends outside its leaf"));
                                }
                                if !in_pieces && !leaves[id as usize].is_empty() {
                                    return Err(format!("triangle {id} is in two leaves"));
                                }
                                leaves[id as usize].push(bounds);
                            }
                        }
                    }
                }
            }
        }
        let in_a_leaf = |id: u32, point: Vec3| {
            leaves[id as usize].iter().any(|leaf| leaf.union(Aabb::from_points([point])) == *leaf)
        };
        let lost = |id: &u32| {
            let [a, b, c] = corners(*id);
            let points = [a, b, c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            points.iter().all(|point| point.is_finite()) && !points.iter().all(|&point| in_a_leaf(*id, point))
        };
        (0..count).find(lost).map_or(Ok(()), |id| Err(format!("part of triangle {id} is not in any leaf")))
    }
}

/// Minimum number of shadow rays in a group that is traced as a packet. In smaller groups, tracing the rays
/// one by one is faster.
const SMALL_GROUP: usize = 8;

/// Groups rays whose directions have the same signs and longest axis. Calls `take` for each group with the
/// maximum distances of all rays, which are negative for rays outside the group, and the group's size.
fn for_each_coherent_ray_group(rays: &[Ray], ends: &F32x16, mut take: impl FnMut(&F32x16, usize)) {
    let way = |ray: &Ray| {
        let [x, y, z] = ray.direction.to_array().map(f32::abs);
        let longest = if x > y && x > z {
            0
        } else if y > z && y >= x {
            1
        } else {
            2
        };
        ray.direction.cmplt(Vec3::ZERO).bitmask() | longest << 3
    };
    let mut ways = [u32::MAX; PACKET_SIZE];
    for (lane, ray) in rays.iter().enumerate().filter(|&(lane, _)| ends[lane] >= 0.0) {
        ways[lane] = way(ray);
    }
    while let Some(&own) = ways.iter().find(|&&way| way != u32::MAX) {
        let (mut group, mut count) = ([-1.0; PACKET_SIZE], 0);
        for (lane, way) in ways.iter_mut().enumerate().filter(|(_, way)| **way == own) {
            group[lane] = ends[lane];
            count += 1;
            *way = u32::MAX;
        }
        take(&group, count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::packet_ray_ends;
    use crate::accel::pathological::{closest_by_brute_force, difficult_meshes, difficult_rays, hit_bits};
    use crate::geometry::watertight::ShearedRay;
    use crate::math::random::signed_number_generator as random;

    fn built(mesh: &[[Vec3; 3]]) -> WideBvh {
        built_with(BuildQuality::Medium, mesh)
    }

    fn built_with(quality: BuildQuality, mesh: &[[Vec3; 3]]) -> WideBvh {
        let tree = WideBvh::build_with_quality(
            quality,
            mesh.len() as u32,
            |id| mesh[id as usize],
            &CancelToken::new(),
        );
        let tree = tree.expect("never canceled");
        tree.validate(mesh.len() as u32, |id| mesh[id as usize]).expect("a valid tree");
        tree
    }

    #[test]
    fn traversals_match_brute_force_bit_for_bit() {
        for (number, mesh) in difficult_meshes().iter().enumerate() {
            let trees = [BuildQuality::Medium, BuildQuality::High].map(|quality| built_with(quality, mesh));
            let trees = trees.iter().flat_map(|tree| {
                InstructionSet::ALL.map(|instructions| tree.clone().with_instruction_set(instructions))
            });
            let trees: Vec<_> = trees.collect();
            for ray in difficult_rays(mesh) {
                let expected = closest_by_brute_force(mesh, &ray);
                for tree in &trees {
                    let context = || format!("mesh {number}, {:?}, {ray:?}", tree.instruction_set());
                    assert_eq!(hit_bits(tree.closest_hit(&ray)), hit_bits(expected), "{}", context());
                    assert_eq!(tree.any_hit(&ray, None), expected.is_some(), "{}", context());
                }
            }
        }
    }

    /// Packets of all sizes. Some contain rays in similar directions, others random rays.
    fn packets(mesh: &[[Vec3; 3]]) -> Vec<Vec<Ray>> {
        let mut next = random(17);
        let mut packets: Vec<Vec<Ray>> =
            difficult_rays(mesh).chunks(PACKET_SIZE).map(<[Ray]>::to_vec).collect();
        for i in 0..600 {
            let origin = Vec3::new(next(), next(), next()) * 15.0;
            let triangle = mesh.get(i * 7 % mesh.len().max(1)).copied().unwrap_or([Vec3::ZERO; 3]);
            let spread = [0.0, 0.01, 0.3, 3.0][i % 4];
            let ray = |k: usize| {
                let target = triangle[k % 3] + Vec3::new(next(), next(), next()) * spread;
                let start =
                    origin + if i % 3 == 0 { Vec3::new(next(), next(), next()) * 0.1 } else { Vec3::ZERO };
                let ray = Ray::new(start, target - start);
                if k.is_multiple_of(5) { Ray { t_max: 1.0, ..ray } } else { ray }
            };
            packets.push((0..1 + i % PACKET_SIZE).map(ray).collect());
        }
        packets
    }

    #[test]
    fn packets_match_single_rays() {
        for (number, mesh) in difficult_meshes().iter().enumerate() {
            let trees = InstructionSet::ALL.map(|one| built(mesh).with_instruction_set(one));
            for rays in packets(mesh) {
                let expected: Vec<_> = rays.iter().map(|ray| closest_by_brute_force(mesh, ray)).collect();
                let bits = |hits: &[Option<ShapeHit>]| hits.iter().copied().map(hit_bits).collect::<Vec<_>>();
                let except: Vec<_> = (0..rays.len())
                    .map(|i| expected[i].filter(|_| i % 3 == 0).map(|hit| hit.primitive))
                    .collect();
                let hits_another = |(i, ray): (usize, &Ray)| {
                    let is_left_out = |id: u32| Some(id) == except[i] || id == ray.start;
                    let sheared = ShearedRay::new(ray.origin, ray.direction);
                    let mut others = mesh.iter().zip(0..).filter(|&(_, id)| !is_left_out(id));
                    expected[i].is_some()
                        && others.any(|(corners, _)| sheared.intersect(corners, ray.t_max).is_some())
                };
                let any = rays.iter().enumerate().map(hits_another);
                let any = any.enumerate().fold(0, |bits, (i, hit)| bits | u32::from(hit) << i);
                for tree in &trees {
                    let context = || format!("mesh {number}, {:?}, {rays:?}", tree.instruction_set());
                    let mut found = vec![None; rays.len()];
                    tree.closest_hit_packet(&rays, &packet_ray_ends(&rays), &mut found);
                    assert_eq!(bits(&found), bits(&expected), "{}", context());
                    let found = tree.any_hit_packet(&rays, &packet_ray_ends(&rays), &except);
                    assert_eq!(found, any, "{}", context());
                }
            }
        }
    }

    #[test]
    fn coherent_rays_are_traced_as_packets() {
        let mesh = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
        let rays: Vec<_> = (0..PACKET_SIZE)
            .map(|i| Ray::new(Vec3::new(0.1 + 0.02 * i as f32, 0.2, 1.0), Vec3::new(0.01, 0.02, -1.0)))
            .collect();
        let apart = [rays[0], Ray { direction: -rays[0].direction, ..rays[0] }];
        for instructions in InstructionSet::ALL {
            let tree = built(&mesh).with_instruction_set(instructions);
            let are_vectors = tree.instruction_set() != InstructionSet::Portable;
            let mut hits = [None; PACKET_SIZE];
            assert_eq!(
                simd::try_closest_hit_packet(&tree, &rays, &packet_ray_ends(&rays), &mut hits),
                are_vectors,
                "{instructions:?}"
            );
            assert_eq!(hits.iter().flatten().count(), if are_vectors { PACKET_SIZE } else { 0 });
            let all = (1 << PACKET_SIZE) - 1;
            assert_eq!(
                simd::try_any_hit_packet(&tree, &rays, &packet_ray_ends(&rays), &[]),
                are_vectors.then_some(all)
            );
            assert!(
                !simd::try_closest_hit_packet(&tree, &apart, &packet_ray_ends(&apart), &mut hits[..2]),
                "{instructions:?}"
            );
            assert_eq!(
                simd::try_any_hit_packet(&tree, &apart, &packet_ray_ends(&apart), &[]),
                None,
                "{instructions:?}"
            );
        }
    }

    #[test]
    fn distant_rays_hit_despite_overflow() {
        let (at, size) = (Vec3::new(1e8, 0.0, 0.0), 96.0);
        let mesh = [[
            at + Vec3::new(-size, -size, size),
            at + Vec3::new(size, -size, size),
            at + Vec3::new(0.0, size, size),
        ]];
        let tree = built(&mesh);
        for direction in [Vec3::Z, Vec3::Z * 1e-20, Vec3::new(-0.0, 0.0, 1e-20), Vec3::Z * 1e-30] {
            let ray = Ray::new(at, direction);
            let expected = closest_by_brute_force(&mesh, &ray);
            for instructions in InstructionSet::ALL {
                let tree = tree.clone().with_instruction_set(instructions);
                assert_eq!(
                    hit_bits(tree.closest_hit(&ray)),
                    hit_bits(expected),
                    "{instructions:?}, {direction:?}"
                );
                assert_eq!(tree.any_hit(&ray, None), expected.is_some(), "{instructions:?}, {direction:?}");
            }
        }
        assert!(closest_by_brute_force(&mesh, &Ray::new(at, Vec3::Z * 1e-20)).is_some());
    }

    #[test]
    fn any_hit_skips_the_excluded_triangle() {
        let mesh = [[Vec3::ZERO, Vec3::X, Vec3::Y]];
        let tree = built(&mesh);
        let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
        for instructions in InstructionSet::ALL {
            let tree = tree.clone().with_instruction_set(instructions);
            assert!(tree.any_hit(&ray, None) && !tree.any_hit(&ray, Some(0)));
        }
    }
}
