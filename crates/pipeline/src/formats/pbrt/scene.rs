//! Writes the statements of a pbrt scene as the tables of a scene document.

use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::lexer::{PbrtError, PbrtResult};
use super::parameters::Text;
use super::state::{MaterialReference, Statements};
use super::texture_nodes::TextureResolver;
use crate::assets::Companion;
use crate::control::CancelToken;
use crate::formats::foreign::import::CopiedFile;
use crate::formats::foreign::notes::NoteCollector;
use crate::formats::foreign::{ForeignOptions, MissingAssetMode};
use crate::formats::model::UsedNames;
use crate::math::DMat4;
use crate::scene::{InMemoryFile, SceneDocumentBuilder};
use crate::system::file::{FileKind, file_kind_and_metadata};

/// Maximum number of errors to report.
const MAX_ERRORS: usize = 50;

/// Maps the pbrt scene's files to the document's file names.
pub(super) struct AssetPathResolver<'a> {
    /// Folder of the pbrt file.
    pub(super) source: PathBuf,
    /// Name of the pbrt file.
    pub(super) file: String,
    /// Folder, relative to the imported scene, into which `glimt import` copies all files. `None` to use the
    /// original files.
    pub(super) import: Option<&'a str>,
    /// Files to copy.
    pub(super) copies: Vec<CopiedFile>,
    names: UsedNames,
    known: HashMap<PathBuf, String>,
}

impl<'a> AssetPathResolver<'a> {
    pub(super) fn new(path: &Path, import: Option<&'a str>) -> Self {
        let source = path.parent().unwrap_or(Path::new("")).to_owned();
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Self { source, file, import, copies: Vec::new(), names: UsedNames::default(), known: HashMap::new() }
    }

    /// Returns the document's name for an existing file, and schedules the copy for an import.
    fn place_existing_file(&mut self, file: &str) -> String {
        let Some(folder) = self.import else { return file.to_owned() };
        let path = self.source.join(file);
        if let Some(known) = self.known.get(&path) {
            return known.clone();
        }
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = self.unique_name(folder, &stem, &extension);
        self.copies.push(CopiedFile { name: name.clone(), source: path.clone() });
        self.known.insert(path, name.clone());
        name
    }

    fn unique_name(&mut self, folder: &str, stem: &str, extension: &str) -> String {
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let plain: String = stem.chars().map(plain).take(60).collect();
        format!("{folder}/{}.{extension}", self.names.make_unique(&plain.to_lowercase(), "asset"))
    }
}

/// Identity of a material table: the pbrt material and the formatted [`ShapeProperties`].
///
/// [`ShapeProperties`]: super::material_tables::ShapeProperties
pub(super) type MaterialIdentity = (MaterialReference, String);

/// A material in the document.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum LoweredMaterial {
    Table {
        name: String,
        /// Whether it uses texture coordinates or tangents.
        needs_uv: bool,
        /// Whether its surfaces enclose an interior, as dielectrics do.
        has_inside: bool,
    },
    /// Shapes with this material have no surface.
    Invisible,
    /// The material has an error, which has been reported.
    Invalid,
}

/// Writes the scene document.
pub(super) struct PbrtConverter<'a> {
    pub(super) statements: &'a Statements,
    pub(super) resolver: TextureResolver<'a>,
    pub(super) document: SceneDocumentBuilder,
    pub(super) notes: NoteCollector,
    pub(super) errors: Vec<PbrtError>,
    pub(super) assets: AssetPathResolver<'a>,
    pub(super) options: &'a ForeignOptions,
    pub(super) token: &'a CancelToken,
    pub(super) companions: Vec<Companion>,
    /// Names of texture tables by their formatted keys.
    pub(super) textures: HashMap<String, String>,
    pub(super) texture_names: UsedNames,
    pub(super) material_names: UsedNames,
    pub(super) materials: HashMap<MaterialIdentity, LoweredMaterial>,
    /// Names of generated files by content hash.
    generated_names: HashMap<[u8; 32], String>,
}

