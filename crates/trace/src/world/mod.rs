//! The traceable world: geometry, materials, lights and camera. It is immutable and shared through `Arc`.

mod assemble;
mod box_query;
pub mod camera;
mod camera_interior;
pub mod contact;
mod coplanar;
mod distinct_lights;
mod emitters;
mod file_materials;
pub mod geometry;
mod glass_solids;
mod isolated;
mod lower;
mod lower_texture;
mod merged;
mod mesh_instance;
mod mesh_packet;
pub mod mesh_tree;
mod null_interaction;
mod object;
mod origin;
mod packet;
mod packet_material;
mod placement;
mod ray_nodes;
pub mod textures;
mod triangle_point;
mod triangle_tree;
mod unlit_glass;

use std::collections::HashMap;
use std::sync::Arc;

pub use crate::accel::{InstructionSet, PACKET_SIZE, RayBoxInterval, SimdKernel, VisitedNode};
pub use camera::{Camera, FilmPosition, FilmPositionPacket, PixelFootprint};
pub use camera_interior::CompoundSolid;
pub use contact::{
    CoincidenceQuery, CoincidenceScratch, CoincidentOrEnclosingSurface, MAX_INTERIORS, OffsetPoints,
};
pub use coplanar::{CoplanarLight, find_coplanar_lights, light_lifts};
pub use distinct_lights::{emissive_override_flags_by_mesh_file, separate_coincident_emitters};
pub use emitters::{EnvironmentSource, build_environment_map, build_lights, build_sky, scene_photon_emitter};
pub use geometry::{Geometry, Hit};
pub use glass_solids::{GlassSolids, OpenGlass};
pub use merged::MergedMeshes;
pub use mesh_instance::MeshInstance;
pub use mesh_tree::MeshTree;
pub use null_interaction::{MAX_NULL_INTERACTIONS, ShadowTransmittancePacket};
pub use object::Object;
pub use origin::choose_origin_near_camera_target;
pub use packet_material::PacketShadingMaterial;
pub use textures::{
    HashableAlphaCutoff, NeededTexture, TextureImageKey, TextureRolesNeededByRender,
    environment_map_image_key, scene_material_image_key, textures_needed,
};
pub use unlit_glass::LightBoundingBoxes;

use crate::assets::GkitOrbiterCamera;
use crate::geometry::SurfacePoint;
use crate::geometry::packet::set_bit_lanes;
use crate::lights::Lights;
use crate::materials::texels::Texels;
use crate::materials::{
    ExtraCoordinates, Footprint, Material, Mipmaps, ObjectPoint, SecondUvPoint, TexturePoint,
};
use crate::math::Vec3;
use crate::math::transform::Transform;
use crate::scene::description;

/// A scene's decoded images, indexed by source.
pub type Images = HashMap<TextureImageKey, TexelsAndMipmaps>;

/// A decoded image.
#[derive(Clone, Debug)]
pub struct TexelsAndMipmaps {
    /// The full-resolution pixels.
    pub texels: Arc<Texels>,
    /// Mip levels, if any texture needs them.
    pub mipmaps: Option<Arc<Mipmaps>>,
}

/// Prepared inputs from which a world is assembled.
#[derive(Clone, Debug, Default)]
pub struct WorldInputs {
    /// One tree per entry of [`crate::scene::description::Scene::mesh_files`].
    pub meshes: Vec<Arc<MeshTree>>,
    /// The images listed by [`textures_needed`].
    pub images: Images,
    /// Contents of the orbiter file, or `None` if the scene file defines the camera itself.
    pub orbiter: Option<GkitOrbiterCamera>,
    /// Camera that overrides the scene's camera, if any.
    pub camera: Option<description::Camera>,
    /// Glass solids, if they have already been found.
    pub glass_solids: Option<Arc<GlassSolids>>,
}

