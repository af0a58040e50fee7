//! What surfaces do with light, in a local frame.

pub mod texels;
