//! A path vertex: the geometry, normals and material at a hit, prepared for shading.

use std::borrow::Cow;

use super::cone::{RayCone, SpecularEvent};
use super::interiors::InteriorList;
use super::ray::PathRay;
use super::tile::TileContext;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint, SurfaceRequest};
use crate::integrators::RayCounters;
use crate::materials::{
    BxdfPoint, Footprint, Material, Mirror, SpecularLayer, SpecularOverBase, TexturePoint, ThinDielectric,
};
use crate::math::Vec3;
use crate::sampling::Dimension;
use crate::scene::description::ShadowMode;
use crate::world::{Hit, OffsetPoints};

/// A path vertex on a surface.
pub struct SurfaceVertex<'a> {
    /// The surface.
    pub surface: SurfacePoint,
    /// Material of the surface. At a blend, this is the chosen part.
    pub material: &'a Material,
    /// Material of the surface before choosing a part of a blend.
    pub surface_material: &'a Material,
    /// [`Ray::start`] for rays that leave the vertex.
    start: u32,
    /// Origins for rays on either side, if they are known more precisely than the surface's error bound
    /// allows.
    sides: Option<OffsetPoints>,
    /// Whether the path hits the front face.
    pub is_front: bool,
    /// Whether the surface has texture coordinates. Set only for materials that need tangents.
    has_uv: bool,
    /// Unit direction toward the viewer, opposite to the path's ray.
    pub wo: Vec3,
    /// Geometric normal, oriented toward the viewer.
    pub normal: Vec3,
    /// −1 if the viewer is on the back side, 1 otherwise.
    side: f32,
    /// Point for texture lookups.
    pub texture_point: TexturePoint,
    /// The path's ray cone at the surface.
    pub cone: RayCone,
    /// Vertex color, if any, which multiplies the material's color.
    pub color: Option<Vec3>,
    /// Mean curvature, positive if the surface bulges toward the viewer. Computed only for specular surfaces.
    pub curvature: f32,
}

impl<'a> SurfaceVertex<'a> {
    /// Creates the vertex at a hit.
    pub fn new(tile: &TileContext<'a>, path: &PathRay, hit: &Hit) -> Self {
        Self::from_computed_surface(tile, path, hit, tile.world.geometry.surface(&path.ray, hit))
    }

    /// Creates the vertex at a hit, computing only what the material needs.
    pub fn from_hit_with_needed_attributes(tile: &TileContext<'a>, path: &PathRay, hit: &Hit) -> Self {
        Self::from_ray_hit(tile, path, (&path.ray, hit), hit.shape.t)
    }

    /// Creates the vertex at a hit whose surface has already been computed.
    pub fn from_computed_surface(
        tile: &TileContext<'a>,
        path: &PathRay,
        hit: &Hit,
        surface: SurfacePoint,
    ) -> Self {
        Self::at_surface(tile, path, tile.world.material_index(hit), surface, hit, hit.shape.t)
    }

    /// Creates the vertex on a surface that coincides with the surface that the path hits at `distance`.
    /// `hit` is a hit along the segment between the origins on either side.
    pub fn at_coincident_surface(
        tile: &TileContext<'a>,
        path: &PathRay,
        (sides, hit): (OffsetPoints, &Hit),
        distance: f32,
    ) -> Self {
        Self {
            sides: Some(sides),
            ..Self::from_ray_hit(tile, path, (&sides.segment_from_before_to_beyond(), hit), distance)
        }
    }

    fn from_ray_hit(tile: &TileContext<'a>, path: &PathRay, (by, hit): (&Ray, &Hit), distance: f32) -> Self {
        let index = tile.world.material_index(hit);
        let is_lit = tile.world.materials[index].bsdf.has_non_delta_lobes();
        let request =
            SurfaceRequest { uv: tile.world.material_needs_uvs_or_tangents(index), shadow_point: is_lit };
        let surface = tile.world.geometry.requested_surface(by, hit, request);
        Self::at_surface(tile, path, index, surface, hit, distance)
    }

