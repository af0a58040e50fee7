//! Surface attributes of a mesh for all hits in a packet.

use super::MeshInstance;
use super::placement::{IdentityPlacement, MeshPlacement};
use super::triangle_point::PlacedMesh;
use crate::accel::{PACKET_SIZE, SimdKernel};
use crate::geometry::packet::{HitPacket, RayPacket, set_bit_lanes};
use crate::geometry::surface_packet::SurfacePacket;
use crate::materials::UvSet;
use crate::math::lanes::{Simd, TRUE, Vec3x16, lane, set_lane};
use crate::math::{Vec2, Vec3};

impl MeshInstance {
    /// Computes the surfaces at the hits in `of`, which must all be on this instance. Includes UVs if a set
    /// is requested.
    #[inline(always)]
    pub fn fill_surfaces(
        &self,
        surface: &mut SurfacePacket,
        rays: &RayPacket,
        hits: &HitPacket,
        of: u32,
        asked_uvs: Option<UvSet>,
        simd: impl Simd,
    ) {
        simd.call_out_of_line(FillSurfacesKernel { mesh: self, surface, rays, hits, of, asked_uvs });
    }

    #[inline(always)]
    fn fill_placed_surfaces(
        &self,
        placed: PlacedMesh<impl MeshPlacement>,
        surface: &mut SurfacePacket,
        (rays, hits): (&RayPacket, &HitPacket),
        of: u32,
        asked_uvs: Option<UvSet>,
        simd: impl Simd,
    ) {
        let mesh = &self.tree.loaded_mesh().mesh;
        // Other lanes contain a copy of an arbitrary triangle, and their results are discarded.
        let filler = hits.primitive[of.trailing_zeros() as usize % PACKET_SIZE];
        let mut vertices = [[0; 3]; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let triangle = if of & 1 << i != 0 { hits.primitive[i] } else { filler };
            vertices[i] = mesh.triangles[triangle as usize];
        }
        let corners = gather_vertex_attributes(&vertices, &mesh.positions);
        let corners_of = |i: usize| [lane(&corners[0], i), lane(&corners[1], i), lane(&corners[2], i)];
        let (mut found, mut doubtful) = (SurfacePacket::EMPTY, [0; PACKET_SIZE]);
        for i in 0..PACKET_SIZE {
            let facet = placed.triangle_point(corners_of(i), [hits.u[i], hits.v[i]]);
            set_lane(&mut found.point, i, facet.point);
            set_lane(&mut found.error, i, facet.error);
            set_lane(&mut found.normal, i, facet.normal);
            doubtful[i] = if facet.may_need_correction() { TRUE } else { 0 };
        }
        // Hits near an edge or in a huge triangle are rare.
        let doubtful = simd.movemask(&doubtful) & of;
        let mut on_ray = 0;
        if doubtful != 0 {
            on_ray = correct_doubtful_points(&placed, &corners, (rays, hits), doubtful, &mut found);
        }
        surface.copy_surface_lanes_from(of, &found);
        if self.smooth {
            let normals = gather_vertex_attributes(&vertices, self.tree.file_or_computed_normals());
            let normals_of = |i: usize| [lane(&normals[0], i), lane(&normals[1], i), lane(&normals[2], i)];
            for i in 0..PACKET_SIZE {
                let facet = placed.triangle_point(corners_of(i), [hits.u[i], hits.v[i]]);
                set_lane(&mut found.shading_normal, i, placed.shading_normal(&facet, &normals_of(i)));
            }
            for i in 0..PACKET_SIZE {
                let facet = placed.triangle_point(corners_of(i), [hits.u[i], hits.v[i]]);
                let direction = lane(&rays.direction, i).as_dvec3();
                let lifted = placed.lifted_shadow_origin(&facet, &normals_of(i), direction);
                set_lane(&mut found.shadow_point, i, lifted);
            }
            for i in set_bit_lanes(on_ray) {
                set_lane(&mut found.shadow_point, i, lane(&found.point, i));
            }
            surface.copy_shading_lanes_from(of, &found);
        }
        if let Some(set) = asked_uvs {
            let all = self.all_vertex_uvs_in_set(set);
            for i in 0..PACKET_SIZE {
                let uvs = match all {
                    [] => [Vec2::ZERO, Vec2::X, Vec2::Y],
                    uvs => vertices[i].map(|vertex| uvs[vertex as usize]),
                };
                let uv =
                    interpolate_corner_uvs(uvs, Vec3::new(1.0 - hits.u[i] - hits.v[i], hits.u[i], hits.v[i]));
                let is_own = of & 1 << i != 0;
                surface.uv[0][i] = if is_own { f64::from(uv.x) } else { surface.uv[0][i] };
                surface.uv[1][i] = if is_own { f64::from(uv.y) } else { surface.uv[1][i] };
            }
        }
    }
}

