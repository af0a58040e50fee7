//! Stores the vertices of plain surfaces in a packet: positions, normals, shadow-ray origins and path state.

use super::batch::{UNPERTURBED, VertexBatch};
use super::packet_source::PacketSource;
use super::vertex::lift_significance_and_t_max;
use crate::geometry::Ray;
use crate::geometry::packet::RayPacket;
use crate::geometry::ray::offset_origin;
use crate::geometry::surface_packet::SurfacePacket;
use crate::math::lanes::{Simd, TRUE, lane, mask_from_bits, select, select_u32, set_lane};
use crate::sampling::CAMERA_PATH;
use crate::world::PACKET_SIZE;

/// Selects the vertices on smooth meshes to lift above their facets.
#[derive(Clone, Copy)]
pub(super) enum ShadowLiftSelection {
    /// All vertices.
    All,
    /// Only the vertices whose bits are set, and only if the segment to the vertex's lifted point is
    /// unoccluded.
    IfFree(u32),
}

impl VertexBatch {
    /// Sets [`VertexBatch::start`] for the lanes in `of`.
    #[inline(always)]
    pub(super) fn set_start_triangles(&mut self, of: u32, starts: &[u32; PACKET_SIZE]) {
        select_u32(&mask_from_bits(of), starts, &mut self.start);
    }

    /// Sets shading normals and lifted origins in the lanes of smooth surfaces.
    #[inline(always)]
    fn set_smooth_normals_and_lifts(
        &mut self,
        rays: &RayPacket,
        surface: &SurfacePacket,
        lifts: ShadowLiftSelection,
        simd: impl Simd,
    ) {
        // Turn the shading and geometric normals toward the viewer.
        let (mut normals, mut facets) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
        let (mut ends, mut above, mut bent) = ([0.0; PACKET_SIZE], [0; PACKET_SIZE], [0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let (geometric, direction) = (lane(&surface.normal, i), lane(&rays.direction, i));
            let shading = lane(&surface.shading_normal, i);
            let is_perturbed =
                (shading.x != geometric.x) | (shading.y != geometric.y) | (shading.z != geometric.z);
            bent[i] = if is_perturbed { TRUE } else { 0 };
            let side = if geometric.dot(direction) > 0.0 { -1.0 } else { 1.0 };
            set_lane(&mut normals, i, shading * side);
            set_lane(&mut facets, i, geometric * side);
        }
        // Compute the lifted points above the facets.
        for i in 0..PACKET_SIZE {
            let (from, to) = (lane(&self.from, i), lane(&surface.shadow_point, i));
            let (is_above, end) =
                lift_significance_and_t_max(from, to, lane(&facets, i), lane(&surface.error, i));
            above[i] = if is_above { TRUE } else { 0 };
            ends[i] = end;
        }
        // Determine which vertices to lift now, and which to lift only if the segment is unoccluded.
        let of = mask_from_bits(surface.smooth);
        let above = simd.movemask(&above) & surface.smooth;
        let rises = match lifts {
            ShadowLiftSelection::All => mask_from_bits(above),
            ShadowLiftSelection::IfFree(only_specular_before) => {
                self.has_horizon |= simd.movemask(&bent) & surface.smooth;
                self.may_lift |= above & only_specular_before;
                [0; PACKET_SIZE]
            }
        };
        self.bsdf.set_normals_and_ray_directions(Some(&of), &mut normals, &rays.direction, simd);
        for axis in 0..3 {
            select(&of, &facets[axis], &mut self.horizon[axis]);
            select(&of, &facets[axis], &mut self.facet[axis]);
            select(&of, &surface.point[axis], &mut self.point[axis]);
            select(&of, &normals[axis], &mut self.smooth_normal[axis]);
            select(&of, &surface.shadow_point[axis], &mut self.lifted[axis]);
            select(&rises, &surface.shadow_point[axis], &mut self.from[axis]);
            select(&of, &normals[axis], &mut self.normal[axis]);
        }
        select_u32(&rises, &[Ray::NO_TRIANGLE; PACKET_SIZE], &mut self.start);
        select(&of, &ends, &mut self.lift_end);
        select(&of, &[UNPERTURBED; PACKET_SIZE], &mut self.shading_normal_cosine);
        self.has_facet |= surface.smooth;
    }

    /// Sets the positions and path state of plain vertices and returns the mask of vertices whose front face
    /// was hit.
    #[inline(always)]
    pub(super) fn set_plain_vertices(
        &mut self,
        paths: &PacketSource<'_>,
        rays: &RayPacket,
        surface: &SurfacePacket,
        lifts: ShadowLiftSelection,
        simd: impl Simd,
    ) -> u32 {
        // Place the vertices on the facets, on the viewer's side.
        let mut front = [0; PACKET_SIZE];
        self.interiors = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let (normal, direction) = (lane(&surface.normal, i), lane(&rays.direction, i));
            let cosine = normal.dot(direction);
            front[i] = if cosine < 0.0 { TRUE } else { 0 };
            let normal = normal * if cosine > 0.0 { -1.0 } else { 1.0 };
            let from = offset_origin(lane(&surface.point, i), lane(&surface.error, i), normal, normal);
            set_lane(&mut self.from, i, from);
            set_lane(&mut self.normal, i, normal);
        }
        self.bsdf.set_normals_and_ray_directions(None, &mut self.normal, &rays.direction, simd);
        // Replace the normals of smooth surfaces.
        if surface.smooth != 0 {
            self.set_smooth_normals_and_lifts(rays, surface, lifts, simd);
        }
        // Copy the path state.
        match paths {
            PacketSource::Camera(_, slot, ..) => {
                self.throughput = [[1.0; PACKET_SIZE]; 3];
                self.path = [CAMERA_PATH + 1; PACKET_SIZE];
                self.roulette_throughput = [1.0; PACKET_SIZE];
                for i in 0..PACKET_SIZE {
                    self.slot[i] = slot + i as u32;
                }
            }
            PacketSource::Paths(..) | PacketSource::Traced(..) => {
                for i in 0..PACKET_SIZE {
                    let Some(path) = paths.queued_path(i) else { break };
                    set_lane(&mut self.throughput, i, path.throughput);
                    self.roulette_throughput[i] = path.state.roulette_throughput;
                    (self.slot[i], self.path[i]) = (path.slot, path.path);
                }
            }
        }
        for i in 0..PACKET_SIZE {
            self.place[i] = paths.queue_index(i);
        }
        simd.movemask(&front)
    }
}
