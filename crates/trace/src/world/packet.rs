//! Traces packets of up to 16 rays. Each ray has the same hit as if it were traced alone.

use super::merged::MergedMeshes;
use super::{Geometry, Hit};
use crate::accel::{AnyHitCallback, ClosestHitCallback, F32x16, PACKET_SIZE, SimdKernel};
use crate::geometry::Ray;
use crate::geometry::packet::{HitPacket, RayPacket, nonnegative_end_mask, set_bit_lanes};
use crate::lights::{GeometryOfLight, GeometryOfLightPacket};
use crate::math::lanes::{Simd, TRUE, select, select_u32};

impl Geometry {
    /// Like [`Geometry::closest_hit`], for up to [`PACKET_SIZE`] rays. `hits` must have the same length as
    /// `rays`.
    pub fn closest_hit_packet(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        debug_assert!(rays.len() <= PACKET_SIZE && rays.len() == hits.len());
        self.instruction_set().run(ClosestHitKernel { geometry: self, rays, hits });
    }

    /// Like [`Geometry::closest_hit_packet`], for callers inside a SIMD kernel. Returns the hits and their
    /// objects. `traced` is the mask of rays to trace.
    #[inline(always)]
    pub fn closest_hit_packet_simd(
        &self,
        rows: &RayPacket,
        ends: &mut F32x16,
        traced: u32,
        simd: impl Simd,
    ) -> (HitPacket, [u32; PACKET_SIZE]) {
        if self.traced_tree().has_shells() {
            return self.closest_hit_one_by_one(rows, ends, traced);
        }
        let mut nearest = ClosestHitTest {
            geometry: self,
            rows,
            hits: HitPacket::without_hits(),
            object: [NONE; PACKET_SIZE],
            simd,
        };
        self.traced_tree().closest_hit_packet(rows, ends, traced, self.unbounded(), &mut nearest, simd);
        (nearest.hits, nearest.object)
    }

    /// Like [`Geometry::is_occluded_except_by_light`], for a packet of shadow rays. Returns the mask of
    /// occluded rays. `traced` is the mask of rays to trace. Must be called inside a SIMD kernel.
    #[inline(always)]
    pub fn occluded_ray_mask(
        &self,
        rows: &RayPacket,
        ends: &F32x16,
        traced: u32,
        sources: &GeometryOfLightPacket,
        simd: impl Simd,
    ) -> u32 {
        simd.call_out_of_line(OcclusionKernel { geometry: self, rows, ends, traced, sources })
    }
}

impl Geometry {
    /// Mask of rays whose light is an entire merged mesh.
    #[inline(always)]
    pub(super) fn light_is_entire_merged_mesh_mask(&self, sources: &GeometryOfLightPacket) -> u32 {
        if !sources.is_any || !self.has_merged_meshes() {
            return 0;
        }
        let is_whole = |lane: usize| {
            sources.part[lane] == GeometryOfLightPacket::NONE
                && self.is_light_entire_merged_mesh(GeometryOfLight::Object(sources.object[lane]))
        };
        (0..PACKET_SIZE).filter(|&lane| is_whole(lane)).fold(0, |bits, lane| bits | 1 << lane)
    }

    /// Like [`Geometry::closest_hit_packet_simd`], but traces the rays one by one.
    #[cold]
    #[inline(never)]
    fn closest_hit_one_by_one(
        &self,
        rows: &RayPacket,
        ends: &mut F32x16,
        traced: u32,
    ) -> (HitPacket, [u32; PACKET_SIZE]) {
        let (mut hits, mut objects) = (HitPacket::without_hits(), [NONE; PACKET_SIZE]);
        for lane in set_bit_lanes(traced) {
            if let Some(hit) = self.closest_hit(&Ray { t_max: ends[lane], ..rows.ray(lane) }) {
                hits.set(lane, &hit.shape);
                (objects[lane], ends[lane]) = (hit.object, hit.shape.t);
            }
        }
        (hits, objects)
    }

    /// Calls [`Geometry::is_occluded_except_by_light`] for each ray.
    #[cold]
    #[inline(never)]
    fn occluded_one_by_one(
        &self,
        rows: &RayPacket,
        ends: &F32x16,
        traced: u32,
        sources: &GeometryOfLightPacket,
    ) -> u32 {
        let is_occluded = |&lane: &usize| {
            self.is_occluded_except_by_light(
                &Ray { t_max: ends[lane], ..rows.ray(lane) },
                sources.geometry(lane),
            )
        };
        set_bit_lanes(traced).filter(is_occluded).fold(0, |bits, lane| bits | 1 << lane)
    }
}

