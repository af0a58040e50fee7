//! glimt: the world that is traced, and the integrators. The map of the house is in the crate `glimt`.
//!
//! | folder | what it knows |
//! | --- | --- |
//! | [`world`] | everything ready to trace: objects and their trees, materials, lights, the camera, glass solids |
//! | `integrators/` | [`RenderSettings`](integrators::RenderSettings), [`View`](integrators::View), and [`render_tile_with_photons`](integrators::render_tile_with_photons), which renders a tile |
//! | `integrators/transport/` | rays of a tile, packets of their hits, vertices in rows of sixteen, the walk through glass, scattering |
//! | `integrators/direct/` | light samples, shadow rays, lobe rays, MIS weights |
//! | `integrators/photons/` | photon emission, maps, gathering |
//!
//! `world` knows neither pixels nor settings of a render. The table in `integrators` says which of its parts uses which.

pub mod integrators;
pub mod world;

// The rooms below, under the names that they have in the whole house.
use glimt_base::{choice, control, film, math, sampling};
use glimt_files::assets;
use glimt_kernel::{accel, geometry, lights, materials};
use glimt_scene as scene;
