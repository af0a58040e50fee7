//! `glimt compare`: measures the error of an image relative to a reference. Writes a table, JSON or an image.

mod pictures;

use std::cell::RefCell;
use std::path::Path;

use rayon::ThreadPool;
use serde::Serialize;

use crate::args::CompareArgs;
use crate::compare::{self, Bias, ErrorMetrics, ImagePair, PIXELS_PER_DEGREE, PairMeasurements};
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::film::RadianceImage;
use crate::output::part::is_part_or_checkpoint;
use crate::output::write::{self, ExistingFilePolicy};
use crate::output::{
    self, AttributeLossPolicy, EncodeOptions, FileIdentity, Format, OutputError, WriteWarning,
    may_be_same_file,
};
use crate::system::threads::start_logical_cpu_pool;
use crate::tui::wrap_text;

pub(crate) fn run(args: &CompareArgs, console: &Console) -> Exit {
    match start_logical_cpu_pool() {
        Ok(pool) => run_comparison_in_pool(&pool, args, console).unwrap_or_else(|exit| exit),
        Err(message) => console.print_error(Exit::FAILED, &message),
    }
}

/// Runs the comparison and reports errors. `Err` contains the exit code.
fn run_comparison_in_pool(pool: &ThreadPool, args: &CompareArgs, console: &Console) -> Result<Exit, Exit> {
    let diff =
        args.diff.as_deref().map(|path| ErrorImageOutput::try_from_args(path, args, console)).transpose()?;
    let pair = ImagePair::load(&args.a, &args.b).map_err(|errors| {
        errors.iter().for_each(|error| console.print_line_to_stderr(&format!("error: {error}")));
        Exit::WRONG
    })?;
    pair.file_warnings()
        .iter()
        .for_each(|warning| console.print_line_to_stderr(&format!("warning: {warning}")));
    warn_about_same_file(args, console);
    let measured = pool.install(|| compare::measure(&pair));
    let errors = &measured.errors;
    let bias = Bias::new(errors, [&args.a, &args.b].map(|path| output::read_mean_luminance_error(path)));
    let summary = ComparisonSummary::new(args, &pair, errors, bias);
    if args.json {
        print_json(&summary, console);
    } else {
        pictures::print_images(
            &pool.install(|| pictures::render_images_as_text(args, &pair, &measured)),
            console,
        );
        let lines = format_table(&summary, console.stdout_columns());
        lines.iter().for_each(|line| console.print_line(line));
    }
    if let Some(diff) = diff {
        let written = pool.install(|| diff.write(args, &pair, &measured));
        let warnings = written.map_err(|error| console.print_error(Exit::FAILED, &error.to_string()))?;
        warnings.iter().for_each(|warning| console.print_line_to_stderr(&format!("warning: {warning}")));
        console.print_line_to_stderr(&format!("wrote {} ({})", diff.path.display(), diff.description()));
    }
    Ok(check_relmse_threshold(&summary, console))
}

fn check_relmse_threshold(summary: &ComparisonSummary<'_>, console: &Console) -> Exit {
    match summary.max_relmse {
        Some(most) if !summary.is_within => {
            let relmse = format_six_significant_digits(summary.relmse);
            console.print_error(Exit::FAILED, &format!("relMSE {relmse} is above --max-relmse {most}"))
        }
        Some(_) | None => Exit::DONE,
    }
}

fn warn_about_same_file(args: &CompareArgs, console: &Console) {
    let identity = FileIdentity::from_existing_or_new_path(&args.a);
    if identity.is_some() && identity == FileIdentity::from_existing_or_new_path(&args.b) {
        let (a, b) = (args.a.display(), args.b.display());
        let which = if args.a == args.b {
            format!("{a} is specified twice")
        } else {
            format!("{a} and {b} are the same file")
        };
        console.print_line_to_stderr(&format!(
            "warning: {which}, so the error is 0; pass an image and a reference"
        ));
    }
}

/// The error image requested with `--diff`.
struct ErrorImageOutput<'a> {
    path: &'a Path,
    format: Format,
}

