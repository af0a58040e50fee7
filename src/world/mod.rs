//! Everything ready to trace: immutable, shared by `Arc`.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use crate::assets::{LoadedMesh, OrbiterCamera};
use crate::control::{CancelToken, Cancelled};
use crate::materials::texels::Texels;
use crate::math::Vec3;
use crate::scene::description::Scene;

/// The tree over one mesh file's triangles with the triangles themselves; shared by every instance.
#[derive(Debug)]
pub struct MeshTree {
    _mesh: Arc<LoadedMesh>,
}

impl MeshTree {
    /// Build it; vertex normals are computed where the file has none.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn build(mesh: Arc<LoadedMesh>, token: &CancelToken) -> Result<Self, Cancelled> {
        token.check()?;
        Ok(Self { _mesh: mesh })
    }

    /// Bytes held by the tree.
    pub fn memory_bytes(&self) -> usize {
        0
    }
}

/// What a world is made of.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// One for each of [`Scene::mesh_files`].
    pub meshes: Vec<Arc<MeshTree>>,
    /// The texels of textures that are needed, by what [`textures_needed`] said.
    pub textures: HashMap<TextureSource, Arc<Texels>>,
    /// Where the scene's camera is an orbiter file: that file.
    pub orbiter: Option<OrbiterCamera>,
}

/// An image file that a world looks up, and how its numbers are read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct TextureSource {
    /// The file.
    pub path: PathBuf,
    /// True: sRGB bytes are decoded.
    pub encoding: SourceEncoding,
}

/// How the numbers of an image file are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SourceEncoding {
    /// 8-bit files are sRGB, others linear.
    Color,
    /// Always sRGB.
    Srgb,
    /// Always linear.
    Linear,
}

/// The image files that visible surfaces look up, each with its name for progress bars and, for textures of the
/// scene file, its index there. Textures that no visible material names are not among them.
pub fn textures_needed(scene: &Scene, meshes: &[Arc<LoadedMesh>]) -> Vec<NeededTexture> {
    let _ = (scene, meshes);
    Vec::new()
}

/// An image file that is needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NeededTexture {
    /// File and encoding.
    pub source: TextureSource,
    /// Its name on progress bars.
    pub name: String,
    /// Index into [`Scene::textures`]; none: a mesh file's own texture.
    pub declared: Option<usize>,
    /// Index into [`Scene::mesh_files`] of the mesh whose material names it.
    pub mesh_file: Option<usize>,
}

/// A scene that can be traced.
#[derive(Debug)]
pub struct World {
    /// Radiance seen by rays that leave.
    pub background: Vec3,
}

impl World {
    /// Put the parts together and build the tree over all objects, or take over those of `reuse` whose inputs
    /// are equal.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn assemble(
        scene: &Scene,
        parts: &Parts,
        reuse: Option<&Self>,
        token: &CancelToken,
    ) -> Result<Self, Cancelled> {
        let _ = (parts, reuse);
        token.check()?;
        Ok(Self { background: scene.render.background })
    }

    /// Whether the camera has a lens of some size.
    pub fn has_lens(&self) -> bool {
        false
    }

    /// Lights of any kind.
    pub fn light_count(&self) -> usize {
        0
    }

    /// Triangles over all mesh instances and single triangles.
    pub fn triangle_count(&self) -> u64 {
        0
    }

    /// Shapes of any kind; a mesh instance counts as one.
    pub fn object_count(&self) -> u64 {
        0
    }

    /// Bytes held by all trees, shared ones once.
    pub fn accel_memory_bytes(&self) -> usize {
        0
    }
}
