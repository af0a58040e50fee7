//! Techniques that compete with light sampling, and their MIS weights (multiple importance sampling: Veach,
//! *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2).

use crate::geometry::{Ray, ShapeHit};
use crate::integrators::transport::batch::{BsdfValuesAndCosines, VertexBatch};
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::lights::{GeometryOfLight, LightHitPoint, LightSamplePacket, Side};
use crate::materials::Footprint;
use crate::materials::bsdf::{BsdfValuePacket, LobesToSample, divide_lanes_or_zero};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, Vec3x16, lane, set_lane};
use crate::world::{Hit, MAX_NULL_INTERACTIONS};

/// The technique that competes with light samples.
#[derive(Clone, Copy)]
pub enum CompetingTechnique {
    /// No competing technique.
    Nothing,
    /// Paths that continue from the vertices.
    Paths,
    /// Paths that continue in the narrow lobes of the vertices.
    NarrowPaths,
    /// Rays in the glossy lobes of the vertices in the mask.
    Lobes(u32),
}

impl CompetingTechnique {
    /// Returns lobe rays at the vertices in `sharp`, or no technique if the mask is 0.
    pub fn from_sharp_vertex_mask(sharp: u32) -> Self {
        if sharp == 0 { Self::Nothing } else { Self::Lobes(sharp) }
    }

    /// Whether the technique consists of rays in glossy lobes.
    pub fn uses_glossy_lobe_rays(self) -> bool {
        match self {
            Self::Nothing | Self::Paths | Self::NarrowPaths => false,
            Self::Lobes(_) => true,
        }
    }

    /// Number of BSDF samples per light sample, for a light with `count` samples.
    #[inline(always)]
    pub fn bsdf_rays_per_light_sample(self, count: u32) -> f32 {
        match self {
            Self::Nothing => 0.0,
            Self::Paths | Self::NarrowPaths => 1.0 / count as f32,
            Self::Lobes(_) => 1.0,
        }
    }

    /// Multiplies `values`, the contributions of light samples at a packet of vertices, by their
    /// power-heuristic weights. `of_light` contains the inverse pdfs of the samples. `competing` is the
    /// number of BSDF samples per light sample.
    #[inline(always)]
    pub fn apply_mis_weights(
        self,
        row: &VertexBatch,
        (samples, response): (&LightSamplePacket, &BsdfValuesAndCosines),
        mut values: Vec3x16,
        (of_light, competing): (&F32x16, f32),
        simd: impl Simd,
    ) -> Vec3x16 {
        // Weight each sample against the lobes from which BSDF samples are drawn.
        let (lobes, start) = match self {
            Self::Nothing => return values,
            Self::Paths => (LobesToSample::All, !0),
            Self::NarrowPaths => (LobesToSample::Narrow, !0),
            Self::Lobes(sharp) => (LobesToSample::Narrow, sharp),
        };
        let pdfs = row.bsdf.pdf(lobes, &row.normal, &samples.directions, &response.bsdf, simd);
        let mut weights = [1.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let weight = power_heuristic_from_ratio(pdfs[i] * of_light[i] * competing);
            weights[i] = if start & 1 << i != 0 { weight } else { 1.0 };
        }
        // Apply the weights to the light reflected by these lobes.
        match lobes {
            LobesToSample::All => {
                for i in 0..PACKET_SIZE {
                    let value = lane(&values, i) * weights[i];
                    set_lane(&mut values, i, value);
                }
            }
            LobesToSample::Narrow => {
                let BsdfValuePacket { wide, narrow, .. } = &response.bsdf;
                for i in 0..PACKET_SIZE {
                    let left = wide_and_narrow_mis_factor(lane(wide, i), lane(narrow, i), weights[i]);
                    let value = lane(&values, i) * left;
                    set_lane(&mut values, i, value);
                }
            }
        }
        values
    }
}

impl CompetingTechnique {
    /// Adjusts the fractions of reflected light that are from wide lobes, after MIS weights have changed the
    /// light from `unweighted` to `weighted`. Weights of narrow lobes leave the light from wide lobes
    /// unchanged.
    #[inline(never)]
    pub fn adjust_wide_light_fraction(
        self,
        fraction: &mut Vec3x16,
        unweighted: &Vec3x16,
        weighted: &Vec3x16,
    ) {
        match self {
            Self::Nothing | Self::Paths => {}
            Self::NarrowPaths | Self::Lobes(_) => {
                let change = divide_lanes_or_zero(unweighted, weighted);
                for axis in 0..3 {
                    for i in 0..PACKET_SIZE {
                        fraction[axis][i] *= change[axis][i];
                    }
                }
            }
        }
    }
}

