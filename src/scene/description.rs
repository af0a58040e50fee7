//! The lowered scene: what a scene file means, with every default filled in and every invariant kept by
//! validation. Nothing here knows the file's syntax; objects refer to each other by index.
//!
//! Lengths are in the scene's unit, angles in degrees, colours linear Rec. 709. All numbers are finite.

use std::ops::Range;
use std::path::PathBuf;

use crate::choice;
pub use crate::film::tone::Tonemap;
pub use crate::lights::point::Falloff;
pub use crate::materials::texture::{TextureFilter, Wrap};
use crate::math::{DVec3, Vec2, Vec3};
pub use crate::sampling::filter::PixelFilter;

/// A whole scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The `[render]` table.
    pub render: Render,
    /// Where the picture goes, if the scene says so, resolved against the scene's folder.
    pub output: Option<PathBuf>,
    /// The `[camera]` table.
    pub camera: Camera,
    /// The `[photons]` table.
    pub photons: Photons,
    /// `[textures.*]`, in the order of the file.
    pub textures: Vec<Texture>,
    /// `[materials.*]`, in the order of the file.
    pub materials: Vec<Material>,
    /// The mesh files that `[[mesh]]` tables name, each once.
    pub mesh_files: Vec<Located<PathBuf>>,
    /// Every shape, in the order of the file within its kind.
    pub objects: Vec<Object>,
    /// `[[light]]`, in the order of the file.
    pub lights: Vec<PointLight>,
}

/// A value with its place in the scene file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Bytes of the scene file.
    pub span: Range<usize>,
}

/// Most scatterings along one path that a scene may ask for: between perfect mirrors a path ends nowhere else.
pub const MOST_SCATTERINGS: u32 = 10_000;

/// Settings of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Render {
    /// Pixels across, 1 … 65536.
    pub width: u32,
    /// Pixels down, 1 … 65536.
    pub height: u32,
    /// Most samples per pixel, ≥ 1.
    pub samples: u32,
    /// Shadow rays towards each light from each shaded point, ≥ 1.
    pub shadow_samples: u32,
    /// Scatterings along one path: 0 = emitted light only, 1 = direct light.
    pub max_depth: u32,
    /// The method.
    pub integrator: Integrator,
    /// Shadows.
    pub shadows: Shadows,
    /// Ambient radiance of the Phong model.
    pub ambient: Vec3,
    /// Radiance seen by a ray that leaves the scene.
    pub background: Vec3,
    /// Reconstruction filter.
    pub filter: PixelFilter,
    /// Stops.
    pub exposure: f32,
    /// Tone curve of 8-bit and 16-bit files.
    pub tonemap: Tonemap,
    /// Acceleration structure.
    pub accel: Accel,
    /// Seed of every random number.
    pub seed: u32,
}

choice! {
    /// Rendering methods.
    pub enum Integrator {
        /// Direct light by Phong, mirror, glass, ambient.
        Whitted = "whitted",
    }
    unavailable "path"
}

choice! {
    /// How shadows are made.
    pub enum Shadows {
        /// Nothing stops light.
        Off = "off",
        /// One ray to the middle of a light.
        Hard = "hard",
        /// The visible part of the light, sampled.
        Soft = "soft",
    }
}

choice! {
    /// Acceleration structures.
    pub enum Accel {
        /// Bounding volume hierarchy.
        Bvh = "bvh",
        /// The same, with large triangles of meshes in several of its leaves: longer to build, faster to trace where
        /// triangles are long and lie askew.
        BvhHigh = "bvh-high",
        /// kd-tree over the triangles of meshes.
        KdTree = "kdtree",
    }
}

/// The view.
#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// Given by vectors; `position` ≠ `look_at`, `up` not parallel to the view.
    LookAt {
        /// The eye.
        position: DVec3,
        /// The point in the middle of the picture.
        look_at: DVec3,
        /// Up in the picture.
        up: DVec3,
        /// Vertical whole angle in degrees, in (0, 180).
        fov: f64,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Distance along the view axis to the plane in focus, > 0.
        focus: f64,
    },
    /// A gKit orbiter file, resolved against the scene's folder.
    Orbiter {
        /// The file.
        file: Located<PathBuf>,
        /// Vertical whole angle in degrees, in (0, 180); none: the file's.
        fov: Option<f64>,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Distance to the plane in focus; none: the file's distance to its centre.
        focus: Option<f64>,
    },
}

/// Photon maps: read and validated, used by the integrators that have them.
#[derive(Clone, Debug, PartialEq)]
pub struct Photons {
    /// Whether the scene asks for them.
    pub enabled: bool,
    /// Photons emitted in a pass, ≥ 1.
    pub count: u64,
    /// First gather radius; 0 = chosen from the scene's size.
    pub radius: f64,
    /// Most bounces.
    pub bounces: u32,
}

/// An image that materials look up.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Its name in the scene.
    pub name: String,
    /// Its file, resolved against the scene's folder.
    pub file: Located<PathBuf>,
    /// Interpolation.
    pub filter: TextureFilter,
    /// Outside [0, 1].
    pub wrap: Wrap,
    /// How often it fits into u and v; not 0.
    pub repeat: Vec2,
    /// What its numbers are.
    pub encoding: Encoding,
}

