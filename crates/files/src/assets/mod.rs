//! Reads meshes, textures and cameras. All errors include the file name and, for text files, the line.

pub mod catch_panic;
pub mod gltf;
pub mod image;
pub mod mesh;
pub mod orbiter;
mod read;

use std::path::{Path, PathBuf};

use crate::geometry::mesh::TriangleMesh;
use crate::materials::PixelValue;
use crate::math::{DVec2, Vec2, Vec3};
use crate::system::file::FileStamp;

/// Error for a file that cannot be used.
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
        /// Line number, starting at 1. `None` for files without lines.
        line: Option<usize>,
        /// The reason, as shown to the user.
        reason: String,
    },
    /// An allocation for the file's content failed.
    #[error("out of memory: cannot allocate {} MB for {}", bytes.div_ceil(1_000_000), path.display())]
    OutOfMemory {
        /// The file.
        path: PathBuf,
        /// Size of the failed allocation.
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

/// Returns the line number and reason from the error of a rejected file.
#[cfg(test)]
pub(crate) fn rejection<T: std::fmt::Debug>(result: Result<T, AssetError>) -> (Option<usize>, String) {
    match result {
        Err(AssetError::Malformed { line, reason, .. }) => (line, reason),
        Err(AssetError::Unreadable { reason, .. }) => (None, reason),
        other => panic!("expected a rejection, found {other:?}"),
    }
}

/// BLAKE3 hash of a file, computed from the decoded bytes.
pub type FileHash = [u8; 32];

/// A file referenced by an asset, such as a material library or a glTF buffer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Companion {
    /// The file.
    pub path: PathBuf,
    /// Hash of the decoded bytes. `None` if the file could not be read.
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
    /// Materials of the file, indexed by [`TriangleMesh::materials`].
    pub materials: Vec<FileMaterial>,
    /// Number of skipped faces, by reason.
    pub dropped: Dropped,
    /// Other warnings, one line each.
    pub warnings: Vec<String>,
    /// Warnings about the file's materials, one line each. Not relevant if the scene overrides the materials.
    pub material_warnings: Vec<String>,
    /// Files that affect the mesh, including missing ones: material libraries, or buffers of a glTF file.
    pub companions: Vec<Companion>,
    /// Images referenced by the material libraries or the glTF file, used or not.
    pub pictures: Vec<PathBuf>,
}

impl LoadedMesh {
    /// Whether the mesh has no normals and consists of flat faces, like a box.
    pub fn is_faceted(&self) -> bool {
        mesh::normals::is_faceted(&self.mesh)
    }

    /// Whether the mesh has triangles but no materials.
    pub fn lacks_materials(&self) -> bool {
        self.materials.is_empty() && !self.mesh.triangles.is_empty()
    }
}

/// Number of unusable faces, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Faces with a NaN or an infinite coordinate.
    pub non_finite: u64,
    /// Faces with coincident or collinear corners.
    pub degenerate: u64,
}

/// A material from an MTL or glTF file.
#[derive(Clone, Debug, PartialEq)]
pub struct FileMaterial {
    /// Name in the file.
    pub name: String,
    /// Diffuse reflectance, `Kd`.
    pub diffuse: Vec3,
    /// Specular reflectance, `Ks`: scale of the unnormalized Phong lobe.
    pub specular: Vec3,
    /// Phong exponent, `Ns`.
    pub shininess: f32,
    /// Emitted radiance, `Ke`. Scales the emission texture, if any.
    pub emission: Vec3,
    /// Index of refraction, `Ni`.
    pub ior: f32,
    /// Illumination model, `illum`.
    pub illumination_model: Option<u8>,
    /// Opacity in [0, 1]: `d`, or 1 − `Tr`.
    pub opacity: f32,
    /// Opacity texture, `map_d`. Overrides `opacity`.
    pub opacity_texture: Option<FileTexture>,
    /// Diffuse texture, `map_Kd`.
    pub diffuse_texture: Option<FileTexture>,
    /// Specular texture, `map_Ks`.
    pub specular_texture: Option<FileTexture>,
    /// Emission texture, `map_Ke`.
    pub emission_texture: Option<FileTexture>,
    /// Normal map, `norm` or `map_Bump`.
    pub normal_texture: Option<FileTexture>,
    /// Scale factor for the normal map's slopes, ≥ 0. Set by the option `-bm`, 1 by default.
    pub normal_strength: f32,
    /// Parameters of the PBR extension. `None` if the material does not use the extension.
    pub physical: Option<PhysicalMaterial>,
}

impl FileMaterial {
    /// Whether the material has a specular highlight. Illumination models 0 and 1 have none. Materials with
    /// an exponent of 0 are also excluded: their highlight would cover the hemisphere at full strength.
    pub fn has_highlight(&self) -> bool {
        self.shininess > 0.0 && !matches!(self.illumination_model, Some(0 | 1))
    }

    /// Whether the specular reflection is a coat over a diffuse texture or a stronger diffuse color.
    pub fn is_coated(&self) -> bool {
        self.diffuse_texture.is_some() || self.diffuse.max_element() > self.specular.max_element()
    }
}

/// A texture with map options in an MTL material.
#[derive(Clone, Debug, PartialEq)]
pub struct FileTexture {
    /// Image file, relative to the MTL file's folder.
    pub path: PathBuf,
    /// Scale of the texture coordinates, `-s`.
    pub repeat: Vec2,
    /// Offset added to the scaled texture coordinates, `-o`.
    pub offset: DVec2,
    /// Whether coordinates outside [0, 1] are clamped, `-clamp on`.
    pub is_clamped: bool,
    /// Offset and scale of the values, `-mm`.
    pub range: (f32, f32),
    /// Channel to read as a scalar, `-imfchan`.
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

    /// Whether both textures use the same image with the same coordinates.
    pub fn is_same_image(&self, other: &Self) -> bool {
        let at = |texture: &Self| (texture.repeat, texture.offset, texture.is_clamped);
        self.path == other.path && at(self) == at(other)
    }
}

/// PBR extension of MTL. Values are in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalMaterial {
    /// Roughness, `Pr`.
    pub roughness: f32,
    /// Metallic weight, `Pm`.
    pub metallic: f32,
    /// Clear coat weight, `Pc`.
    pub clearcoat: f32,
    /// Clear coat roughness, `Pcr`.
    pub clearcoat_roughness: f32,
    /// Roughness texture, `map_Pr`.
    pub roughness_texture: Option<FileTexture>,
    /// Metallic texture, `map_Pm`.
    pub metallic_texture: Option<FileTexture>,
}

/// A gKit orbiter camera, which orbits the scene's center.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbiterCamera {
    /// `c`: point at which the camera looks.
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
