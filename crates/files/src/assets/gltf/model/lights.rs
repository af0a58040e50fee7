//! Lights of a glTF scene (`KHR_lights_punctual`).

use super::super::GltfError;
use super::super::description::{AffineMap, ModelLight, ModelLightKind};
use super::super::json::JsonLight;
use super::{MAX_MAGNITUDE, SceneWalk};
use crate::math::DVec3;

impl SceneWalk<'_> {
    pub(super) fn add_light(&mut self, json: &JsonLight, node: &str, placed: AffineMap, place: &str) {
        let kind = match json.kind.as_str() {
            "point" => ModelLightKind::Point,
            "directional" => ModelLightKind::Directional,
            "spot" => {
                let outer = json.spot.outer_cone_angle.clamp(1e-3, std::f64::consts::FRAC_PI_2);
                let inner = json.spot.inner_cone_angle.clamp(0.0, outer);
                if inner < outer {
                    self.notes
                        .add(place, "the falloff between the light's inner and outer cones is approximate");
                }
                ModelLightKind::Spot { angle: 2.0 * outer.to_degrees(), blend: 1.0 - inner / outer }
            }
            other => {
                self.notes.add(
                    place,
                    &format!(
                        "a light of unknown type {:?} is skipped",
                        super::super::truncate_for_message(other)
                    ),
                );
                return;
            }
        };
        if json.range.is_some() {
            self.notes.add(place, "the light's range is ignored; it falls off with the squared distance");
        }
        let intensity = DVec3::from(json.color) * json.intensity;
        let direction = (placed.linear * DVec3::NEG_Z).normalize_or(DVec3::NEG_Z);
        let usable = intensity.is_finite() && intensity.min_element() >= 0.0 && placed.translate.is_finite();
        if !usable {
            self.notes.add(place, "a light with negative or nonfinite values is skipped");
            return;
        }
        let name = if json.name.is_empty() { node } else { &json.name };
        self.scene.lights.push(ModelLight {
            name: name.to_owned(),
            kind,
            intensity,
            position: placed.translate,
            direction,
        });
    }
}

/// Rejects lights with an intensity above the limit.
pub(super) fn check_intensity_limit(json: &JsonLight, number: usize) -> Result<(), GltfError> {
    let brightest = json.color.iter().fold(0.0_f64, |max, part| max.max(*part)) * json.intensity;
    if brightest < MAX_MAGNITUDE || !(json.intensity > 0.0) {
        return Ok(());
    }
    let name = if json.name.is_empty() {
        String::new()
    } else {
        format!(" {:?}", super::super::truncate_for_message(&json.name))
    };
    let intensity = json.intensity;
    Err(GltfError::new(format!(
        "its light lights[{number}]{name} has intensity {intensity:e}, but must stay below {MAX_MAGNITUDE:e}"
    )))
}
