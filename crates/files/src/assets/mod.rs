//! Assets: from bytes to meshes, textures and cameras. Every error names the file and, if the file has lines, the line.

pub mod contain;
pub mod gltf;
pub mod image;
pub mod mesh;
pub mod orbiter;
mod read;

use std::path::{Path, PathBuf};

use crate::geometry::mesh::TriangleMesh;
use crate::materials::PixelValue;
use crate::math::{DVec2, Vec2, Vec3};

/// Reasons for which a file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum AssetError {
    /// The file could not be read, or is not a regular file.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reason, in words.
        reason: String,
    },
    /// The content of the file is wrong.
    #[error("{}{}: {reason}", path.display(), line.map_or(String::new(), |line| format!(":{line}")))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, from 1. `None` for files without lines.
        line: Option<usize>,
        /// The reason, in words.
        reason: String,
    },
    /// There is not enough memory for its content.
    #[error("out of memory: {} MB for {} were refused", bytes.div_ceil(1_000_000), path.display())]
    OutOfMemory {
        /// The file.
        path: PathBuf,
        /// Size of the refused allocation.
        bytes: usize,
    },
    /// The work was cancelled.
    #[error("cancelled")]
    Cancelled(#[from] crate::control::Cancelled),
}

impl AssetError {
    pub(crate) fn unreadable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unreadable { path: path.to_owned(), reason: reason.into() }
    }

    pub(crate) fn malformed(path: &Path, line: Option<usize>, reason: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), line, reason: reason.into() }
    }
}

/// BLAKE3 hash of a file's bytes, computed from the same bytes that are decoded.
pub type FileHash = [u8; 32];

/// A file that another file names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Companion {
    /// The file.
    pub path: PathBuf,
    /// Hash of the bytes that were decoded. `None` if the file could not be read.
    pub hash: Option<FileHash>,
}

/// A mesh file's content.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadedMesh {
    /// Hash of the file.
    pub hash: FileHash,
    /// The triangles that can be used.
    pub mesh: TriangleMesh,
    /// The file's own materials, which [`TriangleMesh::materials`] refers to.
    pub materials: Vec<FileMaterial>,
    /// Faces that were left out.
    pub dropped: Dropped,
    /// Other warnings, a line each.
    pub warnings: Vec<String>,
    /// Warnings about its own materials, a line each; they do not matter if the scene gives the mesh another material.
    pub material_warnings: Vec<String>,
    /// Files that belong to the mesh file, read or missing: material libraries, or the buffers of a glTF file. If one of them
    /// changes, so does this value.
    pub companions: Vec<Companion>,
    /// Pictures that the material libraries or the glTF file name, looked up or not.
    pub pictures: Vec<PathBuf>,
}

impl LoadedMesh {
    /// Whether it has no normals and is of flat faces, as a box is.
    pub fn is_faceted(&self) -> bool {
        mesh::normals::is_faceted(&self.mesh)
    }

    /// Whether there are triangles and no material for any of them.
    pub fn lacks_materials(&self) -> bool {
        self.materials.is_empty() && !self.mesh.triangles.is_empty()
    }
}

/// Faces that could not be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Faces with a NaN or an infinite coordinate.
    pub non_finite: u64,
    /// Faces with two corners at one place, or all corners on a line.
    pub degenerate: u64,
}

