//! Cameras: perspective and orthographic with a thin lens, equirectangular panoramas and fisheyes.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::assets::GkitOrbiterCamera;
use crate::geometry::packet::RayPacket;
use crate::geometry::{Aabb, Ray};
use crate::math::decimal::{decimal_step_for_distance, round_to_step};
use crate::math::elementary::sin_cos_f64;
use crate::math::lanes::{F32x16, PACKET_SIZE, set_lane};
use crate::math::transform::rotation_xyz;
use crate::math::{DMat3, DVec2, DVec3, Vec2, Vec3};
use crate::scene::description::{self, ImageShiftAndMirror, Pose, ResolvedCamera};

/// A camera. All projections use the same axes. Without `shift`, `look_at` is at the center of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Center of the lens, or for an orthographic camera, a point on the plane where rays start.
    pub position: DVec3,
    /// Orthonormal axes: image right, image up, and view direction.
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    projection: Projection,
    /// Whether the image is flipped horizontally.
    mirror: bool,
    /// Lens radius, or 0 for a pinhole.
    pub aperture: f64,
    /// Distance to the plane of focus along the view axis.
    pub focus: f64,
}

/// Mapping from film positions to rays, with precomputed constants. The variants are named as in pbrt.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Projection {
    /// Rays through one point, onto a flat image.
    Perspective {
        /// Unnormalized direction through the image center. Its component along the view axis is 1.
        center: DVec3,
        /// Tangent of half the vertical field of view.
        tan_half_fov: f64,
    },
    /// Parallel rays that start on the plane through the camera's position, perpendicular to the view axis.
    Orthographic {
        /// Offset of the image center from the camera's position.
        center: DVec3,
        /// Half the height of the image in scene units.
        half_height: f64,
    },
    /// Equirectangular image of all directions, in the coordinates of environment maps.
    Spherical {
        /// Offset of the image center in units of half the image height.
        shift: DVec2,
    },
    /// Equidistant fisheye.
    Fisheye {
        /// Offset of the image center in units of half the image height.
        shift: DVec2,
        /// Half the angle across the circle, in radians.
        half_fov: f64,
    },
}

/// A position on the film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmPosition {
    /// Offset from the image center, to the right and up, in units of half the image height.
    pub offset: DVec2,
    /// Half the image width in the same units.
    pub half_width: f64,
}

/// The film positions of a packet of rays.
#[derive(Clone, Copy, Debug)]
pub struct FilmPositionPacket {
    /// Offsets from the image center, to the right and up, in units of half the image height.
    pub offset: [[f64; PACKET_SIZE]; 2],
    /// Half the image width in the same units.
    pub half_width: f64,
}

/// Width of a pixel's footprint at the center of the image, as a linear function of distance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelFootprint {
    /// Width at the ray origin.
    pub width: f32,
    /// Increase of the width per unit of distance.
    pub spread: f32,
}

impl Camera {
    /// Creates the camera described by the scene, using the contents of the orbiter file if there is one.
    pub fn from_description(camera: &description::Camera, orbiter: Option<&GkitOrbiterCamera>) -> Self {
        match camera {
            description::Camera::LookAt { position, look_at, up, projection, window, aperture, focus } => {
                let forward = (*look_at - *position).normalize();
                let right = forward.cross(*up).normalize();
                let axes = [right, right.cross(forward), forward];
                Self::from_axes(*position, axes, *projection, window, [*aperture, *focus])
            }
            description::Camera::Orbiter { projection, window, aperture, focus, .. } => {
                let orbiter = orbiter.copied().unwrap_or(DEFAULT_ORBITER);
                let of_file = description::Projection::Perspective { fov: orbiter.fov };
                let lens = [*aperture, focus.unwrap_or(orbiter.size)];
                let (position, axes) = orbiter_position_and_axes(&orbiter);
                Self::from_axes(position, axes, projection.unwrap_or(of_file), window, lens)
            }
        }
    }

    /// Creates a camera with the axes right, up and forward.
    fn from_axes(
        position: DVec3,
        [right, up, forward]: [DVec3; 3],
        projection: description::Projection,
        window: &ImageShiftAndMirror,
        [aperture, focus]: [f64; 2],
    ) -> Self {
        let shift = 2.0 * window.shift;
        let across = right * shift.x + up * shift.y;
        let projection = match projection {
            description::Projection::Perspective { fov } => {
                let tan_half_fov = libm::tan(fov.to_radians() * 0.5);
                Projection::Perspective { center: forward + across * tan_half_fov, tan_half_fov }
            }
            description::Projection::Orthographic { view_height } => {
                let half_height = 0.5 * view_height;
                Projection::Orthographic { center: across * half_height, half_height }
            }
            description::Projection::Spherical => Projection::Spherical { shift },
            description::Projection::Fisheye { fov } => {
                Projection::Fisheye { shift, half_fov: 0.5 * fov.to_radians() }
            }
        };
        Self { position, right, up, forward, projection, mirror: window.mirror, aperture, focus }
    }

