//! The `[camera]` table: cameras, viewpoints and changes to them.

use std::path::PathBuf;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::Spanned;
use crate::choice;
use crate::math::{DVec2, DVec3};

choice! {
    /// Values of the key `projection`.
    pub enum ProjectionKind {
        /// Rays through one point, onto a flat image.
        Perspective = "perspective",
        /// Parallel rays: the size of an object in the image does not depend on its distance.
        Orthographic = "orthographic",
        /// All directions, as in an environment map; `look_at` is at the center.
        Panorama = "panorama",
        /// A circle in which the distance from the center is proportional to the angle from the view axis.
        Fisheye = "fisheye",
    }
}

/// Mapping from image positions to rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays through one point, onto a flat image.
    Perspective {
        /// Vertical field of view in degrees, in (0, 180).
        fov: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Height of the image in scene units, > 0.
        view_height: f64,
    },
    /// Equirectangular image of all directions, stretched to the image's size.
    Spherical,
    /// Equidistant fisheye: the distance from the image center is proportional to the angle from the view
    /// axis. The image is black outside a circle as high as the image.
    Fisheye {
        /// Angle across the circle in degrees, in (0, 360].
        fov: f64,
    },
}

impl Projection {
    /// Value of the key `projection`.
    pub fn kind(self) -> ProjectionKind {
        match self {
            Self::Perspective { .. } => ProjectionKind::Perspective,
            Self::Orthographic { .. } => ProjectionKind::Orthographic,
            Self::Spherical => ProjectionKind::Panorama,
            Self::Fisheye { .. } => ProjectionKind::Fisheye,
        }
    }

    /// Field of view in degrees, or `None` if the projection has no field of view.
    pub fn fov(self) -> Option<f64> {
        match self {
            Self::Perspective { fov } | Self::Fisheye { fov } => Some(fov),
            Self::Orthographic { .. } | Self::Spherical => None,
        }
    }

    /// Height of the image in scene units, or `None` unless the projection is orthographic.
    pub fn view_height(self) -> Option<f64> {
        match self {
            Self::Orthographic { view_height } => Some(view_height),
            Self::Perspective { .. } | Self::Spherical | Self::Fisheye { .. } => None,
        }
    }

    /// Whether the camera has a lens, which can be out of focus.
    pub fn supports_depth_of_field(self) -> bool {
        match self {
            Self::Perspective { .. } | Self::Orthographic { .. } => true,
            Self::Spherical | Self::Fisheye { .. } => false,
        }
    }

    /// Returns the projection with another field of view or image height, if it has one.
    pub fn with_fov_or_view_height(self, fov: Option<f64>, view_height: Option<f64>) -> Self {
        match self {
            Self::Perspective { fov: own } => Self::Perspective { fov: fov.unwrap_or(own) },
            Self::Orthographic { view_height: own } => {
                Self::Orthographic { view_height: view_height.unwrap_or(own) }
            }
            Self::Spherical => Self::Spherical,
            Self::Fisheye { fov: own } => Self::Fisheye { fov: fov.unwrap_or(own) },
        }
    }
}

/// Part of the image plane that the image shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageShiftAndMirror {
    /// Offset of the window to the right and up, in units of the image height.
    pub shift: DVec2,
    /// Whether the image is flipped horizontally, after the shift.
    pub mirror: bool,
}

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
        /// Mapping from image positions to rays.
        projection: Projection,
        /// Part of the image plane that the image shows.
        window: ImageShiftAndMirror,
        /// Lens radius, ≥ 0.
        aperture: f64,
        /// Focus distance along the view axis, > 0.
        focus: f64,
    },
    /// A camera defined by a gKit orbiter file.
    Orbiter {
        /// The orbiter file.
        file: Spanned<PathBuf>,
        /// Mapping from image positions to rays. `None` is a perspective with the field of view in the file.
        projection: Option<Projection>,
        /// Part of the image plane that the image shows.
        window: ImageShiftAndMirror,
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
    /// Mapping from image positions to rays.
    pub projection: Projection,
    /// Part of the image plane that the image shows.
    pub window: ImageShiftAndMirror,
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
    /// Field of view in degrees, in the projection's range. Ignored by projections without one.
    pub fov: Option<f64>,
    /// Height of an orthographic image in scene units, > 0. Ignored by other projections.
    pub view_height: Option<f64>,
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
            projection: self.projection.with_fov_or_view_height(change.fov, change.view_height),
            focus: change.focus.unwrap_or(focus),
            ..*self
        }
    }

    /// Whether the focal plane passes through `look_at`.
    pub fn is_focused_on_look_at(&self) -> bool {
        self.focus == self.pose.distance()
    }
}

impl From<ResolvedCamera> for Camera {
    fn from(view: ResolvedCamera) -> Self {
        let ResolvedCamera { pose: Pose { position, look_at, up }, projection, window, aperture, focus } =
            view;
        Self::LookAt { position, look_at, up, projection, window, aperture, focus }
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
    pub fn is_nearly_equal_to_view(&self, view: &ResolvedCamera) -> bool {
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

impl Fingerprinted for Projection {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let size = self.fov().or(self.view_height());
        key.add_choice_name(self.kind()).add_f64(size.unwrap_or(0.0));
    }
}

impl Fingerprinted for Camera {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let window = match self {
            Self::LookAt { position, look_at, up, projection, window, aperture, focus } => {
                key.add_usize(0)
                    .add_dvec3(*position)
                    .add_dvec3(*look_at)
                    .add_dvec3(*up)
                    .add_with_references(projection, of)
                    .add_f64(*aperture)
                    .add_f64(*focus);
                window
            }
            // Hash the file's contents rather than its name.
            Self::Orbiter { file: _, projection, window, aperture, focus } => {
                key.add_usize(1).add_f64(*aperture).add_bool(projection.is_some());
                if let Some(projection) = projection {
                    key.add_with_references(projection, of);
                }
                // 0 is not a valid distance.
                key.add_f64(focus.unwrap_or(0.0)).add_str(of.orbiter.unwrap_or(""));
                window
            }
        };
        key.add_f64(window.shift.x).add_f64(window.shift.y).add_bool(window.mirror);
    }
}
