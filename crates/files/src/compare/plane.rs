//! Scalar planes for tiles, and separable filters.

/// Scalars in row-major order.
#[derive(Clone, Debug)]
pub(super) struct Plane {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f64>,
}

impl Plane {
    pub(super) fn zero(width: usize, height: usize) -> Self {
        Self { width, height, values: vec![0.0; width * height] }
    }

    /// Elementwise product of two planes.
    pub(super) fn elementwise_product(&self, other: &Self) -> Self {
        let values = self.values.iter().zip(&other.values).map(|(a, b)| a * b).collect();
        Self { values, ..*self }
    }

    /// Filters rows and columns. Pixels whose taps are not all inside the plane are dropped, which shrinks
    /// the plane by `taps − 1` in both dimensions.
    pub(super) fn filtered(&self, along_rows: &[f64], along_columns: &[f64]) -> Self {
        self.filter_along_rows(along_rows).filter_along_columns(along_columns)
    }

    /// Filters along rows.
    pub(super) fn filter_along_rows(&self, taps: &[f64]) -> Self {
        let mut out = Self::zero(self.width + 1 - taps.len(), self.height);
        for (row, out) in self.values.chunks_exact(self.width).zip(out.values.chunks_exact_mut(out.width)) {
            let shifted: Vec<_> = row.windows(out.len()).collect();
            add_weighted_rows(out, &shifted, taps);
        }
        out
    }

    /// Filters along columns.
    pub(super) fn filter_along_columns(&self, taps: &[f64]) -> Self {
        let mut out = Self::zero(self.width, self.height + 1 - taps.len());
        let rows: Vec<_> = self.values.chunks_exact(self.width).collect();
        for (out, rows) in out.values.chunks_exact_mut(self.width).zip(rows.windows(taps.len())) {
            add_weighted_rows(out, rows, taps);
        }
        out
    }
}

/// Adds rows multiplied by their taps. Processes four rows at a time to reduce loads and stores of the sums.
fn add_weighted_rows(sums: &mut [f64], rows: &[&[f64]], taps: &[f64]) {
    let (fours, rest) = taps.as_chunks();
    let (fours_of_rows, rest_of_rows) = rows.as_chunks();
    for ([t, u, v, w], [a, b, c, d]) in fours.iter().zip(fours_of_rows) {
        let values = a.iter().zip(*b).zip(*c).zip(*d);
        for (sum, (((a, b), c), d)) in sums.iter_mut().zip(values) {
            *sum += (t * a + u * b) + (v * c + w * d);
        }
    }
    for (tap, row) in rest.iter().zip(rest_of_rows) {
        for (sum, value) in sums.iter_mut().zip(*row) {
            *sum += tap * value;
        }
    }
}

/// exp(−x²/2σ²) at integer pixel offsets from −radius to radius.
pub(super) fn unnormalized_gaussian_taps(sigma: f64, radius: usize) -> Vec<f64> {
    tap_offsets(radius).map(|x| libm::exp(-x * x / (2.0 * sigma * sigma))).collect()
}

/// −radius … radius.
pub(super) fn tap_offsets(radius: usize) -> impl Iterator<Item = f64> {
    let radius = radius as i32;
    (-radius..=radius).map(f64::from)
}

/// Scales taps to a sum of 1.
pub(super) fn normalized_taps(taps: &[f64]) -> Vec<f64> {
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|tap| tap / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_weight_neighbors() {
        let plane = Plane { width: 4, height: 3, values: (0..12).map(f64::from).collect() };
        let rows = plane.filter_along_rows(&[1.0, 10.0, 100.0]);
        assert_eq!((rows.width, rows.height), (2, 3));
        assert_eq!(rows.values, [210.0, 321.0, 654.0, 765.0, 1098.0, 1209.0]);
        let columns = plane.filter_along_columns(&[1.0, 10.0]);
        assert_eq!((columns.width, columns.height), (4, 2));
        assert_eq!(columns.values, [40.0, 51.0, 62.0, 73.0, 84.0, 95.0, 106.0, 117.0]);
        let row = Plane { width: 12, height: 1, ..plane };
        let taps: Vec<_> = (0..6).map(|power| f64::from(8_i32.pow(power))).collect();
        let sum = |start: usize| (0..6).map(|i| (start + i) as f64 * taps[i]).sum::<f64>();
        let sums: Vec<_> = (0..7).map(sum).collect();
        assert_eq!(row.filter_along_rows(&taps).values, sums);
    }

    #[test]
    fn gaussian_taps_match_known_values() {
        let taps = normalized_taps(&unnormalized_gaussian_taps(1.5, 5));
        assert_eq!(taps.len(), 11);
        assert!((taps[5] - 0.266_011_7).abs() < 1e-7 && (taps[0] - 0.001_028_4).abs() < 1e-7, "{taps:?}");
    }
}
