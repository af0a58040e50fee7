//! Pinhole and thin-lens camera.

use crate::assets::GkitOrbiterCamera;
use crate::geometry::Ray;
use crate::math::decimal::{decimal_step_at_distance, round_to_step};
use crate::math::transform::rotation_xyz;
use crate::math::{DMat3, DVec2, DVec3, Vec2};
use crate::scene::description::{self, Pose, ResolvedCamera};

/// A perspective camera with a plane of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Center of the lens.
    pub position: DVec3,
    /// Orthonormal axes: image right, image up, and view direction.
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Tangent of half the vertical field of view.
    tan_half_fov: f64,
    /// Lens radius, or 0 for a pinhole.
    pub aperture: f64,
    /// Distance to the plane of focus along the view axis.
    pub focus: f64,
}

impl Camera {
    /// Creates the camera described by the scene, using the contents of the orbiter file if there is one.
    pub fn from_description(camera: &description::Camera, orbiter: Option<&GkitOrbiterCamera>) -> Self {
        match camera {
            description::Camera::LookAt { position, look_at, up, fov, aperture, focus } => {
                let forward = (*look_at - *position).normalize();
                let right = forward.cross(*up).normalize();
                Self {
                    position: *position,
                    right,
                    up: right.cross(forward),
                    forward,
                    tan_half_fov: libm::tan(fov.to_radians() * 0.5),
                    aperture: *aperture,
                    focus: *focus,
                }
            }
            description::Camera::Orbiter { fov, aperture, focus, .. } => {
                let file = orbiter.copied().unwrap_or(DEFAULT_ORBITER);
                let orbiter = GkitOrbiterCamera { fov: fov.unwrap_or(file.fov), ..file };
                Self {
                    aperture: *aperture,
                    focus: focus.unwrap_or(orbiter.size),
                    ..Self::from_orbiter(&orbiter)
                }
            }
        }
    }

    /// Returns the point that the camera orbits, and the distance to it.
    pub fn target_and_distance(
        camera: &description::Camera,
        orbiter: Option<&GkitOrbiterCamera>,
    ) -> (DVec3, f64) {
        match camera {
            description::Camera::LookAt { position, look_at, .. } => (*look_at, position.distance(*look_at)),
            description::Camera::Orbiter { .. } => {
                let orbiter = orbiter.copied().unwrap_or(DEFAULT_ORBITER);
                (DVec3::from_array(orbiter.center), orbiter.size)
            }
        }
    }

    /// Returns the camera as position, target and up vector. An orbiter camera is rounded to short decimals,
    /// precise enough to render the same view. Its target is the point on the view axis at the distance of
    /// the orbiter's center.
    pub fn look_at_from_description(
        camera: &description::Camera,
        orbiter: Option<&GkitOrbiterCamera>,
    ) -> ResolvedCamera {
        match camera {
            description::Camera::LookAt { position, look_at, up, fov, aperture, focus } => ResolvedCamera {
                pose: Pose { position: *position, look_at: *look_at, up: *up },
                fov: *fov,
                aperture: *aperture,
                focus: *focus,
            },
            description::Camera::Orbiter { fov, focus, .. } => {
                let file = orbiter.copied().unwrap_or(DEFAULT_ORBITER);
                let Self { position, up, forward, aperture, .. } =
                    Self::from_description(camera, Some(&file));
                let look_at = position + forward * file.size;
                let short = |place: DVec3| {
                    DVec3::from_array(
                        place.to_array().map(|at| round_to_step(at, decimal_step_at_distance(file.size))),
                    )
                };
                let (position, look_at) = (short(position), short(look_at));
                // An orbiter does not roll. Unless it is upside down, y points up in the image.
                let is_upright = up.y > UPRIGHT;
                let pose = Pose { position, look_at, up: if is_upright { DVec3::Y } else { up } };
                let focus = focus.unwrap_or_else(|| pose.distance());
                ResolvedCamera { pose, fov: fov.unwrap_or(file.fov), aperture, focus }
            }
        }
    }

    /// Converts the camera to coordinates relative to `origin`.
    pub fn relative_to(self, origin: DVec3) -> Self {
        Self { position: self.position - origin, ..self }
    }

    /// Camera of a gKit orbiter. The world-to-camera transform is T(−p, −size)·Rx(r.x)·Ry(r.y)·T(−center).
    fn from_orbiter(orbiter: &GkitOrbiterCamera) -> Self {
        let [x, y] = orbiter.rotation;
        // `rotation_xyz` rotates about x first, but the orbiter rotates about y first.
        let view: DMat3 = rotation_xyz(DVec3::new(x, 0.0, 0.0)) * rotation_xyz(DVec3::new(0.0, y, 0.0));
        let axes = view.transpose();
        let eye = DVec3::new(orbiter.position[0], orbiter.position[1], orbiter.size);
        Self {
            position: DVec3::from_array(orbiter.center) + axes * eye,
            right: axes.x_axis,
            up: axes.y_axis,
            forward: -axes.z_axis,
            tan_half_fov: libm::tan(orbiter.fov.to_radians() * 0.5),
            aperture: 0.0,
            focus: orbiter.size,
        }
    }

    /// Returns the camera ray through an image point and a point on the unit lens disk. Its direction is
    /// normalized. `place` is measured from the image center to the right and up, in units of half the image
    /// height.
    #[inline(always)]
    pub fn ray(&self, place: DVec2, lens: Vec2) -> Ray {
        let direction = self.image_point_direction(place);
        let lens = lens.as_dvec2() * self.aperture;
        let offset = self.right * lens.x + self.up * lens.y;
        let aimed = direction - offset / self.focus;
        Ray::new((self.position + offset).as_vec3(), aimed.normalize().as_vec3())
    }

