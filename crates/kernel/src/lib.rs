//! The rendering kernel: ray intersection, materials, and lights. It is independent of scene files, pixels,
//! and threads. See the crate `glimt` for an overview.
//!
//! | module | contents | uses |
//! | --- | --- | --- |
//! | [`geometry`] | rays, boxes, one file per shape; hits with error bounds | no other module of this crate |
//! | [`accel`] | trees over boxes, with a closure that tests shapes; trees over triangles, with several instruction sets | `geometry` (only triangles as shapes) |
//! | [`materials`] | one file per BSDF; textures and their footprints, normal maps, height maps | no other module; all directions are in a local frame |
//! | [`lights`] | one file per light, in `area`, `delta` and `infinite`; light sampling; photon emission | `geometry` and textures; no BSDFs or trees over shapes |
//!
//! Start reading at [`geometry::Shape`], [`materials::Material`], and the documentation of [`lights`] and
//! [`accel`].
//!
//! Performance-critical code exists in two versions: one for single rays and one for packets of 16 rays.

pub mod accel;
pub mod geometry;
pub mod lights;
pub mod materials;

// Modules from lower-level crates, under the names used throughout the workspace.
use glimt_base::{choice, control, math, sampling};
