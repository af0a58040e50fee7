//! What a picture shows.

use crate::choice;

choice! {
    /// What a picture shows.
    pub enum View {
        /// The picture.
        Beauty = "beauty",
        /// Shading normals, (n + 1)/2.
        Normal = "normal",
        /// Distance along the view axis; near is bright.
        Depth = "depth",
        /// Barycentric coordinates: a red, b green, c blue.
        Barycentric = "barycentric",
        /// Texture coordinates.
        Uv = "uv",
        /// Diffuse reflectance.
        Albedo = "albedo",
        /// Ambient part of Phong.
        Ambient = "ambient",
        /// Diffuse part of Phong.
        Diffuse = "diffuse",
        /// Specular part of Phong.
        Specular = "specular",
        /// Fraction of the lights' radiance that arrives.
        Shadow = "shadow",
    }
}

impl View {
    /// What its numbers are.
    pub fn shown(self) -> Shown {
        match self {
            Self::Beauty | Self::Ambient | Self::Diffuse | Self::Specular => Shown::Light,
            Self::Shadow => Shown::ArrivingShare,
            Self::Normal => Shown::FirstHit(FirstHit::Normal),
            Self::Depth => Shown::FirstHit(FirstHit::Depth),
            Self::Barycentric => Shown::FirstHit(FirstHit::Barycentric),
            Self::Uv => Shown::FirstHit(FirstHit::Uv),
            Self::Albedo => Shown::FirstHit(FirstHit::Albedo),
        }
    }
}

/// What the numbers of a view are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// Radiance, of all light or of a part.
    Light,
    /// The share, from 0 to 1, of the light that could arrive.
    ArrivingShare,
    /// A number about the first hit, to be displayed as it is: no exposure or tone curve applies.
    FirstHit(FirstHit),
}

/// A number about the first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstHit {
    /// [`View::Normal`].
    Normal,
    /// [`View::Depth`].
    Depth,
    /// [`View::Barycentric`].
    Barycentric,
    /// [`View::Uv`].
    Uv,
    /// [`View::Albedo`].
    Albedo,
}
