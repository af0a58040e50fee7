//! The lowered scene: what a scene file means, with every default filled in and every invariant kept by
//! validation. Nothing here knows the file's syntax; objects refer to each other by index.
//!
//! Lengths are in the scene's unit, angles in degrees, colours linear Rec. 709. All numbers are finite.

mod camera;
pub mod light;
mod material;
mod method;
mod render;
mod shape;

use std::ops::Range;
use std::path::PathBuf;

pub use camera::{Camera, CameraChange, Pose, Viewpoint, is_same_distance};
pub use light::{Environment, Light};
pub use material::{
    Bump, Channel, ColorSource, EmissionSides, EmissionSource, Encoding, FresnelSource, Material,
    MaterialKind, NormalMap, NumberSource, OpacitySource, PixelValue, Texture, TextureFilter, TextureRole,
    TextureUse, UvSet, Wrap,
};
pub use method::{Integrator, Method};
pub use render::{
    Accel, KeyRange, MOST_SCATTERINGS, PixelFilter, Render, RenderKey, Shadows, Tonemap, render_keys,
};
pub use shape::{Lowered, Mesh, Object, Placement, Shape, Sheet, greatest};

/// A whole scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The `[render]` table.
    pub render: Render,
    /// Output file, if the scene names one, resolved against the scene's folder.
    pub output: Option<PathBuf>,
    /// The `[camera]` table.
    pub camera: Camera,
    /// The `[photons]` table.
    pub photons: Photons,
    /// `[textures.*]`, in the order of the file.
    pub textures: Vec<Texture>,
    /// `[materials.*]`, in the order of the file.
    pub materials: Vec<Material>,
    /// The mesh files that `[[mesh]]` tables name, and parts of them, each once.
    pub mesh_files: Vec<MeshFile>,
    /// Every shape, in the order of the file within its kind.
    pub objects: Vec<Object>,
    /// `[[light]]`, in the order of the file.
    pub lights: Vec<Light>,
    /// `[environment]`; it takes the place of [`Render::background`].
    pub environment: Option<Environment>,
}

/// A value with its place in the scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Bytes of the scene file.
    pub span: Range<usize>,
}

/// A mesh file, or one part of a glTF file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// The file.
    pub value: PathBuf,
    /// Bytes of the scene file that name it.
    pub span: Range<usize>,
    /// Number of the part. `None` for the whole file.
    pub part: Option<u32>,
}

/// Photon maps: read and validated, used by the integrators that have them.
#[derive(Clone, Debug, PartialEq)]
pub struct Photons {
    /// Whether the scene asks for them.
    pub enabled: bool,
    /// Photons emitted in a pass; 0 = about one for each pixel.
    pub count: u64,
    /// First gather radius; 0 = chosen from the scene's size.
    pub radius: f64,
    /// Most bounces.
    pub bounces: u32,
}
