//! Meshes of few triangles: each triangle is tested against all rays of a packet at once, whatever their directions. Hits have
//! the bits of those by the mesh's tree.

use super::MeshInstance;
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket};
use crate::geometry::watertight_packet::ShearedPacket;
use crate::math::lanes::{Simd, lane, set_lane};

/// Most triangles of such a mesh: for more, the tree skips so many that it is faster.
const FEW: usize = 16;

impl MeshInstance {
    /// Whether it has few triangles.
    #[inline(always)]
    pub(super) fn has_few(&self) -> bool {
        self.tree.loaded().mesh.triangles.len() <= FEW
    }

    /// The nearest hits of the rays in `met`; the others end below 0.
    #[inline(always)]
    pub(super) fn closest_of_few(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        found: &mut HitPacket,
        simd: impl Simd,
    ) {
        let (mesh, local, mut ends) = (&self.tree.loaded().mesh, self.local_rows(rows), *ends);
        let rays = ShearedPacket::new(&local);
        for number in 0..mesh.triangles.len() as u32 {
            rays.closest((number, &mesh.corners(number)), (met, &mut ends), found, simd);
        }
    }

    /// A bit for each ray in `met` that hits any triangle but its own of `except`; the others end below 0.
    #[inline(always)]
    pub(super) fn any_of_few(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
        simd: impl Simd,
    ) -> u32 {
        let (mesh, local) = (&self.tree.loaded().mesh, self.local_rows(rows));
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
                hit |= rays.any((number, &mesh.corners(number)), asked, ends, simd);
            }
        }
        hit
    }

    /// The rays in the mesh's coordinates.
    #[inline(always)]
    fn local_rows(&self, rows: &RayPacket) -> RayPacket {
        let RayPacket { mut origin, mut direction, mut start } = *rows;
        if self.is_moved {
            for i in 0..PACKET_SIZE {
                let at = self.transform.inverse_point(lane(&origin, i).as_dvec3()).as_vec3();
                set_lane(&mut origin, i, at);
                let towards = self.transform.inverse_vector(lane(&direction, i).as_dvec3()).as_vec3();
                set_lane(&mut direction, i, towards);
            }
        }
        for start in &mut start {
            *start = self.own_number(*start);
        }
        RayPacket::of(origin, direction).leaving(start)
    }
}
