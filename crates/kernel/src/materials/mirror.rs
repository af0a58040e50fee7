//! The perfect mirror.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::metal::MetalFresnel;
use super::texture::{Color, Texture};
use crate::math::Vec3;

/// A mirror, which reflects in one direction.
#[derive(Clone, Debug, PartialEq)]
pub enum Mirror {
    /// The same reflectance of each colour at every angle.
    Even(Color),
    /// A smooth conductor.
    Metal(MetalFresnel),
}

impl Mirror {
    /// Reflectance by the cosine of the angle of incidence, with its colour multiplied by another one, if there is one.
    #[inline]
    pub fn reflectance(&self, cosine: f32, tint: Option<Vec3>, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Even(color) => color.at(at, lookups).min(Vec3::ONE) * tint.unwrap_or(Vec3::ONE),
            Self::Metal(fresnel) => {
                let own = fresnel.at(at, lookups);
                tint.map_or(own, |tint| own.tinted(tint)).reflectance(cosine)
            }
        }
    }

    /// [`Mirror::reflectance`] with white in place of its textures.
    pub fn bleached(&self, cosine: f32) -> Vec3 {
        match self {
            Self::Even(color) => color.constant().unwrap_or(Vec3::ONE),
            Self::Metal(fresnel) => fresnel.bleached().reflectance(cosine),
        }
    }

    /// Its textures.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let (color, fresnel) = match self {
            Self::Even(color) => (color.texture(), None),
            Self::Metal(fresnel) => (None, Some(fresnel)),
        };
        color.into_iter().chain(fresnel.into_iter().flat_map(MetalFresnel::textures))
    }
}

/// The direction `incident` takes at a mirror: R = I − 2(I·N)N.
pub fn reflect(incident: Vec3, normal: Vec3) -> Vec3 {
    incident - normal * (2.0 * incident.dot(normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec2;

    #[test]
    fn another_colour_multiplies_that_of_a_metal_and_nothing_of_an_index() {
        let (at, half) = (TexturePoint::sharp(DVec2::ZERO), Some(Vec3::splat(0.5)));
        let grey = |mirror: &Mirror, cosine: f32, tint| mirror.reflectance(cosine, tint, &at, &mut 0).x;
        let color = |reflectance: f32| Color::Constant(Vec3::splat(reflectance));
        let even = Mirror::Even(color(0.8));
        assert_eq!([grey(&even, 0.1, None), grey(&even, 0.1, half)], [0.8, 0.4]);
        // Schlick: F0 + (1 − F0)(1 − cosθ)⁵ with F0 = .4.
        let metal = Mirror::Metal(MetalFresnel::Schlick(color(0.8)));
        assert!((grey(&metal, 0.5, half) - (0.4 + 0.6 / 32.0)).abs() < 1e-6);
        let index = Mirror::Metal(MetalFresnel::Index { eta: color(0.2), k: color(3.9) });
        assert_eq!(grey(&index, 0.5, half), grey(&index, 0.5, None));
    }

    #[test]
    fn metals_of_any_index_reflect_a_part_of_the_light() {
        let at = TexturePoint::sharp(DVec2::ZERO);
        for (eta, k) in [(1e-30_f32, 0.0_f32), (1e30, 0.0), (0.0, 1e38), (f32::MAX, f32::MAX), (5e9, 5e9)] {
            let [eta, k] = [eta, k].map(|part| Color::Constant(Vec3::splat(part)));
            let metal = Mirror::Metal(MetalFresnel::Index { eta, k });
            for cosine in [0.01, 0.5, 1.0] {
                let part = metal.reflectance(cosine, None, &at, &mut 0).x;
                assert!((0.999..=1.0).contains(&part), "{metal:?}: {part}");
            }
        }
    }

    #[test]
    fn angles_in_and_out_are_equal() {
        let (incident, normal) = (Vec3::new(0.6, -0.8, 0.0), Vec3::Y);
        assert_eq!(reflect(incident, normal), Vec3::new(0.6, 0.8, 0.0));
        assert_eq!(reflect(incident, -normal), reflect(incident, normal));
    }
}
