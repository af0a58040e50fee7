//! Sample costs, predicted from earlier samples.

/// Cost of the jobs in a cell, consisting of a cost per sample and an overhead for each pixel in each job.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CellCost {
    seconds: f64,
    /// Number of samples, summed over all pixels.
    units: f64,
    /// Total number of pixels in all jobs.
    pixels: f64,
    last: Option<MeasuredJobCost>,
}

/// Cost of a job in a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeasuredJobCost {
    pub(crate) seconds: f64,
    pub(crate) pixels: f64,
    /// Samples per pixel.
    pub(crate) samples: f64,
}

impl CellCost {
    /// Weight of earlier jobs relative to a new job. It is less than 1 because the first samples cost more
    /// than later ones.
    const KEPT: f64 = 0.25;

    pub(crate) fn record(&mut self, job: MeasuredJobCost, share: &mut PixelOverhead) {
        share.record_job_pair(self.last, job);
        self.seconds = Self::KEPT * self.seconds + job.seconds;
        self.units = Self::KEPT * self.units + job.pixels * job.samples;
        self.pixels = Self::KEPT * self.pixels + job.pixels;
        self.last = Some(job);
    }

    /// Whether the cost is unknown because it has not been measured.
    pub(crate) fn is_unknown(&self) -> bool {
        !(self.units > 0.0)
    }

    pub(crate) fn decayed_seconds_sum(&self) -> f64 {
        self.seconds
    }

    /// The cell's cost as an equivalent number of samples, including the pixel overhead.
    pub(crate) fn cost_in_samples_with_overhead(&self, share: PixelOverhead) -> f64 {
        share.samples_including_overhead(self.units, self.pixels)
    }
}

/// Per-pixel overhead of a job, in addition to the cost of its samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelOverhead {
    /// Sum of the numerators for estimating b, the overhead per pixel in samples. If n' samples in a cell
    /// take s' seconds and n > n' samples take s seconds, then s/s' = (n + b)/(n' + b) and b = (s'n − sn')/(s
    /// − s').
    of_pixels: f64,
    /// Sum of the denominators for estimating b, which is defined at `of_pixels`.
    of_samples: f64,
}

impl PixelOverhead {
    /// Maximum overhead per pixel, in samples.
    const MAX_OVERHEAD: f64 = 4.0;

    fn record_job_pair(&mut self, before: Option<MeasuredJobCost>, now: MeasuredJobCost) {
        if let Some(before) =
            before.filter(|before| before.pixels == now.pixels && before.samples < now.samples)
        {
            self.of_pixels += before.seconds * now.samples - now.seconds * before.samples;
            self.of_samples += now.seconds - before.seconds;
        }
    }

    /// Converts the cost of `units` samples plus the overhead of `pixels` pixels to an equivalent number of
    /// samples.
    pub(crate) fn samples_including_overhead(self, units: f64, pixels: f64) -> f64 {
        let share = if self.of_samples > 0.0 { self.of_pixels / self.of_samples } else { 0.0 };
        units + share.clamp(0.0, Self::MAX_OVERHEAD) * pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_and_sample_costs_are_separated() {
        // Each cell has 100 pixels. A sample takes 1 or 3 seconds, and the pixel overhead is half a sample.
        let (mut share, mut cells) = (PixelOverhead::default(), [CellCost::default(); 2]);
        for samples in [1.0, 1.0, 2.0, 4.0] {
            for (cell, rate) in cells.iter_mut().zip([1.0, 3.0]) {
                let seconds = 100.0 * rate * (samples + 0.5);
                cell.record(MeasuredJobCost { seconds, pixels: 100.0, samples }, &mut share);
            }
        }
        for (cell, rate) in cells.iter().zip([1.0, 3.0]) {
            assert!((share.samples_including_overhead(800.0, 100.0) - 850.0).abs() < 1e-9);
            assert!(
                (cell.decayed_seconds_sum() / cell.cost_in_samples_with_overhead(share) - rate).abs() < 1e-9
            );
        }
    }

    #[test]
    fn implausible_times_are_clamped() {
        let of = |seconds: [f64; 2]| {
            let (mut share, mut cell) = (PixelOverhead::default(), CellCost::default());
            for (seconds, samples) in seconds.into_iter().zip([1.0, 2.0]) {
                cell.record(MeasuredJobCost { seconds, pixels: 1.0, samples }, &mut share);
            }
            share.samples_including_overhead(0.0, 1.0)
        };
        assert_eq!(of([1.0, 2.0]), 0.0);
        assert_eq!(of([1.0, 4.0]), 0.0, "the overhead should not be negative");
        assert_eq!(of([1.0, 0.5]), 0.0, "more samples in less time should be ignored");
        assert_eq!(of([1.0, 1.001]), PixelOverhead::MAX_OVERHEAD);
    }

    #[test]
    fn jobs_of_different_sizes_are_not_compared() {
        let (mut share, mut cell) = (PixelOverhead::default(), CellCost::default());
        // The first job covers a cell, and the second covers half of it with twice the samples.
        for (pixels, samples) in [(2.0, 1.0), (1.0, 2.0)] {
            cell.record(MeasuredJobCost { seconds: pixels * (samples + 1.0), pixels, samples }, &mut share);
        }
        assert_eq!(share.samples_including_overhead(0.0, 1.0), 0.0);
    }

    #[test]
    fn cell_without_pixels_has_unknown_cost() {
        let (mut share, mut cell) = (PixelOverhead::default(), CellCost::default());
        cell.record(MeasuredJobCost { seconds: 1e-6, pixels: 1.0, samples: 1.0 }, &mut share);
        assert!(!cell.is_unknown());
        // Halves without pixels also have jobs.
        for _ in 0..2000 {
            cell.record(MeasuredJobCost { seconds: 1e-9, pixels: 0.0, samples: 32.0 }, &mut share);
        }
        assert!(cell.is_unknown(), "{cell:?}");
    }
}
