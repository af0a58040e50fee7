//! Scattering of paths at diffuse and glossy surfaces, sixteen at a time; Russian roulette; and the MIS weights of paths that
//! hit a lamp which light samples find too.

use super::beside::weight;
use super::cone::Cone;
use super::lit_row::{LitRow, Response};
use super::medium::Medium;
use super::ray::{History, PathRay};
use super::shot::Shot;
use super::specular::SCATTERED;
use crate::geometry::rows::lanes;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::{Met, Source};
use crate::materials::TexturePoint;
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes, Lanes3, lane, set_lane};
use crate::sampling::Decision;
use crate::world::{Hit, Loops};

/// Continuation of the paths of a round.
#[derive(Clone, Copy, Debug)]
pub struct Onward {
    /// Whether paths go on, and would find anything: after the last scattering, only lamps.
    pub leads_on: bool,
    /// Whether Russian roulette applies.
    pub is_risked: bool,
}

impl Onward {
    /// Scatterings before Russian roulette begins.
    const SURE: u32 = 3;

    /// The continuation from vertices after so many scatterings.
    pub fn new(shot: &Shot<'_>, depth: u32) -> Self {
        let emits = || shot.world.materials.iter().any(|material| material.emission.shines());
        let max_depth = shot.settings.render.max_depth;
        let shines = || shot.world.lights.are_beyond() || emits();
        let leads_on = depth + 1 < max_depth || depth + 1 == max_depth && shines();
        Self { leads_on, is_risked: depth >= Self::SURE }
    }

    /// Survival probability of a path: the root of its throughput, as its part of the variance goes with the square of its
    /// throughput (Bolin and Meyer, *An Error Metric for Monte Carlo Ray Tracing*, 1997).
    #[inline(always)]
    fn chance(self, carried: f32) -> f32 {
        if self.is_risked & (carried < 1.0) { carried.sqrt() } else { 1.0 }
    }

    /// Russian roulette for a path after a mirror or glass. `None` if it ends; survivors are reweighted.
    pub fn spared(self, shot: &Shot<'_>, mut path: PathRay) -> Option<PathRay> {
        let chance = self.chance(path.history.carried);
        if chance < 1.0 {
            if !(shot.sampler(path.slot).pair(path.path, Decision::Spared).x < chance) {
                return None;
            }
            path.throughput /= chance;
            path.history.carried /= chance;
        }
        Some(path)
    }
}

/// Scatters paths at the vertices of a row.
pub struct Scattering<'a> {
    /// Context of the tile.
    pub shot: &'a Shot<'a>,
    /// The vertices.
    pub row: &'a LitRow,
    /// A bit for each vertex at which paths go on.
    pub used: u32,
    /// Continuation of the paths.
    pub onward: Onward,
}

/// Scattered directions at the vertices of a row.
pub struct Ways {
    /// A bit for each path that goes on.
    alive: u32,
    /// Unit directions.
    directions: Lanes3,
    /// Their pdfs in sr⁻¹.
    densities: Lanes,
    /// Factors on the throughput.
    factors: Lanes3,
    /// Factors on [`History::carried`].
    carried: Lanes,
}

impl Scattering<'_> {
    /// Adds the rays of the next round. `media` are those of the vertices; `cones` are the beams at the vertices, by place, if
    /// beams are requested.
    pub fn scatter(self, media: &[Medium], cones: &[Cone], next: &mut Vec<PathRay>) {
        let row = self.row;
        let ways = self.shot.world.geometry.instructions().run(self);
        let of_lobe = |density: f32| move |cone: &Cone| cone.scattered(density);
        next.extend(lanes(ways.alive).map(|i| {
            let mut path = PathRay {
                ray: Ray::new(lane(&row.from, i), lane(&ways.directions, i)),
                throughput: lane(&row.throughput, i) * lane(&ways.factors, i),
                slot: row.slot[i],
                path: row.path[i],
                medium: media[row.medium[i] as usize],
                history: History {
                    density: ways.densities[i],
                    normal: lane(&row.normal, i),
                    carried: ways.carried[i],
                    is_seen: false,
                    is_step: row.seen & 1 << i != 0,
                    is_from_gloss: row.albedos[1][i] > 0.0,
                },
                cone: cones.get(row.place[i] as usize).map_or(Cone::default(), of_lobe(ways.densities[i])),
            };
            path.path = path.next_path(SCATTERED);
            path
        }));
    }
}

