//! Views: the AOVs that an image can show.

use crate::choice;
use crate::film::FilmQuantity;
use crate::materials::bsdf::ShownLobes;

choice! {
    /// Content of an image.
    pub enum ViewMode {
        /// The rendered image.
        Beauty = "beauty",
        /// Shading normals, as (n + 1)/2.
        Normal = "normal",
        /// Depth along the view axis, or 0 without a hit. The preview maps the visible range to gray values,
        /// with near surfaces bright.
        Depth = "depth",
        /// Barycentric coordinates: a is red, b green, c blue.
        Barycentric = "barycentric",
        /// Texture coordinates.
        Uv = "uv",
        /// Diffuse reflectance.
        Albedo = "albedo",
        /// Ambient term.
        Ambient = "ambient",
        /// Light reflected by diffuse lobes.
        Diffuse = "diffuse",
        /// Light reflected by glossy lobes.
        Specular = "specular",
        /// Emission of visible surfaces, and the background.
        Emission = "emission",
        /// Light that reaches the first diffuse or glossy surface from other diffuse or glossy surfaces.
        Indirect = "indirect",
        /// Light that reaches the first diffuse or glossy surface only via mirrors and glass.
        Caustic = "caustic",
        /// Number of photons in one pass within the kernel at each point, if photons are enabled.
        Photons = "photons",
        /// Unoccluded fraction of the lights' radiance.
        Shadow = "shadow",
        /// Bounding boxes of the acceleration structures over the image, with one color per level, faint
        /// behind surfaces.
        Bounds = "bounds",
        /// Number of boxes and shapes tested against the rays of a sample.
        Cost = "cost",
        /// Samples per pixel.
        Samples = "samples",
        /// Estimated standard error of each pixel's luminance.
        Error = "error",
    }
}

impl ViewMode {
    /// Source of this view's values.
    pub fn aov_source(self) -> AovSource {
        let of = |parts: RadianceComponentMask| AovSource::Light(PathAov::Radiance(parts));
        let by = |paths: PathClasses| {
            of(RadianceComponentMask { diffuse: true, specular: true, paths, ..RadianceComponentMask::NONE })
        };
        match self {
            Self::Beauty => of(RadianceComponentMask::ALL),
            Self::Ambient => of(RadianceComponentMask { ambient: true, ..RadianceComponentMask::NONE }),
            Self::Diffuse => of(RadianceComponentMask { diffuse: true, ..RadianceComponentMask::NONE }),
            Self::Specular => of(RadianceComponentMask { specular: true, ..RadianceComponentMask::NONE }),
            Self::Emission => of(RadianceComponentMask { emitted: true, ..RadianceComponentMask::NONE }),
            Self::Indirect => by(PathClasses { indirect: true, ..PathClasses::NONE }),
            Self::Caustic => by(PathClasses { caustic: true, ..PathClasses::NONE }),
            Self::Photons => AovSource::FirstHit(FirstHitQuantity::Photons),
            Self::Shadow => AovSource::Light(PathAov::LitFraction),
            Self::Bounds => AovSource::Bounds,
            Self::Cost => AovSource::Light(PathAov::TraversalCost),
            Self::Samples => AovSource::Film(FilmQuantity::Samples),
            Self::Error => AovSource::Film(FilmQuantity::Error),
            Self::Normal => AovSource::FirstHit(FirstHitQuantity::Normal),
            Self::Depth => AovSource::FirstHit(FirstHitQuantity::Depth),
            Self::Barycentric => AovSource::FirstHit(FirstHitQuantity::Barycentric),
            Self::Uv => AovSource::FirstHit(FirstHitQuantity::Uv),
            Self::Albedo => AovSource::FirstHit(FirstHitQuantity::Albedo),
        }
    }
}

impl ViewMode {
    /// View whose samples are used to compute this view.
    pub fn view_to_sample(self) -> Self {
        match self.aov_source() {
            AovSource::Film(FilmQuantity::Radiance | FilmQuantity::Samples | FilmQuantity::Error) => {
                Self::Beauty
            }
            AovSource::Light(_) | AovSource::FirstHit(_) | AovSource::Bounds => self,
        }
    }

