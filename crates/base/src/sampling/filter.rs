//! Filter importance sampling: samples are drawn in proportion to the pixel filter, so all samples with the
//! same sign have equal weight (Ernst, Stamminger, Greiner, *Filter Importance Sampling*, 2006).

use std::sync::LazyLock;

use crate::choice;
use crate::math::Vec2;

choice! {
    /// Reconstruction filters.
    pub enum PixelFilter {
        /// One pixel wide.
        Box = "box",
        /// Two pixels wide, with linear falloff.
        Tent = "tent",
        /// Truncated Gaussian, three pixels wide, with a standard deviation of half a pixel.
        Gaussian = "gaussian",
        /// Mitchell–Netravali filter with B = C = 1/3, four pixels wide.
        Mitchell = "mitchell",
    }
}

/// A sample drawn in proportion to |f|: its offset from the pixel center in pixels, and the sign of f there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSample {
    /// Offset from the pixel center.
    pub offset: Vec2,
    /// Whether the filter is negative at this offset. The pixel value is (1 + w) · mean of the positive
    /// samples − w · mean of the negative samples, with w from [`PixelFilter::negative_weight`].
    pub is_negative: bool,
}

impl PixelFilter {
    /// Maps a point in the unit square to a filter sample.
    #[inline]
    pub fn sample(self, u: Vec2) -> FilterSample {
        match self {
            Self::Box => FilterSample { offset: u - Vec2::splat(0.5), is_negative: false },
            Self::Tent => {
                FilterSample { offset: Vec2::new(sample_tent(u.x), sample_tent(u.y)), is_negative: false }
            }
            Self::Gaussian => GAUSSIAN.sample_2d(u),
            Self::Mitchell => MITCHELL.sample_2d(u),
        }
    }

    /// Replaces points in the unit square with filter offsets. For filters sampled from a table, which may
    /// have negative lobes, also passes each sample and its index to `each`.
    #[inline(always)]
    pub fn sample_packet<const N: usize>(
        self,
        u: &mut [[f32; N]; 2],
        mut each: impl FnMut(usize, FilterSample),
    ) {
        match self {
            Self::Box => u.as_flattened_mut().iter_mut().for_each(|u| *u -= 0.5),
            Self::Tent => u.as_flattened_mut().iter_mut().for_each(|u| *u = sample_tent(*u)),
            Self::Gaussian | Self::Mitchell => {
                for i in 0..N {
                    let sample = self.sample(Vec2::new(u[0][i], u[1][i]));
                    (u[0][i], u[1][i]) = (sample.offset.x, sample.offset.y);
                    each(i, sample);
                }
            }
        }
    }

    /// Weight of the negative lobes, −∫min(f, 0)/∫f over the plane, or `None` if f is never negative.
    pub fn negative_weight(self) -> Option<f64> {
        match self {
            Self::Box | Self::Tent | Self::Gaussian => None,
            // In two dimensions, ∫|f| is 1 + 2w in units of ∫f.
            Self::Mitchell => Some((MITCHELL.excess * MITCHELL.excess - 1.0) * 0.5),
        }
    }
}

/// Samples the pdf 1 − |x| on [−1, 1].
#[inline(always)]
fn sample_tent(u: f32) -> f32 {
    let (is_left, twice) = (u < 0.5, 2.0 * u);
    let rest = 1.0 - (if is_left { twice } else { 2.0 - twice }).sqrt();
    if is_left { -rest } else { rest }
}

static GAUSSIAN: LazyLock<TabulatedFilter> = LazyLock::new(|| {
    let at = |x: f64| libm::exp(-2.0 * x * x);
    TabulatedFilter::new(1.5, |x| at(x) - at(1.5))
});

static MITCHELL: LazyLock<TabulatedFilter> = LazyLock::new(|| {
    TabulatedFilter::new(2.0, |x| {
        let x = x.abs();
        // B = C = 1/3 in the general cubic.
        if x < 1.0 {
            ((7.0 * x - 12.0) * x * x + 16.0 / 3.0) / 6.0
        } else {
            (((-7.0 / 3.0 * x + 12.0) * x - 20.0) * x + 32.0 / 3.0) / 6.0
        }
    })
});

/// A tabulated one-dimensional even function, sampled in proportion to its absolute value.
struct TabulatedFilter {
    radius: f64,
    sums: Vec<f64>,
    is_negative: Vec<bool>,
    /// ∫|f|/∫f.
    excess: f64,
}

