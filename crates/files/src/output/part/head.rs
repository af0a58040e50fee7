//! Header of a part file: the image's properties, the share of the image that the file contains, and the
//! encoding settings.

use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::{BitDepth, FilmEncodingSettings};
use crate::choice::Choice;
use crate::film::range_map::{DataBrightnessMap, DataKind};
use crate::film::tone::{ToneMapping, Tonemap, Transfer};
use crate::film::{ConvergenceModel, Film, FilmCreationError, FilmQuantity, Rect, SumOrder};

/// Header of a part or checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartHeader {
    /// Type of the file.
    pub kind: PartFileKind,
    /// Everything the image depends on, with user-visible names.
    pub identity: Vec<NamedRenderInput>,
    /// Share of the image that the file contains.
    pub share: PartShare,
    /// Properties of the image.
    pub picture: ImageHeader,
    /// Scene path relative to the part, which may differ between parts of the same image. Empty if unknown.
    #[serde(default)]
    pub scene: String,
    /// Files that the scene references, including unused ones. Paths are relative to the scene's folder.
    /// Files outside that folder are listed by name only. This list does not affect the image.
    #[serde(default)]
    pub references: Vec<String>,
}

/// Type of a part file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartFileKind {
    /// A finished part of an image.
    Part,
    /// The saved state of a render that can be resumed.
    Checkpoint,
}

impl PartFileKind {
    /// Returns the name of the type.
    pub fn name(self) -> &'static str {
        match self {
            Self::Part => "part",
            Self::Checkpoint => "checkpoint",
        }
    }
}

/// An input that an image depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedRenderInput {
    /// A scene key or a file name.
    pub name: String,
    /// Value of the key, or hash of the file's content.
    pub value: String,
}

impl PartHeader {
    /// Whether all numbers are in range.
    pub(super) fn has_valid_numbers(&self) -> bool {
        /// Maximum width, height and number of parts.
        const LIMIT: u32 = 1 << 17;
        let Self { share, picture, .. } = self;
        let [x, y, width, height] = picture.crop;
        let is_inside = |at: u32, length: u32, total: u32| {
            length > 0 && total <= LIMIT && at.checked_add(length).is_some_and(|end| end <= total)
        };
        is_inside(x, width, picture.width)
            && is_inside(y, height, picture.height)
            && (1..=share.count).contains(&share.index)
            && share.blocks.is_sorted()
            && share.blocks.last().is_none_or(|last| *last < share.block_count)
            && picture.tone.exposure.is_finite()
    }

    /// Returns the name of the input file with this hexadecimal hash, or `None` if there is no such file.
    pub(super) fn input_name_by_hash(&self, hash: &str) -> Option<&str> {
        let matches = |input: &&NamedRenderInput| input.name.starts_with(FILE) && input.value == hash;
        self.identity.iter().find(matches).map(|input| strip_file_dependency_prefix(&input.name))
    }

    /// Searches the input files, then the scene's other references, for a name that matches the end of
    /// `path`. The file need not exist. Returns the name, relative to the scene's folder.
    pub(super) fn find_input_that_is_path_suffix(&self, path: &Path) -> Option<&str> {
        let inputs = self.identity.iter().filter(|input| input.name.starts_with(FILE));
        let references = self.references.iter().map(String::as_str);
        inputs
            .map(|input| strip_file_dependency_prefix(&input.name))
            .chain(references)
            .find(|name| path_ends_with(name, path))
    }
}

/// Whether a path ends with a name. Ignores the name's components up to the last `..`.
fn path_ends_with(name: &str, path: &Path) -> bool {
    let mut end = PathBuf::new();
    for component in Path::new(name).components() {
        match component {
            Component::ParentDir => end = PathBuf::new(),
            Component::Normal(name) => end.push(name),
            Component::CurDir | Component::RootDir | Component::Prefix(_) => {}
        }
    }
    !end.as_os_str().is_empty() && path.ends_with(end)
}

