//! Scene setting overrides from the command line and the keyboard, and the effective settings.

use std::path::PathBuf;

pub use super::formats::foreign::{ForeignOptions, MissingAssetMode};
use super::turntable::TurntableFrame;
use crate::choice;
use crate::film::Rect;
pub use crate::integrators::ViewMode;
use crate::integrators::{LayerSet, SampleLayer};
pub use crate::scene::description::CameraOverrides;
use crate::scene::description::{Accel, Integrator, RenderOptions, ResolvedCamera, ShadowMode, render_keys};

macro_rules! overrides {
    ($(
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
    )*) => {
        /// Overrides of scene settings for this run. `None` keeps the scene's value.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Overrides {
            /// Overrides of scene keys in the form `TABLE.KEY=VALUE`, applied before all other overrides.
            pub sets: Vec<String>,
            /// Output files. If empty, the scene's output file is used.
            pub outputs: Vec<PathBuf>,
            /// JSON file for the report of each finished request.
            pub report: Option<PathBuf>,
            /// Whether the report, and images with default names, may replace files that glimt did not write.
            pub replaces_foreign: bool,
            /// Time limit in seconds. Once it is reached, the render stops and keeps its current samples.
            pub time_seconds: Option<f64>,
            /// Whether to use photon maps.
            pub photons: Option<bool>,
            /// Whether to use depth of field.
            pub dof: Option<bool>,
            /// The view: beauty or an AOV.
            pub view: Option<ViewMode>,
            /// Side of a model that faces the camera. Replaces the model's own camera.
            pub from: Option<ViewSide>,
            /// Up axis of a model. Replaces the format's default.
            pub up: Option<UpAxis>,
            /// Changes to the scene's camera.
            pub camera: CameraOverrides,
            /// Additional layers for EXR files.
            pub layers: Vec<OutputLayer>,
            /// Turntable frame, or `None` for a still image.
            pub turn: Option<TurntableFrame>,
            /// Options for scenes from other renderers.
            pub foreign: ForeignOptions,
            /// Pixels to render. The rest of the image stays black.
            pub crop: Option<Rect>,
            /// Number of threads. `None` or 0 means one per core.
            pub threads: Option<usize>,
            /// Bits per channel for PNG files: 8 or 16.
            pub bit_depth: Option<u8>,
            /// 1-based number of the part that this process renders, and the number of parts.
            pub shard: Option<(u32, u32)>,
            /// Checkpoint settings.
            pub checkpoints: CheckpointSettings,
            /// Maximum memory use of the render, in bytes.
            pub memory: Option<u64>,
            $($(#[doc = $doc])* pub $name: Option<$type>,)*
        }

        impl Overrides {
            /// Applies the overrides to a scene's settings.
            pub(super) fn apply_to(&self, to: &RenderOptions) -> RenderOptions {
                RenderOptions { $($name: self.$name.unwrap_or(to.$name),)* ..*to }
            }
        }
    };
}

render_keys!(overrides, changed);

choice! {
    /// Sides from which to view a model.
    pub enum ViewSide {
        /// The front: +z, or −y in STL files.
        Front = "front",
        /// The back.
        Back = "back",
        /// The left side in the front view.
        Left = "left",
        /// The right side in the front view.
        Right = "right",
        /// The view from above.
        Top = "top",
        /// The view from below, without a ground plane.
        Bottom = "bottom",
        /// The view from the front, top and right.
        Iso = "iso",
    }
}

choice! {
    /// Extra channels (AOVs) in EXR files.
    pub enum OutputLayer {
        /// Diffuse reflectance.
        Albedo = "albedo",
        /// World-space shading normal, from -1 to 1, or 0 if nothing is hit.
        Normal = "normal",
        /// Distance along the view axis, or 0 if nothing is hit.
        Depth = "depth",
        /// Variance of the pixel's luminance.
        Variance = "variance",
        /// Samples per pixel.
        Samples = "samples",
        /// Ambient component of Phong materials.
        Ambient = "ambient",
        /// Diffuse light component.
        Diffuse = "diffuse",
        /// Specular light component.
        Specular = "specular",
        /// Light emitted by surfaces and the background.
        Emission = "emission",
    }
}

/// Source of a layer's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LayerValueSource {
    /// Values recorded with the image's samples.
    Samples(SampleLayer),
    /// The variance of each pixel's luminance.
    Variance,
    /// The number of samples in each pixel.
    SampleCount,
}

