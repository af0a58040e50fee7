//! Behaviour of the rays of a picture: the scene's table of methods, as far as the view and photons let it apply.

use super::settings::RenderSettings;
use super::view::Measure;
use crate::lights::Receivers;
use crate::scene::description::Method;

/// Behaviour of the rays of a picture at surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Behaviour {
    /// Whether camera paths are split at glass.
    pub splits: bool,
    /// Whether paths scatter at rough surfaces: by the method, or in whitted to find what photons do not bring.
    pub scatters: bool,
    /// Whether rays in the lobes of microfacets go on, where other paths end.
    pub mirrors: bool,
    /// Whether photons are gathered at rough surfaces; then paths leave to them the light behind mirrors and glass.
    pub gathers: bool,
    /// Purpose of light samples.
    pub receivers: Receivers,
}

impl Behaviour {
    /// The behaviour with these settings, with photon maps or without.
    pub fn of(settings: &RenderSettings, has_photons: bool) -> Self {
        let Method { splits, scatters, gathers, .. } = settings.render.integrator.method();
        let gathers = gathers && has_photons;
        match settings.view.shown().measure() {
            // The share of the lamps' light that arrives is measured at the first visible surface, for which all light is sampled.
            Measure::ArrivingShare => {
                Self { splits: true, scatters: gathers, mirrors: false, gathers, receivers: Receivers::Eye }
            }
            Measure::Radiance(_) | Measure::Work => {
                let scatters = scatters || gathers;
                let receivers = if scatters { Receivers::Paths } else { Receivers::Eye };
                Self { splits, scatters, mirrors: !scatters, gathers, receivers }
            }
        }
    }
}

/// Purpose of light samples with these settings, with photons or without.
pub fn receivers(settings: &RenderSettings, are_gathered: bool) -> Receivers {
    Behaviour::of(settings, are_gathered).receivers
}
