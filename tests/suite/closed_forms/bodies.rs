//! Glass assembled from several open parts. Parts that together form a closed surface are one solid. Open
//! surfaces are reported, and they render identically with path tracing and photons.

use glimt::assets::LoadedMesh;
use glimt::control::CancelToken;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{Integrator, Material, Shape};
use glimt::world::GlassSolids;

use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, glass, lat_long_sphere, matte, scene, tinted};
use super::v;

/// The glass solids in a built scene.
fn bodies(build: &Build) -> GlassSolids {
    let meshes: Vec<&LoadedMesh> = build.parts.meshes.iter().map(|mesh| mesh.loaded_mesh()).collect();
    GlassSolids::find(&build.scene, &meshes, &CancelToken::new()).expect("the token is not canceled")
}

/// A prism whose base is a polygon in the plane z = 0, specified counterclockwise as viewed from +z. Each
/// side is divided into rectangles.
fn prism(polygon: &[DVec3], caps: &[[usize; 3]], height: f64, steps: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut put = |corners: [DVec3; 3]| {
        let ids = corners.map(|corner| {
            let place = corner.as_vec3();
            let known = mesh.positions.iter().position(|&own| own == place);
            known.unwrap_or_else(|| {
                mesh.positions.push(place);
                mesh.positions.len() - 1
            }) as u32
        });
        mesh.triangles.push(ids);
    };
    let up = |step: usize| v(0.0, 0.0, height * step as f64 / steps as f64);
    for i in 0..polygon.len() {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        for step in 0..steps {
            put([a + up(step), b + up(step), b + up(step + 1)]);
            put([a + up(step), b + up(step + 1), a + up(step + 1)]);
        }
    }
    for &[a, b, c] in caps {
        put([polygon[a], polygon[c], polygon[b]]);
        put([a, b, c].map(|i| polygon[i] + up(steps)));
    }
    mesh
}

/// A closed solid above z = 0 with a size of about 1.
fn closed(round: usize) -> TriangleMesh {
    let corner = |x: f64, y: f64| v(x, y, 0.0);
    match round % 4 {
        0 => lat_long_sphere(12, 20, 0.7, v(0.0, 0.0, 0.9)),
        // An L-shaped prism.
        1 => prism(
            &[
                corner(-0.8, -0.8),
                corner(0.8, -0.8),
                corner(0.8, 0.0),
                corner(0.0, 0.0),
                corner(0.0, 0.8),
                corner(-0.8, 0.8),
            ],
            &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]],
            1.1,
            3,
        ),
        2 => prism(
            &[corner(-0.7, -0.6), corner(0.7, -0.6), corner(0.7, 0.6), corner(-0.7, 0.6)],
            &[[0, 1, 2], [0, 2, 3]],
            0.9,
            4,
        ),
        _ => prism(&[corner(-0.8, -0.5), corner(0.8, -0.5), corner(0.0, 0.9)], &[[0, 1, 2]], 1.3, 2),
    }
}

/// A mesh's triangles that satisfy `holds`.
fn submesh(mesh: &TriangleMesh, holds: impl Fn(usize) -> bool) -> TriangleMesh {
    let own = mesh.triangles.iter().enumerate().filter(|&(i, _)| holds(i));
    TriangleMesh { triangles: own.map(|(_, &own)| own).collect(), ..mesh.clone() }
}

/// Splits a mesh into parts by assigning each triangle to the nearest of several random points.
fn split_at_random(mesh: &TriangleMesh, count: usize, random: &mut TestRandom) -> Vec<TriangleMesh> {
    let middle = |i: usize| mesh.corners(i as u32).iter().sum::<Vec3>() / 3.0;
    let seeds: Vec<Vec3> =
        (0..count).map(|_| middle((random.unit() * mesh.triangles.len() as f64) as usize)).collect();
    let nearest = |i: usize| {
        let off = |seed: usize| seeds[seed].distance_squared(middle(i));
        (0..count).min_by(|&a, &b| off(a).total_cmp(&off(b))).expect("a seed")
    };
    let parts = (0..count).map(|seed| submesh(mesh, |i| nearest(i) == seed));
    parts.filter(|part| !part.triangles.is_empty()).collect()
}

