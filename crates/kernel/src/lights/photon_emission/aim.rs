//! Aims photons at target spheres.

use std::f64::consts::{PI, TAU};

use arrayvec::ArrayVec;

use super::BoundingSphere;
use crate::lights::area::sphere::one_minus_cos_from_sin2;
use crate::lights::delta::DeltaPositionLight;
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec3};
use crate::sampling::distribution::DiscreteDistribution;
use crate::sampling::warp;

/// Spheres at which photons are aimed. A sphere is chosen with a probability proportional to the light
/// expected to reach it. Then a direction or a point is sampled uniformly over its visible part.
#[derive(Clone, Debug)]
pub struct PhotonTargets {
    balls: Vec<BoundingSphere>,
    /// Distribution over the spheres, weighted by squared radius.
    pick_by_disk: DiscreteDistribution,
}

/// Maximum number of targets. If there are more, some are merged.
pub const MAX_TARGETS: usize = 32;

/// Directional distribution of the light emitted from a point.
pub enum EmissionProfile<'a> {
    /// A delta light's distribution.
    Light {
        /// The light.
        light: &'a dyn DeltaPositionLight,
        /// [`DeltaPositionLight::effective_solid_angle`], which is expensive to compute for some lights.
        spread: f64,
    },
    /// A cosine distribution around this unit normal.
    Front(DVec3),
}

impl EmissionProfile<'_> {
    /// Power divided by peak intensity, in sr.
    pub fn effective_solid_angle(&self) -> f64 {
        match self {
            Self::Light { spread, .. } => *spread,
            Self::Front(_) => PI,
        }
    }

    /// Intensity in a direction, relative to the peak intensity.
    pub fn relative_intensity(&self, direction: Vec3) -> f64 {
        match self {
            Self::Light { light, .. } => f64::from(light.relative_intensity(direction)),
            Self::Front(normal) => direction.as_dvec3().dot(*normal).max(0.0),
        }
    }

    /// Upper bound on [`EmissionProfile::relative_intensity`] over a cone of directions. `sin` is the sine of
    /// the cone's half angle, which is at most 90°.
    fn relative_intensity_bound_in_cone(&self, axis: DVec3, sin: f64) -> f64 {
        let cos = ((1.0 - sin) * (1.0 + sin)).max(0.0).sqrt();
        // Cosine of the smallest angle between a direction and the cone.
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

impl PhotonTargets {
    /// Creates targets from spheres, or returns `None` if no sphere has a positive radius.
    pub fn new(balls: &[BoundingSphere]) -> Option<Self> {
        let balls: Vec<BoundingSphere> = balls.iter().copied().filter(|ball| ball.radius > 0.0).collect();
        let balls = cluster_spheres(balls);
        let pick_by_disk = DiscreteDistribution::new(balls.iter().map(|ball| ball.radius * ball.radius))?;
        Some(Self { balls, pick_by_disk })
    }

    /// All target spheres.
    #[cfg(test)]
    pub fn balls(&self) -> &[BoundingSphere] {
        &self.balls
    }

    /// Chooses a target for photons from infinity.
    pub fn pick_by_cross_section(&self, u: f32) -> &BoundingSphere {
        &self.balls[self.pick_by_disk.sample(u).0]
    }

    /// Total area of the targets' disks.
    pub fn total_disk_area(&self) -> f64 {
        PI * self.pick_by_disk.total()
    }

    /// Area density at a point if points are sampled uniformly on the disks of
    /// [`PhotonTargets::pick_by_cross_section`]. `is_on` returns whether the point is on a disk.
    pub fn area_pdf_on_disks(&self, is_on: impl Fn(&BoundingSphere) -> bool) -> f64 {
        // Disks are chosen with probabilities proportional to their areas, so each one contributes the same
        // density.
        self.balls.iter().filter(|ball| is_on(ball)).count() as f64 / self.total_disk_area()
    }

    /// The targets seen from an emission point.
    #[inline]
    pub fn view_from<'a>(&self, from: DVec3, sends: &'a EmissionProfile<'a>) -> TargetsSeenFromPoint<'a> {
        let mut view = TargetsSeenFromPoint { sends, seen: ArrayVec::new(), total: 0.0 };
        for ball in &self.balls {
            let cone = TargetCone::from_sphere(ball, from);
            let weight = match &cone {
                Some(cone) => {
                    cone.solid_angle() * sends.relative_intensity_bound_in_cone(cone.axis, cone.sin)
                }
                None => sends.effective_solid_angle(),
            };
            if weight > 0.0 {
                view.total += weight;
                view.seen.push(TargetSeenFromPoint { cone, weight });
            }
        }
        view
    }
}

/// Targets seen from an emission point.
pub struct TargetsSeenFromPoint<'a> {
    sends: &'a EmissionProfile<'a>,
    /// Targets that the light can reach.
    seen: ArrayVec<TargetSeenFromPoint, MAX_TARGETS>,
    total: f64,
}

