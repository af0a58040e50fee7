use crate::geometry::mesh::TriangleMesh;
use crate::geometry::{Ray, SurfaceRequest};
use crate::math::random::TestRandom;
use crate::math::{DVec3, Vec3};
use crate::scene::description::Shape;
use crate::test_world::TestWorldBuilder;
use crate::world::{
    CoincidenceQuery, CoincidenceScratch, CoincidentOrEnclosingSurface, Hit, MAX_INTERIORS, OffsetPoints,
    World,
};

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A scene without objects. Material 0 is matte, and materials 1 and 2 are glass.
fn empty_scene() -> TestWorldBuilder {
    TestWorldBuilder::from_text(
        "[camera]\nposition = [0, -9, 2]\nlook_at = [0, 0, 0]\nup = [0, 0, 1]\n\
         [materials.a]\ntype = 'phong'\n[materials.b]\ntype = 'glass'\n\
         [materials.c]\ntype = 'glass'\nior = 1.33\n",
    )
}

/// The cube from −1 to 1, each face divided into `steps` × `steps` squares.
fn cube_mesh(steps: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for axis in 0..3 {
        for side in [-1.0_f32, 1.0] {
            let first = mesh.positions.len() as u32;
            for (i, j) in (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j))) {
                let along = |i: u32| 2.0 * i as f32 / steps as f32 - 1.0;
                let mut place = Vec3::ZERO;
                (place[axis], place[(axis + 1) % 3], place[(axis + 2) % 3]) = (side, along(i), along(j));
                mesh.positions.push(place);
            }
            for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
                let at = |i: u32, j: u32| first + i * (steps + 1) + j;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let both = if side > 0.0 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] };
                mesh.triangles.extend(both);
            }
        }
    }
    mesh
}

/// The cube projected onto the unit sphere.
fn sphere_mesh(steps: u32) -> TriangleMesh {
    let mut mesh = cube_mesh(steps);
    mesh.positions.iter_mut().for_each(|place| *place = place.normalize());
    mesh
}

