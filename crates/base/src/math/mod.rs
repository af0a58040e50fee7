//! Numbers, vectors, transforms and color, used by all other modules.

pub mod color;
pub mod decimal;
pub mod elementary;
pub mod float;
pub mod frame;
pub mod lanes;
pub mod limits;
pub mod origin;
pub mod random;
pub mod soa;
pub mod transform;

pub use glam::{DMat3, DMat4, DVec2, DVec3, DVec4, Mat3, UVec2, Vec2, Vec3, Vec4};
