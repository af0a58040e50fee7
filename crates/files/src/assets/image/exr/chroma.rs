//! Converts luminance and chroma to RGB, as OpenEXR's `RgbaInputFile` does (Kainz and Bogart, *Technical
//! Introduction to OpenEXR*, "Luminance/Chroma Images").

use ::exr::meta::header::Header;
use ::exr::prelude::Vec2;

use super::channels::PartAndChannelIndex;
use super::{ChannelRow, SAMPLE_BYTES, channel_by_index};
use crate::math::DVec3;

/// Interpolation weights for the samples on either side of a pixel, from nearest to farthest
/// (`ImfRgbaYca.cpp`).
const WEIGHTS: [f32; 7] = [0.627_123, -0.186_077, 0.087_929, -0.043_159, 0.019_597, -0.007_540, 0.002_128];

/// Luminance and chroma planes for the data window.
pub(super) struct LuminanceChromaPlanes {
    /// Y, RY and BY.
    channels: [PartAndChannelIndex; 3],
    /// Size of the luminance plane.
    size: Vec2<usize>,
    /// Distance between chroma samples in pixels.
    step: Vec2<usize>,
    luminance: Vec<f32>,
    chroma: [Vec<f32>; 2],
}

impl LuminanceChromaPlanes {
    pub(super) fn new(headers: &[Header], channels: [PartAndChannelIndex; 3]) -> Self {
        let [_, ry, _] = channels;
        let (size, step) = (headers[ry.part].layer_size, channel_by_index(headers, ry).sampling);
        let chroma = || vec![0.0; (size / step).area()];
        Self { channels, size, step, luminance: vec![0.0; size.area()], chroma: [chroma(), chroma()] }
    }

    /// Size in memory of the planes after chroma has been interpolated along rows.
    pub(super) fn memory_bytes(headers: &[Header], [_, ry, _]: [PartAndChannelIndex; 3]) -> u64 {
        let size = headers[ry.part].layer_size;
        let rows = size.height() / channel_by_index(headers, ry).sampling.y();
        let samples = (size.width() as u64).saturating_mul((size.height() + 2 * rows) as u64);
        samples.saturating_mul(SAMPLE_BYTES as u64)
    }

    /// Stores a row of samples if its channel belongs to one of the planes.
    pub(super) fn store_channel_row(
        &mut self,
        channel: PartAndChannelIndex,
        row: usize,
        line: ChannelRow<'_>,
    ) {
        let widths = [self.size, self.size / self.step, self.size / self.step].map(|size| size.width());
        let [ry, by] = &mut self.chroma;
        for ((plane, width), plane_channel) in
            [&mut self.luminance, ry, by].into_iter().zip(widths).zip(self.channels)
        {
            if let Some(row) = plane.chunks_exact_mut(width).nth(row).filter(|_| plane_channel == channel) {
                line.for_each_value(0, row.iter_mut(), |target, value| *target = value);
            }
        }
    }

    /// Calls `put` with the column, row and color of each pixel. `weights` are the luminance weights of red,
    /// green and blue.
    pub(super) fn for_each_color(mut self, weights: DVec3, mut put: impl FnMut([usize; 2], [f32; 3])) {
        let (width, height) = (self.size.width(), self.size.height());
        let is_filtered = self.step == Vec2(2, 2);
        self.interpolate_chroma_along_rows();
        if !is_filtered {
            for (index, luminance) in self.luminance.iter().enumerate() {
                let at = [index % width, index / width];
                put(at, luminance_chroma_to_rgb(*luminance, self.interpolated_chroma_at_pixel(at), weights));
            }
            return;
        }
        let mut rows = [-1, 0, 1].map(|row| self.rgb_row(row, weights));
        for y in 0..height {
            for x in 0..width {
                put([x, y], limit_saturation_to_neighbors([&rows[0], &rows[1], &rows[2]], x, weights));
            }
            rows.rotate_left(1);
            rows[2] = self.rgb_row(y as i64 + 2, weights);
        }
    }

    /// Interpolates chroma along the rows that have samples.
    fn interpolate_chroma_along_rows(&mut self) {
        let (width, step) = (self.size.width(), self.step.x());
        let interpolated = |plane: &Vec<f32>| -> Vec<f32> {
            let rows = plane.chunks_exact(width / step);
            rows.flat_map(|row| {
                (0..width).map(|x| interpolated_chroma_at_column(x, self.step, row.len(), |at| row[at]))
            })
            .collect()
        };
        let chroma = [interpolated(&self.chroma[0]), interpolated(&self.chroma[1])];
        self.chroma = chroma;
    }

