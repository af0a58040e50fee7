//! What a person should know of the settings that hold, each with what asked for it: an option or the scene.

use std::path::PathBuf;

use super::plan::MOST_PHOTONS;
use super::settings::{Overrides, View};
use crate::choice::Choice;
use crate::integrators::RenderSettings;
use crate::scene::description::{MaterialKind, Scene};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::{Loaded, is_model};

/// The setting that a warning comes of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cause {
    Integrator,
    Photons,
    PhotonCount,
    Clamp,
    View,
}

/// The warnings of a scene by the settings that hold, `overrides` among them.
pub(super) fn cautions(
    loaded: &Loaded,
    scene: &Scene,
    settings: &RenderSettings,
    overrides: &Overrides,
) -> Vec<Diagnostic> {
    let place = |(cause, message)| placed(cause, message, loaded, overrides);
    found(scene, settings).into_iter().map(place).collect()
}

/// Where the setting gets its value.
fn placed(cause: Cause, message: String, loaded: &Loaded, overrides: &Overrides) -> Diagnostic {
    let severity = Severity::Warning;
    if let Some(option) = cause.option(overrides) {
        let help = Some(format!("this comes of the setting `{option}`, not of the scene"));
        return Diagnostic { severity, message, path: PathBuf::new(), place: None, help };
    }
    if cause == Cause::Clamp && is_model(&loaded.path) {
        let message = format!("the light that its polished surfaces throw on others is cut: {message}");
        let help = Some("--clamp 0 shows all of it, with bright dots until many samples".to_owned());
        return Diagnostic { severity, message, path: loaded.path.clone(), place: None, help };
    }
    match cause.key().and_then(|(table, key)| loaded.setting(table, key)) {
        Some(span) => loaded.diagnostic_at(span, severity, message, None),
        None => Diagnostic { severity, message, path: loaded.path.clone(), place: None, help: None },
    }
}

impl Cause {
    /// As it is typed, where it overrides the scene.
    fn option(self, overrides: &Overrides) -> Option<String> {
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

    /// Table and key in a scene.
    fn key(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Integrator => Some(("render", "integrator")),
            Self::Photons => Some(("photons", "enabled")),
            Self::PhotonCount => Some(("photons", "count")),
            Self::Clamp => Some(("render", "clamp")),
            Self::View => None,
        }
    }
}

fn found(scene: &Scene, settings: &RenderSettings) -> Vec<(Cause, String)> {
    let RenderSettings { render, photons, .. } = &settings.effective();
    let finds_all_light = render.integrator.method().scatters;
    let is_specular = |kind: &MaterialKind| kind.has_delta();
    // A ray of a light stops at it, and light that goes straight on has no other way to be found.
    let keeps_direction = |kind: &MaterialKind| kind.has_delta() || kind.is_like_air();
    let has = |is_one: &dyn Fn(&MaterialKind) -> bool| {
        let used = scene.objects.iter().filter_map(|object| object.material);
        used.map(|index| &scene.materials[index].kind).any(is_one)
    };
    let mut warnings = Vec::new();
    let is_sharp_any = scene.lights.iter().any(|light| light.sends() && light.is_sharp());
    if finds_all_light && is_sharp_any && has(&keeps_direction) {
        let message = "path finds no light of a [[light]] without size that passes mirror or glass before it meets a \
                       surface: what they would throw on it stays dark";
        warnings.push((Cause::Integrator, message.to_owned()));
    }
    if photons.is_some()
        && has(&is_specular)
        && scene.lights.iter().any(|light| light.sends() && light.is_steady())
    {
        let message =
            "photons carry no light of `falloff = \"none\"`: mirrors and glass throw none of it on surfaces";
        warnings.push((Cause::Photons, message.to_owned()));
    }
    if photons.is_none() && settings.view == View::Photons {
        let message = "the view `photons` shows nothing: photons are off, or `path` renders";
        warnings.push((Cause::View, message.to_owned()));
    }
    if photons.is_some() && scene.photons.count > MOST_PHOTONS {
        let message =
            format!("a pass sends {MOST_PHOTONS} photons at most, for their memory: `count` is larger");
        warnings.push((Cause::PhotonCount, message));
    }
    if render.clamp > 0.0 {
        let message =
            format!("`clamp` {} makes the picture less noisy, but too dark: it is biased", render.clamp);
        warnings.push((Cause::Clamp, message));
    }
    warnings
}
