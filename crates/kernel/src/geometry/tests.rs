use super::*;
use crate::math::DVec4;

/// Shapes of each kind, before and after a transform that mirrors them.
fn shapes() -> Vec<Shape> {
    let plain = untransformed_shapes();
    let mirrored = plain.clone().map(|shape| transformed::tests::sheared(shape, -1.0));
    plain.into_iter().chain(mirrored).collect()
}

/// The shape before its transform, and whether it has a transform.
fn untransformed(shape: &Shape) -> (&Shape, bool) {
    if let Shape::Transformed(own) = shape { (&own.shape, true) } else { (shape, false) }
}

fn untransformed_shapes() -> [Shape; 11] {
    let (p, q) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.0, 0.5, -0.4));
    [
        Shape::Sphere(Sphere { center: p, radius: 0.7 }),
        Shape::Quad(Parallelogram::new(p, DVec3::X, q)),
        Shape::Box(OrientedBox::new(p, DVec3::new(1.0, 0.4, 2.0), DVec3::new(10.0, 70.0, -30.0))),
        Shape::Triangle(Triangle { a: p, b: q, c: DVec3::Y }),
        Shape::Disk(Disk::new(p, q, 0.6)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, true)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, false)),
        Shape::Cone(Cone::new(p, q, 0.4, true)),
        Shape::Cone(Cone::new(p, q, 0.4, false)),
        Shape::Torus(Torus::new(p, q, 1.0, 0.4)),
        Shape::Plane(Plane::new(p, q)),
    ]
}

const SIDE: u32 = 400;

/// A regular grid over the unit square.
fn grid(side: u32) -> impl Iterator<Item = Vec2> {
    (0..side * side).map(move |i| Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5) / side as f32)
}

/// Integrates several functions over the surface.
fn integrals(shape: &Shape, functions: impl Fn(&SurfaceSample) -> DVec4) -> DVec4 {
    let side = 100;
    let over_part = |(part, area): (u32, f64)| {
        let values =
            |place: SurfaceSample| functions(&place) * shape.area_scale_for_world_normal(place.normal);
        let sum: DVec4 = grid(side).map(|u| values(shape.sample_point_on_part(part, u))).sum();
        sum * area / f64::from(side * side)
    };
    (0..).zip(shape.local_part_areas()).map(over_part).sum()
}

/// Hits of rays aimed at the shape from a surrounding sphere.
fn hits(shape: &Shape) -> impl Iterator<Item = (RayF64, ShapeHit)> + '_ {
    (0..4000).filter_map(move |i| {
        let around = Shape::Sphere(Sphere { center: shape.centroid(), radius: 5.0 });
        let u = |i: u32| Vec2::new(i as f32 * 0.618_034 % 1.0, i as f32 * 0.754_877_7 % 1.0);
        let from = around.sample_point_on_part(0, u(i)).point;
        let near = Shape::Sphere(Sphere { center: shape.centroid(), radius: 0.8 });
        let to = near.sample_point_on_part(0, u(3 * i + 7)).point;
        let ray = Ray::new(from.as_vec3(), (to - from).as_vec3()).to_f64();
        shape.intersect(&ray).map(|hit| (ray, hit))
    })
}

#[test]
fn sampled_points_are_on_the_shape() {
    for shape in shapes() {
        for (part, _) in (0_u32..).zip(shape.local_part_areas()).filter(|(_, area)| *area > 0.0) {
            for i in 0..200_u32 {
                let u = Vec2::new((i as f32 + 0.5) * 0.618_034 % 1.0, (i as f32 + 0.5) / 200.0);
                let place = shape.sample_point_on_part(part, u);
                assert!((place.normal.length() - 1.0).abs() < 1e-9, "{shape:?}");
                let from = place.point + place.normal * 0.01;
                let ray = Ray::new(from.as_vec3(), -place.normal.as_vec3()).to_f64();
                let hit = shape.intersect(&ray).unwrap_or_else(|| panic!("{shape:?} {part} {u}"));
                assert!((hit.t - 0.01).abs() < 1e-5, "{shape:?} {part} {u}: {hit:?}");
                assert_eq!(hit.primitive, part, "{shape:?} {u}");
                let normal = shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3();
                assert!((normal - place.normal).length() < 1e-4, "{shape:?} {u}: {normal}");
            }
        }
    }
}

