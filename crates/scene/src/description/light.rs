//! Lights without a shape (`[[light]]`), and the `[environment]` table.

use std::path::PathBuf;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::Spanned;
use crate::lights;
pub use crate::lights::delta::Falloff;
use crate::math::{DMat3, DVec3, Vec3};

/// A light that is not a shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// A point light.
    Point(PointLight),
    /// A spotlight.
    Spot(SpotLight),
    /// A distant light.
    Directional(DirectionalLight),
}

/// A point light.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Position of the light.
    pub position: DVec3,
    /// Radiant intensity in W·sr⁻¹. For [`Falloff::None`], the irradiance at normal incidence.
    pub intensity: Vec3,
    /// Falloff with distance.
    pub falloff: Falloff,
}

/// A point light that shines only within a cone.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotLight {
    /// The light's position and on-axis intensity.
    pub point: PointLight,
    /// A point on the axis, different from the position.
    pub look_at: DVec3,
    /// Full apex angle of the cone in degrees, in (0, 360).
    pub angle: f64,
    /// Outer fraction of the half angle over which the light fades out, in [0, 1].
    pub blend: f32,
}

/// A distant light.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Direction in which the light travels. Any nonzero length.
    pub direction: DVec3,
    /// Irradiance at normal incidence.
    pub irradiance: Vec3,
    /// Apparent diameter in degrees, from 0 (no extent) to 180.
    pub angle: f64,
}

/// Light from all directions: `[environment]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Radiance, or a scale factor for the map.
    pub color: Vec3,
    /// Path to an equirectangular map, resolved against the scene's folder.
    pub file: Option<Spanned<PathBuf>>,
    /// Orientation of the map.
    pub orientation: MapOrientation,
}

/// Orientation of an environment map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapOrientation {
    /// Rotation about +y in degrees, counterclockwise when seen from above.
    Turn(f64),
    /// Rotation from the map's axes to the world's.
    Rotation(DMat3),
}

impl Light {
    /// Whether the light's color is not black.
    pub fn has_emission(&self) -> bool {
        let color = match self {
            Self::Point(light) => light.intensity,
            Self::Spot(light) => light.point.intensity,
            Self::Directional(light) => light.irradiance,
        };
        color != Vec3::ZERO
    }

    /// Whether the light is a δ light, which rays cannot hit.
    pub fn is_delta(&self) -> bool {
        match self {
            Self::Point(_) | Self::Spot(_) => true,
            Self::Directional(light) => light.angle == 0.0,
        }
    }

    /// Whether the light is a point light or spotlight with `falloff = "none"`.
    pub fn has_disabled_falloff(&self) -> bool {
        match self {
            Self::Point(light) => light.falloff == Falloff::None,
            Self::Spot(light) => light.point.falloff == Falloff::None,
            Self::Directional(_) => false,
        }
    }

    /// Converts the light to the form that is traced, with coordinates relative to `origin`.
    pub fn to_traced_light(&self, origin: DVec3) -> lights::Light {
        match self {
            Self::Point(light) => lights::Light::Point(light.to_traced_light(origin)),
            Self::Spot(light) => {
                let axis = (light.look_at - light.point.position).normalize().as_vec3();
                let half_angle = (light.angle.to_radians() * 0.5) as f32;
                let point = light.point.to_traced_light(origin);
                lights::Light::Spot(lights::delta::SpotLight { point, axis, half_angle, blend: light.blend })
            }
            Self::Directional(light) => {
                let to_light = -light.direction.normalize().as_vec3();
                let angle = light.angle.to_radians();
                lights::Light::Directional(lights::infinite::DirectionalLight::new(
                    to_light,
                    light.irradiance,
                    angle,
                ))
            }
        }
    }
}

impl PointLight {
    /// Converts the light to the form that is traced, with coordinates relative to `origin`.
    fn to_traced_light(&self, origin: DVec3) -> lights::delta::PointLight {
        let Self { position, intensity, falloff } = *self;
        lights::delta::PointLight { position: position - origin, intensity, falloff }
    }
}

impl Environment {
    /// Whether the color is not black, regardless of the map.
    pub fn has_emission(&self) -> bool {
        self.color != Vec3::ZERO
    }
}

impl Fingerprinted for Light {
    fn add_to(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Point(light) => light.add_to(key.add_str("point"), of),
            Self::Spot(SpotLight { point, look_at, angle, blend }) => {
                point.add_to(key.add_str("spot"), of);
                key.add_dvec3(*look_at).add_f64(*angle).add_f32(*blend);
            }
            Self::Directional(DirectionalLight { direction, irradiance, angle }) => {
                key.add_str("directional").add_dvec3(*direction).add_vec3(*irradiance).add_f64(*angle);
            }
        }
    }
}

impl Fingerprinted for PointLight {
    fn add_to(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self { position, intensity, falloff } = *self;
        key.add_dvec3(position).add_vec3(intensity).add_choice(falloff);
    }
}

/// Covers only the lookup parameters. The texels have a separate fingerprint.
impl Fingerprinted for Environment {
    fn add_to(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self { color, file, orientation } = self;
        key.add_vec3(*color).add_bool(file.is_some());
        match orientation {
            MapOrientation::Turn(degrees) => key.add_usize(0).add_f64(*degrees),
            MapOrientation::Rotation(DMat3 { x_axis, y_axis, z_axis }) => {
                key.add_usize(1).add_dvec3(*x_axis).add_dvec3(*y_axis).add_dvec3(*z_axis)
            }
        };
        if let Some(file) = file {
            key.add_path_bytes(&file.value);
        }
    }
}
