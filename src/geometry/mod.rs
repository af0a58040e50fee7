//! Rays, boxes, shapes and hits with error bounds.

pub mod mesh;
