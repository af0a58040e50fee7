//! Structure-of-arrays storage for a packet's rays.

use crate::accel::{F32x16, PACKET_SIZE as SIZE};
use crate::geometry::Ray;

/// Rays in structure-of-arrays layout.
#[repr(align(64))]
pub struct RaySoa {
    pub origin: [F32x16; 3],
    pub direction: [F32x16; 3],
    pub ends: F32x16,
    /// [`Ray::start`] of each ray, stored as a bit pattern. NaN for a ray without a start triangle.
    pub start: F32x16,
    /// Mask of the traced rays.
    pub traced: u32,
    /// First traced ray.
    pub first: Ray,
}

/// Mask of all lanes.
const ALL: u32 = (1 << SIZE) - 1;

impl RaySoa {
    #[inline(always)]
    fn set(&mut self, lane: usize, ray: &Ray) {
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
        self.start[lane] = f32::from_bits(ray.start);
    }

    /// Loads rays. Lanes without a ray or with a negative end get a copy of the first traced ray. Returns
    /// `None` if no ray is traced.
    #[inline(always)]
    pub fn new(rays: &[Ray], ends: &F32x16) -> Option<Self> {
        let count = rays.len().min(SIZE);
        let mut traced = 0;
        for (lane, &end) in ends.iter().enumerate().take(count) {
            traced |= u32::from(end >= 0.0) << lane;
        }
        let first_lane = traced.trailing_zeros() as usize;
        let first = *rays.get(first_lane)?;
        let mut rows = Self {
            origin: [[0.0; SIZE]; 3],
            direction: [[0.0; SIZE]; 3],
            ends: [-1.0; SIZE],
            start: [f32::NAN; SIZE],
            traced,
            first,
        };
        match <&[Ray; SIZE]>::try_from(rays) {
            Ok(rays) if traced == ALL => {
                for (lane, ray) in rays.iter().enumerate() {
                    rows.set(lane, ray);
                }
                rows.ends = *ends;
            }
            _ => {
                for lane in 0..SIZE {
                    let is_traced = traced & 1 << lane != 0;
                    rows.set(lane, &rays[if is_traced { lane } else { first_lane }]);
                    rows.ends[lane] = if is_traced { ends[lane] } else { -1.0 };
                }
            }
        }
        Some(rows)
    }
}