    // Inlined because each call would copy the surface, which is large.
    #[inline(always)]
    fn at_surface(
        tile: &TileContext<'a>,
        path: &PathRay,
        index: usize,
        surface: SurfacePoint,
        hit: &Hit,
        distance: f32,
    ) -> Self {
        let surface_material = &tile.world.materials[index];
        // Determine the path's side.
        let wo = -path.ray.direction;
        let side = if surface.normal.dot(wo) < 0.0 { -1.0 } else { 1.0 };
        let cone = path.cone.propagated_by(distance);
        // If ray cones are used, compute the footprint and the curvature.
        let has_beam = tile.camera_cone.is_some();
        let footprint = |tangents| match has_beam && tile.world.is_material_mipmapped(index) {
            true => Footprint::from_ray_cone(cone.width.abs(), path.ray.direction, surface.normal, tangents),
            false => Footprint::POINT,
        };
        let texture_point = tile.world.texture_point(hit, &surface, footprint);
        let material = choose_blend_part(tile, path, surface_material, &texture_point);
        let curvature = match has_beam && material.bsdf.has_delta() {
            true => side * tile.world.geometry.mean_curvature(hit, &surface),
            false => 0.0,
        };
        Self {
            texture_point,
            cone,
            color: tile.world.vertex_color(hit),
            curvature,
            material,
            surface_material,
            has_uv: tile.world.object_has_texture_axes_if_needed(hit.object),
            is_front: surface.normal.dot(path.ray.direction) < 0.0,
            wo,
            normal: surface.normal * side,
            side,
            surface,
            start: tile.world.geometry.scene_triangle_number(hit),
            sides: None,
        }
    }

    /// Whether the surface is a blend.
    pub fn is_blended(&self) -> bool {
        !std::ptr::eq(self.material, self.surface_material)
    }

    /// Whether the surface scatters light on the side of the path.
    pub fn scatters(&self) -> bool {
        self.material.scatters_on_side(self.is_front)
    }

    /// Whether the vertex emits toward the path.
    pub fn emits(&self) -> bool {
        self.material.emission.emits_on_side(self.is_front)
    }

    /// Radiance emitted toward the path. If light samples compete with the path, texture lookups are
    /// unfiltered, as in light samples.
    pub fn emitted_radiance(&self, path: &PathRay, counters: &mut RayCounters) -> Vec3 {
        let is_shared = path.state.pdf > 0.0;
        let at = self.texture_lookup_point(is_shared);
        self.material.emission.radiance_at_cosine(
            &at,
            self.normal.dot(self.wo),
            &mut counters.texture_lookups,
        )
    }

