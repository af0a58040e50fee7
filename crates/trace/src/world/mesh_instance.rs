//! Instances of meshes.

use std::sync::Arc;

use super::mesh_facet::{ASIDE, Facet, PlacedMesh};
use super::mesh_rows::uv_between;
use super::mesh_tree::MeshTree;
use super::placement::{Placement, Unmoved};
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::packet::{HitPacket, RayPacket, lanes};
use crate::geometry::{Aabb, Ray, RayF64, ShapeHit, SurfacePoint, SurfaceRequest};
use crate::materials::UvSet;
use crate::math::transform::Transform;
use crate::math::{DVec3, Vec2, Vec3};

/// An instance of a mesh.
#[derive(Clone, Debug)]
pub struct MeshInstance {
    /// The triangles.
    pub tree: Arc<MeshTree>,
    /// Map from the mesh's coordinates to the world's.
    pub transform: Transform,
    /// Whether to interpolate vertex normals.
    pub smooth: bool,
    /// Whether rays find it in a tree over several meshes, in the scene's coordinates.
    pub(super) is_merged: bool,
    /// Number of its first triangle among those of all meshes. `None` if there are more than numbers.
    pub(super) first: Option<u32>,
    /// Whether its coordinates are not the scene's.
    pub(super) is_moved: bool,
    /// Factor from errors of points to the least distance from edges, in the mesh's coordinates.
    aside: f64,
}

impl MeshInstance {
    /// An instance of a mesh with its own tree.
    pub fn new(tree: Arc<MeshTree>, transform: Transform, smooth: bool) -> Self {
        let aside = ASIDE * transform.max_inverse_stretch();
        let is_moved = transform != Transform::IDENTITY;
        Self { tree, transform, smooth, is_merged: false, first: None, is_moved, aside }
    }

    /// The ray in the mesh's coordinates, with the same t.
    pub(super) fn local_ray(&self, ray: &Ray) -> Ray {
        let start = self.own_number(ray.start);
        if self.is_moved { self.moved(ray).leaving(start) } else { ray.leaving(start) }
    }

