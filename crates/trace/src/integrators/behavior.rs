//! How paths continue at surfaces, derived from the integrator's method, the view and photon mapping.

use super::settings::RenderSettings;
use super::view::PathAov;
use crate::lights::LightSamplingPurpose;
use crate::scene::description::IntegratorProperties;

/// How camera paths continue at surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathBehavior {
    /// Whether camera paths split into a reflected and a refracted path at glass.
    pub splits: bool,
    /// Whether paths scatter at non-specular surfaces. True for `path`, and for `whitted` with photons, where
    /// scattered paths find the light that photons do not account for.
    pub scatters: bool,
    /// Whether paths continue in microfacet lobes but end at other non-specular surfaces.
    pub mirrors: bool,
    /// Whether photons are gathered at non-specular surfaces. If so, a path that hits a light via mirrors or
    /// glass ignores this light.
    pub gathers: bool,
    /// How lights are sampled.
    pub receivers: LightSamplingPurpose,
}

impl PathBehavior {
    /// Derives the path behavior from the settings and the presence of photon maps.
    pub fn from_settings(settings: &RenderSettings, has_photons: bool) -> Self {
        let IntegratorProperties { splits, scatters, gathers, .. } = settings.render.integrator.properties();
        let gathers = gathers && has_photons;
        match settings.view.aov_source().light_transport_aov_or_all() {
            // The lit fraction is measured at the first visible surface, where all lights are sampled.
            PathAov::LitFraction => Self {
                splits: true,
                scatters: gathers,
                mirrors: false,
                gathers,
                receivers: LightSamplingPurpose::Eye,
            },
            PathAov::Radiance(_) | PathAov::TraversalCost => {
                let scatters = scatters || gathers;
                let receivers =
                    if scatters { LightSamplingPurpose::Paths } else { LightSamplingPurpose::Eye };
                Self { splits, scatters, mirrors: !scatters, gathers, receivers }
            }
        }
    }
}

/// Determines how lights are sampled, based on the settings and on whether photons are gathered.
pub fn light_sampling_purpose(settings: &RenderSettings, are_gathered: bool) -> LightSamplingPurpose {
    PathBehavior::from_settings(settings, are_gathered).receivers
}
