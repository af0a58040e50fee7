//! Photons at surfaces that are shaded one by one: where photons are stored, and how mirrors, glass, panes
//! and other surfaces scatter them.

use super::super::coverage::can_store_photons;
use super::PhotonWavefront;
use crate::integrators::transport::batch::ALL;
use crate::integrators::transport::crossing::CoincidentSurfaceBuffers;
use crate::integrators::transport::interface::{
    FresnelSplit, diffuser_basic_radiance_transmittance, fresnel_split, reflected_path,
};
use crate::integrators::transport::interiors::{InteriorList, medium_ior};
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::vertex::{ShadingVertex, SpecularLobe, SurfaceVertex};
use crate::integrators::transport::walk::{
    MediumInterface, NullInteractionOutcome, OpaqueSurfaceHit, PathStepper, ReachedInteraction,
    opacity_at_path_vertex,
};
use crate::integrators::view::PathAov;
use crate::materials::{Bsdf, BxdfPoint, Material, NonSpecular, SpecularOverBase, ThinDielectric};
use crate::math::Vec3;
use crate::math::lanes::set_lane;
use crate::world::Hit;

/// Squared difference below which directions are considered equal.
const SAME: f32 = 1e-8;

impl<'a> PathStepper<'a> for PhotonWavefront<'a> {
    fn tile_context(&self) -> &'a TileContext<'a> {
        self.tracing.tile
    }

    fn coincident_surface_buffers(&mut self) -> &mut CoincidentSurfaceBuffers {
        &mut self.crossing
    }

    fn record_surface_crossing(&mut self, _: &PathRay, _: Option<Hit>) {}

    #[inline(always)]
    fn handle_interaction(&mut self, path: &PathRay, reached: ReachedInteraction<'_, 'a>, has_passed: bool) {
        match reached {
            ReachedInteraction::Opaque(vertex, _, far) => {
                let lacks_photons = self.depth == 0 && !has_passed;
                self.shade_surface(path, vertex, (far, lacks_photons));
            }
            ReachedInteraction::Glass(vertex, _, MediumInterface { far, rough: None }) => {
                self.shade_glass_hit(path, vertex, far);
            }
            // Direct light is found by light samples.
            ReachedInteraction::Glass(..) if self.depth == 0 && !has_passed => {}
            ReachedInteraction::Glass(vertex, _, MediumInterface { far, rough: Some(rough) }) => {
                self.store_and_scatter(path, vertex, rough.reflection_bxdf(), (far, Some(1.0)));
            }
            ReachedInteraction::Nothing | ReachedInteraction::Hidden => {}
        }
    }

    fn texture_lookup_counter(&mut self) -> &mut u64 {
        &mut self.counters.texture_lookups
    }

    fn handle_pane(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'a>,
        _: OpaqueSurfaceHit,
        pane: &ThinDielectric,
    ) -> NullInteractionOutcome {
        let reflectance = pane.reflectance(vertex.surface.shading_normal.dot(vertex.wo));
        let tint = vertex.pane_transmittance(path, pane, &mut self.counters.texture_lookups);
        if !self.is_below_max_depth() {
            return NullInteractionOutcome::Passed(tint * (1.0 - reflectance));
        }
        if !self.tracing.tile.chooses_reflection(path, reflectance) {
            return NullInteractionOutcome::Passed(tint);
        }
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let ray = reflected_path(path, vertex, &shading, Vec3::ONE);
        self.queue_after_specular_bounce(path, vertex, (shading.normal, 1.0), ray);
        NullInteractionOutcome::Ended
    }
}

