//! Perturbs shading normals with normal maps and bump maps. The shape itself does not change.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::normal_map::NormalMap;
use super::texture::{HeightGradient, Texture};
use crate::math::Vec3;

/// A normal map, a bump map, or both.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalPerturbation {
    /// The normals.
    pub normal_map: Option<NormalMap>,
    /// Heights above the surface. They are added to the relief from the normal map.
    pub bump: Option<Bump>,
}

impl NormalPerturbation {
    /// Combines a normal map and a bump map. Returns `None` if there is neither.
    pub fn new(normal_map: Option<NormalMap>, bump: Option<Bump>) -> Option<Self> {
        (normal_map.is_some() || bump.is_some()).then_some(Self { normal_map, bump })
    }

    /// The perturbed shading normal. `dpdu` and `dpdv` are ∂p/∂u and ∂p/∂v. Counts texture lookups in
    /// `lookups`.
    #[inline]
    pub fn perturb(
        &self,
        at: &TexturePoint,
        normal: Vec3,
        [dpdu, dpdv]: [Vec3; 2],
        lookups: &mut u64,
    ) -> Vec3 {
        let mut bent = normal;
        if let Some(map) = &self.normal_map {
            *lookups += 1;
            bent = map.perturb(at, normal, dpdu, dpdv);
        }
        if let Some(bump) = &self.bump {
            *lookups += Bump::LOOKUPS;
            bent = bump.perturb(at, normal, bent, [dpdu, dpdv]);
        }
        bent
    }

    /// The texture of each map that is present.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let of_normals = self.normal_map.as_ref().map(|map| &map.texture);
        of_normals.into_iter().chain(self.bump.as_ref().map(|bump| &bump.texture))
    }
}

/// A bump map, with heights in the red channel of a texture (Blinn, *Simulation of Wrinkled Surfaces*,
/// SIGGRAPH 1978).
#[derive(Clone, Debug, PartialEq)]
pub struct Bump {
    /// The heights.
    pub texture: Arc<Texture>,
    /// Length that a height of 1 represents. Negative values invert the relief.
    pub scale: f32,
}

impl Bump {
    /// Number of texture lookups per perturbed normal.
    const LOOKUPS: u64 = 4;

