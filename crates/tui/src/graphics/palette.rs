//! Palette quantization. The color box with the largest squared error is split repeatedly, and the mean of
//! each final box becomes a palette color (after X. Wu, "Efficient statistical computations for optimal color
//! quantization", 1991).
//!
//! Successive previews of a render are similar, so the palette is reused while it fits, which prevents
//! flicker. Colors outside the palette are dithered.

use std::ops::Range;

use crate::color::{PaletteDither, dither_to_6_bits_per_channel};
use crate::film::Srgb8Image;

/// Maximum number of colors. Registers below 16 are reserved for the terminal.
const MAX_COLORS: usize = 240;
/// Histogram bits per channel.
const HISTOGRAM_BITS: u32 = 6;
/// An existing palette is reused while its RMS error is at most `MAX_ERROR_RATIO` times a new palette's
/// error, plus `ALLOWED` code values.
const MAX_ERROR_RATIO: f64 = 1.2;
const ALLOWED: f64 = 1.5;

/// Palette colors for an image.
#[derive(Debug)]
pub(super) struct Palette {
    colors: Vec<[u8; 3]>,
    dither: PaletteDither,
}

impl Palette {
    /// Returns the palette for an image, reusing the previous one if it still fits.
    pub(super) fn reused_or_new(picture: &Srgb8Image, before: Option<Self>) -> Self {
        let mut bins = histogram(picture);
        let colors = choose_palette_colors(&mut bins);
        let fits = |palette: &Self| {
            palette_rms_error(&bins, &palette.colors)
                <= MAX_ERROR_RATIO * palette_rms_error(&bins, &colors) + ALLOWED
        };
        before.filter(fits).unwrap_or_else(|| Self { dither: PaletteDither::new(&colors), colors })
    }

    pub(super) fn colors(&self) -> &[[u8; 3]] {
        &self.colors
    }

    /// Returns each pixel's palette index.
    pub(super) fn indices(&mut self, picture: &Srgb8Image) -> Vec<u8> {
        let width = picture.width.max(1) as usize;
        let mut index = |(i, rgb): (usize, &[u8; 3])| {
            let (x, y) = (i % width, i / width);
            self.dither.index_at(dither_to_6_bits_per_channel(*rgb, x, y), x, y) as u8
        };
        picture.pixels.iter().enumerate().map(&mut index).collect()
    }
}

/// A histogram bin.
#[derive(Clone, Copy, Debug, Default)]
struct HistogramBin {
    sum: [f32; 3],
    count: f32,
}

impl HistogramBin {
    fn mean(&self) -> [f64; 3] {
        self.sum.map(|sum| f64::from(sum / self.count.max(1.0)))
    }
}

/// Histogram of an image's colors, without empty bins.
fn histogram(picture: &Srgb8Image) -> Vec<HistogramBin> {
    let mut bins = vec![HistogramBin::default(); 1 << (3 * HISTOGRAM_BITS)];
    for rgb in &picture.pixels {
        let place = rgb
            .iter()
            .fold(0, |place, channel| place << HISTOGRAM_BITS | usize::from(channel >> (8 - HISTOGRAM_BITS)));
        let bin = &mut bins[place];
        bin.count += 1.0;
        for (sum, channel) in bin.sum.iter_mut().zip(rgb) {
            *sum += f32::from(*channel);
        }
    }
    bins.retain(|bin| bin.count > 0.0);
    bins
}

/// Bins that are merged into one palette color.
struct ColorBox {
    bins: Range<usize>,
    mean: [f64; 3],
    /// The axis with the largest squared error, and that error.
    axis: usize,
    error: f64,
}

impl ColorBox {
    fn for_bins(all: &[HistogramBin], bins: Range<usize>) -> Self {
        let own = &all[bins.clone()];
        let count: f64 = own.iter().map(|bin| f64::from(bin.count)).sum();
        let sum = |i: usize| own.iter().map(|bin| f64::from(bin.sum[i])).sum::<f64>();
        let mean: [f64; 3] = std::array::from_fn(|i| sum(i) / count.max(1.0));
        let along = |i: usize| -> f64 {
            own.iter().map(|bin| f64::from(bin.count) * (bin.mean()[i] - mean[i]).powi(2)).sum()
        };
        let errors: [f64; 3] = std::array::from_fn(along);
        let axis = (0..3).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        // A single bin cannot be split, even if rounding gives it a nonzero error.
        let error = if bins.len() > 1 { errors[axis] } else { 0.0 };
        Self { bins, mean, axis, error }
    }
}

