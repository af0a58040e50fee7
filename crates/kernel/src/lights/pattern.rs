//! Lamps that do not send the same radiance from everywhere.
//!
//! Samples of a quad follow its texture, those of other shapes are taken as if they did; each counts the texture at its point:
//! densities are those of the emitter, and exact.

use std::sync::Arc;

use crate::geometry::Shape;
use crate::geometry::triangle::weights;
use crate::materials::TexturePoint;
use crate::materials::texture::Texture;
use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// What the radiance of a lamp is multiplied by, from point to point.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    texture: Arc<Texture>,
    chart: Chart,
}

/// How the points of a lamp find their texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Chart {
    /// As the shape has them.
    Shape(Shape),
    /// By the triangles of a mesh, in the order of their numbers.
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

impl Pattern {
    /// Of a texture, on a lamp with these texture coordinates.
    pub fn new(texture: &Arc<Texture>, chart: Chart) -> Self {
        Self { texture: Arc::clone(texture), chart }
    }

    /// What is looked up.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// At a point of the lamp; `primitive` is the triangle of a mesh that it is on.
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
