//! Robustness: rays leaving surfaces or aimed at edges, extreme scales, and NaN.

use glimt::choice::Choice;
use glimt::control::CancelToken;
use glimt::film::Rect;
use glimt::geometry::mesh::TriangleMesh;
use glimt::geometry::ray::offset_origin;
use glimt::geometry::{Ray, SurfacePoint};
use glimt::integrators::render_tile;
use glimt::lights::GeometryOfLight;
use glimt::materials::fresnel::fresnel_dielectric;
use glimt::math::random::TestRandom;
use glimt::math::transform::Transform;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{Integrator, Shape};
use glimt::world::{Geometry, Hit};

use super::scenes::{
    Build, IDENTITY_PLACEMENT, emitter, glass, lat_long_sphere, matte, mirror, phong, scene,
};
use super::v;

/// The surface hit by a ray from outside toward a point.
fn surface_hit_toward(
    geometry: &Geometry,
    random: &mut TestRandom,
    at: DVec3,
    far: f64,
) -> Option<SurfacePoint> {
    let origin = (at + random.direction() * far).as_vec3();
    let ray = Ray::new(origin, (at - origin.as_dvec3()).as_vec3().normalize());
    geometry.closest_hit(&ray).map(|hit| geometry.surface(&ray, &hit))
}

/// A ray from a surface into the hemisphere around `side`, often at a grazing angle.
pub fn ray_leaving(random: &mut TestRandom, surface: &SurfacePoint, side: Vec3) -> Ray {
    let across = random.direction();
    let n = side.as_dvec3();
    let flat = across - n * n.dot(across);
    let direction = (flat.normalize() + n * 10.0_f64.powf(-3.0 * random.unit())).as_vec3().normalize();
    Ray::new(offset_origin(surface.point, surface.error, surface.normal, direction), direction)
}

/// Counts rays that leave a convex shape outward but hit it again. Returns this count and the number of rays.
pub fn self_hits(build: &Build, random: &mut TestRandom, center: DVec3, size: f64, tries: u32) -> (u32, u32) {
    let world = build.world();
    let (mut hits, mut tried) = (0, 0);
    for _ in 0..tries {
        let at = center + random.direction() * size * random.unit();
        let Some(surface) = surface_hit_toward(&world.geometry, random, at, size * 4.0) else { continue };
        let ray = ray_leaving(random, &surface, surface.normal);
        tried += 1;
        hits += u32::from(world.geometry.closest_hit(&ray).is_some());
    }
    (hits, tried)
}

/// Random positions up to 10⁶ from the origin. The first few place the shape's surface near the origin.
pub fn places(random: &mut TestRandom, size: f64) -> Vec<DVec3> {
    let mut places = vec![v(0.0, -size, 0.0), random.direction() * size, DVec3::ZERO];
    for far in [1.0, 1e2, 1e4, 1e6] {
        if far < size * 1e6 {
            places.push(random.direction() * far);
        }
    }
    places
}

#[test]
fn convex_shapes_do_not_self_hit() {
    // A convex shape lies on one side of its tangent plane, so a ray leaving on the other side never hits it.
    let mut random = TestRandom::new(11);
    for size in [1e-3, 1.0, 1e3, 1e6] {
        for center in places(&mut random, size) {
            let angles = v(17.0, 33.0, -71.0);
            let triangle = [0, 1, 2].map(|_| center + random.direction() * size);
            let octahedron = lat_long_sphere(2, 4, size, center);
            let unit = lat_long_sphere(2, 4, 1.0, DVec3::ZERO);
            let shapes = [
                ("sphere", scene().sphere(center, size, matte(0.5))),
                ("box", scene().cuboid(center, DVec3::splat(size * 1.2), DVec3::ZERO, matte(0.5))),
                ("turned box", scene().cuboid(center, DVec3::splat(size * 1.2), angles, matte(0.5))),
                ("quad", scene().quad(center, triangle[0] - center, triangle[1] - center, matte(0.5))),
                ("triangle", scene().triangle(triangle, matte(0.5))),
                (
                    "disk",
                    scene().shape(
                        Shape::Disk { center, normal: triangle[0] - center, radius: size },
                        matte(0.5),
                    ),
                ),
                ("mesh", scene().mesh(octahedron, IDENTITY_PLACEMENT, matte(0.5))),
                ("instance", scene().mesh(unit, [v(size, size * 0.7, -size), angles, center], matte(0.5))),
            ];
            for (what, build) in shapes {
                let (hits, tried) = self_hits(&build, &mut random, center, size, 4000);
                assert!(tried > 0, "no ray hits {what} of size {size} at {center}");
                assert_eq!(hits, 0, "of {tried} rays, {what} of size {size} at {center}");
            }
        }
    }
}

