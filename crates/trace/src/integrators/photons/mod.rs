//! Photon mapping: light that reaches surfaces through mirrors, glass and other surfaces, traced from the
//! lights (Jensen, *Global Illumination using Photon Maps*, 1996). Photons are traced in passes. The only
//! bias of a pass is the width of a kernel that shrinks from pass to pass, so the mean over passes converges
//! (Hachisuka, Ogaki, Jensen, *Progressive Photon Mapping*, 2008; Knaus and Zwicker, *Progressive Photon
//! Mapping: A Probabilistic Approach*, 2011). Pass i is used for sample i of every pixel.
//!
//! Estimators for paths from lights L via mirrors and glass S and other surfaces D to the eye E. Camera paths
//! continue at each D:
//!
//! | paths | estimator |
//! | --- | --- |
//! | `L S* E` | the camera path hits the light |
//! | `L D … E` | light samples at that D and the camera path that hits the light directly after it, combined with MIS |
//! | `L S+ D S* E` | caustic photons at that D |
//! | `L S+ D S* D … E`, the second D without a glossy lobe | bounced photons, at the second D |
//! | `L S+ D S* D … E`, the second D with a glossy lobe | caustic photons at the first D |
//!
//! Photons therefore represent only light that first hits mirrors or glass, and camera paths ignore lights
//! that they hit via mirrors and glass after a D. Light scattered once at a caustic reaches most of the scene
//! from a small region that camera paths rarely hit, so it is represented by bounced photons, which are
//! scattered at the caustic. The total number of bounces is at most `max_depth`. It includes the bounces of
//! the camera path, the vertex at which photons are gathered, and the bounces of the photon.
//!
//! The light at a point is the sum over its kernel divided by the kernel's coverage p: the fraction of the
//! kernel that receives photons. Surfaces are included if they have about the point's normal and are not
//! occluded from the point. With this correction, uniform light stays uniform up to edges, rims and walls.
//! Estimators of p:
//!
//! | around the kernel | estimator |
//! | --- | --- |
//! | flat pieces of its plane, walls at their borders, large spheres | p in closed form, without occlusion |
//! | anything else | one photon of the kernel, chosen by its contribution, determines whether the kernel is occluded, and trials at positions sampled from the kernel estimate 1/p |

mod coverage;
mod emit;
pub(super) mod gather;
mod kernel;
mod map;
mod occlusion;
mod packed;
mod reservoir;
mod trials;

use crate::math::lanes::PortableSimd;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use crate::control::{CancelToken, Canceled, Progress, ignore_progress};
use crate::film::Rect;
use crate::geometry::{Aabb, ShapeHit};
use crate::integrators::behavior::PathBehavior;
use crate::integrators::settings::{PhotonSettings, RenderSettings};
use crate::integrators::transport::interiors::Interior;
use crate::integrators::transport::tile::{SampleBlock, TileContext};
use crate::lights::{BoundingSphere, PhotonEmitter};
use crate::materials::{Dielectric, Material};
use crate::scene::description::{RenderOptions, ShadowMode};
use crate::world::{CompoundSolid, Hit, LightBoundingBoxes, World, scene_photon_emitter};
use emit::{PhotonTracer, StoredPhotonChunk};
pub(super) use map::GatherPoint;
pub use map::{Photon, PhotonMap};

/// Number of photons that a thread emits at a time.
const PHOTONS_PER_JOB: u32 = 2048;

/// α, the fraction of a pass's photons kept by the shrinking kernel.
const ALPHA: f64 = 2.0 / 3.0;

/// Target median photon count in the first pass's kernels, for caustic and bounced photons.
const TARGET_KERNEL_PHOTONS: [f32; 2] = [12.0, 8.0];

/// Fractions of photons aimed at mirrors and glass: the first if all of these objects are bounded, the second
/// if some are unbounded.
const AIMED_FRACTIONS: [f32; 2] = [0.9, 0.5];

