//! `[camera]`.

use std::path::PathBuf;

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use super::Located;
use crate::math::DVec3;

/// The view.
#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// Given by vectors; `position` ≠ `look_at`, `up` not parallel to the view.
    LookAt {
        /// The eye.
        position: DVec3,
        /// The point in the middle of the picture.
        look_at: DVec3,
        /// Up in the picture.
        up: DVec3,
        /// Vertical whole angle in degrees, in (0, 180).
        fov: f64,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Distance along the view axis to the plane in focus, > 0.
        focus: f64,
    },
    /// A gKit orbiter file, resolved against the scene's folder.
    Orbiter {
        /// The file.
        file: Located<PathBuf>,
        /// Vertical whole angle in degrees, in (0, 180); none: the file's.
        fov: Option<f64>,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Distance to the plane in focus; none: the file's distance to its centre.
        focus: Option<f64>,
    },
}

impl Camera {
    /// Lens radius, ≥ 0.
    pub fn aperture(&self) -> f64 {
        match self {
            Self::LookAt { aperture, .. } | Self::Orbiter { aperture, .. } => *aperture,
        }
    }
}

impl Fingerprinted for Camera {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::LookAt { position, look_at, up, fov, aperture, focus } => {
                key.index(0).dvec3(*position).dvec3(*look_at).dvec3(*up).f64(*fov).f64(*aperture).f64(*focus);
            }
            // What the file says counts, not its name.
            Self::Orbiter { file: _, fov, aperture, focus } => {
                // 0 is no valid angle and no valid distance.
                key.index(1).f64(*aperture).f64(fov.unwrap_or(0.0)).f64(focus.unwrap_or(0.0));
                key.text(of.orbiter.unwrap_or(""));
            }
        }
    }
}
