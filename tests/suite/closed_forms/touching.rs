//! Glass that touches or overlaps other glass or opaque surfaces. Both surfaces count, regardless of file
//! order and angle.

use glimt::geometry::mesh::TriangleMesh;
use glimt::materials::Dielectric;
use glimt::math::random::TestRandom;
use glimt::math::transform::rotation_xyz;
use glimt::math::{DMat3, DVec3, Vec3};
use glimt::scene::description::Shape;

use super::glass::boxes;
use super::global::path_traced;
use super::scenes::{self, Build, IDENTITY_PLACEMENT, emitter, file_material, glass, matte, mirror, scene};
use super::{assert_close, mean_and_error, v};

/// Unpolarized reflectance between IORs `n` and `m` from the Fresnel equations. `sine` is the sine of the
/// ray's angle in air.
fn fresnel(n: f64, m: f64, sine: f64) -> f64 {
    let cosine = |n: f64| (1.0 - (sine / n).powi(2)).sqrt();
    let (a, b) = (cosine(n), cosine(m));
    let across = (n * a - m * b) / (n * a + m * b);
    let along = (m * a - n * b) / (m * a + n * b);
    0.5 * (across * across + along * along)
}

/// Reflectance and transmittance of a stack of layers in air. Adds one surface at a time; interreflections
/// between the previous surfaces and the new one form a geometric series.
fn layers(indices: &[f64], sine: f64) -> (f64, f64) {
    let media: Vec<f64> = [1.0].iter().chain(indices).chain(&[1.0]).copied().collect();
    // Reflectance from above, reflectance from below, and transmittance of the previous surfaces.
    let (mut above, mut below, mut passed) = (0.0, 0.0, 1.0);
    for pair in media.windows(2) {
        let r = fresnel(pair[0], pair[1], sine);
        let series = 1.0 / (1.0 - below * r);
        above += passed * passed * r * series;
        below = r + (1.0 - r).powi(2) * below * series;
        passed *= (1.0 - r) * series;
    }
    (above, passed)
}

#[test]
fn layer_formula_matches_known_values() {
    // A slab transmits (1 − R)/(1 + R). For n = 1.5 and 2, 1/T − 1 is the sum of R/(1 − R): 1/24 + 1/48 +
    // 1/8.
    let (r, t) = layers(&[1.5], 0.0);
    assert_close("passed", t, 0.96 / 1.04);
    assert_close("reflected", r, 0.08 / 1.04);
    assert_close("two", layers(&[1.5, 2.0], 0.0).1, 1.0 / (1.0 + 1.0 / 24.0 + 1.0 / 48.0 + 1.0 / 8.0));
    assert_close("45°", layers(&[1.5], 0.5_f64.sqrt()).1, 0.904_326_79);
}

/// Rotation of a whole scene.
#[derive(Clone, Copy)]
struct SceneRotation {
    degrees: DVec3,
    axes: DMat3,
}

impl SceneRotation {
    fn from_degrees(degrees: DVec3) -> Self {
        Self { degrees, axes: rotation_xyz(degrees) }
    }

    fn random(random: &mut TestRandom) -> Self {
        Self::from_degrees(v(random.signed(), random.signed(), random.signed()) * 180.0)
    }

    /// A box between two corners.
    fn cuboid(&self, low: DVec3, high: DVec3) -> Shape {
        let center = self.axes * ((low + high) * 0.5);
        Shape::Box { center, size: high - low, rotate: self.degrees }
    }

    /// A square at y = `height`, centered on the axis and facing up.
    fn square(&self, height: f64, half: f64) -> Shape {
        let [corner, u, v] = [v(-half, height, half), v(2.0 * half, 0.0, 0.0), v(0.0, 0.0, -2.0 * half)];
        Shape::Quad { corner: self.axes * corner, u: self.axes * u, v: self.axes * v }
    }

    fn seen(&self, build: Build, from: DVec3, at: DVec3) -> Build {
        build.seen(self.axes * from, self.axes * at)
    }
}

/// Checks that the mean over seeds is exact to within a fraction of the value.
#[track_caller]
fn assert_within(what: &str, build: &Build, samples: u32, exact: f64, part: f64) {
    let (mean, error) = mean_and_error(&build.values(samples, 16));
    assert!(error <= 0.4 * part * exact, "{what}: too noisy: {mean} ± {error}");
    assert!((mean - exact).abs() <= part * exact, "{what}: {mean} ± {error}, expected {exact}");
}

