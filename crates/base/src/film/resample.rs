//! Exact box-filter resampling for any size ratio.

use rayon::prelude::*;

use super::{RadianceImage, is_in_thread_pool};
use crate::math::DVec3;

/// Maps pixels along one axis to another resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AxisPixelMapping {
    from: u64,
    to: u64,
}

impl AxisPixelMapping {
    /// Maps `from` pixels to `to` pixels, both at least 1.
    pub(super) fn new(from: u32, to: u32) -> Self {
        Self { from: u64::from(from.max(1)), to: u64::from(to.max(1)) }
    }

    /// Target pixels that overlap source pixel `index`, each with the length of the overlap. Lengths are in
    /// units of 1/(from·to) of the axis, so every overlap is an exact integer.
    pub(super) fn overlapping_target_pixels(self, index: u32) -> impl Iterator<Item = (u32, f64)> + Clone {
        let (start, end) = (u64::from(index) * self.to, (u64::from(index) + 1) * self.to);
        (start / self.from..end.div_ceil(self.from)).map(move |new| {
            let overlap = end.min((new + 1) * self.from) - start.max(new * self.from);
            (new as u32, overlap as f64)
        })
    }

    fn inverse(self) -> Self {
        Self { from: self.to, to: self.from }
    }
}

pub(super) fn resized(image: &RadianceImage, width: u32, height: u32) -> RadianceImage {
    if (width, height) == (image.width, image.height) || image.pixels.is_empty() {
        return image.clone();
    }
    let (width, height) = (width.max(1), height.max(1));
    // Use the inverse mapping to gather the old pixels that each new pixel covers. The overlaps are the same.
    let columns = AxisPixelMapping::new(image.width, width).inverse();
    let rows = AxisPixelMapping::new(image.height, height).inverse();
    let pixel = |i: usize| {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (y, row_weight) in rows.overlapping_target_pixels((i / width as usize) as u32) {
            let row = &image.pixels[y as usize * image.width as usize..][..image.width as usize];
            for (x, column_weight) in columns.overlapping_target_pixels((i % width as usize) as u32) {
                sum += row[x as usize].as_dvec3() * (row_weight * column_weight);
                weights += row_weight * column_weight;
            }
        }
        (sum / weights).as_vec3()
    };
    let all = 0..width as usize * height as usize;
    let pixels = if is_in_thread_pool() {
        all.into_par_iter().with_min_len(256).map(pixel).collect()
    } else {
        all.map(pixel).collect()
    };
    RadianceImage { width, height, pixels }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec3;
    use proptest::prelude::*;

    #[test]
    fn three_pixels_shrink_to_two() {
        let image =
            RadianceImage { width: 3, height: 1, pixels: vec![Vec3::X, Vec3::splat(3.0), Vec3::splat(6.0)] };
        let smaller = image.resized(2, 1);
        // Each new pixel covers half of the middle pixel: (2·a + 1·b)/3.
        assert!((smaller.pixels[0] - Vec3::new(5.0, 3.0, 3.0) / 3.0).abs().max_element() < 1e-6);
        assert!((smaller.pixels[1] - Vec3::splat(5.0)).abs().max_element() < 1e-6);
        let larger = image.resized(9, 4);
        assert_eq!(larger.pixels[0..3], [Vec3::X; 3]);
        assert_eq!(larger.pixels[33..36], [Vec3::splat(6.0); 3]);
    }

    proptest! {
        #[test]
        fn overlaps_conserve_pixel_areas(from in 1_u32..70, to in 1_u32..70) {
            let axis = AxisPixelMapping::new(from, to);
            let mut filled = vec![0.0; to as usize];
            for old in 0..from {
                let parts: Vec<_> = axis.overlapping_target_pixels(old).collect();
                prop_assert_eq!(parts.iter().map(|part| part.1).sum::<f64>(), f64::from(to));
                for (new, weight) in parts {
                    prop_assert!(weight > 0.0);
                    filled[new as usize] += weight;
                }
            }
            prop_assert!(filled.iter().all(|&sum| sum == f64::from(from)));
        }
    }
}
