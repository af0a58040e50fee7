//! Samples of one light for a row of points.

use super::sample::{End, LightSample, Source};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, mask_from_bits, select, select_u32, set_lane};

/// Samples of the light of one lamp at some points: [`LightSample`]s side by side.
#[derive(Clone, Debug)]
pub struct LightRow {
    /// Unit directions to the light.
    pub directions: Vec3x16,
    /// Sampled points.
    pub targets: Vec3x16,
    /// [`LightSample::weight`]; 0 if nothing arrives.
    pub weights: Vec3x16,
    /// Objects that the shadow rays ignore.
    pub sources: SourceRow,
    /// A bit for each sample whose light comes from beyond everything.
    pub beyond: u32,
    /// Inverse pdfs in sr, for an environment alone; those of other lights are computed on request.
    pub(super) of_sky: F32x16,
}

/// [`Source`]s side by side.
#[derive(Clone, Debug)]
pub struct SourceRow {
    /// The object; [`SourceRow::NONE`] for nothing.
    pub object: [u32; PACKET_SIZE],
    /// The primitive; [`SourceRow::NONE`] for all of the object.
    pub part: [u32; PACKET_SIZE],
    /// Whether any of them is an object.
    pub is_any: bool,
}

impl SourceRow {
    /// Number in place of an object, or of a part of one.
    pub const NONE: u32 = u32::MAX;

    /// Number in place of a part, for [`Source::Sheer`]: no primitive has it.
    const SHEER: u32 = u32::MAX - 1;

    /// The same source in all lanes.
    #[inline(always)]
    pub fn of(source: Source) -> Self {
        let (object, part) = numbers(source);
        Self { object: [object; PACKET_SIZE], part: [part; PACKET_SIZE], is_any: object != Self::NONE }
    }

    /// Takes a lane of another row.
    #[inline(always)]
    pub fn copy(&mut self, lane: usize, other: &Self, from: usize) {
        (self.object[lane], self.part[lane]) = (other.object[from], other.part[from]);
        self.is_any |= other.is_any;
    }

    /// The source of a lane.
    #[inline]
    pub fn source(&self, lane: usize) -> Source {
        match (self.object[lane], self.part[lane]) {
            (Self::NONE, _) => Source::Nothing,
            (object, Self::NONE) => Source::Object(object),
            (object, Self::SHEER) => Source::Sheer(object),
            (object, part) => Source::Primitive(object, part),
        }
    }

    /// Sets the source of a lane.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, source: Source) {
        (self.object[lane], self.part[lane]) = numbers(source);
        self.is_any |= self.object[lane] != Self::NONE;
    }
}

#[inline(always)]
fn numbers(source: Source) -> (u32, u32) {
    match source {
        Source::Nothing => (SourceRow::NONE, SourceRow::NONE),
        Source::Object(object) => (object, SourceRow::NONE),
        Source::Sheer(object) => (object, SourceRow::SHEER),
        Source::Primitive(object, part) => (object, part),
    }
}

/// Makes a row from the directions, targets and weights of each lane, all lanes at once. It is no function: one with a closure
/// would not always be compiled as part of its caller, with the caller's instructions.
macro_rules! row_of {
    ($source:expr, $i:ident => $sample:expr) => {{
        let mut row = $crate::lights::row::LightRow::dark($source);
        for $i in 0..$crate::math::lanes::PACKET_SIZE {
            let (direction, target, weight) = $sample;
            $crate::math::lanes::set_lane(&mut row.directions, $i, direction);
            $crate::math::lanes::set_lane(&mut row.targets, $i, target);
            $crate::math::lanes::set_lane(&mut row.weights, $i, weight);
        }
        row
    }};
}

pub(super) use row_of;

/// [`row_of`] for directions and weights of light from beyond everything.
macro_rules! row_beyond {
    ($i:ident => $sample:expr) => {{
        let row = $crate::lights::row::row_of!($crate::lights::sample::Source::Nothing, $i => {
            let (direction, weight) = $sample;
            (direction, $crate::math::Vec3::ZERO, weight)
        });
        $crate::lights::row::LightRow { beyond: u32::MAX, ..row }
    }};
}

pub(super) use row_beyond;

impl LightRow {
    /// Takes the samples of another row in the lanes whose bits are set.
    #[inline(always)]
    pub(super) fn take_lanes(&mut self, bits: u32, other: &Self) {
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
    pub(super) fn dark(source: Source) -> Self {
        Self {
            directions: [[0.0; PACKET_SIZE]; 3],
            targets: [[0.0; PACKET_SIZE]; 3],
            weights: [[0.0; PACKET_SIZE]; 3],
            sources: SourceRow::of(source),
            beyond: 0,
            of_sky: [0.0; PACKET_SIZE],
        }
    }

    fn put(&mut self, i: usize, sample: &LightSample) {
        set_lane(&mut self.directions, i, sample.direction);
        set_lane(&mut self.weights, i, sample.weight);
        self.sources.set(i, sample.source);
        match sample.end {
            End::At(target) => set_lane(&mut self.targets, i, target),
            End::Beyond => self.beyond |= 1 << i,
        }
    }

    /// A row from the samples of the points whose bits are set.
    pub(super) fn one_by_one(
        points: &Vec3x16,
        used: u32,
        sample: impl Fn(usize, Vec3) -> Option<LightSample>,
    ) -> Self {
        let mut row = Self::dark(Source::Nothing);
        for i in (0..PACKET_SIZE).filter(|i| used & 1 << i != 0) {
            if let Some(sample) = sample(i, lane(points, i)) {
                row.put(i, &sample);
            }
        }
        row
    }
}
