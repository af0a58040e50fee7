//! The text of a scene: the file, and behind it what the call sets, so that every place is a range of one text.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Place, Severity};
use super::toml::is_key_value;

/// Name in place of a file in messages about values that the call sets.
const CALL: &str = "--set";

/// A scene file and what the call sets.
#[derive(Clone, Debug)]
pub struct Source {
    all: Arc<str>,
    /// Bytes of the file.
    file: usize,
    sets: Vec<Set>,
    /// Whether the text was made of a model: its lines are in no file.
    is_made: bool,
}

/// A value that the call sets: its part of the text, and the same as a text of its own.
#[derive(Clone, Debug)]
struct Set {
    span: Range<usize>,
    text: Arc<str>,
}

impl Source {
    /// A file as it is.
    pub fn file(text: Arc<str>) -> Self {
        Self { file: text.len(), all: text, sets: Vec::new(), is_made: false }
    }

    /// A file with texts of the form `TABLE.KEY=VALUE`. A value that is neither TOML nor a number is taken for a text.
    ///
    /// # Errors
    /// Each text that does not have that form.
    pub fn with_sets(file: Arc<str>, sets: &[String]) -> Result<Self, Vec<Diagnostic>> {
        if sets.is_empty() {
            return Ok(Self::file(file));
        }
        let (mut all, mut known, mut wrong) = (file.to_string(), Vec::new(), Vec::new());
        for set in sets {
            match key_value(set) {
                Some(text) => {
                    all.push('\n');
                    known.push(Set { span: all.len()..all.len() + text.len(), text: text.as_str().into() });
                    all.push_str(&text);
                }
                None => wrong.push(malformed(set)),
            }
        }
        if wrong.is_empty() {
            Ok(Self { all: all.into(), file: file.len(), sets: known, is_made: false })
        } else {
            Err(wrong)
        }
    }

    /// The file and what is set.
    pub(super) fn all(&self) -> &Arc<str> {
        &self.all
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        self.all.get(..self.file).unwrap_or_default()
    }

    /// [`Self::text`], to be kept: shared, unless the call sets anything.
    pub fn shared_text(&self) -> Arc<str> {
        if self.sets.is_empty() { Arc::clone(&self.all) } else { self.text().into() }
    }

    /// Beginnings of the values that the call sets.
    pub(super) fn sets(&self) -> impl Iterator<Item = usize> + '_ {
        self.sets.iter().map(|set| set.span.start)
    }

    /// The same as the text of a model's scene.
    pub(super) fn made(self) -> Self {
        Self { is_made: true, ..self }
    }

    /// A place of the file at `path`, or of what is set, and what holds it. `None` for a place of a text that is in no file.
    pub(super) fn place(&self, path: &Path, span: Range<usize>, label: String) -> (PathBuf, Option<Place>) {
        let set = self.sets.iter().find(|set| set.span.start <= span.start && span.end <= set.span.end);
        let (path, source, span) = match set {
            Some(Set { span: own, text }) => {
                (Path::new(CALL), text, span.start - own.start..span.end - own.start)
            }
            None if self.is_made => return (path.to_owned(), None),
            None => (path, &self.all, span),
        };
        let is_inside = source.get(span.clone()).is_some();
        let span = if is_inside { span } else { 0..0 };
        (path.to_owned(), Some(Place { source: Arc::clone(source), span, label }))
    }
}

/// The text as TOML: with its value as it stands, or as a text in quotes. None: it has no key in a table, or no `=`.
fn key_value(set: &str) -> Option<String> {
    // Keys in quotes may have some.
    const MOST_EQUALS_SIGNS: usize = 8;
    set.match_indices('=').take(MOST_EQUALS_SIGNS).find_map(|(at, _)| {
        let (key, value) = (set[..at].trim(), set[at + 1..].trim());
        let with = |value: &str| Some(format!("{key} = {value}")).filter(|text| is_key_value(text));
        with("0")?;
        with(value).or_else(|| with(&number(value)?)).or_else(|| with(&quoted(value)))
    })
}

/// A number without digits before or after its point, as TOML writes it.
fn number(text: &str) -> Option<String> {
    let number: f64 = text.parse().ok().filter(|number: &f64| number.is_finite())?;
    text.contains('.').then(|| format!("{number:?}"))
}

/// A basic string of TOML.
pub fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control.is_control() => quoted.push_str(&format!("\\U{:08x}", u32::from(control))),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

fn malformed(set: &str) -> Diagnostic {
    let place =
        Place { source: set.into(), span: 0..set.len(), label: "this is not TABLE.KEY=VALUE".to_owned() };
    let key = set.split('=').next().unwrap_or_default();
    let help = if !set.contains('=') {
        "there is no `=` between what to set and its value, as in render.samples=3"
    } else if key.contains(|c: char| c.is_whitespace() || !c.is_ascii()) {
        "a name of more than letters, digits, - and _ stands in quotes, as in --set 'sphere.\"back wall\".radius=.3'"
    } else {
        "such as render.samples=3, materials.wall.diffuse=0.5, sphere.2.radius=.3 or sphere.ball.radius=.3"
    };
    Diagnostic {
        severity: Severity::Error,
        message: "this does not say what to set".to_owned(),
        path: PathBuf::from(CALL),
        place: Some(place),
        help: Some(help.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_value_of_toml_is_a_text() {
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
            assert_eq!(key_value(set).as_deref(), Some(text), "{set}");
        }
        for wrong in
            ["", "=", "render", "render=3", "=3", "render.=3", ".samples=3", "[render]\nsamples=3", "a b.c=1"]
        {
            assert_eq!(key_value(wrong), None, "{wrong}");
        }
    }
}