    /// Like [`Camera::ray`], but through the lens center.
    #[inline(always)]
    pub fn pinhole_ray(&self, place: DVec2) -> Ray {
        Ray::new(self.position.as_vec3(), self.image_point_direction(place).normalize().as_vec3())
    }

    /// Unnormalized direction from the lens center through an image point. Its component along the view axis
    /// is 1.
    #[inline(always)]
    fn image_point_direction(&self, place: DVec2) -> DVec3 {
        let place = place * self.tan_half_fov;
        self.forward + self.right * place.x + self.up * place.y
    }

    /// Width of a pixel's footprint per unit of distance, at the center of an image with `rows` rows.
    pub fn pixel_spread(&self, rows: u32) -> f32 {
        (2.0 * self.tan_half_fov / f64::from(rows)) as f32
    }

    /// Depth of a point along the view axis.
    pub fn depth_of(&self, point: DVec3) -> f64 {
        (point - self.position).dot(self.forward)
    }
}

/// Minimum y component of the up axis for a camera that is neither upside down nor looking straight up or
/// down.
const UPRIGHT: f64 = 1e-3;

/// Orbiter used if the orbiter file is missing. The pipeline reports the missing file as an error first.
const DEFAULT_ORBITER: GkitOrbiterCamera = GkitOrbiterCamera {
    center: [0.0; 3],
    position: [0.0; 2],
    rotation: [0.0; 2],
    size: 1.0,
    radius: 1.0,
    fov: 45.0,
    width: 1.0,
    height: 1.0,
};

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    fn look_at(aperture: f64) -> Camera {
        let camera = description::Camera::LookAt {
            position: DVec3::new(0.0, 1.0, 4.0),
            look_at: DVec3::new(0.0, 1.0, 0.0),
            up: DVec3::Y,
            fov: 90.0,
            aperture,
            focus: 4.0,
        };
        Camera::from_description(&camera, None)
    }

    #[test]
    fn rays_pass_through_image_points() {
        let camera = look_at(0.0);
        let direction = |x, y| camera.ray(DVec2::new(x, y), Vec2::ZERO).direction;
        assert!((direction(0.0, 0.0) - Vec3::NEG_Z).length() < 1e-6);
        assert!((direction(0.0, 1.0) - Vec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-6);
        assert!((direction(2.0, 0.0) - Vec3::new(2.0, 0.0, -1.0).normalize()).length() < 1e-6);
    }

    #[test]
    fn focal_plane_is_sharp_for_all_lens_points() {
        let camera = look_at(0.5);
        let on_plane = |lens| {
            let ray = camera.ray(DVec2::new(0.6, 0.6), lens);
            ray.at((0.0 - ray.origin.z) / ray.direction.z)
        };
        let sharp = on_plane(Vec2::ZERO);
        for lens in [Vec2::X, Vec2::new(-0.3, 0.8)] {
            assert!((on_plane(lens) - sharp).length() < 1e-5);
        }
    }

    #[test]
    fn orbiter_looks_at_its_center() {
        let orbiter = GkitOrbiterCamera {
            center: [1.0, 2.0, 3.0],
            rotation: [30.0, 90.0],
            size: 5.0,
            ..DEFAULT_ORBITER
        };
        let camera = Camera::from_orbiter(&orbiter);
        let to_center = DVec3::new(1.0, 2.0, 3.0) - camera.position;
        assert!((to_center - camera.forward * 5.0).length() < 1e-12);
        // A rotation by 90° about y places the camera on the scene's −x axis, and 30° about x raises it.
        let expected = DVec3::new(-30.0_f64.to_radians().cos(), 30.0_f64.to_radians().sin(), 0.0) * 5.0;
        assert!((-to_center - expected).length() < 1e-12, "{to_center}");
        assert!(camera.up.y > 0.8);
    }

    #[test]
    fn orbiter_viewpoint_matches_the_camera() {
        let file = description::Spanned { value: "camera.txt".into(), span: 0..0 };
        for rotation in [[30.0, 90.0], [18.0, 16.0], [90.0, 20.0], [120.0, -7.0], [-90.0, 0.0]] {
            let orbiter = GkitOrbiterCamera {
                center: [1.0, 2.0, 3.0],
                position: [0.5, -0.25],
                rotation,
                size: 5.0,
                ..DEFAULT_ORBITER
            };
            let scene =
                description::Camera::Orbiter { file: file.clone(), fov: None, aperture: 0.1, focus: None };
            let of_file = Camera::from_description(&scene, Some(&orbiter));
            let view = Camera::look_at_from_description(&scene, Some(&orbiter));
            let by_vectors = Camera::from_description(&view.into(), None);
            for (a, b) in [
                (of_file.position, by_vectors.position),
                (of_file.right, by_vectors.right),
                (of_file.up, by_vectors.up),
                (of_file.forward, by_vectors.forward),
            ] {
                assert!((a - b).length() < 1e-4 * 5.0, "{rotation:?}: {a} {b}");
            }
            assert_eq!(of_file.tan_half_fov, by_vectors.tan_half_fov);
            assert!((by_vectors.focus - 5.0).abs() < 1e-4 * 5.0 && by_vectors.aperture == 0.1);
            assert!(view.is_focused_on_look_at());
        }
    }
}
