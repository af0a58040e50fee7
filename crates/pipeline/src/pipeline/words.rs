//! Amounts in words, the same in every front end.

/// A time in a few characters.
pub fn seconds(seconds: f64) -> String {
    match seconds {
        s if !s.is_finite() || s < 0.0 => "?".to_owned(),
        s if s > 0.0 && s < 0.000_005 => "<0.01 ms".to_owned(),
        s if s < 0.000_95 => format!("{:.2} ms", s * 1e3),
        s if s < 0.009_95 => format!("{:.1} ms", s * 1e3),
        s if s < 0.999_5 => format!("{:.0} ms", s * 1e3),
        s if s < 9.995 => format!("{s:.2} s"),
        s if s < 59.95 => format!("{s:.1} s"),
        s => clock(s.round() as u64),
    }
}

fn clock(seconds: u64) -> String {
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_in_words() {
        for (time, words) in [
            (0.0, "0.00 ms"),
            (0.000_001, "<0.01 ms"),
            (0.0004, "0.40 ms"),
            (0.0042, "4.2 ms"),
            (0.023, "23 ms"),
            (0.999_7, "1.00 s"),
            (1.93, "1.93 s"),
            (59.97, "1 min 00 s"),
            (125.0, "2 min 05 s"),
            (3720.0, "1 h 02 min"),
            (f64::NAN, "?"),
        ] {
            assert_eq!(seconds(time), words);
        }
    }
}
