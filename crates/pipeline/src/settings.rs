//! Overrides of a scene by the command line and by keys, and the settings that result.

use std::path::PathBuf;

use super::turntable::Turn;
use crate::choice;
use crate::film::Rect;
use crate::integrators::RenderSettings;
pub use crate::integrators::View;
pub use crate::scene::description::CameraChange;
use crate::scene::description::{Accel, Integrator, Render, Shadows, render_keys};

macro_rules! overrides {
    ($(
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
    )*) => {
        /// Changes to a scene's settings for this run; `None` leaves the scene's own.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Overrides {
            /// Values in place of those in the file: texts `TABLE.KEY=VALUE`. The other changes come after these.
            pub sets: Vec<String>,
            /// Files to write; empty: the scene's own.
            pub outputs: Vec<PathBuf>,
            /// File for the report of each finished request, as JSON.
            pub report: Option<PathBuf>,
            /// Whether the report and the picture that nobody named may replace a file that glimt did not write.
            pub replaces_foreign: bool,
            /// Budget of time: stop rendering after this long, with what there is.
            pub time_seconds: Option<f64>,
            /// Photon maps.
            pub photons: Option<bool>,
            /// Depth of field.
            pub dof: Option<bool>,
            /// The view: beauty or an AOV.
            pub view: Option<View>,
            /// The side from which a model is seen, in place of its own camera.
            pub from: Option<Side>,
            /// The axis of a model that points upwards, in place of the usual one of its format.
            pub up: Option<UpAxis>,
            /// The camera.
            pub camera: CameraChange,
            /// Layers beside the picture in EXR files.
            pub layers: Vec<Layer>,
            /// The picture of a turntable. `None` for a single picture.
            pub turn: Option<Turn>,
            /// Render these pixels only; the rest of the picture stays black.
            pub crop: Option<Rect>,
            /// Threads; `None` or 0: one per core.
            pub threads: Option<usize>,
            /// Bits per channel of PNG files: 8 or 16.
            pub bit_depth: Option<u8>,
            /// The part of the picture that this process renders, from 1, and the number of parts.
            pub shard: Option<(u32, u32)>,
            /// Checkpoints of the render.
            pub checkpoints: Checkpoints,
            /// Most bytes that the render may need.
            pub memory: Option<u64>,
            $($(#[doc = $doc])* pub $name: Option<$type>,)*
        }

        impl Overrides {
            /// The settings of a scene with these changes.
            pub(super) fn applied(&self, to: &Render) -> Render {
                Render { $($name: self.$name.unwrap_or(to.$name),)* ..*to }
            }
        }
    };
}

render_keys!(overrides, changed);

choice! {
    /// Sides from which a model is seen.
    pub enum Side {
        /// The front: +z, of an STL file −y.
        Front = "front",
        /// The back.
        Back = "back",
        /// Its left side in the picture of the front.
        Left = "left",
        /// Its right side in the picture of the front.
        Right = "right",
        /// Above.
        Top = "top",
        /// Below, without the ground.
        Bottom = "bottom",
        /// Before it, from above and to its right.
        Iso = "iso",
    }
}

choice! {
    /// Layers beside the picture in EXR files.
    pub enum Layer {
        /// Diffuse reflectance.
        Albedo = "albedo",
        /// Shading normals in the world's axes, from -1 to 1; 0 where nothing is.
        Normal = "normal",
        /// Distance along the view axis, 0 where nothing is.
        Depth = "depth",
        /// Variance of the luminance of each pixel.
        Variance = "variance",
        /// Samples of each pixel.
        Samples = "samples",
        /// Ambient part of Phong.
        Ambient = "ambient",
        /// Diffuse part of the light.
        Diffuse = "diffuse",
        /// Specular part of the light.
        Specular = "specular",
        /// Light that surfaces send out, and that of the background.
        Emission = "emission",
    }
}

choice! {
    /// The axis of a mesh file that points upwards.
    pub enum UpAxis {
        /// x: −z is the front's right.
        X = "x",
        /// y, as glTF has it, and most OBJ and PLY files.
        Y = "y",
        /// z, as programs for construction and printing have it.
        Z = "z",
    }
}

/// Checkpoints of a render, beside its output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Checkpoints {
    /// Seconds between two of them; 0 for none.
    pub seconds: f64,
    /// Whether a render goes on from one.
    pub resume: Resume,
    /// Whether the last one stays when the picture is written.
    pub are_kept: bool,
}

/// Whether a render goes on from a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resume {
    /// It begins anew.
    #[default]
    No,
    /// It goes on from the checkpoint that is there; one of another picture is an error.
    Asked,
    /// It goes on from a checkpoint of the same picture, and leaves others alone.
    IfSame,
}

/// Settings of the scene itself, which keys change for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OwnSettings {
    /// Method.
    pub integrator: Integrator,
    /// Shadows.
    pub shadows: Shadows,
    /// Whether photons are on.
    pub photons: bool,
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
    /// Noise threshold of a tile, relative to its brightness; 0: no threshold.
    pub error: f32,
    /// Method.
    #[serde(serialize_with = "choice::serialize")]
    pub integrator: Integrator,
    /// Shadows.
    #[serde(serialize_with = "choice::serialize")]
    pub shadows: Shadows,
    /// Most radiance that a path brings by one vertex after its first reflection, which makes a bias; 0: no such limit.
    pub clamp: f32,
    /// Whether photons are on.
    pub photons: bool,
    /// Whether depth of field is on.
    pub dof: bool,
    /// Acceleration structure.
    #[serde(serialize_with = "choice::serialize")]
    pub accel: Accel,
    /// The view: beauty or an AOV.
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
        let RenderSettings { render, dof, view, photons } = settings.effective();
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
