//! Interactions of camera paths with surfaces that are shaded one by one. At specular surfaces (mirrors,
//! smooth glass, panes and coats), paths either split or continue in a randomly chosen branch.

use super::CameraPathWavefront;
use crate::geometry::Ray;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::aov::{record_first_hit_of_ray, record_first_hits_on_plain_surfaces, record_vertex};
use crate::integrators::transport::crossing::CoincidentSurfaceBuffers;
use crate::integrators::transport::interface::{FresnelSplit, fresnel_split, reflected_path};
use crate::integrators::transport::interiors::InteriorList;
use crate::integrators::transport::packet::PacketHits;
use crate::integrators::transport::packet_source::PacketSource;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::{SpecularLobe, SurfaceVertex};
use crate::integrators::transport::walk::{
    MediumInterface, NullInteractionOutcome, OpaqueSurfaceHit, PathStepper, ReachedInteraction,
    walk_to_interaction,
};
use crate::integrators::view::PathAov;
use crate::materials::{Bsdf, Mirror, SpecularOverBase, ThinDielectric};
use crate::math::Vec3;
use crate::world::Hit;

/// A path splits only if its weaker branch contributes at least this much. Otherwise, one branch is chosen at
/// random.
const MIN_SPLIT: f32 = 0.01;

impl<'a> PathStepper<'a> for CameraPathWavefront<'a, '_> {
    fn tile_context(&self) -> &'a TileContext<'a> {
        self.tile
    }

    fn coincident_surface_buffers(&mut self) -> &mut CoincidentSurfaceBuffers {
        self.crossing
    }

    fn record_surface_crossing(&mut self, path: &PathRay, next: Option<Hit>) {
        if self.accumulator.aov == PathAov::TraversalCost {
            self.accumulator
                .add_traversal_cost(path.slot, count_traversal_cost_to_hit(self.tile, path, next));
        }
    }

    #[inline(always)]
    fn handle_interaction(&mut self, path: &PathRay, reached: ReachedInteraction<'_, 'a>, has_passed: bool) {
        match reached {
            ReachedInteraction::Opaque(vertex, hit, far) => {
                if !has_passed && matches!(hit, OpaqueSurfaceHit::Direct(_)) {
                    self.record_camera_vertex(path, vertex);
                }
                if self.add_emission_and_check_depth(path, vertex, hit) && vertex.scatters() {
                    match &vertex.material.bsdf {
                        Bsdf::NonSpecular(rough) => self.shade_non_specular(path, vertex, rough, far),
                        Bsdf::Mirror(mirror) => self.shade_mirror_hit(path, vertex, mirror),
                        Bsdf::SpecularOverBase(layers) => {
                            self.shade_specular_over_base_hit(path, vertex, layers, far);
                        }
                        // At a blend, each vertex has the material of the chosen part.
                        Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Blend(_) => {}
                    }
                }
            }
            ReachedInteraction::Glass(vertex, hit, MediumInterface { far, rough }) => {
                if !has_passed {
                    self.record_camera_vertex(path, vertex);
                }
                if self.add_emission_and_check_depth(path, vertex, OpaqueSurfaceHit::Direct(hit)) {
                    match rough {
                        Some(rough) => self.queue_rough_glass_vertices(path, vertex, rough, far),
                        None => self.shade_glass_hit(path, vertex, far),
                    }
                }
            }
            ReachedInteraction::Hidden if self.is_below_max_depth() => self.push_specular(*path),
            ReachedInteraction::Hidden => {}
            ReachedInteraction::Nothing => self.add_mis_weighted_infinite_light(path),
        }
    }