    /// Point for texture lookups. Has no footprint if `is_shared`, which means that light samples compete
    /// with the path.
    pub fn texture_lookup_point(&self, is_shared: bool) -> Cow<'_, TexturePoint> {
        match is_shared {
            true => Cow::Owned(self.texture_point.without_footprint()),
            false => Cow::Borrowed(&self.texture_point),
        }
    }

    /// Multiplies a material color by the vertex color.
    #[inline]
    pub fn times_vertex_color(&self, color: Vec3) -> Vec3 {
        self.color.map_or(color, |own| color * own)
    }

    /// Transmittance of a thin pane at this vertex. If light samples compete with the path, the texture is
    /// looked up without filtering, as for shadow rays.
    pub fn pane_transmittance(&self, path: &PathRay, pane: &ThinDielectric, lookups: &mut u64) -> Vec3 {
        let is_shared = path.state.pdf > 0.0;
        let at = self.texture_lookup_point(is_shared);
        self.times_vertex_color(pane.tint.evaluate(&at, lookups).min(Vec3::ONE))
    }

    /// Multiplies a BSDF by the vertex color.
    #[inline(always)]
    pub fn tint_bsdf_by_vertex_color(&self, bsdf: &mut BxdfPoint) {
        if let Some(color) = self.color {
            *bsdf = bsdf.tinted(color);
        }
    }

    /// Sets the origins for rays on either side.
    pub fn set_offset_points(&mut self, sides: OffsetPoints) {
        self.sides = Some(sides);
    }

    /// Vertex for transmitted light, on the side facing away from the viewer.
    pub fn seen_from_far_side(&self) -> Self {
        let turned =
            |OffsetPoints { before, beyond }: OffsetPoints| OffsetPoints { before: beyond, beyond: before };
        Self {
            normal: -self.normal,
            side: -self.side,
            sides: self.sides.map(turned),
            texture_point: self.texture_point.clone(),
            ..*self
        }
    }

    /// Shading normal on the front side: interpolated, then perturbed by the normal or bump map.
    pub fn unflipped_perturbed_normal(&self, counters: &mut RayCounters) -> Vec3 {
        let surface = &self.surface;
        let Some(normal_perturbation) = &self.material.normal_perturbation else {
            return surface.shading_normal;
        };
        let (normal, tangents) = (surface.shading_normal, [surface.dpdu, surface.dpdv]);
        normal_perturbation.perturb(&self.texture_point, normal, tangents, &mut counters.texture_lookups)
    }

    /// The shading normals on the viewer's side.
    pub fn perturbed_and_smooth_normals(&self, counters: &mut RayCounters) -> PerturbedAndSmoothNormals {
        let normal = self.unflipped_perturbed_normal(counters) * self.side;
        let smooth_normal = self.surface.shading_normal * self.side;
        let shading_normal_cosine = (smooth_normal != normal).then(|| smooth_normal.dot(normal));
        PerturbedAndSmoothNormals { normal, smooth_normal, shading_normal_cosine }
    }

    /// Ray cone after specular reflection or refraction.
    pub fn cone_after_specular(&self, event: SpecularEvent) -> RayCone {
        self.cone.after_specular(event, self.curvature, self.wo.dot(self.normal))
    }

    /// Reflectance of a mirror at this vertex, using the shading normal. Textures are treated as white unless
    /// `is_colored` is true.
    pub fn mirror_reflectance(
        &self,
        mirror: &Mirror,
        shading: &PerturbedAndSmoothNormals,
        is_colored: bool,
        counters: &mut RayCounters,
    ) -> Vec3 {
        let cosine = shading.normal.dot(self.wo).abs().min(1.0);
        if is_colored {
            mirror.reflectance(cosine, self.color, &self.texture_point, &mut counters.texture_lookups)
        } else {
            mirror.reflectance_with_white_textures(cosine)
        }
    }

    /// The δ lobe of a surface that also has non-specular lobes, using the shading normal. Mirrors are
    /// treated as white unless `is_colored` is true.
    pub fn specular_lobe(
        &self,
        layers: &SpecularOverBase,
        shading: &PerturbedAndSmoothNormals,
        is_colored: bool,
        counters: &mut RayCounters,
    ) -> SpecularLobe {
        let cosine = shading.normal.dot(self.wo).abs().min(1.0);
        let mirror = match &layers.specular {
            SpecularLayer::Mirror(mirror) => self.mirror_reflectance(mirror, shading, is_colored, counters),
            SpecularLayer::SmoothCoat { .. } => Vec3::ONE,
        };
        let lookups = &mut counters.texture_lookups;
        let probability = layers.specular_probability(cosine, mirror, &self.texture_point, lookups);
        SpecularLobe { cosine, mirror, probability }
    }

    /// Reflectance of the δ lobe, divided by the probability of choosing it.
    pub fn specular_sample_weight(
        &self,
        layers: &SpecularOverBase,
        lobe: &SpecularLobe,
        counters: &mut RayCounters,
    ) -> Vec3 {
        let &SpecularLobe { cosine, mirror, probability: _ } = lobe;
        layers.specular_sample_weight(cosine, mirror, &self.texture_point, &mut counters.texture_lookups)
    }

    /// ∂p/∂u, or zero on a mesh without texture coordinates, where u is not defined.
    pub fn dpdu_or_zero(&self) -> Vec3 {
        if self.has_uv { self.surface.dpdu } else { Vec3::ZERO }
    }

    /// Returns the geometry for light sampling and BSDF sampling.
    #[inline(always)]
    pub fn scattering_geometry(
        &self,
        tile: &TileContext<'_>,
        only_specular_before: bool,
    ) -> ScatteringGeometry {
        ScatteringGeometry {
            origin: self.shadow_origin(tile, only_specular_before),
            facet: Some((self.surface.point, self.normal)),
            wo: self.wo,
            tangent: self.dpdu_or_zero(),
        }
    }

    /// Origin for rays on the far side, if the origins on both sides are known.
    pub fn far_origin(&self) -> Option<Vec3> {
        self.sides.map(|sides| sides.beyond)
    }

    /// Spawns a ray from the vertex in a direction.
    pub fn spawn_ray(&self, direction: Vec3) -> Ray {
        let SurfacePoint { point, error, normal, .. } = self.surface;
        match self.sides {
            Some(sides) if direction.dot(self.normal) < 0.0 => Ray::new(sides.beyond, direction),
            Some(sides) => Ray::new(sides.before, direction),
            None => Ray::new(offset_origin(point, error, normal, direction), direction)
                .with_start_triangle(self.start),
        }
    }

    /// Origin of shadow rays. On a smooth mesh, lights are sampled from a point above the facet if the
    /// segment to this point is unoccluded. Neighboring facets then do not shadow areas that are lit
    /// according to the shading normals. Light that reaches this point also reaches the facet, without
    /// leaking around a corner of a closed surface. Otherwise, the origin is on the facet, and nothing behind
    /// the facet is visible. Vertices that the camera does not see also use the facet, because testing the
    /// segment would cost a ray without a visible difference.
    pub fn shadow_origin(&self, tile: &TileContext<'_>, only_specular_before: bool) -> ShadowOrigin {
        let SurfacePoint { point, error, shadow_point, shading_normal, normal, .. } = self.surface;
        if let Some(sides) = self.sides {
            // Rays from rough glass must not pass through their own facet.
            let is_perturbed = shading_normal != normal && self.material.bsdf.as_dielectric().is_some();
            let horizon = is_perturbed.then_some(self.normal);
            return ShadowOrigin { point: sides.before, start: Ray::NO_TRIANGLE, horizon, lift: None };
        }
        let on_facet = offset_origin(point, error, self.normal, self.normal);
        let is_traced = tile.settings.render.shadows != ShadowMode::Off;
        let (is_above, end) = lift_significance_and_t_max(on_facet, shadow_point, self.normal, error);
        if is_above && !is_traced {
            return ShadowOrigin { point: shadow_point, start: Ray::NO_TRIANGLE, horizon: None, lift: None };
        }
        let horizon = (is_traced && shading_normal != normal).then_some(self.normal);
        let lift =
            (is_above && only_specular_before).then_some(ShadowOriginLiftSegment { to: shadow_point, end });
        ShadowOrigin { point: on_facet, start: self.start, horizon, lift }
    }
}

