//! Bounds on lights: position, power, and emission directions.

use crate::geometry::Aabb;
use crate::math::{DVec3, Vec3};

/// Bounds on one or more lights, used to estimate the lights' contribution without examining each light
/// (Conty Estevez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, 2018, section
/// 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// How distance affects the light.
    pub space: DistanceFalloff,
    /// Center of a bounding sphere.
    pub center: DVec3,
    /// Radius of the bounding sphere.
    pub radius: f64,
    /// Expected emission along the axes, averaged over the color channels: an intensity in W·sr⁻¹, or an
    /// irradiance for lights without falloff. Always positive.
    pub power: f64,
    /// Directions of emission.
    pub cone: EmissionCone,
}

/// How distance affects a light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DistanceFalloff {
    /// Irradiance decreases with the square of the distance.
    InverseSquare,
    /// The light has a position but no falloff.
    Constant,
    /// The light is at infinity. The sphere bounds unit vectors toward the light.
    Beyond,
}

/// Bounds on the directions of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionCone {
    /// Axis of a cone that contains the lights' emission axes.
    pub axis: DVec3,
    /// Cosine of the cone's half angle.
    pub cos: f64,
    /// Falloff outside the cone.
    pub edge: ConeFalloff,
}

/// Falloff of the emission outside a cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ConeFalloff {
    /// No emission outside the cone.
    Sharp,
    /// Cosine of the angle to the cone, or 0 for angles of at least 90°.
    Cosine,
}

impl EmissionCone {
    /// All directions.
    pub const ALL: Self = Self { axis: DVec3::Z, cos: -1.0, edge: ConeFalloff::Sharp };

    /// Emission from the front of a flat surface.
    pub fn lambertian(normal: DVec3) -> Self {
        Self { axis: normal, cos: 1.0, edge: ConeFalloff::Cosine }
    }

    /// Emission into a cone with a half angle of up to π.
    pub fn from_half_angle(axis: DVec3, half_angle: f64) -> Self {
        Self { axis, cos: libm::cos(half_angle), edge: ConeFalloff::Sharp }
    }

    /// A cone that contains all given cones, around the mean of their axes.
    fn union_of_all<'a>(cones: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let edge = cones.clone().map(|cone| cone.edge).max().unwrap_or(ConeFalloff::Sharp);
        let sum: DVec3 = cones.clone().map(|cone| cone.axis).sum();
        let Some(axis) = sum.try_normalize() else { return Self { edge, ..Self::ALL } };
        Self { axis, cos: cones.map(|cone| cone.cos_max_angle_to_axis(axis)).fold(1.0, f64::min), edge }
    }

    /// Cosine of the largest angle between `axis` and any direction in the cone.
    fn cos_max_angle_to_axis(&self, axis: DVec3) -> f64 {
        let cos = self.axis.dot(axis).clamp(-1.0, 1.0);
        let (sin, own_sin) = (sine_from_cosine(cos), sine_from_cosine(self.cos));
        // If the sum of the angles is at least 180°, the largest angle is 180°.
        if cos <= -self.cos { -1.0 } else { cos * self.cos - sin * own_sin }
    }
}

fn sine_from_cosine(cos: f64) -> f64 {
    ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()
}

impl LightBounds {
    /// The bounds scaled by a color.
    pub fn scaled_by(self, color: Vec3) -> Self {
        Self { power: self.power * mean_channel(color), ..self }
    }

    /// Bounds on a light with inverse-square falloff inside a box.
    pub fn from_bounding_box(bounds: Aabb, power: f64, cone: EmissionCone) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let radius = (max - min).length() * 0.5;
        Self { space: DistanceFalloff::InverseSquare, center: (min + max) * 0.5, radius, power, cone }
    }

    /// Bounds on the emission of a triangle that faces along (b − a) × (c − a), for a radiance of 1, or
    /// `None` if the triangle has no area.
    pub fn from_triangle(corners: &[DVec3; 3]) -> Option<Self> {
        let [a, b, c] = *corners;
        let vector_area = (b - a).cross(c - a) * 0.5;
        let normal = vector_area.try_normalize()?;
        Some(Self::from_bounding_box(
            Aabb::from_points_f64(*corners),
            vector_area.length(),
            EmissionCone::lambertian(normal),
        ))
    }

    /// The union of all bounds in `all`, which must have the same falloff, or `None` if `all` is empty.
    pub fn union_of_all<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
        let space = all.clone().next()?.space;
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for one in all.clone() {
            (min, max) = (min.min(one.center - one.radius), max.max(one.center + one.radius));
        }
        let center = (min + max) * 0.5;
        let reaches = all.clone().map(|one| (one.center - center).length() + one.radius);
        Some(Self {
            space,
            center,
            radius: reaches.fold(0.0, f64::max).min((max - min).length() * 0.5),
            power: combined_intensity_along_axes(all.clone()),
            cone: EmissionCone::union_of_all(all.map(|one| &one.cone)),
        })
    }
}

/// Expected intensity of several lights, averaged over directions within the spread of their axes. Cosine
/// emitters contribute all of their power if their axes agree, and a quarter of it if the axes are uniformly
/// distributed.
fn combined_intensity_along_axes<'a>(all: impl Iterator<Item = &'a LightBounds>) -> f64 {
    let (mut everywhere, mut by_cosine, mut axes) = (0.0, 0.0, DVec3::ZERO);
    for LightBounds { power, cone, .. } in all {
        match cone.edge {
            ConeFalloff::Sharp => everywhere += power,
            ConeFalloff::Cosine => (by_cosine, axes) = (by_cosine + power, axes + cone.axis * *power),
        }
    }
    everywhere + 0.25 * (by_cosine + 3.0 * axes.length().min(by_cosine))
}

/// Reduces a color to a single number. All channels have the same weight because the lights are picked for
/// all channels together.
pub fn mean_channel(color: Vec3) -> f64 {
    color.as_dvec3().element_sum() / 3.0
}
