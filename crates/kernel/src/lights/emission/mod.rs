//! Photon emission: rays that start at lights, each with its share of their power.
//!
//! A photon of light ℓ is a ray y. Its flux is the power per measure of rays, Φ′(y), over the pdf of such photons, so that the
//! mean of the flux over photons is the power of all lights. There are two ways to make a photon, and the flux takes the pdf of
//! both (one-sample multiple importance sampling; Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997,
//! section 9.2.4). With probability 1 − q it is made by emission alone, with probability q it is aimed at one of the [`Ball`]s
//! around surfaces that need photons. Both ways choose the start alike. With the probabilities P and A of the light, and a(y)/e(y)
//! the ratio of the other pdfs,
//!
//! flux = Φ′(y)/e(y) / ((1 − q)·P + q·A·a(y)/e(y)).

mod aim;
mod surface;

use std::f64::consts::PI;
use std::sync::Arc;

use super::area::EmissionTexture;
use super::delta::{Falloff, PointLight};
use super::light::{Family, Light};
use super::set::Lights;
use super::tree::bounds::strength;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Shape};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::Discrete;
use crate::sampling::warp;

use aim::{Sends, Targets};
use surface::Surface;

/// A ball in the coordinates of the lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

impl Ball {
    /// A ball around balls: centred in the box around them.
    pub fn around(balls: &[Self]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for Self { center, radius } in balls {
            (min, max) = (min.min(*center - *radius), max.max(*center + *radius));
        }
        let center = if balls.is_empty() { DVec3::ZERO } else { (min + max) * 0.5 };
        let reach = |ball: &Self| (ball.center - center).length() + ball.radius;
        Self { center, radius: balls.iter().map(reach).fold(0.0, f64::max) }
    }
}

/// The object that emits a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// A shape.
    Shape(Shape),
    /// A mesh.
    Mesh {
        /// Upper bound on the error of each of its triangles at a hit.
        rounding: f32,
    },
}

/// Random numbers in [0, 1) for a photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    /// Choice of the light, and of its piece.
    pub light: [f32; 2],
    /// Choice whether to aim, and of the target.
    pub aim: [f32; 2],
    /// Position on the light, or on the disc through which light from beyond the scene comes.
    pub position: [f32; 2],
    /// Direction to which it goes; for light from beyond the scene, from which it comes.
    pub direction: [f32; 2],
}

/// A photon at its start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitted {
    /// The number of its light.
    pub light: u32,
    /// Start of the photon.
    pub start: Start,
    /// Unit direction that it goes in.
    pub direction: Vec3,
    /// Power in W over the pdf of such photons: the mean over photons is the power of all lights.
    pub flux: Vec3,
    /// Whether it was aimed at a target.
    pub is_aimed: bool,
}

/// Start of a photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// At a light without extent.
    Point(Vec3),
    /// On the front of a surface.
    Surface {
        /// The point.
        point: Vec3,
        /// Bound on each component's error.
        error: Vec3,
        /// Unit normal of the front.
        normal: Vec3,
    },
    /// A place beyond all finite objects: on a plane that touches the ball around them. Infinite objects may lie on the
    /// way there from the light, against the direction of the photon.
    Beyond(Vec3),
}

impl Emitted {
    /// The photon's ray, which starts as one that the surface of its light scatters.
    pub fn ray(&self) -> Ray {
        let origin = match self.start {
            Start::Point(point) | Start::Beyond(point) => point,
            Start::Surface { point, error, normal } => offset_origin(point, error, normal, self.direction),
        };
        Ray::new(origin, self.direction)
    }
}

/// Source of the photons of all lights.
#[derive(Clone, Debug)]
pub struct PhotonSource {
    lights: Arc<Lights>,
    sources: Vec<OfLight>,
    /// Ball around all finite objects, over which light from beyond the scene is emitted.
    around: Ball,
    by_power: Discrete,
    aim: Option<Aim>,
}

/// Emission of a light.
#[derive(Clone, Debug)]
struct OfLight {
    /// Power in W.
    power: Vec3,
    /// Power over the intensity on the axis, in sr, for a light without extent.
    spread: f64,
    /// Surface, for a light that is an object.
    surface: Option<Surface>,
}

/// Aiming of photons.
#[derive(Clone, Debug)]
struct Aim {
    targets: Targets,
    /// Fraction of the photons that are aimed.
    share: f32,
    /// Distribution of the lights by their estimated power towards the targets.
    by_light: Discrete,
}

/// Fraction of aimed photons whose light is chosen by power, as for other photons: an estimate of 0 may be wrong.
const BY_POWER: f64 = 0.1;

