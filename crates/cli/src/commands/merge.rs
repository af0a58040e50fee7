//! `glimt merge`: merges parts into an image.

mod inputs;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use indicatif::ProgressBar;
use rayon::ThreadPool;
use serde_json::json;

use self::inputs::{RenderInputFiles, possible_scene_paths};
use crate::args::{MergeArgs, ProgressMode};
use crate::console::{Console, stdout_columns_or_default};
use crate::control::{CancelToken, Canceled};
use crate::exit::Exit;
use crate::film::Film;
use crate::film::tone::tone_map_to_8_bits;
use crate::merge_block::InPlaceTerminalBlock;
use crate::output::part::{self, MergedParts, PartError, PartFile};
use crate::output::write::{ExistingFilePolicy, write_atomically_with_policy};
use crate::output::{
    self, AttributeLossPolicy, FilmEncodingSettings, Format, OutputError, may_be_same_file, scene_path,
};
use crate::progress::{bar_style_from_template, json_line};
use crate::scene::sanitize::{escape_and_truncate, escape_invisible_chars};
use crate::signals;
use crate::system::threads::start_logical_cpu_pool;
use crate::tui::{NamedImage, images_as_text};

/// Polling interval for new parts.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

pub(crate) fn run(args: &MergeArgs, console: &Console) -> Exit {
    let pool = match start_logical_cpu_pool() {
        Ok(pool) => pool,
        Err(message) => return console.print_error(Exit::FAILED, &message),
    };
    signals::run_cancelable_by_signals(console, |token| {
        MergeCommand { args, console, token, pool: &pool }.run()
    })
}

/// The context of a running `merge` command.
struct MergeCommand<'a> {
    args: &'a MergeArgs,
    console: &'a Console,
    token: &'a CancelToken,
    pool: &'a ThreadPool,
}

