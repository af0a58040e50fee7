//! Frames a model: computes its default camera and key light.

use super::rounding::round_significant;
use crate::math::DVec3;
use crate::settings::ViewSide;
use crate::turntable::TurntableFrame;

/// Vertical field of view in degrees.
pub(super) const FOV: f64 = 30.0;
/// Fraction of the image's width and height that the model may occupy.
const MAX_FILL: f64 = 0.88;

/// Minimum model size.
const MIN_SIZE: f64 = 1e-30;

/// Maximum number of turntable frames used to fit the model. More would not change the result noticeably.
const MAX_MEASURED: u32 = 72;

/// Position and orientation of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CameraPose {
    pub(super) position: DVec3,
    pub(super) look_at: DVec3,
    pub(super) up: DVec3,
}

impl ViewSide {
    /// Direction from the model to the camera, and the image's up vector. The model's front faces +z.
    fn camera_and_up_directions(self) -> (DVec3, DVec3) {
        match self {
            Self::Front => (DVec3::Z, DVec3::Y),
            Self::Back => (DVec3::NEG_Z, DVec3::Y),
            Self::Left => (DVec3::NEG_X, DVec3::Y),
            Self::Right => (DVec3::X, DVec3::Y),
            Self::Top => (DVec3::Y, DVec3::NEG_Z),
            Self::Bottom => (DVec3::NEG_Y, DVec3::Z),
            Self::Iso => (DVec3::new(0.8, 0.62, 1.0).normalize(), DVec3::Y),
        }
    }
}

/// Returns the closest camera that keeps all `points` inside the image in each of the `turns` turntable
/// frames. `min` and `max` are opposite corners of the model's bounding box.
pub(super) fn frame_model(
    [min, max]: [DVec3; 2],
    points: &[DVec3],
    from: ViewSide,
    turns: u32,
    aspect: f64,
) -> CameraPose {
    let (back, up) = from.camera_and_up_directions();
    let middle = (min + max) * 0.5;
    let tangent = libm::tan((FOV * 0.5).to_radians()) * MAX_FILL;
    // Move the camera back until every point is inside the frame.
    let half = (max - min) * 0.5;
    let mut distance = 0.0_f64;
    for back in TurntableFrame::camera_offsets_of_all_frames(turns.min(MAX_MEASURED), back, up) {
        let right = up.cross(back).normalize_or(DVec3::X);
        let above = back.cross(right);
        for point in points {
            let at = *point - middle;
            let (across, upwards, near) = (at.dot(right).abs(), at.dot(above).abs(), at.dot(back));
            distance = distance.max(near + (across / (tangent * aspect)).max(upwards / tangent));
        }
    }
    let distance = distance.max(MIN_SIZE);
    // Drop digits that make no visible difference.
    let size = half.length().max(MIN_SIZE);
    let step = size * 1e-4;
    let tidy = |at: DVec3| DVec3::from(at.to_array().map(|part| round_to_decimals_of_step(part, step)));
    CameraPose { position: tidy(middle + back * distance), look_at: tidy(middle), up }
}

/// Rounds to a multiple of the largest power of ten that does not exceed `step`.
pub(super) fn round_to_decimals_of_step(value: f64, step: f64) -> f64 {
    let unit = libm::pow(10.0, libm::floor(libm::log10(step)));
    let whole = (value / unit).round();
    // Dividing by a power of ten produces fewer digits than multiplying by its reciprocal.
    if unit < 1.0 { whole / libm::round(1.0 / unit) } else { whole * unit }
}

/// Elevation of the key light in degrees.
const KEY_LIGHT_ELEVATION: f64 = 50.0;
/// Azimuth of the key light in degrees, to the left of the camera.
const KEY_LIGHT_AZIMUTH: f64 = 40.0;

/// Direction in which the key light travels. The light comes from above the viewer's left shoulder.
pub(super) fn key_light_travel_direction(eye: &CameraPose) -> DVec3 {
    let back = eye.position - eye.look_at;
    // For views from directly above or below, use the front direction instead.
    let flat = DVec3::new(back.x, 0.0, back.z);
    let flat = if flat.length() > 1e-3 * back.length() { flat.normalize() } else { DVec3::Z };
    let (sin, cos) = (libm::sin(KEY_LIGHT_AZIMUTH.to_radians()), libm::cos(KEY_LIGHT_AZIMUTH.to_radians()));
    let aside = DVec3::new(flat.x * cos - flat.z * sin, 0.0, flat.x * sin + flat.z * cos);
    let (rise, run) =
        (libm::sin(KEY_LIGHT_ELEVATION.to_radians()), libm::cos(KEY_LIGHT_ELEVATION.to_radians()));
    let towards = aside * run + DVec3::Y * rise;
    DVec3::from((-towards).to_array().map(|part| round_significant(part, 2)))
}

