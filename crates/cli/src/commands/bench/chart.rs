//! The braille plot in the terminal, shown above the progress bar and at the end.

use std::io::IsTerminal;

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

use crate::bench::{Results, SceneResult};
use crate::console::Console;
use crate::progress::format_seconds;
use crate::scene::sanitize::escape_invisible_chars;
use crate::tui::paint::buffer_to_ansi_text;

/// Method colors, from the terminal's palette.
const COLORS: [Color; 6] =
    [Color::Blue, Color::Red, Color::Green, Color::Magenta, Color::Yellow, Color::Cyan];
/// Method markers. Marker and color combinations repeat after 30 methods.
const MARKERS: [char; 5] = ['o', 'x', '+', '*', '#'];
/// Height of a chart in rows.
const ROWS: u16 = 16;
/// Maximum width of a chart.
const MAX_COLUMNS: u16 = 100;
/// Minimum size of a readable chart.
const MIN_SIZE: (u16, u16) = (30, 8);
/// Rows reserved for the current task, the bar and the prompt.
const RESERVED_ROWS: u16 = 6;

/// The points measured so far for one scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ConvergenceChart {
    scene: String,
    methods: Vec<MethodCurve>,
}

/// A method's curve: the time in seconds and the relMSE of each step.
#[derive(Clone, Debug, PartialEq)]
struct MethodCurve {
    name: String,
    points: Vec<(f64, f64)>,
}

impl ConvergenceChart {
    fn from_scene_result(scene: &SceneResult) -> Self {
        let methods = scene.methods.iter().map(|method| MethodCurve {
            name: method.name.clone(),
            points: method.steps.iter().map(|step| (step.seconds, step.relmse)).collect(),
        });
        Self { scene: scene.scene.clone(), methods: methods.collect() }
    }

    /// Adds a point. Clears the chart if the point belongs to another scene.
    pub(super) fn add_point(&mut self, scene: &str, method: &str, point: (f64, f64)) {
        if self.scene != scene {
            *self = Self { scene: scene.to_owned(), methods: Vec::new() };
        }
        match self.methods.iter_mut().find(|line| line.name == method) {
            Some(line) => line.points.push(point),
            None => self.methods.push(MethodCurve { name: method.to_owned(), points: vec![point] }),
        }
    }

    /// Renders the chart as text for a terminal of this size. The text is empty if there are no points or if
    /// the chart does not fit.
    pub(super) fn render_text(&self, columns: u16, rows: u16, is_colored: bool) -> String {
        // Some terminals wrap lines that fill the whole width.
        let columns = columns.saturating_sub(1).min(MAX_COLUMNS);
        let rows = rows.saturating_sub(RESERVED_ROWS).min(ROWS);
        if self.methods.is_empty() || columns < MIN_SIZE.0 || rows < MIN_SIZE.1 {
            return String::new();
        }
        buffer_to_ansi_text(&self.draw_to_buffer(columns, rows), is_colored)
    }

    fn draw_to_buffer(&self, columns: u16, rows: u16) -> Buffer {
        let points: Vec<Vec<(f64, f64)>> = self.methods.iter().map(MethodCurve::log_points).collect();
        let styles = MARKERS.iter().cycle().zip(COLORS.iter().cycle());
        let lines = self.methods.iter().zip(&points).zip(styles);
        let (trends, signs): (Vec<_>, Vec<_>) = lines
            .map(|((line, points), (sign, color))| {
                line_and_marker_datasets(&line.name, points, *sign, *color)
            })
            .unzip();
        let across = axis_bounds(points.iter().flatten().map(|point| point.0));
        let up = axis_bounds(points.iter().flatten().map(|point| point.1));
        // Draw markers on top of all lines.
        let chart = Chart::new(trends.into_iter().chain(signs).collect())
            .hidden_legend_constraints((Constraint::Percentage(70), Constraint::Percentage(70)))
            .x_axis(Axis::default().bounds(across).labels(axis_labels(across, format_seconds)))
            .y_axis(Axis::default().bounds(up).labels(axis_labels(up, |error| format!("{error:.0e}"))));
        let area = Rect::new(0, 0, columns, rows);
        let mut buffer = Buffer::empty(area);
        chart.render(area, &mut buffer);
        buffer
    }
}

/// Returns two datasets: the line through the points, and the markers, which carry the method's name.
fn line_and_marker_datasets<'a>(
    name: &str,
    points: &'a [(f64, f64)],
    sign: char,
    color: Color,
) -> (Dataset<'a>, Dataset<'a>) {
    let shared = Dataset::default().data(points).style(Style::new().fg(color));
    let signs = shared.clone().marker(Marker::Custom(sign)).graph_type(GraphType::Scatter);
    let trend = shared.marker(Marker::Braille).graph_type(GraphType::Line);
    (trend, signs.name(format!("{sign} {}", escape_invisible_chars(name))))
}

