//! Glass: Fresnel reflectance and Snell's law in slabs, prisms and balls, absorption, and nesting.

use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::geometry::ray::offset_origin;
use glimt::materials::fresnel::{fresnel_dielectric, refract_given_transmitted_cosine};
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{EmissionSource, Material, MeshReference, Shape};
use glimt::world::Geometry;

use super::global::path_traced;
use super::scenes::{
    Build, IDENTITY_PLACEMENT, emitter, file_material, glass, lat_long_sphere, receiver, scene, tinted,
};
use super::{assert_close, assert_mean, v};

/// Direction of a downward ray at an angle to the vertical.
fn tilted(degrees: f64) -> DVec3 {
    v(degrees.to_radians().sin(), -degrees.to_radians().cos(), 0.0)
}

/// A slab of thickness 1 between y = −1 and 0, entered at the origin.
fn slab(degrees: f64, material: Material) -> Build {
    scene()
        .cuboid(v(0.0, -0.5, 0.0), v(1000.0, 1.0, 1000.0), DVec3::ZERO, material)
        .seen(-tilted(degrees) * 2.0, DVec3::ZERO)
}

/// Uniform light from below.
fn lit_from_below(build: Build) -> Build {
    build.quad(v(-1e4, -2.0, 1e4), v(2e4, 0.0, 0.0), v(0.0, 0.0, -2e4), emitter(1.0))
}

/// Unpolarized reflectance at n = 1.5 from Fresnel's sine and tangent laws.
fn reflectance(degrees: f64) -> f64 {
    let i = degrees.to_radians();
    let t = (i.sin() / 1.5).asin();
    if i == 0.0 {
        return 0.04;
    }
    (((i - t).sin() / (i + t).sin()).powi(2) + ((i - t).tan() / (i + t).tan()).powi(2)) / 2.0
}

#[test]
fn slab_includes_all_internal_reflections() {
    // T = (1 − R)²·Σ R²ⁱ = (1 − R)/(1 + R).
    for (degrees, exact) in
        [(0.0, 0.923_076_923_1), (45.0, 0.904_326_79), (60.0, 0.836_232_46), (80.0, 0.441_229_17)]
    {
        let r = reflectance(degrees);
        assert_close("the formula", (1.0 - r) / (1.0 + r), exact);
        let values = lit_from_below(slab(degrees, glass(1.5))).depth(100).values(64, 64);
        assert_mean(&format!("{degrees}°"), &values, (1.0 - r) / (1.0 + r), 3e-4);
    }
}

#[test]
fn slab_terms_are_powers_of_reflectance() {
    // At depth 2, light passes straight through: (1 − R)². At depth 1, no light arrives from below, and the
    // sky above is visible only by reflection: R.
    for degrees in [0.0, 45.0, 60.0] {
        let r = reflectance(degrees);
        let through = lit_from_below(slab(degrees, glass(1.5)));
        assert_eq!(through.clone().depth(1).value(), 0.0);
        assert_close("through", through.depth(2).value(), (1.0 - r).powi(2));
        let sky = slab(degrees, glass(1.5)).quad(
            v(-1e4, 9.0, -1e4),
            v(2e4, 0.0, 0.0),
            v(0.0, 0.0, 2e4),
            emitter(1.0),
        );
        assert_close("reflected", sky.depth(1).value(), r);
    }
}

#[test]
fn slab_shifts_rays_laterally() {
    // The shift is t·sin θ·(1 − cos θ/√(n² − sin²θ)). It determines where the edge of a light below becomes
    // visible straight through the slab.
    for (degrees, exact) in [(45.0, 0.329_142_31), (60.0, 0.512_472_01), (80.0, 0.833_663_85)] {
        let seen = |edge: f64| {
            let half = v(1e4, 0.0, 0.0);
            let build = slab(degrees, glass(1.5)).depth(2);
            build.quad(v(edge, -2.0, 1e4), half, v(0.0, 0.0, -2e4), emitter(1.0)).value() > 0.0
        };
        let straight = 2.0 * f64::tan(degrees.to_radians());
        let (mut low, mut high) = (straight - 10.0, straight);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if seen(middle) { low = middle } else { high = middle }
        }
        assert_close(&format!("{degrees}°"), (straight - low) * degrees.to_radians().cos(), exact);
    }
}