    /// The ray in the mesh's coordinates, if the mesh is moved.
    fn moved(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.transform.inverse_point(ray.origin.as_dvec3()).as_vec3(),
            direction: self.transform.inverse_vector(ray.direction.as_dvec3()).as_vec3(),
            ..*ray
        }
    }

    /// The scene's number of a triangle, see [`Geometry::triangle_number`](super::Geometry::triangle_number).
    #[inline(always)]
    pub(super) fn scene_number(&self, triangle: u32) -> u32 {
        self.first.map_or(Ray::NO_TRIANGLE, |first| first + triangle)
    }

    /// `scene_number` of the triangles of a row; any numbers for lanes without one.
    #[inline(always)]
    pub fn scene_numbers(&self, triangles: &[u32; PACKET_SIZE]) -> [u32; PACKET_SIZE] {
        let Some(first) = self.first else { return [Ray::NO_TRIANGLE; PACKET_SIZE] };
        triangles.map(|triangle| first.wrapping_add(triangle))
    }

    /// The number among the mesh's triangles of the one with this number in the scene; if that is another mesh's, a number that
    /// no triangle has.
    #[inline(always)]
    pub(super) fn own_number(&self, in_scene: u32) -> u32 {
        self.first.map_or(Ray::NO_TRIANGLE, |first| in_scene.wrapping_sub(first))
    }

    /// The box around it.
    pub(super) fn bounds(&self) -> Aabb {
        let local = self.tree.bounds();
        if local.is_empty() {
            return Aabb::EMPTY;
        }
        let corner = |i: usize| {
            let pick = |axis: usize| if i & (1 << axis) == 0 { local.min[axis] } else { local.max[axis] };
            self.transform.point(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3())
        };
        Aabb::around_f64((0..8).map(corner))
    }

    /// Corners of a triangle in world coordinates, ordered so that the front is along (b − a) × (c − a).
    pub fn world_corners(&self, triangle: u32) -> [DVec3; 3] {
        let [a, b, c] = self.tree.loaded().mesh.corners(triangle).map(|p| self.transform.point(p.as_dvec3()));
        if self.transform.flips_handedness() { [a, c, b] } else { [a, b, c] }
    }

    /// Corners of a triangle in the mesh's coordinates, in the order of the file.
    pub(super) fn local_corners(&self, triangle: u32) -> [DVec3; 3] {
        self.tree.loaded().mesh.corners(triangle).map(|corner| corner.as_dvec3())
    }

    /// Number of triangles of the mesh.
    pub(super) fn triangle_count(&self) -> usize {
        self.tree.loaded().mesh.triangles.len()
    }

    /// Corners of a triangle in the scene's coordinates, rounded, in the order of the file.
    pub(super) fn rounded_corners(&self, triangle: u32) -> [Vec3; 3] {
        let corners = self.tree.loaded().mesh.corners(triangle);
        if !self.is_moved {
            return corners;
        }
        corners.map(|corner| self.transform.point(corner.as_dvec3()).as_vec3())
    }

    /// Texture coordinates of the vertices by a set; those of the first if there is no second.
    #[inline(always)]
    pub(super) fn uvs(&self, set: UvSet) -> &[Vec2] {
        let mesh = &self.tree.loaded().mesh;
        match set {
            UvSet::Second if !mesh.second_uvs.is_empty() => &mesh.second_uvs,
            UvSet::Second | UvSet::First => &mesh.uvs,
        }
    }

    /// Texture coordinates of the corners of a triangle, in the order of [`MeshInstance::world_corners`].
    pub fn corner_uvs(&self, triangle: u32) -> [Vec2; 3] {
        self.ordered(triangle, self.uvs(UvSet::First)).unwrap_or([Vec2::ZERO, Vec2::X, Vec2::Y])
    }

    /// The same of the second set. `None` without one.
    pub fn second_corner_uvs(&self, triangle: u32) -> Option<[Vec2; 3]> {
        self.ordered(triangle, &self.tree.loaded().mesh.second_uvs)
    }

    /// Values of the corners of a triangle, in the order of [`MeshInstance::world_corners`]. `None` if vertices have no values.
    fn ordered(&self, triangle: u32, values: &[Vec2]) -> Option<[Vec2; 3]> {
        let corners = self.tree.loaded().mesh.triangles[triangle as usize];
        let [a, b, c] = corners.map(|vertex| values.get(vertex as usize).copied());
        let (a, b, c) = (a?, b?, c?);
        Some(if self.transform.flips_handedness() { [a, c, b] } else { [a, b, c] })
    }

    /// The point at a hit by the second set of texture coordinates, with its tangents. `None` without one.
    pub(super) fn second_parametrisation(&self, hit: &ShapeHit) -> Option<(Vec2, [Vec3; 2])> {
        let mesh = &self.tree.loaded().mesh;
        if mesh.second_uvs.is_empty() {
            return None;
        }
        let vertices = mesh.triangles[hit.primitive as usize].map(|vertex| vertex as usize);
        let [a, b, c] = vertices.map(|vertex| mesh.positions[vertex].as_dvec3());
        let barycentric = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
        let (uv, dpdu, dpdv) = self.parametrisation(&mesh.second_uvs, vertices, barycentric, [b - a, c - a]);
        Some((uv, [dpdu, dpdv]))
    }

    /// Mean curvature of the surface that a triangle approximates, by its vertices' normals (Akenine-Möller et al. 2021, section
    /// 4), > 0 if it bulges to the front.
    pub(super) fn curvature(&self, triangle: u32, normal: Vec3) -> f32 {
        if !self.smooth {
            return 0.0;
        }
        let (mesh, normals) = (&self.tree.loaded().mesh, self.tree.normals());
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

    /// The mesh by its own placement, given in its kind.
    #[inline(always)]
    pub(super) fn placed<P>(&self, placement: P) -> PlacedMesh<P> {
        PlacedMesh { placement, aside: self.aside, has_rounded_corners: self.is_merged && self.is_moved }
    }

    /// The requested parts of the surface at a hit.
    pub(super) fn surface(&self, ray: &RayF64, hit: &ShapeHit, asked: SurfaceRequest) -> SurfacePoint {
        match self.is_moved {
            true => self.surface_in(self.placed(&self.transform), ray, hit, asked),
            false => self.surface_in(self.placed(Unmoved), ray, hit, asked),
        }
    }

    fn surface_in(
        &self,
        placed: PlacedMesh<impl Placement>,
        ray: &RayF64,
        hit: &ShapeHit,
        asked: SurfaceRequest,
    ) -> SurfacePoint {
        let mesh = &self.tree.loaded().mesh;
        let vertices = mesh.triangles[hit.primitive as usize].map(|vertex| vertex as usize);
        let facet = placed.facet(vertices.map(|vertex| mesh.positions[vertex]), [hit.u, hit.v]);
        let Facet { corners: [a, b, c], normal, barycentric, .. } = facet;
        let [point, error] = match facet.is_doubtful() {
            true => placed.corrected(&facet, ray, [hit.u, hit.v]),
            false => [facet.point, facet.error],
        };
        let (uv, dpdu, dpdv) = if asked.uv {
            self.parametrisation(&mesh.uvs, vertices, barycentric, [b - a, c - a])
        } else {
            (Vec2::ZERO, Vec3::ZERO, Vec3::ZERO)
        };
        let (mut shading_normal, mut shadow_point) = (normal, point);
        if self.smooth {
            let normals = self.tree.normals();
            let normals = vertices.map(|vertex| normals[vertex]);
            shading_normal = placed.shading_normal(&facet, &normals);
            if asked.shadow_point && !placed.is_on_ray(&facet, ray) {
                shadow_point = placed.shadow_point(&facet, &normals, ray.direction);
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

    /// Texture coordinates and their tangents; without texture coordinates, the barycentric ones.
    fn parametrisation(
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
        let uv = uv_between([a, b, c], barycentric);
        let (duv_b, duv_c) = ((b - a).as_dvec2(), (c - a).as_dvec2());
        let determinant = duv_b.perp_dot(duv_c);
        if determinant == 0.0 || !determinant.is_finite() {
            return (uv, Vec3::ZERO, Vec3::ZERO);
        }
        let dpdu = (ab * duv_c.y - ac * duv_b.y) / determinant;
        let dpdv = (ac * duv_b.x - ab * duv_c.x) / determinant;
        (uv, world(dpdu), world(dpdv))
    }

    /// The nearest hits of the rays in `met`; the others end below 0.
    #[inline(never)]
    pub(super) fn closest_rows(&self, rows: &RayPacket, met: u32, ends: &F32x16, found: &mut HitPacket) {
        let mut hits = [None; PACKET_SIZE];
        self.tree.triangles().closest_packet(&self.local_rays(rows, met), ends, &mut hits);
        for (lane, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                found.put(lane, hit);
            }
        }
    }

    /// A bit for each ray in `met` that hits any triangle but its own of `except`.
    #[inline(never)]
    pub(super) fn any_rows(
        &self,
        rows: &RayPacket,
        met: u32,
        ends: &F32x16,
        except: Option<(u32, &[u32; PACKET_SIZE])>,
    ) -> u32 {
        let local = self.local_rays(rows, met);
        let Some((own, numbers)) = except else { return self.tree.triangles().any_packet(&local, ends, &[]) };
        let mut parts = [None; PACKET_SIZE];
        lanes(own).for_each(|lane| parts[lane] = Some(numbers[lane]));
        self.tree.triangles().any_packet(&local, ends, &parts)
    }

    /// The rays of a packet that are in `met`, in the mesh's coordinates; other lanes get the first of these rays, which goes in a
    /// similar direction.
    #[inline]
    fn local_rays(&self, rows: &RayPacket, met: u32) -> [Ray; PACKET_SIZE] {
        let local = |lane: usize| {
            let ray = rows.ray(lane % PACKET_SIZE);
            let ray = ray.leaving(self.own_number(ray.start));
            if self.is_moved { self.moved(&ray) } else { ray }
        };
        let mut rays = [local(met.trailing_zeros() as usize); PACKET_SIZE];
        for lane in lanes(met & met.wrapping_sub(1)) {
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
    use crate::math::random::signed as random;
    use crate::scene::description::Accel;

    #[test]
    fn points_of_a_moved_mesh_are_between_its_corners() {
        let mut next = random(23);
        let mut vector = || DVec3::from_array(std::array::from_fn(|_| f64::from(next())));
        let mesh = TriangleMesh {
            positions: (0..30).map(|_| vector().as_vec3()).collect(),
            triangles: (0..10).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..TriangleMesh::default()
        };
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let tree = MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("nobody cancels");
        let tree = Arc::new(tree);
        for _ in 0..20 {
            let transform = Transform::scale_rotate_translate(vector(), vector() * 180.0, vector());
            let mesh = MeshInstance::new(Arc::clone(&tree), transform, false);
            for primitive in 0..10 {
                let hit = ShapeHit { primitive, u: 0.5, v: 0.25, t: 1.0 };
                let surface =
                    mesh.surface(&Ray::new(Vec3::ZERO, Vec3::Z).to_f64(), &hit, SurfaceRequest::ALL);
                let [a, b, c] = mesh.tree.loaded().mesh.corners(primitive);
                let [a, b, c] = [a, b, c].map(|corner| transform.point(corner.as_dvec3()));
                let off = surface.point.as_dvec3() - (a * 0.25 + b * 0.5 + c * 0.25);
                assert!(off.abs().cmple(surface.error.as_dvec3()).all(), "{off} {}", surface.error);
                let across = (b - a).cross(c - a).normalize() * transform.linear.determinant().signum();
                assert!((surface.normal.as_dvec3() - across).length() < 1e-6, "{across}");
            }
        }
    }
}
