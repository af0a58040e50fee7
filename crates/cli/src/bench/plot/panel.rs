//! Draws the panel for one scene.

use plotters::coord::Shift;
use plotters::prelude::*;

use super::AXES;
use super::axes::{LogAxis, format_log_axis_mark, format_log_mark_as_decimal};
use crate::bench::results::{BiasVerdict, MethodAnalysis, SceneResult, StepResult};
use crate::bench::slope::ErrorOverTimeSlope;
use crate::scene::sanitize::escape_invisible_chars;

/// Okabe and Ito's color-blind-safe palette.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
const FAINT: RGBColor = RGBColor(225, 225, 225);
const GRAY: RGBColor = RGBColor(110, 110, 110);

/// Half the marker size in pixels.
const MARKER: i32 = 4;

/// The drawing area of a panel.
type PanelArea<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type DrawError<'a> = DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>;
type Chart<'c, 'a> = ChartContext<'c, SVGBackend<'a>, Cartesian2d<LogAxis, LogAxis>>;

/// Draws the panel for one scene: axes, reference noise, error bars, medians and legend.
pub(super) fn draw_panel<'a>(scene: &SceneResult, place: &PanelArea<'a>) -> Result<(), DrawError<'a>> {
    let steps = || scene.methods.iter().flat_map(|method| &method.steps);
    let noise = scene.reference.noise;
    let across = LogAxis::spanning(steps().map(|step| step.seconds), 0.0);
    let errors = steps().flat_map(|step| [step.relmse, step.spread[0], step.spread[1]]);
    let up = LogAxis::spanning(errors.chain([noise]), legend_height_fraction(scene.methods.len()));
    let mut chart = ChartBuilder::on(place)
        .caption(caption_text(scene), ("sans-serif", 20))
        .margin(14)
        .x_label_area_size(50)
        .y_label_area_size(80)
        .build_cartesian_2d(across.clone(), up.clone())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(FAINT)
        .axis_style(GRAY)
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 16))
        .x_desc(AXES[0])
        .y_desc(AXES[1])
        .x_label_formatter(&|mark| format_log_mark_as_decimal(*mark))
        .y_label_formatter(&|mark| format_log_axis_mark(*mark))
        .draw()?;
    if noise > 0.0 {
        draw_reference_noise(&mut chart, libm::log10(noise), &across)?;
    }
    for (number, method) in scene.methods.iter().enumerate() {
        draw_error_bars(&mut chart, method, method_color(number), &up)?;
        draw_medians(&mut chart, method, number)?;
    }
    draw_legend(&mut chart)
}

/// Returns the caption, without characters that are invalid in XML.
fn caption_text(scene: &SceneResult) -> String {
    format!("{}, {}×{}", escape_invisible_chars(&scene.scene), scene.width, scene.height)
}

/// Fraction of the height reserved for the legend.
fn legend_height_fraction(methods: usize) -> f64 {
    (0.05 * (methods as f64 + 1.0) + 0.08).min(0.6)
}

fn method_color(number: usize) -> RGBColor {
    COLORS[number % COLORS.len()]
}

fn draw_legend<'c, 'a: 'c>(chart: &mut Chart<'c, 'a>) -> Result<(), DrawError<'a>> {
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(FAINT)
        .label_font(("sans-serif", 14))
        .margin(8)
        .draw()
}

/// Draws the reference noise as a dashed line.
fn draw_reference_noise<'c, 'a: 'c>(
    chart: &mut Chart<'c, 'a>,
    level: f64,
    across: &LogAxis,
) -> Result<(), DrawError<'a>> {
    let dashes = |points: Vec<(f64, f64)>| DashedLineSeries::new(points, 5, 5, GRAY.stroke_width(1));
    let ends = vec![(across.range.start, level), (across.range.end, level)];
    let sample = |(x, y): (i32, i32)| PathElement::new([(x, y), (x + 8, y)], GRAY);
    chart.draw_series(dashes(ends))?.label("noise of each reference").legend(sample);
    Ok(())
}

/// Draws each step's error range.
fn draw_error_bars<'c, 'a: 'c>(
    chart: &mut Chart<'c, 'a>,
    method: &MethodAnalysis,
    color: RGBColor,
    up: &LogAxis,
) -> Result<(), DrawError<'a>> {
    let seen = method.steps.iter().filter(|step| step.spread[1] > 0.0);
    let bar = |step: &StepResult| {
        let low = if step.spread[0] > 0.0 { libm::log10(step.spread[0]) } else { up.range.start };
        let high = libm::log10(step.spread[1]);
        let middle = if step.relmse > 0.0 { libm::log10(step.relmse) } else { low };
        ErrorBar::new_vertical(libm::log10(step.seconds), low, middle, high, color.stroke_width(1), 8)
    };
    chart.draw_series(seen.map(bar))?;
    Ok(())
}

/// Draws the medians and adds the method to the legend.
fn draw_medians<'c, 'a: 'c>(
    chart: &mut Chart<'c, 'a>,
    method: &MethodAnalysis,
    number: usize,
) -> Result<(), DrawError<'a>> {
    let color = method_color(number);
    let seen = method.steps.iter().filter(|step| step.relmse > 0.0);
    let points: Vec<(f64, f64)> =
        seen.map(|step| (libm::log10(step.seconds), libm::log10(step.relmse))).collect();
    let sample = move |(x, y): (i32, i32)| {
        let line = PathElement::new([(x, y), (x + 20, y)], color.stroke_width(2));
        EmptyElement::at((0, 0)) + line + method_marker((x + 10, y), number)
    };
    let drawn = chart.draw_series(LineSeries::new(points.clone(), color.stroke_width(2)))?;
    drawn.label(legend_label(method)).legend(sample);
    let at = |point: (f64, f64)| EmptyElement::at(point) + method_marker((0, 0), number);
    chart.draw_series(points.into_iter().map(at))?;
    Ok(())
}

/// Returns a filled marker centered on a pixel. Its shape depends on the method's index.
fn method_marker(at: (i32, i32), number: usize) -> Polygon<(i32, i32)> {
    let corners: &[(i32, i32)] = match number % 4 {
        0 => &[(-1, -1), (1, -1), (1, 1), (-1, 1)],
        1 => &[(0, -1), (1, 1), (-1, 1)],
        2 => &[(0, -1), (1, 0), (0, 1), (-1, 0)],
        _ => &[(-1, -1), (1, -1), (0, 1)],
    };
    let size = if number.is_multiple_of(4) { MARKER - 1 } else { MARKER + 1 };
    let corner = |(x, y): &(i32, i32)| (at.0 + x * size, at.1 + y * size);
    Polygon::new(corners.iter().map(corner).collect::<Vec<_>>(), method_color(number).filled())
}

/// A method's legend entry, such as `path, slope −0.98`.
fn legend_label(method: &MethodAnalysis) -> String {
    let slope = method.slope.map_or(String::new(), |ErrorOverTimeSlope { value, .. }| {
        format!(", slope {}{:.2}", if value < 0.0 { "−" } else { "" }, value.abs())
    });
    let bias = match method.verdict {
        BiasVerdict::Stays { size, .. } => format!(", BIAS {size:.1e}"),
        BiasVerdict::Falls { size, .. } => format!(", bias {size:.1e}, falling"),
        BiasVerdict::Unknown | BiasVerdict::NoneFound { .. } => String::new(),
    };
    format!("{}{slope}{bias}", method.name)
}
