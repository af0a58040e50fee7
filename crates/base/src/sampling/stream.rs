//! Padded, Owen-scrambled Sobol points: every random decision of a path has its own independently scrambled
//! sequence (Burley, *Practical Hash-based Owen Scrambling*, JCGT 2020).

use crate::math::Vec2;

/// A dimension of the sample sequence: one random decision at a path vertex. Numbers for different decisions
/// are independent, while numbers for the same decision are well distributed over a pixel's samples. Every
/// random number is used for a single decision.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dimension {
    /// Position in the pixel.
    Pixel,
    /// Position on the lens.
    Lens,
    /// Position on the light with this index.
    Light(u32),
    /// Choice of a light if not all lights are sampled.
    LightChoice,
    /// Position on the chosen light.
    ChosenLight,
    /// Choice of the sampled lights that are tested with shadow rays.
    ShadowRayChoice,
    /// Choice between reflection and refraction.
    Fresnel,
    /// Stochastic transparency: whether the surface is opaque at this point.
    Opacity,
    /// Choice among the materials of a blend.
    Blend,
    /// Choice of the BSDF lobe to sample.
    Lobe,
    /// Direction within a lobe.
    Direction,
    /// Russian roulette after sampling a BSDF lobe.
    Roulette,
    /// Russian roulette after a specular surface. Separate from `Roulette` because the next vertex has the
    /// same path number.
    SpecularRoulette,
    /// Choice of the vertices at which photons are gathered, if the path has several.
    Gather,
    /// Position in a density kernel for the coverage trial with this index.
    Trial(u32),
    /// Choice of the light that emits a photon, and of the part of the light that emits it.
    PhotonLight,
    /// Whether a photon is aimed, and at which target.
    PhotonTarget,
    /// Starting position of a photon on its light.
    PhotonPosition,
    /// Direction of an emitted photon.
    PhotonDirection,
}

impl Dimension {
    /// Hash that selects the Owen scramble for this decision. `path` distinguishes the paths of one sample.
    #[inline(always)]
    fn hash(self, path: u32) -> u32 {
        let number = match self {
            Self::Light(number) => number,
            Self::Fresnel => u32::MAX,
            Self::Pixel => u32::MAX - 1,
            Self::Lens => u32::MAX - 2,
            Self::Lobe => u32::MAX - 3,
            Self::Direction => u32::MAX - 4,
            Self::Roulette => u32::MAX - 5,
            Self::LightChoice => u32::MAX - 6,
            Self::ChosenLight => u32::MAX - 7,
            Self::ShadowRayChoice => u32::MAX - 8,
            Self::PhotonLight => u32::MAX - 9,
            Self::PhotonTarget => u32::MAX - 10,
            Self::PhotonPosition => u32::MAX - 11,
            Self::PhotonDirection => u32::MAX - 12,
            Self::SpecularRoulette => u32::MAX - 13,
            Self::Gather => u32::MAX - 14,
            Self::Opacity => u32::MAX - 15,
            Self::Blend => u32::MAX - 16,
            Self::Trial(number) => (1 << 31) + number,
        };
        mix_bits(mix_bits(path.wrapping_add(1)) ^ number.wrapping_mul(0x9e37_79b9))
    }
}

/// Path number for decisions made in the camera.
pub const CAMERA_PATH: u32 = 0;

/// Random numbers for one sample in a pixel.
#[derive(Clone, Copy, Debug)]
pub struct PixelSampler {
    seed: u32,
    sample: u32,
}

/// Hashes a pixel's coordinates in the full image.
#[inline(always)]
fn pixel_seed(seed: u32, x: u32, y: u32) -> u32 {
    mix_bits(mix_bits(mix_bits(seed) ^ x) ^ y.rotate_left(16))
}

impl PixelSampler {
    /// Creates the sampler for sample `sample` of pixel (x, y) in the full image.
    #[inline]
    pub fn new(seed: u32, x: u32, y: u32, sample: u32) -> Self {
        Self { seed: pixel_seed(seed, x, y), sample }
    }

    /// Returns two numbers in [0, 1) for one decision.
    #[inline]
    pub fn pair(&self, path: u32, decision: Dimension) -> Vec2 {
        let [[x], [y]] =
            owen_scrambled_points([self.sample], [mix_bits(self.seed ^ decision.hash(path)) ^ mix_bits(0)]);
        Vec2::new(x, y)
    }
}

/// A packet of [`PixelSampler`]s.
#[derive(Clone, Copy, Debug)]
pub struct SamplerPacket<const N: usize> {
    seeds: [u32; N],
    samples: [u32; N],
}