choice! {
    /// What a texture's numbers are.
    pub enum Encoding {
        /// sRGB for 8-bit colour, linear for normal maps and float files.
        Auto = "auto",
        /// sRGB, decoded.
        Srgb = "srgb",
        /// Used as they are.
        Linear = "linear",
    }
}

/// A colour or a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorSource {
    /// The same everywhere.
    Constant(Vec3),
    /// Index into [`Scene::textures`].
    Texture(usize),
}

/// A named material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the scene.
    pub name: String,
    /// What it does.
    pub kind: MaterialKind,
}

/// What a material does.
#[derive(Clone, Debug, PartialEq)]
pub enum MaterialKind {
    /// Normalised Phong.
    Phong {
        /// kd.
        diffuse: ColorSource,
        /// ks.
        specular: ColorSource,
        /// α ≥ 0.
        shininess: f32,
        /// ka; none: the diffuse colour.
        ambient: Option<ColorSource>,
        /// Radiance on the front side.
        emission: Vec3,
        /// Index into [`Scene::textures`] of a tangent-space normal map, and its strength ≥ 0.
        normal_map: Option<(usize, f32)>,
    },
    /// A perfect mirror of this reflectance in [0, 1].
    Mirror {
        /// Reflectance.
        reflectance: Vec3,
    },
    /// Smooth dielectric.
    Glass {
        /// Index of refraction inside, in [0.1, 10]; below 1: thinner than what is outside, as a bubble in water.
        ior: f32,
        /// Transmittance per unit of length inside, in [0, 1].
        tint: Vec3,
    },
}

impl MaterialKind {
    /// Radiance of the front side.
    pub fn emission(&self) -> Vec3 {
        match self {
            Self::Phong { emission, .. } => *emission,
            Self::Mirror { .. } | Self::Glass { .. } => Vec3::ZERO,
        }
    }
}

/// A shape with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// The geometry.
    pub shape: Shape,
    /// Index into [`Scene::materials`]; none: the mesh file's own.
    pub material: Option<usize>,
    /// The table in the file.
    pub span: Range<usize>,
}

/// The geometry of an object.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// All points at `radius` > 0 from `center`.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// corner + s·u + t·v, s and t in [0, 1]; u × v ≠ 0, front along it.
    Quad {
        /// Corner.
        corner: DVec3,
        /// First edge.
        u: DVec3,
        /// Second edge.
        v: DVec3,
    },
    /// Infinite.
    Plane {
        /// A point of it.
        point: DVec3,
        /// Its front; not 0, any length.
        normal: DVec3,
    },
    /// An oriented box.
    Box {
        /// Centre.
        center: DVec3,
        /// Edge lengths, > 0.
        size: DVec3,
        /// Degrees about x, then y, then z.
        rotate: DVec3,
    },
    /// Front along (b − a) × (c − a) ≠ 0.
    Triangle {
        /// Corner.
        a: DVec3,
        /// Corner.
        b: DVec3,
        /// Corner.
        c: DVec3,
    },
    /// Flat and round.
    Disk {
        /// Centre.
        center: DVec3,
        /// Its front; not 0, any length.
        normal: DVec3,
        /// Radius > 0.
        radius: f64,
    },
    /// A round bar, or a tube.
    Cylinder {
        /// An end of its axis.
        a: DVec3,
        /// The other end, elsewhere.
        b: DVec3,
        /// Radius > 0.
        radius: f64,
        /// Whether the ends are closed.
        caps: bool,
    },
    /// Round, with a tip.
    Cone {
        /// Middle of its base.
        base: DVec3,
        /// Its tip, elsewhere.
        tip: DVec3,
        /// Radius > 0 of the base.
        radius: f64,
        /// Whether the base is closed.
        cap: bool,
    },
    /// A ring of a round tube.
    Torus {
        /// Centre.
        center: DVec3,
        /// The axis that it goes around; not 0, any length.
        axis: DVec3,
        /// Radius of the circle in the middle of the tube, > `tube`.
        radius: f64,
        /// Radius of the tube, > 0.
        tube: f64,
    },
    /// An instance of a mesh file.
    Mesh {
        /// Index into [`Scene::mesh_files`].
        file: usize,
        /// Applied first; no component 0.
        scale: DVec3,
        /// Then this, degrees about x, then y, then z.
        rotate: DVec3,
        /// Then this.
        translate: DVec3,
        /// Interpolate vertex normals.
        smooth: bool,
    },
}

impl Shape {
    /// Index into [`Scene::mesh_files`] of the file that it is an instance of, if it is a mesh.
    pub fn mesh_file(&self) -> Option<usize> {
        match self {
            Self::Mesh { file, .. } => Some(*file),
            Self::Sphere { .. }
            | Self::Quad { .. }
            | Self::Plane { .. }
            | Self::Box { .. }
            | Self::Triangle { .. }
            | Self::Disk { .. }
            | Self::Cylinder { .. }
            | Self::Cone { .. }
            | Self::Torus { .. } => None,
        }
    }
}

/// A light without extent.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Where.
    pub position: DVec3,
    /// W·sr⁻¹; with [`Falloff::None`] irradiance at normal incidence.
    pub intensity: Vec3,
    /// How it weakens with distance.
    pub falloff: Falloff,
}