impl Loops for Scattering<'_> {
    type Done = Ways;

    #[inline(always)]
    fn run(self, folds: impl Folds) -> Ways {
        let Self { shot, row, used, onward } = self;
        let sampler = row.sampler(shot);
        // Sample a direction for each vertex.
        let u = sampler.pairs(&row.path, Decision::Direction, 0, 1);
        let [lobe, _] =
            if row.is_glossy { sampler.pairs(&row.path, Decision::Lobe, 0, 1) } else { [[0.0; LANES]; 2] };
        let mut directions = [[0.0; LANES]; 3];
        if row.is_glossy {
            for i in 0..LANES {
                set_lane(&mut directions, i, row.lobes(i).sample(lobe[i], [u[0][i], u[1][i]]));
            }
        } else {
            for i in 0..LANES {
                set_lane(&mut directions, i, row.lobes(i).sample_diffuse([u[0][i], u[1][i]]));
            }
        }
        // Evaluate the BSDF and the pdf there.
        let Response { f, cosines, glosses } = row.response(&directions);
        let [mut densities, mut carried] = [[0.0; LANES]; 2];
        let mut factors = f;
        let mut alive = 0_u32;
        for i in 0..LANES {
            let lobes = row.lobes(i);
            densities[i] = lobes.density(lane(&directions, i), glosses[i]);
            let share = cosines[i] / densities[i];
            carried[i] = row.carried[i] * lobes.value(glosses[i]) * share;
            let factor = lane(&f, i) * share;
            set_lane(&mut factors, i, factor);
            let brings = (factor.x > 0.0) | (factor.y > 0.0) | (factor.z > 0.0);
            let bit = 1 << i;
            alive |= if (cosines[i] > 0.0) & (densities[i] > 0.0) & brings { bit } else { 0 };
        }
        // Drop directions that certainly see nothing.
        alive &= used & !row.hidden(&directions, folds);
        // Apply Russian roulette.
        if onward.is_risked {
            let [risk, _] = sampler.pairs(&row.path, Decision::Roulette, 0, 1);
            for i in 0..LANES {
                let chance = onward.chance(carried[i]);
                let bit = 1 << i;
                alive &= if risk[i] < chance { !0 } else { !bit };
                let factor = lane(&factors, i) / chance;
                set_lane(&mut factors, i, factor);
                carried[i] /= chance;
            }
        }
        Ways { alive, directions, densities, factors, carried }
    }
}

