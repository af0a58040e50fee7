//! Everything ready to trace: immutable, shared by `Arc`.

mod along;
mod around;
mod assemble;
mod bodies;
pub mod camera;
pub mod contact;
mod coplanar;
mod dark;
mod emitters;
mod few;
pub mod geometry;
mod inside;
mod isolated;
mod lower;
mod merged;
mod mesh_facet;
mod mesh_instance;
mod mesh_rows;
pub mod mesh_tree;
mod object;
mod origin;
mod packet;
mod placement;
mod plain;
mod straight;
pub mod textures;
mod triangle_tree;

use std::collections::HashMap;
use std::sync::Arc;

pub use crate::accel::{PACKET_SIZE, RayInterval, SimdKernel, TreeNode};
pub use bodies::{Bodies, OpenGlass};
pub use camera::Camera;
pub use contact::{Meeting, Near, NearMemory, Sides};
pub use coplanar::{Coplanar, coplanar_lights, with_lifted_lights};
pub use dark::LampBox;
pub use emitters::{lights, photon_source, sky};
pub use geometry::{Geometry, Hit};
pub use inside::BodyInParts;
pub use lower::{file_emits, file_is_glass};
pub use merged::MergedMeshes;
pub use mesh_instance::MeshInstance;
pub use mesh_tree::MeshTree;
pub use object::Object;
pub use origin::origin;
pub use plain::PlainMaterial;
pub use straight::{MOST_STRAIGHT, Weakened};
pub use textures::{
    Cutoff, Lookups, NeededTexture, TextureSource, environment_source, material_source, textures_needed,
};

use crate::assets::OrbiterCamera;
use crate::geometry::SurfacePoint;
use crate::geometry::packet::lanes;
use crate::lights::Lights;
use crate::materials::texels::Texels;
use crate::materials::{Footprint, Material, Mipmaps, SecondPoint, TexturePoint};
use crate::math::Vec3;
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
    /// What rows need to know of each material that is plain.
    plain: Box<[Option<PlainMaterial>]>,
    /// Whether the lobes of any material depend on the direction of texture coordinates.
    has_directions: bool,
    /// [`Material::is_textured`] of each material.
    textured: Box<[bool]>,
    /// Material of each object, or the range of a mesh file's own materials.
    object_materials: Vec<ObjectMaterial>,
    /// Lights of every kind.
    pub lights: Arc<Lights>,
    /// Bodies of glass: which surfaces belong together.
    bodies: Arc<Bodies>,
    /// Whether any body of glass is open.
    has_open_glass: bool,
    /// Whether any material is glass.
    has_glass: bool,
    /// Whether the surface of any glass is rough.
    has_rough_glass: bool,
    /// Whether each object is the place of a body of glass without a lamp in it; empty without rough glass.
    dark_bodies: Box<[bool]>,
    /// The closed shapes of glass that the lens may be in, with their materials.
    glass_at_eye: Vec<(u32, u32)>,
    /// The other bodies of glass that the camera is in, with their materials.
    bodies_at_eye: Vec<(u32, u32)>,
    /// [`Material::is_mipmapped`] of each material.
    mipmapped: Box<[bool]>,
    /// Whether any texture is looked up by a mesh's second set of coordinates.
    has_second_uvs: bool,
    /// Whether the vertex colours of each object count. `None` if those of none do.
    colored: Option<Box<[bool]>>,
    /// Objects that light may pass straight on. `None` if there are none.
    passable: Option<Box<straight::Passable>>,
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
                let own = self.geometry.file_material(hit.object, hit.shape.primitive);
                own.map_or(fallback, |own| first + own) as usize
            }
        }
    }

    /// Name of the material that a mesh file gives the triangle of a hit. `None` if it gives none.
    pub fn own_material_name(&self, hit: &Hit) -> Option<&str> {
        let own = self.geometry.file_material(hit.object, hit.shape.primitive)?;
        let mesh = self.geometry.objects()[hit.object as usize].mesh()?;
        mesh.tree.loaded().materials.get(own as usize).map(|material| material.name.as_str())
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

    /// Indices of the materials at some lanes of a row that hit one object; any index for other lanes.
    #[inline(always)]
    pub fn row_of_materials(
        &self,
        object: u32,
        of: u32,
        primitives: &[u32; PACKET_SIZE],
    ) -> [u32; PACKET_SIZE] {
        match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => [index; PACKET_SIZE],
            ObjectMaterial::OfFile { first, fallback } => {
                let mut materials = [fallback; PACKET_SIZE];
                for lane in lanes(of) {
                    let own = self.geometry.file_material(object, primitives[lane]);
                    materials[lane] = own.map_or(fallback, |own| first + own);
                }
                materials
            }
        }
    }

    /// [`Material::is_textured`] of a material.
    #[inline(always)]
    pub fn is_textured(&self, material: usize) -> bool {
        self.textured[material]
    }

    /// [`Material::is_mipmapped`] of a material.
    #[inline(always)]
    pub fn is_mipmapped(&self, material: usize) -> bool {
        self.mipmapped[material]
    }

    /// Whether vertex colours count at an object.
    #[inline]
    pub fn is_colored(&self, object: u32) -> bool {
        self.colored.as_ref().is_some_and(|colored| colored[object as usize])
    }

    /// The vertex colour at a hit, by which the material's colour is multiplied. `None` if it does not count.
    #[inline]
    pub fn vertex_color(&self, hit: &Hit) -> Option<Vec3> {
        self.is_colored(hit.object).then(|| self.geometry.vertex_color(hit)).flatten()
    }

    /// The place in textures of a surface at a hit, whose footprint is that of a point or of a beam by the tangents of the
    /// coordinates.
    #[inline]
    pub fn texture_point(
        &self,
        hit: &Hit,
        surface: &SurfacePoint,
        footprint: impl Fn([Vec3; 2]) -> Footprint,
    ) -> TexturePoint {
        let second = if self.has_second_uvs { self.second_point(hit, &footprint) } else { None };
        TexturePoint { uv: surface.uv, footprint: footprint([surface.dpdu, surface.dpdv]), second }
    }

    /// The same by the second set of coordinates. `None` without one.
    #[cold]
    #[inline(never)]
    fn second_point(
        &self,
        hit: &Hit,
        footprint: impl Fn([Vec3; 2]) -> Footprint,
    ) -> Option<Box<SecondPoint>> {
        let (uv, tangents) = self.geometry.second_uv(hit)?;
        Some(Box::new(SecondPoint { uv: uv.as_dvec2(), footprint: footprint(tangents), tangents }))
    }

    /// Whether an object has texture coordinates of its own, in place of barycentric ones, or no material asks for their direction.
    #[inline]
    pub fn has_coordinates(&self, object: u32) -> bool {
        if !self.has_directions {
            return true;
        }
        let mesh = self.geometry.objects()[object as usize].mesh();
        mesh.is_none_or(|mesh| !mesh.tree.loaded().mesh.uvs.is_empty())
    }

    /// Whether any material is glass.
    pub fn has_glass(&self) -> bool {
        self.has_glass
    }

    /// Whether the surface of any glass is rough.
    #[inline]
    pub fn has_rough_glass(&self) -> bool {
        self.has_rough_glass
    }

    /// Whether any material has a texture with mip levels, for which rays must know the width of their beams.
    pub fn has_mipmaps(&self) -> bool {
        self.mipmapped.contains(&true)
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