/// Kernel of [`Geometry::occluded_ray_mask`].
struct OcclusionKernel<'a> {
    geometry: &'a Geometry,
    rows: &'a RayPacket,
    ends: &'a F32x16,
    traced: u32,
    sources: &'a GeometryOfLightPacket,
}

impl SimdKernel for OcclusionKernel<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> u32 {
        let Self { geometry, rows, ends, traced, sources } = self;
        if geometry.traced_tree().has_shells()
            || traced & geometry.light_is_entire_merged_mesh_mask(sources) != 0
        {
            return geometry.occluded_one_by_one(rows, ends, traced, sources);
        }
        let mut occluders = OcclusionTest::new(geometry, rows, sources, simd);
        geometry.traced_tree().any_hit_packet(rows, ends, traced, geometry.unbounded(), &mut occluders, simd)
    }
}

/// Kernel of [`Geometry::closest_hit_packet`].
struct ClosestHitKernel<'a> {
    geometry: &'a Geometry,
    rays: &'a [Ray],
    hits: &'a mut [Option<Hit>],
}

impl SimdKernel for ClosestHitKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: impl Simd) {
        let (rows, mut ends) = RayPacket::new(self.rays);
        let traced = nonnegative_end_mask(&ends, simd);
        let (hits, object) = self.geometry.closest_hit_packet_simd(&rows, &mut ends, traced, simd);
        for (lane, hit) in self.hits.iter_mut().enumerate().take(PACKET_SIZE) {
            *hit = hits.get(lane).map(|shape| Hit { shape, object: object[lane] });
        }
    }
}

/// Placeholder for "no object".
const NONE: u32 = u32::MAX;

/// Closest-hit test: the nearest hits so far and their objects.
struct ClosestHitTest<'a, F> {
    geometry: &'a Geometry,
    rows: &'a RayPacket,
    hits: HitPacket,
    object: [u32; PACKET_SIZE],
    simd: F,
}

impl<F: Simd> ClosestHitCallback for ClosestHitTest<'_, F> {
    #[inline(always)]
    fn intersect_primitive(&mut self, id: u32, active: u32, ends: &mut F32x16) {
        let mut found = HitPacket::without_hits();
        let (these, mut objects) = (masked_ends(active, ends), [id; PACKET_SIZE]);
        match self.geometry.merged_meshes_if_proxy_id(id) {
            Some(merged) => {
                let by = self.geometry.instruction_set();
                merged.closest_hit_packet(by, self.rows, (active, &these), &mut found);
                objects = resolve_merged_hits(merged, &mut found);
            }
            None => {
                let object = &self.geometry.objects()[id as usize];
                object.closest_hit_packet(self.rows, active, &these, &mut found, self.simd);
            }
        }
        let mut nearer = [0; PACKET_SIZE];
        for lane in 0..PACKET_SIZE {
            let (t, end) = (found.t[lane], ends[lane]);
            let is_nearer = (t < end) | ((t == end) & (objects[lane] < self.object[lane]));
            nearer[lane] = if is_nearer { TRUE } else { 0 };
        }
        select(&nearer, &found.t, ends);
        select(&nearer, &found.t, &mut self.hits.t);
        select(&nearer, &found.u, &mut self.hits.u);
        select(&nearer, &found.v, &mut self.hits.v);
        select_u32(&nearer, &found.primitive, &mut self.hits.primitive);
        select_u32(&nearer, &objects, &mut self.object);
    }
}

/// Returns the objects of hits on merged meshes, and renumbers the hit triangles per object.
#[inline(always)]
fn resolve_merged_hits(merged: &MergedMeshes, found: &mut HitPacket) -> [u32; PACKET_SIZE] {
    let mut objects = [NONE; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        // Lanes without a hit look up triangle 0. The result is not used.
        let is_hit = !found.t[lane].is_nan();
        let of = merged.triangle(if is_hit { found.primitive[lane] } else { 0 });
        (objects[lane], found.primitive[lane]) = (of.object, of.primitive);
    }
    objects
}

/// Any-hit test for shadow rays.
pub(super) struct OcclusionTest<'a, F> {
    geometry: &'a Geometry,
    rows: &'a RayPacket,
    sources: &'a GeometryOfLightPacket,
    /// Mask of rays whose light is a single primitive of an object.
    in_part: u32,
    simd: F,
}

impl<'a, F: Simd> OcclusionTest<'a, F> {
    /// Creates the test for a packet of shadow rays to these lights.
    #[inline(always)]
    pub(super) fn new(
        geometry: &'a Geometry,
        rows: &'a RayPacket,
        sources: &'a GeometryOfLightPacket,
        simd: F,
    ) -> Self {
        Self { geometry, rows, sources, in_part: light_is_single_primitive_mask(sources, simd), simd }
    }
}

