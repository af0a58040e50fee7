//! What the command line and the keys change of a scene, and what then holds.

use std::path::PathBuf;

use crate::choice;
use crate::film::Rect;
use crate::integrators::RenderSettings;
pub use crate::integrators::View;
pub use crate::scene::description::CameraChange;
use crate::scene::description::{Accel, Integrator, Render, Shadows};

/// Changes to a scene's settings for this run; `None` leaves the scene's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overrides {
    /// Values in place of those in the file: texts `TABLE.KEY=VALUE`. The other changes come after these.
    pub sets: Vec<String>,
    /// Files to write; empty: the scene's own.
    pub outputs: Vec<PathBuf>,
    /// Where the report of each finished request is written, as JSON.
    pub report: Option<PathBuf>,
    /// Whether the report and the picture that nobody named may replace a file that glimt did not write.
    pub replaces_foreign: bool,
    /// Pixels across.
    pub width: Option<u32>,
    /// Pixels down.
    pub height: Option<u32>,
    /// Samples per pixel.
    pub samples: Option<u32>,
    /// Noise that ends the sampling of a tile.
    pub error: Option<f32>,
    /// Stop rendering after this long, with what there is.
    pub time_seconds: Option<f64>,
    /// Scatterings along a path.
    pub max_depth: Option<u32>,
    /// Method.
    pub integrator: Option<Integrator>,
    /// Shadows.
    pub shadows: Option<Shadows>,
    /// Most that a path brings by one vertex.
    pub clamp: Option<f32>,
    /// Photon maps.
    pub photons: Option<bool>,
    /// Depth of field.
    pub dof: Option<bool>,
    /// Acceleration structure.
    pub accel: Option<Accel>,
    /// What is shown.
    pub view: Option<View>,
    /// The camera.
    pub camera: CameraChange,
    /// In stops.
    pub exposure: Option<f32>,
    /// Seed.
    pub seed: Option<u32>,
    /// Render these pixels only; the rest of the picture stays black.
    pub crop: Option<Rect>,
    /// Threads; none or 0: one per core.
    pub threads: Option<usize>,
    /// Bits per channel of PNG files: 8 or 16.
    pub bit_depth: Option<u8>,
}

impl Overrides {
    /// The settings of a scene with these changes.
    pub(super) fn applied(&self, to: &Render) -> Render {
        Render {
            width: self.width.unwrap_or(to.width),
            height: self.height.unwrap_or(to.height),
            samples: self.samples.unwrap_or(to.samples),
            error: self.error.unwrap_or(to.error),
            max_depth: self.max_depth.unwrap_or(to.max_depth),
            integrator: self.integrator.unwrap_or(to.integrator),
            shadows: self.shadows.unwrap_or(to.shadows),
            clamp: self.clamp.unwrap_or(to.clamp),
            accel: self.accel.unwrap_or(to.accel),
            seed: self.seed.unwrap_or(to.seed),
            exposure: self.exposure.unwrap_or(to.exposure),
            ..*to
        }
    }
}

/// The settings a request renders with, for status lines.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Effective {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples per pixel, at most.
    pub samples: u32,
    /// Noise that ends the sampling of a tile, relative to its brightness; 0: none does.
    pub error: f32,
    /// Method.
    #[serde(serialize_with = "choice::serialize")]
    pub integrator: Integrator,
    /// Shadows.
    #[serde(serialize_with = "choice::serialize")]
    pub shadows: Shadows,
    /// Most radiance that a path brings by one vertex after its first reflection, which is a bias; 0: no such limit.
    pub clamp: f32,
    /// Whether photons are on.
    pub photons: bool,
    /// Whether depth of field is on.
    pub dof: bool,
    /// Acceleration structure.
    #[serde(serialize_with = "choice::serialize")]
    pub accel: Accel,
    /// What is shown.
    #[serde(serialize_with = "choice::serialize")]
    pub view: View,
    /// In stops.
    pub exposure: f32,
    /// The seed.
    pub seed: u32,
    /// Threads that render.
    pub threads: usize,
    /// The files the picture is written to.
    #[serde(serialize_with = "lossy_paths")]
    pub outputs: Vec<PathBuf>,
}

impl Effective {
    pub(super) fn new(settings: &RenderSettings, threads: usize, outputs: &[PathBuf]) -> Self {
        let RenderSettings { render, dof, view, photons } = settings.heeded();
        Self {
            width: render.width,
            height: render.height,
            samples: render.samples,
            error: render.error,
            integrator: render.integrator,
            shadows: settings.render.shadows,
            clamp: render.clamp,
            photons: photons.is_some(),
            dof,
            accel: render.accel,
            view,
            exposure: render.exposure,
            seed: render.seed,
            threads,
            outputs: outputs.to_vec(),
        }
    }
}

/// Names that are not UTF-8 must not keep a report from being written.
fn lossy_paths<S: serde::Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.to_string_lossy()))
}