impl PhotonSource {
    /// Source of the photons of all lights. `outline` gives the object of a number; `around` is a ball around all finite
    /// objects. `None` if no light emits. Lights without fall-off and the background emit no photons.
    pub fn new(lights: &Arc<Lights>, outline: impl Fn(u32) -> Option<Outline>, around: Ball) -> Option<Self> {
        let source = |(_, light): (u32, &Light)| OfLight::new(light, &outline, around);
        let sources: Vec<OfLight> = lights.iter().map(source).collect();
        let by_power = Discrete::new(sources.iter().map(|source| strength(source.power)))?;
        Some(Self { lights: Arc::clone(lights), sources, around, by_power, aim: None })
    }

    /// The source with this fraction of the photons, in [0, 1], aimed at targets. If all are aimed, only rays that meet a target
    /// are made, and the mean of their flux is the power that goes there.
    #[must_use]
    pub fn aimed_at(self, targets: &[Ball], share: f32) -> Self {
        let targets = Targets::new(targets).filter(|_| share > 0.0);
        let aim = targets.and_then(|targets| {
            let towards = |(number, light)| self.towards(number, light, &targets);
            let towards: Vec<f64> = self.lights.iter().map(towards).collect();
            let (sum, total) = (towards.iter().sum::<f64>(), self.by_power.total());
            let weight = |(number, towards): (usize, &f64)| {
                let estimate = if sum > 0.0 { (1.0 - BY_POWER) * towards / sum } else { 0.0 };
                estimate + BY_POWER * strength(self.sources[number].power) / total
            };
            let by_light = Discrete::new(towards.iter().enumerate().map(weight))?;
            Some(Aim { targets, share: share.min(1.0), by_light })
        });
        Self { aim, ..self }
    }

    /// Ball around all finite objects.
    pub fn around(&self) -> Ball {
        self.around
    }

    /// Power of a light, in W.
    pub fn power_of(&self, light: u32) -> Vec3 {
        self.sources[light as usize].power
    }

    /// Power of all lights, in W.
    pub fn power(&self) -> Vec3 {
        self.sources.iter().map(|source| source.power.as_dvec3()).sum::<DVec3>().as_vec3()
    }

    /// Fraction of the photons that are aimed.
    pub fn aimed_share(&self) -> f32 {
        self.aim.as_ref().map_or(0.0, |aim| aim.share)
    }

    /// Emits a photon. `None` if the chosen light or target gets nothing.
    pub fn emit(&self, u: &Numbers) -> Option<Emitted> {
        let aim = self.aim.as_ref().filter(|aim| u.aim[0] < aim.share);
        let by_light = aim.map_or(&self.by_power, |aim| &aim.by_light);
        let (number, _) = by_light.sample(u.light[0]);
        let targets = aim.map(|aim| &aim.targets);
        let made = self.made(number, targets, u).filter(|made| made.flux != Vec3::ZERO)?;
        let (all, of_light) = (f64::from(self.aimed_share()), |by: &Discrete| by.share(number));
        let aimed = self.aim.as_ref().map_or(0.0, |aim| all * of_light(&aim.by_light) * made.ratio);
        let density = (1.0 - all) * of_light(&self.by_power) + aimed;
        let flux = (made.flux.as_dvec3() / density).as_vec3();
        let Made { start, direction, .. } = made;
        let emitted = Emitted { light: number as u32, start, direction, flux, is_aimed: aim.is_some() };
        // A direction of infinite density carries no flux.
        (flux != Vec3::ZERO).then_some(emitted)
    }

    /// A photon of one light, aimed at a target or not.
    fn made(&self, number: usize, targets: Option<&Targets>, u: &Numbers) -> Option<Made> {
        let source = &self.sources[number];
        match self.lights.get(number as u32).family() {
            Family::Delta(light) => {
                let sends = Sends::Light { light, spread: source.spread };
                let PointLight { position, intensity, .. } = *light.brightest();
                let (direction, ratio) =
                    self.directed(position, &sends, targets, u, || light.direction(u.direction));
                let flux = intensity * source.spread as f32;
                Some(Made { start: Start::Point(position.as_vec3()), direction, flux, ratio })
            }
            Family::Infinite(light) => {
                let (to_light, irradiance) = light.arriving_anywhere(u.direction);
                self.arriving_beyond(to_light, irradiance, targets, u)
            }
            Family::Area(light) => {
                let place = source.surface.as_ref()?.place(light, u.light[1], Vec2::from_array(u.position));
                let normal = place.normal.as_vec3();
                let by_cosine = || Frame::from_normal(normal).to_world(warp::cosine(u.direction));
                let (direction, ratio) =
                    self.directed(place.from, &Sends::Front(place.normal), targets, u, by_cosine);
                let start = Start::Surface { point: place.point, error: place.error, normal };
                // A clear coat weakens what leaves in this direction.
                let left = |texture: &EmissionTexture| {
                    texture.left_by_coat(place.point, place.primitive, -direction)
                };
                let flux = place.flux * light.texture.as_deref().map_or(1.0, left);
                Some(Made { start, direction, flux, ratio })
            }
        }
    }
}

/// A photon of one light, before the probability of the light counts.
struct Made {
    start: Start,
    direction: Vec3,
    /// Flux if all photons were of this light and none aimed.
    flux: Vec3,
    /// Pdf of aimed photons over that of others.
    ratio: f64,
}

