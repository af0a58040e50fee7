//! A palette made from a picture: boxes of colors are split where their squared error is largest (after X. Wu, "Efficient
//! statistical computations for optimal color quantization", 1991), and each becomes its mean.
//!
//! Pictures of one render follow each other closely: the palette stays as long as it fits, or its colors would flicker.
//! Colors between those of the palette are mixed by place, as those of other palettes are.

use std::ops::Range;

use crate::color::{Mixture, finer};
use crate::film::Picture;

/// The most colors: registers below 16 are the terminal's own.
const MOST: usize = 240;
/// Bits of a channel that tell colors apart when the palette is made.
const BITS: u32 = 6;
/// A palette stays while the root of its squared error is no larger than this many times that of a new one, and so many codes.
const WORSE: f64 = 1.2;
const ALLOWED: f64 = 1.5;

/// The colors that a picture is shown in.
#[derive(Debug)]
pub(super) struct Palette {
    colors: Vec<[u8; 3]>,
    mixture: Mixture,
}

impl Palette {
    /// The palette for a picture: the one before if that fits it.
    pub(super) fn for_picture(picture: &Picture, before: Option<Self>) -> Self {
        let mut bins = bins(picture);
        let colors = split(&mut bins);
        let fits = |palette: &Self| error(&bins, &palette.colors) <= WORSE * error(&bins, &colors) + ALLOWED;
        before.filter(fits).unwrap_or_else(|| Self { mixture: Mixture::new(&colors), colors })
    }

    pub(super) fn colors(&self) -> &[[u8; 3]] {
        &self.colors
    }

    /// The number of the color for each pixel.
    pub(super) fn indices(&mut self, picture: &Picture) -> Vec<u8> {
        let width = picture.width.max(1) as usize;
        let mut index = |(i, rgb): (usize, &[u8; 3])| {
            let (x, y) = (i % width, i / width);
            self.mixture.index(finer(*rgb, x, y), x, y) as u8
        };
        picture.pixels.iter().enumerate().map(&mut index).collect()
    }
}

/// Pixels of about one color.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    sum: [f32; 3],
    count: f32,
}

impl Bin {
    fn mean(&self) -> [f64; 3] {
        self.sum.map(|sum| f64::from(sum / self.count.max(1.0)))
    }
}

/// The colors of a picture and how often each is there.
fn bins(picture: &Picture) -> Vec<Bin> {
    let mut bins = vec![Bin::default(); 1 << (3 * BITS)];
    for rgb in &picture.pixels {
        let place = rgb.iter().fold(0, |place, channel| place << BITS | usize::from(channel >> (8 - BITS)));
        let bin = &mut bins[place];
        bin.count += 1.0;
        for (sum, channel) in bin.sum.iter_mut().zip(rgb) {
            *sum += f32::from(*channel);
        }
    }
    bins.retain(|bin| bin.count > 0.0);
    bins
}

/// Some bins that become one color.
struct ColorBox {
    bins: Range<usize>,
    mean: [f64; 3],
    /// The axis along which the squared error is largest, and that error.
    axis: usize,
    error: f64,
}

impl ColorBox {
    fn of(all: &[Bin], bins: Range<usize>) -> Self {
        let own = &all[bins.clone()];
        let count: f64 = own.iter().map(|bin| f64::from(bin.count)).sum();
        let sum = |i: usize| own.iter().map(|bin| f64::from(bin.sum[i])).sum::<f64>();
        let mean: [f64; 3] = std::array::from_fn(|i| sum(i) / count.max(1.0));
        let along = |i: usize| -> f64 {
            own.iter().map(|bin| f64::from(bin.count) * (bin.mean()[i] - mean[i]).powi(2)).sum()
        };
        let errors: [f64; 3] = std::array::from_fn(along);
        let axis = (0..3).max_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        // One bin cannot be split, whatever rounding makes of it.
        let error = if bins.len() > 1 { errors[axis] } else { 0.0 };
        Self { bins, mean, axis, error }
    }
}

