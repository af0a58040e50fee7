//! Piecewise linear densities.

/// A density on [0, 1] that interpolates linearly between evenly spaced nodes. At the nodes, it is
/// proportional to the values.
#[derive(Clone, Copy, Debug)]
pub struct PiecewiseLinear<const NODES: usize>(pub [f64; NODES]);

impl<const NODES: usize> PiecewiseLinear<NODES> {
    const PIECES: f64 = (NODES - 1) as f64;

    /// Integral over [0, 1] of the interpolated values.
    pub fn integral(&self) -> f64 {
        let inner: f64 = self.0[1..NODES - 1].iter().sum();
        (inner + 0.5 * (self.0[0] + self.0[NODES - 1])) / Self::PIECES
    }

    /// Inverts the cumulative distribution at `u` in [0, 1). Returns the position and its density.
    pub fn sample(&self, u: f64) -> (f64, f64) {
        let integral = self.integral();
        let (mut rest, mut piece) = (u * integral * Self::PIECES, 0);
        while piece < NODES - 2 {
            let own = 0.5 * (self.0[piece] + self.0[piece + 1]);
            if rest < own {
                break;
            }
            (rest, piece) = (rest - own, piece + 1);
        }
        // Solve low·t + (high − low)·t²/2 = rest.
        let (low, high) = (self.0[piece], self.0[piece + 1]);
        let root = (low * low + 2.0 * rest * (high - low)).max(0.0).sqrt();
        let along = if low + root > 0.0 { (2.0 * rest / (low + root)).min(1.0) } else { 0.0 };
        ((piece as f64 + along) / Self::PIECES, (low + (high - low) * along) / integral)
    }

    /// Density at a position.
    pub fn pdf(&self, place: f64) -> f64 {
        let place = place * Self::PIECES;
        let piece = (place as usize).min(NODES - 2);
        let along = (place - piece as f64).min(1.0);
        (self.0[piece] + (self.0[piece + 1] - self.0[piece]) * along) / self.integral()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_follow_the_pdf() {
        for linear in [
            PiecewiseLinear([1.0, 3.0, 0.0, 2.0]),
            PiecewiseLinear([0.0, 0.0, 1.0, 1.0]),
            PiecewiseLinear([5.0; 4]),
        ] {
            let n = 100_000;
            let (mut before, mut integral) = (-1e-9, 0.0);
            for i in 0..n {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                let (place, density) = linear.sample(u);
                assert!((density - linear.pdf(place)).abs() < 1e-9, "{place}");
                assert!(place >= before && place <= 1.0);
                // Check that the density times each step in position equals the step in the random number.
                if i > 0 && density > 0.05 {
                    let middle = linear.pdf(0.5 * (place + before));
                    assert!((middle * (place - before) * f64::from(n) - 1.0).abs() < 0.01, "{place}");
                }
                before = place;
                integral += linear.pdf(u) / f64::from(n);
            }
            assert!((integral - 1.0).abs() < 1e-6, "{integral}");
        }
    }
}
