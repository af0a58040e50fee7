//! `--report`: what a render did, as JSON.

use std::path::Path;

use crate::output::write::atomic;
use crate::pipeline::protocol::Report;

/// Write it.
///
/// # Errors
/// Why not, with the file's name.
pub(super) fn write(path: &Path, report: &Report) -> Result<(), String> {
    let mut text = serde_json::to_vec_pretty(report)
        .map_err(|error| format!("cannot write {}: {error}", path.display()))?;
    text.push(b'\n');
    atomic(path, &text).map_err(|error| error.to_string())
}
