//! Up to sixteen rays side by side, a row for each coordinate. A shape tests them in a loop without branches, which
//! compilers turn into vector instructions. Every lane gets the bits that its ray gets alone.

use super::{Ray, RayF64, ShapeHit};
use crate::math::lanes::{Folds, LANES, TRUE};
use crate::math::{DVec3, Vec3};

/// Rays that are traced together.
pub const PACKET: usize = LANES;

/// One number for each ray of a packet.
pub type Row = [f32; PACKET];

/// End of each ray of a packet, in place of its own `t_max`; below 0 for a lane without a ray, or whose ray is not
/// traced.
pub type Ends = Row;

/// A bit for each ray that has an end.
#[inline(always)]
pub fn traced(ends: &Ends, folds: impl Folds) -> u32 {
    let mut traced = [0; PACKET];
    for lane in 0..PACKET {
        traced[lane] = if ends[lane] >= 0.0 { TRUE } else { 0 };
    }
    folds.bits(&traced)
}

/// Lanes whose bits are set.
pub fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            lane
        })
    })
}

/// The rays of a packet; lanes without a ray are all 0, and have no end.
#[derive(Clone, Debug)]
pub struct RayRows {
    /// Coordinates of the origins.
    pub origin: [Row; 3],
    /// Coordinates of the directions.
    pub direction: [Row; 3],
    /// [`Ray::start`] of each ray.
    pub start: [u32; PACKET],
}

impl RayRows {
    /// Rows of these coordinates, of rays that start on no triangle.
    #[inline(always)]
    pub fn of(origin: [Row; 3], direction: [Row; 3]) -> Self {
        Self { origin, direction, start: [Ray::NO_TRIANGLE; PACKET] }
    }

    /// The rays, with the triangles on which they start.
    #[inline(always)]
    pub fn leaving(self, start: [u32; PACKET]) -> Self {
        Self { start, ..self }
    }

    /// The ray in a lane, without an end.
    #[inline(always)]
    pub fn ray(&self, lane: usize) -> Ray {
        let of = |rows: &[Row; 3]| Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane]);
        Ray::new(of(&self.origin), of(&self.direction)).leaving(self.start[lane])
    }

    /// Rows of at most [`PACKET`] rays, and their ends.
    #[inline(always)]
    pub fn new(rays: &[Ray]) -> (Self, Ends) {
        let mut rows = Self::of([[0.0; PACKET]; 3], [[0.0; PACKET]; 3]);
        let mut ends = [-1.0; PACKET];
        // Compile full packets apart: their loop has a known length.
        match <&[Ray; PACKET]>::try_from(rays) {
            Ok(full) => rows.fill(&mut ends, full),
            Err(_) => rows.fill(&mut ends, rays),
        }
        (rows, ends)
    }

    #[inline(always)]
    fn fill(&mut self, ends: &mut Ends, rays: &[Ray]) {
        for (lane, ray) in rays.iter().enumerate().take(PACKET) {
            for axis in 0..3 {
                self.origin[axis][lane] = ray.origin[axis];
                self.direction[axis][lane] = ray.direction[axis];
            }
            ends[lane] = ray.t_max;
            self.start[lane] = ray.start;
        }
    }

    /// The ray in a lane in double precision, without an end.
    #[inline(always)]
    pub(super) fn line(&self, lane: usize) -> RayF64 {
        let [ox, oy, oz] = &self.origin;
        let [dx, dy, dz] = &self.direction;
        RayF64 {
            origin: DVec3::new(f64::from(ox[lane]), f64::from(oy[lane]), f64::from(oz[lane])),
            direction: DVec3::new(f64::from(dx[lane]), f64::from(dy[lane]), f64::from(dz[lane])),
            t_max: f64::INFINITY,
        }
    }
}

/// Hits of the rays of a packet: [`ShapeHit`]s side by side.
#[derive(Clone, Debug)]
pub struct HitRows {
    /// [`ShapeHit::t`]; NaN for a ray without a hit.
    pub t: Row,
    /// [`ShapeHit::primitive`].
    pub primitive: [u32; PACKET],
    /// [`ShapeHit::u`].
    pub u: Row,
    /// [`ShapeHit::v`].
    pub v: Row,
}

impl HitRows {
    /// No hit.
    #[inline(always)]
    pub fn none() -> Self {
        Self { t: [f32::NAN; PACKET], primitive: [0; PACKET], u: [0.0; PACKET], v: [0.0; PACKET] }
    }

    /// A bit for each ray that hits.
    #[inline(always)]
    pub fn any(&self, folds: impl Folds) -> u32 {
        let mut any = [0; PACKET];
        for lane in 0..PACKET {
            any[lane] = if self.t[lane].is_nan() { 0 } else { TRUE };
        }
        folds.bits(&any)
    }

    /// Stores a hit.
    pub fn put(&mut self, lane: usize, hit: &ShapeHit) {
        self.t[lane] = hit.t;
        self.primitive[lane] = hit.primitive;
        (self.u[lane], self.v[lane]) = (hit.u, hit.v);
    }

    /// The hit of the ray in a lane.
    #[inline(always)]
    pub fn get(&self, lane: usize) -> Option<ShapeHit> {
        let hit =
            ShapeHit { t: self.t[lane], primitive: self.primitive[lane], u: self.u[lane], v: self.v[lane] };
        (!hit.t.is_nan()).then_some(hit)
    }
}

/// [`RayF64::accept`] without a branch; NaN in place of `None`.
#[inline(always)]
pub(super) fn accept(t: f64, end: f32) -> f32 {
    let single = t as f32;
    let is_on_it = (single > 0.0) & (single < f32::INFINITY) & (single <= end);
    if is_on_it { single } else { f32::NAN }
}

/// Whether [`accept`] may take the quotient of `above` and `along`; if not, the division can be saved. The factor is more
/// than the effect of rounding the quotient to `f32`; the terms make up for numbers too small for it.
#[inline(always)]
pub(super) fn may_accept(above: f64, along: f64, end: f32) -> bool {
    let is_ahead = ((above > 0.0) & (along > 0.0)) | ((above < 0.0) & (along < 0.0));
    let reach = along.abs() * ((f64::from(end) + f64::from(f32::MIN_POSITIVE)) * (1.0 + 1e-6)) + 1e-290;
    // Not `<=`: an infinite end times 0 is NaN.
    let is_beyond = above.abs() > reach;
    is_ahead & !is_beyond
}