/// A material of a mesh file (MTL).
#[derive(Clone, Debug, PartialEq)]
pub struct FileMaterial {
    /// Its name in the file.
    pub name: String,
    /// Diffuse reflectance, `Kd`.
    pub diffuse: Vec3,
    /// Specular reflectance, `Ks`: the strength of the classic highlight without normalisation.
    pub specular: Vec3,
    /// Exponent, `Ns`.
    pub shininess: f32,
    /// Emission, `Ke`: radiance; with a texture, the factor on it.
    pub emission: Vec3,
    /// Index of refraction, `Ni`.
    pub ior: f32,
    /// Illumination model, `illum`.
    pub illumination_model: Option<u8>,
    /// Opacity in [0, 1], `d` or else 1 − `Tr`.
    pub opacity: f32,
    /// Texture of the opacity, `map_d`, in its place.
    pub opacity_texture: Option<FileTexture>,
    /// Diffuse texture, `map_Kd`.
    pub diffuse_texture: Option<FileTexture>,
    /// Specular texture, `map_Ks`.
    pub specular_texture: Option<FileTexture>,
    /// Emission texture, `map_Ke`.
    pub emission_texture: Option<FileTexture>,
    /// Normal map, `norm` or `map_Bump`.
    pub normal_texture: Option<FileTexture>,
    /// Factor on its slopes, ≥ 0: the option `-bm`, or 1.
    pub normal_strength: f32,
    /// What the extension for physically based rendering says. `None` without any of its statements.
    pub physical: Option<PhysicalMaterial>,
}

impl FileMaterial {
    /// Whether it has a highlight. Without an exponent above 0 it would be spread over the hemisphere at full strength; the models 0 and 1
    /// have none.
    pub fn has_highlight(&self) -> bool {
        self.shininess > 0.0 && !matches!(self.illumination_model, Some(0 | 1))
    }

    /// Whether its mirror is a coat over a stronger diffuse color.
    pub fn is_coated(&self) -> bool {
        self.diffuse_texture.is_some() || self.diffuse.max_element() > self.specular.max_element()
    }
}

/// A texture of a mesh file's material, with the options of its map.
#[derive(Clone, Debug, PartialEq)]
pub struct FileTexture {
    /// The image, relative to the MTL's folder.
    pub path: PathBuf,
    /// Factor on the coordinates, `-s`.
    pub repeat: Vec2,
    /// Translation of the repeated coordinates, `-o`.
    pub offset: DVec2,
    /// Whether the border continues, `-clamp on`.
    pub is_clamped: bool,
    /// Summand and factor of the values, `-mm`.
    pub range: (f32, f32),
    /// The number of a pixel, if it is asked for: `-imfchan`.
    pub number: Option<PixelValue>,
}

impl FileTexture {
    /// A texture without options.
    pub fn new(path: PathBuf) -> Self {
        Self {
            path,
            repeat: Vec2::ONE,
            offset: DVec2::ZERO,
            is_clamped: false,
            range: (0.0, 1.0),
            number: None,
        }
    }

    /// Whether another texture shows the same image at the same coordinates.
    pub fn is_same_image(&self, other: &Self) -> bool {
        let at = |texture: &Self| (texture.repeat, texture.offset, texture.is_clamped);
        self.path == other.path && at(self) == at(other)
    }
}

/// The extension of MTL for physically based rendering. Numbers are in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalMaterial {
    /// Roughness, `Pr`.
    pub roughness: f32,
    /// Weight of the metal, `Pm`.
    pub metallic: f32,
    /// Weight of a clear coat, `Pc`.
    pub clearcoat: f32,
    /// Roughness of the clear coat, `Pcr`.
    pub clearcoat_roughness: f32,
    /// Texture of the roughness, `map_Pr`.
    pub roughness_texture: Option<FileTexture>,
    /// Texture of the metal's weight, `map_Pm`.
    pub metallic_texture: Option<FileTexture>,
}

/// A gKit orbiter camera: the scene's centre seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbiterCamera {
    /// `c`: centre of the view.
    pub center: [f64; 3],
    /// `p`: offset in the picture's plane.
    pub position: [f64; 2],
    /// `r`: rotation in degrees, about x and y.
    pub rotation: [f64; 2],
    /// `s`: distance to the centre, and the scene's radius.
    pub size: f64,
    /// Second number of `s`.
    pub radius: f64,
    /// `f`: vertical angle in degrees.
    pub fov: f64,
    /// Second and third number of `f`: size in pixels.
    pub width: f64,
    /// Pixels down.
    pub height: f64,
}
