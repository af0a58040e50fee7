//! Transport: rays of a tile, their hits, and vertices in rows of sixteen. It knows the world, but neither methods nor photons.

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
