//! Transport: rays of a tile, their hits, and vertices in rows of sixteen. It knows the world, but neither integrators nor photons.
//!
//! - `tile`: what all rays of a tile have in common; `ray`, `cone`, `medium`: a path's ray, its beam, the glass around it.
//! - `camera`: the first rays; `trace`, `packet`: rays to hits, and to rows of plain surfaces.
//! - `walk`, `crossing`: through glass, up to the first surface that matters; `vertex`: that surface, prepared for shading.
//! - `interface`: reflection and refraction; `batch`: rows of rough vertices; `scatter`: paths that go on from these.
//! - `accumulator`: the parts of light that the view shows; `scratch`: memory of the queues.

pub mod accumulator;
pub mod batch;
pub mod camera;
pub mod cone;
pub mod crossing;
pub mod interface;
pub mod medium;
pub mod packet;
pub mod ray;
pub mod scatter;
pub mod scratch;
pub mod tile;
pub mod trace;
pub mod vertex;
pub mod walk;
