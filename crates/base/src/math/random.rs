//! The pseudo-random numbers of tests and benchmarks, and a hash for fixed sampling patterns. Integrators draw
//! their numbers from `sampling::stream` instead.

use super::{DVec3, Vec3};

/// Hashes `number` to 64 well-mixed bits, identically on every machine (`MurmurHash3` finalizer).
pub fn hash(number: u64) -> u64 {
    let mix = |x: u64, factor: u64| (x ^ (x >> 33)).wrapping_mul(factor);
    let mixed = mix(mix(number.wrapping_add(1), 0xff51_afd7_ed55_8ccd), 0xc4ce_b9fe_1a85_ec53);
    mixed ^ (mixed >> 33)
}

/// Pseudo-random number generator for tests and benchmarks: a linear congruential generator with the constants
/// of Knuth's MMIX. The numbers depend only on the seed, so a failing test fails on every machine.
#[derive(Clone, Debug)]
pub struct TestRandom {
    state: u64,
}

impl TestRandom {
    /// Creates a generator.
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// Creates one of many independent generators with the same seed.
    pub fn stream(seed: u64, number: u64) -> Self {
        Self::new(hash(hash(seed) ^ number))
    }

    /// Advances the state. Its lower bits have short periods.
    #[inline]
    fn advance(&mut self) -> u64 {
        self.state =
            self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.state
    }

    /// 64 uniform bits.
    pub fn bits(&mut self) -> u64 {
        hash(self.advance())
    }

    /// A uniform number in [0, 1), a multiple of 2⁻⁵³.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.advance() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A uniform number in [0, 1), a multiple of 2⁻²⁴.
    #[inline]
    pub fn unit_f32(&mut self) -> f32 {
        (self.advance() >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// A uniform number in [−1, 1).
    #[inline]
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A uniform number in [−1, 1).
    #[inline]
    pub fn signed_f32(&mut self) -> f32 {
        2.0 * self.unit_f32() - 1.0
    }

    /// A uniform integer below `count`, which must not be 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.bits()) * count as u128) >> 64) as usize
    }

    /// A random element of a nonempty slice.
    pub fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    /// A uniform point in the cube [−1, 1)³.
    pub fn in_cube(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// A uniform point in the cube [−1, 1)³.
    pub fn in_cube_f32(&mut self) -> Vec3 {
        Vec3::new(self.signed_f32(), self.signed_f32(), self.signed_f32())
    }

    /// A uniform unit direction.
    pub fn direction(&mut self) -> DVec3 {
        let (z, (sin, cos)) = (self.signed(), libm::sincos(std::f64::consts::TAU * self.unit()));
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, z)
    }
}

/// [`TestRandom::unit_f32`] as a closure.
pub fn unit_generator(seed: u64) -> impl FnMut() -> f32 {
    let mut random = TestRandom::new(seed);
    move || random.unit_f32()
}

/// [`TestRandom::signed_f32`] as a closure.
pub fn signed_number_generator(seed: u64) -> impl FnMut() -> f32 {
    let mut random = TestRandom::new(seed);
    move || random.signed_f32()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_ranges_evenly() {
        // Five standard errors of a cell's share: √(p/n) for small p.
        let (mut random, n, cells) = (TestRandom::new(1), 100_000, 16);
        let mut counts = vec![[0_u32; 4]; cells];
        for _ in 0..n {
            let place = |unit: f64| (unit * cells as f64) as usize;
            let draws = [
                place(random.unit()),
                place(f64::from(random.unit_f32())),
                random.below(cells),
                (random.bits() % cells as u64) as usize,
            ];
            for (kind, cell) in draws.into_iter().enumerate() {
                counts[cell][kind] += 1;
            }
        }
        let (share, n) = (1.0 / cells as f64, f64::from(n));
        for count in counts.iter().flatten() {
            assert!((f64::from(*count) / n - share).abs() < 5.0 * (share / n).sqrt(), "{counts:?}");
        }
    }

    #[test]
    fn streams_differ() {
        let first = |seed, number| TestRandom::stream(seed, number).bits();
        let all: std::collections::HashSet<u64> =
            (0..100).flat_map(|seed| (0..100).map(move |number| first(seed, number))).collect();
        assert_eq!(all.len(), 10_000);
    }
}
