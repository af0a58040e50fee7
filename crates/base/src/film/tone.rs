//! Conversion of radiance to display values: exposure, tone curve, clamp, sRGB.

use rayon::prelude::*;

use super::range_map::DataBrightnessMap;
use super::{RadianceImage, Srgb8Image, Srgb16Image, curves, is_in_thread_pool, linear_to_srgb8_by_table};
use crate::choice;
use crate::math::Vec3;
use crate::math::color::linear_to_srgb;
use crate::math::elementary::exp2;

choice! {
    /// Tone curves.
    pub enum Tonemap {
        /// Clamp.
        None = "none",
        /// x/(1 + x) on luminance (Reinhard et al. 2002).
        Reinhard = "reinhard",
        /// Fit of the ACES filmic curve (Narkowicz 2015).
        Aces = "aces",
        /// AgX (Sobotka 2022).
        Agx = "agx",
    }
}

#[allow(clippy::derivable_impls, reason = "the enum is defined by `choice!`")]
impl Default for Tonemap {
    fn default() -> Self {
        Self::None
    }
}

/// Encoding of display light in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transfer {
    /// The sRGB curve (IEC 61966-2-1).
    #[default]
    Srgb,
    /// Passes the values through unchanged.
    Identity,
}

/// Maps radiance to display values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToneMapping {
    /// Exposure in stops: radiance is multiplied by 2 raised to this power.
    pub exposure_stops: f32,
    /// Tone curve, which is applied after exposure and returns values in [0, 1].
    pub curve: Tonemap,
    /// Encoding of the result.
    pub transfer: Transfer,
    /// Range mapping for data without an inherent brightness.
    pub range_map: DataBrightnessMap,
}

/// Maximum radiance, far above the saturation point of every curve and far below overflow.
const MAX_RADIANCE: f32 = 1e10;
/// Minimum number of pixels at which parallel processing pays off.
const PARALLEL_PIXELS: usize = 1 << 18;

impl ToneMapping {
    /// Tone mapping for data images, which already contain display values: it only clamps them.
    pub const DATA: Self = Self {
        exposure_stops: 0.0,
        curve: Tonemap::None,
        transfer: Transfer::Identity,
        range_map: DataBrightnessMap::None,
    };

    /// Resolves the range mapping using the values in this image.
    pub fn with_image_range(self, image: &RadianceImage) -> Self {
        Self { range_map: self.range_map.with_image_range(image), ..self }
    }

    /// Linear display light in [0, 1] for any input color. NaN and negative components are treated as 0.
    pub fn linear_display_light(&self, radiance: Vec3) -> Vec3 {
        self.linear_display_light_with_exposure(radiance, exp2(self.exposure_stops))
    }

    fn linear_display_light_with_exposure(&self, radiance: Vec3, factor: f32) -> Vec3 {
        let radiance = self.range_map.map_to_brightness(radiance);
        let bounded = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, MAX_RADIANCE) };
        let color = Vec3::from_array((radiance * factor).to_array().map(bounded));
        match self.curve {
            Tonemap::None => color.min(Vec3::ONE),
            Tonemap::Reinhard => curves::reinhard(color),
            Tonemap::Aces => curves::aces(color),
            Tonemap::Agx => curves::agx(color),
        }
    }
}

/// Converts an image to 8 bits per channel.
pub fn tone_map_to_8_bits(image: &RadianceImage, tone: &ToneMapping) -> Srgb8Image {
    let pixels = match tone.transfer {
        Transfer::Srgb => {
            tone_map_pixels(image, tone, |color| color.to_array().map(linear_to_srgb8_by_table))
        }
        Transfer::Identity => {
            tone_map_pixels(image, tone, |color| color.to_array().map(|x| (x * 255.0 + 0.5) as u8))
        }
    };
    Srgb8Image { width: image.width, height: image.height, pixels }
}