fn inside_out(mesh: &TriangleMesh) -> TriangleMesh {
    TriangleMesh { triangles: mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(), ..mesh.clone() }
}

/// A floor with a large area light above it, and the parts in between.
fn room(parts: &[TriangleMesh], material: &Material) -> Build {
    let build = scene().quad(v(-6.0, -6.0, -0.1), v(12.0, 0.0, 0.0), v(0.0, 12.0, 0.0), matte(0.7)).quad(
        v(-3.0, 3.0, 4.0),
        v(6.0, 0.0, 0.0),
        v(0.0, -6.0, 0.0),
        emitter(1.0),
    );
    let build = parts
        .iter()
        .fold(build, |build, part| build.mesh(part.clone(), IDENTITY_PLACEMENT, material.clone()));
    build.pictured(v(0.9, -4.2, 2.6), v(0.0, 0.0, 0.4), 30.0, 12, 12).depth(12)
}

fn path_traced(build: Build) -> Build {
    build.with(|scene| scene.render.integrator = Integrator::Path)
}

#[test]
fn solid_split_into_parts_renders_the_same() {
    let mut random = TestRandom::new(11);
    for round in 0..12 {
        let whole = closed(round);
        let count = 2 + (random.unit() * 5.0) as usize;
        let parts = split_at_random(&whole, count, &mut random);
        let material = tinted(1.5, v(0.6, 0.9, 0.8));
        let (one, several) = (room(&[whole], &material), room(&parts, &material));
        let found = bodies(&several);
        assert!(
            !found.has_open() && found.open_objects().is_empty(),
            "round {round}: {:?}",
            found.open_objects()
        );
        let last = several.scene.objects.len() as u32 - 1;
        for part in 2..=last {
            assert_eq!(found.solid_id(part), last, "round {round}");
            assert!(!found.is_inside_out(part), "round {round}");
        }
        let [one_path, several_path] = [&one, &several].map(|build| path_traced(build.clone()).picture(8, 5));
        assert!(one_path == several_path, "round {round}: {} parts, path tracing", parts.len());
        // Photons are aimed at objects, so splitting an object changes the photons.
        if round < 4 {
            let [one, several] = [one, several].map(|build| build.photons(4000, 0.1));
            assert_same(&format!("round {round}: photons"), &one, &several, 2, 3.5, 0.0);
        }
    }
}

#[test]
fn reversed_part_is_flipped() {
    let mut random = TestRandom::new(5);
    for round in 0..8 {
        let whole = closed(round);
        let mut parts = split_at_random(&whole, 4, &mut random);
        let material = glass(1.5);
        let right = path_traced(room(&parts, &material)).picture(8, 3);
        let flips: Vec<bool> = parts.iter().map(|_| random.unit() < 0.5).collect();
        for (part, _) in parts.iter_mut().zip(&flips).filter(|(_, flip)| **flip) {
            *part = inside_out(part);
        }
        let build = room(&parts, &material);
        let found = bodies(&build);
        assert!(found.open_objects().is_empty(), "round {round}: {:?}", found.open_objects());
        for (object, flip) in (2..).zip(&flips) {
            assert_eq!(found.is_inside_out(object), *flip, "round {round}");
        }
        // Reversed triangles round differently, which changes a few paths.
        let sum = |picture: &[DVec3]| picture.iter().map(|pixel| pixel.y).sum::<f64>();
        let (own, right) = (sum(&path_traced(build).picture(8, 3)), sum(&right));
        assert!((own - right).abs() < 1e-3 * right, "round {round}: {flips:?}: {own}, expected {right}");
    }
}

