//! Footprints: the areas of a texture that single lookups cover.

use crate::math::frame::Frame;
use crate::math::transform::Transform;
use crate::math::{DMat3, DVec2, DVec3, Vec2, Vec3};

/// One of a mesh's UV sets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum UvSet {
    /// The first set. Analytic shapes have only this set.
    #[default]
    First,
    /// The second set, or the first set if the mesh has only one.
    Second,
}

/// A point in texture space, and the footprint of the lookup there.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturePoint {
    /// Texture coordinates.
    pub uv: DVec2,
    /// Footprint around `uv`. Ignored by filters without mip levels.
    pub footprint: Footprint,
    /// The point in coordinates that few textures use, or `None` if the object has none of them or no texture
    /// uses them. Boxed to keep this struct small.
    pub extra: Option<Box<ExtraCoordinates>>,
}

/// A surface point in coordinates that few textures use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtraCoordinates {
    /// The point in the second UV set, if the object has one and a texture uses it.
    pub second: Option<SecondUvPoint>,
    /// The point in the shape's own coordinates, if a texture of the object uses them.
    pub object: Option<ObjectPoint>,
}

/// A surface point in the shape's own coordinates, before its matrix and the transforms of groups.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectPoint {
    /// The point, in scene units.
    pub position: DVec3,
    /// Length of the footprint's longer axis, or 0 for a point.
    pub width: f32,
    /// Linear map from world vectors to vectors in the shape's own coordinates.
    pub from_world: DMat3,
}

impl ObjectPoint {
    /// A point without a footprint. `frame` maps the shape's own coordinates to world coordinates.
    pub fn new(frame: &Transform, point: DVec3) -> Self {
        Self { position: frame.inverse_point(point), width: 0.0, from_world: frame.inverse_linear }
    }

    /// Sets the footprint on a surface with this normal. `footprint` returns the footprint in the coordinates
    /// of any tangents.
    #[must_use]
    pub fn with_footprint(self, normal: Vec3, footprint: impl Fn([Vec3; 2]) -> Footprint) -> Self {
        let frame = Frame::from_normal(normal);
        let axes = footprint([frame.s, frame.t]).axes();
        let length = |axis: Vec2| {
            let along = (frame.s * axis.x + frame.t * axis.y).as_dvec3();
            (self.from_world * along).length() as f32
        };
        Self { width: length(axes[0]).max(length(axes[1])), ..self }
    }
}

/// A point in the second UV set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondUvPoint {
    /// Texture coordinates.
    pub uv: DVec2,
    /// Footprint around `uv`.
    pub footprint: Footprint,
    /// ∂p/∂u and ∂p/∂v.
    pub tangents: [Vec3; 2],
}

impl TexturePoint {
    /// A point without a footprint.
    pub fn from_uv(uv: DVec2) -> Self {
        Self { uv, footprint: Footprint::POINT, extra: None }
    }

    /// The same point without its footprint.
    pub fn without_footprint(&self) -> Self {
        let sharp = |extra: &ExtraCoordinates| {
            let second = extra.second.map(|second| SecondUvPoint { footprint: Footprint::POINT, ..second });
            let object = extra.object.map(|object| ObjectPoint { width: 0.0, ..object });
            Box::new(ExtraCoordinates { second, object })
        };
        Self { uv: self.uv, footprint: Footprint::POINT, extra: self.extra.as_deref().map(sharp) }
    }

    /// The point in the second UV set, if it is known.
    #[inline]
    pub fn second_uv_point(&self) -> Option<&SecondUvPoint> {
        self.extra.as_ref()?.second.as_ref()
    }

    /// The point in the shape's own coordinates, if it is known.
    #[inline]
    pub fn object_point(&self) -> Option<&ObjectPoint> {
        self.extra.as_ref()?.object.as_ref()
    }
}

/// An ellipse in texture space, defined by its axes. Both axes are 0 for a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    axes: [Vec2; 2],
}

impl Footprint {
    /// The footprint of a point.
    pub const POINT: Self = Self { axes: [Vec2::ZERO; 2] };