/// Share of an image that a part file contains.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PartShare {
    /// Index of the part, starting at 1.
    pub index: u32,
    /// Number of parts.
    pub count: u32,
    /// Number of sample blocks in the image. 0 if parts contain complete tiles.
    pub block_count: u32,
    /// Indices of the sample blocks that this part contains in each tile, in ascending order.
    pub blocks: Vec<u32>,
}

/// Properties of the image that a part belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageHeader {
    /// Width of the full image.
    pub width: u32,
    /// Height of the full image.
    pub height: u32,
    /// Rendered region: left, top, width and height.
    pub crop: [u32; 4],
    /// Whether the noise converges as it does in photon mapping.
    pub is_by_photons: bool,
    /// Displayed quantity: `radiance`, `samples` or `error`.
    pub quantity: String,
    /// Tone mapping.
    pub tone: ToneHeader,
    /// Bits per channel in PNG and PPM files, 8 or 16.
    pub bit_depth: u8,
    /// Metadata names and values for the image file.
    pub metadata: Vec<(String, String)>,
    /// Whether the values are radiance.
    pub is_light: bool,
}

/// Tone mapping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToneHeader {
    /// Exposure in stops.
    pub exposure: f32,
    /// Name of the tone curve.
    pub curve: String,
    /// Whether the values are already display values.
    pub is_data: bool,
    /// Range mapping: `distances`, `amounts` or none.
    pub stretch: Option<String>,
}

/// Names of the quantities in part files.
const QUANTITIES: [(FilmQuantity, &str); 3] = [
    (FilmQuantity::Radiance, "radiance"),
    (FilmQuantity::Samples, "samples"),
    (FilmQuantity::Error, "error"),
];

/// Names of the range mappings in part files.
const RANGE_MAPPING_NAMES: [(DataKind, &str); 2] =
    [(DataKind::Distances, "distances"), (DataKind::Amounts, "amounts")];

impl ImageHeader {
    /// Describes the image that these settings produce from a film.
    pub fn from_film(film: &Film, finish: &FilmEncodingSettings) -> Self {
        let Rect { x, y, width, height } = film.crop_rect();
        let tone = &finish.tone;
        let kind = match tone.range_map {
            DataBrightnessMap::None => None,
            DataBrightnessMap::Unresolved(kind) | DataBrightnessMap::Resolved(kind, _) => Some(kind),
        };
        let word = |wanted: DataKind| {
            RANGE_MAPPING_NAMES.iter().find(|(kind, _)| *kind == wanted).map(|(_, word)| *word)
        };
        let quantity = QUANTITIES.iter().find(|(quantity, _)| *quantity == finish.quantity);
        Self {
            width: film.width(),
            height: film.height(),
            crop: [x, y, width, height],
            is_by_photons: film.convergence_model() == ConvergenceModel::Photons,
            quantity: quantity.map_or("radiance", |(_, word)| *word).to_owned(),
            tone: ToneHeader {
                exposure: tone.exposure_stops,
                curve: tone.curve.name().to_owned(),
                is_data: tone.transfer == Transfer::Identity,
                stretch: kind.and_then(word).map(str::to_owned),
            },
            bit_depth: match finish.bit_depth {
                BitDepth::Eight => 8,
                BitDepth::Sixteen => 16,
            },
            metadata: finish.metadata.clone(),
            is_light: finish.is_light,
        }
    }

    /// Returns the settings for encoding the image file, or `None` if a name is unknown.
    pub fn film_encoding_settings(&self) -> Option<FilmEncodingSettings> {
        let range_map = match self.tone.stretch.as_deref() {
            None => DataBrightnessMap::None,
            Some(word) => {
                DataBrightnessMap::Unresolved(RANGE_MAPPING_NAMES.iter().find(|(_, known)| *known == word)?.0)
            }
        };
        Some(FilmEncodingSettings {
            quantity: QUANTITIES.iter().find(|(_, word)| *word == self.quantity)?.0,
            tone: ToneMapping {
                exposure_stops: self.tone.exposure,
                curve: Tonemap::named(&self.tone.curve)?,
                transfer: if self.tone.is_data { Transfer::Identity } else { Transfer::Srgb },
                range_map,
            },
            bit_depth: BitDepth::try_from(self.bit_depth).ok()?,
            metadata: self.metadata.clone(),
            is_light: self.is_light,
        })
    }

