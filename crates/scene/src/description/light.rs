//! Lights without a shape (`[[light]]`), and the `[environment]` table.

use std::path::PathBuf;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::Spanned;
use crate::lights;
pub use crate::lights::delta::Falloff;
pub use crate::lights::infinite::MapRowPlacement;
use crate::lights::infinite::sky::{SkyModelInputs, elevation};
use crate::math::transform::rotation_xyz;
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
    /// A sky, which replaces the color and the map.
    pub sky: Option<Sky>,
    /// Orientation of the map or the sky.
    pub orientation: MapOrientation,
    /// Polar angles of the map's rows.
    pub rows: MapRowPlacement,
}

/// Orientation of an environment map or a sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapOrientation {
    /// Rotation about +y in degrees, counterclockwise when seen from above.
    Turn(f64),
    /// Rotation from the environment's own axes to the world's.
    Rotation(DMat3),
}

/// A Hosek–Wilkie sky and its sun.
#[derive(Clone, Debug, PartialEq)]
pub struct Sky {
    /// Unit direction toward the sun, before the environment's rotation. Above the horizon.
    pub sun: DVec3,
    /// Turbidity of the air, from 1 to 10.
    pub turbidity: f64,
    /// Albedo of the ground.
    pub ground: Vec3,
    /// Apparent diameter of the sun in degrees.
    pub sun_angle: f64,
    /// Factor on the sun's radiance.
    pub sun_scale: f32,
    /// Factor on the sky's radiance.
    pub sky_scale: f32,
    /// Factor on the radiance of the ground.
    pub ground_scale: f32,
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
    /// Whether the environment emits light, regardless of the map.
    pub fn has_emission(&self) -> bool {
        match &self.sky {
            Some(sky) => sky.sun_scale > 0.0 || sky.sky_scale > 0.0,
            None => self.color != Vec3::ZERO,
        }
    }

    /// Rotation from the environment's axes to the world's.
    pub fn rotation(&self) -> DMat3 {
        match self.orientation {
            MapOrientation::Turn(degrees) => rotation_xyz(DVec3::new(0.0, degrees, 0.0)),
            MapOrientation::Rotation(rotation) => rotation,
        }
    }
}

impl Sky {
    /// The parameters of the model.
    pub fn parameters(&self) -> SkyModelInputs {
        let Self { sun, turbidity, ground, sun_angle, sun_scale, sky_scale, ground_scale } = *self;
        SkyModelInputs {
            sun_elevation: elevation(sun),
            turbidity,
            ground,
            sun_angle: sun_angle.to_radians(),
            sun_scale,
            sky_scale,
            ground_scale,
        }
    }
}

impl Fingerprinted for Light {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        match self {
            Self::Point(light) => light.add_to_fingerprint(key.add_str("point"), of),
            Self::Spot(SpotLight { point, look_at, angle, blend }) => {
                point.add_to_fingerprint(key.add_str("spot"), of);
                key.add_dvec3(*look_at).add_f64(*angle).add_f32(*blend);
            }
            Self::Directional(DirectionalLight { direction, irradiance, angle }) => {
                key.add_str("directional").add_dvec3(*direction).add_vec3(*irradiance).add_f64(*angle);
            }
        }
    }
}

impl Fingerprinted for PointLight {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self { position, intensity, falloff } = *self;
        key.add_dvec3(position).add_vec3(intensity).add_choice_name(falloff);
    }
}

impl Fingerprinted for Sky {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self { sun, turbidity, ground, sun_angle, sun_scale, sky_scale, ground_scale } = *self;
        key.add_dvec3(sun).add_f64(turbidity).add_vec3(ground).add_f64(sun_angle);
        key.add_f32(sun_scale).add_f32(sky_scale).add_f32(ground_scale);
    }
}

/// Covers only the lookup parameters. The texels have a separate fingerprint.
impl Fingerprinted for Environment {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, of: &FingerprintContext<'_>) {
        let Self { color, file, sky, orientation, rows } = self;
        key.add_vec3(*color).add_bool(file.is_some()).add_choice_name(*rows);
        match orientation {
            MapOrientation::Turn(degrees) => key.add_usize(0).add_f64(*degrees),
            MapOrientation::Rotation(DMat3 { x_axis, y_axis, z_axis }) => {
                key.add_usize(1).add_dvec3(*x_axis).add_dvec3(*y_axis).add_dvec3(*z_axis)
            }
        };
        if let Some(sky) = sky {
            key.add_str("sky").add_with_references(sky, of);
        }
        if let Some(file) = file {
            key.add_path_bytes(&file.value);
        }
    }
}
