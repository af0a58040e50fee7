//! The disk of the Hosek–Wilkie sun.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use super::model::{LIMB_DARKENING, SkyModelInputs, sun_radiance};
use crate::math::{DVec3, Vec3};

/// The model's angular diameter of the sun, in degrees. Disks of other diameters are scaled to the same
/// irradiance.
pub const SUN_ANGLE_DEGREES: f64 = 0.5338;

/// Number of heights at which the radiance is tabulated.
const HEIGHTS: usize = 16;

/// Radiance of the sun's disk, which decreases toward the limb and toward the horizon. The horizon hides the
/// part of the disk below it.
#[derive(Clone, Debug, PartialEq)]
pub struct SunDisk {
    /// 1 − cos of half the angular diameter.
    one_minus_cos: f64,
    /// Sine of the elevation of the disk's lowest point.
    bottom: f32,
    /// Difference of the sines of the elevations of the disk's highest and lowest points.
    extent: f32,
    /// Radiance without limb darkening, from the lowest to the highest point.
    radiances: [Vec3; HEIGHTS],
    /// Mean radiance over the disk, including the hidden part.
    mean: Vec3,
    /// Irradiance on a horizontal surface.
    horizontal_irradiance: DVec3,
}

impl SunDisk {
    /// Creates the disk.
    pub(super) fn new(parameters: &SkyModelInputs) -> Self {
        let SkyModelInputs { sun_elevation, turbidity, sun_angle, sun_scale, .. } = *parameters;
        let one_minus_cos = |angle: f64| 2.0 * libm::sin(angle / 4.0) * libm::sin(angle / 4.0);
        let model_angle = SUN_ANGLE_DEGREES.to_radians();
        let scale = f64::from(sun_scale) * (one_minus_cos(model_angle) / one_minus_cos(sun_angle));
        let sine = |offset: f64| libm::sin((sun_elevation + offset).min(FRAC_PI_2));
        let (bottom, top) = (sine(-sun_angle / 2.0), sine(sun_angle / 2.0));
        let radiance = |row: usize| {
            let offset = (row as f64 / (HEIGHTS - 1) as f64 - 0.5) * model_angle;
            let elevation = (sun_elevation + offset).clamp(0.0, FRAC_PI_2);
            (sun_radiance(turbidity, elevation) * scale).as_vec3()
        };
        let mut disk = Self {
            one_minus_cos: one_minus_cos(sun_angle),
            bottom: bottom as f32,
            extent: (top - bottom) as f32,
            radiances: std::array::from_fn(radiance),
            mean: Vec3::ZERO,
            horizontal_irradiance: DVec3::ZERO,
        };
        disk.compute_mean_and_irradiance(sun_elevation);
        disk
    }

    /// Computes the mean radiance and the irradiance with the midpoint rule.
    fn compute_mean_and_irradiance(&mut self, elevation: f64) {
        const RINGS: usize = 64;
        const SECTORS: usize = 64;
        let (sin, cos) = (libm::sin(elevation), libm::cos(elevation));
        let (mut mean, mut horizontal) = (DVec3::ZERO, DVec3::ZERO);
        for ring in 0..RINGS {
            let below_one = self.one_minus_cos * (ring as f64 + 0.5) / RINGS as f64;
            let along = 1.0 - below_one;
            let across = (below_one * (2.0 - below_one)).sqrt();
            for sector in 0..SECTORS {
                let up = libm::cos((sector as f64 + 0.5) / SECTORS as f64 * TAU);
                let height = sin * along + cos * across * up;
                let radiance = self.radiance_inside_disk(height as f32, (2.0 * below_one) as f32).as_dvec3();
                mean += radiance / (RINGS * SECTORS) as f64;
                horizontal += radiance * height / (RINGS * SECTORS) as f64;
            }
        }
        self.mean = mean.as_vec3();
        self.horizontal_irradiance = horizontal * TAU * self.one_minus_cos;
    }

    /// Radiance at a point inside the disk, given the sine of its elevation and the squared chord to the
    /// disk's center.
    fn radiance_inside_disk(&self, height: f32, squared_chord: f32) -> Vec3 {
        if height < 0.0 {
            return Vec3::ZERO;
        }
        let row = ((height - self.bottom) / self.extent).clamp(0.0, 1.0) * (HEIGHTS - 1) as f32;
        let lower = (row as usize).min(HEIGHTS - 2);
        let radiance = self.radiances[lower].lerp(self.radiances[lower + 1], row - lower as f32);
        // The chord is proportional to the distance from the center of the projected disk.
        let mu = (1.0 - squared_chord / (2.0 * self.one_minus_cos as f32)).max(0.0).sqrt();
        let limb = LIMB_DARKENING.map(|channel| channel.iter().rev().fold(0.0, |sum, one| sum * mu + one));
        radiance * Vec3::from_array(limb)
    }

    /// 1 − cos of half the angular diameter.
    pub fn one_minus_cos(&self) -> f64 {
        self.one_minus_cos
    }

    /// Mean radiance over the disk, including the hidden part.
    pub fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Irradiance on a horizontal surface.
    pub fn horizontal_irradiance(&self) -> DVec3 {
        self.horizontal_irradiance
    }
}

/// A sun disk, oriented by the vertical axis of its sky.
#[derive(Clone, Debug, PartialEq)]
pub struct OrientedSunDisk {
    /// The disk.
    pub disk: Arc<SunDisk>,
    /// Unit direction to the zenith.
    pub up: Vec3,
}

impl OrientedSunDisk {
    /// Radiance from a unit direction inside the disk around `center`.
    pub fn radiance(&self, center: Vec3, direction: Vec3) -> Vec3 {
        self.disk.radiance_inside_disk(direction.dot(self.up), (direction - center).length_squared())
    }
}
