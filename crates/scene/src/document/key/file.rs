//! Reads file paths.

use std::io;
use std::path::{Path, PathBuf};

use super::super::super::description::Spanned;
use super::super::super::keys::key::ValueKind;
use super::super::super::nearest::nearest_name;
use super::super::super::read::{MAX_FOLDER_FILES, is_symlink, similar_file};
use super::super::super::sanitize::{escape_and_truncate, escape_invisible_chars};
use super::super::context::Issue;
use super::KeyInTable;
use crate::system::describe_io_error;
use crate::system::file::{self, FileKind};

impl KeyInTable<'_> {
    /// Reads the path of an existing file and resolves it against the scene's folder.
    pub(in super::super) fn existing_file(&self) -> Option<Spanned<PathBuf>> {
        self.existing_file_with_extension(self.allowed_file_extensions())
    }

    /// Like [`Self::existing_file`], for a file with one of the extensions `endings`. If the list is empty,
    /// any file is allowed.
    pub(in super::super) fn existing_file_with_extension(
        &self,
        endings: &[&str],
    ) -> Option<Spanned<PathBuf>> {
        let text = self.string("a file path")?;
        let span = self.value_span()?;
        if text.is_empty() {
            self.context
                .report(Issue::error(span, format!("`{}` is empty; expected a file path", self.info.name)));
            return None;
        }
        if !endings.is_empty() && !self.check_extension(text, endings) {
            return None;
        }
        let path = self.context.resolve_path(text);
        if self.context.is_in_memory_file(text) {
            return Some(Spanned { value: path, span });
        }
        let may_be_meant = |found: &Path| {
            endings.is_empty() || endings.contains(&lowercase_extension(&found.to_string_lossy()).as_str())
        };
        if let Err((message, is_missing)) = check_regular_file(&path) {
            let help = is_missing.then(|| {
                match self
                    .context
                    .run_limited_name_search(MAX_FOLDER_FILES, || similar_file(&path, may_be_meant))
                {
                    Some(near) => {
                        format!(
                            "did you mean {}?",
                            escape_invisible_chars(&to_scene_relative_path(text, &near))
                        )
                    }
                    None => "paths are relative to the scene file".to_owned(),
                }
            });
            self.context.report(Issue::error(span, message).with_optional_help(help));
            return None;
        }
        Some(Spanned { value: path, span })
    }

    /// Extensions of the key's files.
    pub(in super::super) fn allowed_file_extensions(&self) -> &'static [&'static str] {
        if let ValueKind::File(extensions) = self.info.kind { extensions } else { &[] }
    }

    /// Checks a path's extension and reports an error if it is wrong.
    pub(in super::super) fn check_extension(&self, text: &str, endings: &[&str]) -> bool {
        let ending = lowercase_extension(text);
        if endings.contains(&ending.as_str()) {
            return true;
        }
        let Some(span) = self.value_span() else { return false };
        let list = endings.iter().map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ");
        let shown = escape_and_truncate(&ending, 16);
        let message = match ending.as_str() {
            "" => format!("`{}` needs a file extension", self.info.name),
            _ => format!("`{}`: unknown file extension .{shown}", self.info.name),
        };
        let mut issue = Issue::error(span, message).with_help(format!("expected one of {list}"));
        if let Some(near) = nearest_name(&ending, endings.iter().copied()) {
            issue = issue.with_label(format!("did you mean .{near}?"));
        }
        self.context.report(issue);
        false
    }
}

/// Returns a suggested file's path as written in scenes: relative to the scene's folder.
fn to_scene_relative_path(text: &str, near: &Path) -> String {
    let name = near.file_name().unwrap_or(near.as_os_str());
    Path::new(text).with_file_name(name).to_string_lossy().into_owned()
}

/// Returns a path's extension in lowercase, or an empty string.
fn lowercase_extension(text: &str) -> String {
    Path::new(text).extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// Checks that a file is a regular file. The error contains a message, and a flag that is set if the file is
/// missing.
fn check_regular_file(path: &Path) -> Result<(), (String, bool)> {
    let shown = escape_and_truncate(&path.to_string_lossy(), 200);
    match file::file_kind_and_metadata(path) {
        Ok((FileKind::Regular, _)) => Ok(()),
        Ok((kind, _)) => Err((format!("{shown} is {}, not a file", kind.description()), false)),
        Err(error) if error.kind() == io::ErrorKind::NotFound && is_symlink(path) => {
            Err((format!("{shown} is a symbolic link to a file that does not exist"), false))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Err((format!("file not found: {shown}"), true))
        }
        Err(error) => Err((format!("cannot read {shown}: {}", describe_io_error(&error)), false)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn suggestions_are_relative_to_the_scene() {
        let near = Path::new("scenes/../assets/textures/bricks.png");
        assert_eq!(
            to_scene_relative_path("../assets/textures/brick.png", near),
            "../assets/textures/bricks.png"
        );
        assert_eq!(to_scene_relative_path("brick.png", Path::new("scenes/bricks.png")), "bricks.png");
    }
}