impl MethodCurve {
    /// Base-10 logarithms of the points with positive coordinates.
    fn log_points(&self) -> Vec<(f64, f64)> {
        let seen = self.points.iter().filter(|point| point.0 > 0.0 && point.1 > 0.0);
        seen.map(|point| (libm::log10(point.0), libm::log10(point.1))).collect()
    }
}

/// Draws a chart for every scene if stdout is a terminal.
pub(super) fn print_charts(results: &Results, console: &Console) {
    if !std::io::stdout().is_terminal() {
        return;
    }
    let columns =
        crossterm::terminal::size().map_or(80, |(columns, _)| columns.clamp(MIN_SIZE.0, MAX_COLUMNS));
    for scene in &results.scenes {
        console.print_line(&format!("{}: relMSE over seconds (log–log)", scene.scene));
        console.print_trusted_text(&buffer_to_ansi_text(
            &ConvergenceChart::from_scene_result(scene).draw_to_buffer(columns, ROWS),
            console.is_colored(),
        ));
    }
}

/// Returns the range of the values plus a margin.
fn axis_bounds(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high { [-1.0, 1.0] } else { [low - 0.1, high + 0.1] }
}

/// Axis labels at both ends and in the middle.
fn axis_labels([low, high]: [f64; 2], word: impl Fn(f64) -> String) -> Vec<String> {
    [low, (low + high) / 2.0, high].map(|power| word(libm::pow(10.0, power))).to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{MethodAnalysis, ReferenceResult, StepResult};

    fn scene() -> SceneResult {
        let step = |samples: f64| StepResult {
            samples,
            budget: None,
            seconds: samples * 0.01,
            relmse: 0.1 / samples,
            spread: [0.0, 1.0],
            uncertainty: 0.0,
            bias: None,
            brightness: None,
            pictures: Vec::new(),
        };
        let method = MethodAnalysis {
            name: "path".to_owned(),
            setup_seconds: 0.0,
            steps: vec![step(1.0), step(16.0)],
            slope: None,
            last_slope: None,
            time_to: [None; 3],
            verdict: crate::bench::BiasVerdict::Unknown,
        };
        let reference =
            ReferenceResult { samples: None, noise: 0.0, seconds: None, is_cached: false, files: Vec::new() };
        SceneResult { scene: "a.toml".to_owned(), width: 8, height: 8, reference, methods: vec![method] }
    }

    #[test]
    fn charts_have_lines_names_and_labels() {
        let buffer = ConvergenceChart::from_scene_result(&scene()).draw_to_buffer(60, ROWS);
        let plain = buffer_to_ansi_text(&buffer, false);
        assert!(plain.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c)), "{plain}");
        assert!(plain.contains("o path") && plain.contains("201 ms") && plain.contains("1e-1"), "{plain}");
        assert!(plain.lines().all(|line| line.chars().count() <= 60) && !plain.contains('\u{1b}'), "{plain}");
        assert_eq!(plain.matches('o').count(), 2 + 1, "expected two points and the legend: {plain}");
        let colored = buffer_to_ansi_text(&buffer, true);
        let ends = |line: &str| line.rfind('\u{1b}') == line.rfind("\u{1b}[0m");
        assert!(colored.contains("\u{1b}[34m") && colored.lines().all(ends), "{colored}");
    }

    #[test]
    fn empty_charts_are_drawn() {
        let mut empty = scene();
        empty.methods.clear();
        assert!(
            !buffer_to_ansi_text(&ConvergenceChart::from_scene_result(&empty).draw_to_buffer(30, ROWS), true)
                .is_empty()
        );
    }

    #[test]
    fn progress_charts_show_one_scene() {
        let mut lines = ConvergenceChart::default();
        assert_eq!(lines.render_text(80, 24, false), "");
        lines.add_point("a.toml", "path", (0.1, 0.5));
        lines.add_point("a.toml", "path", (0.4, 0.1));
        lines.add_point("a.toml", "whitted", (0.1, 0.01));
        let text = lines.render_text(80, 24, false);
        assert!(text.contains("o path") && text.contains("x whitted"), "{text}");
        assert!(text.lines().count() == 16 && text.lines().all(|line| line.chars().count() < 80), "{text}");
        assert_eq!(lines.render_text(80, 18, false).lines().count(), 12);
        assert_eq!((lines.render_text(80, 13, false), lines.render_text(30, 24, false)), Default::default());
        lines.add_point("b.toml", "path", (0.1, 0.5));
        assert!(!lines.render_text(80, 24, false).contains("whitted"));
    }
}
