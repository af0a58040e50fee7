//! Numbers, vectors, transforms and colour: what every other room may use.

pub mod color;
pub mod decimal;
pub mod elementary;
pub mod float;
pub mod frame;
pub mod lanes;
pub mod limits;
pub mod origin;
pub mod random;
pub mod transform;

pub use glam::{DMat3, DVec2, DVec3, UVec2, Vec2, Vec3, Vec4};
