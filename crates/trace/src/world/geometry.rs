//! All objects under one tree; infinite ones beside it.

use std::sync::Arc;

use crate::accel::{Bvh, Instructions};
use crate::control::{CancelToken, Cancelled};
use crate::geometry::{Aabb, Asked, Ray, ShapeHit, SurfacePoint};
use crate::lights::Source;
use crate::math::DVec3;
use crate::math::transform::Transform;
use crate::scene::description::{self, Lowered, Scene};

use super::lonely::Lonely;
use super::merged::MergedTriangle;
use super::{MergedMeshes, MeshInstance, MeshTree, Object};

/// The nearest hit in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Hit on the object.
    pub shape: ShapeHit,
    /// Number of the object.
    pub object: u32,
}

/// Objects and the tree over them.
#[derive(Debug)]
pub struct Geometry {
    objects: Vec<Object>,
    /// Origin of all coordinates, in the scene's.
    origin: DVec3,
    tree: Bvh,
    /// Small meshes under one tree.
    merged: Option<Merged>,
    /// Objects that are not in the tree.
    unbounded: Vec<u32>,
    /// Error of the triangles of any mesh, with a margin for ray tests there.
    mesh_rounding: f32,
    /// Places with nothing near their surface.
    lonely: Lonely,
    instructions: Instructions,
}

/// Small meshes under one tree, and the tree that rays visit in place of that over all objects.
#[derive(Debug)]
pub(super) struct Merged {
    /// The meshes; their number among the objects of `over` comes after those of all objects.
    pub(super) meshes: MergedMeshes,
    /// The tree over them and the other objects.
    pub(super) over: Bvh,
}