    /// Footprint of a ray cone on a surface, where `width` is the cone's width and `direction` a unit vector
    /// (Akenine-Möller, Crassin, Boksansky, Belcour, Panteleev, Wright, *Improved Shader and Texture Level of
    /// Detail Using Ray Cones*, JCGT 2021, section 5). The ellipse is as wide as the cone perpendicular to
    /// the direction. Along the direction, it is longer by a factor of 1 / cosine. `tangents` are ∂p/∂u and
    /// ∂p/∂v. If they are parallel or 0, the footprint is a point.
    #[inline]
    pub fn from_ray_cone(width: f32, direction: Vec3, normal: Vec3, tangents: [Vec3; 2]) -> Self {
        let cosine = normal.dot(direction);
        let along =
            (direction - normal * cosine).try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        let across = normal.cross(along);
        let [u, v] = tangents;
        let (uu, uv, vv) = (u.length_squared(), u.dot(v), v.length_squared());
        let determinant = uu * vv - uv * uv;
        let coordinates = |vector: Vec3| {
            let (by_u, by_v) = (vector.dot(u), vector.dot(v));
            Vec2::new(vv * by_u - uv * by_v, uu * by_v - uv * by_u) / determinant
        };
        let long = width / cosine.abs().max(Self::MIN_COSINE);
        let axes = [coordinates(along * long), coordinates(across * width)];
        if axes.iter().all(|axis| axis.is_finite()) { Self { axes } } else { Self::POINT }
    }

    /// Minimum cosine, which limits the size of footprints.
    const MIN_COSINE: f32 = 1e-4;

    /// The axes of the ellipse, in texture coordinates.
    #[inline]
    pub fn axes(&self) -> [Vec2; 2] {
        self.axes
    }

    /// Length of the longer axis in texels. `per_unit` is the number of texels per unit of u and v.
    pub fn major_axis_texels(&self, per_unit: Vec2) -> f32 {
        self.transformed_major_axis_length(|axis| axis * per_unit)
    }

    /// Length of the longer axis after applying a linear map.
    #[inline]
    pub fn transformed_major_axis_length(&self, map: impl Fn(Vec2) -> Vec2) -> f32 {
        let lengths = self.axes.map(|axis| map(axis).length());
        lengths[0].max(lengths[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprints_stretch_along_the_direction() {
        let tangents = [Vec3::X * 2.0, Vec3::Y * 4.0];
        let straight = Footprint::from_ray_cone(0.5, Vec3::NEG_Z, Vec3::Z, tangents);
        // A length of 0.5 spans a quarter of u and an eighth of v.
        assert!((straight.major_axis_texels(Vec2::new(100.0, 0.0)) - 25.0).abs() < 1e-4);
        assert!((straight.major_axis_texels(Vec2::new(0.0, 100.0)) - 12.5).abs() < 1e-4);
        let steep = Footprint::from_ray_cone(0.5, Vec3::new(0.0, 0.8, -0.6), Vec3::Z, tangents);
        assert!((steep.major_axis_texels(Vec2::new(0.0, 60.0)) - 12.5).abs() < 1e-4);
        assert!((steep.major_axis_texels(Vec2::new(100.0, 0.0)) - 25.0).abs() < 1e-4);
    }

    #[test]
    fn oblique_tangents_are_separated() {
        let tangents = [Vec3::X, Vec3::new(1.0, 1.0, 0.0)];
        let seen = Footprint::from_ray_cone(1.0, Vec3::new(0.6, 0.0, -0.8), Vec3::Z, tangents);
        // Along x, only u changes, by 1/0.8. Along y, v increases by one and u decreases by one.
        assert!((seen.major_axis_texels(Vec2::X) - 1.25).abs() < 1e-6);
        assert!((seen.major_axis_texels(Vec2::Y) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn object_footprints_scale_with_the_shape() {
        // The shape is stretched by 4 along x, so the footprint is shorter there in its own coordinates.
        let frame = Transform::scale_rotate_translate(
            DVec3::new(4.0, 2.0, 1.0),
            DVec3::ZERO,
            DVec3::new(1.0, 0.0, 5.0),
        );
        let point = ObjectPoint::new(&frame, DVec3::new(3.0, 1.0, 6.0));
        assert_eq!((point.position, point.width), (DVec3::new(0.5, 0.5, 1.0), 0.0));
        let seen = |direction: Vec3| {
            let footprint = |tangents| Footprint::from_ray_cone(0.5, direction, Vec3::Z, tangents);
            point.with_footprint(Vec3::Z, footprint).width
        };
        assert!((seen(Vec3::NEG_Z) - 0.25).abs() < 1e-6);
        // The longer axis is 0.5 / 0.6 along y, or along x.
        assert!((seen(Vec3::new(0.0, 0.8, -0.6)) - 0.5 / 0.6 / 2.0).abs() < 1e-6);
        assert!((seen(Vec3::new(0.8, 0.0, -0.6)) - 0.25).abs() < 1e-6);
    }

    #[test]
    fn degenerate_tangents_give_a_point() {
        for tangents in [[Vec3::ZERO; 2], [Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::X]] {
            assert_eq!(Footprint::from_ray_cone(1.0, Vec3::NEG_Z, Vec3::Z, tangents), Footprint::POINT);
        }
    }
}
