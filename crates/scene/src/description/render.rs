//! The `[render]` table: render settings and the definitions of their keys.

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::super::keys::key::{
    COLOR, DefaultValue, KeyInfo, ValueKind, choice_values, doc_without_final_period, parsed_default,
};
use super::super::keys::limits::Limits;
use super::method::Integrator;
use crate::choice;
use crate::choice::Choice;
pub use crate::film::tone::Tonemap;
use crate::math::Vec3;
pub use crate::sampling::filter::PixelFilter;

/// Maximum value of `max_depth`, which is the only limit for paths between perfect mirrors.
pub const MAX_BOUNCES: u32 = 10_000;

#[doc(hidden)]
#[macro_export]
macro_rules! __render_keys {
    ($callback:ident $(, $which:ident)?) => {
        $crate::description::render_keys! {
            @pass $callback [$($which)?] []

            /// Width of the image; at most 2^30 pixels in total.
            width: u32 = 640, whole(1, 65_536), "pixels", option;
            /// Height of the image.
            height: u32 = 480, whole(1, 65_536), "pixels", option;
            /// Maximum number of samples per pixel.
            samples: u32 = 64, whole(1, u32::MAX), "per pixel", option;
            /// Noise threshold below which a tile is finished; 0 always takes all `samples`.
            error: f32 = 0.0, at_least(0.0), "fraction of the brightness", option;
            /// Shadow rays traced to each area light per sample.
            shadow_samples: u32 = 1, whole(1, 4096), "per light", scene;
            /// Maximum number of bounces along a path: 0 shows only emitted light, 1 adds direct light.
            max_depth: u32 = 8, whole(0, MAX_BOUNCES), "bounces", option;
            /// The rendering algorithm.
            integrator: Integrator = Integrator::Whitted, choice, "", option;
            /// Shadows in `whitted`.
            shadows: ShadowMode = ShadowMode::Soft, choice, "", option;
            /// Limit on indirect radiance per bounce: removes fireflies, but darkens the image (biased); 0
            /// disables the limit.
            clamp: f32 = 0.0, at_least(0.0), "radiance", option;
            /// Ambient radiance in `whitted`, an approximation of indirect light.
            ambient: Vec3 = Vec3::ZERO, color, "radiance", scene;
            /// Radiance seen by camera rays that leave the scene; it illuminates nothing.
            background: Vec3 = Vec3::ZERO, color, "radiance", scene;
            /// Pixel reconstruction filter.
            filter: PixelFilter = PixelFilter::Box, choice, "", scene;
            /// Scale factor for the light in the image, including float files.
            gain: f32 = 1.0, at_least(0.0), "", scene;
            /// Image exposure: each stop doubles the brightness.
            exposure: f32 = 0.0, between(-100.0, 100.0), "stops", live;
            /// Tone curve for 8- and 16-bit formats and the screen.
            tonemap: Tonemap = Tonemap::None, choice, "", scene;
            /// Acceleration structure.
            accel: Accel = Accel::Bvh, choice, "", option;
            /// Random seed: different seeds produce different noise.
            seed: u32 = 0, whole(0, u32::MAX), "", option;
        }
    };
    // Filter the keys.
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

/// Passes the definitions of all `[render]` keys to a macro, each as `doc name: type = default, range, unit,
/// change;`. [`RenderOptions`], its reader, overrides and command-line options are generated from them.
///
/// The ranges are `whole(MIN, MAX)`, `at_least(MIN)`, `between(MIN, MAX)`, `choice` and `color`. `change`
/// specifies what can override the key:
///
/// | | |
/// | --- | --- |
/// | `option` | a command-line option with the key's name, with `-` instead of `_` |
/// | `live` | the terminal UI |
/// | `scene` | nothing: only the scene sets the key |
///
/// `render_keys!(callback)` passes all keys, `render_keys!(callback, changed)` passes keys with `option` or
/// `live`, and `render_keys!(callback, option)` passes keys with `option`.
///
/// To add a key, add it here, to [`RenderOptions::add_to_fingerprint`](Fingerprinted::add_to_fingerprint) if images depend on it, to
/// the starter scene, and to the command-line arguments if it has an option. Tests check that these agree.
#[doc(inline)]
pub use __render_keys as render_keys;

macro_rules! kind {
    (whole($least:expr, $most:expr), $type:ty) => {
        ValueKind::Whole(<u64 as From<u32>>::from($least), <u64 as From<u32>>::from($most))
    };
    (at_least($least:expr), $type:ty) => {
        ValueKind::Number(Limits::AtLeast($least))
    };
    (between($least:expr, $most:expr), $type:ty) => {
        ValueKind::Number(Limits::Between($least, $most))
    };
    (choice, $type:ty) => {
        ValueKind::Words(choice_values::<$type>)
    };
    (color, $type:ty) => {
        COLOR
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
        /// The `[render]` settings.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct RenderOptions {
            $($(#[doc = $doc])* pub $name: $type,)*
        }

        impl RenderOptions {
            /// The default settings.
            pub const DEFAULT: Self = Self { $($name: $default),* };

            /// Returns the definitions of the keys in `[render]`, except `output`.
            pub(crate) fn key_definitions() -> Vec<KeyInfo> {
                vec![$(KeyInfo {
                    name: stringify!($name),
                    kind: kind!($range $(($($limit),*))?, $type),
                    unit: $unit,
                    default: DefaultValue::Is(in_toml!($range, Self::DEFAULT.$name).leak()),
                    default_value: parsed_default!(DefaultValue::Is(
                        in_toml!($range, RenderOptions::DEFAULT.$name).leak()
                    )),
                    doc: doc_without_final_period(concat!($($doc),*)),
                }),*]
            }
        }
    };
}

render_keys!(settings);

choice! {
    /// Kinds of shadows.
    pub enum ShadowMode {
        /// No shadows.
        Off = "off",
        /// One ray to the center of each light.
        Hard = "hard",
        /// Random rays to each area light.
        Soft = "soft",
    }
}

choice! {
    /// Acceleration structures.
    pub enum Accel {
        /// Bounding volume hierarchy.
        Bvh = "bvh",
        /// BVH with spatial splits (SBVH): slower to build, but faster to trace if triangles are long and
        /// diagonal.
        BvhHigh = "bvh-high",
        /// kd-tree over the triangles of meshes.
        KdTree = "kdtree",
    }
}

impl RenderOptions {
    /// Replaces settings ignored by the integrator with their defaults.
    pub fn reset_ignored(self) -> Self {
        let method = self.integrator.properties();
        Self {
            shadows: if method.honors_shadows { self.shadows } else { Self::DEFAULT.shadows },
            ambient: if method.honors_ambient { self.ambient } else { Self::DEFAULT.ambient },
            clamp: if method.honors_clamp { self.clamp } else { Self::DEFAULT.clamp },
            ..self
        }
    }
}

/// Fingerprint of all settings that affect the samples.
impl Fingerprinted for RenderOptions {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self {
            width,
            height,
            // The film stores its sample count.
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
            gain,
            // These affect only the output.
            exposure: _,
            tonemap: _,
            // All acceleration structures find the same hits. Views that visualize these structures add this
            // key to their fingerprint.
            accel: _,
            seed,
        } = self.reset_ignored();
        key.add_f32(error);
        key.add_u64(width.into())
            .add_u64(height.into())
            .add_u64(shadow_samples.into())
            .add_u64(max_depth.into());
        key.add_choice_name(integrator)
            .add_choice_name(shadows)
            .add_f32(clamp)
            .add_vec3(ambient)
            .add_vec3(background)
            .add_choice_name(filter)
            .add_f32(gain)
            .add_u64(seed.into());
    }
}
