//! One-dimensional discrete distributions.

/// Samples an index in proportion to its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscreteDistribution {
    /// Inclusive cumulative sums of the weights.
    sums: Vec<f64>,
}

impl DiscreteDistribution {
    /// Creates a distribution from weights ≥ 0, or `None` if their sum is 0 or not finite.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<Self> {
        let sums: Vec<f64> = weights
            .into_iter()
            .scan(0.0, |sum, weight| {
                *sum += weight;
                Some(*sum)
            })
            .collect();
        sums.last().is_some_and(|&total| total > 0.0 && total.is_finite()).then_some(Self { sums })
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Probability of `index`.
    pub fn probability(&self, index: usize) -> f64 {
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        (self.sums[index] - before) / self.total()
    }

    /// Samples an index with `u` in [0, 1). Also returns the relative position, in [0, 1), of `u` within that
    /// index's interval.
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let target = f64::from(u) * self.total();
        let index = self.sums.partition_point(|&sum| sum <= target).min(self.sums.len() - 1);
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        let share = self.sums[index] - before;
        let rest = if share > 0.0 { ((target - before) / share) as f32 } else { 0.0 };
        (index, rest.clamp(0.0, 1.0_f32.next_down()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_sampled_in_proportion_to_weights() {
        let distribution = DiscreteDistribution::new([1.0, 0.0, 3.0, 0.0]).expect("some weight");
        let mut counts = [0; 4];
        let mut rests = 0.0;
        for i in 0..1000 {
            let (index, rest) = distribution.sample((i as f32 + 0.5) / 1000.0);
            counts[index] += 1;
            rests += rest;
        }
        assert_eq!(counts, [250, 0, 750, 0]);
        assert_eq!([0, 1, 2, 3].map(|index| distribution.probability(index)), [0.25, 0.0, 0.75, 0.0]);
        assert!((rests / 1000.0 - 0.5).abs() < 0.01);
        assert_eq!(distribution.sample(1.0_f32.next_down()).0, 2);
        assert_eq!(DiscreteDistribution::new([0.0]), None);
        assert_eq!(DiscreteDistribution::new([]), None);
    }
}