/// Layers of glass below y = 0, starting with the top layer. `order` is their order in the scene.
fn stack(turned: &SceneRotation, layers: &[(f64, f64)], order: &[usize], half: f64) -> Build {
    let mut tops = vec![0.0];
    for (_, thickness) in layers {
        tops.push(tops[tops.len() - 1] - thickness);
    }
    order.iter().fold(scene(), |build, &i| {
        let shape = turned.cuboid(v(-half, tops[i + 1], -half), v(half, tops[i], half));
        build.shape(shape, glass(layers[i].0 as f32))
    })
}

#[test]
fn boxes_sharing_a_face_match_layers() {
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let exact = layers(&[1.5, 2.0], 0.0).1;
    for order in [[0, 1], [1, 0]] {
        let both = stack(&level, &[(1.5, 1.0), (2.0, 1.0)], &order, 500.0).depth(200);
        let both = both.seen(v(0.3, 2.0, 0.2), v(0.3, 0.0, 0.2));
        let white = both.clone().background(1.0);
        assert_within(&format!("{order:?}, white background"), &white, 16, 1.0, 1e-3);
        let lamp = both.shape(level.square(-3.0, 5000.0), emitter(1.0));
        assert_within(&format!("{order:?}, above a light"), &lamp, 512, exact, 2e-3);
    }
}

#[test]
fn no_boundary_between_equal_iors() {
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let lamp_under = |index: f64, depth: u32| {
        stack(&level, &[(index, 1.0); 3], &[0, 1, 2], 500.0)
            .shape(level.square(-9.0, 5000.0), emitter(1.0))
            .seen(v(0.3, 2.0, 0.2), v(0.3, 0.0, 0.2))
            .depth(depth)
    };
    // Passing through three boxes with the same IOR takes two bounces. Boxes of air take none.
    assert_within("boxes with equal IORs", &lamp_under(1.5, 2), 512, 0.96 * 0.96, 2e-3);
    assert_within("path", &path_traced(lamp_under(1.5, 2), 2), 2048, 0.96 * 0.96, 5e-3);
    for air in [lamp_under(1.0, 0), path_traced(lamp_under(1.0, 0), 0)] {
        assert_eq!(air.value(), 1.0);
    }
}

#[test]
fn gaps_and_overlaps_match_layers() {
    // A gap adds two surfaces between glass and air. An overlap belongs to the later solid.
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let touching = layers(&[1.5, 2.0], 0.0).1;
    let apart = layers(&[1.5, 1.0, 2.0], 0.0).1;
    for gap in [1e-3, 1e-5, 1e-6, 0.0, -1e-8, -1e-7, -1e-6, -1e-3] {
        for later in [0, 1] {
            let top = level.cuboid(v(-500.0, 0.0, -500.0), v(500.0, 1.0, 500.0));
            let bottom = level.cuboid(v(-500.0, -1.0, -500.0), v(500.0, -gap, 500.0));
            let (one, other) = ((top, glass(1.5)), (bottom, glass(2.0)));
            let order = if later == 0 { [other, one] } else { [one, other] };
            let both = order.into_iter().fold(scene(), |build, (shape, glass)| build.shape(shape, glass));
            let both = both.shape(level.square(-3.0, 5000.0), emitter(1.0)).depth(200);
            let both = both.seen(v(0.3, 2.0, 0.2), v(0.3, 0.0, 0.2));
            let exact = if gap > 0.0 { apart } else { touching };
            assert_within(&format!("gap {gap}, {later} later"), &both, 512, exact, 2e-3);
        }
    }
    // For gaps below the rounding error, either result is correct.
    for gap in [1e-7, 3e-8] {
        let top = level.cuboid(v(-500.0, 0.0, -500.0), v(500.0, 1.0, 500.0));
        let bottom = level.cuboid(v(-500.0, -1.0, -500.0), v(500.0, -gap, 500.0));
        let both = scene().shape(top, glass(1.5)).shape(bottom, glass(2.0)).depth(200);
        let both = both.shape(level.square(-3.0, 5000.0), emitter(1.0));
        let (mean, _) = mean_and_error(&both.seen(v(0.3, 2.0, 0.2), v(0.3, 0.0, 0.2)).values(512, 16));
        let off = |exact: f64| (mean - exact).abs() / exact;
        assert!(off(touching).min(off(apart)) < 2e-3, "gap {gap}: {mean}, expected {touching} or {apart}");
    }
}

