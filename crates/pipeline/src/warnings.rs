//! Warnings about the effective settings, each with the command-line option or scene key that caused it.

use std::path::PathBuf;

use super::plan::MAX_PHOTONS;
use super::settings::{Overrides, ViewMode};
use crate::choice::Choice;
use crate::integrators::RenderSettings;
use crate::messages::{CLAMP_EFFECT, CLAMP_EFFECT_ON_MODELS};
use crate::scene::LoadedScene;
use crate::scene::description::{MaterialKind, Scene};
use crate::scene::diagnostic::{Diagnostic, Severity};

/// The setting that caused a warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WarnedSetting {
    Integrator,
    Photons,
    PhotonCount,
    Clamp,
    View,
}

/// Returns warnings about a scene's effective settings, which already include `overrides`.
pub(super) fn settings_warnings(
    loaded: &LoadedScene,
    scene: &Scene,
    settings: &RenderSettings,
    overrides: &Overrides,
) -> Vec<Diagnostic> {
    let place = |(cause, message)| warning_at_setting(cause, message, loaded, overrides);
    find_setting_warnings(scene, settings).into_iter().map(place).collect()
}

/// Creates a warning, located at the setting that caused it.
fn warning_at_setting(
    cause: WarnedSetting,
    message: String,
    loaded: &LoadedScene,
    overrides: &Overrides,
) -> Diagnostic {
    let severity = Severity::Warning;
    if let Some(option) = cause.overriding_command_line_option(overrides) {
        let help = Some(format!("caused by `{option}`, not by the scene"));
        return Diagnostic { severity, message, path: PathBuf::new(), place: None, help };
    }
    if cause == WarnedSetting::Clamp && loaded.is_foreign() {
        let message = message.replace(CLAMP_EFFECT, CLAMP_EFFECT_ON_MODELS);
        let help = Some("`--clamp 0` turns it off".to_owned());
        return Diagnostic { severity, message, path: loaded.path.clone(), place: None, help };
    }
    match cause.scene_table_and_key().and_then(|(table, key)| loaded.setting_value_span(table, key)) {
        Some(span) => loaded.create_diagnostic_at(span, severity, message, None),
        None => Diagnostic::about_file(&loaded.path, severity, message),
    }
}

impl WarnedSetting {
    /// Returns the command-line option if it overrides the scene.
    fn overriding_command_line_option(self, overrides: &Overrides) -> Option<String> {
        match self {
            Self::Integrator => overrides.integrator.map(|one| format!("--integrator {}", one.name())),
            Self::Photons => {
                overrides.photons.map(|on| format!("--photons {}", if on { "on" } else { "off" }))
            }
            Self::PhotonCount => None,
            Self::Clamp => overrides.clamp.map(|clamp| format!("--clamp {clamp}")),
            Self::View => overrides.view.map(|view| format!("--view {}", view.name())),
        }
    }

    /// Returns the setting's table and key in the scene file.
    fn scene_table_and_key(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Integrator => Some(("render", "integrator")),
            Self::Photons => Some(("photons", "enabled")),
            Self::PhotonCount => Some(("photons", "count")),
            Self::Clamp => Some(("render", "clamp")),
            Self::View => None,
        }
    }
}

fn find_setting_warnings(scene: &Scene, settings: &RenderSettings) -> Vec<(WarnedSetting, String)> {
    let RenderSettings { render, photons, .. } = &settings.without_ineffective_settings();
    let finds_all_light = render.integrator.properties().scatters;
    let is_specular = |kind: &MaterialKind| kind.has_delta_lobe();
    // These surfaces block shadow rays, and path tracing has no other way to sample light that passes
    // straight through them.
    let keeps_direction = |kind: &MaterialKind| kind.has_delta_lobe() || kind.is_index_matched_glass();
    let has = |is_one: &dyn Fn(&MaterialKind) -> bool| {
        let used = scene.objects.iter().filter_map(|object| object.material);
        used.map(|index| &scene.materials[index].kind).any(is_one)
    };
    let mut warnings = Vec::new();
    let is_sharp_any = scene.lights.iter().any(|light| light.has_emission() && light.is_delta());
    if finds_all_light && is_sharp_any && has(&keeps_direction) {
        let message = "path does not find light from a [[light]] of zero size through mirrors or glass: the caustics \
                       are missing";
        warnings.push((WarnedSetting::Integrator, message.to_owned()));
    }
    if photons.is_some()
        && has(&is_specular)
        && scene.lights.iter().any(|light| light.has_emission() && light.has_disabled_falloff())
    {
        let message = "photons ignore lights with `falloff = \"none\"`: mirrors and glass reflect none of their light onto surfaces";
        warnings.push((WarnedSetting::Photons, message.to_owned()));
    }
    if photons.is_none() && settings.view == ViewMode::Photons {
        let message = "the `photons` view is empty: photons are off or the integrator is `path`";
        warnings.push((WarnedSetting::View, message.to_owned()));
    }
    if photons.is_some() && scene.photons.count > MAX_PHOTONS {
        let message =
            format!("`count` exceeds the maximum of {MAX_PHOTONS} photons per pass, which limits memory use");
        warnings.push((WarnedSetting::PhotonCount, message));
    }
    if render.clamp > 0.0 {
        let message = format!("`clamp = {}` {CLAMP_EFFECT}", render.clamp);
        warnings.push((WarnedSetting::Clamp, message));
    }
    warnings
}