/// Traces a ray through glass with n = 1.5 until it leaves. `None` for total internal reflection.
fn exit_ray(geometry: &Geometry, mut ray: Ray) -> Option<Ray> {
    while let Some(hit) = geometry.closest_hit(&ray) {
        let surface = geometry.surface(&ray, &hit);
        let entering = surface.normal.dot(ray.direction) < 0.0;
        let (normal, eta) = if entering { (surface.normal, 1.5) } else { (-surface.normal, 1.0 / 1.5) };
        let (_, cosine) = fresnel_dielectric(-normal.dot(ray.direction), eta);
        let direction = refract_given_transmitted_cosine(ray.direction, normal, eta, cosine?);
        ray = Ray::new(offset_origin(surface.point, surface.error, surface.normal, direction), direction);
    }
    Some(ray)
}

#[test]
fn prism_has_analytic_minimum_deviation() {
    // 2·asin(n·sin 30°) − 60° = 37.180756° for the symmetric path.
    let mut mesh = TriangleMesh::default();
    for z in [-10.0, 10.0] {
        for degrees in [90.0_f64, 210.0, 330.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            mesh.positions.push(v(cos, sin, z).as_vec3());
        }
    }
    for [a, b] in [[0, 1], [1, 2], [2, 0]] {
        mesh.triangles.extend([[a, b, b + 3], [a, b + 3, a + 3]]);
    }
    let world = scene().mesh(mesh, IDENTITY_PLACEMENT, glass(1.5)).world();
    // Toward the left face, whose normal is 150° from +x.
    let deviation = |incidence: f64| {
        let heading = (incidence - 30.0).to_radians();
        let direction = v(heading.cos(), heading.sin(), 0.0);
        let target = v(-3.0_f64.sqrt() / 4.0, 0.25, 0.1);
        let out = exit_ray(&world.geometry, Ray::new((target - direction).as_vec3(), direction.as_vec3()));
        out.map_or(f64::INFINITY, |ray| {
            let out = ray.direction.as_dvec3();
            out.cross(direction).length().atan2(out.dot(direction)).to_degrees()
        })
    };
    let angles = (300..900).map(|tenths| deviation(f64::from(tenths) / 10.0));
    let least = angles.fold(f64::INFINITY, f64::min).min(deviation(0.75_f64.asin().to_degrees()));
    assert_close("least deviation", least, 37.180_756);
}

#[test]
fn ball_lens_focuses_paraxial_rays() {
    // With sin θ = h and sin θ' = h/n, the ray is deflected by 2(θ − θ') and meets the axis at distance
    // h/sin(2(θ − θ')) from the center.
    let world = scene().sphere(DVec3::ZERO, 1.0, glass(1.5)).world();
    for (h, exact) in [(1e-3_f64, 1.5), (0.5, 1.391_572_9), (0.9, 1.104_445_6)] {
        let formula = h / (2.0 * (h.asin() - (h / 1.5).asin())).sin();
        assert_close("the formula", formula, exact);
        let start = Vec3::new(h as f32, 0.0, 3.0);
        let out =
            exit_ray(&world.geometry, Ray::new(start, Vec3::NEG_Z)).expect("no total internal reflection");
        let (o, d) = (out.origin.as_dvec3(), out.direction.as_dvec3());
        assert_close(&format!("h = {h}"), -(o.z - d.z * o.x / d.x), formula);
    }
}