/// Photon emission for an image, shared by all passes.
#[derive(Debug)]
pub struct PhotonPassTracer {
    settings: PhotonSettings,
    /// Maximum number of bounces per photon before it is gathered.
    max_depth: u32,
    /// Source of the photons, or `None` if the scene has no mirrors or glass.
    emission: Option<PhotonEmitter>,
    /// Closed glass shapes that may contain lights.
    glasses: Vec<u32>,
    /// Other glass solids that may contain lights.
    bodies: Vec<CompoundSolid>,
    /// First-pass kernel radii for caustic and bounced photons.
    radii: [f32; 2],
}

/// The photon maps from one pass.
#[derive(Debug)]
pub struct PhotonPass {
    /// Caustic photons, scattered only by mirrors and glass.
    pub caustic: PhotonMap,
    /// Bounced photons, scattered once at a caustic.
    pub bounced: PhotonMap,
    /// Number of emitted photons.
    pub emitted: u64,
    /// Number of texture lookups.
    pub lookups: u64,
}

impl PhotonPass {
    /// Number of stored photons.
    pub fn stored_photon_count(&self) -> u64 {
        (self.caustic.len() + self.bounced.len()) as u64
    }

    /// Memory use in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.caustic.memory_bytes() + self.bounced.memory_bytes()
    }
}

/// Photon passes for a range of samples.
#[derive(Clone, Debug)]
pub struct PhotonPassesBySample {
    /// Index of the first sample.
    pub first: u32,
    /// One pass per sample.
    pub passes: Vec<Arc<PhotonPass>>,
}

impl PhotonPassesBySample {
    /// Photon pass for a sample.
    pub fn pass_for_sample(&self, sample: u32) -> &PhotonPass {
        &self.passes[(sample - self.first) as usize]
    }
}

impl PhotonPassTracer {
    /// Prepares photon emission for a world and traces pass 0, whose photons determine the radii. `progress`
    /// receives the number of photons traced so far and the total number.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn new_and_trace_first_pass(
        world: &World,
        settings: &RenderSettings,
        photons: PhotonSettings,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<(Self, PhotonPass), Canceled> {
        // Aim photons at the mirrors and glass.
        let specular = SpecularObjectBounds::from_world(world);
        let emission = scene_photon_emitter(&world.geometry, &world.lights).filter(|_| specular.has_any());
        let aimed = AIMED_FRACTIONS[usize::from(specular.is_unbounded)];
        let emission = emission.map(|emission| emission.with_targets(&specular.balls, aimed));
        let (glasses, bodies) = light_enclosing_glass_candidates(world);
        let max_depth = photons.bounces.min(settings.render.max_depth.saturating_sub(1));
        let radii = [photons.radius; 2];
        let mut own = Self { settings: photons, max_depth, emission, glasses, bodies, radii };
        // Trace pass 0, and choose the radii from its photons.
        let sent = own.trace_photons((world, settings), 0, progress, token)?;
        if photons.radius == 0.0 {
            let kinds = [&sent.caustic, &sent.bounced];
            let size =
                own.emission.as_ref().map_or(1.0, |emission| emission.finite_scene_bounds().radius as f32);
            let radii = kinds.into_par_iter().zip(TARGET_KERNEL_PHOTONS);
            let radii = radii.map(|(of, wanted)| radius_for_neighbor_count(of, wanted, size, token));
            let radii = radii.collect::<Result<Vec<_>, _>>()?;
            own.radii.iter_mut().zip(radii).for_each(|(own, radius)| *own = radius);
        }
        let first = own.build_maps_from_photons(&sent, 0, token)?;
        Ok((own, first))
    }

    /// First-pass kernel radii for caustic and bounced photons.
    pub fn first_pass_radii(&self) -> [f32; 2] {
        self.radii
    }

    /// Number of photons emitted per pass, which may be 0.
    pub fn photons_per_pass(&self) -> u64 {
        if self.emits_photons() { self.settings.count.into() } else { 0 }
    }

    /// Whether photons are emitted, which requires mirrors or glass and a light that illuminates them.
    pub fn emits_photons(&self) -> bool {
        self.emission.is_some() && self.max_depth > 0
    }

