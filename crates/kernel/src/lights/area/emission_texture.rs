//! Emission textures: lamps whose radiance differs from point to point.
//!
//! Samples of a quad follow its texture; samples of other shapes do not. Each sample is multiplied by the texture at its
//! point. Pdfs are those of the emitter, and exact.

use std::sync::Arc;

use crate::geometry::Shape;
use crate::geometry::triangle::weights;
use crate::materials::TexturePoint;
use crate::materials::texture::Texture;
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Factor on the radiance of a lamp, from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionTexture {
    texture: Arc<Texture>,
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
    /// The emission texture of a lamp with these texture coordinates.
    pub fn new(texture: &Arc<Texture>, chart: Chart) -> Self {
        Self { texture: Arc::clone(texture), chart }
    }

    /// Texture that it looks up.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// Factor at a point of the lamp; `primitive` is the triangle of the mesh that contains the point.
    #[inline]
    pub fn at(&self, point: Vec3, primitive: u32) -> Vec3 {
        self.texture.lookup(&TexturePoint::sharp(self.chart.uv(point.as_dvec3(), primitive)))
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