impl<const N: usize> SamplerPacket<N> {
    /// Creates samplers for one sample of each pixel (x, y) in the full image.
    #[inline(always)]
    pub fn new(seed: u32, x: &[u32; N], y: &[u32; N], samples: &[u32; N]) -> Self {
        let mut seeds = [0; N];
        for i in 0..N {
            seeds[i] = pixel_seed(seed, x[i], y[i]);
        }
        Self { seeds, samples: *samples }
    }

    /// Returns two numbers in [0, 1) per sample, for a decision made `of` times per sample. The numbers are
    /// well distributed over all repetitions and samples. The scramble changes every 2³² points.
    #[inline(always)]
    pub fn pairs(&self, paths: &[u32; N], decision: Dimension, repetition: u32, of: u32) -> [[f32; N]; 2] {
        let (mut indices, mut seeds) = ([0; N], [0; N]);
        for i in 0..N {
            let index = u64::from(self.samples[i]) * u64::from(of) + u64::from(repetition);
            indices[i] = index as u32;
            seeds[i] = mix_bits(self.seeds[i] ^ decision.hash(paths[i])) ^ mix_bits((index >> 32) as u32);
        }
        owen_scrambled_points(indices, seeds)
    }
}

/// Points of the first two Sobol dimensions. Their order and both coordinates are Owen-scrambled.
#[inline(always)]
fn owen_scrambled_points<const N: usize>(indices: [u32; N], seeds: [u32; N]) -> [[f32; N]; 2] {
    // Run each step over all lanes before the next step so that compilers vectorize it.
    let mut places = indices;
    for (place, &seed) in places.iter_mut().zip(&seeds) {
        *place = owen_scramble_reversed(place.reverse_bits(), seed).reverse_bits();
    }
    let mut points = [[0.0; N]; 2];
    for i in 0..N {
        points[0][i] =
            reversed_bits_to_unit(owen_scramble_reversed(places[i], mix_bits(seeds[i] ^ 0x68bc_21eb)));
    }
    for i in 0..N {
        points[1][i] = reversed_bits_to_unit(owen_scramble_reversed(
            reversed_second_sobol(places[i]),
            mix_bits(seeds[i] ^ 0x02e5_be93),
        ));
    }
    points
}

/// Converts the upper 24 bits, in reversed order, to a fraction in [0, 1). 24 bits allow signed conversion,
/// which vector units support.
#[inline(always)]
fn reversed_bits_to_unit(bits: u32) -> f32 {
    (bits.reverse_bits() >> 8) as i32 as f32 * (1.0 / (1 << 24) as f32)
}

/// Bit-reversed second Sobol coordinate. Bit j is the sum (mod 2) of the index bits k for which C(k, j) is
/// odd, that is, for which k has every bit of j set. The bit-reversed first coordinate is the index itself.
#[inline(always)]
fn reversed_second_sobol(mut bits: u32) -> u32 {
    for (shift, lacking) in
        [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)]
    {
        bits ^= (bits >> shift) & lacking;
    }
    bits
}

/// Owen scrambling of reversed bits with a hash in which each bit depends only on lower bits (Laine and
/// Karras, *Stratified Sampling for Stochastic Transparency*, 2011, with the constants from Vegdahl,
/// *Building a Better LK Hash*, 2021).
#[inline(always)]
fn owen_scramble_reversed(mut bits: u32, seed: u32) -> u32 {
    bits ^= bits.wrapping_mul(0x3d20_adea);
    bits = bits.wrapping_add(seed);
    bits = bits.wrapping_mul((seed >> 16) | 1);
    bits ^= bits.wrapping_mul(0x0552_6c56);
    bits ^ bits.wrapping_mul(0x53a2_2864)
}