#[test]
fn random_box_stacks_match_layers() {
    let mut random = TestRandom::new(2026);
    for round in 0..40 {
        let turned = if round % 8 == 0 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        let count = 2 + (random.unit() * 5.0) as usize;
        let own: Vec<(f64, f64)> =
            (0..count).map(|_| (1.0 + 1.5 * random.unit(), 0.1 + random.unit())).collect();
        let mut order: Vec<usize> = (0..count).collect();
        for i in 0..count {
            order.swap(i, i + (random.unit() * (count - i) as f64) as usize);
        }
        let angle = (85.0 * random.unit()).to_radians();
        let bottom = -own.iter().map(|layer| layer.1).sum::<f64>();
        let lamp = turned.square(bottom - 0.5, 5000.0);
        let build = stack(&turned, &own, &order, 300.0).shape(lamp, emitter(1.0)).depth(400);
        let at = v(random.signed(), 0.0, random.signed());
        let build = turned.seen(build, at + v(angle.sin(), angle.cos(), 0.0) * 3.0, at);
        // Round the IORs to single precision.
        let indices: Vec<f64> = own.iter().map(|layer| f64::from(layer.0 as f32)).collect();
        let (_, exact) = layers(&indices, angle.sin());
        let what = format!("round {round}: {own:?}, order {order:?}, {}°", angle.to_degrees());
        assert_within(&what, &build, 512, exact, 2e-3);
    }
}

#[test]
fn drink_in_a_glass_matches_layers() {
    let mut random = TestRandom::new(7);
    for round in 0..6 {
        let turned = if round == 0 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        let bar = |low: f64, high: f64, radius: f64| Shape::Cylinder {
            a: turned.axes * v(0.0, low, 0.0),
            b: turned.axes * v(0.0, high, 0.0),
            radius,
            caps: true,
        };
        // A glass filled to the brim: liquid (IOR 1.33) and glass (IOR 1.5) share the top face. From above, rays go
        // from air into the liquid, the glass, and air.
        let full = scene().shape(bar(0.0, 2.0, 1.0), glass(1.5)).shape(bar(0.2, 2.0, 0.9), glass(1.33));
        let full = full.shape(turned.square(-1.0, 5000.0), emitter(1.0)).depth(200);
        let n = f64::from(1.33_f32);
        let what = format!("full, round {round}");
        let seen = turned.seen(full, v(0.05, 4.0, 0.02), v(0.05, 0.0, 0.02));
        assert_within(&what, &seen, 512, layers(&[n, 1.5], 0.0).1, 2e-3);
        // A hollow glass with air inside, half filled with a drink that touches the wall. The camera looks
        // through the axis from the side.
        let half = scene()
            .shape(bar(0.0, 2.0, 1.0), glass(1.5))
            .shape(bar(0.2, 2.0, 0.9), glass(1.0))
            .shape(bar(0.2, 1.0, 0.9), glass(1.33));
        let corner = turned.axes * v(50.0, -50.0, -50.0);
        let (up, across) = (turned.axes * v(0.0, 100.0, 0.0), turned.axes * v(0.0, 0.0, 100.0));
        let half = half.shape(Shape::Quad { corner, u: across, v: up }, emitter(1.0)).depth(200);
        let side = turned.seen(half.clone(), v(-4.0, 0.6, 0.0), v(0.0, 0.6, 0.0));
        assert_within(&format!("side, round {round}"), &side, 512, layers(&[1.5, n, 1.5], 0.0).1, 2e-3);
        // Above the drink, the glass contains air.
        let above = turned.seen(half, v(-4.0, 1.5, 0.0), v(0.0, 1.5, 0.0));
        assert_within(&format!("above, round {round}"), &above, 512, layers(&[1.5, 1.0, 1.5], 0.0).1, 2e-3);
    }
}

