//! Compares results with a baseline and tests the differences for significance.

use super::results::{MethodAnalysis, Results, StepResult};
use super::statistics::{student_t_tail, student_t_upper_quantile, welch_difference};

/// Family-wise false positive rate for the whole table.
const FALSE_POSITIVE_RATE: f64 = 0.01;

/// Change in a method's time or error on a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodQuantityChange {
    /// Name of the scene.
    pub scene: String,
    /// Name of the method.
    pub method: String,
    /// The compared quantity.
    pub quantity: ComparedQuantity,
    /// Ratio of the new value to the old value, as the geometric mean over all steps.
    pub factor: f64,
    /// 95 % confidence interval for the factor.
    pub interval: [f64; 2],
    /// Two-sided p-value for the change.
    pub p_value: f64,
    /// Whether the change is significant, after a Bonferroni correction for all comparisons.
    pub is_significant: bool,
}

/// Quantities to compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComparedQuantity {
    /// Rendering time in seconds.
    Seconds,
    /// relMSE.
    Error,
}

/// Compares the scenes, methods and steps that occur in both runs. Matches scenes by name and size, methods
/// by name, and steps by sample count or time budget.
pub fn compare_runs(then: &Results, now: &Results) -> Vec<MethodQuantityChange> {
    let mut changes = Vec::new();
    for scene in &now.scenes {
        let is_same = |other: &&super::SceneResult| {
            (&other.scene, other.width, other.height) == (&scene.scene, scene.width, scene.height)
        };
        let Some(before) = then.scenes.iter().find(is_same) else { continue };
        for method in &scene.methods {
            let Some(old) = before.methods.iter().find(|old| old.name == method.name) else { continue };
            for quantity in [ComparedQuantity::Seconds, ComparedQuantity::Error] {
                changes.extend(method_change(&scene.scene, old, method, quantity));
            }
        }
    }
    let threshold = FALSE_POSITIVE_RATE / changes.len().max(1) as f64;
    changes.iter_mut().for_each(|change| change.is_significant = change.p_value < threshold);
    changes
}

fn method_change(
    scene: &str,
    then: &MethodAnalysis,
    now: &MethodAnalysis,
    quantity: ComparedQuantity,
) -> Option<MethodQuantityChange> {
    let pairs = now.steps.iter().filter_map(|step| Some((find_matching_step(step, &then.steps)?, step)));
    let differences: Vec<(f64, f64, f64)> =
        pairs.filter_map(|(old, new)| log_difference_and_standard_error(old, new, quantity)).collect();
    let count = differences.len() as f64;
    let mean = differences.iter().map(|(difference, ..)| difference).sum::<f64>() / count;
    let variances = || differences.iter().map(|(_, error, freedom)| (error * error, freedom));
    let variance: f64 = variances().map(|(square, _)| square).sum();
    let weights: f64 = variances().map(|(square, freedom)| square * square / freedom).sum();
    let error = variance.sqrt() / count;
    let freedom = if weights > 0.0 { variance * variance / weights } else { 1.0 };
    let p_value = match (error > 0.0, mean == 0.0) {
        (true, _) => 2.0 * student_t_tail(mean.abs() / error, freedom),
        (false, true) => 1.0,
        (false, false) => 0.0,
    };
    let reach = student_t_upper_quantile(0.025, freedom) * error;
    (count > 0.0).then(|| MethodQuantityChange {
        scene: scene.to_owned(),
        method: now.name.clone(),
        quantity,
        factor: libm::exp(mean),
        interval: [libm::exp(mean - reach), libm::exp(mean + reach)],
        p_value,
        is_significant: false,
    })
}

/// The baseline's step with the same sample count or time budget.
fn find_matching_step<'a>(step: &StepResult, then: &'a [StepResult]) -> Option<&'a StepResult> {
    then.iter().find(|old| match (step.budget, old.budget) {
        (None, None) => old.samples == step.samples,
        (now, then) => now == then,
    })
}

/// Difference between two steps' mean log times or mean log errors, with its standard error and degrees of
/// freedom, or `None` if a step has fewer than two positive values.
fn log_difference_and_standard_error(
    then: &StepResult,
    now: &StepResult,
    quantity: ComparedQuantity,
) -> Option<(f64, f64, f64)> {
    let of = |step: &StepResult| -> Vec<f64> {
        let values = step.pictures.iter().map(|picture| match quantity {
            ComparedQuantity::Seconds => picture.seconds,
            ComparedQuantity::Error => picture.relmse,
        });
        values.filter(|value| *value > 0.0).map(libm::log).collect()
    };
    let (old, new) = (of(then), of(now));
    if old.len() < 2 || new.len() < 2 {
        return None;
    }
    // Identical images have identical errors, so the difference is exactly 0.
    if old == new { Some((0.0, 0.0, 1.0)) } else { Some(welch_difference(&old, &new)) }
}

