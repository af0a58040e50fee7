//! Owen-scrambled Sobol points, padded: every decision of a path draws from a sequence of its own, scrambled anew
//! (Burley, *Practical Hash-based Owen Scrambling*, JCGT 2020).

use crate::math::Vec2;
use crate::math::lanes::{LANES, Lanes};

/// Length of the library's sequences.
const SEQUENCE_LENGTH: u32 = 1 << 16;

/// A random decision at a vertex of a path. Numbers of different decisions are independent, those of one decision well
/// distributed over the samples of a pixel. There is no other way to a dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// Where on the light of this number.
    Light(u32),
    /// Which of two ways to go on.
    Choice,
}

impl Decision {
    /// Its dimension at a vertex; `path` tells the paths of one sample apart.
    fn dimension(self, path: u32) -> u32 {
        let number = match self {
            Self::Light(number) => number,
            Self::Choice => u32::MAX,
        };
        mix(mix(path.wrapping_add(1)) ^ number.wrapping_mul(0x9e37_79b9))
    }
}

/// The dimension of the position in the pixel and on the lens.
const CAMERA: u32 = 0;

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

    /// Four numbers in [0, 1): the position in the pixel and on the lens.
    pub fn camera(&self) -> [f32; 4] {
        self.numbers(CAMERA)
    }

    fn numbers(&self, dimension: u32) -> [f32; 4] {
        let (round, place) = (self.sample / SEQUENCE_LENGTH, self.sample % SEQUENCE_LENGTH);
        sobol_burley::sample_4d(place, 0, mix(self.seed ^ dimension) ^ mix(round))
    }

    /// Two numbers in [0, 1) for each of `n` repetitions of one decision, well distributed over repetitions and samples
    /// together.
    pub fn pairs(&self, path: u32, decision: Decision, n: u32) -> Repetitions {
        let (seed, first) =
            (mix(self.seed ^ decision.dimension(path)), u64::from(self.sample) * u64::from(n));
        Repetitions { seed, next: first, end: first + u64::from(n) }
    }

    /// Two numbers in [0, 1) for one decision.
    pub fn pair(&self, path: u32, decision: Decision) -> Vec2 {
        let [x, y, ..] = self.numbers(decision.dimension(path));
        Vec2::new(x, y)
    }
}

/// Numbers for the repetitions of one decision, some at a time.
#[derive(Clone, Copy, Debug)]
pub struct Repetitions {
    seed: u32,
    next: u64,
    end: u64,
}

impl Iterator for Repetitions {
    /// With how many of the lanes count.
    type Item = ([Lanes; 2], usize);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.next >= self.end {
            return None;
        }
        let used = (self.end - self.next).min(LANES as u64);
        let points = scrambled_from(self.next, self.seed);
        self.next += used;
        Some((points, used as usize))
    }
}

/// Points of the first two dimensions from number `first` on; every 2³² of them are scrambled anew.
#[inline(always)]
fn scrambled_from(first: u64, seed: u32) -> [Lanes; 2] {
    let [round, last_round] = [first, first + LANES as u64 - 1].map(|index| (index >> 32) as u32);
    let start = first as u32;
    let mut indices = [start; LANES];
    for (i, index) in indices.iter_mut().enumerate() {
        *index = index.wrapping_add(i as u32);
    }
    let points = scrambled(indices, seed ^ mix(round));
    if round == last_round {
        return points;
    }
    let anew = scrambled(indices, seed ^ mix(last_round));
    [0, 1].map(|of| std::array::from_fn(|i| if indices[i] < start { anew[of][i] } else { points[of][i] }))
}

/// Points of the first two dimensions of Sobol's sequence, their order and both coordinates scrambled.
#[inline(always)]
fn scrambled(indices: [u32; LANES], seed: u32) -> [Lanes; 2] {
    let (x_seed, y_seed) = (mix(seed ^ 0x68bc_21eb), mix(seed ^ 0x02e5_be93));
    // One step for all lanes after the other: so they become vector instructions.
    let mut places = indices;
    for place in &mut places {
        *place = owen(place.reverse_bits(), seed).reverse_bits();
    }
    let mut points = [[0.0; LANES]; 2];
    for (x, &place) in points[0].iter_mut().zip(&places) {
        *x = unit(owen(place, x_seed));
    }
    for (y, &place) in points[1].iter_mut().zip(&places) {
        *y = unit(owen(pascal(place), y_seed));
    }
    points
}

/// The upper 24 of reversed bits as a part of 1; so few that vectors convert them as signed numbers.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    (bits.reverse_bits() >> 8) as i32 as f32 * (1.0 / (1 << 24) as f32)
}

/// The second coordinate with its bits reversed: bit j is the sum of those bits k of the index for which C(k, j) is odd,
/// which are the k that have every bit of j. That of the first coordinate is the index itself.
#[inline(always)]
fn pascal(mut bits: u32) -> u32 {
    for (shift, lacking) in
        [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)]
    {
        bits ^= (bits >> shift) & lacking;
    }
    bits
}

