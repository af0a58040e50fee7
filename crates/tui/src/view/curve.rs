//! A small log-log chart of noise over time, with a line at the requested `error`.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Widget};

use super::text::{TextRole, format_seconds, format_two_digit_percent, nth_row, put_text, wrap_text};
use crate::color::ColorDepth;
use crate::messages;
use crate::preview_style::PreviewStyle;
use crate::state::State;

/// Minimum and maximum height of the chart in rows.
const MIN_ROWS: u16 = 6;
const MAX_ROWS: u16 = 12;
/// Maximum width of the chart. More columns would not add detail.
const MAX_COLUMNS: u16 = 60;
/// Minimum number of points in a curve, and minimum ratio between its last and first times.
const MIN_POINTS: usize = 3;
const MIN_RATIO: f64 = 1.5;

/// Draws the chart at the top of an area. Returns the number of rows used, or 0 if there is no curve or too
/// little space.
pub(super) fn draw_noise_chart(state: &State, area: Rect, buffer: &mut Buffer) -> u16 {
    let area = Rect { width: area.width.min(MAX_COLUMNS), ..area }.intersection(buffer.area);
    let (Some(rows), Some(points)) = (chart_and_caption_height(state, area), curve_points_if_enough(state))
    else {
        return 0;
    };
    let depth = state.display.depth;
    put_text(buffer, nth_row(area, 0), &[(messages::NOISE_OVER_TIME, TextRole::Strong)], depth);
    let caption = wrapped_caption(state, points, area.width);
    let chart = Rect { y: area.y + 1, height: rows - 1 - caption.len() as u16, ..area };
    plot_noise_curve(state, points, chart, buffer);
    for (index, line) in (chart.bottom() - area.y..).zip(&caption) {
        put_text(buffer, nth_row(area, index), &[(line, TextRole::Faint)], depth);
    }
    rows
}

/// Number of rows that the chart and its caption use, or `None` if they do not fit.
pub(super) fn chart_and_caption_height(state: &State, area: Rect) -> Option<u16> {
    let words =
        1 + wrapped_caption(state, curve_points_if_enough(state)?, area.width.min(MAX_COLUMNS)).len() as u16;
    let chart = area.height.checked_sub(words)?.min(MAX_ROWS);
    (chart >= MIN_ROWS && area.width >= 20).then_some(words + chart)
}

/// The current image's points, if there are enough for a curve.
fn curve_points_if_enough(state: &State) -> Option<&[(f64, f64)]> {
    let points = state.work.curve.points();
    let [(first, _), .., (last, _)] = points else { return None };
    (points.len() >= MIN_POINTS && *last >= first * MIN_RATIO).then_some(points)
}

/// The requested noise per tile.
fn requested_noise(state: &State) -> Option<f64> {
    state.request.effective.as_ref().map(|it| f64::from(it.error)).filter(|error| *error > 0.0)
}

/// A no-break space, which keeps a number and its unit on one line.
const NO_BREAK_SPACE: &str = "\u{a0}";

/// Wraps the caption into lines without separating numbers from their units.
fn wrapped_caption(state: &State, points: &[(f64, f64)], width: u16) -> Vec<String> {
    let ([(first, from), ..], [.., (last, to)]) = (points, points) else { return Vec::new() };
    let whole = |amount: String| amount.replace(' ', NO_BREAK_SPACE);
    let (from, first) = (whole(format_two_digit_percent(*from)), whole(format_seconds(*first)));
    let (to, last) = (whole(format_two_digit_percent(*to)), whole(format_seconds(*last)));
    let fell = format!("{from} after {first}, {to} after {last}");
    let line = match requested_noise(state) {
        Some(target) => {
            let share = whole(format_two_digit_percent(f64::from((target * 1e6).round() as f32) / 1e6));
            format!("; {}", messages::noise_target_line_label(&share))
        }
        None => String::new(),
    };
    wrap_text(&(fell + &line), usize::from(width))
        .iter()
        .map(|line| line.replace(NO_BREAK_SPACE, " "))
        .collect()
}

fn plot_noise_curve(state: &State, points: &[(f64, f64)], area: Rect, buffer: &mut Buffer) {
    let depth = state.display.depth;
    let log = |(seconds, noise): &(f64, f64)| (seconds.log10(), noise.log10());
    let curve: Vec<(f64, f64)> = points.iter().map(log).collect();
    let ends = |of: &dyn Fn(&(f64, f64)) -> f64, more: Option<f64>| {
        let all = || curve.iter().map(of).chain(more);
        [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)]
    };
    let target = requested_noise(state).map(f64::log10);
    let (x, y) = (ends(&|point| point.0, None), ends(&|point| point.1, target));
    let line = target.map(|target| [(x[0], target), (x[1], target)]);
    // Add a margin, since a line at the very edge would not be visible.
    let margin = 0.05 * (y[1] - y[0]).max(0.1);
    let bounds = [y[0] - margin, y[1] + margin];
    let style = |tone: TextRole| tone.style(depth);
    let dataset = |data, tone| {
        Dataset::default()
            .data(data)
            .marker(chart_marker_style(state))
            .graph_type(GraphType::Line)
            .style(style(tone))
    };
    let mut sets = Vec::new();
    sets.extend(line.as_ref().map(|line| dataset(&line[..], TextRole::Good)));
    sets.push(dataset(&curve, TextRole::Working));
    let axis = |bounds, labels: [String; 2]| {
        let labels = labels.map(|label| Span::styled(label, style(TextRole::Faint)));
        Axis::default().bounds(bounds).labels(labels).style(style(TextRole::Faint))
    };
    let ten = |power: f64| 10_f64.powf(power);
    Chart::new(sets)
        .style(Style::new())
        .legend_position(None)
        .x_axis(axis(x, x.map(|x| format_seconds(ten(x)))))
        .y_axis(axis(bounds, y.map(|y| format_two_digit_percent(ten(y)))))
        .render(area, buffer);
}

/// The chart's marker: Braille dots, if the terminal is likely to support them.
fn chart_marker_style(state: &State) -> Marker {
    let is_simple = state.display.kind == PreviewStyle::Ascii
        || matches!(state.display.depth, ColorDepth::Ansi16 | ColorDepth::None);
    if is_simple { Marker::Dot } else { Marker::Braille }
}
