//! Draws the preview using characters whose ink coverage approximates the brightness.

use crate::film::Srgb8Image;
use crate::math::Vec3;
use crate::math::color::{linear_to_srgb, linear_to_srgb8, luminance, srgb_to_linear, srgb8_color_to_linear};

/// Characters and the fraction of a cell covered by their ink, measured with DejaVu Sans Mono. Other fonts
/// differ by a few percent. All are punctuation, so that they are not mistaken for text.
const RAMP: [(char, f32); 15] = [
    (' ', 0.0),
    ('.', 0.027),
    (',', 0.043),
    (':', 0.055),
    ('^', 0.069),
    ('!', 0.085),
    ('*', 0.095),
    ('+', 0.108),
    ('?', 0.124),
    ('[', 0.140),
    ('{', 0.155),
    ('%', 0.181),
    ('$', 0.211),
    ('&', 0.233),
    ('@', 0.267),
];
const MAX_INK: f32 = RAMP[RAMP.len() - 1].1;

/// A mapping from brightness to characters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AsciiRamp {
    /// The sRGB values shown as black and white.
    low: f32,
    high: f32,
    /// Whether the background is lighter than the foreground.
    is_light: bool,
}

impl AsciiRamp {
    /// Creates a ramp from an image's darkest to its brightest values, ignoring a thirtieth of the pixels at
    /// each end. The limits are quantized to keep most characters stable under noise. Contrast is increased
    /// by no more than a factor of four.
    pub(super) fn for_image(picture: &Srgb8Image, is_light: bool) -> Self {
        const STEPS: f32 = 16.0;
        const MIN: f32 = 0.25;
        let mut counts = [0_usize; 256];
        for pixel in &picture.pixels {
            let level = linear_to_srgb8(luminance(srgb8_color_to_linear(*pixel)));
            counts[usize::from(level)] += 1;
        }
        let beyond = picture.pixels.len() / 30;
        let low = (histogram_level_at_rank(&counts, 0..256, beyond) * STEPS).floor() / STEPS;
        let high = (histogram_level_at_rank(&counts, (0..256).rev(), beyond) * STEPS).ceil() / STEPS;
        let (low, high) = if high - low < MIN { (high.min(1.0) - MIN, high.min(1.0)) } else { (low, high) };
        Self { low: low.max(0.0), high, is_light }
    }

    /// Maps an sRGB brightness from the ramp's range to [0, 1].
    fn map_ramp_range_to_unit(self, brightness: f32) -> f32 {
        ((brightness - self.low) / (self.high - self.low).max(1e-3)).clamp(0.0, 1.0)
    }

    /// The character for a color on a monochrome terminal.
    pub(super) fn glyph(self, rgb: [u8; 3]) -> char {
        self.nearest_glyph(
            self.map_ramp_range_to_unit(linear_to_srgb(
                luminance(srgb8_color_to_linear(rgb)).clamp(0.0, 1.0),
            )),
        )
    }

    /// Returns the character that shows a color, and its ink color. The ink is as saturated as possible,
    /// which maximizes the area covered by the character.
    pub(super) fn tinted_glyph(self, rgb: [u8; 3]) -> (char, [u8; 3]) {
        let linear = srgb8_color_to_linear(rgb);
        if self.is_light {
            let ink = (1.0 - linear.min_element()).max(1e-3);
            let brightness = self.map_ramp_range_to_unit(linear_to_srgb(1.0 - ink));
            (
                self.nearest_glyph(brightness),
                linear_to_quantized_srgb8(Vec3::ONE - (Vec3::ONE - linear) / ink),
            )
        } else {
            let brightest = linear.max_element().max(1e-3);
            (
                self.nearest_glyph(self.map_ramp_range_to_unit(linear_to_srgb(brightest))),
                linear_to_quantized_srgb8(linear / brightest),
            )
        }
    }

