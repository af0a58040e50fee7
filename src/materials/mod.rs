//! What surfaces do with light.

pub mod fresnel;
pub mod glass;
pub mod lobes;
pub mod mirror;
pub mod normal_map;
pub mod phong;
pub mod texels;
pub mod texture;

pub use glass::Glass;
pub use lobes::Lobes;
pub use mirror::Mirror;
pub use normal_map::NormalMap;
pub use phong::Phong;

use crate::math::{DVec2, Vec3};

/// A material, ready to be looked up.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// What it does with light that arrives.
    pub bsdf: Bsdf,
    /// Radiance that its front side sends out, in every direction alike.
    pub emission: Vec3,
    /// Bends the shading normals.
    pub normal_map: Option<NormalMap>,
}

/// What a material does with light that arrives (a bidirectional scattering distribution function).
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// Diffuse and glossy.
    Phong(Phong),
    /// A perfect mirror.
    Mirror(Mirror),
    /// A smooth dielectric.
    Glass(Glass),
}

impl Bsdf {
    /// What it is filled with, if it is a glass.
    pub fn glass(&self) -> Option<&Glass> {
        match self {
            Self::Glass(glass) => Some(glass),
            Self::Phong(_) | Self::Mirror(_) => None,
        }
    }

    /// Its main colour, and how many texture look-ups that took.
    pub fn albedo(&self, uv: DVec2, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Phong(phong) => phong.diffuse.at(uv, lookups),
            Self::Mirror(mirror) => mirror.reflectance,
            Self::Glass(glass) => glass.tint,
        }
    }
}
