//! Reliefs: what bends the shading normals of a surface without changing its shape.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::normal_map::NormalMap;
use super::texture::Texture;
use crate::math::Vec3;

/// A normal map, a texture of heights, or both.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// The normals.
    pub normal_map: Option<NormalMap>,
    /// The heights over the surface with those normals.
    pub bump: Option<Bump>,
}

impl Relief {
    /// The relief of these. `None` if there is neither.
    pub fn new(normal_map: Option<NormalMap>, bump: Option<Bump>) -> Option<Self> {
        (normal_map.is_some() || bump.is_some()).then_some(Self { normal_map, bump })
    }

    /// The bent shading normal, on the same side as `normal`; `dpdu` and `dpdv` are the changes of the point with the texture
    /// coordinates. Adds to `lookups`.
    #[inline]
    pub fn bend(&self, at: &TexturePoint, normal: Vec3, [dpdu, dpdv]: [Vec3; 2], lookups: &mut u64) -> Vec3 {
        let mut bent = normal;
        if let Some(map) = &self.normal_map {
            *lookups += 1;
            bent = map.bend(at, normal, dpdu, dpdv);
        }
        if let Some(bump) = &self.bump {
            *lookups += Bump::LOOKUPS;
            bent = bump.bend(at, normal, bent, [dpdu, dpdv]);
        }
        bent
    }

    /// Its textures.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let of_normals = self.normal_map.as_ref().map(|map| &map.texture);
        of_normals.into_iter().chain(self.bump.as_ref().map(|bump| &bump.texture))
    }
}

/// A texture of heights, in the red channel (Blinn, *Simulation of Wrinkled Surfaces*, SIGGRAPH 1978).
#[derive(Clone, Debug, PartialEq)]
pub struct Bump {
    /// The heights.
    pub texture: Arc<Texture>,
    /// Factor on the heights: the length of a height of 1. Below 0, what stood out is sunk.
    pub scale: f32,
}

impl Bump {
    /// Number of look-ups for one normal.
    const LOOKUPS: u64 = 4;

    /// The normal `bent`, bent further by the slopes of the heights above the surface of the normal `normal`. Where the tangents
    /// say nothing about the slopes it stays.
    ///
    /// The surface gradient ∇h is that of Mikkelsen (*Surface Gradient-Based Bump Mapping Framework*, JCGT 2020, section 2):
    /// ∇h = (h_u (p_v × n) + h_v (n × p_u)) / (n · (p_u × p_v)). The slopes of both are added: with the normal m of a normal map, the
    /// bent normal is along m / (m · n) − ∇h.
    fn bend(&self, at: &TexturePoint, normal: Vec3, bent: Vec3, tangents: [Vec3; 2]) -> Vec3 {
        let [dpdu, dpdv] = self.texture.tangents(at, tangents);
        let slopes = self.texture.slopes(at) * self.scale;
        let volume = normal.dot(dpdu.cross(dpdv));
        let gradient = (dpdv.cross(normal) * slopes.x + normal.cross(dpdu) * slopes.y) / volume;
        (bent - gradient * bent.dot(normal)).try_normalize().unwrap_or(bent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::texels::{TexelData, Texels};
    use crate::materials::texture::{TextureFilter, Wrap};
    use crate::math::{DVec2, Vec2};

    /// A texture of one row of these numbers.
    fn texture(numbers: &[Vec3]) -> Arc<Texture> {
        let data = TexelData::Float(numbers.to_vec());
        let texels = Arc::new(Texels { width: numbers.len() as u32, height: 1, data, unusable: 0 });
        let (filter, wrap) = (TextureFilter::Bilinear, Wrap::Repeat);
        Arc::new(Texture {
            texels,
            filter,
            wrap,
            repeat: Vec2::ONE,
            mipmaps: None,
            moved: None,
            factor: None,
        })
    }

    /// Heights that rise by 1 in a unit of u around the middle.
    fn ramp(scale: f32) -> Bump {
        Bump { texture: texture(&[0.0, 0.25, 0.5, 0.75].map(Vec3::splat)), scale }
    }

    fn bent(relief: &Relief, normal: Vec3, tangents: [Vec3; 2]) -> (Vec3, u64) {
        let mut lookups = 0;
        let at = TexturePoint::sharp(DVec2::new(0.5, 0.3));
        (relief.bend(&at, normal, tangents, &mut lookups), lookups)
    }

    #[test]
    fn a_ramp_tilts_by_its_slope_over_the_length_of_the_tangent() {
        // (tangents, normal, scale, bent normal without its length)
        let cases = [
            ([Vec3::X, Vec3::Y], Vec3::Z, 0.5, Vec3::new(-0.5, 0.0, 1.0)),
            ([Vec3::X * 2.0, Vec3::Y], Vec3::Z, 0.5, Vec3::new(-0.25, 0.0, 1.0)),
            ([Vec3::X, Vec3::NEG_Y], Vec3::Z, 0.5, Vec3::new(-0.5, 0.0, 1.0)),
            ([Vec3::X, Vec3::Y], Vec3::NEG_Z, 0.5, Vec3::new(-0.5, 0.0, -1.0)),
            ([Vec3::X, Vec3::Y], Vec3::Z, -0.5, Vec3::new(0.5, 0.0, 1.0)),
            // Along u + v, u does not change: the height is x − y.
            ([Vec3::X, Vec3::new(1.0, 1.0, 0.0)], Vec3::Z, 1.0, Vec3::new(-1.0, 1.0, 1.0)),
            // The shading normal may lean: its tangents are those of the surface without what goes along it.
            ([Vec3::new(1.0, 0.0, 0.7), Vec3::Y], Vec3::Z, 1.0, Vec3::new(-1.0, 0.0, 1.0)),
        ];
        for (tangents, normal, scale, expected) in cases {
            let relief = Relief { normal_map: None, bump: Some(ramp(scale)) };
            let (bent, lookups) = bent(&relief, normal, tangents);
            assert!((bent - expected.normalize()).length() < 1e-6, "{tangents:?} {normal}: {bent}");
            assert_eq!(lookups, 4);
        }
    }

    #[test]
    fn slopes_of_both_add_up() {
        let map = NormalMap { texture: texture(&[Vec3::new(0.8, 0.5, 0.9)]), strength: 1.0 };
        let relief = Relief { normal_map: Some(map), bump: Some(ramp(0.5)) };
        let (bent, lookups) = bent(&relief, Vec3::Z, [Vec3::X, Vec3::Y]);
        // 0.6/0.8 from the map, −0.5 from the ramp.
        assert!((bent - Vec3::new(0.25, 0.0, 1.0).normalize()).length() < 1e-6, "{bent}");
        assert_eq!(lookups, 5);
    }

    #[test]
    fn where_tangents_say_nothing_the_normal_stays() {
        let relief = Relief { normal_map: None, bump: Some(ramp(1.0)) };
        for tangents in [[Vec3::ZERO; 2], [Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::Y], [Vec3::X, Vec3::Z]]
        {
            assert_eq!(bent(&relief, Vec3::Z, tangents).0, Vec3::Z, "{tangents:?}");
        }
    }
}
