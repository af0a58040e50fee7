//! Finds the meshes and images of a scene.

use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::reader::SceneReader;
use super::xml::truncate_for_message;
use crate::assets::Companion;
use crate::formats::foreign::options::MissingAssetMode;
use crate::system::file::{FileStamp, open_regular_file};

impl SceneReader<'_> {
    /// Searches for a file. Watches the places before the one where it is found, or all of them if it does
    /// not exist.
    pub(super) fn find_file(&mut self, name: &str, span: &Range<usize>) -> Option<PathBuf> {
        let own_folder = self.files.path_of_span(span).and_then(Path::parent);
        let own = own_folder.map(|folder| folder.join(name));
        // Scenes written on Windows have backslashes in paths.
        let plain = name.replace('\\', "/");
        let names = [name, plain.as_str()];
        let folders = self.folders;
        let candidates =
            names.iter().flat_map(|name| folders.iter().rev().map(move |folder| folder.join(name)));
        for candidate in candidates.chain(own) {
            if candidate.is_file() {
                return Some(candidate);
            }
            if self.watched_files.insert(candidate.clone()) {
                self.companions.push(Companion { path: candidate, hash: None, stamp: None });
            }
        }
        None
    }

    /// Returns a property of a file, and watches the file because the document depends on the property.
    /// `inspect` reads it, once per file and `part`.
    pub(super) fn inspect_watched(
        &mut self,
        path: &Path,
        part: Option<i64>,
        inspect: impl FnOnce(&Self) -> bool,
    ) -> bool {
        let key = (path.to_owned(), part);
        if let Some(known) = self.inspected_files.get(&key) {
            return *known;
        }
        // The stamp is older than the inspected content.
        let stamp = FileStamp::from_path(path);
        if self.watched_files.insert(path.to_owned()) {
            self.companions.push(Companion { path: path.to_owned(), hash: None, stamp });
        }
        let found = inspect(self);
        self.inspected_files.insert(key, found);
        found
    }

    /// Reads and watches a file of at most `limit` bytes to which the document does not refer. Returns `None`
    /// if it is not readable.
    pub(super) fn read_watched_file(&mut self, path: &Path, limit: u64) -> Option<Vec<u8>> {
        let stamp = FileStamp::from_path(path);
        let mut bytes = Vec::new();
        let opened = open_regular_file(path).ok().and_then(Result::ok);
        let read = opened.and_then(|(file, _)| file.take(limit + 1).read_to_end(&mut bytes).ok());
        let is_read = read.is_some() && bytes.len() as u64 <= limit;
        let hash = is_read.then(|| *blake3::hash(&bytes).as_bytes());
        self.companions.push(Companion { path: path.to_owned(), hash, stamp });
        is_read.then_some(bytes)
    }

    /// Returns the name by which the document refers to an asset. Reports an error if the file does not
    /// exist, unless missing files are allowed.
    pub(super) fn resolve_asset_reference(
        &mut self,
        name: &str,
        span: &Range<usize>,
        kind: &str,
    ) -> Option<String> {
        let path = self.asset_path(name, span, kind)?;
        Some(self.asset_reference(&path))
    }

    /// Returns the path of an asset. Reports an error if the file does not exist, unless missing files are
    /// allowed.
    pub(super) fn asset_path(&mut self, name: &str, span: &Range<usize>, kind: &str) -> Option<PathBuf> {
        if let Some(found) = self.find_file(name, span) {
            return Some(found);
        }
        match self.options.missing {
            MissingAssetMode::Error => {
                let help = "add the file, or use --missing note to render without it".to_owned();
                self.report_error(
                    span.clone(),
                    format!("{kind} not found: {}", truncate_for_message(name)),
                    Some(help),
                );
            }
            MissingAssetMode::Note => {
                let text = match kind {
                    "image" => "not found; replaced by gray",
                    "spectrum" => "not found; replaced by the default value",
                    _ => "not found; left out",
                };
                self.notes.note_lighting_substitution(
                    &format!("{kind} {}", truncate_for_message(name)),
                    text,
                    span.clone(),
                );
            }
        }
        None
    }

    /// Returns the name by which the document refers to an existing file.
    pub(super) fn asset_reference(&mut self, path: &Path) -> String {
        let Some(folder) = self.asset_folder else {
            let scene_folder = self.path.parent().unwrap_or(Path::new(""));
            let relative = path.strip_prefix(scene_folder).unwrap_or(path);
            // A path that does not start with the scene's folder is relative to the working directory.
            let is_relative = relative == path && !path.is_absolute() && !scene_folder.as_os_str().is_empty();
            let absolute = is_relative.then(|| std::path::absolute(path).ok()).flatten();
            return absolute.as_deref().unwrap_or(relative).to_string_lossy().into_owned();
        };
        if let Some(known) = self.asset_names.get(path) {
            return known.clone();
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let plain: String = stem
            .chars()
            .map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' })
            .take(60)
            .collect();
        // The number precedes the extension. The result may be the name of another file.
        let mut name = format!("{plain}.{extension}");
        let mut next = 2;
        while !self.used_asset_names.insert(name.clone()) {
            name = format!("{plain}_{next}.{extension}");
            next += 1;
        }
        let name = format!("{folder}/{name}");
        self.asset_names.insert(path.to_owned(), name.clone());
        name
    }
}
