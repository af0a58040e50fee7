//! Logarithmic axes. Coordinates are base-10 logarithms.

use std::ops::Range;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};

/// Range and tick marks of an axis, as base-10 logarithms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LogAxis {
    pub(super) range: Range<f64>,
    pub(super) marks: Vec<f64>,
}

impl LogAxis {
    /// Creates an axis that spans the positive values and leaves a fraction `free` of its length empty at the
    /// start.
    pub(super) fn spanning(values: impl Iterator<Item = f64>, free: f64) -> Self {
        let logs = values.filter(|value| *value > 0.0 && value.is_finite()).map(libm::log10);
        let (low, high) =
            logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), log| (low.min(log), high.max(log)));
        let (low, high) = if low > high { (-1.0, 1.0) } else { (low, high) };
        let margin = 0.06 * (high - low).max(0.5);
        let length = (high - low + 2.0 * margin) / (1.0 - free);
        let range = high + margin - length..high + margin;
        let powers = |factors: &[f64]| -> Vec<f64> {
            let whole = range.start.floor() as i32..=range.end.ceil() as i32;
            let all = whole
                .flat_map(|power| factors.iter().map(move |factor| f64::from(power) + libm::log10(*factor)));
            all.filter(|mark| range.contains(mark)).collect()
        };
        let marks = powers(&[1.0]);
        let marks = if marks.len() < 3 { powers(&[1.0, 2.0, 5.0]) } else { marks };
        Self { range, marks }
    }
}

impl Ranged for LogAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (begin, end): (i32, i32)) -> i32 {
        let share = (value - self.range.start) / (self.range.end - self.range.start);
        begin + (f64::from(end - begin) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.marks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

/// Formats a mark as `10⁻³`, `2·10⁻³` or `5`.
pub(super) fn format_log_axis_mark(mark: f64) -> String {
    let (factor, whole) = digit_and_exponent_of_log10(mark);
    if whole == 0 {
        return factor.to_string();
    }
    let digits = format!("{whole}").chars().map(superscript_char).collect::<String>();
    if factor == 1 { format!("10{digits}") } else { format!("{factor}·10{digits}") }
}

/// Formats a mark as `0.02`, `5` or `200`.
pub(super) fn format_log_mark_as_decimal(mark: f64) -> String {
    let (factor, whole) = digit_and_exponent_of_log10(mark);
    if (-3..=5).contains(&whole) {
        let decimals = (-whole).max(0) as usize;
        format!("{:.decimals$}", f64::from(factor) * libm::pow(10.0, f64::from(whole)))
    } else {
        format_log_axis_mark(mark)
    }
}

/// Returns the leading digit and exponent of a mark.
fn digit_and_exponent_of_log10(mark: f64) -> (i32, i32) {
    let whole = (mark + 1e-9).floor();
    (libm::pow(10.0, mark - whole).round() as i32, whole as i32)
}

fn superscript_char(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_powers_or_simple_numbers() {
        let far = LogAxis::spanning([1e-5, 0.3].into_iter(), 0.0);
        assert_eq!(far.marks, [-5.0, -4.0, -3.0, -2.0, -1.0]);
        let near = LogAxis::spanning([0.02, 0.3, -1.0, f64::NAN].into_iter(), 0.0);
        let names: Vec<String> = near.marks.iter().map(|mark| format_log_mark_as_decimal(*mark)).collect();
        assert_eq!(names, ["0.02", "0.05", "0.1", "0.2"]);
        let names: Vec<String> = near.marks.iter().map(|mark| format_log_axis_mark(*mark)).collect();
        assert_eq!(names, ["2·10⁻²", "5·10⁻²", "10⁻¹", "2·10⁻¹"]);
        assert_eq!(LogAxis::spanning([].into_iter(), 0.0).marks, [-1.0, 0.0, 1.0]);
        let half = LogAxis::spanning([1e-2, 1.0].into_iter(), 0.5).range;
        assert!((half.start + 4.36).abs() < 1e-9 && (half.end - 0.12).abs() < 1e-9, "{half:?}");
        assert_eq!(format_log_axis_mark(libm::log10(5.0)), "5");
        assert_eq!(
            (format_log_mark_as_decimal(2.0).as_str(), format_log_mark_as_decimal(-12.0).as_str()),
            ("100", "10⁻¹²")
        );
    }
}
