//! Detects quad lights that face away from the whole scene.

use std::ops::Range;

use super::description::{
    Camera, EmissionSides, MeshReference, Object, Projection, Scene, Shape, max_projection,
};
use crate::math::DVec3;

/// Warning message about a quad light that faces away from everything. Its label and help text follow.
pub(super) const MESSAGE: &str = "this light shines away from everything";
pub(super) const LABEL: &str = "all shapes are behind it";
pub(super) const HELP: &str = "swap `u` and `v`: the front faces along u × v";

/// Minimum and maximum corners of a mesh file's bounding box, or `None` for a mesh without vertices.
pub type MeshBoundingBox = Option<[DVec3; 2]>;

/// Minimum ratio of the scene's extent in front of a light to the extent behind the light. Below this ratio,
/// the light counts as facing away. The ratio is small because a light may be meant to illuminate only the
/// ceiling just above it.
const MIN_FRONT_RATIO: f64 = 0.02;

/// Returns the spans of one-sided quad lights that have shapes behind them and nothing in front of them. Checks
/// only the first copy of a light in a group, because each check visits all objects.
/// Calls `bounds` only if the scene has one-sided quad lights.
pub(super) fn spans_of_lights_facing_nothing(
    scene: &Scene,
    bounds: impl FnOnce() -> Vec<MeshBoundingBox>,
) -> Vec<Range<usize>> {
    let emits = |object: &Object| {
        let material = object.material.map(|index| &scene.materials[index]);
        material.is_some_and(|material| material.emits() && material.emission_sides() == EmissionSides::Front)
    };
    let quad = |object: &Object| {
        let Shape::Quad { corner, u, v } = object.shape else { return None };
        let front = u.cross(v).try_normalize()?;
        emits(object).then_some((corner, front))
    };
    let mut is_first_copy = scene.first_copy_filter();
    let lights: Vec<_> = scene
        .objects
        .iter()
        .enumerate()
        .filter_map(|(number, object)| Some((number, quad(object)?)))
        .filter(|(number, _)| is_first_copy(*number))
        .collect();
    if lights.is_empty() {
        return Vec::new();
    }
    let bounds = bounds();
    let is_away = |number: usize, corner: DVec3, front: DVec3| {
        let others = scene.objects.iter().enumerate().filter(|(other, _)| *other != number);
        let reach = |direction: DVec3| {
            let of = |object: &Object| {
                shape_upper_bound_along(&object.shape, &bounds, direction) - direction.dot(corner)
            };
            others.clone().map(|(_, object)| of(object)).fold(0.0, f64::max)
        };
        let (ahead, behind) = (reach(front), reach(-front));
        behind > 0.0
            && ahead <= MIN_FRONT_RATIO * behind
            && !is_camera_in_front_of_light(&scene.camera, corner, front)
    };
    let away = lights.into_iter().filter(|(number, (corner, front))| is_away(*number, *corner, *front));
    away.map(|(number, _)| scene.objects[number].span.clone()).collect()
}

/// Whether the camera is in front of a light. Always true for orbiter cameras, because their files are not
/// read here.
fn is_camera_in_front_of_light(camera: &Camera, corner: DVec3, front: DVec3) -> bool {
    match camera {
        // For parallel rays, only the view direction matters.
        Camera::LookAt { position, look_at, projection: Projection::Orthographic { .. }, .. } => {
            front.dot(*look_at - *position) < 0.0
        }
        Camera::LookAt { position, .. } => front.dot(*position - corner) > 0.0,
        Camera::Orbiter { .. } => true,
    }
}

/// Returns an upper bound on the projection of a shape's points onto a unit direction.
fn shape_upper_bound_along(shape: &Shape, bounds: &[MeshBoundingBox], direction: DVec3) -> f64 {
    shape.upper_bound_along(direction).unwrap_or_else(|| {
        let of = |mesh: &MeshReference| {
            Some(transformed_box_corners(mesh, bounds.get(mesh.file).copied().flatten()?))
        };
        shape.as_mesh().and_then(of).map_or(f64::NEG_INFINITY, |corners| max_projection(direction, &corners))
    })
}

/// Returns the transformed corners of a mesh's bounding box.
fn transformed_box_corners(mesh: &MeshReference, [min, max]: [DVec3; 2]) -> [DVec3; 8] {
    let place = mesh.placed.to_transform();
    std::array::from_fn(|number| {
        let far = DVec3::new((number & 1) as f64, (number >> 1 & 1) as f64, (number >> 2) as f64);
        place.point(min + (max - min) * far)
    })
}
