//! The plot in the terminal, in braille.

use std::io::IsTerminal;

use ratatui::buffer::Buffer;
use ratatui::layout::{Constraint, Rect};
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

use crate::bench::{Results, SceneResult};
use crate::cli::console::Console;
use crate::cli::progress::seconds;

/// Of the palette of the terminal, in the order of the methods.
const COLORS: [Color; 6] =
    [Color::Blue, Color::Red, Color::Green, Color::Magenta, Color::Yellow, Color::Cyan];
/// Rows of a chart.
const ROWS: u16 = 16;
/// Columns at most.
const COLUMNS: u16 = 100;

/// Draws every scene where stdout is a terminal.
pub(super) fn show(results: &Results, console: &Console) {
    if !std::io::stdout().is_terminal() {
        return;
    }
    let columns = crossterm::terminal::size().map_or(80, |(columns, _)| columns.clamp(30, COLUMNS));
    for scene in &results.scenes {
        console.answer(&format!("{}: relMSE against seconds, both logarithmic", scene.scene));
        console.text(&text(&drawn(scene, columns), console.is_colored()));
    }
}

fn drawn(scene: &SceneResult, columns: u16) -> Buffer {
    let points: Vec<Vec<(f64, f64)>> = scene
        .methods
        .iter()
        .map(|method| {
            let seen = method.steps.iter().filter(|step| step.relmse > 0.0 && step.seconds > 0.0);
            seen.map(|step| (libm::log10(step.seconds), libm::log10(step.relmse))).collect()
        })
        .collect();
    let lines = scene.methods.iter().zip(&points).zip(COLORS.iter().cycle());
    let lines = lines.map(|((method, points), color)| {
        Dataset::default()
            .name(method.name.as_str())
            .data(points)
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(Style::new().fg(*color))
    });
    let across = bounds(points.iter().flatten().map(|point| point.0));
    let up = bounds(points.iter().flatten().map(|point| point.1));
    let chart = Chart::new(lines.collect())
        .hidden_legend_constraints((Constraint::Percentage(70), Constraint::Percentage(70)))
        .x_axis(Axis::default().bounds(across).labels(labels(across, seconds)))
        .y_axis(Axis::default().bounds(up).labels(labels(up, |error| format!("{error:.0e}"))));
    let area = Rect::new(0, 0, columns, ROWS);
    let mut buffer = Buffer::empty(area);
    chart.render(area, &mut buffer);
    buffer
}

/// From the least to the greatest, with a little room.
fn bounds(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high { [-1.0, 1.0] } else { [low - 0.1, high + 0.1] }
}

/// At both ends and in the middle.
fn labels([low, high]: [f64; 2], word: impl Fn(f64) -> String) -> Vec<String> {
    [low, (low + high) / 2.0, high].map(|power| word(libm::pow(10.0, power))).to_vec()
}

/// Lines, with a sequence where the colour changes.
fn text(buffer: &Buffer, is_colored: bool) -> String {
    let mut text = String::new();
    for y in buffer.area.top()..buffer.area.bottom() {
        let mut line = String::new();
        let mut color = Color::Reset;
        for x in buffer.area.left()..buffer.area.right() {
            let cell = &buffer[(x, y)];
            if is_colored && cell.fg != color {
                color = cell.fg;
                line += &sequence(color);
            }
            line += cell.symbol();
        }
        text += line.trim_end();
        text += if color == Color::Reset { "\n" } else { "\u{1b}[39m\n" };
    }
    text
}

fn sequence(color: Color) -> String {
    let number = COLORS.iter().position(|one| *one == color);
    // Blue, red, green, magenta, yellow, cyan (ECMA-48).
    number.map_or("\u{1b}[39m".to_owned(), |number| format!("\u{1b}[{}m", [34, 31, 32, 35, 33, 36][number]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{MethodResult, ReferenceResult, Step};

    fn scene() -> SceneResult {
        let step = |samples: f64| Step {
            samples,
            budget: None,
            seconds: samples * 0.01,
            relmse: 0.1 / samples,
            spread: [0.0, 1.0],
            uncertainty: 0.0,
            bias: None,
            pictures: Vec::new(),
        };
        let method = MethodResult {
            name: "path".to_owned(),
            setup_seconds: 0.0,
            steps: vec![step(1.0), step(16.0)],
            slope: None,
            last_slope: None,
            time_to: [None; 3],
            verdict: crate::bench::Verdict::Unknown,
        };
        let reference =
            ReferenceResult { samples: None, noise: 0.0, seconds: None, is_cached: false, files: Vec::new() };
        SceneResult { scene: "a.toml".to_owned(), width: 8, height: 8, reference, methods: vec![method] }
    }

    #[test]
    fn the_chart_has_its_lines_names_and_ends() {
        let buffer = drawn(&scene(), 60);
        let plain = text(&buffer, false);
        assert!(plain.chars().any(|c| ('\u{2801}'..='\u{28ff}').contains(&c)), "{plain}");
        assert!(plain.contains("path") && plain.contains("201 ms") && plain.contains("1e-1"), "{plain}");
        assert!(plain.lines().all(|line| line.chars().count() <= 60) && !plain.contains('\u{1b}'), "{plain}");
        let colored = text(&buffer, true);
        let ends = |line: &str| line.rfind('\u{1b}') == line.rfind("\u{1b}[39m");
        assert!(colored.contains("\u{1b}[34m") && colored.lines().all(ends), "{colored}");
    }

    #[test]
    fn nothing_measured_is_drawn_too() {
        let mut empty = scene();
        empty.methods.clear();
        assert!(!text(&drawn(&empty, 30), true).is_empty());
    }
}
