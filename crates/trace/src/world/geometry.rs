//! The scene's objects and the acceleration structures over them.

use std::sync::Arc;

use crate::accel::{Bvh, InstructionSet, SphericalShell};
use crate::control::{CancelToken, Canceled};
use crate::geometry::{Aabb, Ray, Shape, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::lights::GeometryOfLight;
use crate::math::color::srgb8_color_to_linear;
use crate::math::{DVec3, Vec2, Vec3};
use crate::scene::description::{self, LoweredShape, Scene};

use super::coplanar::light_lifts;
use super::isolated::IsolatedRegionCache;
use super::merged::MergedTriangle;
use super::{MergedMeshes, MeshInstance, MeshTree, Object};

/// Nearest hit in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The hit within the object.
    pub shape: ShapeHit,
    /// Index of the object.
    pub object: u32,
}

/// All objects of a scene and the tree over them.
#[derive(Debug)]
pub struct Geometry {
    objects: Vec<Object>,
    /// Origin of the traced coordinates, in scene coordinates.
    origin: DVec3,
    tree: Bvh,
    /// Small meshes merged into one tree, or `None` if merging is not worthwhile.
    merged: Option<MergedMeshesWithTopTree>,
    /// Infinite objects, which are not in the tree.
    unbounded: Vec<u32>,
    /// Upper bound on the position error of mesh triangles, including the error of ray tests.
    mesh_rounding: f32,
    /// Cache of isolated surface regions.
    isolated: IsolatedRegionCache,
    /// One translation per object, or empty if no objects are moved.
    lifts: Vec<DVec3>,
    instructions: InstructionSet,
}

/// Small meshes in one tree, and the top-level tree used for tracing instead of the tree over all objects.
#[derive(Debug)]
pub(super) struct MergedMeshesWithTopTree {
    /// The merged meshes. In `over`, they are represented by one object, whose id follows the ids of all real
    /// objects.
    pub(super) meshes: MergedMeshes,
    /// The tree over the merged meshes and the remaining objects.
    pub(super) over: Bvh,
}