    /// Creates an empty film for the image.
    ///
    /// # Errors
    /// There is not enough memory.
    pub fn create_film(&self) -> Result<Film, FilmCreationError> {
        let [x, y, width, height] = self.crop;
        let film = Film::new(self.width, self.height, Some(Rect { x, y, width, height }))?;
        Ok(match self.is_by_photons {
            true => {
                film.with_convergence_model(ConvergenceModel::Photons).with_sum_order(SumOrder::Blocked)?
            }
            false => film,
        })
    }
}

/// Describes the differences between two lists of inputs, which the messages call `here` and `there`.
pub fn render_input_differences(
    a: &[NamedRenderInput],
    b: &[NamedRenderInput],
    here: &str,
    there: &str,
) -> Vec<String> {
    let value_of = |all: &[NamedRenderInput], name: &str| {
        all.iter().find(|input| input.name == name).map(|input| input.value.clone())
    };
    let shown = |value: Option<String>| value.unwrap_or_else(|| "missing".to_owned());
    let mut names: Vec<&str> = a.iter().map(|input| input.name.as_str()).collect();
    names.extend(b.iter().map(|input| input.name.as_str()).filter(|name| value_of(a, name).is_none()));
    let differing = names.into_iter().filter(|name| value_of(a, name) != value_of(b, name));
    let differing: Vec<&str> = differing.collect();
    let is_named = differing.iter().any(|name| !is_content_hash_dependency(name));
    differing
        .iter()
        // The total hash is only useful if nothing else differs.
        .filter(|name| **name != EVERYTHING || differing.len() == 1)
        .filter(|name| !is_named || **name != EVERYTHING)
        .map(|name| match (value_of(a, name), value_of(b, name)) {
            _ if *name == EVERYTHING => "the scene's shapes, materials, lights or camera differ".to_owned(),
            (Some(_), Some(_)) if is_content_hash_dependency(name) => {
                format!("{} has different content", strip_file_dependency_prefix(name))
            }
            (a, b) if is_content_hash_dependency(name) => {
                let place = if a.is_some() { here } else { there };
                debug_assert!(a.is_some() != b.is_some());
                format!("{} is only used {place}", strip_file_dependency_prefix(name))
            }
            (Some(a), Some(b)) if *name == PROGRAM => {
                format!("it was rendered by glimt {a} {here} and glimt {b} {there}; use the same build")
            }
            (a, b) => format!("{name} is {} {here} and {} {there}", shown(a), shown(b)),
        })
        .collect()
}

/// Name of the input that identifies the program's version and build.
const PROGRAM: &str = "glimt";

/// Name of the input that contains the hash of all inputs.
pub(super) const EVERYTHING: &str = "everything";

fn is_content_hash_dependency(name: &str) -> bool {
    name.starts_with(FILE) || name == EVERYTHING
}

fn strip_file_dependency_prefix(name: &str) -> &str {
    name.strip_prefix(FILE).unwrap_or(name)
}

/// Name prefix for file inputs.
const FILE: &str = "file ";

impl NamedRenderInput {
    /// Creates an input for a setting.
    pub fn from_setting(name: &str, value: impl Into<String>) -> Self {
        Self { name: name.to_owned(), value: value.into() }
    }

    /// Creates an input for a file from its name and content hash.
    pub fn from_file(name: &str, content: impl Into<String>) -> Self {
        Self { name: format!("{FILE}{name}"), value: content.into() }
    }

    /// Creates the input that contains the hash of everything the image depends on.
    pub fn from_combined_hash(key: impl Into<String>) -> Self {
        Self { name: EVERYTHING.to_owned(), value: key.into() }
    }
}