#[test]
fn coincident_and_inscribed_balls_match_layers() {
    let lamp = |build: Build| {
        build.quad(v(-5e3, -3.0, 5e3), v(1e4, 0.0, 0.0), v(0.0, 0.0, -1e4), emitter(1.0)).depth(200)
    };
    let through = |build: Build| lamp(build).seen(v(0.0, 4.0, 0.0), DVec3::ZERO);
    let center = v(0.0, 0.1, 0.0);
    for (one, other) in [(1.5, 1.5), (2.0, 1.5), (1.3, 1.5)] {
        // Of two coincident balls, the later one counts.
        let twice = scene().sphere(center, 1.0, glass(one)).sphere(center, 1.0, glass(other));
        assert_within(&format!("{one} and {other}"), &through(twice), 512, layers(&[1.5], 0.0).1, 2e-3);
        let boxes = scene().cuboid(center, v(2.0, 3.0, 4.0), DVec3::ZERO, glass(one)).cuboid(
            center,
            v(2.0, 3.0, 4.0),
            DVec3::ZERO,
            glass(other),
        );
        assert_within(&format!("boxes {one} and {other}"), &through(boxes), 512, layers(&[1.5], 0.0).1, 2e-3);
    }
    // The ball touches the box from inside on the axis, so only the ball's glass is on the axis.
    let inside =
        scene().cuboid(center, DVec3::splat(2.0), DVec3::ZERO, glass(1.5)).sphere(center, 1.0, glass(2.0));
    assert_within("ball in a box", &through(inside), 512, layers(&[2.0], 0.0).1, 2e-3);
    // A ball on a glass table, viewed through the point of contact.
    let table = scene().cuboid(v(0.0, -1.5, 0.0), v(20.0, 1.0, 20.0), DVec3::ZERO, glass(1.5));
    let on_table = table.sphere(DVec3::ZERO, 1.0, glass(2.0));
    assert_within("on a table", &through(on_table), 512, layers(&[2.0, 1.5], 0.0).1, 2e-3);
}

#[test]
fn touching_meshes_match_layers() {
    let mut random = TestRandom::new(11);
    for round in 0..12 {
        let turned = if round == 0 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        // Aim close to the faces' diagonal.
        let eye = v(0.13, 3.0, -0.08) + v(0.1, 0.0, 0.05) * random.signed();
        let at = eye - v(0.0, 3.0, 0.0);
        let lamp = |build: Build| build.shape(turned.square(-5.0, 5000.0), emitter(1.0)).depth(200);
        let mesh = boxes(&[(v(0.0, -0.5, 0.0), 1.0, 0)]);
        let placed = [DVec3::ONE, turned.degrees, DVec3::ZERO];
        let below = turned.cuboid(v(-0.7, -2.0, -0.7), v(0.7, -1.0, 0.7));
        for later in [false, true] {
            let own = |build: Build| build.mesh(mesh.clone(), placed, glass(1.5));
            let other = |build: Build| build.shape(below.clone(), glass(2.0));
            let both = if later { own(other(scene())) } else { other(own(scene())) };
            let seen = turned.seen(lamp(both), eye, at);
            let what = format!("mesh on a box, round {round}, {later}");
            assert_within(&what, &seen, 128, layers(&[1.5, 2.0], 0.0).1, 2e-3);
        }
        // Two parts of a mesh with different glass share a face with different triangulations.
        let parts = boxes(&[(v(0.0, -0.5, 0.0), 1.0, 0), (v(0.2, -1.75, 0.1), 1.5, 1)]);
        let turn = |mut mesh: glimt::geometry::mesh::TriangleMesh| {
            for p in &mut mesh.positions {
                *p = (turned.axes * p.as_dvec3()).as_vec3();
            }
            mesh
        };
        let parts = scene().own_mesh(turn(parts), vec![file_material(9, 1.5), file_material(9, 2.0)]);
        let seen = turned.seen(lamp(parts), eye, at);
        assert_within(&format!("parts, round {round}"), &seen, 128, layers(&[1.5, 2.0], 0.0).1, 2e-3);
        // There is no surface between parts with the same glass.
        let same = boxes(&[(v(0.0, -0.5, 0.0), 1.0, 0), (v(0.2, -1.75, 0.1), 1.5, 0)]);
        let same = scene().mesh(turn(same), IDENTITY_PLACEMENT, glass(1.5));
        let seen = turned.seen(lamp(same), eye, at);
        assert_within(&format!("same glass, round {round}"), &seen, 128, layers(&[1.5], 0.0).1, 2e-3);
    }
}

