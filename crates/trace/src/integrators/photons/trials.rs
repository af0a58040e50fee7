//! Unbiased estimate of the reciprocal of a kernel's coverage, from random trials.

use super::coverage::{KernelCoverage, can_store_photons, primitive_material};
use super::kernel::warp_disk_point;
use super::map::{GatherPoint, MAX_PLANE_DISTANCE, MIN_COSINE};
use super::occlusion::is_photon_occluded;
use super::reservoir::PhotonPositionAndNormal;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfaceRequest};
use crate::math::frame::Frame;
use crate::math::{Vec2, Vec3};
use crate::sampling::warp;
use crate::world::World;

/// The trials end after this many successes.
const SUCCESSES: u32 = 4;

/// Maximum number of trials. At most the fraction (1 − p)⁶⁵ of the kernel's light is lost, which is
/// significant only if less than about a tenth of the kernel receives photons.
const MAX_TRIALS: u32 = 64;

/// Maximum number of surfaces examined along the normal at one position in a kernel.
const LAYERS: usize = 8;

/// Estimates the reciprocal of the kernel's coverage with trials at random positions. `pair` returns
/// independent pairs of random numbers.
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
        let Vec2 { x, y } = warp_disk_point(warp::disk(pair(number))) * radius;
        can_position_receive_photons(world, look, look.point + frame.s * x + frame.t * y, radius)
    };
    match clip {
        KernelCoverage::Fraction(part) => 1.0 / part,
        KernelCoverage::Clipped => mean_trials_per_success(&mut succeeds),
        KernelCoverage::Crowded => estimate_reciprocal_probability(succeeds),
    }
}

/// Returns 1 if the first trial succeeds, which has probability p, and otherwise a value with expectation 1 +
/// 1/p. The overall expectation is p + (1 − p)·(1 + 1/p) = 1/p.
fn estimate_reciprocal_probability(mut succeeds: impl FnMut(u32) -> bool) -> f32 {
    if succeeds(0) { 1.0 } else { 1.0 + mean_trials_per_success(|number| succeeds(number + 1)) }
}

/// Mean number of trials per success until `SUCCESSES` trials have succeeded. Its expectation is 1/p. If
/// `MAX_TRIALS` is reached first, the numbers of trials and successes are both increased by one. Over both
/// outcomes, the expectation is (1 − (1 − p)^(MAX_TRIALS + 1))/p. With m = SUCCESSES, the first outcome
/// contributes Σ C(n, m)·pᵐ(1 − p)ⁿ⁻ᵐ and the second Σ C(MAX_TRIALS + 1, s + 1)·pˢ(1 − p)^(MAX_TRIALS − s).
/// These are the probabilities of more than m successes and of 1 to m successes in MAX_TRIALS + 1 trials,
/// divided by p.
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

/// Whether an unoccluded surface above or below a position in the tangent plane can receive the kernel's
/// photons.
fn can_position_receive_photons(world: &World, look: &GatherPoint, place: Vec3, radius: f32) -> bool {
    let above = MAX_PLANE_DISTANCE * radius * look.normal;
    let end = place - above;
    let mut start = place + above;
    let may_receive = |id: u32| {
        world.materials_of(id).any(|one| can_store_photons(one, true) || can_store_photons(one, false))
    };
    for _ in 0..LAYERS {
        let ray = Ray::segment_ending_before_point(start, end);
        // Find the next surface below that may receive photons.
        let Some(hit) = world.geometry.closest_hit_on_objects_where(&ray, may_receive) else { return false };
        let bare = SurfaceRequest { uv: false, shadow_point: false };
        let surface = world.geometry.requested_surface(&ray, &hit, bare);
        // Succeed if the surface receives photons, has about the same normal, and is not occluded.
        let cosine = surface.normal.dot(look.normal);
        let normal = if cosine < 0.0 { -surface.normal } else { surface.normal };
        let photon = PhotonPositionAndNormal { point: surface.point, normal };
        if cosine.abs() > MIN_COSINE
            && can_store_photons(primitive_material(world, hit.object, hit.shape.primitive), cosine > 0.0)
            && !is_photon_occluded(&world.geometry, look, &photon, radius)
        {
            return true;
        }
        // Continue below the surface.
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
    use crate::math::random::unit_generator;

    #[test]
    fn reciprocal_estimate_is_unbiased() {
        let mut next = unit_generator(7);
        for chance in [0.03_f32, 0.1, 0.3, 0.5, 0.9, 1.0] {
            for is_crowded in [false, true] {
                const RUNS: u32 = 100_000;
                let mut value = || {
                    let succeeds = |_: u32| next() < chance;
                    f64::from(if is_crowded {
                        estimate_reciprocal_probability(succeeds)
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
                assert!(error < 6e-3 / p, "{chance}: too noisy: {mean} ± {error}");
                assert!(off < 4.0 * error + lost + 1e-9, "{chance}: {mean} ± {error}");
            }
        }
    }
}
