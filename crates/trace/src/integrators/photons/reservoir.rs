//! Chooses one photon in a kernel, with a probability proportional to its contribution. The whole kernel is
//! treated as occluded if this photon is occluded, which yields the correct expected value.

use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE};

/// Largest number below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// Position and normal of a photon.
#[derive(Clone, Copy, Debug)]
pub struct PhotonPositionAndNormal {
    /// Position of the photon.
    pub point: Vec3,
    /// Unit geometric normal on the side of the surface that the photon hit.
    pub normal: Vec3,
}

/// Reservoir sampling in each lane: chooses among a stream of items in proportion to weights whose sum is not
/// known in advance (Chao, *A General Purpose Unequal Probability Sampling Plan*, 1982). A single random
/// number is enough for all choices because it can be rescaled after each choice.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct ReservoirPacket {
    random: F32x16,
    totals: F32x16,
    chosen: [u32; PACKET_SIZE],
}

impl ReservoirPacket {
    /// Creates reservoirs from a random number in [0, 1).
    #[inline(always)]
    pub fn new(random: f32) -> Self {
        let mut randoms = [0.0; PACKET_SIZE];
        for (i, own) in randoms.iter_mut().enumerate() {
            let turned = random + i as f32 * (1.0 / PACKET_SIZE as f32);
            *own = if turned < 1.0 { turned } else { turned - 1.0 };
        }
        Self { random: randoms, totals: [0.0; PACKET_SIZE], chosen: [0; PACKET_SIZE] }
    }

    /// Adds item `number` with nonnegative weights to the stream.
    #[inline(always)]
    pub fn add_item(&mut self, number: u32, weights: &F32x16) {
        for i in 0..PACKET_SIZE {
            self.totals[i] += weights[i];
            let part = if weights[i] > 0.0 { weights[i] / self.totals[i] } else { 0.0 };
            let is_chosen = self.random[i] < part;
            let left = if is_chosen { self.random[i] } else { self.random[i] - part };
            let of = if is_chosen { part } else { 1.0 - part };
            let random = left / of;
            // If `of` is close to 1, the rescaled number may round to 1.
            self.random[i] = if random < BELOW_ONE { random } else { BELOW_ONE };
            self.chosen[i] = if is_chosen { number } else { self.chosen[i] };
        }
    }

    /// Chooses a lane in proportion to its total weight and returns the lane's item and index, or `None` if
    /// all weights are 0.
    #[inline(always)]
    pub fn choose_one_lane_by_weight(&self, random: f32) -> Option<(u32, usize)> {
        let mut left = random * self.totals.iter().sum::<f32>();
        let mut last = None;
        for i in 0..PACKET_SIZE {
            if self.totals[i] > 0.0 {
                last = Some((self.chosen[i], i));
                if left < self.totals[i] {
                    break;
                }
            }
            left -= self.totals[i];
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit_generator;

    #[test]
    fn items_are_chosen_in_proportion_to_weight() {
        const ITEMS: usize = 5;
        let mut next = unit_generator(5);
        let mut weights = [[0.0; PACKET_SIZE]; ITEMS];
        weights.as_flattened_mut().iter_mut().for_each(|weight| *weight = (next() * 3.0 - 1.0).max(0.0));
        weights[1][3] = 9.0;
        let total: f32 = weights.as_flattened().iter().sum();
        let mut counts = [[0_u32; PACKET_SIZE]; ITEMS];
        const DRAWS: u32 = 400_000;
        for _ in 0..DRAWS {
            let mut choices = ReservoirPacket::new(next());
            (0..ITEMS).for_each(|number| choices.add_item(number as u32, &weights[number]));
            let (number, lane) =
                choices.choose_one_lane_by_weight(next()).expect("some weights should be positive");
            counts[number as usize][lane] += 1;
        }
        for (weight, count) in weights.as_flattened().iter().zip(counts.as_flattened()) {
            let expected = f64::from(weight / total) * f64::from(DRAWS);
            let difference = (f64::from(*count) - expected).abs();
            assert!(difference <= 5.0 * expected.sqrt(), "got {count}, expected {expected}");
        }
        assert_eq!(ReservoirPacket::new(0.3).choose_one_lane_by_weight(0.5), None);
    }
}
