//! Small meshes merged into one tree, so that a ray that crosses many of them traverses only one tree. If
//! there are few triangles in total, packets test them using a [`TriangleList`] without a tree.
//!
//! Triangles are transformed to world coordinates and rounded. [`contact`](super::contact) and
//! [`Geometry::visit_nodes_along_ray`](super::Geometry::visit_nodes_along_ray) use the per-mesh trees. Hits
//! on untransformed instances are bit-identical to hits on unmerged meshes.

use super::triangle_tree::TriangleTree;
use super::{MeshInstance, Object};
use crate::accel::{F32x16, InstructionSet, PACKET_SIZE, SimdKernel};
use crate::control::{CancelToken, Canceled};
use crate::geometry::packet::{HitPacket, RayPacket, set_bit_lanes};
use crate::geometry::triangle_list::{self, TriangleList};
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;
use crate::math::lanes::{Simd, TRUE};

/// Maximum triangle count of a merged mesh. For a larger mesh, a separate tree is worthwhile because it does
/// not need to be rebuilt when the mesh moves.
const MAX_PER_MESH: usize = 1 << 14;

/// Maximum total triangle count of merged meshes. Building a tree of this size takes about 10 ms.
const MAX_TOTAL: usize = 1 << 17;

/// Maximum triangle count at which packets test all triangles without a tree.
const MAX_FACETS: usize = triangle_list::MAX_TRIANGLES;

/// Maximum coordinate of a merged mesh, relative to its size. Beyond this, rounding would distort the mesh.
const MAX_RELATIVE_COORDINATE: f32 = 1024.0;

/// Maximum size of a transformed mesh, relative to the scene's smallest object. Rounding would move the
/// corners of a larger mesh by more than 1/256 of the smallest object's size.
const MAX_RELATIVE_SIZE: f32 = (1 << 17) as f32;

/// Identifies the object and primitive of a triangle in the merged tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MergedTriangle {
    /// Object id.
    pub object: u32,
    /// Index of the triangle in the object's mesh.
    pub primitive: u32,
}

/// Instances of small meshes in one tree.
#[derive(Debug)]
pub struct MergedMeshes {
    tree: TriangleTree,
    /// The triangles that packets test without the tree, or `None` if there are too many.
    facets: Option<TriangleList>,
    /// Triangles sorted by object, so that at equal distances the lowest object id wins.
    triangles: Vec<MergedTriangle>,
    /// Index of each object's first triangle, or [`MergedMeshes::NOT_HERE`] if the object is not merged.
    first: Vec<u32>,
}

impl MergedMeshes {
    /// Entry of `first` for an object that is not merged.
    const NOT_HERE: u32 = u32::MAX;

    /// Merges the small meshes among `objects`. Returns `None` if merging is not worthwhile.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn merge_small_meshes(objects: &mut [Object], token: &CancelToken) -> Result<Option<Self>, Canceled> {
        // Choose the smallest meshes first, up to the maximum number of triangles to rebuild after each edit.
        let count = |object: &Object| object.mesh().map_or(0, MeshInstance::triangle_count);
        let smallest = smallest_object_size(objects);
        let mut chosen: Vec<usize> =
            (0..objects.len()).filter(|&id| may_be_merged(&objects[id], smallest)).collect();
        chosen.sort_by_key(|&id| (count(&objects[id]), id));
        let mut total = 0;
        chosen.retain(|&id| {
            let with_it = total + count(&objects[id]);
            let has_room = with_it <= MAX_TOTAL;
            total = if has_room { with_it } else { total };
            has_room
        });
        let Some(accel) = chosen.first().and_then(|&id| Some(objects[id].mesh()?.tree.accel_kind())) else {
            return Ok(None);
        };
        if chosen.len() < 2 && total > MAX_FACETS {
            return Ok(None);
        }
        // A small number of triangles is worth merging only if packets can test them without a tree.
        let rounded = |&id: &usize| {
            let mesh = objects[id].mesh();
            mesh.into_iter().flat_map(|mesh| {
                (0..mesh.triangle_count() as u32).map(|own| mesh.world_corners_rounded_to_f32(own))
            })
        };
        chosen.sort_unstable();
        let facets = if total > MAX_FACETS {
            None
        } else {
            TriangleList::new(chosen.iter().flat_map(rounded).collect())
        };
        if total <= MAX_FACETS && facets.is_none() {
            return Ok(None);
        }
        // Number the triangles by object.
        let mut triangles = Vec::with_capacity(total);
        let mut first = vec![Self::NOT_HERE; objects.len()];
        for &id in &chosen {
            first[id] = triangles.len() as u32;
            let object = id as u32;
            triangles.extend(
                (0..count(&objects[id]) as u32).map(|primitive| MergedTriangle { object, primitive }),
            );
            if let Object::Mesh(mesh) = &mut objects[id] {
                mesh.is_merged = true;
            }
        }
        // Build the tree.
        let corners = |number: u32| {
            let MergedTriangle { object, primitive } = triangles[number as usize];
            objects[object as usize]
                .mesh()
                .map_or([Vec3::NAN; 3], |mesh| mesh.world_corners_rounded_to_f32(primitive))
        };
        let number = triangles.len() as u32;
        let tree = TriangleTree::build(accel, number, corners, token)?;
        Ok(Some(Self { tree, facets, triangles, first }))
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// The tree over all triangles.
    pub fn tree(&self) -> &TriangleTree {
        &self.tree
    }