    fn texture_lookup_counter(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn handle_pane(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'a>,
        hit: OpaqueSurfaceHit,
        pane: &ThinDielectric,
    ) -> NullInteractionOutcome {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.wo));
        let tint = vertex.pane_transmittance(path, pane, &mut self.counters.texture_lookups);
        let left = tint * (1.0 - reflectance);
        // After the last bounce, only light that passes straight through the pane is added.
        if !self.add_emission_and_check_depth(path, vertex, hit) {
            return NullInteractionOutcome::Passed(left);
        }
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let mirrored = |weight: f32| reflected_path(path, vertex, &shading, Vec3::splat(weight));
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        if weaker >= MIN_SPLIT && splits {
            self.roulette_and_push_reflected(mirrored(reflectance));
            NullInteractionOutcome::Passed(left)
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.roulette_and_push_reflected(mirrored(1.0));
            NullInteractionOutcome::Ended
        } else {
            NullInteractionOutcome::Passed(tint)
        }
    }
}

impl CameraPathWavefront<'_, '_> {
    /// Adds the traversal costs of a packet's rays.
    pub(super) fn add_traversal_costs(&mut self, rays: &PacketSource<'_>, packet: &PacketHits) {
        for lane in 0..rays.lane_count() {
            let path = rays.path(self.tile, lane);
            let cost = count_traversal_cost_to_hit(self.tile, &path, packet.hit(lane));
            self.accumulator.add_traversal_cost(path.slot, cost);
        }
    }

    /// Shades the hit of one ray in a packet. The path is large, so it is moved only here.
    #[inline(never)]
    pub(super) fn shade_ray(&mut self, mut path: PathRay, (packet, lane): (&PacketHits, usize)) {
        let (tile, bit) = (self.tile, 1 << lane);
        match packet.hit(lane) {
            Some(hit) if packet.plain & bit != 0 => {
                self.add_emission_and_ambient(&path, &hit, packet.shining & bit != 0);
            }
            Some(hit) => {
                let surface = packet.non_plain_surface_of_lane(self.surfaces, lane);
                self.is_first_hit_pending = self.depth == 0
                    && self.accumulator.first_hit_layers().is_some()
                    && !tile.world.has_null_interaction_surfaces();
                walk_to_interaction(self, &mut path, (hit, surface));
            }
            None => {
                let sky = tile.world.lights.environment().map(|_| packet.sky_radiance_and_pdf_of_lane(lane));
                self.add_infinite_light(&path, tile.infinite_light_with_precomputed_sky(sky, &path));
            }
        }
    }

    /// Records the first-hit layers of a packet of camera rays, except for hits that
    /// [`Self::record_camera_vertex`] has recorded. `pending` is the mask of shaded rays whose walks did not
    /// end directly at the surface they hit. Out of line because most images have no layers.
    #[inline(never)]
    pub(super) fn record_first_hits(&mut self, rays: &PacketSource<'_>, packet: &PacketHits, pending: u32) {
        let tile = self.tile;
        let PacketSource::Camera(_, first, ..) = *rays else { return };
        let Some(values) = self.accumulator.first_hit_layers() else { return };
        let mut left = record_first_hits_on_plain_surfaces(tile, (packet, self.surfaces), first, values);
        left |= pending;
        // Paths may pass through surfaces that the layers show.
        if tile.world.has_null_interaction_surfaces() {
            left |= packet.any & !packet.plain & rays.mask();
        }
        for lane in set_bit_lanes(left) {
            let Some(hit) = packet.hit(lane) else { continue };
            record_first_hit_of_ray(tile, (&rays.path(tile, lane), &hit), values, self.counters);
        }
    }

    /// Records the first-hit layers at the vertex where a camera ray's walk ended.
    pub(super) fn record_camera_vertex(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>) {
        if self.is_first_hit_pending
            && let Some(values) = self.accumulator.first_hit_layers()
        {
            record_vertex(self.tile, path.slot, vertex, values, self.counters);
            self.is_first_hit_pending = false;
        }
    }

    pub(super) fn shade_mirror_hit(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, mirror: &Mirror) {
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let is_colored = self.accumulator.aov.applies_surface_colors();
        let reflectance = vertex.mirror_reflectance(mirror, &shading, is_colored, self.counters);
        self.roulette_and_push_reflected(reflected_path(path, vertex, &shading, reflectance));
    }

