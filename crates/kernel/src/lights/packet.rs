//! Samples one light for a packet of points.

use super::sample::{GeometryOfLight, LightSample, ShadowRayEnd};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, mask_from_bits, select, select_u32, set_lane};

/// Samples of a light for a packet of points: [`LightSample`]s in structure-of-arrays layout.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct LightSamplePacket {
    /// Unit directions to the light.
    pub directions: Vec3x16,
    /// Sampled points.
    pub targets: Vec3x16,
    /// [`LightSample::weight`], or 0 for black samples.
    pub weights: Vec3x16,
    /// Geometry that the shadow rays ignore.
    pub sources: GeometryOfLightPacket,
    /// Mask of samples at infinity.
    pub beyond: u32,
    /// Inverse pdfs in sr, set only for environments. For other lights, they are computed on request.
    pub(super) environment_inverse_pdfs: F32x16,
}

/// A packet of [`GeometryOfLight`]s.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct GeometryOfLightPacket {
    /// Object index, or [`GeometryOfLightPacket::NONE`] if there is no geometry.
    pub object: [u32; PACKET_SIZE],
    /// Primitive index, or [`GeometryOfLightPacket::NONE`] for the entire object.
    pub part: [u32; PACKET_SIZE],
    /// Whether any lane has an object.
    pub is_any: bool,
}

impl GeometryOfLightPacket {
    /// Marks a lane that has no object, or a lane that refers to an entire object.
    pub const NONE: u32 = u32::MAX;

    /// Marks a [`GeometryOfLight::SeeThrough`] lane. No primitive has this index.
    const SEE_THROUGH: u32 = u32::MAX - 1;

    /// A packet with the same source in all lanes.
    #[inline(always)]
    pub fn splat(source: GeometryOfLight) -> Self {
        let (object, part) = object_and_part_codes(source);
        Self { object: [object; PACKET_SIZE], part: [part; PACKET_SIZE], is_any: object != Self::NONE }
    }

    /// Copies a lane from another packet.
    #[inline(always)]
    pub fn copy_lane(&mut self, lane: usize, other: &Self, from: usize) {
        (self.object[lane], self.part[lane]) = (other.object[from], other.part[from]);
        self.is_any |= other.is_any;
    }

    /// Returns a lane's light source geometry.
    #[inline]
    pub fn geometry(&self, lane: usize) -> GeometryOfLight {
        match (self.object[lane], self.part[lane]) {
            (Self::NONE, _) => GeometryOfLight::Nothing,
            (object, Self::NONE) => GeometryOfLight::Object(object),
            (object, Self::SEE_THROUGH) => GeometryOfLight::SeeThrough(object),
            (object, part) => GeometryOfLight::Primitive(object, part),
        }
    }

    /// Sets a lane's light source geometry.
    #[inline(always)]
    pub fn set_geometry(&mut self, lane: usize, source: GeometryOfLight) {
        (self.object[lane], self.part[lane]) = object_and_part_codes(source);
        self.is_any |= self.object[lane] != Self::NONE;
    }
}

#[inline(always)]
fn object_and_part_codes(source: GeometryOfLight) -> (u32, u32) {
    match source {
        GeometryOfLight::Nothing => (GeometryOfLightPacket::NONE, GeometryOfLightPacket::NONE),
        GeometryOfLight::Object(object) => (object, GeometryOfLightPacket::NONE),
        GeometryOfLight::SeeThrough(object) => (object, GeometryOfLightPacket::SEE_THROUGH),
        GeometryOfLight::Primitive(object, part) => (object, part),
    }
}

/// Builds a packet from the direction, target, and weight of each lane. This is a macro because a function
/// with a closure is not always inlined, in which case it would not be compiled with the caller's instruction
/// set.
macro_rules! packet_of {
    ($source:expr, $i:ident => $sample:expr) => {{
        let mut row = $crate::lights::packet::LightSamplePacket::black($source);
        for $i in 0..$crate::math::lanes::PACKET_SIZE {
            let (direction, target, weight) = $sample;
            $crate::math::lanes::set_lane(&mut row.directions, $i, direction);
            $crate::math::lanes::set_lane(&mut row.targets, $i, target);
            $crate::math::lanes::set_lane(&mut row.weights, $i, weight);
        }
        row
    }};
}

pub(super) use packet_of;

/// [`packet_of`] for lights at infinity.
macro_rules! infinite_packet_of {
    ($i:ident => $sample:expr) => {{
        let row = $crate::lights::packet::packet_of!($crate::lights::sample::GeometryOfLight::Nothing, $i => {
            let (direction, weight) = $sample;
            (direction, $crate::math::Vec3::ZERO, weight)
        });
        $crate::lights::packet::LightSamplePacket { beyond: u32::MAX, ..row }
    }};
}

pub(super) use infinite_packet_of;

impl LightSamplePacket {
    /// Copies the lanes in the mask `bits` from another packet.
    #[inline(always)]
    pub(super) fn copy_lanes(&mut self, bits: u32, other: &Self) {
        let of = mask_from_bits(bits);
        for axis in 0..3 {
            select(&of, &other.directions[axis], &mut self.directions[axis]);
            select(&of, &other.targets[axis], &mut self.targets[axis]);
            select(&of, &other.weights[axis], &mut self.weights[axis]);
        }
        select_u32(&of, &other.sources.object, &mut self.sources.object);
        select_u32(&of, &other.sources.part, &mut self.sources.part);
        self.sources.is_any |= other.sources.is_any;
        self.beyond = self.beyond & !bits | other.beyond & bits;
    }

    #[inline(always)]
    pub(super) fn black(source: GeometryOfLight) -> Self {
        Self {
            directions: [[0.0; PACKET_SIZE]; 3],
            targets: [[0.0; PACKET_SIZE]; 3],
            weights: [[0.0; PACKET_SIZE]; 3],
            sources: GeometryOfLightPacket::splat(source),
            beyond: 0,
            environment_inverse_pdfs: [0.0; PACKET_SIZE],
        }
    }

    fn set_sample(&mut self, i: usize, sample: &LightSample) {
        set_lane(&mut self.directions, i, sample.direction);
        set_lane(&mut self.weights, i, sample.weight);
        self.sources.set_geometry(i, sample.source);
        match sample.end {
            ShadowRayEnd::At(target) => set_lane(&mut self.targets, i, target),
            ShadowRayEnd::Beyond => self.beyond |= 1 << i,
        }
    }

    /// Samples the points in the mask `used` one by one.
    pub(super) fn sample_one_by_one(
        points: &Vec3x16,
        used: u32,
        sample: impl Fn(usize, Vec3) -> Option<LightSample>,
    ) -> Self {
        let mut row = Self::black(GeometryOfLight::Nothing);
        for i in (0..PACKET_SIZE).filter(|i| used & 1 << i != 0) {
            if let Some(sample) = sample(i, lane(points, i)) {
                row.set_sample(i, &sample);
            }
        }
        row
    }
}
