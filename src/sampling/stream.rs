//! Owen-scrambled Sobol points, padded: every decision of a path draws from a sequence of its own, scrambled anew
//! (Burley, *Practical Hash-based Owen Scrambling*, JCGT 2020).

use crate::math::Vec2;

/// Length of the library's sequences.
const SEQUENCE_LENGTH: u32 = 1 << 16;

/// What random numbers are for: numbers of different purposes are independent, those of one purpose well
/// distributed over the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purpose(u32);

impl Purpose {
    /// Position in the pixel and on the lens.
    pub const CAMERA: Self = Self(0);

    /// Something that happens at a vertex of a path: `path` tells the paths of one sample apart, `what` the
    /// decisions at one vertex.
    pub fn at_vertex(path: u32, what: u32) -> Self {
        Self(mix(mix(path.wrapping_add(1)) ^ what.wrapping_mul(0x9e37_79b9)))
    }
}

/// The random numbers of one sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSampler {
    seed: u32,
    sample: u32,
}

impl PixelSampler {
    /// For sample number `sample` of pixel (x, y) of the whole picture.
    pub fn new(seed: u32, x: u32, y: u32, sample: u32) -> Self {
        Self { seed: mix(mix(mix(seed) ^ x) ^ y.rotate_left(16)), sample }
    }

    /// Four numbers in [0, 1).
    pub fn get4(&self, purpose: Purpose) -> [f32; 4] {
        self.get4_of(purpose, 0, 1)
    }

    /// Four numbers for the `i`-th of `n` repetitions of one decision, well distributed over repetitions and samples together.
    pub fn get4_of(&self, purpose: Purpose, i: u32, n: u32) -> [f32; 4] {
        let index = u64::from(self.sample) * u64::from(n) + u64::from(i);
        let (round, place) =
            (index / u64::from(SEQUENCE_LENGTH), (index % u64::from(SEQUENCE_LENGTH)) as u32);
        sobol_burley::sample_4d(place, 0, mix(self.seed ^ purpose.0) ^ mix(round as u32))
    }

    /// Two numbers in [0, 1).
    pub fn get2(&self, purpose: Purpose) -> Vec2 {
        let [x, y, ..] = self.get4(purpose);
        Vec2::new(x, y)
    }
}

/// A bijective hash of 32 bits (Wellons, *Prospecting for Hash Functions*, 2018, "lowbias32").
fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_are_stratified_and_pixels_differ() {
        for n in [1_u32, 16] {
            let mut cells = [0_u32; 64];
            for sample in 0..64 / n {
                for i in 0..n {
                    let [x, y, ..] =
                        PixelSampler::new(3, 10, 20, sample).get4_of(Purpose::at_vertex(1, 2), i, n);
                    cells[(x * 8.0) as usize * 8 + (y * 8.0) as usize] += 1;
                }
            }
            assert_eq!(cells, [1; 64]);
        }
        let first = |x| PixelSampler::new(3, x, 20, 0).get2(Purpose::CAMERA);
        assert_ne!(first(10), first(11));
    }

    #[test]
    fn the_sequence_goes_on_after_its_library_s_end() {
        let numbers = |sample| PixelSampler::new(0, 0, 0, sample).get4(Purpose::CAMERA);
        assert_ne!(numbers(0), numbers(SEQUENCE_LENGTH));
        assert!(numbers(u32::MAX).iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn purposes_are_independent() {
        // Correlation of first coordinates over one pixel's samples: a shared scramble would give 1.
        let (mut product, n) = (0.0, 4096);
        for sample in 0..n {
            let sampler = PixelSampler::new(1, 5, 5, sample);
            let (a, b) = (sampler.get2(Purpose::at_vertex(0, 0)).x, sampler.get2(Purpose::at_vertex(0, 1)).x);
            product += (f64::from(a) - 0.5) * (f64::from(b) - 0.5) * 12.0;
        }
        assert!((product / f64::from(n)).abs() < 0.05);
    }
}