/// Radiance of the sky.
pub(super) const SKY_RADIANCE: f64 = 0.5;
/// Irradiance of the key light at normal incidence.
pub(super) const KEY_LIGHT_IRRADIANCE: f64 = 1.5;

/// Ground reflectance that makes level ground as bright as the sky, which hides the horizon. The ground's
/// irradiance is π·`SKY_RADIANCE` plus the key light's contribution.
pub(super) fn ground_reflectance_matching_sky() -> f64 {
    let key = KEY_LIGHT_IRRADIANCE * libm::sin(KEY_LIGHT_ELEVATION.to_radians()) / std::f64::consts::PI;
    round_significant(SKY_RADIANCE / (SKY_RADIANCE + key), 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_fill_the_frame() {
        let bounds = [DVec3::new(-1.0, 2.0, -3.0), DVec3::new(4.0, 3.0, 0.5)];
        for from in [
            ViewSide::Front,
            ViewSide::Back,
            ViewSide::Left,
            ViewSide::Right,
            ViewSide::Top,
            ViewSide::Bottom,
            ViewSide::Iso,
        ] {
            for aspect in [0.5, 1.0, 4.0 / 3.0, 3.0] {
                let corners: Vec<DVec3> = (0..8)
                    .map(|corner| DVec3::from([0, 1, 2].map(|axis: usize| bounds[corner >> axis & 1][axis])))
                    .collect();
                let eye = frame_model(bounds, &corners, from, 1, aspect);
                let back = (eye.position - eye.look_at).normalize();
                let right = eye.up.cross(back).normalize();
                let above = back.cross(right);
                let tangent = libm::tan((FOV * 0.5).to_radians());
                let mut most = 0.0_f64;
                for corner in 0..8 {
                    let at = DVec3::from([0, 1, 2].map(|axis: usize| bounds[corner >> axis & 1][axis]))
                        - eye.position;
                    let depth = -at.dot(back);
                    assert!(depth > 0.0);
                    most = most.max((at.dot(right) / (depth * tangent * aspect)).abs());
                    most = most.max((at.dot(above) / (depth * tangent)).abs());
                }
                assert!(most < 0.9 && most > 0.86, "{from:?} {aspect}: {most}");
            }
        }
    }

    /// A long model facing the camera end-on must still fit when the turntable shows its side.
    #[test]
    fn every_turntable_frame_contains_the_model() {
        let bounds = [DVec3::new(-0.5, 0.0, -4.0), DVec3::new(0.5, 1.0, 4.0)];
        let corners = [bounds[0], bounds[1], DVec3::new(-0.5, 1.0, 4.0), DVec3::new(0.5, 0.0, -4.0)];
        let distance = |turns| {
            let eye = frame_model(bounds, &corners, ViewSide::Front, turns, 1.0);
            (eye.position - eye.look_at).length()
        };
        let side = frame_model(bounds, &corners, ViewSide::Right, 1, 1.0);
        let of_side = (side.position - side.look_at).length();
        assert!(distance(1) < 0.6 * of_side && distance(4) >= of_side - 1e-3, "{} {of_side}", distance(4));
    }

    #[test]
    fn insignificant_digits_are_dropped() {
        assert_eq!(round_to_decimals_of_step(1.234_567_8, 3e-4), 1.2346);
        assert_eq!(round_to_decimals_of_step(-12_345.678, 30.0), -12_350.0);
    }

    /// A plane lit only by the sky and the key light has the sky's radiance.
    #[test]
    fn ground_is_as_bright_as_the_sky() {
        let eye = frame_model([DVec3::ZERO, DVec3::ONE], &[DVec3::ZERO, DVec3::ONE], ViewSide::Iso, 1, 1.0);
        let direction = key_light_travel_direction(&eye).normalize();
        let irradiance = std::f64::consts::PI * SKY_RADIANCE - direction.y * KEY_LIGHT_IRRADIANCE;
        let radiance = ground_reflectance_matching_sky() * irradiance / std::f64::consts::PI;
        assert!((radiance / SKY_RADIANCE - 1.0).abs() < 0.02, "{radiance}");
        let to_eye = (eye.position - eye.look_at).normalize();
        assert!((-direction).dot(to_eye) > 0.3, "the key light and the camera should be on the same side");
    }
}