    /// Whether an object is merged.
    pub fn contains_object(&self, object: u32) -> bool {
        self.first.get(object as usize).is_some_and(|&first| first != Self::NOT_HERE)
    }

    /// Triangle with this index in the tree.
    #[inline(always)]
    pub fn triangle(&self, number: u32) -> MergedTriangle {
        self.triangles[number as usize]
    }

    /// Tree index of an object's triangle, or `None` if the object is not merged.
    #[inline(always)]
    pub fn merged_triangle_index(&self, object: u32, primitive: u32) -> Option<u32> {
        let first = self.first.get(object as usize).copied().filter(|&first| first != Self::NOT_HERE)?;
        Some(first + primitive)
    }

    /// Returns the nearest hit. The hit's primitive is a triangle index into the tree.
    pub fn closest_hit_with_merged_index(&self, ray: &Ray) -> Option<ShapeHit> {
        self.tree.closest_hit(ray)
    }

    /// Whether the ray hits any triangle except `except`.
    pub fn any_hit(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.tree.any_hit(ray, except)
    }

    /// Invalid triangle number.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// Finds the nearest hits of the rays in `active`. The hits' primitives are triangle indices into the
    /// tree. Other lanes have negative `ends`.
    #[inline(never)]
    pub fn closest_hit_packet(
        &self,
        by: InstructionSet,
        rows: &RayPacket,
        (active, ends): (u32, &F32x16),
        found: &mut HitPacket,
    ) {
        let Some(facets) = &self.facets else {
            return self.closest_hit_packet_with_tree(rows, active, ends, found);
        };
        let size = self.bounds().extent();
        match by.run(ClosestHitIfIncoherentKernel { facets, size, rows, active, ends, found }) {
            Some(0) => {}
            Some(undecided) => self.closest_hit_per_ray(rows, undecided, ends, found),
            None => self.closest_hit_packet_with_tree(rows, active, ends, found),
        }
    }

    /// Traces the rays in `these` one by one.
    #[cold]
    #[inline(never)]
    fn closest_hit_per_ray(&self, rows: &RayPacket, these: u32, ends: &F32x16, found: &mut HitPacket) {
        for lane in set_bit_lanes(these) {
            if let Some(hit) = self.tree.closest_hit(&Ray { t_max: ends[lane], ..rows.ray(lane) }) {
                found.set(lane, &hit);
            }
        }
    }

