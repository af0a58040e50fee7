//! Bounds of lights: positions, power, and directions of emission.

use crate::geometry::Aabb;
use crate::math::{DVec3, Vec3};

/// Bounds of one light or of several, for estimates without examining each (Conty Estevez and Kulla, *Importance Sampling of
/// Many Lights with Adaptive Tree Splitting*, 2018, section 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// Effect of distance on the light.
    pub space: Space,
    /// Centre of a sphere around them.
    pub center: DVec3,
    /// Radius of that sphere.
    pub radius: f64,
    /// Expected emission along their axes, > 0: W·sr⁻¹, or irradiance for lights without fall-off; mean of the colours.
    pub power: f64,
    /// Directions of the emission.
    pub cone: EmissionCone,
}

/// Meaning of distances to lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Space {
    /// Lights whose irradiance falls with the square of the distance.
    Weakening,
    /// Lights with a position, but without fall-off.
    Steady,
    /// Light from beyond the scene: the sphere is around unit vectors to it.
    Beyond,
}

/// Directions into which light is emitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionCone {
    /// Unit axis of a cone around the axes of all lights.
    pub axis: DVec3,
    /// Cosine of its half angle.
    pub cos: f64,
    /// Fall-off beyond the cone.
    pub edge: Edge,
}

/// Fall-off of the emission beyond a cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Edge {
    /// No emission beyond the cone.
    Sharp,
    /// The cosine of the angle from the cone, 0 from 90° on.
    Cosine,
}

impl EmissionCone {
    /// All directions.
    pub const ALL: Self = Self { axis: DVec3::Z, cos: -1.0, edge: Edge::Sharp };

    /// Emission from the front of a flat surface.
    pub fn of_front(normal: DVec3) -> Self {
        Self { axis: normal, cos: 1.0, edge: Edge::Cosine }
    }

    /// Emission into a cone of a half angle up to π.
    pub fn within(axis: DVec3, half_angle: f64) -> Self {
        Self { axis, cos: libm::cos(half_angle), edge: Edge::Sharp }
    }

    /// A cone around all of these, about the mean of their axes.
    fn around<'a>(cones: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let edge = cones.clone().map(|cone| cone.edge).max().unwrap_or(Edge::Sharp);
        let sum: DVec3 = cones.clone().map(|cone| cone.axis).sum();
        let Some(axis) = sum.try_normalize() else { return Self { edge, ..Self::ALL } };
        Self { axis, cos: cones.map(|cone| cone.widest_from(axis)).fold(1.0, f64::min), edge }
    }

    /// Cosine of the greatest angle from an axis to a direction of the cone.
    fn widest_from(&self, axis: DVec3) -> f64 {
        let cos = self.axis.dot(axis).clamp(-1.0, 1.0);
        let (sin, own_sin) = (sine(cos), sine(self.cos));
        // Together they exceed 180°.
        if cos <= -self.cos { -1.0 } else { cos * self.cos - sin * own_sin }
    }
}

fn sine(cos: f64) -> f64 {
    ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt()
}

impl LightBounds {
    /// Scaled by a colour.
    pub fn times(self, color: Vec3) -> Self {
        Self { power: self.power * strength(color), ..self }
    }

    /// Bounds of a light in a box, with fall-off.
    pub fn in_box(bounds: Aabb, power: f64, cone: EmissionCone) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let radius = (max - min).length() * 0.5;
        Self { space: Space::Weakening, center: (min + max) * 0.5, radius, power, cone }
    }

    /// Bounds of a triangle with its front along (b − a) × (c − a), for a unit of radiance. `None` if it has no area.
    pub fn of_triangle(corners: &[DVec3; 3]) -> Option<Self> {
        let [a, b, c] = *corners;
        let vector_area = (b - a).cross(c - a) * 0.5;
        let normal = vector_area.try_normalize()?;
        Some(Self::in_box(Aabb::around_f64(*corners), vector_area.length(), EmissionCone::of_front(normal)))
    }

    /// Bounds around all of these, which are in one space. `None` if there are none.
    pub fn around<'a>(all: impl Iterator<Item = &'a Self> + Clone) -> Option<Self> {
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
            power: power(all.clone()),
            cone: EmissionCone::around(all.map(|one| &one.cone)),
        })
    }
}

/// Expected intensity of several lights, averaged over directions within the spread of their axes. Cosine emitters give all of
/// their power if the axes agree, a quarter of it if the axes are uniform.
fn power<'a>(all: impl Iterator<Item = &'a LightBounds>) -> f64 {
    let (mut everywhere, mut by_cosine, mut axes) = (0.0, 0.0, DVec3::ZERO);
    for LightBounds { power, cone, .. } in all {
        match cone.edge {
            Edge::Sharp => everywhere += power,
            Edge::Cosine => (by_cosine, axes) = (by_cosine + power, axes + cone.axis * *power),
        }
    }
    everywhere + 0.25 * (by_cosine + 3.0 * axes.length().min(by_cosine))
}

/// One number for a colour, as lights are chosen by their effect on all of its components.
pub fn strength(color: Vec3) -> f64 {
    color.as_dvec3().element_sum() / 3.0
}
