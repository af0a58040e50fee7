//! The perfect mirror.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::metal::MetalFresnel;
use super::texture::Texture;
use crate::math::Vec3;

/// A mirror, which reflects in one direction.
#[derive(Clone, Debug, PartialEq)]
pub enum Mirror {
    /// The same reflectance of each colour at every angle.
    Even(Vec3),
    /// A smooth conductor.
    Metal(MetalFresnel),
}

impl Mirror {
    /// Reflectance by the cosine of the angle of incidence.
    #[inline]
    pub fn reflectance(&self, cosine: f32, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Even(reflectance) => *reflectance,
            Self::Metal(fresnel) => fresnel.at(at, lookups).reflectance(cosine),
        }
    }

    /// [`Mirror::reflectance`] with white in place of its textures.
    pub fn bleached(&self, cosine: f32) -> Vec3 {
        match self {
            Self::Even(reflectance) => *reflectance,
            Self::Metal(fresnel) => fresnel.bleached().reflectance(cosine),
        }
    }

    /// Its textures.
    pub fn textures(&self) -> impl Iterator<Item = &Arc<Texture>> {
        let fresnel = match self {
            Self::Even(_) => None,
            Self::Metal(fresnel) => Some(fresnel),
        };
        fresnel.into_iter().flat_map(MetalFresnel::textures)
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
