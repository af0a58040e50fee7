//! Lights that shine away from everything.

use super::super::description::{Camera, Object, Scene, Shape};
use super::context::{Context, Issue};
use crate::math::DVec3;

/// What is in front of a light counts from this part of what is behind it on: a ceiling just above it does not.
const LEAST: f64 = 0.02;

/// Warns about quads that send light where nothing is, while all that could be lit is behind them.
pub(super) fn warn_about_lights(context: &Context<'_>, scene: &Scene) {
    // Where a mesh is, is not known before it is loaded.
    if scene.objects.iter().any(|object| object.shape.mesh().is_some()) {
        return;
    }
    let emits = |object: &Object| object.material.is_some_and(|index| scene.materials[index].emits());
    for (number, object) in scene.objects.iter().enumerate().filter(|(_, object)| emits(object)) {
        let Shape::Quad { corner, u, v } = object.shape else { continue };
        let Some(front) = u.cross(v).try_normalize() else { continue };
        let others = scene.objects.iter().enumerate().filter(|(other, _)| *other != number);
        let reach = |direction: DVec3| {
            let of = |object: &Object| furthest(&object.shape, direction) - direction.dot(corner);
            others.clone().map(|(_, object)| of(object)).fold(0.0, f64::max)
        };
        let (ahead, behind) = (reach(front), reach(-front));
        if behind > 0.0 && ahead <= LEAST * behind && !sees(&scene.camera, corner, front) {
            let issue = Issue::warning(object.span.clone(), "this light shines away from everything")
                .label("all shapes are behind it")
                .help("swap `u` and `v`: its front is along u × v");
            context.report(issue);
        }
    }
}

/// Whether the camera is in front of a light; one in a file may be.
fn sees(camera: &Camera, corner: DVec3, front: DVec3) -> bool {
    match camera {
        Camera::LookAt { position, .. } => front.dot(*position - corner) > 0.0,
        Camera::Orbiter { .. } => true,
    }
}

/// How far a shape reaches in a direction of length 1, or a little further than that.
fn furthest(shape: &Shape, direction: DVec3) -> f64 {
    let along = |place: DVec3| direction.dot(place);
    let most = |places: &[DVec3]| places.iter().copied().map(along).fold(f64::NEG_INFINITY, f64::max);
    // The part of a circle's radius around an axis that lies along the direction.
    let round = |axis: DVec3, radius: f64| {
        let cosine = axis.try_normalize().map_or(0.0, along);
        radius * (1.0 - cosine * cosine).max(0.0).sqrt()
    };
    match *shape {
        Shape::Sphere { center, radius } => along(center) + radius,
        Shape::Quad { corner, u, v } => most(&[corner, corner + u, corner + v, corner + u + v]),
        Shape::Triangle { a, b, c } => most(&[a, b, c]),
        // It has an end where it is parallel alone.
        Shape::Plane { point, normal } => {
            let is_parallel = normal.try_normalize().is_some_and(|normal| along(normal).abs() > 1.0 - 1e-9);
            if is_parallel { along(point) } else { f64::INFINITY }
        }
        Shape::Box { center, size, rotate: DVec3::ZERO } => along(center) + 0.5 * direction.abs().dot(size),
        Shape::Box { center, size, rotate: _ } => along(center) + 0.5 * size.length(),
        Shape::Disk { center, normal, radius } => along(center) + round(normal, radius),
        Shape::Cylinder { a, b, radius, caps: _ } => most(&[a, b]) + round(b - a, radius),
        Shape::Cone { base, tip, radius, cap: _ } => {
            most(&[base + direction * round(tip - base, radius), tip])
        }
        Shape::Torus { center, axis, radius, tube } => along(center) + round(axis, radius) + tube,
        Shape::Mesh(_) => f64::INFINITY,
    }
}
