//! Cost of samples, predicted from those before them.

/// Cost of the jobs in a cell: a part for each sample of a pixel, and a part for each pixel of a job.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CellCost {
    seconds: f64,
    /// Pixels times samples.
    units: f64,
    /// Pixels, in each job anew.
    pixels: f64,
    last: Option<JobCost>,
}

/// Cost of a job in a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JobCost {
    pub(crate) seconds: f64,
    pub(crate) pixels: f64,
    /// Samples of each pixel.
    pub(crate) samples: f64,
}

impl CellCost {
    /// Weight of earlier jobs beside a new one: the first samples cost more than those of later passes.
    const KEPT: f64 = 0.25;

    pub(crate) fn note(&mut self, job: JobCost, share: &mut PixelShare) {
        share.note(self.last, job);
        self.seconds = Self::KEPT * self.seconds + job.seconds;
        self.units = Self::KEPT * self.units + job.pixels * job.samples;
        self.pixels = Self::KEPT * self.pixels + job.pixels;
        self.last = Some(job);
    }

    /// Whether nothing is known of it.
    pub(crate) fn is_unknown(&self) -> bool {
        !(self.units > 0.0)
    }

    pub(crate) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Samples that the cell's seconds were spent on; pixels count for their share.
    pub(crate) fn worth(&self, share: PixelShare) -> f64 {
        share.worth(self.units, self.pixels)
    }
}

/// Cost of a pixel in a job, beside its samples.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PixelShare {
    /// A cell had n' samples in s' seconds, then n > n' in s. If a pixel costs as much as b samples, s/s' = (n + b)/(n' + b), so that
    /// b = (s'n − sn')/(s − s'). The sum of the numerators.
    of_pixels: f64,
    /// The sum of the denominators.
    of_samples: f64,
}

impl PixelShare {
    /// The most that is believed, in samples.
    const MOST: f64 = 4.0;

    fn note(&mut self, before: Option<JobCost>, now: JobCost) {
        if let Some(before) =
            before.filter(|before| before.pixels == now.pixels && before.samples < now.samples)
        {
            self.of_pixels += before.seconds * now.samples - now.seconds * before.samples;
            self.of_samples += now.seconds - before.seconds;
        }
    }

    /// Samples that would cost as much as jobs of so many samples (`units`) and pixels.
    pub(crate) fn worth(self, units: f64, pixels: f64) -> f64 {
        let share = if self.of_samples > 0.0 { self.of_pixels / self.of_samples } else { 0.0 };
        units + share.clamp(0.0, Self::MOST) * pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_pixels_take_is_told_apart_from_what_samples_take() {
        // Cells of 100 pixels, where a sample takes 1 and 3 seconds, and a pixel as much as half a sample.
        let (mut share, mut cells) = (PixelShare::default(), [CellCost::default(); 2]);
        for samples in [1.0, 1.0, 2.0, 4.0] {
            for (cell, rate) in cells.iter_mut().zip([1.0, 3.0]) {
                let seconds = 100.0 * rate * (samples + 0.5);
                cell.note(JobCost { seconds, pixels: 100.0, samples }, &mut share);
            }
        }
        for (cell, rate) in cells.iter().zip([1.0, 3.0]) {
            assert!((share.worth(800.0, 100.0) - 850.0).abs() < 1e-9);
            assert!((cell.seconds() / cell.worth(share) - rate).abs() < 1e-9);
        }
    }

    #[test]
    fn chance_in_the_seconds_is_not_believed() {
        let of = |seconds: [f64; 2]| {
            let (mut share, mut cell) = (PixelShare::default(), CellCost::default());
            for (seconds, samples) in seconds.into_iter().zip([1.0, 2.0]) {
                cell.note(JobCost { seconds, pixels: 1.0, samples }, &mut share);
            }
            share.worth(0.0, 1.0)
        };
        assert_eq!(of([1.0, 2.0]), 0.0);
        assert_eq!(of([1.0, 4.0]), 0.0, "more than twice as long for twice as many");
        assert_eq!(of([1.0, 0.5]), 0.0, "less for more");
        assert_eq!(of([1.0, 1.001]), PixelShare::MOST);
    }

    #[test]
    fn jobs_of_other_pixels_are_not_compared() {
        let (mut share, mut cell) = (PixelShare::default(), CellCost::default());
        // A cell, then a half of it: as long for as many samples.
        for (pixels, samples) in [(2.0, 1.0), (1.0, 2.0)] {
            cell.note(JobCost { seconds: pixels * (samples + 1.0), pixels, samples }, &mut share);
        }
        assert_eq!(share.worth(0.0, 1.0), 0.0);
    }

    #[test]
    fn a_cell_without_pixels_tells_nothing() {
        let (mut share, mut cell) = (PixelShare::default(), CellCost::default());
        cell.note(JobCost { seconds: 1e-6, pixels: 1.0, samples: 1.0 }, &mut share);
        assert!(!cell.is_unknown());
        // A half without pixels gets jobs too.
        for _ in 0..2000 {
            cell.note(JobCost { seconds: 1e-9, pixels: 0.0, samples: 32.0 }, &mut share);
        }
        assert!(cell.is_unknown(), "{cell:?}");
    }
}