/// Chooses a part of a blend. All vertices of one interaction choose the same part, because the random number
/// depends only on the path. If light samples compete with the path, the weight's texture is looked up
/// without filtering, as for light samples and shadow rays.
#[inline]
fn choose_blend_part<'a>(
    tile: &TileContext<'_>,
    path: &PathRay,
    material: &'a Material,
    at: &TexturePoint,
) -> &'a Material {
    if !material.is_blend() {
        return material;
    }
    let number = || tile.sampler_for_slot(path.slot).pair(path.path, Dimension::Blend).x;
    match path.state.pdf > 0.0 {
        true => material.choose_part(&at.without_footprint(), number, &mut 0),
        false => material.choose_part(at, number, &mut 0),
    }
}

/// Returns whether the distance from a facet to the lifted point `to` is significant. Also returns the
/// segment's `t_max`: 1 at the point, plus a margin for the error.
#[inline(always)]
pub fn lift_significance_and_t_max(on_facet: Vec3, to: Vec3, normal: Vec3, error: Vec3) -> (bool, f32) {
    let lift = Ray { t_max: 1.0, ..Ray::new(on_facet, to - on_facet) };
    let is_above = lift.direction.dot(normal) > MIN_LIFT * normal.abs().dot(error);
    (is_above, lift.extended_by_endpoint_error(error).t_max)
}

