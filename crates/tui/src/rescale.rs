//! Image resizing.

use std::borrow::Cow;

use crate::film::Srgb8Image;
use crate::math::Vec3;
use crate::math::color::{linear_to_srgb8, srgb8_color_to_linear};

/// Resizes an image to `width` × `height`.
pub(super) fn resized(picture: &Srgb8Image, width: u32, height: u32) -> Srgb8Image {
    Srgb8Image { width, height, pixels: resized_pixels(picture, width, height).into_owned() }
}

/// Returns the resized image's pixels. Downscaling averages the covered pixels in linear light, weighted by
/// area. Upscaling repeats the nearest pixel.
pub(super) fn resized_pixels(picture: &Srgb8Image, width: u32, height: u32) -> Cow<'_, [[u8; 3]]> {
    if (picture.width, picture.height) == (width, height) {
        return Cow::Borrowed(&picture.pixels);
    }
    let columns: Vec<_> = (0..width).map(|i| covered_pixel_weights(i, width, picture.width)).collect();
    let rows: Vec<_> = (0..height).map(|i| covered_pixel_weights(i, height, picture.height)).collect();
    let mut pixels = Vec::with_capacity(width as usize * height as usize);
    for row in &rows {
        for column in &columns {
            pixels.push(mean_color(picture, column, row));
        }
    }
    Cow::Owned(pixels)
}

/// Returns the source pixels that a target pixel covers along one axis, each with its covered length.
fn covered_pixel_weights(target: u32, targets: u32, sources: u32) -> Vec<(u32, f32)> {
    if targets >= sources {
        let middle = (u64::from(target) * 2 + 1) * u64::from(sources) / (2 * u64::from(targets.max(1)));
        return vec![(u32::try_from(middle).unwrap_or(0), 1.0)];
    }
    let ratio = f64::from(sources) / f64::from(targets);
    let (start, end) = (f64::from(target) * ratio, f64::from(target + 1) * ratio);
    let last = (end.ceil() as u32).min(sources);
    (start.floor() as u32..last)
        .map(|source| {
            let length = (f64::from(source + 1)).min(end) - f64::from(source).max(start);
            (source, length as f32)
        })
        .filter(|(_, length)| *length > 0.0)
        .collect()
}

fn mean_color(picture: &Srgb8Image, columns: &[(u32, f32)], rows: &[(u32, f32)]) -> [u8; 3] {
    let at = |x: u32, y: u32| {
        picture.pixels.get(y as usize * picture.width as usize + x as usize).copied().unwrap_or_default()
    };
    if let ([(x, _)], [(y, _)]) = (columns, rows) {
        return at(*x, *y);
    }
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (y, height) in rows {
        for (x, width) in columns {
            sum += srgb8_color_to_linear(at(*x, *y)) * (width * height);
            weights += width * height;
        }
    }
    let mean = sum / weights;
    [linear_to_srgb8(mean.x), linear_to_srgb8(mean.y), linear_to_srgb8(mean.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> Srgb8Image {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
        Srgb8Image { width, height, pixels }
    }

    #[test]
    fn downscaling_averages_in_linear_light() {
        let checks = picture(8, 8, |x, y| if (x + y) % 2 == 0 { [255; 3] } else { [0; 3] });
        let half = linear_to_srgb8(0.5);
        assert_eq!(resized_pixels(&checks, 4, 4).as_ref(), [[half; 3]; 16]);
        let thirds = picture(3, 1, |x, _| if x == 0 { [255; 3] } else { [0; 3] });
        // The first of the two pixels covers one white pixel and half of a black one.
        assert_eq!(resized_pixels(&thirds, 2, 1).as_ref(), [[linear_to_srgb8(2.0 / 3.0); 3], [0; 3]]);
    }

    #[test]
    fn enlarging_repeats_pixels() {
        let two = picture(2, 1, |x, _| if x == 0 { [1, 2, 3] } else { [4, 5, 6] });
        assert_eq!(resized_pixels(&two, 4, 1).as_ref(), [[1, 2, 3], [1, 2, 3], [4, 5, 6], [4, 5, 6]]);
    }
}
