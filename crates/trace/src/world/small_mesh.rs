//! Small meshes: every triangle is tested against all rays of a packet, without using the tree. Hits are
//! bit-identical to the hits found with the tree.

use super::MeshInstance;
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket};
use crate::geometry::watertight_packet::ShearedPacket;
use crate::math::lanes::{Simd, lane, set_lane};

/// Maximum triangle count. Above it, traversing the tree is faster.
const SMALL_MESH: usize = 16;

impl MeshInstance {
    /// Whether the mesh is small enough to be tested without the tree.
    #[inline(always)]
    pub(super) fn is_small(&self) -> bool {
        self.tree.loaded().mesh.triangles.len() <= SMALL_MESH
    }

    /// Finds the nearest hits of the rays in `met`. Other lanes have negative `ends`.
    #[inline(always)]
    pub(super) fn closest_hit_packet_without_tree(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        let (mesh, local, mut ends) = (&self.tree.loaded().mesh, self.local_packet(rows), *ends);
        let rays = ShearedPacket::new(&local);
        for number in 0..mesh.triangles.len() as u32 {
            rays.update_closest_hits((number, &mesh.corners(number)), (met, &mut ends), found, simd);
        }
    }

    /// Returns the mask of rays in `met` that hit any triangle other than the ignored triangle. Other lanes
    /// have negative `ends`.
    #[inline(always)]
    pub(super) fn any_hit_packet_without_tree(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
        simd: impl Simd,
    ) -> u32 {
        let (mesh, local) = (&self.tree.loaded().mesh, self.local_packet(rows));
        let (rays, mut hit) = (ShearedPacket::new(&local), 0);
        for number in 0..mesh.triangles.len() as u32 {
            let mut asked = met & !hit;
            if let Some((own, parts)) = except {
                for i in 0..PACKET_SIZE {
                    let is_own = own & 1 << i != 0 && parts[i] == number;
                    asked &= !(u32::from(is_own) << i);
                }
            }
            if asked != 0 {
                hit |= rays.hit_mask((number, &mesh.corners(number)), asked, ends, simd);
            }
        }
        hit
    }

    /// Transforms the rays to mesh coordinates.
    #[inline(always)]
    fn local_packet(&self, rows: &RayPacket) -> RayPacket {
        let RayPacket { mut origin, mut direction, mut start } = *rows;
        if self.is_transformed {
            for i in 0..PACKET_SIZE {
                let at = self.transform.inverse_point(lane(&origin, i).as_dvec3()).as_vec3();
                set_lane(&mut origin, i, at);
                let towards = self.transform.inverse_vector(lane(&direction, i).as_dvec3()).as_vec3();
                set_lane(&mut direction, i, towards);
            }
        }
        for start in &mut start {
            *start = self.mesh_triangle_number_unchecked(*start);
        }
        RayPacket::from_soa(origin, direction).with_start_triangle(start)
    }
}