impl Geometry {
    /// The objects of a scene with these trees for its mesh files, in coordinates that start at `origin`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_scene(
        scene: &Scene,
        meshes: &[Arc<MeshTree>],
        origin: DVec3,
        token: &CancelToken,
    ) -> Result<Self, Cancelled> {
        let objects = scene.objects.iter().map(|object| lowered(&object.shape, meshes, origin, token));
        Ok(Self { origin, ..Self::build(objects.collect::<Result<_, _>>()?, token)? })
    }

    /// Builds the tree over objects.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn build(mut objects: Vec<Object>, token: &CancelToken) -> Result<Self, Cancelled> {
        let merged = MergedMeshes::of_objects(&mut objects, token)?;
        let bounds: Vec<Option<Aabb>> = objects.iter().map(Object::bounds).collect();
        let unbounded =
            (0_u32..).zip(&bounds).filter(|(_, bounds)| bounds.is_none()).map(|(id, _)| id).collect();
        let boxes: Vec<Aabb> = bounds.into_iter().map(|bounds| bounds.unwrap_or(Aabb::EMPTY)).collect();
        let (tree, instructions) = (Bvh::build(&boxes, token)?, Instructions::best());
        let merged = merged.map(|meshes| -> Result<_, Cancelled> {
            let each = (0..).zip(&boxes).map(|(id, own)| if meshes.has(id) { Aabb::EMPTY } else { *own });
            let with_all: Vec<Aabb> = each.chain([meshes.bounds()]).collect();
            Ok(Merged { over: Bvh::build(&with_all, token)?, meshes })
        });
        let merged = merged.transpose()?;
        let rounding = objects.iter().filter_map(Object::mesh).map(MeshInstance::rounding);
        let mesh_rounding = rounding.fold(0.0, f32::max);
        let origin = DVec3::ZERO;
        let lonely = Lonely::new(&boxes);
        Ok(Self { objects, origin, tree, merged, unbounded, mesh_rounding, lonely, instructions })
    }

    /// The objects, which an index names.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Origin of all coordinates, in the scene's.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The tree over the finite objects.
    pub(super) fn tree(&self) -> &Bvh {
        &self.tree
    }

    /// The tree that rays visit: objects by their number, and after them the merged meshes.
    pub(super) fn visited(&self) -> &Bvh {
        self.merged.as_ref().map_or(&self.tree, |merged| &merged.over)
    }

    /// The merged meshes. `None` if the number from [`Geometry::visited`] is that of an object.
    #[inline(always)]
    pub(super) fn merged(&self, id: u32) -> Option<&MergedMeshes> {
        let merged = self.merged.as_ref()?;
        (id as usize == self.objects.len()).then_some(&merged.meshes)
    }

    /// Whether any meshes are merged.
    #[inline(always)]
    pub(super) fn has_merged(&self) -> bool {
        self.merged.is_some()
    }

    /// Whether a light is all of a merged object: shadow rays to it visit the trees of each mesh.
    #[inline(always)]
    pub(super) fn is_whole_merged(&self, source: Source) -> bool {
        match (source, &self.merged) {
            (Source::Object(object), Some(merged)) => merged.meshes.has(object),
            (Source::Nothing | Source::Object(_) | Source::Primitive(..), _) => false,
        }
    }

    /// Whether any object is infinite.
    pub fn has_unbounded(&self) -> bool {
        !self.unbounded.is_empty()
    }

    /// The infinite objects.
    pub(super) fn unbounded(&self) -> &[u32] {
        &self.unbounded
    }

    /// Error of the triangles of any mesh, with a margin for ray tests there.
    pub(super) fn mesh_rounding(&self) -> f32 {
        self.mesh_rounding
    }

    /// Places with nothing near their surface.
    pub(super) fn lonely(&self) -> &Lonely {
        &self.lonely
    }

    /// The geometry, with packets traced by other instructions.
    #[cfg(test)]
    pub(super) fn with(mut self, instructions: Instructions) -> Self {
        self.instructions = instructions;
        self
    }

    /// Instructions that trace packets.
    pub fn instructions(&self) -> Instructions {
        self.instructions
    }

    /// The nearest hit; of hits at one distance, the object of the lowest number.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut ray_f64 = ray.to_f64();
        let mut segment = *ray;
        let mut test = |id: u32, t_max: f32| {
            segment.t_max = t_max;
            let hit = match self.merged(id) {
                Some(merged) => {
                    let shape = merged.closest(&segment)?;
                    let MergedTriangle { object, primitive } = merged.triangle(shape.primitive);
                    Hit { shape: ShapeHit { primitive, ..shape }, object }
                }
                None => {
                    ray_f64.t_max = f64::from(t_max);
                    Hit { shape: self.objects[id as usize].closest(&segment, &ray_f64)?, object: id }
                }
            };
            let nearer = best.is_none_or(|best| (hit.shape.t, hit.object) < (best.shape.t, best.object));
            nearer.then(|| {
                best = Some(hit);
                hit.shape.t
            })
        };
        let mut end = ray.t_max;
        for &id in &self.unbounded {
            end = test(id, end).unwrap_or(end);
        }
        self.visited().closest(&Ray { t_max: end, ..*ray }, test);
        best
    }

    /// Whether anything but the light itself lies on the segment.
    pub fn occluded(&self, ray: &Ray, source: Source) -> bool {
        let ray_f64 = ray.to_f64();
        let any = |id: u32, except: Option<u32>| self.objects[id as usize].any(ray, &ray_f64, except);
        let of_object = |id: u32| match source {
            Source::Nothing => any(id, None),
            Source::Object(own) => own != id && any(id, None),
            Source::Primitive(own, part) => any(id, (own == id).then_some(part)),
        };
        let test = |id: u32| match (self.merged(id), source) {
            (Some(merged), Source::Nothing | Source::Object(_)) => merged.any(ray, None),
            (Some(merged), Source::Primitive(own, part)) => merged.any(ray, merged.number(own, part)),
            (None, _) => of_object(id),
        };
        if self.is_whole_merged(source) {
            return self.unbounded.iter().any(|&id| of_object(id)) || self.tree.any(ray, of_object);
        }
        self.unbounded.iter().any(|&id| test(id)) || self.visited().any(ray, test)
    }

    /// The surface at a hit of this ray.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        self.asked_surface(ray, hit, Asked::ALL)
    }

    /// The requested parts of the surface at a hit of this ray.
    pub fn asked_surface(&self, ray: &Ray, hit: &Hit, asked: Asked) -> SurfacePoint {
        self.objects[hit.object as usize].surface(ray, &hit.shape, asked)
    }

    /// Mean curvature at a hit, > 0 if the surface bulges to its front.
    pub fn curvature(&self, hit: &Hit, surface: &SurfacePoint) -> f32 {
        match &self.objects[hit.object as usize] {
            Object::Shape(shape) => shape.curvature(hit.shape.primitive, surface.point.as_dvec3()) as f32,
            Object::Mesh(mesh) => mesh.curvature(hit.shape.primitive, surface.normal),
        }
    }

    /// The material that a mesh file gives the triangle of a hit, by the file's own count.
    pub fn file_material(&self, hit: &Hit) -> Option<u32> {
        let mesh = self.objects[hit.object as usize].mesh()?;
        let materials = &mesh.tree.loaded().mesh.materials;
        materials.get(hit.shape.primitive as usize).copied().filter(|&own| own != u32::MAX)
    }

    /// Bytes of the objects and of the tree over them, without those of meshes.
    pub fn own_memory_bytes(&self) -> usize {
        let of_merged = |merged: &Merged| merged.meshes.memory_bytes() + merged.over.memory_bytes();
        let merged = self.merged.as_ref().map_or(0, of_merged);
        self.tree.memory_bytes() + merged + size_of_val(self.objects.as_slice())
    }

    /// Bytes of this tree and of each mesh's, counted once.
    pub fn memory_bytes(&self) -> usize {
        let mut seen = Vec::new();
        let mut bytes = self.own_memory_bytes() - size_of_val(self.objects.as_slice());
        for mesh in self.objects.iter().filter_map(Object::mesh) {
            if !seen.contains(&Arc::as_ptr(&mesh.tree)) {
                seen.push(Arc::as_ptr(&mesh.tree));
                bytes += mesh.tree.memory_bytes();
            }
        }
        bytes
    }
}

fn lowered(
    shape: &description::Shape,
    meshes: &[Arc<MeshTree>],
    origin: DVec3,
    token: &CancelToken,
) -> Result<Object, Cancelled> {
    let mesh = match shape.lowered(origin) {
        Lowered::Shape(shape) => return Ok(Object::Shape(shape)),
        Lowered::Mesh(mesh) => mesh,
    };
    let tree = &meshes[mesh.file];
    let placed = Transform::scale_rotate_translate(mesh.scale, mesh.rotate, mesh.translate);
    let transform = placed.between(tree.loaded().mesh.origin, origin);
    let instance = MeshInstance::new(Arc::clone(tree), transform, mesh.smooth);
    if instance.smooth {
        instance.tree.prepare_normals(token)?;
    }
    Ok(Object::Mesh(Box::new(instance)))
}