#[test]
fn long_edge_matches_several_short_edges() {
    // A box at an oblique angle to the axes. Its sides are divided into strips, but its lids are not.
    let corners = [v(-0.7, -0.6, 0.0), v(0.7, -0.6, 0.0), v(0.7, 0.6, 0.0), v(-0.7, 0.6, 0.0)];
    let side = |step: f64| v(0.0, 0.0, 0.9 * step);
    let mut sides = TriangleMesh::default();
    for i in 0..4 {
        for step in 0..7 {
            let (from, to) = (corners[i], corners[(i + 1) % 4]);
            let at = |step: usize| from + (to - from) * (step as f64 / 7.0);
            let first = sides.positions.len() as u32;
            let own = [at(step), at(step + 1), at(step + 1) + side(1.0), at(step) + side(1.0)];
            sides.positions.extend(own.map(|own| own.as_vec3()));
            sides.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    let lid = |height: f64| TriangleMesh {
        positions: corners.map(|corner| (corner + side(height)).as_vec3()).to_vec(),
        triangles: if height > 0.0 { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] },
        ..TriangleMesh::default()
    };
    let askew = [DVec3::splat(1.3), v(20.0, -35.0, 70.0), v(0.1, 0.2, 0.3)];
    let build = |parts: &[TriangleMesh]| {
        parts.iter().fold(scene(), |build, part| build.mesh(part.clone(), askew, glass(1.5)))
    };
    let closed = bodies(&build(&[lid(0.0), sides.clone(), lid(1.0)]));
    assert!(closed.open_objects().is_empty(), "{:?}", closed.open_objects());
    assert_eq!([0, 1, 2].map(|part| closed.solid_id(part)), [2; 3]);
    let without = bodies(&build(&[sides, lid(1.0)]));
    assert!(without.has_open());
    let [open] = without.open_objects() else { panic!("{:?}", without.open_objects()) };
    assert_eq!((open.object, open.edges, open.disagrees, open.is_covered), (0, 28, false, false));
    assert!((open.missing - 1.68 / (1.68 + 0.9 * 5.2)).abs() < 1e-5, "{}", open.missing);
}

/// The six quads of a box between two corners. `flips` is a bit mask of inward-facing quads.
fn quads(low: DVec3, high: DVec3, flips: u32) -> Vec<Shape> {
    let size = high - low;
    let mut quads = Vec::new();
    for axis in 0..3 {
        let edge = |axis: usize| {
            let mut edge = DVec3::ZERO;
            edge[axis] = size[axis];
            edge
        };
        let (u, w) = (edge((axis + 1) % 3), edge((axis + 2) % 3));
        for (far, corner) in [(false, low), (true, low + edge(axis))] {
            let is_flipped = flips >> quads.len() & 1 == 1;
            let (u, v) = if far != is_flipped { (u, w) } else { (w, u) };
            quads.push(Shape::Quad { corner, u, v });
        }
    }
    quads
}

#[test]
fn quads_and_disks_close_solids() {
    let of =
        |shapes: Vec<Shape>| shapes.into_iter().fold(scene(), |build, shape| build.shape(shape, glass(1.5)));
    for flips in 0..64 {
        let own = bodies(&of(quads(v(0.1, 0.2, -0.3), v(1.4, 0.9, 0.7), flips)));
        assert!(own.open_objects().is_empty(), "{flips}: {:?}", own.open_objects());
        for quad in 0..6 {
            assert_eq!((own.solid_id(quad), own.is_inside_out(quad)), (5, flips >> quad & 1 == 1), "{flips}");
        }
    }
    // One quad is missing.
    let five = bodies(&of(quads(v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0), 0)[1..].to_vec()));
    assert!(five.has_open() && five.open_objects().len() == 4, "{:?}", five.open_objects());
    // Two boxes that share a face are two solids, although four quads meet at each shared edge.
    let (one, other) =
        (quads(v(0.0, 0.0, 0.0), v(1.0, 1.0, 1.0), 0), quads(v(1.0, 0.0, 0.0), v(2.0, 1.0, 1.0), 0));
    let two = bodies(&of([one, other].concat()));
    assert!(two.open_objects().is_empty(), "{:?}", two.open_objects());
    assert_eq!((0..12).map(|quad| two.solid_id(quad)).collect::<Vec<_>>(), [[5; 6], [11; 6]].concat());
    // A tube with lids, one of them facing inward. A cone with a separate base.
    let (a, b) = (v(0.3, -0.2, 0.1), v(1.0, 0.5, -0.4));
    let tube = Shape::Cylinder { a, b, radius: 0.4, caps: false };
    let lid = |center: DVec3, normal: DVec3| Shape::Disk { center, normal, radius: 0.4 };
    let own = bodies(&of(vec![tube.clone(), lid(a, b - a), lid(b, b - a)]));
    assert!(own.open_objects().is_empty(), "{:?}", own.open_objects());
    assert_eq!(
        [0, 1, 2].map(|part| (own.solid_id(part), own.is_inside_out(part))),
        [(2, false), (2, true), (2, false)]
    );
    let hat = Shape::Cone { base: a, tip: b, radius: 0.4, cap: false };
    assert!(bodies(&of(vec![lid(a, a - b), hat])).open_objects().is_empty());
    assert_eq!(bodies(&of(vec![tube, lid(a, a - b)])).open_objects().len(), 1);
}