#[test]
fn surfaces_match_with_and_without_uvs() {
    for shape in shapes() {
        for (ray, hit) in hits(&shape).take(1000) {
            let [bare, full] = [false, true].map(|uv| {
                shape.surface_point_with_fields(&ray, &hit, SurfaceRequest { uv, shadow_point: true })
            });
            let parts =
                |of: &SurfacePoint| [of.point, of.error, of.normal, of.shadow_point, of.shading_normal];
            assert_eq!(parts(&bare), parts(&full), "{shape:?} {ray:?}");
            let at = ray.at(f64::from(hit.t));
            let off = (bare.point.as_dvec3() - at).abs().max_element();
            assert!(off < 1e-5 * (1.0 + at.length()), "{shape:?}: {off}");
        }
    }
}

#[test]
fn projected_area_integrates_the_cosines() {
    for shape in shapes().into_iter().filter(|shape| !shape.local_part_areas().is_empty()) {
        let directions = [DVec3::X, DVec3::NEG_Y, DVec3::new(-0.3, 0.5, 0.8).normalize()];
        if matches!(untransformed(&shape), (Shape::Torus(_), true)) {
            continue;
        }
        let integrals = integrals(&shape, |place| {
            DVec3::from_array(directions.map(|direction| place.normal.dot(direction).max(0.0))).extend(1.0)
        });
        for (direction, shown) in directions.into_iter().zip(integrals.to_array()) {
            if matches!(shape, Shape::Torus(_)) {
                // For a torus, only the mean over all directions is computed (Cauchy's formula).
                assert_eq!(shape.projected_area(direction), shape.local_part_areas()[0] / 4.0);
            } else {
                let off = shape.projected_area(direction) - shown;
                assert!(off.abs() < 2e-3 * integrals.w, "{shape:?}: {off}");
            }
        }
    }
}

#[test]
fn centroid_is_the_mean_of_the_points() {
    // The centroid of a transformed cone is not the image of the cone's centroid.
    let is_cone = |shape: &Shape| matches!(untransformed(shape), (Shape::Cone(_), true));
    let bounded = |shape: &Shape| !shape.local_part_areas().is_empty();
    for shape in shapes().into_iter().filter(|shape| bounded(shape) && !is_cone(shape)) {
        let integrals = integrals(&shape, |place| place.point.extend(1.0));
        let mean = integrals.truncate() / integrals.w;
        assert!((mean - shape.centroid()).abs().max_element() < 2e-3, "{shape:?}: {mean}");
    }
}

#[test]
fn distance_is_to_the_nearest_point() {
    let distance = |shape: &Shape, point: DVec3| match shape.polygons_or_surface_near(point) {
        NearbyGeometry::Surface { distance, .. } => Some(distance),
        NearbyGeometry::Polygons(_) => None,
    };
    for shape in shapes() {
        let parts = (0_u32..).zip(shape.local_part_areas()).filter(|(_, area)| *area > 0.0);
        let places: Vec<DVec3> = parts
            .flat_map(|(part, _)| grid(SIDE).map(move |u| (part, u)))
            .map(|(part, u)| shape.sample_point_on_part(part, u).point)
            .collect();
        for i in 0..12_u32 {
            let u = |factor: f64| (f64::from(i) + 0.5) * factor % 1.0 * 3.0 - 1.5;
            let point = shape.centroid() + DVec3::new(u(0.618_034), u(0.754_878), u(0.569_84));
            let Some(found) = distance(&shape, point).filter(|_| !places.is_empty()) else { continue };
            let nearest = places.iter().map(|place| (*place - point).length()).fold(f64::MAX, f64::min);
            // For a transformed shape, the distance is a lower bound, within the transform's condition
            // number.
            let range = if untransformed(&shape).1 { 0.3 } else { 1.0 };
            let is_near = nearest >= found - 1e-9 && found + 0.03 > range * nearest;
            assert!(is_near, "{shape:?}: {found}, {nearest}");
        }
    }
}