    #[inline(never)]
    fn closest_hit_packet_with_tree(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        found: &mut HitPacket,
    ) {
        let mut hits = [None; PACKET_SIZE];
        self.tree.closest_hit_packet(&unpack_rays(rows, active), ends, &mut hits);
        for (lane, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                found.set(lane, hit);
            }
        }
    }

    /// Returns the mask of rays in `active` that hit any triangle other than the lane's entry in `except`,
    /// which may be [`MergedMeshes::NO_TRIANGLE`].
    #[inline(never)]
    pub fn any_hit_packet(
        &self,
        by: InstructionSet,
        rows: &RayPacket,
        (active, ends): (u32, &F32x16),
        except: Option<&[u32; PACKET_SIZE]>,
    ) -> u32 {
        let Some(facets) = &self.facets else { return self.any_hit_by_tree(rows, active, ends, except) };
        let own = except.unwrap_or(&[Self::NO_TRIANGLE; PACKET_SIZE]);
        let size = self.bounds().extent();
        match by.run(AnyHitIfIncoherentKernel { facets, size, rows, active, ends, except: own }) {
            Some([hit, 0]) => hit,
            Some([hit, undecided]) => hit | self.any_hit_one_by_one(rows, undecided, ends, own),
            None => self.any_hit_by_tree(rows, active, ends, except),
        }
    }

    /// Traces the rays in `these` one by one. See [`MergedMeshes::any_hit_packet`].
    #[cold]
    #[inline(never)]
    fn any_hit_one_by_one(
        &self,
        rows: &RayPacket,
        these: u32,
        ends: &F32x16,
        except: &[u32; PACKET_SIZE],
    ) -> u32 {
        let is_hit = |&lane: &usize| {
            let own = (except[lane] != Self::NO_TRIANGLE).then_some(except[lane]);
            self.tree.any_hit(&Ray { t_max: ends[lane], ..rows.ray(lane) }, own)
        };
        set_bit_lanes(these).filter(is_hit).fold(0, |bits, lane| bits | 1 << lane)
    }

    #[inline(never)]
    fn any_hit_by_tree(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        except: Option<&[u32; PACKET_SIZE]>,
    ) -> u32 {
        let rays = unpack_rays(rows, active);
        let Some(numbers) = except else { return self.tree.any_hit_packet(&rays, ends, &[]) };
        let own = numbers.map(|number| (number != Self::NO_TRIANGLE).then_some(number));
        self.tree.any_hit_packet(&rays, ends, &own)
    }

    /// Memory used by the tree and its tables, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let facets = self.facets.as_ref().map_or(0, TriangleList::memory_bytes);
        self.tree.memory_bytes() + facets + size_of_val(&*self.triangles) + size_of_val(&*self.first)
    }
}

/// Whether the rays in `active` start close together, relative to `size`, and have similar directions. Such
/// rays are faster with the tree than without it.
#[inline(always)]
fn are_rays_coherent(rows: &RayPacket, active: u32, size: Vec3, simd: impl Simd) -> bool {
    let first = active.trailing_zeros() as usize % PACKET_SIZE;
    let near = size.element_sum() * COHERENCE;
    let along = (0..3).map(|axis| rows.direction[axis][first].abs()).sum::<f32>() * COHERENCE;
    let from = [0, 1, 2].map(|axis| rows.origin[axis][first]);
    let way = [0, 1, 2].map(|axis| rows.direction[axis][first]);
    let ([ox, oy, oz], [dx, dy, dz]) = (&rows.origin, &rows.direction);
    let mut differs = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        let apart = (ox[lane] - from[0]).abs() + (oy[lane] - from[1]).abs() + (oz[lane] - from[2]).abs();
        let aside = (dx[lane] - way[0]).abs() + (dy[lane] - way[1]).abs() + (dz[lane] - way[2]).abs();
        differs[lane] = if (apart <= near) & (aside <= along) { 0 } else { TRUE };
    }
    simd.movemask(&differs) & active == 0
}

/// Coherence threshold: maximum difference between ray origins relative to the size of all triangles, and
/// between directions relative to their length.
const COHERENCE: f32 = 0.125;

/// Kernel that calls [`TriangleList::update_decided_closest_hits`] for incoherent rays and returns the lanes
/// that need an exact test, or returns `None` for coherent rays.
struct ClosestHitIfIncoherentKernel<'a> {
    facets: &'a TriangleList,
    size: Vec3,
    rows: &'a RayPacket,
    active: u32,
    ends: &'a F32x16,
    found: &'a mut HitPacket,
}

impl SimdKernel for ClosestHitIfIncoherentKernel<'_> {
    type Output = Option<u32>;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Option<u32> {
        let Self { facets, size, rows, active, ends, found } = self;
        if are_rays_coherent(rows, active, size, simd) {
            return None;
        }
        Some(facets.update_decided_closest_hits(rows, (active, ends), found, simd))
    }
}

