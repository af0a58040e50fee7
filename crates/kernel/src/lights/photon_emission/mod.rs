//! Photon emission: rays that start at lights and carry their power.
//!
//! A photon from light ℓ is a ray y. Its flux is the power per ray measure, Φ′(y), divided by the pdf of the
//! photon, so that the mean flux over all photons is the total power of the lights. There are two ways to
//! generate a photon, and the flux accounts for the pdfs of both (one-sample multiple importance sampling;
//! Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2.4). With probability
//! 1 − q, the direction is sampled from the light's emission. With probability q, it is aimed at one of the
//! [`BoundingSphere`]s around surfaces that need photons. The starting point is sampled in the same way. Let
//! P and A be the probabilities of choosing the light without and with aiming, and let e(y) and a(y) be the
//! remaining pdfs. Then
//!
//! flux = Φ′(y)/e(y) / ((1 − q)·P + q·A·a(y)/e(y)).

mod aim;
mod surface;

use std::f64::consts::PI;
use std::sync::Arc;

use super::area::EmissionModulation;
use super::delta::{Falloff, PointLight};
use super::light::{Light, LightFamily};
use super::set::Lights;
use super::tree::bounds::mean_channel;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, Shape};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::distribution::DiscreteDistribution;
use crate::sampling::warp;

use aim::{EmissionProfile, PhotonTargets};
use surface::DividedEmissiveSurface;

/// A bounding sphere, in the same coordinates as the lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundingSphere {
    /// Center.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

impl BoundingSphere {
    /// A sphere that contains all spheres in `balls`. Its center is the center of their bounding box.
    pub fn enclosing_all_spheres(balls: &[Self]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for Self { center, radius } in balls {
            (min, max) = (min.min(*center - *radius), max.max(*center + *radius));
        }
        let center = if balls.is_empty() { DVec3::ZERO } else { (min + max) * 0.5 };
        let reach = |ball: &Self| (ball.center - center).length() + ball.radius;
        Self { center, radius: balls.iter().map(reach).fold(0.0, f64::max) }
    }
}

/// The geometry of an emitting object.
#[derive(Clone, Debug, PartialEq)]
pub enum EmissiveObjectGeometry {
    /// A shape.
    Shape(Shape),
    /// A mesh.
    Mesh {
        /// Upper bound on the error of a hit point on any of its triangles.
        rounding: f32,
    },
}

/// Random numbers in [0, 1) for one photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonRandomNumbers {
    /// Picks the light and a piece of its surface.
    pub light: [f32; 2],
    /// Decides whether to aim, and picks the target.
    pub aim: [f32; 2],
    /// Position on the light. For lights at infinity, position on the disk that the light passes through.
    pub position: [f32; 2],
    /// Direction of the photon. For lights at infinity, direction to the light.
    pub direction: [f32; 2],
}

/// A newly emitted photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedPhoton {
    /// Index of the light.
    pub light: u32,
    /// Starting point.
    pub start: PhotonOrigin,
    /// Unit direction of travel.
    pub direction: Vec3,
    /// Power in W divided by the photon's pdf. The mean over all photons is the lights' total power.
    pub flux: Vec3,
    /// Whether the photon was aimed at a target.
    pub is_aimed: bool,
}

/// The starting point of a photon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PhotonOrigin {
    /// On a delta light.
    Point(Vec3),
    /// On a surface.
    Surface {
        /// The point.
        point: Vec3,
        /// Error bound of each component.
        error: Vec3,
        /// Unit normal on the emitting side.
        normal: Vec3,
    },
    /// Beyond all finite objects, on a plane tangent to their bounding sphere. Infinite objects may be
    /// between this point and the light.
    Beyond(Vec3),
}

impl EmittedPhoton {
    /// The photon's ray. Its origin is offset from the light's surface, as for a scattered ray.
    pub fn ray(&self) -> Ray {
        let origin = match self.start {
            PhotonOrigin::Point(point) | PhotonOrigin::Beyond(point) => point,
            PhotonOrigin::Surface { point, error, normal } => {
                offset_origin(point, error, normal, self.direction)
            }
        };
        Ray::new(origin, self.direction)
    }
}

/// Emits photons from all lights.
#[derive(Clone, Debug)]
pub struct PhotonEmitter {
    lights: Arc<Lights>,
    sources: Vec<LightEmissionInfo>,
    /// Bounding sphere of all finite objects. Light from infinity is emitted toward it.
    around: BoundingSphere,
    by_power: DiscreteDistribution,
    aim: Option<PhotonAim>,
}

