//! Footprints: the areas of a texture that single lookups cover.

use crate::math::{DVec2, Vec2, Vec3};

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
    /// The point in the second UV set, or `None` if the object has no second set or no texture uses it. Boxed
    /// to keep this struct small.
    pub second: Option<Box<SecondUvPoint>>,
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
        Self { uv, footprint: Footprint::POINT, second: None }
    }

    /// The same point without its footprint.
    pub fn without_footprint(&self) -> Self {
        let sharp =
            |second: &SecondUvPoint| Box::new(SecondUvPoint { footprint: Footprint::POINT, ..*second });
        Self { uv: self.uv, footprint: Footprint::POINT, second: self.second.as_deref().map(sharp) }
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
    fn degenerate_tangents_give_a_point() {
        for tangents in [[Vec3::ZERO; 2], [Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::X]] {
            assert_eq!(Footprint::from_ray_cone(1.0, Vec3::NEG_Z, Vec3::Z, tangents), Footprint::POINT);
        }
    }
}