    /// Splits a path at a surface with a δ lobe and non-specular lobes, or randomly chooses one of the two.
    pub(super) fn shade_specular_over_base_hit(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        layers: &SpecularOverBase,
        far: &InteriorList,
    ) {
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let is_colored = self.accumulator.aov.applies_surface_colors();
        let lobe = vertex.specular_lobe(layers, &shading, is_colored, self.counters);
        let SpecularLobe { probability, .. } = lobe;
        let weaker = probability.min(1.0 - probability) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        let both = weaker >= MIN_SPLIT && splits;
        let is_specular = !both && self.tile.chooses_reflection(path, probability);
        if both || is_specular {
            let specular = vertex.specular_sample_weight(layers, &lobe, self.counters)
                * if both { probability } else { 1.0 };
            if specular != Vec3::ZERO {
                self.roulette_and_push_reflected(reflected_path(path, vertex, &shading, specular));
            }
        }
        if !is_specular {
            // Divide by the probability of choosing the base.
            let base_factor = if both { 1.0 } else { 1.0 / (1.0 - probability) };
            let mut state = path.state;
            state.roulette_throughput *= base_factor;
            let path = PathRay { throughput: path.throughput * base_factor, state, ..*path };
            self.shade_non_specular(&path, vertex, &layers.base, far);
        }
    }

    pub(super) fn shade_glass_hit(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, far: &InteriorList) {
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let FresnelSplit { reflectance, refracted } =
            fresnel_split(self.tile.world, path, vertex, &shading, far);
        let mirrored = |weight: f32| reflected_path(path, vertex, &shading, Vec3::splat(weight));
        let Some(refracted) = refracted else { return self.roulette_and_push_reflected(mirrored(1.0)) };
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        let splits = self.tile.behavior.splits && path.state.only_specular_before;
        if weaker >= MIN_SPLIT && splits {
            self.roulette_and_push_reflected(mirrored(reflectance));
            self.roulette_and_push_refracted(refracted, 1.0 - reflectance);
        } else if self.tile.chooses_reflection(path, reflectance) {
            self.roulette_and_push_reflected(mirrored(1.0));
        } else {
            self.roulette_and_push_refracted(refracted, 1.0);
        }
    }

    #[inline]
    fn roulette_and_push_reflected(&mut self, mut ray: PathRay) {
        if self.apply_roulette_to_specular_ray(&mut ray) {
            self.counters.reflected_rays += 1;
            self.push_specular(ray);
        }
    }

    #[inline]
    fn roulette_and_push_refracted(&mut self, mut ray: PathRay, weight: f32) {
        ray.throughput *= weight;
        if self.apply_roulette_to_specular_ray(&mut ray) {
            self.counters.refracted_rays += 1;
            self.push_specular(ray);
        }
    }

    /// Queues a ray that continues the current path without a diffuse or glossy vertex.
    pub(super) fn push_specular(&mut self, ray: PathRay) {
        self.next.push(ray);
        if let Some(fractions) = self.accumulator.diffuse_fractions() {
            fractions.append_inherited(self.place);
        }
    }

    /// Applies Russian roulette to a specular ray, unless the path may still split. Returns false if it ends.
    #[inline]
    fn apply_roulette_to_specular_ray(&self, ray: &mut PathRay) -> bool {
        match self.continuation {
            Some(continuation) if !self.tile.behavior.splits || !ray.state.only_specular_before => {
                continuation.apply_roulette(self.tile, ray)
            }
            Some(_) | None => true,
        }
    }
}

/// Traversal cost of a path's ray up to the hit.
fn count_traversal_cost_to_hit(tile: &TileContext<'_>, path: &PathRay, hit: Option<Hit>) -> u32 {
    let t_max = hit.map_or(path.ray.t_max, |hit| hit.shape.t);
    tile.world.geometry.ray_traversal_cost(&Ray { t_max, ..path.ray })
}
