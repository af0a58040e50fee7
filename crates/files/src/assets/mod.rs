//! Reads meshes, textures and cameras. All errors include the file name and, for text files, the line.

pub mod catch_panic;
mod file_material;
pub mod gltf;
mod gzip;
pub mod image;
pub mod mesh;
pub mod orbiter;
mod read;
mod text_file;

use std::io;
use std::path::{Path, PathBuf};

use crate::control::{CancelToken, Canceled};
use crate::geometry::mesh::TriangleMesh;
use crate::system::file::FileStamp;
use crate::system::{RAISE_FILE_LIMIT, describe_io_error, is_too_many_open_files};

pub use gzip::{GzipFile, read_gzip_file};
pub use text_file::{TextFile, read_text_file};

pub use file_material::{FileLine, FileMaterial, FileMaterialKind, FileTexture, PhysicalMaterial};

/// Lists the files that a mesh or glTF file references, without loading them. Returns an empty list for other
/// formats and unreadable files.
///
/// # Errors
/// Returns [`Canceled`] if the token is canceled.
pub fn referenced_files(path: &Path, token: &CancelToken) -> Result<Vec<PathBuf>, Canceled> {
    if gltf::has_gltf_extension(path) {
        gltf::referenced_files(path, token)
    } else {
        mesh::referenced_files(path, token)
    }
}

/// Reason why a file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AssetError {
    /// The file could not be read, or is not a regular file.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The reason, as shown to the user.
        reason: String,
    },
    /// The file's content is invalid.
    #[error("{}{}: {reason}", path.display(), line.map_or(String::new(), |line| format!(":{line}")))]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line number, starting at 1, or `None` for files without lines.
        line: Option<usize>,
        /// The reason, as shown to the user.
        reason: String,
    },
    /// There was not enough memory for the file's content.
    #[error("out of memory: cannot allocate {} MB for {}", bytes.div_ceil(1_000_000), path.display())]
    OutOfMemory {
        /// The file.
        path: PathBuf,
        /// Size of the failed allocation.
        bytes: usize,
    },
    /// A computation on the file's content would exceed the memory limit.
    #[error("{}: {message}", path.display())]
    MemoryLimit {
        /// The file.
        path: PathBuf,
        /// The reason, as shown to the user.
        message: String,
    },
    /// Too many files are open in the process or the system. Other files would have the same problem.
    #[error("cannot read {}: too many open files; {RAISE_FILE_LIMIT}", path.display())]
    TooManyOpenFiles {
        /// The file.
        path: PathBuf,
    },
    /// The work was canceled.
    #[error("canceled")]
    Canceled(#[from] Canceled),
}

impl AssetError {
    pub(crate) fn unreadable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unreadable { path: path.to_owned(), reason: reason.into() }
    }

    /// Creates the error for a file that the system cannot read.
    pub fn from_io(path: &Path, error: &io::Error) -> Self {
        match is_too_many_open_files(error) {
            true => Self::TooManyOpenFiles { path: path.to_owned() },
            false => Self::unreadable(path, describe_io_error(error)),
        }
    }

    /// Creates the error for a file with invalid content.
    pub fn malformed(path: &Path, line: Option<usize>, reason: impl Into<String>) -> Self {
        Self::Malformed { path: path.to_owned(), line, reason: reason.into() }
    }
}

/// Returns the line number and reason from the error for a rejected file.
#[cfg(test)]
pub(crate) fn expect_rejection<T: std::fmt::Debug>(result: Result<T, AssetError>) -> (Option<usize>, String) {
    match result {
        Err(AssetError::Malformed { line, reason, .. }) => (line, reason),
        Err(AssetError::Unreadable { reason, .. }) => (None, reason),
        other => panic!("expected a rejection, found {other:?}"),
    }
}

/// BLAKE3 hash of a file, computed from the bytes that were decoded.
pub type FileHash = [u8; 32];

/// A file referenced by an asset, such as a material library or a glTF buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Companion {
    /// The file.
    pub path: PathBuf,
    /// Hash of the bytes that were decoded, or `None` if the file could not be read.
    pub hash: Option<FileHash>,
    /// Stamp of the file, taken before it was read.
    pub stamp: Option<FileStamp>,
}

/// A decoded mesh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadedMesh {
    /// Hash of the file.
    pub hash: FileHash,
    /// Triangles of all usable faces.
    pub mesh: TriangleMesh,
    /// Materials from the file, indexed by [`TriangleMesh::materials`].
    pub materials: Vec<FileMaterial>,
    /// Number of skipped faces, by reason.
    pub dropped: DroppedFaces,
    /// Other warnings, one line each.
    pub warnings: Vec<String>,
    /// Warnings about the file's materials, one line each. Irrelevant if the scene overrides the materials.
    pub material_warnings: Vec<String>,
    /// Other files that affect the mesh, including missing ones: material libraries or glTF buffers.
    pub companions: Vec<Companion>,
    /// Images referenced by the material libraries or the glTF file, including unused ones.
    pub pictures: Vec<PathBuf>,
}

impl LoadedMesh {
    /// Whether the mesh has no normals and consists of flat faces, like a box.
    pub fn is_polyhedral_without_normals(&self) -> bool {
        mesh::normals::is_polyhedral_without_normals(&self.mesh)
    }

    /// Whether the mesh has triangles but no materials.
    pub fn lacks_materials(&self) -> bool {
        self.materials.is_empty() && !self.mesh.triangles.is_empty()
    }
}

/// Number of unusable faces, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DroppedFaces {
    /// Faces with a NaN or an infinite coordinate.
    pub non_finite: u64,
    /// Faces with coincident or collinear corners.
    pub degenerate: u64,
}

/// A gKit orbiter camera, which orbits the scene's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GkitOrbiterCamera {
    /// `c`: point that the camera looks at.
    pub center: [f64; 3],
    /// `p`: offset in the image plane.
    pub position: [f64; 2],
    /// `r`: rotation in degrees, about x and y.
    pub rotation: [f64; 2],
    /// `s`: distance to the center.
    pub size: f64,
    /// Second number of `s`: radius of the scene.
    pub radius: f64,
    /// `f`: vertical field of view in degrees.
    pub fov: f64,
    /// Second number of `f`: width in pixels.
    pub width: f64,
    /// Third number of `f`: height in pixels.
    pub height: f64,
}
