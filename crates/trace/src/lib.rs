//! The world against which rays are traced, and the integrators. See the `glimt` crate for an overview.
//!
//! | module | contents |
//! | --- | --- |
//! | [`world`] | objects and their acceleration structures, materials, lights, the camera, glass solids |
//! | [`integrators`] | [`RenderSettings`](integrators::RenderSettings), [`View`](integrators::ViewMode), and [`render_tile_with_photons`](integrators::render_tile_with_photons), which renders a tile |
//! | `integrators/transport/` | rays of a tile, packets of their hits, packets of sixteen vertices, paths through glass, scattering |
//! | `integrators/direct/` | light samples, shadow rays, lobe rays, MIS weights |
//! | `integrators/photons/` | photon emission, maps, gathering |
//!
//! `world` does not depend on pixels or render settings. The table in [`integrators`] lists the dependencies
//! between its submodules.

pub mod integrators;
pub mod world;

// Modules from lower-level crates, under the names used throughout the workspace.
use glimt_base::{choice, control, film, math, sampling};
use glimt_files::assets;
use glimt_kernel::{accel, geometry, lights, materials};
use glimt_scene as scene;