impl PhotonWavefront<'_> {
    fn shade_surface(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        (far, lacks_photons): (&InteriorList, bool),
    ) {
        if !vertex.scatters() {
            return;
        }
        match &vertex.material.bsdf {
            // Direct light is found by light samples.
            Bsdf::NonSpecular(_) if lacks_photons => {}
            Bsdf::NonSpecular(rough) => {
                self.store_and_scatter_at_rough(path, vertex, rough, (far, Some(1.0)));
            }
            Bsdf::SpecularOverBase(layers) => {
                self.store_and_reflect_at_specular_over_base(path, vertex, layers, (far, lacks_photons));
            }
            Bsdf::Mirror(mirror) if self.is_below_max_depth() => {
                let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
                let reflectance = vertex.mirror_reflectance(mirror, &shading, true, &mut self.counters);
                let ray = reflected_path(path, vertex, &shading, reflectance);
                self.queue_after_specular_bounce(path, vertex, (shading.normal, 1.0), ray);
            }
            Bsdf::Mirror(_) | Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::Blend(_) => {}
        }
    }

    /// Stores a photon at a surface with a δ lobe and non-specular lobes, and reflects it from the δ lobe.
    /// Caustic photons are randomly reflected by the δ lobe or scattered by the others. All other photons are
    /// reflected, because they never scatter from the other lobes.
    fn store_and_reflect_at_specular_over_base(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        layers: &SpecularOverBase,
        (far, lacks_photons): (&InteriorList, bool),
    ) {
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let lobe = vertex.specular_lobe(layers, &shading, true, &mut self.counters);
        let SpecularLobe { probability, .. } = lobe;
        let chooses = path.state.only_specular_before && !lacks_photons;
        let is_reflected = !chooses || self.tracing.tile.chooses_reflection(path, probability);
        if !lacks_photons {
            let factor = (!is_reflected).then(|| 1.0 / (1.0 - probability));
            self.store_and_scatter_at_rough(path, vertex, &layers.base, (far, factor));
        }
        if is_reflected && self.is_below_max_depth() {
            let specular = vertex.specular_sample_weight(layers, &lobe, &mut self.counters);
            let part = if chooses { 1.0 } else { probability };
            let ray = reflected_path(path, vertex, &shading, specular * part);
            self.queue_after_specular_bounce(path, vertex, (shading.normal, 1.0), ray);
        }
    }

    /// Stores a photon at a non-specular surface with the medium `far` behind it. If `scattered` is
    /// `Some(factor)`, a caustic photon is also scattered, with its flux multiplied by the factor.
    fn store_and_scatter_at_rough(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: &NonSpecular,
        (far, scattered): (&InteriorList, Option<f32>),
    ) {
        let mut bsdf = rough.evaluate_textures(&vertex.texture_point, &mut self.counters.texture_lookups);
        vertex.tint_bsdf_by_vertex_color(&mut bsdf);
        if !bsdf.is_black() {
            self.store_and_scatter(path, vertex, bsdf, (far, scattered));
        } else if vertex.is_blended() {
            // The photon may be reflected by another part of the blend.
            self.store_rescaled_photon(path, vertex);
        }
    }

    /// Stores a photon at a vertex. Its flux is scaled up to account for photons that passed through the
    /// surface as a null interaction, or that chose a part of a blend on which no photons are stored.
    fn store_rescaled_photon(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>) {
        let chance = storage_probability(path, vertex, &mut self.counters.texture_lookups);
        let all = PathRay { throughput: path.throughput / chance, ..*path };
        self.store_photon(&all, vertex.surface.point, vertex.normal);
    }

    /// Like [`PhotonWavefront::store_and_scatter_at_rough`], with the BSDF already evaluated.
    fn store_and_scatter(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        bsdf: BxdfPoint,
        (far, scattered): (&InteriorList, Option<f32>),
    ) {
        let tile = self.tracing.tile;
        self.store_rescaled_photon(path, vertex);
        let Some(factor) = scattered.filter(|_| path.state.only_specular_before && self.is_below_max_depth())
        else {
            return;
        };
        // Queue the photon for scattering.
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let behind = bsdf.bsdf_for_transmitted_light().map(|bsdf| (bsdf, shading.seen_from_far_side()));
        let interiors = self.interior_lists.push_list(&path.interiors);
        if self.open.used == ALL || self.open.bsdf.kind() != bsdf.kind() {
            self.scatter_queued_vertices();
            self.open.bsdf.set_kind(bsdf.kind());
        }
        let i = self.open.used.trailing_ones() as usize;
        let lit = ShadingVertex { path, interiors: &path.interiors, place: 0, vertex, shading, bsdf: &bsdf };
        self.open.set_vertex(i, tile, &lit, PathAov::ALL, interiors);
        let counts = self.open.adjoint_photon_weight(i, vertex.wo) * factor;
        set_lane(&mut self.open.throughput, i, path.throughput * counts);
        // Queue the transmitted photon. The medium behind the surface changes its basic flux.
        let Some((bsdf, shading)) = behind else { return };
        let part = if vertex.material.bsdf.as_dielectric().is_some() {
            let eta = medium_ior(tile.world, far) / medium_ior(tile.world, &path.interiors);
            1.0 / (eta * eta)
        } else {
            // For a camera path, this is transmission from the other side.
            diffuser_basic_radiance_transmittance(tile.world, far, &path.interiors)
        };
        let interiors = self.interior_lists.push_list(far);
        if self.open_behind.used == ALL || self.open_behind.bsdf.kind() != bsdf.kind() {
            self.scatter_queued_vertices();
            self.open_behind.bsdf.set_kind(bsdf.kind());
        }
        let i = self.open_behind.used.trailing_ones() as usize;
        let lit = ShadingVertex {
            path,
            interiors: far,
            place: 0,
            vertex: &vertex.seen_from_far_side(),
            shading,
            bsdf: &bsdf,
        };
        self.open_behind.set_vertex(i, tile, &lit, PathAov::ALL, interiors);
        set_lane(&mut self.open_behind.throughput, i, path.throughput * (counts * part));
    }

    fn shade_glass_hit(&mut self, path: &PathRay, vertex: &SurfaceVertex<'_>, far: &InteriorList) {
        if !self.is_below_max_depth() {
            return;
        }
        let tile = self.tracing.tile;
        let shading = vertex.perturbed_and_smooth_normals(&mut self.counters);
        let FresnelSplit { reflectance, refracted } = fresnel_split(tile.world, path, vertex, &shading, far);
        match refracted {
            Some(mut ray) if !tile.chooses_reflection(path, reflectance) => {
                let eta = medium_ior(tile.world, far) / medium_ior(tile.world, &path.interiors);
                ray.throughput *= 1.0 / (eta * eta);
                self.queue_after_specular_bounce(path, vertex, (shading.normal, eta), ray);
            }
            Some(_) | None => {
                let ray = reflected_path(path, vertex, &shading, Vec3::ONE);
                self.queue_after_specular_bounce(path, vertex, (shading.normal, 1.0), ray);
            }
        }
    }

    /// Queues a photon after a specular bounce. If the shading normal differs from the geometric normal, the
    /// photon is weighted by the adjoint BSDF (see [`emit`](super)). `eta` is the index of
    /// refraction on the far side relative to the near side.
    fn queue_after_specular_bounce(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        (shading, eta): (Vec3, f32),
        mut ray: PathRay,
    ) {
        let facet = vertex.normal;
        if shading != facet {
            let (wi, wo) = (vertex.wo, ray.ray.direction);
            let along = |direction: Vec3| direction - shading * direction.dot(shading);
            // Skip this if the geometric normal was used instead of the shading normal.
            if (along(wi) + along(wo) * eta).length_squared() < SAME {
                let (over, under) = (wi.dot(shading) * wo.dot(facet), wi.dot(facet) * wo.dot(shading));
                ray.throughput *= if under == 0.0 { 0.0 } else { (over / under).abs() };
            }
        }
        debug_assert_eq!(path.slot, ray.slot);
        self.next.push(ray);
    }
}

/// Probability that a photon is stored where it hits a surface.
fn storage_probability(path: &PathRay, vertex: &SurfaceVertex<'_>, lookups: &mut u64) -> f32 {
    if !vertex.is_blended() {
        return opacity_at_path_vertex(path, vertex, lookups);
    }
    let at = vertex.texture_lookup_point(path.state.pdf > 0.0);
    let is_stored = |part: &Material| can_store_photons(part, vertex.is_front);
    vertex.surface_material.presence_probability(&at, &is_stored, lookups)
}
