//! Emission textures: lamps whose radiance differs from point to point, by a texture or by their opacity, or by direction under a
//! clear coat.
//!
//! Samples of a quad follow its texture; samples of other shapes do not. Each sample is multiplied by the texture at its
//! point. Pdfs are those of the emitter, and exact.

use std::sync::Arc;

use crate::geometry::triangle::weights;
use crate::geometry::{RayF64, Shape};
use crate::materials::texture::Texture;
use crate::materials::{EmissionCoat, Footprint, Opacity, SecondPoint, TexturePoint};
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Factor on the radiance of a lamp, from point to point and from direction to direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionTexture {
    texture: Option<Arc<Texture>>,
    opacity: Option<Opacity>,
    coat: Option<Arc<EmissionCoat>>,
    chart: Chart,
}

/// Map from the points of a lamp to their texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Chart {
    /// The shape's own texture coordinates.
    Shape(Shape),
    /// Texture coordinates of the triangles of a mesh, in the order of their numbers.
    Triangles(Vec<Patch>),
}

/// A triangle of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Its number in its object.
    pub primitive: u32,
    /// Corners in world coordinates.
    pub corners: [DVec3; 3],
    /// Their texture coordinates.
    pub uvs: [Vec2; 3],
    /// Their second set of these. `None` if the mesh has none.
    pub second_uvs: Option<[Vec2; 3]>,
}

impl EmissionTexture {
    /// The factor by a texture and by the opacity of a lamp with these texture coordinates. `None` if there is neither.
    pub fn new(texture: Option<&Arc<Texture>>, opacity: Option<&Opacity>, chart: Chart) -> Option<Self> {
        Self::under_coat(texture, opacity, None, chart)
    }

    /// [`EmissionTexture::new`] under a clear coat.
    pub fn under_coat(
        texture: Option<&Arc<Texture>>,
        opacity: Option<&Opacity>,
        coat: Option<&Arc<EmissionCoat>>,
        chart: Chart,
    ) -> Option<Self> {
        let is_any = texture.is_some() || opacity.is_some() || coat.is_some();
        let own =
            || Self { texture: texture.cloned(), opacity: opacity.cloned(), coat: coat.cloned(), chart };
        is_any.then(own)
    }

    /// Whether the factor differs from point to point, in every direction.
    pub fn has_places(&self) -> bool {
        self.texture.is_some() || self.opacity.is_some()
    }

    /// Factor at texture coordinates.
    #[inline]
    pub fn lookup(&self, uv: DVec2) -> Vec3 {
        self.lookup_at(&TexturePoint::sharp(uv))
    }

    #[inline]
    fn lookup_at(&self, at: &TexturePoint) -> Vec3 {
        let color = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.lookup(at));
        match &self.opacity {
            Some(opacity) => color * opacity.at(at, &mut 0),
            None => color,
        }
    }

    /// Number of texels in a unit of u and of v; of two textures, the greater ones.
    pub fn texels_across(&self) -> [f64; 2] {
        let of_opacity = self.opacity.as_ref().and_then(|opacity| opacity.value.texture());
        let across =
            [self.texture.as_ref(), of_opacity].map(|texture| texture.map(|one| one.texels_across()));
        let finer = |[u, v]: [f64; 2], [own_u, own_v]: [f64; 2]| [u.max(own_u), v.max(own_v)];
        across.into_iter().flatten().reduce(finer).unwrap_or([1.0; 2])
    }

    /// Factor at a point of the lamp, for light along a direction; `primitive` is the triangle of the mesh that contains the point.
    #[inline]
    pub fn at(&self, point: Vec3, primitive: u32, direction: Vec3) -> Vec3 {
        self.at_place(point, primitive) * self.left_by_coat(point, primitive, direction)
    }

    /// [`EmissionTexture::at`], without the coat.
    pub fn at_place(&self, point: Vec3, primitive: u32) -> Vec3 {
        self.lookup_at(&self.chart.texture_point(point.as_dvec3(), primitive))
    }

    /// Part of the light along a direction that the clear coat lets through.
    pub fn left_by_coat(&self, point: Vec3, primitive: u32, direction: Vec3) -> f32 {
        let Some(coat) = &self.coat else { return 1.0 };
        let (point, direction) = (point.as_dvec3(), direction.as_dvec3());
        let at = self.chart.texture_point(point, primitive);
        // At a rim, rounding may leave no normal.
        let normal = self.chart.normal(point, primitive, direction);
        coat.left(&at, normal.map_or(1.0, |normal| normal.dot(direction)) as f32, &mut 0)
    }
}

/// Length of the ray that finds the normal at a point, in sizes of the lamp.
const PROBE: f64 = 1e-3;

impl Chart {
    /// The unit normal at a point that is seen along a direction, either way. `None` if nothing is there.
    fn normal(&self, point: DVec3, primitive: u32, direction: DVec3) -> Option<DVec3> {
        match self {
            Self::Shape(shape) => {
                let size = f64::from(shape.bounds()?.extent().max_element());
                // Approach the point on the side from which it is seen.
                let ray =
                    RayF64 { origin: point - direction * (PROBE * size), direction, t_max: f64::INFINITY };
                let hit = shape.intersect(&ray)?;
                Some(shape.surface(&ray, &hit).normal.as_dvec3())
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
            Self::Shape(shape) => return TexturePoint::sharp(shape.uv_at(point)),
            Self::Triangles(patches) => patches,
        };
        let found = patches.binary_search_by_key(&primitive, |patch| patch.primitive);
        let Ok(Patch { corners, uvs, second_uvs, .. }) = found.map(|index| patches[index]) else {
            return TexturePoint::sharp(DVec2::ZERO);
        };
        let weights = weights(corners, point);
        let between = |uvs: [Vec2; 3]| {
            let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
            a + (b - a) * weights.x + (c - a) * weights.y
        };
        // Colours and numbers have no tangents.
        let second = |uvs| {
            let (footprint, tangents) = (Footprint::POINT, [Vec3::ZERO; 2]);
            Box::new(SecondPoint { uv: between(uvs), footprint, tangents })
        };
        TexturePoint { second: second_uvs.map(second), ..TexturePoint::sharp(between(uvs)) }
    }
}
