//! Piecewise-constant distributions over the cells of a grid.

/// Samples a row and then a column within the row, in proportion to the weights. Every cell with a nonzero
/// weight has a minimum probability relative to its row's mean, so that it can be sampled with `f32` random
/// numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant2D {
    columns: usize,
    /// For each row, the cumulative probability of all previous rows. The last element is 1.
    rows: Vec<f32>,
    /// Cumulative column probabilities within each row, `columns + 1` values per row.
    in_row: Vec<f32>,
    /// Guide tables for finding a row, and for finding a column within each row; see [`guide_table`].
    row_guide: Vec<u32>,
    column_guide: Vec<u32>,
}

/// A sampled point on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridSample {
    /// The cell's column.
    pub column: usize,
    /// The cell's row.
    pub row: usize,
    /// Position within the cell, along the row and across it, in [0, 1).
    pub rest: [f32; 2],
}

/// Minimum probability of a cell or row with a nonzero weight, relative to the mean probability.
const MIN_RELATIVE_PROBABILITY: f64 = 1.0 / 64.0;

impl PiecewiseConstant2D {
    /// Creates a distribution from rows of weights ≥ 0, all of the same length. Returns `None` if their sum
    /// is 0 or not finite.
    pub fn new(columns: usize, rows: impl Iterator<Item = Vec<f64>>) -> Option<Self> {
        let (mut in_row, mut totals) = (Vec::new(), Vec::new());
        for weights in rows {
            totals.push(append_normalized_cdf(&weights, &mut in_row));
        }
        let mut rows = Vec::new();
        let total = append_normalized_cdf(&totals, &mut rows);
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let row_guide = guide_table(&rows).collect();
        let column_guide = in_row.chunks(columns + 1).flat_map(guide_table).collect();
        Some(Self { columns, rows, in_row, row_guide, column_guide })
    }

    /// Samples a point with two numbers in [0, 1): the first selects the column, the second the row.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> GridSample {
        let (row, across) = find_interval_and_position(&self.rows, &self.row_guide, u[1]);
        let guide = &self.column_guide[row * self.columns..(row + 1) * self.columns];
        let (column, along) = find_interval_and_position(self.cumulative_sums_of_row(row), guide, u[0]);
        GridSample { column, row, rest: [along, across] }
    }

    /// Probability of sampling `row`.
    #[inline(always)]
    pub fn row_probability(&self, row: usize) -> f32 {
        self.rows[row + 1] - self.rows[row]
    }

    /// Probability of sampling `column` within its row.
    #[inline(always)]
    pub fn column_probability_in_row(&self, row: usize, column: usize) -> f32 {
        let sums = self.cumulative_sums_of_row(row);
        sums[column + 1] - sums[column]
    }

    #[inline(always)]
    fn cumulative_sums_of_row(&self, row: usize) -> &[f32] {
        let start = row * (self.columns + 1);
        &self.in_row[start..=start + self.columns]
    }
}

/// Appends the normalized exclusive cumulative sums of the weights, followed by 1, and returns the total
/// weight.
fn append_normalized_cdf(weights: &[f64], sums: &mut Vec<f32>) -> f64 {
    let total: f64 = weights.iter().sum();
    let least = total / weights.len().max(1) as f64 * MIN_RELATIVE_PROBABILITY;
    let weight = |weight: f64| if weight > 0.0 { weight.max(least) } else { 0.0 };
    let raised: f64 = weights.iter().map(|&one| weight(one)).sum();
    let mut sum = 0.0;
    sums.push(0.0);
    for &one in weights {
        sum += weight(one);
        sums.push(if raised > 0.0 { (sum / raised) as f32 } else { 0.0 });
    }
    total
}

/// Guide table: divides [0, 1) into as many equal parts as there are intervals and yields the interval at the
/// start of each part (Chen and Asau, *On Generating Random Variates from an Empirical Distribution*, 1974).
fn guide_table(sums: &[f32]) -> impl Iterator<Item = u32> {
    let (count, mut place) = (sums.len() - 1, 0);
    (0..count).map(move |part| {
        place = find_interval_forward(sums, place, part as f32 / count as f32);
        place as u32
    })
}