/// Owen scrambling of reversed bits by a hash in which each depends on lower ones only (Laine and Karras, *Stratified
/// Sampling for Stochastic Transparency*, 2011; constants of Vegdahl, *Building a Better LK Hash*, 2021).
#[inline(always)]
fn owen(mut bits: u32, seed: u32) -> u32 {
    bits ^= bits.wrapping_mul(0x3d20_adea);
    bits = bits.wrapping_add(seed);
    bits = bits.wrapping_mul((seed >> 16) | 1);
    bits ^= bits.wrapping_mul(0x0552_6c56);
    bits ^ bits.wrapping_mul(0x53a2_2864)
}

/// A bijective hash of 32 bits (Wellons, *Prospecting for Hash Functions*, 2018, "lowbias32").
#[inline(always)]
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

    fn points(sampler: PixelSampler, decision: Decision, n: u32) -> impl Iterator<Item = [f32; 2]> {
        let some = |([x, y], used): ([Lanes; 2], usize)| (0..used).map(move |i| [x[i], y[i]]);
        sampler.pairs(1, decision, n).flat_map(some)
    }

    #[test]
    fn repetitions_are_one_sequence_also_where_it_is_scrambled_anew() {
        // Of three, five and one number, and over the end of 32 bits: the same points as one by one.
        for (sample, n) in [(0, 3), (7, 5), (9, 1), (u32::MAX / 3, 6), (u32::MAX / 2, 3)] {
            let sampler = PixelSampler::new(2, 3, 4, sample);
            let all: Vec<_> = points(sampler, Decision::Choice, n).collect();
            assert_eq!(all.len(), n as usize);
            let first = u64::from(sample) * u64::from(n);
            for (i, point) in all.iter().enumerate() {
                let index = first + i as u64;
                let seed = mix(sampler.seed ^ Decision::Choice.dimension(1)) ^ mix((index >> 32) as u32);
                let [x, y] = scrambled([index as u32; LANES], seed);
                assert_eq!([x[0], y[0]], *point, "number {i} of sample {sample}");
            }
        }
    }

    #[test]
    fn powers_of_two_are_stratified_and_pixels_differ() {
        // 64 points, one in each cell of every grid of 64: 64×1, 32×2, … 1×64.
        for n in [1_u32, 16] {
            let sampler = |sample| PixelSampler::new(3, 10, 20, sample);
            let all = (0..64 / n).flat_map(|sample| points(sampler(sample), Decision::Light(2), n));
            let points: Vec<[f32; 2]> = all.collect();
            for columns in [1_usize, 2, 4, 8, 16, 32, 64] {
                let mut cells = [0_u32; 64];
                for [x, y] in &points {
                    let (column, row) = (x * columns as f32, y * (64 / columns) as f32);
                    cells[column as usize + columns * row as usize] += 1;
                }
                assert_eq!(cells, [1; 64], "{columns} columns");
            }
        }
        let first = |x| PixelSampler::new(3, x, 20, 0).camera();
        assert_ne!(first(10), first(11));
    }

    #[test]
    fn the_second_dimension_is_sobol_s() {
        // Direction numbers v₀ = ½, vₖ = vₖ₋₁ ⊕ vₖ₋₁/2.
        for index in (0..5000).chain([u32::MAX, 0x8000_0001]) {
            let (mut sum, mut direction) = (0, 1_u32 << 31);
            for bit in 0..32 {
                sum ^= if index >> bit & 1 == 1 { direction } else { 0 };
                direction ^= direction >> 1;
            }
            assert_eq!(pascal(index).reverse_bits(), sum, "{index}");
        }
    }

    #[test]
    fn scrambles_of_many_pixels_are_uniform() {
        let (mut sums, mut product, n) = ([0.0; 2], 0.0, 40_000_u32);
        for pixel in 0..n {
            let sampler = PixelSampler::new(1, pixel % 200, pixel / 200, 7);
            for [x, y] in points(sampler, Decision::Light(0), 1).map(|point| point.map(f64::from)) {
                sums = [sums[0] + x, sums[1] + y];
                product += (x - 0.5) * (y - 0.5) * 12.0;
            }
        }
        let count = f64::from(n);
        // Five standard errors of 1/√(12n), and of 1/√n.
        assert!(sums.iter().all(|sum| (sum / count - 0.5).abs() < 5.0 / (12.0 * count).sqrt()), "{sums:?}");
        assert!((product / count).abs() < 5.0 / count.sqrt(), "{product}");
    }

    #[test]
    fn the_sequence_goes_on_after_its_library_s_end() {
        let numbers = |sample| PixelSampler::new(0, 0, 0, sample).camera();
        assert_ne!(numbers(0), numbers(SEQUENCE_LENGTH));
        assert!(numbers(u32::MAX).iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn decisions_are_independent() {
        // Correlation of first coordinates over one pixel's samples: a shared scramble would give 1.
        let (mut products, n) = ([0.0; 3], 4096);
        for sample in 0..n {
            let sampler = PixelSampler::new(1, 5, 5, sample);
            let first = |path, decision| f64::from(sampler.pair(path, decision).x) - 0.5;
            for (sum, other) in products.iter_mut().zip([
                (0, Decision::Light(1)),
                (0, Decision::Choice),
                (1, Decision::Light(0)),
            ]) {
                *sum += first(0, Decision::Light(0)) * first(other.0, other.1) * 12.0;
            }
        }
        assert!(products.iter().all(|product: &f64| (product / f64::from(n)).abs() < 0.05), "{products:?}");
    }
}
