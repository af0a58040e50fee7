//! What a picture shows.

use crate::choice;

choice! {
    /// What a picture shows.
    pub enum View {
        /// The picture.
        Beauty = "beauty",
        /// Shading normals, (n + 1)/2.
        Normal = "normal",
        /// Distance along the view axis, 0 where there is nothing; shown stretched to what is seen, near is bright.
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
        /// What surfaces send out, and what is behind everything.
        Emission = "emission",
        /// Fraction of the lights' radiance that arrives.
        Shadow = "shadow",
    }
}

impl View {
    /// What its numbers are.
    pub fn shown(self) -> Shown {
        let of = |parts: Parts| Shown::Light(Measure::Radiance(parts));
        match self {
            Self::Beauty => of(Parts::ALL),
            Self::Ambient => of(Parts { ambient: true, ..Parts::NONE }),
            Self::Diffuse => of(Parts { diffuse: true, ..Parts::NONE }),
            Self::Specular => of(Parts { specular: true, ..Parts::NONE }),
            Self::Emission => of(Parts { emitted: true, ..Parts::NONE }),
            Self::Shadow => Shown::Light(Measure::ArrivingShare),
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
    /// A measure of light.
    Light(Measure),
    /// A number about the first hit: no exposure or tone curve applies. But for distances it is displayed as it is.
    FirstHit(FirstHit),
}

/// A measure of the light that a sample sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Radiance, of these parts.
    Radiance(Parts),
    /// The share, from 0 to 1, of what could arrive from the lights that does.
    ArrivingShare,
}

impl Measure {
    /// All radiance.
    pub const ALL: Self = Self::Radiance(Parts::ALL);
}

/// Parts of the light that a sample sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Sent out by surfaces, and by what is behind everything.
    pub emitted: bool,
    /// The ambient part of Phong.
    pub ambient: bool,
    /// The diffuse part of what lights send.
    pub diffuse: bool,
    /// The glossy part of it.
    pub specular: bool,
}

impl Parts {
    /// All of it.
    pub const ALL: Self = Self { emitted: true, ambient: true, diffuse: true, specular: true };
    /// Nothing.
    pub const NONE: Self = Self { emitted: false, ambient: false, diffuse: false, specular: false };
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
