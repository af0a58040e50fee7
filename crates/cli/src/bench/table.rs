//! Formats results as a table that fits 80 columns.

use super::results::{
    BiasVerdict, MethodAnalysis, ReferenceResult, Results, SceneResult, StepResult, TARGETS,
};
use super::slope::{ErrorOverTimeSlope, TimeToError};
use crate::pipeline::words;

/// Formats the results as lines.
pub fn format_results(results: &Results) -> Vec<String> {
    let mut lines: Vec<String> = results.scenes.iter().flat_map(format_scene).collect();
    lines
        .push("Times and relMSE are medians over seeds; \"least\" and \"greatest\" are the range".to_owned());
    lines.push("of relMSE. time × relMSE is constant for an unbiased method.".to_owned());
    lines
}

fn format_scene(scene: &SceneResult) -> Vec<String> {
    let seeds = scene.methods.iter().flat_map(|method| &method.steps).map(|step| step.pictures.len()).max();
    let mut lines = vec![
        format!("{}, {}×{} pixels, {} seeds", scene.scene, scene.width, scene.height, seeds.unwrap_or(0)),
        format_references(&scene.reference, scene),
        String::new(),
    ];
    let width = scene.methods.iter().map(|method| method.name.chars().count()).max().unwrap_or(0).max(6);
    lines.push(format!(
        "{:<width$} {:>8} {:>9}  {:>9} {:>9} {:>9} {:>10}",
        "method", "samples", "seconds", "relMSE", "least", "greatest", "s × relMSE"
    ));
    for method in &scene.methods {
        lines.extend(method.steps.iter().map(|step| format_step_row(&method.name, step, width)));
    }
    lines.push(String::new());
    for method in &scene.methods {
        lines.push(format!("{}: {}", method.name, format_setup_and_slope(method)));
        lines.extend(
            format_method_target_times(method)
                .into_iter()
                .chain([describe_bias(method)])
                .chain(describe_brightness(method))
                .map(|line| format!("  {line}")),
        );
    }
    lines.push(String::new());
    lines
}

fn format_references(reference: &ReferenceResult, scene: &SceneResult) -> String {
    let noise = format!("noise {}", format_error_or_near_zero(reference.noise));
    let Some(samples) = reference.samples else {
        return match reference.files.as_slice() {
            [one] => format!("reference: {one} (a single reference, so its noise counts as error)"),
            files => format!("references: {}, {noise}", files.join(" and ")),
        };
    };
    let steps = scene.methods.iter().flat_map(|method| &method.steps);
    let most = steps.map(|step| step.samples).fold(1.0, f64::max);
    let times = format!("{:.0} × the largest step", samples / most);
    let cached = if reference.is_cached { ", cached" } else { "" };
    format!("references: path, 2 × {samples:.0} samples ({times}), {noise}{cached}")
}

fn format_step_row(name: &str, step: &StepResult, width: usize) -> String {
    let [least, most] = step.spread;
    format!(
        "{name:<width$} {:>8} {:>9}  {:>9} {:>9} {:>9} {:>10}",
        format_sample_count(step.samples),
        words::format_seconds(step.seconds),
        format_error_or_near_zero(step.relmse),
        format_error_or_near_zero(least),
        format_error_or_near_zero(most),
        format_error_or_near_zero(step.seconds * step.relmse)
    )
}

/// Formats a sample count, without decimals for integers.
fn format_sample_count(samples: f64) -> String {
    if samples.fract() == 0.0 { format!("{samples:.0}") } else { format!("{samples:.1}") }
}

/// Formats an error with three digits. Errors of 0 or less, which are below the noise of the references, are
/// shown as ≈ 0.
pub(super) fn format_error_or_near_zero(value: f64) -> String {
    if value > 0.0 { format!("{value:.2e}") } else { "≈ 0".to_owned() }
}

fn format_setup_and_slope(method: &MethodAnalysis) -> String {
    let slope = method.slope.map_or(String::new(), |slope| format!(", slope {}", format_slope(slope)));
    format!("setup {}{slope}", words::format_seconds(method.setup_seconds))
}

/// Describes how long it takes to reach each target error.
fn format_method_target_times(method: &MethodAnalysis) -> Option<String> {
    let times = TARGETS.iter().zip(method.time_to).filter_map(|(target, time)| Some((target, time?)));
    let parts = times.map(|(target, TimeToError { seconds, is_measured })| {
        let about = if is_measured { "" } else { "about " };
        format!("{target:.0e} in {about}{}", words::format_seconds(seconds))
    });
    let parts: Vec<String> = parts.collect();
    (!parts.is_empty()).then(|| format!("relMSE {}", parts.join(", ")))
}

