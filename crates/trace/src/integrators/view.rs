//! Views: the contents of a picture.

use crate::choice;
use crate::film::Quantity;
use crate::materials::bsdf::ShownLobes;

choice! {
    /// Content of a picture.
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
        /// Light that comes to the first diffuse or glossy surface by others.
        Indirect = "indirect",
        /// Light that comes there by mirrors and glass alone.
        Caustic = "caustic",
        /// How many photons a pass has around a point, within its kernel, where photons are on.
        Photons = "photons",
        /// Fraction of the lights' radiance that arrives.
        Shadow = "shadow",
        /// The boxes of the trees over the picture, a colour for each level; faint behind surfaces.
        Bounds = "bounds",
        /// Boxes and shapes that the rays of a sample meet, up to their ends.
        Cost = "cost",
        /// Samples of each pixel.
        Samples = "samples",
        /// Standard error to expect of each pixel's luminance, by what its last samples changed.
        Error = "error",
    }
}

impl View {
    /// Meaning of its numbers.
    pub fn shown(self) -> Shown {
        let of = |parts: Parts| Shown::Light(Measure::Radiance(parts));
        let by = |ways: Ways| of(Parts { diffuse: true, specular: true, ways, ..Parts::NONE });
        match self {
            Self::Beauty => of(Parts::ALL),
            Self::Ambient => of(Parts { ambient: true, ..Parts::NONE }),
            Self::Diffuse => of(Parts { diffuse: true, ..Parts::NONE }),
            Self::Specular => of(Parts { specular: true, ..Parts::NONE }),
            Self::Emission => of(Parts { emitted: true, ..Parts::NONE }),
            Self::Indirect => by(Ways { indirect: true, ..Ways::NONE }),
            Self::Caustic => by(Ways { caustic: true, ..Ways::NONE }),
            Self::Photons => Shown::FirstHit(FirstHit::Photons),
            Self::Shadow => Shown::Light(Measure::ArrivingShare),
            Self::Bounds => Shown::Bounds,
            Self::Cost => Shown::Light(Measure::Work),
            Self::Samples => Shown::Film(Quantity::Samples),
            Self::Error => Shown::Film(Quantity::Error),
            Self::Normal => Shown::FirstHit(FirstHit::Normal),
            Self::Depth => Shown::FirstHit(FirstHit::Depth),
            Self::Barycentric => Shown::FirstHit(FirstHit::Barycentric),
            Self::Uv => Shown::FirstHit(FirstHit::Uv),
            Self::Albedo => Shown::FirstHit(FirstHit::Albedo),
        }
    }
}

impl View {
    /// The view whose samples it shows.
    pub fn sampled(self) -> Self {
        match self.shown() {
            Shown::Film(Quantity::Radiance | Quantity::Samples | Quantity::Error) => Self::Beauty,
            Shown::Light(_) | Shown::FirstHit(_) | Shown::Bounds => self,
        }
    }

    /// Quantity of the samples that it shows.
    pub fn quantity(self) -> Quantity {
        match self.shown() {
            Shown::Film(quantity) => quantity,
            Shown::Light(_) | Shown::FirstHit(_) | Shown::Bounds => Quantity::Radiance,
        }
    }
}

/// Meaning of the numbers of a view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// A measure of light.
    Light(Measure),
    /// A number about the first hit, without exposure or tone curve. All but distances are displayed unchanged.
    FirstHit(FirstHit),
    /// All radiance, with the boxes of the trees over it.
    Bounds,
    /// A number about the samples of the picture.
    Film(Quantity),
}

impl Shown {
    /// The measure of light of its samples; views of first hits do not use it.
    pub fn measure(self) -> Measure {
        match self {
            Self::Light(measure) => measure,
            Self::FirstHit(_) | Self::Bounds | Self::Film(_) => Measure::ALL,
        }
    }
}

/// A measure of the light that a sample sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Radiance, of these parts.
    Radiance(Parts),
    /// The share, from 0 to 1, of the lights' possible radiance that arrives.
    ArrivingShare,
    /// The work of all rays of the sample: what they visit in the trees.
    Work,
}

impl Measure {
    /// All radiance.
    pub const ALL: Self = Self::Radiance(Parts::ALL);

    /// Whether the colours of surfaces are part of the light of lamps.
    pub fn is_colored(self) -> bool {
        match self {
            Self::Radiance(_) | Self::Work => true,
            Self::ArrivingShare => false,
        }
    }

    /// Lobes of rough surfaces that it shows.
    #[inline(always)]
    pub fn lobes(self) -> ShownLobes {
        match self {
            Self::Radiance(Parts { diffuse, specular, .. }) => ShownLobes::Of { diffuse, specular },
            Self::Work => ShownLobes::ALL,
            Self::ArrivingShare => ShownLobes::Unit,
        }
    }

    /// Ways by which light may come to the first diffuse or glossy surface.
    pub fn ways(self) -> Ways {
        match self {
            Self::Radiance(parts) => parts.ways,
            Self::ArrivingShare | Self::Work => Ways::ALL,
        }
    }
}

/// Parts of the light that a sample sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parts {
    /// Emission of surfaces and of the background.
    pub emitted: bool,
    /// The ambient part of Phong.
    pub ambient: bool,
    /// The diffuse part of the reflected light of lights.
    pub diffuse: bool,
    /// The glossy part of it.
    pub specular: bool,
    /// Ways by which it may come to the first diffuse or glossy surface.
    pub ways: Ways,
}

/// Ways of light from the lights to the first diffuse or glossy surface that the camera sees, directly or by mirrors
/// and glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ways {
    /// The direct way.
    pub direct: bool,
    /// The way by mirrors and glass alone.
    pub caustic: bool,
    /// All other ways.
    pub indirect: bool,
}

impl Ways {
    /// All ways.
    pub const ALL: Self = Self { direct: true, caustic: true, indirect: true };
    /// No way.
    pub const NONE: Self = Self { direct: false, caustic: false, indirect: false };
}

impl Parts {
    /// Whether any light of lamps is taken.
    pub fn are_reflected(self) -> bool {
        self.diffuse || self.specular
    }

    /// All parts.
    pub const ALL: Self =
        Self { emitted: true, ambient: true, diffuse: true, specular: true, ways: Ways::ALL };
    /// No parts; parts added to it have all ways.
    pub const NONE: Self =
        Self { emitted: false, ambient: false, diffuse: false, specular: false, ways: Ways::ALL };
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
    /// [`View::Photons`].
    Photons,
}