/// A bijective hash of 32 bits (Wellons, *Prospecting for Hash Functions*, 2018, "lowbias32").
#[inline(always)]
fn mix_bits(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(
        seed: u32,
        [x, y, sample]: [u32; 3],
        decision: Dimension,
        of: u32,
    ) -> impl Iterator<Item = [f32; 2]> {
        let row = SamplerPacket::new(seed, &[x], &[y], &[sample]);
        (0..of).map(move |repetition| row.pairs(&[1], decision, repetition, of).map(|[x]| x))
    }

    #[test]
    fn repetitions_form_a_single_sequence() {
        for (sample, n) in [(0, 3), (7, 5), (9, 1), (u32::MAX / 3, 6), (u32::MAX / 2, 3)] {
            let own = PixelSampler::new(2, 3, 4, sample);
            for (i, point) in points(2, [3, 4, sample], Dimension::Fresnel, n).enumerate() {
                let index = u64::from(sample) * u64::from(n) + i as u64;
                let seed = mix_bits(own.seed ^ Dimension::Fresnel.hash(1)) ^ mix_bits((index >> 32) as u32);
                let [[x], [y]] = owen_scrambled_points([index as u32], [seed]);
                assert_eq!([x, y], point, "number {i} of sample {sample}");
                let row = SamplerPacket::new(2, &[3; 16], &[4; 16], &[sample; 16]);
                let [x, y] = row.pairs(&[1; 16], Dimension::Fresnel, i as u32, n);
                assert_eq!([x[i % 16], y[15]], point, "number {i} of sample {sample} in a packet");
            }
            let first = points(2, [3, 4, sample], Dimension::Fresnel, 1).next();
            assert_eq!(first, Some(own.pair(1, Dimension::Fresnel).to_array()));
        }
    }

    #[test]
    fn power_of_two_counts_are_stratified() {
        // Each cell of every 64-cell grid (64×1, 32×2, …, 1×64) contains one of the 64 points.
        for n in [1_u32, 16] {
            let all = (0..64 / n).flat_map(|sample| points(3, [10, 20, sample], Dimension::Light(2), n));
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
        let first = |x| PixelSampler::new(3, x, 20, 0).pair(CAMERA_PATH, Dimension::Pixel);
        assert_ne!(first(10), first(11));
    }

    #[test]
    fn second_dimension_matches_sobol() {
        // Direction numbers v₀ = ½, vₖ = vₖ₋₁ ⊕ vₖ₋₁/2.
        for index in (0..5000).chain([u32::MAX, 0x8000_0001]) {
            let (mut sum, mut direction) = (0, 1_u32 << 31);
            for bit in 0..32 {
                sum ^= if index >> bit & 1 == 1 { direction } else { 0 };
                direction ^= direction >> 1;
            }
            assert_eq!(reversed_second_sobol(index).reverse_bits(), sum, "{index}");
        }
    }

    #[test]
    fn aligned_repetition_groups_are_stratified() {
        // Check every aligned group of 32 repetitions, for several numbers of groups per sample.
        for (sample, of) in [(0, 32), (5, 96), (77, 160), (1 << 27, 64)] {
            let row = SamplerPacket::new(3, &[7; 16], &[9; 16], &[sample; 16]);
            let paths = std::array::from_fn(|i| i as u32);
            for group in 0..of / 32 {
                let mut found = [0_u32; 16];
                for repetition in 0..32 {
                    let [u, _] = row.pairs(&paths, Dimension::LightChoice, group * 32 + repetition, of);
                    for i in 0..16 {
                        found[i] |= 1 << (u[i] * 32.0) as u32;
                    }
                }
                assert_eq!(found, [u32::MAX; 16], "sample {sample}, group {group} of {of}");
            }
        }
    }

    #[test]
    fn scrambles_are_uniform_over_pixels() {
        let (mut sums, mut product, n) = ([0.0; 2], 0.0, 40_000_u32);
        for pixel in 0..n {
            let place = [pixel % 200, pixel / 200, 7];
            for [x, y] in points(1, place, Dimension::Light(0), 1).map(|point| point.map(f64::from)) {
                sums = [sums[0] + x, sums[1] + y];
                product += (x - 0.5) * (y - 0.5) * 12.0;
            }
        }
        let count = f64::from(n);
        // Allow five standard errors: 1/√(12n) for the means and 1/√n for the mean product.
        assert!(sums.iter().all(|sum| (sum / count - 0.5).abs() < 5.0 / (12.0 * count).sqrt()), "{sums:?}");
        assert!((product / count).abs() < 5.0 / count.sqrt(), "{product}");
    }

    #[test]
    fn dimensions_are_independent() {
        // Mean correlation of the first coordinates over each pixel's samples, for 64 pixels. It would be 1
        // with a shared scramble.
        let others = [
            (0, Dimension::Light(1)),
            (0, Dimension::Fresnel),
            (1, Dimension::Light(0)),
            (0, Dimension::Pixel),
        ];
        let (mut products, samples, pixels) = ([0.0; 4], 1024, 64);
        for (pixel, sample) in (0..pixels).flat_map(|pixel| (0..samples).map(move |sample| (pixel, sample))) {
            let sampler = PixelSampler::new(1, pixel % 8, pixel / 8, sample);
            let first = |path, dimension| f64::from(sampler.pair(path, dimension).x) - 0.5;
            for (sum, other) in products.iter_mut().zip(others) {
                *sum += first(0, Dimension::Light(0)) * first(other.0, other.1) * 12.0;
            }
        }
        let count = f64::from(samples * pixels);
        // Five standard errors of the mean for independent pairs.
        let allowed = 5.0 / count.sqrt();
        assert!(products.iter().all(|product: &f64| (product / count).abs() < allowed), "{products:?}");
    }
}
