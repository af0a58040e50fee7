//! Converts diagnostics to the LSP format.

use std::path::Path;

use lsp_types::{Diagnostic, DiagnosticSeverity, Range};

use super::document::OpenDocument;
use crate::control::CancelToken;
use crate::pipeline::IncrementalSceneChecker;
use crate::pipeline::protocol::Failure;
use crate::scene::diagnostic::{self, Severity};
use crate::scene::{parse, read_scene_file_text};

/// Returns the diagnostics for a document's text.
pub(super) fn text_diagnostics(document: &OpenDocument) -> Vec<Diagnostic> {
    let found = parse(document.text.as_str().into(), &document.path).diagnostics;
    found.iter().map(|one| to_lsp_diagnostic(document, one)).collect()
}

/// Returns the diagnostics for the file and the files it references, as in `glimt check`. Returns `None`
/// if the file differs from the open document, if it cannot be read, or if the token is canceled.
pub(super) fn scene_and_asset_diagnostics(
    document: &OpenDocument,
    checker: &mut IncrementalSceneChecker,
    token: &CancelToken,
) -> Option<Vec<Diagnostic>> {
    if *read_scene_file_text(&document.path).ok()? != *document.text {
        return None;
    }
    let found = match checker.check(&document.path, &[], token) {
        Ok(checked) => checked.warnings,
        Err(Failure::Scene(diagnostics)) => diagnostics,
        Err(Failure::Work(_)) => return None,
    };
    Some(found.iter().map(|one| to_lsp_diagnostic(document, one)).collect())
}

fn to_lsp_diagnostic(document: &OpenDocument, one: &diagnostic::Diagnostic) -> Diagnostic {
    let is_in_document = one.path == document.path;
    let place = one.place.as_ref();
    let range =
        place.filter(|_| is_in_document).map_or(Range::default(), |place| document.to_lsp_range(&place.span));
    let label = place.map(|place| place.label.as_str()).filter(|label| !label.is_empty());
    let mut message = if is_in_document {
        one.message.clone()
    } else {
        format!("{}: {}", file_name(&one.path), one.message)
    };
    for (more, between) in [(label, ": "), (one.help.as_deref(), "\n")] {
        if let Some(more) = more {
            message.push_str(between);
            message.push_str(more);
        }
    }
    let severity = match one.severity {
        Severity::Error => DiagnosticSeverity::ERROR,
        Severity::Warning => DiagnosticSeverity::WARNING,
    };
    let source = Some("glimt".to_owned());
    Diagnostic { range, severity: Some(severity), source, message, ..Diagnostic::default() }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