    /// Traces a pass. The result depends on the pass number but not on the number of threads.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn trace_pass(
        &self,
        world: &World,
        settings: &RenderSettings,
        number: u32,
        token: &CancelToken,
    ) -> Result<PhotonPass, Canceled> {
        let sent = self.trace_photons((world, settings), number, &ignore_progress, token)?;
        self.build_maps_from_photons(&sent, number, token)
    }

    /// Builds the photon maps for a pass.
    fn build_maps_from_photons(
        &self,
        sent: &StoredPhotons,
        number: u32,
        token: &CancelToken,
    ) -> Result<PhotonPass, Canceled> {
        let shrunk = radius_relative_to_first_pass(number);
        let [of_caustic, of_bounced] = self.radii.map(|radius| (f64::from(radius) * shrunk) as f32);
        let map = |of: &[Photon], radius: f32| PhotonMap::new(of, radius, token);
        let (caustic, bounced) =
            rayon::join(|| map(&sent.caustic, of_caustic), || map(&sent.bounced, of_bounced));
        Ok(PhotonPass {
            caustic: caustic?,
            bounced: bounced?,
            emitted: self.photons_per_pass(),
            lookups: sent.lookups,
        })
    }

    /// Traces the photon passes for a range of samples.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn trace_passes_for_samples(
        &self,
        world: &World,
        settings: &RenderSettings,
        samples: Range<u32>,
        token: &CancelToken,
    ) -> Result<PhotonPassesBySample, Canceled> {
        let first = samples.start;
        let pass = |number| self.trace_pass(world, settings, number, token).map(Arc::new);
        Ok(PhotonPassesBySample { first, passes: samples.map(pass).collect::<Result<_, _>>()? })
    }

    /// Traces the photons of a pass and returns them in emission order.
    fn trace_photons(
        &self,
        (world, settings): (&World, &RenderSettings),
        number: u32,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<StoredPhotons, Canceled> {
        let Some(emission) = self.emission.as_ref().filter(|_| self.emits_photons()) else {
            return Ok(StoredPhotons::default());
        };
        // Photons always hit the facets and scatter from there, regardless of the shadow setting.
        let settings = RenderSettings {
            render: RenderOptions { shadows: ShadowMode::Soft, ..settings.render },
            ..*settings
        };
        let material = |object| world.material_index(&Hit { shape: ShapeHit::from_t(0.0), object }) as u32;
        let inside = |&body: &u32| Interior { body, material: material(body) };
        let glasses: &[Interior] = &self.glasses.iter().map(inside).collect::<Vec<_>>();
        let behavior = PathBehavior::from_settings(&settings, false);
        let done = AtomicU64::new(0);
        let chunk = |first: u32| {
            // The photons of consecutive passes are samples of a single sequence.
            let count = self.settings.count;
            let at_once = u32::MAX / count;
            let start = number % at_once * count;
            let samples = start + first..start + (first + PHOTONS_PER_JOB).min(count);
            let place = Rect { x: number / at_once, y: u32::MAX, width: 1, height: 1 };
            let block = SampleBlock { pixels: place.into(), samples, mirrored_width: None };
            let tile = TileContext {
                camera_cone: None,
                ..TileContext::new(world, &settings, &block, token, behavior)
            };
            let (flux_scale, max_depth) = (1.0 / count as f32, self.max_depth);
            let stored =
                PhotonTracer { tile: &tile, emission, glasses, bodies: &self.bodies, flux_scale, max_depth }
                    .trace_photons()?;
            let done =
                done.fetch_add(block.sample_count() as u64, Ordering::Relaxed) + block.sample_count() as u64;
            progress(done, count.into());
            Ok(stored)
        };
        let chunks: Vec<StoredPhotonChunk> = (0..self.settings.count.div_ceil(PHOTONS_PER_JOB))
            .into_par_iter()
            .map(|number| chunk(number * PHOTONS_PER_JOB))
            .collect::<Result<_, _>>()?;
        let lookups = chunks.iter().map(|chunk| chunk.lookups).sum();
        let joined = |of: fn(&StoredPhotonChunk) -> &[Photon]| -> Result<Vec<Photon>, Canceled> {
            let mut all = Vec::with_capacity(chunks.iter().map(|chunk| of(chunk).len()).sum());
            for chunk in &chunks {
                token.check_pause_and_cancel()?;
                all.extend_from_slice(of(chunk));
            }
            Ok(all)
        };
        let (caustic, bounced) =
            rayon::join(|| joined(|chunk| &chunk.caustic), || joined(|chunk| &chunk.bounced));
        let (caustic, bounced) = (caustic?, bounced?);
        Ok(StoredPhotons { caustic, bounced, lookups })
    }
}

