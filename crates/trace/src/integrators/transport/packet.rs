//! Intersects packets of rays and prepares plain surfaces for direct lighting in packets, because preparing
//! each vertex separately would cost more than lighting it.

use arrayvec::ArrayVec;

use super::batch::VertexBatch;
use super::packet_source::PacketSource;
use super::plain_vertices::ShadowLiftSelection;
use super::ray::PathRay;
use super::tile::TileContext;
use crate::control::Canceled;
use crate::geometry::packet::{self, HitPacket, RayPacket};
use crate::geometry::surface_packet::SurfacePacket;
use crate::geometry::{Ray, SurfacePoint};
use crate::integrators::view::PathAov;
use crate::materials::NonSpecular;
use crate::materials::bsdf::ShownLobes;
use crate::math::lanes::{F32x16, Simd, TRUE, Vec3x16, lane, set_lane};
use crate::math::{DVec2, Vec3};
use crate::scene::description::ShadowMode;
use crate::world::{Hit, Object, PACKET_SIZE, PacketShadingMaterial, SimdKernel};

/// Number of rays traced between checks of the cancel token.
pub const POLL_INTERVAL: usize = 256;

/// Hits of a packet. A surface is plain if its ray is in air, its shape and the textures of its non-specular
/// material can be evaluated in packets, and all plain surfaces of the packet have the same kind of BSDF.
#[repr(align(64))]
pub struct PacketHits {
    hits: HitPacket,
    object: [u32; PACKET_SIZE],
    /// Mask of rays that hit anything.
    pub any: u32,
    /// Mask of plain surfaces.
    pub plain: u32,
    /// Mask of plain surfaces that emit toward the ray's origin.
    pub shining: u32,
    /// Mask of non-plain surfaces stored in the surface packet.
    found: u32,
    /// Number of texture lookups for plain surfaces.
    pub lookups: u64,
    /// Radiance and light-sampling pdf of the environment along each ray, if any ray leaves the scene.
    sky: (Vec3x16, F32x16),
}

impl PacketHits {
    /// Returns the hit found by the ray in a lane, if any.
    pub fn hit(&self, lane: usize) -> Option<Hit> {
        self.hits.get(lane).map(|shape| Hit { shape, object: self.object[lane] })
    }

    /// Point and interpolated front normal of a plain surface.
    #[inline]
    pub fn point_and_shading_normal(&self, surfaces: &SurfacePacket, lane_of_ray: usize) -> (Vec3, Vec3) {
        let is_smooth = surfaces.smooth & 1 << lane_of_ray != 0;
        let normal = if is_smooth { &surfaces.shading_normal } else { &surfaces.normal };
        (lane(&surfaces.point, lane_of_ray), lane(normal, lane_of_ray))
    }

    /// Surface at a hit, or `None` if it is plain or not in the surface packet.
    pub fn non_plain_surface_of_lane(
        &self,
        surfaces: &SurfacePacket,
        lane_of_ray: usize,
    ) -> Option<SurfacePoint> {
        let (i, bit) = (lane_of_ray, 1 << lane_of_ray);
        if self.found & bit == 0 {
            return None;
        }
        let (point, normal) = (lane(&surfaces.point, i), lane(&surfaces.normal, i));
        let is_smooth = surfaces.smooth & bit != 0;
        let smooth = |of: &Vec3x16, flat: Vec3| if is_smooth { lane(of, i) } else { flat };
        let (u, v) = (self.hits.u[i], self.hits.v[i]);
        Some(SurfacePoint {
            point,
            shadow_point: smooth(&surfaces.shadow_point, point),
            error: lane(&surfaces.error, i),
            normal,
            shading_normal: smooth(&surfaces.shading_normal, normal),
            uv: DVec2::ZERO,
            dpdu: Vec3::ZERO,
            dpdv: Vec3::ZERO,
            barycentric: Vec3::new(1.0 - u - v, u, v),
        })
    }

    /// Radiance of the environment along a ray that leaves the scene, and its light-sampling pdf in sr⁻¹.
    pub fn sky_radiance_and_pdf_of_lane(&self, lane_of_ray: usize) -> (Vec3, f32) {
        (lane(&self.sky.0, lane_of_ray), self.sky.1[lane_of_ray])
    }
}