/// A scene ready for tracing.
#[derive(Debug)]
pub struct World {
    /// The camera.
    pub camera: Camera,
    /// All objects and their acceleration structures.
    pub geometry: Arc<Geometry>,
    /// Materials, referenced by index from the objects.
    pub materials: Vec<Material>,
    /// Packet-shading data of each material, or `None` for materials that are not plain.
    packet_material: Box<[Option<PacketShadingMaterial>]>,
    /// Whether any material's lobes depend on the texture axes.
    has_directions: bool,
    /// Whether each material needs UVs or tangents; see [`Material::needs_uvs_or_tangents`].
    textured: Box<[bool]>,
    /// For each object, its material or the materials of its mesh file.
    object_materials: Vec<ObjectMaterial>,
    /// All lights.
    pub lights: Arc<Lights>,
    /// Groups of surfaces that enclose one glass solid.
    glass_solids: Arc<GlassSolids>,
    /// Whether any glass solid has holes.
    has_open_glass: bool,
    /// Whether any material is glass.
    has_glass: bool,
    /// Whether any glass surface is rough.
    has_rough_glass: bool,
    /// Whether each object represents a closed glass solid that contains no light. This table is empty if
    /// there is no rough glass.
    unlit_glass: Box<[bool]>,
    /// Closed glass shapes that may contain points on the lens, with their materials.
    lens_glass: Vec<(u32, u32)>,
    /// Relevant enclosing glass shapes in each subtree of nested objects, or empty if few objects are nested.
    enclosing_glass: Box<[contact::LastClosedGlassIdsInSubtree]>,
    /// Other glass solids that contain the camera, with their materials.
    camera_solids: Vec<(u32, u32)>,
    /// Other glass solids in which parallel camera rays may start.
    solids_near_ray_origins: Vec<CompoundSolid>,
    /// Whether each material is mipmapped; see [`Material::uses_footprint`].
    mipmapped: Box<[bool]>,
    /// Whether any texture uses a mesh's second UV set or the shape's own coordinates.
    has_extra_coordinates: bool,
    /// Whether any texture uses a mesh's second UV set.
    has_second_uvs: bool,
    /// For each object, the map from the shape's own coordinates to world coordinates, if textures use them.
    object_frames: Option<Box<[Option<Transform>]>>,
    /// Whether each object's vertex colors are used, or `None` if no object uses them.
    colored: Option<Box<[bool]>>,
    /// Objects that light may pass through without changing direction, if there are any.
    see_through: Option<Box<null_interaction::SeeThroughObjects>>,
}

/// Material assignment of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ObjectMaterial {
    /// One material for the whole object.
    One(u32),
    /// The mesh file's materials, per triangle.
    OfFile {
        /// Index of the file's first material in [`World::materials`].
        first: u32,
        /// Material for triangles without a material in the file.
        fallback: u32,
    },
}

impl World {
    /// Index of the material at a hit.
    pub fn material_index(&self, hit: &Hit) -> usize {
        match self.object_materials[hit.object as usize] {
            ObjectMaterial::One(index) => index as usize,
            ObjectMaterial::OfFile { first, fallback } => {
                let own = self.geometry.file_material_index(hit.object, hit.shape.primitive);
                own.map_or(fallback, |own| first + own) as usize
            }
        }
    }

    /// Name of the hit triangle's material in the mesh file, or `None` if the file does not assign a
    /// material.
    pub fn file_material_name(&self, hit: &Hit) -> Option<&str> {
        let own = self.geometry.file_material_index(hit.object, hit.shape.primitive)?;
        let mesh = self.geometry.objects()[hit.object as usize].mesh()?;
        mesh.tree.loaded_mesh().materials.get(own as usize).map(|material| material.name.as_str())
    }