    /// Returns the colors in a row. Rows outside the image repeat rows near the edge.
    fn rgb_row(&self, y: i64, weights: DVec3) -> Vec<[f32; 3]> {
        let (width, height) = (self.size.width(), self.size.height() as i64);
        let inside = if y >= height { height - 2 } else { y.max(0) } as usize;
        let color = |x: usize| {
            let chroma = [0, 1].map(|plane| {
                let sample = |row: i64| {
                    let row = row.clamp(0, height / 2 - 1) as usize;
                    self.chroma[plane][row * width + x]
                };
                if y % 2 == 0 {
                    sample(inside as i64 / 2)
                } else {
                    filtered_midpoint((y - 1).div_euclid(2), sample)
                }
            });
            luminance_chroma_to_rgb(self.luminance[inside * width + x], chroma, weights)
        };
        (0..width).map(color).collect()
    }

    /// Chroma of a pixel, interpolated linearly between rows that have samples.
    fn interpolated_chroma_at_pixel(&self, [x, y]: [usize; 2]) -> [f32; 2] {
        let (width, rows) = (self.size.width(), self.size.height() / self.step.y());
        [0, 1].map(|plane| {
            interpolate_linearly_at_pixel(y, self.step.y(), rows, |row| self.chroma[plane][row * width + x])
        })
    }
}

/// Interpolates chroma at a column, using the filter for 2 × 2 subsampling and linear interpolation for other
/// factors.
fn interpolated_chroma_at_column(
    x: usize,
    step: Vec2<usize>,
    count: usize,
    sample: impl Fn(usize) -> f32,
) -> f32 {
    if step != Vec2(2, 2) {
        return interpolate_linearly_at_pixel(x, step.x(), count, sample);
    }
    let last = count as i64 - 1;
    match x % 2 {
        0 => sample(x / 2),
        _ => filtered_midpoint(x as i64 / 2, |at| sample(at.clamp(0, last) as usize)),
    }
}

/// Filtered value between the samples `left` and `left + 1`.
fn filtered_midpoint(left: i64, sample: impl Fn(i64) -> f32) -> f32 {
    let pairs = (0..).zip(WEIGHTS);
    pairs.map(|(away, weight)| weight * (sample(left - away) + sample(left + 1 + away))).sum()
}

/// Interpolates linearly between samples that are `step` pixels apart. The last sample is repeated.
fn interpolate_linearly_at_pixel(
    pixel: usize,
    step: usize,
    count: usize,
    sample: impl Fn(usize) -> f32,
) -> f32 {
    let first = (pixel / step).min(count - 1);
    let (low, fraction) = (sample(first), (pixel % step) as f32 / step as f32);
    if fraction == 0.0 { low } else { low + (sample((first + 1).min(count - 1)) - low) * fraction }
}

/// Converts luminance and chroma to red, green and blue. Gray is preserved exactly.
fn luminance_chroma_to_rgb(luminance: f32, [ry, by]: [f32; 2], weights: DVec3) -> [f32; 3] {
    if ry == 0.0 && by == 0.0 {
        return [luminance; 3];
    }
    let y = f64::from(luminance);
    let (red, blue) = ((f64::from(ry) + 1.0) * y, (f64::from(by) + 1.0) * y);
    let green = (y - red * weights.x - blue * weights.z) / weights.y;
    [red as f32, green as f32, blue as f32]
}

/// Limits a pixel's saturation based on its neighbors' saturation, preserving luminance
/// (`RgbaYca::fixSaturation`).
fn limit_saturation_to_neighbors(
    [above, row, below]: [&[[f32; 3]]; 3],
    x: usize,
    weights: DVec3,
) -> [f32; 3] {
    let (left, right) = (x.saturating_sub(1), (x + 1).min(row.len() - 1));
    let corners = [above[left], above[right], below[left], below[right]].map(saturation);
    let mean = (0.25 * corners.iter().sum::<f32>()).min(1.0);
    let (color, found) = (row[x], saturation(row[x]));
    let most = (1.0 - (1.0 - mean) * 0.25).min(1.0);
    if found <= mean || found <= most {
        return color;
    }
    let max = color.into_iter().fold(f32::MIN, f32::max);
    let reduced = color.map(|part| (max - (max - part) * (most / found)).max(0.0));
    let luminance = |color: [f32; 3]| DVec3::from_array(color.map(f64::from)).dot(weights);
    let (wanted, got) = (luminance(color), luminance(reduced));
    if got > 0.0 { reduced.map(|part| (f64::from(part) * wanted / got) as f32) } else { reduced }
}

/// 1 − min/max of the components, or 0 if no component is positive.
fn saturation(color: [f32; 3]) -> f32 {
    let max = color.into_iter().fold(f32::MIN, f32::max);
    let min = color.into_iter().fold(f32::MAX, f32::min);
    if max > 0.0 { 1.0 - min / max } else { 0.0 }
}
