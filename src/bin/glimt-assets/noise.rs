//! Value noise: smoothly interpolated random numbers on a lattice. Uses only arithmetic that gives the same
//! results on every machine.

use super::vector::{Vector, scale};

/// A pseudorandom number in [0, 1) for a lattice point (a finalizer based on Stafford's variant 13).
pub(crate) fn lattice_random(point: [i64; 3], seed: u64) -> f64 {
    let mixed = point.iter().fold(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15), |state, coordinate| {
        let mut word = (state ^ *coordinate as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        word ^ (word >> 31)
    });
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

/// Smooth noise in [0, 1]. If `period` is positive, the noise repeats after `period` lattice points in x and
/// y.
pub(crate) fn value_noise(at: Vector, period: i64, seed: u64) -> f64 {
    let base = [at[0].floor(), at[1].floor(), at[2].floor()];
    let fade = |axis: usize| {
        let t = at[axis] - base[axis];
        t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    };
    let wrap = |coordinate: i64| if period > 0 { coordinate.rem_euclid(period) } else { coordinate };
    let corner = |x: i64, y: i64, z: i64| {
        lattice_random([wrap(base[0] as i64 + x), wrap(base[1] as i64 + y), base[2] as i64 + z], seed)
    };
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let (tx, ty, tz) = (fade(0), fade(1), fade(2));
    let face =
        |z| mix(mix(corner(0, 0, z), corner(1, 0, z), tx), mix(corner(0, 1, z), corner(1, 1, z), tx), ty);
    mix(face(0), face(1), tz)
}

/// Sum of octaves of [`value_noise`], each twice as fine and half as strong as the previous one. The result
/// is in [0, 1].
pub(crate) fn fractal_noise(at: Vector, octaves: u32, period: i64, seed: u64) -> f64 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    for octave in 0..octaves {
        let finer = (1_i64 << octave) as f64;
        sum += weight * value_noise(scale(at, finer), period << octave, seed + u64::from(octave));
        total += weight;
        weight *= 0.5;
    }
    sum / total
}