/// Converts an image to 16 bits per channel.
pub fn tone_map_to_16_bits(image: &RadianceImage, tone: &ToneMapping) -> Srgb16Image {
    let quantise = |x: f32| (x * 65535.0 + 0.5) as u16;
    let pixels = match tone.transfer {
        Transfer::Srgb => {
            tone_map_pixels(image, tone, |color| color.to_array().map(|x| quantise(linear_to_srgb(x))))
        }
        Transfer::Identity => tone_map_pixels(image, tone, |color| color.to_array().map(quantise)),
    };
    Srgb16Image { width: image.width, height: image.height, pixels }
}

fn tone_map_pixels<T: Send>(
    image: &RadianceImage,
    tone: &ToneMapping,
    encode: impl Fn(Vec3) -> T + Sync,
) -> Vec<T> {
    let factor = exp2(tone.exposure_stops);
    let pixel = |&radiance: &Vec3| encode(tone.linear_display_light_with_exposure(radiance, factor));
    if image.pixels.len() < PARALLEL_PIXELS || !is_in_thread_pool() {
        image.pixels.iter().map(pixel).collect()
    } else {
        image.pixels.par_iter().with_min_len(1 << 14).map(pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::Choice;

    fn tone(curve: Tonemap) -> ToneMapping {
        ToneMapping { curve, ..Default::default() }
    }

    fn gray(curve: Tonemap, value: f32) -> f32 {
        tone(curve).linear_display_light(Vec3::splat(value)).y
    }

    #[test]
    fn tone_curves_are_monotonic_for_gray() {
        for &curve in Tonemap::ALL {
            let mut before = gray(curve, 0.0);
            assert!(before.abs() < 1e-6, "{curve:?} maps black to {before}");
            for step in -200..=200 {
                let now = gray(curve, (step as f32 / 10.0).exp2());
                assert!(now >= before - 1e-6 && now <= 1.0, "{curve:?} at 2^{}: {now}", step as f32 / 10.0);
                before = now;
            }
            assert!(before > 0.999, "{curve:?} ends at {before}");
        }
    }

    #[test]
    fn curves_have_known_values() {
        assert_eq!(gray(Tonemap::None, 0.25), 0.25);
        assert!((gray(Tonemap::Reinhard, 1.0) - 0.5).abs() < 1e-6);
        assert!((gray(Tonemap::Reinhard, 3.0) - 0.75).abs() < 1e-6);
        // Reinhard works on luminance: pure red with radiance 1 has a luminance of 0.2126.
        let red = tone(Tonemap::Reinhard).linear_display_light(Vec3::X);
        assert!((red - Vec3::X / 1.2126).abs().max_element() < 1e-6);
        assert!((gray(Tonemap::Aces, 1.0) - 2.54 / 3.16).abs() < 1e-6);
        // Middle gray is at the sigmoid's pivot, whose value of ½ is linearized with a gamma of 2.2.
        assert!((gray(Tonemap::Agx, 0.18) - 0.5_f32.powf(2.2)).abs() < 1e-3);
    }

    #[test]
    fn agx_desaturates_bright_colors() {
        let blue = tone(Tonemap::Agx).linear_display_light(Vec3::new(0.0, 0.0, 1000.0));
        assert!(blue.min_element() > 0.3 && blue.z > 0.9, "{blue}");
    }

    #[test]
    fn exposure_is_in_stops() {
        let image = RadianceImage { width: 1, height: 1, pixels: vec![Vec3::new(0.05, 0.1, 0.2)] };
        let brighter = RadianceImage { pixels: vec![Vec3::new(0.2, 0.4, 0.8)], width: 1, height: 1 };
        for &curve in Tonemap::ALL {
            let exposed = ToneMapping { exposure_stops: 2.0, ..tone(curve) };
            assert_eq!(
                tone_map_to_8_bits(&image, &exposed),
                tone_map_to_8_bits(&brighter, &tone(curve)),
                "{curve:?}"
            );
        }
    }

    #[test]
    fn extreme_inputs_are_mapped_into_range() {
        let hostile =
            [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 1e30, f32::MAX, 0.0, 1e-45];
        for &curve in Tonemap::ALL {
            for exposure_stops in [0.0, 10.0, -10.0, 500.0, -500.0, f32::NAN] {
                let mapping = ToneMapping { exposure_stops, ..tone(curve) };
                for [r, g, b] in hostile.iter().flat_map(|&a| hostile.map(|b| [a, b, 0.5])) {
                    let color = mapping.linear_display_light(Vec3::new(r, g, b));
                    assert!(color.is_finite(), "{mapping:?} of {r}, {g}, {b}: {color}");
                    assert!(color.min_element() >= 0.0 && color.max_element() <= 1.0, "{mapping:?}: {color}");
                }
            }
            let dark = Vec3::new(f32::NAN, -1.0, f32::NEG_INFINITY);
            let image = RadianceImage { width: 2, height: 1, pixels: vec![dark, Vec3::splat(1e30)] };
            assert_eq!(tone_map_to_8_bits(&image, &tone(curve)).pixels, [[0; 3], [255; 3]], "{curve:?}");
            assert_eq!(tone_map_to_16_bits(&image, &tone(curve)).pixels, [[0; 3], [65535; 3]], "{curve:?}");
        }
    }

    #[test]
    fn data_is_only_clamped() {
        let pixels = vec![
            Vec3::new(0.5, 0.0, 1.0),
            Vec3::new(-3.0, f32::NAN, 7.0),
            Vec3::new(0.25, 0.1, f32::INFINITY),
        ];
        let image = RadianceImage { width: 3, height: 1, pixels };
        let eight = tone_map_to_8_bits(&image, &ToneMapping::DATA).pixels;
        assert_eq!(eight, [[128, 0, 255], [0, 0, 255], [64, 26, 255]]);
        let sixteen = tone_map_to_16_bits(&image, &ToneMapping::DATA).pixels;
        assert_eq!(sixteen, [[32768, 0, 65535], [0, 0, 65535], [16384, 6554, 65535]]);
    }

    #[test]
    fn sixteen_bit_output_matches_eight_bit_output() {
        let pixels: Vec<_> = (0..=1000).map(|i| Vec3::splat(i as f32 / 1000.0)).collect();
        let image = RadianceImage { width: 1001, height: 1, pixels };
        let coarse = tone_map_to_8_bits(&image, &tone(Tonemap::None)).pixels;
        let fine = tone_map_to_16_bits(&image, &tone(Tonemap::None)).pixels;
        for (eight, sixteen) in coarse.iter().zip(&fine) {
            assert!(
                (f64::from(sixteen[0]) / 257.0 - f64::from(eight[0])).abs() <= 0.502,
                "{eight:?} {sixteen:?}"
            );
        }
        assert!(fine.windows(2).all(|pair| pair[0] < pair[1]), "values 0.001 apart should be distinct");
    }

    #[test]
    fn work_stays_in_the_callers_pool() {
        let pixels = vec![Vec3::ONE; PARALLEL_PIXELS + 7];
        let image = RadianceImage { width: pixels.len() as u32, height: 1, pixels };
        let threads = || {
            let named = |_: Vec3| std::thread::current().name().map(str::to_owned);
            tone_map_pixels(&image, &tone(Tonemap::None), named)
                .into_iter()
                .collect::<std::collections::HashSet<_>>()
        };
        let own = std::thread::current().name().map(str::to_owned);
        assert_eq!(threads(), [own].into(), "outside a pool");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).thread_name(|i| format!("two-{i}"));
        let used = pool.build().expect("a pool").install(threads);
        assert!(used.iter().flatten().all(|name| name.starts_with("two-")) && used.len() <= 2, "{used:?}");
    }

    #[test]
    fn parallel_conversion_matches_per_pixel_conversion() {
        let pixels: Vec<_> = (0..PARALLEL_PIXELS + 7).map(|i| Vec3::splat(i as f32 * 1e-5)).collect();
        let image = RadianceImage { width: pixels.len() as u32, height: 1, pixels };
        let mapping = tone(Tonemap::Aces);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
        let developed = pool.install(|| tone_map_to_8_bits(&image, &mapping)).pixels;
        for (pixel, &radiance) in developed.iter().zip(&image.pixels) {
            assert_eq!(
                *pixel,
                mapping.linear_display_light(radiance).to_array().map(linear_to_srgb8_by_table)
            );
        }
    }
}
