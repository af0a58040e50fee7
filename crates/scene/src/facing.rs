//! Lights that shine away from everything.

use std::ops::Range;

use super::description::{Camera, EmissionSides, Mesh, Object, Scene, Shape, greatest};
use crate::math::DVec3;

/// Warning about such a light, with its label and the way out.
pub(super) const MESSAGE: &str = "this light shines away from everything";
pub(super) const LABEL: &str = "all shapes are behind it";
pub(super) const HELP: &str = "swap `u` and `v`: its front is along u × v";

/// The least and the greatest coordinates of a mesh file; `None` if it has no vertices.
pub type MeshBounds = Option<[DVec3; 2]>;

/// Least ratio of a reach in front of a light to the reach behind it that counts: a ceiling just above the light does not.
const LEAST: f64 = 0.02;

/// Quads that send light from their front alone where nothing is, while all that they could light is behind them. Asks for the bounds of the scene's
/// mesh files only if there are such lights.
pub(super) fn away(scene: &Scene, bounds: impl FnOnce() -> Vec<MeshBounds>) -> Vec<Range<usize>> {
    let emits = |object: &Object| {
        let material = object.material.map(|index| &scene.materials[index]);
        material.is_some_and(|material| material.emits() && material.emission.sides == EmissionSides::Front)
    };
    let quad = |object: &Object| {
        let Shape::Quad { corner, u, v } = object.shape else { return None };
        let front = u.cross(v).try_normalize()?;
        emits(object).then_some((corner, front))
    };
    let lights: Vec<_> = scene
        .objects
        .iter()
        .enumerate()
        .filter_map(|(number, object)| Some((number, quad(object)?)))
        .collect();
    if lights.is_empty() {
        return Vec::new();
    }
    let bounds = bounds();
    let is_away = |number: usize, corner: DVec3, front: DVec3| {
        let others = scene.objects.iter().enumerate().filter(|(other, _)| *other != number);
        let reach = |direction: DVec3| {
            let of = |object: &Object| furthest(&object.shape, &bounds, direction) - direction.dot(corner);
            others.clone().map(|(_, object)| of(object)).fold(0.0, f64::max)
        };
        let (ahead, behind) = (reach(front), reach(-front));
        behind > 0.0 && ahead <= LEAST * behind && !sees(&scene.camera, corner, front)
    };
    let away = lights.into_iter().filter(|(number, (corner, front))| is_away(*number, *corner, *front));
    away.map(|(number, _)| scene.objects[number].span.clone()).collect()
}

/// Whether the camera is in front of a light; one in a file may be.
fn sees(camera: &Camera, corner: DVec3, front: DVec3) -> bool {
    match camera {
        Camera::LookAt { position, .. } => front.dot(*position - corner) > 0.0,
        Camera::Orbiter { .. } => true,
    }
}

/// Reach of a shape in a direction of length 1, or a little more.
fn furthest(shape: &Shape, bounds: &[MeshBounds], direction: DVec3) -> f64 {
    shape.reach(direction).unwrap_or_else(|| {
        let of = |mesh: &Mesh| Some(corners(mesh, bounds.get(mesh.file).copied().flatten()?));
        shape.mesh().and_then(of).map_or(f64::NEG_INFINITY, |corners| greatest(direction, &corners))
    })
}

/// The corners of a mesh's box where the scene has it.
fn corners(mesh: &Mesh, [least, greatest]: [DVec3; 2]) -> [DVec3; 8] {
    let place = mesh.placed.transform();
    std::array::from_fn(|number| {
        let far = DVec3::new((number & 1) as f64, (number >> 1 & 1) as f64, (number >> 2) as f64);
        place.point(least + (greatest - least) * far)
    })
}