#[test]
fn quads_of_glass_are_a_box() {
    let (low, high) = (v(-0.7, -0.6, 0.0), v(0.7, 0.6, 0.9));
    let material = tinted(1.5, v(0.6, 0.9, 0.8));
    let whole = path_traced(room(&[], &material)).cuboid(
        (low + high) * 0.5,
        high - low,
        DVec3::ZERO,
        material.clone(),
    );
    let parts = quads(low, high, 0b10_0110).into_iter();
    let parts =
        parts.fold(path_traced(room(&[], &material)), |build, quad| build.shape(quad, material.clone()));
    assert_same("quads", &whole, &parts, 64, 3.5, 0.0);
}

#[test]
fn camera_inside_split_solid_is_in_glass() {
    // The camera sees a light through 0.8 units of glass, with no surface in between.
    let (low, high) = (v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0));
    let material = tinted(1.33, v(0.5, 0.5, 0.5));
    let lit = |build: Build| {
        build.sphere(v(0.3, 0.9, 1.0), 0.1, emitter(2.0)).seen(v(0.3, 0.0, 1.0), v(0.3, 0.9, 1.0))
    };
    let of = |shapes: &[Shape], is_opaque: &dyn Fn(usize) -> bool| {
        let shapes = shapes.iter().enumerate();
        shapes.fold(scene(), |build, (number, shape)| {
            build.shape(shape.clone(), if is_opaque(number) { matte(0.5) } else { material.clone() })
        })
    };
    let none = |_: usize| false;
    let whole = scene().cuboid((low + high) * 0.5, high - low, DVec3::ZERO, material.clone());
    let cube = prism(
        &[low, v(1.0, -1.0, 0.0), v(1.0, 1.0, 0.0), v(-1.0, 1.0, 0.0)],
        &[[0, 1, 2], [0, 2, 3]],
        2.0,
        3,
    );
    let mesh = |mesh: &TriangleMesh| scene().mesh(mesh.clone(), IDENTITY_PLACEMENT, material.clone());
    // The last quad is the top, which is the surface of the pool.
    let bodies = [
        ("a box", whole),
        ("quads", of(&quads(low, high, 0), &none)),
        ("inward-facing quads", of(&quads(low, high, 0b10_0110), &none)),
        ("a pool", of(&quads(low, high, 0), &|number| number != 5)),
        ("a mesh", mesh(&cube)),
        ("an inward-facing mesh", mesh(&inside_out(&cube))),
    ];
    for (what, build) in bodies {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let value = lit(build.clone()).with(|scene| scene.render.integrator = integrator).value();
            let expected = 2.0 * 0.5_f64.powf(0.8);
            assert!(
                (value - expected).abs() < 1e-3,
                "{what} with {integrator:?}: {value}, expected {expected}"
            );
        }
    }
    // Above the pool, the ray passes through no glass.
    let above = of(&quads(low, high, 0), &|number| number != 5)
        .sphere(v(0.3, 0.9, 3.0), 0.1, emitter(2.0))
        .seen(v(0.3, 0.0, 3.0), v(0.3, 0.9, 3.0));
    assert!((above.value() - 2.0).abs() < 1e-6, "{}", above.value());
}