/// Kernel of [`MeshInstance::fill_surfaces`].
struct FillSurfacesKernel<'a> {
    mesh: &'a MeshInstance,
    surface: &'a mut SurfacePacket,
    rays: &'a RayPacket,
    hits: &'a HitPacket,
    of: u32,
    asked_uvs: Option<UvSet>,
}

impl SimdKernel for FillSurfacesKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: impl Simd) {
        let Self { mesh, surface, rays, hits, of, asked_uvs } = self;
        if mesh.is_transformed {
            mesh.fill_placed_surfaces(
                mesh.to_placed_mesh(&mesh.transform),
                surface,
                (rays, hits),
                of,
                asked_uvs,
                simd,
            );
        } else {
            mesh.fill_placed_surfaces(
                mesh.to_placed_mesh(IdentityPlacement),
                surface,
                (rays, hits),
                of,
                asked_uvs,
                simd,
            );
        }
    }
}

/// Corrects the doubtful points one by one. Returns the lanes whose points were moved onto their rays. Not
/// inlined, to keep the SIMD code small.
#[cold]
#[inline(never)]
fn correct_doubtful_points(
    placed: &PlacedMesh<impl MeshPlacement>,
    corners: &[Vec3x16; 3],
    (rays, hits): (&RayPacket, &HitPacket),
    doubtful: u32,
    found: &mut SurfacePacket,
) -> u32 {
    let mut on_ray = 0;
    for i in set_bit_lanes(doubtful) {
        let (ray, uv) = (rays.ray(i).to_f64(), [hits.u[i], hits.v[i]]);
        let facet =
            placed.triangle_point([lane(&corners[0], i), lane(&corners[1], i), lane(&corners[2], i)], uv);
        let [point, error] = placed.corrected_point_and_error(&facet, &ray, uv);
        set_lane(&mut found.point, i, point);
        set_lane(&mut found.error, i, error);
        on_ray |= if placed.uses_point_from_ray(&facet, &ray) { 1 << i } else { 0 };
    }
    on_ray
}

/// Interpolates the UVs of a triangle's corners.
#[inline(always)]
pub(super) fn interpolate_corner_uvs([a, b, c]: [Vec2; 3], barycentric: Vec3) -> Vec2 {
    a * barycentric.x + b * barycentric.y + c * barycentric.z
}