/// A room from −size/2 to size/2. Returns its corners, and its walls as corner indices, counterclockwise as
/// seen from inside.
fn room(size: DVec3) -> ([DVec3; 8], [[usize; 4]; 6]) {
    let corner = |i: usize| {
        size * (DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64) - DVec3::splat(0.5))
    };
    let walls = [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]];
    (std::array::from_fn(corner), walls)
}

/// The room as a mesh of twelve triangles.
fn room_of_triangles(size: DVec3) -> TriangleMesh {
    let (corners, walls) = room(size);
    let triangles = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]].map(|three| three.map(|i| i as u32));
    TriangleMesh {
        positions: corners.map(DVec3::as_vec3).to_vec(),
        triangles: walls.into_iter().flat_map(triangles).collect(),
        ..TriangleMesh::default()
    }
}

#[test]
fn no_ray_escapes_through_room_edges() {
    // Trace rays to points on the walls very close to edges and corners, and from there in a random inward
    // direction. All of them must hit another wall.
    let mut random = TestRandom::new(29);
    for size in [v(1.0, 1.0, 1.0), v(8.0, 0.4, 2.0), v(200.0, 0.02, 0.02), v(3e-3, 5e-3, 4e-3)] {
        let small = size.min_element();
        for place in [DVec3::ZERO, v(0.1, 0.1, 0.1), random.direction() * 300.0 * small] {
            for angles in [DVec3::ZERO, v(20.0, 50.0, -10.0)] {
                let placed = [DVec3::ONE, angles, place];
                let mesh = room_of_triangles(size);
                let world = scene().mesh(mesh, placed, matte(0.5)).world();
                let transform = Transform::scale_rotate_translate(DVec3::ONE, angles, place);
                let (mut lost, mut tried) = (0, 0);
                for _ in 0..3000 {
                    // Aim at a point close to one, two or three walls.
                    let within = |random: &mut TestRandom| 1.0 - 2.0 * random.unit();
                    let mut at = [0; 3].map(|_| 0.495 * within(&mut random));
                    let from = transform.point(DVec3::from(at) * size);
                    let near = |random: &mut TestRandom| 0.5 - 10.0_f64.powf(-4.0 - 5.0 * random.unit());
                    for axis in 0..3 {
                        let side = if random.unit() < 0.5 { -1.0 } else { 1.0 };
                        let is_beside = axis == 0 || random.unit() < 0.7;
                        at[axis] =
                            if is_beside { side * near(&mut random) } else { 0.5 * within(&mut random) };
                    }
                    at.rotate_right((random.unit() * 2.99) as usize);
                    let to = transform.point(DVec3::from(at) * size);
                    let from = from.as_vec3();
                    let ray = Ray::new(from, (to - from.as_dvec3()).as_vec3().normalize());
                    let Some(hit) = world.geometry.closest_hit(&ray) else {
                        lost += 1;
                        continue;
                    };
                    let surface = world.geometry.surface(&ray, &hit);
                    let inwards = if surface.normal.dot(ray.direction) < 0.0 { 1.0 } else { -1.0 };
                    let next = ray_leaving(&mut random, &surface, surface.normal * inwards);
                    tried += 1;
                    lost += u32::from(world.geometry.closest_hit(&next).is_none());
                }
                assert!(
                    tried > 2000 && lost == 0,
                    "{lost} of {tried} rays escaped: {size} at {place}, {angles}"
                );
            }
        }
    }
}