#[test]
fn light_inside_split_solid_emits_photons() {
    let cube = |low: f64, high: f64, z: f64| {
        let at = |x: f64, y: f64| v(x, y, z);
        prism(
            &[at(low, low), at(high, low), at(high, high), at(low, high)],
            &[[0, 1, 2], [0, 2, 3]],
            high - low,
            2,
        )
    };
    // A light in a hollow glass cube made of two meshes. The camera looks into the room through its open top.
    let walls = quads(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 2.0), 0).into_iter().take(5);
    let hollow = walls
        .fold(scene(), |build, wall| build.shape(wall, matte(0.6)))
        .mesh(cube(-0.5, 0.5, 0.5), IDENTITY_PLACEMENT, glass(1.45))
        .mesh(cube(-0.35, 0.35, 0.65), IDENTITY_PLACEMENT, glass(1.0))
        .sphere(v(0.0, 0.0, 1.0), 0.2, emitter(5.0))
        .pictured(v(0.0, 0.0, 6.0), v(0.0, 0.0, 0.0), 24.0, 12, 12)
        .depth(5);
    // A light in an air bubble in a pool with opaque walls.
    let water = tinted(1.33, v(0.5, 0.5, 0.5));
    let pool = quads(v(-1.0, -1.0, 0.0), v(1.0, 1.0, 1.0), 0).into_iter().enumerate();
    let pool = pool
        .fold(scene(), |build, (number, shape)| {
            build.shape(shape, if number == 5 { water.clone() } else { matte(0.6) })
        })
        .cuboid(v(0.3, 0.2, 0.6), v(0.4, 0.4, 0.4), DVec3::ZERO, glass(1.0))
        .sphere(v(0.3, 0.2, 0.6), 0.1, emitter(20.0))
        .pictured(v(0.0, 0.0, 6.0), v(0.0, 0.0, 0.0), 16.0, 12, 12)
        .depth(4);
    for (what, build, depth, passes) in [("a hollow", hollow, 5, 6), ("a pool", pool, 4, 12)] {
        let means = path_and_photon_means(&build, depth, [384, passes], (4_000, 0.05));
        assert_same_light(what, means, 1.2e-2, 4e-3);
    }
}

/// Checks that two scenes have the same mean in the whole image and in each quarter, to within `errors`
/// standard errors plus a fraction of the value.
#[track_caller]
fn assert_same(what: &str, one: &Build, other: &Build, samples: u32, errors: f64, part: f64) {
    let means = |build: &Build, first: u32| -> Vec<[f64; 5]> {
        let pictures = build.pictures(samples, first..first + 16);
        pictures
            .iter()
            .map(|picture| {
                let mut sums = [0.0; 5];
                for (i, pixel) in picture.iter().enumerate() {
                    let (x, y) = (i % 12, i / 12);
                    sums[x / 6 + 2 * (y / 6)] += (pixel.x + pixel.y + pixel.z) / 108.0;
                    sums[4] += (pixel.x + pixel.y + pixel.z) / 432.0;
                }
                sums
            })
            .collect()
    };
    let (one, other) = (means(one, 0), means(other, 100));
    for quarter in 0..5 {
        let of = |means: &[[f64; 5]]| {
            let own: Vec<f64> = means.iter().map(|sums| sums[quarter]).collect();
            super::mean_and_error(&own)
        };
        let ((a, a_error), (b, b_error)) = (of(&one), of(&other));
        let allowed = errors * a_error.hypot(b_error) + part * a;
        assert!(a > 0.0 && a_error < 0.02 * a, "{what}, {quarter}: too noisy: {a} ± {a_error}");
        assert!((a - b).abs() <= allowed, "{what}, {quarter}: {a} ± {a_error} vs. {b} ± {b_error}");
    }
}

