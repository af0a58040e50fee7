//! Camera movement with the keyboard and mouse. Coordinates are rounded to a few digits so that the displayed
//! camera can be written to a scene file exactly.

use crate::math::DVec3;
use crate::math::decimal::{decimal_step_for_distance, round_to_step};
use crate::scene::description::{Pose, Projection};

/// Minimum angle in degrees between the orbit axis and the direction from `look_at` to the eye.
const MIN_POLE_ANGLE: f64 = 1.0;
/// Minimum field of view, in degrees.
const MIN_FIELD: f64 = 1.0;
/// Maximum field of view of a perspective, in degrees.
const MAX_FIELD: f64 = 160.0;
/// Maximum field of view of a fisheye, in degrees.
const MAX_FISHEYE_FIELD: f64 = 360.0;
/// Limit on dollying: the distance to `look_at` stays within this factor of its value in the scene. The same
/// limit applies to the height of an orthographic view.
pub(super) const MAX_DOLLY_FACTOR: f64 = 1000.0;

/// Orbits the camera around `look_at` by `right` and `up` degrees.
pub(super) fn orbited(pose: &Pose, right: f64, up: f64) -> Pose {
    let axis = pose.up.normalize_or(DVec3::Y);
    let arm = pose.position - pose.look_at;
    let distance = arm.length();
    let polar = libm::acos((arm.dot(axis) / distance).clamp(-1.0, 1.0)).to_degrees();
    // If the camera starts closer to a pole, leave it there.
    let (least, most) = (MIN_POLE_ANGLE.min(polar), (180.0 - MIN_POLE_ANGLE).max(polar));
    let lifted = (polar - up).clamp(least, most);
    let level = (arm - axis * arm.dot(axis)).normalize_or(axis.any_orthonormal_vector());
    let (sine, cosine) = libm::sincos(right.to_radians());
    let level = level * cosine + axis.cross(level) * sine;
    let (sine, cosine) = libm::sincos(lifted.to_radians());
    with_target_to_eye_vector(pose, (level * sine + axis * cosine) * distance)
}

/// Multiplies the distance to `look_at` by `factor`, limited to within a factor of [`MAX_DOLLY_FACTOR`] of
/// `own`, the distance in the scene.
pub(super) fn dollied(pose: &Pose, factor: f64, own: f64) -> Pose {
    let arm = pose.position - pose.look_at;
    let distance = arm.length();
    let wanted = (distance * factor)
        .clamp((own / MAX_DOLLY_FACTOR).min(distance), (own * MAX_DOLLY_FACTOR).max(distance));
    if wanted == distance { *pose } else { with_target_to_eye_vector(pose, arm * (wanted / distance)) }
}

/// Multiplies the field of view, or the height of an orthographic image, by `factor`, within limits. `own` is
/// the scene's projection.
pub(super) fn zoomed_projection(view: Projection, own: Projection, factor: f64) -> Projection {
    let zoomed_fov =
        |fov: f64, most: f64| round_to_step((fov * factor).clamp(MIN_FIELD.min(fov), most.max(fov)), 0.01);
    match view {
        Projection::Perspective { fov } => Projection::Perspective { fov: zoomed_fov(fov, MAX_FIELD) },
        Projection::Fisheye { fov } => Projection::Fisheye { fov: zoomed_fov(fov, MAX_FISHEYE_FIELD) },
        Projection::Orthographic { view_height: now } => {
            let own = own.view_height().unwrap_or(now);
            let wanted =
                (now * factor).clamp((own / MAX_DOLLY_FACTOR).min(now), (own * MAX_DOLLY_FACTOR).max(now));
            let view_height =
                if wanted == now { now } else { round_to_step(wanted, decimal_step_for_distance(wanted)) };
            Projection::Orthographic { view_height }
        }
        Projection::Spherical => Projection::Spherical,
    }
}

/// Moves the eye to `look_at + arm`, rounding its position by at most 1/10,000 of the distance.
fn with_target_to_eye_vector(pose: &Pose, arm: DVec3) -> Pose {
    let step = decimal_step_for_distance(arm.length());
    let position = (pose.look_at + arm).to_array().map(|number| round_to_step(number, step));
    Pose { position: DVec3::from_array(position), ..*pose }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: Pose =
        Pose { position: DVec3::new(0.0, 1.0, 4.0), look_at: DVec3::new(0.0, 1.0, 0.0), up: DVec3::Y };

    #[test]
    fn camera_orbits_around_look_at() {
        let right = orbited(&POSE, 90.0, 0.0);
        assert_eq!(right.position, DVec3::new(4.0, 1.0, 0.0), "right is +x");
        let up = orbited(&POSE, 0.0, 30.0);
        assert!((up.position - DVec3::new(0.0, 3.0, 4.0 * 0.75_f64.sqrt())).length() < 1e-4);
        let mut pose = POSE;
        for _ in 0..360 {
            pose = orbited(&pose, 1.0, 0.0);
        }
        assert!((pose.position - POSE.position).length() < 5e-3, "{:?}", pose.position);
    }

    #[test]
    fn orbit_stops_before_the_poles() {
        let mut pose = POSE;
        for _ in 0..100 {
            pose = orbited(&pose, 0.0, 5.0);
        }
        let arm = (pose.position - pose.look_at).normalize();
        assert!((arm.dot(DVec3::Y).acos().to_degrees() - MIN_POLE_ANGLE).abs() < 0.01, "{arm}");
        assert!(arm.z > 0.0, "the camera should not cross the pole");
        let above = Pose { position: DVec3::new(0.0, 9.0, 0.0), up: DVec3::Y, look_at: DVec3::ZERO };
        assert!(orbited(&above, 10.0, -40.0).position.is_finite());
    }

    #[test]
    fn dolly_and_zoom_are_limited() {
        assert_eq!(dollied(&POSE, 0.5, 4.0).position, DVec3::new(0.0, 1.0, 2.0));
        for (factor, end) in [(0.5, 0.004), (2.0, 4000.0)] {
            let mut pose = POSE;
            for _ in 0..1000 {
                pose = dollied(&pose, factor, 4.0);
            }
            assert!((pose.distance() / end - 1.0).abs() < 1e-4, "{}", pose.distance());
            assert_eq!(dollied(&pose, factor, 4.0), pose, "no further movement");
        }
        let far = Pose { position: DVec3::new(0.0, 1.0, 1e6), ..POSE };
        assert_eq!(dollied(&far, 2.0, 4.0), far, "a camera that starts beyond the limit should stay there");
        let perspective = |fov| Projection::Perspective { fov };
        let zoom = |view: Projection, factor| zoomed_projection(view, view, factor);
        assert_eq!(zoom(perspective(40.0), 1.1), perspective(44.0));
        assert_eq!(zoom(perspective(40.0), 100.0), perspective(160.0));
        let wide = zoom(perspective(170.0), 1.1);
        assert_eq!(wide, perspective(170.0), "zooming should not narrow a wider field of view");
        assert_eq!(zoom(Projection::Fisheye { fov: 300.0 }, 2.0), Projection::Fisheye { fov: 360.0 });
        assert_eq!(zoom(Projection::Spherical, 2.0), Projection::Spherical);
        let [own, tall, tallest] =
            [3.0, 3.3, 3000.0].map(|view_height| Projection::Orthographic { view_height });
        assert_eq!((zoom(own, 1.1), zoomed_projection(tall, own, 1e9)), (tall, tallest));
    }
}