impl<F: Simd> AnyHitCallback for OcclusionTest<'_, F> {
    #[inline(always)]
    fn primitive_hit_mask(&mut self, id: u32, active: u32, ends: &F32x16) -> u32 {
        if let Some(merged) = self.geometry.merged_meshes_if_proxy_id(id) {
            let these = masked_ends(active, ends);
            if self.in_part & active == 0 {
                return merged.any_hit_packet(
                    self.geometry.instruction_set(),
                    self.rows,
                    (active, &these),
                    None,
                );
            }
            let mut own = [MergedMeshes::NO_TRIANGLE; PACKET_SIZE];
            for lane in set_bit_lanes(self.in_part & active) {
                let number = merged.merged_triangle_index(self.sources.object[lane], self.sources.part[lane]);
                own[lane] = number.unwrap_or(MergedMeshes::NO_TRIANGLE);
            }
            return merged.any_hit_packet(
                self.geometry.instruction_set(),
                self.rows,
                (active, &these),
                Some(&own),
            );
        }
        let own = light_is_on_object_mask(self.sources, id, self.simd);
        let (whole, in_part) = (own & !self.in_part, own & self.in_part);
        let active = active & !whole;
        if active == 0 {
            return 0;
        }
        let object = &self.geometry.objects()[id as usize];
        let except = if in_part == 0 { None } else { Some((in_part, &self.sources.part)) };
        object.any_hit_packet(self.rows, active, &masked_ends(active, ends), except, self.simd)
    }
}

/// Mask of rays whose light is a single primitive of an object.
#[inline(always)]
fn light_is_single_primitive_mask(sources: &GeometryOfLightPacket, simd: impl Simd) -> u32 {
    if !sources.is_any {
        return 0;
    }
    let mut in_part = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        in_part[lane] = if sources.part[lane] == GeometryOfLightPacket::NONE { 0 } else { TRUE };
    }
    simd.movemask(&in_part)
}

/// Mask of rays whose light is on object `id`.
#[inline(always)]
fn light_is_on_object_mask(sources: &GeometryOfLightPacket, id: u32, simd: impl Simd) -> u32 {
    if !sources.is_any {
        return 0;
    }
    let mut own = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        own[lane] = if sources.object[lane] == id { TRUE } else { 0 };
    }
    simd.movemask(&own)
}