/// A cylinder centered at `middle`, with its surface through the origin. Its axis is perpendicular to
/// `middle` if possible, and otherwise parallel.
fn cylinder_through_origin(middle: DVec3, towards: DVec3, radius: f64) -> Shape {
    let flat = towards - middle * (middle.dot(towards) / middle.length_squared());
    let half = if flat.length() > 1e-6 * towards.length() { flat } else { middle };
    Shape::Cylinder { a: middle - half, b: middle + half, radius, caps: true }
}

/// A cone whose side passes through the origin. Along the side, the origin is between the tip and the base.
fn cone_through_origin(normal: DVec3, towards: DVec3, radius: f64) -> Shape {
    let down = normal.cross(towards).normalize();
    let tip = down * -radius;
    // The angle between the side and the axis is 45°. The axis is on the inner side.
    let base = tip + (down - normal) * (1.5 * radius);
    Shape::Cone { base, tip, radius: (base - tip).length(), cap: true }
}

#[test]
fn shapes_through_the_origin_do_not_self_hit() {
    // The hit's coordinates are nearly 0 although the shape is large, so rounding errors in the summands
    // dominate.
    let mut random = TestRandom::new(3);
    for _ in 0..200 {
        let (u, w) = (random.direction() * 1e4, random.direction() * 1e4);
        let corner = -(u * random.unit() + w * random.unit());
        let n = random.direction();
        let radius = 10.0_f64.powf(6.0 * random.unit());
        let plane = Shape::Plane { point: n.cross(u), normal: n };
        for (what, build) in [
            ("quad", scene().quad(corner, u, w, matte(0.5))),
            ("triangle", scene().triangle([corner, corner + u * 2.0, corner + w * 2.0], matte(0.5))),
            ("box", scene().cuboid(v(0.0, 0.0, -1e4), DVec3::splat(2e4), DVec3::ZERO, matte(0.5))),
            ("box", scene().cuboid(-u, DVec3::splat(2e4), v(0.0, u.z.atan2(u.x), 0.0), matte(0.5))),
            ("sphere", scene().sphere(n * radius, radius, matte(0.5))),
            ("disk", scene().shape(Shape::Disk { center: n.cross(u), normal: n, radius: 1e5 }, matte(0.5))),
            ("cylinder", scene().shape(cylinder_through_origin(n * radius, u, radius), matte(0.5))),
            (
                "cylinder's cap",
                scene().shape(cylinder_through_origin(n * radius, n * radius, radius), matte(0.5)),
            ),
            ("cone", scene().shape(cone_through_origin(n, u, radius), matte(0.5))),
            ("plane", scene().shape(plane, matte(0.5))),
        ] {
            for _ in 0..10 {
                let size = 10.0_f64.powf(-14.0 * random.unit());
                let (hits, tried) = self_hits(&build, &mut random, DVec3::ZERO, size, 6);
                assert_eq!(hits, 0, "of {tried} rays, {what} {u} {w} {n} {radius} within {size}");
            }
        }
    }
}

#[test]
fn ray_into_a_ball_hits_its_back_and_exits() {
    // From inside, the next hit is on the back of the sphere, and nothing is behind it.
    let mut random = TestRandom::new(17);
    for radius in [1e-3, 0.75, 1.0, 1e3, 1e6] {
        for center in places(&mut random, radius) {
            let world = scene().sphere(center, radius, glass(1.5)).world();
            for _ in 0..500 {
                let at = center + random.direction() * radius * 0.9;
                let Some(surface) = surface_hit_toward(&world.geometry, &mut random, at, radius * 4.0) else {
                    continue;
                };
                let inner = ray_leaving(&mut random, &surface, -surface.normal);
                let hit = world.geometry.closest_hit(&inner);
                let Some(hit) = hit else { panic!("no exit hit: ball {radius} at {center}") };
                let back = world.geometry.surface(&inner, &hit);
                assert!(back.normal.dot(inner.direction) > 0.0, "ball {radius} at {center}");
                let outer = ray_leaving(&mut random, &back, back.normal);
                assert_eq!(world.geometry.closest_hit(&outer), None, "ball {radius} at {center}");
            }
        }
    }
}