/// Finds the last interval that starts at or before `u`, searching forward from `place`. The result is
/// usually `place` or the next interval, so the first two steps avoid unpredictable branches.
#[inline(always)]
fn find_interval_forward(sums: &[f32], mut place: usize, u: f32) -> usize {
    for _ in 0..2 {
        let next = (place + 1).min(sums.len() - 2);
        place = if sums[next] <= u { next } else { place };
    }
    while place + 2 < sums.len() && sums[place + 1] <= u {
        place += 1;
    }
    place
}

/// Finds the interval that contains `u` in [0, 1), and the relative position of `u` within it, in [0, 1).
#[inline(always)]
fn find_interval_and_position(sums: &[f32], guide: &[u32], u: f32) -> (usize, f32) {
    // Rounding may select the part after the correct part, so start one part earlier.
    let part = ((u * guide.len() as f32) as usize).saturating_sub(1);
    let first = find_interval_forward(sums, guide[part] as usize, u);
    let rest = (u - sums[first]) / (sums[first + 1] - sums[first]);
    const LAST: f32 = 1.0_f32.next_down();
    (first, if rest < LAST { rest } else { LAST })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_sampled_in_proportion_to_weights() {
        let weights = [[0.0, 1.0, 0.0, 3.0], [0.0; 4], [4.0, 0.0, 8.0, 0.0]];
        let grid = PiecewiseConstant2D::new(4, weights.iter().map(|row| row.to_vec())).expect("some weight");
        let mut counts = [[0; 4]; 3];
        let mut rests = [0.0; 2];
        let side = 256;
        for (i, j) in (0..side).flat_map(|j| (0..side).map(move |i| (i, j))) {
            let at = |k: i32| (k as f32 + 0.5) / side as f32;
            let GridSample { column, row, rest } = grid.sample([at(i), at(j)]);
            counts[row][column] += 1;
            rests = [rests[0] + rest[0], rests[1] + rest[1]];
        }
        let all = f64::from(side * side);
        for (row, column) in (0..3).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let share = f64::from(counts[row][column]) / all;
            assert!((share - weights[row][column] / 16.0).abs() < 1e-2, "{row} {column}: {share}");
            let known = grid.row_probability(row) * grid.column_probability_in_row(row, column);
            assert!((f64::from(known) - weights[row][column] / 16.0).abs() < 1e-7, "{row} {column}: {known}");
            assert_eq!(counts[row][column] == 0, weights[row][column] == 0.0);
        }
        assert!(rests.iter().all(|rest| (f64::from(*rest) / all - 0.5).abs() < 1e-2), "{rests:?}");
        let last = grid.sample([1.0_f32.next_down(); 2]);
        assert_eq!((last.column, last.row), (2, 2));
        assert_eq!((grid.sample([0.0; 2]).column, grid.sample([0.0; 2]).row), (1, 0));
    }

    #[test]
    fn dark_cells_in_bright_rows_are_reachable() {
        let mut row = vec![1e-3; 4096];
        row[77] = 1e12;
        let grid = PiecewiseConstant2D::new(4096, [row].into_iter()).expect("some weight");
        for column in [0, 76, 78, 4095] {
            let probability = grid.column_probability_in_row(0, column);
            assert!(probability > 1e-6, "{column}: {probability}");
        }
        assert!(grid.column_probability_in_row(0, 77) > 0.98);
    }

    #[test]
    fn find_returns_the_interval_containing_u() {
        for count in [1_usize, 2, 3, 7, 64, 1000] {
            let weight = |i: usize| match i % 5 {
                0 | 3 => 0.0,
                1 => 1.0,
                _ => 1e-3 * (i * i) as f64,
            };
            let mut sums = Vec::new();
            append_normalized_cdf(&(0..count).map(|i| weight(i + 1)).collect::<Vec<_>>(), &mut sums);
            let guide: Vec<u32> = guide_table(&sums).collect();
            let borders =
                sums[..count].iter().flat_map(|&sum| [sum.next_down().max(0.0), sum, sum.next_up()]);
            let even = (0..10_000).map(|i| i as f32 / 1e4);
            for u in borders.chain(even).filter(|u| *u < 1.0) {
                let expected = (0..count).rev().find(|&i| sums[i] <= u).expect("sums should start at 0");
                assert_eq!(find_interval_and_position(&sums, &guide, u).0, expected, "{u} of {count}");
            }
        }
    }

    #[test]
    fn empty_grids_have_no_distribution() {
        assert_eq!(PiecewiseConstant2D::new(2, [vec![0.0, 0.0]].into_iter()), None);
        assert_eq!(PiecewiseConstant2D::new(2, std::iter::empty()), None);
    }
}
