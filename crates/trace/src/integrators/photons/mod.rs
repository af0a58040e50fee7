//! Photon maps: light that reaches surfaces by mirrors, glass and other surfaces, traced from the lights (Jensen, *Global
//! Illumination using Photon Maps*, 1996). It comes in passes: the maps of each are right but for the width of a kernel that
//! shrinks from pass to pass, so that their mean converges (Hachisuka, Ogaki, Jensen, *Progressive Photon Mapping*, 2008; Knaus and
//! Zwicker, *Progressive Photon Mapping: A Probabilistic Approach*, 2011). Pass i of the photons is sample i of every pixel.
//!
//! Estimators of the paths from lights L by mirrors and glass S and other surfaces D to the eye E; paths from the eye go on
//! from each D:
//!
//! | paths | estimator |
//! | --- | --- |
//! | `L S* E` | the path from the eye meets the light |
//! | `L D … E` | light samples at that D, and the path that meets the light right behind it, weighed against each other |
//! | `L S+ D S* E` | caustic photons at that D |
//! | `L S+ D S* D … E`, the second D without a glossy lobe | bounced photons, at the second D |
//! | `L S+ D S* D … E`, the second D with a glossy lobe | caustic photons at the first D |
//!
//! Photons therefore carry only light that meets mirrors or glass before anything else. Lights that a path from the eye hits behind
//! mirrors and glass, after a D, count nothing. Light from a caustic by one more surface arrives nearly everywhere, from a small
//! place that paths hardly ever find: hence the bounced photons, which are scattered at the caustic. The scatterings of the eye's
//! path, with the vertex at which photons are gathered, and those of the photon are at most `max_depth` together.
//!
//! The light at a point is its kernel's sum, divided by the part p of the kernel that receives photons: surface with about the
//! point's normal, to which the way from the point is free. Thereby even light stays even up to edges, rims and walls. Estimators
//! of p:
//!
//! | around the kernel | estimator |
//! | --- | --- |
//! | flat pieces of its plane, walls at their borders, wide spheres | p in closed form; all of it is reached |
//! | anything else | one photon of the kernel, chosen by its contribution, decides whether the kernel's light arrives; trials, at places chosen by the kernel, give 1/p |

mod clip;
mod emit;
pub(super) mod gather;
mod kernel;
mod map;
mod occlusion;
mod packed;
mod reservoir;
mod trials;

use crate::math::lanes::PlainFolds;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use crate::control::{CancelToken, Cancelled, Progress, unwatched};
use crate::film::Rect;
use crate::geometry::{Aabb, ShapeHit};
use crate::integrators::method::Behaviour;
use crate::integrators::settings::{PhotonSettings, RenderSettings};
use crate::integrators::transport::medium::Inside;
use crate::integrators::transport::tile::{SampleBlock, TileContext};
use crate::lights::{Ball, PhotonSource};
use crate::materials::{Glass, Material};
use crate::scene::description::{Render, Shadows};
use crate::world::{BodyInParts, Hit, LampBox, World, photon_source};
use emit::{EmittedPhotons, PhotonTracing};
pub(super) use map::GatherPoint;
pub use map::{Photon, PhotonMap};

/// Photons that one thread emits together.
const CHUNK: u32 = 2048;

/// α: fraction of the photons of a pass that the shrinking kernel keeps.
const KEPT: f64 = 2.0 / 3.0;

/// Photons that the first kernels should contain, in the median of the caustic photons and of the bounced ones.
const WANTED: [f32; 2] = [12.0, 8.0];

/// Fraction of the photons that are aimed at mirrors and glass: if all of these are in balls, and if some have no bounds.
const AIMED: [f32; 2] = [0.9, 0.5];

/// Common data of all passes of a picture.
#[derive(Debug)]
pub struct Photons {
    settings: PhotonSettings,
    /// Most scatterings of a photon before it is gathered.
    most_depth: u32,
    /// Source of the photons. `None` if nothing mirrors or refracts light.
    emission: Option<PhotonSource>,
    /// The closed shapes of glass that lights may be in.
    glasses: Vec<u32>,
    /// The other bodies of glass that lights may be in.
    bodies: Vec<BodyInParts>,
    /// Radii of the first pass: of the kernel for caustic photons, and of that for bounced ones.
    radii: [f32; 2],
}

