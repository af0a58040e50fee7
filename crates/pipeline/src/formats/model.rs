//! The scenes that glimt generates for models: a camera, lights and a ground plane.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::frame::{
    CameraPose, KEY_LIGHT_IRRADIANCE, SKY_RADIANCE, ground_reflectance_matching_sky,
    key_light_travel_direction, round_to_decimals_of_step,
};
use super::rounding::{round_significant, shorten_number, shorten_vector};
use crate::assets::gltf::ModelProjection;
use crate::math::DVec3;
use crate::scene::SceneDocumentBuilder;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::fingerprint::FingerprintHasher;
use crate::settings::{Overrides, UpAxis, ViewSide};

/// View of a model, as specified on the command line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelViewOptions {
    /// Side facing the camera. `None` uses the camera in the file, or [`ViewSide::Iso`] if there is none.
    pub(crate) from: Option<ViewSide>,
    /// Aspect ratio of the image, or `None` if the command line sets neither width nor height.
    pub(crate) aspect: Option<f64>,
    /// Up axis of a mesh file. `None` uses the format's default.
    pub(crate) up: Option<UpAxis>,
    /// Number of turntable frames, or 1 for a still image. The model must fit in all of them.
    pub(crate) turns: u32,
}

/// Default width and height of the image.
pub(super) const DEFAULT_SIZE: [f64; 2] = [640.0, 480.0];

impl Default for ModelViewOptions {
    fn default() -> Self {
        Self { from: None, aspect: None, up: None, turns: 1 }
    }
}

impl ModelViewOptions {
    /// Returns the view specified on the command line.
    pub(crate) fn from_overrides(overrides: &Overrides) -> Self {
        let aspect = match (overrides.width, overrides.height) {
            (None, None) => None,
            (width, height) => {
                let or = |given: Option<u32>, usual: f64| given.map_or(usual, f64::from);
                Some(or(width, DEFAULT_SIZE[0]) / or(height, DEFAULT_SIZE[1]))
            }
        };
        Self {
            from: overrides.from,
            aspect,
            up: overrides.up,
            turns: overrides.turn.map_or(1, |turn| turn.of),
        }
    }

    /// Adds all fields to a fingerprint.
    pub(crate) fn add_to_fingerprint(self, key: &mut FingerprintHasher) {
        key.add_bool(self.from.is_some());
        if let Some(from) = self.from {
            key.add_choice_name(from);
        }
        key.add_bool(self.up.is_some());
        if let Some(up) = self.up {
            key.add_choice_name(up);
        }
        key.add_f64(self.aspect.unwrap_or_default()).add_u64(self.turns.into());
    }
}

/// Creates a warning about a model.
pub(super) fn model_warning(path: &Path, message: impl Into<String>) -> Diagnostic {
    Diagnostic::about_file(path, Severity::Warning, message.into())
}

/// Returns the last component of a path.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Limit on indirect radiance per bounce: four times the sky's radiance. It is used for scenes with polished
/// surfaces, in which caustics from the key light would appear as fireflies at low sample counts.
const POLISHED_CLAMP: f64 = 2.0;
/// Roughness above which surfaces do not cause fireflies. At 64 samples, clamping changes the error by a
/// quarter at roughness 0.4, but by a factor of ten at roughness 0.2.
pub(super) const POLISHED_ROUGHNESS: f64 = 0.3;
/// Phong exponent with a highlight as narrow as a GGX lobe of roughness [`POLISHED_ROUGHNESS`]: 2/α² − 2 with
/// α = roughness².
pub(super) const POLISHED_EXPONENT: f32 = 245.0;

/// Lighting for a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lighting {
    /// A default sky and key light.
    Default {
        /// Whether any surface is polished.
        is_polished: bool,
    },
    /// The lights from the file, plus a sky scaled to match their brightness.
    FromFile {
        /// Exposure in stops, never positive, to compensate for bright lights.
        exposure: f64,
    },
}

impl Lighting {
    /// Creates lighting that uses the file's lights. `irradiance` is their irradiance on the model.
    pub(super) fn from_file_light_irradiance(irradiance: f64) -> Self {
        // At this irradiance, a white surface is as bright as under the default lights.
        const USUAL_IRRADIANCE: f64 = 3.0;
        let over = (irradiance / USUAL_IRRADIANCE).max(1.0);
        // A light very close to the model would otherwise push the sky's radiance out of the valid range.
        const MAX_STOPS: f64 = 40.0;
        Self::FromFile { exposure: -(libm::log2(over).min(MAX_STOPS) * 10.0).round() / 10.0 }
    }