/// Formats the comparison as lines.
pub fn format_changes(changes: &[MethodQuantityChange], name: &str) -> Vec<String> {
    if changes.is_empty() {
        return vec![format!("{name} shares no combination of scene, size, method and step with this run")];
    }
    let mut lines = vec![format!("compared with {name}, 95 % confidence intervals:")];
    lines.extend(changes.iter().map(format_change));
    let sure = (1.0 - FALSE_POSITIVE_RATE) * 100.0;
    lines.push(format!(
        "SLOWER, WORSE, faster and better mark changes significant at {sure:.0} % over all lines."
    ));
    lines
}

fn format_change(change: &MethodQuantityChange) -> String {
    let MethodQuantityChange { scene, method, factor, interval: [low, high], .. } = change;
    let quantity = match change.quantity {
        ComparedQuantity::Seconds => "time",
        ComparedQuantity::Error => "error",
    };
    let said = match (change.is_significant, change.quantity, *factor > 1.0) {
        (false, _, _) if change.p_value >= 1.0 => "unchanged".to_owned(),
        (false, _, _) => "noise".to_owned(),
        (true, ComparedQuantity::Seconds, true) => format!("SLOWER {}", format_p_value(change.p_value)),
        (true, ComparedQuantity::Seconds, false) => format!("faster {}", format_p_value(change.p_value)),
        (true, ComparedQuantity::Error, true) => format!("WORSE {}", format_p_value(change.p_value)),
        (true, ComparedQuantity::Error, false) => format!("better {}", format_p_value(change.p_value)),
    };
    format!("  {scene}, {method}: {quantity} × {factor:.3} ({low:.3} to {high:.3}): {said}")
}

fn format_p_value(probability: f64) -> String {
    if probability < 1e-6 { "(p < 1e-6)".to_owned() } else { format!("(p = {probability:.0e})") }
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::synthetic_results;
    use super::*;

    fn with(scale: impl Fn(&mut super::super::ImageMeasurement, usize)) -> Results {
        let mut changed = synthetic_results();
        for method in changed.scenes.iter_mut().flat_map(|scene| &mut scene.methods) {
            for step in &mut method.steps {
                (0..).zip(&mut step.pictures).for_each(|(number, picture)| scale(picture, number));
            }
        }
        changed
    }

    #[test]
    fn identical_runs_have_no_changes() {
        let found = compare_runs(&synthetic_results(), &synthetic_results());
        assert_eq!(found.len(), 2 * 2 * 2);
        assert!(
            found
                .iter()
                .all(|change| !change.is_significant && change.factor == 1.0 && change.p_value == 1.0)
        );
        assert!(format_changes(&found, "old.json")[1].ends_with("time × 1.000 (1.000 to 1.000): unchanged"));
    }

    #[test]
    fn large_changes_are_significant() {
        let slower = with(|picture, _| picture.seconds *= 1.5);
        let found = compare_runs(&synthetic_results(), &slower);
        let of = |quantity| found.iter().filter(move |change| change.quantity == quantity);
        assert!(
            of(ComparedQuantity::Seconds)
                .all(|change| change.is_significant && (change.factor - 1.5).abs() < 1e-9),
            "{found:?}"
        );
        assert!(
            of(ComparedQuantity::Seconds).all(|change| change.interval[0] > 1.3 && change.interval[1] < 1.7),
            "{found:?}"
        );
        assert!(of(ComparedQuantity::Error).all(|change| !change.is_significant));
        let said = format_changes(&found, "old.json").join("\n");
        assert!(said.contains("a.toml, path: time × 1.500 (1.3") && said.contains("SLOWER (p "), "{said}");
        let noise = with(|picture, number| picture.seconds *= [1.05, 0.97, 0.99][number]);
        assert!(compare_runs(&synthetic_results(), &noise).iter().all(|change| !change.is_significant));
    }

    #[test]
    fn only_common_steps_are_compared() {
        let mut other = synthetic_results();
        other.scenes[0].scene = "other.toml".to_owned();
        other.scenes[1].methods[0].name = "other".to_owned();
        other.scenes[1].methods[1].steps.truncate(1);
        assert_eq!(compare_runs(&other, &synthetic_results()).len(), 2);
        assert!(matches!(&format_changes(&[], "x.json")[..], [line] if line.starts_with("x.json ")));
    }
}