/// Gathers the vertex attributes for the triangles' first, second and third corners.
#[inline(always)]
fn gather_vertex_attributes(vertices: &[[u32; 3]; PACKET_SIZE], all: &[Vec3]) -> [Vec3x16; 3] {
    let mut each = [[[0.0; PACKET_SIZE]; 3]; 3];
    for i in 0..PACKET_SIZE {
        for corner in 0..3 {
            set_lane(&mut each[corner], i, all[vertices[i][corner] as usize]);
        }
    }
    each
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::accel::InstructionSet;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::mesh::TriangleMesh;
    use crate::geometry::{Ray, ShapeHit, SurfaceRequest};
    use crate::math::DVec3;
    use crate::math::random::signed_number_generator as random;
    use crate::math::transform::Transform;
    use crate::scene::description::Accel;
    use crate::world::MeshTree;

    struct FillMesh<'a> {
        mesh: &'a MeshInstance,
        rays: &'a [Ray],
        hits: &'a HitPacket,
        of: u32,
        set: UvSet,
    }

    impl SimdKernel for FillMesh<'_> {
        type Output = SurfacePacket;

        #[inline(always)]
        fn run(self, simd: impl Simd) -> SurfacePacket {
            let mut surface = SurfacePacket::EMPTY;
            let (rows, _) = RayPacket::new(self.rays);
            self.mesh.fill_surfaces(&mut surface, &rows, self.hits, self.of, Some(self.set), simd);
            surface
        }
    }

    /// Triangles of all sizes with random normals, including a zero normal.
    fn meshes() -> Vec<MeshInstance> {
        let mut next = random(5);
        let mut vector = || Vec3::new(next(), next(), next());
        let mut mesh = TriangleMesh {
            positions: (0..60).map(|_| vector()).collect(),
            normals: (0..60).map(|_| vector().normalize()).collect(),
            triangles: (0..20).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            ..TriangleMesh::default()
        };
        mesh.normals[4] = Vec3::ZERO;

        let with_uvs = TriangleMesh {
            uvs: (0..60).map(|i| Vec2::new(i as f32 * 0.3, -(i as f32))).collect(),
            ..mesh.clone()
        };
        let with_both = TriangleMesh {
            second_uvs: (0..60).map(|i| Vec2::new(-(i as f32), i as f32 * 0.7)).collect(),
            ..with_uvs.clone()
        };
        let placed = |scale: DVec3| {
            Transform::scale_rotate_translate(
                scale,
                DVec3::new(20.0, 50.0, -10.0),
                DVec3::new(0.3, 8.0, -2.0),
            )
        };
        let mut instances = Vec::new();
        for mesh in [mesh, with_uvs, with_both] {
            let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
            let tree = MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled");
            let tree = Arc::new(tree);
            for transform in
                [Transform::IDENTITY, placed(DVec3::splat(1.3)), placed(DVec3::new(0.2, -1.0, 3.0))]
            {
                for smooth in [false, true] {
                    instances.push(MeshInstance::new(Arc::clone(&tree), transform, smooth));
                }
            }
        }
        instances
    }

    #[test]
    fn points_on_huge_triangles_are_on_the_rays() {
        for size in [1e5_f32, 1e7, 1e9] {
            let at = |x: f32, z: f32| Vec3::new(x * size, 0.0, z * size);
            let mesh = TriangleMesh {
                positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                ..TriangleMesh::default()
            };
            let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
            let tree = MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled");
            let tree = Arc::new(tree);
            let turned = Transform::scale_rotate_translate(DVec3::ONE, DVec3::Y * 30.0, DVec3::Y * 0.25);
            for (mesh, height) in [
                (MeshInstance::new(Arc::clone(&tree), Transform::IDENTITY, false), 0.0),
                (MeshInstance::new(Arc::clone(&tree), Transform::IDENTITY, true), 0.0),
                (MeshInstance::new(tree, turned, true), 0.25),
            ] {
                let mut next = random(3);
                // Start every other ray above the edge shared by the two triangles.
                let ray = |i: usize| {
                    let [x, z] = if i.is_multiple_of(2) { [0.5, 0.5] } else { [next(), next()] };
                    Ray::new(Vec3::new(x, 1.0 + height, z), Vec3::new(next() * 0.5, -1.0, next() * 0.5))
                };
                let rays: Vec<Ray> = (0..PACKET_SIZE).map(ray).collect();
                let mut hits = HitPacket::without_hits();
                for (i, ray) in rays.iter().enumerate() {
                    let hit =
                        mesh.tree.triangle_tree().closest_hit(&mesh.local_ray(ray)).expect("the ground");
                    hits.set(i, &hit);
                }
                let (of, set) = (u32::MAX >> (32 - PACKET_SIZE), UvSet::First);
                let filling = FillMesh { mesh: &mesh, rays: &rays, hits: &hits, of, set };
                let row = InstructionSet::from_environment_or_best().run(filling);
                for (i, ray) in rays.iter().enumerate() {
                    let exact = ray.origin.as_dvec3() + ray.direction.as_dvec3();
                    let surface = mesh.surface_point_with_fields(
                        &ray.to_f64(),
                        &hits.get(i).expect("a hit"),
                        SurfaceRequest::ALL,
                    );
                    let off = (surface.point.as_dvec3() - exact).abs().max_element();
                    assert!(off < 2e-6 + f64::from(size) * 1e-14, "{size}: {off}");
                    assert!(surface.error.y < 2e-5 + size * 1e-14, "{size}: {}", surface.error);
                    assert_eq!(surface.shadow_point, surface.point);
                    assert_eq!([lane(&row.point, i), lane(&row.error, i)], [surface.point, surface.error]);
                    assert!(!mesh.smooth || lane(&row.shadow_point, i) == surface.shadow_point);
                }
            }
        }
    }

    #[test]
    fn packet_surfaces_match_single_surfaces() {
        let mut next = random(9);
        let number = |x: f32| (x * 0.5 + 0.5).clamp(0.0, 0.999);
        for mesh in meshes() {
            for round in 0..40_u32 {
                let rays: Vec<Ray> = (0..PACKET_SIZE)
                    .map(|_| Ray::new(Vec3::splat(9.0), Vec3::new(next(), next(), next()).normalize()))
                    .collect();
                let mut hits = HitPacket::without_hits();
                for i in 0..PACKET_SIZE {
                    let (u, v) = (number(next()), number(next()));
                    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                    let primitive = (number(next()) * 20.0) as u32;
                    hits.set(i, &ShapeHit { t: 1.0, primitive, u, v });
                }
                let of = round.wrapping_mul(0x9e37_79b9) >> 16 | 1 << (round % 16);
                for (instructions, set) in InstructionSet::ALL
                    .into_iter()
                    .flat_map(|one| [UvSet::First, UvSet::Second].map(|set| (one, set)))
                {
                    let row = instructions.run(FillMesh { mesh: &mesh, rays: &rays, hits: &hits, of, set });
                    assert_eq!(row.smooth, if mesh.smooth { of } else { 0 });
                    for i in (0..PACKET_SIZE).filter(|i| of & 1 << i != 0) {
                        let hit = hits.get(i).expect("a hit");
                        let alone =
                            mesh.surface_point_with_fields(&rays[i].to_f64(), &hit, SurfaceRequest::ALL);
                        let bits = |v: Vec3| v.to_array().map(f32::to_bits);
                        let what = || format!("{instructions:?}, {hit:?}, {alone:?}");
                        assert_eq!(bits(lane(&row.point, i)), bits(alone.point), "{}", what());
                        assert_eq!(bits(lane(&row.error, i)), bits(alone.error), "{}", what());
                        assert_eq!(bits(lane(&row.normal, i)), bits(alone.normal), "{}", what());
                        let second = mesh.second_uv_and_tangents(&hit).filter(|_| set == UvSet::Second);
                        let uv = second.map_or(alone.uv, |(uv, _)| uv.as_dvec2());
                        assert_eq!([row.uv[0][i], row.uv[1][i]], uv.to_array(), "{}", what());
                        if mesh.smooth {
                            let (normal, shadow) = (lane(&row.shading_normal, i), lane(&row.shadow_point, i));
                            assert_eq!(bits(normal), bits(alone.shading_normal), "{}", what());
                            assert_eq!(bits(shadow), bits(alone.shadow_point), "{}", what());
                        }
                    }
                }
            }
        }
    }
}
