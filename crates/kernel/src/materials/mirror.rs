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

    #[test]
    fn angles_in_and_out_are_equal() {
        let (incident, normal) = (Vec3::new(0.6, -0.8, 0.0), Vec3::Y);
        assert_eq!(reflect(incident, normal), Vec3::new(0.6, 0.8, 0.0));
        assert_eq!(reflect(incident, -normal), reflect(incident, normal));
    }
}