    /// Film quantity shown by this view.
    pub fn displayed_film_quantity(self) -> FilmQuantity {
        match self.aov_source() {
            AovSource::Film(quantity) => quantity,
            AovSource::Light(_) | AovSource::FirstHit(_) | AovSource::Bounds => FilmQuantity::Radiance,
        }
    }
}

/// Source of a view's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AovSource {
    /// Light gathered by paths.
    Light(PathAov),
    /// A quantity at the first hit, without exposure or tone mapping. All quantities except depth are
    /// displayed unchanged.
    FirstHit(FirstHitQuantity),
    /// The beauty image with the acceleration structures' bounding boxes drawn over it.
    Bounds,
    /// A statistic of the beauty image's samples.
    Film(FilmQuantity),
}

impl AovSource {
    /// The light AOV accumulated by paths, or [`PathAov::ALL`] if the source is not a light AOV. First-hit
    /// views do not use it.
    pub fn light_transport_aov_or_all(self) -> PathAov {
        match self {
            Self::Light(aov) => aov,
            Self::FirstHit(_) | Self::Bounds | Self::Film(_) => PathAov::ALL,
        }
    }
}

/// Quantity accumulated along a sample's paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathAov {
    /// Radiance of these components.
    Radiance(RadianceComponentMask),
    /// Fraction of the lights' radiance that is not occluded, from 0 to 1.
    LitFraction,
    /// Traversal cost of all rays in the sample: number of boxes and shapes visited.
    TraversalCost,
}

impl PathAov {
    /// The beauty image.
    pub const ALL: Self = Self::Radiance(RadianceComponentMask::ALL);

    /// Whether surface colors are applied to reflected light.
    pub fn applies_surface_colors(self) -> bool {
        match self {
            Self::Radiance(_) | Self::TraversalCost => true,
            Self::LitFraction => false,
        }
    }

    /// The non-specular lobes that contribute.
    #[inline(always)]
    pub fn lobes(self) -> ShownLobes {
        match self {
            Self::Radiance(RadianceComponentMask { diffuse, specular, .. }) => {
                ShownLobes::Of { diffuse, specular }
            }
            Self::TraversalCost => ShownLobes::ALL,
            Self::LitFraction => ShownLobes::Unit,
        }
    }

    /// Classes of paths along which light may reach the first diffuse or glossy surface.
    pub fn path_classes(self) -> PathClasses {
        match self {
            Self::Radiance(parts) => parts.paths,
            Self::LitFraction | Self::TraversalCost => PathClasses::ALL,
        }
    }
}

/// Components of a sample's radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RadianceComponentMask {
    /// Emission of surfaces, and the background.
    pub emitted: bool,
    /// The ambient term.
    pub ambient: bool,
    /// Light reflected by diffuse lobes.
    pub diffuse: bool,
    /// Light reflected by glossy lobes.
    pub specular: bool,
    /// Classes of paths along which reflected light may reach the first diffuse or glossy surface.
    pub paths: PathClasses,
}

/// Classes of light paths, distinguished by the interactions between the light and the first diffuse or
/// glossy surface seen by the camera, directly or through mirrors and glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathClasses {
    /// Direct light.
    pub direct: bool,
    /// Light scattered only by mirrors and glass.
    pub caustic: bool,
    /// All other paths.
    pub indirect: bool,
}

impl PathClasses {
    /// All classes.
    pub const ALL: Self = Self { direct: true, caustic: true, indirect: true };
    /// No classes.
    pub const NONE: Self = Self { direct: false, caustic: false, indirect: false };
}

impl RadianceComponentMask {
    /// Whether any reflected light contributes.
    pub fn has_reflected(self) -> bool {
        self.diffuse || self.specular
    }

    /// All components.
    pub const ALL: Self =
        Self { emitted: true, ambient: true, diffuse: true, specular: true, paths: PathClasses::ALL };
    /// No components, but all path classes, so that any components added later include all paths.
    pub const NONE: Self =
        Self { emitted: false, ambient: false, diffuse: false, specular: false, paths: PathClasses::ALL };
}

/// A quantity at the first hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstHitQuantity {
    /// Shading normal.
    Normal,
    /// Depth along the view axis.
    Depth,
    /// Barycentric coordinates.
    Barycentric,
    /// Texture coordinates.
    Uv,
    /// Diffuse reflectance.
    Albedo,
    /// Number of photons within the kernel.
    Photons,
}
