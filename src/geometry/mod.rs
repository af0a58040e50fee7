//! Rays, boxes, shapes and hits with error bounds.
//!
//! Triangles of meshes are tested in `f32` by a watertight method; every other shape is a quadric, a torus or a flat
//! piece computed in `f64`, so that no `f32` ray sees its rounding.

pub mod aabb;
mod axial;
pub mod cone;
pub mod cuboid;
pub mod cylinder;
pub mod disk;
pub mod mesh;
pub mod parallelogram;
pub mod plane;
pub mod ray;
pub mod rows;
pub mod sphere;
pub mod surface;
pub mod torus;
pub mod triangle;
pub mod watertight;

pub use aabb::Aabb;
pub use ray::{Ray, RayF64};
pub use surface::{ShapeHit, SurfacePoint};