/// Repeatedly splits the box with the largest error until there are `MAX_COLORS` boxes or all are exact.
/// Returns the mean color of each box.
fn choose_palette_colors(bins: &mut [HistogramBin]) -> Vec<[u8; 3]> {
    let mut boxes = vec![ColorBox::for_bins(bins, 0..bins.len())];
    while boxes.len() < MAX_COLORS {
        let worst = (0..boxes.len()).max_by(|a, b| boxes[*a].error.total_cmp(&boxes[*b].error));
        let Some(worst) = worst.filter(|worst| boxes[*worst].error > 0.0) else { break };
        let ColorBox { bins: range, mean, axis, .. } = boxes.swap_remove(worst);
        let own = &mut bins[range.clone()];
        own.sort_by(|a, b| a.mean()[axis].total_cmp(&b.mean()[axis]));
        let middle = range.start + own.partition_point(|bin| bin.mean()[axis] < mean[axis]);
        // Rounding may put all bins on one side of the split.
        let middle = middle.clamp(range.start + 1, range.end - 1);
        boxes.push(ColorBox::for_bins(bins, range.start..middle));
        boxes.push(ColorBox::for_bins(bins, middle..range.end));
    }
    boxes.iter().map(|own| own.mean.map(|channel| channel.round() as u8)).collect()
}

/// RMS distance between an image's colors and the nearest palette colors, in code values.
fn palette_rms_error(bins: &[HistogramBin], colors: &[[u8; 3]]) -> f64 {
    let nearest = |mean: [f64; 3]| {
        let distance = |color: &[u8; 3]| -> f64 {
            mean.iter().zip(color).map(|(a, b)| (a - f64::from(*b)).powi(2)).sum()
        };
        colors.iter().map(distance).fold(f64::INFINITY, f64::min)
    };
    let sum: f64 = bins.iter().map(|bin| f64::from(bin.count) * nearest(bin.mean())).sum();
    (sum / bins.iter().map(|bin| f64::from(bin.count)).sum::<f64>().max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dark-to-light ramp with a spot of another color.
    fn ramp(most: f64) -> Srgb8Image {
        let pixel = |i: u32| {
            let light = f64::from(i % 128) / 127.0 * most;
            if i < 40 { [200, 10, 10] } else { [light * 0.6, light * 0.9, light].map(|it| it as u8) }
        };
        Srgb8Image { width: 128, height: 64, pixels: (0..128 * 64).map(pixel).collect() }
    }

    fn mean_error(picture: &Srgb8Image, palette: &mut Palette) -> f64 {
        let indices = palette.indices(picture);
        let pairs = indices.iter().zip(&picture.pixels);
        let off = pairs.map(|(index, rgb)| {
            let shown = palette.colors()[usize::from(*index)];
            shown.iter().zip(rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / 3.0
        });
        off.sum::<f64>() / picture.pixels.len() as f64
    }

    #[test]
    fn few_colors_are_exact_even_if_rare() {
        let (red, blue) = ([255, 0, 0], [0, 0, 255]);
        let pixels = (0..4096).map(|i| if i == 77 { red } else { blue }).collect();
        let picture = Srgb8Image { width: 64, height: 64, pixels };
        let mut palette = Palette::reused_or_new(&picture, None);
        assert_eq!(palette.colors().len(), 2);
        assert_eq!(mean_error(&picture, &mut palette), 0.0);
        let spot = ramp(255.0);
        assert!(Palette::reused_or_new(&spot, None).colors().contains(&[200, 10, 10]));
    }

    #[test]
    fn ramp_has_no_visible_banding() {
        let picture = ramp(255.0);
        let mut palette = Palette::reused_or_new(&picture, None);
        let error = mean_error(&picture, &mut palette);
        // For comparison: xterm's cube has steps of 40 code values.
        assert!(error < 4.0, "{error}");
        let indices = palette.indices(&picture);
        let means = indices.chunks(8).map(|run| {
            run.iter().map(|index| f64::from(palette.colors()[usize::from(*index)][2])).sum::<f64>() / 8.0
        });
        let wanted =
            picture.pixels.chunks(8).map(|run| run.iter().map(|rgb| f64::from(rgb[2])).sum::<f64>() / 8.0);
        let most = means.zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 8.0, "eight-pixel means differ by {most}");
    }

    #[test]
    fn palette_is_reused_while_it_fits() {
        let first = Palette::reused_or_new(&ramp(255.0), None);
        let colors = first.colors().to_vec();
        let same = Palette::reused_or_new(&ramp(253.0), Some(first));
        assert_eq!(same.colors(), colors, "the palette should be reused for a nearly identical image");
        let mut other = ramp(255.0);
        other.pixels.iter_mut().for_each(|rgb| rgb.swap(0, 2));
        assert_ne!(Palette::reused_or_new(&other, Some(same)).colors(), colors);
    }
}