/// Emission data of one light.
#[derive(Clone, Debug)]
struct LightEmissionInfo {
    /// Power in W.
    power: Vec3,
    /// Power divided by peak intensity in sr, for delta lights.
    spread: f64,
    /// The emitting surface, for area lights.
    surface: Option<DividedEmissiveSurface>,
}

/// How photons are aimed.
#[derive(Clone, Debug)]
struct PhotonAim {
    targets: PhotonTargets,
    /// Fraction of the photons that are aimed.
    aimed_fraction: f32,
    /// Distribution of the lights, weighted by their estimated power toward the targets.
    by_light: DiscreteDistribution,
}

/// Fraction of aimed photons whose light is chosen by power, as for unaimed photons. It is not 0 because an
/// estimated power of 0 toward the targets may be wrong.
const BY_POWER: f64 = 0.1;

impl PhotonEmitter {
    /// Creates a photon source from all lights. `emitter_geometry` returns the geometry of an object.
    /// `around` is a bounding sphere of all finite objects. Returns `None` if no light emits photons. Lights
    /// without falloff do not emit photons.
    pub fn new(
        lights: &Arc<Lights>,
        emitter_geometry: impl Fn(u32) -> Option<EmissiveObjectGeometry>,
        around: BoundingSphere,
    ) -> Option<Self> {
        let source = |(_, light): (u32, &Light)| LightEmissionInfo::new(light, &emitter_geometry, around);
        let sources: Vec<LightEmissionInfo> = lights.iter().map(source).collect();
        let by_power = DiscreteDistribution::new(sources.iter().map(|source| mean_channel(source.power)))?;
        Some(Self { lights: Arc::clone(lights), sources, around, by_power, aim: None })
    }

    /// Aims the fraction `aimed_fraction` of the photons at targets. If the fraction is 1, all photons hit a
    /// target, and their mean flux is the power that reaches the targets.
    #[must_use]
    pub fn with_targets(self, targets: &[BoundingSphere], aimed_fraction: f32) -> Self {
        let targets = PhotonTargets::new(targets).filter(|_| aimed_fraction > 0.0);
        let aim = targets.and_then(|targets| {
            let power_toward = |(number, light)| self.estimate_power_toward_targets(number, light, &targets);
            let power_toward: Vec<f64> = self.lights.iter().map(power_toward).collect();
            let (sum, total) = (power_toward.iter().sum::<f64>(), self.by_power.total());
            let weight = |(number, power_toward): (usize, &f64)| {
                let estimate = if sum > 0.0 { (1.0 - BY_POWER) * power_toward / sum } else { 0.0 };
                estimate + BY_POWER * mean_channel(self.sources[number].power) / total
            };
            let by_light = DiscreteDistribution::new(power_toward.iter().enumerate().map(weight))?;
            Some(PhotonAim { targets, aimed_fraction: aimed_fraction.min(1.0), by_light })
        });
        Self { aim, ..self }
    }

    /// Bounding sphere of all finite objects.
    pub fn finite_scene_bounds(&self) -> BoundingSphere {
        self.around
    }

    /// Power of a light, in W.
    pub fn light_power(&self, light: u32) -> Vec3 {
        self.sources[light as usize].power
    }

    /// Total power of all lights, in W.
    pub fn total_light_power(&self) -> Vec3 {
        self.sources.iter().map(|source| source.power.as_dvec3()).sum::<DVec3>().as_vec3()
    }

    /// Fraction of the photons that are aimed at targets.
    pub fn aimed_probability(&self) -> f32 {
        self.aim.as_ref().map_or(0.0, |aim| aim.aimed_fraction)
    }

    /// Emits a photon, or returns `None` if the sample carries no flux.
    pub fn emit(&self, u: &PhotonRandomNumbers) -> Option<EmittedPhoton> {
        let aim = self.aim.as_ref().filter(|aim| u.aim[0] < aim.aimed_fraction);
        let by_light = aim.map_or(&self.by_power, |aim| &aim.by_light);
        let (number, _) = by_light.sample(u.light[0]);
        let targets = aim.map(|aim| &aim.targets);
        let sample_photon = self
            .sample_photon_from_light(number, targets, u)
            .filter(|sample_photon| sample_photon.flux != Vec3::ZERO)?;
        let (all, of_light) =
            (f64::from(self.aimed_probability()), |by: &DiscreteDistribution| by.probability(number));
        let aimed = self.aim.as_ref().map_or(0.0, |aim| all * of_light(&aim.by_light) * sample_photon.ratio);
        let density = (1.0 - all) * of_light(&self.by_power) + aimed;
        let flux = (sample_photon.flux.as_dvec3() / density).as_vec3();
        let PhotonSample { start, direction, .. } = sample_photon;
        let emitted = EmittedPhoton { light: number as u32, start, direction, flux, is_aimed: aim.is_some() };
        // A direction with infinite pdf carries no flux.
        (flux != Vec3::ZERO).then_some(emitted)
    }

