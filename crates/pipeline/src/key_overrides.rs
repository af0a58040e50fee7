//! Settings changed with keys.

use super::settings::{Overrides, ViewMode};
use crate::choice::Choice;
use crate::math::DVec3;
use crate::scene::description::{CameraOverrides, Integrator, Pose, ResolvedCamera, ShadowMode};

/// Settings changed with keys while an image is shown. They override the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KeyboardOverrides {
    /// Shadow type.
    pub shadows: Option<ShadowMode>,
    /// Integrator.
    pub integrator: Option<Integrator>,
    /// Whether to use depth of field.
    pub dof: Option<bool>,
    /// Whether to use photon maps.
    pub photons: Option<bool>,
    /// The view: beauty or an AOV.
    pub view: Option<ViewMode>,
    /// Changes to the scene's camera.
    pub camera: CameraOverrides,
    /// Exposure in stops.
    pub exposure: Option<f32>,
}

impl KeyboardOverrides {
    /// Returns the overrides of a request that keys can change.
    pub(super) fn from_overrides(overrides: &Overrides) -> Self {
        let Overrides { shadows, integrator, dof, photons, view, camera, exposure, .. } = *overrides;
        Self { shadows, integrator, dof, photons, view, camera, exposure }
    }

    /// Adds the changes to overrides from the command line.
    pub fn merged_with_command_line(&self, command_line: &Overrides) -> Overrides {
        Overrides {
            shadows: self.shadows.or(command_line.shadows),
            integrator: self.integrator.or(command_line.integrator),
            dof: self.dof.or(command_line.dof),
            photons: self.photons.or(command_line.photons),
            view: self.view.or(command_line.view),
            camera: self.camera,
            exposure: self.exposure.or(command_line.exposure),
            ..command_line.clone()
        }
    }

    /// Formats the settings as command-line options. A camera position replaces the scene's orbiter camera,
    /// so the options then also include the field of view and focus of `orbiter`.
    pub fn as_command_line_options(&self, orbiter: Option<ResolvedCamera>) -> Vec<String> {
        let on_off = |is_on: bool| if is_on { "on" } else { "off" };
        let vector = |key: &str, DVec3 { x, y, z }: DVec3| format!("--set 'camera.{key}=[{x},{y},{z}]'");
        let CameraOverrides { pose, fov, view_height, focus } = self.camera;
        let mut options: Vec<String> = [
            self.integrator.map(|it| format!("--integrator {}", it.name())),
            self.shadows.map(|it| format!("--shadows {}", it.name())),
            self.photons.map(|it| format!("--photons {}", on_off(it))),
            self.dof.map(|it| format!("--dof {}", on_off(it))),
            self.view.map(|it| format!("--view {}", it.name())),
            self.exposure.map(|it| format!("--set render.exposure={it}")),
        ]
        .into_iter()
        .flatten()
        .collect();
        if let Some(Pose { position, look_at, up }) = pose {
            options.extend(
                [("position", position), ("look_at", look_at), ("up", up)]
                    .map(|(key, value)| vector(key, value)),
            );
        }
        let orbiter = orbiter.filter(|_| pose.is_some());
        let fov = fov.or(orbiter.and_then(|camera| camera.projection.fov()));
        let focus = focus.or(orbiter.filter(|camera| camera.aperture > 0.0).map(|camera| camera.focus));
        options.extend(fov.map(|it| format!("--set camera.fov={it}")));
        options.extend(view_height.map(|it| format!("--set camera.view_height={it}")));
        options.extend(focus.map(|it| format!("--set camera.focus={it}")));
        options
    }

    /// Describes settings that differ from `before`. If `is_camera_written`, a camera reset is omitted
    /// because it only reflects the camera's move into the scene.
    pub fn describe_changes_since(&self, before: &Self, is_camera_written: bool) -> Vec<String> {
        let on_off = |is_on: bool| if is_on { "on" } else { "off" }.to_owned();
        let camera = self.camera.has_changes().then(|| "moved".to_owned());
        let name = |name: &str| name.to_owned();
        let all = [
            ("shadows", self.shadows != before.shadows, self.shadows.map(|it| name(it.name()))),
            ("integrator", self.integrator != before.integrator, self.integrator.map(|it| name(it.name()))),
            ("dof", self.dof != before.dof, self.dof.map(on_off)),
            ("photons", self.photons != before.photons, self.photons.map(on_off)),
            ("view", self.view != before.view, self.view.map(|it| name(it.name()))),
            ("camera", self.camera != before.camera && !(is_camera_written && camera.is_none()), camera),
            ("exposure", self.exposure != before.exposure, self.exposure.map(format_exposure_stops)),
        ];
        let differing = || all.iter().filter(|(_, differs, _)| *differs);
        let now = differing().filter_map(|(name, _, now)| Some(format!("{name} {}", now.as_ref()?)));
        // Settings that were reset are grouped together.
        let back: Vec<&str> = differing().filter(|it| it.2.is_none()).map(|it| it.0).collect();
        let back = (!back.is_empty()).then(|| format!("{} reset", join_names(&back)));
        now.chain(back).collect()
    }
}

/// Joins names: `a`, `a and b`, `a, b and c`.
fn join_names(names: &[&str]) -> String {
    match names {
        [rest @ .., last] if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}

/// Formats exposure stops with a sign.
pub fn format_exposure_stops(stops: f32) -> String {
    match stops {
        0.0 => "0".to_owned(),
        stops if stops < 0.0 => format!("−{}", -stops),
        stops => format!("+{stops}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_uses_a_minus_sign() {
        assert_eq!([-0.25, 0.0, 1.5].map(format_exposure_stops), ["−0.25", "0", "+1.5"]);
    }
}