/// Copies the ends of the rays in `active`, and sets other lanes to negative values.
#[inline(always)]
fn masked_ends(active: u32, ends: &F32x16) -> F32x16 {
    let mut own = [-1.0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        own[lane] = if active & 1 << lane != 0 { ends[lane] } else { -1.0 };
    }
    own
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::accel::InstructionSet;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::Shape;
    use crate::geometry::cuboid::OrientedBox;
    use crate::geometry::mesh::TriangleMesh;
    use crate::geometry::parallelogram::Parallelogram;
    use crate::geometry::plane::Plane;
    use crate::geometry::sphere::Sphere;
    use crate::lights::GeometryOfLight;
    use crate::math::random::signed_number_generator as random;
    use crate::math::transform::Transform;
    use crate::math::{DVec3, Vec3};
    use crate::scene::description::Accel;
    use crate::world::MeshTree;
    use crate::world::{MeshInstance, Object};

    /// A grid of spheres, boxes and quads, four instances of a triangle fan (one of them untransformed), and
    /// a floor.
    fn mixed_test_geometry(accel: Accel) -> Geometry {
        let mut mesh = TriangleMesh { positions: vec![Vec3::ZERO], ..TriangleMesh::default() };
        for i in 0..40_u32 {
            let angle = i as f32 * 0.157;
            mesh.positions.push(Vec3::new(angle.cos(), 0.3 * (3.0 * angle).sin(), angle.sin()));
            mesh.triangles.push([0, i + 1, (i + 1) % 40 + 1]);
        }
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let tree = Arc::new(MeshTree::build(loaded, accel, &CancelToken::new()).expect("never canceled"));
        let floor = Plane::new(DVec3::new(0.0, -2.0, 0.0), DVec3::Y);
        let mut objects = vec![Object::Shape(Shape::Plane(floor))];
        for i in 0..30 {
            let center = DVec3::new(f64::from(i % 5), f64::from(i / 5 % 3), f64::from(i / 15)) * 1.5
                - DVec3::splat(2.0);
            objects.push(Object::Shape(match i % 3 {
                0 => Shape::Box(OrientedBox::new(center, DVec3::splat(0.9), DVec3::splat(f64::from(i)))),
                1 => Shape::Quad(Parallelogram::new(center, DVec3::X, DVec3::new(0.0, 0.8, 0.4))),
                _ => Shape::Sphere(Sphere { center, radius: 0.6 }),
            }));
        }
        let placed = |i: i32| {
            let at = DVec3::new(f64::from(i) - 1.0, f64::from(i) * 0.7, 0.3);
            Transform::scale_rotate_translate(DVec3::splat(1.3), DVec3::splat(20.0 * f64::from(i)), at)
        };
        for transform in [Transform::IDENTITY, placed(0), placed(1), placed(2)] {
            objects.push(Object::Mesh(Box::new(MeshInstance::new(Arc::clone(&tree), transform, false))));
        }
        Geometry::build(objects, &CancelToken::new()).expect("never canceled")
    }

    #[test]
    fn packet_hits_match_single_ray_hits() {
        for accel in [Accel::Bvh, Accel::BvhHigh, Accel::KdTree] {
            for instructions in InstructionSet::ALL {
                assert_packets_match_rays(&mixed_test_geometry(accel).with_instruction_set(instructions));
            }
        }
    }

    #[test]
    fn packets_match_single_rays_in_nested_spheres() {
        let sphere = |i: u32| Sphere { center: DVec3::ZERO, radius: 0.5 + f64::from(i) / 64.0 };
        let spheres = (0..200).map(|i| Object::Shape(Shape::Sphere(sphere(i))));
        let geometry = Geometry::build(spheres.collect(), &CancelToken::new()).expect("never canceled");
        assert!(geometry.traced_tree().has_shells());
        assert_packets_match_rays(&geometry);
    }

    struct OccludedRayPacketKernel<'a> {
        geometry: &'a Geometry,
        rays: &'a [Ray],
        sources: &'a GeometryOfLightPacket,
    }

    impl SimdKernel for OccludedRayPacketKernel<'_> {
        type Output = u32;

        #[inline(always)]
        fn run(self, simd: impl Simd) -> u32 {
            let (rows, ends) = RayPacket::new(self.rays);
            self.geometry.occluded_ray_mask(
                &rows,
                &ends,
                nonnegative_end_mask(&ends, simd),
                self.sources,
                simd,
            )
        }
    }

    /// Compares packets of random rays with single rays.
    pub(in crate::world) fn assert_packets_match_rays(geometry: &Geometry) {
        let mut next = random(3);
        let (mut hits, mut shadows) = (0, 0);
        for i in 0..3000 {
            let eye = Vec3::new(next(), next(), next()) * 6.0;
            let target = Vec3::new(next(), next(), next()) * 2.0;
            let spread = [0.001, 0.1, 4.0][i % 3];
            let mut ray = || {
                let to = target + Vec3::new(next(), next(), next()) * spread;
                if i % 2 == 0 { Ray::segment_ending_before_point(eye, to) } else { Ray::new(eye, to - eye) }
            };
            let mut rays: Vec<Ray> = (0..=i % PACKET_SIZE).map(|_| ray()).collect();
            // Let some rays ignore the triangle they would hit.
            for ray in rays.iter_mut().step_by(4) {
                let start = geometry.closest_hit(ray).map_or(7, |hit| geometry.scene_triangle_number(&hit));
                *ray = ray.with_start_triangle(start);
            }
            let mut found = vec![None; rays.len()];
            geometry.closest_hit_packet(&rays, &mut found);
            let alone: Vec<_> = rays.iter().map(|ray| geometry.closest_hit(ray)).collect();
            assert_eq!(found, alone, "{rays:?}");
            let source = |lane: usize| match alone[lane] {
                Some(hit) if lane.is_multiple_of(3) => GeometryOfLight::Object(hit.object),
                Some(hit) if lane % 3 == 1 => GeometryOfLight::Primitive(hit.object, hit.shape.primitive),
                _ => GeometryOfLight::Object(u32::MAX),
            };
            let sources: Vec<_> = (0..rays.len()).map(source).collect();
            let mut row = GeometryOfLightPacket::splat(GeometryOfLight::Nothing);
            sources.iter().enumerate().for_each(|(lane, source)| row.set_geometry(lane, *source));
            let occluded = geometry.instruction_set().run(OccludedRayPacketKernel {
                geometry,
                rays: &rays,
                sources: &row,
            });
            for (lane, (ray, source)) in rays.iter().zip(&sources).enumerate() {
                assert_eq!(
                    occluded & 1 << lane != 0,
                    geometry.is_occluded_except_by_light(ray, *source),
                    "{lane} of {rays:?}"
                );
            }
            hits += alone.iter().flatten().count();
            shadows += occluded.count_ones();
        }
        assert!(hits > 5000 && shadows > 1000, "{hits} hits and {shadows} shadows, too few for the test");
    }
}