impl Geometry {
    /// Builds the geometry of a scene from its objects and mesh trees, in coordinates relative to `origin`.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn from_scene(
        scene: &Scene,
        meshes: &[Arc<MeshTree>],
        origin: DVec3,
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        Self::from_scene_with_light_lifts(scene, meshes, (origin, light_lifts(scene, meshes, origin)), token)
    }

    /// Like [`Self::from_scene`], but also applies translations from [`light_lifts`].
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn from_scene_with_light_lifts(
        scene: &Scene,
        meshes: &[Arc<MeshTree>],
        (origin, lifts): (DVec3, Vec<DVec3>),
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let lift = |object: usize| lifts.get(object).copied().unwrap_or(DVec3::ZERO);
        let objects = scene.objects.iter().enumerate();
        let built = objects.map(|(id, object)| lower_shape(&object.shape, meshes, origin - lift(id), token));
        let built = built.collect::<Result<_, _>>()?;
        Ok(Self { origin, lifts, ..Self::build(built, token)? })
    }

    /// One translation per object, or empty if no objects are moved; see [`super::find_coplanar_lights`].
    pub fn light_lifts_by_object(&self) -> &[DVec3] {
        &self.lifts
    }

    /// Builds the acceleration structures over objects.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn build(mut objects: Vec<Object>, token: &CancelToken) -> Result<Self, Canceled> {
        let merged = MergedMeshes::merge_small_meshes(&mut objects, token)?;
        number_triangles(&mut objects);
        let bounds: Vec<Option<Aabb>> = objects.iter().map(Object::bounds).collect();
        let unbounded =
            (0_u32..).zip(&bounds).filter(|(_, bounds)| bounds.is_none()).map(|(id, _)| id).collect();
        let boxes: Vec<Aabb> = bounds.into_iter().map(|bounds| bounds.unwrap_or(Aabb::EMPTY)).collect();
        let shell = |id: u32| bounding_spherical_shell(&objects[id as usize], &boxes[id as usize]);
        let (tree, instructions) = (
            Bvh::build(&boxes, token)?.with_shells_if_nested(shell),
            InstructionSet::from_environment_or_best(),
        );
        let merged = merged.map(|meshes| -> Result<_, Canceled> {
            let each = (0..)
                .zip(&boxes)
                .map(|(id, own)| if meshes.contains_object(id) { Aabb::EMPTY } else { *own });
            let with_all: Vec<Aabb> = each.chain([meshes.bounds()]).collect();
            let of_merged = meshes.bounds();
            let shell = |id: u32| {
                objects.get(id as usize).map_or(SphericalShell::enclosing_box(&of_merged), |_| shell(id))
            };
            Ok(MergedMeshesWithTopTree {
                over: Bvh::build(&with_all, token)?.with_shells_if_nested(shell),
                meshes,
            })
        });
        let merged = merged.transpose()?;
        let rounding = objects.iter().filter_map(Object::mesh).map(MeshInstance::max_rounding_error);
        let mesh_rounding = rounding.fold(0.0, f32::max);
        let origin = DVec3::ZERO;
        let isolated = IsolatedRegionCache::new(&boxes);
        Ok(Self {
            objects,
            origin,
            tree,
            merged,
            unbounded,
            mesh_rounding,
            isolated,
            lifts: Vec::new(),
            instructions,
        })
    }

    /// All objects, indexed by id.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Origin of the traced coordinates, in scene coordinates.
    pub fn coordinate_origin(&self) -> DVec3 {
        self.origin
    }

    /// The tree over all finite objects.
    pub(super) fn finite_object_tree(&self) -> &Bvh {
        &self.tree
    }

    /// Top-level tree used for tracing. It contains the unmerged objects by id, followed by one object for
    /// all merged meshes.
    pub(super) fn traced_tree(&self) -> &Bvh {
        self.merged.as_ref().map_or(&self.tree, |merged| &merged.over)
    }

    /// Returns the merged meshes if they are represented by `id`, an id from [`Geometry::traced_tree`], or
    /// `None` if `id` refers to a real object.
    #[inline(always)]
    pub(super) fn merged_meshes_if_proxy_id(&self, id: u32) -> Option<&MergedMeshes> {
        let merged = self.merged.as_ref()?;
        (id as usize == self.objects.len()).then_some(&merged.meshes)
    }

    /// Whether any meshes are merged.
    #[inline(always)]
    pub(super) fn has_merged_meshes(&self) -> bool {
        self.merged.is_some()
    }

    /// Whether an object is one of the merged meshes.
    pub(super) fn is_merged(&self, object: u32) -> bool {
        self.merged.as_ref().is_some_and(|merged| merged.meshes.contains_object(object))
    }

    /// Whether a light is an entire merged mesh. Shadow rays to such lights use the per-mesh trees instead.
    #[inline(always)]
    pub(super) fn is_light_entire_merged_mesh(&self, source: GeometryOfLight) -> bool {
        match (source, &self.merged) {
            (GeometryOfLight::Object(object), Some(merged)) => merged.meshes.contains_object(object),
            (
                GeometryOfLight::Nothing
                | GeometryOfLight::Object(_)
                | GeometryOfLight::SeeThrough(_)
                | GeometryOfLight::Primitive(..),
                _,
            ) => false,
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

    /// Upper bound on the position error of mesh triangles, including the error of ray tests.
    pub(super) fn max_mesh_rounding_error(&self) -> f32 {
        self.mesh_rounding
    }

    /// Cache of isolated surface regions.
    pub(super) fn isolated_region_cache(&self) -> &IsolatedRegionCache {
        &self.isolated
    }

    /// Sets the instruction set used to trace packets.
    #[cfg(test)]
    pub(super) fn with_instruction_set(mut self, instructions: InstructionSet) -> Self {
        self.instructions = instructions;
        self
    }

    /// The instruction set used to trace packets.
    pub fn instruction_set(&self) -> InstructionSet {
        self.instructions
    }

    /// Returns the nearest hit. At equal distances, the lowest object id wins.
    pub fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        self.closest_hit_with_unbounded(self.traced_tree(), ray, |id, segment| {
            match self.merged_meshes_if_proxy_id(id) {
                Some(merged) => {
                    let shape = merged.closest_hit_with_merged_index(segment)?;
                    let MergedTriangle { object, primitive } = merged.triangle(shape.primitive);
                    Some(Hit { shape: ShapeHit { primitive, ..shape }, object })
                }
                None => self.intersect_object(id, segment),
            }
        })
    }

    /// Returns the nearest hit among the objects for which `counts` returns true. At equal distances, the
    /// lowest object id wins.
    pub fn closest_hit_on_objects_where(&self, ray: &Ray, counts: impl Fn(u32) -> bool) -> Option<Hit> {
        self.closest_hit_with_unbounded(&self.tree, ray, |id, segment| {
            if counts(id) { self.intersect_object(id, segment) } else { None }
        })
    }

    /// Returns the nearest hit among a tree's objects and the infinite objects. `hit` intersects one object
    /// with a ray segment.
    #[inline]
    fn closest_hit_with_unbounded(
        &self,
        tree: &Bvh,
        ray: &Ray,
        mut hit: impl FnMut(u32, &Ray) -> Option<Hit>,
    ) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut test = |id: u32, t_max: f32| {
            let hit = hit(id, &Ray { t_max, ..*ray })?;
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
        tree.visit_primitives_front_to_back(&Ray { t_max: end, ..*ray }, test);
        best
    }

    /// Returns the nearest hit on one object.
    #[inline]
    fn intersect_object(&self, id: u32, ray: &Ray) -> Option<Hit> {
        let shape = self.objects[id as usize].closest_hit(ray, &ray.to_f64())?;
        Some(Hit { shape, object: id })
    }

    /// Whether anything other than the light itself blocks a shadow ray.
    pub fn is_occluded_except_by_light(&self, ray: &Ray, source: GeometryOfLight) -> bool {
        let ray_f64 = ray.to_f64();
        let any = |id: u32, except: Option<u32>| self.objects[id as usize].any_hit(ray, &ray_f64, except);
        let of_object = |id: u32| match source {
            GeometryOfLight::Nothing => any(id, None),
            GeometryOfLight::Object(own) | GeometryOfLight::SeeThrough(own) => own != id && any(id, None),
            GeometryOfLight::Primitive(own, part) => any(id, (own == id).then_some(part)),
        };
        let test = |id: u32| match (self.merged_meshes_if_proxy_id(id), source) {
            (
                Some(merged),
                GeometryOfLight::Nothing | GeometryOfLight::Object(_) | GeometryOfLight::SeeThrough(_),
            ) => merged.any_hit(ray, None),
            (Some(merged), GeometryOfLight::Primitive(own, part)) => {
                merged.any_hit(ray, merged.merged_triangle_index(own, part))
            }
            (None, _) => of_object(id),
        };
        if self.is_light_entire_merged_mesh(source) {
            return self.unbounded.iter().any(|&id| of_object(id)) || self.tree.any_hit(ray, of_object);
        }
        self.unbounded.iter().any(|&id| test(id)) || self.traced_tree().any_hit(ray, test)
    }

    /// Scene-wide index of the hit triangle, for use as [`Ray::start`]. Returns [`Ray::NO_TRIANGLE`] if there
    /// is none, for example because the shape is not a triangle.
    #[inline(always)]
    pub fn scene_triangle_number(&self, hit: &Hit) -> u32 {
        match &self.objects[hit.object as usize] {
            Object::Shape(_) => Ray::NO_TRIANGLE,
            Object::Mesh(mesh) => mesh.scene_triangle_number(hit.shape.primitive),
        }
    }

    /// Returns the surface at a hit.
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        self.requested_surface(ray, hit, SurfaceRequest::ALL)
    }

    /// Returns the requested surface attributes at a hit.
    pub fn requested_surface(&self, ray: &Ray, hit: &Hit, request: SurfaceRequest) -> SurfacePoint {
        self.objects[hit.object as usize].surface_point_with_fields(ray, &hit.shape, request)
    }

    /// Mean curvature at a hit, positive if the surface is convex on its front side.
    pub fn mean_curvature(&self, hit: &Hit, surface: &SurfacePoint) -> f32 {
        match &self.objects[hit.object as usize] {
            Object::Shape(shape) => {
                shape.mean_curvature(hit.shape.primitive, surface.point.as_dvec3()) as f32
            }
            Object::Mesh(mesh) => mesh.mean_curvature(hit.shape.primitive, surface.normal),
        }
    }

    /// Index of a triangle's material in its mesh file, or `None` if the file does not assign a material.
    pub fn file_material_index(&self, object: u32, triangle: u32) -> Option<u32> {
        let mesh = self.objects[object as usize].mesh()?;
        let materials = &mesh.tree.loaded_mesh().mesh.materials;
        materials.get(triangle as usize).copied().filter(|&own| own != u32::MAX)
    }

    /// Vertex color at a hit, interpolated in linear space, or `None` if the mesh has no vertex colors.
    pub fn vertex_color(&self, hit: &Hit) -> Option<Vec3> {
        let mesh = &self.objects[hit.object as usize].mesh()?.tree.loaded_mesh().mesh;
        let corners = mesh.triangles.get(hit.shape.primitive as usize)?;
        let color = |vertex: u32| mesh.colors.get(vertex as usize).map(|color| srgb8_color_to_linear(*color));
        let [a, b, c] = corners.map(color);
        let (u, v) = (hit.shape.u, hit.shape.v);
        Some(a? * (1.0 - u - v) + b? * u + c? * v)
    }

    /// UV and tangents (∂p/∂u, ∂p/∂v) at a hit in the second UV set, if there is one.
    pub fn second_uv_and_tangents(&self, hit: &Hit) -> Option<(Vec2, [Vec3; 2])> {
        self.objects[hit.object as usize].mesh()?.second_uv_and_tangents(&hit.shape)
    }

    /// Memory used by the objects and the trees over them, in bytes, excluding per-mesh trees.
    pub fn top_level_memory_bytes(&self) -> usize {
        let of_merged =
            |merged: &MergedMeshesWithTopTree| merged.meshes.memory_bytes() + merged.over.memory_bytes();
        let merged = self.merged.as_ref().map_or(0, of_merged);
        self.tree.memory_bytes() + merged + size_of_val(self.objects.as_slice())
    }

    /// Memory used by all trees, in bytes. Each mesh tree is counted once.
    pub fn tree_memory_bytes(&self) -> usize {
        let mut seen = Vec::new();
        let mut bytes = self.top_level_memory_bytes() - size_of_val(self.objects.as_slice());
        for mesh in self.objects.iter().filter_map(Object::mesh) {
            if !seen.contains(&Arc::as_ptr(&mesh.tree)) {
                seen.push(Arc::as_ptr(&mesh.tree));
                bytes += mesh.tree.memory_bytes();
            }
        }
        bytes
    }
}