impl Shot<'_> {
    /// MIS weight of a path that hits a lamp, against light samples.
    pub fn lamp_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let density = path.history.density;
        if !(density > 0.0) {
            return 1.0;
        }
        let normal = self.world.geometry.surface(&path.ray, hit).normal;
        let samples = self.settings.render.shadow_samples as f32;
        weight(self.sample_density(&path.ray, path.history.normal, (hit, normal)) * samples / density)
    }

    /// Weighted radiance from beyond the scene along a path; light samples bring the rest.
    pub fn light_beyond(&self, path: &PathRay) -> Vec3 {
        let environment = self.world.lights.environment();
        self.light_beyond_with(environment.map(|environment| environment.arriving(path.ray.direction)), path)
    }

    /// [`Shot::light_beyond`], given the radiance of the environment and its light-sampling pdf.
    pub fn light_beyond_with(&self, sky: Option<(Vec3, f32)>, path: &PathRay) -> Vec3 {
        let (lights, density) = (&self.world.lights, path.history.density);
        let samples = self.settings.render.shadow_samples as f32;
        if density.is_nan() || density <= 0.0 {
            return lights.beyond_with(sky, path.ray.direction, |_, _| 1.0);
        }
        // No light sample finds the environment, so its light-sampling pdf is 0.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.leaves_sky { 0.0 } else { of_sky }));
        let share = |of_light: f32| weight(of_light * samples / density);
        self.shared_beyond(sky, &path.ray, path.history.normal, share)
    }

    /// [`Shot::lamp_radiance`] for a ray in a glossy lobe that leaves the scene.
    pub fn radiance_beyond(&self, ray: &Ray, normal: Vec3, density: f32) -> Vec3 {
        let sky = self.world.lights.environment().map(|environment| environment.arriving(ray.direction));
        // No light sample brings the part of it that lobes reflect.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.lobes_find_sky { 0.0 } else { of_sky }));
        self.shared_beyond(sky, ray, normal, |of_light| weight(of_light / density))
    }

    /// Radiance that a ray sees which leaves the scene from a surface with this normal, given the radiance of the environment and
    /// its light-sampling pdf. Each light is weighted by its light-sampling pdf.
    fn shared_beyond(
        &self,
        sky: Option<(Vec3, f32)>,
        ray: &Ray,
        normal: Vec3,
        share: impl Fn(f32) -> f32,
    ) -> Vec3 {
        let lights = &self.world.lights;
        if !lights.are_beyond() {
            return Vec3::ZERO;
        }
        let samples = lights.samples_at(self.receivers(), ray.origin, normal);
        lights.beyond_with(sky, ray.direction, |number, density| share(density * samples.of(number)))
    }

    /// Light-sampling pdf in sr⁻¹ of a hit's direction, per requested sample, from a surface with this normal; 0 if the hit
    /// is not on a light.
    fn sample_density(&self, ray: &Ray, normal: Vec3, (hit, of_light): (&Hit, Vec3)) -> f32 {
        let (direction, distance, primitive) = (ray.direction, hit.shape.t, hit.shape.primitive);
        let met = Met { direction, distance, normal: of_light, primitive };
        let lights = &self.world.lights;
        lights.of_hit(hit.object, primitive).map_or(0.0, |(number, light)| {
            light.pdf(ray.origin, normal, &met)
                * lights.samples_at(self.receivers(), ray.origin, normal).of(number)
        })
    }

    /// Weighted radiance that a ray in a lobe meets, from a surface with this normal; light samples, as many as there are such
    /// rays, bring the rest.
    pub fn lamp_radiance(
        &self,
        ray: &Ray,
        from_normal: Vec3,
        hit: &Hit,
        density: f32,
        lookups: &mut u64,
    ) -> Vec3 {
        let world = self.world;
        let emission = &world.materials[world.material_index(hit)].emission;
        if !emission.shines() {
            return Vec3::ZERO;
        }
        let SurfacePoint { normal, uv, .. } = world.geometry.surface(ray, hit);
        if !(normal.dot(ray.direction) < 0.0) {
            return Vec3::ZERO;
        }
        let radiance = emission.at(&TexturePoint::sharp(uv), lookups);
        radiance * weight(self.sample_density(ray, from_normal, (hit, normal)) / density)
    }

    /// [`Shot::lamp_weight`] for a lamp that touches the glass which the path hits with it: the result of the light samples'
    /// shadow rays decides whether they find it there.
    pub fn touching_lamp_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let Ray { origin, direction, .. } = path.ray;
        let shadow = Ray::segment(origin, origin + direction * hit.shape.t);
        if path.history.density > 0.0 && !self.world.geometry.occluded(&shadow, Source::Object(hit.object)) {
            self.lamp_weight(path, hit)
        } else {
            1.0
        }
    }
}