#[test]
fn closed_mesh_has_no_leaks() {
    // Every ray from inside must hit, even when aimed at vertices and edges.
    let mut random = TestRandom::new(23);
    let far = v(148_376.0, 1234.0, -223_423.0);
    let at_origin = lat_long_sphere(16, 16, 2.0, DVec3::ZERO);
    let baked = lat_long_sphere(16, 16, 2.0, far);
    for (mesh, placed, center) in [
        (&at_origin, IDENTITY_PLACEMENT, DVec3::ZERO),
        (&baked, IDENTITY_PLACEMENT, far),
        (&at_origin, [DVec3::ONE, DVec3::ZERO, far], far),
        (&at_origin, [v(1.0, 1.2, -0.9), v(10.0, 20.0, 30.0), v(3.0, -7.0, 1.0)], v(3.0, -7.0, 1.0)),
    ] {
        let build = scene().mesh(mesh.clone(), placed, matte(0.5));
        let world = build.world();
        let corner = |i: u32| {
            let p = mesh.positions[i as usize].as_dvec3();
            let moved =
                glimt::math::transform::Transform::scale_rotate_translate(placed[0], placed[1], placed[2]);
            moved.point(p)
        };
        let mut leaks = 0;
        for i in 0..200_000 {
            let triangle = mesh.triangles[i % mesh.triangles.len()];
            let (a, b) = (corner(triangle[i % 3]), corner(triangle[(i + 1) % 3]));
            let target = if i % 2 == 0 { a } else { a.lerp(b, random.unit()) };
            let origin = (center + random.direction() * random.unit()).as_vec3();
            let ray = Ray::new(origin, (target - origin.as_dvec3()).as_vec3());
            leaks += u32::from(world.geometry.closest_hit(&ray).is_none());
            leaks += u32::from(!world.geometry.is_occluded_except_by_light(&ray, GeometryOfLight::Nothing));
        }
        assert_eq!(leaks, 0, "at {center}");
    }
}

/// A scene of size 2ᵏ with every kind of object.
fn all_objects(k: i32) -> Build {
    let s = 2.0_f64.powi(k);
    let intensity = (8.0 * 4.0_f64.powi(k)) as f32;
    let ball = lat_long_sphere(6, 9, 0.5 * s, DVec3::ZERO);
    scene()
        .quad(
            v(-4.0, -1.0, -1.0) * s,
            v(8.0, 0.0, 0.0) * s,
            v(0.0, 0.0, -8.0) * s,
            phong(0.6, 0.2, 10.0, 0.0),
        )
        .sphere(v(-1.2, -0.3, -5.0) * s, 0.7 * s, mirror(0.9))
        .sphere(v(0.3, -0.4, -4.0) * s, 0.6 * s, glass(1.5))
        .cuboid(v(1.5, -0.5, -5.5) * s, v(0.8, 1.0, 0.7) * s, v(0.0, 30.0, 5.0), matte(0.4))
        .triangle([v(-2.0, -1.0, -7.0) * s, v(2.0, -1.0, -7.0) * s, v(0.1, 2.0, -7.5) * s], matte(0.8))
        .mesh(ball, [DVec3::ONE, v(10.0, 0.0, 0.0), v(1.0, 0.6, -5.0) * s], matte(0.7))
        .shape(
            Shape::Disk { center: v(-2.2, 0.2, -6.5) * s, normal: v(1.0, 0.3, 2.0), radius: 0.5 * s },
            matte(0.6),
        )
        .shape(
            Shape::Cylinder {
                a: v(-0.4, -1.0, -6.0) * s,
                b: v(-0.2, 0.4, -6.1) * s,
                radius: 0.3 * s,
                caps: true,
            },
            phong(0.5, 0.3, 20.0, 0.0),
        )
        .shape(
            Shape::Cone {
                base: v(0.9, -1.0, -3.6) * s,
                tip: v(1.0, 0.1, -3.7) * s,
                radius: 0.3 * s,
                cap: false,
            },
            glass(1.3),
        )
        .shape(
            Shape::Torus {
                center: v(-0.9, 1.1, -5.0) * s,
                axis: v(0.2, 0.5, 1.0),
                radius: 0.5 * s,
                tube: 0.2 * s,
            },
            phong(0.5, 0.2, 30.0, 0.5),
        )
        .quad(v(-0.5, 3.0, -5.0) * s, DVec3::X * s, DVec3::Z * s, emitter(4.0))
        .quad(v(-2.5, 1.0, -6.0) * s, v(0.5, 0.1, 0.0) * s, v(0.3, 0.5, 0.4) * s, emitter(4.0))
        .sphere(v(2.0, 2.0, -4.0) * s, 0.3 * s, emitter(6.0))
        .point_light(v(-2.0, 2.0, -2.0) * s, intensity, Falloff::Square)
        .background(0.25)
        .shadows(glimt::scene::description::ShadowMode::Soft, 2)
        .pictured(v(0.1, 0.3, 0.5) * s, v(0.0, 0.0, -5.0) * s, 50.0, 24, 20)
}