/// A single target seen from an emission point.
struct TargetSeenFromPoint {
    /// The cone of directions to the target, or `None` if the point is inside the target.
    cone: Option<TargetCone>,
    /// Upper bound on the power that the target receives, relative to the peak intensity, in sr.
    weight: f64,
}

impl TargetsSeenFromPoint<'_> {
    /// Upper bound on the total power that the targets receive, relative to the peak intensity, in sr.
    pub fn total_power_bound(&self) -> f64 {
        self.total
    }

    /// Samples a direction uniformly over a target's cone. Returns the direction and the index of the target,
    /// or `None` if the point is inside the target or there is no target. In that case, the caller uses an
    /// unaimed direction.
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

    /// Pdf of aimed directions divided by the pdf of unaimed directions, or ∞ if emission never generates
    /// `direction`. `made_for` is the target at which the direction was aimed, or `None` for an unaimed
    /// direction.
    pub fn aimed_pdf_ratio(&self, direction: Vec3, made_for: Option<usize>) -> f64 {
        if !(self.total > 0.0) {
            return 1.0;
        }
        let (mut by_cones, mut by_others) = (0.0, 0.0);
        for (number, TargetSeenFromPoint { cone, weight }) in self.seen.iter().enumerate() {
            match cone {
                // At the edge of a cone, the result of `contains` depends on rounding.
                Some(cone) if made_for == Some(number) || cone.contains(direction) => {
                    by_cones += weight / cone.solid_angle();
                }
                Some(_) => {}
                None => by_others += weight,
            }
        }
        let by_cones = if by_cones > 0.0 {
            by_cones * self.sends.effective_solid_angle() / self.sends.relative_intensity(direction)
        } else {
            0.0
        };
        (by_cones + by_others) / self.total
    }
}

/// The cone of directions to a sphere.
struct TargetCone {
    axis: DVec3,
    /// Sine of the half angle.
    sin: f64,
    one_minus_cos: f32,
}

impl TargetCone {
    /// The cone of directions from a point to a sphere, or `None` if the point is inside the sphere.
    fn from_sphere(ball: &BoundingSphere, from: DVec3) -> Option<Self> {
        let to_center = ball.center - from;
        let distance = to_center.length();
        let sin = ball.radius / distance;
        (sin < 1.0).then(|| Self {
            axis: to_center / distance,
            sin,
            one_minus_cos: one_minus_cos_from_sin2((sin * sin) as f32),
        })
    }

    fn solid_angle(&self) -> f64 {
        TAU * f64::from(self.one_minus_cos)
    }

    /// Whether a direction is inside the cone. Compares chords, which is accurate even for narrow cones.
    fn contains(&self, direction: Vec3) -> bool {
        (direction.as_dvec3() - self.axis).length_squared() <= 2.0 * f64::from(self.one_minus_cos)
    }
}

/// Merges spheres into at most [`MAX_TARGETS`] groups. Repeatedly splits the largest group into two along its
/// longest axis.
fn cluster_spheres(balls: Vec<BoundingSphere>) -> Vec<BoundingSphere> {
    if balls.len() <= MAX_TARGETS {
        return balls;
    }
    let mut groups = vec![balls];
    while groups.len() < MAX_TARGETS {
        let size = |group: &Vec<BoundingSphere>| {
            if group.len() > 1 { BoundingSphere::enclosing_all_spheres(group).radius } else { 0.0 }
        };
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
    groups.iter().map(|group| BoundingSphere::enclosing_all_spheres(group)).collect()
}
