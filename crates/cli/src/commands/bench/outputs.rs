//! The files of `glimt bench`, held against those that it reads and against each other.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::progress::Said;
use crate::args::BenchArgs;
use crate::bench::{Results, csv, plot};
use crate::console::Console;
use crate::control::CancelToken;
use crate::exit::Exit;
use crate::lower::STANDARD;
use crate::output::write::{self, Guard};
use crate::output::{
    self, FileIdentity, Losses, OutputError, is_one_file, replaced_json, replaced_plot, replaced_table,
};
use crate::system::{describe_error, file};

/// Files to write, and files that must not be written.
pub(super) struct Outputs {
    /// Option, file, and what it holds.
    files: Vec<(&'static str, PathBuf, Kind)>,
    /// Role of each input in this call, and its file.
    inputs: Vec<(&'static str, PathBuf)>,
    baseline: Option<PathBuf>,
    /// Whether files that glimt did not write may be replaced.
    replaces_foreign: bool,
}

#[derive(Clone, Copy)]
enum Kind {
    Csv,
    Json,
    Plot,
}

impl Outputs {
    /// Reports the errors that are known before the work.
    pub(super) fn of(args: &BenchArgs, scenes: &[PathBuf], console: &Console) -> Result<Self, Exit> {
        let all = [
            ("--csv", &args.csv, Kind::Csv),
            ("--json", &args.json, Kind::Json),
            ("--plot", &args.plot, Kind::Plot),
        ];
        let files: Vec<_> =
            all.into_iter().filter_map(|(option, file, kind)| Some((option, file.clone()?, kind))).collect();
        let scenes = scenes.iter().map(|scene| ("a scene of this call", scene.clone()));
        let references = args.reference.iter().map(|file| ("a reference of this call", file.clone()));
        let baseline = args.baseline.iter().map(|file| ("the baseline of this call", file.clone()));
        let inputs = scenes.chain(references).chain(baseline).collect();
        let (baseline, replaces_foreign) = (args.baseline.clone(), args.force);
        let outputs = Self { files, inputs, baseline, replaces_foreign };
        for (index, (_, path, kind)) in outputs.files.iter().enumerate() {
            outputs.check(index, path, *kind).map_err(|error| match error {
                OutputError::Refused { reason } => console.fail(Exit::WRONG, &reason),
                error => console.fail(Exit::FAILED, &error.to_string()),
            })?;
        }
        Ok(outputs)
    }

    fn check(&self, index: usize, path: &Path, kind: Kind) -> Result<(), OutputError> {
        self.may_replace(index, path)?;
        let is_svg = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("svg"));
        if path == Path::new(STANDARD) && !matches!(kind, Kind::Plot) {
            let (option, ..) = self.files[index];
            let reason = format!("{option} {STANDARD} is standard output, which has the tables: name a file");
            return Err(OutputError::Refused { reason });
        }
        if matches!(kind, Kind::Plot) && !is_svg {
            let reason =
                format!("cannot write {}: the plot is an SVG; use a name that ends in .svg", path.display());
            return Err(OutputError::Refused { reason });
        }
        output::check_place(path)
    }

    /// The file of this number, which leads to `real`, must be no input and no other output.
    fn may_replace(&self, index: usize, real: &Path) -> Result<(), OutputError> {
        if FileIdentity::of(real).is_none() {
            return Ok(());
        }
        let is_it = |path: &Path| is_one_file(real, path);
        let (option, path, _) = &self.files[index];
        let refused = |what: &str| {
            let reason = format!(
                "cannot write {}: it is {what}; name another file with {option} FILE",
                path.display()
            );
            Err(OutputError::Refused { reason })
        };
        if let Some((what, _)) = self.inputs.iter().find(|(_, input)| is_it(input)) {
            return refused(what);
        }
        if let Some((other, ..)) = self.files[..index].iter().find(|(_, other, _)| is_it(other)) {
            return refused(&format!("the file of {other}"));
        }
        if self.replaces_foreign { Ok(()) } else { self.check_own(index, real) }
    }

    /// Refuses files that glimt did not write: `--csv scene.toml` lacks its own file's name.
    fn check_own(&self, index: usize, real: &Path) -> Result<(), OutputError> {
        let (option, path, kind) = &self.files[index];
        let replaced = match kind {
            Kind::Csv => replaced_table(real, csv::HEAD),
            // What a baseline can be read from; no run writes one without scenes.
            Kind::Json => {
                replaced_json(real, "a file of results", |found: &Results| !found.scenes.is_empty())
            }
            Kind::Plot => replaced_plot(real, &plot::AXES),
        };
        let Some(why) = replaced.why_kept() else { return Ok(()) };
        let way_out = format!("name another file with {option} FILE, or --force replaces it");
        Err(OutputError::Refused { reason: format!("cannot write {}: {why}; {way_out}", path.display()) })
    }

    /// The older run with its name.
    pub(super) fn baseline(&self, console: &Console) -> Result<Option<(String, Results)>, Exit> {
        let Some(path) = &self.baseline else { return Ok(None) };
        let name = path.display().to_string();
        let read =
            bytes_of(path).map_err(|why| console.fail(Exit::WRONG, &format!("cannot read {name}: {why}")))?;
        let results = serde_json::from_slice(&read).map_err(|error| {
            let way_out = "name a file that `glimt bench --json FILE` wrote";
            console.fail(Exit::WRONG, &format!("{name} is no baseline: {error}; {way_out}"))
        })?;
        Ok(Some((name, results)))
    }

    /// All of them; one that cannot be written does not keep the others from it.
    pub(super) fn write(
        &self,
        results: &Results,
        said: &Said,
        console: &Console,
        token: &CancelToken,
    ) -> Result<(), Exit> {
        let written = (0..self.files.len()).map(|index| {
            let (_, path, _) = &self.files[index];
            let written = self.write_one(index, results, said, token);
            let bytes = written.map_err(|why| console.fail(Exit::FAILED, &why))?;
            said.written(path, bytes);
            Ok(())
        });
        written.collect::<Vec<_>>().into_iter().collect()
    }

    /// Gives its bytes; the error says why not.
    fn write_one(
        &self,
        index: usize,
        results: &Results,
        said: &Said,
        token: &CancelToken,
    ) -> Result<usize, String> {
        let (_, path, kind) = &self.files[index];
        let bytes =
            content(*kind, results).map_err(|why| format!("cannot write {}: {why}", path.display()))?;
        let may_replace = |real: &Path| self.may_replace(index, real);
        let is_kept = |path: &Path| self.inputs.iter().any(|(_, input)| input == path);
        let losses = Losses::Told(&|what| said.warned(&what));
        let guard = Guard { is_kept: &is_kept, may_replace: &may_replace, losses };
        let written = write::atomic_until(path, &bytes, &guard, token);
        written.map(|()| bytes.len()).map_err(|error| error.to_string())
    }
}

/// All bytes of a file of results; refuses anything but a regular file of limited size.
fn bytes_of(path: &Path) -> Result<Vec<u8>, String> {
    /// Bytes of the results of a million pictures.
    const MOST: u64 = 256 << 20;
    let words = |error: std::io::Error| describe_error(&error);
    let (file, metadata) = file::open(path)
        .map_err(words)?
        .map_err(|kind| format!("it is {}, not a regular file", kind.words()))?;
    if metadata.len() > MOST {
        return Err(format!(
            "it has {} bytes, more than the {} MiB that are read",
            metadata.len(),
            MOST >> 20
        ));
    }
    let mut bytes = Vec::new();
    file.take(MOST).read_to_end(&mut bytes).map_err(words)?;
    Ok(bytes)
}

fn content(kind: Kind, results: &Results) -> Result<Vec<u8>, String> {
    match kind {
        Kind::Csv => Ok(csv::csv(results).into_bytes()),
        Kind::Json => Ok(output::json::file(results).map_err(|error| error.to_string())?.into_bytes()),
        Kind::Plot => Ok(plot::svg(results)?.into_bytes()),
    }
}
