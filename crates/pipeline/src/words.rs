//! Formats durations, sizes and sample counts for all front ends.

use super::protocol::RenderProgress;

/// Remaining time of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Eta {
    /// Remaining seconds.
    Seconds(f64),
    /// More than a day.
    OverADay,
}

impl Eta {
    /// Returns the remaining time, or `None` if there is no reliable estimate. An estimate is unreliable
    /// during the first 1 % and the first half second of the render.
    pub fn from_progress(progress: &RenderProgress) -> Option<Self> {
        const DAY: f64 = 24.0 * 3600.0;
        let is_early = progress.fraction < 0.01 || progress.elapsed_seconds < 0.5;
        let seconds = progress.eta_seconds.filter(|seconds| !is_early && *seconds >= 0.0)?;
        Some(if seconds > DAY { Self::OverADay } else { Self::Seconds(seconds) })
    }

    /// Formats the time for a line that is seldom redrawn.
    pub fn format(self) -> String {
        match self {
            Self::Seconds(time) => format_seconds(time),
            Self::OverADay => "over a day".to_owned(),
        }
    }
}

/// Formats the average number of samples per pixel, rounded down. Shows tenths if an integer would contradict
/// the displayed percentage.
pub fn format_mean_samples(progress: &RenderProgress) -> String {
    /// With totals of at least this many samples, one sample is at most one percent.
    const FINE: u32 = 100;
    let tenths = (progress.mean_samples * 10.0).floor();
    let has_tenths = progress.total_samples < FINE && tenths % 10.0 != 0.0;
    if has_tenths { format!("{:.1}", tenths / 10.0) } else { format!("{:.0}", progress.mean_samples.floor()) }
}

/// Formats a duration in a few characters.
pub fn format_seconds(seconds: f64) -> String {
    match seconds {
        s if !s.is_finite() || s < 0.0 => "?".to_owned(),
        s if s > 0.0 && s < 0.000_005 => "<0.01 ms".to_owned(),
        s if s < 0.000_95 => format!("{:.2} ms", s * 1e3),
        s if s < 0.009_95 => format!("{:.1} ms", s * 1e3),
        s if s < 0.999_5 => format!("{:.0} ms", s * 1e3),
        s if s < 9.995 => format!("{s:.2} s"),
        s if s < 59.95 => format!("{s:.1} s"),
        s => format_long_duration(s.round() as u64),
    }
}

fn format_long_duration(seconds: u64) -> String {
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, minutes, seconds) => format!("{minutes} min {seconds:02} s"),
        (hours, minutes, _) => format!("{hours} h {minutes:02} min"),
    }
}

/// Formats a size: `1.25 GiB`, `300 MiB`, `12 KiB`, `1 byte`.
pub(crate) fn format_bytes(bytes: u64) -> String {
    match bytes {
        1 => return "1 byte".to_owned(),
        0..1024 => return format!("{bytes} bytes"),
        1024..0x10_0000 => return format!("{} KiB", bytes / 1024),
        0x10_0000.. => {}
    }
    let mib = bytes as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{:.0} MiB", mib.ceil()) } else { format!("{:.2} GiB", mib / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(fraction: f64, elapsed_seconds: f64, eta_seconds: Option<f64>) -> RenderProgress {
        RenderProgress {
            fraction,
            elapsed_seconds,
            earlier_seconds: 0.0,
            eta_seconds,
            samples: 0,
            mean_samples: 0.0,
            total_samples: 64,
            is_total_fixed: true,
            noise: None,
        }
    }

    #[test]
    fn unreliable_or_huge_eta_has_no_duration() {
        let eta = |fraction, elapsed, eta| {
            Eta::from_progress(&progress(fraction, elapsed, Some(eta))).map(Eta::format)
        };
        assert_eq!(eta(0.009, 60.0, 6e3), None);
        assert_eq!(eta(0.4, 0.49, 0.7), None);
        assert_eq!(eta(0.01, 0.5, 49.5).as_deref(), Some("49.5 s"));
        assert_eq!(eta(0.01, 600.0, 86_400.0).as_deref(), Some("24 h 00 min"));
        assert_eq!(eta(0.01, 1e3, 86_401.0).as_deref(), Some("over a day"));
        assert_eq!(eta(0.5, 1e3, f64::INFINITY).as_deref(), Some("over a day"));
        assert_eq!(eta(0.5, 1e3, f64::NAN), None);
        assert_eq!(Eta::from_progress(&progress(0.5, 1e3, None)), None);
    }

    #[test]
    fn sample_count_is_consistent_with_percentage() {
        for (mean, total, words) in [
            (1.72, 4, "1.7"),
            (0.97, 1, "0.9"),
            (1.0, 1, "1"),
            (2.0, 4, "2"),
            (2.04, 4, "2"),
            (0.0, 64, "0"),
            (63.99, 64, "63.9"),
            (43.9, 100, "43"),
        ] {
            let progress =
                RenderProgress { mean_samples: mean, total_samples: total, ..progress(0.5, 1.0, None) };
            assert_eq!(format_mean_samples(&progress), words);
        }
    }

    #[test]
    fn durations_are_formatted_concisely() {
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
            assert_eq!(format_seconds(time), words);
        }
    }
}
