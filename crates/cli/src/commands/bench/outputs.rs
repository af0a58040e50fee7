//! Output files for `glimt bench`. They must differ from the inputs and from each other.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::progress::BenchProgress;
use crate::args::BenchArgs;
use crate::bench::{Results, csv, plot};
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::lower::STDOUT_NAME;
use crate::output::write::{self, ExistingFilePolicy};
use crate::output::{
    self, AttributeLossPolicy, FileIdentity, OutputError, check_json_replacement, check_plot_replacement,
    check_table_replacement, may_be_same_file,
};
use crate::system::{describe_io_error, file};

/// Files to write, and input files that must not be overwritten.
pub(super) struct BenchOutputs {
    /// Option, path and content type of each output.
    files: Vec<(&'static str, PathBuf, OutputKind)>,
    /// Role and path of each input.
    inputs: Vec<(&'static str, PathBuf)>,
    baseline: Option<PathBuf>,
    /// Whether files that glimt did not write may be replaced.
    replaces_foreign: bool,
}

#[derive(Clone, Copy)]
/// Content type of an output file.
enum OutputKind {
    Csv,
    Json,
    Plot,
}

impl BenchOutputs {
    /// Checks the outputs before measuring and reports errors.
    pub(super) fn try_from_args(
        args: &BenchArgs,
        scenes: &[PathBuf],
        console: &Console,
    ) -> Result<Self, Exit> {
        let all = [
            ("--csv", &args.csv, OutputKind::Csv),
            ("--json", &args.json, OutputKind::Json),
            ("--plot", &args.plot, OutputKind::Plot),
        ];
        let files: Vec<_> =
            all.into_iter().filter_map(|(option, file, kind)| Some((option, file.clone()?, kind))).collect();
        let scenes = scenes.iter().map(|scene| ("one of the scenes", scene.clone()));
        let references = args.reference.iter().map(|file| ("one of the references", file.clone()));
        let baseline = args.baseline.iter().map(|file| ("the baseline", file.clone()));
        let inputs = scenes.chain(references).chain(baseline).collect();
        let (baseline, replaces_foreign) = (args.baseline.clone(), args.force);
        let outputs = Self { files, inputs, baseline, replaces_foreign };
        for (index, (_, path, kind)) in outputs.files.iter().enumerate() {
            outputs.check_output(index, path, *kind).map_err(|error| match error {
                OutputError::Refused { reason } => console.print_error(Exit::WRONG, &reason),
                error => console.print_error(Exit::FAILED, &error.to_string()),
            })?;
        }
        Ok(outputs)
    }

    fn check_output(&self, index: usize, path: &Path, kind: OutputKind) -> Result<(), OutputError> {
        self.check_conflicts_of_output(index, path)?;
        let is_svg = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("svg"));
        if path == Path::new(STDOUT_NAME) && !matches!(kind, OutputKind::Plot) {
            let (option, ..) = self.files[index];
            let reason =
                format!("{option} {STDOUT_NAME} would mix with the tables on stdout; use a file instead");
            return Err(OutputError::Refused { reason });
        }
        if matches!(kind, OutputKind::Plot) && !is_svg {
            let reason =
                format!("cannot write {}: plots are SVG files; use the extension .svg", path.display());
            return Err(OutputError::Refused { reason });
        }
        output::check_output_is_writable(path)
    }

    /// Checks that output `index`, whose resolved path is `real`, is neither an input nor another output.
    fn check_conflicts_of_output(&self, index: usize, real: &Path) -> Result<(), OutputError> {
        if FileIdentity::from_existing_or_new_path(real).is_none() {
            return Ok(());
        }
        let is_target = |path: &Path| may_be_same_file(real, path);
        let (option, path, _) = &self.files[index];
        let refused = |what: &str| {
            let reason = format!(
                "cannot write {}: it is {what}; choose another file with {option} FILE",
                path.display()
            );
            Err(OutputError::Refused { reason })
        };
        if let Some((what, _)) = self.inputs.iter().find(|(_, input)| is_target(input)) {
            return refused(what);
        }
        if let Some((other, ..)) = self.files[..index].iter().find(|(_, other, _)| is_target(other)) {
            return refused(&format!("the output of {other}"));
        }
        if self.replaces_foreign { Ok(()) } else { self.check_written_by_glimt(index, real) }
    }

    /// Rejects files not written by glimt. For example, `--csv scene.toml` would overwrite the scene if the
    /// user forgot the CSV file's name.
    fn check_written_by_glimt(&self, index: usize, real: &Path) -> Result<(), OutputError> {
        let (option, path, kind) = &self.files[index];
        let replaced = match kind {
            OutputKind::Csv => check_table_replacement(real, csv::HEADER_LINE),
            // Replace only valid baselines, which contain at least one scene.
            OutputKind::Json => {
                check_json_replacement(real, "a results file", |found: &Results| !found.scenes.is_empty())
            }
            OutputKind::Plot => check_plot_replacement(real, &plot::AXES),
        };
        let Some(why) = replaced.reason_to_keep() else { return Ok(()) };
        let advice = format!("choose another file with {option} FILE, or use --force");
        Err(OutputError::Refused { reason: format!("cannot write {}: {why}; {advice}", path.display()) })
    }

    /// Reads the baseline and returns its name and results.
    pub(super) fn read_baseline(&self, console: &Console) -> Result<Option<(String, Results)>, Exit> {
        let Some(path) = &self.baseline else { return Ok(None) };
        let name = path.display().to_string();
        let read = read_baseline_bytes(path)
            .map_err(|why| console.print_error(Exit::WRONG, &format!("cannot read {name}: {why}")))?;
        let results = serde_json::from_slice(&read).map_err(|error| {
            let advice = "pass a file written by `glimt bench --json FILE`";
            console.print_error(Exit::WRONG, &format!("{name} is not a baseline: {error}; {advice}"))
        })?;
        Ok(Some((name, results)))
    }

    /// Writes all files, even if some fail.
    pub(super) fn write_all(
        &self,
        results: &Results,
        progress: &BenchProgress,
        console: &Console,
        token: &CancelToken,
    ) -> Result<(), Exit> {
        let written = (0..self.files.len()).map(|index| {
            let (_, path, _) = &self.files[index];
            let written = self.write_output(index, results, progress, token);
            let bytes = written.map_err(|why| console.print_error(Exit::FAILED, &why))?;
            progress.report_written(path, bytes);
            Ok(())
        });
        written.collect::<Vec<_>>().into_iter().collect()
    }

    /// Writes one file and returns its size.
    fn write_output(
        &self,
        index: usize,
        results: &Results,
        progress: &BenchProgress,
        token: &CancelToken,
    ) -> Result<usize, String> {
        let (_, path, kind) = &self.files[index];
        let bytes = format_content(*kind, results)
            .map_err(|why| format!("cannot write {}: {why}", path.display()))?;
        let may_replace = |real: &Path| self.check_conflicts_of_output(index, real);
        let is_kept = |path: &Path| self.inputs.iter().any(|(_, input)| input == path);
        let losses = AttributeLossPolicy::Report(&|warning| {
            progress.report_written_file_warning(&warning.to_string());
        });
        let guard = ExistingFilePolicy { is_kept: &is_kept, may_replace: &may_replace, sweep: None, losses };
        let written = write::write_atomically_with_policy(path, &bytes, &guard, token);
        written.map(|()| bytes.len()).map_err(|error| error.to_string())
    }
}

/// Reads a baseline. Rejects very large files and files that are not regular.
fn read_baseline_bytes(path: &Path) -> Result<Vec<u8>, String> {
    /// Enough for the results of a million images.
    const MAX_BYTES: u64 = 256 << 20;
    let words = |error: std::io::Error| describe_io_error(&error);
    let (file, metadata) = file::open_regular_file(path)
        .map_err(words)?
        .map_err(|kind| format!("it is {}, not a regular file", kind.description()))?;
    if metadata.len() > MAX_BYTES {
        return Err(format!("it has {} bytes; the limit is {} MiB", metadata.len(), MAX_BYTES >> 20));
    }
    let mut bytes = Vec::new();
    file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(words)?;
    Ok(bytes)
}

fn format_content(kind: OutputKind, results: &Results) -> Result<Vec<u8>, String> {
    match kind {
        OutputKind::Csv => Ok(csv::format_csv(results).into_bytes()),
        OutputKind::Json => {
            Ok(output::json::to_pretty_text(results).map_err(|error| error.to_string())?.into_bytes())
        }
        OutputKind::Plot => Ok(plot::draw_svg(results)?.into_bytes()),
    }
}
