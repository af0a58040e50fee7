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
        /// Vertical whole angle in degrees, in (0, 180). `None` for the file's angle.
        fov: Option<f64>,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Distance to the plane in focus. `None` for the file's distance to its centre.
        focus: Option<f64>,
    },
}

/// A camera by vectors, however the scene gives it. What [`Camera::LookAt`] says of its fields holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position and orientation.
    pub pose: Pose,
    /// Vertical whole angle in degrees.
    pub fov: f64,
    /// Lens radius.
    pub aperture: f64,
    /// Distance along the view axis to the plane in focus.
    pub focus: f64,
}

/// Position of a camera, the point that it looks at, and its upward direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The eye.
    pub position: DVec3,
    /// The point in the middle of the picture.
    pub look_at: DVec3,
    /// Up in the picture.
    pub up: DVec3,
}

/// Changes of a camera; `None` leaves its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraChange {
    /// Position and orientation.
    pub pose: Option<Pose>,
    /// Vertical whole angle in degrees, in (0, 180).
    pub fov: Option<f64>,
    /// Distance to the plane in focus, > 0.
    pub focus: Option<f64>,
}

impl Pose {
    /// From the eye to the point that it looks at.
    pub fn distance(&self) -> f64 {
        self.position.distance(self.look_at)
    }
}

impl CameraChange {
    /// Whether it changes anything.
    pub fn is_any(&self) -> bool {
        *self != Self::default()
    }
}

impl Viewpoint {
    /// With a change. Where the plane in focus goes through `look_at`, as it does in a scene that does not say, it stays there.
    pub fn changed(&self, change: &CameraChange) -> Self {
        let pose = change.pose.unwrap_or(self.pose);
        let focus = if self.is_focused_on_look_at() { pose.distance() } else { self.focus };
        Self {
            pose,
            fov: change.fov.unwrap_or(self.fov),
            focus: change.focus.unwrap_or(focus),
            aperture: self.aperture,
        }
    }

    /// Whether the plane in focus goes through `look_at`.
    pub fn is_focused_on_look_at(&self) -> bool {
        self.focus == self.pose.distance()
    }
}

impl From<Viewpoint> for Camera {
    fn from(view: Viewpoint) -> Self {
        let Viewpoint { pose: Pose { position, look_at, up }, fov, aperture, focus } = view;
        Self::LookAt { position, look_at, up, fov, aperture, focus }
    }
}

/// Whether two distances differ by no more than the rounding of a camera's steps; a step nearer is fifty times as long.
pub fn is_same_distance(a: f64, b: f64) -> bool {
    const ROUNDING: f64 = 1e-3;
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

impl Camera {
    /// Whether it is this view, but for what rounding makes of the distance to what is in focus.
    pub fn is_nearly(&self, view: &Viewpoint) -> bool {
        match self {
            Self::LookAt { focus, .. } if is_same_distance(*focus, view.focus) => {
                *self == Viewpoint { focus: *focus, ..*view }.into()
            }
            Self::LookAt { .. } | Self::Orbiter { .. } => false,
        }
    }

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