    /// Radiance of the sky.
    fn uniform_sky_radiance(self) -> f64 {
        match self {
            Self::Default { .. } => SKY_RADIANCE,
            Self::FromFile { exposure } => round_significant(SKY_RADIANCE * libm::exp2(-exposure), 3),
        }
    }
}

/// Adds the `[render]` table.
pub(super) fn add_render_settings(
    document: &mut SceneDocumentBuilder,
    size: Option<[f64; 2]>,
    light: Lighting,
) {
    document.start_table("render");
    if let Some([width, height]) = size {
        document.set("width", width);
        document.set("height", height);
    }
    document.set("samples", 256.0);
    document.set("error", 0.05);
    document.set("integrator", "path");
    match light {
        Lighting::Default { is_polished: true } => document.set("clamp", POLISHED_CLAMP),
        Lighting::Default { is_polished: false } => {}
        Lighting::FromFile { exposure } if exposure != 0.0 => document.set("exposure", exposure),
        Lighting::FromFile { .. } => {}
    }
}

/// Adds the `[camera]` table. Keeps all digits of the points, because a small model may be far from the
/// origin.
pub(super) fn add_camera_table(
    document: &mut SceneDocumentBuilder,
    eye: &CameraPose,
    projection: ModelProjection,
) {
    document.start_table("camera");
    document.set("position", eye.position);
    document.set("look_at", eye.look_at);
    if eye.up != DVec3::Y {
        document.set("up", shorten_vector(eye.up));
    }
    match projection {
        ModelProjection::Perspective { fov: 40.0 } => {}
        ModelProjection::Perspective { fov } => document.set("fov", shorten_number(fov)),
        ModelProjection::Orthographic { view_height } => {
            document.set("projection", "orthographic");
            document.set("view_height", shorten_number(view_height));
        }
    }
}

/// Adds a sky, plus a key light if the model has no lights.
pub(super) fn add_lighting(document: &mut SceneDocumentBuilder, eye: &CameraPose, light: Lighting) {
    document.start_table("environment");
    document.set("color", shorten_number(light.uniform_sky_radiance()));
    if matches!(light, Lighting::Default { .. }) {
        document.start_list_table("light");
        document.set("type", "directional");
        document.set("direction", shorten_vector(key_light_travel_direction(eye)));
        document.set("irradiance", KEY_LIGHT_IRRADIANCE);
        document.set("angle", 6.0);
    }
}

/// Adds a ground plane below the model, unless the camera is below it.
pub(super) fn add_ground(
    document: &mut SceneDocumentBuilder,
    names: &mut UsedNames,
    [min, max]: [DVec3; 2],
    eye: &CameraPose,
) {
    let size = (max - min).length();
    let height = min.y - size * 1e-4;
    if eye.position.y <= height {
        return;
    }
    let name = names.make_unique("ground", "ground");
    document.start_named_table("materials", &name);
    document.set("diffuse", shorten_number(ground_reflectance_matching_sky()));
    document.start_list_table("plane");
    document.set("point", [0.0, round_to_decimals_of_step(height, size * 1e-5), 0.0]);
    document.set("material", name);
}

/// Names already used in a generated scene.
#[derive(Debug, Default)]
pub(super) struct UsedNames {
    names: HashSet<String>,
    /// The next number to append, by name.
    next_numbers: HashMap<String, usize>,
}

impl UsedNames {
    /// Returns `wanted`, with a number appended if it is taken. Falls back to `usual` if `wanted` is empty or
    /// a number.
    pub(super) fn make_unique(&mut self, wanted: &str, usual: &str) -> String {
        let plain: String = wanted.chars().filter(|c| !c.is_control()).take(100).collect();
        let plain = plain.trim();
        let is_name = plain.parse::<f64>().is_err() && !plain.is_empty();
        let plain = if is_name { plain } else { usual };
        if self.names.insert(plain.to_owned()) {
            return plain.to_owned();
        }
        // Many objects can have the same name, so continue with the number after the last one.
        let next = self.next_numbers.entry(plain.to_owned()).or_insert(2);
        loop {
            let name = format!("{plain}_{next}");
            *next += 1;
            if self.names.insert(name.clone()) {
                return name;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found_quickly() {
        let mut names = UsedNames::default();
        let first: Vec<_> = ["a", "a_3", "a", "a"].map(|one| names.make_unique(one, "shape")).into();
        assert_eq!(first, ["a", "a_3", "a_2", "a_4"]);
        // Quadratic time would be minutes.
        let last = (0..200_000).map(|_| names.make_unique("a", "shape")).last();
        assert_eq!(last.as_deref(), Some("a_200004"));
    }
}
