//! Materials: reflection, transmission and emission of surfaces.

pub mod bsdf;
pub mod coated;
pub mod emission;
pub mod footprint;
pub mod fresnel;
pub mod glass;
pub mod lobe_albedo;
pub mod microfacet;
pub mod mipmaps;
pub mod mirror;
pub mod normal_map;
pub mod number;
pub mod opacity;
pub mod pane;
pub mod relief;
pub mod rough;
pub mod texels;
pub mod texture;

pub use coated::Coated;
pub use emission::{Emission, EmissionSides};
pub use footprint::{Footprint, SecondPoint, TexturePoint, UvSet};
pub use glass::Glass;
pub use mipmaps::Mipmaps;
pub use mirror::Mirror;
pub use normal_map::NormalMap;
pub use number::{Channel, Number, PixelNumber};
pub use opacity::Opacity;
pub use pane::Pane;
pub use relief::{Bump, Relief};
pub use rough::*;

use crate::math::Vec3;

/// A material, ready for look-ups.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Scattering of arriving light.
    pub bsdf: Bsdf,
    /// Radiance that it emits, the same in every direction.
    pub emission: Emission,
    /// What bends the shading normals.
    pub relief: Option<Relief>,
    /// The chance that it is there. `None` if it is there everywhere.
    pub opacity: Option<Opacity>,
}

impl Material {
    /// Whether anything of it changes with texture coordinates or their directions.
    pub fn is_textured(&self) -> bool {
        let in_bsdf = match &self.bsdf {
            Bsdf::Rough(rough) => rough.has_textures() || rough.has_direction(),
            Bsdf::Mirror(mirror) => mirror.textures().next().is_some(),
            Bsdf::Coated(coated) => coated.textures().next().is_some() || coated.base.has_textures(),
            Bsdf::Glass(glass) => glass.roughness.texture().is_some(),
            Bsdf::Pane(pane) => pane.tint.texture().is_some(),
        };
        let of_opacity = self.opacity.as_ref().and_then(|opacity| opacity.value.texture());
        in_bsdf || self.relief.is_some() || self.emission.texture.is_some() || of_opacity.is_some()
    }

    /// Whether light may pass it straight on.
    #[inline]
    pub fn lets_pass(&self) -> bool {
        let is_pane = match &self.bsdf {
            Bsdf::Pane(_) => true,
            Bsdf::Rough(_) | Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Coated(_) => false,
        };
        is_pane || self.opacity.is_some()
    }

    /// The part of the light that passes straight on, at texture coordinates and the cosine of an angle of incidence; `color`
    /// multiplies that of a pane. Adds to `lookups`.
    pub fn passing(&self, at: &TexturePoint, color: Vec3, cosine: f32, lookups: &mut u64) -> Vec3 {
        let there = self.opacity.as_ref().map_or(1.0, |opacity| opacity.at(at, lookups));
        let through = match &self.bsdf {
            Bsdf::Pane(pane) => {
                let tint = pane.tint.at(at, lookups).min(Vec3::ONE);
                tint * color * (1.0 - pane.reflectance(cosine))
            }
            Bsdf::Rough(_) | Bsdf::Mirror(_) | Bsdf::Glass(_) | Bsdf::Coated(_) => Vec3::ZERO,
        };
        through * there + Vec3::splat(1.0 - there)
    }

    /// Whether any of its textures has mip levels.
    pub fn is_mipmapped(&self) -> bool {
        let in_bsdf = match &self.bsdf {
            Bsdf::Rough(rough) => rough.is_mipmapped(),
            Bsdf::Mirror(mirror) => mirror.textures().any(|texture| texture.mipmaps.is_some()),
            Bsdf::Coated(coated) => {
                coated.base.is_mipmapped() || coated.textures().any(|texture| texture.mipmaps.is_some())
            }
            Bsdf::Glass(glass) => glass.roughness.texture().is_some_and(|texture| texture.mipmaps.is_some()),
            Bsdf::Pane(pane) => pane.tint.texture().is_some_and(|texture| texture.mipmaps.is_some()),
        };
        let of_opacity = self.opacity.as_ref().and_then(|opacity| opacity.value.texture());
        let of_relief = self.relief.iter().flat_map(Relief::textures);
        let mut others = [self.emission.texture.as_ref(), of_opacity].into_iter().flatten().chain(of_relief);
        in_bsdf || others.any(|texture| texture.mipmaps.is_some())
    }
}

/// A material's scattering of arriving light (bidirectional scattering distribution function).
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// A rough surface: its lobes are not δ.
    Rough(Rough),
    /// A perfect mirror.
    Mirror(Mirror),
    /// A smooth or rough dielectric.
    Glass(Glass),
    /// A thin pane of glass.
    Pane(Pane),
    /// A rough surface under a smooth coat.
    Coated(Coated),
}

impl Bsdf {
    /// Whether it has a δ lobe.
    #[inline]
    pub fn has_delta(&self) -> bool {
        match self {
            Self::Rough(_) => false,
            Self::Glass(glass) => glass.is_smooth(),
            Self::Mirror(_) | Self::Pane(_) | Self::Coated(_) => true,
        }
    }

    /// Whether it has a lobe that is not δ.
    #[inline]
    pub fn is_lit(&self) -> bool {
        self.rough().is_some()
    }

    /// Whether its lobes depend on the direction of texture coordinates.
    #[inline]
    pub fn has_direction(&self) -> bool {
        self.rough().is_some_and(Rough::has_direction)
    }

    /// Its lobes that are not δ. `None` if there are none.
    #[inline]
    pub fn rough(&self) -> Option<&Rough> {
        match self {
            Self::Rough(rough) | Self::Coated(Coated { base: rough, .. }) => Some(rough),
            Self::Mirror(_) | Self::Glass(_) | Self::Pane(_) => None,
        }
    }

    /// The glass that fills the shape. `None` for other materials.
    pub fn glass(&self) -> Option<&Glass> {
        match self {
            Self::Glass(glass) => Some(glass),
            Self::Rough(_) | Self::Mirror(_) | Self::Coated(_) | Self::Pane(_) => None,
        }
    }

    /// Whether it is a sheet that scatters light to its other side.
    pub fn lets_through(&self) -> bool {
        match self {
            Self::Rough(rough) => rough.lets_through(),
            Self::Coated(coated) => coated.base.lets_through(),
            Self::Mirror(_) | Self::Glass(_) | Self::Pane(_) => false,
        }
    }

    /// Its main colour, and the number of texture look-ups for it.
    #[inline]
    pub fn albedo(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Rough(rough) => rough.albedo(at, lookups),
            Self::Mirror(mirror) => mirror.reflectance(1.0, None, at, lookups),
            Self::Glass(glass) => glass.tint,
            Self::Pane(pane) => pane.tint.at(at, lookups),
            Self::Coated(coated) => coated.base.albedo(at, lookups),
        }
    }
}
