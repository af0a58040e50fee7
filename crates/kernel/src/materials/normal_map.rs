//! Tangent-space normal maps.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::math::Vec3;
use crate::math::frame::Frame;

/// A tangent-space normal map. Its linear values encode a normal n as (n + 1)/2, with z pointing away from
/// the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    /// The normals.
    pub texture: Arc<Texture>,
    /// Factor applied to the slopes. A factor of 0 makes the surface flat.
    pub strength: f32,
}

impl NormalMap {
    /// The perturbed shading normal, on the same side as `normal`. The tangents do not have to be unit
    /// vectors or perpendicular. If they are 0, an arbitrary frame is used.
    #[inline]
    pub fn perturb(&self, at: &TexturePoint, normal: Vec3, dpdu: Vec3, dpdv: Vec3) -> Vec3 {
        // Scenes use only images as normal maps.
        let Texture::Image(image) = &*self.texture else { return normal };
        let mapped = image.lookup(at) * 2.0 - Vec3::ONE;
        let slope = image.flip_slopes_in_mirrored_tiles(at, mapped.truncate() * self.strength);
        let mapping = &image.mapping;
        let [dpdu, dpdv] = mapping.transformed_tangents(mapping.untransformed_tangents(at, [dpdu, dpdv]));
        let (tangent, bitangent) = orthogonalize_tangents(normal, dpdu, dpdv);
        let bent = tangent * slope.x + bitangent * slope.y + normal * mapped.z.abs();
        bent.try_normalize().unwrap_or(normal)
    }
}

