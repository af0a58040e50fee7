//! Vertices of camera paths at diffuse and glossy surfaces, queued for light and BSDF sampling.

use super::CameraPathWavefront;
use crate::geometry::packet::set_bit_lanes;
use crate::integrators::direct::queue::ShadingSides;
use crate::integrators::transport::interface::diffuser_basic_radiance_transmittance;
use crate::integrators::transport::interiors::InteriorList;
use crate::integrators::transport::packet::PacketHits;
use crate::integrators::transport::packet_source::PacketSource;
use crate::integrators::transport::ray::PathRay;
use crate::integrators::transport::vertex::{ShadingVertex, SurfaceVertex};
use crate::integrators::view::PathAov;
use crate::materials::{BxdfPoint, NonSpecular, RoughDielectricPoint};
use crate::math::Vec3;
use crate::scene::description::ShadowMode;

impl CameraPathWavefront<'_, '_> {
    /// Whether paths may scatter at the current hits.
    pub(super) fn is_below_max_depth(&self) -> bool {
        self.depth < self.tile.settings.render.max_depth
    }

    /// Stores the ray cones at the vertices of plain surfaces, if ray cones are used.
    pub(super) fn store_plain_surface_cones(&mut self, rays: &PacketSource<'_>, packet: &PacketHits) {
        if self.tile.camera_cone.is_some() {
            for lane in set_bit_lanes(packet.plain) {
                let Some(hit) = packet.hit(lane) else { continue };
                let cone = rays.path(self.tile, lane).cone.propagated_by(hit.shape.t);
                self.direct.store_ray_cone(rays.queue_index(lane), cone);
            }
        }
    }

    /// Shades a non-specular surface. `far` is the medium behind the surface.
    pub(super) fn shade_non_specular(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: &NonSpecular,
        far: &InteriorList,
    ) {
        let (at, lookups) = (&vertex.texture_point, &mut self.counters.texture_lookups);
        let ambient = self.tile.settings.render.ambient;
        let accepts_ambient = ambient != Vec3::ZERO && self.accumulator.accepts_ambient(path);
        // Look up only the textures needed for the displayed quantity.
        if !self.accumulator.accepts_reflected() {
            if accepts_ambient {
                let reflectance = vertex.times_vertex_color(rough.look_up_ambient(at, lookups));
                self.accumulator.add_ambient(path, self.place, path.throughput * ambient * reflectance);
            }
            return;
        }
        let is_colored = self.accumulator.aov.applies_surface_colors();
        let mut bsdf =
            if is_colored { rough.evaluate_textures(at, lookups) } else { rough.with_white_textures() };
        if is_colored {
            vertex.tint_bsdf_by_vertex_color(&mut bsdf);
        }
        if accepts_ambient {
            self.accumulator.add_ambient(
                path,
                self.place,
                path.throughput * ambient * bsdf.ambient_reflectance(),
            );
        }
        if bsdf.is_black() {
            return;
        }
        self.queue_for_direct_lighting(path, vertex, &bsdf, far);
    }

    /// Queues the vertices of a non-specular surface for direct lighting. `far` is the medium behind the
    /// surface.
    #[inline(always)]
    pub(super) fn queue_for_direct_lighting(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        bsdf: &BxdfPoint,
        far: &InteriorList,
    ) {
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let behind = bsdf.bsdf_for_transmitted_light().map(|bsdf| (bsdf, shading.seen_from_far_side()));
        let aov = self.light_aov_at_vertex_of_path(path);
        let lit = ShadingVertex { path, interiors: &path.interiors, place, vertex, shading, bsdf };
        self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        // Transmitted light has its own vertex, except for the lit fraction, which is measured on the
        // viewer's side.
        if let Some((bsdf, shading)) = behind.filter(|_| aov != PathAov::LitFraction) {
            let throughput =
                path.throughput * diffuser_basic_radiance_transmittance(tile.world, &path.interiors, far);
            let (path, vertex) = (&PathRay { throughput, ..*path }, &vertex.seen_from_far_side());
            let lit = ShadingVertex { path, interiors: far, place, vertex, shading, bsdf: &bsdf };
            self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        }
    }

    /// Queues the vertices for rough glass: one for each side, or a single vertex if light samples cannot
    /// reach one of the sides.
    pub(super) fn queue_rough_glass_vertices(
        &mut self,
        path: &PathRay,
        vertex: &SurfaceVertex<'_>,
        rough: RoughDielectricPoint,
        far: &InteriorList,
    ) {
        if !self.accumulator.accepts_reflected() {
            return;
        }
        let (tile, place) = (self.tile, self.place);
        let shading = vertex.perturbed_and_smooth_normals(self.counters);
        let aov = self.light_aov_at_vertex_of_path(path);
        let near = &path.interiors;
        let (reflection, transmission) = (rough.reflection_bxdf(), rough.transmission_bxdf());
        // The lit fraction is measured on the viewer's side. Blocked light is included, so a dark side is
        // sampled like any other.
        if aov == PathAov::LitFraction {
            let lit = ShadingVertex { path, interiors: near, place, vertex, shading, bsdf: &reflection };
            return self.direct.push(tile, &lit, aov, ShadingSides::OneSide { is_dark: false });
        }
        // Without shadows, lights also illuminate the inside of solids.
        let has_shadows = tile.settings.render.shadows != ShadowMode::Off;
        let is_dark = |interiors: &InteriorList| {
            interiors.medium_glass().is_some_and(|inside| tile.world.is_glass_interior_shadowed(inside.body))
        };
        let dark = [near, far].map(|interiors| has_shadows && is_dark(interiors));
        // Photons are stored on both sides, so each side needs a vertex.
        let is_one = dark != [false; 2] && !tile.behavior.gathers && vertex.far_origin().is_some();
        let is_behind = is_one && dark == [true, false];
        let sides = |vertex: &SurfaceVertex<'_>, is_dark: bool, interiors| match vertex.far_origin() {
            Some(beyond) if is_one => ShadingSides::TwoSides { is_dark, beyond, interiors },
            Some(_) | None => ShadingSides::OneSide { is_dark },
        };
        // Queue the viewer's side, unless the vertex on the other side represents both sides.
        let behind =
            (!is_one || is_behind).then(|| (vertex.seen_from_far_side(), shading.seen_from_far_side()));
        if !is_behind {
            let lit = ShadingVertex { path, interiors: near, place, vertex, shading, bsdf: &reflection };
            self.direct.push(tile, &lit, aov, sides(vertex, dark[0], far));
        }
        // Queue the other side.
        if let Some((vertex, shading)) = behind {
            let lit =
                ShadingVertex { path, interiors: far, place, vertex: &vertex, shading, bsdf: &transmission };
            self.direct.push(tile, &lit, aov, sides(&vertex, dark[1], near));
        }
    }

    /// The light AOV at a path's vertex. After the first non-specular surface, all light is included.
    pub(super) fn light_aov_at_vertex_of_path(&self, path: &PathRay) -> PathAov {
        if path.state.only_specular_before { self.accumulator.aov } else { PathAov::ALL }
    }
}
