//! Bounds of lights: where they are, what they send, and into which directions.

use crate::geometry::Aabb;
use crate::math::{DVec3, Vec3};

/// What is known of a light, or of several, without a look at each (Conty Estevez and Kulla, *Importance Sampling of Many Lights
/// with Adaptive Tree Splitting*, 2018, section 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightBounds {
    /// How distance acts on the light.
    pub space: Space,
    /// Centre of a sphere around them.
    pub center: DVec3,
    /// Its radius.
    pub radius: f64,
    /// What they are expected to send along their axes: W·sr⁻¹, or irradiance where distance does not weaken it; mean of the
    /// colours, > 0.
    pub power: f64,
    /// Where to.
    pub cone: EmissionCone,
}

/// What distances to lights mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Space {
    /// Light weakens with the square of the distance.
    Weakening,
    /// Lights have a place, but distance does not weaken them.
    Steady,
    /// Light comes from beyond the scene: the sphere is around unit vectors to it.
    Beyond,
}

/// Directions that light is sent into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionCone {
    /// Unit axis of a cone around the axes of all lights.
    pub axis: DVec3,
    /// Cosine of its half angle.
    pub cos: f64,
    /// How light fades beyond the cone.
    pub edge: Edge,
}

/// How light fades beyond a cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Edge {
    /// There is none.
    Sharp,
    /// With the cosine of the angle from the cone, none from 90° on.
    Cosine,
}

impl EmissionCone {
    /// Everywhere.
    pub const ALL: Self = Self { axis: DVec3::Z, cos: -1.0, edge: Edge::Sharp };

    /// From the front of a flat surface.
    pub fn of_front(normal: DVec3) -> Self {
        Self { axis: normal, cos: 1.0, edge: Edge::Cosine }
    }

    /// Into a cone of a half angle up to π.
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
        // Beyond 180° together.
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

    /// Of a light in a box that weakens with distance.
    pub fn in_box(bounds: Aabb, power: f64, cone: EmissionCone) -> Self {
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let radius = (max - min).length() * 0.5;
        Self { space: Space::Weakening, center: (min + max) * 0.5, radius, power, cone }
    }

    /// Of a triangle with its front along (b − a) × (c − a), for a unit of radiance; none where it has no area.
    pub fn of_triangle(corners: &[DVec3; 3]) -> Option<Self> {
        let [a, b, c] = *corners;
        let vector_area = (b - a).cross(c - a) * 0.5;
        let normal = vector_area.try_normalize()?;
        Some(Self::in_box(Aabb::around_f64(*corners), vector_area.length(), EmissionCone::of_front(normal)))
    }

    /// Around all of them, which are in one space; none around none.
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

/// Expected intensity of several lights, averaged over directions within the spread of their axes: emitters by the cosine give all
/// of their power where the axes agree, a quarter of it where these are uniform.
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

/// One number for a colour: lights are chosen by what they bring to all of its parts.
pub fn strength(color: Vec3) -> f64 {
    color.as_dvec3().element_sum() / 3.0
}
