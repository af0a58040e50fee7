//! `[[light]]`.

use std::path::PathBuf;

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use super::Located;
pub use crate::lights::delta::Falloff;
use crate::math::{DVec3, Vec3};

/// A light that is no shape.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// Without extent.
    Point(PointLight),
    /// Without extent, into a cone.
    Spot(SpotLight),
    /// From beyond the scene.
    Directional(DirectionalLight),
}

/// A light without extent.
#[derive(Clone, Debug, PartialEq)]
pub struct PointLight {
    /// Position.
    pub position: DVec3,
    /// W·sr⁻¹; with [`Falloff::None`] irradiance at normal incidence.
    pub intensity: Vec3,
    /// Fall of the light with distance.
    pub falloff: Falloff,
}

/// A light without extent that shines into a cone.
#[derive(Clone, Debug, PartialEq)]
pub struct SpotLight {
    /// The light on its axis.
    pub point: PointLight,
    /// A point on its axis, not the light's own.
    pub look_at: DVec3,
    /// The whole cone, in degrees, in (0, 360).
    pub angle: f64,
    /// The outer part of the half angle over which it fades, in [0, 1].
    pub blend: f32,
}

/// Light from far away.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalLight {
    /// The way that it travels, of any length but 0.
    pub direction: DVec3,
    /// On a surface that faces it.
    pub irradiance: Vec3,
    /// Apparent diameter in degrees, up to 180; 0 for no extent.
    pub angle: f64,
}

/// Light from all around: `[environment]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Radiance; with a map, what its numbers are multiplied by.
    pub color: Vec3,
    /// An equirectangular map, resolved against the scene's folder.
    pub file: Option<Located<PathBuf>>,
    /// Turn of the map about +y, in degrees, counterclockwise seen from above.
    pub rotate: f64,
}

impl Light {
    /// Whether it is not black.
    pub fn sends(&self) -> bool {
        let color = match self {
            Self::Point(light) => light.intensity,
            Self::Spot(light) => light.point.intensity,
            Self::Directional(light) => light.irradiance,
        };
        color != Vec3::ZERO
    }

    /// Whether it is without extent, so that no ray finds it.
    pub fn is_sharp(&self) -> bool {
        match self {
            Self::Point(_) | Self::Spot(_) => true,
            Self::Directional(light) => light.angle == 0.0,
        }
    }

    /// Whether distance does not weaken it.
    pub fn is_steady(&self) -> bool {
        match self {
            Self::Point(light) => light.falloff == Falloff::None,
            Self::Spot(light) => light.point.falloff == Falloff::None,
            Self::Directional(_) => false,
        }
    }
}

impl Environment {
    /// Whether it is not black, but for its map.
    pub fn sends(&self) -> bool {
        self.color != Vec3::ZERO
    }
}

impl Fingerprinted for Light {
    fn add_to(&self, key: &mut Fingerprint, of: &Referents<'_>) {
        match self {
            Self::Point(light) => light.add_to(key.text("point"), of),
            Self::Spot(SpotLight { point, look_at, angle, blend }) => {
                point.add_to(key.text("spot"), of);
                key.dvec3(*look_at).f64(*angle).f32(*blend);
            }
            Self::Directional(DirectionalLight { direction, irradiance, angle }) => {
                key.text("directional").dvec3(*direction).vec3(*irradiance).f64(*angle);
            }
        }
    }
}

impl Fingerprinted for PointLight {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self { position, intensity, falloff } = *self;
        key.dvec3(position).vec3(intensity).choice(falloff);
    }
}

/// Key of the look-up; the texels have a key of their own.
impl Fingerprinted for Environment {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self { color, file, rotate } = self;
        key.vec3(*color).f64(*rotate).flag(file.is_some());
        if let Some(file) = file {
            key.path(&file.value);
        }
    }
}