impl<'a> ErrorImageOutput<'a> {
    /// Creates the output, and reports errors that can be detected before the measurement.
    fn try_from_args(path: &'a Path, args: &CompareArgs, console: &Console) -> Result<Self, Exit> {
        let format =
            Format::from_path(path).map_err(|error| console.print_error(Exit::WRONG, &error.to_string()))?;
        check_not_input(path, path, args)
            .map_err(|error| console.print_error(Exit::WRONG, &error.to_string()))?;
        output::check_image_target(path)
            .map_err(|error| console.print_error(Exit::FAILED, &error.to_string()))?;
        Ok(Self { path, format })
    }

    fn is_float(&self) -> bool {
        match self.format {
            Format::Exr | Format::Hdr => true,
            Format::Png | Format::Jpeg | Format::Ppm | Format::WebP => false,
        }
    }

    fn description(&self) -> &'static str {
        if self.is_float() {
            "|a - b| per channel, linear"
        } else {
            "FLIP in false color, from black (0) to pale yellow (1)"
        }
    }

    /// Writes the image. Returns warnings about the written file.
    fn write(
        &self,
        args: &CompareArgs,
        pair: &ImagePair,
        measured: &PairMeasurements,
    ) -> Result<Vec<WriteWarning>, OutputError> {
        let image: RadianceImage = if self.is_float() {
            compare::absolute_difference(pair)
        } else {
            compare::flip_heat_map(pair, &measured.flip)
        };
        let note = format!("{}; a: {}, b: {}", self.description(), args.a.display(), args.b.display());
        let options =
            EncodeOptions { metadata: vec![("Error".to_owned(), note)], ..EncodeOptions::default() };
        let token = CancelToken::new();
        let bytes = output::encode(&image, &options, self.format, &token)?;
        let may_replace = |real: &Path| check_not_input(self.path, real, args);
        let is_kept = |path: &Path| check_not_input(path, path, args).is_err();
        let warnings = RefCell::new(Vec::new());
        let losses = AttributeLossPolicy::Report(&|warning| warnings.borrow_mut().push(warning));
        let guard = ExistingFilePolicy { is_kept: &is_kept, may_replace: &may_replace, sweep: None, losses };
        write::write_atomically_with_policy(self.path, &bytes, &guard, &token)?;
        Ok(warnings.into_inner())
    }
}

/// Checks that the target, whose resolved path is `real`, is not one of the compared images, a part or a
/// checkpoint.
fn check_not_input(path: &Path, real: &Path, args: &CompareArgs) -> Result<(), OutputError> {
    if is_part_or_checkpoint(real) {
        let reason = format!(
            "cannot write {}: it is a part or checkpoint; choose another file with --diff FILE",
            path.display()
        );
        return Err(OutputError::Refused { reason });
    }
    match [&args.a, &args.b].into_iter().find(|input| may_be_same_file(real, input)) {
        Some(input) => {
            let other = if path == input { String::new() } else { format!("{}, ", input.display()) };
            let name = path.display();
            let reason = format!(
                "cannot write {name}: it is {other}one of the compared images; choose another file with --diff FILE"
            );
            Err(OutputError::Refused { reason })
        }
        None => Ok(()),
    }
}

/// Measured values, as shown in the table and the JSON object.
#[derive(Serialize)]
struct ComparisonSummary<'a> {
    a: String,
    b: String,
    width: u32,
    height: u32,
    rmse: f64,
    relmse: f64,
    relmse_trimmed: f64,
    dropped_pixels: u64,
    max: f64,
    max_at: &'a [u32; 2],
    psnr_db: f64,
    ssim: f64,
    flip: f64,
    bias: Option<f64>,
    bias_standard_error: Option<f64>,
    bias_z: Option<f64>,
    max_relmse: Option<f64>,
    /// Whether relMSE is at most `max_relmse`.
    is_within: bool,
}