#[test]
fn glass_on_an_opaque_surface_is_exact() {
    let mut random = TestRandom::new(5);
    let r = fresnel(1.0, 1.5, 0.0);
    for round in 0..12 {
        let turned = if round < 2 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        let block = (turned.cuboid(v(-1.0, 0.0, -1.0), v(1.0, 1.0, 1.0)), glass(1.5));
        let stood = |floor: glimt::scene::description::Material, first: bool| {
            let floor = (turned.square(0.0, 50.0), floor);
            let order = if first { [floor, block.clone()] } else { [block.clone(), floor] };
            let build = order.into_iter().fold(scene(), |build, (shape, own)| build.shape(shape, own));
            turned.seen(build.depth(200), v(0.2, 4.0, 0.1), v(0.2, 0.0, 0.1))
        };
        for first in [false, true] {
            let what = |of: &str| format!("{of}, round {round}, floor first: {first}");
            // Only transmission through the upper face contributes. The floor absorbs the light that this
            // face reflects.
            assert_within(&what("lamp"), &stood(emitter(1.0), first), 16, 1.0 - r, 1e-4);
            // r + (1 − r)²·m·Σ(m·r)ᵏ.
            let mirrored = stood(mirror(0.5), first).background(1.0);
            let exact = r + (1.0 - r).powi(2) * 0.5 / (1.0 - 0.5 * r);
            assert_within(&what("mirror"), &mirrored, 512, exact, 2e-3);
            assert_within(&what("lossless"), &stood(mirror(1.0), first).background(1.0), 512, 1.0, 1e-3);
            // From below, the camera sees only the back of the floor, which does not emit.
            let below = turned.seen(stood(emitter(1.0), first), v(0.2, -4.0, 0.1), v(0.2, 0.0, 0.1));
            assert_eq!(below.background(1.0).value(), 0.0, "{}", what("from below"));
        }
    }
}

#[test]
fn tints_apply_within_their_glass() {
    // Straight down through thickness 1 of one tint and 2 of another. Their IORs are equal, so the surface
    // between them does not reflect.
    let tinted = |tint: f64| scenes::tinted(1.5, DVec3::splat(tint));
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let r = fresnel(1.0, 1.5, 0.0);
    for first in [false, true] {
        let top = (level.cuboid(v(-9.0, 0.0, -9.0), v(9.0, 1.0, 9.0)), tinted(0.5));
        let bottom = (level.cuboid(v(-9.0, -2.0, -9.0), v(9.0, 0.0, 9.0)), tinted(0.8));
        let order = if first { [top, bottom] } else { [bottom, top] };
        let build = order.into_iter().fold(scene(), |build, (shape, own)| build.shape(shape, own));
        let build = build.shape(level.square(-3.0, 5000.0), emitter(1.0)).depth(3);
        let seen = build.seen(v(0.3, 2.0, 0.2), v(0.3, 0.0, 0.2));
        let passed = f64::from(Dielectric::new(1.5, DVec3::splat(0.8)).interior_transmittance(2.0).x) * 0.5;
        assert_close("straight through", seen.value(), (1.0 - r).powi(2) * passed);
    }
}

