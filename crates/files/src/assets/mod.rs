//! Bytes → meshes, textures and cameras. Every error names the file and, where it has lines, the line.

pub mod contain;
pub mod image;
pub mod mesh;
pub mod orbiter;
mod read;

use std::path::{Path, PathBuf};

use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;

/// Why a file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum AssetError {
    /// The file could not be read, or is no file.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// In words.
        reason: String,
    },
    /// The file was read and is not what it should be.
    #[error("{}{}: {reason}", path.display(), line.map_or(String::new(), |line| format!(":{line}")))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, from 1, in files that have lines.
        line: Option<usize>,
        /// In words.
        reason: String,
    },
    /// There is no memory for its content.
    #[error("out of memory: {} MB for {} were refused", bytes.div_ceil(1_000_000), path.display())]
    OutOfMemory {
        /// The file.
        path: PathBuf,
        /// Size of what was refused.
        bytes: usize,
    },
    /// The work was told to stop.
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

/// A mesh file's content.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadedMesh {
    /// The triangles that can be used.
    pub mesh: TriangleMesh,
    /// The file's own materials, which [`TriangleMesh::materials`] refers to.
    pub materials: Vec<FileMaterial>,
    /// What was left out.
    pub dropped: Dropped,
    /// Anything else worth saying, a line each.
    pub warnings: Vec<String>,
    /// What its own materials lack, a line each: of no account where the scene gives it another one.
    pub material_warnings: Vec<String>,
    /// Files that were read besides the mesh file, or should have been: material libraries. When one of them
    /// changes, so does this value.
    pub companions: Vec<PathBuf>,
    /// Pictures that the material libraries name, looked up or not.
    pub pictures: Vec<PathBuf>,
}

impl LoadedMesh {
    /// Whether there are triangles and no material for any of them.
    pub fn lacks_materials(&self) -> bool {
        self.materials.is_empty() && !self.mesh.triangles.is_empty()
    }
}

/// Faces that could not be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// With a NaN or an infinite coordinate.
    pub non_finite: u64,
    /// With two corners at one place, or all on a line.
    pub degenerate: u64,
}

/// A material as a mesh file (MTL) has it.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMaterial {
    /// Its name there.
    pub name: String,
    /// Kd.
    pub diffuse: Vec3,
    /// Ks, the strength of the classic highlight without normalisation.
    pub specular: Vec3,
    /// Ns.
    pub shininess: f32,
    /// Ke, radiance; with a texture, what that is multiplied by.
    pub emission: Vec3,
    /// Ni.
    pub ior: f32,
    /// illum.
    pub illumination_model: Option<u8>,
    /// map_Kd, resolved against the MTL's folder.
    pub diffuse_texture: Option<PathBuf>,
    /// map_Ks.
    pub specular_texture: Option<PathBuf>,
    /// map_Ke.
    pub emission_texture: Option<PathBuf>,
    /// norm or map_Bump, read as a normal map.
    pub normal_texture: Option<PathBuf>,
}

/// A gKit orbiter camera: the scene's centre seen from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbiterCamera {
    /// `c`: the centre that is looked at.
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
    /// Second and third number of `f`: pixels.
    pub width: f64,
    /// Pixels down.
    pub height: f64,
}
