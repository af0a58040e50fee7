//! What the command line and the keys change of a scene, and what then holds.

use std::path::PathBuf;

use crate::film::Rect;
pub use crate::integrators::View;
use crate::scene::description::{Accel, Integrator, Shadows};

/// Changes to a scene's settings for this run; `None` leaves the scene's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Files to write; empty: the scene's own.
    pub outputs: Vec<PathBuf>,
    /// Where the report of each finished request is written, as JSON.
    pub report: Option<PathBuf>,
    /// Pixels across.
    pub width: Option<u32>,
    /// Pixels down.
    pub height: Option<u32>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Stop rendering after this long, with what there is.
    pub time_seconds: Option<f64>,
    /// Scatterings along a path.
    pub max_depth: Option<u32>,
    /// Method.
    pub integrator: Option<Integrator>,
    /// Shadows.
    pub shadows: Option<Shadows>,
    /// Photon maps.
    pub photons: Option<bool>,
    /// Depth of field.
    pub dof: Option<bool>,
    /// Acceleration structure.
    pub accel: Option<Accel>,
    /// What is shown.
    pub view: Option<View>,
    /// Seed.
    pub seed: Option<u32>,
    /// Render these pixels only; the rest of the picture stays black.
    pub crop: Option<Rect>,
    /// Threads; none or 0: one per core.
    pub threads: Option<usize>,
    /// Bits per channel of PNG files: 8 or 16.
    pub bit_depth: Option<u8>,
}
