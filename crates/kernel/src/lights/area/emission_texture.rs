//! Emission textures: lamps whose radiance differs from point to point, by a texture or by their opacity.
//!
//! Samples of a quad follow its texture; samples of other shapes do not. Each sample is multiplied by the texture at its
//! point. Pdfs are those of the emitter, and exact.

use std::sync::Arc;

use crate::geometry::Shape;
use crate::geometry::triangle::weights;
use crate::materials::texture::Texture;
use crate::materials::{Opacity, TexturePoint};
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Factor on the radiance of a lamp, from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionTexture {
    texture: Option<Arc<Texture>>,
    opacity: Option<Opacity>,
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
}

impl EmissionTexture {
    /// The factor by a texture and by the opacity of a lamp with these texture coordinates. `None` if there is neither.
    pub fn new(texture: Option<&Arc<Texture>>, opacity: Option<&Opacity>, chart: Chart) -> Option<Self> {
        let is_any = texture.is_some() || opacity.is_some();
        is_any.then(|| Self { texture: texture.cloned(), opacity: opacity.cloned(), chart })
    }

    /// Factor at texture coordinates.
    #[inline]
    pub fn lookup(&self, uv: DVec2) -> Vec3 {
        let at = TexturePoint::sharp(uv);
        let color = self.texture.as_ref().map_or(Vec3::ONE, |texture| texture.lookup(&at));
        match &self.opacity {
            Some(opacity) => color * opacity.at(&at, &mut 0),
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

    /// Factor at a point of the lamp; `primitive` is the triangle of the mesh that contains the point.
    #[inline]
    pub fn at(&self, point: Vec3, primitive: u32) -> Vec3 {
        self.lookup(self.chart.uv(point.as_dvec3(), primitive))
    }
}

impl Chart {
    fn uv(&self, point: DVec3, primitive: u32) -> DVec2 {
        let patches = match self {
            Self::Shape(shape) => return shape.uv_at(point),
            Self::Triangles(patches) => patches,
        };
        let found = patches.binary_search_by_key(&primitive, |patch| patch.primitive);
        let Ok(Patch { corners, uvs, .. }) = found.map(|index| patches[index]) else { return DVec2::ZERO };
        let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
        let weights = weights(corners, point);
        a + (b - a) * weights.x + (c - a) * weights.y
    }
}