/// Kernel that calls [`TriangleList::any_hit_and_undecided_masks`] for incoherent rays and returns the hit
/// lanes and the lanes that need an exact test, or returns `None` for coherent rays.
struct AnyHitIfIncoherentKernel<'a> {
    facets: &'a TriangleList,
    size: Vec3,
    rows: &'a RayPacket,
    active: u32,
    ends: &'a F32x16,
    except: &'a [u32; PACKET_SIZE],
}

impl SimdKernel for AnyHitIfIncoherentKernel<'_> {
    type Output = Option<[u32; 2]>;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> Option<[u32; 2]> {
        let Self { facets, size, rows, active, ends, except } = self;
        if are_rays_coherent(rows, active, size, simd) {
            return None;
        }
        Some(facets.any_hit_and_undecided_masks(rows, (active, ends), except, simd))
    }
}

/// Returns the rays of a packet. Lanes outside `active` contain a copy of the first ray in `active`, whose
/// direction is likely similar.
#[inline]
fn unpack_rays(rows: &RayPacket, active: u32) -> [Ray; PACKET_SIZE] {
    let mut rays = [rows.ray(active.trailing_zeros() as usize % PACKET_SIZE); PACKET_SIZE];
    for lane in set_bit_lanes(active & active.wrapping_sub(1)) {
        rays[lane] = rows.ray(lane);
    }
    rays
}

/// Size of the smallest finite object, or infinity if there is none.
fn smallest_object_size(objects: &[Object]) -> f32 {
    let bounds = objects.iter().filter_map(Object::bounds).filter(|bounds| !bounds.is_empty());
    let sizes = bounds.map(|bounds| bounds.extent().max_element());
    sizes.filter(|size| *size > 0.0).fold(f32::INFINITY, f32::min)
}