impl PhotonSource {
    /// A direction from a point, and the pdf of aimed directions over that of others.
    #[inline(always)]
    fn directed(
        &self,
        from: DVec3,
        sends: &Sends<'_>,
        targets: Option<&Targets>,
        u: &Numbers,
        unaimed: impl FnOnce() -> Vec3,
    ) -> (Vec3, f64) {
        let Some(aim) = &self.aim else { return (unaimed(), 0.0) };
        let view = aim.targets.seen_from(from, sends);
        match targets.and_then(|_| view.sample(u.aim[1], u.direction)) {
            Some((direction, target)) => (direction, view.ratio(direction, Some(target))),
            None => {
                let direction = unaimed();
                (direction, view.ratio(direction, None))
            }
        }
    }

    /// A photon from a direction, with its irradiance at normal incidence.
    fn arriving_beyond(
        &self,
        to_light: Vec3,
        irradiance: Vec3,
        targets: Option<&Targets>,
        u: &Numbers,
    ) -> Option<Made> {
        let Frame { s, t, n } = Frame::from_normal(to_light);
        let (s, t, n) = (s.as_dvec3(), t.as_dvec3(), n.as_dvec3());
        let Ball { center, radius } = self.around;
        // Project onto the plane through the middle of the ball.
        let through = |ball: &Ball| {
            let at = warp::disk(Vec2::from_array(u.position)).as_dvec2() * ball.radius;
            let middle = ball.center - center;
            [middle.dot(s) + at.x, middle.dot(t) + at.y]
        };
        let [x, y] = match targets {
            Some(targets) => through(targets.by_disc(u.aim[1])),
            None => through(&self.around),
        };
        let is_inside = targets.is_none() || x * x + y * y <= radius * radius;
        let ratio = self.aim.as_ref().map_or(0.0, |aim| {
            let is_on = |ball: &Ball| {
                let middle = ball.center - center;
                let (x, y) = (x - middle.dot(s), y - middle.dot(t));
                x * x + y * y <= ball.radius * ball.radius
            };
            aim.targets.by_discs(is_on) * (PI * radius * radius)
        });
        let start = Start::Beyond((center + s * x + t * y + n * radius).as_vec3());
        let flux = (irradiance.as_dvec3() * (PI * radius * radius)).as_vec3();
        is_inside.then_some(Made { start, direction: -to_light, flux, ratio })
    }

    /// Estimated power of a light towards targets, for the choice among lights.
    fn towards(&self, number: u32, light: &Light, targets: &Targets) -> f64 {
        let source = &self.sources[number as usize];
        let power = strength(source.power);
        if !(power > 0.0) {
            return 0.0;
        }
        let disc = PI * self.around.radius * self.around.radius;
        let part = match light.family() {
            Family::Delta(light) => {
                let sends = Sends::Light { light, spread: source.spread };
                targets.seen_from(light.brightest().position, &sends).total() / source.spread
            }
            Family::Infinite(_) => targets.discs() / disc,
            Family::Area(light) => source.surface.as_ref().map_or(0.0, |surface| {
                let of = |i: u32| {
                    let (u, piece) = (places(i), (i as f32 + 0.5) / PLACES as f32);
                    let place = surface.place(light, piece, u);
                    let part = targets.seen_from(place.from, &Sends::Front(place.normal)).total() / PI;
                    part.min(1.0) * strength(place.flux)
                };
                (0..PLACES).map(of).sum::<f64>() / f64::from(PLACES) / power
            }),
        };
        power * part.min(1.0)
    }
}

/// Number of places of a lamp at which its view of the targets is estimated.
const PLACES: u32 = 16;

/// A lattice on the unit square (Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018).
fn places(i: u32) -> Vec2 {
    let along = |step: f64| ((f64::from(i) + 0.5) * step).fract() as f32;
    Vec2::new(along(0.754_877_666_246_693), along(0.569_840_290_998_053_3))
}

impl OfLight {
    fn new(light: &Light, outline: &impl Fn(u32) -> Option<Outline>, around: Ball) -> Self {
        let disc = PI * around.radius * around.radius;
        match light.family() {
            Family::Delta(light) => {
                let spread = light.solid_angle();
                let PointLight { intensity, falloff, .. } = light.brightest();
                let power = match falloff {
                    Falloff::Square => (intensity.as_dvec3() * spread).as_vec3(),
                    Falloff::None => Vec3::ZERO,
                };
                Self { power, spread, surface: None }
            }
            Family::Infinite(light) => Self { power: light.power_over(disc), spread: 0.0, surface: None },
            Family::Area(light) => {
                let surface = outline(light.object).and_then(|outline| Surface::new(light, &outline));
                let power = surface.as_ref().map_or(Vec3::ZERO, Surface::power);
                Self { power, spread: 0.0, surface }
            }
        }
    }
}

#[cfg(test)]
mod tests;