impl TabulatedFilter {
    const CELLS: usize = 1024;

    fn new(radius: f64, f: impl Fn(f64) -> f64) -> Self {
        let middle = |cell: usize| ((cell as f64 + 0.5) / Self::CELLS as f64 * 2.0 - 1.0) * radius;
        let values: Vec<f64> = (0..Self::CELLS).map(|cell| f(middle(cell))).collect();
        let mut sum = 0.0;
        let sums = values.iter().map(|value| {
            sum += value.abs();
            sum
        });
        let sums: Vec<f64> = sums.collect();
        let excess = sum / values.iter().sum::<f64>();
        Self { radius, sums, is_negative: values.iter().map(|value| *value < 0.0).collect(), excess }
    }

    fn sample(&self, u: f32) -> (f32, bool) {
        let target = f64::from(u) * self.sums[Self::CELLS - 1];
        let cell = self.sums.partition_point(|&sum| sum <= target).min(Self::CELLS - 1);
        let before = if cell == 0 { 0.0 } else { self.sums[cell - 1] };
        let rest = (target - before) / (self.sums[cell] - before).max(f64::MIN_POSITIVE);
        let x = ((cell as f64 + rest.clamp(0.0, 1.0)) / Self::CELLS as f64 * 2.0 - 1.0) * self.radius;
        (x as f32, self.is_negative[cell])
    }

    fn sample_2d(&self, u: Vec2) -> FilterSample {
        let ((x, is_x_negative), (y, is_y_negative)) = (self.sample(u.x), self.sample(u.y));
        FilterSample { offset: Vec2::new(x, y), is_negative: is_x_negative != is_y_negative }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments over a fine grid: the weights average to 1, the offsets to 0, and the squared offsets to
    /// ∫x²f/∫f.
    #[test]
    fn filters_have_the_expected_moments() {
        let n = 2048;
        for (filter, moment) in [
            (PixelFilter::Box, 1.0 / 12.0),
            (PixelFilter::Tent, 1.0 / 6.0),
            (PixelFilter::Gaussian, gaussian_moment()),
            (PixelFilter::Mitchell, mitchell_moment()),
        ] {
            let negative = filter.negative_weight().unwrap_or(0.0);
            let (mut weight, mut second, mut mean) = (0.0, 0.0, 0.0);
            for i in 0..n * n {
                let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
                let sample = filter.sample(u);
                let (x, size) = (f64::from(sample.offset.x), 1.0 + 2.0 * negative);
                let own = if sample.is_negative { -size } else { size };
                weight += own;
                mean += own * x;
                second += own * x * x;
            }
            let count = f64::from(n * n);
            assert!((weight / count - 1.0).abs() < 4e-3, "{filter:?}: weight {}", weight / count);
            assert!((mean / count).abs() < 2e-3, "{filter:?}");
            assert!(
                (second / count - moment).abs() < 4e-3,
                "{filter:?}: got {}, expected {moment}",
                second / count
            );
        }
    }

    fn moment_of(radius: f64, f: impl Fn(f64) -> f64) -> f64 {
        let xs = (0..20_000).map(|i| (f64::from(i) + 0.5) / 20_000.0 * radius);
        let (zeroth, second) = xs.fold((0.0, 0.0), |(a, b), x| (a + f(x), b + x * x * f(x)));
        second / zeroth
    }

    fn gaussian_moment() -> f64 {
        moment_of(1.5, |x| (-x * x / 0.5).exp() - (-4.5_f64).exp())
    }

    /// The general Mitchell–Netravali cubic with B = C = 1/3.
    fn mitchell_moment() -> f64 {
        let (b, c) = (1.0 / 3.0, 1.0 / 3.0);
        moment_of(2.0, |x| {
            if x < 1.0 {
                (12.0 - 9.0 * b - 6.0 * c) * x.powi(3)
                    + (-18.0 + 12.0 * b + 6.0 * c) * x.powi(2)
                    + (6.0 - 2.0 * b)
            } else {
                (-b - 6.0 * c) * x.powi(3)
                    + (6.0 * b + 30.0 * c) * x.powi(2)
                    + (-12.0 * b - 48.0 * c) * x
                    + (8.0 * b + 24.0 * c)
            }
        })
    }
}