/// Whether an object is a mesh that is small enough to merge and whose world coordinates are accurate enough
/// in `f32`. `smallest` is the size of the scene's smallest object.
fn may_be_merged(object: &Object, smallest: f32) -> bool {
    let Some(mesh) = object.mesh() else { return false };
    let Some(bounds) = object.bounds().filter(|bounds| !bounds.is_empty()) else { return false };
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let size = bounds.extent().max_element();
    if mesh.is_transformed() && size > MAX_RELATIVE_SIZE * smallest {
        return false;
    }
    let count = mesh.triangle_count();
    (1..=MAX_PER_MESH).contains(&count) && largest.is_finite() && largest <= MAX_RELATIVE_COORDINATE * size
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::assets::LoadedMesh;
    use crate::geometry::mesh::TriangleMesh;
    use crate::geometry::ray::offset_origin;
    use crate::lights::LightSceneGeometry;
    use crate::math::DVec3;
    use crate::math::random::signed_number_generator as random;
    use crate::math::transform::Transform;
    use crate::scene::description::Accel;
    use crate::world::{Geometry, Hit, MeshTree};

    /// A mesh of random triangles, some of them duplicated.
    pub(in crate::world) fn mesh(seed: u64, count: u32) -> Arc<MeshTree> {
        let mut next = random(seed);
        let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
        let mut mesh = TriangleMesh::default();
        for i in 0..count {
            let place = vector(1.0);
            mesh.positions.extend([place, place + vector(0.5), place + vector(0.5)]);
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            if i % 5 == 0 {
                mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
            }
        }
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"))
    }

    fn objects(of: &[(&Arc<MeshTree>, Transform)]) -> Vec<Object> {
        let instance = |(tree, transform): &(&Arc<MeshTree>, Transform)| {
            Object::Mesh(Box::new(MeshInstance::new(Arc::clone(tree), *transform, false)))
        };
        of.iter().map(instance).collect()
    }

    fn geometry(objects: Vec<Object>) -> Geometry {
        Geometry::build(objects, &CancelToken::new()).expect("never canceled")
    }

    fn rays(seed: u64) -> Vec<Ray> {
        let mut next = random(seed);
        let mut vector = || Vec3::new(next(), next(), next());
        (0..4000)
            .map(|i| {
                if i % 2 == 0 {
                    Ray::new(vector() * 3.0, vector())
                } else {
                    Ray::segment_ending_before_point(vector(), vector())
                }
            })
            .collect()
    }

    #[test]
    fn large_transformed_meshes_are_not_distorted() {
        let corners = [Vec3::new(-1e7, 0.0, 1e7), Vec3::new(1e7, 0.0, 1e7), Vec3::new(0.0, 0.0, -1e7)];
        let ground =
            TriangleMesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Default::default() };
        let loaded = Arc::new(LoadedMesh { mesh: ground, ..LoadedMesh::default() });
        let ground =
            Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"));
        let small = mesh(7, 100);
        let shift = DVec3::new(0.37, 0.11, -0.21);
        let turned = Transform::scale_rotate_translate(DVec3::ONE, DVec3::new(0.0, 0.0, 17.3), shift);
        let below = turned.point(DVec3::NEG_Y * 9.0);
        let away = Transform::scale_rotate_translate(DVec3::ONE, DVec3::ZERO, below);
        let geometry = geometry(objects(&[(&ground, turned), (&small, away), (&small, away)]));
        assert!(geometry.has_merged_meshes());
        let up = turned.point(DVec3::Y) - shift;
        for ray in rays(8).iter().map(|ray| Ray::new(ray.origin + up.as_vec3() * 5.0, -up.as_vec3())) {
            let hit = geometry.closest_hit(&ray).expect("the ground");
            let exact = (ray.origin.as_dvec3() - shift).dot(up);
            assert_eq!(hit.object, 0);
            assert!((f64::from(hit.shape.t) - exact).abs() < 1e-4, "{} {exact}", hit.shape.t);
        }
    }

    #[test]
    fn merged_and_unmerged_hits_are_equal() {
        let trees = [mesh(1, 30), mesh(2, 50), mesh(3, 7)];
        // The second mesh occurs twice in the same place, so the lower object id wins.
        let of: Vec<_> = [0, 1, 1, 2].iter().map(|&i| (&trees[i], Transform::IDENTITY)).collect();
        let geometry = geometry(objects(&of));
        let alone = objects(&of);
        assert!(geometry.has_merged_meshes());
        let (mut hits, mut blocked) = (0, 0);
        for ray in rays(4) {
            let each = (0_u32..).zip(&alone).filter_map(|(object, own)| {
                Some(Hit { shape: own.closest_hit(&ray, &ray.to_f64())?, object })
            });
            let expected = each.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
            let found = geometry.closest_hit(&ray);
            assert_eq!(found, expected, "{ray:?}");
            // Ignoring the hit triangle results in a hit on another triangle.
            if let Some(hit) = found {
                let next =
                    geometry.closest_hit(&ray.with_start_triangle(geometry.scene_triangle_number(&hit)));
                let is_own =
                    |next: Hit| (next.object, next.shape.primitive) == (hit.object, hit.shape.primitive);
                assert!(!next.is_some_and(is_own), "{ray:?}");
                assert!(next.is_none_or(|next| next.shape.t >= hit.shape.t), "{ray:?}");
            }
            hits += u32::from(found.is_some());
            let nothing = Hit { shape: ShapeHit::from_t(0.0), object: 3 };
            let Hit { shape, object } = found.unwrap_or(nothing);
            for source in [
                LightSceneGeometry::Nothing,
                LightSceneGeometry::Object(object),
                LightSceneGeometry::Primitive(object, shape.primitive),
            ] {
                let any = (0_u32..).zip(&alone).any(|(id, own)| match source {
                    LightSceneGeometry::Nothing => own.any_hit(&ray, &ray.to_f64(), None),
                    LightSceneGeometry::Object(except) | LightSceneGeometry::SeeThrough(except) => {
                        id != except && own.any_hit(&ray, &ray.to_f64(), None)
                    }
                    LightSceneGeometry::Primitive(of, part) => {
                        own.any_hit(&ray, &ray.to_f64(), (id == of).then_some(part))
                    }
                });
                assert_eq!(geometry.is_occluded_except_by_light(&ray, source), any, "{ray:?} {source:?}");
                blocked += u32::from(any);
            }
        }
        assert!(hits > 900 && blocked > 2000, "{hits} hits, {blocked} blocked");
    }

    /// Large triangles, each with a small part near the origin.
    fn random_mesh_of_large_triangles() -> Arc<MeshTree> {
        let mut next = random(7);
        let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
        let mut mesh = TriangleMesh::default();
        for i in 0..40 {
            let (a, b) = (vector(50.0), vector(50.0));
            mesh.positions.extend([a, b, vector(0.1) - a - b]);
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"))
    }

    #[test]
    fn rays_do_not_hit_their_starting_triangle() {
        let tree = random_mesh_of_large_triangles();
        let turned = |degrees: DVec3, at: DVec3| {
            Transform::scale_rotate_translate(DVec3::new(1.0, 3.0, 0.7), degrees, at)
        };
        let of = [
            (&tree, turned(DVec3::new(13.0, 57.0, 211.0), DVec3::ZERO)),
            (&tree, turned(DVec3::new(-71.0, 5.0, 19.0), DVec3::splat(1e-3))),
        ];
        let geometry = geometry(objects(&of));
        assert!(geometry.has_merged_meshes());
        let mut next = random(9);
        let (mut started, mut again) = (0, 0);
        for _ in 0..4000 {
            let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
            let ray =
                Ray { t_max: f32::INFINITY, ..Ray::segment_ending_before_point(vector(1.0), vector(0.02)) };
            let Some(hit) = geometry.closest_hit(&ray) else { continue };
            let surface = geometry.surface(&ray, &hit);
            for side in [1.0, -1.0] {
                let direction = vector(1.0).normalize();
                let direction =
                    direction * if direction.dot(surface.normal) * side < 0.0 { -1.0 } else { 1.0 };
                let origin = offset_origin(surface.point, surface.error, surface.normal, direction);
                let second = geometry.closest_hit(&Ray::new(origin, direction));
                let is_own = |second: Hit| {
                    (second.object, second.shape.primitive) == (hit.object, hit.shape.primitive)
                };
                (started, again) = (started + 1, again + u32::from(second.is_some_and(is_own)));
            }
        }
        assert!(started > 5000, "{started} rays");
        assert_eq!(again, 0, "none of the {started} rays should hit its starting triangle");
    }

    #[test]
    fn large_distant_or_lone_meshes_are_not_merged() {
        let (small, few) = (mesh(1, 60), mesh(2, 8));
        let here = Transform::IDENTITY;
        let far = Transform::scale_rotate_translate(DVec3::splat(1e-4), DVec3::ZERO, DVec3::splat(9.0));
        let members = |of: &[(&Arc<MeshTree>, Transform)]| {
            let mut objects = objects(of);
            let merged =
                MergedMeshes::merge_small_meshes(&mut objects, &CancelToken::new()).expect("never canceled");
            merged.map(|merged| {
                (0..of.len() as u32).filter(|&id| merged.contains_object(id)).collect::<Vec<_>>()
            })
        };
        assert_eq!(members(&[(&small, here), (&few, here)]), Some(vec![0, 1]));
        assert_eq!(members(&[(&small, here), (&few, far), (&few, here)]), Some(vec![0, 2]));
        assert_eq!(members(&[(&small, here)]), None, "a single mesh");
        // A few triangles are merged without a tree if there are no slivers.
        assert_eq!(members(&[(&few, here), (&few, here)]), Some(vec![0, 1]));
        assert_eq!(members(&[(&few, here)]), Some(vec![0]));
        let (least, needles) = (mesh(5, 3), mesh(6, 8));
        assert_eq!(members(&[(&least, here), (&few, far)]), Some(vec![0]));
        let flat = Transform::scale_rotate_translate(DVec3::new(1.0, 1e-6, 1e-6), DVec3::ZERO, DVec3::ZERO);
        assert_eq!(members(&[(&needles, flat), (&few, here)]), None, "slivers");
        let large = mesh(3, 14_000);
        assert_eq!(members(&[(&large, here), (&small, here), (&few, here)]), Some(vec![1, 2]));
        // The smallest meshes are merged up to the triangle limit.
        let half = mesh(4, 13_000);
        let many: Vec<_> = (0..12).map(|i| (if i == 0 { &few } else { &half }, here)).collect();
        assert_eq!(members(&many), Some((0..9).collect()));
    }
}
