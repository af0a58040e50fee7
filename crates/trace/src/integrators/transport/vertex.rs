//! All data of a hit for shading, prepared once: the geometry, the shading normal, its bounds, and the BSDF.

use std::borrow::Cow;

use super::cone::{Bend, Cone};
use super::medium::Medium;
use super::ray::PathRay;
use super::tile::TileContext;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Asked, Ray, SurfacePoint};
use crate::integrators::RayCounters;
use crate::materials::{Coated, Footprint, Material, Mirror, Pane, RoughBsdf, TexturePoint};
use crate::math::Vec3;
use crate::scene::description::Shadows;
use crate::world::{Hit, Sides};

/// A path's vertex at a surface.
pub struct Vertex<'a> {
    /// The surface.
    pub surface: SurfacePoint,
    /// Its material.
    pub material: &'a Material,
    /// [`Ray::start`] of rays that leave.
    start: u32,
    /// Starts of rays that leave, if they are known better than by the error of the surface.
    sides: Option<Sides>,
    /// Whether the path hits the front.
    pub is_front: bool,
    /// Whether the surface has texture coordinates; looked up for materials with directions alone.
    has_coordinates: bool,
    /// Unit direction to the viewer, from which the path comes.
    pub to_eye: Vec3,
    /// Geometric normal on the viewer's side.
    pub normal: Vec3,
    /// −1 if the viewer's side is the back, else 1.
    side: f32,
    /// Point of the texture look-ups.
    pub texture_point: TexturePoint,
    /// The beam of the path at the surface.
    pub cone: Cone,
    /// Vertex colour, by which the material's colour is multiplied. `None` if it does not count.
    pub color: Option<Vec3>,
    /// Mean curvature, > 0 if the surface bulges towards the viewer; computed for δ surfaces alone.
    pub curvature: f32,
}

impl<'a> Vertex<'a> {
    /// The vertex at a hit.
    pub fn new(tile: &TileContext<'a>, path: &PathRay, hit: &Hit) -> Self {
        Self::on(tile, path, hit, tile.world.geometry.surface(&path.ray, hit))
    }

    /// The vertex at a hit, with only those parts of the surface that its material needs.
    pub fn to_shade(tile: &TileContext<'a>, path: &PathRay, hit: &Hit) -> Self {
        Self::shaded(tile, path, (&path.ray, hit), hit.shape.t)
    }

    /// The vertex at a hit whose surface is known.
    pub fn on(tile: &TileContext<'a>, path: &PathRay, hit: &Hit, surface: SurfacePoint) -> Self {
        Self::at_surface(tile, path, tile.world.material_index(hit), surface, hit, hit.shape.t)
    }

    /// The vertex of a surface that touches the surface of a hit at this distance, as the way between the sides of both
    /// hits it.
    pub fn touching(
        tile: &TileContext<'a>,
        path: &PathRay,
        (sides, hit): (Sides, &Hit),
        distance: f32,
    ) -> Self {
        Self { sides: Some(sides), ..Self::shaded(tile, path, (&sides.ray(), hit), distance) }
    }

    fn shaded(tile: &TileContext<'a>, path: &PathRay, (by, hit): (&Ray, &Hit), distance: f32) -> Self {
        let index = tile.world.material_index(hit);
        let is_lit = tile.world.materials[index].bsdf.is_lit();
        let asked = Asked { uv: tile.world.is_textured(index), shadow_point: is_lit };
        let surface = tile.world.geometry.asked_surface(by, hit, asked);
        Self::at_surface(tile, path, index, surface, hit, distance)
    }

    // Surfaces are large: each call would copy them.
    #[inline(always)]
    fn at_surface(
        tile: &TileContext<'a>,
        path: &PathRay,
        index: usize,
        surface: SurfacePoint,
        hit: &Hit,
        distance: f32,
    ) -> Self {
        let material = &tile.world.materials[index];
        // Decide which side the path is on.
        let to_eye = -path.ray.direction;
        let side = if surface.normal.dot(to_eye) < 0.0 { -1.0 } else { 1.0 };
        let cone = path.cone.after(distance);
        // Compute what beams need, if there are any.
        let has_beam = tile.pixel_spread > 0.0;
        let footprint = |tangents| match has_beam && tile.world.is_mipmapped(index) {
            true => Footprint::of_cone(cone.width.abs(), path.ray.direction, surface.normal, tangents),
            false => Footprint::POINT,
        };
        let curvature = match has_beam && material.bsdf.has_delta() {
            true => side * tile.world.geometry.curvature(hit, &surface),
            false => 0.0,
        };
        Self {
            texture_point: tile.world.texture_point(hit, &surface, footprint),
            cone,
            color: tile.world.vertex_color(hit),
            curvature,
            material,
            has_coordinates: tile.world.has_coordinates(hit.object),
            is_front: surface.normal.dot(path.ray.direction) < 0.0,
            to_eye,
            normal: surface.normal * side,
            side,
            surface,
            start: tile.world.geometry.triangle_number(hit),
            sides: None,
        }
    }