/// The photons of a pass.
#[derive(Debug)]
pub struct PhotonPass {
    /// Caustic photons, which came by mirrors and glass alone.
    pub caustic: PhotonMap,
    /// Bounced photons: scattered at a caustic, and arrived elsewhere.
    pub bounced: PhotonMap,
    /// Number of emitted photons.
    pub emitted: u64,
    /// Texture look-ups.
    pub lookups: u64,
}

impl PhotonPass {
    /// Number of stored photons.
    pub fn stored(&self) -> u64 {
        (self.caustic.len() + self.bounced.len()) as u64
    }

    /// Bytes that it takes.
    pub fn memory_bytes(&self) -> usize {
        self.caustic.memory_bytes() + self.bounced.memory_bytes()
    }
}

/// The passes of some samples.
#[derive(Clone, Debug)]
pub struct PhotonMaps {
    /// The first of the samples.
    pub first: u32,
    /// One for each.
    pub passes: Vec<Arc<PhotonPass>>,
}

impl PhotonMaps {
    /// The pass of one of these samples.
    pub fn pass(&self, sample: u32) -> &PhotonPass {
        &self.passes[(sample - self.first) as usize]
    }
}

impl Photons {
    /// Prepares the passes for a world, and traces pass 0, whose photons determine the radii. `progress` gets the number of
    /// photons so far, and of all.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(
        world: &World,
        settings: &RenderSettings,
        photons: PhotonSettings,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<(Self, PhotonPass), Cancelled> {
        // Aim photons at the mirrors and glass.
        let specular = Specular::of(world);
        let emission = photon_source(&world.geometry, &world.lights).filter(|_| specular.exists());
        let aimed = AIMED[usize::from(specular.is_unbounded)];
        let emission = emission.map(|emission| emission.aimed_at(&specular.balls, aimed));
        let (glasses, bodies) = glasses_at_lights(world);
        let most_depth = photons.bounces.min(settings.render.max_depth.saturating_sub(1));
        let radii = [photons.radius; 2];
        let mut own = Self { settings: photons, most_depth, emission, glasses, bodies, radii };
        // Trace pass 0, and choose the radii by its photons.
        let sent = own.trace_photons((world, settings), 0, progress, token)?;
        if photons.radius == 0.0 {
            let kinds = [&sent.caustic, &sent.bounced];
            let size = own.emission.as_ref().map_or(1.0, |emission| emission.around().radius as f32);
            let radii = kinds.into_par_iter().zip(WANTED);
            let radii = radii.map(|(of, wanted)| radius_to_hold(of, wanted, size, token));
            let radii = radii.collect::<Result<Vec<_>, _>>()?;
            own.radii.iter_mut().zip(radii).for_each(|(own, radius)| *own = radius);
        }
        let first = own.mapped(&sent, 0, token)?;
        Ok((own, first))
    }

    /// Radii of the first pass's kernels: for caustic photons, and for bounced ones.
    pub fn radii(&self) -> [f32; 2] {
        self.radii
    }

    /// Photons emitted in a pass; 0 if there is no emission.
    pub fn count(&self) -> u64 {
        if self.are_sent() { self.settings.count.into() } else { 0 }
    }

    /// Whether photons are emitted at all: there are mirrors or glass, and lights that illuminate them.
    pub fn are_sent(&self) -> bool {
        self.emission.is_some() && self.most_depth > 0
    }