    /// The character that comes closest to an sRGB brightness. The range extends from the bare background to
    /// the densest character.
    fn nearest_glyph(self, brightness: f32) -> char {
        let off = |ink: f32| {
            let covered = ink / MAX_INK;
            // Near white, brightness decreases roughly in proportion to the ink coverage.
            let seen = if self.is_light { 1.0 - covered } else { linear_to_srgb(covered) };
            (seen - brightness).abs()
        };
        RAMP.iter().min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map_or(' ', |(symbol, _)| *symbol)
    }
}

/// Returns the first level by which more than `beyond` pixels have been counted.
fn histogram_level_at_rank(
    counts: &[usize; 256],
    mut levels: impl Iterator<Item = usize>,
    beyond: usize,
) -> f32 {
    let mut seen = 0;
    let level = levels.find(|level| {
        seen += counts[*level];
        seen > beyond
    });
    level.unwrap_or_default() as f32 / 255.0
}

/// Quantizes a color to 5 bits per channel so that noise does not cause redraws.
fn linear_to_quantized_srgb8(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|channel| {
        let level = linear_to_srgb8(channel) >> 3;
        level << 3 | level >> 2
    })
}

/// Whether a background is perceptually closer to white than to black.
pub(crate) fn is_light_color(rgb: [u8; 3]) -> bool {
    luminance(srgb8_color_to_linear(rgb)) > srgb_to_linear(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL: AsciiRamp = AsciiRamp { low: 0.0, high: 1.0, is_light: false };

    fn rank(symbol: char) -> usize {
        RAMP.iter().position(|(other, _)| *other == symbol).expect("a ramp character")
    }

    #[test]
    fn ink_depends_on_brightness_and_background() {
        let light = AsciiRamp { is_light: true, ..FULL };
        assert_eq!((FULL.glyph([0; 3]), FULL.glyph([255; 3])), (' ', '@'));
        assert_eq!((light.glyph([0; 3]), light.glyph([255; 3])), ('@', ' '));
        for level in 0..255 {
            assert!(rank(FULL.glyph([level; 3])) <= rank(FULL.glyph([level + 1; 3])));
            assert!(rank(light.glyph([level; 3])) >= rank(light.glyph([level + 1; 3])));
        }
        assert!(rank(FULL.glyph([0, 255, 0])) > rank(FULL.glyph([0, 0, 255])));
        assert!(RAMP.iter().all(|(symbol, _)| *symbol == ' ' || symbol.is_ascii_punctuation()));
    }

    #[test]
    fn low_contrast_is_increased_and_stable() {
        let dull = |noise: u8| {
            let pixels = (0..1000).map(|i| [80 + (i % 60) as u8 + noise * (i % 2) as u8; 3]).collect();
            Srgb8Image { width: 100, height: 10, pixels }
        };
        let ramp = AsciiRamp::for_image(&dull(0), false);
        assert!(rank(ramp.glyph([80; 3])) < 3 && rank(ramp.glyph([139; 3])) > 11, "{ramp:?}");
        assert_eq!(ramp, AsciiRamp::for_image(&dull(2), false));
        let flat =
            AsciiRamp::for_image(&Srgb8Image { width: 10, height: 1, pixels: vec![[128; 3]; 10] }, false);
        assert!((flat.high - flat.low - 0.25).abs() < 1e-6);
    }

    #[test]
    fn ink_and_character_reproduce_the_color() {
        assert_eq!(FULL.tinted_glyph([128, 0, 0]).1, [255, 0, 0]);
        assert!(rank(FULL.tinted_glyph([128, 0, 0]).0) < rank(FULL.tinted_glyph([255, 0, 0]).0));
        let light = AsciiRamp { is_light: true, ..FULL };
        // Pale red is drawn as a sparse character in pure red.
        let (symbol, ink) = light.tinted_glyph([255, 200, 200]);
        assert_eq!(ink, [255, 0, 0]);
        assert!(rank(symbol) < 11 && rank(symbol) > 0, "{symbol}");
    }

    #[test]
    fn backgrounds_are_classified_as_light_or_dark() {
        assert!(is_light_color([255; 3]) && is_light_color([253, 246, 227]) && !is_light_color([0, 43, 54]));
    }
}