    /// Whether it emits towards the path.
    pub fn emits(&self) -> bool {
        self.material.emission.shines_from(self.is_front)
    }

    /// The radiance that it emits. For paths that share their lamps with light samples, it is what light samples find: that of the
    /// point.
    pub fn emitted(&self, path: &PathRay, counters: &mut RayCounters) -> Vec3 {
        let is_shared = path.state.density > 0.0;
        let at = self.place(is_shared);
        self.material.emission.at(&at, self.normal.dot(self.to_eye), &mut counters.texture_lookups)
    }

    /// The point of the texture look-ups, without its extent for paths that share their lamps with light samples.
    pub fn place(&self, is_shared: bool) -> Cow<'_, TexturePoint> {
        match is_shared {
            true => Cow::Owned(self.texture_point.without_extent()),
            false => Cow::Borrowed(&self.texture_point),
        }
    }

    /// A colour of the material, multiplied by the vertex colour.
    #[inline]
    pub fn tinted(&self, color: Vec3) -> Vec3 {
        self.color.map_or(color, |own| color * own)
    }

    /// Transmittance of a pane here. For paths that share their lamps with light samples, it is what shadow rays find: that of the
    /// point.
    pub fn pane_tint(&self, path: &PathRay, pane: &Pane, lookups: &mut u64) -> Vec3 {
        let is_shared = path.state.density > 0.0;
        let at = self.place(is_shared);
        self.tinted(pane.tint.at(&at, lookups).min(Vec3::ONE))
    }

    /// Multiplies a BSDF by the vertex colour.
    #[inline(always)]
    pub fn tint(&self, bsdf: &mut RoughBsdf) {
        if let Some(color) = self.color {
            *bsdf = bsdf.tinted(color);
        }
    }

    /// Sets the starts of rays that leave.
    pub fn start_between(&mut self, sides: Sides) {
        self.sides = Some(sides);
    }

    /// The vertex for light that comes through the surface: on the side that the viewer does not see.
    pub fn behind(&self) -> Self {
        let turned = |Sides { before, beyond }: Sides| Sides { before: beyond, beyond: before };
        Self {
            normal: -self.normal,
            side: -self.side,
            sides: self.sides.map(turned),
            texture_point: self.texture_point.clone(),
            ..*self
        }
    }

    /// The interpolated normal, bent by the relief, on the front side.
    pub fn front_shading_normal(&self, counters: &mut RayCounters) -> Vec3 {
        let surface = &self.surface;
        let Some(relief) = &self.material.relief else { return surface.shading_normal };
        let (normal, tangents) = (surface.shading_normal, [surface.dpdu, surface.dpdv]);
        relief.bend(&self.texture_point, normal, tangents, &mut counters.texture_lookups)
    }

    /// The shading normals.
    pub fn shading(&self, counters: &mut RayCounters) -> Shading {
        let normal = self.front_shading_normal(counters) * self.side;
        let smooth_normal = self.surface.shading_normal * self.side;
        let bend = (smooth_normal != normal).then(|| smooth_normal.dot(normal));
        Shading { normal, smooth_normal, bend }
    }

    /// The beam after reflection or refraction here.
    pub fn bent_cone(&self, bend: Bend) -> Cone {
        self.cone.bent(bend, self.curvature, self.to_eye.dot(self.normal))
    }

    /// Reflectance of a mirror here, by the shading normal; with white in place of textures if colours are not shown.
    pub fn mirror_reflectance(
        &self,
        mirror: &Mirror,
        shading: &Shading,
        is_colored: bool,
        counters: &mut RayCounters,
    ) -> Vec3 {
        let cosine = shading.normal.dot(self.to_eye).abs().min(1.0);
        if is_colored {
            mirror.reflectance(cosine, self.color, &self.texture_point, &mut counters.texture_lookups)
        } else {
            mirror.bleached(cosine)
        }
    }

    /// The part that a smooth coat here reflects, by the shading normal.
    pub fn coat_reflectance(&self, coated: &Coated, shading: &Shading) -> f32 {
        coated.fresnel(shading.normal.dot(self.to_eye).abs().min(1.0))
    }

    /// Derivative of the position by u; zero on a mesh without texture coordinates, whose barycentric ones say nothing about u.
    pub fn tangent(&self) -> Vec3 {
        if self.has_coordinates { self.surface.dpdu } else { Vec3::ZERO }
    }

    /// Origin of rays on the other side, where the starts of rays are known on both.
    pub fn beyond(&self) -> Option<Vec3> {
        self.sides.map(|sides| sides.beyond)
    }

    /// A ray that starts here.
    pub fn leaving(&self, direction: Vec3) -> Ray {
        let SurfacePoint { point, error, normal, .. } = self.surface;
        match self.sides {
            Some(sides) if direction.dot(self.normal) < 0.0 => Ray::new(sides.beyond, direction),
            Some(sides) => Ray::new(sides.before, direction),
            None => Ray::new(offset_origin(point, error, normal, direction), direction).leaving(self.start),
        }
    }

    /// Origin of light samples. A facet of a smooth mesh sees lights from a point above it, if nothing is on the way there, so
    /// that its neighbours do not shadow what the normals say is lit. Light at that point reaches the facet without passing
    /// around a corner of a closed surface. Otherwise the origin is on the facet itself, and nothing behind it is visible; so
    /// it is at vertices that the camera does not see, where the way up would cost a ray without a visible difference.
    pub fn shadow_origin(&self, tile: &TileContext<'_>, only_specular_before: bool) -> ShadowOrigin {
        let SurfacePoint { point, error, shadow_point, shading_normal, normal, .. } = self.surface;
        if let Some(sides) = self.sides {
            // No ray of rough glass passes its own facet on the way.
            let is_bent = shading_normal != normal && self.material.bsdf.glass().is_some();
            let horizon = is_bent.then_some(self.normal);
            return ShadowOrigin { point: sides.before, start: Ray::NO_TRIANGLE, horizon, lift: None };
        }
        let on_facet = offset_origin(point, error, self.normal, self.normal);
        let is_traced = tile.settings.render.shadows != Shadows::Off;
        let (is_above, end) = way_up(on_facet, shadow_point, self.normal, error);
        if is_above && !is_traced {
            return ShadowOrigin { point: shadow_point, start: Ray::NO_TRIANGLE, horizon: None, lift: None };
        }
        let horizon = (is_traced && shading_normal != normal).then_some(self.normal);
        let lift = (is_above && only_specular_before).then_some(Lift { to: shadow_point, end });
        ShadowOrigin { point: on_facet, start: self.start, horizon, lift }
    }
}

