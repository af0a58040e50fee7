//! A mesh placed in the scene by a transform.

use std::sync::Arc;

use super::mesh_packet::interpolate_corner_uvs;
use super::mesh_tree::MeshTree;
use super::placement::{IdentityPlacement, MeshPlacement};
use super::triangle_point::{EDGE_MARGIN, PlacedMesh, TrianglePoint};
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket, set_bit_lanes};
use crate::geometry::{Aabb, Ray, RayF64, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::materials::UvSet;
use crate::math::transform::Transform;
use crate::math::{DVec3, Vec2, Vec3};

/// An instance of a mesh.
#[derive(Clone, Debug)]
pub struct MeshInstance {
    /// The shared mesh and its tree.
    pub tree: Arc<MeshTree>,
    /// Mesh-to-world transform.
    pub transform: Transform,
    /// Whether vertex normals are interpolated.
    pub smooth: bool,
    /// Whether the mesh is included in the tree of [`MergedMeshes`](super::MergedMeshes), in world
    /// coordinates.
    pub(super) is_merged: bool,
    /// Scene-wide number of the mesh's first triangle, or `None` if the scene has too many triangles for
    /// `u32`.
    pub(super) first: Option<u32>,
    /// Whether the transform is not the identity.
    pub(super) is_transformed: bool,
    /// Minimum distance from triangle edges, as a multiple of the point error, in mesh coordinates.
    edge_margin: f64,
}

impl MeshInstance {
    /// Creates an unmerged instance, with a separate tree.
    pub fn new(tree: Arc<MeshTree>, transform: Transform, smooth: bool) -> Self {
        let edge_margin = EDGE_MARGIN * transform.max_inverse_stretch();
        let is_transformed = transform != Transform::IDENTITY;
        Self { tree, transform, smooth, is_merged: false, first: None, is_transformed, edge_margin }
    }

    /// Transforms a ray to mesh coordinates without changing t.
    pub(super) fn local_ray(&self, ray: &Ray) -> Ray {
        let start = self.triangle_number_in_mesh(ray.start);
        if self.is_transformed {
            self.transform_ray_to_mesh(ray).with_start_triangle(start)
        } else {
            ray.with_start_triangle(start)
        }
    }

    /// Applies the inverse transform to a ray.
    fn transform_ray_to_mesh(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.transform.inverse_point(ray.origin.as_dvec3()).as_vec3(),
            direction: self.transform.inverse_vector(ray.direction.as_dvec3()).as_vec3(),
            ..*ray
        }
    }

    /// Scene-wide number of a triangle; see
    /// [`Geometry::scene_triangle_number`](super::Geometry::scene_triangle_number).
    #[inline(always)]
    pub(super) fn scene_triangle_number(&self, triangle: u32) -> u32 {
        self.first.map_or(Ray::NO_TRIANGLE, |first| first + triangle)
    }

    /// Like `scene_triangle_number`, for a packet. Lanes without a triangle contain arbitrary numbers.
    #[inline(always)]
    pub fn packet_scene_triangle_numbers(&self, triangles: &[u32; PACKET_SIZE]) -> [u32; PACKET_SIZE] {
        let Some(first) = self.first else { return [Ray::NO_TRIANGLE; PACKET_SIZE] };
        triangles.map(|triangle| first.wrapping_add(triangle))
    }

    /// Converts a scene-wide triangle number to this mesh's numbering. For another mesh's triangle, the
    /// result is out of range.
    #[inline(always)]
    pub(super) fn triangle_number_in_mesh(&self, in_scene: u32) -> u32 {
        self.first.map_or(Ray::NO_TRIANGLE, |first| in_scene.wrapping_sub(first))
    }

    /// Bounding box in world coordinates.
    pub(super) fn bounds(&self) -> Aabb {
        let local = self.tree.bounds();
        if local.is_empty() {
            return Aabb::EMPTY;
        }
        let corner = |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { local.min[axis] } else { local.max[axis] };
            self.transform.point(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        };
        Aabb::from_points_f64((0..8).map(corner))
    }

    /// Corners of a triangle in world coordinates, ordered so that the front side faces along (b − a) × (c −
    /// a).
    pub fn world_corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] =
            self.tree.loaded_mesh().mesh.corners(triangle).map(|p| self.transform.point(p.as_dvec3()));
        if self.transform.flips_handedness() { [a, c, b] } else { [a, b, c] }
    }

    /// Corners of a triangle in mesh coordinates and file order.
    pub(super) fn local_corners(&self, triangle: u32) -> [DVec3; 3] {
        self.tree.loaded_mesh().mesh.corners(triangle).map(|corner| corner.as_dvec3())
    }

    /// Number of triangles in the mesh.
    pub(super) fn triangle_count(&self) -> usize {
        self.tree.loaded_mesh().mesh.triangles.len()
    }

    /// Whether world coordinates differ from mesh coordinates.
    pub(super) fn is_transformed(&self) -> bool {
        self.is_transformed
    }

    /// Corners of a triangle in world coordinates, rounded to `f32`, in file order.
    pub(super) fn world_corners_rounded_to_f32(&self, triangle: u32) -> [Vec3; 3] {
        let corners = self.tree.loaded_mesh().mesh.corners(triangle);
        if !self.is_transformed {
            return corners;
        }
        corners.map(|corner| self.transform.point(corner.as_dvec3()).as_vec3())
    }

    /// Vertex UVs in one of the UV sets. Falls back to the first set if there is no second set.
    #[inline(always)]
    pub(super) fn all_vertex_uvs_in_set(&self, set: UvSet) -> &[Vec2] {
        let mesh = &self.tree.loaded_mesh().mesh;
        match set {
            UvSet::Second if !mesh.second_uvs.is_empty() => &mesh.second_uvs,
            UvSet::Second | UvSet::First => &mesh.uvs,
        }
    }

    /// UVs of a triangle's corners, in the order of [`MeshInstance::world_corners`].
    pub fn corner_uvs(&self, triangle: u32) -> [Vec2; 3] {
        self.values_at_world_corners(triangle, self.all_vertex_uvs_in_set(UvSet::First)).unwrap_or([
            Vec2::ZERO,
            Vec2::X,
            Vec2::Y,
        ])
    }

    /// UVs of a triangle's corners in the second UV set, if there is one.
    pub fn second_set_corner_uvs(&self, triangle: u32) -> Option<[Vec2; 3]> {
        self.values_at_world_corners(triangle, &self.tree.loaded_mesh().mesh.second_uvs)
    }

    /// Vertex values at a triangle's corners, in the order of [`MeshInstance::world_corners`], or `None` if
    /// `values` is empty.
    fn values_at_world_corners(&self, triangle: u32, values: &[Vec2]) -> Option<[Vec2; 3]> {
        let corners = self.tree.loaded_mesh().mesh.triangles[triangle as usize];
        let [a, b, c] = corners.map(|vertex| values.get(vertex as usize).copied());
        let (a, b, c) = (a?, b?, c?);
        Some(if self.transform.flips_handedness() { [a, c, b] } else { [a, b, c] })
    }

    /// UV and tangents at a hit in the second UV set, if there is one.
    pub(super) fn second_uv_and_tangents(&self, hit: &ShapeHit) -> Option<(Vec2, [Vec3; 2])> {
        let mesh = &self.tree.loaded_mesh().mesh;
        if mesh.second_uvs.is_empty() {
            return None;
        }
        let vertices = mesh.triangles[hit.primitive as usize].map(|vertex| vertex as usize);
        let [a, b, c] = vertices.map(|vertex| mesh.positions[vertex].as_dvec3());
        let barycentric = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
        let (uv, dpdu, dpdv) = self.uv_and_tangents(&mesh.second_uvs, vertices, barycentric, [b - a, c - a]);
        Some((uv, [dpdu, dpdv]))
    }

    /// Mean curvature of the surface approximated by a triangle, estimated from the vertex normals
    /// (Akenine-Möller et al. 2021, section 4). It is positive if the surface is convex on its front side.
    pub(super) fn mean_curvature(&self, triangle: u32, normal: Vec3) -> f32 {
        if !self.smooth {
            return 0.0;
        }
        let (mesh, normals) = (&self.tree.loaded_mesh().mesh, self.tree.file_or_computed_normals());
        let vertices = mesh.triangles[triangle as usize].map(|vertex| {
            let own = self.transform.normal(normals[vertex as usize].as_dvec3()).normalize_or_zero();
            let own = if own.dot(normal.as_dvec3()) < 0.0 { -own } else { own };
            (self.transform.point(mesh.positions[vertex as usize].as_dvec3()), own)
        });
        let along = |i: usize| {
            let ((p, m), (q, n)) = (vertices[i], vertices[(i + 1) % 3]);
            let curvature = (n - m).dot(q - p) / (q - p).length_squared();
            if curvature.is_finite() { curvature } else { 0.0 }
        };
        ((along(0) + along(1) + along(2)) / 3.0) as f32
    }

    /// Combines this mesh with `placement`, which must represent the mesh's transform.
    #[inline(always)]
    pub(super) fn to_placed_mesh<P>(&self, placement: P) -> PlacedMesh<P> {
        PlacedMesh {
            placement,
            edge_margin: self.edge_margin,
            has_rounded_corners: self.is_merged && self.is_transformed,
        }
    }

    /// Computes the requested surface attributes at a hit.
    pub(super) fn surface_point_with_fields(
        &self,
        ray: &RayF64,
        hit: &ShapeHit,
        request: SurfaceRequest,
    ) -> SurfacePoint {
        match self.is_transformed {
            true => self.surface_using_placement(self.to_placed_mesh(&self.transform), ray, hit, request),
            false => self.surface_using_placement(self.to_placed_mesh(IdentityPlacement), ray, hit, request),
        }
    }

    fn surface_using_placement(
        &self,
        placed: PlacedMesh<impl MeshPlacement>,
        ray: &RayF64,
        hit: &ShapeHit,
        request: SurfaceRequest,
    ) -> SurfacePoint {
        let mesh = &self.tree.loaded_mesh().mesh;
        let vertices = mesh.triangles[hit.primitive as usize].map(|vertex| vertex as usize);
        let facet = placed.triangle_point(vertices.map(|vertex| mesh.positions[vertex]), [hit.u, hit.v]);
        let TrianglePoint { corners: [a, b, c], normal, barycentric, .. } = facet;
        let [point, error] = match facet.may_need_correction() {
            true => placed.corrected_point_and_error(&facet, ray, [hit.u, hit.v]),
            false => [facet.point, facet.error],
        };
        let (uv, dpdu, dpdv) = if request.uv {
            self.uv_and_tangents(&mesh.uvs, vertices, barycentric, [b - a, c - a])
        } else {
            (Vec2::ZERO, Vec3::ZERO, Vec3::ZERO)
        };
        let (mut shading_normal, mut shadow_point) = (normal, point);
        if self.smooth {
            let normals = self.tree.file_or_computed_normals();
            let normals = vertices.map(|vertex| normals[vertex]);
            shading_normal = placed.shading_normal(&facet, &normals);
            if request.shadow_point && !placed.uses_point_from_ray(&facet, ray) {
                shadow_point = placed.lifted_shadow_origin(&facet, &normals, ray.direction);
            }
        }
        SurfacePoint {
            point,
            shadow_point,
            error,
            normal,
            shading_normal,
            uv: uv.as_dvec2(),
            dpdu,
            dpdv,
            barycentric,
        }
    }

    /// UV and tangents at a point on a triangle. Uses barycentric coordinates if the mesh has no UVs.
    fn uv_and_tangents(
        &self,
        uvs: &[Vec2],
        vertices: [usize; 3],
        barycentric: Vec3,
        [ab, ac]: [DVec3; 2],
    ) -> (Vec2, Vec3, Vec3) {
        let world = |v: DVec3| self.transform.vector(v).as_vec3();
        if uvs.is_empty() {
            return (Vec2::new(barycentric.y, barycentric.z), world(ab), world(ac));
        }
        let [a, b, c] = vertices.map(|vertex| uvs[vertex]);
        let uv = interpolate_corner_uvs([a, b, c], barycentric);
        let (duv_b, duv_c) = ((b - a).as_dvec2(), (c - a).as_dvec2());
        let determinant = duv_b.perp_dot(duv_c);
        if determinant == 0.0 || !determinant.is_finite() {
            return (uv, Vec3::ZERO, Vec3::ZERO);
        }
        let dpdu = (ab * duv_c.y - ac * duv_b.y) / determinant;
        let dpdv = (ac * duv_b.x - ab * duv_c.x) / determinant;
        (uv, world(dpdu), world(dpdv))
    }

    /// Finds the nearest hits of the rays in `active`. Other lanes have negative `ends`.
    #[inline(never)]
    pub(super) fn closest_hit_packet(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        found: &mut HitPacket,
    ) {
        let mut hits = [None; PACKET_SIZE];
        self.tree.triangle_tree().closest_hit_packet(&self.local_rays(rows, active), ends, &mut hits);
        for (lane, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                found.set(lane, hit);
            }
        }
    }

    /// Returns the mask of rays in `active` that hit any triangle other than the ignored triangle (see
    /// `except` in [`Object::any_hit_packet`](super::Object::any_hit_packet)).
    #[inline(never)]
    pub(super) fn any_hit_packet(
        &self,
        rows: &RayPacket,
        active: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
    ) -> u32 {
        let local = self.local_rays(rows, active);
        let Some((own, numbers)) = except else {
            return self.tree.triangle_tree().any_hit_packet(&local, ends, &[]);
        };
        let mut parts = [None; PACKET_SIZE];
        set_bit_lanes(own).for_each(|lane| parts[lane] = Some(numbers[lane]));
        self.tree.triangle_tree().any_hit_packet(&local, ends, &parts)
    }

    /// Transforms the rays in `active` to mesh coordinates. Other lanes contain a copy of the first ray in
    /// `active`, whose direction is likely similar.
    #[inline]
    fn local_rays(&self, rows: &RayPacket, active: u32) -> [Ray; PACKET_SIZE] {
        let local = |lane: usize| {
            let ray = rows.ray(lane % PACKET_SIZE);
            let ray = ray.with_start_triangle(self.triangle_number_in_mesh(ray.start));
            if self.is_transformed { self.transform_ray_to_mesh(&ray) } else { ray }
        };
        let mut rays = [local(active.trailing_zeros() as usize); PACKET_SIZE];
        for lane in set_bit_lanes(active & active.wrapping_sub(1)) {
            rays[lane] = local(lane);
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::mesh::TriangleMesh;
    use crate::math::random::signed_number_generator as random;
    use crate::scene::description::Accel;

    #[test]
    fn transformed_points_are_within_their_error_bounds() {
        let mut next = random(23);
        let mut vector = || DVec3::from_array(std::array::from_fn(|_| f64::from(next())));
        let mesh = TriangleMesh {
            positions: (0..30).map(|_| vector().as_vec3()).collect(),
            triangles: (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..TriangleMesh::default()
        };
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let tree = MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled");
        let tree = Arc::new(tree);
        for _ in 0..20 {
            let transform = Transform::scale_rotate_translate(vector(), vector() * 180.0, vector());
            let mesh = MeshInstance::new(Arc::clone(&tree), transform, false);
            for primitive in 0..10 {
                let hit = ShapeHit { primitive, u: 0.5, v: 0.25, t: 1.0 };
                let surface = mesh.surface_point_with_fields(
                    &Ray::new(Vec3::ZERO, Vec3::Z).to_f64(),
                    &hit,
                    SurfaceRequest::ALL,
                );
                let [a, b, c] = mesh.tree.loaded_mesh().mesh.corners(primitive);
                let [a, b, c] = [a, b, c].map(|corner| transform.point(corner.as_dvec3()));
                let off = surface.point.as_dvec3() - (a * 0.25 + b * 0.5 + c * 0.25);
                assert!(off.abs().cmple(surface.error.as_dvec3()).all(), "{off} {}", surface.error);
                let across = (b - a).cross(c - a).normalize() * transform.linear.determinant().signum();
                assert!((surface.normal.as_dvec3() - across).length() < 1e-6, "{across}");
            }
        }
    }
}