impl TileContext<'_> {
    /// Finds the closest hit of every ray in a queue, replacing the content of `hits`.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn closest_hits_of_queue(
        &self,
        rays: &[PathRay],
        hits: &mut Vec<Option<Hit>>,
    ) -> Result<(), Canceled> {
        hits.clear();
        hits.resize(rays.len(), None);
        for (paths, hits) in rays.chunks(POLL_INTERVAL).zip(hits.chunks_mut(POLL_INTERVAL)) {
            self.token.check_pause_and_cancel()?;
            for (paths, hits) in paths.chunks(PACKET_SIZE).zip(hits.chunks_mut(PACKET_SIZE)) {
                let rays: [Ray; PACKET_SIZE] =
                    std::array::from_fn(|lane| paths[lane.min(paths.len() - 1)].ray);
                self.world.geometry.closest_hit_packet(&rays[..paths.len()], hits);
            }
        }
        Ok(())
    }

    /// Intersects at most [`PACKET_SIZE`] rays. Plain surfaces are stored in the vertex packet, ready for
    /// direct lighting if `are_lit` is true. The packet's `used` mask contains the surfaces that reflect
    /// light. Other surfaces are stored in the surface packet if supported.
    pub fn intersect_packet(
        &self,
        rays: PacketSource<'_>,
        aov: PathAov,
        are_lit: bool,
        (row, surface): (&mut VertexBatch, &mut SurfacePacket),
    ) -> PacketHits {
        self.world.geometry.instruction_set().run(PacketIntersector {
            tile: self,
            rays,
            aov,
            are_lit,
            row,
            surface,
        })
    }

    /// Whether surface packets contain everything needed for shading a non-plain material. Surface packets
    /// have no texture coordinates or tangents.
    #[inline(always)]
    fn surface_packet_suffices_for_material(&self, material: usize) -> bool {
        // Ray cones need tangents and curvatures.
        self.camera_cone.is_none() && !self.world.material_needs_uvs_or_tangents(material)
    }

    /// Packet-shading data and non-specular BSDF of a material, or `None` if the material is not plain.
    #[inline(always)]
    pub fn plain_material_for_packets(
        &self,
        material: usize,
    ) -> Option<(&PacketShadingMaterial, &NonSpecular)> {
        let (plain, rough) = self.world.material_for_packet_shading(material)?;
        // A textured ambient color needs a lookup per surface.
        let has_ambient = self.settings.render.ambient != Vec3::ZERO;
        (!has_ambient || plain.ambient.is_some()).then_some((plain, rough))
    }
}

struct PacketIntersector<'a> {
    tile: &'a TileContext<'a>,
    rays: PacketSource<'a>,
    aov: PathAov,
    are_lit: bool,
    row: &'a mut VertexBatch,
    surface: &'a mut SurfacePacket,
}

/// Masks of a packet's plain surfaces.
struct PlainSurfaceMasks {
    /// All plain surfaces.
    all: u32,
    /// Surfaces that emit on either side.
    shining: u32,
    /// Surfaces that emit on both sides.
    two_sided: u32,
    /// Surfaces that are black from behind.
    black_from_behind: u32,
    /// Number of texture lookups for plain surfaces.
    lookups: u64,
}

