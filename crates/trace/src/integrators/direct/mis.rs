//! Techniques that find the light of lamps beside light samples, and the MIS weights of light samples and of these against each other
//! (multiple importance sampling: Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2).

use crate::geometry::{Ray, ShapeHit};
use crate::integrators::transport::batch::{Response, VertexBatch};
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::lights::{LightHit, LightRow, Side, Source};
use crate::materials::Footprint;
use crate::materials::bsdf::LobeSet;
use crate::math::Vec3;
use crate::math::lanes::{Folds, LANES, Lanes, Lanes3, lane, set_lane};
use crate::world::{Hit, MOST_STRAIGHT};

/// Technique that competes with light samples.
#[derive(Clone, Copy)]
pub enum CompetingTechnique {
    /// No other technique.
    Nothing,
    /// The rays of paths that go on from the vertices.
    Paths,
    /// Rays in the narrow lobes of the vertices, in which paths go on.
    NarrowPaths,
    /// Rays in the glossy lobes of the vertices whose bits are set.
    Lobes(u32),
}

impl CompetingTechnique {
    /// The technique of rays in glossy lobes, if the bits of any vertices are set.
    pub fn lobes(sharp: u32) -> Self {
        if sharp == 0 { Self::Nothing } else { Self::Lobes(sharp) }
    }

    /// Whether these are rays in glossy lobes.
    pub fn are_lobes(self) -> bool {
        match self {
            Self::Nothing | Self::Paths | Self::NarrowPaths => false,
            Self::Lobes(_) => true,
        }
    }

    /// Number of BSDF rays for each sample of a light that takes `count` samples.
    #[inline(always)]
    pub fn rays_per_sample(self, count: u32) -> f32 {
        match self {
            Self::Nothing => 0.0,
            Self::Paths | Self::NarrowPaths => 1.0 / count as f32,
            Self::Lobes(_) => 1.0,
        }
    }

    /// Multiplies `values`, the contributions of light samples at the vertices of a row, by their power-heuristic weights. The
    /// inverse pdfs of the samples are given; `competing` is the number of BSDF rays for each sample.
    #[inline(always)]
    pub fn weighted(
        self,
        row: &VertexBatch,
        (samples, response): (&LightRow, &Response),
        mut values: Lanes3,
        (of_light, competing): (&Lanes, f32),
        folds: impl Folds,
    ) -> Lanes3 {
        // Weight each sample against the lobes in which rays leave its vertex.
        let (lobes, start) = match self {
            Self::Nothing => return values,
            Self::Paths => (LobeSet::All, !0),
            Self::NarrowPaths => (LobeSet::Narrow, !0),
            Self::Lobes(sharp) => (LobeSet::Narrow, sharp),
        };
        let densities = row.bsdf.pdf(lobes, &row.normal, &samples.directions, &response.bsdf, folds);
        let mut weights = [1.0; LANES];
        for i in 0..LANES {
            let weight = weight(densities[i] * of_light[i] * competing);
            weights[i] = if start & 1 << i != 0 { weight } else { 1.0 };
        }
        // Apply the weights to the light of those lobes.
        match lobes {
            LobeSet::All => {
                for i in 0..LANES {
                    let value = lane(&values, i) * weights[i];
                    set_lane(&mut values, i, value);
                }
            }
            LobeSet::Narrow => {
                let [wide, narrow] = row.bsdf.parts(&samples.directions, &response.bsdf, folds);
                for i in 0..LANES {
                    let left = left_of_narrow(lane(&wide, i), lane(&narrow, i), weights[i]);
                    let value = lane(&values, i) * left;
                    set_lane(&mut values, i, value);
                }
            }
        }
        values
    }
}

/// Reflected light with its narrow part weighted. The weight applies to that part alone, as rays in a lobe bring no light of wide
/// lobes. Thereby the parts of a picture add up to it.
#[inline(always)]
fn left_of_narrow(wide: Vec3, narrow: Vec3, weight: f32) -> Vec3 {
    let part = |wide: f32, narrow: f32| {
        let all = wide + narrow;
        if all > 0.0 { (wide + narrow * weight) / all } else { 0.0 }
    };
    Vec3::new(part(wide.x, narrow.x), part(wide.y, narrow.y), part(wide.z, narrow.z))
}

/// MIS weight of a sample, if the other technique's pdf is so many times as high (the power heuristic).
#[inline(always)]
pub fn weight(ratio: f32) -> f32 {
    1.0 / (1.0 + ratio * ratio)
}