#[test]
fn texture_seams_are_not_holes() {
    // Triangles do not share vertices.
    let whole = lat_long_sphere(12, 20, 0.7, v(0.1, 0.2, 0.9));
    let positions: Vec<Vec3> =
        whole.triangles.iter().flatten().map(|&i| whole.positions[i as usize]).collect();
    let triangles = (0..whole.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let loose = TriangleMesh { positions, triangles, ..TriangleMesh::default() };
    let of = |mesh: TriangleMesh| bodies(&scene().mesh(mesh, IDENTITY_PLACEMENT, glass(1.5)));
    assert_eq!(of(loose), GlassSolids::default());
    assert_eq!(of(whole.clone()), GlassSolids::default());
    // An inside-out mesh.
    assert!(of(inside_out(&whole)).is_inside_out(0) && of(inside_out(&whole)).open_objects().is_empty());
    // A mirrored instance.
    let mirrored =
        scene().mesh(whole, [v(-1.0, 1.0, 2.0), v(10.0, 20.0, 30.0), v(5.0, 0.0, 1.0)], glass(1.5));
    assert_eq!(bodies(&mirrored), GlassSolids::default());
}

#[test]
fn glass_with_a_hole_is_reported() {
    let mut random = TestRandom::new(3);
    for round in 0..40 {
        let whole = closed(round);
        // Remove a triangle.
        let lost = (random.unit() * whole.triangles.len() as f64) as usize;
        let mut parts = split_at_random(&submesh(&whole, |i| i != lost), 3, &mut random);
        let open = bodies(&room(&parts, &glass(1.5)));
        let area = |mesh: &TriangleMesh| {
            let area = |corners: [Vec3; 3]| (corners[1] - corners[0]).cross(corners[2] - corners[0]).length();
            (0..mesh.triangles.len() as u32).map(|i| area(mesh.corners(i))).sum::<f32>() * 0.5
        };
        let missing = area(&submesh(&whole, |i| i == lost));
        let expected = f64::from(missing / (area(&whole) - missing));
        assert!(!open.open_objects().is_empty(), "round {round}");
        assert_eq!(open.open_objects().iter().map(|open| open.edges).sum::<usize>(), 3, "round {round}");
        for one in open.open_objects() {
            assert!(
                (one.missing - expected).abs() < 1e-4 * expected,
                "round {round}: {one:?}, expected {expected}"
            );
            assert!(!one.disagrees && !one.is_covered, "round {round}: {one:?}");
            assert_eq!(open.is_open(open.solid_id(one.object)), expected > 1e-3, "round {round}");
        }
        // Put the triangle back with reversed orientation.
        parts[0].triangles.push({
            let [a, b, c] = whole.triangles[lost];
            [a, c, b]
        });
        let odd = bodies(&room(&parts, &glass(1.5)));
        assert!(!odd.open_objects().is_empty(), "round {round}");
    }
}

#[test]
fn sheet_between_opaque_walls_is_closed() {
    // A pool surface that touches the walls or extends through them.
    let wall = |build: Build, corner: DVec3, u: DVec3, w: DVec3| build.quad(corner, u, w, matte(0.5));
    let pool = |reach: f64| {
        let (x, y, z) = (v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), v(0.0, 0.0, 1.0));
        let build = wall(scene(), v(-1.0, -1.0, 0.0), x, y);
        let build = wall(wall(build, v(-1.0, -1.0, 0.0), x, z), v(-1.0, 1.0, 0.0), x, z);
        let build = wall(wall(build, v(-1.0, -1.0, 0.0), y, z), v(1.0, -1.0, 0.0), y, z);
        build.quad(v(-reach, -reach, 0.7), v(2.0 * reach, 0.0, 0.0), v(0.0, 2.0 * reach, 0.0), glass(1.33))
    };
    for reach in [1.0, 1.2] {
        let own = bodies(&pool(reach));
        assert!(
            !own.has_open() && own.open_objects().iter().all(|open| open.is_covered),
            "{reach}: {:?}",
            own.open_objects()
        );
    }
    for reach in [0.5, 0.98] {
        let own = bodies(&pool(reach));
        assert!(
            own.has_open() && own.open_objects().iter().all(|open| !open.is_covered),
            "{reach}: {:?}",
            own.open_objects()
        );
    }
}

