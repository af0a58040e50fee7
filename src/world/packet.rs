//! Up to sixteen rays at once through a scene: what they hit is what each hits alone.

use super::shape::{MeshInstance, Shape};
use super::{Geometry, Hit};
use crate::accel::PACKET;
use crate::geometry::{Ray, RayF64};
use crate::lights::Source;
use crate::math::transform::Transform;

/// Rays of a packet whose bits are set.
fn lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            lane
        })
    })
}

/// Of the rays in a packet, a bit for each.
fn all(rays: &[Ray]) -> u32 {
    (1 << rays.len()) - 1
}

/// Where each ray ends; lanes without a ray have no length.
fn ends(rays: &[Ray]) -> [f32; PACKET] {
    let mut ends = [-1.0; PACKET];
    for (end, ray) in ends.iter_mut().zip(rays) {
        *end = ray.t_max;
    }
    ends
}

impl Geometry {
    /// [`Geometry::closest`] of at most [`PACKET`] rays, into as many places.
    pub fn closest_packet(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        debug_assert!(rays.len() <= PACKET && rays.len() == hits.len());
        hits.fill(None);
        let mut doubles = Doubles::new(rays);
        let mut test = |id: u32, met: u32, ends: &mut [f32; PACKET]| {
            let mut found = [None; PACKET];
            match &self.shapes()[id as usize] {
                Shape::Mesh(mesh) => {
                    let (local, lane_of, count) = local_rays(mesh, rays, met, ends);
                    let mut of_mesh = [None; PACKET];
                    mesh.tree.closest_packet(&local[..count], &mut of_mesh[..count]);
                    for (hit, &lane) in of_mesh.into_iter().zip(&lane_of[..count]) {
                        found[lane] = hit;
                    }
                }
                shape => {
                    for lane in lanes(met) {
                        let segment = Ray { t_max: ends[lane], ..rays[lane] };
                        found[lane] = shape.closest(&segment, doubles.of(lane, segment.t_max));
                    }
                }
            }
            for lane in lanes(met) {
                let Some(shape) = found[lane] else { continue };
                if hits[lane].is_none_or(|best| (shape.t, id) < (best.shape.t, best.object)) {
                    hits[lane] = Some(Hit { shape, object: id });
                    ends[lane] = shape.t;
                }
            }
        };
        let mut ends = ends(rays);
        for &id in self.unbounded() {
            test(id, all(rays), &mut ends);
        }
        self.tree().visit_packet(rays, &mut ends, |id, met, ends| test(id, met & all(rays), ends));
    }

    /// [`Geometry::occluded`] of at most [`PACKET`] segments, each with the light that it goes to: a bit for each that is.
    pub fn occluded_packet(&self, rays: &[Ray], sources: &[Source]) -> u32 {
        debug_assert!(rays.len() <= PACKET && rays.len() == sources.len());
        let doubles = Doubles::new(rays);
        let mut occluded = 0;
        let mut test = |id: u32, met: u32, ends: &mut [f32; PACKET]| {
            let own = |lane: usize| matches!(sources[lane], Source::Object(own) if own == id);
            let met =
                lanes(met & !occluded).filter(|&lane| !own(lane)).fold(0, |bits, lane| bits | 1 << lane);
            let except = |lane: usize| match sources[lane] {
                Source::Primitive(own, part) if own == id => Some(part),
                _ => None,
            };
            let mut found = 0;
            match &self.shapes()[id as usize] {
                Shape::Mesh(mesh) => {
                    let (local, lane_of, count) = local_rays(mesh, rays, met, ends);
                    let bits = mesh.tree.any_packet(&local[..count], &lane_of.map(except)[..count]);
                    found |= lanes(bits).fold(0, |all, i| all | 1 << lane_of[i]);
                }
                shape => {
                    for lane in lanes(met) {
                        let hit = shape.any(&rays[lane], &doubles.rays[lane], except(lane));
                        found |= u32::from(hit) << lane;
                    }
                }
            }
            occluded |= found;
            lanes(found).for_each(|lane| ends[lane] = -1.0);
        };
        let mut ends = ends(rays);
        for &id in self.unbounded() {
            test(id, all(rays), &mut ends);
        }
        self.tree().visit_packet(rays, &mut ends, |id, met, ends| test(id, met & all(rays), ends));
        occluded
    }
}

/// The rays of `met` in a mesh's coordinates, side by side, which lanes they came from, and how many they are.
#[inline]
fn local_rays(
    mesh: &MeshInstance,
    rays: &[Ray],
    met: u32,
    ends: &[f32; PACKET],
) -> ([Ray; PACKET], [usize; PACKET], usize) {
    let mut local = [rays[0]; PACKET];
    let mut lane_of = [0; PACKET];
    let mut count = 0;
    let is_placed = mesh.transform != Transform::IDENTITY;
    for lane in lanes(met) {
        local[count] = if is_placed { mesh.local_ray(&rays[lane]) } else { rays[lane] };
        local[count].t_max = ends[lane];
        lane_of[count] = lane;
        count += 1;
    }
    (local, lane_of, count)
}