/// Shell around an object with this bounding box.
fn bounding_spherical_shell(object: &Object, bounds: &Aabb) -> SphericalShell {
    match object {
        Object::Shape(Shape::Sphere(sphere)) => SphericalShell::from_sphere(sphere.center, sphere.radius),
        Object::Shape(_) | Object::Mesh(_) => SphericalShell::enclosing_box(bounds),
    }
}

/// Assigns scene-wide triangle numbers: first to merged meshes, in the order of their common tree, and then
/// to other meshes. Meshes whose numbers would exceed `u32` are not numbered.
fn number_triangles(objects: &mut [Object]) {
    let mut next = Some(0_u32);
    for of_merged in [true, false] {
        let meshes = objects.iter_mut().filter_map(Object::mesh_mut);
        for mesh in meshes.filter(|mesh| mesh.is_merged == of_merged) {
            let count = u32::try_from(mesh.triangle_count()).ok();
            let end = next.zip(count).and_then(|(first, count)| first.checked_add(count));
            mesh.first = next.filter(|_| end.is_some());
            next = end;
        }
    }
}

fn lower_shape(
    shape: &description::Shape,
    meshes: &[Arc<MeshTree>],
    origin: DVec3,
    token: &CancelToken,
) -> Result<Object, Canceled> {
    let mesh = match shape.to_traced_shape_relative_to(origin) {
        LoweredShape::Shape(shape) => return Ok(Object::Shape(shape)),
        LoweredShape::Mesh(mesh) => mesh,
    };
    let tree = &meshes[mesh.file];
    let transform = mesh.placed.to_transform().relative_to_origins(tree.loaded_mesh().mesh.origin, origin);
    let instance = MeshInstance::new(Arc::clone(tree), transform, mesh.smooth);
    if instance.smooth {
        instance.tree.prepare_normals(token)?;
    }
    Ok(Object::Mesh(Box::new(instance)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::ray::offset_origin;
    use crate::math::random::signed_number_generator as random;
    use crate::math::transform::Transform;
    use crate::world::merged::tests::mesh;

    /// Merged meshes, tiny meshes, and large meshes that have separate trees. Some meshes are transformed.
    fn geometry() -> Geometry {
        let trees = [mesh(1, 70), mesh(2, 8), mesh(3, 17_000), mesh(4, 40)];
        let placed = |(place, tree): (usize, usize)| {
            let at = DVec3::X * (4 * place) as f64;
            let turn = if place % 2 == 0 { DVec3::ZERO } else { DVec3::new(13.0, 57.0, 211.0) };
            let transform = Transform::scale_rotate_translate(DVec3::new(1.0, 0.9, 1.1), turn, at);
            Object::Mesh(Box::new(MeshInstance::new(Arc::clone(&trees[tree]), transform, false)))
        };
        let objects = [2, 0, 1, 3, 2].into_iter().enumerate().map(placed).collect();
        Geometry::build(objects, &CancelToken::new()).expect("never canceled")
    }

    #[test]
    fn triangle_numbers_are_unique_across_meshes() {
        let geometry = geometry();
        let mut seen = std::collections::HashSet::new();
        for (object, own) in (0..).zip(geometry.objects()) {
            for primitive in 0..own.triangle_count() as u32 {
                let hit = Hit { shape: ShapeHit { primitive, ..ShapeHit::from_t(1.0) }, object };
                assert!(seen.insert(geometry.scene_triangle_number(&hit)), "{object} {primitive}");
            }
        }
        assert!(!seen.contains(&Ray::NO_TRIANGLE));
    }

    #[test]
    fn ignoring_the_start_triangle_preserves_hits() {
        let geometry = geometry();
        let mut next = random(5);
        let (mut started, mut hits) = (0, [0; 5]);
        while started < 8000 {
            let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
            let place = Vec3::X * (4 * (started as u32 % 5)) as f32;
            let ray = Ray::new(place + vector(3.0), vector(1.0));
            let Some(hit) = geometry.closest_hit(&ray) else { continue };
            let surface = geometry.surface(&ray, &hit);
            let direction = vector(1.0).normalize();
            let origin = offset_origin(surface.point, surface.error, surface.normal, direction);
            let leaving =
                Ray::new(origin, direction).with_start_triangle(geometry.scene_triangle_number(&hit));
            let found = geometry.closest_hit(&leaving);
            assert_eq!(found, geometry.closest_hit(&Ray::new(origin, direction)), "{hit:?} {leaving:?}");
            started += 1;
            hits[hit.object as usize] += u32::from(found.is_some());
        }
        assert!(hits.iter().all(|&hits| hits > 10), "{hits:?} hits by rays starting on each object");
    }
}
