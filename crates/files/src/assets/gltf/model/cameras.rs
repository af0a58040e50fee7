//! Cameras of a glTF scene.

use super::super::description::{AffineMap, ModelCamera, ModelProjection};
use super::super::json::JsonCamera;
use super::{MAX_MAGNITUDE, SceneWalk, UNKNOWN_CAMERA};
use crate::math::DVec3;

impl SceneWalk<'_> {
    pub(super) fn add_camera(&mut self, json: &JsonCamera, node: &str, placed: AffineMap, place: &str) {
        let direction = (placed.linear * DVec3::NEG_Z).try_normalize();
        let up = (placed.linear * DVec3::Y).try_normalize();
        let (Some(direction), Some(up)) = (direction, up) else { return };
        let position = placed.translate;
        let (projection, is_in_range, aspect) = match (&json.perspective, &json.orthographic) {
            (Some(lens), _) => {
                let fov = lens.yfov.to_degrees();
                (ModelProjection::Perspective { fov }, fov > 0.0 && fov < 180.0, lens.aspect_ratio)
            }
            (None, Some(lens)) => {
                let view_height = 2.0 * lens.ymag.abs();
                let is_in_range = view_height > 1.0 / MAX_MAGNITUDE && view_height < MAX_MAGNITUDE;
                let aspect = lens.xmag.map(|xmag| (xmag / lens.ymag).abs());
                (ModelProjection::Orthographic { view_height }, is_in_range, aspect)
            }
            (None, None) => {
                return self.notes.add(place, UNKNOWN_CAMERA);
            }
        };
        if position.abs().max_element() < MAX_MAGNITUDE && is_in_range {
            let name = if json.name.is_empty() { node } else { &json.name };
            let aspect = aspect.filter(|aspect| *aspect > 0.05 && *aspect < 20.0);
            self.scene.cameras.push(ModelCamera {
                name: name.to_owned(),
                position,
                direction,
                up,
                projection,
                aspect,
            });
        } else {
            self.notes.add(place, "the camera is skipped: invalid position, field of view or size");
        }
    }
}
