//! Sample streams, warps and distributions. Random numbers are a function of seed, pixel, sample and
//! dimension.

pub mod distribution;
pub mod filter;
pub mod grid;
pub mod stream;
pub mod warp;

pub use stream::{CAMERA_PATH, Decision, PixelSampler, SamplerPacket};
