//! Light transport: a tile's rays, their hits, and packets of sixteen vertices. Depends on the world, but not
//! on integrators or photons.
//!
//! - `tile`: the context shared by all rays of a tile. `ray`, `cone`, `interiors`: a path's ray, its ray
//!   cone, and the glass around it.
//! - `camera`: camera rays. `packet_source`: the rays of a packet. `packet`: intersection, and packets of
//!   plain surfaces. `plain_vertices`: their vertices.
//! - `walk`, `crossing`: null interactions and glass boundaries up to the next scattering surface. `vertex`:
//!   that surface, prepared for shading.
//! - `interface`: specular reflection and refraction. `batch`: packets of non-specular vertices. `scatter`:
//!   BSDF sampling at non-specular vertices.
//! - `accumulator`: sums of the light components shown by the view. `scratch`: reused queues.

pub mod accumulator;
pub mod batch;
pub mod camera;
pub mod cone;
pub mod crossing;
pub mod interface;
pub mod interiors;
pub mod packet;
pub mod packet_source;
mod plain_vertices;
pub mod ray;
pub mod scatter;
pub mod scratch;
pub mod tile;
pub mod vertex;
pub mod walk;
