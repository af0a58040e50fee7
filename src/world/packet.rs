//! Up to sixteen rays at once through a scene: what they hit is what each hits alone.

use super::shape::{MeshInstance, Shape};
use super::{Geometry, Hit};
use crate::accel::{Ends, PACKET, ends};
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

/// The ends of the rays of `met`; the others end below 0.
fn of_these(met: u32, ends: &Ends) -> Ends {
    std::array::from_fn(|lane| if met & 1 << lane != 0 { ends[lane] } else { -1.0 })
}

impl Geometry {
    /// [`Geometry::closest`] of at most [`PACKET`] rays, into as many places.
    pub fn closest_packet(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        debug_assert!(rays.len() <= PACKET && rays.len() == hits.len());
        hits.fill(None);
        let mut doubles = Doubles::default();
        let mut test = |id: u32, met: u32, ends: &mut Ends| {
            let mut found = [None; PACKET];
            match &self.shapes()[id as usize] {
                Shape::Mesh(mesh) => {
                    let found = &mut found[..rays.len()];
                    let own_ends = of_these(met, ends);
                    in_mesh(mesh, rays, met, |local| mesh.tree.closest_packet(local, &own_ends, found));
                }
                shape => {
                    for lane in lanes(met) {
                        let segment = Ray { t_max: ends[lane], ..rays[lane] };
                        found[lane] = shape.closest(&segment, doubles.of(rays, lane, segment.t_max));
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
        let mut doubles = Doubles::default();
        let mut occluded = 0;
        let mut test = |id: u32, met: u32, ends: &mut Ends| {
            let (mut own, mut has_own_parts) = (0, false);
            for (lane, source) in sources.iter().enumerate() {
                own |= u32::from(*source == Source::Object(id)) << lane;
                has_own_parts |= matches!(source, Source::Primitive(object, _) if *object == id);
            }
            let met = met & !occluded & !own;
            if met == 0 {
                return;
            }
            let except = |lane: usize| match sources.get(lane) {
                Some(Source::Primitive(object, part)) if *object == id => Some(*part),
                _ => None,
            };
            let mut found = 0;
            match &self.shapes()[id as usize] {
                Shape::Mesh(mesh) => {
                    let own_ends = of_these(met, ends);
                    let parts: [_; PACKET];
                    let mut except_parts: &[Option<u32>] = &[];
                    if has_own_parts {
                        parts = std::array::from_fn(except);
                        except_parts = &parts[..rays.len()];
                    }
                    in_mesh(mesh, rays, met, |local| {
                        found = mesh.tree.any_packet(local, &own_ends, except_parts);
                    });
                }
                shape => {
                    for lane in lanes(met) {
                        let hit =
                            shape.any(&rays[lane], doubles.of(rays, lane, rays[lane].t_max), except(lane));
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

/// Those rays of a packet that are in `met` in a mesh's coordinates, the others as they are.
#[inline]
fn in_mesh(mesh: &MeshInstance, rays: &[Ray], met: u32, trace: impl FnOnce(&[Ray])) {
    if mesh.transform == Transform::IDENTITY {
        return trace(rays);
    }
    let mut local = [rays[0]; PACKET];
    for lane in lanes(met) {
        local[lane] = mesh.local_ray(&rays[lane]);
    }
    trace(&local[..rays.len()]);
}

/// The rays in double precision, where a shape asks for one.
#[derive(Default)]
struct Doubles {
    rays: Option<[RayF64; PACKET]>,
}

impl Doubles {
    /// The ray of a lane up to `end`.
    fn of(&mut self, rays: &[Ray], lane: usize, end: f32) -> &RayF64 {
        let doubles = self
            .rays
            .get_or_insert_with(|| std::array::from_fn(|lane| rays[lane.min(rays.len() - 1)].to_f64()));
        doubles[lane].t_max = f64::from(end);
        &doubles[lane]
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
