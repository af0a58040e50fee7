//! What surfaces do with light.

pub mod fresnel;
pub mod glass;
pub mod mirror;
pub mod normal_map;
pub mod phong;
pub mod texels;
pub mod texture;

pub use glass::Glass;
pub use mirror::Mirror;
pub use phong::Phong;

use crate::math::Vec3;

/// A material, ready to be looked up.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Diffuse and glossy.
    Phong(Phong),
    /// A perfect mirror.
    Mirror(Mirror),
    /// A smooth dielectric.
    Glass(Glass),
}

impl Material {
    /// What it is filled with, if it is a glass.
    pub fn glass(&self) -> Option<&Glass> {
        match self {
            Self::Glass(glass) => Some(glass),
            Self::Phong(_) | Self::Mirror(_) => None,
        }
    }

    /// Radiance that its front side sends out, in every direction alike.
    pub fn emission(&self) -> Vec3 {
        match self {
            Self::Phong(phong) => phong.emission,
            Self::Mirror(_) | Self::Glass(_) => Vec3::ZERO,
        }
    }
}