    /// All materials that parts of an object may have.
    pub fn materials_of(&self, object: u32) -> impl Iterator<Item = &Material> {
        let (first, count, one) = match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => (0, 0, index),
            ObjectMaterial::OfFile { first, fallback } => {
                let mesh = self.geometry.objects()[object as usize].mesh();
                (first, mesh.map_or(0, |mesh| mesh.tree.loaded_mesh().materials.len()), fallback)
            }
        };
        self.materials[first as usize..][..count].iter().chain(self.materials.get(one as usize))
    }

    /// Material indices for the lanes in `of`, which all hit `object`. Other lanes contain arbitrary valid
    /// indices.
    #[inline(always)]
    pub fn packet_material_indices(
        &self,
        object: u32,
        of: u32,
        primitives: &[u32; PACKET_SIZE],
    ) -> [u32; PACKET_SIZE] {
        match self.object_materials[object as usize] {
            ObjectMaterial::One(index) => [index; PACKET_SIZE],
            ObjectMaterial::OfFile { first, fallback } => {
                let mut materials = [fallback; PACKET_SIZE];
                for lane in set_bit_lanes(of) {
                    let own = self.geometry.file_material_index(object, primitives[lane]);
                    materials[lane] = own.map_or(fallback, |own| first + own);
                }
                materials
            }
        }
    }

    /// Whether a material needs UVs or tangents; see [`Material::needs_uvs_or_tangents`].
    #[inline(always)]
    pub fn material_needs_uvs_or_tangents(&self, material: usize) -> bool {
        self.textured[material]
    }

    /// Whether a material is mipmapped; see [`Material::uses_footprint`].
    #[inline(always)]
    pub fn is_material_mipmapped(&self, material: usize) -> bool {
        self.mipmapped[material]
    }

    /// Whether an object's vertex colors are used.
    #[inline]
    pub fn object_uses_vertex_colors(&self, object: u32) -> bool {
        self.colored.as_ref().is_some_and(|colored| colored[object as usize])
    }

    /// The vertex color that tints the material at a hit, or `None` if vertex colors are not used.
    #[inline]
    pub fn vertex_color(&self, hit: &Hit) -> Option<Vec3> {
        self.object_uses_vertex_colors(hit.object).then(|| self.geometry.vertex_color(hit)).flatten()
    }

    /// Texture coordinates at a hit. `footprint` computes their footprint from the tangents.
    #[inline]
    pub fn texture_point(
        &self,
        hit: &Hit,
        surface: &SurfacePoint,
        footprint: impl Fn([Vec3; 2]) -> Footprint,
    ) -> TexturePoint {
        let extra = match self.has_extra_coordinates {
            true => self.extra_texture_coordinates(hit, surface, &footprint),
            false => None,
        };
        TexturePoint { uv: surface.uv, footprint: footprint([surface.dpdu, surface.dpdv]), extra }
    }

    /// The rarely used part of [`World::texture_point`], or `None` if the object has none.
    #[cold]
    #[inline(never)]
    fn extra_texture_coordinates(
        &self,
        hit: &Hit,
        surface: &SurfacePoint,
        footprint: impl Fn([Vec3; 2]) -> Footprint,
    ) -> Option<Box<ExtraCoordinates>> {
        let second = if self.has_second_uvs { self.geometry.second_uv_and_tangents(hit) } else { None };
        let second = second.map(|(uv, tangents)| SecondUvPoint {
            uv: uv.as_dvec2(),
            footprint: footprint(tangents),
            tangents,
        });
        let frame = self.object_frames.as_ref().and_then(|frames| frames[hit.object as usize].as_ref());
        let object = frame.map(|frame| {
            ObjectPoint::new(frame, surface.point.as_dvec3()).with_footprint(surface.normal, &footprint)
        });
        (second.is_some() || object.is_some()).then(|| Box::new(ExtraCoordinates { second, object }))
    }

    /// Whether an object's texture axes are well defined or irrelevant: the object has UVs, or no lobes
    /// depend on the axes.
    #[inline]
    pub fn object_has_texture_axes_if_needed(&self, object: u32) -> bool {
        if !self.has_directions {
            return true;
        }
        let mesh = self.geometry.objects()[object as usize].mesh();
        mesh.is_none_or(|mesh| !mesh.tree.loaded_mesh().mesh.uvs.is_empty())
    }

    /// Whether any material is glass.
    pub fn has_glass(&self) -> bool {
        self.has_glass
    }

    /// Whether any glass surface is rough.
    #[inline]
    pub fn has_rough_glass(&self) -> bool {
        self.has_rough_glass
    }

    /// Whether any texture has mip levels, so that rays must track their footprints.
    pub fn has_mipmaps(&self) -> bool {
        self.mipmapped.contains(&true)
    }

    /// Total number of triangles, counting every mesh instance.
    pub fn triangle_count(&self) -> u64 {
        self.geometry.objects().iter().map(Object::triangle_count).sum()
    }

    /// Number of objects. A mesh instance counts as one object.
    pub fn object_count(&self) -> u64 {
        self.geometry.objects().len() as u64
    }

    /// Memory used by all acceleration structures, in bytes. Shared structures are counted once.
    pub fn accel_memory_bytes(&self) -> usize {
        self.geometry.tree_memory_bytes()
    }
}
