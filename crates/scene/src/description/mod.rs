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
mod texture;
mod transform;

use std::collections::HashSet;
use std::ops::Range;
use std::path::PathBuf;

pub use camera::{
    Camera, CameraOverrides, ImageShiftAndMirror, Pose, Projection, ProjectionKind, ResolvedCamera,
    is_same_distance,
};
pub use light::{Environment, Light, MapOrientation, MapRowPlacement, Sky};
pub use material::{
    Bump, Channel, ChannelSelector, CoatSource, ColorSource, ConductorFresnelSource, EmissionSides,
    EmissionSource, Material, MaterialKind, MicrofacetDistribution, NormalMap, NumberSource, OpacitySource,
    PhongParameters, PixelInterpretation, ReflectingSides, TextureRole,
};
pub use method::{Integrator, IntegratorProperties};
pub use render::{Accel, MAX_BOUNCES, PixelFilter, RenderOptions, ShadowMode, Tonemap, render_keys};
pub use shape::{LoweredShape, MeshReference, Object, OpenSurface, Shape, max_projection};
pub use texture::{
    ImageSource, Pattern, Texture, TextureEncoding, TextureFilter, TextureSource, UvSet, Wrap,
};
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
    /// All shapes, in file order. The objects of each [`Instance`] are consecutive.
    pub objects: Vec<Object>,
    /// The top-level `[[instance]]` tables, in file order.
    pub instances: Vec<Instance>,
    /// `[[light]]`, in file order.
    pub lights: Vec<Light>,
    /// `[environment]`, which replaces [`RenderOptions::background`].
    pub environment: Option<Environment>,
}

/// A copy of a group, including all groups nested in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    /// Indices of the copied objects in [`Scene::objects`].
    pub objects: Range<usize>,
    /// Value of the key `name`, if any.
    pub name: Option<Box<str>>,
    /// Byte range of the table header in the file.
    pub span: Range<usize>,
}

impl Scene {
    /// Returns the instance that contains an object, or `None` if the object is not in a group.
    pub fn instance_containing(&self, object: usize) -> Option<&Instance> {
        let index = self.instances.partition_point(|instance| instance.objects.end <= object);
        self.instances.get(index).filter(|instance| instance.objects.contains(&object))
    }

    /// Returns a filter that accepts only the first copy of each object in a group, so that a problem in a
    /// group is reported once. Accepts all objects outside of groups.
    pub fn first_copy_filter(&self) -> impl FnMut(usize) -> bool {
        let mut known = HashSet::new();
        move |object| self.instances.is_empty() || known.insert(self.objects[object].span.start)
    }
}

/// A value and its span in the scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Spanned<T> {
    /// The value.
    pub value: T,
    /// Byte range in the scene file.
    pub span: Range<usize>,
}

/// A mesh file, or one part of a glTF file, after subdivision.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MeshFile {
    /// Path of the file.
    pub value: PathBuf,
    /// Byte range of the path in the scene file.
    pub span: Range<usize>,
    /// Index of the glTF part. `None` means the whole file.
    pub part: Option<u32>,
    /// Number of subdivision levels.
    pub subdivide: u32,
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