#[test]
fn curved_opaque_surface_closes_open_glass() {
    // A label on a glass ball. The ball has no triangles under the label.
    let ball = lat_long_sphere(12, 20, 0.7, v(0.0, 0.0, 0.9));
    let middle = |i: usize| ball.corners(i as u32).iter().sum::<Vec3>() / 3.0;
    let is_label = |i: usize| middle(i).x > 0.4;
    let (bare, label) = (submesh(&ball, |i| !is_label(i)), submesh(&ball, is_label));
    let with = |label: TriangleMesh| {
        scene().mesh(bare.clone(), IDENTITY_PLACEMENT, glass(1.5)).mesh(label, IDENTITY_PLACEMENT, matte(0.5))
    };
    let fits = bodies(&with(label.clone()));
    assert!(
        !fits.has_open() && fits.open_objects().iter().all(|open| open.is_covered),
        "{:?}",
        fits.open_objects()
    );
    // The label does not touch the ball.
    let off =
        TriangleMesh { positions: label.positions.iter().map(|p| p + Vec3::X * 0.02).collect(), ..label };
    assert!(bodies(&with(off)).has_open());
    // Two glass panes in an opaque tube. The chords along their rims deviate from the tube by 2 % of the
    // radius.
    let pane = |radius: f64, height: f64, faces_up: bool| {
        let mut mesh =
            TriangleMesh { positions: vec![v(0.0, 0.0, height).as_vec3()], ..TriangleMesh::default() };
        for i in 0..16 {
            let angle = f64::from(i) / 16.0 * std::f64::consts::TAU;
            mesh.positions.push(v(radius * angle.cos(), radius * angle.sin(), height).as_vec3());
            let (one, next) = (i as u32 + 1, (i as u32 + 1) % 16 + 1);
            mesh.triangles.push(if faces_up { [0, one, next] } else { [0, next, one] });
        }
        mesh
    };
    let tube = Shape::Cylinder { a: v(0.0, 0.0, -1.0), b: v(0.0, 0.0, 1.0), radius: 1.0, caps: false };
    for (radius, is_open) in [(1.0, false), (0.95, true)] {
        let plug = scene()
            .shape(tube.clone(), matte(0.5))
            .mesh(pane(radius, 0.4, true), IDENTITY_PLACEMENT, glass(1.5))
            .mesh(pane(radius, -0.4, false), IDENTITY_PLACEMENT, glass(1.5));
        assert_eq!(bodies(&plug).has_open(), is_open, "{radius}");
    }
}

#[test]
fn each_hole_is_tested_separately() {
    // Five-sided boxes: on a table, above the table, with the open side up, and on a mesh.
    let (low, high) = (v(0.0, 0.0, 0.0), v(1.0, 1.0, 0.5));
    let five = |at: DVec3, lost: usize| {
        let all = quads(low + at, high + at, 0).into_iter().enumerate();
        all.filter(move |(i, _)| *i != lost).map(|(_, quad)| quad)
    };
    let bottom = (0..6).find(|&i| {
        let Shape::Quad { corner, u, v } = quads(low, high, 0)[i] else { return false };
        [corner, corner + u, corner + v].iter().all(|place| place.z == 0.0)
    });
    let (bottom, x) = (bottom.expect("a side"), |i: f64| v(3.0 * i, 0.0, 0.0));
    let top = (0..6).find(|&i| {
        let Shape::Quad { corner, u, v } = quads(low, high, 0)[i] else { return false };
        [corner, corner + u, corner + v].iter().all(|place| place.z == 0.5)
    });
    let top = top.expect("a side");
    let table = v(-1.0, -1.0, 0.0);
    let mut board = prism(
        &[v(8.0, -1.0, 0.0), v(11.0, -1.0, 0.0), v(11.0, 2.0, 0.0), v(8.0, 2.0, 0.0)],
        &[[0, 1, 2], [0, 2, 3]],
        0.1,
        1,
    );
    board.positions.iter_mut().for_each(|place| place.z -= 0.1);
    let parts = [
        five(x(0.0), bottom),
        five(x(1.0) + v(0.0, 0.0, 0.2), bottom),
        five(x(2.0), top),
        five(x(3.0), bottom),
    ];
    let build = scene().quad(table, v(3.0, 0.0, 0.0), v(0.0, 3.0, 0.0), matte(0.5)).mesh(
        board,
        IDENTITY_PLACEMENT,
        matte(0.5),
    );
    let build = parts.into_iter().flatten().fold(build, |build, quad| build.shape(quad, glass(1.5)));
    let found = bodies(&build);
    let is_open = [0, 1, 2, 3].map(|part| found.is_open(found.solid_id(2 + 5 * part)));
    assert_eq!(is_open, [false, true, true, false], "{:?}", found.open_objects());
}

