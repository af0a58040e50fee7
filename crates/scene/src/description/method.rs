//! Properties of the integrators, and the settings they support. Other code queries these properties instead
//! of matching on the integrator.

use crate::choice;

choice! {
    /// Integrators.
    pub enum Integrator {
        /// Whitted ray tracing: direct light, mirrors, glass and ambient light.
        Whitted = "whitted",
        /// Unbiased path tracing.
        Path = "path",
    }
}

/// Properties of an integrator, and the settings it supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntegratorProperties {
    /// Whether camera paths split at glass, rather than randomly choosing between reflection and refraction.
    pub splits: bool,
    /// Whether paths continue at rough surfaces and thus account for all light. If not, they end at rough
    /// surfaces, unless they gather photons.
    pub scatters: bool,
    /// Whether `[photons]` is supported.
    pub gathers: bool,
    /// Whether `shadows` is supported. If not, shadows are soft.
    pub honors_shadows: bool,
    /// Whether `ambient` is supported. Photons replace ambient light.
    pub honors_ambient: bool,
    /// Whether `clamp` is supported.
    pub honors_clamp: bool,
}

impl Integrator {
    /// Returns the integrator's properties.
    pub const fn properties(self) -> IntegratorProperties {
        match self {
            Self::Whitted => IntegratorProperties {
                splits: true,
                scatters: false,
                gathers: true,
                honors_shadows: true,
                honors_ambient: true,
                honors_clamp: false,
            },
            Self::Path => IntegratorProperties {
                splits: false,
                scatters: true,
                gathers: false,
                honors_shadows: false,
                honors_ambient: false,
                honors_clamp: true,
            },
        }
    }
}