impl OutputLayer {
    /// Returns the source of the layer's values.
    pub(super) fn source(self) -> LayerValueSource {
        match self {
            Self::Albedo => LayerValueSource::Samples(SampleLayer::Albedo),
            Self::Normal => LayerValueSource::Samples(SampleLayer::Normal),
            Self::Depth => LayerValueSource::Samples(SampleLayer::Depth),
            Self::Variance => LayerValueSource::Variance,
            Self::Samples => LayerValueSource::SampleCount,
            Self::Ambient => LayerValueSource::Samples(SampleLayer::Ambient),
            Self::Diffuse => LayerValueSource::Samples(SampleLayer::Diffuse),
            Self::Specular => LayerValueSource::Samples(SampleLayer::Specular),
            Self::Emission => LayerValueSource::Samples(SampleLayer::Emission),
        }
    }
}

/// Returns the layers to record with the image's samples.
pub(super) fn layers_to_record(layers: &[OutputLayer]) -> LayerSet {
    let recorded = |layer: &OutputLayer| match layer.source() {
        LayerValueSource::Samples(layer) => Some(layer),
        LayerValueSource::Variance | LayerValueSource::SampleCount => None,
    };
    layers.iter().filter_map(recorded).collect()
}

choice! {
    /// Up axis of a mesh file.
    pub enum UpAxis {
        /// The x axis points up.
        X = "x",
        /// The y axis points up, as in glTF and most OBJ and PLY files.
        Y = "y",
        /// The z axis points up, as in CAD and 3D printing.
        Z = "z",
    }
}

/// How often a render saves checkpoints next to its output file, and whether it resumes from them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CheckpointSettings {
    /// Seconds between checkpoints. 0 disables checkpoints.
    pub seconds: f64,
    /// Whether a render resumes from a checkpoint.
    pub resume: ResumeMode,
    /// Whether the last checkpoint is kept when the image is written.
    pub are_kept: bool,
}

/// Whether a render resumes from a checkpoint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResumeMode {
    /// Start from scratch.
    #[default]
    No,
    /// Resume from an existing checkpoint. Fail if it belongs to another image.
    Asked,
    /// Resume if the checkpoint belongs to the same image. Otherwise, ignore it.
    IfSame,
}

/// The scene's values for the settings that keys can change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdjustableSceneSettings {
    /// Camera.
    pub camera: ResolvedCamera,
    /// Exposure in stops.
    pub exposure: f32,
    /// Integrator.
    pub integrator: Integrator,
    /// Shadow type.
    pub shadows: ShadowMode,
    /// Whether photons are on.
    pub photons: bool,
}

/// Effective settings of a request, for status lines and reports.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct EffectiveSettingsSummary {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Maximum samples per pixel.
    pub samples: u32,
    /// Noise target per tile, relative to the tile's brightness. 0 means no target.
    pub error: f32,
    /// Integrator.
    #[serde(serialize_with = "choice::serialize")]
    pub integrator: Integrator,
    /// Shadow type.
    #[serde(serialize_with = "choice::serialize")]
    pub shadows: ShadowMode,
    /// Limit on indirect radiance per bounce, which introduces bias. 0 means no limit.
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
    pub view: ViewMode,
    /// Exposure in stops.
    pub exposure: f32,
    /// Random seed.
    pub seed: u32,
    /// Number of render threads.
    pub threads: usize,
    /// Output files of the image.
    #[serde(serialize_with = "serialize_paths_lossily")]
    pub outputs: Vec<PathBuf>,
}

/// Serializes paths lossily, so that a report can be written even if a path is not valid UTF-8.
fn serialize_paths_lossily<S: serde::Serializer>(
    paths: &[PathBuf],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.to_string_lossy()))
}