impl<'a> ComparisonSummary<'a> {
    fn new(args: &CompareArgs, pair: &ImagePair, errors: &'a ErrorMetrics, bias: Bias) -> Self {
        let &ErrorMetrics { rmse, relmse, relmse_trimmed, dropped_pixels, max, psnr_db, ssim, flip, .. } =
            errors;
        Self {
            a: args.a.display().to_string(),
            b: args.b.display().to_string(),
            width: pair.measured_image().width,
            height: pair.measured_image().height,
            rmse,
            relmse,
            relmse_trimmed,
            dropped_pixels,
            max,
            max_at: &errors.max_at,
            psnr_db,
            ssim,
            flip,
            bias: bias.value,
            bias_standard_error: bias.standard_error,
            bias_z: bias.z,
            max_relmse: args.max_relmse,
            is_within: args.max_relmse.is_none_or(|most| relmse <= most),
        }
    }
}

/// Prints the JSON object. Values that are not finite become null.
fn print_json(summary: &ComparisonSummary<'_>, console: &Console) {
    match output::json::to_line_without_newline(summary) {
        Ok(text) => console.print_line(&text),
        Err(error) => console.print_line_to_stderr(&format!("error: {error}")),
    }
}

/// Formats the table as lines, wrapped to `columns`.
fn format_table(summary: &ComparisonSummary<'_>, columns: Option<usize>) -> Vec<String> {
    let ComparisonSummary { a, b, width, height, .. } = summary;
    let title = format!("{a} compared with reference {b}, {width}×{height} pixels");
    let rows = table_rows(summary).into_iter().flat_map(|(name, value, unit, note)| {
        format_row(&format!("{name:<16}{value:>12} {unit:<4}"), &note, columns)
    });
    let end = "Higher is better for PSNR and SSIM; lower for the rest.";
    let mut lines = wrap(&title, columns);
    lines.push(String::new());
    lines.extend(rows);
    lines.push(String::new());
    lines.extend(wrap(end, columns));
    lines
}

/// Formats a row's values and its description, which is on the next line if it does not fit after the values.
fn format_row(figures: &str, note: &str, columns: Option<usize>) -> Vec<String> {
    /// Minimum width of a description.
    const MIN_NOTE_COLUMNS: usize = 24;
    const INDENT: usize = 4;
    let start = figures.chars().count();
    let Some(columns) = columns else { return vec![format!("{figures}{note}").trim_end().to_owned()] };
    let fits_beside = columns >= start + MIN_NOTE_COLUMNS;
    let indent = if fits_beside { start } else { INDENT };
    let mut note = wrap_text(note, columns.saturating_sub(indent).max(1));
    let first = if fits_beside && !note.is_empty() { note.remove(0) } else { String::new() };
    let first = format!("{figures}{first}").trim_end().to_owned();
    let rest = note.into_iter().map(|line| format!("{:indent$}{line}", ""));
    std::iter::once(first).chain(rest).collect()
}

fn wrap(text: &str, columns: Option<usize>) -> Vec<String> {
    columns.map_or_else(|| vec![text.to_owned()], |columns| wrap_text(text, columns))
}

/// Minimum z-score for a significant bias. If there is no bias, noise exceeds it about once in two million
/// comparisons.
const SIGNIFICANT_Z: f64 = 5.0;

/// Note appended if the bias is significant.
const SIGNIFICANT: &str = ": significant, not explained by noise";

/// Name, value, unit and description of each row.
fn table_rows(summary: &ComparisonSummary<'_>) -> Vec<(&'static str, String, &'static str, String)> {
    let pixels = u64::from(summary.width) * u64::from(summary.height);
    let [x, y] = summary.max_at;
    let trimmed = format!("without the worst 0.1 %: {} of {pixels} pixels", summary.dropped_pixels);
    let place = if summary.max > 0.0 { format!(", at pixel ({x}, {y})") } else { String::new() };
    let flip = format!("clamped sRGB, {PIXELS_PER_DEGREE} pixels per degree; mean, 0 to 1");
    let mut rows = vec![
        ("RMSE", format_six_significant_digits(summary.rmse), "", "linear".to_owned()),
        (
            "relMSE",
            format_six_significant_digits(summary.relmse),
            "",
            "linear: mean of (a - b)²/(b² + 0.01)".to_owned(),
        ),
        ("relMSE, trimmed", format_six_significant_digits(summary.relmse_trimmed), "", trimmed),
        ("max |a - b|", format_six_significant_digits(summary.max), "", format!("linear{place}")),
        ("PSNR", format_decibels(summary.psnr_db), "dB", "clamped sRGB".to_owned()),
        ("SSIM", format!("{:.6}", summary.ssim), "", "luma of clamped sRGB".to_owned()),
        ("FLIP", format_six_significant_digits(summary.flip), "", flip),
    ];
    if let Some(bias) = summary.bias {
        let noise = summary.bias_standard_error.map_or_else(
            || "noise unknown".to_owned(),
            |error| format!("standard error {}", format_six_significant_digits(error)),
        );
        rows.push((
            "bias",
            format_six_digits_any_sign(bias),
            "",
            format!("linear: mean(a - b)/mean(b); {noise}"),
        ));
    }
    if let Some(z) = summary.bias_z {
        let verdict = if z.abs() > SIGNIFICANT_Z { SIGNIFICANT } else { "" };
        rows.push(("bias, z", format!("{z:.2}"), "", format!("bias / standard error{verdict}")));
    }
    rows
}