#[test]
fn lossless_glass_under_a_sky_is_invisible() {
    // Radiance/n² is conserved, reflection and refraction are lossless, and every path ends in the sky, so
    // every pixel is exactly 1.
    let ball = lat_long_sphere(8, 10, 1.0, v(0.0, -2.2, -6.0));
    let seen = scene()
        .sphere(v(-1.2, 0.0, -5.0), 1.0, glass(1.5))
        .sphere(v(1.2, 0.0, -5.0), 1.0, glass(2.4))
        .sphere(v(1.2, 0.0, -5.0), 0.6, glass(1.0))
        .cuboid(v(0.0, 2.0, -5.0), v(1.5, 1.0, 1.0), v(10.0, 20.0, 30.0), glass(1.33))
        .mesh(ball, IDENTITY_PLACEMENT, glass(1.5))
        .background(1.0)
        .depth(2000);
    for target in [
        v(-1.2, 0.0, -5.0),
        v(-0.5, 0.2, -5.0),
        v(-0.25, 0.1, -5.0),
        v(1.2, 0.0, -5.0),
        v(1.5, -0.7, -5.0),
        v(0.1, 2.1, -5.0),
        v(0.3, -2.0, -6.0),
    ] {
        let values = seen.clone().seen(v(0.1, 0.05, 0.2), target).values(32, 32);
        assert_mean(&format!("towards {target}"), &values, 1.0, 1e-6);
    }
}

#[test]
fn white_furnace_from_inside_a_ball() {
    // Russian roulette preserves the total weight of internal reflections, so the result is 1, however weak
    // they are.
    for ior in [1.1, 1.5, 2.4] {
        let ball = scene().sphere(DVec3::ZERO, 1.0, glass(ior)).background(1.0).depth(300);
        let seen = ball.pictured(v(0.0, 0.0, 1e-3), v(0.0, 0.0, -1.0), 2.0, 8, 8).picture(1024, 1);
        let mean = seen.iter().map(|pixel| pixel.x).sum::<f64>() / seen.len() as f64;
        assert!((mean - 1.0).abs() < 2e-4, "n = {ior}: {mean}");
    }
}

#[test]
fn slab_and_ball_absorption_is_exact() {
    // Straight through thickness d with tint a: (1 − R)²·aᵈ, R = 0.04. With all reflections: (1 − R)²aᵈ/(1 −
    // R²a²ᵈ).
    let tint = DVec3::new(0.5, 0.9, 0.25);
    let green = tinted(1.5, tint);
    let ball = scene().sphere(v(0.0, -0.75, 0.0), 0.75, green.clone()).seen(v(0.0, 2.0, 0.0), DVec3::ZERO);
    for (build, d) in [(slab(0.0, green), 1.0), (ball, 1.5)] {
        let lit = lit_from_below(build);
        let straight = lit.clone().depth(2).color();
        let all: Vec<DVec3> = lit.depth(60).pictures(16, 0..64).iter().map(|picture| picture[0]).collect();
        for channel in 0..3 {
            let a = tint[channel].powf(d);
            assert_close("straight through", straight[channel], 0.96 * 0.96 * a);
            let all: Vec<f64> = all.iter().map(|color| color[channel]).collect();
            assert_mean("all", &all, 0.96 * 0.96 * a / (1.0 - 0.0016 * a * a), 2.5e-4);
        }
    }
    // Through a ball at angle θ, the chord is 2R·cos θ' and T = (1 − R(θ))²·a^chord.
    let h = 0.7_f64;
    let ball = scene()
        .sphere(DVec3::ZERO, 1.0, tinted(1.5, tint))
        .background(1.0)
        .depth(2)
        .seen(v(h, 3.0, 0.0), v(h, 0.0, 0.0));
    let r = reflectance(h.asin().to_degrees());
    let chord = 2.0 * (1.0 - (h / 1.5).powi(2)).sqrt();
    for channel in 0..3 {
        // At depth 2, the sky is visible only by reflection and straight through.
        let exact = r + (1.0 - r).powi(2) * tint[channel].powf(chord);
        assert_close("chord", ball.color()[channel], exact);
    }
}