impl<'a> PbrtConverter<'a> {
    pub(super) fn new(
        statements: &'a Statements,
        resolver: TextureResolver<'a>,
        document: SceneDocumentBuilder,
        assets: AssetPathResolver<'a>,
        options: &'a ForeignOptions,
        token: &'a CancelToken,
    ) -> Self {
        Self {
            statements,
            resolver,
            document,
            notes: NoteCollector::default(),
            errors: Vec::new(),
            assets,
            options,
            token,
            companions: Vec::new(),
            textures: HashMap::new(),
            texture_names: UsedNames::default(),
            material_names: UsedNames::default(),
            materials: HashMap::new(),
            generated_names: HashMap::new(),
        }
    }

    /// Writes all tables. Stops after too many errors.
    pub(super) fn convert_all(&mut self) {
        let file = self.assets.file.clone();
        self.document.add_comment_above_next_table(format!("{file}, as glimt shows it."));
        let is_rendered = self.convert_settings_and_camera();
        self.value_or_record_error(is_rendered);
        self.convert_lights();
        self.convert_objects();
    }

    /// Records the error of a failed operation, or returns the result of a successful one.
    pub(super) fn value_or_record_error<T>(&mut self, result: PbrtResult<T>) -> Option<T> {
        match result {
            Ok(value) => Some(value),
            Err(error) => {
                if self.errors.len() < MAX_ERRORS && !self.errors.contains(&error) {
                    self.errors.push(*error);
                }
                None
            }
        }
    }

    /// Whether the maximum number of errors has been reached.
    pub(super) fn has_too_many_errors(&self) -> bool {
        self.errors.len() >= MAX_ERRORS
    }

    /// Returns the `file` key's value for an existing file.
    pub(super) fn register_asset_file(&mut self, file: &Text) -> String {
        self.document.set_span_for_next_values(file.span.clone());
        self.assets.place_existing_file(&file.text)
    }

    /// Path of an asset in the pbrt scene.
    pub(super) fn asset_path(&self, file: &str) -> PathBuf {
        self.assets.source.join(file)
    }

    /// Whether a file is missing and `--missing note` tolerates that. If so, adds a substitution.
    pub(super) fn tolerate_if_missing(&mut self, file: &Text, what: &str, substitute: &str) -> bool {
        let is_file =
            matches!(file_kind_and_metadata(&self.asset_path(&file.text)), Ok((FileKind::Regular, _)));
        if is_file || self.options.missing != MissingAssetMode::Note {
            return false;
        }
        self.companions.push(Companion { path: self.asset_path(&file.text), hash: None, stamp: None });
        self.notes.note_lighting_substitution(&format!("missing {what}"), substitute, file.span.clone());
        true
    }

    /// Adds a file that exists only in memory, and returns the `file` key's value for it.
    pub(super) fn add_generated_file(&mut self, stem: &str, extension: &str, bytes: Vec<u8>) -> String {
        let hash = *blake3::hash(&bytes).as_bytes();
        if let Some(known) = self.generated_names.get(&hash) {
            return known.clone();
        }
        let stem = if stem.is_empty() { "part" } else { stem };
        let name = match self.assets.import {
            Some(folder) => self.assets.unique_name(folder, stem, extension),
            // Derive the name only from the content, so that edits elsewhere do not invalidate caches.
            None => format!(
                "{}/{stem}-{}.{extension}",
                self.assets.file,
                &blake3::Hash::from(hash).to_hex()[..16]
            ),
        };
        let bytes: Arc<[u8]> = bytes.into();
        self.document.add_in_memory_file(name.clone(), InMemoryFile { bytes, hash });
        self.generated_names.insert(hash, name.clone());
        name
    }

    /// Returns the transform at the start time. Adds a substitution if the transform at the end time differs.
    pub(super) fn still_transform(&mut self, transform: [DMat4; 2], span: Range<usize>) -> DMat4 {
        let [start, end] = transform;
        if start != end {
            self.notes.note_substitution("motion", "only the transform at the start time is used", span);
        }
        start
    }
}
