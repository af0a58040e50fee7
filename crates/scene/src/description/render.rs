//! `[render]`.

use std::ops::RangeInclusive;

use super::super::fingerprint::{Fingerprint, Fingerprinted, Referents};
use super::super::keys::key::{WordList, words};
use super::method::Integrator;
use crate::choice;
use crate::choice::Choice;
pub use crate::film::tone::Tonemap;
use crate::math::Vec3;
use crate::math::limits::LARGEST;
pub use crate::sampling::filter::PixelFilter;

/// Most scatterings along one path that a scene may ask for: between perfect mirrors a path ends nowhere else.
pub const MOST_SCATTERINGS: u32 = 10_000;

#[doc(hidden)]
#[macro_export]
macro_rules! __render_keys {
    ($callback:ident $(, $which:ident)?) => {
        $crate::description::render_keys! {
            @pass $callback [$($which)?] []

            /// Width of the image; at most 2^30 pixels in all.
            width: u32 = 640, whole(1, 65_536), "pixels", option;
            /// Height of the image.
            height: u32 = 480, whole(1, 65_536), "pixels", option;
            /// Most samples that a pixel gets.
            samples: u32 = 64, whole(1, u32::MAX), "per pixel", option;
            /// Noise at which a tile is done; with 0, `samples` decide.
            error: f32 = 0.0, at_least(0.0), "part of the brightness", option;
            /// Shadow rays to each light of some size, for each sample.
            shadow_samples: u32 = 1, whole(1, 4096), "per light", scene;
            /// Bounces along one path: 0 shows emitted light only, 1 direct light.
            max_depth: u32 = 8, whole(0, MOST_SCATTERINGS), "scatterings", option;
            /// The rendering algorithm.
            integrator: Integrator = Integrator::Whitted, choice, "", option;
            /// Shadows in `whitted`.
            shadows: Shadows = Shadows::Soft, choice, "", option;
            /// Most that one bounce may bring: less noise, but the picture gets too dark; 0 is no limit.
            clamp: f32 = 0.0, at_least(0.0), "radiance", option;
            /// Light from everywhere in `whitted`, in place of light that bounces.
            ambient: Vec3 = Vec3::ZERO, color, "radiance", scene;
            /// Radiance that a ray sees when it leaves the scene; it lights nothing.
            background: Vec3 = Vec3::ZERO, color, "radiance", scene;
            /// Reconstruction filter of a pixel.
            filter: PixelFilter = PixelFilter::Box, choice, "", scene;
            /// Brightness of the image: 1 is twice as bright.
            exposure: f32 = 0.0, between(-100.0, 100.0), "stops", live;
            /// Tone curve of formats with 8 or 16 bits, and of the screen.
            tonemap: Tonemap = Tonemap::None, choice, "", scene;
            /// Acceleration structure.
            accel: Accel = Accel::Bvh, choice, "", option;
            /// Seed of all random numbers: another seed, other noise.
            seed: u32 = 0, whole(0, u32::MAX), "", option;
        }
    };
    // Pass the keys on that are wanted.
    (@pass $callback:ident [$($which:ident)?] [$($kept:tt)*]) => { $callback! { $($kept)* } };
    (@pass $callback:ident [] [] $($all:tt)*) => { $callback! { $($all)* } };
    (
        @pass $callback:ident [$which:ident] [$($kept:tt)*]
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, option; $($rest:tt)*
    ) => {
        $crate::description::render_keys! {
            @pass $callback [$which]
            [$($kept)* $(#[doc = $doc])* $name: $type = $default, $range $(($($limit),*))?, $unit, option;]
            $($rest)*
        }
    };
    (
        @pass $callback:ident [changed] [$($kept:tt)*]
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, live; $($rest:tt)*
    ) => {
        $crate::description::render_keys! {
            @pass $callback [changed]
            [$($kept)* $(#[doc = $doc])* $name: $type = $default, $range $(($($limit),*))?, $unit, live;]
            $($rest)*
        }
    };
    (
        @pass $callback:ident [$which:ident] [$($kept:tt)*]
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $other:ident; $($rest:tt)*
    ) => {
        $crate::description::render_keys! { @pass $callback [$which] [$($kept)*] $($rest)* }
    };
}

/// Calls a macro with the keys of `[render]`, each as `doc name: type = default, range, unit, change;`: their one definition. The parser,
/// [`Render`], the overrides of a run and the options of the command line are made from it or read it.
///
/// The ranges are `whole(LEAST, MOST)`, `at_least(LEAST)`, `between(LEAST, MOST)`, `choice` and `color`. The changes:
///
/// | | |
/// | --- | --- |
/// | `option` | an option of the command line overrides the key, which has the key's name with `-` for `_` |
/// | `live` | the terminal UI overrides it |
/// | `scene` | nothing but the scene sets it |
///
/// `render_keys!(callback)` passes all of them on, `render_keys!(callback, changed)` those with `option` or `live`,
/// `render_keys!(callback, option)` those with an option.
///
/// To add a key: a line here; [`Render::add_to`](Fingerprinted::add_to), which says whether pictures depend on it; a line of the
/// starter scene; and the help of its option, if it has one, in the command line's arguments. Tests compare these.
#[doc(inline)]
pub use __render_keys as render_keys;

/// Values that a key of `[render]` accepts.
#[derive(Clone, Debug, PartialEq)]
pub enum KeyRange {
    /// Whole numbers.
    Whole(RangeInclusive<u32>),
    /// Numbers, up to [`LARGEST`](crate::math::limits::LARGEST).
    Number(RangeInclusive<f64>),
    /// These names.
    Names(Vec<&'static str>),
    /// A colour.
    Color,
}

/// A key of `[render]`.
#[derive(Clone, Debug)]
pub struct RenderKey {
    /// The key.
    pub name: &'static str,
    /// Description, one sentence without its full stop.
    pub doc: &'static str,
    /// The unit; empty for none.
    pub unit: &'static str,
    /// Accepted values.
    pub range: KeyRange,
    /// The accepted names with their meanings; none for other values.
    pub words: WordList,
    /// The default, as a scene file has it.
    pub default: String,
    /// Whether an option of the command line overrides it.
    pub has_option: bool,
}

macro_rules! range {
    (whole($least:expr, $most:expr), $type:ty) => {
        KeyRange::Whole($least..=$most)
    };
    (at_least($least:expr), $type:ty) => {
        KeyRange::Number($least..=LARGEST)
    };
    (between($least:expr, $most:expr), $type:ty) => {
        KeyRange::Number($least..=$most)
    };
    (choice, $type:ty) => {
        KeyRange::Names(<$type>::ALL.iter().map(|one| one.name()).collect())
    };
    (color, $type:ty) => {
        KeyRange::Color
    };
}

macro_rules! words {
    (choice, $type:ty) => {
        words::<$type>
    };
    ($range:ident, $type:ty) => {
        Vec::new
    };
}

macro_rules! in_toml {
    (choice, $value:expr) => {
        format!("\"{}\"", $value.name())
    };
    (color, $value:expr) => {
        format!("[{}]", $value.to_array().map(|part| part.to_string()).join(", "))
    };
    ($range:ident, $value:expr) => {
        format!("{:?}", $value)
    };
}

macro_rules! settings {
    ($(
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
    )*) => {
        /// Settings of the picture.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Render {
            $($(#[doc = $doc])* pub $name: $type,)*
        }

        impl Render {
            /// Settings of a scene that has none.
            pub const DEFAULT: Self = Self { $($name: $default),* };

            /// The keys of `[render]`, but for `output`.
            pub fn keys() -> Vec<RenderKey> {
                vec![$(RenderKey {
                    name: stringify!($name),
                    doc: concat!($($doc),*).trim().trim_end_matches('.'),
                    unit: $unit,
                    range: range!($range $(($($limit),*))?, $type),
                    words: words!($range, $type),
                    default: in_toml!($range, Self::DEFAULT.$name),
                    has_option: stringify!($change) == "option",
                }),*]
            }

            /// The key of a name. `None` if there is none.
            pub fn key(name: &str) -> Option<RenderKey> {
                Self::keys().into_iter().find(|key| key.name == name)
            }
        }
    };
}

render_keys!(settings);

choice! {
    /// Methods for shadows.
    pub enum Shadows {
        /// Nothing stops light.
        Off = "off",
        /// One ray to the middle of a light.
        Hard = "hard",
        /// The visible part of the light, sampled.
        Soft = "soft",
    }
}

choice! {
    /// Acceleration structures.
    pub enum Accel {
        /// Bounding volume hierarchy.
        Bvh = "bvh",
        /// The same, with large triangles of meshes in several of its leaves: longer to build, faster to trace where
        /// triangles are long and lie askew.
        BvhHigh = "bvh-high",
        /// kd-tree over the triangles of meshes.
        KdTree = "kdtree",
    }
}

impl Render {
    /// With the defaults in place of what its integrator ignores.
    pub fn effective(self) -> Self {
        let method = self.integrator.method();
        Self {
            shadows: if method.honours_shadows { self.shadows } else { Shadows::Soft },
            ambient: if method.honours_ambient { self.ambient } else { Vec3::ZERO },
            clamp: if method.honours_clamp { self.clamp } else { 0.0 },
            ..self
        }
    }
}

/// Key of the settings that samples depend on.
impl Fingerprinted for Render {
    fn add_to(&self, key: &mut Fingerprint, _: &Referents<'_>) {
        let Self {
            width,
            height,
            // The film knows how many it has.
            samples: _,
            error,
            shadow_samples,
            max_depth,
            integrator,
            shadows,
            clamp,
            ambient,
            background,
            filter,
            // For files and screens only.
            exposure: _,
            tonemap: _,
            // All trees give the same hits; views that show the trees add it.
            accel: _,
            seed,
        } = self.effective();
        key.f32(error);
        key.u64(width.into()).u64(height.into()).u64(shadow_samples.into()).u64(max_depth.into());
        key.choice(integrator)
            .choice(shadows)
            .f32(clamp)
            .vec3(ambient)
            .vec3(background)
            .choice(filter)
            .u64(seed.into());
    }
}
