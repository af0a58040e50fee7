//! Targets of photons.

use std::f64::consts::{PI, TAU};

use arrayvec::ArrayVec;

use super::Ball;
use crate::lights::area::sphere::one_minus_cos;
use crate::lights::delta::DeltaLight;
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec3};
use crate::sampling::distribution::Discrete;
use crate::sampling::warp;

/// Balls at which photons are aimed. A ball is chosen by its expected light, and then a direction or a place uniform over its
/// visible part.
#[derive(Clone, Debug)]
pub struct Targets {
    balls: Vec<Ball>,
    /// Distribution by the squares of the radii.
    by_disc: Discrete,
}

/// Most targets; more are merged.
pub const MOST_TARGETS: usize = 32;

/// Directional distribution of the light that a point emits.
pub enum Sends<'a> {
    /// Distribution of a light without extent.
    Light {
        /// The light.
        light: &'a dyn DeltaLight,
        /// [`DeltaLight::solid_angle`], which takes long to compute for some.
        spread: f64,
    },
    /// The cosine with this unit normal, before a surface.
    Front(DVec3),
}

impl Sends<'_> {
    /// Power over the radiant intensity in the brightest direction, in sr.
    pub fn spread(&self) -> f64 {
        match self {
            Self::Light { spread, .. } => *spread,
            Self::Front(_) => PI,
        }
    }

    /// Intensity in a direction, relative to the brightest direction.
    pub fn share(&self, direction: Vec3) -> f64 {
        match self {
            Self::Light { light, .. } => f64::from(light.share(direction)),
            Self::Front(normal) => direction.as_dvec3().dot(*normal).max(0.0),
        }
    }

    /// Upper bound on [`Sends::share`] over a cone of directions, given the sine of its half angle, up to 90°.
    fn greatest(&self, axis: DVec3, sin: f64) -> f64 {
        let cos = ((1.0 - sin) * (1.0 + sin)).max(0.0).sqrt();
        // Cosine of the angle from a direction to the nearest one of the cone.
        let nearest = |direction: DVec3| {
            let along = direction.dot(axis).clamp(-1.0, 1.0);
            let across = ((1.0 - along) * (1.0 + along)).sqrt();
            if along >= cos { 1.0 } else { along * cos + across * sin }
        };
        match self {
            Self::Light { light, .. } => {
                let cone = light.bounds().cone;
                let is_met = nearest(cone.axis) >= cone.cos - 1e-9;
                f64::from(u8::from(is_met))
            }
            Self::Front(normal) => nearest(*normal).max(0.0),
        }
    }
}

impl Targets {
    /// Targets around these balls. `None` if none has an extent.
    pub fn new(balls: &[Ball]) -> Option<Self> {
        let balls: Vec<Ball> = balls.iter().copied().filter(|ball| ball.radius > 0.0).collect();
        let balls = together(balls);
        let by_disc = Discrete::new(balls.iter().map(|ball| ball.radius * ball.radius))?;
        Some(Self { balls, by_disc })
    }

    /// All of them.
    #[cfg(test)]
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// Target of a number in [0, 1), for light from beyond the scene.
    pub fn by_disc(&self, u: f32) -> &Ball {
        &self.balls[self.by_disc.sample(u).0]
    }

    /// Sum of the areas of all discs.
    pub fn discs(&self) -> f64 {
        PI * self.by_disc.total()
    }

    /// Density per area of places uniform over the discs of [`Targets::by_disc`], at a place that is on some of the
    /// discs.
    pub fn by_discs(&self, is_on: impl Fn(&Ball) -> bool) -> f64 {
        // A disc is chosen by its area: the density on each is the same.
        self.balls.iter().filter(|ball| is_on(ball)).count() as f64 / self.discs()
    }

    /// The targets as a point that emits light sees them.
    #[inline]
    pub fn seen_from<'a>(&self, from: DVec3, sends: &'a Sends<'a>) -> View<'a> {
        let mut view = View { sends, seen: ArrayVec::new(), total: 0.0 };
        for ball in &self.balls {
            let cone = Cone::around(ball, from);
            let weight = match &cone {
                Some(cone) => cone.solid_angle() * sends.greatest(cone.axis, cone.sin),
                None => sends.spread(),
            };
            if weight > 0.0 {
                view.total += weight;
                view.seen.push(Seen { cone, weight });
            }
        }
        view
    }
}