fn format_six_digits_any_sign(value: f64) -> String {
    let sign = if value < 0.0 { "-" } else { "" };
    format!("{sign}{}", format_six_significant_digits(value.abs()))
}

/// Formats six significant digits.
fn format_six_significant_digits(value: f64) -> String {
    let is_short = (1e-4..1e6).contains(&value);
    let decimals = if is_short { (5.0 - libm::log10(value).floor()).max(0.0) as usize } else { 5 };
    match value {
        0.0 => "0".to_owned(),
        _ if is_short => format!("{value:.decimals$}"),
        _ => format!("{value:.decimals$e}"),
    }
}

fn format_decibels(value: f64) -> String {
    if value.is_finite() { format!("{value:.4}") } else { "∞".to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary() -> ComparisonSummary<'static> {
        ComparisonSummary {
            a: "a/long/name/of/a/folder/picture.png".to_owned(),
            b: "a/long/name/of/a/folder/reference.png".to_owned(),
            width: 256,
            height: 256,
            rmse: 0.012_345,
            relmse: 0.1,
            relmse_trimmed: 0.05,
            dropped_pixels: 64,
            max: 1.0,
            max_at: &[3, 4],
            psnr_db: 31.25,
            ssim: 0.9,
            flip: 0.1,
            bias: Some(0.01),
            bias_standard_error: Some(0.02),
            bias_z: Some(0.5),
            max_relmse: None,
            is_within: true,
        }
    }

    #[test]
    fn tables_wrap_to_the_terminal() {
        let summary = summary();
        let words =
            |lines: &[String]| lines.join(" ").split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let whole = format_table(&summary, None);
        assert!(whole.iter().any(|line| line.contains("0.1 %: 64 of 65536 pixels")), "{whole:?}");
        for columns in [200, 120, 80, 60, 50, 40] {
            let lines = format_table(&summary, Some(columns));
            let widest = lines.iter().map(|line| line.chars().count()).max();
            assert!(widest.is_some_and(|widest| widest <= columns), "{columns}: {lines:#?}");
            assert_eq!(words(&lines), words(&whole), "{columns}");
        }
    }

    #[test]
    fn only_large_z_scores_are_significant() {
        for (z, is_far) in [(0.5, false), (-3.5, false), (5.5, true), (-40.0, true)] {
            let lines = format_table(&ComparisonSummary { bias_z: Some(z), ..summary() }, None);
            let line = lines.iter().find(|line| line.contains("bias, z")).expect("a line");
            assert_eq!(line.contains(SIGNIFICANT), is_far, "{line}");
        }
    }

    #[test]
    fn figures_have_six_significant_digits() {
        let cases = [
            (0.0, "0"),
            (0.012_345_678, "0.0123457"),
            (0.000_2, "0.000200000"),
            (1.5, "1.50000"),
            (123.456_789, "123.457"),
            (123_456.7, "123457"),
            (999_999.9, "1000000"),
            (1.234_5e-7, "1.23450e-7"),
            (5e30, "5.00000e30"),
        ];
        for (value, text) in cases {
            assert_eq!(format_six_significant_digits(value), text);
        }
        assert_eq!(format_decibels(f64::INFINITY), "∞");
        assert_eq!(format_decibels(31.25), "31.2500");
    }
}