/// The means of boxes, of which the worst is split until there are enough or all are exact.
fn split(bins: &mut [Bin]) -> Vec<[u8; 3]> {
    let mut boxes = vec![ColorBox::of(bins, 0..bins.len())];
    while boxes.len() < MOST {
        let worst = (0..boxes.len()).max_by(|a, b| boxes[*a].error.total_cmp(&boxes[*b].error));
        let Some(worst) = worst.filter(|worst| boxes[*worst].error > 0.0) else { break };
        let ColorBox { bins: range, mean, axis, .. } = boxes.swap_remove(worst);
        let own = &mut bins[range.clone()];
        own.sort_by(|a, b| a.mean()[axis].total_cmp(&b.mean()[axis]));
        let middle = range.start + own.partition_point(|bin| bin.mean()[axis] < mean[axis]);
        // Rounding may put all of them on one side.
        let middle = middle.clamp(range.start + 1, range.end - 1);
        boxes.push(ColorBox::of(bins, range.start..middle));
        boxes.push(ColorBox::of(bins, middle..range.end));
    }
    boxes.iter().map(|own| own.mean.map(|channel| channel.round() as u8)).collect()
}

/// The root of the mean squared distance, in codes, of the colors of a picture to the nearest of a palette.
fn error(bins: &[Bin], colors: &[[u8; 3]]) -> f64 {
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

    /// A ramp of one color from dark to light, and a spot of another one.
    fn ramp(most: f64) -> Picture {
        let pixel = |i: u32| {
            let light = f64::from(i % 128) / 127.0 * most;
            if i < 40 { [200, 10, 10] } else { [light * 0.6, light * 0.9, light].map(|it| it as u8) }
        };
        Picture { width: 128, height: 64, pixels: (0..128 * 64).map(pixel).collect() }
    }

    fn mean_error(picture: &Picture, palette: &mut Palette) -> f64 {
        let indices = palette.indices(picture);
        let pairs = indices.iter().zip(&picture.pixels);
        let off = pairs.map(|(index, rgb)| {
            let shown = palette.colors()[usize::from(*index)];
            shown.iter().zip(rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / 3.0
        });
        off.sum::<f64>() / picture.pixels.len() as f64
    }

    #[test]
    fn few_colors_are_shown_exactly_and_rare_ones_are_not_lost() {
        let (red, blue) = ([255, 0, 0], [0, 0, 255]);
        let pixels = (0..4096).map(|i| if i == 77 { red } else { blue }).collect();
        let picture = Picture { width: 64, height: 64, pixels };
        let mut palette = Palette::for_picture(&picture, None);
        assert_eq!(palette.colors().len(), 2);
        assert_eq!(mean_error(&picture, &mut palette), 0.0);
        let spot = ramp(255.0);
        assert!(Palette::for_picture(&spot, None).colors().contains(&[200, 10, 10]));
    }

    #[test]
    fn a_ramp_has_no_rings() {
        let picture = ramp(255.0);
        let mut palette = Palette::for_picture(&picture, None);
        let error = mean_error(&picture, &mut palette);
        // xterm's cube has steps of 40 codes.
        assert!(error < 4.0, "{error}");
        let indices = palette.indices(&picture);
        let means = indices.chunks(8).map(|run| {
            run.iter().map(|index| f64::from(palette.colors()[usize::from(*index)][2])).sum::<f64>() / 8.0
        });
        let wanted =
            picture.pixels.chunks(8).map(|run| run.iter().map(|rgb| f64::from(rgb[2])).sum::<f64>() / 8.0);
        let most = means.zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 8.0, "{most}: the mean of eight pixels");
    }

    #[test]
    fn a_palette_stays_while_it_fits() {
        let first = Palette::for_picture(&ramp(255.0), None);
        let colors = first.colors().to_vec();
        let same = Palette::for_picture(&ramp(253.0), Some(first));
        assert_eq!(same.colors(), colors, "hardly another picture");
        let mut other = ramp(255.0);
        other.pixels.iter_mut().for_each(|rgb| rgb.swap(0, 2));
        assert_ne!(Palette::for_picture(&other, Some(same)).colors(), colors);
    }
}
