//! The rendering kernel: ray intersection, materials and lights. It knows nothing of scene files, pixels or threads. See the crate
//! `glimt` for an overview.
//!
//! | module | contents | uses |
//! | --- | --- | --- |
//! | [`geometry`] | rays, boxes, one file per shape; hits with error bounds | no other module of this crate |
//! | [`accel`] | trees over boxes whose contents a closure tests; trees over triangles for all instruction sets | `geometry`, and of its shapes only triangles |
//! | [`materials`] | one file per BSDF; textures and their footprints, normal maps, height maps | no other module; directions are in a local frame |
//! | [`lights`] | one file per light, in `area`, `delta` and `infinite`; light sampling; photon emission | `geometry` and textures, but neither BSDFs nor trees over shapes |
//!
//! Start reading at [`geometry::Shape`], [`materials::Material`], and the documentation of [`lights`] and [`accel`].
//!
//! Hot code exists in two forms, for a single ray and for packets of sixteen.

pub mod accel;
pub mod geometry;
pub mod lights;
pub mod materials;

// Modules of lower crates, under the names used throughout the workspace.
use glimt_base::{choice, control, math, sampling};
