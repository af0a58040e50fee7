//! Everything ready to trace: immutable, shared by `Arc`.

mod along;
mod around;
mod assemble;
mod bodies;
pub mod camera;
pub mod contact;
mod emitters;
mod few;
pub mod geometry;
mod isolated;
mod lower;
mod merged;
mod mesh_instance;
mod mesh_rows;
pub mod mesh_tree;
mod object;
mod origin;
mod packet;
pub mod textures;
mod triangle_tree;

use std::collections::HashMap;
use std::sync::Arc;

pub use crate::accel::{Cell, Loops, PACKET, Stretch};
pub use bodies::{Bodies, OpenGlass};
pub use camera::Camera;
pub use contact::{Meeting, Near, NearMemory, Sides};
pub use emitters::{lights, photon_source, sky};
pub use geometry::{Geometry, Hit};
pub use lower::file_emits;
pub use merged::MergedMeshes;
pub use mesh_instance::MeshInstance;
pub use mesh_tree::MeshTree;
pub use object::Object;
pub use origin::origin;
pub use textures::{
    Lookups, NeededTexture, TextureSource, declared_source, environment_source, textures_needed,
};

use crate::assets::OrbiterCamera;
use crate::lights::Lights;
use crate::materials::texels::Texels;
use crate::materials::{Bsdf, Material, Mipmaps, Rough};
use crate::scene::description;

/// The images of a scene.
pub type Images = HashMap<TextureSource, Image>;

/// A decoded image.
#[derive(Clone, Debug)]
pub struct Image {
    /// The image.
    pub texels: Arc<Texels>,
    /// Its mip levels. `None` if no texture needs them.
    pub mipmaps: Option<Arc<Mipmaps>>,
}

/// Parts of a world.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// One tree for each of [`crate::scene::description::Scene::mesh_files`].
    pub meshes: Vec<Arc<MeshTree>>,
    /// The images that [`textures_needed`] named.
    pub images: Images,
    /// The orbiter file of the scene's camera. `None` if the scene has a camera of its own.
    pub orbiter: Option<OrbiterCamera>,
    /// A camera in place of the scene's.
    pub camera: Option<description::Camera>,
    /// The bodies of glass, if they were found before.
    pub bodies: Option<Arc<Bodies>>,
}

/// A scene that can be traced.
#[derive(Debug)]
pub struct World {
    /// The camera.
    pub camera: Camera,
    /// Objects under their tree.
    pub geometry: Arc<Geometry>,
    /// Materials; objects refer to them by index.
    pub materials: Vec<Material>,
    /// Material of each object, or the range of a mesh file's own materials.
    object_materials: Vec<ObjectMaterial>,
    /// Lights of every kind.
    pub lights: Arc<Lights>,
    /// Bodies of glass: which surfaces belong together.
    bodies: Arc<Bodies>,
    /// Whether any body of glass is open.
    has_open_glass: bool,
    /// The closed shapes of glass that the lens may be in, with their materials.
    glass_at_eye: Vec<(u32, u32)>,
    /// Whether any material has a texture with mip levels.
    is_mipmapped: bool,
}

/// Map from an object to its material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ObjectMaterial {
    /// One material for all of the object.
    One(u32),
    /// Materials of the file, one for each triangle, counted from here.
    OfFile {
        /// Index of the file's first material.
        first: u32,
        /// Material of triangles that name none.
        fallback: u32,
    },
}

impl World {
    /// Index of the material at a hit.
    pub fn material_index(&self, hit: &Hit) -> usize {
        match self.object_materials[hit.object as usize] {
            ObjectMaterial::One(index) => index as usize,
            ObjectMaterial::OfFile { first, fallback } => {
                let own = self.geometry.file_material(hit);
                own.map_or(fallback, |own| first + own) as usize
            }
        }
    }

    /// The materials that an object may have anywhere.
    pub fn materials_of(&self, object: u32) -> impl Iterator<Item = &Material> {
        let (first, count, one) = match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => (0, 0, index),
            ObjectMaterial::OfFile { first, fallback } => {
                let mesh = self.geometry.objects()[object as usize].mesh();
                (first, mesh.map_or(0, |mesh| mesh.tree.loaded().materials.len()), fallback)
            }
        };
        self.materials[first as usize..][..count].iter().chain(self.materials.get(one as usize))
    }

    /// The material of an object and its rough BSDF. `None` if anything bends its normals, its emission is textured, or rows are
    /// not filled with the BSDF.
    pub fn plain_rough(&self, object: u32) -> Option<(&Material, &Rough)> {
        let material = match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => &self.materials[index as usize],
            ObjectMaterial::OfFile { .. } => return None,
        };
        if material.normal_map.is_some() || material.emission.texture.is_some() {
            return None;
        }
        match &material.bsdf {
            Bsdf::Rough(rough) => rough.fills_rows().then_some((material, rough)),
            Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Coated(_) => None,
        }
    }

    /// The material of all of an object. `None` if it needs more of a surface than rows of surfaces hold: texture coordinates or
    /// tangents.
    pub fn untextured(&self, object: u32) -> Option<&Material> {
        match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => {
                Some(&self.materials[index as usize]).filter(|material| !material.is_textured())
            }
            ObjectMaterial::OfFile { .. } => None,
        }
    }

    /// Whether an object has texture coordinates of its own, in place of barycentric ones.
    pub fn has_coordinates(&self, object: u32) -> bool {
        let mesh = self.geometry.objects()[object as usize].mesh();
        mesh.is_none_or(|mesh| !mesh.tree.loaded().mesh.uvs.is_empty())
    }

    /// Whether any material has a texture with mip levels, for which rays must know the width of their beams.
    pub fn is_mipmapped(&self) -> bool {
        self.is_mipmapped
    }

    /// Number of triangles over all mesh instances and single triangles.
    pub fn triangle_count(&self) -> u64 {
        self.geometry.objects().iter().map(Object::triangle_count).sum()
    }

    /// Number of shapes of any kind; a mesh instance counts as one.
    pub fn object_count(&self) -> u64 {
        self.geometry.objects().len() as u64
    }

    /// Bytes of all trees, shared ones counted once.
    pub fn accel_memory_bytes(&self) -> usize {
        self.geometry.memory_bytes()
    }
}
