//! The validated scene description. It has all defaults filled in and is independent of the file syntax.
//! Objects refer to each other by index.
//!
//! Lengths are in scene units, angles in degrees, and colors in linear Rec. 709. All numbers are finite.

mod camera;
pub mod light;
mod material;
mod method;
mod render;
mod shape;
mod transform;

use std::ops::Range;
use std::path::PathBuf;

pub use camera::{Camera, CameraOverrides, Pose, ResolvedCamera, is_same_distance};
pub use light::{Environment, Light};
pub use material::{
    Bump, Channel, ChannelSelector, ColorSource, EmissionSides, EmissionSource, FresnelSource, Material,
    MaterialKind, NormalMap, NumberSource, OpacitySource, PhongParameters, PixelInterpretation, Texture,
    TextureEncoding, TextureFilter, TextureRole, UvSet, Wrap,
};
pub use method::{Integrator, IntegratorProperties};
pub use render::{Accel, MAX_BOUNCES, PixelFilter, RenderOptions, ShadowMode, Tonemap, render_keys};
pub use shape::{LoweredShape, MeshReference, Object, OpenSurface, Shape, max_projection};
pub use transform::{AffineMap, ObjectTransform};

/// A validated scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The `[render]` table.
    pub render: RenderOptions,
    /// The value of `output` in `[render]`, resolved against the scene's folder.
    pub output: Option<PathBuf>,
    /// The `[camera]` table.
    pub camera: Camera,
    /// The `[photons]` table.
    pub photons: PhotonOptions,
    /// `[textures.*]`, in file order.
    pub textures: Vec<Texture>,
    /// `[materials.*]`, in file order.
    pub materials: Vec<Material>,
    /// The mesh files and glTF parts that `[[mesh]]` tables reference, without duplicates.
    pub mesh_files: Vec<MeshFile>,
    /// All shapes, in file order.
    pub objects: Vec<Object>,
    /// `[[light]]`, in file order.
    pub lights: Vec<Light>,
    /// `[environment]`, which replaces [`RenderOptions::background`].
    pub environment: Option<Environment>,
}

/// A value and its span in the scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Byte range in the scene file.
    pub span: Range<usize>,
}

/// A mesh file, or one part of a glTF file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// Path of the file.
    pub value: PathBuf,
    /// Byte range of the path in the scene file.
    pub span: Range<usize>,
    /// Index of the glTF part. `None` means the whole file.
    pub part: Option<u32>,
}

/// The `[photons]` table.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotonOptions {
    /// Whether the scene enables photons.
    pub enabled: bool,
    /// Photons per pass. 0 means about one per pixel.
    pub count: u64,
    /// Kernel radius of the first pass. 0 chooses a radius based on the photon density.
    pub radius: f64,
    /// Maximum number of bounces per photon.
    pub bounces: u32,
}
