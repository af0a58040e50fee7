//! Emission textures: radiance that varies with position because of a texture or opacity, or with direction
//! because of a clear coat.
//!
//! The texture is importance sampled on quads, but not on other shapes. Each sample is multiplied by the
//! texture value at its point. Pdfs depend only on the emitter.

use std::sync::Arc;

use crate::geometry::triangle::barycentric_weights_at_point;
use crate::geometry::{RayF64, Shape};
use crate::materials::texture::Texture;
use crate::materials::{Coat, Footprint, Opacity, SecondUvPoint, TexturePoint};
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// A factor on a light's radiance that varies with position and direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionModulation {
    texture: Option<Arc<Texture>>,
    opacity: Option<Opacity>,
    coat: Option<Arc<Coat>>,
    chart: UvMapping,
}

/// Maps points on a light to texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum UvMapping {
    /// The shape's own UV parameterization.
    Shape(Shape),
    /// UVs of a mesh's triangles, sorted by primitive index.
    Triangles(Vec<TriangleWithUvs>),
}

/// A triangle with UV coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleWithUvs {
    /// Primitive index in its object.
    pub primitive: u32,
    /// Corners in world coordinates.
    pub corners: [DVec3; 3],
    /// UVs of the corners.
    pub uvs: [Vec2; 3],
    /// The corners' UVs in the second set, or `None` if there is no second set.
    pub second_uvs: Option<[Vec2; 3]>,
}

impl EmissionModulation {
    /// Creates the factor from a texture and an opacity. Returns `None` if there is neither.
    pub fn new(texture: Option<&Arc<Texture>>, opacity: Option<&Opacity>, chart: UvMapping) -> Option<Self> {
        Self::new_with_coat(texture, opacity, None, chart)
    }

    /// [`EmissionModulation::new`] under a clear coat.
    pub fn new_with_coat(
        texture: Option<&Arc<Texture>>,
        opacity: Option<&Opacity>,
        coat: Option<&Arc<Coat>>,
        chart: UvMapping,
    ) -> Option<Self> {
        let is_any = texture.is_some() || opacity.is_some() || coat.is_some();
        let own =
            || Self { texture: texture.cloned(), opacity: opacity.cloned(), coat: coat.cloned(), chart };
        is_any.then(own)
    }

    /// Whether the factor varies with position.
    pub fn varies_with_position(&self) -> bool {
        self.texture.is_some() || self.opacity.is_some()
    }

    /// The factor at the given texture coordinates.
    #[inline]
    pub fn factor_at_uv(&self, uv: DVec2) -> Vec3 {
        self.lookup_texture_point(&TexturePoint::from_uv(uv))
    }

    #[inline]
    fn lookup_texture_point(&self, at: &TexturePoint) -> Vec3 {
        let color = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.lookup(at));
        match &self.opacity {
            Some(opacity) => color * opacity.evaluate(at, &mut 0),
            None => color,
        }
    }

    /// Number of texels per unit of u and v. If there is both a color texture and an opacity texture, returns
    /// the larger number.
    pub fn texels_per_uv_unit(&self) -> [f64; 2] {
        let of_opacity = self.opacity.as_ref().and_then(|opacity| opacity.value.texture());
        let across =
            [self.texture.as_ref(), of_opacity].map(|texture| texture.map(|one| one.texels_per_unit()));
        let finer = |[u, v]: [f64; 2], [own_u, own_v]: [f64; 2]| [u.max(own_u), v.max(own_v)];
        across.into_iter().flatten().reduce(finer).unwrap_or([1.0; 2])
    }

    /// The factor at a point on the light, for a ray in a given direction. `primitive` is the mesh triangle
    /// that contains the point.
    #[inline]
    pub fn radiance_factor(&self, point: Vec3, primitive: u32, direction: Vec3) -> Vec3 {
        self.radiance_factor_without_coat(point, primitive)
            * self.coat_transmittance(point, primitive, direction)
    }

    /// [`EmissionModulation::radiance_factor`] without the coat.
    pub fn radiance_factor_without_coat(&self, point: Vec3, primitive: u32) -> Vec3 {
        self.lookup_texture_point(&self.chart.texture_point(point.as_dvec3(), primitive))
    }

    /// The clear coat's transmittance for a ray in a given direction.
    pub fn coat_transmittance(&self, point: Vec3, primitive: u32, direction: Vec3) -> Vec3 {
        let Some(coat) = &self.coat else { return Vec3::ONE };
        let (point, direction) = (point.as_dvec3(), direction.as_dvec3());
        let at = self.chart.texture_point(point, primitive);
        // At a shape's edge, the probe ray may miss the shape because of rounding.
        let normal = self.chart.geometric_normal_at_point(point, primitive, direction);
        coat.transmittance(&at, normal.map_or(1.0, |normal| normal.dot(direction)) as f32, &mut 0)
    }
}

/// Length of the probe ray that finds the normal at a point, as a fraction of the light's size.
const PROBE: f64 = 1e-3;

impl UvMapping {
    /// The unit normal on the front side at a point, which may be viewed from either side. Returns `None` if
    /// the probe ray misses the surface.
    fn geometric_normal_at_point(&self, point: DVec3, primitive: u32, direction: DVec3) -> Option<DVec3> {
        match self {
            Self::Shape(shape) => {
                let size = f64::from(shape.bounds()?.extent().max_element());
                // Approach the point from the viewer's side.
                let ray =
                    RayF64 { origin: point - direction * (PROBE * size), direction, t_max: f64::INFINITY };
                let hit = shape.intersect(&ray)?;
                Some(shape.surface_point_at_hit(&ray, &hit).normal.as_dvec3())
            }
            Self::Triangles(patches) => {
                let index = patches.binary_search_by_key(&primitive, |patch| patch.primitive).ok()?;
                let [a, b, c] = patches[index].corners;
                (b - a).cross(c - a).try_normalize()
            }
        }
    }

    fn texture_point(&self, point: DVec3, primitive: u32) -> TexturePoint {
        let patches = match self {
            Self::Shape(shape) => return TexturePoint::from_uv(shape.uv_at_point(point)),
            Self::Triangles(patches) => patches,
        };
        let found = patches.binary_search_by_key(&primitive, |patch| patch.primitive);
        let Ok(TriangleWithUvs { corners, uvs, second_uvs, .. }) = found.map(|index| patches[index]) else {
            return TexturePoint::from_uv(DVec2::ZERO);
        };
        let weights = barycentric_weights_at_point(corners, point);
        let between = |uvs: [Vec2; 3]| {
            let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
            a + (b - a) * weights.x + (c - a) * weights.y
        };
        // Colors and scalars do not need tangents.
        let second = |uvs| {
            let (footprint, tangents) = (Footprint::POINT, [Vec3::ZERO; 2]);
            Box::new(SecondUvPoint { uv: between(uvs), footprint, tangents })
        };
        TexturePoint { second: second_uvs.map(second), ..TexturePoint::from_uv(between(uvs)) }
    }
}