/// Minimum lift, in units of the point's error. Below it, the point on the facet is used.
const MIN_LIFT: f32 = 8.0;

/// The δ lobe of a surface that also has non-specular lobes, for one view direction.
pub struct SpecularLobe {
    cosine: f32,
    mirror: Vec3,
    /// Probability of choosing the δ lobe.
    pub probability: f32,
}

/// Geometry of a vertex at which light is sampled and the path may scatter, on a surface or elsewhere.
pub struct ScatteringGeometry {
    /// Origin of light samples and shadow rays.
    pub origin: ShadowOrigin,
    /// The surface point, and the geometric normal oriented toward the viewer. `None` if the vertex is not on
    /// a surface. The origin and the shading normal are then used instead.
    pub facet: Option<(Vec3, Vec3)>,
    /// Unit direction toward the viewer.
    pub wo: Vec3,
    /// ∂p/∂u, or zero without texture coordinates.
    pub tangent: Vec3,
}

/// Origin of shadow rays.
#[derive(Clone, Copy, Debug)]
pub struct ShadowOrigin {
    /// The point from which lights are sampled and shadow rays start.
    pub point: Vec3,
    /// [`Ray::start`] for rays in front of the facet.
    pub start: u32,
    /// Horizon normal, behind which all directions are occluded, or `None` if the cosines or the shadow rays
    /// account for this.
    pub horizon: Option<Vec3>,
    /// A point above the facet. If the segment to this point is unoccluded, it is used as the origin for
    /// lights in all directions.
    pub lift: Option<ShadowOriginLiftSegment>,
}

/// A segment from a facet to a point above it.
#[derive(Clone, Copy, Debug)]
pub struct ShadowOriginLiftSegment {
    /// The lifted point.
    pub to: Vec3,
    /// The segment's `t_max`: 1 at the point, plus a margin for the error.
    pub end: f32,
}

impl PerturbedAndSmoothNormals {
    /// Returns the normals on the other side.
    pub fn seen_from_far_side(&self) -> Self {
        Self {
            normal: -self.normal,
            smooth_normal: -self.smooth_normal,
            shading_normal_cosine: self.shading_normal_cosine,
        }
    }
}

/// Shading normals on the viewer's side.
pub struct PerturbedAndSmoothNormals {
    /// The interpolated normal, perturbed by the normal or bump map.
    pub normal: Vec3,
    /// The interpolated normal.
    pub smooth_normal: Vec3,
    /// The cosine between the two normals, or `None` if they are equal.
    pub shading_normal_cosine: Option<f32>,
}

/// A vertex with a non-specular lobe, ready for direct lighting.
pub struct ShadingVertex<'a> {
    /// The path whose ray hit the surface at this vertex.
    pub path: &'a PathRay,
    /// The medium on the lit side.
    pub interiors: &'a InteriorList,
    /// Index of the path in the bounce's queue.
    pub place: u32,
    /// The vertex to shade.
    pub vertex: &'a SurfaceVertex<'a>,
    /// Shading normals of the vertex.
    pub shading: PerturbedAndSmoothNormals,
    /// BSDF of the vertex.
    pub bsdf: &'a BxdfPoint,
}