    /// Generates a photon from one light. The photon is aimed if there are `targets`.
    fn sample_photon_from_light(
        &self,
        number: usize,
        targets: Option<&PhotonTargets>,
        u: &PhotonRandomNumbers,
    ) -> Option<PhotonSample> {
        let source = &self.sources[number];
        match self.lights.get(number as u32).family() {
            LightFamily::Delta(light) => {
                let sends = EmissionProfile::Light { light, spread: source.spread };
                let PointLight { position, intensity, .. } = *light.isotropic_at_peak_intensity();
                let (direction, ratio) = self.sample_direction_from(position, &sends, targets, u, || {
                    light.sample_direction(u.direction)
                });
                let flux = intensity * source.spread as f32;
                Some(PhotonSample { start: PhotonOrigin::Point(position.as_vec3()), direction, flux, ratio })
            }
            LightFamily::Infinite(light) => {
                let (to_light, irradiance) = light.sample_direction_and_weight(u.direction);
                self.photon_from_infinity(to_light, irradiance, targets, u)
            }
            LightFamily::Area(light) => {
                let place =
                    source.surface.as_ref()?.sample_point(light, u.light[1], Vec2::from_array(u.position));
                let normal = place.normal.as_vec3();
                let by_cosine = || Frame::from_normal(normal).to_world(warp::cosine(u.direction));
                let (direction, ratio) = self.sample_direction_from(
                    place.from,
                    &EmissionProfile::Front(place.normal),
                    targets,
                    u,
                    by_cosine,
                );
                let start = PhotonOrigin::Surface { point: place.point, error: place.error, normal };
                // Apply the clear coat's transmittance in the photon's direction.
                let left = |modulation: &EmissionModulation| {
                    modulation.coat_transmittance(place.point, place.primitive, -direction)
                };
                let flux = place.flux * light.modulation.as_deref().map_or(Vec3::ONE, left);
                Some(PhotonSample { start, direction, flux, ratio })
            }
        }
    }
}

/// A photon from one light, before accounting for the probability of choosing the light.
struct PhotonSample {
    start: PhotonOrigin,
    direction: Vec3,
    /// Flux, assuming that all photons come from this light and none are aimed.
    flux: Vec3,
    /// Pdf of aimed photons divided by the pdf of unaimed photons.
    ratio: f64,
}

impl PhotonEmitter {
    /// Samples a direction from a point. Returns the direction and a ratio of pdfs: the pdf of aimed
    /// directions divided by the pdf of unaimed directions.
    #[inline(always)]
    fn sample_direction_from(
        &self,
        from: DVec3,
        sends: &EmissionProfile<'_>,
        targets: Option<&PhotonTargets>,
        u: &PhotonRandomNumbers,
        unaimed: impl FnOnce() -> Vec3,
    ) -> (Vec3, f64) {
        let Some(aim) = &self.aim else { return (unaimed(), 0.0) };
        let view = aim.targets.view_from(from, sends);
        match targets.and_then(|_| view.sample(u.aim[1], u.direction)) {
            Some((direction, target)) => (direction, view.aimed_pdf_ratio(direction, Some(target))),
            None => {
                let direction = unaimed();
                (direction, view.aimed_pdf_ratio(direction, None))
            }
        }
    }