    /// Traces a pass. It depends on its number alone, whatever the threads.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn pass(
        &self,
        world: &World,
        settings: &RenderSettings,
        number: u32,
        token: &CancelToken,
    ) -> Result<PhotonPass, Cancelled> {
        let sent = self.trace_photons((world, settings), number, &unwatched, token)?;
        self.mapped(&sent, number, token)
    }

    /// The maps of a pass.
    fn mapped(&self, sent: &Sent, number: u32, token: &CancelToken) -> Result<PhotonPass, Cancelled> {
        let shrunk = shrunk(number);
        let [of_caustic, of_bounced] = self.radii.map(|radius| (f64::from(radius) * shrunk) as f32);
        let map = |of: &[Photon], radius: f32| PhotonMap::new(of, radius, token);
        let (caustic, bounced) =
            rayon::join(|| map(&sent.caustic, of_caustic), || map(&sent.bounced, of_bounced));
        Ok(PhotonPass { caustic: caustic?, bounced: bounced?, emitted: self.count(), lookups: sent.lookups })
    }

    /// The passes of some samples.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn maps(
        &self,
        world: &World,
        settings: &RenderSettings,
        samples: Range<u32>,
        token: &CancelToken,
    ) -> Result<PhotonMaps, Cancelled> {
        let first = samples.start;
        let pass = |number| self.pass(world, settings, number, token).map(Arc::new);
        Ok(PhotonMaps { first, passes: samples.map(pass).collect::<Result<_, _>>()? })
    }

    /// The photons of a pass in the order of their numbers.
    fn trace_photons(
        &self,
        (world, settings): (&World, &RenderSettings),
        number: u32,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<Sent, Cancelled> {
        let Some(emission) = self.emission.as_ref().filter(|_| self.are_sent()) else {
            return Ok(Sent::default());
        };
        // Photons land on the facets, from which they are scattered in every picture alike.
        let settings =
            RenderSettings { render: Render { shadows: Shadows::Soft, ..settings.render }, ..*settings };
        let material = |object| world.material_index(&Hit { shape: ShapeHit::at(0.0), object }) as u32;
        let inside = |&body: &u32| Inside { body, material: material(body) };
        let glasses: &[Inside] = &self.glasses.iter().map(inside).collect::<Vec<_>>();
        let behaviour = Behaviour::of(&settings, false);
        let done = AtomicU64::new(0);
        let chunk = |first: u32| {
            // All photons of a number of passes are samples of one sequence.
            let count = self.settings.count;
            let at_once = u32::MAX / count;
            let start = number % at_once * count;
            let samples = start + first..start + (first + CHUNK).min(count);
            let place = Rect { x: number / at_once, y: u32::MAX, width: 1, height: 1 };
            let block = SampleBlock { pixels: place.into(), samples };
            let tile = TileContext {
                pixel_spread: 0.0,
                ..TileContext::new(world, &settings, &block, token, behaviour)
            };
            let (share, most_depth) = (1.0 / count as f32, self.most_depth);
            let shots =
                PhotonTracing { tile: &tile, emission, glasses, bodies: &self.bodies, share, most_depth }
                    .trace_photons()?;
            let done = done.fetch_add(block.len() as u64, Ordering::Relaxed) + block.len() as u64;
            progress(done, count.into());
            Ok(shots)
        };
        let chunks: Vec<EmittedPhotons> = (0..self.settings.count.div_ceil(CHUNK))
            .into_par_iter()
            .map(|number| chunk(number * CHUNK))
            .collect::<Result<_, _>>()?;
        let lookups = chunks.iter().map(|chunk| chunk.lookups).sum();
        let joined = |of: fn(&EmittedPhotons) -> &[Photon]| -> Result<Vec<Photon>, Cancelled> {
            let mut all = Vec::with_capacity(chunks.iter().map(|chunk| of(chunk).len()).sum());
            for chunk in &chunks {
                token.check()?;
                all.extend_from_slice(of(chunk));
            }
            Ok(all)
        };
        let (caustic, bounced) =
            rayon::join(|| joined(|chunk| &chunk.caustic), || joined(|chunk| &chunk.bounced));
        let (caustic, bounced) = (caustic?, bounced?);
        Ok(Sent { caustic, bounced, lookups })
    }
}

/// Stored photons of a pass.
#[derive(Default)]
struct Sent {
    /// Caustic photons, which came by mirrors and glass alone.
    caustic: Vec<Photon>,
    /// Bounced photons, scattered at a caustic.
    bounced: Vec<Photon>,
    lookups: u64,
}

/// Radius of a pass relative to that of the first: r²ᵢ₊₁ = r²ᵢ·(i + α)/(i + 1).
fn shrunk(pass: u32) -> f64 {
    (1..=pass).map(f64::from).map(|i| (i + KEPT) / (i + 1.0)).product::<f64>().sqrt()
}