#[test]
fn power_of_two_scale_keeps_pixels_identical() {
    // Scaling by powers of two does not round, and no result may depend on the unit of length.
    let picture = all_objects(0).picture(4, 9);
    for k in [-30, -7, 1, 12, 30] {
        let scaled = all_objects(k).picture(4, 9);
        let different = picture.iter().zip(&scaled).filter(|(a, b)| a != b).count();
        assert_eq!(different, 0, "differing pixels at 2^{k}");
    }
}

#[test]
fn splitting_the_work_keeps_pixels_identical() {
    // A sample depends only on the scene, pixel, sample index and seed.
    for integrator in Integrator::ALL {
        assert_no_split(&all_objects(0).with(|scene| scene.render.integrator = *integrator));
    }
}

fn assert_no_split(build: &Build) {
    let (world, settings, token) = (build.world(), build.settings(4), CancelToken::new());
    let render = |x, y, width, height, samples| {
        let rect = Rect { x, y, width, height };
        let tile = render_tile(&world, &settings, rect, samples, &token).expect("the token is not canceled");
        tile.0.radiance
    };
    let whole = render(0, 0, 24, 20, 0..6);
    for (x, y, width, height, first, last) in
        [(0, 0, 24, 7, 0, 6), (5, 3, 1, 1, 2, 3), (7, 11, 13, 9, 0, 4), (23, 19, 1, 1, 5, 6)]
    {
        let part = render(x, y, width, height, first..last);
        for (i, radiance) in (0_u32..).zip(&part) {
            let (pixel, sample) = (i / (last - first), i % (last - first) + first);
            let (px, py) = (x + pixel % width, y + pixel / width);
            assert_eq!(*radiance, whole[((py * 24 + px) * 6 + sample) as usize]);
        }
    }
    let mut other = settings;
    other.render.seed = 5;
    let rect = Rect { x: 0, y: 0, width: 24, height: 20 };
    let reseeded =
        render_tile(&world, &other, rect, 0..6, &token).expect("the token is not canceled").0.radiance;
    assert_ne!(whole, reseeded);
}

#[test]
fn invalid_rays_hit_nothing() {
    let world = all_objects(0).with(|_| ()).world();
    let good = Ray::new(Vec3::new(0.1, 0.3, 0.5), Vec3::NEG_Z);
    assert!(world.geometry.closest_hit(&good).is_some());
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for axis in 0..3 {
            let (mut origin, mut direction) = (good, good);
            origin.origin[axis] = bad;
            direction.direction[axis] = bad;
            for ray in [origin, direction] {
                assert_eq!(world.geometry.closest_hit(&ray), None, "{ray:?}");
                assert!(
                    !world.geometry.is_occluded_except_by_light(&ray, GeometryOfLight::Nothing),
                    "{ray:?}"
                );
            }
        }
    }
    let still = Ray::new(good.origin, Vec3::ZERO);
    assert_eq!(world.geometry.closest_hit(&still), None);
}