#[test]
fn glass_with_surrounding_ior_is_invisible() {
    // Without a change in n, there is no reflection or refraction, so the ball changes no pixel, even at its
    // rim.
    let behind = |build: Build| {
        (0..10).fold(build.background(0.1), |build, i| {
            let x = f64::from(i) * 0.4 - 2.0;
            build.quad(v(x, -3.0, -8.0), v(0.2, 0.0, 0.0), v(0.0, 6.0, 0.0), emitter(1.0 + i as f32))
        })
    };
    let plain = behind(scene());
    let ball = behind(scene().sphere(v(0.0, 0.0, -5.0), 1.0, glass(1.0)));
    let mut random = TestRandom::new(5);
    for i in 0..3000 {
        // Rays near the rim, passing the center of the ball at distances 1 − 10⁻¹ … 1 − 10⁻⁷.
        let rim = 1.0 / (1.0 - 1.0 / 25.0_f64).sqrt();
        let r = rim * (1.0 - 10.0_f64.powf(-1.0 - 6.0 * random.unit()));
        let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
        let target = v(r * cos, r * sin, -5.0);
        let look = |build: &Build| build.clone().depth(2).seen(DVec3::ZERO, target).value();
        assert_eq!(look(&ball), look(&plain), "towards {target}");
    }
}

#[test]
fn nested_glass_transmits_exactly() {
    // In a slab with n = 1.5, a ball with the same n has no effect. At depth 4, the path through both
    // transmits (1 − R)².
    let r = reflectance(30.0);
    let inside = slab(30.0, glass(1.5)).sphere(v(0.2, -0.5, 0.05), 0.3, glass(1.5));
    assert_close("equal", lit_from_below(inside).depth(4).value(), (1.0 - r).powi(2));
    // A ball of air on the axis, with four surfaces at normal incidence: (1 − 0.04)⁴.
    let bubble = slab(0.0, glass(1.5)).sphere(v(0.0, -0.5, 0.0), 0.25, glass(1.0));
    assert_close("bubble", lit_from_below(bubble).depth(4).value(), 0.96_f64.powi(4));
    // A ball with n = 2 in the slab. The reflectance of the inner surfaces is ((2 − 1.5)/(2 + 1.5))².
    let dense = slab(0.0, glass(1.5)).sphere(v(0.0, -0.5, 0.0), 0.25, glass(2.0));
    let inner = 1.0 - 1.0 / 49.0;
    assert_mean(
        "dense",
        &lit_from_below(dense).depth(4).values(64, 64),
        (0.96 * inner) * (0.96 * inner),
        1e-6,
    );
    // From inside the slab, only one surface remains. Radiance is basic radiance, L/n².
    let within = slab(0.0, glass(1.5)).seen(v(0.0, -0.5, 0.0), v(0.0, -1.0, 0.0));
    assert_close("from within", lit_from_below(within).depth(1).value(), 0.96);
}

/// A mesh of outward-facing cubes, each specified as (center, edge length, material).
pub fn boxes(parts: &[(DVec3, f64, u32)]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for &(center, edge, material) in parts {
        let first = mesh.positions.len() as u32;
        for corner in 0..8_u32 {
            let side = |axis: u32| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
            mesh.positions.push((center + v(side(0), side(1), side(2)) * edge).as_vec3());
        }
        for axis in 0..3 {
            let (u, w) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
            let far = first + (1 << axis);
            mesh.triangles.extend([[first, first + w, first + u + w], [first, first + u + w, first + u]]);
            mesh.triangles.extend([[far, far + u, far + u + w], [far, far + u + w, far + w]]);
        }
        mesh.materials.resize(mesh.triangles.len(), material);
    }
    mesh
}

#[test]
fn mesh_parts_have_their_own_glass() {
    // Straight through a slab, T = (1 − R)² with R = ((n − 1)/(n + 1))². The first triangles have a different
    // material.
    let passed = |n: f64| (1.0 - ((n - 1.0) / (n + 1.0)).powi(2)).powi(2);
    let look = |build: &Build, x: f64| {
        let through = build.clone().seen(v(x, 3.0, 0.1), v(x, 0.0, 0.1));
        lit_from_below(through).depth(2).value()
    };
    let mesh = boxes(&[(v(-2.0, 0.0, 0.0), 1.0, 0), (v(0.0, 0.0, 0.0), 1.0, 1), (v(2.0, 0.0, 0.0), 1.0, 2)]);
    let opaque_first = [file_material(2, 1.0), file_material(9, 1.5), file_material(9, 2.0)];
    let other_first = [file_material(9, 1.4), file_material(9, 1.5), file_material(9, 2.0)];
    let opaque_first = scene().own_mesh(mesh.clone(), opaque_first.to_vec());
    let other_first = scene().own_mesh(mesh, other_first.to_vec());
    assert_eq!(look(&opaque_first, -1.9), 0.0);
    assert_close("n = 1.4", look(&other_first, -1.9), passed(1.4));
    for build in [opaque_first, other_first] {
        assert_close("n = 1.5", look(&build, 0.1), passed(1.5));
        assert_close("n = 2", look(&build, 2.1), passed(2.0));
    }
}