#[test]
fn later_glass_determines_overlaps() {
    // One solid extends from y = 0 to 2, the other from −1 to 1. Between 0 and 1, the later solid counts.
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let tinted = |ior: f32, tint: f64| scenes::tinted(ior, DVec3::splat(tint));
    for (order, exact) in [([0, 1], 0.5 * 0.8 * 0.8), ([1, 0], 0.5 * 0.5 * 0.8)] {
        let own = [
            (level.cuboid(v(-9.0, 0.0, -9.0), v(9.0, 2.0, 9.0)), tinted(1.0, 0.5)),
            (level.cuboid(v(-9.0, -1.0, -9.0), v(9.0, 1.0, 9.0)), tinted(1.0, 0.8)),
        ];
        let own = order.map(|i: usize| own[i].clone());
        let build = own.into_iter().fold(scene(), |build, (shape, own)| build.shape(shape, own));
        let build = build.shape(level.square(-3.0, 5000.0), emitter(1.0)).depth(4);
        assert_close("overlap", build.seen(v(0.3, 3.0, 0.2), v(0.3, 0.0, 0.2)).value(), exact);
    }
    let mut random = TestRandom::new(3);
    for round in 0..10 {
        let turned = SceneRotation::random(&mut random);
        let boxes = [
            (turned.cuboid(v(-90.0, 0.0, -90.0), v(90.0, 2.0, 90.0)), 1.4),
            (turned.cuboid(v(-90.0, -1.0, -90.0), v(90.0, 1.0, 90.0)), 1.9),
        ];
        let order = if round % 2 == 0 { [0, 1] } else { [1, 0] };
        let build = order
            .into_iter()
            .fold(scene(), |build, i: usize| build.shape(boxes[i].0.clone(), glass(boxes[i].1)));
        let build = build.shape(turned.square(-3.0, 5000.0), emitter(1.0)).depth(200);
        let angle = (70.0 * random.unit()).to_radians();
        let seen = turned.seen(build, v(angle.sin(), angle.cos(), 0.0) * 5.0, DVec3::ZERO);
        let (a, b) = (f64::from(1.4_f32), f64::from(1.9_f32));
        assert_within(&format!("round {round}"), &seen, 512, layers(&[a, b], angle.sin()).1, 2e-3);
    }
}

#[test]
fn camera_inside_glass_finds_its_medium() {
    let level = SceneRotation::from_degrees(DVec3::ZERO);
    let r = fresnel(1.5, 2.0, 0.0);
    for first in [false, true] {
        let top = (level.cuboid(v(-500.0, 0.0, -500.0), v(500.0, 1.0, 500.0)), glass(1.5));
        let bottom = (level.cuboid(v(-500.0, -1.0, -500.0), v(500.0, 0.0, 500.0)), glass(2.0));
        let order = if first { [top, bottom] } else { [bottom, top] };
        let build = order.into_iter().fold(scene(), |build, (shape, own)| build.shape(shape, own));
        let build = build.shape(level.square(-3.0, 5000.0), emitter(1.0)).depth(2);
        let seen = build.seen(v(0.3, 0.5, 0.2), v(0.3, 0.0, 0.2));
        assert_close("within", seen.value(), (1.0 - r) * (1.0 - fresnel(2.0, 1.0, 0.0)));
    }
}

#[test]
fn nested_glass_is_invisible_in_a_furnace() {
    let mut random = TestRandom::new(99);
    for round in 0..6 {
        let turned = if round == 0 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        let mut things = vec![
            turned.cuboid(v(-1.0, -1.0, -1.0), v(1.0, 0.0, 1.0)),
            turned.cuboid(v(-1.0, 0.0, -1.0), v(0.0, 1.0, 1.0)),
            turned.cuboid(v(0.0, 0.0, -1.0), v(1.0, 1.0, 0.5)),
            turned.cuboid(v(-0.5, -0.5, -1.0), v(0.5, 0.5, 1.0)),
            turned.cuboid(v(-1.0, -1.0, 1.0), v(1.0, 1.0, 1.3)),
            Shape::Sphere { center: turned.axes * v(0.0, 1.5, 0.0), radius: 0.5 },
            Shape::Sphere { center: turned.axes * v(0.0, 1.5, 0.0), radius: 0.5 },
            Shape::Cylinder {
                a: turned.axes * v(0.0, -1.0, 0.0),
                b: turned.axes * v(0.0, 1.0, 0.0),
                radius: 0.4,
                caps: true,
            },
        ];
        for i in 0..things.len() {
            let other = i + (random.unit() * (things.len() - i) as f64) as usize;
            things.swap(i, other);
        }
        let build = things
            .into_iter()
            .fold(scene(), |build, shape| build.shape(shape, glass((1.0 + 1.4 * random.unit()) as f32)));
        let seen = build.background(1.0).depth(3000);
        for (i, &pixel) in seen
            .pictured(turned.axes * v(1.0, 3.0, 6.0), DVec3::ZERO, 40.0, 12, 9)
            .picture(16, 1)
            .iter()
            .enumerate()
        {
            assert!((pixel.x - 1.0).abs() < 0.03, "round {round}, pixel {i}: {pixel}");
        }
    }
}

