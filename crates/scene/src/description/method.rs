//! The table of rendering methods: what each does, and which settings it honours. Nothing else tells integrators apart.

use crate::choice;

choice! {
    /// Rendering methods.
    pub enum Integrator {
        /// Direct light by Phong, mirror, glass, ambient.
        Whitted = "whitted",
        /// All light, by paths from the eye, without bias.
        Path = "path",
    }
}

/// Properties of a rendering method, and the settings that it honours; it ignores all others of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method {
    /// Whether camera paths are split at glass. Otherwise chance chooses between reflection and refraction.
    pub splits: bool,
    /// Whether paths scatter at rough surfaces, and so find all light by themselves. Otherwise they end there, unless photons are
    /// gathered.
    pub scatters: bool,
    /// Whether `[photons]` is honoured.
    pub gathers: bool,
    /// Whether `shadows` is honoured; otherwise they are soft.
    pub honours_shadows: bool,
    /// Whether `ambient` is honoured, if no photons take its place.
    pub honours_ambient: bool,
    /// Whether `clamp` is honoured.
    pub honours_clamp: bool,
}

impl Integrator {
    /// Its line of the table.
    pub const fn method(self) -> Method {
        match self {
            Self::Whitted => Method {
                splits: true,
                scatters: false,
                gathers: true,
                honours_shadows: true,
                honours_ambient: true,
                honours_clamp: false,
            },
            Self::Path => Method {
                splits: false,
                scatters: true,
                gathers: false,
                honours_shadows: false,
                honours_ambient: false,
                honours_clamp: true,
            },
        }
    }
}