impl TileContext<'_> {
    /// MIS weight of a path that hits a lamp, against light samples.
    pub fn lamp_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let density = path.state.density;
        if !(density > 0.0) {
            return 1.0;
        }
        let normal = self.world.geometry.surface(&path.ray, hit).normal;
        let samples = self.settings.render.shadow_samples as f32;
        weight(self.sample_density(&path.ray, path.state.normal, (hit, normal)) * samples / density)
    }

    /// Weighted radiance from beyond the scene along a path; light samples bring the rest.
    pub fn light_beyond(&self, path: &PathRay) -> Vec3 {
        let environment = self.world.lights.environment();
        self.light_beyond_with(environment.map(|environment| environment.arriving(path.ray.direction)), path)
    }

    /// [`TileContext::light_beyond`], given the radiance of the environment and its light-sampling pdf.
    pub fn light_beyond_with(&self, sky: Option<(Vec3, f32)>, path: &PathRay) -> Vec3 {
        let (lights, density) = (&self.world.lights, path.state.density);
        let samples = self.settings.render.shadow_samples as f32;
        if density.is_nan() || density <= 0.0 {
            return lights.beyond_with(sky, path.ray.direction, |_, _| 1.0);
        }
        // If light samples leave out the environment, its light-sampling pdf is 0.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.leaves_sky { 0.0 } else { of_sky }));
        let share = |of_light: f32| weight(of_light * samples / density);
        self.shared_beyond((None, sky), &path.ray, path.state.normal, share)
    }

    /// [`TileContext::lamp_radiance`] for a ray in a glossy lobe that leaves the scene.
    pub fn radiance_beyond(&self, ray: &Ray, normal: Vec3, density: f32) -> Vec3 {
        self.radiance_of(None, ray, normal, density)
    }

    /// [`TileContext::radiance_beyond`] of the light `number` alone; of all lights if it is `None`.
    pub fn radiance_of(&self, number: Option<u32>, ray: &Ray, normal: Vec3, density: f32) -> Vec3 {
        let sky = self.world.lights.environment().map(|environment| environment.arriving(ray.direction));
        // If rays in lobes find the sky, light samples leave it out, and its light-sampling pdf is 0.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.lobes_find_sky { 0.0 } else { of_sky }));
        self.shared_beyond((number, sky), ray, normal, |of_light| weight(of_light / density))
    }

    /// Radiance that a ray sees which leaves the scene from a surface with this normal, of one light or of all, given the radiance of
    /// the environment and its light-sampling pdf. Each light is weighted by its light-sampling pdf.
    fn shared_beyond(
        &self,
        (only, sky): (Option<u32>, Option<(Vec3, f32)>),
        ray: &Ray,
        normal: Vec3,
        share: impl Fn(f32) -> f32,
    ) -> Vec3 {
        let lights = &self.world.lights;
        if !lights.are_beyond() {
            return Vec3::ZERO;
        }
        let samples = lights.samples_at(self.behaviour.receivers, ray.origin, normal);
        lights.beyond_with(sky, ray.direction, |number, density| {
            if only.is_none_or(|only| only == number) { share(density * samples.of(number)) } else { 0.0 }
        })
    }

    /// Light-sampling pdf in sr⁻¹ of a hit's direction, per requested sample, from a surface with this normal; 0 if the hit
    /// is not on a light.
    fn sample_density(&self, ray: &Ray, normal: Vec3, (hit, of_light): (&Hit, Vec3)) -> f32 {
        let (direction, distance, primitive) = (ray.direction, hit.shape.t, hit.shape.primitive);
        let met = LightHit { direction, distance, normal: of_light, primitive };
        let lights = &self.world.lights;
        let side = if of_light.dot(direction) > 0.0 { Side::Back } else { Side::Front };
        lights.of_hit(hit.object, primitive, side).map_or(0.0, |(number, light)| {
            light.pdf(ray.origin, normal, &met)
                * lights.samples_at(self.behaviour.receivers, ray.origin, normal).of(number)
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
        let material = &world.materials[world.material_index(hit)];
        let emission = &material.emission;
        if !emission.shines() {
            return Vec3::ZERO;
        }
        let surface = world.geometry.surface(ray, hit);
        let normal = surface.normal;
        if !emission.shines_from(normal.dot(ray.direction) < 0.0) {
            return Vec3::ZERO;
        }
        let at = world.texture_point(hit, &surface, |_| Footprint::POINT);
        let mut radiance = emission.at(&at, normal.dot(ray.direction), lookups);
        if let Some(opacity) = &material.opacity {
            radiance *= opacity.at(&at, lookups);
        }
        radiance * weight(self.sample_density(ray, from_normal, (hit, normal)) / density)
    }

    /// Weighted radiance that a ray in a lobe meets, from a surface with this normal, beginning with its first hit and going straight
    /// on from there. `transmittance` is that of the medium up to a distance.
    #[cold]
    #[inline(never)]
    pub fn radiance_straight_on(
        &self,
        (ray, first): (&Ray, Option<Hit>),
        from_normal: Vec3,
        density: f32,
        transmittance: impl Fn(f32) -> Vec3,
        lookups: &mut u64,
    ) -> Vec3 {
        let (mut sum, mut left, mut passed) = (Vec3::ZERO, Vec3::ONE, 0.0);
        let (mut along, mut next) = (*ray, first);
        for _ in 0..=MOST_STRAIGHT {
            let Some(hit) = next else {
                let beyond = self.radiance_beyond(ray, from_normal, density);
                return sum + left * beyond * transmittance(f32::MAX);
            };
            // Add the light of the surface, as if the ray had come there without a stop.
            let distance = passed + hit.shape.t;
            let met = Hit { shape: ShapeHit { t: distance, ..hit.shape }, ..hit };
            let radiance = self.lamp_radiance(ray, from_normal, &met, density, lookups);
            sum += left * radiance * transmittance(distance);
            // Go straight on, if the surface lets light pass.
            if !self.world.materials[self.world.material_index(&hit)].lets_pass() {
                return sum;
            }
            let (part, beyond) = self.world.beyond(&along, &hit, lookups);
            (left, along, passed) = (left * part, beyond, distance);
            if left == Vec3::ZERO {
                return sum;
            }
            next = self.world.geometry.closest(&along);
        }
        sum
    }

    /// [`TileContext::lamp_weight`] of a lamp that touches the glass which the path hits: 1 if shadow rays of light samples cannot
    /// reach the lamp there.
    pub fn touching_lamp_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let Ray { origin, direction, .. } = path.ray;
        let shadow = Ray::segment(origin, origin + direction * hit.shape.t);
        if path.state.density > 0.0 && !self.world.is_dark(&shadow, Source::Object(hit.object)) {
            self.lamp_weight(path, hit)
        } else {
            1.0
        }
    }
}