    /// Perturbs the normal `bent` by the slopes of the bump map. `normal` is the surface normal. Returns
    /// `bent` unchanged if the tangents are degenerate.
    ///
    /// The surface gradient is ∇h = (h_u (p_v × n) + h_v (n × p_u)) / (n · (p_u × p_v)) (Mikkelsen, *Surface
    /// Gradient-Based Bump Mapping Framework*, JCGT 2020, section 2). Slopes of a normal map and a bump map
    /// add up: if m is the normal from the normal map, the perturbed normal has the direction m / (m · n) −
    /// ∇h.
    fn perturb(&self, at: &TexturePoint, normal: Vec3, bent: Vec3, tangents: [Vec3; 2]) -> Vec3 {
        let gradient = match self.texture.slopes(at) {
            HeightGradient::AlongUv(slopes) => {
                let [dpdu, dpdv] = self.texture.untransformed_tangents(at, tangents);
                let slopes = slopes * self.scale;
                let volume = normal.dot(dpdu.cross(dpdv));
                (dpdv.cross(normal) * slopes.x + normal.cross(dpdu) * slopes.y) / volume
            }
            HeightGradient::World(gradient) => (gradient - normal * gradient.dot(normal)) * self.scale,
        };
        (bent - gradient * bent.dot(normal)).try_normalize().unwrap_or(bent)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::materials::texels::{TexelData, Texels};
    use crate::materials::texture::{ImageTexture, TextureFilter, TextureMapping, Wrap};
    use crate::math::DVec2;

    /// A texture with a single row of values.
    fn texture(numbers: &[Vec3]) -> Arc<Texture> {
        let data = TexelData::Float(numbers.to_vec());
        let texels = Arc::new(Texels { width: numbers.len() as u32, height: 1, data, unusable: 0 });
        let (filter, wrap) = (TextureFilter::Bilinear, Wrap::Repeat);
        let mapping = TextureMapping::IDENTITY;
        Arc::new(Texture::Image(ImageTexture { texels, filter, wrap, mapping, mipmaps: None, factor: None }))
    }

    #[test]
    fn noise_bumps_need_no_tangents() {
        use crate::materials::footprint::{ExtraCoordinates, ObjectPoint};
        use crate::materials::texture::{Noise, Pattern, PatternTexture};
        use crate::math::DMat3;

        let pattern = Pattern::Noise(Noise { size: 1.0, octaves: 2, seed: 1 });
        let texture = PatternTexture { pattern, colors: [Vec3::ZERO, Vec3::ONE], is_filtered: false };
        let at = |point: Vec3| {
            let object = ObjectPoint { position: point.as_dvec3(), width: 0.0, from_world: DMat3::IDENTITY };
            let extra = Some(Box::new(ExtraCoordinates { second: None, object: Some(object) }));
            TexturePoint { extra, ..TexturePoint::from_uv(DVec2::ZERO) }
        };
        let height = |point: Vec3| texture.lookup(&at(point)).x;
        let normal = Vec3::new(2.0, -1.0, 2.0) / 3.0;
        let bump = Bump { texture: Arc::new(Texture::Pattern(texture.clone())), scale: 0.1 };
        let point = Vec3::new(0.3, 0.6, -0.8);
        let bent = bump.perturb(&at(point), normal, normal, [Vec3::ZERO; 2]);
        // The displaced surface has the slopes of the height along two tangents.
        let tangents = [Vec3::new(1.0, 2.0, 0.0), Vec3::new(0.0, 2.0, 1.0)];
        let step = 1e-3;
        for tangent in tangents {
            let rise = height(point + tangent * step) - height(point - tangent * step);
            let displaced = tangent + normal * (0.1 * rise / (2.0 * step));
            assert!(bent.dot(displaced).abs() < 1e-3, "{bent}: {displaced}");
        }
        assert!((bent - normal).length() > 1e-2, "{bent}");
    }

    /// A bump map whose heights increase by 1 per unit of u near the center.
    fn ramp(scale: f32) -> Bump {
        Bump { texture: texture(&[0.0, 0.25, 0.5, 0.75].map(Vec3::splat)), scale }
    }

    fn bent(normal_perturbation: &NormalPerturbation, normal: Vec3, tangents: [Vec3; 2]) -> (Vec3, u64) {
        let mut lookups = 0;
        let at = TexturePoint::from_uv(DVec2::new(0.5, 0.3));
        (normal_perturbation.perturb(&at, normal, tangents, &mut lookups), lookups)
    }

    #[test]
    fn ramps_tilt_normals_by_their_slope() {
        // (tangents, normal, scale, unnormalized expected normal)
        let cases = [
            ([Vec3::X, Vec3::Y], Vec3::Z, 0.5, Vec3::new(-0.5, 0.0, 1.0)),
            ([Vec3::X * 2.0, Vec3::Y], Vec3::Z, 0.5, Vec3::new(-0.25, 0.0, 1.0)),
            ([Vec3::X, Vec3::NEG_Y], Vec3::Z, 0.5, Vec3::new(-0.5, 0.0, 1.0)),
            ([Vec3::X, Vec3::Y], Vec3::NEG_Z, 0.5, Vec3::new(-0.5, 0.0, -1.0)),
            ([Vec3::X, Vec3::Y], Vec3::Z, -0.5, Vec3::new(0.5, 0.0, 1.0)),
            // Here, x = u + v and y = v, so the height u equals x − y.
            ([Vec3::X, Vec3::new(1.0, 1.0, 0.0)], Vec3::Z, 1.0, Vec3::new(-1.0, 1.0, 1.0)),
            // The shading normal may be tilted. Only the components of the tangents perpendicular to it
            // matter.
            ([Vec3::new(1.0, 0.0, 0.7), Vec3::Y], Vec3::Z, 1.0, Vec3::new(-1.0, 0.0, 1.0)),
        ];
        for (tangents, normal, scale, expected) in cases {
            let normal_perturbation = NormalPerturbation { normal_map: None, bump: Some(ramp(scale)) };
            let (bent, lookups) = bent(&normal_perturbation, normal, tangents);
            assert!((bent - expected.normalize()).length() < 1e-6, "{tangents:?} {normal}: {bent}");
            assert_eq!(lookups, 4);
        }
    }

    #[test]
    fn normal_map_and_bump_map_slopes_add_up() {
        let map = NormalMap { texture: texture(&[Vec3::new(0.8, 0.5, 0.9)]), strength: 1.0 };
        let normal_perturbation = NormalPerturbation { normal_map: Some(map), bump: Some(ramp(0.5)) };
        let (bent, lookups) = bent(&normal_perturbation, Vec3::Z, [Vec3::X, Vec3::Y]);
        // The normal map has a slope of 0.6/0.8, and the ramp has a slope of −0.5.
        assert!((bent - Vec3::new(0.25, 0.0, 1.0).normalize()).length() < 1e-6, "{bent}");
        assert_eq!(lookups, 5);
    }

    #[test]
    fn degenerate_tangents_keep_the_normal() {
        let normal_perturbation = NormalPerturbation { normal_map: None, bump: Some(ramp(1.0)) };
        for tangents in [[Vec3::ZERO; 2], [Vec3::X, Vec3::X * 2.0], [Vec3::NAN, Vec3::Y], [Vec3::X, Vec3::Z]]
        {
            assert_eq!(bent(&normal_perturbation, Vec3::Z, tangents).0, Vec3::Z, "{tangents:?}");
        }
    }
}
