//! Emission and ambient light found by camera paths.

use super::CameraPathWavefront;
use crate::geometry::packet::{RayPacket, set_bit_lanes};
use crate::integrators::behavior::PathBehavior;
use crate::integrators::transport::accumulator::NonReflectedTerm;
use crate::integrators::transport::packet::PacketHits;
use crate::integrators::transport::packet_source::PacketSource;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::vertex::SurfaceVertex;
use crate::integrators::transport::walk::OpaqueSurfaceHit;
use crate::math::Vec3;
use crate::math::lanes::lane as lane_of;
use crate::scene::description::ShadowMode;
use crate::world::Hit;

impl CameraPathWavefront<'_, '_> {
    /// Masks of a packet's plain surfaces that emit or reflect ambient light, and of the rays that escape to
    /// a background or an infinite light.
    pub(super) fn emitting_and_escaped_masks(
        &self,
        rays: &PacketSource<'_>,
        packet: &PacketHits,
    ) -> (u32, u32) {
        let (render, lights) = (&self.tile.settings.render, &self.tile.world.lights);
        let plain = if render.ambient == Vec3::ZERO { packet.shining } else { packet.plain };
        let is_dark_beyond = render.background == Vec3::ZERO && !lights.escaping_rays_can_hit_light();
        (plain, if is_dark_beyond { 0 } else { rays.mask() & !packet.any })
    }

    /// Adds the emission visible to camera rays: from plain surfaces, the background and infinite lights. It
    /// can be added directly because each sample's emission precedes its direct light.
    pub(super) fn add_camera_ray_emission(
        &mut self,
        rays: &RayPacket,
        first: u32,
        packet: &PacketHits,
        (plain, beyond): (u32, u32),
    ) {
        let tile = self.tile;
        let render = &tile.settings.render;
        // Add the emission and ambient light of plain surfaces.
        let has_ambient = render.ambient != Vec3::ZERO && self.depth < render.max_depth;
        let mut known: Option<(usize, Vec3, Option<Vec3>)> = None;
        for lane in set_bit_lanes(plain) {
            let Some(hit) = packet.hit(lane) else { continue };
            let index = tile.world.material_index(&hit);
            if known.is_none_or(|(own, ..)| own != index) {
                known = tile.plain_material_for_packets(index).map(|(material, _)| {
                    let ambient = material.ambient.filter(|_| has_ambient);
                    (index, material.emission, ambient.map(|ambient| render.ambient * ambient))
                });
            }
            let Some((_, emission, ambient)) = known else { continue };
            let slot = first + lane as u32;
            if packet.shining & 1 << lane != 0 {
                self.accumulator.add_non_reflected(slot, NonReflectedTerm::Emitted, emission);
            }
            if let Some(ambient) = ambient {
                self.accumulator.add_non_reflected(slot, NonReflectedTerm::Ambient, ambient);
            }
        }
        // Add the background and the infinite lights.
        let lights = &tile.world.lights;
        if !lights.escaping_rays_can_hit_light() {
            let slots = set_bit_lanes(beyond).map(|lane| first + lane as u32);
            return self.accumulator.add_background(slots, render.background);
        }
        for lane in set_bit_lanes(beyond) {
            let sky = lights.environment().map(|_| packet.sky_radiance_and_pdf_of_lane(lane));
            let beyond = lights.radiance_from_infinity_with_precomputed_sky(
                sky,
                lane_of(&rays.direction, lane),
                |_, _| 1.0,
            );
            self.accumulator.add_non_reflected(
                first + lane as u32,
                NonReflectedTerm::Emitted,
                render.background + beyond,
            );
        }
    }

    /// Adds a plain surface's emission and ambient light.
    pub(super) fn add_emission_and_ambient(&mut self, path: &PathRay, hit: &Hit, is_shining: bool) {
        let index = self.tile.world.material_index(hit);
        let Some((material, _)) = self.tile.plain_material_for_packets(index) else { return };
        if is_shining {
            self.add_weighted_emission(path, material.emission, self.tile.emitter_mis_weight(path, hit));
        }
        let render = &self.tile.settings.render;
        if render.ambient != Vec3::ZERO && self.depth < render.max_depth {
            let Some(ambient) = material.ambient else { return };
            self.accumulator.add_ambient(path, self.place, path.throughput * render.ambient * ambient);
        }
    }

    /// Adds the emission of a surface and returns whether the path may scatter at the surface.
    pub(super) fn add_emission_and_check_depth(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        hit: OpaqueSurfaceHit,
    ) -> bool {
        if vertex.emits() {
            let weight = match hit {
                OpaqueSurfaceHit::Direct(hit) => self.tile.emitter_mis_weight(path, &hit),
                OpaqueSurfaceHit::Touching(hit) => self.tile.coincident_glass_emitter_mis_weight(path, &hit),
            };
            let radiance = vertex.emitted_radiance(path, self.counters);
            self.add_weighted_emission(path, radiance, weight);
        }
        self.is_below_max_depth()
    }

    /// Adds the emission of a surface that a path hits, multiplied by the path's MIS weight. Light samples
    /// contribute the rest.
    pub(super) fn add_weighted_emission(&mut self, path: &PathRay, radiance: Vec3, weight: f32) {
        if self.is_light_counted_elsewhere(path) {
            return;
        }
        if path.state.only_specular_before {
            self.accumulator.add_non_reflected(
                path.slot,
                NonReflectedTerm::Emitted,
                path.throughput * radiance,
            );
        } else {
            self.accumulator.add_emitter_hit(path, self.place, path.throughput * radiance * weight);
        }
    }

    /// Whether another technique accounts for the light that a path finds: photons for light via mirrors and
    /// glass, or light samples for hard shadows.
    pub(super) fn is_light_counted_elsewhere(&self, path: &PathRay) -> bool {
        let PathBehavior { gathers, mirrors, .. } = self.tile.behavior;
        let is_shared = path.state.pdf > 0.0;
        let is_soft = self.tile.settings.render.shadows == ShadowMode::Soft;
        !path.state.only_specular_before && (gathers || mirrors && is_shared) && !(is_shared && is_soft)
    }

    pub(super) fn add_mis_weighted_infinite_light(&mut self, path: &PathRay) {
        self.add_infinite_light(path, self.tile.mis_weighted_infinite_light(path));
    }

    /// Adds light from infinite lights to a path that leaves the scene. The background is visible but does
    /// not illuminate anything.
    pub(super) fn add_infinite_light(&mut self, path: &PathRay, beyond: Vec3) {
        if path.state.only_specular_before {
            let background = self.tile.settings.render.background;
            self.accumulator.add_non_reflected(
                path.slot,
                NonReflectedTerm::Emitted,
                path.throughput * (background + beyond),
            );
        } else if beyond != Vec3::ZERO && !self.is_light_counted_elsewhere(path) {
            self.accumulator.add_emitter_hit(path, self.place, path.throughput * beyond);
        }
    }
}
