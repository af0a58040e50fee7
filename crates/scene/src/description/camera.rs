//! The `[camera]` table: cameras, viewpoints and changes to them.

use std::path::PathBuf;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::Spanned;
use crate::math::DVec3;

/// A scene's camera.
#[derive(Clone, Debug, PartialEq)]
pub enum Camera {
    /// A camera defined by vectors. `position` ≠ `look_at`, and `up` is not parallel to the view direction.
    LookAt {
        /// Position of the camera.
        position: DVec3,
        /// The point at the center of the image.
        look_at: DVec3,
        /// Up direction in the image.
        up: DVec3,
        /// Vertical field of view in degrees, in (0, 180).
        fov: f64,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Focus distance along the view axis, > 0.
        focus: f64,
    },
    /// A camera defined by a gKit orbiter file.
    Orbiter {
        /// The orbiter file.
        file: Spanned<PathBuf>,
        /// Vertical field of view in degrees, in (0, 180). `None` uses the field of view in the file.
        fov: Option<f64>,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Focus distance. `None` focuses on the orbiter's center.
        focus: Option<f64>,
    },
}

/// A camera defined by vectors, created from either kind of [`Camera`]. The fields have the same invariants
/// as those of [`Camera::LookAt`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolvedCamera {
    /// Position and orientation.
    pub pose: Pose,
    /// Vertical field of view in degrees.
    pub fov: f64,
    /// Lens radius.
    pub aperture: f64,
    /// Focus distance along the view axis.
    pub focus: f64,
}

/// Position and orientation of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the camera.
    pub position: DVec3,
    /// The point at the center of the image.
    pub look_at: DVec3,
    /// Up direction in the image.
    pub up: DVec3,
}

/// A change to a camera. `None` keeps the current value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraOverrides {
    /// Position and orientation.
    pub pose: Option<Pose>,
    /// Vertical field of view in degrees, in (0, 180).
    pub fov: Option<f64>,
    /// Focus distance, > 0.
    pub focus: Option<f64>,
}

impl Pose {
    /// Returns the distance from the camera to `look_at`.
    pub fn distance(&self) -> f64 {
        self.position.distance(self.look_at)
    }
}

impl CameraOverrides {
    /// Whether any value changes.
    pub fn has_changes(&self) -> bool {
        *self != Self::default()
    }
}

impl ResolvedCamera {
    /// Returns this camera with a change applied. If the focal plane passes through `look_at` (the default),
    /// the focus follows `look_at`.
    pub fn with_change(&self, change: &CameraOverrides) -> Self {
        let pose = change.pose.unwrap_or(self.pose);
        let focus = if self.is_focused_on_look_at() { pose.distance() } else { self.focus };
        Self {
            pose,
            fov: change.fov.unwrap_or(self.fov),
            focus: change.focus.unwrap_or(focus),
            aperture: self.aperture,
        }
    }

    /// Whether the focal plane passes through `look_at`.
    pub fn is_focused_on_look_at(&self) -> bool {
        self.focus == self.pose.distance()
    }
}

impl From<ResolvedCamera> for Camera {
    fn from(view: ResolvedCamera) -> Self {
        let ResolvedCamera { pose: Pose { position, look_at, up }, fov, aperture, focus } = view;
        Self::LookAt { position, look_at, up, fov, aperture, focus }
    }
}

/// Whether two distances are equal up to the rounding errors of camera moves. Moving one step towards
/// `look_at` changes the distance by 50 times the tolerance.
pub fn is_same_distance(a: f64, b: f64) -> bool {
    const ROUNDING: f64 = 1e-3;
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

impl Camera {
    /// Whether the camera has this viewpoint, up to rounding of the focus distance.
    pub fn is_look_at_matching_view(&self, view: &ResolvedCamera) -> bool {
        match self {
            Self::LookAt { focus, .. } if is_same_distance(*focus, view.focus) => {
                *self == ResolvedCamera { focus: *focus, ..*view }.into()
            }
            Self::LookAt { .. } | Self::Orbiter { .. } => false,
        }
    }

    /// Lens radius, ≥ 0.
    pub fn lens_radius(&self) -> f64 {
        match self {
            Self::LookAt { aperture, .. } | Self::Orbiter { aperture, .. } => *aperture,
        }
    }
}

impl Fingerprinted for Camera {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::LookAt { position, look_at, up, fov, aperture, focus } => {
                key.add_usize(0)
                    .add_dvec3(*position)
                    .add_dvec3(*look_at)
                    .add_dvec3(*up)
                    .add_f64(*fov)
                    .add_f64(*aperture)
                    .add_f64(*focus);
            }
            // Hash the file's contents rather than its name.
            Self::Orbiter { file: _, fov, aperture, focus } => {
                // 0 is neither a valid angle nor a valid distance.
                key.add_usize(1).add_f64(*aperture).add_f64(fov.unwrap_or(0.0)).add_f64(focus.unwrap_or(0.0));
                key.add_str(of.orbiter.unwrap_or(""));
            }
        }
    }
}