    /// Returns the point that the camera orbits, and the distance to it.
    pub fn orbit_target_and_distance(
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
    pub fn resolve_to_look_at(
        camera: &description::Camera,
        orbiter: Option<&GkitOrbiterCamera>,
    ) -> ResolvedCamera {
        match camera {
            description::Camera::LookAt { position, look_at, up, projection, window, aperture, focus } => {
                ResolvedCamera {
                    pose: Pose { position: *position, look_at: *look_at, up: *up },
                    projection: *projection,
                    window: *window,
                    aperture: *aperture,
                    focus: *focus,
                }
            }
            description::Camera::Orbiter { projection, window, focus, aperture, .. } => {
                let file = orbiter.copied().unwrap_or(DEFAULT_ORBITER);
                let Self { position, up, forward, .. } = Self::from_description(camera, Some(&file));
                let look_at = position + forward * file.size;
                let short = |place: DVec3| {
                    DVec3::from_array(
                        place.to_array().map(|at| round_to_step(at, decimal_step_for_distance(file.size))),
                    )
                };
                let (position, look_at) = (short(position), short(look_at));
                // An orbiter does not roll. Unless it is upside down, y points up in the image.
                let is_upright = up.y > UPRIGHT;
                let pose = Pose { position, look_at, up: if is_upright { DVec3::Y } else { up } };
                let of_file = description::Projection::Perspective { fov: file.fov };
                ResolvedCamera {
                    pose,
                    projection: projection.unwrap_or(of_file),
                    window: *window,
                    aperture: *aperture,
                    focus: focus.unwrap_or_else(|| pose.distance()),
                }
            }
        }
    }

    /// Converts the camera to coordinates relative to `origin`.
    pub fn relative_to(self, origin: DVec3) -> Self {
        Self { position: self.position - origin, ..self }
    }

    /// Whether the image is flipped horizontally.
    pub fn is_mirrored(&self) -> bool {
        self.mirror
    }

    /// Returns the camera ray through a film position and a point on the unit lens disk, or `None` outside
    /// the circle of a fisheye. Its direction is normalized. The position is in the image before mirroring.
    pub fn ray(&self, film: FilmPosition, lens: Vec2) -> Option<Ray> {
        let offset = [[film.offset.x; PACKET_SIZE], [film.offset.y; PACKET_SIZE]];
        let film = FilmPositionPacket { offset, half_width: film.half_width };
        let lens = [[lens.x; PACKET_SIZE], [lens.y; PACKET_SIZE]];
        let (rays, valid) = self.ray_packet(&film, (self.aperture > 0.0).then_some(&lens));
        (valid & 1 != 0).then(|| rays.ray(0))
    }

    /// Returns camera rays through film positions and points on the unit lens disk, and the mask of the lanes
    /// that have a ray. `lens` is `None` for rays through the center of the lens.
    #[inline(always)]
    pub fn ray_packet(&self, film: &FilmPositionPacket, lens: Option<&[F32x16; 2]>) -> (RayPacket, u32) {
        let place = |lane: usize| DVec2::new(film.offset[0][lane], film.offset[1][lane]);
        let eye = self.position.as_vec3();
        match self.projection {
            Projection::Perspective { center, tan_half_fov } => {
                let direction = |lane: usize| {
                    let place = place(lane) * tan_half_fov;
                    center + self.right * place.x + self.up * place.y
                };
                let rays = match lens {
                    Some(lens) => {
                        fill_ray_packet(|lane| self.lens_ray(self.position, direction(lane), lens, lane))
                    }
                    None => {
                        let mut directions = [[0.0; PACKET_SIZE]; 3];
                        for lane in 0..PACKET_SIZE {
                            set_lane(&mut directions, lane, direction(lane).normalize().as_vec3());
                        }
                        RayPacket::from_soa(eye.to_array().map(|at| [at; PACKET_SIZE]), directions)
                    }
                };
                (rays, u32::MAX)
            }
            Projection::Orthographic { center, half_height } => {
                let origin = |lane: usize| {
                    let place = place(lane) * half_height;
                    self.position + (center + self.right * place.x + self.up * place.y)
                };
                let forward = self.forward.as_vec3();
                let rays = match lens {
                    Some(lens) => {
                        fill_ray_packet(|lane| self.lens_ray(origin(lane), self.forward, lens, lane))
                    }
                    None => fill_ray_packet(|lane| (origin(lane).as_vec3(), forward)),
                };
                (rays, u32::MAX)
            }
            Projection::Spherical { shift } => {
                let rays = fill_ray_packet(|lane| {
                    let place = place(lane) + shift;
                    // Reduce the azimuth to one turn: `shift` can move a narrow image by many turns.
                    let turns = 0.5 * place.x / film.half_width;
                    let (sin, cos) = sin_cos_f64(2.0 * PI * (turns - turns.floor()));
                    let (height, across) = sin_cos_f64(FRAC_PI_2 * place.y);
                    let level = self.right * sin + self.forward * cos;
                    (eye, (level * across + self.up * height).as_vec3())
                });
                (rays, u32::MAX)
            }
            Projection::Fisheye { shift, half_fov } => {
                let mut valid = 0;
                let rays = fill_ray_packet(|lane| {
                    let place = place(lane) + shift;
                    let radius = place.length();
                    valid |= u32::from(radius <= 1.0) << lane;
                    let (sin, cos) = sin_cos_f64(radius.min(1.0) * half_fov);
                    let slope = if radius > 0.0 { sin / radius } else { half_fov };
                    let across = self.right * place.x + self.up * place.y;
                    (eye, (self.forward * cos + across * slope).as_vec3())
                });
                (rays, valid)
            }
        }
    }

    /// Origin and unit direction of the ray that starts at a lane's lens point and meets the pinhole ray on
    /// the plane of focus. The component of `direction`, the pinhole ray's direction, along the view axis
    /// is 1.
    #[inline(always)]
    fn lens_ray(&self, center: DVec3, direction: DVec3, lens: &[F32x16; 2], lane: usize) -> (Vec3, Vec3) {
        let lens = Vec2::new(lens[0][lane], lens[1][lane]).as_dvec2() * self.aperture;
        let offset = self.right * lens.x + self.up * lens.y;
        let aimed = direction - offset / self.focus;
        ((center + offset).as_vec3(), aimed.normalize().as_vec3())
    }

    /// Width of a pixel's footprint at the center of an image with `rows` rows.
    pub fn pixel_footprint(&self, rows: u32) -> PixelFootprint {
        let per_row = |extent: f64| (extent / f64::from(rows)) as f32;
        match self.projection {
            Projection::Perspective { tan_half_fov, .. } => {
                PixelFootprint { width: 0.0, spread: per_row(2.0 * tan_half_fov) }
            }
            Projection::Orthographic { half_height, .. } => {
                PixelFootprint { width: per_row(2.0 * half_height), spread: 0.0 }
            }
            Projection::Spherical { .. } => PixelFootprint { width: 0.0, spread: per_row(PI) },
            Projection::Fisheye { half_fov, .. } => {
                PixelFootprint { width: 0.0, spread: per_row(2.0 * half_fov) }
            }
        }
    }

    /// Depth of a point: the distance along the view axis, or for panoramas and fisheyes, which also show
    /// points behind the camera, the distance from the camera.
    pub fn depth_of(&self, point: DVec3) -> f64 {
        let arm = point - self.position;
        match self.projection {
            Projection::Perspective { .. } | Projection::Orthographic { .. } => arm.dot(self.forward),
            Projection::Spherical { .. } | Projection::Fisheye { .. } => arm.length(),
        }
    }

    /// Whether the rays start on a plane rather than on the lens.
    pub fn has_parallel_rays(&self) -> bool {
        match self.projection {
            Projection::Orthographic { .. } => true,
            Projection::Perspective { .. } | Projection::Spherical { .. } | Projection::Fisheye { .. } => {
                false
            }
        }
    }

    /// Whether rays can start in a box. For an orthographic camera, returns whether the box touches the plane
    /// where rays start.
    pub fn may_start_rays_in(&self, bounds: &Aabb) -> bool {
        let eye = self.position.as_vec3();
        // Origins are rounded to `f32`.
        let rounding = eye.abs() * f32::EPSILON;
        if self.has_parallel_rays() {
            let bounds = bounds.expanded(rounding);
            let (min, max) = (bounds.min.as_dvec3() - self.position, bounds.max.as_dvec3() - self.position);
            let reach = (max - min).dot(self.forward.abs());
            return (min + max).dot(self.forward).abs() <= reach;
        }
        let lens = Vec3::splat(self.aperture as f32);
        bounds.overlaps(&Aabb { min: eye, max: eye }.expanded(lens + rounding))
    }
}

/// Fills a packet with origins and directions.
#[inline(always)]
fn fill_ray_packet(mut ray: impl FnMut(usize) -> (Vec3, Vec3)) -> RayPacket {
    let (mut origins, mut directions) = ([[0.0; PACKET_SIZE]; 3], [[0.0; PACKET_SIZE]; 3]);
    for lane in 0..PACKET_SIZE {
        let (origin, direction) = ray(lane);
        set_lane(&mut origins, lane, origin);
        set_lane(&mut directions, lane, direction);
    }
    RayPacket::from_soa(origins, directions)
}

/// Position of a gKit orbiter camera, and its axes right, up and forward. The world-to-camera transform is
/// T(−p, −size)·Rx(r.x)·Ry(r.y)·T(−center).
fn orbiter_position_and_axes(orbiter: &GkitOrbiterCamera) -> (DVec3, [DVec3; 3]) {
    let [x, y] = orbiter.rotation;
    // `rotation_xyz` rotates about x first, but the orbiter rotates about y first.
    let view: DMat3 = rotation_xyz(DVec3::new(x, 0.0, 0.0)) * rotation_xyz(DVec3::new(0.0, y, 0.0));
    let axes = view.transpose();
    let eye = DVec3::new(orbiter.position[0], orbiter.position[1], orbiter.size);
    (DVec3::from_array(orbiter.center) + axes * eye, [axes.x_axis, axes.y_axis, -axes.z_axis])
}

/// Minimum y component of the up axis at which a camera counts as upright: neither upside down nor looking
/// straight up or down.
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
#[path = "camera_tests.rs"]
mod tests;