/// Photons stored by a pass.
#[derive(Default)]
struct StoredPhotons {
    /// Caustic photons, scattered only by mirrors and glass.
    caustic: Vec<Photon>,
    /// Bounced photons, scattered at a caustic.
    bounced: Vec<Photon>,
    lookups: u64,
}

/// Kernel radius of a pass relative to the first pass: r²ᵢ₊₁ = r²ᵢ·(i + α)/(i + 1).
fn radius_relative_to_first_pass(pass: u32) -> f64 {
    (1..=pass).map(f64::from).map(|i| (i + ALPHA) / (i + 1.0)).product::<f64>().sqrt()
}

/// Radius within which the median photon has `wanted` neighbors. `size` is the radius of the scene's bounding
/// sphere.
fn radius_for_neighbor_count(
    photons: &[Photon],
    wanted: f32,
    size: f32,
    token: &CancelToken,
) -> Result<f32, Canceled> {
    /// Maximum number of photons examined.
    const MAX_EXAMINED: usize = 1 << 14;
    const LOOKS: usize = 256;
    /// Number of neighbors to find among the examined photons.
    const NEAR: f32 = 12.0;
    /// Maximum radius, and default radius for too few photons, both relative to the scene's radius.
    const LARGEST: f32 = 0.05;
    const BY_DEFAULT: f32 = 0.02;
    let step = photons.len().div_ceil(MAX_EXAMINED).max(1);
    let some: Vec<Photon> = photons.iter().step_by(step).copied().collect();
    let bounds = some.iter().fold(Aabb::EMPTY, |all, one| all.union(Aabb { min: one.point, max: one.point }));
    let extent = (bounds.max - bounds.min).length();
    if some.len() as f32 <= 2.0 * NEAR || !(extent > 0.0) {
        return Ok(BY_DEFAULT * size);
    }
    let largest = LARGEST * size;
    let mut radius = largest.min(0.05 * extent);
    for _ in 0..12 {
        let map = PhotonMap::new(&some, radius, token)?;
        // Do not count the photon itself.
        let count = |&Photon { point, normal, .. }: &Photon| {
            map.count_near(&GatherPoint { point, normal, max_depth: u32::MAX }, PortableSimd)
                .saturating_sub(1)
        };
        let mut counts: Vec<u32> = some.iter().step_by(some.len().div_ceil(LOOKS)).map(count).collect();
        counts.sort_unstable();
        let middle = counts[counts.len() / 2] as f32;
        let factor = (NEAR / middle.max(0.5)).sqrt();
        radius *= factor.clamp(0.2, 4.0);
        if (0.8..1.25).contains(&factor) {
            break;
        }
    }
    Ok(largest.min(radius * (wanted / (NEAR * step as f32)).sqrt()))
}

/// Closed glass shapes and other glass solids that may contain lights.
fn light_enclosing_glass_candidates(world: &World) -> (Vec<u32>, Vec<CompoundSolid>) {
    let light_boxes = world.finite_light_boxes();
    let may_contain_light = |object: &u32| {
        let bounds = world.geometry.objects()[*object as usize].bounds();
        bounds
            .is_none_or(|bounds| light_boxes.iter().any(|light| light.may_light_source_overlap_box(&bounds)))
    };
    let closed = world.closed_glass_shapes().map(|(object, _)| object).filter(may_contain_light).collect();
    // A solid closed by opaque surfaces may extend beyond its bounding box, so test the center and corners of
    // each light.
    let encloses_light = |body: &CompoundSolid, light: &LightBoundingBoxes| {
        light
            .smaller_box_center_and_corners()
            .any(|point| world.glass_material_around_point(body, point, light.object).is_some())
    };
    let mut bodies = world.find_compound_glass_solids();
    bodies.retain(|body| {
        light_boxes.iter().any(|light| {
            light.may_light_source_overlap_box(&body.bounds) || body.is_covered && encloses_light(body, light)
        })
    });
    (closed, bodies)
}

/// Glass objects with their bounding boxes and indices of refraction.
struct GlassObjectBoundsList(Vec<(u32, Option<Aabb>, f32)>);