#[test]
fn tree_finds_the_same_hit_as_brute_force() {
    // If several shapes are at the same distance, the lowest index wins, regardless of their order in the
    // tree.
    let mut random = TestRandom::new(31);
    let mut build = scene();
    for _ in 0..60 {
        let corner = v(random.signed(), random.signed(), 0.0) * 3.0;
        let (x, y) = (random.unit() * 2.0, random.unit() * 2.0);
        build = build.quad(corner, v(x, 0.0, 0.1 * x), v(0.0, y, 0.3 * y), matte(0.5));
        let z = 0.1 * corner.x + 0.3 * corner.y;
        let moved = corner + v(0.0, 0.0, z);
        build = build.quad(moved, v(x, 0.0, 0.1 * x), v(0.0, y, 0.3 * y), matte(0.5));
        let flat = v(corner.x, corner.y, -1.0 / 3.0);
        build = build.quad(flat, v(x, 0.0, 0.0), v(0.0, y, 0.0), matte(0.5));
        build = build.cuboid(flat - v(0.0, 0.0, 0.5), v(x, y, 1.0), DVec3::ZERO, matte(0.5));
        build = build.triangle([flat, flat + v(x, 0.0, 0.0), flat + v(0.0, y, 0.0)], matte(0.5));
    }
    let world = build.world();
    let mut found = 0;
    for i in 0..40_000 {
        let origin = v(random.signed() * 4.0, random.signed() * 4.0, 3.0 + random.unit());
        let direction = if i % 2 == 0 { DVec3::NEG_Z } else { v(random.signed(), random.signed(), -1.0) };
        let ray = Ray::new(origin.as_vec3(), direction.normalize().as_vec3());
        let one_by_one = (0_u32..).zip(world.geometry.objects()).filter_map(|(object, shape)| {
            Some(Hit { shape: shape.closest_hit(&ray, &ray.to_f64())?, object })
        });
        let nearest = one_by_one.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
        found += u32::from(nearest.is_some());
        assert_eq!(world.geometry.closest_hit(&ray), nearest, "{ray:?}");
        assert_eq!(
            world.geometry.is_occluded_except_by_light(&ray, GeometryOfLight::Nothing),
            nearest.is_some()
        );
    }
    assert!(found > 20_000);
}

#[test]
fn fresnel_matches_double_precision() {
    // The reference averages both polarizations in double precision from the same f32 cosine and IOR.
    let mut random = TestRandom::new(41);
    for _ in 0..100_000 {
        let cosine = 10.0_f64.powf(-6.0 * random.unit()) as f32;
        let eta = [1.0, 1.0001, 1.0 / 1.0001, 1.5, 1.0 / 1.5, 2.4, 1.0 / 2.4][(random.unit() * 7.0) as usize];
        let (reflectance, transmitted) = fresnel_dielectric(cosine, eta);
        let (c, n) = (f64::from(cosine), f64::from(eta));
        let cos2 = 1.0 - (1.0 - c * c) / (n * n);
        let exact = if cos2 <= 0.0 {
            1.0
        } else {
            let t = cos2.sqrt();
            (((n * c - t) / (n * c + t)).powi(2) + ((c - n * t) / (c + n * t)).powi(2)) / 2.0
        };
        assert!(
            (f64::from(reflectance) - exact).abs() < 1e-6,
            "R = {reflectance}, expected {exact} at cos {cosine}, eta {eta}"
        );
        assert!(eta != 1.0 || transmitted.is_some_and(|t| (t / cosine - 1.0).abs() < 1e-6), "at {cosine}");
    }
}
