//! Sums of reflected direct light, with the rays and texture lookups that they took.

use crate::geometry::packet::F32x16;
use crate::integrators::RayCounters;
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, Vec3x16, mask_from_bits, set_lane};

/// Ray and texture lookup counts for direct lighting.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectLightCounters {
    /// Shadow rays.
    pub shadow: u64,
    /// Rays in narrow lobes.
    pub scattered: u64,
    /// Emission texture lookups.
    pub lookups: u64,
}

impl DirectLightCounters {
    /// Adds these counts to a tile's counts.
    pub fn add_to(&self, counters: &mut RayCounters) {
        counters.shadow_rays += self.shadow;
        counters.scattered_rays += self.scattered;
        counters.texture_lookups += self.lookups;
    }
}

impl std::ops::AddAssign for DirectLightCounters {
    fn add_assign(&mut self, other: Self) {
        self.shadow += other.shadow;
        self.scattered += other.scattered;
        self.lookups += other.lookups;
    }
}

/// Direct light that a packet of vertices reflects toward the viewer, summed over all light samples.
#[derive(Clone)]
#[repr(align(64))]
pub struct LightSums {
    /// Unoccluded reflected light, before multiplication by the path throughput.
    pub light: Vec3x16,
    /// The part of `light` from wide lobes, if it was requested.
    pub diffuse: Vec3x16,
    /// Reflected light, ignoring occlusion.
    pub total: F32x16,
    /// Rays and texture lookups so far.
    pub rays: DirectLightCounters,
}

impl LightSums {
    /// No light, from no samples.
    pub const ZERO: Self = Self {
        light: [[0.0; PACKET_SIZE]; 3],
        diffuse: [[0.0; PACKET_SIZE]; 3],
        total: [0.0; PACKET_SIZE],
        rays: DirectLightCounters { shadow: 0, scattered: 0, lookups: 0 },
    };

    /// Replaces the reflected light with the lit fraction.
    #[cold]
    pub fn replace_light_with_lit_fraction(&mut self) {
        for i in 0..PACKET_SIZE {
            let share = if self.total[i] > 0.0 { self.light[0][i] / self.total[i] } else { 0.0 };
            set_lane(&mut self.light, i, Vec3::splat(share));
        }
    }

    /// Adds reflected light, and if `splits_lobes` its part from wide lobes, in the lanes set in `bits`.
    pub fn add_lanes(&mut self, bits: u32, [light, diffuse]: &[Vec3x16; 2], splits_lobes: bool) {
        add_masked_lanes(bits, light, &mut self.light);
        if splits_lobes {
            add_masked_lanes(bits, diffuse, &mut self.diffuse);
        }
    }
}

/// Adds the values in the lanes set in `bits`, selecting them with bit masks as in
/// [`select`](crate::math::lanes::select).
#[inline(always)]
pub fn add_masked_lanes(bits: u32, values: &Vec3x16, sums: &mut Vec3x16) {
    let of = mask_from_bits(bits);
    for axis in 0..3 {
        for i in 0..PACKET_SIZE {
            sums[axis][i] += f32::from_bits(values[axis][i].to_bits() & of[i]);
        }
    }
}

/// Adds the products of `values` and `fraction` in the lanes set in `bits`.
#[inline(never)]
pub fn add_masked_lane_products(bits: u32, values: &Vec3x16, fraction: &Vec3x16, sums: &mut Vec3x16) {
    let of = mask_from_bits(bits);
    for axis in 0..3 {
        for i in 0..PACKET_SIZE {
            let part = values[axis][i] * fraction[axis][i];
            sums[axis][i] += f32::from_bits(part.to_bits() & of[i]);
        }
    }
}
