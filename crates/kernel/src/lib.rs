//! glimt's kernel: where rays meet surfaces, what surfaces do with light, and where light comes from. Nothing here knows scene
//! files, pixels or threads.
//!
//! | room | contents | may know |
//! | --- | --- | --- |
//! | [`geometry`] | rays, boxes, one file a shape; hits with bounds on their errors | no other room of this crate |
//! | [`accel`] | trees over boxes, whose closures test what is in them; trees over triangles, with all vector instructions | `geometry`; of the shapes, triangles alone |
//! | [`materials`] | one file a BSDF; textures and their footprints, normal maps, heights | no other room: directions are in a local frame |
//! | [`lights`] | one file a light, in `area`, `delta` and `infinite`; picks among many; photon emission | `geometry` and textures, but neither BSDFs nor trees over shapes |
//!
//! Begin to read at [`geometry::Shape`] (what a shape tells), at the page of [`lights`] (what a light tells), at
//! [`materials::Material`] (what a surface is made of) and at the page of [`accel`] (which tree does what).
//!
//! Hot code has a form for sixteen lanes side by side, beside the form for a single ray: files and methods called `row` or `rows`. The map of the house is in the crate `glimt`.

pub mod accel;
pub mod geometry;
pub mod lights;
pub mod materials;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, math, sampling};