impl MergeCommand<'_> {
    fn run(&self) -> Exit {
        self.run_and_print_errors().unwrap_or_else(|exit| exit)
    }

    fn run_and_print_errors(&self) -> Result<Exit, Exit> {
        let format = self.check_output()?;
        let parts = if self.args.watch { self.wait_for_parts()? } else { self.open_parts()? };
        let inputs = RenderInputFiles::new(&parts, &self.args.out, self.token);
        self.check_output_is_not_scene_input(&inputs)?;
        let merged = self.merge_parts(&parts, self.args.partial, "merge")?;
        let Some(finish) = parts.first().and_then(|part| part.head.picture.film_encoding_settings()) else {
            return Err(self.console.print_error(Exit::WRONG, "the parts contain no output settings"));
        };
        self.write_image(format, finish, &merged, &parts, &inputs)?;
        self.report_missing_parts(&merged);
        Ok(Exit::DONE)
    }

    /// Checks that the output can be written and is not one of the parts.
    fn check_output(&self) -> Result<Format, Exit> {
        let out = &self.args.out;
        let name = out.display();
        if part::is_part_or_checkpoint(out) {
            let message = format!("cannot write {name}: it is a part; name the output before the parts");
            return Err(self.console.print_error(Exit::WRONG, &message));
        }
        if self.args.parts.iter().any(|part| may_be_same_file(part, out)) {
            let message = format!("{name} is both the output and a part");
            return Err(self.console.print_error(Exit::WRONG, &message));
        }
        let format = Format::from_path(out)
            .map_err(|error| self.console.print_error(Exit::WRONG, &error.to_string()))?;
        output::check_image_target(out)
            .map_err(|error| self.console.print_error(Exit::FAILED, &error.to_string()))?;
        Ok(format)
    }

    /// Checks that the output does not replace an input file of the render.
    fn check_output_is_not_scene_input(&self, inputs: &RenderInputFiles<'_>) -> Result<(), Exit> {
        match self.message_if_render_input(inputs, &self.args.out) {
            Ok(None) => Ok(()),
            Ok(Some(message)) => Err(self.console.print_error(Exit::WRONG, &message)),
            Err(Canceled) => Err(Exit::FAILED),
        }
    }

    /// Returns an error message if the file at `path` is an input file of the parts or their scene.
    fn message_if_render_input(
        &self,
        inputs: &RenderInputFiles<'_>,
        path: &Path,
    ) -> Result<Option<String>, Canceled> {
        let why = inputs.reason_not_to_overwrite(path)?;
        Ok(why.map(|why| format!("cannot write {}: {why}; choose another output", self.args.out.display())))
    }

    /// Opens all parts and reports every invalid one.
    fn open_parts(&self) -> Result<Vec<PartFile>, Exit> {
        let mut bar = StepProgressBar::new(self.args.progress, self.console, "read");
        let (mut parts, mut wrong) = (Vec::new(), Vec::new());
        for (index, path) in self.args.parts.iter().enumerate() {
            match PartFile::open_and_validate(path, self.token) {
                Ok(part) => parts.push(part),
                Err(error) if error.is_too_many_open_files() => {
                    bar.end();
                    return Err(self.report_open_file_limit(parts.len()));
                }
                Err(PartError::Unreadable { source, .. })
                    if self.args.partial && source.kind() == std::io::ErrorKind::NotFound => {}
                Err(PartError::Canceled(_)) => return Err(Exit::FAILED),
                Err(error) => wrong.push(error),
            }
            bar.update(index + 1, self.args.parts.len());
        }
        bar.end();
        wrong.iter().for_each(|error| self.console.print_line_to_stderr(&format!("error: {error}")));
        match (wrong.is_empty(), parts.is_empty()) {
            (false, _) => Err(Exit::WRONG),
            (true, true) => Err(self.console.print_error(Exit::WRONG, "none of the parts exist")),
            (true, false) => Ok(parts),
        }
    }

    /// Reports that no more parts can be opened because the limit on open files has been reached.
    fn report_open_file_limit(&self, opened: usize) -> Exit {
        let all = self.args.parts.len();
        let message = format!(
            "too many open files: only {opened} of {all} parts could be opened; raise the limit (ulimit -n)"
        );
        self.console.print_error(Exit::FAILED, &message)
    }

    /// Waits until all parts are complete, showing the image so far.
    fn wait_for_parts(&self) -> Result<Vec<PartFile>, Exit> {
        let mut parts: Vec<PartFile> = Vec::new();
        let mut waiting: Vec<AwaitedPart> = self.args.parts.iter().cloned().map(AwaitedPart::new).collect();
        let mut reported = None;
        let mut block = InPlaceTerminalBlock::default();
        loop {
            let mut rest = Vec::new();
            for mut awaited in waiting {
                let looked = awaited.open_if_complete(self.token).map_err(|error| {
                    match error.is_too_many_open_files() {
                        true => self.report_open_file_limit(parts.len()),
                        false => self.report_part_error(&error),
                    }
                });
                match looked? {
                    Some(part) => parts.push(part),
                    None => rest.push(awaited),
                }
            }
            waiting = rest;
            let unfinished: Vec<&Path> =
                waiting.iter().filter_map(AwaitedPart::existing_path_if_incomplete).collect();
            let state = (parts.len(), unfinished.iter().map(|path| path.to_path_buf()).collect::<Vec<_>>());
            if reported.as_ref() != Some(&state) {
                let is_new = reported.is_none_or(|(count, _)| count != parts.len());
                let words = self.describe_completed_parts(parts.len(), &unfinished);
                if self.redraws_image_in_place() {
                    self.redraw_terminal_image(&parts, &words, &mut block)?;
                } else if is_new {
                    // Report mismatched parts as soon as they appear.
                    part::check_and_list_missing(&parts).map_err(|error| self.report_part_error(&error))?;
                }
                self.report_completed_parts(parts.len(), &unfinished, &words);
                reported = Some(state);
            }
            if waiting.is_empty() {
                return Ok(parts);
            }
            self.sleep_until_next_poll()?;
        }
    }

    fn sleep_until_next_poll(&self) -> Result<(), Exit> {
        let end = Instant::now() + POLL_INTERVAL;
        while Instant::now() < end {
            if self.token.is_canceled() {
                return Err(Exit::FAILED);
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }

    /// Describes how many parts are complete, and names the incomplete parts.
    fn describe_completed_parts(&self, count: usize, unfinished: &[&Path]) -> String {
        let names: Vec<_> = unfinished.iter().map(|path| path.to_string_lossy()).collect();
        let incomplete = match names.as_slice() {
            [] => String::new(),
            [name] => format!("; {name} is incomplete"),
            names => format!("; {} are incomplete", names.join(", ")),
        };
        format!("{count} of {} parts{incomplete}", self.args.parts.len())
    }

    /// Reports the parts on stderr, unless the terminal already shows the same text above the image.
    fn report_completed_parts(&self, count: usize, unfinished: &[&Path], words: &str) {
        match self.args.progress {
            ProgressMode::None => {}
            ProgressMode::Json => {
                let names: Vec<_> = unfinished.iter().map(|path| path.to_string_lossy()).collect();
                let total = self.args.parts.len();
                json_line(&json!({ "event": "parts", "parts": count, "total": total, "unfinished": names }));
            }
            ProgressMode::Auto if self.redraws_image_in_place() && self.console.is_terminal => {}
            ProgressMode::Auto | ProgressMode::Plain => self.console.print_line_to_stderr(words),
        }
    }

    /// Whether to redraw the image in place. This requires a terminal on which no progress lines are printed
    /// between redraws.
    fn redraws_image_in_place(&self) -> bool {
        let has_lines = match self.args.progress {
            ProgressMode::Plain | ProgressMode::Json => self.console.is_terminal,
            ProgressMode::Auto | ProgressMode::None => false,
        };
        std::io::stdout().is_terminal() && !has_lines
    }

    /// Redraws the image merged from these parts, with a title.
    fn redraw_terminal_image(
        &self,
        parts: &[PartFile],
        words: &str,
        block: &mut InPlaceTerminalBlock,
    ) -> Result<(), Exit> {
        let words = escape_invisible_chars(words);
        let columns = stdout_columns_or_default();
        let finish = parts.first().and_then(|part| part.head.picture.film_encoding_settings());
        let lines = match finish {
            None => {
                part::check_and_list_missing(parts).map_err(|error| self.report_part_error(&error))?;
                String::new()
            }
            Some(finish) => {
                let merged = self.merge_parts(parts, true, "show")?;
                self.pool.install(|| {
                    let image = finish.extract_quantity(&merged.film);
                    let picture = tone_map_to_8_bits(&image, &finish.tone.with_image_range(&image));
                    images_as_text(&[NamedImage { name: words.to_string(), picture }], self.args.color, true)
                })
            }
        };
        // Narrow terminals do not show an image.
        let lines =
            if lines.is_empty() { format!("{}\n", escape_and_truncate(&words, columns)) } else { lines };
        self.console.print_trusted_text(&block.redraw_to_string(&lines, columns));
        Ok(())
    }

    fn merge_parts(
        &self,
        parts: &[PartFile],
        is_partial: bool,
        what: &'static str,
    ) -> Result<MergedParts, Exit> {
        let mut bar = StepProgressBar::new(self.args.progress, self.console, what);
        let tell = |tile: usize, film: &Film| bar.update(tile, film.tile_count());
        let merged = part::merge_parts(parts, is_partial, self.token, tell);
        bar.end();
        merged.map_err(|error| self.report_part_error(&error))
    }

    fn report_part_error(&self, error: &PartError) -> Exit {
        match error {
            PartError::Canceled(_) => Exit::FAILED,
            PartError::Film(_) => self.console.print_error(Exit::FAILED, &error.to_string()),
            PartError::Unreadable { .. }
            | PartError::NotRegular { .. }
            | PartError::Foreign { .. }
            | PartError::Version { .. }
            | PartError::Unfinished { .. }
            | PartError::Damaged { .. }
            | PartError::Kind { .. }
            | PartError::Other { .. }
            | PartError::Doubled { .. }
            | PartError::Missing { .. } => self.console.print_error(Exit::WRONG, &error.to_string()),
        }
    }

    fn write_image(
        &self,
        format: Format,
        mut finish: FilmEncodingSettings,
        merged: &MergedParts,
        parts: &[PartFile],
        inputs: &RenderInputFiles<'_>,
    ) -> Result<(), Exit> {
        let (out, token) = (&self.args.out, self.token);
        set_relative_scene_path(&mut finish, parts, out);
        let film = &merged.film;
        let may_replace = |real: &Path| {
            let is_given = self.args.parts.iter().any(|part| may_be_same_file(part, real));
            let is_part = is_given || part::is_part_or_checkpoint(real);
            let why = is_part.then(|| format!("cannot write {}: it is a part", out.display()));
            let why = why.map_or_else(|| self.message_if_render_input(inputs, real), |why| Ok(Some(why)))?;
            why.map_or(Ok(()), |reason| Err(OutputError::Refused { reason }))
        };
        let is_kept = |path: &Path| self.args.parts.iter().any(|part| may_be_same_file(part, path));
        let tell = |warning| self.console.print_line_to_stderr(&format!("warning: {warning}"));
        let guard = ExistingFilePolicy {
            is_kept: &is_kept,
            may_replace: &may_replace,
            sweep: None,
            losses: AttributeLossPolicy::Report(&tell),
        };
        let bytes = self.pool.install(|| {
            finish.encode_with_film_metadata(film, &finish.extract_quantity(film), &[], format, token)
        });
        let written = bytes.and_then(|bytes| write_atomically_with_policy(out, &bytes, &guard, token));
        written.map_err(|error| match error {
            OutputError::Canceled(_) => Exit::FAILED,
            other => self.console.print_error(Exit::FAILED, &other.to_string()),
        })?;
        if self.args.progress != ProgressMode::None {
            let (width, height) = (film.width(), film.height());
            self.console.print_line_to_stderr(&format!("wrote {} ({width}×{height})", out.display()));
        }
        Ok(())
    }

    fn report_missing_parts(&self, merged: &MergedParts) {
        if !merged.missing.is_empty() {
            let missing = part::missing_parts_message(&merged.missing, merged.count);
            self.console.print_line_to_stderr(&format!("warning: {missing}; merged the others"));
        }
    }
}

/// Records the scene's path relative to the output, as an unsharded render does.
fn set_relative_scene_path(finish: &mut FilmEncodingSettings, parts: &[PartFile], out: &Path) {
    let Some((_, scene)) = finish.metadata.iter_mut().find(|(name, _)| name == "glimt:scene") else { return };
    if let Some(path) = possible_scene_paths(parts, out).find(|path| path.is_file()) {
        *scene = scene_path::relative_to_image(&path, out);
    }
}

/// A part that is not yet complete.
struct AwaitedPart {
    path: PathBuf,
    /// Length and modification time of the incomplete file, or `None` if the file does not exist.
    unfinished: Option<(u64, Option<SystemTime>)>,
}

impl AwaitedPart {
    fn new(path: PathBuf) -> Self {
        Self { path, unfinished: None }
    }

    /// Opens the part, or returns `None` if it is missing or incomplete.
    ///
    /// # Errors
    /// Returns an error if the part is invalid.
    fn open_if_complete(&mut self, token: &CancelToken) -> Result<Option<PartFile>, PartError> {
        let now = std::fs::metadata(&self.path).ok().map(|found| (found.len(), found.modified().ok()));
        // Do not read an unchanged file again.
        if now.is_none() || now == self.unfinished {
            self.unfinished = now;
            return Ok(None);
        }
        match PartFile::open_and_validate(&self.path, token) {
            Ok(part) => Ok(Some(part)),
            Err(PartError::Unfinished { .. }) => {
                self.unfinished = now;
                Ok(None)
            }
            Err(PartError::Unreadable { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
                self.unfinished = None;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// Returns the part's path if the file exists but is incomplete.
    fn existing_path_if_incomplete(&self) -> Option<&Path> {
        self.unfinished.is_some().then_some(&self.path)
    }
}

/// Progress bar and JSON events for one step of a merge.
struct StepProgressBar {
    what: &'static str,
    bar: Option<ProgressBar>,
    is_json: bool,
    reported: usize,
}

impl StepProgressBar {
    fn new(progress: ProgressMode, console: &Console, what: &'static str) -> Self {
        let template = "  {wide_bar} {percent:>3}% {msg}";
        let has_bar = progress == ProgressMode::Auto && console.is_terminal;
        let bar = has_bar
            .then(|| ProgressBar::new(1).with_style(bar_style_from_template(template)).with_message(what));
        Self { what, bar, is_json: progress == ProgressMode::Json, reported: 0 }
    }

    fn update(&mut self, done: usize, total: usize) {
        /// Maximum number of progress reports per step.
        const STEPS: usize = 100;
        let step = done * STEPS / total.max(1);
        if step == self.reported {
            return;
        }
        self.reported = step;
        if let Some(bar) = &self.bar {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
        if self.is_json {
            let fraction = done as f64 / total.max(1) as f64;
            json_line(&json!({ "event": "progress", "stage": self.what, "fraction": fraction }));
        }
    }

    fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}