impl GlassObjectBoundsList {
    fn from_world(world: &World) -> Self {
        let each = (0..).zip(world.geometry.objects()).flat_map(|(id, object)| {
            let glasses = world.materials_of(id).filter_map(|material| material.bsdf.as_dielectric());
            glasses.map(move |glass| (id, object.bounds(), glass.ior))
        });
        Self(each.collect())
    }

    /// Whether light may pass through a glass object's surface unchanged, because the object's index of
    /// refraction is 1 or the object may touch or overlap glass with the same index.
    fn may_be_index_matched(&self, id: u32, ior: f32) -> bool {
        let own = self.0.iter().find(|(other, ..)| *other == id).and_then(|(_, bounds, _)| *bounds);
        let may_touch =
            |other: &Aabb| own.is_none_or(|own| own.expanded(own.extent() * NEAR).overlaps(other));
        let matches_other_glass = |(other, bounds, index): &(u32, Option<Aabb>, f32)| {
            *other != id && *index == ior && bounds.as_ref().is_none_or(may_touch)
        };
        ior == 1.0 || self.0.iter().any(matches_other_glass)
    }
}

/// Distance below which the shapes in two boxes may touch, relative to the size of one box.
const NEAR: f32 = 1e-3;

/// The mirrors and glass objects in a scene.
struct SpecularObjectBounds {
    /// Bounding spheres of the bounded objects.
    balls: Vec<BoundingSphere>,
    /// Whether there are unbounded objects.
    is_unbounded: bool,
}

impl SpecularObjectBounds {
    fn from_world(world: &World) -> Self {
        let mut own = Self { balls: Vec::new(), is_unbounded: false };
        let glasses = GlassObjectBoundsList::from_world(world);
        for (id, object) in (0..).zip(world.geometry.objects()) {
            // Between equal indices of refraction, light passes through rough glass unchanged, but shadow
            // rays are blocked.
            let is_specular = |material: &Material| {
                let is_passed = |glass: &Dielectric| glasses.may_be_index_matched(id, glass.ior);
                material.bsdf.has_delta() || material.bsdf.as_dielectric().is_some_and(is_passed)
            };
            if world.materials_of(id).any(is_specular) {
                own.balls.extend(object.bounding_sphere());
                own.is_unbounded |= object.bounding_sphere().is_none();
            }
        }
        own
    }

    fn has_any(&self) -> bool {
        self.is_unbounded || !self.balls.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn radius_shrinks_according_to_the_paper() {
        // r²ᵢ₊₁ = r²ᵢ·(i + α)/(i + 1), α = 2/3 (Knaus and Zwicker, 2011).
        for (passes, exact) in [(1, 1.0), (100, 0.4882), (1000, 0.3328), (10_000, 0.2267)] {
            assert!(
                (radius_relative_to_first_pass(passes - 1) - exact).abs() < 1e-3,
                "{passes}: {}",
                radius_relative_to_first_pass(passes - 1)
            );
        }
    }

    #[test]
    fn first_radius_is_bounded_by_the_scene() {
        // Photons on a unit square: a disk of radius √(12/100π) = .195 contains 12.
        let photons = |side: u16| -> Vec<Photon> {
            let all = (0..side).flat_map(|x| (0..side).map(move |y| (f32::from(x), f32::from(y))));
            let place = |(x, y)| Photon {
                point: Vec3::new(x, 0.0, y) / f32::from(side),
                direction: Vec3::Y,
                flux: Vec3::ONE,
                normal: Vec3::Y,
                depth: 1,
            };
            all.map(place).collect()
        };
        let radius = |side, size| {
            radius_for_neighbor_count(&photons(side), 12.0, size, &CancelToken::new())
                .expect("never canceled")
        };
        assert_eq!(radius(10, 1.0), 0.05);
        assert!((radius(10, 100.0) / 0.195 - 1.0).abs() < 0.2, "{}", radius(10, 100.0));
        assert!((radius(100, 1.0) / 0.0195 - 1.0).abs() < 0.2, "{}", radius(100, 1.0));
        // Too few photons to determine the radius.
        assert_eq!(radius(3, 1.0), 0.02);
    }
}