#[test]
fn rays_hit_fronts_on_entry_and_backs_on_exit() {
    for shape in shapes() {
        let mut seen = 0;
        // A tube or an open cone also contains points, although its surface is open.
        let is_closed = match untransformed(&shape).0 {
            Shape::Sphere(_) | Shape::Box(_) | Shape::Torus(_) => true,
            Shape::Cylinder(_) | Shape::Cone(_) => shape.local_part_areas().iter().all(|&area| area > 0.0),
            Shape::Quad(_)
            | Shape::Plane(_)
            | Shape::Triangle(_)
            | Shape::Disk(_)
            | Shape::Transformed(_) => false,
        };
        for (ray, hit) in hits(&shape) {
            let surface = shape.surface_point_at_hit(&ray, &hit);
            let behind = surface.point.as_dvec3() - surface.normal.as_dvec3() * 1e-3;
            let before = surface.point.as_dvec3() + surface.normal.as_dvec3() * 1e-3;
            assert!(!shape.encloses_point(before) || !is_closed, "{shape:?}");
            seen += u32::from(shape.encloses_point(behind));
        }
        assert_eq!(
            seen > 100,
            is_closed || matches!(untransformed(&shape).0, Shape::Cylinder(_) | Shape::Cone(_)),
            "{shape:?}"
        );
    }
}

#[test]
fn tangents_are_derivatives_of_points() {
    for shape in shapes() {
        let mut seen = 0;
        for (ray, hit) in hits(&shape) {
            let surface = shape.surface_point_at_hit(&ray, &hit);
            let point = surface.point.as_dvec3();
            let uv = shape.uv_at_point(point);
            let (u, v) = (surface.dpdu.as_dvec3(), surface.dpdv.as_dvec3());
            // Skip steps that cross a seam, a border, or a pole.
            let step = 1e-4;
            let is_inside = |uv: DVec2| uv.min_element() > 0.02 && uv.max_element() < 0.98;
            let (kind, is_transformed) = untransformed(&shape);
            let is_round =
                matches!(kind, Shape::Disk(_)) || hit.primitive > 0 && !matches!(kind, Shape::Box(_));
            if is_round && (surface.uv - DVec2::splat(0.5)).length() > 0.48 {
                continue;
            }
            if !matches!(kind, Shape::Plane(_)) && !is_inside(surface.uv) {
                continue;
            }
            seen += 1;
            assert!((uv - surface.uv).length() < 1e-5 + 1e-7 * uv.length(), "{shape:?}: {uv} {}", surface.uv);
            let moved = [shape.uv_at_point(point + u * step) - uv, shape.uv_at_point(point + v * step) - uv];
            let off = (moved[0] - DVec2::X * step).length().max((moved[1] - DVec2::Y * step).length());
            assert!(off < 0.02 * step, "{shape:?} at {uv}: {moved:?}");
            // On spheres, u increases from x to z as documented, so images are mirrored. They are not
            // mirrored on other shapes.
            let is_mirrored = u.cross(v).dot(surface.normal.as_dvec3()) < 0.0;
            assert_eq!(is_mirrored, matches!(kind, Shape::Sphere(_)) != is_transformed, "{shape:?}");
            assert!((u.dot(surface.normal.as_dvec3())).abs() < 1e-5 * u.length(), "{shape:?}");
        }
        assert!(seen > 100, "{shape:?}");
    }
}

#[test]
fn curvature_is_half_the_normal_divergence() {
    for shape in shapes() {
        let mut compared = 0;
        for (ray, hit) in hits(&shape).step_by(7) {
            let surface = shape.surface_point_at_hit(&ray, &hit);
            let (point, normal) = (surface.point.as_dvec3(), surface.normal.as_dvec3());
            let step = 1e-2;
            let normal_at = |aside: DVec3| {
                let from = point + aside * step + normal * (4.0 * step);
                let ray = RayF64 { origin: from, direction: -normal, t_max: f64::INFINITY };
                let hit =
                    shape.intersect(&ray).filter(|near| near.primitive == hit.primitive && near.t < 0.1)?;
                Some(shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3())
            };
            let (a, b) = normal.any_orthonormal_pair();
            let along = |e: DVec3| Some((normal_at(e)? - normal_at(-e)?).dot(e) / (2.0 * step));
            let Some(divergence) = along(a).zip(along(b)).map(|(a, b)| a + b) else { continue };
            let curvature = shape.mean_curvature(hit.primitive, point);
            let allowed = 0.02 * curvature.abs() + 2e-3;
            // The finite-difference steps are too long near the tip of a cone.
            let is_tip = matches!(untransformed(&shape).0, Shape::Cone(_)) && curvature > 6.0;
            assert!(
                is_tip || (0.5 * divergence - curvature).abs() < allowed,
                "{shape:?}: {divergence} {curvature}"
            );
            compared += u32::from(!is_tip);
        }
        assert!(compared > 30, "{shape:?}: {compared}");
    }
}
