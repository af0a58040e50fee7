//! Samples of lights that each point of a row picked for itself.

use super::emitter::{Arrival, Emitter};
use super::row::row_of;
use super::sphere::SphereEmitter;
use super::{AreaLight, Light, LightRow, Lights, PointLight, Source};
use crate::geometry::rows::lanes;
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};

impl Lights {
    /// [`Light::sample`] of a light of its own for each point whose bit is set, by numbers of its own; one over the densities
    /// in sr⁻¹, as [`Light::inverse_densities`]; and how many texture look-ups that took. Side by side where all are points, or balls.
    #[inline(always)]
    pub fn sample_each(
        &self,
        picked: &[u32; LANES],
        (points, normals): (&Lanes3, &Lanes3),
        used: u32,
        u: &[Lanes; 2],
    ) -> (LightRow, Lanes, u64) {
        let mut lights = [self.get(picked[0]); LANES];
        for i in 1..LANES {
            lights[i] = self.get(picked[i]);
        }
        let mut row = if let Some(lights) = all(&lights, point) {
            row_of!(Source::Nothing, i => {
                let (direction, weight) = lights[i].arriving(lane(points, i));
                (direction, lights[i].position.as_vec3(), weight)
            })
        } else if let Some(balls) = all(&lights, ball) {
            let mut row = row_of!(Source::Nothing, i => {
                let (ball, light) = balls[i];
                let Arrival { direction, target, factor } = ball.sample(lane(points, i), [u[0][i], u[1][i]]);
                (direction, target, light.radiance * factor)
            });
            for i in 0..LANES {
                row.sources.set(i, Source::Object(balls[i].1.object));
            }
            row
        } else {
            let sample =
                |i: usize, point| lights[i].plain_sample(point, lane(normals, i), [u[0][i], u[1][i]]);
            LightRow::one_by_one(points, used, sample)
        };
        let mut inverse = [0.0; LANES];
        for i in 0..LANES {
            inverse[i] = lights[i].inverse_density(lane(&row.directions, i), lane(&row.weights, i));
        }
        // Densities are those of plain lamps.
        let mut lookups = 0;
        for i in lanes(used) {
            let weight = lane(&row.weights, i);
            if let Some(pattern) = lights[i].pattern().filter(|_| weight != Vec3::ZERO) {
                let weight = weight * pattern.at(lane(&row.targets, i), row.sources.part[i]);
                set_lane(&mut row.weights, i, weight);
                lookups += 1;
            }
        }
        (row, inverse, lookups)
    }
}

#[inline(always)]
fn point(light: &Light) -> Option<&PointLight> {
    match light {
        Light::Point(light) => Some(light),
        Light::Spot(_) | Light::Directional(_) | Light::Environment(_) | Light::Area(_) => None,
    }
}

#[inline(always)]
fn ball(light: &Light) -> Option<(&SphereEmitter, &AreaLight)> {
    let Light::Area(light) = light else { return None };
    match &light.shape {
        Emitter::Sphere(ball) => Some((ball, light)),
        Emitter::Quad(_)
        | Emitter::Picture(_)
        | Emitter::Box(_)
        | Emitter::Triangle(_)
        | Emitter::Disk(_)
        | Emitter::Cylinder(_)
        | Emitter::Cone(_)
        | Emitter::Torus(_)
        | Emitter::Mesh(_) => None,
    }
}

/// What all lights are, if they are.
#[inline(always)]
fn all<'a, T: Copy>(
    lights: &[&'a Light; LANES],
    kind: impl Fn(&'a Light) -> Option<T>,
) -> Option<[T; LANES]> {
    let mut all = [kind(lights[0])?; LANES];
    for i in 1..LANES {
        all[i] = kind(lights[i])?;
    }
    Some(all)
}

impl Light {
    /// One of [`Light::inverse_densities`], by the direction and the weight of a sample.
    #[inline(always)]
    fn inverse_density(&self, direction: Vec3, weight: Vec3) -> f32 {
        match self {
            Self::Point(_) | Self::Spot(_) => 0.0,
            Self::Directional(light) => light.inverse_density(),
            Self::Environment(light) => light.inverse_density(direction),
            Self::Area(light) => weight.max_element() / light.radiance.max_element(),
        }
    }
}