/// Factor for reflected light if the MIS weight applies only to the narrow lobe, because rays in a narrow
/// lobe do not account for wide lobes. With this factor, the AOVs still sum to the beauty image.
#[inline(always)]
fn wide_and_narrow_mis_factor(wide: Vec3, narrow: Vec3, weight: f32) -> Vec3 {
    let part = |wide: f32, narrow: f32| {
        let all = wide + narrow;
        if all > 0.0 { (wide + narrow * weight) / all } else { 0.0 }
    };
    Vec3::new(part(wide.x, narrow.x), part(wide.y, narrow.y), part(wide.z, narrow.z))
}

/// Power-heuristic weight of a sample. `ratio` is the other technique's pdf divided by the sample's own pdf.
#[inline(always)]
pub fn power_heuristic_from_ratio(ratio: f32) -> f32 {
    1.0 / (1.0 + ratio * ratio)
}

impl TileContext<'_> {
    /// MIS weight of a path that hits an emitter, relative to light samples.
    pub fn emitter_mis_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let pdf = path.state.pdf;
        if !(pdf > 0.0) {
            return 1.0;
        }
        let normal = self.world.geometry.surface(&path.ray, hit).normal;
        let samples = self.settings.render.shadow_samples as f32;
        power_heuristic_from_ratio(
            self.light_pdf(&path.ray, path.state.normal, (hit, normal)) * samples / pdf,
        )
    }

    /// MIS-weighted radiance of infinite lights along a path. Light samples contribute the rest.
    pub fn mis_weighted_infinite_light(&self, path: &PathRay) -> Vec3 {
        let environment = self.world.lights.environment();
        self.infinite_light_with_precomputed_sky(
            environment.map(|environment| environment.radiance_and_pdf(path.ray.direction)),
            path,
        )
    }

    /// Like [`TileContext::mis_weighted_infinite_light`], with the environment's radiance and light-sampling
    /// pdf already evaluated.
    pub fn infinite_light_with_precomputed_sky(&self, sky: Option<(Vec3, f32)>, path: &PathRay) -> Vec3 {
        let (lights, pdf) = (&self.world.lights, path.state.pdf);
        let samples = self.settings.render.shadow_samples as f32;
        if pdf.is_nan() || pdf <= 0.0 {
            return lights.radiance_from_infinity_with_precomputed_sky(sky, path.ray.direction, |_, _| 1.0);
        }
        // If light samples skip the environment, its light-sampling pdf is 0.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.paths_find_sky { 0.0 } else { of_sky }));
        let weight = |of_light: f32| power_heuristic_from_ratio(of_light * samples / pdf);
        self.weighted_infinite_light((None, sky), &path.ray, path.state.normal, weight)
    }

    /// Like [`TileContext::lobe_ray_emitter_radiance`], for a lobe ray that leaves the scene.
    pub fn lobe_ray_radiance_from_infinity(&self, ray: &Ray, normal: Vec3, pdf: f32) -> Vec3 {
        self.lobe_ray_radiance_from_infinite_light(None, ray, normal, pdf)
    }

    /// Like [`TileContext::lobe_ray_radiance_from_infinity`], but restricted to light `number`, unless it is
    /// `None`.
    pub fn lobe_ray_radiance_from_infinite_light(
        &self,
        number: Option<u32>,
        ray: &Ray,
        normal: Vec3,
        pdf: f32,
    ) -> Vec3 {
        let sky =
            self.world.lights.environment().map(|environment| environment.radiance_and_pdf(ray.direction));
        // If lobe rays account for the environment, light samples skip it, and its light-sampling pdf is 0.
        let sky = sky.map(|(radiance, of_sky)| (radiance, if self.lobes_find_sky { 0.0 } else { of_sky }));
        self.weighted_infinite_light((number, sky), ray, normal, |of_light| {
            power_heuristic_from_ratio(of_light / pdf)
        })
    }

    /// Weighted radiance of infinite lights along a ray that leaves the scene from a surface with this
    /// normal. `only` restricts the result to one light. `sky` contains the environment's radiance and
    /// light-sampling pdf. `weight` maps each light's sampling pdf to its weight.
    fn weighted_infinite_light(
        &self,
        (only, sky): (Option<u32>, Option<(Vec3, f32)>),
        ray: &Ray,
        normal: Vec3,
        weight: impl Fn(f32) -> f32,
    ) -> Vec3 {
        let lights = &self.world.lights;
        if !lights.escaping_rays_can_hit_light() {
            return Vec3::ZERO;
        }
        let samples = lights.expected_sample_counts(self.behavior.receivers, ray.origin, normal);
        lights.radiance_from_infinity_with_precomputed_sky(sky, ray.direction, |number, pdf| {
            if only.is_none_or(|only| only == number) { weight(pdf * samples.for_light(number)) } else { 0.0 }
        })
    }

    /// Light-sampling pdf of the direction from a surface point to a hit, in sr⁻¹ per requested sample.
    /// `normal` is the surface's normal. Returns 0 if the hit is not on a light.
    fn light_pdf(&self, ray: &Ray, normal: Vec3, (hit, of_light): (&Hit, Vec3)) -> f32 {
        let (direction, distance, primitive) = (ray.direction, hit.shape.t, hit.shape.primitive);
        let met = LightHitPoint { direction, distance, normal: of_light, primitive };
        let lights = &self.world.lights;
        let side = if of_light.dot(direction) > 0.0 { Side::Back } else { Side::Front };
        lights.light_on_primitive(hit.object, primitive, side).map_or(0.0, |(number, light)| {
            light.pdf_of_hit(ray.origin, normal, &met)
                * lights.expected_sample_counts(self.behavior.receivers, ray.origin, normal).for_light(number)
        })
    }

    /// Radiance of the emitter hit by a lobe ray, multiplied by the MIS weight for equal numbers of light
    /// samples and lobe rays.
    pub fn lobe_ray_emitter_radiance(
        &self,
        ray: &Ray,
        from_normal: Vec3,
        hit: &Hit,
        pdf: f32,
        lookups: &mut u64,
    ) -> Vec3 {
        let world = self.world;
        let material = &world.materials[world.material_index(hit)];
        if !material.is_emissive() {
            return Vec3::ZERO;
        }
        let surface = world.geometry.surface(ray, hit);
        let normal = surface.normal;
        let at = world.texture_point(hit, &surface, |_| Footprint::POINT);
        let cosine = normal.dot(ray.direction);
        let radiance = material.expected_emission_at(&at, cosine < 0.0, cosine, lookups);
        if radiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        radiance * power_heuristic_from_ratio(self.light_pdf(ray, from_normal, (hit, normal)) / pdf)
    }

    /// MIS-weighted radiance along a lobe ray, including null interactions, starting at its first hit.
    /// `transmittance` returns the medium's transmittance up to a distance.
    #[cold]
    #[inline(never)]
    pub fn radiance_through_null_surfaces(
        &self,
        (ray, first): (&Ray, Option<Hit>),
        from_normal: Vec3,
        pdf: f32,
        transmittance: impl Fn(f32) -> Vec3,
        lookups: &mut u64,
    ) -> Vec3 {
        let (mut sum, mut left, mut passed) = (Vec3::ZERO, Vec3::ONE, 0.0);
        let (mut along, mut next) = (*ray, first);
        for _ in 0..=MAX_NULL_INTERACTIONS {
            let Some(hit) = next else {
                let beyond = self.lobe_ray_radiance_from_infinity(ray, from_normal, pdf);
                return sum + left * beyond * transmittance(f32::MAX);
            };
            // Add the surface's emission, using the hit distance along the original ray.
            let distance = passed + hit.shape.t;
            let met = Hit { shape: ShapeHit { t: distance, ..hit.shape }, ..hit };
            let radiance = self.lobe_ray_emitter_radiance(ray, from_normal, &met, pdf, lookups);
            sum += left * radiance * transmittance(distance);
            // Continue if the surface may be a null interaction.
            if !self.world.materials[self.world.material_index(&hit)].has_null_interaction() {
                return sum;
            }
            let (part, beyond) = self.world.transmittance_and_continued_ray(&along, &hit, lookups);
            (left, along, passed) = (left * part, beyond, distance);
            if left == Vec3::ZERO {
                return sum;
            }
            next = self.world.geometry.closest_hit(&along);
        }
        sum
    }

    /// Like [`TileContext::emitter_mis_weight`], for an emitter that coincides with glass. Returns 1 if
    /// shadow rays cannot reach the hit point.
    pub fn coincident_glass_emitter_mis_weight(&self, path: &PathRay, hit: &Hit) -> f32 {
        let Ray { origin, direction, .. } = path.ray;
        let shadow = Ray::segment_ending_before_point(origin, origin + direction * hit.shape.t);
        if path.state.pdf > 0.0
            && !self.world.has_zero_transmittance_along(&shadow, GeometryOfLight::Object(hit.object))
        {
            self.emitter_mis_weight(path, hit)
        } else {
            1.0
        }
    }
}