/// The rays in double precision.
struct Doubles {
    rays: [RayF64; PACKET],
}

impl Doubles {
    fn new(rays: &[Ray]) -> Self {
        let first =
            rays.first().map_or_else(|| Ray::new(crate::math::Vec3::ZERO, crate::math::Vec3::X), |ray| *ray);
        let mut own = Self { rays: [first.to_f64(); PACKET] };
        for (own, ray) in own.rays.iter_mut().zip(rays) {
            *own = ray.to_f64();
        }
        own
    }

    /// The ray of a lane up to `end`.
    fn of(&mut self, lane: usize, end: f32) -> &RayF64 {
        self.rays[lane].t_max = f64::from(end);
        &self.rays[lane]
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::assets::LoadedMesh;
    use crate::control::CancelToken;
    use crate::geometry::mesh::TriangleMesh;
    use crate::geometry::plane::Plane;
    use crate::geometry::sphere::Sphere;
    use crate::math::{DVec3, Vec3};
    use crate::scene::description::Accel;
    use crate::world::MeshTree;

    /// Random numbers in [−1, 1).
    fn random(seed: u64) -> impl FnMut() -> f32 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f32) / (1_u64 << 24) as f32 * 2.0 - 1.0
        }
    }

    /// Spheres in a grid, three instances of a fan of triangles, a floor.
    fn geometry(accel: Accel) -> Geometry {
        let mut mesh = TriangleMesh { positions: vec![Vec3::ZERO], ..TriangleMesh::default() };
        for i in 0..40_u32 {
            let angle = i as f32 * 0.157;
            mesh.positions.push(Vec3::new(angle.cos(), 0.3 * (3.0 * angle).sin(), angle.sin()));
            mesh.triangles.push([0, i + 1, (i + 1) % 40 + 1]);
        }
        let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
        let tree = Arc::new(MeshTree::build(loaded, accel, &CancelToken::new()).expect("nobody cancels"));
        let mut shapes = vec![Shape::Plane(Plane::new(DVec3::new(0.0, -2.0, 0.0), DVec3::Y))];
        for i in 0..30 {
            let center = DVec3::new(f64::from(i % 5), f64::from(i / 5 % 3), f64::from(i / 15)) * 1.5
                - DVec3::splat(2.0);
            shapes.push(Shape::Sphere(Sphere { center, radius: 0.6 }));
        }
        for i in 0..3 {
            let at = DVec3::new(f64::from(i) - 1.0, f64::from(i) * 0.7, 0.3);
            let transform =
                Transform::scale_rotate_translate(DVec3::splat(1.3), DVec3::splat(20.0 * f64::from(i)), at);
            shapes.push(Shape::Mesh(Box::new(MeshInstance {
                tree: Arc::clone(&tree),
                transform,
                smooth: false,
            })));
        }
        Geometry::build(shapes, Vec::new(), &CancelToken::new()).expect("nobody cancels")
    }

    #[test]
    fn a_packet_sees_what_its_rays_see_alone() {
        for accel in [Accel::Bvh, Accel::BvhHigh, Accel::KdTree] {
            assert_packets(&geometry(accel));
        }
    }

    fn assert_packets(geometry: &Geometry) {
        let mut next = random(3);
        let (mut hits, mut shadows) = (0, 0);
        for i in 0..3000 {
            let eye = Vec3::new(next(), next(), next()) * 6.0;
            let target = Vec3::new(next(), next(), next()) * 2.0;
            let spread = [0.001, 0.1, 4.0][i % 3];
            let mut ray = || {
                let to = target + Vec3::new(next(), next(), next()) * spread;
                if i % 2 == 0 { Ray::segment(eye, to) } else { Ray::new(eye, to - eye) }
            };
            let rays: Vec<Ray> = (0..=i % PACKET).map(|_| ray()).collect();
            let mut found = vec![None; rays.len()];
            geometry.closest_packet(&rays, &mut found);
            let alone: Vec<_> = rays.iter().map(|ray| geometry.closest(ray)).collect();
            assert_eq!(found, alone, "{rays:?}");
            let source = |lane: usize| match alone[lane] {
                Some(hit) if lane.is_multiple_of(3) => Source::Object(hit.object),
                Some(hit) if lane % 3 == 1 => Source::Primitive(hit.object, hit.shape.primitive),
                _ => Source::Object(u32::MAX),
            };
            let sources: Vec<_> = (0..rays.len()).map(source).collect();
            let occluded = geometry.occluded_packet(&rays, &sources);
            for (lane, (ray, source)) in rays.iter().zip(&sources).enumerate() {
                assert_eq!(occluded & 1 << lane != 0, geometry.occluded(ray, *source), "{lane} of {rays:?}");
            }
            hits += alone.iter().flatten().count();
            shadows += occluded.count_ones();
        }
        assert!(hits > 5000 && shadows > 1000, "{hits} hits, {shadows} shadows: the rays see something");
    }
}
