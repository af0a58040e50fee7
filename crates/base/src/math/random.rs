//! A simple pseudo-random number generator for tests and fixed sampling patterns.

/// Hashes `number` to 64 well-mixed bits, identically on every machine (`MurmurHash3` finalizer).
pub fn hash(number: u64) -> u64 {
    let mix = |x: u64, factor: u64| (x ^ (x >> 33)).wrapping_mul(factor);
    let mixed = mix(mix(number.wrapping_add(1), 0xff51_afd7_ed55_8ccd), 0xc4ce_b9fe_1a85_ec53);
    mixed ^ (mixed >> 33)
}

/// Uniform numbers in [0, 1) from the upper 24 bits of a linear congruential generator (Knuth's MMIX).
pub fn unit_generator(seed: u64) -> impl FnMut() -> f32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1_u64 << 24) as f32
    }
}

/// Uniform numbers in [−1, 1), from [`unit_generator()`].
pub fn signed_generator(seed: u64) -> impl FnMut() -> f32 {
    let mut unit = unit_generator(seed);
    move || unit() * 2.0 - 1.0
}
