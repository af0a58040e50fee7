//! Samples of one light for a row of points.

use super::emitter::{Arrival, Emitter};
use super::{End, Light, LightSample, Source};
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};

/// Ways for the light of one lamp to arrive at some points: [`LightSample`]s side by side.
#[derive(Clone, Debug)]
pub struct LightRow {
    /// Unit directions to where it comes from.
    pub directions: Lanes3,
    /// Where that is.
    pub targets: Lanes3,
    /// [`LightSample::weight`]; 0 where nothing arrives.
    pub weights: Lanes3,
    /// What the shadow rays need not hit.
    pub sources: SourceRow,
    /// A bit for each whose light comes from beyond everything.
    pub beyond: u32,
}

/// [`Source`]s side by side.
#[derive(Clone, Debug)]
pub struct SourceRow {
    /// The object; [`SourceRow::NONE`] for nothing.
    pub object: [u32; LANES],
    /// The primitive; [`SourceRow::NONE`] for all of the object.
    pub part: [u32; LANES],
}

impl SourceRow {
    /// No object, or no part of one.
    pub const NONE: u32 = u32::MAX;

    /// The same for all.
    #[inline(always)]
    pub fn of(source: Source) -> Self {
        let (object, part) = numbers(source);
        Self { object: [object; LANES], part: [part; LANES] }
    }

    /// Of one of them.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, source: Source) {
        (self.object[lane], self.part[lane]) = numbers(source);
    }
}

#[inline(always)]
fn numbers(source: Source) -> (u32, u32) {
    match source {
        Source::Nothing => (SourceRow::NONE, SourceRow::NONE),
        Source::Object(object) => (object, SourceRow::NONE),
        Source::Primitive(object, part) => (object, part),
    }
}

impl LightRow {
    #[inline(always)]
    fn dark(source: Source) -> Self {
        Self {
            directions: [[0.0; LANES]; 3],
            targets: [[0.0; LANES]; 3],
            weights: [[0.0; LANES]; 3],
            sources: SourceRow::of(source),
            beyond: 0,
        }
    }

    /// Of directions, targets and weights; all lanes at once.
    #[inline(always)]
    fn of(source: Source, sample: impl Fn(usize) -> (Vec3, Vec3, Vec3)) -> Self {
        let mut row = Self::dark(source);
        for i in 0..LANES {
            let (direction, target, weight) = sample(i);
            set_lane(&mut row.directions, i, direction);
            set_lane(&mut row.targets, i, target);
            set_lane(&mut row.weights, i, weight);
        }
        row
    }

    /// Of directions and weights of light from beyond everything.
    #[inline(always)]
    fn beyond(sample: impl Fn(usize) -> (Vec3, Vec3)) -> Self {
        let row = Self::of(Source::Nothing, |i| {
            let (direction, weight) = sample(i);
            (direction, Vec3::ZERO, weight)
        });
        Self { beyond: u32::MAX, ..row }
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

    /// From the samples of the points whose bits are set.
    fn one_by_one(points: &Lanes3, used: u32, sample: impl Fn(usize, Vec3) -> Option<LightSample>) -> Self {
        let mut row = Self::dark(Source::Nothing);
        for i in (0..LANES).filter(|i| used & 1 << i != 0) {
            if let Some(sample) = sample(i, lane(points, i)) {
                row.put(i, &sample);
            }
        }
        row
    }
}

impl Light {
    /// [`Light::sample`] for the points whose bits are set, each by numbers of its own.
    #[inline(always)]
    pub fn sample_row(&self, points: &Lanes3, normals: &Lanes3, used: u32, u: &[Lanes; 2]) -> LightRow {
        let numbers = |i: usize| [u[0][i], u[1][i]];
        let light = match self {
            Self::Point(light) => {
                let target = light.position.as_vec3();
                return LightRow::of(Source::Nothing, |i| {
                    let (direction, weight) = light.arriving(lane(points, i));
                    (direction, target, weight)
                });
            }
            Self::Spot(light) => {
                let target = light.point.position.as_vec3();
                return LightRow::of(Source::Nothing, |i| {
                    let (direction, weight) = light.arriving(lane(points, i));
                    (direction, target, weight)
                });
            }
            Self::Directional(light) => return LightRow::beyond(|i| light.arriving(numbers(i))),
            Self::Environment(light) => {
                return LightRow::beyond(|i| light.arriving_at(lane(normals, i), numbers(i)));
            }
            Self::Area(light) => light,
        };
        let shining = |sample: Arrival| (sample.direction, sample.target, light.radiance * sample.factor);
        let source = Source::Object(light.object);
        match &light.shape {
            Emitter::Quad(quad) => {
                LightRow::of(source, |i| shining(quad.sample(lane(points, i), numbers(i))))
            }
            Emitter::Sphere(sphere) => {
                LightRow::of(source, |i| shining(sphere.sample(lane(points, i), numbers(i))))
            }
            Emitter::Disk(disk) => {
                LightRow::of(source, |i| shining(disk.sample(lane(points, i), numbers(i))))
            }
            Emitter::Box(cuboid) => {
                LightRow::of(source, |i| shining(cuboid.sample(lane(points, i), numbers(i))))
            }
            Emitter::Triangle(_)
            | Emitter::Cylinder(_)
            | Emitter::Cone(_)
            | Emitter::Torus(_)
            | Emitter::Mesh(_) => {
                LightRow::one_by_one(points, used, |i, point| light.sample(point, numbers(i)))
            }
        }
    }
}

impl Light {
    /// One over the densities in sr⁻¹ of samples of this light; 0 of a light without extent, which has no other way to be found,
    /// and where nothing arrives.
    #[inline(always)]
    pub fn inverse_densities(&self, samples: &LightRow) -> Lanes {
        let mut inverse = [0.0; LANES];
        match self {
            Self::Point(_) | Self::Spot(_) => {}
            Self::Directional(light) => inverse = [light.inverse_density(); LANES],
            Self::Environment(light) => {
                for i in 0..LANES {
                    inverse[i] = light.inverse_density(lane(&samples.directions, i));
                }
            }
            Self::Area(light) => {
                let of_radiance = 1.0 / light.radiance.max_element();
                for i in 0..LANES {
                    inverse[i] = lane(&samples.weights, i).max_element() * of_radiance;
                }
            }
        }
        inverse
    }
}