/// A radius within which the median photon has so many neighbours; `size` is the radius of a ball around the scene.
fn radius_to_hold(photons: &[Photon], wanted: f32, size: f32, token: &CancelToken) -> Result<f32, Cancelled> {
    /// Most photons that are examined.
    const MOST: usize = 1 << 14;
    const LOOKS: usize = 256;
    /// Neighbours that are found among the examined photons.
    const NEAR: f32 = 12.0;
    /// Largest radius, and the radius if there are too few photons to decide, in radii of the scene.
    const LARGEST: f32 = 0.05;
    const BY_DEFAULT: f32 = 0.02;
    let step = photons.len().div_ceil(MOST).max(1);
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
        // Count others than the photon itself.
        let count = |&Photon { point, normal, .. }: &Photon| {
            map.count_around(&GatherPoint { point, normal, most_depth: u32::MAX }, PlainFolds)
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

/// The closed shapes of glass that lights may be in, and the other bodies.
fn glasses_at_lights(world: &World) -> (Vec<u32>, Vec<BodyInParts>) {
    let lamps = world.lamp_boxes();
    let may_hold_light = |object: &u32| {
        let bounds = world.geometry.objects()[*object as usize].bounds();
        bounds.is_none_or(|bounds| lamps.iter().any(|lamp| lamp.meets(&bounds)))
    };
    let closed = world.closed_glasses().map(|(object, _)| object).filter(may_hold_light).collect();
    // What opaque surfaces close may reach out of its box: ask for the middle and the corners of each lamp.
    let is_around = |body: &BodyInParts, lamp: &LampBox| {
        lamp.points().any(|point| world.material_around(body, point, lamp.object).is_some())
    };
    let mut bodies = world.bodies_in_parts();
    bodies.retain(|body| {
        lamps.iter().any(|lamp| lamp.meets(&body.bounds) || body.is_covered && is_around(body, lamp))
    });
    (closed, bodies)
}

/// Objects of glass with their boxes, and their indices of refraction.
struct Glasses(Vec<(u32, Option<Aabb>, f32)>);

impl Glasses {
    fn of(world: &World) -> Self {
        let each = (0..).zip(world.geometry.objects()).flat_map(|(id, object)| {
            let glasses = world.materials_of(id).filter_map(|material| material.bsdf.glass());
            glasses.map(move |glass| (id, object.bounds(), glass.ior))
        });
        Self(each.collect())
    }

    /// Whether the surface of an object may be no boundary: its glass has the index of air, or may touch or overlap glass of the same
    /// index.
    fn may_vanish(&self, id: u32, ior: f32) -> bool {
        let own = self.0.iter().find(|(other, ..)| *other == id).and_then(|(_, bounds, _)| *bounds);
        let meets = |other: &Aabb| own.is_none_or(|own| own.grown(own.extent() * NEAR).meets(other));
        let is_met = |(other, bounds, index): &(u32, Option<Aabb>, f32)| {
            *other != id && *index == ior && bounds.as_ref().is_none_or(meets)
        };
        ior == 1.0 || self.0.iter().any(is_met)
    }
}

/// Distance between boxes whose shapes may touch, by the size of one.
const NEAR: f32 = 1e-3;

/// Mirrors and glass.
struct Specular {
    /// Balls around those that have bounds.
    balls: Vec<Ball>,
    /// Whether others exist.
    is_unbounded: bool,
}

impl Specular {
    fn of(world: &World) -> Self {
        let mut own = Self { balls: Vec::new(), is_unbounded: false };
        let glasses = Glasses::of(world);
        for (id, object) in (0..).zip(world.geometry.objects()) {
            // Where indices are equal, light goes through rough glass as if there were nothing, but not on the way of a light sample.
            let is_specular = |material: &Material| {
                let is_passed = |glass: &Glass| glasses.may_vanish(id, glass.ior);
                material.bsdf.has_delta() || material.bsdf.glass().is_some_and(is_passed)
            };
            if world.materials_of(id).any(is_specular) {
                own.balls.extend(object.ball());
                own.is_unbounded |= object.ball().is_none();
            }
        }
        own
    }

    fn exists(&self) -> bool {
        self.is_unbounded || !self.balls.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;

    #[test]
    fn the_radius_shrinks_as_the_squared_error_asks_for() {
        // r²ᵢ₊₁ = r²ᵢ·(i + α)/(i + 1), α = 2/3 (Knaus and Zwicker, 2011).
        for (passes, exact) in [(1, 1.0), (100, 0.4882), (1000, 0.3328), (10_000, 0.2267)] {
            assert!((shrunk(passes - 1) - exact).abs() < 1e-3, "{passes}: {}", shrunk(passes - 1));
        }
    }

    #[test]
    fn radii_are_held_to_a_part_of_the_scene() {
        // Photons on a square of side 1: 12 are on a disc of radius √(12/100π) = .195.
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
            radius_to_hold(&photons(side), 12.0, size, &CancelToken::new()).expect("nobody cancels")
        };
        assert_eq!(radius(10, 1.0), 0.05);
        assert!((radius(10, 100.0) / 0.195 - 1.0).abs() < 0.2, "{}", radius(10, 100.0));
        assert!((radius(100, 1.0) / 0.0195 - 1.0).abs() < 0.2, "{}", radius(100, 1.0));
        // There are too few photons to decide.
        assert_eq!(radius(3, 1.0), 0.02);
    }
}