/// Formats a sample count with its unit, as in `1 sample`.
pub(super) fn format_samples_with_unit(samples: f64) -> String {
    format!("{} sample{}", format_sample_count(samples), if samples == 1.0 { "" } else { "s" })
}

/// Formats a slope, as in `−0.98 ± 0.02`.
pub(super) fn format_slope(ErrorOverTimeSlope { value, error }: ErrorOverTimeSlope) -> String {
    let sign = if value < 0.0 { "−" } else { "" };
    format!("{sign}{:.2} ± {error:.2}", value.abs())
}

/// Describes a method's bias.
fn describe_bias(method: &MethodAnalysis) -> String {
    let at = method
        .steps
        .last()
        .map_or(String::new(), |step| format!(" at {}", format_samples_with_unit(step.samples)));
    let percent = |share: f64| format!("{:.0} % of the error", share * 100.0);
    match method.verdict {
        BiasVerdict::Unknown => "too few seeds to detect a bias".to_owned(),
        BiasVerdict::NoneFound { bound } => {
            format!("no bias in relMSE, below {}{at}", format_error_or_near_zero(bound))
        }
        BiasVerdict::Falls { size, share } => {
            format!(
                "bias that decreases with samples: {}, {}{at}",
                format_error_or_near_zero(size),
                percent(share)
            )
        }
        BiasVerdict::Stays { size, share } => {
            let last = method
                .last_slope
                .map_or(String::new(), |slope| format!(", last slope {}", format_slope(slope)));
            format!("BIAS: {}, {}{at}{last}", format_error_or_near_zero(size), percent(share))
        }
    }
}

/// Describes how the mean luminance at the last step differs from the references.
fn describe_brightness(method: &MethodAnalysis) -> Option<String> {
    let brightness = method.steps.last()?.brightness?;
    let percent = |part: f64| format!("{:.2} %", 100.0 * part.abs());
    let side = if brightness.value < 0.0 { "below" } else { "above" };
    let figures =
        format!("{} ± {} {side} the references", percent(brightness.value), percent(brightness.error));
    Some(match brightness.is_biased() {
        true => format!("BIAS in mean luminance: {figures}"),
        false => format!("mean luminance: {figures} (noise)"),
    })
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::synthetic_results;
    use super::*;

    #[test]
    fn table_fits_80_columns_and_reports_bias() {
        let lines = format_results(&synthetic_results());
        assert!(lines.iter().all(|line| line.chars().count() <= 80), "{}", lines.join("\n"));
        assert_eq!(lines[0], "a.toml, 128×96 pixels, 3 seeds");
        assert_eq!(lines[1], "references: path, 2 × 4096 samples (64 × the largest step), noise 1.00e-5");
        assert_eq!(lines[3], "method   samples   seconds     relMSE     least  greatest s × relMSE");
        assert_eq!(lines[4], "path           1     10 ms    2.00e-1   1.80e-1   2.20e-1    2.00e-3");
        assert_eq!(lines[13], "path: setup 3.0 ms, slope −1.00 ± 0.00");
        assert_eq!(lines[14], "  relMSE 1e-2 in 200 ms, 1e-3 in about 2.00 s, 1e-4 in about 20.0 s");
        assert_eq!(lines[15], "  no bias in relMSE, below 1.00e-8 at 64 samples");
        assert_eq!(lines[16], "  mean luminance: 1.00 % ± 0.10 % below the references (noise)");
        assert!(
            lines[18].starts_with("  BIAS: 1.00e-2, 97 % of the error at 64 samples, last slope −0.0"),
            "{}",
            lines[18]
        );
        assert_eq!(lines[19], "  BIAS in mean luminance: 1.00 % ± 0.10 % below the references");
    }

    #[test]
    fn errors_below_noise_are_shown_as_zero() {
        assert_eq!(
            (format_error_or_near_zero(-1e-9).as_str(), format_error_or_near_zero(0.0123).as_str()),
            ("≈ 0", "1.23e-2")
        );
        assert_eq!((format_sample_count(16.0).as_str(), format_sample_count(16.25).as_str()), ("16", "16.2"));
    }
}