#[test]
fn inward_facing_mesh_in_glass_is_a_cavity() {
    let tint = v(0.5, 0.9, 0.25);
    // With an IOR of 1, the color depends only on the distance through glass.
    let material = tinted(1.0, tint);
    let seen = |parts: &[TriangleMesh], x: f64| {
        let build = scene().background(1.0).depth(20).seen(v(x, 0.013, 5.0), v(x, 0.013, 0.0));
        parts
            .iter()
            .fold(build, |build, part| build.mesh(part.clone(), IDENTITY_PLACEMENT, material.clone()))
            .color()
    };
    let ball = |radius: f64| lat_long_sphere(96, 192, radius, DVec3::ZERO);
    let chord = |radius: f64, x: f64| 2.0 * (radius * radius - x * x - 0.013 * 0.013).max(0.0).sqrt();
    let check = |what: &str, parts: &[TriangleMesh], x: f64, way: f64| {
        let color = seen(parts, x);
        for channel in 0..3 {
            let exact = tint[channel].powf(way);
            assert!((color[channel] - exact).abs() < 2e-3, "{what}, {x}: {color} at distance {way}");
        }
    };
    let (outer, inner) = (ball(1.0), ball(0.8));
    for x in [0.0, 0.3, 0.7, 0.9] {
        let shell = chord(1.0, x) - chord(0.8, x);
        check("hollow", &[outer.clone(), inside_out(&inner)], x, shell);
        check("reverse order", &[inside_out(&inner), outer.clone()], x, shell);
        check("solid", &[outer.clone(), inner.clone()], x, chord(1.0, x));
        check("alone", &[inside_out(&inner)], x, chord(0.8, x));
        let onion = [outer.clone(), inside_out(&ball(0.2)), inside_out(&inner), ball(0.5)];
        check("hollow ball inside", &onion, x, shell + chord(0.5, x) - chord(0.2, x));
        let lost = [outer.clone(), inside_out(&inner), inside_out(&ball(0.5))];
        check("inside-out ball inside", &lost, x, shell + chord(0.5, x));
    }
    // Two separate cavities. A mesh that is partly outside or has a different material is not a cavity.
    let at = |radius: f64, x: f64| lat_long_sphere(24, 48, radius, v(x, 0.0, 0.0));
    let two = scene().mesh(at(1.0, 0.0), IDENTITY_PLACEMENT, material.clone());
    let two = two.mesh(inside_out(&at(0.3, -0.5)), IDENTITY_PLACEMENT, material.clone());
    let two = bodies(&two.mesh(inside_out(&at(0.3, 0.5)), IDENTITY_PLACEMENT, material.clone()));
    assert_eq!([0, 1, 2].map(|object| (two.solid_id(object), two.is_inside_out(object))), [(2, false); 3]);
    for (other, x) in [(material.clone(), 0.9), (tinted(1.0, v(0.4, 0.9, 0.25)), 0.5)] {
        let build = scene().mesh(at(1.0, 0.0), IDENTITY_PLACEMENT, material.clone());
        let own = bodies(&build.mesh(inside_out(&at(0.3, x)), IDENTITY_PLACEMENT, other));
        assert_eq!(
            [0, 1].map(|object| (own.solid_id(object), own.is_inside_out(object))),
            [(0, false), (1, true)]
        );
    }
}

#[test]
fn open_glass_matches_with_path_and_photons() {
    let material = tinted(1.8, v(0.5, 0.9, 0.7));
    let sphere = lat_long_sphere(12, 20, 0.7, v(0.0, 0.0, 0.9));
    let middle = |i: usize| sphere.corners(i as u32).iter().sum::<Vec3>() / 3.0;
    let (bowl, dome) = (submesh(&sphere, |i| middle(i).z < 0.9), submesh(&sphere, |i| middle(i).z > 0.95));
    // Two parts of a solid that do not touch. Both are open.
    let block = closed(2);
    let height = |i: usize| block.corners(i as u32).iter().map(|corner| corner.z).sum::<f32>() / 3.0;
    let apart = [submesh(&block, |i| height(i) > 0.89), submesh(&block, |i| height(i) < 0.6)];
    for (what, parts) in [("bowl", vec![bowl]), ("dome", vec![dome]), ("apart", apart.to_vec())] {
        let build = room(&parts, &material);
        assert!(bodies(&build).has_open(), "{what}");
        assert_same(what, &path_traced(build.clone()), &build.photons(8_000, 0.05), 7, 3.5, 0.006);
    }
}
