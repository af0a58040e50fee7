//! A scene's source text: the file's text followed by the `--set` values. All spans index into this text.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Severity, SourceSpan};
use super::source_files::{SourceFile, line_number_at};
use super::toml::{is_one_dotted_key_assignment, quote_toml_string};

/// File name shown in diagnostics about `--set` values.
const SET_OPTION: &str = "--set";

/// The text of a scene file, and the `--set` values.
#[derive(Clone, Debug)]
pub struct SceneText {
    all: Arc<str>,
    /// Length of the file's text, the first part of `all`.
    file: usize,
    sets: Vec<SetArg>,
    /// Whether the scene is from a foreign file. Only some of its values have a span in the file's text.
    is_foreign: bool,
    /// The files of a foreign scene. Empty if the text is a single file.
    files: Arc<[SourceFile]>,
}

/// A `--set` value: its span in the whole text, and a copy of its text for diagnostics.
#[derive(Clone, Debug)]
struct SetArg {
    span: Range<usize>,
    text: Arc<str>,
}

impl SceneText {
    /// Wraps the text of a file, without `--set` values.
    pub fn from_file_text(text: Arc<str>) -> Self {
        Self { file: text.len(), all: text, sets: Vec::new(), is_foreign: false, files: Arc::new([]) }
    }

    /// Combines a file's text with `--set` values of the form `TABLE.KEY=VALUE`. Values that are neither
    /// TOML nor numbers become strings.
    ///
    /// # Errors
    /// Returns one error per malformed value.
    pub fn with_set_args(file: Arc<str>, sets: &[String]) -> Result<Self, Vec<Diagnostic>> {
        if sets.is_empty() {
            return Ok(Self::from_file_text(file));
        }
        let (mut all, mut known, mut wrong) = (file.to_string(), Vec::new(), Vec::new());
        for set in sets {
            match set_arg_to_toml(set) {
                Some(text) => {
                    all.push('\n');
                    known
                        .push(SetArg { span: all.len()..all.len() + text.len(), text: text.as_str().into() });
                    all.push_str(&text);
                }
                None => wrong.push(malformed_set_arg_error(set)),
            }
        }
        if wrong.is_empty() {
            let (all, file, files) = (all.into(), file.len(), Arc::new([]));
            Ok(Self { all, file, sets: known, is_foreign: false, files })
        } else {
            Err(wrong)
        }
    }

    /// The file's text followed by the `--set` values.
    pub(super) fn full_text(&self) -> &Arc<str> {
        &self.all
    }

    /// The file's text.
    pub fn text_without_set_args(&self) -> &str {
        self.all.get(..self.file).unwrap_or_default()
    }

    /// Returns [`Self::text_without_set_args`] as an `Arc`. Copies the text only if there are `--set` values.
    pub fn text_without_set_args_as_arc(&self) -> Arc<str> {
        if self.sets.is_empty() { Arc::clone(&self.all) } else { self.text_without_set_args().into() }
    }

    /// Returns the byte offsets of the `--set` values.
    pub(super) fn override_arg_offsets(&self) -> impl Iterator<Item = usize> + '_ {
        self.sets.iter().map(|set| set.span.start)
    }

    /// Whether a span is in a `--set` value rather than in the file.
    pub(super) fn is_span_in_set_arg(&self, span: &Range<usize>) -> bool {
        // A newline separates the values from the file.
        span.start > self.file
    }

    /// Whether a span refers to text. In a scene from a foreign file, values without a span have an empty
    /// span at the start.
    pub(super) fn span_refers_to_text(&self, span: &Range<usize>) -> bool {
        !self.is_foreign || *span != (0..0)
    }

    /// Whether a span is in a foreign file, where the text need not match the value.
    pub(super) fn is_span_in_foreign_format(&self, span: &Range<usize>) -> bool {
        self.is_foreign && !self.is_span_in_set_arg(span)
    }

    /// Marks the text as the text of a foreign file, which is empty if the file is not text. `files` are the
    /// files that it consists of, if there are several.
    pub(super) fn mark_foreign(self, files: Arc<[SourceFile]>) -> Self {
        Self { is_foreign: true, files, ..self }
    }

    /// Returns the 1-based number of the line where a span starts, in its own file.
    pub(super) fn line_number(&self, span: &Range<usize>) -> usize {
        match self.files.iter().find_map(|file| Some((file, file.local_span(span)?))) {
            Some((file, local)) => line_number_at(&file.text, local.start),
            None => line_number_at(self.text_without_set_args(), span.start),
        }
    }

    /// Maps a span to the file at `path` or to a `--set` value. Returns no span if it does not refer to text.
    pub(super) fn resolve_span(
        &self,
        path: &Path,
        span: Range<usize>,
        label: String,
    ) -> (PathBuf, Option<SourceSpan>) {
        let set = self.sets.iter().find(|set| set.span.start <= span.start && span.end <= set.span.end);
        let (path, source, span) = match set {
            Some(SetArg { span: own, text }) => {
                (Path::new(SET_OPTION), text, span.start - own.start..span.end - own.start)
            }
            None if !self.span_refers_to_text(&span) => return (path.to_owned(), None),
            None => match self.files.iter().find_map(|file| Some((file, file.local_span(&span)?))) {
                Some((file, local)) => (file.path.as_path(), &file.text, local),
                None => (path, &self.all, span),
            },
        };
        let is_inside = source.get(span.clone()).is_some();
        let span = if is_inside { span } else { 0..0 };
        (path.to_owned(), Some(SourceSpan { source: Arc::clone(source), span, label }))
    }
}