    /// Creates a photon from infinity, given its direction and the irradiance at normal incidence.
    fn photon_from_infinity(
        &self,
        to_light: Vec3,
        irradiance: Vec3,
        targets: Option<&PhotonTargets>,
        u: &PhotonRandomNumbers,
    ) -> Option<PhotonSample> {
        let Frame { s, t, n } = Frame::from_normal(to_light);
        let (s, t, n) = (s.as_dvec3(), t.as_dvec3(), n.as_dvec3());
        let BoundingSphere { center, radius } = self.around;
        // Project onto the plane through the center of the bounding sphere.
        let through = |ball: &BoundingSphere| {
            let at = warp::disk(Vec2::from_array(u.position)).as_dvec2() * ball.radius;
            let middle = ball.center - center;
            [middle.dot(s) + at.x, middle.dot(t) + at.y]
        };
        let [x, y] = match targets {
            Some(targets) => through(targets.pick_by_cross_section(u.aim[1])),
            None => through(&self.around),
        };
        let is_inside = targets.is_none() || x * x + y * y <= radius * radius;
        let ratio = self.aim.as_ref().map_or(0.0, |aim| {
            let is_on = |ball: &BoundingSphere| {
                let middle = ball.center - center;
                let (x, y) = (x - middle.dot(s), y - middle.dot(t));
                x * x + y * y <= ball.radius * ball.radius
            };
            aim.targets.area_pdf_on_disks(is_on) * (PI * radius * radius)
        });
        let start = PhotonOrigin::Beyond((center + s * x + t * y + n * radius).as_vec3());
        let flux = (irradiance.as_dvec3() * (PI * radius * radius)).as_vec3();
        is_inside.then_some(PhotonSample { start, direction: -to_light, flux, ratio })
    }

    /// Estimated power that a light emits toward the targets, used for choosing a light.
    fn estimate_power_toward_targets(&self, number: u32, light: &Light, targets: &PhotonTargets) -> f64 {
        let source = &self.sources[number as usize];
        let power = mean_channel(source.power);
        if !(power > 0.0) {
            return 0.0;
        }
        let disk = PI * self.around.radius * self.around.radius;
        let part = match light.family() {
            LightFamily::Delta(light) => {
                let sends = EmissionProfile::Light { light, spread: source.spread };
                targets.view_from(light.isotropic_at_peak_intensity().position, &sends).total_power_bound()
                    / source.spread
            }
            LightFamily::Infinite(_) => targets.total_disk_area() / disk,
            LightFamily::Area(light) => source.surface.as_ref().map_or(0.0, |surface| {
                let of = |i: u32| {
                    let (u, piece) =
                        (low_discrepancy_point(i), (i as f32 + 0.5) / POWER_SAMPLE_POINTS as f32);
                    let place = surface.sample_point(light, piece, u);
                    let part = targets
                        .view_from(place.from, &EmissionProfile::Front(place.normal))
                        .total_power_bound()
                        / PI;
                    part.min(1.0) * mean_channel(place.flux)
                };
                (0..POWER_SAMPLE_POINTS).map(of).sum::<f64>() / f64::from(POWER_SAMPLE_POINTS) / power
            }),
        };
        power * part.min(1.0)
    }
}

/// Number of points on an area light that are used to estimate the power toward the targets.
const POWER_SAMPLE_POINTS: u32 = 16;

/// A low-discrepancy sequence in the unit square (Roberts, *The Unreasonable Effectiveness of Quasirandom
/// Sequences*, 2018).
fn low_discrepancy_point(i: u32) -> Vec2 {
    let along = |step: f64| ((f64::from(i) + 0.5) * step).fract() as f32;
    Vec2::new(along(0.754_877_666_246_693), along(0.569_840_290_998_053_3))
}

impl LightEmissionInfo {
    fn new(
        light: &Light,
        emitter_geometry: &impl Fn(u32) -> Option<EmissiveObjectGeometry>,
        around: BoundingSphere,
    ) -> Self {
        let disk = PI * around.radius * around.radius;
        match light.family() {
            LightFamily::Delta(light) => {
                let spread = light.effective_solid_angle();
                let PointLight { intensity, falloff, .. } = light.isotropic_at_peak_intensity();
                let power = match falloff {
                    Falloff::Square => (intensity.as_dvec3() * spread).as_vec3(),
                    Falloff::None => Vec3::ZERO,
                };
                Self { power, spread, surface: None }
            }
            LightFamily::Infinite(light) => {
                Self { power: light.power_through_disk(disk), spread: 0.0, surface: None }
            }
            LightFamily::Area(light) => {
                let surface = emitter_geometry(light.object)
                    .and_then(|emitter_geometry| DividedEmissiveSurface::new(light, &emitter_geometry));
                let power = surface.as_ref().map_or(Vec3::ZERO, DividedEmissiveSurface::power);
                Self { power, spread: 0.0, surface }
            }
        }
    }
}

#[cfg(test)]
mod tests;