impl SimdKernel for PacketIntersector<'_> {
    type Output = PacketHits;

    #[inline(always)]
    fn run(mut self, simd: impl Simd) -> PacketHits {
        let (tile, rays) = (self.tile, self.rays);
        let world = tile.world;
        self.row.reset();
        // Gather the rays into a packet.
        let (of_paths, traced);
        let mut ends = [-1.0; PACKET_SIZE];
        let rows = match rays {
            PacketSource::Camera(row, _, count, _) => {
                ends[..count].fill(f32::INFINITY);
                traced = rays.mask();
                if row.valid != u32::MAX {
                    for lane in 0..PACKET_SIZE {
                        ends[lane] = if traced >> lane & 1 != 0 { f32::INFINITY } else { -1.0 };
                    }
                }
                &row.rays
            }
            PacketSource::Paths(..) | PacketSource::Traced(..) => {
                let (mut origin, mut direction) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
                let mut start = [Ray::NO_TRIANGLE; PACKET_SIZE];
                for lane in 0..PACKET_SIZE {
                    let Some(path) = rays.queued_path(lane) else { break };
                    set_lane(&mut origin, lane, path.ray.origin);
                    set_lane(&mut direction, lane, path.ray.direction);
                    (start[lane], ends[lane]) = (path.ray.start, path.ray.t_max);
                }
                traced = packet::nonnegative_end_mask(&ends, simd);
                of_paths = RayPacket::from_soa(origin, direction).with_start_triangles(start);
                &of_paths
            }
        };
        // Intersect the rays, or use the hits found earlier.
        let (hits, object) = match rays {
            PacketSource::Camera(..) | PacketSource::Paths(..) => {
                world.geometry.closest_hit_packet_simd(rows, &mut ends, traced, simd)
            }
            PacketSource::Traced(_, known, places) => gather_hit_packet(known, places),
        };
        // Select the rays in air, whose surfaces may be plain.
        *self.surface = SurfacePacket::EMPTY;
        let any = hits.hit_mask(simd);
        let (mut in_air, mut only_specular_before, mut after_gloss) = (any, !0, 0);
        match rays {
            PacketSource::Camera(..) => in_air = if world.is_camera_in_air() { any } else { 0 },
            PacketSource::Paths(..) | PacketSource::Traced(..) => {
                for lane in 0..PACKET_SIZE {
                    let Some(path) = rays.queued_path(lane) else { break };
                    in_air &= if path.interiors.is_air() { !0 } else { !(1 << lane) };
                    only_specular_before &= if path.state.only_specular_before { !0 } else { !(1 << lane) };
                    after_gloss |= u32::from(path.state.is_after_gloss) << lane;
                }
            }
        }
        // Compute the plain surfaces and their BSDFs.
        (self.row.only_specular_before, self.row.after_gloss) = (only_specular_before, after_gloss);
        let plain = self.fill_plain_surfaces(rows, (&hits, &object), in_air, simd);
        // Set the positions and normals of the plain vertices.
        let lifts = match tile.settings.render.shadows {
            ShadowMode::Off => ShadowLiftSelection::All,
            ShadowMode::Hard | ShadowMode::Soft => ShadowLiftSelection::IfFree(only_specular_before),
        };
        let front = if plain.all == 0 {
            0
        } else {
            self.row.set_plain_vertices(&rays, rows, self.surface, lifts, simd)
        };
        self.row.used &= front | !plain.black_from_behind;
        // Compute the other surfaces, and the environment for rays that leave the scene.
        let found = tile.fill_packable_non_plain_surfaces(
            self.surface,
            rows,
            (&hits, &object),
            any & !plain.all,
            simd,
        );
        let all = rays.mask();
        let sky = match world.lights.environment() {
            Some(environment) if any & all != all => environment.radiance_and_pdf_packet(&rows.direction),
            Some(_) | None => ([[0.0; PACKET_SIZE]; 3], [0.0; PACKET_SIZE]),
        };
        let (shining, lookups) = (plain.shining & (front | plain.two_sided), plain.lookups);
        PacketHits { hits, object, any, plain: plain.all, shining, found, lookups, sky }
    }
}

impl PacketIntersector<'_> {
    /// Stores the plain surfaces among the hits in `left` in the surface packet, and their BSDFs in the
    /// vertex packet.
    #[inline(always)]
    fn fill_plain_surfaces(
        &mut self,
        rows: &RayPacket,
        (hits, object): (&HitPacket, &[u32; PACKET_SIZE]),
        mut left: u32,
        simd: impl Simd,
    ) -> PlainSurfaceMasks {
        let Self { tile, aov, are_lit, row, surface, .. } = self;
        let mut plain =
            PlainSurfaceMasks { all: 0, shining: 0, two_sided: 0, black_from_behind: 0, lookups: 0 };
        while left != 0 {
            let (id, of_object) = first_value_and_matching_lanes(object, left, simd);
            left &= !of_object;
            if tile.world.object_uses_vertex_colors(id) {
                continue;
            }
            // Skip materials that are not plain. The first plain material determines the kind of all BSDFs.
            let materials = tile.world.packet_material_indices(id, of_object, &hits.primitive);
            let (mut of, mut asked_uvs) = (0, None);
            let mut groups = ArrayVec::<(&NonSpecular, bool, u32), PACKET_SIZE>::new();
            let mut waiting = of_object;
            while waiting != 0 {
                let (material, alike) = first_value_and_matching_lanes(&materials, waiting, simd);
                waiting &= !alike;
                let Some((material, rough)) = tile.plain_material_for_packets(material as usize) else {
                    continue;
                };
                if plain.all | of == 0 {
                    row.bsdf.set_kind(material.kind);
                } else if row.bsdf.kind() != material.kind {
                    continue;
                }
                let own_uvs = material.row_texture.filter(|_| *are_lit && aov.applies_surface_colors());
                // Packets have room for one set of texture coordinates.
                if own_uvs.is_some() && asked_uvs.is_some() && own_uvs != asked_uvs {
                    continue;
                }
                asked_uvs = asked_uvs.or(own_uvs);
                of |= alike;
                plain.shining |= if material.is_emissive() { alike } else { 0 };
                plain.two_sided |= if material.is_two_sided { alike } else { 0 };
                plain.black_from_behind |= if material.is_black_from_behind { alike } else { 0 };
                groups.push((rough, own_uvs.is_some(), alike));
            }
            if of == 0 {
                continue;
            }
            // Compute the surfaces.
            match &tile.world.geometry.objects()[id as usize] {
                Object::Shape(shape) => {
                    row.set_start_triangles(of, &[Ray::NO_TRIANGLE; PACKET_SIZE]);
                    if !surface.try_fill_points_of_shape_lanes(shape, rows, hits, of) {
                        (plain.shining, plain.two_sided) = (plain.shining & !of, plain.two_sided & !of);
                        continue;
                    }
                    if asked_uvs.is_some() {
                        surface.fill_uv_of_shape_lanes(shape, rows, hits, of);
                    }
                }
                Object::Mesh(mesh) => {
                    row.set_start_triangles(of, &mesh.packet_scene_triangle_numbers(&hits.primitive));
                    mesh.fill_surfaces(surface, rows, hits, of, asked_uvs, simd);
                }
            }
            plain.all |= of;
            // Evaluate the materials. At vertices that the camera does not see, all lobes are used.
            for (rough, has_uv, of) in groups {
                plain.lookups += if has_uv { u64::from(of.count_ones()) } else { 0 };
                let shown = [(of, aov.lobes()), (of & !row.only_specular_before, ShownLobes::ALL)];
                let shown = if *aov == PathAov::ALL { &shown[..1] } else { &shown };
                let black =
                    row.bsdf.evaluate_material_into_lanes(rough, has_uv.then_some(&surface.uv), shown, simd);
                row.used |= of & !black;
            }
        }
        plain
    }
}