/// Targets relative to a point that emits light.
pub struct View<'a> {
    sends: &'a Sends<'a>,
    /// Targets that the light can reach.
    seen: ArrayVec<Seen, MOST_TARGETS>,
    total: f64,
}

/// A target relative to a point that emits light.
struct Seen {
    /// Cone of directions to it. `None` if the point is inside.
    cone: Option<Cone>,
    /// Upper bound on the power it gets, in units of the intensity in the brightest direction, in sr.
    weight: f64,
}

impl View<'_> {
    /// Upper bound on the power of all targets, in units of the intensity in the brightest direction, in sr.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// A direction uniform over the cone of a target, and the target. `None` if the point is inside the target, or there is
    /// no target: then a direction that is not aimed takes its place.
    pub fn sample(&self, u: f32, direction: [f32; 2]) -> Option<(Vec3, usize)> {
        let goal = f64::from(u) * self.total;
        let (mut sum, mut target) = (0.0, 0);
        for (number, seen) in self.seen.iter().enumerate() {
            if sum <= goal {
                target = number;
            }
            sum += seen.weight;
        }
        let cone = self.seen.get(target)?.cone.as_ref()?;
        let local = warp::cone(direction, cone.one_minus_cos);
        Some((Frame::from_normal(cone.axis.as_vec3()).to_world(local), target))
    }

    /// Pdf of aimed directions over that of emitted ones, at a direction that was made for a target or by emission. ∞ if
    /// emission never makes it.
    pub fn ratio(&self, direction: Vec3, made_for: Option<usize>) -> f64 {
        if !(self.total > 0.0) {
            return 1.0;
        }
        let (mut by_cones, mut by_others) = (0.0, 0.0);
        for (number, Seen { cone, weight }) in self.seen.iter().enumerate() {
            match cone {
                // The very edge may count either way.
                Some(cone) if made_for == Some(number) || cone.holds(direction) => {
                    by_cones += weight / cone.solid_angle();
                }
                Some(_) => {}
                None => by_others += weight,
            }
        }
        let by_cones =
            if by_cones > 0.0 { by_cones * self.sends.spread() / self.sends.share(direction) } else { 0.0 };
        (by_cones + by_others) / self.total
    }
}

/// The cone of directions to a ball.
struct Cone {
    axis: DVec3,
    /// Sine of the half angle.
    sin: f64,
    one_minus_cos: f32,
}

impl Cone {
    /// The cone around a ball. `None` from inside.
    fn around(ball: &Ball, from: DVec3) -> Option<Self> {
        let to_center = ball.center - from;
        let distance = to_center.length();
        let sin = ball.radius / distance;
        (sin < 1.0).then(|| Self {
            axis: to_center / distance,
            sin,
            one_minus_cos: one_minus_cos((sin * sin) as f32),
        })
    }

    fn solid_angle(&self) -> f64 {
        TAU * f64::from(self.one_minus_cos)
    }

    /// Whether a direction is inside. Compares chords to the axis.
    fn holds(&self, direction: Vec3) -> bool {
        (direction.as_dvec3() - self.axis).length_squared() <= 2.0 * f64::from(self.one_minus_cos)
    }
}

/// At most [`MOST_TARGETS`] balls around these balls: the largest group is cut in two along its longest side until there are so
/// many.
fn together(balls: Vec<Ball>) -> Vec<Ball> {
    if balls.len() <= MOST_TARGETS {
        return balls;
    }
    let mut groups = vec![balls];
    while groups.len() < MOST_TARGETS {
        let size = |group: &Vec<Ball>| if group.len() > 1 { Ball::around(group).radius } else { 0.0 };
        let sizes = groups.iter().map(size).enumerate();
        let Some((largest, _)) = sizes.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        let mut group = groups.swap_remove(largest);
        let centers = || group.iter().map(|ball| ball.center);
        let extent =
            centers().fold(DVec3::NEG_INFINITY, DVec3::max) - centers().fold(DVec3::INFINITY, DVec3::min);
        let axis = if extent.x >= extent.y.max(extent.z) { 0 } else { 1 + usize::from(extent.z > extent.y) };
        group.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
        let rest = group.split_off(group.len() / 2);
        groups.extend([group, rest]);
    }
    groups.iter().map(|group| Ball::around(group)).collect()
}
