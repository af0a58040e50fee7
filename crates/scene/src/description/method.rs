//! Properties and supported settings of the integrators. Other code queries these properties instead of
//! matching on the integrator.

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

/// Properties and supported settings of an integrator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// Whether camera paths split at glass. Otherwise, they choose randomly between reflection and
    /// refraction.
    pub splits: bool,
    /// Whether paths scatter at rough surfaces and thus find all light. Otherwise, paths end at rough
    /// surfaces, unless photons are gathered.
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
    /// Returns the properties of the integrator.
    pub const fn method(self) -> Method {
        match self {
            Self::Whitted => Method {
                splits: true,
                scatters: false,
                gathers: true,
                honors_shadows: true,
                honors_ambient: true,
                honors_clamp: false,
            },
            Self::Path => Method {
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