/// Returns the index stored in the first lane in `left`, and the mask of lanes in `left` that have the same
/// index.
#[inline(always)]
fn first_value_and_matching_lanes(indices: &[u32; PACKET_SIZE], left: u32, simd: impl Simd) -> (u32, u32) {
    let index = indices[left.trailing_zeros() as usize % PACKET_SIZE];
    let mut of = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        of[lane] = if indices[lane] == index { TRUE } else { 0 };
    }
    (index, simd.movemask(&of) & left)
}

/// Gathers the previously found hits at these queue indices into a packet.
#[inline(always)]
fn gather_hit_packet(known: &[Option<Hit>], places: &[u32]) -> (HitPacket, [u32; PACKET_SIZE]) {
    let (mut hits, mut object) = (HitPacket::without_hits(), [u32::MAX; PACKET_SIZE]);
    for (lane, &place) in places.iter().enumerate().take(PACKET_SIZE) {
        if let Some(hit) = &known[place as usize] {
            hits.set(lane, &hit.shape);
            object[lane] = hit.object;
        }
    }
    (hits, object)
}

impl TileContext<'_> {
    /// Stores the surfaces of non-plain hits in the surface packet and returns the mask of stored surfaces.
    #[inline(always)]
    fn fill_packable_non_plain_surfaces(
        &self,
        surface: &mut SurfacePacket,
        rows: &RayPacket,
        (hits, object): (&HitPacket, &[u32; PACKET_SIZE]),
        mut left: u32,
        simd: impl Simd,
    ) -> u32 {
        let mut found = 0;
        while left != 0 {
            let (id, of_object) = first_value_and_matching_lanes(object, left, simd);
            left &= !of_object;
            let shown_object = &self.world.geometry.objects()[id as usize];
            // A single hit on a shape is cheaper to evaluate separately.
            if matches!(shown_object, Object::Shape(_)) && of_object.is_power_of_two() {
                continue;
            }
            let materials = self.world.packet_material_indices(id, of_object, &hits.primitive);
            let (mut of, mut waiting) = (0, of_object);
            while waiting != 0 {
                let (material, alike) = first_value_and_matching_lanes(&materials, waiting, simd);
                waiting &= !alike;
                of |= if self.surface_packet_suffices_for_material(material as usize) { alike } else { 0 };
            }
            if of == 0 {
                continue;
            }
            let is_filled = match shown_object {
                Object::Shape(shape) => surface.try_fill_points_of_shape_lanes(shape, rows, hits, of),
                Object::Mesh(mesh) => {
                    mesh.fill_surfaces(surface, rows, hits, of, None, simd);
                    true
                }
            };
            found |= if is_filled { of } else { 0 };
        }
        found
    }
}
