//! Sample streams, warps and distributions. Random numbers are a function of (seed, pixel, sample, dimension).

pub mod distribution;
pub mod filter;
pub mod stream;
pub mod warp;

pub use stream::{Decision, PixelSampler, Repetitions};
