//! Sample streams, warps and distributions. Random numbers are a function of the seed, pixel, sample and
//! dimension.

pub mod distribution;
pub mod filter;
pub mod piecewise_constant;
pub mod stream;
pub mod warp;

pub use stream::{CAMERA_PATH, Dimension, PixelSampler, SamplerPacket};
