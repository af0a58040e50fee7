//! Collects notes (features that glimt defines differently) and substitutions (features without an
//! equivalent). Each is reported once, at its first occurrence and with the number of occurrences.

use std::collections::HashMap;
use std::ops::Range;

use crate::scene::SourceFiles;
use crate::scene::diagnostic::{Diagnostic, Severity};

/// How the rendering of a feature differs from the original renderer's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum NoteKind {
    /// The feature has no equivalent, and its replacement changes the lighting of the scene.
    LightSubstitution,
    /// Any other replacement of a feature without an equivalent.
    Substitution,
    /// The feature exists in glimt, with a slightly different definition.
    Note,
}

/// The notes and substitutions of a scene.
#[derive(Debug, Default)]
pub(crate) struct NoteCollector {
    notes: Vec<Note>,
    by_text: HashMap<(NoteKind, String), usize>,
}

#[derive(Debug)]
struct Note {
    kind: NoteKind,
    /// The feature, such as "`curve`".
    subject: String,
    /// What replaces the feature, or how it differs.
    text: String,
    span: Range<usize>,
    count: usize,
}

impl NoteCollector {
    /// Adds an occurrence of a feature. `subject` names the feature, and `text` states what replaces it or
    /// how it differs. Occurrences with the same subject and text are merged and counted.
    pub(crate) fn add(&mut self, kind: NoteKind, subject: &str, text: &str, span: Range<usize>) {
        let key = (kind, format!("{subject}\n{text}"));
        match self.by_text.get(&key) {
            Some(&index) => self.notes[index].count += 1,
            None => {
                self.by_text.insert(key, self.notes.len());
                let (subject, text) = (subject.to_owned(), text.to_owned());
                self.notes.push(Note { kind, subject, text, span, count: 1 });
            }
        }
    }

    /// Adds a note about a feature that glimt defines differently.
    pub(crate) fn note(&mut self, subject: &str, text: &str, span: Range<usize>) {
        self.add(NoteKind::Note, subject, text, span);
    }

    /// Adds a substitution.
    pub(crate) fn note_substitution(&mut self, subject: &str, text: &str, span: Range<usize>) {
        self.add(NoteKind::Substitution, subject, text, span);
    }

    /// Adds a substitution that changes the lighting.
    pub(crate) fn note_lighting_substitution(&mut self, subject: &str, text: &str, span: Range<usize>) {
        self.add(NoteKind::LightSubstitution, subject, text, span);
    }

    /// Returns the notes and the substitutions as warnings. Substitutions that change the lighting are first.
    pub(crate) fn into_diagnostics(mut self, sources: &SourceFiles) -> (Vec<Diagnostic>, Vec<Diagnostic>) {
        self.notes.sort_by_key(|note| note.kind);
        let (mut notes, mut substitutions) = (Vec::new(), Vec::new());
        for note in self.notes {
            let count = if note.count == 1 { String::new() } else { format!("{} × ", note.count) };
            let light = match note.kind {
                NoteKind::LightSubstitution => "the lighting changes: ",
                NoteKind::Substitution | NoteKind::Note => "",
            };
            let message = format!("{light}{count}{}: {}", note.subject, note.text);
            let diagnostic = sources.diagnostic(Severity::Warning, note.span, message, "", None);
            match note.kind {
                NoteKind::Note => notes.push(diagnostic),
                NoteKind::LightSubstitution | NoteKind::Substitution => substitutions.push(diagnostic),
            }
        }
        (notes, substitutions)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn notes_are_counted_and_light_is_first() {
        let (mut sources, mut notes) = (SourceFiles::default(), NoteCollector::default());
        sources.add(Path::new("a.xml"), "one\ntwo\n".into());
        let second = sources.add(Path::new("b.xml"), "three\nfour".into());
        notes.note("`bump`", "fades", 0..3);
        notes.note_substitution("`curve`", "skipped", 4..7);
        notes.note_substitution("`curve`", "skipped", 0..3);
        notes.note_lighting_substitution("`hair`", "diffuse", second + 6..second + 10);
        let (notes, substitutions) = notes.into_diagnostics(&sources);
        assert_eq!(notes.iter().map(|one| &*one.message).collect::<Vec<_>>(), ["`bump`: fades"]);
        let messages: Vec<_> = substitutions.iter().map(|one| &*one.message).collect();
        assert_eq!(messages, ["the lighting changes: `hair`: diffuse", "2 × `curve`: skipped"]);
        assert_eq!(substitutions[0].path, Path::new("b.xml"));
        assert_eq!(substitutions[0].place.as_ref().map(|place| place.span.clone()), Some(6..10));
    }
}