#[test]
fn mesh_parts_can_be_nested() {
    // Four surfaces on the axis of a single object: R = 0.04 between air and 1.5, and R = 1/49 between 1.5
    // and 2.
    let mesh = boxes(&[(v(0.0, 0.0, 0.0), 1.0, 0), (v(0.0, 0.0, 0.0), 0.5, 1)]);
    let nested = scene().own_mesh(mesh, vec![file_material(9, 1.5), file_material(9, 2.0)]);
    let straight = lit_from_below(nested.seen(v(0.05, 3.0, 0.1), v(0.05, 0.0, 0.1))).depth(4);
    let exact = (0.96 * (1.0 - 1.0 / 49.0_f64)).powi(2);
    assert_mean("nested", &straight.values(64, 64), exact, 1e-6);
}

#[test]
fn shading_normals_create_no_light() {
    // Reflection and refraction split radiance/n² without loss, and a random choice between them preserves
    // its expectation. Each path sees the sky at most once, so the value is at most 1, even inside glass.
    // A ray that is refracted outward with respect to the shading normal but does not cross the facet must
    // not count as outside.
    let mut ball = lat_long_sphere(8, 10, 1.0, DVec3::ZERO);
    ball.normals = ball.positions.iter().map(|p| p.normalize()).collect();
    let seen = scene().mesh(ball, IDENTITY_PLACEMENT, glass(1.5)).background(1.0).depth(50).with(|scene| {
        if let Shape::Mesh(MeshReference { smooth, .. }) = &mut scene.objects[0].shape {
            *smooth = true;
        }
    });
    let geometry = seen.world().geometry;
    let mut random = TestRandom::new(77);
    let mut along = 0;
    for _ in 0..30_000 {
        let eye = (random.direction() * 0.85).as_vec3();
        let direction = random.direction().as_vec3();
        let ray = Ray::new(eye, direction);
        let hit = geometry.closest_hit(&ray).expect("inside a closed mesh");
        let surface = geometry.surface(&ray, &hit);
        let (_, cosine) = fresnel_dielectric(surface.shading_normal.dot(direction), 1.0 / 1.5);
        let refracted = cosine
            .map(|c| refract_given_transmitted_cosine(direction, -surface.shading_normal, 1.0 / 1.5, c));
        if refracted.is_none_or(|refracted| refracted.dot(surface.normal) > 0.0) {
            continue;
        }
        along += 1;
        let value = seen.clone().seen(eye.as_dvec3(), (eye + direction).as_dvec3()).value();
        assert!(value <= 1.0 + 1e-5, "from {eye} in direction {direction}: {value}");
    }
    assert!(along > 50, "{along}");
}

/// Glass that does not refract still shows its emission, and lights a floor alike in all techniques.
#[test]
fn glass_without_refraction_emits() {
    let lamp = || Material { emission: EmissionSource::from_constant(Vec3::splat(2.0)), ..glass(1.0) };
    let ball = scene().sphere(v(0.0, 0.0, -4.0), 1.0, lamp());
    for build in [ball.clone(), path_traced(ball, 3)] {
        assert_close("a ball", build.value(), 2.0);
    }
    let (at, radius) = (v(0.0, 2.0, 0.0), 0.5);
    let lit = receiver(DVec3::ZERO, 0.5).sphere(at, radius, lamp()).depth(2);
    // The irradiance from a sphere of radiance L straight above is πL·(r/d)².
    let exact = 0.5 * 2.0 * (radius / at.y).powi(2);
    for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit, 2))] {
        assert_mean(what, &build.values(1024, 16), exact, 5e-3);
    }
}