/// Scenes with touching and non-touching surfaces, each with target points for rays.
fn contact_scenes(random: &mut TestRandom) -> Vec<(World, Vec<DVec3>)> {
    let floor = Shape::Quad { corner: v(-4.0, -4.0, -1.0), u: v(8.0, 0.0, 0.0), v: v(0.0, 8.0, 0.0) };
    let cube = |x: f64, size: f64| Shape::Box {
        center: v(x, 0.0, 0.0),
        size: DVec3::splat(size),
        rotate: DVec3::ZERO,
    };
    let globe = |center: DVec3, radius: f64| Shape::Sphere { center, radius };
    let at = |place: DVec3| [DVec3::ONE, DVec3::ZERO, place];
    let places = |mesh: &TriangleMesh, at: DVec3| -> Vec<DVec3> {
        mesh.positions.iter().map(|own| own.as_dvec3() + at).collect()
    };
    let plane = Shape::Plane { point: v(0.0, 0.0, -1.0), normal: DVec3::Z };
    let (fine, coarse) = (sphere_mesh(9), cube_mesh(3));
    let corners = |half: f64| {
        (0..8)
            .map(|i| v(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * (2.0 * half) - half)
            .collect::<Vec<_>>()
    };
    let turned = random.in_cube() * 90.0;
    let rotated = crate::math::transform::rotation_xyz(turned);
    let scenes = vec![
        // Blocks on a floor, side by side.
        (
            empty_scene().shape(floor.clone(), 0).mesh(coarse.clone(), at(DVec3::ZERO), 1).mesh(
                coarse.clone(),
                at(v(2.0, 0.0, 0.0)),
                2,
            ),
            places(&coarse, DVec3::ZERO),
        ),
        // A floating sphere, and another sphere that touches it at a point.
        (
            empty_scene().shape(floor.clone(), 0).mesh(fine.clone(), at(v(0.0, 0.0, 0.5)), 1).mesh(
                fine.clone(),
                at(v(2.0, 0.0, 0.5)),
                1,
            ),
            places(&fine, v(0.0, 0.0, 0.5)),
        ),
        // Nested spheres on a plane.
        (
            empty_scene()
                .shape(plane, 0)
                .shape(globe(DVec3::ZERO, 1.0), 1)
                .shape(globe(v(0.3, 0.0, 0.0), 0.5), 2)
                .shape(globe(v(-0.6, 0.0, 0.0), 0.4), 1),
            vec![v(0.0, 0.0, -1.0), v(-1.0, 0.0, 0.0), v(0.8, 0.0, 0.0)],
        ),
        // Boxes that share a face, one of which is a mesh, and a box of another size.
        (
            empty_scene()
                .shape(floor, 0)
                .shape(cube(0.0, 2.0), 1)
                .mesh(coarse.clone(), at(v(2.0, 0.0, 0.0)), 2)
                .shape(cube(-1.7, 1.4), 1),
            corners(1.0),
        ),
        // A rotated box, a thin box, and a small box in a corner of the rotated box.
        (
            empty_scene()
                .shape(Shape::Box { center: DVec3::ZERO, size: v(1.2, 0.8, 1.0), rotate: turned }, 1)
                .shape(
                    Shape::Box { center: v(0.0, 0.0, 1.5), size: v(2.0, 2.0, 1e-6), rotate: DVec3::ZERO },
                    2,
                )
                .shape(
                    Shape::Box {
                        center: rotated * v(0.6, 0.4, 0.5),
                        size: DVec3::splat(0.3),
                        rotate: turned,
                    },
                    2,
                ),
            (0..8)
                .map(|i| {
                    rotated
                        * v(
                            f64::from(i & 1) * 1.2 - 0.6,
                            f64::from(i >> 1 & 1) * 0.8 - 0.4,
                            f64::from(i >> 2) - 0.5,
                        )
                })
                .chain([v(0.0, 0.0, 1.5), v(1.0, 0.0, 1.5)])
                .collect(),
        ),
        // A triangulated sphere inside a sphere and a room, and a triangle coplanar with one of its faces.
        (
            empty_scene()
                .shape(
                    Shape::Quad { corner: v(-3.0, -3.0, -3.0), u: v(6.0, 0.0, 0.0), v: v(0.0, 6.0, 0.0) },
                    0,
                )
                .shape(globe(DVec3::ZERO, 1.4), 2)
                .mesh(fine.clone(), [DVec3::ONE, turned, DVec3::ZERO], 1)
                .shape(
                    Shape::Triangle {
                        a: rotated * fine.positions[0].as_dvec3(),
                        b: rotated * fine.positions[1].as_dvec3(),
                        c: rotated * fine.positions[10].as_dvec3(),
                    },
                    0,
                ),
            fine.positions.iter().map(|own| rotated * own.as_dvec3()).collect(),
        ),
        // A crease: two sheets at a small angle, and a third at a large angle.
        (
            empty_scene().mesh(
                TriangleMesh {
                    positions: vec![
                        Vec3::ZERO,
                        Vec3::Y,
                        Vec3::X,
                        Vec3::new(1.0, 0.0, 0.02),
                        Vec3::new(-1.0, 0.0, 0.9),
                    ],
                    triangles: vec![[0, 2, 1], [0, 1, 3], [1, 0, 4]],
                    ..TriangleMesh::default()
                },
                at(DVec3::ZERO),
                1,
            ),
            vec![DVec3::ZERO, v(0.0, 1.0, 0.0), v(0.0, 0.4, 0.0), v(0.0003, 0.4, 0.0)],
        ),
    ];
    scenes.into_iter().map(|(build, places)| (build.world(), places)).collect()
}

#[test]
fn isolated_regions_match_the_full_search() {
    let mut random = TestRandom::new(1);
    let (mut isolated, mut asked, mut touching) = (0, 0, 0);
    for (number, (world, places)) in contact_scenes(&mut random).into_iter().enumerate() {
        for round in 0..30_000 {
            // Aim at a target point, between two target points, near one, or at a random point.
            let pick = |random: &mut TestRandom| places[(random.unit() * places.len() as f64) as usize];
            let (one, other) = (pick(&mut random), pick(&mut random));
            let target = match round % 4 {
                0 => one,
                1 => one + (other - one) * random.unit(),
                2 => one + random.in_cube() * 0.1_f64.powf(1.0 + 5.0 * random.unit()),
                _ => random.in_cube() * 1.2,
            };
            let from = random.in_cube().normalize()
                * if round % 3 == 0 { 0.2 } else { 3.0 + 40.0 * random.unit().powi(4) };
            let ray = Ray::new(from.as_vec3(), (target - from).normalize().as_vec3());
            let Some(hit) = world.geometry.closest_hit(&ray) else { continue };
            if !world.is_glass_material(world.material_index(&hit) as u32) {
                continue;
            }
            let surface = world.geometry.requested_surface(&ray, &hit, SurfaceRequest::ALL);
            let facing = surface.normal.dot(ray.direction);
            let normal = if facing > 0.0 { -surface.normal } else { surface.normal };
            let at = CoincidenceQuery {
                hit: &hit,
                surface: &surface,
                normal,
                lead: hit.shape.t * f32::EPSILON * facing.abs(),
            };
            let found = |only_hit: bool| -> (OffsetPoints, Vec<CoincidentOrEnclosingSurface>) {
                let (mut memory, mut near) = (CoincidenceScratch::default(), Vec::new());
                let error = if only_hit {
                    world.geometry.set_hit_as_only_candidate(&at, &mut memory)
                } else {
                    world.collect_surfaces_near_hit(&at, &mut memory)
                };
                (world.visit_coincident_surfaces(&at, (&memory, error), |one| near.push(one)), near)
            };
            let searched = found(false);
            let is_isolated =
                world.geometry.is_hit_isolated(&hit, at.surface, world.geometry.coincidence_margin(&at));
            if is_isolated {
                assert_eq!(found(true), searched, "scene {number}, ray {round}: {ray:?}, {hit:?}");
            }
            let mut near = Vec::new();
            let sides = world
                .find_coincident_surfaces_at(&at, &mut CoincidenceScratch::default(), |one| near.push(one));
            assert_eq!((sides, near), searched, "scene {number}, ray {round}: {ray:?}, {hit:?}");
            let is_other = |near: &CoincidentOrEnclosingSurface| match near {
                CoincidentOrEnclosingSurface::Around { object, .. }
                | CoincidentOrEnclosingSurface::Surface { hit: Hit { object, .. }, .. } => {
                    *object != hit.object
                }
            };
            touching += usize::from(searched.1.iter().any(is_other));
            isolated += usize::from(is_isolated && round % 4 == 3);
            asked += usize::from(round % 4 == 3);
        }
    }
    assert!(touching > 5000, "{touching}");
    assert!(2 * isolated > asked, "{isolated} of {asked}");
}

#[test]
fn nested_sphere_search_takes_log_squared_time() {
    for count in [100_u32, 400, 1600, 6400] {
        // The file order differs from the radius order. Some spheres are matte.
        let radius = |i: u32| 1.0 + f64::from(i * 37 % count) / f64::from(count);
        let globe = |i: u32| Shape::Sphere { center: v(0.1, 0.2, 0.3), radius: radius(i) };
        let material = |i: u32| [1, 2, 1, 2, 0][i as usize % 5];
        let scene = (0..count).fold(empty_scene(), |scene, i| scene.shape(globe(i), material(i)));
        let world = scene.world();
        let mut random = TestRandom::new(3);
        let mut memory = CoincidenceScratch::default();
        for _ in 0..200 {
            let from = (v(0.1, 0.2, 0.3) + random.in_cube() * 1.5).as_vec3();
            let ray = Ray::new(from, random.in_cube().normalize().as_vec3());
            let Some(hit) = world.geometry.closest_hit(&ray) else { continue };
            let surface = world.geometry.surface(&ray, &hit);
            let facing = surface.normal.dot(ray.direction);
            let normal = if facing > 0.0 { -surface.normal } else { surface.normal };
            let lead = hit.shape.t * f32::EPSILON * facing.abs();
            let at = CoincidenceQuery { hit: &hit, surface: &surface, normal, lead };
            let mut around = Vec::new();
            let mut found = 0_u32;
            let sides = world.find_coincident_surfaces_at(&at, &mut memory, |near| {
                found += 1;
                if let CoincidentOrEnclosingSurface::Around { object, .. } = near {
                    around.push(object);
                }
            });
            // Each level of the tree lists a few spheres.
            let bound = 1.5 * f64::from(count).log2().powi(2);
            assert!(f64::from(found) <= bound, "{found} of {count}");
            // Check that the listed spheres include the spheres that determine the medium.
            let glasses = world.closed_glass_shapes().map(|(object, _)| object);
            let enclosing = glasses.filter(|object| world.is_closed_shape_containing(*object, sides.beyond));
            let enclosing: Vec<_> = enclosing.collect();
            around.sort_unstable();
            let last = |all: &[u32]| all[all.len().saturating_sub(MAX_INTERIORS)..].to_vec();
            assert_eq!(last(&around), last(&enclosing), "{ray:?} {hit:?}");
        }
    }
}