/// Converts `TABLE.KEY=VALUE` to TOML, quoting the value if necessary. Returns `None` if the `=`, the table
/// or the key is missing.
fn set_arg_to_toml(set: &str) -> Option<String> {
    // Quoted keys may contain `=`, so try each `=`.
    const MAX_EQUALS_SIGNS: usize = 8;
    set.match_indices('=').take(MAX_EQUALS_SIGNS).find_map(|(at, _)| {
        let (key, value) = (set[..at].trim(), set[at + 1..].trim());
        let with =
            |value: &str| Some(format!("{key} = {value}")).filter(|text| is_one_dotted_key_assignment(text));
        with("0")?;
        with(value)
            .or_else(|| with(&normalize_decimal_for_toml(value)?))
            .or_else(|| with(&quote_toml_string(value)))
    })
}

/// Completes numbers such as `.5` and `5.`, which are invalid in TOML.
fn normalize_decimal_for_toml(text: &str) -> Option<String> {
    let number: f64 = text.parse().ok().filter(|number: &f64| number.is_finite())?;
    text.contains('.').then(|| format!("{number:?}"))
}

/// Error message for a malformed `--set` value.
pub(super) const MALFORMED_SET: &str = "malformed value";
/// Hint for a `--set` value without `=`.
pub(super) const MISSING_EQUALS_HELP: &str = "add `=` between the key and its value, as in render.samples=3";

fn malformed_set_arg_error(set: &str) -> Diagnostic {
    let place =
        SourceSpan { source: set.into(), span: 0..set.len(), label: "expected TABLE.KEY=VALUE".to_owned() };
    let key = set.split('=').next().unwrap_or_default();
    let help = if !set.contains('=') {
        MISSING_EQUALS_HELP
    } else if key.contains(|c: char| c.is_whitespace() || !c.is_ascii()) {
        "quote names with characters other than letters, digits, - and _, as in --set 'sphere.\"back wall\".radius=.3'"
    } else {
        "examples: render.samples=3, materials.wall.diffuse=0.5, sphere.2.radius=.3, sphere.ball.radius=.3"
    };
    Diagnostic {
        severity: Severity::Error,
        message: MALFORMED_SET.to_owned(),
        path: PathBuf::from(SET_OPTION),
        place: Some(place),
        help: Some(help.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_values_become_strings() {
        for (set, text) in [
            ("render.samples=3", "render.samples = 3"),
            (" camera.position = [0, 1,\n 4] ", "camera.position = [0, 1,\n 4]"),
            ("materials.wall.diffuse=#ff0000", "materials.wall.diffuse = \"#ff0000\""),
            ("materials.\"a=b\".diffuse=red", "materials.\"a=b\".diffuse = \"red\""),
            ("render.output=a b=c.png", "render.output = \"a b=c.png\""),
            ("render.output=", "render.output = \"\""),
            ("mesh.1.file=C:\\x\"\u{7}", "mesh.1.file = \"C:\\\\x\\\"\\U00000007\""),
            ("sphere.2.radius=.3", "sphere.2.radius = 0.3"),
            ("sphere.2.radius=-5.", "sphere.2.radius = -5.0"),
            ("render.samples=3 # few", "render.samples = 3 # few"),
            ("render.a=1\nrender.b=2", "render.a = \"1\\U0000000arender.b=2\""),
        ] {
            assert_eq!(set_arg_to_toml(set).as_deref(), Some(text), "{set}");
        }
        for wrong in
            ["", "=", "render", "render=3", "=3", "render.=3", ".samples=3", "[render]\nsamples=3", "a b.c=1"]
        {
            assert_eq!(set_arg_to_toml(wrong), None, "{wrong}");
        }
    }
}