/// Unit tangents along u and v, perpendicular to the normal. Mirrored parameterizations keep their
/// handedness.
fn orthogonalize_tangents(normal: Vec3, dpdu: Vec3, dpdv: Vec3) -> (Vec3, Vec3) {
    let Some(tangent) = (dpdu - normal * normal.dot(dpdu)).try_normalize() else {
        let frame = Frame::from_normal(normal);
        return (frame.s, frame.t);
    };
    let bitangent = normal.cross(tangent);
    let sense = if bitangent.dot(dpdv) < 0.0 { -1.0 } else { 1.0 };
    (tangent, bitangent * sense)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::footprint::UvSet;
    use crate::materials::texels::{TexelData, Texels};
    use crate::materials::texture::{ImageTexture, TextureFilter, TextureMapping, UvTransform, Wrap};
    use crate::math::{DVec2, Vec2};

    fn middle() -> TexturePoint {
        TexturePoint::from_uv(DVec2::ZERO)
    }

    fn map(normal: Vec3) -> NormalMap {
        let data = TexelData::Float(vec![(normal + Vec3::ONE) * 0.5]);
        let texels = Arc::new(Texels { width: 1, height: 1, data, unusable: 0 });
        let image = ImageTexture {
            texels,
            filter: TextureFilter::Nearest,
            wrap: Wrap::Repeat,
            mapping: TextureMapping::IDENTITY,
            mipmaps: None,
            factor: None,
        };
        NormalMap { texture: Arc::new(Texture::Image(image)), strength: 1.0 }
    }

    fn image_mut(map: &mut NormalMap) -> &mut ImageTexture {
        let Texture::Image(image) = Arc::make_mut(&mut map.texture) else { panic!("an image") };
        image
    }

    #[test]
    fn slopes_rotate_with_the_texture() {
        let mut turned = map(Vec3::new(0.6, 0.0, 0.8));
        let mapping = &mut image_mut(&mut turned).mapping;
        mapping.moved = UvTransform::new(UvSet::First, 90.0, DVec2::ZERO).map(Box::new);
        // The texture's first coordinate equals −v.
        let bent = turned.perturb(&middle(), Vec3::Z, Vec3::X, Vec3::Y);
        assert!((bent - Vec3::new(0.0, -0.6, 0.8)).length() < 1e-6, "{bent}");
        // Rotate, stretch, and skew the coordinates. The texture coordinates are u' = 2 u cos + 3 v sin and
        // v' = 3 v cos − 2 u sin with an angle of −30°. The tangent along u' is the direction in which v' is
        // constant.
        let mut turned = map(Vec3::new(0.6, 0.0, 0.8));
        let mapping = &mut image_mut(&mut turned).mapping;
        (mapping.moved, mapping.repeat) =
            (UvTransform::new(UvSet::First, -30.0, DVec2::ZERO).map(Box::new), Vec2::new(2.0, 3.0));
        let (dpdu, dpdv) = (Vec3::new(2.0, 0.5, 0.0), Vec3::new(-0.3, 0.7, 0.0));
        let (sine, cosine) = 30.0_f32.to_radians().sin_cos();
        // A step with 2 u = cos and 3 v = sin changes u' by 1.
        let along = dpdu * (cosine / 2.0) + dpdv * (sine / 3.0);
        let bent = turned.perturb(&middle(), Vec3::Z, dpdu, dpdv);
        let expected = along.normalize() * 0.6 + Vec3::Z * 0.8;
        assert!((bent - expected).length() < 1e-6, "{bent} instead of {expected}");
    }

    #[test]
    fn slopes_are_mirrored_with_the_texture() {
        let leaning = Vec3::new(0.48, 0.36, 0.8);
        // (repeat, wrap, texture coordinates, signs of the slopes)
        let cases = [
            (Vec2::new(1.0, 1.0), Wrap::Repeat, DVec2::new(1.5, 2.5), [1.0, 1.0]),
            (Vec2::new(-1.0, 1.0), Wrap::Repeat, DVec2::new(0.5, 0.5), [-1.0, 1.0]),
            (Vec2::new(2.0, -3.0), Wrap::Clamp, DVec2::new(0.5, 0.5), [1.0, -1.0]),
            (Vec2::new(1.0, 1.0), Wrap::Mirror, DVec2::new(0.5, 0.5), [1.0, 1.0]),
            (Vec2::new(1.0, 1.0), Wrap::Mirror, DVec2::new(1.5, -0.5), [-1.0, -1.0]),
            (Vec2::new(-1.0, 4.0), Wrap::Mirror, DVec2::new(0.5, 0.4), [1.0, -1.0]),
            (Vec2::new(1.0, 1.0), Wrap::Mirror, DVec2::new(f64::NAN, 2.5), [1.0, 1.0]),
        ];
        for (repeat, wrap, uv, sides) in cases {
            let mut map = map(leaning);
            let image = image_mut(&mut map);
            (image.mapping.repeat, image.wrap) = (repeat, wrap);
            let bent = map.perturb(&TexturePoint::from_uv(uv), Vec3::Z, Vec3::X, Vec3::Y);
            let expected = Vec3::new(0.48 * sides[0], 0.36 * sides[1], 0.8);
            assert!((bent - expected).length() < 1e-6, "{repeat} {wrap:?} {uv}: {bent}");
        }
    }

    #[test]
    fn normal_map_tilts_follow_the_tangents() {
        let n = Vec3::Z;
        assert_eq!(map(Vec3::Z).perturb(&middle(), n, Vec3::X, Vec3::Y), n);
        let tilted = map(Vec3::new(0.6, 0.0, 0.8));
        let bent = tilted.perturb(&middle(), n, Vec3::new(0.0, 3.0, 1.0), Vec3::new(-2.0, 0.0, 0.0));
        assert!((bent - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6);
        // A mirrored parameterization perturbs the normal in the opposite direction along v.
        let along_v = map(Vec3::new(0.0, 0.6, 0.8));
        let bent = along_v.perturb(&middle(), n, Vec3::X, Vec3::NEG_Y);
        assert!((bent - Vec3::new(0.0, -0.6, 0.8)).length() < 1e-6);
    }

    #[test]
    fn missing_tangents_give_a_valid_normal() {
        let bent = map(Vec3::new(0.6, 0.0, -0.8)).perturb(&middle(), Vec3::Y, Vec3::ZERO, Vec3::ZERO);
        assert!((bent.length() - 1.0).abs() < 1e-6 && bent.y > 0.0);
    }
}