#[test]
fn ambient_light_is_uniform_in_and_under_glass() {
    // Lossless glass on a white floor under ambient light 1 with a white background. The radiance is 1
    // everywhere, inside and outside the glass.
    let mut random = TestRandom::new(17);
    for round in 0..6 {
        let turned = if round == 0 {
            SceneRotation::from_degrees(DVec3::ZERO)
        } else {
            SceneRotation::random(&mut random)
        };
        let build = scene()
            .shape(turned.square(0.0, 50.0), matte(1.0))
            .shape(turned.cuboid(v(-1.0, 0.0, -1.0), v(1.0, 1.0, 1.0)), glass(1.5))
            .shape(turned.cuboid(v(-1.0, 1.0, -1.0), v(1.0, 1.5, 1.0)), glass(2.0))
            .shape(Shape::Sphere { center: turned.axes * v(0.0, 0.5, 0.0), radius: 0.2 }, matte(1.0))
            .with(|scene| scene.render.ambient = Vec3::ONE)
            .background(1.0)
            .depth(1000);
        for (from, at) in [
            (v(0.3, 5.0, 0.2), v(0.3, 0.0, 0.2)),
            (v(3.0, 2.0, 1.0), v(0.0, 0.5, 0.0)),
            (v(0.9, 0.5, 0.6), v(0.0, 0.5, 0.0)),
            (v(0.9, 0.5, 0.6), v(0.5, 0.0, 0.0)),
        ] {
            let (mean, error) = mean_and_error(&turned.seen(build.clone(), from, at).values(16, 16));
            assert!((mean - 1.0).abs() < 1e-3, "round {round}, from {from} at {at}: {mean} ± {error}");
        }
    }
}

/// A box mesh whose corners are exactly as specified.
pub fn block(low: DVec3, high: DVec3) -> TriangleMesh {
    let mut mesh = boxes(&[(DVec3::ZERO, 2.0, 0)]);
    for p in &mut mesh.positions {
        let is_high = p.cmpgt(Vec3::ZERO);
        *p = Vec3::select(is_high, high.as_vec3(), low.as_vec3());
    }
    mesh
}

/// Checks that a white furnace has value 1 everywhere.
#[track_caller]
pub fn assert_white(what: &str, build: Build) {
    let seen = build.background(1.0).depth(1000).pictured(v(2.2, 1.7, 4.5), DVec3::ZERO, 40.0, 32, 24);
    for (i, pixel) in seen.picture(8, 1).into_iter().enumerate() {
        assert!((pixel.x - 1.0).abs() <= 1e-5, "{what}, pixel {i}: {pixel}");
    }
}

#[test]
fn mesh_faces_touch_in_coordinate_planes() {
    let one = DVec3::ONE;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        // Boxes from −1 to 0 and from 0 to 1 along the axis.
        let (below, above) = (
            (-one * 0.5 - axis * 0.5, one * 0.5 - axis * 0.5),
            (axis * 0.5 - one * 0.5, axis * 0.5 + one * 0.5),
        );
        let analytic = |(low, high): (DVec3, DVec3)| Shape::Box {
            center: (low + high) * 0.5,
            size: high - low,
            rotate: DVec3::ZERO,
        };
        let mesh = |build: Build, (low, high), own| build.mesh(block(low, high), IDENTITY_PLACEMENT, own);
        let what = |of: &str| format!("{of}, normal {axis}");
        let through = (
            v(-0.45, -0.25, 0.25) * (one - axis) - axis * 0.3,
            v(0.25, 0.25, 0.75) * (one - axis) + axis * 0.4,
        );
        let mirrored = mesh(scene().shape(analytic(through), glass(1.33)), below, mirror(1.0));
        assert_white(&what("a mirror in glass"), mirrored);
        let meshes = mesh(mesh(scene(), below, glass(1.5)), above, glass(1.33));
        assert_white(&what("two meshes"), meshes);
        let pair = mesh(scene().shape(analytic(below), glass(1.5)), above, glass(1.33));
        assert_white(&what("a box and a mesh"), pair);
    }
    // Eight solids meet at the origin, where rays that self-intersect would never terminate.
    let eight = (0..8_u32).fold(scene(), |build, i| {
        let low = v(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) - one;
        build.mesh(block(low, low + one), IDENTITY_PLACEMENT, glass([1.5, 1.33, 2.4][i as usize % 3]))
    });
    assert_white("eight meshes", eight);
}
