//! Unbiased estimate of the reciprocal of a kernel's coverage, from random trials.

use super::coverage::{KernelCoverage, material, receives};
use super::kernel::sample;
use super::map::{GatherPoint, MIN_COSINE, REACH};
use super::occlusion::is_occluded;
use super::reservoir::PhotonPosition;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfaceRequest};
use crate::math::frame::Frame;
use crate::math::{Vec2, Vec3};
use crate::sampling::warp;
use crate::world::World;

/// Number of successes after which the trials end.
const SUCCESSES: u32 = 4;

/// Maximum number of trials: if less than a tenth of a kernel receives photons, a fraction of at most (1 − p)⁶⁵ of its
/// light is lost.
const MAX_TRIALS: u32 = 64;

/// Maximum number of surfaces examined along the normal at one position in a kernel.
const LAYERS: usize = 8;

/// Estimates the reciprocal of the kernel's coverage with trials at positions that pairs of independent random numbers
/// choose.
#[inline(never)]
pub fn inverse_coverage(
    world: &World,
    look: &GatherPoint,
    radius: f32,
    clip: KernelCoverage,
    mut pair: impl FnMut(u32) -> Vec2,
) -> f32 {
    let frame = Frame::from_normal(look.normal);
    let mut succeeds = |number: u32| {
        let Vec2 { x, y } = sample(warp::disk(pair(number))) * radius;
        receives_photons(world, look, look.point + frame.s * x + frame.t * y, radius)
    };
    match clip {
        KernelCoverage::Fraction(part) => 1.0 / part,
        KernelCoverage::Clipped => mean_trials_per_success(&mut succeeds),
        KernelCoverage::Crowded => mean_after_first(succeeds),
    }
}

/// Returns 1 if the first trial succeeds, which has probability p, and otherwise 1 + 1/p in expectation: p + (1 − p)·(1
/// + 1/p) = 1/p.
fn mean_after_first(mut succeeds: impl FnMut(u32) -> bool) -> f32 {
    if succeeds(0) { 1.0 } else { 1.0 + mean_trials_per_success(|number| succeeds(number + 1)) }
}

/// Mean number of trials per success until `SUCCESSES` trials have succeeded, with expectation 1/p. If the trials end
/// before that, the numbers of trials and of successes are each counted one higher. Over both outcomes, the expectation
/// is (1 − (1 − p)^(MAX_TRIALS + 1))/p: the sums Σ C(n, m)·pᵐ(1 − p)ⁿ⁻ᵐ over the first and Σ C(MAX_TRIALS + 1, s + 1)·pˢ(1 −
/// p)^(MAX_TRIALS − s) over the second are the probabilities of more than m, and of 1 to m, successes in MAX_TRIALS + 1 trials,
/// divided by p, with m = SUCCESSES.
fn mean_trials_per_success(mut succeeds: impl FnMut(u32) -> bool) -> f32 {
    let mut successes = 0;
    for number in 0..MAX_TRIALS {
        successes += u32::from(succeeds(number));
        if successes == SUCCESSES {
            return (number + 1) as f32 / SUCCESSES as f32;
        }
    }
    (MAX_TRIALS + 1) as f32 / (successes + 1) as f32
}

/// Whether a position in the tangent plane has a surface above or below it that may hold photons of the kernel and is
/// not occluded.
fn receives_photons(world: &World, look: &GatherPoint, place: Vec3, radius: f32) -> bool {
    let above = REACH * radius * look.normal;
    let end = place - above;
    let mut start = place + above;
    let may_receive = |id: u32| world.materials_of(id).any(receives);
    for _ in 0..LAYERS {
        let ray = Ray::segment(start, end);
        // Find the next surface below that may receive photons.
        let Some(hit) = world.geometry.closest_of(&ray, may_receive) else { return false };
        let bare = SurfaceRequest { uv: false, shadow_point: false };
        let surface = world.geometry.requested_surface(&ray, &hit, bare);
        // Succeed if it does receive them, has about the same normal, and is not occluded.
        let cosine = surface.normal.dot(look.normal);
        let normal = if cosine < 0.0 { -surface.normal } else { surface.normal };
        let photon = PhotonPosition { point: surface.point, normal };
        if cosine.abs() > MIN_COSINE
            && receives(material(world, hit.object, hit.shape.primitive))
            && !is_occluded(&world.geometry, look, &photon, radius)
        {
            return true;
        }
        // Continue below it.
        start = offset_origin(surface.point, surface.error, surface.normal, ray.direction);
        if (end - start).dot(look.normal) >= 0.0 {
            return false;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit;

    #[test]
    fn trials_estimate_reciprocal_without_bias() {
        let mut next = unit(7);
        for chance in [0.03_f32, 0.1, 0.3, 0.5, 0.9, 1.0] {
            for is_crowded in [false, true] {
                const RUNS: u32 = 100_000;
                let mut value = || {
                    let succeeds = |_: u32| next() < chance;
                    f64::from(if is_crowded {
                        mean_after_first(succeeds)
                    } else {
                        mean_trials_per_success(succeeds)
                    })
                };
                let values: Vec<f64> = (0..RUNS).map(|_| value()).collect();
                let mean = values.iter().sum::<f64>() / f64::from(RUNS);
                let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
                let error = (squares / f64::from(RUNS)).sqrt() / f64::from(RUNS).sqrt();
                let p = f64::from(chance);
                let lost = (1.0 - p).powi(MAX_TRIALS as i32 + 1) / p;
                let off = (mean - 1.0 / p).abs();
                assert!(off < 4.0 * error + lost + 1e-9, "{chance}: {mean} ± {error}");
            }
        }
    }
}