/// Whether the way from a facet to a point goes up far enough to matter, and the end of the way: 1 at the point, and a margin
/// for the error.
#[inline(always)]
pub fn way_up(on_facet: Vec3, to: Vec3, normal: Vec3, error: Vec3) -> (bool, f32) {
    let lift = Ray { t_max: 1.0, ..Ray::new(on_facet, to - on_facet) };
    let is_above = lift.direction.dot(normal) > LEAST_LIFT * normal.abs().dot(error);
    (is_above, lift.beyond(error).t_max)
}

/// Least lift, in errors of the point; for less, the facet serves as well.
const LEAST_LIFT: f32 = 8.0;

/// Origin of light samples and shadow rays.
#[derive(Clone, Copy, Debug)]
pub struct ShadowOrigin {
    /// The point from which lights are sampled and shadow rays start.
    pub point: Vec3,
    /// [`Ray::start`] of the rays in front of the facet.
    pub start: u32,
    /// Horizon normal: nothing behind it is visible. `None` if the cosines or the shadow rays take care of this.
    pub horizon: Option<Vec3>,
    /// Another point above it. If nothing is on the way there, lights are sampled from it, in all directions.
    pub lift: Option<Lift>,
}

/// The way to a point above a facet.
#[derive(Clone, Copy, Debug)]
pub struct Lift {
    /// The point.
    pub to: Vec3,
    /// The end of the way: 1 at the point, and a margin for the error.
    pub end: f32,
}

impl Shading {
    /// The normals on the other side.
    pub fn behind(&self) -> Self {
        Self { normal: -self.normal, smooth_normal: -self.smooth_normal, bend: self.bend }
    }
}

/// Shading normals on the viewer's side.
pub struct Shading {
    /// The interpolated normal, bent by a relief.
    pub normal: Vec3,
    /// The interpolated normal.
    pub smooth_normal: Vec3,
    /// The cosine between them. `None` if they are equal.
    pub bend: Option<f32>,
}

/// A vertex with a lobe that is not δ, ready for direct light.
pub struct ShadingVertex<'a> {
    /// The path that came here.
    pub path: &'a PathRay,
    /// The glass around the side that is lit.
    pub medium: &'a Medium,
    /// Its place in the round's queue.
    pub place: u32,
    /// The vertex.
    pub vertex: &'a Vertex<'a>,
    /// Its shading normals.
    pub shading: Shading,
    /// Its BSDF.
    pub bsdf: &'a RoughBsdf,
}
