//! Rounds numbers to a few decimals for display.

/// Rounds to a multiple of `step` (a power of ten) and returns the `f64` nearest to the result.
pub fn round_to_step(number: f64, step: f64) -> f64 {
    let digits = libm::round(-libm::log10(step)).max(0.0) as usize;
    let whole = libm::round(number / step) * step;
    format!("{whole:.digits$}").parse().unwrap_or(whole) + 0.0
}

/// Decimal step for rounding coordinates at `distance` from the viewpoint: a power of ten between 1e-5 and
/// 1e-4 times the distance.
pub fn decimal_step_for_distance(distance: f64) -> f64 {
    libm::pow(10.0, libm::floor(libm::log10(distance)) - 4.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_numbers_are_short_and_accurate() {
        for (number, step, text) in [
            (1.234_567, 1e-4, "1.2346"),
            (-1e-9, 1e-4, "0"),
            (0.1 + 0.2, 1e-4, "0.3"),
            (1234.5, 10.0, "1230"),
        ] {
            assert_eq!(round_to_step(number, step).to_string(), text);
        }
        for distance in [0.003, 1.0, 4.0, 9.99, 12_345.0] {
            let error = decimal_step_for_distance(distance) / 2.0 / distance;
            assert!((4e-6..=5.1e-5).contains(&error), "{distance}: {error}");
        }
    }
}
