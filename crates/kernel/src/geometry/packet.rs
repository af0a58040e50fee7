//! Packets of 16 rays in structure-of-arrays layout. Shapes test them in branchless loops that compilers
//! vectorize. Every lane's result is bit-identical to the scalar test of its ray.

use super::{Ray, RayF64, ShapeHit};
pub use crate::math::lanes::{F32x16, PACKET_SIZE};
use crate::math::lanes::{Simd, TRUE};
use crate::math::{DVec3, Vec3};

/// Mask of the lanes with a nonnegative end.
#[inline(always)]
pub fn nonnegative_end_mask(ends: &F32x16, simd: impl Simd) -> u32 {
    let mut traced = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        traced[lane] = if ends[lane] >= 0.0 { TRUE } else { 0 };
    }
    simd.movemask(&traced)
}

/// Lane indices of a mask's set bits.
pub fn set_bit_lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            lane
        })
    })
}

/// A packet of rays in structure-of-arrays layout. Lanes without a ray are 0.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct RayPacket {
    /// Ray origins, stored as one array per axis.
    pub origin: [F32x16; 3],
    /// Ray directions, stored as one array per axis.
    pub direction: [F32x16; 3],
    /// [`Ray::start`] of each ray.
    pub start: [u32; PACKET_SIZE],
}

impl RayPacket {
    /// Creates a packet of rays that do not start on triangles.
    #[inline(always)]
    pub fn from_soa(origin: [F32x16; 3], direction: [F32x16; 3]) -> Self {
        Self { origin, direction, start: [Ray::NO_TRIANGLE; PACKET_SIZE] }
    }

    /// Sets the rays' start triangles.
    #[inline(always)]
    pub fn with_start_triangles(self, start: [u32; PACKET_SIZE]) -> Self {
        Self { start, ..self }
    }

    /// Returns the ray in a lane, with an infinite end.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> Ray {
        let of = |rows: &[F32x16; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        Ray::new(of(&self.origin), of(&self.direction)).with_start_triangle(self.start[lane])
    }

    /// Packs up to [`PACKET_SIZE`] rays and their ends.
    #[inline(always)]
    pub fn new(rays: &[Ray]) -> (Self, F32x16) {
        let mut rows = Self::from_soa([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
        let mut ends = [-1.0; PACKET_SIZE];
        // Compile full packets separately because a constant length makes their loop faster.
        match <&[Ray; PACKET_SIZE]>::try_from(rays) {
            Ok(full) => rows.fill_from_rays(&mut ends, full),
            Err(_) => rows.fill_from_rays(&mut ends, rays),
        }
        (rows, ends)
    }

    #[inline(always)]
    fn fill_from_rays(&mut self, ends: &mut F32x16, rays: &[Ray]) {
        for (lane, ray) in rays.iter().enumerate().take(PACKET_SIZE) {
            for axis in 0..3 {
                self.origin[axis][lane] = ray.origin[axis];
                self.direction[axis][lane] = ray.direction[axis];
            }
            ends[lane] = ray.t_max;
            self.start[lane] = ray.start;
        }
    }

    /// Returns the ray in a lane in double precision, with an infinite end.
    #[inline(always)]
    pub(super) fn ray_f64(&self, lane: usize) -> RayF64 {
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.direction;
        RayF64 {
            origin: DVec3::new(f64::from(ox[lane]), f64::from(oy[lane]), f64::from(oz[lane])),
            direction: DVec3::new(f64::from(dx[lane]), f64::from(dy[lane]), f64::from(dz[lane])),
            t_max: f64::INFINITY,
        }
    }
}

/// Hits for a packet of rays: [`ShapeHit`]s in structure-of-arrays layout.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct HitPacket {
    /// [`ShapeHit::t`], or NaN for a ray without a hit.
    pub t: F32x16,
    /// [`ShapeHit::primitive`].
    pub primitive: [u32; PACKET_SIZE],
    /// [`ShapeHit::u`].
    pub u: F32x16,
    /// [`ShapeHit::v`].
    pub v: F32x16,
}

impl HitPacket {
    /// A packet without hits.
    #[inline(always)]
    pub fn without_hits() -> Self {
        Self {
            t: [f32::NAN; PACKET_SIZE],
            primitive: [0; PACKET_SIZE],
            u: [0.0; PACKET_SIZE],
            v: [0.0; PACKET_SIZE],
        }
    }

    /// Mask of the rays with a hit.
    #[inline(always)]
    pub fn hit_mask(&self, simd: impl Simd) -> u32 {
        let mut any = [0; PACKET_SIZE];
        for lane in 0..PACKET_SIZE {
            any[lane] = if self.t[lane].is_nan() { 0 } else { TRUE };
        }
        simd.movemask(&any)
    }

    /// Stores a hit.
    pub fn set(&mut self, lane: usize, hit: &ShapeHit) {
        self.t[lane] = hit.t;
        self.primitive[lane] = hit.primitive;
        (self.u[lane], self.v[lane]) = (hit.u, hit.v);
    }

    /// Returns the hit for the ray in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Option<ShapeHit> {
        let hit =
            ShapeHit { t: self.t[lane], primitive: self.primitive[lane], u: self.u[lane], v: self.v[lane] };
        (!hit.t.is_nan()).then_some(hit)
    }
}

/// Branchless version of [`RayF64::round_t_if_in_range`] that returns NaN for `None`.
#[inline(always)]
pub(super) fn round_t_to_f32_or_nan(t: f64, end: f32) -> f32 {
    let single = t as f32;
    let is_on_it = (single > 0.0) & (single < f32::INFINITY) & (single <= end);
    if is_on_it { single } else { f32::NAN }
}

/// Whether [`round_t_to_f32_or_nan`] may accept the quotient `above / along`. If not, the division can be
/// skipped. The factor is larger than the relative error of rounding the quotient to `f32`. The added
/// constants handle numbers that are too small for the factor.
#[inline(always)]
pub(super) fn can_quotient_be_in_range(above: f64, along: f64, end: f32) -> bool {
    let is_ahead = ((above > 0.0) & (along > 0.0)) | ((above < 0.0) & (along < 0.0));
    let reach = along.abs() * ((f64::from(end) + f64::from(f32::MIN_POSITIVE)) * (1.0 + 1e-6)) + 1e-290;
    // `<=` would be wrong here because an infinite end times 0 is NaN.
    let is_beyond = above.abs() > reach;
    is_ahead & !is_beyond
}
